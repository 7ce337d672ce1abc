//! A leaf at rest on one grid.

use crate::leaf::{DiscreteLeaf, Leaf, State, whole_of};

/// A leaf settled on one grid.
#[derive(Clone)]
pub struct Level {
    pub leaf: DiscreteLeaf,
    pub state: State,
}

/// The level of the whole leaf from that of its half, or from its own.
pub fn complete(reduced: &Leaf, whole: &Leaf, level: &Level) -> Level {
    if !reduced.in_half() {
        return level.clone();
    }
    Level {
        leaf: DiscreteLeaf::new(whole, level.leaf.grid.clone()),
        state: whole_of(reduced, &level.state),
    }
}

/// Whether all nodes lie in the plane z = 0.
pub fn flat(level: &Level) -> bool {
    level.state.x.iter().all(|x| x.z == 0.0)
}

/// Positions of all rods at every `stride`-th node, dimensionless.
pub fn positions(level: &Level, stride: usize) -> Vec<f64> {
    let n = level.leaf.segments();
    let nodes = |j: usize| {
        (0..=n)
            .step_by(stride)
            .map(move |i| level.state.base(j) + i)
    };
    let nodes = (0..level.leaf.rods()).flat_map(nodes);
    nodes.flat_map(|k| level.state.x[k].to_array()).collect()
}
