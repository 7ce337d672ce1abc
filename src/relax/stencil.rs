//! Interpolation between the nodes of a grid.

use crate::leaf::DiscreteLeaf;
use glam::DVec3;

/// Largest number of nodes of a stencil.
const NODES: usize = 7;

/// Nodes of a grid with their weights in an interpolated value.
pub(crate) struct Stencil {
    first: usize,
    count: usize,
    weights: [f64; NODES],
    /// Derivatives of the weights with sigma.
    slopes: [f64; NODES],
}

impl Stencil {
    /// Of the polynomial through the nodes around a fraction of the length; linear
    /// extrapolation beyond the ends of the rod.
    pub fn new(leaf: &DiscreteLeaf, sigma: f64) -> Stencil {
        let (beyond, sigma) = (sigma - sigma.clamp(0.0, 1.0), sigma.clamp(0.0, 1.0));
        let nodes = leaf.grid.sigma();
        // A polynomial does not reach across a kink.
        let kinks = leaf.leaf.kinks();
        let panel = kinks.partition_point(|&kink| kink < sigma);
        let low = panel.checked_sub(1).map_or(0.0, |k| kinks[k]);
        let high = kinks.get(panel).copied().unwrap_or(1.0);
        // A node at a kink agrees with it up to rounding.
        let node = |kink: f64| nodes.partition_point(|&node| node < kink - 1e-12);
        let (low, high) = (node(low), node(high));
        let count = NODES.min(high - low + 1);
        let right = nodes.partition_point(|&node| node < sigma);
        let first = (right.saturating_sub(count / 2)).clamp(low, high + 1 - count);
        // Nodes of a panel are equally spaced.
        let width = nodes[first + 1] - nodes[first];
        let (mut weights, mut slopes) = lagrange(count, (sigma - nodes[first]) / width);
        for (weight, slope) in weights.iter_mut().zip(&mut slopes) {
            *slope /= width;
            *weight += beyond * *slope;
        }
        Stencil {
            first,
            count,
            weights,
            slopes,
        }
    }

    /// The interpolated value, of values at nodes numbered from 0.
    pub fn value(&self, at: impl Fn(usize) -> DVec3) -> DVec3 {
        self.sum(&self.weights, at)
    }

    /// Its derivative with respect to sigma.
    pub fn slope(&self, at: impl Fn(usize) -> DVec3) -> DVec3 {
        self.sum(&self.slopes, at)
    }

    fn sum(&self, weights: &[f64; NODES], at: impl Fn(usize) -> DVec3) -> DVec3 {
        let weights = weights[..self.count].iter().enumerate();
        weights
            .map(|(a, weight)| *weight * at(self.first + a))
            .sum()
    }
}

/// Weights of the polynomial through values at 0, 1, ..., `count` - 1 in its value at
/// `t`, and their derivatives: products from both ends, each with its derivative.
fn lagrange(count: usize, t: f64) -> ([f64; NODES], [f64; NODES]) {
    let (mut weights, mut slopes) = ([0.0; NODES], [0.0; NODES]);
    let mut left = (1.0, 0.0);
    let mut below = 1.0;
    for a in 0..count {
        (weights[a], slopes[a]) = left;
        // The denominator is a! (-1)^(count - 1 - a) (count - 1 - a)!.
        let factorial: f64 = (1..count - a).map(|k| -(k as f64)).product();
        below *= if a > 0 { a as f64 } else { 1.0 };
        weights[a] /= below * factorial;
        slopes[a] /= below * factorial;
        let step = t - a as f64;
        left = (left.0 * step, left.1 * step + left.0);
    }
    let mut right = (1.0, 0.0);
    for a in (0..count).rev() {
        let (weight, slope) = (weights[a], slopes[a]);
        weights[a] = weight * right.0;
        slopes[a] = slope * right.0 + weight * right.1;
        let step = t - a as f64;
        right = (right.0 * step, right.1 * step + right.0);
    }
    (weights, slopes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The weights reproduce value and derivative of polynomials up to their degree.
    #[test]
    fn polynomials_are_met() {
        for count in 2..=NODES {
            let t = 0.37 * count as f64;
            let (weights, slopes) = lagrange(count, t);
            for degree in 0..count as i32 {
                let term = |(a, weight): (usize, &f64)| weight * (a as f64).powi(degree);
                let sum = |weights: &[f64; NODES]| -> f64 {
                    weights[..count].iter().enumerate().map(term).sum()
                };
                let slope = match degree {
                    0 => 0.0,
                    _ => f64::from(degree) * t.powi(degree - 1),
                };
                let size = (count as f64).powi(degree);
                assert!((sum(&weights) - t.powi(degree)).abs() < 1e-13 * size);
                assert!((sum(&slopes) - slope).abs() < 1e-12 * size);
            }
        }
    }
}
