//! Saddles of the energy: their Morse index, their refinement by Newton's method, and the side on which
//! a leaf leaves them: the same on all grids, in all units, and in whichever order its veins are
//! numbered.

use crate::leaf::{
    DefiniteFactors, DirectSolver, DiscreteLeaf, LinearSolveOutcome, NodalField, State, System,
};
use crate::newton::{NewtonEquations, NewtonIteration, SolverCounts};
use crate::relax::same_equilibrium::{are_different_sides, are_equally_low, is_noticed_saddle};
use glam::DVec3;
use serde::Serialize;

/// How a leaf is pushed off a saddle.
struct SaddleEscape {
    /// Largest rotation (radians) or displacement (lengths) of the push along the unstable mode. A much
    /// shorter one costs steps until the leaf moves, a much longer one may lead over another saddle.
    distance: f64,
    /// Steps of inverse iteration for the mode: it must be unstable, not accurate.
    mode_iterations: usize,
    /// Relative accuracy of the linear solutions of these.
    mode_accuracy: f64,
    /// The first shift of the inverse iteration, with respect to the masses; doubled until the matrix is
    /// positive definite.
    first_shift: f64,
}

const ESCAPE: SaddleEscape = SaddleEscape {
    distance: 0.03,
    mode_iterations: 6,
    mode_accuracy: 1e-3,
    first_shift: 1e-4,
};

/// Lower bound on the lowest eigenvalue (with respect to the masses; 12 for a clamped rod) on
/// one grid of a leaf that counts as clearly stable: near a fold it changes with the shape.
const CLEARLY_POSITIVE: f64 = 0.1;

/// Noise of eigenvalues by rounding from which on their signs are not taken for granted.
pub const NOISY_EIGENVALUE_THRESHOLD: f64 = 0.01;

/// Safety factor on the excess stiffness of the elements, which is computed with the forces on
/// the grid.
const EXCESS_SAFETY: f64 = 3.0;

/// A saddle that the leaf reached and left before it came to rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Saddle {
    /// Potential energy of the leaf at the saddle.
    pub energy: f64,
    /// Its number of negative eigenvalues (Morse index).
    pub negative_eigenvalues: usize,
    /// Position of the joint tip, or of the first rod's.
    pub tip: DVec3,
}

/// Morse index of a state at rest: the number of negative eigenvalues of the Hessian of its
/// energy (the symmetric part of it, under a dead moment). Eigenvalues (with respect to the
/// masses) between -`shift` and zero do not count. `None` if the factorization does not fit
/// into memory.
pub fn index(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    shift: f64,
    work: &mut SolverCounts,
) -> Option<usize> {
    count(
        leaf,
        state,
        system,
        HessianShift { excess: 0.0, shift },
        work,
    )
}

/// What is added to the Hessian of the energy before its negative eigenvalues are counted.
#[derive(Clone, Copy)]
struct HessianShift {
    /// Factor on the excess stiffness of the elements, which is subtracted.
    excess: f64,
    /// Factor on the mass matrix, which is added.
    shift: f64,
}

/// Negative eigenvalues of the shifted Hessian. With an excess any number of them without coupling is
/// `None`, too.
fn count(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    shifted: HessianShift,
    work: &mut SolverCounts,
) -> Option<usize> {
    if system.has_tissue() {
        return count_coupled(leaf, state, system, shifted, work);
    }
    assemble_minus_excess(leaf, state, system, shifted.excess, work);
    // For most stable leaves one linear-time factorization is enough.
    if system.is_definite_without_coupling(shifted.shift) {
        return Some(0);
    }
    if shifted.excess > 0.0 && !system.coupled() {
        return None;
    }
    count_coupled(leaf, state, system, shifted, work)
}

/// Assembles the Hessian, minus `excess` times the excess stiffness of the elements.
fn assemble_minus_excess(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    excess: f64,
    work: &mut SolverCounts,
) {
    leaf.assemble(state, system);
    leaf.add_phase_conditions(state, system);
    if excess > 0.0 {
        leaf.subtract_excess_stiffness(state, system, excess);
    }
    work.force_evaluations += 1;
    work.factorizations += 1;
}

/// Negative eigenvalues of the shifted Hessian, by the factorization of the whole matrix.
fn count_coupled(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    HessianShift { excess, shift }: HessianShift,
    work: &mut SolverCounts,
) -> Option<usize> {
    assemble_minus_excess(leaf, state, system, excess, work);
    let pattern = DirectSolver::for_coupling_pattern(system).ok()?;
    pattern.count_negative(system, shift).ok()
}

/// Bounds of the Morse index of an equilibrium, by its eigenvalues with respect to the masses.
pub struct IndexBounds {
    /// Eigenvalues that are negative beyond doubt.
    pub least: usize,
    /// Eigenvalues that may be negative on this grid, being close to zero.
    pub here: usize,
    /// Eigenvalues that may be negative on finer grids: those of the Hessian less what
    /// [`clearly_stable`] subtracts.
    pub finer: usize,
    /// The size up to which an eigenvalue is close to zero.
    pub close: f64,
}

/// The bounds of the Morse index of a state at rest. `None` if the factorization does not fit
/// into memory.
pub fn bounds(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    work: &mut SolverCounts,
) -> Option<IndexBounds> {
    let close = CLEARLY_POSITIVE.max(leaf.neutral_shift());
    let mut count = |excess, shift| {
        let shifted = HessianShift { excess, shift };
        count_coupled(leaf, state, system, shifted, work)
    };
    let least = count(0.0, close)?;
    let here = count(0.0, -close)?;
    let finer = count(EXCESS_SAFETY, -close)?;
    Some(IndexBounds {
        least,
        here,
        finer: finer.max(here),
        close,
    })
}

/// The least and the largest [`index`] on a grid so fine that rounding may change the sign of
/// the softest eigenvalues.
pub fn index_within_rounding(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    work: &mut SolverCounts,
) -> Option<[usize; 2]> {
    let noise = leaf.neutral_shift();
    let least = index(leaf, state, system, noise, work)?;
    Some([least, index(leaf, state, system, -noise, work)?])
}

/// Whether a state at rest on a grid may be expected to be stable on finer ones as well: its
/// Hessian minus [`EXCESS_SAFETY`] times the excess stiffness of the elements over the rods
/// and minus [`CLEARLY_POSITIVE`], or more where rounding is more, times the mass matrix is
/// positive definite.
pub fn clearly_stable(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    work: &mut SolverCounts,
) -> bool {
    let least = CLEARLY_POSITIVE.max(leaf.neutral_shift());
    let shifted = HessianShift {
        excess: EXCESS_SAFETY,
        shift: -least,
    };
    count(leaf, state, system, shifted, work) == Some(0)
}

/// Newton's equations with pivots of any sign, for steps to an equilibrium of any Morse index with
/// rotations (radians) and displacements (lengths) of bounded size.
pub const INDEFINITE_NEWTON_EQUATIONS: NewtonEquations =
    NewtonEquations::Indefinite { largest: 0.5 };

/// Newton iterations that converge a saddle to rounding from where it was noticed.
const CONVERGENCE_ITERATIONS: usize = 20;

/// Accuracy of a converged saddle, in lengths and radians: rounding.
const CONVERGED_ACCURACY: f64 = 1e-13;

/// Converges a state near a saddle to rounding by Newton's method and counts its Morse index,
/// a neutral mode not counting as negative. `None` if Newton's method leads elsewhere, with
/// the state unchanged, or if the index is not known.
pub fn converge_saddle(
    leaf: &DiscreteLeaf,
    state: &mut State,
    system: &mut System,
    work: &mut SolverCounts,
) -> Option<usize> {
    let mut exact = state.clone();
    let iteration = NewtonIteration {
        accuracy: CONVERGED_ACCURACY,
        iterations: CONVERGENCE_ITERATIONS,
        work,
        progress: &mut |_, _| {},
    };
    let found = iteration.solve(leaf, &mut exact, system, INDEFINITE_NEWTON_EQUATIONS);
    if found.is_err() || !is_noticed_saddle(state, &exact) {
        return None;
    }
    *state = exact;
    index(leaf, state, system, leaf.neutral_shift(), work)
}

/// Finds the most unstable mode at a saddle, by inverse iteration with the first shift that makes the matrix positive definite, from the [`symmetry_breaking_field`]. It is the solution
/// of the system; false if there is none.
pub fn find_unstable_mode(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    leaning: DVec3,
    work: &mut SolverCounts,
) -> bool {
    leaf.assemble(state, system);
    leaf.add_phase_conditions(state, system);
    work.force_evaluations += 1;
    let momentum = system.mass_product(&symmetry_breaking_field(leaf, state, leaning));
    system.set_rhs(&momentum);
    let mut shift = ESCAPE.first_shift;
    let mut factors = loop {
        work.factorizations += 1;
        if let Some(mut factors) = DefiniteFactors::new(system, shift)
            && matches!(
                factors.solve(system, ESCAPE.mode_accuracy),
                LinearSolveOutcome::Converged(_)
            )
        {
            break factors;
        }
        shift *= 2.0;
        if !shift.is_finite() {
            return false;
        }
    };
    for _ in 0..ESCAPE.mode_iterations {
        system.iterate_inverse();
        if !matches!(
            factors.solve(system, ESCAPE.mode_accuracy),
            LinearSolveOutcome::Converged(_)
        ) {
            break;
        }
    }
    true
}

/// Displaces a state along the mode that was found, to the side of this sign.
pub fn displace(leaf: &DiscreteLeaf, state: &mut State, system: &System, sign: f64) {
    let mut pushed = state.clone();
    let step = sign * ESCAPE.distance / system.largest_increment().larger();
    leaf.advance(state, system, step, &mut pushed);
    *state = pushed;
}

/// Displaces a state at a saddle along its most unstable mode, to the [`symmetry_breaking_field`].
pub fn escape_saddle(
    leaf: &DiscreteLeaf,
    state: &mut State,
    system: &mut System,
    leaning: DVec3,
    work: &mut SolverCounts,
) {
    if find_unstable_mode(leaf, state, system, leaning, work) {
        displace(leaf, state, system, 1.0);
    }
}

/// An equilibrium to which a leaf turned from a saddle.
pub struct SideOfSaddle {
    pub state: State,
    /// The energy of the leaf there.
    pub energy: f64,
    /// Whether the other side has the same energy.
    pub equally_open: bool,
}

impl SideOfSaddle {
    pub fn new(leaf: &DiscreteLeaf, state: State) -> Self {
        SideOfSaddle {
            energy: leaf.energy(&state),
            state,
            equally_open: false,
        }
    }
}

/// The side of less energy of those to which a leaf turned from a saddle, or the first of two equal
/// ones.
pub fn lower_energy_side(sides: [Option<SideOfSaddle>; 2]) -> Option<SideOfSaddle> {
    match sides {
        [Some(one), Some(other)] => {
            let same = are_equally_low(one.energy, other.energy);
            match one.energy <= other.energy || same {
                true => Some(SideOfSaddle {
                    equally_open: same && are_different_sides(&one.state, &other.state),
                    ..one
                }),
                false => Some(other),
            }
        }
        [one, other] => one.or(other),
    }
}

/// The saddle at a state, in the units of the scenario.
pub fn saddle_summary(leaf: &DiscreteLeaf, state: &State, index: usize) -> Saddle {
    let scale = leaf.leaf.scale;
    Saddle {
        energy: leaf.energy(state) * scale.moment(),
        negative_eigenvalues: index,
        tip: state.tip(0) * scale.length,
    }
}

/// Increments without symmetry, from which inverse iteration leads to the unstable mode, with the
/// sign that has most in common with them; of several modes of one eigenvalue, as of veins that
/// buckle alike, to that sum of them. They move the leaf along `leaning`, down, to the left
/// (along e2) and forward, in this order of importance, more so away from the base and, with
/// other weights, to the left. A straight rod along e1 is bent in a plane by them: one that is round
/// would turn out of any other on its way.
fn symmetry_breaking_field(leaf: &DiscreteLeaf, state: &State, leaning: DVec3) -> NodalField {
    let (down, left, forward) = (-DVec3::Z, DVec3::Y, DVec3::X);
    let given = GIVEN_BIAS_WEIGHT * leaning.normalize_or_zero();
    let everywhere = given + down + 0.5 * left + 0.25 * forward;
    let leftwards = 0.31 * down + 0.17 * left + 0.11 * forward;
    let node = |j: usize, i: usize| {
        let x = state.x[state.base(j) + i];
        let shift = (1.0 + 0.2 * x.x) * everywhere + x.y * leftwards;
        [0.0, 0.0, 0.0, shift.x, shift.y, shift.z]
    };
    let rod = |j: usize| leaf.moving_nodes().map(|i| node(j, i)).collect();
    (0..leaf.rods()).map(rod).collect()
}

/// Weight of a given direction over that of the others.
const GIVEN_BIAS_WEIGHT: f64 = 10.0;
