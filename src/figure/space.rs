//! The panel in space: a parallel projection of the leaf in a box, with its shadow
//! on the floor.

use super::kit::*;

/// The direction from which the box is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// From above one of its edges.
    Oblique,
    /// Along the xi axis, from a little above.
    Front,
}

impl View {
    /// Azimuth from the xi axis and elevation above the floor, in degrees.
    fn angles(self) -> [f64; 2] {
        match self {
            View::Oblique => [-55.0, 28.0],
            View::Front => [-8.0, 12.0],
        }
    }
}

/// No side of the box is shorter than this fraction of the longest.
const SHORTEST_SIDE: f64 = 0.4;
/// Padding around the leaf, as a fraction of its largest extent.
const PADDING: f64 = 0.06;

/// Margins around the box, for the labels of its axes.
#[derive(Clone, Copy)]
pub struct Margins {
    pub left: f64,
    pub right: f64,
    pub below: f64,
}

/// Least distance between the ticks of an axis.
const TICK_DISTANCE: f64 = 30.0;

/// From the top of a vertical edge to its name.
const ABOVE: DVec2 = DVec2::new(6.0, -12.0);

/// A box around all of these shapes.
pub fn common_box<'a>(shapes: impl Iterator<Item = &'a Veins>) -> [DVec3; 2] {
    let boxes = shapes.map(|veins| (veins.low, veins.high));
    let all = boxes.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let (low, high) = all.unwrap_or_default();
    surrounding_box(low, high)
}

/// The box with padding around it, and no side too short.
pub fn surrounding_box(low: DVec3, high: DVec3) -> [DVec3; 2] {
    let extent = (high - low).max_element();
    let padding = DVec3::splat(PADDING * if extent > 1e-9 { extent } else { 1.0 });
    let (low, high) = (low - padding, high + padding);
    let middle = 0.5 * (low + high);
    let sides = high - low;
    let half = 0.5 * sides.max(DVec3::splat(SHORTEST_SIDE * sides.max_element()));
    [middle - half, middle + half]
}

/// A parallel projection, centred in a cell.
pub struct Camera {
    right: DVec3,
    up: DVec3,
    toward: DVec3,
    /// Pixels per length.
    pub scale: f64,
    /// The origin on the page.
    origin: DVec2,
}

impl Camera {
    /// Shows the whole box in a cell with these margins.
    pub fn facing([low, high]: [DVec3; 2], view: View, cell: Cell, margins: Margins) -> Self {
        let [(sin_a, cos_a), (sin_e, cos_e)] =
            view.angles().map(|angle| angle.to_radians().sin_cos());
        let mut camera = Camera {
            right: DVec3::new(-sin_a, cos_a, 0.0),
            up: DVec3::new(-sin_e * cos_a, -sin_e * sin_a, cos_e),
            toward: DVec3::new(cos_e * cos_a, cos_e * sin_a, sin_e),
            scale: 1.0,
            origin: DVec2::ZERO,
        };
        let (first, last) = camera.outline([low, high]);
        let free = cell.size - DVec2::new(margins.left + margins.right, margins.below);
        camera.scale = (free / (last - first)).min_element();
        let shift = DVec2::new(margins.left - margins.right, -margins.below);
        let middle = cell.corner + 0.5 * cell.size + 0.5 * shift;
        camera.origin = middle - camera.scale * 0.5 * (first + last);
        camera
    }

    /// Corners of the bounding rectangle of a box on the page.
    pub fn outline(&self, [low, high]: [DVec3; 2]) -> (DVec2, DVec2) {
        let corners = (0..8).map(|corner| {
            let side = |axis: usize| [low, high][corner >> axis & 1][axis];
            self.place(DVec3::new(side(0), side(1), side(2)))
        });
        let none = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        corners.fold(none, |(first, last), at| (first.min(at), last.max(at)))
    }

    fn place(&self, point: DVec3) -> DVec2 {
        let flat = DVec2::new(self.right.dot(point), -self.up.dot(point));
        self.origin + self.scale * flat
    }
}

/// One axis along an edge of the box.
struct Edge {
    axis: usize,
    direction: DVec3,
    at: DVec3,
    low: f64,
    high: f64,
    /// Away from the box, in the plane the labels lie in.
    outward: DVec3,
    /// Offsets from a point on the edge along its grid lines: to the corner between the two
    /// walls, and to the end of the second.
    walls: [DVec3; 2],
    /// Displayed value between ticks, and that of a length of 1.
    step: f64,
    unit: f64,
}

impl Edge {
    fn point(&self, value: f64) -> DVec3 {
        self.at + (value - self.at.dot(self.direction)) * self.direction
    }

    fn ticks(&self) -> Vec<(f64, String)> {
        let inset = 0.02 * (self.high - self.low);
        let ends = [self.low + inset, self.high - inset].map(|end| self.unit * end);
        let found = multiples(ends[0], ends[1], self.step).into_iter();
        found
            .map(|(value, text)| (value / self.unit, text))
            .collect()
    }
}

/// Edges along the three axes, with ticks spaced by `step` or, without it, as close as is
/// readable.
fn edges(camera: &Camera, low: DVec3, high: DVec3, unit: f64, step: Option<f64>) -> [Edge; 3] {
    let sides = high - low;
    let edge = |axis, direction: DVec3, at, outward, walls| Edge {
        axis,
        direction,
        at,
        low: direction.dot(low),
        high: direction.dot(high),
        outward,
        walls,
        step: step.unwrap_or_else(|| {
            let length = camera.place(direction).distance(camera.place(DVec3::ZERO));
            round_step(unit * TICK_DISTANCE / length)
        }),
        unit,
    };
    let side = |axis: DVec3| sides * axis;
    let (back, up, left) = (side(DVec3::Y), side(DVec3::Z), side(DVec3::NEG_X));
    let walls = [[back, back + up], [left, left + up], [back, back - left]];
    [
        edge(0, DVec3::X, low, DVec3::NEG_Y, walls[0]),
        edge(1, DVec3::Y, low.with_x(high.x), DVec3::X, walls[1]),
        edge(2, DVec3::Z, low, -camera.right, walls[2]),
    ]
}

pub struct Scene {
    low: DVec3,
    high: DVec3,
    camera: Camera,
    edges: [Edge; 3],
    setting: Setting,
    cell: Cell,
}

impl Scene {
    /// The box in a cell with these margins; its grid is spaced by `step` or, without it,
    /// as close as is readable.
    pub fn new(
        [low, high]: [DVec3; 2],
        setting: &Setting,
        view: View,
        cell: Cell,
        margins: Margins,
        step: Option<f64>,
    ) -> Self {
        let camera = Camera::facing([low, high], view, cell, margins);
        let edges = edges(&camera, low, high, setting.scale(), step);
        Scene {
            low,
            high,
            camera,
            edges,
            setting: setting.clone(),
            cell,
        }
    }

    pub fn place(&self, point: DVec3) -> DVec2 {
        self.camera.place(point)
    }

    /// Draws the floor, the two walls behind the leaf, and their grid.
    pub fn draw_box(&self, page: &mut Drawing) {
        let (low, high) = (self.low, self.high);
        // Seen from large xi and small eta, the walls at small xi and large eta are
        // behind the leaf.
        let near = DVec3::new(high.x, low.y, low.z);
        let far = DVec3::new(low.x, high.y, low.z);
        let right = near.with_y(high.y);
        let floor = [low, near, right, far].map(|corner| self.place(corner));
        page.shape(polygon(&floor), FLOOR, None);
        for edge in &self.edges {
            for (value, _) in edge.ticks() {
                let start = edge.point(value);
                let line = [start, start + edge.walls[0], start + edge.walls[1]];
                let line = line.map(|point| self.place(point));
                page.stroke(polyline(&line), Stroke::new(GRID, 0.7));
            }
        }
        let top = |corner: DVec3| corner.with_z(high.z);
        for (from, to) in [
            (low, near),
            (near, right),
            (low, top(low)),
            (far, right),
            (far, low),
            (far, top(far)),
            (top(low), top(far)),
            (top(far), high),
            (right, high),
        ] {
            page.line(self.place(from), self.place(to), Stroke::new(FRAME, 0.8));
        }
    }

    pub fn draw_labels(&self, page: &mut Drawing) {
        for edge in &self.edges {
            let out = self.outward(edge);
            for (value, text) in edge.ticks() {
                let foot = self.place(edge.point(value));
                page.line(foot, foot + 4.0 * out, Stroke::new(FRAME, 0.8));
                let at = foot + label_offset(out, 17.0);
                page.centered_label(at, &text, TICK_SIZE, Anchor::Middle, NOTE);
            }
        }
    }

    /// Draws the names of all axes at a distance from their edges, with units if values
    /// are shown.
    pub fn draw_names(&self, page: &mut Drawing, distance: f64, values: bool) {
        for edge in &self.edges {
            let at = self.middle(edge) + label_offset(self.outward(edge), distance);
            let name = self.setting.brief_axis(edge.axis, values);
            // A long name extends away from its edge, or is placed on top of it.
            let (at, anchor) = match edge.axis {
                _ if name.chars().count() < 3 => (at, Anchor::Middle),
                0 => (at, Anchor::End),
                1 => (at, Anchor::Start),
                _ => (self.place(edge.point(edge.high)) + ABOVE, Anchor::End),
            };
            page.centered_label(at, &name, TEXT_SIZE + 1.0, anchor, INK);
        }
    }

    /// Draws the direction of gravity, if there is any, outside the box.
    pub fn draw_gravity(&self, page: &mut Drawing) {
        let Some(gravity) = self.setting.gravity else {
            return;
        };
        let Camera {
            right, up, toward, ..
        } = self.camera;
        let direction = DVec2::new(right.dot(gravity), -up.dot(gravity));
        let ends = [self.low, self.high];
        let corner = |k: usize| DVec3::new(ends[k & 1].x, ends[k >> 1 & 1].y, ends[k >> 2].z);
        let corners = (0..8).map(|k| self.place(corner(k)));
        let names = self.edges.iter().map(|edge| self.middle(edge));
        let toward = toward.dot(gravity) > 0.0;
        draw_gravity(page, self.cell, corners.chain(names), direction, toward);
    }

    /// The middle of an edge on the page.
    fn middle(&self, edge: &Edge) -> DVec2 {
        self.place(edge.point(0.5 * (edge.low + edge.high)))
    }

    /// The outward direction of an edge on the page.
    fn outward(&self, edge: &Edge) -> DVec2 {
        (self.place(edge.outward) - self.place(DVec3::ZERO)).normalize()
    }

    /// Draws the shadows of all veins on the floor, the pieces of the veins, those
    /// farther away first, and the leaf's markers.
    pub fn draw_leaf(&self, page: &mut Drawing, veins: &Veins, width: f64) {
        for vein in &veins.veins {
            let shadow = vein.path(|point| self.place(point.with_z(self.low.z)));
            page.stroke(shadow, Stroke::new(SHADOW, width));
        }
        let depth = |piece: &Piece| self.camera.toward.dot(piece[0] + piece[3]);
        let mut pieces: Vec<(f64, &Piece, &Vein)> = Vec::new();
        for vein in &veins.veins {
            pieces.extend(vein.pieces.iter().map(|piece| (depth(piece), piece, vein)));
        }
        pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, piece, vein) in pieces {
            let [start, a, b, end] = piece.map(|point| self.place(point));
            let path = vec![Step::Move(start), Step::Cubic(a, b, end)];
            page.stroke(path, Stroke::new(vein.color, width));
        }
        leaf_markers(page, veins, |point| self.place(point));
    }
}

/// Where a label is relative to its axis: labels are wider than high and need more distance
/// to the side.
fn label_offset(out: DVec2, distance: f64) -> DVec2 {
    distance * out + DVec2::new(5.0 * out.x, 0.0)
}
