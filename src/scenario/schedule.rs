//! Quantities in time: through given values at given times, in straight lines or smoothly, or as a sine.

use crate::rotation;
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

/// What may change in time: numbers and vectors.
pub trait InTime: Copy + PartialEq {
    /// Nothing.
    const ZERO: Self;

    /// The sum with so many times another value.
    fn plus(self, times: f64, other: Self) -> Self;
}

impl InTime for f64 {
    const ZERO: f64 = 0.0;

    fn plus(self, times: f64, other: f64) -> f64 {
        self + times * other
    }
}

impl InTime for [f64; 3] {
    const ZERO: [f64; 3] = [0.0; 3];

    fn plus(self, times: f64, other: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| self[axis] + times * other[axis])
    }
}

/// A quantity in time.
#[derive(Clone, Debug, PartialEq)]
pub enum Schedule<T> {
    /// Through given values: linear between them, constant before the first and after the last.
    Linear(Knots<T>),
    /// The same without kinks: the cubic spline through the values that begins and ends level.
    Smooth {
        /// The values.
        knots: Knots<T>,
        /// The rate of change at each knot.
        slopes: Vec<T>,
    },
    /// An oscillation.
    Sine(Sine<T>),
}

/// Values at times.
#[derive(Clone, Debug, PartialEq)]
pub struct Knots<T> {
    /// At least one time, strictly increasing.
    pub at: Vec<f64>,
    /// Values at these times; same length as `at`.
    pub value: Vec<T>,
}

/// mean + amplitude sin(2 pi frequency t + phase).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sine<T> {
    /// The value about which it oscillates.
    pub mean: T,
    /// The largest difference from that.
    pub amplitude: T,
    /// Periods per unit of time; positive.
    pub frequency: f64,
    /// Phase at time 0, radians.
    pub phase: f64,
}

/// Times in a period of a sine at which steps of a motion end: longer ones would not see it.
const SINE_KNOTS: f64 = 8.0;

impl<T: InTime> Schedule<T> {
    /// The same value at all times.
    pub fn constant(value: T) -> Self {
        Schedule::linear(vec![0.0], vec![value])
    }

    /// Linear between values at strictly increasing times, one value each.
    pub fn linear(at: Vec<f64>, value: Vec<T>) -> Self {
        Schedule::Linear(Knots { at, value })
    }

    /// Smooth through values at strictly increasing times, one value each.
    pub fn smooth(at: Vec<f64>, value: Vec<T>) -> Self {
        let knots = Knots { at, value };
        Schedule::Smooth {
            slopes: knots.spline_slopes(),
            knots,
        }
    }

    /// The values that it goes through, unless it is a sine.
    pub fn knots(&self) -> Option<&Knots<T>> {
        match self {
            Schedule::Linear(knots) | Schedule::Smooth { knots, .. } => Some(knots),
            Schedule::Sine(_) => None,
        }
    }

    /// Whether the value is the same at all times.
    pub fn is_constant(&self) -> bool {
        match self {
            Schedule::Linear(knots) | Schedule::Smooth { knots, .. } => {
                knots.value.windows(2).all(|pair| pair[0] == pair[1])
            }
            Schedule::Sine(sine) => sine.amplitude == T::ZERO,
        }
    }

    /// Whether its rate may jump.
    pub fn has_kinks(&self) -> bool {
        matches!(self, Schedule::Linear(_)) && !self.is_constant()
    }

    /// The value at `time`.
    pub fn at(&self, time: f64) -> T {
        match self {
            Schedule::Linear(knots) => knots.linear_at(time),
            Schedule::Smooth { knots, slopes } => knots.smooth_at(slopes, time),
            Schedule::Sine(sine) => sine.mean.plus(sine.angle(time).sin(), sine.amplitude),
        }
    }

    /// The rate of change at `time`, at a kink that after it.
    pub fn rate(&self, time: f64) -> T {
        match self {
            Schedule::Linear(knots) => {
                let Bracket {
                    from, to, after, ..
                } = knots.bracket(time);
                let width = after.map_or(1.0, |after| knots.at[after] - knots.at[after - 1]);
                T::ZERO.plus(1.0 / width, to.plus(-1.0, from))
            }
            Schedule::Smooth { knots, slopes } => knots.smooth_rate(slopes, time),
            Schedule::Sine(sine) => {
                let rate = 2.0 * PI * sine.frequency * sine.angle(time).cos();
                T::ZERO.plus(rate, sine.amplitude)
            }
        }
    }

    /// The mean over an interval, exact however short the pulses in it.
    pub fn mean(&self, from: f64, to: f64) -> T {
        match self {
            Schedule::Linear(knots) => knots.sum_of_pieces(from, to, |piece| {
                knots.linear_at(0.5 * (piece[0] + piece[1]))
            }),
            // Simpson's rule is exact for cubics.
            Schedule::Smooth { knots, slopes } => knots.sum_of_pieces(from, to, |[a, b]| {
                let at = |time: f64| knots.smooth_at(slopes, time);
                let ends = at(a).plus(1.0, at(b)).plus(4.0, at(0.5 * (a + b)));
                T::ZERO.plus(1.0 / 6.0, ends)
            }),
            Schedule::Sine(sine) => {
                let half = PI * sine.frequency * (to - from);
                let width = if half == 0.0 { 1.0 } else { half.sin() / half };
                let middle = sine.angle(0.5 * (from + to)).sin();
                sine.mean.plus(width * middle, sine.amplitude)
            }
        }
    }

    /// The times up to `end` at which it may change its slope, or at which steps of a motion must end to see
    /// it change; none if it is constant.
    pub fn knot_times(&self, end: f64) -> Vec<f64> {
        match self {
            _ if self.is_constant() => Vec::new(),
            Schedule::Linear(knots) | Schedule::Smooth { knots, .. } => knots.at.clone(),
            Schedule::Sine(sine) => {
                let step = 1.0 / (SINE_KNOTS * sine.frequency);
                let count = (end / step).ceil() as usize;
                (1..=count).map(|k| k as f64 * step).collect()
            }
        }
    }

    /// The time of a value that differs from both beside it, which are less than `width` apart.
    pub fn pulse_within(&self, width: f64) -> Option<f64> {
        let Knots { at, value } = self.knots()?;
        let mut inner = 1..at.len().saturating_sub(1);
        let pulse = inner.find(|&k| {
            let apart = value[k] != value[k - 1] && value[k] != value[k + 1];
            apart && at[k + 1] - at[k - 1] < width
        });
        pulse.map(|k| at[k])
    }

    /// Values between which, component by component, all of its values are.
    pub fn bounds(&self) -> Vec<T> {
        match self {
            Schedule::Linear(knots) => knots.value.clone(),
            Schedule::Smooth { knots, slopes } => {
                let mut bounds = knots.value.clone();
                // A cubic is within the hull of these.
                for k in 1..knots.at.len() {
                    let third = (knots.at[k] - knots.at[k - 1]) / 3.0;
                    bounds.push(knots.value[k - 1].plus(third, slopes[k - 1]));
                    bounds.push(knots.value[k].plus(-third, slopes[k]));
                }
                bounds
            }
            Schedule::Sine(sine) => [-1.0, 1.0]
                .map(|sign| sine.mean.plus(sign, sine.amplitude))
                .to_vec(),
        }
    }
}

impl Schedule<f64> {
    /// A factor in time, times a value.
    pub fn times<T: InTime>(&self, value: T) -> Schedule<T> {
        let all = |factors: &[f64]| factors.iter().map(|&of| scaled(of, value)).collect();
        let through = |knots: &Knots<f64>| Knots {
            at: knots.at.clone(),
            value: all(&knots.value),
        };
        match self {
            Schedule::Linear(knots) => Schedule::Linear(through(knots)),
            Schedule::Smooth { knots, slopes } => Schedule::Smooth {
                knots: through(knots),
                slopes: all(slopes),
            },
            Schedule::Sine(sine) => Schedule::Sine(Sine {
                mean: scaled(sine.mean, value),
                amplitude: scaled(sine.amplitude, value),
                frequency: sine.frequency,
                phase: sine.phase,
            }),
        }
    }
}

/// Rotations in time: vectors are rotation vectors.
impl Schedule<[f64; 3]> {
    /// Rotations through these rotation vectors: in straight lines, the shortest rotation at a constant rate from each
    /// to the next; smoothly or as a sine, those of the rotation vectors between.
    pub fn of_rotations(self) -> Self {
        let Schedule::Smooth { knots, .. } = self else {
            return self;
        };
        // The vector of each rotation that is nearest to that before it.
        let mut before = DVec3::ZERO;
        let nearest = |value: [f64; 3]| {
            let vector = DVec3::from_array(value);
            let axis = vector.try_normalize().or(before.try_normalize());
            let turns = axis.map_or(0.0, |axis| {
                ((before - vector).dot(axis) / (2.0 * PI)).round()
            });
            before = vector + 2.0 * PI * turns * axis.unwrap_or(DVec3::ZERO);
            before.to_array()
        };
        let values = knots.value.into_iter().map(nearest).collect();
        Schedule::smooth(knots.at, values)
    }

    /// The rotation at a time.
    pub fn rotation(&self, time: f64) -> DQuat {
        match self {
            Schedule::Linear(knots) => {
                let Bracket {
                    from, to, fraction, ..
                } = knots.bracket(time);
                let [from, to] = [from, to].map(|it| rotation::exp(DVec3::from_array(it)));
                rotation::exp(fraction * rotation::log(to * from.conjugate())) * from
            }
            _ => rotation::exp(DVec3::from_array(self.at(time))),
        }
    }

    /// The angular velocity at a time, along the lab axes.
    pub fn angular_velocity(&self, time: f64) -> DVec3 {
        if let Schedule::Linear(knots) = self {
            let Bracket {
                from, to, after, ..
            } = knots.bracket(time);
            let width = after.map_or(1.0, |after| knots.at[after] - knots.at[after - 1]);
            let [from, to] = [from, to].map(|it| rotation::exp(DVec3::from_array(it)));
            return rotation::log(to * from.conjugate()) / width;
        }
        let [theta, rate] = [self.at(time), self.rate(time)].map(DVec3::from_array);
        let (angle, axis) = (theta.length(), theta.normalize_or_zero());
        if axis == DVec3::ZERO {
            return rate;
        }
        // omega = sin(t)/t r + (1 - sin(t)/t) a a.r + (1 - cos(t))/t a x r
        let sinc = angle.sin() / angle;
        sinc * rate
            + (1.0 - sinc) * axis.dot(rate) * axis
            + (1.0 - angle.cos()) / angle * axis.cross(rate)
    }
}

/// A value times a factor.
pub fn scaled<T: InTime>(factor: f64, value: T) -> T {
    T::ZERO.plus(factor, value)
}

impl<T> Sine<T> {
    fn angle(&self, time: f64) -> f64 {
        2.0 * PI * self.frequency * time + self.phase
    }
}

/// The values on both sides of a time.
struct Bracket<T> {
    from: T,
    to: T,
    /// The fraction of the step from one to the other that has passed.
    fraction: f64,
    /// The number of the second, if the time is between two.
    after: Option<usize>,
}

impl<T: InTime> Knots<T> {
    /// The sum over the pieces between knots in an interval, of the mean of each, by its ends, times its
    /// share of the interval.
    fn sum_of_pieces(&self, from: f64, to: f64, mean: impl Fn([f64; 2]) -> T) -> T {
        let first = self.at.partition_point(|&known| known <= from);
        let last = self.at.partition_point(|&known| known < to).max(first);
        let inner = || self.at[first..last].iter().copied();
        let ends = inner().chain([to]);
        let begins = [from].into_iter().chain(inner());
        begins.zip(ends).fold(T::ZERO, |sum, (a, b)| {
            let share = if to > from {
                (b - a) / (to - from)
            } else {
                1.0
            };
            sum.plus(share, mean([a, b]))
        })
    }

    /// The values on both sides of `time`.
    fn bracket(&self, time: f64) -> Bracket<T> {
        let last = self.at.len() - 1;
        let constant = |value| Bracket {
            from: value,
            to: value,
            fraction: 0.0,
            after: None,
        };
        match self.at.partition_point(|&known| known <= time) {
            0 => constant(self.value[0]),
            after if after > last => constant(self.value[last]),
            after => {
                let (from, to) = (self.at[after - 1], self.at[after]);
                Bracket {
                    from: self.value[after - 1],
                    to: self.value[after],
                    fraction: (time - from) / (to - from),
                    after: Some(after),
                }
            }
        }
    }

    fn linear_at(&self, time: f64) -> T {
        let Bracket {
            from, to, fraction, ..
        } = self.bracket(time);
        from.plus(fraction, to.plus(-1.0, from))
    }

    fn smooth_at(&self, slopes: &[T], time: f64) -> T {
        let Bracket {
            from,
            to,
            fraction: t,
            after,
        } = self.bracket(time);
        let Some(after) = after else {
            return from;
        };
        let width = self.at[after] - self.at[after - 1];
        from.plus(t * t * (3.0 - 2.0 * t), to.plus(-1.0, from))
            .plus(width * t * (1.0 - t) * (1.0 - t), slopes[after - 1])
            .plus(-width * t * t * (1.0 - t), slopes[after])
    }

    fn smooth_rate(&self, slopes: &[T], time: f64) -> T {
        let Bracket {
            from,
            to,
            fraction: t,
            after,
        } = self.bracket(time);
        let Some(after) = after else {
            return T::ZERO;
        };
        let width = self.at[after] - self.at[after - 1];
        T::ZERO
            .plus(6.0 * t * (1.0 - t) / width, to.plus(-1.0, from))
            .plus((1.0 - t) * (1.0 - 3.0 * t), slopes[after - 1])
            .plus(-t * (2.0 - 3.0 * t), slopes[after])
    }

    /// The slopes of the cubic spline through the values that begins and ends level: those for which its
    /// second derivative is continuous.
    fn spline_slopes(&self) -> Vec<T> {
        let count = self.at.len();
        let mut slopes = vec![T::ZERO; count];
        if count < 3 {
            return slopes;
        }
        let width = |k: usize| self.at[k + 1] - self.at[k];
        let rate = |k: usize| {
            let change = self.value[k + 1].plus(-1.0, self.value[k]);
            T::ZERO.plus(1.0 / width(k), change)
        };
        // s[k-1]/w[k-1] + 2 (1/w[k-1] + 1/w[k]) s[k] + s[k+1]/w[k] = 3 (r[k-1]/w[k-1] + r[k]/w[k])
        let mut eliminated = vec![0.0; count];
        for k in 1..count - 1 {
            let [before, after] = [width(k - 1), width(k)].map(|width| 1.0 / width);
            let diagonal = 2.0 * (before + after) - before * eliminated[k - 1];
            eliminated[k] = after / diagonal;
            let right = T::ZERO
                .plus(3.0 * before, rate(k - 1))
                .plus(3.0 * after, rate(k))
                .plus(-before, slopes[k - 1]);
            slopes[k] = T::ZERO.plus(1.0 / diagonal, right);
        }
        for k in (1..count - 1).rev() {
            slopes[k] = slopes[k].plus(-eliminated[k], slopes[k + 1]);
        }
        slopes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schedule<T: InTime>(at: &[f64], value: &[T]) -> Schedule<T> {
        Schedule::linear(at.to_vec(), value.to_vec())
    }

    /// A force that changes from time 0 to 2.
    fn sloping() -> Schedule<[f64; 3]> {
        schedule(&[0.0, 2.0], &[[0.0, 1.0, 0.0], [4.0, 1.0, -2.0]])
    }

    #[test]
    fn linear_between_times_exact_at_them_and_constant_outside() {
        let factor = schedule(&[-1.0, 0.5, 0.7], &[1.0, 4.0, 0.1]);
        let values = [-1e9, -1.0, 0.0, 0.5, 0.7, 1e9].map(|time| factor.at(time));
        assert_eq!(values, [1.0, 1.0, 3.0, 4.0, 0.1, 0.1]);
        assert_eq!(sloping().at(0.5), [1.0, 1.0, -0.5]);
        assert!(!factor.is_constant());
    }

    #[test]
    fn means_see_every_pulse() {
        let pulse = schedule(&[0.5, 0.5 + 1e-6, 0.5 + 4e-6], &[0.0, 3e6, 0.0]);
        assert!((pulse.mean(0.0, 2.0) - 3.0).abs() < 1e-9);
        assert!((pulse.mean(0.0, 0.5 + 1e-6) - 3.0).abs() < 1e-5);
        assert_eq!(pulse.mean(0.6, 0.9), 0.0);
        let slope = sloping();
        assert_eq!(slope.mean(0.25, 0.75), slope.at(0.5));
        assert_eq!(slope.mean(0.5, 0.5), slope.at(0.5));
        assert_eq!(slope.mean(1.0, 3.0), [3.5, 1.0, -1.75]);
    }

    #[test]
    fn equal_values_are_constant_however_many() {
        for still in [schedule(&[0.0, 1.0], &[0.3, 0.3]), Schedule::constant(0.3)] {
            assert!(still.is_constant());
            let times = [f64::NEG_INFINITY, -1.0, 0.0, 0.7, 1e300, f64::INFINITY];
            assert_eq!(times.map(|time| still.at(time)), [0.3; 6]);
        }
    }

    fn smooth() -> Schedule<f64> {
        Schedule::smooth(vec![0.0, 1.0, 1.5, 4.0], vec![0.0, 2.0, -1.0, 3.0])
    }

    /// Through its values, level at both ends, with slopes and second derivatives that do not jump inside.
    #[test]
    fn a_smooth_course_has_two_continuous_derivatives() {
        let course = smooth();
        let h = 1e-4;
        let slope = |t: f64| (course.at(t + h) - course.at(t - h)) / (2.0 * h);
        let second = |t: f64| (course.at(t + h) - 2.0 * course.at(t) + course.at(t - h)) / (h * h);
        for (time, value) in [(-3.0, 0.0), (0.0, 0.0), (1.0, 2.0), (1.5, -1.0), (9.0, 3.0)] {
            assert!((course.at(time) - value).abs() < 1e-14);
        }
        for end in [0.0, 4.0] {
            assert!(slope(end).abs() < 1e-2, "{}", slope(end));
        }
        for knot in [1.0, 1.5] {
            let jump = |of: &dyn Fn(f64) -> f64| (of(knot + 2.0 * h) - of(knot - 2.0 * h)).abs();
            assert!(jump(&slope) < 2e-2 && jump(&second) < 2e-2 * second(knot).abs());
        }
        let within = |time: f64| {
            let bounds = course.bounds();
            let [least, most] = [f64::INFINITY, f64::NEG_INFINITY];
            let least = bounds.iter().copied().fold(least, f64::min);
            let most = bounds.iter().copied().fold(most, f64::max);
            (least..=most).contains(&course.at(time))
        };
        assert!((0..400).all(|k| within(0.01 * f64::from(k))));
    }

    /// Means are those of many values.
    #[test]
    fn means_of_smooth_courses_and_of_sines_are_exact() {
        let sine = Schedule::Sine(Sine {
            mean: 0.5,
            amplitude: 2.0,
            frequency: 0.7,
            phase: 0.3,
        });
        for course in [smooth(), sine] {
            for [from, to] in [[-1.0, 5.0], [0.2, 0.9], [0.9, 1.7], [1.0, 1.0]] {
                let count = 20_000;
                let at = |k: i32| from + (f64::from(k) + 0.5) / f64::from(count) * (to - from);
                let sum: f64 = (0..count).map(|k| course.at(at(k))).sum();
                let found = course.mean(from, to);
                assert!((found - sum / f64::from(count)).abs() < 1e-7, "{found}");
            }
        }
    }

    /// Rates are those of values nearby.
    #[test]
    fn rates_are_differences() {
        let sine = Schedule::Sine(Sine {
            mean: 0.5,
            amplitude: 2.0,
            frequency: 0.7,
            phase: 0.3,
        });
        let linear = schedule(&[0.0, 1.0, 1.5], &[1.0, 4.0, 0.1]);
        for course in [smooth(), sine, linear] {
            for time in [-0.3, 0.2, 0.9, 1.2, 3.1, 5.0] {
                let h = 1e-5;
                let rate = (course.at(time + h) - course.at(time - h)) / (2.0 * h);
                assert!((course.rate(time) - rate).abs() < 1e-8, "{time}: {rate}");
            }
        }
    }

    /// Rotations go through those given, by the shortest way, and angular velocities are theirs.
    #[test]
    fn rotations_take_the_shortest_way() {
        let at = vec![0.0, 0.5, 1.0, 2.0];
        let value = vec![[0.0; 3], [0.0, 0.0, 3.0], [0.0, 0.1, -3.0], [1.0, 0.5, 0.2]];
        let sine = Schedule::Sine(Sine {
            mean: [0.1, 0.0, 0.0],
            amplitude: [1.0, 2.0, -0.5],
            frequency: 0.7,
            phase: 0.3,
        });
        for turn in [
            Schedule::linear(at.clone(), value.clone()).of_rotations(),
            Schedule::smooth(at.clone(), value.clone()).of_rotations(),
            sine,
        ] {
            if let Some(knots) = turn.knots() {
                for (time, value) in knots.at.iter().zip(&value) {
                    let exact = rotation::exp(DVec3::from_array(*value));
                    assert!(turn.rotation(*time).dot(exact).abs() > 1.0 - 1e-12);
                }
                // From 3 to 2 pi - 3 is not the way back through 0.
                let middle = turn.rotation(0.75) * DVec3::X;
                assert!(middle.x < -0.8, "{middle}");
            }
            for time in [0.2, 0.7, 1.3] {
                let h = 1e-5;
                let turned = turn.rotation(time + h) * turn.rotation(time - h).conjugate();
                let rate = rotation::log(turned) / (2.0 * h);
                let found = turn.angular_velocity(time);
                assert!(found.distance(rate) < 1e-7, "{time}: {found} {rate}");
            }
        }
    }

    #[test]
    fn a_sine_swings_about_its_mean() {
        let sine = Schedule::Sine(Sine {
            mean: [1.0, 0.0, 0.0],
            amplitude: [0.0, 2.0, 0.0],
            frequency: 0.25,
            phase: PI / 2.0,
        });
        assert!(!sine.is_constant());
        for (time, y) in [(0.0, 2.0), (1.0, 0.0), (2.0, -2.0)] {
            let [a, b, c] = sine.at(time);
            assert!((a, c) == (1.0, 0.0) && (b - y).abs() < 1e-14);
        }
        assert_eq!(sine.bounds(), [[1.0, -2.0, 0.0], [1.0, 2.0, 0.0]]);
        assert_eq!(sine.knot_times(1.2), [0.5, 1.0, 1.5]);
    }
}
