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
    pub dashed: bool,
}

impl Stroke {
    pub fn new(color: Color, width: f64) -> Self {
        Stroke {
            color,
            width,
            dashed: false,
        }
    }

    pub fn dashed(self, dashed: bool) -> Self {
        Stroke { dashed, ..self }
    }
}

/// Lengths of the dashes of dashed lines and of the gaps between them.
pub const DASHES: [f64; 2] = [5.0, 4.0];

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
const HALF_CAPITAL: f64 = 0.36;

impl Drawing {
    /// An empty page whose height is not known yet.
    pub fn new(width: f64, description: &str) -> Self {
        Drawing {
            width,
            height: 0.0,
            description: description.into(),
            marks: Vec::new(),
        }
    }

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

    /// Adds a label, if it says anything.
    fn add(&mut self, label: Label) {
        if !label.text.is_empty() {
            self.marks.push(Mark::Label(label));
        }
    }

    pub fn label(&mut self, at: DVec2, text: &str, size: f64, anchor: Anchor, color: Color) {
        self.add(Label {
            at,
            text: text.into(),
            size,
            anchor,
            color,
            upright: false,
        });
    }

    /// A label whose digits and capitals have their middle at the height of `at`.
    pub fn beside(&mut self, at: DVec2, text: &str, size: f64, anchor: Anchor, color: Color) {
        let base = at + DVec2::new(0.0, HALF_CAPITAL * size);
        self.label(base, text, size, anchor, color);
    }

    pub fn upright_label(&mut self, at: DVec2, text: &str, size: f64, color: Color) {
        self.add(Label {
            at,
            text: text.into(),
            size,
            anchor: Anchor::Middle,
            color,
            upright: true,
        });
    }
}

/// Straight lines from each point to the next.
pub fn polyline(points: &[DVec2]) -> Path {
    let mut path: Path = points.iter().map(|&point| Step::Line(point)).collect();
    if let Some(first) = points.first() {
        path[0] = Step::Move(*first);
    }
    path
}

pub fn polygon(corners: &[DVec2]) -> Path {
    let mut path = polyline(corners);
    path.push(Step::Close);
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
