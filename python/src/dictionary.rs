//! Dictionaries as TOML.

use std::fmt::Write;

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple, PyType};

use crate::errors::refuse_entry;

static MAPPING: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// How deep lists and tables may stand in each other: none of a scenario stands deeper.
const DEEPEST: usize = 8;

/// A key and its value.
type Entry<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);

/// A scenario's text: tables after what stands outside of them, an entry a line.
pub fn document(scenario: &Bound<PyAny>) -> PyResult<String> {
    let (mut text, mut tables) = (String::new(), String::new());
    for (key, value) in entries(scenario)? {
        let key = name(&key, "")?;
        match is_mapping(&value)? {
            true => {
                let _ = writeln!(tables, "[{}]", quoted_key(&key));
                for (inner, value) in entries(&value)? {
                    let inner = name(&inner, &key)?;
                    line(&mut tables, &inner, &value, &format!("{key}.{inner}"))?;
                }
            }
            false => line(&mut text, &key, &value, &key)?,
        }
    }
    text.push_str(&tables);
    Ok(text)
}

/// Replaced entries as the program takes them: `KEY=VALUE`.
#[pyfunction]
pub fn overrides(entries: &Bound<PyAny>) -> PyResult<Vec<String>> {
    let mut texts = Vec::new();
    for (key, new) in self::entries(entries)? {
        let key = name(&key, "")?;
        let mut text = format!("{key}=");
        value(&mut text, &new, &key, 0)?;
        texts.push(text);
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

/// Whether something is a mapping. An exception while it is asked, Ctrl-C above all, is not
/// an answer, as it is where PyO3 asks.
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

fn line(text: &mut String, key: &str, entry: &Bound<PyAny>, path: &str) -> PyResult<()> {
    text.push_str(&quoted_key(key));
    text.push_str(" = ");
    value(text, entry, path, 0)?;
    text.push('\n');
    Ok(())
}

fn name(key: &Bound<PyAny>, table: &str) -> PyResult<String> {
    match key.cast::<PyString>() {
        Ok(key) => Ok(key.to_cow()?.into_owned()),
        Err(_) => Err(refuse_entry(key, table, "keys are texts")),
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

/// Numbers keep every digit. What has `tolist`, as arrays and numbers of numpy do, is that list.
fn value(text: &mut String, entry: &Bound<PyAny>, path: &str, depth: usize) -> PyResult<()> {
    if depth > DEEPEST {
        return Err(refuse_entry(
            entry,
            path,
            "lists stand too deep in each other",
        ));
    }
    if let Ok(yes) = entry.cast::<PyBool>() {
        text.push_str(if yes.is_true() { "true" } else { "false" });
    } else if entry.is_instance_of::<PyInt>() {
        text.push_str(&entry.str()?.to_cow()?);
    } else if entry.is_instance_of::<PyFloat>() {
        match entry.extract::<f64>()? {
            nan if nan.is_nan() => text.push_str("nan"),
            number => {
                let _ = write!(text, "{number:?}");
            }
        }
    } else if let Ok(words) = entry.cast::<PyString>() {
        match &*words.to_cow()? {
            // As results have it in JSON, which knows no infinity.
            "inf" if path.starts_with("stiffness.") => text.push_str("inf"),
            words => text.push_str(&quoted(words)),
        }
    } else if entry.is_instance_of::<PyList>() || entry.is_instance_of::<PyTuple>() {
        text.push('[');
        for (at, item) in entry.try_iter()?.enumerate() {
            text.push_str(if at > 0 { ", " } else { "" });
            value(text, &item?, path, depth + 1)?;
        }
        text.push(']');
    } else if let Ok(table) = entry.cast::<PyDict>() {
        text.push('{');
        for (at, (key, item)) in table.iter().enumerate() {
            text.push_str(if at > 0 { ", " } else { " " });
            let key = name(&key, path)?;
            text.push_str(&quoted_key(&key));
            text.push_str(" = ");
            value(text, &item, &format!("{path}.{key}"), depth + 1)?;
        }
        text.push_str(" }");
    } else if entry.hasattr("tolist")? {
        value(text, &entry.call_method0("tolist")?, path, depth + 1)?;
    } else {
        let allowed = "allowed are numbers, texts, true or false, lists, arrays and dicts";
        return Err(refuse_entry(entry, path, allowed));
    }
    Ok(())
}
