//! `chart.csv` and `chart_rods.csv`: one row per measurement, for spreadsheets
//! and scripts. What the columns say is in `chart.json` by the same names.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::Value;

use super::Format;
use crate::study::{Chart, Scaling};

/// `chart.csv`: one row per contender and setting, then those of the peers.
pub struct ChartTable;

/// `chart_rods.csv`: one row per leaf and contender.
pub struct ScalingTable;

/// Names of the columns of both, but for the first of `chart_rods.csv` and the
/// last of `chart.csv`.
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

impl Format<Chart> for ChartTable {
    fn file_name(&self) -> &'static str {
        "chart.csv"
    }

    fn write(&self, chart: &Chart, out: &mut dyn Write) -> io::Result<()> {
        let rows = chart.rows.iter().map(object);
        let peers = chart.peers.iter().map(|peer| {
            let mut row = object(peer);
            row["method"] = row["program"].take();
            row
        });
        write_columns(&COLUMNS[1..], rows.chain(peers), out)
    }
}

impl Format<Scaling> for ScalingTable {
    fn file_name(&self) -> &'static str {
        "chart_rods.csv"
    }

    fn write(&self, scaling: &Scaling, out: &mut dyn Write) -> io::Result<()> {
        let columns = &COLUMNS[..COLUMNS.len() - 1];
        write_columns(columns, scaling.rows.iter().map(object), out)
    }
}

fn object(row: &impl Serialize) -> Value {
    serde_json::to_value(row).unwrap_or_default()
}

/// What a row does not tell, or is no number, is an empty cell.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    fn lines<R>(format: &dyn Format<R>, result: &R) -> Vec<String> {
        let mut bytes = Vec::new();
        format.write(result, &mut bytes).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        text.lines().map(String::from).collect()
    }

    #[test]
    fn rows_of_contenders_peers_and_leaves() {
        let chart = lines(&ChartTable, &sample::chart());
        assert_eq!(
            chart[1],
            "semi-implicit,tolerance=1e-2,1e-3,8e-4,8.75e-4,1.2e-3,5,8,9,9,1e-4,1e-3,converged,true"
        );
        for wanted in [
            "explicit,tolerance=1e-11,,,,,,,,,,,not-run,false",
            "solve_bvp,tol=0.001,2.5e-1,2e-1,2.1875e-1,3e-1,5,,,,5e-6,,converged,false",
        ] {
            assert!(chart.iter().any(|line| line == wanted), "{chart:?}");
        }
        let scaling = lines(&ScalingTable, &sample::scaling());
        assert!(scaling[1].starts_with("5,semi-implicit,tolerance=1e-6,1e-3,"));
        assert!(scaling[1].ends_with(",converged"));
    }
}
