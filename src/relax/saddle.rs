//! Saddles: their Morse index, their refinement by Newton's method, and leaving them.
//!
//! Where the path loses its stability: the leaf moves on, down its energy, to another equilibrium
//! under the same part of the loading.
//!
//! The motion is one of a leaf in a very viscous medium: implicit Euler steps without inertia,
//! each solved to convergence, so that segments carry the forces of their strains however stiff
//! they are. It leaves a saddle, or the place of a fold, along the one direction in which the
//! energy falls, and ends at the bottom of the valley that this leads to. Where steps are long it
//! is Newton's method.

use crate::leaf::{
    DefiniteFactors, DirectSolver, DiscreteLeaf, LinearSolveOutcome, NodalField, State, System,
};
use crate::newton::{NewtonEquations, NewtonIteration, SolverCounts};
use crate::numbers::larger;
use glam::DVec3;
use serde::Serialize;

/// Size of the push off a saddle: largest rotation (radians) or displacement
/// (lengths) along the unstable mode.
const SADDLE_ESCAPE_DISTANCE: f64 = 0.03;

/// Steps of inverse iteration; the mode must be unstable, not accurate.
const MODE_ITERATIONS: usize = 6;

/// Largest rotation or displacement in a Newton step towards an equilibrium of any kind.
const MAX_STEP: f64 = 0.5;

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
    /// Its energy.
    pub energy: f64,
    /// Its number of negative eigenvalues (Morse index).
    pub negative_eigenvalues: usize,
    /// Position of the joint tip, or of the first rod's.
    pub tip: DVec3,
}

/// Morse index of a state at rest: the number of negative eigenvalues of the Hessian of its
/// energy (the symmetric part of it, under a dead moment). Eigenvalues (with respect to the
/// masses) between -`shift` and zero do not count. `None` if the factorisation does not fit
/// into memory.
pub fn index(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    shift: f64,
    work: &mut SolverCounts,
) -> Option<usize> {
    count(leaf, state, system, (0.0, shift), work)
}

/// Negative eigenvalues of the Hessian minus `excess` times the excess stiffness of the elements
/// plus `shift` times the mass matrix. With an excess any number of them without coupling is
/// `None`, too.
fn count(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    (excess, shift): (f64, f64),
    work: &mut SolverCounts,
) -> Option<usize> {
    if system.has_tissue() {
        return count_coupled(leaf, state, system, (excess, shift), work);
    }
    assemble_minus_excess(leaf, state, system, excess, work);
    // For most stable leaves one linear-time factorisation is enough.
    if system.is_definite_without_coupling(shift) {
        return Some(0);
    }
    if excess > 0.0 && !system.coupled() {
        return None;
    }
    count_coupled(leaf, state, system, (excess, shift), work)
}

/// The matrix, minus `excess` times the excess stiffness of the elements.
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

/// [`count`] by the factorisation of the whole matrix.
fn count_coupled(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    (excess, shift): (f64, f64),
    work: &mut SolverCounts,
) -> Option<usize> {
    assemble_minus_excess(leaf, state, system, excess, work);
    let pattern = DirectSolver::for_coupling_pattern(system).ok()?;
    pattern.count_negative(system, shift).ok()
}

/// How many eigenvalues of an equilibrium are negative beyond doubt, how many may be on this
/// grid, being close to zero, and how many on finer ones: those of the Hessian less what
/// [`clearly_stable`] subtracts. Also how close to zero is close.
pub struct IndexBounds {
    pub least: usize,
    pub here: usize,
    pub finer: usize,
    pub close: f64,
}

/// The bounds of the Morse index of a state at rest. `None` if the factorisation does not fit
/// into memory.
pub fn bounds(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    work: &mut SolverCounts,
) -> Option<IndexBounds> {
    let close = CLEARLY_POSITIVE.max(leaf.neutral_shift());
    let mut of = |excess, shift| count_coupled(leaf, state, system, (excess, shift), work);
    let least = of(0.0, close)?;
    let here = of(0.0, -close)?;
    let finer = of(EXCESS_SAFETY, -close)?;
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
    count(leaf, state, system, (EXCESS_SAFETY, -least), work) == Some(0)
}

/// Newton's equations with pivots of any sign, and steps of bounded size.
pub const INDEFINITE_NEWTON_EQUATIONS: NewtonEquations =
    NewtonEquations::Indefinite { largest: MAX_STEP };

/// Newton iterations to converge at a saddle.
const POLISH_ITERATIONS: usize = 20;

/// Accuracy of a converged saddle: rounding.
const POLISH_ACCURACY: f64 = 1e-13;

/// Largest distance of a saddle from the state at which it was noticed, in lengths.
const POLISH_DISTANCE: f64 = 0.1;

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
        accuracy: POLISH_ACCURACY,
        iterations: POLISH_ITERATIONS,
        work,
        progress: &mut |_, _| {},
    };
    let found = iteration.solve(leaf, &mut exact, system, INDEFINITE_NEWTON_EQUATIONS);
    if found.is_err() || state.largest_displacement_to(&exact) >= POLISH_DISTANCE {
        return None;
    }
    *state = exact;
    index(leaf, state, system, leaf.neutral_shift(), work)
}

/// Finds the most unstable mode at a saddle, by inverse iteration with the first shift, doubled
/// from 1e-4, that makes the matrix positive definite, from the [`symmetry_breaking_field`]. It is the solution
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
    let mut shift = 1e-4;
    let mut factors = loop {
        work.factorizations += 1;
        if let Some(mut factors) = DefiniteFactors::new(system, shift)
            && matches!(
                factors.solve(system, 1e-3),
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
    for _ in 0..MODE_ITERATIONS {
        system.iterate_inverse();
        if !matches!(
            factors.solve(system, 1e-3),
            LinearSolveOutcome::Converged(_)
        ) {
            break;
        }
    }
    true
}

/// Displaces a state along the mode that was found, to the side of this sign.
pub fn displace(leaf: &DiscreteLeaf, state: &mut State, system: &System, sign: f64) {
    let (turn, displacement) = system.largest_increment();
    let mut pushed = state.clone();
    let step = sign * SADDLE_ESCAPE_DISTANCE / larger(turn, displacement);
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

/// Energies of mirror images agree to this part, of the larger one or of one (A/L); images are
/// farther apart than this (lengths, radians).
const SAME_ENERGY: f64 = 1e-3;

const IMAGES_APART: f64 = 0.05;

/// Of the sides of a saddle to which a leaf turned, with their energies: that of less energy, or the
/// first of two that are equal, and whether there is another one as good.
pub fn lower_energy_side(sides: [Option<(f64, State)>; 2]) -> Option<(State, bool)> {
    match sides {
        [Some((e1, one)), Some((e2, other))] => {
            let same = (e1 - e2).abs() <= SAME_ENERGY * e1.abs().max(e2.abs()).max(1.0);
            let apart = one.distance(&other) > IMAGES_APART;
            match e1 <= e2 || same {
                true => Some((one, same && apart)),
                false => Some((other, false)),
            }
        }
        [Some((_, one)), None] | [None, Some((_, one))] => Some((one, false)),
        [None, None] => None,
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

/// Spring rates (squared frequencies; the lowest of a clamped rod is 12) of the steps: the
/// first, the rate below which there are no springs (beside a bifurcation a leaf moves slowly),

/// Increments without symmetry, from which inverse iteration leads to the unstable mode, with the
/// sign that has most in common with them; of several modes of one eigenvalue, as of veins that
/// buckle alike, to that sum of them. They move the leaf along `leaning`, down, to the left
/// (along e2) and forward, in this order of importance, more so away from the base and, with
/// other weights, to the left. A straight rod along e1 is bent in a plane by them: one that is round
/// would turn out of any other on its way.
pub fn symmetry_breaking_field(leaf: &DiscreteLeaf, state: &State, leaning: DVec3) -> NodalField {
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
pub(super) const GIVEN_BIAS_WEIGHT: f64 = 10.0;
