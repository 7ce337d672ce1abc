//! The page of branches of equilibria: the diagram, and the leaf at each point.

use super::Viewed;
use super::data::{Chart, Curve, Leaf, View};
use crate::figure::drawing::Drawing;
use crate::report::numbers::{brief, significant};
use crate::report::words::equilibrium_of_index;
use crate::scenario::Scenario;
use crate::study::{PointKind, Trace, TraceBranch, TracePoint};

/// Most segments of a vein that are drawn.
const MOST_NODES: usize = 32;

impl Viewed for Trace {
    fn fill(&self, view: &mut View) {
        view.kind = "trace";
        let count = self.branches.len();
        view.verdict = match (count, self.complete) {
            (1, true) => "1 branch, followed to its end".into(),
            (count, true) => format!("{count} branches, followed to their ends"),
            (count, false) => format!("{count} of the branches, not all followed to their ends"),
        };
        view.success = self.complete;
        let points = self.branches.iter().flat_map(|branch| &branch.points);
        view.leaves = points.map(|point| leaf(self, point, &view.drawn)).collect();
        view.chart = Some(chart(self, view));
    }

    fn still(&self, scenario: &Scenario) -> Drawing {
        crate::figure::trace(self, scenario)
    }
}

fn leaf(trace: &Trace, point: &TracePoint, drawn: &[usize]) -> Leaf {
    let kind = match point.kind {
        PointKind::Regular => equilibrium_of_index(Some(point.index)),
        kind => kind.word().replace('-', " "),
    };
    let at = match point.kind {
        PointKind::Regular => brief(point.value),
        _ => trace.keys.text(point.value),
    };
    let label = format!("{at}: {kind}");
    Leaf {
        summary: vec![("energy", significant(point.energy))],
        ..Leaf::coarse(label, &point.stations, &point.curves, drawn, MOST_NODES)
    }
}

/// Coordinates of the tip and the energy against the varied number.
fn chart(trace: &Trace, view: &View) -> Chart {
    type Of = fn(&TracePoint) -> f64;
    // Of free tips the first represents all.
    fn tip(point: &TracePoint, axis: usize) -> f64 {
        point.tips.first().map_or(f64::NAN, |tip| tip[axis])
    }
    let choices: [(&str, Of); 4] = [
        ("tip z", |point| tip(point, 2)),
        ("tip y", |point| tip(point, 1)),
        ("tip x", |point| tip(point, 0)),
        ("energy", |point| point.energy),
    ];
    let mut curves = Vec::new();
    for (choice, (_, of)) in choices.iter().enumerate() {
        let mut first = 0;
        for (number, branch) in trace.branches.iter().enumerate() {
            curves.push(curve(choice, number, first, branch, *of));
            first += branch.points.len();
        }
    }
    Chart {
        across: trace.keys.to_string(),
        log: trace.log,
        choices: choices
            .map(|(name, _)| view.with_unit(name, name != "energy"))
            .into(),
        curves,
    }
}

fn curve(
    choice: usize,
    number: usize,
    first: usize,
    branch: &TraceBranch,
    of: fn(&TracePoint) -> f64,
) -> Curve {
    let points = &branch.points;
    Curve {
        choice,
        name: format!("branch {}", number + 1),
        color: number,
        x: points.iter().map(|point| point.value).collect(),
        y: points.iter().map(of).collect(),
        leaves: (first..first + points.len()).collect(),
        unstable: points.iter().map(|point| point.index > 0).collect(),
        special: (branch.critical())
            .map(|(at, point)| (at, point.kind.word()))
            .collect(),
    }
}
