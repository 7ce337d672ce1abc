//! Limits that several values set together, all free of units: beyond them
//! the numbers of a scenario are a slip, or no grid could resolve its shape.

use super::error::{Problem, ScenarioError};
use super::key::Key;
use super::raw::Raw;
use super::{Rod, Scenario};

/// |F| L^2/A, |g| L^3/A and |M| L/A. A rod in tension F turns within
/// sqrt(A/F) of its ends: at this limit, within 1e-4 of its length.
pub(super) const MOST_LOAD: f64 = 1e8;
/// kappa L^4/A: two coupled rods join within (A/kappa)^(1/4), here 1e-3 of the length.
const MOST_COUPLING: f64 = 1e12;
/// Largest to smallest torsion or bending stiffness: leaves four of the
/// sixteen digits of double precision.
const MOST_STIFFNESS_RATIO: f64 = 1e12;
/// |u0| L, an angle in radians: 160 coils.
pub(super) const MOST_REST_ANGLE: f64 = 1e3;
/// H L^2/A: below, a rod is softer against stretch or shear than against
/// bending into a curl a thousandth of its length.
const LEAST_FORCE_STIFFNESS: f64 = 1e-6;
/// Growth of the rest length, and its inverse: as with lengths.
const MOST_STRETCH: f64 = 1e3;
/// Longest to shortest rod.
const MOST_LENGTH_RATIO: f64 = 1e3;

const COUPLE: [Key; 3] = [Key::Torsion, Key::Bending2, Key::Bending3];
const FORCE: [Key; 3] = [Key::Axial, Key::Shear2, Key::Shear3];
const REST: [Key; 3] = [Key::RestTwist, Key::RestBend2, Key::RestBend3];
const COUPLING: [Key; 3] = [Key::CouplingX, Key::CouplingY, Key::CouplingZ];

pub(super) const CONFINED: &str = "A is the smallest bending stiffness of a rod and L its length; \
     beyond the limit bending is confined to less than 1e-4 of the length: lower the load or stiffen the rods";
pub(super) const WOUND: &str = "A is the smallest bending stiffness of the rod and L its length; \
     the rod would roll up by this many radians: lower the moment or stiffen the rod";
const COUPLED: &str = "A is the smallest bending stiffness of the two rods and L the longer length; \
     beyond the limit neighbours act as glued together: lower the coupling";
const UNEVEN: &str = "the ratio of the largest to this smallest torsion or bending stiffness; \
     double precision does not resolve more: raise this one or lower the largest";
pub(super) const CURLED: &str =
    "an angle in radians: the rod at rest would be wound up more than 150 times";
const SOFT: &str = "A is the smallest bending stiffness of the rod and L its length; \
     below the limit the rod is softer in stretch or shear than any beam: raise this stiffness";
const GROWN: &str = "the factor of the rest length; beyond it or its inverse one grid \
     of equal fractions of the length does not serve the leaf";
const SHORT: &str = "the ratio of the longest rod to this shortest one: \
     one grid of equal fractions of the length does not serve both";

/// The smallest bending stiffness of a rod, anywhere along it.
fn bending(rod: &Rod) -> f64 {
    rod.couple_stiffness[1]
        .min()
        .min(rod.couple_stiffness[2].min())
}

pub(super) fn check(raw: &Raw, scenario: &Scenario) -> Result<(), ScenarioError> {
    lengths(raw, scenario)?;
    stiffness(raw, scenario)?;
    loads(raw, scenario)?;
    coupling(raw, scenario)?;
    super::dynamics::limits::check(raw, scenario)
}

/// An error about `key`, at the entry of one rod or gap where there is one.
fn beyond(
    raw: &Raw,
    key: Key,
    index: Option<usize>,
    (formula, value, limit, because): (&'static str, f64, f64, &'static str),
) -> ScenarioError {
    let problem = Problem::Limit {
        formula,
        value,
        limit,
        because,
    };
    match raw.required(key) {
        Ok(item) => index
            .map_or(item, |index| item.entry(index))
            .refuse(problem),
        Err(missing) => missing,
    }
}

fn lengths(raw: &Raw, scenario: &Scenario) -> Result<(), ScenarioError> {
    let longest = scenario
        .rods
        .iter()
        .map(|rod| rod.length)
        .fold(0.0, f64::max);
    for (index, rod) in scenario.rods.iter().enumerate() {
        let ratio = longest / rod.length;
        if ratio > MOST_LENGTH_RATIO {
            return Err(beyond(
                raw,
                Key::Length,
                Some(index),
                ("L_max/L", ratio, MOST_LENGTH_RATIO, SHORT),
            ));
        }
    }
    Ok(())
}

fn stiffness(raw: &Raw, scenario: &Scenario) -> Result<(), ScenarioError> {
    let largest = scenario
        .rods
        .iter()
        .flat_map(|rod| &rod.couple_stiffness)
        .map(|stiffness| stiffness.max_abs())
        .fold(0.0, f64::max);
    for (index, rod) in scenario.rods.iter().enumerate() {
        let refuse = |key, what| Err(beyond(raw, key, Some(index), what));
        for (key, stiffness) in COUPLE.into_iter().zip(&rod.couple_stiffness) {
            let ratio = largest / stiffness.min();
            if ratio > MOST_STIFFNESS_RATIO {
                return refuse(key, ("A_max/A", ratio, MOST_STIFFNESS_RATIO, UNEVEN));
            }
        }
        for (key, stiffness) in FORCE.into_iter().zip(&rod.force_stiffness) {
            let ratio = stiffness.min() * rod.length.powi(2) / bending(rod);
            if ratio < LEAST_FORCE_STIFFNESS {
                return refuse(key, ("H L^2/A", ratio, LEAST_FORCE_STIFFNESS, SOFT));
            }
        }
        for (key, curvature) in REST.into_iter().zip(&rod.rest_curvature) {
            let angle = curvature.max_abs() * rod.length;
            if angle > MOST_REST_ANGLE {
                return refuse(key, ("|u0| L", angle, MOST_REST_ANGLE, CURLED));
            }
        }
        let (least, most) = (rod.rest_stretch.min(), rod.rest_stretch.max_abs());
        for (found, limit, beyond) in [
            (most, MOST_STRETCH, most > MOST_STRETCH),
            (least, 1.0 / MOST_STRETCH, least < 1.0 / MOST_STRETCH),
        ] {
            if beyond {
                return refuse(Key::RestStretch, ("v0", found, limit, GROWN));
            }
        }
    }
    Ok(())
}

fn loads(raw: &Raw, scenario: &Scenario) -> Result<(), ScenarioError> {
    let loads = [
        (Key::Gravity, scenario.gravity, "|g| L^3/A", 3, CONFINED),
        (Key::TipForce, scenario.tip_force, "|F| L^2/A", 2, CONFINED),
        (Key::TipMoment, scenario.tip_moment, "|M| L/A", 1, WOUND),
    ];
    for (key, load, formula, power, because) in loads {
        let worst = norm(load) * longest_arm(scenario, power);
        if worst > MOST_LOAD {
            return Err(beyond(raw, key, None, (formula, worst, MOST_LOAD, because)));
        }
    }
    Ok(())
}

pub(super) fn norm([x, y, z]: [f64; 3]) -> f64 {
    // hypot: squares of large components overflow.
    x.hypot(y).hypot(z)
}

/// The largest L^power/A of a rod: times a load, that load free of units.
pub(super) fn longest_arm(scenario: &Scenario, power: i32) -> f64 {
    scenario
        .rods
        .iter()
        .map(|rod| rod.length.powi(power) / bending(rod))
        .fold(0.0, f64::max)
}

fn coupling(raw: &Raw, scenario: &Scenario) -> Result<(), ScenarioError> {
    for (gap, (stiffness, rods)) in scenario
        .coupling
        .iter()
        .zip(scenario.rods.windows(2))
        .enumerate()
    {
        let length = rods[0].length.max(rods[1].length);
        let softest = bending(&rods[0]).min(bending(&rods[1]));
        for (key, stiffness) in COUPLING.into_iter().zip(stiffness) {
            let ratio = stiffness * (length.powi(4) / softest);
            if ratio > MOST_COUPLING {
                return Err(beyond(
                    raw,
                    key,
                    Some(gap),
                    ("kappa L^4/A", ratio, MOST_COUPLING, COUPLED),
                ));
            }
        }
    }
    Ok(())
}
