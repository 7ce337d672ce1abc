//! Serializes a checked scenario as JSON of the same form as the TOML, which can be read
//! in place of the TOML.

#[cfg(test)]
mod tests;

use crate::scenario::blade::Spline;
use crate::scenario::checked::Scenario;
use crate::scenario::format::{Key, TablePath};
use crate::scenario::loads::{PointLoad, PolarInertia};
use crate::scenario::photo::axis_name;
use crate::scenario::profile::{Profile, RodPlace, knot_places};
use crate::scenario::schedule::{InTime, Knots, Schedule, Sine};
use crate::scenario::section::{HollowSection, Property, Section, SectionOutline, ShearLaw};
use crate::scenario::supports::Grip;
use crate::scenario::veins::{Rod, StiffnessSource, Tissue};
use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::{Value, json};
use std::sync::Arc;

/// The sections of a scenario where they give the stiffnesses.
struct SerializedSections<'a> {
    sections: &'a [Arc<Section>],
    /// Whether they give the densities, too.
    density: bool,
}

/// An entry of the format with its value.
struct SerializedEntry {
    path: TablePath<'static>,
    value: Value,
}

/// A JSON object from which [`Scenario::from_toml`] makes an equal scenario: all entries with their
/// values, including defaults, but not those that `[section]` or `[blade]` gives. An infinite
/// stiffness is `"inf"`.
impl Serialize for Scenario {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let sections = self.sections();
        let entry = |key: Key| match key {
            // All tables of a name stand where the first of its keys does.
            Key::PointVein | Key::GripVein => Some(SerializedEntry {
                path: TablePath::split(key.table()),
                value: self.table_rows(key)?,
            }),
            _ if key.is_repeated() => None,
            _ => Some(SerializedEntry {
                path: key.table_path(),
                value: self.serialized_value(key, sections.as_ref())?,
            }),
        };
        let entries: Vec<_> = Key::all().filter_map(entry).collect();
        let mut top = serializer.serialize_map(None)?;
        for entries in entries.chunk_by(|one, other| one.path.table == other.path.table) {
            let SerializedEntry { path, value } = &entries[0];
            match path.table {
                "" => top.serialize_entry(path.name, value)?,
                table => top.serialize_entry(table, &SerializedTable(entries))?,
            }
        }
        top.end()
    }
}

impl Scenario {
    /// The scenario as TOML, with all entries and their values, from which [`Scenario::from_toml`] makes an equal one.
    pub fn to_toml(&self) -> String {
        let json = serde_json::to_value(self).unwrap_or_default();
        let value = toml_value(&json).unwrap_or(toml::Value::Table(toml::Table::new()));
        toml::to_string(&value).unwrap_or_default()
    }
}

/// A value of JSON as one of TOML, in which an infinite number is no text. TOML has no null.
fn toml_value(json: &Value) -> Option<toml::Value> {
    Some(match json {
        Value::Null => return None,
        Value::Bool(switch) => toml::Value::Boolean(*switch),
        Value::Number(number) => match number.as_i64() {
            Some(whole) => toml::Value::Integer(whole),
            None => toml::Value::Float(number.as_f64()?),
        },
        Value::String(text) if text == "inf" => toml::Value::Float(f64::INFINITY),
        Value::String(text) => toml::Value::String(text.clone()),
        Value::Array(all) => toml::Value::Array(all.iter().filter_map(toml_value).collect()),
        Value::Object(all) => {
            let entries = all.iter();
            let entries =
                entries.filter_map(|(key, value)| Some((key.clone(), toml_value(value)?)));
            toml::Value::Table(entries.collect())
        }
    })
}

/// The entries of a table, in the order of the format.
struct SerializedTable<'e>(&'e [SerializedEntry]);

impl Serialize for SerializedTable<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let entries = self.0.iter();
        serializer.collect_map(entries.map(|entry| (entry.path.name, &entry.value)))
    }
}

impl Scenario {
    /// All points that are loaded, or all grips, by the first of their keys.
    fn table_rows(&self, first: Key) -> Option<Value> {
        let point = |point: &PointLoad| {
            let varying = point.in_time.as_deref();
            let [force, moment] =
                varying.map_or([point.force, point.moment], |it| [it.force, it.moment]);
            let mut row = json!({
                "vein": point.vein + 1, "at": point.at,
                "mass": point.landing.map_or(point.mass, |landing| landing.mass),
                "force": list_value(force), "moment": list_value(moment),
                "follows": point.follows, "offset": list_value(point.offset),
            });
            if let Some(landing) = point.landing {
                row["from"] = number_value(landing.from);
                row["velocity"] = list_value(landing.velocity);
            }
            if let Some(varying) = varying {
                row["factor"] = schedule_value(&varying.factor, "factor", number_value);
            }
            row
        };
        let moves = self.support_motion.as_ref().map_or(&[][..], |it| &it.grips);
        let grip = |(number, grip): (usize, &Grip)| {
            let [from, to] = grip.at;
            let moved = match moves.get(number) {
                Some(moves) => vectors_value(moves),
                None => list_value(grip.displacement),
            };
            json!({
                "vein": grip.vein + 1, "held": grip.held, "move": moved,
                "at": if from == to { json!(from) } else { list_value(grip.at) },
                "stiffness": list_value(grip.stiffness),
                "turn_stiffness": number_value(grip.turn_stiffness),
            })
        };
        let rows: Vec<Value> = match first {
            Key::PointVein => self.points.iter().map(point).collect(),
            _ => self.grips.iter().enumerate().map(grip).collect(),
        };
        (!rows.is_empty()).then(|| rows.into())
    }

    /// The value of a key; `None` if other keys determine it.
    fn serialized_value(&self, key: Key, sections: Option<&SerializedSections>) -> Option<Value> {
        if let Some(blade) = &self.blade {
            match (key, blade.curvature()) {
                _ if key.follows_from_blade() => return None,
                (Key::RestTwist, Some(_)) => return None,
                (Key::RestBend2, Some(curvature)) => return Some(spline_value(curvature)),
                _ => {}
            }
        }
        match key.table() {
            "blade" => return self.blade_value(key),
            "section" => return sections?.serialized_value(key),
            "stiffness" if sections.is_some() => return None,
            "tip" => return self.tip_value(key),
            "photo" => return self.photo_value(key),
            "tissue" => return self.tissue_value(key),
            "wind" => return self.wind_value(key),
            "dynamics" => return self.dynamics_value(key, sections),
            _ if key == Key::Elevation && self.blade.is_some() => {
                return Some(number_value(self.blade.as_ref()?.elevation));
            }
            _ => {}
        }
        let triple = |keys: [Key; 3], of: fn(&Rod) -> &[Profile; 3]| {
            let axis = keys.iter().position(|one| *one == key)?;
            Some(quantity_value(self.rods.iter().map(|rod| &of(rod)[axis])))
        };
        let of_veins = triple(Key::COUPLE, |rod| &rod.couple_stiffness)
            .or_else(|| triple(Key::FORCE, |rod| &rod.force_stiffness))
            .or_else(|| triple(Key::REST_CURVATURE, |rod| &rod.rest_curvature));
        if of_veins.is_some() {
            return of_veins;
        }
        Some(match key {
            Key::Name => json!(self.name),
            Key::UnitLength => json!(self.units.length.as_deref()?),
            Key::UnitForce => json!(self.units.force.as_deref()?),
            Key::UnitTime => json!(self.units.time.as_deref()?),
            Key::Rods => json!(self.rods.len()),
            Key::Length => number_or_list(self.rods.iter().map(|rod| rod.length)),
            Key::Base => vector_or_list(self.rods.iter().map(|rod| rod.base)),
            Key::Elevation => number_or_list(self.rods.iter().map(|rod| rod.elevation)),
            Key::BaseHeld => match self.base_held.split_first() {
                Some((first, others)) if others.iter().all(|other| other == first) => json!(first),
                _ => json!(self.base_held),
            },
            Key::BaseSpin => json!(self.base_spin),
            Key::BaseTurnStiffness if self.base_turn_stiffness.is_empty() => return None,
            Key::BaseTurnStiffness => number_or_list(self.base_turn_stiffness.iter().copied()),
            Key::Fan => list_value(self.rods.iter().map(|rod| rod.angle)),
            Key::Joined => json!(self.joined),
            Key::RestStretch => quantity_value(self.rods.iter().map(|rod| &rod.rest_stretch)),
            Key::CouplingX | Key::CouplingY | Key::CouplingZ => {
                // A single rod has no gaps: any number will do.
                let axis = Key::COUPLING.iter().position(|axis| *axis == key)?;
                number_or_list(self.coupling.iter().map(|gap| gap[axis]))
            }
            Key::Gravity
            | Key::G
            | Key::Distributed
            | Key::Follower
            | Key::Couple
            | Key::CoupleFollows
            | Key::LoadFactor => return self.load_value(key),
            Key::FoundationStiffness => vector_quantity(self.foundation.as_deref()?),
            Key::TipForce => list_value(self.tip_force),
            Key::TipMoment => list_value(self.tip_moment),
            Key::Tolerance => number_value(self.tolerance),
            _ => return None,
        })
    }

    /// Loads of veins, at a factor of one, and the factor.
    fn load_value(&self, key: Key) -> Option<Value> {
        if let (Some(loads), Key::LoadFactor) = (&self.factored, key) {
            return Some(schedule_value(&loads.factor, "factor", number_value));
        }
        let mut whole = std::borrow::Cow::Borrowed(self);
        if let Some(loads) = &self.factored {
            let whole = whole.to_mut();
            whole.gravity = loads.gravity;
            whole.own_gravity.clone_from(&loads.own_gravity);
            whole.g = loads.g;
            whole.distributed.clone_from(&loads.distributed);
            whole.follower.clone_from(&loads.follower);
            whole.couple.clone_from(&loads.couple);
        }
        Some(match key {
            Key::Gravity => {
                let veins = 0..self.rods.len();
                vector_or_list(veins.map(|vein| whole.weight(vein).even))
            }
            Key::G => list_value(whole.g),
            Key::Distributed => vector_quantity(whole.distributed.as_deref()?),
            Key::Follower => vector_quantity(whole.follower.as_deref()?),
            Key::Couple => vector_quantity(whole.couple.as_deref()?),
            Key::CoupleFollows => json!(whole.couple.as_ref().map(|_| self.couple_follows)?),
            _ => return None,
        })
    }

    fn tissue_value(&self, key: Key) -> Option<Value> {
        let tissue = self.tissue.as_ref()?;
        if key == Key::TissueGrown {
            return Some(json!(self.tissue_grown));
        }
        let mut keys = Key::TISSUE.iter().chain([&Key::TissueContraction]);
        let which = keys.position(|one| *one == key)?;
        let of = |gap: &Tissue| gap.profiles()[which].at(0.0);
        Some(number_or_list(tissue.iter().map(of)))
    }

    fn blade_value(&self, key: Key) -> Option<Value> {
        let blade = self.blade.as_ref()?;
        let materials = blade.materials.iter();
        Some(match key {
            Key::BladeLength => number_value(blade.length()),
            Key::BladeWidth => spline_value(blade.width_profile()),
            Key::BladeThickness => quantity_value(materials.map(|of| &of.thickness)),
            Key::BladeYoung => quantity_value(materials.map(|of| &of.young)),
            Key::YoungAcross => optional_quantity(materials.map(|of| of.young_across.as_ref()))?,
            Key::ShearModulus => optional_quantity(materials.map(|of| of.shear_modulus.as_ref()))?,
            Key::BladePoisson => quantity_value(materials.map(|of| &of.poisson)),
            Key::BladeMassDensity => {
                optional_quantity(materials.map(|of| of.mass_density.as_ref()))?
            }
            Key::Edges => json!(blade.edges),
            _ => number_value(blade.least_width_fraction()),
        })
    }

    /// Whether the blade has a mass.
    fn has_blade_mass(&self) -> bool {
        self.blade.as_ref().is_some_and(|blade| blade.has_mass())
    }

    fn wind_value(&self, key: Key) -> Option<Value> {
        let wind = self.wind.as_ref()?;
        Some(match key {
            Key::WindVelocity => vectors_value(&wind.velocity),
            Key::WindDensity => number_value(wind.density),
            Key::WindDrag => number_value(wind.drag),
            _ if self.wind_width_follows_from_source() => return None,
            _ => quantity_value(wind.width.iter()),
        })
    }

    /// A ruler is told as the scale that follows from it.
    fn photo_value(&self, key: Key) -> Option<Value> {
        let photo = self.photo.as_ref()?;
        match key {
            Key::PhotoScale => Some(number_value(photo.scale)),
            Key::PhotoX => Some(number_value(photo.origin[0])),
            Key::PhotoY => Some(number_value(photo.origin[1])),
            Key::PhotoRotation => Some(number_value(photo.rotation)),
            Key::PhotoRight => Some(json!(axis_name(photo.right))),
            Key::PhotoUp => Some(json!(axis_name(photo.up))),
            _ => None,
        }
    }

    fn tip_value(&self, key: Key) -> Option<Value> {
        let held = self.held_tip.as_ref()?;
        let clamps = held.clamps.as_deref();
        Some(match key {
            Key::TipHeld if clamps.is_some() => json!("clamped"),
            Key::TipHeld => json!("pinned"),
            Key::TipPosition => match self.support_motion.as_ref().and_then(|it| it.tip.as_ref()) {
                Some(position) => vectors_value(position),
                None => list_value(held.position),
            },
            Key::TipAngles => number_or_list(clamps?.iter().map(|clamp| clamp.angle)),
            _ => number_or_list(clamps?.iter().map(|clamp| clamp.twist)),
        })
    }

    fn dynamics_value(&self, key: Key, sections: Option<&SerializedSections>) -> Option<Value> {
        let dynamics = &self.dynamics;
        Some(match key {
            Key::Density if self.has_blade_mass() => return None,
            Key::Density if sections.is_some_and(|it| it.density) => return None,
            // If given, it would have a weight.
            Key::Density if self.weighs_points_only => return None,
            // If given, rotary inertia would follow from it and the source of the stiffnesses.
            Key::Density
                if dynamics.polar_inertia == PolarInertia::Same
                    && (sections.is_some() || self.blade.is_some()) =>
            {
                return None;
            }
            Key::Density => quantity_value(dynamics.density.iter()),
            // If given, it would be larger about d1.
            Key::RotaryInertia | Key::RotaryInertia3
                if dynamics.polar_inertia == PolarInertia::Same
                    || self.rotary_inertia_follows_from_source(sections) =>
            {
                return None;
            }
            Key::RotaryInertia => {
                quantity_value(dynamics.rotary_inertia.iter().map(|[about_2, _]| about_2))
            }
            Key::RotaryInertia3 => {
                let mut both = dynamics.rotary_inertia.iter();
                if both.all(|[about_2, about_3]| about_2 == about_3) {
                    return None;
                }
                quantity_value(dynamics.rotary_inertia.iter().map(|[_, about_3]| about_3))
            }
            // If given, it would count for the verdict on small motions.
            Key::ExternalDamping
                if dynamics.assumes_damping
                    && dynamics.external_damping == dynamics.critical_damping(&self.rods) =>
            {
                return None;
            }
            Key::ExternalDamping => number_value(dynamics.external_damping),
            Key::InternalDamping => number_value(dynamics.internal_damping),
            Key::Duration => number_value(dynamics.duration),
            Key::OutputInterval => number_value(dynamics.output_interval),
            Key::Clamped => json!(dynamics.clamped),
            Key::Start => json!(dynamics.start),
            Key::GravityInTime if self.factored.is_some() => return None,
            Key::GravityInTime => {
                schedule_unless_constant(&dynamics.gravity, self.gravity, "value", list_value)?
            }
            Key::TipForceInTime => {
                schedule_unless_constant(&dynamics.tip_force, self.tip_force, "value", list_value)?
            }
            Key::TipMomentInTime => schedule_unless_constant(
                &dynamics.tip_moment,
                self.tip_moment,
                "value",
                list_value,
            )?,
            Key::BaseInTime => {
                let base = self.support_motion.as_ref()?.base.as_ref()?;
                let mut value = json!({});
                for (name, motion) in [("move", &base.displacement), ("turn", &base.turn)] {
                    if *motion != Schedule::constant([0.0; 3]) {
                        value[name] = schedule_value(motion, "value", list_value);
                    }
                }
                if value == json!({}) {
                    value["move"] = schedule_value(&base.displacement, "value", list_value);
                }
                value
            }
            Key::RestInTime => {
                schedule_unless_constant(&dynamics.rest, 1.0, "factor", number_value)?
            }
            _ => return None,
        })
    }

    /// The sections, if they give the stiffnesses.
    fn sections(&self) -> Option<SerializedSections<'_>> {
        if !self.stiffnesses_follow_from_sections() {
            return None;
        }
        let sections = self.radii.sections();
        let give = |profiles: &[Profile], property| {
            let mut pairs = profiles.iter().zip(sections);
            pairs.all(|(profile, section)| *profile == section.profile(property))
        };
        let density = give(&self.dynamics.density, Property::Density);
        Some(SerializedSections { sections, density })
    }

    /// What the stiffnesses follow from, unless that is numbers.
    fn stiffness_source(&self) -> Option<StiffnessSource> {
        match &self.blade {
            Some(blade) => Some(StiffnessSource::from_blade(blade.clone())),
            None if !self.radii.sections().is_empty() => {
                Some(StiffnessSource::Sections(self.radii.sections().to_vec()))
            }
            None => None,
        }
    }

    /// The width of every vein along d2: of its section, or of its strip of a blade; none where numbers are given in
    /// place of these.
    pub(crate) fn vein_widths(&self) -> Option<Vec<Profile>> {
        self.stiffness_source()?.property_profiles(Property::Width)
    }

    /// Whether the width in the wind is that of the sections, or of the strips of a blade.
    pub(crate) fn wind_width_follows_from_source(&self) -> bool {
        let widths = self.wind.as_ref().map(|wind| &wind.width);
        widths.is_some() && widths == self.vein_widths().as_ref()
    }

    /// Whether the rotary inertia is that of the densities and the sections, or the strips of a blade.
    fn rotary_inertia_follows_from_source(&self, sections: Option<&SerializedSections>) -> bool {
        let gives_stiffnesses = self.blade.is_some() || sections.is_some();
        let dynamics = &self.dynamics;
        let source = self.stiffness_source().filter(|_| gives_stiffnesses);
        let inertia = source.and_then(|source| source.rotary_inertia(&dynamics.density));
        inertia.as_ref() == Some(&dynamics.rotary_inertia)
    }
}

impl SerializedSections<'_> {
    fn serialized_value(&self, key: Key) -> Option<Value> {
        let outline = self.sections.first()?.outline;
        let of = |of: fn(&Section) -> &Profile| {
            quantity_value(self.sections.iter().map(|section| of(section)))
        };
        Some(match key {
            Key::SectionShape => json!(outline),
            Key::Diameter if outline == SectionOutline::Circle => of(|section| &section.width),
            Key::Width | Key::Thickness if outline == SectionOutline::Circle => return None,
            Key::Width => of(|section| &section.width),
            Key::Thickness if outline == SectionOutline::Hexagon => return None,
            Key::Thickness => of(|section| &section.thickness),
            Key::InnerDiameter | Key::Wall => {
                let hollow = |section: &'_ Arc<Section>| section.hollow.clone();
                let hollow: Vec<HollowSection> =
                    self.sections.iter().map(hollow).collect::<Option<_>>()?;
                let is_bore = matches!(hollow.first()?, HollowSection::Bore(_));
                if is_bore != (key == Key::InnerDiameter) {
                    return None;
                }
                quantity_value(hollow.iter().map(HollowSection::profile))
            }
            Key::Young => of(|section| &section.young),
            Key::Poisson | Key::SectionShearModulus => {
                let law = &self.sections.first()?.shear;
                let is_modulus = matches!(law, ShearLaw::Modulus(_));
                if is_modulus != (key == Key::SectionShearModulus) {
                    return None;
                }
                of(|section| section.shear.profile())
            }
            Key::MassDensity if self.density => of(|section| &section.mass_density),
            _ => return None,
        })
    }
}

/// A number; JSON has no infinity: `"inf"`.
fn number_value(number: f64) -> Value {
    match number.is_infinite() {
        true => json!("inf"),
        false => json!(number),
    }
}

fn list_value(numbers: impl IntoIterator<Item = f64>) -> Value {
    numbers.into_iter().map(number_value).collect()
}

/// A single number if all are the same.
fn number_or_list(numbers: impl Iterator<Item = f64>) -> Value {
    let numbers: Vec<f64> = numbers.collect();
    let first = numbers.first().copied().unwrap_or(0.0);
    match numbers.iter().all(|number| *number == first) {
        true => number_value(first),
        false => list_value(numbers),
    }
}

/// A single vector if all are the same.
fn vector_or_list(vectors: impl Iterator<Item = [f64; 3]>) -> Value {
    let vectors: Vec<[f64; 3]> = vectors.collect();
    match vectors.first() {
        Some(first) if vectors.iter().all(|vector| vector == first) => list_value(*first),
        _ => vectors.into_iter().map(list_value).collect(),
    }
}

/// Vectors along all rods, in the shortest form.
fn vector_quantity(rods: &[[Profile; 3]]) -> Value {
    let mut profiles = rods.iter().flatten();
    if profiles.all(|it| matches!(it, Profile::Constant(_))) {
        let constant = |rod: &[Profile; 3]| rod.each_ref().map(|profile| profile.at(0.0));
        return vector_or_list(rods.iter().map(constant));
    }
    let places = knot_places(rods.iter().flatten());
    let values = |rod: &[Profile; 3]| -> Value {
        let knot = |&place: &RodPlace| list_value(rod.each_ref().map(|profile| profile.at(place)));
        places.iter().map(knot).collect()
    };
    let value = match rods.iter().all(|rod| *rod == rods[0]) {
        true => values(&rods[0]),
        false => rods.iter().map(values).collect(),
    };
    json!({ "at": fractions(&places), "value": value })
}

fn fractions(places: &[RodPlace]) -> Vec<f64> {
    places.iter().map(|place| place.sigma).collect()
}

/// A quantity of all rods, in the shortest form.
fn quantity_value<'p>(profiles: impl Iterator<Item = &'p Profile>) -> Value {
    let profiles: Vec<&Profile> = profiles.collect();
    if profiles.iter().all(|it| matches!(it, Profile::Constant(_))) {
        return number_or_list(profiles.iter().map(|profile| profile.at(0.0)));
    }
    let places = knot_places(profiles.iter().copied());
    let values = |profile: &Profile| list_value(places.iter().map(|&place| profile.at(place)));
    let value = match profiles.iter().all(|profile| *profile == profiles[0]) {
        true => values(profiles[0]),
        false => profiles.iter().map(|profile| values(profile)).collect(),
    };
    json!({ "at": fractions(&places), "value": value })
}

/// A quantity along a blade.
fn spline_value(spline: &Spline) -> Value {
    let (at, value) = (spline.knots(), spline.values());
    match value.iter().all(|one| *one == value[0]) {
        true => number_value(value[0]),
        false => json!({ "at": at, "value": value }),
    }
}

/// A quantity of all rods; `None` if the quantity is left out.
fn optional_quantity<'p>(profiles: impl Iterator<Item = Option<&'p Profile>>) -> Option<Value> {
    let profiles: Option<Vec<&Profile>> = profiles.collect();
    Some(quantity_value(profiles?.into_iter()))
}

/// A quantity in time; `None` if the quantity always has its value at rest.
fn schedule_unless_constant<T: InTime>(
    schedule: &Schedule<T>,
    at_rest: T,
    name: &str,
    written: impl Fn(T) -> Value,
) -> Option<Value> {
    let constant = *schedule == Schedule::constant(at_rest);
    (!constant).then(|| schedule_value(schedule, name, written))
}

/// Vectors in time, or the one that is the same at all times.
fn vectors_value(of: &Schedule<[f64; 3]>) -> Value {
    match of.is_constant() {
        true => list_value(of.at(0.0)),
        false => schedule_value(of, "value", list_value),
    }
}

fn schedule_value<T: InTime>(of: &Schedule<T>, name: &str, written: impl Fn(T) -> Value) -> Value {
    let through = |knots: &Knots<T>| -> [Value; 2] {
        let values = knots.value.iter().map(|&value| written(value));
        [json!(knots.at), values.collect()]
    };
    match of {
        Schedule::Linear(knots) => {
            let [at, values] = through(knots);
            json!({ "at": at, name: values })
        }
        Schedule::Smooth { knots, .. } => {
            let [at, values] = through(knots);
            json!({ "at": at, name: values, "smooth": true })
        }
        Schedule::Sine(Sine {
            mean,
            amplitude,
            frequency,
            phase,
        }) => json!({
            "mean": written(*mean),
            "amplitude": written(*amplitude),
            "frequency": frequency,
            "phase": phase,
        }),
    }
}
