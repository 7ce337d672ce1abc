//! The scenario into which varying numbers are substituted.

use std::path::Path;

use super::{Keys, Knob, Knobs, Target, VaryError};
use crate::relax::Parameter;
use crate::scenario::{self, Entries, Form, Key, Scenario};

/// A scenario with some entries replaced, into which numbers are substituted.
#[derive(Clone, Debug)]
pub struct Base {
    pub(super) entries: Entries,
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
    pub fn read(path: &Path, overrides: &[String]) -> Result<Self, VaryError> {
        Base::of_text(scenario::text(path)?, path.display().to_string(), overrides)
    }

    /// The same from a text; messages call it `file`.
    pub fn of_text(text: String, file: String, overrides: &[String]) -> Result<Self, VaryError> {
        Base::new(&Entries::of_text(&text, &file)?, overrides, true)
    }

    /// The same from entries; settings of methods are unknown keys unless they are allowed.
    pub fn new(
        entries: &Entries,
        overrides: &[String],
        of_methods: bool,
    ) -> Result<Self, VaryError> {
        let mut knobs = Knobs::default();
        let mut of_scenario = Vec::new();
        for given in overrides {
            match given.split_once('=') {
                Some((path, value)) if of_methods && path.trim().starts_with("method.") => {
                    let (knob, value) = setting(path.trim(), value.trim())?;
                    knobs.set(knob, value)?;
                }
                _ => of_scenario.push(given.clone()),
            }
        }
        let entries = entries.replaced(&of_scenario)?;
        Ok(Base {
            scenario: entries.check()?,
            entries,
            overrides: of_scenario,
            knobs,
        })
    }

    /// The scenario without variation.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The settings of methods without variation.
    pub fn knobs(&self) -> Knobs {
        self.knobs
    }

    /// The text of the scenario's file.
    pub fn text(&self) -> &str {
        self.entries.text()
    }

    /// The entries replaced, without the settings of methods.
    pub fn overrides(&self) -> &[String] {
        &self.overrides
    }

    /// The number that the scenario has at these keys, if it is one and the same for all of them.
    pub fn number(&self, keys: &Keys) -> Option<f64> {
        let mut numbers = keys.targets().iter().map(|target| match target {
            Target::Entry(part) => self.entries.number_at(*part),
            Target::Knob(_) => None,
        });
        let first = numbers.next()??;
        numbers.all(|other| other == Some(first)).then_some(first)
    }

    /// The base with a value substituted permanently.
    ///
    /// # Errors
    /// If the scenario is then invalid, or has no such entry.
    pub fn with(&self, keys: &Keys, value: f64) -> Result<Base, VaryError> {
        let Varied { scenario, knobs } = self.at(&[(keys, value)])?;
        let given = overriding(&[(keys, value)]);
        Ok(Base {
            entries: self.entries.replaced(&given)?,
            overrides: [&self.overrides[..], &given].concat(),
            knobs,
            scenario,
        })
    }

    /// The scenario with these values.
    ///
    /// # Errors
    /// If it is invalid, has no such entry, or does not change with these keys.
    pub fn at(&self, values: &[(&Keys, f64)]) -> Result<Varied, VaryError> {
        let mut knobs = self.knobs;
        for (keys, value) in values {
            self.check_factor(keys)?;
            for &target in keys.targets() {
                if let Target::Knob(knob) = target {
                    knobs.set(knob, *value)?;
                }
            }
        }
        // An entry that does not exist does so at no value, unless rods are added.
        let mut targets = values.iter().flat_map(|(keys, _)| keys.targets());
        let adds = |target: &Target| matches!(target, Target::Entry(part) if part.key == Key::Rods);
        let adds = targets.any(adds);
        let entries = self.entries.replaced(&overriding(values));
        let entries = entries.map_err(|error| match adds {
            true => VaryError::Scenario(error),
            false => VaryError::Missing(error),
        })?;
        Ok(Varied {
            scenario: entries.check()?,
            knobs,
        })
    }

    /// Refuses factors with which nothing varies.
    fn check_factor(&self, keys: &Keys) -> Result<(), VaryError> {
        let fixed = |target: &Target| match target {
            Target::Entry(part) => part.scale && !self.entries.is_scalable(*part),
            Target::Knob(_) => false,
        };
        match keys.targets().iter().all(fixed) {
            true => Err(VaryError::Key(format!(
                "{keys}: its numbers are 0 or infinite, which no factor changes: write others first"
            ))),
            false => Ok(()),
        }
    }

    /// The number at these keys: one with respect to which derivatives exist, the
    /// same for all of them; 1 for a scale factor.
    ///
    /// # Errors
    /// If it is a whole number, a setting of a method, not a single number, or left out.
    pub fn value(&self, keys: &Keys) -> Result<f64, VaryError> {
        let mut found = None;
        for &target in keys.targets() {
            let refuse = |why: &str| Err(VaryError::Key(format!("{target}: {why}")));
            let Target::Entry(part) = target else {
                return refuse("is a setting of a method, not a number of the leaf");
            };
            if part.key.form() == Form::Whole {
                return refuse("is a whole number, and cannot change by a little");
            }
            if part.is_place() {
                return refuse(
                    "where knots and points are cannot change by a little: the grids have nodes there",
                );
            }
            if self.entries.value_at(part).is_none() {
                return refuse(
                    "is not in the scenario: write it there first; indices count from 0",
                );
            }
            match self.entries.number_at(part) {
                Some(value) if !value.is_finite() => {
                    return refuse("is infinite, and cannot change by a little");
                }
                Some(value) if found.is_none_or(|found| found == value) => found = Some(value),
                Some(_) => return refuse("has another value than the keys it is joined to"),
                None => return refuse("is a list or a profile: name one of its entries"),
            }
        }
        found.ok_or_else(|| VaryError::Key(format!("{keys}: no number")))
    }

    /// The `k`th of these values as a parameter of the scenario that has them all. `unit` is the
    /// size of its steps where it is zero.
    pub(crate) fn parameter<'v>(
        &'v self,
        values: &'v [(&'v Keys, f64)],
        k: usize,
        unit: f64,
    ) -> Parameter<'v> {
        let (keys, value) = values[k];
        Parameter {
            make: Box::new(move |value| {
                let mut values = values.to_vec();
                values[k].1 = value;
                Some(self.at(&values).ok()?.scenario)
            }),
            value,
            unit,
            // The natural leaf depends on shapes at rest otherwise.
            linear: keys.is_linear() && !self.scenario().depends_on_natural_leaf(),
        }
    }

    /// The same keys, or one for each entry if they are a list or a profile.
    pub(crate) fn entries_of(&self, keys: &Keys) -> Vec<Keys> {
        let [Target::Entry(part)] = keys.targets() else {
            return vec![keys.clone()];
        };
        match self.entries.value_at(*part) {
            Some(value) => (part.numbers(value).into_iter())
                .map(|part| Keys(vec![Target::Entry(part)]))
                .collect(),
            None => vec![keys.clone()],
        }
    }

    /// The scenario with these values, as TOML.
    pub fn toml(&self, values: &[(&Keys, f64)]) -> Option<String> {
        let changed = self.entries.replaced(&overriding(values)).ok()?;
        Some(changed.to_toml())
    }
}

/// The overrides that set these values.
fn overriding(values: &[(&Keys, f64)]) -> Vec<String> {
    let mut overrides = Vec::new();
    for (keys, value) in values {
        for &target in keys.targets() {
            if let Target::Entry(part) = target {
                overrides.push(format!("{part}={}", target.text(*value)));
            }
        }
    }
    overrides
}

/// Parses the setting of a method from its path and its value.
fn setting(path: &str, value: &str) -> Result<(Knob, f64), VaryError> {
    let Some(knob) = Knob::from_path(path) else {
        let all = Knob::ALL.map(Knob::path).join(" and ");
        return Err(VaryError::Key(format!("{path}: methods have {all}")));
    };
    let number = value.parse();
    let number = number.map_err(|_| VaryError::knob(knob, format_args!("{value}"), "a number"))?;
    Ok((knob, number))
}
