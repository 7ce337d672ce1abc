//! Intervals of the free numbers: from the curvature at the minimum if the sum of squares is quadratic,
//! else from its profile, the least sum for each value of one number.
//!
//! The ends of a profile are first sought from a few points around the minimum, with derivatives at few of
//! them; if that fails, by whole fits: the number is held at one distance from the minimum after another,
//! and all others are fitted again.

use crate::study::fit::least_squares::{
    GaussNewtonIteration, GaussNewtonOutcome, GaussNewtonResult,
};
use crate::study::fit::model::{FitPoint, MOST_RELAXATION_STEPS};
use crate::study::fit::result::{FitParameter, FitStep};
use crate::study::fit::statistics::{
    BETTER_MINIMUM_EXCESS, ConstrainedMinimum, DifferentiatedPoint, EvaluatedPoint, FitStatistics,
    GaussNewtonModel, MinimumNeighbourhood, UNDETERMINED_UNCERTAINTY, normalized_excess,
};
use nalgebra::DVector;

/// The free numbers with their intervals. The shape of the sum of squares away from
/// the minimum is taken from `shape`, which may be a minimum on coarser grids.
///
/// # Errors
/// A point from which a better minimum is reached.
pub(super) fn parameters_with_intervals(
    stats: &FitStatistics,
    shape: &FitStatistics,
    progress: &mut dyn FnMut(&FitStep),
) -> Result<Vec<FitParameter>, FitPoint> {
    let near = MinimumNeighbourhood::new(shape);
    let all = stats.singular_values.len();
    (0..all)
        .map(|k| {
            let known = Some((k, all));
            let mut profiling = |step, sum| {
                progress(&FitStep {
                    step,
                    sum,
                    known,
                    budget: None,
                })
            };
            parameter_with_interval(stats, shape, near.as_ref(), k, &mut profiling)
        })
        .collect()
}

/// The free numbers without a minimum: nothing is known of them but the given bounds.
pub(super) fn parameters_without_intervals(stats: &FitStatistics) -> Vec<FitParameter> {
    (0..stats.singular_values.len())
        .map(|k| parameter_without_interval(stats, k))
        .collect()
}

fn parameter_without_interval(stats: &FitStatistics, k: usize) -> FitParameter {
    let free = &stats.model.coordinates[k];
    let given = |bound: f64| free.has_given_bounds.then(|| free.inverse_transform(bound));
    let [low, high] = free.bounds.map(given);
    FitParameter {
        key: free.number.to_string(),
        value: free.inverse_transform(stats.point.theta[k]),
        low,
        high,
        standard_error: None,
        determined: false,
        profiled: false,
        lost: [None; 2],
    }
}

fn parameter_with_interval(
    stats: &FitStatistics,
    shape: &FitStatistics,
    near: Option<&MinimumNeighbourhood>,
    k: usize,
    progress: &mut dyn FnMut(usize, f64),
) -> Result<FitParameter, FitPoint> {
    let free = &stats.model.coordinates[k];
    let theta = stats.point.theta[k];
    let mut parameter = parameter_without_interval(stats, k);
    if !stats.is_sensitive_to(k) {
        return Ok(parameter);
    }
    let (low, high) = (parameter.low, parameter.high);
    let own = stats.uncertainty(k).deviation;
    parameter.standard_error = Some(own * free.value_derivative(theta));
    let half = stats.coverage_factor * own;
    let mut sides = [ProfileEndpoint::End(half); 2];
    let near_minimum = shape.uncertainty(k);
    let along = &near_minimum.correlated_changes;
    let first = shape.coverage_factor * near_minimum.deviation;
    let few = match near {
        Some(near) => interval_endpoints(near, k, first, half),
        None if half > UNDETERMINED_UNCERTAINTY || !is_quadratic_at_ends(shape, along, first) => {
            Some([Err(half), Err(half)])
        }
        None => None,
    };
    let runaways: Vec<usize> = (0..stats.singular_values.len())
        .filter(|&j| j != k && shape.is_runaway(j))
        .collect();
    let vague = (0..stats.singular_values.len()).any(|j| j != k && shape.is_weakly_determined(j));
    // Derivatives do not lead to values far away at which the sum is lower, and ends are too near.
    let few = match runaways.is_empty() && !vague {
        true => few,
        false => {
            let guess = |side: Result<ProfileEndpoint, f64>| match side {
                Ok(ProfileEndpoint::End(end)) => Err(end),
                other => other,
            };
            Some(few.map_or([Err(first); 2], |sides| sides.map(guess)))
        }
    };
    if let Some(found) = few {
        parameter.profiled = true;
        let profile = LikelihoodProfile {
            stats: shape,
            k,
            along: &shape.conditional_changes(k),
            runaways: &runaways,
        };
        for ((side, sign), found) in sides.iter_mut().zip([-1.0, 1.0]).zip(found) {
            *side = match found {
                Ok(found) => found,
                Err(guess) => profile.find_endpoint(sign * guess, progress)?,
            };
        }
    }
    let end = |side: ProfileEndpoint, sign: f64, bound: f64, given: Option<f64>| {
        let end = match side {
            ProfileEndpoint::End(reach) => Some(theta + sign * reach),
            ProfileEndpoint::Open | ProfileEndpoint::Lost(_) => None,
        };
        // Outside the possible or permitted range.
        let inside = end.filter(|end| (bound - end) * sign >= 0.0);
        inside.map_or(given, |end| Some(free.inverse_transform(end)))
    };
    let lost = |side: ProfileEndpoint, sign: f64| match side {
        ProfileEndpoint::Lost(reach) => Some(free.inverse_transform(theta + sign * reach)),
        ProfileEndpoint::End(_) | ProfileEndpoint::Open => None,
    };
    let [down, up] = sides;
    parameter.lost = [lost(down, -1.0), lost(up, 1.0)];
    parameter.low = end(down, -1.0, free.bounds[0], low);
    parameter.high = end(up, 1.0, free.bounds[1], high);
    let near = |end: Option<f64>| {
        end.is_some_and(|end| (free.transform(end) - theta).abs() <= UNDETERMINED_UNCERTAINTY)
    };
    // A bound at which the number stands is not an end that the data give.
    let at_bound = free.active_bound(theta).is_some();
    parameter.determined = !at_bound && near(parameter.low) && near(parameter.high);
    Ok(parameter)
}

/// Whether the sum of squares at the ends of an interval agrees with the quadratic
/// approximation at the minimum.
fn is_quadratic_at_ends(stats: &FitStatistics, along: &DVector<f64>, half: f64) -> bool {
    let expected = stats.coverage_factor.powi(2);
    [-half, half].into_iter().all(|step| {
        let theta = stats.model.bounded_update(&stats.point.theta, step, along);
        let there = stats.model.continue_leaves(stats.point, &theta);
        let above = there.map(|point| normalized_excess(stats, &point));
        above.is_ok_and(|above| (above / expected - 1.0).abs() < QUADRATIC_DEVIATION_LIMIT)
    })
}

/// Largest relative deviation of the sum of squares from a quadratic at the ends of an interval;
/// beyond it the interval is taken from the profile of the sum.
pub(super) const QUADRATIC_DEVIATION_LIMIT: f64 = 0.15;

/// The search for an end of an interval from a few points.
struct EndpointSearchLimits {
    /// Largest number of points before the full profile is computed.
    most_points: usize,
    /// The sum is the least one if a correction can still reduce it by less than this part.
    settled_reduction: f64,
    /// Relative accuracy of the distance of the end.
    accuracy: f64,
    /// A correction that leaves more than this part of the expected reduction has failed.
    failed_correction: f64,
    /// The part of a correction that went too far, taken next.
    shortening: f64,
    /// Largest number of points at which leaves are lost.
    most_lost_leaves: usize,
    /// A sum with a smaller relative error needs no further evaluation, as a part of the deviation
    /// from a quadratic that is allowed.
    clear_sum_error: f64,
}

const ENDPOINT_SEARCH: EndpointSearchLimits = EndpointSearchLimits {
    most_points: 14,
    settled_reduction: 0.1,
    accuracy: 0.03,
    failed_correction: 0.5,
    shortening: 0.5,
    most_lost_leaves: 3,
    clear_sum_error: 0.3,
};

/// Where a profile ends on one side of the minimum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ProfileEndpoint {
    /// At this distance.
    End(f64),
    /// Not within a factor of ten, nor before a bound.
    Open,
    /// Beyond this distance, up to which it does not, the other numbers could not be fitted.
    Lost(f64),
}

/// The ends of an interval below and above, from a few points around the minimum; as errors,
/// approximate distances that are not confirmed. `None` if they are those of the quadratic
/// approximation.
pub(super) fn interval_endpoints(
    near: &MinimumNeighbourhood,
    k: usize,
    first: f64,
    half: f64,
) -> Option<[Result<ProfileEndpoint, f64>; 2]> {
    let stats = near.stats;
    let slopes = near.gauss_newton_model();
    let along = stats.conditional_changes(k);
    let mut known: Option<EvaluatedPoint> = None;
    if half <= UNDETERMINED_UNCERTAINTY {
        let expected = stats.coverage_factor.powi(2);
        let off = |above: f64| (above / expected - 1.0).abs();
        let change = &along * first;
        let Ok(up) = near.residuals(stats.point, &near.bounded_update(&change)) else {
            return Some([Err(half), Err(half)]);
        };
        // By reflection, to second order.
        let linear = &stats.jacobian * change;
        let down = &up.residuals - &linear - &linear;
        let sides = [&up.residuals, &down]
            .map(|residuals| near.constrained_minimum(&slopes, k, residuals, f64::INFINITY));
        let clear = |least: &Option<ConstrainedMinimum>| {
            (least.as_ref()).is_some_and(|least| {
                off(least.excess) < ENDPOINT_SEARCH.clear_sum_error * QUADRATIC_DEVIATION_LIMIT
            })
        };
        if sides.iter().all(clear) {
            return None;
        }
        known = Some(up);
    }
    let [low, high] = stats.model.coordinates[k].bounds;
    let theta = stats.point.theta[k];
    let distance = |sign: f64, room: f64, known: Option<EvaluatedPoint>| {
        let most = (UNDETERMINED_UNCERTAINTY + 0.1).min(room);
        let search = EndpointSearch {
            neighbourhood: near,
            k,
            at_minimum: &slopes,
            along: &along,
            sign,
            most,
            distance: first.min(most),
            curvature: DVector::zeros(along.len()),
            previous: ProfileRoot {
                distance: 0.0,
                root: 0.0,
            },
            derivatives_elsewhere: None,
            longest: f64::INFINITY,
            last: ProfileCorrection {
                length: 0.0,
                from: f64::INFINITY,
                gain: f64::INFINITY,
            },
        };
        search.run(known.filter(|_| first <= most))
    };
    let down = distance(-1.0, theta - low, None);
    let up = distance(1.0, high - theta, known);
    let quadratic =
        half <= UNDETERMINED_UNCERTAINTY && [down, up] == [Ok(ProfileEndpoint::End(first)); 2];
    (!quadratic).then_some([down, up])
}

/// Search for the end of a profile on one side: along a parabola from the minimum, which
/// is corrected towards the least sum. Derivatives are those of the minimum until an end
/// is near, and then those where they last proved inaccurate.
struct EndpointSearch<'s, 'j, 'm, 'a> {
    neighbourhood: &'s MinimumNeighbourhood<'j, 'm, 'a>,
    k: usize,
    at_minimum: &'s GaussNewtonModel,
    along: &'s DVector<f64>,
    sign: f64,
    /// Upper limit of the distance.
    most: f64,
    /// Present estimate of the distance of the end.
    distance: f64,
    curvature: DVector<f64>,
    previous: ProfileRoot,
    /// Where derivatives are known, if not only at the minimum.
    derivatives_elsewhere: Option<DifferentiatedPoint>,
    longest: f64,
    last: ProfileCorrection,
}

/// The sum of squares at a distance from the minimum.
struct ProfileRoot {
    distance: f64,
    /// The root of its excess, normalized to one at an end of the interval.
    root: f64,
}

/// A correction of the other numbers towards the least sum.
struct ProfileCorrection {
    length: f64,
    /// The sum before it, and its expected reduction.
    from: f64,
    gain: f64,
}

struct EndpointSearchFailure;

/// The result at a point: the end if this is it, or none, if another point follows.
type EndpointSearchStep = Result<Option<ProfileEndpoint>, EndpointSearchFailure>;

impl EndpointSearch<'_, '_, '_, '_> {
    /// Finds the end; `known` is the point at the first guess.
    ///
    /// # Errors
    /// The approximate distance of the end, if the search does not converge.
    fn run(mut self, mut known: Option<EvaluatedPoint>) -> Result<ProfileEndpoint, f64> {
        if self.most <= 0.0 {
            return Ok(ProfileEndpoint::Open);
        }
        let mut lost = 0;
        for step in 0..ENDPOINT_SEARCH.most_points {
            let Some(found) = known.take().or_else(|| self.leaves_at_estimate()) else {
                lost += 1;
                if lost > ENDPOINT_SEARCH.most_lost_leaves {
                    break;
                }
                self.distance = 0.5 * (self.previous.distance + self.distance);
                continue;
            };
            match self.evaluate(step == 0, found) {
                Ok(None) => {}
                Ok(Some(end)) => return Ok(end),
                Err(EndpointSearchFailure) => break,
            }
        }
        Err(self.distance)
    }

    /// The leaves at the present estimate of the end.
    fn leaves_at_estimate(&self) -> Option<EvaluatedPoint> {
        let change =
            self.along * (self.sign * self.distance) + &self.curvature * self.distance.powi(2);
        let from = match &self.derivatives_elsewhere {
            Some(elsewhere) => &elsewhere.point,
            None => self.neighbourhood.stats.point,
        };
        let found = self
            .neighbourhood
            .residuals(from, &self.neighbourhood.bounded_update(&change));
        found.ok()
    }

    fn constrained_minimum(
        &self,
        residuals: &DVector<f64>,
    ) -> Result<ConstrainedMinimum, EndpointSearchFailure> {
        let slopes = match &self.derivatives_elsewhere {
            Some(elsewhere) => &elsewhere.model,
            None => self.at_minimum,
        };
        let least = self
            .neighbourhood
            .constrained_minimum(slopes, self.k, residuals, self.longest);
        least.ok_or(EndpointSearchFailure)
    }

    /// Whether the sum is the least one, and that of an end.
    fn is_converged(&self, least: &ConstrainedMinimum) -> bool {
        let corrected = least.excess_without_correction - least.excess
            < ENDPOINT_SEARCH.settled_reduction * least.excess;
        corrected && (self.normalized_root(least) - 1.0).abs() < ENDPOINT_SEARCH.accuracy
    }

    /// The root of the sum, normalized to one at an end.
    fn normalized_root(&self, least: &ConstrainedMinimum) -> f64 {
        least.excess.max(0.0).sqrt() / self.neighbourhood.stats.coverage_factor
    }

    fn evaluate(&mut self, first: bool, found: EvaluatedPoint) -> EndpointSearchStep {
        let EvaluatedPoint { residuals, point } = found;
        let wanted = self.neighbourhood.stats.coverage_factor.powi(2);
        let mut least = self.constrained_minimum(&residuals)?;
        if least.excess_without_correction < -BETTER_MINIMUM_EXCESS {
            return Err(EndpointSearchFailure);
        }
        if self.distance >= self.most && least.excess_without_correction < wanted {
            return Ok(Some(ProfileEndpoint::Open));
        }
        if first && (least.excess / wanted - 1.0).abs() < QUADRATIC_DEVIATION_LIMIT {
            return Ok(Some(ProfileEndpoint::End(self.distance)));
        }
        let gain = least.excess_without_correction - least.excess;
        let stagnates = self.derivatives_elsewhere.is_some()
            && gain > ENDPOINT_SEARCH.failed_correction * self.last.gain;
        if stagnates || self.is_converged(&least) {
            // With the derivatives there the sum may be reduced further.
            self.derivatives_elsewhere = Some(
                self.neighbourhood
                    .gauss_newton_model_at(point)
                    .map_err(|_| EndpointSearchFailure)?,
            );
            least = self.constrained_minimum(&residuals)?;
            if self.is_converged(&least) {
                return Ok(Some(ProfileEndpoint::End(self.distance)));
            }
        }
        if stagnates {
            // The last correction went too far, or not far enough.
            self.longest = match least.excess_without_correction > self.last.from {
                true => ENDPOINT_SEARCH.shortening * self.last.length,
                false => 2.0 * self.longest,
            };
            least = self.constrained_minimum(&residuals)?;
        }
        self.advance(&least)
    }

    fn advance(&mut self, least: &ConstrainedMinimum) -> EndpointSearchStep {
        self.last = ProfileCorrection {
            length: least.correction.norm(),
            from: least.excess_without_correction,
            gain: least.excess_without_correction - least.excess,
        };
        self.curvature += &least.correction / self.distance.powi(2);
        // The root of the sum is nearly linear.
        let root = self.normalized_root(least);
        let secant = (root - self.previous.root) / (self.distance - self.previous.distance);
        let wanted = self.neighbourhood.stats.coverage_factor.powi(2);
        let next = match &self.derivatives_elsewhere {
            None if secant > 0.0 => self.distance + (1.0 - root) / secant,
            _ => self.distance + self.sign * least.step_to_excess(wanted, self.sign),
        };
        if !next.is_finite() {
            return Err(EndpointSearchFailure);
        }
        self.previous = ProfileRoot {
            distance: self.distance,
            root,
        };
        self.distance = next
            .clamp(0.5 * self.distance, 2.0 * self.distance)
            .min(self.most);
        Ok(None)
    }
}

/// The search for an end of an interval by whole fits.
struct ProfileLimits {
    /// Largest number of distances at which the number is held.
    most_steps: usize,
    /// Largest number of steps of the fit at each distance.
    most_iterations: usize,
    /// Accuracy of the least sum of squares there, in variances.
    sum_accuracy: f64,
    /// Relative accuracy of the distance of the end.
    accuracy: f64,
    /// Largest number of distances at which the other numbers cannot be fitted.
    most_lost_distances: usize,
    /// Number of smaller steps by which leaves are followed to such a distance.
    substeps_after_loss: usize,
    /// Where fits begin again for numbers that ran away: so far on the way from their initial
    /// values.
    restart_fractions: [f64; 3],
}

const PROFILE: ProfileLimits = ProfileLimits {
    most_steps: 16,
    most_iterations: 25,
    sum_accuracy: 1e-2,
    accuracy: 0.01,
    most_lost_distances: 6,
    substeps_after_loss: 4,
    restart_fractions: [1.0 / 3.0, 0.0, 2.0 / 3.0],
};

/// The profile of the sum of squares along a number.
pub(super) struct LikelihoodProfile<'s, 'm, 'a> {
    pub stats: &'s FitStatistics<'m, 'a>,
    pub k: usize,
    /// The changes of all numbers per change of this one.
    pub along: &'s DVector<f64>,
    /// Other numbers that ran away: there the data hardly feel them, and derivatives do not lead
    /// back to values at which the sum would be lower.
    pub runaways: &'s [usize],
}

struct ProfilePoint {
    distance: f64,
    /// The root of the sum, normalized to one at an end.
    root: f64,
    /// None at the minimum.
    point: Option<FitPoint>,
}

impl LikelihoodProfile<'_, '_, '_> {
    /// The end of an interval: where the excess of the profile (the least sum of squares over all
    /// other numbers) is that at the end of a normal one. `first` is a guess of its distance, with
    /// its sign.
    ///
    /// # Errors
    /// A point with a lower sum than the minimum.
    pub fn find_endpoint(
        &self,
        first: f64,
        progress: &mut dyn FnMut(usize, f64),
    ) -> Result<ProfileEndpoint, FitPoint> {
        let sign = first.signum();
        let most = (UNDETERMINED_UNCERTAINTY + 0.1).min(self.distance_to_bound(sign));
        if most <= 0.0 {
            return Ok(ProfileEndpoint::Open);
        }
        let mut reach = first.abs().min(most);
        let mut inside = ProfilePoint {
            distance: 0.0,
            root: 0.0,
            point: None,
        };
        let mut outside: Option<ProfilePoint> = None;
        // The nearest distance at which all fits failed.
        let mut lost = f64::INFINITY;
        let mut failures = 0;
        for _ in 0..PROFILE.most_steps {
            if self.stats.model.must_end() {
                return Ok(ProfileEndpoint::Lost(inside.distance));
            }
            let least = self.constrained_minimum(sign * reach, &inside, outside.as_ref(), progress);
            let Some(mut least) = least else {
                failures += 1;
                if failures > PROFILE.most_lost_distances {
                    break;
                }
                lost = reach;
                reach = 0.5 * (inside.distance + reach);
                continue;
            };
            if self.normalized_root(&least) > 1.0 - PROFILE.accuracy {
                least = self.restart_runaways(&least, progress).unwrap_or(least);
            }
            if normalized_excess(self.stats, &least) < -BETTER_MINIMUM_EXCESS {
                return Err(least);
            }
            let root = self.normalized_root(&least);
            if (root - 1.0).abs() < PROFILE.accuracy {
                return Ok(ProfileEndpoint::End(reach));
            }
            let known = ProfilePoint {
                distance: reach,
                root,
                point: Some(least),
            };
            match root < 1.0 {
                true => inside = known,
                false => outside = Some(known),
            }
            reach = match &outside {
                None if reach >= most => return Ok(ProfileEndpoint::Open),
                None => {
                    let next = (reach / root.max(0.3) * 1.05).min(most);
                    next.min(0.5 * (reach + lost))
                }
                // The root of the sum is nearly linear.
                Some(outside) => {
                    let part = (1.0 - inside.root) / (outside.root - inside.root);
                    let width = outside.distance - inside.distance;
                    inside.distance + part.clamp(0.1, 0.9) * width
                }
            };
        }
        Ok(match outside {
            Some(outside) if failures <= PROFILE.most_lost_distances => {
                ProfileEndpoint::End(outside.distance)
            }
            _ => ProfileEndpoint::Lost(inside.distance),
        })
    }

    /// The root of the sum, normalized to one at an end.
    fn normalized_root(&self, least: &FitPoint) -> f64 {
        normalized_excess(self.stats, least).max(0.0).sqrt() / self.stats.coverage_factor
    }

    /// The distance of the bound on one side.
    fn distance_to_bound(&self, sign: f64) -> f64 {
        let [low, high] = self.stats.model.coordinates[self.k].bounds;
        let theta = self.stats.point.theta[self.k];
        match sign < 0.0 {
            true => theta - low,
            false => high - theta,
        }
    }

    /// The minimum over all other numbers at a distance from the minimum of all, with its sign. If it
    /// is not reached from inside, it is approached in smaller steps, from outside, and with leaves
    /// relaxed from their usual starts. `None` if all that fails.
    fn constrained_minimum(
        &self,
        distance: f64,
        inside: &ProfilePoint,
        outside: Option<&ProfilePoint>,
        progress: &mut dyn FnMut(usize, f64),
    ) -> Option<FitPoint> {
        let from = inside.point.as_ref().unwrap_or(self.stats.point);
        let sign = distance.signum();
        let step = distance - sign * inside.distance;
        let behind = outside.and_then(|known| {
            let step = distance - sign * known.distance;
            Some((known.point.as_ref()?, step))
        });
        let along = |from: &FitPoint, step: f64| {
            self.stats
                .model
                .bounded_update(&from.theta, step, self.along)
        };
        let followed = |from: &FitPoint, step: f64| {
            self.stats
                .model
                .continue_leaves(from, &along(from, step))
                .ok()
        };
        let relaxed = |theta: &[f64]| {
            self.stats
                .model
                .relax_leaves_within_steps(theta, MOST_RELAXATION_STEPS)
                .ok()
        };
        let initial = || {
            let mut theta = self.initial_values();
            theta[self.k] = along(from, step)[self.k];
            theta
        };
        let ways: [&dyn Fn() -> Option<FitPoint>; 5] = [
            &|| followed(from, step),
            &|| self.continue_in_substeps(from, step),
            &|| behind.and_then(|(point, step)| followed(point, step)),
            &|| relaxed(&along(from, step)),
            &|| relaxed(&initial()),
        ];
        ways.into_iter().find_map(|way| {
            let least = self.minimize_over_others(way()?, progress);
            let converged = least.outcome == GaussNewtonOutcome::Converged;
            // Without a minimum there, the least sum is still no larger.
            (converged || self.normalized_root(&least.point) < 1.0).then_some(least.point)
        })
    }

    /// A point followed in smaller steps, at each of which the derivatives are new.
    fn continue_in_substeps(&self, from: &FitPoint, step: f64) -> Option<FitPoint> {
        let model = self.stats.model;
        let mut there: Option<FitPoint> = None;
        for part in 1..=PROFILE.substeps_after_loss {
            let part = part as f64 / PROFILE.substeps_after_loss as f64;
            let theta = model.bounded_update(&from.theta, part * step, self.along);
            let mut next = model
                .continue_leaves(there.as_ref().unwrap_or(from), &theta)
                .ok()?;
            model.differentiate_data(&mut next).ok()?;
            there = Some(next);
        }
        there
    }

    fn initial_values(&self) -> Vec<f64> {
        let coordinates = self.stats.model.coordinates.iter();
        coordinates.map(|free| free.initial).collect()
    }

    /// From a point to a minimum over all other numbers.
    fn minimize_over_others(
        &self,
        start: FitPoint,
        progress: &mut dyn FnMut(usize, f64),
    ) -> GaussNewtonResult {
        let mut iteration =
            GaussNewtonIteration::new(self.stats.model, self.stats.weighting, progress);
        iteration.held[self.k] = true;
        iteration.most_steps = PROFILE.most_iterations;
        iteration.gain_tolerance = PROFILE.sum_accuracy;
        iteration.run(start)
    }

    /// A lower sum with the same value of the number, if numbers that ran away are fitted again
    /// from where the data feel them. Where there is no leaf, there is no lower sum.
    fn restart_runaways(
        &self,
        least: &FitPoint,
        progress: &mut dyn FnMut(usize, f64),
    ) -> Option<FitPoint> {
        if self.runaways.is_empty() {
            return None;
        }
        let (stats, model) = (self.stats, self.stats.model);
        let lowest = normalized_excess(stats, least);
        let mut before: Option<FitPoint> = None;
        for part in PROFILE.restart_fractions {
            let mut theta = least.theta.clone();
            for &j in self.runaways {
                theta[j] =
                    model.coordinates[j].interpolate_from_initial(stats.point.theta[j], part);
            }
            let from = before.as_ref().unwrap_or(least);
            let there = model.continue_leaves(from, &theta).ok();
            let Some(mut there) = there.or_else(|| {
                model
                    .relax_leaves_within_steps(&theta, MOST_RELAXATION_STEPS)
                    .ok()
            }) else {
                continue;
            };
            if model.differentiate_data(&mut there).is_err() {
                continue;
            }
            let start = model.continue_leaves(&there, &theta);
            before = Some(there);
            let Ok(start) = start else { continue };
            let found = self.minimize_over_others(start, progress).point;
            if normalized_excess(stats, &found) < lowest - PROFILE.sum_accuracy {
                return Some(found);
            }
        }
        None
    }
}
