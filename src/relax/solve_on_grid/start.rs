//! The initial state of a relaxation.
//!
//! A relaxation that begins where another leaf is.
//!
//! The side to which a leaf turns from a saddle, the same on all grids, in all units, and in
//! whichever order its veins are numbered.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, NodalField, State};
use crate::relax::accuracy::NestedEquilibrium;
use crate::relax::loading::arrival;
use crate::relax::remark::EquilibriumDoubt;
use crate::relax::request::{
    Method, Options, Progress, RelaxError, check_hinge_equilibrium, check_tolerance,
    check_wind_options,
};
use crate::relax::rest::{RelaxationProblem, WorkLog, equilibrium_with_stability, relax_on_grids};
use crate::relax::result::Equilibrium;
use crate::relax::solve_on_grid::{check_segments, least_segments};
use crate::relax::stability::state_from_rod_shapes;
use crate::rotation;
use crate::run::{Instant, RefusedOption};
use crate::scenario::Scenario;
use crate::shape::{NodeState, RodShape};
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

/// Largest slope of a disturbance, and the number of amplitudes.
const LARGEST_DISTURBANCE_SLOPE: f64 = 0.8;

const DISTURBANCE_AMPLITUDES: usize = 4;

/// Waves of a disturbance along the rods and across the leaf.
const DISTURBANCE_WAVES_ALONG: usize = 3;

const DISTURBANCE_WAVES_ACROSS: usize = 3;

/// Lifts the nodes of an initial state out of the plane of the fan, and rotates them
/// accordingly: a smooth pattern, the same on all grids, that differs for every second number,
/// with alternating sign. A joint tip stays joint.
pub fn disturb(leaf: &DiscreteLeaf, number: usize, state: &mut State) {
    let (pattern, sign) = (number / 2, [1.0, -1.0][number % 2]);
    // Multiples of the golden ratio are equidistributed: a deterministic pseudo-random sequence.
    let golden = |k: usize| 2.0 * (k as f64 * 0.618_033_988_749_895).fract() - 1.0;
    let size = sign * LARGEST_DISTURBANCE_SLOPE * (1 + pattern % DISTURBANCE_AMPLITUDES) as f64
        / DISTURBANCE_AMPLITUDES as f64;
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
            for k in 1..=DISTURBANCE_WAVES_ALONG {
                for l in 0..DISTURBANCE_WAVES_ACROSS {
                    let part = golden(1 + 13 * pattern + DISTURBANCE_WAVES_ALONG * l + k)
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

/// Brings a scenario's leaf to rest from a shape with as many rods, given at `stations` from 0 to 1:
/// in the valley in which that lies, where a relaxation may find another. Where that leads nowhere it
/// relaxes as without, and one of the doubts says so.
///
/// # Errors
/// Requests that cannot be met, as of [`relax`](crate::relax::relax); other methods than the
/// semi-implicit one, and shapes of other leaves.
pub fn relax_from(
    scenario: &Scenario,
    (stations, rods): (&[f64], &[RodShape]),
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
    check_tolerance(tolerance)?;
    check_wind_options(scenario, options)?;
    check_hinge_equilibrium(scenario)?;
    check_start(scenario, stations, rods)?;
    let method = options.method;
    let Method::SemiImplicit(how) = method else {
        let why = "only the method semi-implicit begins from a given shape";
        return Err(RefusedOption::new("method", method.word(), why).into());
    };
    let clock = Instant::now();
    let leaf = Leaf::new(scenario);
    let problem = RelaxationProblem::new(&leaf, options, tolerance);
    let segments = check_segments(
        &leaf,
        method.segments(),
        least_segments(method, tolerance, false),
    )?;
    let grid = Grid::new(segments, leaf.kinks());
    let discrete = DiscreteLeaf::new(&leaf, grid.clone());
    let there = (rods.iter())
        .map(|rod| interpolate_rod_shape(stations, rod, grid.sigma()))
        .collect::<Vec<_>>();
    let mut state = state_from_rod_shapes(&leaf, &discrete, &there);
    for j in 0..leaf.rods() {
        let base = state.base(j);
        (state.x[base], state.q[base]) = leaf.base(j);
    }
    leaf.place_held_tips(&mut state);
    let mut effort = WorkLog::new(progress);
    let begun = NestedEquilibrium::without_grids(&problem);
    let found = arrival::solve_from_guesses(&problem, begun, vec![(grid, state)], &mut effort);
    let settled = match &found {
        Ok(found) => found.is_stable() || how.keep_unstable,
        Err(_) => problem.out_of_time(),
    };
    if settled {
        return Ok(equilibrium_with_stability(&problem, found, clock, &mut effort).0);
    }
    drop(effort);
    let (mut leaf, _) = relax_on_grids(scenario, options, false, progress)?;
    leaf.doubts.push(EquilibriumDoubt::RelaxedAnew);
    Ok(leaf)
}

/// Refuses the shape of another leaf, and one that is no shape.
fn check_start(
    scenario: &Scenario,
    stations: &[f64],
    rods: &[RodShape],
) -> Result<(), RefusedOption> {
    let refuse = |value: String, why: String| Err(RefusedOption::new("start", value, why));
    let (own, given) = (scenario.rods.len(), rods.len());
    if own != given {
        let why = format!("must have as many rods as the scenario, {own}");
        return refuse(format!("a leaf of {given} rods"), why);
    }
    let ascending = stations.windows(2).all(|pair| pair[0] < pair[1]);
    let whole = stations.first() == Some(&0.0) && stations.last() == Some(&1.0);
    let finite = |node: &NodeState| {
        node.position.is_finite() && node.n.is_finite() && node.rotation.is_normalized()
    };
    let complete =
        |rod: &RodShape| rod.nodes.len() == stations.len() && rod.nodes.iter().all(finite);
    if !ascending || !whole || !rods.iter().all(complete) {
        let why = "must be at rest, with numbers at all of its stations from 0 to 1";
        return refuse("a leaf".into(), why.into());
    }
    Ok(())
}

/// A rod at other stations: on chords, with the directors turned evenly from node to node.
fn interpolate_rod_shape(stations: &[f64], rod: &RodShape, to: &[f64]) -> RodShape {
    let node = |&sigma: &f64| {
        let next = stations.partition_point(|&at| at < sigma);
        let next = next.clamp(1, stations.len() - 1);
        let (a, b) = (&rod.nodes[next - 1], &rod.nodes[next]);
        let weight = (sigma - stations[next - 1]) / (stations[next] - stations[next - 1]);
        let mean = |of: fn(&NodeState) -> DVec3| of(a).lerp(of(b), weight);
        NodeState {
            position: mean(|node| node.position),
            rotation: a.rotation.slerp(b.rotation, weight),
            v: mean(|node| node.v),
            u: mean(|node| node.u),
            n: mean(|node| node.n),
            m: mean(|node| node.m),
        }
    };
    RodShape {
        length: rod.length,
        nodes: to.iter().map(node).collect(),
    }
}

/// Weight of a given direction over that of the others.
const GIVEN_BIAS_WEIGHT: f64 = 10.0;

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
