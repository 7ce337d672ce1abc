//! The panel in space: a parallel projection of the leaf in a box, with its shadow
//! on the floor.

use crate::figure::drawing::axes::{multiples, round_step};
use crate::figure::drawing::formats::Font;
use crate::figure::drawing::labels::{Cell, TEXT_SIZE, TICK_SIZE};
use crate::figure::drawing::markers::{draw_arrow, leaf_markers};
use crate::figure::drawing::{
    Anchor, Drawing, FLOOR, FRAME, GRID, INK, NOTE, SHADOW, Step, Stroke, polygon, polyline,
};
use crate::figure::leaf::{Piece, Vein, Veins};
use crate::figure::scenario::{Arrow, Setting};
use glam::{DVec2, DVec3};

/// Directions from which the box is seen: azimuth from the xi axis and elevation above the
/// floor, in degrees. From above one of its edges, and along the xi axis from a little above.
pub type View = [f64; 2];

pub const OBLIQUE: View = [-55.0, 28.0];

pub const FRONT: View = [-8.0, 12.0];

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

impl Margins {
    /// Pixels that are left to the box, of a cell of this size.
    pub fn inside(self, size: DVec2) -> DVec2 {
        size - DVec2::new(self.left + self.right, self.below)
    }
}

/// Least distance between the ticks of an axis.
const TICK_DISTANCE: f64 = 30.0;

/// Least distance of a name from the right edge of the page.
const PAGE_EDGE: f64 = 6.0;

/// Least distance of the name of an axis from its edge, besides half of its widest label.
const BEYOND_LABELS: f64 = 25.0;

/// From the middle of an edge to the name of its axis in a small panel.
const NEAR_NAME: f64 = 14.0;

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

/// A parallel projection.
pub struct Camera {
    right: DVec3,
    up: DVec3,
    pub toward: DVec3,
    /// Pixels per length.
    scale: f64,
    /// The origin on the page.
    origin: DVec2,
}

impl Camera {
    /// The origin is in the corner of the page, and a pixel a length.
    pub fn new(right: DVec3, up: DVec3) -> Self {
        Camera {
            right,
            up,
            toward: right.cross(up),
            scale: 1.0,
            origin: DVec2::ZERO,
        }
    }

    pub fn facing(view: View) -> Self {
        let [(sin_a, cos_a), (sin_e, cos_e)] = view.map(|angle| angle.to_radians().sin_cos());
        let right = DVec3::new(-sin_a, cos_a, 0.0);
        Camera::new(right, DVec3::new(-sin_e * cos_a, -sin_e * sin_a, cos_e))
    }

    /// Shows a point at a place on the page.
    pub fn placed(mut self, scale: f64, point: DVec3, at: DVec2) -> Self {
        self.scale = scale;
        self.origin += at - self.place(point);
        self
    }

    pub fn place(&self, point: DVec3) -> DVec2 {
        self.origin + self.turned(point)
    }

    fn turned(&self, vector: DVec3) -> DVec2 {
        self.scale * DVec2::new(self.right.dot(vector), -self.up.dot(vector))
    }

    /// Width and height of a box on the page.
    pub fn extent(&self, bounds: [DVec3; 2]) -> DVec2 {
        let corners = || corners(bounds).map(|corner| self.place(corner));
        let low = corners().fold(DVec2::INFINITY, DVec2::min);
        corners().fold(DVec2::NEG_INFINITY, DVec2::max) - low
    }

    /// Draws arrows, each in a corner far from `taken` and from the others.
    pub fn draw_arrows(
        &self,
        page: &mut Drawing,
        arrows: &[Arrow],
        cell: Cell,
        taken: impl Iterator<Item = DVec2>,
    ) {
        let mut taken: Vec<DVec2> = taken.collect();
        for Arrow { direction, name } in arrows {
            let shown = self.turned(*direction) / self.scale;
            let toward = self.toward.dot(*direction) > 0.0;
            let at = draw_arrow(page, cell, &taken, (shown, toward), name);
            taken.push(at);
        }
    }
}

fn corners(bounds: [DVec3; 2]) -> impl Iterator<Item = DVec3> {
    let side = move |corner: usize, axis: usize| bounds[corner >> axis & 1][axis];
    (0..8).map(move |k| DVec3::new(side(k, 0), side(k, 1), side(k, 2)))
}

/// One axis along an edge of the box.
struct Edge {
    axis: usize,
    from: DVec3,
    to: DVec3,
    /// Away from the box, on the page.
    out: DVec2,
    /// Offsets from a point on the edge along its grid lines: to the corner between the two
    /// walls, and to the end of the second.
    walls: [DVec3; 2],
    ticks: Vec<(DVec3, String)>,
}

/// A box in space, and the leaf in it.
pub struct Scene<'s> {
    low: DVec3,
    high: DVec3,
    camera: Camera,
    edges: [Edge; 3],
    setting: &'s Setting,
    cell: Cell,
}

impl<'s> Scene<'s> {
    /// The box in a cell with these margins; its grid is spaced by `step`, in the unit that is
    /// shown, or, without it, as close as is readable.
    pub fn new(
        [low, high]: [DVec3; 2],
        setting: &'s Setting,
        view: View,
        cell: Cell,
        margins: Margins,
        step: Option<f64>,
    ) -> Self {
        let camera = Camera::facing(view);
        let scale = margins.inside(cell.size) / camera.extent([low, high]);
        let shift = DVec2::new(margins.left - margins.right, -margins.below);
        let (middle, at) = (0.5 * (low + high), cell.middle() + 0.5 * shift);
        let camera = camera.placed(scale.min_element(), middle, at);
        let unit = setting.scale();
        let edge = |axis: usize, from: DVec3, outward: DVec3, walls: [DVec3; 2]| {
            let at = |value: f64| from + (value - from[axis]) * DVec3::AXES[axis];
            let step = step.unwrap_or_else(|| {
                round_step(unit * TICK_DISTANCE / camera.turned(DVec3::AXES[axis]).length())
            });
            let inset = 0.02 * (high - low)[axis];
            let ends = [low[axis] + inset, high[axis] - inset].map(|end| unit * end);
            let ticks = multiples(ends[0], ends[1], step).into_iter();
            Edge {
                axis,
                from,
                to: at(high[axis]),
                out: camera.turned(outward).normalize(),
                walls,
                ticks: ticks
                    .map(|(value, text)| (at(value / unit), text))
                    .collect(),
            }
        };
        let [x, y, z] = DVec3::AXES.map(|axis| (high - low) * axis);
        let edges = [
            edge(0, low, DVec3::NEG_Y, [y, y + z]),
            edge(1, low.with_x(high.x), DVec3::X, [-x, z - x]),
            edge(2, low, -camera.right, [y, y + x]),
        ];
        Scene {
            low,
            high,
            camera,
            edges,
            setting,
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
            for &(start, _) in &edge.ticks {
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

    /// Draws the axes with their names at this distance from the edges.
    pub fn draw_axes(&self, page: &mut Drawing, distance: f64) {
        for Edge { out, ticks, .. } in &self.edges {
            for (point, text) in ticks {
                let foot = self.place(*point);
                page.line(foot, foot + 4.0 * *out, Stroke::new(FRAME, 0.8));
                let at = foot + label_offset(*out, 17.0);
                page.centered_label(at, text, TICK_SIZE, Anchor::Middle, NOTE);
            }
        }
        self.draw_names(page, distance, true);
    }

    /// The middles of the edges that have axes.
    fn middles(&self) -> [DVec2; 3] {
        let middle = |edge: &Edge| self.place(0.5 * (edge.from + edge.to));
        self.edges.each_ref().map(middle)
    }

    /// Draws the names of all axes at a distance from their edges, with units if values
    /// are shown.
    pub fn draw_names(&self, page: &mut Drawing, distance: f64, values: bool) {
        for (edge, middle) in self.edges.iter().zip(self.middles()) {
            let widths = edge.ticks.iter();
            let widths = widths.map(|(_, text)| Font::embedded().width(text, TICK_SIZE));
            let beyond = BEYOND_LABELS + 0.5 * widths.fold(0.0, f64::max);
            let distance = if values {
                distance.max(beyond)
            } else {
                distance
            };
            let at = middle + label_offset(edge.out, distance);
            let name = self.setting.brief_axis(edge.axis, values);
            // A long name extends away from its edge, on the page, or is placed on top of it.
            let size = TEXT_SIZE + 1.0;
            let most = page.width - Font::embedded().width(&name, size) - PAGE_EDGE;
            let (at, anchor) = match edge.axis {
                _ if name.chars().count() < 3 => (at, Anchor::Middle),
                0 => (at, Anchor::End),
                1 => (at.with_x(at.x.min(most)), Anchor::Start),
                _ => (self.place(edge.to) + ABOVE, Anchor::End),
            };
            page.centered_label(at, &name, size, anchor, INK);
        }
    }

    /// Draws the directions of gravity and of the wind at a time outside the box, or in a panel that
    /// is not the first what may differ from it.
    pub fn draw_arrows(&self, page: &mut Drawing, first: bool, time: f64) {
        let taken = corners([self.low, self.high]).map(|corner| self.place(corner));
        let names = self.edges.iter().zip(self.middles());
        let names = names.flat_map(|(edge, middle)| [middle, middle + NEAR_NAME * edge.out]);
        let taken = taken.chain(names);
        let arrows = self.setting.arrows(first, time);
        self.camera.draw_arrows(page, &arrows, self.cell, taken);
    }

    /// Draws the shadows of all veins on the floor.
    pub fn draw_shadows(&self, page: &mut Drawing, veins: &Veins, width: f64) {
        for vein in &veins.veins {
            let shadow = vein.path(|point| self.place(point.with_z(self.low.z)));
            page.stroke(shadow, Stroke::new(SHADOW, width));
        }
    }

    /// Draws the shadows of all veins on the floor, the pieces of the veins, those
    /// farther away first, and the leaf's markers.
    pub fn draw_leaf(&self, page: &mut Drawing, veins: &Veins, width: f64) {
        self.draw_shadows(page, veins, width);
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
