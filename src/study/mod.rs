//! What is built on the solvers.

mod check;

pub use check::{Check, CheckOptions, Place, Quantity, Shot, Verdict, check};
