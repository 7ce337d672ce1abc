//! Files: each complete or absent, never half written, and recordings that grow.

mod atomic;
mod checksum;
mod journal;
mod part;
mod peers;
mod recording;

use std::fs;
use std::path::{Path, PathBuf};

pub use atomic::{abandon_unfinished, check_writable};
pub use journal::{Journal, belongs, claim, write_rows};
pub use peers::{PeersError, read_peers};
pub use recording::{CannotResume, Keeper, Recording};

use crate::figure::{FigurePng, FigureSvg, ModesFigure, MotionFigure};
use crate::relax::Equilibrium;
use crate::report::{
    Centerlines, ChartSummary, ChartTable, CheckSummary, Format, Json, MapSummary, MapTable,
    ModesTable, MotionSummary, OutputError, ScalingTable, TraceSummary, TraceTable, Written,
};
use crate::simulate::Record;
use crate::study::{All, Chart, Check, Map, Scaling, Trace};

impl Written for Equilibrium {
    const FORMATS: &'static [&'static dyn Format<Self>] =
        &[&Json("summary.json"), &Centerlines, &FigureSvg, &FigurePng];

    const MORE: &'static [&'static dyn Format<Self>] =
        &[&ModesTable, &ModesFigure::SVG, &ModesFigure::PNG];

    fn has_more(&self) -> bool {
        let stability = &self.stability;
        stability.mode_shapes
            && stability
                .modes
                .as_ref()
                .is_some_and(|modes| !modes.is_empty())
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
    const FORMATS: &'static [&'static dyn Format<Self>] =
        &[&Json("equilibria.json"), &FigureSvg, &FigurePng];
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
