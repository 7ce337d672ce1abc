//! A leaf at rest, and all equilibria of a leaf.
//!
//! The four panels of a leaf: along each axis, and in space.
//!
//! The three flat panels have one scale and are placed as in a technical drawing:
//! the side view below the top view with the same xi axis, the front view to the
//! right of the side view with the same zeta axis.
//!
//! Veins as smooth curves, in units of the largest rod length.

use crate::figure::drawing::axes::{Axis, PanelAxes};
use crate::figure::drawing::labels::{
    HEADER, PAGE_LEFT_MARGIN, PAGE_RIGHT_MARGIN, PANEL_AXIS_HEIGHT, PANEL_TITLE_HEIGHT,
    PageRectangle, SIDE_MARGIN, SmallPanels, TICK_FONT_SIZE, WIDTH, draw_panel_title, new_page,
};
use crate::figure::drawing::markers::{MomentArrow, draw_leaf_markers, moment_arrows};
use crate::figure::drawing::space::{
    BoxMargins, OBLIQUE_VIEW, ParallelProjection, SpacePanel, padded_box,
};
use crate::figure::drawing::{
    Color, Drawing, DrawingPath, PathStep, Stroke, color_of_vein, curve_between_fractions,
    is_drawable,
};
use crate::figure::rod;
use crate::figure::scenario::{FigureSetting, LoadMark, ParsedKey, load_marks, support_marks};
use crate::report::numbers::format_error_bound;
use crate::report::{relaxation_verdict, shooting_method_name, stability_phrase};
use glam::{DVec2, DVec3};
use leafdyn::relax::{Equilibrium, RodShape};
use leafdyn::scenario::{Scenario, SupportKind};
use leafdyn::simulate::{Record, ShapeSnapshot};
use leafdyn::study::Equilibria;

pub fn draw(leaf: &Equilibrium, scenario: &Scenario) -> Drawing {
    let setting = FigureSetting::from_scenario(scenario);
    let veins = DrawnVeins::from_equilibrium(leaf, scenario);
    let notes = header_notes(leaf, &veins, &setting);
    let mut drawing = match veins.count {
        1 => rod::draw(leaf, scenario, &veins, &setting, &notes),
        _ => {
            let panels = LeafPanels::placed_below(HEADER, &veins);
            let mut drawing = new_page(PAGE_LEFT_MARGIN, &leaf.scenario, &notes, Some(&veins));
            drawing.height = panels.bottom().ceil();
            panels.draw(&mut drawing, &veins, &setting);
            drawing
        }
    };
    drawing.description = format!("{}: {}", leaf.scenario, relaxation_verdict(leaf));
    drawing
}

fn header_notes(
    equilibrium: &Equilibrium,
    veins: &DrawnVeins,
    setting: &FigureSetting,
) -> Vec<String> {
    let mut notes = vec![
        format!("N = {}", veins.count),
        relaxation_verdict(equilibrium),
    ];
    match equilibrium.accuracy.intervals {
        Some(count) => notes.push(format!("by {}", shooting_method_name(count))),
        None if equilibrium.method.is_shooting() => {
            notes.push("shown is how far shooting came".into());
        }
        None => (),
    }
    if let Some(error) = equilibrium.accuracy.error_estimate {
        let error = format_error_bound(setting.value_per_length() * (error / veins.unit));
        notes.push(format!(
            "error of positions ≤ {error} {}",
            setting.length_unit()
        ));
    }
    notes.extend(veins.leaf_notes(setting));
    notes
}

/// Most equilibria drawn.
const MOST_EQUILIBRIA_DRAWN: usize = 24;

pub fn draw_equilibria(all: &Equilibria, scenario: &Scenario) -> Drawing {
    let setting = FigureSetting::from_scenario(scenario);
    let shown = &all.found[..all.found.len().min(MOST_EQUILIBRIA_DRAWN)];
    let shapes = shown
        .iter()
        .map(|found| DrawnVeins::from_equilibrium(&found.equilibrium, scenario));
    let shapes: Vec<DrawnVeins> = shapes.collect();
    let panels = SmallPanels::fitted_to_shapes(shapes.iter(), shown.len(), &setting, HEADER);
    let name = format!("{}: equilibria, lowest energy first", all.scenario);
    let count = all.found.len();
    let mut notes = vec![format!("{count} found from {} starts", all.starts)];
    if count > MOST_EQUILIBRIA_DRAWN {
        notes.push(format!("the first {MOST_EQUILIBRIA_DRAWN} drawn"));
    }
    let mut drawing = new_page(SIDE_MARGIN, &name, &notes, shapes.first());
    drawing.height = panels.bottom();
    for (index, (found, veins)) in shown.iter().zip(&shapes).enumerate() {
        let negative = found.equilibrium.stability.negative_eigenvalues;
        let stability = negative.map_or(String::new(), stability_phrase);
        let energy = found.equilibrium.energy.unwrap_or(f64::NAN);
        let text = format!("energy {energy:.7}, {stability}");
        drawing.draw_group("leaf", |page| {
            panels.draw_leaf(page, index, veins, [&(index + 1).to_string(), &text]);
        });
    }
    drawing
}

const BOTTOM: f64 = 4.0;

/// Between the columns, for the right one's axis.
const COLUMN_GAP: f64 = 74.0;

const COLUMNS_WIDTH: f64 = WIDTH - PAGE_LEFT_MARGIN - PAGE_RIGHT_MARGIN - COLUMN_GAP;

/// Panels are at least this large, however flat the leaf is.
const LEAST_COLUMN_WIDTH: f64 = 340.0;

const LEAST_TOP_HEIGHT: f64 = 270.0;

const MIN_BOTTOM_ROW_HEIGHT: f64 = 130.0;

/// Both rows together are at most this high, however tall the leaf is.
const LARGEST_ROWS_HEIGHT: f64 = 800.0;

/// Padding around the leaf, as a fraction of its largest extent.
const PADDING: f64 = 0.06;

/// Least distance between grid lines.
const TICK_DISTANCE: f64 = 36.0;

/// The flat panels: names of their groups, letters, titles, and the two axes.
const PLANE_PANELS: [(&str, &str, &str, [usize; 2]); 3] = [
    ("top", "(a)", "from above", [0, 1]),
    ("side", "(b)", "from the side", [0, 2]),
    ("front", "(c)", "from the front", [1, 2]),
];

/// Of the panel in space.
const MARGINS: BoxMargins = BoxMargins {
    left: 56.0,
    right: 22.0,
    below: 36.0,
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
            tick_spacing: Some(TICK_DISTANCE),
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

/// Draws the projection of the leaf onto two axes, centred.
fn draw_plane_projection(
    page: &mut Drawing,
    veins: &DrawnVeins,
    setting: &FigureSetting,
    cell: PageRectangle,
    scale: f64,
    axes: [usize; 2],
) {
    let middle = 0.5 * (veins.low + veins.high);
    let camera = draw_plane_panel(page, middle, setting, cell, scale, axes);
    let place = |point: DVec3| camera.project_point(point);
    // Veins farther from the viewer first.
    let nearness = |vein: &DrawnVein| {
        let ends = vein.pieces.iter().map(|piece| camera.toward.dot(piece[3]));
        ends.sum::<f64>() / vein.pieces.len().max(1) as f64
    };
    let mut order: Vec<&DrawnVein> = veins.veins.iter().collect();
    order.sort_by(|a, b| nearness(a).total_cmp(&nearness(b)));
    for vein in order {
        let stroke = Stroke::new(vein.color, veins.line_width());
        page.draw_stroke(vein.projected_path(place), stroke);
    }
    draw_leaf_markers(page, veins, place);
    let arrows = setting.direction_arrows(true, 0.0);
    camera.draw_arrows(page, &arrows, cell, veins.piece_ends().map(place));
}

/// Starts and lengths of columns and rows, and the pixels per length of the
/// flat panels.
pub struct LeafPanels {
    columns: [(f64, f64); 2],
    rows: [(f64, f64); 2],
    scale: f64,
}

impl LeafPanels {
    /// The panels of these veins, placed below `start`.
    pub fn placed_below(start: f64, veins: &DrawnVeins) -> Self {
        let DVec3 { x, y, z } =
            veins.high - veins.low + DVec3::splat(2.0 * PADDING * veins.largest_extent());
        // The largest scale that lets every panel hold the leaf.
        let scale = [
            COLUMNS_WIDTH / (x + y),
            (COLUMNS_WIDTH - LEAST_COLUMN_WIDTH) / x.max(y),
            LARGEST_ROWS_HEIGHT / (y + z),
            (LARGEST_ROWS_HEIGHT - MIN_BOTTOM_ROW_HEIGHT) / y,
            (LARGEST_ROWS_HEIGHT - LEAST_TOP_HEIGHT) / z,
        ]
        .into_iter()
        .fold(f64::INFINITY, f64::min);

        let widths = [x, y].map(|extent| (scale * extent).max(LEAST_COLUMN_WIDTH));
        let spare = COLUMNS_WIDTH - widths[0] - widths[1];
        let widths = widths.map(|width| width + 0.5 * spare);
        let heights = [
            (scale * y).max(LEAST_TOP_HEIGHT),
            (scale * z).max(MIN_BOTTOM_ROW_HEIGHT),
        ];
        let top = start + PANEL_TITLE_HEIGHT;
        let bottom = top + heights[0] + PANEL_AXIS_HEIGHT + PANEL_TITLE_HEIGHT;
        LeafPanels {
            columns: [
                (PAGE_LEFT_MARGIN, widths[0]),
                (PAGE_LEFT_MARGIN + widths[0] + COLUMN_GAP, widths[1]),
            ],
            rows: [(top, heights[0]), (bottom, heights[1])],
            scale,
        }
    }

    pub fn bottom(&self) -> f64 {
        self.rows[1].0 + self.rows[1].1 + PANEL_AXIS_HEIGHT + BOTTOM
    }

    pub fn draw(&self, drawing: &mut Drawing, veins: &DrawnVeins, setting: &FigureSetting) {
        let [left, right] = self.columns;
        let [top, bottom] = self.rows;
        let cell = |column: (f64, f64), row: (f64, f64)| {
            PageRectangle::new(DVec2::new(column.0, row.0), DVec2::new(column.1, row.1))
        };
        let cells = [(left, top), (left, bottom), (right, bottom)];
        for ((name, letter, text, axes), (column, row)) in PLANE_PANELS.into_iter().zip(cells) {
            let cell = cell(column, row);
            drawing.draw_group(name, |page| {
                draw_panel_title(page, cell.corner, letter, text);
                draw_plane_projection(page, veins, setting, cell, self.scale, axes);
            });
        }
        // The panel in space has no axis on its left: it takes half of the gap.
        let shift = 0.5 * COLUMN_GAP;
        let cell = cell(
            (right.0 - shift, right.1 + shift),
            (top.0, top.1 + PANEL_AXIS_HEIGHT - TICK_FONT_SIZE),
        );
        drawing.draw_group("space", |page| {
            let bounds = padded_box(veins.low, veins.high);
            let scene = SpacePanel::new(bounds, setting, OBLIQUE_VIEW, cell, MARGINS, None);
            draw_panel_title(page, cell.corner, "(d)", "in space");
            scene.draw_box(page);
            scene.draw_axes(page, 38.0);
            scene.draw_direction_arrows(page, true, 0.0);
            scene.draw_leaf(page, veins, veins.line_width());
        });
    }
}

/// Of a wider leaf only some veins are drawn: more could not be distinguished.
const MOST_VEINS_DRAWN: usize = 200;

/// Largest distance of a drawn curve from the computed points, in lengths: a
/// quarter of a pixel.
const LARGEST_CURVE_DEVIATION: f64 = 3e-4;

/// Curves are drawn with at least this many pieces, if they have as many segments.
const FEWEST_PIECES_PER_CURVE: usize = 8;

/// Dots of a second solution: about the most veins with dots, about the most dots in
/// total, dots per extent of the leaf, and the fewest on a vein that has as many nodes.
const MOST_VEINS_DOTTED: usize = 24;

const MOST_DOTS: usize = 160;

const DOTS_PER_EXTENT: f64 = 14.0;

const FEWEST_DOTS: usize = 8;

pub type BezierPiece = [DVec3; 4];

pub struct DrawnVein {
    pub pieces: Vec<BezierPiece>,
    pub color: Color,
}

impl DrawnVein {
    pub fn projected_path(&self, place: impl Fn(DVec3) -> DVec2) -> DrawingPath {
        let start = self
            .pieces
            .first()
            .map(|piece| PathStep::Move(place(piece[0])));
        let pieces = self.pieces.iter();
        let rest = pieces.map(|&[_, a, b, end]| PathStep::Cubic(place(a), place(b), place(end)));
        start.into_iter().chain(rest).collect()
    }
}

/// A stretch of a vein, or a point, that a grip holds.
pub struct GrippedStretch {
    pub points: Vec<DVec3>,
    pub support: SupportKind,
}

pub struct DrawnVeins {
    pub veins: Vec<DrawnVein>,
    pub count: usize,
    pub dots: Vec<DVec3>,
    pub tips: Vec<(DVec3, Color)>,
    /// How the bases are held, and the tips if they are.
    pub base_support: SupportKind,
    pub tip_support: Option<SupportKind>,
    pub grips: Vec<GrippedStretch>,
    pub moments: Vec<MomentArrow>,
    /// Corners of the bounding box.
    pub low: DVec3,
    pub high: DVec3,
    /// The largest rod length, in the scenario's units.
    pub unit: f64,
}

impl DrawnVeins {
    pub fn from_equilibrium(equilibrium: &Equilibrium, scenario: &Scenario) -> Self {
        let shape = &equilibrium.shape;
        let veins = DrawnVeins::from_curves(&shape.curves, &equilibrium.tips, shape.longest());
        let nodes = (&shape.curve_stations[..], &shape.curves[..]);
        veins
            .with_supports(scenario)
            .with_loads(scenario, &load_marks(scenario, None), nodes)
    }

    /// Where the veins that are drawn begin.
    pub fn bases(&self) -> impl Iterator<Item = DVec3> {
        let first = |vein: &DrawnVein| vein.pieces.first().map_or(DVec3::ZERO, |piece| piece[0]);
        self.veins.iter().map(first)
    }

    /// The veins of a moving leaf at one instant.
    pub fn from_motion(record: &Record, still: &ShapeSnapshot, scenario: &Scenario) -> Self {
        let tips = vein_tips(&still.curves, record.joined);
        let veins = DrawnVeins::from_curves(&still.curves, &tips, record.length);
        let time = record.moments.get(still.moment).map_or(0.0, |it| it.time);
        let loads = load_marks(scenario, Some(time));
        veins.with_supports(scenario).with_loads(
            scenario,
            &loads,
            (&record.stations, &still.curves),
        )
    }

    /// With what the grips of a scenario hold and where moments act, on curves through nodes at these
    /// stations.
    fn with_loads(
        mut self,
        scenario: &Scenario,
        loads: &[LoadMark],
        (stations, curves): (&[f64], &[Vec<DVec3>]),
    ) -> Self {
        self.moments = moment_arrows(loads, |sigma| {
            let point =
                curve_between_fractions(stations, curves.first()?, [sigma; 2]).pop()? / self.unit;
            is_drawable(point).then_some(point)
        });
        let grips = support_marks(scenario).into_iter();
        for grip in grips.filter(|mark| mark.part == ParsedKey::Grip) {
            let curve = curves.get(grip.vein - 1).map_or(&[][..], Vec::as_slice);
            let points = curve_between_fractions(stations, curve, grip.at).into_iter();
            let points = points.map(|point| point / self.unit);
            self.grips.push(GrippedStretch {
                points: points.filter(|&point| is_drawable(point)).collect(),
                support: grip.held,
            });
        }
        self
    }

    /// With bases and tips that are held as in a scenario.
    pub fn with_supports(self, scenario: &Scenario) -> Self {
        let marks = support_marks(scenario);
        let held = |part| {
            let mut of_part = marks.iter().filter(move |mark| mark.part == part);
            of_part.next().map(|mark| mark.held)
        };
        DrawnVeins {
            base_support: held(ParsedKey::Base).unwrap_or(self.base_support),
            tip_support: held(ParsedKey::Tip),
            ..self
        }
    }

    /// Veins through these points, with the longest rod as the unit. Tips are extrapolated,
    /// points need not be.
    pub fn from_curves(curves: &[Vec<DVec3>], tips: &[DVec3], longest: f64) -> Self {
        let usable = longest.is_finite() && longest > 0.0;
        let unit = if usable { longest } else { 1.0 };
        let count = curves.len();
        let drawn = (0..count).filter(|&index| is_vein_drawn(index, count));
        let veins: Vec<DrawnVein> = drawn
            .map(|index| DrawnVein {
                pieces: smooth_vein(&drawable_points(&curves[index], unit)),
                color: color_of_vein(index, count),
            })
            .collect();
        let joined = tips.len() == 1;
        let tips = (0..tips.len())
            .filter(|&index| joined || is_vein_drawn(index, count))
            .map(|index| (tips[index] / unit, color_of_vein(index, count)))
            .filter(|(tip, _)| is_drawable(*tip))
            .collect();

        let pieces = veins.iter().flat_map(|vein| &vein.pieces);
        let (mut low, mut high) = (DVec3::ZERO, DVec3::ZERO);
        for piece in pieces {
            (low, high) = (low.min(piece[3]), high.max(piece[3]));
        }
        DrawnVeins {
            veins,
            count,
            dots: Vec::new(),
            tips,
            base_support: SupportKind::Clamped,
            tip_support: None,
            grips: Vec::new(),
            moments: Vec::new(),
            low,
            high,
            unit,
        }
    }

    /// Adds a second solution as dots, on as many veins and at as many nodes as can be
    /// distinguished.
    pub fn add_second_solution(&mut self, rods: &[RodShape]) {
        let every = self.count.div_ceil(MOST_VEINS_DOTTED).max(1);
        let most = (MOST_DOTS / rods.len().div_ceil(every).max(1)).max(FEWEST_DOTS);
        // A coiled vein is longer than the leaf.
        let lengths = 1.0 / self.largest_extent();
        let wanted = (DOTS_PER_EXTENT * lengths).ceil() as usize;
        let dots = wanted.clamp(FEWEST_DOTS, most);
        for rod in rods.iter().step_by(every) {
            let stride = (rod.nodes.len() - 1).div_ceil(dots).max(1);
            // The base is under the clamp's marker.
            let nodes = rod.nodes.iter().skip(stride).step_by(stride);
            let points = nodes.map(|node| node.position / self.unit);
            self.dots.extend(points.filter(|&point| is_drawable(point)));
        }
        for &point in &self.dots {
            (self.low, self.high) = (self.low.min(point), self.high.max(point));
        }
    }

    pub fn leaf_notes(&self, setting: &FigureSetting) -> Vec<String> {
        let mut notes = vec![format!("L = {}", setting.longest_rod_text())];
        let every = vein_stride(self.count);
        if every > 1 {
            notes.push(format!("1 vein in {every} drawn"));
        }
        match self.moments.as_slice() {
            [] => (),
            [one] => notes.push(format!(
                "curved arrow: moment {}",
                setting.moment_text(one.size)
            )),
            _ => notes.push("curved arrows: moments".into()),
        }
        notes
    }

    /// The ends of all pieces.
    pub fn piece_ends(&self) -> impl Iterator<Item = DVec3> {
        let pieces = self.veins.iter().flat_map(|vein| &vein.pieces);
        pieces.flat_map(|piece| [piece[0], piece[3]])
    }

    /// The largest side of the box, or 1 if it is a point.
    pub fn largest_extent(&self) -> f64 {
        let extent = (self.high - self.low).max_element();
        if extent > 1e-9 { extent } else { 1.0 }
    }

    /// A line width that keeps neighbouring veins apart.
    pub fn line_width(&self) -> f64 {
        match self.veins.len() {
            0..=2 => 2.0,
            3..=8 => 1.7,
            9..=30 => 1.25,
            31..=60 => 0.9,
            61..=120 => 0.65,
            _ => 0.45,
        }
    }
}

fn vein_stride(count: usize) -> usize {
    count.div_ceil(MOST_VEINS_DRAWN).max(1)
}

/// Whether a vein is drawn: of a wide leaf only every n-th vein and the last are.
pub fn is_vein_drawn(index: usize, count: usize) -> bool {
    index.is_multiple_of(vein_stride(count)) || index + 1 == count
}

/// The last point of the first curve if the tips are joined, otherwise of all curves.
pub fn vein_tips(curves: &[Vec<DVec3>], joined: bool) -> Vec<DVec3> {
    let count = if joined { 1 } else { curves.len() };
    let ends = curves.iter().take(count);
    ends.filter_map(|curve| curve.last()).copied().collect()
}

/// The length of the longest of these curves.
pub fn longest_curve<'c>(curves: impl IntoIterator<Item = &'c Vec<DVec3>>) -> f64 {
    let length = |curve: &Vec<DVec3>| curve.windows(2).map(|w| w[0].distance(w[1])).sum();
    curves.into_iter().map(length).fold(0.0, f64::max)
}

/// Points of which those that cannot be drawn repeat the one before; the first is the clamp.
pub fn replace_undrawable_points(points: impl Iterator<Item = DVec3>, longest: f64) -> Vec<DVec3> {
    let mut last = DVec3::ZERO;
    let tame = points.map(|point| {
        if is_drawable(point / longest) {
            last = point;
        }
        last
    });
    tame.collect()
}

/// The smallest stride that leaves a vein of so many nodes its tip and at most so many segments.
pub fn node_stride(nodes: usize, most: usize) -> usize {
    let last = nodes.saturating_sub(1);
    let mut strides = last.div_ceil(most).max(1)..=last;
    let whole = strides.find(|stride| last.is_multiple_of(*stride));
    whole.unwrap_or(1)
}

/// The points up to the first that cannot be drawn.
fn drawable_points(curve: &[DVec3], unit: f64) -> Vec<DVec3> {
    let points = curve.iter().map(|&point| point / unit);
    points.take_while(|&point| is_drawable(point)).collect()
}

/// Smooth pieces through every second, fourth, ... of the points, as long as the curve
/// stays close to the others.
fn smooth_vein(points: &[DVec3]) -> Vec<BezierPiece> {
    let segments = points.len().saturating_sub(1);
    let mut stride = 1;
    while segments.is_multiple_of(2 * stride) && segments / (2 * stride) >= FEWEST_PIECES_PER_CURVE
    {
        stride *= 2;
    }
    loop {
        let kept: Vec<DVec3> = points.iter().copied().step_by(stride).collect();
        let pieces = interpolate_pieces(&kept);
        if stride == 1 || largest_deviation(&pieces, points, stride) < LARGEST_CURVE_DEVIATION {
            return pieces;
        }
        stride /= 2;
    }
}

fn largest_deviation(pieces: &[BezierPiece], points: &[DVec3], stride: usize) -> f64 {
    let deviation = |(index, &point): (usize, &DVec3)| {
        let place = (index / stride).min(pieces.len() - 1);
        let t = index as f64 / stride as f64 - place as f64;
        bezier_point(&pieces[place], t).distance(point)
    };
    points.iter().enumerate().map(deviation).fold(0.0, f64::max)
}

fn bezier_point(piece: &BezierPiece, t: f64) -> DVec3 {
    let [a, b, c, d] = *piece;
    let s = 1.0 - t;
    s * s * s * a + 3.0 * s * s * t * b + 3.0 * s * t * t * c + t * t * t * d
}

/// One piece per segment through equally spaced points, with tangents from
/// differences: of fourth order inside, of second order next to the ends.
fn interpolate_pieces(points: &[DVec3]) -> Vec<BezierPiece> {
    let p = points;
    let last = p.len().saturating_sub(1);
    let tangent = |i: usize| match (i, last) {
        (_, 0) => DVec3::ZERO,
        (_, 1) => p[1] - p[0],
        (0, _) => 2.0 * p[1] - 1.5 * p[0] - 0.5 * p[2],
        (i, _) if i == last => 1.5 * p[i] - 2.0 * p[i - 1] + 0.5 * p[i - 2],
        (i, _) if i == 1 || i + 1 == last => 0.5 * (p[i + 1] - p[i - 1]),
        (i, _) => (8.0 * (p[i + 1] - p[i - 1]) - (p[i + 2] - p[i - 2])) / 12.0,
    };
    let piece = |i: usize| {
        let (start, end) = (tangent(i) / 3.0, tangent(i + 1) / 3.0);
        [p[i], p[i] + start, p[i + 1] - end, p[i + 1]]
    };
    (0..last).map(piece).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn every_extent_fits_its_panel() {
        for size in [
            [1.0, 1.0, 0.2],
            [1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.1, 2.0, 0.0],
            [0.0; 3],
        ] {
            let mut veins = DrawnVeins::from_equilibrium(
                &sample::sample_equilibrium(3, 4),
                &sample::sample_scenario("fan", 3),
            );
            veins.low = DVec3::ZERO;
            veins.high = DVec3::from_array(size);
            let found = LeafPanels::placed_below(0.0, &veins);
            let [left, right] = found.columns.map(|column| column.1 + 1e-9);
            let [top, bottom] = found.rows.map(|row| row.1 + 1e-9);
            let [x, y, z] = size.map(|extent| found.scale * extent);
            let fits = left >= x && right >= y && top >= y && bottom >= z;
            assert!(fits, "{size:?}");
            assert!((left + right - COLUMNS_WIDTH).abs() < 1e-8, "{size:?}");
            assert!(top + bottom <= LARGEST_ROWS_HEIGHT + 1e-8, "{size:?}");
        }
    }
}

#[cfg(test)]
mod veins_tests {
    use crate::report::sample;
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn a_half_circle_is_drawn_round_with_few_pieces() {
        let points: Vec<DVec3> = (0..=256)
            .map(|i| DVec2::from_angle(PI * f64::from(i) / 256.0).extend(0.0) / PI)
            .collect();
        let pieces = smooth_vein(&points);
        assert!(pieces.len() <= 16, "{}", pieces.len());
        for piece in &pieces {
            for t in [0.25, 0.5, 0.75] {
                assert!((bezier_point(piece, t).length() * PI - 1.0).abs() < 2e-3);
            }
        }
    }

    #[test]
    fn curves_of_no_one_and_two_points() {
        assert!(smooth_vein(&[]).is_empty());
        assert!(smooth_vein(&[DVec3::X]).is_empty());
        assert_eq!(smooth_vein(&[DVec3::ZERO, DVec3::X])[0][3], DVec3::X);
    }

    #[test]
    fn a_thinned_vein_keeps_its_tip() {
        for (nodes, kept) in [(65, 33), (33, 33), (61, 31), (2, 2), (1, 1), (0, 1)] {
            let (last, stride) = (f64::max(nodes as f64 - 1.0, 0.0), node_stride(nodes, 32));
            assert_eq!(last / stride as f64 + 1.0, f64::from(kept));
        }
    }

    #[test]
    fn dots_are_few_enough_to_be_distinguished() {
        for (rods, dots) in [(1, 14), (5, 5 * 14), (21, 21 * 8), (200, 23 * 8)] {
            let leaf = sample::sample_equilibrium(rods, 64);
            let mut veins = DrawnVeins::from_equilibrium(
                &leaf,
                &sample::sample_scenario("fan", leaf.shape.rods.len()),
            );
            veins.add_second_solution(&leaf.shape.rods);
            assert!(veins.dots.len() <= dots, "{rods}: {}", veins.dots.len());
            assert!(veins.dots.len() > dots / 2, "{rods}: {}", veins.dots.len());
        }
    }

    #[test]
    fn dots_away_from_the_leaf_are_in_the_box() {
        let leaf = sample::sample_equilibrium(3, 8);
        let mut veins = DrawnVeins::from_equilibrium(
            &leaf,
            &sample::sample_scenario("fan", leaf.shape.rods.len()),
        );
        let mut rods = leaf.shape.rods.clone();
        rods[1].nodes[8].position.z = 3.0;
        veins.add_second_solution(&rods);
        assert_eq!(veins.high.z, 3.0);
    }
}
