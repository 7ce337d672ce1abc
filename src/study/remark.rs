//! What is said of traces, their branches, boundaries of stability and sets of equilibria: why they
//! are not known as far as requested, and what would help. And what a method says of its answer,
//! where methods are compared, or why they are not.

use crate::branch::{CorrectorFailure, VerificationFailure};
use crate::numbers::format_error_bound;
use crate::relax::EquilibriumRemark;
use crate::run::remarks;
use crate::shooting::{NeutralDirection, ShootingFailureReason};
use crate::study::vary::ParameterKeys;

remarks! {
    /// Why a trace has no branch, or fewer than there are.
    pub enum TraceRemark {
        /// A leaf that is not at rest where the trace begins, or whose index is not known there.
        #[error(
            "no equilibrium to begin with at {keys} = {}: {}", .keys.text(*.value),
            .remark.as_ref().map_or("the leaf is not at rest".into(), ToString::to_string)
        )]
        NoEquilibrium {
            /// The number that varies.
            keys: ParameterKeys,
            /// Its value there.
            value: f64,
            /// What is said of the leaf.
            remark: Option<EquilibriumRemark>,
        } = "no-equilibrium",
        /// A leaf at rest that is not found again on the grids of the trace.
        #[error("no equilibrium to begin with at {keys} = {}: {why}", .keys.text(*.value))]
        NoFirstPoint {
            /// The number that varies.
            keys: ParameterKeys,
            /// Its value there.
            value: f64,
            /// Why.
            why: CorrectorFailure,
        } = "no-first-point",
        /// More branches than are followed.
        #[error("there are more than {most} branches")]
        TooManyBranches {
            /// The largest number of branches.
            most: usize,
        } = "too-many-branches",
        /// A run that was stopped.
        #[error("the run was stopped")]
        Stopped = "stopped",
        /// A run that was stopped before all branches that cross were followed.
        #[error("the run was stopped: branches that cross are not all followed")]
        StoppedBeforeCrossings = "stopped-before-crossings",
    }

    /// Why a branch is incomplete, and which branches that cross it are missing. Values are written as
    /// in the scenario.
    pub enum BranchRemark {
        /// As many points as are allowed.
        #[error("there are more points: allow more, or end the branch where it becomes unstable")]
        MorePoints = "more-points",
        /// No point within the shortest step.
        #[error("{0}")]
        StepFailed(CorrectorFailure) = "step-failed",
        /// A next point that is less accurate than the tolerance.
        #[error("{}: ask for a larger one", VerificationFailure::Inaccurate)]
        ToleranceNotReached = "tolerance-not-reached",
        /// A next point that finer grids do not confirm.
        #[error("what comes next is not verified: {0}")]
        PointUnverified(VerificationFailure) = "point-unverified",
        /// A vertex at which no branch that crosses was found.
        #[error(
            "it turns back beyond {value} where another branch must cross it, which was not found"
        )]
        CrossingNotFound {
            /// The number that varies, at the point before.
            value: String,
        } = "crossing-not-found",
        /// A branch point from which no branch leads into the range.
        #[error(
            "the branches that cross at {value} are not followed: none was found within the range"
        )]
        CrossingNotFollowed {
            /// The number that varies, there.
            value: String,
        } = "crossing-not-followed",
        /// A first leaf that snapped while it was loaded.
        #[error(
            "it begins at a leaf that snapped on its way, to one of several equilibria in which it can rest: others, which \
             relax --all finds, may lose their stability elsewhere"
        )]
        BeginsBeyondSnap = "begins-beyond-snap",
        /// A branch point at which several modes become neutral together.
        #[error(
            "at {value} branches cross in {directions} directions, of which one is followed, to both its sides: of a \
             symmetric leaf the others are its copies, and where nothing ties the veins each buckles for itself: follow one vein"
        )]
        OneDirectionFollowed {
            /// The number that varies, there.
            value: String,
            /// The number of modes.
            directions: usize,
        } = "one-direction-followed",
        /// Without a potential, a change of stability whose place is not found.
        #[error(
            "beyond {value} stability changes where no grid tells: follow it in smaller steps, or on other segments"
        )]
        CriticalPointNotLocated {
            /// The number that varies, at the point before.
            value: String,
        } = "critical-point-not-located",
    }

    /// Why a boundary of stability has no curve, or fewer than there may be.
    pub enum BoundaryRemark {
        /// What is said of the first trace.
        #[error("{0}")]
        Trace(TraceRemark) = inner.code(),
        /// A first trace along which the index is the same everywhere.
        #[error("along {vary} the index changes nowhere at {across} = {}", .across.text(*.start))]
        NoIndexChange {
            /// The number that varies along the trace.
            vary: ParameterKeys,
            /// The other number.
            across: ParameterKeys,
            /// Its value.
            start: f64,
        } = "no-index-change",
        /// Incomplete branches of the first trace.
        #[error(
            "not all branches along the first number are followed to their ends: see a trace of it alone"
        )]
        BranchesIncomplete = "branches-incomplete",
        /// More curves than are followed.
        #[error("there are more than {most} curves")]
        TooManyCurves {
            /// The largest number of curves.
            most: usize,
        } = "too-many-curves",
        /// A run that was stopped.
        #[error("{}", CorrectorFailure::Stopped)]
        Stopped = "stopped",
    }

    /// Why a check has nothing to compare.
    pub enum CheckReason {
        /// A leaf that is not at rest.
        #[error(
            "the relaxation did not come to rest{}",
            .remark.as_ref().map_or(String::new(), |remark| format!(": {remark}"))
        )]
        NotAtRest {
            /// What is said of it.
            remark: Option<EquilibriumRemark>,
        } = "not-at-rest",
        /// No solution by shooting.
        #[error("{0}")]
        ShootingFailed(ShootingFailureReason) = "shooting-failed",
        /// A solution by shooting that is less accurate than the tolerance.
        #[error(
            "the boundary-value solution is only known within {error:.1e}: ask for a larger tolerance"
        )]
        Inaccurate {
            /// The bound on its error, in units of length.
            error: f64,
        } = "inaccurate",
    }

    /// What a method says of its answer.
    pub enum SolutionRemark {
        /// What is said of an equilibrium.
        #[error("{0}")]
        Equilibrium(EquilibriumRemark) = inner.code(),
        /// The saddle that a relaxation left.
        #[error("left a saddle of index {index}")]
        LeftSaddle {
            /// Its Morse index.
            index: usize,
        } = "left-saddle",
        /// How shooting found the solution.
        #[error(
            "over {}, growth 10^{growth:.1}{}",
            match .intervals {
                1 => "1 interval".into(),
                count => format!("{count} intervals"),
            },
            .neutral.as_ref().map_or(String::new(), |neutral| format!("; {neutral}"))
        )]
        Shot {
            /// Its number of intervals.
            intervals: usize,
            /// Decimal logarithm of the growth of perturbations from base to tip.
            growth: f64,
            /// A direction in which the leaf can move without resistance.
            neutral: Option<NeutralDirection>,
        } = "shot",
        /// Why shooting found no solution.
        #[error("{0}")]
        ShootingFailed(ShootingFailureReason) = "shooting-failed",
        /// The time step of explicit motion.
        #[error("step {step:.3e}, stable up to {stable:.3e} because of {limit}")]
        Stepped {
            /// The step, in the scenario's unit of time.
            step: f64,
            /// The longest stable one.
            stable: f64,
            /// The fastest motion, which limits it.
            limit: &'static str,
        } = "stepped",
    }

    /// What is to be said of the equilibria that were found. They are counted from 0.
    pub enum EquilibriaRemark {
        /// A stable one with less energy than that in which a relaxation ends.
        #[error(
            "a relaxation ends in equilibrium {}, but number {} is stable, too, and has less energy, by {}",
            .plain + 1, .lowest + 1, format_error_bound(*.difference)
        )]
        LowerEnergy {
            /// The one in which a relaxation ends.
            plain: usize,
            /// The stable one with the least energy.
            lowest: usize,
            /// The difference of both energies.
            difference: f64,
        } = "lower-energy",
        /// A search that was stopped.
        #[error("the search was stopped after {starts} starts")]
        Stopped {
            /// The number of starts.
            starts: usize,
        } = "stopped",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::join_remarks;

    #[test]
    fn remarks_are_sentences_with_codes() {
        let all = [
            EquilibriaRemark::LowerEnergy {
                plain: 1,
                lowest: 0,
                difference: 0.25,
            },
            EquilibriaRemark::Stopped { starts: 16 },
        ];
        let joined = "a relaxation ends in equilibrium 2, but number 1 is stable, too, and has less energy, by 2.5×10⁻¹; \
                      the search was stopped after 16 starts";
        assert_eq!(join_remarks(&all).as_deref(), Some(joined));
        assert_eq!(join_remarks::<EquilibriaRemark>(&[]), None);
        let [vary, across] = ["load.gravity[2]", "leaf.rods"].map(|key| key.parse().unwrap());
        let start = 5.0;
        let remark = BoundaryRemark::NoIndexChange {
            vary,
            across,
            start,
        };
        let sentence = "along load.gravity[2] the index changes nowhere at leaf.rods = 5";
        assert_eq!(remark.to_string(), sentence);
        let passed_on = BoundaryRemark::Trace(TraceRemark::TooManyBranches { most: 24 });
        assert_eq!(passed_on.code(), "too-many-branches");
    }
}
