//! Segments of rods: their sections, strains, energy and derivatives.

mod balance;
mod element;
mod planar;
mod section;
mod segment;
mod spatial;

pub use balance::{FIELDS, Fields, GroupFields, GroupLaws, laws};
pub use element::{Element, Nodes};
pub use planar::PlanarElement;
pub use section::{Section, Sections};
pub use segment::{Blocks, Ends, SectionRate, Segment};
pub use spatial::SpatialElement;

/// Largest rotation (radians) between the ends of a segment that its grid resolves.
pub const RESOLVED_TURN: f64 = 1.6;
