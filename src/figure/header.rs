//! Above the panels: a title, a line of notes, and the key to colours and markers.

use glam::DVec2;

use super::colors::{INK, NOTE, vein_color};
use super::drawing::{Anchor, Drawing, rectangle};
use super::font::Font;
use super::markers::{clamp_marker, tip_marker};
use super::page::{RIGHT, TEXT_SIZE, TITLE_SIZE, WIDTH};
use super::veins::Veins;

const TITLE_BASE: f64 = 38.0;
/// Base line of the notes.
pub const NOTE_BASE: f64 = 60.0;

/// A page as wide as usual whose header says this; its text begins at `left`.
pub fn page(left: f64, title: &str, notes: &[String], leaf: Option<&Veins>) -> Drawing {
    let mut drawing = Drawing::new(WIDTH, title);
    drawing.group("header", |page| header(page, left, title, notes, leaf));
    drawing
}

/// Draws the title, as much of it as fits, the notes and, of a leaf, the key to
/// its veins. The text begins at `left`.
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
        page.beside(DVec2::new(*x, MIDDLE), text, TEXT_SIZE, Anchor::End, NOTE);
        *x -= font.width(text, TEXT_SIZE) + 6.0;
    };
    if veins.count > 1 {
        text_before(page, &mut x, &veins.count.to_string());
        x -= BAR.x;
        let corner = DVec2::new(x, MIDDLE - 0.5 * BAR.y);
        let part = DVec2::new(BAR.x / f64::from(BAR_STEPS), BAR.y);
        for i in 0..BAR_STEPS {
            let color = vein_color(f64::from(i) / f64::from(BAR_STEPS - 1));
            // Each part reaches under the next: no gaps between them.
            let overlap = if i + 1 < BAR_STEPS { 0.5 } else { 0.0 };
            let start = corner + f64::from(i) * DVec2::new(part.x, 0.0);
            let size = part + DVec2::new(overlap, 0.0);
            page.shape(rectangle(start, size), color, None);
        }
        x -= 6.0;
        text_before(page, &mut x, "vein 1");
        x -= 16.0;
    }
    let tips = if veins.tips.len() > 1 { "tips" } else { "tip" };
    text_before(page, &mut x, tips);
    tip_marker(page, DVec2::new(x - 3.0, MIDDLE));
    x -= 26.0;
    text_before(page, &mut x, "clamp");
    clamp_marker(page, DVec2::new(x - 3.0, MIDDLE));
    x - 10.0
}
