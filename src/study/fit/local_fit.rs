//! The fit from one start: the search for the minimum near it, and what is told of the minimum.
//!
//! The search runs on coarse grids and ends on all of them. If the profile of a number leads to a
//! better minimum, it goes on from there.

use crate::numbers::format_two_digits;
use crate::relax::ContinuationFailure;
use crate::scenario::longest;
use crate::study::ParameterKeys;
use crate::study::fit::columns::{DatumDimension, FitError};
use crate::study::fit::data::{Experiment, ObservedExperiment};
use crate::study::fit::free::{FitCoordinate, LONGEST_COORDINATE_STEP};
use crate::study::fit::lack_of_fit::{FAR_FROM_BASE, data_contradict_model, data_far_from_model};
use crate::study::fit::least_squares::{
    GaussNewtonIteration, GaussNewtonOutcome, GaussNewtonResult, KnownMinimum,
};
use crate::study::fit::model::{CoarseModel, FitModel, FitPoint, Weighting, round_to_three_digits};
use crate::study::fit::prediction::DatumQuantity;
use crate::study::fit::remark::FitRemark;
use crate::study::fit::result::{
    ExperimentConditions, Fit, FitLeaf, FitOutcome, FitParameter, FitResidual, FitStep, FitWork,
};
use crate::study::fit::statistics::{
    BETTER_MINIMUM_EXCESS, FitStatistics, UNDETERMINED_UNCERTAINTY, sparse_basis,
};
use crate::study::fit::{intervals, lack_of_fit, statistics};
use std::collections::BTreeMap;

/// How often a local search begins again.
struct LocalSearchLimits {
    /// Largest number of minima abandoned for better ones.
    most_minima_abandoned: usize,
    /// Largest number of jumps of leaves to other equilibria, if a fit cannot continue without.
    most_jumps: usize,
    /// Number of values, of those at which a leaf would have to jump, at which it is relaxed again.
    most_jumps_relaxed: usize,
    /// If the standard deviation of the data is estimated from the residuals, the largest ratio of
    /// that of the search to it: a larger one is due to coarse grids.
    consistent_deviation: f64,
}

const LOCAL_SEARCH: LocalSearchLimits = LocalSearchLimits {
    most_minima_abandoned: 4,
    most_jumps: 3,
    most_jumps_relaxed: 3,
    consistent_deviation: 1.05,
};

/// A minimum, or where the search for it ended.
pub(super) struct FitMinimum {
    pub fit: Fit,
    pub theta: Vec<f64>,
    /// The sum of squares, the variance of a datum, and the excess at the ends of intervals.
    pub sum: f64,
    pub variance: f64,
    pub significant_excess: f64,
    pub converged: bool,
    /// Root mean square of the residuals, relative to the size of the data.
    pub misfit: f64,
    /// Whether the sum still falls where a number without given bounds is as far from its initial
    /// value as it may be.
    pub beyond_window: bool,
}

impl FitMinimum {
    /// The point of these statistics, converged or not, with what is told of it.
    fn new(stats: &FitStatistics, fit: Fit, converged: bool) -> FitMinimum {
        FitMinimum {
            fit,
            sum: stats.weighting.sum_of_squares(stats.point),
            variance: stats.residual_deviation.powi(2),
            significant_excess: (stats.coverage_factor * stats.residual_deviation).powi(2),
            converged,
            misfit: stats.model.relative_misfit(stats.point),
            beyond_window: falls_beyond_window(stats),
            theta: stats.point.theta.clone(),
        }
    }

    /// Whether this is the better answer. A minimum is not left for values that are none.
    pub fn is_preferred_to(&self, other: &FitMinimum) -> bool {
        match self.converged == other.converged {
            true => self.sum < other.sum,
            false => self.converged,
        }
    }

    /// This minimum as one besides which another is searched from these values.
    pub fn exclude_from(&self, theta: &[f64]) -> KnownMinimum<'_> {
        let change = theta.iter().zip(&self.theta).map(|(to, from)| to - from);
        KnownMinimum {
            theta: &self.theta,
            largest_sum: self.sum + self.significant_excess,
            distance: change.map(|it| it.powi(2)).sum::<f64>().sqrt(),
        }
    }
}

/// The search for a minimum near a start.
pub(super) struct LocalFitSearch<'m, 'a> {
    pub model: &'m FitModel<'a>,
    pub weighting: Weighting,
    /// Whether the standard deviations of the data are known.
    pub has_known_deviations: bool,
    pub candidates: &'m [Experiment],
    /// Largest number of steps to a minimum.
    pub most_steps: usize,
}

impl<'m, 'a> LocalFitSearch<'m, 'a> {
    /// Begins with these leaves. If a profile leads to a better minimum, the search goes on from
    /// there.
    pub fn run(
        &self,
        first: &FitPoint,
        progress: &mut dyn FnMut(&FitStep),
    ) -> Result<FitMinimum, FitError> {
        let (model, weighting) = (self.model, self.weighting);
        let CoarseModel {
            model: mut coarse,
            mut point,
        } = model.coarse_model(first, weighting)?;
        let mut work = FitWork::default();
        let mut attempts = 0;
        let mut jumps = 0;
        let mut found = loop {
            // The search on coarse grids; the last steps use all.
            let mut searching = |step, sum| {
                let known = None;
                progress(&FitStep {
                    step,
                    sum,
                    known,
                    budget: None,
                });
            };
            let mut search = GaussNewtonIteration::new(&coarse, weighting, &mut searching);
            search.most_steps = search.most_steps.min(self.most_steps);
            let searched = search.run(point);
            let near = searched.point;
            work.evaluations += searched.evaluations;
            attempts += 1;
            let there = model.continue_leaves(&near, &near.theta);
            let there = there.or_else(|_| model.relax_leaves(&near.theta));
            if there.is_err() && model.options.limit.reached() && near.gradients().next().is_some()
            {
                // No leaf comes to rest on finer grids any more: these are the answer.
                break self.stopped_minimum(&coarse, &near, work);
            }
            let there = there?;
            let mut last = GaussNewtonIteration::new(model, weighting, &mut searching);
            last.reuses_derivatives = true;
            last.most_steps = last.most_steps.min(self.most_steps);
            let GaussNewtonResult {
                point: mut least,
                outcome: end,
                evaluations,
            } = last.run(there);
            work.evaluations += 1 + evaluations;
            work.accurate += 1 + evaluations;
            if least.gradients().next().is_none() && model.options.limit.reached() {
                break self.stopped_minimum(&coarse, &near, work);
            }
            let is_lost =
                end == GaussNewtonOutcome::Stuck(Some(ContinuationFailure::OtherEquilibrium));
            if is_lost
                && jumps < LOCAL_SEARCH.most_jumps
                && let Some(there) = model.relax_beyond_jump(&last.jumps, &least, weighting)
            {
                jumps += 1;
                attempts -= 1;
                CoarseModel {
                    model: coarse,
                    point,
                } = model.coarse_model(&there, weighting)?;
                continue;
            }
            let of_search =
                FitStatistics::new(&coarse, weighting, self.has_known_deviations, &near);
            let spread = self.statistics(&least).residual_deviation;
            let same = searched.outcome == GaussNewtonOutcome::Converged
                && of_search.residual_deviation < LOCAL_SEARCH.consistent_deviation * spread;
            if !same && end == GaussNewtonOutcome::Converged {
                // Its neighbourhood is computed with its own leaves.
                let differentiated = model.differentiate_data(&mut least);
                differentiated.map_err(|lost| model.no_equilibrium_error(&near.theta, 0, &lost))?;
            }
            let stats = self.statistics(&least);
            let shape = if same { &of_search } else { &stats };
            let contradicted = lack_of_fit::data_contradict_model(&stats);
            let parameters = match end {
                GaussNewtonOutcome::Converged if !contradicted => {
                    intervals::parameters_with_intervals(&stats, shape, progress)
                }
                _ => Ok(intervals::parameters_without_intervals(&stats)),
            };
            let (end, parameters) = match parameters {
                Ok(parameters) => (end, parameters),
                Err(better) if attempts < LOCAL_SEARCH.most_minima_abandoned => {
                    point = better;
                    continue;
                }
                Err(_) => (
                    GaussNewtonOutcome::StepLimit,
                    intervals::parameters_without_intervals(&stats),
                ),
            };
            let fit = assemble_fit(&stats, &end, parameters, work, self.candidates);
            break FitMinimum::new(&stats, fit, end == GaussNewtonOutcome::Converged);
        };
        if jumps > 0 {
            found.fit.remarks.push(FitRemark::JumpedOnTheWay);
        }
        Ok(found)
    }

    /// The point on coarse grids at which the limit of the run ended the search.
    fn stopped_minimum(&self, coarse: &FitModel, near: &FitPoint, work: FitWork) -> FitMinimum {
        let stats = FitStatistics::new(coarse, self.weighting, self.has_known_deviations, near);
        let parameters = intervals::parameters_without_intervals(&stats);
        let end = GaussNewtonOutcome::BudgetExhausted;
        let fit = assemble_fit(&stats, &end, parameters, work, &[]);
        FitMinimum::new(&stats, fit, false)
    }

    fn statistics<'p>(&'p self, point: &'p FitPoint) -> FitStatistics<'p, 'a> {
        FitStatistics::new(self.model, self.weighting, self.has_known_deviations, point)
    }
}

/// Whether a step beyond a bound that was not given is expected to reduce the sum of squares by more
/// than chance.
fn falls_beyond_window(stats: &FitStatistics) -> bool {
    let weighed = stats.weighting.weight_roots(&stats.residuals);
    let slopes = (stats.jacobian).tr_mul(&stats.residuals.component_mul(&weighed));
    let coordinates = stats.model.coordinates.iter().zip(&stats.point.theta);
    coordinates.enumerate().any(|(k, (free, theta))| {
        let [low, high] = free.bounds;
        let slope = slopes[k];
        let outwards = *theta <= low && slope > 0.0 || *theta >= high && slope < 0.0;
        let bend = stats.jacobian.column(k).norm_squared();
        let step = (slope.abs() / bend).min(LONGEST_COORDINATE_STEP);
        let gain = step * (2.0 * slope.abs() - bend * step);
        !free.has_given_bounds
            && outwards
            && gain > BETTER_MINIMUM_EXCESS * stats.residual_deviation.powi(2)
    })
}

impl FitModel<'_> {
    /// The leaves relaxed from their usual starts, beyond the values at which one of
    /// `before` would have to jump; or there, if another equilibrium exists. `None`
    /// if that does not reduce the residuals.
    pub fn relax_beyond_jump(
        &self,
        jumps: &[Vec<f64>],
        before: &FitPoint,
        weighting: Weighting,
    ) -> Option<FitPoint> {
        let residuals = weighting.residuals(before);
        let bound = weighting.huber_bound(&residuals);
        let sum = weighting.huber_sum(&residuals, bound);
        // The farthest are the steps that the data ask for; close to where a leaf buckles none is followed.
        let far = jumps.iter().take(LOCAL_SEARCH.most_jumps_relaxed);
        let near = jumps
            .iter()
            .skip(LOCAL_SEARCH.most_jumps_relaxed)
            .next_back();
        far.chain(near).chain([&before.theta]).find_map(|theta| {
            let there = self.relax_leaves(theta).ok()?;
            let nearer = weighting.huber_sum(&weighting.residuals(&there), bound) < sum;
            nearer.then_some(there)
        })
    }
}

/// Components of a weakly determined combination smaller than this part of its
/// largest are left out.
const NEGLIGIBLE_COEFFICIENT: f64 = 0.1;

pub(super) fn assemble_fit(
    stats: &FitStatistics,
    end: &GaussNewtonOutcome,
    mut parameters: Vec<FitParameter>,
    work: FitWork,
    wanted: &[Experiment],
) -> Fit {
    let base = stats.model.base;
    let coordinates = stats.model.coordinates;
    let mut remarks = fit_remarks(stats, end);
    let contradicted = *end == GaussNewtonOutcome::Converged && data_contradict_model(stats);
    let open = match end {
        GaussNewtonOutcome::Converged if !contradicted => {
            unidentifiable_combinations(stats, &parameters)
        }
        // Away from a minimum, the data may be insensitive to other combinations.
        _ => Vec::new(),
    };
    let systematic = match end {
        // What the data leave open comes first.
        GaussNewtonOutcome::Converged if open.is_empty() => {
            lack_of_fit::systematic_residuals(stats)
        }
        _ => None,
    };
    let mut says = result_sentences(&parameters, &open, coordinates);
    if let Some(found) = &systematic {
        lack_of_fit::widen_intervals(stats, &mut parameters, found.widened);
        // None of them is determined any more.
        says = result_sentences(&parameters, &open, coordinates);
        says.insert(0, lack_of_fit::systematic_residuals_sentence(stats, found));
    }
    if contradicted {
        says.insert(0, contradiction_sentence(stats));
    }
    let outcome = match end {
        GaussNewtonOutcome::Converged if contradicted => FitOutcome::Contradicted,
        GaussNewtonOutcome::Converged if systematic.is_some() => FitOutcome::Systematic,
        GaussNewtonOutcome::Converged
            if open.is_empty() && parameters.iter().all(|p| p.determined) =>
        {
            FitOutcome::Converged
        }
        GaussNewtonOutcome::Converged => FitOutcome::Undetermined,
        _ => FitOutcome::NotConverged,
    };
    let candidates = match statistics::rank_candidate_experiments(stats, wanted) {
        Ok(candidates) => candidates,
        Err(refused) => {
            remarks.push(FitRemark::Candidates(refused.to_string()));
            Vec::new()
        }
    };
    let values: Vec<(&ParameterKeys, f64)> = (coordinates.iter().zip(&stats.point.theta))
        .filter_map(|(free, theta)| {
            Some((free.number.scenario_keys()?, free.inverse_transform(*theta)))
        })
        .collect();
    Fit {
        scenario: base.scenario().name.clone(),
        outcome,
        remarks,
        correlations: stats.correlations(),
        undetermined: open
            .iter()
            .map(|open| combination_by_key(open, coordinates))
            .collect(),
        alternatives: Vec::new(),
        tried: Vec::new(),
        systematic,
        says,
        parameters,
        chi_squared: match stats.has_known_deviations {
            true => stats.residuals.norm_squared(),
            // In units of the deviation estimated from the residuals.
            false => {
                stats.residuals.norm_squared()
                    / stats.residual_deviation.powi(2).max(f64::MIN_POSITIVE)
            }
        },
        degrees_of_freedom: stats.degrees_of_freedom,
        coverage_factor: stats.coverage_factor,
        standard_deviation: (!stats.has_known_deviations)
            .then_some(stats.residual_deviation * stats.weighting.assumed_deviation),
        files: Vec::new(),
        experiments: fit_experiments(stats),
        residuals: fit_residuals(stats),
        candidates,
        work: FitWork {
            last: FitModel::solver_work(stats.point),
            ..work
        },
        wall_seconds: 0.0,
        fitted: base.toml(&values).unwrap_or_default(),
        leaves: fitted_leaves(stats),
    }
}

fn fit_remarks(stats: &FitStatistics, end: &GaussNewtonOutcome) -> Vec<FitRemark> {
    let mut remarks = Vec::new();
    match end {
        GaussNewtonOutcome::Converged => {}
        // The used-up budget is told once, by the search for the best minimum.
        GaussNewtonOutcome::BudgetExhausted => {}
        GaussNewtonOutcome::StepLimit => remarks.push(FitRemark::StepLimit),
        GaussNewtonOutcome::Stuck(Some(ContinuationFailure::OtherEquilibrium)) => {
            remarks.push(FitRemark::EndsAtJump);
        }
        GaussNewtonOutcome::Stuck(Some(ContinuationFailure::NotAtRest(why))) => {
            remarks.push(FitRemark::EndsWithoutEquilibrium(why.clone()));
        }
        GaussNewtonOutcome::Stuck(None) => remarks.push(FitRemark::NoSmallerResiduals),
    }
    for (free, theta) in stats.model.coordinates.iter().zip(&stats.point.theta) {
        if let Some(bound) = free.active_bound(*theta) {
            let (number, value) = (free.number.to_string(), free.inverse_transform(bound));
            remarks.push(match free.has_given_bounds {
                true => FitRemark::AtBound {
                    number,
                    bound: value,
                },
                false => FitRemark::WentFar { number, value },
            });
        }
    }
    remarks.extend(unit_mismatch_remarks(stats));
    if stats.degrees_of_freedom == 0 {
        remarks.push(FitRemark::NoFreedom);
    }
    if stats.has_known_deviations && stats.has_excessive_residuals() {
        remarks.push(FitRemark::ExcessiveResiduals {
            chi_squared: stats.residuals.norm_squared(),
            degrees_of_freedom: stats.degrees_of_freedom,
        });
    }
    if !stats.has_known_deviations && stats.degrees_of_freedom > 0 {
        remarks.extend(unequal_scatter_remark(stats));
    }
    remarks
}

/// Fewer data of a column do not tell how it scatters, nor do residuals below this part of the leaf's length, to which
/// equilibria are known.
const FEWEST_SCATTERED_DATA: usize = 3;
const SMALLEST_SCATTER: f64 = 1e-6;

/// Columns whose residuals differ by a larger factor do not have one standard deviation: of three data each, that of
/// equal ones differs so much in one of ten thousand cases.
const LARGEST_SCATTER_RATIO: f64 = 30.0;

/// The remark on columns that scatter differently, of data without standard deviations.
fn unequal_scatter_remark(stats: &FitStatistics) -> Option<FitRemark> {
    let mut sums: BTreeMap<String, (f64, usize)> = BTreeMap::new();
    for component in stats.point.components() {
        if component.is_uninformative || component.sd.is_some() {
            continue;
        }
        let (sum, count) = sums.entry(component.quantity.column()).or_default();
        *sum += (component.observed - component.model).powi(2);
        *count += 1;
    }
    let least = SMALLEST_SCATTER * longest(&stats.model.base.scenario().rods);
    let mut scatters: Vec<(f64, String)> = sums
        .into_iter()
        .filter(|(_, (_, count))| *count >= FEWEST_SCATTERED_DATA)
        .map(|(column, (sum, count))| ((sum / count as f64).sqrt(), column))
        .filter(|(scatter, _)| *scatter > least)
        .collect();
    scatters.sort_by(|a, b| a.0.total_cmp(&b.0));
    let [(small, smooth), .., (large, scattered)] = &scatters[..] else {
        return None;
    };
    let ratio = large / small;
    (ratio > LARGEST_SCATTER_RATIO).then(|| FitRemark::UnequalScatter {
        scattered: scattered.clone(),
        smooth: smooth.clone(),
        ratio,
    })
}

/// Data that are probably in other units than the scenario.
fn unit_mismatch_remarks(stats: &FitStatistics) -> Vec<FitRemark> {
    let base = stats.model.base;
    let longest = longest(&base.scenario().rods);
    let (mut beyond, mut missed) = (0, 0);
    for component in data_far_from_model(stats) {
        match component.quantity.dimension() == DatumDimension::Length {
            true if component.observed.abs() > FAR_FROM_BASE * longest => beyond += 1,
            true => missed += 1,
            false => {}
        }
    }
    let mut components = stats.point.components();
    let frequencies =
        components.any(|component| component.quantity.dimension() == DatumDimension::Frequency);
    let mut remarks = Vec::new();
    let length = longest;
    if beyond > 0 {
        let count = beyond;
        remarks.push(FitRemark::FarFromAnyLeaf { count, length });
    }
    if missed > 0 {
        let count = missed;
        remarks.push(FitRemark::FarFromFittedLeaf { count, length });
    }
    let given = |key: &str| {
        let keys = key.parse::<ParameterKeys>();
        keys.is_ok_and(|keys| base.scenario_with_values(&[(&keys, 1.0)]).is_ok())
    };
    if frequencies
        && !["scale:dynamics.density", "scale:section.mass_density"]
            .into_iter()
            .any(given)
    {
        remarks.push(FitRemark::NoDensity);
    }
    remarks
}

/// Undetermined combinations: those to which the data are insensitive, in their sparsest form,
/// and those with an uncertainty of more than a factor of ten.
fn unidentifiable_combinations(
    stats: &FitStatistics,
    parameters: &[FitParameter],
) -> Vec<UnidentifiableCombination> {
    let mut open: Vec<UnidentifiableCombination> = sparse_basis(
        &stats
            .singular_directions
            .columns(0, stats.insensitive_count)
            .into_owned(),
    )
    .into_iter()
    .map(|parts| UnidentifiableCombination {
        coefficients: parts,
        is_exact: true,
    })
    .collect();
    for direction in stats.insensitive_count..stats.singular_values.len() {
        if stats.coverage_factor * stats.residual_deviation / stats.singular_values[direction]
            > UNDETERMINED_UNCERTAINTY
        {
            let v = stats.singular_directions.column(direction);
            let largest = v.amax();
            let sign = v
                .iter()
                .find(|part| part.abs() == largest)
                .map_or(1.0, |p| p.signum());
            let parts = v.iter().map(|part| sign * part / largest).enumerate();
            let parts: Vec<_> = parts
                .filter(|(_, part)| part.abs() > NEGLIGIBLE_COEFFICIENT)
                .collect();
            // Whether a single number is determined its profile decides.
            if !matches!(parts[..], [(k, _)] if parameters[k].determined) {
                let exactly = false;
                open.push(UnidentifiableCombination {
                    coefficients: parts,
                    is_exact: exactly,
                });
            }
        }
    }
    // A number whose profile alone has no end.
    for (k, parameter) in parameters.iter().enumerate() {
        let named =
            |open: &UnidentifiableCombination| open.coefficients.iter().any(|(part, _)| *part == k);
        if !parameter.determined && !open.iter().any(named) {
            open.push(UnidentifiableCombination {
                coefficients: vec![(k, 1.0)],
                is_exact: false,
            });
        }
    }
    open
}

/// The experiments in the order of the data, which that of the leaves need not be.
fn experiments_in_data_order<'s>(stats: &'s FitStatistics) -> Vec<&'s ObservedExperiment> {
    let cases = stats.model.cases.iter();
    let mut observed: Vec<_> = cases.flat_map(|case| &case.experiments).collect();
    observed.sort_by_key(|it| it.number);
    observed
}

fn fit_experiments(stats: &FitStatistics) -> Vec<ExperimentConditions> {
    let experiment = |observed: &ObservedExperiment| {
        let settings = observed.experiment.settings.iter();
        ExperimentConditions {
            experiment: observed.experiment.name.clone(),
            settings: settings
                .map(|(keys, value)| (keys.to_string(), *value))
                .collect(),
        }
    };
    experiments_in_data_order(stats)
        .into_iter()
        .map(experiment)
        .collect()
}

fn fit_residuals(stats: &FitStatistics) -> Vec<FitResidual> {
    let mut all: Vec<_> = stats
        .point
        .components()
        .zip(stats.confidence_bands())
        .collect();
    all.sort_by_key(|(component, _)| component.experiment);
    let observed = experiments_in_data_order(stats);
    let of = |number: usize| {
        let found = observed.binary_search_by_key(&number, |it| it.number);
        found.map_or_else(|_| String::new(), |at| observed[at].experiment.name.clone())
    };
    all.into_iter()
        .map(|(component, band)| {
            let sd = stats.datum_deviation(component);
            let (rod, sigma) = match component.quantity {
                DatumQuantity::Result(_) => (None, None),
                DatumQuantity::Vein { rod, sigma, .. } => (Some(rod + 1), Some(sigma)),
            };
            FitResidual {
                experiment: of(component.experiment),
                number: component.experiment + 1,
                what: component.quantity.column(),
                rod,
                sigma,
                data: component.observed,
                model: component.model,
                band,
                sd,
                residual: (component.observed - component.model) / sd,
            }
        })
        .collect()
}

fn fitted_leaves(stats: &FitStatistics) -> Vec<(String, FitLeaf)> {
    let mut leaves = Vec::new();
    for (case, at) in stats.model.cases.iter().zip(&stats.point.case_solutions) {
        let Some(finest) = at.equilibrium.levels.last() else {
            continue;
        };
        let length = finest.leaf.leaf.scale.length;
        let nodes = finest.leaf.segments() + 1;
        let curves = finest.state.x.chunks(nodes);
        let curves = curves.map(|rod| rod.iter().map(|x| *x * length).collect());
        let curves: Vec<_> = curves.collect();
        let view = at.photo_projection();
        for observed in &case.experiments {
            let traced = observed.traced.iter();
            let leaf = FitLeaf {
                number: observed.number + 1,
                settings: observed.experiment.settings.clone(),
                curves: curves.clone(),
                traced: { traced }
                    .map(|traced| (traced.rod, view.position_in_space(&traced.coordinates)))
                    .collect(),
            };
            leaves.push((observed.number, observed.experiment.name.clone(), leaf));
        }
    }
    leaves.sort_by_key(|(number, ..)| *number);
    let leaves = leaves.into_iter();
    leaves.map(|(_, name, leaf)| (name, leaf)).collect()
}

/// An undetermined combination: coordinates and their coefficients.
pub(super) struct UnidentifiableCombination {
    /// Index of the free number, and its coefficient; the largest is one.
    pub coefficients: Vec<(usize, f64)>,
    /// Whether the data are completely insensitive to it, or only weakly sensitive.
    pub is_exact: bool,
}

/// The combination in the form of the result.
pub(super) fn combination_by_key(
    open: &UnidentifiableCombination,
    free: &[FitCoordinate],
) -> BTreeMap<String, f64> {
    let part = |&(k, part): &(usize, f64)| {
        (
            free[k].number.to_string(),
            round_coefficient(part * free[k].unit),
        )
    };
    open.coefficients.iter().map(part).collect()
}

/// Removes rounding errors from a simple number.
fn round_coefficient(value: f64) -> f64 {
    let digits = (value * 1e4).round() / 1e4;
    if (digits - value).abs() < 1e-4 * value.abs().max(1e-3) {
        digits
    } else {
        value
    }
}

/// Smaller coefficients would be written as zero.
const SMALLEST_WRITTEN_COEFFICIENT: f64 = 5e-3;

/// A sentence for each number and each undetermined combination.
/// What is said first of data that contradict the model.
fn contradiction_sentence(stats: &FitStatistics) -> String {
    let (sum, freedom) = (stats.residuals.norm_squared(), stats.degrees_of_freedom);
    let sum = format_two_digits(sum);
    match stats.has_known_deviations {
        true => format!(
            "the data contradict the model: the squares of their residuals, in standard deviations, sum up to {sum}, \
             and {freedom} are expected; intervals mean nothing"
        ),
        false => {
            "the data contradict the model: it is far from most of them; intervals mean nothing"
                .into()
        }
    }
}

pub(super) fn result_sentences(
    parameters: &[FitParameter],
    open: &[UnidentifiableCombination],
    free: &[FitCoordinate],
) -> Vec<String> {
    let mut said = Vec::new();
    for (k, parameter) in parameters.iter().enumerate() {
        let (low, high) = match (parameter.low, parameter.high) {
            (Some(low), Some(high)) if parameter.determined => (low, high),
            _ => continue,
        };
        let half = 0.5 * (high - low);
        let key = &parameter.key;
        said.push(match free[k].is_logarithmic {
            true => format!("{key}: to {}", format_percent(half / parameter.value.abs())),
            false => format!("{key}: to {}", format_two_digits(half)),
        });
    }
    said.extend(parameters.iter().flat_map(unknown_endpoint_sentences));
    for open in open {
        said.push(combination_sentence(open, parameters, free));
    }
    said
}

fn format_percent(part: f64) -> String {
    match 100.0 * part {
        percent if percent >= 10.0 => format!("{percent:.0} %"),
        percent if percent >= 0.1 => format!("{percent:.1} %"),
        percent => format!("{percent:.3} %"),
    }
}

fn combination_sentence(
    open: &UnidentifiableCombination,
    parameters: &[FitParameter],
    free: &[FitCoordinate],
) -> String {
    let key = |k: usize| parameters[k].key.as_str();
    let parts = open.coefficients.iter().copied();
    let parts: Vec<_> = parts
        .filter(|(_, part)| part.abs() >= SMALLEST_WRITTEN_COEFFICIENT)
        .collect();
    let all_logs = parts.iter().all(|(k, _)| free[*k].is_logarithmic);
    match parts.as_slice() {
        [(k, _)] if open.is_exact => format!("{}: not at all", key(*k)),
        [(k, _)] if is_at_bound(&parameters[*k], &free[*k]) => format!(
            "{}: not, as it stands at its bound {}",
            key(*k),
            round_to_three_digits(parameters[*k].value)
        ),
        [(k, _)] => match (parameters[*k].low, parameters[*k].high) {
            _ if parameters[*k].lost.iter().any(Option::is_some) => {
                format!("{}: not known, as an end of its interval is not", key(*k))
            }
            (Some(low), None) => format!(
                "{}: only that it is above {}",
                key(*k),
                format_two_digits(low)
            ),
            (None, Some(high)) => {
                format!(
                    "{}: only that it is below {}",
                    key(*k),
                    format_two_digits(high)
                )
            }
            _ => format!("{}: hardly, to no better than a factor of ten", key(*k)),
        },
        [(a, one), (b, two)] if all_logs && (one.abs() - two.abs()).abs() < 1e-3 => {
            let only = if one * two > 0.0 { "ratio" } else { "product" };
            let how = if open.is_exact { "" } else { "nearly " };
            let [first, second] = [*a, *b].map(|k| parameters[k].value);
            let value = match only {
                "ratio" => first / second,
                _ => first * second,
            };
            let value = round_to_three_digits(value);
            format!(
                "{} and {}: {how}only as their {only}, {value}",
                key(*a),
                key(*b)
            )
        }
        parts => {
            // In numbers that are not logarithms the combination is a tangent.
            let change = |(k, part): &(usize, f64)| match free[*k].is_logarithmic {
                true => format!(
                    "{} in proportion to t^{}",
                    key(*k),
                    format_two_decimals(*part)
                ),
                false => format!(
                    "{} by {} ln t",
                    key(*k),
                    round_to_three_digits(part * free[*k].unit)
                ),
            };
            let changes: Vec<String> = parts.iter().map(change).collect();
            let unseen = if open.is_exact {
                "unseen"
            } else {
                "hardly seen"
            };
            let which = if all_logs { "any t" } else { "t near 1" };
            format!("{unseen}: {} together, for {which}", changes.join(", "))
        }
    }
}

/// Which ends of an interval are not known.
fn unknown_endpoint_sentences(parameter: &FitParameter) -> Vec<String> {
    let sides = parameter.lost.iter().zip(["below", "above"]);
    let lost = sides.filter_map(|(lost, side)| Some((round_to_three_digits((*lost)?), side)));
    lost.map(|(lost, side)| {
        format!(
            "{}: where its interval ends {side} is not known: held beyond {lost}, the other numbers \
             could not be fitted",
            parameter.key
        )
    })
    .collect()
}

/// Whether a number stands at a bound that was given.
fn is_at_bound(parameter: &FitParameter, free: &FitCoordinate) -> bool {
    let bounds = free.bounds.map(|bound| free.inverse_transform(bound));
    free.has_given_bounds && bounds.contains(&parameter.value)
}

fn format_two_decimals(value: f64) -> String {
    let text = format!("{value:.2}");
    text.trim_end_matches('0').trim_end_matches('.').into()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is said of a combination of logarithms.
    fn said(parts: &[(&str, f64)]) -> String {
        let coordinate = |(key, _): &(&str, f64)| FitCoordinate {
            number: key.parse().unwrap(),
            is_logarithmic: true,
            unit: 1.0,
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
            has_given_bounds: false,
            initial: 0.0,
        };
        let parameter = |(key, _): &(&str, f64)| FitParameter {
            key: (*key).into(),
            value: 1.0,
            low: None,
            high: None,
            standard_error: None,
            determined: false,
            profiled: false,
            lost: [None; 2],
        };
        let free: Vec<FitCoordinate> = parts.iter().map(coordinate).collect();
        let parameters: Vec<FitParameter> = parts.iter().map(parameter).collect();
        let coefficients = parts.iter().map(|part| part.1).enumerate();
        let open = UnidentifiableCombination {
            coefficients: coefficients.collect(),
            is_exact: true,
        };
        combination_sentence(&open, &parameters, &free)
    }

    #[test]
    fn what_does_not_change_is_left_out() {
        let [a, b, c] = ["stiffness.torsion", "stiffness.axial", "coupling.y"];
        let together = said(&[(a, 1.0), (b, 0.002), (c, 0.5)]);
        assert!(together.contains("torsion") && together.contains("t^0.5"));
        assert!(!together.contains("axial"), "{together}");
        assert_eq!(said(&[(a, 1.0), (b, -0.002)]), format!("{a}: not at all"));
        let ratio = said(&[(a, 1.0), (b, 1.0), (c, 0.001)]);
        assert_eq!(ratio, format!("{a} and {b}: only as their ratio, 1"));
    }
}
