//! The free numbers of a fit: keys of the scenario and offsets of columns, with their bounds, and the
//! coordinates in which they are searched for.

use crate::scenario::units::LENGTH;
use crate::study::fit::columns::{FitError, MeasuredQuantity};
use crate::study::fit::data::Data;
use crate::study::{BaseScenario, ParameterKeys, VariableTarget, VaryError};
use std::fmt;
use std::str::FromStr;

/// Longest step of a logarithm, or of another number in its unit.
pub(in crate::study) const LONGEST_COORDINATE_STEP: f64 = 1.5;

/// Largest distance of a number without bounds from its initial value, in logarithms (a
/// factor of a thousand) or units: numbers that the data drive beyond this
/// are not determined by them.
pub(super) const LARGEST_DISTANCE_FROM_INITIAL: f64 = 6.907_755_278_982_137;

/// A column of the data whose zero may be unknown.
#[derive(Clone, Debug, PartialEq)]
pub enum OffsetColumn {
    /// A number that was set in experiments.
    Setting(ParameterKeys),
    /// A result that was measured in experiments.
    Result(MeasuredQuantity),
}

/// Numbers that a fit varies.
#[derive(Clone, Debug, PartialEq)]
pub enum FreeParameterTarget {
    /// Numbers of the scenario that take the same value: `KEY`.
    Entry(ParameterKeys),
    /// What is added to the numbers in a column of the data, in the unit of that column:
    /// `offset:COLUMN`.
    Offset(OffsetColumn),
}

impl FreeParameterTarget {
    /// The keys of the scenario that it stands for, if it does.
    pub(in crate::study) fn scenario_keys(&self) -> Option<&ParameterKeys> {
        match self {
            FreeParameterTarget::Entry(keys) => Some(keys),
            FreeParameterTarget::Offset(_) => None,
        }
    }

    /// Whether it is the offset of a setting of experiments by these keys.
    pub(in crate::study) fn is_offset_of(&self, setting: &ParameterKeys) -> bool {
        matches!(self, FreeParameterTarget::Offset(OffsetColumn::Setting(keys)) if keys == setting)
    }

    /// Whether they have a number in common.
    pub(in crate::study) fn overlaps(&self, other: &FreeParameterTarget) -> bool {
        match (self, other) {
            (FreeParameterTarget::Entry(one), FreeParameterTarget::Entry(two)) => one.overlaps(two),
            _ => self == other,
        }
    }
}

impl FromStr for FreeParameterTarget {
    type Err = FitError;

    fn from_str(text: &str) -> Result<Self, FitError> {
        let keys = |text: &str| text.parse::<ParameterKeys>();
        let Some(column) = text.trim().strip_prefix(OFFSET_PREFIX) else {
            let keys = keys(text).map_err(|refused| FitError::Free(refused.to_string()))?;
            return Ok(FreeParameterTarget::Entry(keys));
        };
        let column = column.trim();
        if let Ok(quantity) = column.parse() {
            return Ok(FreeParameterTarget::Offset(OffsetColumn::Result(quantity)));
        }
        let refuse = |refused: VaryError| {
            FitError::Free(format!(
                "{text}: offsets are those of columns of experiments, keys of the scenario and results ({}): {refused}",
                MeasuredQuantity::ALL
            ))
        };
        let keys = keys(column).map_err(refuse)?;
        Ok(FreeParameterTarget::Offset(OffsetColumn::Setting(keys)))
    }
}

impl fmt::Display for FreeParameterTarget {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            FreeParameterTarget::Entry(keys) => keys.fmt(f),
            FreeParameterTarget::Offset(OffsetColumn::Setting(keys)) => {
                write!(f, "{OFFSET_PREFIX}{keys}")
            }
            FreeParameterTarget::Offset(OffsetColumn::Result(quantity)) => {
                write!(f, "{OFFSET_PREFIX}{quantity}")
            }
        }
    }
}

/// How the name of an offset begins.
pub(super) const OFFSET_PREFIX: &str = "offset:";

/// Numbers that a fit varies together: `KEY` or `offset:COLUMN`, or with bounds `KEY=LOW..HIGH`.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeParameter {
    /// What is free.
    pub number: FreeParameterTarget,
    /// Bounds, if given.
    pub bounds: Option<[f64; 2]>,
}

impl FromStr for FreeParameter {
    type Err = FitError;

    fn from_str(text: &str) -> Result<Self, FitError> {
        let (number, bounds) = match text.split_once('=') {
            Some((number, bounds)) => (number, Some(bounds)),
            None => (text, None),
        };
        let number = number.parse()?;
        let Some(given) = bounds else {
            let bounds = None;
            return Ok(FreeParameter { number, bounds });
        };
        let numbers = given
            .split_once("..")
            .and_then(|(low, high)| Some([low.trim().parse().ok()?, high.trim().parse().ok()?]));
        match numbers {
            Some([low, high]) if low < high => Ok(FreeParameter {
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

impl fmt::Display for FreeParameter {
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
pub(in crate::study) struct FitCoordinate {
    pub number: FreeParameterTarget,
    pub is_logarithmic: bool,
    pub unit: f64,
    /// Bounds of the coordinate, and whether they were given.
    pub bounds: [f64; 2],
    pub has_given_bounds: bool,
    pub initial: f64,
}

impl FitCoordinate {
    pub fn new(
        base: &BaseScenario,
        data: &Data,
        free: &FreeParameter,
    ) -> Result<FitCoordinate, FitError> {
        let number = free.number.clone();
        let (value, log, unit) = match &number {
            FreeParameterTarget::Entry(keys) => {
                let value = base.differentiable_value(keys);
                let value = value.map_err(|refused| FitError::Free(refused.to_string()))?;
                match keys.is_positive() && value > 0.0 {
                    true => (value, true, 1.0),
                    false => (
                        value,
                        false,
                        value.abs().max(keys.reference_magnitude(base.scenario())),
                    ),
                }
            }
            FreeParameterTarget::Offset(column) => (0.0, false, offset_unit(column, data)?),
        };
        let mut coordinate = FitCoordinate {
            number,
            is_logarithmic: log,
            unit,
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
            has_given_bounds: free.bounds.is_some(),
            initial: 0.0,
        };
        if let Some([low, high]) = free.bounds {
            if !(low..=high).contains(&value) {
                let why = match &free.number {
                    FreeParameterTarget::Entry(_) => {
                        format!("the scenario has {value}, which is not between the bounds")
                    }
                    FreeParameterTarget::Offset(_) => {
                        "an offset begins at 0, which is not between the bounds".into()
                    }
                };
                return Err(FitError::Free(format!("{free}: {why}")));
            }
            if log && low <= 0.0 {
                let why = "the number is positive, and so must be its bounds";
                return Err(FitError::Free(format!("{free}: {why}")));
            }
            coordinate.bounds = [low, high].map(|bound| coordinate.transform(bound));
        }
        coordinate.initial = coordinate.transform(value);
        if free.bounds.is_none() {
            let farthest = if log {
                LARGEST_DISTANCE_FROM_INITIAL
            } else {
                LARGEST_DISTANCE_FROM_INITIAL.exp()
            };
            coordinate.bounds = [-farthest, farthest].map(|far| coordinate.initial + far);
        }
        Ok(coordinate)
    }

    /// Whether its order of magnitude may be unknown: that of stiffnesses and other positive numbers, but
    /// not of lengths, which are measured.
    pub fn is_searched_in_decades(&self) -> bool {
        let mut keys = self
            .number
            .scenario_keys()
            .into_iter()
            .flat_map(ParameterKeys::targets);
        let is_length =
            |target: &VariableTarget| target.key().is_some_and(|it| it.dimension() == LENGTH);
        self.is_logarithmic && !keys.any(is_length)
    }

    /// The same coordinate with another initial value. Bounds that were not given move with it.
    pub fn with_initial_value(&self, start: f64) -> FitCoordinate {
        let moved = start - self.initial;
        let bounds = match self.has_given_bounds {
            true => self.bounds,
            false => self.bounds.map(|bound| bound + moved),
        };
        FitCoordinate {
            initial: start,
            bounds,
            ..self.clone()
        }
    }

    pub fn transform(&self, value: f64) -> f64 {
        match self.is_logarithmic {
            true => value.ln(),
            false => value / self.unit,
        }
    }

    pub fn inverse_transform(&self, coordinate: f64) -> f64 {
        match self.is_logarithmic {
            true => coordinate.exp(),
            false => coordinate * self.unit,
        }
    }

    /// The bound at which the coordinate stands.
    pub fn active_bound(&self, coordinate: f64) -> Option<f64> {
        let [low, high] = self.bounds;
        [low, high].into_iter().find(|bound| *bound == coordinate)
    }

    /// So far on the way from the initial value to another, by orders of magnitude.
    pub fn interpolate_from_initial(&self, to: f64, part: f64) -> f64 {
        let way = to - self.initial;
        let far = match self.is_logarithmic {
            true => part * way.abs(),
            false => (1.0 + way.abs()).powf(part) - 1.0,
        };
        self.initial + far * way.signum()
    }

    /// d value/d coordinate.
    pub fn value_derivative(&self, coordinate: f64) -> f64 {
        match self.is_logarithmic {
            true => coordinate.exp(),
            false => self.unit,
        }
    }
}

/// The range of the numbers in a column, or their size where there is one: how far its zero may be off.
pub(super) fn offset_unit(column: &OffsetColumn, data: &Data) -> Result<f64, FitError> {
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
        let name = FreeParameterTarget::Offset(column.clone());
        let why = "no file of experiments has that column";
        return Err(FitError::Free(format!("{name}: {why}")));
    }
    let range = high - low;
    let size = if range > 0.0 { range } else { high.abs() };
    Ok(if size > 0.0 { size } else { 1.0 })
}
