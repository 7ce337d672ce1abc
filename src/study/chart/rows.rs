//! Rows of a chart from the results of runs: true errors, and runs that ended in another
//! equilibrium.

use super::plan::Contender;
use super::reference::Reference;
use super::run::Runs;
use super::timing::Spread;
use super::{Ending, Row};
use crate::relax::{Method, Outcome};
use crate::scenario::longest;
use crate::study::judge::{Answer, common};

/// Errors above this are not due to discretisation if the run's own estimate is
/// less than half as large: it is another equilibrium.
const ELSEWHERE: f64 = 1e-2;
const MUCH_LESS: f64 = 0.5;

/// Stations required of the reference: those of all runs, so that
/// nothing has to be interpolated. The stations of runs on one grid are usually among those of
/// the others; only those that are not are added.
pub fn stations(all: &[Runs]) -> Vec<f64> {
    let runs = || all.iter().filter_map(Runs::answer);
    let Some(fewest) = runs().min_by_key(|run| run.stations.len()) else {
        return Vec::new();
    };
    let mut wanted = fewest.stations.clone();
    for run in runs() {
        if common(&run.stations, &fewest.stations).len() < fewest.stations.len() {
            wanted.extend(&run.stations);
        }
    }
    wanted
}

/// The rows of one leaf.
pub fn rows(all: &[Runs], reference: Option<&Answer>) -> Vec<Row> {
    let errors: Vec<Option<f64>> = all.iter().map(|runs| runs.error(reference)).collect();
    let row = |i: usize| row(&all[i], errors[i], is_elsewhere(i, all, &errors));
    (0..all.len()).map(row).collect()
}

/// Whether the error of a run is due to another equilibrium.
fn is_elsewhere(i: usize, all: &[Runs], errors: &[Option<f64>]) -> bool {
    let this = &all[i];
    let (Some(answer), Some(error)) = (this.at_rest(), errors[i]) else {
        return false;
    };
    if error <= ELSEWHERE {
        return false;
    }
    let unit = longest(&this.scenario.rods);
    if !this.contender.one_grid {
        let estimate = answer.error_estimate.map(|estimate| estimate / unit);
        return estimate.is_some_and(|estimate| estimate < MUCH_LESS * error);
    }
    // On one grid, without an error estimate: if a coarser grid is much more accurate,
    // or the next grid has nearly the same shape.
    let alike = |other: &usize| all[*other].contender == this.contender;
    let mut coarser = (0..i).filter(alike);
    if coarser.any(|it| errors[it].is_some_and(|there| there < MUCH_LESS * error)) {
        return true;
    }
    let at_rest = |other: usize| all[other].at_rest();
    let finer = (i + 1..all.len()).find(alike).and_then(at_rest);
    let next = finer.or_else(|| (0..i).rfind(alike).and_then(at_rest));
    let apart = next.and_then(|next| answer.distance(next));
    apart.is_some_and(|apart| apart / unit < MUCH_LESS * error)
}

fn row(runs: &Runs, error: Option<f64>, elsewhere: bool) -> Row {
    let blank = Row {
        seconds: Spread::of(&runs.seconds),
        ..Row::without_result(runs.contender, runs.knob, Ending::NotRun)
    };
    let run = match &runs.found {
        None => return blank,
        Some(Err(refusal)) => {
            return Row {
                ending: Ending::Refused,
                remark: Some(refusal.to_string()),
                ..blank
            };
        }
        Some(Ok(run)) => run,
    };
    let ending = match run.outcome {
        Outcome::Saddle => Ending::Ended(Outcome::Saddle),
        _ if elsewhere => Ending::OtherEquilibrium,
        outcome => Ending::Ended(outcome),
    };
    let unit = longest(&runs.scenario.rods);
    Row {
        steps: Some(run.work.steps),
        factorizations: Some(run.work.factorizations),
        force_evaluations: Some(run.work.force_evaluations),
        true_error: error,
        error_estimate: run.error_estimate.map(|estimate| estimate / unit),
        ending,
        // An unknown number of negative eigenvalues is not a failure.
        remark: run.remark.clone().filter(|_| !ending.is_success()),
        ..blank
    }
}

/// Remarks on these rows and their reference.
pub fn remarks(
    rows: &[Row],
    contenders: &[Contender],
    reference: Option<&Reference>,
) -> Vec<String> {
    let floor = reference.map_or(0.0, |found| found.known_within);
    let neutral = reference.and_then(|found| found.neutral.as_ref());
    let mut remarks = Vec::new();
    let mut methods = contenders.iter().map(|contender| contender.method);
    if methods.any(|method| matches!(method, Method::Explicit { .. })) {
        let step = "it takes the longest stable one";
        remarks.push(format!(
            "explicit relaxation has no knob for its time step: {step}"
        ));
    }
    if let Some(neutral) = neutral {
        remarks.push(format!(
            "errors tell little: {neutral}, and runs come to rest in different places"
        ));
    }
    for &contender in contenders {
        remarks.extend(remarks_on(contender, rows, floor, neutral.is_some()));
    }
    remarks
}

fn remarks_on(contender: Contender, rows: &[Row], floor: f64, neutral: bool) -> Vec<String> {
    let mut remarks = Vec::new();
    let of_it = || rows.iter().filter(|row| row.contender == contender);
    let word = contender.word();
    if of_it().all(|row| row.ending == Ending::Refused)
        && let Some(why) = of_it().find_map(|row| row.remark.as_ref())
    {
        remarks.push(format!("{word} is not charted: {why}"));
    }
    if let Some(first) = of_it().find(|row| row.ending == Ending::NotRun) {
        let why = "the run before took too long; allow more seconds";
        remarks.push(format!("{word} is not run from {} on: {why}", first.knob));
    }
    // Estimates that are smaller than the true error are reported here.
    let too_small = |row: &&Row| {
        let estimate = row.error_estimate.unwrap_or(f64::INFINITY).max(floor);
        row.ending.is_success() && row.true_error.is_some_and(|error| error > estimate)
    };
    let knobs = of_it().filter(too_small).map(|row| row.knob.to_string());
    let knobs: Vec<String> = knobs.collect();
    if !knobs.is_empty() && !neutral {
        let knobs = knobs.join(", ");
        remarks.push(format!("{word} underestimates its error at {knobs}"));
    }
    remarks
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scenario::Scenario;
    use crate::study::judge::tests::rod;

    const STATIONS: [f64; 3] = [0.0, 0.5, 1.0];

    fn scenario() -> Scenario {
        let leaf = r#"
            name = "cantilever"
            leaf = { rods = 1, length = 2.0, fan = [0.0] }
            stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = 100, shear_2 = 100, shear_3 = 100 }
        "#;
        Scenario::from_toml(leaf).unwrap()
    }

    /// Straight but for a shift of its tip; the estimate is relative to the length
    /// of 2.
    fn answer(outcome: Outcome, shift: f64, estimate: Option<f64>) -> Answer {
        Answer {
            outcome,
            remark: Some("why".into()),
            error_estimate: estimate.map(|estimate| 2.0 * estimate),
            ..rod(&STATIONS, 2.0, |sigma| {
                DVec3::new(2.0 * sigma, 0.0, shift * sigma)
            })
        }
    }

    type Found = Option<Result<Answer, crate::relax::RelaxError>>;

    fn found(outcome: Outcome, shift: f64, estimate: Option<f64>) -> Found {
        Some(Ok(answer(outcome, shift, estimate)))
    }

    /// The runs of a contender with these results at its first settings.
    fn runs(scenario: &Scenario, contender: Contender, found: Vec<Found>) -> Vec<Runs<'_>> {
        let runs = contender.knobs().into_iter().zip(found);
        runs.map(|(knob, found)| Runs {
            found,
            seconds: vec![1.0],
            ..Runs::new(scenario, contender, knob)
        })
        .collect()
    }

    /// Their rows, and those of its other settings, which are not run.
    fn judged(contender: &str, found: Vec<Found>) -> Vec<Row> {
        let (scenario, contender) = (scenario(), contender.parse::<Contender>().unwrap());
        let mut runs = runs(&scenario, contender, found);
        let rest = contender.knobs().into_iter().skip(runs.len());
        runs.extend(rest.map(|knob| Runs::new(&scenario, contender, knob)));
        rows(&runs, Some(&answer(Outcome::Converged, 0.0, None)))
    }

    fn words(rows: &[Row]) -> Vec<&'static str> {
        rows.iter().map(|row| row.ending.word()).collect()
    }

    #[test]
    fn errors_are_relative_and_what_ends_elsewhere_is_no_success() {
        let rows = judged(
            "shooting",
            vec![
                found(Outcome::Converged, 2e-4, Some(3e-4)),
                found(Outcome::Converged, 0.5, Some(1e-3)),
                found(Outcome::Saddle, 0.5, Some(1e-3)),
                found(Outcome::NotAtRest, 0.5, None),
                found(Outcome::Converged, 0.03, Some(1e-2)),
            ],
        );
        let wanted = ["converged", "other-equilibrium", "saddle", "not-at-rest"];
        assert_eq!(words(&rows)[..4], wanted);
        assert_eq!(words(&rows)[4..6], ["converged", "not-run"]);
        assert_eq!(rows[0].point(), Some((1.0, 1e-4)));
        assert_eq!(rows[0].error_estimate, Some(3e-4));
        assert_eq!((rows[1].true_error, rows[3].true_error), (Some(0.25), None));
        // Remarks are for failures.
        assert_eq!(rows[0].remark, None);
        assert_eq!(rows[3].remark.as_deref(), Some("why"));
    }

    /// A coarse grid may have a large error because it is coarse, unless the next grid has
    /// the same one.
    #[test]
    fn a_coarse_grid_is_not_called_another_equilibrium() {
        let elsewhere = |shifts: &[f64]| -> Vec<bool> {
            let at = |shift: &f64| found(Outcome::Converged, *shift, None);
            let rows = judged("semi-implicit-grid", shifts.iter().map(at).collect());
            let rows = rows.iter().take(shifts.len());
            rows.map(|row| row.ending == Ending::OtherEquilibrium)
                .collect()
        };
        assert_eq!(elsewhere(&[1.6, 0.4, 0.1, 0.025]), [false; 4]);
        assert_eq!(elsewhere(&[0.52, 0.51, 0.505]), [true; 3]);
        let astray = elsewhere(&[0.4, 0.1, 0.5, 6e-3]);
        assert_eq!(astray, [false, false, true, false]);
    }

    #[test]
    fn underestimates_are_told() {
        let told = [(2e-4, 1e-5), (2e-12, 1e-15)];
        let told = told.map(|(shift, told)| found(Outcome::Converged, shift, Some(told)));
        let rows = judged("semi-implicit", told.into());
        let mut reference = Reference {
            confirmed: true,
            told: String::new(),
            known_within: 1e-11,
            relaxation_estimate: None,
            shooting_estimate: None,
            difference: None,
            neutral: None,
        };
        let contenders = [Contender::ALL[0]];
        let told = remarks(&rows, &contenders, Some(&reference));
        assert!(told[0].starts_with("semi-implicit is not run from tolerance=1e-3 on"));
        let wrong = "semi-implicit underestimates its error at tolerance=1e-1";
        assert_eq!(told[1..], [wrong]);
        // Along a neutral direction no estimate can be wrong.
        reference.neutral = Some("the leaf can move".into());
        let told = remarks(&rows, &contenders, Some(&reference));
        assert!(told[0].starts_with("errors tell little: the leaf can move"));
        assert_eq!(told.len(), 2, "{told:?}");
    }

    #[test]
    fn the_reference_is_wanted_where_a_run_has_stations_of_its_own() {
        let scenario = scenario();
        let with = |stations: &[f64]| {
            let run = Answer {
                stations: stations.to_vec(),
                ..answer(Outcome::Converged, 0.0, None)
            };
            let contender = Contender::ALL[0];
            Runs {
                found: Some(Ok(run)),
                ..Runs::new(&scenario, contender, contender.knobs()[0])
            }
        };
        let nested = [with(&[0.0, 0.25, 0.5, 0.75, 1.0]), with(&STATIONS)];
        assert_eq!(stations(&nested), STATIONS);
        let other = [with(&[0.0, 0.3, 0.6, 1.0]), with(&STATIONS)];
        assert_eq!(stations(&other), [0.0, 0.5, 1.0, 0.0, 0.3, 0.6, 1.0]);
        assert!(stations(&[]).is_empty());
    }
}
