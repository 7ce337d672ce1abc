//! Strains and stress resultants at the nodes of a state.

use crate::leaf::{DiscreteLeaf, Leaf, State};
use crate::scenario::Scale;
use crate::shape::{NodeState, RodShape};
use glam::DVec3;

/// The state of node `i` of rod `j`, dimensionless: strains follow from the stress
/// resultants by eqs (5) and (6).
pub fn node(leaf: &DiscreteLeaf, state: &State, j: usize, i: usize) -> NodeState {
    let [n, m] = resultants(leaf, state, j, i);
    let k = state.base(j) + i;
    let mut node = NodeState {
        position: state.x[k],
        rotation: state.q[k],
        v: DVec3::X,
        u: DVec3::ZERO,
        n,
        m,
    };
    strains(&leaf.leaf, j, leaf.grid.sigma()[i], &mut node);
    node
}

/// A dimensionless node in the units of a scenario.
pub fn in_units(node: NodeState, scale: Scale) -> NodeState {
    NodeState {
        position: node.position * scale.length,
        u: node.u / scale.length,
        n: node.n * scale.force(),
        m: node.m * scale.moment(),
        ..node
    }
}

/// All rods of a state in the units of the scenario.
pub fn rods(leaf: &DiscreteLeaf, state: &State) -> Vec<RodShape> {
    let scale = leaf.leaf.scale;
    let rod = |j: usize| {
        let nodes = (0..=leaf.segments()).map(|i| in_units(node(leaf, state, j, i), scale));
        RodShape {
            length: leaf.leaf.length(j) * scale.length,
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
        (carried(0) + leaf.load(state, j, 0).0, -segment(0).1)
    } else {
        // The part of the nodal load that belongs to the left half-cell.
        let left = leaf.grid.width(i - 1);
        let right = if i < n { leaf.grid.width(i) } else { 0.0 };
        let mut load = leaf.load(state, j, i).0;
        if i == n {
            load -= leaf.tip_force(j);
        }
        let force = carried(i - 1) - load * (left / (left + right));
        (force, segment(i - 1).2)
    };
    [force, moment].map(|vector| to_directors * vector)
}

/// Sets v and u of a node from its n and m by the constitutive law.
pub fn strains(leaf: &Leaf, j: usize, sigma: f64, node: &mut NodeState) {
    let section = leaf.section(j, sigma, 1.0);
    node.v = section.rest_strain + section.compliance * node.n;
    node.u = section.rest_curvature + node.m / section.couple_stiffness;
}
