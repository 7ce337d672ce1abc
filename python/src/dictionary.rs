//! Scenarios from dictionaries: their entries, and the same as TOML.

use std::fmt::{self, Write};

use leafdyn::scenario::{Entries, Value};
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple, PyType};

use crate::errors::entry_error;

static MAPPING: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// Largest nesting depth of lists and tables; scenarios need less.
const MAX_DEPTH: usize = 8;

/// A key and its value.
type Entry<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);

/// Entries of a table, in the order of the dictionary.
type Table = Vec<(String, Value)>;

/// A dictionary: its entries outside of tables, and its tables.
pub struct Document {
    top: Table,
    tables: Vec<(String, Table)>,
}

impl Document {
    /// Converts a dictionary; refuses values that no scenario can have.
    pub fn read(scenario: &Bound<PyAny>) -> PyResult<Document> {
        let (mut top, mut tables) = (Table::new(), Vec::new());
        for (key, entry) in entries(scenario)? {
            let key = name(&key, "")?;
            if is_mapping(&entry)? {
                let mut table = Table::new();
                for (inner, entry) in entries(&entry)? {
                    let inner = name(&inner, &key)?;
                    let value = value(&entry, Path(&key, &inner), 0)?;
                    table.push((inner, value));
                }
                tables.push((key, table));
            } else {
                let value = value(&entry, Path("", &key), 0)?;
                top.push((key, value));
            }
        }
        Ok(Document { top, tables })
    }

    /// Its entries; `None` if a key is unknown: parsing the text gives the reason.
    pub fn entries(&self) -> Option<Entries> {
        let tables = self.tables.iter();
        let tables = tables.map(|(key, table)| {
            let table = table.iter().cloned().collect();
            (key.clone(), Value::Table(table))
        });
        Entries::of_table(self.top.iter().cloned().chain(tables).collect()).ok()
    }

    /// Its text: first the entries outside of tables, then the tables, one entry per line.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let lines = |text: &mut String, table: &Table| {
            for (key, value) in table {
                let _ = writeln!(text, "{} = {}", quoted_key(key), Toml(value));
            }
        };
        lines(&mut text, &self.top);
        for (key, table) in &self.tables {
            let _ = writeln!(text, "[{}]", quoted_key(key));
            lines(&mut text, table);
        }
        text
    }
}

/// Replaced entries as the program takes them: `KEY=VALUE`.
#[pyfunction]
pub fn overrides(entries: &Bound<PyAny>) -> PyResult<Vec<String>> {
    let mut texts = Vec::new();
    for (key, new) in self::entries(entries)? {
        let key = name(&key, "")?;
        let new = value(&new, Path("", &key), 0)?;
        texts.push(format!("{key}={}", Toml(&new)));
    }
    Ok(texts)
}

/// Keys and values.
fn entries<'py>(mapping: &Bound<'py, PyAny>) -> PyResult<Vec<Entry<'py>>> {
    match mapping.cast::<PyDict>() {
        Ok(dict) => Ok(dict.iter().collect()),
        Err(_) => {
            let items = mapping.call_method0("items")?;
            items.try_iter()?.map(|entry| entry?.extract()).collect()
        }
    }
}

/// Whether an object is a mapping. Unlike PyO3's check, passes on an exception during the
/// check, above all Ctrl-C.
fn is_mapping(found: &Bound<PyAny>) -> PyResult<bool> {
    if found.is_instance_of::<PyDict>() {
        return Ok(true);
    }
    let simple = found.is_instance_of::<PyString>()
        || found.is_instance_of::<PyFloat>()
        || found.is_instance_of::<PyInt>()
        || found.is_instance_of::<PyList>();
    if simple {
        return Ok(false);
    }
    found.is_instance(MAPPING.import(found.py(), "collections.abc", "Mapping")?)
}

fn name(key: &Bound<PyAny>, table: &str) -> PyResult<String> {
    match key.cast::<PyString>() {
        Ok(key) => Ok(key.to_cow()?.into_owned()),
        Err(_) => Err(entry_error(key, table, "keys are texts")),
    }
}

/// The path of an entry: its table, empty at the top, and its key.
#[derive(Clone, Copy)]
struct Path<'a>(&'a str, &'a str);

impl Path<'_> {
    fn refuse(self, entry: &Bound<PyAny>, allowed: &str) -> PyErr {
        entry_error(entry, &self.to_string(), allowed)
    }

    fn is_stiffness(self) -> bool {
        self.0 == "stiffness" || self.1.starts_with("stiffness.")
    }
}

impl fmt::Display for Path<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Path("", key) => f.write_str(key),
            Path(table, key) => write!(f, "{table}.{key}"),
        }
    }
}

/// Converts a value. Numbers keep every digit. Objects with `tolist`, as numpy arrays and
/// numbers have, are converted by it.
fn value(entry: &Bound<PyAny>, path: Path, depth: usize) -> PyResult<Value> {
    if depth > MAX_DEPTH {
        return Err(path.refuse(entry, "lists stand too deep in each other"));
    }
    if let Ok(number) = entry.cast::<PyFloat>() {
        Ok(Value::Float(number.extract()?))
    } else if let Ok(yes) = entry.cast::<PyBool>() {
        Ok(Value::Boolean(yes.is_true()))
    } else if entry.is_instance_of::<PyInt>() {
        whole(entry, path)
    } else if let Ok(words) = entry.cast::<PyString>() {
        Ok(match &*words.to_cow()? {
            // As in the JSON of results, which has no infinity.
            "inf" if path.is_stiffness() => Value::Float(f64::INFINITY),
            words => Value::String(words.into()),
        })
    } else if entry.is_instance_of::<PyList>() || entry.is_instance_of::<PyTuple>() {
        let items = entry.try_iter()?;
        let values = items.map(|item| value(&item?, path, depth + 1));
        Ok(Value::Array(values.collect::<PyResult<_>>()?))
    } else if let Ok(table) = entry.cast::<PyDict>() {
        let values = table.iter().map(|(key, item)| {
            let key = name(&key, &path.to_string())?;
            let value = value(&item, path, depth + 1)?;
            Ok((key, value))
        });
        Ok(Value::Table(values.collect::<PyResult<_>>()?))
    } else if entry.hasattr("tolist")? {
        value(&entry.call_method0("tolist")?, path, depth + 1)
    } else {
        let allowed = "allowed are numbers, texts, true or false, lists, arrays and dicts";
        Err(path.refuse(entry, allowed))
    }
}

/// A whole number, or a float if it is too large for one.
fn whole(entry: &Bound<PyAny>, path: Path) -> PyResult<Value> {
    if let Ok(number) = entry.extract::<i64>() {
        return Ok(Value::Integer(number));
    }
    match entry.extract::<f64>() {
        Ok(number) => Ok(Value::Float(number)),
        Err(error) if error.is_instance_of::<PyOverflowError>(entry.py()) => {
            let why = "is not a number a computer can hold (the largest is 1.8e308)";
            Err(path.refuse(entry, why))
        }
        Err(error) => Err(error),
    }
}

/// A value as TOML. Numbers keep every digit in the shortest form.
struct Toml<'a>(&'a Value);

impl fmt::Display for Toml<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.0 {
            Value::Float(number) if number.is_nan() => f.write_str("nan"),
            Value::Float(number) => write!(f, "{number:?}"),
            Value::String(words) => f.write_str(&quoted(words)),
            Value::Array(list) => {
                f.write_char('[')?;
                for (at, item) in list.iter().enumerate() {
                    let comma = if at > 0 { ", " } else { "" };
                    write!(f, "{comma}{}", Toml(item))?;
                }
                f.write_char(']')
            }
            Value::Table(table) => {
                f.write_char('{')?;
                for (at, (key, item)) in table.iter().enumerate() {
                    let comma = if at > 0 { "," } else { "" };
                    write!(f, "{comma} {} = {}", quoted_key(key), Toml(item))?;
                }
                f.write_str(" }")
            }
            value => value.fmt(f),
        }
    }
}

fn quoted_key(key: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    match !key.is_empty() && key.chars().all(bare) {
        true => key.into(),
        false => quoted(key),
    }
}

fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => {
                let _ = write!(quoted, "\\u{:04X}", c as u32);
            }
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}
