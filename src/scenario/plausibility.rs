//! Numbers of a scenario that are allowed, but probably not what was intended: degrees in place of
//! radians, accelerations in place of weights, lengths in other units.

use crate::run::remarks;
use crate::scenario::checked::Scenario;
use crate::scenario::loads::{Dynamics, PolarInertia};
use crate::scenario::profile::Profile;
use crate::scenario::supports::Clamp;
use crate::scenario::veins::Rod;
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Largest plausible stretch of a vein relative to its rest stretch.
pub(crate) const LARGEST_PLAUSIBLE_STRETCH: f64 = 0.2;

/// What numbers of a leaf plausibly are. Accelerations are in units of length per second squared.
struct PlausibleRanges {
    /// A leaf longer than (A/q)^(1/3) by this factor hangs like a thread: a column is stable under its
    /// own weight up to 1.99 times that length (Greenhill 1881, Proc. Camb. Phil. Soc. 4).
    hanging_length: f64,
    /// Relative tolerance with which the acceleration of gravity is recognized.
    gravity_tolerance: f64,
    /// Multiple of (A/q)^(1/3) from which on a weight of 9.81 is taken for an acceleration.
    suspicious_length: f64,
    /// Multiple of the acceleration of gravity, and fraction of it, by which a weight contradicts a
    /// mass.
    weight_contradiction: f64,
    /// Fraction by which two statements of a weight differ in rounding, and their angle in radians.
    weight_tolerance: f64,
    /// Angles beyond a right angle that are whole numbers are degrees, and so are twists of more than
    /// a turn that are multiples of this.
    degree_multiple: f64,
    /// Difference from a right angle that is one of digits left out.
    upright_tolerance: f64,
    /// Multiple of the width of a blade that its veins do not turn to the wind together.
    width_in_wind: f64,
}

const PLAUSIBLE: PlausibleRanges = PlausibleRanges {
    hanging_length: 30.0,
    gravity_tolerance: 2e-3,
    suspicious_length: 5.0,
    weight_contradiction: 10.0,
    weight_tolerance: 0.01,
    degree_multiple: 15.0,
    upright_tolerance: 1e-3,
    width_in_wind: 1.5,
};

/// A unit of length, and the acceleration of gravity in it per second squared.
struct GravityInUnit {
    length: &'static str,
    acceleration: f64,
}

const GRAVITY_IN_UNITS: [GravityInUnit; 4] = {
    const fn unit(length: &'static str, acceleration: f64) -> GravityInUnit {
        GravityInUnit {
            length,
            acceleration,
        }
    }
    [
        unit("m", 9.81),
        unit("cm", 981.0),
        unit("mm", 9810.0),
        unit("in", 386.1),
    ]
};

/// The least and the largest acceleration of gravity in these units: in metres and in millimetres.
const GRAVITY_RANGE: [f64; 2] = [
    GRAVITY_IN_UNITS[0].acceleration,
    GRAVITY_IN_UNITS[2].acceleration,
];

impl GravityInUnit {
    fn of(length: &str) -> Option<&'static GravityInUnit> {
        GRAVITY_IN_UNITS.iter().find(|unit| unit.length == length)
    }
}

remarks! {
    /// What in a scenario is probably not what was intended. Veins are counted from 0, and numbers
    /// are in the units of the scenario.
    pub enum PlausibilityWarning {
        /// An angle that is in degrees, or of a vein that grows backwards.
        #[error("{key} is in radians, and {angle} is {}", turn_in_words(*.angle))]
        AngleInDegrees {
            /// The key of the scenario.
            key: &'static str,
            /// Its value.
            angle: f64,
        } = "angle-in-degrees",
        /// A leaf that is upright but for the digits of its angle.
        #[error(
            "leaf.elevation is {angle}, a right angle but for {}, and the leaf leans so much: a leaf that is exactly upright, whose critical load can be traced, has {}",
            four_digits(.angle.abs() - FRAC_PI_2), FRAC_PI_2.copysign(*.angle)
        )]
        NearlyUpright {
            /// Its elevation.
            angle: f64,
        } = "nearly-upright",
        /// Rotary inertia that is not given, of veins with a mass.
        #[error(
            "dynamics.density is given without a rotary inertia: frequencies and motions are those of veins with sections {} in radius, a fifth of the length; dynamics.section_radius gives the radius of round ones, dynamics.rotary_inertia that of others",
            four_digits(*.radius)
        )]
        AssumedRotaryInertia {
            /// The radius of a round section with the rotary inertia that is assumed.
            radius: f64,
        } = "assumed-rotary-inertia",
        /// A width in the wind that is that of a blade, and that every vein of it has.
        #[error(
            "wind.width is that of each vein: together they turn {} to the wind where the blade is {} wide; without it \
             each vein has the width of its strip",
            four_digits(*.together), four_digits(*.blade)
        )]
        WiderThanBlade {
            /// The largest widths of all veins together.
            together: f64,
            /// The largest width of the blade.
            blade: f64,
        } = "wider-than-blade",
        /// A section with a side longer than its vein.
        #[error(
            "the section of vein {} is {} across, and the vein is {} long: check both numbers and their units",
            .vein + 1, four_digits(*.side), four_digits(*.length)
        )]
        ThickerThanLong {
            /// The vein.
            vein: usize,
            /// The longest side of its section.
            side: f64,
            /// Its length.
            length: f64,
        } = "thicker-than-long",
        /// A tip that is held farther from the base than a vein plausibly stretches.
        #[error(
            "tip.position is {} from the base, and vein {} is {} long: it would stretch by {:.0} %; check both numbers and their units",
            four_digits(*.distance), .vein + 1, four_digits(*.length), 100.0 * .stretch
        )]
        OutOfReach {
            /// Of the tip from the base.
            distance: f64,
            /// The vein that would stretch most.
            vein: usize,
            /// Its length at rest.
            length: f64,
            /// By which part of its length it would stretch.
            stretch: f64,
        } = "out-of-reach",
        /// A weight per length besides an acceleration that gives the mass the same weight.
        #[error(
            "load.gravity and load.g state the same weight, {} per length of vein {}, which then counts twice; {}",
            four_digits(*.weight), .vein + 1, BOTH_WEIGHTS
        )]
        WeightGivenTwice {
            /// A vein that has both.
            vein: usize,
            /// The weight per length.
            weight: f64,
        } = "weight-given-twice",
        /// A weight per length besides an acceleration that gives the mass another weight.
        #[error(
            "load.gravity and load.g contradict each other: {}; {}",
            both_weights(*.vein, [*.given, *.of_mass], *.apart), BOTH_WEIGHTS
        )]
        WeightsContradict {
            /// A vein that has both.
            vein: usize,
            /// Its weight per length, as given.
            given: f64,
            /// The weight per length of its mass.
            of_mass: f64,
            /// The angle between both, in radians, if their directions differ.
            apart: Option<f64>,
        } = "weights-contradict",
        /// A leaf that is too long for its weight, which is the acceleration of gravity by its number.
        #[error(
            "{}: load.gravity is a force per length, mass per length times 9.81, not the acceleration",
            too_long_in_words(*.times)
        )]
        AccelerationAsWeight {
            /// The length of every vein, at least, in lengths over which it carries its weight.
            times: f64,
        } = "acceleration-as-weight",
        /// A leaf that is too long for its weight and stiffness.
        #[error(
            "{}: {}", too_long_in_words(*.times),
            match .of_mass {
                true => "load.g is an acceleration: check it, the mass, the stiffnesses and the units",
                false => "load.gravity is a force per length: check it, the stiffnesses and the units",
            }
        )]
        TooLong {
            /// The length of every vein, at least, in lengths over which it carries its weight.
            times: f64,
            /// Whether the weight is that of its mass, by an acceleration.
            of_mass: bool,
        } = "too-long",
        /// A material denser than any.
        #[error(
            "{key} is {} kg/m³ in the units of the scenario, and osmium, the densest material, has 22600; check it and its unit: with lengths in {length}, forces in {force} and times in s, water has {}",
            four_digits(*.density), four_digits(*.water)
        )]
        DenserThanAnything {
            /// The key of the scenario.
            key: &'static str,
            /// Mass per volume, in kg/m³.
            density: f64,
            /// The unit of length.
            length: String,
            /// The unit of force.
            force: String,
            /// That of water in the units of the scenario.
            water: f64,
        } = "denser-than-anything",
        /// A material lighter than air.
        #[error(
            "{key} is {} kg/m³ in the units of the scenario, and air has {AIR}: it is mass per volume; divide a mass per area by the thickness",
            four_digits(*.density)
        )]
        LighterThanAir {
            /// The key of the scenario.
            key: &'static str,
            /// Mass per volume, in kg/m³.
            density: f64,
        } = "lighter-than-air",
        /// A material stiffer than any.
        #[error(
            "{key} is {} GPa in the units of the scenario, and diamond, the stiffest material, has 1220; check it and its unit: with lengths in {length} and forces in {force}, 1 GPa is {}",
            four_digits(1e-9 * .young), four_digits(*.gigapascal)
        )]
        StifferThanDiamond {
            /// The key of the scenario.
            key: &'static str,
            /// Young's modulus, in Pa.
            young: f64,
            /// The unit of length.
            length: String,
            /// The unit of force.
            force: String,
            /// A gigapascal in the units of the scenario.
            gigapascal: f64,
        } = "stiffer-than-diamond",
        /// A weight that is not that of the mass.
        #[error(
            "load.gravity is {} per length, and the mass per length is {}: the acceleration of gravity would be {}; check both and their units",
            four_digits(*.weight), four_digits(*.mass), four_digits(.weight / .mass)
        )]
        WeightOfAnotherMass {
            /// Per length.
            weight: f64,
            /// Per length.
            mass: f64,
        } = "weight-of-another-mass",
        /// The acceleration of gravity as it is in another unit of length.
        #[error(
            "load.g is {}, the acceleration of gravity in {other}/s², and lengths are in {unit}: there it is {expected}",
            four_digits(*.given)
        )]
        GravityOfAnotherUnit {
            /// The acceleration.
            given: f64,
            /// The unit of length in which it is that of gravity.
            other: &'static str,
            /// The unit of length of the scenario.
            unit: String,
            /// That of gravity in it.
            expected: f64,
        } = "gravity-of-another-unit",
    }
}

/// What to do about two weights.
const BOTH_WEIGHTS: &str =
    "they add up: give one of them, and other loads along veins as load.distributed";

fn turn_in_words(angle: f64) -> &'static str {
    match angle.abs() > TAU {
        true => "more than a turn",
        false => "more than a right angle",
    }
}

fn both_weights(vein: usize, weights: [f64; 2], apart: Option<f64>) -> String {
    let ([one, other], vein) = (weights.map(four_digits), vein + 1);
    match apart {
        Some(angle) => format!(
            "as weights per length of vein {vein}, {one} and {other}, they are {:.0} degrees apart",
            angle.to_degrees()
        ),
        None => format!("they state the weights {one} and {other} per length of vein {vein}"),
    }
}

fn too_long_in_words(times: f64) -> String {
    format!(
        "every vein is {times:.0} times longer than (A/q)^(1/3), over which it carries its weight"
    )
}

fn four_digits(number: f64) -> f64 {
    format!("{number:.3e}").parse().unwrap_or(number)
}

/// What is probably not what was intended.
pub fn plausibility_warnings(scenario: &Scenario) -> Vec<PlausibilityWarning> {
    let heavy = weight_stated_twice(scenario).or_else(|| leaf_too_long_for_weight(scenario));
    let heavy = heavy
        .or_else(|| weight_of_another_mass(scenario))
        .or_else(|| gravity_of_another_unit(scenario));
    let lengths = [
        section_wider_than_vein_long(scenario),
        heavy,
        held_tip_out_of_reach(scenario),
    ];
    let angles = [
        fan_angles_in_degrees(scenario),
        clamp_angle_in_degrees(scenario),
        nearly_upright(scenario),
    ];
    let materials = [
        denser_than_anything(scenario),
        lighter_than_air(scenario),
        stiffer_than_diamond(scenario),
        wider_than_blade(scenario),
    ];
    let all = angles.into_iter().chain(lengths).chain(materials);
    all.flatten().collect()
}

/// The one of them that most probably keeps a leaf from coming to rest.
pub fn probable_obstacle_to_rest(scenario: &Scenario) -> Option<PlausibilityWarning> {
    let slips = [
        held_tip_out_of_reach,
        clamp_angle_in_degrees,
        fan_angles_in_degrees,
        section_wider_than_vein_long,
        weight_stated_twice,
        weight_of_another_mass,
    ];
    slips.into_iter().find_map(|slip| slip(scenario))
}

/// A width in the wind that every vein of a blade has, and that is the blade's.
fn wider_than_blade(scenario: &Scenario) -> Option<PlausibilityWarning> {
    let (wind, blade) = (scenario.wind.as_ref()?, scenario.blade.as_ref()?);
    let together = wind.width.iter().map(Profile::max_abs).sum();
    let blade = blade.width(blade.widest());
    (together > PLAUSIBLE.width_in_wind * blade)
        .then_some(PlausibilityWarning::WiderThanBlade { together, blade })
}

/// How far a held tip is from the base of a vein.
struct TipReach {
    vein: usize,
    /// By which part the vein would have to stretch.
    stretch: f64,
    away: f64,
    /// Length of the vein at rest.
    length: f64,
}

/// A tip that is held farther from the base than a vein plausibly stretches.
pub fn held_tip_out_of_reach(scenario: &Scenario) -> Option<PlausibilityWarning> {
    let tip = DVec3::from_array(scenario.held_tip.as_ref()?.position);
    let reach = |(vein, rod): (usize, &Rod)| {
        let length = rod.length * rod.rest_stretch.integral(1.0);
        let away = tip.distance(rod.base_position());
        TipReach {
            vein,
            stretch: away / length - 1.0,
            away,
            length,
        }
    };
    let all = scenario.rods.iter().enumerate().map(reach);
    let least = all.min_by(|a, b| b.stretch.total_cmp(&a.stretch))?;
    (least.stretch > LARGEST_PLAUSIBLE_STRETCH).then_some(PlausibilityWarning::OutOfReach {
        distance: least.away,
        vein: least.vein,
        length: least.length,
        stretch: least.stretch,
    })
}

/// Base angles of more than a right angle: a vein that grows backwards.
fn fan_angles_in_degrees(scenario: &Scenario) -> Option<PlausibilityWarning> {
    type Angle = fn(&Rod) -> f64;
    let kinds: [(&'static str, Angle); 2] = [
        ("leaf.fan", |rod| rod.angle),
        ("leaf.elevation", |rod| rod.elevation),
    ];
    let doubt = |key: &'static str, angle: f64| {
        let turned = angle.abs() > FRAC_PI_2 * (1.0 + PLAUSIBLE.gravity_tolerance);
        turned.then_some(PlausibilityWarning::AngleInDegrees { key, angle })
    };
    if let Some(blade) = &scenario.blade {
        // The directions of a blade's veins follow from this angle and the outline.
        return doubt("leaf.elevation", blade.elevation);
    }
    kinds.into_iter().find_map(|(key, of)| {
        let angles = scenario.rods.iter().map(of);
        doubt(key, angles.max_by(|a, b| a.abs().total_cmp(&b.abs()))?)
    })
}

/// An angle by which a clamped tip is turned that looks like one in degrees.
fn clamp_angle_in_degrees(scenario: &Scenario) -> Option<PlausibilityWarning> {
    let clamps = scenario.held_tip.as_ref()?.clamps.as_ref()?;
    let angle = |clamp: &Clamp| {
        let whole = clamp.angle.fract() == 0.0 && clamp.angle.abs() > FRAC_PI_2;
        whole.then_some(("tip.angles", clamp.angle))
    };
    let twist = |clamp: &Clamp| {
        let whole = clamp.twist % PLAUSIBLE.degree_multiple == 0.0 && clamp.twist.abs() > TAU;
        whole.then_some(("tip.twist", clamp.twist))
    };
    let (key, angle) = clamps
        .iter()
        .find_map(|clamp| angle(clamp).or_else(|| twist(clamp)))?;
    Some(PlausibilityWarning::AngleInDegrees { key, angle })
}

/// An elevation that differs from a right angle by rounding of its digits.
fn nearly_upright(scenario: &Scenario) -> Option<PlausibilityWarning> {
    let angle = match &scenario.blade {
        Some(blade) => blade.elevation,
        None => scenario.rods.first()?.elevation,
    };
    let apart = (angle.abs() - FRAC_PI_2).abs();
    (apart > 0.0 && apart < PLAUSIBLE.upright_tolerance)
        .then_some(PlausibilityWarning::NearlyUpright { angle })
}

/// The rotary inertia that veins without a section have, where masses are real ones.
pub fn assumed_rotary_inertia(scenario: &Scenario) -> Option<PlausibilityWarning> {
    let given = &scenario.dynamics;
    let assumed = given.polar_inertia == PolarInertia::Same
        && given.density != Dynamics::default_for(&scenario.rods).density;
    let real = assumed && scenario.units.is_in_seconds();
    let density = given.density.first()?.at(0.0);
    let inertia = given.rotary_inertia.first()?[0].at(0.0);
    real.then_some(PlausibilityWarning::AssumedRotaryInertia {
        radius: 2.0 * (inertia / density).sqrt(),
    })
}

/// A section with a side longer than its vein.
fn section_wider_than_vein_long(scenario: &Scenario) -> Option<PlausibilityWarning> {
    let side = |j: usize| scenario.radii.largest_side(j).unwrap_or(0.0);
    let mut rods = scenario.rods.iter().enumerate();
    let (vein, rod) = rods.find(|(j, rod)| side(*j) >= rod.length)?;
    Some(PlausibilityWarning::ThickerThanLong {
        vein,
        side: side(vein),
        length: rod.length,
    })
}

/// Density of osmium, in kg/m³, and Young's modulus of diamond, in Pa (Lide, CRC Handbook of Chemistry and
/// Physics, 85th ed., sections 4 and 12): no material has more.
const LARGEST_DENSITY: f64 = 2.26e4;
const LARGEST_YOUNG: f64 = 1.22e12;

/// Density of water, in kg/m³.
const WATER: f64 = 1e3;

/// Density of air at sea level, in kg/m³ (International Standard Atmosphere, ISO 2533).
const AIR: f64 = 1.225;

/// A mass per volume, where units are named.
struct NamedDensity {
    key: &'static str,
    /// In the units of the scenario.
    value: f64,
    /// The unit, in kg/m³.
    unit: f64,
}

impl NamedDensity {
    /// The largest mass per volume of a scenario.
    fn of(scenario: &Scenario) -> Option<NamedDensity> {
        let units = &scenario.units;
        let (metres, newtons) = (units.meters()?, units.newtons()?);
        if !units.is_in_seconds() {
            return None;
        }
        let (key, value) = match &scenario.blade {
            Some(blade) => ("blade.mass_density", blade.largest_mass_density()?),
            None => (
                "section.mass_density",
                scenario.radii.largest_mass_density()?,
            ),
        };
        // The unit of mass is that of force times a second squared over that of length.
        let unit = newtons / metres.powi(4);
        Some(NamedDensity { key, value, unit })
    }
}

/// A material denser than any, where units are named.
fn denser_than_anything(scenario: &Scenario) -> Option<PlausibilityWarning> {
    let NamedDensity { key, value, unit } = NamedDensity::of(scenario)?;
    let (units, density) = (&scenario.units, unit * value);
    (density > LARGEST_DENSITY).then(|| PlausibilityWarning::DenserThanAnything {
        key,
        density,
        length: units.length.clone().unwrap_or_default(),
        force: units.force.clone().unwrap_or_default(),
        water: WATER / unit,
    })
}

/// A material lighter than air, where units are named.
fn lighter_than_air(scenario: &Scenario) -> Option<PlausibilityWarning> {
    let NamedDensity { key, value, unit } = NamedDensity::of(scenario)?;
    let density = unit * value;
    (0.0 < density && density < AIR).then_some(PlausibilityWarning::LighterThanAir { key, density })
}

/// A material stiffer than any, where units are named.
fn stiffer_than_diamond(scenario: &Scenario) -> Option<PlausibilityWarning> {
    let units = &scenario.units;
    let unit = units.newtons()? / units.meters()?.powi(2);
    let (key, largest) = match &scenario.blade {
        Some(blade) => ("blade.young", blade.largest_young()),
        None => ("section.young", scenario.radii.largest_young()?),
    };
    let young = unit * largest;
    (young > LARGEST_YOUNG).then(|| PlausibilityWarning::StifferThanDiamond {
        key,
        young,
        length: units.length.clone().unwrap_or_default(),
        force: units.force.clone().unwrap_or_default(),
        gigapascal: 1e9 / unit,
    })
}

/// A weight per length besides an acceleration that pulls the mass: they add up, and state either the
/// same weight twice or two weights.
fn weight_stated_twice(scenario: &Scenario) -> Option<PlausibilityWarning> {
    let weights = |vein: usize| {
        let weight = scenario.weight(vein);
        let given = DVec3::from_array(weight.even);
        let (g, mass) = weight.of_mass?;
        let pulled = DVec3::from_array(g) * mass.integral(1.0);
        (given != DVec3::ZERO).then_some((vein, given, pulled))
    };
    let (vein, given, pulled) = (0..scenario.rods.len()).find_map(weights)?;
    let of_mass = pulled.length();
    let angle = given.angle_between(pulled);
    Some(
        match given.distance(pulled) <= PLAUSIBLE.weight_tolerance * of_mass {
            true => PlausibilityWarning::WeightGivenTwice {
                vein,
                weight: of_mass,
            },
            false => PlausibilityWarning::WeightsContradict {
                vein,
                given: given.length(),
                of_mass,
                apart: (angle > PLAUSIBLE.weight_tolerance).then_some(angle),
            },
        },
    )
}

/// A weight that is not that of the mass, if both are given, in seconds.
fn weight_of_another_mass(scenario: &Scenario) -> Option<PlausibilityWarning> {
    let even = (0..scenario.rods.len()).map(|vein| scenario.weight(vein).even);
    let weight = even.map(|even| DVec3::from_array(even).length());
    let weight = weight.fold(0.0, f64::max);
    let given = scenario.dynamics.density != Dynamics::default_for(&scenario.rods).density;
    let unit = scenario.units.length.as_deref();
    if scenario.units.time.is_some() && !scenario.units.is_in_seconds() {
        return None;
    }
    let [least, most] = match unit.and_then(GravityInUnit::of) {
        Some(known) if given => [known.acceleration; 2],
        // In units without names densities alone may be dimensionless, those of a material not.
        None if unit.is_none() && scenario.radii.have_mass() => GRAVITY_RANGE,
        _ => return None,
    };
    let mass = scenario.dynamics.mean_density();
    let found = weight / mass;
    let allowed = least / PLAUSIBLE.weight_contradiction..=most * PLAUSIBLE.weight_contradiction;
    (weight > 0.0 && !allowed.contains(&found))
        .then_some(PlausibilityWarning::WeightOfAnotherMass { weight, mass })
}

/// The acceleration of gravity as it is in another unit of length.
fn gravity_of_another_unit(scenario: &Scenario) -> Option<PlausibilityWarning> {
    let units = &scenario.units;
    if units.time.is_some() && !units.is_in_seconds() {
        return None;
    }
    let own = units.length.as_deref()?;
    let known = GravityInUnit::of(own)?.acceleration;
    let given = DVec3::from_array(scenario.g).length();
    let is = |acceleration: f64| (given / acceleration - 1.0).abs() < PLAUSIBLE.gravity_tolerance;
    let of_other = |unit: &&GravityInUnit| unit.length != own && is(unit.acceleration);
    let other = GRAVITY_IN_UNITS.iter().find(of_other)?.length;
    Some(PlausibilityWarning::GravityOfAnotherUnit {
        given,
        other,
        unit: own.to_owned(),
        expected: known,
    })
}

/// A leaf that is too long for its weight and stiffness, if only its base is held.
fn leaf_too_long_for_weight(scenario: &Scenario) -> Option<PlausibilityWarning> {
    if scenario.held_tip.is_some() {
        return None;
    }
    let weights = (0..scenario.rods.len()).map(|vein| scenario.weight(vein).at(0.5));
    let weights = weights.map(|weight| DVec3::from_array(weight).length());
    let weight = weights.fold(0.0, f64::max);
    // 9.81 times a power of ten, for other units of length.
    let digits = weight / 10_f64.powf((weight / GRAVITY_RANGE[0]).log10().round());
    let of_mass = scenario.g != [0.0; 3];
    let slip = !of_mass && (digits / GRAVITY_RANGE[0] - 1.0).abs() < PLAUSIBLE.gravity_tolerance;
    // A blade's edge may carry what its face does not: only the mistake is sought by their mean.
    let stiffness = |rod: &Rod| {
        let [face, edge] = [1, 2].map(|axis| rod.couple_stiffness[axis].at(0.0));
        if slip {
            (face * edge).sqrt()
        } else {
            face.max(edge)
        }
    };
    let times = |rod: &Rod| rod.length / (stiffness(rod) / weight).cbrt();
    let shortest = scenario
        .rods
        .iter()
        .map(times)
        .fold(f64::INFINITY, f64::min);
    if weight == 0.0
        || shortest
            < if slip {
                PLAUSIBLE.suspicious_length
            } else {
                PLAUSIBLE.hanging_length
            }
    {
        return None;
    }
    let times = shortest;
    Some(match slip {
        true => PlausibilityWarning::AccelerationAsWeight { times },
        false => PlausibilityWarning::TooLong { times, of_mass },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Metres and centimetres are told apart by the acceleration of gravity, where units have names.
    #[test]
    fn gravity_in_another_unit_is_doubted() {
        let doubts = |length: &str, g: f64| {
            // The density of water, and 1 GPa.
            let (density, young) = match length {
                "cm" => (1e-5, 1e5),
                _ => (1e3, 1e9),
            };
            let text = format!(
                r#"
                units = {{ length = "{length}", force = "N", time = "s" }}
                leaf = {{ rods = 1, length = 3.0, fan = [0.0] }}
                section = {{ shape = "circle", diameter = 0.2, young = {young}, mass_density = {density} }}
                load = {{ g = [0.0, 0.0, -{g}] }}"#
            );
            plausibility_warnings(&Scenario::from_toml(&text).unwrap())
        };
        let said = "load.g is 9.81, the acceleration of gravity in m/s², and lengths are in cm: there it is 981";
        assert_eq!(doubts("cm", 9.81)[0].to_string(), said);
        for (length, g, meant) in [("cm", 9.8, ("m", 981.0)), ("m", 981.0, ("cm", 9.81))] {
            let said = &doubts(length, g)[0];
            assert!(
                matches!(said, PlausibilityWarning::GravityOfAnotherUnit { other, expected, .. }
                    if (*other, *expected) == meant),
                "{said}"
            );
        }
        for (length, g) in [("cm", 981.0), ("m", 9.81), ("cm", 160.0), ("ell", 9.81)] {
            assert_eq!(doubts(length, g), []);
        }
    }

    /// A blade is turned by one angle, of which those of its veins are no evidence.
    #[test]
    fn a_blade_turned_by_degrees_is_doubted() {
        let doubts = |elevation: f64| {
            let text = format!(
                r#"
                units = {{ length = "cm", force = "N" }}
                leaf = {{ rods = 5, elevation = {elevation} }}
                blade = {{ length = 20.0, width = {{ at = [0.0, 0.4, 1.0], value = [1.0, 2.0, 0.2] }}, thickness = 0.03, young = 1e5 }}"#
            );
            plausibility_warnings(&Scenario::from_toml(&text).unwrap())
        };
        for elevation in [45.0, 2.0] {
            let said = doubts(elevation);
            let key = "leaf.elevation";
            let wanted = PlausibilityWarning::AngleInDegrees {
                key,
                angle: elevation,
            };
            assert_eq!(said, [wanted]);
        }
        assert_eq!(doubts(1.2), []);
    }

    /// A column whose angle has five digits leans, and has no critical load.
    #[test]
    fn a_column_that_leans_by_the_digits_of_its_angle_is_doubted() {
        let doubts = |elevation: &str| {
            let text = format!(
                r#"
                leaf = {{ rods = 1, length = 1.0, fan = [0.0], elevation = {elevation} }}
                section = {{ shape = "circle", diameter = 0.01, young = 1e9 }}"#
            );
            plausibility_warnings(&Scenario::from_toml(&text).unwrap())
        };
        for angle in ["1.5708", "-1.5708", "1.57"] {
            let said = doubts(angle);
            let angle = angle.parse().unwrap();
            assert_eq!(said, [PlausibilityWarning::NearlyUpright { angle }]);
        }
        for angle in ["1.5707963267948966", "-1.5707963267948966", "1.56", "0.0"] {
            assert_eq!(doubts(angle), [], "{angle}");
        }
        let said = doubts("1.5708")[0].to_string();
        assert!(said.contains("1.5707963267948966"), "{said}");
    }

    /// Real masses have real sections: those that are assumed are a fifth of the length in radius.
    #[test]
    fn a_rotary_inertia_that_is_assumed_is_doubted() {
        let doubts = |time: &str, dynamics: &str| {
            let text = format!(
                r#"
                units = {{ length = "cm", force = "N"{time} }}
                leaf = {{ rods = 1, length = 12.0, fan = [0.0] }}
                stiffness = {{ torsion = 0.2, bending_2 = 0.2, bending_3 = 0.2, axial = inf, shear_2 = inf, shear_3 = inf }}
                dynamics = {{ {dynamics} }}"#
            );
            assumed_rotary_inertia(&Scenario::from_toml(&text).unwrap())
        };
        let seconds = ", time = \"s\"";
        let density = "density = 7.5e-7";
        let Some(PlausibilityWarning::AssumedRotaryInertia { radius }) = doubts(seconds, density)
        else {
            panic!("{:?}", doubts(seconds, density))
        };
        assert!((radius - 2.4).abs() < 1e-12, "{radius}");
        for given in ["section_radius = 0.1", "rotary_inertia = 1e-9"] {
            assert_eq!(doubts(seconds, &format!("{density}, {given}")), None);
        }
        assert_eq!(doubts("", density), None);
        assert_eq!(doubts("", ""), None);
    }

    /// Materials in other units than those of the scenario: 0.8 g/cm³ and 500 MPa as they stand, in cm and N.
    #[test]
    fn materials_that_there_are_not_are_doubted() {
        let doubts = |density: f64, young: f64, of: &str| {
            let material = format!("young = {young:e}, mass_density = {density:e}");
            let leaf = match of {
                "section" => format!(
                    "leaf = {{ rods = 1, length = 3.0, fan = [0.0] }}\nsection = {{ shape = \"circle\", diameter = 0.2, {material} }}"
                ),
                _ => format!(
                    "leaf = {{ rods = 5 }}\nblade = {{ length = 20.0, width = {{ at = [0.0, 1.0], value = [1.0, 2.0] }}, thickness = 0.03, {material} }}"
                ),
            };
            let text = format!(
                "units = {{ length = \"cm\", force = \"N\", time = \"s\" }}\n{leaf}\nload = {{ g = [0.0, 0.0, -1e-9] }}"
            );
            let said = plausibility_warnings(&Scenario::from_toml(&text).unwrap());
            said.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        for of in ["section", "blade"] {
            assert_eq!(doubts(8e-6, 5e4, of), Vec::<String>::new(), "{of}");
            // A thousand times too dense: 800,000 kg/m³.
            let said = doubts(8e-3, 5e4, of);
            let wanted = format!("{of}.mass_density is 800000 kg/m³");
            assert!(said[0].starts_with(&wanted), "{said:?}");
            assert!(said[0].ends_with("water has 0.00001"), "{said:?}");
            // In Pa in place of N/cm²: 5 TPa.
            let said = doubts(8e-6, 5e8, of);
            let wanted = format!("{of}.young is 5000 GPa");
            assert!(said[0].starts_with(&wanted), "{said:?}");
            assert!(said[0].ends_with("1 GPa is 100000"), "{said:?}");
        }
    }

    /// A weight of another mass may keep a leaf from coming to rest.
    #[test]
    fn a_weight_of_another_mass_is_an_obstacle() {
        let heavy = |density: f64| {
            let text = format!(
                r#"
                name = "heavy"
                leaf = {{ rods = 1, length = 0.3, fan = [0.0] }}
                section = {{ shape = "circle", diameter = 0.002, young = 1e9, mass_density = {density:e} }}
                load = {{ gravity = [0.0, 0.0, -0.03] }}"#
            );
            probable_obstacle_to_rest(&Scenario::from_toml(&text).unwrap())
        };
        assert_eq!(heavy(1000.0), None);
        assert!(heavy(1e-6).is_some());
    }
}
