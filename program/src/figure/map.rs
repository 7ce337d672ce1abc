//! A map: one panel per method and one color per outcome or, if waves are shown, per number of waves of
//! stable leaves. Over a single number a panel is a strip, and the results of one method are also drawn as
//! curves below its strip: the tip and the energy or, where waves are shown, waves and twist.

use crate::figure::drawing::axes::{Axis, PanelAxes, TickPlacement};
use crate::figure::drawing::formats::Font;
use crate::figure::drawing::labels::{Legend, LegendRows, draw_header};
use crate::figure::drawing::markers::Marker;
use crate::figure::drawing::{
    CURVE_COLORS, Color, Drawing, FONT_SIZE, NOTE_COLOR, PAGE, PageRectangle, Stroke, TEXT_COLOR,
    TextAnchor, WHITE, circle_path, rectangle_path, vein_color,
};
use crate::figure::scenario::{QuantityLabel, name_with_unit};
use crate::report::map_title;
use glam::DVec2;
use leafdyn::scenario::Units;
use leafdyn::study::{
    Map, MapMethod, MapOutcome, MapRequest, MapRow, MapShow, ParameterSweep, ReferenceConfidence,
    SolverSetting,
};

/// Sizes of the panels of a map over two numbers, in pixels.
struct MapLayout {
    /// Side of a color in the key.
    swatch: f64,
    /// Room below each panel for ticks and, below the last, for the name of the axis.
    ticks: f64,
    axis_name: f64,
    /// Between panels, for the ticks of the right one.
    gap: f64,
    most_columns: usize,
    /// Largest width of a panel, and its height as a part of its width.
    widest: f64,
    aspect_ratio: f64,
    /// Width of a page with one panel.
    single_page: f64,
}

const LAYOUT: MapLayout = MapLayout {
    swatch: 12.0,
    ticks: 26.0,
    axis_name: 26.0,
    gap: 44.0,
    most_columns: 3,
    widest: 470.0,
    aspect_ratio: 0.86,
    single_page: 600.0,
};

const WAVES_EXPLANATION: &str = "Colours and numbers: how often the margins of a stable leaf wave out of its surface, \
    of both the margin that waves more. Two half-waves, between changes of the side to which it bends, are one wave.";

/// Sizes of the strip of a method over one number, and of the curves below a single one, in pixels.
struct StripLayout {
    /// Height of the strip, and of the gap below it.
    height: f64,
    gap: f64,
    /// Room for the name of the method and for its count.
    name: f64,
    count: f64,
    /// Between the strip of a single method and its curves.
    curves_gap: f64,
    /// Heights of panels of several curves, and of one.
    tall_curves: f64,
    low_curve: f64,
}

const STRIP: StripLayout = StripLayout {
    height: 30.0,
    gap: 9.0,
    name: 130.0,
    count: 100.0,
    curves_gap: 12.0,
    tall_curves: 260.0,
    low_curve: 150.0,
};

pub fn draw(map: &Map) -> Drawing {
    let name = &map.request.base.scenario().name;
    let title = format!("{name}: {}", map_title(map.show));
    let width = match (map.request.axes.len(), map.request.methods.len()) {
        (2, 1) => LAYOUT.single_page,
        _ => PAGE.width,
    };
    let mut drawing = Drawing::new(width, &title);
    let mut end = 0.0;
    drawing.draw_group("header", |page| {
        draw_header(page, PAGE.left_margin, &title, &header_notes(map), None);
        end = draw_legend(page, map, PAGE.notes_base_line + 20.0);
        if map.show == MapShow::Waves {
            end = draw_waves_explanation(page, end);
        }
    });
    let axes: Vec<VariedAxis> = (map.request.axes.iter())
        .map(|axis| VariedAxis::from_sweep(axis, &map.request.base.scenario().units))
        .collect();
    drawing.height = match axes.split_first() {
        Some((x, more)) => draw_panels(&mut drawing, map, x, more.first(), end),
        None => end,
    };
    drawing
}

fn header_notes(map: &Map) -> Vec<String> {
    let request = &map.request;
    let (known, confirmed) = map.known_and_confirmed_cells();
    let mut axes = request.axes.iter();
    let mut notes = Vec::new();
    if !axes.any(|axis| axis.keys.to_string() == "leaf.rods") {
        notes.push(format!("N = {}", request.base.scenario().rods.len()));
    }
    notes.push(match request.cells() {
        cells if known < cells => format!("{known} of {cells} cells"),
        _ => format!("{known} cells"),
    });
    notes.push(format!("reference confirmed in {confirmed}"));
    if let Some(segments) = request.base.solver_settings().segments {
        notes.push(format!("{segments} segments a vein"));
    }
    notes
}

/// Draws the key of the outcomes and marks that occur; returns where it ends.
fn draw_legend(page: &mut Drawing, map: &Map, base: f64) -> f64 {
    let mut key = LegendRows::starting_at(PAGE.left_margin, base, LAYOUT.swatch);
    for outcome in MapOutcome::ALL {
        let shown =
            |row: &MapRow| row.outcome == outcome && stable_waves_shown(map.show, row).is_none();
        if map.rows.iter().any(shown) {
            let name = match outcome {
                MapOutcome::Saddle => "saddle, with its index".to_string(),
                outcome => outcome.word().replace('-', " "),
            };
            key.add_entry(page, &name, |page, cell| fill_outcome(page, cell, outcome));
        }
    }
    let counts = map
        .rows
        .iter()
        .filter_map(|row| stable_waves_shown(map.show, row));
    let mut counts: Vec<f64> = counts.collect();
    counts.sort_by(f64::total_cmp);
    counts.dedup();
    for waves in counts {
        let name = match waves {
            0.0 => "stable, no waves".into(),
            1.0 => "1 wave".into(),
            waves => format!("{waves} waves"),
        };
        key.add_entry(page, &name, |page, cell| fill_waves(page, cell, waves));
    }
    for (reference, name) in [
        (ReferenceConfidence::Unconfirmed, "reference unconfirmed"),
        (ReferenceConfidence::None, "no reference"),
    ] {
        if map.rows.iter().any(|row| row.reference == reference) {
            key.add_entry(page, name, |page, cell| {
                mark_unconfirmed_reference(page, cell, reference)
            });
        }
    }
    if has_step_axis(map) {
        key.add_entry(page, "longest step known to be stable", |page, cell| {
            cell.draw_midline(page, STABLE_STEP_STROKE);
        });
    }
    key.bottom()
}

/// Draws the explanation of a map of waves; returns where it ends.
fn draw_waves_explanation(page: &mut Drawing, mut top: f64) -> f64 {
    let room = page.width - PAGE.left_margin - PAGE.right_margin;
    for line in Font::embedded().wrap_text(WAVES_EXPLANATION, FONT_SIZE.tick, room) {
        let base = DVec2::new(PAGE.left_margin, top + FONT_SIZE.tick);
        page.draw_label(base, &line, FONT_SIZE.tick, TextAnchor::Start, NOTE_COLOR);
        top += 1.4 * FONT_SIZE.tick;
    }
    top + 6.0
}

/// Whether explicit motion is shown over an axis of time steps.
fn has_step_axis(map: &Map) -> bool {
    let mut axes = map.request.axes.iter();
    map.request.methods.contains(&MapMethod::ExplicitMotion)
        && axes.any(|axis| axis.keys.contains_solver_setting(SolverSetting::Step))
}

fn outcome_count_text(map: &Map, method: MapMethod) -> String {
    let waving = |row: &&MapRow| row.method == method && row.stable_waves() > Some(0.0);
    let (count, what) = match map.show {
        MapShow::Waves => (map.rows.iter().filter(waving).count(), "wave"),
        MapShow::Outcomes => (map.outcome_count(method, MapOutcome::Right), "right"),
    };
    format!("{count} of {} {what}", map.request.cells())
}

/// Draws a panel for every method or, with one axis, a strip. Returns the height of
/// the page.
fn draw_panels(
    drawing: &mut Drawing,
    map: &Map,
    x: &VariedAxis,
    y: Option<&VariedAxis>,
    start: f64,
) -> f64 {
    let methods = &map.request.methods;
    let columns = y.map_or(1, |_| methods.len().clamp(1, LAYOUT.most_columns));
    let (corner, size, pitch) = match y {
        Some(_) => {
            let left = PAGE.left_margin + 18.0;
            let room = PAGE.width - PAGE.right_margin - left - (columns - 1) as f64 * LAYOUT.gap;
            let width = (room / columns as f64).min(LAYOUT.widest);
            let size = DVec2::new(width, LAYOUT.aspect_ratio * width);
            let pitch = size + DVec2::new(LAYOUT.gap, PAGE.panel_title + LAYOUT.ticks + 6.0);
            (DVec2::new(left, start + PAGE.panel_title), size, pitch)
        }
        None => {
            let left = PAGE.left_margin + STRIP.name;
            let size = DVec2::new(
                PAGE.width - PAGE.right_margin - STRIP.count - left,
                STRIP.height,
            );
            let pitch = DVec2::new(0.0, STRIP.height + STRIP.gap);
            (DVec2::new(left, start + 10.0), size, pitch)
        }
    };
    let mut last = PageRectangle { corner, size };
    for (i, &method) in methods.iter().enumerate() {
        let place = DVec2::new((i % columns) as f64, (i / columns) as f64);
        let cell = PageRectangle::new(corner + place * pitch, size);
        // A single strip has its axis below the curves.
        let labelled = y.is_some() || (i + 1 == methods.len() && i > 0);
        drawing.draw_group(method.word(), |page| {
            draw_method_name(page, map, method, cell, y.is_some());
            let panel = MapPanel::new(cell, x, y, labelled);
            let rows = map.rows.iter().filter(|row| row.method == method);
            panel.draw(page, map.show, rows);
            if method == MapMethod::ExplicitMotion && has_step_axis(map) {
                panel.draw_stable_step(page, &map.request);
            }
        });
        last = cell;
    }
    if let (None, [_]) = (y, methods.as_slice()) {
        return draw_curves(
            drawing,
            map,
            x,
            last,
            last.opposite_corner().y + STRIP.curves_gap,
        );
    }
    let end = last.opposite_corner().y + LAYOUT.ticks;
    let across = columns as f64 * (size.x + LAYOUT.gap) - LAYOUT.gap;
    let below = DVec2::new(corner.x + 0.5 * across, end + 12.0);
    drawing.draw_label(
        below,
        &x.axis.title(),
        FONT_SIZE.text,
        TextAnchor::Middle,
        TEXT_COLOR,
    );
    if let Some(y) = y {
        let middle = DVec2::new(24.0, 0.5 * (corner.y + last.opposite_corner().y));
        drawing.draw_rotated_label(middle, &y.axis.title(), FONT_SIZE.text, TEXT_COLOR);
    }
    end + LAYOUT.axis_name
}

/// Draws a method's name and count, above a panel or to both sides of a strip.
fn draw_method_name(
    page: &mut Drawing,
    map: &Map,
    method: MapMethod,
    cell: PageRectangle,
    above: bool,
) {
    let (name, count) = (method.word(), outcome_count_text(map, method));
    if above {
        let base = cell.corner - DVec2::new(0.0, 8.0);
        page.draw_label(base, name, FONT_SIZE.text, TextAnchor::Start, TEXT_COLOR);
        let base = base.with_x(cell.opposite_corner().x);
        return page.draw_label(base, &count, FONT_SIZE.tick, TextAnchor::End, NOTE_COLOR);
    }
    let [left, right] = cell.midline();
    let gap = DVec2::new(10.0, 0.0);
    page.draw_centered_label(
        left - gap,
        name,
        FONT_SIZE.text,
        TextAnchor::End,
        TEXT_COLOR,
    );
    page.draw_centered_label(
        right + gap,
        &count,
        FONT_SIZE.tick,
        TextAnchor::Start,
        NOTE_COLOR,
    );
}

/// Extent of an axis of values that vary by less, which is rounding.
const ROUNDING_VARIATION: f64 = 1e-9;

/// A curve over the number that varies.
struct CurveOverNumber {
    name: &'static str,
    color: Color,
    value: fn(&MapRow) -> Option<f64>,
}

/// A panel with curves over the number that varies.
struct CurvePanel {
    title: &'static str,
    axis_name: String,
    curves: Vec<CurveOverNumber>,
}

fn curve_panels(map: &Map) -> Vec<CurvePanel> {
    let curve = |name, color: usize, value| CurveOverNumber {
        name,
        color: CURVE_COLORS[color],
        value,
    };
    let units = &map.request.base.scenario().units;
    let length = units.length.as_deref();
    match map.show {
        MapShow::Outcomes => vec![
            CurvePanel {
                title: "where the tip is",
                axis_name: name_with_unit("tip", length),
                curves: vec![
                    curve("x", 0, |row| row.tip_x),
                    curve("y", 1, |row| row.tip_y),
                    curve("z", 2, |row| row.tip_z),
                ],
            },
            CurvePanel {
                title: "energy",
                axis_name: name_with_unit("energy", units.energy().as_deref()),
                curves: vec![curve("energy", 3, |row| row.energy)],
            },
        ],
        MapShow::Waves => vec![
            CurvePanel {
                title: "waves along the margins, of stable leaves",
                axis_name: "waves".into(),
                curves: vec![curve("waves", 0, MapRow::stable_waves)],
            },
            CurvePanel {
                title: "their amplitude",
                axis_name: name_with_unit("amplitude", Some("L")),
                curves: vec![curve("amplitude", 1, |row| {
                    row.stable_waves().and(row.margin_amplitude)
                })],
            },
            CurvePanel {
                title: "mean twist of the veins",
                axis_name: name_with_unit("twist", Some("rad")),
                curves: vec![curve("twist", 3, |row| row.twist)],
            },
        ],
    }
}

/// Draws the curves below `start`, as wide as the strip. Returns where they end.
fn draw_curves(
    page: &mut Drawing,
    map: &Map,
    x: &VariedAxis,
    strip: PageRectangle,
    start: f64,
) -> f64 {
    let values = &map.request.axes[0].values;
    let mut top = start;
    for panel in curve_panels(map) {
        let curves = &panel.curves;
        let height = if curves.len() > 1 {
            STRIP.tall_curves
        } else {
            STRIP.low_curve
        };
        let cell = PageRectangle::new(
            DVec2::new(strip.corner.x, top + PAGE.panel_title),
            DVec2::new(strip.size.x, height),
        );
        let lines = curves.iter().map(|curve| {
            let mut line: Vec<(f64, f64)> = values.iter().map(|&x| (x, f64::NAN)).collect();
            for row in &map.rows {
                line[row.cell].1 = (curve.value)(row).unwrap_or(f64::NAN);
            }
            line
        });
        let lines: Vec<_> = lines.collect();
        let known = lines.iter().flatten().map(|point| point.1);
        let up = Axis::linear_covering(&panel.axis_name, known.filter(|value| value.is_finite()))
            .with_least_extent(ROUNDING_VARIATION);
        page.draw_group("curves", |page| {
            let axes = PanelAxes::draw_titled(page, cell, ["", panel.title], x.axis.clone(), up);
            let mut key = Legend::right_of(cell);
            for (curve, line) in curves.iter().zip(lines) {
                axes.draw_curve(page, &line, Stroke::new(curve.color, 1.6));
                axes.draw_markers(page, line, Marker::Dot, curve.color);
                key.add_marked_line(page, curve.name, "", curve.color);
            }
        });
        top = cell.opposite_corner().y + PAGE.panel_axis;
    }
    top
}

/// What a cell of this size in pixels has.
struct CellMarks {
    /// Smaller cells have no gaps between them and no marks.
    separated: f64,
    /// Smaller cells have no numbers.
    numbered: f64,
    number_font: f64,
}

const CELL: CellMarks = CellMarks {
    separated: 5.0,
    numbered: 13.0,
    number_font: 8.0,
};

/// Color where leaves are stable.
pub const STABLE_GROUND_COLOR: Color = Color(226, 236, 226);

/// More waves than this have the same color.
const MOST_WAVES_DISTINGUISHED: f64 = 2.5;

/// Colors that the color-blind can distinguish (Okabe and Ito); that of right answers is
/// light. Those that are alike without colors also differ in their marks.
fn outcome_color(outcome: MapOutcome) -> Color {
    match outcome {
        MapOutcome::Right => Color(170, 214, 240),
        MapOutcome::OtherEquilibrium => Color(240, 228, 66),
        MapOutcome::Saddle => Color(213, 94, 0),
        MapOutcome::Inaccurate => Color(204, 121, 167),
        MapOutcome::NotConverged => Color(128, 128, 134),
        MapOutcome::Diverged => Color(32, 32, 36),
        MapOutcome::Refused => Color(240, 240, 242),
        MapOutcome::OutOfTime => Color(104, 52, 128),
    }
}

/// Waves along the margins, where these are shown and the leaf is stable.
fn stable_waves_shown(show: MapShow, row: &MapRow) -> Option<f64> {
    row.stable_waves().filter(|_| show == MapShow::Waves)
}

/// Fills a cell, with the mark of its outcome if it has one and is large enough.
fn fill_outcome(page: &mut Drawing, cell: PageRectangle, outcome: MapOutcome) {
    page.draw_shape(
        rectangle_path(cell.corner, cell.size),
        outcome_color(outcome),
        None,
    );
    if cell.size.min_element() < CELL.separated {
        return;
    }
    let inset = 0.25 * cell.size;
    let (low, high) = (cell.corner + inset, cell.opposite_corner() - inset);
    let rising = (low.with_y(high.y), high.with_y(low.y));
    let upright = (low.with_x(cell.middle().x), high.with_x(cell.middle().x));
    let level = (low.with_y(cell.middle().y), high.with_y(cell.middle().y));
    let (color, lines): (Color, &[(DVec2, DVec2)]) = match outcome {
        MapOutcome::Refused => (NOTE_COLOR, &[(low, high), rising]),
        MapOutcome::OtherEquilibrium => (NOTE_COLOR, &[(low, high)]),
        MapOutcome::NotConverged => (WHITE, &[rising]),
        MapOutcome::Inaccurate => (WHITE, &[level]),
        MapOutcome::OutOfTime => (WHITE, &[upright]),
        _ => return,
    };
    for &(from, to) in lines {
        page.draw_line(from, to, Stroke::new(color, 1.0));
    }
}

fn fill_waves(page: &mut Drawing, cell: PageRectangle, waves: f64) {
    let color = match waves {
        0.0 => STABLE_GROUND_COLOR,
        waves => vein_color((waves - 1.0) / (MOST_WAVES_DISTINGUISHED - 1.0)),
    };
    page.draw_shape(rectangle_path(cell.corner, cell.size), color, None);
}

/// Indices from this one on have the same color.
pub const DARKEST_MORSE_INDEX: usize = 4;

/// Fills a cell lightly by the index of its equilibrium: the more, the darker.
pub fn fill_cell_by_index(page: &mut Drawing, cell: PageRectangle, index: usize) {
    let color = match index {
        0 => STABLE_GROUND_COLOR,
        1 => Color(255, 240, 222),
        2 => Color(252, 224, 194),
        3 => Color(246, 204, 168),
        _ => Color(236, 182, 144),
    };
    page.draw_shape(rectangle_path(cell.corner, cell.size), color, None);
}

/// Marks a cell whose reference is not confirmed: a dot, or a ring if there is
/// none.
fn mark_unconfirmed_reference(
    page: &mut Drawing,
    cell: PageRectangle,
    reference: ReferenceConfidence,
) {
    let radius = (0.14 * cell.size.min_element()).clamp(1.0, 2.2);
    let at = cell.corner.with_x(cell.opposite_corner().x) + 2.0 * radius * DVec2::new(-1.0, 1.0);
    let (color, rim) = match reference {
        ReferenceConfidence::Confirmed | ReferenceConfidence::FinerGrids => return,
        ReferenceConfidence::Unconfirmed => (TEXT_COLOR, Stroke::new(WHITE, 0.5)),
        ReferenceConfidence::None => (WHITE, Stroke::new(TEXT_COLOR, 0.8)),
    };
    page.draw_shape(circle_path(at, radius), color, Some(rim));
}

/// Stroke of the longest stable step.
const STABLE_STEP_STROKE: Stroke = Stroke::new(Color(170, 0, 60), 2.0);

/// The axis of a number that varies, with a cell around each of its values.
pub struct VariedAxis {
    pub axis: Axis,
    /// Edges of the cells, as fractions of the axis: one more than there are cells.
    edges: Vec<f64>,
}

impl VariedAxis {
    /// Cells in the order given, each around its value.
    pub fn from_sweep(vary: &ParameterSweep, units: &Units) -> Self {
        let sign = vary.log.then(|| vary.values[0].signum());
        let scale = |value: &f64| match sign {
            Some(sign) => (sign * value).log10(),
            None => *value,
        };
        let places: Vec<f64> = vary.values.iter().map(scale).collect();
        let (first, last) = (places[0], places[places.len() - 1]);
        let mut edges: Vec<f64> = places.windows(2).map(|p| 0.5 * (p[0] + p[1])).collect();
        let (start, end) = match (edges.first(), edges.last()) {
            (Some(low), Some(high)) => (2.0 * first - low, 2.0 * last - high),
            _ => (first - 0.5, first + 0.5),
        };
        edges.insert(0, start);
        edges.push(end);
        let name = QuantityLabel::from_keys(&vary.keys.to_string(), units).axis_name();
        let mut axis = Axis::linear(&name, start, end);
        axis.sign = sign;
        if vary.keys.is_whole() {
            axis.ticks = TickPlacement::WholeNumbers(vary.values.clone());
        }
        let part = |edge: f64| (edge - start) / (end - start);
        VariedAxis {
            axis,
            edges: edges.into_iter().map(part).collect(),
        }
    }

    /// The axis of a panel with curves over the values of a sweep: logarithmic where they are, given their sign.
    pub fn over_values(vary: &ParameterSweep, name: &str, sign: Option<f64>) -> Axis {
        let axis = Axis::covering_values(name, vary.values.iter().copied(), sign);
        match vary.keys.is_whole() {
            true => Axis {
                ticks: TickPlacement::WholeNumbers(vary.values.clone()),
                ..axis
            },
            false => axis,
        }
    }

    fn cell_count(&self) -> usize {
        self.edges.len() - 1
    }

    /// The rectangle of the cell in this column and row of a panel with two axes.
    pub fn cell_rectangle(
        panel: PageRectangle,
        [x, y]: [&VariedAxis; 2],
        [column, row]: [usize; 2],
    ) -> PageRectangle {
        let PageRectangle { corner, size } = panel;
        let (left, right) = (x.edges[column], x.edges[column + 1]);
        let (low, high) = (y.edges[row], y.edges[row + 1]);
        PageRectangle::new(
            corner + size * DVec2::new(left, 1.0 - high),
            size * DVec2::new(right - left, high - low),
        )
    }
}

/// A panel; with one axis it is a strip.
struct MapPanel<'a> {
    axes: PanelAxes,
    x: &'a VariedAxis,
    y: Option<&'a VariedAxis>,
}

impl<'a> MapPanel<'a> {
    pub fn new(
        cell: PageRectangle,
        x: &'a VariedAxis,
        y: Option<&'a VariedAxis>,
        labelled: bool,
    ) -> Self {
        // Panels share the names of their axes.
        let unnamed = |axis: &Axis| Axis {
            name: String::new(),
            ..axis.clone()
        };
        let across = Axis {
            labelled,
            ..unnamed(&x.axis)
        };
        let up = y.map_or(Axis::blank(), |y| unnamed(&y.axis));
        let axes = PanelAxes { cell, across, up };
        MapPanel { axes, x, y }
    }

    /// Cells are counted along the last axis first.
    pub fn draw<'r>(
        &self,
        page: &mut Drawing,
        show: MapShow,
        rows: impl Iterator<Item = &'r MapRow>,
    ) {
        for row in rows {
            self.draw_cell(page, row, stable_waves_shown(show, row));
        }
        self.axes.draw_without_grid(page);
    }

    fn cell_indices(&self, i: usize) -> (usize, usize) {
        let along_y = self.y.map_or(1, VariedAxis::cell_count);
        (i / along_y, i % along_y)
    }

    fn cell_rectangle(&self, i: usize) -> PageRectangle {
        let PageRectangle { corner, size } = self.axes.cell;
        let (column, row) = self.cell_indices(i);
        let (left, right) = (self.x.edges[column], self.x.edges[column + 1]);
        let (low, high) = self
            .y
            .map_or((0.0, 1.0), |y| (y.edges[row], y.edges[row + 1]));
        PageRectangle::new(
            corner + size * DVec2::new(left, 1.0 - high),
            size * DVec2::new(right - left, high - low),
        )
    }

    fn draw_cell(&self, page: &mut Drawing, row: &MapRow, waves: Option<f64>) {
        let mut cell = self.cell_rectangle(row.cell);
        let large = cell.size.min_element() >= CELL.separated;
        if large {
            let inset = DVec2::splat(0.4);
            cell.corner += inset;
            cell.size -= 2.0 * inset;
        }
        match waves {
            Some(waves) => fill_waves(page, cell, waves),
            None => fill_outcome(page, cell, row.outcome),
        }
        if large {
            mark_unconfirmed_reference(page, cell, row.reference);
        }
        let number = match (row.outcome, row.index, waves) {
            (MapOutcome::Saddle, Some(index), _) => index.to_string(),
            (_, _, Some(waves)) if waves > 0.0 => waves.to_string(),
            _ => return,
        };
        if cell.size.min_element() >= CELL.numbered {
            page.draw_centered_label(
                cell.middle(),
                &number,
                CELL.number_font,
                TextAnchor::Middle,
                WHITE,
            );
        }
    }

    /// Draws the longest step known to be stable, across every row or column.
    fn draw_stable_step(&self, page: &mut Drawing, request: &MapRequest) {
        let along_x = request.axes[0]
            .keys
            .contains_solver_setting(SolverSetting::Step);
        let inside = |fraction: &f64| (0.0..=1.0).contains(fraction);
        for i in 0..request.cells() {
            let (column, row) = self.cell_indices(i);
            let (first, axis) = match along_x {
                true => (column == 0, &self.axes.across),
                false => (row == 0, &self.axes.up),
            };
            let step = request.longest_stable_step(i).filter(|_| first);
            let fraction = step.map(|step| axis.fraction(step));
            let Some(fraction) = fraction.filter(inside) else {
                continue;
            };
            let (tile, PageRectangle { corner, size }) = (self.cell_rectangle(i), self.axes.cell);
            let place = corner + size * DVec2::new(fraction, 1.0 - fraction);
            let (from, to) = match along_x {
                true => (
                    tile.corner.with_x(place.x),
                    tile.opposite_corner().with_x(place.x),
                ),
                false => (
                    tile.corner.with_y(place.y),
                    tile.opposite_corner().with_y(place.y),
                ),
            };
            page.draw_line(from, to, STABLE_STEP_STROKE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::formats::checked_svg_text;
    use crate::report::sample;

    fn svg(map: &Map) -> String {
        checked_svg_text(&draw(map))
    }

    #[test]
    fn every_method_and_outcome_is_named() {
        let map = sample::map_of_all_outcomes();
        let svg = svg(&map);
        for method in MapMethod::ALL {
            assert!(svg.contains(&format!(">{method}</text>")), "{method}");
        }
        for outcome in MapOutcome::ALL {
            assert!(svg.contains(&outcome.word().replace('-', " ")), "{outcome}");
        }
        for axis in ["gravity along z", "bending stiffness A2"] {
            assert!(svg.contains(axis), "{axis}");
        }
        assert!(svg.contains("no reference") && svg.contains("10⁻¹"));
    }

    #[test]
    fn waves_are_shown_in_place_of_outcomes() {
        let mut map = sample::map_of_all_outcomes();
        assert!(!svg(&map).contains("waves"));
        map.show = MapShow::Waves;
        let svg = svg(&map);
        let texts = "waves along the margins|Two half-waves|>1.5 waves<|stable, no waves";
        for text in texts.split('|') {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("other equilibrium") && svg.contains("saddle"));
    }

    #[test]
    fn one_method_along_one_axis_is_drawn_as_curves() {
        let mut map = sample::map_of_all_outcomes();
        map.request.axes.remove(0);
        map.request.methods.truncate(1);
        map.rows
            .retain(|row| row.cell < 4 && row.method == MapMethod::default());
        let curves = |svg: &str| -> Vec<usize> {
            let groups = svg.split("<g class=\"curves\">").skip(1);
            let groups = groups.map(|group| group.split("</g>").next().unwrap());
            let lines = groups.map(|group| group.matches("stroke-width=\"1.6\"").count());
            lines.collect()
        };
        // The lines of the panels and those of their keys.
        let svg = svg(&map);
        assert_eq!(curves(&svg), [6, 2]);
        assert!(svg.contains("where the tip is") && svg.contains(">energy<"));
        // Not of several methods, nor over two axes.
        assert!(curves(&self::svg(&sample::map_of_all_outcomes())).is_empty());
        map.show = MapShow::Waves;
        let svg = self::svg(&map);
        assert_eq!(curves(&svg), [2, 2, 2]);
        assert!(svg.contains("mean twist"));
    }

    #[test]
    fn one_axis_and_missing_cells_are_drawn() {
        let mut map = sample::map_of_all_outcomes();
        map.request.axes.remove(0);
        map.rows.retain(|row| row.cell < 3);
        let svg = svg(&map);
        assert!(svg.contains("3 of 4 cells"));
        assert!(!svg.contains("bending stiffness"));
    }
}

#[cfg(test)]
mod panel_tests {
    use super::*;
    use crate::figure::drawing::axes::AxisOrientation;

    fn parse_varied_axis(given: &str) -> VariedAxis {
        VariedAxis::from_sweep(&given.parse().unwrap(), &Units::default())
    }

    #[test]
    fn cells_fill_the_axis_in_the_order_given() {
        for given in [
            "stiffness.torsion=1..1e-5:6log",
            "load.gravity[2]=-1e-3..-10:5log",
            "rest.twist=3..-3:4",
            "leaf.rods=1..40:6log",
            "rest.twist=3..4:1",
        ] {
            let edges = parse_varied_axis(given).edges;
            assert_eq!(edges[0], 0.0, "{given}");
            assert_eq!(edges[edges.len() - 1], 1.0, "{given}");
            assert!(edges.windows(2).all(|pair| pair[0] < pair[1]), "{given}");
        }
    }

    #[test]
    fn ticks_are_readable() {
        let texts = |given: &str, length: f64| -> Vec<String> {
            let ticks = parse_varied_axis(given)
                .axis
                .ticks(length, AxisOrientation::Horizontal);
            ticks.into_iter().map(|tick| tick.text).collect()
        };
        let decades = texts("load.gravity[2]=-1e-3..-10:5log", 230.0);
        assert_eq!(decades.len(), 5);
        assert_eq!(decades[0], "\u{2212}10⁻³");
        assert!(texts("stiffness.axial=1..1e10:11log", 230.0).len() <= 6);
        assert_eq!(texts("stiffness.axial=2..5:4log", 230.0), ["2", "5"]);
        let whole = texts("leaf.rods=1..5:5", 250.0);
        assert_eq!(whole, ["1", "2", "3", "4", "5"]);
        assert_eq!(texts("rest.twist=0..1:3", 250.0), ["0.0", "0.5", "1.0"]);
    }
}
