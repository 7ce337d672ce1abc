//! PNG files: the drawing at 192 dots per inch.

use std::io::{self, Write};
use std::ops::Range;

use glam::DVec2;
use rayon::prelude::*;
use tiny_skia::{
    FillRule, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Rect, Stroke as Pen, StrokeDash,
    Transform,
};

use super::drawing::{Anchor, Color, Drawing, Mark, Path, Step, Stroke};
use super::font::Font;

const SCALE: f64 = 2.0;
/// Bytes per chunk of the file.
const CHUNK: usize = 1 << 16;
/// 192 dots per inch, in dots per metre as the file states it.
const DOTS_PER_METRE: u32 = 7559;

/// Rows of a band; bands are painted in parallel.
const BAND: u32 = 320;

pub fn write_png(drawing: &Drawing, out: &mut dyn Write) -> io::Result<()> {
    let [width, height] = size(drawing);
    let shapes = shapes(drawing);
    let starts = (0..height).step_by(BAND as usize);
    let bands: Vec<Range<u32>> = starts.map(|at| at..(at + BAND).min(height)).collect();
    let together = bands.chunks(rayon::current_num_threads());
    let painted = together.flat_map(|some| -> Vec<Pixmap> {
        let each = some.par_iter().cloned();
        each.map(|rows| paint_rows(&shapes, width, rows)).collect()
    });
    encode([width, height], painted, out)
}

/// Pixels of a drawing, across and down.
fn size(drawing: &Drawing) -> [u32; 2] {
    [drawing.width, drawing.height].map(|length| (length * SCALE).ceil() as u32)
}

pub fn paint(drawing: &Drawing) -> Pixmap {
    let [width, height] = size(drawing);
    paint_rows(&shapes(drawing), width, 0..height)
}

/// A path to be painted `before` pixels left of a place on the page, and then rotated about
/// that place by `turn` degrees.
struct Shape {
    path: tiny_skia::Path,
    fill: Option<Color>,
    stroke: Option<Stroke>,
    at: DVec2,
    turn: f32,
    before: f64,
}

fn shapes(drawing: &Drawing) -> Vec<Shape> {
    let font = Font::embedded();
    let shape = |mark: &Mark| match mark {
        Mark::Group(_) | Mark::EndGroup => None,
        Mark::Shape { path, fill, stroke } => Some(Shape {
            path: outline(path)?,
            fill: *fill,
            stroke: *stroke,
            at: DVec2::ZERO,
            turn: 0.0,
            before: 0.0,
        }),
        Mark::Label(label) => Some(Shape {
            path: outline(&font.outline(&label.text, label.size))?,
            fill: Some(label.color),
            stroke: None,
            at: label.at,
            turn: if label.rotated { -90.0 } else { 0.0 },
            before: match label.anchor {
                Anchor::Start => 0.0,
                Anchor::Middle => 0.5,
                Anchor::End => 1.0,
            } * font.width(&label.text, label.size),
        }),
    };
    drawing.marks.iter().filter_map(shape).collect()
}

fn paint_rows(shapes: &[Shape], width: u32, rows: Range<u32>) -> Pixmap {
    let height = rows.end - rows.start;
    let mut canvas = Pixmap::new(width, height).expect("a page has a width and a height");
    // White.
    canvas.data_mut().fill(u8::MAX);
    let page = Transform::from_translate(0.0, -(rows.start as f32));
    let page = page.pre_scale(SCALE as f32, SCALE as f32);
    for shape in shapes {
        let path = &shape.path;
        let place = page
            .pre_translate(shape.at.x as f32, shape.at.y as f32)
            .pre_rotate(shape.turn)
            .pre_translate(-shape.before as f32, 0.0);
        let rim = (SCALE * shape.stroke.map_or(1.0, |stroke| 1.0 + stroke.width)) as f32;
        let outside = |it: Rect| it.bottom() + rim < 0.0 || it.top() - rim > height as f32;
        if path.bounds().transform(place).is_some_and(outside) {
            continue;
        }
        if let Some(color) = shape.fill {
            canvas.fill_path(path, &ink(color), FillRule::Winding, place, None);
        }
        if let Some(stroke) = &shape.stroke {
            stroke_path(&mut canvas, path, stroke, place);
        }
    }
    canvas
}

/// The path; `None` if there is nothing to paint, as for a single point.
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

fn stroke_path(canvas: &mut Pixmap, path: &tiny_skia::Path, stroke: &Stroke, transform: Transform) {
    let dash = stroke.dash.lengths().iter().map(|&length| length as f32);
    let pen = Pen {
        width: stroke.width as f32,
        line_cap: LineCap::Round,
        line_join: LineJoin::Round,
        // None of no lengths.
        dash: StrokeDash::new(dash.collect(), 0.0),
        ..Pen::default()
    };
    canvas.stroke_path(path, &ink(stroke.color), &pen, transform, None);
}

/// Writes rows as they are painted.
fn encode(
    [width, height]: [u32; 2],
    bands: impl Iterator<Item = Pixmap>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut encoder = png::Encoder::new(out, width, height);
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
    // Row by row: buffers of the whole page would cost more than the encoding.
    let mut writer = encoder.write_header()?;
    let mut rows = writer.stream_writer_with_size(CHUNK)?;
    let mut rgb = vec![[0; 3]; width as usize];
    for band in bands {
        for row in band.data().chunks_exact(4 * width as usize) {
            // The page is opaque: alpha need not be stored.
            let pixels = rgb.iter_mut().zip(row.as_chunks::<4>().0);
            pixels.for_each(|(to, [red, green, blue, _])| *to = [*red, *green, *blue]);
            rows.write_all(rgb.as_flattened())?;
        }
    }
    rows.finish()?;
    Ok(writer.finish()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::{DOT, INK, circle, rectangle};
    use std::io::Cursor;

    #[test]
    fn bands_are_one_picture() {
        let mut page = Drawing::new(300.0, "");
        page.height = 700.0;
        let (corner, size) = (DVec2::new(20.0, 20.0), DVec2::new(200.0, 600.0));
        page.shape(rectangle(corner, size), DOT, None);
        for k in 0..14 {
            let at = DVec2::new(30.0 + 10.0 * f64::from(k), 50.0 * f64::from(k));
            page.stroke(circle(at, 45.0), Stroke::new(INK, 3.0));
            page.label(at, "name", 20.0, Anchor::Start, INK);
            page.rotated_label(at, "a long name of an axis", 20.0, INK);
        }
        let (from, to) = (DVec2::new(0.0, 10.0), DVec2::new(300.0, 690.0));
        page.line(from, to, Stroke::new(INK, 4.0));
        let mut bytes = Vec::new();
        write_png(&page, &mut bytes).unwrap();
        let reader = ::png::Decoder::new(Cursor::new(&bytes)).read_info();
        let mut reader = reader.unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        let whole = paint(&page);
        assert_eq!(4 * pixels.len(), 3 * whole.data().len());
        // Up to rounding at antialiased edges, by four subpixels each way.
        let pairs = pixels.chunks_exact(3).zip(whole.data().chunks_exact(4));
        let off = |(a, b): (&[u8], &[u8])| (0..3).map(|c| a[c].abs_diff(b[c])).max();
        let off: Vec<u8> = pairs.filter_map(off).collect();
        assert!(off.iter().all(|&off| off <= 64), "{:?}", off.iter().max());
        let seen = off.iter().filter(|&&off| off > 2).count();
        assert!(seen < off.len() / 1000, "{seen} pixels of {}", off.len());
    }
}
