//! A number of a scenario, and how the scenario changes with it.

use crate::scenario::Scenario;
use std::sync::Arc;

/// Step by which a scenario is differenced with a number in which it is linear, as
/// a part of the number: large, as only rounding makes an error.
const LINEAR: f64 = 0.125;

/// And with others, where four differences leave an error of the fourth order.
const CURVED: f64 = 1e-3;

/// Step of differences of what the matrix gives, whose modes may be close together.
const SMALL: f64 = 3e-4;

/// Weights of differences at -2, -1, 1, 2 steps, and at 0 to 4 steps.
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

/// A number of a scenario.
pub(crate) struct Number<'a> {
    /// The scenario with another value of it, if there can be such.
    pub make: &'a (dyn Fn(f64) -> Option<Scenario> + Sync),
    /// Its value.
    pub value: f64,
    /// What it is measured by where it is zero.
    pub unit: f64,
    /// Whether the scenario is linear in it.
    pub linear: bool,
}

impl Number<'_> {
    fn size(&self) -> f64 {
        match self.value.abs() {
            size if size > 0.0 => size,
            _ => self.unit,
        }
    }

    /// Scenarios with their offsets and weights, by the first of these rules that
    /// asks for none that cannot be.
    fn by(&self, step: f64, rules: &[&[(f64, f64)]]) -> Option<Vec<(f64, f64, Scenario)>> {
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

    /// The change of the scenario: scenarios with weights.
    pub fn rate(&self) -> Option<Vec<(f64, Scenario)>> {
        let found = match self.linear {
            true => self.by(LINEAR * self.size(), &[&[(0.0, -1.0), (1.0, 1.0)]]),
            false => self.by(CURVED * self.size(), &[&CENTRAL, &ONE_SIDED]),
        };
        let terms = found?.into_iter();
        Some(
            terms
                .map(|(_, weight, scenario)| (weight, scenario))
                .collect(),
        )
    }

    /// Scenarios nearby, with their offsets and the weights by which a function of
    /// them is differenced.
    pub fn nearby(&self) -> Option<Vec<(f64, f64, Arc<Scenario>)>> {
        let found = self.by(SMALL * self.size(), &[&CENTRAL, &ONE_SIDED])?;
        let shared = |(offset, weight, scenario)| (offset, weight, Arc::new(scenario));
        Some(found.into_iter().map(shared).collect())
    }
}
