//! Polynomials through the nodes of a grid that are nearest to a point.

use crate::leaf::DiscreteLeaf;
use glam::DVec3;

/// Largest number of nodes of a polynomial along a rod.
const NODES: usize = 7;

/// Adjacent points with their weights in a value that is interpolated between them, or in its
/// derivative.
pub(crate) struct Stencil<const MOST: usize = NODES> {
    pub first: usize,
    count: usize,
    weights: [f64; MOST],
}

impl<const MOST: usize> Stencil<MOST> {
    /// Of the value at `place` among `points` equally spaced points, of which `first` is the
    /// first: through at most `MOST` of the nearest of them.
    pub fn new(first: usize, points: usize, place: f64) -> Self {
        let count = MOST.min(points);
        let centred = (place - 0.5 * (count - 1) as f64).round().max(0.0);
        let skipped = (centred as usize).min(points - count);
        let mut weights = [0.0; MOST];
        for (a, weight) in weights[..count].iter_mut().enumerate() {
            *weight = lagrange(count, a, place - skipped as f64).0;
        }
        Stencil {
            first: first + skipped,
            count,
            weights,
        }
    }

    /// Points and their weights.
    pub fn terms(&self) -> impl Iterator<Item = (usize, f64)> {
        (self.first..).zip(self.weights[..self.count].iter().copied())
    }

    /// The interpolated value, or its derivative.
    pub fn value(&self, at: impl Fn(usize) -> DVec3) -> DVec3 {
        self.terms().map(|(i, weight)| weight * at(i)).sum()
    }

    /// Of the value at a fraction of the length, and of its derivative with sigma, of values at
    /// nodes numbered from 0; linear extrapolation beyond the ends of the rod.
    pub fn at(leaf: &DiscreteLeaf, sigma: f64) -> [Self; 2] {
        let (beyond, sigma) = (sigma - sigma.clamp(0.0, 1.0), sigma.clamp(0.0, 1.0));
        let nodes = leaf.grid.sigma();
        // A polynomial does not reach across a kink.
        let kinks = leaf.leaf.kinks();
        let panel = kinks.partition_point(|&kink| kink < sigma);
        let low = panel.checked_sub(1).map_or(0.0, |k| kinks[k]);
        let high = kinks.get(panel).copied().unwrap_or(1.0);
        // A node at a kink agrees with it up to rounding.
        let [low, high] = [low, high].map(|at| nodes.partition_point(|&node| node < at - 1e-12));
        let count = MOST.min(high - low + 1);
        let right = nodes.partition_point(|&node| node < sigma);
        let first = (right.saturating_sub(count / 2)).clamp(low, high + 1 - count);
        // Nodes of a panel are equally spaced.
        let width = nodes[first + 1] - nodes[first];
        let place = (sigma - nodes[first]) / width;
        let (mut weights, mut slopes) = ([0.0; MOST], [0.0; MOST]);
        for (a, (weight, slope)) in weights.iter_mut().zip(&mut slopes).take(count).enumerate() {
            (*weight, *slope) = lagrange(count, a, place);
            *slope /= width;
            *weight += beyond * *slope;
        }
        [weights, slopes].map(|weights| Stencil {
            first,
            count,
            weights,
        })
    }
}

/// Weight of the value at point `a` of 0, 1, ..., `count` - 1 in the value at `t` of the
/// polynomial through all of them, and its derivative with `t`.
fn lagrange(count: usize, a: usize, t: f64) -> (f64, f64) {
    let others = (0..count).filter(|&b| b != a);
    others.fold((1.0, 0.0), |(weight, slope), b| {
        let apart = a as f64 - b as f64;
        let factor = (t - b as f64) / apart;
        (weight * factor, slope * factor + weight / apart)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The weights reproduce value and derivative of polynomials up to their degree.
    #[test]
    fn polynomials_are_met() {
        for count in 2..=NODES {
            let t = 0.37 * count as f64;
            for degree in 0..count as i32 {
                let term = |a: usize| {
                    let (weight, slope) = lagrange(count, a, t);
                    let value = (a as f64).powi(degree);
                    (weight * value, slope * value)
                };
                let (weights, slopes): (Vec<f64>, Vec<f64>) = (0..count).map(term).unzip();
                let slope = match degree {
                    0 => 0.0,
                    _ => f64::from(degree) * t.powi(degree - 1),
                };
                let size = (count as f64).powi(degree);
                assert!((weights.iter().sum::<f64>() - t.powi(degree)).abs() < 1e-13 * size);
                assert!((slopes.iter().sum::<f64>() - slope).abs() < 1e-12 * size);
            }
        }
    }
}
