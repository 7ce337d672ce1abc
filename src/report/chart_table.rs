//! `chart.csv` and `chart_rods.csv`: one row per measurement, for spreadsheets
//! and scripts. `chart.json` has the same values under the same names.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::Value;

use crate::study::{Chart, Scaling};

/// Names of the columns of both files; `chart.csv` lacks the first, `chart_rods.csv`
/// the last.
const COLUMNS: [&str; 15] = [
    "rods",
    "method",
    "knob",
    "seconds",
    "seconds_min",
    "seconds_q1",
    "seconds_q3",
    "runs",
    "steps",
    "factorizations",
    "force_evaluations",
    "true_error",
    "error_estimate",
    "outcome",
    "pareto",
];

/// `chart.csv`: one row per contender and setting, then those of the peers.
pub fn chart_table(chart: &Chart, out: &mut dyn Write) -> io::Result<()> {
    let rows = chart.rows.iter().map(object);
    let peers = chart.peers.iter().map(|peer| {
        let mut row = object(peer);
        row["method"] = row["program"].take();
        row
    });
    write_columns(&COLUMNS[1..], rows.chain(peers), out)
}

/// `chart_rods.csv`: one row per leaf and contender.
pub fn scaling_table(scaling: &Scaling, out: &mut dyn Write) -> io::Result<()> {
    let columns = &COLUMNS[..COLUMNS.len() - 1];
    write_columns(columns, scaling.rows.iter().map(object), out)
}

fn object(row: &impl Serialize) -> Value {
    serde_json::to_value(row).unwrap_or_default()
}

/// Writes these columns; missing values, and numbers that are not finite, are empty cells.
fn write_columns(
    columns: &[&str],
    rows: impl Iterator<Item = Value>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut table = csv::Writer::from_writer(out);
    table.write_record(columns)?;
    for row in rows {
        let cell = |column: &&str| match &row[*column] {
            Value::String(text) => text.clone(),
            Value::Bool(yes) => yes.to_string(),
            Value::Number(count) if count.is_u64() => match row["seconds"].is_null() {
                // Nothing was measured.
                true if *column == "runs" => String::new(),
                _ => count.to_string(),
            },
            Value::Number(number) => format!("{:e}", number.as_f64().unwrap_or(f64::NAN)),
            _ => String::new(),
        };
        table.write_record(columns.iter().map(cell))?;
    }
    table.flush()
}
