//! The motion of nodes: a kick by all forces, then a drift free of them.

use pulp::Simd;

use super::segments::quaternion;
use super::{Array, BLOCK, Motion, Step, WIDTH};
use crate::lanes::{Lanes, Vectors, cut, cut_mut, slice, slice_mut};

/// cos and sin(a)/a as series in a^2, for angles of a step (halved). Due to truncation
/// a node turns by slightly too much: by 2e-10 of the angle at a = 0.1,
/// increasing with a^6, which does not affect the order of the method. As the angle still
/// depends on the angular momentum alone, the method stays symplectic. cos^2 +
/// sin^2 exceeds 1 by at most 4e-4 a^8.
const COS: [f64; 4] = [1.0, -1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0];
const SINC: [f64; 3] = [1.0, -1.0 / 6.0, 1.0 / 120.0];

impl Step<'_> {
    /// Moves the nodes of the block `range` (index of the first, count) with the forces in
    /// the block; returns eight times their kinetic energy in the middle of the
    /// kick. Every node rotates as a torque-free body with one axis of symmetry:
    /// about its angular momentum, and about its own axis.
    #[inline(always)]
    pub fn kick_and_drift<S: Simd>(&mut self, simd: S, range: (usize, usize)) -> Lanes<S> {
        // In two loops: the processor overlaps iterations of short ones.
        let none = [[0.0; 3]; 2];
        let moving = match (self.coupling, self.applied) {
            (coupling, Some([moments, _])) => {
                self.add_moments(range, moments);
                self.translate::<S, true, true>(simd, range, coupling.unwrap_or(none))
            }
            (Some(coupling), None) => self.translate::<S, true, false>(simd, range, coupling),
            (None, None) => self.translate::<S, false, false>(simd, range, none),
        };
        let turning = match self.normalise {
            true => self.rotate::<S, true>(simd, range),
            false => self.rotate::<S, false>(simd, range),
        };
        moving + turning
    }

    /// Adds moments on the nodes to those of the segments.
    fn add_moments(&mut self, (start, nodes): (usize, usize), moments: &[Array; 3]) {
        let first = self.layout.at(self.layout.rods_of(self.pack).start, start);
        for (left, moments) in self.block.left.iter_mut().zip(moments) {
            let moments = &moments[first..first + nodes];
            for (left, moment) in left[WIDTH..].iter_mut().zip(moments) {
                *left += 2.0 * moment;
            }
        }
    }

    /// Velocities and positions.
    #[inline(always)]
    fn translate<S: Simd, const COUPLED: bool, const APPLIED: bool>(
        &mut self,
        simd: S,
        range: (usize, usize),
        coupling: [[f64; 3]; 2],
    ) -> Lanes<S> {
        let (start, nodes) = range;
        let own = |array| slice(array, (0, nodes));
        let blocks = self.material;
        let material = &blocks[start / BLOCK];
        let weight = own(&material.weight);
        let coupled = cut(&material.coupled, (0, nodes));
        let (mass, per_mass) = (own(&material.mass), own(&material.per_mass));
        let n_right = cut(&self.block.n, (WIDTH, nodes));
        let n_left = cut(&self.block.n, (WIDTH - 1, nodes));
        let stride = self.layout.stride;
        let first = self.layout.at(self.layout.rods_of(self.pack).start, start);
        let of_rods = |first| cut(self.positions, (first, nodes));
        let (before, x, after) = (
            of_rods(first - stride),
            of_rods(first),
            of_rods(first + stride),
        );
        let forces = cut(
            self.applied.map_or(self.positions, |[_, forces]| forces),
            (first, nodes),
        );
        let [next_x, next_y, next_z] = &mut self.next;
        let mut next = [
            slice_mut(next_x, range),
            slice_mut(next_y, range),
            slice_mut(next_z, range),
        ];
        let mut v = cut_mut(&mut self.motion.v, range);
        let [to_before, to_after] = coupling.map(|coupling| Vectors::splat(simd, coupling));
        let gravity = Vectors::splat(simd, self.loads.gravity.to_array());
        let (keep, kick) = (Lanes::splat(simd, self.keep), Lanes::splat(simd, self.kick));
        let step = Lanes::splat(simd, self.drift);
        let mut energy = Lanes::splat(simd, 0.0);
        let mut at = 0;
        while at + S::F64_LANES <= nodes {
            let weight = Lanes::load(simd, weight, at);
            let force = Vectors::load(simd, &n_right, at) - Vectors::load(simd, &n_left, at);
            let mut force = gravity.mul_add(weight, force);
            let x = Vectors::load(simd, &x, at);
            if COUPLED {
                let pull = (Vectors::load(simd, &before, at) - x) * to_before;
                force = pull.mul_add(Lanes::load(simd, coupled[0], at), force);
                let pull = (Vectors::load(simd, &after, at) - x) * to_after;
                force = pull.mul_add(Lanes::load(simd, coupled[1], at), force);
            }
            if APPLIED {
                force = force + Vectors::load(simd, &forces, at);
            }
            let per_mass = Lanes::load(simd, per_mass, at);
            let old = Vectors::load(simd, &v, at);
            let new = force.mul_add(kick * per_mass, old.scale(keep));
            new.store(&mut v, at);
            new.mul_add(step, x).store(&mut next, at);
            let twice = old + new;
            energy = (twice.dot(twice)).mul_add(Lanes::load(simd, mass, at), energy);
            at += S::F64_LANES;
        }
        energy
    }

    /// Angular momenta and rotations.
    #[inline(always)]
    fn rotate<S: Simd, const NORMALISE: bool>(
        &mut self,
        simd: S,
        range: (usize, usize),
    ) -> Lanes<S> {
        let (start, nodes) = range;
        let own = |array| slice(array, (0, nodes));
        let blocks = self.material;
        let material = &blocks[start / BLOCK];
        let (per_inertia, per_spin) = (own(&material.per_inertia), own(&material.per_spin));
        let left = cut(&self.block.left, (WIDTH, nodes));
        let right = cut(&self.block.right, (WIDTH - 1, nodes));
        let Motion { q, p, .. } = &mut *self.motion;
        let [i, j, k, l] = q;
        let q = [
            slice_mut(i, range),
            slice_mut(j, range),
            slice_mut(k, range),
            slice_mut(l, range),
        ];
        let mut p = cut_mut(p, range);
        let keep = Lanes::splat(simd, self.keep);
        let half_kick = Lanes::splat(simd, 0.5 * self.kick);
        let half_step = Lanes::splat(simd, 0.5 * self.drift);
        let one = Lanes::splat(simd, 1.0);
        let (three_halves, half) = (Lanes::splat(simd, 1.5), Lanes::splat(simd, 0.5));
        let mut energy = Lanes::splat(simd, 0.0);
        let mut at = 0;
        while at + S::F64_LANES <= nodes {
            let moment = Vectors::load(simd, &left, at) + Vectors::load(simd, &right, at);
            let before = Vectors::load(simd, &p, at);
            let after = moment.mul_add(half_kick, before.scale(keep));
            after.store(&mut p, at);
            let (r, w) = quaternion(simd, &q, at);
            let (y, z) = (r.y + r.y, r.z + r.z);
            let d1 = Vectors::new(
                r.y.neg_mul_add(y, r.z.neg_mul_add(z, one)),
                r.x.mul_add(y, w * z),
                w.neg_mul_add(y, r.x * z),
            );
            let per_inertia = Lanes::load(simd, per_inertia, at);
            let per_spin = Lanes::load(simd, per_spin, at);
            let twice = before + after;
            let spin = d1.dot(twice);
            energy = (twice.dot(twice)).mul_add(per_inertia, energy);
            energy = (spin * spin).mul_add(per_spin, energy);

            // Half angle about the body's own axis d1.
            let b = d1.dot(after) * (half_step * per_spin);
            let squared = b * b;
            let (mut c, mut s) = (squared.polynomial(&COS), b * squared.polynomial(&SINC));
            if NORMALISE {
                // Newton's iteration for the length, which is nearly one.
                let scale = half.neg_mul_add(r.dot(r) + w * w, three_halves);
                (c, s) = (c * scale, s * scale);
            }
            // q <- q (s, 0, 0, c)
            let spun = Vectors::new(
                r.x.mul_add(c, w * s),
                r.y.mul_add(c, r.z * s),
                r.y.neg_mul_add(s, r.z * c),
            );
            let spun_w = r.x.neg_mul_add(s, w * c);
            // Half angle about the angular momentum.
            let a = after.scale(half_step * per_inertia);
            let squared = a.dot(a);
            let (c, s) = (squared.polynomial(&COS), squared.polynomial(&SINC));
            let a = a.scale(s);
            // q <- (a, c) q
            let turned = a.mul_add(spun_w, spun.scale(c)) + a.cross(spun);
            turned.x.store(q[0], at);
            turned.y.store(q[1], at);
            turned.z.store(q[2], at);
            (spun_w * c - a.dot(spun)).store(q[3], at);
            at += S::F64_LANES;
        }
        energy
    }
}
