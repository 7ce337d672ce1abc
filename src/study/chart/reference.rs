//! The solution that all others are measured against.

use serde::Serialize;

use crate::bvp::{self, Start};
use crate::relax::{Options, Outcome, RelaxError, SMALLEST_TOLERANCE};
use crate::scenario::Scenario;
use crate::study::judge::{Answer, longest, union};

/// Tolerances of the relaxation: first one that most leaves reach, then the
/// best, or else one that asks for fewer grids to come to rest on.
const FIRST: f64 = 1e-10;
const LARGER: f64 = 1e-4;

/// The reference, and how far it can be trusted. Lengths are relative to the
/// longest rod.
#[derive(Clone, Debug, Serialize)]
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
    pub relaxation_estimate: Option<f64>,
    /// Error estimate of the shooting, if it found a solution.
    pub shooting_estimate: Option<f64>,
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
) -> Result<Option<(Reference, Answer)>, RelaxError> {
    let relaxed = best_relaxed(scenario)?;
    let known = relaxed.iter().flat_map(|leaf| &leaf.stations);
    let stations = union(wanted.into_iter().chain(known.copied()).collect());
    let start = relaxed.as_ref().map_or(Start::Arcs, Answer::as_start);
    let solved = bvp::solve_within(scenario, start, SMALLEST_TOLERANCE, None, &stations);
    let neutral = match &solved {
        Ok(solution) => solution.neutral.as_ref().map(ToString::to_string),
        Err(_) => None,
    };
    let shot = solved.map(|solution| Answer::of_solution(scenario, solution, SMALLEST_TOLERANCE));
    let unit = longest(scenario);
    Ok(match (relaxed, shot) {
        (Some(leaf), Ok(shot)) => {
            let (reference, answer) = both(leaf, shot, unit);
            Some((
                Reference {
                    neutral,
                    ..reference
                },
                answer,
            ))
        }
        (Some(leaf), Err(failure)) => {
            let estimate = leaf.error() / unit;
            let reference = Reference {
                confirmed: false,
                told: format!(
                    "the relaxed leaf: shooting does not confirm it, {}",
                    failure.reason
                ),
                known_within: estimate,
                relaxation_estimate: Some(estimate),
                shooting_estimate: None,
                difference: None,
                neutral,
            };
            Some((reference, leaf))
        }
        (None, Ok(shot)) => {
            let estimate = shot.error() / unit;
            let reference = Reference {
                confirmed: false,
                told: "the boundary-value solution from arcs: the relaxation does not come to rest"
                    .into(),
                known_within: estimate,
                relaxation_estimate: None,
                shooting_estimate: Some(estimate),
                difference: None,
                neutral,
            };
            Some((reference, shot))
        }
        (None, Err(_)) => None,
    })
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
/// otherwise the one that claims to be better.
fn both(leaf: Answer, shot: Answer, unit: f64) -> (Reference, Answer) {
    let [relaxation, shooting] = [&leaf, &shot].map(|answer| answer.error() / unit);
    let distance = leaf.distance(&shot);
    let confirmed = distance.is_some_and(|distance| leaf.confirms(&shot, distance));
    let difference = distance.map(|distance| distance / unit);
    let better = relaxation.min(shooting);
    let told = match (confirmed, relaxation < shooting) {
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
        relaxation_estimate: Some(relaxation),
        shooting_estimate: Some(shooting),
        difference,
        neutral: None,
    };
    match confirmed || shooting <= relaxation {
        true => (reference, shot),
        false => (reference, leaf),
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
        let relaxed = best_relaxed(&scenario).unwrap().unwrap();
        let (reference, mut elsewhere) = find(&scenario, Vec::new()).unwrap().unwrap();
        assert!(reference.confirmed, "{}", reference.told);
        assert!(reference.known_within < 1e-11);
        for rod in &mut elsewhere.rods {
            for node in &mut rod.nodes {
                node.position.z += 1e-6;
            }
        }
        for (error, shot_is_better) in [(1e-16, true), (1e-7, false)] {
            elsewhere.error_estimate = Some(error);
            let (reference, taken) = both(relaxed.clone(), elsewhere.clone(), 2.0);
            assert!(!reference.confirmed);
            assert_eq!(taken.rods == elsewhere.rods, shot_is_better);
        }
        // An estimate that is as large as the difference confirms little, but
        // truly.
        elsewhere.error_estimate = Some(3e-6);
        assert!(both(relaxed, elsewhere, 2.0).0.confirmed);
    }
}
