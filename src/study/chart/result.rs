//! The result of a chart: `chart.json`.

use serde::{Serialize, Serializer};

use super::front::front;
use super::peers::Peer;
use super::plan::{Contender, Setting};
use super::reference::Reference;
use super::scaling::Scaling;
use super::timing::{Spread, serialize_spread};
use crate::relax::Outcome;

/// Outcome of a run in a chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The outcome of the run itself.
    Ended(Outcome),
    /// At rest, but not in the reference's equilibrium.
    OtherEquilibrium,
    /// The contender does not support the request.
    Refused,
    /// Not run, since a coarser run of the contender took too long.
    NotRun,
}

impl Ending {
    /// The word used in files.
    pub fn word(self) -> &'static str {
        match self {
            Ending::Ended(outcome) => outcome.word(),
            Ending::OtherEquilibrium => "other-equilibrium",
            Ending::Refused => "refused",
            Ending::NotRun => "not-run",
        }
    }

    /// Whether the leaf is at rest in the reference equilibrium, with the requested accuracy,
    /// and not known to be unstable.
    pub fn is_success(self) -> bool {
        let Ending::Ended(outcome) = self else {
            return false;
        };
        matches!(outcome, Outcome::Converged | Outcome::ConvergedAfterSaddle)
    }
}

impl Serialize for Ending {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.word())
    }
}

/// One setting of one contender. Errors are relative to the longest rod.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The contender.
    #[serde(rename = "method")]
    pub contender: Contender,
    /// Its setting.
    pub knob: Setting,
    /// Times from the checked scenario to the result; `None` if it did not run.
    #[serde(flatten, serialize_with = "serialize_spread")]
    pub seconds: Option<Spread>,
    /// Steps or iterations of a run; these counts are `None` if it did not run.
    pub steps: Option<usize>,
    /// Its factorisations.
    pub factorizations: Option<usize>,
    /// Its evaluations of all forces of the leaf.
    pub force_evaluations: Option<usize>,
    /// Largest distance from the reference; `None` if the leaf is not at rest,
    /// or there is no reference.
    pub true_error: Option<f64>,
    /// The run's own error estimate.
    pub error_estimate: Option<f64>,
    /// How it ended.
    #[serde(rename = "outcome")]
    pub ending: Ending,
    /// Why it did not succeed, in a sentence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
    /// Whether it is on the Pareto front; `None` where no front is drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pareto: Option<bool>,
}

impl Row {
    /// A row of a contender without a result.
    pub fn without_result(contender: Contender, knob: Setting, ending: Ending) -> Self {
        Row {
            contender,
            knob,
            seconds: None,
            steps: None,
            factorizations: None,
            force_evaluations: None,
            true_error: None,
            error_estimate: None,
            ending,
            remark: None,
            pareto: None,
        }
    }

    /// Seconds and error, if it succeeded.
    pub fn point(&self) -> Option<(f64, f64)> {
        let point = (self.seconds?.median, self.true_error?);
        self.ending.is_success().then_some(point)
    }
}

/// Speed against accuracy.
#[derive(Clone, Debug, Serialize)]
pub struct Chart {
    /// Name of the scenario.
    pub scenario: String,
    /// Number of veins.
    pub rods: usize,
    /// Whether the tips share one point.
    #[serde(skip)]
    pub joined: bool,
    /// Threads that every run had.
    pub threads: usize,
    /// Number of rounds in which all contenders took turns.
    pub rounds: usize,
    /// The reference for errors; `None` if no equilibrium was found.
    pub reference: Option<Reference>,
    /// Remarks on the measurement: one sentence each.
    pub remarks: Vec<String>,
    /// All settings of all contenders.
    #[serde(rename = "runs")]
    pub rows: Vec<Row>,
    /// Measurements of other programs.
    pub peers: Vec<Peer>,
    /// The fastest contender for every power of ten.
    pub decades: Vec<Decade>,
    /// Cost against the number of veins, if requested.
    pub scaling: Option<Scaling>,
}

/// The fastest contender for an accuracy, and how much slower the default one is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Decade {
    /// The accuracy.
    pub error: f64,
    /// The fastest contender that is as accurate.
    #[serde(rename = "method")]
    pub contender: Option<Contender>,
    /// Its setting.
    pub knob: Option<Setting>,
    /// Its time.
    pub seconds: Option<f64>,
    /// The setting at which the default contender is as accurate.
    pub default_knob: Option<Setting>,
    /// Its time.
    pub default_seconds: Option<f64>,
    /// Ratio of the default contender's time to the fastest.
    pub factor: Option<f64>,
}

/// Accuracies for which the fastest contender is given: powers of ten.
const DECADES: [i32; 9] = [-2, -3, -4, -5, -6, -7, -8, -9, -10];

impl Chart {
    /// Whether two independent methods agree on the reference.
    pub fn confirmed(&self) -> bool {
        self.reference.as_ref().is_some_and(|found| found.confirmed)
    }

    /// Errors below this cannot be distinguished from zero.
    fn floor(&self) -> f64 {
        self.reference
            .as_ref()
            .map_or(0.0, |found| found.known_within)
    }

    /// The chart with its Pareto front, the ratios of its peers, and the fastest contenders.
    pub fn compared(mut self) -> Self {
        self.mark_front();
        let floor = self.floor();
        let ratio = |peer: &Peer| {
            let (seconds, error) = peer.point()?;
            // Errors indistinguishable from zero count as equal.
            let ours = self.fastest(error.max(floor), |row| row.contender.is_default())?;
            Some(seconds / ours.seconds?.median)
        };
        let ratios: Vec<Option<f64>> = self.peers.iter().map(ratio).collect();
        for (peer, ratio) in self.peers.iter_mut().zip(ratios) {
            peer.ratio = ratio;
        }
        self.decades = DECADES.map(|power| self.decade(10f64.powi(power))).to_vec();
        self
    }

    /// The fastest row with an error of at most `error` among those wanted.
    fn fastest(&self, error: f64, wanted: impl Fn(&Row) -> bool) -> Option<&Row> {
        let rows = self.rows.iter().filter(|row| wanted(row));
        let timed = rows.filter_map(|row| Some((row.point()?, row)));
        let accurate = timed.filter(|((_, its_error), _)| *its_error <= error);
        let fastest = accurate.min_by(|((a, _), _), ((b, _), _)| a.total_cmp(b));
        fastest.map(|(_, row)| row)
    }

    fn decade(&self, error: f64) -> Decade {
        let fastest = self.fastest(error, |_| true);
        let default = self.fastest(error, |row| row.contender.is_default());
        let median = |row: &Row| row.seconds.map(|spread| spread.median);
        let [seconds, default_seconds] = [fastest, default].map(|row| row.and_then(median));
        let both = default_seconds.zip(seconds);
        Decade {
            error,
            contender: fastest.map(|row| row.contender),
            knob: fastest.map(|row| row.knob),
            seconds,
            default_knob: default.map(|row| row.knob),
            default_seconds,
            factor: both.map(|(default, best)| default / best),
        }
    }

    /// Marks the Pareto front of all rows and peers together.
    fn mark_front(&mut self) {
        const NOWHERE: (f64, f64) = (f64::INFINITY, f64::INFINITY);
        let points = self.rows.iter().map(Row::point);
        let points = points.chain(self.peers.iter().map(Peer::point));
        let points: Vec<(f64, f64)> = points.map(|point| point.unwrap_or(NOWHERE)).collect();
        let mut marks = front(&points, self.floor()).into_iter();
        for (row, on_front) in self.rows.iter_mut().zip(&mut marks) {
            row.pareto = Some(on_front && row.point().is_some());
        }
        for (peer, on_front) in self.peers.iter_mut().zip(marks) {
            peer.pareto = on_front && peer.point().is_some();
        }
    }
}
