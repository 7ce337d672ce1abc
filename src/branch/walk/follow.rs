//! Following a branch on grids as fine as it needs, every point verified.

use glam::DVec3;
use rayon::prelude::*;

use crate::branch::Point;
use crate::branch::problem::equations::{Equations, Stuck};
use crate::branch::problem::family::Family;
use crate::branch::verify::critical::refine_critical;
use crate::branch::verify::refined::{Doubt, Refined};
use crate::branch::verify::regular::refine;
use crate::branch::walk::steps::{Branch, End, Walk};
use crate::leaf::{Grid, State};

/// The finest grid to follow a branch on, in segments and in nodes.
const FINEST: usize = 512;
const MOST_NODES: usize = 20_000;

/// Least and largest number of points computed before they are verified in parallel.
const FEWEST: usize = 2;
const MOST: usize = 16;

/// Attempts to pass a point on the finest grid, and the factor by which each shortens the step.
const TRIES: usize = 4;
const SHORTER: f64 = 0.4;

/// Largest number of consecutive points dropped next to a critical point: that lies elsewhere
/// on every grid, so that a point may be before it on one grid and beyond it on another.
const DROPPED: usize = 4;

/// From the grid on which they were found to the finest, neighbouring points move alike: the
/// difference is at most this part of their distance plus this part of the larger displacement,
/// plus `SMALL`. The part is large, since they are sought in different planes.
const ALIKE: f64 = 0.8;
const SMALL: f64 = 1e-6;

/// The equations of a family on successively refined grids, each of which halves the
/// segments of the one before.
pub struct Grids<'a> {
    equations: Vec<Equations<'a>>,
}

/// A branch with only verified points.
pub struct Followed {
    /// The branch as found on its grids.
    pub branch: Branch,
    /// How it ended.
    pub end: End,
    /// Its points, extrapolated over grids.
    pub points: Vec<Refined>,
    /// Its critical points, likewise.
    pub critical: Vec<Refined>,
    /// What was found of critical points beyond the last point.
    beyond: Vec<Result<Refined, Doubt>>,
}

impl<'a> Grids<'a> {
    /// Starts with one grid.
    pub fn new(family: &'a Family<'a>, grid: Grid) -> Self {
        Grids {
            equations: vec![Equations::new(family, grid)],
        }
    }

    /// The equations on the grid of a state, which must be one of these.
    pub fn of(&mut self, state: &State) -> &mut Equations<'a> {
        let level = (state.segments() / self.equations[0].grid().segments()).ilog2();
        &mut self.equations[level as usize]
    }

    /// Creates the next finer grid if needed; false if that is too fine.
    fn refine(&mut self, state: &State) -> bool {
        let finer = 2 * state.segments();
        if finer > FINEST || finer * state.rods() > MOST_NODES {
            return false;
        }
        let last = &self.equations[self.equations.len() - 1];
        if last.grid().segments() < finer {
            let refined = last.refined();
            self.equations.push(refined);
        }
        true
    }

    /// Number of matrices factorised so far.
    pub fn factorizations(&self) -> usize {
        self.equations.iter().map(|it| it.factorizations).sum()
    }

    /// Follows a branch from its first point in the direction of its tangent. Where a
    /// point cannot be verified, the branch is continued from the last one that was: with a shorter
    /// step, or on a finer grid. `progress` is called after each point with the number of points
    /// and the parameter.
    pub fn follow(
        &mut self,
        first: Point,
        how: &Walk,
        accuracy: f64,
        progress: &mut dyn FnMut(usize, f64),
    ) -> Followed {
        let mut known = Followed {
            branch: Branch::new(first, how),
            end: End::MostPoints,
            points: Vec::new(),
            critical: Vec::new(),
            beyond: Vec::new(),
        };
        let (mut ahead, mut tries) = (MOST / 2, 0);
        loop {
            let now = &known.branch.points[known.branch.points.len() - 1];
            let (before, now) = (known.points.len(), now.state.clone());
            let equations = self.of(&now);
            (known.branch).extend_to(equations, how, before + ahead, progress);
            let leaves = &equations.leaves;
            let doubt = known.verify(leaves.family, &leaves.grid, (accuracy, how.critical_grids));
            if known.points.len() > before {
                tries = 0;
            }
            if leaves.family.limit.reached() && !(doubt.is_none() && known.branch.is_complete()) {
                let last = known.points.len().saturating_sub(1);
                known.branch.truncate_at(last);
                known.end = End::Stopped;
                return known;
            }
            match (doubt, &known.branch.end) {
                (None, None) => {
                    ahead = (2 * ahead).min(MOST);
                    continue;
                }
                (Some(_), _)
                | (None, Some(End::Stuck(Stuck::NotConverged | Stuck::Unresolved))) => {}
                (None, Some(end)) => {
                    known.end = end.clone();
                    return known;
                }
            }
            let end = known.branch.end.clone();
            ahead = FEWEST;
            tries += 1;
            let last = known.points.len().saturating_sub(1);
            known.branch.truncate_at(last);
            let here = known.branch.points[last].state.clone();
            let refined = self.refine(&here) && known.branch.refine(self.of(&here)).is_ok();
            known.branch.shorten(if refined { 1.0 } else { SHORTER });
            if !refined && (tries > TRIES || known.points.is_empty() || doubt.is_none()) {
                known.end = match (doubt, end) {
                    (None, Some(end)) => end,
                    (doubt, _) => End::Unverified(doubt.unwrap_or(Doubt::Unsolved)),
                };
                return known;
            }
        }
    }
}

impl Followed {
    /// Verifies the remaining points, all on one grid; stops at the first that
    /// fails, and returns why.
    fn verify(
        &mut self,
        family: &Family,
        grid: &Grid,
        (accuracy, grids): (f64, usize),
    ) -> Option<Doubt> {
        let mut singular = std::mem::take(&mut self.beyond);
        let critical = &self.branch.critical[self.critical.len() + singular.len()..];
        let points = &self.branch.points[self.points.len()..];
        // Points and critical points in one list, to keep all threads busy.
        let mut found: Vec<Result<Refined, Doubt>> = (0..points.len() + critical.len())
            .into_par_iter()
            .map(|k| match points.get(k) {
                Some(point) => refine(family, grid, point, accuracy),
                None => {
                    let critical = &critical[k - points.len()].1;
                    refine_critical(family, grid, critical, accuracy, grids)
                }
            })
            .collect();
        singular.append(&mut found.split_off(points.len()));
        self.forget_vertices(&mut singular);
        let mut critical = singular.into_iter();
        let mut dropped = 0;
        for point in found {
            let number = self.points.len();
            let near = number > 0 && self.branch.is_near_critical(number);
            let near = near && matches!(point, Err(Doubt::OtherIndex));
            if near && dropped < DROPPED {
                if number + 1 < self.branch.points.len() {
                    self.branch.drop_point(number);
                    dropped += 1;
                    continue;
                } else if self.branch.end.is_none() {
                    // Decided once there is a point after it.
                    self.beyond = critical.collect();
                    return None;
                }
            }
            dropped = 0;
            let known = self.critical.len();
            let count = number
                .checked_sub(1)
                .map_or(0, |before| self.critical_after(before));
            let singular: Result<Vec<Refined>, Doubt> = critical.by_ref().take(count).collect();
            if let Err(doubt) = self.add(point, singular) {
                self.points.truncate(number);
                self.critical.truncate(known);
                return Some(doubt);
            }
        }
        None
    }

    /// Moves vertices of pitchforks that are not verified from the last critical points, and from
    /// what is `found` of these, to those of which no crossing branch is known.
    fn forget_vertices(&mut self, found: &mut Vec<Result<Refined, Doubt>>) {
        let known = self.critical.len();
        for k in (0..found.len()).rev() {
            if found[k].is_err() && self.branch.critical[known + k].1.is_vertex() {
                let (after, _) = self.branch.critical.remove(known + k);
                self.branch.unmet.push(after);
                drop(found.remove(k));
            }
        }
    }

    /// Number of critical points between this point and the next.
    fn critical_after(&self, point: usize) -> usize {
        let critical = self.branch.critical.iter();
        critical.filter(|(after, _)| *after == point).count()
    }

    /// Adds a point with the critical points before it.
    fn add(
        &mut self,
        point: Result<Refined, Doubt>,
        critical: Result<Vec<Refined>, Doubt>,
    ) -> Result<(), Doubt> {
        let number = self.points.len();
        if number > 0 && self.branch.missed.contains(&(number - 1)) {
            return Err(Doubt::Unexplained);
        }
        let critical = critical?;
        // A point next to the range's end is on the other side of it, in truth.
        if !critical.iter().all(Refined::is_inside) {
            return Err(Doubt::OtherIndex);
        }
        self.critical.extend(critical);
        self.points.push(point?);
        match number == 0 || self.displaced_alike(number) {
            true => Ok(()),
            false => Err(Doubt::OtherBranch),
        }
    }

    /// Whether a point and its predecessor are displaced alike on the finest grids.
    fn displaced_alike(&self, number: usize) -> bool {
        let [before, now] = [number - 1, number].map(|k| {
            let (coarse, fine) = (&self.branch.points[k].state, &self.points[k].state);
            (coarse, displacements(coarse, fine))
        });
        let largest = |displacements: &[DVec3]| {
            crate::largest::largest(displacements.iter().map(|d| d.length()))
        };
        let differences = before.1.iter().zip(&now.1).map(|(a, b)| *b - *a);
        let differences: Vec<DVec3> = differences.collect();
        let distance = before.0.shift_to(now.0);
        largest(&differences)
            <= ALIKE * distance + ALIKE * largest(&before.1).max(largest(&now.1)) + SMALL
    }
}

/// Displacements of the nodes of a state to those of one on the same grid or a refinement.
fn displacements(coarse: &State, fine: &State) -> Vec<DVec3> {
    let stride = fine.segments() / coarse.segments();
    let node =
        |j: usize, i: usize| fine.x[fine.base(j) + stride * i] - coarse.x[coarse.base(j) + i];
    let rods = (0..coarse.rods()).flat_map(|j| (0..=coarse.segments()).map(move |i| (j, i)));
    rods.map(|(j, i)| node(j, i)).collect()
}
