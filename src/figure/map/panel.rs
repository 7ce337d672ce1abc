//! One panel of a map: its cells in the colours of their outcomes.

use glam::DVec2;

use super::super::colors::{Color, FRAME, INK, NOTE, WHITE, vein_color};
use super::super::drawing::{Anchor, Drawing, HALF_CAPITAL, Stroke, circle, rectangle};
use super::super::page::{Cell, TICK_SIZE};
use super::axis::Axis;
use crate::study::{Confidence, Knob, MapOutcome, MapRequest};

const TICK_LENGTH: f64 = 4.0;
/// Cells smaller than this are not set apart, and bear no marks.
const APART: f64 = 5.0;
/// And no numbers, if smaller than this.
const NUMBERED: f64 = 13.0;
const NUMBER_SIZE: f64 = 8.0;
/// Room that a tick's text takes at least, along each axis.
const TICK_ROOM: DVec2 = DVec2::new(38.0, 22.0);

/// What a cell shows.
#[derive(Clone, Copy)]
pub struct Tile {
    pub outcome: MapOutcome,
    pub index: Option<usize>,
    pub reference: Confidence,
    /// Waves along the margins, where these are shown and the leaf is stable.
    pub waves: Option<f64>,
}

/// Colours that the colour-blind can tell apart (Okabe and Ito), right ones
/// light and calm.
fn color(outcome: MapOutcome) -> Color {
    match outcome {
        MapOutcome::Right => Color(170, 214, 240),
        MapOutcome::OtherEquilibrium => Color(240, 228, 66),
        MapOutcome::Saddle => Color(213, 94, 0),
        MapOutcome::Inaccurate => Color(204, 121, 167),
        MapOutcome::NotConverged => Color(150, 150, 156),
        MapOutcome::Diverged => Color(32, 32, 36),
        MapOutcome::Refused => Color(232, 232, 236),
        MapOutcome::OutOfTime => Color(0, 92, 158),
    }
}

/// A leaf that does not wave.
const PALE: Color = Color(226, 236, 226);

/// Fills a cell; one that was refused is crossed out.
pub fn fill(page: &mut Drawing, cell: Cell, outcome: MapOutcome) {
    page.shape(rectangle(cell.corner, cell.size), color(outcome), None);
    if outcome == MapOutcome::Refused && cell.size.min_element() >= APART {
        let inset = 0.25 * cell.size;
        let (low, high) = (cell.corner + inset, cell.corner + cell.size - inset);
        let thin = Stroke::new(FRAME, 0.8);
        page.line(low, high, thin);
        page.line(DVec2::new(low.x, high.y), DVec2::new(high.x, low.y), thin);
    }
}

/// Waves beyond which colours do not change any more.
const MOST_WAVES: f64 = 2.5;

/// Fills a cell by its number of waves: none is pale.
pub fn fill_waves(page: &mut Drawing, cell: Cell, waves: f64) {
    let color = match waves {
        0.0 => PALE,
        waves => vein_color((waves - 1.0) / (MOST_WAVES - 1.0)),
    };
    page.shape(rectangle(cell.corner, cell.size), color, None);
}

/// Marks a cell whose reference is not confirmed: a dot, or a ring if there is
/// none.
pub fn mark(page: &mut Drawing, cell: Cell, reference: Confidence) {
    let radius = (0.14 * cell.size.min_element()).clamp(1.0, 2.2);
    let at = cell.corner + DVec2::new(cell.size.x, 0.0) + 2.0 * radius * DVec2::new(-1.0, 1.0);
    match reference {
        Confidence::Confirmed => {}
        Confidence::Unconfirmed => {
            page.shape(circle(at, radius), INK, Some(Stroke::new(WHITE, 0.5)));
        }
        Confidence::None => page.shape(circle(at, radius), WHITE, Some(Stroke::new(INK, 0.8))),
    }
}

const BOUND: Color = Color(170, 0, 60);

/// How the longest stable step is drawn.
pub fn bound_key(page: &mut Drawing, cell: Cell) {
    let middle = cell.corner + 0.5 * cell.size;
    let half = DVec2::new(0.5 * cell.size.x, 0.0);
    page.line(middle - half, middle + half, Stroke::new(BOUND, 2.0));
}

/// A panel; with one axis it is a strip.
pub struct Panel<'a> {
    pub cell: Cell,
    pub x: &'a Axis,
    pub y: Option<&'a Axis>,
}

impl Panel<'_> {
    /// Cells are counted along the last axis first; `named`: with ticks below.
    pub fn draw(&self, page: &mut Drawing, tiles: &[Option<Tile>], named: bool) {
        for (i, tile) in tiles.iter().enumerate() {
            if let Some(tile) = tile {
                self.tile(page, i, *tile);
            }
        }
        let rim = Stroke::new(FRAME, 0.8);
        page.stroke(rectangle(self.cell.corner, self.cell.size), rim);
        self.ticks(page, named);
    }

    /// Which cell along x and y, and how many there are along y.
    fn place(&self, i: usize) -> (usize, usize) {
        let along_y = self.y.map_or(1, Axis::cells);
        (i / along_y, i % along_y)
    }

    fn rectangle(&self, i: usize) -> Cell {
        let Cell { corner, size } = self.cell;
        let (column, row) = self.place(i);
        let (left, right) = self.x.cell(column);
        let (low, high) = self.y.map_or((0.0, 1.0), |y| y.cell(row));
        Cell {
            corner: corner + size * DVec2::new(left, 1.0 - high),
            size: size * DVec2::new(right - left, high - low),
        }
    }

    fn tile(&self, page: &mut Drawing, i: usize, tile: Tile) {
        let mut cell = self.rectangle(i);
        let large = cell.size.min_element() >= APART;
        if large {
            let air = DVec2::splat(0.4);
            cell.corner += air;
            cell.size -= 2.0 * air;
        }
        match tile.waves {
            Some(waves) => fill_waves(page, cell, waves),
            None => fill(page, cell, tile.outcome),
        }
        if large {
            mark(page, cell, tile.reference);
        }
        let number = match (tile.outcome, tile.index, tile.waves) {
            (MapOutcome::Saddle, Some(index), _) => index.to_string(),
            (_, _, Some(waves)) if waves > 0.0 => waves.to_string(),
            _ => return,
        };
        if cell.size.min_element() >= NUMBERED {
            let middle = cell.corner + 0.5 * cell.size;
            page.centered(middle, &number, NUMBER_SIZE, WHITE);
        }
    }

    fn ticks(&self, page: &mut Drawing, named: bool) {
        let Cell { corner, size } = self.cell;
        let rim = Stroke::new(FRAME, 0.8);
        let most = size / TICK_ROOM;
        for (part, text) in self.x.ticks(most.x as usize) {
            let foot = corner + size * DVec2::new(part, 1.0);
            page.line(foot, foot + DVec2::new(0.0, TICK_LENGTH), rim);
            if named {
                let base = foot + DVec2::new(0.0, TICK_LENGTH + 1.2 * TICK_SIZE);
                page.label(base, &text, TICK_SIZE, Anchor::Middle, NOTE);
            }
        }
        for (part, text) in self.y.map_or(Vec::new(), |y| y.ticks(most.y as usize)) {
            let foot = corner + size * DVec2::new(0.0, 1.0 - part);
            page.line(foot, foot - DVec2::new(TICK_LENGTH, 0.0), rim);
            let base = foot + DVec2::new(-TICK_LENGTH - 3.0, HALF_CAPITAL * TICK_SIZE);
            page.label(base, &text, TICK_SIZE, Anchor::End, NOTE);
        }
    }

    /// The longest step known to be stable, across every row or column.
    pub fn bound(&self, page: &mut Drawing, request: &MapRequest) {
        let steps_along_x = request.axes[0].keys.sets(Knob::Step);
        let Cell { corner, size } = self.cell;
        let stroke = Stroke::new(BOUND, 2.0);
        for i in 0..request.cells() {
            let (column, row) = self.place(i);
            let first = if steps_along_x { column } else { row };
            if first > 0 {
                continue;
            }
            let axis = if steps_along_x { Some(self.x) } else { self.y };
            let stable = request.stable_step(i);
            let Some(part) = axis.zip(stable).and_then(|(axis, step)| axis.part(step)) else {
                continue;
            };
            let tile = self.rectangle(i);
            let (from, to) = match steps_along_x {
                true => {
                    let x = corner.x + part * size.x;
                    let y = tile.corner.y;
                    (DVec2::new(x, y), DVec2::new(x, y + tile.size.y))
                }
                false => {
                    let y = corner.y + (1.0 - part) * size.y;
                    let x = tile.corner.x;
                    (DVec2::new(x, y), DVec2::new(x + tile.size.x, y))
                }
            };
            page.line(from, to, stroke);
        }
    }
}
