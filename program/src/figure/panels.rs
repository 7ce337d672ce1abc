//! The four panels of a leaf: along each axis, and in space.
//!
//! The three flat panels have one scale and are placed as in a technical drawing:
//! the side view below the top view with the same xi axis, the front view to the
//! right of the side view with the same zeta axis.

use crate::figure::axes::Axes;
use crate::figure::axis::Axis;
use crate::figure::drawing::{Drawing, Stroke};
use crate::figure::layout::{Cell, LEFT, PANEL_AXIS, PANEL_TITLE, RIGHT, TICK_SIZE, WIDTH, title};
use crate::figure::markers::leaf_markers;
use crate::figure::setting::Setting;
use crate::figure::space::{Camera, Margins, OBLIQUE, Scene, surrounding_box};
use crate::figure::veins::{Vein, Veins};
use glam::{DVec2, DVec3};

const BOTTOM: f64 = 4.0;
/// Between the columns, for the right one's axis.
const COLUMN_GAP: f64 = 74.0;
const COLUMNS: f64 = WIDTH - LEFT - RIGHT - COLUMN_GAP;
/// Panels are at least this large, however flat the leaf is.
const NARROWEST_COLUMN: f64 = 340.0;
const LOWEST_TOP: f64 = 270.0;
const LOWEST_BOTTOM: f64 = 130.0;
/// Both rows together are at most this high, however tall the leaf is.
const HIGHEST_ROWS: f64 = 800.0;
/// Padding around the leaf, as a fraction of its largest extent.
const PADDING: f64 = 0.06;
/// Least distance between grid lines.
const TICK_DISTANCE: f64 = 36.0;

/// The flat panels: names of their groups, letters, titles, and the two axes.
const FLAT: [(&str, &str, &str, [usize; 2]); 3] = [
    ("top", "(a)", "from above", [0, 1]),
    ("side", "(b)", "from the side", [0, 2]),
    ("front", "(c)", "from the front", [1, 2]),
];

/// Of the panel in space.
const MARGINS: Margins = Margins {
    left: 56.0,
    right: 22.0,
    below: 36.0,
};

/// Draws a panel of two axes with `scale` pixels per length and this point in its middle; returns how
/// it shows points.
pub fn flat(
    page: &mut Drawing,
    middle: DVec3,
    setting: &Setting,
    cell: Cell,
    scale: f64,
    [across, up]: [usize; 2],
) -> Camera {
    let camera = Camera::new(DVec3::AXES[across], DVec3::AXES[up]);
    let camera = camera.placed(scale, middle, cell.middle());
    let shown = setting.scale();
    let axis = |which: usize, pixels: f64| {
        let half = 0.5 * pixels / scale;
        let (low, high) = (middle[which] - half, middle[which] + half);
        Axis {
            tick_spacing: Some(TICK_DISTANCE),
            ..Axis::linear(&setting.axis(which), shown * low, shown * high)
        }
    };
    let axes = Axes {
        cell,
        across: axis(across, cell.size.x),
        up: axis(up, cell.size.y),
    };
    axes.draw(page);
    camera
}

/// Draws the projection of the leaf onto two axes, centred.
fn draw_flat(
    page: &mut Drawing,
    veins: &Veins,
    setting: &Setting,
    cell: Cell,
    scale: f64,
    axes: [usize; 2],
) {
    let middle = 0.5 * (veins.low + veins.high);
    let camera = flat(page, middle, setting, cell, scale, axes);
    let place = |point: DVec3| camera.place(point);
    // Veins farther from the viewer first.
    let nearness = |vein: &Vein| {
        let ends = vein.pieces.iter().map(|piece| camera.toward.dot(piece[3]));
        ends.sum::<f64>() / vein.pieces.len().max(1) as f64
    };
    let mut order: Vec<&Vein> = veins.veins.iter().collect();
    order.sort_by(|a, b| nearness(a).total_cmp(&nearness(b)));
    for vein in order {
        let stroke = Stroke::new(vein.color, veins.line_width());
        page.stroke(vein.path(place), stroke);
    }
    leaf_markers(page, veins, place);
    let arrows = setting.arrows(true, 0.0);
    camera.draw_arrows(page, &arrows, cell, veins.points().map(place));
}

/// Starts and lengths of columns and rows, and the pixels per length of the
/// flat panels.
pub struct Panels {
    columns: [(f64, f64); 2],
    rows: [(f64, f64); 2],
    scale: f64,
}

impl Panels {
    /// The panels of these veins, placed below `start`.
    pub fn below(start: f64, veins: &Veins) -> Self {
        let DVec3 { x, y, z } =
            veins.high - veins.low + DVec3::splat(2.0 * PADDING * veins.extent());
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
        let top = start + PANEL_TITLE;
        let bottom = top + heights[0] + PANEL_AXIS + PANEL_TITLE;
        Panels {
            columns: [
                (LEFT, widths[0]),
                (LEFT + widths[0] + COLUMN_GAP, widths[1]),
            ],
            rows: [(top, heights[0]), (bottom, heights[1])],
            scale,
        }
    }

    pub fn end(&self) -> f64 {
        self.rows[1].0 + self.rows[1].1 + PANEL_AXIS + BOTTOM
    }

    pub fn draw(&self, drawing: &mut Drawing, veins: &Veins, setting: &Setting) {
        let [left, right] = self.columns;
        let [top, bottom] = self.rows;
        let cell = |column: (f64, f64), row: (f64, f64)| {
            Cell::new(DVec2::new(column.0, row.0), DVec2::new(column.1, row.1))
        };
        let cells = [(left, top), (left, bottom), (right, bottom)];
        for ((name, letter, text, axes), (column, row)) in FLAT.into_iter().zip(cells) {
            let cell = cell(column, row);
            drawing.group(name, |page| {
                title(page, cell.corner, letter, text);
                draw_flat(page, veins, setting, cell, self.scale, axes);
            });
        }
        // The panel in space has no axis on its left: it takes half of the gap.
        let shift = 0.5 * COLUMN_GAP;
        let cell = cell(
            (right.0 - shift, right.1 + shift),
            (top.0, top.1 + PANEL_AXIS - TICK_SIZE),
        );
        drawing.group("space", |page| {
            let bounds = surrounding_box(veins.low, veins.high);
            let scene = Scene::new(bounds, setting, OBLIQUE, cell, MARGINS, None);
            title(page, cell.corner, "(d)", "in space");
            scene.draw_box(page);
            scene.draw_axes(page, 38.0);
            scene.draw_arrows(page, true, 0.0);
            scene.draw_leaf(page, veins, veins.line_width());
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn every_extent_fits_its_panel() {
        for size in [
            [1.0, 1.0, 0.2],
            [1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.1, 2.0, 0.0],
            [0.0; 3],
        ] {
            let mut veins = Veins::of(&sample::fan(3, 4), &sample::scenario("fan", 3));
            veins.low = DVec3::ZERO;
            veins.high = DVec3::from_array(size);
            let found = Panels::below(0.0, &veins);
            let [left, right] = found.columns.map(|column| column.1 + 1e-9);
            let [top, bottom] = found.rows.map(|row| row.1 + 1e-9);
            let [x, y, z] = size.map(|extent| found.scale * extent);
            let fits = left >= x && right >= y && top >= y && bottom >= z;
            assert!(fits, "{size:?}");
            assert!((left + right - COLUMNS).abs() < 1e-8, "{size:?}");
            assert!(top + bottom <= HIGHEST_ROWS + 1e-8, "{size:?}");
        }
    }
}
