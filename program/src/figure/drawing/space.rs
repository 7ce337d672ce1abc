//! Parallel projections of leaves: flat panels of two axes, and panels in space, alone or many of
//! one scale on a page, with the box around the leaf and its shadow on the floor.

use crate::figure::drawing::axes::{
    Axis, LabelledValue, PanelAxes, multiples_with_text, round_step,
};
use crate::figure::drawing::formats::Font;
use crate::figure::drawing::markers::{ProjectedDirection, draw_direction_arrow};
use crate::figure::drawing::veins::{BezierPiece, DrawnVein, DrawnVeins, draw_leaf_markers};
use crate::figure::drawing::{
    Drawing, FLOOR_COLOR, FONT_SIZE, FRAME_COLOR, GRID_COLOR, NOTE_COLOR, PAGE, PageRectangle,
    PanelCaption, PathStep, SHADOW_COLOR, Stroke, TEXT_COLOR, TextAnchor, polygon_path,
    polyline_path,
};
use crate::figure::scenario::{DirectionArrow, FigureSetting};
use crate::report::numbers::format_four_digits;
use glam::{DVec2, DVec3};

/// The direction from which a box is seen, in degrees: from the xi axis, and above the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewAngles {
    azimuth: f64,
    elevation: f64,
}

/// From the side, and a little from the end at large xi.
const VIEW_FROM_TIP: ViewAngles = ViewAngles {
    azimuth: -59.0,
    elevation: 19.0,
};

/// From the side, and a little from the end at small xi.
const VIEW_FROM_BASE: ViewAngles = ViewAngles {
    azimuth: -121.0,
    elevation: 19.0,
};

/// A tip that is higher or lower than its base by a smaller part of their distance is level with it.
const LEVEL_TIP: f64 = 0.02;

impl ViewAngles {
    /// The oblique view of leaves with these vectors from the base to the tip: hanging tips are drawn
    /// below their bases, and rising ones above.
    ///
    /// A view from above shows what is nearer to the viewer lower on the page: seen from its tip, a leaf
    /// that rises a little seems to hang, and seen from its base, one that hangs a little seems to rise.
    pub fn oblique(tips_from_bases: impl IntoIterator<Item = DVec3>) -> ViewAngles {
        let tip: DVec3 = tips_from_bases.into_iter().sum();
        let shown = ParallelProjection::from_view(VIEW_FROM_TIP).up.dot(tip);
        match tip.z.abs() > LEVEL_TIP * tip.length() && shown * tip.z < 0.0 {
            true => VIEW_FROM_BASE,
            false => VIEW_FROM_TIP,
        }
    }

    /// The oblique view, or that from the front if it shows these shapes farther apart: compared are the
    /// two shapes that look most alike, in parts of what is drawn.
    pub fn telling_apart(shapes: &[DrawnVeins]) -> ViewAngles {
        let oblique = ViewAngles::oblique(shapes.iter().map(DrawnVeins::tip_from_base));
        let bounds = common_bounding_box(shapes.iter());
        let points: Vec<Vec<DVec3>> = shapes.iter().map(compared_points).collect();
        let pairs = || (0..points.len()).flat_map(|i| (0..i).map(move |j| [i, j]));
        let least_distance = |view: ViewAngles| {
            let camera = ParallelProjection::from_view(view);
            let seen = |[i, j]: [usize; 2]| {
                let pairs = points[i].iter().zip(&points[j]);
                let distances = pairs.map(|(a, b)| camera.project_direction(*a - *b).length());
                distances.fold(0.0, f64::max)
            };
            let drawn = camera.projected_extent(bounds).max_element();
            pairs().map(seen).fold(f64::INFINITY, f64::min) / drawn
        };
        match least_distance(FRONT_VIEW) > least_distance(oblique) {
            true => FRONT_VIEW,
            false => oblique,
        }
    }

    /// The unit vector toward the viewer.
    pub fn toward_viewer(self) -> DVec3 {
        ParallelProjection::from_view(self).toward
    }
}

/// Along the xi axis, from a little above.
pub const FRONT_VIEW: ViewAngles = ViewAngles {
    azimuth: -8.0,
    elevation: 6.0,
};

/// Equal parts of each vein at whose ends shapes are compared.
const COMPARED_PARTS_PER_VEIN: usize = 8;

/// No side of the box is shorter than this fraction of the longest.
const SHORTEST_BOX_SIDE: f64 = 0.4;

/// Padding around the leaf, as a fraction of its largest extent.
pub const LEAF_PADDING: f64 = 0.06;

/// Margins around the box, for the labels of its axes.
#[derive(Clone, Copy)]
pub struct BoxMargins {
    pub left: f64,
    pub right: f64,
    pub below: f64,
}

impl BoxMargins {
    /// Pixels that are left to the box, of a cell of this size.
    fn inner_size(self, size: DVec2) -> DVec2 {
        size - DVec2::new(self.left + self.right, self.below)
    }
}

/// Distances of ticks and names along the edges of a box in space, in pixels.
struct EdgeLabels {
    /// Least distance between the ticks of an axis that rises on the page, and of one that is rather level,
    /// along which labels stand beside each other.
    ticks: f64,
    level_ticks: f64,
    /// From a name to the right edge of the page, at least.
    page_edge: f64,
    /// From the edge to the name of its axis, at least, besides half of the widest label.
    name: f64,
    /// From the middle of the edge to the name in a small panel.
    small_panel_name: f64,
    /// From the top of a vertical edge to its name.
    vertical_name: DVec2,
    /// How far a name that does not fit beside the numbers moves down.
    below_ticks: f64,
}

const EDGE_LABELS: EdgeLabels = EdgeLabels {
    ticks: 30.0,
    level_ticks: 46.0,
    page_edge: 6.0,
    name: 25.0,
    small_panel_name: 14.0,
    vertical_name: DVec2::new(6.0, -12.0),
    below_ticks: 16.0,
};

/// A box around all of these shapes.
pub fn common_bounding_box<'a>(shapes: impl Iterator<Item = &'a DrawnVeins>) -> [DVec3; 2] {
    let boxes = shapes.map(|veins| (veins.low, veins.high));
    let all = boxes.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let (low, high) = all.unwrap_or_default();
    padded_box(low, high)
}

/// The box with padding around it, and no side too short.
pub fn padded_box(low: DVec3, high: DVec3) -> [DVec3; 2] {
    let extent = (high - low).max_element();
    let padding = DVec3::splat(LEAF_PADDING * if extent > 1e-9 { extent } else { 1.0 });
    let (low, high) = (low - padding, high + padding);
    let middle = 0.5 * (low + high);
    let sides = high - low;
    let half = 0.5 * sides.max(DVec3::splat(SHORTEST_BOX_SIDE * sides.max_element()));
    [middle - half, middle + half]
}

/// A parallel projection of space onto the page.
pub struct ParallelProjection {
    pub right: DVec3,
    pub up: DVec3,
    pub toward: DVec3,
    /// Pixels per length.
    scale: f64,
    /// Where the origin of space is on the page.
    origin: DVec2,
}

impl ParallelProjection {
    /// The origin is in the corner of the page, and a pixel a length.
    pub fn new(right: DVec3, up: DVec3) -> Self {
        ParallelProjection {
            right,
            up,
            toward: right.cross(up),
            scale: 1.0,
            origin: DVec2::ZERO,
        }
    }

    pub fn from_view(view: ViewAngles) -> Self {
        let (sin_a, cos_a) = view.azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = view.elevation.to_radians().sin_cos();
        let right = DVec3::new(-sin_a, cos_a, 0.0);
        ParallelProjection::new(right, DVec3::new(-sin_e * cos_a, -sin_e * sin_a, cos_e))
    }

    /// Shows a point at a place on the page.
    fn with_point_at(mut self, scale: f64, point: DVec3, at: DVec2) -> Self {
        self.scale = scale;
        self.origin += at - self.project_point(point);
        self
    }

    pub fn project_point(&self, point: DVec3) -> DVec2 {
        self.origin + self.project_direction(point)
    }

    fn project_direction(&self, vector: DVec3) -> DVec2 {
        self.scale * DVec2::new(self.right.dot(vector), -self.up.dot(vector))
    }

    /// Width and height of a box on the page.
    fn projected_extent(&self, bounds: [DVec3; 2]) -> DVec2 {
        let corners = || box_corners(bounds).map(|corner| self.project_point(corner));
        let low = corners().fold(DVec2::INFINITY, DVec2::min);
        corners().fold(DVec2::NEG_INFINITY, DVec2::max) - low
    }

    /// Draws arrows, each in a corner far from `taken` and from the others.
    pub fn draw_arrows(
        &self,
        page: &mut Drawing,
        arrows: &[DirectionArrow],
        cell: PageRectangle,
        taken: impl Iterator<Item = DVec2>,
    ) {
        let mut taken: Vec<DVec2> = taken.collect();
        for DirectionArrow { direction, name } in arrows {
            let direction = ProjectedDirection {
                on_page: self.project_direction(*direction) / self.scale,
                is_toward_viewer: self.toward.dot(*direction) > 0.0,
            };
            let at = draw_direction_arrow(page, cell, &taken, direction, name);
            taken.push(at);
        }
    }
}

fn box_corners(bounds: [DVec3; 2]) -> impl Iterator<Item = DVec3> {
    let side = move |corner: usize, axis: usize| bounds[corner >> axis & 1][axis];
    (0..8).map(move |k| DVec3::new(side(k, 0), side(k, 1), side(k, 2)))
}

/// Points at equal parts of every vein.
fn compared_points(shape: &DrawnVeins) -> Vec<DVec3> {
    let of_vein = |vein: &DrawnVein| {
        let count = vein.pieces.len();
        let end = |k: usize| {
            vein.pieces
                .get((k * count / COMPARED_PARTS_PER_VEIN).max(1) - 1)
        };
        let ends = (1..=COMPARED_PARTS_PER_VEIN).filter_map(|k| Some(end(k)?[3]));
        ends.collect::<Vec<DVec3>>()
    };
    shape.veins.iter().flat_map(of_vein).collect()
}

/// The ends of a box along xi: that nearer to the viewer, and the other.
fn near_and_far_x(camera: &ParallelProjection, low: DVec3, high: DVec3) -> [f64; 2] {
    match camera.toward.x < 0.0 {
        true => [low.x, high.x],
        false => [high.x, low.x],
    }
}

/// An axis along an edge of the box.
struct AxisEdge {
    axis: usize,
    from: DVec3,
    to: DVec3,
    /// Away from the box, on the page.
    outward: DVec2,
    /// Offsets from a point on the edge along its grid lines: to the corner between the two
    /// walls, and to the end of the second.
    grid_line_offsets: [DVec3; 2],
    ticks: Vec<EdgeTick>,
}

/// A tick of an axis in space.
struct EdgeTick {
    point: DVec3,
    text: String,
}

/// A box in space, and the leaf in it.
pub struct SpacePanel<'s> {
    low: DVec3,
    high: DVec3,
    camera: ParallelProjection,
    edges: [AxisEdge; 3],
    setting: &'s FigureSetting,
    cell: PageRectangle,
}

impl<'s> SpacePanel<'s> {
    /// The box in a cell with these margins; its grid is spaced by `step`, in the unit that is
    /// shown, or, without it, as close as is readable.
    pub fn new(
        [low, high]: [DVec3; 2],
        setting: &'s FigureSetting,
        view: ViewAngles,
        cell: PageRectangle,
        margins: BoxMargins,
        step: Option<f64>,
    ) -> Self {
        let camera = ParallelProjection::from_view(view);
        let scale = margins.inner_size(cell.size) / camera.projected_extent([low, high]);
        let shift = DVec2::new(margins.left - margins.right, -margins.below);
        let (middle, at) = (0.5 * (low + high), cell.middle() + 0.5 * shift);
        let camera = camera.with_point_at(scale.min_element(), middle, at);
        let unit = setting.value_per_length();
        let edge = |axis: usize, from: DVec3, outward: DVec3, walls: [DVec3; 2]| {
            let at = |value: f64| from + (value - from[axis]) * DVec3::AXES[axis];
            let step = step.unwrap_or_else(|| {
                let way = camera.project_direction(DVec3::AXES[axis]);
                let apart = match way.x.abs() > way.y.abs() {
                    true => EDGE_LABELS.level_ticks,
                    false => EDGE_LABELS.ticks,
                };
                round_step(unit * apart / way.length())
            });
            let inset = 0.02 * (high - low)[axis];
            let ends = [low[axis] + inset, high[axis] - inset].map(|end| unit * end);
            let ticks = multiples_with_text(ends[0], ends[1], step).into_iter();
            AxisEdge {
                axis,
                from,
                to: at(high[axis]),
                outward: camera.project_direction(outward).normalize(),
                grid_line_offsets: walls,
                ticks: ticks
                    .map(|LabelledValue { value, text }| EdgeTick {
                        point: at(value / unit),
                        text,
                    })
                    .collect(),
            }
        };
        let [x, y, z] = DVec3::AXES.map(|axis| (high - low) * axis);
        let [near_x, far_x] = near_and_far_x(&camera, low, high);
        // From the near side to the far one.
        let inward = x * (far_x - near_x).signum();
        let edges = [
            edge(0, low, DVec3::NEG_Y, [y, y + z]),
            edge(
                1,
                low.with_x(near_x),
                -inward.normalize_or_zero(),
                [inward, z + inward],
            ),
            match near_x > far_x {
                true => edge(2, low, -camera.right, [y, y + x]),
                false => edge(2, low.with_y(high.y), -camera.right, [x, x - y]),
            },
        ];
        SpacePanel {
            low,
            high,
            camera,
            edges,
            setting,
            cell,
        }
    }

    pub fn project_point(&self, point: DVec3) -> DVec2 {
        self.camera.project_point(point)
    }

    /// Draws the floor, the two walls behind the leaf, and their grid.
    pub fn draw_floor_and_walls(&self, page: &mut Drawing) {
        let (low, high) = (self.low, self.high);
        // Seen from small eta, the wall at large eta is behind the leaf, and so is that at the far xi.
        let [near_x, far_x] = near_and_far_x(&self.camera, low, high);
        let near = low.with_x(near_x);
        let side = low.with_x(far_x);
        let behind = near.with_y(high.y);
        let far = side.with_y(high.y);
        let floor = [side, near, behind, far].map(|corner| self.project_point(corner));
        page.draw_shape(polygon_path(&floor), FLOOR_COLOR, None);
        for edge in &self.edges {
            for &EdgeTick { point: start, .. } in &edge.ticks {
                let line = [
                    start,
                    start + edge.grid_line_offsets[0],
                    start + edge.grid_line_offsets[1],
                ];
                let line = line.map(|point| self.project_point(point));
                page.draw_stroke(polyline_path(&line), Stroke::new(GRID_COLOR, 0.7));
            }
        }
        let top = |corner: DVec3| corner.with_z(high.z);
        for (from, to) in [
            (side, near),
            (near, behind),
            (side, top(side)),
            (far, behind),
            (far, side),
            (far, top(far)),
            (top(side), top(far)),
            (top(far), top(behind)),
            (behind, top(behind)),
        ] {
            page.draw_line(
                self.project_point(from),
                self.project_point(to),
                Stroke::new(FRAME_COLOR, 0.8),
            );
        }
    }

    /// Draws the axes with their names at this distance from the edges.
    pub fn draw_axes(&self, page: &mut Drawing, distance: f64) {
        for AxisEdge {
            outward: out,
            ticks,
            ..
        } in &self.edges
        {
            for EdgeTick { point, text } in ticks {
                let foot = self.project_point(*point);
                page.draw_line(foot, foot + 4.0 * *out, Stroke::new(FRAME_COLOR, 0.8));
                let at = foot + label_offset(*out, 17.0);
                page.draw_centered_label(at, text, FONT_SIZE.tick, TextAnchor::Middle, NOTE_COLOR);
            }
        }
        self.draw_axis_names(page, distance, true);
    }

    /// The middles of the edges that have axes.
    fn edge_middles(&self) -> [DVec2; 3] {
        let middle = |edge: &AxisEdge| self.project_point(0.5 * (edge.from + edge.to));
        self.edges.each_ref().map(middle)
    }

    /// Draws the names of all axes at a distance from their edges, with units if values
    /// are shown.
    fn draw_axis_names(&self, page: &mut Drawing, distance: f64, values: bool) {
        for (edge, middle) in self.edges.iter().zip(self.edge_middles()) {
            let widths = edge.ticks.iter();
            let widths = widths.map(|tick| Font::embedded().text_width(&tick.text, FONT_SIZE.tick));
            let beyond = EDGE_LABELS.name + 0.5 * widths.fold(0.0, f64::max);
            let distance = if values {
                distance.max(beyond)
            } else {
                distance
            };
            let at = middle + label_offset(edge.outward, distance);
            let name = self.setting.brief_axis_name(edge.axis, values);
            // A long name extends away from its edge, on the page, or is placed on top of it.
            let size = FONT_SIZE.text + 1.0;
            let least = Font::embedded().text_width(&name, size) + EDGE_LABELS.page_edge;
            let most = page.width - least;
            // Where the page ends it moves below the numbers.
            let shifted = |x: f64| match x == at.x {
                true => at,
                false => DVec2::new(x, at.y + EDGE_LABELS.below_ticks),
            };
            let (at, anchor) = match edge.axis {
                _ if name.chars().count() < 3 => (at, TextAnchor::Middle),
                0 | 1 if edge.outward.x < 0.0 => (shifted(at.x.max(least)), TextAnchor::End),
                0 | 1 => (shifted(at.x.min(most)), TextAnchor::Start),
                _ => (
                    self.project_point(edge.to) + EDGE_LABELS.vertical_name,
                    TextAnchor::End,
                ),
            };
            page.draw_centered_label(at, &name, size, anchor, TEXT_COLOR);
        }
    }

    /// Draws the directions of gravity and of the wind at a time outside the box, or in a panel that
    /// is not the first what may differ from it.
    pub fn draw_direction_arrows(&self, page: &mut Drawing, first: bool, time: f64) {
        let taken = box_corners([self.low, self.high]).map(|corner| self.project_point(corner));
        let names = self.edges.iter().zip(self.edge_middles());
        let names = names.flat_map(|(edge, middle)| {
            [middle, middle + EDGE_LABELS.small_panel_name * edge.outward]
        });
        let taken = taken.chain(names);
        let arrows = self.setting.direction_arrows(first, time);
        self.camera.draw_arrows(page, &arrows, self.cell, taken);
    }

    /// Draws the shadows of all veins on the floor.
    pub fn draw_shadows(&self, page: &mut Drawing, veins: &DrawnVeins, width: f64) {
        for vein in &veins.veins {
            let shadow = vein.projected_path(|point| self.project_point(point.with_z(self.low.z)));
            page.draw_stroke(shadow, Stroke::new(SHADOW_COLOR, width));
        }
    }

    /// Draws the shadows of all veins on the floor, the pieces of the veins, those
    /// farther away first, and the leaf's markers.
    pub fn draw_leaf(&self, page: &mut Drawing, veins: &DrawnVeins, width: f64) {
        self.draw_shadows(page, veins, width);
        let depth = |piece: &BezierPiece| self.camera.toward.dot(piece[0] + piece[3]);
        let mut pieces: Vec<(f64, &BezierPiece, &DrawnVein)> = Vec::new();
        for vein in &veins.veins {
            pieces.extend(vein.pieces.iter().map(|piece| (depth(piece), piece, vein)));
        }
        pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, piece, vein) in pieces {
            let [start, a, b, end] = piece.map(|point| self.project_point(point));
            let path = vec![PathStep::Move(start), PathStep::Cubic(a, b, end)];
            page.draw_stroke(path, Stroke::new(vein.color, width));
        }
        draw_leaf_markers(page, veins, |point| self.project_point(point));
    }
}

/// Where a label is relative to its axis: labels are wider than high and need more distance
/// to the side.
fn label_offset(out: DVec2, distance: f64) -> DVec2 {
    distance * out + DVec2::new(5.0 * out.x, 0.0)
}

/// Least distance between grid lines.
const PLANE_TICK_DISTANCE: f64 = 36.0;

/// A view along one of the three axes: its title, and the axes that point to the right and up.
#[derive(Clone, Copy)]
pub struct PlaneView {
    pub title: &'static str,
    pub axes: [usize; 2],
}

pub const VIEW_FROM_ABOVE: PlaneView = PlaneView {
    title: "from above",
    axes: [0, 1],
};

pub const VIEW_FROM_SIDE: PlaneView = PlaneView {
    title: "from the side",
    axes: [0, 2],
};

pub const VIEW_FROM_FRONT: PlaneView = PlaneView {
    title: "from the front",
    axes: [1, 2],
};

/// Draws a panel of two axes with `scale` pixels per length and this point in its middle; returns how
/// it shows points.
pub fn draw_plane_panel(
    page: &mut Drawing,
    middle: DVec3,
    setting: &FigureSetting,
    cell: PageRectangle,
    scale: f64,
    [across, up]: [usize; 2],
) -> ParallelProjection {
    let camera = ParallelProjection::new(DVec3::AXES[across], DVec3::AXES[up]);
    let camera = camera.with_point_at(scale, middle, cell.middle());
    let shown = setting.value_per_length();
    let axis = |which: usize, pixels: f64| {
        let half = 0.5 * pixels / scale;
        let (low, high) = (middle[which] - half, middle[which] + half);
        Axis {
            tick_spacing: Some(PLANE_TICK_DISTANCE),
            ..Axis::linear(&setting.axis_name(which), shown * low, shown * high)
        }
    };
    let axes = PanelAxes {
        cell,
        across: axis(across, cell.size.x),
        up: axis(up, cell.size.y),
    };
    axes.draw(page);
    camera
}

/// Sizes of small panels, in pixels.
struct SmallPanelSizes {
    columns: usize,
    gap: f64,
    /// Least and largest height.
    lowest: f64,
    highest: f64,
    /// Room below the last row.
    bottom: f64,
    /// Least distance between grid lines.
    grid_spacing: f64,
    margins: BoxMargins,
}

const SMALL_PANEL: SmallPanelSizes = SmallPanelSizes {
    columns: 4,
    gap: 12.0,
    lowest: 110.0,
    highest: 330.0,
    bottom: 10.0,
    grid_spacing: 17.0,
    margins: BoxMargins {
        left: 14.0,
        right: 14.0,
        below: 14.0,
    },
};

/// Factor of the line width of veins in small panels.
pub const SMALL_LINE_WIDTH_FACTOR: f64 = 0.75;

/// Where the panels are, and the box that all of them show.
pub struct SmallPanels<'s> {
    bounds: [DVec3; 2],
    /// From where all of them are seen.
    pub view: ViewAngles,
    setting: &'s FigureSetting,
    /// Displayed width of a square of the grid.
    grid_step: f64,
    size: DVec2,
    top: f64,
    count: usize,
}

impl<'s> SmallPanels<'s> {
    /// `count` panels from `top` on that can hold any of these shapes, in the oblique view of all.
    pub fn fitted_to_shapes<'a>(
        shapes: impl Iterator<Item = &'a DrawnVeins> + Clone,
        count: usize,
        setting: &'s FigureSetting,
        top: f64,
    ) -> Self {
        let view = ViewAngles::oblique(shapes.clone().map(DrawnVeins::tip_from_base));
        SmallPanels::seen_from(view, shapes, count, setting, top)
    }

    /// `count` panels from `top` on that can hold any of these shapes in this view.
    pub fn seen_from<'a>(
        view: ViewAngles,
        shapes: impl Iterator<Item = &'a DrawnVeins>,
        count: usize,
        setting: &'s FigureSetting,
        top: f64,
    ) -> Self {
        let bounds = common_bounding_box(shapes);
        let width = (PAGE.width
            - 2.0 * PAGE.side_margin
            - (SMALL_PANEL.columns - 1) as f64 * SMALL_PANEL.gap)
            / SMALL_PANEL.columns as f64;
        let extent = ParallelProjection::from_view(view).projected_extent(bounds);
        let height = (width - SMALL_PANEL.margins.left - SMALL_PANEL.margins.right) * extent.y
            / extent.x
            + SMALL_PANEL.margins.below;
        let size = DVec2::new(width, height.clamp(SMALL_PANEL.lowest, SMALL_PANEL.highest));
        let scale = (SMALL_PANEL.margins.inner_size(size) / extent).min_element();
        SmallPanels {
            bounds,
            view,
            grid_step: round_step(setting.value_per_length() * SMALL_PANEL.grid_spacing / scale),
            setting,
            size,
            top,
            count,
        }
    }

    /// Formats the width of a square of the grid.
    pub fn grid_width(&self) -> String {
        format!(
            "{} {}",
            format_four_digits(self.grid_step),
            self.setting.length_unit()
        )
    }

    fn panel_rectangle(&self, index: usize) -> PageRectangle {
        let place = DVec2::new(
            (index % SMALL_PANEL.columns) as f64,
            (index / SMALL_PANEL.columns) as f64,
        );
        let pitch = self.size + DVec2::new(SMALL_PANEL.gap, PAGE.panel_title + SMALL_PANEL.gap);
        PageRectangle::new(
            DVec2::new(PAGE.side_margin, self.top + PAGE.panel_title) + place * pitch,
            self.size,
        )
    }

    pub fn bottom(&self) -> f64 {
        let rows = self.count.div_ceil(SMALL_PANEL.columns).max(1);
        let row = PAGE.panel_title + self.size.y + SMALL_PANEL.gap;
        (self.top + rows as f64 * row + SMALL_PANEL.bottom).ceil()
    }

    /// Draws a leaf with its letter and title in its panel.
    pub fn draw_leaf(
        &self,
        page: &mut Drawing,
        index: usize,
        veins: &DrawnVeins,
        caption: [&str; 2],
    ) {
        let [letter, text] = caption;
        let caption = PanelCaption {
            letter,
            text,
            color: NOTE_COLOR,
        };
        let scene = self.draw_empty_panel(page, index, 0.0, self.view, caption);
        scene.draw_leaf(page, veins, SMALL_LINE_WIDTH_FACTOR * veins.line_width());
    }

    /// Draws a panel in which a leaf can be drawn, by its number and time, with its letter and a
    /// title in a color. The first also shows the names of the axes and gravity, and each the wind
    /// if that changes.
    pub fn draw_empty_panel(
        &self,
        page: &mut Drawing,
        index: usize,
        time: f64,
        view: ViewAngles,
        caption: PanelCaption,
    ) -> SpacePanel<'s> {
        let cell = self.panel_rectangle(index);
        let room = PanelCaption::text_room(cell.size.x + SMALL_PANEL.gap);
        let text = Font::embedded().shorten_text(caption.text, FONT_SIZE.text, room);
        let caption = PanelCaption {
            text: &text,
            ..caption
        };
        caption.draw(page, cell.corner);
        let (bounds, setting, step) = (self.bounds, self.setting, Some(self.grid_step));
        let scene = SpacePanel::new(bounds, setting, view, cell, SMALL_PANEL.margins, step);
        scene.draw_floor_and_walls(page);
        if index == 0 {
            scene.draw_axis_names(page, 9.0, false);
        }
        scene.draw_direction_arrows(page, index == 0, time);
        scene
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn tips_below_their_bases_are_drawn_below_them_and_higher_ones_above() {
        let heights = [-2.0, -0.5, -0.15, -0.03, 0.03, 0.15, 0.5, 2.0];
        for (x, y) in [
            (1.0, 0.0),
            (1.0, 0.05),
            (0.9, -0.1),
            (-0.5, 0.0),
            (0.0, 0.1),
        ] {
            for z in heights {
                let tip = DVec3::new(x, y, z);
                let camera = ParallelProjection::from_view(ViewAngles::oblique([tip]));
                let below = camera.project_point(tip).y - camera.project_point(DVec3::ZERO).y;
                assert!(below * z < 0.0, "{tip} is drawn {below} below its base");
            }
        }
        // What is level, or not a number, has the usual view.
        for tip in [
            DVec3::X,
            DVec3::new(1.0, 0.0, 1e-9),
            DVec3::NAN,
            DVec3::ZERO,
        ] {
            assert_eq!(ViewAngles::oblique([tip]), VIEW_FROM_TIP);
        }
    }

    #[test]
    fn shapes_that_differ_across_are_seen_from_the_front() {
        let shape = |[y, z]: [f64; 2]| {
            let curve: Vec<DVec3> = (0..=8)
                .map(|k| DVec3::new(f64::from(k) / 8.0, 0.0, 0.0))
                .chain([DVec3::new(1.1, y, z)])
                .collect();
            DrawnVeins::from_curves(std::slice::from_ref(&curve), &curve[9..], 1.0)
        };
        let across = [[0.1, 0.0], [-0.1, 0.0], [0.0, 0.1]].map(shape);
        assert_eq!(ViewAngles::telling_apart(&across), FRONT_VIEW);
        // A single shape has nothing from which it is to be told apart.
        let one = ViewAngles::telling_apart(&across[..1]);
        assert_eq!(one, VIEW_FROM_TIP);
    }

    #[test]
    fn walls_are_behind_the_leaf_and_its_axes_before_it() {
        let setting = FigureSetting::from_scenario(&sample::sample_scenario("fan", 3));
        let cell = PageRectangle::new(DVec2::ZERO, DVec2::splat(400.0));
        for view in [VIEW_FROM_TIP, VIEW_FROM_BASE, FRONT_VIEW] {
            let bounds = [DVec3::ZERO, DVec3::ONE];
            let margins = SMALL_PANEL.margins;
            let scene = SpacePanel::new(bounds, &setting, view, cell, margins, None);
            let toward = scene.camera.toward;
            let middle = toward.dot(DVec3::splat(0.5));
            let [xi, eta, zeta] = &scene.edges;
            for edge in [xi, eta] {
                assert!(toward.dot(0.5 * (edge.from + edge.to)) > middle, "{view:?}");
            }
            let left = scene.project_point(zeta.from).x;
            let corners = box_corners(bounds).map(|corner| scene.project_point(corner).x);
            assert!(
                (left - corners.fold(f64::INFINITY, f64::min)).abs() < 1e-9,
                "{view:?}"
            );
            // Grid lines end on a wall: at the far xi or at large eta.
            for edge in &scene.edges {
                let end = edge.from + edge.grid_line_offsets[1];
                let inside = end.cmpge(DVec3::splat(-1e-9)) & end.cmple(DVec3::splat(1.0 + 1e-9));
                let corner = edge.axis != 2 || toward.dot(end) < toward.dot(zeta.from);
                assert!(
                    inside.all() && corner || edge.axis == 2,
                    "{view:?} {}",
                    edge.axis
                );
            }
        }
    }
}
