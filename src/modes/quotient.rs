//! Rayleigh quotients of shapes.

use crate::leaf::{DiscreteLeaf, Increment, State, at_constant_force, shift, turn};
use crate::rod::{Section, Segment};
use glam::DVec3;

/// Rounding error of the quotient of a mode of unit mass.
pub fn rounding(leaf: &DiscreteLeaf) -> f64 {
    let sections = leaf.sections.iter();
    let stiffest = sections.fold(0.0_f64, |m, s| m.max(s.couple_stiffness.max_element()));
    4.0 * f64::EPSILON * stiffest * (leaf.segments() * leaf.segments()) as f64
}

/// The spatial forces that a shape causes in the segments.
pub fn forces(leaf: &DiscreteLeaf, state: &State, shape: &[Increment]) -> Vec<DVec3> {
    let n = leaf.segments();
    let force = |(j, i): (usize, usize)| {
        let mut segment = leaf.segment(state, j, i, state.n[j * n + i]);
        segment.gap = DVec3::ZERO;
        let [a, b] = [0, 1].map(|end| &shape[state.base(j) + i + end]);
        segment.force_increment(leaf.section(j, i), shift(b) - shift(a), turn(a), turn(b))
    };
    leaf.each(0..n).map(force).collect()
}

/// Rayleigh quotient of a shape of unit mass, in mixed form: with the [`forces`] that the shape
/// causes in the segments as independent variables. Errors of the shape or of these forces,
/// from rounding or from the stiffness with which the forces were condensed out, have only a
/// second-order effect; and no large stiffness enters. The leaf and the state may be near those
/// to which both belong.
pub fn quotient(leaf: &DiscreteLeaf, state: &State, shape: &[Increment], forces: &[DVec3]) -> f64 {
    let n = leaf.segments();
    let mut sum = 0.0;
    for (j, i) in leaf.each(0..n) {
        let section = leaf.section(j, i);
        let segment = leaf.segment(state, j, i, state.n[j * n + i]);
        let [a, b] = [0, 1].map(|end| &shape[state.base(j) + i + end]);
        let (dx, a, b) = (shift(b) - shift(a), turn(a), turn(b));
        let force = segment.frame.transpose() * forces[j * n + i];
        let gap = segment.gap_increment(section, dx, a, b);
        sum += 2.0 * force.dot(gap) - section.ds * (section.compliance * force).dot(force);
        sum += turns(&segment, section, a, b);
    }
    for (j, i) in leaf
        .each(leaf.moving_nodes())
        .filter(|(j, _)| j + 1 < leaf.rods())
    {
        let [a, b] = [j, j + 1].map(|rod| shift(&shape[state.base(rod) + i]));
        sum += (b - a).dot(leaf.spring(j, i) * (b - a));
    }
    sum + leaf.tissue_curvature(state, shape)
}

/// The contribution of second derivatives with respect to rotations, at constant force.
fn turns(segment: &Segment, section: &Section, a: DVec3, b: DVec3) -> f64 {
    let k = at_constant_force(segment, section);
    a.dot(k.aa * a) + 2.0 * a.dot(k.ab * b) + b.dot(k.bb * b)
}
