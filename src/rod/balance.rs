//! The equilibrium equations along rods, as functions of sigma = s/L:
//!
//! x' = L R v,   q' = L/2 (R u) q,   n' = -f,   m' = n x x'          eqs (1) (2)
//!
//! with v = v0 + c R^T n and u = u0 + R^T m / A by eqs (5) and (6), n and m along the
//! lab axes and f the force that acts per unit of sigma; and the potential energy of
//! everything up to sigma,
//!
//! E' = L/2 (n.c n + m.m/A) + that of the loads.

use super::section::Sections;
use crate::lanes::{Four, Lanes, Vectors};
use crate::rotation::{Quaternions, directors};
use pulp::Simd;

/// Numbers that describe a rod at one sigma.
pub const FIELDS: usize = 14;

/// What describes the rods of a group at one sigma: positions, quaternions, forces and
/// moments along the lab axes, energies.
pub type GroupFields = [Four; FIELDS];

/// The same of several rods.
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

impl<S: Simd> Fields<S> {
    /// Those of the lanes from `part` on.
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

    /// Their slopes where a force acts, with its potential, `sections` being as long as the
    /// rods.
    #[inline(always)]
    pub fn slopes(
        &self,
        sections: &Sections<S>,
        (force, potential): (Vectors<S>, Lanes<S>),
    ) -> Self {
        let (q, w) = self.q;
        let [half, two] = [0.5, 2.0].map(|number| Lanes::splat(w.simd, number));
        let frame = directors(self.q, two / w.times(w, q.dot(q)));
        let (n, m) = (self.n.onto(frame), self.m.onto(frame));
        let (strain, bend) = (sections.compliance * n, m.over(sections.couple_stiffness));
        let (v, u) = (
            sections.rest_strain + strain,
            sections.rest_curvature + bend,
        );
        let tangent = v.along(frame).scale(sections.ds);
        let turn = u.along(frame).scale(sections.ds * half);
        Fields {
            x: tangent,
            q: (turn.scale(w) + turn.cross(q), -turn.dot(q)),
            n: -force,
            m: self.n.cross(tangent),
            energy: half * sections.ds * (n.dot(strain) + m.dot(bend)) + potential,
        }
    }
}
