//! Vector (SIMD) arithmetic: several numbers per processor instruction.

mod number;
mod vectors;

pub use number::*;
pub use vectors::Vectors;
