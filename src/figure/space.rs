//! The panel in space: seen from far away, with parallel rays, in a box whose
//! floor catches the leaf's shadow.

use glam::{DVec2, DVec3};

use super::drawing::{
    Anchor, Drawing, FLOOR, FRAME, GRID, INK, NOTE, SHADOW, Step, Stroke, polygon, polyline,
};
use super::gravity;
use super::markers::leaf_markers;
use super::page::{Cell, TEXT_SIZE, TICK_SIZE};
use super::round::{multiples, round_step};
use super::setting::Setting;
use super::veins::{Piece, Vein, Veins};

/// From where the box is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// From above one of its edges.
    Oblique,
    /// Along the xi axis, from a little above.
    Front,
}

impl View {
    /// Degrees from the xi axis, and above the floor.
    fn angles(self) -> [f64; 2] {
        match self {
            View::Oblique => [-55.0, 28.0],
            View::Front => [-8.0, 12.0],
        }
    }
}

/// No side of the box is shorter than this part of its longest.
const SHORTEST_SIDE: f64 = 0.4;
/// Air around the leaf, as a fraction of its largest extent.
const AIR: f64 = 0.06;

/// Room around the box, for the labels of its axes.
#[derive(Clone, Copy)]
pub struct Room {
    pub left: f64,
    pub right: f64,
    pub below: f64,
}

/// Distance between the ticks of an axis at least.
const TICK_DISTANCE: f64 = 30.0;

/// From the top of an upright edge to its name.
const ABOVE: DVec2 = DVec2::new(6.0, -12.0);

/// The leaf with air around it, no side too short to see.
pub fn surrounding_box(low: DVec3, high: DVec3) -> [DVec3; 2] {
    let extent = (high - low).max_element();
    let air = DVec3::splat(AIR * if extent > 1e-9 { extent } else { 1.0 });
    let (low, high) = (low - air, high + air);
    let middle = 0.5 * (low + high);
    let sides = high - low;
    let half = 0.5 * sides.max(DVec3::splat(SHORTEST_SIDE * sides.max_element()));
    [middle - half, middle + half]
}

/// A view with parallel rays, centred in a cell.
pub struct Camera {
    right: DVec3,
    up: DVec3,
    toward: DVec3,
    /// Pixels per length.
    pub scale: f64,
    /// Where the origin is on the page.
    origin: DVec2,
}

impl Camera {
    /// Sees the whole box in a cell that also has room for labels.
    pub fn facing([low, high]: [DVec3; 2], view: View, cell: Cell, room: Room) -> Self {
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
        let free = cell.size - DVec2::new(room.left + room.right, room.below);
        camera.scale = (free / (last - first)).min_element();
        let shift = DVec2::new(room.left - room.right, -room.below);
        let middle = cell.corner + 0.5 * cell.size + 0.5 * shift;
        camera.origin = middle - camera.scale * 0.5 * (first + last);
        camera
    }

    /// Corners of the rectangle on the page that holds a box.
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
    /// Where the two walls on which its grid lines run end.
    walls: [DVec3; 2],
    /// Between ticks, as they are shown, and what is shown for a length of 1.
    step: f64,
    shown: f64,
}

impl Edge {
    fn point(&self, value: f64) -> DVec3 {
        self.at + (value - self.at.dot(self.direction)) * self.direction
    }

    fn ticks(&self) -> Vec<(f64, String)> {
        let room = 0.02 * (self.high - self.low);
        let ends = [self.low + room, self.high - room].map(|end| self.shown * end);
        let found = multiples(ends[0], ends[1], self.step).into_iter();
        found
            .map(|(value, text)| (value / self.shown, text))
            .collect()
    }
}

/// Edges along the three axes, each with ticks this far apart or, without a
/// step, as fine as can be read.
fn edges(camera: &Camera, low: DVec3, high: DVec3, shown: f64, step: Option<f64>) -> [Edge; 3] {
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
            let seen = camera.place(direction).distance(camera.place(DVec3::ZERO));
            round_step(shown * TICK_DISTANCE / seen)
        }),
        shown,
    };
    let side = |axis: DVec3| sides * axis;
    let (behind, up, left) = (side(DVec3::Y), side(DVec3::Z), side(DVec3::NEG_X));
    let walls = [
        [behind, behind + up],
        [left, left + up],
        [behind, behind - left],
    ];
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
    /// The box in a cell with room for labels; its grid is so wide or, without
    /// a step, as fine as can be read.
    pub fn new(
        [low, high]: [DVec3; 2],
        setting: &Setting,
        view: View,
        cell: Cell,
        room: Room,
        step: Option<f64>,
    ) -> Self {
        let camera = Camera::facing([low, high], view, cell, room);
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

    /// The floor, the two walls behind the leaf, and their grid.
    pub fn draw_box(&self, page: &mut Drawing) {
        let (low, high) = (self.low, self.high);
        // The viewer stands at large xi and small eta: the walls at small xi and
        // large eta are behind the leaf.
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
                let at = foot + away(out, 17.0);
                page.beside(at, &text, TICK_SIZE, Anchor::Middle, NOTE);
            }
        }
    }

    /// Names all axes, so far from their edges; with units if values stand there.
    pub fn draw_names(&self, page: &mut Drawing, distance: f64, values: bool) {
        for edge in &self.edges {
            let middle = self.place(edge.point(0.5 * (edge.low + edge.high)));
            let at = middle + away(self.outward(edge), distance);
            let name = self.setting.brief_axis(edge.axis, values);
            // A long name reaches away from its edge, or stands on top of it.
            let (at, anchor) = match edge.axis {
                _ if name.chars().count() < 3 => (at, Anchor::Middle),
                0 => (at, Anchor::End),
                1 => (at, Anchor::Start),
                _ => (self.place(edge.point(edge.high)) + ABOVE, Anchor::End),
            };
            page.beside(at, &name, TEXT_SIZE + 1.0, anchor, INK);
        }
    }

    /// Draws the direction of gravity, if there is any, beside the box.
    pub fn draw_gravity(&self, page: &mut Drawing) {
        let Some(gravity) = self.setting.gravity else {
            return;
        };
        let Camera {
            right, up, toward, ..
        } = self.camera;
        let way = DVec2::new(right.dot(gravity), -up.dot(gravity));
        let ends = [self.low, self.high];
        let corner = |k: usize| DVec3::new(ends[k & 1].x, ends[k >> 1 & 1].y, ends[k >> 2].z);
        let corners = (0..8).map(|k| self.place(corner(k)));
        let named = self
            .edges
            .iter()
            .map(|edge| self.place(edge.point(0.5 * (edge.low + edge.high))));
        gravity::draw(
            page,
            self.cell,
            corners.chain(named),
            way,
            toward.dot(gravity) > 0.0,
        );
    }

    /// Away from the box, on the page.
    fn outward(&self, edge: &Edge) -> DVec2 {
        (self.place(edge.outward) - self.place(DVec3::ZERO)).normalize()
    }

    /// The shadow of all veins on the floor, the veins piece by piece, those
    /// farther away first, and the leaf's markers.
    pub fn draw_leaf(&self, page: &mut Drawing, veins: &Veins, width: f64) {
        for vein in &veins.veins {
            let shadow = vein.path(|point| self.place(point.with_z(self.low.z)));
            page.stroke(shadow, Stroke::new(SHADOW, width));
        }
        let pieces = veins
            .veins
            .iter()
            .flat_map(|vein| vein.pieces.iter().map(move |p| (p, vein)));
        let depth = |piece: &Piece| self.camera.toward.dot(piece[0] + piece[3]);
        let pieces = pieces.map(|(piece, vein)| (depth(piece), piece, vein));
        let mut pieces: Vec<(f64, &Piece, &Vein)> = pieces.collect();
        pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, piece, vein) in pieces {
            let [start, a, b, end] = piece.map(|point| self.place(point));
            let path = vec![Step::Move(start), Step::Cubic(a, b, end)];
            page.stroke(path, Stroke::new(vein.color, width));
        }
        leaf_markers(page, veins, |point| self.place(point));
    }
}

/// Labels are wider than high: those beside an axis stand farther away.
fn away(out: DVec2, distance: f64) -> DVec2 {
    distance * out + DVec2::new(5.0 * out.x, 0.0)
}
