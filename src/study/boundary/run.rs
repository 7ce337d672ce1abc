//! Making a boundary.

use std::time::Instant;

use glam::DVec3;

use super::known::{Known, Start, criticals};
use super::map::{compared, rows};
use super::result::{Boundary, BoundaryCurve, BoundaryPoint, CurveEnd, word};
use super::{BoundaryRequest, MOST_CURVES};
use crate::branch::boundary::{self as curves, Plane, Stride, Verified};
use crate::branch::{Critical, Family, Refined};
use crate::leaf::Grid;
use crate::scenario::Scenario;
use crate::study::trace::{TraceError, TraceRequest};

/// Longest step along a curve where few values are asked for.
const LONGEST: f64 = 0.1;

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
    let (trace, criticals) = criticals(&along, &mut |points, value| {
        progress(None, points, [value, start]);
    })?;
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
        factorizations: 0,
        wall_seconds: 0.0,
    };
    let mut run = Run {
        request,
        make: &make,
        accuracy: trace.tolerance,
        known: Vec::new(),
        tried: 0,
        progress,
    };
    run.follow_new(start, &criticals, &mut boundary)?;
    if let Some(cells) = request.map {
        let rows = rows(&request.trace, across, cells)?;
        // One after the other, so that it is the same on any number of threads.
        for row in &rows {
            run.follow_new(row.second, &row.criticals, &mut boundary)?;
        }
        boundary.map = Some(compared(vary, rows, &boundary));
    }
    let curves = &boundary.curves;
    let whole = (curves.iter().flat_map(|curve| curve.ends)).all(CurveEnd::complete);
    if curves.is_empty() && boundary.remark.is_none() {
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
    boundary.wall_seconds = clock.elapsed().as_secs_f64();
    Ok(boundary)
}

/// Following curves.
struct Run<'r, 'p> {
    request: &'r BoundaryRequest,
    make: &'r (dyn Fn([f64; 2]) -> Result<Scenario, String> + Sync),
    accuracy: f64,
    known: Vec<Known>,
    /// Critical points from which curves were followed.
    tried: usize,
    progress: &'p mut dyn FnMut(Option<usize>, usize, [f64; 2]),
}

impl Run<'_, '_> {
    /// Follows the curves through critical points at a value of the second number that lie
    /// on none that is known.
    fn follow_new(
        &mut self,
        second: f64,
        criticals: &[(Critical, Refined)],
        boundary: &mut Boundary,
    ) -> Result<(), TraceError> {
        if criticals.is_empty() {
            return Ok(());
        }
        let (vary, across) = (&self.request.trace.vary, &self.request.across);
        let first = |value: f64| (self.make)([value, second]);
        let [from, to] = boundary.ranges[0];
        let family = Family::new(&first, (from, to), vary.log);
        let family = family.map_err(|out| TraceError::Vary(format!("{}: {out}", vary.keys)))?;
        let plane = Plane {
            family: &family,
            make: self.make,
            range: boundary.ranges[1],
            log: across.log,
        };
        let how = Stride {
            longest: (1.0 / (across.values.len() - 1) as f64).min(LONGEST),
            most: self.request.trace.most_points,
            accuracy: self.accuracy,
        };
        for (critical, refined) in criticals {
            let start = Start {
                critical,
                refined,
                second: plane.fraction(second),
                length: family.scale().length,
            };
            if self.known.iter().any(|known| start.is_on(known)) {
                continue;
            }
            if self.tried == MOST_CURVES {
                boundary.remark = Some(format!("there are more than {MOST_CURVES} curves"));
                break;
            }
            self.tried += 1;
            let number = boundary.curves.len();
            let finest = start.refined.grid.sigma();
            let stride = (finest.len() - 1) / start.critical.state.segments();
            let stations: Vec<f64> = finest.iter().copied().step_by(stride).collect();
            let grid = Grid::through(&stations, family.first().kinks());
            let progress = &mut *self.progress;
            let mut tell = |points, place| progress(Some(number), points, plane.values(place));
            let curve = curves::follow(plane, &grid, start.critical, start.second, &how, &mut tell);
            let work = curve.points.iter().map(|point| point.factorizations);
            boundary.factorizations += work.sum::<usize>();
            boundary
                .curves
                .push(in_units(&plane, boundary.joined, &curve));
            let length = start.length;
            self.known.push(Known { curve, length });
        }
        Ok(())
    }
}

/// A curve in the scenario's units.
fn in_units(plane: &Plane, joined: bool, curve: &curves::Boundary) -> BoundaryCurve {
    BoundaryCurve {
        kind: curve.kind,
        multiplicity: curve.neutral,
        ends: curve.ends.map(CurveEnd),
        points: (curve.points.iter().enumerate())
            .map(|(k, point)| point_in_units(plane, joined, k + 1, point))
            .collect(),
    }
}

/// A point in the scenario's units.
fn point_in_units(plane: &Plane, joined: bool, number: usize, point: &Verified) -> BoundaryPoint {
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
