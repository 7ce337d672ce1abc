//! What is read and checked, but that no method takes into account yet.

use super::{Key, PointLoad, Scenario};

/// The first key of a scenario that would be left out of account, if any.
pub(super) fn not_yet(scenario: &Scenario) -> Option<Key> {
    let turned = |point: &PointLoad| point.moment != [0.0; 3];
    let used = scenario.points.iter().any(turned);
    used.then_some(Key::PointMoment)
}
