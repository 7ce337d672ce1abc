//! What is asked of a relaxation: the methods with their options, and the errors of requests that cannot
//! be met.

use crate::memory::TooMuch;
use crate::natural::Natural;
use crate::numbers::largest;
use crate::relax::path::Route;
use crate::run::{Limit, RefusedOption, UnmodelledFeature};
use crate::scenario::{Scenario, UnbalancedMoment, longest};
use crate::{read_and_write, shooting};
use glam::DVec3;
use std::fmt;

/// How a leaf is brought to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Method {
    /// Linearly implicit damped motion that turns into Newton's method.
    SemiImplicit(SemiImplicit),
    /// Explicit damped motion, then accelerated descent with fictitious masses and damping.
    /// Not for rigid rods.
    Explicit {
        /// One grid of so many segments a rod, without extrapolation; `None`: as
        /// fine as the tolerance needs.
        segments: Option<usize>,
    },
    /// The boundary-value problem in one piece (module `shooting`), from arcs by
    /// continuation. Finds equilibria, stable or not.
    SingleShooting,
    /// The boundary-value problem by multiple shooting, from arcs by continuation.
    /// Finds equilibria, stable or not.
    Shooting {
        /// Number of intervals; `None`: as many as the growth of perturbations
        /// needs.
        intervals: Option<usize>,
    },
    /// The boundary-value problem by multiple shooting, from the leaf relaxed to a
    /// coarse tolerance.
    ShootingFromRest {
        /// Number of intervals; `None`: as many as the growth of perturbations
        /// needs.
        intervals: Option<usize>,
    },
}

/// Options of the semi-implicit method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SemiImplicit {
    /// One grid of so many segments a rod, without extrapolation; `None`: as fine
    /// as the tolerance needs.
    pub segments: Option<usize>,
    /// Whether to stop at a saddle instead of leaving it. Newton's method then converges to
    /// equilibria of any kind.
    pub keep_unstable: bool,
    /// Whether to solve for the whole leaf even where symmetry allows half of it.
    pub full_model: bool,
    /// Start from the state of this number in an unlimited series of disturbed ones: each
    /// displaces the leaf out of its plane in a different pattern, consecutive numbers to
    /// opposite sides.
    pub disturbance: Option<usize>,
}

impl Default for Method {
    fn default() -> Self {
        Method::SemiImplicit(SemiImplicit::default())
    }
}

impl Method {
    /// All of them, with default options.
    pub const ALL: [Method; 5] = [
        Method::SemiImplicit(SemiImplicit {
            segments: None,
            keep_unstable: false,
            full_model: false,
            disturbance: None,
        }),
        Method::Explicit { segments: None },
        Method::SingleShooting,
        Method::Shooting { intervals: None },
        Method::ShootingFromRest { intervals: None },
    ];

    /// Its name on the command line and in files.
    pub fn word(self) -> &'static str {
        match self {
            Method::SemiImplicit(_) => "semi-implicit",
            Method::Explicit { .. } => "explicit",
            Method::SingleShooting => "single-shooting",
            Method::Shooting { .. } => "shooting",
            Method::ShootingFromRest { .. } => "shooting-from-rest",
        }
    }

    /// Segments per rod of a fixed grid, if the method has one.
    pub fn segments(self) -> Option<usize> {
        match self {
            Method::SemiImplicit(SemiImplicit { segments, .. }) | Method::Explicit { segments } => {
                segments
            }
            _ => None,
        }
    }

    /// The same method on one grid of `segments` segments a rod or, with `None`, on as many
    /// grids as it needs; no change for a method without grids.
    pub fn on_grid(self, segments: Option<usize>) -> Method {
        match self {
            Method::SemiImplicit(how) => Method::SemiImplicit(SemiImplicit { segments, ..how }),
            Method::Explicit { .. } => Method::Explicit { segments },
            shooting => shooting,
        }
    }

    /// The same method with the given settings.
    pub fn with(self, settings: Settings) -> Result<Method, UnsupportedSetting> {
        let Settings {
            segments,
            intervals,
            keep_unstable,
            full_model,
            route,
        } = settings;
        let shooting = matches!(
            self,
            Method::Shooting { .. } | Method::ShootingFromRest { .. }
        );
        let unfit = |setting, value, why| UnsupportedSetting {
            setting,
            value,
            why,
        };
        if intervals.is_some() && !shooting {
            let why = "only the method shooting has intervals";
            return Err(unfit("intervals", intervals, why));
        }
        if route == Route::Release && self.is_shooting() {
            let why = "shooting follows no motion; use the method semi-implicit or explicit";
            return Err(unfit("path", None, why));
        }
        if segments.is_some() && self.is_shooting() {
            let why = "shooting has no grid; leave it out, or set the number of intervals";
            return Err(unfit("segments", segments, why));
        }
        Ok(match self {
            Method::SemiImplicit(how) => Method::SemiImplicit(SemiImplicit {
                segments,
                keep_unstable,
                full_model,
                ..how
            }),
            Method::Explicit { .. } if keep_unstable => {
                let why = "explicit motion leaves unstable equilibria; \
                    use the method semi-implicit or shooting";
                return Err(unfit("keep_unstable", None, why));
            }
            Method::Explicit { .. } => Method::Explicit { segments },
            Method::SingleShooting => Method::SingleShooting,
            Method::Shooting { .. } => Method::Shooting { intervals },
            Method::ShootingFromRest { .. } => Method::ShootingFromRest { intervals },
        })
    }

    /// Whether it solves the boundary-value problem.
    pub fn is_shooting(self) -> bool {
        self.shooting().is_some()
    }

    /// How it solves the boundary-value problem, if it does.
    pub fn shooting(self) -> Option<ShootingVariant> {
        let (intervals, from_relaxed_leaf) = match self {
            Method::SemiImplicit(_) | Method::Explicit { .. } => return None,
            Method::SingleShooting => (Some(1), false),
            Method::Shooting { intervals } => (intervals, false),
            Method::ShootingFromRest { intervals } => (intervals, true),
        };
        Some(ShootingVariant {
            intervals,
            from_relaxed_leaf,
        })
    }

    /// Whether it is the explicit method.
    pub fn is_explicit(self) -> bool {
        matches!(self, Method::Explicit { .. })
    }

    /// The options of the semi-implicit method, if it is that.
    pub fn semi_implicit(self) -> Option<SemiImplicit> {
        match self {
            Method::SemiImplicit(how) => Some(how),
            _ => None,
        }
    }
}

/// How a leaf is brought to rest by shooting; single shooting has one interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShootingVariant {
    /// Number of intervals; `None`: as many as the growth of perturbations needs.
    pub intervals: Option<usize>,
    /// Whether it starts from the leaf relaxed to a coarse tolerance, in place of arcs.
    pub from_relaxed_leaf: bool,
}

impl SemiImplicit {
    /// On one grid of `segments` segments a rod or, with `None`, on as many grids as it needs.
    pub fn on_grid(segments: Option<usize>) -> SemiImplicit {
        SemiImplicit {
            segments,
            ..SemiImplicit::default()
        }
    }
}

impl From<SemiImplicit> for Method {
    fn from(how: SemiImplicit) -> Self {
        Method::SemiImplicit(how)
    }
}

read_and_write!(Method);

/// Settings by name, whatever the method.
#[derive(Clone, Copy, Debug, Default)]
pub struct Settings {
    /// One grid of so many segments a rod.
    pub segments: Option<usize>,
    /// Number of intervals of shooting.
    pub intervals: Option<usize>,
    /// Whether to stop at a saddle.
    pub keep_unstable: bool,
    /// Whether to solve for the whole leaf.
    pub full_model: bool,
    /// Which equilibrium is meant.
    pub route: Route,
}

/// A setting that a method does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnsupportedSetting {
    /// The setting's name among [`Settings`].
    pub setting: &'static str,
    /// Its value, if it is a number.
    pub value: Option<usize>,
    /// Why, and what to change.
    pub why: &'static str,
}

/// Options of a relaxation.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// How the leaf is brought to rest.
    pub method: Method,
    /// Which equilibrium is meant, where there are several (semi-implicit and explicit method).
    pub route: Route,
    /// A force along the lab axes, of any size, that decides to which side a slowly loaded leaf
    /// turns where both are equally open; zero: down, then to the left, then forward.
    pub bias_direction: DVec3,
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
        /// Number of the step on that grid, from 0.
        step: usize,
        /// Size of that step: largest rotation or displacement, in radians or
        /// lengths of the leaf. It goes to zero as the leaf comes to rest.
        residual: f64,
    },
    /// Of a shooting.
    Shooting(shooting::CorrectionProgress),
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
            Progress::Shooting(now) if now.lambda < 1.0 => write!(
                f,
                "shooting, {:.0} % of the way, correction {:.1e}",
                100.0 * now.lambda,
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
const ALLOWED_TOLERANCES: &str = "allowed are 1e-12 to 0.1 (relative to the largest rod length; double \
     precision does not carry more)";

/// Largest number of nodes of a leaf, all rods together: about 1.5 kB each.
pub const MAX_NODES: usize = 4_000_000;

/// Largest number of modes that may be requested.
pub const MOST_MODES: usize = 100;

/// Largest number of intervals of a shooting.
pub const MAX_INTERVALS: usize = 4096;

/// Checks that a tolerance is in range.
pub fn check_tolerance(tolerance: f64) -> Result<(), RefusedOption> {
    match (SMALLEST_TOLERANCE..=LARGEST_TOLERANCE).contains(&tolerance) {
        true => Ok(()),
        false => Err(RefusedOption::new(
            "tolerance",
            tolerance,
            ALLOWED_TOLERANCES,
        )),
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
        /// Nodes of all rods together.
        nodes: usize,
    },
    /// Too much memory.
    #[error("{0}")]
    Memory(#[from] TooMuch),
    /// The scenario has what this method or question does not take into account.
    #[error("{0}")]
    Unmodelled(#[from] UnmodelledFeature),
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
    /// A shared place of tips that rigid tissue keeps apart.
    #[error(
        "tissue.along, tissue.normal = inf: the tips of veins that share one are {apart:.1e} of the longest vein apart \
         in the natural leaf, where rigid tissue keeps them: let them end in one place at rest, leave the tips free \
         (leaf.joined = false), or make the tissue soft; if they are apart by growth alone, tissue.grown = false lets \
         growth strain the tissue instead"
    )]
    NaturalTipsApart {
        /// Largest distance of the tips of two neighbors, over the longest vein.
        apart: f64,
    },
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

/// Refuses scenarios with wind, or with loads that turn with the section, for what does not take them
/// into account.
pub fn without_wind_or_followers(
    scenario: &Scenario,
    what: &'static str,
) -> Result<(), RelaxError> {
    match scenario.wind {
        _ if scenario.has_followers() => Err(UnmodelledFeature::Followers { what }.into()),
        None => Ok(()),
        Some(_) => Err(UnmodelledFeature::Wind { what }.into()),
    }
}

/// Refuses a leaf on hinges that may point anywhere, or that nothing keeps from turning for ever.
pub fn check_hinge_equilibrium(scenario: &Scenario) -> Result<(), RelaxError> {
    match (
        scenario.has_undetermined_orientation(),
        scenario.unbalanced_moment(),
    ) {
        (true, _) => Err(RelaxError::TurnsFreely),
        (false, Some(UnbalancedMoment { line, moment })) => {
            Err(RelaxError::UnbalancedMoment { line, moment })
        }
        (false, None) => Ok(()),
    }
}

/// Largest distance of two natural tips, over the longest vein, that counts as that of the integration of a steep
/// outline.
const SAME_TIP_DISTANCE: f64 = 1e-6;

/// Refuses a shared place of the tips of veins that rigid tissue ties and that end apart in the natural leaf:
/// beside the tip it would have to keep them as far apart as there.
pub fn check_natural_tips(scenario: &Scenario) -> Result<(), RelaxError> {
    let tissue = scenario.tissue.iter().flatten().enumerate();
    let rigid = tissue.filter(|(_, of)| of.is_rigid()).map(|(gap, _)| gap);
    let shared = scenario.joined || scenario.held_tip.is_some();
    let mut rigid = rigid.filter(|_| shared).peekable();
    if rigid.peek().is_none() {
        return Ok(());
    }
    let natural = Natural::new(scenario, scenario.tissue_grown);
    let tip = |j: usize| natural.vein_pose(j, 1.0).position;
    let apart = largest(rigid.map(|gap| tip(gap).distance(tip(gap + 1))));
    let apart = apart / longest(&scenario.rods);
    match apart <= SAME_TIP_DISTANCE {
        true => Ok(()),
        false => Err(RelaxError::NaturalTipsApart { apart }),
    }
}

/// Refuses wind that changes, and a leaf in wind, or under loads that turn with the section, where a method
/// needs a potential.
pub fn check_options_without_potential(
    scenario: &Scenario,
    options: &Options,
) -> Result<(), RelaxError> {
    let followers = scenario.has_followers();
    let general = match options.method {
        Method::SemiImplicit(how) if how.keep_unstable => {
            Some("the search for an equilibrium of any index")
        }
        Method::SemiImplicit(_) => None,
        Method::Explicit { .. } => Some("explicit relaxation"),
        _ => None,
    };
    if let Some(what) = general.filter(|_| followers) {
        return Err(UnmodelledFeature::Followers { what }.into());
    }
    let Some(wind) = &scenario.wind else {
        return Ok(());
    };
    let Some(what) = general else {
        return match wind.velocity.is_constant() {
            true => Ok(()),
            false => Err(RelaxError::ChangingWind),
        };
    };
    Err(UnmodelledFeature::Wind { what }.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_has_its_own_word() {
        for method in Method::ALL {
            assert_eq!(method.word().parse(), Ok(method));
        }
        let error = "newton".parse::<Method>().unwrap_err().to_string();
        assert!(error.starts_with("newton: must be one of semi-implicit, "));
    }
}
