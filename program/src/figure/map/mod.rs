//! A map: one panel per method and one colour per outcome or, if waves are shown, per
//! number of waves of stable leaves. Results of one method along one axis are also drawn as
//! curves below its strip: the tip and the energy or, where waves are shown, waves and twist.

mod panel;

use crate::figure::axes::Axes;
use crate::figure::axis::Axis;
use crate::figure::drawing::{Anchor, CURVES, Color, Drawing, INK, NOTE, Stroke};
use crate::figure::font::Font;
use crate::figure::layout::{
    Cell, LEFT, PANEL_AXIS, PANEL_TITLE, RIGHT, TEXT_SIZE, TICK_SIZE, WIDTH,
};
use crate::figure::markers::Marker;
use crate::figure::page::{Key, KeyRows, NOTE_BASE, header};
use crate::figure::setting::with_unit;
use crate::report::words::map_shows;
use glam::DVec2;
use leafdyn::study::{Confidence, Knob, Map, MapMethod, MapOutcome, MapRow, MapShow};
pub use panel::{DARKEST_INDEX, PALE, fill_index};
use panel::{Panel, Varied, waves};

const SWATCH: f64 = 12.0;
/// Room below each panel for ticks and, below the last, for the name of the axis.
const TICKS: f64 = 26.0;
const NAME: f64 = 26.0;
/// Between panels, for the ticks of the right one.
const GAP: f64 = 44.0;
const MOST_COLUMNS: usize = 3;
const WIDEST: f64 = 470.0;
/// Explains a map of waves.
const MEANING: &str = "Colours and numbers: how often the margins of a stable leaf wave out of its surface, \
    of both the margin that waves more. Two half-waves, between changes of the side to which it bends, are one wave.";
/// Width of a page with one panel.
const NARROW: f64 = 600.0;
/// Between the strip of a single method and its curves.
const CURVES_GAP: f64 = 12.0;
/// Height over width of a panel.
const ASPECT: f64 = 0.86;
/// With one axis: height of a method's strip, the gap below it, and room for its name
/// and count.
const STRIP: f64 = 30.0;
const STRIP_GAP: f64 = 9.0;
const METHOD: f64 = 130.0;
const COUNT: f64 = 100.0;

pub fn draw(map: &Map) -> Drawing {
    let name = &map.request.base.scenario().name;
    let title = format!("{name}: {}", map_shows(map.show));
    let width = match (map.request.axes.len(), map.request.methods.len()) {
        (2, 1) => NARROW,
        _ => WIDTH,
    };
    let mut drawing = Drawing::new(width, &title);
    let mut end = 0.0;
    drawing.group("header", |page| {
        header(page, LEFT, &title, &notes(map), None);
        end = draw_key(page, map, NOTE_BASE + 20.0);
        if map.show == MapShow::Waves {
            end = draw_meaning(page, end);
        }
    });
    let axes: Vec<Varied> = (map.request.axes.iter())
        .map(|axis| Varied::of(axis, &map.request.base.scenario().units))
        .collect();
    drawing.height = match axes.split_first() {
        Some((x, more)) => draw_panels(&mut drawing, map, x, more.first(), end),
        None => end,
    };
    drawing
}

fn notes(map: &Map) -> Vec<String> {
    let request = &map.request;
    let (known, confirmed) = map.known_and_confirmed();
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
    if let Some(segments) = request.base.knobs().segments {
        notes.push(format!("{segments} segments a vein"));
    }
    notes
}

/// Draws the key of the outcomes and marks that occur; returns where it ends.
fn draw_key(page: &mut Drawing, map: &Map, base: f64) -> f64 {
    let mut key = KeyRows::at(LEFT, base, SWATCH);
    for outcome in MapOutcome::ALL {
        let shown = |row: &MapRow| row.outcome == outcome && waves(map.show, row).is_none();
        if map.rows.iter().any(shown) {
            let name = match outcome {
                MapOutcome::Saddle => "saddle, with its index".to_string(),
                outcome => outcome.word().replace('-', " "),
            };
            key.entry(page, &name, |page, cell| panel::fill(page, cell, outcome));
        }
    }
    let counts = map.rows.iter().filter_map(|row| waves(map.show, row));
    let mut counts: Vec<f64> = counts.collect();
    counts.sort_by(f64::total_cmp);
    counts.dedup();
    for waves in counts {
        let name = match waves {
            0.0 => "stable, no waves".into(),
            1.0 => "1 wave".into(),
            waves => format!("{waves} waves"),
        };
        key.entry(page, &name, |page, cell| {
            panel::fill_waves(page, cell, waves)
        });
    }
    for (reference, name) in [
        (Confidence::Unconfirmed, "reference unconfirmed"),
        (Confidence::None, "no reference"),
    ] {
        if map.rows.iter().any(|row| row.reference == reference) {
            key.entry(page, name, |page, cell| panel::mark(page, cell, reference));
        }
    }
    if has_step_axis(map) {
        key.entry(page, "longest step known to be stable", |page, cell| {
            cell.line(page, panel::BOUND);
        });
    }
    key.end()
}

/// Draws the explanation of a map of waves; returns where it ends.
fn draw_meaning(page: &mut Drawing, mut top: f64) -> f64 {
    let room = page.width - LEFT - RIGHT;
    for line in Font::embedded().wrapped(MEANING, TICK_SIZE, room) {
        let base = DVec2::new(LEFT, top + TICK_SIZE);
        page.label(base, &line, TICK_SIZE, Anchor::Start, NOTE);
        top += 1.4 * TICK_SIZE;
    }
    top + 6.0
}

/// Whether explicit motion is shown over an axis of time steps.
fn has_step_axis(map: &Map) -> bool {
    let mut axes = map.request.axes.iter();
    map.request.methods.contains(&MapMethod::ExplicitMotion)
        && axes.any(|axis| axis.keys.sets(Knob::Step))
}

fn count(map: &Map, method: MapMethod) -> String {
    let waving = |row: &&MapRow| row.method == method && row.stable_waves() > Some(0.0);
    let (count, what) = match map.show {
        MapShow::Waves => (map.rows.iter().filter(waving).count(), "wave"),
        MapShow::Outcomes => (map.count(method, MapOutcome::Right), "right"),
    };
    format!("{count} of {} {what}", map.request.cells())
}

/// Draws a panel for every method or, with one axis, a strip. Returns the height of
/// the page.
fn draw_panels(
    drawing: &mut Drawing,
    map: &Map,
    x: &Varied,
    y: Option<&Varied>,
    start: f64,
) -> f64 {
    let methods = &map.request.methods;
    let columns = y.map_or(1, |_| methods.len().clamp(1, MOST_COLUMNS));
    let (corner, size, pitch) = match y {
        Some(_) => {
            let left = LEFT + 18.0;
            let room = WIDTH - RIGHT - left - (columns - 1) as f64 * GAP;
            let width = (room / columns as f64).min(WIDEST);
            let size = DVec2::new(width, ASPECT * width);
            let pitch = size + DVec2::new(GAP, PANEL_TITLE + TICKS + 6.0);
            (DVec2::new(left, start + PANEL_TITLE), size, pitch)
        }
        None => {
            let left = LEFT + METHOD;
            let size = DVec2::new(WIDTH - RIGHT - COUNT - left, STRIP);
            let pitch = DVec2::new(0.0, STRIP + STRIP_GAP);
            (DVec2::new(left, start + 10.0), size, pitch)
        }
    };
    let mut last = Cell { corner, size };
    for (i, &method) in methods.iter().enumerate() {
        let place = DVec2::new((i % columns) as f64, (i / columns) as f64);
        let cell = Cell::new(corner + place * pitch, size);
        // A single strip has its axis below the curves.
        let labelled = y.is_some() || (i + 1 == methods.len() && i > 0);
        drawing.group(method.word(), |page| {
            draw_method(page, map, method, cell, y.is_some());
            let panel = Panel::new(cell, x, y, labelled);
            let rows = map.rows.iter().filter(|row| row.method == method);
            panel.draw(page, map.show, rows);
            if method == MapMethod::ExplicitMotion && has_step_axis(map) {
                panel.draw_bound(page, &map.request);
            }
        });
        last = cell;
    }
    if let (None, [_]) = (y, methods.as_slice()) {
        return draw_curves(drawing, map, x, last, last.end().y + CURVES_GAP);
    }
    let end = last.end().y + TICKS;
    let across = columns as f64 * (size.x + GAP) - GAP;
    let below = DVec2::new(corner.x + 0.5 * across, end + 12.0);
    drawing.label(below, &x.axis.title(), TEXT_SIZE, Anchor::Middle, INK);
    if let Some(y) = y {
        let middle = DVec2::new(24.0, 0.5 * (corner.y + last.end().y));
        drawing.rotated_label(middle, &y.axis.title(), TEXT_SIZE, INK);
    }
    end + NAME
}

/// Draws a method's name and count, above a panel or to both sides of a strip.
fn draw_method(page: &mut Drawing, map: &Map, method: MapMethod, cell: Cell, above: bool) {
    let (name, count) = (method.word(), count(map, method));
    if above {
        let base = cell.corner - DVec2::new(0.0, 8.0);
        page.label(base, name, TEXT_SIZE, Anchor::Start, INK);
        let base = base.with_x(cell.end().x);
        return page.label(base, &count, TICK_SIZE, Anchor::End, NOTE);
    }
    let [left, right] = cell.midline();
    let gap = DVec2::new(10.0, 0.0);
    page.centered_label(left - gap, name, TEXT_SIZE, Anchor::End, INK);
    page.centered_label(right + gap, &count, TICK_SIZE, Anchor::Start, NOTE);
}

/// Smaller variations are rounding.
const ROUNDING: f64 = 1e-9;
const TALL: f64 = 260.0;
const LOW: f64 = 150.0;

/// A curve: its name, its colour, and its value in a row.
type PanelQuantity<'a> = (&'a str, Color, fn(&MapRow) -> Option<f64>);

/// The titles of the panels, the names of their axes, and their curves.
fn panels(map: &Map) -> Vec<(&str, String, Vec<PanelQuantity<'_>>)> {
    let units = &map.request.base.scenario().units;
    let length = units.length.as_deref();
    match map.show {
        MapShow::Outcomes => vec![
            (
                "where the tip is",
                with_unit("tip", length),
                vec![
                    ("x", CURVES[0], |row| row.tip_x),
                    ("y", CURVES[1], |row| row.tip_y),
                    ("z", CURVES[2], |row| row.tip_z),
                ],
            ),
            (
                "energy",
                with_unit("energy", units.energy().as_deref()),
                vec![("energy", CURVES[3], |row| row.energy)],
            ),
        ],
        MapShow::Waves => vec![
            (
                "waves along the margins, of stable leaves",
                "waves".into(),
                vec![("waves", CURVES[0], MapRow::stable_waves)],
            ),
            (
                "their amplitude",
                with_unit("amplitude", Some("L")),
                vec![("amplitude", CURVES[1], |row| {
                    row.stable_waves().and(row.margin_amplitude)
                })],
            ),
            (
                "mean twist of the veins",
                with_unit("twist", Some("rad")),
                vec![("twist", CURVES[3], |row| row.twist)],
            ),
        ],
    }
}

/// Draws the curves below `start`, as wide as the strip. Returns where they end.
fn draw_curves(page: &mut Drawing, map: &Map, x: &Varied, strip: Cell, start: f64) -> f64 {
    let values = &map.request.axes[0].values;
    let mut top = start;
    for (what, name, curves) in panels(map) {
        let height = if curves.len() > 1 { TALL } else { LOW };
        let cell = Cell::new(
            DVec2::new(strip.corner.x, top + PANEL_TITLE),
            DVec2::new(strip.size.x, height),
        );
        let lines = curves.iter().map(|(_, _, of)| {
            let mut line: Vec<(f64, f64)> = values.iter().map(|&x| (x, f64::NAN)).collect();
            for row in &map.rows {
                line[row.cell].1 = of(row).unwrap_or(f64::NAN);
            }
            line
        });
        let lines: Vec<_> = lines.collect();
        let known = lines.iter().flatten().map(|point| point.1);
        let up = Axis::holding(&name, known.filter(|value| value.is_finite())).at_least(ROUNDING);
        page.group("curves", |page| {
            let axes = Axes::titled(page, cell, ["", what], x.axis.clone(), up);
            let mut key = Key::right_of(cell);
            for ((name, color, _), line) in curves.iter().zip(lines) {
                axes.curve(page, &line, Stroke::new(*color, 1.6));
                axes.markers(page, line, Marker::Dot, *color);
                key.marked_line(page, name, "", *color);
            }
        });
        top = cell.end().y + PANEL_AXIS;
    }
    top
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::svg::text;
    use crate::report::sample;

    fn svg(map: &Map) -> String {
        text(&draw(map))
    }

    #[test]
    fn every_method_and_outcome_is_named() {
        let map = sample::map();
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
        let mut map = sample::map();
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
        let mut map = sample::map();
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
        assert!(curves(&super::tests::svg(&sample::map())).is_empty());
        map.show = MapShow::Waves;
        let svg = super::tests::svg(&map);
        assert_eq!(curves(&svg), [2, 2, 2]);
        assert!(svg.contains("mean twist"));
    }

    #[test]
    fn one_axis_and_missing_cells_are_drawn() {
        let mut map = sample::map();
        map.request.axes.remove(0);
        map.rows.retain(|row| row.cell < 3);
        let svg = svg(&map);
        assert!(svg.contains("3 of 4 cells"));
        assert!(!svg.contains("bending stiffness"));
    }
}
