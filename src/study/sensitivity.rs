//! A leaf at rest, and its derivatives with respect to numbers of its scenario.

use super::{Base, Keys, VaryError};
use crate::relax::{
    Equilibrium, Follower, Options, Parameter, Progress, RelaxError, Sensitivity, relax_on_grids,
    sensitivities, without_wind,
};
use crate::scenario::Scenario;

/// Why there are no derivatives.
#[derive(Debug, thiserror::Error)]
pub enum SensitivityError {
    /// Numbers that cannot vary.
    #[error(transparent)]
    Vary(#[from] VaryError),
    /// A relaxation that cannot be run.
    #[error(transparent)]
    Relax(#[from] RelaxError),
    /// Shooting has no grids on which equations are linearised.
    #[error("sensitivities are those of a relaxed leaf: use the method semi-implicit")]
    Method,
}

/// Relaxes the leaf of `base` and computes the derivatives of its tip, its energy and its lowest
/// eigenvalue with respect to these numbers of its scenario, as
/// [`Equilibrium::sensitivities`]; none if the leaf is not at rest.
pub fn relax_with_sensitivities(
    base: &Base,
    keys: &[Keys],
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, SensitivityError> {
    if options.method.is_shooting() {
        return Err(SensitivityError::Method);
    }
    let scenario = base.scenario();
    without_wind(scenario, "a derivative")?;
    let values = values(base, keys)?;
    let numbers = numbers(base, &values);
    let (mut leaf, found) = relax_on_grids(scenario, options, false, progress)?;
    let at_rest = leaf.accuracy.residual.is_some() && leaf.outcome.is_at_rest();
    let turns = leaf.stability.neutral_directions > 0;
    let turnings = bent_turnings(scenario);
    let (none, known): (Vec<_>, Vec<_>) = (numbers.into_iter())
        .partition(|(_, number)| at_rest && turns && decides_where_it_turns(number, turnings));
    leaf.doubts
        .extend(none.iter().map(|(key, _)| no_derivative(key)));
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

/// The same derivatives of a leaf that follows, and is where `base` has it.
pub fn sensitivities_of(
    follower: &Follower,
    base: &Base,
    keys: &[Keys],
) -> Result<Vec<Sensitivity>, SensitivityError> {
    let scenario = base.scenario();
    without_wind(scenario, "a derivative")?;
    let values = values(base, keys)?;
    let numbers = numbers(base, &values);
    Ok(sensitivities(
        follower.levels(),
        &numbers,
        scenario.tolerance,
        0,
    ))
}

/// Each of the keys with its number.
fn values<'k>(base: &Base, keys: &'k [Keys]) -> Result<Vec<(&'k Keys, f64)>, VaryError> {
    keys.iter()
        .map(|keys| Ok((keys, base.value(keys)?)))
        .collect()
}

/// These numbers by their names.
fn numbers<'v>(base: &'v Base, values: &'v [(&'v Keys, f64)]) -> Vec<(String, Parameter<'v>)> {
    let unit = |keys: &Keys| keys.unit(base.scenario());
    let each = values.chunks(1);
    each.map(|own| (own[0].0.to_string(), base.parameter(own, 0, unit(own[0].0))))
        .collect()
}

/// Whether of so many groups of veins that turn about their base without resistance fewer do after
/// a change of this number: then the smallest change decides where they turn to.
fn decides_where_it_turns(number: &Parameter, turnings: usize) -> bool {
    let near = number.rate().unwrap_or_default();
    near.iter()
        .any(|(_, scenario)| bent_turnings(scenario) < turnings)
}

fn bent_turnings(scenario: &Scenario) -> usize {
    scenario.turnings().iter().filter(|it| it.bent).count()
}

fn no_derivative(key: &str) -> String {
    format!(
        "{key} has no derivative: the leaf turns about its base without resistance, and the smallest \
         change of this number decides where it turns to"
    )
}
