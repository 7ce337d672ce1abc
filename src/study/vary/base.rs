//! The scenario into which varying numbers are put.

use std::path::Path;

use super::{Keys, Knob, Knobs, Target, VaryError};
use crate::scenario::{self, Key, Scenario, resolve};

/// A scenario as text, with some entries replaced: what numbers are put into.
#[derive(Clone, Debug)]
pub struct Base {
    text: String,
    file: String,
    overrides: Vec<String>,
    knobs: Knobs,
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
        let mut overrides = self.overrides.clone();
        for (keys, value) in values {
            for &target in keys.targets() {
                match target {
                    Target::Knob(knob) => knobs.set(knob, *value)?,
                    Target::Entry(part) => {
                        overrides.push(format!("{part}={}", target.text(*value)));
                    }
                }
            }
        }
        // A part that is not there is not there at any value, unless rods are added.
        let mut targets = values.iter().flat_map(|(keys, _)| keys.targets());
        let adds = |target: &Target| matches!(target, Target::Entry(part) if part.key == Key::Rods);
        if !targets.any(adds) {
            resolve(&self.text, &overrides).map_err(|error| VaryError::Key(error.to_string()))?;
        }
        Ok(Varied {
            scenario: Scenario::from_toml_with(&self.text, &self.file, &overrides)?,
            knobs,
        })
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
