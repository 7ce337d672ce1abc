//! A quantity as written: a number, a list of one per rod, or a profile.

use toml::de::DeValue;

use super::Profile;
use super::check::{Range, entries, number};
use super::error::{Because, Form, Needed, Problem, ScenarioError, Spot};
use super::raw::Item;

type Result<T> = std::result::Result<T, ScenarioError>;

/// Reads a quantity for `rods` rods; one profile per rod.
pub(super) fn read(item: Item, rods: usize, range: Range) -> Result<Vec<Profile>> {
    match item.value() {
        DeValue::Integer(_) | DeValue::Float(_) => {
            Ok(vec![Profile::Constant(number(item, range)?); rods])
        }
        DeValue::Table(_) => profiles(item, rods, range),
        _ => {
            let array = item.array(Needed::Quantity(rods))?;
            entries(item, array.len(), rods, Because::OnePerRod)?;
            (0..rods)
                .map(|rod| Ok(Profile::Constant(number(item.entry(rod), range)?)))
                .collect()
        }
    }
}

fn profiles(item: Item, rods: usize, range: Range) -> Result<Vec<Profile>> {
    // Infinite has no place between knots: it cannot be interpolated.
    let range = if range == Range::PositiveOrInfinite {
        Range::Positive
    } else {
        range
    };
    let names = [("at", Spot::At(None)), ("value", Spot::Value(None))];
    let [at, value] = item.pair(names, Form::Profile)?;
    let at = knots(at)?;
    let array = value.array(Needed::ProfileValue(rods))?;
    if array
        .first()
        .is_some_and(|first| first.get_ref().is_array())
    {
        entries(value, array.len(), rods, Because::OnePerRod)?;
        return array
            .iter()
            .enumerate()
            .map(|(rod, list)| {
                let list = value.part(Spot::Value(Some(rod)), list);
                linear(list, &at, range, |knot| Spot::RodValue(rod, knot))
            })
            .collect();
    }
    Ok(vec![
        linear(value, &at, range, |knot| Spot::Value(Some(
            knot
        )))?;
        rods
    ])
}

fn linear(item: Item, at: &[f64], range: Range, spot: impl Fn(usize) -> Spot) -> Result<Profile> {
    let array = item.array(Needed::ListOfNumbers)?;
    entries(item, array.len(), at.len(), Because::OnePerKnot)?;
    let value = array
        .iter()
        .enumerate()
        .map(|(knot, value)| number(item.part(spot(knot), value), range));
    Ok(Profile::Linear {
        at: at.to_vec(),
        value: value.collect::<Result<_>>()?,
    })
}

/// Fractions of the length: from 0 to 1, rising strictly.
fn knots(item: Item) -> Result<Vec<f64>> {
    let array = item.array(Needed::ListOfNumbers)?;
    if array.len() < 2 {
        return Err(item.refuse(Problem::TooFewKnots));
    }
    let mut at: Vec<f64> = Vec::with_capacity(array.len());
    for (knot, value) in array.iter().enumerate() {
        let item = item.part(Spot::At(Some(knot)), value);
        let fraction = number(item, Range::Finite)?;
        match at.last() {
            None if fraction != 0.0 => return Err(item.refuse(Problem::FirstKnot)),
            Some(&before) if fraction <= before => {
                return Err(item.refuse(Problem::KnotsNotRising { before }));
            }
            _ => at.push(fraction),
        }
        if knot + 1 == array.len() && fraction != 1.0 {
            return Err(item.refuse(Problem::LastKnot));
        }
    }
    Ok(at)
}
