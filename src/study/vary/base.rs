//! The scenario into which varying numbers are put.

use std::collections::BTreeMap;
use std::path::Path;

use toml::Value;

use super::{Keys, Knob, Knobs, Target, VaryError};
use crate::scenario::{self, Form, Key, LeftOut, Scenario};

/// A scenario as text, with some entries replaced: what numbers are put into.
#[derive(Clone, Debug)]
pub struct Base {
    text: String,
    file: String,
    overrides: Vec<String>,
    knobs: Knobs,
    /// The same, parsed: a list can only change as a whole.
    entries: BTreeMap<&'static str, Value>,
    scenario: Scenario,
}

/// A scenario and the settings of methods at one point.
#[derive(Clone, Debug)]
pub struct Varied {
    /// The scenario.
    pub scenario: Scenario,
    /// The settings.
    pub knobs: Knobs,
}

impl Base {
    /// Reads the file at `path`, with the entries `overrides` replaced
    /// (`KEY=VALUE`, as in `--set`, or `method.segments=16`).
    ///
    /// # Errors
    /// If it is refused as it is.
    pub fn read(path: &Path, overrides: &[String]) -> Result<Self, VaryError> {
        Base::of_text(scenario::text(path)?, path.display().to_string(), overrides)
    }

    /// The same from a text; messages call it `file`.
    ///
    /// # Errors
    /// If it is refused as it is.
    pub fn of_text(text: String, file: String, overrides: &[String]) -> Result<Self, VaryError> {
        let mut knobs = Knobs::default();
        let mut of_scenario = Vec::new();
        for given in overrides {
            match given.split_once('=') {
                Some((path, value)) if path.trim().starts_with("method.") => {
                    let (knob, value) = setting(path.trim(), value.trim())?;
                    knobs.set(knob, value)?;
                }
                _ => of_scenario.push(given.clone()),
            }
        }
        let scenario = Scenario::from_toml_with(&text, &file, &of_scenario)?;
        Ok(Base {
            entries: entries(&text, &of_scenario),
            text,
            file,
            overrides: of_scenario,
            knobs,
            scenario,
        })
    }

    /// The scenario with nothing varied.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The settings of methods with nothing varied.
    pub fn knobs(&self) -> Knobs {
        self.knobs
    }

    /// The text of the scenario's file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The entries replaced, without the settings of methods.
    pub fn overrides(&self) -> &[String] {
        &self.overrides
    }

    /// The scenario with these values.
    ///
    /// # Errors
    /// If it is refused, or has no such entry.
    pub fn at(&self, values: &[(&Keys, f64)]) -> Result<Varied, VaryError> {
        let mut knobs = self.knobs;
        let mut changed: BTreeMap<&'static str, Value> = BTreeMap::new();
        for (keys, value) in values {
            for &target in keys.targets() {
                match target {
                    Target::Knob(knob) => knobs.set(knob, *value)?,
                    Target::Entry { key, index } => {
                        let entry = self.entry(&changed, key, index, *value)?;
                        changed.insert(key.path(), entry);
                    }
                }
            }
        }
        let changes = changed
            .iter()
            .map(|(path, value)| format!("{path}={value}"));
        let overrides: Vec<String> = self.overrides.iter().cloned().chain(changes).collect();
        Ok(Varied {
            scenario: Scenario::from_toml_with(&self.text, &self.file, &overrides)?,
            knobs,
        })
    }

    /// The whole value of a key of which one number is new.
    fn entry(
        &self,
        changed: &BTreeMap<&'static str, Value>,
        key: Key,
        index: Option<usize>,
        value: f64,
    ) -> Result<Value, VaryError> {
        if key.form() == Form::Whole {
            return Ok(Value::Integer(value as i64));
        }
        let Some(index) = index else {
            return Ok(Value::Float(value));
        };
        let now = |key: Key| changed.get(key.path()).or(self.entries.get(key.path()));
        let refuse = |why: String| {
            let index = Some(index);
            let key = Target::Entry { key, index };
            Err(VaryError::Key(format!("{key}: {why}")))
        };
        let rods = match now(Key::Rods) {
            Some(Value::Integer(rods)) => *rods as usize,
            _ => self.scenario.rods.len(),
        };
        let count = match key.form() {
            Form::PerGap(_) => rods.saturating_sub(1),
            _ => rods,
        };
        let mut list = match now(key) {
            Some(Value::Array(list)) => list.clone(),
            Some(number @ (Value::Float(_) | Value::Integer(_))) => vec![number.clone(); count],
            Some(_) => return refuse("is no list in the scenario".into()),
            None => return refuse("is not in the scenario: write its list first".into()),
        };
        let entries = list.len();
        let Some(entry) = list.get_mut(index) else {
            return refuse(format!(
                "there are {entries} entries, and indices count from 0"
            ));
        };
        *entry = Value::Float(value);
        Ok(Value::Array(list))
    }
}

/// The setting of a method by its path, and its value.
fn setting(path: &str, value: &str) -> Result<(Knob, f64), VaryError> {
    let Some(knob) = Knob::from_path(path) else {
        let all = Knob::ALL.map(Knob::path).join(" and ");
        return Err(VaryError::Key(format!("{path}: methods have {all}")));
    };
    let number = value.parse();
    let number = number.map_err(|_| VaryError::knob(knob, format_args!("{value}"), "a number"))?;
    Ok((knob, number))
}

/// Every entry of an accepted scenario by its path, those left out included
/// where they have a value all the same.
fn entries(text: &str, overrides: &[String]) -> BTreeMap<&'static str, Value> {
    let table = |text: &str| text.parse::<toml::Table>().unwrap_or_default();
    // What is no TOML is a text.
    let value = |text: &str| {
        let value = table(&format!("it = {text}")).remove("it");
        value.unwrap_or_else(|| Value::String(text.trim().into()))
    };
    let document = table(text);
    let mut entries = BTreeMap::new();
    for key in Key::all() {
        let written = match key.path().split_once('.') {
            Some((table, name)) => document.get(table).and_then(|table| table.get(name)),
            None => document.get(key.path()),
        };
        let left_out = match key.left_out() {
            LeftOut::Means(text) => Some(value(text)),
            _ => None,
        };
        entries.extend(
            written
                .cloned()
                .or(left_out)
                .map(|value| (key.path(), value)),
        );
    }
    for given in overrides {
        let Some((path, text)) = given.split_once('=') else {
            continue;
        };
        if let Some(key) = Key::from_path(path.trim()) {
            entries.insert(key.path(), value(text));
        }
    }
    entries
}
