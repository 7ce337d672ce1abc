//! Leaves that differ in one parameter.

use std::sync::Arc;

use glam::DVec3;

use super::cache::{LruCache, Patterns};
use crate::leaf::{DiscreteLeaf, Grid, Leaf, Scale, State};
use crate::scenario::Scenario;

/// Largest stiffness in stretch and shear, in units of A/L^2, with which the segment forces are
/// condensed out: near singular points a larger stiffness loses digits.
const STIFFEST: f64 = 1e5;

/// The value at a fraction of a range, or of that of its logarithm.
pub fn between([from, to]: [f64; 2], log: bool, fraction: f64) -> f64 {
    match log {
        true => from * (to / from).powf(fraction),
        false => from + (to - from) * fraction,
    }
}

/// Makes the scenario at a value of a parameter.
type Make<'a> = &'a (dyn Fn(f64) -> Result<Scenario, String> + Sync);

/// A leaf for every value of a parameter.
#[derive(Clone)]
pub struct Family<'a> {
    make: Make<'a>,
    /// Values of the parameter at the fractions 0 and 1.
    from: f64,
    to: f64,
    /// Whether fractions are those of the logarithm of the value.
    log: bool,
    /// The leaves at the fractions 0 and 1.
    ends: [Leaf; 2],
    /// Sparsity patterns of their matrices.
    pub patterns: Arc<Patterns>,
}

/// A value of the parameter that no leaf can have, with the message of the scenario.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{0}")]
pub struct OutOfRange(pub String);

impl<'a> Family<'a> {
    /// The leaves given by `make`, for values of the parameter in this range (divided
    /// logarithmically if `log`), in the units of the first.
    pub fn new(make: Make<'a>, (from, to): (f64, f64), log: bool) -> Result<Self, OutOfRange> {
        let scale = make(from).map_err(OutOfRange)?.scale();
        Family::in_units(make, (from, to), log, scale)
    }

    fn in_units(
        make: Make<'a>,
        (from, to): (f64, f64),
        log: bool,
        scale: Scale,
    ) -> Result<Self, OutOfRange> {
        let leaf = |value: f64| {
            let scenario = make(value).map_err(OutOfRange)?;
            Ok(Leaf::in_units(Arc::new(scenario), scale))
        };
        let [first, last] = [leaf(from)?, leaf(to)?];
        Ok(Family {
            make,
            from,
            to,
            log,
            ends: [first, last],
            patterns: Arc::default(),
        })
    }

    /// Leaves of the same kind, in the same units, along another path with the parameter 0 to 1.
    pub fn along_path<'b>(&self, make: Make<'b>) -> Result<Family<'b>, OutOfRange> {
        let family = Family::in_units(make, (0.0, 1.0), false, self.scale())?;
        Ok(Family {
            patterns: self.patterns.clone(),
            ..family
        })
    }

    /// The units of all its leaves.
    pub fn scale(&self) -> Scale {
        self.ends[0].scale
    }

    /// Tips of all rods in the scenario's units: the shared one alone, or each.
    pub fn tips(&self, tips: &[DVec3]) -> Vec<DVec3> {
        let count = if self.first().joined() { 1 } else { tips.len() };
        let tips = tips.iter().take(count);
        tips.map(|tip| *tip * self.scale().length).collect()
    }

    /// Centerlines of a state in the scenario's units, one per rod.
    pub fn curves(&self, state: &State) -> Vec<Vec<DVec3>> {
        let length = self.scale().length;
        let rods = state.x.chunks(state.segments() + 1);
        rods.map(|rod| rod.iter().map(|x| *x * length).collect())
            .collect()
    }

    /// The leaf at the fraction 0.
    pub fn first(&self) -> &Leaf {
        &self.ends[0]
    }

    /// The parameter at a fraction of its range.
    pub fn value(&self, fraction: f64) -> f64 {
        match fraction {
            1.0 => self.to,
            _ => between([self.from, self.to], self.log, fraction),
        }
    }

    /// The scenario at a fraction.
    pub fn scenario(&self, fraction: f64) -> Result<Scenario, OutOfRange> {
        (self.make)(self.value(fraction)).map_err(OutOfRange)
    }

    /// The leaf at a fraction.
    pub fn leaf(&self, fraction: f64) -> Result<Leaf, OutOfRange> {
        Ok(match fraction {
            0.0 => self.ends[0].clone(),
            1.0 => self.ends[1].clone(),
            _ => Leaf::in_units(Arc::new(self.scenario(fraction)?), self.scale()),
        })
    }

    /// Calls `act` with the leaf at a fraction, on a grid.
    pub fn with<R>(
        &self,
        fraction: f64,
        grid: &Grid,
        act: impl FnOnce(&DiscreteLeaf) -> R,
    ) -> Result<R, OutOfRange> {
        Ok(act(&discretised(&self.leaf(fraction)?, grid, None)))
    }
}

/// A leaf on a grid, if requested softened: see [`Leaves::softened`].
fn discretised(leaf: &Leaf, grid: &Grid, softening: Option<f64>) -> DiscreteLeaf {
    let mut discrete = DiscreteLeaf::new(leaf, grid.clone());
    for section in &mut discrete.sections {
        section.condensing = match softening {
            Some(softening) => (section.compliance + DVec3::splat(softening)).recip(),
            None => section.condensing.min(DVec3::splat(STIFFEST)),
        };
    }
    discrete
}

/// Leaves that differ in parameters, which are given as fractions of their ranges.
pub trait Source: Copy {
    type At: Copy + PartialEq;

    fn leaf_at(self, at: Self::At) -> Result<Leaf, OutOfRange>;
}

impl Source for &Family<'_> {
    type At = f64;

    fn leaf_at(self, fraction: f64) -> Result<Leaf, OutOfRange> {
        self.leaf(fraction)
    }
}

/// Leaves of a family, or of a plane, on one grid. The last few are cached: iterations
/// return to them, and making a scenario costs more than assembling a small leaf.
pub struct Leaves<F: Source> {
    pub family: F,
    pub grid: Grid,
    softening: Option<f64>,
    cache: LruCache<F::At, DiscreteLeaf, CACHED>,
}

/// Number of cached leaves: those of differences over two parameters, and one more.
const CACHED: usize = 6;

impl<F: Source> Leaves<F> {
    pub fn new(family: F, grid: Grid) -> Self {
        Leaves {
            family,
            grid,
            softening: None,
            cache: LruCache::default(),
        }
    }

    /// The same, the matrices being those of leaves with this additional
    /// compliance in stretch and shear (in units of L^2/A), equilibria
    /// unchanged. The soft modes of a nearly rigid leaf are lost to rounding in its matrix;
    /// the point at which they become neutral is analytic in the softening, and can be
    /// extrapolated to zero softening.
    pub fn softened(family: F, grid: Grid, softening: f64) -> Self {
        Leaves {
            softening: Some(softening),
            ..Leaves::new(family, grid)
        }
    }

    /// The same on the grid with all segments halved.
    pub fn refined(&self) -> Self {
        let (grid, softening) = (self.grid.refined(), self.softening);
        let finer = |leaf: &DiscreteLeaf| discretised(&leaf.leaf, &grid, softening);
        Leaves {
            cache: self.cache.map(finer),
            family: self.family,
            grid,
            softening,
        }
    }

    /// The leaf at these parameters.
    pub fn at(&mut self, at: F::At) -> Result<&DiscreteLeaf, OutOfRange> {
        let (family, grid, softening) = (self.family, &self.grid, self.softening);
        let make = || Ok(discretised(&family.leaf_at(at)?, grid, softening));
        self.cache.at(at, make)
    }
}

/// Puts the bases of all rods where the leaf clamps them, and held tips where it holds them.
pub fn clamp(leaf: &DiscreteLeaf, state: &mut State) {
    leaf.leaf.hold_tips(state);
    for j in 0..leaf.rods() {
        let base = state.base(j);
        state.q[base] = leaf.leaf.base(j);
    }
}
