//! Speed against accuracy: every way to bring a leaf to rest, over its own knob,
//! measured side by side against one reference.

mod front;
mod judge;
mod peers;
mod plan;
mod reference;
mod run;
mod scaling;
mod timing;

use thiserror::Error;

pub use peers::{Peer, PeerRow};
pub use plan::{Contender, Setting};
pub use reference::Reference;
pub use scaling::{Scaling, ScalingRow, scaling};
pub use timing::{Spread, Turn};

use crate::relax::{Outcome, RelaxError, Work};
use crate::scenario::Scenario;

/// What is asked of a chart.
#[derive(Clone, Debug)]
pub struct ChartOptions {
    /// About how long to measure, in seconds; slow runs are made once whatever
    /// they take.
    pub seconds: f64,
    /// Who takes part.
    pub contenders: Vec<Contender>,
    /// Measurements of other programs.
    pub peers: Vec<PeerRow>,
}

impl Default for ChartOptions {
    fn default() -> Self {
        ChartOptions {
            seconds: 10.0,
            contenders: Contender::ALL.to_vec(),
            peers: Vec::new(),
        }
    }
}

/// Longest time that can be asked for: a day.
const MOST_SECONDS: f64 = 86_400.0;

/// A chart that cannot be made.
#[derive(Debug, Error)]
pub enum ChartError {
    /// The leaf cannot be relaxed.
    #[error(transparent)]
    Relax(#[from] RelaxError),
    /// The time allowed is out of range.
    #[error("--seconds {found}: must be greater than 0 and at most {MOST_SECONDS}")]
    Seconds {
        /// The time asked for.
        found: f64,
    },
    /// The one thread that all runs have cannot be started.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] rayon::ThreadPoolBuildError),
}

/// How a run ended, for a chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// As the run itself says.
    Ended(Outcome),
    /// At rest, but not in the reference's equilibrium.
    OtherEquilibrium,
    /// The contender cannot be asked this.
    Refused,
    /// Not run, as a coarser run of the contender took too long.
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

    /// Whether the leaf is at rest where it should be, as accurately as asked
    /// for, and stable as far as known.
    pub fn is_success(self) -> bool {
        let Ending::Ended(outcome) = self else {
            return false;
        };
        matches!(outcome, Outcome::Converged | Outcome::ConvergedAfterSaddle)
    }
}

/// One setting of one contender. Errors are relative to the longest rod.
#[derive(Clone, Debug)]
pub struct Row {
    /// Who.
    pub contender: Contender,
    /// Where its knob stands.
    pub knob: Setting,
    /// Times from the checked scenario to the result; `None` if it did not run.
    pub seconds: Option<Spread>,
    /// What a run does.
    pub work: Work,
    /// Largest distance from the reference; `None` if the leaf is not at rest,
    /// or there is no reference.
    pub true_error: Option<f64>,
    /// What the run itself says of its error.
    pub error_estimate: Option<f64>,
    /// How it ended.
    pub ending: Ending,
    /// Why it did not succeed, in a sentence.
    pub remark: Option<String>,
    /// Whether it is on the Pareto front.
    pub pareto: bool,
}

impl Row {
    /// Seconds and error, if it succeeded.
    pub fn point(&self) -> Option<(f64, f64)> {
        let point = (self.seconds?.median, self.true_error?);
        self.ending.is_success().then_some(point)
    }
}

impl Peer {
    /// Seconds and error, if it came to rest.
    pub fn point(&self) -> Option<(f64, f64)> {
        Some((self.seconds.median, self.true_error?))
    }
}

/// Speed against accuracy.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Name of the scenario.
    pub scenario: String,
    /// Number of veins.
    pub rods: usize,
    /// Whether the tips share one point.
    pub joined: bool,
    /// What errors are measured against; `None` if no equilibrium was found.
    pub reference: Option<Reference>,
    /// All settings of all contenders.
    pub rows: Vec<Row>,
    /// Measurements of other programs.
    pub peers: Vec<Peer>,
    /// Rounds in which all contenders took turns.
    pub rounds: usize,
    /// What is to be said of the measurement: one sentence each.
    pub remarks: Vec<String>,
    /// Cost against the number of veins, if asked for.
    pub scaling: Option<Scaling>,
}

/// The fastest ways to an accuracy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decade {
    /// The accuracy.
    pub error: f64,
    /// The fastest row that is as accurate.
    pub fastest: Option<usize>,
    /// The fastest such row of the default contender.
    pub default: Option<usize>,
    /// How many times longer the default contender takes.
    pub factor: Option<f64>,
}

/// Accuracies for which the fastest way is told: powers of ten.
const DECADES: [i32; 9] = [-2, -3, -4, -5, -6, -7, -8, -9, -10];

impl Chart {
    /// Whether two independent methods agree on the reference.
    pub fn confirmed(&self) -> bool {
        self.reference.as_ref().is_some_and(|found| found.confirmed)
    }

    /// Errors that cannot be told from none.
    pub fn floor(&self) -> f64 {
        self.reference
            .as_ref()
            .map_or(0.0, |found| found.known_within)
    }

    /// The fastest row with an error of at most `error` among those wanted.
    fn fastest(&self, error: f64, wanted: impl Fn(&Row) -> bool) -> Option<usize> {
        let rows = self.rows.iter().map(|row| match row.point() {
            Some(point) if wanted(row) => point,
            _ => (f64::INFINITY, f64::INFINITY),
        });
        front::fastest(rows, error)
    }

    /// The fastest ways to every power of ten.
    pub fn decades(&self) -> Vec<Decade> {
        let seconds = |row: usize| self.rows[row].seconds.map(|spread| spread.median);
        let decades = DECADES.map(|decade| {
            let error = 10f64.powi(decade);
            let fastest = self.fastest(error, |_| true);
            let default = self.fastest(error, |row| row.contender == Contender::SemiImplicit);
            let factor = default.and_then(seconds).zip(fastest.and_then(seconds));
            Decade {
                error,
                fastest,
                default,
                factor: factor.map(|(default, best)| default / best),
            }
        });
        decades.to_vec()
    }

    /// A peer's time over that of the default contender at an error at most as
    /// large; errors that cannot be told from none are equal.
    pub fn ratio(&self, peer: &Peer) -> Option<f64> {
        let (seconds, error) = peer.point()?;
        let error = error.max(self.floor());
        let ours = self.fastest(error, |row| row.contender == Contender::SemiImplicit)?;
        Some(seconds / self.rows[ours].seconds?.median)
    }

    /// Marks the Pareto front of all rows and peers together.
    fn mark_front(&mut self) {
        let floor = self.floor();
        let rows = self.rows.iter_mut();
        let rows = rows.filter_map(|row| Some((row.point()?, &mut row.pareto)));
        let peers = self.peers.iter_mut();
        let peers = peers.filter_map(|peer| Some((peer.point()?, &mut peer.pareto)));
        let (points, marks): (Vec<_>, Vec<_>) = rows.chain(peers).unzip();
        for (mark, on_it) in marks.into_iter().zip(front::front(&points, floor)) {
            *mark = on_it;
        }
    }
}

/// Charts speed against accuracy for a leaf. Everything runs on one thread.
///
/// # Errors
/// Requests that cannot be met.
pub fn chart(
    scenario: &Scenario,
    options: &ChartOptions,
    progress: &mut (dyn FnMut(&Turn) + Send),
) -> Result<Chart, ChartError> {
    let cells = plan::cells(scenario, &options.contenders);
    let (reference, rows, rounds) = alone(options.seconds, || {
        let (measured, rounds) = timing::measure(&cells, options.seconds, progress);
        let found = reference::find(scenario, judge::stations(&measured))?;
        let (reference, shape) = found.unzip();
        let rows = judge::rows(scenario, &cells, measured, shape.as_ref());
        Ok((reference, rows, rounds))
    })?;
    let rods = scenario.rods.len();
    let (peers, others) =
        peers::about(&options.peers, &scenario.name, rods, run::longest(scenario));
    let mut remarks = judge::remarks(&rows, &options.contenders, reference.as_ref());
    remarks.extend(others);
    let mut chart = Chart {
        scenario: scenario.name.clone(),
        rods,
        joined: scenario.joined,
        reference,
        rows,
        peers,
        rounds,
        remarks,
        scaling: None,
    };
    chart.mark_front();
    Ok(chart)
}

/// Does something on one thread, if it may take so many `seconds`.
fn alone<R: Send>(
    seconds: f64,
    work: impl FnOnce() -> Result<R, RelaxError> + Send,
) -> Result<R, ChartError> {
    if !(seconds > 0.0 && seconds <= MOST_SECONDS) {
        return Err(ChartError::Seconds { found: seconds });
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    Ok(pool.install(work)?)
}
