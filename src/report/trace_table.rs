//! `trace.csv`: every point of every branch.

use std::io::{self, Write};

use serde::Serialize;

use super::table::{append_csv, header};
use crate::study::{PointKind, Trace, TracePoint};

/// A row; `value` is that of the varied number. Branches and points are numbered
/// from 1. The tip is the joint one, or the first rod's.
#[derive(Default, Serialize)]
struct Row {
    branch: usize,
    point: usize,
    kind: &'static str,
    value: f64,
    value_error: Option<f64>,
    tip_x: f64,
    tip_y: f64,
    tip_z: f64,
    error: Option<f64>,
    energy: f64,
    negative_eigenvalues: usize,
    stable: bool,
    multiplicity: Option<usize>,
    margin_waves: Option<f64>,
    margin_amplitude: Option<f64>,
    twist: f64,
}

/// Further columns if tips are held: the force on their holder.
#[derive(Default, Serialize)]
struct Reaction {
    reaction_x: f64,
    reaction_y: f64,
    reaction_z: f64,
}

impl Reaction {
    fn of(point: &TracePoint) -> Self {
        let [reaction_x, reaction_y, reaction_z] =
            (point.reaction.unwrap_or_default().to_array()).map(|x| x + 0.0);
        Reaction {
            reaction_x,
            reaction_y,
            reaction_z,
        }
    }
}

impl Row {
    fn of(branch: usize, point: &TracePoint) -> Self {
        let tip = point.tips.first();
        // Adding zero turns -0 into 0.
        let [tip_x, tip_y, tip_z] =
            tip.map_or([f64::NAN; 3], |tip| tip.to_array().map(|x| x + 0.0));
        let margin = point.undulation.margin();
        Row {
            branch: branch + 1,
            point: point.point,
            kind: point.kind.word(),
            value: point.value,
            value_error: point.value_error,
            tip_x,
            tip_y,
            tip_z,
            error: point.error,
            energy: point.energy,
            negative_eigenvalues: point.index,
            stable: point.index == 0,
            multiplicity: match point.kind {
                PointKind::Branching(modes) => Some(modes),
                _ => None,
            },
            margin_waves: margin.map(|vein| vein.waves()),
            margin_amplitude: margin.map(|vein| vein.amplitude),
            twist: point.undulation.twist() + 0.0,
        }
    }
}

/// `trace.csv`: one row per branch and point.
pub fn trace_table(trace: &Trace, out: &mut dyn Write) -> io::Result<()> {
    let branches = trace.branches.iter().enumerate();
    let points = branches.flat_map(|(b, branch)| branch.points.iter().map(move |p| (b, p)));
    // A trace without points has a header, too.
    match trace.held {
        false => {
            out.write_all(&header(Row::default()))?;
            append_csv(points.map(|(b, p)| Row::of(b, p)), out)
        }
        true => {
            out.write_all(&header((Row::default(), Reaction::default())))?;
            append_csv(points.map(|(b, p)| (Row::of(b, p), Reaction::of(p))), out)
        }
    }
}
