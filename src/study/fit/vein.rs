//! A vein as a curve on which the nearest point to a traced one is looked for.

use glam::DVec3;

use crate::relax::AtRest;

/// Iterations to the nearest point between two nodes, and how exactly it is found.
const ITERATIONS: usize = 60;
const EXACT: f64 = 1e-13;

/// A vein at the nodes of its finest grid.
pub(super) struct Vein<'a> {
    at: &'a AtRest,
    rod: usize,
    /// Fractions of the length, and places in the scenario's units.
    nodes: Vec<(f64, DVec3)>,
}

impl<'a> Vein<'a> {
    pub fn of(at: &'a AtRest, rod: usize) -> Self {
        let nodes = at.levels.last().map_or(Vec::new(), |level| {
            let (base, length) = (level.state.base(rod), level.leaf.leaf.scale.length);
            let sigma = level.leaf.grid.sigma().iter().enumerate();
            sigma
                .map(|(i, sigma)| (*sigma, level.state.x[base + i] * length))
                .collect()
        });
        Vein { at, rod, nodes }
    }

    /// The point at a fraction of the length, in the scenario's units. Beyond its ends
    /// the vein goes on straight.
    pub fn at(&self, sigma: f64) -> DVec3 {
        self.point(sigma).0
    }

    /// The point and its derivative with the fraction.
    fn point(&self, sigma: f64) -> (DVec3, DVec3) {
        let stencils = self.at.stencils(sigma);
        let length = self.at.levels[0].leaf.leaf.scale.length;
        let x = self.at.best(|k, level| {
            let base = level.state.base(self.rod);
            stencils[k].value(|i| level.state.x[base + i])
        });
        let slope = self.at.best(|k, level| {
            let base = level.state.base(self.rod);
            stencils[k].slope(|i| level.state.x[base + i])
        });
        (x * length, slope * length)
    }

    /// The fraction of the length nearest to a point of which these coordinates were
    /// seen. The vein goes on straight beyond its ends: a traced point beside them is
    /// compared across the vein like all others, so that noise along it, of which half
    /// is beyond the end, does not lengthen the vein.
    pub fn nearest(&self, seen: [Option<f64>; 3]) -> f64 {
        let mask = DVec3::from_array(seen.map(|value| f64::from(u8::from(value.is_some()))));
        let seen = DVec3::from_array(seen.map(|value| value.unwrap_or(0.0)));
        let square = |node: &(f64, DVec3)| (mask * (node.1 - seen)).length_squared();
        let order =
            |a: &usize, b: &usize| square(&self.nodes[*a]).total_cmp(&square(&self.nodes[*b]));
        let last = self.nodes.len().saturating_sub(1);
        let best = (0..=last).min_by(order).unwrap_or(0);
        // The derivative of half the squared distance.
        let rate = |sigma: f64| {
            let (x, slope) = self.point(sigma);
            (mask * (x - seen)).dot(slope)
        };
        let [mut low, mut high] =
            [best.saturating_sub(1), (best + 1).min(last)].map(|node| self.nodes[node].0);
        let [mut at_low, mut at_high] = [low, high].map(rate);
        for (end, rate, beyond) in [(low, at_low, at_low > 0.0), (high, at_high, at_high < 0.0)] {
            if beyond && (end == 0.0 || end == 1.0) {
                let slope = (mask * self.point(end).1).length_squared();
                return match slope > 0.0 {
                    true => end - rate / slope,
                    false => end,
                };
            }
        }
        if at_low > 0.0 || at_high < 0.0 {
            return self.nodes[best].0;
        }
        // The rule of false position; the end that stays counts half (Illinois).
        let mut sigma = self.nodes[best].0;
        for _ in 0..ITERATIONS {
            let middle = low + (high - low) * at_low / (at_low - at_high);
            if (middle - sigma).abs() < EXACT || !middle.is_finite() {
                break;
            }
            sigma = middle;
            let at_middle = rate(middle);
            if at_middle == 0.0 {
                break;
            }
            if at_middle < 0.0 {
                (low, at_low) = (middle, at_middle);
                at_high *= 0.5;
            } else {
                (high, at_high) = (middle, at_middle);
                at_low *= 0.5;
            }
        }
        sigma
    }
}
