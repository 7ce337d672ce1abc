//! Vectors, and places along a rod, as values of keys.

use super::error::ScenarioResult;
use super::form::{Form, Range};
use super::item::{Item, ONE_PER_KNOT, ONE_PER_ROD};
use super::values::number;
use super::{Profile, Schedule};

const VECTOR_PROFILE_IS: &str = "a load along the rods is a list [x, y, z], one such list per rod, or \
     { at = [0.0, 1.0], value = [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]] }";
const LOAD_IN_TIME: &str =
    "a load in time is { at = [0.0, 1.0], value = [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]] }";
const VECTORS: &str = "a list of lists of three numbers [x, y, z]";

impl Item<'_> {
    /// Three numbers.
    pub(super) fn vector(&self) -> ScenarioResult<[f64; 3]> {
        let needed = "a list of three numbers [x, y, z]";
        let mut vector = [0.0; 3];
        let components = self.list_of(3, "one per axis x, y, z", needed)?;
        for (component, item) in vector.iter_mut().zip(components) {
            *component = item.number_in(Range::Finite)?;
        }
        Ok(vector)
    }

    /// A vector for each of `rods` rods: one for all, or a list.
    pub(super) fn vectors(&self, rods: usize) -> ScenarioResult<Vec<[f64; 3]>> {
        if self.value.is_array() && self.value.get(0).is_some_and(|first| first.is_array()) {
            let each = self.list_of(rods, ONE_PER_ROD, VECTORS)?;
            return each.map(|item| item.vector()).collect();
        }
        self.ensure(
            self.value.is_array(),
            format_args!(
                "must be a list of three numbers [x, y, z], or a list of {rods} of them (one per rod)"
            ),
        )?;
        Ok(vec![self.vector()?; rods])
    }

    /// A vector along each of `rods` rods, one profile for each component.
    pub(super) fn vector_profiles(&self, rods: usize) -> ScenarioResult<Vec<[Profile; 3]>> {
        if !self.value.is_table() {
            let each = self.vectors(rods)?.into_iter();
            return Ok(each.map(|of| of.map(Profile::Constant)).collect());
        }
        let [at, value] = self.pair("value", VECTOR_PROFILE_IS)?;
        let at = at.increasing(true)?;
        let profiles = |list: Item| -> ScenarioResult<[Profile; 3]> {
            let each = list.list_of(at.len(), ONE_PER_KNOT, VECTORS)?;
            let each: Vec<[f64; 3]> = each.map(|item| item.vector()).collect::<ScenarioResult<_>>()?;
            Ok([0, 1, 2].map(|axis| Profile::Linear {
                at: at.clone(),
                value: each.iter().map(|vector| vector[axis]).collect(),
            }))
        };
        let vector = value.value.get(0).and_then(|first| first.get(0));
        match vector.is_some_and(|component| component.is_array()) {
            true => {
                let each = value.list_of(rods, ONE_PER_ROD, VECTORS)?;
                each.map(profiles).collect()
            }
            false => Ok(vec![profiles(value)?; rods]),
        }
    }

    /// A load in time; of some keys, or one that is always the same.
    pub(super) fn vectors_in_time(&self) -> ScenarioResult<Schedule<[f64; 3]>> {
        if self.key().form() == Form::VectorOrInTime && self.value.is_array() {
            return Ok(Schedule::constant(self.vector()?));
        }
        let [at, value] = self.pair("value", LOAD_IN_TIME)?;
        let at = at.increasing(false)?;
        let value = value.list_of(at.len(), ONE_PER_KNOT, VECTORS)?;
        let value = value.map(|item| item.vector()).collect::<ScenarioResult<_>>()?;
        Ok(Schedule { at, value })
    }

    /// A fraction of the length behind the base.
    pub(super) fn fraction(&self) -> ScenarioResult<f64> {
        let at = self.number_in(Range::Finite)?;
        self.ensure(
            at > 0.0 && at <= 1.0,
            "must be greater than 0 (the base) and at most 1 (the tip): a fraction of the length",
        )?;
        Ok(at)
    }

    /// A stretch of a rod, `[from, to]`, or one point of it.
    pub(super) fn stretch(&self) -> ScenarioResult<[f64; 2]> {
        if number(self.value).is_some() {
            return Ok([self.fraction()?; 2]);
        }
        let needed = "a fraction of the length, or a list [from, to] of two";
        let mut ends = self.list_of(2, "where the stretch begins and ends", needed)?;
        let mut next = || ends.next().map_or(Ok(0.0), |item| item.fraction());
        let [from, to] = [next()?, next()?];
        self.ensure(from < to, "must rise from the base to the tip")?;
        Ok([from, to])
    }
}
