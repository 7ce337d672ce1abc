//! The index along a straight path through the plane, as implied by the curves.

use glam::DVec3;

use super::known::{IMAGES, image, through};
use crate::branch::Kind;
use crate::branch::boundary::{Boundary, Special, Verified};
use crate::largest::largest;

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
            let far =
                |last: &&Verified| (0..2).any(|i| (point.params[i] - last.params[i]).abs() > APART_IN_RANGES);
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
