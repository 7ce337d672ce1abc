//! Whether critical points of branches in the plane lie on a known curve.

use glam::DVec3;

use crate::branch::boundary::{Boundary, Seed, Verified, coarsened};
use crate::branch::{End, Kind};
use crate::leaf::Grid;
use crate::shape::weights;

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
            if (points_of_curve.last()).is_none_or(|last| distance_of_parameters(last, &coordinates) > APART_ON_CURVE) {
                points.push(point);
                points_of_curve.push(coordinates);
            }
        }
        IMAGES.iter().any(|signs| {
            let target = coordinates(self.params, &image(self.tips, *signs));
            if let [only] = &points[..] {
                return distance_of_parameters(&points_of_curve[0], &target) < SAME_POINT + self.error + error(only);
            }
            (1..points.len()).any(|k| {
                let pair = &points[k - 1..=k];
                let within = pair.iter().map(|it| error(it)).fold(0.0, f64::max);
                let mut sides = pair.iter().map(|it| sorted(it.indices));
                let same_sides = crossed || sides.any(|sides| sides == self.sides);
                same_sides && is_between(&points_of_curve, k, &target, SAME_POINT + self.error + within)
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
    let chords = few.windows(2).map(|pair| distance_of_parameters(&pair[0], &pair[1]));
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
