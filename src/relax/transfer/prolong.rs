//! Prolongation to the grid with all segments halved or to any other, and restriction.

use crate::leaf::{DiscreteLeaf, Grid, State};
use crate::relax::transfer::stencil::Stencil;
use glam::{DQuat, DVec3};

/// The state on the refined grid: nodes in common are kept, new ones lie on cubic Hermite
/// interpolants of position and quaternion. Forces are interpolated linearly between the
/// midpoints of the segments.
pub fn prolong(leaf: &DiscreteLeaf, state: &State) -> State {
    let n = leaf.segments();
    let (mut x, mut q, mut forces) = (Vec::new(), Vec::new(), Vec::new());
    for j in 0..leaf.rods() {
        let force = |i: usize| state.n[j * n + i];
        // Spatial curvature and force at a node: from the adjacent segments, or extrapolated
        // from the two nearest to an end.
        let curved = |i: usize| {
            let segment = leaf.segment(state, j, i, force(i));
            segment.frame * segment.u
        };
        let curvatures: Vec<DVec3> = (0..n).map(curved).collect();
        let nodal = |value: &dyn Fn(usize) -> DVec3, i: usize| match i {
            _ if n == 1 => value(0),
            0 => 1.5 * value(0) - 0.5 * value(1),
            _ if i == n => 1.5 * value(n - 1) - 0.5 * value(n - 2),
            _ => 0.5 * (value(i - 1) + value(i)),
        };
        let curvature = |i: usize| nodal(&|i| curvatures[i], i);
        let base = state.base(j);
        for i in 0..n {
            let (section, k) = (leaf.section(j, i), base + i);
            let tangent = |i: usize| {
                let q = state.q[base + i];
                q * (section.rest_strain + section.compliance * (q.conjugate() * nodal(&force, i)))
            };
            let middle = 0.5 * (state.x[k] + state.x[k + 1])
                + section.ds / 8.0 * (tangent(i) - tangent(i + 1));
            let (q0, q1) = (state.q[k], state.q[k + 1]);
            let q1 = if q0.dot(q1) < 0.0 { -q1 } else { q1 };
            // q' = u q / 2 with u spatial.
            let slope = |u: DVec3, q: DQuat| DQuat::from_xyzw(u.x, u.y, u.z, 0.0) * q * 0.5;
            let bend = (slope(curvature(i), q0) - slope(curvature(i + 1), q1)) * (section.ds / 8.0);
            x.extend([state.x[k], middle]);
            q.extend([q0, ((q0 + q1) * 0.5 + bend).normalize()]);
            let before = match i {
                0 => 2.0 * force(0) - force(1.min(n - 1)),
                _ => force(i - 1),
            };
            let after = match i + 1 < n {
                true => force(i + 1),
                false => 2.0 * force(i) - force(i.saturating_sub(1)),
            };
            let eighth = 0.125 * (after - before);
            forces.extend([force(i) - eighth, force(i) + eighth]);
        }
        x.push(state.x[base + n]);
        q.push(state.q[base + n]);
    }
    let mut fine = State::new(2 * n, x, q);
    fine.n = forces;
    fine.tissue = (state.tissue.chunks(n + 1)).flat_map(halved).collect();
    fine
}

/// Values at nodes, and between them: cubic, at the ends quadratic.
fn halved(at: &[DVec3]) -> Vec<DVec3> {
    let n = at.len() - 1;
    let between = |i: usize| match i {
        _ if n < 3 => 0.5 * (at[i] + at[i + 1]),
        0 => 0.375 * at[0] + 0.75 * at[1] - 0.125 * at[2],
        _ if i + 1 == n => 0.375 * at[n] + 0.75 * at[n - 1] - 0.125 * at[n - 2],
        _ => 0.5625 * (at[i] + at[i + 1]) - 0.0625 * (at[i - 1] + at[i + 2]),
    };
    let pairs = (0..n).flat_map(|i| [at[i], between(i)]);
    pairs.chain([at[n]]).collect()
}

/// The state on any other grid, interpolated: positions and quaternions by polynomials through
/// nodes nearby, forces linearly between the midpoints of the segments.
pub fn transfer(leaf: &DiscreteLeaf, state: &State, grid: &Grid) -> State {
    if *grid == leaf.grid {
        return state.clone();
    }
    let n = leaf.segments();
    let stencils: Vec<Stencil> = (grid.sigma().iter())
        .map(|sigma| {
            let [value, _] = Stencil::at(leaf, *sigma);
            value
        })
        .collect();
    let middle = |i: usize| {
        let i = i.min(n - 1);
        leaf.grid.middle(i)
    };
    // The segment whose middle is before a place, and the weight of the next.
    let between = |sigma: f64| {
        let before = (0..n)
            .take_while(|i| middle(*i) <= sigma)
            .count()
            .saturating_sub(1);
        let next = (before + 1).min(n - 1);
        let width = middle(next) - middle(before);
        let weight = if width > 0.0 {
            (sigma - middle(before)) / width
        } else {
            0.0
        };
        (before, next, weight.clamp(0.0, 1.0))
    };
    let places: Vec<_> = (0..grid.segments())
        .map(|i| between(grid.middle(i)))
        .collect();
    let (mut x, mut q, mut forces) = (Vec::new(), Vec::new(), Vec::new());
    for j in 0..leaf.rods() {
        let base = state.base(j);
        for stencil in &stencils {
            let first = state.q[base + stencil.first];
            let mut sum = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
            for (i, weight) in stencil.terms() {
                let q = state.q[base + i];
                sum += if q.dot(first) < 0.0 { -q } else { q } * weight;
            }
            x.push(stencil.value(|i| state.x[base + i]));
            q.push(sum.normalize());
        }
        for &(before, next, weight) in &places {
            let [a, b] = [before, next].map(|i| state.n[j * n + i]);
            forces.push(a.lerp(b, weight));
        }
    }
    let mut other = State::new(grid.segments(), x, q);
    other.n = forces;
    let gaps = state.tissue.chunks(n + 1);
    let nodes = gaps.flat_map(|gap| stencils.iter().map(|stencil| stencil.value(|i| gap[i])));
    other.tissue = nodes.collect();
    // Ends are exact.
    for j in 0..leaf.rods() {
        let (from, to) = (state.base(j), other.base(j));
        for (a, b) in [(from, to), (from + n, to + grid.segments())] {
            (other.x[b], other.q[b]) = (state.x[a], state.q[a]);
        }
    }
    other
}

/// The state on the next coarser grid: forces are means over the two halves of a segment.
pub fn restrict(fine: &State) -> State {
    let (mut x, mut q) = (Vec::new(), Vec::new());
    for j in 0..fine.rods() {
        let nodes = (0..=fine.segments()).step_by(2).map(|i| fine.base(j) + i);
        x.extend(nodes.clone().map(|k| fine.x[k]));
        q.extend(nodes.map(|k| fine.q[k]));
    }
    let mut coarse = State::new(fine.segments() / 2, x, q);
    coarse.n = fine.n.chunks(2).map(|n| 0.5 * (n[0] + n[1])).collect();
    let gaps = fine.tissue.chunks(fine.segments() + 1);
    coarse.tissue = gaps
        .flat_map(|gap| gap.iter().step_by(2))
        .copied()
        .collect();
    coarse
}
