//! The data of the pages: what each kind of result shows of its leaves, and the chart beside
//! them.

use crate::figure;
use crate::figure::FigureFunction;
use crate::figure::drawing::space::ViewAngles;
use crate::figure::drawing::veins::DrawnVeins;
use crate::figure::leaf::DrawnMode;
use crate::figure::motion::small_motion_origin;
use crate::figure::scenario::{LoadMark, name_with_unit, with_followers_as_dead};
use crate::page::data::{ModeShape, PageChart, PageCurve, PageData, PageLeaf, encode_vectors};
use crate::page::{PageResult, loads_on_drawn_veins};
use crate::report::numbers::{
    count_in_words, format_five_digits, format_four_digits, format_ten_digits,
};
use crate::report::{
    ReportedResult, equilibrium_kind, is_codimension_two, relaxation_verdict, stability_phrase,
};
use glam::DVec3;
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::{Scenario, Units};
use leafdyn::simulate::{OutputSample, Record};
use leafdyn::study::{
    BoundaryPoint, Equilibria, ParameterKeys, PointKind, StabilityBoundary, Trace, TraceBranch,
    TracePoint, TraceShow, VariableTarget,
};
use std::slice;

/// Most segments of a vein that are drawn of each of many leaves, and of those of a motion.
const MOST_SEGMENTS_PER_VEIN: usize = 32;

const MOST_MOTION_SEGMENTS: usize = 64;

/// More equilibria could not be distinguished side by side.
const MOST_EQUILIBRIA_SHOWN: usize = 24;

/// Most points of a curve over time.
const MOST_CURVE_POINTS: usize = 1000;

impl PageResult for Equilibrium {
    const FALLBACK_FIGURE: FigureFunction<Self> = figure::leaf;

    fn fill_page_data(&self, view: &mut PageData, scenario: &Scenario) {
        view.verdict = relaxation_verdict(self);
        view.success = self.outcome.is_success();
        view.leaves.push(PageLeaf {
            loads: Some(loads_on_leaf(self, scenario)),
            ..PageLeaf::with_node_states("at rest".into(), self, view)
        });
        if self.stability.mode_shapes {
            let modes = DrawnMode::lowest(self, &scenario.units);
            let modes = modes.iter().enumerate();
            view.modes = modes
                .map(|(k, mode)| mode_shape(self, k + 1, mode, &view.drawn))
                .collect();
        }
    }
}

/// The loads on a leaf at rest, those that turn with its sections among them.
fn loads_on_leaf(leaf: &Equilibrium, scenario: &Scenario) -> Vec<LoadMark> {
    loads_on_drawn_veins(&with_followers_as_dead(scenario, leaf), None)
}

fn mode_shape(leaf: &Equilibrium, number: usize, mode: &DrawnMode, drawn: &[usize]) -> ModeShape {
    let pick = |of: &[Vec<DVec3>]| {
        let chosen = drawn.iter().filter_map(|&number| of.get(number - 1));
        encode_vectors(chosen.flatten().copied())
    };
    ModeShape {
        label: format!("mode {number}: {}", mode.text),
        nodes: mode.displacement.first().map_or(0, Vec::len),
        rest: pick(&leaf.shape.curves),
        displacement: pick(mode.displacement),
        later: mode.later_displacement.map(pick),
    }
}

impl PageResult for Equilibria {
    const FALLBACK_FIGURE: FigureFunction<Self> = figure::equilibria;

    /// Lists all equilibria, to be shown side by side.
    fn fill_page_data(&self, view: &mut PageData, scenario: &Scenario) {
        let units = &scenario.units;
        view.kind = "equilibria";
        let count = self.found.len();
        view.verdict = count_in_words(count, "equilibrium", "equilibria");
        if count > MOST_EQUILIBRIA_SHOWN {
            view.verdict += &format!(", the first {MOST_EQUILIBRIA_SHOWN} shown");
        }
        view.success = count > 0;
        let shown = self.found.iter().take(MOST_EQUILIBRIA_SHOWN);
        let shapes = shown.map(|it| DrawnVeins::from_equilibrium(&it.equilibrium, scenario));
        let shapes: Vec<DrawnVeins> = shapes.collect();
        view.toward = Some(ViewAngles::telling_apart(&shapes).toward_viewer());
        for (k, found) in self.found.iter().take(MOST_EQUILIBRIA_SHOWN).enumerate() {
            let leaf = &found.equilibrium;
            let kind = leaf.stability.negative_eigenvalues;
            let kind = kind.map_or("stability unknown".into(), stability_phrase);
            let energy = format_four_digits(leaf.energy.unwrap_or(f64::NAN));
            let label = format!("{}. energy {energy}, {kind}", k + 1);
            view.leaves.push(PageLeaf {
                summary: leaf.summary(units),
                loads: Some(loads_on_leaf(leaf, scenario)),
                ..PageLeaf::with_node_states(label, leaf, view)
            });
        }
    }
}

impl PageResult for Record {
    const FALLBACK_FIGURE: FigureFunction<Self> = figure::filmstrip;

    fn fill_page_data(&self, view: &mut PageData, scenario: &Scenario) {
        let units = &scenario.units;
        view.kind = "motion";
        view.verdict = match self.stopped {
            None => format!("followed to {}", instant_text(self.time, units)),
            Some(_) => {
                let (instant, outcome) = (instant_text(self.time, units), self.outcome());
                format!("ended early at {instant}: {outcome}")
            }
        };
        view.success = self.stopped.is_none();
        let shapes = self.film.iter().map(|still| {
            let time = self.moments[still.moment].time;
            let (label, curves) = (instant_text(time, units), &still.curves);
            PageLeaf {
                time: Some(time),
                ..PageLeaf::from_centerlines(
                    label,
                    &self.stations,
                    curves,
                    view,
                    MOST_MOTION_SEGMENTS,
                )
            }
        });
        view.leaves = shapes.collect();
        view.chart = Some(motion_chart(&self.moments, units));
    }
}

/// An instant in the scenario's unit of time, if it names one.
fn instant_text(time: f64, units: &Units) -> String {
    let number = format_four_digits(time);
    match &units.time {
        Some(unit) => format!("t = {number} {unit}"),
        None => format!("t = {number}"),
    }
}

fn motion_chart(moments: &[OutputSample], units: &Units) -> PageChart {
    let stride = moments.len().div_ceil(MOST_CURVE_POINTS).max(1);
    let shown = || moments.iter().step_by(stride);
    let curve = |choice, color, name: &str, of: &dyn Fn(&OutputSample) -> f64| PageCurve {
        choice,
        name: name.into(),
        color,
        x: shown().map(|moment| moment.time).collect(),
        y: shown().map(of).collect(),
        ..PageCurve::default()
    };
    type Energy = fn(&OutputSample) -> f64;
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
    let origin = small_motion_origin(moments);
    let start = origin.unwrap_or_default();
    let tip =
        tip.map(|(axis, name)| curve(1, axis, name, &|m: &OutputSample| (m.tip - start)[axis]));
    let way = match origin {
        Some(_) => "tip, from where it began",
        None => "tip",
    };
    PageChart {
        across: name_with_unit("time", units.time.as_deref()),
        log: false,
        choices: vec![
            name_with_unit("energy", units.energy().as_deref()),
            name_with_unit(way, units.length.as_deref()),
        ],
        curves: energies.chain(tip).collect(),
    }
}

impl PageResult for Trace {
    const FALLBACK_FIGURE: FigureFunction<Self> = figure::trace;

    fn fill_page_data(&self, view: &mut PageData, scenario: &Scenario) {
        let units = &scenario.units;
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
                    let kind = match point.motion {
                        None => equilibrium_kind(Some(point.index)),
                        Some(_) => match point.stable() {
                            Some(false) => "unstable equilibrium".into(),
                            stable => equilibrium_kind(stable.map(|_| 0)),
                        },
                    };
                    format!("{}: {kind}", format_five_digits(point.value))
                }
                kind => {
                    let kind = kind.word().replace('-', " ");
                    format!("{}: {kind}", self.keys.text(point.value))
                }
            };
            PageLeaf {
                summary: match point.energy.is_nan() {
                    true => Vec::new(),
                    false => vec![("energy", format_ten_digits(point.energy))],
                },
                ..PageLeaf::from_centerlines(
                    label,
                    &point.stations,
                    &point.curves,
                    view,
                    MOST_SEGMENTS_PER_VEIN,
                )
            }
        };
        view.leaves = points.map(leaf).collect();
        view.chart = Some(trace_chart(self, units));
    }
}

/// Coordinates of the tip, of free tips that of the first, and the energy against the varied
/// number.
fn trace_chart(trace: &Trace, units: &Units) -> PageChart {
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
            let curve = |branch: &TraceBranch| PageCurve {
                choice,
                unstable: branch.points.iter().map(|point| point.index > 0).collect(),
                special: (branch.critical_points())
                    .map(|(at, point)| (at, point.kind.word()))
                    .collect(),
                ..curve_with_leaves(&branch.points, |point| {
                    (point.value, point.figure_value(*shown))
                })
            };
            number_curves("branch", trace.branches.iter().map(curve).collect())
        });
    PageChart {
        across: trace.keys.to_string(),
        log: trace.log,
        curves: curves.collect(),
        choices: choices
            .map(|(name, _, unit)| name_with_unit(name, unit))
            .into(),
    }
}

/// A curve through points that have a leaf each.
fn curve_with_leaves<P>(points: &[P], place: impl Fn(&P) -> (f64, f64)) -> PageCurve {
    let (x, y) = points.iter().map(place).unzip();
    PageCurve {
        x,
        y,
        ..PageCurve::default()
    }
}

/// Names and colors the curves by their numbers, and numbers the leaves of their points.
fn number_curves(what: &str, mut curves: Vec<PageCurve>) -> Vec<PageCurve> {
    let mut first = 0;
    for (number, curve) in curves.iter_mut().enumerate() {
        curve.name = format!("{what} {}", number + 1);
        curve.color = number;
        curve.leaves = (first..first + curve.x.len()).collect();
        first += curve.x.len();
    }
    curves
}

impl PageResult for StabilityBoundary {
    const FALLBACK_FIGURE: FigureFunction<Self> = figure::boundary;

    fn fill_page_data(&self, view: &mut PageData, _: &Scenario) {
        view.kind = "trace";
        drop_varied_loads(view, &self.keys);
        let count = count_in_words(self.curves.len(), "curve", "curves");
        view.verdict = match self.complete {
            true => format!("{count}, followed to the ends"),
            false => format!("{count}, not all followed to their ends"),
        };
        view.success = self.complete;
        let points = self.curves.iter().flat_map(|curve| &curve.points);
        let leaf = |point: &BoundaryPoint| {
            let [first, second] = point.values.map(format_five_digits);
            let label = format!("{first}, {second}: {}", point.kind.replace('-', " "));
            PageLeaf::from_centerlines(
                label,
                &point.stations,
                &point.curves,
                view,
                MOST_SEGMENTS_PER_VEIN,
            )
        };
        view.leaves = points.map(leaf).collect();
        view.chart = Some(boundary_chart(self));
    }
}

/// Loads that vary from leaf to leaf have no arrow of one size.
fn drop_varied_loads(view: &mut PageData, keys: &[ParameterKeys]) {
    let is_load = |target: &VariableTarget| match target {
        VariableTarget::Entry(part) => part.key.path().starts_with("load."),
        VariableTarget::Knob(_) => false,
    };
    if keys.iter().flat_map(ParameterKeys::targets).any(is_load) {
        view.loads.clear();
    }
}

/// The plane of a boundary: the second number, or its logarithm, against the first.
fn boundary_chart(boundary: &StabilityBoundary) -> PageChart {
    let up = |value: f64| match boundary.log[1] {
        true => value.abs().log10(),
        false => value,
    };
    let curves = boundary.curves.iter().map(|curve| {
        let points = &curve.points;
        let special = points.iter().enumerate();
        let special = special.filter(|(_, point)| is_codimension_two(point));
        PageCurve {
            unstable: (points.iter())
                .map(|point| point.index_before.min(point.index_behind) > 0)
                .collect(),
            special: special.map(|(at, point)| (at, point.kind)).collect(),
            ..curve_with_leaves(points, |point| (point.values[0], up(point.values[1])))
        }
    });
    let name = boundary.keys[1].to_string();
    PageChart {
        across: boundary.keys[0].to_string(),
        log: boundary.log[0],
        choices: vec![match boundary.log[1] {
            true => format!("log₁₀ of {name}"),
            false => name,
        }],
        curves: number_curves("curve", curves.collect()),
    }
}
