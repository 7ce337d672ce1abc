//! Where each method fails: a leaf solved in every cell of a grid of
//! parameters by every method, each answer judged.
//!
//! What is right is decided by two methods that share nothing: the relaxed
//! leaf, and the solution of the boundary-value problem that starts from it,
//! a hundred times sharper. Where they agree within their estimates the
//! reference is confirmed. Everything else is measured against it.

mod cell;
mod jumps;
mod motion;
mod request;
mod row;

pub use jumps::MapJump;
pub use request::{CELL_SECONDS, MapRefused, MapRequest};
pub use row::{Confidence, MapMethod, MapOutcome, MapRow, MapShow};

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::thread;

use serde::{Serialize, Serializer};

/// A finished map, or as much of one as there is.
#[derive(Clone, Debug)]
pub struct Map {
    /// What was asked.
    pub request: MapRequest,
    /// What is known, sorted by cell and method, none twice.
    pub rows: Vec<MapRow>,
    /// What the figure shows.
    pub show: MapShow,
    /// Between which cells the leaf jumps to another equilibrium, once that was looked for.
    pub jumps: Option<Vec<MapJump>>,
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
            jumps: None,
        }
    }

    /// How often a method had an outcome.
    pub fn count(&self, method: MapMethod, outcome: MapOutcome) -> usize {
        let counted = |row: &&MapRow| row.method == method && row.outcome == outcome;
        self.rows.iter().filter(counted).count()
    }

    /// Number of cells with rows, and of those whose reference is confirmed.
    pub fn known_and_confirmed(&self) -> (usize, usize) {
        let mut cells: Vec<(usize, Confidence)> = (self.rows.iter())
            .map(|row| (row.cell, row.reference))
            .collect();
        cells.dedup_by_key(|(cell, _)| *cell);
        let confirmed = |(_, reference): &&(usize, Confidence)| *reference == Confidence::Confirmed;
        (cells.len(), cells.iter().filter(confirmed).count())
    }
}

/// `map.json`: which map the rows beside it are of, and how often each method had
/// each outcome; those it never had are left out.
impl Serialize for Map {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Keys<'a> {
            scenario: &'a str,
            request: &'a MapRequest,
            cells: usize,
            confirmed: usize,
            outcomes: Vec<Counts>,
            jumps: &'a Option<Vec<MapJump>>,
        }
        #[derive(Serialize)]
        struct Counts {
            method: MapMethod,
            counts: BTreeMap<&'static str, usize>,
        }
        let request = &self.request;
        let outcomes = request.methods.iter().map(|&method| Counts {
            method,
            counts: (MapOutcome::ALL.into_iter())
                .map(|outcome| (outcome.word(), self.count(method, outcome)))
                .filter(|(_, count)| *count > 0)
                .collect(),
        });
        Keys {
            scenario: &request.base.scenario().name,
            request,
            cells: request.cells(),
            confirmed: self.known_and_confirmed().1,
            outcomes: outcomes.collect(),
            jumps: &self.jumps,
        }
        .serialize(serializer)
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
    // A thread that panics ends the run anyway.
    let left = Mutex::new(cells.iter());
    let next = || left.lock().unwrap_or_else(PoisonError::into_inner).next();
    let done = Mutex::new(done);
    let work = || {
        while let Some((cell, methods)) = next() {
            let rows = request.solve(*cell, methods);
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
                    // Slower, but as right.
                    Err(_) => work(),
                }
            });
        }
    });
}
