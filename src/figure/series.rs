//! Series of points, and how they are marked.

use glam::DVec2;

use super::colors::{Color, INK, WHITE};
use super::differences::dashes;
use super::drawing::{Drawing, Path, Stroke, circle, polygon};

/// Points on the Pareto front, and the band that joins them.
pub const FRONT: Color = Color(247, 205, 92);

/// The shape of a series' points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    Circle,
    Square,
    Triangle,
    Wedge,
    Diamond,
    Ring,
}

/// A point, in the units of the axes.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub x: f64,
    pub y: f64,
    /// From here to there it was spread in repeated measurements.
    pub spread: Option<[(f64, f64); 2]>,
    /// Whether it is on the Pareto front.
    pub front: bool,
}

/// A run that has no place among the points.
#[derive(Clone, Debug)]
pub struct Failure {
    /// Where it is on the axis across; `None`: nowhere.
    pub x: Option<f64>,
    /// How it ended: the name of its lane.
    pub word: String,
}

/// What is joined by one line.
pub struct Series {
    pub name: String,
    pub color: Color,
    pub dashed: bool,
    pub marker: Marker,
    pub points: Vec<Point>,
    pub failures: Vec<Failure>,
}

/// A piece of a series' line.
pub fn stretch(page: &mut Drawing, from: DVec2, to: DVec2, series: &Series) {
    let stroke = Stroke::new(series.color, 1.5);
    match series.dashed {
        true => dashes(page, from, to, stroke),
        false => page.line(from, to, stroke),
    }
}

pub fn marker(page: &mut Drawing, at: DVec2, series: &Series) {
    let corners = |corners: &[(f64, f64)]| -> Path {
        let corners = corners.iter().map(|&(x, y)| at + DVec2::new(x, y));
        polygon(&corners.collect::<Vec<_>>())
    };
    let path = match series.marker {
        Marker::Circle | Marker::Ring => circle(at, 3.4),
        Marker::Square => corners(&[(-3.1, -3.1), (3.1, -3.1), (3.1, 3.1), (-3.1, 3.1)]),
        Marker::Triangle => corners(&[(0.0, -4.2), (4.0, 3.0), (-4.0, 3.0)]),
        Marker::Wedge => corners(&[(0.0, 4.2), (4.0, -3.0), (-4.0, -3.0)]),
        Marker::Diamond => corners(&[(0.0, -4.4), (4.4, 0.0), (0.0, 4.4), (-4.4, 0.0)]),
    };
    match series.marker {
        Marker::Ring => page.shape(path, WHITE, Some(Stroke::new(series.color, 1.5))),
        _ => page.shape(path, series.color, Some(Stroke::new(WHITE, 0.8))),
    }
}

pub fn halo(page: &mut Drawing, at: DVec2) {
    page.shape(circle(at, 7.5), FRONT, Some(Stroke::new(INK, 0.8)));
}

pub fn cross(page: &mut Drawing, at: DVec2, color: Color) {
    const ARM: f64 = 3.6;
    let stroke = Stroke::new(color, 1.7);
    for arm in [DVec2::new(ARM, ARM), DVec2::new(ARM, -ARM)] {
        page.line(at - arm, at + arm, stroke);
    }
}
