//! Serializes a checked scenario as JSON of the same form as the TOML, which can be read
//! in place of it.

use std::sync::Arc;

use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::{Value, json};

use super::section::{Outline, Property, Section};
use super::{Key, Profile, Rod, Scenario, Schedule, ascending};

/// The sections of a scenario, and what else is theirs.
struct Sections<'a> {
    sections: &'a [Arc<Section>],
    density: bool,
    rotary_inertia: bool,
}

/// All entries with their values, including defaults, but not those that `[section]` gives: a JSON object from which
/// [`Scenario::from_toml`] makes an equal scenario. An infinite stiffness is
/// `"inf"`.
impl Serialize for Scenario {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let sections = self.sections();
        let entry = |key: Key| Some((key.parts(), self.written(key, sections.as_ref())?));
        let entries: Vec<_> = Key::all().filter_map(entry).collect();
        let mut top = serializer.serialize_map(None)?;
        for entries in entries.chunk_by(|(one, _), (other, _)| one.0 == other.0) {
            match &entries[0] {
                (("", name), value) => top.serialize_entry(name, value)?,
                ((table, _), _) => top.serialize_entry(table, &Table(entries))?,
            }
        }
        top.end()
    }
}

/// The entries of a table, in the order of the format.
struct Table<'e>(&'e [((&'static str, &'static str), Value)]);

impl Serialize for Table<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|((_, name), value)| (name, value)))
    }
}

impl Scenario {
    /// The value of a key; `None` if other keys determine it.
    fn written(&self, key: Key, sections: Option<&Sections>) -> Option<Value> {
        match key.parts().0 {
            "section" => return sections?.written(key),
            "stiffness" if sections.is_some() => return None,
            "tip" => return self.of_tip(key),
            "dynamics" => return self.of_dynamics(key, sections),
            _ => {}
        }
        type Triple = fn(&Rod) -> &[Profile; 3];
        let triples: [([Key; 3], Triple); 3] = [
            (Key::COUPLE, |rod| &rod.couple_stiffness),
            (Key::FORCE, |rod| &rod.force_stiffness),
            (Key::REST, |rod| &rod.rest_curvature),
        ];
        for (keys, of) in triples {
            if let Some(which) = keys.iter().position(|one| *one == key) {
                return Some(quantity(self.rods.iter().map(|rod| &of(rod)[which])));
            }
        }
        Some(match key {
            Key::Name => json!(self.name),
            Key::UnitLength => json!(self.units.length.as_deref()?),
            Key::UnitForce => json!(self.units.force.as_deref()?),
            Key::Rods => json!(self.rods.len()),
            Key::Length => number_or_list(self.rods.iter().map(|rod| rod.length)),
            Key::Fan => list(self.rods.iter().map(|rod| rod.angle)),
            Key::Joined => json!(self.joined),
            Key::RestStretch => quantity(self.rods.iter().map(|rod| &rod.rest_stretch)),
            Key::CouplingX | Key::CouplingY | Key::CouplingZ => {
                // A single rod has no gaps: any number will do.
                let axis = Key::COUPLING.iter().position(|axis| *axis == key)?;
                number_or_list(self.coupling.iter().map(|gap| gap[axis]))
            }
            Key::Gravity => list(self.gravity),
            Key::TipForce => list(self.tip_force),
            Key::TipMoment => list(self.tip_moment),
            Key::Tolerance => number(self.tolerance),
            _ => return None,
        })
    }

    fn of_tip(&self, key: Key) -> Option<Value> {
        let held = self.held_tip.as_ref()?;
        let clamps = held.clamps.as_deref();
        Some(match key {
            Key::TipHeld if clamps.is_some() => json!("clamped"),
            Key::TipHeld => json!("pinned"),
            Key::TipPosition => list(held.position),
            Key::TipAngles => number_or_list(clamps?.iter().map(|clamp| clamp.angle)),
            _ => number_or_list(clamps?.iter().map(|clamp| clamp.twist)),
        })
    }

    fn of_dynamics(&self, key: Key, sections: Option<&Sections>) -> Option<Value> {
        let dynamics = &self.dynamics;
        Some(match key {
            Key::Density if sections.is_some_and(|it| it.density) => return None,
            Key::RotaryInertia if sections.is_some_and(|it| it.rotary_inertia) => return None,
            Key::Density => quantity(dynamics.density.iter()),
            // If given, it would be larger about d1.
            Key::RotaryInertia if dynamics.polar_excess == 0.0 => return None,
            Key::RotaryInertia => quantity(dynamics.rotary_inertia.iter()),
            Key::ExternalDamping => number(dynamics.external_damping),
            Key::InternalDamping => number(dynamics.internal_damping),
            Key::Duration => number(dynamics.duration),
            Key::OutputInterval => number(dynamics.output_interval),
            Key::Clamped => json!(dynamics.clamped),
            Key::Start => json!(dynamics.start),
            Key::GravityInTime => in_time(&dynamics.gravity, self.gravity, "value", list)?,
            Key::TipForceInTime => in_time(&dynamics.tip_force, self.tip_force, "value", list)?,
            Key::TipMomentInTime => in_time(&dynamics.tip_moment, self.tip_moment, "value", list)?,
            Key::RestInTime => in_time(&dynamics.rest, 1.0, "factor", number)?,
            _ => return None,
        })
    }

    /// The sections, if they give the stiffnesses.
    fn sections(&self) -> Option<Sections<'_>> {
        let sections = self.radii.sections();
        let gives = |(rod, section): (&Rod, &Arc<Section>)| {
            (0..3).all(|axis| {
                rod.couple_stiffness[axis] == section.profile(Property::Couple(axis))
                    && rod.force_stiffness[axis] == section.profile(Property::Force(axis))
            })
        };
        if sections.len() != self.rods.len() || !self.rods.iter().zip(sections).all(gives) {
            return None;
        }
        let give = |profiles: &[Profile], property| {
            let mut pairs = profiles.iter().zip(sections);
            pairs.all(|(profile, section)| *profile == section.profile(property))
        };
        let density = give(&self.dynamics.density, Property::Density);
        let inertia = give(&self.dynamics.rotary_inertia, Property::RotaryInertia);
        Some(Sections {
            sections,
            density,
            rotary_inertia: density && inertia,
        })
    }
}

impl Sections<'_> {
    fn written(&self, key: Key) -> Option<Value> {
        let outline = self.sections.first()?.outline;
        let of = |of: fn(&Section) -> &Profile| {
            quantity(self.sections.iter().map(|section| of(section)))
        };
        Some(match key {
            Key::SectionShape => json!(outline),
            Key::Diameter if outline == Outline::Circle => of(|section| &section.width),
            Key::Width | Key::Thickness if outline == Outline::Circle => return None,
            Key::Width => of(|section| &section.width),
            Key::Thickness => of(|section| &section.thickness),
            Key::Young => of(|section| &section.young),
            Key::Poisson => of(|section| &section.poisson),
            Key::MassDensity if self.density => of(|section| &section.mass_density),
            _ => return None,
        })
    }
}

/// A number; JSON has no infinity: `"inf"`.
fn number(number: f64) -> Value {
    match number.is_infinite() {
        true => json!("inf"),
        false => json!(number),
    }
}

fn list(numbers: impl IntoIterator<Item = f64>) -> Value {
    numbers.into_iter().map(number).collect()
}

/// A single number if all are the same.
fn number_or_list(numbers: impl Iterator<Item = f64>) -> Value {
    let numbers: Vec<f64> = numbers.collect();
    let first = numbers.first().copied().unwrap_or(0.0);
    match numbers.iter().all(|number| *number == first) {
        true => number(first),
        false => list(numbers),
    }
}

/// A quantity of all rods, in the shortest form.
fn quantity<'p>(profiles: impl Iterator<Item = &'p Profile>) -> Value {
    let profiles: Vec<&Profile> = profiles.collect();
    if profiles.iter().all(|it| matches!(it, Profile::Constant(_))) {
        return number_or_list(profiles.iter().map(|profile| profile.at(0.0)));
    }
    let kinks = profiles.iter().flat_map(|profile| profile.kinks());
    let at = ascending([0.0, 1.0].iter().chain(kinks).copied());
    let values = |profile: &Profile| list(at.iter().map(|&sigma| profile.at(sigma)));
    let value = match profiles.iter().all(|profile| *profile == profiles[0]) {
        true => values(profiles[0]),
        false => profiles.iter().map(|profile| values(profile)).collect(),
    };
    json!({ "at": at, "value": value })
}

/// A quantity in time; `None` if it is always the one at rest.
fn in_time<T: Copy + PartialEq>(
    schedule: &Schedule<T>,
    at_rest: T,
    name: &str,
    written: impl Fn(T) -> Value,
) -> Option<Value> {
    let values = || schedule.value.iter().map(|&value| written(value));
    let table = || json!({ "at": schedule.at, name: values().collect::<Value>() });
    (*schedule != Schedule::constant(at_rest)).then(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use leafdyn_testing::pairs;

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
        let taper =
            "{ at = [0, 0.4, 1], value = [[0.2, 0.1, 0.05], [0.2, 0.2, 0.1], [0.2, 0.1, 0.1]] }";
        let section = format!(
            "section = {{ shape = 'circle', diameter = {taper}, young = [1e3, 2e3, 3e3], mass_density = 2 }}"
        );
        let mass = tail.find("density").unwrap()..tail.find("internal").unwrap();
        let tail = [&tail[..mass.start], &tail[mass.end..]].concat();
        let tapering = format!("{head}{section}\n{tail}");
        let even = tapering.replace(taper, "0.3");
        for text in [FULL, paper, swing, buckled, held, &tapering, &even] {
            let scenario = Scenario::from_toml(text).unwrap();
            let json = serde_json::to_string(&scenario).unwrap();
            let again = Scenario::from_toml(&json);
            assert_eq!(again.unwrap(), scenario, "{json}");
            let section = json.contains("section");
            assert_eq!(section, text.contains("section ="), "{json}");
            assert!(!(section && json.contains("torsion")), "{json}");
            let summary = format!("{{\"outcome\": \"converged\", \"input\": {json}}}");
            assert_eq!(Scenario::from_toml(&summary).unwrap(), scenario);
        }
    }

    /// What a section gives is not written beside it, but what is given in its place is.
    #[test]
    fn a_section_is_written_as_it_was_given() {
        let head = "name = 'strip'\nleaf = { rods = 1, length = 0.3, fan = [0.0] }\n";
        let inertia_given = "[dynamics]\nrotary_inertia = 1e-8";
        let table = "
            shape = 'rectangle', width = 0.04, thickness = 4e-4, mass_density = 800 => rotary_inertia
            shape = 'ellipse', width = 0.04, thickness = 0.04, mass_density = 800 =>
            shape = 'circle', diameter = { at = [0, 1], value = [0.02, 0.01] }, mass_density = 800 => rotary_inertia
            shape = 'circle', diameter = 0.02, poisson = 0.4 => density
        ";
        for (sides, beside) in pairs(table) {
            let [density, inertia] = ["density", "rotary_inertia"].map(|key| key == beside);
            let dynamics = if inertia { inertia_given } else { "" };
            let text = format!("{head}section = {{ {sides}, young = 2e9 }}\n{dynamics}");
            let scenario = Scenario::from_toml(&text).unwrap();
            let written = serde_json::to_value(&scenario).unwrap();
            let again = Scenario::from_toml(&written.to_string()).unwrap();
            assert_eq!(again, scenario);
            assert_eq!(serde_json::to_value(&again).unwrap(), written);
            assert!(sides.contains(written["section"]["shape"].as_str().unwrap()));
            for key in ["diameter", "width", "thickness"] {
                assert_eq!(written["section"].get(key).is_some(), sides.contains(key));
            }
            assert!(written.get("stiffness").is_none());
            assert_eq!(written["dynamics"].get("density").is_some(), density);
            assert_eq!(written["dynamics"].get("rotary_inertia").is_some(), inertia);
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
        let table = r#"
            { => not valid JSON
            {"name": null} => is no scenario
            {"name": "a", "leaf": {"rod": 1}} => did you mean leaf.rods?
        "#;
        for (text, part) in pairs(table) {
            let error = Scenario::from_toml(text).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
