//! The contents of a chart: contenders and their accuracy settings.

use std::fmt;

use serde::{Serialize, Serializer};

use crate::read_and_write;
use crate::relax::Method;

/// A method for an equilibrium, with one setting for its accuracy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Contender {
    /// The method; the setting depends on whether it is used on one grid.
    pub method: Method,
    /// Whether it is used on one grid, with the number of segments as its setting, and not on
    /// nested grids with extrapolation.
    pub one_grid: bool,
}

/// The setting of a contender's accuracy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setting {
    /// Required accuracy, relative to the longest rod.
    Tolerance(f64),
    /// Segments per rod.
    Segments(usize),
}

/// Tolerances from coarse to fine.
const TOLERANCES: [f64; 11] = [
    1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11,
];

/// Single grids from coarse to fine.
pub(super) const SEGMENTS: [usize; 8] = [4, 8, 16, 32, 64, 128, 256, 512];

impl Contender {
    /// All of them; the first is the default.
    pub const ALL: [Contender; 7] = {
        const fn of(method: usize, one_grid: bool) -> Contender {
            Contender {
                method: Method::ALL[method],
                one_grid,
            }
        }
        [
            of(0, false),
            of(0, true),
            of(1, false),
            of(1, true),
            of(2, false),
            of(3, false),
            of(4, false),
        ]
    };

    /// The word used on the command line and in files.
    pub fn word(self) -> &'static str {
        match (self.method, self.one_grid) {
            (Method::SemiImplicit(_), true) => "semi-implicit-grid",
            (Method::Explicit { .. }, true) => "explicit-grid",
            (method, _) => method.word(),
        }
    }

    /// Whether it is the default of [`crate::relax::relax`].
    pub fn is_default(self) -> bool {
        self == Contender::ALL[0]
    }

    /// The settings that are charted, from coarse to fine.
    pub fn knobs(self) -> Vec<Setting> {
        match self.one_grid {
            true => SEGMENTS.map(Setting::Segments).to_vec(),
            false => TOLERANCES.map(Setting::Tolerance).to_vec(),
        }
    }
}

read_and_write!(Contender);

impl Serialize for Setting {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// As in files: `tolerance=1e-6`, `segments=64`.
impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Setting::Tolerance(tolerance) => write!(f, "tolerance={tolerance:e}"),
            Setting::Segments(segments) => write!(f, "segments={segments}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knobs_are_written_as_they_are_typed() {
        assert_eq!(Setting::Tolerance(1e-11).to_string(), "tolerance=1e-11");
        assert_eq!(Setting::Tolerance(1e-2).to_string(), "tolerance=1e-2");
        assert_eq!(Setting::Segments(64).to_string(), "segments=64");
    }

    #[test]
    fn every_contender_has_its_own_word() {
        for contender in Contender::ALL {
            assert_eq!(contender.word().parse(), Ok(contender));
        }
    }
}
