//! The panel that shows along the veins how far two solutions are apart.

use glam::DVec2;

use super::axes::Axes;
use super::axis::{Axis, Ticks};
use super::colors::{CURVES, Color, NOTE};
use super::drawing::{Drawing, Stroke};
use super::key::Key;
use super::markers::Marker;
use super::page::{Cell, PANEL_AXIS, PANEL_TITLE, title};
use crate::report::numbers::power_of_ten;
use crate::study::{Check, Quantity};

const FRAME_HEIGHT: f64 = 216.0;
/// Right of the frame, for the key.
const KEY: f64 = 212.0;
/// The panel with its title and axis.
pub const HEIGHT: f64 = PANEL_TITLE + FRAME_HEIGHT + PANEL_AXIS;

/// Decades of differences, at least.
const FEWEST_DECADES: f64 = 3.0;

/// Below, for differences of exactly zero: one lane for each quantity.
const ZERO_STRIP: f64 = 30.0;

/// Stations are marked if there are no more.
const MOST_MARKED: usize = 70;

/// One quantity along the veins.
struct Curve {
    name: &'static str,
    color: Color,
    /// Stations and differences.
    points: Vec<(f64, f64)>,
    /// Up to which the solutions are called the same.
    allowed: Option<f64>,
}

impl Curve {
    /// Positions in units of `unit`, the rest in the scenario's.
    fn of(quantity: Quantity, check: &Check, unit: f64, color: Color) -> Self {
        let (name, unit, allowed) = match quantity {
            Quantity::Position => {
                let allowed = check.allowed() / unit;
                ("position, in lengths L", unit, Some(allowed))
            }
            Quantity::Rotation => ("rotation, in radians", 1.0, Some(check.allowed_rotation())),
            Quantity::Force => ("force, in the scenario's unit", 1.0, None),
            Quantity::Moment => ("moment, in the scenario's unit", 1.0, None),
        };
        let values = check.along.iter().map(|found| quantity.of(found) / unit);
        Curve {
            name,
            color,
            points: check
                .relaxed
                .shape
                .stations
                .iter()
                .copied()
                .zip(values)
                .collect(),
            allowed,
        }
    }

    fn values(&self) -> impl Iterator<Item = f64> {
        self.points.iter().map(|point| point.1)
    }
}

/// Draws the panel below `start`.
pub fn draw(page: &mut Drawing, check: &Check, unit: f64, start: f64) {
    let curves: Vec<Curve> = Quantity::ALL
        .into_iter()
        .zip(CURVES)
        .map(|(quantity, color)| Curve::of(quantity, check, unit, color))
        .collect();
    let mut cell = Cell::beside_key(start + PANEL_TITLE, FRAME_HEIGHT, KEY);
    title(
        page,
        cell.corner,
        "(e)",
        "largest difference of all veins at each station",
    );
    let stations = Axis {
        apart: Some(50.0),
        ..Axis::linear("σ, fraction of each vein's length", 0.0, 1.0)
    };
    let mut across = stations.clone();
    if curves
        .iter()
        .any(|curve| curve.values().any(|value| value == 0.0))
    {
        cell.size.y -= ZERO_STRIP;
        across.labelled = false;
        draw_zeros(page, &curves, cell, stations);
    }
    let allowed = curves.iter().filter_map(|curve| curve.allowed);
    let values = curves.iter().flat_map(Curve::values).chain(allowed);
    let axes = Axes {
        cell,
        across,
        up: Axis::logarithmic("", values, FEWEST_DECADES),
    };
    axes.draw(page);
    for curve in &curves {
        if let Some(allowed) = curve.allowed {
            let stroke = Stroke::new(curve.color, 1.0).dashed(true);
            axes.curve(page, &[(0.0, allowed), (1.0, allowed)], stroke);
        }
    }
    for curve in &curves {
        axes.curve(page, &curve.points, Stroke::new(curve.color, 1.6));
        if curve.points.len() <= MOST_MARKED {
            axes.markers(page, curve.points.iter().copied(), Marker::Dot, curve.color);
        }
    }
    draw_key(page, &curves, cell);
}

/// Differences that a logarithmic axis has no place for, in a strip below it.
fn draw_zeros(page: &mut Drawing, curves: &[Curve], above: Cell, stations: Axis) {
    let strip = Axes {
        cell: Cell {
            corner: DVec2::new(above.corner.x, above.end().y),
            size: DVec2::new(above.size.x, ZERO_STRIP),
        },
        across: stations,
        up: Axis {
            ticks: Ticks::At(vec![0.0]),
            ..Axis::linear("", 2.7, -2.7)
        },
    };
    strip.draw(page);
    for (lane, curve) in curves.iter().enumerate() {
        let zeros = curve.points.iter().filter(|point| point.1 == 0.0);
        let places = zeros.map(|point| (point.0, lane as f64 - 1.5));
        strip.markers(page, places, Marker::Dot, curve.color);
    }
}

/// Each curve's name and its largest value.
fn draw_key(page: &mut Drawing, curves: &[Curve], cell: Cell) {
    let mut key = Key::beside(cell);
    for curve in curves {
        let largest = match curve.values().fold(0.0, f64::max) {
            0.0 => "no difference".into(),
            largest => format!("≤ {}", power_of_ten(largest)),
        };
        key.entry(page, curve.name, &largest, |page, cell| {
            let [from, to] = cell.midline();
            page.line(from, to, Stroke::new(curve.color, 1.6));
            Marker::Dot.draw(page, cell.middle(), curve.color);
        });
    }
    let dashed = Stroke::new(NOTE, 1.0).dashed(true);
    key.line(page, "allowed difference", "", dashed);
}
