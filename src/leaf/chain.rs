//! One rod's chain of blocks: its factorisation, base to tip, and its
//! triangular solves. Linear in the number of nodes.
//!
//! The B unknowns of a node are (theta, dx): 6, or the 3 that move it within
//! the plane z = 0. The last node's dx is either the rod's own, or belongs to
//! the joint tip: then it is left out of the elimination, and its Schur
//! complement is what the rod adds to the tip's 3 x 3 matrix.

use super::state::Increment;

/// A block of a chain, rows first.
pub type Block<const B: usize> = [[f64; B]; B];

/// Unknowns of a node in space.
pub const SPATIAL: usize = 6;

/// Unknowns of a node that stays in the plane z = 0: its turn about z, its
/// shifts along x and y.
pub const PLANAR: usize = 3;

/// How many of the B unknowns of a node are turns; they come first.
pub const fn turns(b: usize) -> usize {
    if b == PLANAR { 1 } else { 3 }
}

/// The component of an [`Increment`] that is the first of B unknowns; the
/// others follow.
pub const fn first(b: usize) -> usize {
    3 - turns(b)
}

/// The 3 x 3 matrix of a tip, rows first.
pub type Tip = Block<3>;

/// The matrix of one rod, nodes 1 to n, without the coupling to others.
#[derive(Clone, Debug)]
pub struct Chain<const B: usize> {
    /// Diagonal blocks; upper triangles count.
    pub diagonal: Vec<Block<B>>,
    /// Block (i, i + 1) for i = 1..n-1.
    pub off: Vec<Block<B>>,
}

/// L D L^T of a chain, with unit lower L. `upper[i]` holds L^T of the node's
/// own block above the diagonal and 1/d on it, `w[i]` = L^-1 off[i].
#[derive(Clone, Debug)]
pub struct Factor<const B: usize> {
    upper: Vec<Block<B>>,
    w: Vec<Block<B>>,
    /// Eliminated unknowns of the last node: with a joint tip its turns alone.
    last: usize,
}

impl<const B: usize> Chain<B> {
    pub fn new(segments: usize) -> Self {
        Chain {
            diagonal: vec![[[0.0; B]; B]; segments],
            off: vec![[[0.0; B]; B]; segments - 1],
        }
    }
}

impl<const B: usize> Factor<B> {
    pub fn new(segments: usize, joined: bool) -> Self {
        let chain = Chain::new(segments);
        Factor {
            upper: chain.diagonal,
            w: chain.off,
            last: if joined { turns(B) } else { B },
        }
    }

    /// Factorises `chain` plus `shift` times the diagonal matrix of the nodal
    /// `mass` (rotary and translational). Returns the rod's contribution to
    /// the joint tip, or `None` at the first pivot that is not positive, or
    /// that is zero if `any_sign` lets negative ones pass.
    pub fn factorize(
        &mut self,
        chain: &Chain<B>,
        shift: f64,
        mass: &[[f64; 2]],
        any_sign: bool,
    ) -> Option<Tip> {
        let n = chain.diagonal.len();
        let mut schur = [[0.0; B]; B];
        for i in 0..n {
            let mut block = chain.diagonal[i];
            for k in 0..B {
                for c in 0..B {
                    block[k][c] -= schur[k][c];
                }
                block[k][k] += shift * mass[i][(first(B) + k) / 3];
            }
            let count = if i + 1 < n { B } else { self.last };
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
        let turns = turns(B);
        // A tip that stays in the plane is held across it by a one.
        let mut tip = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        for r in 0..B - turns {
            for c in 0..B - turns {
                tip[r][c] = block[turns + r.min(c)][turns + r.max(c)];
            }
        }
        Some(tip)
    }

    /// Forward substitution L y = b in place. With a joint tip the last dx
    /// slot then holds what the rod adds to the tip's right-hand side.
    pub fn forward(&self, y: &mut [Increment]) {
        let (n, first) = (self.upper.len(), first(B));
        let mut before = [0.0; B];
        for i in 0..n {
            let mut b: [f64; B] = unknowns(&y[i]);
            if i > 0 {
                let (w, upper) = (&self.w[i - 1], &self.upper[i - 1]);
                for k in 0..B {
                    let t = before[k] * upper[k][k];
                    for c in 0..B {
                        b[c] -= t * w[k][c];
                    }
                }
            }
            let upper = &self.upper[i];
            let count = if i + 1 < n { B } else { self.last };
            for k in 0..count {
                let t = b[k];
                for r in k + 1..B {
                    b[r] -= upper[k][r] * t;
                }
            }
            y[i][first..first + B].copy_from_slice(&b);
            before = b;
        }
    }

    /// Backward substitution in place, from the result of [`Factor::forward`];
    /// with a joint tip its displacement must stand in the last dx slot.
    pub fn backward(&self, y: &mut [Increment]) {
        let (n, first) = (self.upper.len(), first(B));
        let mut after = [0.0; B];
        for i in (0..n).rev() {
            let upper = &self.upper[i];
            let mut b: [f64; B] = unknowns(&y[i]);
            let count = if i + 1 < n { B } else { self.last };
            if i + 1 < n {
                let w = &self.w[i];
                for k in 0..B {
                    // Two sums, neither of which waits for the other.
                    let mut sums = [0.0; 2];
                    for c in 0..B {
                        sums[c % 2] += w[k][c] * after[c];
                    }
                    b[k] -= sums[0] + sums[1];
                }
            }
            for k in 0..count {
                b[k] *= upper[k][k];
            }
            for k in (0..count).rev() {
                let mut t = b[k];
                for r in k + 1..B {
                    t -= upper[k][r] * b[r];
                }
                b[k] = t;
            }
            y[i][first..first + B].copy_from_slice(&b);
            after = b;
        }
    }
}

/// The unknowns among the components of an increment.
#[inline(always)]
fn unknowns<const B: usize>(increment: &Increment) -> [f64; B] {
    std::array::from_fn(|k| increment[first(B) + k])
}

/// Eliminates the first `count` unknowns of a block: rows above the diagonal
/// become L^T, the diagonal 1/d. False at the first pivot that is not allowed.
#[inline(always)]
fn eliminate<const B: usize>(block: &mut Block<B>, count: usize, any_sign: bool) -> bool {
    for k in 0..count {
        let d = block[k][k];
        if d.is_nan() || d == 0.0 || (d < 0.0 && !any_sign) {
            return false;
        }
        let inverse = 1.0 / d;
        let row = block[k];
        for r in k + 1..B {
            let l = row[r] * inverse;
            for c in 0..B {
                block[r][c] -= l * row[c];
            }
        }
        for c in k + 1..B {
            block[k][c] = row[c] * inverse;
        }
        block[k][k] = inverse;
    }
    true
}

/// w <- L^-1 w; returns w^T D^-1 w, full.
#[inline(always)]
fn substitute<const B: usize>(upper: &Block<B>, w: &mut Block<B>) -> Block<B> {
    let mut schur = [[0.0; B]; B];
    for k in 0..B {
        let row = w[k];
        for r in k + 1..B {
            let l = upper[k][r];
            for c in 0..B {
                w[r][c] -= l * row[c];
            }
        }
        for r in 0..B {
            let t = row[r] * upper[k][k];
            for c in 0..B {
                schur[r][c] += t * row[c];
            }
        }
    }
    schur
}

/// The matrix of one rod with its factorisation.
#[derive(Clone, Debug)]
pub enum RodMatrix {
    /// Of a rod in space.
    Spatial(Chain<SPATIAL>, Factor<SPATIAL>),
    /// Of a rod in the plane z = 0.
    Planar(Chain<PLANAR>, Factor<PLANAR>),
}

impl RodMatrix {
    pub fn new(segments: usize, joined: bool, planar: bool) -> Self {
        match planar {
            false => RodMatrix::Spatial(Chain::new(segments), Factor::new(segments, joined)),
            true => RodMatrix::Planar(Chain::new(segments), Factor::new(segments, joined)),
        }
    }

    /// The chain, of a rod in space.
    pub fn spatial(&self) -> &Chain<SPATIAL> {
        match self {
            RodMatrix::Spatial(chain, _) => chain,
            RodMatrix::Planar(..) => unreachable!("a leaf in its plane is only brought to rest"),
        }
    }

    /// The same, to change it.
    pub fn spatial_mut(&mut self) -> &mut Chain<SPATIAL> {
        match self {
            RodMatrix::Spatial(chain, _) => chain,
            RodMatrix::Planar(..) => unreachable!("a leaf in its plane is only brought to rest"),
        }
    }

    /// See [`Factor::factorize`].
    pub fn factorize(&mut self, shift: f64, mass: &[[f64; 2]], any_sign: bool) -> Option<Tip> {
        match self {
            RodMatrix::Spatial(chain, factor) => factor.factorize(chain, shift, mass, any_sign),
            RodMatrix::Planar(chain, factor) => factor.factorize(chain, shift, mass, any_sign),
        }
    }

    /// See [`Factor::forward`].
    pub fn forward(&self, y: &mut [Increment]) {
        match self {
            RodMatrix::Spatial(_, factor) => factor.forward(y),
            RodMatrix::Planar(_, factor) => factor.forward(y),
        }
    }

    /// See [`Factor::backward`].
    pub fn backward(&self, y: &mut [Increment]) {
        match self {
            RodMatrix::Spatial(_, factor) => factor.backward(y),
            RodMatrix::Planar(_, factor) => factor.backward(y),
        }
    }
}

/// Solves a symmetric 3 x 3 system by L D L^T; `None` if not positive definite.
#[derive(Clone, Copy, Debug)]
pub struct TipFactor(Tip);

impl TipFactor {
    pub fn new(mut a: Tip) -> Option<Self> {
        eliminate(&mut a, 3, false).then_some(TipFactor(a))
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
