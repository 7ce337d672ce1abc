//! The methods by which a leaf is brought to rest, each with its own options.

use crate::read_and_write;
use crate::relax::path::Route;

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
    pub fn with(self, settings: Settings) -> Result<Method, Unfit> {
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
        let unfit = |setting, value, why| Unfit {
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
        !matches!(self, Method::SemiImplicit(_) | Method::Explicit { .. })
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
pub struct Unfit {
    /// The setting's name among [`Settings`].
    pub setting: &'static str,
    /// Its value, if it is a number.
    pub value: Option<usize>,
    /// Why, and what to change.
    pub why: &'static str,
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
