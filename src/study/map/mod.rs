//! Where each method fails: a leaf solved by every method in every cell of a grid of
//! parameters, with a verdict on each answer.
//!
//! The reference is determined by two independent methods: the relaxed
//! leaf, and the solution of the boundary-value problem that starts from it,
//! both at a hundredth of the tolerance. If they agree within their estimates the
//! reference is confirmed. All answers are measured against it.

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

/// A map, complete or partial.
#[derive(Clone, Debug)]
pub struct Map {
    /// The request.
    pub request: MapRequest,
    /// The rows so far, sorted by cell and method.
    pub rows: Vec<MapRow>,
    /// What the figure shows.
    pub show: MapShow,
    /// The jumps of the leaf to another equilibrium between cells, if they were searched for.
    pub jumps: Option<Vec<MapJump>>,
}

impl Map {
    /// Sorts the rows.
    pub fn new(request: MapRequest, mut rows: Vec<MapRow>) -> Self {
        rows.sort_by_key(|row| (row.cell, row.method));
        Map {
            request,
            rows,
            show: MapShow::default(),
            jumps: None,
        }
    }

    /// Number of a method's answers with an outcome.
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

/// `map.json`: the request, and how often each method had each outcome; zero counts are left out.
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
            let rows = request.solve(cell, &request.methods);
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
