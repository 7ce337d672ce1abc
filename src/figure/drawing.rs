//! What a picture is made of: shapes and labels on a page whose unit is 1/96
//! inch, x to the right and y down.

use glam::DVec2;

use super::colors::Color;

/// A page and everything on it, in painting order.
pub struct Drawing {
    pub width: f64,
    pub height: f64,
    /// What the page shows, in words.
    pub description: String,
    pub marks: Vec<Mark>,
}

pub enum Mark {
    /// Begins a named group: for whoever edits the SVG.
    Group(&'static str),
    /// Ends the group begun last.
    EndGroup,
    Shape {
        path: Path,
        fill: Option<Color>,
        stroke: Option<Stroke>,
    },
    Label(Label),
}

/// A line drawn with round caps and joins.
#[derive(Clone, Copy)]
pub struct Stroke {
    pub color: Color,
    pub width: f64,
    pub opacity: f64,
}

impl Stroke {
    pub fn new(color: Color, width: f64) -> Self {
        Stroke {
            color,
            width,
            opacity: 1.0,
        }
    }
}

#[derive(Clone, Copy)]
pub enum Step {
    Move(DVec2),
    Line(DVec2),
    Cubic(DVec2, DVec2, DVec2),
    Close,
}

pub type Path = Vec<Step>;

/// Where a label's text lies relative to its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

pub struct Label {
    /// On the base line, at the text's start, middle or end.
    pub at: DVec2,
    pub text: String,
    pub size: f64,
    pub anchor: Anchor,
    pub color: Color,
    /// Written from below to above.
    pub upright: bool,
}

/// From the base line to the middle of digits and capitals, in font sizes.
pub const HALF_CAPITAL: f64 = 0.36;

impl Drawing {
    pub fn group(&mut self, name: &'static str, fill: impl FnOnce(&mut Self)) {
        self.marks.push(Mark::Group(name));
        fill(self);
        self.marks.push(Mark::EndGroup);
    }

    pub fn stroke(&mut self, path: Path, stroke: Stroke) {
        self.marks.push(Mark::Shape {
            path,
            fill: None,
            stroke: Some(stroke),
        });
    }

    pub fn shape(&mut self, path: Path, fill: Color, stroke: Option<Stroke>) {
        self.marks.push(Mark::Shape {
            path,
            fill: Some(fill),
            stroke,
        });
    }

    pub fn line(&mut self, from: DVec2, to: DVec2, stroke: Stroke) {
        self.stroke(vec![Step::Move(from), Step::Line(to)], stroke);
    }

    pub fn label(&mut self, at: DVec2, text: &str, size: f64, anchor: Anchor, color: Color) {
        let text = text.to_string();
        self.marks.push(Mark::Label(Label {
            at,
            text,
            size,
            anchor,
            color,
            upright: false,
        }));
    }

    /// A label centred on `at` in both directions.
    pub fn centered(&mut self, at: DVec2, text: &str, size: f64, color: Color) {
        let base = DVec2::new(at.x, at.y + HALF_CAPITAL * size);
        self.label(base, text, size, Anchor::Middle, color);
    }

    pub fn upright_label(&mut self, at: DVec2, text: &str, size: f64, color: Color) {
        let text = text.to_string();
        let anchor = Anchor::Middle;
        self.marks.push(Mark::Label(Label {
            at,
            text,
            size,
            anchor,
            color,
            upright: true,
        }));
    }
}

pub fn polygon(corners: &[DVec2]) -> Path {
    let mut path: Path = corners.iter().map(|&corner| Step::Line(corner)).collect();
    if let Some(first) = corners.first() {
        path[0] = Step::Move(*first);
        path.push(Step::Close);
    }
    path
}

pub fn rectangle(corner: DVec2, size: DVec2) -> Path {
    polygon(&[
        corner,
        corner + DVec2::new(size.x, 0.0),
        corner + size,
        corner + DVec2::new(0.0, size.y),
    ])
}

pub fn circle(center: DVec2, radius: f64) -> Path {
    /// Control points of a quarter circle lie this far along its tangents.
    const QUARTER: f64 = 0.552_284_749_8;
    let point = |x: f64, y: f64| center + radius * DVec2::new(x, y);
    let q = QUARTER;
    vec![
        Step::Move(point(1.0, 0.0)),
        Step::Cubic(point(1.0, q), point(q, 1.0), point(0.0, 1.0)),
        Step::Cubic(point(-q, 1.0), point(-1.0, q), point(-1.0, 0.0)),
        Step::Cubic(point(-1.0, -q), point(-q, -1.0), point(0.0, -1.0)),
        Step::Cubic(point(q, -1.0), point(1.0, -q), point(1.0, 0.0)),
        Step::Close,
    ]
}
