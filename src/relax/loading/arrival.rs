//! The end of the path, reached on one grid or, where stability was lost, on two that agree.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, State, System, half_of, whole_of};
use crate::newton::Stop;
use crate::relax::accuracy::richardson::distance;
use crate::relax::loading::walk::Walk;
use crate::relax::path::{Event, Path};
use crate::relax::request::options::Progress;
use crate::relax::saddle;
use crate::relax::settle::iteration::InitialGuess;
use crate::relax::settle::run::{BUDGET, Run};
use crate::relax::transfer::level::{Level, positions};
use crate::relax::transfer::prolong::{prolong, transfer};

/// Segments of the coarsest grid of a walk, and of the finest on which a lost stability is
/// confirmed.
pub const COARSEST: usize = 8;
const FINEST: usize = 64;

/// The finest grid that is tried where coarser ones do not resolve the bending.
const FINEST_RESOLVING: usize = 2048;

/// States on two grids of which no common nodes are farther apart than this (lengths) are the
/// same equilibrium.
pub const SAME_PLACE: f64 = 0.05;

/// Energies of the same equilibrium on one grid agree to this part, or of A/L.
const SAME_ENERGY: f64 = 1e-5;

/// The finest requested grid, in segments of the grid from which it is interpolated.
const FARTHEST_GRID: usize = 8;

/// Limits on the force evaluations of all walks, and on nodes times these: typical walks take a
/// dozen, and a few hundred for each loss of stability.
const MOST_EVALUATIONS: usize = 2500;
const BUDGET_OF_WALKS: usize = BUDGET / 8;

/// The least compliance (L^2/A) on a walk: a stiffer leaf differs from it by its strains of some
/// millionths, while the signs of the eigenvalues of its matrix would be lost to rounding.
const WALKING_COMPLIANCE: f64 = 1e-6;

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
                Err(stop) => return self.release_instead(stop),
            };
            grid = arrived.leaf.grid.refined();
            let (on, state) = self.guess(arrived);
            let path = self.path.take();
            if let Some(half) = half
                && is_mirrored(half, &state)
            {
                self = self.of(half, Some(leaf));
                let end = self.follow(vec![(on.clone(), half_of(half, &state))]);
                self.path.clone_from(&path);
                if self.is_answer(&end) {
                    return (self.completed(leaf), end);
                }
                self = self.of(leaf, None);
            }
            let last = grid.segments() > FINEST || self.segments().is_some();
            self.stays_in_valley = !last;
            let end = self.follow(vec![(on, state)]);
            // Further grids may show that it has to leave the valley.
            self.stays_in_valley = false;
            self.path = path;
            match end {
                Ok(false) | Err(_) if last && self.segments().is_none() => {
                    let stop = end.err().unwrap_or(Stop::StepLimit);
                    return self.release_instead(stop);
                }
                Err(_) if !last && !self.out_of_time() => self = self.of(leaf, None),
                Ok(false) if !self.out_of_time() && !self.path_is_stable() => {
                    return self.release_instead(Stop::StepLimit);
                }
                _ => return (self, end),
            }
        }
    }

    /// Whether nothing happened on its path.
    fn path_is_stable(&self) -> bool {
        (self.path.as_ref()).is_some_and(|path| path.events().is_empty())
    }

    /// A leaf whose path could not be followed is released from arcs.
    fn release_instead(self, stop: Stop) -> (Self, Result<bool, Stop>) {
        // Others were released before.
        if self.out_of_time() || !self.loads_slowly() {
            return (self, Err(stop));
        }
        let leaf = self.leaf;
        let segments = self.segments().unwrap_or(COARSEST);
        let grid = Grid::new(segments.max(leaf.kinks().len() + 1), leaf.kinks());
        let mut released = self.of(leaf, None);
        let end = released.solve(grid);
        released.path = Some(Path::Released);
        (released, end)
    }

    /// Walks on this grid, and on finer ones where it does not resolve the leaf or where
    /// stability was lost; the leaf on the coarser of two grids that agree. If no grid leads to
    /// rest, the last state is kept.
    pub fn arrive(&mut self, mut grid: Grid) -> Result<Level, Stop> {
        let mut before: Option<Level> = None;
        loop {
            let (level, events, end) = self.walk(grid.clone());
            let finer = grid.refined();
            let spent = self.walks_left() == 0 || self.out_of_time();
            let last = finer.segments() > FINEST || spent;
            match end {
                Ok(()) if events.is_empty() => {
                    self.path = Some(Path::STABLE);
                    return Ok(level);
                }
                Ok(()) => {
                    let near = before.as_ref().is_some_and(|coarser| {
                        distance(&positions(coarser, 1), &positions(&level, 2)) < SAME_PLACE
                    });
                    let confirmed = near
                        || before
                            .as_ref()
                            .is_some_and(|coarser| self.is_alike(coarser, &level));
                    if confirmed || last {
                        self.path = Some(Path::Loaded { events, confirmed });
                        // On finer grids it is followed: two members of a circle of equilibria
                        // would not be extrapolated.
                        return Ok(before.filter(|_| confirmed).unwrap_or(level));
                    }
                    before = Some(level);
                }
                Err(stop) => {
                    let resolved = stop != Stop::Unresolved || finer.segments() > FINEST_RESOLVING;
                    if (resolved && last) || spent {
                        self.push(level);
                        return Err(stop);
                    }
                    before = None;
                }
            }
            grid = finer;
        }
    }

    /// Whether the equilibrium on a coarser grid has, on the grid of `level`, the energy of that
    /// there: it is one of a circle of equilibria then, as of a buckled round column, or its
    /// mirror image.
    fn is_alike(&mut self, coarser: &Level, level: &Level) -> bool {
        let Level { leaf, state } = level;
        let mut other = prolong(&coarser.leaf, &coarser.state);
        let mut system = System::new(leaf);
        let index = saddle::polish(leaf, &mut other, &mut system, &mut self.work);
        let [a, b] = [state, &other].map(|state| leaf.energy(state));
        index == Some(0) && (a - b).abs() <= SAME_ENERGY * a.abs().max(1.0)
    }

    /// The initial guess from where a walk arrived: on the grid of the walk, or on the requested
    /// one.
    pub fn guess(&mut self, arrived: Level) -> (Grid, State) {
        let Some(segments) = self.segments() else {
            return (arrived.leaf.grid, arrived.state);
        };
        let grid = Grid::new(segments, self.leaf.kinks());
        let mut finest = arrived;
        while FARTHEST_GRID * finest.leaf.segments() < segments {
            let state = prolong(&finest.leaf, &finest.state);
            let finer = finest.leaf.grid.refined();
            finest = self.settle(finer, InitialGuess::Coarser(state)).level;
        }
        let state = transfer(&finest.leaf, &finest.state, &grid);
        (grid, state)
    }

    /// Nodes times force evaluations that are left for walks.
    fn walks_left(&self) -> usize {
        BUDGET_OF_WALKS.saturating_sub(self.walked)
    }

    /// Walks on one grid.
    fn walk(&mut self, grid: Grid) -> (Level, Vec<Event>, Result<(), Stop>) {
        let leaf = DiscreteLeaf::new(self.leaf, grid).softened(WALKING_COMPLIANCE);
        let (segments, left) = (leaf.segments(), self.walks_left());
        let report = &mut *self.progress;
        let mut progress = |step: usize, residual: f64| {
            let grid = segments;
            report(&Progress::Relaxing {
                grid,
                step,
                residual,
            });
        };
        let (before, nodes) = (self.work.force_evaluations, leaf.rods() * segments);
        let most = before + (left / nodes).min(MOST_EVALUATIONS);
        let mut walk = Walk::new(
            &leaf,
            (&mut self.work, &mut progress),
            (&self.options.limit, most),
        );
        walk.leaning = self.options.leaning;
        let end = walk.run();
        let events = std::mem::take(&mut walk.events);
        let reached = (walk.stage, walk.part);
        let evaluations = walk.work.force_evaluations - before;
        // Walks on coarse grids are cheap, and yet not many.
        self.walked += evaluations * nodes.max(BUDGET_OF_WALKS / MOST_EVALUATIONS);
        let mut state = walk.last();
        if leaf.tips_move_together() {
            state.join_tips();
        }
        leaf.lean_down(&mut state);
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
