//! What is built on the solvers.

mod check;
mod map;
mod vary;

pub use check::{Check, CheckOptions, Place, Quantity, Shot, Verdict, check};
pub use map::{
    CELL_SECONDS, Confidence, Map, MapMethod, MapOutcome, MapRefused, MapRequest, MapRow, MapShow,
    UnknownWord, map,
};
pub use vary::{Base, Keys, Knob, Knobs, Target, Varied, Vary, VaryError};
