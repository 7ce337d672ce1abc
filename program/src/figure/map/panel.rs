//! One panel of a map: its cells in the colours of their outcomes.

use crate::figure::axes::Axes;
use crate::figure::axis::{Axis, Ticks};
use crate::figure::drawing::{
    Anchor, Color, Drawing, INK, NOTE, Stroke, WHITE, circle, rectangle, vein_color,
};
use crate::figure::layout::Cell;
use crate::figure::quantity::Quantity;
use glam::DVec2;
use leafdyn::scenario::Units;
use leafdyn::study::{Confidence, Knob, MapOutcome, MapRequest, MapRow, MapShow, Vary};

/// Smaller cells have no gaps between them and no marks.
const SEPARATE: f64 = 5.0;
/// Smaller cells have no numbers.
const NUMBERED: f64 = 13.0;
const NUMBER_SIZE: f64 = 8.0;
/// Of stable leaves.
pub const PALE: Color = Color(226, 236, 226);
/// More waves than this have the same colour.
const MOST_WAVES: f64 = 2.5;

/// Colours that the colour-blind can distinguish (Okabe and Ito); that of right answers is
/// light. Those that are alike without colours also differ in their marks.
fn color(outcome: MapOutcome) -> Color {
    match outcome {
        MapOutcome::Right => Color(170, 214, 240),
        MapOutcome::OtherEquilibrium => Color(240, 228, 66),
        MapOutcome::Saddle => Color(213, 94, 0),
        MapOutcome::Inaccurate => Color(204, 121, 167),
        MapOutcome::NotConverged => Color(128, 128, 134),
        MapOutcome::Diverged => Color(32, 32, 36),
        MapOutcome::Refused => Color(240, 240, 242),
        MapOutcome::OutOfTime => Color(0, 92, 158),
    }
}

/// Waves along the margins, where these are shown and the leaf is stable.
pub fn waves(show: MapShow, row: &MapRow) -> Option<f64> {
    row.stable_waves().filter(|_| show == MapShow::Waves)
}

/// Fills a cell, with the mark of its outcome if it has one and is large enough.
pub fn fill(page: &mut Drawing, cell: Cell, outcome: MapOutcome) {
    page.shape(rectangle(cell.corner, cell.size), color(outcome), None);
    if cell.size.min_element() < SEPARATE {
        return;
    }
    let inset = 0.25 * cell.size;
    let (low, high) = (cell.corner + inset, cell.end() - inset);
    let rising = (low.with_y(high.y), high.with_y(low.y));
    let level = (low.with_y(cell.middle().y), high.with_y(cell.middle().y));
    let (color, lines): (Color, &[(DVec2, DVec2)]) = match outcome {
        MapOutcome::Refused => (NOTE, &[(low, high), rising]),
        MapOutcome::OtherEquilibrium => (NOTE, &[(low, high)]),
        MapOutcome::NotConverged => (WHITE, &[rising]),
        MapOutcome::Inaccurate => (WHITE, &[level]),
        _ => return,
    };
    for &(from, to) in lines {
        page.line(from, to, Stroke::new(color, 1.0));
    }
}

pub fn fill_waves(page: &mut Drawing, cell: Cell, waves: f64) {
    let color = match waves {
        0.0 => PALE,
        waves => vein_color((waves - 1.0) / (MOST_WAVES - 1.0)),
    };
    page.shape(rectangle(cell.corner, cell.size), color, None);
}

/// Indices from this one on have the same colour.
pub const DARKEST_INDEX: usize = 4;

/// Fills a cell lightly by the index of its equilibrium: the more, the darker.
pub fn fill_index(page: &mut Drawing, cell: Cell, index: usize) {
    let color = match index {
        0 => PALE,
        1 => Color(255, 240, 222),
        2 => Color(252, 224, 194),
        3 => Color(246, 204, 168),
        _ => Color(236, 182, 144),
    };
    page.shape(rectangle(cell.corner, cell.size), color, None);
}

/// Marks a cell whose reference is not confirmed: a dot, or a ring if there is
/// none.
pub fn mark(page: &mut Drawing, cell: Cell, reference: Confidence) {
    let radius = (0.14 * cell.size.min_element()).clamp(1.0, 2.2);
    let at = cell.corner.with_x(cell.end().x) + 2.0 * radius * DVec2::new(-1.0, 1.0);
    let (color, rim) = match reference {
        Confidence::Confirmed => return,
        Confidence::Unconfirmed => (INK, Stroke::new(WHITE, 0.5)),
        Confidence::None => (WHITE, Stroke::new(INK, 0.8)),
    };
    page.shape(circle(at, radius), color, Some(rim));
}

/// Stroke of the longest stable step.
pub const BOUND: Stroke = Stroke::new(Color(170, 0, 60), 2.0);

pub struct Varied {
    pub axis: Axis,
    /// Edges of the cells, as fractions of the axis: one more than there are cells.
    edges: Vec<f64>,
}

impl Varied {
    /// Cells in the order given, each around its value.
    pub fn of(vary: &Vary, units: &Units) -> Self {
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
        let name = Quantity::of(&vary.keys.to_string(), units).axis();
        let mut axis = Axis::linear(&name, start, end);
        axis.sign = sign;
        if vary.keys.is_whole() {
            axis.ticks = Ticks::At(vary.values.clone());
        }
        let part = |edge: f64| (edge - start) / (end - start);
        Varied {
            axis,
            edges: edges.into_iter().map(part).collect(),
        }
    }

    fn cells(&self) -> usize {
        self.edges.len() - 1
    }
}

/// A panel; with one axis it is a strip.
pub struct Panel<'a> {
    axes: Axes,
    x: &'a Varied,
    y: Option<&'a Varied>,
}

impl<'a> Panel<'a> {
    pub fn new(cell: Cell, x: &'a Varied, y: Option<&'a Varied>, labelled: bool) -> Self {
        // Panels share the names of their axes.
        let unnamed = |axis: &Axis| Axis {
            name: String::new(),
            ..axis.clone()
        };
        let across = Axis {
            labelled,
            ..unnamed(&x.axis)
        };
        let strip = Axis {
            ticks: Ticks::At(Vec::new()),
            ..Axis::linear("", 0.0, 1.0)
        };
        let up = y.map_or(strip, |y| unnamed(&y.axis));
        let axes = Axes { cell, across, up };
        Panel { axes, x, y }
    }

    /// Cells are counted along the last axis first.
    pub fn draw<'r>(
        &self,
        page: &mut Drawing,
        show: MapShow,
        rows: impl Iterator<Item = &'r MapRow>,
    ) {
        for row in rows {
            self.draw_cell(page, row, waves(show, row));
        }
        self.axes.draw_frame(page);
    }

    fn place(&self, i: usize) -> (usize, usize) {
        let along_y = self.y.map_or(1, Varied::cells);
        (i / along_y, i % along_y)
    }

    fn rectangle(&self, i: usize) -> Cell {
        let Cell { corner, size } = self.axes.cell;
        let (column, row) = self.place(i);
        let (left, right) = (self.x.edges[column], self.x.edges[column + 1]);
        let (low, high) = self
            .y
            .map_or((0.0, 1.0), |y| (y.edges[row], y.edges[row + 1]));
        Cell::new(
            corner + size * DVec2::new(left, 1.0 - high),
            size * DVec2::new(right - left, high - low),
        )
    }

    fn draw_cell(&self, page: &mut Drawing, row: &MapRow, waves: Option<f64>) {
        let mut cell = self.rectangle(row.cell);
        let large = cell.size.min_element() >= SEPARATE;
        if large {
            let inset = DVec2::splat(0.4);
            cell.corner += inset;
            cell.size -= 2.0 * inset;
        }
        match waves {
            Some(waves) => fill_waves(page, cell, waves),
            None => fill(page, cell, row.outcome),
        }
        if large {
            mark(page, cell, row.reference);
        }
        let number = match (row.outcome, row.index, waves) {
            (MapOutcome::Saddle, Some(index), _) => index.to_string(),
            (_, _, Some(waves)) if waves > 0.0 => waves.to_string(),
            _ => return,
        };
        if cell.size.min_element() >= NUMBERED {
            page.centered_label(cell.middle(), &number, NUMBER_SIZE, Anchor::Middle, WHITE);
        }
    }

    /// Draws the longest step known to be stable, across every row or column.
    pub fn draw_bound(&self, page: &mut Drawing, request: &MapRequest) {
        let along_x = request.axes[0].keys.sets(Knob::Step);
        let inside = |fraction: &f64| (0.0..=1.0).contains(fraction);
        for i in 0..request.cells() {
            let (column, row) = self.place(i);
            let (first, axis) = match along_x {
                true => (column == 0, &self.axes.across),
                false => (row == 0, &self.axes.up),
            };
            let step = request.stable_step(i).filter(|_| first);
            let fraction = step.map(|step| axis.fraction(step));
            let Some(fraction) = fraction.filter(inside) else {
                continue;
            };
            let (tile, Cell { corner, size }) = (self.rectangle(i), self.axes.cell);
            let place = corner + size * DVec2::new(fraction, 1.0 - fraction);
            let (from, to) = match along_x {
                true => (tile.corner.with_x(place.x), tile.end().with_x(place.x)),
                false => (tile.corner.with_y(place.y), tile.end().with_y(place.y)),
            };
            page.line(from, to, BOUND);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::axis::Direction;

    fn varied(given: &str) -> Varied {
        Varied::of(&given.parse().unwrap(), &Units::default())
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
            let edges = varied(given).edges;
            assert_eq!(edges[0], 0.0, "{given}");
            assert_eq!(edges[edges.len() - 1], 1.0, "{given}");
            assert!(edges.windows(2).all(|pair| pair[0] < pair[1]), "{given}");
        }
    }

    #[test]
    fn ticks_are_readable() {
        let texts = |given: &str, length: f64| -> Vec<String> {
            let ticks = varied(given).axis.ticks(length, Direction::Across);
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
