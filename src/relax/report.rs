//! From the settled grids to the result in the units of the scenario.

use crate::leaf::DiscreteLeaf;
use crate::relax::equilibrium::{Equilibrium, Model, Outcome};
use crate::relax::grids::{End, Level, Run};
use crate::relax::richardson::Richardson;
use crate::relax::semi_implicit::Settled;
use crate::relax::shape;
use crate::shape::{NodeState, RodShape};
use crate::undulation::{Centerline, Undulation};
use glam::{DQuat, DVec3};

/// Positions of all rods at every `stride`-th node, dimensionless.
pub fn positions(level: &Level, stride: usize) -> Vec<f64> {
    let n = level.leaf.segments();
    (0..level.leaf.rods())
        .flat_map(|j| {
            (0..=n)
                .step_by(stride)
                .map(move |i| level.state.base(j) + i)
        })
        .flat_map(|k| level.state.x[k].to_array())
        .collect()
}

/// Assembles the result.
pub fn equilibrium(
    run: Run,
    outcome: Outcome,
    remark: Option<String>,
    wall_seconds: f64,
) -> Equilibrium {
    let (first, finest) = match (run.levels.first(), run.levels.last()) {
        (Some(first), Some(finest)) => (first, finest),
        _ => unreachable!("a run leaves at least the grid it failed on"),
    };
    let scale = run.leaf.scale;
    let best = run.table.best();
    let columns = best.as_ref().map_or(0, |best| best.columns);
    let series = run.series();
    let rods = fields(&series, columns);
    let joined = run.leaf.joined();
    let tips = rods.iter().take(if joined { 1 } else { rods.len() });
    let mut energies = Richardson::default();
    for level in &series {
        energies.push(level.leaf.segments(), vec![level.leaf.energy(&level.state)]);
    }
    let stations = first.leaf.grid.sigma().to_vec();
    let error_estimate = run.error().map(|error| error * scale.length);
    let lines = centerlines(finest);
    let tip_force = |rod: &RodShape| rod.nodes.last().map_or(DVec3::ZERO, |n| n.rotation * n.n);
    Equilibrium {
        scenario: run.leaf.scenario().name.clone(),
        method: run.options.method.name(),
        outcome,
        remark,
        segments: series.iter().map(|level| level.leaf.segments()).collect(),
        intervals: None,
        tolerance: run.tolerance,
        residual: finest.leaf.residual(&finest.state),
        error_estimate,
        energy: energies.column(columns)[0] * scale.moment(),
        joined,
        tips: tips
            .filter_map(|rod| rod.nodes.last())
            .map(|node| node.position)
            .collect(),
        tip_force_sum: rods.iter().map(tip_force).sum(),
        negative_eigenvalues: run.index,
        modes: None,
        mode_shapes: run.options.mode_shapes,
        saddle: run.saddle,
        model: Model {
            rods: run.solved,
            planar: run.planar,
            shear: run.effects[0].map(|effect| effect * scale.length),
            stretch: run.effects[1].map(|effect| effect * scale.length),
        },
        work: run.work,
        wall_seconds,
        undulation: Undulation::of(
            run.leaf.scenario(),
            &lines,
            &stations,
            &rods,
            error_estimate,
        ),
        stations,
        rods,
        curves: (lines.iter())
            .map(|line| line.iter().map(|(x, _)| *x).collect())
            .collect(),
    }
}

/// All nodes of a level, in units of the scenario.
fn centerlines(level: &Level) -> Vec<Centerline> {
    let (n, length) = (level.leaf.segments(), level.leaf.leaf.scale.length);
    (0..level.leaf.rods())
        .map(|j| {
            let base = level.state.base(j);
            let nodes = base..=base + n;
            nodes
                .map(|k| (level.state.x[k] * length, level.state.q[k]))
                .collect()
        })
        .collect()
}

/// Values carried per node through the extrapolation: position, quaternion, n, m.
const FIELDS: usize = 13;

/// All nodal fields at the stations of the first level, in the scenario's
/// units, with `columns` extrapolations.
fn fields(levels: &[&Level], columns: usize) -> Vec<RodShape> {
    let first = levels[0];
    let (n, scale) = (first.leaf.segments(), first.leaf.leaf.scale);
    let used = &levels[levels.len() - 1 - columns..];
    (0..first.leaf.rods())
        .map(|j| {
            let mut table = Richardson::default();
            let mut reference: Vec<DQuat> = Vec::new();
            for level in used {
                let stride = level.leaf.segments() / n;
                let nodes: Vec<NodeState> = (0..=n)
                    .map(|i| shape::node(&level.leaf, &level.state, j, i * stride))
                    .collect();
                if reference.is_empty() {
                    reference = nodes.iter().map(|node| node.rotation).collect();
                }
                let values = nodes.iter().zip(&reference).flat_map(pack).collect();
                table.push(level.leaf.segments(), values);
            }
            let values = table.column(columns);
            let nodes = values
                .chunks_exact(FIELDS)
                .enumerate()
                .map(|(i, values)| unpack(&first.leaf, j, i, values))
                .collect();
            RodShape {
                length: first.leaf.leaf.length(j) * scale.length,
                nodes,
            }
        })
        .collect()
}

fn pack((node, reference): (&NodeState, &DQuat)) -> [f64; FIELDS] {
    // A rotation's two quaternions must not be mixed up between grids.
    let q = if node.rotation.dot(*reference) < 0.0 {
        -node.rotation
    } else {
        node.rotation
    };
    let (x, n, m) = (node.position, node.n, node.m);
    [
        x.x, x.y, x.z, q.x, q.y, q.z, q.w, n.x, n.y, n.z, m.x, m.y, m.z,
    ]
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

/// How a run ended: a word, and a sentence where one helps.
pub fn outcome(run: &Run, end: End) -> (Outcome, Option<String>) {
    let finest = run.levels.last().map_or(0, |level| level.leaf.segments());
    match end {
        End::Rest => (
            match (run.index, run.saddle) {
                (Some(1..), _) => Outcome::Saddle,
                (_, Some(_)) => Outcome::ConvergedAfterSaddle,
                _ => Outcome::Converged,
            },
            run.index.is_none().then(|| match run.leaf.tip_moment == DVec3::ZERO {
                true => "the leaf is too large to count its negative eigenvalues: its stability is not known".into(),
                false => "a dead moment has no potential, so that no count of eigenvalues decides stability: it is not stated".into(),
            }),
        ),
        End::NotAccurate => (
            Outcome::ToleranceNotReached,
            Some(match run.beyond_rounding(2 * finest) {
                true => "rounding and unfinished iterations leave more than the tolerance on any grid: ask for a larger one".into(),
                false => format!(
                    "{finest} segments a rod, the finest grid allowed, do not reach the tolerance: ask for a larger one"
                ),
            }),
        ),
        End::Failed(settled) => (
            match settled {
                Settled::Stuck => Outcome::Diverged,
                _ => Outcome::NotAtRest,
            },
            Some(match settled {
                Settled::StepLimit if run.late() => format!(
                    "the time allowed was over before rest on {finest} segments: allow more"
                ),
                Settled::Unresolved => format!(
                    "a vein bends by more than a right angle within one of {finest} segments: use more segments or smaller loads"
                ),
                Settled::Stuck => format!(
                    "no step lowers the energy on {finest} segments: use more segments, or raise the softest stiffness or lower the load"
                ),
                _ => format!(
                    "the step limit came before rest on {finest} segments: the load may admit no stable equilibrium; lower it"
                ),
            }),
        ),
    }
}
