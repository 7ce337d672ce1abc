//! Where a motion begins.

use super::Refused;
use crate::leaf::{DiscreteLeaf, Grid, Leaf, State};
use crate::limit::Limit;
use crate::motion::unstrained;
use crate::relax::{self, Route};
use crate::scenario::{Scenario, Schedule, Start};
use std::f64::consts::PI;

/// Largest force in a segment of the arcs that a leaf is released from, in units of A/L^2 of its
/// rod. A rod under a larger one buckles in waves shorter than an eighth of its length, which few
/// segments do not resolve.
const LARGEST_FORCE: f64 = 256.0 * PI * PI;

/// The positions and rotations at time 0.
pub(super) fn state(
    leaf: &Leaf,
    grid: &Grid,
    tolerance: f64,
    limit: Limit,
) -> Result<State, Refused> {
    match leaf.scenario().dynamics.start {
        Start::Released if !leaf.is_held() => Ok(released(&DiscreteLeaf::new(leaf, grid.clone()))),
        // Held tips and grips are moved to their positions by the relaxation.
        Start::Released | Start::AtRest => at_rest(leaf, grid, tolerance, limit),
    }
}

/// The initial state of a relaxation or, where its arcs would strain rods that hardly yield, a
/// state near it without such strains: otherwise the energy of these would drive the motion.
fn released(leaf: &DiscreteLeaf) -> State {
    let mut arcs = relax::start(leaf);
    leaf.strain_forces(&mut arcs);
    let strained = leaf.each(0..leaf.segments()).any(|(j, i)| {
        let softest = leaf.section(j, i).couple_stiffness.min_element();
        let unit = softest / leaf.leaf.length(j).powi(2);
        arcs.n[j * leaf.segments() + i].length() > LARGEST_FORCE * unit
    });
    let unstrained = strained.then(|| unstrained(leaf, &arcs)).flatten();
    unstrained.unwrap_or(arcs)
}

/// The equilibrium under the loads, in the wind and with the rest shape at time 0.
fn at_rest(leaf: &Leaf, grid: &Grid, tolerance: f64, limit: Limit) -> Result<State, Refused> {
    let scenario = at_beginning(leaf.scenario());
    let options = relax::Options {
        method: relax::Method::default().on_grid(Some(grid.segments())),
        tolerance: Some(tolerance),
        limit,
        route: match scenario.wind {
            Some(_) => Route::Release,
            None => Route::default(),
        },
        ..relax::Options::default()
    };
    let found = relax::relax(&scenario, &options, &mut |_| {})?;
    if !found.outcome.is_success() {
        return Err(Refused::NoRest {
            outcome: found.outcome.word(),
        });
    }
    let nodes = || found.shape.rods.iter().flat_map(|rod| &rod.nodes);
    let x = nodes().map(|node| node.position / leaf.scale.length);
    let q = nodes().map(|node| node.rotation);
    Ok(State::new(grid.segments(), x.collect(), q.collect()))
}

/// The scenario with the loads, the wind and the rest shape at time 0.
fn at_beginning(scenario: &Scenario) -> Scenario {
    let mut scenario = scenario.clone();
    let dynamics = &scenario.dynamics;
    scenario.gravity = dynamics.gravity.at(0.0);
    scenario.tip_force = dynamics.tip_force.at(0.0);
    scenario.tip_moment = dynamics.tip_moment.at(0.0);
    let factor = dynamics.rest.at(0.0);
    let air = scenario.wind.as_ref().map(|wind| wind.velocity.at(0.0));
    match (&mut scenario.wind, air) {
        (Some(wind), Some(air)) if air != [0.0; 3] => wind.velocity = Schedule::constant(air),
        (wind, _) => *wind = None,
    }
    let rods = scenario.rods.iter_mut();
    for curvature in rods.flat_map(|rod| &mut rod.rest_curvature) {
        *curvature = curvature.scaled(factor);
    }
    scenario
}
