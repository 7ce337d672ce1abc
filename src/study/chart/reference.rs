//! The solution that all others are measured against.

use super::run::{Shape, longest, union};
use crate::bvp::{self, Neutral, Solution, Start};
use crate::relax::{self, Equilibrium, Options, Outcome, RelaxError, SMALLEST_TOLERANCE};
use crate::scenario::Scenario;

/// Tolerances of the relaxation: first one that most leaves reach, then the
/// best, or else one that asks for fewer grids to come to rest on.
const FIRST: f64 = 1e-10;
const LARGER: f64 = 1e-4;

/// The reference, and how far it can be trusted. Lengths are relative to the
/// longest rod.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Whether relaxation and shooting agree within their error estimates.
    pub confirmed: bool,
    /// Which solution it is, and why it is not confirmed: a sentence.
    pub told: String,
    /// How well the reference is known: the better of both error estimates, or
    /// the difference of both if that is larger and they agree. Smaller errors
    /// cannot be told from none.
    pub known_within: f64,
    /// Error estimate of the relaxation, if the leaf came to rest.
    pub relaxed: Option<f64>,
    /// Error estimate of the shooting, if it found a solution.
    pub shot: Option<f64>,
    /// Largest distance between both.
    pub difference: Option<f64>,
    /// How the leaf could move without resistance, if it could: errors then say
    /// where along that way a run came to rest.
    pub neutral: Option<String>,
}

/// Finds the reference of a scenario, at `wanted` stations if shooting can
/// tell them. `None` if neither way finds an equilibrium.
///
/// # Errors
/// If the leaf cannot be relaxed at all.
pub fn find(
    scenario: &Scenario,
    wanted: Vec<f64>,
) -> Result<Option<(Reference, Shape)>, RelaxError> {
    let relaxed = best_relaxed(scenario)?;
    let stations = relaxed.iter().flat_map(|leaf| &leaf.shape.stations);
    let stations = union(wanted.into_iter().chain(stations.copied()).collect());
    let start = match &relaxed {
        Some(leaf) => Start::Leaf {
            stations: &leaf.shape.stations,
            rods: &leaf.shape.rods,
        },
        None => Start::Arcs,
    };
    let shot = bvp::solve_within(scenario, start, SMALLEST_TOLERANCE, None, &stations);
    let unit = longest(scenario);
    Ok(match (relaxed, shot) {
        (Some(leaf), Ok(solution)) => Some(both(leaf, solution, unit)),
        (Some(leaf), Err(failure)) => {
            let reference = Reference {
                confirmed: false,
                told: format!(
                    "the relaxed leaf: shooting does not confirm it, {}",
                    failure.reason
                ),
                known_within: estimate(&leaf, unit),
                relaxed: Some(estimate(&leaf, unit)),
                shot: None,
                difference: None,
                neutral: None,
            };
            Some((reference, Shape::new(leaf.shape.stations, &leaf.shape.rods)))
        }
        (None, Ok(solution)) => {
            let error = solution.error.position / unit;
            let reference = Reference {
                confirmed: false,
                told: "the boundary-value solution from arcs: the relaxation does not come to rest"
                    .into(),
                known_within: error,
                relaxed: None,
                shot: Some(error),
                difference: None,
                neutral: solution.neutral.as_ref().map(Neutral::to_string),
            };
            Some((reference, Shape::new(solution.stations, &solution.rods)))
        }
        (None, Err(_)) => None,
    })
}

fn estimate(leaf: &Equilibrium, unit: f64) -> f64 {
    leaf.accuracy
        .error_estimate
        .map_or(f64::INFINITY, |error| error / unit)
}

/// The most accurate relaxation that comes to rest.
fn best_relaxed(scenario: &Scenario) -> Result<Option<Equilibrium>, RelaxError> {
    let at = |tolerance: f64| {
        let options = Options {
            tolerance: Some(tolerance),
            ..Options::default()
        };
        let leaf = relax::relax(scenario, &options, &mut |_| {})?;
        let at_rest = leaf.outcome.is_success() || leaf.outcome == Outcome::ToleranceNotReached;
        Ok(at_rest.then_some(leaf))
    };
    let Some(first) = at(FIRST)? else {
        return at(LARGER);
    };
    if first.outcome == Outcome::ToleranceNotReached {
        return Ok(Some(first));
    }
    let better = at(SMALLEST_TOLERANCE)?;
    Ok(better
        .filter(|leaf| leaf.accuracy.error_estimate <= first.accuracy.error_estimate)
        .or(Some(first)))
}

/// The boundary-value solution, which is known at all stations, if both agree;
/// otherwise the one that claims to be better.
fn both(leaf: Equilibrium, solution: Solution, unit: f64) -> (Reference, Shape) {
    let (relaxed, shot) = (estimate(&leaf, unit), solution.error.position / unit);
    let leaf = Shape::new(leaf.shape.stations, &leaf.shape.rods);
    let neutral = solution.neutral.as_ref().map(Neutral::to_string);
    let solution = Shape::new(solution.stations, &solution.rods);
    let difference = leaf.distance(&solution).map(|distance| distance / unit);
    let confirmed = difference.is_some_and(|difference| difference <= relaxed + shot);
    let better = relaxed.min(shot);
    let told = match (confirmed, relaxed < shot) {
        (true, _) => "relaxation and shooting agree within their error estimates",
        (false, true) => "the relaxed leaf: shooting finds another shape",
        (false, false) => "the boundary-value solution: the relaxed leaf has another shape",
    };
    let reference = Reference {
        confirmed,
        told: told.into(),
        known_within: match difference {
            Some(difference) if confirmed => better.max(difference),
            _ => better,
        },
        relaxed: Some(relaxed),
        shot: Some(shot),
        difference,
        neutral,
    };
    match confirmed || shot <= relaxed {
        true => (reference, solution),
        false => (reference, leaf),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaf() -> Scenario {
        let leaf = r#"
            name = "fan"
            leaf = { rods = 2, length = 2.0, fan = "symmetric" }
            stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = 100, shear_2 = 100, shear_3 = 100 }
            load = { gravity = [0.0, 0.0, -0.1] }
        "#;
        Scenario::from_toml(leaf).unwrap()
    }

    #[test]
    fn both_ways_confirm_each_other_and_all_stations_are_known() {
        let found = find(&leaf(), vec![0.0, 1.0 / 3.0, 1.0]).unwrap();
        let (reference, shape) = found.unwrap();
        assert!(reference.confirmed, "{}", reference.told);
        assert!(reference.known_within < 1e-11);
        assert!(shape.covers(&[1.0 / 3.0, 0.125, 1.0]));
    }

    #[test]
    fn another_shape_does_not_confirm_and_the_better_is_taken() {
        let scenario = leaf();
        let relaxed = best_relaxed(&scenario).unwrap().unwrap();
        let start = Start::Leaf {
            stations: &relaxed.shape.stations,
            rods: &relaxed.shape.rods,
        };
        let solution =
            bvp::solve_within(&scenario, start, 1e-12, None, &relaxed.shape.stations).unwrap();
        let mut elsewhere = solution.clone();
        for rod in &mut elsewhere.rods {
            for node in &mut rod.nodes {
                node.position.z += 1e-6;
            }
        }
        for (error, shot_is_better) in [(1e-16, true), (1e-7, false)] {
            elsewhere.error.position = error;
            let (reference, shape) = both(relaxed.clone(), elsewhere.clone(), 2.0);
            assert!(!reference.confirmed);
            let shifted = Shape::new(elsewhere.stations.clone(), &elsewhere.rods);
            assert_eq!(shape == shifted, shot_is_better);
        }
        // An estimate that is as large as the difference confirms little, but
        // truly.
        elsewhere.error.position = 3e-6;
        assert!(both(relaxed, elsewhere, 2.0).0.confirmed);
    }
}
