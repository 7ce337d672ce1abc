//! `trace.csv`: every point of every branch.

use std::io::{self, Write};

use serde::Serialize;

use super::table::csv_without_header;
use crate::study::{PointKind, Trace, TracePoint};

/// `value` is that of the varied number. Branches and points are numbered from 1. The tip is
/// the joint one, or the first rod's.
const COLUMNS: [&str; 16] = [
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

/// Further columns if tips are held: the force on their holder.
const REACTION: [&str; 3] = ["reaction_x", "reaction_y", "reaction_z"];

/// `trace.csv`: one row per branch and point.
pub fn trace_table(trace: &Trace, out: &mut dyn Write) -> io::Result<()> {
    let mut table = csv_without_header(out);
    let more = if trace.held { REACTION.len() } else { 0 };
    table.serialize((COLUMNS, &REACTION[..more]))?;
    for (number, branch) in trace.branches.iter().enumerate() {
        for point in &branch.points {
            let reaction = point.reaction.unwrap_or_default().to_array();
            let reaction = reaction.map(|x| x + 0.0);
            table.serialize((number + 1, point.point, cells(point), &reaction[..more]))?;
        }
    }
    table.flush()
}

/// The columns from `kind` to `twist`.
fn cells(point: &TracePoint) -> impl Serialize {
    let tip = point.tips.first();
    // Adding zero turns -0 into 0.
    let tip = tip.map_or([f64::NAN; 3], |tip| tip.to_array().map(|x| x + 0.0));
    let multiplicity = match point.kind {
        PointKind::Branching(modes) => Some(modes),
        _ => None,
    };
    let margin = point.undulation.margin();
    (
        (point.kind.word(), point.value, point.value_error),
        (tip, point.error, point.energy),
        (point.index, point.index == 0, multiplicity),
        margin.map(|vein| vein.waves()),
        margin.map(|vein| vein.amplitude),
        point.undulation.twist() + 0.0,
    )
}
