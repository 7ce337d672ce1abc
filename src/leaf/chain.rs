//! One rod's chain of 6 x 6 blocks: its factorisation, base to tip, and its
//! triangular solves. Linear in the number of nodes.
//!
//! The unknowns of a node are (theta, dx). The last node's dx is either the
//! rod's own, or belongs to the joint tip: then it is left out of the
//! elimination, and its Schur complement is what the rod adds to the tip's
//! 3 x 3 matrix.

use super::state::Increment;

/// A 6 x 6 block, rows first.
pub type Block = [[f64; 6]; 6];

/// The 3 x 3 matrix of a tip, rows first.
pub type Tip = [[f64; 3]; 3];

/// The matrix of one rod, nodes 1 to n, without the coupling to others.
#[derive(Clone, Debug)]
pub struct Chain {
    /// Diagonal blocks; upper triangles count.
    pub diagonal: Vec<Block>,
    /// Block (i, i + 1) for i = 1..n-1.
    pub off: Vec<Block>,
}

/// L D L^T of a chain, with unit lower L. `upper[i]` holds L^T of the node's
/// own block above the diagonal and 1/d on it, `w[i]` = L^-1 off[i].
#[derive(Clone, Debug)]
pub struct Factor {
    upper: Vec<Block>,
    w: Vec<Block>,
    /// Eliminated unknowns of the last node: 3 with a joint tip, else 6.
    last: usize,
}

impl Chain {
    pub fn new(segments: usize) -> Self {
        Chain {
            diagonal: vec![[[0.0; 6]; 6]; segments],
            off: vec![[[0.0; 6]; 6]; segments - 1],
        }
    }
}

impl Factor {
    pub fn new(segments: usize, joined: bool) -> Self {
        let chain = Chain::new(segments);
        Factor {
            upper: chain.diagonal,
            w: chain.off,
            last: if joined { 3 } else { 6 },
        }
    }

    /// Factorises `chain` plus `shift` times the diagonal matrix of the nodal
    /// `mass` (rotary and translational). Returns the rod's contribution to
    /// the joint tip, or `None` at the first pivot that is not positive, or
    /// that is zero if `any_sign` lets negative ones pass.
    pub fn factorize(
        &mut self,
        chain: &Chain,
        shift: f64,
        mass: &[[f64; 2]],
        any_sign: bool,
    ) -> Option<Tip> {
        let n = chain.diagonal.len();
        let mut schur = [[0.0; 6]; 6];
        for i in 0..n {
            let mut block = chain.diagonal[i];
            for k in 0..6 {
                for c in 0..6 {
                    block[k][c] -= schur[k][c];
                }
                block[k][k] += shift * mass[i][k / 3];
            }
            let count = if i + 1 < n { 6 } else { self.last };
            if !eliminate(&mut block, count, any_sign) {
                return None;
            }
            self.upper[i] = block;
            if i + 1 < n {
                let w = &mut self.w[i];
                *w = chain.off[i];
                schur = substitute(&block, w);
            }
        }
        let block = &self.upper[n - 1];
        let mut tip = [[0.0; 3]; 3];
        for r in 0..3 {
            for c in 0..3 {
                tip[r][c] = if r <= c {
                    block[3 + r][3 + c]
                } else {
                    block[3 + c][3 + r]
                };
            }
        }
        Some(tip)
    }

    /// Forward substitution L y = b in place. With a joint tip the last dx
    /// slot then holds what the rod adds to the tip's right-hand side.
    pub fn forward(&self, y: &mut [Increment]) {
        let n = self.upper.len();
        for i in 0..n {
            let mut b = y[i];
            if i > 0 {
                let (w, upper, before) = (&self.w[i - 1], &self.upper[i - 1], &y[i - 1]);
                for k in 0..6 {
                    let t = before[k] * upper[k][k];
                    for c in 0..6 {
                        b[c] -= t * w[k][c];
                    }
                }
            }
            let upper = &self.upper[i];
            let count = if i + 1 < n { 6 } else { self.last };
            for k in 0..count {
                let t = b[k];
                for r in k + 1..6 {
                    b[r] -= upper[k][r] * t;
                }
            }
            y[i] = b;
        }
    }

    /// Backward substitution in place, from the result of [`Factor::forward`];
    /// with a joint tip its displacement must stand in the last dx slot.
    pub fn backward(&self, y: &mut [Increment]) {
        let n = self.upper.len();
        for i in (0..n).rev() {
            let upper = &self.upper[i];
            let mut b = y[i];
            let count = if i + 1 < n { 6 } else { self.last };
            if i + 1 < n {
                let (w, after) = (&self.w[i], &y[i + 1]);
                for k in 0..6 {
                    let row = &w[k];
                    let even = row[0] * after[0] + row[2] * after[2] + row[4] * after[4];
                    let odd = row[1] * after[1] + row[3] * after[3] + row[5] * after[5];
                    b[k] -= even + odd;
                }
            }
            for k in 0..count {
                b[k] *= upper[k][k];
            }
            for k in (0..count).rev() {
                let mut t = b[k];
                for r in k + 1..6 {
                    t -= upper[k][r] * b[r];
                }
                b[k] = t;
            }
            y[i] = b;
        }
    }
}

/// Eliminates the first `count` unknowns of a block: rows above the diagonal
/// become L^T, the diagonal 1/d. False at the first pivot that is not allowed.
#[inline(always)]
fn eliminate(block: &mut Block, count: usize, any_sign: bool) -> bool {
    for k in 0..count {
        let d = block[k][k];
        if d.is_nan() || d == 0.0 || (d < 0.0 && !any_sign) {
            return false;
        }
        let inverse = 1.0 / d;
        let row = block[k];
        for r in k + 1..6 {
            let l = row[r] * inverse;
            for c in 0..6 {
                block[r][c] -= l * row[c];
            }
        }
        for c in k + 1..6 {
            block[k][c] = row[c] * inverse;
        }
        block[k][k] = inverse;
    }
    true
}

/// w <- L^-1 w; returns w^T D^-1 w, full.
#[inline(always)]
fn substitute(upper: &Block, w: &mut Block) -> Block {
    let mut schur = [[0.0; 6]; 6];
    for k in 0..6 {
        let row = w[k];
        for r in k + 1..6 {
            let l = upper[k][r];
            for c in 0..6 {
                w[r][c] -= l * row[c];
            }
        }
        for r in 0..6 {
            let t = row[r] * upper[k][k];
            for c in 0..6 {
                schur[r][c] += t * row[c];
            }
        }
    }
    schur
}

/// Solves a symmetric 3 x 3 system by L D L^T; `None` if not positive definite.
#[derive(Clone, Copy, Debug)]
pub struct TipFactor([[f64; 3]; 3]);

impl TipFactor {
    pub fn new(mut a: Tip) -> Option<Self> {
        for k in 0..3 {
            if a[k][k].is_nan() || a[k][k] <= 0.0 {
                return None;
            }
            let inverse = 1.0 / a[k][k];
            for r in k + 1..3 {
                let l = a[k][r] * inverse;
                for c in r..3 {
                    a[r][c] -= l * a[k][c];
                }
            }
            for c in k + 1..3 {
                a[k][c] *= inverse;
            }
            a[k][k] = inverse;
        }
        Some(TipFactor(a))
    }

    pub fn solve(&self, mut b: [f64; 3]) -> [f64; 3] {
        let u = &self.0;
        b[1] -= u[0][1] * b[0];
        b[2] -= u[0][2] * b[0] + u[1][2] * b[1];
        let z = b[2] * u[2][2];
        let y = b[1] * u[1][1] - u[1][2] * z;
        let x = b[0] * u[0][0] - u[0][1] * y - u[0][2] * z;
        [x, y, z]
    }
}
