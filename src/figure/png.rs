//! The drawing painted, twice as fine as a screen of 96 dots per inch.

use std::io::{self, Write};

use tiny_skia::{
    FillRule, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Stroke as Pen, StrokeDash, Transform,
};

use super::drawing::{Anchor, Color, DASHES, Drawing, Label, Mark, Path, Step, Stroke};
use super::font::Font;

const SCALE: f64 = 2.0;
/// Bytes of a chunk of the file.
const CHUNK: usize = 1 << 16;
/// 192 dots per inch, as the file says them: dots per metre.
const DOTS_PER_METRE: u32 = 7559;

pub fn write(drawing: &Drawing, out: &mut dyn Write) -> io::Result<()> {
    encode(&paint(drawing), out)
}

/// The drawing as pixels.
pub fn paint(drawing: &Drawing) -> Pixmap {
    let pixels = |length: f64| (length * SCALE).ceil() as u32;
    let mut canvas = Pixmap::new(pixels(drawing.width), pixels(drawing.height))
        .expect("a page has a width and a height");
    canvas.fill(tiny_skia::Color::WHITE);
    let font = Font::embedded();
    for mark in &drawing.marks {
        match mark {
            Mark::Group(_) | Mark::EndGroup => (),
            Mark::Shape { path, fill, stroke } => {
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

/// The path; `None` of one that has nothing to paint, like a single point.
fn outline(path: &Path) -> Option<tiny_skia::Path> {
    let mut builder = PathBuilder::with_capacity(path.len(), 3 * path.len());
    for step in path {
        match *step {
            Step::Move(to) => builder.move_to(to.x as f32, to.y as f32),
            Step::Line(to) => builder.line_to(to.x as f32, to.y as f32),
            Step::Cubic(a, b, to) => {
                let [a, b, to] = [a, b, to].map(|point| point.as_vec2());
                builder.cubic_to(a.x, a.y, b.x, b.y, to.x, to.y);
            }
            Step::Close => builder.close(),
        }
    }
    builder.finish()
}

fn ink(Color(red, green, blue): Color) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(red, green, blue, 255);
    paint
}

fn fill_path(canvas: &mut Pixmap, path: &tiny_skia::Path, color: Color, transform: Transform) {
    canvas.fill_path(path, &ink(color), FillRule::Winding, transform, None);
}

fn stroke_path(canvas: &mut Pixmap, path: &tiny_skia::Path, stroke: &Stroke) {
    let dash = stroke.dashed.then(|| DASHES.map(|length| length as f32));
    let pen = Pen {
        width: stroke.width as f32,
        line_cap: LineCap::Round,
        line_join: LineJoin::Round,
        dash: dash.and_then(|dash| StrokeDash::new(dash.to_vec(), 0.0)),
        ..Pen::default()
    };
    canvas.stroke_path(path, &ink(stroke.color), &pen, page_to_pixels(), None);
}

fn paint_label(canvas: &mut Pixmap, label: &Label, font: &Font) {
    let Some(path) = outline(&font.outline(&label.text, label.size)) else {
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
        .pre_translate(-before as f32, 0.0);
    fill_path(canvas, &path, label.color, place);
}

fn encode(canvas: &Pixmap, out: &mut dyn Write) -> io::Result<()> {
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
    // Row by row: buffers of the whole page cost more than what is done with them.
    let mut writer = encoder.write_header()?;
    let mut rows = writer.stream_writer_with_size(CHUNK)?;
    let mut rgb = vec![0; 3 * canvas.width() as usize];
    for row in canvas.data().chunks_exact(4 * canvas.width() as usize) {
        // The page is opaque: its transparency need not be stored.
        for (to, from) in rgb.chunks_exact_mut(3).zip(row.chunks_exact(4)) {
            to.copy_from_slice(&from[..3]);
        }
        rows.write_all(&rgb)?;
    }
    rows.finish()?;
    Ok(writer.finish()?)
}
