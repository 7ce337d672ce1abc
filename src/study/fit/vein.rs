//! A vein as a curve, for the nearest point to a traced one.

use glam::DVec3;

use super::view::{Seen, View};
use crate::relax::{NestedEquilibrium, Stencil};

/// Iterations for the nearest point between two nodes, and its accuracy.
const ITERATIONS: usize = 60;
const EXACT: f64 = 1e-10;

/// A vein at the nodes of its finest grid.
pub(super) struct Vein<'a> {
    at: &'a NestedEquilibrium,
    rod: usize,
    /// Fractions of the length, and positions in the scenario's units.
    nodes: Vec<(f64, DVec3)>,
}

impl<'a> Vein<'a> {
    pub fn of(at: &'a NestedEquilibrium, rod: usize) -> Self {
        let nodes = at.levels.last().map_or(Vec::new(), |level| {
            let (base, length) = (level.state.base(rod), level.leaf.leaf.scale.length);
            let sigma = level.leaf.grid.sigma().iter().enumerate();
            sigma
                .map(|(i, sigma)| (*sigma, level.state.x[base + i] * length))
                .collect()
        });
        Vein { at, rod, nodes }
    }

    /// The point at a fraction of the length, in the scenario's units, and its derivative
    /// with respect to the fraction. The vein is extended straight beyond its ends.
    pub fn point(&self, sigma: f64) -> (DVec3, DVec3) {
        let length = self.at.levels[0].leaf.leaf.scale.length;
        let (mut x, mut slope) = (DVec3::ZERO, DVec3::ZERO);
        for (level, weight) in self.at.levels.iter().zip(&self.at.weights) {
            if *weight != 0.0 {
                let [value, derivative] = <Stencil>::at(&level.leaf, sigma);
                let base = level.state.base(self.rod);
                let node = |i: usize| level.state.x[base + i];
                x += *weight * value.value(node);
                slope += *weight * derivative.value(node);
            }
        }
        (x * length, slope * length)
    }

    /// The fraction of the length nearest to a point with these measured coordinates,
    /// and the point there. The vein is extended straight beyond its ends: a traced
    /// point near an end is compared across the vein like all others, so that noise along
    /// it, half of which is beyond the end, does not lengthen the vein.
    pub fn nearest(&self, seen: &Seen, view: &View) -> (f64, DVec3) {
        let known = || {
            let known = seen.iter().enumerate();
            known.filter_map(|(coordinate, value)| Some((coordinate, (*value)?)))
        };
        let apart = |x: DVec3| known().map(move |(k, value)| (k, view.of(k, x) - value));
        let square = |node: &(f64, DVec3)| apart(node.1).map(|(_, it)| it * it).sum::<f64>();
        let order =
            |a: &usize, b: &usize| square(&self.nodes[*a]).total_cmp(&square(&self.nodes[*b]));
        let last = self.nodes.len().saturating_sub(1);
        let best = (0..=last).min_by(order).unwrap_or(0);
        let [low, high] =
            [best.saturating_sub(1), (best + 1).min(last)].map(|node| self.nodes[node].0);
        // The derivative of half the squared distance, and the point.
        let rate = |sigma: f64| {
            let (x, slope) = self.point(sigma);
            let (mut value, mut squared) = (0.0, 0.0);
            for (k, apart) in apart(x) {
                let slope = view.along(k, slope);
                value += slope * apart;
                squared += slope * slope;
            }
            (value, squared, x)
        };
        // Newton's method without the curvature, then the secant method; bisection where a step
        // leaves the bracket of the zero.
        let mut sigma = self.nodes[best].0;
        let (mut below, mut above) = (low, high);
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..ITERATIONS {
            let (value, squared, x) = rate(sigma);
            let step = match before {
                Some((other, at_other)) if (value - at_other) * (sigma - other) > 0.0 => {
                    -value * (sigma - other) / (value - at_other)
                }
                _ if squared > 0.0 => -value / squared,
                _ => 0.0,
            };
            if step.abs() < EXACT {
                return (sigma, x);
            }
            match value < 0.0 {
                true => below = sigma,
                false => above = sigma,
            }
            let next = sigma + step;
            let ends = [(0.0, below, next < low), (1.0, above, next > high)];
            let beyond = ends.iter().find(|(end, it, out)| *out && end == it);
            before = Some((sigma, value));
            sigma = match beyond {
                // On a straight extension, the first step is exact.
                Some((end, ..)) if sigma == *end => {
                    let beyond = end - value / squared;
                    return (beyond, self.point(beyond).0);
                }
                Some((end, ..)) => {
                    before = None;
                    *end
                }
                None if (below..=above).contains(&next) => next,
                None => 0.5 * (below + above),
            };
        }
        (sigma, self.point(sigma).0)
    }
}
