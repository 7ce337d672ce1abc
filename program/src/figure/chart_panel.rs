//! The panel of a chart: one line per series, with failures in lanes above.

use crate::figure::axes::Axes;
use crate::figure::axis::Axis;
use crate::figure::drawing::{
    Anchor, Color, Drawing, INK, NOTE, SHADOW, Stroke, circle, rectangle,
};
use crate::figure::font::Font;
use crate::figure::layout::{Cell, PANEL_AXIS, TICK_SIZE};
use crate::figure::markers::Marker;
use crate::figure::page::Key;
use glam::DVec2;

const FRAME_HEIGHT: f64 = 430.0;
/// Right of the frame, for the key and the names of lanes.
const KEY: f64 = 252.0;
const LANE: f64 = 16.0;
const LANE_GAP: f64 = 7.0;
/// Colour of the points on the Pareto front and of the band that joins them.
const FRONT: Color = Color(247, 205, 92);
/// Colour of the area below the accuracy of the reference.
const FLOOR: Color = Color(240, 240, 243);
const LANES: Color = Color(250, 240, 238);

/// A point, in the units of the axes.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub at: (f64, f64),
    /// Ends of its spread in repeated measurements.
    pub spread: [(f64, f64); 2],
    pub front: bool,
}

/// A run without a point.
#[derive(Clone, Debug)]
pub struct Failure {
    /// Where it is on the horizontal axis; `None`: not known.
    pub x: Option<f64>,
    pub word: String,
}

pub struct Series {
    pub name: String,
    pub color: Color,
    pub dashed: bool,
    pub marker: Marker,
    pub points: Vec<Point>,
    pub failures: Vec<Failure>,
}

impl Series {
    /// Without points so far.
    pub fn new(name: String, color: Color, marker: Marker, dashed: bool) -> Self {
        Series {
            name,
            color,
            dashed,
            marker,
            points: Vec::new(),
            failures: Vec::new(),
        }
    }

    fn stroke(&self) -> Stroke {
        Stroke::new(self.color, 1.5).dashed(self.dashed)
    }

    fn places(&self) -> impl Iterator<Item = (f64, f64)> {
        self.points.iter().map(|point| point.at)
    }
}

pub struct ChartPanel {
    pub series: Vec<Series>,
    pub across: Axis,
    pub up: Axis,
    pub floor: Option<f64>,
}

impl ChartPanel {
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

    fn lanes_height(&self) -> f64 {
        match self.lanes().len() {
            0 => 0.0,
            lanes => lanes as f64 * LANE + LANE_GAP,
        }
    }

    /// Height of the panel with lanes and axis.
    pub fn height(&self) -> f64 {
        self.lanes_height() + FRAME_HEIGHT + PANEL_AXIS
    }

    pub fn draw(&self, page: &mut Drawing, start: f64) {
        let axes = Axes {
            cell: Cell::left_of_key(start + self.lanes_height(), FRAME_HEIGHT, KEY),
            across: self.across.clone(),
            up: self.up.clone(),
        };
        self.draw_floor(page, axes.cell);
        axes.draw(page);
        self.draw_front(page, &axes);
        for series in &self.series {
            let line: Vec<(f64, f64)> = series.places().collect();
            axes.curve(page, &line, series.stroke());
        }
        for series in &self.series {
            for point in &series.points {
                axes.curve(page, &point.spread, Stroke::new(series.color, 1.1));
            }
            axes.markers(page, series.places(), series.marker, series.color);
        }
        for (lane, word) in self.lanes().into_iter().enumerate() {
            self.draw_lane(page, axes.cell, start + lane as f64 * LANE, word);
        }
        self.draw_key(page, axes.cell);
    }

    fn draw_floor(&self, page: &mut Drawing, cell: Cell) {
        let Some(floor) = self.floor else { return };
        let height = cell.size.y * self.up.fraction(floor).clamp(0.0, 1.0);
        let start = DVec2::new(cell.corner.x, cell.end().y - height);
        let area = DVec2::new(cell.size.x, height);
        page.shape(rectangle(start, area), FLOOR, None);
        page.line(start, start.with_x(cell.end().x), Stroke::new(SHADOW, 1.0));
    }

    /// A broad band under the lines that joins the points of the front.
    fn draw_front(&self, page: &mut Drawing, axes: &Axes) {
        let points = self.series.iter().flat_map(|series| &series.points);
        let front = points.filter(|point| point.front);
        let mut front: Vec<(f64, f64)> = front.map(|point| point.at).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        axes.curve(page, &front, Stroke::new(FRONT, 8.0));
        for place in front.into_iter().filter_map(|point| axes.at(point)) {
            halo(page, place);
        }
    }

    /// Draws crosses for the runs that failed with this word, and the word.
    fn draw_lane(&self, page: &mut Drawing, cell: Cell, top: f64, word: &str) {
        const SPACING: f64 = 11.0;
        let (left, right) = (cell.corner.x, cell.end().x);
        let middle = top + 0.5 * LANE;
        let area = DVec2::new(cell.size.x, LANE - 2.0);
        let start = DVec2::new(left, top + 1.0);
        page.shape(rectangle(start, area), LANES, None);
        let name = Font::embedded().shortened(word, TICK_SIZE, KEY - 14.0);
        let at = DVec2::new(right + 10.0, middle);
        page.centered_label(at, &name, TICK_SIZE, Anchor::Start, NOTE);
        let mut from_right = right;
        for series in &self.series {
            let failures = || series.failures.iter().filter(|it| it.word == word);
            let places = failures().filter_map(|it| Some(self.across.fraction(it.x?)));
            for fraction in places.filter(|fraction| fraction.is_finite()) {
                let x = left + fraction.clamp(0.0, 1.0) * cell.size.x;
                Marker::Cross.draw(page, DVec2::new(x, middle), series.color);
            }
            if failures().any(|failure| failure.x.is_none()) {
                from_right -= SPACING;
                Marker::Cross.draw(page, DVec2::new(from_right, middle), series.color);
            }
        }
    }

    fn draw_key(&self, page: &mut Drawing, cell: Cell) {
        let mut key = Key::right_of(cell);
        for series in &self.series {
            key.entry(page, &series.name, "", |page, cell| {
                cell.line(page, series.stroke());
                series.marker.draw(page, cell.middle(), series.color);
            });
        }
        let points = || self.series.iter().flat_map(|series| &series.points);
        if points().any(|point| point.front) {
            let note = "nothing is both faster and more accurate";
            key.entry(page, "Pareto front", note, |page, cell| {
                cell.line(page, Stroke::new(FRONT, 8.0));
                halo(page, cell.middle());
            });
        }
        if !self.lanes().is_empty() {
            let note = "failed or not run: see above";
            key.marker(page, "", note, Marker::Cross, NOTE);
        }
        if self.floor.is_some() {
            let note = "below what is known of the reference itself";
            key.entry(page, "", note, |page, cell| {
                let rim = Stroke::new(SHADOW, 1.0);
                page.shape(rectangle(cell.corner, cell.size), FLOOR, Some(rim));
            });
        }
    }
}

fn halo(page: &mut Drawing, at: DVec2) {
    page.shape(circle(at, 7.5), FRONT, Some(Stroke::new(INK, 0.8)));
}
