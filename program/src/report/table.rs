//! Layout of results: labelled lines for the console, rows for CSV.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// Lines of a report, each with its label; one without a label continues the one
/// above.
pub type Lines = Vec<(&'static str, String)>;

/// Lines of which only the first is labelled.
pub fn labelled(name: &'static str, lines: impl IntoIterator<Item = String>) -> Lines {
    let names = std::iter::once(name).chain(std::iter::repeat(""));
    names.zip(lines).collect()
}

pub fn list_files(folder: &Path, files: &[PathBuf]) -> String {
    let names = files.iter().filter_map(|file| file.file_name());
    let names: Vec<_> = names.map(|name| name.to_string_lossy()).collect();
    format!("{}: {}", folder.display(), names.join(", "))
}

/// What spreadsheets take for the beginning of a formula, which they run.
const FORMULA: [char; 6] = ['=', '+', '-', '@', '\t', '\r'];

/// Before a text spreadsheets take this for a sign that it is one.
const TEXT: char = '\'';

/// The cell of a text that comes from a name, such as that of an experiment.
pub fn text_cell(text: &str) -> Cow<'_, str> {
    match text.starts_with(FORMULA) && text.parse::<f64>().is_err() {
        true => format!("{TEXT}{text}").into(),
        false => text.into(),
    }
}

/// Writes rows as CSV without a header; each may be a tuple of tuples and arrays, whose
/// elements are its cells.
pub fn append_csv<R: Serialize>(
    rows: impl IntoIterator<Item = R>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut table = csv_without_header(out);
    for row in rows {
        table.serialize(row)?;
    }
    table.flush()
}

/// A CSV writer that writes no header by itself.
pub fn csv_without_header<W: Write>(out: W) -> csv::Writer<W> {
    let mut builder = csv::WriterBuilder::new();
    builder.has_headers(false).from_writer(out)
}

/// One table of several results, each given as its scenario's file, its exit status and
/// its JSON, whose scalar values are the cells. Columns are named by their keys, those of
/// nested objects by both keys (`work_steps`); lists are left out, except tips.
pub fn rows_of_json(results: &[(String, i32, Vec<u8>)]) -> io::Result<Vec<u8>> {
    let mut columns: Vec<String> = Vec::new();
    let mut rows: Vec<HashMap<String, String>> = Vec::new();
    for (file, status, json) in results {
        let Flat(mut cells) = serde_json::from_slice(json)?;
        let head = [
            ("file", text_cell(file).into()),
            ("exit_status", status.to_string()),
        ];
        cells.retain(|(name, _)| name != "exit_status");
        cells.splice(0..0, head.map(|(name, cell)| (name.to_string(), cell)));
        let mut after = 0;
        for (name, _) in &cells {
            after = 1 + match columns.iter().position(|column| column == name) {
                Some(known) => known,
                None => {
                    columns.insert(after, name.clone());
                    after
                }
            };
        }
        rows.push(cells.into_iter().collect());
    }
    columns.retain(|column| column != "error");
    columns.push("error".into());
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(&columns)?;
    for row in &rows {
        let cells = columns.iter().map(|column| row.get(column));
        table.write_record(cells.map(|cell| cell.map_or("", String::as_str)))?;
    }
    table.into_inner().map_err(|error| error.into_error())
}

/// A JSON value as named cells; that of a scalar has no name.
struct Flat(Vec<(String, String)>);

impl<'de> Deserialize<'de> for Flat {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Cells;

        impl Cells {
            fn one<E>(cell: impl ToString) -> Result<Flat, E> {
                Ok(Flat(vec![(String::new(), cell.to_string())]))
            }
        }

        impl<'de> Visitor<'de> for Cells {
            type Value = Flat;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("JSON")
            }

            fn visit_bool<E>(self, value: bool) -> Result<Flat, E> {
                Cells::one(value)
            }

            fn visit_i64<E>(self, value: i64) -> Result<Flat, E> {
                Cells::one(value)
            }

            fn visit_u64<E>(self, value: u64) -> Result<Flat, E> {
                Cells::one(value)
            }

            fn visit_f64<E>(self, value: f64) -> Result<Flat, E> {
                Cells::one(format_args!("{value:?}"))
            }

            fn visit_str<E>(self, value: &str) -> Result<Flat, E> {
                Cells::one(text_cell(value))
            }

            fn visit_unit<E>(self) -> Result<Flat, E> {
                Cells::one("")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Flat, A::Error> {
                while list.next_element::<IgnoredAny>()?.is_some() {}
                Ok(Flat(Vec::new()))
            }

            fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Flat, A::Error> {
                let mut cells = Vec::new();
                while let Some(key) = object.next_key::<String>()? {
                    match key.as_str() {
                        "version" | "source" | "input" => {
                            object.next_value::<IgnoredAny>()?;
                        }
                        "tip" | "tip_force_sum" => {
                            let tip = object.next_value::<Option<[f64; 3]>>()?;
                            for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                                let cell = tip.map(|tip| format!("{:?}", tip[axis]));
                                cells.push((format!("{key}_{name}"), cell.unwrap_or_default()));
                            }
                        }
                        _ => {
                            let Flat(inner) = object.next_value()?;
                            for (name, cell) in inner {
                                let below = if name.is_empty() { "" } else { "_" };
                                cells.push((format!("{key}{below}{name}"), cell));
                            }
                        }
                    }
                }
                Ok(Flat(cells))
            }
        }

        deserializer.deserialize_any(Cells)
    }
}

/// The header of a table with these columns, which commas separate.
pub fn header(columns: &str) -> Vec<u8> {
    format!("{columns}\n").into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_look_like_formulas_are_cells_of_text() {
        let names = [
            "=cmd|' /C calc'!A0",
            "@SUM(1+1)",
            "+1+1",
            "-2+3",
            "\t=1",
            "rod",
            "-2",
            "'a",
        ];
        for name in names {
            let cell = text_cell(name);
            let runs = cell.starts_with(FORMULA) && cell.parse::<f64>().is_err();
            assert!(!runs, "{cell}");
            assert!(cell == name || cell == format!("'{name}"));
        }
        let refused = br#"{ "scenario": "=1+1", "tolerance": -1e-6 }"#.to_vec();
        let table = rows_of_json(&[("@a.toml".into(), 2, refused)]).unwrap();
        let table = String::from_utf8(table).unwrap();
        assert!(table.contains("'@a.toml,2,'=1+1,-1e-6"), "{table}");
    }
}
