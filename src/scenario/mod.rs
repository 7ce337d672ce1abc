//! A scenario: the description of a leaf, read from TOML or JSON and checked once.
//!
//! All other modules rely on a [`Scenario`] being valid: lengths of lists agree,
//! stiffnesses are positive, angles finite.

mod blade;
mod checked;
mod format;
mod json;
mod limits;
mod loads;
mod photo;
mod plausibility;
mod profile;
mod read;
mod schedule;
mod section;
mod support_motion;
mod supports;
#[cfg(test)]
mod tests;
mod veins;
mod zero_energy;

crate::renamed! {
    Begin => BaseRotations,
    Part => EntryPath,
    PhotoRate => PhotoParameterDerivative,
    Place => SourceLocation,
    Start => MotionStart,
    Turning => ZeroEnergyRotation,
}

pub use crate::scenario::blade::Blade;
pub(crate) use crate::scenario::checked::distinct_places;
pub use crate::scenario::checked::{NaturalShapes, Scenario};
pub use crate::scenario::format::Key;
pub use crate::scenario::format::entries::Entries;
pub use crate::scenario::format::error::{ScenarioError, SourceLocation, printable};
pub use crate::scenario::format::path::EntryPath;
pub use crate::scenario::format::schema::schema;
pub(crate) use crate::scenario::format::source::intended_number;
pub use crate::scenario::format::units::{self, Units};
pub(crate) use crate::scenario::loads::CLAMPED_ROD_FREQUENCY;
pub use crate::scenario::loads::{
    Dynamics, FactoredLoads, Landing, MotionStart, PointLoad, PolarInertia, VaryingPointLoad,
    Weight, Wind,
};
pub use crate::scenario::photo::{Photo, PhotoParameterDerivative};
pub use crate::scenario::plausibility::PlausibilityWarning;
pub(crate) use crate::scenario::plausibility::{
    LARGEST_PLAUSIBLE_STRETCH, assumed_rotary_inertia, held_tip_out_of_reach,
    plausibility_warnings, probable_obstacle_to_rest,
};
pub(crate) use crate::scenario::profile::knot_places as knots;
pub use crate::scenario::profile::{DerivedProfile, Profile, RodPlace, Side};
pub use crate::scenario::read::{MOST_BYTES, bytes, decode_utf8, text};
pub use crate::scenario::schedule::{InTime, Knots, Schedule, Sine};
pub use crate::scenario::section::{Moduli, Radii, SectionConstants, SectionOutline, Stress};
pub use crate::scenario::support_motion::{BaseMotion, SupportMotion};
pub use crate::scenario::supports::{BaseSpin, BaseSupport, Clamp, Grip, HeldTip, SupportKind};
pub use crate::scenario::veins::{Rod, Scale, Tissue, longest};
pub use crate::scenario::zero_energy::{BaseRotations, UnbalancedMoment, ZeroEnergyRotation};
/// Values as they can be written.
pub use toml::{Table, Value};
