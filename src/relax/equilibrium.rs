//! What a relaxation returns: the shape, and everything that judges it.

use crate::shape::RodShape;
use crate::undulation::Undulation;
use glam::DVec3;

/// How a run ended: one word per way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// At rest in a stable equilibrium, within the tolerance.
    Converged,
    /// As `Converged`, but a saddle was met on the way: the leaf was pushed
    /// off along the unstable mode and came to rest elsewhere.
    ConvergedAfterSaddle,
    /// At rest within the tolerance in an unstable equilibrium, and kept
    /// there because that was asked for.
    Saddle,
    /// At rest, but the finest grid allowed does not reach the tolerance.
    ToleranceNotReached,
    /// The step limit came before rest.
    NotAtRest,
    /// The equations are singular: at a bifurcation, or where the leaf can move
    /// without resistance.
    Singular,
    /// Energy grew beyond what the method allows, or a value was not finite.
    Diverged,
}

impl Outcome {
    /// The word used in `summary.json`.
    pub fn word(self) -> &'static str {
        match self {
            Outcome::Converged => "converged",
            Outcome::ConvergedAfterSaddle => "converged-after-saddle",
            Outcome::Saddle => "saddle",
            Outcome::ToleranceNotReached => "tolerance-not-reached",
            Outcome::NotAtRest => "not-at-rest",
            Outcome::Singular => "singular",
            Outcome::Diverged => "diverged",
        }
    }

    /// Whether the leaf is at rest within the tolerance (exit status 0).
    pub fn is_success(self) -> bool {
        matches!(
            self,
            Outcome::Converged | Outcome::ConvergedAfterSaddle | Outcome::Saddle
        )
    }
}

/// Work done by a solver, counted so that tests can pin it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Accepted steps (time steps or Newton iterations).
    pub steps: usize,
    /// Factorisations of a leaf matrix, rod by rod or sparse.
    pub factorizations: usize,
    /// Evaluations of all internal forces of the leaf.
    pub force_evaluations: usize,
    /// Iterations of the conjugate gradients, all steps together.
    pub cg_iterations: usize,
}

/// A saddle that was met on the way to rest, and left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Saddle {
    /// Its energy.
    pub energy: f64,
    /// Its number of negative eigenvalues (Morse index).
    pub negative_eigenvalues: usize,
    /// Position of the joint tip, or of the first rod's.
    pub tip: DVec3,
}

/// What was solved, and what it shows to be dispensable.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Model {
    /// Rods solved for; the others are their mirror images.
    pub rods: usize,
    /// Whether in their plane, which the leaf does not leave.
    pub planar: bool,
    /// Largest displacement, in units of length, that would follow from
    /// neglecting shear, to first order, on the coarsest grid.
    pub shear: Option<f64>,
    /// The same of stretch.
    pub stretch: Option<f64>,
}

/// A way in which the leaf moves by itself, without damping and by so little
/// that forces change in proportion: sin(omega t) times its shape, or
/// exp(gamma t) where the equilibrium is unstable.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// omega^2, or -gamma^2 if negative: the eigenvalue of the energy's Hessian
    /// over the masses, per time squared.
    pub eigenvalue: f64,
    /// Bound on its error; `None` on a single grid.
    pub error: Option<f64>,
    /// Displacement of the nodes of [`Equilibrium::curves`], one list per rod.
    /// The largest is as long as the longest rod, but of a mode that turns the
    /// rods without displacing them, of which the largest rotation is 1.
    pub displacement: Vec<Vec<DVec3>>,
    /// Rotation vector of these nodes, along the lab axes, radians.
    pub rotation: Vec<Vec<DVec3>>,
}

impl Mode {
    /// Angular frequency omega, radians per time; `None` if it is unstable.
    pub fn frequency(&self) -> Option<f64> {
        (self.eigenvalue >= 0.0).then(|| self.eigenvalue.sqrt())
    }

    /// Rate gamma at which the leaf leaves an unstable equilibrium, per time.
    pub fn growth(&self) -> Option<f64> {
        (self.eigenvalue < 0.0).then(|| (-self.eigenvalue).sqrt())
    }

    /// Whether the eigenvalue cannot be told from zero.
    pub fn is_neutral(&self) -> bool {
        self.error
            .is_some_and(|error| self.eigenvalue.abs() <= error)
    }
}

/// A leaf at rest (or as far as it came), in the units of its scenario.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// Name of the scenario.
    pub scenario: String,
    /// Name of the method.
    pub method: &'static str,
    /// How the run ended.
    pub outcome: Outcome,
    /// What would help, when the run did not succeed: one sentence for the user.
    pub remark: Option<String>,
    /// Segments per rod of each grid used, coarse to fine; none if shot.
    pub segments: Vec<usize>,
    /// Intervals of the shooting.
    pub intervals: Option<usize>,
    /// Wanted accuracy, relative to the largest rod length.
    pub tolerance: f64,
    /// Largest unbalanced nodal force or moment, in units of A/L^2 and A/L
    /// (A: the leaf's mean bending stiffness, L: largest rod length). Of the
    /// shooting: the largest defect ([`crate::bvp::Solution::defect`]).
    pub residual: f64,
    /// Bound on the error of the positions, in units of length; `None` on a
    /// single grid, which has nothing to compare with.
    pub error_estimate: Option<f64>,
    /// Total potential energy.
    pub energy: f64,
    /// Whether the tips share one point.
    pub joined: bool,
    /// The joint tip alone, or one tip per rod.
    pub tips: Vec<DVec3>,
    /// Sum over the rods of the force each passes to its tip.
    pub tip_force_sum: DVec3,
    /// Morse index: negative eigenvalues of the energy's Hessian. `None` if
    /// the leaf is not at rest.
    pub negative_eigenvalues: Option<usize>,
    /// The lowest modes, ascending, none left out. `None` if they were not asked
    /// for or not found, the leaf is not at rest, or it was shot.
    pub modes: Option<Vec<Mode>>,
    /// Whether the shapes of the modes were asked for.
    pub mode_shapes: bool,
    /// A saddle that was met and left.
    pub saddle: Option<Saddle>,
    /// What was solved.
    pub model: Model,
    /// Work done.
    pub work: Work,
    /// Time of the solve alone, in seconds.
    pub wall_seconds: f64,
    /// Fractions of the length at which `rods` are given, base to tip.
    pub stations: Vec<f64>,
    /// Best values at the stations, extrapolated where several grids were used.
    pub rods: Vec<RodShape>,
    /// Centerlines on the finest grid, one per rod, for drawing.
    pub curves: Vec<Vec<DVec3>>,
    /// Waves and twist of the veins on the finest grid.
    pub undulation: Undulation,
}

impl Equilibrium {
    /// Whether the equilibrium is stable: no negative eigenvalue.
    pub fn stable(&self) -> Option<bool> {
        self.negative_eigenvalues.map(|count| count == 0)
    }
}
