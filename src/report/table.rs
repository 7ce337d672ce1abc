//! How results are laid out: named lines for the console, rows for CSV.

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;

use super::Written;

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

/// Writes a table of flat rows as CSV; the names of their fields are the header.
///
/// # Errors
/// Those of `out`.
pub fn write_csv<R: Serialize>(
    rows: impl IntoIterator<Item = R>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut table = csv::Writer::from_writer(out);
    for row in rows {
        table.serialize(row)?;
    }
    table.flush()
}
