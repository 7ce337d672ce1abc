//! Speed against accuracy: all methods for an equilibrium, over their own accuracy settings,
//! measured together against one reference.

mod front;
mod peers;
mod plan;
mod reference;
mod result;
mod rows;
mod run;
mod scaling;
mod timing;

use crate::refusal::RefusedOption;
use run::Runs;
use thiserror::Error;

pub use peers::{Peer, PeerRow};
pub use plan::{Contender, Setting};
pub use reference::Reference;
pub use result::{Chart, Decade, Ending, Row};
pub use scaling::{Scaling, ScalingRow, scaling};
pub use timing::{Spread, Turn};

use crate::relax::{RelaxError, without_wind};
use crate::scenario::{Scenario, longest};

/// Options of a chart.
#[derive(Clone, Debug)]
pub struct ChartOptions {
    /// Approximate total time of the measurement, in seconds; slow runs are made once, however
    /// long they take.
    pub seconds: f64,
    /// The methods measured.
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

/// Longest time that can be requested: a day.
const MOST_SECONDS: f64 = 86_400.0;

/// Why a chart cannot be made.
#[derive(Debug, Error)]
pub enum ChartError {
    /// The leaf cannot be relaxed.
    #[error(transparent)]
    Relax(#[from] RelaxError),
    /// The time requested is out of range.
    #[error("{0}")]
    Seconds(#[from] RefusedOption),
    /// The single thread for all runs cannot be started.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] rayon::ThreadPoolBuildError),
}

/// Charts speed against accuracy for a leaf. Everything runs on one thread.
pub fn chart(
    scenario: &Scenario,
    options: &ChartOptions,
    progress: &mut (dyn FnMut(&Turn) + Send),
) -> Result<Chart, ChartError> {
    without_wind(scenario, "a chart")?;
    let each = |&who: &Contender| {
        let knobs = who.knobs().into_iter();
        knobs.map(move |knob| Runs::new(scenario, who, knob))
    };
    let mut all: Vec<Runs> = options.contenders.iter().flat_map(each).collect();
    let (reference, rows, rounds) = on_one_thread(options.seconds, || {
        let rounds = timing::measure(&mut all, options.seconds, progress);
        let found = reference::find(scenario, rows::stations(&all))?;
        let (reference, answer) = found.unzip();
        Ok((reference, rows::rows(&all, answer.as_ref()), rounds))
    })?;
    let rods = scenario.rods.len();
    let longest = longest(&scenario.rods);
    let (peers, others) = peers::about(&options.peers, &scenario.name, rods, longest);
    let mut remarks = rows::remarks(&rows, &options.contenders, reference.as_ref());
    remarks.extend(others);
    let chart = Chart {
        scenario: scenario.name.clone(),
        rods,
        joined: scenario.joined,
        threads: 1,
        rounds,
        reference,
        remarks,
        rows,
        peers,
        decades: Vec::new(),
        scaling: None,
    };
    Ok(chart.compared())
}

/// Calls a function on one thread, if it may take so many `seconds`.
fn on_one_thread<R: Send>(
    seconds: f64,
    work: impl FnOnce() -> Result<R, RelaxError> + Send,
) -> Result<R, ChartError> {
    if !(seconds > 0.0 && seconds <= MOST_SECONDS) {
        let allowed = format!("must be greater than 0 and at most {MOST_SECONDS}");
        return Err(RefusedOption::new("seconds", seconds, allowed).into());
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    Ok(pool.install(work)?)
}
