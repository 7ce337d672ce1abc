//! The error of what a run has found, from its grids and the defect on them.

use super::{
    COARSEST, CORRECTED, CORRECTIONS, EXTRAPOLATED, LARGEST, LAYERS, LEAST_ALONE, OUT_OF_REACH,
    ROUNDING, Run, SAFETY, is_large,
};
use crate::largest::larger;
use crate::relax::accuracy::defect;
use crate::relax::accuracy::defect::Estimate;
use crate::relax::request::method::Method;

impl Run<'_, '_> {
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
        let extrapolation = match &self.estimate {
            // The errors of unfinished iterations are corrected with the others.
            Some(estimate) if estimate.corrections > 0 => {
                return Some(SAFETY * estimate.largest() + ROUNDING * segments[0] as f64);
            }
            // If nodes are few the midpoints are stations, too.
            Some(estimate) if self.too_coarse(segments[0]) || best.is_none() => {
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
        EXTRAPOLATED * self.remaining + ROUNDING * segments as f64
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

    /// The largest number of corrections.
    fn corrections(&self) -> usize {
        let grids = matches!(self.options.method, Method::SemiImplicit(_));
        let free = self.leaf.held.is_none() && self.segments().is_none();
        match grids && free && self.shape_alone {
            true => CORRECTIONS,
            false => 0,
        }
    }

    /// Whether the first grid may be enough.
    pub fn may_be_alone(&self) -> bool {
        self.corrections() > 0 && self.tolerance >= LEAST_ALONE
    }

    /// Estimates the error of the values on the only grid or of the extrapolated values from
    /// their defect, and corrects it if that makes them accurate enough.
    pub fn estimate_accuracy(&mut self) {
        let most = self.corrections();
        let farthest = OUT_OF_REACH * CORRECTED.powi(-(most as i32)) * self.tolerance;
        let columns = match self.table.best() {
            Some(best) => (best.error <= farthest).then_some(best.columns),
            // What has left a saddle may be close to another on the next grid.
            None => (self.may_be_alone() && self.pushes == 0).then_some(0),
        };
        let enough = (self.tolerance / SAFETY - ROUNDING * COARSEST as f64, most);
        let systems = (&mut self.linear, &mut self.spare_system);
        let (levels, work) = (&self.levels, &mut self.work);
        self.estimate =
            columns.and_then(|columns| defect::estimate(levels, columns, enough, systems, work));
        if (self.levels.last()).is_some_and(|level| is_large(&level.leaf)) {
            self.linear = None;
        }
    }

    /// Whether errors by unfinished iterations and rounding alone exceed the tolerance on a
    /// grid of `segments` segments and are already at least half of the present error:
    /// refinement does not help then.
    pub fn beyond_rounding(&self, segments: usize) -> bool {
        let floor = self.unfinished(segments);
        floor > self.tolerance && self.error().is_some_and(|error| error <= 2.0 * floor)
    }
}
