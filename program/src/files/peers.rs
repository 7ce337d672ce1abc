//! Tables of measurements of other programs, as `benches/peers` writes them.

use crate::report::FileError;
use leafdyn::study::PeerMeasurement;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Columns that a table must have, in any order.
const PEER_TABLE_COLUMNS: [&str; 7] = [
    "program", "scenario", "rods", "knob", "seconds", "error", "outcome",
];

const MOST_TABLE_BYTES: u64 = 16 << 20;

/// Most rows: a chart of more is unreadable.
const MOST_TABLE_ROWS: usize = 10_000;

/// Most programs in one chart, each a marker and a line of the key.
const MOST_PROGRAMS: usize = 100;

const MOST_CELL_CHARACTERS: usize = 200;

/// Reads a table.
///
/// # Errors
/// If it is not one, with the line.
pub fn read_peer_measurements(file: &Path) -> Result<Vec<PeerMeasurement>, FileError> {
    let refused = |what: String| FileError(format!("--peers: {what}"));
    let mut bytes = Vec::new();
    File::open(file)
        .and_then(|open| open.take(MOST_TABLE_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|reason| refused(FileError::cannot_read(file, reason).to_string()))?;
    let shown = file.display();
    if bytes.len() as u64 > MOST_TABLE_BYTES {
        let most = MOST_TABLE_BYTES >> 20;
        let what = format!("{shown} is larger than {most} MB: it is no table of measurements");
        return Err(refused(what));
    }
    parse_peer_table(&bytes)
        .map_err(|TableError { line, problem }| refused(format!("{shown}:{line}: {problem}")))
}

/// What is wrong with a table.
#[derive(Debug)]
struct TableError {
    line: u64,
    problem: String,
}

impl TableError {
    fn at(line: u64) -> impl Fn(String) -> Self {
        move |problem| TableError { line, problem }
    }
}

fn parse_peer_table(bytes: &[u8]) -> Result<Vec<PeerMeasurement>, TableError> {
    let mut table = csv::ReaderBuilder::new().flexible(true).from_reader(bytes);
    let header = table
        .headers()
        .map_err(|error| TableError::at(1)(csv_error_message(&error)))?;
    let header = header.clone();
    let mut columns = [0; PEER_TABLE_COLUMNS.len()];
    for (column, name) in columns.iter_mut().zip(PEER_TABLE_COLUMNS) {
        let mut places = (0..header.len()).filter(|&i| header[i].trim() == name);
        *column = match (places.next(), places.next()) {
            (Some(place), None) => place,
            _ => {
                let wanted = PEER_TABLE_COLUMNS.join(", ");
                let what = format!("the first line must name the columns {wanted}, each once");
                return Err(TableError::at(1)(what));
            }
        };
    }
    let mut rows: Vec<PeerMeasurement> = Vec::new();
    let mut programs = BTreeSet::new();
    for record in table.records() {
        let record = record.map_err(|error| {
            let line = error.position().map_or(0, csv::Position::line);
            TableError::at(line)(csv_error_message(&error))
        })?;
        let refused = TableError::at(record.position().map_or(0, csv::Position::line));
        if record.len() != header.len() {
            let (found, wanted) = (record.len(), header.len());
            let what = format!("{found} cells, not {wanted} as in the first line");
            return Err(refused(what));
        }
        let cell = columns.map(|column| record[column].trim());
        if rows.len() == MOST_TABLE_ROWS {
            let what = format!("more than {MOST_TABLE_ROWS} rows: take fewer");
            return Err(refused(what));
        }
        for (name, cell) in PEER_TABLE_COLUMNS.into_iter().zip(cell) {
            if cell.chars().count() > MOST_CELL_CHARACTERS {
                let what = format!("{name}: more than {MOST_CELL_CHARACTERS} characters");
                return Err(refused(what));
            }
        }
        let row = parse_peer_row(cell).map_err(&refused)?;
        let (_, settings) = row.knob.split_once(' ').unwrap_or_default();
        programs.insert(format!("{} {settings}", row.program));
        if programs.len() > MOST_PROGRAMS {
            let what = "programs, each with its settings: take fewer";
            return Err(refused(format!("more than {MOST_PROGRAMS} {what}")));
        }
        rows.push(row);
    }
    Ok(rows)
}

/// The message of a CSV error, without its position.
fn csv_error_message(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::Utf8 { .. } => "not UTF-8".into(),
        _ => error.to_string(),
    }
}

fn parse_peer_row(
    [program, scenario, rods, knob, seconds, error, outcome]: [&str; 7],
) -> Result<PeerMeasurement, String> {
    let named = |name: &str, cell: &str| match cell {
        "" => Err(format!("{name}: must not be empty")),
        cell => Ok(cell.to_string()),
    };
    let number = |name: &str, cell: &str, allowed: &str, good: fn(f64) -> bool| {
        let value = cell.parse().ok();
        let value = value.filter(|&value: &f64| value.is_finite() && good(value));
        value.ok_or_else(|| format!("{name} = {cell:?}: must be {allowed}"))
    };
    Ok(PeerMeasurement {
        program: named("program", program)?,
        scenario: named("scenario", scenario)?,
        rods: match rods.parse() {
            Ok(rods @ 1..) => rods,
            _ => {
                return Err(format!(
                    "rods = {rods:?}: must be a whole number, at least 1"
                ));
            }
        },
        knob: knob.into(),
        seconds: number("seconds", seconds, "a number greater than 0", |it| it > 0.0)?,
        error: match error {
            "" => None,
            cell => {
                let allowed = "empty, or a number not below 0";
                Some(number("error", cell, allowed, |it| it >= 0.0)?)
            }
        },
        outcome: named("outcome", outcome)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "program,scenario,rods,knob,seconds,error,outcome\n";

    #[track_caller]
    fn refused(text: &[u8], line: u64, part: &str) {
        let TableError { line: at, problem } = parse_peer_table(text).unwrap_err();
        assert_eq!(at, line, "{problem}");
        assert!(problem.contains(part), "{part} in {problem}");
    }

    #[test]
    fn columns_may_be_in_any_order_with_others_between() {
        let text = "outcome,date,error,seconds,knob,rods,scenario,program\nat-rest,today,,2,n=1,3,leaf,p\n";
        let rows = parse_peer_table(text.as_bytes()).unwrap();
        assert_eq!((rows[0].rods, rows[0].error), (3, None));
    }

    #[test]
    fn what_is_malformed_is_refused_with_its_line() {
        let good = "solve_bvp,fig04,5,tol=0.001,0.2671,5.487e-06,converged\n";
        for (bad, part) in [
            ("p,s,5,k,0.1,1e-3", "6 cells, not 7"),
            ("p,s,5,k,0.1,1e-3,converged,more", "8 cells"),
            ("p,s,0,k,0.1,1e-3,converged", "rods = \"0\""),
            ("p,s,2.5,k,0.1,1e-3,converged", "rods"),
            ("p,s,5,k,0,1e-3,converged", "seconds = \"0\""),
            ("p,s,5,k,inf,1e-3,converged", "seconds"),
            ("p,s,5,k,fast,1e-3,converged", "seconds = \"fast\""),
            ("p,s,5,k,,1e-3,converged", "seconds"),
            ("p,s,5,k,0.1,-1,converged", "error"),
            ("p,s,5,k,0.1,nan,converged", "error"),
            (",s,5,k,0.1,1e-3,converged", "program"),
            ("p,,5,k,0.1,1e-3,converged", "scenario"),
            ("p,s,5,k,0.1,1e-3,", "outcome"),
        ] {
            refused(format!("{HEADER}{good}{bad}\n{good}").as_bytes(), 3, part);
        }
        let row = |program: &str| format!("{program},s,5,k,0.1,1e-3,converged\n");
        let long = HEADER.to_string() + &row("p") + &row(&"x".repeat(1_000_000));
        refused(long.as_bytes(), 3, "program: more than 200 characters");
        let many: String = (0..60_000).map(|i| row(&format!("p{i}"))).collect();
        let settings: String = (0..101).map(|i| format!("p,s,5,k s{i},1,,c\n")).collect();
        for rows in [many, settings] {
            let text = HEADER.to_string() + &rows;
            refused(text.as_bytes(), 102, "more than 100 programs");
        }
        let rows = HEADER.to_string() + &row("p").repeat(10_001);
        refused(rows.as_bytes(), 10_002, "more than 10000 rows");
        refused(b"", 1, "must name the columns program,");
        refused(b"program,scenario\n", 1, "must name the columns");
        refused(format!("program,{HEADER}").as_bytes(), 1, "each once");
        let invalid = [HEADER.as_bytes(), b"p,\xff,5,k,0.1,,c\n"].concat();
        refused(&invalid, 2, "UTF-8");
    }
}
