//! Speed against accuracy: error against time, and time against the number of
//! veins, for every method of relaxation.

use super::chart_panel::{ChartPanel, Failure, Point, Series};
use crate::figure::axis::{Axis, Ticks};
use crate::figure::drawing::{BLUE, Color, Drawing, GREEN, ORANGE, PURPLE, SKY, SLATE, VERMILION};
use crate::figure::layout::{HEADER, LEFT};
use crate::figure::markers::Marker;
use crate::figure::page::new_page;
use crate::report::numbers::power_of_ten;
use crate::report::words::contender;
use leafdyn::relax::Method;
use leafdyn::study::{Chart, Contender, Peer, Row, Scaling};

/// Fixed colours of the peers that come with this crate, the same in every chart;
/// other peers take the rest in turn.
const KNOWN_PEERS: [(&str, Color); 3] = [
    ("solve_bvp", Color(120, 120, 128)),
    ("exudyn", Color(150, 105, 60)),
    ("pyelastica", Color(100, 130, 90)),
];
const OTHER_PEERS: [Color; 3] = [
    Color(125, 100, 160),
    Color(70, 130, 140),
    Color(165, 120, 130),
];

/// Smaller errors are drawn here.
const SMALLEST: f64 = 1e-17;
const FEWEST_DECADES: f64 = 1.0;

pub fn draw_chart(chart: &Chart) -> Drawing {
    let rows: Vec<(usize, &Row)> = chart.rows.iter().map(|row| (chart.rods, row)).collect();
    let mut series = contenders(&rows, false);
    series.extend(peers(&chart.peers));
    let floor = chart.reference.as_ref().map(|found| found.known_within);
    let floor = floor.filter(|floor| floor.is_normal() && *floor > 0.0);
    let (across, up) = places(&series);
    let failed = series.iter().flat_map(|series| &series.failures);
    let across = across.into_iter();
    let up = up.into_iter().chain(floor);
    let panel = ChartPanel {
        across: times(across.chain(failed.filter_map(|failure| failure.x))),
        up: Axis::logarithmic("largest true error of positions / L", up, FEWEST_DECADES),
        series,
        floor,
    };
    let reference = match &chart.reference {
        None => "no reference: no equilibrium was found".into(),
        Some(found) => {
            let what = match found.confirmed {
                true => "reference confirmed by two methods, known within",
                false => "the reference is NOT confirmed; taken to be within",
            };
            format!("{what} {}", power_of_ten(found.known_within))
        }
    };
    let notes = [
        format!("N = {}", chart.rods),
        reference,
        "left is faster, down is more accurate".into(),
    ];
    let title = format!("{}: speed against accuracy", chart.scenario);
    page(&title, &notes, &panel)
}

pub fn draw_scaling(scaling: &Scaling) -> Drawing {
    let rows = scaling.rows.iter().map(|found| (found.rods, &found.row));
    let series = contenders(&rows.collect::<Vec<_>>(), true);
    let mut rods: Vec<usize> = scaling.rows.iter().map(|found| found.rods).collect();
    rods.sort_unstable();
    rods.dedup();
    let rods: Vec<f64> = rods.into_iter().map(|rods| rods as f64).collect();
    let axis = Axis::logarithmic("number of veins N", rods.iter().copied(), FEWEST_DECADES);
    let panel = ChartPanel {
        across: Axis {
            ticks: Ticks::At(rods),
            ..axis
        },
        up: times(places(&series).1.into_iter()),
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
    page(&title, &notes, &panel)
}

fn times(values: impl Iterator<Item = f64>) -> Axis {
    let name = "time on one thread: median, and quartiles as a thin line";
    Axis {
        ticks: Ticks::Times,
        ..Axis::logarithmic(name, values, FEWEST_DECADES)
    }
}

fn page(title: &str, notes: &[String], panel: &ChartPanel) -> Drawing {
    let mut drawing = new_page(LEFT, title, notes, None);
    drawing.height = (HEADER + panel.height()).ceil();
    drawing.group("chart", |page| panel.draw(page, HEADER));
    drawing
}

/// Coordinates of the points of all series, across and up.
fn places(series: &[Series]) -> (Vec<f64>, Vec<f64>) {
    let points = series.iter().flat_map(|series| &series.points);
    points.map(|point| point.at).unzip()
}

/// Colour and marker of a contender.
fn style(who: Contender) -> (Color, Marker) {
    match (who.method, who.one_grid) {
        (Method::SemiImplicit(_), false) => (BLUE, Marker::Circle),
        (Method::SemiImplicit(_), true) => (SKY, Marker::Square),
        (Method::Explicit { .. }, false) => (VERMILION, Marker::Circle),
        (Method::Explicit { .. }, true) => (ORANGE, Marker::Square),
        (Method::SingleShooting, _) => (GREEN, Marker::Triangle),
        (Method::Shooting { .. }, _) => (PURPLE, Marker::Wedge),
        (Method::ShootingFromRest { .. }, _) => (SLATE, Marker::Diamond),
    }
}

/// A series for each contender with results: seconds over veins, or errors over
/// seconds. Each row comes with its number of veins.
fn contenders(rows: &[(usize, &Row)], over_veins: bool) -> Vec<Series> {
    let of = |who: Contender| {
        let (color, marker) = style(who);
        let default = if who.is_default() { " (default)" } else { "" };
        let name = format!("{}{default}", contender(who));
        let mut series = Series::new(name, color, marker, false);
        for (rods, row) in rows.iter().filter(|(_, row)| row.contender == who) {
            let rods = *rods as f64;
            let place = |seconds: f64, error: f64| match over_veins {
                true => (rods, seconds),
                false => (seconds, error.max(SMALLEST)),
            };
            match row.seconds.zip(row.point()) {
                Some((seconds, (median, error))) => series.points.push(Point {
                    at: place(median, error),
                    spread: [seconds.q1, seconds.q3].map(|time| place(time, error)),
                    front: row.pareto == Some(true),
                }),
                // Over veins a failure has a position even if it was not run.
                None => series.failures.push(Failure {
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
    let mut all: Vec<Series> = Contender::ALL.into_iter().map(of).collect();
    all.retain(|series| !(series.points.is_empty() && series.failures.is_empty()));
    all
}

fn peer_color(name: &str, others: usize) -> Color {
    let known = KNOWN_PEERS.iter().find(|(known, _)| *known == name);
    known.map_or(OTHER_PEERS[others % OTHER_PEERS.len()], |(_, color)| *color)
}

/// One dashed line for each peer, from large errors to small.
fn peers(peers: &[Peer]) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for peer in peers {
        let place = all.iter().position(|series| series.name == peer.name);
        let place = place.unwrap_or_else(|| {
            let color = peer_color(&peer.name, all.len());
            all.push(Series::new(peer.name.clone(), color, Marker::Ring, true));
            all.len() - 1
        });
        match peer.point().map(|(x, y)| (x, y.max(SMALLEST))) {
            Some(at) => all[place].points.push(Point {
                at,
                spread: [peer.seconds.q1, peer.seconds.q3].map(|x| (x, at.1)),
                front: peer.pareto,
            }),
            None => all[place].failures.push(Failure {
                x: Some(peer.seconds.median),
                word: peer.outcome.clone(),
            }),
        }
    }
    for series in &mut all {
        series.points.sort_by(|a, b| b.at.1.total_cmp(&a.at.1));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::svg::text;
    use crate::report::sample;

    fn svg(chart: &Chart) -> String {
        text(&draw_chart(chart))
    }

    #[test]
    fn every_series_and_every_kind_of_failure_is_named() {
        let svg = svg(&sample::chart());
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
        let mut chart = sample::chart();
        chart.reference.as_mut().unwrap().confirmed = false;
        assert!(svg(&chart).contains("NOT confirmed"));
        chart.reference = None;
        chart.rows.iter_mut().for_each(|row| row.true_error = None);
        assert!(svg(&chart).contains("no reference"));
    }

    #[test]
    fn leaves_are_marked_by_their_veins() {
        let mut scaling = sample::scaling();
        let first = text(&draw_scaling(&scaling));
        assert!(first.contains("to a tolerance of 1e-6"));
        for text in [">5<", ">15<", "number of veins N", "not-run"] {
            assert!(first.contains(text), "{text}");
        }
        scaling.unconfirmed = vec![15];
        let second = text(&draw_scaling(&scaling));
        assert!(second.contains("NOT confirmed for N = 15"));
    }

    #[test]
    fn times_are_spread_along_their_axis() {
        let chart = sample::chart();
        let rows = [(5, &chart.rows[0])];
        let spread = |over_veins| contenders(&rows, over_veins)[0].points[0].spread;
        assert_eq!(spread(false), [(8.75e-4, 1e-4), (1.2e-3, 1e-4)]);
        assert_eq!(spread(true), [(5.0, 8.75e-4), (5.0, 1.2e-3)]);
    }

    #[test]
    fn a_peer_has_one_colour_in_every_chart() {
        let mut chart = sample::chart();
        let of = |chart: &Chart| -> Vec<(String, Color)> {
            let all = peers(&chart.peers).into_iter();
            all.map(|peer| (peer.name, peer.color)).collect()
        };
        let alone = of(&chart)[0].clone();
        chart.peers.insert(0, chart.peers[0].clone());
        chart.peers[0].name = "another".into();
        let both = of(&chart);
        assert_eq!(both[1], alone);
        assert_ne!(both[0].1, alone.1);
    }
}
