//! What a leaf at rest does when a number of its scenario changes: derivatives of
//! its results, from the linearised equations on each grid, extrapolated like the
//! results themselves.

use crate::leaf::{
    DiscreteLeaf, Field, Forces, Leaf, LeafRate, Response, Solved, SparseFactor, SparsePattern,
    State, System, shift, turn,
};
use crate::modes;
use crate::motion::Physics;
use crate::relax::number::Number;
use crate::relax::richardson::Richardson;
use crate::relax::run::Level;
use crate::rotation;
use crate::scenario::Scenario;
use crate::shape::serialize_tips;
use glam::DVec3;
use serde::Serialize;
use std::sync::Arc;

/// Relative accuracy of the conjugate gradients, as a part of the tolerance, and the
/// best there is.
const SOLUTION: f64 = 3e-3;
const BEST_SOLUTION: f64 = 1e-11;

/// Corrections where the forces of a stiff rod are condensed out with less than its
/// stiffness; each gains many digits.
const CORRECTIONS: usize = 3;
const CORRECTED: f64 = 1e-10;

/// Safety factor on the estimate for positions: errors of derivatives fall less
/// regularly.
const SAFETY: f64 = 3.0;

/// Relative error that rounding leaves, and that which unfinished iterations leave as
/// a part of the tolerance.
const ROUNDING: f64 = 1e-10;
const UNFINISHED: f64 = 0.1;

/// Relative error of the eigenvalue's where modes are those of a softened leaf, and the
/// compliance of one that is.
const SOFTENED: f64 = 2e-5;
const SOFTENED_COMPLIANCE: f64 = 1e-6;

/// Unknowns of the finest grid on which the eigenvalue is differenced, but for the
/// first.
const FEW_UNKNOWNS: usize = 4_000;

/// How the results of a leaf at rest change with a number of its scenario: by one
/// of its units, in those of the scenario.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sensitivity {
    /// The number.
    pub key: String,
    /// Its value.
    pub value: f64,
    /// Change of the joint tip alone, or one per rod.
    #[serde(flatten, serialize_with = "serialize_tips")]
    pub tips: Vec<DVec3>,
    /// Bound on its error; `None` on a single grid.
    pub tip_error: Option<f64>,
    /// Change of the energy.
    pub energy: f64,
    /// Bound on its error.
    pub energy_error: Option<f64>,
    /// Change of the lowest eigenvalue, if that is known: of the squared frequency.
    pub lowest_eigenvalue: Option<f64>,
    /// Bound on its error.
    pub lowest_eigenvalue_error: Option<f64>,
}

/// The answers of a settled leaf (all rods, in space) to forces. `None` where its
/// matrix is singular.
pub(crate) fn responses(level: &Level, loads: &[Forces], tolerance: f64) -> Option<Vec<Response>> {
    let (leaf, state) = (&level.leaf, &level.state);
    let accuracy = (SOLUTION * tolerance).clamp(BEST_SOLUTION, 1e-4);
    let mut system = System::new(leaf);
    leaf.assemble(state, &mut system);
    let factorized = match leaf.tip_moment() == DVec3::ZERO {
        true => system.factorize(0.0),
        false => system.factorize_indefinite(),
    };
    if factorized {
        let rods = |system: &mut System, rhs: &Field| {
            system.set_rhs(rhs);
            match system.solve(None, accuracy) {
                Solved::Yes(_) => Some(system.solution()),
                _ => None,
            }
        };
        let found: Option<Vec<_>> = (loads.iter())
            .map(|load| answer(leaf, state, load, &mut |rhs| rods(&mut system, rhs)))
            .collect();
        if found.is_some() {
            return found;
        }
        leaf.assemble(state, &mut system);
    }
    let pattern = SparsePattern::new(&system).ok()?;
    let mut factor: SparseFactor = pattern.factorize(&system, 0.0).ok()?;
    let mut direct = |rhs: &Field| Some(factor.solve_bordered(rhs, &[]).increments);
    (loads.iter())
        .map(|load| answer(leaf, state, load, &mut direct))
        .collect()
}

fn answer(
    leaf: &DiscreteLeaf,
    state: &State,
    load: &Forces,
    solve: &mut dyn FnMut(&Field) -> Option<Field>,
) -> Option<Response> {
    let mut gaps = load.gaps.clone();
    let mut rhs = load.nodes.clone();
    let mut response = Response {
        nodes: vec![vec![[0.0; 6]; leaf.segments()]; leaf.rods()],
        carried: vec![DVec3::ZERO; gaps.len()],
    };
    let mut first = f64::INFINITY;
    for correction in 0..CORRECTIONS {
        leaf.condense_gaps(state, &gaps, &mut rhs);
        let increments = solve(&rhs)?;
        leaf.carried(state, &increments, &mut gaps, &mut response.carried);
        let mut largest = 0.0_f64;
        let sums = response.nodes.iter_mut().flatten().flatten();
        for (sum, increment) in sums.zip(increments.iter().flatten().flatten()) {
            largest = largest.max(increment.abs());
            *sum += increment;
        }
        if correction == 0 {
            first = largest;
        }
        let settled = gaps.iter().all(|gap| *gap == DVec3::ZERO);
        if !largest.is_finite() || settled || largest < CORRECTED * first {
            break;
        }
        rhs.iter_mut().flatten().for_each(|force| *force = [0.0; 6]);
    }
    let mut numbers = response.nodes.iter().flatten().flatten();
    let finite = numbers.all(|value| value.is_finite());
    finite.then_some(response)
}

/// Values on ever finer grids, each extrapolated on its own.
pub(crate) struct Series {
    segments: Vec<usize>,
    values: Vec<Vec<DVec3>>,
}

impl Series {
    pub fn new() -> Self {
        Series {
            segments: Vec::new(),
            values: Vec::new(),
        }
    }

    pub fn push(&mut self, segments: usize, values: Vec<DVec3>) {
        self.segments.push(segments);
        self.values.push(values);
    }

    /// The best values, and a bound on the error of all.
    pub fn judged(&self, tolerance: f64) -> (Vec<DVec3>, Option<f64>) {
        let all = self.values.iter().flatten();
        let unit = all.fold(0.0_f64, |m, v| m.max(v.abs().max_element()));
        let count = self.values.last().map_or(0, Vec::len);
        if unit == 0.0 || count == 0 {
            let error = (self.segments.len() > 1).then_some(0.0);
            return (vec![DVec3::ZERO; count], error);
        }
        let mut table = Richardson::default();
        for (segments, values) in self.segments.iter().zip(&self.values) {
            let numbers = values.iter().flat_map(|v| (*v / unit).to_array());
            table.push(*segments, numbers.collect());
        }
        let best = table.best();
        let column = table.column(best.map_or(0, |best| best.columns));
        let values = column.chunks(3).map(|v| DVec3::from_slice(v) * unit);
        (
            values.collect(),
            best.map(|best| (SAFETY * best.error + ROUNDING + UNFINISHED * tolerance) * unit),
        )
    }

    fn judged_number(&self, tolerance: f64) -> (f64, Option<f64>) {
        let (values, error) = self.judged(tolerance);
        (values.first().map_or(f64::NAN, |value| value.x), error)
    }
}

/// A unit force on every tip along every axis.
fn unit_forces(leaf: &DiscreteLeaf, tips: usize) -> Vec<Forces> {
    let n = leaf.segments();
    let force = |(tip, axis): (usize, usize)| {
        let mut nodes = vec![vec![[0.0; 6]; n]; leaf.rods()];
        nodes[tip][n - 1][3 + axis] = 1.0;
        Forces {
            nodes,
            gaps: vec![DVec3::ZERO; leaf.rods() * n],
            energy: 0.0,
        }
    };
    let all = (0..tips).flat_map(|tip| (0..3).map(move |axis| (tip, axis)));
    all.map(force).collect()
}

/// The derivatives of a leaf's results by these numbers, each of which has a name.
/// `levels` are its grids from coarse to fine. A number of which the scenario cannot
/// be differenced, and all where the leaf is at a singular point, are left out.
pub(crate) fn sensitivities(
    levels: &[Level],
    numbers: &[(String, Number)],
    tolerance: f64,
    eigenvalue: bool,
) -> Vec<Sensitivity> {
    let Some(finest) = levels.last() else {
        return Vec::new();
    };
    let leaf = &finest.leaf.leaf;
    let known: Vec<(&String, &Number, Vec<(f64, Scenario)>)> = (numbers.iter())
        .filter_map(|(key, number)| Some((key, number, number.rate()?)))
        .collect();
    let rates: Vec<LeafRate> = (known.iter())
        .map(|(_, _, terms)| LeafRate::new(leaf, terms))
        .collect();
    let tips = if leaf.joined() { 1 } else { leaf.rods() };
    let mut found: Vec<[Series; 3]> = (rates.iter())
        .map(|_| [(); 3].map(|()| Series::new()))
        .collect();
    for (k, level) in levels.iter().enumerate() {
        let unknowns = 6 * level.leaf.rods() * level.leaf.segments();
        let vibrates = eigenvalue && (k == 0 || unknowns < FEW_UNKNOWNS);
        let Some(values) = on_level(level, &known, &rates, tips, (tolerance, vibrates)) else {
            return Vec::new();
        };
        for (series, (tips, energy, eigenvalue)) in found.iter_mut().zip(values) {
            let segments = level.leaf.segments();
            series[0].push(segments, tips);
            series[1].push(segments, vec![DVec3::X * energy]);
            if let Some(eigenvalue) = eigenvalue {
                series[2].push(segments, vec![DVec3::X * eigenvalue]);
            }
        }
    }
    let scale = leaf.scale;
    let softened = match finest.leaf.stiffest() < SOFTENED_COMPLIANCE {
        true => SOFTENED,
        false => 0.0,
    };
    let named = known.iter().zip(found);
    let sensitivity = |((key, number, _), [tips, energy, eigenvalue]): (
        &(&String, &Number, Vec<(f64, Scenario)>),
        [Series; 3],
    )| {
        let (tips, tip_error) = tips.judged(tolerance);
        let (energy, energy_error) = energy.judged_number(tolerance);
        let eigenvalue = (!eigenvalue.values.is_empty()).then(|| {
            let (value, error) = eigenvalue.judged_number(tolerance);
            (value, error.map(|error| error + softened * value.abs()))
        });
        Sensitivity {
            key: (*key).clone(),
            value: number.value,
            tips: tips.iter().map(|tip| *tip * scale.length).collect(),
            tip_error: tip_error.map(|error| error * scale.length),
            energy: energy * scale.moment(),
            energy_error: energy_error.map(|error| error * scale.moment()),
            lowest_eigenvalue: eigenvalue.map(|(value, _)| value),
            lowest_eigenvalue_error: eigenvalue.and_then(|(_, error)| error),
        }
    };
    named.map(sensitivity).collect()
}

/// Changes of the tips, of the energy and, if that is wanted, of the lowest
/// eigenvalue on one grid, for every number.
fn on_level(
    level: &Level,
    known: &[(&String, &Number, Vec<(f64, Scenario)>)],
    rates: &[LeafRate],
    tips: usize,
    (tolerance, eigenvalue): (f64, bool),
) -> Option<Vec<(Vec<DVec3>, f64, Option<f64>)>> {
    let (leaf, state) = (&level.leaf, &level.state);
    let n = leaf.segments();
    let forces: Vec<Forces> = rates.iter().map(|rate| leaf.rate(state, rate)).collect();
    let moment = leaf.tip_moment();
    let mode = match eigenvalue && moment == DVec3::ZERO {
        true => modes::lowest(leaf, &Physics::new(&leaf.leaf), state, 1),
        false => None,
    };
    let mode = mode.and_then(|pairs| pairs.into_iter().next());
    // One solution for each number, or for each result if they are fewer.
    let forward = mode.is_some() || moment != DVec3::ZERO || forces.len() <= 3 * tips;
    if !forward {
        let adjoint = responses(level, &unit_forces(leaf, tips), tolerance)?;
        let component = |forces: &Forces, k: usize| leaf.work(state, forces, &adjoint[k]);
        let tip = |forces: &Forces, tip: usize| {
            DVec3::from_array([0, 1, 2].map(|axis| component(forces, 3 * tip + axis)))
        };
        let all = |forces: &Forces| (0..tips).map(|k| tip(forces, k)).collect();
        return Some(
            (forces.iter())
                .map(|forces| (all(forces), forces.energy, None))
                .collect(),
        );
    }
    let responses = responses(level, &forces, tolerance)?;
    let values = known.iter().zip(rates).zip(forces.iter().zip(&responses));
    let value = |(((_, number, _), rate), (forces, response)): (
        (&(&String, &Number, Vec<(f64, Scenario)>), &LeafRate),
        (&Forces, &Response),
    )| {
        let ends = (0..tips).map(|j| shift(&response.nodes[j][n - 1]));
        // A dead moment has no potential: what it does is not balanced in the energy.
        let work = moment.dot(turn(&response.nodes[0][n - 1]));
        let eigenvalue = (mode.as_ref())
            .and_then(|mode| eigenvalue_rate(level, number, (rate, response), &mode.shape));
        (ends.collect(), forces.energy + work, eigenvalue)
    };
    Some(values.map(value).collect())
}

/// The change of the eigenvalue of a mode: that of its quotient as the leaf goes from
/// equilibrium to equilibrium, since its shape enters in the second order only.
pub(crate) fn eigenvalue_rate(
    level: &Level,
    number: &Number,
    (rate, response): (&LeafRate, &Response),
    shape: &[[f64; 6]],
) -> Option<f64> {
    let leaf = &level.leaf;
    let forces = modes::mode_forces(leaf, &level.state, shape);
    let mut sum = 0.0;
    for (offset, weight, scenario) in number.nearby()? {
        let near = Leaf::in_units(Arc::new(scenario), leaf.leaf.scale);
        let near = DiscreteLeaf::new(&near, leaf.grid.clone());
        let state = moved(level, rate, response, offset);
        let physics = Physics::new(&near.leaf);
        sum += weight * modes::eigenvalue(&near, &physics, &state, shape, &forces);
    }
    Some(sum)
}

/// The state, moved along a response.
pub(crate) fn moved(level: &Level, rate: &LeafRate, response: &Response, step: f64) -> State {
    let (leaf, mut state) = (&level.leaf, level.state.clone());
    for (j, rod) in response.nodes.iter().enumerate() {
        let base = state.base(j);
        let turned = rotation::exp(step * rate.base_turn(j) * DVec3::Z);
        state.q[base] = (turned * state.q[base]).normalize();
        for (i, increment) in rod.iter().enumerate() {
            state.advance(base + i + 1, increment, step);
        }
    }
    let forces = state.n.iter_mut().zip(&response.carried);
    forces.for_each(|(force, change)| *force += step * change);
    debug_assert_eq!(state.segments(), leaf.segments());
    state
}
