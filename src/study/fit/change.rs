//! How a scenario changes with the free numbers, and the scenario after a change.

use std::sync::Arc;

use crate::scenario::{Profile, Scenario};

/// The change of a scenario with a number: scenarios with weights.
pub(super) type Change = Arc<Vec<(f64, Scenario)>>;

/// Numbers of a scenario that a change may change.
#[derive(Clone, Copy, Debug)]
enum Place {
    /// Of a rod: its number, and that of its profile.
    Profile(usize, usize),
    Coupling(usize),
    Load(usize),
}

/// What to add to numbers of a scenario.
pub(super) struct Addition {
    parts: Vec<(Place, Vec<f64>)>,
}

/// Profiles of a rod.
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

/// The numbers of a place; none of a profile that is not given by numbers.
fn numbers(scenario: &Scenario, place: Place) -> &[f64] {
    match place {
        Place::Profile(rod, number) => match profile(scenario, rod, number) {
            Profile::Constant(value) => std::slice::from_ref(value),
            Profile::Linear { value, .. } => value,
            Profile::Section { .. } => &[],
        },
        Place::Coupling(gap) => &scenario.coupling[gap],
        Place::Load(0) => &scenario.gravity,
        Place::Load(1) => &scenario.tip_force,
        Place::Load(_) => &scenario.tip_moment,
    }
}

fn numbers_mut(scenario: &mut Scenario, place: Place) -> &mut [f64] {
    match place {
        Place::Profile(rod, number) => {
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
        Place::Coupling(gap) => &mut scenario.coupling[gap],
        Place::Load(0) => &mut scenario.gravity,
        Place::Load(1) => &mut scenario.tip_force,
        Place::Load(_) => &mut scenario.tip_moment,
    }
}

impl Addition {
    /// By one unit of a number in which a scenario is linear; `None` if it changes what
    /// is not a number of a profile, of the coupling or of the loads.
    pub fn new(change: &[(f64, Scenario)]) -> Option<Addition> {
        let first = &change.first()?.1;
        let rods = first.rods.len();
        let profiles = (0..rods).flat_map(|j| (0..PROFILES).map(move |k| Place::Profile(j, k)));
        let places = profiles
            .chain((0..rods - 1).map(Place::Coupling))
            .chain((0..3).map(Place::Load));
        let mut parts = Vec::new();
        for place in places {
            let known = numbers(first, place);
            let mut sum = vec![0.0; known.len()];
            for (weight, other) in change {
                let values = numbers(other, place);
                if values.len() != known.len() {
                    return None;
                }
                for ((sum, value), known) in sum.iter_mut().zip(values).zip(known) {
                    // What is infinite stays so.
                    if value != known {
                        *sum += weight * (value - known);
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

    /// Adds it so many times.
    pub fn add(&self, scenario: &mut Scenario, times: f64) {
        for (place, part) in &self.parts {
            let values = numbers_mut(scenario, *place).iter_mut();
            values
                .zip(part)
                .for_each(|(value, part)| *value += times * part);
        }
    }
}
