//! The equilibrium equations along rods, as functions of sigma = s/L:
//!
//! x' = L R v,   q' = L/2 (R u) q,   n' = -f,   m' = n x x'          eqs (1) (2)
//!
//! with v = v0 + c R^T n and u = u0 + R^T m / A by eqs (5) and (6), n and m along the lab axes
//! and f the force per unit of sigma; and the potential energy up to sigma,
//!
//! E' = L/2 (n.c n + m.m/A) + potential of the loads.

use super::section::Section;
use crate::lanes::{Four, GROUP, Lanes, Vectors};
use crate::rotation::{Quaternions, directors};
use pulp::Simd;

/// Number of fields of a rod at one sigma.
pub const FIELDS: usize = 14;

/// The fields of the rods of a group at one sigma: positions, quaternions, forces and moments
/// along the lab axes, energies.
pub type GroupFields = [Four; FIELDS];

/// The fields of several rods at one sigma, as vectors.
#[derive(Clone, Copy)]
pub struct Fields<S: Simd> {
    /// Positions.
    pub x: Vectors<S>,
    /// Rotations; quaternions of any length.
    pub q: Quaternions<S>,
    /// Forces.
    pub n: Vectors<S>,
    /// Moments.
    pub m: Vectors<S>,
    /// Energies.
    pub energy: Lanes<S>,
}

/// The coefficients of the equations for a group of rods: lengths, v0, u0, c, 1/A.
pub type GroupLaws = [Four; 13];

/// The coefficients from sections whose `ds` is the length of the rod.
pub fn laws(sections: [&Section; GROUP]) -> GroupLaws {
    let number = |k: usize| {
        let of = |section: &Section| match k {
            0 => section.ds,
            1..4 => section.rest_strain[k - 1],
            4..7 => section.rest_curvature[k - 4],
            7..10 => section.compliance[k - 7],
            _ => 1.0 / section.couple_stiffness[k - 10],
        };
        Four(sections.map(of))
    };
    std::array::from_fn(number)
}

impl<S: Simd> Fields<S> {
    /// The fields of the lanes from `part` on.
    #[inline(always)]
    pub fn of(simd: S, group: &GroupFields, part: usize) -> Self {
        let number = |k: usize| Lanes::of(simd, &group[k], part);
        let vector = |k: usize| Vectors::new(number(k), number(k + 1), number(k + 2));
        Fields {
            x: vector(0),
            q: (vector(3), number(6)),
            n: vector(7),
            m: vector(10),
            energy: number(13),
        }
    }

    /// Writes them.
    #[inline(always)]
    pub fn put(self, group: &mut GroupFields, part: usize) {
        for (first, vector) in [(0, self.x), (3, self.q.0), (7, self.n), (10, self.m)] {
            for (k, component) in vector.array().into_iter().enumerate() {
                component.put(&mut group[first + k], part);
            }
        }
        self.q.1.put(&mut group[6], part);
        self.energy.put(&mut group[13], part);
    }

    /// Their derivatives with respect to sigma under a force with its potential, of the lanes
    /// from `part` on.
    #[inline(always)]
    pub fn slopes(
        &self,
        laws: &GroupLaws,
        (force, potential): (Vectors<S>, Lanes<S>),
        part: usize,
    ) -> Self {
        let (q, w) = self.q;
        let law = |k: usize| Lanes::of(w.simd, &laws[k], part);
        let laws = |k: usize| Vectors::new(law(k), law(k + 1), law(k + 2));
        let [half, two] = [0.5, 2.0].map(|number| Lanes::splat(w.simd, number));
        let frame = directors(self.q, two / w.mul_add(w, q.dot(q)));
        let (n, m) = (self.n.onto(frame), self.m.onto(frame));
        let (length, strain, bend) = (law(0), laws(7) * n, laws(10) * m);
        let (v, u) = (laws(1) + strain, laws(4) + bend);
        let tangent = v.along(frame).scale(length);
        let turn = u.along(frame).scale(length * half);
        Fields {
            x: tangent,
            q: (turn.scale(w) + turn.cross(q), -turn.dot(q)),
            n: -force,
            m: self.n.cross(tangent),
            energy: half * length * (n.dot(strain) + m.dot(bend)) + potential,
        }
    }
}
