//! From the scenario as written to a scenario that can be trusted: the type
//! and the meaning of every value. Limits that several values set together
//! are in `limits`, and what concerns motion is in `dynamics`.

use std::f64::consts::PI;

use toml::de::DeValue;

use super::error::{Because, Needed, Problem, ScenarioError, Spot};
use super::key::Key;
use super::raw::{Item, Raw};
use super::{Profile, Rod, Scenario, Units, dynamics, limits, quantity};

type Result<T> = std::result::Result<T, ScenarioError>;

/// Lengths and stiffnesses lie between these: fourth powers of lengths and
/// quotients of stiffnesses must not overflow.
pub(super) const MAGNITUDES: (f64, f64) = (1e-50, 1e50);
/// Most rods: a leaf of 100,000 rods and eight segments already has five
/// million unknowns.
const MOST_RODS: usize = 100_000;
/// Longest name: a folder of it, and files in that, must be allowed everywhere.
const LONGEST_NAME: usize = 100;
/// Longest name of a unit: it stands beside axes.
const LONGEST_UNIT: usize = 20;
const TOLERANCE_DEFAULT: f64 = 1e-6;
/// What is left of double precision after a solve on a fine grid.
const TOLERANCE_LEAST: f64 = 1e-12;
/// A tenth of the length is no longer an accuracy.
const TOLERANCE_MOST: f64 = 0.1;

/// Which numbers a key allows; never NaN.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Range {
    Finite,
    NotNegative,
    Positive,
    PositiveOrInfinite,
}

pub(super) fn check(raw: &Raw) -> Result<Scenario> {
    let name = name(raw.required(Key::Name)?)?;
    let units = Units {
        length: raw.optional(Key::UnitLength).map(unit).transpose()?,
        force: raw.optional(Key::UnitForce).map(unit).transpose()?,
    };
    let rods = rods(raw.required(Key::Rods)?)?;
    let rods = veins(raw, rods)?;
    let joined = raw.optional(Key::Joined).map_or(Ok(true), truth)?;
    let coupling = coupling(raw, rods.len() - 1)?;
    let gravity = vector(raw, Key::Gravity)?;
    let tip_force = vector(raw, Key::TipForce)?;
    let tip_moment = tip_moment(raw, rods.len())?;
    let tolerance = tolerance(raw)?;
    let dynamics = dynamics::check::read(raw, &rods, [gravity, tip_force, tip_moment])?;
    let scenario = Scenario {
        name,
        units,
        rods,
        joined,
        coupling,
        gravity,
        tip_force,
        tip_moment,
        tolerance,
        dynamics,
    };
    limits::check(raw, &scenario)?;
    Ok(scenario)
}

fn name(item: Item) -> Result<String> {
    let DeValue::String(name) = item.value() else {
        return Err(item.refuse(Problem::WrongType {
            needed: Needed::Text,
        }));
    };
    let allowed = |c: char| c.is_alphanumeric() || "_-.+".contains(c);
    let starts_well = name.starts_with(|c: char| c.is_alphanumeric() || c == '_');
    if starts_well && name.len() <= LONGEST_NAME && name.chars().all(allowed) {
        Ok(name.to_string())
    } else {
        Err(item.refuse(Problem::Name { most: LONGEST_NAME }))
    }
}

fn unit(item: Item) -> Result<String> {
    let DeValue::String(unit) = item.value() else {
        return Err(item.refuse(Problem::WrongType {
            needed: Needed::Text,
        }));
    };
    let printed = !unit.trim().is_empty() && !unit.chars().any(char::is_control);
    match printed && unit.chars().count() <= LONGEST_UNIT {
        true => Ok(unit.trim().to_string()),
        false => Err(item.refuse(Problem::Unit { most: LONGEST_UNIT })),
    }
}

fn rods(item: Item) -> Result<usize> {
    match item.value() {
        DeValue::Integer(integer) => usize::from_str_radix(integer.as_str(), integer.radix()).ok(),
        _ => None,
    }
    .filter(|rods| (1..=MOST_RODS).contains(rods))
    .ok_or_else(|| item.refuse(Problem::Rods { most: MOST_RODS }))
}

pub(super) fn truth(item: Item) -> Result<bool> {
    match item.value() {
        DeValue::Boolean(value) => Ok(*value),
        _ => Err(item.refuse(Problem::WrongType {
            needed: Needed::TrueOrFalse,
        })),
    }
}

fn veins(raw: &Raw, rods: usize) -> Result<Vec<Rod>> {
    let length = lengths(raw.required(Key::Length)?, rods)?;
    let angle = angles(raw.required(Key::Fan)?, rods)?;
    let required = |key, range| quantity::read(raw.required(key)?, rods, range);
    let or_zero = |key| match raw.optional(key) {
        Some(item) => quantity::read(item, rods, Range::Finite),
        None => Ok(vec![Profile::Constant(0.0); rods]),
    };
    let mut stretch = match raw.optional(Key::RestStretch) {
        Some(item) => quantity::read(item, rods, Range::Positive)?,
        None => vec![Profile::Constant(1.0); rods],
    };
    let mut couple = [
        required(Key::Torsion, Range::Positive)?,
        required(Key::Bending2, Range::Positive)?,
        required(Key::Bending3, Range::Positive)?,
    ];
    let mut force = [
        required(Key::Axial, Range::PositiveOrInfinite)?,
        required(Key::Shear2, Range::PositiveOrInfinite)?,
        required(Key::Shear3, Range::PositiveOrInfinite)?,
    ];
    let mut rest = [
        or_zero(Key::RestTwist)?,
        or_zero(Key::RestBend2)?,
        or_zero(Key::RestBend3)?,
    ];
    let one =
        |of: &mut Vec<Profile>, rod: usize| std::mem::replace(&mut of[rod], Profile::Constant(0.0));
    let take =
        |of: &mut [Vec<Profile>; 3], rod: usize| of.each_mut().map(|profiles| one(profiles, rod));
    Ok((0..rods)
        .map(|rod| Rod {
            length: length[rod],
            angle: angle[rod],
            couple_stiffness: take(&mut couple, rod),
            force_stiffness: take(&mut force, rod),
            rest_curvature: take(&mut rest, rod),
            rest_stretch: one(&mut stretch, rod),
        })
        .collect())
}

fn lengths(item: Item, rods: usize) -> Result<Vec<f64>> {
    let needed = Needed::LengthOf(rods);
    number_or_list(item, rods, Range::Positive, needed, Because::OnePerRod)
}

/// Base angles phi_n of the rods n = 1..N (paper, section 2.4 (c)).
fn angles(item: Item, rods: usize) -> Result<Vec<f64>> {
    let step = PI / (3.0 * rods as f64);
    // -pi/3 + 2 pi n / (3N) = step (2n - N); with n - 1/2 the fan is exactly antisymmetric.
    let fan = |odd: f64| {
        (1..=rods)
            .map(|n| step * (2.0 * n as f64 - odd - rods as f64))
            .collect()
    };
    match item.value() {
        DeValue::String(text) if text == "paper" => Ok(fan(0.0)),
        DeValue::String(text) if text == "symmetric" => Ok(fan(1.0)),
        DeValue::Array(_) => number_or_list(
            item,
            rods,
            Range::Finite,
            Needed::ListOfNumbers,
            Because::OnePerRod,
        ),
        _ => Err(item.refuse(Problem::Fan { rods })),
    }
}

fn coupling(raw: &Raw, gaps: usize) -> Result<Vec<[f64; 3]>> {
    let mut coupling = vec![[0.0; 3]; gaps];
    for (axis, key) in [Key::CouplingX, Key::CouplingY, Key::CouplingZ]
        .into_iter()
        .enumerate()
    {
        let Some(item) = raw.optional(key) else {
            continue;
        };
        let needed = Needed::PerGap(gaps);
        let stiffness = number_or_list(item, gaps, Range::NotNegative, needed, Because::OnePerGap)?;
        for (gap, stiffness) in coupling.iter_mut().zip(stiffness) {
            gap[axis] = stiffness;
        }
    }
    Ok(coupling)
}

fn number_or_list(
    item: Item,
    count: usize,
    range: Range,
    needed: Needed,
    because: Because,
) -> Result<Vec<f64>> {
    match item.value() {
        DeValue::Integer(_) | DeValue::Float(_) => Ok(vec![number(item, range)?; count]),
        _ => {
            let array = item.array(needed)?;
            entries(item, array.len(), count, because)?;
            (0..count)
                .map(|index| number(item.entry(index), range))
                .collect()
        }
    }
}

fn vector(raw: &Raw, key: Key) -> Result<[f64; 3]> {
    let Some(item) = raw.optional(key) else {
        return Ok([0.0; 3]);
    };
    components(item, Spot::Entry)
}

/// Three numbers, each at its own spot.
pub(super) fn components(item: Item, spot: impl Fn(usize) -> Spot) -> Result<[f64; 3]> {
    let array = item.array(Needed::Vector)?;
    entries(item, array.len(), 3, Because::Axes)?;
    let mut vector = [0.0; 3];
    for (axis, component) in vector.iter_mut().enumerate() {
        *component = number(item.part(spot(axis), &array[axis]), Range::Finite)?;
    }
    Ok(vector)
}

fn tip_moment(raw: &Raw, rods: usize) -> Result<[f64; 3]> {
    let moment = vector(raw, Key::TipMoment)?;
    match raw.optional(Key::TipMoment) {
        Some(item) if rods > 1 && moment != [0.0; 3] => {
            Err(item.refuse(Problem::MomentOnManyRods { rods }))
        }
        _ => Ok(moment),
    }
}

fn tolerance(raw: &Raw) -> Result<f64> {
    let Some(item) = raw.optional(Key::Tolerance) else {
        return Ok(TOLERANCE_DEFAULT);
    };
    let tolerance = number(item, Range::Finite)?;
    if tolerance <= 0.0 || tolerance > TOLERANCE_MOST {
        Err(item.refuse(Problem::Tolerance {
            most: TOLERANCE_MOST,
        }))
    } else if tolerance < TOLERANCE_LEAST {
        Err(item.refuse(Problem::ToleranceTooSmall {
            least: TOLERANCE_LEAST,
        }))
    } else {
        Ok(tolerance)
    }
}

/// Refuses a list whose length is not `needed`.
pub(super) fn entries(item: Item, found: usize, needed: usize, because: Because) -> Result<()> {
    if found == needed {
        Ok(())
    } else {
        Err(item.refuse(Problem::Entries {
            found,
            needed,
            because,
        }))
    }
}

pub(super) fn number(item: Item, range: Range) -> Result<f64> {
    let value = match item.value() {
        DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str().parse().ok(),
        DeValue::Integer(integer) => u128::from_str_radix(integer.as_str(), integer.radix())
            .ok()
            .map(|value| value as f64),
        DeValue::Float(float) => float.as_str().parse().ok(),
        _ => {
            return Err(item.refuse(Problem::WrongType {
                needed: Needed::Number,
            }));
        }
    };
    // 1e999 parses to infinity, which nobody wrote.
    let says_infinite =
        matches!(item.value(), DeValue::Float(float) if float.as_str().contains("inf"));
    let value: f64 = match value {
        Some(value) if says_infinite || !f64::is_infinite(value) => value,
        _ => return Err(item.refuse(Problem::Overflow)),
    };
    let positive = matches!(range, Range::Positive | Range::PositiveOrInfinite);
    let problem = if value.is_nan() || value == f64::NEG_INFINITY {
        Problem::NotFinite
    } else if positive && value <= 0.0 {
        Problem::NotPositive
    } else if value == f64::INFINITY {
        match range {
            Range::PositiveOrInfinite => return Ok(value),
            Range::Positive => Problem::Infinite,
            _ => Problem::NotFinite,
        }
    } else if positive && !(MAGNITUDES.0..=MAGNITUDES.1).contains(&value) {
        Problem::Magnitude
    } else if range == Range::NotNegative && value < 0.0 {
        Problem::Negative
    } else {
        return Ok(value);
    };
    Err(item.refuse(problem))
}
