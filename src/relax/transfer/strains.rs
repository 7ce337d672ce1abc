//! Strains and stress resultants at the nodes of a state.

use crate::leaf::{DiscreteLeaf, Leaf, RodFields, State};
use crate::shape::{NodeState, RodShape};
use glam::{DQuat, DVec3};

/// The state of rod `j` at `sigma`, from its dimensionless position and rotation and its stress
/// resultants along the directors, in the units of the scenario: strains follow from these by
/// eqs (5) and (6).
pub fn node(
    leaf: &Leaf,
    (j, sigma): (usize, f64),
    (position, rotation): (DVec3, DQuat),
    [n, m]: [DVec3; 2],
) -> NodeState {
    let (section, scale) = (leaf.section(j, sigma, 1.0), leaf.scale);
    let u = section.rest_curvature + m / section.couple_stiffness;
    NodeState {
        position: position * scale.length,
        rotation,
        v: section.rest_strain + section.compliance * n,
        u: u / scale.length,
        n: n * scale.force(),
        m: m * scale.moment(),
    }
}

/// The same from dimensionless fields along the lab axes.
pub fn node_of(leaf: &Leaf, at: (usize, f64), fields: &RodFields) -> NodeState {
    let &RodFields { x, q, n, m } = fields;
    node(leaf, at, (x, q), [n, m].map(|vector| q.inverse() * vector))
}

/// The dimensionless fields, along the lab axes, of a state in the units of the scenario.
pub fn fields(leaf: &Leaf, node: &NodeState) -> RodFields {
    let (q, scale) = (node.rotation, leaf.scale);
    RodFields {
        x: node.position / scale.length,
        q,
        n: q * node.n / scale.force(),
        m: q * node.m / scale.moment(),
    }
}

/// All rods of a state in the units of the scenario.
pub fn rods(leaf: &DiscreteLeaf, state: &State) -> Vec<RodShape> {
    let rod = |j: usize| {
        let nodes = leaf.grid.sigma().iter().enumerate().map(|(i, sigma)| {
            let k = state.base(j) + i;
            let resultants = resultants(leaf, state, j, i);
            node(
                &leaf.leaf,
                (j, *sigma),
                (state.x[k], state.q[k]),
                resultants,
            )
        });
        RodShape {
            length: leaf.leaf.length(j) * leaf.leaf.scale.length,
            nodes: nodes.collect(),
        }
    };
    (0..leaf.rods()).map(rod).collect()
}

/// Stress resultant n and couple m at node `i` of rod `j` along its directors, dimensionless:
/// from the balance of the node's half-cell and the end moments of the adjoining segment, so
/// that they have the clean ds^2 series of the positions.
pub fn resultants(leaf: &DiscreteLeaf, state: &State, j: usize, i: usize) -> [DVec3; 2] {
    let n = leaf.segments();
    let to_directors = state.q[state.base(j) + i].conjugate();
    let carried = |i: usize| state.n[j * n + i];
    let segment = |i: usize| {
        leaf.segment(state, j, i, carried(i))
            .gradient(leaf.section(j, i))
    };
    let (force, moment) = if i == 0 {
        let load = leaf.load(state, j, 0);
        (carried(0) + load.force, load.moment - segment(0).1)
    } else {
        // The part of the nodal load that belongs to the left half-cell.
        let left = leaf.grid.width(i - 1);
        let right = if i < n { leaf.grid.width(i) } else { 0.0 };
        let mut load = leaf.load(state, j, i);
        load.force -= match i == n {
            true => leaf.tip_force(j),
            false => leaf.force_on_points(j, leaf.grid.sigma()[i]),
        };
        let before = left / (left + right);
        let force = carried(i - 1) - before * load.force;
        (force, segment(i - 1).2 - before * load.moment)
    };
    [force, moment].map(|vector| to_directors * vector)
}
