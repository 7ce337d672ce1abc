//! How the panels share the page.
//!
//! The three flat panels are drawn to one scale and placed as in a technical
//! drawing: the side view under the top view with the same xi axis, the front
//! view beside the side view with the same zeta axis.

use glam::{DVec2, DVec3};

use super::colors::{INK, NOTE, WHITE, vein_color};
use super::drawing::{Anchor, Drawing, HALF_CAPITAL, Stroke, circle, rectangle};
use super::font::Font;
use super::ticks::round_step;
use super::veins::Veins;
use super::{flat, space};
use crate::output::{power_of_ten, verdict};
use crate::relax::Equilibrium;

const WIDTH: f64 = 900.0;
const LEFT: f64 = 64.0;
const RIGHT: f64 = 22.0;
const HEADER: f64 = 74.0;
/// Above a panel, for its title.
const PANEL_TITLE: f64 = 24.0;
/// Below a panel, for its axis.
const PANEL_AXIS: f64 = 48.0;
const BOTTOM: f64 = 4.0;
/// Between the columns, for the right one's axis.
const COLUMN_GAP: f64 = 74.0;
const COLUMNS: f64 = WIDTH - LEFT - RIGHT - COLUMN_GAP;

/// Panels do not get smaller than this, however flat the leaf.
const NARROWEST_COLUMN: f64 = 340.0;
const LOWEST_TOP: f64 = 270.0;
const LOWEST_BOTTOM: f64 = 130.0;
/// Both rows together do not get higher than this, however tall the leaf.
const HIGHEST_ROWS: f64 = 800.0;

/// Air around the leaf, as a fraction of its largest extent.
const AIR: f64 = 0.06;

/// Distance between grid lines at least.
const TICK_DISTANCE: f64 = 36.0;

/// Font sizes.
pub const TITLE_SIZE: f64 = 19.0;
pub const TEXT_SIZE: f64 = 12.0;
pub const TICK_SIZE: f64 = 10.5;

/// A rectangle on the page.
#[derive(Clone, Copy)]
pub struct Cell {
    pub corner: DVec2,
    pub size: DVec2,
}

/// Draws the whole page.
pub fn draw(equilibrium: &Equilibrium) -> Drawing {
    let veins = Veins::of(equilibrium);
    let layout = Layout::of(&veins);
    let mut drawing = Drawing {
        width: WIDTH,
        height: layout.height(),
        description: format!("{}: {}", equilibrium.scenario, verdict(equilibrium)),
        marks: Vec::new(),
    };
    drawing.group("header", |page| header(page, equilibrium, &veins));

    let step = round_step(TICK_DISTANCE / layout.scale);
    let [left, right] = layout.columns.map(|column| column.0);
    let [top, bottom] = layout.rows.map(|row| row.0);
    let [width_left, width_right] = layout.columns.map(|column| column.1);
    let [height_top, height_bottom] = layout.rows.map(|row| row.1);
    let cell = |x, y, width, height| Cell {
        corner: DVec2::new(x, y),
        size: DVec2::new(width, height),
    };
    for (view, cell) in [
        (&flat::TOP, cell(left, top, width_left, height_top)),
        (&flat::SIDE, cell(left, bottom, width_left, height_bottom)),
        (
            &flat::FRONT,
            cell(right, bottom, width_right, height_bottom),
        ),
    ] {
        let scale = layout.scale;
        drawing.group(view.name, |page| {
            flat::draw(page, view, &veins, cell, scale, step)
        });
    }
    // Nothing stands left of the panel in space: it takes half of the gap.
    let shift = 0.5 * COLUMN_GAP;
    let space_cell = cell(
        right - shift,
        top,
        width_right + shift,
        height_top + PANEL_AXIS - TICK_SIZE,
    );
    drawing.group("space", |page| space::draw(page, &veins, space_cell));
    drawing
}

/// Starts and lengths of columns and rows, and the pixels per length of the
/// flat panels.
struct Layout {
    columns: [(f64, f64); 2],
    rows: [(f64, f64); 2],
    scale: f64,
}

impl Layout {
    fn of(veins: &Veins) -> Self {
        let DVec3 { x, y, z } = veins.high - veins.low + DVec3::splat(2.0 * AIR * veins.extent());
        // The largest scale that lets every panel hold the leaf.
        let scale = [
            COLUMNS / (x + y),
            (COLUMNS - NARROWEST_COLUMN) / x.max(y),
            HIGHEST_ROWS / (y + z),
            (HIGHEST_ROWS - LOWEST_BOTTOM) / y,
            (HIGHEST_ROWS - LOWEST_TOP) / z,
        ]
        .into_iter()
        .fold(f64::INFINITY, f64::min);

        let widths = [x, y].map(|extent| (scale * extent).max(NARROWEST_COLUMN));
        let spare = COLUMNS - widths[0] - widths[1];
        let widths = widths.map(|width| width + 0.5 * spare);
        let heights = [(scale * y).max(LOWEST_TOP), (scale * z).max(LOWEST_BOTTOM)];
        let top = HEADER + PANEL_TITLE;
        let bottom = top + heights[0] + PANEL_AXIS + PANEL_TITLE;
        Layout {
            columns: [
                (LEFT, widths[0]),
                (LEFT + widths[0] + COLUMN_GAP, widths[1]),
            ],
            rows: [(top, heights[0]), (bottom, heights[1])],
            scale,
        }
    }

    fn height(&self) -> f64 {
        let (start, height) = self.rows[1];
        (start + height + PANEL_AXIS + BOTTOM).ceil()
    }
}

/// The scenario's name, what was found, and the key to colours and markers.
fn header(page: &mut Drawing, equilibrium: &Equilibrium, veins: &Veins) {
    const TITLE_BASE: f64 = 38.0;
    const NOTE_BASE: f64 = 60.0;
    let font = Font::embedded();
    let key_start = key(page, equilibrium, &font);
    let name = shortened(&equilibrium.scenario, key_start - LEFT - 20.0, &font);
    page.label(
        DVec2::new(LEFT, TITLE_BASE),
        &name,
        TITLE_SIZE,
        Anchor::Start,
        INK,
    );
    let note = note(equilibrium, veins);
    page.label(
        DVec2::new(LEFT, NOTE_BASE),
        &note,
        TEXT_SIZE,
        Anchor::Start,
        NOTE,
    );
}

fn note(equilibrium: &Equilibrium, veins: &Veins) -> String {
    let mut parts = vec![
        format!("N = {}", equilibrium.curves.len()),
        verdict(equilibrium),
    ];
    if let Some(error) = equilibrium.error_estimate {
        parts.push(format!(
            "error of positions ≤ {} L",
            power_of_ten(error / veins.unit)
        ));
    }
    parts.push(format!("L = {}", veins.unit));
    if veins.every > 1 {
        parts.push(format!("1 vein in {} drawn", veins.every));
    }
    // Spaces that SVG does not collapse.
    parts.join("\u{a0}\u{a0}·\u{a0}\u{a0}")
}

/// The text, or as much of it as fits, with an ellipsis.
fn shortened(text: &str, width: f64, font: &Font) -> String {
    let mut shown: String = text.chars().filter(|c| !c.is_control()).collect();
    if font.width(&shown, TITLE_SIZE) <= width {
        return shown;
    }
    while font.width(&shown, TITLE_SIZE) + TITLE_SIZE > width && shown.pop().is_some() {}
    shown + "…"
}

/// Draws the key at the right end of the header; returns where it starts.
fn key(page: &mut Drawing, equilibrium: &Equilibrium, font: &Font) -> f64 {
    const MIDDLE: f64 = 32.0;
    const BAR: DVec2 = DVec2::new(120.0, 9.0);
    const BAR_STEPS: u32 = 60;
    let base = MIDDLE + HALF_CAPITAL * TEXT_SIZE;
    let mut x = WIDTH - RIGHT;
    let text_before = |page: &mut Drawing, x: &mut f64, text: &str| {
        page.label(DVec2::new(*x, base), text, TEXT_SIZE, Anchor::End, NOTE);
        *x -= font.width(text, TEXT_SIZE) + 6.0;
    };
    let count = equilibrium.curves.len();
    if count > 1 {
        text_before(page, &mut x, &count.to_string());
        x -= BAR.x;
        let corner = DVec2::new(x, MIDDLE - 0.5 * BAR.y);
        let part = DVec2::new(BAR.x / f64::from(BAR_STEPS), BAR.y);
        for i in 0..BAR_STEPS {
            let color = vein_color(f64::from(i) / f64::from(BAR_STEPS - 1));
            // Each part reaches under the next: no gaps between them.
            let overlap = if i + 1 < BAR_STEPS { 0.5 } else { 0.0 };
            let size = part + DVec2::new(overlap, 0.0);
            page.shape(
                rectangle(corner + f64::from(i) * DVec2::new(part.x, 0.0), size),
                color,
                None,
            );
        }
        x -= 6.0;
        text_before(page, &mut x, "vein 1");
        x -= 16.0;
    }
    text_before(
        page,
        &mut x,
        if equilibrium.tips.len() > 1 {
            "tips"
        } else {
            "tip"
        },
    );
    tip_marker(page, DVec2::new(x - 3.0, MIDDLE));
    x -= 26.0;
    text_before(page, &mut x, "clamp");
    clamp_marker(page, DVec2::new(x - 3.0, MIDDLE));
    x - 10.0
}

/// Where the rods are clamped; larger than the tip's marker, which may cover it.
pub fn clamp_marker(page: &mut Drawing, at: DVec2) {
    let half = DVec2::splat(4.2);
    page.shape(
        rectangle(at - half, 2.0 * half),
        INK,
        Some(Stroke::new(WHITE, 1.0)),
    );
}

/// The joint tip, or the tip of a single rod.
pub fn tip_marker(page: &mut Drawing, at: DVec2) {
    page.shape(circle(at, 3.3), WHITE, Some(Stroke::new(INK, 1.3)));
}

/// Marks all tips, small if there are many.
pub fn tip_markers(page: &mut Drawing, veins: &Veins, place: impl Fn(DVec3) -> DVec2) {
    if let [(tip, _)] = veins.tips.as_slice() {
        return tip_marker(page, place(*tip));
    }
    let radius = if veins.tips.len() > 30 { 1.5 } else { 2.4 };
    for (tip, color) in &veins.tips {
        let rim = Stroke::new(*color, 0.5 * radius);
        page.shape(circle(place(*tip), radius), WHITE, Some(rim));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::sample;

    #[test]
    fn every_extent_fits_its_panel() {
        for size in [
            [1.0, 1.0, 0.2],
            [1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.1, 2.0, 0.0],
            [0.0; 3],
        ] {
            let mut veins = Veins::of(&sample::fan(3, 4));
            veins.low = DVec3::ZERO;
            veins.high = DVec3::from_array(size);
            let Layout {
                columns,
                rows,
                scale,
            } = Layout::of(&veins);
            let slack = 1e-9;
            assert!(columns[0].1 + slack >= scale * size[0], "{size:?}");
            assert!(columns[1].1 + slack >= scale * size[1], "{size:?}");
            assert!(rows[0].1 + slack >= scale * size[1], "{size:?}");
            assert!(rows[1].1 + slack >= scale * size[2], "{size:?}");
            assert!(
                (columns[0].1 + columns[1].1 - COLUMNS).abs() < slack,
                "{size:?}"
            );
            assert!(rows[0].1 + rows[1].1 <= HIGHEST_ROWS + slack, "{size:?}");
        }
    }

    #[test]
    fn shapes_gone_wild_are_drawn_without_a_panic() {
        for wild in [f64::NAN, f64::INFINITY, 1e300, -1e-300] {
            let mut leaf = sample::fan(3, 8);
            for curve in &mut leaf.curves {
                curve[4].z = wild;
            }
            leaf.tips[0].x = wild;
            draw(&leaf);
            leaf.curves
                .iter_mut()
                .for_each(|curve| curve.fill(DVec3::splat(wild)));
            draw(&leaf);
            leaf.curves.clear();
            draw(&leaf);
        }
    }
}
