//! Serializes a checked scenario as JSON of the same form as the TOML, which can be read
//! in place of it.

use serde::ser::{Serialize, SerializeMap, Serializer};

use super::error::ScenarioError;
use super::key::Range;
use super::section::{Outline, Section};
use super::{Key, Profile, Rod, Scenario, Schedule, Start, ascending};

/// A value to be written.
enum Written<'a> {
    Text(&'a str),
    Switch(bool),
    Whole(usize),
    /// JSON has no infinity: `"inf"`.
    Number(f64),
    List(Vec<Written<'a>>),
    Table(Vec<(&'static str, Written<'a>)>),
}

impl Serialize for Written<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Written::Text(text) => serializer.serialize_str(text),
            Written::Switch(switch) => serializer.serialize_bool(*switch),
            Written::Whole(whole) => serializer.serialize_u64(*whole as u64),
            Written::Number(number) if number.is_infinite() => serializer.serialize_str("inf"),
            Written::Number(number) => serializer.serialize_f64(*number),
            Written::List(list) => serializer.collect_seq(list),
            Written::Table(table) => {
                let mut object = serializer.serialize_map(Some(table.len()))?;
                for (key, value) in table {
                    object.serialize_entry(key, value)?;
                }
                object.end()
            }
        }
    }
}

/// All entries with their values, including defaults: a JSON object from which
/// [`Scenario::from_toml`] makes an equal scenario. An infinite stiffness is
/// `"inf"`.
impl Serialize for Scenario {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut top: Vec<(&str, Written)> = Vec::new();
        for key in Key::all() {
            let Some(value) = self.written(key) else {
                continue;
            };
            match (key.parts(), top.last_mut()) {
                (("", name), _) => top.push((name, value)),
                ((table, name), Some((last, Written::Table(entries)))) if *last == table => {
                    entries.push((name, value));
                }
                ((table, name), _) => top.push((table, Written::Table(vec![(name, value)]))),
            }
        }
        Written::Table(top).serialize(serializer)
    }
}

impl Scenario {
    /// The value of a key; `None` if other keys determine it.
    fn written(&self, key: Key) -> Option<Written<'_>> {
        match key.parts().0 {
            "section" => return self.of_section(key),
            "stiffness" if self.section(0).is_some() => return None,
            "tip" => return self.of_tip(key),
            "dynamics" => return self.of_dynamics(key),
            _ => {}
        }
        Some(match key {
            Key::Name => Written::Text(&self.name),
            Key::UnitLength => Written::Text(self.units.length.as_deref()?),
            Key::UnitForce => Written::Text(self.units.force.as_deref()?),
            Key::Rods => Written::Whole(self.rods.len()),
            Key::Length => number_or_list(self.rods.iter().map(|rod| rod.length)),
            Key::Fan => list(self.rods.iter().map(|rod| rod.angle)),
            Key::Joined => Written::Switch(self.joined),
            Key::Torsion | Key::Bending2 | Key::Bending3 => {
                self.of_rods(Key::COUPLE, key, |rod| &rod.couple_stiffness)
            }
            Key::Axial | Key::Shear2 | Key::Shear3 => {
                self.of_rods(Key::FORCE, key, |rod| &rod.force_stiffness)
            }
            Key::RestTwist | Key::RestBend2 | Key::RestBend3 => {
                self.of_rods(Key::REST, key, |rod| &rod.rest_curvature)
            }
            Key::RestStretch => quantity(self.rods.iter().map(|rod| &rod.rest_stretch)),
            Key::CouplingX | Key::CouplingY | Key::CouplingZ => {
                // A single rod has no gaps: any number will do.
                let axis = Key::COUPLING.iter().position(|axis| *axis == key)?;
                number_or_list(self.coupling.iter().map(|gap| gap[axis]))
            }
            Key::Gravity => list(self.gravity),
            Key::TipForce => list(self.tip_force),
            Key::TipMoment => list(self.tip_moment),
            Key::Tolerance => Written::Number(self.tolerance),
            _ => return None,
        })
    }

    /// The value of a key of `[tip]`.
    fn of_tip(&self, key: Key) -> Option<Written<'_>> {
        let held = self.held_tip.as_ref()?;
        let clamps = held.clamps.as_deref();
        Some(match key {
            Key::TipHeld if clamps.is_some() => Written::Text("clamped"),
            Key::TipHeld => Written::Text("pinned"),
            Key::TipPosition => list(held.position),
            Key::TipAngles => number_or_list(clamps?.iter().map(|clamp| clamp.angle)),
            _ => number_or_list(clamps?.iter().map(|clamp| clamp.twist)),
        })
    }

    /// The value of a key of `[dynamics]`.
    fn of_dynamics(&self, key: Key) -> Option<Written<'_>> {
        let dynamics = &self.dynamics;
        let of_section = section_of(&dynamics.density[0]).is_some();
        Some(match key {
            Key::Density | Key::RotaryInertia if of_section => return None,
            Key::Density => quantity(dynamics.density.iter()),
            // If given, it would be larger about d1.
            Key::RotaryInertia if dynamics.polar_excess == 0.0 => return None,
            Key::RotaryInertia => quantity(dynamics.rotary_inertia.iter()),
            Key::ExternalDamping => Written::Number(dynamics.external_damping),
            Key::InternalDamping => Written::Number(dynamics.internal_damping),
            Key::Duration => Written::Number(dynamics.duration),
            Key::OutputInterval => Written::Number(dynamics.output_interval),
            Key::Clamped => Written::Switch(dynamics.clamped),
            Key::Start => Written::Text(match dynamics.start {
                Start::Released => "released",
                Start::AtRest => "at-rest",
            }),
            Key::GravityInTime => in_time(&dynamics.gravity, self.gravity, "value", list)?,
            Key::TipForceInTime => in_time(&dynamics.tip_force, self.tip_force, "value", list)?,
            Key::TipMomentInTime => in_time(&dynamics.tip_moment, self.tip_moment, "value", list)?,
            Key::RestInTime => in_time(&dynamics.rest, 1.0, "factor", Written::Number)?,
            _ => return None,
        })
    }

    /// The section from which the stiffnesses of a rod follow.
    fn section(&self, rod: usize) -> Option<&Section> {
        section_of(&self.rods[rod].couple_stiffness[0])
    }

    /// The value of a key of sections that change along the rods; for constant ones the
    /// stiffnesses are written instead.
    fn of_section(&self, key: Key) -> Option<Written<'_>> {
        let outline = self.section(0)?.outline;
        let sections = || (0..self.rods.len()).filter_map(|rod| self.section(rod));
        Some(match key {
            Key::SectionShape => Written::Text(match outline {
                Outline::Ellipse => "ellipse",
                Outline::Rectangle => "rectangle",
            }),
            Key::Width => quantity(sections().map(|section| &section.width)),
            Key::Thickness => quantity(sections().map(|section| &section.thickness)),
            Key::Young => quantity(sections().map(|section| &section.young)),
            Key::Poisson => quantity(sections().map(|section| &section.poisson)),
            Key::MassDensity => {
                section_of(&self.dynamics.density[0])?;
                quantity(sections().map(|section| &section.mass_density))
            }
            _ => return None,
        })
    }

    /// One of three quantities of all rods.
    fn of_rods(
        &self,
        keys: [Key; 3],
        key: Key,
        of: impl Fn(&Rod) -> &[Profile; 3],
    ) -> Written<'static> {
        let which = keys.iter().position(|one| *one == key).unwrap_or(0);
        quantity(self.rods.iter().map(|rod| &of(rod)[which]))
    }
}

fn section_of(profile: &Profile) -> Option<&Section> {
    match profile {
        Profile::Section { section, .. } => Some(section),
        _ => None,
    }
}

fn list(numbers: impl IntoIterator<Item = f64>) -> Written<'static> {
    Written::List(numbers.into_iter().map(Written::Number).collect())
}

/// A single number if all are the same.
fn number_or_list(numbers: impl Iterator<Item = f64>) -> Written<'static> {
    let numbers: Vec<f64> = numbers.collect();
    let first = numbers.first().copied().unwrap_or(0.0);
    match numbers.iter().all(|number| *number == first) {
        true => Written::Number(first),
        false => list(numbers),
    }
}

/// A quantity of all rods, in the shortest form.
fn quantity<'p>(profiles: impl Iterator<Item = &'p Profile>) -> Written<'static> {
    let profiles: Vec<&Profile> = profiles.collect();
    if profiles.iter().all(|it| matches!(it, Profile::Constant(_))) {
        return number_or_list(profiles.iter().map(|profile| profile.at(0.0)));
    }
    let kinks = profiles.iter().flat_map(|profile| profile.kinks());
    let at = ascending([0.0, 1.0].iter().chain(kinks).copied());
    let values = |profile: &Profile| list(at.iter().map(|&sigma| profile.at(sigma)));
    let value = match profiles.iter().all(|profile| *profile == profiles[0]) {
        true => values(profiles[0]),
        false => Written::List(profiles.iter().map(|profile| values(profile)).collect()),
    };
    Written::Table(vec![("at", list(at.iter().copied())), ("value", value)])
}

/// A quantity in time; `None` if it is always the one at rest.
fn in_time<T: Copy + PartialEq>(
    schedule: &Schedule<T>,
    at_rest: T,
    name: &'static str,
    written: impl Fn(T) -> Written<'static>,
) -> Option<Written<'static>> {
    let values = schedule.value.iter().map(|&value| written(value));
    let table = || {
        let at = list(schedule.at.iter().copied());
        Written::Table(vec![("at", at), (name, Written::List(values.collect()))])
    };
    (*schedule != Schedule::constant(at_rest)).then(table)
}

/// Converts a scenario in JSON, or the `input` of a result, to TOML; `None` if the text
/// is not a JSON object.
pub(super) fn from_json(text: &str, file: &str) -> Option<Result<String, ScenarioError>> {
    // No TOML begins like this.
    if !text.trim_start().starts_with('{') {
        return None;
    }
    let parsed = serde_json::from_str::<serde_json::Value>(text).map_err(|error| {
        let line = Some(error.line());
        ScenarioError::in_file(file, line, format!("not valid JSON: {error}"))
    });
    Some(parsed.and_then(|mut document| {
        let form = match document.get_mut("input") {
            Some(input) => input.take(),
            None => document,
        };
        let form = toml::Table::try_from(form);
        let mut form = form.map_err(|error| {
            ScenarioError::in_file(file, None, format!("is no scenario: {error}"))
        })?;
        for key in Key::all().filter(|key| key.form().range() == Range::PositiveOrInfinite) {
            let (table, name) = key.parts();
            let value = form.get_mut(table).and_then(|table| table.get_mut(name));
            value.into_iter().for_each(restore_infinity);
        }
        Ok(form.to_string())
    }))
}

/// Turns `"inf"`, for which JSON has no number, into the number.
fn restore_infinity(value: &mut toml::Value) {
    match value {
        toml::Value::String(text) if text == "inf" => *value = toml::Value::Float(f64::INFINITY),
        toml::Value::Array(list) => list.iter_mut().for_each(restore_infinity),
        _ => (),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uses every feature of the format.
    const FULL: &str = r#"
        name = "full"
        units = { length = "cm", force = "N" }
        leaf = { rods = 3, length = [1.0, 0.7, 0.1], fan = "paper", joined = false }
        stiffness = { torsion = [1.0, 0.3333333333333333, 3.0], bending_2 = { at = [0.0, 0.3, 1.0], value = [1.0, 0.1, 0.2] }, bending_3 = { at = [0, 1], value = [[1, 2], [1, 3], [1, 4]] }, axial = inf, shear_2 = [inf, 100, inf], shear_3 = 1e2 }
        rest = { twist = -0.1, stretch = 1.1 }
        coupling = { y = [0.1, 0.2], z = 1 }
        load = { gravity = [0, 1e-3, -1.0], tip_force = [0.1, 0, 0] }
        solve = { tolerance = 1e-7 }
        [dynamics]
        density = { at = [0.0, 0.5, 1.0], value = [1.0, 0.7, 0.3] }
        section_radius = { at = [0.0, 0.25, 1.0], value = [0.2, 0.1, 0.05] }
        internal_damping = 0.01
        duration = 3.3
        start = "at-rest"
        gravity = { at = [0.0, 1.0], value = [[0, 0, 0], [0, 0, -1]] }
        rest = { at = [0.0, 0.1], factor = [1.0, 2.0] }
    "#;

    #[test]
    fn a_scenario_read_from_its_json_is_the_same() {
        let paper = include_str!("../../scenarios/paper/fig04.toml");
        let swing = include_str!("../../scenarios/motion/swing.toml");
        let buckled = include_str!("../../scenarios/classic/elastica_buckled.toml");
        let held = include_str!("../../scenarios/classic/twisted_strip.toml");
        let (head, tail) = FULL.split_at(FULL.find("stiffness").unwrap());
        let tail = &tail[tail.find("rest").unwrap()..];
        let section = "section = { shape = 'circle', diameter = { at = [0, 0.4, 1], value = [[0.2, 0.1, 0.05], [0.2, 0.2, 0.1], [0.2, 0.1, 0.1]] }, young = [1e3, 2e3, 3e3], mass_density = 2 }";
        let mass = tail.find("density").unwrap()..tail.find("internal").unwrap();
        let tail = [&tail[..mass.start], &tail[mass.end..]].concat();
        let tapering = format!("{head}{section}\n{tail}");
        let even = tapering.replace(
            "{ at = [0, 0.4, 1], value = [[0.2, 0.1, 0.05], [0.2, 0.2, 0.1], [0.2, 0.1, 0.1]] }",
            "0.3",
        );
        for text in [FULL, paper, swing, buckled, held, &tapering, &even] {
            let scenario = Scenario::from_toml(text).unwrap();
            let json = serde_json::to_string(&scenario).unwrap();
            let again = Scenario::from_toml(&json);
            assert_eq!(again.unwrap(), scenario, "{json}");
            let summary = format!("{{\"outcome\": \"converged\", \"input\": {json}}}");
            assert_eq!(Scenario::from_toml(&summary).unwrap(), scenario);
        }
    }

    #[test]
    fn what_all_rods_share_is_one_number() {
        let json = serde_json::to_value(Scenario::from_toml(FULL).unwrap()).unwrap();
        assert_eq!(json["stiffness"]["axial"], "inf");
        assert_eq!(json["stiffness"]["shear_3"], 100.0);
        assert_eq!(json["coupling"]["y"], serde_json::json!([0.1, 0.2]));
        assert!(json["dynamics"].get("tip_force").is_none());
    }

    #[test]
    fn errors_in_json_are_refused() {
        for (text, part) in [
            ("{", "not valid JSON"),
            (r#"{"name": null}"#, "is no scenario"),
            (
                r#"{"name": "a", "leaf": {"rod": 1}}"#,
                "did you mean leaf.rods?",
            ),
        ] {
            let error = Scenario::from_toml(text).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
