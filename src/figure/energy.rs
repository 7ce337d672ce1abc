//! Where the energy of a moving leaf is, in time.

use glam::DVec2;

use super::colors::{CURVES, Color, INK};
use super::curves::{Axes, Range};
use super::drawing::{Drawing, Stroke};
use super::flat::title;
use super::header::{self, HEADER};
use super::motion::notes;
use super::page::{Cell, LEFT, PANEL_AXIS, PANEL_TITLE, RIGHT, WIDTH};
use crate::motion::Energy;
use crate::simulate::Record;

const ENERGIES: f64 = 300.0;
const BALANCE: f64 = 120.0;
/// Above the lower panel, which has its ticks labelled as the upper.
const BETWEEN: f64 = 30.0;
const BOTTOM: f64 = 4.0;
/// Right of the panels, for the key.
const KEY: f64 = 200.0;

/// One energy in time.
struct Curve {
    name: &'static str,
    color: Color,
    points: Vec<(f64, f64)>,
}

impl Curve {
    fn of(
        record: &Record,
        name: &'static str,
        color: Color,
        value: impl Fn(&Energy) -> f64,
    ) -> Self {
        let moments = record.moments.iter();
        Curve {
            name,
            color,
            points: moments
                .map(|moment| (moment.time, value(&moment.energy)))
                .collect(),
        }
    }

    fn values(&self) -> impl Iterator<Item = f64> {
        self.points.iter().map(|point| point.1)
    }
}

/// The whole page.
pub fn draw(record: &Record) -> Drawing {
    let name = format!("{}: energy in time", record.scenario);
    let (upper, lower) = (HEADER + PANEL_TITLE, HEADER + PANEL_TITLE + ENERGIES);
    let lower = lower + BETWEEN + PANEL_TITLE;
    let mut drawing = Drawing {
        width: WIDTH,
        height: lower + BALANCE + PANEL_AXIS + BOTTOM,
        description: name.clone(),
        marks: Vec::new(),
    };
    drawing.group("header", |page| {
        header::draw_without_key(page, &name, &notes(record));
    });
    let first = record.moments.first().map(|moment| moment.energy);
    let first = first.unwrap_or_default();
    let balance = Curve::of(record, "balance", INK, |e| e.balance() - first.balance());
    let cell = |top: f64, height: f64| Cell {
        corner: DVec2::new(LEFT, top),
        size: DVec2::new(WIDTH - LEFT - RIGHT - KEY, height),
    };
    let end = match record.time() {
        time if time > 0.0 => time,
        _ => record.duration,
    };
    let time = Range::between(0.0, end);
    let mut curves = parts(record, &first);
    let values = curves.iter().flat_map(Curve::values);
    let axes = Axes {
        cell: cell(upper, ENERGIES),
        across: time,
        up: Range::of(values.chain(balance.values()).chain([0.0])).airy(),
    };
    let magnified = Axes {
        cell: cell(lower, BALANCE),
        across: time,
        up: Range::of(balance.values().chain([0.0])).airy(),
    };
    curves.push(balance);
    drawing.group("energies", |page| {
        title(page, axes.cell.corner, "(a)", "where the energy is");
        axes.draw(page, "", "energy");
        // The balance, which should be zero, under all others.
        for (entry, curve) in curves.iter().enumerate().rev() {
            axes.curve(page, &curve.points, Stroke::new(curve.color, 1.6));
            let last = curve.points.last().map_or(0.0, |point| point.1);
            let at_end = format!("at the end {}", short(last));
            axes.key(page, entry, curve.color, curve.name, &at_end);
        }
    });
    drawing.group("balance", |page| {
        let balance = &curves[curves.len() - 1];
        let what =
            "its balance, which no motion changes, magnified: all energies less the work put in";
        title(page, magnified.cell.corner, "(b)", what);
        magnified.draw(page, "time, in the scenario's unit", "balance");
        magnified.curve(page, &balance.points, Stroke::new(INK, 1.3));
    });
    drawing
}

/// All energies but those that are always zero.
fn parts(record: &Record, first: &Energy) -> Vec<Curve> {
    let [kinetic, strains, potential, dissipated, work] = CURVES;
    let mut curves = vec![
        Curve::of(record, "kinetic", kinetic, |e| e.kinetic),
        Curve::of(record, "elastic and coupling", strains, |e| {
            e.elastic + e.coupling
        }),
        Curve::of(record, "potential, from the start", potential, |e| {
            e.potential - first.potential
        }),
        Curve::of(record, "dissipated", dissipated, |e| e.dissipated),
        Curve::of(record, "work put in", work, |e| e.work),
    ];
    curves.retain(|curve| curve.values().any(|value| value != 0.0));
    curves
}

/// A number, rounded to four digits.
pub fn short(value: f64) -> String {
    let minus = if value < 0.0 { "\u{2212}" } else { "" };
    let size = value.abs();
    if size.is_nan() || size.is_infinite() {
        return "∞".into();
    }
    if size < f64::MIN_POSITIVE {
        return "0".into();
    }
    let exponent = size.log10().floor() as i32;
    if !(-3..6).contains(&exponent) {
        let mantissa = size / 10f64.powi(exponent);
        let power = crate::report::numbers::superscript(exponent);
        return format!("{minus}{mantissa:.2}×10{power}");
    }
    let decimals = (3 - exponent).max(0) as usize;
    let digits = format!("{size:.decimals$}");
    let digits = match decimals {
        0 => &digits,
        _ => digits.trim_end_matches('0').trim_end_matches('.'),
    };
    format!("{minus}{digits}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn numbers_have_few_digits() {
        assert_eq!(short(0.0), "0");
        assert_eq!(short(-0.123456), "\u{2212}0.1235");
        assert_eq!(short(1234.56), "1235");
        assert_eq!(short(0.7), "0.7");
        assert_eq!(short(120.0), "120");
        assert_eq!(short(2.5e-9), "2.50×10⁻⁹");
        assert_eq!(short(f64::NAN), "∞");
    }

    #[test]
    fn what_is_always_zero_is_not_drawn() {
        let mut record = sample::record(3, 4);
        let names = |record: &Record| -> Vec<&str> {
            parts(record, &Energy::default())
                .iter()
                .map(|curve| curve.name)
                .collect()
        };
        assert!(!names(&record).contains(&"work put in"));
        record.moments[3].energy.work = 0.1;
        assert!(names(&record).contains(&"work put in"));
    }
}
