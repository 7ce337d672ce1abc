//! What is asked of a posture, and why it cannot be answered.

use crate::posture::points::{PostureError, PosturePoints};
use crate::relax::RelaxError;
use crate::run::Limit;
use crate::scenario::Scenario;
use crate::study::fit::columns::FitError;
use std::ops::RangeInclusive;

/// Another posture of the same leaf.
#[derive(Clone, Debug)]
pub struct SecondPosture {
    /// Its points.
    pub points: PosturePoints,
    /// The angle by which the leaf was turned about the direction of its base, in radians.
    pub roll: f64,
}

/// What is asked of a posture.
#[derive(Clone, Debug)]
pub struct UnbendRequest {
    /// The leaf up to its modulus, with its loads.
    pub scenario: Scenario,
    /// Points from base to tip.
    pub points: PosturePoints,
    /// The modulus, or the least and the largest one that are thought of.
    pub young: Option<RangeInclusive<f64>>,
    /// The same leaf in another posture.
    pub second: Option<SecondPosture>,
    /// Whether the unit of the points is known, so that their length may be any.
    pub is_unit_known: bool,
    /// Whether the scenario that rests in the posture is relaxed from there.
    pub check: bool,
    /// Whether slow loading is tried at several moduli.
    pub slow_loading: bool,
    /// When to give up.
    pub limit: Limit,
}

/// Why a posture could not be used.
#[derive(Debug, thiserror::Error)]
pub enum UnbendError {
    /// The scenario or its points.
    #[error(transparent)]
    Posture(#[from] PostureError),
    /// The points of the second posture.
    #[error("second posture: {0}")]
    Second(PostureError),
    /// The table of points.
    #[error(transparent)]
    Table(#[from] FitError),
    /// A relaxation.
    #[error(transparent)]
    Relax(#[from] RelaxError),
    /// A modulus.
    #[error(
        "young = {young}: must be greater than 0, and the first of two no greater than the second"
    )]
    Young {
        /// As given.
        young: String,
    },
}

impl UnbendRequest {
    /// All that can be told of a posture.
    pub fn new(scenario: Scenario, points: PosturePoints) -> UnbendRequest {
        UnbendRequest {
            scenario,
            points,
            young: None,
            second: None,
            is_unit_known: false,
            check: true,
            slow_loading: true,
            limit: Limit::default(),
        }
    }
}
