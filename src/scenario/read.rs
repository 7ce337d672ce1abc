//! Reads a scenario: a file, its text, its entries, and from these the checked [`Scenario`], every
//! value interpreted. Limits on combinations of values are in `limits`.
//!
//! Reading ends at the first mistake; all other mistakes are then looked for, to be told at once.

use crate::memory;
use crate::scenario::checked::Scenario;
use crate::scenario::format::entries::{CollectedEntries, Entries, MOST_RODS};
use crate::scenario::format::error::{ScenarioError, ScenarioResult, line_number_at};
use crate::scenario::format::item::EntryValue;
use crate::scenario::format::source::ScenarioSource;
use crate::scenario::format::units::Units;
use crate::scenario::format::{Key, MissingKeyRule, ValueSchema};
use crate::scenario::loads::{
    GravityAcceleration, PointLoad, check_single_rod_moments, read_dynamics, read_wind,
};
use crate::scenario::photo::read_photo;
use crate::scenario::schedule::Schedule;
use crate::scenario::support_motion::read_support_motion;
use crate::scenario::supports::Grip;
use crate::scenario::veins::{StiffnessSource, read_joined, read_tissue, read_veins};
use crate::scenario::{limits, loads, supports};
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;
use toml::{Table, Value};

/// Most bytes of a file; 100,000 rods with every quantity listed need fewer.
pub const MOST_BYTES: u64 = 64 << 20;

impl Scenario {
    /// Reads and checks the TOML in `text`, or the JSON of a [`Scenario`] or of a
    /// result with its `input`.
    ///
    /// ```
    /// let scenario = leafdyn::scenario::Scenario::from_toml(
    ///     r#"
    ///     name = "cantilever"
    ///     leaf = { rods = 1, length = 1.0, fan = [0.0] }
    ///     stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
    ///     load = { tip_force = [0.0, 0.0, -1.0] }
    ///     "#,
    /// )?;
    /// assert_eq!(scenario.rods.len(), 1);
    /// # Ok::<(), leafdyn::scenario::ScenarioError>(())
    /// ```
    pub fn from_toml(text: &str) -> Result<Scenario, ScenarioError> {
        Scenario::from_toml_with(text, "scenario", &[])
    }

    /// As [`Scenario::from_toml`], with the entries `overrides` replaced
    /// (`KEY=VALUE`, such as `load.gravity=[0,0,-0.5]`; the value is TOML, anything
    /// else is taken as text), or parts of them: one entry of a list
    /// (`load.gravity[2]=-1`, `stiffness.bending_2.value[0]=2`), or every number of
    /// a key multiplied (`scale:load.gravity=2`). Messages call the text `file`.
    pub fn from_toml_with(
        text: &str,
        file: &str,
        overrides: &[String],
    ) -> Result<Scenario, ScenarioError> {
        let entries = Entries::from_text(text, file)?;
        entries.replaced(overrides)?.check()
    }

    /// Reads and checks the file at `path`.
    pub fn read(path: impl AsRef<Path>) -> Result<Scenario, ScenarioError> {
        Scenario::read_with(path.as_ref(), &[])
    }

    /// As [`Scenario::read`], with the entries `overrides` replaced.
    pub fn read_with(path: &Path, overrides: &[String]) -> Result<Scenario, ScenarioError> {
        Scenario::from_toml_with(&text(path)?, &path.display().to_string(), overrides)
    }
}

/// Reads the text of a scenario's file.
///
/// # Errors
/// If it cannot be read, or is not text.
pub fn text(path: &Path) -> Result<String, ScenarioError> {
    decode_utf8(bytes(path)?, &path.display().to_string())
}

/// Reads a file, of at most one byte more than [`MOST_BYTES`].
///
/// # Errors
/// If it cannot be read.
pub fn bytes(path: &Path) -> Result<Vec<u8>, ScenarioError> {
    let file = path.display().to_string();
    let mut bytes = Vec::new();
    // Opening a folder succeeds on some systems, and reading it fails.
    File::open(path)
        .and_then(|file| file.take(MOST_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|reason| match reason.kind() {
            ErrorKind::IsADirectory => {
                ScenarioError::in_file(&file, None, "is a folder: give the file itself".into())
            }
            _ => {
                let problem = format!("cannot be read: {reason}: check its path and permissions");
                ScenarioError::in_file(&file, None, problem)
            }
        })?;
    Ok(bytes)
}

/// Decodes the text of a scenario's `file` from its first bytes.
pub fn decode_utf8(bytes: Vec<u8>, file: &str) -> Result<String, ScenarioError> {
    if bytes.len() as u64 > MOST_BYTES {
        let problem = format!("is larger than {MOST_BYTES} bytes: this is no scenario");
        return Err(ScenarioError::in_file(file, None, problem));
    }
    memory::check_text_memory(&bytes)
        .map_err(|why| ScenarioError::in_file(file, None, why.to_string()))?;
    String::from_utf8(bytes).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        let bytes = error.as_bytes();
        let byte = bytes[offset];
        let problem =
            format!("is not text in UTF-8: byte {offset} is 0x{byte:02x}: save the file as UTF-8");
        ScenarioError::in_file(file, Some(line_number_at(bytes, offset)), problem)
    })
}

/// What names, units, the tolerance and messages may be.
struct ReadingLimits {
    /// Bytes of a name, which must be allowed everywhere as the name of a folder with files.
    longest_name: usize,
    /// Characters of the name of a unit, which figures show at their axes.
    longest_unit: usize,
    /// Range of the tolerance. The least is the accuracy that double precision leaves after a solve on
    /// a fine grid; an error of a tenth of the length is no accuracy.
    least_tolerance: f64,
    largest_tolerance: f64,
    /// Most mistakes that are told at once.
    reported_mistakes: usize,
}

const LIMITS: ReadingLimits = ReadingLimits {
    longest_name: 100,
    longest_unit: 20,
    least_tolerance: 1e-12,
    largest_tolerance: 0.1,
    reported_mistakes: 8,
};

impl Entries {
    /// The entries in a text, TOML or JSON; messages call it `file`.
    ///
    /// # Errors
    /// If it cannot be parsed, or has an unknown key.
    pub fn from_text(text: &str, file: &str) -> ScenarioResult<Self> {
        Entries::collect_from_text(text, file)?.refuse_unknown()
    }

    /// The entries in a table of the same form, without a text.
    ///
    /// # Errors
    /// If it has an unknown key.
    pub fn from_table(table: Table) -> ScenarioResult<Self> {
        Entries::collect_from_table(ScenarioSource::default(), table).refuse_unknown()
    }

    /// The checked scenario.
    ///
    /// # Errors
    /// If an entry that is needed is missing, or a value is not allowed.
    pub fn check(&self) -> ScenarioResult<Scenario> {
        let entries = self.with_common_places();
        let scenario = entries
            .read()
            .map_err(|error| entries.error_with_others(error))?;
        limits::check_limits(&entries, &scenario)?;
        check_masses_off_axis(&entries, &scenario)?;
        Ok(scenario)
    }

    /// Interprets the entries one after the other; ends at the first mistake.
    fn read(&self) -> ScenarioResult<Scenario> {
        let name = match self.given_value(Key::Name) {
            Some(item) => read_name(item)?,
            None => self.name_of_file(),
        };
        let units = Units {
            length: self
                .given_value(Key::UnitLength)
                .map(read_unit)
                .transpose()?,
            force: self
                .given_value(Key::UnitForce)
                .map(read_unit)
                .transpose()?,
            time: self
                .given_value(Key::UnitTime)
                .map(|item| read_unit_of_time(self, item))
                .transpose()?,
        };
        let rods = self.value_or_default(Key::Rods)?.whole_number(MOST_RODS)?;
        let source = StiffnessSource::from_entries(self, rods)?;
        let rods = read_veins(self, rods, &source)?;
        let joined = read_joined(self, source.blade())?;
        let coupling = read_coupling(self, rods.len() - 1)?;
        let bases = supports::read_base_support(self, rods.len())?;
        let tissue = read_tissue(self, rods.len() - 1, &source)?;
        let weights = loads::read_weights(self, rods.len())?;
        let GravityAcceleration {
            g,
            weighs_points_only,
        } = loads::read_gravity_acceleration(self)?;
        let along = |key| loads::read_loads_along_veins(self, key, rods.len());
        let distributed = along(Key::Distributed)?;
        let foundation = along(Key::FoundationStiffness)?;
        let (follower, couple) = (along(Key::Follower)?, along(Key::Couple)?);
        let along = loads::LoadsAlongVeins {
            distributed: &distributed,
            follower: &follower,
            couple: &couple,
        };
        let factored = loads::read_load_factor(self, &weights, g, along)?;
        let points = loads::read_point_loads(self, rods.len())?;
        let tip_force = self.value_or_default(Key::TipForce)?.vector()?;
        let item = self.value_or_default(Key::TipMoment)?;
        let tip_moment = item.vector()?;
        check_single_rod_moments(item, rods.len(), &[tip_moment])?;
        let held_tip = supports::read_held_tip(self, &rods, joined)?;
        let shared = held_tip.is_some() || joined && rods.len() > 1;
        let grips = supports::read_grips(self, &rods, shared)?;
        let support_motion = read_support_motion(self)?;
        let wind = read_wind(self, rods.len(), &source)?;
        let photo = read_photo(self)?;
        let tolerance = read_tolerance(self.value_or_default(Key::Tolerance)?)?;
        let gravity = match &factored {
            Some(loads) => loads.factor.times(loads.gravity),
            None => Schedule::constant(weights.shared),
        };
        let dynamics = read_dynamics(self, &rods, &source, gravity, [tip_force, tip_moment])?;
        let mut scenario = Scenario {
            name,
            units,
            rods,
            radii: source.radii(),
            blade: source.blade().cloned(),
            base_held: bases.held,
            base_turn_stiffness: bases.turn_stiffness,
            base_spin: bases.spin,
            joined,
            coupling,
            tissue,
            tissue_grown: self.value_or_default(Key::TissueGrown)?.switch()?,
            natural: None,
            gravity: weights.shared,
            own_gravity: weights.own,
            g,
            weighs_points_only,
            distributed,
            foundation,
            factored,
            follower,
            couple,
            couple_follows: self.value_or_default(Key::CoupleFollows)?.switch()?,
            points,
            tip_force,
            tip_moment,
            held_tip,
            grips,
            support_motion,
            wind,
            photo,
            tolerance,
            place_shift: self.largest_place_shift(),
            dynamics,
        };
        scenario.apply_load_factor(0.0);
        Ok(scenario)
    }

    /// The name of a leaf that has none: that of its file.
    fn name_of_file(&self) -> String {
        let stem = Path::new(&self.source.file).file_stem();
        let stem = stem.and_then(|stem| stem.to_str());
        stem.filter(|stem| is_name(stem)).unwrap_or("leaf").into()
    }
}

impl CollectedEntries {
    /// Refuses unknown names, with the errors about the values of the other entries.
    fn refuse_unknown(self) -> ScenarioResult<Entries> {
        let CollectedEntries { entries, unknown } = self;
        let mut unknown = unknown.into_iter();
        match unknown.next() {
            None => Ok(entries),
            Some(first) => {
                let others = unknown.chain(entries.value_errors()).collect();
                Err(ScenarioError { others, ..first })
            }
        }
    }
}

fn read_name(item: EntryValue) -> ScenarioResult<String> {
    let name = item.text()?;
    item.refuse_unless(
        is_name(name),
        format_args!(
            "must be usable as a folder name: 1 to {} letters, digits, spaces and the \
             signs _ - . + with a letter, digit or _ first and no space last",
            LIMITS.longest_name
        ),
    )?;
    Ok(name.to_string())
}

/// Whether a folder can have this name on every system.
fn is_name(name: &str) -> bool {
    let allowed = |c: char| c.is_alphanumeric() || "_-.+ ".contains(c);
    let starts_well = name.starts_with(|c: char| c.is_alphanumeric() || c == '_');
    let ends_well = !name.ends_with(' ');
    starts_well && ends_well && name.len() <= LIMITS.longest_name && name.chars().all(allowed)
}

fn read_unit(item: EntryValue) -> ScenarioResult<String> {
    let unit = item.text()?;
    let longest = LIMITS.longest_unit;
    let printed = !unit.trim().is_empty() && !unit.chars().any(char::is_control);
    item.refuse_unless(
        printed && unit.chars().count() <= longest,
        format_args!("must be 1 to {longest} characters that can be printed"),
    )?;
    Ok(unit.trim().to_string())
}

/// The unit of time, which is that of the others only if the mass is given.
fn read_unit_of_time(entries: &Entries, item: EntryValue) -> ScenarioResult<String> {
    let densities = [Key::Density, Key::MassDensity, Key::BladeMassDensity];
    item.refuse_unless(
        densities.iter().any(|key| entries.is_given(*key)),
        "without a density times are in units of T = sqrt(rho L^4/A), whatever the other units: \
         give dynamics.density or a mass_density, or leave this out",
    )?;
    read_unit(item)
}

fn read_coupling(entries: &Entries, gaps: usize) -> ScenarioResult<Vec<[f64; 3]>> {
    let mut coupling = vec![[0.0; 3]; gaps];
    for (axis, key) in Key::COUPLING.into_iter().enumerate() {
        let stiffness = entries.value_or_default(key)?.number_for_each(gaps)?;
        for (gap, stiffness) in coupling.iter_mut().zip(stiffness) {
            gap[axis] = stiffness;
        }
    }
    Ok(coupling)
}

/// Refuses a mass off the axis of a section that turns freely about a place which moves in time.
fn check_masses_off_axis(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    for (row, point) in scenario.points.iter().enumerate() {
        let mass = point.landing.map_or(point.mass, |landing| landing.mass);
        if point.is_off_axis() && mass > 0.0 {
            let item = entries.value_in_row(Key::PointOffset, row)?;
            item.refuse_unless(
                point.at > 0.0 || !scenario.holds_base_spin(point.vein),
                "is of a mass at a base whose spin a hinge holds (leaf.base_spin), which no motion takes into account: \
                 place the mass above the base",
            )?;
            item.refuse_unless(
                !swings_on_moving_support(scenario, point),
                "is of a mass where a pinned holder moves in time, which would swing it: clamp the holder, or place \
                 the mass elsewhere",
            )?;
        }
    }
    Ok(())
}

/// Whether the section of a point turns freely about a place that moves in time.
fn swings_on_moving_support(scenario: &Scenario, point: &PointLoad) -> bool {
    let Some(motion) = &scenario.support_motion else {
        return false;
    };
    let holds = |(grip, moves): (&Grip, &Schedule<[f64; 3]>)| {
        let here = grip.vein == point.vein && (grip.at[0]..=grip.at[1]).contains(&point.at);
        here && !grip.holds_directions() && !moves.is_constant()
    };
    let tip = scenario.held_tip.as_ref();
    let on_tip = motion.tip.is_some() && point.at == 1.0;
    let turns = on_tip && tip.is_some_and(|held| held.clamps.is_none());
    turns || scenario.grips.iter().zip(&motion.grips).any(holds)
}

fn read_tolerance(item: EntryValue) -> ScenarioResult<f64> {
    let tolerance = item.number()?;
    let (least, largest) = (LIMITS.least_tolerance, LIMITS.largest_tolerance);
    item.refuse_unless(
        tolerance > 0.0 && tolerance <= largest,
        format_args!(
            "must be greater than 0 and at most {largest}: \
             it is the error of the centerlines relative to the length of a rod"
        ),
    )?;
    item.refuse_unless(
        tolerance >= least,
        format_args!(
            "must be at least {least:e}: double precision carries 16 digits, \
             and rounding in the solve takes about four of them"
        ),
    )?;
    Ok(tolerance)
}

impl Entries {
    /// The errors about the values of keys that are there.
    fn value_errors(&self) -> Vec<ScenarioError> {
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
    fn error_with_others(&self, error: ScenarioError) -> ScenarioError {
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
        // The error about the first missing key names all missing keys.
        let is_missing = |error: &ScenarioError| error.key.is_some_and(|key| !self.is_given(key));
        let first = found.iter().position(is_missing);
        let others = found.into_iter().enumerate().skip(1);
        let others = others.filter(|(k, error)| first == Some(*k) || !is_missing(error));
        let others = others
            .map(|(_, error)| error)
            .take(LIMITS.reported_mistakes - 1)
            .collect();
        ScenarioError { others, ..error }
    }

    /// Replaces the refused entry by one that is allowed. Returns false if none is known, or if other
    /// entries are right or wrong by what the refused one says.
    fn replace_refused_entry(&mut self, error: &ScenarioError) -> bool {
        let Some(key) = error.key.filter(|key| !self.other_entries_depend(*key)) else {
            return false;
        };
        let value = match key.missing_key_rule() {
            MissingKeyRule::Required(example) => Some(example),
            _ => None,
        };
        self.replace_value(key, value);
        true
    }

    /// Whether other entries are right or wrong by what this one says: lists are as long as
    /// `leaf.rods`, if there are any.
    fn other_entries_depend(&self, key: Key) -> bool {
        match key.form() {
            ValueSchema::Whole if key == Key::Rods => {
                Key::all().any(|key| self.is_list_of_rods(key))
            }
            ValueSchema::Text
            | ValueSchema::TextPerRod
            | ValueSchema::Whole
            | ValueSchema::WholeOrList => key.table() != "units",
            _ => false,
        }
    }

    /// Whether a list is given, with as many entries as there are rods or gaps between them.
    fn is_list_of_rods(&self, key: Key) -> bool {
        let single = match key.form() {
            ValueSchema::PerRod(_)
            | ValueSchema::TextPerRod
            | ValueSchema::Quantity(_)
            | ValueSchema::PerGap(_)
            | ValueSchema::Fan => 0,
            ValueSchema::VectorPerRod | ValueSchema::VectorQuantity(_) => 1,
            _ => return false,
        };
        self.given_value(key)
            .is_some_and(|item| list_depth(item.value) > single)
    }
}

/// How deep lists are nested; in a profile, within the value at a knot.
fn list_depth(value: &Value) -> usize {
    match value {
        Value::Array(list) => 1 + list.first().map_or(0, list_depth),
        Value::Table(profile) => profile
            .get("value")
            .map_or(0, |value| list_depth(value).saturating_sub(1)),
        _ => 0,
    }
}

/// Whether an error may follow from the value that replaced that of another: a wall is compared with
/// its diameter.
fn may_follow_from(error: &ScenarioError, on: &ScenarioError) -> bool {
    let in_section = on.key.is_some_and(|key| key.table() == "section");
    // A channel without the wall that is refused has none.
    let of_wall = on.key == Some(Key::Wall) && error.key == Some(Key::SectionShape);
    of_wall || in_section && matches!(error.key, Some(Key::Wall | Key::InnerDiameter))
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
