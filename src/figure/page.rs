//! How the four panels of a leaf share the page.
//!
//! The three flat panels are drawn to one scale and placed as in a technical
//! drawing: the side view under the top view with the same xi axis, the front
//! view beside the side view with the same zeta axis.

use glam::{DVec2, DVec3};

use super::drawing::Drawing;
use super::ticks::round_step;
use super::veins::Veins;
use super::{flat, space};

pub const WIDTH: f64 = 900.0;
pub const LEFT: f64 = 64.0;
pub const RIGHT: f64 = 22.0;
/// Above a panel, for its title.
pub const PANEL_TITLE: f64 = 24.0;
/// Below a panel, for its axis.
pub const PANEL_AXIS: f64 = 48.0;
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

    /// Where the page may go on.
    pub fn end(&self) -> f64 {
        let (start, height) = self.rows[1];
        start + height + PANEL_AXIS + BOTTOM
    }

    /// Draws all four.
    pub fn draw(&self, drawing: &mut Drawing, veins: &Veins) {
        let scale = self.scale;
        let step = round_step(TICK_DISTANCE / scale);
        let [left, right] = self.columns;
        let [top, bottom] = self.rows;
        let cell = |column: (f64, f64), row: (f64, f64)| Cell {
            corner: DVec2::new(column.0, row.0),
            size: DVec2::new(column.1, row.1),
        };
        for (view, cell) in [
            (&flat::TOP, cell(left, top)),
            (&flat::SIDE, cell(left, bottom)),
            (&flat::FRONT, cell(right, bottom)),
        ] {
            drawing.group(view.name, |page| {
                flat::draw(page, view, veins, cell, scale, step)
            });
        }
        // Nothing stands left of the panel in space: it takes half of the gap.
        let shift = 0.5 * COLUMN_GAP;
        let space_cell = cell(
            (right.0 - shift, right.1 + shift),
            (top.0, top.1 + PANEL_AXIS - TICK_SIZE),
        );
        drawing.group("space", |page| space::draw(page, veins, space_cell));
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
            let mut veins = Veins::of(&sample::fan(3, 4));
            veins.low = DVec3::ZERO;
            veins.high = DVec3::from_array(size);
            let Panels {
                columns,
                rows,
                scale,
            } = Panels::below(0.0, &veins);
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
}
