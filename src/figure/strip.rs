//! Small panels in rows, all seen by one camera, to one scale.

use glam::{DVec2, DVec3};

use super::header::HEADER;
use super::page::{Cell, PANEL_TITLE, WIDTH};
use super::space::{Camera, Edge, Room, edges_with, surrounding_box};
use super::ticks::round_step;
use super::veins::Veins;

const COLUMNS: usize = 4;
pub const SIDE: f64 = 22.0;
const GAP: f64 = 12.0;
const LOWEST: f64 = 110.0;
const HIGHEST: f64 = 330.0;
const BOTTOM: f64 = 10.0;

/// Between grid lines at least.
const GRID: f64 = 17.0;

/// Veins are thinner in small panels.
pub const THINNER: f64 = 0.75;

const NAMES: Room = Room {
    left: 14.0,
    right: 14.0,
    below: 14.0,
};

/// Where the panels are, and the box that all of them show.
pub struct Strip {
    pub low: DVec3,
    pub high: DVec3,
    /// Width of a square of the grid, in lengths.
    pub step: f64,
    size: DVec2,
    panels: usize,
}

impl Strip {
    /// Panels that hold all of these shapes.
    pub fn holding<'a>(shapes: impl Iterator<Item = &'a Veins>, panels: usize) -> Self {
        let boxes = shapes.map(|veins| (veins.low, veins.high));
        let all = boxes.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let (low, high) = all.unwrap_or((DVec3::ZERO, DVec3::ZERO));
        let (low, high) = surrounding_box(low, high);
        let width = (WIDTH - 2.0 * SIDE - (COLUMNS - 1) as f64 * GAP) / COLUMNS as f64;
        let mut strip = Strip {
            low,
            high,
            step: 1.0,
            size: DVec2::new(width, height(low, high, width)),
            panels,
        };
        strip.step = round_step(GRID / strip.camera(0).scale());
        strip
    }

    /// Where a panel is.
    pub fn cell(&self, index: usize) -> Cell {
        let row = PANEL_TITLE + self.size.y + GAP;
        Cell {
            corner: DVec2::new(
                SIDE + (index % COLUMNS) as f64 * (self.size.x + GAP),
                HEADER + PANEL_TITLE + (index / COLUMNS) as f64 * row,
            ),
            size: self.size,
        }
    }

    /// How a panel sees the box.
    pub fn camera(&self, index: usize) -> Camera {
        Camera::facing(self.low, self.high, self.cell(index), NAMES)
    }

    /// The edges of the box with the ticks of its grid.
    pub fn edges(&self, camera: &Camera) -> [Edge; 3] {
        edges_with(camera, self.low, self.high, |_| self.step)
    }

    /// Where the page ends.
    pub fn end(&self) -> f64 {
        let rows = self.panels.div_ceil(COLUMNS).max(1);
        let row = PANEL_TITLE + self.size.y + GAP;
        (HEADER + rows as f64 * row + BOTTOM).ceil()
    }
}

/// As high as the box needs in a panel of this width.
fn height(low: DVec3, high: DVec3, width: f64) -> f64 {
    let any = Cell {
        corner: DVec2::ZERO,
        size: DVec2::ONE * (NAMES.left + NAMES.right + 1.0),
    };
    let (first, last) = Camera::facing(low, high, any, NAMES).outline(low, high);
    let needed = (last - first).y / (last - first).x * (width - NAMES.left - NAMES.right);
    (needed + NAMES.below).clamp(LOWEST, HIGHEST)
}
