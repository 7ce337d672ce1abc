//! Which method moves a leaf, and why.

use super::cost::Cost;
use super::{Options, Scheme};
use crate::motion::Physics;
use crate::numbers::two_digits;
use crate::words;
use serde::{Serialize, Serializer};
use std::fmt;

words! {
    /// Why a motion has its method.
    pub enum Reason {
        /// It was requested.
        Requested = "requested",
        /// The explicit method has no stable step for rigid rods.
        RigidRods = "rigid-rods",
        /// The base is free, and the semi-implicit method holds it.
        FreeBase = "free-base",
        /// A load has a pulse that is too short for the semi-implicit method.
        ShortPulse = "short-pulse",
        /// The length of the steps was given, and explicit ones are cheaper.
        GivenStep = "given-step",
        /// It takes less time, as the costs of both methods say.
        Cost = "cost",
    }
}

/// The method of a motion, and why. Displayed, it is a short explanation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The method.
    pub scheme: Scheme,
    /// Why.
    pub reason: Reason,
    /// The costs that were compared, if any were: of the explicit and of the semi-implicit
    /// method.
    pub costs: Option<[Cost; 2]>,
}

impl Choice {
    /// The choice that does not depend on costs, if there is one.
    pub(super) fn without_costs(options: &Options, physics: &Physics, rigid: bool) -> Option<Self> {
        let of = |scheme, reason| Choice {
            scheme,
            reason,
            costs: None,
        };
        if let Some(scheme) = options.scheme {
            return Some(of(scheme, Reason::Requested));
        }
        if rigid {
            return Some(of(Scheme::SemiImplicit, Reason::RigidRods));
        }
        let reason = if !physics.clamped() {
            Reason::FreeBase
        } else if physics.too_short_a_pulse().is_some() {
            Reason::ShortPulse
        } else if options.step.is_some() {
            Reason::GivenStep
        } else {
            return None;
        };
        Some(of(Scheme::Explicit, reason))
    }

    /// The cheaper method.
    pub(super) fn by_costs(explicit: Cost, semi_implicit: Cost) -> Self {
        Choice {
            scheme: match explicit.seconds <= semi_implicit.seconds {
                true => Scheme::Explicit,
                false => Scheme::SemiImplicit,
            },
            reason: Reason::Cost,
            costs: Some([explicit, semi_implicit]),
        }
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self.reason {
            Reason::Requested => "as requested",
            Reason::RigidRods => "the explicit method cannot move rigid rods (a stiffness is inf)",
            Reason::FreeBase => "the semi-implicit method holds the base, and this one is free",
            Reason::ShortPulse => "a load has a pulse too short for the semi-implicit method",
            Reason::GivenStep => "of steps of a given length the explicit ones are cheaper",
            Reason::Cost => "it costs less: ",
        })?;
        let Some([explicit, semi_implicit]) = self.costs else {
            return Ok(());
        };
        write!(
            f,
            "{explicit} by the explicit method, {semi_implicit} by the semi-implicit one"
        )
    }
}

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let about = if self.at_least { "more than" } else { "some" };
        let [steps, seconds] = [self.steps, self.seconds].map(two_digits);
        write!(f, "{about} {steps} steps in {seconds} s")
    }
}

impl Serialize for Choice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Keys {
            reason: Reason,
            explanation: String,
            explicit: Option<Cost>,
            semi_implicit: Option<Cost>,
        }
        let of = |method: usize| self.costs.map(|costs| costs[method]);
        let keys = Keys {
            reason: self.reason,
            explanation: self.to_string(),
            explicit: of(0),
            semi_implicit: of(1),
        };
        keys.serialize(serializer)
    }
}
