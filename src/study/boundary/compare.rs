//! What curves say of the index on a straight way through the plane.

use super::known::IMAGES;
use crate::branch::Kind;
use crate::branch::boundary::{Boundary, Special, Verified};

/// Points closer than this part of both ranges are one: polynomials through both would
/// make slopes of their errors.
const APART: f64 = 1e-4;

/// Crossings closer than this may be in the other order.
const SAME: f64 = 1e-3;

/// Tips of a curve farther than this from those of a branch (lengths) are of another one.
const NEAR: f64 = 0.02;

/// Curves between larger indices are not followed for a map: what is beyond is judged by the
/// singular matrices on the way itself.
pub const MOST_INDEX: usize = 8;

/// A straight way along one of the numbers, on which a branch was followed.
pub struct Edge {
    /// Both numbers at its ends, as fractions of their ranges.
    pub ends: [[f64; 2]; 2],
    /// The index where it begins.
    pub index: usize,
    /// Tips along it, in the units of the curves: one if they are joined.
    pub tips: Vec<Vec<[f64; 3]>>,
    /// Where else matrices are singular on it, beyond the largest index of curves.
    pub beyond: Vec<Crossing>,
    /// The index where it ends; none if the branch does not come there.
    pub found: Option<usize>,
}

/// Where a curve is crossed.
#[derive(Clone)]
pub struct Crossing {
    /// The number that changes.
    pub at: f64,
    /// Whether the branch ends there.
    pub fold: bool,
    pub indices: [usize; 2],
}

/// Whether a change of the index is one that is followed for a map.
pub fn is_followed(indices: [usize; 2]) -> bool {
    indices.iter().all(|index| *index <= MOST_INDEX)
}

impl Edge {
    /// The number that changes along it.
    fn along(&self) -> usize {
        usize::from(self.ends[0][0] == self.ends[1][0])
    }

    /// Whether what was found is what the curves say: at each of them that has the present
    /// index on one side it becomes that on the other; at a fold the branch ends.
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
                crossing.indices.contains(&now) && distance(crossing) > reached - SAME
            });
            let Some(next) = next else { break };
            let crossing = crossings.remove(next);
            if crossing.fold {
                return self.found.is_none();
            }
            reached = distance(&crossing);
            let [before, behind] = crossing.indices;
            now = before + behind - now;
        }
        self.found == Some(now)
    }

    /// Where a curve of this branch crosses the line of this way.
    fn crossings(&self, curve: &Boundary) -> Vec<Crossing> {
        let along = self.along();
        let value = self.ends[0][1 - along];
        let mut points: Vec<&Verified> = Vec::new();
        for point in &curve.points {
            let far =
                |last: &&Verified| (0..2).any(|i| (point.params[i] - last.params[i]).abs() > APART);
            if points.last().is_none_or(far) {
                points.push(point);
            }
        }
        let places = points
            .iter()
            .map(|it| [it.params[along], it.params[1 - along]]);
        let places: Vec<[f64; 2]> = places.collect();
        let mut crossings = Vec::new();
        for k in 1..places.len() {
            let [low, high] = [places[k - 1][1], places[k][1]];
            let part = (value - low) / (high - low);
            if (low < value) == (high < value) || !self.is_near([points[k - 1], points[k]], part) {
                continue;
            }
            // Through four points where the number goes one way along them, or two.
            let few = k.saturating_sub(2)..(k + 2).min(places.len());
            let rises = |pair: &[[f64; 2]]| (pair[1][1] > pair[0][1]) == (high > low);
            let near = match places[few.clone()].windows(2).all(rises) {
                true => &places[few],
                false => &places[k - 1..=k],
            };
            // Where curves cross, other modes count as well.
            let point = match points[k].special {
                Some(Special::Crossing) => points[k - 1],
                _ => points[k],
            };
            crossings.push(Crossing {
                at: through(near, value),
                fold: curve.kind == Kind::Fold && curve.neutral == 1,
                indices: point.indices,
            });
        }
        crossings
    }

    /// Whether the tips between two points of a curve are somewhere those of the branch,
    /// which is known at its points only.
    fn is_near(&self, [a, b]: [&Verified; 2], part: f64) -> bool {
        let tips = a.tips.iter().zip(&b.tips);
        let between =
            |(a, b): (&[f64; 3], &[f64; 3])| [0, 1, 2].map(|c| a[c] + part * (b[c] - a[c]));
        let tips: Vec<[f64; 3]> = tips.map(between).collect();
        // Its image in a plane of the axes has the same index.
        let images = IMAGES.map(|signs| image(&tips, signs));
        let own = self.tips.iter();
        let off = own.flat_map(|own| images.iter().map(|tips| distance(own, tips)));
        let off = off.fold(f64::INFINITY, f64::min);
        let steps = self
            .tips
            .windows(2)
            .map(|pair| distance(&pair[0], &pair[1]));
        off < NEAR + 0.5 * steps.fold(0.0, f64::max)
    }
}

/// The image of tips, by the signs of y and z.
fn image(tips: &[[f64; 3]], [y, z]: [f64; 2]) -> Vec<[f64; 3]> {
    let tips = tips.iter();
    tips.map(|tip| [tip[0], y * tip[1], z * tip[2]]).collect()
}

/// The largest distance of tips.
fn distance(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| {
        let parts = a.iter().zip(b).map(|(x, y)| (x - y) * (x - y));
        parts.sum::<f64>()
    });
    squares.fold(0.0, f64::max).sqrt()
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
