//! Explicit motion with one time step, stable or not: the answer of a plain simulation
//! of the damped leaf.

use crate::largest::largest;
use crate::leaf::{DiscreteLeaf, Grid, Leaf};
use crate::limit::Limit;
use crate::motion::{Explicit, TimeIntegrator, Physics, Stopped};
use crate::relax::{self, Outcome, RelaxError, Work, index_near, shape_of, start};
use crate::scenario::Scenario;
use crate::study::judge::{Answer, SAME_LEAF, fine_grid, grid_error};
use crate::undulation::Undulation;
use glam::DVec3;

use super::row::{Found, MapOutcome};
use crate::study::vary::{Knobs, Varied};

/// Default number of segments per rod: as in a simulation.
const MOTION_SEGMENTS: usize = 16;

/// Largest number of stations at which answers are compared.
const MOST_STATIONS: usize = 4096;

/// Steps between checks of the time limit.
const LOOK: f64 = 1000.0;

/// Moves the leaf, released from the initial state of a relaxation, for the scenario's
/// duration under the loads of its dynamics, in steps of `method.step`.
pub fn answer_of_motion(scenario: &Scenario, knobs: Knobs, tolerance: f64, limit: &Limit) -> Found {
    let refused = |why: String| Err((MapOutcome::Refused, why));
    let Some(step) = knobs.step else {
        return refused("explicit motion needs method.step".into());
    };
    let leaf = Leaf::new(scenario);
    let grid = match grid(&leaf, knobs) {
        Ok(grid) => grid,
        Err(error) => return refused(error.to_string()),
    };
    let physics = Physics::new(&leaf);
    if !physics.clamped() {
        return refused("a free leaf has no place to rest in".into());
    }
    let discrete = DiscreteLeaf::new(&leaf, grid.clone());
    let state = start(&discrete);
    let h = step / physics.time;
    let Ok(mut motion) = Explicit::new(discrete, physics.clone(), &state, Some(h)) else {
        return refused("no time step is stable for rigid rods (a stiffness is inf)".into());
    };
    let stable = motion.stable_step();
    let (most, why) = (stable.step * physics.time, stable.limit);
    let note = format!("step {step:.3e}, stable up to {most:.3e} because of {why}");
    let failed = |outcome, what: String| Err((outcome, format!("{what}; {note}")));
    let (duration, _) = physics.duration();
    while motion.time() < duration {
        let until = motion.time() + LOOK * h;
        if let Err(stopped) = motion.advance(until.min(duration)) {
            let (Stopped::Unresolved { time, .. }
            | Stopped::HalfTurn { time, .. }
            | Stopped::Diverged { time, .. }
            | Stopped::StepTooShort { time, .. }
            | Stopped::Interrupted { time }) = stopped;
            let at = format!("at t = {:.3e}", time * physics.time);
            return match stopped {
                Stopped::Unresolved { turn, .. } => {
                    let bent = format!("a segment bends by {turn:.2} rad, more than it resolves");
                    failed(MapOutcome::NotConverged, format!("{at} {bent}"))
                }
                Stopped::HalfTurn { half_turn, .. } => failed(
                    MapOutcome::NotConverged,
                    format!("{at} {}", half_turn.sentence()),
                ),
                _ => failed(MapOutcome::Diverged, format!("numerical instability {at}")),
            };
        }
        if limit.reached() {
            // Past the limit it counts as out of time, whatever is returned here.
            return failed(MapOutcome::OutOfTime, "still moving".into());
        }
    }
    let end = motion.snapshot();
    let speeds = end
        .velocity
        .iter()
        .map(|v| [v.linear, v.angular].map(DVec3::length));
    let fastest = largest(speeds.flatten());
    if fastest > tolerance {
        let moves = format!("still moves by {fastest:.1e} lengths in a unit of time");
        return failed(MapOutcome::NotConverged, moves);
    }
    let rods = shape_of(&DiscreteLeaf::new(&leaf, grid.clone()), &end.state);
    let index = index_near(scenario, grid.clone(), &rods, SAME_LEAF * leaf.scale.length);
    if index.is_none() && !leaf.loads.has_moments() {
        return failed(MapOutcome::NotConverged, "slow, but not at rest".into());
    }
    let length = leaf.scale.length;
    let error = grid_error(scenario, grid.segments(), tolerance, limit);
    let estimate = error.unwrap_or(SAME_LEAF * length) + tolerance * length;
    Ok(Answer {
        outcome: Outcome::Converged,
        remark: Some(note),
        undulation: Undulation::at_stations(scenario, grid.sigma(), &rods, Some(estimate)),
        stations: grid.sigma().to_vec(),
        rods,
        energy: (end.energy.elastic + end.energy.coupling + end.energy.potential)
            * leaf.scale.moment(),
        index,
        error_estimate: Some(estimate),
        work: Work::default(),
    })
}

/// The grid, of as many segments as are set or needed.
fn grid(leaf: &Leaf, knobs: Knobs) -> Result<Grid, RelaxError> {
    let segments = relax::check_segments(leaf, knobs.segments, MOTION_SEGMENTS)?;
    Ok(Grid::new(segments, leaf.kinks()))
}

/// The longest step known to be stable.
pub fn stable_step(varied: &Varied) -> Option<f64> {
    let leaf = Leaf::new(&varied.scenario);
    let grid = grid(&leaf, varied.knobs).ok()?;
    let physics = Physics::new(&leaf);
    let discrete = DiscreteLeaf::new(&leaf, grid);
    let state = start(&discrete);
    let time = physics.time;
    let motion = Explicit::new(discrete, physics, &state, Some(1.0)).ok()?;
    Some(motion.stable_step().step * time)
}

/// Additional stations that a reference should have.
pub fn stations(scenario: &Scenario, knobs: Knobs) -> Vec<f64> {
    let leaf = Leaf::new(scenario);
    match relax::check_segments(&leaf, knobs.segments, MOTION_SEGMENTS) {
        Ok(segments) if knobs.segments.is_some() => {
            let grid = fine_grid(scenario, segments);
            let every = grid.segments().div_ceil(MOST_STATIONS);
            let some = grid.sigma().iter().copied().step_by(every);
            some.chain([1.0]).collect()
        }
        _ => vec![0.0, 1.0],
    }
}
