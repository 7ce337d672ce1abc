//! Leaves over the grid of some numbers of their scenario: each is relaxed alone, side by side on all cores,
//! and has a row of a table. A leaf that is refused has a row with the reason.

pub(super) mod columns;

use crate::memory::TooMuch;
use crate::relax::{Equilibrium, Options, RelaxError, check_tolerance, relax};
use crate::study::blade::estimate_error_in_veins;
use crate::study::parameter_grid::{
    cell_count, cell_position, cell_texts, cell_values, check_axes,
};
use crate::study::sweep::columns::{ColumnValue, LeafColumn, LeafQuantity, quantities_of_leaf};
use crate::study::vary::{
    BaseScenario, ParameterKeys, ParameterSweep, SolverSetting, VariableTarget, VaryError,
};
use rayon::prelude::*;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Largest number of leaves of a sweep.
const MOST_LEAVES: usize = 1_000_000;

/// Why a sweep cannot be made, as a sentence.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SweepRefused {
    /// A number cannot vary.
    #[error("{0}")]
    Vary(#[from] VaryError),
    /// An option cannot be met.
    #[error(transparent)]
    Relax(#[from] RelaxError),
    /// Its leaves would take too much memory.
    #[error("{0}")]
    Memory(#[from] TooMuch),
    /// The numbers do not make a grid, or one that is too large.
    #[error("{0}")]
    Grid(String),
}

/// A request for leaves over a grid of numbers.
#[derive(Clone, Debug)]
pub struct SweepRequest {
    /// The scenario.
    pub base: BaseScenario,
    /// What varies, the last fastest.
    pub axes: Vec<ParameterSweep>,
    /// How every leaf is relaxed; with modes, their frequencies keep the tolerance.
    pub options: Options,
    /// The columns of the table.
    pub columns: Vec<LeafColumn>,
}

impl SweepRequest {
    /// Validates the request; its columns are those that leaves of the scenario have.
    ///
    /// # Errors
    /// If no leaf of the grid can be made, a number varies twice, or the grid is too large.
    pub fn new(
        base: BaseScenario,
        axes: Vec<ParameterSweep>,
        options: Options,
    ) -> Result<Self, SweepRefused> {
        if axes.is_empty() {
            return Err(SweepRefused::Grid("nothing varies".into()));
        }
        check_axes(&axes, MOST_LEAVES, "leaves").map_err(SweepRefused::Grid)?;
        if let Some(tolerance) = options.tolerance {
            check_tolerance(tolerance).map_err(RelaxError::from)?;
        }
        let mut keys = axes.iter().flat_map(|axis| axis.keys.targets());
        let is_step =
            |target: &&VariableTarget| **target == VariableTarget::Knob(SolverSetting::Step);
        if keys.any(|target| is_step(&target)) || base.solver_settings().step.is_some() {
            let why = "method.step: a leaf at rest has no time step";
            return Err(SweepRefused::Grid(why.into()));
        }
        let quantities = quantities_of_leaf(base.scenario(), options.modes);
        let request = SweepRequest {
            base,
            axes,
            options,
            columns: LeafColumn::with_errors(&quantities),
        };
        request.check_entries()?;
        Ok(request)
    }

    /// An entry that no leaf has is a mistake in the request.
    fn check_entries(&self) -> Result<(), SweepRefused> {
        let ends =
            [0, self.leaves() - 1].map(|leaf| self.base.scenario_with_values(&self.values(leaf)));
        match ends {
            [Err(why), Err(other)] if !why.depends_on_value() && !other.depends_on_value() => {
                Err(why.into())
            }
            _ => Ok(()),
        }
    }

    /// Number of leaves.
    pub fn leaves(&self) -> usize {
        cell_count(&self.axes)
    }

    /// Index of a leaf along each axis.
    pub fn position(&self, leaf: usize) -> Vec<usize> {
        cell_position(&self.axes, leaf)
    }

    /// The varied values of a leaf.
    pub fn values(&self, leaf: usize) -> Vec<(&ParameterKeys, f64)> {
        cell_values(&self.axes, leaf)
    }

    /// The varied values of a leaf as texts, as in tables.
    pub fn texts(&self, leaf: usize) -> Vec<String> {
        cell_texts(&self.axes, leaf)
    }

    /// Relaxes one leaf.
    fn solve(&self, leaf: usize) -> Result<Equilibrium, String> {
        let base = self.base.with_values(&self.values(leaf));
        let base = base.map_err(|error| error.to_string())?;
        let mut options = self.options.clone();
        if let Some(segments) = base.solver_settings().segments {
            options.method = options.method.on_grid(Some(segments));
        }
        let found = relax(base.scenario(), &options, &mut |_| {});
        let mut found = found.map_err(|error| error.to_string())?;
        estimate_error_in_veins(&base, &mut found, &options);
        Ok(found.at_stations(base.scenario(), None))
    }

    fn row(&self, leaf: usize) -> SweepRow {
        let found = self.solve(leaf);
        let columns = self.columns.iter();
        let cells = match &found {
            Ok(found) => columns.map(|column| column.value(found)).collect(),
            Err(why) => columns.map(|column| column.refused_value(why)).collect(),
        };
        SweepRow {
            leaf,
            cells,
            success: found.as_ref().is_ok_and(|it| it.outcome.is_success()),
            refused: found.is_err(),
        }
    }
}

/// The row of a leaf.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepRow {
    /// The number of the leaf, the last key varying fastest.
    pub leaf: usize,
    /// The cells, as the columns of the request are; `None` where a value is not known.
    pub cells: Vec<Option<ColumnValue>>,
    /// Whether the leaf is at rest within the tolerance.
    pub success: bool,
    /// Whether the leaf was refused.
    pub refused: bool,
}

/// Leaves over a grid of numbers, or the finished ones of a run that was stopped.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// The request.
    pub request: SweepRequest,
    /// The rows, in the order of the leaves.
    pub rows: Vec<SweepRow>,
    /// The quantities that the figure shows; none: the coordinate of the tip that varies most.
    pub show: Vec<LeafQuantity>,
}

/// Relaxes all leaves of a request, each alone, side by side on all cores; `done` is told how many are
/// finished. The rows do not depend on the number of cores. A cancelled run has the rows of the leaves that
/// were finished.
pub fn sweep(request: SweepRequest, done: &(dyn Fn(usize) + Sync)) -> Sweep {
    let finished = AtomicUsize::new(0);
    let is_cancelled = || {
        let cancel = request.options.limit.cancel.as_ref();
        cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed))
    };
    let solve = |leaf: usize| -> Option<SweepRow> {
        if is_cancelled() {
            return None;
        }
        let row = request.row(leaf);
        // What was cancelled on the way is no result.
        if is_cancelled() && !row.success {
            return None;
        }
        done(1 + finished.fetch_add(1, Ordering::Relaxed));
        Some(row)
    };
    // One by one: a leaf may take a thousand times as long as the next.
    let leaves = (0..request.leaves()).into_par_iter().with_max_len(1);
    let rows = leaves.map(solve).collect::<Vec<_>>();
    Sweep {
        rows: rows.into_iter().flatten().collect(),
        request,
        show: Vec::new(),
    }
}

impl Sweep {
    /// Whether all leaves are at rest within the tolerance.
    pub fn is_complete(&self) -> bool {
        self.rows.len() == self.request.leaves() && self.rows.iter().all(|row| row.success)
    }

    /// The column of a quantity: where it stands in the rows.
    pub fn column(&self, quantity: LeafQuantity) -> Option<usize> {
        let mut columns = self.request.columns.iter();
        columns.position(|column| column.quantity == quantity && !column.is_error)
    }

    /// The number of a quantity in a row, if it is known.
    pub fn number(&self, row: &SweepRow, quantity: LeafQuantity) -> Option<f64> {
        row.cells[self.column(quantity)?].as_ref()?.number()
    }

    /// The quantities that the figure shows.
    pub fn shown(&self) -> Vec<LeafQuantity> {
        if !self.show.is_empty() {
            return self.show.clone();
        }
        let extent = |quantity: LeafQuantity| {
            let numbers = self
                .rows
                .iter()
                .filter_map(|row| self.number(row, quantity));
            let ends = numbers.map(|it| [it, it]);
            let ends = ends.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
            ends.map_or(0.0, |[low, high]| high - low)
        };
        let tips = (0..3).map(LeafQuantity::Tip);
        let most = tips.max_by(|a, b| extent(*a).total_cmp(&extent(*b)));
        most.into_iter().collect()
    }
}

/// `table.json`: what varies, the names of the columns, and a row a leaf.
impl Serialize for Sweep {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        struct Row<'s> {
            request: &'s SweepRequest,
            row: &'s SweepRow,
        }
        impl Serialize for Row<'_> {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                let mut map = serializer.serialize_map(None)?;
                for (keys, value) in self.request.values(self.row.leaf) {
                    match keys.is_whole() {
                        true => map.serialize_entry(keys, &(value as i64))?,
                        false => map.serialize_entry(keys, &value)?,
                    }
                }
                for (column, cell) in self.request.columns.iter().zip(&self.row.cells) {
                    map.serialize_entry(column, cell)?;
                }
                map.end()
            }
        }
        let request = &self.request;
        let keys: Vec<&ParameterKeys> = request.axes.iter().map(|axis| &axis.keys).collect();
        let rows: Vec<Row> = self.rows.iter().map(|row| Row { request, row }).collect();
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("scenario", &request.base.scenario().name)?;
        map.serialize_entry("vary", &keys)?;
        map.serialize_entry("leaves", &request.leaves())?;
        map.serialize_entry("columns", &request.columns)?;
        map.serialize_entry("rows", &rows)?;
        map.end()
    }
}
