//! `trace`: an equilibrium followed through a parameter of its scenario.

mod law;
mod result;
mod run;
mod show;

pub use law::Law;
pub use result::{PointKind, Trace, TraceBranch, TracePoint};
pub(super) use run::traced;
pub use run::{trace, trace_through};
pub use show::TraceShow;

use super::vary::{Base, Vary};
use crate::limit::Limit;
use crate::refusal::RefusedOption;
use crate::relax::{RelaxError, without_wind};
use crate::scenario::Key;
use crate::study::{Target, UnknownWord, VaryError};
use std::str::FromStr;

/// Largest number of branches of a trace.
pub const MOST_BRANCHES: usize = 24;

/// Default for the largest number of points of a branch.
pub const MOST_POINTS: usize = 2000;

/// A request for a trace.
#[derive(Clone, Debug)]
pub struct TraceRequest {
    /// The scenario.
    pub base: Base,
    /// The number that varies, with its range; a leaf that does not change would be followed
    /// in as many steps as it has values.
    pub vary: Vary,
    /// Whether to follow crossing branches as well.
    pub switch: bool,
    /// What ends a branch before the end of the range, if anything.
    pub until: Option<TraceUntil>,
    /// Whether to take the first equilibrium from Newton's method, stable or not.
    pub keep_unstable: bool,
    /// The grid on which the branch is followed; default: twice as fine as the
    /// coarsest on which the first equilibrium was found.
    pub segments: Option<usize>,
    /// Required accuracy of the tips, relative to the longest rod; default: the scenario's.
    pub tolerance: Option<f64>,
    /// Largest number of points of a branch.
    pub most_points: usize,
    /// When the run ends; what is known of the branches then is its result.
    pub limit: Limit,
}

/// What ends a branch before the end of the range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraceUntil {
    /// The loss of its stability; a branch that is unstable from its beginning ends where it
    /// becomes unstable in one more direction: where its Morse index grows.
    Unstable,
}

impl TraceUntil {
    /// The word on the command line and in Python.
    pub fn word(self) -> &'static str {
        match self {
            TraceUntil::Unstable => "unstable",
        }
    }
}

impl FromStr for TraceUntil {
    type Err = UnknownWord;

    fn from_str(text: &str) -> Result<Self, UnknownWord> {
        let allowed = [TraceUntil::Unstable];
        let found = allowed.into_iter().find(|it| it.word() == text);
        found.ok_or_else(|| UnknownWord {
            found: text.into(),
            allowed: allowed.map(TraceUntil::word).into(),
        })
    }
}

/// Why a trace cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// The number cannot be followed.
    #[error("{0}")]
    Vary(String),
    /// An option has a value it cannot have.
    #[error("{0}")]
    Option(#[from] RefusedOption),
    /// The scenario at the start of the range is invalid.
    #[error(transparent)]
    Scenario(#[from] VaryError),
    /// The request for the first equilibrium cannot be met.
    #[error(transparent)]
    Relax(#[from] RelaxError),
}

impl TraceRequest {
    /// Validates the request before it is run.
    pub(super) fn check(&self) -> Result<(), TraceError> {
        without_wind(self.base.scenario(), "following a branch")?;
        let keys = &self.vary.keys;
        let refuse = |why: &str| TraceError::Vary(format!("{keys}: {why}"));
        if keys.is_whole() {
            return Err(refuse(
                "a whole number has nothing between its values to follow",
            ));
        }
        for target in keys.targets() {
            let why = match target {
                Target::Knob(_) => "is a setting of a method, not of the leaf",
                Target::Entry(part) => match part.key {
                    Key::TipMoment => NO_MOMENT,
                    Key::Tolerance => "changes no leaf",
                    Key::Density if self.base.scenario().g != [0.0; 3] => continue,
                    key if ["dynamics.", "wind."]
                        .iter()
                        .any(|it| key.path().starts_with(it)) =>
                    {
                        "changes a motion, but no equilibrium"
                    }
                    _ => continue,
                },
            };
            return Err(refuse(why));
        }
        if self.vary.values.len() < 2 {
            return Err(refuse("FROM and TO are the same"));
        }
        if self.base.scenario().has_moments() {
            return Err(refuse(NO_MOMENT));
        }
        if self.most_points < 2 {
            return Err(RefusedOption::new("points", self.most_points, "must be 2 or more").into());
        }
        Ok(())
    }
}

const NO_MOMENT: &str = "a dead moment (load.tip_moment, load.point.moment) has no potential: there is no index to follow; use loads that have";
