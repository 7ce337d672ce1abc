//! From measurements to the numbers of a scenario: least squares over experiments and
//! traced veins, and what the data say about each number and what they do not.
//!
//! The leaves of all experiments are followed from equilibrium to equilibrium, with
//! derivatives from their linearised equations, so that a fit does not hop between
//! branches. Positive numbers are fitted by their logarithms.

mod answers;
mod around;
mod candidates;
mod case;
mod change;
mod data;
mod derivatives;
mod directions;
mod end;
mod found;
mod free;
mod interval;
mod judge;
mod least_squares;
mod model;
mod quantity;
mod result;
mod rough;
mod vein;
mod words;

pub use data::{Data, Experiment, Measured, Origin, Traced};
pub use free::Free;
pub use quantity::Quantity as MeasuredQuantity;
pub use result::{
    Fit, FitCandidate, FitLeaf, FitOutcome, FitParameter, FitResidual, FitStep, FitWork,
};

use std::time::Instant;

use super::{Base, VaryError};
use crate::limit::Limit;
use crate::relax::{Lost, Options, RelaxError, check_tolerance};
use free::Coordinate;
use judge::{Evaluations, Judge};
use least_squares::{ASSUMED, End, Iteration, Weighing};
use model::Model;

/// Minima that are left for better ones.
const MOST_MINIMA: usize = 4;

/// Jumps of leaves to other equilibria, where a fit cannot go on without.
const MOST_JUMPS: usize = 3;

/// Where the standard deviation of the data comes from the residuals, that of the
/// search may be larger by this factor: else coarse grids are seen in it.
const SAME_SPREAD: f64 = 1.05;

/// Why nothing can be fitted.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// Data that cannot be used.
    #[error("{0}")]
    Data(String),
    /// A number that cannot be free.
    #[error("{0}")]
    Free(String),
    /// An experiment whose leaf does not come to rest.
    #[error("{0}")]
    NoEquilibrium(String),
    /// A scenario that is refused.
    #[error(transparent)]
    Vary(#[from] VaryError),
    /// A relaxation that cannot be.
    #[error(transparent)]
    Relax(#[from] RelaxError),
}

/// What is to be fitted to what.
#[derive(Clone, Debug)]
pub struct FitRequest {
    /// The scenario: its numbers are where the fit starts.
    pub base: Base,
    /// The data.
    pub data: Data,
    /// The numbers that are free.
    pub free: Vec<Free>,
    /// Whether data far off the others count less (Huber's weights).
    pub robust: bool,
    /// Experiments that could be made: which of them would say most?
    pub candidates: Vec<Experiment>,
    /// Replaces the scenario's tolerance.
    pub tolerance: Option<f64>,
    /// When to give up.
    pub limit: Limit,
}

impl FitRequest {
    /// Experiments that could be made, from a table like that of experiments.
    ///
    /// # Errors
    /// If it is not of the form.
    pub fn read_candidates(text: &str, file: &str) -> Result<Vec<Experiment>, FitError> {
        data::candidates(text, file)
    }
}

/// What is said where a leaf did not stay on its branch.
const JUMPED: &str = "on the way a leaf jumped to another equilibrium, that to which it \
    relaxes from the start: compare with a fit that starts from the values found";

/// Fits the free numbers to the data. `progress` is told of each step.
///
/// # Errors
/// Requests that cannot be met; how the fit itself ended is its outcome.
pub fn fit(request: &FitRequest, progress: &mut dyn FnMut(&FitStep)) -> Result<Fit, FitError> {
    let clock = Instant::now();
    let base = &request.base;
    if let Some(tolerance) = request.tolerance {
        check_tolerance(tolerance)?;
    }
    let coordinates = coordinates(request)?;
    let options = Options {
        tolerance: request.tolerance,
        limit: request.limit.clone(),
        ..Options::default()
    };
    let model = Model::new(base, &coordinates, &options, request.data.clone())?;
    let start: Vec<f64> = coordinates.iter().map(|free| free.start).collect();
    let assumed = ASSUMED * model.unit();
    let (first, _) = model.loose(assumed).find(&start)?;
    let known = model.check_deviations(&first)?;
    let measured = first.components().filter(|component| !component.free);
    check_count(coordinates.len(), measured.count(), known)?;
    let weighing = Weighing {
        assumed,
        robust: request.robust,
    };
    let (mut rough, mut point) = model.rough(&first, weighing)?;
    let mut evaluations = Evaluations::default();
    let mut attempts = 0;
    let mut jumps = 0;
    let mut found = loop {
        // The search on coarse grids, and the last steps on all.
        let mut searching = |step, sum| {
            let known = None;
            progress(&FitStep { step, sum, known });
        };
        let mut search = Iteration::new(&rough, weighing, &mut searching);
        let (near, searched, more) = search.run(point);
        evaluations.rough += more;
        attempts += 1;
        let there = model.refined(&near).or_else(|_| {
            let found = model.find(&near.theta);
            found.map(|(there, _)| there)
        })?;
        let mut last = Iteration::new(&model, weighing, &mut searching);
        last.lean = true;
        let (mut least, end, more) = last.run(there);
        evaluations.accurate += 1 + more;
        let beyond = last
            .jump
            .filter(|_| end == End::Stuck(Some(Lost::Elsewhere)));
        if let Some(theta) = beyond.filter(|_| jumps < MOST_JUMPS)
            && let Some(there) = model.beyond(&theta, &least, weighing)
        {
            jumps += 1;
            attempts -= 1;
            (rough, point) = model.rough(&there, weighing)?;
            continue;
        }
        let of_search = Judge::new(&rough, weighing, known, &near, evaluations);
        let spread = Judge::new(&model, weighing, known, &least, evaluations).spread;
        let same = searched == End::Converged && of_search.spread < SAME_SPREAD * spread;
        if !same && end == End::Converged {
            // What is around it is asked of its own leaves.
            let differentiated = model.differentiate(&mut least);
            differentiated.map_err(|lost| model.no_equilibrium(0, &lost))?;
        }
        let judge = Judge::new(&model, weighing, known, &least, evaluations);
        let shape = if same { &of_search } else { &judge };
        let parameters = match end {
            End::Converged => interval::intervals(&judge, shape, progress),
            _ => Ok(interval::without_intervals(&judge)),
        };
        match parameters {
            Ok(parameters) => break found::fit(&judge, &end, parameters, &request.candidates),
            Err(better) if attempts < MOST_MINIMA => point = better,
            Err(_) => {
                let parameters = interval::without_intervals(&judge);
                break found::fit(&judge, &End::MostSteps, parameters, &request.candidates);
            }
        }
    };
    if jumps > 0 {
        found.remarks.push(JUMPED.into());
    }
    found.wall_seconds = clock.elapsed().as_secs_f64();
    Ok(found)
}

/// The coordinates of the free numbers, none of which is another's.
fn coordinates(request: &FitRequest) -> Result<Vec<Coordinate>, FitError> {
    let base = &request.base;
    let free = expanded(request)?;
    let coordinates = free.iter().map(|free| Coordinate::new(base, free));
    let coordinates = coordinates.collect::<Result<Vec<_>, _>>()?;
    for (k, one) in coordinates.iter().enumerate() {
        if coordinates[..k]
            .iter()
            .any(|other| other.keys.overlaps(&one.keys))
        {
            let keys = &one.keys;
            return Err(FitError::Free(format!(
                "{keys}: is free twice: leave one out"
            )));
        }
    }
    Ok(coordinates)
}

/// Whether there are data enough.
fn check_count(free: usize, count: usize, known: bool) -> Result<(), FitError> {
    if free == 0 || free > count {
        return Err(FitError::Free(match free {
            0 => "no number is free: name at least one".into(),
            _ => format!(
                "{free} numbers are free, and there are {count} data: free fewer, or measure more"
            ),
        }));
    }
    if !known && free == count {
        return Err(FitError::Free(format!(
            "{count} numbers are free, and there are as many data, whose standard deviations are not \
             known: nothing is left to tell them: add columns sd_tip_x, ..., free fewer, or measure more"
        )));
    }
    Ok(())
}

/// The free numbers, with every entry of a list or a profile in its place.
fn expanded(request: &FitRequest) -> Result<Vec<Free>, FitError> {
    let mut all = Vec::new();
    for free in &request.free {
        let entries = request.base.entries_of(&free.keys);
        all.extend(entries.into_iter().map(|keys| Free {
            keys,
            bounds: free.bounds,
        }));
    }
    Ok(all)
}
