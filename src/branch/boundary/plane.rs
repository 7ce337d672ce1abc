//! Leaves that differ in two parameters.

use std::sync::Arc;

use crate::branch::family::{Family, OutOfRange, Source, between};
use crate::leaf::Leaf;
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

impl Source for Plane<'_> {
    type At = [f64; 2];

    fn leaf_at(self, params: [f64; 2]) -> Result<Leaf, OutOfRange> {
        let scenario = Arc::new(self.scenario(params)?);
        Ok(Leaf::in_units(scenario, self.family.scale()))
    }
}
