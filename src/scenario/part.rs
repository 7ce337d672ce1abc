//! Parts of a scenario's entries: `load.gravity[2]`, `stiffness.bending_2.value[1]`,
//! or all numbers of one together, `scale:stiffness.bending_2`.

use std::collections::BTreeMap;
use std::fmt;

use toml::Value;

use super::error::{Place, ScenarioError};
use super::excerpt::shorten;
use super::key::{Form, Key, LeftOut, unknown};

/// Lists that a table can have.
const LISTS: [&str; 3] = ["at", "value", "factor"];

/// What is set: an entry of a scenario, one of its lists, one entry of that, or
/// all numbers of one of these, which are multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// The key.
    pub key: Key,
    /// Which list of a profile or schedule.
    pub(crate) list: Option<&'static str>,
    /// Which entry of the list, and which of that, counted from 0.
    pub(crate) indices: [Option<usize>; 2],
    /// Whether its numbers are multiplied, and not replaced.
    pub(crate) scale: bool,
}

impl Part {
    /// Reads it; otherwise why it is none.
    pub(crate) fn parse(text: &str) -> Result<Part, String> {
        let (scale, rest) = match text.trim().strip_prefix("scale:") {
            Some(rest) => (true, rest.trim()),
            None => (false, text.trim()),
        };
        let (path, brackets) = rest.split_at(rest.find('[').unwrap_or(rest.len()));
        let path = path.trim();
        let (key, list) = match Key::from_path(path) {
            Some(key) => (key, None),
            None => {
                let list = path.rsplit_once('.').and_then(|(path, name)| {
                    let list = LISTS.into_iter().find(|list| *list == name)?;
                    Some((Key::from_path(path)?, Some(list)))
                });
                list.ok_or_else(|| unknown(path))?
            }
        };
        let mut indices = [None; 2];
        let wrong = || "an index is a whole number from 0, as in load.gravity[2]".to_string();
        for (place, index) in brackets.split_terminator(']').enumerate() {
            let index = index.trim().strip_prefix('[').ok_or_else(wrong)?.trim();
            let index = index.parse().map_err(|_| wrong())?;
            *indices.get_mut(place).ok_or_else(wrong)? = Some(index);
        }
        if !brackets.is_empty() && !brackets.ends_with(']') {
            return Err(wrong());
        }
        let part = Part {
            key,
            list,
            indices,
            scale,
        };
        part.check()?;
        Ok(part)
    }

    /// Refuses what no entry of this form has.
    fn check(&self) -> Result<(), String> {
        let (form, path, index) = (self.key.form(), self.key.path(), self.indices[0]);
        let single = matches!(form, Form::Text | Form::Switch | Form::Whole);
        match form {
            _ if single && self.scale => Err("has no numbers that could be scaled".into()),
            Form::Whole | Form::Number(_) if index.is_some() => {
                Err("is one number: leave the index out".into())
            }
            Form::Text | Form::Switch if index.is_some() => Err("has no entries".into()),
            Form::Vector if index > Some(2) => Err("x, y, z have the indices 0, 1, 2".into()),
            Form::Quantity(_) | Form::VectorInTime | Form::FactorInTime => Ok(()),
            _ if self.list.is_some() => Err(format!("{path} has no lists within")),
            _ => Ok(()),
        }
    }

    /// Whether it is one number, or one for all rods, that can take any value.
    pub(crate) fn is_number(&self) -> Result<(), String> {
        let path = self.key.path();
        let within = self
            .list
            .map_or(path.to_string(), |list| format!("{path}.{list}"));
        let list = || Err(format!("is a list: give an index, as in {within}[0]"));
        match self.key.form() {
            _ if self.scale => Ok(()),
            Form::Text | Form::Switch => Err("takes no number that could vary".into()),
            Form::VectorInTime | Form::FactorInTime if self.list.is_none() => Err(format!(
                "takes no number that could vary; its entries do: {path}.at[0]"
            )),
            Form::Vector | Form::Fan if self.indices[0].is_none() => list(),
            _ if self.list.is_some() && self.indices[0].is_none() => list(),
            _ => Ok(()),
        }
    }

    /// Whether it is the whole of its key.
    fn is_whole(&self) -> bool {
        self.list.is_none() && self.indices[0].is_none() && !self.scale
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let scale = if self.scale { "scale:" } else { "" };
        write!(f, "{scale}{}", self.key.path())?;
        self.list.map_or(Ok(()), |list| write!(f, ".{list}"))?;
        let mut indices = self.indices.iter().flatten();
        indices.try_for_each(|index| write!(f, "[{index}]"))
    }
}

/// An override with the whole value of its key.
pub(crate) struct Override {
    /// As it was given.
    pub given: String,
    pub key: Key,
    pub value: String,
}

/// Overrides of whole entries, from those of parts of entries of the scenario in
/// `text`, which may have errors that are found elsewhere.
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
                let entries = entries.get_or_insert_with(|| Entries::new(text, &resolved));
                entries.changed(part, value).map_err(about)?.to_string()
            }
        };
        if let Some(entries) = &mut entries {
            let new = value_of(&whole).map(|value| (part.key.path(), value));
            entries.0.extend(new);
        }
        resolved.push(Override {
            given: given.clone(),
            key: part.key,
            value: whole,
        });
    }
    Ok(resolved)
}

/// The value of a part of the scenario in `text`, with entries overridden.
pub(crate) fn value_at(text: &str, overrides: &[String], part: Part) -> Option<Value> {
    let toml = super::form::from_json(text, "").and_then(Result::ok);
    let text = toml.as_deref().unwrap_or(text);
    let resolved = resolve(text, overrides).ok()?;
    let entries = Entries::new(text, &resolved);
    let mut place = entries.0.get(part.key.path())?;
    if let Some(list) = part.list {
        place = place.get(list)?;
    }
    for index in part.indices.into_iter().flatten() {
        // One number for all rods is that of each.
        if number(place).is_none() {
            place = place.get(index)?;
        }
    }
    Some(place.clone())
}

/// The number that a part of the scenario has, if it is one; a factor is 1.
pub(crate) fn number_at(text: &str, overrides: &[String], part: Part) -> Option<f64> {
    match part.scale {
        true => Some(1.0),
        false => number(&value_at(text, overrides, part)?),
    }
}

/// The scenario in `text` as TOML, with entries overridden.
pub(crate) fn with_overrides(text: &str, overrides: &[String]) -> Option<String> {
    let toml = super::form::from_json(text, "").and_then(Result::ok);
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

impl Part {
    /// The parts that are numbers: of a list or a profile with this value every entry.
    pub(crate) fn numbers(self, value: &Value) -> Vec<Part> {
        let depth = self.indices.iter().flatten().count();
        match value {
            _ if self.scale => vec![self],
            Value::Array(list) if depth < self.indices.len() => {
                let entry = |(index, value): (usize, &Value)| {
                    let mut part = self;
                    part.indices[depth] = Some(index);
                    part.numbers(value)
                };
                list.iter().enumerate().flat_map(entry).collect()
            }
            Value::Table(table) if self.list.is_none() => match table.get("value") {
                Some(value) => {
                    let list = Some("value");
                    Part { list, ..self }.numbers(value)
                }
                None => vec![self],
            },
            _ => vec![self],
        }
    }

    /// Whether some number is of both.
    pub(crate) fn overlaps(&self, other: &Part) -> bool {
        let same =
            |one: Option<usize>, two: Option<usize>| one.is_none() || two.is_none() || one == two;
        let lists = self.list.is_none() || other.list.is_none() || self.list == other.list;
        let mut pairs = self.indices.iter().zip(other.indices);
        self.key == other.key && lists && pairs.all(|(one, two)| same(*one, two))
    }
}

/// Every entry by its key, as far as it can be read, those left out included
/// where they have a value all the same.
struct Entries(BTreeMap<&'static str, Value>);

impl Entries {
    fn new(text: &str, overrides: &[Override]) -> Self {
        let document = text.parse::<toml::Table>().unwrap_or_default();
        let mut entries = BTreeMap::new();
        for key in Key::all() {
            let written = match key.parts() {
                ("", name) => document.get(name),
                (table, name) => document.get(table).and_then(|table| table.get(name)),
            };
            let left_out = || match key.left_out() {
                LeftOut::Means(text) => value_of(text),
                _ => None,
            };
            entries.extend(
                written
                    .cloned()
                    .or_else(left_out)
                    .map(|value| (key.path(), value)),
            );
        }
        for given in overrides {
            entries.extend(value_of(&given.value).map(|value| (given.key.path(), value)));
        }
        Entries(entries)
    }

    /// The whole value of a key of which a part is new.
    fn changed(&self, part: Part, given: &str) -> Result<Value, String> {
        let given = given.trim();
        let new = value_of(given).ok_or(format!("{} is no value", shorten(given)))?;
        let whole = self.0.get(part.key.path());
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

    /// Turns a number for all rods, or gaps, into a list.
    fn spread(&self, part: Part, place: &mut Value) -> Result<(), String> {
        if number(place).is_some() {
            let rods = self.0.get(Key::Rods.path()).and_then(Value::as_integer);
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

/// Most entries that a number is spread to; a scenario with more is refused.
const MOST_RODS: usize = 100_000;

/// What a text means as TOML.
fn value_of(text: &str) -> Option<Value> {
    let table = format!("it = {text}").parse::<toml::Table>();
    match table {
        Ok(mut table) => table.remove("it").filter(|_| table.is_empty()),
        // What is no TOML is a text.
        Err(_) => (!text.starts_with(['[', '{', '"', '\''])).then(|| Value::String(text.into())),
    }
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(float) => Some(*float),
        Value::Integer(integer) => Some(*integer as f64),
        _ => None,
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

#[cfg(test)]
mod tests;
