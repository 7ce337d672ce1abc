//! Which minimum is the answer: where the search begins, where it begins again if it ends without a
//! good one, and other minima that fit the data as well.
//!
//! Other values from which a search may begin: in decades around given ones, near them, and those
//! that exchange or mirror what the data may not distinguish.

use crate::run::Instant;
use crate::scenario::longest;
use crate::study::fit::data::{Experiment, Kind, Quantity};
use crate::study::fit::intervals::BETTER;
use crate::study::fit::least_squares::{Besides, End, Iteration, Minimum, Search, Weighting};
use crate::study::fit::model::{Compared, Model, Point};
use crate::study::fit::statistics::OPEN;
use crate::study::fit::{
    Coordinate, Fit, FitAlternative, FitError, FitOutcome, FitParameter, FitStep,
};
use rayon::prelude::*;
use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Root mean square of the residuals, relative to the size of the data, beyond which initial values
/// say nothing of the minimum: they are searched in decades first.
const FAR: f64 = 0.25;

/// The same of a minimum, beyond which the data would be less accurate than measurements are.
const COARSE: f64 = 0.05;

/// Largest number of searches from other values, and of values from which each begins.
const MOST_SEARCHES: usize = 3;

const MOST_STARTS: usize = 4;

/// Largest number of steps to another minimum.
const FEW_STEPS: usize = 30;

/// Relative difference of values that are the same.
const SAME: f64 = 1e-3;

/// Where a search begins.
pub(super) struct Beginning {
    pub point: Point,
    /// The values of the scenario, if it does not begin there although all leaves come to rest.
    initial: Option<Point>,
    /// Why it does not begin at the values of the scenario, or what was tried.
    remark: Option<String>,
    /// How often the leaves were relaxed to find it.
    evaluations: usize,
}

impl Beginning {
    /// The values of the scenario, if all leaves come to rest there and the data are not far from
    /// them; otherwise the best ones in decades around them, or near them.
    /// `told` is called with the time in seconds that the first leaves took.
    pub fn find(
        model: &Model,
        weighting: Weighting,
        told: &mut dyn FnMut(f64),
    ) -> Result<Beginning, FitError> {
        let start: Vec<f64> = model.coordinates.iter().map(|free| free.start).collect();
        let loose = model.with_loose_tolerance(weighting.assumed);
        let clock = Instant::now();
        let found = loose.find(&start);
        told(clock.elapsed().as_secs_f64());
        let (initial, refused) = match found {
            Ok(point) if misfit(model, &point) <= FAR => {
                return Ok(Beginning {
                    point,
                    initial: None,
                    remark: None,
                    evaluations: 0,
                });
            }
            Ok(point) => (Some(point), None),
            Err(FitError::NoEquilibrium(why)) => (None, Some(why)),
            Err(other) => return Err(other),
        };
        let mut taken = 0;
        if let Some(point) = &initial {
            // One search from there costs less than a look at other decades.
            let (found, evaluations) = descend(model, weighting, &point.theta, (None, FEW_STEPS));
            taken = evaluations;
            let there = found.and_then(|found| loose.find(&found.theta).ok());
            if let Some(there) = there.filter(|there| misfit(model, there) <= COARSE) {
                return Ok(Beginning {
                    point: there,
                    initial: None,
                    remark: None,
                    evaluations: taken,
                });
            }
        }
        let scout = Scout::new(model, weighting);
        let least = match &initial {
            Some(point) => sum(weighting, point),
            None => f64::INFINITY,
        };
        let mut starts = match initial {
            Some(_) => Vec::new(),
            None => scout.nearest(&start),
        };
        if starts.is_empty() {
            starts = scout.in_decades(&start, least);
        }
        let better = starts.iter().filter(|found| found.sum < least);
        let better = better
            .take(MOST_STARTS)
            .find_map(|found| loose.find(&found.theta).ok());
        let evaluations = taken + scout.evaluations();
        match (better, initial, refused) {
            (Some(point), initial, refused) => {
                let values = model.in_words(&point.theta);
                let why = refused.unwrap_or_else(|| {
                    "with the numbers of the scenario the leaf is far from the data".into()
                });
                let remark = Some(format!("{why}; the search began with {values}"));
                Ok(Beginning {
                    point,
                    initial,
                    remark,
                    evaluations,
                })
            }
            (None, Some(point), _) => {
                let remark = Some(
                    "with the numbers of the scenario the leaf is far from the data, and no other \
                     decade of them is nearer"
                        .into(),
                );
                Ok(Beginning {
                    point,
                    initial: None,
                    remark,
                    evaluations,
                })
            }
            (None, None, refused) => Err(FitError::NoEquilibrium(refused.unwrap_or_default())),
        }
    }
}

/// The minimum near some values, on coarse grids, and how often the leaves were relaxed.
fn descend(
    model: &Model,
    weighting: Weighting,
    theta: &[f64],
    (besides, most_steps): (Option<Besides>, usize),
) -> (Option<Start>, usize) {
    let first = model.with_loose_tolerance(weighting.assumed);
    let Ok(first) = first.find_within(theta, MOST_STEPS) else {
        return (None, 1);
    };
    let Ok((coarse, point)) = model.coarse(&first, weighting) else {
        return (None, 1);
    };
    let mut quietly = |_, _| {};
    let mut iteration = Iteration::new(&coarse, weighting, &mut quietly);
    iteration.most_steps = most_steps;
    iteration.besides = besides;
    let (point, end, more) = iteration.run(point);
    let found = (end == End::Converged).then(|| Start {
        sum: sum(weighting, &point),
        theta: point.theta,
    });
    (found, 1 + more)
}

/// Other minima, and what was tried to find them.
#[derive(Default)]
struct Others {
    minima: Vec<Start>,
    tried: Vec<String>,
}

/// Searches for the best minimum.
pub(super) struct Minima<'m, 'a> {
    pub model: &'m Model<'a>,
    pub weighting: Weighting,
    /// Whether the standard deviations of the data are known.
    pub known: bool,
    pub candidates: &'m [Experiment],
    /// How often the leaves were relaxed, by searches and to compare minima.
    pub evaluations: Cell<usize>,
}

impl<'a> Minima<'_, 'a> {
    /// The best minimum, with the others that fit as well.
    pub fn best(
        &self,
        began: Beginning,
        progress: &mut dyn FnMut(&FitStep),
    ) -> Result<Fit, FitError> {
        let mut remark = began.remark;
        let first = self.search(&began.point, usize::MAX, progress);
        // What the initial values lead to is found even where other values seemed better.
        let doubtful = first.as_ref().map_or(true, |first| self.doubts(first));
        let budget = &self.model.budget;
        let plain = (began.initial).filter(|_| doubtful && !budget.is_used_up());
        let plain = plain.and_then(|initial| self.search(&initial, usize::MAX, progress).ok());
        let mut best = match (first, plain) {
            (Ok(first), Some(plain)) if !plain.is_preferred_to(&first) => first,
            (_, Some(plain)) => {
                remark = None;
                plain
            }
            (Err(FitError::NoEquilibrium(why)), None) => {
                self.search_near(&began.point, why, progress)?
            }
            (first, None) => first?,
        };
        for _ in 0..MOST_SEARCHES {
            let further = (best.beyond_window && !budget.is_used_up())
                .then(|| self.again(&best, &best.theta, progress));
            let further = further.flatten();
            match further.filter(|again| again.is_preferred_to(&best)) {
                Some(again) => best = again,
                None => break,
            }
        }
        let mut others = Others::default();
        for _ in 0..MOST_SEARCHES {
            if budget.is_used_up() {
                break;
            }
            others = match self.doubts(&best) {
                true => self.elsewhere(&best),
                false => self.images(&best),
            };
            let better = others
                .minima
                .iter()
                .filter(|other| self.is_better(&best, other.sum));
            let better = better.min_by(|a, b| a.sum.total_cmp(&b.sum));
            let Some(again) = better.and_then(|it| self.again(&best, &it.theta, progress)) else {
                break;
            };
            if !again.is_preferred_to(&best) {
                break;
            }
            best = again;
        }
        let mut fit = best.fit;
        if best.converged {
            let significant = best.significant;
            let as_well = |other: &&Start| other.sum <= best.sum + significant;
            for other in others.minima.iter().filter(as_well) {
                self.tell(&mut fit, (other, best.sum));
            }
        }
        fit.tried = others.tried;
        fit.remarks.splice(0..0, remark);
        if budget.is_used_up() {
            fit.remarks.insert(
                0,
                format!(
                    "the budget of {} evaluations was used up: this is the best that was found so far; allow more, \
                     free fewer numbers, or begin nearer",
                    budget.most()
                ),
            );
        }
        fit.work.evaluations = began.evaluations + self.evaluations.get();
        Ok(fit)
    }

    fn count(&self, more: usize) {
        self.evaluations.set(self.evaluations.get() + more);
    }

    /// The number of evaluations at which searches from other values end: beside a minimum, they take no
    /// more in all than the fit itself took.
    fn most_evaluations(&self, best: &Minimum) -> usize {
        match best.converged {
            true => self.evaluations.get() + best.fit.work.evaluations,
            false => usize::MAX,
        }
    }

    /// How many evaluations are left up to that, if any.
    fn left(&self, most: usize) -> Option<usize> {
        let left = most.saturating_sub(self.evaluations.get());
        (left > 0).then_some(left)
    }

    fn loose(&self) -> Model<'a> {
        self.model.with_loose_tolerance(self.weighting.assumed)
    }

    /// The search from a point in no more than so many steps, with bounds around it if none are given.
    fn search(
        &self,
        first: &Point,
        most_steps: usize,
        progress: &mut dyn FnMut(&FitStep),
    ) -> Result<Minimum, FitError> {
        let coordinates = self.model.coordinates.iter().zip(&first.theta);
        let coordinates: Vec<Coordinate> = coordinates
            .map(|(free, theta)| free.starting_at(*theta))
            .collect();
        let model = Model {
            coordinates: &coordinates,
            ..self.model.clone()
        };
        let search = Search {
            model: &model,
            weighting: self.weighting,
            known: self.known,
            candidates: self.candidates,
            most_steps,
        };
        let found = search.run(first, progress)?;
        self.count(found.fit.work.evaluations);
        Ok(found)
    }

    /// The search from other values; where a minimum is known, in no more steps than that took.
    fn again(
        &self,
        best: &Minimum,
        theta: &[f64],
        progress: &mut dyn FnMut(&FitStep),
    ) -> Option<Minimum> {
        let point = self.loose().find(theta).ok()?;
        let most_steps = match best.converged {
            true => best.fit.work.evaluations,
            false => usize::MAX,
        };
        self.search(&point, most_steps, progress).ok()
    }

    /// The search from values near those from which it ended where there is no leaf.
    fn search_near(
        &self,
        from: &Point,
        why: String,
        progress: &mut dyn FnMut(&FitStep),
    ) -> Result<Minimum, FitError> {
        let starts = Scout::new(self.model, self.weighting).near(&from.theta);
        let mut points = starts.iter().take(MOST_STARTS);
        let found = points.find_map(|start| {
            let point = self.loose().find(&start.theta).ok()?;
            self.search(&point, usize::MAX, progress).ok()
        });
        found.ok_or(FitError::NoEquilibrium(why))
    }

    /// Whether there may well be a better minimum elsewhere.
    fn doubts(&self, best: &Minimum) -> bool {
        let contradicted = best.fit.outcome == FitOutcome::Contradicted;
        let coarse = !self.known && best.misfit > COARSE;
        !best.converged || best.beyond_window || contradicted || coarse
    }

    /// Whether a sum of squares is less than that of a minimum by more than chance.
    fn is_better(&self, best: &Minimum, sum: f64) -> bool {
        match best.converged {
            true => sum < best.sum - BETTER * best.variance,
            false => sum < best.sum,
        }
    }

    /// Minima to which searches lead that begin elsewhere: in other decades, and near.
    fn elsewhere(&self, best: &Minimum) -> Others {
        let mut tried = vec!["values near these".to_string()];
        let scout = Scout::new(self.model, self.weighting);
        let initial = self.model.coordinates.iter().map(|free| free.start);
        let mut starts = scout.compare(vec![initial.collect()]);
        starts.extend(scout.near(&best.theta));
        if best.beyond_window || best.misfit > COARSE {
            tried.push("other decades".into());
            starts.extend(scout.in_decades(&best.theta, best.sum));
        }
        starts.sort_by(|a, b| a.sum.total_cmp(&b.sum));
        self.count(scout.evaluations());
        let mut minima = Vec::new();
        let most = self.most_evaluations(best);
        for start in starts.into_iter().take(MOST_STARTS) {
            // Values that are better already need not lead away from the minimum.
            let beside = best.converged && !self.is_better(best, start.sum);
            let besides = beside.then(|| best.besides(&start.theta));
            let Some(most_steps) = self.left(most) else {
                break;
            };
            let most_steps = most_steps.min(FEW_STEPS);
            minima.extend(self.descend(&start.theta, besides, most_steps));
        }
        Others { minima, tried }
    }

    /// Minima near values that may fit as well.
    fn images(&self, best: &Minimum) -> Others {
        let mut others = Others::default();
        let most = self.most_evaluations(best);
        for (theta, what) in images(self.model, &best.theta) {
            let Some(most_steps) = self.left(most) else {
                break;
            };
            let found = self.descend(&theta, Some(best.besides(&theta)), most_steps);
            others.minima.extend(found);
            others.tried.push(what);
        }
        others
    }

    /// The minimum near some values, on coarse grids.
    fn descend(&self, theta: &[f64], besides: Option<Besides>, most_steps: usize) -> Option<Start> {
        let (found, evaluations) =
            descend(self.model, self.weighting, theta, (besides, most_steps));
        self.count(evaluations);
        found
    }

    /// Adds another minimum to a fit, if a number that is determined has a value there beyond its
    /// interval: then it is not.
    fn tell(&self, fit: &mut Fit, (other, least): (&Start, f64)) {
        let values = self.model.numbers(&other.theta);
        let beyond = |parameter: &FitParameter, value: f64| {
            let (low, high) = (parameter.low, parameter.high);
            let outside =
                low.is_some_and(|low| value < low) || high.is_some_and(|high| value > high);
            low.is_some() && high.is_some() && outside
        };
        let known = fit.alternatives.iter().any(|known| {
            let mut both = values.iter();
            both.all(|(key, value)| (known.values[key] / value - 1.0).abs() < SAME)
        });
        let differs: Vec<bool> = (fit.parameters.iter().zip(&values))
            .map(|(parameter, (_, value))| beyond(parameter, *value))
            .collect();
        if known || !differs.contains(&true) {
            return;
        }
        let ratio = if least > 0.0 { other.sum / least } else { 1.0 };
        let alternative = FitAlternative {
            chi_squared: fit.chi_squared * ratio,
            values: values.iter().cloned().collect(),
        };
        let told = self.model.in_words(&other.theta);
        fit.says.push(format!("other values fit as well: {told}"));
        fit.alternatives.push(alternative);
        fit.outcome = FitOutcome::Undetermined;
        let parameters = fit.parameters.iter_mut().zip(differs);
        parameters.for_each(|(parameter, differs)| parameter.determined &= !differs);
    }
}

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
