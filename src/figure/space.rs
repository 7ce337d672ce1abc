//! The panel in space: seen from far away, with parallel rays, in a box whose
//! floor catches the leaf's shadow.

use glam::{DVec2, DVec3};

use super::colors::{FLOOR, FRAME, GRID, INK, NOTE, SHADOW};
use super::drawing::{Drawing, Step, Stroke, polygon};
use super::flat::{curve, title};
use super::markers::{clamp_marker, dots, tip_markers};
use super::page::{Cell, TEXT_SIZE, TICK_SIZE};
use super::ticks::{round_step, ticks};
use super::veins::{Piece, Vein, Veins};

/// Where the viewer stands: degrees from the xi axis, and above the floor.
const AZIMUTH: f64 = -55.0;
const ELEVATION: f64 = 28.0;

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

const LABELS: Room = Room {
    left: 56.0,
    right: 22.0,
    below: 36.0,
};

/// Distance between the ticks of an axis at least.
const TICK_DISTANCE: f64 = 30.0;

/// Draws the panel into `cell`.
pub fn draw(page: &mut Drawing, veins: &Veins, cell: Cell) {
    let (low, high) = surrounding_box(veins.low, veins.high);
    let camera = Camera::facing(low, high, cell, LABELS);
    title(page, cell.corner, "(d)", "in space");
    let edges = edges(&camera, low, high);
    draw_box(page, &camera, low, high, &edges);
    for edge in &edges {
        draw_labels(page, &camera, edge);
    }
    draw_veins(page, &camera, veins, low.z, veins.line_width());
    dots(page, veins, |point| camera.place(point));
    clamp_marker(page, camera.place(DVec3::ZERO));
    tip_markers(page, veins, |tip| camera.place(tip));
}

/// The leaf with air around it, no side too short to see.
pub fn surrounding_box(low: DVec3, high: DVec3) -> (DVec3, DVec3) {
    let extent = (high - low).max_element();
    let air = DVec3::splat(AIR * if extent > 1e-9 { extent } else { 1.0 });
    let (low, high) = (low - air, high + air);
    let middle = 0.5 * (low + high);
    let sides = high - low;
    let half = 0.5 * sides.max(DVec3::splat(SHORTEST_SIDE * sides.max_element()));
    (middle - half, middle + half)
}

/// A view with parallel rays, centred in a cell.
pub struct Camera {
    right: DVec3,
    up: DVec3,
    toward: DVec3,
    scale: f64,
    /// Where the origin is on the page.
    origin: DVec2,
}

impl Camera {
    /// Sees the whole box in a cell that also has room for labels.
    pub fn facing(low: DVec3, high: DVec3, cell: Cell, room: Room) -> Self {
        let (sin_a, cos_a) = AZIMUTH.to_radians().sin_cos();
        let (sin_e, cos_e) = ELEVATION.to_radians().sin_cos();
        let mut camera = Camera {
            right: DVec3::new(-sin_a, cos_a, 0.0),
            up: DVec3::new(-sin_e * cos_a, -sin_e * sin_a, cos_e),
            toward: DVec3::new(cos_e * cos_a, cos_e * sin_a, sin_e),
            scale: 1.0,
            origin: DVec2::ZERO,
        };
        let (first, last) = camera.outline(low, high);
        let free = cell.size - DVec2::new(room.left + room.right, room.below);
        camera.scale = (free / (last - first)).min_element();
        let middle =
            cell.corner + 0.5 * cell.size + 0.5 * DVec2::new(room.left - room.right, -room.below);
        camera.origin = middle - camera.scale * 0.5 * (first + last);
        camera
    }

    /// Corners of the rectangle on the page that holds a box.
    pub fn outline(&self, low: DVec3, high: DVec3) -> (DVec2, DVec2) {
        let corners = (0..8).map(|corner| {
            let side = |bit: u32, low: f64, high: f64| if corner & bit == 0 { low } else { high };
            let corner = DVec3::new(
                side(1, low.x, high.x),
                side(2, low.y, high.y),
                side(4, low.z, high.z),
            );
            self.place(corner)
        });
        corners.fold(
            (DVec2::INFINITY, DVec2::NEG_INFINITY),
            |(first, last), corner| (first.min(corner), last.max(corner)),
        )
    }

    /// Pixels per length.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// Where a point is on the page.
    pub fn place(&self, point: DVec3) -> DVec2 {
        let flat = DVec2::new(self.right.dot(point), -self.up.dot(point));
        self.origin + self.scale * flat
    }
}

/// One axis along an edge of the box.
pub struct Edge {
    name: &'static str,
    direction: DVec3,
    /// A point of the edge.
    at: DVec3,
    low: f64,
    high: f64,
    /// Between ticks.
    step: f64,
    /// Away from the box, in the plane the labels lie in.
    outward: DVec3,
    /// Where the two walls on which its grid lines run end.
    walls: [DVec3; 2],
}

/// Edges along the three axes, each with ticks as fine as can be read.
fn edges(camera: &Camera, low: DVec3, high: DVec3) -> [Edge; 3] {
    let step = |direction: DVec3| {
        let seen = camera.place(direction).distance(camera.place(DVec3::ZERO));
        round_step(TICK_DISTANCE / seen)
    };
    edges_with(camera, low, high, step)
}

/// Edges with ticks at this distance.
pub fn edges_with(
    camera: &Camera,
    low: DVec3,
    high: DVec3,
    step: impl Fn(DVec3) -> f64,
) -> [Edge; 3] {
    let sides = high - low;
    [
        Edge {
            name: "ξ",
            direction: DVec3::X,
            at: low,
            low: low.x,
            high: high.x,
            step: step(DVec3::X),
            outward: DVec3::NEG_Y,
            walls: [
                DVec3::ZERO.with_y(sides.y),
                DVec3::new(0.0, sides.y, sides.z),
            ],
        },
        Edge {
            name: "η",
            direction: DVec3::Y,
            at: DVec3::new(high.x, low.y, low.z),
            low: low.y,
            high: high.y,
            step: step(DVec3::Y),
            outward: DVec3::X,
            walls: [
                DVec3::ZERO.with_x(-sides.x),
                DVec3::new(-sides.x, 0.0, sides.z),
            ],
        },
        Edge {
            name: "ζ",
            direction: DVec3::Z,
            at: low,
            low: low.z,
            high: high.z,
            step: step(DVec3::Z),
            outward: -camera.right,
            walls: [
                DVec3::ZERO.with_y(sides.y),
                DVec3::new(sides.x, sides.y, 0.0),
            ],
        },
    ]
}

/// The floor, the two walls behind the leaf, and their grid.
pub fn draw_box(page: &mut Drawing, camera: &Camera, low: DVec3, high: DVec3, edges: &[Edge]) {
    // The viewer stands at large xi and small eta: the walls at small xi and
    // large eta are behind the leaf.
    let near = DVec3::new(high.x, low.y, low.z);
    let far = DVec3::new(low.x, high.y, low.z);
    let floor = [low, near, near.with_y(high.y), far];
    page.shape(
        polygon(&floor.map(|corner| camera.place(corner))),
        FLOOR,
        None,
    );
    for edge in edges {
        draw_grid(page, camera, edge);
    }
    let rim = Stroke::new(FRAME, 0.8);
    for (from, to) in [
        (low, near),
        (near, near.with_y(high.y)),
        (low, low.with_z(high.z)),
        (far, near.with_y(high.y)),
        (far, low),
        (far, far.with_z(high.z)),
        (low.with_z(high.z), far.with_z(high.z)),
        (far.with_z(high.z), high),
        (near.with_y(high.y), high),
    ] {
        page.line(camera.place(from), camera.place(to), rim);
    }
}

impl Edge {
    fn point(&self, value: f64) -> DVec3 {
        self.at + (value - self.at.dot(self.direction)) * self.direction
    }

    /// Away from the box, on the page.
    fn outward(&self, camera: &Camera) -> DVec2 {
        (camera.place(self.outward) - camera.place(DVec3::ZERO)).normalize()
    }

    fn ticks(&self) -> Vec<(f64, String)> {
        let room = 0.02 * (self.high - self.low);
        ticks(self.low + room, self.high - room, self.step)
    }
}

fn draw_grid(page: &mut Drawing, camera: &Camera, edge: &Edge) {
    for (value, _) in edge.ticks() {
        let start = edge.point(value);
        let path = [start, start + edge.walls[0], start + edge.walls[1]].map(|p| camera.place(p));
        let [first, second, third] = path;
        let steps = vec![Step::Move(first), Step::Line(second), Step::Line(third)];
        page.stroke(steps, Stroke::new(GRID, 0.7));
    }
}

fn draw_labels(page: &mut Drawing, camera: &Camera, edge: &Edge) {
    let out = edge.outward(camera);
    for (value, text) in edge.ticks() {
        let foot = camera.place(edge.point(value));
        page.line(foot, foot + 4.0 * out, Stroke::new(FRAME, 0.8));
        page.centered(foot + away(out, 17.0), &text, TICK_SIZE, NOTE);
    }
    name(page, camera, edge, 38.0);
}

/// The name of the axis, so far from its edge.
pub fn name(page: &mut Drawing, camera: &Camera, edge: &Edge, distance: f64) {
    let middle = camera.place(edge.point(0.5 * (edge.low + edge.high)));
    let at = middle + away(edge.outward(camera), distance);
    page.centered(at, edge.name, TEXT_SIZE + 1.0, INK);
}

/// Labels are wider than high: those beside an axis stand farther away.
fn away(out: DVec2, distance: f64) -> DVec2 {
    distance * out + DVec2::new(5.0 * out.x, 0.0)
}

/// The shadow of all veins on the floor, and the veins piece by piece, those
/// farther away first.
pub fn draw_veins(page: &mut Drawing, camera: &Camera, veins: &Veins, floor: f64, width: f64) {
    let on_floor = |point: DVec3| camera.place(point.with_z(floor));
    for vein in &veins.veins {
        page.stroke(curve(vein, on_floor), Stroke::new(SHADOW, width));
    }
    let mut pieces: Vec<(f64, &Piece, &Vein)> = veins
        .veins
        .iter()
        .flat_map(|vein| vein.pieces.iter().map(move |piece| (piece, vein)))
        .map(|(piece, vein)| (camera.toward.dot(piece[0] + piece[3]), piece, vein))
        .collect();
    pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, piece, vein) in pieces {
        let [start, a, b, end] = piece.map(|point| camera.place(point));
        let path = vec![Step::Move(start), Step::Cubic(a, b, end)];
        page.stroke(path, Stroke::new(vein.color, width));
    }
}
