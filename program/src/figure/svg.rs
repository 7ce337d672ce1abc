//! SVG files.

use std::io::{self, Write};

use glam::DVec2;

use super::drawing::{Anchor, Color, Drawing, Label, Mark, Step};

pub fn write_svg(drawing: &Drawing, out: &mut dyn Write) -> io::Result<()> {
    let Drawing { width, height, .. } = drawing;
    writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" role=\"img\" fill=\"none\" stroke-linecap=\"round\" \
         stroke-linejoin=\"round\" font-family=\"DejaVu Sans, Verdana, sans-serif\">"
    )?;
    writeln!(out, "<title>{}</title>", escaped(&drawing.description))?;
    writeln!(
        out,
        "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>"
    )?;
    for mark in &drawing.marks {
        match mark {
            // No id, as there may be several of a kind.
            Mark::Group(name) => writeln!(out, "<g class=\"{name}\">")?,
            Mark::EndGroup => writeln!(out, "</g>")?,
            Mark::Shape { path, fill, stroke } => {
                write!(out, "<path d=\"")?;
                for step in path {
                    match step {
                        Step::Move(to) => write!(out, "M{}", point(to))?,
                        Step::Line(to) => write!(out, "L{}", point(to))?,
                        Step::Cubic(a, b, to) => {
                            write!(out, "C{} {} {}", point(a), point(b), point(to))?;
                        }
                        Step::Close => write!(out, "Z")?,
                    }
                }
                write!(out, "\"")?;
                if let Some(fill) = fill {
                    write!(out, " fill=\"{}\"", hex(*fill))?;
                }
                if let Some(stroke) = stroke {
                    let color = hex(stroke.color);
                    write!(out, " stroke=\"{color}\" stroke-width=\"{}\"", stroke.width)?;
                    let dash: Vec<String> =
                        (stroke.dash.lengths().iter().map(f64::to_string)).collect();
                    if !dash.is_empty() {
                        write!(out, " stroke-dasharray=\"{}\"", dash.join(" "))?;
                    }
                }
                writeln!(out, "/>")?;
            }
            Mark::Label(label) => write_label(label, out)?,
        }
    }
    writeln!(out, "</svg>")
}

fn write_label(label: &Label, out: &mut dyn Write) -> io::Result<()> {
    let (x, y) = (number(label.at.x), number(label.at.y));
    match label.rotated {
        true => write!(out, "<text transform=\"translate({x} {y}) rotate(-90)\"")?,
        false => write!(out, "<text x=\"{x}\" y=\"{y}\"")?,
    }
    match label.anchor {
        Anchor::Start => (),
        Anchor::Middle => write!(out, " text-anchor=\"middle\"")?,
        Anchor::End => write!(out, " text-anchor=\"end\"")?,
    }
    let (size, color, text) = (label.size, hex(label.color), escaped(&label.text));
    writeln!(out, " font-size=\"{size}\" fill=\"{color}\">{text}</text>")
}

fn point(point: &DVec2) -> String {
    format!("{} {}", number(point.x), number(point.y))
}

/// Rounds to a hundredth of a pixel, without trailing zeros.
fn number(value: f64) -> String {
    let hundredths = (value * 100.0).round() / 100.0;
    // Adding zero turns -0 into 0.
    (hundredths + 0.0).to_string()
}

pub fn hex(Color(red, green, blue): Color) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Escapes text for XML and leaves out control characters.
pub fn escaped(text: &str) -> String {
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
pub fn text(drawing: &Drawing) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!(number(12.3456), "12.35");
        assert_eq!(number(-0.001), "0");
        assert_eq!(number(7.0), "7");
    }
}
