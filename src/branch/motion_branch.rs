//! A branch of equilibria on which forces without a potential act, followed through a parameter.
//!
//! There is no index and no energy: every point is brought to rest on its own grids by Newton's method with
//! the unsymmetric matrix, predicted on the line through the two before, and its stability is that of its
//! linearised motion. The parameter increases along the branch, which ends where it turns back.

use crate::branch::continuation::BranchEnd;
use crate::branch::equations::CorrectorFailure;
use crate::branch::family::LeafFamily;
use crate::branch::motion_critical::{KnownStability, MotionCriticalPoint, locate_critical_point};
use crate::leaf::{Grid, Leaf};
use crate::relax::accuracy::transfer::transfer;
use crate::relax::balanced::{rest_near, state_on_line};
use crate::relax::{Equilibrium, GridLevel, Options, RelaxedLeaf, StateOnGrid};

/// Steps in the parameter, as parts of its range, and displacements of the leaf in lengths.
struct Steps {
    /// The shortest step: what Newton's method does not reach by it is not on the branch.
    shortest: f64,
    /// Factor on a step that fails, and on the next after one that does not.
    failure: f64,
    growth: f64,
    /// Largest displacement from the prediction.
    farthest: f64,
    /// Segments of the finest grid on which the next point is looked for: beside a fold coarser grids have
    /// none.
    finest: usize,
}

const STEPS: Steps = Steps {
    shortest: 1e-5,
    failure: 0.25,
    growth: 2.0,
    farthest: 0.05,
    finest: 256,
};

/// Critical points between two regular ones, at most.
const MOST_BETWEEN: usize = 8;

/// Largest bound on the error of a critical value, as a part of the distance of the points beside it.
const LARGEST_ERROR: f64 = 0.1;

/// Distance behind a critical point, as a part of the range, from which the next is looked for.
const BEHIND_CRITICAL: f64 = 1e-5;

/// Distances from a critical point, as parts of the range, at which the leaf is taken if its equations are
/// singular there, as at a divergence.
const BESIDE_CRITICAL: [f64; 3] = [0.0, -1e-7, -1e-5];

/// A leaf at rest on a branch.
pub(crate) struct MotionBranchPoint {
    /// The parameter, as a fraction of its range.
    pub fraction: f64,
    /// The leaf in the units of the scenario.
    pub leaf: Equilibrium,
    /// Whether growth begins or ends there; none at a regular point.
    pub critical: Option<MotionCriticalPoint>,
    /// The leaf on its grids.
    levels: Vec<GridLevel>,
}

impl MotionBranchPoint {
    pub fn regular(fraction: f64, relaxed: RelaxedLeaf) -> Self {
        MotionBranchPoint {
            fraction,
            leaf: relaxed.result,
            critical: None,
            levels: relaxed.on_grids.levels,
        }
    }

    /// The leaf on the finest of its grids.
    fn finest(&self) -> &GridLevel {
        &self.levels[self.levels.len() - 1]
    }

    /// The leaf on the coarsest of its grids with at least so many segments, or on the finest.
    fn level_from(&self, least: usize) -> &GridLevel {
        let mut levels = self.levels.iter();
        let fine = levels.find(|level| level.leaf.segments() >= least);
        fine.unwrap_or(self.finest())
    }

    /// Segments of the finest of its grids.
    pub fn finest_segments(&self) -> usize {
        self.finest().leaf.segments()
    }

    /// Roots with growth, both of a conjugate pair, if they are known: of a critical point those after it.
    pub fn unstable_roots(&self) -> Option<usize> {
        match (&self.critical, &self.leaf.stability.small_motions) {
            (Some(critical), _) => Some(critical.unstable_roots[1]),
            (None, motions) => motions.as_ref()?.unstable_roots,
        }
    }

    /// So many roots next to zero have those with growth among them.
    fn searched_roots(&self) -> usize {
        let motions = self.leaf.stability.small_motions.as_ref();
        motions.map_or(0, |motions| motions.searched_roots)
    }
}

/// How a branch is followed.
pub(crate) struct MotionContinuation<'o> {
    pub options: &'o Options,
    /// Required accuracy of the tips, relative to the longest rod.
    pub tolerance: f64,
    /// Longest step, as a part of the range.
    pub longest: f64,
    pub most_points: usize,
    /// Whether the branch ends where it loses its stability.
    pub until_unstable: bool,
    /// The grid on which every point begins; none: that of the first.
    pub segments: Option<usize>,
}

/// A branch, with its critical points among the others.
pub(crate) struct MotionBranch {
    pub points: Vec<MotionBranchPoint>,
    pub end: BranchEnd,
    /// Whether growth begins or ends between two points at a value that was not located.
    pub unlocated: Option<usize>,
}

impl MotionBranch {
    /// Segments of the coarsest grid of the last regular point with at least so many.
    fn coarsest_segments(&self, least: usize) -> usize {
        let last = self.points.iter().rev().find(|it| it.critical.is_none());
        last.map_or(least, |last| {
            least.max(last.level_from(least).leaf.segments())
        })
    }
}

/// The state at a fraction on the line through two points, on the coarsest grid of the first with at least so
/// many segments, or one with nodes where the leaf needs them.
fn guess(
    leaf: &Leaf,
    [last, before]: [&MotionBranchPoint; 2],
    fraction: f64,
    least: usize,
) -> StateOnGrid {
    let level = last.level_from(least);
    let same_nodes = level.leaf.leaf.kinks() == leaf.kinks();
    if !same_nodes || level.leaf.segments() < least {
        let segments = least.max(level.leaf.segments());
        let grid = match same_nodes {
            true => level.leaf.grid.refined(),
            false => Grid::new(segments, leaf.kinks()),
        };
        let state = transfer(&level.leaf, &level.state, &grid);
        return StateOnGrid { grid, state };
    }
    let grid = level.leaf.grid.clone();
    let alike = |it: &&GridLevel| it.leaf.grid.sigma() == grid.sigma();
    let before_here = before.levels.iter().find(alike);
    let state = match before_here.filter(|_| before.fraction != last.fraction) {
        Some(other) => {
            let at = (fraction - before.fraction) / (last.fraction - before.fraction);
            state_on_line(&other.state, &level.state, at)
        }
        None => level.state.clone(),
    };
    StateOnGrid { grid, state }
}

impl MotionContinuation<'_> {
    /// Follows the branch of the first point, at the fraction 0, to 1. `progress` takes the number of points and
    /// the fraction of the last.
    pub fn follow(
        &self,
        family: &LeafFamily,
        first: MotionBranchPoint,
        progress: &mut dyn FnMut(usize, f64),
    ) -> MotionBranch {
        let mut branch = MotionBranch {
            points: vec![first],
            end: BranchEnd::RangeEndReached,
            unlocated: None,
        };
        let (mut step, mut at) = (self.longest, 0.0);
        let mut least = self.segments.unwrap_or(0);
        progress(1, at);
        while at < 1.0 {
            if family.limit.reached() {
                branch.end = BranchEnd::RunLimitReached;
                break;
            }
            if branch.points.len() >= self.most_points {
                branch.end = BranchEnd::PointLimitReached;
                break;
            }
            let next = match at + step > 1.0 - STEPS.shortest {
                true => 1.0,
                false => at + step,
            };
            match self.point_at(family, &branch.points, next, least) {
                Ok(point) => {
                    at = next;
                    step = (STEPS.growth * step).min(self.longest);
                    self.add_with_critical(family, &mut branch, point);
                    progress(branch.points.len(), at);
                    if self.until_unstable && self.ends_unstable(&mut branch) {
                        break;
                    }
                }
                Err(_) if step > STEPS.shortest && !family.limit.reached() => {
                    step *= STEPS.failure;
                }
                Err(_)
                    if branch.coarsest_segments(least) < STEPS.finest
                        && !family.limit.reached() =>
                {
                    least = 2 * branch.coarsest_segments(least);
                    step = self.longest;
                }
                Err(failure) => {
                    branch.end = match family.limit.reached() {
                        true => BranchEnd::RunLimitReached,
                        false => BranchEnd::StepFailed(failure),
                    };
                    break;
                }
            }
        }
        branch
    }

    /// The point at a fraction next to the last of these.
    fn point_at(
        &self,
        family: &LeafFamily,
        points: &[MotionBranchPoint],
        fraction: f64,
        least: usize,
    ) -> Result<MotionBranchPoint, CorrectorFailure> {
        let leaf = family.leaf([fraction])?;
        let mut regular = points.iter().rev().filter(|it| it.critical.is_none());
        let (Some(last), before) = (regular.next(), regular.next()) else {
            return Err(CorrectorFailure::NotConverged);
        };
        let guess = guess(&leaf, [last, before.unwrap_or(last)], fraction, least);
        let expected = guess.state.clone();
        let relaxed = self.rest(&leaf, guess)?;
        let near = (relaxed.on_grids.levels.first())
            .is_some_and(|it| it.state.largest_displacement_to(&expected) < STEPS.farthest);
        match near {
            true => Ok(MotionBranchPoint::regular(fraction, relaxed)),
            false => Err(CorrectorFailure::TurnsBack),
        }
    }

    fn rest(&self, leaf: &Leaf, guess: StateOnGrid) -> Result<RelaxedLeaf, CorrectorFailure> {
        use crate::newton::EquilibriumFailure;
        rest_near(leaf, guess, self.options, self.tolerance).map_err(|stop| match stop {
            EquilibriumFailure::Unresolved => CorrectorFailure::Unresolved,
            EquilibriumFailure::Memory => CorrectorFailure::TooLarge,
            _ => CorrectorFailure::TurnsBack,
        })
    }

    /// Adds a point, and before it the critical points between it and the last point whose stability is
    /// known.
    fn add_with_critical(
        &self,
        family: &LeafFamily,
        branch: &mut MotionBranch,
        point: MotionBranchPoint,
    ) {
        let known = (branch.points.iter())
            .rposition(|it| it.critical.is_none() && it.unstable_roots().is_some());
        let mut found: Vec<MotionBranchPoint> = Vec::new();
        if let (Some(known), Some(after)) = (known, point.unstable_roots()) {
            let from = &branch.points[known];
            let before = from.unstable_roots().unwrap_or(after);
            let ends = [(from.fraction, before), (point.fraction, after)];
            if !self.locate_all(family, ends, [from, &point], &mut found) {
                branch.unlocated = Some(known);
            }
        }
        branch.points.extend(found);
        branch.points.push(point);
        // Between may be points at which it is not certain what grows.
        let first = known.map_or(0, |known| known + 1);
        branch.points[first..].sort_by(|a, b| a.fraction.total_cmp(&b.fraction));
    }

    /// Locates all critical points between two ends, fractions with their numbers of roots with growth, beside
    /// points of the branch; whether these are all.
    fn locate_all(
        &self,
        family: &LeafFamily,
        ends: [(f64, usize); 2],
        beside: [&MotionBranchPoint; 2],
        found: &mut Vec<MotionBranchPoint>,
    ) -> bool {
        let [(from, before), (to, after)] = ends;
        if before == after {
            return true;
        }
        if found.len() >= MOST_BETWEEN || to - from <= BEHIND_CRITICAL || family.limit.reached() {
            return false;
        }
        let [low, high] = beside;
        let known = |(fraction, unstable_roots), of: &'_ MotionBranchPoint| KnownStability {
            fraction,
            unstable_roots,
            searched_roots: of.searched_roots(),
            level: of.finest().clone(),
        };
        let located = locate_critical_point(
            family,
            [known(ends[0], low), known(ends[1], high)],
            self.tolerance,
        );
        let certain = |it: &MotionCriticalPoint| {
            let error = it.fraction_error.unwrap_or(0.0);
            let within = it.fraction >= from - error && it.fraction <= to + error;
            within && error <= LARGEST_ERROR * (to - from)
        };
        let Some(critical) = located.filter(certain) else {
            return false;
        };
        let Some(point) = self.critical_point(family, beside, critical) else {
            return false;
        };
        let [below, above] = critical.unstable_roots;
        let under = [ends[0], (critical.fraction - BEHIND_CRITICAL, below)];
        let over = [(critical.fraction + BEHIND_CRITICAL, above), ends[1]];
        let all_below = self.locate_all(family, under, [low, &point], found);
        let all_above = self.locate_all(family, over, [&point, high], found);
        found.push(point);
        all_below && all_above
    }

    /// The leaf at a critical point between two regular ones.
    fn critical_point(
        &self,
        family: &LeafFamily,
        [from, to]: [&MotionBranchPoint; 2],
        critical: MotionCriticalPoint,
    ) -> Option<MotionBranchPoint> {
        BESIDE_CRITICAL.iter().find_map(|beside| {
            let fraction = critical.fraction + beside;
            let leaf = family.leaf([fraction]).ok()?;
            let guess = guess(&leaf, [to, from], fraction, 0);
            let relaxed = self.rest(&leaf, guess).ok()?;
            Some(MotionBranchPoint {
                fraction: critical.fraction,
                critical: Some(critical),
                ..MotionBranchPoint::regular(fraction, relaxed)
            })
        })
    }

    /// Ends a branch at the first critical point at which it loses stability.
    fn ends_unstable(&self, branch: &mut MotionBranch) -> bool {
        let loses = |it: &MotionBranchPoint| {
            (it.critical).is_some_and(|it| it.unstable_roots[1] > it.unstable_roots[0])
        };
        let Some(last) = branch.points.iter().position(loses) else {
            return false;
        };
        branch.points.truncate(last + 1);
        branch.end = BranchEnd::StabilityLost;
        true
    }
}
