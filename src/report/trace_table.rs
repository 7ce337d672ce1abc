//! `trace.csv`: every point of every branch.

use std::io::{self, Write};

use super::Format;
use crate::study::Trace;

/// `trace.csv`: one row per branch and point.
pub struct TraceTable;

/// Names of the columns; the number that varies stands in `value`. Branches and
/// points are numbered from 1. The tip is the joint one, or the first rod's.
const HEADER: [&str; 16] = [
    "branch",
    "point",
    "kind",
    "value",
    "value_error",
    "tip_x",
    "tip_y",
    "tip_z",
    "error",
    "energy",
    "negative_eigenvalues",
    "stable",
    "multiplicity",
    "margin_waves",
    "margin_amplitude",
    "twist",
];

impl Format<Trace> for TraceTable {
    fn file_name(&self) -> &'static str {
        "trace.csv"
    }

    fn write(&self, trace: &Trace, out: &mut dyn Write) -> io::Result<()> {
        use crate::study::PointKind::Branching;
        let mut table = csv::WriterBuilder::new()
            .has_headers(false)
            .from_writer(out);
        table.write_record(HEADER)?;
        for (b, branch) in trace.branches.iter().enumerate() {
            for (p, point) in branch.points.iter().enumerate() {
                let tip = point
                    .tips
                    .first()
                    .map_or([f64::NAN; 3], |tip| tip.to_array());
                let margin = point.undulation.margin();
                let multiplicity = match point.kind {
                    Branching(modes) => Some(modes),
                    _ => None,
                };
                table.serialize((
                    (
                        b + 1,
                        p + 1,
                        point.kind.word(),
                        point.value,
                        point.value_error,
                    ),
                    // Adding zero turns -0 into 0.
                    tip.map(|value| value + 0.0),
                    (
                        point.error,
                        point.energy,
                        point.index,
                        point.index == 0,
                        multiplicity,
                    ),
                    (
                        margin.map(|vein| vein.waves()),
                        margin.map(|vein| vein.amplitude),
                        point.undulation.twist() + 0.0,
                    ),
                ))?;
            }
        }
        table.flush()
    }
}
