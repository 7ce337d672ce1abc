//! The figures of a chart: error against time, and time against the number of
//! veins.

use super::Pictured;
use super::colors::Color;
use super::drawing::Drawing;
use super::header::{self, HEADER};
use super::logaxis::Labels;
use super::loglog::LogLog;
use super::page::WIDTH;
use super::series::{Failure, Marker, Point, Series};
use crate::report::numbers::power_of_ten;
use crate::report::words::contender;
use crate::study::{Chart, Contender, Peer, Row, Scaling, Spread};

/// Colours that must be told apart, also by the colour-blind (Okabe and Ito);
/// methods of one kind are alike.
const COLORS: [Color; 7] = [
    Color(0, 114, 178),
    Color(86, 170, 225),
    Color(205, 80, 0),
    Color(230, 159, 0),
    Color(0, 158, 115),
    Color(170, 90, 150),
    Color(60, 60, 66),
];

/// Colours of the peers that come with this crate, so that they are the same in
/// every chart; and of others, in turn.
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

impl Pictured for Chart {
    const SVG: &'static str = "chart.svg";
    const PNG: &'static str = "chart.png";

    fn draw(&self) -> Drawing {
        let contenders = Contender::ALL.into_iter().zip(COLORS);
        let contenders = contenders.filter_map(|(contender, color)| {
            let rows = self.rows.iter().filter(|row| row.contender == contender);
            let rows: Vec<&Row> = rows.collect();
            (!rows.is_empty()).then(|| series(contender, color, &rows, |_, row| row.point()))
        });
        let panel = LogLog {
            series: contenders.chain(peers(&self.peers)).collect(),
            across: (
                "time on one thread: median, and quartiles as a thin line",
                Labels::Times,
            ),
            up: ("largest true error of positions / L", Labels::Powers),
            floor: self.reference.as_ref().map(|found| found.known_within),
        };
        let mut notes = vec![format!("N = {}", self.rods)];
        notes.push(match &self.reference {
            None => "no reference: no equilibrium was found".into(),
            Some(found) if found.confirmed => format!(
                "reference confirmed by two methods, known within {}",
                power_of_ten(found.known_within)
            ),
            Some(found) => format!(
                "the reference is NOT confirmed; taken to be within {}",
                power_of_ten(found.known_within)
            ),
        });
        notes.push("left is faster, down is more accurate".into());
        let title = format!("{}: speed against accuracy", self.scenario);
        page(&title, &notes, &panel)
    }
}

impl Pictured for Scaling {
    const SVG: &'static str = "chart_rods.svg";
    const PNG: &'static str = "chart_rods.png";

    fn draw(&self) -> Drawing {
        let contenders = Contender::ALL.into_iter().zip(COLORS);
        let contenders = contenders.filter_map(|(contender, color)| {
            let found = self
                .rows
                .iter()
                .filter(|found| found.row.contender == contender);
            let (rods, rows): (Vec<usize>, Vec<&Row>) =
                found.map(|found| (found.rods, &found.row)).unzip();
            let place = |i: usize, row: &Row| {
                let (seconds, _) = row.point()?;
                Some((rods[i] as f64, seconds))
            };
            if rows.is_empty() {
                return None;
            }
            let mut series = series(contender, color, &rows, place);
            // Failures are where their leaf is, run or not.
            let failed = (0..rows.len()).filter(|&i| place(i, rows[i]).is_none());
            for (failure, i) in series.failures.iter_mut().zip(failed) {
                failure.x = Some(rods[i] as f64);
            }
            Some(series)
        });
        let mut rods: Vec<usize> = self.rows.iter().map(|found| found.rods).collect();
        rods.sort_unstable();
        rods.dedup();
        let panel = LogLog {
            series: contenders.collect(),
            across: ("number of veins N", Labels::Numbers(rods)),
            up: ("time on one thread: median and quartiles", Labels::Times),
            floor: None,
        };
        let mut notes = vec![format!("to a tolerance of {:e}", self.tolerance)];
        if !self.unconfirmed.is_empty() {
            let rods: Vec<String> = self.unconfirmed.iter().map(usize::to_string).collect();
            notes.push(format!(
                "the reference is NOT confirmed for N = {}",
                rods.join(", ")
            ));
        }
        let title = format!("{}: time against the number of veins", self.scenario);
        page(&title, &notes, &panel)
    }
}

fn page(title: &str, notes: &[String], panel: &LogLog) -> Drawing {
    let mut drawing = Drawing {
        width: WIDTH,
        height: (HEADER + panel.height()).ceil(),
        description: title.into(),
        marks: Vec::new(),
    };
    drawing.group("header", |page| {
        header::draw_without_key(page, title, notes)
    });
    drawing.group("chart", |page| panel.draw(page, HEADER));
    drawing
}

/// The line of a contender, with its points where `place` puts them.
fn series(
    who: Contender,
    color: Color,
    rows: &[&Row],
    place: impl Fn(usize, &Row) -> Option<(f64, f64)>,
) -> Series {
    let mut series = Series {
        name: match who {
            Contender::SemiImplicit => format!("{} (default)", contender(who)),
            _ => contender(who).into(),
        },
        color,
        dashed: false,
        marker: match who {
            Contender::SemiImplicit | Contender::Explicit => Marker::Circle,
            Contender::SemiImplicitGrid | Contender::ExplicitGrid => Marker::Square,
            Contender::SingleShooting => Marker::Triangle,
            Contender::MultipleShooting => Marker::Wedge,
            Contender::RelaxedShooting => Marker::Diamond,
        },
        points: Vec::new(),
        failures: Vec::new(),
    };
    for (i, row) in rows.iter().enumerate() {
        match place(i, row) {
            Some((x, y)) => series.points.push(Point {
                x,
                y,
                spread: quartiles(row).and_then(|[q1, q3]| Some([place(i, &q1)?, place(i, &q3)?])),
                front: row.pareto,
            }),
            None => series.failures.push(Failure {
                x: row.seconds.map(|spread| spread.median),
                word: row.ending.word().into(),
            }),
        }
    }
    series
}

/// The row as if its quartiles were its time.
fn quartiles(row: &Row) -> Option<[Row; 2]> {
    let spread = row.seconds?;
    let taking = |median: f64| Row {
        seconds: Some(Spread { median, ..spread }),
        ..row.clone()
    };
    Some([spread.q1, spread.q3].map(taking))
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
            all.push(Series {
                name: peer.name.clone(),
                color: peer_color(&peer.name, all.len()),
                dashed: true,
                marker: Marker::Ring,
                points: Vec::new(),
                failures: Vec::new(),
            });
            all.len() - 1
        });
        match peer.point() {
            Some((x, y)) => all[place].points.push(Point {
                x,
                y,
                spread: Some([(peer.seconds.q1, y), (peer.seconds.q3, y)]),
                front: peer.pareto,
            }),
            None => all[place].failures.push(Failure {
                x: Some(peer.seconds.median),
                word: peer.outcome.clone(),
            }),
        }
    }
    for series in &mut all {
        series.points.sort_by(|a, b| b.y.total_cmp(&a.y));
    }
    all
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;
    use crate::figure::{FigurePng, FigureSvg};
    use crate::report::{Format, sample};

    fn svg<R: Pictured>(result: &R) -> String {
        let mut bytes = Vec::new();
        FigureSvg.write(result, &mut bytes).unwrap();
        let svg = String::from_utf8(bytes).unwrap();
        assert_eq!(svg.matches("<g ").count(), svg.matches("</g>").count());
        assert!(!svg.contains("NaN") && !svg.contains(">inf"), "{svg}");
        svg
    }

    #[test]
    fn every_series_and_every_kind_of_failure_is_named() {
        let svg = svg(&sample::chart());
        for text in [
            "fan: speed against accuracy",
            "N = 5",
            "semi-implicit, extrapolated",
            "semi-implicit, single grids",
            "single shooting",
            "solve_bvp",
            "not-at-rest",
            "not-run",
            "not-converged max-nodes",
            "Pareto front",
            "1 ms",
            "10⁻⁸",
            "reference confirmed by two methods, known within 1.0×10⁻¹²",
        ] {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn a_reference_that_is_not_confirmed_is_called_so() {
        let mut chart = sample::chart();
        if let Some(reference) = &mut chart.reference {
            reference.confirmed = false;
        }
        assert!(svg(&chart).contains("NOT confirmed"));
        chart.reference = None;
        for row in &mut chart.rows {
            row.true_error = None;
        }
        assert!(svg(&chart).contains("no reference"));
    }

    #[test]
    fn leaves_are_marked_by_their_veins() {
        let mut scaling = sample::scaling();
        let first = svg(&scaling);
        for text in [
            "to a tolerance of 1e-6",
            ">5<",
            ">15<",
            "number of veins N",
            "not-run",
        ] {
            assert!(first.contains(text), "{text}");
        }
        scaling.unconfirmed = vec![15];
        assert!(svg(&scaling).contains("NOT confirmed for N = 15"));
    }

    #[test]
    fn times_are_spread_along_their_axis() {
        let chart = sample::chart();
        let rows = [&chart.rows[0]];
        let across = series(rows[0].contender, COLORS[0], &rows, |_, row| row.point());
        let wanted = Some([(8.75e-4, 1e-4), (1.2e-3, 1e-4)]);
        assert_eq!(across.points[0].spread, wanted);
        let up = |_, row: &Row| Some((5.0, row.point()?.0));
        let up = series(rows[0].contender, COLORS[0], &rows, up);
        let wanted = Some([(5.0, 8.75e-4), (5.0, 1.2e-3)]);
        assert_eq!(up.points[0].spread, wanted);
    }

    #[test]
    fn a_peer_has_one_colour_in_every_chart() {
        let mut chart = sample::chart();
        let of = |chart: &Chart| -> Vec<(String, Color)> {
            let all = peers(&chart.peers).into_iter();
            all.map(|peer| (peer.name, peer.color)).collect()
        };
        let alone = of(&chart)[0].clone();
        chart.peers.insert(
            0,
            Peer {
                name: "another".into(),
                ..chart.peers[0].clone()
            },
        );
        let both = of(&chart);
        assert_eq!(both[1], alone);
        assert_ne!(both[0].1, alone.1);
    }

    #[test]
    fn numbers_gone_wild_are_drawn_without_a_panic() {
        for wild in [f64::NAN, f64::INFINITY, 1e300, 1e-310, -1.0, 0.0] {
            let mut chart = sample::chart();
            chart.rows[0].true_error = Some(wild);
            if let Some(spread) = &mut chart.rows[1].seconds {
                spread.median = wild;
            }
            if let Some(reference) = &mut chart.reference {
                reference.known_within = wild;
            }
            svg(&chart);
        }
    }

    #[test]
    fn the_picture_is_as_wide_as_that_of_a_leaf() {
        let mut bytes = Vec::new();
        FigurePng.write(&sample::chart(), &mut bytes).unwrap();
        let reader = png::Decoder::new(io::Cursor::new(&bytes)).read_info();
        assert_eq!(reader.unwrap().info().width, 1800);
    }
}
