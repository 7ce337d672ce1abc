//! The coarse map under the curves of a boundary: the Morse index of equilibria at the centers of cells,
//! each continued from a neighboring cell, independently of the curves.
//!
//! A path contradicts the curves if its critical points are not where the curves cross it, or if its end
//! has another index than they imply; such paths lead to curves that are not known yet.

use crate::branch::boundary::{
    BoundarySeed, CodimensionTwoKind, ConfirmedEquilibrium, ContinuedBoundary, ParameterPath,
    TwoParameterProblem, VerifiedBoundaryPoint, coarsened, follow_path, recount_index,
};
use crate::branch::{BranchEnd, CriticalKind, CriticalPoint};
use crate::leaf::Grid;
use crate::numbers::largest;
use crate::shape::interpolation_weights;
use crate::study::boundary::BoundaryMap;
use glam::DVec3;
use rayon::prelude::*;

/// Largest number of cells along a side.
pub const MOST_CELLS_PER_SIDE: usize = 256;

/// The cells of a map, as far as they have been computed.
pub struct IndexMapSweep<'p> {
    plane: &'p TwoParameterProblem<'p>,
    columns_and_rows: [usize; 2],
    /// The equilibria found in the last sweep, from which others may be reached.
    frontier: Vec<Option<ConfirmedEquilibrium>>,
    /// Paths that were followed, by the cell at their end; only the last one may have reached it.
    paths_by_cell: Vec<Vec<CellPath>>,
    pub factorizations: usize,
}

/// A path that contradicts the curves, with the critical points on it.
pub struct UnexplainedPath {
    pub ends: [[f64; 2]; 2],
    pub grid: Grid,
    pub critical: Vec<CriticalPoint>,
}

/// Offsets of neighbouring cells along the first and the second parameter.
const NEIGHBOUR_OFFSETS: [[isize; 2]; 4] = [[-1, 0], [1, 0], [0, -1], [0, 1]];

impl<'p> IndexMapSweep<'p> {
    /// A map of so many cells, all unknown.
    pub fn new(plane: &'p TwoParameterProblem<'p>, size: [usize; 2]) -> Self {
        let count = size[0] * size[1];
        IndexMapSweep {
            plane,
            columns_and_rows: size,
            frontier: vec![None; count],
            paths_by_cell: (0..count).map(|_| Vec::new()).collect(),
            factorizations: 0,
        }
    }

    fn cell_center(&self, cell: usize) -> [f64; 2] {
        let at = [
            cell % self.columns_and_rows[0],
            cell / self.columns_and_rows[0],
        ];
        [0, 1].map(|i| (at[i] as f64 + 0.5) / self.columns_and_rows[i] as f64)
    }

    fn neighbouring_cells(&self, cell: usize) -> impl Iterator<Item = usize> + use<> {
        let [columns, rows] = self.columns_and_rows;
        let (column, row) = (cell % columns, cell / columns);
        NEIGHBOUR_OFFSETS
            .into_iter()
            .filter_map(move |[right, up]| {
                let column = column.checked_add_signed(right).filter(|it| *it < columns);
                let row = row.checked_add_signed(up).filter(|it| *it < rows);
                Some(row? * columns + column?)
            })
    }

    /// The index in a cell, if its equilibrium is known.
    fn known_index(&self, cell: usize) -> Option<usize> {
        self.paths_by_cell[cell].last()?.end_index
    }

    /// Continues an equilibrium to the nearest cell of the first column, along the first parameter
    /// and then along the second; returns the paths that contradict the curves.
    pub fn continue_to_first_cell(
        &mut self,
        first: ConfirmedEquilibrium,
        curves: &[ContinuedBoundary],
    ) -> Vec<UnexplainedPath> {
        let second = first.solution.params[1];
        let row =
            ((second * self.columns_and_rows[1] as f64) as usize).min(self.columns_and_rows[1] - 1);
        let cell = row * self.columns_and_rows[0];
        let middle = self.cell_center(cell);
        let mut unexplained = Vec::new();
        let mut now = Some(first);
        for to in [[middle[0], second], middle] {
            if let Some(from) = now.take_if(|from| from.solution.params != to) {
                let mut path = follow_path(self.plane, &from, to);
                now = path.end.take();
                unexplained.extend(self.record_path(&from, to, now.as_ref(), cell, path, curves));
            }
        }
        self.frontier[cell] = now;
        unexplained
    }

    /// Recounts the index on finer grids in those cells of the last sweep where it contradicts
    /// the curves: close to a curve, the grid of a path may be too coarse.
    fn recount_contradicting_indices(&mut self, curves: &[ContinuedBoundary]) {
        let counted: Vec<(usize, usize)> = (self.frontier.par_iter().enumerate())
            .filter_map(|(cell, at)| {
                let (at, edge) = (at.as_ref()?, self.paths_by_cell[cell].last()?);
                if edge.agrees_with_curves(curves) {
                    return None;
                }
                Some((cell, recount_index(self.plane, at)?))
            })
            .collect();
        for (cell, index) in counted {
            if let (Some(at), Some(edge)) = (
                &mut self.frontier[cell],
                self.paths_by_cell[cell].last_mut(),
            ) {
                at.index = index;
                edge.end_index = Some(index);
            }
        }
    }

    /// Continues to all neighbours of the cells found last, in parallel; returns the paths that
    /// contradict the curves, or `None` if there are no such neighbours.
    pub fn sweep_to_neighbours(
        &mut self,
        curves: &[ContinuedBoundary],
    ) -> Option<Vec<UnexplainedPath>> {
        self.recount_contradicting_indices(curves);
        let next: Vec<(usize, Vec<usize>)> = (0..self.frontier.len())
            .filter(|&cell| self.known_index(cell).is_none())
            .map(|cell| {
                let from = self
                    .neighbouring_cells(cell)
                    .filter(|&it| self.frontier[it].is_some());
                (cell, from.collect())
            })
            .filter(|(_, from): &(usize, Vec<usize>)| !from.is_empty())
            .collect();
        let followed: Vec<Vec<(usize, ParameterPath)>> = (next.par_iter())
            .map(|(cell, from)| self.paths_to_cell(*cell, from))
            .collect();
        let none = vec![None; self.frontier.len()];
        let before = std::mem::replace(&mut self.frontier, none);
        let mut unexplained = Vec::new();
        for ((cell, _), paths) in next.iter().zip(followed) {
            for (from, mut path) in paths {
                let (to, end) = (self.cell_center(*cell), path.end.take());
                if let Some(from) = &before[from] {
                    unexplained.extend(self.record_path(
                        from,
                        to,
                        end.as_ref(),
                        *cell,
                        path,
                        curves,
                    ));
                }
                self.frontier[*cell] = end;
            }
        }
        (!next.is_empty()).then_some(unexplained)
    }

    /// Continues to a cell from its neighbours in turn, until one path reaches it.
    fn paths_to_cell(&self, cell: usize, from: &[usize]) -> Vec<(usize, ParameterPath)> {
        let mut paths = Vec::new();
        for &other in from {
            let Some(begun) = &self.frontier[other] else {
                continue;
            };
            let path = follow_path(self.plane, begun, self.cell_center(cell));
            let found = path.end.is_some();
            paths.push((other, path));
            if found {
                break;
            }
        }
        paths
    }

    /// Records a path to a cell; returns it if it contradicts the curves.
    fn record_path(
        &mut self,
        from: &ConfirmedEquilibrium,
        to: [f64; 2],
        end: Option<&ConfirmedEquilibrium>,
        cell: usize,
        mut path: ParameterPath,
        curves: &[ContinuedBoundary],
    ) -> Option<UnexplainedPath> {
        self.factorizations += path.factorizations;
        if self.plane.first_leaf().joined() {
            path.tips.iter_mut().for_each(|tips| tips.truncate(1));
        }
        let ends = [from.solution.params, to];
        let along = usize::from(ends[0][0] == ends[1][0]);
        let beyond = path
            .critical
            .extract_if(.., |it| !is_index_change_followed(it.indices));
        let beyond = beyond.map(|critical| CurveCrossing {
            parameter: ends[0][along] + critical.fraction * (to[along] - ends[0][along]),
            is_fold: critical.kind == CriticalKind::Fold,
            indices: critical.indices,
        });
        let edge = CellPath {
            ends,
            high_index_crossings: beyond.collect(),
            index: from.index,
            tips: path.tips,
            end_index: end.map(|end| end.index),
        };
        let unexplained = (!edge.agrees_with_curves(curves)).then_some(UnexplainedPath {
            ends: edge.ends,
            grid: path.grid,
            critical: path.critical,
        });
        self.paths_by_cell[cell].push(edge);
        unexplained
    }

    /// The map, compared with the curves. A cell disagrees if its index is not the one that they
    /// imply from the cell at the start of its path, or if no path reaches it though they do not
    /// prevent it.
    pub fn map_compared_with_curves(&self, curves: &[ContinuedBoundary]) -> BoundaryMap {
        let [columns, rows] = self.columns_and_rows;
        let value = |i: usize, cell: usize| self.plane.values(self.cell_center(cell))[i];
        let row = |r: usize| {
            (0..columns)
                .map(|c| self.known_index(r * columns + c))
                .collect()
        };
        let mut map = BoundaryMap {
            first: (0..columns).map(|c| value(0, c)).collect(),
            second: (0..rows).map(|r| value(1, r * columns)).collect(),
            index: (0..rows).map(row).collect(),
            disagreeing: Vec::new(),
        };
        for (cell, edges) in self.paths_by_cell.iter().enumerate() {
            let explained = match edges.last() {
                Some(last) if last.end_index.is_some() => last.agrees_with_curves(curves),
                _ => edges.iter().all(|edge| edge.agrees_with_curves(curves)),
            };
            if !explained && self.plane.scenario(self.cell_center(cell)).is_ok() {
                let (column, row) = (cell % columns + 1, cell / columns + 1);
                map.disagreeing.push([column, row]);
            }
        }
        map
    }
}

/// When critical points of paths and points of curves are the same. Parameters are fractions of
/// their ranges, and distances of tips lengths.
struct CurveMatching {
    /// Points of a path closer than this part of both ranges are merged: their errors would
    /// dominate the slopes of interpolating polynomials.
    merged_in_ranges: f64,
    /// Points of a curve closer than this are merged, for the same reason.
    merged_on_curve: f64,
    /// Crossings closer than this may be in either order.
    same_crossing: f64,
    /// Parameters and tips that agree within this plus both error bounds are the same.
    same_point: f64,
    /// A curve and a branch with tips farther apart than this belong to different leaves.
    largest_tip_distance: f64,
    /// Iterations for the nearest point of a curve.
    nearest_point_iterations: usize,
    /// A point may lie outside an interval of a curve by this part of it.
    interval_overhang: f64,
}

const CURVE_MATCHING: CurveMatching = CurveMatching {
    merged_in_ranges: 1e-4,
    merged_on_curve: 1e-3,
    same_crossing: 1e-3,
    same_point: 1e-6,
    largest_tip_distance: 0.02,
    nearest_point_iterations: 20,
    interval_overhang: 0.05,
};

/// Curves between larger indices are not followed for a map: beyond this, singular
/// matrices on the path itself are used.
pub const LARGEST_INDEX_FOLLOWED: usize = 8;

/// A straight path along one of the parameters, on which a branch was followed.
pub struct CellPath {
    /// Both parameters at its ends, as fractions of their ranges.
    pub ends: [[f64; 2]; 2],
    /// The index at its start.
    pub index: usize,
    /// Tips along it, in the units of the curves: only one if they are joined.
    pub tips: Vec<Vec<DVec3>>,
    /// Critical points on it with indices too large for the curves.
    pub high_index_crossings: Vec<CurveCrossing>,
    /// The index at its end; none if the branch does not reach it.
    pub end_index: Option<usize>,
}

/// Crossing of a path and a curve.
#[derive(Clone)]
pub struct CurveCrossing {
    /// The parameter that varies.
    pub parameter: f64,
    /// Whether the branch ends there.
    pub is_fold: bool,
    pub indices: [usize; 2],
}

/// Whether a change of the index is followed for a map.
pub fn is_index_change_followed(indices: [usize; 2]) -> bool {
    indices.iter().all(|index| *index <= LARGEST_INDEX_FOLLOWED)
}

impl CellPath {
    /// The parameter that varies along it.
    fn varying_parameter(&self) -> usize {
        usize::from(self.ends[0][0] == self.ends[1][0])
    }

    /// Whether the result agrees with the curves: at each curve that has the present index on one
    /// side the index becomes that on the other; at a fold the branch ends.
    pub fn agrees_with_curves(&self, curves: &[ContinuedBoundary]) -> bool {
        let along = self.varying_parameter();
        let [from, to] = self.ends.map(|end| end[along]);
        let mut crossings: Vec<CurveCrossing> = (curves.iter())
            .flat_map(|curve| self.crossings_of_curve(curve))
            .filter(|crossing| is_index_change_followed(crossing.indices))
            .chain(self.high_index_crossings.iter().cloned())
            .filter(|crossing| (crossing.parameter - from) * (crossing.parameter - to) < 0.0)
            .collect();
        let distance = |crossing: &CurveCrossing| (crossing.parameter - from).abs();
        crossings.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        let (mut now, mut reached) = (self.index, 0.0);
        loop {
            let next = crossings.iter().position(|crossing| {
                crossing.indices.contains(&now)
                    && distance(crossing) > reached - CURVE_MATCHING.same_crossing
            });
            let Some(next) = next else { break };
            let crossing = crossings.remove(next);
            if crossing.is_fold {
                return self.end_index.is_none();
            }
            reached = distance(&crossing);
            let [before, after] = crossing.indices;
            now = before + after - now;
        }
        self.end_index == Some(now)
    }

    /// Crossings of a curve of this branch with the line of this path.
    fn crossings_of_curve(&self, curve: &ContinuedBoundary) -> Vec<CurveCrossing> {
        let along = self.varying_parameter();
        let value = self.ends[0][1 - along];
        let mut points: Vec<&VerifiedBoundaryPoint> = Vec::new();
        for point in &curve.points {
            let far = |last: &&VerifiedBoundaryPoint| {
                (0..2).any(|i| {
                    (point.params[i] - last.params[i]).abs() > CURVE_MATCHING.merged_in_ranges
                })
            };
            if points.last().is_none_or(far) {
                points.push(point);
            }
        }
        let coordinates = points
            .iter()
            .map(|it| [it.params[along], it.params[1 - along]]);
        let coordinates: Vec<[f64; 2]> = coordinates.collect();
        let mut crossings = Vec::new();
        for k in 1..coordinates.len() {
            let [low, high] = [coordinates[k - 1][1], coordinates[k][1]];
            let part = (value - low) / (high - low);
            if (low < value) == (high < value)
                || !self.has_matching_tips([points[k - 1], points[k]], part)
            {
                continue;
            }
            // Through four points if the parameter is monotonic along them, else through two.
            let few = k.saturating_sub(2)..(k + 2).min(coordinates.len());
            let rises = |pair: &[[f64; 2]]| (pair[1][1] > pair[0][1]) == (high > low);
            let near = match coordinates[few.clone()].windows(2).all(rises) {
                true => &coordinates[few],
                false => &coordinates[k - 1..=k],
            };
            // Where curves cross, further modes contribute.
            let point = match points[k].special {
                Some(CodimensionTwoKind::Crossing) => points[k - 1],
                _ => points[k],
            };
            let own: Vec<f64> = near.iter().map(|point| point[1]).collect();
            crossings.push(CurveCrossing {
                parameter: interpolate_polynomial(near, &own, value)[0],
                is_fold: curve.kind == CriticalKind::Fold && curve.neutral == 1,
                indices: point.indices,
            });
        }
        crossings
    }

    /// Whether the tips between two points of a curve agree with those of the branch, which are
    /// known at its points only, anywhere along it.
    fn has_matching_tips(&self, [a, b]: [&VerifiedBoundaryPoint; 2], part: f64) -> bool {
        let tips = a.tips.iter().zip(&b.tips);
        let tips: Vec<DVec3> = tips.map(|(a, b)| a + part * (b - a)).collect();
        // The mirror image in a plane of the axes has the same index.
        let images = MIRROR_IMAGE_SIGNS.map(|signs| mirror_image_of_tips(&tips, signs));
        let own = self.tips.iter();
        let off = own.flat_map(|own| images.iter().map(|tips| largest_tip_distance(own, tips)));
        let off = off.fold(f64::INFINITY, f64::min);
        let steps = self
            .tips
            .windows(2)
            .map(|pair| largest_tip_distance(&pair[0], &pair[1]));
        off < CURVE_MATCHING.largest_tip_distance + 0.5 * largest(steps)
    }
}

/// The largest distance between corresponding tips.
fn largest_tip_distance(a: &[DVec3], b: &[DVec3]) -> f64 {
    let distances = a.iter().zip(b).map(|(a, b)| a.distance(*b));
    largest(distances)
}

impl BoundarySeed<'_> {
    /// Its grid, for leaves with these kinks.
    pub fn grid(&self, kinks: &[f64]) -> Grid {
        let segments = self.critical.state.segments();
        coarsened(&self.refined.grid, segments, kinks)
    }

    /// Whether it lies on a curve.
    pub fn lies_on_curve(&self, curve: &ContinuedBoundary) -> bool {
        let [first, second] = self.direction;
        let singular = SingularPointSample {
            params: self.parameters_at(self.refined.fraction),
            tips: &self.refined.tips,
            error: self.refined.fraction_error * first.hypot(second) + self.refined.position_error,
            kind: self.critical.kind,
            modes: self.critical.modes.len(),
            adjacent_indices: sorted_indices(self.critical.indices),
        };
        singular.lies_on_curve(curve)
    }
}

/// Removes from the ends of a curve what repeats known ones; nothing may remain.
pub fn remove_repeated_ends(curve: &mut ContinuedBoundary, known: &[ContinuedBoundary]) {
    let is_known = |point: &VerifiedBoundaryPoint| {
        let singular = SingularPointSample {
            params: point.params,
            tips: &point.tips,
            error: parameter_and_tip_error(point),
            kind: point.kind,
            modes: curve.neutral,
            adjacent_indices: sorted_indices(point.indices),
        };
        known.iter().any(|other| singular.lies_on_curve(other))
    };
    let repeated: Vec<bool> = curve.points.iter().map(is_known).collect();
    if repeated.iter().all(|known| *known) {
        curve.points.clear();
        return;
    }
    // A known point may be a crossing of curves; the last known one of several is where they meet.
    let first = repeated.iter().take_while(|known| **known).count();
    let last = repeated.iter().rev().take_while(|known| **known).count();
    if last > 1 {
        curve.points.truncate(repeated.len() - last + 1);
        curve.ends[1] = BranchEnd::KnownBoundaryMet;
    }
    if first > 1 {
        curve.points.drain(..first - 1);
        curve.ends[0] = BranchEnd::KnownBoundaryMet;
    }
}

/// A singular point, by its parameters and tips.
struct SingularPointSample<'a> {
    params: [f64; 2],
    tips: &'a [DVec3],
    error: f64,
    kind: CriticalKind,
    modes: usize,
    /// The smaller and the larger index next to it.
    adjacent_indices: [usize; 2],
}

/// A leaf and its mirror images in the planes of its longitudinal axes lose stability
/// together: signs of y and z.
pub const MIRROR_IMAGE_SIGNS: [[f64; 2]; 4] = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];

impl SingularPointSample<'_> {
    /// Whether it lies on a curve or on one of its mirror images: no farther from a polynomial
    /// through its points than that is from one of lower degree, with the same indices on both
    /// sides. If more modes become neutral than those of the curve, others cross it there.
    fn lies_on_curve(&self, curve: &ContinuedBoundary) -> bool {
        let crossed = self.modes > curve.neutral;
        if self.modes < curve.neutral || !crossed && curve.kind != self.kind {
            return false;
        }
        let (mut points, mut points_of_curve) = (Vec::new(), Vec::<Vec<f64>>::new());
        for point in &curve.points {
            let coordinates = parameters_and_tips(point.params, &point.tips);
            if (points_of_curve.last()).is_none_or(|last| {
                parameter_distance(last, &coordinates) > CURVE_MATCHING.merged_on_curve
            }) {
                points.push(point);
                points_of_curve.push(coordinates);
            }
        }
        MIRROR_IMAGE_SIGNS.iter().any(|signs| {
            let target = parameters_and_tips(self.params, &mirror_image_of_tips(self.tips, *signs));
            if let [only] = &points[..] {
                return parameter_distance(&points_of_curve[0], &target)
                    < CURVE_MATCHING.same_point + self.error + parameter_and_tip_error(only);
            }
            (1..points.len()).any(|k| {
                let pair = &points[k - 1..=k];
                let within = pair
                    .iter()
                    .map(|it| parameter_and_tip_error(it))
                    .fold(0.0, f64::max);
                let mut sides = pair.iter().map(|it| sorted_indices(it.indices));
                let same_sides = crossed || sides.any(|sides| sides == self.adjacent_indices);
                same_sides
                    && is_on_interpolated_interval(
                        &points_of_curve,
                        k,
                        &target,
                        CURVE_MATCHING.same_point + self.error + within,
                    )
            })
        })
    }
}

/// The mirror image of tips, by the signs of y and z.
pub fn mirror_image_of_tips(tips: &[DVec3], [y, z]: [f64; 2]) -> Vec<DVec3> {
    let signs = DVec3::new(1.0, y, z);
    tips.iter().map(|tip| signs * tip).collect()
}

/// Sum of the error bounds of a point.
fn parameter_and_tip_error(point: &VerifiedBoundaryPoint) -> f64 {
    point.errors[0] + point.errors[1] + point.error
}

fn sorted_indices([a, b]: [usize; 2]) -> [usize; 2] {
    [a.min(b), a.max(b)]
}

/// A singular point as a vector: both parameters, then the tips.
fn parameters_and_tips(params: [f64; 2], tips: &[DVec3]) -> Vec<f64> {
    let tips = tips.iter().flat_map(|tip| tip.to_array());
    params.into_iter().chain(tips).collect()
}

fn parameter_distance(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}

/// Whether a point lies on the interpolated curve, between one of its points and the previous.
fn is_on_interpolated_interval(
    points_of_curve: &[Vec<f64>],
    k: usize,
    target: &[f64],
    error: f64,
) -> bool {
    let few = &points_of_curve[k.saturating_sub(2)..(k + 2).min(points_of_curve.len())];
    let chords = few
        .windows(2)
        .map(|pair| parameter_distance(&pair[0], &pair[1]));
    let mut at = vec![0.0];
    at.extend(chords.scan(0.0, |sum, chord| {
        *sum += chord;
        Some(*sum)
    }));
    let first = k - 1 - k.saturating_sub(2);
    let [low, high] = [at[first], at[first + 1]];
    let beyond = CURVE_MATCHING.interval_overhang * (high - low);
    let mut t = 0.5 * (low + high);
    for _ in 0..CURVE_MATCHING.nearest_point_iterations {
        let h = 1e-4 * (high - low);
        let here = interpolate_polynomial(few, &at, t);
        let [a, b] = [t - h, t + h].map(|t| interpolate_polynomial(few, &at, t));
        let (mut along, mut square) = (0.0, 0.0);
        for (((x, wanted), a), b) in here.iter().zip(target).zip(&a).zip(&b) {
            let rate = (b - a) / (2.0 * h);
            along += rate * (wanted - x);
            square += rate * rate;
        }
        t = (t + along / square).clamp(low - beyond, high + beyond);
    }
    // Lower degree: without the outermost point, or a straight line.
    let (from, to) = match few.len() {
        2 => (0, 2),
        len if first == 0 => (0, len - 1),
        len => (1, len),
    };
    let found = interpolate_polynomial(few, &at, t);
    let lower = match few.len() {
        2 => found.clone(),
        _ => interpolate_polynomial(&few[from..to], &at[from..to], t),
    };
    parameter_distance(&found, target) < error + parameter_distance(&found, &lower)
}

/// The polynomial through points at these values of a variable.
pub fn interpolate_polynomial(points: &[impl AsRef<[f64]>], at: &[f64], t: f64) -> Vec<f64> {
    let mut sum = vec![0.0; points[0].as_ref().len()];
    let weights = interpolation_weights(at, t, at.len()).weights;
    for (coordinates, weight) in points.iter().zip(weights) {
        for (sum, x) in sum.iter_mut().zip(coordinates.as_ref()) {
            *sum += weight * x;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::branch::boundary::TwoParameterDirection;
    use crate::leaf::State;
    use glam::DQuat;

    /// A parabola over the second parameter, between two of its values, with tips that move.
    fn curve(from: f64, to: f64, y: f64) -> ContinuedBoundary {
        let point = |k: usize| {
            let at = from + (to - from) * k as f64 / 20.0;
            VerifiedBoundaryPoint {
                params: [0.3 + 0.2 * at * at, at],
                errors: [1e-9, 0.0],
                tips: vec![DVec3::new(1.0 - 0.3 * at, y * at, 0.0)],
                error: 1e-9,
                state: State::new(1, vec![DVec3::ZERO; 2], vec![DQuat::IDENTITY; 2]),
                across: TwoParameterDirection {
                    increments: Vec::new(),
                    params: [1.0, 0.0],
                },
                stations: vec![0.0, 1.0],
                kind: CriticalKind::Branching,
                special: None,
                indices: [0, 1],
                factorizations: 0,
            }
        };
        ContinuedBoundary {
            kind: CriticalKind::Branching,
            neutral: 1,
            points: (0..=20).map(point).collect(),
            ends: [BranchEnd::RangeEndReached, BranchEnd::RangeEndReached],
            factorizations: 0,
        }
    }

    #[test]
    fn a_curve_ends_where_it_meets_another() {
        let known = [curve(0.0, 0.61, 0.5)];
        let mut second = curve(0.2, 1.0, 0.5);
        remove_repeated_ends(&mut second, &known);
        assert_eq!(
            second.ends,
            [BranchEnd::KnownBoundaryMet, BranchEnd::RangeEndReached]
        );
        let first = &second.points[0];
        assert!((first.params[1] - 0.6).abs() < 1e-12, "{:?}", first.params);
        assert_eq!(second.points.len(), 11);
    }

    #[test]
    fn a_curve_that_repeats_another_or_its_image_is_left_out() {
        for y in [0.5, -0.5] {
            let mut second = curve(0.1, 0.9, y);
            remove_repeated_ends(&mut second, &[curve(0.0, 1.0, 0.5)]);
            assert!(second.points.is_empty());
        }
    }

    #[test]
    fn other_curves_stay_as_they_are() {
        let mut second = curve(0.0, 1.0, 0.5);
        let mut other = curve(0.0, 1.0, 0.5);
        (other.points.iter_mut())
            .for_each(|point| point.params[0] += 1e-3 * (point.params[1] - 0.5));
        remove_repeated_ends(&mut second, &[other]);
        assert_eq!(second.points.len(), 21);
        assert_eq!(
            second.ends,
            [BranchEnd::RangeEndReached, BranchEnd::RangeEndReached]
        );
    }
}
