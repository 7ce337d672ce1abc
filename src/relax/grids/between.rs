//! A grid between the finest two, for a better extrapolation.

use super::settle::From;
use super::{Level, Run};
use crate::relax::method::Method;
use crate::relax::prolong::{between, predict};
use crate::relax::report;
use crate::relax::richardson::Richardson;
use crate::relax::semi_implicit::Settled;

/// Where the error estimate is to become smaller by no more than this, a grid
/// between the finest two is enough.
const BETWEEN: f64 = 30.0;

impl<'a> Run<'a, '_> {
    /// Whether a grid between the finest two makes the extrapolation accurate
    /// enough: it gains about as much as one twice as fine as the finest, for
    /// three eighths of its segments.
    pub(super) fn accurate_with_between(&mut self) -> bool {
        let [.., coarse, middle, fine] = self.levels.as_slice() else {
            return false;
        };
        let near = self
            .error()
            .is_some_and(|error| error <= BETWEEN * self.tolerance);
        let clean = (self.table.best()).is_some_and(|best| best.columns + 1 == self.levels.len());
        if !near || !clean || !matches!(self.options.method, Method::SemiImplicit(_)) {
            return false;
        }
        let mut state = between(&fine.state);
        predict(&middle.state, &fine.state, &mut state);
        let grid = coarse.leaf.grid.tripled();
        // Stability is judged on the finest grid.
        let last = self.last.take();
        let (level, settled, _) = self.settle(grid, From::Finer(state));
        self.last = last;
        if !matches!(settled, Settled::Rest(_)) {
            return false;
        }
        let without = self.table.clone();
        self.between = Some(level);
        self.tabulate();
        self.change = self.table.judged_by(&without);
        if self.accurate() {
            return true;
        }
        self.drop_between();
        false
    }

    /// Leaves the grid between out, as where refinement goes on.
    pub(super) fn drop_between(&mut self) {
        if self.between.take().is_some() {
            self.change = None;
            self.tabulate();
        }
    }

    /// The grids that are extrapolated, from coarse to fine.
    pub fn series(&self) -> Vec<&Level> {
        let mut series: Vec<_> = self.levels.iter().collect();
        if let Some(between) = &self.between {
            series.insert(series.len() - 1, between);
        }
        series
    }

    pub(super) fn tabulate(&mut self) {
        let mut table = Richardson::default();
        let series = self.series();
        for level in &series {
            let segments = level.leaf.segments();
            let stride = segments / series[0].leaf.segments();
            table.push(segments, report::positions(level, stride));
        }
        self.table = table;
    }
}
