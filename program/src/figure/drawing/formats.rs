//! Drawings as files: SVG, and PNG at 192 dots per inch, painted in parallel bands. The embedded font
//! tells how wide a text is, and has its outlines for the PNG.

use crate::figure::drawing::{
    Color, Drawing, DrawingElement, DrawingPath, PathStep, Stroke, TextAnchor, TextLabel,
};
use glam::DVec2;
use rayon::prelude::*;
use std::borrow::Borrow;
use std::io::Write;
use std::ops::Range;
use std::{io, iter};
use tiny_skia::{
    FillRule, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Rect, Stroke as Pen, StrokeDash,
    Transform,
};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

pub fn write_svg(drawing: &Drawing, out: &mut dyn Write) -> io::Result<()> {
    let Drawing { width, height, .. } = drawing;
    writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" role=\"img\" fill=\"none\" stroke-linecap=\"round\" \
         stroke-linejoin=\"round\" font-family=\"DejaVu Sans, Verdana, sans-serif\">"
    )?;
    writeln!(out, "<title>{}</title>", escape_xml(&drawing.description))?;
    writeln!(
        out,
        "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>"
    )?;
    for mark in &drawing.elements {
        match mark {
            // No id, as there may be several of a kind.
            DrawingElement::Group(name) => writeln!(out, "<g class=\"{name}\">")?,
            DrawingElement::EndGroup => writeln!(out, "</g>")?,
            DrawingElement::Shape { path, fill, stroke } => {
                write!(out, "<path d=\"")?;
                for step in path {
                    match step {
                        PathStep::Move(to) => write!(out, "M{}", format_point(to))?,
                        PathStep::Line(to) => write!(out, "L{}", format_point(to))?,
                        PathStep::Cubic(a, b, to) => {
                            write!(
                                out,
                                "C{} {} {}",
                                format_point(a),
                                format_point(b),
                                format_point(to)
                            )?;
                        }
                        PathStep::Close => write!(out, "Z")?,
                    }
                }
                write!(out, "\"")?;
                if let Some(fill) = fill {
                    write!(out, " fill=\"{}\"", hex_color(*fill))?;
                }
                if let Some(stroke) = stroke {
                    let color = hex_color(stroke.color);
                    write!(out, " stroke=\"{color}\" stroke-width=\"{}\"", stroke.width)?;
                    let dash: Vec<String> =
                        (stroke.dash.dash_lengths().iter().map(f64::to_string)).collect();
                    if !dash.is_empty() {
                        write!(out, " stroke-dasharray=\"{}\"", dash.join(" "))?;
                    }
                }
                writeln!(out, "/>")?;
            }
            DrawingElement::Label(label) => write_label(label, out)?,
        }
    }
    writeln!(out, "</svg>")
}

fn write_label(label: &TextLabel, out: &mut dyn Write) -> io::Result<()> {
    let (x, y) = (
        format_coordinate(label.position.x),
        format_coordinate(label.position.y),
    );
    match label.rotated {
        true => write!(out, "<text transform=\"translate({x} {y}) rotate(-90)\"")?,
        false => write!(out, "<text x=\"{x}\" y=\"{y}\"")?,
    }
    match label.anchor {
        TextAnchor::Start => (),
        TextAnchor::Middle => write!(out, " text-anchor=\"middle\"")?,
        TextAnchor::End => write!(out, " text-anchor=\"end\"")?,
    }
    let (size, color, text) = (label.size, hex_color(label.color), escape_xml(&label.text));
    writeln!(out, " font-size=\"{size}\" fill=\"{color}\">{text}</text>")
}

fn format_point(point: &DVec2) -> String {
    format!(
        "{} {}",
        format_coordinate(point.x),
        format_coordinate(point.y)
    )
}

/// Rounds to a hundredth of a pixel, without trailing zeros.
fn format_coordinate(value: f64) -> String {
    let hundredths = (value * 100.0).round() / 100.0;
    // Adding zero turns -0 into 0.
    (hundredths + 0.0).to_string()
}

pub fn hex_color(Color(red, green, blue): Color) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Escapes text for XML and leaves out control characters.
pub fn escape_xml(text: &str) -> String {
    text.chars()
        .filter(|c| !c.is_control())
        .map(|c| match c {
            '&' => "&amp;".to_string(),
            '<' => "&lt;".to_string(),
            '>' => "&gt;".to_string(),
            c => c.to_string(),
        })
        .collect()
}

/// The picture as text; checks that groups are closed, ids do not repeat and numbers are finite.
#[cfg(test)]
pub fn checked_svg_text(drawing: &Drawing) -> String {
    let mut bytes = Vec::new();
    write_svg(drawing, &mut bytes).unwrap();
    let svg = String::from_utf8(bytes).unwrap();
    assert_eq!(svg.matches("<g ").count(), svg.matches("</g>").count());
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    let mut ids: Vec<_> = svg
        .split(" id=\"")
        .skip(1)
        .map(|rest| rest.split('"').next())
        .collect();
    ids.sort_unstable();
    assert!(ids.windows(2).all(|pair| pair[0] != pair[1]), "{ids:?}");
    svg
}

pub const PIXELS_PER_UNIT: f64 = 2.0;

/// Bytes per chunk of the file.
const CHUNK_BYTES: usize = 1 << 16;

/// 192 dots per inch, in dots per metre as the file states it.
const DOTS_PER_METRE: u32 = 7559;

/// Rows of a band; bands are painted in parallel.
const BAND_ROWS: u32 = 320;

pub fn write_png(drawing: &Drawing, out: &mut dyn Write) -> io::Result<()> {
    let [width, height] = pixel_size(drawing);
    let shapes = painted_shapes(drawing);
    let starts = (0..height).step_by(BAND_ROWS as usize);
    let bands: Vec<Range<u32>> = starts.map(|at| at..(at + BAND_ROWS).min(height)).collect();
    let together = bands.chunks(rayon::current_num_threads());
    let painted = together.flat_map(|some| -> Vec<Pixmap> {
        let each = some.par_iter().cloned();
        each.map(|rows| paint_rows(&shapes, width, rows)).collect()
    });
    encode_bands([width, height], PngEncoding::OF_LINES, painted, out)
}

/// Writes the pixels of an opaque picture as PNG.
pub fn write_pixels(picture: &Pixmap, out: &mut dyn Write) -> io::Result<()> {
    let size = [picture.width(), picture.height()];
    let all = iter::once(picture);
    encode_bands(size, PngEncoding::OF_SHADES, all, out)
}

/// Pixels of a drawing, across and down.
fn pixel_size(drawing: &Drawing) -> [u32; 2] {
    [drawing.width, drawing.height].map(|length| (length * PIXELS_PER_UNIT).ceil() as u32)
}

pub fn rasterize(drawing: &Drawing) -> Pixmap {
    let [width, height] = pixel_size(drawing);
    paint_rows(&painted_shapes(drawing), width, 0..height)
}

/// A path to be painted `before` pixels left of a place on the page, and then rotated about
/// that place by `turn` degrees.
struct PaintedShape {
    path: tiny_skia::Path,
    fill: Option<Color>,
    stroke: Option<Stroke>,
    anchor: DVec2,
    rotation: f32,
    left_offset: f64,
}

fn painted_shapes(drawing: &Drawing) -> Vec<PaintedShape> {
    let font = Font::embedded();
    let shape = |mark: &DrawingElement| match mark {
        DrawingElement::Group(_) | DrawingElement::EndGroup => None,
        DrawingElement::Shape { path, fill, stroke } => Some(PaintedShape {
            path: skia_path(path)?,
            fill: *fill,
            stroke: *stroke,
            anchor: DVec2::ZERO,
            rotation: 0.0,
            left_offset: 0.0,
        }),
        DrawingElement::Label(label) => Some(PaintedShape {
            path: skia_path(&font.text_outline(&label.text, label.size))?,
            fill: Some(label.color),
            stroke: None,
            anchor: label.position,
            rotation: if label.rotated { -90.0 } else { 0.0 },
            left_offset: match label.anchor {
                TextAnchor::Start => 0.0,
                TextAnchor::Middle => 0.5,
                TextAnchor::End => 1.0,
            } * font.text_width(&label.text, label.size),
        }),
    };
    drawing.elements.iter().filter_map(shape).collect()
}

fn paint_rows(shapes: &[PaintedShape], width: u32, rows: Range<u32>) -> Pixmap {
    let height = rows.end - rows.start;
    let mut canvas = Pixmap::new(width, height).expect("a page has a width and a height");
    // White.
    canvas.data_mut().fill(u8::MAX);
    paint_shapes(&mut canvas, shapes, rows.start);
    canvas
}

/// Paints a drawing over a picture of its size.
pub fn paint_over(picture: &mut Pixmap, drawing: &Drawing) {
    paint_shapes(picture, &painted_shapes(drawing), 0);
}

/// Paints shapes on a canvas that begins at this row of the page.
fn paint_shapes(canvas: &mut Pixmap, shapes: &[PaintedShape], first_row: u32) {
    let height = canvas.height();
    let page = Transform::from_translate(0.0, -(first_row as f32));
    let page = page.pre_scale(PIXELS_PER_UNIT as f32, PIXELS_PER_UNIT as f32);
    for shape in shapes {
        let path = &shape.path;
        let place = page
            .pre_translate(shape.anchor.x as f32, shape.anchor.y as f32)
            .pre_rotate(shape.rotation)
            .pre_translate(-shape.left_offset as f32, 0.0);
        let rim = (PIXELS_PER_UNIT * shape.stroke.map_or(1.0, |stroke| 1.0 + stroke.width)) as f32;
        let outside = |it: Rect| it.bottom() + rim < 0.0 || it.top() - rim > height as f32;
        if path.bounds().transform(place).is_some_and(outside) {
            continue;
        }
        if let Some(color) = shape.fill {
            canvas.fill_path(path, &solid_paint(color), FillRule::Winding, place, None);
        }
        if let Some(stroke) = &shape.stroke {
            stroke_path(canvas, path, stroke, place);
        }
    }
}

/// The path; `None` if there is nothing to paint, as for a single point.
fn skia_path(path: &DrawingPath) -> Option<tiny_skia::Path> {
    let mut builder = PathBuilder::with_capacity(path.len(), 3 * path.len());
    for step in path {
        match *step {
            PathStep::Move(to) => builder.move_to(to.x as f32, to.y as f32),
            PathStep::Line(to) => builder.line_to(to.x as f32, to.y as f32),
            PathStep::Cubic(a, b, to) => {
                let [a, b, to] = [a, b, to].map(|point| point.as_vec2());
                builder.cubic_to(a.x, a.y, b.x, b.y, to.x, to.y);
            }
            PathStep::Close => builder.close(),
        }
    }
    builder.finish()
}

fn solid_paint(Color(red, green, blue): Color) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(red, green, blue, 255);
    paint
}

fn stroke_path(canvas: &mut Pixmap, path: &tiny_skia::Path, stroke: &Stroke, transform: Transform) {
    let dash = stroke
        .dash
        .dash_lengths()
        .iter()
        .map(|&length| length as f32);
    let pen = Pen {
        width: stroke.width as f32,
        line_cap: LineCap::Round,
        line_join: LineJoin::Round,
        // None of no lengths.
        dash: StrokeDash::new(dash.collect(), 0.0),
        ..Pen::default()
    };
    canvas.stroke_path(path, &solid_paint(stroke.color), &pen, transform, None);
}

/// How rows are filtered and compressed.
struct PngEncoding {
    compression: png::Compression,
    filter: png::Filter,
}

impl PngEncoding {
    /// Lines and text on white: a simple filter is four times as fast as choosing one row by row, for a file half as
    /// large again.
    const OF_LINES: PngEncoding = PngEncoding {
        compression: png::Compression::Fast,
        filter: png::Filter::Up,
    };

    /// Colors that change little from a pixel to the next.
    const OF_SHADES: PngEncoding = PngEncoding {
        compression: png::Compression::Balanced,
        filter: png::Filter::Adaptive,
    };
}

/// Writes rows as they are painted.
fn encode_bands(
    [width, height]: [u32; 2],
    encoding: PngEncoding,
    bands: impl Iterator<Item: Borrow<Pixmap>>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut encoder = png::Encoder::new(out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(encoding.compression);
    encoder.set_filter(encoding.filter);
    encoder.set_pixel_dims(Some(png::PixelDimensions {
        xppu: DOTS_PER_METRE,
        yppu: DOTS_PER_METRE,
        unit: png::Unit::Meter,
    }));
    // Row by row: buffers of the whole page would cost more than the encoding.
    let mut writer = encoder.write_header()?;
    let mut rows = writer.stream_writer_with_size(CHUNK_BYTES)?;
    let mut rgb = vec![[0; 3]; width as usize];
    for band in bands {
        for row in band.borrow().data().chunks_exact(4 * width as usize) {
            // The page is opaque: alpha need not be stored.
            let pixels = rgb.iter_mut().zip(row.as_chunks::<4>().0);
            pixels.for_each(|(to, [red, green, blue, _])| *to = [*red, *green, *blue]);
            rows.write_all(rgb.as_flattened())?;
        }
    }
    rows.finish()?;
    Ok(writer.finish()?)
}

static FONT_FILE: &[u8] = include_bytes!("../../../assets/DejaVuSans-subset.ttf");

pub struct Font {
    face: Face<'static>,
}

impl Font {
    pub fn embedded() -> Self {
        Font {
            face: Face::parse(FONT_FILE, 0).expect("the embedded font is whole"),
        }
    }

    pub fn text_width(&self, text: &str, size: f64) -> f64 {
        text.chars()
            .map(|c| self.glyph_advance(self.glyph_of_character(c)))
            .sum::<f64>()
            * self.units_to_size(size)
    }

    /// The text in lines no wider than `width`, unless a single word is.
    pub fn wrap_text(&self, text: &str, size: f64, width: f64) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for word in text.split_whitespace() {
            if let Some(line) = lines.last_mut() {
                let longer = format!("{line} {word}");
                if self.text_width(&longer, size) <= width {
                    *line = longer;
                    continue;
                }
            }
            lines.push(word.into());
        }
        lines
    }

    /// The text, cut off with an ellipsis where it does not fit.
    pub fn shorten_text(&self, text: &str, size: f64, width: f64) -> String {
        let mut shown: String = text.chars().filter(|c| !c.is_control()).collect();
        if self.text_width(&shown, size) <= width {
            return shown;
        }
        while self.text_width(&shown, size) + size > width && shown.pop().is_some() {}
        shown + "…"
    }

    /// The outlines of a text that starts at the origin of its base line.
    fn text_outline(&self, text: &str, size: f64) -> DrawingPath {
        let mut outline = GlyphOutlineBuilder {
            scale: self.units_to_size(size),
            line_position: 0.0,
            at: DVec2::ZERO,
            path: Vec::new(),
        };
        for glyph in text.chars().map(|c| self.glyph_of_character(c)) {
            // Blanks have no outline.
            let _ = self.face.outline_glyph(glyph, &mut outline);
            outline.line_position += self.glyph_advance(glyph) * outline.scale;
        }
        outline.path
    }

    fn units_to_size(&self, size: f64) -> f64 {
        size / f64::from(self.face.units_per_em())
    }

    /// Characters that the font lacks appear as its empty box.
    fn glyph_of_character(&self, c: char) -> GlyphId {
        self.face.glyph_index(c).unwrap_or(GlyphId(0))
    }

    fn glyph_advance(&self, glyph: GlyphId) -> f64 {
        f64::from(self.face.glyph_hor_advance(glyph).unwrap_or(0))
    }
}

/// Collects the outlines of glyphs: scaled, with y down as on the page, and moved along
/// the base line.
struct GlyphOutlineBuilder {
    scale: f64,
    line_position: f64,
    at: DVec2,
    path: DrawingPath,
}

impl GlyphOutlineBuilder {
    fn page_point(&mut self, x: f32, y: f32) -> DVec2 {
        let point = self.scale * DVec2::new(f64::from(x), -f64::from(y));
        self.at = point + DVec2::new(self.line_position, 0.0);
        self.at
    }
}

impl OutlineBuilder for GlyphOutlineBuilder {
    fn move_to(&mut self, x: f32, y: f32) {
        let to = self.page_point(x, y);
        self.path.push(PathStep::Move(to));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let to = self.page_point(x, y);
        self.path.push(PathStep::Line(to));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let from = self.at;
        let control = self.page_point(x1, y1);
        let to = self.page_point(x, y);
        // The equivalent cubic curve.
        let (a, b) = (from.lerp(control, 2.0 / 3.0), to.lerp(control, 2.0 / 3.0));
        self.path.push(PathStep::Cubic(a, b, to));
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let (a, b) = (self.page_point(x1, y1), self.page_point(x2, y2));
        let to = self.page_point(x, y);
        self.path.push(PathStep::Cubic(a, b, to));
    }

    fn close(&mut self) {
        self.path.push(PathStep::Close);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!(format_coordinate(12.3456), "12.35");
        assert_eq!(format_coordinate(-0.001), "0");
        assert_eq!(format_coordinate(7.0), "7");
    }
}

#[cfg(test)]
mod png_tests {
    use super::*;
    use crate::figure::drawing::{SECOND_SOLUTION_COLOR, TEXT_COLOR, circle_path, rectangle_path};
    use std::io::Cursor;

    #[test]
    fn bands_are_one_picture() {
        let mut page = Drawing::new(300.0, "");
        page.height = 700.0;
        let (corner, size) = (DVec2::new(20.0, 20.0), DVec2::new(200.0, 600.0));
        page.draw_shape(rectangle_path(corner, size), SECOND_SOLUTION_COLOR, None);
        for k in 0..14 {
            let at = DVec2::new(30.0 + 10.0 * f64::from(k), 50.0 * f64::from(k));
            page.draw_stroke(circle_path(at, 45.0), Stroke::new(TEXT_COLOR, 3.0));
            page.draw_label(at, "name", 20.0, TextAnchor::Start, TEXT_COLOR);
            page.draw_rotated_label(at, "a long name of an axis", 20.0, TEXT_COLOR);
        }
        let (from, to) = (DVec2::new(0.0, 10.0), DVec2::new(300.0, 690.0));
        page.draw_line(from, to, Stroke::new(TEXT_COLOR, 4.0));
        let mut bytes = Vec::new();
        write_png(&page, &mut bytes).unwrap();
        let reader = ::png::Decoder::new(Cursor::new(&bytes)).read_info();
        let mut reader = reader.unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        let whole = rasterize(&page);
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

#[cfg(test)]
mod font_tests {
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
        let width = font.text_width("use more", 12.0) + 0.1;
        let lines = font.wrap_text("use more intervals or more", 12.0, width);
        assert_eq!(lines, ["use more", "intervals", "or more"]);
        assert!(font.wrap_text("", 12.0, width).is_empty());
    }

    #[test]
    fn long_names_are_cut() {
        let font = Font::embedded();
        assert_eq!(font.shorten_text("explicit", 10.5, 200.0), "explicit");
        let long = font.shorten_text(&"explicit ".repeat(20), 10.5, 200.0);
        assert!(long.ends_with('…') && font.text_width(&long, 10.5) <= 200.0);
    }
}
