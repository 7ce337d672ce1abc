//! The free numbers of a fit.

use std::fmt;
use std::str::FromStr;

use super::FitError;
use super::data::Data;
use super::quantity::Quantity;
use crate::scenario::units::LENGTH;
use crate::study::{Base, Keys, Target, VaryError};

/// Longest step of a logarithm, or of another number in its unit.
pub(super) const LONGEST_STEP: f64 = 1.5;

/// Largest distance of a number without bounds from its initial value, in logarithms (a
/// factor of a thousand) or units: numbers that the data drive beyond this
/// are not determined by them.
const FARTHEST: f64 = 6.907_755_278_982_137;

/// A column of the data whose zero may be unknown.
#[derive(Clone, Debug, PartialEq)]
pub enum OffsetColumn {
    /// Of what was set in experiments.
    Setting(Keys),
    /// Of what was measured in experiments.
    Result(Quantity),
}

/// Numbers that a fit varies.
#[derive(Clone, Debug, PartialEq)]
pub enum FreeNumber {
    /// Numbers of the scenario that take the same value: `KEY`.
    Entry(Keys),
    /// What is added to the numbers in a column of the data, in the unit of that column:
    /// `offset:COLUMN`.
    Offset(OffsetColumn),
}

/// How the name of an offset begins.
const OFFSET: &str = "offset:";

impl FreeNumber {
    /// The keys of the scenario that it stands for, if it does.
    pub(super) fn keys(&self) -> Option<&Keys> {
        match self {
            FreeNumber::Entry(keys) => Some(keys),
            FreeNumber::Offset(_) => None,
        }
    }

    /// Whether it is the offset of a setting of experiments by these keys.
    pub(super) fn is_offset_of(&self, setting: &Keys) -> bool {
        matches!(self, FreeNumber::Offset(OffsetColumn::Setting(keys)) if keys == setting)
    }

    /// Whether they have a number in common.
    pub(super) fn overlaps(&self, other: &FreeNumber) -> bool {
        match (self, other) {
            (FreeNumber::Entry(one), FreeNumber::Entry(two)) => one.overlaps(two),
            _ => self == other,
        }
    }
}

impl FromStr for FreeNumber {
    type Err = FitError;

    fn from_str(text: &str) -> Result<Self, FitError> {
        let keys = |text: &str| text.parse::<Keys>();
        let Some(column) = text.trim().strip_prefix(OFFSET) else {
            let keys = keys(text).map_err(|refused| FitError::Free(refused.to_string()))?;
            return Ok(FreeNumber::Entry(keys));
        };
        let column = column.trim();
        if let Ok(quantity) = column.parse() {
            return Ok(FreeNumber::Offset(OffsetColumn::Result(quantity)));
        }
        let refuse = |refused: VaryError| {
            FitError::Free(format!(
                "{text}: offsets are those of columns of experiments, keys of the scenario and results ({}): {refused}",
                Quantity::ALL
            ))
        };
        let keys = keys(column).map_err(refuse)?;
        Ok(FreeNumber::Offset(OffsetColumn::Setting(keys)))
    }
}

impl fmt::Display for FreeNumber {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            FreeNumber::Entry(keys) => keys.fmt(f),
            FreeNumber::Offset(OffsetColumn::Setting(keys)) => write!(f, "{OFFSET}{keys}"),
            FreeNumber::Offset(OffsetColumn::Result(quantity)) => write!(f, "{OFFSET}{quantity}"),
        }
    }
}

/// Numbers that a fit varies together: `KEY` or `offset:COLUMN`, or with bounds `KEY=LOW..HIGH`.
#[derive(Clone, Debug, PartialEq)]
pub struct Free {
    /// What is free.
    pub number: FreeNumber,
    /// Bounds, if given.
    pub bounds: Option<[f64; 2]>,
}

impl FromStr for Free {
    type Err = FitError;

    fn from_str(text: &str) -> Result<Self, FitError> {
        let (number, bounds) = match text.split_once('=') {
            Some((number, bounds)) => (number, Some(bounds)),
            None => (text, None),
        };
        let number = number.parse()?;
        let Some(given) = bounds else {
            let bounds = None;
            return Ok(Free { number, bounds });
        };
        let numbers = given
            .split_once("..")
            .and_then(|(low, high)| Some([low.trim().parse().ok()?, high.trim().parse().ok()?]));
        match numbers {
            Some([low, high]) if low < high => Ok(Free {
                number,
                bounds: Some([low, high]),
            }),
            _ => {
                let why = "bounds are LOW..HIGH, two numbers, as in stiffness.axial=1..1e4";
                Err(FitError::Free(format!("{text}: {why}")))
            }
        }
    }
}

impl fmt::Display for Free {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}", self.number)?;
        match self.bounds {
            Some([low, high]) => write!(f, "={low}..{high}"),
            None => Ok(()),
        }
    }
}

/// A free number as a coordinate of the least squares: its logarithm, or the number in a
/// suitable unit.
#[derive(Clone, Debug)]
pub(super) struct Coordinate {
    pub number: FreeNumber,
    pub log: bool,
    pub unit: f64,
    /// Bounds of the coordinate, and whether they were given.
    pub bounds: [f64; 2],
    pub bounded: bool,
    pub start: f64,
}

impl Coordinate {
    pub fn new(base: &Base, data: &Data, free: &Free) -> Result<Coordinate, FitError> {
        let number = free.number.clone();
        let (value, log, unit) = match &number {
            FreeNumber::Entry(keys) => {
                let value = base.value(keys);
                let value = value.map_err(|refused| FitError::Free(refused.to_string()))?;
                match keys.is_positive() && value > 0.0 {
                    true => (value, true, 1.0),
                    false => (value, false, value.abs().max(keys.unit(base.scenario()))),
                }
            }
            FreeNumber::Offset(column) => (0.0, false, unit_of_offset(column, data)?),
        };
        let mut coordinate = Coordinate {
            number,
            log,
            unit,
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
            bounded: free.bounds.is_some(),
            start: 0.0,
        };
        if let Some([low, high]) = free.bounds {
            if !(low..=high).contains(&value) {
                let why = match &free.number {
                    FreeNumber::Entry(_) => {
                        format!("the scenario has {value}, which is not between the bounds")
                    }
                    FreeNumber::Offset(_) => {
                        "an offset begins at 0, which is not between the bounds".into()
                    }
                };
                return Err(FitError::Free(format!("{free}: {why}")));
            }
            if log && low <= 0.0 {
                let why = "the number is positive, and so must be its bounds";
                return Err(FitError::Free(format!("{free}: {why}")));
            }
            coordinate.bounds = [low, high].map(|bound| coordinate.of(bound));
        }
        coordinate.start = coordinate.of(value);
        if free.bounds.is_none() {
            let farthest = if log { FARTHEST } else { FARTHEST.exp() };
            coordinate.bounds = [-farthest, farthest].map(|far| coordinate.start + far);
        }
        Ok(coordinate)
    }

    /// Whether its order of magnitude may be unknown: that of stiffnesses and other positive numbers, but
    /// not of lengths, which are measured.
    pub fn is_searched_in_decades(&self) -> bool {
        let mut keys = self.number.keys().into_iter().flat_map(Keys::targets);
        let is_length = |target: &Target| target.key().is_some_and(|it| it.dimension() == LENGTH);
        self.log && !keys.any(is_length)
    }

    /// The same coordinate with another initial value. Bounds that were not given move with it.
    pub fn starting_at(&self, start: f64) -> Coordinate {
        let moved = start - self.start;
        let bounds = match self.bounded {
            true => self.bounds,
            false => self.bounds.map(|bound| bound + moved),
        };
        Coordinate {
            start,
            bounds,
            ..self.clone()
        }
    }

    pub fn of(&self, value: f64) -> f64 {
        match self.log {
            true => value.ln(),
            false => value / self.unit,
        }
    }

    pub fn value(&self, coordinate: f64) -> f64 {
        match self.log {
            true => coordinate.exp(),
            false => coordinate * self.unit,
        }
    }

    /// The bound at which the coordinate stands.
    pub fn at_bound(&self, coordinate: f64) -> Option<f64> {
        let [low, high] = self.bounds;
        [low, high].into_iter().find(|bound| *bound == coordinate)
    }

    /// So far on the way from the initial value to another, by orders of magnitude.
    pub fn on_the_way(&self, to: f64, part: f64) -> f64 {
        let way = to - self.start;
        let far = match self.log {
            true => part * way.abs(),
            false => (1.0 + way.abs()).powf(part) - 1.0,
        };
        self.start + far * way.signum()
    }

    /// d value/d coordinate.
    pub fn slope(&self, coordinate: f64) -> f64 {
        match self.log {
            true => coordinate.exp(),
            false => self.unit,
        }
    }
}

/// The range of the numbers in a column, or their size where there is one: how far its zero may be off.
fn unit_of_offset(column: &OffsetColumn, data: &Data) -> Result<f64, FitError> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for experiment in &data.experiments {
        let set = experiment.settings.iter().filter_map(|(keys, value)| {
            matches!(column, OffsetColumn::Setting(of) if of == keys).then_some(*value)
        });
        let measured = experiment.measured.iter().filter_map(|measured| {
            let is_it = matches!(column, OffsetColumn::Result(of) if *of == measured.quantity);
            measured.value.filter(|_| is_it)
        });
        for value in set.chain(measured) {
            (low, high) = (low.min(value), high.max(value));
        }
    }
    if low > high {
        let name = FreeNumber::Offset(column.clone());
        let why = "no file of experiments has that column";
        return Err(FitError::Free(format!("{name}: {why}")));
    }
    let range = high - low;
    let size = if range > 0.0 { range } else { high.abs() };
    Ok(if size > 0.0 { size } else { 1.0 })
}
