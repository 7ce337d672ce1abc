//! A scenario as written: which key has which value, and where it stands.
//! Nothing here knows what the values mean.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{Form, Needed, Place, Problem, ScenarioError, Spot, line_of, shorten, snippet};
use super::key::{Key, TABLES, nearest};

/// All entries of a scenario, those of `--set` in place of the file's.
pub(super) struct Raw<'a> {
    file: &'a str,
    entries: [Option<Entry<'a>>; Key::COUNT],
    /// Which tables the file has.
    tables: Vec<&'static str>,
}

struct Entry<'a> {
    value: Spanned<DeValue<'a>>,
    source: Source<'a>,
}

/// The text an entry was read from; spans count in `text`.
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
}

impl Source<'_> {
    fn place(&self, at: usize) -> Place {
        match self.origin {
            Origin::File(file) => Place::Line {
                file: file.to_string(),
                line: line_of(self.text.as_bytes(), at),
            },
            Origin::Set(given) => Place::Set {
                given: shorten(given),
            },
        }
    }

    fn found(&self, value: &Spanned<DeValue>) -> String {
        shorten(self.text.get(value.span()).unwrap_or(""))
    }

    fn syntax(&self, error: &toml::de::Error) -> ScenarioError {
        let span = error.span().unwrap_or(0..0);
        let snippet = match self.origin {
            Origin::File(_) => snippet(self.text, span.clone()),
            Origin::Set(_) => String::new(),
        };
        ScenarioError::Syntax {
            place: self.place(span.start),
            message: error.message().to_string(),
            snippet,
        }
    }

    fn unknown_key(&self, key: &Spanned<std::borrow::Cow<'_, str>>, table: &str) -> ScenarioError {
        let name = key.get_ref();
        let path = if table.is_empty() {
            name.to_string()
        } else {
            format!("{table}.{name}")
        };
        ScenarioError::UnknownKey {
            place: self.place(key.span().start),
            meant: nearest(&path),
            key: shorten(&path),
            allowed: Key::allowed_in(table),
            snippet: snippet(self.text, key.span()),
        }
    }
}

impl<'a> Raw<'a> {
    /// Reads `text`, then lays the `KEY=VALUE` of `overrides` over it.
    pub(super) fn parse(
        text: &'a str,
        file: &'a str,
        overrides: &'a [String],
    ) -> Result<Raw<'a>, ScenarioError> {
        let mut raw = Raw {
            file,
            entries: [const { None }; Key::COUNT],
            tables: Vec::new(),
        };
        let source = Source {
            text,
            origin: Origin::File(file),
        };
        let document = DeTable::parse(text).map_err(|error| source.syntax(&error))?;
        raw.read_table(document.into_inner(), "", source)?;
        for given in overrides {
            raw.set(given)?;
        }
        Ok(raw)
    }

    fn read_table(
        &mut self,
        table: DeTable<'a>,
        name: &'static str,
        source: Source<'a>,
    ) -> Result<(), ScenarioError> {
        for (key, value) in table {
            let here = |known: &&Key| {
                known.table() == name && known.short_name() == key.get_ref().as_ref()
            };
            if let Some(known) = Key::all().find(|known| here(&known)) {
                self.entries[known as usize] = Some(Entry { value, source });
            } else if let Some(inner) = TABLES
                .into_iter()
                .find(|table| name.is_empty() && table == key.get_ref())
            {
                let found = source.found(&value);
                let DeValue::Table(table) = value.into_inner() else {
                    return Err(ScenarioError::NotATable {
                        place: source.place(key.span().start),
                        table: inner,
                        found,
                        allowed: Key::allowed_in(inner),
                    });
                };
                self.tables.push(inner);
                self.read_table(table, inner, source)?;
            } else {
                return Err(source.unknown_key(&key, name));
            }
        }
        Ok(())
    }

    /// Takes one `KEY=VALUE`. The value is TOML; what cannot be is taken as text.
    fn set(&mut self, given: &'a str) -> Result<(), ScenarioError> {
        let Some((path, text)) = given.split_once('=') else {
            return Err(ScenarioError::NotAnOverride {
                given: shorten(given),
            });
        };
        let (path, text) = (path.trim(), text.trim());
        let source = Source {
            text,
            origin: Origin::Set(given),
        };
        let Some(key) = Key::from_path(path) else {
            return Err(ScenarioError::UnknownKey {
                place: source.place(0),
                meant: nearest(path),
                key: shorten(path),
                allowed: Key::all().map(Key::path).collect(),
                snippet: String::new(),
            });
        };
        let value = match DeValue::parse(text) {
            Ok(value) => value,
            Err(error) if text.is_empty() || text.starts_with(['[', '{', '"', '\'']) => {
                return Err(source.syntax(&error));
            }
            Err(_) => Spanned::new(0..text.len(), DeValue::String(text.into())),
        };
        self.entries[key as usize] = Some(Entry { value, source });
        Ok(())
    }

    /// The value of a key that may be left out.
    pub(super) fn optional(&self, key: Key) -> Option<Item<'_>> {
        let entry = self.entries[key as usize].as_ref()?;
        Some(Item {
            key,
            spot: Spot::Whole,
            value: &entry.value,
            source: entry.source,
        })
    }

    /// The value of a key that must be there.
    pub(super) fn required(&self, key: Key) -> Result<Item<'_>, ScenarioError> {
        self.optional(key).ok_or_else(|| ScenarioError::Missing {
            file: self.file.to_string(),
            key,
            has_table: self.tables.contains(&key.table()),
        })
    }
}

/// A value, or a part of one, that knows where it stands.
#[derive(Clone, Copy)]
pub(super) struct Item<'e> {
    key: Key,
    spot: Spot,
    value: &'e Spanned<DeValue<'e>>,
    source: Source<'e>,
}

impl<'e> Item<'e> {
    pub(super) fn value(&self) -> &'e DeValue<'e> {
        self.value.get_ref()
    }

    /// A part of this value.
    pub(super) fn part(&self, spot: Spot, value: &'e Spanned<DeValue<'e>>) -> Item<'e> {
        Item {
            spot,
            value,
            ..*self
        }
    }

    /// The two parts of a table that has no others.
    pub(super) fn pair(
        &self,
        names: [(&'static str, Spot); 2],
        form: Form,
    ) -> Result<[Item<'e>; 2], ScenarioError> {
        let DeValue::Table(table) = self.value() else {
            return Err(self.refuse(Problem::WrongType {
                needed: Needed::Table(form),
            }));
        };
        if let Some(key) = table
            .keys()
            .find(|key| names.iter().all(|(name, _)| name != key.get_ref()))
        {
            let key = shorten(key.get_ref());
            return Err(self.refuse(Problem::UnknownPart { key, form }));
        }
        let part = |(key, spot)| match table.get(key) {
            Some(value) => Ok(self.part(spot, value)),
            None => Err(self.refuse(Problem::MissingPart { key, form })),
        };
        let [first, second] = names;
        Ok([part(first)?, part(second)?])
    }

    /// The part that belongs to one rod or gap, where there is one.
    pub(super) fn entry(&self, index: usize) -> Item<'e> {
        match self.value().get(index) {
            Some(value) => self.part(Spot::Entry(index), value),
            None => *self,
        }
    }

    pub(super) fn array(
        &self,
        needed: Needed,
    ) -> Result<&'e [Spanned<DeValue<'e>>], ScenarioError> {
        match self.value() {
            DeValue::Array(array) => Ok(array),
            _ => Err(self.refuse(Problem::WrongType { needed })),
        }
    }

    pub(super) fn refuse(&self, problem: Problem) -> ScenarioError {
        ScenarioError::Value {
            place: self.source.place(self.value.span().start),
            key: self.key,
            spot: self.spot,
            found: self.source.found(self.value),
            problem: Box::new(problem),
        }
    }
}
