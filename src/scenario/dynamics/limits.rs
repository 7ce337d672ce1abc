//! Limits on what concerns motion, free of units. Only what was given can be
//! beyond them, never what was left out.

use super::super::check::Range;
use super::super::error::{Problem, ScenarioError};
use super::super::key::Key;
use super::super::limits::{
    CONFINED, CURLED, MOST_LOAD, MOST_REST_ANGLE, WOUND, longest_arm, norm,
};
use super::super::raw::{Item, Raw};
use super::super::{Profile, Scenario, in_time, quantity};
use super::{longest, time};

type Result = std::result::Result<(), ScenarioError>;

/// Densities, moments of inertia, damping and times over their natural units:
/// at most this and, where zero would make no sense, at least its inverse.
/// What is twelve orders apart hardly meets in double precision, which has 16.
const MOST_RATIO: f64 = 1e12;
/// Radius over length, which enters by its square.
const MOST_RADIUS: f64 = 1e6;
/// Factor of the rest curvatures.
const MOST_FACTOR: f64 = 1e6;
/// Outputs after the first.
const MOST_OUTPUTS: f64 = 1e6;

const UNEVEN: &str = "rho_mean is the mean of the densities mid-rod; \
     beyond the limit one part weighs nothing beside another: choose densities closer to each other";
const STOUT: &str = "rho_mean is the mean of the densities mid-rod and L the longest rod; \
     it is r^2/(4 L^2) for a round section of radius r: choose one closer to that of a rod";
const WIDE: &str =
    "r is the radius of the section and L the longest rod: choose one closer to that of a rod";
const UNIT: &str = "T = sqrt(rho_mean L^4/A) is the natural unit of time, with the longest rod L and \
     the means rho_mean and A of the densities and bending stiffnesses mid-rod: \
     choose a value, or a density, that brings this closer to 1";
const OUTPUTS: &str =
    "the number of outputs: choose a longer output_interval or a shorter duration";
const FACTOR: &str =
    "rest curvatures are multiplied by it: choose larger ones in [rest], and a smaller factor";

pub(in super::super) fn check(raw: &Raw, scenario: &Scenario) -> Result {
    inertia(raw, scenario)?;
    times(raw, scenario)?;
    loads(raw, scenario)?;
    rest(raw, scenario)
}

fn beyond(
    item: Item,
    (formula, value, limit, because): (&'static str, f64, f64, &'static str),
) -> Result {
    let problem = Problem::Limit {
        formula,
        value,
        limit,
        because,
    };
    Err(item.refuse(problem))
}

/// Refuses a `ratio` above `most` or below its inverse.
fn near_one(
    item: Item,
    (formula, ratio, most, because): (&'static str, f64, f64, &'static str),
) -> Result {
    if ratio > most {
        beyond(item, (formula, ratio, most, because))
    } else if ratio < 1.0 / most {
        beyond(item, (formula, ratio, 1.0 / most, because))
    } else {
        Ok(())
    }
}

fn inertia(raw: &Raw, scenario: &Scenario) -> Result {
    let dynamics = &scenario.dynamics;
    let (rho, length) = (dynamics.mean_density(), longest(&scenario.rods));
    let check = |item: Item, profiles: &[Profile], formula, unit, most, because| {
        for (index, profile) in profiles.iter().enumerate() {
            for value in [profile.min(), profile.max_abs()] {
                near_one(item.entry(index), (formula, value / unit, most, because))?;
            }
        }
        Ok(())
    };
    if let Some(item) = raw.optional(Key::Density) {
        let formula = "rho/rho_mean";
        check(item, &dynamics.density, formula, rho, MOST_RATIO, UNEVEN)?;
    }
    if let Some(item) = raw.optional(Key::RotaryInertia) {
        let (inertia, unit) = (&dynamics.rotary_inertia, rho * length * length);
        let formula = "rho I/(rho_mean L^2)";
        check(item, inertia, formula, unit, MOST_RATIO, STOUT)?;
    }
    if let Some(item) = raw.optional(Key::SectionRadius) {
        // Judged by itself: beside a small density its moment of inertia is small, too.
        let radius = quantity::read(item, scenario.rods.len(), Range::Positive)?;
        check(item, &radius, "r/L", length, MOST_RADIUS, WIDE)?;
    }
    Ok(())
}

fn times(raw: &Raw, scenario: &Scenario) -> Result {
    let dynamics = &scenario.dynamics;
    let (rho, time) = (
        dynamics.mean_density(),
        time(&scenario.rods, &dynamics.density),
    );
    let rate = dynamics.external_damping / rho * time;
    let retardation = dynamics.internal_damping / time;
    for (key, formula, ratio) in [
        (Key::ExternalDamping, "c T/rho_mean", rate),
        (Key::InternalDamping, "t/T", retardation),
    ] {
        match raw.optional(key) {
            Some(item) if ratio > MOST_RATIO => {
                return beyond(item, (formula, ratio, MOST_RATIO, UNIT));
            }
            _ => {}
        }
    }
    if let Some(item) = raw.optional(Key::Duration) {
        near_one(item, ("t/T", dynamics.duration / time, MOST_RATIO, UNIT))?;
    }
    if let Some(item) = raw.optional(Key::OutputInterval) {
        // What rounding adds to a quotient is no output.
        let outputs = (dynamics.duration / dynamics.output_interval).floor();
        if outputs > MOST_OUTPUTS {
            let formula = "duration/output_interval";
            return beyond(item, (formula, outputs, MOST_OUTPUTS, OUTPUTS));
        }
    }
    let listed = [
        (Key::GravityInTime, &dynamics.gravity.at),
        (Key::TipForceInTime, &dynamics.tip_force.at),
        (Key::TipMomentInTime, &dynamics.tip_moment.at),
        (Key::RestInTime, &dynamics.rest.at),
    ];
    for (key, at) in listed {
        let Some(item) = raw.optional(key) else {
            continue;
        };
        for (index, at) in at.iter().enumerate() {
            let ratio = at.abs() / time;
            if ratio > MOST_RATIO {
                let item = in_time::time(item, index);
                return beyond(item, ("|t|/T", ratio, MOST_RATIO, UNIT));
            }
        }
    }
    Ok(())
}

fn loads(raw: &Raw, scenario: &Scenario) -> Result {
    let dynamics = &scenario.dynamics;
    let gravity = (Key::GravityInTime, &dynamics.gravity);
    let tip_force = (Key::TipForceInTime, &dynamics.tip_force);
    let tip_moment = (Key::TipMomentInTime, &dynamics.tip_moment);
    for ((key, load), formula, power, because) in [
        (gravity, "|g| L^3/A", 3, CONFINED),
        (tip_force, "|F| L^2/A", 2, CONFINED),
        (tip_moment, "|M| L/A", 1, WOUND),
    ] {
        let Some(item) = raw.optional(key) else {
            continue;
        };
        let arm = longest_arm(scenario, power);
        for (index, &value) in load.value.iter().enumerate() {
            let ratio = norm(value) * arm;
            if ratio > MOST_LOAD {
                let item = in_time::vector(item, index);
                return beyond(item, (formula, ratio, MOST_LOAD, because));
            }
        }
    }
    Ok(())
}

fn rest(raw: &Raw, scenario: &Scenario) -> Result {
    let Some(item) = raw.optional(Key::RestInTime) else {
        return Ok(());
    };
    let angle = scenario
        .rods
        .iter()
        .flat_map(|rod| rod.rest_curvature.iter().map(|u| u.max_abs() * rod.length))
        .fold(0.0, f64::max);
    for (index, factor) in scenario.dynamics.rest.value.iter().enumerate() {
        let (item, factor) = (in_time::factor(item, index), factor.abs());
        if factor > MOST_FACTOR {
            return beyond(item, ("|factor|", factor, MOST_FACTOR, FACTOR));
        }
        if factor * angle > MOST_REST_ANGLE {
            let formula = "|factor u0| L";
            return beyond(item, (formula, factor * angle, MOST_REST_ANGLE, CURLED));
        }
    }
    Ok(())
}
