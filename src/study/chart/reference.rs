//! The solution against which all runs of a chart are measured.
//!
//! It is determined by two independent methods: the most accurate relaxation that comes to rest, and the
//! solution of the boundary-value problem that starts from there, which is known at all stations. If
//! they agree within their estimates, it is confirmed.

use crate::relax::{Options, Outcome, RelaxError, SMALLEST_TOLERANCE};
use crate::scenario::{Scenario, longest};
use crate::shooting;
use crate::shooting::ShootingStart;
use crate::study::judge::{MethodSolution, union_of_stations};
use serde::Serialize;

/// Tolerances of the relaxation: first one that most leaves reach, then the
/// best one, or else one that requires fewer grids.
const FIRST_REFERENCE_TOLERANCE: f64 = 1e-10;

const FALLBACK_REFERENCE_TOLERANCE: f64 = 1e-4;

/// The reference and its reliability. Lengths are relative to the longest rod.
#[derive(Clone, Debug, Serialize)]
pub struct ReferenceSolution {
    /// Whether relaxation and shooting agree within their error estimates.
    pub confirmed: bool,
    /// A sentence: which solution it is, and why it is not confirmed.
    pub told: String,
    /// Accuracy of the reference: the smaller of both error estimates, or the difference
    /// of both solutions if that is larger and they agree. Smaller errors cannot be
    /// distinguished from zero.
    pub known_within: f64,
    /// Error estimate of the relaxation, if the leaf came to rest.
    pub relaxation_estimate: Option<f64>,
    /// Error estimate of the shooting, if it found a solution.
    pub shooting_estimate: Option<f64>,
    /// Largest distance between both.
    pub difference: Option<f64>,
    /// How the leaf can move without resistance, if it can: errors then include the
    /// position at which a run came to rest along that neutral direction.
    pub neutral: Option<String>,
}

/// The reference of a scenario, and what is told of it.
pub struct FoundReference {
    pub reference: ReferenceSolution,
    pub solution: MethodSolution,
}

/// Finds the reference of a scenario, at the `wanted` stations if shooting
/// succeeds. `None` if neither method finds an equilibrium.
///
/// # Errors
/// If the leaf cannot be relaxed at all.
pub fn find_reference(
    scenario: &Scenario,
    wanted: Vec<f64>,
) -> Result<Option<FoundReference>, RelaxError> {
    let relaxed = most_accurate_relaxation(scenario)?;
    let known = relaxed.iter().flat_map(|leaf| &leaf.stations);
    let ends = [0.0, 1.0].into_iter();
    let stations = union_of_stations(ends.chain(wanted).chain(known.copied()).collect());
    let start = relaxed
        .as_ref()
        .map_or(ShootingStart::Arcs, MethodSolution::shooting_start);
    let precision = shooting::RequiredPrecision::EstimatedError(SMALLEST_TOLERANCE);
    let options = shooting::ShootingOptions {
        gives_up: relaxed.is_some(),
        ..shooting::ShootingOptions::new(start, &stations, precision)
    };
    let solved = shooting::solve(scenario, &options, &mut |_| {});
    let neutral = match &solved {
        Ok(solution) => solution.neutral.as_ref().map(ToString::to_string),
        Err(_) => None,
    };
    let shot = solved
        .map(|solution| MethodSolution::from_shooting(scenario, solution, SMALLEST_TOLERANCE));
    let unit = longest(&scenario.rods);
    let estimate = |answer: &MethodSolution| answer.error_bound() / unit;
    let mut reference = ReferenceSolution {
        confirmed: false,
        told: String::new(),
        known_within: 0.0,
        relaxation_estimate: relaxed.as_ref().map(estimate),
        shooting_estimate: shot.as_ref().ok().map(estimate),
        difference: None,
        neutral,
    };
    let ChosenReference { told, solution } = match (relaxed, shot) {
        (Some(leaf), Ok(shot)) => {
            let distance = leaf.largest_distance(&shot);
            reference.difference = distance.map(|distance| distance / unit);
            reference.confirmed =
                distance.is_some_and(|apart| leaf.agrees_within_errors(&shot, apart));
            choose_reference(leaf, shot, reference.confirmed)
        }
        (Some(leaf), Err(failure)) => {
            let why = &failure.reason;
            let told = format!("the relaxed leaf: shooting does not confirm it, {why}");
            ChosenReference {
                told,
                solution: leaf,
            }
        }
        (None, Ok(shot)) => ChosenReference {
            told: "the boundary-value solution from arcs: the relaxation does not come to rest"
                .into(),
            solution: shot,
        },
        (None, Err(_)) => return Ok(None),
    };
    let estimates = [reference.relaxation_estimate, reference.shooting_estimate];
    let better = (estimates.into_iter().flatten()).fold(f64::INFINITY, f64::min);
    reference.told = told;
    reference.known_within = match reference.difference {
        Some(difference) if reference.confirmed => better.max(difference),
        _ => better,
    };
    Ok(Some(FoundReference {
        reference,
        solution,
    }))
}

/// The most accurate relaxation that comes to rest.
fn most_accurate_relaxation(scenario: &Scenario) -> Result<Option<MethodSolution>, RelaxError> {
    let at = |tolerance: f64| {
        let options = Options {
            tolerance: Some(tolerance),
            ..Options::default()
        };
        Ok(Some(MethodSolution::from_relaxation(scenario, &options)?)
            .filter(MethodSolution::is_at_rest))
    };
    let Some(first) = at(FIRST_REFERENCE_TOLERANCE)? else {
        return at(FALLBACK_REFERENCE_TOLERANCE);
    };
    if first.outcome == Outcome::ToleranceNotReached {
        return Ok(Some(first));
    }
    let better = at(SMALLEST_TOLERANCE)?;
    Ok(better
        .filter(|leaf| leaf.error_estimate <= first.error_estimate)
        .or(Some(first)))
}

/// The solution that is the reference, and a sentence on which it is.
struct ChosenReference {
    told: String,
    solution: MethodSolution,
}

/// The boundary-value solution, which is known at all stations, if both agree;
/// otherwise the one with the smaller error estimate.
fn choose_reference(
    leaf: MethodSolution,
    shot: MethodSolution,
    confirmed: bool,
) -> ChosenReference {
    let leaf_is_better = leaf.error_bound() < shot.error_bound();
    let told = match (confirmed, leaf_is_better) {
        (true, _) => "relaxation and shooting agree within their error estimates",
        (false, true) => "the relaxed leaf: shooting finds another shape",
        (false, false) => "the boundary-value solution: the relaxed leaf has another shape",
    };
    let takes_leaf = !confirmed && leaf_is_better;
    ChosenReference {
        told: told.into(),
        solution: if takes_leaf { leaf } else { shot },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_shape_does_not_confirm_and_the_better_is_taken() {
        let leaf = r#"
            name = "fan"
            leaf = { rods = 2, length = 2.0, fan = "symmetric" }
            stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = 100, shear_2 = 100, shear_3 = 100 }
            load = { gravity = [0.0, 0.0, -0.1] }
        "#;
        let scenario = Scenario::from_toml(leaf).unwrap();
        let relaxed = most_accurate_relaxation(&scenario).unwrap().unwrap();
        let found = find_reference(&scenario, Vec::new()).unwrap().unwrap();
        let mut elsewhere = found.solution;
        for node in elsewhere.rods.iter_mut().flat_map(|rod| &mut rod.nodes) {
            node.position.z += 1e-6;
        }
        for (error, is_taken) in [(1e-16, true), (1e-7, false)] {
            elsewhere.error_estimate = Some(error);
            let apart = relaxed.largest_distance(&elsewhere).unwrap();
            assert!(!relaxed.agrees_within_errors(&elsewhere, apart));
            let taken = choose_reference(relaxed.clone(), elsewhere.clone(), false).solution;
            assert_eq!(taken.rods == elsewhere.rods, is_taken);
        }
        // An estimate as large as the difference confirms little, but validly.
        elsewhere.error_estimate = Some(3e-6);
        assert!(relaxed.agrees_within_errors(&elsewhere, 1e-6));
    }
}
