//! Derivatives of a scenario with respect to the free numbers, and the scenario after a step.

use std::sync::Arc;

use crate::scenario::{Profile, Scenario};

/// Derivative of a scenario with respect to a number: scenarios with finite-difference weights.
pub(super) type Change = Arc<Vec<(f64, Scenario)>>;

/// Position of numbers in a scenario that may change.
#[derive(Clone, Copy, Debug)]
enum Slot {
    /// Of a rod: its number, and that of its profile.
    Profile(usize, usize),
    Coupling(usize),
    Load(usize),
}

/// Increments of numbers of a scenario.
pub(super) struct Addition {
    parts: Vec<(Slot, Vec<f64>)>,
}

/// Number of profiles of a rod.
const PROFILES: usize = 10;

fn profile(scenario: &Scenario, rod: usize, number: usize) -> &Profile {
    let rod = &scenario.rods[rod];
    match number {
        0..3 => &rod.couple_stiffness[number],
        3..6 => &rod.force_stiffness[number - 3],
        6..9 => &rod.rest_curvature[number - 6],
        _ => &rod.rest_stretch,
    }
}

/// The numbers at a position; empty for a profile that is not given by numbers.
fn numbers(scenario: &Scenario, slot: Slot) -> &[f64] {
    match slot {
        Slot::Profile(rod, number) => match profile(scenario, rod, number) {
            Profile::Constant(value) => std::slice::from_ref(value),
            Profile::Linear { value, .. } => value,
            Profile::Section { .. } => &[],
        },
        Slot::Coupling(gap) => &scenario.coupling[gap],
        Slot::Load(0) => &scenario.gravity,
        Slot::Load(1) => &scenario.tip_force,
        Slot::Load(_) => &scenario.tip_moment,
    }
}

fn numbers_mut(scenario: &mut Scenario, slot: Slot) -> &mut [f64] {
    match slot {
        Slot::Profile(rod, number) => {
            let rod = &mut scenario.rods[rod];
            let profile = match number {
                0..3 => &mut rod.couple_stiffness[number],
                3..6 => &mut rod.force_stiffness[number - 3],
                6..9 => &mut rod.rest_curvature[number - 6],
                _ => &mut rod.rest_stretch,
            };
            match profile {
                Profile::Constant(value) => std::slice::from_mut(value),
                Profile::Linear { value, .. } => value,
                Profile::Section { .. } => &mut [],
            }
        }
        Slot::Coupling(gap) => &mut scenario.coupling[gap],
        Slot::Load(0) => &mut scenario.gravity,
        Slot::Load(1) => &mut scenario.tip_force,
        Slot::Load(_) => &mut scenario.tip_moment,
    }
}

impl Addition {
    /// The increments per unit of a number in which a scenario is linear; `None` if it changes
    /// anything but the numbers of a profile, of the coupling or of the loads.
    pub fn new(change: &[(f64, Scenario)]) -> Option<Addition> {
        let first = &change.first()?.1;
        let rods = first.rods.len();
        let profiles = (0..rods).flat_map(|j| (0..PROFILES).map(move |k| Slot::Profile(j, k)));
        let slots = profiles
            .chain((0..rods - 1).map(Slot::Coupling))
            .chain((0..3).map(Slot::Load));
        let mut parts = Vec::new();
        for slot in slots {
            let known = numbers(first, slot);
            let mut sum = vec![0.0; known.len()];
            for (weight, other) in change {
                let values = numbers(other, slot);
                if values.len() != known.len() {
                    return None;
                }
                for ((sum, value), known) in sum.iter_mut().zip(values).zip(known) {
                    // Infinite values do not change.
                    if value != known {
                        *sum += weight * (value - known);
                    }
                }
            }
            if !sum.iter().all(|value| value.is_finite()) {
                return None;
            }
            if sum.iter().any(|value| *value != 0.0) {
                parts.push((slot, sum));
            }
        }
        Some(Addition { parts })
    }

    pub fn add(&self, scenario: &mut Scenario, times: f64) {
        for (slot, part) in &self.parts {
            let values = numbers_mut(scenario, *slot).iter_mut();
            values
                .zip(part)
                .for_each(|(value, part)| *value += times * part);
        }
    }
}
