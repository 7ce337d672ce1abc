//! The end of the path, reached on one grid or, where stability was lost, on two that agree.

use super::walk::Walk;
use super::{Event, Path};
use crate::leaf::{DiscreteLeaf, Grid, Leaf, State, half_of, whole_of};
use crate::newton::Stop;
use crate::relax::level::{Level, positions};
use crate::relax::options::Progress;
use crate::relax::prolong::transfer;
use crate::relax::richardson::distance;
use crate::relax::run::{BUDGET, Run};

/// Segments of the coarsest grid of a walk, and of the finest on which a lost stability is
/// confirmed.
pub const COARSEST: usize = 8;
const FINEST: usize = 64;

/// The finest grid that is tried where coarser ones do not resolve the bending.
const FINEST_RESOLVING: usize = 2048;

/// States on two grids of which no common nodes are farther apart than this (lengths) are the
/// same equilibrium.
pub const SAME_PLACE: f64 = 0.05;

/// Limit on nodes times force evaluations of a walk: some seconds.
const BUDGET_OF_WALK: usize = BUDGET / 2;

impl<'a> Run<'a, '_> {
    /// Loads the leaf slowly, and brings it to rest on nested grids from where that leads; the
    /// `half` of it where it keeps its mirror symmetry. A grid that was too coarse for the walk
    /// is refined.
    pub fn load_slowly(mut self, half: Option<&'a Leaf>) -> (Self, Result<bool, Stop>) {
        let leaf = self.leaf;
        let mut grid = Grid::new(COARSEST.max(leaf.kinks().len() + 1), leaf.kinks());
        loop {
            let arrived = match self.arrive(grid) {
                Ok(arrived) => arrived,
                Err(stop) => return (self, Err(stop)),
            };
            grid = arrived[arrived.len() - 1].leaf.grid.refined();
            let guesses = self.guesses(&arrived);
            let path = self.path.take();
            if let Some(half) = half
                && guesses.iter().all(|(_, state)| is_mirrored(half, state))
            {
                self = self.of(half, Some(leaf));
                let halves = guesses
                    .iter()
                    .map(|(grid, state)| (grid.clone(), half_of(half, state)));
                let end = self.follow(halves.collect());
                self.path.clone_from(&path);
                if self.is_answer(&end) {
                    return (self.completed(leaf), end);
                }
                self = self.of(leaf, None);
            }
            let last = grid.segments() > FINEST || self.segments().is_some();
            self.stays_in_valley = !last;
            let end = self.follow(guesses);
            self.path = path;
            if end.is_ok() || last || self.out_of_time() {
                return (self, end);
            }
            self = self.of(leaf, None);
        }
    }

    /// Walks on this grid, and on finer ones where it does not resolve the leaf or where
    /// stability was lost; the leaf on one grid, or on two that agree, from coarse to fine. If
    /// no grid leads to rest, the last state is kept.
    pub fn arrive(&mut self, mut grid: Grid) -> Result<Vec<Level>, Stop> {
        let mut before: Option<Level> = None;
        loop {
            let (level, events, end) = self.walk(grid.clone());
            let finer = grid.refined();
            let last = finer.segments() > FINEST || self.out_of_time();
            match end {
                Ok(()) if events.is_empty() => {
                    self.path = Some(Path::STABLE);
                    return Ok(vec![level]);
                }
                Ok(()) => {
                    let confirmed = before.as_ref().is_some_and(|coarser| {
                        distance(&positions(coarser, 1), &positions(&level, 2)) < SAME_PLACE
                    });
                    if confirmed || last {
                        let coarser = before.filter(|_| confirmed);
                        self.path = Some(Path::Loaded { events, confirmed });
                        return Ok(coarser.into_iter().chain([level]).collect());
                    }
                    before = Some(level);
                }
                Err(stop) => {
                    let resolved = stop != Stop::Unresolved || finer.segments() > FINEST_RESOLVING;
                    if (resolved && last) || self.out_of_time() {
                        self.push(level);
                        return Err(stop);
                    }
                    before = None;
                }
            }
            grid = finer;
        }
    }

    /// The initial guesses from where a walk arrived: on the grids of the walk, or on the
    /// requested one.
    pub fn guesses(&self, arrived: &[Level]) -> Vec<(Grid, State)> {
        match self.segments() {
            None => (arrived.iter())
                .map(|level| (level.leaf.grid.clone(), level.state.clone()))
                .collect(),
            Some(segments) => {
                let finest = &arrived[arrived.len() - 1];
                let grid = Grid::new(segments, self.leaf.kinks());
                let state = transfer(&finest.leaf, &finest.state, &grid);
                vec![(grid, state)]
            }
        }
    }

    /// Walks on one grid.
    fn walk(&mut self, grid: Grid) -> (Level, Vec<Event>, Result<(), Stop>) {
        let leaf = DiscreteLeaf::new(self.leaf, grid);
        let segments = leaf.segments();
        let report = &mut *self.progress;
        let mut progress = |step: usize, residual: f64| {
            let grid = segments;
            report(&Progress::Relaxing {
                grid,
                step,
                residual,
            });
        };
        let most = self.work.force_evaluations + BUDGET_OF_WALK / (leaf.rods() * segments);
        let mut walk = Walk::new(
            &leaf,
            (&mut self.work, &mut progress),
            (&self.options.limit, most),
        );
        walk.leaning = self.options.leaning;
        let end = walk.run();
        let events = std::mem::take(&mut walk.events);
        let reached = (walk.stage, walk.part);
        let mut state = walk.last();
        leaf.leaf.hold_tips(&mut state);
        if leaf.tips_move_together() {
            state.join_tips();
        }
        self.reached = end.is_err().then_some(reached);
        (Level { leaf, state }, events, end)
    }
}

/// Distance of a state from its mirror image, lengths, that is rounding or unfinished iteration.
const MIRRORED: f64 = 1e-3;

/// Whether a state is its own mirror image.
fn is_mirrored(half: &Leaf, state: &State) -> bool {
    whole_of(half, &half_of(half, state)).shift_to(state) < MIRRORED
}
