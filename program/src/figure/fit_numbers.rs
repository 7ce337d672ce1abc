//! The free numbers of a fit with their intervals.

use super::quantity::Quantity;
use crate::figure::axes::Axes;
use crate::figure::axis::{Axis, Ticks};
use crate::figure::drawing::{Anchor, BLUE, Drawing, INK, Stroke};
use crate::figure::font::Font;
use crate::figure::layout::{Cell, LEFT, PANEL_AXIS, PANEL_TITLE, RIGHT, TICK_SIZE, WIDTH};
use crate::figure::markers::Marker;
use crate::report::numbers::{rounded_to, short};
use glam::DVec2;
use leafdyn::scenario::Units;
use leafdyn::study::FitParameter;

/// Left of the intervals, for the numbers in words; right of them, for the values; and a row.
const WORDS: f64 = 216.0;
const VALUES: f64 = 200.0;
const ROW: f64 = 24.0;
const MOST_NUMBERS: usize = 30;
/// Intervals are drawn up to this part of the value.
const WIDEST: f64 = 1.0;

/// Draws the free numbers with their intervals; returns where that ends.
pub fn draw_numbers(
    page: &mut Drawing,
    top: f64,
    letter: &str,
    all: &[FitParameter],
    units: &Units,
) -> f64 {
    let shown = &all[..all.len().min(MOST_NUMBERS)];
    let corner = DVec2::new(LEFT + WORDS, top + PANEL_TITLE);
    let size = DVec2::new(
        WIDTH - RIGHT - VALUES - corner.x,
        ROW * shown.len().max(1) as f64,
    );
    let cell = Cell::new(corner, size);
    // The ends of the intervals as parts of the values.
    let parts = |it: &FitParameter| {
        let part = |end: Option<f64>| end.map(|end| (end - it.value) / it.value.abs());
        [part(it.low), part(it.high)]
    };
    let known = shown.iter().flat_map(parts).flatten();
    let widest = known.map(f64::abs).filter(|it| it.is_finite());
    let widest = widest.fold(0.0, f64::max).min(WIDEST);
    let open = shown
        .iter()
        .flat_map(parts)
        .any(|end| end.is_none_or(|it| it.abs() > WIDEST));
    let end = 110.0
        * if open || widest == 0.0 {
            WIDEST
        } else {
            widest
        };
    let across = Axis {
        emphasizes_zero: true,
        ..Axis::linear("from the value / %", -end, end)
    };
    let up = Axis {
        ticks: Ticks::At(Vec::new()),
        labelled: false,
        ..Axis::linear("", 0.0, 1.0)
    };
    let axes = Axes::titled(page, cell, [letter, "95 % intervals"], across, up);
    for (k, it) in shown.iter().enumerate() {
        let middle = corner.y + ROW * (k as f64 + 0.5);
        let label = |page: &mut Drawing, x: f64, text: &str, room: f64, anchor: Anchor| {
            let text = Font::embedded().shortened(text, TICK_SIZE, room);
            page.centered_label(DVec2::new(x, middle), &text, TICK_SIZE, anchor, INK);
        };
        let number = Quantity::of(&it.key, units);
        label(
            page,
            corner.x - 10.0,
            &number.words,
            WORDS + LEFT - 16.0,
            Anchor::End,
        );
        let unit = number.unit.map_or(String::new(), |unit| format!(" {unit}"));
        let text = interval(it) + &unit;
        label(
            page,
            cell.end().x + 12.0,
            &text,
            WIDTH - cell.end().x - 16.0,
            Anchor::Start,
        );
        // An open interval leaves the frame, dashed.
        let [low, high] = parts(it);
        let place = |part: f64| axes.at((100.0 * part, 0.0)).map(|at| at.with_y(middle));
        let ends = [(low, -1.0), (high, 1.0)].map(|(part, sign)| {
            let inside = part.filter(|part| part.abs() <= WIDEST);
            (
                inside.is_some(),
                place(inside.unwrap_or(0.0099 * sign * end)),
            )
        });
        let Some(value) = place(0.0).filter(|_| it.value != 0.0) else {
            continue;
        };
        for (known, at) in ends {
            if let Some(at) = at {
                page.line(value, at, Stroke::new(BLUE, 1.8).dashed(!known));
            }
            if let Some(at) = at.filter(|_| known) {
                let half = DVec2::new(0.0, 4.5);
                page.line(at - half, at + half, Stroke::new(BLUE, 1.8));
            }
        }
        if it.determined {
            Marker::Circle.draw(page, value, BLUE);
        }
    }
    cell.end().y + PANEL_AXIS
}

/// A fitted number with its interval, without digits below it.
fn interval(it: &FitParameter) -> String {
    let error = match (it.low, it.high) {
        (Some(low), Some(high)) => 0.05 * (high - low),
        _ => 0.0,
    };
    let [value, low, high] =
        [Some(it.value), it.low, it.high].map(|it| it.map(|it| short(rounded_to(it, error))));
    let value = value.unwrap_or_default();
    match (it.determined, low, high) {
        (true, Some(low), Some(high)) => format!("{value} ({low} to {high})"),
        (true, ..) => value,
        (false, Some(low), Some(high)) => format!("open: {low} to {high}"),
        (false, Some(low), None) => format!("open: above {low}"),
        (false, None, Some(high)) => format!("open: below {high}"),
        (false, None, None) => "not determined".into(),
    }
}
