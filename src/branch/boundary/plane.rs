//! Leaves that differ in two parameters.

use std::sync::Arc;

use crate::branch::cache::LruCache;
use crate::branch::family::{Family, OutOfRange, between, discretised};
use crate::leaf::{DiscreteLeaf, Grid, Leaf};
use crate::scenario::Scenario;

/// Fractions within this of an end are at the end.
const EXACT: f64 = 1e-12;

/// Leaves that differ in two parameters: a family along the first for every value of the
/// second.
#[derive(Clone, Copy)]
pub struct Plane<'a> {
    /// Along the first parameter, at some value of the second: range and units.
    pub family: &'a Family<'a>,
    /// The scenario at values of both.
    pub make: &'a (dyn Fn([f64; 2]) -> Result<Scenario, String> + Sync),
    /// Values of the second parameter at the ends of its range.
    pub range: [f64; 2],
    /// Whether fractions are those of the logarithm of the value.
    pub log: bool,
}

impl Plane<'_> {
    /// Values of both parameters at fractions of their ranges.
    pub fn values(&self, params: [f64; 2]) -> [f64; 2] {
        let [from, to] = self.range;
        // At an end, rounding must not lead beyond: there may be no leaf.
        let [first, second] = params.map(|part| match part {
            part if part.abs() < EXACT => 0.0,
            part if (part - 1.0).abs() < EXACT => 1.0,
            part => part,
        });
        let second = match second {
            0.0 => from,
            1.0 => to,
            part => between(self.range, self.log, part),
        };
        [self.family.value(first), second]
    }

    /// The fraction of the second parameter's range at a value of it.
    pub fn fraction(&self, value: f64) -> f64 {
        let [from, to] = self.range;
        match self.log {
            true => (value / from).ln() / (to / from).ln(),
            false => (value - from) / (to - from),
        }
    }

    /// The scenario at fractions of both ranges.
    pub fn scenario(&self, params: [f64; 2]) -> Result<Scenario, OutOfRange> {
        (self.make)(self.values(params)).map_err(OutOfRange)
    }
}

/// Leaves of a plane on one grid, as [`crate::branch::family::Leaves`] of a family: the last few
/// are cached, and they may be softened.
pub struct PlaneLeaves<'a> {
    plane: Plane<'a>,
    grid: Grid,
    softening: Option<f64>,
    cache: LruCache<[f64; 2], DiscreteLeaf, CACHED>,
}

/// Number of cached leaves: those of differences over both parameters, and one more.
const CACHED: usize = 6;

impl<'a> PlaneLeaves<'a> {
    pub fn new(plane: Plane<'a>, grid: Grid, softening: Option<f64>) -> Self {
        PlaneLeaves {
            plane,
            grid,
            softening,
            cache: LruCache::default(),
        }
    }

    /// The leaf at fractions of both ranges.
    pub fn at(&mut self, params: [f64; 2]) -> Result<&DiscreteLeaf, OutOfRange> {
        self.cache.at(params, || {
            let scenario = Arc::new(self.plane.scenario(params)?);
            let leaf = Leaf::in_units(scenario, self.plane.family.scale());
            Ok(discretised(&leaf, &self.grid, self.softening))
        })
    }
}
