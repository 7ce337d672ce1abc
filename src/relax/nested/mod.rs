//! An equilibrium on nested grids: the leaf on each of them, their extrapolation with its bar, and
//! the Morse index.
//!
//! It is a value: on a finer grid another one takes its place. Whoever needs the leaf more
//! accurately, or surer of its index, asks [`grids`](crate::relax::grids) for that.

pub mod error;

use crate::largest::larger;
use crate::leaf::{Grid, Leaf, RodFields, whole_changes, whole_fields};
use crate::memory;
use crate::newton::{Contraction, Stop, Work};
use crate::relax::accuracy::defect::{Estimate, Linear};
use crate::relax::accuracy::nodal_fields::finer_nodes;
use crate::relax::accuracy::richardson::Richardson;
use crate::relax::path::Path;
use crate::relax::request::options::MAX_NODES;
use crate::relax::request::problem::Problem;
use crate::relax::saddle::Saddle;
use crate::relax::transfer::level::{Level, complete, positions};
use crate::relax::transfer::predict::weights;
use crate::relax::transfer::stencil::Stencil;
use glam::DVec3;

/// Segments of the finest grid.
pub const FINEST: usize = 16_384;

/// Changes of the energy below this part of it, or of the leaf's bending energy, are rounding.
const ENERGY_NOISE: f64 = 1e-11;

/// Largest number of grids over which the energy is extrapolated: errors on those before, which the
/// finest have no more, need not be small.
const ENERGY_GRIDS: usize = 4;

/// A leaf at rest on nested grids.
pub struct NestedEquilibrium {
    /// The leaf on each grid, from coarse to fine. Where it failed the last is that of the failure.
    pub levels: Vec<Level>,
    /// The positions on all grids.
    pub table: Richardson,
    /// Weight of each grid in the extrapolated values.
    pub weights: Vec<f64>,
    /// The error of the table's best column where the energy converges otherwise than its order
    /// indicates: then layers are thinner than the segments, and what they change in positions,
    /// which is the same on all grids that miss them, is not seen in these.
    unresolved: f64,
    /// The error estimated from the defect of the extrapolated values, if it is known, and the
    /// linear equations for it.
    pub estimate: Option<Estimate>,
    pub linear: Option<Linear>,
    /// Whether its error is within the tolerance; always on a fixed grid.
    pub keeps_tolerance: bool,
    /// Negative eigenvalues, as counted on the finest grid.
    pub index: Option<usize>,
    /// Whether the lowest eigenvalue is clearly positive.
    pub clearly_stable: bool,
    /// Factor on the error estimate of a leaf that is beside a bifurcation: see
    /// [`Lowest::softening`](crate::relax::stability::eigenvalues::Lowest::softening).
    pub softening: f64,
    /// Rods solved for.
    pub solved: usize,
    /// Whether a grid was added for the nodes of the finest one.
    pub added_for_nodes: bool,
    /// Whether the leaf moved far from its start, and to no equilibrium on two grids.
    pub unconfirmed: bool,
    /// How the leaf came to where it is, if that is known.
    pub path: Option<Path>,
    /// How it came to rest on its grids.
    pub history: History,
    /// The work for it.
    pub work: Work,
    /// The tolerance to which it is meant.
    tolerance: f64,
    /// Whether its grid is a requested one.
    fixed: bool,
}

/// How a leaf came to rest on its grids so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct History {
    /// The last saddle that it left.
    pub saddle: Option<Saddle>,
    /// Displacements that would follow from neglecting shear, and stretch.
    pub effects: [Option<f64>; 2],
    /// Largest remaining iteration error on any grid.
    pub remaining: f64,
    /// Convergence of Newton's method on the grids so far.
    pub contraction: Contraction,
    /// Number of pushes off saddles at which the iteration had converged (found by their Morse
    /// index).
    pub pushes: i32,
    /// Distance of the first equilibrium from the start (lengths, radians), and the steps that
    /// led there.
    pub from_start: Option<(f64, usize)>,
    /// Segments of the coarsest grid on which it rests, if there is one.
    pub coarsest: Option<usize>,
}

/// Where a leaf was when it failed to come to rest, and why.
pub struct Failure {
    pub at: NestedEquilibrium,
    pub stop: Stop,
}

/// An equilibrium, or where none was found.
pub type Found = Result<NestedEquilibrium, Box<Failure>>;

impl Failure {
    /// On this path.
    pub fn along(self, path: Option<Path>) -> Self {
        let at = self.at.along(path);
        Failure { at, ..self }
    }
}

/// What was found on this path, or, without one, on its own.
pub fn along(found: Found, path: Option<Path>) -> Found {
    match found {
        found if path.is_none() => found,
        Ok(found) => Ok(found.along(path)),
        Err(failure) => Err(Box::new(failure.along(path))),
    }
}

impl NestedEquilibrium {
    /// On no grid so far.
    pub fn begun(problem: &Problem) -> Self {
        NestedEquilibrium {
            levels: Vec::new(),
            table: Richardson::default(),
            weights: Vec::new(),
            unresolved: 0.0,
            estimate: None,
            linear: None,
            keeps_tolerance: true,
            index: None,
            clearly_stable: false,
            softening: 1.0,
            solved: problem.leaf.rods(),
            added_for_nodes: false,
            unconfirmed: false,
            path: None,
            history: History::default(),
            work: Work::default(),
            tolerance: problem.tolerance,
            fixed: problem.segments().is_some(),
        }
    }

    /// With the next finer grid.
    pub fn with(mut self, finest: Level) -> Self {
        self.levels.push(finest);
        self.tabulated()
    }

    /// On these grids in place of its own, without estimates so far.
    pub fn on(self, levels: Vec<Level>) -> Self {
        NestedEquilibrium { levels, ..self }.tabulated()
    }

    /// On all grids but the finest, and that one.
    pub fn split(mut self) -> (Self, Level) {
        let finest = self.levels.pop().expect("the leaf has settled");
        self.history.coarsest = (self.levels.first()).map(|level| level.leaf.segments());
        (self, finest)
    }

    /// With that finest grid again.
    pub fn joined(mut self, finest: Level) -> Self {
        self.levels.push(finest);
        self.history.coarsest = (self.levels.first()).map(|level| level.leaf.segments());
        self
    }

    /// With its negative eigenvalues counted.
    pub fn counted(self, clearly_stable: bool, index: Option<usize>) -> Self {
        NestedEquilibrium {
            clearly_stable,
            index,
            ..self
        }
    }

    /// Tabulates the positions on all grids, and discards earlier estimates.
    fn tabulated(mut self) -> Self {
        let segments: Vec<usize> = (self.levels.iter())
            .map(|level| level.leaf.segments())
            .collect();
        let on = |level: &Level| {
            let own = level.leaf.segments();
            (own, positions(level, own / segments[0]))
        };
        self.table = self.levels.iter().map(on).collect();
        let ordered = energies(&self.levels).ordered();
        self.unresolved = self.table.change_beyond(ordered);
        let first = segments.len().saturating_sub(1 + self.table.columns());
        self.weights = vec![0.0; first];
        self.weights
            .extend(weights(&segments[first..], f64::INFINITY));
        self.estimate = None;
        if self.levels.len() < 2 {
            self.linear = None;
        }
        self.history.coarsest = segments.first().copied();
        self
    }

    /// The same leaf on the same grids, without estimates and their equations.
    pub fn grids(&self) -> Self {
        NestedEquilibrium {
            levels: self.levels.clone(),
            table: self.table.clone(),
            weights: self.weights.clone(),
            estimate: None,
            linear: None,
            softening: 1.0,
            path: self.path.clone(),
            ..*self
        }
    }

    /// The same on the coarsest `count` grids alone; `None` unless each of them halves the
    /// segments of the one before.
    pub fn coarsest(&self, count: usize) -> Option<Self> {
        let levels = self.levels.get(..count)?;
        let halved = |pair: &[Level]| pair[1].leaf.segments() == 2 * pair[0].leaf.segments();
        let nested = levels.windows(2).all(halved);
        nested.then(|| self.grids().on(levels.to_vec()))
    }

    /// That of the whole leaf, where the problem was one of its half.
    pub fn completed(mut self, problem: &Problem) -> Self {
        let Some(whole) = problem.whole else {
            return self;
        };
        let reduced = problem.leaf;
        let complete = |level: &Level| complete(reduced, whole, level);
        let levels = self.levels.iter().map(complete).collect();
        let estimate = self.estimate.take().map(|half| completed(half, reduced));
        // The equations are those of the reduced leaf.
        self.linear = None;
        NestedEquilibrium {
            estimate,
            ..self.on(levels)
        }
    }

    /// With a bar that is larger by this factor.
    pub fn softened(self, softening: f64) -> Self {
        NestedEquilibrium { softening, ..self }
    }

    /// At the end of refinement, within the tolerance or not.
    pub fn ended(self, keeps_tolerance: bool) -> Self {
        NestedEquilibrium {
            keeps_tolerance,
            ..self
        }
    }

    /// On this path.
    pub fn along(self, path: Option<Path>) -> Self {
        NestedEquilibrium { path, ..self }
    }

    /// As a result: after this work, and without the equations of its estimate.
    pub fn after(self, work: Work) -> Self {
        NestedEquilibrium {
            work,
            linear: None,
            ..self
        }
    }

    /// A failure here.
    pub fn failed<T>(self, stop: Stop) -> Result<T, Box<Failure>> {
        Err(Box::new(Failure { at: self, stop }))
    }

    /// Whether no eigenvalue is negative.
    pub fn is_stable(&self) -> bool {
        self.index == Some(0)
    }

    /// The next finer grid, if the limits on its size allow it and rounding leaves something
    /// to gain.
    pub fn finer(&self) -> Option<Grid> {
        let leaf = &self.levels.last()?.leaf;
        let grid = leaf.grid.refined();
        let (rods, segments) = (leaf.rods(), grid.segments());
        let allowed = !self.fixed
            && segments <= FINEST
            && rods * segments <= MAX_NODES
            && memory::grid(rods, segments).is_ok()
            && !self.beyond_rounding(segments);
        allowed.then_some(grid)
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

    /// The levels from which the next one is predicted: those of the extrapolation, but at
    /// least the finest two where there are two.
    pub fn levels_for_prediction(&self) -> Vec<&Level> {
        let count = (self.table.columns() + 1).max(2).min(self.levels.len());
        self.levels[self.levels.len() - count..].iter().collect()
    }

    /// The extrapolated value of a quantity given by `on` on each grid.
    pub fn best(&self, on: impl Fn(usize, &Level) -> DVec3) -> DVec3 {
        let levels = self.levels.iter().zip(&self.weights).enumerate();
        let known = levels.filter(|(_, (_, weight))| **weight != 0.0);
        known
            .map(|(k, (level, weight))| *weight * on(k, level))
            .sum()
    }

    /// Interpolation stencils of each grid at the fraction `sigma`, of values and of their
    /// derivatives; extrapolation beyond the ends is linear.
    pub fn stencils(&self, sigma: f64) -> Vec<[Stencil; 2]> {
        let on = |level: &Level| Stencil::at(&level.leaf, sigma);
        self.levels.iter().map(on).collect()
    }

    /// The potential energy: integrated along the leaf, with an error of second order in the
    /// defect, or extrapolated as far as it converges as that assumes; and its error, which is
    /// unknown on a single grid.
    pub fn energy(&self) -> (f64, Option<f64>) {
        if let Some(estimate) = &self.estimate {
            return (estimate.energy, Some(self.energy_error(estimate)));
        }
        let finest = &self.levels[self.levels.len().saturating_sub(ENERGY_GRIDS)..];
        let (table, columns) = (energies(finest), self.table.columns());
        let Some(best) = table.error_of_few() else {
            return (table.column(columns)[0], None);
        };
        let energy = table.column(columns.min(best.columns))[0];
        let further = (energy - table.column(best.columns)[0]).abs();
        (energy, Some(best.error + further))
    }
}

/// The estimate of a whole leaf from that of its half.
fn completed(half: Estimate, reduced: &Leaf) -> Estimate {
    let both = if reduced.in_half() { 2.0 } else { 1.0 };
    Estimate {
        rods: whole_fields(reduced, half.rods),
        energy: half.energy * both,
        energy_error: half.energy_error * both,
        errors: whole_changes(reduced, half.errors),
        ..half
    }
}

/// The potential energies on all grids.
fn energies(levels: &[Level]) -> Richardson {
    let on = |level: &Level| (level.leaf.segments(), vec![level.leaf.energy(&level.state)]);
    let largest = (levels.iter()).map(|level| level.leaf.energy(&level.state).abs());
    let noise = ENERGY_NOISE * largest.fold(1.0, larger);
    levels
        .iter()
        .map(on)
        .collect::<Richardson>()
        .with_noise(noise)
}
