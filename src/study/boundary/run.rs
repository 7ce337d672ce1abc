//! Making a boundary.

use std::time::Instant;

use glam::DVec3;

use super::map::map;
use super::result::{Boundary, BoundaryCurve, BoundaryPoint, CurveEnd, word};
use super::{BoundaryRequest, MOST_CURVES};
use crate::branch::boundary::{self as curves, Halt, Plane, Stride, Verified};
use crate::branch::{Critical, Family, Refined};
use crate::leaf::Grid;
use crate::scenario::Scenario;
use crate::study::trace::{TraceError, TraceRequest, trace_seen};

/// Longest step along a curve where few values are asked for.
const LONGEST: f64 = 0.1;

/// A critical point that lies on a curve: the same numbers and tips within these.
const SAME: [f64; 2] = [1e-7, 1e-4];

/// A critical point of a branch along the first number.
struct Start {
    critical: Critical,
    refined: Refined,
}

/// The curves on which the index of a leaf changes in the plane of two numbers, through
/// the critical points of a trace along the first. `progress` is told of each point: the
/// curve (none of the trace itself), how many points there are, and the values.
///
/// # Errors
/// Requests that cannot be met; all that happens on the way is in the result.
pub fn boundary(
    request: &BoundaryRequest,
    progress: &mut dyn FnMut(Option<usize>, usize, [f64; 2]),
) -> Result<Boundary, TraceError> {
    request.check()?;
    let clock = Instant::now();
    let (vary, across) = (&request.trace.vary, &request.across);
    let ends = [vary, across].map(|it| [it.values[0], it.values[it.values.len() - 1]]);
    let base = &request.trace.base;
    let make = |[first, second]: [f64; 2]| -> Result<Scenario, String> {
        let at = base.at(&[(&vary.keys, first), (&across.keys, second)]);
        Ok(at.map_err(|refused| refused.to_string())?.scenario)
    };
    for second in ends[1] {
        base.at(&[(&vary.keys, ends[0][0]), (&across.keys, second)])?;
    }
    let [low, high] = [ends[1][0].min(ends[1][1]), ends[1][0].max(ends[1][1])];
    let present = base.number(&across.keys);
    let start = present.filter(|value| (low..=high).contains(value));
    let start = start.unwrap_or(ends[1][0]);
    let along = TraceRequest {
        base: base.with(&across.keys, start)?,
        ..request.trace.clone()
    };
    let mut starts: Vec<Start> = Vec::new();
    let trace = trace_seen(
        &along,
        &mut |_, points, value| progress(None, points, [value, start]),
        &mut |followed| {
            let critical = followed.branch.critical.iter().zip(&followed.critical);
            starts.extend(critical.map(|((_, critical), refined)| Start {
                critical: critical.clone(),
                refined: refined.clone(),
            }));
        },
    )?;
    let mut boundary = Boundary {
        scenario: trace.scenario,
        keys: [vary.keys.clone(), across.keys.clone()],
        ranges: ends,
        log: [vary.log, across.log],
        start,
        units: trace.units,
        rods: trace.rods,
        joined: trace.joined,
        tolerance: trace.tolerance,
        complete: false,
        remark: trace.remark,
        curves: Vec::new(),
        map: None,
        wall_seconds: 0.0,
    };
    let first = |value: f64| make([value, start]);
    let family = Family::new(&first, (ends[0][0], ends[0][1]), vary.log);
    let family = family.map_err(|out| TraceError::Vary(format!("{}: {out}", vary.keys)))?;
    let plane = Plane {
        family: &family,
        make: &make,
        range: ends[1],
        log: across.log,
    };
    let how = Stride {
        longest: (1.0 / (across.values.len() - 1) as f64).min(LONGEST),
        most: request.trace.most_points,
        accuracy: trace.tolerance,
    };
    let second = plane.fraction(start);
    let mut found: Vec<curves::Boundary> = Vec::new();
    for it in &starts {
        if found.iter().any(|curve| passes(curve, it, second)) {
            continue;
        }
        let number = found.len();
        if number == MOST_CURVES {
            boundary.remark = Some(format!("there are more than {MOST_CURVES} curves"));
            break;
        }
        let finest = it.refined.grid.sigma();
        let stride = (finest.len() - 1) / it.critical.state.segments();
        let stations: Vec<f64> = finest.iter().copied().step_by(stride).collect();
        let grid = Grid::through(&stations, family.first().kinks());
        let mut tell = |points, place| progress(Some(number), points, plane.values(place));
        found.push(curves::follow(
            plane,
            &grid,
            &it.critical,
            second,
            &how,
            &mut tell,
        ));
    }
    let whole = found
        .iter()
        .flat_map(|curve| curve.ends)
        .all(Halt::complete);
    if found.is_empty() && boundary.remark.is_none() {
        let at = across.keys.text(start);
        let (vary, across) = (&vary.keys, &across.keys);
        let why = format!("along {vary} the index changes nowhere at {across} = {at}");
        boundary.remark = Some(why);
    }
    boundary.complete = whole && trace.complete && boundary.remark.is_none();
    if !trace.complete && boundary.remark.is_none() {
        boundary.remark = Some(
            "not all branches along the first number are followed to \
                               their ends: see a trace of it alone"
                .into(),
        );
    }
    let units = |curve: &curves::Boundary| BoundaryCurve {
        kind: curve.kind,
        multiplicity: curve.neutral,
        ends: curve.ends.map(CurveEnd),
        points: (curve.points.iter().enumerate())
            .map(|(k, point)| in_units(&plane, boundary.joined, k + 1, point))
            .collect(),
    };
    boundary.curves = found.iter().map(units).collect();
    if let Some(cells) = request.map {
        boundary.map = Some(map(&request.trace, across, cells, &boundary)?);
    }
    boundary.wall_seconds = clock.elapsed().as_secs_f64();
    Ok(boundary)
}

/// Whether a curve passes through a critical point along the first number.
fn passes(curve: &curves::Boundary, start: &Start, second: f64) -> bool {
    let Start { critical, refined } = start;
    curve.points.iter().any(|point| {
        let off = (point.place[0] - refined.fraction).abs();
        let within = SAME[0] + point.errors[0] + refined.fraction_error;
        let mut tips = point.tips.iter().zip(&refined.tips);
        let shift = |a: &[f64; 3], b: &[f64; 3]| DVec3::from(*a).distance(DVec3::from(*b));
        (point.place[1] - second).abs() < SAME[0]
            && point.kind == critical.kind
            && off < within
            && tips.all(|(a, b)| shift(a, b) < SAME[1])
    })
}

/// A point in the scenario's units.
fn in_units(plane: &Plane, joined: bool, number: usize, point: &Verified) -> BoundaryPoint {
    let length = plane.family.scale().length;
    let values = plane.values(point.place);
    let beyond = plane.values([0, 1].map(|i| point.place[i] + point.errors[i]));
    let tips = (point.tips.iter()).map(|tip| DVec3::from_array(*tip) * length);
    let nodes = point.state.segments() + 1;
    BoundaryPoint {
        point: number,
        kind: word(point.kind, point.special),
        values,
        errors: [0, 1].map(|i| (beyond[i] - values[i]).abs()),
        tips: tips.take(if joined { 1 } else { usize::MAX }).collect(),
        error: point.error * length,
        index_before: point.indices[0],
        index_behind: point.indices[1],
        stations: point.stations.clone(),
        curves: (point.state.x.chunks(nodes))
            .map(|rod| rod.iter().map(|x| *x * length).collect())
            .collect(),
    }
}
