//! The page of a moving leaf.

use super::Viewed;
use super::data::{Chart, Curve, Leaf, View};
use crate::figure::drawing::Drawing;
use crate::report::numbers::short;
use crate::scenario::Scenario;
use crate::simulate::{Moment, Record};

/// Most segments of a vein that are drawn.
const MOST_NODES: usize = 64;

/// Most points of a curve.
const MOST_POINTS: usize = 1000;

impl Viewed for Record {
    fn fill(&self, view: &mut View) {
        view.kind = "motion";
        view.verdict = match self.stopped {
            None => format!("followed to t = {}", short(self.time)),
            Some(_) => {
                let (time, outcome) = (short(self.time), self.outcome());
                format!("ended early at t = {time}: {outcome}")
            }
        };
        view.success = self.stopped.is_none();
        let shapes = self.film.iter().map(|still| {
            let time = self.moments[still.moment].time;
            let (label, curves) = (format!("t = {}", short(time)), &still.curves);
            Leaf {
                time: Some(time),
                ..Leaf::coarse(label, &self.stations, curves, &view.drawn, MOST_NODES)
            }
        });
        view.leaves = shapes.collect();
        view.chart = Some(chart(&self.moments, view));
    }

    fn still(&self, scenario: &Scenario) -> Drawing {
        crate::figure::filmstrip(self, scenario)
    }
}

/// Energies and the tip over time.
fn chart(moments: &[Moment], view: &View) -> Chart {
    let stride = moments.len().div_ceil(MOST_POINTS).max(1);
    let shown = || moments.iter().step_by(stride);
    let curve = |choice, color, name: &str, of: &dyn Fn(&Moment) -> f64| Curve {
        choice,
        name: name.into(),
        color,
        x: shown().map(|moment| moment.time).collect(),
        y: shown().map(of).collect(),
        ..Curve::default()
    };
    type Energy = fn(&Moment) -> f64;
    let energies: [(&str, Energy); 7] = [
        ("kinetic", |m| m.energy.kinetic),
        ("elastic", |m| m.energy.elastic),
        ("coupling", |m| m.energy.coupling),
        ("potential of the loads", |m| m.energy.potential),
        ("dissipated", |m| m.energy.dissipated),
        ("work put in", |m| m.energy.work),
        ("balance", |m| m.energy.balance()),
    ];
    let mut curves: Vec<Curve> = Vec::new();
    for (color, (name, of)) in energies.into_iter().enumerate() {
        let curve = curve(0, color, name, &of);
        // An energy that is always zero needs no curve.
        if curve.y.iter().any(|&y| y != 0.0) {
            curves.push(curve);
        }
    }
    for (axis, name) in ["tip x", "tip y", "tip z"].into_iter().enumerate() {
        curves.push(curve(1, axis, name, &|m| m.tip[axis]));
    }
    Chart {
        across: "time".into(),
        log: false,
        choices: vec![view.with_unit("energy", false), view.with_unit("tip", true)],
        curves,
    }
}
