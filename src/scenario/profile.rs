//! A quantity along a rod.
//!
//! A quantity in time.
//!
//! A rule of quadrature.

use crate::scenario::blade::{BladePart, BladeProperty};
use crate::scenario::section::{Property, Section};
use std::sync::Arc;

/// Parts of the length of a blade over which an integral is a sum.
const INTEGRATION_PANELS: usize = 32;

/// A quantity along a rod: constant, linear between knots given at fractions
/// sigma = s/L of the rod's length, or determined by its section or the blade.
#[derive(Clone, Debug, PartialEq)]
pub enum Profile {
    /// The same value everywhere; may be infinite where the quantity allows it.
    Constant(f64),
    /// At least two knots: `at` rises strictly from 0 to 1; same length as `value`.
    Linear {
        /// Fractions of the length.
        at: Vec<f64>,
        /// Values at the knots, all finite.
        value: Vec<f64>,
    },
    /// A property of the rod's section, where the section changes along it.
    Section {
        /// The section.
        section: Arc<Section>,
        /// The property.
        property: Property,
        /// A factor of the property.
        factor: f64,
    },
    /// What follows from the outline and the material of a blade.
    Blade {
        /// The vein, or the tissue between two.
        part: Arc<BladePart>,
        /// The property.
        property: BladeProperty,
        /// A factor of the property.
        factor: f64,
    },
}

impl Profile {
    /// The value at the fraction `sigma` in [0, 1].
    pub fn at(&self, sigma: f64) -> f64 {
        match self {
            Profile::Constant(value) => *value,
            Profile::Linear { at, value } => {
                let right = at.partition_point(|&knot| knot < sigma);
                let right = right.clamp(1, at.len() - 1);
                let t = (sigma - at[right - 1]) / (at[right] - at[right - 1]);
                if t >= 1.0 {
                    // The sum below would lose a small value next to a large one.
                    return value[right];
                }
                value[right - 1] + t.max(0.0) * (value[right] - value[right - 1])
            }
            Profile::Section {
                section,
                property,
                factor,
            } => factor * section.property_value(*property, sigma),
            Profile::Blade {
                part,
                property,
                factor,
            } => factor * part.property_value(*property, sigma),
        }
    }

    /// The values of three at once: what they have in common is computed once.
    pub fn values_of_three(profiles: &[Profile; 3], sigma: f64) -> [f64; 3] {
        if let [
            Profile::Blade {
                part,
                property: first,
                factor,
            },
            others @ ..,
        ] = profiles
        {
            let alike = |other: &Profile| match other {
                Profile::Blade {
                    part: its,
                    property,
                    factor,
                } if Arc::ptr_eq(part, its) => Some((*property, *factor)),
                _ => None,
            };
            if let [Some(second), Some(third)] = others.each_ref().map(alike)
                && let Some(values) = part.three([*first, second.0, third.0], sigma)
            {
                let factors = [*factor, second.1, third.1];
                return [0, 1, 2].map(|k| factors[k] * values[k]);
            }
        }
        profiles.each_ref().map(|profile| profile.at(sigma))
    }

    /// The integral over fractions from 0 to `sigma` in [0, 1].
    pub fn integral(&self, sigma: f64) -> f64 {
        match self {
            Profile::Constant(value) => value * sigma,
            Profile::Linear { at, .. } => {
                let inside = at.iter().copied().filter(|&knot| knot < sigma);
                let knots: Vec<f64> = inside.chain([sigma]).collect();
                let part = |w: &[f64]| (w[1] - w[0]) * self.at(0.5 * (w[0] + w[1]));
                knots.windows(2).map(part).sum()
            }
            Profile::Section { .. } | Profile::Blade { .. } => {
                let inside = self.kinks().iter().copied().chain(self.panels());
                let inside = inside.filter(|&knot| knot < sigma).chain([0.0, sigma]);
                let part = |w: &[f64]| -> f64 {
                    let width = w[1] - w[0];
                    let points = GAUSS_LEGENDRE_RULE.iter();
                    points
                        .map(|(x, weight)| width * weight * self.at(w[0] + x * width))
                        .sum()
                };
                sorted_distinct(inside).windows(2).map(part).sum()
            }
        }
    }

    /// Fractions at which an integral is divided, besides kinks.
    fn panels(&self) -> impl Iterator<Item = f64> + use<> {
        let count = match self {
            Profile::Blade { .. } => INTEGRATION_PANELS,
            _ => 1,
        };
        (1..count).map(move |k| k as f64 / count as f64)
    }

    /// Fractions strictly inside (0, 1) where the slope may jump.
    pub fn kinks(&self) -> &[f64] {
        match self {
            Profile::Constant(_) => &[],
            Profile::Linear { at, .. } => &at[1..at.len() - 1],
            Profile::Section { section, .. } => section.kinks(),
            Profile::Blade { part, .. } => part.kinks(),
        }
    }

    /// Fractions strictly inside (0, 1) where some higher derivative may jump: an integration of high
    /// order stops there.
    pub(crate) fn seams(&self) -> &[f64] {
        match self {
            Profile::Blade { part, .. } => part.outline_points(),
            _ => &[],
        }
    }

    /// The largest absolute value along the rod.
    pub fn max_abs(&self) -> f64 {
        self.fold_extremes(0.0, |m, v| m.max(v.abs()))
    }

    /// The smallest value along the rod.
    pub fn min(&self) -> f64 {
        self.fold_extremes(f64::INFINITY, f64::min)
    }

    /// The same profile times a factor.
    pub fn scaled(&self, factor: f64) -> Profile {
        match self {
            Profile::Constant(value) => Profile::Constant(factor * value),
            Profile::Linear { at, value } => Profile::Linear {
                at: at.clone(),
                value: value.iter().map(|v| factor * v).collect(),
            },
            Profile::Section {
                section,
                property,
                factor: own,
            } => Profile::Section {
                section: section.clone(),
                property: *property,
                factor: factor * own,
            },
            Profile::Blade {
                part,
                property,
                factor: own,
            } => Profile::Blade {
                part: part.clone(),
                property: *property,
                factor: factor * own,
            },
        }
    }

    /// Folds values that include the extremes.
    fn fold_extremes(&self, start: f64, with: impl Fn(f64, f64) -> f64) -> f64 {
        match self {
            Profile::Section {
                section,
                property,
                factor,
            } => {
                let values = section.extremes(*property).map(|value| factor * value);
                values.into_iter().fold(start, with)
            }
            Profile::Blade {
                part,
                property,
                factor,
            } => {
                let values = part.extremes(*property).map(|value| factor * value);
                values.into_iter().fold(start, with)
            }
            Profile::Constant(value) => with(start, *value),
            Profile::Linear { value, .. } => value.iter().copied().fold(start, with),
        }
    }
}

/// Numbers in ascending order, each once.
pub(crate) fn sorted_distinct(numbers: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut numbers: Vec<f64> = numbers.into_iter().collect();
    numbers.sort_by(f64::total_cmp);
    numbers.dedup();
    numbers
}

/// A quantity in time: linear between given times, constant before the first
/// and after the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule<T> {
    /// At least one time, strictly increasing.
    pub at: Vec<f64>,
    /// Values at these times; same length as `at`.
    pub value: Vec<T>,
}

impl<T> Schedule<T> {
    /// The same value at all times.
    pub fn constant(value: T) -> Self {
        Schedule {
            at: vec![0.0],
            value: vec![value],
        }
    }

    /// Whether the value is the same at all times.
    pub fn is_constant(&self) -> bool
    where
        T: PartialEq,
    {
        self.value.windows(2).all(|pair| pair[0] == pair[1])
    }

    /// The time of a value that differs from both beside it, which are less than `width` apart.
    pub fn pulse_within(&self, width: f64) -> Option<f64>
    where
        T: PartialEq,
    {
        let mut inner = 1..self.at.len().saturating_sub(1);
        let pulse = inner.find(|&k| {
            let value = &self.value[k];
            let apart = *value != self.value[k - 1] && *value != self.value[k + 1];
            apart && self.at[k + 1] - self.at[k - 1] < width
        });
        pulse.map(|k| self.at[k])
    }

    /// The linear pieces of an interval: the middle of each, and its part of the interval.
    fn pieces(&self, from: f64, to: f64) -> impl Iterator<Item = (f64, f64)> {
        let first = self.at.partition_point(|&known| known <= from);
        let last = self.at.partition_point(|&known| known < to).max(first);
        let inner = || self.at[first..last].iter().copied();
        let ends = inner().chain([to]);
        [from]
            .into_iter()
            .chain(inner())
            .zip(ends)
            .map(move |(a, b)| {
                let part = if to > from {
                    (b - a) / (to - from)
                } else {
                    1.0
                };
                (0.5 * (a + b), part)
            })
    }

    /// The values on both sides of `time`, and the fraction of the step between them.
    fn bracketing_values(&self, time: f64) -> (&T, &T, f64) {
        let last = self.at.len() - 1;
        match self.at.partition_point(|&known| known <= time) {
            0 => (&self.value[0], &self.value[0], 0.0),
            after if after > last => (&self.value[last], &self.value[last], 0.0),
            after => {
                let (from, to) = (self.at[after - 1], self.at[after]);
                let fraction = (time - from) / (to - from);
                (&self.value[after - 1], &self.value[after], fraction)
            }
        }
    }
}

impl Schedule<f64> {
    /// The value at `time`.
    pub fn at(&self, time: f64) -> f64 {
        let (from, to, fraction) = self.bracketing_values(time);
        interpolate_linearly(*from, *to, fraction)
    }

    /// The mean over an interval, exact however short the pulses in it.
    pub fn mean(&self, from: f64, to: f64) -> f64 {
        let pieces = self.pieces(from, to);
        pieces.map(|(middle, part)| part * self.at(middle)).sum()
    }
}

impl Schedule<[f64; 3]> {
    /// The value at `time`.
    pub fn at(&self, time: f64) -> [f64; 3] {
        let (from, to, fraction) = self.bracketing_values(time);
        std::array::from_fn(|axis| interpolate_linearly(from[axis], to[axis], fraction))
    }

    /// The mean over an interval, exact however short the pulses in it.
    pub fn mean(&self, from: f64, to: f64) -> [f64; 3] {
        let pieces = self.pieces(from, to);
        pieces.fold([0.0; 3], |sum, (middle, part)| {
            let value = self.at(middle);
            std::array::from_fn(|axis| sum[axis] + part * value[axis])
        })
    }
}

fn interpolate_linearly(from: f64, to: f64, fraction: f64) -> f64 {
    from + fraction * (to - from)
}

/// Abscissae and weights of the Gauss-Legendre rule of five points on (0, 1).
pub(super) const GAUSS_LEGENDRE_RULE: [(f64, f64); 5] = [
    (0.046_910_077_030_668_004, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_23),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_6, 0.239_314_335_249_683_23),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn linear<const N: usize>(at: [f64; N], value: [f64; N]) -> Profile {
        Profile::Linear {
            at: at.to_vec(),
            value: value.to_vec(),
        }
    }

    #[test]
    fn a_constant_is_the_same_everywhere() {
        let rigid = Profile::Constant(f64::INFINITY);
        assert_eq!([0.0, 1.0].map(|sigma| rigid.at(sigma)), [f64::INFINITY; 2]);
        assert!(rigid.kinks().is_empty());
        let negative = Profile::Constant(-2.0);
        let found = (negative.integral(0.25), negative.max_abs(), negative.min());
        assert_eq!(found, (-0.5, 2.0, -2.0));
    }

    /// Beyond the ends, where a rounding error may lead, the end values hold.
    #[test]
    fn linear_between_knots_and_exact_at_them() {
        let tent = linear([0.0, 0.25, 1.0], [1.0, 3.0, -6.0]);
        let at = [-1e-17, 0.0, 0.125, 0.25, 0.5, 1.0, 1.0 + 1e-15];
        let values = [1.0, 1.0, 2.0, 3.0, 0.0, -6.0, -6.0];
        assert_eq!(at.map(|sigma| tent.at(sigma)), values);
        let integrals = [0.0, 0.125, 0.25, 1.0].map(|sigma| tent.integral(sigma));
        assert_eq!(integrals, [0.0, 0.1875, 0.5, -0.625]);
        assert_eq!(tent.kinks(), [0.25]);
        assert_eq!((tent.max_abs(), tent.min()), (6.0, -6.0));
        // A small value at a knot is not lost next to large ones.
        assert_eq!(linear([0.0, 0.5, 1.0], [1e9, 1e-9, 1e9]).at(0.5), 1e-9);
    }
}

#[cfg(test)]
mod schedule_tests {
    use super::*;

    fn schedule<T: Copy>(at: &[f64], value: &[T]) -> Schedule<T> {
        let (at, value) = (at.to_vec(), value.to_vec());
        Schedule { at, value }
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
}
