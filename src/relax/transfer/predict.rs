//! Prediction of the leaf at rest on a finer grid from those on nested coarser grids.

use crate::leaf::{Grid, State};
use crate::relax::transfer::level::Level;
use crate::relax::transfer::stencil::Stencil;
use crate::rotation;
use glam::DQuat;

/// Segments of a panel from which on such polynomials are better than cubic Hermite
/// interpolants.
const SEGMENTS: usize = 4;

/// Predicts the state on the finest grid refined: the polynomial in ds^2 through the states on
/// nested `levels`, from coarse to fine. Interpolation along the panels between kinks is
/// polynomial as well; in panels of few segments the finest grid contributes `state`, its
/// prolongation.
pub fn predict(levels: &[&Level], state: &mut State) {
    let [coarser @ .., finest] = levels else {
        return;
    };
    let first = &levels[0].leaf;
    let edges = edges(&first.grid, first.leaf.kinks());
    let panel = |ends: &[usize]| Panel {
        first: ends[0],
        last: ends[1],
        coarsest: first.segments(),
        known: usize::from(ends[0] > 0 || !first.leaf.hinged()),
    };
    let panels: Vec<Panel> = edges.windows(2).map(panel).collect();
    for panel in &panels {
        if panel.count(&finest.state) >= SEGMENTS {
            panel.interpolate(&finest.state, state);
        }
    }
    let segments: Vec<usize> = levels.iter().map(|it| it.leaf.segments()).collect();
    for (level, weight) in coarser
        .iter()
        .zip(weights(&segments, state.segments() as f64))
    {
        for panel in &panels {
            panel.add_change(weight, &level.state, &finest.state, state);
        }
    }
}

/// Weights of values on grids of the given segments in the value on another or, with infinitely
/// many segments, in their limit, by the polynomial in ds^2 through all of them.
pub fn weights(segments: &[usize], target: f64) -> Vec<f64> {
    let target = target.powi(-2);
    let square = |segments: usize| (segments as f64).powi(-2);
    let weight = |own: &usize| {
        let others = segments.iter().filter(|other| *other != own);
        let parts = others.map(|it| (target - square(*it)) / (square(*own) - square(*it)));
        parts.product()
    };
    segments.iter().map(weight).collect()
}

/// Nodes of a grid at its ends and kinks.
fn edges(grid: &Grid, kinks: &[f64]) -> Vec<usize> {
    let node = |kink: &f64| grid.sigma().partition_point(|at| *at < kink - 1e-12);
    let inner = kinks.iter().map(node);
    [0].into_iter()
        .chain(inner)
        .chain([grid.segments()])
        .collect()
}

/// The part of the rods between two kinks: from node `first` to node `last` of the coarsest
/// grid, which has `coarsest` segments.
struct Panel {
    first: usize,
    last: usize,
    coarsest: usize,
    /// Whether its first node is known: a clamped base, or the last of the panel before.
    known: usize,
}

impl Panel {
    /// Its first node or segment on the grid of a state.
    fn first(&self, state: &State) -> usize {
        self.first * state.segments() / self.coarsest
    }

    /// Its segments there.
    fn count(&self, state: &State) -> usize {
        (self.last - self.first) * state.segments() / self.coarsest
    }

    /// Interpolation from its nodes on one grid to those on another.
    fn nodes(&self, from: &State, to: &State) -> Vec<Stencil> {
        let (have, want) = (self.count(from), self.count(to));
        let place = |k: usize| (k * have) as f64 / want as f64;
        let through = |k: usize| Stencil::new(self.first(from), have + 1, place(k));
        (0..=want).map(through).collect()
    }

    /// The same for midpoints of segments.
    fn middles(&self, from: &State, to: &State) -> Vec<Stencil> {
        let (have, want) = (self.count(from), self.count(to));
        let place = |i: usize| (i as f64 + 0.5) * have as f64 / want as f64 - 0.5;
        let through = |i: usize| Stencil::new(self.first(from), have, place(i));
        (0..want).map(through).collect()
    }

    /// Interpolates the state on one grid to another.
    fn interpolate(&self, from: &State, to: &mut State) {
        let (nodes, middles) = (self.nodes(from, to), self.middles(from, to));
        for j in 0..from.rods() {
            let base = from.base(j);
            let first = to.base(j) + self.first(to);
            for (k, node) in nodes.iter().enumerate() {
                // Neighbours differ by less than half a turn; more distant nodes may not.
                let mut before = from.q[base + node.first];
                let mut sum = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
                for (i, weight) in node.terms() {
                    let q = from.q[base + i];
                    before = if q.dot(before) < 0.0 { -q } else { q };
                    sum += before * weight;
                }
                to.x[first + k] = node.value(|i| from.x[base + i]);
                to.q[first + k] = sum.normalize();
            }
            let base = j * from.segments();
            let first = j * to.segments() + self.first(to);
            for (i, middle) in middles.iter().enumerate() {
                to.n[first + i] = middle.value(|i| from.n[base + i]);
            }
        }
        if !to.tissue.is_empty() {
            for g in 0..from.tissue.len() / (from.segments() + 1) {
                let (base, first) = (from.base(g), to.base(g) + self.first(to));
                for (k, node) in nodes.iter().enumerate() {
                    to.tissue[first + k] = node.value(|i| from.tissue[base + i]);
                }
            }
        }
    }

    /// Adds `weight` times the change from the state on the `fine` grid to that on
    /// the `coarse` one.
    fn add_change(&self, weight: f64, coarse: &State, fine: &State, to: &mut State) {
        let (nodes, middles) = (self.nodes(coarse, to), self.middles(coarse, to));
        let on_coarse = self.middles(fine, coarse);
        let (start, count) = (self.first(coarse), self.count(coarse));
        let stride = fine.segments() / coarse.segments();
        for j in 0..coarse.rods() {
            let change = |i: usize| {
                let (a, b) = (coarse.base(j) + i, fine.base(j) + stride * i);
                let turn = rotation::log(coarse.q[a] * fine.q[b].conjugate());
                (weight * (coarse.x[a] - fine.x[b]), weight * turn)
            };
            let changes: Vec<_> = (start..=start + count).map(change).collect();
            let first = to.base(j) + self.first(to);
            for (k, node) in nodes.iter().enumerate().skip(self.known) {
                let turn = node.value(|i| changes[i - start].1);
                to.x[first + k] += node.value(|i| changes[i - start].0);
                to.q[first + k] = (rotation::exp(turn) * to.q[first + k]).normalize();
            }
            let [base, fine_base] = [coarse, fine].map(|state| j * state.segments());
            let change = |i: usize| {
                let known = on_coarse[i - start].value(|i| fine.n[fine_base + i]);
                weight * (coarse.n[base + i] - known)
            };
            let changes: Vec<_> = (start..start + count).map(change).collect();
            let first = j * to.segments() + self.first(to);
            for (i, middle) in middles.iter().enumerate() {
                to.n[first + i] += middle.value(|i| changes[i - start]);
            }
        }
        if [coarse, fine, to]
            .iter()
            .any(|state| state.tissue.is_empty())
        {
            return;
        }
        for g in 0..coarse.tissue.len() / (coarse.segments() + 1) {
            let change = |i: usize| {
                let (a, b) = (coarse.base(g) + i, fine.base(g) + stride * i);
                weight * (coarse.tissue[a] - fine.tissue[b])
            };
            let changes: Vec<_> = (start..=start + count).map(change).collect();
            let first = to.base(g) + self.first(to);
            let skipped = usize::from(self.first > 0);
            for (k, node) in nodes.iter().enumerate().skip(skipped) {
                to.tissue[first + k] += node.value(|i| changes[i - start]);
            }
        }
    }
}
