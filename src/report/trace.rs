//! The summary of a trace that people read.

use std::path::Path;

use crate::report::numbers::power_of_ten;
use crate::report::words::branch_end;
use crate::study::{PointKind, Trace, TracePoint};

use super::numbers::{seconds, veins_of};
use super::table::{lay_out, written};

/// The branches, their ends, and where the index changes.
pub fn report(trace: &Trace, folder: Option<&Path>) -> String {
    let mut lines: Vec<(&str, String)> = vec![(
        "vary",
        format!(
            "{} from {} to {}",
            trace.keys,
            trace.keys.text(trace.range[0]),
            trace.keys.text(trace.range[1])
        ),
    )];
    for (number, branch) in trace.branches.iter().enumerate() {
        let name = match number {
            0 => "branch",
            _ => "",
        };
        let from = match branch.from {
            Some([from, _]) => format!(", off branch {}", from + 1),
            None => String::new(),
        };
        lines.push((
            name,
            format!(
                "{}{from}: {} points, {}",
                number + 1,
                branch.points.len(),
                branch_end(&branch.end)
            ),
        ));
        let mut before = branch.points.first().map_or(0, |point| point.index);
        let first = branch.points.first();
        lines.extend(first.map(|point| ("", format!("  from {}", place(trace, point)))));
        for (_, point) in branch.critical() {
            lines.push(("", format!("  {}", critical(trace, point, before))));
            before = point.index;
        }
        let last = branch.points.last();
        lines.extend(last.map(|point| ("", format!("  to {}", place(trace, point)))));
        lines.extend((branch.remark.iter()).map(|remark| ("", format!("  {remark}"))));
    }
    if let Some(law) = trace.law {
        let unit = match (&trace.units.force, &trace.units.length) {
            (Some(force), Some(length)) => format!(" {force}/{length}"),
            _ => String::new(),
        };
        lines.push((
            "law",
            format!(
                "force against displacement along {}: slope {:.6}{unit}, R² = {:.7}, off the line by {:.2} % at most",
                ['x', 'y', 'z'][law.axis],
                law.slope,
                law.r_squared,
                100.0 * law.deviation
            ),
        ));
        lines.extend(law.young.map(|young| {
            let length = format!("over a length of {:.6}", law.length);
            ("", format!("Young's modulus {young:.6}, {length}"))
        }));
    }
    let errors = trace.branches.iter().flat_map(|branch| &branch.points);
    let errors = errors.filter_map(|point| point.error);
    if let Some(worst) = errors.reduce(f64::max) {
        let worst = format!("tips within {}", power_of_ten(worst));
        lines.push((
            "error",
            format!("{worst}, followed on {} segments a vein", trace.segments),
        ));
    }
    lines.push((
        "work",
        format!(
            "{} factorisations to follow, {} in all",
            trace.factorizations,
            seconds(trace.wall_seconds)
        ),
    ));
    lines.extend(folder.map(|folder| ("written", written(trace, folder))));
    lines.extend((trace.remark.iter()).map(|remark| ("remark", remark.clone())));
    let veins = veins_of(trace.rods, trace.joined);
    lay_out(&format!("{}: {veins}, followed", trace.scenario), &lines)
}

fn place(trace: &Trace, point: &TracePoint) -> String {
    let stability = match point.index {
        0 => "stable".into(),
        index => format!("index {index}"),
    };
    let tip = match &point.tips[..] {
        [tip] => format!(", tip ({:.7}, {:.7}, {:.7})", tip.x, tip.y, tip.z),
        _ => String::new(),
    };
    format!("{}: {stability}{tip}", trace.keys.text(point.value))
}

fn critical(trace: &Trace, point: &TracePoint, before: usize) -> String {
    let what = match point.kind {
        PointKind::Fold => "fold".into(),
        PointKind::Branching(1) | PointKind::Regular => "branches cross".into(),
        PointKind::Branching(modes) => format!("branches cross in {modes} directions"),
    };
    let within = match point.value_error {
        Some(error) => format!(", within {}", power_of_ten(error)),
        None => String::new(),
    };
    let value = trace.keys.text(point.value);
    format!(
        "{what} at {value}{within}: index {before} to {}",
        point.index
    )
}
