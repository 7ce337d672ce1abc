//! Interpolation of fields along a vein between the stations where they are known.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::shape::weights;

/// Largest number of nodes of a Hermite polynomial.
const HERMITE: usize = 4;

/// Each further station reduces the error by a factor that is smaller than that of the one
/// before by this, at least.
const LEAST_GAIN: f64 = 4.0;

/// Largest number of nodes of a Lagrange polynomial.
const LAGRANGE: usize = 6;

/// A point along the veins, and the stations around it.
pub struct Place {
    /// The station at this point, if there is one.
    pub node: Option<usize>,
    pub at: f64,
    /// Stations between the same knots.
    near: Vec<f64>,
    /// Index of the first of them.
    first: usize,
}

/// Stations with the weights of the value and of the slope there.
pub type Slopes = Vec<(usize, f64, f64)>;

impl Place {
    /// The point `at` among the stations `known`, with kinks of profiles at `kinks`.
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

    /// The Hermite polynomial through values and slopes at the nearest stations, `fewer` than are
    /// possible, and the monic polynomial that vanishes there together with its slope.
    pub fn hermite(&self, fewer: usize) -> (Slopes, f64) {
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
        let vanishing = near.iter().map(|node| (self.at - node).powi(2)).product();
        (each.collect(), vanishing)
    }

    /// The Lagrange polynomial through the nearest stations.
    pub fn lagrange(&self) -> Slopes {
        let (first, weights) = weights(&self.near, self.at, LAGRANGE);
        let stations = (self.first + first..).zip(weights);
        stations.map(|(i, weight)| (i, weight, 0.0)).collect()
    }
}

/// Error estimate of Hermite polynomials between two knots of a rod: their difference from
/// those through one station less, times the reduction by one more station. Both follow from
/// the differences of three of them, as largest coefficients of the polynomials that vanish at
/// their stations.
#[derive(Default)]
pub struct Differences {
    /// Keyed by the first station between two knots.
    panels: BTreeMap<usize, Panel>,
}

#[derive(Default)]
struct Panel {
    /// Largest coefficients of the difference of the second and third polynomial, and of
    /// the first and second.
    coefficients: [f64; 2],
    /// Values, at every point, of the polynomials that vanish at the stations of the second,
    /// and of the first.
    vanishing: Vec<[f64; 2]>,
}

impl Differences {
    /// Adds the differences at a point, of values interpolated with the given weights.
    pub fn add(&mut self, place: &Place, value: impl Fn(&Slopes) -> DVec3) {
        let panel = self.panels.entry(place.first).or_default();
        let interpolated = |fewer| {
            let (weights, vanishing) = place.hermite(fewer);
            (value(&weights), vanishing)
        };
        let [
            (best, first_vanishes),
            (second, second_vanishes),
            (third, third_vanishes),
        ] = [0, 1, 2].map(interpolated);
        let coefficients = [
            (second - third).length() / third_vanishes,
            (best - second).length() / second_vanishes,
        ];
        let largest = panel.coefficients.iter_mut().zip(coefficients);
        largest.for_each(|(largest, it)| *largest = largest.max(it));
        (panel.vanishing).push([second_vanishes, first_vanishes]);
    }

    /// The largest error.
    pub fn error(&self) -> f64 {
        let errors = self.panels.values().flat_map(|panel| {
            let [before, last] = panel.coefficients;
            (panel.vanishing.iter()).map(move |[second, first]| {
                // Without a third polynomial the reduction is not known.
                let reduction = LEAST_GAIN * last * first / (before * second);
                last * second * if reduction < 1.0 { reduction } else { 1.0 }
            })
        });
        errors.fold(0.0, f64::max)
    }
}
