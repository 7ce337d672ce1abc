//! Speed against accuracy: error against time, and time against the number of veins, for every method of
//! relaxation and for other programs. A series is a line of points; its failures are crosses in lanes above
//! the frame, one lane for each way to fail.

use crate::figure::drawing::axes::{Axis, PanelAxes, TickPlacement};
use crate::figure::drawing::formats::Font;
use crate::figure::drawing::labels::{Legend, new_page};
use crate::figure::drawing::markers::Marker;
use crate::figure::drawing::{
    BLUE, Color, Drawing, FONT_SIZE, GREEN, NOTE_COLOR, ORANGE, PAGE, PURPLE, PageRectangle,
    SHADOW_COLOR, SKY, SLATE, Stroke, TEXT_COLOR, TextAnchor, VERMILION, circle_path,
    rectangle_path,
};
use crate::report::contender_name;
use crate::report::numbers::format_error_bound;
use glam::DVec2;
use leafdyn::study::{Chart, ChartRow, PeerProgram, ScalingStudy, SolverConfig};

/// Fixed colors of the peers that come with this crate, the same in every chart;
/// other peers take the rest in turn.
const KNOWN_PEER_COLORS: [(&str, Color); 3] = [
    ("solve_bvp", Color(120, 120, 128)),
    ("exudyn", Color(150, 105, 60)),
    ("pyelastica", Color(100, 130, 90)),
];

const OTHER_PEER_COLORS: [Color; 3] = [
    Color(125, 100, 160),
    Color(70, 130, 140),
    Color(165, 120, 130),
];

/// Errors below this one, down to zero, are drawn as if they were as large.
const SMALLEST_ERROR_DRAWN: f64 = 1e-17;

const FEWEST_DECADES: f64 = 1.0;

pub fn draw_chart(chart: &Chart) -> Drawing {
    let rods = chart.rods;
    let rows = chart.rows.iter().map(|row| RowOfLeaf { rods, row });
    let mut series = contender_series(&rows.collect::<Vec<_>>(), SeriesOf::from_chart(chart));
    series.extend(peer_series(&chart.peers));
    let floor = chart.reference.as_ref().map(|found| found.known_within);
    let floor = floor.filter(|floor| floor.is_normal() && *floor > 0.0);
    let failed = series.iter().flat_map(|series| &series.failures);
    let seconds = series_points(&series).map(|point| point.0);
    let errors = series_points(&series).map(|point| point.1).chain(floor);
    let name = match chart.motion {
        true => "largest true error of tips and middles in the motion / L",
        false => "largest true error of positions / L",
    };
    let panel = ChartPanel {
        across: time_axis(seconds.chain(failed.filter_map(|failure| failure.x))),
        up: Axis::logarithmic(name, errors, FEWEST_DECADES),
        series,
        floor,
    };
    let reference = match &chart.reference {
        None if chart.motion => "no reference: no method follows the motion".into(),
        None => "no reference: no equilibrium was found".into(),
        Some(found) => {
            let what = match found.confirmed {
                true => "reference confirmed by two methods, known within",
                false => "the reference is NOT confirmed; taken to be within",
            };
            format!("{what} {}", format_error_bound(found.known_within))
        }
    };
    let notes = [
        format!("N = {}", chart.rods),
        reference,
        "left is faster, down is more accurate".into(),
    ];
    let what = if chart.motion { ", in motion" } else { "" };
    let title = format!("{}{what}: speed against accuracy", chart.scenario);
    chart_page(&title, &notes, &panel)
}

pub fn draw_scaling(scaling: &ScalingStudy) -> Drawing {
    let rows = scaling.rows.iter().map(|found| RowOfLeaf {
        rods: found.rods,
        row: &found.row,
    });
    let series = contender_series(&rows.collect::<Vec<_>>(), SeriesOf::VEINS);
    let mut rods: Vec<usize> = scaling.rows.iter().map(|found| found.rods).collect();
    rods.sort_unstable();
    rods.dedup();
    let rods: Vec<f64> = rods.into_iter().map(|rods| rods as f64).collect();
    let axis = Axis::logarithmic("number of veins N", rods.iter().copied(), FEWEST_DECADES);
    let panel = ChartPanel {
        across: Axis {
            ticks: TickPlacement::WholeNumbers(rods),
            ..axis
        },
        up: time_axis(series_points(&series).map(|point| point.1)),
        series,
        floor: None,
    };
    let mut notes = vec![format!("to a tolerance of {:e}", scaling.tolerance)];
    if !scaling.unconfirmed.is_empty() {
        let rods: Vec<String> = scaling.unconfirmed.iter().map(usize::to_string).collect();
        let rods = rods.join(", ");
        notes.push(format!("the reference is NOT confirmed for N = {rods}"));
    }
    let title = format!("{}: time against the number of veins", scaling.scenario);
    chart_page(&title, &notes, &panel)
}

fn time_axis(values: impl Iterator<Item = f64>) -> Axis {
    let name = "time on one thread: median, and quartiles as a thin line";
    Axis {
        ticks: TickPlacement::PowersInSeconds,
        ..Axis::logarithmic(name, values, FEWEST_DECADES)
    }
}

fn chart_page(title: &str, notes: &[String], panel: &ChartPanel) -> Drawing {
    let mut drawing = new_page(PAGE.left_margin, title, notes, None);
    drawing.height = (PAGE.header + panel.total_height()).ceil();
    drawing.draw_group("chart", |page| panel.draw(page, PAGE.header));
    drawing
}

fn series_points(series: &[ChartSeries]) -> impl Iterator<Item = (f64, f64)> {
    series.iter().flat_map(ChartSeries::point_coordinates)
}

/// A row of a chart, and the number of veins of its leaf.
struct RowOfLeaf<'c> {
    rods: usize,
    row: &'c ChartRow,
}

/// How the points of a series look, and the line through them.
#[derive(Clone, Copy)]
struct SeriesStyle {
    color: Color,
    marker: Marker,
    dashed: bool,
}

/// Color and marker of each contender, in the order of [`SolverConfig::ALL`].
const CONTENDER_STYLES: [SeriesStyle; SolverConfig::ALL.len()] = {
    const fn solid(color: Color, marker: Marker) -> SeriesStyle {
        SeriesStyle {
            color,
            marker,
            dashed: false,
        }
    }
    [
        solid(BLUE, Marker::Circle),
        solid(SKY, Marker::Square),
        solid(VERMILION, Marker::Circle),
        solid(ORANGE, Marker::Square),
        solid(GREEN, Marker::Triangle),
        solid(PURPLE, Marker::Wedge),
        solid(SLATE, Marker::Diamond),
    ]
};

fn contender_style(who: SolverConfig) -> SeriesStyle {
    CONTENDER_STYLES[who.number().unwrap_or(0)]
}

/// What is charted.
#[derive(Clone, Copy)]
struct SeriesOf {
    /// Seconds over veins, and not errors over seconds.
    over_veins: bool,
    /// Motions, and not leaves at rest.
    motion: bool,
    /// The contender that is called the default.
    default: SolverConfig,
}

impl SeriesOf {
    const VEINS: SeriesOf = SeriesOf {
        over_veins: true,
        motion: false,
        default: SolverConfig::ALL[0],
    };

    fn from_chart(chart: &Chart) -> Self {
        SeriesOf {
            over_veins: false,
            motion: chart.motion,
            default: chart.default,
        }
    }
}

/// A series for each contender with results: seconds over veins, or errors over
/// seconds.
fn contender_series(rows: &[RowOfLeaf], charted: SeriesOf) -> Vec<ChartSeries> {
    let SeriesOf {
        over_veins,
        motion,
        default,
    } = charted;
    let of = |who: SolverConfig| {
        let default = if who == default { " (default)" } else { "" };
        let name = format!("{}{default}", contender_name(who, motion));
        let mut series = ChartSeries::new(name, contender_style(who));
        for RowOfLeaf { rods, row } in rows.iter().filter(|it| it.row.contender == who) {
            let rods = *rods as f64;
            let place = |seconds: f64, error: f64| match over_veins {
                true => (rods, seconds),
                false => (seconds, error.max(SMALLEST_ERROR_DRAWN)),
            };
            match row.seconds.zip(row.seconds_and_error()) {
                Some((seconds, (median, error))) => series.points.push(ChartPoint {
                    coordinates: place(median, error),
                    spread: [seconds.q1, seconds.q3].map(|time| place(time, error)),
                    is_on_front: row.pareto == Some(true),
                }),
                // Over veins a failure has a position even if it was not run.
                None => series.failures.push(FailedRun {
                    x: match over_veins {
                        true => Some(rods),
                        false => row.seconds.map(|spread| spread.median),
                    },
                    word: row.ending.word().into(),
                }),
            }
        }
        series
    };
    let mut all: Vec<ChartSeries> = SolverConfig::ALL.into_iter().map(of).collect();
    all.retain(|series| !(series.points.is_empty() && series.failures.is_empty()));
    all
}

fn peer_color(name: &str, others: usize) -> Color {
    let known = KNOWN_PEER_COLORS.iter().find(|(known, _)| *known == name);
    known.map_or(
        OTHER_PEER_COLORS[others % OTHER_PEER_COLORS.len()],
        |(_, color)| *color,
    )
}

/// A dashed series for each other program, from large errors to small.
fn peer_series(peers: &[PeerProgram]) -> Vec<ChartSeries> {
    let mut all: Vec<ChartSeries> = Vec::new();
    for peer in peers {
        let place = all.iter().position(|series| series.name == peer.name);
        let place = place.unwrap_or_else(|| {
            let style = SeriesStyle {
                color: peer_color(&peer.name, all.len()),
                marker: Marker::Ring,
                dashed: true,
            };
            all.push(ChartSeries::new(peer.name.clone(), style));
            all.len() - 1
        });
        match peer
            .seconds_and_error()
            .map(|(x, y)| (x, y.max(SMALLEST_ERROR_DRAWN)))
        {
            Some(at) => all[place].points.push(ChartPoint {
                coordinates: at,
                spread: [peer.seconds.q1, peer.seconds.q3].map(|x| (x, at.1)),
                is_on_front: peer.pareto,
            }),
            None => all[place].failures.push(FailedRun {
                x: Some(peer.seconds.median),
                word: peer.outcome.clone(),
            }),
        }
    }
    for series in &mut all {
        series
            .points
            .sort_by(|a, b| b.coordinates.1.total_cmp(&a.coordinates.1));
    }
    all
}

/// Sizes of a chart, in pixels.
struct ChartLayout {
    frame: f64,
    /// Width right of the frame, for the key and the names of lanes.
    key: f64,
    /// Height of a lane of failures, and the gap below all.
    lane: f64,
    lane_gap: f64,
}

const LAYOUT: ChartLayout = ChartLayout {
    frame: 430.0,
    key: 252.0,
    lane: 16.0,
    lane_gap: 7.0,
};

/// Color of the points on the Pareto front and of the band that joins them.
const PARETO_FRONT_COLOR: Color = Color(247, 205, 92);

/// Color of the area below the accuracy of the reference.
const REFERENCE_ACCURACY_COLOR: Color = Color(240, 240, 243);

const FAILURE_LANES_COLOR: Color = Color(250, 240, 238);

/// A point, in the units of the axes.
#[derive(Clone, Copy, Debug)]
struct ChartPoint {
    pub coordinates: (f64, f64),
    /// Ends of its spread in repeated measurements.
    pub spread: [(f64, f64); 2],
    pub is_on_front: bool,
}

/// A run without a point.
#[derive(Clone, Debug)]
struct FailedRun {
    /// Its value along the horizontal axis, if that is known.
    pub x: Option<f64>,
    pub word: String,
}

struct ChartSeries {
    pub name: String,
    pub style: SeriesStyle,
    pub points: Vec<ChartPoint>,
    pub failures: Vec<FailedRun>,
}

impl ChartSeries {
    pub fn new(name: String, style: SeriesStyle) -> Self {
        ChartSeries {
            name,
            style,
            points: Vec::new(),
            failures: Vec::new(),
        }
    }

    fn stroke(&self) -> Stroke {
        Stroke::new(self.style.color, 1.5).with_dashes(self.style.dashed)
    }

    fn point_coordinates(&self) -> impl Iterator<Item = (f64, f64)> {
        self.points.iter().map(|point| point.coordinates)
    }
}

struct ChartPanel {
    pub series: Vec<ChartSeries>,
    pub across: Axis,
    pub up: Axis,
    pub floor: Option<f64>,
}

impl ChartPanel {
    /// Names of the lanes, in the order in which they appear.
    fn failure_lanes(&self) -> Vec<&str> {
        let mut lanes: Vec<&str> = Vec::new();
        for failure in self.series.iter().flat_map(|series| &series.failures) {
            if !lanes.contains(&failure.word.as_str()) {
                lanes.push(&failure.word);
            }
        }
        lanes
    }

    fn lanes_height(&self) -> f64 {
        match self.failure_lanes().len() {
            0 => 0.0,
            lanes => lanes as f64 * LAYOUT.lane + LAYOUT.lane_gap,
        }
    }

    /// Height of the panel with lanes and axis.
    fn total_height(&self) -> f64 {
        self.lanes_height() + LAYOUT.frame + PAGE.panel_axis
    }

    pub fn draw(&self, page: &mut Drawing, start: f64) {
        let axes = PanelAxes {
            cell: PageRectangle::left_of_legend(
                start + self.lanes_height(),
                LAYOUT.frame,
                LAYOUT.key,
            ),
            across: self.across.clone(),
            up: self.up.clone(),
        };
        self.draw_reference_accuracy(page, axes.cell);
        axes.draw(page);
        self.draw_pareto_front(page, &axes);
        for series in &self.series {
            let line: Vec<(f64, f64)> = series.point_coordinates().collect();
            axes.draw_curve(page, &line, series.stroke());
        }
        for series in &self.series {
            for point in &series.points {
                axes.draw_curve(page, &point.spread, Stroke::new(series.style.color, 1.1));
            }
            axes.draw_markers(
                page,
                series.point_coordinates(),
                series.style.marker,
                series.style.color,
            );
        }
        for (lane, word) in self.failure_lanes().into_iter().enumerate() {
            self.draw_failure_lane(page, axes.cell, start + lane as f64 * LAYOUT.lane, word);
        }
        self.draw_legend(page, axes.cell);
    }

    fn draw_reference_accuracy(&self, page: &mut Drawing, cell: PageRectangle) {
        let Some(floor) = self.floor else { return };
        let height = cell.size.y * self.up.fraction(floor).clamp(0.0, 1.0);
        let start = DVec2::new(cell.corner.x, cell.opposite_corner().y - height);
        let area = DVec2::new(cell.size.x, height);
        page.draw_shape(rectangle_path(start, area), REFERENCE_ACCURACY_COLOR, None);
        page.draw_line(
            start,
            start.with_x(cell.opposite_corner().x),
            Stroke::new(SHADOW_COLOR, 1.0),
        );
    }

    /// A broad band under the lines that joins the points of the front.
    fn draw_pareto_front(&self, page: &mut Drawing, axes: &PanelAxes) {
        let points = self.series.iter().flat_map(|series| &series.points);
        let front = points.filter(|point| point.is_on_front);
        let mut front: Vec<(f64, f64)> = front.map(|point| point.coordinates).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        axes.draw_curve(page, &front, Stroke::new(PARETO_FRONT_COLOR, 8.0));
        for place in front
            .into_iter()
            .filter_map(|point| axes.page_position(point))
        {
            draw_halo(page, place);
        }
    }

    /// Draws crosses for the runs that failed with this word, and the word.
    fn draw_failure_lane(&self, page: &mut Drawing, cell: PageRectangle, top: f64, word: &str) {
        const CROSS_SPACING: f64 = 11.0;
        let (left, right) = (cell.corner.x, cell.opposite_corner().x);
        let middle = top + 0.5 * LAYOUT.lane;
        let area = DVec2::new(cell.size.x, LAYOUT.lane - 2.0);
        let start = DVec2::new(left, top + 1.0);
        page.draw_shape(rectangle_path(start, area), FAILURE_LANES_COLOR, None);
        let name = Font::embedded().shorten_text(word, FONT_SIZE.tick, LAYOUT.key - 14.0);
        let at = DVec2::new(right + 10.0, middle);
        page.draw_centered_label(at, &name, FONT_SIZE.tick, TextAnchor::Start, NOTE_COLOR);
        let mut from_right = right;
        for series in &self.series {
            let failures = || series.failures.iter().filter(|it| it.word == word);
            let places = failures().filter_map(|it| Some(self.across.fraction(it.x?)));
            for fraction in places.filter(|fraction| fraction.is_finite()) {
                let x = left + fraction.clamp(0.0, 1.0) * cell.size.x;
                Marker::Cross.draw(page, DVec2::new(x, middle), series.style.color);
            }
            if failures().any(|failure| failure.x.is_none()) {
                from_right -= CROSS_SPACING;
                Marker::Cross.draw(page, DVec2::new(from_right, middle), series.style.color);
            }
        }
    }

    fn draw_legend(&self, page: &mut Drawing, cell: PageRectangle) {
        let mut key = Legend::right_of(cell);
        for series in &self.series {
            key.add_entry(page, &series.name, "", |page, cell| {
                cell.draw_midline(page, series.stroke());
                (series.style.marker).draw(page, cell.middle(), series.style.color);
            });
        }
        let points = || self.series.iter().flat_map(|series| &series.points);
        if points().any(|point| point.is_on_front) {
            let note = "nothing is both faster and more accurate";
            key.add_entry(page, "Pareto front", note, |page, cell| {
                cell.draw_midline(page, Stroke::new(PARETO_FRONT_COLOR, 8.0));
                draw_halo(page, cell.middle());
            });
        }
        if !self.failure_lanes().is_empty() {
            let note = "failed or not run: see above";
            key.add_marker(page, "", note, Marker::Cross, NOTE_COLOR);
        }
        if self.floor.is_some() {
            let note = "below what is known of the reference itself";
            key.add_entry(page, "", note, |page, cell| {
                let rim = Stroke::new(SHADOW_COLOR, 1.0);
                page.draw_shape(
                    rectangle_path(cell.corner, cell.size),
                    REFERENCE_ACCURACY_COLOR,
                    Some(rim),
                );
            });
        }
    }
}

fn draw_halo(page: &mut Drawing, at: DVec2) {
    page.draw_shape(
        circle_path(at, 7.5),
        PARETO_FRONT_COLOR,
        Some(Stroke::new(TEXT_COLOR, 0.8)),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::formats::checked_svg_text;
    use crate::report::sample;

    fn svg(chart: &Chart) -> String {
        checked_svg_text(&draw_chart(chart))
    }

    #[test]
    fn every_series_and_every_kind_of_failure_is_named() {
        let svg = svg(&sample::sample_chart());
        let texts = "fan: speed against accuracy|N = 5|semi-implicit, extrapolated|\
            semi-implicit, single grids|single shooting|solve_bvp|not-at-rest|not-run|\
            not-converged max-nodes|Pareto front|1 ms|10⁻⁸|\
            reference confirmed by two methods, known within 1.0×10⁻¹²";
        for text in texts.split('|') {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn an_unconfirmed_reference_is_reported() {
        let mut chart = sample::sample_chart();
        chart.reference.as_mut().unwrap().confirmed = false;
        assert!(svg(&chart).contains("NOT confirmed"));
        chart.reference = None;
        chart.rows.iter_mut().for_each(|row| row.true_error = None);
        assert!(svg(&chart).contains("no reference"));
    }

    #[test]
    fn leaves_are_marked_by_their_veins() {
        let mut scaling = sample::sample_scaling();
        let first = checked_svg_text(&draw_scaling(&scaling));
        assert!(first.contains("to a tolerance of 1e-6"));
        for text in [">5<", ">15<", "number of veins N", "not-run"] {
            assert!(first.contains(text), "{text}");
        }
        scaling.unconfirmed = vec![15];
        let second = checked_svg_text(&draw_scaling(&scaling));
        assert!(second.contains("NOT confirmed for N = 15"));
    }

    #[test]
    fn times_are_spread_along_their_axis() {
        let chart = sample::sample_chart();
        let rows = [RowOfLeaf {
            rods: 5,
            row: &chart.rows[0],
        }];
        let spread = |over_veins| {
            contender_series(
                &rows,
                SeriesOf {
                    over_veins,
                    ..SeriesOf::VEINS
                },
            )[0]
            .points[0]
                .spread
        };
        assert_eq!(spread(false), [(8.75e-4, 1e-4), (1.2e-3, 1e-4)]);
        assert_eq!(spread(true), [(5.0, 8.75e-4), (5.0, 1.2e-3)]);
    }

    #[test]
    fn a_peer_has_one_colour_in_every_chart() {
        let mut chart = sample::sample_chart();
        let of = |chart: &Chart| -> Vec<(String, Color)> {
            let all = peer_series(&chart.peers).into_iter();
            all.map(|peer| (peer.name, peer.style.color)).collect()
        };
        let alone = of(&chart)[0].clone();
        chart.peers.insert(0, chart.peers[0].clone());
        chart.peers[0].name = "another".into();
        let both = of(&chart);
        assert_eq!(both[1], alone);
        assert_ne!(both[0].1, alone.1);
    }
}
