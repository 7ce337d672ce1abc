//! A load or factor in time as written: times, and a value for each.

use super::Schedule;
use super::check::{Range, components, entries, number};
use super::error::{Because, Form, Needed, Problem, ScenarioError, Spot};
use super::raw::Item;

/// Where an entry stands, or the list of them.
type Place = fn(Option<usize>) -> Spot;
type Result<T> = std::result::Result<T, ScenarioError>;

/// Reads a load in time, `{ at = [...], value = [[x, y, z], ...] }`.
pub(super) fn vectors(item: Item) -> Result<Schedule<[f64; 3]>> {
    let value = ("value", Spot::Value as Place, Needed::ListOfVectors);
    read(item, Form::LoadInTime, value, |item, index| {
        components(item, |axis| Spot::Component(index, axis))
    })
}

/// Reads a factor in time, `{ at = [...], factor = [...] }`.
pub(super) fn factors(item: Item) -> Result<Schedule<f64>> {
    let factor = ("factor", Spot::Factor as Place, Needed::ListOfNumbers);
    read(item, Form::FactorInTime, factor, |item, _| {
        number(item, Range::Finite)
    })
}

/// One of the times of what was read from `item`.
pub(super) fn time(item: Item, index: usize) -> Item {
    nth(item, "at", Spot::At, index)
}

/// One of the vectors of what was read from `item`.
pub(super) fn vector(item: Item, index: usize) -> Item {
    nth(item, "value", Spot::Value, index)
}

/// One of the factors of what was read from `item`.
pub(super) fn factor(item: Item, index: usize) -> Item {
    nth(item, "factor", Spot::Factor, index)
}

fn nth<'e>(item: Item<'e>, name: &str, spot: Place, index: usize) -> Item<'e> {
    item.value()
        .get(name)
        .and_then(|list| list.get_ref().get(index))
        .map_or(item, |written| item.part(spot(Some(index)), written))
}

fn read<T>(
    item: Item,
    form: Form,
    (name, spot, needed): (&'static str, Place, Needed),
    entry: impl Fn(Item, usize) -> Result<T>,
) -> Result<Schedule<T>> {
    let [at, value] = item.pair([("at", Spot::At(None)), (name, spot(None))], form)?;
    let at = times(at)?;
    let array = value.array(needed)?;
    entries(value, array.len(), at.len(), Because::OnePerKnot)?;
    let value = array
        .iter()
        .enumerate()
        .map(|(index, written)| entry(value.part(spot(Some(index)), written), index))
        .collect::<Result<_>>()?;
    Ok(Schedule { at, value })
}

fn times(item: Item) -> Result<Vec<f64>> {
    let array = item.array(Needed::ListOfNumbers)?;
    if array.is_empty() {
        return Err(item.refuse(Problem::NoTimes));
    }
    let mut at: Vec<f64> = Vec::with_capacity(array.len());
    for (index, value) in array.iter().enumerate() {
        let item = item.part(Spot::At(Some(index)), value);
        let time = number(item, Range::Finite)?;
        match at.last() {
            Some(&before) if time <= before => {
                return Err(item.refuse(Problem::TimesNotRising { before }));
            }
            _ => at.push(time),
        }
    }
    Ok(at)
}
