//! A leaf on which forces without a potential act, near a state in which it is known: in balance on one
//! grid, at rest on as many grids as a tolerance needs, and which of its small motions grow.
//!
//! Where such a leaf is continued in a number of its scenario these are the equations of a branch: Newton's
//! method with the exact, unsymmetric matrix leads to the balance next to a guess, stable or not.

use crate::leaf::{DiscreteLeaf, Leaf, State, System};
use crate::modes::linearized::{MotionRoot, MotionRoots, lowest_roots};
use crate::motion::Physics;
use crate::newton::{EquilibriumFailure, SolverCounts};
use crate::numbers::largest;
use crate::relax::accuracy::NestedEquilibrium;
use crate::relax::accuracy::transfer::{GridLevel, StateOnGrid};
use crate::relax::log::WorkLog;
use crate::relax::nested_grids::solve_from_guesses;
use crate::relax::plan::{RelaxationProblem, UNKNOWNS, ValleyPolicy};
use crate::relax::request::{Options, Progress};
use crate::relax::rest::{RelaxedLeaf, equilibrium_with_stability};
use crate::relax::small_motions::{LEAST_ROOTS, small_motions, unknowns};
use crate::relax::solve_on_grid::follower_loads::{WithoutPotential, balance_near};
use crate::rod::Section;
use crate::rotation;
use crate::run::{Instant, Limit};
use faer::c64;
use glam::DVec3;

/// Imaginary part of the square of a root, as a part of its size, that is rounding: two equal roots, as of
/// a round rod, may differ by it. Where flutter begins it grows as the root of the distance from there.
const PAIR_ROUNDING: f64 = 1e-6;

/// Growth of a damped motion, as a part of the size of its root, from which on it is followed to where it begins: less than
/// the accuracy of a root, as that is interpolated from several.
const GROWTH_ROUNDING: f64 = 1e-8;

/// A small motion that grows, on one grid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GrowingMotion {
    /// Rate of growth, dimensionless.
    pub growth: f64,
    /// A smooth function of the loads that is zero where the growth begins, and positive beyond. Without
    /// damping two frequencies meet in flutter, and growth begins as a root: this is the square of the
    /// imaginary part of lambda^2, in divergence lambda^2 itself. With damping it is the growth.
    pub measure: f64,
    /// Square of the size of the root, with which rounding of the matrix moves the zero of the measure; `None` in
    /// flutter without damping, where it moves it as it does the root of the measure.
    pub square: Option<f64>,
    /// Angular frequency in the scenario's unit of time; zero in divergence.
    pub frequency: f64,
}

/// The small motions that grow, on one grid.
#[derive(Clone, Debug, Default)]
pub(crate) struct GrowingMotions {
    /// Number of roots of positive real part, both of a conjugate pair.
    pub unstable_roots: usize,
    /// Each of the motions once.
    pub motions: Vec<GrowingMotion>,
}

impl GrowingMotions {
    fn add(&mut self, motion: GrowingMotion) {
        self.unstable_roots += match motion.frequency > 0.0 {
            true => 2,
            false => 1,
        };
        self.motions.push(motion);
    }

    /// The motion that grows most slowly: the last that began to, close to where it did.
    pub fn slowest(&self) -> Option<GrowingMotion> {
        let all = self.motions.iter().copied();
        all.min_by(|a, b| a.growth.total_cmp(&b.growth))
    }
}

/// Whether the small motions of a leaf on a grid are computed: the leaf is not too large.
pub(crate) fn has_small_motions(leaf: &DiscreteLeaf) -> bool {
    unknowns(leaf) <= UNKNOWNS.without_shapes
}

/// Whether the small motions of a leaf on a grid take little time.
pub(crate) fn has_quick_small_motions(leaf: &DiscreteLeaf) -> bool {
    unknowns(leaf) <= UNKNOWNS.quick
}

/// Stiffness in stretch and shear above which matrices are softened: a larger one loses digits of the roots, a
/// smaller one is harder to extrapolate to none.
struct Softening {
    /// In units of A/L^2.
    stiffness: f64,
    /// Over the largest force of the rods, if that is more.
    force_ratio: f64,
}

const SOFTENING: Softening = Softening {
    stiffness: 1e5,
    force_ratio: 1e3,
};

fn softened_stiffness(state: &State) -> f64 {
    let tension = largest(state.n.iter().map(|n| n.length()));
    SOFTENING.stiffness.max(SOFTENING.force_ratio * tension)
}

/// Whether the matrix of a leaf is softened.
pub(crate) fn is_softened(level: &GridLevel) -> bool {
    let stiffest = softened_stiffness(&level.state);
    let stiff = |section: &Section| section.compliance.min_element() * stiffest < 1.0;
    level.leaf.sections.iter().any(stiff)
}

/// Rounding of the squares of roots: that of the matrix.
pub(crate) fn rounding_of_squares(level: &GridLevel) -> f64 {
    f64::EPSILON * softened_stiffness(&level.state) * (level.leaf.segments() as f64).powi(2)
}

/// The leaf with matrices of nearly rigid segments that have this multiple of the least compliance besides
/// their own.
fn softened(GridLevel { leaf, state }: &GridLevel, times: f64) -> DiscreteLeaf {
    let mut soft = leaf.clone();
    let least = DVec3::splat(1.0 / softened_stiffness(state));
    for section in &mut soft.sections {
        let added = (least - section.compliance).max(DVec3::ZERO);
        section.condensing = (section.compliance + times * added).recip();
    }
    soft
}

/// The small motions that grow about a balance on a grid, of matrices that are softened so many times, among so many
/// roots next to zero; `None` if these are not found.
pub(crate) fn growing_motions(
    level: &GridLevel,
    softening: f64,
    searched_roots: usize,
    limit: &Limit,
) -> Option<GrowingMotions> {
    let (physics, _) = Physics::for_small_motions(&level.leaf.leaf);
    let leaf = softened(level, softening);
    let forces = WithoutPotential::in_motion(&leaf, &physics);
    let count = LEAST_ROOTS.max(searched_roots);
    let roots = lowest_roots(&leaf, &physics, &level.state, &forces, count, limit)?;
    let rate = 1.0 / physics.time_unit;
    let mut growing = GrowingMotions::default();
    match roots {
        MotionRoots::Squares(squares) => {
            for square in squares.iter().map(|it| it.value) {
                let pair = square.im.abs() > PAIR_ROUNDING * square.norm();
                match pair {
                    // One of each conjugate pair.
                    true if square.im > 0.0 => growing.add(GrowingMotion {
                        growth: MotionRoot::from_square(square).growth,
                        measure: square.im * square.im,
                        square: None,
                        frequency: MotionRoot::from_square(c64::new(square.re, 0.0))
                            .frequency
                            .max(f64::MIN_POSITIVE)
                            * rate,
                    }),
                    false if square.re > 0.0 => growing.add(GrowingMotion {
                        growth: square.re.sqrt(),
                        measure: square.re,
                        square: Some(square.re),
                        frequency: 0.0,
                    }),
                    _ => {}
                }
            }
        }
        MotionRoots::Damped(roots) => {
            let grows = |it: &&MotionRoot| it.growth > GROWTH_ROUNDING * it.size();
            for root in roots.iter().filter(grows) {
                growing.add(GrowingMotion {
                    growth: root.growth,
                    measure: root.growth,
                    square: Some(root.size().powi(2)),
                    frequency: root.frequency * rate,
                });
            }
        }
    }
    Some(growing)
}

/// Puts bases and tips where the leaf holds them.
fn place_supports(leaf: &Leaf, state: &mut State) {
    leaf.place_held_bases(state);
    leaf.place_held_tips(state);
}

/// The balance of a leaf on a grid next to a guess; `None` if Newton's method leads elsewhere, or nowhere.
pub(crate) fn balance_on_grid(leaf: &Leaf, guess: StateOnGrid, limit: &Limit) -> Option<GridLevel> {
    let (grid, mut state) = (guess.grid, guess.state);
    let discrete = DiscreteLeaf::new(leaf, grid);
    place_supports(leaf, &mut state);
    discrete.place_held_nodes(&mut state);
    let (mut system, mut work) = (System::new(&discrete), SolverCounts::default());
    let state = balance_near(&discrete, &mut system, state, &mut work, limit)?;
    Some(GridLevel {
        leaf: discrete,
        state,
    })
}

/// A leaf at rest next to a guess, stable or not, on as many grids as the tolerance needs, with its small
/// motions.
pub(crate) fn rest_near(
    leaf: &Leaf,
    guess: StateOnGrid,
    options: &Options,
    tolerance: f64,
) -> Result<RelaxedLeaf, EquilibriumFailure> {
    let clock = Instant::now();
    let mut guess = guess;
    place_supports(leaf, &mut guess.state);
    let problem = RelaxationProblem {
        valley: ValleyPolicy::StayOnBranch,
        ..RelaxationProblem::new(leaf, options, tolerance)
    };
    let ignored: &mut dyn FnMut(&Progress) = &mut |_| {};
    let mut effort = WorkLog::new(ignored);
    let begun = NestedEquilibrium::without_grids(&problem);
    let found = solve_from_guesses(&problem, begun, vec![guess], &mut effort);
    let found = found.map_err(|failure| failure.stop)?;
    let relaxed = equilibrium_with_stability(&problem, Ok(found), clock, &mut effort);
    Ok(with_small_motions(&problem, relaxed))
}

/// A relaxed leaf with its small motions, also where no load without a potential acts: at the end of a
/// range these may be zero.
fn with_small_motions(problem: &RelaxationProblem, mut relaxed: RelaxedLeaf) -> RelaxedLeaf {
    let motions = &mut relaxed.result.stability.small_motions;
    if motions.is_none() {
        *motions = small_motions(problem, &relaxed.on_grids);
    }
    relaxed
}

/// The same of a leaf that was relaxed under these options.
pub(crate) fn told_with_small_motions(
    leaf: &Leaf,
    options: &Options,
    tolerance: f64,
    relaxed: RelaxedLeaf,
) -> RelaxedLeaf {
    with_small_motions(&RelaxationProblem::new(leaf, options, tolerance), relaxed)
}

/// The state on the line through two states on one grid: the first at 0, the second at 1, turned about the
/// axes of the rotations between them.
pub(crate) fn state_on_line(from: &State, to: &State, at: f64) -> State {
    let mut state = to.clone();
    let beyond = at - 1.0;
    for (x, before) in state.x.iter_mut().zip(&from.x) {
        *x += beyond * (*x - *before);
    }
    for (q, before) in state.q.iter_mut().zip(&from.q) {
        let turn = rotation::log(*q * before.conjugate());
        *q = (rotation::exp(beyond * turn) * *q).normalize();
    }
    for (n, before) in state.n.iter_mut().zip(&from.n) {
        *n += beyond * (*n - *before);
    }
    for (force, before) in state.tissue.iter_mut().zip(&from.tissue) {
        *force += beyond * (*force - *before);
    }
    state
}
