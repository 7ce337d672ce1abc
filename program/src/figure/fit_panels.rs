//! The panels of the figure of a fit.

use super::fit_series::Results;
use super::quantity::Quantity;
use crate::figure::axes::Axes;
use crate::figure::axis::{Axis, Ticks};
use crate::figure::drawing::{
    BLUE, Color, DOT, Drawing, INK, NOTE, Stroke, WHITE, circle, color_of_vein, polygon, rectangle,
};
use crate::figure::layout::{Cell, LEFT, PANEL_AXIS, PANEL_TITLE, RIGHT, WIDTH};
use crate::figure::markers::Marker;
use crate::figure::page::Key;
use crate::figure::setting::with_unit;
use glam::{DVec2, DVec3};
use leafdyn::scenario::Units;
use leafdyn::study::{FitLeaf, FitResidual, MeasuredQuantity};

const RESULT: f64 = 190.0;
const RESIDUALS: f64 = 70.0;
/// Least pixels between ticks of residuals.
const RESIDUAL_TICKS: f64 = 16.0;
/// Between results and their residuals.
const GAP: f64 = 12.0;
/// Heights of a leaf, and between its two views.
const LOWEST: f64 = 110.0;
const HIGHEST: f64 = 300.0;
const VIEWS_GAP: f64 = 70.0;
/// Right of the panels, for the key.
const KEY: f64 = 200.0;
const BAND: Color = Color(200, 222, 238);
const MODEL: Stroke = Stroke::new(BLUE, 1.6);
/// Half the width of the band of a single experiment, in pixels.
const SINGLE: f64 = 5.0;

const AXES: [&str; 3] = ["x", "y", "z"];
/// Views, and their axes.
const VIEWS: [(&str, [usize; 2]); 3] = [
    ("from above", [0, 1]),
    ("from the side", [0, 2]),
    ("along x", [1, 2]),
];

/// A result in words, with its unit.
fn result(kind: &str, units: &Units) -> Quantity {
    let (words, unit) = match kind.parse() {
        Ok(MeasuredQuantity::Tip(axis)) => (format!("{} of the tip", AXES[axis]), &units.length),
        Ok(MeasuredQuantity::Reaction(axis)) => {
            (format!("reaction along {}", AXES[axis]), &units.force)
        }
        Ok(MeasuredQuantity::Grip(grip, axis)) => {
            let words = format!("force on grip {} along {}", grip + 1, AXES[axis]);
            (words, &units.force)
        }
        Ok(MeasuredQuantity::Frequency(mode)) => (format!("frequency of mode {mode}"), &None),
        Err(()) => (kind.into(), &None),
    };
    let unit = unit.clone();
    Quantity { words, unit }
}

/// Draws results of one kind with the model along what varied, and their residuals along the same;
/// returns where that ends.
pub fn draw_results(
    page: &mut Drawing,
    top: f64,
    letter: &str,
    units: &Units,
    results: &Results,
) -> f64 {
    let cell = Cell::left_of_key(top + PANEL_TITLE, RESULT, KEY);
    let quantity = result(results.kind, units);
    let values = results.all().flat_map(|(_, r)| {
        let (band, sd) = (r.band, 2.0 * r.sd);
        [r.data - sd, r.data + sd, r.model - band, r.model + band]
    });
    let up = Axis {
        emphasizes_zero: false,
        ..Axis::holding(&quantity.axis(), values)
    };
    let places = || results.all().map(|(x, _)| x);
    let across = match results.along {
        Some(keys) => Axis::holding(&Quantity::of(&keys.to_string(), units).axis(), places()),
        None => {
            let mut numbers: Vec<f64> = places().collect();
            numbers.dedup();
            let ends = [numbers.first(), numbers.last()].map(|end| end.copied().unwrap_or(1.0));
            Axis {
                ticks: Ticks::At(numbers),
                ..Axis::linear("experiment", ends[0] - 0.5, ends[1] + 0.5)
            }
        }
    };
    let unlabelled = Axis {
        labelled: false,
        ..across.clone()
    };
    let axes = Axes::titled(page, cell, [letter, &quantity.words], unlabelled, up);
    for series in &results.series {
        match results.along {
            Some(_) => draw_model(page, &axes, series),
            None => draw_single(page, &axes, series),
        }
    }
    for (x, r) in results.all() {
        let bar = [(x, r.data - 2.0 * r.sd), (x, r.data + 2.0 * r.sd)];
        axes.curve(page, &bar, Stroke::new(DOT, 1.0));
    }
    axes.markers(
        page,
        results.all().map(|(x, r)| (x, r.data)),
        Marker::Dot,
        DOT,
    );
    let mut key = Key::right_of(cell);
    key.marker(
        page,
        "data",
        "with two standard deviations",
        Marker::Dot,
        DOT,
    );
    key.line(page, "model", "", MODEL);
    key.entry(
        page,
        "95 % band",
        "what the data leave open",
        |page, cell| {
            page.shape(rectangle(cell.corner, cell.size), BAND, None);
        },
    );
    let points = results.all().map(|(x, r)| (x, r.residual, INK)).collect();
    draw_residuals(page, cell, across, points)
}

/// Draws the model through a series of experiments, with its band.
fn draw_model(page: &mut Drawing, axes: &Axes, series: &[(f64, &FitResidual)]) {
    let mut once = series.to_vec();
    once.dedup_by_key(|(x, _)| *x);
    let line = |of: &dyn Fn(&FitResidual) -> f64| -> Vec<DVec2> {
        let points: Vec<(f64, f64)> = once.iter().map(|(x, r)| (*x, of(r))).collect();
        axes.smooth(&points).into_iter().flatten().collect()
    };
    let mut band = line(&|r| r.model + r.band);
    band.extend(line(&|r| r.model - r.band).into_iter().rev());
    if !band.is_empty() {
        page.shape(polygon(&band), BAND, None);
    }
    let model: Vec<Option<DVec2>> = line(&|r| r.model).into_iter().map(Some).collect();
    axes.line(page, &model, MODEL);
    if let [(x, r)] = once[..] {
        draw_single(page, axes, &[(x, r)]);
    }
}

/// Draws the model of single experiments, each with its band.
fn draw_single(page: &mut Drawing, axes: &Axes, experiments: &[(f64, &FitResidual)]) {
    for (x, r) in experiments {
        let ends = [r.model + r.band, r.model - r.band].map(|y| axes.at((*x, y)));
        if let ([Some(top), Some(end)], Some(at)) = (ends, axes.at((*x, r.model))) {
            let half = DVec2::new(SINGLE, 0.0);
            page.shape(rectangle(top - half, end - top + 2.0 * half), BAND, None);
            page.line(at - half, at + half, MODEL);
        }
    }
}

/// Draws residuals below a panel along the same axis; returns where they end.
fn draw_residuals(
    page: &mut Drawing,
    above: Cell,
    across: Axis,
    points: Vec<(f64, f64, Color)>,
) -> f64 {
    let corner = DVec2::new(above.corner.x, above.end().y + GAP);
    let cell = Cell::new(corner, DVec2::new(above.size.x, RESIDUALS));
    let sizes = points.iter().map(|(_, residual, _)| residual.abs());
    let most = 1.2 * sizes.filter(|it| it.is_finite()).fold(2.5, f64::max);
    let up = Axis {
        emphasizes_zero: true,
        tick_spacing: Some(RESIDUAL_TICKS),
        ..Axis::linear("residual", -most, most)
    };
    let axes = Axes { cell, across, up };
    axes.draw(page);
    let two = Stroke::new(NOTE, 1.0).dashed(true);
    for bound in [-2.0, 2.0] {
        let fraction = 1.0 - axes.up.fraction(bound);
        let from = corner + DVec2::new(0.0, fraction * cell.size.y);
        page.line(from, from.with_x(cell.end().x), two);
    }
    for (x, residual, color) in points {
        axes.markers(page, [(x, residual)], Marker::Dot, color);
    }
    let mut key = Key::right_of(cell);
    let note = "in standard deviations";
    key.marker(page, "data less model", note, Marker::Dot, INK);
    cell.end().y + PANEL_AXIS
}

/// Draws a leaf in the one or two views in which points were measured, with these, and their
/// residuals along the veins; returns where that ends.
pub fn draw_veins(
    page: &mut Drawing,
    top: f64,
    letter: &str,
    (experiment, units): (&str, &Units),
    leaf: &FitLeaf,
    residuals: Vec<&FitResidual>,
) -> f64 {
    let measured = |(_, [a, b]): &(&str, [usize; 2])| {
        let mut points = leaf.traced.iter();
        points.any(|(_, at)| at[*a].is_some() && at[*b].is_some())
    };
    let mut views: Vec<_> = VIEWS.into_iter().filter(measured).collect();
    if views.is_empty() {
        // Of marked points a single coordinate.
        views = VIEWS.into();
    }
    views.truncate(2);
    let whole = WIDTH - LEFT - RIGHT - KEY;
    let width = match views.len() {
        1 => whole,
        _ => 0.5 * (WIDTH - LEFT - RIGHT - VIEWS_GAP),
    };
    let count = leaf.curves.len();
    let panels: Vec<_> = (views.iter())
        .map(|(_, axes)| {
            let seen = |at: [Option<f64>; 3]| Some((at[axes[0]]?, at[axes[1]]?));
            let traced = leaf.traced.iter();
            let points = traced.filter_map(|(rod, at)| Some((*rod, seen(*at)?)));
            let points: Vec<(usize, (f64, f64))> = points.collect();
            let flat = |point: &DVec3| (point[axes[0]], point[axes[1]]);
            let curves = leaf.curves.iter();
            let curves = curves.map(|curve| curve.iter().map(flat).collect());
            let curves: Vec<Vec<(f64, f64)>> = curves.collect();
            let all = || curves.iter().flatten().chain(points.iter().map(|it| &it.1));
            let name = |k: usize| with_unit(AXES[axes[k]], units.length.as_deref());
            let across = Axis::holding(&name(0), all().map(|p| p.0));
            let up = Axis::holding(&name(1), all().map(|p| p.1));
            (across, up, curves, points)
        })
        .collect();
    let tall = |(across, up, ..): &(Axis, Axis, _, _)| {
        width * (up.end - up.start) / (across.end - across.start)
    };
    let height = panels
        .iter()
        .map(tall)
        .fold(0.0, f64::max)
        .clamp(LOWEST, HIGHEST);
    let experiment = match experiment {
        "as it is" => "traced veins".to_string(),
        name => format!("traced veins, experiment {name}"),
    };
    let mut below = Cell::left_of_key(top + PANEL_TITLE, height, KEY);
    for (k, ((view, _), (across, up, curves, points))) in views.iter().zip(panels).enumerate() {
        let corner = DVec2::new(LEFT + k as f64 * (width + VIEWS_GAP), top + PANEL_TITLE);
        let cell = Cell::new(corner, DVec2::new(width, height));
        let letter = if k == 0 { letter } else { "" };
        let what = format!("{experiment}, {view}");
        let (across, up) = equal_scales(across, up, cell.size);
        let panel = Axes::titled(page, cell, [letter, &what], across, up);
        for (rod, line) in curves.iter().enumerate() {
            let drawn = panel.smooth(line).into_iter().flatten().map(Some);
            let stroke = Stroke::new(color_of_vein(rod, count), 1.4);
            panel.line(page, &drawn.collect::<Vec<_>>(), stroke);
        }
        for (rod, point) in points {
            if let Some(at) = panel.at(point) {
                let rim = Stroke::new(color_of_vein(rod, count), 1.2);
                page.shape(circle(at, 2.6), WHITE, Some(rim));
            }
        }
        if views.len() == 1 {
            let mut key = Key::right_of(cell);
            key.line(page, "model", "each vein in its colour", MODEL);
            key.entry(page, "traced points", "", |page, cell| {
                let rim = Stroke::new(BLUE, 1.2);
                page.shape(circle(cell.middle(), 2.6), WHITE, Some(rim));
            });
        }
    }
    below.corner.y += PANEL_AXIS - GAP;
    let along = Axis::linear("fraction of the length", 0.0, 1.0);
    let points = residuals.iter().filter_map(|it| {
        let color = color_of_vein(it.rod?.checked_sub(1)?, count);
        Some((it.sigma?, it.residual, color))
    });
    draw_residuals(page, below, along, points.collect())
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
