//! The leaf at the nodes of its grids, extrapolated over them.

use crate::leaf::RodFields;
use crate::relax::level::Level;
use crate::relax::richardson::Richardson;
use crate::relax::shape;
use glam::{DQuat, DVec3};

/// Values carried per node through the extrapolation: position, quaternion, n, m.
const FIELDS: usize = 13;

pub type Node = [f64; FIELDS];

/// The leaf's fields after `columns` extrapolations at the ends of `parts` equal parts of its
/// grids, rod after rod, dimensionless.
pub fn nodes(levels: &[Level], columns: usize, parts: usize) -> Vec<Vec<RodFields>> {
    let finest = &levels[levels.len() - 1];
    let rods = 0..finest.leaf.rods();
    if columns == 0 {
        return rods.map(|j| on_grid(finest, j, parts)).collect();
    }
    let used: Vec<&Level> = levels[levels.len() - 1 - columns..].iter().collect();
    let node = |values: &Node| {
        let (x, q, resultants) = unpacked(values);
        let [n, m] = resultants.map(|vector| q * vector);
        RodFields { x, q, n, m }
    };
    let rod = |j: usize| {
        let nodes = RodNodes::new(&used, finest, j).extrapolated(parts);
        nodes.iter().map(node).collect()
    };
    rods.map(rod).collect()
}

/// The fields of a rod on one grid.
fn on_grid(level: &Level, j: usize, parts: usize) -> Vec<RodFields> {
    let Level { leaf, state } = level;
    let stride = leaf.segments() / parts;
    let node = |(i, q): (usize, DQuat)| {
        let [n, m] = shape::resultants(leaf, state, j, i).map(|vector| q * vector);
        let x = state.x[state.base(j) + i];
        RodFields { x, q, n, m }
    };
    let rotations = rotations(level, j).into_iter().enumerate();
    rotations.step_by(stride).map(node).collect()
}

/// The nodes of a rod on several grids, each computed on first use and cached: nodes common to
/// several grids are used repeatedly.
pub struct RodNodes<'l> {
    rod: usize,
    /// Quaternions on the finest grid, continuous in sign.
    signs: Vec<DQuat>,
    levels: Vec<(&'l Level, Vec<Option<Node>>)>,
}

impl<'l> RodNodes<'l> {
    /// On `levels`; quaternions have the signs of those on the finest.
    pub fn new(levels: &[&'l Level], finest: &Level, rod: usize) -> Self {
        let none = |level: &&'l Level| (*level, vec![None; level.leaf.segments() + 1]);
        RodNodes {
            rod,
            signs: rotations(finest, rod),
            levels: levels.iter().map(none).collect(),
        }
    }

    /// The extrapolated fields at the ends of `parts` equal parts of the grid, from the grids
    /// that have these nodes.
    pub fn extrapolated(&mut self, parts: usize) -> Vec<Node> {
        let (rod, signs) = (self.rod, &self.signs);
        let mut table = Richardson::default();
        let mut count = 0;
        for (level, known) in &mut self.levels {
            let segments = level.leaf.segments();
            if !segments.is_multiple_of(parts) {
                continue;
            }
            let stride = segments / parts;
            let values = (0..=parts).flat_map(|i| {
                *known[i * stride].get_or_insert_with(|| {
                    let state = &level.state;
                    let k = state.base(rod) + i * stride;
                    let [n, m] = shape::resultants(&level.leaf, state, rod, i * stride);
                    // q and -q are the same rotation: all grids must use the same sign.
                    let q = with_sign_of(state.q[k], signs[i * ((signs.len() - 1) / parts)]);
                    components(state.x[k], q, n, m)
                })
            });
            table.push(segments, values.collect());
            count += 1;
        }
        table.column(count - 1).as_chunks().0.to_vec()
    }
}

/// Quaternions of rod `j` at all nodes, continuous in sign.
fn rotations(level: &Level, j: usize) -> Vec<DQuat> {
    let base = level.state.base(j);
    continuous(&level.state.q[base..=base + level.leaf.segments()])
}

/// The same rotations by quaternions that are continuous in sign.
pub fn continuous(rotations: &[DQuat]) -> Vec<DQuat> {
    let mut before = rotations[0];
    let same = |q: &DQuat| {
        before = with_sign_of(*q, before);
        before
    };
    rotations.iter().map(same).collect()
}

/// The components of a node's fields, with force and moment along its directors.
pub fn components(x: DVec3, q: DQuat, n: DVec3, m: DVec3) -> Node {
    [
        x.x, x.y, x.z, q.x, q.y, q.z, q.w, n.x, n.y, n.z, m.x, m.y, m.z,
    ]
}

/// The same as position, rotation, force and moment.
pub fn unpacked(node: &Node) -> (DVec3, DQuat, [DVec3; 2]) {
    let vector = |k: usize| DVec3::from_slice(&node[k..]);
    let q = DQuat::from_slice(&node[3..]).normalize();
    (vector(0), q, [vector(7), vector(10)])
}

/// Of q and -q the one nearer to `other`.
pub fn with_sign_of(q: DQuat, other: DQuat) -> DQuat {
    if q.dot(other) < 0.0 { -q } else { q }
}
