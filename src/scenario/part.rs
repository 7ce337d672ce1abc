//! Parts of a scenario's entries: `load.gravity[2]`, `stiffness.bending_2.value[1]`,
//! or all numbers of one together, `scale:stiffness.bending_2`.

use std::fmt;

use toml::Value;

use super::key::{Form, Key, unknown};

/// Lists that a table can have.
const LISTS: [&str; 3] = ["at", "value", "factor"];

/// The target of an override: an entry of a scenario, one of its lists, one entry of
/// that, or all numbers of one of these, which are then multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// The key.
    pub key: Key,
    /// Which list of a profile or schedule.
    pub(crate) list: Option<&'static str>,
    /// Which entry of the list, and which of that, counted from 0.
    pub(crate) indices: [Option<usize>; 2],
    /// Whether its numbers are multiplied instead of replaced.
    pub(crate) scale: bool,
}

impl Part {
    /// The whole value of a key.
    pub(super) fn whole(key: Key) -> Part {
        Part {
            key,
            list: None,
            indices: [None; 2],
            scale: false,
        }
    }

    /// Parses a part; an error says what is wrong.
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
        let invalid_index =
            || "an index is a whole number from 0, as in load.gravity[2]".to_string();
        for (place, index) in brackets.split_terminator(']').enumerate() {
            let index = index
                .trim()
                .strip_prefix('[')
                .ok_or_else(invalid_index)?
                .trim();
            let index = index.parse().map_err(|_| invalid_index())?;
            *indices.get_mut(place).ok_or_else(invalid_index)? = Some(index);
        }
        if !brackets.is_empty() && !brackets.ends_with(']') {
            return Err(invalid_index());
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
            Form::Vector if index > Some(2) => Err("x, y, z have the indices 0, 1, 2".into()),
            Form::Quantity(_) | Form::VectorInTime | Form::FactorInTime => Ok(()),
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
            Form::Vector | Form::Fan if self.indices[0].is_none() => list(),
            _ if self.list.is_some() && self.indices[0].is_none() => list(),
            _ => Ok(()),
        }
    }

    /// Whether it is the whole value of its key.
    pub(super) fn is_whole(&self) -> bool {
        self.list.is_none() && self.indices[0].is_none() && !self.scale
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
        self.key == other.key && lists && pairs.all(|(one, two)| same(*one, two))
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
