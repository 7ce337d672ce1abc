//! A leaf at rest with the derivatives of its results with respect to numbers of its scenario; and a blade
//! at rest with the effect of its division into veins, told by the same blade with half as many veins, and
//! with narrower ends.

use crate::numbers::largest;
use crate::relax::{
    Equilibrium, EquilibriumDoubt, EquilibriumTracker, FewerVeins, Options, Parameter, Progress,
    RelaxError, RelaxedLeaf, Sensitivity, relax, relax_on_grids, sensitivities, without_wind,
};
use crate::scenario::Scenario;
use crate::study::judge::SAME_STATION_DISTANCE;
use crate::study::{BaseScenario, ParameterKeys, VaryError};
use glam::DVec3;

/// Why there are no derivatives.
#[derive(Debug, thiserror::Error)]
pub enum SensitivityError {
    /// Numbers that cannot vary.
    #[error(transparent)]
    Vary(#[from] VaryError),
    /// A relaxation that cannot be run.
    #[error(transparent)]
    Relax(#[from] RelaxError),
    /// Shooting has no grids on which equations are linearized.
    #[error("sensitivities are those of a relaxed leaf: use the method semi-implicit")]
    Method,
}

/// Relaxes the leaf of `base` and computes the derivatives of its tip, its energy and its lowest
/// eigenvalue with respect to these numbers of its scenario, as
/// [`Equilibrium::sensitivities`]; none if the leaf is not at rest.
pub fn relax_with_sensitivities(
    base: &BaseScenario,
    keys: &[ParameterKeys],
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, SensitivityError> {
    if options.method.is_shooting() {
        return Err(SensitivityError::Method);
    }
    let scenario = base.scenario();
    without_wind(scenario, "a derivative")?;
    let values = values_of_keys(base, keys)?;
    let numbers = named_parameters(base, &values);
    let RelaxedLeaf {
        result: mut leaf,
        on_grids: found,
    } = relax_on_grids(scenario, options, false, progress)?;
    let at_rest = leaf.accuracy.residual.is_some() && leaf.outcome.is_at_rest();
    let turns = leaf.stability.neutral_directions > 0;
    let turnings = count_zero_energy_rotations(scenario);
    let (none, known): (Vec<_>, Vec<_>) = (numbers.into_iter()).partition(|(_, number)| {
        at_rest && turns && decides_zero_energy_rotation(number, turnings)
    });
    leaf.doubts
        .extend((none.into_iter()).map(|(key, _)| EquilibriumDoubt::NoDerivative { key }));
    leaf.sensitivities = Some(match at_rest {
        true => sensitivities(
            &found.levels,
            &known,
            leaf.accuracy.tolerance,
            options.modes,
        ),
        false => Vec::new(),
    });
    Ok(leaf)
}

/// Derivatives of the tip, the energy and the lowest eigenvalue of a leaf that is followed, where
/// `base` has it now.
pub fn sensitivities_of_tracker(
    follower: &EquilibriumTracker,
    base: &BaseScenario,
    keys: &[ParameterKeys],
) -> Result<Vec<Sensitivity>, SensitivityError> {
    let scenario = base.scenario();
    without_wind(scenario, "a derivative")?;
    let values = values_of_keys(base, keys)?;
    let numbers = named_parameters(base, &values);
    Ok(sensitivities(
        follower.levels(),
        &numbers,
        scenario.tolerance,
        0,
    ))
}

/// Each of the keys with its number.
fn values_of_keys<'k>(
    base: &BaseScenario,
    keys: &'k [ParameterKeys],
) -> Result<Vec<(&'k ParameterKeys, f64)>, VaryError> {
    keys.iter()
        .map(|keys| Ok((keys, base.differentiable_value(keys)?)))
        .collect()
}

/// The numbers as parameters of the scenario, by their names.
fn named_parameters<'v>(
    base: &'v BaseScenario,
    values: &'v [(&'v ParameterKeys, f64)],
) -> Vec<(String, Parameter<'v>)> {
    let unit = |keys: &ParameterKeys| keys.reference_magnitude(base.scenario());
    let each = values.chunks(1);
    each.map(|own| (own[0].0.to_string(), base.parameter(own, 0, unit(own[0].0))))
        .collect()
}

/// Whether of so many groups of veins that turn about their base without resistance fewer do after
/// a change of this number: then the smallest change decides where they turn to.
fn decides_zero_energy_rotation(number: &Parameter, turnings: usize) -> bool {
    let near = number.rate().unwrap_or_default();
    near.iter()
        .any(|it| count_zero_energy_rotations(&it.term) < turnings)
}

fn count_zero_energy_rotations(scenario: &Scenario) -> usize {
    scenario
        .zero_energy_rotations()
        .iter()
        .filter(|it| it.includes_bent_veins)
        .count()
}

/// Tolerance of the blades that a blade is compared with.
const COMPARED_BLADE_TOLERANCE: f64 = 1e-4;

/// Relaxes the leaf of `base` and, if it is a blade that comes to rest in a stable equilibrium,
/// compares it with others: [`Equilibrium::blade`] tells how far they are apart. Neither is
/// computed for a fixed grid, or by other methods than the semi-implicit one.
///
/// # Errors
/// If it cannot be relaxed; where the others cannot be, they are left out.
pub fn relax_blade(
    base: &BaseScenario,
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    let mut leaf = relax(base.scenario(), options, progress)?;
    let refines = (options.method.semi_implicit()).is_some_and(|how| how.segments.is_none());
    let (Some(blade), Some(true), true) = (leaf.blade.as_ref(), leaf.stable(), refines) else {
        return Ok(leaf);
    };
    let narrows = blade.least_width.is_some();
    let other = |key: &str, value: f64| -> Option<(Scenario, Equilibrium)> {
        let keys: ParameterKeys = key.parse().ok()?;
        let scenario = base.scenario_with_values(&[(&keys, value)]).ok()?.scenario;
        let options = Options {
            tolerance: Some(leaf.accuracy.tolerance.max(COMPARED_BLADE_TOLERANCE)),
            modes: 0,
            every_node: false,
            ..options.clone()
        };
        let found = relax(&scenario, &options, &mut |_| {}).ok()?;
        (found.stable() == Some(true)).then_some((scenario, found))
    };
    let least = base
        .scenario()
        .blade
        .as_ref()
        .map(|blade| blade.least_width_fraction());
    let narrower = least
        .filter(|_| narrows)
        .and_then(|least| other(LEAST_WIDTH_KEY, 0.5 * least));
    let effect = narrower
        .map(|(_, found)| largest_blade_distance(base.scenario(), &leaf, base.scenario(), &found));
    let rods = leaf.rod_count.div_ceil(2);
    // Loads and holders of single veins are on others then.
    let alike = base.scenario().points.is_empty() && base.scenario().grips.is_empty();
    let fewer = (alike && leaf.rod_count > 2)
        .then(|| other(RODS_KEY, rods as f64))
        .flatten();
    let half = fewer.map(|(scenario, found)| FewerVeins {
        rods,
        difference: largest_blade_distance(base.scenario(), &leaf, &scenario, &found),
    });
    if let Some(blade) = &mut leaf.blade {
        (blade.least_width_effect, blade.half_as_many) = (effect, half);
    }
    Ok(leaf)
}

const LEAST_WIDTH_KEY: &str = "blade.least_width";

const RODS_KEY: &str = "leaf.rods";

/// The largest distance of the veins of one blade from the surface through those of another, at
/// stations in common.
fn largest_blade_distance(
    whole: &Scenario,
    leaf: &Equilibrium,
    other: &Scenario,
    fewer: &Equilibrium,
) -> f64 {
    let (Some(blade), Some(fewer_blade)) = (&whole.blade, &other.blade) else {
        return f64::NAN;
    };
    let etas: Vec<f64> = (0..leaf.rod_count)
        .map(|j| blade.vein_position(j))
        .collect();
    let vein = |k: usize| {
        let eta = fewer_blade.vein_position(k);
        let right = etas.partition_point(|of| *of < eta).min(etas.len() - 1);
        let left = right.saturating_sub(1);
        // A single vein is compared with a single one.
        let part = match left == right {
            true => 0.0,
            false => (eta - etas[left]) / (etas[right] - etas[left]),
        };
        let shape = &fewer.shape;
        let stations = shape.stations.iter().zip(&shape.rods[k].nodes);
        let apart = stations.filter_map(|(sigma, node)| {
            let same = |station: &f64| (station - sigma).abs() < SAME_STATION_DISTANCE;
            let at = leaf.shape.stations.iter().position(same)?;
            let [a, b]: [DVec3; 2] = [left, right].map(|j| leaf.shape.rods[j].nodes[at].position);
            Some(a.lerp(b, part).distance(node.position))
        });
        largest(apart.collect::<Vec<f64>>())
    };
    largest((0..fewer.rod_count).map(vein))
}
