//! An independent method for the same equilibrium: the paper's boundary-value problem by
//! multiple shooting.
//!
//! It shares with the relaxation only the checked scenario and, with its error estimate, the
//! coefficients of a Runge-Kutta method: no grid, no element, no linear algebra. A solution
//! found by both is therefore not an artifact of either.
//!
//! **Unknown functions.** The paper integrates 18 functions per rod: r, the nine
//! components of three directors, n and m along the directors, by eqs (1) to (6)
//! and the nine equations d_i' = u x d_i. These do not keep the directors orthonormal,
//! which the paper names as its difficulty. Here orientation is a unit
//! quaternion, normalized after every step, and n and m are components
//! along the lab axes, in which their balance contains no frame: 13 functions.
//!
//! **Boundary conditions.** (a) and (c) fix r and the directors at the base;
//! n and m there are the unknowns, 6 N in all. (b), (d) and (e) are 6 N
//! conditions at the tip: all moments vanish (or equal the given one), all
//! positions agree with the first rod's, all forces sum up to the given one.
//!
//! **Initial-value problems** are integrated by the explicit Runge-Kutta method
//! of order 8 of Dormand and Prince with step control. Sensitivities satisfy the
//! linearized equations, integrated with the same steps.
//!
//! **Multiple shooting.** Perturbations can grow beyond machine precision from base to
//! tip: like exp(L sqrt(T/A2)) in a vein under tension T. The length is
//! therefore divided into intervals over which growth stays below a thousand, the
//! state at the beginning of each is unknown too, and the linear equations
//! are condensed without forming the product of all sensitivities.
//! [`ShootingOptions::intervals`] = 1 is plain single shooting, to show where it fails.
//!
//! **Tissue** acts on both its veins. Where it is rigid, rates of strains that vanish are conditions on n and m
//! at every sigma, and what the integration carries are momenta: n and m, and what the tissue takes up from
//! there to the tip. Conditions at the tip hold for them as they are.
//!
//! **Newton's method** is damped by an affine-invariant test. It starts
//! from a relaxed leaf, or from arcs by continuation: a leaf whose rest shape is
//! those arcs solves the equations without loads, and is changed step by step
//! into the scenario's.
//!
//! **Error.** Every problem is solved with two tolerances; the difference is the
//! estimate ([`ShootingSolution::error`]). Near a bifurcation [`ShootingSolution::neutral`] is
//! the direction in which the leaf can move without resistance.
//!
//! This file has the requests to the boundary-value solver and its results.

mod equations;
mod follower_loads;
mod integrate;
mod intervals;
mod newton;
mod rod_state;
mod sensitivities;
mod solve;
mod tissue;
mod tissue_stresses;

use crate::memory::TooMuch;
use crate::run::{Limit, UnmodelledFeature};
use crate::shape::{Difference, RodShape};
use crate::shooting::integrate::UnboundedSolution;
pub use crate::shooting::solve::{check_models, solve};
use glam::DVec3;
use serde::Serialize;
use std::fmt;
use std::ops::AddAssign;

/// Work of the shooting, counted so that tests can check it exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ShootingCounts {
    /// Number of corrections.
    pub iterations: usize,
    /// Linearizations: sensitivities of all intervals, and their factorization.
    pub linearizations: usize,
    /// Steps of the integrator.
    pub steps: usize,
    /// Evaluations of the slopes of the whole leaf.
    pub slopes: usize,
}

impl AddAssign for ShootingCounts {
    fn add_assign(&mut self, other: ShootingCounts) {
        self.iterations += other.iterations;
        self.linearizations += other.linearizations;
        self.steps += other.steps;
        self.slopes += other.slopes;
    }
}

/// Progress of a shooting.
#[derive(Clone, Copy, Debug)]
pub struct CorrectionProgress {
    /// Part of the present change from the leaf of arcs to the scenario's (of its loads, or of its
    /// stiffness) that is done, from 0 to 1; 1 for a start near the leaf.
    pub lambda: f64,
    /// Number of corrections for the present solution.
    pub iteration: usize,
    /// Part of the linearization for the next correction that is done, from 0 to 1.
    pub linearized: f64,
    /// The largest component of the last correction, in the units of the unknowns;
    /// infinite before the first.
    pub size: f64,
    /// The size below which corrections have converged.
    pub convergence_size: f64,
}

/// Counts the work of a shooting and reports its progress.
struct ShootingLog<'p> {
    work: ShootingCounts,
    /// Part of the present change of the leaf of arcs that is done.
    lambda: f64,
    /// Called for each correction.
    progress: &'p mut dyn FnMut(&CorrectionProgress),
}

/// Displacements below this part of the largest are not mentioned.
const MENTIONED_DISPLACEMENT_FRACTION: f64 = 0.2;

/// The start of a solution.
#[derive(Clone, Copy, Debug)]
pub enum ShootingStart<'s> {
    /// No given start: the leaf of arcs, followed by continuation.
    Arcs,
    /// The shape of the leaf at some stations, in the scenario's units.
    Leaf {
        /// Fractions of the length, from 0 to 1.
        stations: &'s [f64],
        /// One shape per rod.
        rods: &'s [RodShape],
    },
}

/// Required precision of a solution.
#[derive(Clone, Copy, Debug)]
pub enum RequiredPrecision {
    /// Estimated error of the positions relative to the longest rod, or the best that
    /// double precision allows: see [`ShootingSolution::error`].
    EstimatedError(f64),
    /// Local error allowed per integration step, in dimensionless form.
    LocalError(f64),
}

/// Options of the shooting.
#[derive(Clone, Debug)]
pub struct ShootingOptions<'s> {
    /// The start.
    pub start: ShootingStart<'s>,
    /// Fractions of the length at which the solution is returned, from 0 to 1.
    pub stations: &'s [f64],
    /// The required precision.
    pub precision: RequiredPrecision,
    /// Number of intervals; `None`: as many as the growth of perturbations needs.
    pub intervals: Option<usize>,
    /// Time limit of Newton's method.
    pub limit: Limit,
    /// Whether shooting gives up where Newton's method does not converge as it does near a solution: for
    /// a start that is one.
    pub gives_up: bool,
}

impl<'s> ShootingOptions<'s> {
    /// Options with automatic intervals and without a time limit.
    pub fn new(
        start: ShootingStart<'s>,
        stations: &'s [f64],
        precision: RequiredPrecision,
    ) -> Self {
        ShootingOptions {
            start,
            stations,
            precision,
            intervals: None,
            limit: Limit::default(),
            gives_up: false,
        }
    }
}

/// A direction that the equations leave undetermined, or nearly so: the leaf
/// is at a bifurcation, or its equilibria form a family.
#[derive(Clone, Debug, PartialEq)]
pub struct NeutralDirection {
    /// Smallest singular value of the condensed equations over the largest.
    pub ratio: f64,
    /// Displacement of every rod along it at the stations, scaled so that the largest
    /// is 1.
    pub displacement: Vec<Vec<DVec3>>,
}

/// A solution of the boundary-value problem, in the units of the scenario.
#[derive(Clone, Debug)]
pub struct ShootingSolution {
    /// Fractions of the length.
    pub stations: Vec<f64>,
    /// The shape there, one per rod.
    pub rods: Vec<RodShape>,
    /// Total potential energy (a dead moment has none).
    pub energy: f64,
    /// Estimated global error: the difference from a solution with local errors
    /// larger by two orders of magnitude, plus one local error.
    pub error: Difference,
    /// Largest jump between intervals or violation of a condition at the tip,
    /// relative to lengths, radians, and the forces and moments of each rod.
    pub defect: f64,
    /// Ends of the intervals as fractions of the length, from 0 to 1.
    pub intervals: Vec<f64>,
    /// Decimal logarithm of the growth of perturbations from base to tip: the
    /// sum over the intervals.
    pub growth: f64,
    /// Smallest singular value of the condensed equations over the largest.
    pub condition: f64,
    /// The corresponding direction, where the equations are nearly singular.
    pub neutral: Option<NeutralDirection>,
    /// Why no attempt to reach the accuracy with smaller local errors succeeded, if this is the
    /// solution before it.
    pub unsharpened: Option<ShootingFailureReason>,
    /// Work done.
    pub work: ShootingCounts,
}

/// Growth over an interval to which a failure is attributed, as a power of ten.
const TOO_MUCH_GROWTH: f64 = 5.0;

/// Why there is no solution.
#[derive(Clone, Debug, PartialEq)]
pub enum ShootingFailureReason {
    /// An initial-value problem grows without bound before its interval ends.
    Unbounded {
        /// Fraction of the length that the solution reached.
        sigma: f64,
        /// Whether the number of intervals was given.
        fixed: bool,
        /// Whether the start was a leaf at rest.
        from_leaf: bool,
    },
    /// Newton's method does not converge.
    NoConvergence {
        /// Size of the last correction, in the units of the unknowns.
        correction: f64,
        /// Decimal logarithm of the largest growth over one interval.
        growth: f64,
        /// Whether the number of intervals was given.
        fixed: bool,
        /// Whether the start was a leaf at rest.
        from_leaf: bool,
    },
    /// Corrections from a leaf at rest do not decrease as they do near a solution: rounding, in
    /// perturbations that grow, leaves no smaller ones.
    Rounding {
        /// Size of the last correction, in the units of the unknowns.
        correction: f64,
        /// Decimal logarithm of the growth of perturbations from base to tip.
        growth: f64,
    },
    /// A linearization would take too much work: not begun.
    TooMuchWork {
        /// Decimal logarithm of the growth of perturbations from base to tip, at most.
        growth: f64,
    },
    /// The equations are singular.
    Singular(NeutralDirection),
    /// The necessary number of intervals takes too much memory.
    TooMuchMemory(TooMuch),
    /// The time allowed was over, or the run was cancelled.
    OutOfTime,
    /// The boundary-value problem does not contain all of the scenario.
    Unmodelled(UnmodelledFeature),
}

impl From<UnmodelledFeature> for ShootingFailureReason {
    fn from(unmodelled: UnmodelledFeature) -> Self {
        ShootingFailureReason::Unmodelled(unmodelled)
    }
}

impl From<TooMuch> for ShootingFailureReason {
    fn from(too_much: TooMuch) -> Self {
        ShootingFailureReason::TooMuchMemory(too_much)
    }
}

impl From<UnboundedSolution> for ShootingFailureReason {
    fn from(UnboundedSolution { sigma }: UnboundedSolution) -> Self {
        ShootingFailureReason::Unbounded {
            sigma,
            fixed: false,
            from_leaf: false,
        }
    }
}

impl ShootingFailureReason {
    /// What may help is known where the number of intervals and the start are.
    fn in_context(mut self, given: bool, leaf: bool) -> Self {
        if let ShootingFailureReason::Unbounded {
            fixed, from_leaf, ..
        }
        | ShootingFailureReason::NoConvergence {
            fixed, from_leaf, ..
        } = &mut self
        {
            (*fixed, *from_leaf) = (given, leaf);
        }
        self
    }

    /// What a user may change, in words.
    fn advice(&self) -> &'static str {
        match *self {
            ShootingFailureReason::Unbounded { fixed: true, .. } => "use more intervals",
            ShootingFailureReason::NoConvergence {
                fixed: true,
                growth,
                ..
            } if growth > TOO_MUCH_GROWTH => "use more intervals",
            ShootingFailureReason::Unbounded {
                from_leaf: true, ..
            } => "more intervals than are allowed would be needed",
            ShootingFailureReason::NoConvergence {
                from_leaf: true, ..
            } => "lower the load",
            _ => "lower the load, or start from the relaxed leaf",
        }
    }
}

impl fmt::Display for ShootingFailureReason {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let advice = self.advice();
        match self {
            ShootingFailureReason::Unbounded { sigma, .. } => write!(
                f,
                "integrated from the start, the leaf grows out of all bounds at {sigma:.3} of its length: {advice}"
            ),
            ShootingFailureReason::NoConvergence {
                correction, growth, ..
            } if *growth > TOO_MUCH_GROWTH => write!(
                f,
                "Newton's method stops at corrections of {correction:.1e}; perturbations grow 10^{growth:.0} times over an interval: {advice}"
            ),
            ShootingFailureReason::NoConvergence { correction, .. } => write!(
                f,
                "Newton's method stops at corrections of {correction:.1e}: {advice}"
            ),
            ShootingFailureReason::Rounding { correction, growth } => write!(
                f,
                "shooting cannot resolve this leaf: perturbations grow 10^{growth:.0} times from base to tip, and \
                 from the leaf at rest corrections of {correction:.1e} do not decrease"
            ),
            ShootingFailureReason::Singular(neutral) => write!(
                f,
                "the equations are singular (ratio of singular values {:.1e}): {neutral}",
                neutral.ratio
            ),
            ShootingFailureReason::TooMuchWork { growth } => write!(
                f,
                "shooting would take too much work for this leaf: between veins that tissue ties perturbations may grow \
                 10^{growth:.0} times from base to tip"
            ),
            ShootingFailureReason::TooMuchMemory(too_much) => too_much.fmt(f),
            ShootingFailureReason::Unmodelled(unmodelled) => unmodelled.fmt(f),
            ShootingFailureReason::OutOfTime => {
                f.write_str("the time allowed was over before shooting had converged: allow more")
            }
        }
    }
}

/// The meaning of the direction, in words.
impl fmt::Display for NeutralDirection {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let longer = |a: DVec3, b: &DVec3| if b.length() > a.length() { *b } else { a };
        let largest: Vec<DVec3> = (self.displacement.iter())
            .map(|rod| rod.iter().fold(DVec3::ZERO, longer))
            .collect();
        let veins: Vec<String> = (largest.iter().enumerate())
            .filter(|(_, moved)| moved.length() > MENTIONED_DISPLACEMENT_FRACTION)
            .map(|(j, _)| (j + 1).to_string())
            .collect();
        let who = match veins.as_slice() {
            all if all.len() == largest.len() && all.len() > 1 => "all veins".to_string(),
            [one] => format!("vein {one}"),
            several => format!("veins {}", several.join(", ")),
        };
        let sum: DVec3 = largest.iter().map(|moved| *moved * *moved).sum();
        let axis = ["x", "y", "z"][sum.max_position()];
        write!(
            f,
            "a bifurcation is near, or the leaf can move without resistance; {who} would move, mostly along {axis}"
        )
    }
}

/// Why no solution was found.
#[derive(Clone, Debug)]
pub struct ShootingFailure {
    /// The reason.
    pub reason: ShootingFailureReason,
    /// Part of the change from the leaf of arcs to the scenario's that was made.
    pub lambda: f64,
    /// The last shape computed, at the stations.
    pub rods: Vec<RodShape>,
    /// Work done.
    pub work: ShootingCounts,
}
