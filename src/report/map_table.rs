//! Rows of a map as CSV, to and fro.

use std::collections::HashMap;
use std::fs;
use std::io::{self, Write};
use std::path::Path;
use std::str::FromStr;

use super::MapFileError;
use crate::report::Format;
use crate::study::{Map, MapRequest, MapRow};

/// `map.csv`: one row per cell and method.
pub struct MapTable;

/// The columns after those of the varied keys.
const COLUMNS: [&str; 15] = [
    "method",
    "outcome",
    "detail",
    "index",
    "tip_x",
    "tip_y",
    "tip_z",
    "energy",
    "error",
    "error_estimate",
    "margin_waves",
    "margin_amplitude",
    "twist",
    "seconds",
    "reference",
];

impl Format<Map> for MapTable {
    fn file_name(&self) -> &'static str {
        "map.csv"
    }

    fn write(&self, map: &Map, out: &mut dyn Write) -> io::Result<()> {
        out.write_all(&table(&map.request, &map.rows)?)
    }
}

fn header(request: &MapRequest) -> Vec<String> {
    let keys = request.axes.iter().map(|axis| axis.keys.to_string());
    keys.chain(COLUMNS.map(String::from)).collect()
}

/// The header and all rows.
pub fn table(request: &MapRequest, rows: &[MapRow]) -> io::Result<Vec<u8>> {
    let mut table = csv::WriterBuilder::new()
        .has_headers(false)
        .from_writer(Vec::new());
    table.write_record(header(request))?;
    let mut bytes = table.into_inner().map_err(|error| error.into_error())?;
    bytes.extend(lines(request, rows)?);
    Ok(bytes)
}

/// The rows alone, each a whole line.
pub fn lines(request: &MapRequest, rows: &[MapRow]) -> io::Result<Vec<u8>> {
    let mut table = csv::WriterBuilder::new()
        .has_headers(false)
        .from_writer(Vec::new());
    for row in rows {
        table.write_record(fields(request, row))?;
    }
    table.into_inner().map_err(|error| error.into_error())
}

fn fields(request: &MapRequest, row: &MapRow) -> Vec<String> {
    // Adding zero turns -0 into 0.
    let number = |value: f64| format!("{:?}", value + 0.0);
    let optional = |value: Option<f64>| value.map(number).unwrap_or_default();
    let mut fields = request.texts(row.cell);
    fields.extend([
        row.method.to_string(),
        row.outcome.to_string(),
        row.detail.clone(),
        row.index.map(|index| index.to_string()).unwrap_or_default(),
    ]);
    fields.extend((0..3).map(|axis| optional(row.tip.map(|tip| tip[axis]))));
    fields.extend([
        optional(row.energy),
        optional(row.error),
        optional(row.error_estimate),
        optional(row.margin_waves),
        optional(row.margin_amplitude),
        optional(row.twist),
        format!("{:.6}", row.seconds),
        row.reference.to_string(),
    ]);
    fields
}

/// Reads the rows of a file; header lines may repeat, as in files that were
/// joined. A last line without an end is what a run that was killed was about
/// to write, and is left out.
pub fn read_rows(file: &Path, request: &MapRequest) -> Result<Vec<MapRow>, MapFileError> {
    let bytes = fs::read(file).map_err(|reason| MapFileError::Unreadable {
        file: file.into(),
        reason,
    })?;
    let whole = bytes.iter().rposition(|&byte| byte == b'\n');
    let bytes = &bytes[..whole.map_or(0, |end| end + 1)];
    let cells: HashMap<Vec<String>, usize> = (0..request.cells())
        .map(|cell| (request.texts(cell), cell))
        .collect();
    let header = header(request);
    let mut table = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .from_reader(bytes);
    let mut rows = Vec::new();
    for (count, record) in table.records().enumerate() {
        let refuse = |line: u64, why: String| MapFileError::OtherRow {
            file: file.into(),
            line,
            why,
        };
        let record = record.map_err(|error| refuse(count as u64 + 1, error.to_string()))?;
        let line = record.position().map_or(0, csv::Position::line);
        if record.iter().eq(&header) {
            continue;
        }
        if count == 0 {
            return Err(refuse(
                line,
                format!("the columns are not {}", header.join(", ")),
            ));
        }
        let fields: Vec<&str> = record.iter().collect();
        rows.push(row(&fields, request, &cells).map_err(|why| refuse(line, why))?);
    }
    Ok(rows)
}

fn row(
    fields: &[&str],
    request: &MapRequest,
    cells: &HashMap<Vec<String>, usize>,
) -> Result<MapRow, String> {
    let axes = request.axes.len();
    if fields.len() != axes + COLUMNS.len() {
        return Err(format!("it has {} columns", fields.len()));
    }
    let (place, fields) = fields.split_at(axes);
    let texts: Vec<String> = place.iter().map(|text| text.to_string()).collect();
    let Some(&cell) = cells.get(&texts) else {
        return Err(format!("it has no cell {}", texts.join(", ")));
    };
    let number = |column: usize| match fields[column] {
        "" => Ok(None),
        text => Some(parsed::<f64>(text)).transpose(),
    };
    let tip = [number(4)?, number(5)?, number(6)?];
    Ok(MapRow {
        cell,
        method: parsed(fields[0])?,
        outcome: parsed(fields[1])?,
        detail: fields[2].into(),
        index: match fields[3] {
            "" => None,
            text => Some(parsed(text)?),
        },
        tip: match tip {
            [Some(x), Some(y), Some(z)] => Some([x, y, z]),
            _ => None,
        },
        energy: number(7)?,
        error: number(8)?,
        error_estimate: number(9)?,
        margin_waves: number(10)?,
        margin_amplitude: number(11)?,
        twist: number(12)?,
        seconds: number(13)?.unwrap_or_default(),
        reference: parsed(fields[14])?,
    })
}

fn parsed<T: FromStr>(text: &str) -> Result<T, String>
where
    T::Err: std::fmt::Display,
{
    text.parse().map_err(|error| format!("{text:?}: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;
    use crate::study::{Confidence, MapMethod, MapOutcome};

    #[test]
    fn rows_come_back_as_they_were() {
        let map = sample::map();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("map.csv");
        fs::write(&file, table(&map.request, &map.rows).unwrap()).unwrap();
        assert_eq!(read_rows(&file, &map.request).unwrap(), map.rows);
    }

    #[test]
    fn joined_files_are_read_and_a_half_written_row_is_not() {
        let map = sample::map();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("joined.csv");
        let (first, second) = map.rows.split_at(5);
        let mut bytes = table(&map.request, first).unwrap();
        bytes.extend(table(&map.request, second).unwrap());
        bytes.truncate(bytes.len() - 3);
        fs::write(&file, &bytes).unwrap();
        let read = read_rows(&file, &map.request).unwrap();
        assert_eq!(read, map.rows[..map.rows.len() - 1]);
    }

    #[test]
    fn rows_of_other_maps_are_refused() {
        let map = sample::map();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("map.csv");
        let good = String::from_utf8(table(&map.request, &map.rows).unwrap()).unwrap();
        for (bad, why) in [
            (
                good.replace("load.gravity[2]", "load.gravity[1]"),
                "columns",
            ),
            (good.replace("\n1.0,", "\n1.5,"), "no cell 1.5"),
            (good.replace(",right,", ",perfect,"), "other-equilibrium"),
            (good.replace(",confirmed", ""), "columns"),
            ("nonsense\n".into(), "columns"),
        ] {
            fs::write(&file, &bad).unwrap();
            let message = read_rows(&file, &map.request).unwrap_err().to_string();
            assert!(message.contains(why), "{why}: {message}");
        }
    }

    #[test]
    fn one_row_is_one_line() {
        let map = sample::map();
        let text = String::from_utf8(table(&map.request, &map.rows).unwrap()).unwrap();
        assert_eq!(text.lines().count(), 1 + map.rows.len());
        let first = text.lines().nth(1).unwrap();
        let row = &map.rows[0];
        assert_eq!(row.method, MapMethod::SemiImplicit);
        assert_eq!(row.outcome, MapOutcome::Right);
        assert_eq!(row.reference, Confidence::Confirmed);
        assert!(
            first.starts_with("1.0,-0.1,semi-implicit,right,"),
            "{first}"
        );
    }
}
