//! The text report of a fit, and its table.

use crate::report::document::ReportedResult;
use crate::report::numbers::{
    count_in_words, duration_text, format_five_digits, number_in_key_unit, round_to_error,
};
use crate::report::table::{LabelledLines, label_first_line, text_cell};
use leafdyn::scenario::Units;
use leafdyn::study::{DataFile, Fit, FitOutcome, FitParameter, FitResidual};
use std::io;
use std::io::Write;
use std::path::Path;

const MOST_CANDIDATES_LISTED: usize = 5;

impl ReportedResult for Fit {
    fn heading(&self) -> String {
        let (name, count) = (&self.scenario, self.residuals.len());
        let numbers = count_in_words(self.parameters.len(), "number", "numbers");
        format!("{name}: fit of {numbers} to {count} data")
    }

    fn report_lines(&self, units: &Units) -> LabelledLines {
        let found = match self.outcome {
            FitOutcome::Converged if self.parameters.iter().any(hardly_determined) => {
                "a minimum; the data determine every free number within a factor of ten, but not within two"
            }
            FitOutcome::Converged => "a minimum; the data determine every free number",
            FitOutcome::Undetermined => "a minimum; the data do not determine every free number",
            FitOutcome::Systematic => {
                "a minimum, at which the residuals are systematic: the model lacks something"
            }
            FitOutcome::Contradicted => "a minimum, at which the data contradict the model",
            FitOutcome::NotConverged => "no minimum",
        };
        let mut lines: LabelledLines = vec![("found", found.into())];
        lines.extend(label_first_line(
            "numbers",
            (self.parameters.iter()).map(|it| parameter_line(it, self.outcome, units)),
        ));
        lines.extend(label_first_line("data say", self.says.clone()));
        lines.extend(label_first_line(
            "data",
            self.files.iter().map(data_file_line),
        ));
        let (count, freedom) = (self.residuals.len(), self.degrees_of_freedom);
        let misfit = match self.standard_deviation {
            Some(sd) => format!("standard deviation {}", format_five_digits(sd)),
            None => format!("chi squared {}", format_five_digits(self.chi_squared)),
        };
        let misfit = format!("{misfit} over {count} data, {freedom} degrees of freedom");
        lines.push(("misfit", misfit));
        let candidates = self
            .candidates
            .iter()
            .take(MOST_CANDIDATES_LISTED)
            .map(|candidate| {
                let (bits, part) = (candidate.bits, candidate.shrinks);
                let text = match &candidate.remark {
                    Some(remark) => remark.to_string(),
                    None => {
                        format!("{bits:.1} bits; what is least known shrinks to {part:.2} of it")
                    }
                };
                format!("{}: {text}", candidate.experiment)
            });
        lines.extend(label_first_line("measure", candidates));
        lines
    }

    fn work_line(&self) -> Option<String> {
        let (evaluations, time) = (self.work.evaluations, duration_text(self.wall_seconds));
        Some(format!(
            "all leaves brought to rest {evaluations} times in {time}"
        ))
    }

    fn remarks(&self) -> LabelledLines {
        label_first_line("remark", self.remarks.iter().map(ToString::to_string))
    }
}

/// A line on what a file of data was read as.
fn data_file_line(file: &DataFile) -> String {
    let name = Path::new(&file.file).file_name();
    let name = name.map_or(file.file.as_str().into(), |name| name.to_string_lossy());
    let rows = count_in_words(file.rows, "row", "rows");
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

/// Whether the ends of the interval of a number that is determined are more than a factor of four apart.
fn hardly_determined(parameter: &FitParameter) -> bool {
    let ends = parameter.low.zip(parameter.high);
    ends.is_some_and(|(low, high)| low > 0.0 && high > 4.0 * low)
}

fn parameter_line(parameter: &FitParameter, outcome: FitOutcome, units: &Units) -> String {
    // The interval has two digits.
    let error = match (parameter.low, parameter.high) {
        (Some(low), Some(high)) => 0.05 * (high - low),
        _ => 0.0,
    };
    let digits = |value: f64| format_five_digits(round_to_error(value, error));
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
            let value = number_in_key_unit(digits(parameter.value), units, key);
            format!("{key} = {value} ({bounds})")
        }
        false => format!("{key} is not determined ({bounds})"),
    }
}

/// `fit.csv`: one row per datum.
pub fn write_fit_table(fit: &Fit, out: &mut dyn Write) -> io::Result<()> {
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
pub fn write_fitted_scenario(fit: &Fit, out: &mut dyn Write) -> io::Result<()> {
    out.write_all(fit.fitted.as_bytes())
}
