//! The error of an equilibrium on nested grids, from these and from the defect on them.

use super::NestedEquilibrium;
use crate::largest::larger;
use crate::leaf::{DiscreteLeaf, System};
use crate::newton::Work;
use crate::relax::accuracy::defect;
use crate::relax::accuracy::defect::Estimate;
use crate::relax::request::problem::{COARSEST, Problem};
use crate::relax::transfer::level::Level;

/// Amplification of errors on single grids by extrapolation: bound on the sum of the weights'
/// absolute values.
const EXTRAPOLATED: f64 = 2.0;

/// Safety factor on the error estimated from the defect of the extrapolated leaf.
const SAFETY: f64 = 2.0;

/// The same on that of the energy: the linear equations of a coarse grid tell less of what is of
/// second order.
const ENERGY_SAFETY: f64 = 3.0;

/// The least part of the largest error between the nodes of the coarsest grid that is taken
/// for the error at these nodes: where layers are thinner than its segments the linear
/// equations of a coarse grid are wrong by so much.
const LAYERS: f64 = 0.1;

/// Upper bound of that estimate in units of the error estimated from the last extrapolation:
/// the response of a neutral mode to rounding is not an error.
const LARGEST: f64 = 10.0;

/// If the error estimated by extrapolation exceeds the tolerance by this factor, the defect is
/// not computed: it would hardly be small enough.
const OUT_OF_REACH: f64 = 3e3;

/// The part of the error that each correction leaves at best.
const CORRECTED: f64 = 1e-2;

/// For leaves with more nodes than this no equations are kept while others are solved, which
/// saves memory at the cost of another factorisation on a coarse grid.
const MANY_NODES: usize = 50_000;

/// Rounding error per segment.
const ROUNDING: f64 = 4e-15;

/// Whether the equations of a leaf need much memory.
pub fn is_large(leaf: &DiscreteLeaf) -> bool {
    leaf.rods() * leaf.segments() > MANY_NODES
}

impl NestedEquilibrium {
    /// Segments of the grid whose linear equations tell the error; of the finest if none do.
    pub fn segments_of_estimate(&self) -> Option<usize> {
        let level = match (&self.estimate, &self.linear) {
            (Some(_), Some(linear)) => self.levels.get(linear.grid()),
            _ => self.levels.last(),
        };
        level.map(|level| level.leaf.segments())
    }

    /// Error estimate relative to the leaf's length: grids, unfinished iterations and rounding.
    pub fn error(&self) -> Option<f64> {
        self.error_of_linear().map(|error| self.softening * error)
    }

    /// The error estimate as the linear equations of a grid tell it.
    fn error_of_linear(&self) -> Option<f64> {
        let segments = [self.levels.first()?, self.levels.last()?].map(|it| it.leaf.segments());
        let best = self.table.best();
        let best = best.map(|best| larger(best.error, self.unresolved));
        let most = best.map_or(f64::INFINITY, |best| LARGEST * best);
        let too_coarse = !self.fixed && segments[0] < COARSEST;
        let extrapolation = match &self.estimate {
            // The errors of unfinished iterations are corrected with the others.
            Some(estimate) if estimate.corrections > 0 => {
                return Some(SAFETY * estimate.largest() + ROUNDING * segments[0] as f64);
            }
            // If nodes are few the midpoints are stations, too.
            Some(estimate) if too_coarse || best.is_none() => {
                (SAFETY * estimate.largest()).min(most)
            }
            Some(estimate) => {
                let at_nodes = estimate.at_nodes.max(LAYERS * estimate.between);
                (SAFETY * at_nodes).min(most)
            }
            None => best?,
        };
        Some(extrapolation + self.unfinished(segments[1]))
    }

    /// Error by unfinished iterations and rounding on a grid of `segments` segments.
    fn unfinished(&self, segments: usize) -> f64 {
        EXTRAPOLATED * self.history.remaining + ROUNDING * segments as f64
    }

    /// Error of the energy of an integrated leaf: that of grids, and rounding of what is summed along
    /// the rods.
    pub(super) fn energy_error(&self, estimate: &Estimate) -> f64 {
        let segments = estimate.grid.segments() * estimate.rods.len();
        let rounding = ROUNDING * segments as f64 * larger(1.0, estimate.energy.abs());
        self.softening * ENERGY_SAFETY * estimate.energy_error + rounding
    }

    /// The leaf integrated along its rods, with bounds on the errors of its fields, along the lab axes,
    /// at equally many places of each rod.
    pub fn field_errors(&self) -> Option<(&Estimate, f64)> {
        let estimate = self.estimate.as_ref()?;
        Some((estimate, self.softening * SAFETY))
    }

    /// Whether the error is within the tolerance; always true on a fixed grid.
    pub fn is_accurate(&self) -> bool {
        self.fixed || self.error().is_some_and(|error| error <= self.tolerance)
    }

    /// The leaf integrated to the nodes of the finest grid, or of a finer one if it was
    /// corrected, and its error, if that is within the tolerance or the leaf was corrected.
    pub fn integrated(&self) -> Option<(&Estimate, f64)> {
        let (estimate, segments) = (self.estimate.as_ref()?, self.levels.last()?.leaf.segments());
        let error = match estimate.corrections {
            0 => SAFETY * estimate.largest() + self.unfinished(segments),
            _ => self.error()?,
        };
        (error <= self.tolerance || estimate.corrections > 0).then_some((estimate, error))
    }

    /// The integrated leaf, if its error was corrected.
    pub fn corrected(&self) -> Option<&Estimate> {
        self.estimate
            .as_ref()
            .filter(|estimate| estimate.corrections > 0)
    }

    /// The same with the error of the values on its only grid or of the extrapolated values
    /// estimated from their defect, and corrected if that makes them accurate enough. The
    /// equations take the place of the `spare` ones.
    pub fn estimated(
        mut self,
        problem: &Problem,
        spare: &mut Option<System>,
        work: &mut Work,
    ) -> Self {
        let most = problem.corrections();
        let farthest = OUT_OF_REACH * CORRECTED.powi(-(most as i32)) * self.tolerance;
        // A leaf that can turn is the same one of its circle on every grid: the response to a defect
        // leaves where on the circle it is as it was, with the error of that.
        let turns = |level: &Level| !level.leaf.turns(&level.state).is_empty();
        // The defect is that of dead loads.
        let columns = match self.table.best() {
            _ if problem.leaf.in_wind() || self.levels.last().is_some_and(turns) => None,
            Some(best) => (best.error <= farthest).then_some(best.columns),
            // What has left a saddle may be close to another on the next grid.
            None => (problem.may_be_alone() && self.history.pushes == 0).then_some(0),
        };
        let enough = (self.tolerance / SAFETY - ROUNDING * COARSEST as f64, most);
        let (levels, systems) = (&self.levels, (&mut self.linear, spare));
        self.estimate =
            columns.and_then(|columns| defect::estimate(levels, columns, enough, systems, work));
        if (self.levels.last()).is_some_and(|level| is_large(&level.leaf)) {
            self.linear = None;
        }
        self
    }

    /// Whether errors by unfinished iterations and rounding alone exceed the tolerance on a
    /// grid of `segments` segments and are already at least half of the present error:
    /// refinement does not help then.
    pub fn beyond_rounding(&self, segments: usize) -> bool {
        let floor = self.unfinished(segments);
        floor > self.tolerance && self.error().is_some_and(|error| error <= 2.0 * floor)
    }
}
