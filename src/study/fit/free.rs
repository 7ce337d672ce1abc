//! The free numbers of a fit.

use std::fmt;
use std::str::FromStr;

use super::FitError;
use crate::study::{Base, Keys};

/// Longest step of a logarithm, or of another number in its unit.
pub(super) const LONGEST_STEP: f64 = 1.5;

/// Largest distance of a number without bounds from its initial value, in logarithms (a
/// factor of a thousand) or units: numbers that the data drive beyond this
/// are not determined by them.
const FARTHEST: f64 = 6.907_755_278_982_137;

/// Numbers that a fit varies together: `KEY`, or `KEY=LOW..HIGH`.
#[derive(Clone, Debug, PartialEq)]
pub struct Free {
    /// The key, as in `--vary`.
    pub keys: Keys,
    /// Bounds, if given.
    pub bounds: Option<[f64; 2]>,
}

impl FromStr for Free {
    type Err = FitError;

    fn from_str(text: &str) -> Result<Self, FitError> {
        let (keys, bounds) = match text.split_once('=') {
            Some((keys, bounds)) => (keys, Some(bounds)),
            None => (text, None),
        };
        let keys = keys
            .parse::<Keys>()
            .map_err(|e| FitError::Free(e.to_string()))?;
        let Some(given) = bounds else {
            let bounds = None;
            return Ok(Free { keys, bounds });
        };
        let numbers = given
            .split_once("..")
            .and_then(|(low, high)| Some([low.trim().parse().ok()?, high.trim().parse().ok()?]));
        match numbers {
            Some([low, high]) if low < high => Ok(Free {
                keys,
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
        write!(f, "{}", self.keys)?;
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
    pub keys: Keys,
    pub log: bool,
    pub unit: f64,
    /// Bounds of the coordinate, and whether they were given.
    pub bounds: [f64; 2],
    pub bounded: bool,
    pub start: f64,
}

impl Coordinate {
    pub fn new(base: &Base, free: &Free) -> Result<Coordinate, FitError> {
        let keys = free.keys.clone();
        let value = base.value(&keys);
        let value = value.map_err(|refused| FitError::Free(refused.to_string()))?;
        let log = keys.is_positive() && value > 0.0;
        let unit = match log {
            true => 1.0,
            false => value.abs().max(keys.unit(base.scenario())),
        };
        let mut coordinate = Coordinate {
            keys,
            log,
            unit,
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
            bounded: free.bounds.is_some(),
            start: 0.0,
        };
        if let Some([low, high]) = free.bounds {
            if !(low..=high).contains(&value) {
                let why = format!("the scenario has {value}, which is not between the bounds");
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
