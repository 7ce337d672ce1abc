//! The data of the pages: what each kind of result shows of its leaves, and the chart beside
//! them.

use crate::figure;
use crate::figure::Figure;
use crate::figure::scenario::with_unit;
use crate::page::Viewed;
use crate::page::data::{Chart, Curve, Leaf, ModeShape, View, vectors};
use crate::report::numbers::{brief, counted, short, significant};
use crate::report::{Reported, equilibrium_of_index, is_special, verdict};
use glam::DVec3;
use leafdyn::relax::{Equilibrium, Mode};
use leafdyn::scenario::Units;
use leafdyn::simulate::{Moment, Record};
use leafdyn::study::{
    Boundary, BoundaryPoint, Equilibria, Keys, PointKind, Target, Trace, TraceBranch, TracePoint,
    TraceShow,
};
use std::slice;

/// Most segments of a vein that are drawn of each of many leaves, and of those of a motion.
const MOST_NODES: usize = 32;

const MOST_MOVING_NODES: usize = 64;

/// More equilibria could not be distinguished side by side.
const MOST_EQUILIBRIA: usize = 24;

/// Most points of a curve over time.
const MOST_POINTS: usize = 1000;

impl Viewed for Equilibrium {
    const STILL: Figure<Self> = figure::leaf;

    fn fill(&self, view: &mut View, _: &Units) {
        view.verdict = verdict(self);
        view.success = self.outcome.is_success();
        view.leaves.push(Leaf::full("at rest".into(), self, view));
        if self.stability.mode_shapes {
            let modes = self.stability.modes.iter().flatten().enumerate();
            view.modes = modes
                .map(|(k, mode)| mode_shape(self, k + 1, mode, &view.drawn))
                .collect();
        }
    }
}

fn mode_shape(leaf: &Equilibrium, number: usize, mode: &Mode, drawn: &[usize]) -> ModeShape {
    let what = match (mode.is_neutral(), mode.growth()) {
        (true, _) => "neutral".into(),
        (_, Some(growth)) => format!("unstable, grows at {}", short(growth)),
        (_, None) => format!("ω = {}", short(mode.frequency().unwrap_or_default())),
    };
    let pick = |of: &[Vec<DVec3>]| {
        let chosen = drawn.iter().filter_map(|&number| of.get(number - 1));
        vectors(chosen.flatten().copied())
    };
    ModeShape {
        label: format!("mode {number}: {what}"),
        nodes: mode.displacement.first().map_or(0, Vec::len),
        rest: pick(&leaf.shape.curves),
        displacement: pick(&mode.displacement),
    }
}

impl Viewed for Equilibria {
    const STILL: Figure<Self> = figure::equilibria;

    /// Equilibria side by side.
    fn fill(&self, view: &mut View, units: &Units) {
        view.kind = "equilibria";
        let count = self.found.len();
        view.verdict = counted(count, "equilibrium", "equilibria");
        if count > MOST_EQUILIBRIA {
            view.verdict += &format!(", the first {MOST_EQUILIBRIA} shown");
        }
        view.success = count > 0;
        for (k, found) in self.found.iter().take(MOST_EQUILIBRIA).enumerate() {
            let leaf = &found.equilibrium;
            let kind = equilibrium_of_index(leaf.stability.negative_eigenvalues);
            let energy = short(leaf.energy.unwrap_or(f64::NAN));
            let label = format!("{}. {kind}, energy {energy}", k + 1);
            view.leaves.push(Leaf {
                summary: leaf.summary(units),
                ..Leaf::full(label, leaf, view)
            });
        }
    }
}

impl Viewed for Record {
    const STILL: Figure<Self> = figure::filmstrip;

    fn fill(&self, view: &mut View, units: &Units) {
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
                ..Leaf::coarse(label, &self.stations, curves, view, MOST_MOVING_NODES)
            }
        });
        view.leaves = shapes.collect();
        view.chart = Some(energies_and_tip(&self.moments, units));
    }
}

fn energies_and_tip(moments: &[Moment], units: &Units) -> Chart {
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
    let energies = energies.into_iter().enumerate();
    let energies = energies.map(|(color, (name, of))| curve(0, color, name, &of));
    // An energy that is always zero needs no curve.
    let energies = energies.filter(|curve| curve.y.iter().any(|&y| y != 0.0));
    let tip = ["tip x", "tip y", "tip z"].into_iter().enumerate();
    let tip = tip.map(|(axis, name)| curve(1, axis, name, &|m: &Moment| m.tip[axis]));
    Chart {
        across: "time".into(),
        log: false,
        choices: vec![
            with_unit("energy", units.energy().as_deref()),
            with_unit("tip", units.length.as_deref()),
        ],
        curves: energies.chain(tip).collect(),
    }
}

impl Viewed for Trace {
    const STILL: Figure<Self> = figure::trace;

    fn fill(&self, view: &mut View, units: &Units) {
        view.kind = "trace";
        drop_varied_loads(view, slice::from_ref(&self.keys));
        let count = self.branches.len();
        view.verdict = match (count, self.complete) {
            (1, true) => "1 branch, followed to its end".into(),
            (count, true) => format!("{count} branches, followed to their ends"),
            (count, false) => format!("{count} of the branches, not all followed to their ends"),
        };
        view.success = self.complete;
        let points = self.branches.iter().flat_map(|branch| &branch.points);
        let leaf = |point: &TracePoint| {
            let label = match point.kind {
                PointKind::Regular => {
                    let kind = equilibrium_of_index(Some(point.index));
                    format!("{}: {kind}", brief(point.value))
                }
                kind => {
                    let kind = kind.word().replace('-', " ");
                    format!("{}: {kind}", self.keys.text(point.value))
                }
            };
            Leaf {
                summary: vec![("energy", significant(point.energy))],
                ..Leaf::coarse(label, &point.stations, &point.curves, view, MOST_NODES)
            }
        };
        view.leaves = points.map(leaf).collect();
        view.chart = Some(branches(self, units));
    }
}

/// Coordinates of the tip, of free tips that of the first, and the energy against the varied
/// number.
fn branches(trace: &Trace, units: &Units) -> Chart {
    let (length, energy) = (units.length.as_deref(), units.energy());
    let choices = [
        ("tip z", TraceShow::Tip(2), length),
        ("tip y", TraceShow::Tip(1), length),
        ("tip x", TraceShow::Tip(0), length),
        ("energy", TraceShow::Energy, energy.as_deref()),
    ];
    let curves = choices
        .iter()
        .enumerate()
        .flat_map(|(choice, (_, shown, _))| {
            let curve = |branch: &TraceBranch| Curve {
                choice,
                unstable: branch.points.iter().map(|point| point.index > 0).collect(),
                special: (branch.critical())
                    .map(|(at, point)| (at, point.kind.word()))
                    .collect(),
                ..along(&branch.points, |point| (point.value, point.shown(*shown)))
            };
            numbered("branch", trace.branches.iter().map(curve).collect())
        });
    Chart {
        across: trace.keys.to_string(),
        log: trace.log,
        curves: curves.collect(),
        choices: choices.map(|(name, _, unit)| with_unit(name, unit)).into(),
    }
}

/// A curve through points that have a leaf each.
fn along<P>(points: &[P], place: impl Fn(&P) -> (f64, f64)) -> Curve {
    let (x, y) = points.iter().map(place).unzip();
    Curve {
        x,
        y,
        ..Curve::default()
    }
}

/// Names and colours the curves by their numbers, and numbers the leaves of their points.
fn numbered(what: &str, mut curves: Vec<Curve>) -> Vec<Curve> {
    let mut first = 0;
    for (number, curve) in curves.iter_mut().enumerate() {
        curve.name = format!("{what} {}", number + 1);
        curve.color = number;
        curve.leaves = (first..first + curve.x.len()).collect();
        first += curve.x.len();
    }
    curves
}

impl Viewed for Boundary {
    const STILL: Figure<Self> = figure::boundary;

    fn fill(&self, view: &mut View, _: &Units) {
        view.kind = "trace";
        drop_varied_loads(view, &self.keys);
        let count = counted(self.curves.len(), "curve", "curves");
        view.verdict = match self.complete {
            true => format!("{count}, followed to the ends"),
            false => format!("{count}, not all followed to their ends"),
        };
        view.success = self.complete;
        let points = self.curves.iter().flat_map(|curve| &curve.points);
        let leaf = |point: &BoundaryPoint| {
            let [first, second] = point.values.map(brief);
            let label = format!("{first}, {second}: {}", point.kind.replace('-', " "));
            Leaf::coarse(label, &point.stations, &point.curves, view, MOST_NODES)
        };
        view.leaves = points.map(leaf).collect();
        view.chart = Some(plane(self));
    }
}

/// Loads that vary from leaf to leaf have no arrow of one size.
fn drop_varied_loads(view: &mut View, keys: &[Keys]) {
    let is_load = |target: &Target| match target {
        Target::Entry(part) => part.key.path().starts_with("load."),
        Target::Knob(_) => false,
    };
    if keys.iter().flat_map(Keys::targets).any(is_load) {
        view.loads.clear();
    }
}

/// The plane of a boundary: the second number, or its logarithm, against the first.
fn plane(boundary: &Boundary) -> Chart {
    let up = |value: f64| match boundary.log[1] {
        true => value.abs().log10(),
        false => value,
    };
    let curves = boundary.curves.iter().map(|curve| {
        let points = &curve.points;
        let special = points.iter().enumerate();
        let special = special.filter(|(_, point)| is_special(point));
        Curve {
            unstable: (points.iter())
                .map(|point| point.index_before.min(point.index_behind) > 0)
                .collect(),
            special: special.map(|(at, point)| (at, point.kind)).collect(),
            ..along(points, |point| (point.values[0], up(point.values[1])))
        }
    });
    let name = boundary.keys[1].to_string();
    Chart {
        across: boundary.keys[0].to_string(),
        log: boundary.log[0],
        choices: vec![match boundary.log[1] {
            true => format!("log₁₀ of {name}"),
            false => name,
        }],
        curves: numbered("curve", curves.collect()),
    }
}
