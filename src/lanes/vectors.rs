//! Vectors of several nodes, or rods, at once.

use crate::lanes::number::{Four, GROUP, Lanes};
use glam::DVec3;
use pulp::{Scalar, Simd};
use std::ops::{Add, Deref, Div, Mul, Neg, Sub};

/// A vector for each of several neighbouring nodes, or rods.
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
    /// From its components.
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
    pub fn less_cross(self, a: Self, b: Self) -> Self {
        Vectors::new(
            a.y.neg_mul_add(b.z, a.z.mul_add(b.y, self.x)),
            a.z.neg_mul_add(b.x, a.x.mul_add(b.z, self.y)),
            a.x.neg_mul_add(b.y, a.y.mul_add(b.x, self.z)),
        )
    }

    /// The vector with these components along `directors`.
    #[inline(always)]
    pub fn along(self, directors: [Self; 3]) -> Self {
        let [d1, d2, d3] = directors;
        d1.mul_add(self.x, d2.mul_add(self.y, d3.scale(self.z)))
    }

    /// Its components.
    #[inline(always)]
    pub fn array(self) -> [Lanes<S>; 3] {
        [self.x, self.y, self.z]
    }

    /// The components along `directors`.
    #[inline(always)]
    pub fn onto(self, directors: [Self; 3]) -> Self {
        let [d1, d2, d3] = directors;
        Vectors::new(d1.dot(self), d2.dot(self), d3.dot(self))
    }

    /// One vector in every lane, from the lane `part` on.
    #[inline(always)]
    pub fn gather(simd: S, vectors: [DVec3; GROUP], part: usize) -> Self {
        let [a, b, c, d] = vectors;
        Vectors::new(
            Lanes::of(simd, &Four([a.x, b.x, c.x, d.x]), part),
            Lanes::of(simd, &Four([a.y, b.y, c.y, d.y]), part),
            Lanes::of(simd, &Four([a.z, b.z, c.z, d.z]), part),
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
