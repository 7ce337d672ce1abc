//! What is said of one method in one cell of a map: what else is known of its answer, or why there is
//! none.

use crate::leaf::HalfTurn;
use crate::run::remarks;
use crate::shooting::ShootingFailureReason;
use crate::study::remark::SolutionRemark;

remarks! {
    /// What is said of a method in a cell.
    pub enum MapRemark {
        /// What the method says of an answer that is right, or not at rest.
        #[error("{0}")]
        Solution(SolutionRemark) = inner.code(),
        /// An unstable equilibrium.
        #[error("index {index}; {}", optional_text(.remark))]
        Saddle {
            /// Its Morse index.
            index: usize,
            /// What the method says of it.
            remark: Option<SolutionRemark>,
        } = "saddle",
        /// A stable equilibrium in a cell without a reference.
        #[error("stable, with nothing to compare with; {}", optional_text(.remark))]
        Uncompared {
            /// What the method says of it.
            remark: Option<SolutionRemark>,
        } = "uncompared",
        /// A stable equilibrium that is not the reference.
        #[error(
            "{distance:.1e} lengths from the reference, {}; {}",
            match *.energy {
                lower if lower < 0.0 => format!("energy lower by {:.1e}", -lower),
                higher => format!("energy higher by {higher:.1e}"),
            },
            optional_text(.remark)
        )]
        Elsewhere {
            /// The distance of both, in lengths.
            distance: f64,
            /// Its energy minus that of the reference.
            energy: f64,
            /// What the method says of it.
            remark: Option<SolutionRemark>,
        } = "elsewhere",
        /// A refusal, in its own words.
        #[error("{0}")]
        Refused(String) = "refused",
        /// Explicit motion without a time step.
        #[error("explicit motion needs method.step")]
        NoTimeStep = "no-time-step",
        /// A free leaf, which moves for ever.
        #[error("a free leaf has no place to rest in")]
        FreeLeaf = "free-leaf",
        /// Rigid rods, for which no time step is stable.
        #[error("no time step is stable for rigid rods (a stiffness is inf)")]
        RigidRods = "rigid-rods",
        /// Masses off the axis, which the explicit method does not move.
        #[error("the explicit method does not move masses off the axis (load.point.offset)")]
        MassesOffAxis = "masses-off-axis",
        /// A grid that takes longer than is allowed in any case.
        #[error("{nodes} nodes take longer than {seconds} s")]
        TooManyNodes {
            /// Its number of nodes.
            nodes: usize,
            /// The time allowed, in seconds.
            seconds: f64,
        } = "too-many-nodes",
        /// A run that took longer than is allowed.
        #[error("no answer within {seconds} s")]
        OutOfTime {
            /// The time allowed, in seconds.
            seconds: f64,
        } = "out-of-time",
        /// No solution by shooting.
        #[error(
            "{reason}{}",
            match *.part {
                part if part < 1.0 => format!(" (at {part:.4} of the way from arcs)"),
                _ => String::new(),
            }
        )]
        ShootingFailed {
            /// Why.
            reason: ShootingFailureReason,
            /// Part of the change from the leaf of arcs to that of the cell that was made.
            part: f64,
        } = "shooting-failed",
        /// A solution by shooting that is less accurate than the tolerance.
        #[error("the solution is only known within {error:.1e}")]
        Inaccurate {
            /// The bound on its error, in units of length.
            error: f64,
        } = "inaccurate",
        /// No relaxed leaf to shoot from.
        #[error("the leaf to start from is not at rest: {}", optional_text(.why))]
        NoStart {
            /// Why.
            why: Option<Box<MapRemark>>,
        } = "no-start",
        /// A leaf at rest on one grid, and on no finer one.
        #[error("the error of the grid cannot be told: a finer one finds no rest")]
        UnknownError = "unknown-error",
        /// Explicit motion that does not come to rest. Times are in the scenario's unit.
        #[error("{motion}; {step}")]
        MotionFailed {
            /// How it fails.
            motion: MapMotionFailure,
            /// Its time step.
            step: SolutionRemark,
        } = "motion-failed",
    }

    /// How explicit motion does not come to rest. Times are in the scenario's unit.
    pub enum MapMotionFailure {
        /// A segment that bends by more than it resolves.
        #[error("at t = {time:.3e} a segment bends by {turn:.2} rad, more than it resolves")]
        Unresolved {
            /// When.
            time: f64,
            /// By which angle.
            turn: f64,
        } = "unresolved",
        /// Sections of neighbouring veins turned against each other by half a turn.
        #[error("at t = {time:.3e} {}", .place.sentence())]
        HalfTurn {
            /// When.
            time: f64,
            /// Where.
            place: HalfTurn,
        } = "half-turn",
        /// Spurious energy.
        #[error("numerical instability at t = {time:.3e}")]
        Unstable {
            /// When.
            time: f64,
        } = "unstable",
        /// The end of the time allowed.
        #[error("still moving")]
        OutOfTime = "out-of-time",
        /// A leaf that moves at the end of its duration.
        #[error("still moves by {speed:.1e} lengths in a unit of time")]
        StillMoving {
            /// How fast, in lengths per unit of time.
            speed: f64,
        } = "still-moving",
        /// A leaf that is slow, with no equilibrium nearby.
        #[error("slow, but not at rest")]
        NotAtRest = "not-at-rest",
    }
}

fn optional_text(remark: &Option<impl ToString>) -> String {
    remark.as_ref().map(ToString::to_string).unwrap_or_default()
}
