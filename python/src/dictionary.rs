//! Scenarios from dictionaries: their entries, and the same as TOML.

use std::fmt::{self, Write};

use leafdyn::relax::MAX_NODES;
use leafdyn::scenario::{Entries, Key, Value, schema};
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple, PyType};

use crate::errors::entry_error;

static MAPPING: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static SEQUENCE: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static REAL: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// Largest nesting depth of lists and tables; scenarios need less.
const MAX_DEPTH: usize = 8;

/// Most numbers of a value: as many as a leaf can have nodes. More are refused before any is read.
const MOST_NUMBERS: usize = MAX_NODES;

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
            let key = name(&key, None)?;
            let path = Path::Key("", &key);
            if let Some((table, within)) = key.split_once('.') {
                let meant = format!("{{\"{table}\": {{\"{within}\": ...}}}}");
                let problem = format!("unknown key {key}: write {meant}, or replace it by `set`");
                return Err(entry_error(entry.py(), &key, false, problem));
            }
            if is_mapping(&entry)? {
                let mut table = Table::new();
                for (inner, entry) in entries(&entry)? {
                    let inner = name(&inner, Some(path))?;
                    let value = value(&entry, Path::Key(&key, &inner), 0)?;
                    table.push((inner, value));
                }
                tables.push((key, table));
            } else if Key::from_path(&key).is_none()
                && schema()["properties"][&key]["type"] == "object"
            {
                return Err(path.refuse(&entry, "must be a dict"));
            } else {
                let value = value(&entry, path, 0)?;
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
        Entries::from_table(self.top.iter().cloned().chain(tables).collect()).ok()
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
        let Ok(key) = key.cast::<PyString>() else {
            let problem = "keys must be text, as \"leaf.rods\"".into();
            return Err(entry_error(key.py(), &key.repr()?.to_cow()?, true, problem));
        };
        let key = key.to_cow()?;
        let new = value(&new, Path::Set(&key), 0)?;
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

/// The name of a key of a dictionary, which is at the top or within another.
fn name(key: &Bound<PyAny>, within: Option<Path>) -> PyResult<String> {
    if let Ok(key) = key.cast::<PyString>() {
        return Ok(key.to_cow()?.into_owned());
    }
    let found = key.repr()?;
    let within_what = within.map_or(String::new(), |path| format!(" of {path}"));
    let problem = format!("key {found}{within_what}: must be text");
    let root = within.map(Path::root);
    let (root, in_set) = root.unwrap_or_default();
    Err(entry_error(key.py(), &root, in_set, problem))
}

/// Where a value is.
#[derive(Clone, Copy)]
enum Path<'a> {
    /// A key of a table, which has no name at the top.
    Key(&'a str, &'a str),
    /// A replaced entry.
    Set(&'a str),
    /// A key of an inner dictionary.
    Inner(&'a Path<'a>, &'a str),
    /// An item of a list.
    Item(&'a Path<'a>, usize),
}

impl Path<'_> {
    /// The key of the scenario, and whether it is one of `set`.
    fn root(self) -> (String, bool) {
        match self {
            Path::Key(..) => (self.to_string(), false),
            Path::Set(key) => (key.into(), true),
            Path::Inner(outer, _) | Path::Item(outer, _) => outer.root(),
        }
    }

    fn refuse(self, entry: &Bound<PyAny>, allowed: &str) -> PyErr {
        let kind = entry.get_type().name();
        let kind = match entry.is_none() {
            true => "None".into(),
            false => kind.map_or("an object".into(), |name| name.to_string()),
        };
        let (key, in_set) = self.root();
        let problem = format!("{self} = {kind}: {allowed}");
        entry_error(entry.py(), &key, in_set, problem)
    }

    fn is_stiffness(self) -> bool {
        match self {
            Path::Key(table, _) => table == "stiffness",
            Path::Set(key) => key.starts_with("stiffness."),
            Path::Inner(outer, _) | Path::Item(outer, _) => outer.is_stiffness(),
        }
    }
}

impl fmt::Display for Path<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Path::Key("", key) | Path::Set(key) => f.write_str(key),
            Path::Key(table, key) => write!(f, "{table}.{key}"),
            Path::Inner(outer, key) => write!(f, "{outer}.{key}"),
            Path::Item(list, index) => write!(f, "{list}[{index}]"),
        }
    }
}

/// Converts a value. Numbers keep every digit. Sequences, as ranges, become lists; objects with
/// `tolist`, as numpy arrays and numbers have, are converted by it, others with `__array__`, as those of
/// xarray, by numpy, and other real numbers to floats.
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
    } else if is_sequence(entry)? {
        check_size(entry.len()?, path, entry)?;
        let items = entry.try_iter()?.enumerate();
        let values = items.map(|(at, item)| value(&item?, Path::Item(&path, at), depth + 1));
        Ok(Value::Array(values.collect::<PyResult<_>>()?))
    } else if let Ok(table) = entry.cast::<PyDict>() {
        let values = table.iter().map(|(key, item)| {
            let key = name(&key, Some(path))?;
            let value = value(&item, Path::Inner(&path, &key), depth + 1)?;
            Ok((key, value))
        });
        Ok(Value::Table(values.collect::<PyResult<_>>()?))
    } else if let Some(plain) = plain(entry, path)? {
        value(&plain, path, depth + 1)
    } else if entry.is_instance(REAL.import(entry.py(), "numbers", "Real")?)? {
        float(entry, path)
    } else {
        let allowed = "allowed are numbers, texts, true or false, lists, arrays and dicts";
        Err(path.refuse(entry, allowed))
    }
}

fn is_sequence(entry: &Bound<PyAny>) -> PyResult<bool> {
    if entry.is_instance_of::<PyList>() || entry.is_instance_of::<PyTuple>() {
        return Ok(true);
    }
    entry.is_instance(SEQUENCE.import(entry.py(), "collections.abc", "Sequence")?)
}

/// Refuses more numbers than any scenario can have.
fn check_size(size: usize, path: Path, entry: &Bound<PyAny>) -> PyResult<()> {
    match size <= MOST_NUMBERS {
        true => Ok(()),
        false => Err(path.refuse(
            entry,
            &format!("has {size} numbers: at most {MOST_NUMBERS} are allowed"),
        )),
    }
}

/// What `tolist` makes of an object, or of the array that it becomes, if that is something else: a long
/// double stays one.
fn plain<'py>(entry: &Bound<'py, PyAny>, path: Path) -> PyResult<Option<Bound<'py, PyAny>>> {
    let array = match entry.hasattr("tolist")? {
        true => entry.clone(),
        false if entry.hasattr("__array__")? => {
            let asarray = entry.py().import("numpy")?.getattr("asarray")?;
            check_array(entry, path)?;
            asarray.call1((entry,))?
        }
        false => return Ok(None),
    };
    check_array(&array, path)?;
    let plain = array.call_method0("tolist")?;
    Ok(Some(plain).filter(|plain| !plain.get_type().is(entry.get_type())))
}

/// The same for an array, which knows its size before any number is read.
fn check_array(array: &Bound<PyAny>, path: Path) -> PyResult<()> {
    match array
        .getattr("size")
        .and_then(|size| size.extract::<usize>())
    {
        Ok(size) => check_size(size, path, array),
        Err(_) => Ok(()),
    }
}

/// A whole number, or a float if it is too large for one.
fn whole(entry: &Bound<PyAny>, path: Path) -> PyResult<Value> {
    match entry.extract::<i64>() {
        Ok(number) => Ok(Value::Integer(number)),
        Err(_) => float(entry, path),
    }
}

fn float(entry: &Bound<PyAny>, path: Path) -> PyResult<Value> {
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
