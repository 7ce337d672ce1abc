//! A page with its elements, shapes and labels, on which every figure is drawn: sizes, panels,
//! colors, and smooth curves. The unit is 1/96 inch, x points to the right and y down.

pub(super) mod axes;
pub(crate) mod formats;
pub(super) mod labels;
pub(super) mod markers;
pub(crate) mod space;
pub(crate) mod veins;

use glam::{DVec2, DVec3};

/// A page and everything on it, in painting order.
pub struct Drawing {
    pub width: f64,
    pub height: f64,
    /// What the page shows, in words.
    pub description: String,
    pub elements: Vec<DrawingElement>,
}

pub enum DrawingElement {
    /// Begins a named group, for editing the SVG.
    Group(&'static str),
    EndGroup,
    Shape {
        path: DrawingPath,
        fill: Option<Color>,
        stroke: Option<Stroke>,
    },
    Label(TextLabel),
}

/// A line drawn with round caps and joins.
#[derive(Clone, Copy)]
pub struct Stroke {
    pub color: Color,
    pub width: f64,
    pub dash: DashPattern,
}

impl Stroke {
    pub const fn new(color: Color, width: f64) -> Self {
        Stroke {
            color,
            width,
            dash: DashPattern::Solid,
        }
    }

    pub fn with_dashes(self, dashed: bool) -> Self {
        let dash = if dashed {
            DashPattern::Dashed
        } else {
            DashPattern::Solid
        };
        Stroke { dash, ..self }
    }
}

/// How a line is interrupted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DashPattern {
    Solid,
    Dashed,
    Dotted,
    Alternating,
}

impl DashPattern {
    pub const ALL: [DashPattern; 4] = [
        DashPattern::Solid,
        DashPattern::Dashed,
        DashPattern::Dotted,
        DashPattern::Alternating,
    ];

    /// Lengths of dashes and of the gaps between them, in turn; none of a solid line.
    pub fn dash_lengths(self) -> &'static [f64] {
        match self {
            DashPattern::Solid => &[],
            DashPattern::Dashed => &[5.0, 4.0],
            DashPattern::Dotted => &[0.1, 4.0],
            DashPattern::Alternating => &[8.0, 4.0, 0.1, 4.0],
        }
    }
}

#[derive(Clone, Copy)]
pub enum PathStep {
    Move(DVec2),
    Line(DVec2),
    Cubic(DVec2, DVec2, DVec2),
    Close,
}

pub type DrawingPath = Vec<PathStep>;

/// Where a label's text lies relative to its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextAnchor {
    Start,
    Middle,
    End,
}

pub struct TextLabel {
    /// On the base line, at the text's start, middle or end.
    pub position: DVec2,
    pub text: String,
    pub size: f64,
    pub anchor: TextAnchor,
    pub color: Color,
    /// Rotated to read from bottom to top.
    pub rotated: bool,
}

/// Height of the middle of digits and capitals above the base line, in font sizes.
const HALF_CAPITAL_HEIGHT: f64 = 0.36;

impl Drawing {
    pub fn new(width: f64, description: &str) -> Self {
        Drawing {
            width,
            height: 0.0,
            description: description.into(),
            elements: Vec::new(),
        }
    }

    pub fn draw_group(&mut self, name: &'static str, fill: impl FnOnce(&mut Self)) {
        self.elements.push(DrawingElement::Group(name));
        fill(self);
        self.elements.push(DrawingElement::EndGroup);
    }

    pub fn draw_stroke(&mut self, path: DrawingPath, stroke: Stroke) {
        let (fill, stroke) = (None, Some(stroke));
        self.elements
            .push(DrawingElement::Shape { path, fill, stroke });
    }

    pub fn draw_shape(&mut self, path: DrawingPath, fill: Color, stroke: Option<Stroke>) {
        let fill = Some(fill);
        self.elements
            .push(DrawingElement::Shape { path, fill, stroke });
    }

    pub fn draw_line(&mut self, from: DVec2, to: DVec2, stroke: Stroke) {
        self.draw_stroke(vec![PathStep::Move(from), PathStep::Line(to)], stroke);
    }

    fn add_label(&mut self, label: TextLabel) {
        if !label.text.is_empty() {
            self.elements.push(DrawingElement::Label(label));
        }
    }

    /// Adds a label unless it is empty.
    pub fn draw_label(
        &mut self,
        at: DVec2,
        text: &str,
        size: f64,
        anchor: TextAnchor,
        color: Color,
    ) {
        self.add_label(TextLabel {
            position: at,
            text: text.into(),
            size,
            anchor,
            color,
            rotated: false,
        });
    }

    /// Adds a label that is vertically centered at `at`.
    pub fn draw_centered_label(
        &mut self,
        at: DVec2,
        text: &str,
        size: f64,
        anchor: TextAnchor,
        color: Color,
    ) {
        let base = at + DVec2::new(0.0, HALF_CAPITAL_HEIGHT * size);
        self.draw_label(base, text, size, anchor, color);
    }

    /// Adds a label that reads from bottom to top.
    pub fn draw_rotated_label(&mut self, at: DVec2, text: &str, size: f64, color: Color) {
        self.add_label(TextLabel {
            position: at,
            text: text.into(),
            size,
            anchor: TextAnchor::Middle,
            color,
            rotated: true,
        });
    }
}

pub fn polyline_path(points: &[DVec2]) -> DrawingPath {
    let mut path: DrawingPath = points.iter().map(|&point| PathStep::Line(point)).collect();
    if let Some(first) = points.first() {
        path[0] = PathStep::Move(*first);
    }
    path
}

pub fn polygon_path(corners: &[DVec2]) -> DrawingPath {
    let mut path = polyline_path(corners);
    path.push(PathStep::Close);
    path
}

pub fn rectangle_path(corner: DVec2, size: DVec2) -> DrawingPath {
    polygon_path(&[
        corner,
        corner + DVec2::new(size.x, 0.0),
        corner + size,
        corner + DVec2::new(0.0, size.y),
    ])
}

pub fn circle_path(center: DVec2, radius: f64) -> DrawingPath {
    /// Control points of a quarter circle lie this far along its tangents.
    const QUARTER_CIRCLE_TANGENT: f64 = 0.552_284_749_8;
    let point = |x: f64, y: f64| center + radius * DVec2::new(x, y);
    let q = QUARTER_CIRCLE_TANGENT;
    vec![
        PathStep::Move(point(1.0, 0.0)),
        PathStep::Cubic(point(1.0, q), point(q, 1.0), point(0.0, 1.0)),
        PathStep::Cubic(point(-q, 1.0), point(-1.0, q), point(-1.0, 0.0)),
        PathStep::Cubic(point(-1.0, -q), point(-q, -1.0), point(0.0, -1.0)),
        PathStep::Cubic(point(q, -1.0), point(1.0, -q), point(1.0, 0.0)),
        PathStep::Close,
    ]
}

/// Sizes of a page, in pixels.
pub struct PageSizes {
    pub width: f64,
    pub left_margin: f64,
    pub right_margin: f64,
    /// Margins to the left and right of panels without labels.
    pub side_margin: f64,
    /// Base lines of the title and of the notes below it.
    pub title_base_line: f64,
    pub notes_base_line: f64,
    /// Height of the header, below which panels may begin.
    pub header: f64,
    /// Room above a panel, for its title, and below, for its axis.
    pub panel_title: f64,
    pub panel_axis: f64,
    /// Margin below the last panel.
    pub bottom_margin: f64,
}

pub const PAGE: PageSizes = PageSizes {
    width: 900.0,
    left_margin: 64.0,
    right_margin: 22.0,
    side_margin: 22.0,
    title_base_line: 38.0,
    notes_base_line: 60.0,
    header: 74.0,
    panel_title: 24.0,
    panel_axis: 48.0,
    bottom_margin: 4.0,
};

/// Sizes of letters, in pixels: of a page's title, of text, and of the labels of ticks and points.
pub struct FontSizes {
    pub title: f64,
    pub text: f64,
    pub tick: f64,
}

pub const FONT_SIZE: FontSizes = FontSizes {
    title: 19.0,
    text: 12.0,
    tick: 10.5,
};

#[derive(Clone, Copy)]
pub struct PageRectangle {
    pub corner: DVec2,
    pub size: DVec2,
}

impl PageRectangle {
    pub fn new(corner: DVec2, size: DVec2) -> Self {
        PageRectangle { corner, size }
    }

    /// A panel across the page that leaves this width on the right for a key.
    pub fn left_of_legend(top: f64, height: f64, key: f64) -> Self {
        PageRectangle::new(
            DVec2::new(PAGE.left_margin, top),
            DVec2::new(
                PAGE.width - PAGE.left_margin - PAGE.right_margin - key,
                height,
            ),
        )
    }

    pub fn opposite_corner(&self) -> DVec2 {
        self.corner + self.size
    }

    /// Of the four points at this inset from its corners, the one farthest from all points
    /// `taken`.
    pub fn emptiest_corner(&self, inset: DVec2, taken: impl Iterator<Item = DVec2>) -> DVec2 {
        let (low, high) = (self.corner + inset, self.opposite_corner() - inset);
        let places = [low.with_x(high.x), low, high, high.with_x(low.x)];
        let mut free = [f64::INFINITY; 4];
        for point in taken {
            for (free, place) in free.iter_mut().zip(places) {
                *free = free.min(place.distance_squared(point));
            }
        }
        // The first of equally free ones, up to rounding.
        let freer = |k: usize, best: usize| free[k] > (1.0 + 1e-9) * free[best];
        places[(0..4).fold(0, |best, k| if freer(k, best) { k } else { best })]
    }

    pub fn middle(&self) -> DVec2 {
        self.corner + 0.5 * self.size
    }

    /// The ends of the line from left to right through its middle.
    pub fn midline(&self) -> [DVec2; 2] {
        let half = DVec2::new(0.5 * self.size.x, 0.0);
        [self.middle() - half, self.middle() + half]
    }

    pub fn draw_midline(&self, page: &mut Drawing, stroke: Stroke) {
        let [from, to] = self.midline();
        page.draw_line(from, to, stroke);
    }
}

/// From the letter of a panel to its text, in pixels.
const LETTER_WIDTH: f64 = 24.0;

/// A panel's title: its letter, and a text in a color.
#[derive(Clone, Copy)]
pub struct PanelCaption<'t> {
    pub letter: &'t str,
    pub text: &'t str,
    pub color: Color,
}

impl PanelCaption<'_> {
    /// Draws the title above the frame whose upper left corner is given.
    pub fn draw(self, page: &mut Drawing, corner: DVec2) {
        let base = corner - DVec2::new(0.0, 8.0);
        let mut label = |at: DVec2, text: &str, color: Color| {
            page.draw_label(at, text, FONT_SIZE.text, TextAnchor::Start, color);
        };
        label(base, self.letter, TEXT_COLOR);
        label(base + DVec2::new(LETTER_WIDTH, 0.0), self.text, self.color);
    }

    /// The room for its text above a panel, in a row of panels that are this far apart.
    pub fn text_room(pitch: f64) -> f64 {
        pitch - LETTER_WIDTH - FONT_SIZE.text
    }
}

/// Draws a panel's title above its frame.
pub fn draw_panel_title(page: &mut Drawing, corner: DVec2, letter: &str, text: &str) {
    let color = NOTE_COLOR;
    PanelCaption {
        letter,
        text,
        color,
    }
    .draw(page, corner);
}

/// Letters of panels: `(a)`, `(b)`, ...
pub fn panel_letters() -> impl Iterator<Item = String> + Clone {
    (b'a'..=b'z').map(|letter| format!("({})", char::from(letter)))
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Color(pub u8, pub u8, pub u8);

pub const WHITE: Color = Color(255, 255, 255);

pub const TEXT_COLOR: Color = Color(32, 32, 36);

pub const NOTE_COLOR: Color = Color(84, 84, 92);

pub const FRAME_COLOR: Color = Color(120, 120, 128);

pub const GRID_COLOR: Color = Color(226, 227, 232);

/// The floor of the panel in space.
pub const FLOOR_COLOR: Color = Color(247, 247, 249);

/// Shadows of veins on the floor of the panel in space.
pub const SHADOW_COLOR: Color = Color(212, 213, 220);

pub const SECOND_SOLUTION_COLOR: Color = Color(213, 60, 30);

/// Colors that the color-blind can distinguish, too (after Okabe and Ito).
pub const BLUE: Color = Color(0, 114, 178);

pub const SKY: Color = Color(86, 170, 225);

pub const GREEN: Color = Color(0, 158, 115);

pub const VERMILION: Color = Color(213, 94, 0);

pub const PURPLE: Color = Color(170, 90, 150);

pub const ORANGE: Color = Color(230, 159, 0);

const BROWN: Color = Color(120, 80, 45);

pub const SLATE: Color = Color(60, 60, 66);

/// Colors of the curves in one panel, in this order.
pub const CURVE_COLORS: [Color; 8] = [BLUE, GREEN, VERMILION, PURPLE, ORANGE, SKY, BROWN, SLATE];

/// Viridis (Smith and van der Walt, matplotlib), equally spaced.
const VIRIDIS_COLORS: [Color; 11] = [
    Color(68, 1, 84),
    Color(72, 36, 117),
    Color(65, 68, 135),
    Color(53, 95, 141),
    Color(42, 120, 142),
    Color(33, 145, 140),
    Color(34, 168, 132),
    Color(68, 191, 112),
    Color(122, 209, 81),
    Color(189, 223, 38),
    Color(253, 231, 37),
];

/// The bright end of viridis is left out: thin yellow lines vanish on white.
const BRIGHTEST_VIRIDIS_FRACTION: f64 = 0.88;

/// The color of a vein: `t` runs from 0 at one edge of the leaf to 1 at the other.
pub fn vein_color(t: f64) -> Color {
    let place = BRIGHTEST_VIRIDIS_FRACTION * t.clamp(0.0, 1.0) * (VIRIDIS_COLORS.len() - 1) as f64;
    let left = (place as usize).min(VIRIDIS_COLORS.len() - 2);
    let (a, b) = (VIRIDIS_COLORS[left], VIRIDIS_COLORS[left + 1]);
    let mix = |a: u8, b: u8| {
        let (a, b) = (f64::from(a), f64::from(b));
        (a + (place - left as f64) * (b - a)).round() as u8
    };
    Color(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}

/// The color of one of `count` veins.
pub fn color_of_vein(index: usize, count: usize) -> Color {
    match count {
        0 | 1 => vein_color(0.3),
        _ => vein_color(index as f64 / (count - 1) as f64),
    }
}

/// Length in pixels of the straight pieces of which a curve is drawn, and the most pieces between
/// two of its points.
const PIECE_LENGTH: f64 = 5.0;

const MOST_PIECES_BETWEEN_POINTS: usize = 24;

/// The tangent at a point of a curve is at most so many times as long as the chord on its other side.
const LONGEST_SWING: f64 = 2.0;

/// A curve through these points as straight pieces: for every point but the last those that lead
/// from it to the next. Between two points it is a cubic with the tangents of parabolas through
/// three points each, over the lengths of the chords. Where the chords turn back the curve has a
/// corner.
pub fn smooth_curve(points: &[DVec2]) -> Vec<Vec<DVec2>> {
    let chords: Vec<DVec2> = points.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let slope = |k: usize| chords[k].normalize_or_zero();
    let length = |k: usize| chords[k].length();
    // At both ends of chord `k`.
    let inner = |before: usize, after: usize| {
        let (a, b) = (length(before), length(after));
        if a == 0.0 || b == 0.0 || slope(before).dot(slope(after)) <= 0.0 {
            return None;
        }
        Some((b * slope(before) + a * slope(after)) / (a + b))
    };
    let tangents = |k: usize| {
        let start = k.checked_sub(1).and_then(|before| inner(before, k));
        let end = (k + 1 < chords.len()).then(|| inner(k, k + 1)).flatten();
        // Of a parabola, at whose other end the tangent is known.
        let other = |known: Option<DVec2>| known.map_or(slope(k), |it| 2.0 * slope(k) - it);
        [start.unwrap_or(other(end)), end.unwrap_or(other(start))]
    };
    (0..chords.len())
        .map(|k| {
            // A long chord does not swing out by the slope of a short one beside it, nor where it begins or ends a curve.
            let beside = [k.checked_sub(1), Some(k + 1).filter(|k| *k < chords.len())];
            let most = beside.map(|k| k.map(|k| LONGEST_SWING * length(k)));
            let most = [most[0].or(most[1]), most[1].or(most[0])];
            let [from, to] = [0, 1]
                .map(|end| length(k).min(most[end].unwrap_or(f64::INFINITY)) * tangents(k)[end]);
            let (a, b) = (points[k], points[k + 1]);
            let count =
                ((length(k) / PIECE_LENGTH).ceil() as usize).clamp(1, MOST_PIECES_BETWEEN_POINTS);
            let at = |i: usize| {
                let t = i as f64 / count as f64;
                let s = 1.0 - t;
                // Hermite's cubics.
                a * (s * s * (1.0 + 2.0 * t)) + b * (t * t * (1.0 + 2.0 * s)) + from * (t * s * s)
                    - to * (t * t * s)
            };
            let inside = (1..count).map(at);
            [a].into_iter().chain(inside).chain([b]).collect()
        })
        .collect()
}

/// Points farther away than this many lengths are diverged and not drawn.
const FARTHEST_DRAWN_DISTANCE: f64 = 1e4;

/// Whether a point, in lengths, is finite and not too far away to be drawn.
pub fn is_drawable(point: DVec3) -> bool {
    point.is_finite() && point.abs().max_element() < FARTHEST_DRAWN_DISTANCE
}

/// The points of a curve through nodes at these stations from one fraction of its length to another,
/// or at one.
pub fn curve_between_fractions(
    stations: &[f64],
    curve: &[DVec3],
    [from, to]: [f64; 2],
) -> Vec<DVec3> {
    let nodes = || stations.iter().copied().zip(curve.iter().copied());
    let at = |sigma: f64| {
        let before = nodes().take_while(|(at, _)| *at <= sigma).last();
        let after = nodes().find(|(at, _)| *at >= sigma);
        match (before, after) {
            (Some((a, x)), Some((b, y))) if b > a => Some(x.lerp(y, (sigma - a) / (b - a))),
            (one, other) => one.or(other).map(|(_, x)| x),
        }
    };
    let inside = nodes().filter(|(at, _)| from < *at && *at < to);
    let end = if to > from { at(to) } else { None };
    at(from)
        .into_iter()
        .chain(inside.map(|(_, x)| x))
        .chain(end)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deviations of the curve through points of a circle are of the third order in their distance.
    #[test]
    fn a_circle_is_drawn_round() {
        let worst = |count: usize| {
            let angle = |k: usize| std::f64::consts::PI * k as f64 / count as f64;
            let points: Vec<DVec2> = (0..=count)
                .map(|k| 200.0 * DVec2::from_angle(angle(k)))
                .collect();
            let drawn = smooth_curve(&points);
            let off = drawn.iter().flatten().map(|it| (it.length() - 200.0).abs());
            off.fold(0.0, f64::max)
        };
        let off = [8, 16, 32].map(worst);
        assert!(
            off[0] < 1.5 && off[1] < off[0] / 7.0 && off[2] < off[1] / 7.0,
            "{off:?}"
        );
    }

    /// A flat chord of 100 beside a steep one of 10 swings out by a few, and not by 22.
    #[test]
    fn uneven_points_do_not_swing_out() {
        let points =
            [[0.0, 0.0], [100.0, 0.0], [101.0, 10.0], [101.5, 30.0]].map(DVec2::from_array);
        let drawn = smooth_curve(&points);
        let lowest = drawn.iter().flatten().map(|it| it.y).fold(0.0, f64::min);
        assert!(lowest > -6.0, "{lowest}");
    }

    #[test]
    fn corners_and_repeated_points_stay() {
        let back = [[0.0, 0.0], [10.0, 0.0], [0.0, 1.0]].map(DVec2::from_array);
        let drawn = smooth_curve(&back);
        assert_eq!(drawn.len(), 2);
        assert!(drawn[0].iter().all(|it| it.y == 0.0 && it.x <= 10.0));
        let twice = [DVec2::X, DVec2::X, 2.0 * DVec2::X];
        assert!(
            smooth_curve(&twice)
                .iter()
                .flatten()
                .all(|it| it.is_finite() && it.y == 0.0)
        );
        assert!(smooth_curve(&[]).is_empty() && smooth_curve(&[DVec2::X]).is_empty());
    }
}

#[cfg(test)]
mod curve_tests {
    use super::*;

    #[test]
    fn a_stretch_ends_between_nodes() {
        let (stations, curve) = ([0.0, 0.5, 1.0], [0.0, 1.0, 3.0].map(|x| x * DVec3::X));
        let of = |at| -> Vec<f64> {
            let points = curve_between_fractions(&stations, &curve, at).into_iter();
            points.map(|point| point.x).collect()
        };
        assert_eq!(of([0.25, 0.75]), [0.5, 1.0, 2.0]);
        assert_eq!(of([0.5, 1.0]), [1.0, 3.0]);
        assert_eq!(of([0.75, 0.75]), [2.0]);
        assert_eq!(of([1.0, 1.0]), [3.0]);
        assert!(curve_between_fractions(&[], &[], [0.5, 1.0]).is_empty());
    }
}
