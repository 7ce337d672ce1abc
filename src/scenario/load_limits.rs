//! Limits on bases, tissue, weights, loads along veins and wind.

use super::bounds::{
    GRAVITY, Limit, TIME, TIP_FORCE, TIP_MOMENT, UNIT, most, near_one, norm, smallest_unit, softest,
};
use super::entries::Entries;
use super::error::ScenarioResult;
use super::key::Key;
use super::{Profile, Rod, Scale, Scenario, longest};

/// A thousandth of the digits of positions is lost.
const BASE: Limit = most("|base|/L", 1e3, FAR);
/// Wider than for couplings, as blades need: a strip of width h, thickness t and length L gives
/// k L^4/A = 12 L^4/(h^2 t^2) and c L^2/A = L^2/h^2.
const TISSUE: Limit = most("k L^4/A", 1e16, TIED);
const FOLD: Limit = most("c L^2/A", 1e12, TIED);
const PULLED: Limit = most("|g| rho L^3/A", 1e8, HEAVY);
const PULLED_POINT: Limit = most("|g| m L^2/A", 1e8, HEAVY);
const MASS: Limit = most("m/(rho_mean L)", 1e12, UNIT);
const DRAG: Limit = most("rho C_D w |U|^2 L^3/(2 A)", 1e8, STORM);
const VELOCITY: Limit = most("|U| T/L", 1e12, UNIT);
const WIDTH: Limit = near_one("w/L", 1e6, WIDE_LOAD);

const FAR: &str = "L is the longest rod; \
     beyond the limit positions lose digits: choose an origin closer to the leaf";
const TIED: &str = "A is the smallest bending stiffness of the two rods and L the longer length; \
     beyond the limit double precision does not resolve both: lower this one or stiffen the rods";
const HEAVY: &str = "A is the smallest bending stiffness of a rod, L its length and rho its mass per \
     length; beyond the limit bending is confined to less than 1e-4 of the length: check both units";
const STORM: &str = "A is the smallest bending stiffness of a rod and L its length; \
     beyond the limit bending is confined to less than 1e-4 of the length: lower the velocity";
const WIDE_LOAD: &str = "L is the longest rod: choose one closer to the width of a rod";

pub(super) fn check_loads(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    bases(entries, scenario)?;
    tissue(entries, scenario)?;
    weights(entries, scenario)?;
    distributed(entries, scenario)?;
    points(entries, scenario)?;
    wind(entries, scenario)
}

fn bases(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let Some(item) = entries.given(Key::Base) else {
        return Ok(());
    };
    let longest = longest(&scenario.rods);
    let mut rods = scenario.rods.iter();
    rods.try_for_each(|rod| BASE.check(item, norm(rod.base) / longest))
}

fn tissue(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let gaps = scenario
        .tissue
        .iter()
        .flatten()
        .zip(scenario.rods.windows(2));
    for (gap, (tissue, rods)) in gaps.enumerate() {
        // The ends of a blade may be far narrower than the rest.
        let middle = scenario.blade.is_some();
        let softest = |rod: &Rod| match middle {
            true => Scale {
                length: rod.length,
                stiffness: (rod.couple_stiffness[1].at(0.5)).min(rod.couple_stiffness[2].at(0.5)),
            },
            false => softest(rod),
        };
        let [one, other] = [softest(&rods[0]), softest(&rods[1])];
        let both = Scale {
            length: one.length.max(other.length),
            stiffness: one.stiffness.min(other.stiffness),
        };
        for (key, profile) in Key::TISSUE.into_iter().zip(tissue.profiles()) {
            let blade = || entries.given(Key::BladeThickness);
            let stiffness = match middle {
                true => profile.at(0.5),
                false => profile.max_abs(),
            };
            if let Some(item) = entries.given(key).or_else(blade) {
                let limit = if key == Key::TissueFold {
                    &FOLD
                } else {
                    &TISSUE
                };
                limit.check(item.entry(gap), stiffness / both.unit(key, 1.0))?;
            }
        }
    }
    Ok(())
}

fn weights(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let unit = smallest_unit(Key::Gravity, &scenario.rods);
    if let Some(item) = entries.given(Key::Gravity) {
        GRAVITY.check(item, norm(scenario.gravity) / unit)?;
        for (vein, own) in scenario.own_gravity.iter().enumerate() {
            GRAVITY.check(item.entry(vein), norm(*own) / unit)?;
        }
    }
    let Some(item) = entries.given(Key::G) else {
        return Ok(());
    };
    for (rod, density) in scenario.rods.iter().zip(&scenario.dynamics.density) {
        let unit = softest(rod).unit(Key::Gravity, 1.0);
        PULLED.check(item, norm(scenario.g) / unit * density.max_abs())?;
    }
    Ok(())
}

fn distributed(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let Some(item) = entries.given(Key::Distributed) else {
        return Ok(());
    };
    let unit = smallest_unit(Key::Distributed, &scenario.rods);
    let loads = scenario.distributed.iter().flatten();
    for load in loads {
        let most = load.each_ref().map(Profile::max_abs);
        GRAVITY.check(item, norm(most) / unit)?;
    }
    Ok(())
}

fn points(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let unit = |key| smallest_unit(key, &scenario.rods);
    let (force, moment) = (unit(Key::PointForce), unit(Key::PointMoment));
    let mass = scenario.unit(Key::PointMass);
    for (row, point) in scenario.points.iter().enumerate() {
        let item = |key| entries.item_of(key, row);
        TIP_FORCE.check(item(Key::PointForce)?, norm(point.force) / force)?;
        TIP_MOMENT.check(item(Key::PointMoment)?, norm(point.moment) / moment)?;
        let weighed = item(Key::PointMass)?;
        MASS.check(weighed, point.mass / mass)?;
        PULLED_POINT.check(weighed, norm(scenario.g) / force * point.mass)?;
    }
    Ok(())
}

fn wind(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let Some(wind) = &scenario.wind else {
        return Ok(());
    };
    let (item, time) = (entries.item(Key::WindVelocity)?, scenario.time());
    for at in &wind.velocity.at {
        TIME.check(item, at.abs() / time)?;
    }
    let velocity = scenario.unit(Key::WindVelocity);
    for speed in wind.velocity.value.iter().map(|&value| norm(value)) {
        VELOCITY.check(item, speed / velocity)?;
        for (rod, width) in scenario.rods.iter().zip(&wind.width) {
            let pressure = 0.5 * wind.density * wind.drag * speed * speed;
            let unit = softest(rod).unit(Key::Gravity, 1.0);
            DRAG.check(item, pressure * width.max_abs() / unit)?;
        }
    }
    let longest = longest(&scenario.rods);
    WIDTH.check_profiles(entries.item(Key::WindWidth)?, &wind.width, longest)
}
