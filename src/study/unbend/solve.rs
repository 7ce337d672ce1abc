//! A posture, what rests in it, and where slow loading leads.

use crate::posture::Posture;
use crate::posture::leaf::{ScenarioRod, rest_scenario, with_level_base};
use crate::posture::points::PostureError;
use crate::posture::rest::Stations;
use crate::posture::two_postures::{TwoPostures, compare};
use crate::relax::{self, Equilibrium, EquilibriumDoubt, Options, Outcome};
use crate::run::{Instant, Limit};
use crate::scenario::Scenario;
use crate::study::unbend::request::{UnbendError, UnbendRequest};
use crate::study::unbend::result::{ModulusInterval, RestCheck, SlowLoading, Unbending};
use rayon::prelude::*;

/// Where no modulus is given, the files are those of this many times the least one: of measured wheat leaves half rest
/// there after slow loading at 1.5 times.
const SHOWN_AT: f64 = 2.0;

/// The largest modulus at which slow loading is tried, in least ones, and the steps by which its end is narrowed down.
const STIFFEST: f64 = 100.0;
const SLOW_LOADING_STEPS: usize = 8;

/// A leaf has come to a posture if it is nearer than this fraction of its length: other equilibria are farther away.
const SAME_POSTURE: f64 = 0.01;

/// The least modulus at which a posture is stable, and what rests there at larger ones.
///
/// # Errors
/// Scenarios and points of which that does not follow.
pub fn unbend(request: &UnbendRequest) -> Result<Unbending, UnbendError> {
    let clock = Instant::now();
    let young = request.young.clone();
    if let Some(range) = &young {
        let (low, high) = (*range.start(), *range.end());
        if !(low > 0.0 && high.is_finite() && low <= high) {
            let young = if low == high {
                format!("{low}")
            } else {
                format!("{low}..{high}")
            };
            return Err(UnbendError::Young { young });
        }
    }
    let of = ScenarioRod::new(&request.scenario)?;
    let base = Some(of.base);
    let posture = Posture::from_points(of.rod.clone(), &request.points, base)?;
    // Points out of order are longer than their leaf, too.
    check_units(request)?;
    let compared = match &request.second {
        Some(second) => {
            let other = Posture::from_points(of.rod.clone(), &second.points, base)
                .map_err(UnbendError::Second)?;
            let compared = compare(&posture, &other, second.roll);
            Some(compared.ok_or(UnbendError::Second(PostureError::Coincident))?)
        }
        None => None,
    };
    Ok(describe(request, of, posture, compared, clock))
}

/// Refuses points that are probably not in the unit of the scenario.
fn check_units(request: &UnbendRequest) -> Result<(), UnbendError> {
    if request.is_unit_known {
        return Ok(());
    }
    let given = request.scenario.rods[0].length;
    let meters = request.scenario.units.meters();
    request.points.check_unit(given, meters)?;
    match &request.second {
        Some(second) => (second.points.check_unit(given, meters)).map_err(UnbendError::Second),
        None => Ok(()),
    }
}

/// Several postures, side by side; a posture that cannot be used is an error of its own.
pub fn unbend_many(requests: &[UnbendRequest]) -> Vec<Result<Unbending, UnbendError>> {
    requests.par_iter().map(unbend).collect()
}

fn describe(
    request: &UnbendRequest,
    of: ScenarioRod,
    posture: Posture,
    compared: Option<TwoPostures>,
    clock: Instant,
) -> Unbending {
    let stations = posture.stations(request.check);
    let least = match posture.critical_young() {
        0.0 => of.young / SHOWN_AT,
        least => least,
    };
    let by_two = compared.and_then(|compared| ModulusInterval::new(&compared));
    let shown = match (&request.young, by_two) {
        (Some(range), _) => {
            // Of a range the part in which the posture is stable.
            let (low, high) = (*range.start(), *range.end());
            (low.max(least).min(high) * high).sqrt()
        }
        (None, Some(young)) => young.value,
        (None, None) => SHOWN_AT * least,
    };
    let scenario = &request.scenario;
    let rest = |young: f64| rest_scenario(scenario, &of, &posture, &stations, young);
    let check = (request.check).then(|| check_rest(&rest(shown), &stations, shown));
    let slow_loading =
        (request.slow_loading).then(|| slow_loading(&rest, &stations, least, &request.limit));
    let mut found = Unbending::new(scenario, &of, posture, stations, request);
    found.shown_young = shown;
    found.young = by_two;
    found.compared = compared;
    found.rest_check = check;
    found.slow_loading = slow_loading;
    found.rest = Some(with_level_base(&rest_scenario(
        scenario,
        &of,
        &found.posture,
        &found.stations,
        shown,
    )));
    found.add_remarks(request);
    found.wall_seconds = clock.elapsed().as_secs_f64();
    found
}

impl Unbending {
    /// The scenario that rests in the posture at a modulus.
    pub fn rest_at(&self, scenario: &Scenario, young: f64) -> Result<Scenario, UnbendError> {
        let of = ScenarioRod::new(scenario)?;
        let rest = rest_scenario(scenario, &of, &self.posture, &self.stations, young);
        Ok(with_level_base(&rest))
    }
}

/// Relaxes the scenario that rests in a posture from there.
fn check_rest(rest: &Scenario, stations: &Stations, young: f64) -> RestCheck {
    let (at, rods) = stations.to_shape();
    let options = Options {
        method: relax::SemiImplicit {
            keep_unstable: true,
            ..relax::SemiImplicit::default()
        }
        .into(),
        every_node: true,
        ..Options::default()
    };
    let leaf = relax::relax_from(rest, (&at, &rods), &options, &mut |_| {});
    // Where the matrix is nearly singular the leaf may have left the posture: that confirms nothing.
    let stayed = |leaf: &Equilibrium| {
        leaf.outcome.is_at_rest() && !leaf.doubts.contains(&EquilibriumDoubt::RelaxedAnew)
    };
    let leaf = leaf.ok().filter(stayed);
    RestCheck {
        young,
        distance: leaf.as_ref().and_then(|leaf| distance(leaf, stations)),
        index: leaf.and_then(|leaf| leaf.stability.negative_eigenvalues),
    }
}

/// The largest distance of a relaxed leaf from a posture, in lengths, at stations that both have.
fn distance(leaf: &Equilibrium, stations: &Stations) -> Option<f64> {
    let nodes = &leaf.shape.rods.first()?.nodes;
    let mut largest: Option<f64> = None;
    let mut from = 0;
    for station in &stations.ends {
        while from < leaf.shape.stations.len() && leaf.shape.stations[from] < station.sigma - 1e-9 {
            from += 1;
        }
        let Some(&sigma) = leaf.shape.stations.get(from) else {
            break;
        };
        if (sigma - station.sigma).abs() < 1e-9 {
            let off = nodes[from].position.distance(station.position) / stations.length;
            largest = Some(largest.map_or(off, |most| crate::numbers::larger(most, off)));
        }
    }
    largest
}

/// The modulus from which slow loading of the leaf without loads leads to the posture.
fn slow_loading(
    rest: &dyn Fn(f64) -> Scenario,
    stations: &Stations,
    least: f64,
    limit: &Limit,
) -> SlowLoading {
    let reaches = |young: f64| {
        let options = Options {
            tolerance: Some(1e-4),
            limit: limit.clone(),
            ..Options::default()
        };
        let leaf = relax::relax(&rest(young), &options, &mut |_| {});
        let leaf = leaf.ok().filter(|leaf| leaf.outcome == Outcome::Converged);
        let off = leaf.and_then(|leaf| distance(&leaf, stations));
        off.is_some_and(|off| off < SAME_POSTURE)
    };
    let (mut low, mut high) = (1.02 * least, STIFFEST * least);
    if !reaches(high) {
        return SlowLoading::NotBelow(high);
    }
    if reaches(low) {
        return SlowLoading::From(low);
    }
    for _ in 0..SLOW_LOADING_STEPS {
        let middle = (low * high).sqrt();
        if reaches(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    SlowLoading::From(high)
}
