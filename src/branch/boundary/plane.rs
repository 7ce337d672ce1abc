//! Leaves that differ in two numbers.

use std::sync::Arc;

use crate::branch::family::{Family, OutOfRange};
use crate::branch::recent::Recent;
use crate::leaf::{DiscreteLeaf, Grid, Leaf};
use crate::scenario::Scenario;

/// Fractions of a range within this are the same.
const EXACT: f64 = 1e-12;

/// Leaves that differ in two numbers: a family along the first for every value of the
/// second.
#[derive(Clone, Copy)]
pub struct Plane<'a> {
    /// Along the first number, at some value of the second: range and units.
    pub family: &'a Family<'a>,
    /// The scenario at values of both.
    pub make: &'a (dyn Fn([f64; 2]) -> Result<Scenario, String> + Sync),
    /// The second number at the ends of its range.
    pub range: [f64; 2],
    /// Whether equal steps of its fraction are equal quotients of its value.
    pub log: bool,
}

impl Plane<'_> {
    /// Both numbers at fractions of their ranges.
    pub fn values(&self, place: [f64; 2]) -> [f64; 2] {
        let [from, to] = self.range;
        // At an end rounding must not lead beyond: there may be nothing.
        let [first, second] = place.map(|part| match part {
            part if part.abs() < EXACT => 0.0,
            part if (part - 1.0).abs() < EXACT => 1.0,
            part => part,
        });
        let second = match second {
            0.0 => from,
            1.0 => to,
            part if self.log => from * (to / from).powf(part),
            part => from + (to - from) * part,
        };
        [self.family.value(first), second]
    }

    /// The fraction of the second number's range at which it has a value.
    pub fn fraction(&self, value: f64) -> f64 {
        let [from, to] = self.range;
        match self.log {
            true => (value / from).ln() / (to / from).ln(),
            false => (value - from) / (to - from),
        }
    }

    /// The scenario at fractions of both ranges.
    pub fn scenario(&self, place: [f64; 2]) -> Result<Scenario, OutOfRange> {
        (self.make)(self.values(place)).map_err(OutOfRange)
    }
}

/// The last few leaves of a plane on a grid, as in [`crate::branch::family::Leaves`].
#[derive(Default)]
pub struct Kept(Recent<[f64; 2], DiscreteLeaf, KEPT>);

/// Of differences over both numbers, and one more.
const KEPT: usize = 6;

impl Kept {
    pub fn at(
        &mut self,
        plane: &Plane,
        family: &Family,
        grid: &Grid,
        place: [f64; 2],
    ) -> Result<&DiscreteLeaf, OutOfRange> {
        self.0.at(place, || {
            let scenario = Arc::new(plane.scenario(place)?);
            Ok(family.discretised(&Leaf::in_units(scenario, family.scale()), grid))
        })
    }
}
