//! `chart.csv` and `chart_rods.csv`: one row per measurement, for spreadsheets
//! and scripts.

use std::io::{self, Write};

use super::Format;
use crate::study::{Chart, Peer, Row, Scaling, Spread};

/// `chart.csv`: one row per contender and setting, then those of the peers.
pub struct ChartTable;

/// `chart_rods.csv`: one row per leaf and contender.
pub struct ScalingTable;

/// Names of the columns of `chart.csv`.
const COLUMNS: [&str; 14] = [
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

/// Columns that both tables have.
const SHARED: usize = COLUMNS.len() - 1;

type Cells = Vec<String>;

impl Format<Chart> for ChartTable {
    fn file_name(&self) -> &'static str {
        "chart.csv"
    }

    fn write(&self, chart: &Chart, out: &mut dyn Write) -> io::Result<()> {
        let mut table = csv::Writer::from_writer(out);
        table.write_record(COLUMNS)?;
        for row in &chart.rows {
            let mut cells = shared(row);
            cells.push(row.pareto.to_string());
            table.write_record(cells)?;
        }
        for peer in &chart.peers {
            table.write_record(peer_cells(peer))?;
        }
        table.flush()
    }
}

impl Format<Scaling> for ScalingTable {
    fn file_name(&self) -> &'static str {
        "chart_rods.csv"
    }

    fn write(&self, scaling: &Scaling, out: &mut dyn Write) -> io::Result<()> {
        let mut table = csv::Writer::from_writer(out);
        let header = ["rods"].iter().chain(&COLUMNS[..SHARED]);
        table.write_record(header)?;
        for found in &scaling.rows {
            let mut cells = vec![found.rods.to_string()];
            cells.extend(shared(&found.row));
            table.write_record(cells)?;
        }
        table.flush()
    }
}

fn shared(row: &Row) -> Cells {
    let ran = row.seconds.is_some();
    let count = |count: usize| {
        if ran {
            count.to_string()
        } else {
            String::new()
        }
    };
    let mut cells = vec![row.contender.word().to_string(), row.knob.to_string()];
    cells.extend(times(row.seconds));
    cells.extend([
        count(row.work.steps),
        count(row.work.factorizations),
        count(row.work.force_evaluations),
        number(row.true_error),
        number(row.error_estimate),
        row.ending.word().to_string(),
    ]);
    cells
}

/// A peer tells neither what it did nor its own error.
fn peer_cells(peer: &Peer) -> Cells {
    let mut cells = vec![peer.name.clone(), peer.knob.clone()];
    cells.extend(times(Some(peer.seconds)));
    cells.extend([String::new(), String::new(), String::new()]);
    cells.extend([
        number(peer.true_error),
        String::new(),
        peer.outcome.clone(),
        peer.pareto.to_string(),
    ]);
    cells
}

fn times(spread: Option<Spread>) -> Cells {
    match spread {
        None => vec![String::new(); 5],
        Some(Spread {
            min,
            q1,
            median,
            q3,
            runs,
        }) => {
            let mut cells = [median, min, q1, q3]
                .map(|time| number(Some(time)))
                .to_vec();
            cells.push(runs.to_string());
            cells
        }
    }
}

/// What is not known, or no number, is an empty cell.
fn number(value: Option<f64>) -> String {
    match value {
        Some(value) if value.is_finite() => format!("{value:e}"),
        _ => String::new(),
    }
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
    fn rows_of_contenders_and_peers() {
        let lines = lines(&ChartTable, &sample::chart());
        assert_eq!(
            lines[0],
            "method,knob,seconds,seconds_min,seconds_q1,seconds_q3,runs,steps,factorizations,\
             force_evaluations,true_error,error_estimate,outcome,pareto"
        );
        assert_eq!(
            lines[1],
            "semi-implicit,tolerance=1e-2,1e-3,8e-4,8.75e-4,1.2e-3,5,8,9,9,1e-4,1e-3,converged,true"
        );
        let not_run = "explicit,tolerance=1e-11,,,,,,,,,,,not-run,false";
        assert!(lines.iter().any(|line| line == not_run), "{lines:?}");
        let peer = "solve_bvp,tol=0.001,2.5e-1,2e-1,2.1875e-1,3e-1,5,,,,5e-6,,converged,false";
        assert!(lines.iter().any(|line| line == peer), "{lines:?}");
    }

    #[test]
    fn rows_of_leaves() {
        let lines = lines(&ScalingTable, &sample::scaling());
        assert!(lines[0].starts_with("rods,method,knob,seconds,"));
        assert!(lines[0].ends_with(",error_estimate,outcome"));
        assert!(lines[1].starts_with("5,semi-implicit,tolerance=1e-6,"));
    }
}
