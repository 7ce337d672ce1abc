//! The result of a fit: from the minimum and what surrounds it.

use super::candidates;
use super::case::What;
use super::data::Experiment;
use super::directions::sparse;
use super::free::Coordinate;
use super::judge::{Judge, OPEN};
use super::least_squares::End;
use super::model::Model;
use super::result::{Fit, FitLeaf, FitOutcome, FitParameter, FitResidual, FitWork};
use super::words::{self, Open};
use crate::relax::Lost;
use crate::study::Keys;

/// Components of a combination that is hardly felt smaller than this part of its
/// largest are left out.
const NEGLIGIBLE: f64 = 0.1;

/// The result.
pub(super) fn fit(
    judge: &Judge,
    end: &End,
    parameters: Vec<FitParameter>,
    wanted: &[Experiment],
) -> Fit {
    let base = judge.model.base;
    let coordinates = judge.model.coordinates;
    let mut remarks = remarks(judge, end);
    let open = match end {
        End::Converged => open(judge, &parameters),
        // Elsewhere the data may feel other combinations.
        _ => Vec::new(),
    };
    let keys: Vec<String> = coordinates
        .iter()
        .map(|free| free.keys.to_string())
        .collect();
    let logs: Vec<bool> = coordinates.iter().map(|free| free.log).collect();
    let units: Vec<f64> = coordinates.iter().map(unit).collect();
    let outcome = match end {
        End::Converged if open.is_empty() && parameters.iter().all(|p| p.determined) => {
            FitOutcome::Converged
        }
        End::Converged => FitOutcome::Undetermined,
        _ => FitOutcome::NotConverged,
    };
    let candidates = match candidates::judge(judge, wanted) {
        Ok(candidates) => candidates,
        Err(refused) => {
            remarks.push(format!("candidates: {refused}"));
            Vec::new()
        }
    };
    let values: Vec<(&Keys, f64)> = (coordinates.iter().zip(&judge.point.theta))
        .map(|(free, theta)| (&free.keys, free.value(*theta)))
        .collect();
    Fit {
        scenario: base.scenario().name.clone(),
        outcome,
        remarks,
        correlations: judge.correlations(),
        undetermined: open
            .iter()
            .map(|open| words::map(open, &keys, &units))
            .collect(),
        says: words::says(&parameters, &open, &logs),
        parameters,
        chi_squared: match judge.known {
            true => judge.residuals.norm_squared(),
            // In units of the deviation that they tell themselves.
            false => judge.residuals.norm_squared() / judge.spread.powi(2).max(f64::MIN_POSITIVE),
        },
        degrees_of_freedom: judge.freedom,
        standard_deviation: (!judge.known).then_some(judge.spread * judge.weighing.assumed),
        residuals: compared(judge),
        candidates,
        work: FitWork {
            evaluations: judge.evaluations.rough + judge.evaluations.accurate,
            accurate: judge.evaluations.accurate,
            last: Model::work(judge.point),
        },
        wall_seconds: 0.0,
        fitted: base.toml(&values).unwrap_or_default(),
        leaves: leaves(judge),
    }
}

fn remarks(judge: &Judge, end: &End) -> Vec<String> {
    let mut remarks = Vec::new();
    match end {
        End::Converged => {}
        End::MostSteps => remarks.push(
            "the step limit came before the minimum: start from values nearer to it".into(),
        ),
        End::Stuck(Some(Lost::Elsewhere)) => remarks.push(
            "the way to smaller residuals ends where a leaf jumps to another equilibrium, and is not \
             followed there: start from other values, or leave out experiments beyond the jump"
                .into(),
        ),
        End::Stuck(Some(Lost::NotAtRest(why))) => {
            remarks.push(format!("the way to smaller residuals ends: {why}"));
        }
        End::Stuck(None) => remarks.push("no step makes the residuals smaller".into()),
    }
    for (free, theta) in judge.model.coordinates.iter().zip(&judge.point.theta) {
        let bound = free.bounds.iter().find(|bound| *bound == theta);
        if let Some(bound) = bound {
            let (keys, bound) = (&free.keys, free.value(*bound));
            remarks.push(match free.bounded {
                true => format!("{keys} is at its bound {bound}"),
                false => format!("{keys} went as far as {bound:.3e}, and was let no farther"),
            });
        }
    }
    if judge.freedom == 0 {
        remarks
            .push("there are as many numbers as data: nothing is left to judge the fit by".into());
    }
    if judge.known && judge.suspicious() {
        remarks.push(format!(
            "chi squared is {:.3e} for {} degrees of freedom: the standard deviations are not \
             those of these data, or the model is not that of this leaf; intervals are then too narrow",
            judge.residuals.norm_squared(),
            judge.freedom
        ));
    }
    remarks
}

/// Combinations that stay open: those that are not felt, in their sparsest form, and
/// those that may be off by more than a factor of ten.
fn open(judge: &Judge, parameters: &[FitParameter]) -> Vec<Open> {
    let mut open: Vec<Open> = sparse(&judge.directions.columns(0, judge.unfelt).into_owned())
        .into_iter()
        .map(|parts| Open {
            parts,
            exactly: true,
        })
        .collect();
    for direction in judge.unfelt..judge.values.len() {
        if judge.quantile * judge.spread / judge.values[direction] > OPEN {
            let v = judge.directions.column(direction);
            let largest = v.amax();
            let sign = v
                .iter()
                .find(|part| part.abs() == largest)
                .map_or(1.0, |p| p.signum());
            let parts = v.iter().map(|part| sign * part / largest).enumerate();
            let parts = parts.filter(|(_, part)| part.abs() > NEGLIGIBLE);
            open.push(Open {
                parts: parts.collect(),
                exactly: false,
            });
        }
    }
    // A number of which only the profile has no end.
    for (k, parameter) in parameters.iter().enumerate() {
        let named = |open: &Open| open.parts.iter().any(|(part, _)| *part == k);
        if !parameter.determined && !open.iter().any(named) {
            open.push(Open {
                parts: vec![(k, 1.0)],
                exactly: false,
            });
        }
    }
    open
}

fn compared(judge: &Judge) -> Vec<FitResidual> {
    let bands = judge.bands();
    (judge.point.components().zip(bands))
        .map(|(component, band)| {
            let sd = judge.sd(component);
            let (what, rod, sigma) = match component.what {
                What::Result(quantity) => (quantity.to_string(), None, None),
                What::Vein { rod, axis, sigma } => {
                    (["x", "y", "z"][axis].into(), Some(rod + 1), Some(sigma))
                }
            };
            FitResidual {
                experiment: judge.model.cases[component.case].name.clone(),
                what,
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

fn leaves(judge: &Judge) -> Vec<(String, FitLeaf)> {
    let cases = judge.model.cases.iter().zip(&judge.point.cases);
    cases
        .filter_map(|(case, at)| {
            let finest = at.at.levels.last()?;
            let length = finest.leaf.leaf.scale.length;
            let nodes = finest.leaf.segments() + 1;
            let curves = finest.state.x.chunks(nodes);
            let curves = curves.map(|rod| rod.iter().map(|x| *x * length).collect());
            let leaf = FitLeaf {
                curves: curves.collect(),
                traced: case
                    .traced
                    .iter()
                    .map(|traced| (traced.rod, traced.at))
                    .collect(),
            };
            Some((case.name.clone(), leaf))
        })
        .collect()
}

/// By what a coefficient of a coordinate's combination is one of its number.
fn unit(free: &Coordinate) -> f64 {
    1.0 / free.unit
}
