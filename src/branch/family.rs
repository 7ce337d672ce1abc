//! Leaves that differ in one parameter.

use std::sync::Arc;

use glam::DVec3;

use super::lru_cache::LruCache;
use super::patterns::Patterns;
use crate::leaf::{DiscreteLeaf, Grid, Leaf, Scale, State};
use crate::scenario::Scenario;

/// Largest stiffness in stretch and shear, in units of A/L^2, with which the segment forces are
/// condensed out: near singular points a larger stiffness loses digits.
const STIFFEST: f64 = 1e5;

/// A leaf for every value of a parameter.
#[derive(Clone)]
pub struct Family<'a> {
    make: &'a (dyn Fn(f64) -> Result<Scenario, String> + Sync),
    /// Values of the parameter at the fractions 0 and 1.
    from: f64,
    to: f64,
    /// Whether fractions are those of the logarithm of the value.
    log: bool,
    /// The leaves at the fractions 0 and 1.
    ends: [Leaf; 2],
    softening: Option<f64>,
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
    pub fn new(
        make: &'a (dyn Fn(f64) -> Result<Scenario, String> + Sync),
        (from, to): (f64, f64),
        log: bool,
    ) -> Result<Self, OutOfRange> {
        let scale = make(from).map_err(OutOfRange)?.scale();
        Family::in_units(make, (from, to), log, scale)
    }

    /// The same in given units.
    fn in_units(
        make: &'a (dyn Fn(f64) -> Result<Scenario, String> + Sync),
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
            softening: None,
            patterns: Arc::default(),
        })
    }

    /// Leaves of the same kind, in the same units, along another path with the parameter 0 to 1.
    pub fn along_path<'b>(
        &self,
        make: &'b (dyn Fn(f64) -> Result<Scenario, String> + Sync),
    ) -> Result<Family<'b>, OutOfRange> {
        let family = Family::in_units(make, (0.0, 1.0), false, self.scale())?;
        Ok(Family {
            patterns: self.patterns.clone(),
            ..family
        })
    }

    /// The same family, its matrices those of leaves with this additional
    /// compliance in stretch and shear (in units of L^2/A), its equilibria
    /// unchanged. The soft modes of a nearly rigid leaf are lost to rounding in its matrix;
    /// the point at which they become neutral is analytic in the softening, and can be
    /// extrapolated to zero softening.
    pub fn softened(&self, softening: f64) -> Self {
        Family {
            softening: Some(softening),
            ..self.clone()
        }
    }

    /// The units of all its leaves.
    pub fn scale(&self) -> Scale {
        self.ends[0].scale
    }

    /// The leaf at the fraction 0.
    pub fn first(&self) -> &Leaf {
        &self.ends[0]
    }

    /// The parameter at a fraction of its range.
    pub fn value(&self, fraction: f64) -> f64 {
        match fraction {
            1.0 => self.to,
            _ if self.log => self.from * (self.to / self.from).powf(fraction),
            _ => self.from + (self.to - self.from) * fraction,
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

    /// A leaf of the family on a grid.
    pub(super) fn discretised(&self, leaf: &Leaf, grid: &Grid) -> DiscreteLeaf {
        let mut discrete = DiscreteLeaf::new(leaf, grid.clone());
        for section in &mut discrete.sections {
            section.condensing = match self.softening {
                Some(softening) => (section.compliance + DVec3::splat(softening)).recip(),
                None => section.condensing.min(DVec3::splat(STIFFEST)),
            };
        }
        discrete
    }

    /// Calls `act` with the leaf at a fraction, on a grid.
    pub fn with<R>(
        &self,
        fraction: f64,
        grid: &Grid,
        act: impl FnOnce(&DiscreteLeaf) -> R,
    ) -> Result<R, OutOfRange> {
        Ok(act(&self.discretised(&self.leaf(fraction)?, grid)))
    }
}

/// Leaves of a family on one grid. The last few are cached: iterations
/// return to them, and making a scenario costs more than assembling a small leaf.
pub struct Leaves<'a> {
    pub family: &'a Family<'a>,
    pub grid: Grid,
    cache: LruCache<f64, DiscreteLeaf, CACHED>,
}

/// Number of cached leaves: those of a difference over the parameter, and one more.
const CACHED: usize = 4;

impl<'a> Leaves<'a> {
    pub fn new(family: &'a Family<'a>, grid: Grid) -> Self {
        Leaves {
            family,
            grid,
            cache: LruCache::default(),
        }
    }

    /// The same on the grid with all segments halved.
    pub fn refined(&self) -> Self {
        let grid = self.grid.refined();
        let finer = |leaf: &DiscreteLeaf| self.family.discretised(&leaf.leaf, &grid);
        Leaves {
            cache: self.cache.map(finer),
            family: self.family,
            grid,
        }
    }

    /// The leaf at a fraction of the range.
    pub fn at(&mut self, fraction: f64) -> Result<&DiscreteLeaf, OutOfRange> {
        let (family, grid) = (self.family, &self.grid);
        self.cache.at(fraction, || {
            Ok(family.discretised(&family.leaf(fraction)?, grid))
        })
    }
}

/// Puts the bases of all rods where the leaf clamps them, and held tips where it holds them.
pub fn clamp(leaf: &DiscreteLeaf, state: &mut State) {
    leaf.hold_tips(state);
    for j in 0..leaf.rods() {
        let base = state.base(j);
        state.q[base] = leaf.leaf.base(j);
    }
}
