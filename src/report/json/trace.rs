//! `trace.json`: the branches, their ends, and the points where the index changes.

use std::io::{self, Write};

use serde::Serialize;

use super::{Point, points, tips, write};
use crate::report::Format;
use crate::study::{Law, Trace, TraceBranch, TracePoint};

/// `trace.json`, which is also what `--json` prints.
pub struct TraceSummary;

impl Format<Trace> for TraceSummary {
    fn file_name(&self) -> &'static str {
        "trace.json"
    }

    fn write(&self, trace: &Trace, out: &mut dyn Write) -> io::Result<()> {
        write(&Object::from(trace), out)
    }
}

/// The keys, in the order in which they are written.
#[derive(Serialize)]
struct Object {
    scenario: String,
    vary: String,
    range: [f64; 2],
    rods: usize,
    segments: usize,
    tolerance: f64,
    complete: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    remark: Option<String>,
    branches: Vec<BranchObject>,
    law: Option<LawObject>,
    factorizations: usize,
    wall_seconds: f64,
}

#[derive(Serialize)]
struct BranchObject {
    /// Branch and point, from 1, from which it was entered.
    from: Option<[usize; 2]>,
    points: usize,
    end: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    remark: Option<String>,
    first: PointObject,
    last: PointObject,
    critical: Vec<PointObject>,
}

#[derive(Serialize)]
struct PointObject {
    point: usize,
    kind: &'static str,
    value: f64,
    value_error: Option<f64>,
    tip: Option<Point>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tips: Option<Vec<Point>>,
    error: Option<f64>,
    energy: f64,
    negative_eigenvalues: usize,
    stable: bool,
}

#[derive(Serialize)]
struct LawObject {
    axis: char,
    slope: f64,
    r_squared: f64,
    deviation: f64,
    length: f64,
    young: Option<f64>,
}

impl From<&Trace> for Object {
    fn from(trace: &Trace) -> Self {
        Object {
            scenario: trace.scenario.clone(),
            vary: trace.keys.to_string(),
            range: trace.range,
            rods: trace.rods,
            segments: trace.segments,
            tolerance: trace.tolerance,
            complete: trace.complete(),
            remark: trace.remark.clone(),
            branches: trace.branches.iter().filter_map(branch).collect(),
            law: trace.law.map(LawObject::from),
            factorizations: trace.factorizations,
            wall_seconds: trace.wall_seconds,
        }
    }
}

fn branch(branch: &TraceBranch) -> Option<BranchObject> {
    let last = branch.points.len().checked_sub(1)?;
    Some(BranchObject {
        from: branch.from.map(|from| from.map(|k| k + 1)),
        points: branch.points.len(),
        end: branch.end.word(),
        remark: branch.remark.clone(),
        first: point(0, &branch.points[0]),
        last: point(last, &branch.points[last]),
        critical: branch
            .critical()
            .map(|(k, found)| point(k, found))
            .collect(),
    })
}

fn point(number: usize, point: &TracePoint) -> PointObject {
    let (tip, tips) = match point.tips.len() {
        0 => (None, Some(points([]))),
        _ => tips(&point.tips),
    };
    PointObject {
        point: number + 1,
        kind: point.kind.word(),
        value: point.value,
        value_error: point.value_error,
        tip,
        tips,
        error: point.error,
        energy: point.energy,
        negative_eigenvalues: point.index,
        stable: point.index == 0,
    }
}

impl From<Law> for LawObject {
    fn from(law: Law) -> Self {
        LawObject {
            axis: ['x', 'y', 'z'][law.axis],
            slope: law.slope,
            r_squared: law.r_squared,
            deviation: law.deviation,
            length: law.length,
            young: law.young,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, text};
    use super::*;
    use crate::report::sample;

    #[test]
    fn the_keys_are_those_of_the_readme() {
        let text = text(&TraceSummary, &sample::trace());
        let wanted = [
            "scenario",
            "vary",
            "range",
            "rods",
            "segments",
            "tolerance",
            "complete",
            "branches",
            "law",
            "factorizations",
            "wall_seconds",
        ];
        assert_eq!(keys(&text), wanted);
        let object: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(object["branches"][1]["from"], serde_json::json!([1, 6]));
        assert_eq!(object["branches"][0]["critical"][0]["kind"], "branch-point");
        assert_eq!(
            object["branches"][0]["critical"][0]["negative_eigenvalues"],
            1
        );
        assert_eq!(object["law"]["axis"], "x");
    }
}
