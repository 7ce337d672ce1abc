//! A relaxation by any of the methods, as accurate between the stations as requested.

use crate::memory;
use crate::refusal::RefusedOption;
use crate::relax::request::options::{
    MOST_MODES, Options, Progress, RelaxError, SMALLEST_TOLERANCE, check_tolerance,
};
use crate::relax::rest::relax_on_grids;
use crate::relax::result::equilibrium::Equilibrium;
use crate::relax::shooting;
use crate::scenario::Scenario;

/// Factor on the tolerance of a leaf that does not keep it between the stations of its
/// solution, in layers thinner than the distance of these.
const FOR_STATIONS: f64 = 1e-2;

/// Brings a scenario's leaf to rest.
///
/// # Errors
/// Requests that cannot be met; everything that happens while solving is an
/// [`Outcome`](crate::relax::Outcome) instead.
pub fn relax(
    scenario: &Scenario,
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    if let Some(stations) = options.stations {
        memory::stations(scenario.rods.len(), stations)?;
    }
    let found = relax_once(scenario, options, progress)?;
    let Some(parts) = options.stations else {
        return Ok(found);
    };
    if found.keeps_tolerance_at(scenario, parts) {
        return Ok(found);
    }
    let tolerance = found.accuracy.tolerance;
    let sharper = Options {
        tolerance: Some((FOR_STATIONS * tolerance).max(SMALLEST_TOLERANCE)),
        ..options.clone()
    };
    let mut sharp = relax_once(scenario, &sharper, progress)?;
    sharp.accuracy.tolerance = tolerance;
    let mut tips = sharp.tips.iter().zip(&found.tips);
    let apart = 2.0 * tolerance * found.shape.longest();
    let same = sharp.stability.negative_eigenvalues == found.stability.negative_eigenvalues
        && tips.all(|(one, other)| one.distance(*other) <= apart);
    if !same || !sharp.keeps_tolerance() || !sharp.keeps_tolerance_at(scenario, parts) {
        return Ok(found);
    }
    sharp.wall_seconds += found.wall_seconds;
    Ok(Equilibrium {
        outcome: found.outcome,
        remark: found.remark,
        work: found.work + sharp.work,
        ..sharp
    })
}

/// Relaxes once, whatever the stations.
fn relax_once(
    scenario: &Scenario,
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
    check_tolerance(tolerance)?;
    if options.modes > MOST_MODES {
        let allowed = format!("allowed are 0 to {MOST_MODES}");
        return Err(RefusedOption::new("modes", options.modes, allowed).into());
    }
    if options.mode_shapes && options.method.is_shooting() {
        // Shooting has no grids on which eigenvalues are computed.
        let why = "modes are those of a relaxed leaf: use the method semi-implicit";
        return Err(RefusedOption::new("modes", options.modes, why).into());
    }
    if options.method.is_shooting() {
        return shooting::relax(scenario, options, tolerance, progress);
    }
    let shape_alone = options.modes == 0;
    relax_on_grids(scenario, options, shape_alone, progress).map(|(found, _)| found)
}
