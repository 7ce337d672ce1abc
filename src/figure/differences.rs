//! The panel that shows the differences of two solutions along the veins.

use glam::DVec2;

use super::axes::{Axes, Curve};
use super::axis::{Axis, Ticks};
use super::drawing::{CURVES, Color, Drawing, NOTE, Stroke};
use super::markers::Marker;
use super::page::{Cell, Key, PANEL_AXIS, PANEL_TITLE, title};
use crate::report::numbers::power_of_ten;
use crate::study::{Check, Quantity};

const FRAME_HEIGHT: f64 = 216.0;
/// Right of the frame, for the key.
const KEY: f64 = 212.0;
pub const HEIGHT: f64 = PANEL_TITLE + FRAME_HEIGHT + PANEL_AXIS;
const FEWEST_DECADES: f64 = 3.0;
/// Height of the strip below for differences of exactly zero: one lane per quantity.
const ZERO_STRIP: f64 = 30.0;
const MOST_MARKED: usize = 70;

/// Differences of a quantity along the veins, and the largest one at which the
/// solutions agree. Positions are in units of `unit`, the rest in the scenario's.
fn curve(quantity: Quantity, check: &Check, unit: f64, color: Color) -> (Curve, Option<f64>) {
    let (name, unit, allowed) = match quantity {
        Quantity::Position => ("position, in lengths L", unit, Some(check.allowed() / unit)),
        Quantity::Rotation => ("rotation, in radians", 1.0, Some(check.allowed_rotation())),
        Quantity::Force => ("force, in the scenario's unit", 1.0, None),
        Quantity::Moment => ("moment, in the scenario's unit", 1.0, None),
    };
    let values = check.along.iter().map(|found| quantity.of(found) / unit);
    let stations = check.relaxed.shape.stations.iter().copied();
    let points = stations.zip(values).collect();
    let curve = Curve {
        name,
        color,
        points,
    };
    (curve, allowed)
}

pub fn draw(page: &mut Drawing, check: &Check, unit: f64, start: f64) {
    let quantities = Quantity::ALL.into_iter().zip(CURVES);
    let (curves, allowed): (Vec<Curve>, Vec<Option<f64>>) = quantities
        .map(|(quantity, color)| curve(quantity, check, unit, color))
        .unzip();
    let mut cell = Cell::left_of_key(start + PANEL_TITLE, FRAME_HEIGHT, KEY);
    let what = "largest difference of all veins at each station";
    title(page, cell.corner, "(e)", what);
    let stations = Axis {
        tick_spacing: Some(50.0),
        ..Axis::linear("σ, fraction of each vein's length", 0.0, 1.0)
    };
    let mut across = stations.clone();
    let mut values = curves.iter().flat_map(Curve::values);
    if values.any(|value| value == 0.0) {
        cell.size.y -= ZERO_STRIP;
        across.labelled = false;
        draw_zeros(page, &curves, cell, stations);
    }
    let values = curves.iter().flat_map(Curve::values);
    let values = values.chain(allowed.iter().flatten().copied());
    let axes = Axes {
        cell,
        across,
        up: Axis::logarithmic("", values, FEWEST_DECADES),
    };
    axes.draw(page);
    for (curve, allowed) in curves.iter().zip(allowed) {
        if let Some(allowed) = allowed {
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

/// Draws differences of zero, which have no place on a logarithmic axis, in a strip
/// below it.
fn draw_zeros(page: &mut Drawing, curves: &[Curve], above: Cell, stations: Axis) {
    let strip = Axes {
        cell: Cell::new(
            DVec2::new(above.corner.x, above.end().y),
            DVec2::new(above.size.x, ZERO_STRIP),
        ),
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

fn draw_key(page: &mut Drawing, curves: &[Curve], cell: Cell) {
    let mut key = Key::right_of(cell);
    for curve in curves {
        let largest = match curve.values().fold(0.0, f64::max) {
            0.0 => "no difference".into(),
            largest => format!("≤ {}", power_of_ten(largest)),
        };
        key.marked_line(page, curve.name, &largest, curve.color);
    }
    let dashed = Stroke::new(NOTE, 1.0).dashed(true);
    key.line(page, "allowed difference", "", dashed);
}
