//! Wind: the table `[wind]`.

use super::entries::Entries;
use super::error::ScenarioResult;
use super::key::Key;
use super::{Profile, Schedule};

/// Air that flows past the veins. The force per reference length on a vein is rho C_D w |u| u/2, with
/// the part u of the air's velocity relative to the vein that is normal to the vein's tangent.
#[derive(Clone, Debug, PartialEq)]
pub struct Wind {
    /// Velocity of the air.
    pub velocity: Schedule<[f64; 3]>,
    /// rho, mass of the air per volume; positive.
    pub density: f64,
    /// C_D, the drag coefficient; not negative.
    pub drag: f64,
    /// w, the width that a vein turns to the wind, one profile per vein; positive.
    pub width: Vec<Profile>,
}

/// Reads `[wind]`; `None` if there is no such table.
pub(super) fn wind(entries: &Entries, rods: usize) -> ScenarioResult<Option<Wind>> {
    let mut table = Key::all().filter(|key| key.parts().0 == "wind");
    if !table.any(|key| entries.is_given(key)) {
        return Ok(None);
    }
    Ok(Some(Wind {
        velocity: entries.item(Key::WindVelocity)?.vectors_in_time()?,
        density: entries.item(Key::WindDensity)?.number()?,
        drag: entries.item(Key::WindDrag)?.number()?,
        width: entries.item(Key::WindWidth)?.quantity(rods)?,
    }))
}
