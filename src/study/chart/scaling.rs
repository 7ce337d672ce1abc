//! Cost against the number of veins, at a fixed accuracy.

use super::plan::{Cell, Contender, SEGMENTS, Setting};
use super::reference;
use super::run::{Shape, longest, run};
use super::{ChartError, ChartOptions, Ending, Row, Turn, alone, judge, timing};
use crate::relax::{MAX_NODES, Outcome, RelaxError, Work, check_tolerance};
use crate::scenario::Scenario;

/// Cost against the number of veins.
#[derive(Clone, Debug)]
pub struct Scaling {
    /// Name of the scenario.
    pub scenario: String,
    /// Wanted accuracy, relative to the longest rod.
    pub tolerance: f64,
    /// One row for each leaf and contender.
    pub rows: Vec<ScalingRow>,
    /// Numbers of veins whose reference is not confirmed.
    pub unconfirmed: Vec<usize>,
}

/// One contender on one leaf.
#[derive(Clone, Debug)]
pub struct ScalingRow {
    /// Number of veins.
    pub rods: usize,
    /// What was measured.
    pub row: Row,
}

/// Measures all contenders on these leaves, from few veins to many, at one
/// tolerance. On one grid, a contender gets the coarsest that is accurate
/// enough.
///
/// # Errors
/// Requests that cannot be met.
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
    let (rows, unconfirmed) = alone(options.seconds, || {
        measure(&leaves, tolerance, options, progress)
    })?;
    Ok(Scaling {
        scenario: leaves
            .first()
            .map_or(String::new(), |leaf| leaf.name.clone()),
        tolerance,
        rows,
        unconfirmed,
    })
}

type Found = (Vec<ScalingRow>, Vec<usize>);

fn measure(
    leaves: &[&Scenario],
    tolerance: f64,
    options: &ChartOptions,
    progress: &mut (dyn FnMut(&Turn) + Send),
) -> Result<Found, RelaxError> {
    let any_grid = options
        .contenders
        .iter()
        .any(|contender| contender.on_one_grid());
    let (mut shapes, mut grids, mut unconfirmed) = (Vec::new(), Vec::new(), Vec::new());
    for leaf in leaves {
        let (reference, shape) = reference::find(leaf, Vec::new())?.unzip();
        if !reference.is_some_and(|found| found.confirmed) {
            unconfirmed.push(leaf.rods.len());
        }
        grids.push(match &shape {
            Some(shape) if any_grid => accurate_grid(leaf, shape, tolerance),
            _ => None,
        });
        shapes.push(shape);
    }
    // A contender goes from few veins to many: if one leaf takes it too long,
    // larger ones are not tried.
    let mut cells = Vec::new();
    let mut hopeless = Vec::new();
    for &contender in &options.contenders {
        for (scenario, grid) in leaves.iter().zip(&grids) {
            let knob = match (contender.on_one_grid(), grid) {
                (false, _) => Setting::Tolerance(tolerance),
                (true, Some(segments)) => Setting::Segments(*segments),
                (true, None) => {
                    hopeless.push(no_grid(scenario, contender));
                    continue;
                }
            };
            cells.push(Cell {
                scenario,
                contender,
                knob,
            });
        }
    }
    let (measured, _) = timing::measure(&cells, options.seconds, progress);
    let mut rows = hopeless;
    for (cell, measured) in cells.iter().zip(measured) {
        let place = leaves
            .iter()
            .position(|leaf| std::ptr::eq(*leaf, cell.scenario));
        let reference = place.and_then(|place| shapes[place].as_ref());
        let row = judge::rows(cell.scenario, &[*cell], vec![measured], reference);
        rows.extend(row.into_iter().map(|row| ScalingRow {
            rods: cell.scenario.rods.len(),
            row,
        }));
    }
    let order = |contender| Contender::ALL.iter().position(|other| *other == contender);
    rows.sort_by_key(|found| (order(found.row.contender), found.rods));
    Ok((rows, unconfirmed))
}

/// The coarsest single grid whose error is within the tolerance.
fn accurate_grid(scenario: &Scenario, reference: &Shape, tolerance: f64) -> Option<usize> {
    let fits = |segments: &&usize| scenario.rods.len() * **segments <= MAX_NODES;
    let accurate = |segments: usize| {
        let cell = Cell {
            scenario,
            contender: Contender::SemiImplicitGrid,
            knob: Setting::Segments(segments),
        };
        let (run, _) = run(&cell).ok()?;
        let error = run.shape.distance(reference)? / longest(scenario);
        (run.at_rest() && error <= tolerance).then_some(segments)
    };
    SEGMENTS
        .iter()
        .take_while(fits)
        .find_map(|&segments| accurate(segments))
}

fn no_grid(scenario: &Scenario, contender: Contender) -> ScalingRow {
    let finest = SEGMENTS[SEGMENTS.len() - 1];
    ScalingRow {
        rods: scenario.rods.len(),
        row: Row {
            contender,
            knob: Setting::Segments(finest),
            seconds: None,
            work: Work::default(),
            true_error: None,
            error_estimate: None,
            ending: Ending::Ended(Outcome::ToleranceNotReached),
            remark: Some(format!(
                "no grid of up to {finest} segments is accurate enough"
            )),
            pareto: false,
        },
    }
}
