//! Strains and stress resultants at the nodes of a state.

use crate::leaf::{DiscreteLeaf, Leaf, State};
use crate::shape::NodeState;
use glam::DVec3;

/// The state of node `i` of rod `j`, dimensionless.
///
/// Forces and moments are taken from the balance of the node's half-cell and
/// the end moments of the adjoining segment, strains from them by eqs (5) and
/// (6): all of them then have the clean ds^2 series of the positions.
pub fn node(leaf: &DiscreteLeaf, state: &State, j: usize, i: usize) -> NodeState {
    let n = leaf.segments();
    let k = state.base(j) + i;
    let to_directors = state.q[k].conjugate();
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
    let mut node = NodeState {
        position: state.x[k],
        rotation: state.q[k],
        v: DVec3::X,
        u: DVec3::ZERO,
        n: to_directors * force,
        m: to_directors * moment,
    };
    strains(&leaf.leaf, j, leaf.grid.sigma()[i], &mut node);
    node
}

/// Sets v and u of a node from its n and m by the constitutive law.
pub fn strains(leaf: &Leaf, j: usize, sigma: f64, node: &mut NodeState) {
    let section = leaf.section(j, sigma, 1.0);
    node.v = section.rest_strain + section.compliance * node.n;
    node.u = section.rest_curvature + node.m / section.couple_stiffness;
}
