//! A vein as a curve, for the nearest point to a traced one.

use glam::DVec3;

use crate::relax::{AtRest, Stencil};

/// Iterations for the nearest point between two nodes, and its accuracy.
const ITERATIONS: usize = 60;
const EXACT: f64 = 1e-10;

/// A vein at the nodes of its finest grid.
pub(super) struct Vein<'a> {
    at: &'a AtRest,
    rod: usize,
    /// Fractions of the length, and positions in the scenario's units.
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
    pub fn nearest(&self, seen: [Option<f64>; 3]) -> (f64, DVec3) {
        let mask = DVec3::from_array(seen.map(|value| f64::from(u8::from(value.is_some()))));
        let seen = DVec3::from_array(seen.map(|value| value.unwrap_or(0.0)));
        let square = |node: &(f64, DVec3)| (mask * (node.1 - seen)).length_squared();
        let order =
            |a: &usize, b: &usize| square(&self.nodes[*a]).total_cmp(&square(&self.nodes[*b]));
        let last = self.nodes.len().saturating_sub(1);
        let best = (0..=last).min_by(order).unwrap_or(0);
        let [low, high] =
            [best.saturating_sub(1), (best + 1).min(last)].map(|node| self.nodes[node].0);
        // The derivative of half the squared distance, and the point.
        let rate = |sigma: f64| {
            let (x, slope) = self.point(sigma);
            let slope = mask * slope;
            (slope.dot(x - seen), slope.length_squared(), x)
        };
        // Newton's method without the curvature; then the secant method.
        let mut sigma = self.nodes[best].0;
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
            // On a straight extension, the first step is exact.
            let inside = (low..=high).contains(&(sigma + step));
            let [base, tip] = [
                low == 0.0 && sigma + step < low,
                high == 1.0 && sigma + step > high,
            ];
            if step.abs() < EXACT {
                return (sigma, x);
            }
            if !(inside || base || tip) || !step.is_finite() {
                break;
            }
            if base || tip {
                let end = if base { low } else { high };
                if sigma == end {
                    let beyond = end - value / squared;
                    return (beyond, self.point(beyond).0);
                }
                sigma = end;
                before = None;
                continue;
            }
            before = Some((sigma, value));
            sigma += step;
        }
        let found = self.bracketed(self.nodes[best].0, (low, high), &|sigma| {
            let (value, squared, _) = rate(sigma);
            (value, squared)
        });
        (found, self.point(found).0)
    }

    /// The same between two nodes next to the best, where the derivative changes its sign.
    fn bracketed(
        &self,
        best: f64,
        (mut low, mut high): (f64, f64),
        rate: &dyn Fn(f64) -> (f64, f64),
    ) -> f64 {
        let ends = [low, high].map(|end| (end, rate(end)));
        let [mut at_low, mut at_high] = ends.map(|(_, (value, _))| value);
        for ((end, (value, squared)), beyond) in ends.into_iter().zip([at_low > 0.0, at_high < 0.0])
        {
            if beyond && (end == 0.0 || end == 1.0) {
                return end - value / squared.max(f64::MIN_POSITIVE);
            }
        }
        let mut sigma = best;
        if at_low > 0.0 || at_high < 0.0 {
            return sigma;
        }
        // Regula falsi; the value at the retained end is halved (Illinois).
        for _ in 0..ITERATIONS {
            let middle = low + (high - low) * at_low / (at_low - at_high);
            if (middle - sigma).abs() < EXACT || !middle.is_finite() {
                break;
            }
            sigma = middle;
            let at_middle = rate(middle).0;
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
