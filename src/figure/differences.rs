//! The panel that shows along the veins how far two solutions are apart, on a
//! logarithmic axis.

use glam::DVec2;

use super::colors::{CURVES, Color, FRAME, GRID, INK, NOTE, WHITE};
use super::drawing::{Anchor, Drawing, HALF_CAPITAL, Path, Step, Stroke, circle, rectangle};
use super::flat::title;
use super::page::{Cell, LEFT, PANEL_AXIS, PANEL_TITLE, RIGHT, TEXT_SIZE, TICK_SIZE, WIDTH};
use super::ticks::ticks;
use crate::report::numbers::{power_of_ten, superscript};
use crate::study::{Check, Quantity};

const FRAME_HEIGHT: f64 = 216.0;
/// Right of the frame, for the key.
const KEY: f64 = 212.0;
/// The panel with its title and axis.
pub const HEIGHT: f64 = PANEL_TITLE + FRAME_HEIGHT + PANEL_AXIS;

/// Decades that are shown at most; what is smaller is rounding of rounding.
const MOST_DECADES: i32 = 18;
/// And at least.
const FEWEST_DECADES: i32 = 3;
/// Labels that the logarithmic axis has at most.
const MOST_LABELS: i32 = 9;

/// Decades between curves and the frame at least.
const AIR: f64 = 0.15;

/// Below the logarithmic axis, for differences of exactly zero: one lane for
/// each quantity.
const ZERO_STRIP: f64 = 30.0;
const LANE: f64 = 5.5;

/// Stations are marked if there are no more.
const MOST_MARKED: usize = 70;

/// One quantity along the veins.
struct Curve {
    quantity: Quantity,
    values: Vec<f64>,
    /// Up to which the solutions are called the same.
    allowed: Option<f64>,
    color: Color,
}

impl Curve {
    /// Positions in units of `unit`, the rest in the scenario's.
    fn of(quantity: Quantity, check: &Check, unit: f64, color: Color) -> Self {
        let (unit, allowed) = match quantity {
            Quantity::Position => (unit, Some(check.allowed() / unit)),
            Quantity::Rotation => (1.0, Some(check.allowed_rotation())),
            Quantity::Force | Quantity::Moment => (1.0, None),
        };
        let along = check.along.iter();
        Curve {
            quantity,
            values: along.map(|found| quantity.of(found) / unit).collect(),
            allowed,
            color,
        }
    }

    fn largest(&self) -> f64 {
        self.values.iter().copied().fold(0.0, f64::max)
    }

    fn name(&self) -> &'static str {
        match self.quantity {
            Quantity::Position => "position, in lengths L",
            Quantity::Rotation => "rotation, in radians",
            Quantity::Force => "force, in the scenario's unit",
            Quantity::Moment => "moment, in the scenario's unit",
        }
    }
}

/// Draws the panel below `start`.
pub fn draw(page: &mut Drawing, check: &Check, unit: f64, start: f64) {
    let cell = Cell {
        corner: DVec2::new(LEFT, start + PANEL_TITLE),
        size: DVec2::new(WIDTH - LEFT - RIGHT - KEY, FRAME_HEIGHT),
    };
    let curves: Vec<Curve> = Quantity::ALL
        .into_iter()
        .zip(CURVES)
        .map(|(quantity, color)| Curve::of(quantity, check, unit, color))
        .collect();
    let axis = Axis::of(&curves, cell);
    title(
        page,
        cell.corner,
        "(e)",
        "largest difference of all veins at each station",
    );
    draw_axes(page, &axis);
    for curve in &curves {
        draw_allowed(page, &axis, curve);
    }
    for curve in &curves {
        draw_curve(page, &axis, curve, &check.relaxed.shape.stations);
        draw_zeros(page, &axis, curve, &check.relaxed.shape.stations);
    }
    draw_key(page, &curves, cell);
}

/// From fractions of the length and differences to the page.
struct Axis {
    cell: Cell,
    /// Decades at both ends.
    low: i32,
    high: i32,
    /// Whether there are zeros, shown in a strip below.
    zeros: bool,
}

impl Axis {
    fn of(curves: &[Curve], cell: Cell) -> Self {
        let values = || curves.iter().flat_map(|curve| curve.values.iter().copied());
        let allowed = curves.iter().filter_map(|curve| curve.allowed);
        let shown = values()
            .chain(allowed)
            .filter(|value| value.is_normal())
            .map(|value| value.log10());
        let (low, high) = shown.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        let high = if high.is_finite() { high } else { 0.0 };
        let low = (low.min(high) - AIR).floor() as i32;
        let high = (high + AIR).ceil() as i32;
        Axis {
            cell,
            low: low.clamp(high - MOST_DECADES, high - FEWEST_DECADES),
            high,
            zeros: values().any(|value| value == 0.0),
        }
    }

    fn across(&self, sigma: f64) -> f64 {
        self.cell.corner.x + sigma * self.cell.size.x
    }

    /// The end of the logarithmic axis.
    fn foot(&self) -> f64 {
        let strip = if self.zeros { ZERO_STRIP } else { 0.0 };
        self.cell.corner.y + self.cell.size.y - strip
    }

    fn zero(&self) -> f64 {
        self.foot() + 0.5 * ZERO_STRIP
    }

    /// Where a value is on the logarithmic axis, if it is.
    fn up(&self, value: f64) -> Option<f64> {
        let decades = f64::from(self.high - self.low);
        let part = (f64::from(self.high) - value.log10()) / decades;
        let inside = (0.0..=1.0).contains(&part);
        inside.then(|| self.cell.corner.y + part * (self.foot() - self.cell.corner.y))
    }

    /// The decades that are labelled.
    fn decades(&self) -> impl Iterator<Item = i32> {
        let (low, high) = (self.low, self.high);
        let every = (high - low + 1 + MOST_LABELS - 1) / MOST_LABELS;
        (low..=high).filter(move |decade| decade.rem_euclid(every) == 0)
    }
}

fn draw_axes(page: &mut Drawing, axis: &Axis) {
    const TICK_LENGTH: f64 = 4.0;
    let Cell { corner, size } = axis.cell;
    let end = corner + size;
    let (grid, rim) = (Stroke::new(GRID, 0.7), Stroke::new(FRAME, 0.8));
    let tenths = ticks(0.0, 1.0, 0.1);
    let mut rows: Vec<(f64, String)> = axis
        .decades()
        .filter_map(|decade| {
            let y = axis.up(10f64.powi(decade))?;
            Some((y, format!("10{}", superscript(decade))))
        })
        .collect();
    if axis.zeros {
        rows.push((axis.zero(), "0".into()));
    }
    for (sigma, _) in &tenths {
        let x = axis.across(*sigma);
        page.line(DVec2::new(x, corner.y), DVec2::new(x, end.y), grid);
    }
    for (y, _) in &rows {
        page.line(DVec2::new(corner.x, *y), DVec2::new(end.x, *y), grid);
    }
    page.stroke(rectangle(corner, size), rim);
    if axis.zeros {
        let (from, to) = (corner.with_y(axis.foot()), end.with_y(axis.foot()));
        page.line(from, to, rim);
    }
    for (sigma, text) in &tenths {
        let foot = DVec2::new(axis.across(*sigma), end.y);
        page.line(foot, foot + DVec2::new(0.0, TICK_LENGTH), rim);
        let base = foot + DVec2::new(0.0, TICK_LENGTH + 1.2 * TICK_SIZE);
        page.label(base, text, TICK_SIZE, Anchor::Middle, NOTE);
    }
    for (y, text) in &rows {
        let foot = DVec2::new(corner.x, *y);
        page.line(foot, foot - DVec2::new(TICK_LENGTH, 0.0), rim);
        let base = foot + DVec2::new(-TICK_LENGTH - 3.0, HALF_CAPITAL * TICK_SIZE);
        page.label(base, text, TICK_SIZE, Anchor::End, NOTE);
    }
    let below = DVec2::new(0.5 * (corner.x + end.x), end.y + 34.0);
    page.label(
        below,
        "σ, fraction of each vein's length",
        TEXT_SIZE,
        Anchor::Middle,
        INK,
    );
}

/// A dashed line.
pub fn dashes(page: &mut Drawing, from: DVec2, to: DVec2, stroke: Stroke) {
    const DASH: f64 = 5.0;
    const GAP: f64 = 4.0;
    let length = to.distance(from);
    let along = (to - from) / length;
    let mut start = 0.0;
    while start < length {
        let end = (start + DASH).min(length);
        page.line(from + start * along, from + end * along, stroke);
        start += DASH + GAP;
    }
}

fn draw_allowed(page: &mut Drawing, axis: &Axis, curve: &Curve) {
    if let Some(y) = curve.allowed.and_then(|allowed| axis.up(allowed)) {
        let (from, to) = (axis.across(0.0), axis.across(1.0));
        let stroke = Stroke::new(curve.color, 1.0);
        dashes(page, DVec2::new(from, y), DVec2::new(to, y), stroke);
    }
}

/// A line where differences can be joined on the logarithmic axis.
fn draw_curve(page: &mut Drawing, axis: &Axis, curve: &Curve, stations: &[f64]) {
    let line = Stroke::new(curve.color, 1.6);
    let points: Vec<Option<DVec2>> = stations
        .iter()
        .zip(&curve.values)
        .map(|(&sigma, &value)| Some(DVec2::new(axis.across(sigma), axis.up(value)?)))
        .collect();
    for joined in points.split(Option::is_none) {
        let mut path: Path = joined.iter().flatten().copied().map(Step::Line).collect();
        if let Some(first) = joined.first().copied().flatten() {
            path[0] = Step::Move(first);
        }
        page.stroke(path, line);
    }
    if stations.len() <= MOST_MARKED {
        for &at in points.iter().flatten() {
            marker(page, at, curve.color);
        }
    }
}

fn draw_zeros(page: &mut Drawing, axis: &Axis, curve: &Curve, stations: &[f64]) {
    let lane = curve.quantity as usize as f64 - 1.5;
    for (&sigma, &value) in stations.iter().zip(&curve.values) {
        if value == 0.0 {
            let at = DVec2::new(axis.across(sigma), axis.zero() + LANE * lane);
            marker(page, at, curve.color);
        }
    }
}

fn marker(page: &mut Drawing, at: DVec2, color: Color) {
    page.shape(circle(at, 2.4), color, Some(Stroke::new(WHITE, 0.7)));
}

/// Each curve's name and its largest value.
fn draw_key(page: &mut Drawing, curves: &[Curve], cell: Cell) {
    const ENTRY: f64 = 43.0;
    const SWATCH: f64 = 22.0;
    let mut at = cell.corner + DVec2::new(cell.size.x + 16.0, 8.0);
    let text = at.x + SWATCH + 6.0;
    for curve in curves {
        let end = at + DVec2::new(SWATCH, 0.0);
        page.line(at, end, Stroke::new(curve.color, 1.6));
        marker(page, 0.5 * (at + end), curve.color);
        let base = DVec2::new(text, at.y + HALF_CAPITAL * TICK_SIZE);
        page.label(base, curve.name(), TICK_SIZE, Anchor::Start, INK);
        let largest = match curve.largest() {
            0.0 => "no difference".into(),
            largest => format!("≤ {}", power_of_ten(largest)),
        };
        let below = base + DVec2::new(0.0, 15.0);
        page.label(below, &largest, TICK_SIZE, Anchor::Start, NOTE);
        at.y += ENTRY;
    }
    let end = at + DVec2::new(SWATCH, 0.0);
    dashes(page, at, end, Stroke::new(NOTE, 1.0));
    let base = DVec2::new(text, at.y + HALF_CAPITAL * TICK_SIZE);
    let dashed = "dashed: allowed difference";
    page.label(base, dashed, TICK_SIZE, Anchor::Start, NOTE);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(values: &[f64]) -> Axis {
        let curve = Curve {
            quantity: Quantity::Force,
            values: values.to_vec(),
            allowed: None,
            color: CURVES[0],
        };
        let cell = Cell {
            corner: DVec2::ZERO,
            size: DVec2::new(500.0, 200.0),
        };
        Axis::of(&[curve], cell)
    }

    #[test]
    fn all_values_are_inside() {
        for values in [vec![1e-9, 3e-7], vec![1e-12], vec![0.0, 1e3, 1e-4]] {
            let axis = axis(&values);
            for value in values.into_iter().filter(|&value| value > 0.0) {
                assert!(axis.up(value).is_some(), "{value}");
            }
            assert!(axis.high - axis.low >= FEWEST_DECADES);
            assert!(axis.decades().count() as i32 <= MOST_LABELS);
        }
    }

    #[test]
    fn only_zeros() {
        let axis = axis(&[0.0, 0.0]);
        assert!(axis.zeros);
        assert_eq!(axis.up(0.0), None);
        assert!(axis.zero() < 200.0 && axis.zero() > axis.foot());
    }

    #[test]
    fn rounding_of_rounding_is_left_out() {
        let axis = axis(&[1e-300, 1e-3]);
        assert_eq!(axis.high - axis.low, MOST_DECADES);
        assert_eq!(axis.up(1e-300), None);
    }
}
