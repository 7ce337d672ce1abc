//! Above the panels: a title, a line of notes, and the key to colours and markers.

use glam::DVec2;

use super::colors::{INK, NOTE, vein_color};
use super::drawing::{Anchor, Drawing, HALF_CAPITAL, rectangle};
use super::font::Font;
use super::markers::{clamp_marker, tip_marker};
use super::page::{LEFT, RIGHT, TEXT_SIZE, TITLE_SIZE, WIDTH};
use super::veins::Veins;

/// Where the notes end and the panels may begin.
pub const HEADER: f64 = 74.0;

/// Base line of the notes.
pub const NOTE_BASE: f64 = 60.0;

/// Draws the title, as much of it as fits, the notes, and the key.
pub fn draw(page: &mut Drawing, title: &str, notes: &[String], veins: &Veins) {
    draw_from(LEFT, page, title, notes, veins);
}

/// The same, with the text beginning at `left`.
pub fn draw_from(left: f64, page: &mut Drawing, title: &str, notes: &[String], veins: &Veins) {
    let font = Font::embedded();
    let key_start = key(page, veins, &font);
    text(page, title, notes, (left, key_start - 20.0), &font);
}

/// Draws the title, as much of it as fits, and the notes.
pub fn draw_without_key(page: &mut Drawing, title: &str, notes: &[String]) {
    text(page, title, notes, (LEFT, WIDTH - RIGHT), &Font::embedded());
}

fn text(page: &mut Drawing, title: &str, notes: &[String], (left, right): (f64, f64), font: &Font) {
    const TITLE_BASE: f64 = 38.0;
    let shown = shortened(title, right - left, font);
    let base = DVec2::new(left, TITLE_BASE);
    page.label(base, &shown, TITLE_SIZE, Anchor::Start, INK);
    // Spaces that SVG does not collapse.
    let notes = notes.join("\u{a0}\u{a0}·\u{a0}\u{a0}");
    let base = DVec2::new(left, NOTE_BASE);
    page.label(base, &notes, TEXT_SIZE, Anchor::Start, NOTE);
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
fn key(page: &mut Drawing, veins: &Veins, font: &Font) -> f64 {
    const MIDDLE: f64 = 32.0;
    const BAR: DVec2 = DVec2::new(120.0, 9.0);
    const BAR_STEPS: u32 = 60;
    let base = MIDDLE + HALF_CAPITAL * TEXT_SIZE;
    let mut x = WIDTH - RIGHT;
    let text_before = |page: &mut Drawing, x: &mut f64, text: &str| {
        page.label(DVec2::new(*x, base), text, TEXT_SIZE, Anchor::End, NOTE);
        *x -= font.width(text, TEXT_SIZE) + 6.0;
    };
    let count = veins.count;
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
        if veins.tips.len() > 1 { "tips" } else { "tip" },
    );
    tip_marker(page, DVec2::new(x - 3.0, MIDDLE));
    x -= 26.0;
    text_before(page, &mut x, "clamp");
    clamp_marker(page, DVec2::new(x - 3.0, MIDDLE));
    x - 10.0
}
