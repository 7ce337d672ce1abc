//! The solution against which all others are measured.

use serde::Serialize;

use crate::relax::{Options, Outcome, RelaxError, SMALLEST_TOLERANCE};
use crate::scenario::{Scenario, longest};
use crate::shooting;
use crate::shooting::Start;
use crate::study::judge::{Answer, union};

/// Tolerances of the relaxation: first one that most leaves reach, then the
/// best one, or else one that requires fewer grids.
const FIRST: f64 = 1e-10;
const LARGER: f64 = 1e-4;

/// The reference and its reliability. Lengths are relative to the longest rod.
#[derive(Clone, Debug, Serialize)]
pub struct Reference {
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

/// Finds the reference of a scenario, at the `wanted` stations if shooting
/// succeeds. `None` if neither method finds an equilibrium.
///
/// # Errors
/// If the leaf cannot be relaxed at all.
pub fn find(
    scenario: &Scenario,
    wanted: Vec<f64>,
) -> Result<Option<(Reference, Answer)>, RelaxError> {
    let relaxed = best_relaxed(scenario)?;
    let known = relaxed.iter().flat_map(|leaf| &leaf.stations);
    let ends = [0.0, 1.0].into_iter();
    let stations = union(ends.chain(wanted).chain(known.copied()).collect());
    let start = relaxed.as_ref().map_or(Start::Arcs, Answer::as_start);
    let precision = shooting::Precision::Error(SMALLEST_TOLERANCE);
    let options = shooting::Options::new(start, &stations, precision);
    let solved = shooting::solve(scenario, &options, &mut |_| {});
    let neutral = match &solved {
        Ok(solution) => solution.neutral.as_ref().map(ToString::to_string),
        Err(_) => None,
    };
    let shot = solved.map(|solution| Answer::of_solution(scenario, solution, SMALLEST_TOLERANCE));
    let unit = longest(&scenario.rods);
    let estimate = |answer: &Answer| answer.error() / unit;
    let mut reference = Reference {
        confirmed: false,
        told: String::new(),
        known_within: 0.0,
        relaxation_estimate: relaxed.as_ref().map(estimate),
        shooting_estimate: shot.as_ref().ok().map(estimate),
        difference: None,
        neutral,
    };
    let (told, answer) = match (relaxed, shot) {
        (Some(leaf), Ok(shot)) => {
            let distance = leaf.distance(&shot);
            reference.difference = distance.map(|distance| distance / unit);
            reference.confirmed = distance.is_some_and(|apart| leaf.confirms(&shot, apart));
            choose(leaf, shot, reference.confirmed)
        }
        (Some(leaf), Err(failure)) => {
            let why = &failure.reason;
            let told = format!("the relaxed leaf: shooting does not confirm it, {why}");
            (told, leaf)
        }
        (None, Ok(shot)) => (
            "the boundary-value solution from arcs: the relaxation does not come to rest".into(),
            shot,
        ),
        (None, Err(_)) => return Ok(None),
    };
    let estimates = [reference.relaxation_estimate, reference.shooting_estimate];
    let better = (estimates.into_iter().flatten()).fold(f64::INFINITY, f64::min);
    reference.told = told;
    reference.known_within = match reference.difference {
        Some(difference) if reference.confirmed => better.max(difference),
        _ => better,
    };
    Ok(Some((reference, answer)))
}

/// The most accurate relaxation that comes to rest.
fn best_relaxed(scenario: &Scenario) -> Result<Option<Answer>, RelaxError> {
    let at = |tolerance: f64| {
        let options = Options {
            tolerance: Some(tolerance),
            ..Options::default()
        };
        Ok(Some(Answer::relaxed(scenario, &options)?).filter(Answer::at_rest))
    };
    let Some(first) = at(FIRST)? else {
        return at(LARGER);
    };
    if first.outcome == Outcome::ToleranceNotReached {
        return Ok(Some(first));
    }
    let better = at(SMALLEST_TOLERANCE)?;
    Ok(better
        .filter(|leaf| leaf.error_estimate <= first.error_estimate)
        .or(Some(first)))
}

/// The boundary-value solution, which is known at all stations, if both agree;
/// otherwise the one with the smaller error estimate.
fn choose(leaf: Answer, shot: Answer, confirmed: bool) -> (String, Answer) {
    let leaf_is_better = leaf.error() < shot.error();
    let told = match (confirmed, leaf_is_better) {
        (true, _) => "relaxation and shooting agree within their error estimates",
        (false, true) => "the relaxed leaf: shooting finds another shape",
        (false, false) => "the boundary-value solution: the relaxed leaf has another shape",
    };
    let takes_leaf = !confirmed && leaf_is_better;
    (told.into(), if takes_leaf { leaf } else { shot })
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
        let relaxed = best_relaxed(&scenario).unwrap().unwrap();
        let (_, mut elsewhere) = find(&scenario, Vec::new()).unwrap().unwrap();
        for node in elsewhere.rods.iter_mut().flat_map(|rod| &mut rod.nodes) {
            node.position.z += 1e-6;
        }
        for (error, is_taken) in [(1e-16, true), (1e-7, false)] {
            elsewhere.error_estimate = Some(error);
            let apart = relaxed.distance(&elsewhere).unwrap();
            assert!(!relaxed.confirms(&elsewhere, apart));
            let (_, taken) = choose(relaxed.clone(), elsewhere.clone(), false);
            assert_eq!(taken.rods == elsewhere.rods, is_taken);
        }
        // An estimate as large as the difference confirms little, but validly.
        elsewhere.error_estimate = Some(3e-6);
        assert!(relaxed.confirms(&elsewhere, 1e-6));
    }
}
