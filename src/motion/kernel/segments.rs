//! Internal forces of the midpoint element.
//!
//! The element is that of [`crate::rod`], with the force not as an independent
//! unknown but given by the strains, n = H (v - v0), which has the same
//! equilibria. With the unit quaternions q0, q1 at its ends, s = q0 + q1,
//! delta = |q1 - q0|^2 = (2 sin(psi/4))^2 = 4 - |s|^2, and w the vector part of
//! q0^* q1, of length sin(psi/2):
//!
//! ```text
//! R = R(s/|s|),   tau = 2 w/|s|^2 = tan(psi/4),   psi = 2 sigma w
//! v = R^T dx,   n = H/ds (v - ds v0),   M = 2 S A/ds (psi - ds u0)
//! force N = R n,   twice the moments on the ends G + T,  G - T,
//! G = dx x N,   T = R M - (R tau) x G
//! ```
//!
//! R w is the vector part of q1 q0^*: that of q0^* q1 is its even part minus its
//! odd part, and this their sum.
//!
//! S = sigma + c w w^T is the derivative of the rotation vector. As it maps
//! vectors along w to themselves, c = (1 - sigma)/|w|^2 = -4 B/|s|^2 if sigma is
//! written as 1 + B delta. B is a polynomial in delta ([`B`]): a segment costs one
//! division and no root.

use super::{Array, Block, GROUP, Law, Material, Past};
use crate::lanes::{Lanes, Vectors, cut, cut_mut, slice};
use crate::rotation::{B, directors};
use pulp::Simd;
use std::ops::Deref;

/// The rate of a strain, from it and the last two.
#[inline(always)]
fn rate<S: Simd>(
    (one, two): (&mut [&mut [f64]; 3], &mut [&mut [f64]; 3]),
    (now, at): (Vectors<S>, usize),
    rates: [Lanes<S>; 3],
    remember: bool,
) -> Vectors<S> {
    let simd = now.x.simd;
    let last = Vectors::load(simd, one, at);
    let before = Vectors::load(simd, two, at);
    if remember {
        last.store(two, at);
        now.store(one, at);
    }
    before.times(rates[2], last.times(rates[1], now.scale(rates[0])))
}

#[derive(Clone, Copy)]
pub struct Nodes<'a> {
    /// Index of the first, count.
    pub range: (usize, usize),
    pub x: &'a [Array; 3],
    pub q: &'a [Array; 4],
    pub material: &'a Material,
    pub law: &'a Law,
}

/// Sums of the loops over segments: see [`super::StepTotals`].
#[derive(Clone, Copy)]
pub struct SegmentSums<S: Simd> {
    /// If `DAMPED`.
    pub friction: Lanes<S>,
    /// If `CHANGES`.
    pub rest: Lanes<S>,
    pub largest_delta: Lanes<S>,
}

impl<S: Simd> SegmentSums<S> {
    #[inline(always)]
    pub fn zero(simd: S) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        SegmentSums {
            friction: zero,
            rest: zero,
            largest_delta: zero,
        }
    }
}

/// Forces and moments of the segments after `nodes`, written to `block`.
#[inline(always)]
pub fn forces<S: Simd, const DAMPED: bool, const CHANGES: bool>(
    simd: S,
    nodes: Nodes,
    past: &mut Past,
    block: &mut Block,
    sums: &mut SegmentSums<S>,
) {
    let ([one_v, one_psi], [two_v, two_psi]) = (&mut past.one, &mut past.two);
    // In two loops: the processor overlaps iterations of short ones.
    bend::<S, DAMPED, CHANGES>(simd, nodes, (one_psi, two_psi), block, sums);
    stretch::<S, DAMPED>(simd, nodes, (one_v, two_v), block, sums);
}

/// Bending: M, R tau and 2/|s|^2, for [`stretch`].
#[inline(always)]
fn bend<S: Simd, const DAMPED: bool, const CHANGES: bool>(
    simd: S,
    nodes: Nodes,
    (past_one, past_two): (&mut [Array; 3], &mut [Array; 3]),
    block: &mut Block,
    sums: &mut SegmentSums<S>,
) {
    let ((start, count), q) = (nodes.range, nodes.q);
    let (material, law) = (nodes.material, nodes.law);
    // All arrays have one length: an index valid for one is valid for the others.
    let (range, own) = ((start, count), (GROUP, count));
    let (q0, q1) = (cut(q, range), cut(q, (start + 1, count)));
    let stiffness = cut(&material.bend, (0, count));
    let rest_turn = cut(&material.rest_turn, (0, count));
    let rest_moment = cut(&material.rest_moment, (0, count));
    let mut moment = cut_mut(&mut block.left, own);
    let mut tangent = cut_mut(&mut block.right, own);
    let twice_inverse = &mut block.twice_inverse[..count];
    let mut past = DAMPED.then(|| (cut_mut(past_one, range), cut_mut(past_two, range)));
    let rates = law.rates.map(|rate| Lanes::splat(simd, rate));
    let retardation = Lanes::splat(simd, law.retardation);
    let rest = Lanes::splat(simd, law.rest);
    let (two, four) = (Lanes::splat(simd, 2.0), Lanes::splat(simd, 4.0));
    let SegmentSums {
        friction: mut power,
        rest: mut lost,
        mut largest_delta,
    } = *sums;
    let mut at = 0;
    while at + S::F64_LANES <= count {
        let (a, aw) = quaternion(simd, &q0, at);
        let (b, bw) = quaternion(simd, &q1, at);
        let (d, dw) = (b - a, bw - aw);
        let delta = d.x.times(d.x, d.y * d.y) + d.z.times(d.z, dw * dw);
        largest_delta = largest_delta.max(delta);
        let inverse = (four - delta).recip();
        let twice = inverse + inverse;
        let (even, odd) = (a.times_from(bw, b.scale(aw)), a.cross(b));
        let w = even - odd;
        (even + odd).scale(twice).store(&mut tangent, at);
        let stiffness = Vectors::load(simd, &stiffness, at);
        // The moment A (2 sigma w - u0) and its component along w, as far as possible
        // before sigma is known: the series has a long latency.
        let slope = w * stiffness;
        let mut at_rest = Vectors::load(simd, &rest_moment, at);
        if CHANGES {
            at_rest = at_rest.scale(rest);
        }
        let (slope_along, rest_along) = (w.dot(slope), w.dot(at_rest));
        let series = delta.polynomial(&B);
        let two_sigma = series.times(delta + delta, two);
        let mut m = slope.scale(two_sigma) - at_rest;
        let mut along = slope_along * two_sigma - rest_along;
        if CHANGES {
            lost = lost + Vectors::load(simd, &rest_turn, at).dot(m);
        }
        if let Some((one, two)) = &mut past {
            let rate = rate((one, two), (w.scale(two_sigma), at), rates, law.remember);
            let friction = rate * stiffness;
            power = power + rate.dot(friction);
            let friction = friction.scale(retardation);
            m = m + friction;
            along = along + w.dot(friction);
        }
        let c = series * (four * twice) * along;
        (w.times_from(c, m.scale(two_sigma))).store(&mut moment, at);
        twice.store(twice_inverse, at);
        at += S::F64_LANES;
    }
    *sums = SegmentSums {
        friction: power,
        rest: lost,
        largest_delta,
    };
}

/// Stretch and shear, and the forces and moments on the ends.
#[inline(always)]
fn stretch<S: Simd, const DAMPED: bool>(
    simd: S,
    nodes: Nodes,
    (past_one, past_two): (&mut [Array; 3], &mut [Array; 3]),
    block: &mut Block,
    sums: &mut SegmentSums<S>,
) {
    let ((start, count), x, q) = (nodes.range, nodes.x, nodes.q);
    let (material, law) = (nodes.material, nodes.law);
    let (range, after, own) = ((start, count), (start + 1, count), (GROUP, count));
    let (x0, x1) = (cut(x, range), cut(x, after));
    let (q0, q1) = (cut(q, range), cut(q, after));
    let stiffness = cut(&material.stretch, (0, count));
    let rest_length = slice(&material.rest_length, (0, count));
    let mut force = cut_mut(&mut block.n, own);
    let mut left = cut_mut(&mut block.left, own);
    let mut right = cut_mut(&mut block.right, own);
    let twice_inverse = &block.twice_inverse[..count];
    let mut past = DAMPED.then(|| (cut_mut(past_one, range), cut_mut(past_two, range)));
    let rates = law.rates.map(|rate| Lanes::splat(simd, rate));
    let retardation = Lanes::splat(simd, law.retardation);
    let mut power = sums.friction;
    let mut at = 0;
    while at + S::F64_LANES <= count {
        let (a, aw) = quaternion(simd, &q0, at);
        let (b, bw) = quaternion(simd, &q1, at);
        // Midpoint frame: the rotation matrix of s, not normalised.
        let (s, sw) = (a + b, aw + bw);
        let directors = directors((s, sw), Lanes::load(simd, twice_inverse, at));
        let dx = Vectors::load(simd, &x1, at) - Vectors::load(simd, &x0, at);
        let length = Lanes::load(simd, rest_length, at);
        let v = dx.onto(directors);
        let mut strain = Vectors::new(v.x - length, v.y, v.z);
        let stiffness = Vectors::load(simd, &stiffness, at);
        if let Some((one, two)) = &mut past {
            let rate = rate((one, two), (v, at), rates, law.remember);
            strain = rate.times(retardation, strain);
            power = power + rate.dot(rate * stiffness);
        }
        let n = strain * stiffness;
        // Along the lab axes from here on: R (v x n) = dx x N.
        let n = n.along(directors);
        n.store(&mut force, at);
        let g = dx.cross(n);
        let m = Vectors::load(simd, &left, at).along(directors);
        let t = m.less_cross(Vectors::load(simd, &right, at), g);
        (g + t).store(&mut left, at);
        (g - t).store(&mut right, at);
        at += S::F64_LANES;
    }
    sums.friction = power;
}

/// Vector and scalar parts of unit quaternions.
#[inline(always)]
pub fn quaternion<S: Simd>(
    simd: S,
    q: &[impl Deref<Target = [f64]>; 4],
    at: usize,
) -> (Vectors<S>, Lanes<S>) {
    let vector = Vectors::new(
        Lanes::load(simd, &q[0], at),
        Lanes::load(simd, &q[1], at),
        Lanes::load(simd, &q[2], at),
    );
    (vector, Lanes::load(simd, &q[3], at))
}
