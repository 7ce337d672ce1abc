//! `trace`: an equilibrium followed through one number of its scenario.

mod law;
mod result;
mod run;

pub use law::Law;
pub use result::{PointKind, Trace, TraceBranch, TracePoint, TraceShow};
pub use run::trace;
pub(super) use run::trace_seen;

use super::vary::{Base, Vary};
use crate::relax::RelaxError;
use crate::scenario::Key;
use crate::study::{Target, VaryError};

/// Most branches of a trace.
pub const MOST_BRANCHES: usize = 24;

/// Most points of a branch unless told otherwise.
pub const MOST_POINTS: usize = 2000;

/// What is asked of a trace.
#[derive(Clone, Debug)]
pub struct TraceRequest {
    /// The scenario.
    pub base: Base,
    /// The number that varies, and over which range; as many steps as it has
    /// values would follow a leaf that does not change.
    pub vary: Vary,
    /// Follow the branches that cross, too.
    pub switch: bool,
    /// Go by Newton's method to the first equilibrium, stable or not.
    pub keep_unstable: bool,
    /// The grid on which the branch is followed; left out: twice as fine as the
    /// coarsest on which the first equilibrium was found.
    pub segments: Option<usize>,
    /// Wanted accuracy of the tips, relative to the longest rod; left out: the
    /// scenario's.
    pub tolerance: Option<f64>,
    /// Most points of a branch.
    pub most_points: usize,
    /// Area of the leaf's cross-section, in the scenario's units, for an
    /// effective Young's modulus.
    pub cross_section: Option<f64>,
}

/// A trace that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// The number cannot be followed.
    #[error("{0}")]
    Vary(String),
    /// An option has a value it cannot have.
    #[error("{0}")]
    Option(String),
    /// The scenario at the start of the range is refused.
    #[error(transparent)]
    Scenario(#[from] VaryError),
    /// The first equilibrium is asked for in a way that cannot be met.
    #[error(transparent)]
    Relax(#[from] RelaxError),
}

impl TraceRequest {
    /// Whether it can be met, as far as can be told before.
    pub(super) fn check(&self) -> Result<(), TraceError> {
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
                    key if key.path().starts_with("dynamics.") => {
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
        if self.base.scenario().tip_moment != [0.0; 3] {
            return Err(refuse(NO_MOMENT));
        }
        if self.most_points < 2 {
            let why = format!("points {}: must be 2 or more", self.most_points);
            return Err(TraceError::Option(why));
        }
        if let Some(area) = self.cross_section
            && !(area > 0.0 && area.is_finite())
        {
            let why = format!("cross-section {area:?}: must be greater than 0");
            return Err(TraceError::Option(why));
        }
        Ok(())
    }
}

const NO_MOMENT: &str =
    "a dead moment on the tip has no potential: there is no index to follow; use loads that have";
