//! Requests for maps, and their validation.

use crate::refusal::RefusedOption;
use std::time::Duration;

use serde::{Serialize, Serializer};

use super::cell::{Cell, one_line};
use super::motion;
use super::row::{MapMethod, MapRow};
use crate::limit::Limit;
use crate::memory::{self, TooMuch};
use crate::relax::{RelaxError, check_tolerance, without_wind};
use crate::study::vary::{Base, Keys, Knob, Vary, VaryError};

/// Largest number of cells of a map.
const MOST_CELLS: usize = 1_000_000;

/// Default seconds allowed for each method in each cell.
pub const CELL_SECONDS: f64 = 20.0;

/// A request for a map.
#[derive(Clone, Debug)]
pub struct MapRequest {
    /// The scenario.
    pub base: Base,
    /// One or two axes.
    pub axes: Vec<Vary>,
    /// The methods, in the order of [`MapMethod::ALL`].
    pub methods: Vec<MapMethod>,
    /// Replaces the scenario's tolerance.
    pub tolerance: Option<f64>,
    /// Seconds allowed for each method in each cell.
    pub cell_seconds: f64,
    /// Time limit for unfinished cells, if set.
    pub limit: Limit,
}

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
        base: Base,
        axes: Vec<Vary>,
        methods: Option<Vec<MapMethod>>,
        tolerance: Option<f64>,
        cell_seconds: f64,
    ) -> Result<Self, MapRefused> {
        without_wind(base.scenario(), "a map")?;
        let refuse = |why: String| Err(MapRefused::Map(why));
        if !(1..=2).contains(&axes.len()) {
            return refuse(format!("{} axes: a map has one or two axes", axes.len()));
        }
        let targets: Vec<_> = axes.iter().flat_map(|axis| axis.keys.targets()).collect();
        for (i, target) in targets.iter().enumerate() {
            if targets[..i].contains(target) {
                return refuse(format!("{target}: varies twice"));
            }
        }
        let found: usize = axes.iter().map(|axis| axis.values.len()).product();
        if found > MOST_CELLS {
            let allowed = format!("at most {MOST_CELLS} are allowed; lower the counts of the axes");
            return refuse(format!("{found} cells: {allowed}"));
        }
        if !(cell_seconds > 0.0 && cell_seconds <= 1e6) {
            let allowed = "must be greater than 0 and at most 1e6";
            return Err(RefusedOption::new("cell_seconds", cell_seconds, allowed).into());
        }
        if let Some(tolerance) = tolerance {
            check_tolerance(tolerance)?;
        }
        let steps = base.knobs().step.is_some() || axes.iter().any(|a| a.keys.sets(Knob::Step));
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
        memory::map(found, methods.len())?;
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
        let first = self.base.at(&self.values(0));
        let last = self.base.at(&self.values(self.cells() - 1));
        match (first, last) {
            (Err(why), Err(other)) if !why.depends_on_value() && !other.depends_on_value() => {
                Err(why.into())
            }
            _ => Ok(()),
        }
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.axes.iter().map(|axis| axis.values.len()).product()
    }

    /// Index of a cell along each axis.
    pub fn place(&self, cell: usize) -> Vec<usize> {
        let mut rest = cell;
        let mut place: Vec<usize> = (self.axes.iter().rev())
            .map(|axis| {
                let at = rest % axis.values.len();
                rest /= axis.values.len();
                at
            })
            .collect();
        place.reverse();
        place
    }

    /// The varied values of a cell.
    pub fn values(&self, cell: usize) -> Vec<(&Keys, f64)> {
        let axes = self.axes.iter().zip(self.place(cell));
        axes.map(|(axis, at)| (&axis.keys, axis.values[at]))
            .collect()
    }

    /// The same as texts, as in tables.
    pub fn texts(&self, cell: usize) -> Vec<String> {
        let values = self.values(cell).into_iter();
        values.map(|(keys, value)| keys.text(value)).collect()
    }

    /// The longest time step of explicit motion known to be stable in a cell, in the scenario's
    /// unit of time.
    pub fn stable_step(&self, cell: usize) -> Option<f64> {
        motion::stable_step(&self.base.at(&self.values(cell)).ok()?)
    }

    /// Solves one cell by these methods.
    pub fn solve(&self, cell: usize, methods: &[MapMethod]) -> Vec<MapRow> {
        let varied = match self.base.at(&self.values(cell)) {
            Ok(varied) => varied,
            Err(refused) => {
                let detail = one_line(&refused.to_string());
                let refused = |&method: &MapMethod| MapRow {
                    detail: detail.clone(),
                    cell,
                    method,
                    ..MapRow::default()
                };
                return methods.iter().map(refused).collect();
            }
        };
        let limit = Duration::from_secs_f64(self.cell_seconds);
        let solved = Cell::new(&varied, self.tolerance, limit, &self.limit);
        (methods.iter().map(|&method| solved.row(cell, method))).collect()
    }
}

/// What identifies a map. Values are texts, as in the table: they must
/// agree to the last digit.
impl Serialize for MapRequest {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Keys<'a> {
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
        let knobs = self.base.knobs();
        let text = |value: f64| format!("{value:?}");
        let axes = self.axes.iter().map(|axis| Axis {
            keys: axis.keys.to_string(),
            log: axis.log,
            values: axis.values.iter().map(|&v| axis.keys.text(v)).collect(),
        });
        Keys {
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
