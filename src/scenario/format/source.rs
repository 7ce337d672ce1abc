//! The text of a scenario, TOML or JSON: its values, and the places of errors in it.
//!
//! Values as they are written, before anything is known of their meaning.
//!
//! Excerpts of user input for messages.
//!
//! The error of a refused scenario: one message for people, and its place.

use crate::scenario::format::entries::EntryPath;
use crate::scenario::format::{Key, split, table_brackets};
use serde::Deserialize;
use serde_json::Value as Json;
use std::borrow::Cow;
use std::fmt;
use std::ops::Range;
use toml::de::{DeTable, DeValue, Error};
use toml::{Spanned, Table, Value};

/// Where the entries of a scenario are from.
#[derive(Clone, Debug, Default)]
pub(in crate::scenario) struct ScenarioSource {
    /// The name of the text in messages.
    pub file: String,
    pub text: String,
    /// Whether errors have lines: not those in JSON, nor without a text.
    has_lines: bool,
    /// The tables that it has, also empty ones.
    pub tables: Vec<&'static str>,
}

/// The places of a key and of its value in the text.
pub(in crate::scenario) struct EntrySpans {
    pub key: Range<usize>,
    pub value: Range<usize>,
}

impl ScenarioSource {
    /// Parses TOML, or the JSON of a scenario or of a result with its `input`.
    pub fn parse(text: &str, file: &str) -> ScenarioResult<(ScenarioSource, Table)> {
        // A mark that some editors write.
        let text = text.trim_start_matches('\u{feff}');
        let mut source = ScenarioSource {
            file: file.into(),
            text: text.into(),
            // No TOML begins like this.
            has_lines: !text.trim_start().starts_with('{'),
            tables: Vec::new(),
        };
        let table = match source.has_lines {
            true => match DeTable::parse(text) {
                Ok(table) => table_from_parsed(table.get_ref()),
                Err(error) => {
                    let span = error.span().unwrap_or(0..0);
                    let problem = toml_error_message(&error, text) + &snippet(text, span.clone());
                    return Err(source.error_at_span(Some(span), problem));
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
    pub fn find_entry_spans(
        &self,
        (table, name): (&str, &str),
        row: usize,
        part: Option<EntryPath>,
    ) -> Option<EntrySpans> {
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
        Some(EntrySpans {
            key: key.span(),
            value: part.map_or(value.span(), |part| entry_span(value, part)),
        })
    }

    /// A value as it is written, shortened.
    pub fn displayed_value(&self, spans: Option<&EntrySpans>, value: &Value) -> String {
        let written = spans.and_then(|spans| self.text.get(spans.value.clone()));
        written.map_or_else(|| shorten(&value.to_string()), shorten)
    }

    pub fn location(&self, at: Option<usize>) -> SourceLocation {
        SourceLocation::File {
            file: self.file.clone(),
            line: at.map(|at| line_of(self.text.as_bytes(), at)),
        }
    }

    /// An error that is not about the value of a key.
    fn error_at_span(&self, span: Option<Range<usize>>, problem: String) -> ScenarioError {
        ScenarioError {
            place: self.location(span.map(|span| span.start)),
            key: None,
            problem,
            others: Vec::new(),
        }
    }

    /// The error about a key that is none of the format, with its line.
    pub fn unknown_key_error(
        &self,
        parts: (&str, &str),
        row: usize,
        problem: String,
    ) -> ScenarioError {
        let span = self
            .find_entry_spans(parts, row, None)
            .map(|spans| spans.key);
        let line = span.clone().map(|span| snippet(&self.text, span));
        self.error_at_span(span, problem + &line.unwrap_or_default())
    }

    /// The error about a value in place of a table, or of several.
    pub fn misplaced_value_error(&self, table: &str, value: &Value) -> ScenarioError {
        let spans = self.find_entry_spans(split(table), 0, None);
        let found = self.displayed_value(spans.as_ref(), value);
        let allowed = Key::allowed_in(table).join(", ");
        let (open, close) = table_brackets(table);
        let kind = match open.len() {
            1 => "a table",
            _ => "one table or several",
        };
        let problem = format!(
            "{table} = {found}: must be {kind}: write {open}{table}{close} on a line of its own, below it {allowed}"
        );
        self.error_at_span(spans.map(|spans| spans.key), problem)
    }
}

/// Why `text` is no TOML.
pub(in crate::scenario) fn toml_error_message(error: &Error, text: &str) -> String {
    let line = error
        .span()
        .map(|span| line_of(text.as_bytes(), span.start));
    let line = line.and_then(|line| text.lines().nth(line - 1));
    let meant = line.and_then(intended_number_in_line);
    let meant = meant.map_or(String::new(), |meant| format!(": {meant}"));
    format!("not valid TOML: {}{meant}", error.message())
}

/// The place of a part of a value, or of as much of it as there is.
pub(in crate::scenario) fn entry_span(value: &Spanned<DeValue>, part: EntryPath) -> Range<usize> {
    let mut place = value;
    if let Some(list) = part.list {
        place = place.get_ref().get(list).unwrap_or(place);
    }
    for index in part.indices.into_iter().flatten() {
        place = place.get_ref().get(index).unwrap_or(place);
    }
    place.span()
}

fn table_from_parsed(table: &DeTable) -> Table {
    let entries = table.iter();
    let entries =
        entries.map(|(name, value)| (name.get_ref().to_string(), value_from_parsed(value)));
    entries.collect()
}

/// The value that was parsed. A number that is too large to be one is NaN; a whole number that
/// is too large for an integer is still a number.
pub(in crate::scenario) fn value_from_parsed(parsed: &Spanned<DeValue>) -> Value {
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
        DeValue::Array(list) => Value::Array(list.iter().map(value_from_parsed).collect()),
        DeValue::Table(table) => Value::Table(table_from_parsed(table)),
    }
}

/// A result, of which only the scenario is read.
#[derive(Deserialize)]
struct ResultInput {
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
    if let Some(path) = null_entry_path(input.unwrap_or(&document), "") {
        let key = path.split('[').next().and_then(Key::from_path);
        let problem =
            format!("is no scenario: {path} = null: give a value, or leave the entry out");
        let error = refuse(None, problem);
        return Err(ScenarioError { key, ..error });
    }
    // Unlike the document, these refuse a key that is there twice.
    let form = match input {
        Some(_) => serde_json::from_str(text).map(|ResultInput { input }| input),
        None => serde_json::from_str(text),
    };
    let form = form.map_err(|error| at(error, "is no scenario"))?;
    Table::try_from(form).map_err(|error| refuse(None, format!("is no scenario: {error}")))
}

/// The path of an entry that is null, within `path`.
fn null_entry_path(value: &Json, path: &str) -> Option<String> {
    let inside =
        |(name, value): (&String, &Json)| null_entry_path(value, &format!("{path}.{name}"));
    let at = |(index, value): (usize, &Json)| null_entry_path(value, &format!("{path}[{index}]"));
    match value {
        Json::Null if !path.is_empty() => Some(path.trim_start_matches('.').into()),
        Json::Object(table) => table.iter().find_map(inside),
        Json::Array(list) => list.iter().enumerate().find_map(at),
        _ => None,
    }
}

/// Parses a value. What is no TOML is a text.
pub(in crate::scenario) fn parse(
    text: &str,
) -> std::result::Result<Spanned<DeValue<'_>>, toml::de::Error> {
    match DeValue::parse(text) {
        Err(_) if !text.is_empty() && !text.starts_with(['[', '{', '"', '\'']) => {
            Ok(Spanned::new(0..text.len(), DeValue::String(text.into())))
        }
        parsed => parsed,
    }
}

/// The number that a value is. As JSON has no infinity, that may be a text.
pub(in crate::scenario) fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(float) => Some(*float),
        Value::Integer(integer) => Some(*integer as f64),
        Value::String(text) if text == "inf" => Some(f64::INFINITY),
        _ => None,
    }
}

/// What people and word processors write for a minus sign: hyphens, dashes and the sign itself.
const MINUS_SIGNS: [char; 7] = [
    '\u{2010}', '\u{2011}', '\u{2012}', '\u{2013}', '\u{2014}', '\u{2015}', '\u{2212}',
];

/// How a text that a person would read as a number is written as one.
pub(crate) fn intended_number(text: &str) -> Option<String> {
    let meant = text.trim().replace(MINUS_SIGNS, "-").replacen(',', ".", 1);
    meant
        .parse::<f64>()
        .ok()
        .filter(|number| number.is_finite())?;
    let how = [
        (text.contains(','), "with a decimal point"),
        (text.contains(MINUS_SIGNS), "with a hyphen as minus sign"),
    ];
    let how: Vec<&str> = how
        .into_iter()
        .filter_map(|(is, how)| is.then_some(how))
        .collect();
    Some(match how.as_slice() {
        [] => format!("write {meant}, without quotes"),
        how => format!("write {meant}, {}", how.join(" and ")),
    })
}

/// The same of a number in a line that is no TOML.
pub(in crate::scenario) fn intended_number_in_line(line: &str) -> Option<String> {
    let value = line.split_once('=').map_or(line, |(_, value)| value);
    let value = value.split('#').next().unwrap_or(value);
    // In a list a comma divides numbers.
    let marks = ['[', ']', '{', '}', '=', ' ', '\t', ','];
    let in_list = value.split(marks).find(|part| part.contains(MINUS_SIGNS));
    let alone =
        (value.contains(',') || value.contains(MINUS_SIGNS)).then(|| intended_number(value));
    alone.flatten().or_else(|| intended_number(in_list?))
}

/// Multiplies every number; knots and times stay where they are.
pub(in crate::scenario) fn multiply(
    value: &mut Value,
    factor: f64,
) -> std::result::Result<(), String> {
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

/// Escapes characters that a terminal would interpret: control characters other than
/// line ends and tabs, and marks of the writing direction.
pub fn printable(message: &str) -> Cow<'_, str> {
    let interpreted = |c: char| {
        c.is_control() && !matches!(c, '\n' | '\t')
            || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if !message.contains(interpreted) {
        return message.into();
    }
    let mut shown = String::new();
    for c in message.chars() {
        match interpreted(c) {
            true => shown.extend(c.escape_default()),
            false => shown.push(c),
        }
    }
    shown.into()
}

/// The line of `text` that holds byte `at`, counted from 1.
pub(in crate::scenario) fn line_of(text: &[u8], at: usize) -> usize {
    let before = text[..at.min(text.len())].iter();
    1 + before.filter(|byte| **byte == b'\n').count()
}

/// The offending line with a caret below, to be put after a message; empty
/// where the line is too long to be read.
pub(in crate::scenario) fn snippet(text: &str, span: std::ops::Range<usize>) -> String {
    const MAX_LINE_WIDTH: usize = 120;
    let at = span.start.min(text.len());
    let (Some(before), Some(after)) = (text.get(..at), text.get(at..)) else {
        return String::new();
    };
    let start = before.rfind('\n').map_or(0, |newline| newline + 1);
    let line = text[start..at + after.find('\n').unwrap_or(after.len())].trim_end();
    let length = line.chars().count();
    if length > MAX_LINE_WIDTH {
        return String::new();
    }
    let number = line_of(text.as_bytes(), at).to_string();
    let gap = " ".repeat(number.len());
    // Tabs stay tabs, so that the caret stands below its character.
    let indent = text[start..at].replace(|c| c != '\t', " ");
    let width = text
        .get(span.start..span.end.max(span.start))
        .map_or(1, |s| s.trim_end().chars().count());
    let room = length.saturating_sub(indent.chars().count()).max(1);
    let carets = "^".repeat(width.clamp(1, room));
    format!("\n{gap} |\n{number} | {line}\n{gap} | {indent}{carets}")
}

/// `text` on one line and not too long.
pub(in crate::scenario) fn shorten(text: &str) -> String {
    const MAX_SHORTENED_LENGTH: usize = 60;
    let mut short = String::new();
    for word in text.split_whitespace() {
        if !short.is_empty() {
            short.push(' ');
        }
        short.push_str(word);
        if let Some((cut, _)) = short.char_indices().nth(MAX_SHORTENED_LENGTH) {
            short.truncate(cut);
            short.push_str(" ...");
            break;
        }
    }
    short
}

pub(in crate::scenario) type ScenarioResult<T> = std::result::Result<T, ScenarioError>;

/// Why a scenario was refused. Its text is the whole message: the place, the key, the
/// value found, and what to change.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.message_with_option("set"))]
pub struct ScenarioError {
    /// Where.
    pub place: SourceLocation,
    /// The key, if it is one of the format.
    pub key: Option<Key>,
    /// The rest of the message.
    pub problem: String,
    /// Errors about other entries that do not follow from this one, in the order of the format, as far
    /// as they can be told; the message has all in the order of their lines.
    pub others: Vec<ScenarioError>,
}

impl ScenarioError {
    /// The error about a file, or a line of it, that is not one about the value of a key.
    pub(in crate::scenario) fn in_file(file: &str, line: Option<usize>, problem: String) -> Self {
        let file = file.to_string();
        ScenarioError {
            place: SourceLocation::File { file, line },
            key: None,
            problem,
            others: Vec::new(),
        }
    }

    /// The whole message, where overrides are given by this option.
    pub fn message_with_option(&self, option: &str) -> String {
        let mut all: Vec<&ScenarioError> = [self].into_iter().chain(&self.others).collect();
        // In the order of the lines of the file, then what it lacks, then what is set.
        all.sort_by_key(|error| match error.place {
            SourceLocation::File { line, .. } => line.unwrap_or(usize::MAX - 1),
            SourceLocation::Set { .. } => usize::MAX,
        });
        let all = all.into_iter().map(|error| match &error.place {
            SourceLocation::Set { given } => format!("{option} {given}: {}", error.problem),
            place => format!("{place}: {}", error.problem),
        });
        let all: Vec<String> = all.collect();
        printable(&all.join("\n")).into_owned()
    }
}

/// Where a value was written, or is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SourceLocation {
    /// In a file.
    File {
        /// The file.
        file: String,
        /// The line, counted from 1; `None` for the whole file.
        line: Option<usize>,
    },
    /// In an override.
    Set {
        /// The whole `KEY=VALUE`.
        given: String,
    },
}

impl fmt::Display for SourceLocation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SourceLocation::File { file, line } => {
                f.write_str(file)?;
                line.map_or(Ok(()), |line| write!(f, ":{line}"))
            }
            SourceLocation::Set { given } => write!(f, "set {given}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::scenario::{Entries, Scenario};
    use leafdyn_testing::pairs;

    /// A rod with this length, axial stiffness and load.
    fn rod(length: &str, axial: &str, load: &str) -> Result<Scenario, String> {
        let text = format!(
            "name = 'rod'\n[leaf]\nrods = 1\nlength = {length}\nfan = [0.0]\n[stiffness]\n\
             torsion = 1\nbending_2 = 1\nbending_3 = 1\naxial = {axial}\nshear_2 = [\"inf\"]\n\
             shear_3 = inf\n[load]\ngravity = {load} # down, -1\n"
        );
        Scenario::from_toml(&text).map_err(|refused| refused.to_string())
    }

    const LOAD: &str = "[0.0, 0.0, -1.0]";

    #[test]
    fn infinity_may_be_a_text() {
        let scenario = rod("1.5", "\"inf\"", LOAD).unwrap();
        assert_eq!(scenario, rod("1.5", "inf", LOAD).unwrap());
        let refused = rod("\"inf\"", "inf", LOAD).unwrap_err();
        assert!(refused.contains("must be a finite number"), "{refused}");
    }

    #[test]
    fn numbers_in_other_notation_are_explained() {
        let lengths = "
            1,5 => not valid TOML
            1,5 => : write 1.5, with a decimal point
            −1,5 => : write -1.5, with a decimal point and with a hyphen as minus sign
            ‐1.5 => : write -1.5, with a hyphen as minus sign
            –1.5 => : write -1.5, with a hyphen as minus sign
            '1,5' => leaf.length = '1,5': must be a number: write 1.5, with a decimal point
            '1.5' => must be a number: write 1.5, without quotes
            'long' => must be a number or a list of 1
        ";
        for (length, said) in pairs(lengths) {
            let refused = rod(length, "inf", LOAD).unwrap_err();
            assert!(refused.contains(said), "{length}: {refused}");
        }
        for load in ["[0, 0, −1.5]", "[0, 0, '−1.5']"] {
            let refused = rod("1.0", "inf", load).unwrap_err();
            let said = "write -1.5, with a hyphen as minus sign";
            assert!(refused.contains(said), "{refused}");
        }
        let text = "name = 'rod'\nleaf = { rods = 1, length = 1.0, fan = [0.0] }";
        let entries = Entries::from_text(text, "rod.toml").unwrap();
        let refused = entries.replaced(&["load.gravity=[0, 0, −2]".into()]);
        let refused = refused.unwrap_err().to_string();
        assert!(refused.contains("write -2, with a hyphen"), "{refused}");
    }
}
