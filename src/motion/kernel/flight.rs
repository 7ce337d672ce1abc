//! The motion of nodes: a kick by all forces, then free flight.

use pulp::Simd;

use super::{Block, GROUP, Material, Motion, Neighbour};
use crate::motion::lanes::{Lanes, Vectors, cut, cut_mut, slice};

/// cos and sin(a)/a as series in a^2, for angles of a step (halved): 3e-17 up
/// to 0.1, 1e-9 up to 0.5. (Cut off, they turn a node by a little more or less
/// than its angular momentum says, by an angle that still depends on that alone:
/// the method stays symplectic.)
const COS: [f64; 5] = [1.0, -1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40_320.0];
const SINC: [f64; 5] = [
    1.0,
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5_040.0,
    1.0 / 362_880.0,
];

/// A kick and a flight of the nodes of a block. Positions move on, and every
/// node turns as a body free of moments with one axis of symmetry does: about
/// its angular momentum, and about its own axis.
pub struct Flight<'a> {
    pub positions: &'a [Vec<f64>; 3],
    pub next: &'a mut [Vec<f64>; 3],
    pub neighbours: &'a [Option<Neighbour<'a>>; 2],
    pub motion: &'a mut Motion,
    pub material: &'a Material,
    pub gravity: [f64; 3],
    pub keep: f64,
    pub kick: f64,
    pub step: f64,
    pub block: &'a Block,
}

impl Flight<'_> {
    /// Moves the nodes of `place` (index of the first, count); returns eight
    /// times their kinetic energy in the middle of the kick.
    #[inline(always)]
    pub fn go<S: Simd>(self, simd: S, place: (usize, usize)) -> Lanes<S> {
        let nodes = place.1;
        let own = |array| slice(array, place);
        let material = self.material;
        let (weight, coupled) = (own(&material.weight), own(&material.coupled));
        let (mass, per_mass) = (own(&material.mass), own(&material.per_mass));
        let (per_inertia, per_spin) = (own(&material.per_inertia), own(&material.per_spin));
        let (here, before) = ((GROUP, nodes), (GROUP - 1, nodes));
        let (n_right, n_left) = (cut(&self.block.n, here), cut(&self.block.n, before));
        let (left, right) = (cut(&self.block.left, here), cut(&self.block.right, before));
        let x = cut(self.positions, place);
        let mut next = cut_mut(self.next, place);
        let Motion { q, v, p } = self.motion;
        let (q, mut v, mut p) = (cut_mut(q, place), cut_mut(v, place), cut_mut(p, place));
        let neighbours = self.neighbours.each_ref().map(|neighbour| {
            neighbour.as_ref().map(|neighbour| {
                let stiffness = Vectors::splat(simd, neighbour.stiffness);
                (cut(&neighbour.positions.x, place), stiffness)
            })
        });
        let gravity = Vectors::splat(simd, self.gravity);
        let (keep, kick) = (Lanes::splat(simd, self.keep), Lanes::splat(simd, self.kick));
        let half_kick = Lanes::splat(simd, 0.5 * self.kick);
        let step = Lanes::splat(simd, self.step);
        let half_step = Lanes::splat(simd, 0.5 * self.step);
        let one = Lanes::splat(simd, 1.0);
        let (three_halves, half) = (Lanes::splat(simd, 1.5), Lanes::splat(simd, 0.5));
        let mut energy = Lanes::splat(simd, 0.0);
        let mut at = 0;
        while at + S::F64_LANES <= nodes {
            let weight = Lanes::load(simd, weight, at);
            let force = Vectors::load(simd, &n_right, at) - Vectors::load(simd, &n_left, at);
            let mut force = gravity.times(weight, force);
            let x = Vectors::load(simd, &x, at);
            let share = Lanes::load(simd, coupled, at);
            for (beside, stiffness) in neighbours.iter().flatten() {
                let gap = Vectors::load(simd, beside, at) - x;
                force = gap.each(*stiffness).times(share, force);
            }
            let per_mass = Lanes::load(simd, per_mass, at);
            let before = Vectors::load(simd, &v, at);
            let after = force.times(kick * per_mass, before.scale(keep));
            after.store(&mut v, at);
            after.times(step, x).store(&mut next, at);
            let twice = before + after;
            energy = (twice.dot(twice)).times(Lanes::load(simd, mass, at), energy);

            let moment = Vectors::load(simd, &left, at) + Vectors::load(simd, &right, at);
            let per_inertia = Lanes::load(simd, per_inertia, at);
            let per_spin = Lanes::load(simd, per_spin, at);
            let before = Vectors::load(simd, &p, at);
            let after = moment.times(half_kick, before.scale(keep));
            after.store(&mut p, at);
            let twice = before + after;
            let (r, w) = (
                Vectors::load(simd, &[&*q[0], &*q[1], &*q[2]], at),
                Lanes::load(simd, q[3], at),
            );
            let (y, z) = (r.y + r.y, r.z + r.z);
            let d1 = Vectors::new(
                r.y.times_from(y, r.z.times_from(z, one)),
                r.x.times(y, w * z),
                w.times_from(y, r.x * z),
            );
            let spin = d1.dot(twice);
            energy = twice.dot(twice).times(per_inertia, energy);
            energy = (spin * spin).times(per_spin, energy);

            // Half angle about the angular momentum.
            let a = after.scale(half_step * per_inertia);
            let squared = a.dot(a);
            let (c, s) = (squared.polynomial(&COS), squared.polynomial(&SINC));
            let a = a.scale(s);
            // q <- (a, c) q
            let turned = a.times(w, r.scale(c)).less_cross(r, a);
            let turned_w =
                a.z.times_from(r.z, a.y.times_from(r.y, a.x.times_from(r.x, c * w)));
            // Half angle about the body's own axis d1 of the old rotation.
            let b = d1.dot(after) * half_step * per_spin;
            let squared = b * b;
            let (c, s) = (squared.polynomial(&COS), b * squared.polynomial(&SINC));
            // q <- q (s, 0, 0, c)
            let x = turned.x.times(c, turned_w * s);
            let y = turned.y.times(c, turned.z * s);
            let z = turned.y.times_from(s, turned.z * c);
            let w = turned.x.times_from(s, turned_w * c);
            // Back to unit length, from very near to it.
            let squared = x.times(x, y * y) + z.times(z, w * w);
            let scale = half.times_from(squared, three_halves);
            (x * scale).store(q[0], at);
            (y * scale).store(q[1], at);
            (z * scale).store(q[2], at);
            (w * scale).store(q[3], at);
            at += S::F64_LANES;
        }
        energy
    }
}
