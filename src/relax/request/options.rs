//! Options of a relaxation, and the errors of requests that cannot be met.

use std::fmt;

use crate::limit::Limit;
use crate::memory::TooMuch;
use crate::refusal::{RefusedOption, Unmodelled};
use crate::relax::path::Route;
use crate::relax::request::method::Method;
use crate::scenario::{Scenario, UnbalancedMoment};
use crate::shooting;
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
    Shooting(shooting::Correction),
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

/// What a tolerance must be.
const TOLERANCES: &str = "allowed are 1e-12 to 0.1 (relative to the largest rod length; double \
     precision does not carry more)";

/// Largest number of nodes of a leaf, all rods together: about 1.5 kB each.
pub const MAX_NODES: usize = 4_000_000;

/// Largest number of modes.
pub const MOST_MODES: usize = 100;

/// Largest number of intervals of a shooting.
pub const MAX_INTERVALS: usize = 4096;

/// Checks that a tolerance is in range.
pub fn check_tolerance(tolerance: f64) -> Result<(), RefusedOption> {
    match (SMALLEST_TOLERANCE..=LARGEST_TOLERANCE).contains(&tolerance) {
        true => Ok(()),
        false => Err(RefusedOption::new("tolerance", tolerance, TOLERANCES)),
    }
}

/// A request that cannot be met.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RelaxError {
    /// An option has a value that it cannot have.
    #[error("{0}")]
    Option(#[from] RefusedOption),
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
    #[error("{0}")]
    Memory(#[from] TooMuch),
    /// The scenario has what this method or question does not take into account.
    #[error("{0}")]
    Unmodelled(#[from] Unmodelled),
    /// Wind that changes, in which nothing rests.
    #[error(
        "wind.velocity: a leaf comes to rest in steady wind only: give one velocity, or follow the leaf with simulate"
    )]
    ChangingWind,
    /// Hinges in one place, about which an unloaded leaf turns to anywhere.
    #[error(
        "leaf.base_held: without a load nothing holds the leaf against turning about its hinge: give it a load or another hinge, hold its tip, or clamp its base"
    )]
    TurnsFreely,
    /// Dead moments about the line about which a leaf on hinges turns freely.
    #[error(
        "leaf.base_held: no equilibrium exists: the leaf turns freely about {line}, and nothing balances the moments on it, \
         which sum up to {moment:e} there: let them sum up to zero, add a force across this line, or clamp the base"
    )]
    UnbalancedMoment {
        /// The line.
        line: &'static str,
        /// The sum of the moments about it, in the units of the scenario.
        moment: f64,
    },
}

/// Refuses scenarios with wind for what does not take it into account.
pub fn without_wind(scenario: &Scenario, what: &'static str) -> Result<(), RelaxError> {
    match scenario.wind {
        None => Ok(()),
        Some(_) => Err(Unmodelled::Wind { what }.into()),
    }
}

/// Refuses a leaf on hinges that may point anywhere, or that nothing keeps from turning for ever.
pub fn points_somewhere(scenario: &Scenario) -> Result<(), RelaxError> {
    match (scenario.turns_freely(), scenario.unbalanced_moment()) {
        (true, _) => Err(RelaxError::TurnsFreely),
        (false, Some(UnbalancedMoment { line, moment })) => {
            Err(RelaxError::UnbalancedMoment { line, moment })
        }
        (false, None) => Ok(()),
    }
}

/// Refuses a leaf in wind unless it is released, to move to rest by the semi-implicit method.
pub fn rests_in_wind(scenario: &Scenario, options: &Options) -> Result<(), RelaxError> {
    let Some(wind) = &scenario.wind else {
        return Ok(());
    };
    let what = match options.method {
        Method::SemiImplicit(how) if how.keep_unstable => {
            "the search for an equilibrium of any index"
        }
        Method::SemiImplicit(how) if how.disturbance.is_some() => "a disturbed start",
        Method::SemiImplicit(_) if options.route == Route::Loading => "slow loading",
        Method::SemiImplicit(_) if options.mode_shapes => "a list of modes",
        Method::SemiImplicit(_) if !wind.velocity.is_constant() => {
            return Err(RelaxError::ChangingWind);
        }
        Method::SemiImplicit(_) if scenario.has_moments() => {
            "a leaf under load.tip_moment or load.point.moment"
        }
        Method::SemiImplicit(_) => return Ok(()),
        Method::Explicit { .. } => "explicit relaxation",
        _ => "shooting",
    };
    Err(Unmodelled::Wind { what }.into())
}
