//! Where the iteration on a grid begins: the natural leaf with its tips joined along circular arcs,
//! disturbed on request; and the state and limits of an iteration.

use crate::leaf::{DiscreteLeaf, State};
use crate::newton::{DefiniteSolver, SolverCounts};
use crate::relax::path::LoadOrder;
use crate::rotation;
use crate::run::Limit;
use glam::DVec3;
use std::f64::consts::PI;

/// The initial state of a relaxation: circular arcs that leave the base in the directions of
/// the fan and meet in a common tip; free rods start from their rest shapes.
pub fn initial_state(leaf: &DiscreteLeaf) -> State {
    match leaf.leaf.joined() && leaf.rods() > 1 {
        true if leaf.has_tissue() || !leaf.leaf.is_fan() => joined_natural_leaf(leaf),
        true => arcs(leaf),
        false => leaf.stress_free_state(),
    }
}

/// The natural leaf with its tips moved to their mean, and every node in proportion to its distance
/// from the base.
fn joined_natural_leaf(leaf: &DiscreteLeaf) -> State {
    let mut state = leaf.stress_free_state();
    let tips: DVec3 = state.tips().sum();
    let mean = tips / leaf.rods() as f64;
    for j in 0..leaf.rods() {
        let (base, missing) = (state.base(j), mean - state.tip(j));
        for (i, &sigma) in leaf.grid.sigma().iter().enumerate() {
            state.x[base + i] += sigma * missing;
        }
        state.x[base + leaf.segments()] = mean;
    }
    state
}

/// Arcs in the plane of the fan, symmetric about the mean base direction. Their chords differ:
/// each is stretched to the mean chord.
fn arcs(leaf: &DiscreteLeaf) -> State {
    let model = &leaf.leaf;
    let rods = &model.scenario().rods;
    let angles: Vec<f64> = (0..leaf.rods()).map(|j| rods[j].angle).collect();
    let towards = |phi: f64| DVec3::new(phi.cos(), phi.sin(), 0.0);
    let sum: DVec3 = angles.iter().map(|phi| towards(*phi)).sum();
    let mean = if sum.length() > 1e-9 * angles.len() as f64 {
        sum.y.atan2(sum.x)
    } else {
        angles[0]
    };
    let opening = |phi: f64| {
        let delta = (phi - mean).rem_euclid(2.0 * PI);
        if delta > PI { delta - 2.0 * PI } else { delta }
    };
    let sinc = |x: f64| if x.abs() < 1e-8 { 1.0 } else { x.sin() / x };
    let chords: f64 = (0..leaf.rods())
        .map(|j| model.grown_length(j, 1.0) * sinc(opening(angles[j])))
        .sum();
    let tip = towards(mean) * (chords / leaf.rods() as f64);
    let (mut x, mut q) = (Vec::new(), Vec::new());
    for (j, &phi) in angles.iter().enumerate() {
        let (delta, length) = (opening(phi), model.grown_length(j, 1.0));
        // The rotation is uniform over the grown length of the vein.
        let part = |sigma: f64| model.grown_length(j, sigma) / length;
        let arc = |sigma: f64| {
            // A chord's direction is half-way between the tangents at its ends.
            towards(phi - delta * sigma) * (length * sigma * sinc(delta * sigma))
        };
        let missing = tip - arc(1.0);
        for &sigma in leaf.grid.sigma() {
            let sigma = part(sigma);
            x.push(arc(sigma) + sigma * missing);
            q.push(rotation::exp((phi - 2.0 * delta * sigma) * DVec3::Z));
        }
        *x.last_mut().expect("a rod has nodes") = tip;
    }
    State::new(leaf.segments(), x, q)
}

/// The pattern by which initial states are disturbed out of the plane of the fan.
struct DisturbancePattern {
    /// Largest slope out of the plane.
    largest_slope: f64,
    /// Number of amplitudes, up to the largest.
    amplitudes: usize,
    /// Number of waves along the rods.
    waves_along: usize,
    /// Number of waves across the leaf.
    waves_across: usize,
}

const DISTURBANCE: DisturbancePattern = DisturbancePattern {
    largest_slope: 0.8,
    amplitudes: 4,
    waves_along: 3,
    waves_across: 3,
};

/// Lifts the nodes of an initial state out of the plane of the fan, and rotates them
/// accordingly: a smooth pattern, the same on all grids, that differs for every second number,
/// with alternating sign. A joint tip stays joint.
pub fn disturb(leaf: &DiscreteLeaf, number: usize, state: &mut State) {
    let (pattern, sign) = (number / 2, [1.0, -1.0][number % 2]);
    // Multiples of the golden ratio are equidistributed: a deterministic pseudo-random sequence.
    let golden = |k: usize| 2.0 * (k as f64 * 0.618_033_988_749_895).fract() - 1.0;
    let size = sign * DISTURBANCE.largest_slope * (1 + pattern % DISTURBANCE.amplitudes) as f64
        / DISTURBANCE.amplitudes as f64;
    let rods = leaf.rods();
    let joined = leaf.leaf.joined() && rods > 1;
    let longest = (0..rods).map(|j| leaf.leaf.length(j)).fold(0.0, f64::max);
    for j in 0..rods {
        // All tips that are one are lifted alike.
        let length = leaf.leaf.length(j);
        let (unit, steeper) = match joined {
            true => (longest, longest / length),
            false => (length, 1.0),
        };
        let across = match rods {
            1 => 0.0,
            _ => j as f64 / (rods - 1) as f64,
        };
        let base = state.base(j);
        for (i, &sigma) in leaf.grid.sigma().iter().enumerate().skip(1) {
            let (mut lift, mut slope) = (0.0, 0.0);
            for k in 1..=DISTURBANCE.waves_along {
                for l in 0..DISTURBANCE.waves_across {
                    let part = golden(1 + 13 * pattern + DISTURBANCE.waves_along * l + k)
                        / (k * (l + 1)) as f64;
                    let part = part * (PI * l as f64 * across).cos();
                    // Zero slope at the base; waves across the leaf vanish at a joint tip.
                    let (wave, k) = (PI * k as f64 * sigma, k as f64);
                    let end = if joined && l > 0 { 1.0 - sigma } else { 1.0 };
                    let fall = if joined && l > 0 { 1.0 } else { 0.0 };
                    let bump = (1.0 - wave.cos()) / (PI * k);
                    lift += part * bump * end;
                    slope += part * (wave.sin() * end - bump * fall);
                }
            }
            state.x[base + i].z += size * lift * unit;
            let sideways = state.q[base + i] * DVec3::Y;
            let turn = rotation::exp(-(size * slope * steeper).atan() * sideways);
            state.q[base + i] = (turn * state.q[base + i]).normalize();
        }
    }
}

/// Relative accuracy of the first solution by conjugate gradients of a leaf far from rest.
pub const FAR_FROM_REST: f64 = 1e-2;

/// A relaxation on one grid: its state and its parameters.
pub struct GridRelaxation<'a> {
    pub state: State,
    /// Largest remaining error of positions and rotations, lengths and radians.
    pub accuracy: f64,
    pub work: &'a mut SolverCounts,
    /// Receives the size of every step or, with the explicit method, the largest unbalanced
    /// force or moment.
    pub progress: &'a mut dyn FnMut(usize, f64),
    pub limit: &'a Limit,
    /// Whether the state is close to equilibrium: a stiff leaf is then not softened first.
    pub near_rest: bool,
    /// Whether the leaf moved through states of non-convex energy.
    pub left_convex_valley: bool,
    /// Relative accuracy of the conjugate gradients in the first step.
    pub cg_tolerance: f64,
    /// How often it was pushed off saddles before: each time it is softened less, since a
    /// softened leaf may return to the saddle.
    pub saddle_escapes: i32,
    pub solver: DefiniteSolver,
    /// Count of force evaluations at which the iteration ends without success.
    pub most_evaluations: usize,
    /// Whether to fail at once where the energy is not convex.
    pub convex_only: bool,
    /// When loads without a potential grow.
    pub load_order: LoadOrder,
    /// The part of the loads without a potential that the leaf bears beside all others, where they could not
    /// grow farther.
    pub borne_part: Option<f64>,
}

impl<'a> GridRelaxation<'a> {
    /// The relaxation of a state far from rest, without a limit on its work but `limit`.
    pub fn new(
        state: State,
        accuracy: f64,
        work: &'a mut SolverCounts,
        progress: &'a mut dyn FnMut(usize, f64),
        limit: &'a Limit,
    ) -> Self {
        GridRelaxation {
            state,
            accuracy,
            work,
            progress,
            limit,
            near_rest: false,
            left_convex_valley: false,
            cg_tolerance: FAR_FROM_REST,
            saddle_escapes: 0,
            solver: DefiniteSolver::default(),
            most_evaluations: usize::MAX,
            convex_only: false,
            load_order: LoadOrder::default(),
            borne_part: None,
        }
    }
}
