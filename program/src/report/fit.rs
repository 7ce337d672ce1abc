//! The text report of a fit, and its table.

use crate::report::Reported;
use crate::report::numbers::{brief, counted, in_unit_of_key, rounded_to, seconds};
use crate::report::table::{Lines, labelled, text_cell};
use leafdyn::scenario::Units;
use leafdyn::study::{DataFile, Fit, FitOutcome, FitParameter, FitResidual};
use std::io;
use std::io::Write;
use std::path::Path;

/// Most candidates that are listed.
const CANDIDATES: usize = 5;

impl Reported for Fit {
    fn heading(&self) -> String {
        let (name, count) = (&self.scenario, self.residuals.len());
        let numbers = counted(self.parameters.len(), "number", "numbers");
        format!("{name}: fit of {numbers} to {count} data")
    }

    fn lines(&self, units: &Units) -> Lines {
        let found = match self.outcome {
            FitOutcome::Converged => "a minimum; the data determine every free number",
            FitOutcome::Undetermined => "a minimum; the data do not determine every free number",
            FitOutcome::Systematic => {
                "a minimum, at which the residuals are systematic: the model lacks something"
            }
            FitOutcome::Contradicted => "a minimum, at which the data contradict the model",
            FitOutcome::NotConverged => "no minimum",
        };
        let mut lines: Lines = vec![("found", found.into())];
        lines.extend(labelled(
            "numbers",
            (self.parameters.iter()).map(|it| number(it, self.outcome, units)),
        ));
        lines.extend(labelled("data say", self.says.clone()));
        lines.extend(labelled("data", self.files.iter().map(read)));
        let (count, freedom) = (self.residuals.len(), self.degrees_of_freedom);
        let misfit = match self.standard_deviation {
            Some(sd) => format!("standard deviation {}", brief(sd)),
            None => format!("chi squared {}", brief(self.chi_squared)),
        };
        let misfit = format!("{misfit} over {count} data, {freedom} degrees of freedom");
        lines.push(("misfit", misfit));
        let candidates = self.candidates.iter().take(CANDIDATES).map(|candidate| {
            let (bits, part) = (candidate.bits, candidate.shrinks);
            let text = match &candidate.remark {
                Some(remark) => remark.clone(),
                None => format!("{bits:.1} bits; what is least known shrinks to {part:.2} of it"),
            };
            format!("{}: {text}", candidate.experiment)
        });
        lines.extend(labelled("measure", candidates));
        lines
    }

    fn work(&self) -> Option<String> {
        let (evaluations, time) = (self.work.evaluations, seconds(self.wall_seconds));
        Some(format!(
            "all leaves brought to rest {evaluations} times in {time}"
        ))
    }

    fn remarks(&self) -> Lines {
        labelled("remark", self.remarks.clone())
    }
}

/// One line on what a file was read as.
fn read(file: &DataFile) -> String {
    let name = Path::new(&file.file).file_name();
    let name = name.map_or(file.file.as_str().into(), |name| name.to_string_lossy());
    let rows = counted(file.rows, "row", "rows");
    let left_out = match file.left_out.as_slice() {
        [] => None,
        left_out => Some(format!("left out: {}", left_out.join(", "))),
    };
    let said = file.taken.iter().cloned().chain(left_out);
    let said: Vec<String> = [format!("{name}: {rows}")]
        .into_iter()
        .chain(said)
        .collect();
    said.join("; ")
}

fn number(parameter: &FitParameter, outcome: FitOutcome, units: &Units) -> String {
    // The interval has two digits.
    let error = match (parameter.low, parameter.high) {
        (Some(low), Some(high)) => 0.05 * (high - low),
        _ => 0.0,
    };
    let digits = |value: f64| brief(rounded_to(value, error));
    let key = &parameter.key;
    let percent = match outcome {
        FitOutcome::Systematic => "95 %, widened",
        _ => "95 %",
    };
    let bounds = match (parameter.low.map(digits), parameter.high.map(digits)) {
        (Some(low), Some(high)) => format!("{percent}: {low} to {high}"),
        (Some(low), None) => format!("{percent}: at least {low}"),
        (None, Some(high)) => format!("{percent}: at most {high}"),
        (None, None) => "no bounds".into(),
    };
    let widened =
        outcome == FitOutcome::Systematic && parameter.low.is_some() && parameter.high.is_some();
    match parameter.determined || widened {
        true => {
            let value = in_unit_of_key(digits(parameter.value), units, key);
            format!("{key} = {value} ({bounds})")
        }
        false => format!("{key} is not determined ({bounds})"),
    }
}

/// `fit.csv`: one row per datum.
pub fn table(fit: &Fit, out: &mut dyn Write) -> io::Result<()> {
    let mut table = csv::Writer::from_writer(out);
    for residual in &fit.residuals {
        let experiment = text_cell(&residual.experiment).into();
        table.serialize(FitResidual {
            experiment,
            ..residual.clone()
        })?;
    }
    table.flush()
}

/// `fitted.toml`: the scenario with the fitted values.
pub fn fitted(fit: &Fit, out: &mut dyn Write) -> io::Result<()> {
    out.write_all(fit.fitted.as_bytes())
}
