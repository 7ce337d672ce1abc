//! The loops along the rods of a group.

use super::{Chain, Increments, Masses, entries, first, off, upper};
use crate::lanes::{Four, Kernel, Lanes};
use pulp::Simd;

/// See [`Chain::factorize`].
pub struct Factorize<'a, const B: usize> {
    pub chain: &'a mut Chain<B>,
    pub masses: &'a Masses<'a>,
    pub any_sign: bool,
    pub definite: bool,
}

impl<const B: usize> Kernel for Factorize<'_, B> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let size = entries(B);
        let (zero, one) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 1.0));
        let shift = Lanes::splat(simd, self.masses.shift);
        let mut masses = [zero; 2];
        for k in 0..2 {
            masses[k] = shift * Lanes::of(simd, &self.masses.per_weight[k], part);
        }
        let n = self.chain.segments;
        let mut schur = [[zero; B]; B];
        for i in 0..n {
            let node = &self.chain.matrix[i * size..][..size];
            let factor = &mut self.chain.factor[i * size..][..size];
            let weight = Lanes::splat(simd, self.masses.weights[i]);
            let mut a = [[zero; B]; B];
            for r in 0..B {
                for c in r..B {
                    a[r][c] = Lanes::of(simd, &node[upper(B, r, c)], part) - schur[r][c];
                }
            }
            for k in 0..B {
                a[k][k] = masses[(first(B) + k) / 3].times(weight, a[k][k]);
            }
            // Rows above the diagonal become L^T, the diagonal 1/d.
            let count = if i + 1 < n { B } else { self.chain.last };
            let mut definite = one;
            for k in 0..B {
                if k < count {
                    let (row, d) = (a[k], a[k][k]);
                    let test = if self.any_sign { d * d } else { d };
                    definite = definite.where_positive(test, zero);
                    let inverse = d.recip();
                    for r in k + 1..B {
                        let l = row[r] * inverse;
                        for c in r..B {
                            a[r][c] = l.times_from(row[c], a[r][c]);
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
            for r in 0..B {
                for c in r..B {
                    a[r][c].put(&mut factor[upper(B, r, c)], part);
                }
            }
            if i + 1 < n {
                schur = substitute(simd, &a, (node, factor), part);
            }
        }
    }
}

/// Writes w = L^-1 times the block (i, i + 1); returns the upper triangle of
/// w^T D^-1 w.
#[inline(always)]
fn substitute<S: Simd, const B: usize>(
    simd: S,
    a: &[[Lanes<S>; B]; B],
    (node, factor): (&[Four], &mut [Four]),
    part: usize,
) -> [[Lanes<S>; B]; B] {
    let zero = Lanes::splat(simd, 0.0);
    let (mut w, mut schur) = ([[zero; B]; B], [[zero; B]; B]);
    for r in 0..B {
        for c in 0..B {
            w[r][c] = Lanes::of(simd, &node[off(B, r, c)], part);
        }
    }
    for k in 0..B {
        let row = w[k];
        for r in k + 1..B {
            for c in 0..B {
                w[r][c] = a[k][r].times_from(row[c], w[r][c]);
            }
        }
        for c in 0..B {
            row[c].put(&mut factor[off(B, k, c)], part);
        }
    }
    for k in 0..B {
        for r in 0..B {
            let t = w[k][r] * a[k][k];
            for c in r..B {
                schur[r][c] = t.times(w[k][c], schur[r][c]);
            }
        }
    }
    schur
}

/// See [`Chain::forward`].
pub struct Forward<'a, const B: usize> {
    pub chain: &'a Chain<B>,
    pub b: &'a [Increments],
    pub y: &'a mut [Increments],
}

impl<const B: usize> Kernel for Forward<'_, B> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let (size, n) = (entries(B), self.chain.segments);
        let mut y = [Lanes::splat(simd, 0.0); B];
        let mut before = y;
        for i in 0..n {
            for k in 0..B {
                y[k] = Lanes::of(simd, &self.b[i][first(B) + k], part);
            }
            if i > 0 {
                let w = &self.chain.factor[(i - 1) * size..][..size];
                for k in 0..B {
                    for c in 0..B {
                        let w = Lanes::of(simd, &w[off(B, k, c)], part);
                        y[c] = before[k].times_from(w, y[c]);
                    }
                }
            }
            let own = &self.chain.factor[i * size..][..size];
            let count = if i + 1 < n { B } else { self.chain.last };
            for k in 0..B {
                if k < count {
                    for r in k + 1..B {
                        let l = Lanes::of(simd, &own[upper(B, k, r)], part);
                        y[r] = y[k].times_from(l, y[r]);
                    }
                }
            }
            for k in 0..B {
                y[k].put(&mut self.y[i][first(B) + k], part);
                before[k] = y[k] * Lanes::of(simd, &own[upper(B, k, k)], part);
            }
        }
    }
}

/// See [`Chain::backward`].
pub struct Backward<'a, const B: usize> {
    pub chain: &'a Chain<B>,
    pub b: &'a [Increments],
    pub y: &'a mut [Increments],
    pub product: Four,
}

impl<const B: usize> Kernel for Backward<'_, B> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let (size, n) = (entries(B), self.chain.segments);
        let mut y = [Lanes::splat(simd, 0.0); B];
        let (mut after, mut product) = (y, y[0]);
        for i in (0..n).rev() {
            let own = &self.chain.factor[i * size..][..size];
            for k in 0..B {
                y[k] = Lanes::of(simd, &self.y[i][first(B) + k], part);
            }
            if i + 1 < n {
                for k in 0..B {
                    for c in 0..B {
                        let w = Lanes::of(simd, &own[off(B, k, c)], part);
                        y[k] = after[c].times_from(w, y[k]);
                    }
                }
            }
            let count = if i + 1 < n { B } else { self.chain.last };
            for k in (0..B).rev() {
                if k < count {
                    y[k] = y[k] * Lanes::of(simd, &own[upper(B, k, k)], part);
                    for r in k + 1..B {
                        let l = Lanes::of(simd, &own[upper(B, k, r)], part);
                        y[k] = y[r].times_from(l, y[k]);
                    }
                }
            }
            for k in 0..B {
                let b = Lanes::of(simd, &self.b[i][first(B) + k], part);
                product = b.times(y[k], product);
                y[k].put(&mut self.y[i][first(B) + k], part);
            }
            after = y;
        }
        product.put(&mut self.product, part);
    }
}
