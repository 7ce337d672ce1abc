//! The entries of a scenario as values, and replacements of whole entries or parts of
//! them ([`EntryPath`]). A scenario with other numbers is made from these without parsing its
//! text again, which is only looked at for the places of errors.

#[cfg(test)]
mod tests;

use crate::scenario::format::error::{
    ScenarioError, ScenarioResult, SourceLocation, UNKNOWN_KEY, shorten_excerpt,
};
use crate::scenario::format::path::{EntryPath, nearest_key};
use crate::scenario::format::places::CommonPlaces;
use crate::scenario::format::source::{
    ParsedText, ScenarioSource, entry_span, multiply_numbers, number_of_value, parse_value,
    toml_error_message, value_from_parsed,
};
use crate::scenario::format::{Key, MissingKeyRule, TablePath, ValueSchema};
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
    /// How many there are of each table of [`Key::REPEATED_TABLES`].
    rows: [usize; Key::REPEATED_TABLES.len()],
    /// What places along the veins are read as, if some are so close that they are one.
    common_places: Option<Arc<CommonPlaces>>,
    pub(in crate::scenario) source: Arc<ScenarioSource>,
}

#[derive(Debug)]
struct Entry {
    value: Value,
    /// The override `KEY=VALUE` that it is from; `None`: from the source.
    override_text: Option<String>,
}

/// One of the tables of a scenario.
#[derive(Clone, Copy)]
struct TableRow {
    /// The name of the table; empty at the top.
    table: &'static str,
    /// Which of the tables of this name, counted from 0, where there may be several.
    row: usize,
}

/// Which of several tables of a name, and how many there are.
#[derive(Clone, Copy)]
struct RowOfSeveral {
    row: usize,
    rows: usize,
}

/// Where a part of an entry was written, and how.
pub(super) struct WrittenEntry {
    pub place: SourceLocation,
    pub text: String,
}

/// Entries, and what is wrong with their names.
pub(in crate::scenario) struct CollectedEntries {
    pub entries: Entries,
    pub unknown: Vec<ScenarioError>,
}

impl Entries {
    /// The entries in a text, TOML or JSON; messages call it `file`.
    ///
    /// # Errors
    /// If the text cannot be parsed.
    pub(in crate::scenario) fn collect_from_text(
        text: &str,
        file: &str,
    ) -> ScenarioResult<CollectedEntries> {
        let ParsedText { source, table } = ScenarioSource::parse(text, file)?;
        Ok(Entries::collect_from_table(source, table))
    }

    /// The entries in a table.
    pub(in crate::scenario) fn collect_from_table(
        source: ScenarioSource,
        table: Table,
    ) -> CollectedEntries {
        let mut entries = Entries {
            entries: [const { Vec::new() }; Key::COUNT],
            rows: [0; Key::REPEATED_TABLES.len()],
            common_places: None,
            source: source.into(),
        };
        let mut unknown = Vec::new();
        entries.add_table(TableRow { table: "", row: 0 }, table, &mut unknown);
        CollectedEntries { entries, unknown }
    }

    /// Adds the entries of a table, and the errors about those that have no place in it.
    fn add_table(&mut self, of: TableRow, entries: Table, errors: &mut Vec<ScenarioError>) {
        let TableRow { table, row } = of;
        for (name, value) in entries {
            let own_path = TablePath { table, name: &name };
            if let Some(known) = Key::from_table_path(own_path) {
                self.put_entry(EntryPath::whole_entry(known, row), value, None);
                continue;
            }
            let path = [table, &name].join(".");
            let path = path.trim_start_matches('.');
            match Key::table_named(path) {
                Some(inner) => self.add_inner(inner, value, errors),
                None => {
                    let meant = nearest_key(path).map(|key| format!(" (did you mean {key}?)"));
                    let (path, meant) = (shorten_excerpt(path), meant.unwrap_or_default());
                    let allowed = Key::allowed_in(table).join(", ");
                    let problem = format!("{UNKNOWN_KEY} {path}{meant}: allowed here: {allowed}");
                    errors.push(self.source.unknown_key_error(own_path, row, problem));
                }
            }
        }
    }

    /// Adds a table, or all tables of a name.
    fn add_inner(&mut self, table: &'static str, value: Value, errors: &mut Vec<ScenarioError>) {
        let repeated = Key::REPEATED_TABLES.iter().position(|name| *name == table);
        match (repeated, value) {
            (None, Value::Table(entries)) => {
                self.add_table(TableRow { table, row: 0 }, entries, errors)
            }
            (Some(which), Value::Array(list)) if list.iter().all(Value::is_table) => {
                self.rows[which] = list.len();
                for (row, value) in list.into_iter().enumerate() {
                    if let Value::Table(entries) = value {
                        self.add_table(TableRow { table, row }, entries, errors);
                    }
                }
            }
            (_, value) => errors.push(self.source.misplaced_value_error(table, &value)),
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
            let refuse = |problem: String| {
                let given = shorten_excerpt(given);
                ScenarioError::at_place(SourceLocation::Set { given }, problem)
            };
            let Some((path, text)) = given.split_once('=') else {
                let problem = "must be KEY=VALUE, as in load.gravity=[0,0,-0.5]";
                return Err(refuse(problem.into()));
            };
            let part = EntryPath::parse(path).map_err(refuse)?;
            entries.check_row(part).map_err(refuse)?;
            let text = text.trim();
            let value = parse_value(text).map(|value| value_from_parsed(&value));
            let value = match part.is_whole() {
                true => value.map_err(|error| refuse(toml_error_message(&error, text)))?,
                false => {
                    let new = value.map_err(|_| format!("{} is no value", shorten_excerpt(text)));
                    // What is too large for a number is shown as it was given.
                    let is_number =
                        |new: &Value| number_of_value(new).is_none_or(|number| !number.is_nan());
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

    /// These entries with close places along the veins made one.
    pub(in crate::scenario) fn with_common_places(&self) -> Self {
        Entries {
            common_places: CommonPlaces::of_places(self.written_places()).map(Arc::new),
            ..self.clone()
        }
    }

    /// All places along the veins that are written, and both ends of the veins.
    fn written_places(&self) -> Vec<f64> {
        let mut all = vec![0.0, 1.0];
        for key in Key::all() {
            let is_place = matches!(key, Key::PointAt | Key::GripAt);
            let is_profile = match key.form() {
                // Fractions of a blade are not those of its veins.
                ValueSchema::Quantity(_) | ValueSchema::VectorQuantity(_) => key.table() != "blade",
                _ => false,
            };
            if !is_place && !is_profile {
                continue;
            }
            let values = self.paths_of_key(key).filter_map(|it| self.value_at(it));
            for value in values {
                // One profile for all veins, or a list of one for each; numbers without knots name no place.
                let each = one_or_all(value).iter().filter_map(|it| match is_place {
                    true => Some(it),
                    false => it.get("at"),
                });
                let numbers = each.flat_map(one_or_all);
                all.extend(numbers.filter_map(number_of_value));
            }
        }
        all
    }

    /// What a place along a vein is read as.
    pub(super) fn common_place(&self, at: f64) -> f64 {
        let common = self.common_places.as_ref();
        common.map_or(at, |places| places.common_place(at))
    }

    /// The largest difference between a place along a vein and what it is read as.
    pub(in crate::scenario) fn largest_place_shift(&self) -> f64 {
        let common = self.common_places.as_ref();
        common.map_or(0.0, |places| places.largest_shift())
    }

    /// The text that the entries are from, without overrides.
    pub(crate) fn source_text(&self) -> &str {
        &self.source.text
    }

    /// All entries that are given, as TOML.
    pub(crate) fn to_toml(&self) -> String {
        let mut document = Table::new();
        for key in Key::all() {
            let TablePath { table, name } = key.table_path();
            for (row, entry) in self.entries[key as usize].iter().enumerate() {
                let Some(entry) = entry else { continue };
                let rows = self.table_count(table);
                let which = rows.map(|rows| RowOfSeveral { row, rows });
                let inner = inner_table(&mut document, table, which);
                if let Some(inner) = inner {
                    inner.insert(name.into(), entry.value.clone());
                }
            }
        }
        document.to_string()
    }

    /// How many tables of this name are given, if there may be several.
    pub(in crate::scenario) fn table_count(&self, table: &str) -> Option<usize> {
        let which = Key::REPEATED_TABLES
            .iter()
            .position(|known| *known == table)?;
        Some(self.rows[which])
    }

    /// The whole value of a key, in each of its tables.
    pub(crate) fn paths_of_key(&self, key: Key) -> impl Iterator<Item = EntryPath> {
        let table = key.table();
        let rows = self.table_count(table).unwrap_or(1);
        (0..rows).map(move |row| EntryPath::whole_entry(key, row))
    }

    /// Refuses a part of a table that is not there.
    fn check_row(&self, part: EntryPath) -> Result<(), String> {
        let table = part.key.table();
        match self.table_count(table) {
            Some(rows) if part.row >= rows => Err(format!(
                "{part}: there are {rows} of [[{table}]], counted from 0: write it first"
            )),
            _ => Ok(()),
        }
    }

    /// Where a part of an entry, which has this value, was written, and how.
    pub(super) fn written_entry(&self, part: EntryPath, value: &Value) -> WrittenEntry {
        let entry = self.entry(part.key, part.row);
        let Some(given) = entry.and_then(|entry| entry.override_text.as_ref()) else {
            let path = part.key.table_path();
            let spans = self.source.find_entry_spans(path, part.row, Some(part));
            return WrittenEntry {
                text: self.source.displayed_value(spans.as_ref(), value),
                place: self.source.location(spans.map(|spans| spans.value.start)),
            };
        };
        // The value of a part is not that of the whole entry.
        let whole = given.split_once('=').filter(|(path, _)| {
            let overridden = EntryPath::parse(path);
            overridden.is_ok_and(|overridden| overridden.is_whole())
        });
        let text = whole.map(|(_, text)| text.trim());
        let found = text.and_then(|text| text.get(entry_span(&parse_value(text).ok()?, part)));
        let found = found.map_or_else(|| shorten_excerpt(&value.to_string()), shorten_excerpt);
        let given = shorten_excerpt(given);
        WrittenEntry {
            place: SourceLocation::Set { given },
            text: found,
        }
    }

    /// Whether a value of the key is written.
    pub(in crate::scenario) fn is_given(&self, key: Key) -> bool {
        self.entry(key, 0).is_some()
    }

    /// Whether a value of the key is written in one of its tables, if there may be several.
    pub(crate) fn is_given_in_row(&self, key: Key, row: usize) -> bool {
        self.entry(key, row).is_some()
    }

    /// Whether a value of some key of this table is written.
    pub(in crate::scenario) fn has_key_of_table(&self, table: &str) -> bool {
        let mut keys = Key::all().filter(|key| key.table() == table);
        keys.any(|key| self.is_given(key))
    }

    /// A key whose value is a list with one entry for each rod, or each gap between two, if there is one.
    pub(crate) fn key_with_list_per_rod(&self) -> Option<Key> {
        let is_list_of_lists = |value: &Value| (value.get(0)).is_some_and(|first| first.is_array());
        Key::all().find(|key| {
            let Some(value) = self.entry(*key, 0).map(|entry| &entry.value) else {
                return false;
            };
            match key.form() {
                ValueSchema::PerRod(_) | ValueSchema::PerGap(_) | ValueSchema::Fan => {
                    value.is_array()
                }
                ValueSchema::Quantity(_) => {
                    value.is_array() || value.get("value").is_some_and(is_list_of_lists)
                }
                ValueSchema::VectorPerRod | ValueSchema::VectorQuantity(_) => {
                    is_list_of_lists(value)
                }
                _ => false,
            }
        })
    }

    fn entry(&self, key: Key, row: usize) -> Option<&Entry> {
        self.entries[key as usize].get(row)?.as_deref()
    }

    /// The value of a key, or its default; in one of its tables if there may be several.
    pub(super) fn given_or_default(&self, key: Key, row: usize) -> Option<&Value> {
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
    pub(in crate::scenario) fn replace_value(&mut self, key: Key, value: Option<&str>) {
        self.entries[key as usize].clear();
        let value = value.and_then(|text| parse_value(text).ok());
        if let Some(value) = value.map(|value| value_from_parsed(&value)) {
            let parts: Vec<EntryPath> = self.paths_of_key(key).collect();
            for part in parts {
                self.put_entry(part, value.clone(), None);
            }
        }
    }

    /// The value at a path, if there is one.
    pub(crate) fn value_at(&self, part: EntryPath) -> Option<&Value> {
        self.check_row(part).ok()?;
        let mut place = self.given_or_default(part.key, part.row)?;
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
            if number_of_value(place).is_none() {
                place = place.get(index)?;
            }
        }
        Some(place)
    }

    /// The number that a part is, if any; that of a scale is 1.
    pub(crate) fn number_at(&self, part: EntryPath) -> Option<f64> {
        match part.scale {
            true => Some(1.0),
            false => number_of_value(self.value_at(part)?),
        }
    }

    /// Whether a factor changes any number of a part, or is refused.
    pub(crate) fn is_scalable(&self, part: EntryPath) -> bool {
        let times = |factor| self.replaced_value(part, Value::Float(factor));
        times(1.0) != times(2.0) || times(1.0).is_err()
    }

    /// The whole value of a key after a part of it is replaced.
    fn replaced_value(&self, part: EntryPath, new: Value) -> Result<Value, String> {
        let whole = self.given_or_default(part.key, part.row);
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
                let component = part
                    .check_is_number()
                    .err()
                    .filter(|_| number_of_value(&new).is_some());
                let there = || format!("there are {count} entries, and indices count from 0");
                component.unwrap_or_else(there)
            })?;
        }
        match part.scale {
            true => {
                let factor = number_of_value(&new).filter(|factor| factor.is_finite());
                multiply_numbers(place, factor.ok_or("the factor must be a finite number")?)?;
            }
            false => *place = new,
        }
        Ok(whole)
    }

    /// Turns a single number or vector for all rods, or gaps, into a list.
    fn expand_to_list(&self, part: EntryPath, place: &mut Value) -> Result<(), String> {
        if number_of_value(place).is_some() || part.shared_indices(place) > 0 {
            let rods = self
                .given_or_default(Key::Rods, 0)
                .and_then(Value::as_integer);
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
            MissingKeyRule::Default(text) => parse_value(text)
                .ok()
                .map(|value| value_from_parsed(&value)),
            _ => None,
        };
        Key::all().map(value).collect()
    });
    VALUES[key as usize].as_ref()
}

/// A table of a document, or one of several, made where it is not there yet.
fn inner_table<'d>(
    document: &'d mut Table,
    path: &str,
    which: Option<RowOfSeveral>,
) -> Option<&'d mut Table> {
    let TablePath { table: outer, name } = TablePath::split(path);
    if name.is_empty() {
        return Some(document);
    }
    let outer = inner_table(document, outer, None)?;
    let inner = outer.entry(name);
    match which {
        None => inner.or_insert_with(|| Table::new().into()).as_table_mut(),
        Some(RowOfSeveral { row, rows }) => {
            let rows = || Value::Array(vec![Table::new().into(); rows]);
            inner.or_insert_with(rows).get_mut(row)?.as_table_mut()
        }
    }
}

/// The values of a list, or the value that is none.
fn one_or_all(value: &Value) -> &[Value] {
    value
        .as_array()
        .map_or(std::slice::from_ref(value), Vec::as_slice)
}
