//! Computation of a boundary.

use std::time::Instant;

use glam::DVec3;

use super::known::{Start, coarsened, remove_known, traced};
use super::map::{Cells, Unexplained};
use super::neighbours::add_leaves;
use super::result::{Boundary, BoundaryCurve, BoundaryMap, BoundaryPoint, CurveEnd, word};
use super::{BoundaryRequest, MOST_CURVES};
use crate::branch::Family;
use crate::branch::boundary::{
    self as curves, Accuracy, AtRest, Plane, Solution, Verified, WalkOptions,
};
use crate::scenario::Scenario;
use crate::study::trace::{TraceError, TraceRequest};

/// Longest step along a curve if few values are asked for.
const LONGEST: f64 = 0.1;

/// Longest step along curves that are followed for a map.
const OF_MAP: f64 = 0.04;

/// Accuracy of parameters, as parts of their ranges, relative to that of tips; not for
/// curves that are followed for a map only.
const EXACTER: f64 = 1e-2;

/// The curves on which the index of a leaf changes in the plane of two parameters, through
/// the critical points of a trace along the first. `progress` is called for each point: with
/// the curve (none for the trace itself), the number of points, and the values.
///
/// # Errors
/// Requests that cannot be met; failures during the run are part of the result.
pub fn boundary(
    request: &BoundaryRequest,
    progress: &mut (dyn FnMut(Option<usize>, usize, [f64; 2]) + Send),
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
    let begun = traced(&along, &mut |points, value| {
        progress(None, points, [value, start]);
    })?;
    let (trace, first) = (begun.trace, |value: f64| make([value, start]));
    let family = Family::new(&first, (ends[0][0], ends[0][1]), vary.log);
    let family = family.map_err(|out| TraceError::Vary(format!("{}: {out}", vary.keys)))?;
    let plane = Plane {
        family: &family,
        make: &make,
        range: ends[1],
        log: across.log,
    };
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
        factorizations: trace.factorizations,
        wall_seconds: 0.0,
    };
    let mut run = Run {
        plane,
        how: WalkOptions {
            longest: (1.0 / (across.values.len() - 1) as f64).min(LONGEST),
            most: request.trace.most_points,
            accuracy: Accuracy {
                tips: trace.tolerance,
                numbers: EXACTER * trace.tolerance,
            },
        },
        known: Vec::new(),
        tried: 0,
        progress,
    };
    for (critical, refined) in &begun.critical {
        let start = Start {
            critical,
            refined,
            from: [0.0, plane.fraction(start)],
            direction: [1.0, 0.0],
        };
        run.follow_new(&start, &mut boundary);
    }
    if let (Some(size), Some((point, grid))) = (request.map, begun.first) {
        let kinks = family.first().kinks();
        let first = AtRest {
            grid: coarsened(&grid, point.state.segments(), kinks),
            index: point.index,
            solution: Solution {
                state: point.state,
                params: [0.0, plane.fraction(start)],
            },
        };
        boundary.map = Some(run.map(size, first, &mut boundary));
    }
    add_leaves(plane, &run.known, &mut boundary);
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

/// The run that follows the curves.
struct Run<'r, 'p> {
    plane: Plane<'r>,
    how: WalkOptions,
    known: Vec<curves::Boundary>,
    /// Number of critical points from which curves were started.
    tried: usize,
    progress: &'p mut (dyn FnMut(Option<usize>, usize, [f64; 2]) + Send),
}

impl Run<'_, '_> {
    /// Follows the curve through a critical point, unless it lies on a known one.
    fn follow_new(&mut self, start: &Start, boundary: &mut Boundary) {
        if self.known.iter().any(|known| start.is_on(known)) {
            return;
        }
        if self.tried == MOST_CURVES {
            boundary.remark = Some(format!("there are more than {MOST_CURVES} curves"));
            return;
        }
        self.tried += 1;
        let (plane, progress) = (self.plane, &mut *self.progress);
        let number = boundary.curves.len();
        let mut report = |points, params| progress(Some(number), points, plane.values(params));
        let grid = start.grid(plane.family.first().kinks());
        let mut curve = curves::follow(plane, &grid, &start.seed(), &self.how, &mut report);
        boundary.factorizations += curve.factorizations;
        if !curve.points.is_empty() {
            remove_known(&mut curve, &self.known);
            if curve.points.is_empty() {
                return;
            }
        }
        (boundary.curves).push(in_units(&plane, boundary.joined, &curve));
        self.known.push(curve);
    }

    /// The map of so many cells, continued from an equilibrium. Critical points on the paths that
    /// lie on no known curve start new ones; sequentially, so that the result does not depend on
    /// the number of threads, and with longer steps than those of the trace, for the map alone.
    fn map(&mut self, size: [usize; 2], first: AtRest, boundary: &mut Boundary) -> BoundaryMap {
        let accuracy = self.how.accuracy.tips;
        self.how.longest = self.how.longest.max(OF_MAP);
        self.how.accuracy.numbers = accuracy;
        let mut cells = Cells::new(self.plane, size, boundary.joined);
        let mut next = Some(cells.begin(first, &self.known));
        while let Some(unexplained) = next {
            for Unexplained {
                ends,
                grid,
                critical,
            } in &unexplained
            {
                let [from, to] = *ends;
                for critical in critical {
                    let refined =
                        curves::refine_on_path(&self.plane, *ends, grid, critical, accuracy);
                    if let Ok(refined) = &refined {
                        let direction = [0, 1].map(|i| to[i] - from[i]);
                        let start = Start {
                            critical,
                            refined,
                            from,
                            direction,
                        };
                        self.follow_new(&start, boundary);
                    }
                }
            }
            next = cells.advance(&self.known);
        }
        boundary.factorizations += cells.factorizations;
        cells.compared(&self.known)
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
        beside: Vec::new(),
    }
}

/// A point in the scenario's units.
fn point_in_units(plane: &Plane, joined: bool, number: usize, point: &Verified) -> BoundaryPoint {
    let length = plane.family.scale().length;
    let values = plane.values(point.params);
    let beyond = plane.values([0, 1].map(|i| point.params[i] + point.errors[i]));
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
