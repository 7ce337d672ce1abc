//! What the columns of a file of data are: quantities that can be measured on a leaf, keys of the
//! scenario, coordinates of points on veins.
//!
//! Columns with other names are given theirs by [`MeasuredColumn`], with a factor and an offset for
//! other units; [`RowFilter`] chooses rows.

use crate::relax::RelaxError;
use crate::study::vary::AXIS_NAMES;
use crate::study::{ParameterKeys, VaryError};
use std::num::NonZeroUsize;
use std::str::FromStr;

/// A quantity that can be measured on a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeasuredQuantity {
    /// A coordinate of the shared tip, or of the only rod's: 0, 1, 2.
    Tip(usize),
    /// A component of the reaction at a held tip: 0, 1, 2.
    Reaction(usize),
    /// A component of the force on a grip, which is counted from 0: 0, 1, 2.
    Grip(usize, usize),
    /// The frequency of a mode in cycles per time; modes are numbered from 1.
    Frequency(usize),
}

impl MeasuredQuantity {
    /// The quantities as words that can be followed by a plural.
    pub(super) const ALL: &str = "tip_x, tip_y, tip_z, reaction_x, reaction_y, reaction_z, grip_1_x, ..., frequency_1, \
         frequency_2, ...";

    pub(super) fn dimension(self) -> DatumDimension {
        match self {
            MeasuredQuantity::Tip(_) => DatumDimension::Length,
            MeasuredQuantity::Reaction(_) | MeasuredQuantity::Grip(..) => DatumDimension::Force,
            MeasuredQuantity::Frequency(_) => DatumDimension::Frequency,
        }
    }
}

/// Kinds of data, which can only be weighted relative to each other by their deviations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DatumDimension {
    Length,
    /// Lengths in photographs.
    Pixel,
    Force,
    Frequency,
}

impl FromStr for MeasuredQuantity {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let axis = |axis: &str| AXIS_NAMES.iter().position(|name| *name == axis).ok_or(());
        match text.split_once('_') {
            Some(("tip", at)) => Ok(MeasuredQuantity::Tip(axis(at)?)),
            Some(("reaction", at)) => Ok(MeasuredQuantity::Reaction(axis(at)?)),
            Some(("grip", rest)) => {
                let (number, at) = rest.split_once('_').ok_or(())?;
                let number: usize = number.parse().map_err(|_| ())?;
                Ok(MeasuredQuantity::Grip(
                    number.checked_sub(1).ok_or(())?,
                    axis(at)?,
                ))
            }
            Some(("frequency", mode)) => match mode.parse() {
                Ok(mode @ 1..=crate::relax::MOST_MODES) => Ok(MeasuredQuantity::Frequency(mode)),
                _ => Err(()),
            },
            _ => Err(()),
        }
    }
}

impl std::fmt::Display for MeasuredQuantity {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            MeasuredQuantity::Tip(axis) => write!(f, "tip_{}", AXIS_NAMES[*axis]),
            MeasuredQuantity::Reaction(axis) => write!(f, "reaction_{}", AXIS_NAMES[*axis]),
            MeasuredQuantity::Grip(grip, axis) => {
                write!(f, "grip_{}_{}", grip + 1, AXIS_NAMES[*axis])
            }
            MeasuredQuantity::Frequency(mode) => write!(f, "frequency_{mode}"),
        }
    }
}

/// The coordinates that a point may have, by the names of their columns.
pub(super) const COORDINATE_COLUMNS: [&str; 5] = ["x", "y", "z", "pixel_x", "pixel_y"];

/// The first of those in a photograph.
pub(super) const FIRST_PHOTO_COORDINATE: usize = 3;

/// The coordinates of a traced point, as far as they were seen.
pub(super) type ObservedCoordinates = [Option<f64>; COORDINATE_COLUMNS.len()];

/// The column of the names of experiments.
pub(in crate::study) const EXPERIMENT_NAME_COLUMN: &str = "experiment";

pub(super) const TRACED_POINT_COLUMNS: [&str; 9] = [
    "rod",
    "x",
    "y",
    "z",
    "pixel_x",
    "pixel_y",
    "sigma",
    "sd",
    EXPERIMENT_NAME_COLUMN,
];

/// Components of a blade's normal, d3, at points of a posture.
pub(in crate::study) const NORMAL_COLUMNS: [&str; 3] = ["normal_x", "normal_y", "normal_z"];

/// Whether this is the name of a column that a fit uses.
pub(super) fn is_known_column(name: &str) -> bool {
    let quantity = name.strip_prefix("sd_").unwrap_or(name);
    TRACED_POINT_COLUMNS.contains(&name)
        || quantity.parse::<MeasuredQuantity>().is_ok()
        || name.parse::<ParameterKeys>().is_ok()
}

/// A column of a file by the name that it has there, and what it is here:
/// `NAME=QUANTITY[:FACTOR][+OFFSET]`. The quantity is the factor times the number in the file,
/// plus the offset.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredColumn {
    /// Its name in the file.
    pub name: String,
    /// Its name here: a key of the scenario, a result, or another column of the data.
    pub quantity: String,
    /// Factor, such as of a unit.
    pub factor: f64,
    /// Offset, in the unit of the scenario.
    pub offset: f64,
}

/// The conversion of numbers in a column: factor times number plus offset.
#[derive(Clone, Copy, PartialEq)]
struct ColumnConversion {
    factor: f64,
    offset: f64,
}

impl ColumnConversion {
    const NONE: ColumnConversion = ColumnConversion {
        factor: 1.0,
        offset: 0.0,
    };
}

/// Parses FACTOR, FACTOR+OFFSET and FACTOR-OFFSET.
fn parse_column_conversion(text: &str) -> Option<ColumnConversion> {
    let finite = |text: &str| text.parse().ok().filter(|number: &f64| number.is_finite());
    let sign = text.char_indices().skip(1).find(|(at, character)| {
        matches!(character, '+' | '-') && !text[..*at].ends_with(['e', 'E'])
    });
    let (factor, offset) = text.split_at(sign.map_or(text.len(), |(at, _)| at));
    let offset = if offset.is_empty() {
        Some(0.0)
    } else {
        finite(offset)
    };
    Some(ColumnConversion {
        factor: finite(factor).filter(|factor| *factor != 0.0)?,
        offset: offset?,
    })
}

impl FromStr for MeasuredColumn {
    type Err = FitError;

    fn from_str(text: &str) -> Result<Self, FitError> {
        let refuse = |why: &str| Err(FitError::Data(format!("column {text}: {why}")));
        // The name may have the characters = and :, and the quantity has none behind its key.
        let Some((name, rest)) = text.rsplit_once('=') else {
            return refuse(
                "write NAME=QUANTITY, the name in the file and what it is, such as Force=load.tip_force[0]",
            );
        };
        let (name, rest) = (name.trim(), rest.trim());
        if name.is_empty() {
            return refuse("write the name that it has in the file before =");
        }
        let (quantity, conversion) = match rest.rsplit_once(':') {
            _ if is_known_column(rest) => (rest, ColumnConversion::NONE),
            None => (rest, ColumnConversion::NONE),
            Some((quantity, numbers)) => match parse_column_conversion(numbers.trim()) {
                Some(conversion) => (quantity.trim(), conversion),
                None => {
                    return refuse(
                        "behind : stands a factor, which is not 0, and an offset if there is one, such as 1e-3 or 1e-3+0.12",
                    );
                }
            },
        };
        if !is_known_column(quantity) && !NORMAL_COLUMNS.contains(&quantity) {
            return refuse(&format!(
                "{quantity} is no quantity: {}",
                match quantity.parse::<ParameterKeys>() {
                    Err(refused) if quantity.contains('.') => refused.to_string(),
                    _ => format!(
                        "keys of the scenario, results ({}), their standard deviations (sd_tip_x), and {} are",
                        MeasuredQuantity::ALL,
                        TRACED_POINT_COLUMNS.join(", ")
                    ),
                }
            ));
        }
        if quantity == EXPERIMENT_NAME_COLUMN && conversion != ColumnConversion::NONE {
            return refuse("a name has no factor and no offset: leave them out");
        }
        Ok(MeasuredColumn {
            name: name.into(),
            quantity: quantity.into(),
            factor: conversion.factor,
            offset: conversion.offset,
        })
    }
}

/// How the number in a column compares with a given one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ComparisonOperator {
    /// `<`
    Less,
    /// `<=`
    AtMost,
    /// `>`
    Greater,
    /// `>=`
    AtLeast,
    /// `=`
    Equal,
}

/// Longer signs come before those that they begin with.
const COMPARISON_SIGNS: [(&str, ComparisonOperator); 5] = [
    ("<=", ComparisonOperator::AtMost),
    (">=", ComparisonOperator::AtLeast),
    ("<", ComparisonOperator::Less),
    (">", ComparisonOperator::Greater),
    ("=", ComparisonOperator::Equal),
];

/// A condition on the rows of a table: `COLUMN>VALUE`.
#[derive(Clone, Debug, PartialEq)]
pub struct RowCondition {
    /// The column by its name here: a key, a result, or another column of the data.
    pub column: String,
    /// How its number compares with the value.
    pub comparison: ComparisonOperator,
    /// The value, in the units of the scenario.
    pub value: f64,
}

impl RowCondition {
    /// Whether a row with this number is read.
    pub(super) fn is_met_by(&self, number: f64) -> bool {
        match self.comparison {
            ComparisonOperator::Less => number < self.value,
            ComparisonOperator::AtMost => number <= self.value,
            ComparisonOperator::Greater => number > self.value,
            ComparisonOperator::AtLeast => number >= self.value,
            ComparisonOperator::Equal => number == self.value,
        }
    }
}

/// Conditions on rows, all of which are met: `COLUMN>VALUE`, joined by `and`.
#[derive(Clone, Debug, PartialEq)]
pub struct RowFilter {
    /// The conditions.
    pub conditions: Vec<RowCondition>,
}

impl FromStr for RowFilter {
    type Err = FitError;

    fn from_str(text: &str) -> Result<Self, FitError> {
        let refuse = |why: String| FitError::Data(format!("rows {text}: {why}"));
        let condition = |text: &str| {
            let found = COMPARISON_SIGNS.iter().filter_map(|(sign, comparison)| {
                let at = text.find(sign)?;
                Some((at, *sign, *comparison))
            });
            // The first sign; of two at one place the longer one, which comes first.
            let (at, sign, comparison) = found.min_by_key(|(at, ..)| *at).ok_or_else(|| {
                refuse("write COLUMN>VALUE, or <, >=, <=, =, as in load.tip_force[0]>0.5".into())
            })?;
            let column = text[..at].trim();
            let value = text[at + sign.len()..].trim();
            let number = value.parse().ok().filter(|number: &f64| number.is_finite());
            let value = number.ok_or_else(|| refuse(format!("{value} is not a finite number")))?;
            if !is_known_column(column) || column == EXPERIMENT_NAME_COLUMN {
                return Err(refuse(format!(
                    "{column} is no column of numbers: keys of the scenario, results ({}) and columns of points \
                     on veins are",
                    MeasuredQuantity::ALL
                )));
            }
            Ok(RowCondition {
                column: column.into(),
                comparison,
                value,
            })
        };
        let conditions = text.split(" and ").map(condition);
        let conditions = conditions.collect::<Result<_, _>>()?;
        Ok(RowFilter { conditions })
    }
}

/// How files of data are read.
#[derive(Clone, Debug)]
pub struct DataFileOptions {
    /// Columns that have other names in the files.
    pub columns: Vec<MeasuredColumn>,
    /// The first row is read, and then each that is so many further.
    pub every: NonZeroUsize,
    /// Conditions that rows meet, in tables with their columns.
    pub rows: Vec<RowFilter>,
}

impl Default for DataFileOptions {
    fn default() -> Self {
        DataFileOptions {
            columns: Vec::new(),
            every: NonZeroUsize::MIN,
            rows: Vec::new(),
        }
    }
}

/// Why nothing can be fitted.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// Data that cannot be used.
    #[error("{0}")]
    Data(String),
    /// A number that cannot be free.
    #[error("{0}")]
    Free(String),
    /// An experiment whose leaf does not come to rest.
    #[error("{0}")]
    NoEquilibrium(String),
    /// A scenario that is invalid.
    #[error(transparent)]
    Vary(#[from] VaryError),
    /// A relaxation that cannot be run.
    #[error(transparent)]
    Relax(#[from] RelaxError),
}
