//! `leafdyn map`: maps where each method fails.

use crate::report;
use crate::verbs::exit::{ExitStatus, InterruptedRun, Refusal};
use crate::verbs::progress::completed_fraction;
use crate::verbs::request::{DeliveredResult, ScenarioArguments, ScenarioJob, VerbTraits};
use clap::Args;
use leafdyn::study;
use leafdyn::study::{
    DEFAULT_CELL_SECONDS, Map as Cells, MapMethod, MapRequest, MapRow, MapShow, ParameterSweep,
};
use std::sync::Mutex;
use std::time::Instant;

/// What is told of an option that is gone.
const SHARD_REFUSAL: &str = "--shard is gone: give each job a part of the range, as in --vary KEY=1..5:5 and KEY=6..10:5, \
                     with an --out DIR of its own, and join the rows of their map.csv; or loop in Python";

/// Solve a leaf by several methods over one or two varying numbers, and map where each method fails.
///
/// Exit status: 0 the map is made, whatever the methods did; 2 the request was
/// refused; 130 stopped by Ctrl-C (the files have the finished cells).
#[derive(Debug, Args)]
pub struct MapArguments {
    #[command(flatten)]
    request: ScenarioArguments,

    /// What varies, once or twice: numbers of the scenario as in --set, entries of lists counted from 0 (load.gravity[2]), method.step, method.segments; several keys that vary together are joined by +
    #[arg(long, value_name = "KEY=FROM..TO[:COUNT][log]", required = true)]
    vary: Vec<ParameterSweep>,

    /// The methods: semi-implicit, explicit, explicit-motion, single-shooting, shooting, shooting-from-rest [default: all; explicit-motion if method.step is set or varies]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    methods: Option<Vec<MapMethod>>,

    /// Time allowed for each method in each cell
    #[arg(long, value_name = "S", default_value_t = DEFAULT_CELL_SECONDS, allow_negative_numbers = true)]
    cell_seconds: f64,

    /// Refused: replaced by maps of parts of the ranges
    #[arg(long, value_name = "I/K", hide = true)]
    shard: Option<String>,

    /// What the figure shows: outcomes, or waves: how many the margins of stable answers make
    #[arg(long, value_name = "WHAT", default_value_t)]
    show: MapShow,
}

impl MapArguments {
    pub fn run(self) -> Result<ExitStatus, Refusal> {
        let traits = VerbTraits {
            varies_numbers: true,
            value_option: Some("--vary"),
            keeps_partial_result: true,
            ..VerbTraits::default()
        };
        if self.shard.is_some() {
            return Err(SHARD_REFUSAL.into());
        }
        self.request
            .run_each_scenario::<Cells>(traits, |job| self.run_scenario(job))
    }

    fn run_scenario(&self, job: &ScenarioJob) -> Result<DeliveredResult, Refusal> {
        let mut request = MapRequest::new(
            job.base.clone(),
            self.vary.clone(),
            self.methods.clone(),
            self.request.tolerance,
            self.cell_seconds,
        )?;
        request.limit = job.limit.clone();
        let clock = Instant::now();
        let rows = solve_cells(job, &request);
        if job.is_interrupted() && rows.is_empty() {
            return Err(InterruptedRun("no cell was finished").into());
        }
        let mut map = Cells::new(request, rows);
        map.show = self.show;
        if !job.is_interrupted() {
            let line = Mutex::new(job.progress_line());
            map.find_jumps(&|done, pairs| {
                if let Ok(mut line) = line.lock() {
                    line.update(completed_fraction(done, pairs), || {
                        format!("{done} of {pairs} pairs of cells that stand apart")
                    });
                }
            });
        }
        let work = report::ReportedMap {
            map: &map,
            seconds: clock.elapsed().as_secs_f64(),
        };
        job.deliver_written(&map, true, &work, [job.write_files(&map)])
    }
}

/// The rows of all cells or, of a run that a signal ends, those of the finished ones.
fn solve_cells(job: &ScenarioJob, request: &MapRequest) -> Vec<MapRow> {
    let cells = interleave((0..request.cells()).collect());
    let mut line = job.progress_line();
    let (mut rows, mut finished) = (Vec::new(), 0);
    study::map(request, &cells, &mut |new| {
        // Cells that a signal cuts short still arrive.
        if job.is_interrupted() {
            return false;
        }
        rows.extend(new);
        finished += 1;
        line.update(completed_fraction(finished, cells.len()), || {
            format!("{finished} of {} cells", cells.len())
        });
        true
    });
    rows
}

/// All of them, so ordered that those before any of them are a fair sample of all: hard cells stand side by side,
/// and the time that is left is estimated from the cells that are finished.
fn interleave<T>(all: Vec<T>) -> Vec<T> {
    let count = all.len();
    // Steps of the golden section, which leave no gap for long.
    let golden = (0.618 * count as f64).round().max(1.0) as usize;
    let shared = |step: usize, k: usize| step.is_multiple_of(k) && count.is_multiple_of(k);
    let coprime = |step: &usize| (2..=*step).all(|k| !shared(*step, k));
    let step = (golden..).find(coprime).unwrap_or(1);
    let mut all: Vec<Option<T>> = all.into_iter().map(Some).collect();
    let order = (0..count).map(|k| (k * step) % count);
    order.filter_map(|at| all[at].take()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each comes once, and the first of them are from everywhere.
    #[test]
    fn cells_come_from_all_over_the_map() {
        for count in [0, 1, 2, 3, 6, 7, 48, 117, 1024] {
            let mut order = interleave((0..count).collect::<Vec<usize>>());
            let first: Vec<usize> = order.iter().copied().take(count / 4).collect();
            for quarter in 0..4 {
                let within = |cell: &&usize| **cell * 4 / count == quarter;
                let found = first.iter().filter(within).count();
                assert!(4 * found + 8 >= first.len(), "{count}: {first:?}");
            }
            order.sort();
            assert_eq!(order, (0..count).collect::<Vec<_>>());
        }
    }
}
