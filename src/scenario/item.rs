//! The value of a key, or a part of it, with its place for messages.

use std::fmt::Display;

use toml::Value;

use super::entries::Entries;
use super::error::{Result, ScenarioError};
use super::excerpt::shorten;
use super::key::{Form, Key, LeftOut};
use super::part::Part;

/// The value of a key, or a part of it.
#[derive(Clone, Copy)]
pub(super) struct Item<'e> {
    entries: &'e Entries,
    part: Part,
    pub value: &'e Value,
}

impl Entries {
    /// The value of a key, if it is given.
    pub(super) fn given(&self, key: Key) -> Option<Item<'_>> {
        if self.is_given(key) {
            self.item(key).ok()
        } else {
            None
        }
    }

    /// The value of a key as given, or its default.
    pub(super) fn item(&self, key: Key) -> Result<Item<'_>> {
        match self.get(key) {
            Some(value) => Ok(Item {
                entries: self,
                part: Part::whole(key),
                value,
            }),
            None => Err(self.missing(key)),
        }
    }

    /// The error about a key that is required and left out.
    fn missing(&self, key: Key) -> ScenarioError {
        let has = |table: &str| self.source.tables.contains(&table);
        let (table, name) = key.parts();
        let example = match key.left_out() {
            LeftOut::Refused(example) => example,
            _ => "...",
        };
        let entry = format!("a line such as `{name} = {example}`");
        let how = match table {
            "" => format!("add {entry} at the top of the file"),
            _ if has(table) => format!("add {entry} below [{table}]"),
            _ => format!("add the table [{table}], and below it {entry}"),
        };
        // Stiffnesses are required unless sections are given.
        let needed = |other: &Key| match other.parts().0 {
            "" | "leaf" => true,
            "stiffness" => !has("section"),
            _ => false,
        };
        let others = Key::all().filter(|other| *other != key && !self.is_given(*other));
        let others = others.filter(|other| matches!(other.left_out(), LeftOut::Refused(_)));
        let others: Vec<&str> = others.filter(needed).map(Key::path).collect();
        let also = match others.is_empty() {
            true => String::new(),
            false => format!("; also missing: {}", others.join(", ")),
        };
        let problem = format!("{} is missing: {how}{also}", key.path());
        ScenarioError {
            key: Some(key),
            ..ScenarioError::in_file(&self.source.file, None, problem)
        }
    }
}

impl<'e> Item<'e> {
    pub(super) fn key(&self) -> Key {
        self.part.key
    }

    /// One of the lists of a table, if this is a table that has it.
    pub(super) fn list(&self, list: &'static str) -> Option<Item<'e>> {
        let value = self.value.get(list)?;
        let list = Some(list);
        let part = Part { list, ..self.part };
        Some(Item {
            part,
            value,
            ..*self
        })
    }

    /// An entry of a list; the value itself if it is not a list or too short.
    pub(super) fn entry(&self, index: usize) -> Item<'e> {
        let Some(value) = self.value.get(index) else {
            return *self;
        };
        let indices = match self.part.indices {
            [None, _] => [Some(index), None],
            [first, _] => [first, Some(index)],
        };
        let part = Part {
            indices,
            ..self.part
        };
        Item {
            part,
            value,
            ..*self
        }
    }

    /// The two lists, `at` and `other`, of a table that may have no others. `form`
    /// describes such a table.
    pub(super) fn pair(&self, other: &'static str, form: &str) -> Result<[Item<'e>; 2]> {
        let Some(table) = self.value.as_table() else {
            return Err(self.refuse(format_args!("must be a table: {form}")));
        };
        if let Some(key) = table.keys().find(|key| *key != "at" && *key != other) {
            let key = shorten(key);
            return Err(self.refuse(format_args!("unknown key {key}: {form}")));
        }
        let list = |name| {
            self.list(name)
                .ok_or_else(|| self.refuse(format_args!("{name} is missing: {form}")))
        };
        Ok([list("at")?, list(other)?])
    }

    /// The value as it is written, shortened.
    pub(super) fn shown(&self) -> String {
        self.entries.place(self.part, self.value).1
    }

    /// Refuses this value unless a condition `holds`.
    pub(super) fn ensure(&self, holds: bool, problem: impl Display) -> Result<()> {
        match holds {
            true => Ok(()),
            false => Err(self.refuse(problem)),
        }
    }

    pub(super) fn refuse(&self, problem: impl Display) -> ScenarioError {
        let list = self.part.list.map(|list| format!(", {list}"));
        let entry = match self.part.indices.map(|index| index.map(|index| index + 1)) {
            [Some(i), Some(j)] if self.key().form() == Form::VectorInTime => {
                format!(", entry {i}, component {j}")
            }
            [Some(i), Some(j)] => format!(", list {i}, entry {j}"),
            [Some(i), None] => format!(", entry {i}"),
            [None, _] => String::new(),
        };
        let (path, part) = (self.key().path(), list.unwrap_or_default() + &entry);
        let (place, found) = self.entries.place(self.part, self.value);
        ScenarioError {
            place,
            key: Some(self.key()),
            problem: format!("{path}{part} = {found}: {problem}"),
        }
    }
}
