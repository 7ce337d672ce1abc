//! One segment of a rod: its section, its strains, its energy and derivatives.

mod element;
mod planar;

pub use element::{Blocks, Ends, Section, Segment};
pub use planar::{PlanarBlocks, PlanarGradient, PlanarSegment};

/// A segment that is bent by more than this (radians) is not resolved by its grid.
pub const RESOLVED_TURN: f64 = 1.6;
