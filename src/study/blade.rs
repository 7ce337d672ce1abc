//! How accurate a blade is as one of so many veins: the error in veins, estimated by the same blade with
//! half as many, the number of veins that an accuracy needs, and the effect of narrow ends.

use crate::natural::Natural;
use crate::numbers::largest;
use crate::relax::{
    Equilibrium, EquilibriumRemark, FewerVeins, Method, Options, Outcome, Progress, RelaxError,
    SemiImplicit, TriedVeins, VeinsRemark, relax, relax_from,
};
use crate::run::RefusedOption;
use crate::scenario::{Blade, Scenario};
use crate::shape::{NodeState, RodShape, interpolation_weights};
use crate::study::judge::SAME_STATION_DISTANCE;
use crate::study::{BaseScenario, ParameterKeys, VaryError};
use glam::{DQuat, DVec3};

/// How the error in veins is estimated.
struct VeinsRules {
    /// The fewest veins of which it is estimated: half of fewer have no tissue, or no vein inside.
    fewest: usize,
    /// With so many veins or fewer in place of these the estimate is often too small.
    very_few: usize,
    /// The estimate over the difference to half as many veins. Of an error of second order, which is then
    /// 1/3 of the difference, it is 4.5 times, of one of first order 1.5 times as large.
    factor: f64,
    /// The widest gap between veins, as a fraction of the blade's length, of which anything is told: a
    /// short wide plate in shear approaches its limit from the other side with more veins.
    widest_gap: f64,
    /// A difference of more than this fraction of the length is that of another equilibrium.
    another_equilibrium: f64,
    /// The error of the grid of the smaller blade, as a fraction of the difference.
    grid_error: f64,
    /// The first tolerance of the smaller blade; twice as large saves no grid.
    first_tolerance: f64,
}

const RULES: VeinsRules = VeinsRules {
    fewest: 5,
    very_few: 3,
    factor: 1.5,
    widest_gap: 0.25,
    another_equilibrium: 0.1,
    grid_error: 0.1,
    first_tolerance: 1e-4,
};

/// The largest number of veins to which a blade is refined.
pub const MOST_REFINED_VEINS: usize = 65;

/// The error in veins to which a blade is refined if nothing is said: a fraction of the largest
/// displacement from the natural leaf.
pub const DEFAULT_VEINS_TOLERANCE: f64 = 1e-2;

/// Tolerance of the blade with narrower ends that a blade is compared with.
const COMPARED_BLADE_TOLERANCE: f64 = 1e-4;

/// Veins through which a curve across a blade is laid.
const VEINS_ACROSS: usize = 4;

const LEAST_WIDTH_KEY: &str = "blade.least_width";

const RODS_KEY: &str = "leaf.rods";

/// Relaxes the leaf of `base` and, if it is a blade that comes to rest in a stable equilibrium, tells in
/// [`Equilibrium::blade`] by how much narrower ends would move it; not for a fixed grid, or by
/// other methods than the semi-implicit one.
///
/// # Errors
/// If it cannot be relaxed; where the blade with narrower ends cannot be, that is left out.
pub fn relax_blade(
    base: &BaseScenario,
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    let mut leaf = relax(base.scenario(), options, progress)?;
    compare_with_narrower_ends(base, &mut leaf, options);
    Ok(leaf)
}

/// Tells by how much a blade at rest moves if its least width is half as much.
fn compare_with_narrower_ends(base: &BaseScenario, leaf: &mut Equilibrium, options: &Options) {
    let scenario = base.scenario();
    let refines = (options.method.semi_implicit()).is_some_and(|how| how.segments.is_none());
    let is_narrow = (leaf.blade.as_ref()).is_some_and(|blade| blade.least_width.is_some());
    let (Some(blade), true) = (&scenario.blade, refines && is_narrow) else {
        return;
    };
    if leaf.stable() != Some(true) {
        return;
    }
    let tolerance = leaf.accuracy.tolerance.max(COMPARED_BLADE_TOLERANCE);
    let narrower = blade_with_number(base, LEAST_WIDTH_KEY, 0.5 * blade.least_width_fraction());
    // It is nearly where the blade itself is.
    let there = (leaf.shape.stations.as_slice(), leaf.shape.rods.as_slice());
    let found = (narrower.ok())
        .and_then(|it| relax_from(&it, there, &shape_options(options, tolerance), &mut |_| {}).ok())
        .filter(|found| found.stable() == Some(true));
    let effect = found.map(|found| largest_distance([scenario, scenario], [leaf, &found]));
    if let Some(report) = &mut leaf.blade {
        report.least_width_effect = effect;
    }
}

/// The scenario of a blade with another number at a key.
fn blade_with_number(base: &BaseScenario, key: &str, value: f64) -> Result<Scenario, VaryError> {
    let keys: ParameterKeys = key.parse()?;
    Ok(base.scenario_with_values(&[(&keys, value)])?.scenario)
}

/// Options of a relaxation for the shape alone. Slower methods than the semi-implicit one are not used.
fn shape_options(options: &Options, tolerance: f64) -> Options {
    let how = options.method.semi_implicit();
    let on_grid = || SemiImplicit::on_grid(options.method.segments());
    Options {
        method: Method::SemiImplicit(how.unwrap_or_else(on_grid)),
        tolerance: Some(tolerance),
        modes: 0,
        mode_shapes: false,
        every_node: false,
        stations: None,
        ..options.clone()
    }
}

/// Estimates the error in veins of a blade of `base` that came to rest with these `options`, from the
/// same blade with half as many veins ((N + 1)/2 of N where N is odd, N/2 where it is even): 1.5
/// times the largest difference of equal places. The estimate is put in [`Equilibrium::blade`], with
/// a remark where there is none, or where it is uncertain; nothing else of the leaf changes. Of
/// fewer than 5 veins, and of a leaf that is not at rest, nothing is told.
///
/// It is an estimate, not a bound. It fails for three veins in place of five and for short wide blades
/// in shear, whose error does not go down with every vein.
pub fn estimate_error_in_veins(base: &BaseScenario, leaf: &mut Equilibrium, options: &Options) {
    if leaf.rod_count < RULES.fewest || leaf.blade.is_none() || !leaf.outcome.is_at_rest() {
        return;
    }
    let compared = match key_of_single_veins(base) {
        Some(key) => Err(VeinsRemark::SingleVeins { key }),
        None => compare_with_fewer_veins(base, leaf, options),
    };
    tell_error_in_veins(leaf, compared);
}

/// Takes what a comparison with fewer veins tells.
fn tell_error_in_veins(leaf: &mut Equilibrium, compared: Result<FewerVeins, VeinsRemark>) {
    let Some(report) = &mut leaf.blade else {
        return;
    };
    report.half_as_many = compared.as_ref().ok().copied();
    report.error_in_veins = report
        .half_as_many
        .map(|fewer| RULES.factor * fewer.difference);
    report.error_in_veins_remark = match compared {
        Ok(FewerVeins { rods, .. }) if rods <= RULES.very_few => {
            Some(VeinsRemark::VeryFew { rods })
        }
        Ok(_) => None,
        Err(remark) => Some(remark),
    };
}

/// A key that says something of single veins, so that the leaf with fewer veins is another one.
fn key_of_single_veins(base: &BaseScenario) -> Option<&'static str> {
    let list = || base.entries.key_with_list_per_rod().map(|key| key.path());
    base.scenario().key_of_loads_on_veins().or_else(list)
}

/// Relaxes the blade with half as many veins, as accurately as the difference needs.
fn compare_with_fewer_veins(
    base: &BaseScenario,
    leaf: &Equilibrium,
    options: &Options,
) -> Result<FewerVeins, VeinsRemark> {
    let scenario = base.scenario();
    refuse_short_and_wide(scenario)?;
    let rods = leaf.rod_count.div_ceil(2);
    let fewer = blade_with_number(base, RODS_KEY, rods as f64).map_err(|error| {
        let why = error.to_string();
        VeinsRemark::NoSuchBlade { rods, why }
    })?;
    let (Some(blade), Some(other)) = (&scenario.blade, &fewer.blade) else {
        let why = "it has no outline".into();
        return Err(VeinsRemark::NoSuchBlade { rods, why });
    };
    // They are nearly where the veins of the blade itself are.
    let veins = veins_at_rest_between([blade, other], leaf, rods);
    let there = (leaf.shape.stations.as_slice(), veins.as_slice());
    let finest = leaf.accuracy.tolerance;
    let mut tolerance = finest.max(RULES.first_tolerance);
    loop {
        let options = shape_options(options, tolerance);
        let found = relax_from(&fewer, there, &options, &mut |_| {}).map_err(|error| {
            let why = error.to_string();
            VeinsRemark::NoSuchBlade { rods, why }
        })?;
        let compared = compare_veins([scenario, &fewer], [leaf, &found])?;
        let wanted = RULES.grid_error * compared.difference;
        // Beyond the accuracy of the blade itself no difference is seen.
        if tolerance <= finest || (found.accuracy.error_estimate).is_none_or(|bar| bar <= wanted) {
            return Ok(compared);
        }
        tolerance = (wanted / leaf.shape.longest())
            .min(RULES.grid_error * tolerance)
            .max(finest);
    }
}

/// The `rods` veins of another blade of the same outline where they lie in a blade at rest.
fn veins_at_rest_between(
    [blade, other]: [&Blade; 2],
    leaf: &Equilibrium,
    rods: usize,
) -> Vec<RodShape> {
    let etas = vein_positions(blade, leaf.rod_count);
    // The fewer carry the forces of all.
    let share = leaf.rod_count as f64 / rods as f64;
    let vein = |k: usize| {
        let across = interpolation_weights(&etas, other.vein_position(k), VEINS_ACROSS);
        let veins = &leaf.shape.rods[across.first..][..across.weights.len()];
        let node = |at: usize| {
            let first = veins[0].nodes[at].rotation;
            let mut between = NodeState {
                position: DVec3::ZERO,
                rotation: DQuat::from_array([0.0; 4]),
                v: DVec3::ZERO,
                u: DVec3::ZERO,
                n: DVec3::ZERO,
                m: DVec3::ZERO,
            };
            for (weight, vein) in across.weights.iter().zip(veins) {
                let node = &vein.nodes[at];
                let sign = first.dot(node.rotation).signum();
                between.position += *weight * node.position;
                between.rotation += node.rotation * (sign * weight);
                between.v += *weight * node.v;
                between.u += *weight * node.u;
                between.n += share * weight * node.n;
                between.m += share * weight * node.m;
            }
            between.rotation = between.rotation.normalize();
            between
        };
        RodShape {
            length: veins[0].length,
            nodes: (0..leaf.shape.stations.len()).map(node).collect(),
        }
    };
    (0..rods).map(vein).collect()
}

/// Refuses blades of which no number of fewer veins tells an error.
fn refuse_short_and_wide(scenario: &Scenario) -> Result<(), VeinsRemark> {
    let gap = |blade: &Blade| blade.width(blade.widest()) * blade.gap_fraction();
    let is_wide = |blade: &Blade| gap(blade) > RULES.widest_gap * blade.length();
    match scenario.blade.as_deref().is_some_and(is_wide) {
        true => Err(VeinsRemark::ShortAndWide),
        false => Ok(()),
    }
}

/// The difference of a blade and the same with fewer veins, both at rest, if it is one in veins.
fn compare_veins(
    [scenario, fewer]: [&Scenario; 2],
    [leaf, found]: [&Equilibrium; 2],
) -> Result<FewerVeins, VeinsRemark> {
    let rods = found.rod_count;
    if !found.outcome.is_at_rest() {
        return Err(VeinsRemark::FewerNotAtRest { rods });
    }
    let difference = largest_distance([scenario, fewer], [leaf, found]);
    let index = |leaf: &Equilibrium| leaf.stability.negative_eigenvalues;
    let same_index = index(leaf)
        .zip(index(found))
        .is_none_or(|(one, other)| one == other);
    let near = difference <= RULES.another_equilibrium * leaf.shape.longest();
    match same_index && near {
        true => Ok(FewerVeins { rods, difference }),
        false => Err(VeinsRemark::AnotherEquilibrium {
            rods,
            distance: difference,
        }),
    }
}

/// Where so many veins of a blade lie across it, as fractions of its half width.
fn vein_positions(blade: &Blade, rods: usize) -> Vec<f64> {
    (0..rods).map(|j| blade.vein_position(j)).collect()
}

/// The largest distance between equal places of two forms of a blade: of the veins of the second from
/// where these lie in the first, at stations in common.
fn largest_distance([whole, other]: [&Scenario; 2], [leaf, found]: [&Equilibrium; 2]) -> f64 {
    let (Some(blade), Some(other)) = (&whole.blade, &other.blade) else {
        return f64::NAN;
    };
    let etas = vein_positions(blade, leaf.rod_count);
    let vein = |k: usize| {
        // Across the veins by a cubic; where there is a vein it is that.
        let across = interpolation_weights(&etas, other.vein_position(k), VEINS_ACROSS);
        let stations = found.shape.stations.iter().zip(&found.shape.rods[k].nodes);
        let apart = stations.filter_map(|(sigma, node)| {
            let same = |station: &f64| (station - sigma).abs() < SAME_STATION_DISTANCE;
            let at = leaf.shape.stations.iter().position(same)?;
            let veins = leaf.shape.rods[across.first..].iter().zip(&across.weights);
            let there: DVec3 = veins
                .map(|(rod, weight)| *weight * rod.nodes[at].position)
                .sum();
            Some(there.distance(node.position))
        });
        largest(apart)
    };
    largest((0..found.rod_count).map(vein))
}

/// Why the veins of a leaf are not refined.
#[derive(Debug, thiserror::Error)]
pub enum VeinsError {
    /// The relaxation cannot be run.
    #[error(transparent)]
    Relax(#[from] RelaxError),
    /// There is no such blade with more veins.
    #[error(transparent)]
    Vary(#[from] VaryError),
    /// A leaf whose veins are given one by one.
    #[error(
        "only the veins of a blade can be refined: a leaf without [blade] is another with more veins"
    )]
    NoBlade,
    /// A blade with entries of single veins.
    #[error("{0}")]
    SingleVeins(VeinsRemark),
}

/// A blade with as many veins as its accuracy needs.
#[derive(Clone, Debug)]
pub struct RefinedBlade {
    /// The scenario with this number of veins.
    pub base: BaseScenario,
    /// The blade at rest; [`Equilibrium::blade`] tells which numbers of veins were tried.
    pub leaf: Equilibrium,
}

/// Relaxes a blade with N veins, as many as `base` has or 5, then with 2N - 1 and so on, until the error in
/// veins is at most `tolerance` times its largest displacement from the natural leaf, or less than
/// the error of the grid. An estimate from three veins is not enough. If
/// [`MOST_REFINED_VEINS`] do not suffice the outcome is that the tolerance is not reached, with a
/// remark; a blade that does not come to rest is not refined further.
///
/// The leaf is the same as that of [`relax_blade`] with this number of veins.
///
/// # Errors
/// Requests that cannot be met: leaves without a blade, with keys of single veins, and a tolerance that is
/// not between 0 and 1.
pub fn refine_veins(
    base: &BaseScenario,
    tolerance: f64,
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<RefinedBlade, VeinsError> {
    if !(tolerance > 0.0 && tolerance < 1.0) {
        let why = "must be between 0 and 1: a fraction of the largest displacement";
        return Err(RelaxError::from(RefusedOption::new("veins", tolerance, why)).into());
    }
    if base.scenario().blade.is_none() {
        return Err(VeinsError::NoBlade);
    }
    if let Some(key) = key_of_single_veins(base) {
        return Err(VeinsError::SingleVeins(VeinsRemark::SingleVeins { key }));
    }
    let keys: ParameterKeys = RODS_KEY.parse()?;
    let mut rods = base.scenario().rods.len().max(RULES.fewest);
    let mut tried = Vec::new();
    let mut fewer: Option<RefinedBlade> = None;
    loop {
        let base = base.with_value(&keys, rods as f64)?;
        let scenario = base.scenario();
        let mut leaf = relax(scenario, options, progress)?;
        match &fewer {
            None => estimate_error_in_veins(&base, &mut leaf, options),
            Some(fewer) if leaf.outcome.is_at_rest() => {
                let compared = refuse_short_and_wide(scenario).and_then(|()| {
                    compare_veins([scenario, fewer.base.scenario()], [&leaf, &fewer.leaf])
                });
                tell_error_in_veins(&mut leaf, compared);
            }
            Some(_) => {}
        }
        let report = leaf.blade.as_ref();
        let error = report.and_then(|blade| blade.error_in_veins);
        let from_few = report
            .and_then(|blade| blade.half_as_many)
            .is_none_or(|fewer| fewer.rods <= RULES.very_few);
        tried.push(TriedVeins {
            rods,
            error_in_veins: error,
        });
        let wanted = (tolerance * largest_displacement(scenario, &leaf))
            .max(leaf.accuracy.error_estimate.unwrap_or(0.0));
        let enough = !from_few && error.is_some_and(|error| error <= wanted);
        let next = 2 * rods - 1;
        let stopped = !leaf.outcome.is_at_rest() || options.limit.reached();
        if !enough && !stopped && next <= MOST_REFINED_VEINS {
            (fewer, rods) = (Some(RefinedBlade { base, leaf }), next);
            continue;
        }
        compare_with_narrower_ends(&base, &mut leaf, options);
        if let Some(report) = &mut leaf.blade {
            report.veins_tried = tried;
        }
        if !enough && leaf.outcome.is_success() {
            leaf.outcome = Outcome::ToleranceNotReached;
            leaf.remark = Some(EquilibriumRemark::ErrorInVeins {
                rods,
                error,
                wanted,
            });
        }
        return Ok(RefinedBlade { base, leaf });
    }
}

/// The largest displacement of a station from its place in the natural leaf.
fn largest_displacement(scenario: &Scenario, leaf: &Equilibrium) -> f64 {
    let natural = Natural::new(scenario, true);
    let vein =
        |j: usize| {
            let stations = leaf.shape.stations.iter().zip(&leaf.shape.rods[j].nodes);
            largest(stations.map(|(sigma, node)| {
                (natural.vein_pose(j, *sigma).position).distance(node.position)
            }))
        };
    largest((0..leaf.rod_count).map(vein))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same blade that hangs to the other side is another equilibrium.
    #[test]
    fn far_away_is_another_equilibrium() {
        let rest = |g: f64, rods: usize| {
            let text = format!(
                "name = 'blade'\nleaf = {{ rods = {rods} }}\nload.g = [0, 0, {g}]\n\
                 blade = {{ length = 25.0, width = 2.0, thickness = 0.03, young = 5e4, mass_density = 8e-6 }}"
            );
            let scenario = Scenario::from_toml(&text).unwrap();
            let leaf = scenario.relaxation().tolerance(1e-4).run().unwrap();
            (scenario, leaf)
        };
        let (scenario, leaf) = rest(-981.0, 5);
        let (fewer, alike) = rest(-981.0, 3);
        let near = compare_veins([&scenario, &fewer], [&leaf, &alike]).unwrap();
        assert!(near.rods == 3 && near.difference < 0.1);
        let (fewer, risen) = rest(981.0, 3);
        let far = compare_veins([&scenario, &fewer], [&leaf, &risen]).unwrap_err();
        assert_eq!(far.code(), "another-equilibrium");
    }
}
