//! Results shown: as lines on the console, as rows of tables, as JSON.

mod all;
mod centerlines;
mod chart;
mod chart_table;
mod check;
mod error;
pub mod json;
mod map;
mod map_table;
pub mod numbers;
mod relax;
#[cfg(test)]
pub mod sample;
mod simulate;
pub mod table;
mod trace;
mod trace_table;
pub mod words;

use std::io::{self, Write};

pub use all::report as all_report;
pub use centerlines::{centerlines, modes_table};
pub use chart::report as chart_report;
pub use chart_table::{chart_table, scaling_table};
pub use check::report as check_report;
pub use error::FileError;
pub use json::Json;
pub use map::{Told as MapTold, report as map_report};
pub use map_table::{lines, map_table, read_rows, table};
pub use relax::report as relax_report;
pub use simulate::report as simulate_report;
pub use trace::report as trace_report;
pub use trace_table::trace_table;

/// One way to write a result down.
pub trait Format<R> {
    /// Name of the file, the same from release to release.
    fn file_name(&self) -> &'static str;

    /// Writes the whole file. The only errors are those of `out`.
    fn write(&self, result: &R, out: &mut dyn Write) -> io::Result<()>;
}

/// A result that is written to a folder.
pub trait Written: Sized + 'static {
    /// Every format, in the order in which the files are written; first the
    /// JSON that is also shown on request.
    const FORMATS: &'static [&'static dyn Format<Self>];

    /// Formats of what not every result has, written after the others. If this
    /// one has not, what an earlier run has left of them is removed.
    const MORE: &'static [&'static dyn Format<Self>] = &[];

    /// Whether these are written.
    fn has_more(&self) -> bool {
        false
    }

    /// Names of the files written.
    fn file_names(&self) -> Vec<&'static str> {
        let more = if self.has_more() { Self::MORE } else { &[] };
        let formats = Self::FORMATS.iter().chain(more);
        formats.map(|format| format.file_name()).collect()
    }
}
