//! What is read and checked, but that no method takes into account yet.

use super::{Hold, Key, Scenario};

/// The first key of a scenario that would be left out of account, if any.
pub(super) fn not_yet(scenario: &Scenario) -> Option<Key> {
    (scenario.base_held != Hold::Clamped).then_some(Key::BaseHeld)
}
