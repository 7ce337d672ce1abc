//! Dead moments on a rod as curved arrows about their axes, by the right-hand rule.

use crate::figure::drawing::{Drawing, INK, Stroke, polygon, polyline};
use crate::figure::marks::{Action, LoadMark};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// Radius of an arrow, as a part of the leaf's largest extent.
const RADIUS: f64 = 0.06;
/// Angle along the arrow, and pieces of which it is drawn.
const ANGLE: f64 = 1.5 * PI;
const PIECES: usize = 24;
/// Length and half the width of its head, in pixels.
const ARC_HEAD: [f64; 2] = [8.0, 3.4];

/// A dead moment on a rod.
pub struct Moment {
    pub at: DVec3,
    /// Of length one.
    pub axis: DVec3,
    pub size: f64,
}

/// The moments on a leaf, of those that load it; `at` gives the point at a fraction of its only rod.
pub fn moments(marks: &[LoadMark], at: impl Fn(f64) -> Option<DVec3>) -> Vec<Moment> {
    let moments = marks.iter().filter(|mark| mark.action == Action::Moment);
    let moment = |mark: &LoadMark| {
        Some(Moment {
            axis: mark.direction,
            size: mark.size,
            at: at(mark.at)?,
        })
    };
    moments.filter_map(moment).collect()
}

impl Moment {
    /// Draws it on a leaf of this extent.
    pub fn draw(&self, page: &mut Drawing, extent: f64, place: impl Fn(DVec3) -> DVec2) {
        let across = self.axis.any_orthonormal_vector();
        let other = self.axis.cross(across);
        let point = |k: usize| {
            let (sin, cos) = (ANGLE * k as f64 / PIECES as f64).sin_cos();
            place(self.at + RADIUS * extent * (cos * across + sin * other))
        };
        let points: Vec<DVec2> = (0..=PIECES).map(point).collect();
        page.stroke(polyline(&points), Stroke::new(INK, 1.3));
        let end = points[PIECES];
        if let Some(along) = (end - points[PIECES - 1]).try_normalize() {
            let [length, half] = ARC_HEAD;
            let (tip, side) = (end + 0.5 * length * along, half * along.perp());
            let back = tip - length * along;
            page.shape(polygon(&[tip, back + side, back - side]), INK, None);
        }
    }
}
