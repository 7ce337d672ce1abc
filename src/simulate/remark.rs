//! What is said of a motion: why it ended early, or what makes it doubtful.

use crate::motion::Stopped;
use crate::numbers::format_two_digits;
use crate::run::remarks;
use crate::scenario::PlausibilityWarning;
use crate::simulate::cheaper::CheaperMotion;
use serde::{Serialize, Serializer};

remarks! {
    /// What is to be said of the end of a motion.
    pub enum MotionRemark {
        /// It ended early.
        #[error("{0}")]
        Stopped(Stopped) = inner.word(),
        /// It is completed, and its energy balance is off.
        #[error("{0}")]
        Imbalance(Imbalance) = "imbalance",
    }

    /// What makes a motion doubtful. Times and lengths are in the units of the scenario.
    pub enum MotionDoubt {
        /// What in the scenario is probably not what was intended.
        #[error("{0}")]
        Implausible(PlausibilityWarning) = inner.code(),
        /// A start at an unstable equilibrium, or beside one but without a deviation along its
        /// unstable modes.
        #[error(
            "the motion starts at an unstable equilibrium (negative eigenvalues: {index}), and nothing displaces the leaf \
             the way it would leave: a deviation grows by e in {}, and rounding decides when and to which side; \
             give it a small push, such as a short dynamics.tip_force",
            format_two_digits(*.growth_time)
        )]
        UnstableStart {
            /// The Morse index of the equilibrium.
            index: usize,
            /// The time in which a deviation grows by e.
            growth_time: f64,
        } = "unstable-start",
        /// A motion that was stopped and would have cost much less otherwise.
        #[error("the motion takes long; less would be taken with {}", cheaper_text(.cheaper))]
        Costly {
            /// What would have made it cost less, the cheapest change first.
            cheaper: Vec<CheaperMotion>,
        } = "costly",
        /// Tips that are less accurate than they were to be.
        #[error(
            "the error of the tips may be {}, and {} was aimed at: {}",
            format_two_digits(*.error), format_two_digits(*.aim),
            match .refined_within {
                Some(seconds) => format!(
                    "finer grids would take more than {seconds} seconds, or cannot be followed; give more segments{}",
                    if *.undamped { ", or dynamics.internal_damping, by which the ripples of a blow fade" } else { "" }
                ),
                None => "give more segments and shorter steps, or leave both out".into(),
            }
        )]
        Inaccurate {
            /// The bound on their error.
            error: f64,
            /// The error that was aimed at.
            aim: f64,
            /// The seconds within which grid and steps were refined, if they were.
            refined_within: Option<f64>,
            /// Whether the material has no damping of its own.
            undamped: bool,
        } = "inaccurate",
        /// Runs on two grids that part.
        #[error(
            "from t = {} on runs on two grids part, as where a leaf snaps: how accurate the tips are is known until then",
            format_two_digits(*.from)
        )]
        RunsPart {
            /// The time from which on they do.
            from: f64,
        } = "runs-part",
        /// Tips of unknown accuracy.
        #[error(
            "how accurate the tips are is not known: there is no second run to compare with{}",
            .why.as_ref().map_or(String::new(), |why| format!(" (on another grid: {why})"))
        )]
        NotCompared {
            /// Why there is none, if it was tried.
            why: Option<String>,
        } = "not-compared",
    }
}

/// Changes that make a motion cost less, as one phrase.
pub fn cheaper_text(cheaper: &[CheaperMotion]) -> String {
    let all: Vec<String> = cheaper.iter().map(ToString::to_string).collect();
    all.join("; or with ")
}

/// The largest deviation of the energy balance of a motion from that at its start, as a part of
/// the largest energy that moved.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the energy balance is off by {:.0} % of the largest energy that moved: compare with a motion in shorter steps",
    100.0 * .0
)]
pub struct Imbalance(pub f64);

impl Serialize for Imbalance {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
