//! The embedded font: how wide a text is, and its outlines for the PNG.

use ttf_parser::{Face, GlyphId, OutlineBuilder};

static FONT: &[u8] = include_bytes!("../../assets/DejaVuSans-subset.ttf");

pub struct Font {
    face: Face<'static>,
}

impl Font {
    /// The embedded font, which a test reads as well.
    pub fn embedded() -> Self {
        Font {
            face: Face::parse(FONT, 0).expect("the embedded font is whole"),
        }
    }

    /// Width of a text of the given size.
    pub fn width(&self, text: &str, size: f64) -> f64 {
        text.chars()
            .map(|c| self.advance(self.glyph(c)))
            .sum::<f64>()
            * self.scale(size)
    }

    /// The text in lines that are no wider than `width`, if no word is.
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

    /// Outlines a text that starts at the origin of its base line, y up, in
    /// units of the page.
    pub fn outline(&self, text: &str, size: f64, into: &mut dyn OutlineBuilder) {
        let scale = self.scale(size);
        let mut start = 0.0;
        for glyph in text.chars().map(|c| self.glyph(c)) {
            let mut placed = Placed {
                scale: scale as f32,
                start: start as f32,
                into: &mut *into,
            };
            // Blanks have no outline.
            let _ = self.face.outline_glyph(glyph, &mut placed);
            start += self.advance(glyph) * scale;
        }
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

/// Scales a glyph and moves it along the base line.
struct Placed<'a> {
    scale: f32,
    start: f32,
    into: &'a mut dyn OutlineBuilder,
}

impl Placed<'_> {
    fn place(&self, x: f32, y: f32) -> (f32, f32) {
        (self.start + self.scale * x, self.scale * y)
    }
}

impl OutlineBuilder for Placed<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.into.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.into.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let (x1, y1) = self.place(x1, y1);
        let (x, y) = self.place(x, y);
        self.into.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let (x1, y1) = self.place(x1, y1);
        let (x2, y2) = self.place(x2, y2);
        let (x, y) = self.place(x, y);
        self.into.curve_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.into.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sign_of_the_figure_is_in_the_font() {
        let font = Font::embedded();
        for c in "ξηζσ=xyz/L(abcd)0123456789.−×⁻⁰¹²³⁴⁵⁶⁷⁸⁹·≤∞…".chars()
        {
            assert!(font.face.glyph_index(c).is_some(), "{c}");
        }
    }

    #[test]
    fn lines_are_as_long_as_they_may_be() {
        let font = Font::embedded();
        let width = font.width("use more", 12.0) + 0.1;
        let lines = font.wrapped("use more intervals or more", 12.0, width);
        assert_eq!(lines, ["use more", "intervals", "or more"]);
        assert!(font.wrapped("", 12.0, width).is_empty());
    }
}
