//! A panel with two logarithmic axes: one line for each series, failures in
//! lanes above, and a key beside.

use glam::DVec2;

use super::colors::{Color, FRAME, GRID, INK, NOTE, SHADOW};
use super::drawing::{Anchor, Drawing, HALF_CAPITAL, Stroke, rectangle};
use super::font::Font;
use super::logaxis::{Axis, Labels};
use super::page::{Cell, LEFT, PANEL_AXIS, RIGHT, TEXT_SIZE, TICK_SIZE, WIDTH};
use super::series::{FRONT, Point, Series, cross, halo, marker, stretch};

const FRAME_HEIGHT: f64 = 430.0;
/// Right of the frame, for the key and the names of lanes.
const KEY: f64 = 252.0;
/// Height of a lane of failures.
const LANE: f64 = 16.0;
/// Between the lanes and the frame.
const LANE_GAP: f64 = 7.0;

/// The whole panel.
pub struct LogLog {
    pub series: Vec<Series>,
    pub across: (&'static str, Labels),
    pub up: (&'static str, Labels),
    /// Values of the axis upwards that cannot be told from zero.
    pub floor: Option<f64>,
}

impl LogLog {
    /// Names of the lanes, in the order in which they appear.
    fn lanes(&self) -> Vec<&str> {
        let mut lanes: Vec<&str> = Vec::new();
        for failure in self.series.iter().flat_map(|series| &series.failures) {
            if !lanes.contains(&failure.word.as_str()) {
                lanes.push(&failure.word);
            }
        }
        lanes
    }

    fn above(&self) -> f64 {
        match self.lanes().len() {
            0 => 0.0,
            lanes => lanes as f64 * LANE + LANE_GAP,
        }
    }

    /// Height of the panel with lanes and axis.
    pub fn height(&self) -> f64 {
        self.above() + FRAME_HEIGHT + PANEL_AXIS
    }

    /// Draws the panel below `start`.
    pub fn draw(&self, page: &mut Drawing, start: f64) {
        let points = || self.series.iter().flat_map(|series| &series.points);
        let failures = self.series.iter().flat_map(|series| &series.failures);
        let failed = failures.filter_map(|failure| failure.x);
        let numbers = match &self.across.1 {
            Labels::Numbers(numbers) => numbers.iter().map(|&n| n as f64).collect(),
            _ => Vec::new(),
        };
        let plot = Plot {
            cell: Cell {
                corner: DVec2::new(LEFT, start + self.above()),
                size: DVec2::new(WIDTH - LEFT - RIGHT - KEY, FRAME_HEIGHT),
            },
            across: Axis::of(points().map(|point| point.x).chain(failed).chain(numbers)),
            up: Axis::of(points().map(|point| point.y).chain(self.floor)),
        };
        self.draw_floor(page, &plot);
        self.draw_axes(page, &plot);
        self.draw_front(page, &plot);
        for series in &self.series {
            plot.draw_line(page, series);
        }
        for series in &self.series {
            plot.draw_points(page, series);
        }
        self.draw_lanes(page, &plot, start);
        self.draw_key(page, &plot);
    }

    /// Shades what cannot be told from zero.
    fn draw_floor(&self, page: &mut Drawing, plot: &Plot) {
        let Some(floor) = self.floor.filter(|floor| floor.is_finite()) else {
            return;
        };
        let Cell { corner, size } = plot.cell;
        let top = plot.place(1.0, floor).y;
        let height = corner.y + size.y - top;
        let start = DVec2::new(corner.x, top);
        let area = DVec2::new(size.x, height);
        page.shape(rectangle(start, area), Color(240, 240, 243), None);
        let stroke = Stroke::new(SHADOW, 1.0);
        page.line(start, start + DVec2::new(size.x, 0.0), stroke);
    }

    fn draw_axes(&self, page: &mut Drawing, plot: &Plot) {
        const TICK_LENGTH: f64 = 4.0;
        const MINOR_LENGTH: f64 = 2.0;
        let Cell { corner, size } = plot.cell;
        let end = corner + size;
        let (grid, rim) = (Stroke::new(GRID, 0.7), Stroke::new(FRAME, 0.8));
        let columns = self.across.1.of(&plot.across);
        let rows = self.up.1.of(&plot.up);
        let x = |value: f64| corner.x + plot.across.part(value) * size.x;
        let y = |value: f64| end.y - plot.up.part(value) * size.y;
        for (value, _) in &columns {
            let x = x(*value);
            page.line(DVec2::new(x, corner.y), DVec2::new(x, end.y), grid);
        }
        for decade in plot.up.decades() {
            let y = y(10f64.powi(decade));
            page.line(DVec2::new(corner.x, y), DVec2::new(end.x, y), grid);
        }
        page.stroke(rectangle(corner, size), rim);
        for (value, text) in &columns {
            let foot = DVec2::new(x(*value), end.y);
            page.line(foot, foot + DVec2::new(0.0, TICK_LENGTH), rim);
            let base = foot + DVec2::new(0.0, TICK_LENGTH + 1.2 * TICK_SIZE);
            page.label(base, text, TICK_SIZE, Anchor::Middle, NOTE);
        }
        if !matches!(self.across.1, Labels::Numbers(_)) {
            for value in plot.across.between() {
                let foot = DVec2::new(x(value), end.y);
                page.line(foot, foot + DVec2::new(0.0, MINOR_LENGTH), rim);
            }
        }
        for (value, text) in &rows {
            let foot = DVec2::new(corner.x, y(*value));
            page.line(foot, foot - DVec2::new(TICK_LENGTH, 0.0), rim);
            let base = foot + DVec2::new(-TICK_LENGTH - 3.0, HALF_CAPITAL * TICK_SIZE);
            page.label(base, text, TICK_SIZE, Anchor::End, NOTE);
        }
        let below = DVec2::new(0.5 * (corner.x + end.x), end.y + 36.0);
        page.label(below, self.across.0, TEXT_SIZE, Anchor::Middle, INK);
        let beside = DVec2::new(corner.x - 53.0, 0.5 * (corner.y + end.y));
        page.upright_label(beside, self.up.0, TEXT_SIZE, INK);
    }

    /// A broad band under the lines that joins the points of the front.
    fn draw_front(&self, page: &mut Drawing, plot: &Plot) {
        let points = self.series.iter().flat_map(|series| &series.points);
        let mut front: Vec<&Point> = points.filter(|point| point.front).collect();
        front.sort_by(|a, b| a.x.total_cmp(&b.x));
        let places: Vec<DVec2> = front.iter().map(|p| plot.place(p.x, p.y)).collect();
        for pair in places.windows(2) {
            page.line(pair[0], pair[1], Stroke::new(FRONT, 8.0));
        }
        for place in places {
            halo(page, place);
        }
    }

    /// Crosses for runs that failed, and what the lanes are called.
    fn draw_lanes(&self, page: &mut Drawing, plot: &Plot, start: f64) {
        const ROOM: f64 = 11.0;
        let Cell { corner, size } = plot.cell;
        let end = corner.x + size.x;
        for (row, lane) in self.lanes().into_iter().enumerate() {
            let top = start + row as f64 * LANE;
            let middle = top + 0.5 * LANE;
            let area = DVec2::new(size.x, LANE - 2.0);
            let start = DVec2::new(corner.x, top + 1.0);
            page.shape(rectangle(start, area), Color(250, 240, 238), None);
            let base = DVec2::new(end + 10.0, middle + HALF_CAPITAL * TICK_SIZE);
            let name = fitted(lane, KEY - 14.0);
            page.label(base, &name, TICK_SIZE, Anchor::Start, NOTE);
            let mut from_right = end;
            for series in &self.series {
                let failures = series.failures.iter();
                let mut placeless = false;
                for failure in failures.filter(|failure| failure.word == lane) {
                    match failure.x {
                        Some(x) => {
                            let x = plot.place(x, 1.0).x;
                            cross(page, DVec2::new(x, middle), series.color);
                        }
                        None => placeless = true,
                    }
                }
                if placeless {
                    from_right -= ROOM;
                    cross(page, DVec2::new(from_right, middle), series.color);
                }
            }
        }
    }

    fn draw_key(&self, page: &mut Drawing, plot: &Plot) {
        const ENTRY: f64 = 21.0;
        const SWATCH: f64 = 28.0;
        let Cell { corner, size } = plot.cell;
        let mut at = corner + DVec2::new(size.x + 14.0, 10.0);
        let say = |page: &mut Drawing, at: DVec2, text: &str, color: Color| {
            let base = at + DVec2::new(SWATCH + 7.0, HALF_CAPITAL * TICK_SIZE);
            let text = fitted(text, KEY - SWATCH - 23.0);
            page.label(base, &text, TICK_SIZE, Anchor::Start, color);
        };
        for series in &self.series {
            let end = at + DVec2::new(SWATCH, 0.0);
            stretch(page, at, end, series);
            marker(page, 0.5 * (at + end), series);
            say(page, at, &series.name, INK);
            at.y += ENTRY;
        }
        at.y += 0.4 * ENTRY;
        let middle = |at: DVec2| at + DVec2::new(0.5 * SWATCH, 0.0);
        let points = || self.series.iter().flat_map(|series| &series.points);
        if points().any(|point| point.front) {
            let end = at + DVec2::new(SWATCH, 0.0);
            page.line(at, end, Stroke::new(FRONT, 8.0));
            halo(page, middle(at));
            say(page, at, "Pareto front: nothing is", NOTE);
            at.y += 0.7 * ENTRY;
            say(page, at, "both faster and more accurate", NOTE);
            at.y += ENTRY;
        }
        if !self.lanes().is_empty() {
            cross(page, middle(at), NOTE);
            say(page, at, "failed or not run: see above", NOTE);
            at.y += ENTRY;
        }
        if self.floor.is_some() {
            let corner = at - DVec2::new(0.0, 6.0);
            let area = DVec2::new(SWATCH, 12.0);
            let rim = Stroke::new(SHADOW, 1.0);
            page.shape(rectangle(corner, area), Color(240, 240, 243), Some(rim));
            say(page, at, "below what is known of the", NOTE);
            at.y += 0.7 * ENTRY;
            say(page, at, "reference itself", NOTE);
        }
    }
}

/// From values to the page.
struct Plot {
    cell: Cell,
    across: Axis,
    up: Axis,
}

impl Plot {
    fn place(&self, x: f64, y: f64) -> DVec2 {
        let Cell { corner, size } = self.cell;
        let part = DVec2::new(self.across.part(x), 1.0 - self.up.part(y));
        corner + size * part.clamp(DVec2::ZERO, DVec2::ONE)
    }

    fn draw_line(&self, page: &mut Drawing, series: &Series) {
        for pair in series.points.windows(2) {
            let [from, to] = [pair[0], pair[1]].map(|point| self.place(point.x, point.y));
            stretch(page, from, to, series);
        }
    }

    fn draw_points(&self, page: &mut Drawing, series: &Series) {
        for [from, to] in series.points.iter().filter_map(|point| point.spread) {
            let [from, to] = [from, to].map(|(x, y)| self.place(x, y));
            page.line(from, to, Stroke::new(series.color, 1.1));
        }
        for point in &series.points {
            marker(page, self.place(point.x, point.y), series);
        }
    }
}

/// The text, or as much of it as fits, with an ellipsis.
fn fitted(text: &str, width: f64) -> String {
    let font = Font::embedded();
    let mut shown: String = text.chars().filter(|c| !c.is_control()).collect();
    if font.width(&shown, TICK_SIZE) <= width {
        return shown;
    }
    while font.width(&shown, TICK_SIZE) + TICK_SIZE > width && shown.pop().is_some() {}
    shown + "…"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_are_cut() {
        assert_eq!(fitted("explicit", 200.0), "explicit");
        assert!(fitted(&"explicit ".repeat(20), 200.0).ends_with('…'));
    }
}
