//! A posture: its points, the leaf with and without its loads, curvatures with their bands, the critical mode, and the
//! index over the modulus.

use crate::figure::drawing::axes::{Axis, PanelAxes};
use crate::figure::drawing::labels::{LegendRows, new_page};
use crate::figure::drawing::markers::Marker;
use crate::figure::drawing::{
    BLUE, Color, Drawing, FRAME_COLOR, GRID_COLOR, NOTE_COLOR, PAGE, PageRectangle, SKY, Stroke,
    TEXT_COLOR, VERMILION, polygon_path,
};
use crate::figure::scenario::{QuantityLabel, name_with_unit};
use crate::report::numbers::format_four_digits;
use glam::{DVec2, DVec3};
use leafdyn::posture::leaf::ModulusMeaning;
use leafdyn::posture::rest::Station;
use leafdyn::scenario::{Scenario, Units};
use leafdyn::study::Unbending;

/// Sizes of the panels, in pixels.
struct PostureLayout {
    /// Heights of both rows.
    upper: f64,
    lower: f64,
    /// Between both columns, with the labels of the right one.
    gap: f64,
    /// Above the panels of a row, for a key.
    key: f64,
    /// Between the rows.
    between: f64,
}

const LAYOUT: PostureLayout = PostureLayout {
    upper: 330.0,
    lower: 210.0,
    gap: 74.0,
    key: 20.0,
    between: 12.0,
};

/// Decades of the modulus beside the least one.
const DECADES: f64 = 1.5;

/// A 95 % band is this many standard deviations wide on both sides.
const BAND: f64 = 1.96;

pub fn draw(found: &Unbending, scenario: &Scenario) -> Drawing {
    let units = &scenario.units;
    let title = format!(
        "{}: what its posture tells of its stiffness",
        found.scenario
    );
    let mut page = new_page(PAGE.left_margin, &title, &notes(found, units), None);
    let width = 0.5 * (PAGE.width - PAGE.left_margin - PAGE.right_margin - LAYOUT.gap);
    let cell = |column: usize, top: f64, height: f64| {
        let left = PAGE.left_margin + column as f64 * (width + LAYOUT.gap);
        PageRectangle::new(DVec2::new(left, top), DVec2::new(width, height))
    };
    let upper = PAGE.header + LAYOUT.key + PAGE.panel_title;
    let lower =
        upper + LAYOUT.upper + PAGE.panel_axis + LAYOUT.between + LAYOUT.key + PAGE.panel_title;
    page.draw_group("posture", |page| {
        draw_posture(page, found, units, cell(0, upper, LAYOUT.upper))
    });
    page.draw_group("curvature", |page| {
        draw_curvature(page, found, units, cell(1, upper, LAYOUT.upper));
    });
    page.draw_group("mode", |page| {
        draw_mode(page, found, cell(0, lower, LAYOUT.lower))
    });
    page.draw_group("ladder", |page| {
        draw_ladder(page, found, units, cell(1, lower, LAYOUT.lower))
    });
    page.height = lower + LAYOUT.lower + PAGE.panel_axis + PAGE.bottom_margin;
    page
}

fn notes(found: &Unbending, units: &Units) -> Vec<String> {
    let unit = modulus_label(found, units)
        .unit
        .map_or(String::new(), |unit| format!(" {unit}"));
    let least = found.critical_young;
    let mut notes = vec![match least.value > 0.0 {
        true => format!(
            "E is at least {}{unit} (95 %: {} to {})",
            format_four_digits(least.value),
            format_four_digits(least.low),
            format_four_digits(least.high)
        ),
        false => "stable at any E".to_string(),
    }];
    notes.push(format!(
        "without loads at E = {}{unit}",
        format_four_digits(found.shown_young)
    ));
    notes
}

fn modulus_label(found: &Unbending, units: &Units) -> QuantityLabel {
    match found.meaning {
        ModulusMeaning::Young => QuantityLabel::from_keys("section.young", units),
        ModulusMeaning::Factor => QuantityLabel {
            words: "E, factor of the stiffness".into(),
            unit: None,
        },
    }
}

/// The directions in which a posture is seen: level along it, and upwards.
fn view(found: &Unbending) -> [DVec3; 2] {
    let (sin, cos) = found.posture.base.angle.sin_cos();
    [DVec3::new(cos, sin, 0.0), DVec3::Z]
}

/// A posture that does not leave the x-y plane is seen from above.
fn seen(found: &Unbending, point: DVec3) -> (f64, f64) {
    let [along, up] = view(found);
    let base = found
        .stations
        .ends
        .first()
        .map_or(DVec3::ZERO, |station| station.position);
    let flat = found
        .stations
        .ends
        .iter()
        .all(|it| (it.position - base).z.abs() < 1e-9 * found.stations.length);
    let up = if flat { DVec3::Z.cross(along) } else { up };
    ((point - base).dot(along), (point - base).dot(up))
}

/// Axes on which lengths are alike in both directions.
fn equal_axes(names: [String; 2], points: &[(f64, f64)], size: DVec2) -> [Axis; 2] {
    let axes = [0, 1].map(|axis| {
        let values = points
            .iter()
            .map(|point| if axis == 0 { point.0 } else { point.1 });
        Axis::linear_covering(&names[axis], values)
    });
    let [across, up] = axes;
    let per_pixel = ((across.end - across.start) / size.x).max((up.end - up.start) / size.y);
    [
        across.with_least_extent(per_pixel * size.x),
        up.with_least_extent(per_pixel * size.y),
    ]
}

fn draw_posture(page: &mut Drawing, found: &Unbending, units: &Units, cell: PageRectangle) {
    let base = found.posture.base.rotation();
    let unloaded = found.stations.unloaded(found.shown_young, base);
    let on = |points: &mut dyn Iterator<Item = DVec3>| -> Vec<(f64, f64)> {
        points.map(|point| seen(found, point)).collect()
    };
    let posture = on(&mut found.stations.ends.iter().map(|station| station.position));
    let unloaded = on(&mut unloaded.into_iter());
    let points = on(&mut found.points.iter().copied());
    let all: Vec<(f64, f64)> = [&posture[..], &unloaded, &points].concat();
    let length = units.length.as_deref();
    let names = ["along the base", "up"].map(|name| name_with_unit(name, length));
    let [across, up] = equal_axes(names, &all, cell.size);
    let axes = PanelAxes::draw_titled(
        page,
        cell,
        ["A", "the leaf as measured, and without its loads"],
        across,
        up,
    );
    axes.draw_curve(
        page,
        &unloaded,
        Stroke::new(VERMILION, 1.6).with_dashes(true),
    );
    axes.draw_curve(page, &posture, Stroke::new(BLUE, 2.0));
    axes.draw_markers(page, points, Marker::Dot, TEXT_COLOR);
    // Where the critical mode bends most.
    if found.critical_young.value > 0.0 {
        let at = found.posture.critical.at;
        let nearest = found
            .stations
            .ends
            .iter()
            .min_by(|a, b| (a.sigma - at).abs().total_cmp(&(b.sigma - at).abs()));
        let place = nearest.map(|station| seen(found, station.position));
        axes.draw_markers(page, place, Marker::Ring, VERMILION);
    }
    let mut key =
        LegendRows::starting_at(cell.corner.x, cell.corner.y - PAGE.panel_title - 4.0, 22.0);
    let mut line = |page: &mut Drawing, name: &str, stroke: Stroke| {
        key.add_entry(page, name, |page, cell| cell.draw_midline(page, stroke));
    };
    line(page, "smoothed", Stroke::new(BLUE, 2.0));
    line(
        page,
        "without loads",
        Stroke::new(VERMILION, 1.6).with_dashes(true),
    );
}

/// The component of the curvature that varies most: 1 or 2 for the bends about d2 and d3.
fn main_bend(found: &Unbending) -> usize {
    let squares = |axis: usize| -> f64 {
        let each = found.stations.ends.iter();
        each.map(|station| station.curvature[axis].powi(2) + station.moment[axis].powi(2))
            .sum()
    };
    if squares(1) >= squares(2) { 1 } else { 2 }
}

fn draw_curvature(page: &mut Drawing, found: &Unbending, units: &Units, cell: PageRectangle) {
    let axis = main_bend(found);
    let young = found.shown_young;
    let stations = &found.stations.ends;
    let at = |station: &Station| station.sigma * found.stations.length;
    let curve = |of: &dyn Fn(&Station) -> f64| -> Vec<(f64, f64)> {
        stations
            .iter()
            .map(|station| (at(station), of(station)))
            .collect()
    };
    let bent = curve(&|station| station.curvature[axis]);
    let rest = curve(&|station| station.rest_curvature(young)[axis]);
    let edges = |side: f64| {
        curve(&|station| station.curvature[axis] + side * BAND * station.curvature_deviation[axis])
    };
    let rest_edges = |side: f64| {
        curve(&|station| {
            station.rest_curvature(young)[axis] + side * BAND * station.rest_deviation(young)[axis]
        })
    };
    let bands = [edges(-1.0), edges(1.0), rest_edges(-1.0), rest_edges(1.0)];
    let values = bands
        .iter()
        .chain([&bent, &rest])
        .flatten()
        .map(|point| point.1);
    let length = units.length.as_deref();
    let per_length = length.map(|unit| format!("1/{unit}"));
    let up = Axis::linear_covering(
        &name_with_unit(&format!("bend about d{}", axis + 1), per_length.as_deref()),
        values,
    );
    let across = Axis::linear(
        &name_with_unit("distance from the base", length),
        0.0,
        found.stations.length,
    );
    let axes = PanelAxes::draw_titled(
        page,
        cell,
        ["B", "curvature, and that at rest, with 95 % bands"],
        across,
        up,
    );
    for (low, high, color) in [
        (&bands[0], &bands[1], SKY),
        (&bands[2], &bands[3], Color(240, 190, 160)),
    ] {
        let corners = low.iter().chain(high.iter().rev());
        let corners: Option<Vec<DVec2>> = corners.map(|point| axes.page_position(*point)).collect();
        if let Some(corners) = corners {
            page.draw_shape(polygon_path(&corners), color, None);
        }
    }
    axes.draw_curve(page, &rest, Stroke::new(VERMILION, 1.6).with_dashes(true));
    axes.draw_curve(page, &bent, Stroke::new(BLUE, 2.0));
}

fn draw_mode(page: &mut Drawing, found: &Unbending, cell: PageRectangle) {
    let Some(mode) = &found.posture.mode else {
        let axes = PanelAxes {
            cell,
            across: Axis::blank(),
            up: Axis::blank(),
        };
        axes.draw(page);
        return;
    };
    let largest = mode
        .rotation
        .iter()
        .map(|omega| omega.length())
        .fold(f64::MIN_POSITIVE, f64::max);
    let sigma = &found.posture.elements.sigma;
    let tangents = &found.posture.line.tangent;
    let along = |part: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        let inner = (0..sigma.len()).map(|k| (sigma[k], part(k) / largest));
        [(0.0, 0.0)].into_iter().chain(inner).collect()
    };
    let twist = along(&|k| mode.rotation[k].dot(tangents[k]).abs());
    let bend =
        along(&|k| (mode.rotation[k] - mode.rotation[k].dot(tangents[k]) * tangents[k]).length());
    let axes = PanelAxes::draw_titled(
        page,
        cell,
        ["C", "the critical mode: how far sections turn"],
        Axis::linear("fraction of the length", 0.0, 1.0),
        Axis::linear("turn, largest 1", 0.0, 1.05),
    );
    axes.draw_curve(page, &bend, Stroke::new(BLUE, 2.0));
    axes.draw_curve(page, &twist, Stroke::new(NOTE_COLOR, 1.4).with_dashes(true));
    let mut key =
        LegendRows::starting_at(cell.corner.x, cell.corner.y - PAGE.panel_title - 4.0, 22.0);
    for (name, stroke) in [
        ("bends", Stroke::new(BLUE, 2.0)),
        ("twists", Stroke::new(NOTE_COLOR, 1.4).with_dashes(true)),
    ] {
        key.add_entry(page, name, |page, cell| cell.draw_midline(page, stroke));
    }
}

fn draw_ladder(page: &mut Drawing, found: &Unbending, units: &Units, cell: PageRectangle) {
    let ladder = found.posture.ladder();
    let least = match found.critical_young.value {
        0.0 => found.shown_young,
        least => least,
    };
    let marked = found
        .indices
        .iter()
        .map(|it| it.young)
        .chain(found.reached_from());
    let shown: Vec<f64> = [
        10f64.powf(-DECADES) * least,
        10f64.powf(0.5 * DECADES) * least,
    ]
    .into_iter()
    .chain(marked.clone())
    .collect();
    let across = Axis::logarithmic(
        &modulus_label(found, units).axis_name(),
        shown.iter().copied(),
        1.0,
    );
    let [from, to] = [across.start, across.end].map(|decade| 10f64.powf(decade));
    let most = found.index(from).min(ladder.len());
    let up = Axis::linear("negative eigenvalues", -0.2, most as f64 + 0.6);
    let axes = PanelAxes::draw_titled(page, cell, ["D", "the index at every E"], across, up);
    let interval = found.critical_young;
    let ends = [interval.low, interval.high].map(|young| axes.page_position((young, 0.0)));
    if let ([Some(low), Some(high)], true) = (ends, interval.value > 0.0) {
        let (top, bottom) = (cell.corner.y, cell.opposite_corner().y);
        let corners = [
            low.with_y(top),
            high.with_y(top),
            high.with_y(bottom),
            low.with_y(bottom),
        ];
        page.draw_shape(polygon_path(&corners), GRID_COLOR, None);
    }
    let mut steps = vec![(to, 0.0)];
    for (k, &rung) in ladder.iter().enumerate().filter(|(_, rung)| **rung > from) {
        steps.push((rung, k as f64));
        steps.push((rung, (k + 1) as f64));
    }
    if ladder.last().is_none_or(|last| *last <= from) {
        steps.push((from, found.index(from) as f64));
    }
    axes.draw_curve(page, &steps, Stroke::new(BLUE, 2.0));
    let reached = found.reached_from();
    if let Some(at) = reached.and_then(|young| axes.page_position((young, 0.0))) {
        let (top, bottom) = (cell.corner.y, cell.opposite_corner().y);
        let stroke = Stroke::new(FRAME_COLOR, 1.0).with_dashes(true);
        page.draw_line(at.with_y(top), at.with_y(bottom), stroke);
        let mut key =
            LegendRows::starting_at(cell.corner.x, cell.corner.y - PAGE.panel_title - 4.0, 22.0);
        key.add_entry(page, "slow loading leads here", |page, cell| {
            cell.draw_midline(page, stroke);
        });
    }
    let indices = found.indices.iter().map(|it| (it.young, it.index as f64));
    axes.draw_markers(page, indices, Marker::Diamond, VERMILION);
}
