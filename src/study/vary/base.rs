//! The scenario into which varying numbers are put.

use std::collections::BTreeMap;
use std::path::Path;

use toml::Value;

use super::{Keys, Kind, Knob, Knobs, Target, VaryError, kind};
use crate::scenario::{self, Key, Scenario};

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
            match knob(given)? {
                Some((knob, value)) => set_knob(&mut knobs, knob, value)?,
                None => of_scenario.push(given.clone()),
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
                    Target::Knob(knob) => set_knob(&mut knobs, knob, *value)?,
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
        if kind(key) == Kind::Whole {
            return Ok(Value::Integer(value as i64));
        }
        let Some(index) = index else {
            return Ok(Value::Float(value));
        };
        let now = |key: Key| changed.get(key.path()).or(self.entries.get(key.path()));
        let refuse = |why: String| VaryError::Key {
            key: Target::Entry {
                key,
                index: Some(index),
            }
            .to_string(),
            why,
        };
        let rods = match now(Key::Rods) {
            Some(Value::Integer(rods)) => *rods as usize,
            _ => self.scenario.rods.len(),
        };
        let count = match kind(key) {
            Kind::Vector => 3,
            Kind::PerGap => rods.saturating_sub(1),
            _ => rods,
        };
        let mut list = match now(key) {
            Some(Value::Array(list)) => list.clone(),
            Some(number @ (Value::Float(_) | Value::Integer(_))) => vec![number.clone(); count],
            Some(_) => return Err(refuse("is no list in the scenario".into())),
            None if has_default(key) => {
                let ungrown = if key == Key::RestStretch { 1.0 } else { 0.0 };
                vec![Value::Float(ungrown); count]
            }
            None => {
                return Err(refuse(
                    "is not in the scenario: write its list first".into(),
                ));
            }
        };
        let entries = list.len();
        match list.get_mut(index) {
            Some(entry) => *entry = Value::Float(value),
            None => {
                return Err(refuse(format!(
                    "there are {entries} entries, and indices count from 0"
                )));
            }
        }
        Ok(Value::Array(list))
    }
}

fn has_default(key: Key) -> bool {
    let tables = ["rest.", "coupling.", "load."];
    tables.iter().any(|table| key.path().starts_with(table))
}

/// The setting of a method in a `KEY=VALUE`, if it is one.
fn knob(given: &str) -> Result<Option<(Knob, f64)>, VaryError> {
    let Some((path, value)) = given.split_once('=') else {
        return Ok(None);
    };
    if !path.trim().starts_with("method.") {
        return Ok(None);
    }
    let Some(knob) = Knob::ALL
        .into_iter()
        .find(|knob| knob.path() == path.trim())
    else {
        return Err(VaryError::Key {
            key: path.trim().into(),
            why: format!("methods have {}", Knob::ALL.map(Knob::path).join(" and ")),
        });
    };
    match value.trim().parse() {
        Ok(number) => Ok(Some((knob, number))),
        Err(_) => Err(VaryError::Knob {
            knob,
            found: value.trim().into(),
            needed: "a number",
        }),
    }
}

fn set_knob(knobs: &mut Knobs, knob: Knob, value: f64) -> Result<(), VaryError> {
    let refuse = |needed| VaryError::Knob {
        knob,
        found: format!("{value:?}"),
        needed,
    };
    match knob {
        Knob::Step if value > 0.0 && value.is_finite() => knobs.step = Some(value),
        Knob::Step => return Err(refuse("greater than 0")),
        Knob::Segments if value >= 1.0 && value.fract() == 0.0 && value < 1e9 => {
            knobs.segments = Some(value as usize)
        }
        Knob::Segments => return Err(refuse("a whole number from 1")),
    }
    Ok(())
}

/// Every entry of an accepted scenario by its path.
fn entries(text: &str, overrides: &[String]) -> BTreeMap<&'static str, Value> {
    let parsed = |text: &str| text.parse::<toml::Table>().unwrap_or_default();
    let document = parsed(text);
    let mut entries = BTreeMap::new();
    for key in Key::all() {
        let value = match key.path().split_once('.') {
            Some((table, name)) => document.get(table).and_then(|table| table.get(name)),
            None => document.get(key.path()),
        };
        entries.extend(value.map(|value| (key.path(), value.clone())));
    }
    for given in overrides {
        let Some((path, text)) = given.split_once('=') else {
            continue;
        };
        if let Some(key) = Key::from_path(path.trim()) {
            let value = parsed(&format!("it = {text}")).remove("it");
            // What is no TOML is a text.
            let value = value.unwrap_or_else(|| Value::String(text.trim().into()));
            entries.insert(key.path(), value);
        }
    }
    entries
}
