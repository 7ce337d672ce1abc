//! A scenario as written: the values of the keys and their positions in the text, without
//! interpretation.

use std::fmt::Display;
use std::ops::Range;

use toml::de::{DeTable, DeValue};
use toml::{Spanned, Value};

use super::entries::{Entries, Override, left_out};
use super::error::{Place, ScenarioError};
use super::excerpt::{line_of, shorten, snippet};
use super::key::{Form, Key, LeftOut, nearest};
use super::node::Node;

/// All entries of a scenario, with those of `--set` replacing those of the file.
pub(super) struct Raw<'a> {
    file: &'a str,
    entries: [Option<Entry<'a>>; Key::COUNT],
    /// The tables that the file has.
    tables: Vec<&'static str>,
}

struct Entry<'a> {
    value: EntryValue<'a>,
    source: Source<'a>,
}

enum EntryValue<'a> {
    Parsed(Spanned<DeValue<'a>>),
    Bare(&'a Value),
}

/// The text from which an entry was parsed, and in which spans count.
#[derive(Clone, Copy)]
struct Source<'a> {
    text: &'a str,
    origin: Origin<'a>,
}

#[derive(Clone, Copy)]
enum Origin<'a> {
    File(&'a str),
    /// The whole `KEY=VALUE`.
    Set(&'a str),
    /// A default.
    LeftOut,
}

impl<'a> Source<'a> {
    fn place(&self, at: usize) -> Place {
        match self.origin {
            Origin::File(file) => Place::File {
                file: file.to_string(),
                line: Some(line_of(self.text.as_bytes(), at)),
            },
            Origin::Set(given) => Place::Set {
                given: shorten(given),
            },
            Origin::LeftOut => Place::File {
                file: "default".into(),
                line: None,
            },
        }
    }

    /// An error that is not about the value of a key, with the line around `span` if the text
    /// is that of a file.
    fn refuse(&self, span: Range<usize>, problem: String) -> ScenarioError {
        let place = self.place(span.start);
        let snippet = match self.origin {
            Origin::File(_) => snippet(self.text, span),
            _ => String::new(),
        };
        ScenarioError {
            place,
            key: None,
            problem: problem + &snippet,
        }
    }

    fn parse<T>(&self, parsed: Result<T, toml::de::Error>) -> Result<T, ScenarioError> {
        parsed.map_err(|error| {
            let problem = format!("not valid TOML: {}", error.message());
            self.refuse(error.span().unwrap_or(0..0), problem)
        })
    }
}

impl<'a> Raw<'a> {
    fn empty(file: &'a str) -> Raw<'a> {
        Raw {
            file,
            entries: [const { None }; Key::COUNT],
            tables: Vec::new(),
        }
    }

    /// Parses `text`, then applies `overrides`.
    pub(super) fn parse(
        text: &'a str,
        file: &'a str,
        overrides: &'a [Override],
    ) -> Result<Raw<'a>, ScenarioError> {
        let mut raw = Raw::empty(file);
        let origin = Origin::File(file);
        let source = Source { text, origin };
        let document = source.parse(DeTable::parse(text))?;
        raw.read_table(document.into_inner(), "", source)?;
        for given in overrides {
            raw.set(given)?;
        }
        raw.fill_in_defaults();
        Ok(raw)
    }

    /// The same from values without a text; errors then have no useful place.
    pub(super) fn of(entries: &'a Entries) -> Raw<'a> {
        let mut raw = Raw::empty("");
        let source = Source {
            text: "",
            origin: Origin::File(""),
        };
        for (key, value) in entries.given() {
            let value = EntryValue::Bare(value);
            raw.entries[key as usize] = Some(Entry { value, source });
        }
        raw.fill_in_defaults();
        raw
    }

    fn fill_in_defaults(&mut self) {
        for key in Key::all() {
            let entry = &mut self.entries[key as usize];
            if let (None, Some(value)) = (&entry, left_out(key)) {
                let source = Source {
                    text: "",
                    origin: Origin::LeftOut,
                };
                let value = EntryValue::Bare(value);
                *entry = Some(Entry { value, source });
            }
        }
    }

    fn read_table(
        &mut self,
        table: DeTable<'a>,
        name: &'static str,
        source: Source<'a>,
    ) -> Result<(), ScenarioError> {
        for (key, value) in table {
            let here = (name, key.get_ref().as_ref());
            if let Some(known) = Key::from_parts(here.0, here.1) {
                let value = EntryValue::Parsed(value);
                self.entries[known as usize] = Some(Entry { value, source });
                continue;
            }
            let inner = Key::table(here.1).filter(|_| name.is_empty());
            let Some(inner) = inner else {
                let path = match here {
                    ("", key) => key.to_string(),
                    (table, key) => format!("{table}.{key}"),
                };
                let meant = nearest(&path).map(|key| format!(" (did you mean {key}?)"));
                let (meant, allowed) =
                    (meant.unwrap_or_default(), Key::allowed_in(name).join(", "));
                let path = shorten(&path);
                let problem = format!("unknown key {path}{meant}: allowed here: {allowed}");
                return Err(source.refuse(key.span(), problem));
            };
            let span = value.span();
            let DeValue::Table(table) = value.into_inner() else {
                let found = shorten(source.text.get(span).unwrap_or(""));
                let allowed = Key::allowed_in(inner).join(", ");
                let problem = format!(
                    "{inner} = {found}: must be a table: write [{inner}] on a line of its own, below it {allowed}"
                );
                return Err(ScenarioError {
                    place: source.place(key.span().start),
                    key: None,
                    problem,
                });
            };
            self.tables.push(inner);
            self.read_table(table, inner, source)?;
        }
        Ok(())
    }

    /// Applies one override. The value is TOML; anything else is taken as text.
    fn set(&mut self, given: &'a Override) -> Result<(), ScenarioError> {
        let text = given.value.as_str();
        let origin = Origin::Set(&given.given);
        let source = Source { text, origin };
        let value = match DeValue::parse(text) {
            Err(_) if !text.is_empty() && !text.starts_with(['[', '{', '"', '\'']) => {
                Spanned::new(0..text.len(), DeValue::String(text.into()))
            }
            parsed => source.parse(parsed)?,
        };
        let value = EntryValue::Parsed(value);
        self.entries[given.key as usize] = Some(Entry { value, source });
        Ok(())
    }

    /// The value of a key, if it is given.
    pub(super) fn given(&self, key: Key) -> Option<Item<'_>> {
        self.entry(key)
            .filter(|item| !matches!(item.source.origin, Origin::LeftOut))
    }

    /// The value of a key as given, or its default.
    pub(super) fn item(&self, key: Key) -> Result<Item<'_>, ScenarioError> {
        self.entry(key).ok_or_else(|| {
            let (table, name) = key.parts();
            let example = match key.left_out() {
                LeftOut::Refused(example) => example,
                _ => "...",
            };
            let entry = format!("a line such as `{name} = {example}`");
            let how = match table {
                "" => format!("add {entry} at the top of the file"),
                _ if self.tables.contains(&table) => format!("add {entry} below [{table}]"),
                _ => format!("add the table [{table}], and below it {entry}"),
            };
            let others = self.missing().filter(|other| *other != key);
            let others: Vec<&str> = others.map(Key::path).collect();
            let also = match others.is_empty() {
                true => String::new(),
                false => format!("; also missing: {}", others.join(", ")),
            };
            let problem = format!("{} is missing: {how}{also}", key.path());
            ScenarioError {
                key: Some(key),
                ..ScenarioError::in_file(self.file, None, problem)
            }
        })
    }

    /// Required keys that are missing; stiffnesses are required unless sections are given.
    fn missing(&self) -> impl Iterator<Item = Key> {
        let section = self.tables.contains(&"section");
        let needed = move |key: &Key| {
            let refused = matches!(key.left_out(), LeftOut::Refused(_));
            refused
                && match key.parts().0 {
                    "" | "leaf" => true,
                    "stiffness" => !section,
                    _ => false,
                }
        };
        let keys = Key::all().filter(needed);
        keys.filter(|key| self.entries[*key as usize].is_none())
    }

    fn entry(&self, key: Key) -> Option<Item<'_>> {
        let entry = self.entries[key as usize].as_ref()?;
        Some(Item {
            key,
            list: "",
            indices: [None; 2],
            node: match &entry.value {
                EntryValue::Parsed(value) => Node::Parsed(value),
                EntryValue::Bare(value) => Node::Bare(value),
            },
            source: entry.source,
        })
    }
}

/// The value of a key, or a part of it, with its place.
#[derive(Clone, Copy)]
pub(super) struct Item<'e> {
    key: Key,
    /// Which list of a table: `at`, `value`, `factor`; otherwise empty.
    list: &'static str,
    /// Which entry of the list, and which of that, counted from 0.
    indices: [Option<usize>; 2],
    node: Node<'e>,
    source: Source<'e>,
}

impl<'e> Item<'e> {
    pub(super) fn key(&self) -> Key {
        self.key
    }

    pub(super) fn node(&self) -> Node<'e> {
        self.node
    }

    /// One of the lists of a table, if this is a table that has it.
    pub(super) fn list(&self, list: &'static str) -> Option<Item<'e>> {
        let node = self.node.named(list)?;
        Some(Item {
            list,
            node,
            ..*self
        })
    }

    /// An entry of a list; the value itself if it is not a list or too short.
    pub(super) fn entry(&self, index: usize) -> Item<'e> {
        let Some(node) = self.node.entry(index) else {
            return *self;
        };
        let indices = match self.indices {
            [None, _] => [Some(index), None],
            [first, _] => [first, Some(index)],
        };
        Item {
            indices,
            node,
            ..*self
        }
    }

    /// The two lists, `at` and `other`, of a table that may have no others. `form`
    /// describes such a table.
    pub(super) fn pair(
        &self,
        other: &'static str,
        form: &str,
    ) -> Result<[Item<'e>; 2], ScenarioError> {
        let Some(names) = self.node.names() else {
            return Err(self.refuse(format_args!("must be a table: {form}")));
        };
        let mut names = names.into_iter();
        if let Some(key) = names.find(|key| *key != "at" && *key != other) {
            let key = shorten(key);
            return Err(self.refuse(format_args!("unknown key {key}: {form}")));
        }
        let list = |name| {
            self.list(name)
                .ok_or_else(|| self.refuse(format_args!("{name} is missing: {form}")))
        };
        Ok([list("at")?, list(other)?])
    }

    /// Refuses this value unless a condition `holds`.
    pub(super) fn ensure(&self, holds: bool, problem: impl Display) -> Result<(), ScenarioError> {
        match holds {
            true => Ok(()),
            false => Err(self.refuse(problem)),
        }
    }

    pub(super) fn refuse(&self, problem: impl Display) -> ScenarioError {
        let mut part = String::new();
        if !self.list.is_empty() {
            part = format!(", {}", self.list);
        }
        part += &match self.indices.map(|index| index.unwrap_or(0) + 1) {
            _ if self.indices[0].is_none() => String::new(),
            [i, _] if self.indices[1].is_none() => format!(", entry {i}"),
            [i, j] if self.key.form() == Form::VectorInTime => {
                format!(", entry {i}, component {j}")
            }
            [i, j] => format!(", list {i}, entry {j}"),
        };
        let (path, found) = (self.key.path(), self.node.shown(self.source.text));
        ScenarioError {
            place: self.source.place(self.node.span().start),
            key: Some(self.key),
            problem: format!("{path}{part} = {found}: {problem}"),
        }
    }
}
