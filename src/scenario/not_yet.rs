//! What is read and checked, but that no method takes into account yet.

use super::{Hold, Key, PointLoad, Scenario};

/// The first key of a scenario that would be left out of account, if any.
pub(super) fn not_yet(scenario: &Scenario) -> Option<Key> {
    let Scenario {
        base_held, points, ..
    } = scenario;
    let turned = |point: &PointLoad| point.moment != [0.0; 3];
    let used = [
        (Key::PointMoment, points.iter().any(turned)),
        (Key::BaseHeld, *base_held != Hold::Clamped),
    ];
    let first = used.into_iter().find(|(_, used)| *used)?;
    Some(first.0)
}
