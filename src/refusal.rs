//! Refused options, and what methods do not model, as data: what reads them writes them as its
//! users do.

/// An option that cannot have the value it was given: `--step 0` of a program, `step=0` of a
/// function.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{option} = {value}: {reason}")]
pub struct RefusedOption {
    /// Its name, words with `_` between them.
    pub option: &'static str,
    /// The value.
    pub value: String,
    /// What it must be, or what to change.
    pub reason: String,
}

impl RefusedOption {
    /// An option with this value, for this reason.
    pub fn new(option: &'static str, value: impl ToString, reason: impl Into<String>) -> Self {
        RefusedOption {
            option,
            value: value.to_string(),
            reason: reason.into(),
        }
    }
}

/// What a scenario has and a method or a question does not take into account: an answer to it would
/// be that of another scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unmodelled {
    /// Grips along veins.
    #[error(
        "[[grip]]: {what} does not take grips along veins into account, as relaxation and following do; leave them out, or hold the tip by [tip]"
    )]
    Grips {
        /// The method or the question.
        what: &'static str,
    },
    /// Wind.
    #[error(
        "[wind]: {what} does not take wind into account: simulate does, and relax --path release in a steady one; leave it out"
    )]
    Wind {
        /// The method or the question.
        what: &'static str,
    },
    /// A leaf to which no continuation leads from the arcs that shooting starts from.
    #[error("{why}; use shooting-from-rest")]
    FromArcs {
        /// What the leaf has, and what leads it to rest instead.
        why: &'static str,
    },
}
