//! A map: one panel a method, one colour an outcome or, of stable leaves if
//! that is asked for, a number of waves.

mod panel;

use glam::DVec2;

use super::colors::{INK, NOTE};
use super::drawing::{Anchor, Drawing};
use super::header::{NOTE_BASE, header};
use super::key::KeyRows;
use super::page::{Cell, LEFT, PANEL_TITLE, RIGHT, TEXT_SIZE, TICK_SIZE, WIDTH};
use crate::study::{Confidence, Knob, Map, MapMethod, MapOutcome, MapRow, MapShow};
use panel::{Panel, Tile, Varied};

/// Width of a sample in the key.
const SWATCH: f64 = 12.0;
/// Below each panel, for ticks and, below the last, the name of the axis.
const TICKS: f64 = 26.0;
const NAME: f64 = 26.0;
/// Between panels, for the ticks of the right one.
const GAP: f64 = 44.0;
const MOST_COLUMNS: usize = 3;
const WIDEST: f64 = 470.0;
/// Width of a page with one panel.
const NARROW: f64 = 600.0;
/// Height over width of a panel.
const SHAPE: f64 = 0.86;
/// With one axis: height of a method's strip, and room for its name and count.
const STRIP: f64 = 30.0;
const STRIP_GAP: f64 = 9.0;
const METHOD: f64 = 130.0;
const COUNT: f64 = 100.0;

/// Draws the whole page.
pub fn draw(map: &Map) -> Drawing {
    let name = &map.request.base.scenario().name;
    let title = match map.show {
        MapShow::Outcomes => format!("{name}: where methods fail"),
        MapShow::Waves => format!("{name}: waves along the margins"),
    };
    let width = match (map.request.axes.len(), map.request.methods.len()) {
        (2, 1) => NARROW,
        _ => WIDTH,
    };
    let mut drawing = Drawing::new(width, &title);
    let mut end = 0.0;
    drawing.group("header", |page| {
        header(page, LEFT, &title, &notes(map), None);
        end = draw_key(page, map, NOTE_BASE + 20.0);
    });
    let axes: Vec<Varied> = map.request.axes.iter().map(Varied::of).collect();
    drawing.height = match axes.as_slice() {
        [x] => draw_strips(&mut drawing, map, x, end),
        [x, y, ..] => draw_panels(&mut drawing, map, x, y, end),
        [] => end,
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
    notes.push(match known {
        known if known < request.cells() => format!("{known} of {} cells", request.cells()),
        all => format!("{all} cells"),
    });
    notes.push(format!("reference confirmed in {confirmed}"));
    if let Some(segments) = request.base.knobs().segments {
        notes.push(format!("{segments} segments a vein"));
    }
    notes
}

/// The outcomes and marks that occur; returns where it ends.
fn draw_key(page: &mut Drawing, map: &Map, base: f64) -> f64 {
    let mut key = KeyRows::at(base, SWATCH);
    for outcome in MapOutcome::ALL {
        let shown = |row: &MapRow| row.outcome == outcome && waves(map, row).is_none();
        if map.rows.iter().any(shown) {
            let name = match outcome {
                MapOutcome::Saddle => "saddle, with its index".to_string(),
                outcome => outcome.word().replace('-', " "),
            };
            key.entry(page, &name, |page, cell| panel::fill(page, cell, outcome));
        }
    }
    let mut counts: Vec<f64> = map.rows.iter().filter_map(|row| waves(map, row)).collect();
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
            let [from, to] = cell.midline();
            page.line(from, to, panel::bound_stroke());
        });
    }
    key.end()
}

/// Whether explicit motion is shown over an axis of time steps.
fn has_step_axis(map: &Map) -> bool {
    let mut axes = map.request.axes.iter();
    map.request.methods.contains(&MapMethod::ExplicitMotion)
        && axes.any(|axis| axis.keys.sets(Knob::Step))
}

/// What is known of a method, cell by cell.
fn tiles(map: &Map, method: MapMethod) -> Vec<Option<Tile>> {
    let mut tiles = vec![None; map.request.cells()];
    for row in map.rows.iter().filter(|row| row.method == method) {
        tiles[row.cell] = Some(Tile {
            outcome: row.outcome,
            index: row.index,
            reference: row.reference,
            waves: waves(map, row),
        });
    }
    tiles
}

/// The waves a cell shows.
fn waves(map: &Map, row: &MapRow) -> Option<f64> {
    row.stable_waves().filter(|_| map.show == MapShow::Waves)
}

fn count(map: &Map, method: MapMethod) -> String {
    if map.show == MapShow::Waves {
        let waving = |row: &&MapRow| row.method == method && row.stable_waves() > Some(0.0);
        let count = map.rows.iter().filter(waving).count();
        return format!("{count} of {} wave", map.request.cells());
    }
    let right = map.count(method, MapOutcome::Right);
    format!("{right} of {} right", map.request.cells())
}

fn draw_panel(page: &mut Drawing, map: &Map, method: MapMethod, panel: &Panel) {
    panel.draw(page, &tiles(map, method));
    if method == MapMethod::ExplicitMotion && has_step_axis(map) {
        panel.draw_bound(page, &map.request);
    }
}

/// One axis: a strip for every method. Returns the height of the page.
fn draw_strips(drawing: &mut Drawing, map: &Map, x: &Varied, start: f64) -> f64 {
    let mut cell = Cell {
        corner: DVec2::new(LEFT + METHOD, start + 10.0),
        size: DVec2::new(WIDTH - RIGHT - COUNT - LEFT - METHOD, STRIP),
    };
    let methods = &map.request.methods;
    for (i, &method) in methods.iter().enumerate() {
        drawing.group(method.word(), |page| {
            let [left, right] = cell.midline();
            let air = DVec2::new(10.0, 0.0);
            page.beside(left - air, method.word(), TEXT_SIZE, Anchor::End, INK);
            let count = count(map, method);
            page.beside(right + air, &count, TICK_SIZE, Anchor::Start, NOTE);
            let last = i + 1 == methods.len();
            let panel = Panel::new(cell, x, None, last);
            draw_panel(page, map, method, &panel);
        });
        cell.corner.y += STRIP + STRIP_GAP;
    }
    let below = cell.corner.y - STRIP_GAP + TICKS + 16.0;
    let middle = DVec2::new(cell.middle().x, below);
    drawing.label(middle, &x.axis.title(), TEXT_SIZE, Anchor::Middle, INK);
    below + 12.0
}

/// Two axes: a panel for every method. Returns the height of the page.
fn draw_panels(drawing: &mut Drawing, map: &Map, x: &Varied, y: &Varied, start: f64) -> f64 {
    let methods = &map.request.methods;
    let columns = methods.len().clamp(1, MOST_COLUMNS);
    let left = LEFT + 18.0;
    let room = WIDTH - RIGHT - left - (columns - 1) as f64 * GAP;
    let width = (room / columns as f64).min(WIDEST);
    let size = DVec2::new(width, SHAPE * width);
    let pitch = size + DVec2::new(GAP, PANEL_TITLE + TICKS + 6.0);
    let rows = methods.len().div_ceil(columns);
    for (i, &method) in methods.iter().enumerate() {
        let place = DVec2::new((i % columns) as f64, (i / columns) as f64);
        let corner = DVec2::new(left, start + PANEL_TITLE) + place * pitch;
        drawing.group(method.word(), |page| {
            let base = corner - DVec2::new(0.0, 8.0);
            page.label(base, method.word(), TEXT_SIZE, Anchor::Start, INK);
            let base = base + DVec2::new(size.x, 0.0);
            page.label(base, &count(map, method), TICK_SIZE, Anchor::End, NOTE);
            let panel = Panel::new(Cell { corner, size }, x, Some(y), true);
            draw_panel(page, map, method, &panel);
        });
    }
    let across = columns as f64 * pitch.x - GAP;
    let end = start + rows as f64 * pitch.y - 6.0;
    let below = DVec2::new(left + 0.5 * across, end + 12.0);
    drawing.label(below, &x.axis.title(), TEXT_SIZE, Anchor::Middle, INK);
    let beside = DVec2::new(24.0, 0.5 * (start + PANEL_TITLE + end - TICKS));
    drawing.upright_label(beside, &y.axis.title(), TEXT_SIZE, INK);
    end + NAME
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
        for text in [
            "load.gravity[2]",
            "stiffness.bending_2",
            "no reference",
            "10⁻¹",
        ] {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn waves_are_shown_in_place_of_outcomes() {
        let mut map = sample::map();
        assert!(!svg(&map).contains("waves"));
        map.show = MapShow::Waves;
        let svg = svg(&map);
        for text in ["waves along the margins", ">1.5 waves<", "stable, no waves"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("other equilibrium") && svg.contains("saddle"));
    }

    #[test]
    fn one_axis_and_missing_cells_are_drawn() {
        let mut map = sample::map();
        map.request.axes.remove(0);
        map.rows.retain(|row| row.cell < 3);
        let svg = svg(&map);
        assert!(svg.contains("3 of 4 cells"));
        assert!(!svg.contains("stiffness.bending_2"));
    }
}
