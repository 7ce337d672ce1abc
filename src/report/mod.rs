//! Output of results: as lines on the console, as rows of tables, as JSON.

mod all;
pub mod base64;
mod boundary;
mod centerlines;
mod chart;
mod chart_table;
mod check;
mod error;
mod fit;
pub mod json;
mod map;
mod map_table;
mod margin;
pub mod numbers;
mod relax;
#[cfg(test)]
pub mod sample;
mod sensitivity;
mod simulate;
pub mod table;
mod trace;
mod trace_table;
pub mod words;

use std::io::{self, Write};

use serde::Serialize;

use crate::scenario::{Scenario, printable};

pub use all::{lines as all_lines, report as all_report};
pub use boundary::{
    boundary_table, is_special, lines as boundary_lines, report as boundary_report, sides,
};
pub use centerlines::{centerlines, modes_table};
pub use chart::report as chart_report;
pub use chart_table::{chart_table, scaling_table};
pub use check::report as check_report;
pub use error::FileError;
pub use fit::{fitted, report as fit_report, table as fit_table};
pub use map::{Work as MapWork, report as map_report};
pub use map_table::{lines, map_table, read_rows, table};
pub use relax::{lines as relax_lines, report as relax_report};
pub use sensitivity::table as sensitivity_table;
pub use simulate::{lines as simulate_lines, report as simulate_report};
pub use trace::{error_location, lines as trace_lines, report as trace_report, slope_unit};
pub use trace_table::trace_table;

/// A file format of a result.
pub trait Format<R>: Sync {
    /// Name of the file, which does not change between releases.
    fn file_name(&self) -> &'static str;

    /// Writes the whole file. The only errors are those of `out`.
    fn write(&self, document: &Document<R>, out: &mut dyn Write) -> io::Result<()>;

    /// Files that this one refers to, which are written before it.
    fn parts<'d>(&self, _document: &'d Document<R>) -> Vec<Part<'d>> {
        Vec::new()
    }
}

/// A file that another one refers to: its name within the folder, and what writes it.
pub type Part<'d> = (
    String,
    Box<dyn Fn(&mut dyn Write) -> io::Result<()> + Sync + 'd>,
);

/// A result that is written to a folder.
pub trait Written: Serialize + Sync + Sized + 'static {
    /// Name of its JSON file, which is also printed on request.
    const JSON: Option<&'static str>;

    /// Every other format, in the order in which files are named.
    const FORMATS: &'static [&'static dyn Format<Self>];

    /// Kinds of files that are written while the result is computed.
    const GROWING: &'static [Kind] = &[];

    /// Formats of optional parts of a result, written after the others. Where a result
    /// lacks a part, a file left by an earlier run is removed.
    const MORE: &'static [&'static dyn Format<Self>] = &[];

    /// Whether it has the optional part that a file of this name shows.
    fn has_more(&self, _file: &str) -> bool {
        false
    }

    /// All kinds of its files.
    fn kinds() -> Vec<Kind> {
        let formats = Self::FORMATS
            .iter()
            .map(|format| Kind::of(format.file_name()));
        let json = Self::JSON.map(Kind::of).into_iter();
        json.chain(formats)
            .chain(Self::GROWING.iter().copied())
            .collect()
    }

    /// Its formats of these kinds.
    fn formats(&self, kinds: &[Kind]) -> Vec<&'static dyn Format<Self>> {
        let more = Self::MORE.iter();
        let more = more.filter(|format| self.has_more(format.file_name()));
        let formats = Self::FORMATS.iter().chain(more).copied();
        let wanted = |format: &&dyn Format<Self>| kinds.contains(&Kind::of(format.file_name()));
        formats.filter(wanted).collect()
    }
}

/// A kind of file, as listed by `--write`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The result itself.
    Json,
    /// Tables; large ones as NumPy arrays.
    Csv,
    /// Vector figures.
    Svg,
    /// Raster figures.
    Png,
    /// A page that shows the leaf in space.
    Html,
    /// For ParaView.
    Vtk,
    /// For Blender.
    Glb,
    /// A film.
    Gif,
}

impl Kind {
    /// All of them.
    pub const ALL: [Kind; 8] = [
        Kind::Json,
        Kind::Csv,
        Kind::Svg,
        Kind::Png,
        Kind::Html,
        Kind::Vtk,
        Kind::Glb,
        Kind::Gif,
    ];

    /// Those that need a motion as a film.
    pub const FILMS: [Kind; 4] = [Kind::Html, Kind::Vtk, Kind::Glb, Kind::Gif];

    /// Those that are written by default.
    pub const USUAL: [Kind; 4] = [Kind::Json, Kind::Csv, Kind::Svg, Kind::Png];

    /// Its word.
    pub fn word(self) -> &'static str {
        match self {
            Kind::Json => "json",
            Kind::Csv => "csv",
            Kind::Svg => "svg",
            Kind::Png => "png",
            Kind::Html => "html",
            Kind::Vtk => "vtk",
            Kind::Glb => "glb",
            Kind::Gif => "gif",
        }
    }

    /// The kind of a file, by the extension of its name.
    pub fn of(file: &str) -> Kind {
        let end = file.rsplit('.').next();
        let named = Kind::ALL.into_iter().find(|kind| Some(kind.word()) == end);
        named.unwrap_or(match end {
            Some("vtp" | "pvd") => Kind::Vtk,
            _ => Kind::Csv,
        })
    }
}

/// A result with its input, as JSON: the content of a verb's file, and the output of
/// `--json`.
#[derive(Serialize)]
pub struct Document<'a, R> {
    /// Of the program.
    version: &'static str,
    /// The relative path from the output folder to the scenario's file, if known: it
    /// identifies the scenario whose results a folder holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    source: Option<&'a str>,
    /// The result.
    #[serde(flatten)]
    pub result: &'a R,
    /// The scenario, with all defaults and overrides.
    pub input: &'a Scenario,
    /// Why its files could not be written, with the exit status.
    #[serde(flatten)]
    pub refused: Option<Refused>,
}

/// What `--json` prints of a refusal.
#[derive(Clone, Debug, Serialize)]
pub struct Refused {
    /// Why, and what to change.
    pub error: String,
    /// 2, or 130 after Ctrl-C.
    pub exit_status: i32,
}

impl Refused {
    /// For a refused request, or a file that could not be written.
    pub fn new(error: &str) -> Self {
        Refused {
            error: printable(error).into(),
            exit_status: 2,
        }
    }
}

impl<'a, R> Document<'a, R> {
    /// A result of a scenario in the file `source`.
    pub fn new(result: &'a R, input: &'a Scenario, source: Option<&'a str>) -> Self {
        Document {
            result,
            version: env!("CARGO_PKG_VERSION"),
            source,
            input,
            refused: None,
        }
    }
}
