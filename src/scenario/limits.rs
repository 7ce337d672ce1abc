//! Limits on dimensionless combinations of values: beyond them the numbers of a scenario
//! are a mistake, or no grid could resolve its shape. Only given values are checked;
//! defaults are always within the limits.
//!
//! Limits on bases, tissue, weights, loads along veins and wind.
//!
//! Bounds on dimensionless numbers, and what the checks of combinations of values share.

use crate::scenario::format::entries::Entries;
use crate::scenario::format::item::{EntryValue, MAGNITUDES};
use crate::scenario::format::source::ScenarioResult;
use crate::scenario::format::{Key, ValueSchema};
use crate::scenario::{Dynamics, Profile, Rod, Scale, Scenario, Tissue, longest, section};

/// Longest to shortest rod.
const LENGTHS: DimensionlessLimit = upper_limit("L_max/L", 1e3, LENGTH_RATIO_REASON);

/// Largest to smallest torsion or bending stiffness: leaves four of the 16 digits of
/// double precision.
const STIFFNESSES: DimensionlessLimit = upper_limit("A_max/A", 1e12, STIFFNESS_RATIO_REASON);

/// An angle in radians: 160 coils.
const REST_ANGLE: DimensionlessLimit = upper_limit("|u0| L", 1e3, REST_ANGLE_REASON);

/// Growth of the rest length, and its inverse: as with lengths.
const STRETCH: DimensionlessLimit = ratio_limit("v0", 1e3, STRETCH_REASON);

/// Below, a rod is softer against stretch or shear than against bending into
/// a curl a thousandth of its length.
const FORCE_STIFFNESS: DimensionlessLimit = DimensionlessLimit {
    formula: "H L^2/A",
    least: 1e-6,
    most: f64::INFINITY,
    because: FORCE_STIFFNESS_REASON,
};

/// Two coupled rods join within (A/kappa)^(1/4), at the limit 1e-3 of the length.
const COUPLING_LIMIT: DimensionlessLimit = upper_limit("kappa L^4/A", 1e12, COUPLING_REASON);

/// Masses, damping and times in their natural units: values that differ by twelve orders
/// of magnitude hardly affect each other in double precision, which has 16 digits. A
/// radius is limited by itself, as it enters by its square and, with a small density,
/// gives a small moment of inertia.
const DYNAMICS: [(Key, DimensionlessLimit); 6] = [
    (
        Key::Density,
        ratio_limit("rho/rho_mean", 1e12, DENSITY_RATIO_REASON),
    ),
    (
        Key::RotaryInertia,
        ratio_limit("rho I/(rho_mean L^2)", 1e12, ROTARY_INERTIA_REASON),
    ),
    (Key::SectionRadius, ratio_limit("r/L", 1e6, RADIUS_REASON)),
    (
        Key::ExternalDamping,
        upper_limit("c T/rho_mean", 1e12, NATURAL_UNITS_REASON),
    ),
    (
        Key::InternalDamping,
        upper_limit("t/T", 1e12, NATURAL_UNITS_REASON),
    ),
    (
        Key::Duration,
        ratio_limit("t/T", 1e12, NATURAL_UNITS_REASON),
    ),
];

/// Outputs after the first.
const OUTPUT_COUNT_LIMIT: DimensionlessLimit =
    upper_limit("duration/output_interval", 1e6, OUTPUT_COUNT_REASON);

/// Factor of the rest curvatures, and the same with the largest of them.
const REST_FACTOR_LIMIT: DimensionlessLimit = upper_limit("|factor|", 1e6, REST_FACTOR_REASON);

const REST_FACTOR_ANGLE_LIMIT: DimensionlessLimit =
    upper_limit("|factor u0| L", 1e3, REST_ANGLE_REASON);

const LENGTH_RATIO_REASON: &str = "the ratio of the longest rod to this shortest one: \
     one grid of equal fractions of the length does not serve both";

const STIFFNESS_RATIO_REASON: &str = "the ratio of the largest to this smallest torsion or bending stiffness; \
     double precision does not resolve more: raise this one or lower the largest";

const REST_ANGLE_REASON: &str =
    "an angle in radians: the rod at rest would be wound up more than 150 times";

const STRETCH_REASON: &str = "the factor of the rest length; beyond it or its inverse one grid \
     of equal fractions of the length does not serve the leaf";

const FORCE_STIFFNESS_REASON: &str = "A is the smallest bending stiffness of the rod and L its length; \
     below the limit the rod is softer in stretch or shear than any beam: raise this stiffness";

const COUPLING_REASON: &str = "A is the smallest bending stiffness of the two rods and L the longer length; \
     beyond the limit neighbours act as glued together: lower the coupling";

const DENSITY_RATIO_REASON: &str = "rho_mean is the mean of the densities mid-rod; \
     beyond the limit one part weighs nothing beside another: choose densities closer to each other";

const ROTARY_INERTIA_REASON: &str = "rho_mean is the mean of the densities mid-rod and L the longest rod; \
     it is r^2/(4 L^2) for a round section of radius r: choose one closer to that of a rod";

const RADIUS_REASON: &str =
    "r is the radius of the section and L the longest rod: choose one closer to that of a rod";

const OUTPUT_COUNT_REASON: &str =
    "the number of outputs: choose a longer output_interval or a shorter duration";

const REST_FACTOR_REASON: &str =
    "rest curvatures are multiplied by it: choose larger ones in [rest], and a smaller factor";

pub(super) fn check(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    magnitudes(entries, scenario)?;
    rods(entries, &scenario.rods)?;
    for (key, load, limit) in [
        (Key::TipForce, scenario.tip_force, TIP_FORCE),
        (Key::TipMoment, scenario.tip_moment, TIP_MOMENT),
    ] {
        if let Some(item) = entries.given_value(key) {
            limit.check(item, norm(load) / smallest_unit(key, &scenario.rods))?;
        }
    }
    coupling(entries, scenario)?;
    dynamics(entries, scenario)?;
    masses(entries, scenario)?;
    in_time(entries, scenario)?;
    check_loads(entries, scenario)
}

/// Refuses stiffnesses and masses that are too large or too small, where they follow from a size.
fn magnitudes(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let Some(size) = section::size_entry(entries) else {
        return Ok(());
    };
    let Dynamics {
        density,
        rotary_inertia,
        ..
    } = &scenario.dynamics;
    for (rod, it) in scenario.rods.iter().enumerate() {
        let stiffness = it.couple_stiffness.iter().chain(&it.force_stiffness);
        for profile in stiffness.chain([&density[rod], &rotary_inertia[rod]]) {
            is_moderate(size.entry(rod), profile)?;
        }
    }
    let tissue = scenario.tissue.iter().flatten().flat_map(Tissue::profiles);
    let mut tissue = tissue.filter(|_| scenario.blade.is_some());
    tissue.try_for_each(|profile| is_moderate(size, profile))
}

fn is_moderate(item: EntryValue, profile: &Profile) -> ScenarioResult<()> {
    for value in extremes(profile) {
        item.refuse_unless(
            MAGNITUDES.contains(&value),
            format_args!(
                "gives a stiffness or mass of {value:.3e}, which must lie between \
                 1e-50 and 1e50: choose other units"
            ),
        )?;
    }
    Ok(())
}

fn rods(entries: &Entries, rods: &[Rod]) -> ScenarioResult<()> {
    // The outline of a blade determines lengths and shapes.
    let outline = |key: Key| match key.follows_from_blade() {
        true => entries.given_value(Key::BladeWidth),
        false => None,
    };
    let check = |key, index, limit: &DimensionlessLimit, value| {
        let item = entries.given_value(key).or_else(|| outline(key));
        item.map_or(Ok(()), |item| limit.check(item.entry(index), value))
    };
    let longest = longest(rods);
    for (index, rod) in rods.iter().enumerate() {
        check(Key::Length, index, &LENGTHS, longest / rod.length)?;
    }
    let stiffnesses = rods.iter().flat_map(|rod| &rod.couple_stiffness);
    let stiffest = stiffnesses.fold(0.0, |most: f64, stiffness| most.max(stiffness.max_abs()));
    for (index, rod) in rods.iter().enumerate() {
        let scale = softest_rod_scale(rod);
        let natural = |key, value| value / scale.unit(key, 1.0);
        for (key, stiffness) in Key::COUPLE.into_iter().zip(&rod.couple_stiffness) {
            check(key, index, &STIFFNESSES, stiffest / stiffness.min())?;
        }
        for (key, stiffness) in Key::FORCE.into_iter().zip(&rod.force_stiffness) {
            check(key, index, &FORCE_STIFFNESS, natural(key, stiffness.min()))?;
        }
        // Stiffnesses that are not given follow from the size of a section.
        if let Some(item) = section::size_entry(entries) {
            let couple = rod.couple_stiffness.iter().map(Profile::min);
            let least = couple.fold(f64::INFINITY, f64::min);
            STIFFNESSES.check(item.entry(index), stiffest / least)?;
            for (key, stiffness) in Key::FORCE.into_iter().zip(&rod.force_stiffness) {
                FORCE_STIFFNESS.check(item.entry(index), natural(key, stiffness.min()))?;
            }
        }
        for (key, curvature) in Key::REST_CURVATURE.into_iter().zip(&rod.rest_curvature) {
            check(key, index, &REST_ANGLE, natural(key, curvature.max_abs()))?;
        }
        let (least, most) = (rod.rest_stretch.min(), rod.rest_stretch.max_abs());
        let extreme = if most > STRETCH.most { most } else { least };
        check(Key::RestStretch, index, &STRETCH, extreme)?;
    }
    Ok(())
}

fn coupling(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let gaps = scenario.coupling.iter().zip(scenario.rods.windows(2));
    for (gap, (stiffness, rods)) in gaps.enumerate() {
        let [one, other] = [softest_rod_scale(&rods[0]), softest_rod_scale(&rods[1])];
        let both = Scale {
            length: one.length.max(other.length),
            stiffness: one.stiffness.min(other.stiffness),
        };
        for (key, stiffness) in Key::COUPLING.into_iter().zip(stiffness) {
            if let Some(item) = entries.given_value(key) {
                COUPLING_LIMIT.check(item.entry(gap), stiffness / both.unit(key, 1.0))?;
            }
        }
    }
    Ok(())
}

fn dynamics(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let (scale, time) = (scenario.scale(), scenario.time());
    for (key, limit) in &DYNAMICS {
        let Some(item) = entries.given_value(*key) else {
            continue;
        };
        let unit = scale.unit(*key, time);
        let ValueSchema::Quantity(_) = key.form() else {
            limit.check(item, item.number()? / unit)?;
            continue;
        };
        limit.check_profiles(item, &item.quantity(scenario.rods.len())?, unit)?;
    }
    Ok(())
}

/// Masses that follow from sections.
fn masses(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let mass = [Key::MassDensity, Key::BladeMassDensity];
    let mass = mass.into_iter().find_map(|key| entries.given_value(key));
    let (Some(size), Some(density)) = (section::size_entry(entries), mass) else {
        return Ok(());
    };
    let (scale, time) = (scenario.scale(), scenario.time());
    let dynamics = &scenario.dynamics;
    for (item, key, limit, profiles) in [
        (density, Key::Density, &DYNAMICS[0].1, &dynamics.density),
        (
            size,
            Key::RotaryInertia,
            &DYNAMICS[1].1,
            &dynamics.rotary_inertia,
        ),
    ] {
        limit.check_profiles(item, profiles, scale.unit(key, time))?;
    }
    Ok(())
}

fn in_time(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let (dynamics, rods, time) = (&scenario.dynamics, &scenario.rods, scenario.time());
    if let Some(item) = entries.given_value(Key::OutputInterval) {
        // Rounding of the quotient must not count as an output.
        let outputs = (dynamics.duration / dynamics.output_interval).floor();
        OUTPUT_COUNT_LIMIT.check(item, outputs)?;
    }
    let list = |key, name| {
        entries
            .given_value(key)
            .and_then(|item: EntryValue| item.list(name))
    };
    for (key, at) in [
        (Key::GravityInTime, &dynamics.gravity.at),
        (Key::TipForceInTime, &dynamics.tip_force.at),
        (Key::TipMomentInTime, &dynamics.tip_moment.at),
        (Key::RestInTime, &dynamics.rest.at),
    ] {
        if let Some(list) = list(key, "at") {
            for (index, at) in at.iter().enumerate() {
                TIME.check(list.entry(index), at.abs() / time)?;
            }
        }
    }
    for (key, load, limit) in [
        (Key::GravityInTime, &dynamics.gravity, GRAVITY),
        (Key::TipForceInTime, &dynamics.tip_force, TIP_FORCE),
        (Key::TipMomentInTime, &dynamics.tip_moment, TIP_MOMENT),
    ] {
        if let Some(list) = list(key, "value") {
            let unit = smallest_unit(key, rods);
            for (index, &value) in load.value.iter().enumerate() {
                limit.check(list.entry(index), norm(value) / unit)?;
            }
        }
    }
    if let Some(list) = list(Key::RestInTime, "factor") {
        let angles = (rods.iter())
            .flat_map(|rod| rod.rest_curvature.iter().map(|u| u.max_abs() * rod.length));
        let angle = angles.fold(0.0, f64::max);
        for (index, factor) in dynamics.rest.value.iter().enumerate() {
            REST_FACTOR_LIMIT.check(list.entry(index), factor.abs())?;
            REST_FACTOR_ANGLE_LIMIT.check(list.entry(index), factor.abs() * angle)?;
        }
    }
    Ok(())
}

/// A thousandth of the digits of positions is lost.
const BASE_DISTANCE_LIMIT: DimensionlessLimit = upper_limit("|base|/L", 1e3, BASE_DISTANCE_REASON);

/// Wider than for couplings, as blades need: a strip of width h, thickness t and length L gives
/// k L^4/A = 12 L^4/(h^2 t^2) and c L^2/A = L^2/h^2.
const TISSUE_STIFFNESS_LIMIT: DimensionlessLimit =
    upper_limit("k L^4/A", 1e16, TISSUE_STIFFNESS_REASON);

const FOLD_STIFFNESS_LIMIT: DimensionlessLimit =
    upper_limit("c L^2/A", 1e12, TISSUE_STIFFNESS_REASON);

const ROD_WEIGHT_LIMIT: DimensionlessLimit = upper_limit("|g| rho L^3/A", 1e8, WEIGHT_REASON);

const POINT_WEIGHT_LIMIT: DimensionlessLimit = upper_limit("|g| m L^2/A", 1e8, WEIGHT_REASON);

const POINT_MASS_LIMIT: DimensionlessLimit =
    upper_limit("m/(rho_mean L)", 1e12, NATURAL_UNITS_REASON);

const DRAG_LIMIT: DimensionlessLimit = upper_limit("rho C_D w |U|^2 L^3/(2 A)", 1e8, DRAG_REASON);

const WIND_VELOCITY_LIMIT: DimensionlessLimit = upper_limit("|U| T/L", 1e12, NATURAL_UNITS_REASON);

const WIND_WIDTH_LIMIT: DimensionlessLimit = ratio_limit("w/L", 1e6, WIND_WIDTH_REASON);

const BASE_DISTANCE_REASON: &str = "L is the longest rod; \
     beyond the limit positions lose digits: choose an origin closer to the leaf";

const TISSUE_STIFFNESS_REASON: &str = "A is the smallest bending stiffness of the two rods and L the longer length; \
     beyond the limit double precision does not resolve both: lower this one or stiffen the rods";

const WEIGHT_REASON: &str = "A is the smallest bending stiffness of a rod, L its length and rho its mass per \
     length; beyond the limit bending is confined to less than 1e-4 of the length: check both units";

const DRAG_REASON: &str = "A is the smallest bending stiffness of a rod and L its length; \
     beyond the limit bending is confined to less than 1e-4 of the length: lower the velocity";

const WIND_WIDTH_REASON: &str = "L is the longest rod: choose one closer to the width of a rod";

pub(super) fn check_loads(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    bases(entries, scenario)?;
    tissue(entries, scenario)?;
    weights(entries, scenario)?;
    distributed(entries, scenario)?;
    points(entries, scenario)?;
    wind(entries, scenario)
}

fn bases(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let Some(item) = entries.given_value(Key::Base) else {
        return Ok(());
    };
    let longest = longest(&scenario.rods);
    let mut rods = scenario.rods.iter();
    rods.try_for_each(|rod| BASE_DISTANCE_LIMIT.check(item, norm(rod.base) / longest))
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
            false => softest_rod_scale(rod),
        };
        let [one, other] = [softest(&rods[0]), softest(&rods[1])];
        let both = Scale {
            length: one.length.max(other.length),
            stiffness: one.stiffness.min(other.stiffness),
        };
        for (key, profile) in Key::TISSUE.into_iter().zip(tissue.profiles()) {
            let blade = || entries.given_value(Key::BladeThickness);
            let stiffness = match middle {
                true => profile.at(0.5),
                false => profile.max_abs(),
            };
            if let Some(item) = entries.given_value(key).or_else(blade) {
                let limit = if key == Key::TissueFold {
                    &FOLD_STIFFNESS_LIMIT
                } else {
                    &TISSUE_STIFFNESS_LIMIT
                };
                limit.check(item.entry(gap), stiffness / both.unit(key, 1.0))?;
            }
        }
    }
    Ok(())
}

fn weights(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let unit = smallest_unit(Key::Gravity, &scenario.rods);
    if let Some(item) = entries.given_value(Key::Gravity) {
        GRAVITY.check(item, norm(scenario.gravity) / unit)?;
        for (vein, own) in scenario.own_gravity.iter().enumerate() {
            GRAVITY.check(item.entry(vein), norm(*own) / unit)?;
        }
    }
    let Some(item) = entries.given_value(Key::G) else {
        return Ok(());
    };
    for (rod, density) in scenario.rods.iter().zip(&scenario.dynamics.density) {
        let unit = softest_rod_scale(rod).unit(Key::Gravity, 1.0);
        ROD_WEIGHT_LIMIT.check(item, norm(scenario.g) / unit * density.max_abs())?;
    }
    Ok(())
}

fn distributed(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let Some(item) = entries.given_value(Key::Distributed) else {
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
        let item = |key| entries.value_in_row(key, row);
        TIP_FORCE.check(item(Key::PointForce)?, norm(point.force) / force)?;
        TIP_MOMENT.check(item(Key::PointMoment)?, norm(point.moment) / moment)?;
        let weighed = item(Key::PointMass)?;
        POINT_MASS_LIMIT.check(weighed, point.mass / mass)?;
        POINT_WEIGHT_LIMIT.check(weighed, norm(scenario.g) / force * point.mass)?;
    }
    Ok(())
}

fn wind(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let Some(wind) = &scenario.wind else {
        return Ok(());
    };
    let (item, time) = (
        entries.value_or_default(Key::WindVelocity)?,
        scenario.time(),
    );
    for at in &wind.velocity.at {
        TIME.check(item, at.abs() / time)?;
    }
    let velocity = scenario.unit(Key::WindVelocity);
    for speed in wind.velocity.value.iter().map(|&value| norm(value)) {
        WIND_VELOCITY_LIMIT.check(item, speed / velocity)?;
        for (rod, width) in scenario.rods.iter().zip(&wind.width) {
            let pressure = 0.5 * wind.density * wind.drag * speed * speed;
            let unit = softest_rod_scale(rod).unit(Key::Gravity, 1.0);
            DRAG_LIMIT.check(item, pressure * width.max_abs() / unit)?;
        }
    }
    let longest = longest(&scenario.rods);
    WIND_WIDTH_LIMIT.check_profiles(
        entries.value_or_default(Key::WindWidth)?,
        &wind.width,
        longest,
    )
}

/// The range of a dimensionless number.
pub(super) struct DimensionlessLimit {
    /// The number.
    pub formula: &'static str,
    pub least: f64,
    pub most: f64,
    /// What the symbols mean, why there is a limit, and what to change.
    pub because: &'static str,
}

impl DimensionlessLimit {
    pub fn check(&self, item: EntryValue, value: f64) -> ScenarioResult<()> {
        let limit = match value {
            _ if value > self.most => self.most,
            _ if value < self.least => self.least,
            _ => return Ok(()),
        };
        let (formula, because) = (self.formula, self.because);
        Err(item.value_error(format_args!(
            "gives {formula} = {value:.3e}, the limit is {limit:e}: {because}"
        )))
    }

    /// Checks the extremes of a profile of each rod, in this unit.
    pub fn check_profiles(
        &self,
        item: EntryValue,
        profiles: &[Profile],
        unit: f64,
    ) -> ScenarioResult<()> {
        for (index, profile) in profiles.iter().enumerate() {
            for value in extremes(profile) {
                self.check(item.entry(index), value / unit)?;
            }
        }
        Ok(())
    }
}

/// The least and the largest value of a quantity that is positive. The mass of a blade may vanish at
/// its ends: then the largest twice.
pub(super) fn extremes(profile: &Profile) -> [f64; 2] {
    let (least, most) = (profile.min(), profile.max_abs());
    match profile {
        Profile::Blade { .. } if least == 0.0 => [most; 2],
        _ => [least, most],
    }
}

pub(super) const fn upper_limit(
    formula: &'static str,
    most: f64,
    because: &'static str,
) -> DimensionlessLimit {
    DimensionlessLimit {
        formula,
        least: 0.0,
        most,
        because,
    }
}

/// Within a factor of `most` of 1.
pub(super) const fn ratio_limit(
    formula: &'static str,
    most: f64,
    because: &'static str,
) -> DimensionlessLimit {
    DimensionlessLimit {
        formula,
        least: 1.0 / most,
        most,
        because,
    }
}

/// Loads at rest and in time. A rod in tension F turns within sqrt(A/F) of
/// its ends: at the limit, within 1e-4 of its length.
pub(super) const GRAVITY: DimensionlessLimit = upper_limit("|g| L^3/A", 1e8, TENSION_REASON);

pub(super) const TIP_FORCE: DimensionlessLimit = upper_limit("|F| L^2/A", 1e8, TENSION_REASON);

pub(super) const TIP_MOMENT: DimensionlessLimit = upper_limit("|M| L/A", 1e8, TIP_MOMENT_REASON);

/// Times of loads and factors.
pub(super) const TIME: DimensionlessLimit = upper_limit("|t|/T", 1e12, NATURAL_UNITS_REASON);

const TENSION_REASON: &str = "A is the smallest bending stiffness of a rod and L its length; \
     beyond the limit bending is confined to less than 1e-4 of the length: lower the load or stiffen the rods";

const TIP_MOMENT_REASON: &str = "A is the smallest bending stiffness of the rod and L its length; \
     the rod would roll up by this many radians: lower the moment or stiffen the rod";

pub(super) const NATURAL_UNITS_REASON: &str = "T = sqrt(rho_mean L^4/A) is the natural unit of time, with the longest rod L and \
     the means rho_mean and A of the densities and bending stiffnesses mid-rod: \
     choose a value, or a density, that brings this closer to 1";

/// The length of a rod and its smallest bending stiffness anywhere along it.
pub(super) fn softest_rod_scale(rod: &Rod) -> Scale {
    let [_, second, third] = &rod.couple_stiffness;
    Scale {
        length: rod.length,
        stiffness: second.min().min(third.min()),
    }
}

/// The smallest unit of a quantity of this key, which has no times, of all rods.
pub(super) fn smallest_unit(key: Key, rods: &[Rod]) -> f64 {
    let units = rods.iter().map(|rod| softest_rod_scale(rod).unit(key, 1.0));
    units.fold(f64::INFINITY, f64::min)
}

pub(super) fn norm([x, y, z]: [f64; 3]) -> f64 {
    // hypot avoids overflow of the squares of large components.
    x.hypot(y).hypot(z)
}
