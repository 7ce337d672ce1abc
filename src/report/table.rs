//! How results are laid out: named lines for the console, rows for CSV.

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;

use super::{Format, Written};

/// Lines of a report, each with its name; one without a name continues the one
/// above.
pub type Lines = Vec<(&'static str, String)>;

/// Lines of which only the first has a name.
pub fn under(name: &'static str, lines: Vec<String>) -> Lines {
    let names = std::iter::once(name).chain(std::iter::repeat(""));
    names.zip(lines).collect()
}

/// Named lines under a heading.
pub fn lay_out(heading: &str, lines: &[(&str, String)]) -> String {
    let mut text = format!("{heading}\n");
    for (name, line) in lines {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  {name:<9}{line}");
    }
    text
}

/// The files of a result in their folder.
pub fn written<R: Written>(result: &R, folder: &Path) -> String {
    named(folder, result.file_names().into_iter())
}

/// Files in a folder.
pub fn named<'a>(folder: &Path, names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.collect();
    format!("{}: {}", folder.display(), names.join(", "))
}

/// A table of a result in a file of this name.
pub struct Table<R>(
    pub &'static str,
    pub fn(&R, &mut dyn Write) -> io::Result<()>,
);

impl<R> Format<R> for Table<R> {
    fn file_name(&self) -> &'static str {
        self.0
    }

    fn write(&self, result: &R, out: &mut dyn Write) -> io::Result<()> {
        (self.1)(result, out)
    }
}

/// Writes a table of flat rows as CSV; the names of their fields are the header.
///
/// # Errors
/// Those of `out`.
pub fn write_csv<R: Serialize>(
    rows: impl IntoIterator<Item = R>,
    out: &mut dyn Write,
) -> io::Result<()> {
    write_rows(csv::Writer::from_writer(out), rows)
}

/// The same without the header.
///
/// # Errors
/// Those of `out`.
pub fn append_csv<R: Serialize>(
    rows: impl IntoIterator<Item = R>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut table = csv::WriterBuilder::new();
    write_rows(table.has_headers(false).from_writer(out), rows)
}

fn write_rows<R: Serialize>(
    mut table: csv::Writer<&mut dyn Write>,
    rows: impl IntoIterator<Item = R>,
) -> io::Result<()> {
    for row in rows {
        table.serialize(row)?;
    }
    table.flush()
}

/// The header of a table of such rows, which may have none yet.
pub fn header(row: impl Serialize) -> Vec<u8> {
    let mut table = Vec::new();
    // Writing to memory cannot fail.
    let _ = write_csv([row], &mut table);
    let end = table.iter().position(|&byte| byte == b'\n');
    table.truncate(end.map_or(0, |end| end + 1));
    table
}
