//! The search for a minimum near a start.

use super::FitError;
use super::contradiction;
use super::data::Experiment;
use super::end::BETTER;
use super::found;
use super::free::LONGEST_STEP;
use super::interval;
use super::least_squares::{Besides, End, Iteration, Weighting};
use super::model::{Model, Point};
use super::result::{Fit, FitStep, FitWork};
use super::starts::{misfit, sum};
use super::statistics::Statistics;
use crate::relax::Lost;

/// Largest number of minima abandoned for better ones.
const MOST_MINIMA: usize = 4;

/// Largest number of jumps of leaves to other equilibria, if a fit cannot continue without.
const MOST_JUMPS: usize = 3;

/// If the standard deviation of the data is estimated from the residuals, the largest ratio of
/// that of the search to it: a larger one is due to coarse grids.
const SAME_SPREAD: f64 = 1.05;

/// Remark if a leaf did not stay on its branch.
const JUMPED: &str = "on the way a leaf jumped to another equilibrium, that to which it \
    relaxes from the start: compare with a fit that starts from the values found";

/// A minimum, or where the search for it ended.
pub(super) struct Minimum {
    pub fit: Fit,
    pub theta: Vec<f64>,
    /// The sum of squares, the variance of a datum, and the excess at the ends of intervals.
    pub sum: f64,
    pub variance: f64,
    pub significant: f64,
    pub converged: bool,
    /// Root mean square of the residuals, relative to the size of the data.
    pub misfit: f64,
    /// Whether the sum still falls where a number without given bounds is as far from its initial
    /// value as it may be.
    pub beyond_window: bool,
}

impl Minimum {
    /// Whether this is the better answer. A minimum is not left for values that are none.
    pub fn is_preferred_to(&self, other: &Minimum) -> bool {
        match self.converged == other.converged {
            true => self.sum < other.sum,
            false => self.converged,
        }
    }

    /// This minimum as one besides which another is searched from these values.
    pub fn besides(&self, theta: &[f64]) -> Besides<'_> {
        let change = theta.iter().zip(&self.theta).map(|(to, from)| to - from);
        Besides {
            theta: &self.theta,
            most: self.sum + self.significant,
            distance: change.map(|it| it.powi(2)).sum::<f64>().sqrt(),
        }
    }
}

/// The search for a minimum near a start.
pub(super) struct Search<'m, 'a> {
    pub model: &'m Model<'a>,
    pub weighting: Weighting,
    /// Whether the standard deviations of the data are known.
    pub known: bool,
    pub candidates: &'m [Experiment],
    /// Largest number of steps to a minimum.
    pub most_steps: usize,
}

impl<'m, 'a> Search<'m, 'a> {
    /// Begins with these leaves. If a profile leads to a better minimum, the search goes on from
    /// there.
    pub fn run(
        &self,
        first: &Point,
        progress: &mut dyn FnMut(&FitStep),
    ) -> Result<Minimum, FitError> {
        let (model, weighting) = (self.model, self.weighting);
        let (mut coarse, mut point) = model.coarse(first, weighting)?;
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
            let mut search = Iteration::new(&coarse, weighting, &mut searching);
            search.most_steps = search.most_steps.min(self.most_steps);
            let (near, searched, more) = search.run(point);
            work.evaluations += more;
            attempts += 1;
            let there = model.follow(&near, &near.theta);
            let there = there.or_else(|_| model.find(&near.theta))?;
            let mut last = Iteration::new(model, weighting, &mut searching);
            last.lean = true;
            last.most_steps = last.most_steps.min(self.most_steps);
            let (mut least, end, more) = last.run(there);
            work.evaluations += 1 + more;
            work.accurate += 1 + more;
            let is_lost = end == End::Stuck(Some(Lost::Elsewhere));
            if is_lost
                && jumps < MOST_JUMPS
                && let Some(there) = model.beyond(&last.jumps, &least, weighting)
            {
                jumps += 1;
                attempts -= 1;
                (coarse, point) = model.coarse(&there, weighting)?;
                continue;
            }
            let of_search = Statistics::new(&coarse, weighting, self.known, &near);
            let spread = self.statistics(&least).spread;
            let same = searched == End::Converged && of_search.spread < SAME_SPREAD * spread;
            if !same && end == End::Converged {
                // Its neighbourhood is computed with its own leaves.
                let differentiated = model.differentiate(&mut least);
                differentiated.map_err(|lost| model.no_equilibrium(&near.theta, 0, &lost))?;
            }
            let stats = self.statistics(&least);
            let shape = if same { &of_search } else { &stats };
            let contradicted = contradiction::contradicts(&stats);
            let parameters = match end {
                End::Converged if !contradicted => interval::intervals(&stats, shape, progress),
                _ => Ok(interval::without_intervals(&stats)),
            };
            let (end, parameters) = match parameters {
                Ok(parameters) => (end, parameters),
                Err(better) if attempts < MOST_MINIMA => {
                    point = better;
                    continue;
                }
                Err(_) => (End::MostSteps, interval::without_intervals(&stats)),
            };
            break Minimum {
                fit: found::fit(&stats, &end, parameters, work, self.candidates),
                sum: sum(weighting, stats.point),
                variance: stats.spread.powi(2),
                significant: (stats.quantile * stats.spread).powi(2),
                converged: end == End::Converged,
                misfit: misfit(model, stats.point),
                beyond_window: falls_beyond_window(&stats),
                theta: stats.point.theta.clone(),
            };
        };
        if jumps > 0 {
            found.fit.remarks.push(JUMPED.into());
        }
        Ok(found)
    }

    fn statistics<'p>(&'p self, point: &'p Point) -> Statistics<'p, 'a> {
        Statistics::new(self.model, self.weighting, self.known, point)
    }
}

/// Whether a step beyond a bound that was not given is expected to reduce the sum of squares by more
/// than chance.
fn falls_beyond_window(stats: &Statistics) -> bool {
    let weighed = stats.weighting.roots(&stats.residuals);
    let slopes = (stats.jacobian).tr_mul(&stats.residuals.component_mul(&weighed));
    let coordinates = stats.model.coordinates.iter().zip(&stats.point.theta);
    coordinates.enumerate().any(|(k, (free, theta))| {
        let [low, high] = free.bounds;
        let slope = slopes[k];
        let outwards = *theta <= low && slope > 0.0 || *theta >= high && slope < 0.0;
        let bend = stats.jacobian.column(k).norm_squared();
        let step = (slope.abs() / bend).min(LONGEST_STEP);
        let gain = step * (2.0 * slope.abs() - bend * step);
        !free.bounded && outwards && gain > BETTER * stats.spread.powi(2)
    })
}
