//! Options of a relaxation, and the errors of requests that cannot be met.

use std::fmt;

use crate::bvp;
use crate::limit::Limit;
use crate::memory::TooMuch;
use crate::relax::method::Method;
use crate::relax::path::Route;
use glam::DVec3;

/// Options of a relaxation.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The method.
    pub method: Method,
    /// Which equilibrium is meant, where there are several (semi-implicit and explicit method).
    pub route: Route,
    /// A force along the lab axes, of any size, that decides to which side a slowly loaded leaf
    /// turns where both are equally open; zero: down, then to the left, then forward.
    pub leaning: DVec3,
    /// Replaces the scenario's tolerance.
    pub tolerance: Option<f64>,
    /// Number of lowest modes to compute once the leaf is at rest, at most [`MOST_MODES`];
    /// their time is not measured. 0: none. The signs of their eigenvalues are compared with
    /// the Morse index, and finer grids decide where they differ.
    pub modes: usize,
    /// Whether their shapes are requested. Without them modes of large leaves are left out,
    /// and eigenvalues are slightly less accurate.
    pub mode_shapes: bool,
    /// Whether the leaf is requested at the nodes of the finest grid, not only at those of the
    /// coarsest (semi-implicit and explicit method).
    pub every_node: bool,
    /// The number of equal parts of a vein at whose ends the tolerance must be kept, too: where
    /// interpolation loses more, the leaf is solved with a smaller tolerance.
    pub stations: Option<usize>,
    /// Time limit and cancellation: a run that is stopped ends not at rest.
    pub limit: Limit,
}

/// Progress of a run.
#[derive(Clone, Copy, Debug)]
pub enum Progress {
    /// Of a relaxation.
    Relaxing {
        /// Segments per rod of the present grid.
        grid: usize,
        /// Step on that grid.
        step: usize,
        /// Size of that step: largest rotation or displacement, in radians or
        /// lengths of the leaf. It goes to zero as the leaf comes to rest.
        residual: f64,
    },
    /// Of a shooting.
    Shooting(bvp::Correction),
}

impl fmt::Display for Progress {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Progress::Relaxing {
                grid,
                step,
                residual,
            } => write!(
                f,
                "{grid} segments a vein, step {step}, residual {residual:.1e}"
            ),
            Progress::Shooting(now) if now.way < 1.0 => write!(
                f,
                "shooting, {:.0} % of the way, correction {:.1e}",
                100.0 * now.way,
                now.size
            ),
            Progress::Shooting(now) if now.linearized < 1.0 => write!(
                f,
                "shooting, step {}, {:.0} % of its linearisation",
                now.iteration,
                100.0 * now.linearized
            ),
            Progress::Shooting(now) => write!(
                f,
                "shooting, step {}, correction {:.1e}",
                now.iteration, now.size
            ),
        }
    }
}

/// Smallest tolerance that double precision can keep.
pub const SMALLEST_TOLERANCE: f64 = 1e-12;

/// Largest meaningful tolerance.
pub const LARGEST_TOLERANCE: f64 = 0.1;

/// Largest number of nodes of a leaf, all rods together: about 1.5 kB each.
pub const MAX_NODES: usize = 4_000_000;

/// Largest number of modes.
pub const MOST_MODES: usize = 100;

/// Largest number of intervals of a shooting.
pub const MAX_INTERVALS: usize = 4096;

/// Checks that a tolerance is in range.
pub fn check_tolerance(tolerance: f64) -> Result<(), RelaxError> {
    match (SMALLEST_TOLERANCE..=LARGEST_TOLERANCE).contains(&tolerance) {
        true => Ok(()),
        false => Err(RelaxError::Tolerance { found: tolerance }),
    }
}

/// A request that cannot be met.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RelaxError {
    /// The tolerance is out of range.
    #[error(
        "tolerance = {found}: allowed are {SMALLEST_TOLERANCE:e} to {LARGEST_TOLERANCE} \
         (relative to the largest rod length; double precision does not carry more)"
    )]
    Tolerance {
        /// The requested tolerance.
        found: f64,
    },
    /// Too few segments for the panels of the profiles.
    #[error(
        "segments = {found}: at least {least} are needed, one for every piece between the knots of the profiles"
    )]
    TooFewSegments {
        /// Requested number of segments.
        found: usize,
        /// Least number that can be used.
        least: usize,
    },
    /// Too many nodes.
    #[error(
        "{rods} rods of {segments} segments are {nodes} nodes: at most {MAX_NODES} are allowed (7 to 24 GB); use fewer rods or segments"
    )]
    TooManyNodes {
        /// Number of rods.
        rods: usize,
        /// Segments per rod.
        segments: usize,
        /// Their product.
        nodes: usize,
    },
    /// Too much memory.
    #[error(transparent)]
    Memory(#[from] TooMuch),
    /// The explicit method has no stable time step for rigid rods.
    #[error(
        "method = explicit: a stiffness is inf, and no time step is short enough for rigid rods; give a number, or use semi-implicit"
    )]
    Rigid,
    /// The explicit method integrates a motion, which a dead moment may drive forever.
    #[error(
        "method = explicit: under load.tip_moment, which has no potential, motion need not come to rest; use semi-implicit, or shooting"
    )]
    Follows,
    /// Shooting from arcs has no continuation to a held tip.
    #[error(
        "method = {found}: a tip that is held (tip.held) is led there by the relaxation; use shooting-from-rest"
    )]
    HeldTip {
        /// The requested method.
        found: &'static str,
    },
    /// Too many modes.
    #[error("modes = {found}: allowed are 0 to {MOST_MODES}")]
    Modes {
        /// Requested number of modes.
        found: usize,
    },
    /// Shooting has no grids on which eigenvalues are computed.
    #[error("modes = {found}: modes are those of a relaxed leaf: use the method semi-implicit")]
    ModesByShooting {
        /// Requested number of modes.
        found: usize,
    },
    /// The number of intervals is out of range.
    #[error("intervals = {found}: allowed are 1 to {MAX_INTERVALS}")]
    Intervals {
        /// Requested number of intervals.
        found: usize,
    },
}
