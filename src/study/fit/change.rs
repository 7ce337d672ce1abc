//! Derivatives of a scenario with respect to the free numbers, and the scenario after a step.

use std::sync::Arc;

use crate::scenario::{Profile, Rod, Scenario};

/// Derivative of a scenario with respect to a number: scenarios with finite-difference weights.
pub(super) type Change = Arc<Vec<(f64, Scenario)>>;

/// Increments of numbers of a scenario: the place of a group in [`numbers`], and those of its
/// numbers.
pub(super) struct Addition {
    parts: Vec<(usize, Vec<f64>)>,
}

/// The numbers of a scenario that may change, in groups: profiles of each rod, none for one that
/// is not given by numbers, then the coupling of each gap, then the loads.
fn numbers(scenario: &Scenario) -> Vec<&[f64]> {
    let profiles = scenario.rods.iter().flat_map(Rod::profiles);
    let mut all: Vec<&[f64]> = profiles.map(Profile::numbers).collect();
    all.extend(scenario.coupling.iter().map(|gap| gap.as_slice()));
    all.extend([
        &scenario.gravity[..],
        &scenario.tip_force,
        &scenario.tip_moment,
    ]);
    all
}

/// The same, to be changed.
fn numbers_mut(scenario: &mut Scenario) -> Vec<&mut [f64]> {
    let profiles = scenario.rods.iter_mut().flat_map(Rod::profiles_mut);
    let mut all: Vec<&mut [f64]> = profiles.map(Profile::numbers_mut).collect();
    all.extend(scenario.coupling.iter_mut().map(|gap| gap.as_mut_slice()));
    let loads = [
        &mut scenario.gravity,
        &mut scenario.tip_force,
        &mut scenario.tip_moment,
    ];
    all.extend(loads.map(|load| load.as_mut_slice()));
    all
}

impl Addition {
    /// The increments per unit of a number in which a scenario is linear; `None` if it changes
    /// anything but the numbers of a profile, of the coupling or of the loads.
    pub fn new(change: &[(f64, Scenario)]) -> Option<Addition> {
        let known = numbers(&change.first()?.1);
        let others: Vec<_> = (change.iter())
            .map(|(weight, other)| (weight, numbers(other)))
            .collect();
        let mut parts = Vec::new();
        for (place, known) in known.into_iter().enumerate() {
            let mut sum = vec![0.0; known.len()];
            for (weight, other) in &others {
                let values = other[place];
                if values.len() != known.len() {
                    return None;
                }
                for ((sum, value), known) in sum.iter_mut().zip(values).zip(known) {
                    // Infinite values do not change.
                    if value != known {
                        *sum += *weight * (value - known);
                    }
                }
            }
            if !sum.iter().all(|value| value.is_finite()) {
                return None;
            }
            if sum.iter().any(|value| *value != 0.0) {
                parts.push((place, sum));
            }
        }
        Some(Addition { parts })
    }

    pub fn add(&self, scenario: &mut Scenario, times: f64) {
        let mut all = numbers_mut(scenario);
        for (place, part) in &self.parts {
            for (value, part) in all[*place].iter_mut().zip(part) {
                *value += times * part;
            }
        }
    }
}
