//! Leaves that move: scenarios, starts, methods, and how far apart two motions are.
#![allow(dead_code)]

use glam::DVec3;
use leafdyn::leaf::{DiscreteLeaf, Grid, Leaf, State};
use leafdyn::motion::{Explicit, Method, Physics, SemiImplicit, Snapshot, Steps};
use leafdyn::relax::{self, Options, relax, start};
use leafdyn::scenario::{Profile, Rod, Scenario, Schedule};

use crate::common::paper_leaf;

/// Linear from zero at time 0 to `value` at time `until`, then constant.
pub fn ramp(until: f64, value: [f64; 3]) -> Schedule<[f64; 3]> {
    Schedule {
        at: vec![0.0, until],
        value: vec![[0.0; 3], value],
    }
}

/// A twisted rod of three different bending and shear stiffnesses, without
/// loads and undamped; natural units.
pub fn twisted_rod() -> Scenario {
    let mut rod = paper_leaf(1, [0.9, 1.4, 0.7], [90.0, 60.0, 40.0], 0.0);
    rod.rods[0].rest_curvature = [0.8, -0.5, 0.6].map(Profile::Constant);
    rod.dynamics.external_damping = 0.0;
    rod
}

/// Three veins of different lengths and stiffnesses, coupled and joined at
/// the tip, under their weight; undamped.
pub fn three_veins() -> Scenario {
    let mut leaf = paper_leaf(3, [0.9, 1.2, 0.8], [90.0, 60.0, 40.0], 0.0);
    leaf.coupling = vec![[1.0, 6.0, 2.0], [0.5, 3.0, 4.0]];
    for (rod, part) in leaf.rods.iter_mut().zip([0.95, 1.0, 0.9]) {
        rod.length = part;
        let of = |profile: &mut Profile| *profile = Profile::Constant(part * profile.at(0.5));
        rod.couple_stiffness.iter_mut().for_each(of);
        rod.rest_curvature[1] = Profile::Constant(0.4 * part);
    }
    leaf.dynamics.external_damping = 0.0;
    leaf
}

/// The scenario with loads at rest that are those at time 0.
pub fn at_beginning(scenario: &Scenario) -> Scenario {
    let mut resting = scenario.clone();
    let dynamics = &scenario.dynamics;
    resting.gravity = dynamics.gravity.at(0.0);
    resting.tip_force = dynamics.tip_force.at(0.0);
    resting.tip_moment = dynamics.tip_moment.at(0.0);
    let factor = dynamics.rest.at(0.0);
    for rod in &mut resting.rods {
        for curvature in &mut rod.rest_curvature {
            *curvature = scaled(curvature, factor);
        }
    }
    resting
}

/// A profile times a factor.
pub fn scaled(profile: &Profile, factor: f64) -> Profile {
    match profile {
        Profile::Constant(value) => Profile::Constant(factor * value),
        Profile::Linear { at, value } => Profile::Linear {
            at: at.clone(),
            value: value.iter().map(|v| factor * v).collect(),
        },
    }
}

/// Every profile of a rod's stiffness.
pub fn stiffness(rod: &mut Rod) -> impl Iterator<Item = &mut Profile> {
    rod.couple_stiffness
        .iter_mut()
        .chain(&mut rod.force_stiffness)
}

/// The leaf of a scenario on a grid.
pub fn discrete(leaf: &Leaf, segments: usize) -> DiscreteLeaf {
    DiscreteLeaf::new(leaf, Grid::new(segments, leaf.kinks()))
}

/// The equilibrium at time 0, to rounding.
pub fn rest(scenario: &Scenario, segments: usize) -> State {
    let resting = at_beginning(scenario);
    let options = Options {
        method: relax::Method::default().on_grid(Some(segments)),
        tolerance: Some(1e-12),
        ..Options::default()
    };
    let found = relax(&resting, &options, &mut |_| {}).unwrap();
    assert!(found.outcome.is_success(), "{:?}", found.outcome);
    let length = Leaf::new(scenario).scale.length;
    let nodes = || found.shape.rods.iter().flat_map(|rod| &rod.nodes);
    State::new(
        found.shape.stations.len() - 1,
        nodes().map(|node| node.position / length).collect(),
        nodes().map(|node| node.rotation).collect(),
    )
}

/// The shape from which a leaf is released.
pub fn released(leaf: &Leaf, segments: usize) -> State {
    start(&discrete(leaf, segments))
}

/// The two methods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scheme {
    Explicit,
    SemiImplicit,
}

pub const BOTH: [Scheme; 2] = [Scheme::Explicit, Scheme::SemiImplicit];

/// A method at time 0 with steps of `h`.
pub fn method(scheme: Scheme, leaf: &Leaf, state: &State, h: f64) -> Box<dyn Method> {
    let (physics, grid) = (Physics::new(leaf), discrete(leaf, state.segments()));
    match scheme {
        Scheme::Explicit => Box::new(Explicit::new(grid, physics, state, Some(h)).unwrap()),
        Scheme::SemiImplicit => Box::new(SemiImplicit::new(grid, physics, state, Steps::Fixed(h))),
    }
}

/// Where a leaf is at `until`, having moved by steps of `h`.
#[track_caller]
pub fn at(scheme: Scheme, leaf: &Leaf, state: &State, h: f64, until: f64) -> Snapshot {
    let mut method = method(scheme, leaf, state, h);
    if let Err(broken) = method.advance(until) {
        panic!("{scheme:?}, steps of {h}: {broken:?}");
    }
    method.snapshot()
}

/// All positions, rotations and velocities of a snapshot.
pub fn numbers(snapshot: &Snapshot) -> Vec<f64> {
    let state = &snapshot.state;
    let velocities = snapshot.velocity.iter();
    (state.x.iter().flat_map(|x| x.to_array()))
        .chain(state.q.iter().flat_map(|q| q.to_array()))
        .chain(velocities.flat_map(|v| [v.linear, v.angular].map(|v| v.to_array()).concat()))
        .collect()
}

/// Largest difference.
pub fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max)
}

/// Root of the mean square of the differences, smoother than the largest.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (squares / a.len() as f64).sqrt()
}

/// The limit of values at h and h/2 whose error is of second order.
pub fn limit(coarse: &[f64], fine: &[f64]) -> Vec<f64> {
    let pairs = coarse.iter().zip(fine);
    pairs.map(|(c, f)| f + (f - c) / 3.0).collect()
}

/// Position of the tip of the first rod.
pub fn tip(snapshot: &Snapshot) -> DVec3 {
    snapshot.state.tip(0)
}
