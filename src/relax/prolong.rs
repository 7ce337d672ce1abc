//! From a grid to the one with all segments halved.

use crate::leaf::{DiscreteLeaf, State};
use glam::{DQuat, DVec3};

/// The state on the refined grid: nodes in common are kept, new ones lie on
/// cubic Hermite interpolants of position and quaternion. Forces are linear
/// between the middles of the segments.
pub fn prolong(leaf: &DiscreteLeaf, state: &State) -> State {
    let n = leaf.segments();
    let (mut x, mut q, mut forces) = (Vec::new(), Vec::new(), Vec::new());
    for j in 0..leaf.rods() {
        let force = |i: usize| state.n[j * n + i];
        let segment = |i: usize| leaf.segment(state, j, i, force(i));
        // Curvature, spatial and averaged over the two segments at a node.
        let mut curvature = vec![DVec3::ZERO; n + 1];
        for i in 0..n {
            let s = segment(i);
            let u = s.frame * s.u;
            let weight = |k: usize| if k == 0 || k == n { 1.0 } else { 0.5 };
            curvature[i] += weight(i) * u;
            curvature[i + 1] += weight(i + 1) * u;
        }
        let base = state.base(j);
        for i in 0..n {
            let (section, k) = (leaf.section(j, i), base + i);
            let tangent = |k: usize| {
                state.q[k] * (DVec3::X + section.compliance * (state.q[k].conjugate() * force(i)))
            };
            let middle = 0.5 * (state.x[k] + state.x[k + 1])
                + section.ds / 8.0 * (tangent(k) - tangent(k + 1));
            let (q0, q1) = (state.q[k], state.q[k + 1]);
            let q1 = if q0.dot(q1) < 0.0 { -q1 } else { q1 };
            // q' = u q / 2 with u spatial.
            let slope = |u: DVec3, q: DQuat| DQuat::from_xyzw(u.x, u.y, u.z, 0.0) * q * 0.5;
            let bend = (slope(curvature[i], q0) - slope(curvature[i + 1], q1)) * (section.ds / 8.0);
            let turned = ((q0 + q1) * 0.5 + bend).normalize();
            x.extend([state.x[k], middle]);
            q.extend([q0, turned]);
            let before = if i > 0 {
                force(i - 1)
            } else {
                2.0 * force(0) - force(1.min(n - 1))
            };
            let after = if i + 1 < n {
                force(i + 1)
            } else {
                2.0 * force(i) - force(i.saturating_sub(1))
            };
            let eighth = 0.125 * (after - before);
            forces.extend([force(i) - eighth, force(i) + eighth]);
        }
        x.push(state.x[base + n]);
        q.push(state.q[base + n]);
    }
    let mut fine = State::new(2 * n, x, q);
    fine.n = forces;
    fine
}
