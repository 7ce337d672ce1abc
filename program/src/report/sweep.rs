//! Leaves over a grid of numbers as text, and as rows of CSV.

use crate::report::document::ReportedResult;
use crate::report::numbers::{
    count_in_words, duration_text, format_five_digits, number_in_unit, round_to_error,
};
use crate::report::table::{LabelledLines, append_csv_rows, label_first_line, text_cell};
use leafdyn::scenario::Units;
use leafdyn::study::{ColumnValue, LeafColumn, LeafQuantity, ParameterSweep, Sweep, SweepRow};
use std::io;
use std::io::Write;

/// Most refused leaves whose messages are listed.
const MOST_REFUSALS_LISTED: usize = 3;

/// Exit statuses of single leaves, as in tables of several scenarios.
const AT_REST: i32 = 0;
const NOT_AT_REST: i32 = 1;
const REFUSED: i32 = 2;

/// A sweep, and the time that it took.
pub struct ReportedSweep<'s> {
    pub sweep: &'s Sweep,
    pub seconds: f64,
}

/// What varies, as lines of a report.
pub fn varied_lines(axes: &[ParameterSweep], units: &Units) -> LabelledLines {
    let line = |axis: &ParameterSweep| {
        let [from, to] = axis.ends().map(|value| axis.keys.text(value));
        let to = number_in_unit(to, units, axis.keys.dimension());
        let spacing = if axis.log { ", logarithmic" } else { "" };
        let count = axis.values.len();
        let text = format!("{} from {from} to {to}: {count} values{spacing}", axis.keys);
        ("vary", text)
    };
    axes.iter().map(line).collect()
}

impl ReportedResult for ReportedSweep<'_> {
    fn heading(&self) -> String {
        let request = &self.sweep.request;
        let leaves = count_in_words(request.leaves(), "leaf", "leaves");
        format!("{}: {leaves}", request.base.scenario().name)
    }

    fn report_lines(&self, units: &Units) -> LabelledLines {
        let sweep = self.sweep;
        let mut lines = varied_lines(&sweep.request.axes, units);
        let count = |of: fn(&SweepRow) -> bool| sweep.rows.iter().filter(|row| of(row)).count();
        let (at_rest, refused) = (count(|row| row.success), count(|row| row.refused));
        let mut found = format!(
            "{at_rest} of {} at rest within the tolerance",
            sweep.request.leaves()
        );
        let others = sweep.rows.len() - at_rest - refused;
        for (number, what) in [(others, "not"), (refused, "refused")] {
            if number > 0 {
                found += &format!(", {number} {what}");
            }
        }
        lines.push(("found", found));
        let extremes = sweep.shown().into_iter();
        let extremes = extremes.filter_map(|quantity| extremes_line(sweep, quantity, units));
        lines.extend(label_first_line("range", extremes));
        lines.extend(label_first_line("refused", refusal_lines(sweep)));
        lines
    }

    fn work_line(&self) -> Option<String> {
        Some(format!("{} in all", duration_text(self.seconds)))
    }
}

/// The smallest and the largest value of a quantity, and where they are.
fn extremes_line(sweep: &Sweep, quantity: LeafQuantity, units: &Units) -> Option<String> {
    let error_column = LeafColumn {
        quantity,
        is_error: true,
    };
    let errors = (sweep.request.columns.iter()).position(|column| *column == error_column);
    let known = sweep.rows.iter().filter_map(|row| {
        let value = sweep.number(row, quantity)?;
        let error = errors.and_then(|at| row.cells[at].as_ref()?.number());
        value
            .is_finite()
            .then_some((row, value, error.unwrap_or(0.0)))
    });
    let known: Vec<_> = known.collect();
    let by_value = |a: &&(&SweepRow, f64, f64), b: &&(&SweepRow, f64, f64)| a.1.total_cmp(&b.1);
    let (low, high) = (
        known.iter().min_by(by_value)?,
        known.iter().max_by(by_value)?,
    );
    let text = |(row, value, error): &(&SweepRow, f64, f64)| {
        let value = format_five_digits(round_to_error(*value, *error));
        let unit = match quantity {
            LeafQuantity::Frequency(_) => units.frequency(),
            _ => units.unit_name(quantity.dimension()),
        };
        let value = [value]
            .into_iter()
            .chain(unit)
            .collect::<Vec<_>>()
            .join(" ");
        format!("{value} at {}", sweep.request.texts(row.leaf).join(", "))
    };
    Some(format!("{quantity} from {} to {}", text(low), text(high)))
}

fn refusal_lines(sweep: &Sweep) -> Vec<String> {
    let refused: Vec<&SweepRow> = sweep.rows.iter().filter(|row| row.refused).collect();
    let remark = sweep.column(LeafQuantity::Remark);
    let line = |row: &&SweepRow| {
        let why = remark.and_then(|at| row.cells[at].as_ref());
        let why = why.map_or(String::new(), ToString::to_string);
        let why = why.split_whitespace().collect::<Vec<_>>().join(" ");
        format!("at {}: {why}", sweep.request.texts(row.leaf).join(", "))
    };
    let mut lines: Vec<String> = refused
        .iter()
        .take(MOST_REFUSALS_LISTED)
        .map(line)
        .collect();
    if refused.len() > MOST_REFUSALS_LISTED {
        let more = refused.len() - MOST_REFUSALS_LISTED;
        lines.push(format!("and {more} more: table.csv has all"));
    }
    lines
}

/// The exit status of a leaf, as if it were a scenario of its own.
pub fn row_status(row: &SweepRow) -> i32 {
    match (row.success, row.refused) {
        (true, _) => AT_REST,
        (_, true) => REFUSED,
        _ => NOT_AT_REST,
    }
}

/// `table.csv`: a row a leaf.
pub fn write_sweep_table(sweep: &Sweep, out: &mut dyn Write) -> io::Result<()> {
    let request = &sweep.request;
    let keys = request.axes.iter().map(|axis| axis.keys.to_string());
    let columns = request.columns.iter().map(ToString::to_string);
    let header = keys.chain(["exit_status".into()]).chain(columns);
    append_csv_rows([header.collect::<Vec<String>>()], out)?;
    let rows = sweep.rows.iter().map(|row| {
        let values = request.texts(row.leaf).into_iter();
        let cells = row
            .cells
            .iter()
            .map(|cell| cell.as_ref().map_or(String::new(), cell_text));
        let status = row_status(row).to_string();
        values.chain([status]).chain(cells).collect::<Vec<String>>()
    });
    append_csv_rows(rows, out)
}

/// A cell on one line; a text is in words of the user, too.
fn cell_text(value: &ColumnValue) -> String {
    match value {
        ColumnValue::Text(text) => {
            let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
            text_cell(&line).into()
        }
        number => number.to_string(),
    }
}
