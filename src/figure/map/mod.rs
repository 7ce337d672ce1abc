//! The figure of a map: one panel a method, one colour an outcome or, of
//! stable leaves if that is asked for, a number of waves.

mod axis;
mod panel;

use glam::DVec2;

use super::Pictured;
use super::colors::{INK, NOTE};
use super::drawing::{Anchor, Drawing, HALF_CAPITAL};
use super::font::Font;
use super::page::{Cell, LEFT, PANEL_TITLE, RIGHT, TEXT_SIZE, TICK_SIZE, TITLE_SIZE, WIDTH};
use crate::study::{Confidence, Knob, Map, MapMethod, MapOutcome, MapRow, MapShow};
use axis::Axis;
use panel::{Panel, Tile};

const TITLE_BASE: f64 = 38.0;
const NOTE_BASE: f64 = 60.0;
/// Height of a line of the legend.
const LINE: f64 = 20.0;
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
/// With one axis: height of a method's strip, and room for its name.
const STRIP: f64 = 30.0;
const STRIP_GAP: f64 = 9.0;
const NAMES: f64 = 150.0;

impl Pictured for Map {
    const SVG: &'static str = "map.svg";
    const PNG: &'static str = "map.png";

    fn draw(&self) -> Drawing {
        let name = &self.request.base.scenario().name;
        let title = match self.show {
            MapShow::Outcomes => format!("{name}: where methods fail"),
            MapShow::Waves => format!("{name}: waves along the margins"),
        };
        let mut drawing = Drawing {
            width: match (self.request.axes.len(), self.request.methods.len()) {
                (2, 1) => NARROW,
                _ => WIDTH,
            },
            height: 0.0,
            description: title.clone(),
            marks: Vec::new(),
        };
        let mut end = 0.0;
        drawing.group("header", |page| {
            let base = DVec2::new(LEFT, TITLE_BASE);
            page.label(base, &title, TITLE_SIZE, Anchor::Start, INK);
            let base = DVec2::new(LEFT, NOTE_BASE);
            page.label(base, &notes(self), TEXT_SIZE, Anchor::Start, NOTE);
            end = legend(page, self, NOTE_BASE + LINE);
        });
        let axes: Vec<Axis> = self.request.axes.iter().map(Axis::of).collect();
        drawing.height = match axes.as_slice() {
            [x] => strips(&mut drawing, self, x, end),
            [x, y, ..] => panels(&mut drawing, self, x, y, end),
            [] => end,
        };
        drawing
    }
}

fn notes(map: &Map) -> String {
    let request = &map.request;
    let rods = request.base.scenario().rods.len();
    let mut cells: Vec<_> = map
        .rows
        .iter()
        .map(|row| (row.cell, row.reference))
        .collect();
    cells.dedup_by_key(|(cell, _)| *cell);
    let confirmed = |(_, reference): &&(usize, Confidence)| *reference == Confidence::Confirmed;
    let known = match cells.len() {
        known if known < request.cells() => format!("{known} of {} cells", request.cells()),
        all => format!("{all} cells"),
    };
    let mut notes = vec![
        known,
        format!(
            "reference confirmed in {}",
            cells.iter().filter(confirmed).count()
        ),
    ];
    if !request
        .axes
        .iter()
        .any(|axis| axis.keys.to_string() == "leaf.rods")
    {
        notes.insert(0, format!("N = {rods}"));
    }
    if let Some(segments) = request.base.knobs().segments {
        notes.push(format!("{segments} segments a vein"));
    }
    // Spaces that SVG does not collapse.
    notes.join("\u{a0}\u{a0}·\u{a0}\u{a0}")
}

/// The outcomes and marks that occur; returns where it ends.
fn legend(page: &mut Drawing, map: &Map, mut base: f64) -> f64 {
    let font = Font::embedded();
    let mut x = LEFT;
    let mut entry = |page: &mut Drawing, text: &str, draw: &dyn Fn(&mut Drawing, Cell)| {
        let width = SWATCH + 6.0 + font.width(text, TEXT_SIZE);
        if x + width > page.width - RIGHT {
            (x, base) = (LEFT, base + LINE);
        }
        let middle = base - HALF_CAPITAL * TEXT_SIZE;
        let swatch = Cell {
            corner: DVec2::new(x, middle - 0.5 * SWATCH),
            size: DVec2::splat(SWATCH),
        };
        draw(page, swatch);
        let at = DVec2::new(x + SWATCH + 6.0, base);
        page.label(at, text, TEXT_SIZE, Anchor::Start, INK);
        x += width + 20.0;
    };
    for outcome in MapOutcome::ALL {
        let shown = |row: &MapRow| row.outcome == outcome && waves(map, row).is_none();
        if map.rows.iter().any(shown) {
            let text = match outcome {
                MapOutcome::Saddle => "saddle, with its index".to_string(),
                outcome => outcome.word().replace('-', " "),
            };
            entry(page, &text, &|page, swatch| {
                panel::fill(page, swatch, outcome)
            });
        }
    }
    let mut counts: Vec<f64> = map.rows.iter().filter_map(|row| waves(map, row)).collect();
    counts.sort_by(f64::total_cmp);
    counts.dedup();
    for waves in counts {
        let text = match waves {
            0.0 => "stable, no waves".into(),
            1.0 => "1 wave".into(),
            waves => format!("{waves} waves"),
        };
        entry(page, &text, &|page, swatch| {
            panel::fill_waves(page, swatch, waves)
        });
    }
    for reference in [Confidence::Unconfirmed, Confidence::None] {
        if map.rows.iter().any(|row| row.reference == reference) {
            let text = match reference {
                Confidence::Unconfirmed => "reference unconfirmed",
                _ => "no reference",
            };
            entry(page, text, &|page, swatch| {
                panel::mark(page, swatch, reference)
            });
        }
    }
    if step_axis(map).is_some() {
        let text = "longest step known to be stable";
        entry(page, text, &|page, swatch| panel::bound_key(page, swatch));
    }
    base + 14.0
}

/// The axis of time steps, if explicit motion is shown over one.
fn step_axis(map: &Map) -> Option<usize> {
    let axes = &map.request.axes;
    let shown = map.request.methods.contains(&MapMethod::ExplicitMotion);
    let steps = axes.iter().position(|axis| axis.keys.sets(Knob::Step));
    steps.filter(|_| shown)
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

/// One axis: a strip for every method. Returns the height of the page.
fn strips(drawing: &mut Drawing, map: &Map, x: &Axis, start: f64) -> f64 {
    let left = LEFT + NAMES - 20.0;
    let size = DVec2::new(WIDTH - RIGHT - 100.0 - left, STRIP);
    let mut corner = DVec2::new(left, start + 10.0);
    let methods = &map.request.methods;
    for (i, &method) in methods.iter().enumerate() {
        let last = i + 1 == methods.len();
        drawing.group(method.word(), |page| {
            let middle = corner.y + 0.5 * STRIP + HALF_CAPITAL * TEXT_SIZE;
            let base = DVec2::new(corner.x - 10.0, middle);
            page.label(base, method.word(), TEXT_SIZE, Anchor::End, INK);
            let base = DVec2::new(corner.x + size.x + 10.0, middle);
            page.label(base, &count(map, method), TICK_SIZE, Anchor::Start, NOTE);
            let panel = Panel {
                cell: Cell { corner, size },
                x,
                y: None,
            };
            panel.draw(page, &tiles(map, method), last);
            if method == MapMethod::ExplicitMotion && step_axis(map) == Some(0) {
                panel.bound(page, &map.request);
            }
        });
        corner.y += STRIP + STRIP_GAP;
    }
    let below = corner.y - STRIP_GAP + TICKS + 16.0;
    let middle = DVec2::new(left + 0.5 * size.x, below);
    drawing.label(middle, &x.name, TEXT_SIZE, Anchor::Middle, INK);
    below + 12.0
}

/// Two axes: a panel for every method. Returns the height of the page.
fn panels(drawing: &mut Drawing, map: &Map, x: &Axis, y: &Axis, start: f64) -> f64 {
    let methods = &map.request.methods;
    let columns = methods.len().clamp(1, MOST_COLUMNS);
    let left = LEFT + 18.0;
    let room = WIDTH - RIGHT - left - (columns - 1) as f64 * GAP;
    let width = (room / columns as f64).min(WIDEST);
    let size = DVec2::new(width, SHAPE * width);
    let across = columns as f64 * (width + GAP) - GAP;
    let pitch = size.y + PANEL_TITLE + TICKS + 6.0;
    let rows = methods.len().div_ceil(columns);
    for (i, &method) in methods.iter().enumerate() {
        let (column, row) = (i % columns, i / columns);
        let corner = DVec2::new(
            left + column as f64 * (width + GAP),
            start + PANEL_TITLE + row as f64 * pitch,
        );
        drawing.group(method.word(), |page| {
            let base = corner - DVec2::new(0.0, 8.0);
            page.label(base, method.word(), TEXT_SIZE, Anchor::Start, INK);
            let base = base + DVec2::new(size.x, 0.0);
            page.label(base, &count(map, method), TICK_SIZE, Anchor::End, NOTE);
            let panel = Panel {
                cell: Cell { corner, size },
                x,
                y: Some(y),
            };
            panel.draw(page, &tiles(map, method), true);
            if method == MapMethod::ExplicitMotion && step_axis(map).is_some() {
                panel.bound(page, &map.request);
            }
        });
    }
    let end = start + PANEL_TITLE + rows as f64 * pitch - 6.0 - PANEL_TITLE;
    let below = DVec2::new(left + 0.5 * across, end + 12.0);
    drawing.label(below, &x.name, TEXT_SIZE, Anchor::Middle, INK);
    let beside = DVec2::new(24.0, 0.5 * (start + PANEL_TITLE + end - TICKS));
    drawing.upright_label(beside, &y.name, TEXT_SIZE, INK);
    end + NAME
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::{FigurePng, FigureSvg};
    use crate::report::{Format, sample};

    fn svg(map: &Map) -> String {
        let mut bytes = Vec::new();
        FigureSvg.write(map, &mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
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
        assert_eq!(svg.matches("<g ").count(), svg.matches("</g>").count());
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
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

    #[test]
    fn the_picture_is_as_wide_as_that_of_a_leaf() {
        let mut bytes = Vec::new();
        FigurePng.write(&sample::map(), &mut bytes).unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info();
        assert_eq!(reader.unwrap().info().width, 1800);
    }
}
