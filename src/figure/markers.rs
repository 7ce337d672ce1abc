//! Markers: the clamp, the tips, and points of a second solution.

use glam::{DVec2, DVec3};

use super::colors::{DOT, INK, WHITE};
use super::drawing::{Drawing, Stroke, circle, rectangle};
use super::veins::Veins;

/// Where the rods are clamped; larger than the tip's marker, which may cover it.
pub fn clamp_marker(page: &mut Drawing, at: DVec2) {
    let half = DVec2::splat(4.2);
    page.shape(
        rectangle(at - half, 2.0 * half),
        INK,
        Some(Stroke::new(WHITE, 1.0)),
    );
}

/// The joint tip, or the tip of a single rod.
pub fn tip_marker(page: &mut Drawing, at: DVec2) {
    page.shape(circle(at, 3.3), WHITE, Some(Stroke::new(INK, 1.3)));
}

/// Marks all tips, small if there are many.
pub fn tip_markers(page: &mut Drawing, veins: &Veins, place: impl Fn(DVec3) -> DVec2) {
    if let [(tip, _)] = veins.tips.as_slice() {
        return tip_marker(page, place(*tip));
    }
    let radius = if veins.tips.len() > 30 { 1.5 } else { 2.4 };
    for (tip, color) in &veins.tips {
        let rim = Stroke::new(*color, 0.5 * radius);
        page.shape(circle(place(*tip), radius), WHITE, Some(rim));
    }
}

/// A point of a second solution: a colour that no vein has.
pub fn dot(page: &mut Drawing, at: DVec2, radius: f64) {
    page.shape(circle(at, radius), DOT, None);
}

/// The points of the second solution, small if the veins are thin.
pub fn dots(page: &mut Drawing, veins: &Veins, place: impl Fn(DVec3) -> DVec2) {
    let radius = 0.7 + 0.6 * veins.line_width();
    for &point in &veins.dots {
        dot(page, place(point), radius);
    }
}
