//! Where each method fails: a leaf solved in every cell of a grid of
//! parameters by every method, each answer judged.
//!
//! What is right is decided by two methods that share nothing: the relaxed
//! leaf, and the solution of the boundary-value problem that starts from it,
//! a hundred times sharper. Where they agree within their estimates the
//! reference is confirmed. Everything else is measured against it.

mod answer;
mod cell;
mod motion;
mod row;

pub use row::{Confidence, MapMethod, MapOutcome, MapRow, MapShow, UnknownWord};

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use super::vary::{Base, Keys, Knob, Vary};
use cell::{Cell, one_line};

/// Most cells of a map.
const MOST_CELLS: usize = 1_000_000;

/// Seconds allowed for each method in each cell, if nothing else is said.
pub const CELL_SECONDS: f64 = 20.0;

/// What is asked of a map.
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
}

/// A map that cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MapRefused {
    /// No axis, or too many.
    #[error("{found} times --vary: a map has one or two axes")]
    Axes {
        /// How many.
        found: usize,
    },
    /// One number on both axes, or twice on one.
    #[error("--vary {key}: varies twice")]
    Twice {
        /// The number.
        key: String,
    },
    /// Too many cells.
    #[error("{found} cells: at most {MOST_CELLS} are allowed; lower the counts of --vary")]
    Cells {
        /// How many.
        found: usize,
    },
    /// Not a time.
    #[error("--cell-seconds {found}: must be greater than 0 and at most 1e6")]
    Seconds {
        /// The time.
        found: f64,
    },
    /// Explicit motion without a time step.
    #[error(
        "--methods explicit-motion: needs a time step: --set method.step=STEP or --vary method.step=FROM..TO"
    )]
    NoStep,
    /// Nothing to run.
    #[error("--methods: name one at least")]
    NoMethods,
    /// The tolerance is out of range.
    #[error("--tolerance {found}: allowed are 1e-12 to 0.1")]
    Tolerance {
        /// The tolerance.
        found: f64,
    },
    /// A number that is not there to vary.
    #[error("--vary {message}")]
    Entry {
        /// What is missing.
        message: String,
    },
}

impl MapRequest {
    /// Checks what is asked. Without `methods`: all, explicit motion only if
    /// its time step is set or varies.
    ///
    /// # Errors
    /// If no such map can be made.
    pub fn new(
        base: Base,
        axes: Vec<Vary>,
        methods: Option<Vec<MapMethod>>,
        tolerance: Option<f64>,
        cell_seconds: f64,
    ) -> Result<Self, MapRefused> {
        if !(1..=2).contains(&axes.len()) {
            return Err(MapRefused::Axes { found: axes.len() });
        }
        let targets: Vec<_> = axes.iter().flat_map(|axis| axis.keys.targets()).collect();
        for (i, target) in targets.iter().enumerate() {
            if targets[..i].contains(target) {
                let key = target.to_string();
                return Err(MapRefused::Twice { key });
            }
        }
        let found = axes.iter().map(|axis| axis.values.len()).product();
        if found > MOST_CELLS {
            return Err(MapRefused::Cells { found });
        }
        if !(cell_seconds > 0.0 && cell_seconds <= 1e6) {
            let found = cell_seconds;
            return Err(MapRefused::Seconds { found });
        }
        if let Some(found) = tolerance
            && !(1e-12..=0.1).contains(&found)
        {
            return Err(MapRefused::Tolerance { found });
        }
        let steps = base.knobs().step.is_some() || axes.iter().any(|a| a.keys.sets(Knob::Step));
        let methods = match methods {
            Some(mut methods) => {
                if methods.contains(&MapMethod::ExplicitMotion) && !steps {
                    return Err(MapRefused::NoStep);
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
            return Err(MapRefused::NoMethods);
        }
        let request = MapRequest {
            base,
            axes,
            methods,
            tolerance,
            cell_seconds,
        };
        request.check_entries()?;
        Ok(request)
    }

    /// A number that no cell could vary is a slip, not a failure of methods.
    fn check_entries(&self) -> Result<(), MapRefused> {
        let first = self.base.at(&self.values(0));
        let last = self.base.at(&self.values(self.cells() - 1));
        match (first, last) {
            (Err(super::VaryError::Key { key, why }), Err(super::VaryError::Key { .. })) => {
                let message = format!("{key}: {why}");
                Err(MapRefused::Entry { message })
            }
            _ => Ok(()),
        }
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.axes.iter().map(|axis| axis.values.len()).product()
    }

    /// Place of a cell along each axis.
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

    /// The varied numbers of a cell.
    pub fn values(&self, cell: usize) -> Vec<(&Keys, f64)> {
        let axes = self.axes.iter().zip(self.place(cell));
        axes.map(|(axis, at)| (&axis.keys, axis.values[at]))
            .collect()
    }

    /// The same as they are written into tables.
    pub fn texts(&self, cell: usize) -> Vec<String> {
        let values = self.values(cell).into_iter();
        values.map(|(keys, value)| keys.text(value)).collect()
    }

    /// The longest time step of explicit motion in a cell that is known to be
    /// stable, in the scenario's unit of time.
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
                    cell,
                    method,
                    outcome: MapOutcome::Refused,
                    detail: detail.clone(),
                    index: None,
                    tip: None,
                    energy: None,
                    margin_waves: None,
                    margin_amplitude: None,
                    twist: None,
                    error: None,
                    error_estimate: None,
                    seconds: 0.0,
                    reference: Confidence::None,
                };
                return methods.iter().map(refused).collect();
            }
        };
        let limit = Duration::from_secs_f64(self.cell_seconds);
        let solved = Cell::new(&varied, self.tolerance, limit);
        (methods.iter().map(|&method| solved.row(cell, method))).collect()
    }
}

/// A finished map, or as much of one as there is.
#[derive(Clone, Debug)]
pub struct Map {
    /// What was asked.
    pub request: MapRequest,
    /// What is known, sorted by cell and method, none twice.
    pub rows: Vec<MapRow>,
    /// What the figure shows.
    pub show: MapShow,
}

impl Map {
    /// Sorts the rows; of two about the same the first stays.
    pub fn new(request: MapRequest, mut rows: Vec<MapRow>) -> Self {
        rows.sort_by_key(|row| (row.cell, row.method));
        rows.dedup_by_key(|row| (row.cell, row.method));
        Map {
            request,
            rows,
            show: MapShow::default(),
        }
    }

    /// How often a method had an outcome.
    pub fn count(&self, method: MapMethod, outcome: MapOutcome) -> usize {
        let counted = |row: &&MapRow| row.method == method && row.outcome == outcome;
        self.rows.iter().filter(counted).count()
    }
}

/// Solves cells, each by its methods, and hands over the rows of each as it
/// is finished; `false` from there ends the run. As many cells at a time as
/// rayon has threads, each on one thread of its own, so that no cell's time is
/// spent on another's work.
pub fn map(
    request: &MapRequest,
    cells: &[(usize, Vec<MapMethod>)],
    done: &mut (dyn FnMut(Vec<MapRow>) -> bool + Send),
) {
    let next = AtomicUsize::new(0);
    let stopped = AtomicBool::new(false);
    let done = Mutex::new(done);
    let work = || {
        while !stopped.load(Ordering::Relaxed) {
            let Some((cell, methods)) = cells.get(next.fetch_add(1, Ordering::Relaxed)) else {
                break;
            };
            let rows = request.solve(*cell, methods);
            let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
            if !(*done)(rows) {
                stopped.store(true, Ordering::Relaxed);
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
                    // Slower, but as right.
                    Err(_) => work(),
                }
            });
        }
    });
}
