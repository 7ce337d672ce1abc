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
//!
//! What is the same along all directors needs none of them: H and A are split into their
//! values along d2 and the excess along d1 and d3. For round sections that are straight at
//! rest d1 alone is left, which saves a quarter of the operations.

use super::{Array, Block, Law, Material, Past, WIDTH};
use crate::lanes::{Lanes, Vectors, cut, cut_mut, slice};
use crate::rotation::{B, Quaternions};
use pulp::Simd;
use std::ops::Deref;

/// The rate of a strain, from it and the last two.
#[inline(always)]
fn rate<S: Simd>(
    (last, earlier): (&mut [&mut [f64]; 3], &mut [&mut [f64]; 3]),
    (now, at): (Vectors<S>, usize),
    rates: [Lanes<S>; 3],
    remember: bool,
) -> Vectors<S> {
    let simd = now.x.simd;
    let (one, two) = (
        Vectors::load(simd, last, at),
        Vectors::load(simd, earlier, at),
    );
    if remember {
        one.store(earlier, at);
        now.store(last, at);
    }
    two.mul_add(rates[2], one.mul_add(rates[1], now.scale(rates[0])))
}

/// The nodes of a block.
#[derive(Clone, Copy)]
pub struct Nodes<'a> {
    /// Index of the first in the arrays of the pack, and their number.
    pub start: usize,
    pub count: usize,
    /// Index of the first in the arrays of the leaf.
    pub first: usize,
    /// Of the leaf.
    pub x: &'a [Array; 3],
    /// Of the pack.
    pub q: &'a [Array; 4],
    pub material: &'a Material,
    pub law: &'a Law,
}

/// Sums of the loops over segments: see [`super::StepTotals`].
#[derive(Clone, Copy)]
pub struct SegmentSums<S: Simd> {
    /// With internal friction.
    pub friction: Lanes<S>,
    /// If rest curvatures vary.
    pub rest: Lanes<S>,
}

impl<S: Simd> SegmentSums<S> {
    #[inline(always)]
    pub fn zero(simd: S) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        SegmentSums {
            friction: zero,
            rest: zero,
        }
    }
}

/// Forces and moments of the segments after `nodes`, written to `block`.
#[inline(always)]
pub fn forces<S: Simd>(
    simd: S,
    nodes: Nodes,
    past: &mut Past,
    block: &mut Block,
    sums: &mut SegmentSums<S>,
) {
    let (law, round) = (nodes.law, nodes.material.round);
    match (law.damped, law.changes) {
        (false, false) if round => loops::<S, true, false, false>(simd, nodes, past, block, sums),
        (false, false) => loops::<S, false, false, false>(simd, nodes, past, block, sums),
        (false, true) => loops::<S, false, false, true>(simd, nodes, past, block, sums),
        (true, _) => loops::<S, false, true, true>(simd, nodes, past, block, sums),
    }
}

/// Smallest |s|^2: between two rods, whose segment has no stiffness, it could be zero.
const LEAST: f64 = 1e-8;

/// Up to this delta, of a segment bent by 0.2, so many terms of B are accurate to rounding.
const SHORT: f64 = 0.01;
const TERMS: usize = 5;

/// B(delta).
#[inline(always)]
fn series<S: Simd>(delta: Lanes<S>) -> Lanes<S> {
    let [a, b, c, d, e, ..] = B;
    let short: [f64; TERMS] = [a, b, c, d, e];
    match delta.largest() < SHORT {
        true => delta.polynomial(&short),
        false => delta.polynomial(&B),
    }
}

/// The directors of the quaternion `s` of any length, `twice` being 2/|s|^2: with additions in
/// place of some multiplications, of which there are more here.
#[inline(always)]
fn directors<S: Simd>((s, sw): Quaternions<S>, twice: Lanes<S>) -> [Vectors<S>; 3] {
    let one = Lanes::splat(twice.simd, 1.0);
    let r = s.scale(twice);
    let (xx, yy, zz) = (s.x * r.x, s.y * r.y, s.z * r.z);
    let (xy, xz, yz) = (s.x * r.y, s.x * r.z, s.y * r.z);
    let (wx, wy, wz) = (sw * r.x, sw * r.y, sw * r.z);
    [
        Vectors::new(one - (yy + zz), xy + wz, xz - wy),
        Vectors::new(xy - wz, one - (xx + zz), yz + wx),
        Vectors::new(xz + wy, yz - wx, one - (xx + yy)),
    ]
}

/// A stiffness along the directors: that along d2, and the excess along d1 and d3 over it.
#[inline(always)]
fn stiffness<S: Simd>(along_2: Lanes<S>, excess_1: Lanes<S>, excess_3: Lanes<S>) -> Vectors<S> {
    Vectors::new(along_2 + excess_1, along_2, along_2 + excess_3)
}

#[inline(always)]
fn loops<S: Simd, const ROUND: bool, const DAMPED: bool, const CHANGES: bool>(
    simd: S,
    nodes: Nodes,
    past: &mut Past,
    block: &mut Block,
    sums: &mut SegmentSums<S>,
) {
    let Nodes {
        start,
        count,
        material,
        law,
        ..
    } = nodes;
    let (x0, x1) = (
        cut(nodes.x, (nodes.first, count)),
        cut(nodes.x, (nodes.first + 1, count)),
    );
    let (q0, q1) = (
        cut(nodes.q, (start, count)),
        cut(nodes.q, (start + 1, count)),
    );
    let own = |array| slice(array, (0, count));
    let (shear, bend) = (own(&material.shear), own(&material.bend));
    let stretch_excess = cut(&material.stretch_excess, (0, count));
    let bend_excess = cut(&material.bend_excess, (0, count));
    let rest_force = cut(&material.rest_force, (0, count));
    let rest_moment = cut(&material.rest_moment, (0, count));
    let rest_turn = cut(&material.rest_turn, (0, count));
    let mut force = cut_mut(&mut block.n, (WIDTH, count));
    let mut left = cut_mut(&mut block.left, (WIDTH, count));
    let mut right = cut_mut(&mut block.right, (WIDTH, count));
    let ([last_v, last_psi], [earlier_v, earlier_psi]) = (&mut past.last, &mut past.earlier);
    let mut past = DAMPED.then(|| {
        let range = (start, count);
        (
            (cut_mut(last_v, range), cut_mut(earlier_v, range)),
            (cut_mut(last_psi, range), cut_mut(earlier_psi, range)),
        )
    });
    let rates = law.rates.map(|rate| Lanes::splat(simd, rate));
    let retardation = Lanes::splat(simd, law.retardation);
    let rest = Lanes::splat(simd, law.rest);
    let (two, four) = (Lanes::splat(simd, 2.0), Lanes::splat(simd, 4.0));
    let (quarter, least) = (Lanes::splat(simd, 0.25), Lanes::splat(simd, LEAST));
    let mut at = 0;
    while at + S::F64_LANES <= count {
        let (a, aw) = quaternion(simd, &q0, at);
        let (b, bw) = quaternion(simd, &q1, at);
        let (d, dw) = (b - a, bw - aw);
        let delta = d.x.mul_add(d.x, d.y * d.y) + d.z.mul_add(d.z, dw * dw);
        let inverse = (four - delta).max(least).recip();
        let twice = inverse + inverse;
        let (even, odd) = (a.neg_mul_add(bw, b.scale(aw)), a.cross(b));
        // Along the directors in the middle, and along the lab axes.
        let (w, w_lab) = (even - odd, even + odd);
        let series = series(delta);
        let two_sigma = series.mul_add(delta + delta, two);
        // The moment A (2 sigma w - u0) = A2 2 sigma w + extra.
        let bend = Lanes::load(simd, bend, at);
        let load = |arrays: &[&[f64]; 3]| Vectors::load(simd, arrays, at);
        let [excess_1, excess_3] = [0, 1].map(|c| Lanes::load(simd, bend_excess[c], at));
        let stiff = bend * two_sigma;
        let mut extra = -load(&rest_moment);
        if CHANGES {
            extra = extra.scale(rest);
        }
        extra.x = (excess_1 * two_sigma).mul_add(w.x, extra.x);
        if !ROUND {
            extra.z = (excess_3 * two_sigma).mul_add(w.z, extra.z);
        }
        if CHANGES {
            sums.rest = sums.rest + load(&rest_turn).dot(w.mul_add(stiff, extra));
        }
        if let Some((_, (last, earlier))) = &mut past {
            let rate = rate(
                (last, earlier),
                (w.scale(two_sigma), at),
                rates,
                law.remember,
            );
            let friction = rate * stiffness(bend, excess_1, excess_3);
            sums.friction = sums.friction + rate.dot(friction);
            extra = friction.mul_add(retardation, extra);
        }
        let along_extra = match ROUND {
            true => extra.x * w.x,
            false => extra.dot(w),
        };
        // |w|^2 = sin^2(psi/2).
        let squared = (delta * delta).neg_mul_add(quarter, delta);
        let along = stiff.mul_add(squared, along_extra);
        let four_inverse = twice + twice;
        let c = series * (four_inverse + four_inverse) * along;
        let mut m = w_lab.scale(two_sigma * stiff - c);

        // Along the lab axes: R (v x n) = dx x N.
        let dx = Vectors::load(simd, &x1, at) - Vectors::load(simd, &x0, at);
        let shear = Lanes::load(simd, shear, at);
        let [excess_1, excess_3] = [0, 1].map(|c| Lanes::load(simd, stretch_excess[c], at));
        let directors = directors((a + b, aw + bw), twice);
        let n = if ROUND {
            let [d1, ..] = directors;
            let rest_force = Lanes::load(simd, rest_force[0], at);
            m = d1.mul_add(two_sigma * extra.x, m);
            d1.mul_add(excess_1 * d1.dot(dx) - rest_force, dx.scale(shear))
        } else {
            m = m + extra.scale(two_sigma).along(directors);
            let v = dx.onto(directors);
            let rest_force = load(&rest_force);
            let mut extra = Vectors::new(
                excess_1 * v.x - rest_force.x,
                -rest_force.y,
                excess_3 * v.z - rest_force.z,
            );
            if let Some(((last, earlier), _)) = &mut past {
                let rate = rate((last, earlier), (v, at), rates, law.remember);
                let friction = rate * stiffness(shear, excess_1, excess_3);
                sums.friction = sums.friction + rate.dot(friction);
                extra = friction.mul_add(retardation, extra);
            }
            extra.along(directors) + dx.scale(shear)
        };
        n.store(&mut force, at);
        let g = dx.cross(n);
        let t = m.less_cross(w_lab.scale(twice), g);
        (g + t).store(&mut left, at);
        (g - t).store(&mut right, at);
        at += S::F64_LANES;
    }
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
