//! How pages are laid out.

use glam::DVec2;

use super::colors::{INK, NOTE};
use super::drawing::{Anchor, Drawing};

pub const WIDTH: f64 = 900.0;
pub const LEFT: f64 = 64.0;
pub const RIGHT: f64 = 22.0;
/// Where the title and the notes end and the panels may begin.
pub const HEADER: f64 = 74.0;
/// Above a panel, for its title.
pub const PANEL_TITLE: f64 = 24.0;
/// Below a panel, for its axis.
pub const PANEL_AXIS: f64 = 48.0;

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

impl Cell {
    /// As wide as the page but for its margins and room for a key.
    pub fn beside_key(top: f64, height: f64, key: f64) -> Self {
        Cell {
            corner: DVec2::new(LEFT, top),
            size: DVec2::new(WIDTH - LEFT - RIGHT - key, height),
        }
    }

    /// The corner opposite to `corner`.
    pub fn end(&self) -> DVec2 {
        self.corner + self.size
    }

    pub fn middle(&self) -> DVec2 {
        self.corner + 0.5 * self.size
    }

    /// The line from left to right through its middle.
    pub fn midline(&self) -> [DVec2; 2] {
        let half = DVec2::new(0.5 * self.size.x, 0.0);
        [self.middle() - half, self.middle() + half]
    }
}

/// A panel's title, above its frame.
pub fn title(page: &mut Drawing, corner: DVec2, letter: &str, text: &str) {
    let base = corner - DVec2::new(0.0, 8.0);
    page.label(base, letter, TEXT_SIZE, Anchor::Start, INK);
    let base = base + DVec2::new(24.0, 0.0);
    page.label(base, text, TEXT_SIZE, Anchor::Start, NOTE);
}
