//! Files: each complete or absent, never half written, and recordings that grow.

mod atomic;
mod checksum;
mod journal;
mod peers;
mod recording;

use std::fs;
use std::path::{Path, PathBuf};

pub use atomic::{abandon_unfinished, check_writable};
pub use journal::{Journal, belongs, claim, write_rows};
pub use peers::read_peers;
pub use recording::{Checkpointer, Recording};

use crate::figure::{self, Picture};
use crate::relax::Equilibrium;
use crate::report::table::Table;
use crate::report::{self, FileError, Format, Json, Written};
use crate::simulate::Record;
use crate::study::{All, Chart, Check, Map, Scaling, Trace};

impl Written for Equilibrium {
    const FORMATS: &'static [&'static dyn Format<Self>] = &[
        &Json("summary.json"),
        &Table("centerlines.csv", report::centerlines),
        &Picture::svg("figure.svg", figure::leaf),
        &Picture::png("figure.png", figure::leaf),
    ];

    const MORE: &'static [&'static dyn Format<Self>] = &[
        &Table("modes.csv", report::modes_table),
        &Picture::svg("modes.svg", figure::modes),
        &Picture::png("modes.png", figure::modes),
    ];

    fn has_more(&self) -> bool {
        let modes = self.stability.modes.as_deref();
        self.stability.mode_shapes && modes.is_some_and(|modes| !modes.is_empty())
    }
}

impl Written for Check {
    const FORMATS: &'static [&'static dyn Format<Self>] = &[
        &Json("check.json"),
        &Picture::svg("check.svg", figure::check),
        &Picture::png("check.png", figure::check),
    ];
}

impl Written for Map {
    const FORMATS: &'static [&'static dyn Format<Self>] = &[
        &Json("map.json"),
        &Table("map.csv", report::map_table),
        &Picture::svg("map.svg", figure::map),
        &Picture::png("map.png", figure::map),
    ];
}

impl Written for All {
    const FORMATS: &'static [&'static dyn Format<Self>] = &[
        &Json("equilibria.json"),
        &Picture::svg("equilibria.svg", figure::all),
        &Picture::png("equilibria.png", figure::all),
    ];
}

impl Written for Trace {
    const FORMATS: &'static [&'static dyn Format<Self>] = &[
        &Json("trace.json"),
        &Table("trace.csv", report::trace_table),
        &Picture::svg("trace.svg", figure::trace),
        &Picture::png("trace.png", figure::trace),
    ];
}

impl Written for Record {
    const FORMATS: &'static [&'static dyn Format<Self>] = &[
        &Json("summary.json"),
        &Picture::svg("energy.svg", figure::energy),
        &Picture::png("energy.png", figure::energy),
        &Picture::svg("filmstrip.svg", figure::filmstrip),
        &Picture::png("filmstrip.png", figure::filmstrip),
    ];
}

impl Written for Chart {
    const FORMATS: &'static [&'static dyn Format<Self>] = &[
        &Json("chart.json"),
        &Table("chart.csv", report::chart_table),
        &Picture::svg("chart.svg", figure::chart),
        &Picture::png("chart.png", figure::chart),
    ];
}

/// Its numbers are also in the JSON of its chart.
impl Written for Scaling {
    const FORMATS: &'static [&'static dyn Format<Self>] = &[
        &Table("chart_rods.csv", report::scaling_table),
        &Picture::svg("chart_rods.svg", figure::scaling),
        &Picture::png("chart_rods.png", figure::scaling),
    ];
}

/// Writes every format of a result into `folder`, which is made if it is not
/// there, and returns the paths written.
pub fn write_all<R: Written>(folder: &Path, result: &R) -> Result<Vec<PathBuf>, FileError> {
    atomic::make_folder(folder)?;
    let write_one = |format: &&'static dyn Format<R>| {
        let file = folder.join(format.file_name());
        atomic::write_file(&file, |out| format.write(result, out))
            .map(|()| file.clone())
            .map_err(|reason| FileError::write(&file, reason))
    };
    let more = if result.has_more() { R::MORE } else { &[] };
    let written = R::FORMATS.iter().chain(more).map(write_one).collect();
    for format in R::MORE.iter().skip(more.len()) {
        // Of another result. That there is none is the rule.
        let _ = fs::remove_file(folder.join(format.file_name()));
    }
    written
}
