//! The text report of a boundary, and its rows in CSV.

use std::io::{self, Write};

use crate::study::{Boundary, BoundaryCurve, BoundaryMap, BoundaryPoint};

use super::Reported;
use super::numbers::{brief, power_of_ten, seconds, veins_of};
use super::table::{Lines, csv_without_header, labelled};

impl Reported for Boundary {
    fn heading(&self) -> String {
        let veins = veins_of(self.rods, self.joined);
        format!("{}: {veins}, the boundary", self.scenario)
    }

    fn lines(&self) -> Lines {
        let vary = self.keys.iter().zip(self.ranges).map(|(keys, [from, to])| {
            format!("{keys} from {} to {}", keys.text(from), keys.text(to))
        });
        let mut lines = labelled("vary", vary);
        let second = &self.keys[1];
        let start = format!("at {second} = {}", second.text(self.start));
        lines.push(("begun", start));
        let curves = self.curves.iter().enumerate();
        let curves = curves.flat_map(|(number, curve)| curve_lines(self, number, curve));
        lines.extend(labelled("curve", curves));
        let points = self.curves.iter().flat_map(|curve| &curve.points);
        let worst = points.map(|point| point.error).reduce(f64::max);
        lines.extend(worst.map(|worst| ("error", format!("tips within {}", power_of_ten(worst)))));
        lines.extend((self.map.iter()).flat_map(|map| labelled("map", map_lines(map))));
        lines.push(("work", format!("{} in all", seconds(self.wall_seconds))));
        lines
    }

    fn remarks(&self) -> Lines {
        labelled("remark", self.remark.clone())
    }
}

/// The kind of a curve, its ends and its special points.
fn curve_lines(boundary: &Boundary, number: usize, curve: &BoundaryCurve) -> Vec<String> {
    let what = sides(curve).unwrap_or_else(|| "no point verified".into());
    let (number, points) = (number + 1, curve.points.len());
    let mut lines = vec![format!("{number}: {points} points, {what}")];
    let end = |label: &str, point: Option<&BoundaryPoint>, end: usize| {
        let phrase = curve.ends[end].phrase();
        let at = point.map_or(String::new(), |point| place(boundary, point));
        format!("  {label} {at}: {phrase}")
    };
    lines.push(end("from", curve.points.first(), 0));
    let special = curve.points.iter().filter(|point| is_special(point));
    lines.extend(special.map(|point| format!("  {} at {}", point.kind, place(boundary, point))));
    lines.push(end("to", curve.points.last(), 1));
    lines
}

/// Most disagreeing cells that are listed.
const MOST_NAMED: usize = 5;

/// Whether the map agrees with the curves.
fn map_lines(map: &BoundaryMap) -> Vec<String> {
    let (columns, rows) = (map.first.len(), map.second.len());
    let verdict = match map.disagreeing.len() {
        0 => "all as the curves say".into(),
        count => format!("{count} not as the curves say: others may begin elsewhere"),
    };
    let known = format!("{} with an equilibrium of the branch", map.known());
    let mut lines = vec![format!("{columns} x {rows} cells, {known}, {verdict}")];
    let named = map.disagreeing.iter().take(MOST_NAMED);
    lines.extend(named.map(|[column, row]| {
        let (first, second) = (map.first[column - 1], map.second[row - 1]);
        let what = map.index[row - 1][column - 1];
        let what = what.map_or("none".into(), |index| format!("index {index}"));
        format!("  at ({}, {}): {what}", brief(first), brief(second))
    }));
    lines
}

/// How the index changes across a curve.
pub fn sides(curve: &BoundaryCurve) -> Option<String> {
    let point = curve.points.first()?;
    let what = match (point.kind, curve.multiplicity) {
        ("fold" | "cusp", _) => "fold".into(),
        (_, 1) => "branches cross".into(),
        (_, modes) => format!("branches cross in {modes} directions"),
    };
    let (before, after) = (point.index_before, point.index_behind);
    Some(format!("{what}: index {before} to {after}"))
}

/// Whether a point is a cusp or a crossing.
pub fn is_special(point: &BoundaryPoint) -> bool {
    matches!(point.kind, "cusp" | "crossing")
}

fn place(boundary: &Boundary, point: &BoundaryPoint) -> String {
    let number = |i: usize| {
        let value = boundary.keys[i].text(point.values[i]);
        match point.errors[i] {
            0.0 => value,
            error => format!("{value} within {}", power_of_ten(error)),
        }
    };
    format!("({}, {})", number(0), number(1))
}

/// `boundary.csv`: one row per curve and point, with columns named by the keys.
pub fn boundary_table(boundary: &Boundary, out: &mut dyn Write) -> io::Result<()> {
    let mut table = csv_without_header(out);
    let keys = boundary.keys.each_ref().map(ToString::to_string);
    table.serialize((
        ["curve", "point", "kind"],
        keys,
        ["error_1", "error_2", "tip_x", "tip_y", "tip_z", "error"],
        ["index_before", "index_behind"],
    ))?;
    for (number, curve) in boundary.curves.iter().enumerate() {
        for point in &curve.points {
            // The joint tip, or the first rod's; adding zero turns -0 into 0.
            let tip = point.tips.first();
            let tip = tip.map_or([f64::NAN; 3], |tip| tip.to_array());
            table.serialize((
                (number + 1, point.point, point.kind),
                point.values,
                point.errors,
                tip.map(|x| x + 0.0),
                point.error,
                (point.index_before, point.index_behind),
            ))?;
        }
    }
    table.flush()
}
