//! Where a motion begins: the leaf released, at rest under the loads at time 0, or as its scenario says;
//! and whether that start is an unstable equilibrium which nothing displaces.

use crate::leaf::{
    DiscreteLeaf, Grid, Increment, Leaf, State, System, displacement_part, rotation_part,
};
use crate::modes::{Eigenpair, ModeRequest, lowest};
use crate::motion::{Physics, project_constraints};
use crate::newton::{NewtonIteration, SolverCounts};
use crate::relax;
use crate::relax::{INDEFINITE_NEWTON_EQUATIONS, converge_saddle};
use crate::run::Limit;
use crate::scenario::{MotionStart, NaturalShapes, Scenario, Schedule};
use crate::simulate::remark::MotionDoubt;
use crate::simulate::request::SimulationError;
use std::f64::consts::PI;
use std::sync::Arc;

/// Largest force in a segment of the arcs that a leaf is released from, in units of A/L^2 of its
/// rod. A rod under a larger one buckles in waves shorter than an eighth of its length, which few
/// segments do not resolve.
pub(super) const LARGEST_FORCE: f64 = 256.0 * PI * PI;

/// The positions and rotations at time 0.
pub(crate) fn start_state(
    leaf: &Leaf,
    grid: &Grid,
    tolerance: f64,
    limit: Limit,
) -> Result<State, SimulationError> {
    match motion_start(leaf) {
        MotionStart::Released => Ok(released_state(&DiscreteLeaf::new(leaf, grid.clone()))),
        MotionStart::AtRest => state_at_rest(leaf, grid, tolerance, limit),
    }
}

/// From what the motion of a leaf starts: held tips and grips are moved to their positions by the relaxation,
/// whatever the scenario says.
pub(crate) fn motion_start(leaf: &Leaf) -> MotionStart {
    match leaf.has_placed_supports() {
        true => MotionStart::AtRest,
        false => leaf.scenario().dynamics.start,
    }
}

/// The initial state of a relaxation or, where its arcs would strain rods that hardly yield, a
/// state near it without such strains: otherwise the energy of these would drive the motion.
pub(super) fn released_state(leaf: &DiscreteLeaf) -> State {
    let mut arcs = relax::initial_state(leaf);
    leaf.strain_forces(&mut arcs);
    let strained = leaf.rod_index_pairs(0..leaf.segments()).any(|(j, i)| {
        let softest = leaf.section(j, i).couple_stiffness.min_element();
        let unit = softest / leaf.leaf.length(j).powi(2);
        arcs.n[j * leaf.segments() + i].length() > LARGEST_FORCE * unit
    });
    let unstrained = strained.then(|| project_constraints(leaf, &arcs)).flatten();
    unstrained.unwrap_or(arcs)
}

/// The equilibrium under the loads, in the wind and with the rest shape at time 0.
pub(super) fn state_at_rest(
    leaf: &Leaf,
    grid: &Grid,
    tolerance: f64,
    limit: Limit,
) -> Result<State, SimulationError> {
    let scenario = scenario_at_start(leaf.scenario());
    let options = relax::Options {
        method: relax::SemiImplicit::on_grid(Some(grid.segments())).into(),
        tolerance: Some(tolerance),
        limit,
        ..relax::Options::default()
    };
    let alone = relax::relax(&scenario, &options, &mut |_| {})?;
    let found = match alone.outcome.is_success() {
        true => alone,
        false => rest_near_accurate(&scenario, &options)?.unwrap_or(alone),
    };
    if !found.outcome.is_success() {
        return Err(SimulationError::NoRest {
            outcome: found.outcome.word(),
            segments: grid.segments(),
        });
    }
    let nodes = || found.shape.rods.iter().flat_map(|rod| &rod.nodes);
    let x = nodes().map(|node| node.position / leaf.scale.length);
    let q = nodes().map(|node| node.rotation);
    Ok(State::new(grid.segments(), x.collect(), q.collect()))
}

/// The equilibrium on the grid of these options next to an accurate one, where the way there is too far for the grid;
/// `None` if no grid leads to rest.
fn rest_near_accurate(
    scenario: &Scenario,
    on_grid: &relax::Options,
) -> Result<Option<relax::Equilibrium>, relax::RelaxError> {
    let accurate = relax::Options {
        method: relax::SemiImplicit::on_grid(None).into(),
        ..on_grid.clone()
    };
    let accurate = relax::relax(scenario, &accurate, &mut |_| {})?;
    if !accurate.outcome.is_at_rest() {
        return Ok(None);
    }
    let start = (&accurate.shape.stations[..], &accurate.shape.rods[..]);
    relax::relax_from(scenario, start, on_grid, &mut |_| {}).map(Some)
}

/// The scenario with the loads, the wind and the rest shape at time 0.
pub(super) fn scenario_at_start(scenario: &Scenario) -> Scenario {
    let mut scenario = scenario.at_time(0.0);
    let factor = scenario.dynamics.rest.at(0.0);
    let air = scenario.wind.as_ref().map(|wind| wind.velocity.at(0.0));
    match (&mut scenario.wind, air) {
        (Some(wind), Some(air)) if air != [0.0; 3] => wind.velocity = Schedule::constant(air),
        (wind, _) => *wind = None,
    }
    if factor != 1.0 {
        let natural = Arc::new(scenario.clone());
        scenario.natural = Some(NaturalShapes {
            scenario: natural,
            factor,
        });
    }
    let rods = scenario.rods.iter_mut();
    for curvature in rods.flat_map(|rod| &mut rod.rest_curvature) {
        *curvature = curvature.scaled(factor);
    }
    scenario
}

/// When a start counts as an unstable equilibrium.
pub(super) struct UnstableStartTest {
    /// Largest distance of a start from the equilibrium that it is compared with, in lengths.
    largest_distance: f64,
    /// Largest deviation from that equilibrium along an unstable mode, radians or lengths, that is
    /// none: it would have to grow by e fourteen times.
    negligible_deviation: f64,
    /// Accuracy of these modes.
    mode_accuracy: f64,
}

pub(super) const UNSTABLE_START: UnstableStartTest = UnstableStartTest {
    largest_distance: 0.1,
    negligible_deviation: 1e-6,
    mode_accuracy: 1e-9,
};

/// The doubt about a start at an unstable equilibrium, or beside one but without a deviation along
/// its unstable modes, such as that of a straight column under its weight.
pub(crate) fn unstable_start_doubt(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    start: &State,
) -> Option<MotionDoubt> {
    let mut leaf = leaf.clone();
    physics.apply_loads(&mut leaf, 0.0);
    if !leaf.leaf.has_potential() || leaf.loads.has_moments() || !physics.clamped() {
        // Its rest is no minimum of an energy, or it has none.
        return None;
    }
    leaf.scale_rest_curvatures(physics.rest_curvature_factor(0.0));
    let (mut system, mut work) = (System::new(&leaf), SolverCounts::default());
    if !may_be_near(&leaf, start, &mut system) {
        return None;
    }
    let mut exact = start.clone();
    let index =
        converge_saddle(&leaf, &mut exact, &mut system, &mut work).filter(|&index| index > 0)?;
    let wanted = ModeRequest {
        count: index,
        modes_below: None,
        accuracy: UNSTABLE_START.mode_accuracy,
        approximate_modes: &[],
        time: &Limit::default(),
    };
    let mut modes = lowest(&leaf, physics, &exact, wanted)?;
    modes.retain(|mode| mode.eigenvalue < 0.0);
    let fastest = -modes.first()?.eigenvalue;
    let deviates = |mode: &Eigenpair| {
        mode_deviation(&leaf, physics, (&exact, start), &mode.shape)
            > UNSTABLE_START.negligible_deviation
    };
    if modes.iter().any(deviates) {
        return None;
    }
    Some(MotionDoubt::UnstableStart {
        index,
        growth_time: physics.time_unit / fastest.sqrt(),
    })
}

/// Whether the first step of Newton's method is short enough for an equilibrium nearby.
pub(super) fn may_be_near(leaf: &DiscreteLeaf, start: &State, system: &mut System) -> bool {
    let mut next = start.clone();
    let first = NewtonIteration {
        accuracy: 0.0,
        iterations: 1,
        work: &mut SolverCounts::default(),
        progress: &mut |_, _| {},
    };
    // It is not converged after one step.
    let _ = first.solve(leaf, &mut next, system, INDEFINITE_NEWTON_EQUATIONS);
    start.largest_displacement_to(&next) < UNSTABLE_START.largest_distance
}

/// The largest rotation or displacement in the part along a mode of what leads from one state to
/// another. Modes are orthonormal in the mass product.
pub(super) fn mode_deviation(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    (from, to): (&State, &State),
    mode: &[Increment],
) -> f64 {
    let (mut field, mut along, mut largest) = (Vec::new(), 0.0, 0.0_f64);
    from.increments_to(to, leaf.first_node(), &mut field);
    for (j, i) in leaf.rod_index_pairs(leaf.moving_nodes()) {
        let (k, inertia) = (from.base(j) + i, physics.inertia(leaf, j, i));
        let (off, mode, tensor) = (
            &field[j][i - leaf.first_node()],
            &mode[k],
            inertia.tensor(from.q[k]),
        );
        along += rotation_part(mode).dot(tensor * rotation_part(off))
            + inertia.mass * displacement_part(mode).dot(displacement_part(off));
        if inertia.is_off_axis() {
            let s = inertia.first_moment(from.q[k]);
            along += rotation_part(mode).dot(s.cross(displacement_part(off)))
                + displacement_part(mode).dot(rotation_part(off).cross(s));
        }
        largest = largest
            .max(rotation_part(mode).length())
            .max(displacement_part(mode).length());
    }
    along.abs() * largest
}
