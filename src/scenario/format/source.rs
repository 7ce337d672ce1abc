//! The text of a scenario, TOML or JSON: its values as they are written, before anything is known of
//! their meaning, and the places of errors in it.

use crate::scenario::format::error::{
    ScenarioError, ScenarioResult, SourceLocation, line_number_at, line_with_caret, shorten_excerpt,
};
use crate::scenario::format::path::EntryPath;
use crate::scenario::format::{Key, TablePath, is_repeated_table, table_header};
use serde::Deserialize;
use serde_json::Value as Json;
use std::ops::Range;
use toml::de::{DeTable, DeValue, Error};
use toml::{Spanned, Table, Value};

/// Where the entries of a scenario are from.
#[derive(Clone, Debug, Default)]
pub(in crate::scenario) struct ScenarioSource {
    /// The name of the text in messages.
    pub file: String,
    pub text: String,
    /// Whether errors have lines: not where the text is JSON, or where there is no text.
    has_lines: bool,
    /// The tables that the text has, also empty ones.
    pub tables: Vec<&'static str>,
}

/// A text that was parsed.
pub(super) struct ParsedText {
    pub source: ScenarioSource,
    pub table: Table,
}

/// The places of a key and of its value in the text.
pub(super) struct EntrySpans {
    pub key: Range<usize>,
    pub value: Range<usize>,
}

impl ScenarioSource {
    /// Parses TOML, or the JSON of a scenario or of a result with its `input`.
    pub(super) fn parse(text: &str, file: &str) -> ScenarioResult<ParsedText> {
        // The byte order mark, which some editors write.
        let text = text.trim_start_matches('\u{feff}');
        let mut source = ScenarioSource {
            file: file.into(),
            text: text.into(),
            // TOML never begins with a brace.
            has_lines: !text.trim_start().starts_with('{'),
            tables: Vec::new(),
        };
        let table = match source.has_lines {
            true => match DeTable::parse(text) {
                Ok(table) => table_from_parsed(table.get_ref()),
                Err(error) => {
                    let span = error.span().unwrap_or(0..0);
                    let problem =
                        toml_error_message(&error, text) + &line_with_caret(text, span.clone());
                    return Err(source.error_at_span(Some(span), problem));
                }
            },
            false => from_json(text, file)?,
        };
        source.tables = Key::tables();
        (source.tables).retain(|name| table.get(*name).is_some_and(Value::is_table));
        Ok(ParsedText { source, table })
    }

    /// The places of a key, and of its value or a part of that; in one of its tables if there are
    /// several.
    pub(super) fn find_entry_spans(
        &self,
        path: TablePath,
        row: usize,
        part: Option<EntryPath>,
    ) -> Option<EntrySpans> {
        let document = self.has_lines.then(|| DeTable::parse(&self.text).ok());
        let document = document??.into_inner();
        let mut entries = &document;
        for inner in path.table.split('.').filter(|inner| !inner.is_empty()) {
            let inner = entries.get(inner)?.get_ref();
            entries = match inner.as_array() {
                Some(tables) => tables.get(row)?.get_ref().as_table()?,
                None => inner.as_table()?,
            };
        }
        let (key, value) = entries.get_key_value(path.name)?;
        Some(EntrySpans {
            key: key.span(),
            value: part.map_or(value.span(), |part| entry_span(value, part)),
        })
    }

    /// A value as it is written, shortened.
    pub(super) fn displayed_value(&self, spans: Option<&EntrySpans>, value: &Value) -> String {
        let written = spans.and_then(|spans| self.text.get(spans.value.clone()));
        written.map_or_else(|| shorten_excerpt(&value.to_string()), shorten_excerpt)
    }

    /// The line with byte `at` of the text.
    pub fn location(&self, at: Option<usize>) -> SourceLocation {
        SourceLocation::File {
            file: self.file.clone(),
            line: at.map(|at| line_number_at(self.text.as_bytes(), at)),
        }
    }

    /// An error that is not about the value of a key.
    fn error_at_span(&self, span: Option<Range<usize>>, problem: String) -> ScenarioError {
        ScenarioError::at_place(self.location(span.map(|span| span.start)), problem)
    }

    /// The error about a key that is none of the format, with its line.
    pub fn unknown_key_error(&self, path: TablePath, row: usize, problem: String) -> ScenarioError {
        let span = self
            .find_entry_spans(path, row, None)
            .map(|spans| spans.key);
        let line = span.clone().map(|span| line_with_caret(&self.text, span));
        self.error_at_span(span, problem + &line.unwrap_or_default())
    }

    /// The error about a value in place of a table, or of several.
    pub fn misplaced_value_error(&self, table: &str, value: &Value) -> ScenarioError {
        let spans = self.find_entry_spans(TablePath::split(table), 0, None);
        let found = self.displayed_value(spans.as_ref(), value);
        let allowed = Key::allowed_in(table).join(", ");
        let header = table_header(table);
        let kind = match is_repeated_table(table) {
            false => "a table",
            true => "one table or several",
        };
        let problem = format!(
            "{table} = {found}: must be {kind}: write {header} on a line of its own, below it {allowed}"
        );
        self.error_at_span(spans.map(|spans| spans.key), problem)
    }
}

/// Why `text` is no TOML.
pub(super) fn toml_error_message(error: &Error, text: &str) -> String {
    let line = error
        .span()
        .map(|span| line_number_at(text.as_bytes(), span.start));
    let line = line.and_then(|line| text.lines().nth(line - 1));
    let meant = line.and_then(intended_number_in_line);
    let meant = meant.map_or(String::new(), |meant| format!(": {meant}"));
    format!("not valid TOML: {}{meant}", error.message())
}

/// The place of a part of a value, or of as much of it as there is.
pub(super) fn entry_span(value: &Spanned<DeValue>, part: EntryPath) -> Range<usize> {
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
pub(super) fn value_from_parsed(parsed: &Spanned<DeValue>) -> Value {
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
    // Unlike the generic JSON above, tables refuse a key that is there twice.
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
pub(super) fn parse_value(text: &str) -> Result<Spanned<DeValue<'_>>, Error> {
    match DeValue::parse(text) {
        Err(_) if !text.is_empty() && !text.starts_with(['[', '{', '"', '\'']) => {
            Ok(Spanned::new(0..text.len(), DeValue::String(text.into())))
        }
        parsed => parsed,
    }
}

/// The number that a value is, if any. JSON has no infinity: there it is the text `"inf"`.
pub(super) fn number_of_value(value: &Value) -> Option<f64> {
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

/// Most characters of a unit behind a number.
const LONGEST_UNIT: usize = 8;

/// How a text that a person would read as a number is written as one.
pub(crate) fn intended_number(text: &str) -> Option<String> {
    let meant = text.trim().replace(MINUS_SIGNS, "-").replacen(',', ".", 1);
    let finite = |text: &str| text.parse::<f64>().ok().filter(|number| number.is_finite());
    if finite(&meant).is_none() {
        // A number with a unit behind it.
        let end = meant.char_indices().map(|(end, _)| end).rev();
        let end = end
            .into_iter()
            .find(|&end| finite(meant[..end].trim_end()).is_some())?;
        let (number, unit) = (finite(meant[..end].trim_end())?, meant[end..].trim_start());
        let is_unit = |c: char| c.is_alphanumeric() || "°µ%/^²³*·-".contains(c);
        if unit.chars().count() > LONGEST_UNIT || !unit.chars().all(is_unit) {
            return None;
        }
        return Some(match unit {
            "deg" | "°" | "degree" | "degrees" => {
                format!(
                    "angles are in radians, of which {number} degrees are {}",
                    number.to_radians()
                )
            }
            unit => format!("write it without {unit}, in the units of the scenario ([units])"),
        });
    }
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

/// How a number in a line that is no TOML is written: see [`intended_number`].
fn intended_number_in_line(line: &str) -> Option<String> {
    let value = line.split_once('=').map_or(line, |(_, value)| value);
    let value = value.split('#').next().unwrap_or(value);
    // In a list a comma divides numbers.
    let marks = ['[', ']', '{', '}', '=', ' ', '\t', ','];
    let in_list = value.split(marks).find(|part| part.contains(MINUS_SIGNS));
    let alone =
        (value.contains(',') || value.contains(MINUS_SIGNS)).then(|| intended_number(value));
    alone.flatten().or_else(|| intended_number(in_list?))
}

/// Multiplies every number in a value; knots and times stay where they are.
pub(super) fn multiply_numbers(value: &mut Value, factor: f64) -> Result<(), String> {
    if let Some(number) = number_of_value(value) {
        *value = Value::Float(number * factor);
        return Ok(());
    }
    match value {
        Value::Array(list) => list
            .iter_mut()
            .try_for_each(|entry| multiply_numbers(entry, factor)),
        Value::Table(table) => {
            let lists = table.iter_mut().filter(|(name, _)| *name != "at");
            lists
                .map(|(_, list)| list)
                .try_for_each(|list| multiply_numbers(list, factor))
        }
        other => Err(format!(
            "{} is no number to be scaled: write numbers first",
            shorten_excerpt(&other.to_string())
        )),
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
            '30 cm' => must be a number: write it without cm, in the units of the scenario
            '5e8Pa' => must be a number: write it without Pa
            '90deg' => must be a number: angles are in radians, of which 90 degrees are 1.5707963267948966
            '1.5 in all, more or less' => must be a number or a list of 1
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
