//! A fit: results of experiments with the model and its confidence band, measured points
//! over the veins, and the residuals of all data.

use crate::figure::axes::Axes;
use crate::figure::axis::{Axis, Ticks};
use crate::figure::drawing::{BLUE, DOT, Drawing, INK, NOTE, Stroke};
use crate::figure::layout::{Cell, HEADER, LEFT, PANEL_AXIS, PANEL_TITLE, RIGHT, WIDTH, letters};
use crate::figure::markers::Marker;
use crate::figure::page::{Key, new_page};
use crate::figure::setting::with_unit;
use crate::report::numbers::{brief, counted};
use glam::{DVec2, DVec3};
use leafdyn::scenario::{Scenario, Units};
use leafdyn::study::{Fit, FitLeaf, FitResidual};

const RESULT: f64 = 190.0;
const RESIDUALS: f64 = 120.0;
const VEINS: f64 = 300.0;
/// Right of the panels, for the key.
const KEY: f64 = 190.0;
const BOTTOM: f64 = 4.0;
/// Most kinds of results, and most leaves, that are drawn.
const MOST_RESULTS: usize = 6;
const MOST_LEAVES: usize = 3;
/// Between the two views of a leaf.
const GAP: f64 = 70.0;
/// Views, and their axes.
const VIEWS: [(&str, [usize; 2]); 3] = [
    ("from above", [0, 1]),
    ("from the side", [0, 2]),
    ("along x", [1, 2]),
];

pub fn draw(fit: &Fit, scenario: &Scenario) -> Drawing {
    let units = &scenario.units;
    let name = format!("{}: fit", fit.scenario);
    let count = fit.residuals.len();
    let free = counted(fit.parameters.len(), "free number", "free numbers");
    let mut notes = vec![format!("{count} data, {free}"), fit.outcome.word().into()];
    if let Some(sd) = fit.standard_deviation {
        notes.push(format!("residuals of {}", brief(sd)));
    }
    let mut page = new_page(LEFT, &name, &notes, None);
    let mut top = HEADER;
    let mut letters = letters();
    let mut letter = || letters.next().unwrap_or_default();
    let results = || fit.residuals.iter().filter(|it| it.rod.is_none());
    let mut kinds: Vec<&str> = Vec::new();
    for result in results() {
        if !kinds.contains(&result.what.as_str()) {
            kinds.push(&result.what);
        }
    }
    for kind in kinds.into_iter().take(MOST_RESULTS) {
        let of: Vec<&FitResidual> = results().filter(|it| it.what == kind).collect();
        let letter = letter();
        page.group("result", |page| {
            draw_result(page, top, &letter, (kind, units), &of)
        });
        top += PANEL_TITLE + RESULT + PANEL_AXIS;
    }
    let traced = fit.leaves.iter().filter(|(_, it)| !it.traced.is_empty());
    for (name, leaf) in traced.take(MOST_LEAVES) {
        let letter = letter();
        page.group("veins", |page| {
            draw_veins(page, top, &letter, (name, units), leaf)
        });
        top += PANEL_TITLE + VEINS + PANEL_AXIS;
    }
    let letter = letter();
    page.group("residuals", |page| draw_residuals(page, top, &letter, fit));
    page.height = (top + PANEL_TITLE + RESIDUALS + PANEL_AXIS + BOTTOM).ceil();
    page
}

fn draw_result(
    page: &mut Drawing,
    top: f64,
    letter: &str,
    (kind, units): (&str, &Units),
    of: &[&FitResidual],
) {
    let cell = Cell::left_of_key(top + PANEL_TITLE, RESULT, KEY);
    let what = format!("{kind} of the experiments");
    let values = of.iter().flat_map(|r| {
        let (band, sd) = (r.band, 2.0 * r.sd);
        [r.data - sd, r.data + sd, r.model - band, r.model + band]
    });
    let unit = match kind.split_once('_') {
        Some(("tip", _)) => units.length.as_deref(),
        Some(("reaction" | "grip", _)) => units.force.as_deref(),
        _ => None,
    };
    let mut up = Axis::holding(&with_unit(kind, unit), values);
    up.emphasizes_zero = false;
    let number = |r: &FitResidual| r.number as f64;
    let mut numbers: Vec<f64> = of.iter().map(|r| number(r)).collect();
    numbers.dedup();
    let ends = [numbers.first(), numbers.last()].map(|end| end.copied().unwrap_or(1.0));
    let across = Axis {
        ticks: Ticks::At(numbers),
        ..Axis::linear("experiment", ends[0] - 0.5, ends[1] + 0.5)
    };
    let axes = Axes::titled(page, cell, [letter, &what], across, up);
    let line = |value: &dyn Fn(&FitResidual) -> f64| -> Vec<(f64, f64)> {
        of.iter().map(|r| (number(r), value(r))).collect()
    };
    let dashed = Stroke::new(BLUE, 1.0).dashed(true);
    axes.curve(page, &line(&|r| r.model - r.band), dashed);
    axes.curve(page, &line(&|r| r.model + r.band), dashed);
    axes.curve(page, &line(&|r| r.model), Stroke::new(BLUE, 1.6));
    for r in of {
        let x = number(r);
        let bar = [(x, r.data - 2.0 * r.sd), (x, r.data + 2.0 * r.sd)];
        axes.curve(page, &bar, Stroke::new(DOT, 1.0));
    }
    axes.markers(page, line(&|r| r.data), Marker::Dot, DOT);
    let mut key = Key::right_of(cell);
    let bars = "with two standard deviations";
    key.marker(page, "data", bars, Marker::Dot, DOT);
    key.line(page, "model", "", Stroke::new(BLUE, 1.6));
    key.line(page, "95 % band", "what the data leave open", dashed);
}

/// Draws a leaf in the one or two views in which points were measured, with these.
fn draw_veins(
    page: &mut Drawing,
    top: f64,
    letter: &str,
    (experiment, units): (&str, &Units),
    leaf: &FitLeaf,
) {
    let width = 0.5 * (WIDTH - LEFT - RIGHT - GAP);
    let measured = |(_, [a, b]): &(&str, [usize; 2])| {
        let mut points = leaf.traced.iter();
        points.any(|(_, at)| at[*a].is_some() && at[*b].is_some())
    };
    let mut views: Vec<_> = VIEWS.into_iter().filter(measured).collect();
    if views.is_empty() {
        // Of marked points a single coordinate.
        views = VIEWS.into();
    }
    for (k, (view, axes)) in views.into_iter().take(2).enumerate() {
        let corner = DVec2::new(LEFT + k as f64 * (width + GAP), top + PANEL_TITLE);
        let cell = Cell::new(corner, DVec2::new(width, VEINS));
        let letter = if k == 0 { letter } else { "" };
        let what = format!("experiment {experiment}, {view}");
        let seen = |point: [Option<f64>; 3]| Some((point[axes[0]]?, point[axes[1]]?));
        let flat = |point: &DVec3| (point[axes[0]], point[axes[1]]);
        let traced = leaf.traced.iter();
        let points: Vec<(f64, f64)> = traced.filter_map(|(_, it)| seen(*it)).collect();
        let all: Vec<(f64, f64)> = leaf.curves.iter().flatten().map(flat).collect();
        let all = all.iter().chain(&points);
        let [name, above] = axes.map(|k| with_unit(["x", "y", "z"][k], units.length.as_deref()));
        let across = Axis::holding(&name, all.clone().map(|p| p.0));
        let up = Axis::holding(&above, all.map(|p| p.1));
        let (across, up) = equal_scales(across, up, cell.size);
        let panel = Axes::titled(page, cell, [letter, &what], across, up);
        for curve in &leaf.curves {
            let line: Vec<(f64, f64)> = curve.iter().map(flat).collect();
            panel.curve(page, &line, Stroke::new(BLUE, 1.4));
        }
        panel.markers(page, points, Marker::Dot, DOT);
    }
}

/// The axes, one widened so that both have the same number of pixels per length.
fn equal_scales(mut across: Axis, mut up: Axis, size: DVec2) -> (Axis, Axis) {
    let extents = [across.end - across.start, up.end - up.start];
    let unit = (extents[0] / size.x).max(extents[1] / size.y);
    for (axis, pixels) in [(&mut across, size.x), (&mut up, size.y)] {
        let (middle, half) = (0.5 * (axis.start + axis.end), 0.5 * unit * pixels);
        (axis.start, axis.end) = (middle - half, middle + half);
        axis.emphasizes_zero = false;
    }
    (across, up)
}

fn draw_residuals(page: &mut Drawing, top: f64, letter: &str, fit: &Fit) {
    let cell = Cell::left_of_key(top + PANEL_TITLE, RESIDUALS, KEY);
    let what = "residuals in standard deviations";
    let points = fit.residuals.iter().enumerate();
    let points: Vec<(f64, f64)> = points.map(|(k, r)| (k as f64 + 1.0, r.residual)).collect();
    let count = points.len() as f64;
    let values = points.iter().map(|point| point.1);
    let across = Axis {
        ticks: Ticks::At((1..=points.len()).map(|k| k as f64).collect()),
        ..Axis::linear("datum", 0.0, count + 1.0)
    };
    let up = Axis::holding("residual", values.chain([-2.5, 2.5]));
    let axes = Axes::titled(page, cell, [letter, what], across, up);
    for bound in [-2.0, 2.0] {
        let line = [(0.0, bound), (count + 1.0, bound)];
        axes.curve(page, &line, Stroke::new(NOTE, 1.0).dashed(true));
    }
    axes.markers(page, points, Marker::Dot, INK);
    let mut key = Key::right_of(cell);
    let (sum, freedom) = (brief(fit.chi_squared), fit.degrees_of_freedom);
    let sum = format!("sum of squares {sum} for {freedom} degrees of freedom");
    key.marker(page, "data less model", &sum, Marker::Dot, INK);
}
