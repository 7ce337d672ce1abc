//! Other values from which a search may begin: in decades around given ones, near them, and those
//! that exchange or mirror what the data may not distinguish.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::case::Compared;
use super::least_squares::Weighting;
use super::model::{Model, Point};
use super::quantity::{Kind, Quantity};
use super::statistics::OPEN;
use crate::scenario::longest;

/// Largest number of decades searched to each side, of those in succession that are no better before
/// one is and after it, and the reduction of the sum of squares that counts as better.
const DECADES: usize = 8;
const NO_BETTER: [usize; 2] = [4, 2];
const CLEARLY_LESS: f64 = 0.999;

/// Reduction of the sum of squares in larger numbers at which smaller ones are not searched: leaves
/// of small stiffness take long.
const ENOUGH: f64 = 0.5;

/// Largest number of numbers that are searched one by one.
const FEW: usize = 6;

/// Factors of values near given ones, and changes of numbers that are not positive, in their units.
const FACTORS: [f64; 4] = [1.05, 1.0 / 1.3, 0.5, 2.0];
const CHANGES: [f64; 4] = [-0.2, 0.2, -1.0, 1.0];

/// Accuracy of leaves that are only compared, in lengths of the leaf, and the largest number of
/// steps in which they come to rest: soft leaves far from the data may take thousands.
const COMPARED: f64 = 1e-3;
pub(super) const MOST_STEPS: usize = 400;

/// Values of the coordinates and the sum of squares there.
#[derive(Clone, Debug)]
pub(super) struct Start {
    pub theta: Vec<f64>,
    pub sum: f64,
}

/// Looks for values from which a search may begin.
pub(super) struct Scout<'a> {
    model: Model<'a>,
    weighting: Weighting,
    /// Number of values at which the leaves were relaxed.
    evaluations: AtomicUsize,
}

impl<'a> Scout<'a> {
    pub fn new(model: &Model<'a>, weighting: Weighting) -> Self {
        let mut model = model.clone();
        model.options.tolerance = Some(COMPARED.max(model.tolerance()));
        Scout {
            model,
            weighting,
            evaluations: AtomicUsize::new(0),
        }
    }

    /// How often the leaves were relaxed.
    pub fn evaluations(&self) -> usize {
        self.evaluations.load(Ordering::Relaxed)
    }

    /// The leaves relaxed from their usual starts. `None` if one does not come to rest.
    fn at(&self, theta: Vec<f64>) -> Option<Start> {
        if !is_permitted(&self.model, &theta) {
            return None;
        }
        self.evaluations.fetch_add(1, Ordering::Relaxed);
        let point = self.model.find_within(&theta, MOST_STEPS).ok()?;
        let sum = sum(self.weighting, &point);
        sum.is_finite().then_some(Start { theta, sum })
    }

    /// Those of these values at which all leaves come to rest, by ascending sums of squares.
    pub fn compare(&self, all: Vec<Vec<f64>>) -> Vec<Start> {
        let found = all.into_par_iter().map(|theta| self.at(theta));
        let mut found: Vec<Start> = found.collect::<Vec<_>>().into_iter().flatten().collect();
        found.sort_by(|a, b| a.sum.total_cmp(&b.sum));
        found
    }

    /// Values in decades around given ones: first of all positive numbers together, then of one
    /// after the other. By ascending sums of squares; `least` is the one there.
    pub fn in_decades(&self, from: &[f64], least: f64) -> Vec<Start> {
        let free = self.model.coordinates;
        let positive: Vec<usize> = (0..free.len())
            .filter(|&k| free[k].is_searched_in_decades())
            .collect();
        let mut found = self.both_ways((from, least), &positive);
        if positive.len() > 1 && positive.len() <= FEW {
            for &k in &positive {
                let best = found.iter().min_by(|a, b| a.sum.total_cmp(&b.sum));
                let best = best.filter(|best| best.sum < least);
                let from = best.map_or((from, least), |best| (&best.theta, best.sum));
                let more = self.both_ways(from, &[k]);
                found.extend(more);
            }
        }
        found.sort_by(|a, b| a.sum.total_cmp(&b.sum));
        found
    }

    fn both_ways(&self, from: (&[f64], f64), moving: &[usize]) -> Vec<Start> {
        if moving.is_empty() {
            return Vec::new();
        }
        let mut found = self.one_way(from, moving, OPEN);
        let better = |start: &Start| start.sum < ENOUGH * from.1;
        if from.1.is_infinite() || !found.iter().any(better) {
            found.extend(self.one_way(from, moving, -OPEN));
        }
        found
    }

    /// Decade after decade, until no more are better.
    fn one_way(&self, (from, least): (&[f64], f64), moving: &[usize], decade: f64) -> Vec<Start> {
        let mut found: Vec<Start> = Vec::new();
        let (mut best, mut no_better) = (least, 0);
        for step in 1..=DECADES {
            let mut theta = from.to_vec();
            for &k in moving {
                theta[k] += step as f64 * decade;
            }
            no_better += 1;
            if let Some(start) = self.at(theta) {
                if start.sum < CLEARLY_LESS * best {
                    (best, no_better) = (start.sum, 0);
                }
                found.push(start);
            }
            if no_better == NO_BETTER[usize::from(best < least)] {
                break;
            }
        }
        found
    }

    /// Values near given ones at which all leaves come to rest, by ascending sums of squares:
    /// all numbers changed together, or, if none of these does, one after the other.
    pub fn nearest(&self, from: &[f64]) -> Vec<Start> {
        let together = self.compare(self.together(from));
        match together.is_empty() {
            true => self.compare(self.one_by_one(from)),
            false => together,
        }
    }

    /// Values near given ones, by ascending sums of squares.
    pub fn near(&self, from: &[f64]) -> Vec<Start> {
        let mut all = self.together(from);
        all.extend(self.one_by_one(from));
        self.compare(all)
    }

    fn together(&self, from: &[f64]) -> Vec<Vec<f64>> {
        let times = |factor: f64| {
            let both = self.model.coordinates.iter().zip(from);
            let changed = both.map(|(free, theta)| match free.log {
                true => theta + factor.ln(),
                false => *theta,
            });
            changed.collect()
        };
        FACTORS.map(times).into()
    }

    fn one_by_one(&self, from: &[f64]) -> Vec<Vec<f64>> {
        let free = self.model.coordinates;
        let mut all = Vec::new();
        for k in (0..free.len()).filter(|_| free.len() > 1 && free.len() <= FEW) {
            let changes = match free[k].log {
                true => FACTORS.map(f64::ln),
                false => CHANGES,
            };
            for change in changes {
                let mut theta = from.to_vec();
                theta[k] += change;
                all.push(theta);
            }
        }
        all
    }
}

/// Values that may fit as well as given ones, and what they are: of exchanged directions of a section,
/// of reversed lists of veins, and of the other sign.
pub(super) fn images(model: &Model, of: &[f64]) -> Vec<(Vec<f64>, String)> {
    let keys = model.coordinates.iter().map(|free| free.number.to_string());
    let keys: Vec<String> = keys.collect();
    let place = |key: &str| keys.iter().position(|other| other == key);
    let permuted = |other: &dyn Fn(usize) -> Option<usize>| -> Vec<f64> {
        let other = (0..of.len()).map(|k| other(k).map_or(of[k], |j| of[j]));
        other.collect()
    };
    let exchange = |k: usize| match keys[k].contains("_2") {
        true => place(&keys[k].replacen("_2", "_3", 1)),
        false => place(&keys[k].replacen("_3", "_2", 1)),
    };
    let rods = model.base.scenario().rods.len();
    let reverse = |k: usize| {
        let (name, index) = keys[k].strip_suffix(']')?.rsplit_once('[')?;
        let index: usize = index.parse().ok()?;
        place(&format!("{name}[{}]", rods.checked_sub(index + 1)?))
    };
    let mut all = vec![
        (
            permuted(&exchange),
            "the axes of the section exchanged".to_string(),
        ),
        (
            permuted(&reverse),
            "the veins in reversed order".to_string(),
        ),
    ];
    let can_be_mirrored = |k: &usize| {
        let free = &model.coordinates[*k];
        !free.log && free.number.keys().is_some()
    };
    let signed = (0..of.len()).filter(can_be_mirrored);
    let signed: Vec<usize> = signed.collect();
    for &k in signed.iter().filter(|_| signed.len() <= FEW) {
        let mut theta = of.to_vec();
        theta[k] = -theta[k];
        all.push((theta, format!("{} with the other sign", keys[k])));
    }
    let mut images: Vec<(Vec<f64>, String)> = Vec::new();
    for (theta, what) in all {
        let known = images.iter().any(|(known, _)| *known == theta);
        if theta != of && !known && is_permitted(model, &theta) {
            images.push((theta, what));
        }
    }
    images
}

/// Whether values are within the bounds that were given.
fn is_permitted(model: &Model, theta: &[f64]) -> bool {
    let mut both = model.coordinates.iter().zip(theta);
    both.all(|(free, theta)| {
        let [low, high] = free.bounds;
        !free.bounded || (low..=high).contains(theta)
    })
}

/// The sum of squares at a point.
pub(super) fn sum(weighting: Weighting, point: &Point) -> f64 {
    let residuals = weighting.residuals(point);
    weighting.sum(&residuals, weighting.bound(&residuals))
}

/// The root mean square of the residuals, of coordinates in lengths of the leaf, of other data
/// relative to the largest of their kind.
pub(super) fn misfit(model: &Model, point: &Point) -> f64 {
    let longest = longest(&model.base.scenario().rods);
    let pixel = model.pixel();
    let largest = |kind: Kind| {
        let alike = point.components().filter(move |c| c.what.kind() == kind);
        alike.fold(0.0_f64, |most, c| most.max(c.observed.abs()))
    };
    let (force, frequency) = (largest(Kind::Force), largest(Kind::Frequency));
    let (mut squares, mut count) = (0.0, 0.0_f64);
    for component in point.components() {
        let size = match component.what {
            Compared::Vein { .. } if component.what.kind() == Kind::Pixel => longest / pixel,
            Compared::Vein { .. } | Compared::Result(Quantity::Tip(_)) => longest,
            Compared::Result(Quantity::Reaction(_) | Quantity::Grip(..)) => force,
            Compared::Result(Quantity::Frequency(_)) => frequency,
        };
        let part = (component.model - component.observed) / size.max(f64::MIN_POSITIVE);
        squares += part.powi(2);
        count += 1.0;
    }
    (squares / count.max(1.0)).sqrt()
}
