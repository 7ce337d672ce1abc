//! What is read and checked, but that no method takes into account yet.

use super::{Hold, Key, Scenario};

/// The first key of a scenario that would be left out of account, if any.
pub(super) fn not_yet(scenario: &Scenario) -> Option<Key> {
    let Scenario {
        rods,
        base_held,
        tissue,
        own_gravity,
        g,
        distributed,
        points,
        grips,
        wind,
        ..
    } = scenario;
    let used = [
        (Key::Base, rods.iter().any(|rod| rod.base != [0.0; 3])),
        (Key::Elevation, rods.iter().any(|rod| rod.elevation != 0.0)),
        (Key::BaseHeld, *base_held != Hold::Clamped),
        (Key::TissueAlong, tissue.is_some()),
        (Key::Gravity, !own_gravity.is_empty()),
        (Key::G, *g != [0.0; 3]),
        (Key::Distributed, distributed.is_some()),
        (Key::PointVein, !points.is_empty()),
        (Key::GripVein, !grips.is_empty()),
        (Key::WindVelocity, wind.is_some()),
    ];
    let first = used.into_iter().find(|(_, used)| *used)?;
    Some(first.0)
}
