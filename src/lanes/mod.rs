//! Several numbers at once: what one instruction of the processor works on.

mod number;
mod vectors;

pub use number::*;
pub use vectors::Vectors;
