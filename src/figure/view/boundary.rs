//! The page of a boundary: its curves in the plane of two numbers, and the leaf at each
//! of their points.

use super::Viewed;
use super::data::{Chart, Curve, Leaf, View};
use crate::figure::drawing::Drawing;
use crate::report::is_special;
use crate::report::numbers::brief;
use crate::scenario::Scenario;
use crate::study::{Boundary, BoundaryCurve, BoundaryPoint};

/// Most segments of a vein that are drawn.
const MOST_NODES: usize = 32;

impl Viewed for Boundary {
    fn fill(&self, view: &mut View) {
        view.kind = "trace";
        let count = match self.curves.len() {
            1 => "1 curve".into(),
            count => format!("{count} curves"),
        };
        view.verdict = match self.complete {
            true => format!("{count}, followed to the ends"),
            false => format!("{count}, not all followed to their ends"),
        };
        view.success = self.complete;
        let points = self.curves.iter().flat_map(|curve| &curve.points);
        view.leaves = points.map(|point| leaf(point, &view.drawn)).collect();
        view.chart = Some(chart(self));
    }

    fn still(&self, scenario: &Scenario) -> Drawing {
        crate::figure::boundary(self, scenario)
    }
}

fn leaf(point: &BoundaryPoint, drawn: &[usize]) -> Leaf {
    let [first, second] = point.values.map(brief);
    let kind = point.kind.replace('-', " ");
    let label = format!("{first}, {second}: {kind}");
    Leaf::coarse(label, &point.stations, &point.curves, drawn, MOST_NODES)
}

/// The plane: the second number, or its logarithm, against the first.
fn chart(boundary: &Boundary) -> Chart {
    let up = boundary.keys[1].to_string();
    let mut first = 0;
    let mut curves = Vec::new();
    for (number, found) in boundary.curves.iter().enumerate() {
        curves.push(curve(boundary, number, first, found));
        first += found.points.len();
    }
    Chart {
        across: boundary.keys[0].to_string(),
        log: boundary.log[0],
        choices: vec![match boundary.log[1] {
            true => format!("log₁₀ of {up}"),
            false => up,
        }],
        curves,
    }
}

fn curve(boundary: &Boundary, number: usize, first: usize, curve: &BoundaryCurve) -> Curve {
    let points = &curve.points;
    let up = |point: &BoundaryPoint| match boundary.log[1] {
        true => point.values[1].abs().log10(),
        false => point.values[1],
    };
    let special = points.iter().enumerate();
    let special = special.filter(|(_, point)| is_special(point));
    Curve {
        choice: 0,
        name: format!("curve {}", number + 1),
        color: number,
        x: points.iter().map(|point| point.values[0]).collect(),
        y: points.iter().map(up).collect(),
        leaves: (first..first + points.len()).collect(),
        unstable: (points.iter())
            .map(|point| point.index_before.min(point.index_behind) > 0)
            .collect(),
        special: special.map(|(at, point)| (at, point.kind)).collect(),
    }
}
