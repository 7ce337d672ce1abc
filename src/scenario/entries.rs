//! The entries of a scenario as values, and replacements of whole entries or parts of
//! them ([`Part`]). A scenario with other numbers is made from these without parsing its
//! text again.

use std::sync::{Arc, LazyLock};

use toml::{Table, Value};

use super::error::{Place, ScenarioError};
use super::excerpt::shorten;
use super::form::from_json;
use super::key::{Form, Key, LeftOut};
use super::node::number;
use super::part::Part;

/// Most rods: a leaf of 100,000 rods and eight segments already has five
/// million unknowns.
pub const MOST_RODS: usize = 100_000;

/// The entries given in a scenario, by their keys.
///
/// ```
/// use leafdyn::scenario::{Entries, Value};
///
/// let mut entries = Entries::default();
/// assert!(entries.insert("leaf", "rods", Value::Integer(1)));
/// assert!(!entries.insert("leaf", "rod", Value::Integer(1)), "no key");
/// assert!(entries.scenario().is_none(), "not all that is needed");
/// ```
#[derive(Clone, Debug)]
pub struct Entries([Option<Arc<Value>>; Key::COUNT]);

impl Default for Entries {
    fn default() -> Self {
        Entries([const { None }; Key::COUNT])
    }
}

/// An override with the whole value of its key.
pub(crate) struct Override {
    pub given: String,
    pub key: Key,
    pub value: String,
}

/// Turns overrides of parts of entries of the scenario in `text` into overrides of whole
/// entries. Errors in the text itself are found elsewhere.
pub(crate) fn resolve(text: &str, overrides: &[String]) -> Result<Vec<Override>, ScenarioError> {
    let mut resolved: Vec<Override> = Vec::new();
    let mut entries: Option<Entries> = None;
    for given in overrides {
        let refuse = |problem: String| {
            let given = shorten(given);
            ScenarioError {
                place: Place::Set { given },
                key: None,
                problem,
            }
        };
        let Some((path, value)) = given.split_once('=') else {
            let problem = "must be KEY=VALUE, e.g. --set load.gravity=[0,0,-0.5]";
            return Err(refuse(problem.into()));
        };
        let part = Part::parse(path).map_err(refuse)?;
        let whole = match part.is_whole() {
            true => value.trim().to_string(),
            false => {
                let about = |why: String| ScenarioError {
                    key: Some(part.key),
                    ..refuse(format!("{part}: {why}"))
                };
                let entries = entries.get_or_insert_with(|| Entries::readable(text, &resolved));
                let value = value.trim();
                let new = value_of(value).ok_or(format!("{} is no value", shorten(value)));
                let whole = new.and_then(|new| entries.changed(part, new));
                whole.map_err(about)?.to_string()
            }
        };
        if let (Some(entries), Some(value)) = (&mut entries, value_of(&whole)) {
            entries.put(part.key, value);
        }
        resolved.push(Override {
            given: given.clone(),
            key: part.key,
            value: whole,
        });
    }
    Ok(resolved)
}

/// The scenario in `text` as TOML, with entries overridden.
pub(crate) fn with_overrides(text: &str, overrides: &[String]) -> Option<String> {
    let toml = from_json(text, "").and_then(Result::ok);
    let text = toml.as_deref().unwrap_or(text);
    let mut document = text.parse::<toml::Table>().ok()?;
    for given in resolve(text, overrides).ok()? {
        let value = value_of(&given.value)?;
        match given.key.parts() {
            ("", name) => document.insert(name.into(), value),
            (table, name) => {
                let empty = || Value::Table(toml::Table::new());
                let table = document.entry(table).or_insert_with(empty);
                table.as_table_mut()?.insert(name.into(), value)
            }
        };
    }
    Some(document.to_string())
}

impl Entries {
    /// Adds an entry of a table, whose name is empty for entries at the top; returns whether
    /// there is such a key.
    pub fn insert(&mut self, table: &str, name: &str, value: Value) -> bool {
        let key = Key::from_parts(table, name);
        if let Some(key) = key {
            self.put(key, value);
        }
        key.is_some()
    }

    /// Whether scenarios have a table of this name.
    pub fn has_table(name: &str) -> bool {
        Key::table(name).is_some()
    }

    /// The entries of the scenario in `text`, which is checked elsewhere; `None` if it cannot
    /// be parsed.
    pub fn of_text(text: &str) -> Option<Self> {
        let toml = from_json(text, "").and_then(Result::ok);
        let text = toml.as_deref().unwrap_or(text);
        Some(Entries::of(&text.parse().ok()?))
    }

    /// The same with entries or parts of them replaced, as in
    /// [`Scenario::from_toml_with`](super::Scenario::from_toml_with); `None` if one cannot
    /// be.
    pub fn replaced(&self, overrides: &[String]) -> Option<Self> {
        let mut entries = self.clone();
        for given in overrides {
            let (path, value) = given.split_once('=')?;
            entries.set(Part::parse(path).ok()?, value_of(value.trim())?)?;
        }
        Some(entries)
    }

    /// The entries of the scenario in `text` with these overrides, as far as they can be
    /// parsed.
    fn readable(text: &str, overrides: &[Override]) -> Self {
        let mut entries = Entries::of(&text.parse().unwrap_or_default());
        for given in overrides {
            if let Some(value) = value_of(&given.value) {
                entries.put(given.key, value);
            }
        }
        entries
    }

    fn of(document: &Table) -> Self {
        let mut entries = Entries::default();
        for key in Key::all() {
            let written = match key.parts() {
                ("", name) => document.get(name),
                (table, name) => document.get(table).and_then(|table| table.get(name)),
            };
            if let Some(value) = written {
                entries.put(key, value.clone());
            }
        }
        entries
    }

    pub(super) fn given(&self) -> impl Iterator<Item = (Key, &Value)> {
        Key::all().filter_map(|key| Some((key, self.0[key as usize].as_deref()?)))
    }

    /// The value of a key, or its default.
    fn get(&self, key: Key) -> Option<&Value> {
        self.0[key as usize].as_deref().or_else(|| left_out(key))
    }

    fn put(&mut self, key: Key, value: Value) {
        self.0[key as usize] = Some(Arc::new(value));
    }

    /// Replaces a part by a value, as an override does; `None` if that is impossible.
    pub(crate) fn set(&mut self, part: Part, value: Value) -> Option<()> {
        let whole = match part.is_whole() {
            true => value,
            false => self.changed(part, value).ok()?,
        };
        self.put(part.key, whole);
        Some(())
    }

    pub(crate) fn value_at(&self, part: Part) -> Option<&Value> {
        let mut place = self.get(part.key)?;
        if let Some(list) = part.list {
            place = place.get(list)?;
        }
        for index in part.indices.into_iter().flatten() {
            // A single number holds for all rods.
            if number(place).is_none() {
                place = place.get(index)?;
            }
        }
        Some(place)
    }

    /// The number that a part is, if any; that of a scale is 1.
    pub(crate) fn number_at(&self, part: Part) -> Option<f64> {
        match part.scale {
            true => Some(1.0),
            false => number(self.value_at(part)?),
        }
    }

    /// Whether a factor changes any of its numbers, as far as it has some.
    pub(crate) fn is_scalable(&self, part: Part) -> bool {
        self.value_at(part).is_none_or(is_scalable)
    }

    /// The whole value of a key after a part of it is replaced.
    fn changed(&self, part: Part, new: Value) -> Result<Value, String> {
        let whole = self.get(part.key);
        let mut whole = whole
            .cloned()
            .ok_or("is not in the scenario: write it first")?;
        let mut place = &mut whole;
        if let Some(list) = part.list {
            let found = place.get_mut(list);
            place = found.ok_or(format!("the scenario has no {list} there: write it first"))?;
        } else if part.indices[0].is_some() {
            self.spread(part, place)?;
        }
        for index in part.indices.into_iter().flatten() {
            let entries = place.as_array_mut().ok_or("is no list in the scenario")?;
            let count = entries.len();
            let entry = entries.get_mut(index);
            place = entry
                .ok_or_else(|| format!("there are {count} entries, and indices count from 0"))?;
        }
        match part.scale {
            true => {
                let factor = number(&new).filter(|factor| factor.is_finite());
                multiply(place, factor.ok_or("the factor must be a finite number")?)?;
            }
            false => *place = new,
        }
        Ok(whole)
    }

    /// Turns a single number for all rods, or gaps, into a list.
    fn spread(&self, part: Part, place: &mut Value) -> Result<(), String> {
        if number(place).is_some() {
            let rods = self.get(Key::Rods).and_then(Value::as_integer);
            let rods = rods.and_then(|rods| usize::try_from(rods).ok());
            let rods = rods.filter(|rods| *rods <= MOST_RODS);
            let rods = rods.ok_or("leaf.rods must say of how many")?;
            let count = match part.key.form() {
                Form::PerGap(_) => rods.saturating_sub(1),
                _ => rods,
            };
            *place = Value::Array(vec![place.clone(); count]);
        }
        Ok(())
    }
}

/// The default value of a key that is left out, if it has one.
pub(super) fn left_out(key: Key) -> Option<&'static Value> {
    static VALUES: LazyLock<Vec<Option<Value>>> = LazyLock::new(|| {
        let value = |key: Key| match key.left_out() {
            LeftOut::Means(text) => value_of(text),
            _ => None,
        };
        Key::all().map(value).collect()
    });
    VALUES[key as usize].as_ref()
}

/// What a text means as TOML.
fn value_of(text: &str) -> Option<Value> {
    let table = format!("it = {text}").parse::<toml::Table>();
    match table {
        Ok(mut table) => table.remove("it").filter(|_| table.is_empty()),
        // What is no TOML is a text.
        Err(_) => (!text.starts_with(['[', '{', '"', '\''])).then(|| Value::String(text.into())),
    }
}

/// Multiplies every number; knots and times stay where they are.
fn multiply(value: &mut Value, factor: f64) -> Result<(), String> {
    if let Some(number) = number(value) {
        *value = Value::Float(number * factor);
        return Ok(());
    }
    match value {
        Value::Array(list) => list
            .iter_mut()
            .try_for_each(|entry| multiply(entry, factor)),
        Value::Table(table) => {
            let lists = table.iter_mut().filter(|(name, _)| *name != "at");
            lists
                .map(|(_, list)| list)
                .try_for_each(|list| multiply(list, factor))
        }
        other => Err(format!(
            "{} is no number to be scaled: write numbers first",
            shorten(&other.to_string())
        )),
    }
}

/// Whether [`multiply`] changes it, or refuses it.
fn is_scalable(value: &Value) -> bool {
    match value {
        Value::Array(list) => list.iter().any(is_scalable),
        Value::Table(table) => {
            let mut lists = table.iter().filter(|(name, _)| *name != "at");
            lists.any(|(_, list)| is_scalable(list))
        }
        single => number(single).is_none_or(|number| number != 0.0 && number.is_finite()),
    }
}

#[cfg(test)]
mod tests;
