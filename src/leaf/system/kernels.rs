//! The vectors of the conjugate gradients.

use super::Group;
use crate::lanes::{Four, GROUP, Kernel, Lanes};
use crate::leaf::chain::Increments;
use pulp::Simd;

/// The operands of E p.
#[derive(Clone, Copy)]
pub struct Coupled<'a> {
    /// The p of all groups, and the index of this group.
    pub p: &'a [Vec<Increments>],
    pub group: usize,
    pub weights: &'a [f64],
}

impl Coupled<'_> {
    /// Component `c` of the displacement part of E p at node `i`.
    #[inline(always)]
    fn pull<S: Simd>(
        self,
        simd: S,
        i: usize,
        c: usize,
        coupling: &[[Four; 3]; 2],
        part: usize,
    ) -> Lanes<S> {
        let at = |group: usize, lane: usize| match self.p.get(group) {
            Some(p) => p[i][3 + c].0[lane],
            None => 0.0,
        };
        let own = self.p[self.group][i][3 + c].0;
        let first = at(self.group.wrapping_sub(1), GROUP - 1);
        let last = at(self.group + 1, 0);
        let previous = Four([first, own[0], own[1], own[2]]);
        let next = Four([own[1], own[2], own[3], last]);
        let pull = Lanes::of(simd, &coupling[0][c], part) * Lanes::of(simd, &previous, part);
        let next = Lanes::of(simd, &next, part);
        let pull = next.mul_add(Lanes::of(simd, &coupling[1][c], part), pull);
        Lanes::splat(simd, -self.weights[i]) * pull
    }

    /// Component `c` of (B + E) p at node `i` of its group.
    #[inline(always)]
    fn product<S: Simd>(self, simd: S, of: &Group, i: usize, c: usize, part: usize) -> Lanes<S> {
        let b_p = Lanes::of(simd, &of.b_p[i][c], part);
        match c.checked_sub(3) {
            Some(c) => b_p + self.pull(simd, i, c, &of.coupling, part),
            None => b_p,
        }
    }
}

/// p . (B + E) p.
pub struct Product<'a> {
    pub group: &'a Group,
    pub coupled: Coupled<'a>,
    pub product: Four,
}

impl Kernel for Product<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let mut sum = Lanes::splat(simd, 0.0);
        let p = &self.coupled.p[self.coupled.group];
        for (i, p) in p.iter().enumerate() {
            for c in 0..6 {
                let k_p = self.coupled.product(simd, self.group, i, c, part);
                sum = k_p.mul_add(Lanes::of(simd, &p[c], part), sum);
            }
        }
        sum.put(&mut self.product, part);
    }
}

/// solution += alpha p, residual -= alpha (B + E) p.
pub struct Advance<'a> {
    pub group: &'a mut Group,
    pub coupled: Coupled<'a>,
    pub alpha: f64,
}

impl Kernel for Advance<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let alpha = Lanes::splat(simd, self.alpha);
        let p = &self.coupled.p[self.coupled.group];
        for i in 0..p.len() {
            for c in 0..6 {
                let k_p = self.coupled.product(simd, self.group, i, c, part);
                let solution = &mut self.group.solution[i][c];
                let residual = &mut self.group.residual[i][c];
                let p = Lanes::of(simd, &p[i][c], part);
                p.mul_add(alpha, Lanes::of(simd, solution, part))
                    .put(solution, part);
                k_p.neg_mul_add(alpha, Lanes::of(simd, residual, part))
                    .put(residual, part);
            }
        }
    }
}

/// p = z + beta p, B p = residual + beta B p.
pub struct Direction<'a> {
    pub group: &'a mut Group,
    pub p: &'a mut [Increments],
    pub beta: f64,
}

impl Kernel for Direction<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let beta = Lanes::splat(simd, self.beta);
        let Group {
            z, residual, b_p, ..
        } = &mut *self.group;
        for i in 0..z.len() {
            for c in 0..6 {
                for (old, new) in [
                    (&mut self.p[i][c], &z[i][c]),
                    (&mut b_p[i][c], &residual[i][c]),
                ] {
                    let new = Lanes::of(simd, new, part);
                    Lanes::of(simd, old, part).mul_add(beta, new).put(old, part);
                }
            }
        }
    }
}
