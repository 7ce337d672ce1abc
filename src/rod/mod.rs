//! Segments of rods: their sections, strains, energy and derivatives.

mod balance;
mod derivatives;
mod element;
mod section;
mod segment;
mod strip;

pub use balance::{FIELDS, Fields, GroupFields, GroupLaws, laws};
pub use derivatives::{Block, UNKNOWNS, on_nodes};
pub use element::{Element, Nodes};
pub use section::{Section, Sections};
pub use segment::{Blocks, Ends, SectionRate, Segment};
pub use strip::{NodeBlock, Strip};

/// Largest rotation (radians) between the ends of a segment that its grid resolves.
pub const RESOLVED_TURN: f64 = 1.6;
