//! The text report of a fit, and its table.

use std::io::{self, Write};

use crate::study::{Fit, FitOutcome, FitParameter};

use super::numbers::{brief, seconds};
use super::table::{Lines, labelled, lay_out};

/// Most candidates that are listed.
const CANDIDATES: usize = 5;

/// The fitted numbers and how well the data determine them.
pub fn report(fit: &Fit, files: Option<String>) -> String {
    let found = match fit.outcome {
        FitOutcome::Converged => "a minimum; the data determine every free number",
        FitOutcome::Undetermined => "a minimum; the data do not determine every free number",
        FitOutcome::NotConverged => "no minimum",
    };
    let mut lines: Lines = vec![("found", found.into())];
    let numbers = fit.parameters.iter().map(number);
    lines.extend(labelled("numbers", numbers.collect()));
    lines.extend(labelled("data say", fit.says.clone()));
    let (count, freedom) = (fit.residuals.len(), fit.degrees_of_freedom);
    let misfit = match fit.standard_deviation {
        Some(sd) => format!("standard deviation {}", brief(sd)),
        None => format!("chi squared {}", brief(fit.chi_squared)),
    };
    let misfit = format!("{misfit} over {count} data, {freedom} degrees of freedom");
    lines.push(("misfit", misfit));
    let candidates = fit.candidates.iter().take(CANDIDATES).map(|candidate| {
        let (bits, part) = (candidate.bits, candidate.shrinks);
        let text = match &candidate.remark {
            Some(remark) => remark.clone(),
            None => format!("{bits:.1} bits; what is least known shrinks to {part:.2} of it"),
        };
        format!("{}: {text}", candidate.experiment)
    });
    lines.extend(labelled("measure", candidates.collect()));
    let time = seconds(fit.wall_seconds);
    let evaluations = fit.work.evaluations;
    let work = format!("all leaves brought to rest {evaluations} times in {time}");
    lines.push(("work", work));
    lines.extend(files.map(|files| ("written", files)));
    lines.extend(labelled("remark", fit.remarks.clone()));
    let (name, numbers) = (&fit.scenario, fit.parameters.len());
    let heading = format!("{name}: fit of {numbers} numbers to {count} data");
    lay_out(&heading, &lines)
}

fn number(parameter: &FitParameter) -> String {
    let end = |end: Option<f64>| end.map_or("?".into(), brief);
    let (low, high) = (end(parameter.low), end(parameter.high));
    let key = &parameter.key;
    match parameter.determined {
        true => format!("{key} = {} (95 %: {low} to {high})", brief(parameter.value)),
        false => format!("{key} not determined (95 %: {low} to {high})"),
    }
}

/// `fit.csv`: one row per datum.
pub fn table(fit: &Fit, out: &mut dyn Write) -> io::Result<()> {
    let mut table = csv::Writer::from_writer(out);
    for residual in &fit.residuals {
        table.serialize(residual)?;
    }
    table.flush()
}

/// `fitted.toml`: the scenario with the fitted values.
pub fn fitted(fit: &Fit, out: &mut dyn Write) -> io::Result<()> {
    out.write_all(fit.fitted.as_bytes())
}
