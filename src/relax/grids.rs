//! Nested grids: as fine as the tolerance needs, with an error estimate.

use crate::largest::largest;
use crate::leaf::{Grid, RodFields, State};
use crate::memory;
use crate::newton::Stop;
use crate::relax::accuracy::nodal_fields::finer_nodes;
use crate::relax::accuracy::richardson::distance;
use crate::relax::request::options::MAX_NODES;
use crate::relax::settle::iteration::{InitialGuess, Settled};
use crate::relax::settle::run::{BUDGET, Run};
use crate::relax::settle::segments::{COARSEST_TURN, FINEST};
use crate::relax::transfer::level::{Level, positions};
use crate::relax::transfer::predict::predict;
use crate::relax::transfer::prolong::{prolong, restrict};

/// Two grids on which the leaf moved far count as settled at the same equilibrium if no
/// common nodes are farther apart than this, in lengths.
const SAME_PLACE: f64 = 0.05;

/// The finest grid for this comparison.
const FINEST_COMPARED: usize = 256;

/// The finest grid that is tried when coarser ones do not resolve the bending.
pub(super) const FINEST_RESOLVING: usize = 2048;

impl Run<'_, '_> {
    /// From the start to rest, on as many grids as the tolerance needs; returns
    /// whether the finest grid allowed reaches it.
    pub fn solve(&mut self, grid: Grid) -> Result<bool, Stop> {
        self.settle_from_start(grid)?;
        self.refine()
    }

    /// The same from initial guesses on nested grids, each close to an equilibrium.
    pub fn follow(&mut self, guesses: Vec<(Grid, State)>) -> Result<bool, Stop> {
        self.follow_on_these(guesses)?;
        self.refine()
    }

    /// The same on these grids alone, whatever their accuracy; stability is not checked beyond
    /// the positive definite matrix of the iteration.
    pub fn follow_on_these(&mut self, guesses: Vec<(Grid, State)>) -> Result<(), Stop> {
        for (grid, state) in guesses {
            let Settled { level, rest, .. } = self.settle(grid, InitialGuess::Coarser(state));
            self.push(level);
            rest?;
        }
        Ok(())
    }

    /// Refines until the tolerance is reached.
    pub fn refine(&mut self) -> Result<bool, Stop> {
        loop {
            self.estimate_accuracy();
            if self.accurate() && self.check_stability(false)? && !self.needs_another_grid() {
                return Ok(true);
            }
            if self.out_of_time() {
                return Err(Stop::StepLimit);
            }
            let Some(finer) = self.finer() else {
                self.check_stability(true)?;
                return Ok(false);
            };
            self.settle_on(finer)?;
        }
    }

    /// Whether all nodes of the finest grid are requested and the leaf is not accurate enough
    /// there; then one more grid is added.
    fn needs_another_grid(&mut self) -> bool {
        let enough = !self.options.every_node || self.integrated().is_some();
        if enough || self.added_for_nodes || self.finer().is_none() {
            return false;
        }
        self.added_for_nodes = self.finer_nodes(self.levels.len()).0 + 1 < self.levels.len();
        self.added_for_nodes
    }

    /// The finest of the first `wanted` grids between whose nodes the leaf keeps the tolerance, as
    /// far as it does at the nodes of the coarsest, with the fields and the additional error there.
    pub fn finer_nodes(&self, wanted: usize) -> (usize, Vec<Vec<RodFields>>, f64) {
        let error = self.error().unwrap_or(0.0);
        let allowed = match error <= self.tolerance {
            true => self.tolerance - error,
            false => f64::INFINITY,
        };
        let columns = self.table.columns();
        finer_nodes(&self.levels, columns, wanted, [error, allowed])
    }

    /// Continues to a `finer` grid with all unknowns of a leaf at rest.
    pub fn continue_on(&mut self, finer: Grid) -> Result<bool, Stop> {
        self.solved = self.leaf.rods();
        self.settle_on(finer)?;
        self.refine()
    }

    /// The next finer grid, if the limits on its size allow it and rounding leaves something
    /// to gain.
    pub fn finer(&self) -> Option<Grid> {
        let grid = self.levels.last()?.leaf.grid.refined();
        let (rods, segments) = (self.leaf.rods(), grid.segments());
        let allowed = self.segments().is_none()
            && segments <= FINEST
            && rods * segments <= MAX_NODES
            && memory::grid(rods, segments).is_ok()
            && !self.beyond_rounding(segments);
        allowed.then_some(grid)
    }

    /// Settles the leaf on the next finer grid, from a guess by the grids before.
    pub fn settle_on(&mut self, finer: Grid) -> Result<(), Stop> {
        let level = self.levels.last().expect("the leaf has settled");
        let mut state = prolong(&level.leaf, &level.state);
        let guess = match self.levels_for_prediction().as_slice() {
            [_] => InitialGuess::Coarser(state),
            levels => {
                predict(levels, &mut state);
                InitialGuess::Predicted(state)
            }
        };
        let Settled { level, rest, .. } = self.settle(finer, guess);
        self.push(level);
        rest.map(drop)
    }

    /// The levels from which the next one is predicted: those of the extrapolation, but at
    /// least the finest two where there are two.
    fn levels_for_prediction(&self) -> Vec<&Level> {
        let count = (self.table.columns() + 1).max(2).min(self.levels.len());
        self.levels[self.levels.len() - count..].iter().collect()
    }

    /// Whether the tolerance is reached; always true on a fixed grid.
    fn accurate(&self) -> bool {
        self.segments().is_some() || self.error().is_some_and(|error| error <= self.tolerance)
    }

    /// From the start to rest on the first grid that resolves it. A leaf that had to move far
    /// must reach the same equilibrium on two grids.
    fn settle_from_start(&mut self, mut grid: Grid) -> Result<(), Stop> {
        let mut before: Option<Level> = None;
        let mut failed: Vec<Grid> = Vec::new();
        loop {
            let settled = self.settle(grid.clone(), InitialGuess::Start);
            let Settled { level, rest, moved } = settled;
            let finer = grid.refined();
            let fixed = self.segments().is_some();
            let last = fixed || finer.segments() > FINEST_COMPARED || self.out_of_time();
            match rest {
                // On so coarse a grid the equilibrium that a moving leaf reaches is not reliable.
                _ if self.too_coarse(level.leaf.segments())
                    && (moved || rest.is_err() || largest_turn(&level) > COARSEST_TURN) => {}
                Ok(_) if !moved || fixed => {
                    self.push(level);
                    return Ok(());
                }
                Ok(_) => {
                    if let Some(coarser) = before.take()
                        && distance(&positions(&coarser, 1), &positions(&level, 2)) < SAME_PLACE
                    {
                        self.push(coarser);
                        self.push(level);
                        return Ok(());
                    }
                    if before.is_none()
                        && let [.., coarse, _] = failed.as_slice()
                        && self.is_confirmed_on(&level, coarse.tripled())
                    {
                        self.push(level);
                        self.add_coarser(&failed);
                        return Ok(());
                    }
                    if last {
                        // An equilibrium, but not one to which two grids led.
                        self.unconfirmed = true;
                        self.push(level);
                        return Ok(());
                    }
                    before = Some(level);
                }
                Err(stop) => {
                    let at_limit = self.spent > BUDGET
                        || match stop {
                            Stop::Unresolved => {
                                fixed || finer.segments() > FINEST_RESOLVING || self.out_of_time()
                            }
                            _ => last,
                        };
                    if self.whole.is_some() || at_limit {
                        self.push(level);
                        return Err(stop);
                    }
                    before = None;
                    failed.push(grid);
                }
            }
            grid = finer;
        }
    }

    /// Whether the leaf reaches the same equilibrium on a grid with three quarters of the
    /// segments.
    fn is_confirmed_on(&mut self, level: &Level, grid: Grid) -> bool {
        let Settled {
            level: other, rest, ..
        } = self.settle(grid, InitialGuess::Start);
        let (a, b) = (positions(level, 4), positions(&other, 3));
        rest.is_ok() && distance(&a, &b) < SAME_PLACE
    }

    /// Adds up to two of the coarser grids that failed from the start, settled from the
    /// restricted equilibrium of the only grid so far.
    fn add_coarser(&mut self, grids: &[Grid]) {
        for grid in grids.iter().rev().take(2) {
            let fine = &self.levels[0];
            let (guess, fine) = (restrict(&fine.state), positions(fine, 2));
            let settled = self.settle(grid.clone(), InitialGuess::Coarser(guess));
            let there = distance(&positions(&settled.level, 1), &fine) < SAME_PLACE;
            if settled.rest.is_err() || settled.moved || !there {
                break;
            }
            self.levels.insert(0, settled.level);
        }
        self.tabulate();
    }
}

/// Largest rotation between the ends of a segment.
fn largest_turn(level: &Level) -> f64 {
    let n = level.leaf.segments();
    let rods = level.state.q.chunks_exact(n + 1);
    let ends = rods.flat_map(|rod| rod.windows(2));
    largest(ends.map(|ends| ends[0].angle_between(ends[1])))
}
