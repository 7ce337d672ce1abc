//! What is written about a result: one small file per format behind one small
//! trait. A file is complete or absent, never half written.

mod atomic;
mod chart;
mod checksum;
mod csv;
mod figure;
mod json;
mod map;
mod part;
mod recording;
#[cfg(test)]
mod sample;
mod trace;
mod words;

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use thiserror::Error;

pub use atomic::{abandon_unfinished, check_writable};
pub use chart::{ChartTable, ScalingTable};
pub use csv::{Centerlines, ModesTable};
pub use figure::{FigurePng, FigureSvg, ModesFigure, MotionFigure};
pub use json::{
    AllSummary, ChartSummary, CheckSummary, MapSummary, MotionSummary, Summary, TraceSummary,
};
pub use map::{Journal, MapFileError, MapTable, belongs, claim, read_rows, write_rows};
pub use recording::{CannotResume, Keeper, Recording};
pub use trace::TraceTable;
pub use words::{
    branch_end, contender, equilibrium_of_index, headline, model, power_of_ten, shooting, verdict,
};

use crate::relax::Equilibrium;
use crate::simulate::Record;
use crate::study::{All, Chart, Check, Map, Scaling, Trace};

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

impl Written for Equilibrium {
    const FORMATS: &'static [&'static dyn Format<Self>] =
        &[&Summary, &Centerlines, &FigureSvg, &FigurePng];

    const MORE: &'static [&'static dyn Format<Self>] =
        &[&ModesTable, &ModesFigure::SVG, &ModesFigure::PNG];

    fn has_more(&self) -> bool {
        self.mode_shapes && self.modes.as_ref().is_some_and(|modes| !modes.is_empty())
    }
}

impl Written for Check {
    const FORMATS: &'static [&'static dyn Format<Self>] = &[&CheckSummary, &FigureSvg, &FigurePng];
}

impl Written for Map {
    const FORMATS: &'static [&'static dyn Format<Self>] =
        &[&MapSummary, &MapTable, &FigureSvg, &FigurePng];
}

impl Written for All {
    const FORMATS: &'static [&'static dyn Format<Self>] = &[&AllSummary, &FigureSvg, &FigurePng];
}

impl Written for Trace {
    const FORMATS: &'static [&'static dyn Format<Self>] =
        &[&TraceSummary, &TraceTable, &FigureSvg, &FigurePng];
}

impl Written for Record {
    const FORMATS: &'static [&'static dyn Format<Self>] = &[
        &MotionSummary,
        &MotionFigure::ENERGY_SVG,
        &MotionFigure::ENERGY_PNG,
        &MotionFigure::FILMSTRIP_SVG,
        &MotionFigure::FILMSTRIP_PNG,
    ];
}

impl Written for Chart {
    const FORMATS: &'static [&'static dyn Format<Self>] =
        &[&ChartSummary, &ChartTable, &FigureSvg, &FigurePng];
}

/// Its numbers are also in the JSON of its chart.
impl Written for Scaling {
    const FORMATS: &'static [&'static dyn Format<Self>] = &[&ScalingTable, &FigureSvg, &FigurePng];
}

/// Why a file could not be written.
#[derive(Debug, Error)]
pub enum OutputError {
    /// The output folder, or a folder above it, is something else.
    #[error(
        "cannot write to the folder {}: {} is not a folder; name another with --out DIR",
        folder.display(), obstacle.display()
    )]
    NotAFolder {
        /// The output folder that was asked for.
        folder: PathBuf,
        /// The path that is in the way.
        obstacle: PathBuf,
    },
    /// The output folder cannot be made or written to.
    #[error(
        "cannot write to the folder {}: {reason}; make it writable or name another with --out DIR",
        folder.display()
    )]
    Unwritable {
        /// The output folder that was asked for.
        folder: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// Writing one file failed; the file that may have been there before is untouched.
    #[error(
        "cannot write {}: {reason}; make room there or name another folder with --out DIR",
        file.display()
    )]
    File {
        /// The file that was to be written.
        file: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
}

/// Writes every format of a result into `folder`, which is made if it is not
/// there, and returns the paths written.
pub fn write_all<R: Written>(folder: &Path, result: &R) -> Result<Vec<PathBuf>, OutputError> {
    atomic::make_folder(folder)?;
    let write_one = |format: &&'static dyn Format<R>| {
        let file = folder.join(format.file_name());
        atomic::write_file(&file, |out| format.write(result, out))
            .map(|()| file.clone())
            .map_err(|reason| OutputError::File { file, reason })
    };
    let more = if result.has_more() { R::MORE } else { &[] };
    let written = R::FORMATS.iter().chain(more).map(write_one).collect();
    for format in R::MORE.iter().skip(more.len()) {
        // Of another result. That there is none is the rule.
        let _ = fs::remove_file(folder.join(format.file_name()));
    }
    written
}
