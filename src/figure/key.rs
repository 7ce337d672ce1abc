//! The key to what is drawn.

use glam::DVec2;

use super::colors::{Color, INK, NOTE};
use super::drawing::{Anchor, Drawing, Stroke};
use super::font::Font;
use super::markers::Marker;
use super::page::{Cell, LEFT, RIGHT, TEXT_SIZE, TICK_SIZE};

/// Between a sample and its name.
const GAP: f64 = 7.0;
const LINE: f64 = 15.0;
/// Between entries, one below the other or one beside the other.
const BETWEEN: f64 = 7.0;
const BESIDE: f64 = 20.0;
const ROW: f64 = 20.0;
const SAMPLE_HEIGHT: f64 = 12.0;

/// Samples with their names, one below the other beside a panel.
pub struct Key {
    /// Left end and middle of the next entry's first line.
    at: DVec2,
}

impl Key {
    const SAMPLE: f64 = 26.0;

    pub fn beside(panel: Cell) -> Self {
        Key {
            at: DVec2::new(panel.end().x + 14.0, panel.corner.y + 8.0),
        }
    }

    /// A sample, what it is, and what else there is to say, in as many lines as
    /// these need.
    pub fn entry(
        &mut self,
        page: &mut Drawing,
        name: &str,
        note: &str,
        sample: impl FnOnce(&mut Drawing, Cell),
    ) {
        let font = Font::embedded();
        sample(page, sample_cell(self.at, Self::SAMPLE));
        let left = self.at.x + Self::SAMPLE + GAP;
        let room = page.width - 6.0 - left;
        for (text, color) in [(name, INK), (note, NOTE)] {
            for line in font.wrapped(text, TICK_SIZE, room) {
                let line = font.shortened(&line, TICK_SIZE, room);
                let at = DVec2::new(left, self.at.y);
                page.beside(at, &line, TICK_SIZE, Anchor::Start, color);
                self.at.y += LINE;
            }
        }
        self.at.y += BETWEEN;
    }

    /// The same of a line.
    pub fn line(&mut self, page: &mut Drawing, name: &str, note: &str, stroke: Stroke) {
        self.entry(page, name, note, |page, cell| {
            let [from, to] = cell.midline();
            page.line(from, to, stroke);
        });
    }

    /// The same of marked points.
    pub fn marker(
        &mut self,
        page: &mut Drawing,
        name: &str,
        note: &str,
        marker: Marker,
        color: Color,
    ) {
        self.entry(page, name, note, |page, cell| {
            marker.draw(page, cell.middle(), color);
        });
    }
}

/// Samples with their names, one after the other in rows above the panels.
pub struct KeyRows {
    at: DVec2,
    sample: f64,
}

impl KeyRows {
    /// Rows whose first has its base line at `base`, with samples of this width.
    pub fn at(base: f64, sample: f64) -> Self {
        KeyRows {
            at: DVec2::new(LEFT, base - 0.36 * TEXT_SIZE),
            sample,
        }
    }

    /// A sample and what it is.
    pub fn entry(
        &mut self,
        page: &mut Drawing,
        name: &str,
        sample: impl FnOnce(&mut Drawing, Cell),
    ) {
        let width = self.sample + GAP + Font::embedded().width(name, TEXT_SIZE);
        if self.at.x > LEFT && self.at.x + width > page.width - RIGHT {
            self.at = DVec2::new(LEFT, self.at.y + ROW);
        }
        sample(page, sample_cell(self.at, self.sample));
        let text = self.at + DVec2::new(self.sample + GAP, 0.0);
        page.beside(text, name, TEXT_SIZE, Anchor::Start, INK);
        self.at.x += width + BESIDE;
    }

    /// Where the last row ends.
    pub fn end(&self) -> f64 {
        self.at.y + 18.0
    }
}

fn sample_cell(at: DVec2, width: f64) -> Cell {
    Cell {
        corner: at - DVec2::new(0.0, 0.5 * SAMPLE_HEIGHT),
        size: DVec2::new(width, SAMPLE_HEIGHT),
    }
}
