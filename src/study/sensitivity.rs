//! A leaf at rest with the derivatives of its results with respect to numbers of its scenario.

use crate::relax::{
    Equilibrium, EquilibriumDoubt, EquilibriumTracker, Options, Parameter, Progress, RelaxError,
    RelaxedLeaf, Sensitivity, relax_on_grids, sensitivities,
};
use crate::scenario::Scenario;
use crate::study::{BaseScenario, ParameterKeys, VaryError};

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
/// [`Equilibrium::sensitivities`]; none if the leaf is not at rest. A key of a list or of a profile stands
/// for all of its entries, or the values at all of its knots.
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
    let keys = keys_of_numbers(base, keys);
    let values = values_of_keys(base, &keys)?;
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
/// `base` has it now; the energy is not a number where loads have no potential.
pub fn sensitivities_of_tracker(
    follower: &EquilibriumTracker,
    base: &BaseScenario,
    keys: &[ParameterKeys],
) -> Result<Vec<Sensitivity>, SensitivityError> {
    let values = values_of_keys(base, keys)?;
    let numbers = named_parameters(base, &values);
    Ok(sensitivities(
        follower.levels(),
        &numbers,
        base.scenario().tolerance,
        0,
    ))
}

/// The keys with every entry of a list and every knot of a profile in place of these.
fn keys_of_numbers(base: &BaseScenario, keys: &[ParameterKeys]) -> Vec<ParameterKeys> {
    let each = keys.iter().flat_map(|keys| base.keys_by_entry(keys));
    each.collect()
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
