//! The posture that measured points show.

use crate::posture::frame::{self, FrameRule};
use crate::posture::points::{PostureError, PosturePoints};
use crate::posture::rod::HangingRod;
use crate::posture::second_variation::ELEMENTS;
use crate::posture::smoothing::{self, LEAST_POINTS};
use crate::posture::{Centreline, Posture, intervals};
use glam::DVec3;

impl Posture {
    /// The posture that points show; `base` is where the scenario has its base, if that tells base from tip.
    ///
    /// # Errors
    /// Points that are no posture, or from which the directors of an anisotropic section do not follow.
    pub fn from_points(
        rod: HangingRod,
        points: &PosturePoints,
        base: Option<DVec3>,
    ) -> Result<Posture, PostureError> {
        points.check(LEAST_POINTS, base)?;
        let chosen = frame::choose(&rod, points)?;
        let positions = chosen.positions.as_deref().unwrap_or(&points.positions);
        let coordinates = if chosen.plane.is_some() { 2 } else { 3 };
        let smoothed = smoothing::smooth(positions, points.sd.as_deref(), coordinates);
        let smoothed = smoothed.ok_or(PostureError::Coincident)?;
        let rule = match &points.normals {
            Some(normals) if !rod.is_round() => FrameRule::measured(&smoothed, normals)?,
            _ => FrameRule::Transported,
        };
        let centreline = Centreline::Smoothed(Box::new(smoothed));
        let mut posture = Posture::assemble(rod, centreline, chosen.plane, rule, ELEMENTS);
        posture.off_plane = chosen.off;
        posture.critical.relative_deviation = intervals::relative_deviation(&posture);
        Ok(posture)
    }
}
