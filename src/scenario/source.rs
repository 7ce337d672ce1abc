//! The text of a scenario, TOML or JSON: its values, and the places of errors in it.

use std::ops::Range;

use serde::Deserialize;
use serde_json::Value as Json;
use toml::de::{DeTable, DeValue, Error};
use toml::{Spanned, Table, Value};

use super::error::{Place, ScenarioResult, ScenarioError};
use super::excerpt::{line_of, shorten, snippet};
use super::key::{Key, split};
use super::part::Part;
use super::spelling::brackets;
use super::values::number_meant_in;

/// Where the entries of a scenario are from.
#[derive(Clone, Debug, Default)]
pub(super) struct Source {
    /// The name of the text in messages.
    pub file: String,
    pub text: String,
    /// Whether errors have lines: not those in JSON, nor without a text.
    has_lines: bool,
    /// The tables that it has, also empty ones.
    pub tables: Vec<&'static str>,
}

/// The places of a key and of its value in the text.
pub(super) struct Spans {
    pub key: Range<usize>,
    pub value: Range<usize>,
}

impl Source {
    /// Parses TOML, or the JSON of a scenario or of a result with its `input`.
    pub fn parse(text: &str, file: &str) -> ScenarioResult<(Source, Table)> {
        // A mark that some editors write.
        let text = text.trim_start_matches('\u{feff}');
        let mut source = Source {
            file: file.into(),
            text: text.into(),
            // No TOML begins like this.
            has_lines: !text.trim_start().starts_with('{'),
            tables: Vec::new(),
        };
        let table = match source.has_lines {
            true => match DeTable::parse(text) {
                Ok(table) => table_of(table.get_ref()),
                Err(error) => {
                    let span = error.span().unwrap_or(0..0);
                    let problem = not_toml(&error, text) + &snippet(text, span.clone());
                    return Err(source.refuse(Some(span), problem));
                }
            },
            false => from_json(text, file)?,
        };
        source.tables = Key::tables();
        (source.tables).retain(|name| table.get(*name).is_some_and(Value::is_table));
        Ok((source, table))
    }

    /// The places of a key, and of its value or a part of that; in one of its tables if there are
    /// several.
    pub fn find(
        &self,
        (table, name): (&str, &str),
        row: usize,
        part: Option<Part>,
    ) -> Option<Spans> {
        let document = self.has_lines.then(|| DeTable::parse(&self.text).ok());
        let document = document??.into_inner();
        let mut entries = &document;
        for inner in table.split('.').filter(|inner| !inner.is_empty()) {
            let inner = entries.get(inner)?.get_ref();
            entries = match inner.as_array() {
                Some(tables) => tables.get(row)?.get_ref().as_table()?,
                None => inner.as_table()?,
            };
        }
        let (key, value) = entries.get_key_value(name)?;
        Some(Spans {
            key: key.span(),
            value: part.map_or(value.span(), |part| span_of(value, part)),
        })
    }

    /// A value as it is written, shortened.
    pub fn shown(&self, spans: Option<&Spans>, value: &Value) -> String {
        let written = spans.and_then(|spans| self.text.get(spans.value.clone()));
        written.map_or_else(|| shorten(&value.to_string()), shorten)
    }

    pub fn place(&self, at: Option<usize>) -> Place {
        Place::File {
            file: self.file.clone(),
            line: at.map(|at| line_of(self.text.as_bytes(), at)),
        }
    }

    /// An error that is not about the value of a key.
    fn refuse(&self, span: Option<Range<usize>>, problem: String) -> ScenarioError {
        ScenarioError {
            place: self.place(span.map(|span| span.start)),
            key: None,
            problem,
            others: Vec::new(),
        }
    }

    /// The error about a key that is none of the format, with its line.
    pub fn refuse_key(&self, parts: (&str, &str), row: usize, problem: String) -> ScenarioError {
        let span = self.find(parts, row, None).map(|spans| spans.key);
        let line = span.clone().map(|span| snippet(&self.text, span));
        self.refuse(span, problem + &line.unwrap_or_default())
    }

    /// The error about a value in place of a table, or of several.
    pub fn refuse_value(&self, table: &str, value: &Value) -> ScenarioError {
        let spans = self.find(split(table), 0, None);
        let found = self.shown(spans.as_ref(), value);
        let allowed = Key::allowed_in(table).join(", ");
        let (open, close) = brackets(table);
        let kind = match open.len() {
            1 => "a table",
            _ => "one table or several",
        };
        let problem = format!(
            "{table} = {found}: must be {kind}: write {open}{table}{close} on a line of its own, below it {allowed}"
        );
        self.refuse(spans.map(|spans| spans.key), problem)
    }
}

/// Why `text` is no TOML.
pub(super) fn not_toml(error: &Error, text: &str) -> String {
    let line = error
        .span()
        .map(|span| line_of(text.as_bytes(), span.start));
    let line = line.and_then(|line| text.lines().nth(line - 1));
    let meant = line.and_then(number_meant_in);
    let meant = meant.map_or(String::new(), |meant| format!(": {meant}"));
    format!("not valid TOML: {}{meant}", error.message())
}

/// The place of a part of a value, or of as much of it as there is.
pub(super) fn span_of(value: &Spanned<DeValue>, part: Part) -> Range<usize> {
    let mut place = value;
    if let Some(list) = part.list {
        place = place.get_ref().get(list).unwrap_or(place);
    }
    for index in part.indices.into_iter().flatten() {
        place = place.get_ref().get(index).unwrap_or(place);
    }
    place.span()
}

fn table_of(table: &DeTable) -> Table {
    let entries = table.iter();
    let entries = entries.map(|(name, value)| (name.get_ref().to_string(), value_of(value)));
    entries.collect()
}

/// The value that was parsed. A number that is too large to be one is NaN; a whole number that
/// is too large for an integer is still a number.
pub(super) fn value_of(parsed: &Spanned<DeValue>) -> Value {
    let float = |number: Option<f64>| Value::Float(number.unwrap_or(f64::NAN));
    match parsed.get_ref() {
        DeValue::String(text) => Value::String(text.to_string()),
        DeValue::Integer(integer) => {
            let (digits, radix) = (integer.as_str(), integer.radix());
            match i64::from_str_radix(digits, radix) {
                Ok(integer) => Value::Integer(integer),
                Err(_) if radix == 10 => {
                    float(digits.parse().ok().filter(|it: &f64| it.is_finite()))
                }
                Err(_) => float(u128::from_str_radix(digits, radix).ok().map(|it| it as f64)),
            }
        }
        // 1e999 parses to infinity, but only `inf` means it.
        DeValue::Float(number) => {
            let value = number.as_str().parse().ok();
            float(value.filter(|it: &f64| it.is_finite() || number.as_str().contains("inf")))
        }
        DeValue::Boolean(switch) => Value::Boolean(*switch),
        DeValue::Datetime(time) => Value::Datetime(*time),
        DeValue::Array(list) => Value::Array(list.iter().map(value_of).collect()),
        DeValue::Table(table) => Value::Table(table_of(table)),
    }
}

/// A result, of which only the scenario is read.
#[derive(Deserialize)]
struct Outcome {
    input: Value,
}

/// A scenario in JSON, or the `input` of a result.
fn from_json(text: &str, file: &str) -> ScenarioResult<Table> {
    let refuse = |line: Option<usize>, problem| ScenarioError::in_file(file, line, problem);
    let at = |error: serde_json::Error, what: &str| {
        refuse(Some(error.line()), format!("{what}: {error}"))
    };
    let document: Json = serde_json::from_str(text).map_err(|error| at(error, "not valid JSON"))?;
    let input = document.get("input");
    if let Some(path) = null_in(input.unwrap_or(&document), "") {
        let key = path.split('[').next().and_then(Key::from_path);
        let problem =
            format!("is no scenario: {path} = null: give a value, or leave the entry out");
        let error = refuse(None, problem);
        return Err(ScenarioError { key, ..error });
    }
    // Unlike the document, these refuse a key that is there twice.
    let form = match input {
        Some(_) => serde_json::from_str(text).map(|Outcome { input }| input),
        None => serde_json::from_str(text),
    };
    let form = form.map_err(|error| at(error, "is no scenario"))?;
    Table::try_from(form).map_err(|error| refuse(None, format!("is no scenario: {error}")))
}

/// The path of an entry that is null, within `path`.
fn null_in(value: &Json, path: &str) -> Option<String> {
    let inside = |(name, value): (&String, &Json)| null_in(value, &format!("{path}.{name}"));
    let at = |(index, value): (usize, &Json)| null_in(value, &format!("{path}[{index}]"));
    match value {
        Json::Null if !path.is_empty() => Some(path.trim_start_matches('.').into()),
        Json::Object(table) => table.iter().find_map(inside),
        Json::Array(list) => list.iter().enumerate().find_map(at),
        _ => None,
    }
}
