//! The drawing painted, twice as fine as a screen of 96 dots per inch.

use std::io::{self, Write};

use glam::DVec2;
use tiny_skia::{
    FillRule, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Stroke as Pen, Transform,
};
use ttf_parser::OutlineBuilder;

use super::Pictured;
use super::colors::Color;
use super::drawing::{Anchor, Drawing, Label, Mark, Path, Step, Stroke};
use super::font::Font;
use crate::report::Format;

/// Pixels per unit of the page.
const SCALE: f64 = 2.0;

/// 192 dots per inch, as the file says them: dots per metre.
const DOTS_PER_METRE: u32 = 7559;

/// The figure as PNG: `figure.png` of a leaf, `check.png` of a check, `map.png` of a
/// map.
pub struct FigurePng;

impl<R: Pictured> Format<R> for FigurePng {
    fn file_name(&self) -> &'static str {
        R::PNG
    }

    fn write(&self, result: &R, out: &mut dyn Write) -> io::Result<()> {
        write_drawing(&result.draw(), out)
    }
}

/// Writes the whole file.
pub fn write_drawing(drawing: &Drawing, out: &mut dyn Write) -> io::Result<()> {
    encode(&paint(drawing), out)
}

fn paint(drawing: &Drawing) -> Pixmap {
    let pixels = |length: f64| (length * SCALE).ceil() as u32;
    let mut canvas = Pixmap::new(pixels(drawing.width), pixels(drawing.height))
        .expect("a page has a width and a height");
    canvas.fill(tiny_skia::Color::WHITE);
    let font = Font::embedded();
    for mark in &drawing.marks {
        match mark {
            Mark::Group(_) | Mark::EndGroup => (),
            Mark::Shape { path, fill, stroke } => {
                // A path of a single point has nothing to paint.
                let Some(path) = outline(path) else { continue };
                if let Some(fill) = fill {
                    fill_path(&mut canvas, &path, *fill, page_to_pixels());
                }
                if let Some(stroke) = stroke {
                    stroke_path(&mut canvas, &path, stroke);
                }
            }
            Mark::Label(label) => paint_label(&mut canvas, label, &font),
        }
    }
    canvas
}

fn page_to_pixels() -> Transform {
    Transform::from_scale(SCALE as f32, SCALE as f32)
}

fn outline(path: &Path) -> Option<tiny_skia::Path> {
    let xy = |point: DVec2| (point.x as f32, point.y as f32);
    let mut builder = PathBuilder::with_capacity(path.len(), 3 * path.len());
    for step in path {
        match *step {
            Step::Move(to) => builder.move_to(xy(to).0, xy(to).1),
            Step::Line(to) => builder.line_to(xy(to).0, xy(to).1),
            Step::Cubic(a, b, to) => {
                let ((ax, ay), (bx, by), (x, y)) = (xy(a), xy(b), xy(to));
                builder.cubic_to(ax, ay, bx, by, x, y);
            }
            Step::Close => builder.close(),
        }
    }
    builder.finish()
}

fn ink(Color(red, green, blue): Color, opacity: f64) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(red, green, blue, (255.0 * opacity).round() as u8);
    paint
}

fn fill_path(canvas: &mut Pixmap, path: &tiny_skia::Path, color: Color, transform: Transform) {
    canvas.fill_path(path, &ink(color, 1.0), FillRule::Winding, transform, None);
}

fn stroke_path(canvas: &mut Pixmap, path: &tiny_skia::Path, stroke: &Stroke) {
    let pen = Pen {
        width: stroke.width as f32,
        line_cap: LineCap::Round,
        line_join: LineJoin::Round,
        ..Pen::default()
    };
    canvas.stroke_path(
        path,
        &ink(stroke.color, stroke.opacity),
        &pen,
        page_to_pixels(),
        None,
    );
}

fn paint_label(canvas: &mut Pixmap, label: &Label, font: &Font) {
    let mut glyphs = Glyphs(PathBuilder::new());
    font.outline(&label.text, label.size, &mut glyphs);
    let Some(path) = glyphs.0.finish() else {
        return;
    };
    let before = match label.anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => 0.5,
        Anchor::End => 1.0,
    } * font.width(&label.text, label.size);
    let turn = if label.upright { -90.0 } else { 0.0 };
    let place = page_to_pixels()
        .pre_translate(label.at.x as f32, label.at.y as f32)
        .pre_rotate(turn)
        .pre_translate(-before as f32, 0.0)
        .pre_scale(1.0, -1.0);
    fill_path(canvas, &path, label.color, place);
}

/// Outlines of glyphs on the way into a path.
struct Glyphs(PathBuilder);

impl OutlineBuilder for Glyphs {
    fn move_to(&mut self, x: f32, y: f32) {
        self.0.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.0.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.0.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.0.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.0.close();
    }
}

fn encode(canvas: &Pixmap, out: &mut dyn Write) -> io::Result<()> {
    // The page is opaque: its transparency need not be stored.
    let mut rgb = vec![0; 3 * canvas.pixels().len()];
    for (to, from) in rgb.chunks_exact_mut(3).zip(canvas.data().chunks_exact(4)) {
        to.copy_from_slice(&from[..3]);
    }
    let mut encoder = png::Encoder::new(out, canvas.width(), canvas.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    // Lines and text on white: a simple filter is four times as fast as
    // choosing one row by row, for a file half as large again.
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Up);
    encoder.set_pixel_dims(Some(png::PixelDimensions {
        xppu: DOTS_PER_METRE,
        yppu: DOTS_PER_METRE,
        unit: png::Unit::Meter,
    }));
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&rgb)?;
    writer.finish()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn the_picture_is_wide_enough_to_print() {
        let mut bytes = Vec::new();
        FigurePng.write(&sample::fan(21, 32), &mut bytes).unwrap();
        let reader = png::Decoder::new(io::Cursor::new(&bytes))
            .read_info()
            .unwrap();
        assert_eq!(reader.info().width, 1800);
        assert_eq!(reader.info().color_type, png::ColorType::Rgb);
    }
}
