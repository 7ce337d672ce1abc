//! What figures and pages show of a scenario: arrows of loads, marks of supports, the directions of gravity
//! and wind, units and names of axes, and its numbers in words.
//!
//! Loads and supports are told by veins and fractions of their lengths: figures place them on the shapes that
//! they draw, and pages have them as data.

use crate::report::numbers::format_four_digits;
use ListEntryOwner::*;
use glam::{DQuat, DVec3};
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::{BaseSupport, Grip, Key, Profile, Scenario, Schedule, SupportKind, Units};
use serde::Serialize;
use std::borrow::Cow;

/// Arrows of loads.
struct LoadArrows {
    /// Length of the arrow of the largest force or moment, as a part of the leaf's largest extent.
    longest: f64,
    /// Length of the shortest arrow, as a part of the longest.
    shortest: f64,
    /// Length of the arrow of the largest force along a vein, as a part of the leaf's largest extent, and
    /// how many such arrows there are.
    distributed: f64,
    distributed_count: usize,
    /// Of more veins only some have such arrows.
    most_veins: usize,
    /// How many curved arrows a moment along a vein has, inside of its ends.
    couple_count: usize,
}

const LOAD_ARROWS: LoadArrows = LoadArrows {
    longest: 0.16,
    shortest: 0.35,
    distributed: 0.07,
    distributed_count: 9,
    most_veins: 5,
    couple_count: 3,
};

impl LoadArrows {
    /// Fractions of a vein at which a force per length has its arrows.
    fn places(&self) -> impl Iterator<Item = f64> + Clone {
        let last = self.distributed_count - 1;
        (0..=last).map(move |k| k as f64 / last as f64)
    }

    /// Fractions of a vein at which a moment per length has its arrows.
    fn couple_places(&self) -> impl Iterator<Item = f64> + Clone {
        let count = self.couple_count;
        (1..=count).map(move |k| k as f64 / (count + 1) as f64)
    }

    /// Veins, from 0, on which forces and moments per length are drawn: both margins, and some between.
    fn loaded_veins(&self, count: usize) -> impl Iterator<Item = usize> + Clone {
        let shown = count.min(self.most_veins);
        (0..shown).map(move |k| k * (count - 1) / (shown - 1).max(1))
    }
}

/// What acts at a point of a vein.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LoadKind {
    /// A dead force on a point or a tip.
    Force,
    /// A dead force per length.
    Distributed,
    /// A dead moment.
    Moment,
    /// A dead moment per length.
    Couple,
    /// A mass that has landed, which is drawn as a ball.
    Mass,
}

/// A dead load at a point of a vein, which is drawn as an arrow, or a mass.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LoadMark {
    pub action: LoadKind,
    /// The number of the vein, from 1.
    pub vein: usize,
    /// Fraction of the length of the vein.
    pub at: f64,
    /// Where a force acts off the axis, lengths along d2 and d3.
    #[serde(skip_serializing_if = "is_on_axis")]
    pub offset: [f64; 2],
    /// Unit vector of a force, or about which a moment turns; of a mass none that counts.
    pub direction: DVec3,
    /// In the scenario's units.
    pub size: f64,
    /// Length of the arrow of a force, as a part of the leaf's largest extent.
    pub length: f64,
}

/// What is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ParsedKey {
    Base,
    Tip,
    Grip,
    Foundation,
}

/// How something is held, as it is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SupportForm {
    Clamped,
    Pinned,
    /// Along some axes only.
    Sliding,
    /// By springs.
    Elastic,
}

impl SupportForm {
    /// How a grip holds.
    fn from_grip(grip: &Grip) -> Self {
        match grip.held {
            _ if grip.stiffness.contains(&0.0) => SupportForm::Sliding,
            _ if grip.has_springs() => SupportForm::Elastic,
            SupportKind::Clamped => SupportForm::Clamped,
            SupportKind::Pinned => SupportForm::Pinned,
        }
    }
}

/// Marks of a foundation along each vein.
const FOUNDATION_MARKS: usize = 8;

/// A point or a stretch of a vein that is held.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SupportMark {
    pub part: ParsedKey,
    /// The number of the vein, from 1.
    pub vein: usize,
    /// Fractions of the length of the vein, from and to.
    pub at: [f64; 2],
    pub held: SupportForm,
}

fn is_on_axis(offset: &[f64; 2]) -> bool {
    *offset == [0.0; 2]
}

/// The rotation of a section of a leaf at rest.
pub fn section_rotation(leaf: &Equilibrium, vein: usize, sigma: f64) -> Option<DQuat> {
    let after = leaf.shape.stations.partition_point(|&at| at < sigma);
    let nodes = &leaf.shape.rods.get(vein)?.nodes;
    let node = nodes.get(after).or(nodes.last())?;
    Some(node.rotation)
}

/// A scenario in which loads that turn with the section are dead ones: as they act on this leaf at rest.
pub fn with_followers_as_dead<'s>(scenario: &'s Scenario, leaf: &Equilibrium) -> Cow<'s, Scenario> {
    if !scenario.has_followers() {
        return Cow::Borrowed(scenario);
    }
    let turned = |vein: usize, sigma: f64, load: [f64; 3]| -> [f64; 3] {
        let load = DVec3::from_array(load);
        let rotation = section_rotation(leaf, vein, sigma);
        rotation.map_or(load, |rotation| rotation * load).to_array()
    };
    let mut dead = scenario.clone();
    for point in dead.points.iter_mut().filter(|it| it.follows) {
        point.force = turned(point.vein, point.at, point.force);
        point.moment = turned(point.vein, point.at, point.moment);
        point.follows = false;
    }
    // A load along the veins in the directions of their sections, besides a dead one.
    let along = |following: &[[Profile; 3]], dead: Option<&Vec<[Profile; 3]>>, at: Vec<f64>| {
        let of_vein = |vein: usize| {
            let values: Vec<[f64; 3]> = (at.iter())
                .map(|&sigma| {
                    let own = following[vein].each_ref().map(|load| load.at(sigma));
                    let dead = dead.map_or([0.0; 3], |all| {
                        all[vein].each_ref().map(|load| load.at(sigma))
                    });
                    let own = turned(vein, sigma, own);
                    [0, 1, 2].map(|axis| own[axis] + dead[axis])
                })
                .collect();
            [0, 1, 2].map(|axis| Profile::Linear {
                at: at.clone(),
                value: values.iter().map(|value| value[axis]).collect(),
            })
        };
        (0..following.len()).map(of_vein).collect()
    };
    if let Some(follower) = dead.follower.take() {
        let places = LOAD_ARROWS.places().collect();
        dead.distributed = Some(along(&follower, scenario.distributed.as_ref(), places));
    }
    if let Some(couple) = dead.couple.take_if(|_| scenario.couple_follows) {
        let places = [0.0].into_iter().chain(LOAD_ARROWS.couple_places());
        dead.couple = Some(along(&couple, None, places.chain([1.0]).collect()));
        dead.couple_follows = false;
    }
    Cow::Owned(dead)
}

/// The dead loads on a leaf at rest, or on one in motion at this time; what turns with a section has no
/// direction before its section is known. Gravity and wind, which act on
/// all veins alike, are directions of the whole figure.
pub fn load_marks(scenario: &Scenario, time: Option<f64>) -> Vec<LoadMark> {
    let scenario = &match time {
        Some(time) => Cow::Owned(scenario.at_time(time)),
        None => Cow::Borrowed(scenario),
    };
    let [tip_force, tip_moment] = [scenario.tip_force, scenario.tip_moment].map(DVec3::from_array);
    let veins = scenario.rods.len();
    let g = DVec3::from_array(scenario.g);
    let points = scenario.points.iter();
    let on_points = points.clone().map(|it| {
        let given = if it.follows {
            DVec3::ZERO
        } else {
            DVec3::from_array(it.force)
        };
        let weight = if it.landing.is_some() { 0.0 } else { it.mass };
        (it.vein + 1, it.at, it.offset, given + weight * g)
    });
    let landed = (points.clone()).filter(|it| it.landing.is_some() && it.mass > 0.0);
    let landed = landed.map(|it| LoadMark {
        action: LoadKind::Mass,
        vein: it.vein + 1,
        at: it.at,
        offset: it.offset,
        direction: DVec3::NEG_Z,
        size: it.mass,
        length: 0.0,
    });
    let landed: Vec<LoadMark> = landed.collect();
    // Tips at one point have one arrow.
    let tips = if scenario.joined { 1 } else { veins };
    let axis = [0.0; 2];
    let on_tips = (1..=tips).map(|vein| (vein, 1.0, axis, tip_force));
    let single: Vec<_> = on_points.chain(on_tips).collect();
    let moments = points.filter(|it| !it.follows);
    let moments = moments.map(|it| (it.vein + 1, it.at, axis, DVec3::from_array(it.moment)));
    let moments: Vec<_> = moments.chain([(1, 1.0, axis, tip_moment)]).collect();
    let along = |load: Option<&Vec<[Profile; 3]>>, places: Vec<f64>| -> Vec<_> {
        let of = |vein: usize, s: f64| {
            load.map(|all| DVec3::from_array(all[vein].each_ref().map(|profile| profile.at(s))))
        };
        let loaded = LOAD_ARROWS.loaded_veins(veins);
        let places = loaded.flat_map(|vein| places.iter().map(move |&s| (vein, s)));
        let marks = places.filter_map(|(vein, s)| Some((vein + 1, s, axis, of(vein, s)?)));
        marks.collect()
    };
    let couple = (scenario.couple.as_ref()).filter(|_| !scenario.couple_follows);
    let couples = along(couple, LOAD_ARROWS.couple_places().collect());
    let along = along(
        scenario.distributed.as_ref(),
        LOAD_ARROWS.places().collect(),
    );
    let kinds = [
        (LoadKind::Distributed, along, LOAD_ARROWS.distributed, 0.0),
        (
            LoadKind::Force,
            single,
            LOAD_ARROWS.longest,
            LOAD_ARROWS.shortest,
        ),
        (
            LoadKind::Couple,
            couples,
            LOAD_ARROWS.longest,
            LOAD_ARROWS.shortest,
        ),
        (
            LoadKind::Moment,
            moments,
            LOAD_ARROWS.longest,
            LOAD_ARROWS.shortest,
        ),
    ];
    let marks = kinds
        .into_iter()
        .flat_map(|(action, loads, longest, shortest)| {
            let largest = loads.iter().map(|(.., load)| load.length());
            let largest = largest.fold(0.0, f64::max);
            loads
                .into_iter()
                .filter_map(move |(vein, at, offset, load)| {
                    Some(LoadMark {
                        action,
                        vein,
                        at,
                        offset,
                        direction: load.try_normalize()?,
                        size: load.length(),
                        length: longest * (load.length() / largest).max(shortest),
                    })
                })
        });
    marks.chain(landed).collect()
}

/// What holds a leaf: bases, of which those at one place that are held alike are one, a tip, grips, and a foundation.
pub fn support_marks(scenario: &Scenario) -> Vec<SupportMark> {
    let mut bases: Vec<([f64; 3], BaseSupport)> = Vec::new();
    let mut marks = Vec::new();
    for ((rod, held), vein) in scenario.rods.iter().zip(&scenario.base_held).zip(1..) {
        if !bases.contains(&(rod.base, *held)) {
            bases.push((rod.base, *held));
            marks.push(SupportMark {
                part: ParsedKey::Base,
                vein,
                at: [0.0; 2],
                held: match held {
                    BaseSupport::Clamped => SupportForm::Clamped,
                    BaseSupport::Pinned => SupportForm::Pinned,
                    BaseSupport::Elastic => SupportForm::Elastic,
                },
            });
        }
    }
    marks.extend(scenario.held_tip.iter().map(|tip| SupportMark {
        part: ParsedKey::Tip,
        vein: 1,
        at: [1.0; 2],
        held: match tip.clamps {
            Some(_) => SupportForm::Clamped,
            None => SupportForm::Pinned,
        },
    }));
    marks.extend(scenario.grips.iter().map(|grip| SupportMark {
        part: ParsedKey::Grip,
        vein: grip.vein + 1,
        at: grip.at,
        held: SupportForm::from_grip(grip),
    }));
    for (stiffness, vein) in scenario.foundation.iter().flatten().zip(1..) {
        let places = (1..=FOUNDATION_MARKS).map(|k| k as f64 / FOUNDATION_MARKS as f64);
        let held = |at: &f64| stiffness.iter().any(|along| along.at(*at) > 0.0);
        marks.extend(places.filter(held).map(|at| SupportMark {
            part: ParsedKey::Foundation,
            vein,
            at: [at; 2],
            held: SupportForm::Elastic,
        }));
    }
    marks
}

/// Lengths are drawn in units of the longest rod L, and shown in the scenario's unit
/// if it names one.
#[derive(Clone, Debug)]
pub struct FigureSetting {
    units: Units,
    /// The longest rod, in the scenario's unit.
    length: f64,
    /// Direction of gravity, if there is any.
    gravity: Option<DVec3>,
    /// Velocity of the air, if there is wind.
    wind: Option<Schedule<[f64; 3]>>,
}

/// A direction that is drawn as an arrow with its name.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DirectionArrow {
    pub name: &'static str,
    /// Unit vector.
    pub direction: DVec3,
}

/// Names of the axes as fractions of L, with what they mean.
const COORDINATE_OVER_LENGTH_NAMES: [(&str, &str); 3] = [("ξ", "x/L"), ("η", "y/L"), ("ζ", "z/L")];

pub const COORDINATE_NAMES: [&str; 3] = ["x", "y", "z"];

impl FigureSetting {
    pub fn from_scenario(scenario: &Scenario) -> Self {
        FigureSetting {
            units: scenario.units.clone(),
            length: leafdyn::scenario::longest(&scenario.rods),
            gravity: weight_direction(scenario).try_normalize(),
            wind: scenario.wind.as_ref().map(|wind| wind.velocity.clone()),
        }
    }

    /// The direction of gravity, if there is any.
    pub fn gravity(&self) -> Option<DVec3> {
        self.gravity
    }

    /// The arrows of the first panel, or of a later one, which shows what may differ from the first:
    /// the wind at this time.
    pub fn direction_arrows(&self, first: bool, time: f64) -> Vec<DirectionArrow> {
        let gravity = self
            .gravity
            .filter(|_| first)
            .map(|direction| DirectionArrow {
                direction,
                name: "gravity",
            });
        let wind = self.wind.as_ref();
        let wind = wind.filter(|wind| first || !wind.is_constant());
        let direction = wind.and_then(|wind| DVec3::from_array(wind.at(time)).try_normalize());
        let wind = direction.map(|direction| DirectionArrow {
            direction,
            name: "wind",
        });
        gravity.into_iter().chain(wind).collect()
    }

    /// The value shown for a drawn length of 1.
    pub fn value_per_length(&self) -> f64 {
        match self.units.length {
            Some(_) if self.length.is_normal() => self.length,
            _ => 1.0,
        }
    }

    /// The name of an axis whose values are shown.
    pub fn axis_name(&self, axis: usize) -> String {
        match (&self.units.length, COORDINATE_OVER_LENGTH_NAMES[axis]) {
            (Some(unit), _) => name_with_unit(COORDINATE_NAMES[axis], Some(unit)),
            (None, (name, meaning)) => format!("{name} = {meaning}"),
        }
    }

    /// A shorter name, with the unit only if values are shown.
    pub fn brief_axis_name(&self, axis: usize, values: bool) -> String {
        match (&self.units.length, values) {
            (Some(_), true) => self.axis_name(axis),
            (Some(_), false) => COORDINATE_NAMES[axis].into(),
            (None, _) => COORDINATE_OVER_LENGTH_NAMES[axis].0.into(),
        }
    }

    /// The length of the longest rod, as text.
    pub fn longest_rod_text(&self) -> String {
        match &self.units.length {
            Some(unit) => format!("{} {unit}", format_four_digits(self.length)),
            None => format_four_digits(self.length),
        }
    }

    /// A moment of this size, as text.
    pub fn moment_text(&self, size: f64) -> String {
        let unit = self.units.energy();
        format_four_digits(size) + &unit.map_or(String::new(), |unit| format!(" {unit}"))
    }

    /// The unit of the values shown.
    pub fn length_unit(&self) -> &str {
        self.units.length.as_deref().unwrap_or("L")
    }
}

/// The direction of the weight of all veins.
fn weight_direction(scenario: &Scenario) -> DVec3 {
    if scenario.g == [0.0; 3] && scenario.own_gravity.is_empty() {
        return DVec3::from_array(scenario.gravity);
    }
    let of_vein = |vein: usize| {
        let weight = scenario.weight(vein);
        let pulled = (weight.of_mass).map_or(DVec3::ZERO, |(g, mass)| {
            DVec3::from_array(g) * mass.integral(1.0)
        });
        scenario.rods[vein].length * (DVec3::from_array(weight.even) + pulled)
    };
    (0..scenario.rods.len()).map(of_vein).sum()
}

/// A name with its unit, if that is known.
pub fn name_with_unit(name: &str, unit: Option<&str>) -> String {
    match unit {
        Some(unit) if unit.contains('/') => format!("{name} / ({unit})"),
        Some(unit) => format!("{name} / {unit}"),
        None => name.into(),
    }
}

/// What the entries of a list belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ListEntryOwner {
    /// Nothing that has a name of its own.
    Plain,
    /// The three axes, along or about which the quantity is; before them, the veins.
    Along,
    About,
    Veins,
    /// The gaps between neighboring veins.
    Gaps,
}

/// Keys with their words and what the entries of their lists belong to.
const KEY_WORDS: &[(&str, &str, ListEntryOwner)] = &[
    ("leaf.rods", "number of veins", Plain),
    ("leaf.length", "length", Veins),
    ("leaf.fan", "angle at the base", Veins),
    ("leaf.base", "position of the base", Along),
    ("leaf.elevation", "elevation at the base", Veins),
    ("stiffness.torsion", "torsional stiffness A1", Veins),
    ("stiffness.bending_2", "bending stiffness A2", Veins),
    ("stiffness.bending_3", "bending stiffness A3", Veins),
    ("stiffness.axial", "axial stiffness H1", Veins),
    ("stiffness.shear_2", "shear stiffness H2", Veins),
    ("stiffness.shear_3", "shear stiffness H3", Veins),
    ("section.diameter", "diameter", Veins),
    ("section.width", "width of the section", Veins),
    ("section.thickness", "thickness of the section", Veins),
    ("section.inner_diameter", "diameter of the bore", Veins),
    ("section.wall", "thickness of the wall", Veins),
    ("section.young", "Young's modulus", Veins),
    ("section.poisson", "Poisson's ratio", Veins),
    ("section.shear_modulus", "shear modulus", Veins),
    ("section.mass_density", "mass per volume", Veins),
    ("blade.length", "length of the blade", Plain),
    ("blade.width", "width of the blade", Plain),
    ("blade.thickness", "thickness of the blade", Veins),
    ("blade.young", "Young's modulus along", Veins),
    ("blade.young_across", "Young's modulus across", Veins),
    ("blade.shear_modulus", "shear modulus", Veins),
    ("blade.poisson", "Poisson's ratio", Veins),
    ("blade.mass_density", "mass per volume", Veins),
    ("blade.least_width", "least width of the blade", Plain),
    ("rest.twist", "twist at rest", Veins),
    ("rest.bend_2", "curvature at rest about d2", Veins),
    ("rest.bend_3", "curvature at rest about d3", Veins),
    ("rest.stretch", "growth", Veins),
    ("coupling.x", "coupling along x", Gaps),
    ("coupling.y", "coupling along y", Gaps),
    ("coupling.z", "coupling along z", Gaps),
    ("tissue.along", "tissue along the veins", Gaps),
    ("tissue.across", "tissue across the veins", Gaps),
    ("tissue.normal", "tissue normal to the leaf", Gaps),
    ("tissue.fold", "tissue in folds", Gaps),
    ("load.gravity", "gravity", Along),
    ("load.g", "acceleration of gravity", Along),
    ("load.distributed", "force per length", Along),
    ("load.follower", "following force per length", Along),
    ("load.couple", "moment per length", About),
    ("load.tip_force", "force on the tip", Along),
    ("load.tip_moment", "moment on the tip", About),
    ("load.point.at", "place of point", Plain),
    ("load.point.force", "force on point", Along),
    ("load.point.moment", "moment on point", About),
    ("load.point.mass", "mass of point", Plain),
    ("tip.position", "position of the tip", Along),
    ("tip.angles", "angle at the tip", Veins),
    ("tip.twist", "twist at the tip", Veins),
    ("grip.at", "place of grip", Plain),
    ("grip.move", "displacement of grip", Along),
    ("grip.stiffness", "spring of grip", Along),
    ("grip.turn_stiffness", "turning stiffness of grip", Plain),
    ("foundation.stiffness", "stiffness of foundation", Along),
    ("dynamics.density", "mass per length", Veins),
    ("dynamics.rotary_inertia", "rotary inertia", Veins),
    (
        "dynamics.rotary_inertia_3",
        "rotary inertia about d3",
        Veins,
    ),
    ("dynamics.section_radius", "radius of the section", Veins),
    ("dynamics.external_damping", "external damping", Plain),
    ("dynamics.internal_damping", "internal damping", Plain),
    ("dynamics.duration", "duration", Plain),
    ("wind.velocity", "velocity of the air", Along),
    ("wind.density", "density of the air", Plain),
    ("wind.drag", "drag coefficient", Plain),
    ("wind.width", "width in the wind", Veins),
    ("photo.scale", "length of a pixel", Plain),
    ("photo.x", "pixel of the origin, to the right", Plain),
    ("photo.y", "pixel of the origin, down", Plain),
    ("photo.rotation", "rotation of the photograph", Plain),
    ("method.step", "time step", Plain),
    ("method.segments", "segments a vein", Plain),
];

/// Where more keys vary together, only the first and the last are named.
const MOST_KEYS_NAMED: usize = 3;

/// A number of a scenario.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct QuantityLabel {
    /// What it is.
    pub words: String,
    /// The unit, if the scenario names those of which it consists.
    pub unit: Option<String>,
}

impl QuantityLabel {
    /// The number of these keys, which are joined by `+` where several have one value.
    pub fn from_keys(keys: &str, units: &Units) -> QuantityLabel {
        let parts: Vec<KeyPart> = keys.split('+').map(KeyPart::parse).collect();
        let words = match words_for_several_veins(&parts) {
            Some(words) => words,
            None => {
                let words: Vec<String> = parts.iter().map(KeyPart::words).collect();
                match words.as_slice() {
                    [first, .., last] if words.len() > MOST_KEYS_NAMED => {
                        format!("{first} = … = {last}")
                    }
                    few => few.join(" = "),
                }
            }
        };
        let unit = parts.first().and_then(|part| part.unit(units));
        QuantityLabel { words, unit }
    }

    /// The words with the unit, as the name of an axis.
    pub fn axis_name(&self) -> String {
        name_with_unit(&self.words, self.unit.as_deref())
    }
}

/// How the number of a key is called.
#[derive(Clone, Copy)]
struct KeyWords {
    words: &'static str,
    entries: ListEntryOwner,
}

/// A key as it is written: `scale:load.point[0].force[2]`, `rest.bend_2.value[1]`.
struct KeyPart<'t> {
    text: &'t str,
    scale: bool,
    path: String,
    row: Option<usize>,
    list: Option<&'t str>,
    indices: Vec<usize>,
    named: Option<KeyWords>,
}

impl<'t> KeyPart<'t> {
    fn parse(text: &'t str) -> Self {
        let text = text.trim();
        let (scale, rest) = match text.strip_prefix("scale:") {
            Some(rest) => (true, rest),
            None => (false, text),
        };
        let mut pieces: Vec<(&str, Vec<usize>)> = (rest.split('.'))
            .map(|piece| {
                let mut parts = piece.split('[');
                let name = parts.next().unwrap_or_default();
                let indices = parts.filter_map(|it| it.trim_end_matches(']').parse().ok());
                (name, indices.collect())
            })
            .collect();
        let joined = |pieces: &[(&str, Vec<usize>)]| {
            let names: Vec<&str> = pieces.iter().map(|piece| piece.0).collect();
            names.join(".")
        };
        let named = |path: &str| {
            let found = KEY_WORDS.iter().find(|row| row.0 == path);
            found.map(|&(_, words, entries)| KeyWords { words, entries })
        };
        let last = pieces.len().saturating_sub(1);
        let list = match named(&joined(&pieces)) {
            None if last > 0 => Some(pieces[last].0),
            _ => None,
        };
        let indices = pieces[last].1.clone();
        pieces.truncate(if list.is_some() { last } else { last + 1 });
        let path = joined(&pieces);
        // The row of a repeated table is an index of its name, before that of the key.
        let row = pieces.iter().rev().skip(1);
        let row = row.flat_map(|piece| &piece.1).next().copied();
        KeyPart {
            named: named(&path).filter(|_| list.is_none_or(|it| ["value", "at"].contains(&it))),
            text,
            scale,
            path,
            row,
            list,
            indices,
        }
    }

    fn words(&self) -> String {
        let Some(KeyWords { words, entries }) = self.named else {
            return self.text.into();
        };
        let mut words = words.to_string();
        words.extend(self.row.map(|row| format!(" {}", row + 1)));
        let (knot, mut indices) = match (self.list, self.indices.split_first()) {
            (Some(_), Some((knot, rest))) => (Some(knot + 1), rest),
            _ => (None, &self.indices[..]),
        };
        if let (Along | About, Some((&axis, veins))) = (entries, indices.split_last()) {
            let by = if entries == Along { "along" } else { "about" };
            words += &format!(" {by} {}", COORDINATE_NAMES.get(axis).unwrap_or(&"?"));
            indices = veins;
        }
        match (entries, indices) {
            (Gaps, [gap, ..]) => words += &format!(", veins {} and {}", gap + 1, gap + 2),
            (Plain, [entry, ..]) => words += &format!(", entry {}", entry + 1),
            (_, [vein, ..]) => words += &format!(", vein {}", vein + 1),
            (_, []) => (),
        }
        match (self.list, knot) {
            (Some("at"), Some(knot)) => words = format!("place of knot {knot}, {words}"),
            (_, Some(knot)) => words += &format!(", knot {knot}"),
            _ => (),
        }
        match self.scale {
            true => format!("factor of {words}"),
            false => words,
        }
    }

    fn unit(&self, units: &Units) -> Option<String> {
        if self.scale || self.list == Some("at") {
            return None;
        }
        units.unit_name(Key::from_path(&self.path)?.dimension())
    }
}

/// Words for one number of several veins, as in `bending stiffness A2, veins 1–5, 7–11`.
fn words_for_several_veins(parts: &[KeyPart]) -> Option<String> {
    let first = parts.first().filter(|_| parts.len() > 1)?;
    let KeyWords { words, entries } = first.named?;
    let alike = |part: &KeyPart| {
        let plain = part.list.is_none() && part.indices.len() == 1;
        plain && part.path == first.path && part.scale == first.scale
    };
    if entries != Veins || !parts.iter().all(alike) {
        return None;
    }
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for vein in parts.iter().map(|part| part.indices[0] + 1) {
        match runs.last_mut() {
            Some([_, last]) if *last + 1 == vein => *last = vein,
            _ => runs.push([vein; 2]),
        }
    }
    let runs = runs.into_iter().map(|[from, to]| match to - from {
        0 => from.to_string(),
        1 => format!("{from}, {to}"),
        _ => format!("{from}–{to}"),
    });
    let factor = if first.scale { "factor of " } else { "" };
    let runs: Vec<String> = runs.collect();
    Some(format!("{factor}{words}, veins {}", runs.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cm() -> Units {
        Units {
            length: Some("cm".into()),
            force: Some("N".into()),
            time: None,
        }
    }

    #[test]
    fn every_key_with_words_is_one_of_the_format() {
        for (path, ..) in KEY_WORDS {
            let known = Key::from_path(path).is_some() || path.starts_with("method.");
            assert!(known, "{path}");
        }
    }

    #[test]
    fn keys_are_told_in_words_and_units() {
        for (keys, axis) in [
            ("stiffness.bending_2", "bending stiffness A2 / N cm²"),
            ("stiffness.axial[2]", "axial stiffness H1, vein 3 / N"),
            ("load.gravity[2]", "gravity along z / (N/cm)"),
            ("load.gravity[4][2]", "gravity along z, vein 5 / (N/cm)"),
            ("load.tip_moment[1]", "moment on the tip about y / N cm"),
            ("load.point[0].force[2]", "force on point 1 along z / N"),
            ("grip[1].move[0]", "displacement of grip 2 along x / cm"),
            (
                "rest.bend_2.value[1]",
                "curvature at rest about d2, knot 2 / (1/cm)",
            ),
            (
                "rest.bend_2.at[1]",
                "place of knot 2, curvature at rest about d2",
            ),
            (
                "tissue.along[0]",
                "tissue along the veins, veins 1 and 2 / (N/cm²)",
            ),
            (
                "scale:stiffness.torsion",
                "factor of torsional stiffness A1",
            ),
            ("leaf.rods", "number of veins"),
            ("method.step", "time step"),
            (
                "dynamics.gravity.value[0][2]",
                "dynamics.gravity.value[0][2] / (N/cm)",
            ),
        ] {
            assert_eq!(
                QuantityLabel::from_keys(keys, &cm()).axis_name(),
                axis,
                "{keys}"
            );
        }
        let without = QuantityLabel::from_keys("stiffness.bending_2", &Units::default());
        assert_eq!(without.axis_name(), "bending stiffness A2");
        // A density has a unit of time, which is not named.
        assert_eq!(
            QuantityLabel::from_keys("dynamics.density", &cm()).unit,
            None
        );
    }

    #[test]
    fn keys_with_one_value_share_their_words() {
        let words = |keys: &str| QuantityLabel::from_keys(keys, &cm()).words;
        let veins = [0, 1, 2, 4, 6, 7].map(|vein| format!("stiffness.bending_2[{vein}]"));
        let told = "bending stiffness A2, veins 1–3, 5, 7, 8";
        assert_eq!(words(&veins.join("+")), told);
        let rigid = "axial stiffness H1 = shear stiffness H2";
        assert_eq!(words("stiffness.axial+stiffness.shear_2"), rigid);
        let four = "leaf.length+coupling.x+coupling.y+coupling.z";
        assert_eq!(words(four), "length = … = coupling along z");
    }
}
