//! Which method moves a leaf, and why.
//!
//! What a motion costs by either method is known or estimated beforehand: numbers of steps times measured
//! times.

use crate::leaf::{DiscreteLeaf, Leaf, State};
use crate::motion::{
    Explicit, ExplicitRefusal, MotionTimes, Physics, SemiImplicit, StepControl, TimeIntegrator,
};
use crate::numbers::format_two_digits;
use crate::simulate::request::{Options, Scheme};
use crate::words;
use serde::{Serialize, Serializer};
use std::fmt;

words! {
    /// Why a motion has its method.
    pub enum SchemeReason {
        /// It was requested.
        Requested = "requested",
        /// The explicit method has no stable step for rigid rods.
        RigidRods = "rigid-rods",
        /// The explicit method does not move masses off the axis.
        MassesOffAxis = "masses-off-axis",
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
pub struct SchemeChoice {
    /// The method.
    pub scheme: Scheme,
    /// Why.
    pub reason: SchemeReason,
    /// The costs that were compared, if any were: of the explicit and of the semi-implicit
    /// method.
    pub costs: Option<[MotionCost; 2]>,
}

impl SchemeChoice {
    /// The choice that does not depend on costs, if there is one.
    pub(super) fn forced_choice(
        options: &Options,
        physics: &Physics,
        obstacle: Option<ExplicitRefusal>,
    ) -> Option<Self> {
        let of = |scheme, reason| SchemeChoice {
            scheme,
            reason,
            costs: None,
        };
        if let Some(scheme) = options.scheme {
            return Some(of(scheme, SchemeReason::Requested));
        }
        if let Some(obstacle) = obstacle {
            let reason = match obstacle {
                ExplicitRefusal::RigidRod => SchemeReason::RigidRods,
                ExplicitRefusal::MassOffAxis => SchemeReason::MassesOffAxis,
            };
            return Some(of(Scheme::SemiImplicit, reason));
        }
        let reason = if !physics.clamped() {
            SchemeReason::FreeBase
        } else if physics.unresolved_pulse_time().is_some() {
            SchemeReason::ShortPulse
        } else if options.step.is_some() {
            SchemeReason::GivenStep
        } else {
            return None;
        };
        Some(of(Scheme::Explicit, reason))
    }

    /// The cheaper method.
    pub(super) fn cheaper_method(explicit: MotionCost, semi_implicit: MotionCost) -> Self {
        SchemeChoice {
            scheme: match explicit.seconds <= semi_implicit.seconds {
                true => Scheme::Explicit,
                false => Scheme::SemiImplicit,
            },
            reason: SchemeReason::Cost,
            costs: Some([explicit, semi_implicit]),
        }
    }
}

impl fmt::Display for SchemeChoice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self.reason {
            SchemeReason::Requested => "as requested",
            SchemeReason::RigidRods => {
                "the explicit method cannot move rigid rods (a stiffness is inf)"
            }
            SchemeReason::MassesOffAxis => "the explicit method does not move masses off the axis",
            SchemeReason::FreeBase => {
                "the semi-implicit method holds the base, and this one is free"
            }
            SchemeReason::ShortPulse => "a load has a pulse too short for the semi-implicit method",
            SchemeReason::GivenStep => "of steps of a given length the explicit ones are cheaper",
            SchemeReason::Cost => "it costs less on the first grid: ",
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

impl fmt::Display for MotionCost {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let about = if self.at_least { "more than" } else { "some" };
        let [steps, seconds] = [self.steps, self.seconds].map(format_two_digits);
        write!(f, "{about} {steps} steps in {seconds} s")
    }
}

impl Serialize for SchemeChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Keys {
            reason: SchemeReason,
            explanation: String,
            explicit: Option<MotionCost>,
            semi_implicit: Option<MotionCost>,
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

/// Measured seconds of steps.
struct MotionCosts {
    /// Seconds of an explicit step, whatever the leaf.
    explicit_step: f64,
    /// Further seconds of an explicit step per segment.
    explicit_segment: f64,
    /// Further seconds of an explicit step per strip of tissue between two veins: of a plate whose tissue is springs 0.7
    /// microseconds, of plates and blades whose tissue contracts 1.4.
    explicit_strip: f64,
    /// Seconds of a semi-implicit step, whatever the leaf, with the iterations and the rejected attempts that belong to
    /// it.
    semi_implicit_step: f64,
    /// Further seconds of a semi-implicit step per segment.
    semi_implicit_segment: f64,
    /// Number of rods that a semi-implicit step processes at a time.
    rods_at_once: usize,
    /// Further seconds of a semi-implicit step per strip of tissue between two veins, with which all veins are solved for
    /// together: of blades of 5 and 9 veins on 16 and 32 segments 22 to 28 microseconds.
    semi_implicit_strip: f64,
}

const COSTS: MotionCosts = MotionCosts {
    explicit_step: 1e-7,
    explicit_segment: 2e-8,
    explicit_strip: 1e-6,
    semi_implicit_step: 3e-6,
    semi_implicit_segment: 8e-7,
    rods_at_once: 4,
    semi_implicit_strip: 2.4e-5,
};

/// The pilot that estimates the number of semi-implicit steps. Of 60 leaves as people measure them
/// the estimates were 0.54 to 1.45 of the true numbers, of 200 with internal damping, which need
/// few steps, 1.2 to 3.2.
struct PilotRun {
    /// The permitted local error of its steps, as a multiple of the tolerance.
    error_ratio: f64,
    /// The largest permitted local error of its steps.
    largest_error: f64,
    /// The exponent with which the number of steps grows with the accuracy. By the order of the
    /// method it is 1/3; measured, it is a little more, as fast motions count that longer steps
    /// pass over.
    step_exponent: f64,
    /// Measured part of a step's time that a step of the pilot takes, whose equations are solved
    /// with lower accuracy.
    step_cost: f64,
    /// The longest time of the pilot in seconds.
    longest_seconds: f64,
}

const PILOT: PilotRun = PilotRun {
    error_ratio: 1000.0,
    largest_error: 0.1,
    step_exponent: 0.357,
    step_cost: 0.5,
    longest_seconds: 0.3,
};

/// The cost of a motion by a method.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MotionCost {
    /// Number of time steps; of the semi-implicit method an estimate.
    pub steps: f64,
    /// Seconds that they take on one core of a machine of 2020, approximately.
    pub seconds: f64,
    /// Whether both numbers are only known to be at least as large.
    pub at_least: bool,
}

/// Approximate seconds of an explicit step.
pub(super) fn explicit_step(rods: usize, segments: usize) -> f64 {
    COSTS.explicit_step + COSTS.explicit_segment * (rods * segments) as f64
}

/// Approximate seconds of a semi-implicit step.
pub(super) fn semi_implicit_step(rods: usize, segments: usize) -> f64 {
    let segments = rods.next_multiple_of(COSTS.rods_at_once) * segments;
    COSTS.semi_implicit_step + COSTS.semi_implicit_segment * segments as f64
}

/// Approximate seconds that tissue adds to a step by this method, of which it takes most.
pub(super) fn step_of_tissue(leaf: &Leaf, segments: usize, scheme: Scheme) -> f64 {
    let strips = match leaf.has_tissue() {
        true => leaf.rods().saturating_sub(1) * segments,
        false => 0,
    };
    let of_strip = match scheme {
        Scheme::Explicit => COSTS.explicit_strip,
        Scheme::SemiImplicit => COSTS.semi_implicit_strip,
    };
    of_strip * strips as f64
}

/// The cost of the whole motion by the explicit method: all its steps have the same length.
pub(super) fn explicit_cost(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    method: &Explicit,
) -> MotionCost {
    let duration = physics.times().duration;
    let steps = duration / method.longest_step();
    let of_step = explicit_step(leaf.rods(), leaf.segments())
        + step_of_tissue(&leaf.leaf, leaf.segments(), Scheme::Explicit);
    MotionCost {
        steps,
        seconds: steps * of_step,
        at_least: false,
    }
}

/// The estimated cost of the whole motion by the semi-implicit method: a pilot follows the leaf
/// with a larger permitted error, in a fraction of the steps. It ends early where the cost exceeds
/// `most` seconds, and where it takes long itself; then the rest of the motion is taken to need
/// as many steps as the half or more of the pilot's that are the last. None is needed where the
/// outputs alone take more.
pub(super) fn semi_implicit_cost(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    tolerance: f64,
    most: f64,
) -> MotionCost {
    let MotionTimes { duration, interval } = physics.times();
    let error = (PILOT.error_ratio * tolerance)
        .min(PILOT.largest_error)
        .max(tolerance);
    let of_step = (error / tolerance).powf(PILOT.step_exponent);
    let seconds = semi_implicit_step(leaf.rods(), leaf.segments())
        + step_of_tissue(&leaf.leaf, leaf.segments(), Scheme::SemiImplicit);
    let cost = |steps: f64, at_least: bool| MotionCost {
        steps,
        seconds: steps * seconds,
        at_least,
    };
    // A step ends at every output.
    let outputs = duration / interval;
    let most = most / seconds;
    if outputs > most {
        return cost(outputs, true);
    }
    let longest = (PILOT.longest_seconds / (PILOT.step_cost * seconds)) as usize;
    let steps = StepControl::CountOnly(error);
    let mut pilot = SemiImplicit::new(leaf.clone(), physics.clone(), state, steps);
    let (mut steps, mut attempts, mut failed) = (0.0, 0_usize, false);
    // The time and the number of steps at the last two powers of two of attempts.
    let mut marks = [(0.0, 0.0); 2];
    while pilot.time() < duration && steps <= most && attempts < longest && !failed {
        let before = pilot.time();
        failed = pilot.proceed_towards(duration).is_err();
        steps += match pilot.time() - before {
            h if h > 0.0 => of_step.max(h / interval),
            _ => 0.0,
        };
        attempts += 1;
        if attempts.is_power_of_two() {
            marks = [marks[1], (pilot.time(), steps)];
        }
    }
    let left = duration - pilot.time();
    let at_least = failed || steps > most;
    if left > 0.0 && !at_least {
        let (time, there) = marks[0];
        steps += left * (steps - there) / (pilot.time() - time).max(f64::MIN_POSITIVE);
    }
    cost(steps, at_least)
}
