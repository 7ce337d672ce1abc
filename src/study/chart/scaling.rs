//! Cost against the number of veins, at a fixed accuracy.

use super::plan::{Contender, SEGMENTS, Setting};
use super::reference;
use super::run::Runs;
use super::{ChartError, ChartOptions, Ending, Row, Turn, on_one_thread, rows, timing};
use crate::relax::{MAX_NODES, Method, Outcome, RelaxError, check_tolerance};
use crate::scenario::Scenario;
use crate::study::judge::Answer;
use serde::Serialize;

/// Cost against the number of veins.
#[derive(Clone, Debug, Serialize)]
pub struct Scaling {
    /// Name of the scenario.
    #[serde(skip)]
    pub scenario: String,
    /// Required accuracy, relative to the longest rod.
    pub tolerance: f64,
    /// Numbers of veins whose reference is not confirmed.
    pub unconfirmed: Vec<usize>,
    /// One row for each leaf and contender.
    #[serde(rename = "runs")]
    pub rows: Vec<ScalingRow>,
}

/// One contender on one leaf.
#[derive(Clone, Debug, Serialize)]
pub struct ScalingRow {
    /// Number of veins.
    pub rods: usize,
    /// The measurement.
    #[serde(flatten)]
    pub row: Row,
}

/// Measures all contenders on these leaves, from few veins to many, at one
/// tolerance. A contender on one grid gets the coarsest that is accurate
/// enough.
pub fn scaling(
    leaves: &[Scenario],
    tolerance: f64,
    options: &ChartOptions,
    progress: &mut (dyn FnMut(&Turn) + Send),
) -> Result<Scaling, ChartError> {
    check_tolerance(tolerance)?;
    let mut leaves: Vec<&Scenario> = leaves.iter().collect();
    leaves.sort_by_key(|leaf| leaf.rods.len());
    leaves.dedup_by_key(|leaf| leaf.rods.len());
    let (rows, unconfirmed) = on_one_thread(options.seconds, || {
        measure_scaling(&leaves, tolerance, options, progress)
    })?;
    let first = leaves.first();
    Ok(Scaling {
        scenario: first.map_or(String::new(), |leaf| leaf.name.clone()),
        tolerance,
        unconfirmed,
        rows,
    })
}

type Found = (Vec<ScalingRow>, Vec<usize>);

/// A leaf, its reference, and the coarsest grid that is accurate enough for it.
struct Leaf<'s> {
    scenario: &'s Scenario,
    reference: Option<Answer>,
    grid: Option<usize>,
}

fn measure_scaling(
    leaves: &[&Scenario],
    tolerance: f64,
    options: &ChartOptions,
    progress: &mut (dyn FnMut(&Turn) + Send),
) -> Result<Found, RelaxError> {
    let mut contenders = options.contenders.iter();
    let any_grid = contenders.any(|contender| contender.one_grid);
    let mut unconfirmed = Vec::new();
    let leaves = leaves.iter().map(|&scenario| {
        let (found, reference) = reference::find(scenario, Vec::new())?.unzip();
        if !found.is_some_and(|found| found.confirmed) {
            unconfirmed.push(scenario.rods.len());
        }
        let grid = match &reference {
            Some(reference) if any_grid => accurate_grid(scenario, reference, tolerance),
            _ => None,
        };
        Ok(Leaf {
            scenario,
            reference,
            grid,
        })
    });
    let leaves: Vec<Leaf> = leaves.collect::<Result<_, RelaxError>>()?;
    // From few veins to many: if a contender takes too long for one leaf,
    // it is not tried on larger ones.
    let (mut all, mut of_leaf, mut rows) = (Vec::new(), Vec::new(), Vec::new());
    for &contender in &options.contenders {
        for leaf in &leaves {
            let knob = match (contender.one_grid, leaf.grid) {
                (false, _) => Setting::Tolerance(tolerance),
                (true, Some(segments)) => Setting::Segments(segments),
                (true, None) => {
                    rows.push(no_grid(leaf.scenario, contender));
                    continue;
                }
            };
            all.push(Runs::new(leaf.scenario, contender, knob));
            of_leaf.push(leaf);
        }
    }
    timing::measure(&mut all, options.seconds, progress);
    for (runs, leaf) in all.into_iter().zip(of_leaf) {
        let rods = leaf.scenario.rods.len();
        let row = rows::rows(&[runs], leaf.reference.as_ref());
        rows.extend(row.into_iter().map(|row| ScalingRow { rods, row }));
    }
    let order = |contender| Contender::ALL.iter().position(|other| *other == contender);
    rows.sort_by_key(|found| (order(found.row.contender), found.rods));
    Ok((rows, unconfirmed))
}

/// The coarsest single grid whose error is within the tolerance.
fn accurate_grid(scenario: &Scenario, reference: &Answer, tolerance: f64) -> Option<usize> {
    let fits = |segments: &usize| scenario.rods.len() * segments <= MAX_NODES;
    let grids = Contender {
        method: Method::default(),
        one_grid: true,
    };
    let accurate = |&segments: &usize| {
        let mut run = Runs::new(scenario, grids, Setting::Segments(segments));
        run.found = Some(run.once().map(|(answer, _)| answer));
        let error = run.error(Some(reference));
        error.is_some_and(|error| error <= tolerance)
    };
    SEGMENTS.into_iter().take_while(fits).find(accurate)
}

fn no_grid(scenario: &Scenario, contender: Contender) -> ScalingRow {
    let finest = SEGMENTS[SEGMENTS.len() - 1];
    let ending = Ending::Ended(Outcome::ToleranceNotReached);
    let why = format!("no grid of up to {finest} segments is accurate enough");
    ScalingRow {
        rods: scenario.rods.len(),
        row: Row {
            remark: Some(why),
            ..Row::without_result(contender, Setting::Segments(finest), ending)
        },
    }
}
