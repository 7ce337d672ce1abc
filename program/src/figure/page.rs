//! Pages: the header, and keys.

use crate::figure::drawing::{
    Anchor, CURVES, Color, Drawing, INK, NOTE, Stroke, rectangle, vein_color,
};
use crate::figure::font::Font;
use crate::figure::layout::{Cell, RIGHT, TEXT_SIZE, TICK_SIZE, TITLE_SIZE, WIDTH};
use crate::figure::markers::{Marker, hold_marker, tip_marker};
use crate::figure::veins::Veins;
use glam::DVec2;
use leafdyn::scenario::Hold;

const TITLE_BASE: f64 = 38.0;
/// Base line of the notes.
pub const NOTE_BASE: f64 = 60.0;

/// A page of the default width with a header whose text begins at `left`.
pub fn new_page(left: f64, title: &str, notes: &[String], leaf: Option<&Veins>) -> Drawing {
    let mut drawing = Drawing::new(WIDTH, title);
    drawing.group("header", |page| header(page, left, title, notes, leaf));
    drawing
}

/// Draws the title, cut off where it does not fit, the notes and, given a leaf, the key
/// to its veins. The text begins at `left`.
pub fn header(page: &mut Drawing, left: f64, title: &str, notes: &[String], leaf: Option<&Veins>) {
    let font = Font::embedded();
    let right = match leaf {
        Some(veins) => key(page, veins, &font) - 20.0,
        None => page.width - RIGHT,
    };
    let title = font.shortened(title, TITLE_SIZE, right - left);
    let base = DVec2::new(left, TITLE_BASE);
    page.label(base, &title, TITLE_SIZE, Anchor::Start, INK);
    // Spaces that SVG does not collapse.
    let notes = notes.join("\u{a0}\u{a0}·\u{a0}\u{a0}");
    let base = DVec2::new(left, NOTE_BASE);
    page.label(base, &notes, TEXT_SIZE, Anchor::Start, NOTE);
}

/// Draws the key at the right end of the header; returns where it starts.
fn key(page: &mut Drawing, veins: &Veins, font: &Font) -> f64 {
    const MIDDLE: f64 = 32.0;
    const BAR: DVec2 = DVec2::new(120.0, 9.0);
    const BAR_STEPS: u32 = 60;
    let mut x = page.width - RIGHT;
    let text_before = |page: &mut Drawing, x: &mut f64, text: &str| {
        page.centered_label(DVec2::new(*x, MIDDLE), text, TEXT_SIZE, Anchor::End, NOTE);
        *x -= font.width(text, TEXT_SIZE) + 6.0;
    };
    if veins.count > 1 {
        text_before(page, &mut x, &veins.count.to_string());
        x -= BAR.x;
        let corner = DVec2::new(x, MIDDLE - 0.5 * BAR.y);
        let part = DVec2::new(BAR.x / f64::from(BAR_STEPS), BAR.y);
        for i in 0..BAR_STEPS {
            let color = vein_color(f64::from(i) / f64::from(BAR_STEPS - 1));
            // Each part extends below the next, so that there are no gaps.
            let overlap = if i + 1 < BAR_STEPS { 0.5 } else { 0.0 };
            let start = corner + f64::from(i) * DVec2::new(part.x, 0.0);
            let size = part + DVec2::new(overlap, 0.0);
            page.shape(rectangle(start, size), color, None);
        }
        x -= 6.0;
        text_before(page, &mut x, "vein 1");
        x -= 16.0;
    }
    let held = |how: Hold| {
        let mut grips = veins.grips.iter();
        let ends = veins.base_held == how || veins.tip_held == Some(how);
        ends || grips.any(|grip| grip.held == how)
    };
    let tips = if veins.tips.len() > 1 { "tips" } else { "tip" };
    let mut entry = |page: &mut Drawing, name: &str, marker: &dyn Fn(&mut Drawing, DVec2)| {
        text_before(page, &mut x, name);
        marker(page, DVec2::new(x - 3.0, MIDDLE));
        x -= 26.0;
    };
    if veins.tip_held.is_none() {
        entry(page, tips, &tip_marker);
    }
    for (how, name) in [(Hold::Clamped, "clamp"), (Hold::Pinned, "pinned")] {
        if held(how) {
            entry(page, name, &|page, at| hold_marker(page, at, how));
        }
    }
    x + 16.0
}

/// Between a sample and its name.
const GAP: f64 = 7.0;
const LINE: f64 = 15.0;
/// Between the entries of a column, and of a row.
const ENTRY_GAP: f64 = 7.0;
const ROW_ENTRY_GAP: f64 = 20.0;
const ROW: f64 = 20.0;
const SAMPLE_HEIGHT: f64 = 12.0;

/// Most of many curves that a key names.
pub const MOST_NAMED: usize = 7;

/// The key of a panel: a column of samples with their names.
pub struct Key {
    /// Left end and middle of the next entry's first line.
    at: DVec2,
}

impl Key {
    const SAMPLE: f64 = 26.0;

    pub fn right_of(panel: Cell) -> Self {
        Key {
            at: DVec2::new(panel.end().x + 14.0, panel.corner.y + 8.0),
        }
    }

    /// Adds a sample with a name and a note, in as many lines as they need.
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
                page.centered_label(at, &line, TICK_SIZE, Anchor::Start, color);
                self.at.y += LINE;
            }
        }
        self.at.y += ENTRY_GAP;
    }

    pub fn line(&mut self, page: &mut Drawing, name: &str, note: &str, stroke: Stroke) {
        self.entry(page, name, note, |page, cell| cell.line(page, stroke));
    }

    /// Adds the first of numbered curves with their names and notes.
    pub fn curves(
        &mut self,
        page: &mut Drawing,
        curves: impl ExactSizeIterator<Item = (String, String)>,
    ) {
        let more = curves.len().saturating_sub(MOST_NAMED);
        for ((name, note), color) in curves.take(MOST_NAMED).zip(CURVES) {
            self.line(page, &name, &note, Stroke::new(color, 1.8));
        }
        if more > 0 {
            self.entry(page, "", &format!("and {more} more"), |_, _| ());
        }
    }

    /// Adds a line with marked points.
    pub fn marked_line(&mut self, page: &mut Drawing, name: &str, note: &str, color: Color) {
        self.entry(page, name, note, |page, cell| {
            cell.line(page, Stroke::new(color, 1.6));
            Marker::Dot.draw(page, cell.middle(), color);
        });
    }

    pub fn marker(
        &mut self,
        page: &mut Drawing,
        name: &str,
        note: &str,
        marker: Marker,
        color: Color,
    ) {
        self.entry(page, name, note, |page, cell| {
            marker.draw(page, cell.middle(), color)
        });
    }
}

/// A key above the panels: rows of samples with their names.
pub struct KeyRows {
    left: f64,
    at: DVec2,
    sample: f64,
}

impl KeyRows {
    /// Rows that begin at `left`, the first with its base line at `base`, with samples of
    /// this width.
    pub fn at(left: f64, base: f64, sample: f64) -> Self {
        KeyRows {
            left,
            at: DVec2::new(left, base - 0.36 * TEXT_SIZE),
            sample,
        }
    }

    pub fn entry(
        &mut self,
        page: &mut Drawing,
        name: &str,
        sample: impl FnOnce(&mut Drawing, Cell),
    ) {
        let width = self.sample + GAP + Font::embedded().width(name, TEXT_SIZE);
        if self.at.x > self.left && self.at.x + width > page.width - RIGHT {
            self.at = DVec2::new(self.left, self.at.y + ROW);
        }
        sample(page, sample_cell(self.at, self.sample));
        let text = self.at + DVec2::new(self.sample + GAP, 0.0);
        page.centered_label(text, name, TEXT_SIZE, Anchor::Start, INK);
        self.at.x += width + ROW_ENTRY_GAP;
    }

    pub fn end(&self) -> f64 {
        self.at.y + 18.0
    }
}

fn sample_cell(at: DVec2, width: f64) -> Cell {
    Cell::new(
        at - DVec2::new(0.0, 0.5 * SAMPLE_HEIGHT),
        DVec2::new(width, SAMPLE_HEIGHT),
    )
}
