//! Nested grids: as fine as the tolerance needs, with an error estimate.

use crate::leaf::{Grid, State};
use crate::memory::Request;
use crate::newton::Stop;
use crate::relax::fields::fields;
use crate::relax::level::{Level, positions};
use crate::relax::options::MAX_NODES;
use crate::relax::predict::predict;
use crate::relax::prolong::{prolong, restrict};
use crate::relax::run::{BUDGET, Run};
use crate::relax::segments::{COARSEST_TURN, FINEST};
use crate::relax::settle::{InitialGuess, Settled};

/// Two grids on which the leaf moved far are said to have settled in the same place
/// if no coordinate of a station differs by more than this, in lengths.
const SAME_PLACE: f64 = 0.05;

/// The finest grid on which such places are compared.
const FINEST_LANDING: usize = 256;

/// The finest grid that is tried when coarser ones do not resolve the bending.
const FINEST_RESOLVING: usize = 2048;

impl Run<'_, '_> {
    /// From the start to rest, on as many grids as the tolerance needs; returns
    /// whether the finest grid allowed reaches it.
    pub fn solve(&mut self, grid: Grid) -> Result<bool, Stop> {
        self.settle_from_start(grid)?;
        self.refine()
    }

    /// The same from guesses on nested grids, near which the leaf is at rest.
    pub fn follow(&mut self, guesses: Vec<(Grid, State)>) -> Result<bool, Stop> {
        self.follow_on_these(guesses)?;
        self.refine()
    }

    /// The same on these grids alone, however accurate they are; the leaf is at rest
    /// where its energy has a minimum for all that the iteration sees.
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
            self.judge_accuracy();
            if self.accurate() && self.judge_stability()? && !self.needs_another_grid() {
                return Ok(true);
            }
            if self.late() {
                return Err(Stop::StepLimit);
            }
            let Some(finer) = self.finer() else {
                self.judge_stability()?;
                return Ok(false);
            };
            self.settle_on(finer)?;
        }
    }

    /// Whether the nodes of the finest grid are requested and the leaf is not accurate
    /// enough there: one more grid is added for them.
    fn needs_another_grid(&mut self) -> bool {
        let enough = !self.options.every_node || self.integrated().is_some();
        if enough || self.for_nodes || self.finer().is_none() {
            return false;
        }
        let levels: Vec<&Level> = self.levels.iter().collect();
        let columns = self.table.best().map_or(0, |best| best.columns);
        let fields = fields(&levels, columns, (self.error(), self.tolerance), true, None);
        self.for_nodes = fields.stations.len() <= levels[levels.len() - 1].leaf.segments();
        self.for_nodes
    }

    /// Goes on, with all unknowns of a leaf at rest, to a `finer` grid.
    pub fn go_on(&mut self, finer: Grid) -> Result<bool, Stop> {
        (self.solved, self.planar) = (self.leaf.rods(), self.leaf.planar());
        self.settle_on(finer)?;
        self.refine()
    }

    /// The next finer grid, if there may be one.
    pub fn finer(&self) -> Option<Grid> {
        let grid = self.levels.last()?.leaf.grid.refined();
        let (rods, segments) = (self.leaf.rods(), grid.segments());
        let allowed = self.segments().is_none()
            && segments <= FINEST
            && rods * segments <= MAX_NODES
            && (Request::Grid { rods, segments }).weigh().is_ok()
            && !self.beyond_rounding(segments);
        allowed.then_some(grid)
    }

    /// The leaf at rest on the next finer grid, from where it rests on those before.
    pub fn settle_on(&mut self, finer: Grid) -> Result<(), Stop> {
        let level = self.levels.last().expect("the leaf has settled");
        let mut state = prolong(&level.leaf, &level.state);
        let guess = match self.predicting().as_slice() {
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

    /// The levels from which the next one is predicted: those used by the extrapolation,
    /// but at least the finest two.
    fn predicting(&self) -> Vec<&Level> {
        let columns = self.table.best().map_or(0, |best| best.columns);
        let count = (columns + 1).max(2).min(self.levels.len());
        self.levels[self.levels.len() - count..].iter().collect()
    }

    /// Whether the tolerance is reached; a fixed grid always is.
    fn accurate(&self) -> bool {
        self.segments().is_some() || self.error().is_some_and(|error| error <= self.tolerance)
    }

    /// From the start to rest on the first grid that resolves it. A leaf that
    /// had to move far must settle in the same place on two grids.
    fn settle_from_start(&mut self, mut grid: Grid) -> Result<(), Stop> {
        let mut before: Option<Level> = None;
        let mut failed: Vec<Grid> = Vec::new();
        loop {
            let settled = self.settle(grid.clone(), InitialGuess::Start);
            let Settled { level, rest, moved } = settled;
            let finer = grid.refined();
            let fixed = self.segments().is_some();
            let last = fixed || finer.segments() > FINEST_LANDING || self.late();
            match rest {
                // So coarse a grid cannot decide where a leaf that moves settles.
                _ if self.too_coarse(level.leaf.segments())
                    && (moved || rest.is_err() || largest_turn(&level) > COARSEST_TURN) => {}
                Ok(_) if !moved || last || self.by_steps => {
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
                        && self.settles_alike(&level, coarse.tripled())
                    {
                        self.push(level);
                        self.add_coarser(&failed);
                        return Ok(());
                    }
                    before = Some(level);
                }
                Err(stop) => {
                    let given_up = self.spent > BUDGET
                        || match stop {
                            Stop::Unresolved => {
                                fixed || finer.segments() > FINEST_RESOLVING || self.late()
                            }
                            _ => last,
                        };
                    if self.whole.is_some() || given_up {
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

    /// Whether the leaf moves to the same place on a grid with three quarters of the
    /// segments.
    fn settles_alike(&mut self, level: &Level, grid: Grid) -> bool {
        let Settled {
            level: other, rest, ..
        } = self.settle(grid, InitialGuess::Start);
        let (a, b) = (positions(level, 4), positions(&other, 3));
        rest.is_ok() && distance(&a, &b) < SAME_PLACE
    }

    /// Lets the leaf settle where it did on the only grid on coarser ones, too, on which
    /// it did not get there by itself: up to two, the finest last.
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
    rods.flat_map(|rod| rod.windows(2))
        .map(|ends| ends[0].angle_between(ends[1]))
        .fold(0.0, f64::max)
}

/// Largest difference between coordinates of places.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}
