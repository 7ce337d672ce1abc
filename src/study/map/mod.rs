//! Where each method fails: a leaf solved by every method in every cell of a grid of
//! parameters, with a verdict on each answer.
//!
//! The reference is determined by two independent methods: the relaxed
//! leaf, and the solution of the boundary-value problem that starts from it,
//! both at a hundredth of the tolerance. If they agree within their estimates the
//! reference is confirmed. All answers are measured against it.

mod cell;
mod remark;

use crate::memory::TooMuch;
use crate::relax::{Method, RelaxError, check_tolerance, without_wind};
use crate::run::{Limit, RefusedOption};
use crate::study::judge::MethodSolution;
use crate::study::map::cell::MapCell;
pub use crate::study::map::cell::MapJump;
pub use crate::study::map::remark::{MapMotionFailure, MapRemark};
use crate::study::vary::{BaseScenario, ParameterKeys, ParameterSweep, SolverSetting, VaryError};
use crate::{memory, read_and_write, words};
use serde::{Serialize, Serializer};
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

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
    pub fn outcome_count(&self, method: MapMethod, outcome: MapOutcome) -> usize {
        let counted = |row: &&MapRow| row.method == method && row.outcome == outcome;
        self.rows.iter().filter(counted).count()
    }

    /// Number of cells with rows, and of those whose reference is confirmed.
    pub fn known_and_confirmed_cells(&self) -> (usize, usize) {
        let mut cells: Vec<(usize, ReferenceConfidence)> = (self.rows.iter())
            .map(|row| (row.cell, row.reference))
            .collect();
        cells.dedup_by_key(|(cell, _)| *cell);
        let confirmed = |(_, reference): &&(usize, ReferenceConfidence)| {
            *reference == ReferenceConfidence::Confirmed
        };
        (cells.len(), cells.iter().filter(confirmed).count())
    }
}

/// `map.json`: the request, and how often each method had each outcome; zero counts are left out.
impl Serialize for Map {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct ParameterKeys<'a> {
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
                .map(|outcome| (outcome.word(), self.outcome_count(method, outcome)))
                .filter(|(_, count)| *count > 0)
                .collect(),
        });
        ParameterKeys {
            scenario: &request.base.scenario().name,
            request,
            cells: request.cells(),
            confirmed: self.known_and_confirmed_cells().1,
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

/// A request for a map.
#[derive(Clone, Debug)]
pub struct MapRequest {
    /// The scenario.
    pub base: BaseScenario,
    /// One or two axes.
    pub axes: Vec<ParameterSweep>,
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
        base: BaseScenario,
        axes: Vec<ParameterSweep>,
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
        if found > MOST_MAP_CELLS {
            let allowed =
                format!("at most {MOST_MAP_CELLS} are allowed; lower the counts of the axes");
            return refuse(format!("{found} cells: {allowed}"));
        }
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
        self.axes.iter().map(|axis| axis.values.len()).product()
    }

    /// Index of a cell along each axis.
    pub fn cell_position(&self, cell: usize) -> Vec<usize> {
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
    pub fn values(&self, cell: usize) -> Vec<(&ParameterKeys, f64)> {
        let axes = self.axes.iter().zip(self.cell_position(cell));
        axes.map(|(axis, at)| (&axis.keys, axis.values[at]))
            .collect()
    }

    /// The varied values of a cell as texts, as in tables.
    pub fn texts(&self, cell: usize) -> Vec<String> {
        let values = self.values(cell).into_iter();
        values.map(|(keys, value)| keys.text(value)).collect()
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

/// The methods that are compared, in the order of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MapMethod {
    /// A method of relaxation or shooting. Shooting from rest starts from the result of
    /// the default method at the same tolerance.
    ToRest(Method),
    /// Explicit motion with one time step for the scenario's duration.
    ExplicitMotion,
}

impl MapMethod {
    /// All of them.
    pub const ALL: [MapMethod; 6] = [
        MapMethod::ToRest(Method::ALL[0]),
        MapMethod::ToRest(Method::ALL[1]),
        MapMethod::ExplicitMotion,
        MapMethod::ToRest(Method::ALL[2]),
        MapMethod::ToRest(Method::ALL[3]),
        MapMethod::ToRest(Method::ALL[4]),
    ];

    /// The word used on the command line and in `map.csv`.
    pub fn word(self) -> &'static str {
        match self {
            MapMethod::ToRest(method) => method.word(),
            MapMethod::ExplicitMotion => "explicit-motion",
        }
    }

    fn method_order(self) -> Option<usize> {
        MapMethod::ALL.iter().position(|method| *method == self)
    }
}

impl Default for MapMethod {
    fn default() -> Self {
        MapMethod::ALL[0]
    }
}

impl Ord for MapMethod {
    fn cmp(&self, other: &Self) -> Ordering {
        self.method_order().cmp(&other.method_order())
    }
}

impl PartialOrd for MapMethod {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

words! {
    /// Outcome of a method.
    #[derive(Default, PartialOrd, Ord, Hash)]
    pub enum MapOutcome {
        /// At rest in the reference equilibrium, within both error estimates.
        Right = "right",
        /// At rest in another equilibrium, not known to be unstable.
        OtherEquilibrium = "other-equilibrium",
        /// At rest in an unstable equilibrium.
        Saddle = "saddle",
        /// In the same equilibrium, but further from the reference than both
        /// error estimates allow.
        Inaccurate = "inaccurate",
        /// Not at rest, or not within the tolerance.
        NotConverged = "not-converged",
        /// Values grew without bound, or no step lowered the energy.
        Diverged = "diverged",
        /// The method or the format refuses such a leaf.
        #[default]
        Refused = "refused",
        /// The time limit was exceeded.
        OutOfTime = "out-of-time",
    }
}

/// An answer at rest within the tolerance, or an outcome and a remark that say why there
/// is none.
pub type CellSolution = Result<MethodSolution, CellVerdict>;

/// The outcome of a method in a cell, and what is to be said of it.
#[derive(Clone, Debug)]
pub struct CellVerdict {
    outcome: MapOutcome,
    remark: Option<MapRemark>,
}

impl CellVerdict {
    fn new(outcome: MapOutcome, remark: MapRemark) -> Self {
        CellVerdict {
            outcome,
            remark: Some(remark),
        }
    }
}

words! {
    /// Reliability of the reference.
    #[derive(Default, PartialOrd, Ord, Hash)]
    pub enum ReferenceConfidence {
        /// Relaxation and shooting from there agree within both error estimates,
        /// and so do their numbers of negative eigenvalues.
        Confirmed = "confirmed",
        /// They do not: the reference is the shooting solution if that is a stable
        /// equilibrium, otherwise the relaxed leaf.
        Unconfirmed = "unconfirmed",
        /// The relaxation did not come to rest.
        #[default]
        None = "none",
    }

    /// What the figure of a map shows.
    #[derive(Default)]
    pub enum MapShow {
        /// The outcome of each method.
        #[default]
        Outcomes = "outcomes",
        /// The number of waves along the margins of stable answers.
        Waves = "waves",
    }
}

read_and_write!(MapMethod);

/// One method in one cell: a row of `map.csv`, in the order of its columns.
/// Lengths except the tip's coordinates are relative to the longest rod.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MapRow {
    /// The number of the cell, the last axis varying fastest; the table gives its values instead.
    #[serde(skip)]
    pub cell: usize,
    /// The method.
    pub method: MapMethod,
    /// The outcome.
    pub outcome: MapOutcome,
    /// Further information.
    #[serde(rename = "detail", serialize_with = "serialize_on_one_line")]
    pub remark: Option<MapRemark>,
    /// Negative eigenvalues of the equilibrium found.
    pub index: Option<usize>,
    /// The shared tip, or the first rod's.
    #[serde(serialize_with = "serialize_exact_number")]
    pub tip_x: Option<f64>,
    /// Its y.
    #[serde(serialize_with = "serialize_exact_number")]
    pub tip_y: Option<f64>,
    /// Its z.
    #[serde(serialize_with = "serialize_exact_number")]
    pub tip_z: Option<f64>,
    /// Energy of the equilibrium found.
    #[serde(serialize_with = "serialize_exact_number")]
    pub energy: Option<f64>,
    /// Largest distance from the reference.
    #[serde(serialize_with = "serialize_exact_number")]
    pub error: Option<f64>,
    /// The method's own error estimate.
    #[serde(serialize_with = "serialize_exact_number")]
    pub error_estimate: Option<f64>,
    /// Waves along the margins of the equilibrium found: a multiple of 1/2.
    #[serde(serialize_with = "serialize_exact_number")]
    pub margin_waves: Option<f64>,
    /// Amplitude of the waves along the margins.
    #[serde(serialize_with = "serialize_exact_number")]
    pub margin_amplitude: Option<f64>,
    /// Mean twist of its veins from base to tip, in radians; positive: right-handed.
    #[serde(serialize_with = "serialize_exact_number")]
    pub twist: Option<f64>,
    /// Time taken, by one thread.
    #[serde(serialize_with = "serialize_microseconds")]
    pub seconds: f64,
    /// The reliability of the reference.
    pub reference: ReferenceConfidence,
}

impl MapRow {
    /// Further information on one line, as tables require.
    pub fn detail(&self) -> String {
        on_one_line(self.remark.as_ref())
    }
}

fn on_one_line(remark: Option<&MapRemark>) -> String {
    let text = remark.map(ToString::to_string).unwrap_or_default();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Numbers as Rust writes them, from which every bit can be read.
fn serialize_exact_number<S: Serializer>(
    value: &Option<f64>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    match value {
        // Adding zero turns -0 into 0.
        Some(value) => serializer.collect_str(&format_args!("{:?}", value + 0.0)),
        None => serializer.serialize_none(),
    }
}

fn serialize_on_one_line<S: Serializer>(
    remark: &Option<MapRemark>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&on_one_line(remark.as_ref()))
}

fn serialize_microseconds<S: Serializer>(seconds: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&format_args!("{seconds:.6}"))
}

impl MapRow {
    /// Waves along the margins of a stable equilibrium; `None` where the
    /// method found none.
    pub fn stable_waves(&self) -> Option<f64> {
        self.margin_waves.filter(|_| self.index == Some(0))
    }
}
