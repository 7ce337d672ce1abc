//! The figure of a check: the relaxed leaf as lines, the boundary-value
//! solution as dots, and their differences along the veins.

use crate::figure::drawing::axes::{Axes, Axis, Curve, Ticks};
use crate::figure::drawing::formats::Font;
use crate::figure::drawing::labels::{
    Cell, HEADER, Key, KeyRows, LEFT, NOTE_BASE, PANEL_AXIS, PANEL_TITLE, RIGHT, TEXT_SIZE, WIDTH,
    header, title,
};
use crate::figure::drawing::markers::{Marker, dot};
use crate::figure::drawing::{Anchor, CURVES, Color, Drawing, INK, NOTE, Stroke, vein_color};
use crate::figure::leaf::{Panels, Veins};
use crate::figure::scenario::Setting;
use crate::report::numbers::power_of_ten;
use crate::report::{equilibrium_of_index, headline, verdict};
use glam::DVec2;
use leafdyn::scenario::Scenario;
use leafdyn::study::{Check, Quantity, Verdict};

const LINE: f64 = 19.0;

pub fn draw(check: &Check, scenario: &Scenario) -> Drawing {
    let setting = Setting::of(scenario);
    let mut veins = Veins::of(&check.relaxed, scenario);
    if let Some(solution) = check.solution() {
        veins.add_dots(&solution.rods);
    }
    let title = format!("{}: {}", check.relaxed.scenario, headline(&check.verdict));
    // Why the solutions could not be compared.
    let reason = match &check.verdict {
        Verdict::NotCompared(why) | Verdict::NotIndependent(why) => {
            Font::embedded().wrapped(why, TEXT_SIZE, WIDTH - LEFT - RIGHT)
        }
        _ => Vec::new(),
    };
    let key_line = NOTE_BASE + LINE * (reason.len() + 1) as f64;
    let panels = Panels::below(HEADER - NOTE_BASE + key_line, &veins);
    let compared = !check.along.is_empty();
    let below = if compared { HEIGHT } else { 0.0 };
    let mut drawing = Drawing::new(WIDTH, &title);
    drawing.height = (panels.end() + below).ceil();
    drawing.group("header", |page| {
        let notes = notes(check, &veins, &setting);
        header(page, LEFT, &title, &notes, Some(&veins));
        for (line, text) in reason.iter().enumerate() {
            let base = DVec2::new(LEFT, NOTE_BASE + LINE * (line + 1) as f64);
            page.label(base, text, TEXT_SIZE, Anchor::Start, INK);
        }
        let mut key = KeyRows::at(LEFT, key_line, 26.0);
        let stroke = Stroke::new(vein_color(0.3), veins.line_width());
        key.entry(page, "relaxed", |page, cell| cell.line(page, stroke));
        if check.solution().is_some() {
            key.entry(page, "boundary-value solution by shooting", |page, cell| {
                dot(page, cell.middle(), 2.0);
            });
        }
    });
    panels.draw(&mut drawing, &veins, &setting);
    if compared {
        drawing.group("differences", |page| {
            draw_differences(page, check, veins.unit, panels.end());
        });
    }
    drawing
}

fn notes(check: &Check, veins: &Veins, setting: &Setting) -> Vec<String> {
    let mut notes = vec![format!("N = {}", veins.count)];
    let relaxed = verdict(&check.relaxed);
    match &check.shot {
        Some(shot) if shot.found.is_ok() => {
            let shot = equilibrium_of_index(shot.negative_eigenvalues);
            if shot == relaxed {
                notes.push(format!("both: {shot}"));
            } else {
                notes.push(format!("relaxed: {relaxed}"));
                notes.push(format!("by shooting: {shot}"));
            }
        }
        _ => notes.push(format!("relaxed: {relaxed}")),
    }
    notes.extend(veins.notes(setting));
    notes
}

const FRAME_HEIGHT: f64 = 216.0;

/// Right of the frame, for the key.
const KEY: f64 = 212.0;

const HEIGHT: f64 = PANEL_TITLE + FRAME_HEIGHT + PANEL_AXIS;

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

fn draw_differences(page: &mut Drawing, check: &Check, unit: f64, start: f64) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::formats::text;
    use crate::report::sample;

    fn svg(check: &Check) -> String {
        text(&draw(check, &sample::scenario("fan", 5)))
    }

    #[test]
    fn the_verdict_is_the_title() {
        for (angle, title) in [
            (0.0, "fan: both methods agree"),
            (0.1, "fan: the methods differ"),
        ] {
            let svg = svg(&sample::check(5, 8, angle));
            assert!(svg.contains(&format!("<title>{title}</title>")), "{title}");
            assert!(svg.contains(&format!(">{title}</text>")), "{title}");
            for quantity in ["position", "rotation", "force", "moment"] {
                assert!(svg.contains(quantity), "{quantity}");
            }
        }
    }

    #[test]
    fn without_a_second_solution_the_reason_is_given() {
        let mut check = sample::check(5, 8, 0.0);
        let reason = "the relaxation did not come to rest: ".repeat(6);
        check.shot = None;
        check.along.clear();
        check.difference = None;
        check.verdict = Verdict::NotCompared(reason);
        let svg = svg(&check);
        assert!(svg.contains("could not be compared"));
        assert_eq!(svg.matches("rest:").count(), 6);
        assert!(!svg.contains("class=\"differences\""));
    }
}
