//! The coarse map under the curves of a boundary: the index of equilibria at the centres of
//! cells, each continued from a neighbouring cell, independently of the curves.
//!
//! The index along a straight path through the plane, as implied by the curves.
//!
//! Whether critical points of branches in the plane lie on a known curve.

use crate::branch::boundary::{
    AtRest, Boundary, Path, Plane, Seed, Special, Verified, coarsened, follow_path, recount,
};
use crate::branch::{Critical, End, Kind};
use crate::leaf::Grid;
use crate::numbers::largest;
use crate::shape::weights;
use crate::study::boundary::BoundaryMap;
use glam::DVec3;
use rayon::prelude::*;

/// Largest number of cells along a side.
pub const MOST_CELLS: usize = 256;

/// The cells of a map, as far as they have been computed.
pub struct Cells<'p> {
    plane: &'p Plane<'p>,
    /// Columns and rows.
    size: [usize; 2],
    /// The equilibria found in the last sweep, from which others may be reached.
    front: Vec<Option<AtRest>>,
    /// Paths that were followed, by the cell at their end; only the last one may have reached it.
    edges: Vec<Vec<Edge>>,
    pub factorizations: usize,
}

/// A path that contradicts the curves, with the critical points on it.
pub struct Unexplained {
    pub ends: [[f64; 2]; 2],
    pub grid: Grid,
    pub critical: Vec<Critical>,
}

/// Offsets of neighbouring cells along the first and the second parameter.
const NEIGHBOURS: [[isize; 2]; 4] = [[-1, 0], [1, 0], [0, -1], [0, 1]];

impl<'p> Cells<'p> {
    /// A map of so many cells, all unknown.
    pub fn new(plane: &'p Plane<'p>, size: [usize; 2]) -> Self {
        let count = size[0] * size[1];
        Cells {
            plane,
            size,
            front: vec![None; count],
            edges: (0..count).map(|_| Vec::new()).collect(),
            factorizations: 0,
        }
    }

    /// The centre of a cell.
    fn middle(&self, cell: usize) -> [f64; 2] {
        let at = [cell % self.size[0], cell / self.size[0]];
        [0, 1].map(|i| (at[i] as f64 + 0.5) / self.size[i] as f64)
    }

    /// The neighbours of a cell.
    fn neighbours(&self, cell: usize) -> impl Iterator<Item = usize> + use<> {
        let [columns, rows] = self.size;
        let (column, row) = (cell % columns, cell / columns);
        NEIGHBOURS.into_iter().filter_map(move |[right, up]| {
            let column = column.checked_add_signed(right).filter(|it| *it < columns);
            let row = row.checked_add_signed(up).filter(|it| *it < rows);
            Some(row? * columns + column?)
        })
    }

    /// The index in a cell, if its equilibrium is known.
    fn index(&self, cell: usize) -> Option<usize> {
        self.edges[cell].last()?.found
    }

    /// Continues an equilibrium to the nearest cell of the first column, along the first parameter
    /// and then along the second; returns the paths that contradict the curves.
    pub fn begin(&mut self, first: AtRest, curves: &[Boundary]) -> Vec<Unexplained> {
        let second = first.solution.params[1];
        let row = ((second * self.size[1] as f64) as usize).min(self.size[1] - 1);
        let cell = row * self.size[0];
        let middle = self.middle(cell);
        let mut unexplained = Vec::new();
        let mut now = Some(first);
        for to in [[middle[0], second], middle] {
            if let Some(from) = now.take_if(|from| from.solution.params != to) {
                let mut path = follow_path(self.plane, &from, to);
                now = path.end.take();
                unexplained.extend(self.record((&from, to, now.as_ref()), cell, path, curves));
            }
        }
        self.front[cell] = now;
        unexplained
    }

    /// Recounts the index on finer grids in those cells of the last sweep where it contradicts
    /// the curves: close to a curve, the grid of a path may be too coarse.
    fn recount(&mut self, curves: &[Boundary]) {
        let counted: Vec<(usize, usize)> = (self.front.par_iter().enumerate())
            .filter_map(|(cell, at)| {
                let (at, edge) = (at.as_ref()?, self.edges[cell].last()?);
                if edge.is_explained(curves) {
                    return None;
                }
                Some((cell, recount(self.plane, at)?))
            })
            .collect();
        for (cell, index) in counted {
            if let (Some(at), Some(edge)) = (&mut self.front[cell], self.edges[cell].last_mut()) {
                at.index = index;
                edge.found = Some(index);
            }
        }
    }

    /// Continues to all neighbours of the cells found last, in parallel; returns the paths that
    /// contradict the curves, or `None` if there are no such neighbours.
    pub fn advance(&mut self, curves: &[Boundary]) -> Option<Vec<Unexplained>> {
        self.recount(curves);
        let next: Vec<(usize, Vec<usize>)> = (0..self.front.len())
            .filter(|&cell| self.index(cell).is_none())
            .map(|cell| {
                let from = self.neighbours(cell).filter(|&it| self.front[it].is_some());
                (cell, from.collect())
            })
            .filter(|(_, from): &(usize, Vec<usize>)| !from.is_empty())
            .collect();
        let followed: Vec<Vec<(usize, Path)>> = (next.par_iter())
            .map(|(cell, from)| self.reach(*cell, from))
            .collect();
        let none = vec![None; self.front.len()];
        let before = std::mem::replace(&mut self.front, none);
        let mut unexplained = Vec::new();
        for ((cell, _), paths) in next.iter().zip(followed) {
            for (from, mut path) in paths {
                let (to, end) = (self.middle(*cell), path.end.take());
                if let Some(from) = &before[from] {
                    let ends = (from, to, end.as_ref());
                    unexplained.extend(self.record(ends, *cell, path, curves));
                }
                self.front[*cell] = end;
            }
        }
        (!next.is_empty()).then_some(unexplained)
    }

    /// Continues to a cell from its neighbours in turn, until one path reaches it.
    fn reach(&self, cell: usize, from: &[usize]) -> Vec<(usize, Path)> {
        let mut paths = Vec::new();
        for &other in from {
            let Some(begun) = &self.front[other] else {
                continue;
            };
            let path = follow_path(self.plane, begun, self.middle(cell));
            let found = path.end.is_some();
            paths.push((other, path));
            if found {
                break;
            }
        }
        paths
    }

    /// Records a path to a cell; returns it if it contradicts the curves.
    fn record(
        &mut self,
        (from, to, end): (&AtRest, [f64; 2], Option<&AtRest>),
        cell: usize,
        mut path: Path,
        curves: &[Boundary],
    ) -> Option<Unexplained> {
        self.factorizations += path.factorizations;
        if self.plane.first().joined() {
            path.tips.iter_mut().for_each(|tips| tips.truncate(1));
        }
        let ends = [from.solution.params, to];
        let along = usize::from(ends[0][0] == ends[1][0]);
        let beyond = path.critical.extract_if(.., |it| !is_followed(it.indices));
        let beyond = beyond.map(|critical| Crossing {
            at: ends[0][along] + critical.fraction * (to[along] - ends[0][along]),
            fold: critical.kind == Kind::Fold,
            indices: critical.indices,
        });
        let edge = Edge {
            ends,
            beyond: beyond.collect(),
            index: from.index,
            tips: path.tips,
            found: end.map(|end| end.index),
        };
        let unexplained = (!edge.is_explained(curves)).then_some(Unexplained {
            ends: edge.ends,
            grid: path.grid,
            critical: path.critical,
        });
        self.edges[cell].push(edge);
        unexplained
    }

    /// The map, compared with the curves. A cell disagrees if its index is not the one that they
    /// imply from the cell at the start of its path, or if no path reaches it though they do not
    /// prevent it.
    pub fn compared(&self, curves: &[Boundary]) -> BoundaryMap {
        let [columns, rows] = self.size;
        let value = |i: usize, cell: usize| self.plane.values(self.middle(cell))[i];
        let row = |r: usize| (0..columns).map(|c| self.index(r * columns + c)).collect();
        let mut map = BoundaryMap {
            first: (0..columns).map(|c| value(0, c)).collect(),
            second: (0..rows).map(|r| value(1, r * columns)).collect(),
            index: (0..rows).map(row).collect(),
            disagreeing: Vec::new(),
        };
        for (cell, edges) in self.edges.iter().enumerate() {
            let explained = match edges.last() {
                Some(last) if last.found.is_some() => last.is_explained(curves),
                _ => edges.iter().all(|edge| edge.is_explained(curves)),
            };
            if !explained && self.plane.scenario(self.middle(cell)).is_ok() {
                let (column, row) = (cell % columns + 1, cell / columns + 1);
                map.disagreeing.push([column, row]);
            }
        }
        map
    }
}

/// Points closer than this part of both ranges are merged: their errors would dominate the
/// slopes of interpolating polynomials.
const APART_IN_RANGES: f64 = 1e-4;

/// Crossings closer than this may be in either order.
const SAME_CROSSING: f64 = 1e-3;

/// A curve and a branch with tips farther apart than this (lengths) belong to different leaves.
const NEAR: f64 = 0.02;

/// Curves between larger indices are not followed for a map: beyond this, singular
/// matrices on the path itself are used.
pub const MOST_INDEX: usize = 8;

/// A straight path along one of the parameters, on which a branch was followed.
pub struct Edge {
    /// Both parameters at its ends, as fractions of their ranges.
    pub ends: [[f64; 2]; 2],
    /// The index at its start.
    pub index: usize,
    /// Tips along it, in the units of the curves: only one if they are joined.
    pub tips: Vec<Vec<DVec3>>,
    /// Critical points on it with indices too large for the curves.
    pub beyond: Vec<Crossing>,
    /// The index at its end; none if the branch does not reach it.
    pub found: Option<usize>,
}

/// Crossing of a path and a curve.
#[derive(Clone)]
pub struct Crossing {
    /// The parameter that varies.
    pub at: f64,
    /// Whether the branch ends there.
    pub fold: bool,
    pub indices: [usize; 2],
}

/// Whether a change of the index is followed for a map.
pub fn is_followed(indices: [usize; 2]) -> bool {
    indices.iter().all(|index| *index <= MOST_INDEX)
}

impl Edge {
    /// The parameter that varies along it.
    fn along(&self) -> usize {
        usize::from(self.ends[0][0] == self.ends[1][0])
    }

    /// Whether the result agrees with the curves: at each curve that has the present index on one
    /// side the index becomes that on the other; at a fold the branch ends.
    pub fn is_explained(&self, curves: &[Boundary]) -> bool {
        let along = self.along();
        let [from, to] = self.ends.map(|end| end[along]);
        let mut crossings: Vec<Crossing> = (curves.iter())
            .flat_map(|curve| self.crossings(curve))
            .filter(|crossing| is_followed(crossing.indices))
            .chain(self.beyond.iter().cloned())
            .filter(|crossing| (crossing.at - from) * (crossing.at - to) < 0.0)
            .collect();
        let distance = |crossing: &Crossing| (crossing.at - from).abs();
        crossings.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        let (mut now, mut reached) = (self.index, 0.0);
        loop {
            let next = crossings.iter().position(|crossing| {
                crossing.indices.contains(&now) && distance(crossing) > reached - SAME_CROSSING
            });
            let Some(next) = next else { break };
            let crossing = crossings.remove(next);
            if crossing.fold {
                return self.found.is_none();
            }
            reached = distance(&crossing);
            let [before, after] = crossing.indices;
            now = before + after - now;
        }
        self.found == Some(now)
    }

    /// Crossings of a curve of this branch with the line of this path.
    fn crossings(&self, curve: &Boundary) -> Vec<Crossing> {
        let along = self.along();
        let value = self.ends[0][1 - along];
        let mut points: Vec<&Verified> = Vec::new();
        for point in &curve.points {
            let far = |last: &&Verified| {
                (0..2).any(|i| (point.params[i] - last.params[i]).abs() > APART_IN_RANGES)
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
            if (low < value) == (high < value) || !self.is_near([points[k - 1], points[k]], part) {
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
                Some(Special::Crossing) => points[k - 1],
                _ => points[k],
            };
            let own: Vec<f64> = near.iter().map(|point| point[1]).collect();
            crossings.push(Crossing {
                at: through(near, &own, value)[0],
                fold: curve.kind == Kind::Fold && curve.neutral == 1,
                indices: point.indices,
            });
        }
        crossings
    }

    /// Whether the tips between two points of a curve agree with those of the branch, which are
    /// known at its points only, anywhere along it.
    fn is_near(&self, [a, b]: [&Verified; 2], part: f64) -> bool {
        let tips = a.tips.iter().zip(&b.tips);
        let tips: Vec<DVec3> = tips.map(|(a, b)| a + part * (b - a)).collect();
        // The mirror image in a plane of the axes has the same index.
        let images = IMAGES.map(|signs| image(&tips, signs));
        let own = self.tips.iter();
        let off = own.flat_map(|own| images.iter().map(|tips| distance_of_tips(own, tips)));
        let off = off.fold(f64::INFINITY, f64::min);
        let steps = self
            .tips
            .windows(2)
            .map(|pair| distance_of_tips(&pair[0], &pair[1]));
        off < NEAR + 0.5 * largest(steps)
    }
}

/// The largest distance between corresponding tips.
fn distance_of_tips(a: &[DVec3], b: &[DVec3]) -> f64 {
    let distances = a.iter().zip(b).map(|(a, b)| a.distance(*b));
    largest(distances)
}

/// Parameters (as fractions) and tips that agree within this plus both error bounds are
/// the same.
const SAME_POINT: f64 = 1e-6;

/// Iterations for the nearest point.
const ITERATIONS: usize = 20;

/// Points of a curve closer than this are merged for interpolation: their errors would dominate
/// the slopes.
const APART_ON_CURVE: f64 = 1e-3;

/// A point may lie outside an interval of a curve by this part of it.
const BEYOND: f64 = 0.05;

impl Seed<'_> {
    /// Its grid, for leaves with these kinks.
    pub fn grid(&self, kinks: &[f64]) -> Grid {
        let segments = self.critical.state.segments();
        coarsened(&self.refined.grid, segments, kinks)
    }

    /// Whether it lies on a curve.
    pub fn is_on(&self, curve: &Boundary) -> bool {
        let [first, second] = self.direction;
        let singular = Singular {
            params: self.params(self.refined.fraction),
            tips: &self.refined.tips,
            error: self.refined.fraction_error * first.hypot(second) + self.refined.error,
            kind: self.critical.kind,
            modes: self.critical.modes.len(),
            sides: sorted(self.critical.indices),
        };
        singular.is_on(curve)
    }
}

/// Removes from the ends of a curve what repeats known ones; nothing may remain.
pub fn remove_known(curve: &mut Boundary, known: &[Boundary]) {
    let is_known = |point: &Verified| {
        let singular = Singular {
            params: point.params,
            tips: &point.tips,
            error: error(point),
            kind: point.kind,
            modes: curve.neutral,
            sides: sorted(point.indices),
        };
        known.iter().any(|other| singular.is_on(other))
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
        curve.ends[1] = End::Met;
    }
    if first > 1 {
        curve.points.drain(..first - 1);
        curve.ends[0] = End::Met;
    }
}

/// A singular point, by its parameters and tips.
struct Singular<'a> {
    params: [f64; 2],
    tips: &'a [DVec3],
    error: f64,
    kind: Kind,
    modes: usize,
    /// The smaller and the larger index next to it.
    sides: [usize; 2],
}

/// A leaf and its mirror images in the planes of its longitudinal axes lose stability
/// together: signs of y and z.
pub const IMAGES: [[f64; 2]; 4] = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];

impl Singular<'_> {
    /// Whether it lies on a curve or on one of its mirror images: no farther from a polynomial
    /// through its points than that is from one of lower degree, with the same indices on both
    /// sides. If more modes become neutral than those of the curve, others cross it there.
    fn is_on(&self, curve: &Boundary) -> bool {
        let crossed = self.modes > curve.neutral;
        if self.modes < curve.neutral || !crossed && curve.kind != self.kind {
            return false;
        }
        let (mut points, mut points_of_curve) = (Vec::new(), Vec::<Vec<f64>>::new());
        for point in &curve.points {
            let coordinates = coordinates(point.params, &point.tips);
            if (points_of_curve.last())
                .is_none_or(|last| distance_of_parameters(last, &coordinates) > APART_ON_CURVE)
            {
                points.push(point);
                points_of_curve.push(coordinates);
            }
        }
        IMAGES.iter().any(|signs| {
            let target = coordinates(self.params, &image(self.tips, *signs));
            if let [only] = &points[..] {
                return distance_of_parameters(&points_of_curve[0], &target)
                    < SAME_POINT + self.error + error(only);
            }
            (1..points.len()).any(|k| {
                let pair = &points[k - 1..=k];
                let within = pair.iter().map(|it| error(it)).fold(0.0, f64::max);
                let mut sides = pair.iter().map(|it| sorted(it.indices));
                let same_sides = crossed || sides.any(|sides| sides == self.sides);
                same_sides
                    && is_between(
                        &points_of_curve,
                        k,
                        &target,
                        SAME_POINT + self.error + within,
                    )
            })
        })
    }
}

/// The mirror image of tips, by the signs of y and z.
pub fn image(tips: &[DVec3], [y, z]: [f64; 2]) -> Vec<DVec3> {
    let signs = DVec3::new(1.0, y, z);
    tips.iter().map(|tip| signs * tip).collect()
}

/// Sum of the error bounds of a point.
fn error(point: &Verified) -> f64 {
    point.errors[0] + point.errors[1] + point.error
}

fn sorted([a, b]: [usize; 2]) -> [usize; 2] {
    [a.min(b), a.max(b)]
}

/// A singular point as a vector: both parameters, then the tips.
fn coordinates(params: [f64; 2], tips: &[DVec3]) -> Vec<f64> {
    let tips = tips.iter().flat_map(|tip| tip.to_array());
    params.into_iter().chain(tips).collect()
}

fn distance_of_parameters(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}

/// Whether a point lies on the interpolated curve, between one of its points and the previous.
fn is_between(points_of_curve: &[Vec<f64>], k: usize, target: &[f64], error: f64) -> bool {
    let few = &points_of_curve[k.saturating_sub(2)..(k + 2).min(points_of_curve.len())];
    let chords = few
        .windows(2)
        .map(|pair| distance_of_parameters(&pair[0], &pair[1]));
    let mut at = vec![0.0];
    at.extend(chords.scan(0.0, |sum, chord| {
        *sum += chord;
        Some(*sum)
    }));
    let first = k - 1 - k.saturating_sub(2);
    let [low, high] = [at[first], at[first + 1]];
    let beyond = BEYOND * (high - low);
    let mut t = 0.5 * (low + high);
    for _ in 0..ITERATIONS {
        let h = 1e-4 * (high - low);
        let here = through(few, &at, t);
        let [a, b] = [t - h, t + h].map(|t| through(few, &at, t));
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
    let found = through(few, &at, t);
    let lower = match few.len() {
        2 => found.clone(),
        _ => through(&few[from..to], &at[from..to], t),
    };
    distance_of_parameters(&found, target) < error + distance_of_parameters(&found, &lower)
}

/// The polynomial through points at these values of a variable.
pub fn through(points: &[impl AsRef<[f64]>], at: &[f64], t: f64) -> Vec<f64> {
    let mut sum = vec![0.0; points[0].as_ref().len()];
    for (coordinates, weight) in points.iter().zip(weights(at, t, at.len()).1) {
        for (sum, x) in sum.iter_mut().zip(coordinates.as_ref()) {
            *sum += weight * x;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::branch::boundary::Direction;
    use crate::leaf::State;
    use glam::DQuat;

    /// A parabola over the second parameter, between two of its values, with tips that move.
    fn curve(from: f64, to: f64, y: f64) -> Boundary {
        let point = |k: usize| {
            let at = from + (to - from) * k as f64 / 20.0;
            Verified {
                params: [0.3 + 0.2 * at * at, at],
                errors: [1e-9, 0.0],
                tips: vec![DVec3::new(1.0 - 0.3 * at, y * at, 0.0)],
                error: 1e-9,
                state: State::new(1, vec![DVec3::ZERO; 2], vec![DQuat::IDENTITY; 2]),
                across: Direction {
                    increments: Vec::new(),
                    params: [1.0, 0.0],
                },
                stations: vec![0.0, 1.0],
                kind: Kind::Branching,
                special: None,
                indices: [0, 1],
                factorizations: 0,
            }
        };
        Boundary {
            kind: Kind::Branching,
            neutral: 1,
            points: (0..=20).map(point).collect(),
            ends: [End::Reached, End::Reached],
            factorizations: 0,
        }
    }

    #[test]
    fn a_curve_ends_where_it_meets_another() {
        let known = [curve(0.0, 0.61, 0.5)];
        let mut second = curve(0.2, 1.0, 0.5);
        remove_known(&mut second, &known);
        assert_eq!(second.ends, [End::Met, End::Reached]);
        let first = &second.points[0];
        assert!((first.params[1] - 0.6).abs() < 1e-12, "{:?}", first.params);
        assert_eq!(second.points.len(), 11);
    }

    #[test]
    fn a_curve_that_repeats_another_or_its_image_is_left_out() {
        for y in [0.5, -0.5] {
            let mut second = curve(0.1, 0.9, y);
            remove_known(&mut second, &[curve(0.0, 1.0, 0.5)]);
            assert!(second.points.is_empty());
        }
    }

    #[test]
    fn other_curves_stay_as_they_are() {
        let mut second = curve(0.0, 1.0, 0.5);
        let mut other = curve(0.0, 1.0, 0.5);
        (other.points.iter_mut())
            .for_each(|point| point.params[0] += 1e-3 * (point.params[1] - 0.5));
        remove_known(&mut second, &[other]);
        assert_eq!(second.points.len(), 21);
        assert_eq!(second.ends, [End::Reached, End::Reached]);
    }
}
