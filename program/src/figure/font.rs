//! The embedded font: how wide a text is, and its outlines for the PNG.

use glam::DVec2;
use ttf_parser::{Face, GlyphId, OutlineBuilder};

use super::drawing::{Path, Step};

static FONT: &[u8] = include_bytes!("../../assets/DejaVuSans-subset.ttf");

pub struct Font {
    face: Face<'static>,
}

impl Font {
    pub fn embedded() -> Self {
        Font {
            face: Face::parse(FONT, 0).expect("the embedded font is whole"),
        }
    }

    pub fn width(&self, text: &str, size: f64) -> f64 {
        text.chars()
            .map(|c| self.advance(self.glyph(c)))
            .sum::<f64>()
            * self.scale(size)
    }

    /// The text in lines no wider than `width`, unless a single word is.
    pub fn wrapped(&self, text: &str, size: f64, width: f64) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for word in text.split_whitespace() {
            if let Some(line) = lines.last_mut() {
                let longer = format!("{line} {word}");
                if self.width(&longer, size) <= width {
                    *line = longer;
                    continue;
                }
            }
            lines.push(word.into());
        }
        lines
    }

    /// The text, cut off with an ellipsis where it does not fit.
    pub fn shortened(&self, text: &str, size: f64, width: f64) -> String {
        let mut shown: String = text.chars().filter(|c| !c.is_control()).collect();
        if self.width(&shown, size) <= width {
            return shown;
        }
        while self.width(&shown, size) + size > width && shown.pop().is_some() {}
        shown + "…"
    }

    /// The outlines of a text that starts at the origin of its base line.
    pub fn outline(&self, text: &str, size: f64) -> Path {
        let mut outline = Outline {
            scale: self.scale(size),
            start: 0.0,
            at: DVec2::ZERO,
            path: Vec::new(),
        };
        for glyph in text.chars().map(|c| self.glyph(c)) {
            // Blanks have no outline.
            let _ = self.face.outline_glyph(glyph, &mut outline);
            outline.start += self.advance(glyph) * outline.scale;
        }
        outline.path
    }

    fn scale(&self, size: f64) -> f64 {
        size / f64::from(self.face.units_per_em())
    }

    /// Characters that the font lacks appear as its empty box.
    fn glyph(&self, c: char) -> GlyphId {
        self.face.glyph_index(c).unwrap_or(GlyphId(0))
    }

    fn advance(&self, glyph: GlyphId) -> f64 {
        f64::from(self.face.glyph_hor_advance(glyph).unwrap_or(0))
    }
}

/// Collects the outlines of glyphs: scaled, with y down as on the page, and moved along
/// the base line.
struct Outline {
    scale: f64,
    start: f64,
    at: DVec2,
    path: Path,
}

impl Outline {
    fn place(&mut self, x: f32, y: f32) -> DVec2 {
        let point = self.scale * DVec2::new(f64::from(x), -f64::from(y));
        self.at = point + DVec2::new(self.start, 0.0);
        self.at
    }
}

impl OutlineBuilder for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        let to = self.place(x, y);
        self.path.push(Step::Move(to));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let to = self.place(x, y);
        self.path.push(Step::Line(to));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let from = self.at;
        let control = self.place(x1, y1);
        let to = self.place(x, y);
        // The equivalent cubic curve.
        let (a, b) = (from.lerp(control, 2.0 / 3.0), to.lerp(control, 2.0 / 3.0));
        self.path.push(Step::Cubic(a, b, to));
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let (a, b) = (self.place(x1, y1), self.place(x2, y2));
        let to = self.place(x, y);
        self.path.push(Step::Cubic(a, b, to));
    }

    fn close(&mut self) {
        self.path.push(Step::Close);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_every_character_of_the_figures() {
        let font = Font::embedded();
        for c in "ξηζσω=xyz/L(abcd)0123456789.−×⁻⁰¹²³⁴⁵⁶⁷⁸⁹·≤∞…".chars()
        {
            assert!(font.face.glyph_index(c).is_some(), "{c}");
        }
    }

    #[test]
    fn lines_are_filled_up_to_the_width() {
        let font = Font::embedded();
        let width = font.width("use more", 12.0) + 0.1;
        let lines = font.wrapped("use more intervals or more", 12.0, width);
        assert_eq!(lines, ["use more", "intervals", "or more"]);
        assert!(font.wrapped("", 12.0, width).is_empty());
    }

    #[test]
    fn long_names_are_cut() {
        let font = Font::embedded();
        assert_eq!(font.shortened("explicit", 10.5, 200.0), "explicit");
        let long = font.shortened(&"explicit ".repeat(20), 10.5, 200.0);
        assert!(long.ends_with('…') && font.width(&long, 10.5) <= 200.0);
    }
}
