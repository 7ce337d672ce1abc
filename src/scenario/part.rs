//! Parts of a scenario's entries: `load.gravity[2]`, `stiffness.bending_2.value[1]`,
//! `load.point[0].force[2]`, or all numbers of one together, `scale:stiffness.bending_2`.

use std::fmt;

use toml::Value;

use super::form::Form;
use super::key::Key;
use super::spelling::unknown;

/// Lists that a table can have.
const LISTS: [&str; 3] = ["at", "value", "factor"];

const COMPONENTS: &str = "x, y, z have the indices 0, 1, 2";

/// The target of an override: an entry of a scenario, one of its lists, one entry of
/// that, or all numbers of one of these, which are then multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// The key.
    pub key: Key,
    /// Which of its tables, counted from 0, if there may be several; else 0.
    pub(crate) row: usize,
    /// Which list of a profile or schedule.
    pub(crate) list: Option<&'static str>,
    /// Which entry of the list, which of that, and so on, counted from 0.
    pub(crate) indices: [Option<usize>; 3],
    /// Whether its numbers are multiplied instead of replaced.
    pub(crate) scale: bool,
}

impl Part {
    /// The whole value of a key in one of its tables.
    pub(super) fn of_row(key: Key, row: usize) -> Part {
        Part {
            key,
            row,
            list: None,
            indices: [None; 3],
            scale: false,
        }
    }

    /// Parses a part; an error says what is wrong.
    pub(crate) fn parse(text: &str) -> Result<Part, String> {
        let (scale, rest) = match text.trim().strip_prefix("scale:") {
            Some(rest) => (true, rest.trim()),
            None => (false, text.trim()),
        };
        let (row, path, brackets) = split_row(rest)?;
        let (key, list) = match Key::from_path(&path) {
            Some(key) => (key, None),
            None => {
                let list = path.rsplit_once('.').and_then(|(path, name)| {
                    let list = LISTS.into_iter().find(|list| *list == name)?;
                    Some((Key::from_path(path)?, Some(list)))
                });
                list.ok_or_else(|| unknown(&path))?
            }
        };
        let mut indices = [None; 3];
        for (place, index) in brackets.split_terminator(']').enumerate() {
            let index = index.trim().strip_prefix('[').ok_or_else(invalid_index)?;
            *indices.get_mut(place).ok_or_else(invalid_index)? = Some(number_of(index)?);
        }
        if indices[2].is_some() && key.form() != Form::VectorQuantity {
            return Err(invalid_index());
        }
        if !brackets.is_empty() && !brackets.ends_with(']') {
            return Err(invalid_index());
        }
        let part = Part {
            key,
            row: row.unwrap_or(0),
            list,
            indices,
            scale,
        };
        if row.is_none() && key.is_repeated() {
            let (table, name) = key.parts();
            return Err(format!("say which one, counted from 0: {table}[0].{name}"));
        }
        part.check()?;
        Ok(part)
    }

    /// Refuses parts that entries of this form do not have.
    fn check(&self) -> Result<(), String> {
        let (form, path, index) = (self.key.form(), self.key.path(), self.indices[0]);
        let single = matches!(form, Form::Text | Form::Switch | Form::Whole);
        match form {
            _ if single && self.scale => Err("has no numbers that could be scaled".into()),
            Form::Whole | Form::Number(_) if index.is_some() => {
                Err("is one number: leave the index out".into())
            }
            Form::Text | Form::Switch if index.is_some() => Err("has no entries".into()),
            Form::Vector if index > Some(2) => Err(COMPONENTS.into()),
            Form::VectorPerRod if self.indices[1] > Some(2) => Err(COMPONENTS.into()),
            Form::Quantity(_) | Form::Outline(_) | Form::VectorQuantity => Ok(()),
            Form::VectorInTime | Form::VectorOrInTime | Form::FactorInTime => Ok(()),
            _ if self.list.is_some() => Err(format!("{path} has no lists within")),
            _ => Ok(()),
        }
    }

    /// Checks that it is a single number, or one for all rods, that can vary.
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
            Form::Vector | Form::VectorOrInTime | Form::Fan | Form::Pixel
                if self.indices[0].is_none() =>
            {
                list()
            }
            Form::VectorPerRod | Form::VectorQuantity if self.indices[0].is_none() => list(),
            // One index is that of a component, two are those of a rod and a component.
            Form::VectorPerRod | Form::VectorQuantity
                if self.list.is_none() && self.indices[1].or(self.indices[0]) > Some(2) =>
            {
                Err(COMPONENTS.into())
            }
            _ if self.list.is_some() && self.indices[0].is_none() => list(),
            _ => Ok(()),
        }
    }

    /// Whether it is the whole value of its key.
    pub(super) fn is_whole(&self) -> bool {
        self.list.is_none() && self.indices[0].is_none() && !self.scale
    }

    /// Whether it is where nodes must be, on the way from the base to the tip.
    pub(crate) fn is_place(&self) -> bool {
        self.list == Some("at") || matches!(self.key, Key::PointAt | Key::GripAt)
    }

    /// Of a vector for each rod, how many of its indices are in vain where one value holds for all.
    pub(super) fn shared(&self, value: &Value) -> usize {
        let is_vector = matches!(self.key.form(), Form::VectorPerRod | Form::VectorQuantity);
        if !is_vector || value.is_table() || self.list == Some("at") {
            return 0;
        }
        let wanted = self.indices.iter().flatten().count();
        let depth = std::iter::successors(Some(value), |value| value.get(0)).count() - 1;
        wanted.saturating_sub(depth)
    }

    /// Splits it into parts that are numbers, given its value: every entry of a list or a
    /// profile.
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

    /// Whether both contain some number.
    pub(crate) fn overlaps(&self, other: &Part) -> bool {
        let same =
            |one: Option<usize>, two: Option<usize>| one.is_none() || two.is_none() || one == two;
        let lists = self.list.is_none() || other.list.is_none() || self.list == other.list;
        let mut pairs = self.indices.iter().zip(other.indices);
        (self.key, self.row) == (other.key, other.row)
            && lists
            && pairs.all(|(one, two)| same(*one, two))
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let scale = if self.scale { "scale:" } else { "" };
        match self.key.parts() {
            (table, name) if self.key.is_repeated() => {
                write!(f, "{scale}{table}[{}].{name}", self.row)?;
            }
            _ => write!(f, "{scale}{}", self.key.path())?,
        }
        self.list.map_or(Ok(()), |list| write!(f, ".{list}"))?;
        let mut indices = self.indices.iter().flatten();
        indices.try_for_each(|index| write!(f, "[{index}]"))
    }
}

/// Splits off which one of several tables is meant, and the indices within a value.
fn split_row(text: &str) -> Result<(Option<usize>, String, &str), String> {
    let within = |table: &&str| {
        let rest = text.strip_prefix(table)?.trim_start().strip_prefix('[')?;
        rest.split_once(']')
    };
    let named = Key::REPEATED
        .iter()
        .find_map(|table| Some((table, within(table)?)));
    let (row, outer, rest) = match named {
        Some((table, (row, rest))) => {
            let row = number_of(row)?;
            let Some(rest) = rest.trim_start().strip_prefix('.') else {
                let names = Key::allowed_in(table).join(", ");
                return Err(format!(
                    "name an entry of it: {names}, as in {table}[0].vein"
                ));
            };
            (Some(row), format!("{table}."), rest)
        }
        None => (None, String::new(), text),
    };
    let (path, brackets) = rest.split_at(rest.find('[').unwrap_or(rest.len()));
    Ok((row, outer + path.trim(), brackets))
}

fn number_of(index: &str) -> Result<usize, String> {
    index.trim().parse().map_err(|_| invalid_index())
}

fn invalid_index() -> String {
    "an index is a whole number from 0, as in load.gravity[2]".into()
}
