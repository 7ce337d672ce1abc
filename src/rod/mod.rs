//! Segments of rods: their sections, strains, energy and derivatives.

mod balance;
mod element;
mod section;
mod segment;

pub use balance::{FIELDS, Fields, GroupFields, GroupLaws, laws};
pub use element::{Block, Element, Nodes, UNKNOWNS, on_nodes};
pub use section::{Section, Sections};
pub use segment::{Blocks, Ends, SectionRate, Segment};

/// Largest rotation (radians) between the ends of a segment that its grid resolves.
pub const RESOLVED_TURN: f64 = 1.6;
