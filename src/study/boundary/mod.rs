//! `trace` over two parameters: the boundary of stability as curves in their plane.
//!
//! Curves begin at the critical points of a trace along the first parameter, and at those of the paths by
//! which the cells of a map are reached.

pub(super) mod map;

use crate::branch::boundary::{
    BoundaryAccuracy, BoundaryContinuationOptions, BoundaryNeighbour, BoundarySeed,
    CodimensionTwoKind, ConfirmedEquilibrium, TwoParameterProblem, TwoParameterState,
    VerifiedBoundaryPoint, coarsened, leaves_beside_boundary, refine_on_path,
};
use crate::branch::{BranchEnd, CriticalKind, ParameterRange, boundary, value_at_fraction};
use crate::relax::without_wind_or_followers;
use crate::run::{Instant, RefusedOption};
use crate::scenario::{PlausibilityWarning, Scenario};
use crate::shape::serialize_tips;
use crate::study::ParameterKeys;
use crate::study::boundary::map::{BoundaryMap, IndexMapSweep, remove_repeated_ends};
use crate::study::remark::BoundaryRemark;
use crate::study::trace::{
    LONGEST_BRANCH_STEP, PointOnGrid, RefinedCriticalPoint, Trace, TraceError, TraceRequest,
    trace_with_points,
};
use crate::study::vary::ParameterSweep;
use glam::DVec3;
use serde::ser::Serializer;

/// Largest number of curves of a boundary.
pub const MOST_CURVES: usize = 24;

/// A request for a boundary.
#[derive(Clone, Debug)]
pub struct BoundaryRequest {
    /// The trace along the first parameter whose critical points are followed; it is made
    /// at the scenario's value of the second parameter or, if that is not within the range, at
    /// its start.
    pub trace: TraceRequest,
    /// The second parameter and its range; no step is longer than the distance of its values.
    pub across: ParameterSweep,
    /// Cells of a coarse map under the curves, along both parameters, if requested.
    pub map: Option<[usize; 2]>,
}

impl BoundaryRequest {
    /// Validates the request before it is run.
    fn validate(&self) -> Result<(), TraceError> {
        without_wind_or_followers(self.trace.base.scenario(), "a boundary of stability")?;
        self.trace.validate()?;
        let second = TraceRequest {
            vary: self.across.clone(),
            ..self.trace.clone()
        };
        second.validate()?;
        let (first, second) = (&self.trace.vary.keys, &self.across.keys);
        let shared = first
            .targets()
            .iter()
            .find(|it| second.targets().contains(it));
        if let Some(target) = shared {
            let why = format!("{target}: varies twice; give two numbers that differ");
            return Err(TraceError::Vary(why));
        }
        let possible = |cells: &usize| (1..=map::MOST_CELLS_PER_SIDE).contains(cells);
        if let Some([columns, rows]) = self.map.filter(|map| !map.iter().all(possible)) {
            let most = map::MOST_CELLS_PER_SIDE;
            let why = format!("give from 1 to {most} cells along each number, as 16x16");
            return Err(RefusedOption::new("map", format!("{columns}x{rows}"), why).into());
        }
        Ok(())
    }
}

/// Longest step along curves that are followed for a map.
const LONGEST_MAP_CURVE_STEP: f64 = 0.04;

/// Accuracy of parameters, as parts of their ranges, that is sought, relative to that required;
/// not for curves that are followed for a map only.
const PARAMETER_ACCURACY_RATIO: f64 = 1e-2;

/// Largest number of curves with leaves on either side.
const MOST_CURVES_WITH_LEAVES: usize = 4;

/// The curves on which the index of a leaf changes in the plane of two parameters, through
/// the critical points of a trace along the first. `progress` is called for each point: with
/// the curve (none for the trace itself), the number of points, and the values.
///
/// # Errors
/// Requests that cannot be met; failures during the run are part of the result.
pub fn trace_stability_boundary(
    request: &BoundaryRequest,
    progress: &mut (dyn FnMut(Option<usize>, usize, [f64; 2]) + Send),
) -> Result<StabilityBoundary, TraceError> {
    request.validate()?;
    let clock = Instant::now();
    let (vary, across) = (&request.trace.vary, &request.across);
    let ends = [vary, across].map(ParameterSweep::ends);
    let base = &request.trace.base;
    let make = |[first, second]: [f64; 2]| -> Result<Scenario, String> {
        let at = base.scenario_with_values(&[(&vary.keys, first), (&across.keys, second)]);
        Ok(at.map_err(|refused| refused.to_string())?.scenario)
    };
    for second in ends[1] {
        base.scenario_with_values(&[(&vary.keys, ends[0][0]), (&across.keys, second)])?;
    }
    let start = initial_second_parameter(request);
    let along = TraceRequest {
        base: base.with_value(&across.keys, start)?,
        ..request.trace.clone()
    };
    let begun = trace_with_points(&along, &mut |_, points, value| {
        progress(None, points, [value, start]);
    })?;
    let ranges = [vary, across].map(|it| ParameterRange {
        ends: it.ends(),
        log: it.log,
    });
    let plane = TwoParameterProblem::over_two_parameters(&make, ranges, start);
    let plane = plane.map_err(|out| TraceError::Vary(format!("{}: {out}", vary.keys)))?;
    let plane = &plane.with_limit(request.trace.limit.clone());
    let from = [0.0, ranges[1].fraction(start)];
    let mut boundary = boundary_without_curves(request, &begun.trace, start);
    let mut run = BoundaryTracer {
        plane,
        options: continuation_options(request, begun.trace.tolerance),
        known_curves: Vec::new(),
        seeds_tried: 0,
        progress,
    };
    for RefinedCriticalPoint { critical, refined } in &begun.critical_points {
        let seed = BoundarySeed {
            critical,
            refined,
            from,
            direction: [1.0, 0.0],
        };
        run.follow_unknown_curve(&seed, &mut boundary);
    }
    if let (Some(size), Some(PointOnGrid { point, grid })) = (request.map, begun.first_point) {
        let kinks = plane.first_leaf().kinks();
        let first = ConfirmedEquilibrium {
            grid: coarsened(&grid, point.state.segments(), kinks),
            index: point.index,
            solution: TwoParameterState {
                state: point.state,
                params: from,
            },
        };
        let map = run.build_index_map(size, first, &mut boundary);
        // Cells that were not reached would look like those without an equilibrium.
        boundary.map = (!plane.limit.reached()).then_some(map);
    }
    add_leaves_beside_curves(plane, &run.known_curves, &mut boundary);
    if plane.limit.reached() && boundary.remark.is_none() {
        boundary.remark = Some(BoundaryRemark::Stopped);
    }
    set_completeness(&mut boundary, begun.trace.complete);
    boundary.wall_seconds = clock.elapsed().as_secs_f64();
    Ok(boundary)
}

/// The second parameter at the first trace.
fn initial_second_parameter(request: &BoundaryRequest) -> f64 {
    let across = &request.across;
    let [from, to] = across.ends();
    let present = request.trace.base.number(&across.keys);
    let within = present.filter(|value| (from.min(to)..=from.max(to)).contains(value));
    within.unwrap_or(from)
}

/// The result before any curve is known.
fn boundary_without_curves(
    request: &BoundaryRequest,
    trace: &Trace,
    start: f64,
) -> StabilityBoundary {
    let both = [&request.trace.vary, &request.across];
    StabilityBoundary {
        scenario: trace.scenario.clone(),
        keys: both.map(|it| it.keys.clone()),
        ranges: both.map(ParameterSweep::ends),
        log: both.map(|it| it.log),
        start,
        rods: trace.rods,
        joined: trace.joined,
        tolerance: trace.tolerance,
        complete: false,
        remark: trace.remark.clone().map(BoundaryRemark::Trace),
        doubts: trace.doubts.clone(),
        curves: Vec::new(),
        map: None,
        factorizations: trace.factorizations,
        wall_seconds: 0.0,
    }
}

/// How curves through the critical points of the first trace are followed.
fn continuation_options(request: &BoundaryRequest, tolerance: f64) -> BoundaryContinuationOptions {
    BoundaryContinuationOptions {
        longest_step: (1.0 / (request.across.values.len() - 1) as f64).min(LONGEST_BRANCH_STEP),
        max_points: request.trace.most_points,
        accuracy: BoundaryAccuracy {
            tips: tolerance,
            numbers: tolerance,
            sought: PARAMETER_ACCURACY_RATIO * tolerance,
        },
    }
}

/// Whether all curves are known as far as requested; if not, why. `traced`: whether all branches
/// of the first trace are.
fn set_completeness(boundary: &mut StabilityBoundary, traced: bool) {
    let curves = &boundary.curves;
    let whole = (curves.iter().flat_map(|curve| &curve.ends)).all(BranchEnd::is_complete);
    if curves.is_empty() && boundary.remark.is_none() {
        let [vary, across] = boundary.keys.clone();
        boundary.remark = Some(BoundaryRemark::NoIndexChange {
            vary,
            across,
            start: boundary.start,
        });
    }
    boundary.complete = whole && traced && boundary.remark.is_none();
    if !traced && boundary.remark.is_none() {
        boundary.remark = Some(BoundaryRemark::BranchesIncomplete);
    }
}

/// The run that follows the curves.
struct BoundaryTracer<'r, 'p> {
    plane: &'r TwoParameterProblem<'r>,
    options: BoundaryContinuationOptions,
    known_curves: Vec<boundary::ContinuedBoundary>,
    /// Number of critical points from which curves were started.
    seeds_tried: usize,
    progress: &'p mut (dyn FnMut(Option<usize>, usize, [f64; 2]) + Send),
}

impl BoundaryTracer<'_, '_> {
    /// Follows the curve through a critical point, unless it lies on a known one.
    fn follow_unknown_curve(&mut self, seed: &BoundarySeed, boundary: &mut StabilityBoundary) {
        if self.plane.limit.reached() {
            return;
        }
        if self
            .known_curves
            .iter()
            .any(|known| seed.lies_on_curve(known))
        {
            return;
        }
        if self.seeds_tried == MOST_CURVES {
            let most = MOST_CURVES;
            boundary.remark = Some(BoundaryRemark::TooManyCurves { most });
            return;
        }
        self.seeds_tried += 1;
        let (plane, progress) = (self.plane, &mut *self.progress);
        let number = boundary.curves.len();
        let mut report = |points, params| progress(Some(number), points, plane.values(params));
        let grid = seed.grid(plane.first_leaf().kinks());
        let mut curve = boundary::follow_boundary(plane, &grid, seed, &self.options, &mut report);
        boundary.factorizations += curve.factorizations;
        if !curve.points.is_empty() {
            // If the index changes nowhere, the equilibria only touch the curve, of which another
            // sheet is on both sides.
            let bounds = |point: &VerifiedBoundaryPoint| point.indices[0] != point.indices[1];
            let none = !curve.points.iter().any(bounds);
            remove_repeated_ends(&mut curve, &self.known_curves);
            if curve.points.is_empty() || none {
                return;
            }
        }
        (boundary.curves).push(curve_in_scenario_units(plane, &curve));
        self.known_curves.push(curve);
    }

    /// The map of so many cells, continued from an equilibrium. Critical points on the paths that
    /// lie on no known curve start new ones; sequentially, so that the result does not depend on
    /// the number of threads, and with longer steps than those of the trace, for the map alone.
    fn build_index_map(
        &mut self,
        size: [usize; 2],
        first: ConfirmedEquilibrium,
        boundary: &mut StabilityBoundary,
    ) -> BoundaryMap {
        let accuracy = self.options.accuracy.tips;
        self.options.longest_step = self.options.longest_step.max(LONGEST_MAP_CURVE_STEP);
        self.options.accuracy.sought = accuracy;
        let mut cells = IndexMapSweep::new(self.plane, size);
        let mut next = Some(cells.continue_to_first_cell(first, &self.known_curves));
        while let Some(unexplained) = next {
            for path in &unexplained {
                let [from, to] = path.ends;
                let direction = [0, 1].map(|i| to[i] - from[i]);
                for critical in &path.critical {
                    let (plane, grid) = (self.plane, &path.grid);
                    let refined = refine_on_path(plane, path.ends, grid, critical, accuracy);
                    if let Ok(refined) = &refined {
                        let seed = BoundarySeed {
                            critical,
                            refined,
                            from,
                            direction,
                        };
                        self.follow_unknown_curve(&seed, boundary);
                    }
                }
            }
            next = cells.sweep_to_neighbours(&self.known_curves);
        }
        boundary.factorizations += cells.factorizations;
        cells.map_compared_with_curves(&self.known_curves)
    }
}

fn curve_in_scenario_units(
    plane: &TwoParameterProblem,
    curve: &boundary::ContinuedBoundary,
) -> BoundaryCurve {
    BoundaryCurve {
        kind: curve.kind,
        multiplicity: curve.neutral,
        ends: curve.ends.clone(),
        points: (curve.points.iter().enumerate())
            .map(|(k, point)| point_in_scenario_units(plane, k + 1, point))
            .collect(),
        beside: Vec::new(),
    }
}

fn point_in_scenario_units(
    plane: &TwoParameterProblem,
    number: usize,
    point: &VerifiedBoundaryPoint,
) -> BoundaryPoint {
    let values = plane.values(point.params);
    let beyond = plane.values([0, 1].map(|i| point.params[i] + point.errors[i]));
    BoundaryPoint {
        point: number,
        kind: point_kind_word(point.kind, point.special),
        values,
        errors: [0, 1].map(|i| (beyond[i] - values[i]).abs()),
        tips: plane.tips(&point.tips),
        error: point.error * plane.scale().length,
        index_before: point.indices[0],
        index_behind: point.indices[1],
        stations: point.stations.clone(),
        curves: plane.curves(&point.state),
    }
}

/// Finds leaves on either side of a few curves: of those that bound stable leaves or, if there
/// are none, of those with the smallest index next to them.
fn add_leaves_beside_curves(
    plane: &TwoParameterProblem,
    known: &[boundary::ContinuedBoundary],
    boundary: &mut StabilityBoundary,
) {
    let index = |point: &VerifiedBoundaryPoint| point.indices[0].min(point.indices[1]);
    let mut order: Vec<(usize, usize)> = Vec::new();
    for (number, curve) in known.iter().enumerate() {
        let least = curve.points.iter().map(index).min();
        order.extend(least.map(|least| (least, number)));
    }
    order.sort_unstable();
    let smallest = order.first().map(|first| first.0);
    order.retain(|curve| Some(curve.0) == smallest);
    let found = order.into_iter().filter_map(|(least, number)| {
        let points = &known[number].points;
        // Midway between ends and special points.
        let special = |&k: &usize| points[k].special.is_some();
        let special: Vec<usize> = (0..points.len()).filter(special).collect();
        let off = |&k: &usize| {
            let off = special.iter().map(|other| other.abs_diff(k));
            off.fold(k.min(points.len() - 1 - k), usize::min)
        };
        let same = (0..points.len()).filter(|&k| index(&points[k]) == least);
        let at = same.max_by_key(off)?;
        let before = &points[at.saturating_sub(1)];
        let after = points.get(at + 1).unwrap_or(&points[at]);
        let along = [0, 1].map(|i| after.params[i] - before.params[i]);
        Some((number, leaves_beside_boundary(plane, &points[at], along)?))
    });
    for (number, pair) in found.take(MOST_CURVES_WITH_LEAVES) {
        let leaves = pair.map(|leaf| leaf_in_scenario_units(plane, leaf));
        boundary.curves[number].beside = leaves.into();
    }
}

fn leaf_in_scenario_units(plane: &TwoParameterProblem, leaf: BoundaryNeighbour) -> LeafBeside {
    let state = &leaf.solution.state;
    let tips: Vec<DVec3> = state.tips().collect();
    LeafBeside {
        values: plane.values(leaf.solution.params),
        index: leaf.index,
        tips: plane.tips(&tips),
        curves: plane.curves(state),
        fallen_from: leaf.fallen_from.as_ref().map(|state| plane.curves(state)),
    }
}

/// The boundary of stability in the plane of two parameters of a scenario: the curves on
/// which the Morse index of a leaf changes. As JSON it is `boundary.json`.
#[derive(Clone, Debug, serde::Serialize)]
pub struct StabilityBoundary {
    /// Name of the scenario.
    pub scenario: String,
    /// The parameters.
    #[serde(rename = "vary")]
    pub keys: [ParameterKeys; 2],
    /// Values of the parameters at the ends of their ranges.
    pub ranges: [[f64; 2]; 2],
    /// Whether their logarithms are spaced evenly.
    #[serde(skip)]
    pub log: [bool; 2],
    /// The second parameter at the first trace, at whose critical points curves begin; others
    /// begin at those of the map's rows.
    pub start: f64,
    /// Number of rods.
    pub rods: usize,
    /// Whether the tips share one point.
    #[serde(skip)]
    pub joined: bool,
    /// Required accuracy of the tips, relative to the longest rod.
    pub tolerance: f64,
    /// Whether there are curves, and all are known as far as requested.
    pub complete: bool,
    /// Why there is no curve, or fewer than there may be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<BoundaryRemark>,
    /// What in the scenario is probably not what was intended.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<PlausibilityWarning>,
    /// The curves.
    pub curves: Vec<BoundaryCurve>,
    /// The map under them, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub map: Option<BoundaryMap>,
    /// Matrices factorized to follow and verify the curves, without those of softened leaves,
    /// and to follow the first trace and the paths between the cells of the map.
    pub factorizations: usize,
    /// Total time, in seconds.
    pub wall_seconds: f64,
}

/// One curve.
#[derive(Clone, Debug, serde::Serialize)]
pub struct BoundaryCurve {
    /// What happens to a branch along the first parameter: a fold, or a crossing.
    #[serde(serialize_with = "serialize_kind")]
    pub kind: CriticalKind,
    /// How many modes become neutral.
    pub multiplicity: usize,
    /// How it ended: before its first point, and after its last.
    pub ends: [BranchEnd; 2],
    /// Its points, ordered so that the second parameter increases from the first point or, where
    /// that is also the last, has increased.
    pub points: Vec<BoundaryPoint>,
    /// Leaves on either side, for pictures: of a few curves, those that bound stable leaves if
    /// there are any.
    #[serde(skip)]
    pub beside: Vec<LeafBeside>,
}

/// A leaf next to a curve, in the scenario's units, without an error estimate.
#[derive(Clone, Debug)]
pub struct LeafBeside {
    /// Both parameters.
    pub values: [f64; 2],
    /// Morse index.
    pub index: usize,
    /// The shared tip alone, or every tip.
    pub tips: Vec<DVec3>,
    /// Centerlines, one per rod.
    pub curves: Vec<Vec<DVec3>>,
    /// If the stable leaf of the other side relaxes to it, the initial centerlines of that fall: of
    /// the equilibrium at the same parameters or, at a fold, on the curve.
    pub fallen_from: Option<Vec<Vec<DVec3>>>,
}

/// A point of a curve, in the scenario's units.
#[derive(Clone, Debug, serde::Serialize)]
pub struct BoundaryPoint {
    /// Its number on the curve, from 1.
    pub point: usize,
    /// `fold`, `branch-point`, `cusp` or `crossing`.
    pub kind: &'static str,
    /// Both parameters.
    pub values: [f64; 2],
    /// Bounds on their errors; zero for a given one.
    pub errors: [f64; 2],
    /// The shared tip alone, or every tip.
    #[serde(flatten, serialize_with = "serialize_tips")]
    pub tips: Vec<DVec3>,
    /// Bound on the error of the tips.
    pub error: f64,
    /// Morse index before the point and after it, along the first parameter; at a fold,
    /// the lower and the higher one of the two branches that meet there.
    pub index_before: usize,
    /// See above.
    pub index_behind: usize,
    /// Fractions of the length of the nodes of the finest grid.
    #[serde(skip)]
    pub stations: Vec<f64>,
    /// Centerlines on the finest grid, one per rod.
    #[serde(skip)]
    pub curves: Vec<Vec<DVec3>>,
}

impl StabilityBoundary {
    /// Edges of equal cells along one of the two parameters, from one end of its range to the
    /// other: one more than there are cells.
    pub fn cell_edges(&self, which: usize, cells: usize) -> Vec<f64> {
        let part = |k: usize| k as f64 / cells as f64;
        (0..=cells)
            .map(|k| value_at_fraction(self.ranges[which], self.log[which], part(k)))
            .collect()
    }
}

impl BoundaryMap {
    /// Number of cells with an index.
    pub fn known_cell_count(&self) -> usize {
        self.index.iter().flatten().flatten().count()
    }
}

/// The word for the kind of a point.
pub(super) fn point_kind_word(
    kind: CriticalKind,
    special: Option<CodimensionTwoKind>,
) -> &'static str {
    match (special, kind) {
        (Some(CodimensionTwoKind::Cusp), _) => "cusp",
        (Some(CodimensionTwoKind::Crossing), _) => "crossing",
        (None, CriticalKind::Fold) => "fold",
        (None, CriticalKind::Branching) => "branch-point",
    }
}

fn serialize_kind<S: Serializer>(kind: &CriticalKind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(point_kind_word(*kind, None))
}
