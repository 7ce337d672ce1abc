//! One segment of a rod: its section, its strains, its energy and derivatives.

mod element;

pub use element::{Blocks, Ends, Section, Segment};
