//! Dead moments on a rod as curved arrows about their axes, by the right-hand rule.

use crate::figure::drawing::{Drawing, INK, Stroke, polygon, polyline};
use glam::{DVec2, DVec3};
use leafdyn::scenario::Scenario;
use std::f64::consts::PI;

/// Radius of an arrow, as a part of the leaf's largest extent.
const RADIUS: f64 = 0.06;
/// Angle along the arrow, and pieces of which it is drawn.
const ANGLE: f64 = 1.5 * PI;
const PIECES: usize = 24;
/// Length and half the width of its head, in pixels.
const HEAD: [f64; 2] = [8.0, 3.4];

/// A dead moment on a rod.
pub struct Moment {
    pub at: DVec3,
    /// Of length one.
    pub axis: DVec3,
    pub size: f64,
}

/// The moments on a leaf, that on its tip among them; `at` gives the point at a fraction of the rod.
pub fn moments(
    scenario: &Scenario,
    on_tip: [f64; 3],
    at: impl Fn(f64) -> Option<DVec3>,
) -> Vec<Moment> {
    let points = scenario.points.iter();
    let all = points.map(|point| (point.at, point.moment));
    let all = all.chain([(1.0, on_tip)]);
    all.filter_map(|(sigma, moment)| {
        let moment = DVec3::from_array(moment);
        Some(Moment {
            axis: moment.try_normalize()?,
            size: moment.length(),
            at: at(sigma)?,
        })
    })
    .collect()
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
            let [length, half] = HEAD;
            let (tip, side) = (end + 0.5 * length * along, half * along.perp());
            let back = tip - length * along;
            page.shape(polygon(&[tip, back + side, back - side]), INK, None);
        }
    }
}
