//! Which minimum is the answer: where the search begins, where it begins again if it ends without a
//! good one, and other minima that fit the data as well.
//!
//! Searches begin in decades around given values, near them, and at values that exchange or mirror what
//! the data may not distinguish.

use crate::run::Instant;
use crate::study::fit::columns::FitError;
use crate::study::fit::data::Experiment;
use crate::study::fit::free::FitCoordinate;
use crate::study::fit::least_squares::{
    GaussNewtonIteration, GaussNewtonOutcome, GaussNewtonResult, KnownMinimum,
};
use crate::study::fit::local_fit::{FitMinimum, LocalFitSearch};
use crate::study::fit::model::{CoarseModel, FitModel, FitPoint, MOST_RELAXATION_STEPS, Weighting};
use crate::study::fit::remark::FitRemark;
use crate::study::fit::result::{Fit, FitAlternative, FitOutcome, FitParameter, FitStep};
use crate::study::fit::statistics::{BETTER_MINIMUM_EXCESS, UNDETERMINED_UNCERTAINTY};
use rayon::prelude::*;
use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

/// When a fit begins elsewhere, and how often. Misfits are root mean squares of the residuals
/// relative to the size of the data.
struct GlobalSearchLimits {
    /// Initial values with a larger misfit say nothing of the minimum: they are searched in decades
    /// first.
    poor_initial_misfit: f64,
    /// At a minimum with a larger misfit the data would be less accurate than measurements are.
    poor_minimum_misfit: f64,
    /// Largest number of searches from other values.
    most_searches: usize,
    /// Largest number of values from which each of them begins.
    most_starts: usize,
    /// Largest number of steps to another minimum.
    most_steps_to_alternative: usize,
    /// Relative difference of values that are the same.
    same_values: f64,
}

const GLOBAL_SEARCH: GlobalSearchLimits = GlobalSearchLimits {
    poor_initial_misfit: 0.25,
    poor_minimum_misfit: 0.05,
    most_searches: 3,
    most_starts: 4,
    most_steps_to_alternative: 30,
    same_values: 1e-3,
};

pub(super) struct FitStart {
    pub point: FitPoint,
    /// The values of the scenario, if it does not begin there although all leaves come to rest.
    initial: Option<FitPoint>,
    /// Why it does not begin at the values of the scenario, or what was tried.
    remark: Option<FitRemark>,
    /// How often the leaves were relaxed to find it.
    evaluations: usize,
}

impl FitStart {
    /// The values of the scenario, if all leaves come to rest there and the data are not far from
    /// them; otherwise the best ones in decades around them, or near them.
    /// `told` is called with the time in seconds that the first leaves took.
    pub fn choose_start(
        model: &FitModel,
        weighting: Weighting,
        told: &mut dyn FnMut(f64),
    ) -> Result<FitStart, FitError> {
        let start: Vec<f64> = model.coordinates.iter().map(|free| free.initial).collect();
        let loose = model.with_loose_tolerance(weighting.assumed_deviation);
        let clock = Instant::now();
        let found = loose.relax_leaves(&start);
        told(clock.elapsed().as_secs_f64());
        let (initial, refused) = match found {
            Ok(point) if model.relative_misfit(&point) <= GLOBAL_SEARCH.poor_initial_misfit => {
                return Ok(FitStart {
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
            let found = find_coarse_minimum(
                model,
                weighting,
                &point.theta,
                None,
                GLOBAL_SEARCH.most_steps_to_alternative,
            );
            taken = found.evaluations;
            let there = (found.minimum).and_then(|found| loose.relax_leaves(&found.theta).ok());
            if let Some(there) = there
                .filter(|there| model.relative_misfit(there) <= GLOBAL_SEARCH.poor_minimum_misfit)
            {
                return Ok(FitStart {
                    point: there,
                    initial: None,
                    remark: None,
                    evaluations: taken,
                });
            }
        }
        let scout = Multistart::new(model, weighting);
        let least = match &initial {
            Some(point) => weighting.sum_of_squares(point),
            None => f64::INFINITY,
        };
        let mut starts = match initial {
            Some(_) => Vec::new(),
            None => scout.nearest_starts(&start),
        };
        if starts.is_empty() {
            starts = scout.starts_in_decades(&start, least);
        }
        let better = starts.iter().filter(|found| found.sum < least);
        let better = better
            .take(GLOBAL_SEARCH.most_starts)
            .find_map(|found| loose.relax_leaves(&found.theta).ok());
        let evaluations = taken + scout.evaluations();
        match (better, initial, refused) {
            (Some(point), initial, refused) => {
                let values = model.values_in_words(&point.theta);
                Ok(FitStart {
                    point,
                    initial,
                    remark: Some(FitRemark::BeganElsewhere {
                        refusal: refused,
                        values,
                    }),
                    evaluations,
                })
            }
            (None, Some(point), _) => Ok(FitStart {
                point,
                initial: None,
                remark: Some(FitRemark::NoDecadeNearer),
                evaluations,
            }),
            (None, None, refused) => Err(FitError::NoEquilibrium(refused.unwrap_or_default())),
        }
    }
}

/// The minimum near some values, on coarse grids.
struct CoarseMinimum {
    /// None if the search does not converge.
    minimum: Option<EvaluatedStart>,
    /// How often the leaves were relaxed.
    evaluations: usize,
}

impl CoarseMinimum {
    /// No minimum: the leaves do not come to rest at these values.
    const NO_LEAVES: CoarseMinimum = CoarseMinimum {
        minimum: None,
        evaluations: 1,
    };
}

fn find_coarse_minimum(
    model: &FitModel,
    weighting: Weighting,
    theta: &[f64],
    besides: Option<KnownMinimum>,
    most_steps: usize,
) -> CoarseMinimum {
    let first = model.with_loose_tolerance(weighting.assumed_deviation);
    let Ok(first) = first.relax_leaves_within_steps(theta, MOST_RELAXATION_STEPS) else {
        return CoarseMinimum::NO_LEAVES;
    };
    let Ok(CoarseModel {
        model: coarse,
        point,
    }) = model.coarse_model(&first, weighting)
    else {
        return CoarseMinimum::NO_LEAVES;
    };
    let mut quietly = |_, _| {};
    let mut iteration = GaussNewtonIteration::new(&coarse, weighting, &mut quietly);
    iteration.most_steps = most_steps;
    iteration.excluded_minimum = besides;
    let GaussNewtonResult {
        point,
        outcome,
        evaluations,
    } = iteration.run(point);
    let minimum = (outcome == GaussNewtonOutcome::Converged).then(|| EvaluatedStart {
        sum: weighting.sum_of_squares(&point),
        theta: point.theta,
    });
    CoarseMinimum {
        minimum,
        evaluations: 1 + evaluations,
    }
}

/// Other minima, and what was tried to find them.
#[derive(Default)]
struct AlternativeMinima {
    minima: Vec<EvaluatedStart>,
    tried: Vec<String>,
}

pub(super) struct GlobalFitSearch<'m, 'a> {
    pub model: &'m FitModel<'a>,
    pub weighting: Weighting,
    /// Whether the standard deviations of the data are known.
    pub has_known_deviations: bool,
    pub candidates: &'m [Experiment],
    /// How often the leaves were relaxed, by searches and to compare minima.
    pub evaluations: Cell<usize>,
}

impl<'a> GlobalFitSearch<'_, 'a> {
    /// The best minimum, with the others that fit as well.
    pub fn best_fit(
        &self,
        began: FitStart,
        progress: &mut dyn FnMut(&FitStep),
    ) -> Result<Fit, FitError> {
        let mut remark = began.remark;
        let first = self.search_from_point(&began.point, usize::MAX, progress);
        // What the initial values lead to is found even where other values seemed better.
        let doubtful = first
            .as_ref()
            .map_or(true, |first| self.suspects_better_minimum(first));
        let plain = (began.initial).filter(|_| doubtful && !self.model.must_end());
        let plain =
            plain.and_then(|initial| self.search_from_point(&initial, usize::MAX, progress).ok());
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
        for _ in 0..GLOBAL_SEARCH.most_searches {
            let further = (best.beyond_window && !self.model.must_end())
                .then(|| self.search_from_values(&best, &best.theta, progress));
            let further = further.flatten();
            match further.filter(|again| again.is_preferred_to(&best)) {
                Some(again) => best = again,
                None => break,
            }
        }
        let mut others = AlternativeMinima::default();
        for _ in 0..GLOBAL_SEARCH.most_searches {
            if self.model.must_end() {
                break;
            }
            others = match self.suspects_better_minimum(&best) {
                true => self.minima_from_other_starts(&best),
                false => self.minima_from_symmetric_values(&best),
            };
            let better = others
                .minima
                .iter()
                .filter(|other| self.is_better(&best, other.sum));
            let better = better.min_by(|a, b| a.sum.total_cmp(&b.sum));
            let Some(again) =
                better.and_then(|it| self.search_from_values(&best, &it.theta, progress))
            else {
                break;
            };
            if !again.is_preferred_to(&best) {
                break;
            }
            best = again;
        }
        let mut fit = best.fit;
        if best.converged {
            let significant = best.significant_excess;
            let as_well = |other: &&EvaluatedStart| other.sum <= best.sum + significant;
            for other in others.minima.iter().filter(as_well) {
                self.add_alternative(&mut fit, other, best.sum);
            }
        }
        fit.tried = others.tried;
        fit.remarks.splice(0..0, remark);
        if self.model.options.limit.reached() {
            fit.remarks.insert(0, FitRemark::Stopped);
        } else if self.model.budget.is_used_up() {
            let evaluations = self.model.budget.limit();
            fit.remarks
                .insert(0, FitRemark::BudgetUsedUp { evaluations });
        }
        fit.work.evaluations = began.evaluations + self.evaluations.get();
        Ok(fit)
    }

    fn count_evaluations(&self, more: usize) {
        self.evaluations.set(self.evaluations.get() + more);
    }

    /// The number of evaluations at which searches from other values end: beside a minimum, they take no
    /// more in all than the fit itself took.
    fn search_evaluation_limit(&self, best: &FitMinimum) -> usize {
        match best.converged {
            true => self.evaluations.get() + best.fit.work.evaluations,
            false => usize::MAX,
        }
    }

    /// How many evaluations are left up to that, if any.
    fn remaining_evaluations(&self, most: usize) -> Option<usize> {
        let left = most.saturating_sub(self.evaluations.get());
        (left > 0).then_some(left)
    }

    fn model_with_loose_tolerance(&self) -> FitModel<'a> {
        self.model
            .with_loose_tolerance(self.weighting.assumed_deviation)
    }

    /// The search from a point in no more than so many steps, with bounds around it if none are given.
    fn search_from_point(
        &self,
        first: &FitPoint,
        most_steps: usize,
        progress: &mut dyn FnMut(&FitStep),
    ) -> Result<FitMinimum, FitError> {
        let coordinates = self.model.coordinates.iter().zip(&first.theta);
        let coordinates: Vec<FitCoordinate> = coordinates
            .map(|(free, theta)| free.with_initial_value(*theta))
            .collect();
        let model = FitModel {
            coordinates: &coordinates,
            ..self.model.clone()
        };
        let search = LocalFitSearch {
            model: &model,
            weighting: self.weighting,
            has_known_deviations: self.has_known_deviations,
            candidates: self.candidates,
            most_steps,
        };
        let found = search.run(first, progress)?;
        self.count_evaluations(found.fit.work.evaluations);
        Ok(found)
    }

    /// The search from other values; where a minimum is known, in no more steps than that took.
    fn search_from_values(
        &self,
        best: &FitMinimum,
        theta: &[f64],
        progress: &mut dyn FnMut(&FitStep),
    ) -> Option<FitMinimum> {
        let point = self.model_with_loose_tolerance().relax_leaves(theta).ok()?;
        let most_steps = match best.converged {
            true => best.fit.work.evaluations,
            false => usize::MAX,
        };
        self.search_from_point(&point, most_steps, progress).ok()
    }

    /// The search from values near those from which it ended where there is no leaf.
    fn search_near(
        &self,
        from: &FitPoint,
        why: String,
        progress: &mut dyn FnMut(&FitStep),
    ) -> Result<FitMinimum, FitError> {
        let starts = Multistart::new(self.model, self.weighting).starts_nearby(&from.theta);
        let mut points = starts.iter().take(GLOBAL_SEARCH.most_starts);
        let found = points.find_map(|start| {
            let point = self
                .model_with_loose_tolerance()
                .relax_leaves(&start.theta)
                .ok()?;
            self.search_from_point(&point, usize::MAX, progress).ok()
        });
        found.ok_or(FitError::NoEquilibrium(why))
    }

    /// Whether there may well be a better minimum elsewhere.
    fn suspects_better_minimum(&self, best: &FitMinimum) -> bool {
        let contradicted = best.fit.outcome == FitOutcome::Contradicted;
        let coarse = !self.has_known_deviations && best.misfit > GLOBAL_SEARCH.poor_minimum_misfit;
        !best.converged || best.beyond_window || contradicted || coarse
    }

    /// Whether a sum of squares is less than that of a minimum by more than chance.
    fn is_better(&self, best: &FitMinimum, sum: f64) -> bool {
        match best.converged {
            true => sum < best.sum - BETTER_MINIMUM_EXCESS * best.variance,
            false => sum < best.sum,
        }
    }

    /// Minima to which searches lead that begin elsewhere: in other decades, and near.
    fn minima_from_other_starts(&self, best: &FitMinimum) -> AlternativeMinima {
        let mut tried = vec!["values near these".to_string()];
        let scout = Multistart::new(self.model, self.weighting);
        let initial = self.model.coordinates.iter().map(|free| free.initial);
        let mut starts = scout.ranked_starts(vec![initial.collect()]);
        starts.extend(scout.starts_nearby(&best.theta));
        if best.beyond_window || best.misfit > GLOBAL_SEARCH.poor_minimum_misfit {
            tried.push("other decades".into());
            starts.extend(scout.starts_in_decades(&best.theta, best.sum));
        }
        starts.sort_by(|a, b| a.sum.total_cmp(&b.sum));
        self.count_evaluations(scout.evaluations());
        let mut minima = Vec::new();
        let most = self.search_evaluation_limit(best);
        for start in starts.into_iter().take(GLOBAL_SEARCH.most_starts) {
            // Values that are better already need not lead away from the minimum.
            let beside = best.converged && !self.is_better(best, start.sum);
            let besides = beside.then(|| best.exclude_from(&start.theta));
            let Some(most_steps) = self.remaining_evaluations(most) else {
                break;
            };
            let most_steps = most_steps.min(GLOBAL_SEARCH.most_steps_to_alternative);
            minima.extend(self.find_coarse_minimum(&start.theta, besides, most_steps));
        }
        AlternativeMinima { minima, tried }
    }

    /// Minima near values that may fit as well.
    fn minima_from_symmetric_values(&self, best: &FitMinimum) -> AlternativeMinima {
        let mut others = AlternativeMinima::default();
        let most = self.search_evaluation_limit(best);
        for SymmetricValues { theta, description } in symmetric_values(self.model, &best.theta) {
            let Some(most_steps) = self.remaining_evaluations(most) else {
                break;
            };
            let found =
                self.find_coarse_minimum(&theta, Some(best.exclude_from(&theta)), most_steps);
            others.minima.extend(found);
            others.tried.push(description);
        }
        others
    }

    /// The minimum near some values, on coarse grids.
    fn find_coarse_minimum(
        &self,
        theta: &[f64],
        besides: Option<KnownMinimum>,
        most_steps: usize,
    ) -> Option<EvaluatedStart> {
        let found = find_coarse_minimum(self.model, self.weighting, theta, besides, most_steps);
        self.count_evaluations(found.evaluations);
        found.minimum
    }

    /// Adds another minimum to a fit, if a number that is determined has a value there beyond its
    /// interval: then it is not.
    fn add_alternative(&self, fit: &mut Fit, other: &EvaluatedStart, least: f64) {
        let values = self.model.named_values(&other.theta);
        let beyond = |parameter: &FitParameter, value: f64| {
            let (low, high) = (parameter.low, parameter.high);
            let outside =
                low.is_some_and(|low| value < low) || high.is_some_and(|high| value > high);
            low.is_some() && high.is_some() && outside
        };
        let known = fit.alternatives.iter().any(|known| {
            let mut both = values.iter();
            both.all(|(key, value)| {
                (known.values[key] / value - 1.0).abs() < GLOBAL_SEARCH.same_values
            })
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
        let told = self.model.values_in_words(&other.theta);
        fit.says.push(format!("other values fit as well: {told}"));
        fit.alternatives.push(alternative);
        fit.outcome = FitOutcome::Undetermined;
        let parameters = fit.parameters.iter_mut().zip(differs);
        parameters.for_each(|(parameter, differs)| parameter.determined &= !differs);
    }
}

/// Values at which the leaves are compared before a search begins there.
struct MultistartSettings {
    /// Largest number of decades to each side.
    most_decades: usize,
    /// Largest number of decades in succession that are no better, before one is and after it.
    fruitless_decades: [usize; 2],
    /// Ratio of sums of squares that counts as better.
    improved_sum: f64,
    /// Ratio of sums of squares in larger numbers at which smaller ones are not searched: leaves of
    /// small stiffness take long.
    sufficient_sum: f64,
    /// Largest number of free numbers that are searched one by one.
    most_varied_singly: usize,
    /// Factors of positive numbers near given values.
    nearby_factors: [f64; 4],
    /// Changes of other numbers near given values, in their units.
    nearby_offsets: [f64; 4],
    /// Tolerance of leaves that are only compared.
    tolerance: f64,
}

const MULTISTART: MultistartSettings = MultistartSettings {
    most_decades: 8,
    fruitless_decades: [4, 2],
    improved_sum: 0.999,
    sufficient_sum: 0.5,
    most_varied_singly: 6,
    nearby_factors: [1.05, 1.0 / 1.3, 0.5, 2.0],
    nearby_offsets: [-0.2, 0.2, -1.0, 1.0],
    tolerance: 1e-3,
};

/// Values of the coordinates and the sum of squares there.
#[derive(Clone, Debug)]
pub(super) struct EvaluatedStart {
    pub theta: Vec<f64>,
    pub sum: f64,
}

/// Looks for values from which a search may begin.
pub(super) struct Multistart<'a> {
    model: FitModel<'a>,
    weighting: Weighting,
    /// Number of values at which the leaves were relaxed.
    evaluations: AtomicUsize,
}

impl<'a> Multistart<'a> {
    pub fn new(model: &FitModel<'a>, weighting: Weighting) -> Self {
        let mut model = model.clone();
        model.options.tolerance = Some(MULTISTART.tolerance.max(model.equilibrium_tolerance()));
        Multistart {
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
    fn evaluate_start(&self, theta: Vec<f64>) -> Option<EvaluatedStart> {
        if !is_within_given_bounds(&self.model, &theta) {
            return None;
        }
        self.evaluations.fetch_add(1, Ordering::Relaxed);
        let point = self
            .model
            .relax_leaves_within_steps(&theta, MOST_RELAXATION_STEPS)
            .ok()?;
        let sum = self.weighting.sum_of_squares(&point);
        sum.is_finite().then_some(EvaluatedStart { theta, sum })
    }

    /// The values, of all given ones, at which all leaves come to rest, by ascending sums of squares.
    pub fn ranked_starts(&self, all: Vec<Vec<f64>>) -> Vec<EvaluatedStart> {
        let found = all.into_par_iter().map(|theta| self.evaluate_start(theta));
        let mut found: Vec<EvaluatedStart> =
            found.collect::<Vec<_>>().into_iter().flatten().collect();
        found.sort_by(|a, b| a.sum.total_cmp(&b.sum));
        found
    }

    /// Values in decades around given ones: first of all positive numbers together, then of one
    /// after the other. By ascending sums of squares; `least` is the one there.
    pub fn starts_in_decades(&self, from: &[f64], least: f64) -> Vec<EvaluatedStart> {
        let free = self.model.coordinates;
        let positive: Vec<usize> = (0..free.len())
            .filter(|&k| free[k].is_searched_in_decades())
            .collect();
        let given = EvaluatedStart {
            theta: from.to_vec(),
            sum: least,
        };
        let mut found = self.scan_decades_both_ways(&given, &positive);
        if positive.len() > 1 && positive.len() <= MULTISTART.most_varied_singly {
            for &k in &positive {
                let best = found.iter().min_by(|a, b| a.sum.total_cmp(&b.sum));
                let best = best.filter(|best| best.sum < least);
                let more = self.scan_decades_both_ways(best.unwrap_or(&given), &[k]);
                found.extend(more);
            }
        }
        found.sort_by(|a, b| a.sum.total_cmp(&b.sum));
        found
    }

    fn scan_decades_both_ways(
        &self,
        from: &EvaluatedStart,
        moving: &[usize],
    ) -> Vec<EvaluatedStart> {
        if moving.is_empty() {
            return Vec::new();
        }
        let mut found = self.scan_decades_one_way(from, moving, UNDETERMINED_UNCERTAINTY);
        let better = |start: &EvaluatedStart| start.sum < MULTISTART.sufficient_sum * from.sum;
        if from.sum.is_infinite() || !found.iter().any(better) {
            found.extend(self.scan_decades_one_way(from, moving, -UNDETERMINED_UNCERTAINTY));
        }
        found
    }

    /// Decade after decade, until no more are better.
    fn scan_decades_one_way(
        &self,
        from: &EvaluatedStart,
        moving: &[usize],
        decade: f64,
    ) -> Vec<EvaluatedStart> {
        let mut found: Vec<EvaluatedStart> = Vec::new();
        let (mut best, mut no_better) = (from.sum, 0);
        for step in 1..=MULTISTART.most_decades {
            let mut theta = from.theta.clone();
            for &k in moving {
                theta[k] += step as f64 * decade;
            }
            no_better += 1;
            if let Some(start) = self.evaluate_start(theta) {
                if start.sum < MULTISTART.improved_sum * best {
                    (best, no_better) = (start.sum, 0);
                }
                found.push(start);
            }
            if no_better == MULTISTART.fruitless_decades[usize::from(best < from.sum)] {
                break;
            }
        }
        found
    }

    /// Values near given ones at which all leaves come to rest, by ascending sums of squares:
    /// all numbers changed together, or, if none of these does, one after the other.
    pub fn nearest_starts(&self, from: &[f64]) -> Vec<EvaluatedStart> {
        let together = self.ranked_starts(self.scaled_together(from));
        match together.is_empty() {
            true => self.ranked_starts(self.varied_singly(from)),
            false => together,
        }
    }

    /// Values near given ones, by ascending sums of squares.
    pub fn starts_nearby(&self, from: &[f64]) -> Vec<EvaluatedStart> {
        let mut all = self.scaled_together(from);
        all.extend(self.varied_singly(from));
        self.ranked_starts(all)
    }

    fn scaled_together(&self, from: &[f64]) -> Vec<Vec<f64>> {
        let times = |factor: f64| {
            let both = self.model.coordinates.iter().zip(from);
            let changed = both.map(|(free, theta)| match free.is_logarithmic {
                true => theta + factor.ln(),
                false => *theta,
            });
            changed.collect()
        };
        MULTISTART.nearby_factors.map(times).into()
    }

    fn varied_singly(&self, from: &[f64]) -> Vec<Vec<f64>> {
        let free = self.model.coordinates;
        let mut all = Vec::new();
        for k in (0..free.len())
            .filter(|_| free.len() > 1 && free.len() <= MULTISTART.most_varied_singly)
        {
            let changes = match free[k].is_logarithmic {
                true => MULTISTART.nearby_factors.map(f64::ln),
                false => MULTISTART.nearby_offsets,
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

/// Values that may fit as well as given ones.
struct SymmetricValues {
    theta: Vec<f64>,
    description: String,
}

/// Values of exchanged directions of a section, of reversed lists of veins, and of the other sign.
fn symmetric_values(model: &FitModel, of: &[f64]) -> Vec<SymmetricValues> {
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
        SymmetricValues {
            theta: permuted(&exchange),
            description: "the axes of the section exchanged".into(),
        },
        SymmetricValues {
            theta: permuted(&reverse),
            description: "the veins in reversed order".into(),
        },
    ];
    let can_be_mirrored = |k: &usize| {
        let free = &model.coordinates[*k];
        !free.is_logarithmic && free.number.scenario_keys().is_some()
    };
    let signed = (0..of.len()).filter(can_be_mirrored);
    let signed: Vec<usize> = signed.collect();
    for &k in signed
        .iter()
        .filter(|_| signed.len() <= MULTISTART.most_varied_singly)
    {
        let mut theta = of.to_vec();
        theta[k] = -theta[k];
        let description = format!("{} with the other sign", keys[k]);
        all.push(SymmetricValues { theta, description });
    }
    let mut images: Vec<SymmetricValues> = Vec::new();
    for values in all {
        let known = images.iter().any(|known| known.theta == values.theta);
        if values.theta != of && !known && is_within_given_bounds(model, &values.theta) {
            images.push(values);
        }
    }
    images
}

/// Whether values are within the bounds that were given.
fn is_within_given_bounds(model: &FitModel, theta: &[f64]) -> bool {
    let mut both = model.coordinates.iter().zip(theta);
    both.all(|(free, theta)| {
        let [low, high] = free.bounds;
        !free.has_given_bounds || (low..=high).contains(theta)
    })
}
