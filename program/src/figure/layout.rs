//! Page layout: sizes, and cells of panels with their titles.

use crate::figure::drawing::{Anchor, Color, Drawing, INK, NOTE, Stroke};
use glam::DVec2;

pub const WIDTH: f64 = 900.0;
pub const LEFT: f64 = 64.0;
pub const RIGHT: f64 = 22.0;
/// Where the title and the notes end and the panels may begin.
pub const HEADER: f64 = 74.0;
/// Room above a panel, for its title.
pub const PANEL_TITLE: f64 = 24.0;
/// Room below a panel, for its axis.
pub const PANEL_AXIS: f64 = 48.0;
pub const TITLE_SIZE: f64 = 19.0;
pub const TEXT_SIZE: f64 = 12.0;
pub const TICK_SIZE: f64 = 10.5;

#[derive(Clone, Copy)]
pub struct Cell {
    pub corner: DVec2,
    pub size: DVec2,
}

impl Cell {
    pub fn new(corner: DVec2, size: DVec2) -> Self {
        Cell { corner, size }
    }

    /// A panel across the page that leaves this width on the right for a key.
    pub fn left_of_key(top: f64, height: f64, key: f64) -> Self {
        Cell::new(
            DVec2::new(LEFT, top),
            DVec2::new(WIDTH - LEFT - RIGHT - key, height),
        )
    }

    pub fn end(&self) -> DVec2 {
        self.corner + self.size
    }

    /// Of the four points at this inset from its corners, the one farthest from all points
    /// `taken`.
    pub fn free_corner(&self, inset: DVec2, taken: impl Iterator<Item = DVec2>) -> DVec2 {
        let (low, high) = (self.corner + inset, self.end() - inset);
        let places = [low.with_x(high.x), low, high, high.with_x(low.x)];
        let mut free = [f64::INFINITY; 4];
        for point in taken {
            for (free, place) in free.iter_mut().zip(places) {
                *free = free.min(place.distance_squared(point));
            }
        }
        // The first of equally free ones, up to rounding.
        let freer = |k: usize, best: usize| free[k] > (1.0 + 1e-9) * free[best];
        places[(0..4).fold(0, |best, k| if freer(k, best) { k } else { best })]
    }

    pub fn middle(&self) -> DVec2 {
        self.corner + 0.5 * self.size
    }

    /// The ends of the line from left to right through its middle.
    pub fn midline(&self) -> [DVec2; 2] {
        let half = DVec2::new(0.5 * self.size.x, 0.0);
        [self.middle() - half, self.middle() + half]
    }

    pub fn line(&self, page: &mut Drawing, stroke: Stroke) {
        let [from, to] = self.midline();
        page.line(from, to, stroke);
    }
}

/// Draws a panel's title above its frame.
pub fn title(page: &mut Drawing, corner: DVec2, letter: &str, text: &str) {
    title_in(page, corner, letter, text, NOTE);
}

/// Draws a panel's title above its frame, with the text in this colour.
pub fn title_in(page: &mut Drawing, corner: DVec2, letter: &str, text: &str, color: Color) {
    let base = corner - DVec2::new(0.0, 8.0);
    page.label(base, letter, TEXT_SIZE, Anchor::Start, INK);
    let base = base + DVec2::new(24.0, 0.0);
    page.label(base, text, TEXT_SIZE, Anchor::Start, color);
}

/// Letters of panels: `(a)`, `(b)`, ...
pub fn letters() -> impl Iterator<Item = String> + Clone {
    (b'a'..=b'z').map(|letter| format!("({})", char::from(letter)))
}
