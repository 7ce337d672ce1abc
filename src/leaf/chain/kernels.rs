//! The loops along the rods of a group.

use super::{Chain, Entries, Increments, Masses, TURNS, off, upper};
use crate::lanes::{Four, Kernel, Lanes};
use crate::rod::{Block, UNKNOWNS};
use pulp::Simd;

/// See [`Chain::factorize`].
pub struct Factorize<'a> {
    pub chain: &'a mut Chain,
    pub masses: &'a Masses<'a>,
    pub any_sign: bool,
    pub definite: bool,
}

impl Kernel for Factorize<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let (zero, one) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 1.0));
        let shift = Lanes::splat(simd, self.masses.shift);
        let mut masses = [zero; 2];
        for k in 0..2 {
            masses[k] = shift * Lanes::of(simd, &self.masses.per_weight[k], part);
        }
        let n = self.chain.nodes();
        let mut schur = [[zero; UNKNOWNS]; UNKNOWNS];
        for i in 0..n {
            let node = &self.chain.matrix[i];
            let factor = &mut self.chain.factor[i];
            let weight = Lanes::splat(simd, self.masses.weights[i]);
            let mut a = [[zero; UNKNOWNS]; UNKNOWNS];
            for r in 0..UNKNOWNS {
                for c in r..UNKNOWNS {
                    a[r][c] = Lanes::of(simd, &node[upper(r, c)], part) - schur[r][c];
                }
            }
            for k in 0..UNKNOWNS {
                a[k][k] = masses[k / TURNS].mul_add(weight, a[k][k]);
            }
            // Rows above the diagonal become L^T, the diagonal 1/d.
            let count = if i + 1 < n { UNKNOWNS } else { self.chain.last };
            let mut definite = one;
            for k in 0..UNKNOWNS {
                if k < count {
                    let (row, d) = (a[k], a[k][k]);
                    let test = if self.any_sign { d * d } else { d };
                    definite = definite.where_positive(test, zero);
                    let inverse = d.recip();
                    for r in k + 1..UNKNOWNS {
                        let l = row[r] * inverse;
                        for c in r..UNKNOWNS {
                            a[r][c] = l.neg_mul_add(row[c], a[r][c]);
                        }
                        a[k][r] = l;
                    }
                    a[k][k] = inverse;
                }
            }
            if definite.smallest() != 1.0 {
                self.definite = false;
                return;
            }
            for r in 0..UNKNOWNS {
                for c in r..UNKNOWNS {
                    a[r][c].put(&mut factor[upper(r, c)], part);
                }
            }
            if i + 1 < n {
                schur = substitute(simd, &a, node, factor, part);
            }
        }
    }
}

/// Writes w = L^-1 times the block (i, i + 1); returns the upper triangle of
/// w^T D^-1 w.
#[inline(always)]
fn substitute<S: Simd>(
    simd: S,
    a: &Block<S>,
    node: &Entries,
    factor: &mut Entries,
    part: usize,
) -> Block<S> {
    let zero = Lanes::splat(simd, 0.0);
    let (mut w, mut schur) = ([[zero; UNKNOWNS]; UNKNOWNS], [[zero; UNKNOWNS]; UNKNOWNS]);
    for r in 0..UNKNOWNS {
        for c in 0..UNKNOWNS {
            w[r][c] = Lanes::of(simd, &node[off(r, c)], part);
        }
    }
    for k in 0..UNKNOWNS {
        let row = w[k];
        for r in k + 1..UNKNOWNS {
            for c in 0..UNKNOWNS {
                w[r][c] = a[k][r].neg_mul_add(row[c], w[r][c]);
            }
        }
        for c in 0..UNKNOWNS {
            row[c].put(&mut factor[off(k, c)], part);
        }
    }
    for k in 0..UNKNOWNS {
        for r in 0..UNKNOWNS {
            let t = w[k][r] * a[k][k];
            for c in r..UNKNOWNS {
                schur[r][c] = t.mul_add(w[k][c], schur[r][c]);
            }
        }
    }
    schur
}

/// See [`Chain::forward`].
pub struct Forward<'a> {
    pub chain: &'a Chain,
    pub b: &'a [Increments],
    pub y: &'a mut [Increments],
}

impl Kernel for Forward<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let n = self.chain.nodes();
        let mut y = [Lanes::splat(simd, 0.0); UNKNOWNS];
        let mut before = y;
        for i in 0..n {
            for k in 0..UNKNOWNS {
                y[k] = Lanes::of(simd, &self.b[i][k], part);
            }
            if i > 0 {
                let w = &self.chain.factor[i - 1];
                for k in 0..UNKNOWNS {
                    for c in 0..UNKNOWNS {
                        let w = Lanes::of(simd, &w[off(k, c)], part);
                        y[c] = before[k].neg_mul_add(w, y[c]);
                    }
                }
            }
            let own = &self.chain.factor[i];
            let count = if i + 1 < n { UNKNOWNS } else { self.chain.last };
            for k in 0..UNKNOWNS {
                if k < count {
                    for r in k + 1..UNKNOWNS {
                        let l = Lanes::of(simd, &own[upper(k, r)], part);
                        y[r] = y[k].neg_mul_add(l, y[r]);
                    }
                }
            }
            for k in 0..UNKNOWNS {
                y[k].put(&mut self.y[i][k], part);
                before[k] = y[k] * Lanes::of(simd, &own[upper(k, k)], part);
            }
        }
    }
}

/// See [`Chain::backward`].
pub struct Backward<'a> {
    pub chain: &'a Chain,
    pub b: &'a [Increments],
    pub y: &'a mut [Increments],
    pub product: Four,
}

impl Kernel for Backward<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let n = self.chain.nodes();
        let mut y = [Lanes::splat(simd, 0.0); UNKNOWNS];
        let (mut after, mut product) = (y, y[0]);
        for i in (0..n).rev() {
            let own = &self.chain.factor[i];
            for k in 0..UNKNOWNS {
                y[k] = Lanes::of(simd, &self.y[i][k], part);
            }
            if i + 1 < n {
                for k in 0..UNKNOWNS {
                    for c in 0..UNKNOWNS {
                        let w = Lanes::of(simd, &own[off(k, c)], part);
                        y[k] = after[c].neg_mul_add(w, y[k]);
                    }
                }
            }
            let count = if i + 1 < n { UNKNOWNS } else { self.chain.last };
            for k in (0..UNKNOWNS).rev() {
                if k < count {
                    y[k] = y[k] * Lanes::of(simd, &own[upper(k, k)], part);
                    for r in k + 1..UNKNOWNS {
                        let l = Lanes::of(simd, &own[upper(k, r)], part);
                        y[k] = y[r].neg_mul_add(l, y[k]);
                    }
                }
            }
            for k in 0..UNKNOWNS {
                let b = Lanes::of(simd, &self.b[i][k], part);
                product = b.mul_add(y[k], product);
                y[k].put(&mut self.y[i][k], part);
            }
            after = y;
        }
        product.put(&mut self.product, part);
    }
}
