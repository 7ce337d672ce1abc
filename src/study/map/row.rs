//! The result of one method in one cell: a closed set of words, and numbers.

use std::cmp::Ordering;

use serde::{Serialize, Serializer};

use crate::relax::Method;
use crate::study::judge::Answer;
use crate::{read_and_write, words};

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

    fn rank(self) -> Option<usize> {
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
        self.rank().cmp(&other.rank())
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

/// An answer at rest within the tolerance, or an outcome and a sentence that say why there
/// is none.
pub type Found = Result<Answer, (MapOutcome, String)>;

words! {
    /// Reliability of the reference.
    #[derive(Default, PartialOrd, Ord, Hash)]
    pub enum Confidence {
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
    /// Further information, on one line.
    pub detail: String,
    /// Negative eigenvalues of the equilibrium found.
    pub index: Option<usize>,
    /// The shared tip, or the first rod's.
    #[serde(serialize_with = "number")]
    pub tip_x: Option<f64>,
    /// Its y.
    #[serde(serialize_with = "number")]
    pub tip_y: Option<f64>,
    /// Its z.
    #[serde(serialize_with = "number")]
    pub tip_z: Option<f64>,
    /// Energy of the equilibrium found.
    #[serde(serialize_with = "number")]
    pub energy: Option<f64>,
    /// Largest distance from the reference.
    #[serde(serialize_with = "number")]
    pub error: Option<f64>,
    /// The method's own error estimate.
    #[serde(serialize_with = "number")]
    pub error_estimate: Option<f64>,
    /// Waves along the margins of the equilibrium found: a multiple of 1/2.
    #[serde(serialize_with = "number")]
    pub margin_waves: Option<f64>,
    /// Their amplitude.
    #[serde(serialize_with = "number")]
    pub margin_amplitude: Option<f64>,
    /// Mean twist of its veins from base to tip, in radians; positive: right-handed.
    #[serde(serialize_with = "number")]
    pub twist: Option<f64>,
    /// Time taken, by one thread.
    #[serde(serialize_with = "microseconds")]
    pub seconds: f64,
    /// The reliability of the reference.
    pub reference: Confidence,
}

/// As in Rust's notation, from which every bit can be read.
fn number<S: Serializer>(value: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    match value {
        // Adding zero turns -0 into 0.
        Some(value) => serializer.collect_str(&format_args!("{:?}", value + 0.0)),
        None => serializer.serialize_none(),
    }
}

fn microseconds<S: Serializer>(seconds: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&format_args!("{seconds:.6}"))
}

impl MapRow {
    /// Waves along the margins of a stable equilibrium; `None` where the
    /// method found none.
    pub fn stable_waves(&self) -> Option<f64> {
        self.margin_waves.filter(|_| self.index == Some(0))
    }
}
