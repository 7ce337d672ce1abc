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
pub struct Place<'s> {
    /// The station at this point, if there is one.
    pub node: Option<usize>,
    pub at: f64,
    /// Stations between the same knots.
    near: &'s [f64],
    /// Index of the first of them.
    pub first: usize,
}

/// Stations with the weights of the values there.
pub type Values = Vec<(usize, f64)>;

/// Stations with the weights of the value and of the slope there.
pub type Slopes = Vec<(usize, f64, f64)>;

/// Stations closer than this are one.
const SAME: f64 = 1e-14;

impl<'s> Place<'s> {
    /// The point `at` among the stations `known`, with kinks of profiles at `kinks`.
    pub fn new(known: &'s [f64], kinks: &[f64], at: f64) -> Self {
        let node = known.partition_point(|station| at - station >= SAME);
        let node = (node < known.len() && known[node] - at < SAME).then_some(node);
        let right = kinks.partition_point(|kink| *kink <= at);
        let left = right.checked_sub(1).map_or(0.0, |left| kinks[left]);
        let right = kinks.get(right).copied().unwrap_or(1.0);
        let first = known.partition_point(|station| *station < left - SAME);
        let last = known.partition_point(|station| *station <= right + SAME);
        let near = &known[first..last];
        Place {
            node,
            at,
            near,
            first,
        }
    }

    /// The Hermite polynomial through values and slopes at the nearest stations, as many as
    /// possible.
    pub fn hermite(&self) -> Slopes {
        self.reduced_hermite(0)
    }

    /// The number of stations of the Hermite polynomial with `fewer` stations less.
    fn count(&self, fewer: usize) -> usize {
        HERMITE.min(self.near.len()).saturating_sub(fewer).max(1)
    }

    /// The monic polynomial that vanishes at these stations together with its slope.
    fn node_polynomial(&self, fewer: usize) -> f64 {
        let count = self.count(fewer);
        let (first, _) = weights(self.near, self.at, count);
        let near = &self.near[first..first + count];
        near.iter().map(|node| (self.at - node).powi(2)).product()
    }

    /// The Hermite polynomial through `fewer` stations less.
    fn reduced_hermite(&self, fewer: usize) -> Slopes {
        let count = self.count(fewer);
        let (first, lagrange) = weights(self.near, self.at, count);
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

    /// The Lagrange polynomial through the nearest stations.
    pub fn lagrange(&self) -> Values {
        let (first, weights) = weights(self.near, self.at, LAGRANGE);
        (self.first + first..).zip(weights).collect()
    }

    /// The Lagrange polynomial through the nearest stations other than this one, and that of
    /// two fewer.
    pub fn leave_one_out(&self) -> [Values; 2] {
        let mut near = self.near.to_vec();
        let own = near.iter().position(|at| *at == self.at);
        own.map(|own| near.remove(own));
        [LAGRANGE, LAGRANGE - 2].map(|count| {
            let (first, weights) = weights(&near, self.at, count);
            let station = |i: usize| self.first + i + usize::from(own.is_some_and(|own| i >= own));
            (first..).map(station).zip(weights).collect()
        })
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
        let [best, second, third] = [0, 1, 2].map(|fewer| value(&place.reduced_hermite(fewer)));
        let [first_vanishes, second_vanishes, third_vanishes] =
            [0, 1, 2].map(|fewer| place.node_polynomial(fewer));
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

/// Largest error measures of the polynomials between two knots, and of those of lower order,
/// kept knot by knot since the order may differ.
pub struct ErrorMeasures(Vec<[f64; 2]>);

impl ErrorMeasures {
    /// Zero, for a number of stations.
    pub fn new(stations: usize) -> Self {
        ErrorMeasures(vec![[0.0; 2]; stations])
    }

    /// Adds the measures at a point between the knots whose first station is `first`.
    pub fn add(&mut self, first: usize, measures: [f64; 2]) {
        let largest = self.0[first].iter_mut().zip(measures);
        largest.for_each(|(largest, measure)| *largest = largest.max(measure));
    }

    /// The error estimate of the polynomials, no less than `part` of the measures.
    pub fn error(&self, part: f64) -> f64 {
        let error = |&[best, second]: &[f64; 2]| match second > best {
            true => best * (best / second).max(part),
            false => best,
        };
        self.0.iter().map(error).fold(0.0, f64::max)
    }
}
