//! What is said of a chart, and of each of its runs.

use crate::motion::Stopped;
use crate::relax::RelaxError;
use crate::run::remarks;
use crate::simulate::SimulationError;
use crate::study::chart::contender::{AccuracySetting, SolverConfig};
use crate::study::remark::SolutionRemark;

remarks! {
    /// What is to be said of a chart.
    pub enum ChartRemark {
        /// Explicit relaxation, of which the time step is no setting.
        #[error(
            "explicit relaxation has no knob for its time step: it takes the longest stable one"
        )]
        ExplicitStep = "explicit-step",
        /// A leaf that can move without resistance, as these words say.
        #[error("errors tell little: {0}, and runs come to rest in different places")]
        NeutralDirection(String) = "neutral-direction",
        /// A method that does not model the leaf.
        #[error("{} is not charted: {why}", .contender.word())]
        NotCharted {
            /// The method.
            contender: SolverConfig,
            /// Why.
            why: ChartRowRemark,
        } = "not-charted",
        /// Settings of a method that were not run.
        #[error(
            "{} is not run from {from} on: the run before took too long; allow more seconds",
            .contender.word()
        )]
        NotRun {
            /// The method.
            contender: SolverConfig,
            /// The coarsest of them.
            from: AccuracySetting,
        } = "not-run",
        /// Estimates that are smaller than the true error.
        #[error("{} underestimates its error at {}", .contender.word(), settings_text(.at))]
        Underestimated {
            /// The method.
            contender: SolverConfig,
            /// Its settings.
            at: Vec<AccuracySetting>,
        } = "underestimated",
        /// Measurements of other programs on another leaf.
        #[error("{} about another leaf, and left out", peer_rows_text(*.rows))]
        PeersOfAnotherLeaf {
            /// Their number.
            rows: usize,
        } = "peers-of-another-leaf",
        /// Measurements of other programs without an error.
        #[error(
            "{} without the error of a leaf at rest, and left out",
            peer_rows_text(*.rows)
        )]
        PeersWithoutError {
            /// Their number.
            rows: usize,
        } = "peers-without-error",
    }

    /// Why a run of a chart did not succeed.
    pub enum ChartRowRemark {
        /// A leaf or a setting that the method refuses.
        #[error("{0}")]
        Refused(RelaxError) = "refused",
        /// A motion that the method refuses.
        #[error("{0}")]
        MotionRefused(SimulationError) = "refused",
        /// Why the motion ended early.
        #[error("{0}")]
        MotionStopped(Stopped) = "motion-stopped",
        /// What the method says of its answer.
        #[error("{0}")]
        Solution(SolutionRemark) = inner.code(),
        /// A tolerance that no single grid reaches.
        #[error("no grid of up to {finest} segments is accurate enough")]
        NoAccurateGrid {
            /// Segments of the finest grid.
            finest: usize,
        } = "no-accurate-grid",
    }
}

fn settings_text(settings: &[AccuracySetting]) -> String {
    let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
    settings.join(", ")
}

fn peer_rows_text(rows: usize) -> String {
    match rows {
        1 => "1 row of peers is".to_owned(),
        rows => format!("{rows} rows of peers are"),
    }
}
