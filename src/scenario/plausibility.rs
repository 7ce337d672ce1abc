//! Numbers of a scenario that are allowed, but probably not what was intended: degrees in place of
//! radians, accelerations in place of weights, lengths in other units.

use crate::scenario::checked::Scenario;
use crate::scenario::loads::Dynamics;
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
}

const PLAUSIBLE: PlausibleRanges = PlausibleRanges {
    hanging_length: 30.0,
    gravity_tolerance: 2e-3,
    suspicious_length: 5.0,
    weight_contradiction: 10.0,
    weight_tolerance: 0.01,
    degree_multiple: 15.0,
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

/// What is probably not what was intended, one short sentence each.
pub fn plausibility_warnings(scenario: &Scenario) -> Vec<String> {
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
    ];
    angles.into_iter().chain(lengths).flatten().collect()
}

/// The implausible number that most probably keeps a leaf from coming to rest.
pub fn probable_obstacle_to_rest(scenario: &Scenario) -> Option<String> {
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

/// How far a held tip is from the base of a vein.
struct TipReach {
    /// By which part the vein would have to stretch.
    stretch: f64,
    away: f64,
    /// Length of the vein at rest.
    length: f64,
}

/// A tip that is held farther from the base than a vein plausibly stretches.
pub fn held_tip_out_of_reach(scenario: &Scenario) -> Option<String> {
    let tip = DVec3::from_array(scenario.held_tip.as_ref()?.position);
    let reach = |rod: &Rod| {
        let length = rod.length * rod.rest_stretch.integral(1.0);
        let away = tip.distance(rod.base_position());
        TipReach {
            stretch: away / length - 1.0,
            away,
            length,
        }
    };
    let all = scenario.rods.iter().map(reach).enumerate();
    let (j, nearest) = all.min_by(|(_, a), (_, b)| b.stretch.total_cmp(&a.stretch))?;
    (nearest.stretch > LARGEST_PLAUSIBLE_STRETCH).then(|| {
        format!(
            "tip.position is {} from the base, and vein {} is {} long: it would stretch by {:.0} %; check both numbers and their units",
            round_to_four_digits(nearest.away),
            j + 1,
            round_to_four_digits(nearest.length),
            100.0 * nearest.stretch
        )
    })
}

fn round_to_four_digits(number: f64) -> f64 {
    format!("{number:.3e}").parse().unwrap_or(number)
}

/// Base angles of more than a right angle: a vein that grows backwards.
fn fan_angles_in_degrees(scenario: &Scenario) -> Option<String> {
    let doubt = |key: &str, angle: f64| {
        let turned = angle.abs() > FRAC_PI_2 * (1.0 + PLAUSIBLE.gravity_tolerance);
        turned.then(|| {
            format!(
                "{key} is in radians, and {angle} is {}",
                turn_in_words(angle)
            )
        })
    };
    if let Some(blade) = &scenario.blade {
        // The directions of a blade's veins follow from this angle and the outline.
        return doubt("leaf.elevation", blade.elevation);
    }
    let largest = |key: &str, angle: fn(&Rod) -> f64| {
        let angles = scenario.rods.iter().map(angle);
        doubt(key, angles.max_by(|a, b| a.abs().total_cmp(&b.abs()))?)
    };
    largest("leaf.fan", |rod| rod.angle).or_else(|| largest("leaf.elevation", |rod| rod.elevation))
}

/// An angle by which a clamped tip is turned that looks like one in degrees.
fn clamp_angle_in_degrees(scenario: &Scenario) -> Option<String> {
    let clamps = scenario.held_tip.as_ref()?.clamps.as_ref()?;
    let angle = |clamp: &Clamp| {
        let whole = clamp.angle.fract() == 0.0 && clamp.angle.abs() > FRAC_PI_2;
        whole.then_some(("angles", clamp.angle))
    };
    let twist = |clamp: &Clamp| {
        let whole = clamp.twist % PLAUSIBLE.degree_multiple == 0.0 && clamp.twist.abs() > TAU;
        whole.then_some(("twist", clamp.twist))
    };
    let (key, angle) = clamps
        .iter()
        .find_map(|clamp| angle(clamp).or_else(|| twist(clamp)))?;
    let turned = turn_in_words(angle);
    Some(format!("tip.{key} is in radians, and {angle} is {turned}"))
}

fn turn_in_words(angle: f64) -> &'static str {
    match angle.abs() > TAU {
        true => "more than a turn",
        false => "more than a right angle",
    }
}

/// A section with a side longer than its vein.
fn section_wider_than_vein_long(scenario: &Scenario) -> Option<String> {
    let side = |j: usize| scenario.radii.largest_side(j).unwrap_or(0.0);
    let mut rods = scenario.rods.iter().enumerate();
    let (j, rod) = rods.find(|(j, rod)| side(*j) > rod.length)?;
    Some(format!(
        "the section of vein {} is {} across, and the vein is {} long: check both numbers and their units",
        j + 1,
        round_to_four_digits(side(j)),
        round_to_four_digits(rod.length)
    ))
}

/// A weight per length besides an acceleration that pulls the mass: they add up, and state either the
/// same weight twice or two weights.
fn weight_stated_twice(scenario: &Scenario) -> Option<String> {
    let weights = |vein: usize| {
        let weight = scenario.weight(vein);
        let given = DVec3::from_array(weight.even);
        let (g, mass) = weight.of_mass?;
        let pulled = DVec3::from_array(g) * mass.integral(1.0);
        (given != DVec3::ZERO).then_some((vein, given, pulled))
    };
    let (vein, given, pulled) = (0..scenario.rods.len()).find_map(weights)?;
    let (one, other) = (
        round_to_four_digits(given.length()),
        round_to_four_digits(pulled.length()),
    );
    let angle = given.angle_between(pulled);
    let states = match given.distance(pulled) <= PLAUSIBLE.weight_tolerance * pulled.length() {
        true => format!(
            "state the same weight, {other} per length of vein {}, which then counts twice",
            vein + 1
        ),
        false if angle > PLAUSIBLE.weight_tolerance => format!(
            "contradict each other: as weights per length of vein {}, {one} and {other}, they are {:.0} degrees apart",
            vein + 1,
            angle.to_degrees()
        ),
        false => format!(
            "contradict each other: they state the weights {one} and {other} per length of vein {}",
            vein + 1
        ),
    };
    Some(format!(
        "load.gravity and load.g {states}; they add up: give one of them, and other loads along veins as load.distributed"
    ))
}

/// A weight that is not that of the mass, if both are given, in seconds.
fn weight_of_another_mass(scenario: &Scenario) -> Option<String> {
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
    (weight > 0.0 && !allowed.contains(&found)).then(|| {
        format!(
            "load.gravity is {} per length, and the mass per length is {}: the acceleration of gravity would be {}; check both and their units",
            round_to_four_digits(weight),
            round_to_four_digits(mass),
            round_to_four_digits(found)
        )
    })
}

/// The acceleration of gravity as it is in another unit of length.
fn gravity_of_another_unit(scenario: &Scenario) -> Option<String> {
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
    Some(format!(
        "load.g is {}, the acceleration of gravity in {other}/s², and lengths are in {own}: there it is {known}",
        round_to_four_digits(given)
    ))
}

/// A leaf that is too long for its weight and stiffness, if only its base is held.
fn leaf_too_long_for_weight(scenario: &Scenario) -> Option<String> {
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
    let advice = match slip {
        true => {
            "load.gravity is a force per length, mass per length times 9.81, not the acceleration"
        }
        false if of_mass => {
            "load.g is an acceleration: check it, the mass, the stiffnesses and the units"
        }
        false => "load.gravity is a force per length: check it, the stiffnesses and the units",
    };
    Some(format!(
        "every vein is {shortest:.0} times longer than (A/q)^(1/3), over which it carries its weight: {advice}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Metres and centimetres are told apart by the acceleration of gravity, where units have names.
    #[test]
    fn gravity_in_another_unit_is_doubted() {
        let doubts = |length: &str, g: f64| {
            let text = format!(
                r#"
                units = {{ length = "{length}", force = "N", time = "s" }}
                leaf = {{ rods = 1, length = 3.0, fan = [0.0] }}
                section = {{ shape = "circle", diameter = 0.2, young = 1e5, mass_density = 1e-5 }}
                load = {{ g = [0.0, 0.0, -{g}] }}"#
            );
            plausibility_warnings(&Scenario::from_toml(&text).unwrap())
        };
        assert!(doubts("cm", 9.81)[0].contains("there it is 981"));
        assert!(doubts("cm", 9.8)[0].contains("in m/s²"));
        assert!(doubts("m", 981.0)[0].contains("there it is 9.81"));
        for (length, g) in [("cm", 981.0), ("m", 9.81), ("cm", 160.0), ("ell", 9.81)] {
            assert_eq!(doubts(length, g), Vec::<String>::new());
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
            assert!(
                said.len() == 1 && said[0].starts_with("leaf.elevation "),
                "{said:?}"
            );
        }
        assert_eq!(doubts(1.2), Vec::<String>::new());
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
