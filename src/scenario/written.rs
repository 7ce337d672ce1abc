//! Values of a scenario as they are written, in their shortest form.

use serde::ser::{Serialize, SerializeMap, Serializer};

use super::{Profile, Schedule, ascending};

/// A value to be written.
pub(super) enum Written<'a> {
    Text(&'a str),
    Switch(bool),
    Whole(usize),
    /// JSON has no infinity: `"inf"`.
    Number(f64),
    List(Vec<Written<'a>>),
    Table(Vec<(&'static str, Written<'a>)>),
}

impl Serialize for Written<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Written::Text(text) => serializer.serialize_str(text),
            Written::Switch(switch) => serializer.serialize_bool(*switch),
            Written::Whole(whole) => serializer.serialize_u64(*whole as u64),
            Written::Number(number) if number.is_infinite() => serializer.serialize_str("inf"),
            Written::Number(number) => serializer.serialize_f64(*number),
            Written::List(list) => serializer.collect_seq(list),
            Written::Table(table) => {
                let mut object = serializer.serialize_map(Some(table.len()))?;
                for (key, value) in table {
                    object.serialize_entry(key, value)?;
                }
                object.end()
            }
        }
    }
}

pub(super) fn list(numbers: impl IntoIterator<Item = f64>) -> Written<'static> {
    Written::List(numbers.into_iter().map(Written::Number).collect())
}

/// A single number if all are the same.
pub(super) fn number_or_list(numbers: impl Iterator<Item = f64>) -> Written<'static> {
    let numbers: Vec<f64> = numbers.collect();
    let first = numbers.first().copied().unwrap_or(0.0);
    match numbers.iter().all(|number| *number == first) {
        true => Written::Number(first),
        false => list(numbers),
    }
}

/// A quantity of all rods, in the shortest form.
pub(super) fn quantity<'p>(profiles: impl Iterator<Item = &'p Profile>) -> Written<'static> {
    let profiles: Vec<&Profile> = profiles.collect();
    if profiles.iter().all(|it| matches!(it, Profile::Constant(_))) {
        return number_or_list(profiles.iter().map(|profile| profile.at(0.0)));
    }
    let kinks = profiles.iter().flat_map(|profile| profile.kinks());
    let at = ascending([0.0, 1.0].iter().chain(kinks).copied());
    let values = |profile: &Profile| list(at.iter().map(|&sigma| profile.at(sigma)));
    let value = match profiles.iter().all(|profile| *profile == profiles[0]) {
        true => values(profiles[0]),
        false => Written::List(profiles.iter().map(|profile| values(profile)).collect()),
    };
    Written::Table(vec![("at", list(at.iter().copied())), ("value", value)])
}

/// A quantity in time; `None` if it is always the one at rest.
pub(super) fn in_time<T: Copy + PartialEq>(
    schedule: &Schedule<T>,
    at_rest: T,
    name: &'static str,
    written: impl Fn(T) -> Written<'static>,
) -> Option<Written<'static>> {
    let values = schedule.value.iter().map(|&value| written(value));
    let table = || {
        let at = list(schedule.at.iter().copied());
        Written::Table(vec![("at", at), (name, Written::List(values.collect()))])
    };
    (*schedule != Schedule::constant(at_rest)).then(table)
}
