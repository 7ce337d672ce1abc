//! What is charted: contenders, their knobs, and the cells of the chart.

use std::fmt;

use serde::{Serialize, Serializer};

use crate::scenario::Scenario;

/// A way to bring a leaf to rest, with one knob for its accuracy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contender {
    /// Semi-implicit on nested grids with extrapolation: what
    /// [`crate::relax::relax`] does unless told otherwise.
    SemiImplicit,
    /// Semi-implicit on one grid.
    SemiImplicitGrid,
    /// Explicit on nested grids with extrapolation.
    Explicit,
    /// Explicit on one grid.
    ExplicitGrid,
    /// The boundary-value problem from arcs, over one interval.
    SingleShooting,
    /// The boundary-value problem from arcs, over as many intervals as the
    /// growth of perturbations needs.
    MultipleShooting,
    /// The boundary-value problem from a coarsely relaxed leaf.
    RelaxedShooting,
}

/// What is set to make a contender more accurate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setting {
    /// Wanted accuracy, relative to the longest rod.
    Tolerance(f64),
    /// Segments a rod.
    Segments(usize),
}

/// Tolerances from coarse to fine.
const TOLERANCES: [f64; 10] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11];

/// Single grids from coarse to fine.
pub(super) const SEGMENTS: [usize; 8] = [4, 8, 16, 32, 64, 128, 256, 512];

impl Contender {
    /// All of them.
    pub const ALL: [Contender; 7] = [
        Contender::SemiImplicit,
        Contender::SemiImplicitGrid,
        Contender::Explicit,
        Contender::ExplicitGrid,
        Contender::SingleShooting,
        Contender::MultipleShooting,
        Contender::RelaxedShooting,
    ];

    /// The word used on the command line and in files.
    pub fn word(self) -> &'static str {
        match self {
            Contender::SemiImplicit => "semi-implicit",
            Contender::SemiImplicitGrid => "semi-implicit-grid",
            Contender::Explicit => "explicit",
            Contender::ExplicitGrid => "explicit-grid",
            Contender::SingleShooting => "single-shooting",
            Contender::MultipleShooting => "multiple-shooting",
            Contender::RelaxedShooting => "relaxed-shooting",
        }
    }

    /// Whether it is what a relaxation does unless told otherwise.
    pub fn is_default(self) -> bool {
        self == Contender::SemiImplicit
    }

    /// Whether its knob is the number of segments of its only grid.
    pub fn on_one_grid(self) -> bool {
        matches!(self, Contender::SemiImplicitGrid | Contender::ExplicitGrid)
    }

    /// The settings of its knob that are charted, from coarse to fine.
    pub fn knobs(self) -> Vec<Setting> {
        match self.on_one_grid() {
            true => SEGMENTS.map(Setting::Segments).to_vec(),
            false => TOLERANCES.map(Setting::Tolerance).to_vec(),
        }
    }
}

impl Serialize for Contender {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.word())
    }
}

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

/// One point of a chart: a leaf, a contender, and where its knob stands.
#[derive(Clone, Copy, Debug)]
pub struct Cell<'s> {
    pub scenario: &'s Scenario,
    pub contender: Contender,
    pub knob: Setting,
}

/// All settings of these contenders.
pub fn cells<'s>(scenario: &'s Scenario, contenders: &[Contender]) -> Vec<Cell<'s>> {
    let cells = contenders.iter().flat_map(|&contender| {
        let knobs = contender.knobs().into_iter();
        knobs.map(move |knob| Cell {
            scenario,
            contender,
            knob,
        })
    });
    cells.collect()
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
        let mut words = Contender::ALL.map(Contender::word).to_vec();
        words.sort_unstable();
        words.dedup();
        assert_eq!(words.len(), Contender::ALL.len());
    }
}
