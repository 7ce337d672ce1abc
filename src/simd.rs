//! Vector (SIMD) arithmetic: several numbers per processor instruction.
//!
//! Numbers in lanes, and kernels compiled for each instruction width.
//!
//! Vectors of several nodes, or rods, at once.

use glam::DVec3;
use pulp::{Arch, Scalar, Simd};
use std::ops::{Add, Deref, Div, Mul, Neg, Sub};

/// Numbers in a group: a multiple of the width of every instruction used.
pub const GROUP: usize = 4;

/// The numbers of a group.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(32))]
pub struct NumberGroup(pub [f64; GROUP]);

impl NumberGroup {
    /// One number in every lane.
    pub fn splat(value: f64) -> Self {
        NumberGroup([value; GROUP])
    }

    /// Sum of all.
    pub fn sum(&self) -> f64 {
        self.0.iter().sum()
    }
}

/// Largest number of lanes of an instruction.
pub const MAX_LANES: usize = 8;

/// The widest instructions available.
pub fn widest_arch() -> Arch {
    Arch::new()
}

/// A loop over the nodes or segments of a group of rods, on numbers in lanes.
pub trait GroupKernel {
    /// Processes the lanes from `part` on, as many as an instruction has.
    fn run<S: Simd>(&mut self, simd: S, part: usize);
}

/// Runs a loop with the instructions of `arch` or, if these are wider than a group, with the
/// widest that are not.
pub fn run(arch: Arch, kernel: &mut impl GroupKernel) {
    struct Parts<'a, K>(&'a mut K);
    impl<K: GroupKernel> pulp::WithSimd for Parts<'_, K> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            const {
                assert!(
                    GROUP.is_multiple_of(S::F64_LANES),
                    "a group has whole parts"
                )
            };
            let mut part = 0;
            while part < GROUP {
                self.0.run(simd, part);
                part += S::F64_LANES;
            }
        }
    }
    match arch {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(simd) => Simd::vectorize(*simd, Parts(kernel)),
        #[cfg(target_arch = "x86_64")]
        Arch::V3(simd) => Simd::vectorize(simd, Parts(kernel)),
        #[cfg(target_arch = "x86_64")]
        _ => Simd::vectorize(Scalar, Parts(kernel)),
        #[cfg(not(target_arch = "x86_64"))]
        _ => arch.dispatch(Parts(kernel)),
    }
}

/// A part of an array.
#[derive(Clone, Copy, Debug)]
pub struct ArraySpan {
    pub first: usize,
    pub count: usize,
}

impl ArraySpan {
    /// The part from `first` on of length `count`.
    #[inline(always)]
    pub fn new(first: usize, count: usize) -> Self {
        ArraySpan { first, count }
    }
}

/// A part of an array.
#[inline(always)]
pub fn slice(array: &[f64], span: ArraySpan) -> &[f64] {
    &array[span.first..span.first + span.count]
}

/// The part of an array, mutably.
#[inline(always)]
pub fn slice_mut(array: &mut [f64], span: ArraySpan) -> &mut [f64] {
    &mut array[span.first..span.first + span.count]
}

/// A part of each of several arrays. (Written out, as compilers do not inline `map` here:
/// measured at a twentieth of the time of short rods.)
#[inline(always)]
pub fn array_chunks<const K: usize>(
    arrays: &[impl AsRef<[f64]>; K],
    span: ArraySpan,
) -> [&[f64]; K] {
    let mut parts: [&[f64]; K] = [&[]; K];
    for k in 0..K {
        parts[k] = slice(arrays[k].as_ref(), span);
    }
    parts
}

/// The components of the vectors of a group.
#[inline(always)]
pub fn group_components([a, b, c, d]: [DVec3; GROUP]) -> [NumberGroup; 3] {
    [
        NumberGroup([a.x, b.x, c.x, d.x]),
        NumberGroup([a.y, b.y, c.y, d.y]),
        NumberGroup([a.z, b.z, c.z, d.z]),
    ]
}

/// A part of each of three arrays, mutably.
#[inline(always)]
pub fn spans_mut(arrays: &mut [impl AsMut<[f64]>; 3], span: ArraySpan) -> [&mut [f64]; 3] {
    let [x, y, z] = arrays;
    [
        slice_mut(x.as_mut(), span),
        slice_mut(y.as_mut(), span),
        slice_mut(z.as_mut(), span),
    ]
}

/// One number for each of several neighboring nodes, or rods.
#[derive(Clone, Copy, Debug)]
pub struct Lanes<S: Simd> {
    pub(crate) simd: S,
    v: S::f64s,
}

impl<S: Simd> Lanes<S> {
    /// One number in every lane.
    #[inline(always)]
    pub fn splat(simd: S, value: f64) -> Self {
        let v = simd.splat_f64s(value);
        Lanes { simd, v }
    }

    /// Another value for the same instructions.
    #[inline(always)]
    fn with_value(self, v: S::f64s) -> Self {
        Lanes { v, ..self }
    }

    /// Reads `array` from `at` on.
    #[inline(always)]
    pub fn load(simd: S, array: &[f64], at: usize) -> Self {
        let (lanes, _) = S::as_simd_f64s(&array[at..at + S::F64_LANES]);
        Lanes { simd, v: lanes[0] }
    }

    /// Writes `array` from `at` on.
    #[inline(always)]
    pub fn store(self, array: &mut [f64], at: usize) {
        let (lanes, _) = S::as_mut_simd_f64s(&mut array[at..at + S::F64_LANES]);
        lanes[0] = self.v;
    }

    /// Reads a group from the lane `part` on.
    #[inline(always)]
    pub fn load_group(simd: S, group: &NumberGroup, part: usize) -> Self {
        Lanes::load(simd, &group.0, part)
    }

    /// Writes a group from the lane `part` on.
    #[inline(always)]
    pub fn store_group(self, group: &mut NumberGroup, part: usize) {
        self.store(&mut group.0, part);
    }

    /// `self` where `test` is positive, `otherwise` elsewhere and where `test` is NaN.
    #[inline(always)]
    pub fn select_where_positive(self, test: Self, otherwise: Self) -> Self {
        let zero = self.simd.splat_f64s(0.0);
        let positive = self.simd.less_than_f64s(zero, test.v);
        self.with_value(self.simd.select_f64s(positive, self.v, otherwise.v))
    }

    /// self * factor + term.
    #[inline(always)]
    pub fn mul_add(self, factor: Self, term: Self) -> Self {
        self.with_value(self.simd.mul_add_e_f64s(self.v, factor.v, term.v))
    }

    /// term - self * factor.
    #[inline(always)]
    pub fn neg_mul_add(self, factor: Self, term: Self) -> Self {
        self.with_value(self.simd.negate_mul_add_e_f64s(self.v, factor.v, term.v))
    }

    /// 1 / self.
    #[inline(always)]
    pub fn recip(self) -> Self {
        let one = self.simd.splat_f64s(1.0);
        self.with_value(self.simd.div_f64s(one, self.v))
    }

    /// The larger of two sizes; infinite where one of them is not a number.
    #[inline(always)]
    pub fn larger_or_infinite(self, other: Self) -> Self {
        let sum = (self + other).v;
        let known = self.simd.equal_f64s(sum, sum);
        let most = self.simd.max_f64s(self.v, other.v);
        let infinite = self.simd.splat_f64s(f64::INFINITY);
        self.with_value(self.simd.select_f64s(known, most, infinite))
    }

    /// The larger one, where both are numbers.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        self.with_value(self.simd.max_f64s(self.v, other.v))
    }

    /// The largest of all.
    #[inline(always)]
    pub fn largest(self) -> f64 {
        self.simd.reduce_max_f64s(self.v)
    }

    /// Square roots of all numbers.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        self.with_value(self.simd.sqrt_f64s(self.v))
    }

    /// Applies `f` to every number.
    #[inline(always)]
    pub fn each(self, f: impl Fn(f64) -> f64) -> Self {
        let mut numbers = NumberGroup::default();
        self.store(&mut numbers.0[..S::F64_LANES], 0);
        for number in &mut numbers.0[..S::F64_LANES] {
            *number = f(*number);
        }
        Lanes::load_group(self.simd, &numbers, 0)
    }

    /// The smallest of all.
    #[inline(always)]
    pub fn smallest(self) -> f64 {
        self.simd.reduce_min_f64s(self.v)
    }

    /// Sum of all.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        self.simd.reduce_sum_f64s(self.v)
    }

    /// The polynomial with these coefficients, constant term first: in pairs, then pairs of
    /// these (Estrin's scheme), which are independent of each other.
    #[inline(always)]
    pub fn polynomial<const N: usize>(self, coefficients: &[f64; N]) -> Self {
        const { assert!(N <= 16, "pairs of pairs of pairs of pairs") };
        let mut terms = [self; N];
        for k in 0..N {
            terms[k] = Lanes::splat(self.simd, coefficients[k]);
        }
        // Not in a loop: compilers unroll those inside it only if they know how
        // long they are.
        let (second, fourth) = (self * self, self * self * (self * self));
        let count = self.pair(&mut terms, N);
        let count = second.pair(&mut terms, count);
        let count = fourth.pair(&mut terms, count);
        (fourth * fourth).pair(&mut terms, count);
        terms[0]
    }

    /// Replaces pairs of the first `count` terms by first + self * second; returns the new
    /// number of terms.
    #[inline(always)]
    fn pair<const N: usize>(self, terms: &mut [Self; N], count: usize) -> usize {
        for k in 0..count / 2 {
            terms[k] = terms[2 * k + 1].mul_add(self, terms[2 * k]);
        }
        if count % 2 == 1 {
            terms[count / 2] = terms[count - 1];
        }
        count.div_ceil(2)
    }
}

macro_rules! lanes_operator {
    ($operator:ident, $method:ident, $instruction:ident) => {
        impl<S: Simd> $operator for Lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.with_value(self.simd.$instruction(self.v, other.v))
            }
        }
    };
}

lanes_operator!(Add, add, add_f64s);

lanes_operator!(Sub, sub, sub_f64s);

lanes_operator!(Mul, mul, mul_f64s);

lanes_operator!(Div, div, div_f64s);

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.with_value(self.simd.neg_f64s(self.v))
    }
}

/// A single number.
impl From<f64> for Lanes<Scalar> {
    #[inline(always)]
    fn from(value: f64) -> Self {
        Lanes::splat(Scalar, value)
    }
}

impl From<Lanes<Scalar>> for f64 {
    #[inline(always)]
    fn from(single: Lanes<Scalar>) -> Self {
        single.v
    }
}

/// A vector for each of several neighboring nodes, or rods.
#[derive(Clone, Copy, Debug)]
pub struct Vectors<S: Simd> {
    /// Along the first axis.
    pub x: Lanes<S>,
    /// Along the second axis.
    pub y: Lanes<S>,
    /// Along the third axis.
    pub z: Lanes<S>,
}

impl<S: Simd> Vectors<S> {
    /// Vectors with these components.
    #[inline(always)]
    pub fn new(x: Lanes<S>, y: Lanes<S>, z: Lanes<S>) -> Self {
        Vectors { x, y, z }
    }

    /// The same vector in every lane.
    #[inline(always)]
    pub fn splat(simd: S, v: [f64; 3]) -> Self {
        let [x, y, z] = v.map(|v| Lanes::splat(simd, v));
        Vectors { x, y, z }
    }

    /// Reads three arrays from `at` on.
    #[inline(always)]
    pub fn load(simd: S, arrays: &[impl Deref<Target = [f64]>; 3], at: usize) -> Self {
        Vectors::new(
            Lanes::load(simd, &arrays[0], at),
            Lanes::load(simd, &arrays[1], at),
            Lanes::load(simd, &arrays[2], at),
        )
    }

    /// Writes three arrays from `at` on.
    #[inline(always)]
    pub fn store(self, arrays: &mut [&mut [f64]; 3], at: usize) {
        self.x.store(arrays[0], at);
        self.y.store(arrays[1], at);
        self.z.store(arrays[2], at);
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> Lanes<S> {
        let zz = self.z * other.z;
        self.x.mul_add(other.x, self.y.mul_add(other.y, zz))
    }

    /// Vector product.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Vectors::new(
            self.z.neg_mul_add(other.y, self.y * other.z),
            self.x.neg_mul_add(other.z, self.z * other.x),
            self.y.neg_mul_add(other.x, self.x * other.y),
        )
    }

    /// self * factor.
    #[inline(always)]
    pub fn scale(self, factor: Lanes<S>) -> Self {
        Vectors::new(self.x * factor, self.y * factor, self.z * factor)
    }

    /// term - self * factor.
    #[inline(always)]
    pub fn neg_mul_add(self, factor: Lanes<S>, term: Self) -> Self {
        Vectors::new(
            self.x.neg_mul_add(factor, term.x),
            self.y.neg_mul_add(factor, term.y),
            self.z.neg_mul_add(factor, term.z),
        )
    }

    /// self - a x b.
    #[inline(always)]
    pub fn subtract_cross(self, a: Self, b: Self) -> Self {
        Vectors::new(
            a.y.neg_mul_add(b.z, a.z.mul_add(b.y, self.x)),
            a.z.neg_mul_add(b.x, a.x.mul_add(b.z, self.y)),
            a.x.neg_mul_add(b.y, a.y.mul_add(b.x, self.z)),
        )
    }

    /// The vector with these components along `directors`.
    #[inline(always)]
    pub fn from_director_components(self, directors: [Self; 3]) -> Self {
        let [d1, d2, d3] = directors;
        d1.mul_add(self.x, d2.mul_add(self.y, d3.scale(self.z)))
    }

    /// The components of the vectors.
    #[inline(always)]
    pub fn array(self) -> [Lanes<S>; 3] {
        [self.x, self.y, self.z]
    }

    /// The components along `directors`.
    #[inline(always)]
    pub fn director_components(self, directors: [Self; 3]) -> Self {
        let [d1, d2, d3] = directors;
        Vectors::new(d1.dot(self), d2.dot(self), d3.dot(self))
    }

    /// Packs the vectors of a group, one in every lane, from the lane `part` on.
    #[inline(always)]
    pub fn from_group(simd: S, vectors: [DVec3; GROUP], part: usize) -> Self {
        Vectors::load_group(simd, &group_components(vectors), part)
    }

    /// The vectors of a group with these components, from the lane `part` on.
    #[inline(always)]
    pub fn load_group(simd: S, [x, y, z]: &[NumberGroup; 3], part: usize) -> Self {
        Vectors::new(
            Lanes::load_group(simd, x, part),
            Lanes::load_group(simd, y, part),
            Lanes::load_group(simd, z, part),
        )
    }

    /// self * factor + term.
    #[inline(always)]
    pub fn mul_add(self, factor: Lanes<S>, term: Self) -> Self {
        Vectors::new(
            self.x.mul_add(factor, term.x),
            self.y.mul_add(factor, term.y),
            self.z.mul_add(factor, term.z),
        )
    }
}

macro_rules! vectors_operator {
    ($operator:ident, $method:ident) => {
        impl<S: Simd> $operator for Vectors<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Vectors::new(
                    self.x.$method(other.x),
                    self.y.$method(other.y),
                    self.z.$method(other.z),
                )
            }
        }
    };
}

vectors_operator!(Add, add);

vectors_operator!(Sub, sub);

// Component by component.
vectors_operator!(Mul, mul);

vectors_operator!(Div, div);

impl<S: Simd> Neg for Vectors<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Vectors::new(-self.x, -self.y, -self.z)
    }
}

/// A single vector.
impl From<DVec3> for Vectors<Scalar> {
    #[inline(always)]
    fn from(v: DVec3) -> Self {
        Vectors::splat(Scalar, v.to_array())
    }
}

impl From<Vectors<Scalar>> for DVec3 {
    #[inline(always)]
    fn from(single: Vectors<Scalar>) -> Self {
        DVec3::from_array(single.array().map(f64::from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Count(usize);

    impl GroupKernel for Count {
        fn run<S: Simd>(&mut self, _: S, _: usize) {
            self.0 += 1;
        }
    }

    struct Width;

    impl pulp::WithSimd for Width {
        type Output = usize;
        fn with_simd<S: Simd>(self, _: S) -> usize {
            S::F64_LANES
        }
    }

    /// Instructions that are wider than a group are no reason to take one number at a time.
    #[test]
    fn a_group_takes_as_few_parts_as_the_instructions_allow() {
        let mut count = Count(0);
        run(widest_arch(), &mut count);
        assert_eq!(count.0, GROUP / widest_arch().dispatch(Width).min(GROUP));
    }

    #[test]
    fn a_lane_that_is_no_number_stays_the_largest() {
        let largest = |sizes: [f64; 3]| {
            let [a, b, c] = sizes.map(Lanes::from);
            f64::from(a.larger_or_infinite(b).larger_or_infinite(c))
        };
        assert_eq!(largest([1.0, 3.0, 2.0]), 3.0);
        for at in 0..3 {
            let mut sizes = [1.0, 3.0, 2.0];
            sizes[at] = f64::NAN;
            assert_eq!(largest(sizes), f64::INFINITY, "{at}");
        }
    }
}
