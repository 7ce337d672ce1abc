//! What a map has: the outcome of every method in every cell, its rows, and where the leaf jumps.

use crate::relax::Method;
use crate::run::Limit;
use crate::study::judge::MethodSolution;
use crate::study::map::remark::MapRemark;
use crate::study::vary::{BaseScenario, ParameterSweep};
use crate::words;
use serde::{Serialize, Serializer};
use std::cmp::Ordering;
use std::collections::BTreeMap;

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
        let references = self.cell_references();
        (
            references.len(),
            self.reference_count(ReferenceConfidence::Confirmed),
        )
    }

    /// Number of cells with a reference of this reliability.
    pub fn reference_count(&self, confidence: ReferenceConfidence) -> usize {
        let references = self.cell_references();
        references.iter().filter(|of| **of == confidence).count()
    }

    /// The reliability of the reference in every cell with rows.
    fn cell_references(&self) -> Vec<ReferenceConfidence> {
        let mut cells: Vec<(usize, ReferenceConfidence)> = (self.rows.iter())
            .map(|row| (row.cell, row.reference))
            .collect();
        cells.dedup_by_key(|(cell, _)| *cell);
        cells.into_iter().map(|(_, reference)| reference).collect()
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
    pub(super) outcome: MapOutcome,
    pub(super) remark: Option<Box<MapRemark>>,
}

impl CellVerdict {
    pub(super) fn new(outcome: MapOutcome, remark: impl Into<Option<MapRemark>>) -> Self {
        CellVerdict {
            outcome,
            remark: remark.into().map(Box::new),
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
        /// Where tissue is rigid or contracts: relaxations to the tolerance and to a tenth of it, on
        /// finer grids, agree so, and no other method is asked.
        FinerGrids = "finer-grids",
        /// They do not: the reference is the second solution if that is a stable
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

impl MapRow {
    /// Waves along the margins of a stable equilibrium; `None` where the
    /// method found none.
    pub fn stable_waves(&self) -> Option<f64> {
        self.margin_waves.filter(|_| self.index == Some(0))
    }
}

pub(super) fn on_one_line(remark: Option<&MapRemark>) -> String {
    let text = remark.map(ToString::to_string).unwrap_or_default();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Numbers as Rust writes them, from which every bit can be read.
pub(super) fn serialize_exact_number<S: Serializer>(
    value: &Option<f64>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    match value {
        // Adding zero turns -0 into 0.
        Some(value) => serializer.collect_str(&format_args!("{:?}", value + 0.0)),
        None => serializer.serialize_none(),
    }
}

pub(super) fn serialize_on_one_line<S: Serializer>(
    remark: &Option<MapRemark>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&on_one_line(remark.as_ref()))
}

pub(super) fn serialize_microseconds<S: Serializer>(
    seconds: &f64,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&format_args!("{seconds:.6}"))
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

/// Two neighbouring cells between which the leaf jumps to another equilibrium.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MapJump {
    /// The key that varies between them.
    pub key: String,
    /// The varied values of one cell.
    pub from: Vec<String>,
    /// The varied values of the other cell.
    pub to: Vec<String>,
    /// The two values of the key between which it jumps.
    pub between: [f64; 2],
    /// Size of the jump, in units of length.
    pub distance: f64,
}

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
