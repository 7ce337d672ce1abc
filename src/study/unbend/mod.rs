//! The least stiffness that a posture proves, and the leaf without its weight.
//!
//! [`unbend`] takes the points of a leaf at rest and its scenario up to Young's modulus. The mathematics is in
//! [`crate::posture`]; here are the tables of points, the comparison with relaxations, and the result.

mod many;
mod outline;
mod request;
mod result;
mod shape_formats;
mod sheet;
mod solve;
mod start;
mod table;

pub use crate::study::unbend::many::{PostureOutcome, PostureRow, Postures, unbend_groups};
pub use crate::study::unbend::outline::BladeOutline;
pub use crate::study::unbend::request::{SecondPosture, UnbendError, UnbendRequest};
pub use crate::study::unbend::result::{
    CriticalYoung, ModulusInterval, PostureIndex, RestCheck, SlowLoading, SmoothingReport,
    UnbendRemark, Unbending,
};
pub use crate::study::unbend::shape_formats::ShapeFormat;
pub use crate::study::unbend::solve::{unbend, unbend_many};
pub use crate::study::unbend::start::relax_from_points;
pub use crate::study::unbend::table::{NamedPosture, ShapeTableOptions, read_postures};
