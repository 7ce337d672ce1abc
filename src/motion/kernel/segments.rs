//! Internal forces of the midpoint element.
//!
//! The element is that of [`crate::rod`] with the force not carried as an
//! unknown but following from the strains, n = H (v - v0), which has the same
//! equilibria. With the unit quaternions q0, q1 at its ends, s = q0 + q1,
//! delta = |q1 - q0|^2 = (2 sin(psi/4))^2 = 4 - |s|^2, and w the vector part of
//! q0^* q1, of length sin(psi/2):
//!
//! ```text
//! R = R(s/|s|),   tau = 2 w/|s|^2 = tan(psi/4),   psi = 2 sigma w
//! v = R^T dx,   n = H/ds (v - ds v0),   G = v x n,   M = 2 S A/ds (psi - ds u0)
//! force N = R n,   twice the moments on the ends R (G + T),  R (G - T),   T = M - tau x G
//! ```
//!
//! S = sigma + c w w^T is the derivative of the rotation vector. As it leaves
//! what lies along w as it is, c = (1 - sigma)/|w|^2 = -4 B/|s|^2 if sigma is
//! written as 1 + B delta. B is a polynomial in delta: a segment costs one
//! division and no root.

use pulp::Simd;

use super::{Block, GROUP, Law, Material, Past};
use crate::motion::lanes::{Lanes, Vectors, cut, cut_mut, slice};

/// (sigma - 1)/delta as a polynomial in delta, sigma being (psi/2)/sin(psi/2):
/// interpolated at Chebyshev's nodes on 0..2/3, largest error of sigma 1.7e-16.
/// Up to there, a segment bent by 1.68, a little more than what counts as
/// resolved.
const B: [f64; 11] = [
    0.16666666666666688,
    0.03333333333325741,
    0.007142857147397268,
    0.0015873014817296078,
    0.00036075161528440684,
    8.324142592010429e-05,
    1.9462028784123005e-05,
    4.469961631947446e-06,
    1.2554386436622931e-06,
    7.904972852467008e-08,
    1.5773720034975787e-07,
];

/// The rate of a strain, from the last two.
#[inline(always)]
fn rate<S: Simd>(
    (one, two): (&mut [&mut [f64]; 3], &mut [&mut [f64]; 3]),
    (now, at): (Vectors<S>, usize),
    rates: [Lanes<S>; 3],
    remember: bool,
) -> Vectors<S> {
    let simd = now.x.simd();
    let last = Vectors::load(simd, one, at);
    let before = Vectors::load(simd, two, at);
    if remember {
        last.store(two, at);
        now.store(one, at);
    }
    before.times(rates[2], last.times(rates[1], now.scale(rates[0])))
}

/// Nodes of a rod, and what is known there.
#[derive(Clone, Copy)]
pub struct Nodes<'a> {
    /// Index of the first, count.
    pub place: (usize, usize),
    pub x: &'a [Vec<f64>; 3],
    pub q: &'a [Vec<f64>; 4],
    pub material: &'a Material,
    pub law: &'a Law,
}

/// Forces and moments of the segments behind `nodes`, put into `block`. Returns
/// the power of internal friction over the retardation time, if `DAMPED`, and
/// if `CHANGES` the elastic energy taken by a rise of the factor of the rest
/// curvature, over that rise.
#[inline(always)]
pub fn forces<S: Simd, const DAMPED: bool, const CHANGES: bool>(
    simd: S,
    nodes: Nodes,
    past: &mut Past,
    block: &mut Block,
) -> (Lanes<S>, Lanes<S>) {
    let ([one_v, one_psi], [two_v, two_psi]) = (&mut past.one, &mut past.two);
    // In two loops: of short ones the processor works on several rounds at once.
    let (bent, lost) = bend::<S, DAMPED, CHANGES>(simd, nodes, (one_psi, two_psi), block);
    let stretched = stretch::<S, DAMPED>(simd, nodes, (one_v, two_v), block);
    (bent + stretched, lost)
}

/// Bending: M, tau and 2/|s|^2, for [`stretch`] to go on with.
#[inline(always)]
fn bend<S: Simd, const DAMPED: bool, const CHANGES: bool>(
    simd: S,
    nodes: Nodes,
    (past_one, past_two): (&mut [Vec<f64>; 3], &mut [Vec<f64>; 3]),
    block: &mut Block,
) -> (Lanes<S>, Lanes<S>) {
    let Nodes {
        place: (start, count),
        q,
        material,
        law,
        ..
    } = nodes;
    // Of one length all: what is inside one is inside the others.
    let (place, own) = ((start, count), (GROUP, count));
    let (q0, q1) = (cut(q, place), cut(q, (start + 1, count)));
    let stiffness = cut(&material.bend, place);
    let rest_turn = cut(&material.rest_turn, place);
    let mut moment = cut_mut(&mut block.left, own);
    let mut tangent = cut_mut(&mut block.right, own);
    let twice_inverse = &mut block.twice_inverse[..count];
    let mut past = DAMPED.then(|| (cut_mut(past_one, place), cut_mut(past_two, place)));
    let rates = law.rates.map(|rate| Lanes::splat(simd, rate));
    let retardation = Lanes::splat(simd, law.retardation);
    let rest = Lanes::splat(simd, law.rest);
    let (one, four) = (Lanes::splat(simd, 1.0), Lanes::splat(simd, 4.0));
    let mut power = Lanes::splat(simd, 0.0);
    let mut lost = Lanes::splat(simd, 0.0);
    let mut at = 0;
    while at + S::F64_LANES <= count {
        let (a, aw) = quaternion(simd, &q0, at);
        let (b, bw) = quaternion(simd, &q1, at);
        let (d, dw) = (b - a, bw - aw);
        let delta = d.dot(d) + dw * dw;
        let inverse = (four - delta).recip();
        let twice = inverse + inverse;
        let w = a.times_from(bw, b.scale(aw)).less_cross(a, b);
        let series = delta.long_polynomial(&B);
        let sigma = series.times(delta, one);
        let two_sigma = sigma + sigma;
        let psi = w.scale(two_sigma);
        let rest_turn = Vectors::load(simd, &rest_turn, at);
        let mut turn = psi - rest_turn.scale(rest);
        let stiffness = Vectors::load(simd, &stiffness, at);
        if CHANGES {
            lost = lost + rest_turn.dot(turn.each(stiffness));
        }
        if let Some((one, two)) = &mut past {
            let rate = rate((one, two), (psi, at), rates, law.remember);
            turn = rate.times(retardation, turn);
            power = power + rate.dot(rate.each(stiffness));
        }
        let m = turn.each(stiffness);
        let c = series * (four * twice) * w.dot(m);
        (w.times_from(c, m.scale(two_sigma))).store(&mut moment, at);
        w.scale(twice).store(&mut tangent, at);
        twice.store(twice_inverse, at);
        at += S::F64_LANES;
    }
    (power, lost)
}

/// Stretch and shear, and all that acts on the ends. Returns the power of
/// friction.
#[inline(always)]
fn stretch<S: Simd, const DAMPED: bool>(
    simd: S,
    nodes: Nodes,
    (past_one, past_two): (&mut [Vec<f64>; 3], &mut [Vec<f64>; 3]),
    block: &mut Block,
) -> Lanes<S> {
    let Nodes {
        place: (start, count),
        x,
        q,
        material,
        law,
    } = nodes;
    let (place, after, own) = ((start, count), (start + 1, count), (GROUP, count));
    let (x0, x1) = (cut(x, place), cut(x, after));
    let (q0, q1) = (cut(q, place), cut(q, after));
    let stiffness = cut(&material.stretch, place);
    let rest_length = slice(&material.rest_length, place);
    let mut force = cut_mut(&mut block.n, own);
    let mut left = cut_mut(&mut block.left, own);
    let mut right = cut_mut(&mut block.right, own);
    let twice_inverse = &block.twice_inverse[..count];
    let mut past = DAMPED.then(|| (cut_mut(past_one, place), cut_mut(past_two, place)));
    let rates = law.rates.map(|rate| Lanes::splat(simd, rate));
    let retardation = Lanes::splat(simd, law.retardation);
    let one = Lanes::splat(simd, 1.0);
    let mut power = Lanes::splat(simd, 0.0);
    let mut at = 0;
    while at + S::F64_LANES <= count {
        let (a, aw) = quaternion(simd, &q0, at);
        let (b, bw) = quaternion(simd, &q1, at);
        // Midpoint frame: the rotation matrix of s without its length.
        let (s, sw) = (a + b, aw + bw);
        let t = s.scale(Lanes::load(simd, twice_inverse, at));
        let (xy, xz, yz) = (s.x * t.y, s.x * t.z, s.y * t.z);
        let (not_x, not_z) = (s.x.times_from(t.x, one), s.z.times_from(t.z, one));
        let d1 = Vectors::new(
            s.y.times_from(t.y, not_z),
            sw.times(t.z, xy),
            sw.times_from(t.y, xz),
        );
        let d2 = Vectors::new(
            sw.times_from(t.z, xy),
            s.x.times_from(t.x, not_z),
            sw.times(t.x, yz),
        );
        let d3 = Vectors::new(
            sw.times(t.y, xz),
            sw.times_from(t.x, yz),
            s.y.times_from(t.y, not_x),
        );
        let dx = Vectors::load(simd, &x1, at) - Vectors::load(simd, &x0, at);
        let length = Lanes::load(simd, rest_length, at);
        let v = Vectors::new(d1.dot(dx), d2.dot(dx), d3.dot(dx));
        let mut strain = Vectors::new(v.x - length, v.y, v.z);
        let stiffness = Vectors::load(simd, &stiffness, at);
        if let Some((one, two)) = &mut past {
            let rate = rate((one, two), (v, at), rates, law.remember);
            strain = rate.times(retardation, strain);
            power = power + rate.dot(rate.each(stiffness));
        }
        let n = strain.each(stiffness);
        let directors = [d1, d2, d3];
        n.along(directors).store(&mut force, at);
        let g = v.cross(n);
        let m = Vectors::load(simd, &left, at);
        let t = m.less_cross(Vectors::load(simd, &right, at), g);
        (g + t).along(directors).store(&mut left, at);
        (g - t).along(directors).store(&mut right, at);
        at += S::F64_LANES;
    }
    power
}

/// Vector and scalar parts of unit quaternions.
#[inline(always)]
pub fn quaternion<S: Simd>(simd: S, q: &[&[f64]; 4], at: usize) -> (Vectors<S>, Lanes<S>) {
    let vector = Vectors::new(
        Lanes::load(simd, q[0], at),
        Lanes::load(simd, q[1], at),
        Lanes::load(simd, q[2], at),
    );
    (vector, Lanes::load(simd, q[3], at))
}
