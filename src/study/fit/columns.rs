//! Which columns of a file are which quantities, and how a file is thinned.

use std::num::NonZeroUsize;
use std::str::FromStr;

use super::FitError;
use super::quantity::Quantity;
use crate::study::Keys;

/// The column of the names of experiments.
pub(super) const NAME: &str = "experiment";

/// Columns of points on veins.
pub(super) const TRACED: [&str; 9] = [
    "rod", "x", "y", "z", "pixel_x", "pixel_y", "sigma", "sd", NAME,
];

/// Whether this is the name of a column that a fit uses.
pub(super) fn is_known(name: &str) -> bool {
    let quantity = name.strip_prefix("sd_").unwrap_or(name);
    TRACED.contains(&name) || quantity.parse::<Quantity>().is_ok() || name.parse::<Keys>().is_ok()
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

/// The two numbers in FACTOR, FACTOR+OFFSET and FACTOR-OFFSET.
fn factor_and_offset(text: &str) -> Option<(f64, f64)> {
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
    Some((finite(factor).filter(|factor| *factor != 0.0)?, offset?))
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
        let (quantity, [factor, offset]) = match rest.rsplit_once(':') {
            _ if is_known(rest) => (rest, [1.0, 0.0]),
            None => (rest, [1.0, 0.0]),
            Some((quantity, numbers)) => match factor_and_offset(numbers.trim()) {
                Some((factor, offset)) => (quantity.trim(), [factor, offset]),
                None => {
                    return refuse(
                        "behind : stands a factor, which is not 0, and an offset if there is one, such as 1e-3 or 1e-3+0.12",
                    );
                }
            },
        };
        if !is_known(quantity) {
            return refuse(&format!(
                "{quantity} is no quantity: {}",
                match quantity.parse::<Keys>() {
                    Err(refused) if quantity.contains('.') => refused.to_string(),
                    _ => format!(
                        "keys of the scenario, results ({}), their standard deviations (sd_tip_x), and {} are",
                        Quantity::ALL,
                        TRACED.join(", ")
                    ),
                }
            ));
        }
        if quantity == NAME && [factor, offset] != [1.0, 0.0] {
            return refuse("a name has no factor and no offset: leave them out");
        }
        Ok(MeasuredColumn {
            name: name.into(),
            quantity: quantity.into(),
            factor,
            offset,
        })
    }
}

/// How the number in a column compares with a given one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comparison {
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
const COMPARISONS: [(&str, Comparison); 5] = [
    ("<=", Comparison::AtMost),
    (">=", Comparison::AtLeast),
    ("<", Comparison::Less),
    (">", Comparison::Greater),
    ("=", Comparison::Equal),
];

/// A condition on the rows of a table: `COLUMN>VALUE`.
#[derive(Clone, Debug, PartialEq)]
pub struct RowCondition {
    /// The column by its name here: a key, a result, or another column of the data.
    pub column: String,
    /// How its number compares with the value.
    pub comparison: Comparison,
    /// The value, in the units of the scenario.
    pub value: f64,
}

impl RowCondition {
    /// Whether a row with this number is read.
    pub(super) fn admits(&self, number: f64) -> bool {
        match self.comparison {
            Comparison::Less => number < self.value,
            Comparison::AtMost => number <= self.value,
            Comparison::Greater => number > self.value,
            Comparison::AtLeast => number >= self.value,
            Comparison::Equal => number == self.value,
        }
    }
}

/// Conditions on rows, all of which are met: `COLUMN>VALUE`, joined by `and`.
#[derive(Clone, Debug, PartialEq)]
pub struct RowChoice {
    /// The conditions.
    pub conditions: Vec<RowCondition>,
}

impl FromStr for RowChoice {
    type Err = FitError;

    fn from_str(text: &str) -> Result<Self, FitError> {
        let refuse = |why: String| FitError::Data(format!("rows {text}: {why}"));
        let condition = |text: &str| {
            let found = COMPARISONS.iter().filter_map(|(sign, comparison)| {
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
            if !is_known(column) || column == NAME {
                return Err(refuse(format!(
                    "{column} is no column of numbers: keys of the scenario, results ({}) and columns of points \
                     on veins are",
                    Quantity::ALL
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
        Ok(RowChoice { conditions })
    }
}

/// How files of data are read.
#[derive(Clone, Debug)]
pub struct Reading {
    /// Columns that have other names in the files.
    pub columns: Vec<MeasuredColumn>,
    /// The first row is read, and then each that is so many further.
    pub every: NonZeroUsize,
    /// Conditions that rows meet, in tables with their columns.
    pub rows: Vec<RowChoice>,
}

impl Default for Reading {
    fn default() -> Self {
        Reading {
            columns: Vec::new(),
            every: NonZeroUsize::MIN,
            rows: Vec::new(),
        }
    }
}
