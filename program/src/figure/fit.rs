//! A fit: the free numbers with their intervals, results of experiments with the model and its confidence
//! band, measured points over the veins, and below each panel the residuals. Results of experiments that
//! differ along a line are a series along the column that varies most; other results keep the numbers of
//! their experiments.

use crate::figure::drawing::axes::{Axis, PanelAxes, TickPlacement};
use crate::figure::drawing::formats::Font;
use crate::figure::drawing::labels::{Legend, new_page};
use crate::figure::drawing::markers::Marker;
use crate::figure::drawing::space::{PlaneView, VIEW_FROM_ABOVE, VIEW_FROM_SIDE};
use crate::figure::drawing::{
    BLUE, Color, Drawing, FONT_SIZE, NOTE_COLOR, PAGE, PageRectangle, SECOND_SOLUTION_COLOR,
    Stroke, TEXT_COLOR, TextAnchor, WHITE, circle_path, color_of_vein, panel_letters, polygon_path,
    rectangle_path,
};
use crate::figure::scenario::{COORDINATE_NAMES, QuantityLabel, name_with_unit};
use crate::report::numbers::{
    count_in_words, format_five_digits, format_four_digits, round_to_error,
};
use glam::{DVec2, DVec3};
use leafdyn::scenario::{Scenario, Units};
use leafdyn::study::{Fit, FitLeaf, FitParameter, FitResidual, MeasuredQuantity, ParameterKeys};
use std::collections::HashMap;

/// Sizes of the panels of results and of measured leaves, in pixels.
struct ResultLayout {
    height: f64,
    /// Height of the residuals below a panel, and the gap between.
    residuals: f64,
    residuals_gap: f64,
    /// Least distance between ticks of residuals.
    residual_ticks: f64,
    /// Heights of a leaf, and between its two views.
    least_leaf: f64,
    largest_leaf: f64,
    views_gap: f64,
    /// Width right of the panels, for the key.
    key: f64,
    /// Half the width of the band of a single experiment.
    half_band: f64,
    /// Most panels of results, and most leaves, that are drawn.
    most_panels: usize,
    most_leaves: usize,
}

const RESULT_LAYOUT: ResultLayout = ResultLayout {
    height: 190.0,
    residuals: 70.0,
    residuals_gap: 12.0,
    residual_ticks: 16.0,
    least_leaf: 110.0,
    largest_leaf: 300.0,
    views_gap: 70.0,
    key: 200.0,
    half_band: 5.0,
    most_panels: 8,
    most_leaves: 3,
};

pub fn draw(fit: &Fit, scenario: &Scenario) -> Drawing {
    let units = &scenario.units;
    let name = format!("{}: fit", fit.scenario);
    let count = fit.residuals.len();
    let free = count_in_words(fit.parameters.len(), "free number", "free numbers");
    let mut notes = vec![format!("{count} data, {free}"), fit.outcome.word().into()];
    match fit.standard_deviation {
        Some(sd) => notes.push(format!("residuals of {}", format_five_digits(sd))),
        None => notes.push(format!(
            "sum of squares {} for {} degrees of freedom",
            format_five_digits(fit.chi_squared),
            fit.degrees_of_freedom
        )),
    }
    let mut page = new_page(PAGE.left_margin, &name, &notes, None);
    let mut letters = panel_letters();
    let mut letter = || letters.next().unwrap_or_default();
    let mut top = PAGE.header;
    page.draw_group("numbers", |page| {
        top = draw_fit_parameters(page, top, &letter(), &fit.parameters, units);
    });
    for results in result_series_by_kind(fit)
        .iter()
        .take(RESULT_LAYOUT.most_panels)
    {
        page.draw_group("result", |page| {
            top = draw_results(page, top, &letter(), units, results);
        });
    }
    let traced = fit.leaves.iter().filter(|(_, it)| !it.traced.is_empty());
    for (name, leaf) in traced.take(RESULT_LAYOUT.most_leaves) {
        page.draw_group("veins", |page| {
            let of = fit.residuals.iter();
            let of = of.filter(|it| it.rod.is_some() && it.number == leaf.number);
            top = draw_measured_veins(page, top, &letter(), name, units, leaf, of.collect());
        });
    }
    page.height = (top + PAGE.bottom_margin).ceil();
    page
}

/// Sizes of the panel of intervals, in pixels.
struct IntervalLayout {
    /// Left of the intervals, for the numbers in words; right of them, for the values.
    words: f64,
    values: f64,
    row: f64,
    most_rows: usize,
    /// Intervals are drawn up to this part of the value.
    widest: f64,
}

const INTERVALS: IntervalLayout = IntervalLayout {
    words: 216.0,
    values: 200.0,
    row: 24.0,
    most_rows: 30,
    widest: 1.0,
};

/// Draws the free numbers with their intervals; returns where that ends.
fn draw_fit_parameters(
    page: &mut Drawing,
    top: f64,
    letter: &str,
    all: &[FitParameter],
    units: &Units,
) -> f64 {
    let shown = &all[..all.len().min(INTERVALS.most_rows)];
    let corner = DVec2::new(PAGE.left_margin + INTERVALS.words, top + PAGE.panel_title);
    let size = DVec2::new(
        PAGE.width - PAGE.right_margin - INTERVALS.values - corner.x,
        INTERVALS.row * shown.len().max(1) as f64,
    );
    let cell = PageRectangle::new(corner, size);
    // The ends of the intervals as parts of the values.
    let parts = |it: &FitParameter| {
        let part = |end: Option<f64>| end.map(|end| (end - it.value) / it.value.abs());
        [part(it.low), part(it.high)]
    };
    let known = shown.iter().flat_map(parts).flatten();
    let widest = known.map(f64::abs).filter(|it| it.is_finite());
    let widest = widest.fold(0.0, f64::max).min(INTERVALS.widest);
    let open = shown
        .iter()
        .flat_map(parts)
        .any(|end| end.is_none_or(|it| it.abs() > INTERVALS.widest));
    let end = 110.0
        * if open || widest == 0.0 {
            INTERVALS.widest
        } else {
            widest
        };
    let across = Axis {
        emphasizes_zero: true,
        ..Axis::linear("from the value / %", -end, end)
    };
    let axes = PanelAxes::draw_titled(
        page,
        cell,
        [letter, "95 % intervals"],
        across,
        Axis::blank(),
    );
    for (k, it) in shown.iter().enumerate() {
        let middle = corner.y + INTERVALS.row * (k as f64 + 0.5);
        let label = |page: &mut Drawing, x: f64, text: &str, room: f64, anchor: TextAnchor| {
            let text = Font::embedded().shorten_text(text, FONT_SIZE.tick, room);
            page.draw_centered_label(
                DVec2::new(x, middle),
                &text,
                FONT_SIZE.tick,
                anchor,
                TEXT_COLOR,
            );
        };
        let number = QuantityLabel::from_keys(&it.key, units);
        label(
            page,
            corner.x - 10.0,
            &number.words,
            INTERVALS.words + PAGE.left_margin - 16.0,
            TextAnchor::End,
        );
        let unit = number.unit.map_or(String::new(), |unit| format!(" {unit}"));
        let text = value_with_interval(it) + &unit;
        label(
            page,
            cell.opposite_corner().x + 12.0,
            &text,
            PAGE.width - cell.opposite_corner().x - 16.0,
            TextAnchor::Start,
        );
        // An open interval leaves the frame, dashed.
        let [low, high] = parts(it);
        let place = |part: f64| {
            axes.page_position((100.0 * part, 0.0))
                .map(|at| at.with_y(middle))
        };
        let ends = [(low, -1.0), (high, 1.0)].map(|(part, sign)| {
            let inside = part.filter(|part| part.abs() <= INTERVALS.widest);
            (
                inside.is_some(),
                place(inside.unwrap_or(0.0099 * sign * end)),
            )
        });
        let Some(value) = place(0.0).filter(|_| it.value != 0.0) else {
            continue;
        };
        for (known, at) in ends {
            if let Some(at) = at {
                page.draw_line(value, at, Stroke::new(BLUE, 1.8).with_dashes(!known));
            }
            if let Some(at) = at.filter(|_| known) {
                let half = DVec2::new(0.0, 4.5);
                page.draw_line(at - half, at + half, Stroke::new(BLUE, 1.8));
            }
        }
        if it.determined {
            Marker::Circle.draw(page, value, BLUE);
        }
    }
    cell.opposite_corner().y + PAGE.panel_axis
}

/// A fitted number with its interval, without digits below it.
fn value_with_interval(it: &FitParameter) -> String {
    let error = match (it.low, it.high) {
        (Some(low), Some(high)) => 0.05 * (high - low),
        _ => 0.0,
    };
    let [value, low, high] = [Some(it.value), it.low, it.high]
        .map(|it| it.map(|it| format_four_digits(round_to_error(it, error))));
    let value = value.unwrap_or_default();
    match (it.determined, low, high) {
        (true, Some(low), Some(high)) => format!("{value} ({low} to {high})"),
        (true, ..) => value,
        (false, Some(low), Some(high)) => format!("open: {low} to {high}"),
        (false, Some(low), None) => format!("open: above {low}"),
        (false, None, Some(high)) => format!("open: below {high}"),
        (false, None, None) => "not determined".into(),
    }
}

const CONFIDENCE_BAND_COLOR: Color = Color(200, 222, 238);

const MODEL_STROKE: Stroke = Stroke::new(BLUE, 1.6);

const LEAF_VIEWS: [PlaneView; 3] = [
    VIEW_FROM_ABOVE,
    VIEW_FROM_SIDE,
    PlaneView {
        title: "along x",
        axes: [1, 2],
    },
];

/// A result in words, with its unit.
fn result_label(kind: &str, units: &Units) -> QuantityLabel {
    let (words, unit) = match kind.parse() {
        Ok(MeasuredQuantity::Tip(axis)) => (
            format!("{} of the tip", COORDINATE_NAMES[axis]),
            &units.length,
        ),
        Ok(MeasuredQuantity::Reaction(axis)) => (
            format!("reaction along {}", COORDINATE_NAMES[axis]),
            &units.force,
        ),
        Ok(MeasuredQuantity::Grip(grip, axis)) => {
            let words = format!(
                "force on grip {} along {}",
                grip + 1,
                COORDINATE_NAMES[axis]
            );
            (words, &units.force)
        }
        Ok(MeasuredQuantity::Frequency(mode)) => (format!("frequency of mode {mode}"), &None),
        Err(()) => (kind.into(), &None),
    };
    let unit = unit.clone();
    QuantityLabel { words, unit }
}

/// Draws results of one kind with the model along what varied, and their residuals along the same;
/// returns where that ends.
fn draw_results(
    page: &mut Drawing,
    top: f64,
    letter: &str,
    units: &Units,
    results: &ResultSeries,
) -> f64 {
    let cell = PageRectangle::left_of_legend(
        top + PAGE.panel_title,
        RESULT_LAYOUT.height,
        RESULT_LAYOUT.key,
    );
    let quantity = result_label(results.kind, units);
    let values = results
        .all_residuals()
        .flat_map(|PlacedResidual { residual: r, .. }| {
            let (band, sd) = (r.band, 2.0 * r.sd);
            [r.data - sd, r.data + sd, r.model - band, r.model + band]
        });
    let up = Axis {
        emphasizes_zero: false,
        ..Axis::linear_covering(&quantity.axis_name(), values)
    };
    let places = || results.all_residuals().map(|it| it.abscissa);
    let across = match results.abscissa_keys {
        Some(keys) => Axis::linear_covering(
            &QuantityLabel::from_keys(&keys.to_string(), units).axis_name(),
            places(),
        ),
        None => {
            let mut numbers: Vec<f64> = places().collect();
            numbers.dedup();
            let ends = [numbers.first(), numbers.last()].map(|end| end.copied().unwrap_or(1.0));
            Axis {
                ticks: TickPlacement::WholeNumbers(numbers),
                ..Axis::linear("experiment", ends[0] - 0.5, ends[1] + 0.5)
            }
        }
    };
    let unlabelled = Axis {
        labelled: false,
        ..across.clone()
    };
    let axes = PanelAxes::draw_titled(page, cell, [letter, &quantity.words], unlabelled, up);
    for series in &results.series {
        match results.abscissa_keys {
            Some(_) => draw_model_curve(page, &axes, series),
            None => draw_single_experiments(page, &axes, series),
        }
    }
    for PlacedResidual {
        abscissa: x,
        residual: r,
    } in results.all_residuals()
    {
        let bar = [(x, r.data - 2.0 * r.sd), (x, r.data + 2.0 * r.sd)];
        axes.draw_curve(page, &bar, Stroke::new(SECOND_SOLUTION_COLOR, 1.0));
    }
    axes.draw_markers(
        page,
        results
            .all_residuals()
            .map(|it| (it.abscissa, it.residual.data)),
        Marker::Dot,
        SECOND_SOLUTION_COLOR,
    );
    let mut key = Legend::right_of(cell);
    key.add_marker(
        page,
        "data",
        "with two standard deviations",
        Marker::Dot,
        SECOND_SOLUTION_COLOR,
    );
    key.add_line(page, "model", "", MODEL_STROKE);
    key.add_entry(
        page,
        "95 % band",
        "what the data leave open",
        |page, cell| {
            page.draw_shape(
                rectangle_path(cell.corner, cell.size),
                CONFIDENCE_BAND_COLOR,
                None,
            );
        },
    );
    let points = results
        .all_residuals()
        .map(|it| ResidualMark {
            abscissa: it.abscissa,
            residual: it.residual.residual,
            color: TEXT_COLOR,
        })
        .collect();
    draw_residuals(page, cell, across, points)
}

/// Draws the model through a series of experiments, with its band.
fn draw_model_curve(page: &mut Drawing, axes: &PanelAxes, series: &[PlacedResidual]) {
    let mut once = series.to_vec();
    once.dedup_by_key(|it| it.abscissa);
    let line = |of: &dyn Fn(&FitResidual) -> f64| -> Vec<DVec2> {
        let points: Vec<(f64, f64)> = (once.iter())
            .map(|it| (it.abscissa, of(it.residual)))
            .collect();
        axes.smooth_curve(&points).into_iter().flatten().collect()
    };
    let mut band = line(&|r| r.model + r.band);
    band.extend(line(&|r| r.model - r.band).into_iter().rev());
    if !band.is_empty() {
        page.draw_shape(polygon_path(&band), CONFIDENCE_BAND_COLOR, None);
    }
    let model: Vec<Option<DVec2>> = line(&|r| r.model).into_iter().map(Some).collect();
    axes.draw_clipped_line(page, &model, MODEL_STROKE);
    if once.len() == 1 {
        draw_single_experiments(page, axes, &once);
    }
}

/// Draws the model of single experiments, each with its band.
fn draw_single_experiments(page: &mut Drawing, axes: &PanelAxes, experiments: &[PlacedResidual]) {
    for PlacedResidual {
        abscissa: x,
        residual: r,
    } in experiments
    {
        let ends = [r.model + r.band, r.model - r.band].map(|y| axes.page_position((*x, y)));
        if let ([Some(top), Some(end)], Some(at)) = (ends, axes.page_position((*x, r.model))) {
            let half = DVec2::new(RESULT_LAYOUT.half_band, 0.0);
            page.draw_shape(
                rectangle_path(top - half, end - top + 2.0 * half),
                CONFIDENCE_BAND_COLOR,
                None,
            );
            page.draw_line(at - half, at + half, MODEL_STROKE);
        }
    }
}

/// A residual in standard deviations, as a point of a panel.
struct ResidualMark {
    abscissa: f64,
    residual: f64,
    color: Color,
}

/// Draws residuals below a panel along the same axis; returns where they end.
fn draw_residuals(
    page: &mut Drawing,
    above: PageRectangle,
    across: Axis,
    points: Vec<ResidualMark>,
) -> f64 {
    let corner = DVec2::new(
        above.corner.x,
        above.opposite_corner().y + RESULT_LAYOUT.residuals_gap,
    );
    let cell = PageRectangle::new(corner, DVec2::new(above.size.x, RESULT_LAYOUT.residuals));
    let sizes = points.iter().map(|mark| mark.residual.abs());
    let most = 1.2 * sizes.filter(|it| it.is_finite()).fold(2.5, f64::max);
    let up = Axis {
        emphasizes_zero: true,
        tick_spacing: Some(RESULT_LAYOUT.residual_ticks),
        ..Axis::linear("residual", -most, most)
    };
    let axes = PanelAxes { cell, across, up };
    axes.draw(page);
    let two = Stroke::new(NOTE_COLOR, 1.0).with_dashes(true);
    for bound in [-2.0, 2.0] {
        let fraction = 1.0 - axes.up.fraction(bound);
        let from = corner + DVec2::new(0.0, fraction * cell.size.y);
        page.draw_line(from, from.with_x(cell.opposite_corner().x), two);
    }
    for mark in points {
        let at = (mark.abscissa, mark.residual);
        axes.draw_markers(page, [at], Marker::Dot, mark.color);
    }
    let mut key = Legend::right_of(cell);
    let note = "in standard deviations";
    key.add_marker(page, "data less model", note, Marker::Dot, TEXT_COLOR);
    cell.opposite_corner().y + PAGE.panel_axis
}

/// A measured point of a vein, as a view shows it.
struct MeasuredPoint {
    /// Counted from 0.
    rod: usize,
    at: (f64, f64),
}

/// A leaf and its measured points along one of the axes, with axes that cover both.
struct LeafView {
    title: &'static str,
    across: Axis,
    up: Axis,
    curves: Vec<Vec<(f64, f64)>>,
    points: Vec<MeasuredPoint>,
}

impl LeafView {
    fn of_leaf(view: PlaneView, leaf: &FitLeaf, units: &Units) -> Self {
        let [right, upward] = view.axes;
        let traced = leaf.traced.iter();
        let points = traced.filter_map(|(rod, at)| {
            let at = (at[right]?, at[upward]?);
            Some(MeasuredPoint { rod: *rod, at })
        });
        let points: Vec<MeasuredPoint> = points.collect();
        let flat = |point: &DVec3| (point[right], point[upward]);
        let curves = leaf.curves.iter();
        let curves = curves.map(|curve| curve.iter().map(flat).collect());
        let curves: Vec<Vec<(f64, f64)>> = curves.collect();
        let all = || (curves.iter().flatten()).chain(points.iter().map(|point| &point.at));
        let name = |axis: usize| name_with_unit(COORDINATE_NAMES[axis], units.length.as_deref());
        LeafView {
            title: view.title,
            across: Axis::linear_covering(&name(right), all().map(|point| point.0)),
            up: Axis::linear_covering(&name(upward), all().map(|point| point.1)),
            curves,
            points,
        }
    }
}

/// Draws a leaf in the one or two views in which points were measured, with these, and their
/// residuals along the veins; returns where that ends.
fn draw_measured_veins(
    page: &mut Drawing,
    top: f64,
    letter: &str,
    experiment: &str,
    units: &Units,
    leaf: &FitLeaf,
    residuals: Vec<&FitResidual>,
) -> f64 {
    let measured = |view: &PlaneView| {
        let [a, b] = view.axes;
        let mut points = leaf.traced.iter();
        points.any(|(_, at)| at[a].is_some() && at[b].is_some())
    };
    let mut views: Vec<_> = LEAF_VIEWS.into_iter().filter(measured).collect();
    if views.is_empty() {
        // Of marked points a single coordinate.
        views = LEAF_VIEWS.into();
    }
    views.truncate(2);
    let whole = PAGE.width - PAGE.left_margin - PAGE.right_margin - RESULT_LAYOUT.key;
    let width = match views.len() {
        1 => whole,
        _ => 0.5 * (PAGE.width - PAGE.left_margin - PAGE.right_margin - RESULT_LAYOUT.views_gap),
    };
    let count = leaf.curves.len();
    let panels: Vec<LeafView> = (views.into_iter())
        .map(|view| LeafView::of_leaf(view, leaf, units))
        .collect();
    let tall = |panel: &LeafView| {
        let LeafView { across, up, .. } = panel;
        width * (up.end - up.start) / (across.end - across.start)
    };
    let height = panels
        .iter()
        .map(tall)
        .fold(0.0, f64::max)
        .clamp(RESULT_LAYOUT.least_leaf, RESULT_LAYOUT.largest_leaf);
    let experiment = match experiment {
        "as it is" => "traced veins".to_string(),
        name => format!("traced veins, experiment {name}"),
    };
    let mut below =
        PageRectangle::left_of_legend(top + PAGE.panel_title, height, RESULT_LAYOUT.key);
    let is_single = panels.len() == 1;
    for (k, view) in panels.into_iter().enumerate() {
        let corner = DVec2::new(
            PAGE.left_margin + k as f64 * (width + RESULT_LAYOUT.views_gap),
            top + PAGE.panel_title,
        );
        let cell = PageRectangle::new(corner, DVec2::new(width, height));
        let letter = if k == 0 { letter } else { "" };
        let what = format!("{experiment}, {}", view.title);
        let (across, up) = equalize_axis_scales(view.across, view.up, cell.size);
        let panel = PanelAxes::draw_titled(page, cell, [letter, &what], across, up);
        for (rod, line) in view.curves.iter().enumerate() {
            let drawn = panel.smooth_curve(line).into_iter().flatten().map(Some);
            let stroke = Stroke::new(color_of_vein(rod, count), 1.4);
            panel.draw_clipped_line(page, &drawn.collect::<Vec<_>>(), stroke);
        }
        for MeasuredPoint { rod, at } in view.points {
            if let Some(at) = panel.page_position(at) {
                let rim = Stroke::new(color_of_vein(rod, count), 1.2);
                page.draw_shape(circle_path(at, 2.6), WHITE, Some(rim));
            }
        }
        if is_single {
            let mut key = Legend::right_of(cell);
            key.add_line(page, "model", "each vein in its colour", MODEL_STROKE);
            key.add_entry(page, "traced points", "", |page, cell| {
                let rim = Stroke::new(BLUE, 1.2);
                page.draw_shape(circle_path(cell.middle(), 2.6), WHITE, Some(rim));
            });
        }
    }
    below.corner.y += PAGE.panel_axis - RESULT_LAYOUT.residuals_gap;
    let along = Axis::linear("fraction of the length", 0.0, 1.0);
    let points = residuals.iter().filter_map(|it| {
        let color = color_of_vein(it.rod?.checked_sub(1)?, count);
        Some(ResidualMark {
            abscissa: it.sigma?,
            residual: it.residual,
            color,
        })
    });
    draw_residuals(page, below, along, points.collect())
}

/// The axes, one widened so that both have the same number of pixels per length.
fn equalize_axis_scales(mut across: Axis, mut up: Axis, size: DVec2) -> (Axis, Axis) {
    let extents = [across.end - across.start, up.end - up.start];
    let unit = (extents[0] / size.x).max(extents[1] / size.y);
    for (axis, pixels) in [(&mut across, size.x), (&mut up, size.y)] {
        let (middle, half) = (0.5 * (axis.start + axis.end), 0.5 * unit * pixels);
        (axis.start, axis.end) = (middle - half, middle + half);
        axis.emphasizes_zero = false;
    }
    (across, up)
}

/// Fewest experiments of a series among others.
const FEWEST_EXPERIMENTS: usize = 4;

/// Experiments are in line up to this part of their distance.
const COLLINEAR_EXPERIMENTS_TOLERANCE: f64 = 1e-6;

/// A result of an experiment, and where a panel has it: the value that varied, or the number of the
/// experiment.
#[derive(Clone, Copy)]
struct PlacedResidual<'f> {
    pub abscissa: f64,
    pub residual: &'f FitResidual,
}

/// Results of one kind, drawn in one panel.
struct ResultSeries<'f> {
    /// The name of its column in the data, such as `tip_x`.
    pub kind: &'f str,
    /// The number of the scenario along which the panel has them; `None`: the numbers of the
    /// experiments.
    pub abscissa_keys: Option<&'f ParameterKeys>,
    /// Series along it, each with its values in ascending order.
    pub series: Vec<Vec<PlacedResidual<'f>>>,
}

impl<'f> ResultSeries<'f> {
    fn all_residuals(&self) -> impl Iterator<Item = PlacedResidual<'f>> {
        self.series.iter().flatten().copied()
    }
}

type ExperimentSettings = [(ParameterKeys, f64)];

/// The results of all experiments by their kinds. Those of experiments that differ along a line, as
/// one column varies or several together, are a series; those of others keep their numbers.
fn result_series_by_kind(fit: &Fit) -> Vec<ResultSeries<'_>> {
    let leaves = fit.leaves.iter();
    let settings: HashMap<usize, &ExperimentSettings> = leaves
        .map(|(_, leaf)| (leaf.number, &leaf.settings[..]))
        .collect();
    let mut kinds: Vec<(&str, Vec<&FitResidual>)> = Vec::new();
    for result in fit.residuals.iter().filter(|it| it.rod.is_none()) {
        match kinds.iter_mut().find(|(kind, _)| *kind == result.what) {
            Some((_, of)) => of.push(result),
            None => kinds.push((&result.what, vec![result])),
        }
    }
    let mut all = Vec::new();
    for (kind, of) in kinds {
        let first = all.len();
        let own: Vec<&ExperimentSettings> = (of.iter())
            .map(|it| settings.get(&it.number).copied().unwrap_or_default())
            .collect();
        let mut numbered = Vec::new();
        let mut from = 0;
        while from < of.len() {
            let whole = (from == 0).then(|| most_varying_setting(&own)).flatten();
            let found = match whole {
                Some(key) => Some((of.len(), key)),
                None => (from + FEWEST_EXPERIMENTS..=of.len())
                    .map_while(|to| Some((to, most_varying_setting(&own[from..to])?)))
                    .last(),
            };
            let Some((to, key)) = found else {
                numbered.push(PlacedResidual {
                    abscissa: of[from].number as f64,
                    residual: of[from],
                });
                from += 1;
                continue;
            };
            let keys = &own[from][key].0;
            let mut series: Vec<_> = (from..to)
                .map(|k| PlacedResidual {
                    abscissa: own[k][key].1,
                    residual: of[k],
                })
                .collect();
            series.sort_by(|a, b| a.abscissa.total_cmp(&b.abscissa));
            let along = Some(keys);
            let mut of_kind = all[first..].iter_mut();
            match of_kind.find(|it: &&mut ResultSeries| it.abscissa_keys == along) {
                Some(same) => same.series.push(series),
                None => all.push(ResultSeries {
                    kind,
                    abscissa_keys: along,
                    series: vec![series],
                }),
            }
            from = to;
        }
        if !numbered.is_empty() {
            all.push(ResultSeries {
                kind,
                abscissa_keys: None,
                series: vec![numbered],
            });
        }
    }
    all
}

/// Which setting of the experiments varies most, if they differ along a line.
fn most_varying_setting(settings: &[&ExperimentSettings]) -> Option<usize> {
    let first = settings.first()?;
    let same = |it: &&ExperimentSettings| {
        it.iter()
            .map(|(keys, _)| keys)
            .eq(first.iter().map(|(keys, _)| keys))
    };
    if !settings.iter().all(same) {
        return None;
    }
    let sizes: Vec<f64> = (0..first.len())
        .map(|k| {
            settings
                .iter()
                .fold(0.0, |most: f64, it| most.max(it[k].1.abs()))
        })
        .collect();
    let from_first = |it: &&ExperimentSettings| -> Vec<f64> {
        let each = it.iter().zip(first.iter()).zip(&sizes);
        each.map(|((a, b), size)| if *size > 0.0 { (a.1 - b.1) / size } else { 0.0 })
            .collect()
    };
    let steps: Vec<Vec<f64>> = settings.iter().map(from_first).collect();
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let longest = steps
        .iter()
        .max_by(|a, b| dot(a, a).total_cmp(&dot(b, b)))?;
    let square = dot(longest, longest);
    if square.is_nan() || square <= 0.0 {
        return None;
    }
    let in_line = |step: &Vec<f64>| {
        let part = dot(step, longest) / square;
        let off = step
            .iter()
            .zip(longest)
            .map(|(a, b)| (a - part * b).powi(2));
        off.sum::<f64>()
            <= COLLINEAR_EXPERIMENTS_TOLERANCE * COLLINEAR_EXPERIMENTS_TOLERANCE * square
    };
    if !steps.iter().all(in_line) {
        return None;
    }
    // The first of those that vary alike.
    (0..longest.len()).reduce(|best, k| {
        match longest[k].abs() > (1.0 + 1e-9) * longest[best].abs() {
            true => k,
            false => best,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(keys: [&str; 2], values: &[[f64; 2]]) -> Vec<Vec<(ParameterKeys, f64)>> {
        let row = |values: &[f64; 2]| {
            let each = keys.iter().zip(values);
            each.map(|(key, value)| (key.parse().unwrap(), *value))
                .collect()
        };
        values.iter().map(row).collect()
    }

    #[test]
    fn experiments_in_line_vary_by_one_number() {
        let of = |values: &[[f64; 2]]| {
            let rows = rows(["load.tip_force[0]", "load.tip_force[2]"], values);
            most_varying_setting(&rows.iter().map(Vec::as_slice).collect::<Vec<_>>())
        };
        assert_eq!(of(&[[0.0, 1.0], [0.0, 2.0], [0.0, 5.0]]), Some(1));
        // Two that vary together, one more than the other.
        assert_eq!(of(&[[1.0, 1.0], [2.0, 1.1], [3.0, 1.2]]), Some(0));
        assert_eq!(of(&[[-1.0, 1.0], [-2.0, 2.0]]), Some(0));
        assert_eq!(of(&[[0.0, 1.0], [0.0, 2.0], [1.0, 2.0]]), None);
        assert_eq!(of(&[[1.0, 1.0], [1.0, 1.0]]), None);
        assert_eq!(of(&[]), None);
    }
}
