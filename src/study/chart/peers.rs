//! Measurements of other programs, as `benches/peers` writes them.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::timing::Spread;

/// Columns that a table must have, in any order.
const COLUMNS: [&str; 7] = [
    "program", "scenario", "rods", "knob", "seconds", "error", "outcome",
];

/// Most bytes of a table.
const MOST_BYTES: u64 = 16 << 20;

/// First words of outcomes that are solutions.
const AT_REST: [&str; 2] = ["converged", "at-rest"];

/// First word of a measurement that was not meant to come to rest.
const COMPLETED: &str = "completed";

/// A table that cannot be read.
#[derive(Debug, Error)]
pub enum PeersError {
    /// The file cannot be read.
    #[error("--peers: cannot read {}: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// The file is larger than any table of measurements.
    #[error("--peers: {} is larger than {} MB: it is no table of measurements", file.display(), MOST_BYTES >> 20)]
    TooLarge {
        /// The file.
        file: PathBuf,
    },
    /// A line is not as it should be.
    #[error("--peers: {}:{line}: {problem}", file.display())]
    Malformed {
        /// The file.
        file: PathBuf,
        /// Its line, counted from 1.
        line: u64,
        /// What is wrong, and what is allowed.
        problem: String,
    },
}

/// One row of such a table.
#[derive(Clone, Debug, PartialEq)]
pub struct PeerRow {
    /// The program.
    pub program: String,
    /// Name of the scenario.
    pub scenario: String,
    /// Veins of the leaf.
    pub rods: usize,
    /// What was set to make it more accurate, and other settings after a blank.
    pub knob: String,
    /// The time it took.
    pub seconds: f64,
    /// Largest distance of its positions from the solution, in units of length.
    pub error: Option<f64>,
    /// How it ended.
    pub outcome: String,
}

/// Reads a table.
///
/// # Errors
/// If it is not one, with the line.
pub fn read_peers(file: &Path) -> Result<Vec<PeerRow>, PeersError> {
    let unreadable = |reason| PeersError::Unreadable {
        file: file.into(),
        reason,
    };
    let mut bytes = Vec::new();
    File::open(file)
        .and_then(|open| open.take(MOST_BYTES + 1).read_to_end(&mut bytes))
        .map_err(unreadable)?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(PeersError::TooLarge { file: file.into() });
    }
    parse(&bytes).map_err(|(line, problem)| PeersError::Malformed {
        file: file.into(),
        line,
        problem,
    })
}

/// Rows, or a line and what is wrong with it.
fn parse(bytes: &[u8]) -> Result<Vec<PeerRow>, (u64, String)> {
    let mut table = csv::ReaderBuilder::new().flexible(true).from_reader(bytes);
    let header = match table.headers() {
        Ok(header) => header.clone(),
        Err(error) => return Err((1, said(&error))),
    };
    let mut columns = [0; COLUMNS.len()];
    for (column, name) in columns.iter_mut().zip(COLUMNS) {
        let mut places = (0..header.len()).filter(|&i| header[i].trim() == name);
        *column = match (places.next(), places.next()) {
            (Some(place), None) => place,
            _ => {
                let wanted = COLUMNS.join(", ");
                return Err((
                    1,
                    format!("the first line must name the columns {wanted}, each once"),
                ));
            }
        };
    }
    let mut rows = Vec::new();
    for record in table.records() {
        let record = record.map_err(|error| {
            let line = error.position().map_or(0, csv::Position::line);
            (line, said(&error))
        })?;
        let line = record.position().map_or(0, csv::Position::line);
        if record.len() != header.len() {
            let (found, wanted) = (record.len(), header.len());
            return Err((
                line,
                format!("{found} cells, not {wanted} as in the first line"),
            ));
        }
        let cell = columns.map(|column| record[column].trim());
        rows.push(row(cell).map_err(|problem| (line, problem))?);
    }
    Ok(rows)
}

/// An error of the table without its own idea of the place.
fn said(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::Utf8 { .. } => "not UTF-8".into(),
        _ => error.to_string(),
    }
}

fn row(
    [program, scenario, rods, knob, seconds, error, outcome]: [&str; 7],
) -> Result<PeerRow, String> {
    let named = |name: &str, cell: &str| match cell {
        "" => Err(format!("{name}: must not be empty")),
        cell => Ok(cell.to_string()),
    };
    let number = |name: &str, cell: &str, allowed: &str, good: fn(f64) -> bool| {
        let value = cell
            .parse()
            .ok()
            .filter(|&value: &f64| value.is_finite() && good(value));
        value.ok_or_else(|| format!("{name} = {cell:?}: must be {allowed}"))
    };
    Ok(PeerRow {
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
        seconds: number("seconds", seconds, "a number greater than 0", |value| {
            value > 0.0
        })?,
        error: match error {
            "" => None,
            error => Some(number(
                "error",
                error,
                "empty, or a number not below 0",
                |value| value >= 0.0,
            )?),
        },
        outcome: named("outcome", outcome)?,
    })
}

/// A peer's measurements at one setting.
#[derive(Clone, Debug, PartialEq)]
pub struct Peer {
    /// The program, with its settings other than the knob.
    pub name: String,
    /// Where its knob stands.
    pub knob: String,
    /// Times of all rows alike.
    pub seconds: Spread,
    /// The largest error of these rows, relative to the longest rod; `None`
    /// if it did not come to rest.
    pub true_error: Option<f64>,
    /// How it ended.
    pub outcome: String,
    /// Whether it is on the Pareto front.
    pub pareto: bool,
}

/// The rows about a leaf, with equal rows taken together, and what is to be
/// said of the others. Errors become relative to the longest rod.
pub fn about(
    rows: &[PeerRow],
    scenario: &str,
    rods: usize,
    longest: f64,
) -> (Vec<Peer>, Vec<String>) {
    let mut groups: Vec<(Peer, Vec<f64>)> = Vec::new();
    let (mut other, mut silent) = (0, 0);
    for row in rows {
        if row.scenario != scenario || row.rods != rods {
            other += 1;
            continue;
        }
        let word = row.outcome.split_whitespace().next().unwrap_or_default();
        let at_rest = AT_REST.contains(&word);
        if row.error.is_none() && (at_rest || word == COMPLETED) {
            silent += 1;
            continue;
        }
        let true_error = row.error.filter(|_| at_rest).map(|error| error / longest);
        let (knob, settings) = row.knob.split_once(' ').unwrap_or((&row.knob, ""));
        let name = format!("{} {settings}", row.program).trim_end().to_string();
        let same = groups.iter_mut().find(|(peer, _)| {
            peer.name == name && peer.knob == knob && peer.outcome == row.outcome
        });
        match same {
            Some((peer, seconds)) => {
                seconds.push(row.seconds);
                if true_error > peer.true_error {
                    peer.true_error = true_error;
                }
            }
            None => {
                let seconds = vec![row.seconds];
                let Some(spread) = Spread::of(&seconds) else {
                    continue;
                };
                let peer = Peer {
                    name,
                    knob: knob.into(),
                    seconds: spread,
                    true_error,
                    outcome: row.outcome.clone(),
                    pareto: false,
                };
                groups.push((peer, seconds));
            }
        }
    }
    let peers = groups.into_iter().map(|(peer, mut seconds)| {
        seconds.sort_by(f64::total_cmp);
        let spread = Spread::of(&seconds).unwrap_or(peer.seconds);
        Peer {
            seconds: spread,
            ..peer
        }
    });
    let peers = peers.collect();
    let rows = |count: usize| match count {
        1 => "1 row of --peers is".to_string(),
        count => format!("{count} rows of --peers are"),
    };
    let mut remarks = Vec::new();
    if other > 0 {
        remarks.push(format!("{} about another leaf, and left out", rows(other)));
    }
    if silent > 0 {
        remarks.push(format!(
            "{} without the error of a leaf at rest, and left out",
            rows(silent)
        ));
    }
    (peers, remarks)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "program,scenario,rods,knob,seconds,error,outcome\n";

    fn rows(lines: &str) -> Vec<PeerRow> {
        parse(format!("{HEADER}{lines}").as_bytes()).unwrap()
    }

    #[track_caller]
    fn refused(text: &[u8], line: u64, part: &str) {
        let (at, problem) = parse(text).unwrap_err();
        assert_eq!(at, line, "{problem}");
        assert!(problem.contains(part), "{part} in {problem}");
    }

    #[test]
    fn rows_are_read_as_they_are_written() {
        let rows = rows("solve_bvp,fig04,5,tol=0.001,0.2671,5.487e-06,converged\n");
        assert_eq!(
            rows,
            [PeerRow {
                program: "solve_bvp".into(),
                scenario: "fig04".into(),
                rods: 5,
                knob: "tol=0.001".into(),
                seconds: 0.2671,
                error: Some(5.487e-6),
                outcome: "converged".into(),
            }]
        );
        assert!(parse(HEADER.as_bytes()).unwrap().is_empty());
    }

    #[test]
    fn columns_may_be_in_any_order_with_others_between() {
        let text = "outcome,date,error,seconds,knob,rods,scenario,program\nat-rest,today,,2,n=1,3,leaf,p\n";
        let rows = parse(text.as_bytes()).unwrap();
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
        refused(b"", 1, "must name the columns program,");
        refused(b"program,scenario\n", 1, "must name the columns");
        refused(format!("program,{HEADER}").as_bytes(), 1, "each once");
        refused(
            &[HEADER.as_bytes(), b"p,\xff,5,k,0.1,,c\n"].concat(),
            2,
            "UTF-8",
        );
    }

    #[test]
    fn equal_rows_are_taken_together_and_others_counted() {
        let rows = rows(
            "a,leaf,5,n=10,3,4e-3,converged\n\
             a,leaf,5,n=10,1,4e-3,converged\n\
             a,leaf,5,n=10,2,4e-3,converged\n\
             a,leaf,5,n=10 own-law,2,6e-3,at-rest\n\
             a,leaf,5,n=20,2,,not-converged newton\n\
             a,leaf,5,n=30,2,,converged\n\
             a,leaf,5,n=30 steps=9,2,,completed\n\
             a,leaf,7,n=10,2,1e-3,converged\n\
             a,tree,5,n=10,2,1e-3,converged\n\
             a,tree,5,n=20,2,1e-3,converged\n",
        );
        let (peers, remarks) = about(&rows, "leaf", 5, 2.0);
        let names: Vec<(&str, &str)> = peers
            .iter()
            .map(|peer| (peer.name.as_str(), peer.knob.as_str()))
            .collect();
        assert_eq!(names, [("a", "n=10"), ("a own-law", "n=10"), ("a", "n=20")]);
        assert_eq!((peers[0].seconds.median, peers[0].seconds.runs), (2.0, 3));
        assert_eq!(peers[0].true_error, Some(2e-3));
        assert_eq!(peers[2].true_error, None);
        assert_eq!(
            remarks,
            [
                "3 rows of --peers are about another leaf, and left out",
                "2 rows of --peers are without the error of a leaf at rest, and left out"
            ]
        );
    }
}
