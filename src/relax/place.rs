//! Places between the stations where fields along a vein are known.

use crate::shape::weights;

/// Most nodes that a polynomial goes through whose slopes there are known.
const HERMITE: usize = 4;

/// Most nodes of one whose slopes are not known.
const LAGRANGE: usize = 6;

/// A place along the veins, and the stations around it.
pub struct Place {
    /// The station that it is.
    pub node: Option<usize>,
    pub at: f64,
    /// Stations between the same knots, and the first of them.
    near: Vec<f64>,
    first: usize,
}

/// Weights of the values at stations.
pub type Values = Vec<(usize, f64)>;

/// Weights of a value and of its slope at a station.
pub type Slopes = Vec<(usize, f64, f64)>;

impl Place {
    /// `at` between the stations `known`, with kinks of profiles at `kinks`.
    pub fn new(known: &[f64], kinks: &[f64], at: f64) -> Self {
        let node = known
            .iter()
            .position(|station| (station - at).abs() < 1e-14);
        let right = kinks.partition_point(|kink| *kink <= at);
        let left = right.checked_sub(1).map_or(0.0, |left| kinks[left]);
        let right = kinks.get(right).copied().unwrap_or(1.0);
        let first = known.partition_point(|station| *station < left - 1e-14);
        let last = known.partition_point(|station| *station <= right + 1e-14);
        let near = known[first..last].to_vec();
        Place {
            node,
            at,
            near,
            first,
        }
    }

    /// The polynomial with the values and slopes at the nearest stations, so many
    /// fewer than can be.
    pub fn hermite(&self, fewer: usize) -> Slopes {
        let count = HERMITE.min(self.near.len()).saturating_sub(fewer).max(1);
        let (first, lagrange) = weights(&self.near, self.at, count);
        let near = &self.near[first..first + count];
        let each = lagrange.iter().enumerate().map(|(i, weight)| {
            let others = (0..count).filter(|&j| j != i);
            let slope: f64 = others.map(|j| 1.0 / (near[i] - near[j])).sum();
            let (away, squared) = (self.at - near[i], weight * weight);
            let value = squared * (1.0 - 2.0 * slope * away);
            (self.first + first + i, value, squared * away)
        });
        each.collect()
    }

    /// The polynomial with the values at the nearest stations.
    pub fn lagrange(&self) -> Values {
        let (first, weights) = weights(&self.near, self.at, LAGRANGE);
        (self.first + first..).zip(weights).collect()
    }

    /// The polynomial with the values at the nearest other stations, and that with
    /// those of two fewer.
    pub fn others(&self) -> [Values; 2] {
        let mut near = self.near.clone();
        let own = near.iter().position(|at| *at == self.at);
        own.map(|own| near.remove(own));
        [LAGRANGE, LAGRANGE - 2].map(|count| {
            let (first, weights) = weights(&near, self.at, count);
            let station = |i: usize| self.first + i + usize::from(own.is_some_and(|own| i >= own));
            (first..).map(station).zip(weights).collect()
        })
    }
}

/// What a polynomial may be wrong by, from a measure of that and the same of one of
/// lower order.
pub fn error([best, second]: [f64; 2]) -> f64 {
    match second > best {
        true => best * (best / second),
        false => best,
    }
}
