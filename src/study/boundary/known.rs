//! Critical points of branches along the first number, and whether they lie on a curve
//! that is known.

use crate::branch::boundary::{Boundary, Verified};
use crate::branch::{Critical, Refined};
use crate::study::trace::{Trace, TraceError, TraceRequest, trace_seen};

/// A trace along the first number, and what it met.
pub fn criticals(
    request: &TraceRequest,
    progress: &mut dyn FnMut(usize, f64),
) -> Result<(Trace, Vec<(Critical, Refined)>), TraceError> {
    let mut found = Vec::new();
    let trace = trace_seen(
        request,
        &mut |_, points, value| progress(points, value),
        &mut |followed| {
            let critical = followed.branch.critical.iter().zip(&followed.critical);
            found.extend(
                critical.map(|((_, critical), refined)| (critical.clone(), refined.clone())),
            );
        },
    )?;
    Ok((trace, found))
}

/// A critical point of a branch along the first number.
pub struct Start<'a> {
    pub critical: &'a Critical,
    pub refined: &'a Refined,
    /// Where it is on the second number's range, as a fraction.
    pub second: f64,
    /// The unit of its lengths.
    pub length: f64,
}

/// A curve, and the unit of its lengths.
pub struct Known {
    pub curve: Boundary,
    pub length: f64,
}

/// Both numbers, as fractions, and the tips in units of the start's are the same within
/// this, besides the errors that both have.
const SAME: f64 = 1e-6;

/// Improvements of the nearest point.
const ITERATIONS: usize = 20;

/// Points of a curve closer than this are one for the polynomials: their errors over
/// their distance would be slopes.
const APART: f64 = 1e-3;

/// A point may lie before an interval of a curve or behind it, by this part of it.
const BEYOND: f64 = 0.05;

impl Start<'_> {
    fn place(&self) -> Vec<f64> {
        let tips = self.refined.tips.iter().flatten();
        let numbers = [self.refined.fraction, self.second];
        numbers.into_iter().chain(tips.copied()).collect()
    }

    /// Whether it lies on a curve: beside a polynomial through points of it by no more
    /// than this is off one of lower degree, where it separates the same indices. Where
    /// more modes become neutral than those of the curve, others cross it.
    pub fn is_on(&self, known: &Known) -> bool {
        let Known { curve, length } = known;
        let modes = self.critical.modes.len();
        let crossed = modes > curve.neutral;
        if modes < curve.neutral || !crossed && curve.kind != self.critical.kind {
            return false;
        }
        let scale = length / self.length;
        let (mut points, mut places) = (Vec::new(), Vec::<Vec<f64>>::new());
        for point in &curve.points {
            let place = place(point, scale);
            if (places.last()).is_none_or(|last| distance(last, &place) > APART) {
                points.push(point);
                places.push(place);
            }
        }
        let target = self.place();
        let sides = sorted(self.critical.indices);
        let own = self.refined.fraction_error + self.refined.error;
        if let [only] = &points[..] {
            let error = own + only.errors[0] + only.error * scale;
            return distance(&places[0], &target) < SAME + error;
        }
        (1..points.len()).any(|k| {
            let pair = &points[k - 1..=k];
            let error = pair
                .iter()
                .map(|it| it.errors[0] + it.errors[1] + it.error * scale);
            let error = own + error.fold(0.0, f64::max);
            let same_sides = crossed || pair.iter().any(|it| sorted(it.indices) == sides);
            same_sides && is_between(&places, k, &target, SAME + error)
        })
    }
}

fn sorted([a, b]: [usize; 2]) -> [usize; 2] {
    [a.min(b), a.max(b)]
}

/// A point of a curve as one of a space: both numbers, and the tips.
fn place(point: &Verified, scale: f64) -> Vec<f64> {
    let tips = point.tips.iter().flatten().map(|x| x * scale);
    point.place.into_iter().chain(tips).collect()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}

/// Whether a point lies on the curve through places, between one of them and that before.
fn is_between(places: &[Vec<f64>], k: usize, target: &[f64], error: f64) -> bool {
    let few = &places[k.saturating_sub(2)..(k + 2).min(places.len())];
    let chords = few.windows(2).map(|pair| distance(&pair[0], &pair[1]));
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
    // Without the point that is farther away, or on a straight line.
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
    distance(&found, target) < error + distance(&found, &lower)
}

/// The polynomial through places at such distances along a curve.
fn through(places: &[Vec<f64>], at: &[f64], t: f64) -> Vec<f64> {
    let mut sum = vec![0.0; places[0].len()];
    for (i, place) in places.iter().enumerate() {
        let others = at.iter().enumerate().filter(|(j, _)| *j != i);
        let weight: f64 = others
            .map(|(_, other)| (t - other) / (at[i] - other))
            .product();
        for (sum, x) in sum.iter_mut().zip(place) {
            *sum += weight * x;
        }
    }
    sum
}
