//! From the settled grids to the result in the units of the scenario.

use crate::leaf::DiscreteLeaf;
use crate::newton::Stop;
use crate::relax::equilibrium::{
    Accuracy, Equilibrium, Model, Outcome, Reaction, Shape, Stability,
};
use crate::relax::method::Method;
use crate::relax::prolong::lagrange;
use crate::relax::richardson::Richardson;
use crate::relax::run::{Level, Run};
use crate::relax::shape;
use crate::shape::{NodeState, RodShape};
use crate::undulation::{Centerline, Undulation};
use glam::{DQuat, DVec3};

/// Assembles the result.
pub fn equilibrium(
    run: &Run,
    outcome: Outcome,
    remark: Option<String>,
    wall_seconds: f64,
) -> Equilibrium {
    let finest = run.levels.last().expect("the grid it failed on, at least");
    let (scenario, scale) = (run.leaf.scenario(), run.leaf.scale);
    let best = run.table.best();
    let columns = best.map_or(0, |best| best.columns);
    let series = run.series();
    let (stations, rods) = fields(&series, columns);
    let joined = run.leaf.joined();
    let tips = rods.iter().take(if joined { 1 } else { rods.len() });
    let tips = tips.filter_map(|rod| rod.nodes.last());
    let mut energies = Richardson::default();
    for level in &series {
        energies.push(level.leaf.segments(), vec![level.leaf.energy(&level.state)]);
    }
    let error_estimate = run.error().map(|error| error * scale.length);
    let lines = centerlines(finest);
    let tip_force = |rod: &RodShape| rod.nodes.last().map_or(DVec3::ZERO, |n| n.rotation * n.n);
    let segments: Vec<usize> = series.iter().map(|level| level.leaf.segments()).collect();
    Equilibrium {
        scenario: scenario.name.clone(),
        method: run.options.method,
        outcome,
        remark,
        rod_count: rods.len(),
        energy: Some(energies.column(columns)[0] * scale.moment()),
        tips: tips.map(|node| node.position).collect(),
        tip_force_sum: rods.iter().map(tip_force).sum(),
        reaction: reaction(&series, columns),
        stability: Stability {
            negative_eigenvalues: run.index,
            modes: None,
            mode_shapes: run.options.mode_shapes,
            saddle: run.saddle,
        },
        sensitivities: None,
        undulation: Undulation::of(scenario, &lines, &stations, &rods, error_estimate),
        model: Model::new(
            rods.len(),
            (run.solved, run.planar),
            &segments,
            (run.effects).map(|effect| effect.map(|effect| effect * scale.length)),
        ),
        accuracy: Accuracy {
            segments,
            intervals: None,
            tolerance: run.tolerance,
            residual: Some(finest.leaf.residual(&finest.state)),
            error_estimate,
        },
        work: run.work,
        wall_seconds,
        shape: Shape {
            stations,
            rods,
            joined,
            curves: (lines.iter())
                .map(|line| line.iter().map(|(x, _)| *x).collect())
                .collect(),
            curve_stations: finest.leaf.grid.sigma().to_vec(),
        },
    }
}

/// What the holder of a held tip feels, with `columns` extrapolations.
fn reaction(levels: &[&Level], columns: usize) -> Option<Reaction> {
    let leaf = &levels[0].leaf.leaf;
    let held = leaf.held.as_ref()?;
    let mut table = Richardson::default();
    for level in levels {
        let (force, moments) = level.leaf.reaction(&level.state);
        let all = [force].into_iter().chain(moments);
        table.push(
            level.leaf.segments(),
            all.flat_map(|it| it.to_array()).collect(),
        );
    }
    let values = table.column(columns);
    let mut vectors = values
        .as_chunks::<3>()
        .0
        .iter()
        .map(|&it| DVec3::from_array(it));
    let force = vectors.next()? * leaf.scale.force();
    let moments = vectors.map(|moment| moment * leaf.scale.moment()).collect();
    Some(Reaction {
        force,
        moments: held.clamps.is_some().then_some(moments),
    })
}

/// All nodes of a level, in units of the scenario.
fn centerlines(level: &Level) -> Vec<Centerline> {
    let (n, length) = (level.leaf.segments(), level.leaf.leaf.scale.length);
    let node = |k: usize| (level.state.x[k] * length, level.state.q[k]);
    let bases = (0..level.leaf.rods()).map(|j| level.state.base(j));
    bases
        .map(|base| (base..=base + n).map(node).collect())
        .collect()
}

/// Values carried per node through the extrapolation: position, quaternion, n, m.
const FIELDS: usize = 13;

/// Stations at which a result is given, if it is known there.
const STATIONS: usize = 8;

/// All nodal fields, in the scenario's units, with `columns` extrapolations: at
/// the stations of the first level, or if these are few of the second. What the
/// first level corrects is interpolated then.
fn fields(levels: &[&Level], columns: usize) -> (Vec<f64>, Vec<RodShape>) {
    let first = levels[0];
    let (n, length) = (first.leaf.segments(), first.leaf.leaf.scale.length);
    let used = &levels[levels.len() - 1 - columns..];
    let reported = match levels {
        [_, second, ..] if n < STATIONS => second,
        _ => first,
    };
    let rods = (0..first.leaf.rods())
        .map(|j| {
            let mut nodes = extrapolated(used, j, n);
            let stations = reported.leaf.segments();
            if stations > n {
                let from = used.len().min(levels.len() - 1);
                let mut finer = extrapolated(&used[used.len() - from..], j, stations);
                let stride = stations / n;
                for (i, node) in nodes.iter_mut().enumerate() {
                    for (value, finer) in node.iter_mut().zip(&finer[i * stride]) {
                        *value -= finer;
                    }
                }
                interpolate(&nodes, &mut finer);
                nodes = finer;
            }
            let node = |(i, values): (usize, &[f64; FIELDS])| unpack(&reported.leaf, j, i, values);
            RodShape {
                length: first.leaf.leaf.length(j) * length,
                nodes: nodes.iter().enumerate().map(node).collect(),
            }
        })
        .collect();
    (reported.leaf.grid.sigma().to_vec(), rods)
}

/// The nodal fields of rod `j` at the ends of `n` parts.
fn extrapolated(levels: &[&Level], j: usize, n: usize) -> Vec<[f64; FIELDS]> {
    let reference = rotations(levels[0], j, n);
    let mut table = Richardson::default();
    for level in levels {
        let stride = level.leaf.segments() / n;
        let node = |i: usize| shape::node(&level.leaf, &level.state, j, i * stride);
        let values = (0..=n).flat_map(|i| pack(&node(i), reference[i]));
        table.push(level.leaf.segments(), values.collect());
    }
    table.column(levels.len() - 1).as_chunks().0.to_vec()
}

/// Rotations of rod `j` at the ends of `n` parts, of a continuous sign.
fn rotations(level: &Level, j: usize, n: usize) -> Vec<DQuat> {
    let stride = level.leaf.segments() / n;
    let mut rotations: Vec<DQuat> = Vec::new();
    for i in 0..=n {
        let q = level.state.q[level.state.base(j) + i * stride];
        rotations.push(alike(q, rotations.last().copied().unwrap_or(q)));
    }
    rotations
}

/// Adds to `nodes` what `corrections` at fewer of them are in between.
fn interpolate(corrections: &[[f64; FIELDS]], nodes: &mut [[f64; FIELDS]]) {
    let count = corrections.len().min(5);
    let width = (corrections.len() - 1) as f64 / (nodes.len() - 1) as f64;
    for (k, values) in nodes.iter_mut().enumerate() {
        let at = k as f64 * width;
        let before = (at as usize).saturating_sub(1);
        let begin = before.min(corrections.len() - count);
        for a in 0..count {
            let weight = lagrange(count, a, at - begin as f64);
            for (value, correction) in values.iter_mut().zip(&corrections[begin + a]) {
                *value += weight * correction;
            }
        }
    }
}

fn pack(node: &NodeState, reference: DQuat) -> [f64; FIELDS] {
    // A rotation's two quaternions must not be mixed up between grids.
    let q = alike(node.rotation, reference);
    let (x, n, m) = (node.position, node.n, node.m);
    [
        x.x, x.y, x.z, q.x, q.y, q.z, q.w, n.x, n.y, n.z, m.x, m.y, m.z,
    ]
}

/// That quaternion of a rotation which is nearer to another.
fn alike(q: DQuat, other: DQuat) -> DQuat {
    if q.dot(other) < 0.0 { -q } else { q }
}

fn unpack(leaf: &DiscreteLeaf, j: usize, i: usize, values: &[f64]) -> NodeState {
    let vector = |k: usize| DVec3::new(values[k], values[k + 1], values[k + 2]);
    let mut node = NodeState {
        position: vector(0),
        rotation: DQuat::from_xyzw(values[3], values[4], values[5], values[6]).normalize(),
        v: DVec3::X,
        u: DVec3::ZERO,
        n: vector(7),
        m: vector(10),
    };
    shape::strains(leaf, j, leaf.grid.sigma()[i], &mut node);
    let scale = leaf.leaf.scale;
    node.position *= scale.length;
    node.u /= scale.length;
    node.n *= scale.force();
    node.m *= scale.moment();
    node
}

/// Of a leaf that moved far while it was softer than it is.
const SOFTENED: &str = "stiff rods were softened while the leaf moved: \
     where it has several equilibria, its own motion may end in another; simulate shows it";

/// How a run ended, at rest (to the tolerance or not) or stopped before: a word, and
/// a sentence where one helps.
pub fn outcome(run: &Run, end: Result<bool, Stop>) -> (Outcome, Option<String>) {
    let finest = run.levels.last().map_or(0, |level| level.leaf.segments());
    let explicit = matches!(run.options.method, Method::Explicit { .. });
    match end {
        Ok(true) => (
            match (run.index, run.saddle) {
                (Some(1..), _) => Outcome::Saddle,
                (_, Some(_)) => Outcome::ConvergedAfterSaddle,
                _ => Outcome::Converged,
            },
            run.index.is_none().then(|| match run.leaf.loads.tip_moment == DVec3::ZERO {
                true => "the leaf is too large to count its negative eigenvalues: its stability is not known".into(),
                false => "a dead moment has no potential, so that no count of eigenvalues decides stability: it is not stated".into(),
            })
            .or_else(|| run.moved_softened.then(|| SOFTENED.into())),
        ),
        Ok(false) => (
            Outcome::ToleranceNotReached,
            Some(match run.beyond_rounding(2 * finest) {
                true => "rounding and unfinished iterations leave more than the tolerance on any grid: ask for a larger one".into(),
                false => format!(
                    "{finest} segments a rod, the finest grid allowed, do not reach the tolerance: ask for a larger one"
                ),
            }),
        ),
        Err(Stop::Stuck) => (
            Outcome::Diverged,
            Some(format!(
                "no step lowers the energy on {finest} segments{}",
                what_to_change(run)
            )),
        ),
        Err(stop) => (
            Outcome::NotAtRest,
            Some(match stop {
                Stop::StepLimit if run.late() => format!(
                    "the time allowed was over before rest on {finest} segments: allow more"
                ),
                Stop::StepLimit if explicit => format!(
                    "the step limit came before rest on {finest} segments: use fewer, or the semi-implicit method"
                ),
                Stop::Unresolved => format!(
                    "a vein bends by more than a right angle within one of {finest} segments{}",
                    what_to_change(run)
                ),
                _ => format!(
                    "the step limit came before rest on {finest} segments: the load may admit no stable equilibrium{}",
                    what_to_change(run)
                ),
            }),
        ),
    }
}

/// How far a leaf came that did not come to rest, and what about it may be changed:
/// the larger of its loads, and the softest stiffness of the vein that bends most.
fn what_to_change(run: &Run) -> String {
    let Some(level) = run.levels.last() else {
        return String::new();
    };
    let bends = |j: usize| {
        let base = level.state.base(j);
        let rate = |i: usize| {
            let ends = [level.state.q[base + i], level.state.q[base + i + 1]];
            ends[0].angle_between(ends[1]) / level.leaf.section(j, i).ds
        };
        (0..level.leaf.segments()).map(rate).fold(0.0, f64::max)
    };
    let rods = 0..level.leaf.rods();
    let vein = rods
        .max_by(|&a, &b| bends(a).total_cmp(&bends(b)))
        .unwrap_or(0);
    let stiffness = level.leaf.leaf.section(vein, 0.5, 1.0).couple_stiffness;
    let softest = match stiffness.min_element() {
        least if least == stiffness.x => "torsion",
        least if least == stiffness.y => "bending_2",
        _ => "bending_3",
    };
    let loads = run.leaf.loads;
    let [weight, tip, moment] =
        [loads.gravity, loads.tip_force, loads.tip_moment].map(|load| load.length());
    let load = match weight * run.leaf.rods() as f64 > tip {
        _ if moment > weight.max(tip) => "lower load.tip_moment",
        true => "lower load.gravity",
        false if tip > 0.0 => "lower load.tip_force",
        false => "lower the curvatures at rest",
    };
    let reached = match run.part {
        part if part > 0.0 && part < 0.995 => {
            format!(" (it rests under {:.2} % of the loads)", 100.0 * part)
        }
        _ => String::new(),
    };
    format!(
        "{reached}: {load}, or raise stiffness.{softest} of vein {}",
        vein + 1
    )
}
