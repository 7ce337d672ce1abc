//! A parameter of a scenario, and finite differences of the scenario with respect to it.

use crate::scenario::Scenario;
use std::sync::Arc;

/// Relative step of finite differences with respect to a parameter on which the scenario
/// depends linearly: large, since rounding is the only error.
const LINEAR: f64 = 0.125;

/// Relative step for other parameters, with differences of fourth order.
const NONLINEAR: f64 = 1e-3;

/// Relative step of differences of eigenvalues, whose modes may be close together, and of
/// clamp moments.
const NEIGHBOURING: f64 = 3e-4;

/// Offsets (in steps) and weights of the central and the one-sided fourth-order differences.
const CENTRAL: [(f64, f64); 4] = [
    (-2.0, 1.0 / 12.0),
    (-1.0, -2.0 / 3.0),
    (1.0, 2.0 / 3.0),
    (2.0, -1.0 / 12.0),
];
const ONE_SIDED: [(f64, f64); 5] = [
    (0.0, -25.0 / 12.0),
    (1.0, 4.0),
    (2.0, -3.0),
    (3.0, 4.0 / 3.0),
    (4.0, -0.25),
];

/// A numerical parameter of a scenario.
pub(crate) struct Parameter<'a> {
    /// The scenario with another value of the parameter, if that is admissible.
    pub make: Box<dyn Fn(f64) -> Option<Scenario> + Send + Sync + 'a>,
    /// Its value.
    pub value: f64,
    /// Size used for the step where the value is zero.
    pub unit: f64,
    /// Whether the scenario is linear in it.
    pub linear: bool,
}

impl Parameter<'_> {
    fn size(&self) -> f64 {
        match self.value.abs() {
            size if size > 0.0 => size,
            _ => self.unit,
        }
    }

    /// Scenarios with their offsets and weights by the first of these rules, in either
    /// direction, all of whose scenarios are admissible.
    fn differences(&self, step: f64, rules: &[&[(f64, f64)]]) -> Option<Vec<(f64, f64, Scenario)>> {
        let signs = [1.0, -1.0];
        let mut tried = (rules.iter()).flat_map(|rule| signs.map(|sign| (*rule, sign)));
        tried.find_map(|(rule, sign)| {
            let step = sign * step;
            let at = |(steps, weight): &(f64, f64)| {
                let offset = steps * step;
                let scenario = (self.make)(self.value + offset)?;
                Some((offset, weight / step, scenario))
            };
            rule.iter().map(at).collect()
        })
    }

    /// The derivative of the scenario as a weighted sum of scenarios.
    pub fn rate(&self) -> Option<Vec<(f64, Scenario)>> {
        let found = match self.linear {
            true => self.differences(LINEAR * self.size(), &[&[(0.0, -1.0), (1.0, 1.0)]]),
            false => self.differences(NONLINEAR * self.size(), &[&CENTRAL, &ONE_SIDED]),
        };
        let terms = found?.into_iter();
        Some(
            terms
                .map(|(_, weight, scenario)| (weight, scenario))
                .collect(),
        )
    }

    /// Neighbouring scenarios with their offsets and the finite-difference weights for a
    /// function of the scenario.
    pub fn nearby(&self) -> Option<Vec<(f64, f64, Arc<Scenario>)>> {
        let found = self.differences(NEIGHBOURING * self.size(), &[&CENTRAL, &ONE_SIDED])?;
        let shared = |(offset, weight, scenario)| (offset, weight, Arc::new(scenario));
        Some(found.into_iter().map(shared).collect())
    }
}
