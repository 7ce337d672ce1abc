//! The entries of a scenario as values, and replacements of whole entries or parts of
//! them ([`Part`]). A scenario with other numbers is made from these without parsing its
//! text again, which is only looked at for the places of errors.
//!
//! Parts of a scenario's entries: `load.gravity[2]`, `stiffness.bending_2.value[1]`,
//! `load.point[0].force[2]`, or all numbers of one together, `scale:stiffness.bending_2`.

#[cfg(test)]
mod tests;

use crate::scenario::format::source::{
    ScenarioError, ScenarioResult, ScenarioSource, SourceLocation, entry_span, multiply, number,
    parse, shorten, toml_error_message, value_from_parsed,
};
use crate::scenario::format::{
    Key, MissingKeyRule, ValueSchema, nearest_key, split, unknown_key_message,
};
use std::fmt;
use std::sync::{Arc, LazyLock};
use toml::{Table, Value};

/// Most rods: a leaf of 100,000 rods and eight segments already has five
/// million unknowns.
pub const MOST_RODS: usize = 100_000;

/// The entries given in a scenario, by their keys.
///
/// ```
/// use leafdyn::scenario::Entries;
///
/// let text = "name = 'rod'\nleaf = { rods = 1, length = 1.0, fan = [0.0] }";
/// let entries = Entries::from_text(text, "rod.toml")?;
/// assert!(entries.check().is_err(), "not all that is needed");
/// assert!(entries.replaced(&["leaf.rod=2".into()]).is_err(), "no key");
/// # Ok::<(), leafdyn::scenario::ScenarioError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Entries {
    /// The entries of each key: one, or one for each of its tables if there may be several.
    entries: [Vec<Option<Arc<Entry>>>; Key::COUNT],
    /// How many there are of each table of [`REPEATED_TABLES`].
    rows: [usize; Key::REPEATED_TABLES.len()],
    pub(in crate::scenario) source: Arc<ScenarioSource>,
}

#[derive(Debug)]
struct Entry {
    value: Value,
    /// The override `KEY=VALUE` that it is from; `None`: from the source.
    override_text: Option<String>,
}

impl Entries {
    /// The entries in a text, TOML or JSON; messages call it `file`.
    ///
    /// # Errors
    /// If it cannot be parsed, or has an unknown key.
    pub fn from_text(text: &str, file: &str) -> ScenarioResult<Self> {
        let (source, table) = ScenarioSource::parse(text, file)?;
        Entries::from_source(source, table)
    }

    /// The entries in a table of the same form, without a text.
    ///
    /// # Errors
    /// If it has an unknown key.
    pub fn from_table(table: Table) -> ScenarioResult<Self> {
        Entries::from_source(ScenarioSource::default(), table)
    }

    fn from_source(source: ScenarioSource, table: Table) -> ScenarioResult<Self> {
        let mut entries = Entries {
            entries: [const { Vec::new() }; Key::COUNT],
            rows: [0; Key::REPEATED_TABLES.len()],
            source: source.into(),
        };
        let mut unknown = Vec::new();
        entries.add(("", 0), table, &mut unknown);
        let mut unknown = unknown.into_iter();
        match unknown.next() {
            None => Ok(entries),
            Some(first) => {
                let others = unknown.chain(entries.value_errors()).collect();
                Err(ScenarioError { others, ..first })
            }
        }
    }

    /// Adds the entries of a table, whose name is empty at the top, or of one of several, and the
    /// errors about those that have no place in it.
    fn add(
        &mut self,
        (name, row): (&'static str, usize),
        table: Table,
        errors: &mut Vec<ScenarioError>,
    ) {
        for (key, value) in table {
            if let Some(known) = Key::from_parts(name, &key) {
                self.put_entry(EntryPath::whole_entry(known, row), value, None);
                continue;
            }
            let path = [name, &key].join(".");
            let path = path.trim_start_matches('.');
            match Key::table(path) {
                Some(inner) => self.add_inner(inner, value, errors),
                None => {
                    let meant = nearest_key(path).map(|key| format!(" (did you mean {key}?)"));
                    let (path, meant) = (shorten(path), meant.unwrap_or_default());
                    let allowed = Key::allowed_in(name).join(", ");
                    let problem = format!("unknown key {path}{meant}: allowed here: {allowed}");
                    errors.push(self.source.unknown_key_error((name, &key), row, problem));
                }
            }
        }
    }

    /// Adds a table, or all those of a name.
    fn add_inner(&mut self, name: &'static str, value: Value, errors: &mut Vec<ScenarioError>) {
        let repeated = Key::REPEATED_TABLES.iter().position(|table| *table == name);
        match (repeated, value) {
            (None, Value::Table(table)) => self.add((name, 0), table, errors),
            (Some(which), Value::Array(list)) if list.iter().all(Value::is_table) => {
                self.rows[which] = list.len();
                for (row, value) in list.into_iter().enumerate() {
                    if let Value::Table(table) = value {
                        self.add((name, row), table, errors);
                    }
                }
            }
            (_, value) => errors.push(self.source.misplaced_value_error(name, &value)),
        }
    }

    /// These entries with some of them, or parts of them, replaced, as in
    /// [`Scenario::from_toml_with`](crate::scenario::Scenario::from_toml_with).
    ///
    /// # Errors
    /// If one cannot be.
    pub fn replaced(&self, overrides: &[String]) -> ScenarioResult<Self> {
        let mut entries = self.clone();
        for given in overrides {
            let refuse = |problem: String| ScenarioError {
                place: SourceLocation::Set {
                    given: shorten(given),
                },
                key: None,
                problem,
                others: Vec::new(),
            };
            let Some((path, text)) = given.split_once('=') else {
                let problem = "must be KEY=VALUE, as in load.gravity=[0,0,-0.5]";
                return Err(refuse(problem.into()));
            };
            let part = EntryPath::parse(path).map_err(refuse)?;
            entries.check_row(part).map_err(refuse)?;
            let text = text.trim();
            let value = parse(text).map(|value| value_from_parsed(&value));
            let value = match part.is_whole() {
                true => value.map_err(|error| refuse(toml_error_message(&error, text)))?,
                false => {
                    let new = value.map_err(|_| format!("{} is no value", shorten(text)));
                    // What is too large for a number is shown as it was given.
                    let is_number = |new: &Value| number(new).is_none_or(|number| !number.is_nan());
                    let new = new.map(|new| match is_number(&new) || text.contains("nan") {
                        true => new,
                        false => text.into(),
                    });
                    let whole = new.and_then(|new| entries.replaced_value(part, new));
                    whole.map_err(|why| ScenarioError {
                        key: Some(part.key),
                        ..refuse(format!("{part}: {why}"))
                    })?
                }
            };
            entries.put_entry(part, value, Some(given.clone()));
        }
        Ok(entries)
    }

    /// The text that they are from, without overrides.
    pub(crate) fn text(&self) -> &str {
        &self.source.text
    }

    /// All that are given, as TOML.
    pub(crate) fn to_toml(&self) -> String {
        let mut document = Table::new();
        for key in Key::all() {
            let (table, name) = key.table_and_name();
            for (row, entry) in self.entries[key as usize].iter().enumerate() {
                let Some(entry) = entry else { continue };
                let rows = self.table_count(table);
                let inner = inner_table(&mut document, table, rows.map(|rows| (row, rows)));
                if let Some(inner) = inner {
                    inner.insert(name.into(), entry.value.clone());
                }
            }
        }
        document.to_string()
    }

    /// How many there are of a table, if there may be several.
    pub(in crate::scenario) fn table_count(&self, table: &str) -> Option<usize> {
        let which = Key::REPEATED_TABLES
            .iter()
            .position(|known| *known == table)?;
        Some(self.rows[which])
    }

    /// The whole value of a key, in each of its tables.
    pub(crate) fn parts(&self, key: Key) -> impl Iterator<Item = EntryPath> {
        let (table, _) = key.table_and_name();
        let rows = self.table_count(table).unwrap_or(1);
        (0..rows).map(move |row| EntryPath::whole_entry(key, row))
    }

    /// Refuses a part of a table that is not there.
    fn check_row(&self, part: EntryPath) -> std::result::Result<(), String> {
        let (table, _) = part.key.table_and_name();
        match self.table_count(table) {
            Some(rows) if part.row >= rows => Err(format!(
                "{part}: there are {rows} of [[{table}]], counted from 0: write it first"
            )),
            _ => Ok(()),
        }
    }

    /// Where a part of an entry is written, and how.
    pub(in crate::scenario) fn entry_location(
        &self,
        part: EntryPath,
        value: &Value,
    ) -> (SourceLocation, String) {
        let entry = self.entry(part.key, part.row);
        let Some(given) = entry.and_then(|entry| entry.override_text.as_ref()) else {
            let spans =
                self.source
                    .find_entry_spans(part.key.table_and_name(), part.row, Some(part));
            let found = self.source.displayed_value(spans.as_ref(), value);
            return (
                self.source.location(spans.map(|spans| spans.value.start)),
                found,
            );
        };
        // The value of a part is not that of the whole entry.
        let whole = given.split_once('=').filter(|(path, _)| {
            let overridden = EntryPath::parse(path);
            overridden.is_ok_and(|overridden| overridden.is_whole())
        });
        let text = whole.map(|(_, text)| text.trim());
        let found = text.and_then(|text| text.get(entry_span(&parse(text).ok()?, part)));
        let found = found.map_or_else(|| shorten(&value.to_string()), shorten);
        let given = shorten(given);
        (SourceLocation::Set { given }, found)
    }

    pub(in crate::scenario) fn is_given(&self, key: Key) -> bool {
        self.entry(key, 0).is_some()
    }

    fn entry(&self, key: Key, row: usize) -> Option<&Entry> {
        self.entries[key as usize].get(row)?.as_deref()
    }

    /// The value of a key, or its default; in one of its tables if there may be several.
    pub(in crate::scenario) fn get(&self, key: Key, row: usize) -> Option<&Value> {
        let entry = self.entry(key, row);
        entry
            .map(|entry| &entry.value)
            .or_else(|| default_value(key))
    }

    fn put_entry(&mut self, part: EntryPath, value: Value, given: Option<String>) {
        let rows = &mut self.entries[part.key as usize];
        if rows.len() <= part.row {
            rows.resize(part.row + 1, None);
        }
        rows[part.row] = Some(Arc::new(Entry {
            value,
            override_text: given,
        }));
    }

    /// Replaces a key in each of its tables by this value, as TOML, or by none.
    pub(in crate::scenario) fn replace(&mut self, key: Key, value: Option<&str>) {
        self.entries[key as usize].clear();
        let value = value.and_then(|text| parse(text).ok());
        if let Some(value) = value.map(|value| value_from_parsed(&value)) {
            let parts: Vec<EntryPath> = self.parts(key).collect();
            for part in parts {
                self.put_entry(part, value.clone(), None);
            }
        }
    }

    pub(crate) fn value_at(&self, part: EntryPath) -> Option<&Value> {
        self.check_row(part).ok()?;
        let mut place = self.get(part.key, part.row)?;
        if let Some(list) = part.list {
            place = place.get(list)?;
        }
        for index in part
            .indices
            .into_iter()
            .flatten()
            .skip(part.shared_indices(place))
        {
            // A single number holds for all rods.
            if number(place).is_none() {
                place = place.get(index)?;
            }
        }
        Some(place)
    }

    /// The number that a part is, if any; that of a scale is 1.
    pub(crate) fn number_at(&self, part: EntryPath) -> Option<f64> {
        match part.scale {
            true => Some(1.0),
            false => number(self.value_at(part)?),
        }
    }

    /// Whether a factor changes any of its numbers, or is refused.
    pub(crate) fn is_scalable(&self, part: EntryPath) -> bool {
        let times = |factor| self.replaced_value(part, Value::Float(factor));
        times(1.0) != times(2.0) || times(1.0).is_err()
    }

    /// The whole value of a key after a part of it is replaced.
    fn replaced_value(&self, part: EntryPath, new: Value) -> std::result::Result<Value, String> {
        let whole = self.get(part.key, part.row);
        let mut whole = whole
            .cloned()
            .ok_or("is not in the scenario: write it first")?;
        let mut place = &mut whole;
        if let Some(list) = part.list {
            let found = place.get_mut(list);
            place = found.ok_or(format!("the scenario has no {list} there: write it first"))?;
        } else if part.indices[0].is_some() {
            self.expand_to_list(part, place)?;
        }
        for index in part.indices.into_iter().flatten() {
            let entries = place.as_array_mut().ok_or("is no list in the scenario")?;
            let count = entries.len();
            let entry = entries.get_mut(index);
            place = entry.ok_or_else(|| {
                let component = part.is_number().err().filter(|_| number(&new).is_some());
                let there = || format!("there are {count} entries, and indices count from 0");
                component.unwrap_or_else(there)
            })?;
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

    /// Turns a single number or vector for all rods, or gaps, into a list.
    fn expand_to_list(
        &self,
        part: EntryPath,
        place: &mut Value,
    ) -> std::result::Result<(), String> {
        if number(place).is_some() || part.shared_indices(place) > 0 {
            let rods = self.get(Key::Rods, 0).and_then(Value::as_integer);
            let rods = rods.and_then(|rods| usize::try_from(rods).ok());
            let rods = rods.filter(|rods| *rods <= MOST_RODS);
            let rods = rods.ok_or("leaf.rods must say of how many")?;
            let count = match part.key.form() {
                ValueSchema::PerGap(_) => rods.saturating_sub(1),
                _ => rods,
            };
            *place = Value::Array(vec![place.clone(); count]);
        }
        Ok(())
    }
}

/// The default value of a key that is left out, if it has one.
fn default_value(key: Key) -> Option<&'static Value> {
    static VALUES: LazyLock<Vec<Option<Value>>> = LazyLock::new(|| {
        let value = |key: Key| match key.missing_key_rule() {
            MissingKeyRule::Default(text) => {
                parse(text).ok().map(|value| value_from_parsed(&value))
            }
            _ => None,
        };
        Key::all().map(value).collect()
    });
    VALUES[key as usize].as_ref()
}

/// A table of a document, or one of several (which, and how many there are); made where it is not
/// there yet.
fn inner_table<'d>(
    document: &'d mut Table,
    path: &str,
    row: Option<(usize, usize)>,
) -> Option<&'d mut Table> {
    let (outer, name) = split(path);
    if name.is_empty() {
        return Some(document);
    }
    let outer = inner_table(document, outer, None)?;
    let inner = outer.entry(name);
    match row {
        None => inner.or_insert_with(|| Table::new().into()).as_table_mut(),
        Some((row, rows)) => {
            let rows = || Value::Array(vec![Table::new().into(); rows]);
            inner.or_insert_with(rows).get_mut(row)?.as_table_mut()
        }
    }
}

/// Lists that a table can have.
const LIST_NAMES: [&str; 3] = ["at", "value", "factor"];

const COMPONENT_INDICES_HINT: &str = "x, y, z have the indices 0, 1, 2";

/// The target of an override: an entry of a scenario, one of its lists, one entry of
/// that, or all numbers of one of these, which are then multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EntryPath {
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

impl EntryPath {
    /// The whole value of a key in one of its tables.
    pub(in crate::scenario) fn whole_entry(key: Key, row: usize) -> EntryPath {
        EntryPath {
            key,
            row,
            list: None,
            indices: [None; 3],
            scale: false,
        }
    }

    /// Parses a part; an error says what is wrong.
    pub(crate) fn parse(text: &str) -> Result<EntryPath, String> {
        let (scale, rest) = match text.trim().strip_prefix("scale:") {
            Some(rest) => (true, rest.trim()),
            None => (false, text.trim()),
        };
        let (row, path, brackets) = split_row(rest)?;
        let (key, list) = match Key::from_path(&path) {
            Some(key) => (key, None),
            None => {
                let list = path.rsplit_once('.').and_then(|(path, name)| {
                    let list = LIST_NAMES.into_iter().find(|list| *list == name)?;
                    Some((Key::from_path(path)?, Some(list)))
                });
                list.ok_or_else(|| unknown_key_message(&path))?
            }
        };
        let mut indices = [None; 3];
        for (place, index) in brackets.split_terminator(']').enumerate() {
            let index = index.trim().strip_prefix('[').ok_or_else(invalid_index)?;
            *indices.get_mut(place).ok_or_else(invalid_index)? = Some(parse_index(index)?);
        }
        if indices[2].is_some() && key.form() != ValueSchema::VectorQuantity {
            return Err(invalid_index());
        }
        if !brackets.is_empty() && !brackets.ends_with(']') {
            return Err(invalid_index());
        }
        let part = EntryPath {
            key,
            row: row.unwrap_or(0),
            list,
            indices,
            scale,
        };
        if row.is_none() && key.is_repeated() {
            let (table, name) = key.table_and_name();
            return Err(format!("say which one, counted from 0: {table}[0].{name}"));
        }
        part.check_form()?;
        Ok(part)
    }

    /// Refuses parts that entries of this form do not have.
    fn check_form(&self) -> Result<(), String> {
        let (form, path, index) = (self.key.form(), self.key.path(), self.indices[0]);
        let single = matches!(
            form,
            ValueSchema::Text | ValueSchema::Switch | ValueSchema::Whole
        );
        match form {
            _ if single && self.scale => Err("has no numbers that could be scaled".into()),
            ValueSchema::Whole | ValueSchema::Number(_) if index.is_some() => {
                Err("is one number: leave the index out".into())
            }
            ValueSchema::Text | ValueSchema::Switch if index.is_some() => {
                Err("has no entries".into())
            }
            ValueSchema::Vector if index > Some(2) => Err(COMPONENT_INDICES_HINT.into()),
            ValueSchema::VectorPerRod if self.indices[1] > Some(2) => {
                Err(COMPONENT_INDICES_HINT.into())
            }
            ValueSchema::Quantity(_) | ValueSchema::Outline(_) | ValueSchema::VectorQuantity => {
                Ok(())
            }
            ValueSchema::VectorInTime | ValueSchema::VectorOrInTime | ValueSchema::FactorInTime => {
                Ok(())
            }
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
            ValueSchema::Text | ValueSchema::Switch => {
                Err("takes no number that could vary".into())
            }
            ValueSchema::VectorInTime | ValueSchema::FactorInTime if self.list.is_none() => Err(
                format!("takes no number that could vary; its entries do: {path}.at[0]"),
            ),
            ValueSchema::Vector
            | ValueSchema::VectorOrInTime
            | ValueSchema::Fan
            | ValueSchema::Pixel
                if self.indices[0].is_none() =>
            {
                list()
            }
            ValueSchema::VectorPerRod | ValueSchema::VectorQuantity
                if self.indices[0].is_none() =>
            {
                list()
            }
            // One index is that of a component, two are those of a rod and a component.
            ValueSchema::VectorPerRod | ValueSchema::VectorQuantity
                if self.list.is_none() && self.indices[1].or(self.indices[0]) > Some(2) =>
            {
                Err(COMPONENT_INDICES_HINT.into())
            }
            _ if self.list.is_some() && self.indices[0].is_none() => list(),
            _ => Ok(()),
        }
    }

    /// Whether it is the whole value of its key.
    pub(in crate::scenario) fn is_whole(&self) -> bool {
        self.list.is_none() && self.indices[0].is_none() && !self.scale
    }

    /// Whether it is where nodes must be, on the way from the base to the tip.
    pub(crate) fn is_node_position(&self) -> bool {
        self.list == Some("at") || matches!(self.key, Key::PointAt | Key::GripAt)
    }

    /// Of a vector for each rod, how many of its indices are in vain where one value holds for all.
    pub(in crate::scenario) fn shared_indices(&self, value: &Value) -> usize {
        let is_vector = matches!(
            self.key.form(),
            ValueSchema::VectorPerRod | ValueSchema::VectorQuantity
        );
        if !is_vector || value.is_table() || self.list == Some("at") {
            return 0;
        }
        let wanted = self.indices.iter().flatten().count();
        let depth = std::iter::successors(Some(value), |value| value.get(0)).count() - 1;
        wanted.saturating_sub(depth)
    }

    /// Splits it into parts that are numbers, given its value: every entry of a list or a
    /// profile.
    pub(crate) fn numbers(self, value: &Value) -> Vec<EntryPath> {
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
                    EntryPath { list, ..self }.numbers(value)
                }
                None => vec![self],
            },
            _ => vec![self],
        }
    }

    /// Whether both contain some number.
    pub(crate) fn overlaps(&self, other: &EntryPath) -> bool {
        let same =
            |one: Option<usize>, two: Option<usize>| one.is_none() || two.is_none() || one == two;
        let lists = self.list.is_none() || other.list.is_none() || self.list == other.list;
        let mut pairs = self.indices.iter().zip(other.indices);
        (self.key, self.row) == (other.key, other.row)
            && lists
            && pairs.all(|(one, two)| same(*one, two))
    }
}

impl fmt::Display for EntryPath {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let scale = if self.scale { "scale:" } else { "" };
        match self.key.table_and_name() {
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
    let named = Key::REPEATED_TABLES
        .iter()
        .find_map(|table| Some((table, within(table)?)));
    let (row, outer, rest) = match named {
        Some((table, (row, rest))) => {
            let row = parse_index(row)?;
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

fn parse_index(index: &str) -> Result<usize, String> {
    index.trim().parse().map_err(|_| invalid_index())
}

fn invalid_index() -> String {
    "an index is a whole number from 0, as in load.gravity[2]".into()
}
