//! Where each method fails: a leaf solved by every method in every cell of a grid of
//! parameters, with a verdict on each answer.
//!
//! The reference is determined by two independent methods: the relaxed
//! leaf, and the solution of the boundary-value problem that starts from it,
//! both at a hundredth of the tolerance. If they agree within their estimates the
//! reference is confirmed. All answers are measured against it.

mod cell;
mod remark;
pub(super) mod result;

use crate::memory::TooMuch;
use crate::relax::{RelaxError, check_tolerance, without_wind_or_followers};
use crate::run::{Limit, RefusedOption};
use crate::study::map::cell::MapCell;
pub use crate::study::map::remark::{MapMotionFailure, MapRemark};
pub use crate::study::map::result::MapJump;
use crate::study::map::result::{MapMethod, MapRequest, MapRow};
use crate::study::parameter_grid;
use crate::study::parameter_grid::{cell_count, cell_texts, cell_values, check_axes};
use crate::study::vary::{BaseScenario, ParameterKeys, ParameterSweep, SolverSetting, VaryError};
use crate::{memory, read_and_write};
use serde::{Serialize, Serializer};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// Solves these cells by all methods of a request, and passes the rows of each to a callback as it
/// is finished; if that returns `false` the run ends. As many cells at a time as
/// rayon has threads, each on a single thread, so that no cell's time includes another's work.
pub fn map(
    request: &MapRequest,
    cells: &[usize],
    done: &mut (dyn FnMut(Vec<MapRow>) -> bool + Send),
) {
    // A panic in a thread ends the run anyway.
    let left = Mutex::new(cells.iter());
    let next = || left.lock().unwrap_or_else(PoisonError::into_inner).next();
    let done = Mutex::new(done);
    let work = || {
        while let Some(&cell) = next() {
            let rows = request.solve_cell(cell, &request.methods);
            let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
            if !(*done)(rows) {
                *left.lock().unwrap_or_else(PoisonError::into_inner) = [].iter();
            }
        }
    };
    let threads = rayon::current_num_threads().min(cells.len());
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build();
                match alone {
                    Ok(pool) => pool.install(work),
                    // Slower, with the same result.
                    Err(_) => work(),
                }
            });
        }
    });
}

/// Largest number of cells of a map.
const MOST_MAP_CELLS: usize = 1_000_000;

/// Default seconds allowed for each method in each cell.
pub const DEFAULT_CELL_SECONDS: f64 = 20.0;

/// Why a map cannot be made, as a sentence.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MapRefused {
    /// An option has a value that it cannot have.
    #[error("{0}")]
    Option(#[from] RefusedOption),
    /// Its rows would take too much memory.
    #[error("{0}")]
    Memory(#[from] TooMuch),
    /// A number cannot vary.
    #[error("{0}")]
    Vary(#[from] VaryError),
    /// The leaf has what no method of a map takes into account.
    #[error(transparent)]
    Relax(#[from] RelaxError),
    /// The axes or the methods do not make a map, or one that is too large.
    #[error("{0}")]
    Map(String),
}

impl MapRequest {
    /// Validates the request. Default `methods`: all, explicit motion only if
    /// its time step is set or varies.
    pub fn new(
        base: BaseScenario,
        axes: Vec<ParameterSweep>,
        methods: Option<Vec<MapMethod>>,
        tolerance: Option<f64>,
        cell_seconds: f64,
    ) -> Result<Self, MapRefused> {
        without_wind_or_followers(base.scenario(), "a map")?;
        let refuse = |why: String| Err(MapRefused::Map(why));
        if !(1..=2).contains(&axes.len()) {
            return refuse(format!("{} axes: a map has one or two axes", axes.len()));
        }
        check_axes(&axes, MOST_MAP_CELLS, "cells").map_err(MapRefused::Map)?;
        let found = cell_count(&axes);
        if !(cell_seconds > 0.0 && cell_seconds <= 1e6) {
            let allowed = "must be greater than 0 and at most 1e6";
            return Err(RefusedOption::new("cell_seconds", cell_seconds, allowed).into());
        }
        if let Some(tolerance) = tolerance {
            check_tolerance(tolerance)?;
        }
        let steps = base.solver_settings().step.is_some()
            || axes
                .iter()
                .any(|a| a.keys.contains_solver_setting(SolverSetting::Step));
        let methods = match methods {
            Some(mut methods) => {
                if methods.contains(&MapMethod::ExplicitMotion) && !steps {
                    let needs = "needs a time step: set or vary method.step";
                    return refuse(format!("explicit-motion: {needs}"));
                }
                methods.sort();
                methods.dedup();
                methods
            }
            None => (MapMethod::ALL.into_iter())
                .filter(|&method| method != MapMethod::ExplicitMotion || steps)
                .collect(),
        };
        if methods.is_empty() {
            return refuse("no methods: name one at least".into());
        }
        memory::check_map_memory(found, methods.len())?;
        let request = MapRequest {
            base,
            axes,
            methods,
            tolerance,
            cell_seconds,
            limit: Limit::default(),
        };
        request.check_entries()?;
        Ok(request)
    }

    /// A value that no cell accepts is a mistake in the request, not a failure of methods.
    fn check_entries(&self) -> Result<(), MapRefused> {
        let first = self.base.scenario_with_values(&self.values(0));
        let last = self
            .base
            .scenario_with_values(&self.values(self.cells() - 1));
        match (first, last) {
            (Err(why), Err(other)) if !why.depends_on_value() && !other.depends_on_value() => {
                Err(why.into())
            }
            _ => Ok(()),
        }
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        cell_count(&self.axes)
    }

    /// Index of a cell along each axis.
    pub fn cell_position(&self, cell: usize) -> Vec<usize> {
        parameter_grid::cell_position(&self.axes, cell)
    }

    /// The varied values of a cell.
    pub fn values(&self, cell: usize) -> Vec<(&ParameterKeys, f64)> {
        cell_values(&self.axes, cell)
    }

    /// The varied values of a cell as texts, as in tables.
    pub fn texts(&self, cell: usize) -> Vec<String> {
        cell_texts(&self.axes, cell)
    }

    /// The longest time step of explicit motion known to be stable in a cell, in the scenario's
    /// unit of time.
    pub fn longest_stable_step(&self, cell: usize) -> Option<f64> {
        cell::longest_stable_step(&self.base.scenario_with_values(&self.values(cell)).ok()?)
    }

    /// Renamed to [`MapRequest::solve_cell`].
    #[deprecated(note = "renamed: its documentation has the new name")]
    pub fn solve(&self, cell: usize, methods: &[MapMethod]) -> Vec<MapRow> {
        self.solve_cell(cell, methods)
    }

    /// Solves one cell by these methods.
    pub fn solve_cell(&self, cell: usize, methods: &[MapMethod]) -> Vec<MapRow> {
        let varied = match self.base.scenario_with_values(&self.values(cell)) {
            Ok(varied) => varied,
            Err(refused) => {
                let remark = Some(MapRemark::Refused(refused.to_string()));
                let refused = |&method: &MapMethod| MapRow {
                    remark: remark.clone(),
                    cell,
                    method,
                    ..MapRow::default()
                };
                return methods.iter().map(refused).collect();
            }
        };
        let limit = Duration::from_secs_f64(self.cell_seconds);
        let solved = MapCell::new(&varied, self.tolerance, limit, &self.limit);
        (methods
            .iter()
            .map(|&method| solved.solve_by_method(cell, method)))
        .collect()
    }
}

/// What identifies a map. Values are texts, as in the table: they must
/// agree to the last digit.
impl Serialize for MapRequest {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct ParameterKeys<'a> {
            scenario_digest: String,
            set: &'a [String],
            vary: Vec<Axis>,
            step: Option<String>,
            segments: Option<usize>,
            tolerance: Option<String>,
            cell_seconds: String,
        }
        #[derive(Serialize)]
        struct Axis {
            keys: String,
            log: bool,
            values: Vec<String>,
        }
        let knobs = self.base.solver_settings();
        let text = |value: f64| format!("{value:?}");
        let axes = self.axes.iter().map(|axis| Axis {
            keys: axis.keys.to_string(),
            log: axis.log,
            values: axis.values.iter().map(|&v| axis.keys.text(v)).collect(),
        });
        ParameterKeys {
            scenario_digest: format!("{:08x}", crc32fast::hash(self.base.text().as_bytes())),
            set: self.base.overrides(),
            vary: axes.collect(),
            step: knobs.step.map(text),
            segments: knobs.segments,
            tolerance: self.tolerance.map(text),
            cell_seconds: text(self.cell_seconds),
        }
        .serialize(serializer)
    }
}

read_and_write!(MapMethod);
