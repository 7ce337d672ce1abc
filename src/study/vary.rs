//! Numbers of a scenario that vary: `KEY=FROM..TO[:COUNT][log]`.
//!
//! A key is any number of the scenario by its path (`table.key`), one entry of
//! a list by an index that counts from 0 (`load.gravity[2]`), a common factor of all numbers
//! of a key (`scale:stiffness.bending_2`), or a setting of a method
//! (`method.step`). Several keys joined by `+` take the same value. The
//! values are substituted in the text of the scenario, so that every limit of the
//! format applies to them ([`BaseScenario::scenario_with_values`]); the text is parsed only once.
//!
//! ```
//! use leafdyn::study::{BaseScenario, ParameterSweep};
//!
//! let text = r#"
//!     name = "vein"
//!     leaf = { rods = 1, length = 1.0, fan = [0.0] }
//!     stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
//!     load = { gravity = [0.0, 0.0, -1.0] }
//! "#;
//! let base = BaseScenario::from_text(text.into(), "vein.toml".into(), &[])?;
//! let weight: ParameterSweep = "load.gravity[2]=-0.01..-100:5log".parse()?;
//! assert_eq!(weight.values, [-0.01, -0.1, -1.0, -10.0, -100.0]);
//! let heavy = base.scenario_with_values(&[(&weight.keys, -100.0)])?;
//! assert_eq!(heavy.scenario.gravity, [0.0, 0.0, -100.0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(test)]
mod tests;

use crate::branch::value_at_fraction;
use crate::relax::Parameter;
use crate::scenario;
use crate::scenario::units::{DIMENSIONLESS, Dimension, TIME};
use crate::scenario::{
    BaseSpin, BaseSupport, Entries, EntryPath, Key, Scenario, ScenarioError, Wind, intended_number,
};
use glam::DVec3;
use serde::{Serialize, Serializer};
use std::fmt;
use std::ops::RangeInclusive;
use std::path::Path;
use std::str::FromStr;

/// Default number of values.
const DEFAULT_VALUE_COUNT: usize = 11;

/// Largest number of values along one axis.
const MOST_VALUES: usize = 10_000;

/// Largest and smallest magnitude of a non-zero value: differences, products and quotients
/// of two of them neither overflow nor underflow.
const ADMISSIBLE_MAGNITUDES: RangeInclusive<f64> = 1e-100..=1e100;

/// Decimal digits to which intermediate values are rounded: 0.001, not
/// 0.0010000000000000002.
const ROUNDING_DIGITS: usize = 12;

/// A setting of a method, not of the leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolverSetting {
    /// `method.step`: the time step of explicit motion, in the scenario's unit.
    Step,
    /// `method.segments`: one fixed grid of so many segments per rod.
    Segments,
}

impl SolverSetting {
    const ALL: [SolverSetting; 2] = [SolverSetting::Step, SolverSetting::Segments];

    /// Its path.
    pub fn path(self) -> &'static str {
        match self {
            SolverSetting::Step => "method.step",
            SolverSetting::Segments => "method.segments",
        }
    }

    fn from_path(path: &str) -> Option<SolverSetting> {
        SolverSetting::ALL
            .into_iter()
            .find(|knob| knob.path() == path)
    }
}

/// The settings of methods; `None`: the default of the method.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolverSettings {
    /// `method.step`.
    pub step: Option<f64>,
    /// `method.segments`.
    pub segments: Option<usize>,
}

impl SolverSettings {
    fn set(&mut self, knob: SolverSetting, value: f64) -> Result<(), VaryError> {
        match knob {
            SolverSetting::Step if value > 0.0 && value.is_finite() => self.step = Some(value),
            SolverSetting::Step => {
                return Err(VaryError::invalid_solver_setting(
                    knob,
                    value,
                    "greater than 0",
                ));
            }
            SolverSetting::Segments if value >= 1.0 && value.fract() == 0.0 && value < 1e9 => {
                self.segments = Some(value as usize);
            }
            SolverSetting::Segments => {
                return Err(VaryError::invalid_solver_setting(
                    knob,
                    value,
                    "a whole number from 1",
                ));
            }
        }
        Ok(())
    }
}

/// A number that can be set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VariableTarget {
    /// A number of the scenario.
    Entry(EntryPath),
    /// A setting of a method.
    Knob(SolverSetting),
}

impl VariableTarget {
    /// The key of the scenario, unless it is a setting of a method.
    pub(crate) fn key(self) -> Option<Key> {
        match self {
            VariableTarget::Entry(part) => Some(part.key),
            VariableTarget::Knob(_) => None,
        }
    }

    fn overlaps(self, other: VariableTarget) -> bool {
        match (self, other) {
            (VariableTarget::Entry(one), VariableTarget::Entry(two)) => one.overlaps(&two),
            _ => self == other,
        }
    }

    fn is_whole_number(self) -> bool {
        match self {
            VariableTarget::Entry(part) => part.key.is_whole_number(),
            VariableTarget::Knob(knob) => knob == SolverSetting::Segments,
        }
    }

    fn format_value(self, value: f64) -> String {
        format_number(value, self.is_whole_number())
    }
}

impl FromStr for VariableTarget {
    type Err = VaryError;

    fn from_str(text: &str) -> Result<Self, VaryError> {
        let text = text.trim();
        if let Some(knob) = SolverSetting::from_path(text) {
            return Ok(VariableTarget::Knob(knob));
        }
        let refuse = |why: String| VaryError::Key(format!("{text}: {why}"));
        if text.starts_with("method.") {
            let all = SolverSetting::ALL.map(SolverSetting::path).join(" and ");
            return Err(refuse(format!("unknown key: methods have {all}")));
        }
        let part = EntryPath::parse(text).map_err(refuse)?;
        part.check_is_number().map_err(refuse)?;
        Ok(VariableTarget::Entry(part))
    }
}

impl fmt::Display for VariableTarget {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            VariableTarget::Entry(part) => part.fmt(f),
            VariableTarget::Knob(knob) => f.write_str(knob.path()),
        }
    }
}

/// Numbers that take the same value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParameterKeys(Vec<VariableTarget>);

impl ParameterKeys {
    /// All of them; at least one.
    pub fn targets(&self) -> &[VariableTarget] {
        &self.0
    }

    /// Keys as they are written, of which that of a vector or a list stands for all of its entries.
    ///
    /// # Errors
    /// As those of [`ParameterKeys::from_str`].
    pub fn parse_with_lists(text: &str) -> Result<ParameterKeys, VaryError> {
        match EntryPath::parse(text.trim()) {
            Ok(part) if part.is_whole_list() => {
                Ok(ParameterKeys(vec![VariableTarget::Entry(part)]))
            }
            _ => text.parse(),
        }
    }

    /// The reference magnitude of the number if it is zero, in a scenario's units.
    pub(crate) fn reference_magnitude(&self, scenario: &Scenario) -> f64 {
        // The drag of a velocity is |v| v: small is what is small beside its size.
        let speed = |wind: &Wind| DVec3::from_array(wind.velocity.at(0.0)).length();
        let unit = |target: &VariableTarget| match target {
            VariableTarget::Entry(part) if part.scale => 1.0,
            VariableTarget::Entry(part) if part.key == Key::WindVelocity => {
                let known = scenario.wind.as_ref().map(speed).filter(|it| *it > 0.0);
                known.unwrap_or(AIR_AT_REST * scenario.unit(part.key))
            }
            VariableTarget::Entry(part) => scenario.unit(part.key),
            VariableTarget::Knob(_) => 0.0,
        };
        self.0.iter().map(unit).fold(0.0, f64::max)
    }

    /// The exponents of length, force and time in the unit of their value; without a unit if they
    /// differ, and for factors.
    pub fn dimension(&self) -> Dimension {
        let mut all = self.0.iter().map(|target| match target {
            VariableTarget::Entry(part) if part.scale => DIMENSIONLESS,
            VariableTarget::Entry(part) => part.key.dimension(),
            VariableTarget::Knob(SolverSetting::Step) => TIME,
            VariableTarget::Knob(SolverSetting::Segments) => DIMENSIONLESS,
        });
        let first = all.next().unwrap_or(DIMENSIONLESS);
        match all.all(|other| other == first) {
            true => first,
            false => DIMENSIONLESS,
        }
    }

    /// Whether all must be positive, or non-negative.
    pub(crate) fn is_positive(&self) -> bool {
        self.0.iter().all(|target| match target {
            VariableTarget::Entry(part) => part.scale || part.key.is_positive(),
            VariableTarget::Knob(_) => false,
        })
    }

    /// Whether they have a number in common.
    pub(crate) fn overlaps(&self, other: &ParameterKeys) -> bool {
        self.0
            .iter()
            .any(|one| other.0.iter().any(|two| one.overlaps(*two)))
    }

    /// Whether a scenario is linear in the number. Several keys may enter as a
    /// product, as coupling and lengths do.
    pub(crate) fn is_scenario_linear(&self) -> bool {
        let mut keys = self.0.iter().filter_map(|target| target.key());
        self.0.len() == 1 && keys.all(Key::is_linear)
    }

    /// Whether only whole numbers are allowed.
    pub fn is_whole(&self) -> bool {
        self.0.iter().any(|target| target.is_whole_number())
    }

    /// Whether it contains this setting of a method.
    pub fn contains_solver_setting(&self, knob: SolverSetting) -> bool {
        self.0.contains(&VariableTarget::Knob(knob))
    }

    /// A value of these keys as it is written into the scenario and into tables.
    pub fn text(&self, value: f64) -> String {
        format_number(value, self.is_whole())
    }
}

fn format_number(value: f64, whole: bool) -> String {
    match whole {
        true => format!("{value:.0}"),
        false => format!("{value:?}"),
    }
}

impl FromStr for ParameterKeys {
    type Err = VaryError;

    fn from_str(text: &str) -> Result<Self, VaryError> {
        let targets = text.split('+').map(VariableTarget::from_str);
        Ok(ParameterKeys(targets.collect::<Result<_, _>>()?))
    }
}

impl Serialize for ParameterKeys {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// As written: `stiffness.axial+stiffness.shear_2`.
impl fmt::Display for ParameterKeys {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let paths: Vec<String> = self.0.iter().map(VariableTarget::to_string).collect();
        f.write_str(&paths.join("+"))
    }
}

/// Keys and the values they take, one after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterSweep {
    /// The keys.
    pub keys: ParameterKeys,
    /// The values, from FROM to TO; at least one, without duplicates.
    pub values: Vec<f64>,
    /// Whether they are spaced logarithmically.
    pub log: bool,
}

impl ParameterSweep {
    /// FROM and TO.
    pub fn ends(&self) -> [f64; 2] {
        [self.values[0], self.values[self.values.len() - 1]]
    }
}

impl FromStr for ParameterSweep {
    type Err = VaryError;

    fn from_str(given: &str) -> Result<Self, VaryError> {
        let refuse = |why: &str| VaryError::Syntax(format!("{given}: {why}"));
        let (keys, range) = given.split_once('=').ok_or_else(|| refuse("has no ="))?;
        let keys: ParameterKeys = keys.parse()?;
        let range = range.trim();
        let (range, log) = match range.strip_suffix("log") {
            Some(rest) => (
                rest.trim_end().trim_end_matches([':', ',']).trim_end(),
                true,
            ),
            None => (range, false),
        };
        let (range, count) = match range.split_once(':') {
            Some((range, count)) => {
                let count = count.trim().parse().ok();
                let count = count.filter(|count| (1..=MOST_VALUES).contains(count));
                let why = "COUNT must be a whole number from 1 to 10000";
                (range, count.ok_or_else(|| refuse(why))?)
            }
            None => (range, DEFAULT_VALUE_COUNT),
        };
        let (from, to) = (range.split_once("..")).ok_or_else(|| refuse("has no .."))?;
        let number = |text: &str| {
            let value: Option<f64> = text.trim().parse().ok();
            let allowed =
                |value: &f64| *value == 0.0 || ADMISSIBLE_MAGNITUDES.contains(&value.abs());
            value.filter(allowed).ok_or_else(|| {
                let why = "FROM and TO must be numbers, zero or of a size from 1e-100 to 1e100";
                match (value, intended_number(text)) {
                    (None, Some(how)) => refuse(&how),
                    _ => refuse(why),
                }
            })
        };
        let (from, to) = (number(from)?, number(to)?);
        if log && from * to <= 0.0 {
            return Err(refuse(
                "log needs FROM and TO of one sign: it never reaches zero",
            ));
        }
        let mut values: Vec<f64> = (0..count)
            .map(|i| spaced_value(from, to, i, count - 1, log))
            .collect();
        if keys.is_whole() {
            for value in &mut values {
                *value = value.round();
            }
        }
        values.dedup();
        Ok(ParameterSweep { keys, values, log })
    }
}

/// The `i`-th of `last` + 1 values; the ends exactly.
fn spaced_value(from: f64, to: f64, i: usize, last: usize, log: bool) -> f64 {
    if i == 0 || i == last {
        return if i == 0 { from } else { to };
    }
    let value = value_at_fraction([from, to], log, i as f64 / last as f64);
    let rounded = format!("{value:.*e}", ROUNDING_DIGITS - 1);
    rounded.parse().unwrap_or(value)
}

/// Why numbers cannot vary as requested.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VaryError {
    /// A syntax error.
    #[error("{0}; write KEY=FROM..TO[:COUNT][log], as in stiffness.bending_2=1..1e-5:12log")]
    Syntax(String),
    /// A key that cannot vary.
    #[error("{0}")]
    Key(String),
    /// An entry that the scenario does not have at any value.
    #[error("{0}")]
    Missing(#[source] ScenarioError),
    /// An inadmissible value for the setting of a method.
    #[error("{0}")]
    Knob(String),
    /// The scenario with these values is invalid.
    #[error("{0}")]
    Scenario(#[from] ScenarioError),
}

impl VaryError {
    /// Whether another value may be admissible.
    pub(crate) fn depends_on_value(&self) -> bool {
        !matches!(self, VaryError::Key(_) | VaryError::Missing(_))
    }

    fn invalid_solver_setting(
        knob: SolverSetting,
        found: impl fmt::Debug,
        needed: &str,
    ) -> VaryError {
        VaryError::Knob(format!("{} = {found:?}: must be {needed}", knob.path()))
    }
}

/// A scenario with some entries replaced, into which numbers are substituted.
#[derive(Clone, Debug)]
pub struct BaseScenario {
    pub(super) entries: Entries,
    overrides: Vec<String>,
    solver_settings: SolverSettings,
    scenario: Scenario,
}

/// A scenario and the settings of methods at one point.
#[derive(Clone, Debug)]
pub struct VariedScenario {
    /// The scenario.
    pub scenario: Scenario,
    /// The settings.
    pub solver_settings: SolverSettings,
}

impl BaseScenario {
    /// Reads the file at `path`, with the entries `overrides` replaced
    /// (`KEY=VALUE`, by paths of the scenario, or `method.segments=16`).
    pub fn read(path: &Path, overrides: &[String]) -> Result<Self, VaryError> {
        BaseScenario::from_text(scenario::text(path)?, path.display().to_string(), overrides)
    }

    /// Reads a scenario from a text; messages call it `file`.
    pub fn from_text(text: String, file: String, overrides: &[String]) -> Result<Self, VaryError> {
        BaseScenario::new(&Entries::from_text(&text, &file)?, overrides, true)
    }

    /// Checks entries with the `overrides` replaced; settings of methods are unknown keys unless they are allowed.
    pub fn new(
        entries: &Entries,
        overrides: &[String],
        of_methods: bool,
    ) -> Result<Self, VaryError> {
        let mut knobs = SolverSettings::default();
        let mut of_scenario = Vec::new();
        for given in overrides {
            match given.split_once('=') {
                Some((path, value)) if of_methods && path.trim().starts_with("method.") => {
                    let (knob, value) = parse_solver_setting(path.trim(), value.trim())?;
                    knobs.set(knob, value)?;
                }
                _ => of_scenario.push(given.clone()),
            }
        }
        let entries = entries.replaced(&of_scenario)?;
        Ok(BaseScenario {
            scenario: entries.check()?,
            entries,
            overrides: of_scenario,
            solver_settings: knobs,
        })
    }

    /// The scenario without variation.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The settings of methods without variation.
    pub fn solver_settings(&self) -> SolverSettings {
        self.solver_settings
    }

    /// The text of the scenario's file.
    pub fn text(&self) -> &str {
        self.entries.source_text()
    }

    /// The entries replaced, without the settings of methods.
    pub fn overrides(&self) -> &[String] {
        &self.overrides
    }

    /// The number that the scenario has at these keys, if it is one and the same for all of them.
    pub fn number(&self, keys: &ParameterKeys) -> Option<f64> {
        let mut numbers = keys.targets().iter().map(|target| match target {
            VariableTarget::Entry(part) => self.entries.number_at(*part),
            VariableTarget::Knob(_) => None,
        });
        let first = numbers.next()??;
        numbers.all(|other| other == Some(first)).then_some(first)
    }

    /// The base with a value substituted permanently.
    ///
    /// # Errors
    /// If the scenario is then invalid, or has no such entry.
    pub fn with_value(&self, keys: &ParameterKeys, value: f64) -> Result<BaseScenario, VaryError> {
        self.with_values(&[(keys, value)])
    }

    /// The base with these values substituted permanently.
    ///
    /// # Errors
    /// If the scenario is then invalid, or has no such entry.
    pub fn with_values(&self, values: &[(&ParameterKeys, f64)]) -> Result<BaseScenario, VaryError> {
        let VariedScenario {
            scenario,
            solver_settings: knobs,
        } = self.scenario_with_values(values)?;
        let given = overrides_for_values(values);
        Ok(BaseScenario {
            entries: self.entries.replaced(&given)?,
            overrides: [&self.overrides[..], &given].concat(),
            solver_settings: knobs,
            scenario,
        })
    }

    /// The scenario with these values.
    ///
    /// # Errors
    /// If it is invalid, has no such entry, or does not change with these keys.
    pub fn scenario_with_values(
        &self,
        values: &[(&ParameterKeys, f64)],
    ) -> Result<VariedScenario, VaryError> {
        let mut knobs = self.solver_settings;
        for (keys, value) in values {
            self.refuse_ineffective_factor(keys)?;
            for &target in keys.targets() {
                if let VariableTarget::Knob(knob) = target {
                    knobs.set(knob, *value)?;
                }
            }
        }
        // An entry that does not exist does so at no value, unless rods are added.
        let mut targets = values.iter().flat_map(|(keys, _)| keys.targets());
        let adds = |target: &VariableTarget| matches!(target, VariableTarget::Entry(part) if part.key == Key::Rods);
        let adds = targets.any(adds);
        let entries = self.entries.replaced(&overrides_for_values(values));
        let entries = entries.map_err(|error| match adds {
            true => VaryError::Scenario(error),
            false => VaryError::Missing(error),
        })?;
        Ok(VariedScenario {
            scenario: entries.check()?,
            solver_settings: knobs,
        })
    }

    /// Refuses factors with which nothing varies.
    fn refuse_ineffective_factor(&self, keys: &ParameterKeys) -> Result<(), VaryError> {
        let fixed = |target: &VariableTarget| match target {
            VariableTarget::Entry(part) => part.scale && !self.entries.is_scalable(*part),
            VariableTarget::Knob(_) => false,
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
    pub fn differentiable_value(&self, keys: &ParameterKeys) -> Result<f64, VaryError> {
        let mut found = None;
        for &target in keys.targets() {
            let refuse = |why: &str| Err(VaryError::Key(format!("{target}: {why}")));
            let VariableTarget::Entry(part) = target else {
                return refuse("is a setting of a method, not a number of the leaf");
            };
            if part.key.is_whole_number() {
                return refuse("is a whole number, and cannot change by a little");
            }
            if part.is_node_position() {
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
                None => {
                    let value = self.entries.value_at(part);
                    if let Some(word) = value.and_then(|value| value.as_str()) {
                        return refuse(&format!(
                            "is \"{word}\" in the scenario: write its numbers there, or leave this key out"
                        ));
                    }
                    let entries = value.map(|value| part.number_paths(value));
                    let example = entries.and_then(|all| all.first().copied());
                    let example = example.map_or(String::new(), |one| format!(", as {one}"));
                    let why = format!("is a list or a profile: name one of its entries{example}");
                    return refuse(&why);
                }
            }
        }
        found.ok_or_else(|| VaryError::Key(format!("{keys}: no number")))
    }

    /// All numbers that the scenario gives and with respect to which derivatives exist: of vectors, lists and
    /// profiles every entry.
    pub fn differentiable_numbers(&self) -> Vec<ParameterKeys> {
        let given = Key::all()
            .filter(|key| *key != Key::Tolerance)
            .flat_map(|key| self.entries.paths_of_key(key))
            .filter(|part| self.entries.is_given_in_row(part.key, part.row));
        let each = given
            .flat_map(|part| self.keys_by_entry(&ParameterKeys(vec![VariableTarget::Entry(part)])));
        let numbers = each.filter(|keys| self.differentiable_value(keys).is_ok());
        numbers.collect()
    }

    /// The `k`th of these values as a parameter of the scenario that has them all. `unit` is the
    /// size of its steps where it is zero.
    pub(crate) fn parameter<'v>(
        &'v self,
        values: &'v [(&'v ParameterKeys, f64)],
        k: usize,
        unit: f64,
    ) -> Parameter<'v> {
        let (keys, value) = values[k];
        Parameter {
            make: Box::new(move |value| {
                let mut values = values.to_vec();
                values[k].1 = value;
                Some(self.scenario_with_values(&values).ok()?.scenario)
            }),
            value,
            unit,
            linear: keys.is_scenario_linear() && !has_nonlinear_forces(self.scenario()),
        }
    }

    /// These keys or, of a list or a profile, one key for each entry.
    pub(crate) fn keys_by_entry(&self, keys: &ParameterKeys) -> Vec<ParameterKeys> {
        let [VariableTarget::Entry(part)] = keys.targets() else {
            return vec![keys.clone()];
        };
        match self.entries.value_at(*part) {
            Some(value) => (part.number_paths(value).into_iter())
                .map(|part| ParameterKeys(vec![VariableTarget::Entry(part)]))
                .collect(),
            None => vec![keys.clone()],
        }
    }

    /// The scenario with these values, as TOML.
    pub fn toml(&self, values: &[(&ParameterKeys, f64)]) -> Option<String> {
        let changed = self.entries.replaced(&overrides_for_values(values)).ok()?;
        Some(changed.to_toml())
    }
}

/// Steps of a velocity of air at rest, over those of other numbers.
const AIR_AT_REST: f64 = 1e-9;

/// Whether forces on a leaf depend on numbers of its scenario otherwise than these say: by the stress-free leaf, by the
/// turn of an elastic base from its natural direction, by the frame that a hinge allows, or by the square of the air's velocity.
fn has_nonlinear_forces(scenario: &Scenario) -> bool {
    let elastic = scenario.base_held.contains(&BaseSupport::Elastic);
    let joints = scenario.base_spin == BaseSpin::Held;
    scenario.needs_stress_free_leaf() || elastic || joints || scenario.wind.is_some()
}

/// The overrides that set these values.
fn overrides_for_values(values: &[(&ParameterKeys, f64)]) -> Vec<String> {
    let mut overrides = Vec::new();
    for (keys, value) in values {
        for &target in keys.targets() {
            if let VariableTarget::Entry(part) = target {
                overrides.push(format!("{part}={}", target.format_value(*value)));
            }
        }
    }
    overrides
}

/// Parses the setting of a method from its path and its value.
fn parse_solver_setting(path: &str, value: &str) -> Result<(SolverSetting, f64), VaryError> {
    let Some(knob) = SolverSetting::from_path(path) else {
        let all = SolverSetting::ALL.map(SolverSetting::path).join(" and ");
        return Err(VaryError::Key(format!("{path}: methods have {all}")));
    };
    let number = value.parse();
    let number = number.map_err(|_| {
        VaryError::invalid_solver_setting(knob, format_args!("{value}"), "a number")
    })?;
    Ok((knob, number))
}

/// Entries of a list that are told one by one; of longer ones only their common factor.
const MOST_ENTRIES_LISTED: usize = 9;

/// What is displaced from zero is by so much of the length.
const DISPLACEMENT_FROM_ZERO: f64 = 0.1;

/// A number of a scenario.
#[derive(Clone, Debug)]
pub struct ScenarioNumber {
    /// Its path.
    pub keys: ParameterKeys,
    /// Its value; 1 for a common factor of several.
    pub value: f64,
    /// The size of such a number, where its own is zero, in the scenario's units.
    pub unit: f64,
    /// Whether it must be positive, or not negative.
    pub positive: bool,
    /// Whether it is a whole number.
    pub whole: bool,
    /// What it is.
    pub description: &'static str,
}

impl BaseScenario {
    /// All numbers that the scenario has, given or by default: of vectors each component, of lists
    /// and profiles their common factor, and each entry of short ones.
    pub fn numbers(&self) -> Vec<ScenarioNumber> {
        let mut numbers = Vec::new();
        for part in Key::all().flat_map(|key| self.entries.paths_of_key(key)) {
            let Some(value) = self.entries.value_at(part) else {
                continue;
            };
            let each = match self.entries.number_at(part) {
                Some(_) => vec![part],
                None => part.number_paths(value),
            };
            let factor = EntryPath {
                scale: true,
                ..part
            };
            if each.len() > 1 && self.entries.is_scalable(factor) {
                numbers.extend(self.describe_number(factor));
            }
            if each.len() <= MOST_ENTRIES_LISTED {
                numbers.extend(
                    each.into_iter()
                        .filter_map(|part| self.describe_number(part)),
                );
            }
        }
        numbers
    }

    fn describe_number(&self, part: EntryPath) -> Option<ScenarioNumber> {
        let keys = ParameterKeys(vec![VariableTarget::Entry(part)]);
        let value = self.entries.number_at(part)?;
        // Some defaults are those of tables that would stand beside what is given in their place.
        let allowed = || self.scenario_with_values(&[(&keys, value)]).is_ok();
        let can_vary = part.check_is_number().is_ok() && part.key != Key::Tolerance && allowed();
        let is_length = part.key.dimension() == [1, 0, 0];
        can_vary.then(|| ScenarioNumber {
            value,
            unit: keys.reference_magnitude(self.scenario())
                * if is_length {
                    DISPLACEMENT_FROM_ZERO
                } else {
                    1.0
                },
            positive: keys.is_positive(),
            whole: keys.is_whole(),
            description: part.key.description(),
            keys,
        })
    }
}

/// Names of the lab axes in the words for quantities.
pub(super) const AXIS_NAMES: [&str; 3] = ["x", "y", "z"];

#[cfg(test)]
mod numbers_tests {
    use super::*;

    /// Each of them can be set to its own value, and the scenario is the same.
    #[test]
    fn every_number_can_be_set_by_its_path() {
        let text = include_str!("../../scenarios/measured/clip.toml");
        let base = BaseScenario::from_text(text.into(), "clip.toml".into(), &[]).unwrap();
        let numbers = base.numbers();
        let paths: Vec<String> = (numbers.iter()).map(|it| it.keys.to_string()).collect();
        for path in [
            "leaf.length",
            "section.young",
            "load.g[2]",
            "load.point[0].mass",
            "tissue.along",
        ] {
            assert!(paths.iter().any(|it| it == path), "{path} of {paths:?}");
        }
        for ScenarioNumber { keys, value, .. } in &numbers {
            let parsed: ParameterKeys = keys.to_string().parse().unwrap();
            assert_eq!(parsed, *keys);
            let same = base.scenario_with_values(&[(keys, *value)]);
            let same = same.unwrap_or_else(|refused| panic!("{keys}={value}: {refused}"));
            assert_eq!(same.scenario.rods, base.scenario().rods, "{keys}");
        }
    }
}
