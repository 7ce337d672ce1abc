//! Limits on dimensionless combinations of values: beyond them the numbers of a scenario
//! are a mistake, or no grid could resolve its shape. Only given values are checked;
//! defaults are always within the limits.

use crate::scenario::checked::Scenario;
use crate::scenario::format::entries::Entries;
use crate::scenario::format::error::ScenarioResult;
use crate::scenario::format::item::{EntryValue, MAGNITUDES};
use crate::scenario::format::{Key, ValueSchema};
use crate::scenario::loads::{Dynamics, Landing};
use crate::scenario::profile::Profile;
use crate::scenario::schedule::{InTime, Schedule};
use crate::scenario::section;
use crate::scenario::veins::{Rod, Scale, Tissue, longest};

/// The limits of a leaf. L is a length, A a bending stiffness, T the natural unit of time.
struct LeafLimits {
    /// Longest to shortest rod.
    lengths: DimensionlessLimit,
    /// Largest to smallest torsion or bending stiffness: leaves four of the 16 digits of double
    /// precision.
    stiffnesses: DimensionlessLimit,
    /// Angle at rest, in radians: 160 coils.
    rest_angle: DimensionlessLimit,
    /// Growth of the rest length, and its inverse: as with lengths.
    stretch: DimensionlessLimit,
    /// Below, a rod is softer against stretch or shear than against bending into a curl a thousandth of
    /// its length.
    force_stiffness: DimensionlessLimit,
    /// Two coupled rods join within (A/kappa)^(1/4), at the limit 1e-3 of the length.
    coupling: DimensionlessLimit,
    density: DimensionlessLimit,
    rotary_inertia: DimensionlessLimit,
    /// A radius is limited by itself, as it enters by its square and, with a small density, gives a
    /// small moment of inertia.
    section_radius: DimensionlessLimit,
    external_damping: DimensionlessLimit,
    internal_damping: DimensionlessLimit,
    duration: DimensionlessLimit,
    outputs: DimensionlessLimit,
    /// Times of loads and factors.
    times: DimensionlessLimit,
    /// Oscillations in time.
    periods: DimensionlessLimit,
    phase: DimensionlessLimit,
    load_factor: DimensionlessLimit,
    rest_factor: DimensionlessLimit,
    rest_factor_angle: DimensionlessLimit,
    /// Loads at rest and in time. A rod in tension F turns within sqrt(A/F) of
    /// its ends: at the limit, within 1e-4 of its length.
    gravity: DimensionlessLimit,
    /// A force on a tip or a point: as for gravity.
    tip_force: DimensionlessLimit,
    tip_moment: DimensionlessLimit,
    /// Weight of a rod that follows from its mass: as for gravity.
    rod_weight: DimensionlessLimit,
    /// Weight of the mass of a point: as for forces.
    point_weight: DimensionlessLimit,
    point_mass: DimensionlessLimit,
    point_offset: DimensionlessLimit,
    /// At the limit a thousandth of the digits of positions is lost.
    base_distance: DimensionlessLimit,
    base_turn: DimensionlessLimit,
    /// Wider for tissue than for couplings, as blades need: a strip of width h, thickness t and length L
    /// gives k L^4/A = 12 L^4/(h^2 t^2) and c L^2/A = L^2/h^2.
    tissue: DimensionlessLimit,
    fold: DimensionlessLimit,
    /// Drag on a rod normal to the wind: as for gravity.
    drag: DimensionlessLimit,
    wind_velocity: DimensionlessLimit,
    landing_velocity: DimensionlessLimit,
    wind_width: DimensionlessLimit,
    /// Springs along veins: as for the coupling.
    foundation: DimensionlessLimit,
    grip_stiffness: DimensionlessLimit,
    turn_stiffness: DimensionlessLimit,
}

// Values in natural units that differ by twelve orders of magnitude hardly affect each other in double
// precision, which has 16 digits.
const LIMITS: LeafLimits = LeafLimits {
    lengths: upper_limit(
        "L_max/L",
        1e3,
        "the ratio of the longest rod to this shortest one: \
         one grid of equal fractions of the length does not serve both",
    ),
    stiffnesses: upper_limit(
        "A_max/A",
        1e12,
        "the ratio of the largest to this smallest torsion or bending stiffness; \
         double precision does not resolve more: raise this one or lower the largest",
    ),
    rest_angle: upper_limit("|u0| L", 1e4, REST_ANGLE_REASON),
    stretch: ratio_limit(
        "v0",
        1e3,
        "the factor of the rest length; beyond it or its inverse one grid \
         of equal fractions of the length does not serve the leaf",
    ),
    force_stiffness: lower_limit(
        "H L^2/A",
        1e-6,
        "A is the smallest bending stiffness of the rod and L its length; \
         below the limit the rod is softer in stretch or shear than any beam: raise this stiffness",
    ),
    coupling: upper_limit(
        "kappa L^4/A",
        1e12,
        "A is the smallest bending stiffness of the two rods and L the longer length; \
         beyond the limit neighbours act as glued together: lower the coupling",
    ),
    density: ratio_limit(
        "rho/rho_mean",
        1e12,
        "rho_mean is the mean of the densities mid-rod; \
         beyond the limit one part weighs nothing beside another: choose densities closer to each other",
    ),
    rotary_inertia: ratio_limit(
        "rho I/(rho_mean L^2)",
        1e12,
        "rho_mean is the mean of the densities mid-rod and L the longest rod; \
         it is r^2/(4 L^2) for a round section of radius r: choose one closer to that of a rod",
    ),
    section_radius: ratio_limit(
        "r/L",
        1e6,
        "r is the radius of the section and L the longest rod: choose one closer to that of a rod",
    ),
    external_damping: upper_limit("c T/rho_mean", 1e12, NATURAL_UNITS_REASON),
    internal_damping: upper_limit("t/T", 1e12, NATURAL_UNITS_REASON),
    duration: ratio_limit("t/T", 1e12, NATURAL_UNITS_REASON),
    outputs: upper_limit(
        "duration/output_interval",
        1e6,
        "the number of outputs: choose a longer output_interval or a shorter duration",
    ),
    times: upper_limit("|t|/T", 1e12, NATURAL_UNITS_REASON),
    periods: upper_limit(
        "frequency duration",
        1e5,
        "the number of periods, each of which takes at least eight steps: choose a lower frequency or a shorter duration",
    ),
    phase: upper_limit("|phase|", 1e3, "in radians"),
    load_factor: upper_limit(
        "|factor|",
        1e6,
        "loads are multiplied by it: choose larger ones in [load], and a smaller factor",
    ),
    rest_factor: upper_limit(
        "|factor|",
        1e6,
        "rest curvatures are multiplied by it: choose larger ones in [rest], and a smaller factor",
    ),
    rest_factor_angle: upper_limit("|factor u0| L", 1e4, REST_ANGLE_REASON),
    gravity: upper_limit("|g| L^3/A", 1e8, TENSION_REASON),
    tip_force: upper_limit("|F| L^2/A", 1e8, TENSION_REASON),
    tip_moment: upper_limit(
        "|M| L/A",
        1e8,
        "A is the smallest bending stiffness of the rod and L its length; \
         the rod would roll up by this many radians: lower the moment or stiffen the rod",
    ),
    rod_weight: upper_limit("|g| rho L^3/A", 1e8, WEIGHT_REASON),
    point_weight: upper_limit("|g| m L^2/A", 1e8, WEIGHT_REASON),
    point_mass: upper_limit("m/(rho_mean L)", 1e12, NATURAL_UNITS_REASON),
    point_offset: upper_limit(
        "|offset|/L",
        1e3,
        "L is the longest rod: choose a place closer to the axis",
    ),
    base_distance: upper_limit(
        "|base|/L",
        1e3,
        "L is the longest rod; \
         beyond the limit positions lose digits: choose an origin closer to the leaf",
    ),
    base_turn: upper_limit("|turn|", 1e3, "an angle in radians: more than 150 turns"),
    tissue: upper_limit("k L^4/A", 1e16, TISSUE_STIFFNESS_REASON),
    fold: upper_limit("c L^2/A", 1e12, TISSUE_STIFFNESS_REASON),
    drag: upper_limit(
        "rho C_D w |U|^2 L^3/(2 A)",
        1e8,
        "A is the smallest bending stiffness of a rod and L its length; \
         beyond the limit bending is confined to less than 1e-4 of the length: lower the velocity",
    ),
    wind_velocity: upper_limit("|U| T/L", 1e12, NATURAL_UNITS_REASON),
    landing_velocity: upper_limit("|v| T/L", 1e12, NATURAL_UNITS_REASON),
    wind_width: upper_limit(
        "w/L",
        1e6,
        "L is the longest rod: choose one closer to the width of a rod",
    ),
    foundation: upper_limit("k L^4/A", 1e12, SPRING_REASON),
    grip_stiffness: upper_limit("k L^3/A", 1e12, SPRING_REASON),
    turn_stiffness: upper_limit("c L/A", 1e12, SPRING_REASON),
};

const SPRING_REASON: &str = "A is the smallest bending stiffness of a rod and L its length; beyond the limit a spring \
     is rigid for all that double precision resolves: lower it, or hold the rod rigidly";

const REST_ANGLE_REASON: &str =
    "an angle in radians: the rod at rest would be wound up more than 1,500 times";

const TISSUE_STIFFNESS_REASON: &str = "A is the smallest bending stiffness of the two rods and L the longer length; \
     beyond the limit double precision does not resolve both: lower this one or stiffen the rods";

const WEIGHT_REASON: &str = "A is the smallest bending stiffness of a rod, L its length and rho its mass per \
     length; beyond the limit bending is confined to less than 1e-4 of the length: check both units";

const TENSION_REASON: &str = "A is the smallest bending stiffness of a rod and L its length; \
     beyond the limit bending is confined to less than 1e-4 of the length: lower the load or stiffen the rods";

const NATURAL_UNITS_REASON: &str = "T = sqrt(rho_mean L^4/A) is the natural unit of time, with the longest rod L and \
     the means rho_mean and A of the densities and bending stiffnesses mid-rod: \
     choose a value, or a density, that brings this closer to 1";

/// Refuses a scenario whose given values are beyond a limit.
pub(super) fn check_limits(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    check_magnitudes(entries, scenario)?;
    check_rods(entries, &scenario.rods)?;
    for (key, load, limit) in [
        (Key::TipForce, scenario.tip_force, LIMITS.tip_force),
        (Key::TipMoment, scenario.tip_moment, LIMITS.tip_moment),
    ] {
        if let Some(item) = entries.given_value(key) {
            limit.check(item, vector_norm(load) / smallest_unit(key, &scenario.rods))?;
        }
    }
    check_coupling(entries, scenario)?;
    check_dynamics(entries, scenario)?;
    check_masses(entries, scenario)?;
    check_loads_in_time(entries, scenario)?;
    check_loads(entries, scenario)
}

/// Refuses stiffnesses and masses that are too large or too small, where they follow from a size.
fn check_magnitudes(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
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
        let masses = rotary_inertia[rod].iter().chain([&density[rod]]);
        for profile in stiffness.chain(masses) {
            is_moderate(size.entry(rod), profile)?;
        }
    }
    let tissue = scenario
        .tissue
        .iter()
        .flatten()
        .flat_map(Tissue::stiffness_profiles);
    // A blade resists some strains without limit.
    let mut tissue = tissue.filter(|of| scenario.blade.is_some() && of.at(0.5).is_finite());
    tissue.try_for_each(|profile| is_moderate(size, profile))
}

fn is_moderate(item: EntryValue, profile: &Profile) -> ScenarioResult<()> {
    for value in positive_extremes(profile) {
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

fn check_rods(entries: &Entries, rods: &[Rod]) -> ScenarioResult<()> {
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
        check(Key::Length, index, &LIMITS.lengths, longest / rod.length)?;
    }
    let stiffnesses = rods.iter().flat_map(|rod| &rod.couple_stiffness);
    let stiffest = stiffnesses.fold(0.0, |most: f64, stiffness| most.max(stiffness.max_abs()));
    for (index, rod) in rods.iter().enumerate() {
        let scale = softest_rod_scale(rod);
        let natural = |key, value| value / scale.unit(key, 1.0);
        for (key, stiffness) in Key::COUPLE.into_iter().zip(&rod.couple_stiffness) {
            check(key, index, &LIMITS.stiffnesses, stiffest / stiffness.min())?;
        }
        for (key, stiffness) in Key::FORCE.into_iter().zip(&rod.force_stiffness) {
            check(
                key,
                index,
                &LIMITS.force_stiffness,
                natural(key, stiffness.min()),
            )?;
        }
        // Stiffnesses that are not given follow from the size of a section.
        if let Some(item) = section::size_entry(entries) {
            let couple = rod.couple_stiffness.iter().map(Profile::min);
            let least = couple.fold(f64::INFINITY, f64::min);
            LIMITS
                .stiffnesses
                .check(item.entry(index), stiffest / least)?;
            for (key, stiffness) in Key::FORCE.into_iter().zip(&rod.force_stiffness) {
                LIMITS
                    .force_stiffness
                    .check(item.entry(index), natural(key, stiffness.min()))?;
            }
        }
        for (key, curvature) in Key::REST_CURVATURE.into_iter().zip(&rod.rest_curvature) {
            check(
                key,
                index,
                &LIMITS.rest_angle,
                natural(key, curvature.max_abs()),
            )?;
        }
        let (least, most) = (rod.rest_stretch.min(), rod.rest_stretch.max_abs());
        let extreme = if most > LIMITS.stretch.most {
            most
        } else {
            least
        };
        check(Key::RestStretch, index, &LIMITS.stretch, extreme)?;
    }
    Ok(())
}

fn check_coupling(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let gaps = scenario.coupling.iter().zip(scenario.rods.windows(2));
    for (gap, (stiffness, rods)) in gaps.enumerate() {
        let [one, other] = [softest_rod_scale(&rods[0]), softest_rod_scale(&rods[1])];
        let both = Scale {
            length: one.length.max(other.length),
            stiffness: one.stiffness.min(other.stiffness),
        };
        for (key, stiffness) in Key::COUPLING.into_iter().zip(stiffness) {
            if let Some(item) = entries.given_value(key) {
                LIMITS
                    .coupling
                    .check(item.entry(gap), stiffness / both.unit(key, 1.0))?;
            }
        }
    }
    Ok(())
}

fn check_dynamics(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let (scale, time) = (scenario.scale(), scenario.natural_time());
    for (key, limit) in [
        (Key::Density, &LIMITS.density),
        (Key::RotaryInertia, &LIMITS.rotary_inertia),
        (Key::RotaryInertia3, &LIMITS.rotary_inertia),
        (Key::SectionRadius, &LIMITS.section_radius),
        (Key::ExternalDamping, &LIMITS.external_damping),
        (Key::InternalDamping, &LIMITS.internal_damping),
        (Key::Duration, &LIMITS.duration),
    ] {
        let Some(item) = entries.given_value(key) else {
            continue;
        };
        let unit = scale.unit(key, time);
        let ValueSchema::Quantity(_) = key.form() else {
            limit.check(item, item.number()? / unit)?;
            continue;
        };
        limit.check_profiles(item, &item.profile_per_rod(scenario.rods.len())?, unit)?;
    }
    Ok(())
}

/// Checks masses that follow from sections or a blade.
fn check_masses(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let mass = [Key::MassDensity, Key::BladeMassDensity, Key::Density];
    let mass = mass.into_iter().find_map(|key| entries.given_value(key));
    let (Some(size), Some(density)) = (section::size_entry(entries), mass) else {
        return Ok(());
    };
    let (scale, time) = (scenario.scale(), scenario.natural_time());
    let [of_mass, of_inertia] = [&LIMITS.density, &LIMITS.rotary_inertia];
    let units = [Key::Density, Key::RotaryInertia].map(|key| scale.unit(key, time));
    of_mass.check_profiles(density, &scenario.dynamics.density, units[0])?;
    for axis in 0..2 {
        let inertia = scenario.dynamics.rotary_inertia.iter();
        let about_axis: Vec<Profile> = inertia.map(|both| both[axis].clone()).collect();
        of_inertia.check_profiles(size, &about_axis, units[1])?;
    }
    Ok(())
}

fn check_loads_in_time(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let (dynamics, rods, time) = (&scenario.dynamics, &scenario.rods, scenario.natural_time());
    if let Some(item) = entries.given_value(Key::OutputInterval) {
        // Rounding of the quotient must not count as an output.
        let outputs = (dynamics.duration / dynamics.output_interval).floor();
        LIMITS.outputs.check(item, outputs)?;
    }
    let units = TimeUnits {
        natural: time,
        duration: dynamics.duration,
    };
    check_times(
        entries.given_value(Key::GravityInTime),
        &dynamics.gravity,
        units,
    )?;
    check_times(
        entries.given_value(Key::TipForceInTime),
        &dynamics.tip_force,
        units,
    )?;
    check_times(
        entries.given_value(Key::TipMomentInTime),
        &dynamics.tip_moment,
        units,
    )?;
    check_times(entries.given_value(Key::RestInTime), &dynamics.rest, units)?;
    for (key, load, limit) in [
        (Key::GravityInTime, &dynamics.gravity, LIMITS.gravity),
        (Key::TipForceInTime, &dynamics.tip_force, LIMITS.tip_force),
        (
            Key::TipMomentInTime,
            &dynamics.tip_moment,
            LIMITS.tip_moment,
        ),
    ] {
        if let Some(item) = entries.given_value(key) {
            let unit = smallest_unit(key, rods);
            for (index, value) in load.bounds().into_iter().enumerate() {
                limit.check(entry_of_bound(item, load, index), vector_norm(value) / unit)?;
            }
        }
    }
    if let Some(motion) = &scenario.support_motion {
        let item = entries.given_value(Key::BaseInTime);
        if let (Some(base), Some(item)) = (&motion.base, item) {
            let part = |name| item.list(name).unwrap_or(item);
            check_times(Some(part("move")), &base.displacement, units)?;
            check_times(Some(part("turn")), &base.turn, units)?;
            for way in base.displacement.bounds() {
                let way = vector_norm(way) / longest(rods);
                LIMITS.base_distance.check(part("move"), way)?;
            }
            for turn in base.turn.bounds() {
                LIMITS.base_turn.check(part("turn"), vector_norm(turn))?;
            }
        }
        if let Some(tip) = &motion.tip {
            check_times(entries.given_value(Key::TipPosition), tip, units)?;
        }
        for row in 0..entries.table_count("grip").unwrap_or(0) {
            let item = entries.value_in_row(Key::GripMove, row)?;
            check_times(Some(item), &item.vectors_in_time()?, units)?;
        }
    }
    if let Some(loads) = &scenario.factored {
        check_load_factor(entries.given_value(Key::LoadFactor), &loads.factor, units)?;
    }
    for (row, point) in scenario.points.iter().enumerate() {
        if let Some(varying) = &point.in_time {
            let item = entries.value_in_row(Key::PointFactor, row)?;
            check_load_factor(Some(item), &varying.factor, units)?;
            let unit = |key| smallest_unit(key, rods);
            let [force, moment] = [
                vector_norm(varying.force) / unit(Key::PointForce),
                vector_norm(varying.moment) / unit(Key::PointMoment),
            ];
            for (index, factor) in varying.factor.bounds().into_iter().enumerate() {
                let entry = entry_of_bound(item, &varying.factor, index);
                LIMITS.tip_force.check(entry, factor.abs() * force)?;
                LIMITS.tip_moment.check(entry, factor.abs() * moment)?;
            }
        }
    }
    if let Some(item) = entries.given_value(Key::RestInTime) {
        let angles = (rods.iter())
            .flat_map(|rod| rod.rest_curvature.iter().map(|u| u.max_abs() * rod.length));
        let angle = angles.fold(0.0, f64::max);
        for (index, factor) in dynamics.rest.bounds().into_iter().enumerate() {
            let entry = entry_of_bound(item, &dynamics.rest, index);
            LIMITS.rest_factor.check(entry, factor.abs())?;
            LIMITS
                .rest_factor_angle
                .check(entry, factor.abs() * angle)?;
        }
    }
    Ok(())
}

/// Times of a motion against which those of schedules are limited.
#[derive(Clone, Copy)]
struct TimeUnits {
    natural: f64,
    duration: f64,
}

/// Refuses times, and oscillations, that no motion can follow.
fn check_times<T: InTime>(
    item: Option<EntryValue>,
    schedule: &Schedule<T>,
    units: TimeUnits,
) -> ScenarioResult<()> {
    let Some(item) = item else {
        return Ok(());
    };
    match schedule {
        Schedule::Linear(knots) | Schedule::Smooth { knots, .. } => {
            let list = item.list("at").unwrap_or(item);
            for (index, at) in knots.at.iter().enumerate() {
                LIMITS
                    .times
                    .check(list.entry(index), at.abs() / units.natural)?;
            }
        }
        Schedule::Sine(sine) => {
            let entry = |name| item.list(name).unwrap_or(item);
            let periods = sine.frequency * units.duration;
            LIMITS.periods.check(entry("frequency"), periods)?;
            LIMITS.phase.check(entry("phase"), sine.phase.abs())?;
        }
    }
    Ok(())
}

/// Refuses times of a factor of loads that no motion can follow, and factors that are too large.
fn check_load_factor(
    item: Option<EntryValue>,
    factor: &Schedule<f64>,
    units: TimeUnits,
) -> ScenarioResult<()> {
    check_times(item, factor, units)?;
    let Some(item) = item else {
        return Ok(());
    };
    let bounds = factor.bounds().into_iter().enumerate();
    for (index, value) in bounds {
        let entry = entry_of_bound(item, factor, index);
        LIMITS.load_factor.check(entry, value.abs())?;
    }
    Ok(())
}

/// The entry to which one of the bounds of a schedule belongs.
fn entry_of_bound<'e, T: InTime>(
    item: EntryValue<'e>,
    schedule: &Schedule<T>,
    index: usize,
) -> EntryValue<'e> {
    let known = schedule.knots().is_some_and(|knots| index < knots.at.len());
    let list = ["value", "factor", "amplitude"]
        .into_iter()
        .find_map(|name| item.list(name));
    match (list, known) {
        (Some(list), true) => list.entry(index),
        (Some(list), false) => list,
        (None, _) => item,
    }
}

fn check_loads(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    check_bases(entries, scenario)?;
    check_tissue(entries, scenario)?;
    check_weights(entries, scenario)?;
    check_loads_along_veins(entries, scenario)?;
    check_springs(entries, scenario)?;
    check_point_loads(entries, scenario)?;
    check_wind(entries, scenario)
}

fn check_bases(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let Some(item) = entries.given_value(Key::Base) else {
        return Ok(());
    };
    let longest = longest(&scenario.rods);
    let mut rods = scenario.rods.iter();
    rods.try_for_each(|rod| {
        LIMITS
            .base_distance
            .check(item, vector_norm(rod.base) / longest)
    })
}

fn check_tissue(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
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
        for (key, profile) in Key::TISSUE.into_iter().zip(tissue.stiffness_profiles()) {
            let blade = || entries.given_value(Key::BladeThickness);
            let stiffness = match middle {
                true => profile.at(0.5),
                false => profile.max_abs(),
            };
            if stiffness == f64::INFINITY {
                continue;
            }
            if let Some(item) = entries.given_value(key).or_else(blade) {
                let limit = if key == Key::TissueFold {
                    &LIMITS.fold
                } else {
                    &LIMITS.tissue
                };
                limit.check(item.entry(gap), stiffness / both.unit(key, 1.0))?;
            }
        }
    }
    Ok(())
}

fn check_weights(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let unit = smallest_unit(Key::Gravity, &scenario.rods);
    if let Some(item) = entries.given_value(Key::Gravity) {
        LIMITS
            .gravity
            .check(item, vector_norm(scenario.gravity) / unit)?;
        for (vein, own) in scenario.own_gravity.iter().enumerate() {
            LIMITS
                .gravity
                .check(item.entry(vein), vector_norm(*own) / unit)?;
        }
    }
    let Some(item) = entries.given_value(Key::G) else {
        return Ok(());
    };
    for (vein, rod) in scenario.rods.iter().enumerate() {
        let unit = softest_rod_scale(rod).unit(Key::Gravity, 1.0);
        if let Some((g, density)) = scenario.weight(vein).of_mass {
            LIMITS
                .rod_weight
                .check(item, vector_norm(g) / unit * density.max_abs())?;
        }
    }
    Ok(())
}

fn check_loads_along_veins(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let loads = [
        (Key::Distributed, &scenario.distributed, &LIMITS.gravity),
        (Key::Follower, &scenario.follower, &LIMITS.gravity),
        (Key::Couple, &scenario.couple, &LIMITS.tip_moment),
    ];
    for (key, loads, limit) in loads {
        let Some(item) = entries.given_value(key) else {
            continue;
        };
        let unit = smallest_unit(key, &scenario.rods);
        for load in loads.iter().flatten() {
            let most = load.each_ref().map(Profile::max_abs);
            limit.check(item, vector_norm(most) / unit)?;
        }
    }
    Ok(())
}

fn check_point_loads(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let unit = |key| smallest_unit(key, &scenario.rods);
    let (force, moment) = (unit(Key::PointForce), unit(Key::PointMoment));
    let mass = scenario.unit(Key::PointMass);
    for (row, point) in scenario.points.iter().enumerate() {
        let item = |key| entries.value_in_row(key, row);
        // At a factor of one, if there is one.
        let varying = point.in_time.as_deref();
        let [given, turned] =
            varying.map_or([point.force, point.moment], |it| [it.force, it.moment]);
        LIMITS
            .tip_force
            .check(item(Key::PointForce)?, vector_norm(given) / force)?;
        LIMITS
            .tip_moment
            .check(item(Key::PointMoment)?, vector_norm(turned) / moment)?;
        let weighed = item(Key::PointMass)?;
        let whole = point.landing.map_or(point.mass, |landing| landing.mass);
        LIMITS.point_mass.check(weighed, whole / mass)?;
        LIMITS
            .point_weight
            .check(weighed, vector_norm(scenario.g) / force * whole)?;
        let beside = item(Key::PointOffset)?;
        let lever = point.offset[0].hypot(point.offset[1]);
        let length = scenario.unit(Key::PointOffset);
        LIMITS.point_offset.check(beside, lever / length)?;
        let weight = vector_norm(scenario.g) * whole;
        LIMITS
            .tip_moment
            .check(beside, lever * (vector_norm(given) + weight) / moment)?;
        if let Some(Landing { from, velocity, .. }) = point.landing {
            let unit = |key| scenario.unit(key);
            LIMITS
                .times
                .check(item(Key::PointFrom)?, from / unit(Key::PointFrom))?;
            let speed = vector_norm(velocity) / unit(Key::PointVelocity);
            LIMITS
                .landing_velocity
                .check(item(Key::PointVelocity)?, speed)?;
        }
    }
    Ok(())
}

fn check_springs(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let unit = |key| smallest_unit(key, &scenario.rods);
    if let Some(item) = entries.given_value(Key::FoundationStiffness) {
        let unit = unit(Key::FoundationStiffness);
        for stiffness in scenario.foundation.iter().flatten().flatten() {
            LIMITS.foundation.check(item, stiffness.max_abs() / unit)?;
        }
    }
    if let Some(item) = entries.given_value(Key::BaseTurnStiffness) {
        let unit = unit(Key::BaseTurnStiffness);
        let springs = scenario.base_turn_stiffness.iter().enumerate();
        for (rod, stiffness) in springs.filter(|(_, stiffness)| **stiffness > 0.0) {
            LIMITS
                .turn_stiffness
                .check(item.entry(rod), stiffness / unit)?;
        }
    }
    for row in 0..entries.table_count("grip").unwrap_or(0) {
        let item = entries.value_in_row(Key::GripStiffness, row)?;
        let unit_of_grips = unit(Key::GripStiffness);
        for (axis, stiffness) in item.vector()?.into_iter().enumerate() {
            if stiffness.is_finite() {
                let limit = &LIMITS.grip_stiffness;
                limit.check(item.entry(axis), stiffness / unit_of_grips)?;
            }
        }
        let item = entries.value_in_row(Key::GripTurnStiffness, row)?;
        let stiffness = item.number()?;
        if stiffness.is_finite() {
            let unit = unit(Key::GripTurnStiffness);
            LIMITS.turn_stiffness.check(item, stiffness / unit)?;
        }
    }
    Ok(())
}

fn check_wind(entries: &Entries, scenario: &Scenario) -> ScenarioResult<()> {
    let Some(wind) = &scenario.wind else {
        return Ok(());
    };
    let (item, time) = (
        entries.value_or_default(Key::WindVelocity)?,
        scenario.natural_time(),
    );
    let units = TimeUnits {
        natural: time,
        duration: scenario.dynamics.duration,
    };
    check_times(Some(item), &wind.velocity, units)?;
    let velocity = scenario.unit(Key::WindVelocity);
    for speed in wind.velocity.bounds().into_iter().map(vector_norm) {
        LIMITS.wind_velocity.check(item, speed / velocity)?;
        for (rod, width) in scenario.rods.iter().zip(&wind.width) {
            let pressure = 0.5 * wind.density * wind.drag * speed * speed;
            let unit = softest_rod_scale(rod).unit(Key::Gravity, 1.0);
            LIMITS.drag.check(item, pressure * width.max_abs() / unit)?;
        }
    }
    let Some(item) = entries.given_value(Key::WindWidth) else {
        return Ok(());
    };
    let longest = longest(&scenario.rods);
    (LIMITS.wind_width).check_profiles(item, &wind.width, longest)
}

/// The range of a dimensionless number.
struct DimensionlessLimit {
    /// How the number is computed, for messages.
    formula: &'static str,
    least: f64,
    most: f64,
    /// What the symbols mean, why there is a limit, and what to change.
    because: &'static str,
}

impl DimensionlessLimit {
    fn check(&self, item: EntryValue, value: f64) -> ScenarioResult<()> {
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
    fn check_profiles(
        &self,
        item: EntryValue,
        profiles: &[Profile],
        unit: f64,
    ) -> ScenarioResult<()> {
        for (index, profile) in profiles.iter().enumerate() {
            for value in positive_extremes(profile) {
                self.check(item.entry(index), value / unit)?;
            }
        }
        Ok(())
    }
}

/// The least and the largest value of a quantity that is positive. The mass of a blade may vanish at
/// its ends: then the largest twice.
fn positive_extremes(profile: &Profile) -> [f64; 2] {
    let (least, most) = (profile.min(), profile.max_abs());
    match profile {
        Profile::Derived(_) if least == 0.0 => [most; 2],
        _ => [least, most],
    }
}

const fn upper_limit(
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

const fn lower_limit(
    formula: &'static str,
    least: f64,
    because: &'static str,
) -> DimensionlessLimit {
    DimensionlessLimit {
        formula,
        least,
        most: f64::INFINITY,
        because,
    }
}

/// A limit within a factor of `most` of 1.
const fn ratio_limit(
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

/// The length of a rod and its smallest bending stiffness anywhere along it.
fn softest_rod_scale(rod: &Rod) -> Scale {
    let [_, second, third] = &rod.couple_stiffness;
    Scale {
        length: rod.length,
        stiffness: second.min().min(third.min()),
    }
}

/// The smallest of all rods' units for the quantity of a key whose dimension has no time.
fn smallest_unit(key: Key, rods: &[Rod]) -> f64 {
    let units = rods.iter().map(|rod| softest_rod_scale(rod).unit(key, 1.0));
    units.fold(f64::INFINITY, f64::min)
}

fn vector_norm([x, y, z]: [f64; 3]) -> f64 {
    // hypot avoids overflow of the squares of large components.
    x.hypot(y).hypot(z)
}
