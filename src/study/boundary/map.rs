//! The coarse map under the curves of a boundary: the index in cells of the plane, from
//! traces along its rows, which know nothing of the curves.

use rayon::prelude::*;

use super::known::criticals;
use super::result::{Boundary, BoundaryCurve, BoundaryMap};
use crate::branch::{Critical, Refined};
use crate::study::Vary;
use crate::study::trace::{PointKind, TraceBranch, TraceError, TraceRequest};

/// Most cells along a side.
pub const MOST_CELLS: usize = 256;

/// The middles of so many cells of a range.
fn middles(vary: &Vary, cells: usize) -> Vec<f64> {
    let (from, to) = (vary.values[0], vary.values[vary.values.len() - 1]);
    let part = |k: usize| (k as f64 + 0.5) / cells as f64;
    let value = |part: f64| match vary.log {
        true => from * (to / from).powf(part),
        false => from + (to - from) * part,
    };
    (0..cells).map(|k| value(part(k))).collect()
}

/// A row of the map: a trace along the first number.
pub struct Row {
    /// The second number.
    pub second: f64,
    /// The index in the cells.
    index: Vec<Option<usize>>,
    /// Critical points that the trace met.
    pub criticals: Vec<(Critical, Refined)>,
}

/// The rows of a map of so many cells along both numbers.
pub fn rows(
    along: &TraceRequest,
    across: &Vary,
    cells: [usize; 2],
) -> Result<Vec<Row>, TraceError> {
    let first = middles(&along.vary, cells[0]);
    let row = |&second: &f64| -> Result<Row, TraceError> {
        let request = TraceRequest {
            base: along.base.with(&across.keys, second)?,
            switch: false,
            ..along.clone()
        };
        let (found, criticals) = criticals(&request, &mut |_, _| {})?;
        let branch = found.branches.first();
        let index = first.iter();
        let index = index.map(|value| branch.and_then(|branch| index_at(branch, *value)));
        Ok(Row {
            second,
            index: index.collect(),
            criticals,
        })
    };
    middles(across, cells[1]).par_iter().map(row).collect()
}

/// The map of these rows, compared with the curves that are known.
pub fn compared(vary: &Vary, rows: Vec<Row>, boundary: &Boundary) -> BoundaryMap {
    let mut map = BoundaryMap {
        first: middles(vary, rows[0].index.len()),
        second: rows.iter().map(|row| row.second).collect(),
        index: rows.into_iter().map(|row| row.index).collect(),
        disagreeing: Vec::new(),
    };
    for (r, row) in map.index.iter().enumerate() {
        let expected = expected(boundary, &map.first, map.second[r], row);
        let wrong = row.iter().zip(&expected).enumerate();
        let wrong = wrong.filter(|(_, (found, expected))| found != expected);
        map.disagreeing.extend(wrong.map(|(c, _)| [c + 1, r + 1]));
    }
    map
}

/// The index of a branch where it passes a value for the first time, before it turns.
fn index_at(branch: &TraceBranch, value: f64) -> Option<usize> {
    for pair in branch.points.windows(2) {
        let [a, b] = [pair[0].value, pair[1].value];
        if (value - a) * (value - b) <= 0.0 {
            return Some(pair[0].index);
        }
        if pair[1].kind == PointKind::Fold {
            return None;
        }
    }
    None
}

/// What the curves make of a row of which the first index is known: at each of them that
/// has this index on one side it becomes that on the other; at a fold the branch ends.
fn expected(
    boundary: &Boundary,
    first: &[f64],
    second: f64,
    row: &[Option<usize>],
) -> Vec<Option<usize>> {
    let forward = boundary.ranges[0][1] > boundary.ranges[0][0];
    let mut passed: Vec<(f64, bool, [usize; 2])> = (boundary.curves.iter())
        .flat_map(|curve| crossings(boundary, curve, second))
        .collect();
    passed.sort_by(|a, b| match forward {
        true => a.0.total_cmp(&b.0),
        false => b.0.total_cmp(&a.0),
    });
    let mut passed = passed.into_iter().peekable();
    let mut now = None;
    let mut expected = Vec::with_capacity(row.len());
    for (k, (value, found)) in first.iter().zip(row).enumerate() {
        let mut crossed = Vec::new();
        while let Some(next) = passed.next_if(|next| (next.0 < *value) == forward) {
            crossed.push(next);
        }
        if k == 0 {
            now = *found;
        } else {
            for (_, fold, indices) in crossed {
                now = match (now, fold) {
                    (Some(index), true) if indices.contains(&index) => None,
                    (Some(index), false) if index == indices[0] => Some(indices[1]),
                    (Some(index), false) if index == indices[1] => Some(indices[0]),
                    (now, _) => now,
                };
            }
        }
        expected.push(now);
    }
    expected
}

/// Points closer than this part of both ranges are one: polynomials through both would
/// make slopes of their errors.
const APART: f64 = 1e-4;

/// Where a curve passes a value of the second number: the first number, whether it is a
/// fold, and the indices on both sides.
fn crossings(
    boundary: &Boundary,
    curve: &BoundaryCurve,
    second: f64,
) -> Vec<(f64, bool, [usize; 2])> {
    let scaled = |which: usize, value: f64| match boundary.log[which] {
        true => (value / boundary.ranges[which][0]).ln(),
        false => value,
    };
    let unscaled = |value: f64| match boundary.log[0] {
        true => boundary.ranges[0][0] * value.exp(),
        false => value,
    };
    let spans = [0, 1].map(|i| {
        let [from, to] = boundary.ranges[i];
        (scaled(i, to) - scaled(i, from)).abs()
    });
    let (mut kept, mut points) = (Vec::new(), Vec::<[f64; 2]>::new());
    for point in &curve.points {
        let place = [0, 1].map(|i| scaled(i, point.values[i]));
        let far = |i: usize, last: &[f64; 2]| (place[i] - last[i]).abs() > APART * spans[i];
        if (points.last()).is_none_or(|last| far(0, last) || far(1, last)) {
            kept.push(point);
            points.push(place);
        }
    }
    let at = scaled(1, second);
    let mut crossings = Vec::new();
    for k in 1..points.len() {
        let [low, high] = [points[k - 1][1], points[k][1]];
        if (low < at) == (high < at) {
            continue;
        }
        // Through four points where the second number goes one way along them, or two.
        let few = k.saturating_sub(2)..(k + 2).min(points.len());
        let rises = |pair: &[[f64; 2]]| (pair[1][1] > pair[0][1]) == (high > low);
        let near = match points[few.clone()].windows(2).all(rises) {
            true => &points[few],
            false => &points[k - 1..=k],
        };
        // Where curves cross, other modes count as well.
        let point = if kept[k].kind == "crossing" {
            kept[k - 1]
        } else {
            kept[k]
        };
        let fold = matches!(point.kind, "fold" | "cusp") && curve.multiplicity == 1;
        let sides = [point.index_before, point.index_behind];
        crossings.push((unscaled(through(near, at)), fold, sides));
    }
    crossings
}

/// The polynomial through points, at a value of their second coordinate.
fn through(points: &[[f64; 2]], at: f64) -> f64 {
    let mut sum = 0.0;
    for (i, [value, own]) in points.iter().enumerate() {
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        let weight: f64 = others
            .map(|(_, [_, other])| (at - other) / (own - other))
            .product();
        sum += weight * value;
    }
    sum
}
