//! How far the tip of a leaf moves when a number changes by 1 %, largest first.

use glam::DVec2;

use super::axes::Axes;
use super::axis::{Axis, Ticks};
use super::drawing::{Anchor, BLUE, Drawing, INK, rectangle};
use super::page::{Cell, HEADER, LEFT, PANEL_AXIS, PANEL_TITLE, RIGHT, TICK_SIZE, WIDTH, new_page};
use crate::relax::{Equilibrium, Sensitivity};

/// Room left of the panel, for the keys.
const NAMES: f64 = 190.0;
const ROW: f64 = 22.0;
const BAR: f64 = 12.0;
const BOTTOM: f64 = 4.0;
const MOST: usize = 40;
const FEWEST_DECADES: f64 = 2.0;

pub fn draw(leaf: &Equilibrium) -> Drawing {
    let found = leaf.sensitivities.as_deref().unwrap_or_default();
    let length = leaf.shape.longest();
    let change = |found: &Sensitivity| {
        let by = match found.value {
            0.0 => 1.0,
            value => 0.01 * value,
        };
        let moved = found.tips.iter().map(|tip| (*tip * by).length());
        moved.fold(0.0, f64::max) / length
    };
    let rows = found.iter().map(|it| (it.key.as_str(), change(it)));
    let mut rows: Vec<(&str, f64)> = rows.collect();
    rows.sort_by(|a, b| b.1.total_cmp(&a.1));
    rows.truncate(MOST);
    let height = ROW * rows.len().max(1) as f64;
    let name = format!("{}: what each number does to the tip", leaf.scenario);
    let notes = ["a number that is zero: one of its units".to_string()];
    let mut page = new_page(LEFT, &name, &notes, None);
    page.height = HEADER + PANEL_TITLE + height + PANEL_AXIS + BOTTOM;
    let cell = Cell::new(
        DVec2::new(LEFT + NAMES, HEADER + PANEL_TITLE),
        DVec2::new(WIDTH - LEFT - RIGHT - NAMES, height),
    );
    let values = rows.iter().map(|row| row.1);
    let name = "displacement of the tip by 1 %, in L";
    let across = Axis::logarithmic(name, values, FEWEST_DECADES);
    let up = Axis {
        ticks: Ticks::At(Vec::new()),
        labelled: false,
        ..Axis::linear("", 0.0, 1.0)
    };
    page.group("changes", |page| {
        let what = "by a hundredth of each number";
        let axes = Axes::titled(page, cell, ["", what], across, up);
        for (k, (key, value)) in rows.iter().enumerate() {
            let middle = cell.corner.y + ROW * (k as f64 + 0.5);
            let at = DVec2::new(cell.corner.x - 8.0, middle);
            page.centered_label(at, key, TICK_SIZE, Anchor::End, INK);
            let fraction = axes.across.fraction(*value);
            if fraction.is_finite() && fraction > 0.0 {
                let corner = DVec2::new(cell.corner.x, middle - 0.5 * BAR);
                let size = DVec2::new(fraction.min(1.0) * cell.size.x, BAR);
                page.shape(rectangle(corner, size), BLUE, None);
            }
        }
    });
    page
}
