//! Places between the stations where fields along a vein are known.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::shape::weights;

/// Most nodes that a polynomial goes through whose slopes there are known.
const HERMITE: usize = 4;

/// One more station gains so many times less than the one before it did, at least.
const GAIN: f64 = 4.0;

/// Most nodes of one whose slopes are not known.
const LAGRANGE: usize = 6;

/// A place along the veins, and the stations around it.
pub struct Place {
    /// The station that it is.
    pub node: Option<usize>,
    pub at: f64,
    /// Stations between the same knots.
    near: Vec<f64>,
    /// The first of them.
    pub first: usize,
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

    /// The polynomial with the values and slopes at the nearest stations, as many as can
    /// be.
    pub fn hermite(&self) -> Slopes {
        self.fewer(0)
    }

    /// How many stations that of so many fewer goes through.
    fn count(&self, fewer: usize) -> usize {
        HERMITE.min(self.near.len()).saturating_sub(fewer).max(1)
    }

    /// That which vanishes there with its slope, and the highest power of which has
    /// the coefficient one.
    fn vanishing(&self, fewer: usize) -> f64 {
        let count = self.count(fewer);
        let (first, _) = weights(&self.near, self.at, count);
        let near = &self.near[first..first + count];
        near.iter().map(|node| (self.at - node).powi(2)).product()
    }

    /// The polynomial through so many fewer.
    fn fewer(&self, fewer: usize) -> Slopes {
        let count = self.count(fewer);
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

/// What polynomials with values and slopes may be wrong by between the same knots of a
/// rod: as much as they differ from those through one station less, times what one more
/// station gains. Both are taken from the differences of three of them, largest
/// coefficients of what vanishes at their stations.
#[derive(Default)]
pub struct Differences {
    /// By the first station between those knots.
    panels: BTreeMap<usize, Panel>,
}

#[derive(Default)]
struct Panel {
    /// Largest coefficients of the difference of the second and third polynomial, and of
    /// the first and second.
    coefficients: [f64; 2],
    /// What vanishes at the stations of the second, and of the first, at every place.
    vanishing: Vec<[f64; 2]>,
}

impl Differences {
    /// Adds those at a place, of values interpolated with weights.
    pub fn add(&mut self, place: &Place, value: impl Fn(&Slopes) -> DVec3) {
        let panel = self.panels.entry(place.first).or_default();
        let [best, second, third] = [0, 1, 2].map(|fewer| value(&place.fewer(fewer)));
        let [first_vanishes, second_vanishes, third_vanishes] =
            [0, 1, 2].map(|fewer| place.vanishing(fewer));
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
                // Without a third polynomial nothing is known of the gain.
                let gain = GAIN * last * first / (before * second);
                last * second * if gain < 1.0 { gain } else { 1.0 }
            })
        });
        errors.fold(0.0, f64::max)
    }
}

/// Largest measures of what polynomials between the same knots may be wrong by, and the
/// same of those of lower order: between other knots the order may be another.
pub struct Measures(Vec<[f64; 2]>);

impl Measures {
    /// Of none yet, of so many stations.
    pub fn new(stations: usize) -> Self {
        Measures(vec![[0.0; 2]; stations])
    }

    /// Adds those at a place between the knots whose first station is `first`.
    pub fn add(&mut self, first: usize, measures: [f64; 2]) {
        let largest = self.0[first].iter_mut().zip(measures);
        largest.for_each(|(largest, measure)| *largest = largest.max(measure));
    }

    /// What the polynomials may be wrong by, no less than `part` of the measures.
    pub fn error(&self, part: f64) -> f64 {
        let error = |&[best, second]: &[f64; 2]| match second > best {
            true => best * (best / second).max(part),
            false => best,
        };
        self.0.iter().map(error).fold(0.0, f64::max)
    }
}
