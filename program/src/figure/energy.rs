//! The energies of a moving leaf and the position of its tip over time.

use crate::figure::axes::{Axes, Curve};
use crate::figure::axis::Axis;
use crate::figure::drawing::{CURVES, Drawing, INK, Stroke};
use crate::figure::layout::{Cell, HEADER, LEFT, PANEL_AXIS, PANEL_TITLE};
use crate::figure::page::{Key, new_page};
use crate::figure::setting::with_unit;
use crate::report::numbers::short;
use leafdyn::scenario::{Scenario, Units};
use leafdyn::simulate::Energy;
use leafdyn::simulate::Record;

const ENERGIES: f64 = 300.0;
const BALANCE: f64 = 120.0;
const TIP: f64 = 200.0;
/// Gap above the lower panels, for the tick labels of the upper ones.
const BETWEEN: f64 = 30.0;
const BOTTOM: f64 = 4.0;
/// Right of the panels, for the key.
const KEY: f64 = 200.0;

pub fn notes(record: &Record) -> Vec<String> {
    let mut notes = vec![
        format!("N = {}", record.rods),
        format!("{} method", record.scheme),
        format!("{} segments a vein", record.segments),
    ];
    if record.stopped.is_some() {
        notes.push(format!("ended early: {}", record.outcome()));
    }
    notes
}

pub fn draw_energies(record: &Record, scenario: &Scenario) -> Drawing {
    let name = format!("{}: energy in time", record.scenario);
    let upper = HEADER + PANEL_TITLE;
    let lower = upper + ENERGIES + BETWEEN + PANEL_TITLE;
    let mut drawing = new_page(LEFT, &name, &notes(record), None);
    let lowest = lower + BALANCE + BETWEEN + PANEL_TITLE;
    drawing.height = lowest + TIP + PANEL_AXIS + BOTTOM;
    let end = match record.time {
        time if time > 0.0 => time,
        _ => record.duration,
    };
    let curves = curves(record);
    let balance = &curves[curves.len() - 1];
    let values = curves.iter().flat_map(Curve::values);
    let unit = scenario.units.energy();
    let energy = with_unit("energy", unit.as_deref());
    let across = Axis::linear("", 0.0, end);
    let up = Axis::holding(&energy, values.chain([0.0]));
    let cell = Cell::left_of_key(upper, ENERGIES, KEY);
    drawing.group("energies", |page| {
        let what = "where the energy is";
        let axes = Axes::titled(page, cell, ["(a)", what], across.clone(), up);
        // In reverse, so that the balance, which should be zero, is below all others.
        for curve in curves.iter().rev() {
            axes.curve(page, &curve.points, Stroke::new(curve.color, 1.6));
        }
        let mut key = Key::right_of(cell);
        for curve in &curves {
            draw_key_line(page, &mut key, curve);
        }
    });
    let cell = Cell::left_of_key(lower, BALANCE, KEY);
    let name = with_unit("balance", unit.as_deref());
    let up = Axis::holding(&name, balance.values().chain([0.0]));
    drawing.group("balance", |page| {
        let what =
            "its balance, which no motion changes, magnified: all energies less the work put in";
        let axes = Axes::titled(page, cell, ["(b)", what], across, up);
        axes.curve(page, &balance.points, Stroke::new(INK, 1.3));
    });
    let cell = Cell::left_of_key(lowest, TIP, KEY);
    drawing.group("tip", |page| {
        draw_tip(page, record, &scenario.units, cell, end)
    });
    drawing
}

/// Draws the coordinates of the joint tip, or the means of free ones.
fn draw_tip(page: &mut Drawing, record: &Record, units: &Units, cell: Cell, end: f64) {
    let coordinate = |axis: usize| Curve {
        name: ["x", "y", "z"][axis],
        color: CURVES[axis],
        points: (record.moments.iter())
            .map(|moment| (moment.time, moment.tip[axis]))
            .collect(),
    };
    let curves = [0, 1, 2].map(coordinate);
    let across = match units.time.as_deref() {
        None => "time, in the scenario's unit".into(),
        unit => with_unit("time", unit),
    };
    let across = Axis::linear(&across, 0.0, end);
    let name = with_unit("tip", units.length.as_deref());
    let up = Axis::holding(&name, curves.iter().flat_map(Curve::values).chain([0.0]));
    let what = match record.joined {
        true => "where the tip is",
        false => "where the tips are, in the mean",
    };
    let axes = Axes::titled(page, cell, ["(c)", what], across, up);
    let mut key = Key::right_of(cell);
    for curve in &curves {
        axes.curve(page, &curve.points, Stroke::new(curve.color, 1.6));
        draw_key_line(page, &mut key, curve);
    }
}

/// Draws the line of a curve in the key, with its last value.
fn draw_key_line(page: &mut Drawing, key: &mut Key, curve: &Curve) {
    let last = curve.points.last().map_or(0.0, |point| point.1);
    let note = format!("at the end {}", short(last));
    key.line(page, curve.name, &note, Stroke::new(curve.color, 1.6));
}

/// All energies except those that are always zero; their balance last.
fn curves(record: &Record) -> Vec<Curve> {
    let first = record.moments.first().map(|moment| moment.energy);
    let first = first.unwrap_or_default();
    let curve = |name, color, value: &dyn Fn(&Energy) -> f64| Curve {
        name,
        color,
        points: (record.moments.iter())
            .map(|moment| (moment.time, value(&moment.energy)))
            .collect(),
    };
    let mut curves = vec![
        curve("kinetic", CURVES[0], &|e| e.kinetic),
        curve("elastic and coupling", CURVES[1], &|e| {
            e.elastic + e.coupling
        }),
        curve("potential, from the start", CURVES[2], &|e| {
            e.potential - first.potential
        }),
        curve("dissipated", CURVES[3], &|e| e.dissipated),
        curve("work put in", CURVES[4], &|e| e.work),
    ];
    curves.retain(|curve| curve.values().any(|value| value != 0.0));
    curves.push(curve("balance", INK, &|e| e.balance() - first.balance()));
    curves
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn what_is_always_zero_is_not_drawn() {
        let mut record = sample::record(3, 4);
        let names = |record: &Record| -> Vec<&str> {
            let curves = curves(record).into_iter();
            curves.map(|curve| curve.name).collect()
        };
        assert!(!names(&record).contains(&"work put in"));
        record.moments[3].energy.work = 0.1;
        assert!(names(&record).contains(&"work put in"));
    }
}
