//! Following a branch on grids as fine as it needs, every point verified.

use glam::DVec3;
use rayon::prelude::*;

use super::Point;
use super::equations::{Equations, Stuck};
use super::family::{Family, OutOfRange};
use super::refine::refine;
use super::refine_critical::refine_critical;
use super::refined::{Doubt, Refined};
use super::walk::{Branch, End, Walk};
use crate::leaf::{Grid, State};

/// The finest grid to follow a branch on, in segments and in nodes.
const FINEST: usize = 512;
const MOST_NODES: usize = 20_000;

/// Points that are made before they are verified, side by side.
const FEWEST: usize = 2;
const MOST: usize = 16;

/// Tries to get past a point with shorter steps on the finest grid.
const TRIES: usize = 4;
const SHORTER: f64 = 0.4;

/// Points in a row that are left out next to a critical point, which on every grid
/// lies elsewhere: they may be before it on one and behind it on another.
const LEFT_OUT: usize = 4;

/// A point and the next one move by the same from the grid on which they were found to
/// the finest, but for this part of the way between them and of the larger move, and
/// for this distance; not by less, since they do so in planes that differ.
const ALIKE: f64 = 0.8;
const SMALL: f64 = 1e-6;

/// The equations of a family on a grid and on finer ones, each with half of the
/// segments of the one before.
pub struct Grids<'a> {
    equations: Vec<Equations<'a>>,
}

/// A branch with all of its points verified.
pub struct Followed {
    /// The branch as found on its grids.
    pub branch: Branch,
    /// How it ended.
    pub end: End,
    /// Its points without the error of their grids.
    pub points: Vec<Refined>,
    /// Its critical points, likewise.
    pub critical: Vec<Refined>,
}

impl<'a> Grids<'a> {
    /// Begins with one grid.
    pub fn new(family: &'a Family<'a>, grid: Grid) -> Result<Self, OutOfRange> {
        Ok(Grids {
            equations: vec![Equations::new(family, grid)?],
        })
    }

    /// The equations on the grid of a state, which must be one of these.
    pub fn of(&mut self, state: &State) -> &mut Equations<'a> {
        let level = (state.segments() / self.equations[0].grid().segments()).ilog2();
        &mut self.equations[level as usize]
    }

    /// Makes sure of the next finer grid; false where that is too fine.
    fn refine(&mut self, state: &State) -> Result<bool, OutOfRange> {
        let finer = 2 * state.segments();
        if finer > FINEST || finer * state.rods() > MOST_NODES {
            return Ok(false);
        }
        let last = &self.equations[self.equations.len() - 1];
        if last.grid().segments() < finer {
            let refined = last.refined()?;
            self.equations.push(refined);
        }
        Ok(true)
    }

    /// Matrices factorised so far.
    pub fn factorizations(&self) -> usize {
        self.equations.iter().map(|it| it.factorizations).sum()
    }

    /// Follows a branch from its first point in the direction of its tangent. Where a
    /// point is not verified, the branch goes on from the last one that is: with a shorter
    /// step, or on a finer grid. `progress` is told of each point: how many there are, and
    /// the parameter.
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
        };
        let (mut ahead, mut tries) = (MOST / 2, 0);
        loop {
            let now = &known.branch.points[known.branch.points.len() - 1];
            let (before, now) = (known.points.len(), now.state.clone());
            let equations = self.of(&now);
            (known.branch).go_on(equations, how, before + ahead, progress);
            let leaves = &equations.leaves;
            let doubt = known.verify(leaves.family, &leaves.grid, (accuracy, how.critical_grids));
            if known.points.len() > before {
                tries = 0;
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
            known.branch.go_back(last);
            let here = known.branch.points[last].state.clone();
            let refined = matches!(self.refine(&here), Ok(true))
                && known.branch.refine(self.of(&here)).is_ok();
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
    /// Verifies the points that are not yet, all on one grid; ends with the first that
    /// cannot be, and says why.
    fn verify(
        &mut self,
        family: &Family,
        grid: &Grid,
        (accuracy, grids): (f64, usize),
    ) -> Option<Doubt> {
        let critical = &self.branch.critical[self.critical.len()..];
        let points = &self.branch.points[self.points.len()..];
        // One list, so that all threads have work.
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
        let mut critical = found.split_off(points.len()).into_iter();
        let mut left_out = 0;
        for point in found {
            let number = self.points.len();
            let near = number > 0 && self.branch.is_near_critical(number);
            let near = near && matches!(point, Err(Doubt::OtherIndex));
            if near && left_out < LEFT_OUT {
                if number + 1 < self.branch.points.len() {
                    self.branch.leave_out(number);
                    left_out += 1;
                    continue;
                } else if self.branch.end.is_none() {
                    // Perhaps; as soon as there is a point behind it.
                    return None;
                }
            }
            left_out = 0;
            let known = self.critical.len();
            let count = number
                .checked_sub(1)
                .map_or(0, |before| self.critical_behind(before));
            let singular: Result<Vec<Refined>, Doubt> = critical.by_ref().take(count).collect();
            if let Err(doubt) = self.add(point, singular) {
                self.points.truncate(number);
                self.critical.truncate(known);
                return Some(doubt);
            }
        }
        None
    }

    /// Number of critical points between a point and the next.
    fn critical_behind(&self, point: usize) -> usize {
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
        self.critical.extend(critical?);
        self.points.push(point?);
        match number == 0 || self.alike(number) {
            true => Ok(()),
            false => Err(Doubt::OtherBranch),
        }
    }

    /// Whether a point and the one before it moved alike, to the finest grids.
    fn alike(&self, number: usize) -> bool {
        let [before, now] = [number - 1, number].map(|k| {
            let (coarse, fine) = (&self.branch.points[k].state, &self.points[k].state);
            (coarse, moves(coarse, fine))
        });
        let largest = |moves: &[DVec3]| moves.iter().fold(0.0, |m: f64, d| m.max(d.length()));
        let differences = before.1.iter().zip(&now.1).map(|(a, b)| *b - *a);
        let differences: Vec<DVec3> = differences.collect();
        let way = before.0.shift_to(now.0);
        largest(&differences)
            <= ALIKE * way + ALIKE * largest(&before.1).max(largest(&now.1)) + SMALL
    }
}

/// By how much the nodes of a state move to those of one on a grid as fine or finer.
fn moves(coarse: &State, fine: &State) -> Vec<DVec3> {
    let stride = fine.segments() / coarse.segments();
    let node =
        |j: usize, i: usize| fine.x[fine.base(j) + stride * i] - coarse.x[coarse.base(j) + i];
    let rods = (0..coarse.rods()).flat_map(|j| (0..=coarse.segments()).map(move |i| (j, i)));
    rods.map(|(j, i)| node(j, i)).collect()
}
