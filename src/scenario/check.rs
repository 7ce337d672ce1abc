//! Turns a scenario as written into a checked [`Scenario`]: interprets every value.
//! Limits on combinations of values are in `limits`.
//!
//! All mistakes in the entries of a scenario, though reading it ends at the first.

use crate::scenario::format::entries::{Entries, MOST_RODS};
use crate::scenario::format::item::EntryValue;
use crate::scenario::format::source::{ScenarioError, ScenarioResult};
use crate::scenario::format::{Key, MissingKeyRule, ValueSchema};
use crate::scenario::loads::{DEFAULT_OUTPUTS, check_single_rod_moments, round_inertia, wind};
use crate::scenario::photo::photo;
use crate::scenario::section::Property;
use crate::scenario::veins::{StiffnessSource, joined, tissue, veins};
use crate::scenario::{
    Dynamics, MotionStart, Profile, Rod, Scenario, Units, limits, loads, supports,
};
use std::path::Path;
use toml::Value;

/// Longest name: it must be allowed everywhere as the name of a folder with files.
const LONGEST_NAME: usize = 100;

/// Longest name of a unit, which figures show at their axes.
const LONGEST_UNIT: usize = 20;

/// The accuracy that double precision leaves after a solve on a fine grid.
const TOLERANCE_LEAST: f64 = 1e-12;

/// An error of a tenth of the length is no accuracy.
const TOLERANCE_MOST: f64 = 0.1;

impl Entries {
    /// The checked scenario.
    ///
    /// # Errors
    /// If an entry that is needed is missing, or a value is not allowed.
    pub fn check(&self) -> ScenarioResult<Scenario> {
        let scenario = self.read().map_err(|error| self.error_with_others(error))?;
        limits::check(self, &scenario)?;
        Ok(scenario)
    }

    /// The scenario, entry by entry.
    pub(super) fn read(&self) -> ScenarioResult<Scenario> {
        let name = match self.given_value(Key::Name) {
            Some(item) => name(item)?,
            None => self.name_of_file(),
        };
        let units = Units {
            length: self.given_value(Key::UnitLength).map(unit).transpose()?,
            force: self.given_value(Key::UnitForce).map(unit).transpose()?,
            time: self
                .given_value(Key::UnitTime)
                .map(|item| unit_of_time(self, item))
                .transpose()?,
        };
        let rods = self.value_or_default(Key::Rods)?.whole_number(MOST_RODS)?;
        let made = StiffnessSource::from_entries(self, rods)?;
        let rods = veins(self, rods, &made)?;
        let joined = joined(self, made.blade())?;
        let coupling = coupling(self, rods.len() - 1)?;
        let base_held = supports::of_bases(self)?;
        let tissue = match &made {
            StiffnessSource::Blade(_, parts) => (rods.len() > 1).then(|| parts.tissue()),
            _ => tissue(self, rods.len() - 1)?,
        };
        let (gravity, own_gravity) = loads::gravity(self, rods.len())?;
        let g = loads::g(self)?;
        let distributed = loads::distributed(self, rods.len())?;
        let points = loads::points(self, rods.len())?;
        let tip_force = self.value_or_default(Key::TipForce)?.vector()?;
        let item = self.value_or_default(Key::TipMoment)?;
        let tip_moment = item.vector()?;
        check_single_rod_moments(item, rods.len(), &[tip_moment])?;
        let held_tip = supports::held(self, &rods, joined)?;
        let shared = held_tip.is_some() || joined && rods.len() > 1;
        let grips = supports::grips(self, &rods, shared)?;
        let wind = wind(self, rods.len())?;
        let photo = photo(self)?;
        let tolerance = tolerance(self.value_or_default(Key::Tolerance)?)?;
        let loads = [gravity, tip_force, tip_moment];
        let dynamics = dynamics(self, &rods, &made, loads)?;
        Ok(Scenario {
            name,
            units,
            rods,
            radii: made.radii(),
            blade: made.blade().cloned(),
            base_held,
            joined,
            coupling,
            tissue,
            tissue_grown: self.value_or_default(Key::TissueGrown)?.switch()?,
            gravity,
            own_gravity,
            g,
            distributed,
            points,
            tip_force,
            tip_moment,
            held_tip,
            grips,
            wind,
            photo,
            tolerance,
            dynamics,
        })
    }

    /// The name of a leaf that has none: that of its file.
    fn name_of_file(&self) -> String {
        let stem = Path::new(&self.source.file).file_stem();
        let stem = stem.and_then(|stem| stem.to_str());
        stem.filter(|stem| is_name(stem)).unwrap_or("leaf").into()
    }
}

fn name(item: EntryValue) -> ScenarioResult<String> {
    let name = item.text()?;
    item.refuse_unless(
        is_name(name),
        format_args!(
            "must be usable as a folder name: 1 to {LONGEST_NAME} letters, digits, spaces and the \
             signs _ - . + with a letter, digit or _ first and no space last"
        ),
    )?;
    Ok(name.to_string())
}

/// Whether a folder can have this name on every system.
fn is_name(name: &str) -> bool {
    let allowed = |c: char| c.is_alphanumeric() || "_-.+ ".contains(c);
    let starts_well = name.starts_with(|c: char| c.is_alphanumeric() || c == '_');
    let ends_well = !name.ends_with(' ');
    starts_well && ends_well && name.len() <= LONGEST_NAME && name.chars().all(allowed)
}

fn unit(item: EntryValue) -> ScenarioResult<String> {
    let unit = item.text()?;
    let printed = !unit.trim().is_empty() && !unit.chars().any(char::is_control);
    item.refuse_unless(
        printed && unit.chars().count() <= LONGEST_UNIT,
        format_args!("must be 1 to {LONGEST_UNIT} characters that can be printed"),
    )?;
    Ok(unit.trim().to_string())
}

/// The unit of time, which is that of the others only if the mass is given.
fn unit_of_time(entries: &Entries, item: EntryValue) -> ScenarioResult<String> {
    let densities = [Key::Density, Key::MassDensity, Key::BladeMassDensity];
    item.refuse_unless(
        densities.iter().any(|key| entries.is_given(*key)),
        "without a density times are in units of T = sqrt(rho L^4/A), whatever the other units: \
         give dynamics.density or a mass_density, or leave this out",
    )?;
    unit(item)
}

fn coupling(entries: &Entries, gaps: usize) -> ScenarioResult<Vec<[f64; 3]>> {
    let mut coupling = vec![[0.0; 3]; gaps];
    for (axis, key) in Key::COUPLING.into_iter().enumerate() {
        let stiffness = entries.value_or_default(key)?.number_for_each(gaps)?;
        for (gap, stiffness) in coupling.iter_mut().zip(stiffness) {
            gap[axis] = stiffness;
        }
    }
    Ok(coupling)
}

fn tolerance(item: EntryValue) -> ScenarioResult<f64> {
    let tolerance = item.number()?;
    item.refuse_unless(
        tolerance > 0.0 && tolerance <= TOLERANCE_MOST,
        format_args!(
            "must be greater than 0 and at most {TOLERANCE_MOST}: \
             it is the error of the centerlines relative to the length of a rod"
        ),
    )?;
    item.refuse_unless(
        tolerance >= TOLERANCE_LEAST,
        format_args!(
            "must be at least {TOLERANCE_LEAST:e}: double precision carries 16 digits, \
             and rounding in the solve takes about four of them"
        ),
    )?;
    Ok(tolerance)
}

/// The table `[dynamics]`, for rods under the loads `[gravity, tip_force, tip_moment]`.
fn dynamics(
    entries: &Entries,
    rods: &[Rod],
    made: &StiffnessSource,
    loads: [[f64; 3]; 3],
) -> ScenarioResult<Dynamics> {
    let [gravity, tip_force, tip_moment] = loads;
    let mass = [Key::MassDensity, Key::BladeMassDensity];
    let mass = mass.into_iter().find(|key| entries.is_given(*key));
    let of_mass = |property| mass.and_then(|_| made.profiles(property));
    let density = match entries.given_value(Key::Density) {
        Some(item) => {
            if let Some(key) = mass {
                let path = key.path();
                let why = format!("{path} is given, too: leave one of them out");
                return Err(item.value_error(why));
            }
            Some(item.quantity(rods.len())?)
        }
        None => of_mass(Property::Density),
    };
    let preset = match density {
        Some(density) => Dynamics::of_density(rods, density),
        None => Dynamics::default_for(rods),
    }
    .with_loads(gravity, tip_force, tip_moment);
    let number = |key, default| {
        entries
            .given_value(key)
            .map_or(Ok(default), |item| item.number())
    };
    let load = |key, default| match entries.given_value(key) {
        Some(item) => item.vectors_in_time(),
        None => Ok(default),
    };
    let duration = number(Key::Duration, preset.duration)?;
    let section = rotary_inertia(entries, &preset.density)?;
    let section = section.or_else(|| of_mass(Property::RotaryInertia));
    let external_damping = number(Key::ExternalDamping, preset.external_damping)?;
    let internal_damping = entries.value_or_default(Key::InternalDamping)?.number()?;
    let output_interval = match entries.given_value(Key::OutputInterval) {
        Some(item) => output_interval(item, duration)?,
        None => duration / DEFAULT_OUTPUTS,
    };
    let clamped = clamped(entries.value_or_default(Key::Clamped)?, rods.len())?;
    let start = start(entries.value_or_default(Key::Start)?, clamped)?;
    let gravity = load(Key::GravityInTime, preset.gravity)?;
    let tip_force = load(Key::TipForceInTime, preset.tip_force)?;
    let tip_moment = load(Key::TipMomentInTime, preset.tip_moment)?;
    if let Some(item) = entries.given_value(Key::TipMomentInTime) {
        check_single_rod_moments(item, rods.len(), &tip_moment.value)?;
    }
    Ok(Dynamics {
        polar_excess: if section.is_some() { 1.0 } else { 0.0 },
        rotary_inertia: section.unwrap_or(preset.rotary_inertia),
        external_damping,
        internal_damping,
        duration,
        output_interval,
        clamped,
        start,
        gravity,
        tip_force,
        tip_moment,
        rest: match entries.given_value(Key::RestInTime) {
            Some(item) => item.factors_in_time()?,
            None => preset.rest,
        },
        density: preset.density,
    })
}

fn rotary_inertia(entries: &Entries, density: &[Profile]) -> ScenarioResult<Option<Vec<Profile>>> {
    let quantity = |item: EntryValue| item.quantity(density.len());
    let inertia = entries
        .given_value(Key::RotaryInertia)
        .map(quantity)
        .transpose()?;
    let Some(item) = entries.given_value(Key::SectionRadius) else {
        return Ok(inertia);
    };
    item.refuse_unless(
        inertia.is_none(),
        "dynamics.rotary_inertia is given, too, and is density section_radius^2/4: \
         leave one of them out",
    )?;
    let radius = quantity(item)?;
    let round = density.iter().zip(&radius);
    Ok(Some(
        round
            .map(|(density, radius)| round_inertia(density, radius))
            .collect(),
    ))
}

fn output_interval(item: EntryValue, duration: f64) -> ScenarioResult<f64> {
    let interval = item.number()?;
    item.refuse_unless(
        interval <= duration,
        format_args!(
            "must be at most dynamics.duration, {duration} (left out: a hundredth of the duration)"
        ),
    )?;
    Ok(interval)
}

fn clamped(item: EntryValue, rods: usize) -> ScenarioResult<bool> {
    let clamped = item.switch()?;
    item.refuse_unless(
        clamped || rods == 1,
        format_args!(
            "a free base needs leaf.rods = 1 (here {rods}): the rods of a leaf grow from one base"
        ),
    )?;
    Ok(clamped)
}

fn start(item: EntryValue, clamped: bool) -> ScenarioResult<MotionStart> {
    let start = item.word(
        "must be \"released\" (from the shape where a relaxation starts) or \"at-rest\" \
         (in equilibrium under the loads at time 0)",
    )?;
    item.refuse_unless(
        clamped || start == MotionStart::Released,
        "a rod with a free base has no equilibrium to start from: use \"released\"",
    )?;
    Ok(start)
}

/// Most mistakes that are told at once.
const MAX_REPORTED_MISTAKES: usize = 8;

impl Entries {
    /// The errors about the values of keys that are there.
    pub(super) fn value_errors(&self) -> Vec<ScenarioError> {
        let Err(error) = self.read() else {
            return Vec::new();
        };
        let ScenarioError { others, .. } = self.error_with_others(error.clone());
        let all = [error].into_iter().chain(others);
        let given = |error: &ScenarioError| error.key.is_some_and(|key| self.is_given(key));
        all.filter(given).collect()
    }

    /// An error, with those about other entries that do not follow from it: the refused entry gives
    /// way to one that is allowed, and all are read again.
    pub(super) fn error_with_others(&self, error: ScenarioError) -> ScenarioError {
        let mut entries = self.clone();
        let mut found = vec![error.clone()];
        while found.len() < Key::COUNT
            && found
                .last()
                .is_some_and(|last| entries.replace_refused_entry(last))
        {
            let Err(next) = entries.read() else {
                break;
            };
            let follows =
                |told: &ScenarioError| told.key == next.key || may_follow_from(&next, told);
            if found.iter().any(follows) {
                break;
            }
            found.push(next);
        }
        // The first that is missing names all others.
        let is_missing = |error: &ScenarioError| error.key.is_some_and(|key| !self.is_given(key));
        let first = found.iter().position(is_missing);
        let others = found.into_iter().enumerate().skip(1);
        let others = others.filter(|(k, error)| first == Some(*k) || !is_missing(error));
        let others = others
            .map(|(_, error)| error)
            .take(MAX_REPORTED_MISTAKES - 1)
            .collect();
        ScenarioError { others, ..error }
    }

    /// Replaces the entry that is refused by one that is allowed; false if none is known, or if others
    /// are right or wrong by what it says.
    fn replace_refused_entry(&mut self, error: &ScenarioError) -> bool {
        let Some(key) = error.key.filter(|key| !self.other_entries_depend(*key)) else {
            return false;
        };
        let value = match key.missing_key_rule() {
            MissingKeyRule::Required(example) => Some(example),
            _ => None,
        };
        self.replace(key, value);
        true
    }

    /// Whether other entries are right or wrong by what this one says: lists are as long as
    /// `leaf.rods`, if there are any.
    fn other_entries_depend(&self, key: Key) -> bool {
        match key.form() {
            ValueSchema::Whole if key == Key::Rods => {
                Key::all().any(|key| self.is_list_of_rods(key))
            }
            ValueSchema::Text | ValueSchema::Whole => key.table_and_name().0 != "units",
            _ => false,
        }
    }

    /// Whether a list is given, with as many entries as there are rods or gaps between them.
    fn is_list_of_rods(&self, key: Key) -> bool {
        let single = match key.form() {
            ValueSchema::PerRod(_)
            | ValueSchema::Quantity(_)
            | ValueSchema::PerGap(_)
            | ValueSchema::Fan => 0,
            ValueSchema::VectorPerRod | ValueSchema::VectorQuantity => 1,
            _ => return false,
        };
        self.given_value(key)
            .is_some_and(|item| depth(item.value) > single)
    }
}

/// How deep lists stand within each other; of a profile in those at each knot.
fn depth(value: &Value) -> usize {
    match value {
        Value::Array(list) => 1 + list.first().map_or(0, depth),
        Value::Table(profile) => profile
            .get("value")
            .map_or(0, |value| depth(value).saturating_sub(1)),
        _ => 0,
    }
}

/// Whether an error may follow from the value that replaced that of another: a wall is compared with
/// its diameter.
fn may_follow_from(error: &ScenarioError, on: &ScenarioError) -> bool {
    let in_section = on
        .key
        .is_some_and(|key| key.table_and_name().0 == "section");
    in_section && matches!(error.key, Some(Key::Wall | Key::InnerDiameter))
}

#[cfg(test)]
mod tests {
    use crate::scenario::{Scenario, ScenarioError};

    fn refused(leaf: &str, stiffness: &str) -> ScenarioError {
        let text = format!(
            "[leaf]\nrods = 3\n{leaf}\n[stiffness]\nbending_2 = 1.0\nbending_3 = 1.0\n{stiffness}\n\
             axial = inf\nshear_2 = inf\nshear_3 = inf\n[solve]\ntolerance = 3"
        );
        Scenario::from_toml(&text).unwrap_err()
    }

    fn lines(error: &ScenarioError) -> Vec<String> {
        let text = error.to_string();
        let begin = |line: &str| line.strip_prefix("scenario:").map(String::from);
        text.lines().filter_map(begin).collect()
    }

    /// Errors are told in the order of their lines, whatever that of the format is, and then what
    /// is missing.
    #[test]
    fn mistakes_are_in_the_order_of_lines() {
        let text = "[solve]\ntolerance = 3\n[stiffness]\nbending_2 = -1.0\n[leaf]\nrods = 3\nlength = -1.0\n";
        let lines = lines(&Scenario::from_toml(text).unwrap_err());
        let numbers: Vec<_> = lines
            .iter()
            .map(|line| {
                line.split(':')
                    .next()
                    .unwrap()
                    .parse()
                    .unwrap_or(usize::MAX)
            })
            .collect();
        assert!(
            numbers.starts_with(&[2, 4, 7]) && numbers.is_sorted(),
            "{lines:?}"
        );
    }

    /// Asserts that there is one line about each of these keys, and no other.
    #[track_caller]
    fn assert_keys_mentioned(told: &[String], keys: &[&str]) {
        assert_eq!(told.len(), keys.len(), "{told:?}");
        for key in keys {
            let found = told.iter().any(|line| line.contains(key));
            assert!(found, "{key}: {told:?}");
        }
    }

    /// Every mistake is told once, and what a wrong entry decides is not judged.
    #[test]
    fn all_mistakes_are_told_at_once() {
        let told = lines(&refused(
            "length = 1\nfan = [0.0]\njoined = 1",
            "torsion = -1",
        ));
        let keys = [
            "leaf.fan",
            "stiffness.torsion",
            "leaf.joined",
            "solve.tolerance",
        ];
        assert_keys_mentioned(&told, &keys);
        let rods = refused("length = [1, 1, 1]\nfan = [0, 0, 0]", "torsion = 1");
        let rods = rods.to_string().lines().count();
        assert_eq!(rods, 1, "only the tolerance is wrong");
        let text = "[leaf]\nrods = 0\nlength = [1, 1, 1]\nfan = [0, 0, 0]";
        let error = Scenario::from_toml(text).unwrap_err();
        assert!(
            error.others.is_empty(),
            "lists are as long as rods says: {error}"
        );
    }

    /// A number of rods that is refused hides nothing where no list is as long as it says.
    #[test]
    fn a_wrong_number_of_rods_hides_only_lists() {
        let text = "leaf = { rods = 7.5 }\nblade = { length = -30, width = [0.8, 1.0], thickness = \"0,025\", \
                    young = 6e4 }\nload = { g = -981 }";
        let error = Scenario::from_toml(text).unwrap_err();
        let told = lines(&error);
        let keys = [
            "leaf.rods",
            "blade.length",
            "blade.width",
            "blade.thickness",
            "load.g",
        ];
        assert_keys_mentioned(&told, &keys);
        let listed = text.replace("\"0,025\"", "[0.1, 0.2]");
        let listed = Scenario::from_toml(&listed).unwrap_err();
        assert!(listed.others.is_empty(), "{listed}");
    }

    /// A name that is none does not hide wrong values, and is not called missing as well.
    #[test]
    fn unknown_names_are_told_with_the_rest() {
        let told = lines(&refused(
            "lenght = 1\nfan = 'paper'",
            "torsion = -1\nbending = 2",
        ));
        let keys = [
            "leaf.lenght",
            "stiffness.bending ",
            "stiffness.torsion",
            "solve.tolerance",
        ];
        assert_keys_mentioned(&told, &keys);
    }

    /// What follows from a wrong entry alone is not told.
    #[test]
    fn what_is_missing_is_told_once() {
        let error = Scenario::from_toml("[leaf]\nrods = 2\n[solve]\ntolerance = 3").unwrap_err();
        let told = lines(&error);
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(told[1].contains("also missing: leaf.length"), "{told:?}");
    }
}
