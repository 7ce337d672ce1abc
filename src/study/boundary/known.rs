//! Critical points of branches through the plane, and whether they lie on a curve that is
//! known.

use crate::branch::boundary::{Boundary, Seed, Verified};
use crate::branch::{Critical, Point, Refined};
use crate::leaf::Grid;
use crate::study::trace::{Trace, TraceError, TraceRequest, trace_seen};

/// A trace along the first number, where it begins, and what it met.
pub struct Traced {
    pub trace: Trace,
    /// The first point, and a grid of which its own is a coarser one; none where there is none.
    pub first: Option<(Point, Grid)>,
    pub critical: Vec<(Critical, Refined)>,
}

/// Makes it.
pub fn traced(
    request: &TraceRequest,
    progress: &mut dyn FnMut(usize, f64),
) -> Result<Traced, TraceError> {
    let (mut first, mut critical) = (None, Vec::new());
    let trace = trace_seen(
        request,
        &mut |_, points, value| progress(points, value),
        &mut |followed| {
            let begun = followed.branch.points.first().zip(followed.points.first());
            let begun = begun.map(|(point, refined)| (point.clone(), refined.grid.clone()));
            first = first.take().or(begun);
            let found = followed.branch.critical.iter().zip(&followed.critical);
            critical
                .extend(found.map(|((_, critical), refined)| (critical.clone(), refined.clone())));
        },
    )?;
    Ok(Traced {
        trace,
        first,
        critical,
    })
}

/// A critical point of a branch, without the error of its grid.
pub struct Start<'a> {
    pub critical: &'a Critical,
    pub refined: &'a Refined,
    /// Both numbers where the branch begins, as fractions, and their change with its
    /// parameter.
    pub from: [f64; 2],
    pub way: [f64; 2],
}

/// Both numbers, as fractions, and the tips are the same within this, besides the errors that
/// both have.
const SAME: f64 = 1e-6;

/// Improvements of the nearest point.
const ITERATIONS: usize = 20;

/// Points of a curve closer than this are one for the polynomials: their errors over
/// their distance would be slopes.
const APART: f64 = 1e-3;

/// A point may lie before an interval of a curve or behind it, by this part of it.
const BEYOND: f64 = 0.05;

impl Start<'_> {
    /// Both numbers at a value of the branch's parameter.
    fn numbers(&self, parameter: f64) -> [f64; 2] {
        [0, 1].map(|i| self.from[i] + parameter * self.way[i])
    }

    /// As the beginning of a curve.
    pub fn seed(&self) -> Seed<'_> {
        Seed {
            critical: self.critical,
            place: self.numbers(self.critical.fraction),
            way: self.way,
        }
    }

    /// The grid of it, of leaves with these kinks.
    pub fn grid(&self, kinks: &[f64]) -> Grid {
        coarsened(&self.refined.grid, self.critical.state.segments(), kinks)
    }

    fn place(&self) -> Vec<f64> {
        let tips = self.refined.tips.iter().flatten();
        let numbers = self.numbers(self.refined.fraction);
        numbers.into_iter().chain(tips.copied()).collect()
    }

    /// Whether it lies on a curve: beside a polynomial through points of it by no more
    /// than this is off one of lower degree, where it separates the same indices. Where
    /// more modes become neutral than those of the curve, others cross it.
    pub fn is_on(&self, curve: &Boundary) -> bool {
        let modes = self.critical.modes.len();
        let crossed = modes > curve.neutral;
        if modes < curve.neutral || !crossed && curve.kind != self.critical.kind {
            return false;
        }
        let (mut points, mut places) = (Vec::new(), Vec::<Vec<f64>>::new());
        for point in &curve.points {
            let place = place(point);
            if (places.last()).is_none_or(|last| distance(last, &place) > APART) {
                points.push(point);
                places.push(place);
            }
        }
        let target = self.place();
        let sides = sorted(self.critical.indices);
        let length = self.way[0].hypot(self.way[1]);
        let own = self.refined.fraction_error * length + self.refined.error;
        if let [only] = &points[..] {
            let error = own + only.errors[0] + only.errors[1] + only.error;
            return distance(&places[0], &target) < SAME + error;
        }
        (1..points.len()).any(|k| {
            let pair = &points[k - 1..=k];
            let error = pair.iter().map(|it| it.errors[0] + it.errors[1] + it.error);
            let error = own + error.fold(0.0, f64::max);
            let same_sides = crossed || pair.iter().any(|it| sorted(it.indices) == sides);
            same_sides && is_between(&places, k, &target, SAME + error)
        })
    }
}

/// The grid of so many segments of which this is a finer one.
pub fn coarsened(grid: &Grid, segments: usize, kinks: &[f64]) -> Grid {
    let stations = grid.sigma().iter().copied();
    let stations: Vec<f64> = stations.step_by(grid.segments() / segments).collect();
    Grid::through(&stations, kinks)
}

fn sorted([a, b]: [usize; 2]) -> [usize; 2] {
    [a.min(b), a.max(b)]
}

/// A point of a curve as one of a space: both numbers, and the tips.
fn place(point: &Verified) -> Vec<f64> {
    let tips = point.tips.iter().flatten();
    point.place.into_iter().chain(tips.copied()).collect()
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
