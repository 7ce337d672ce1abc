//! The matrices of a group of rods, one rod in each lane: every rod's block-tridiagonal matrix
//! (chain), its factorisation, base to tip, and its triangular solves. Linear in the number of
//! nodes.
//!
//! The B unknowns of a node are (theta, dx): 6, or the 3 within the plane z = 0. The last
//! node's dx is either the rod's own, or belongs to the joint tip: then it is not eliminated,
//! and its Schur complement is the rod's contribution to the tip's 3 x 3 matrix.

mod kernels;

use self::kernels::{Backward, Factorize, Forward};
use super::state::Increment;
use crate::lanes::{Four, GROUP, Lanes, run};
use pulp::{Arch, Simd};

/// Increments of a node, or the forces dual to them, of all rods of a group.
pub type Increments = [Four; 6];

/// Those of the rod in a lane.
pub fn of_lane(increments: &Increments, lane: usize) -> Increment {
    increments.map(|four| four.0[lane])
}

/// Writes those of the rod in a lane.
pub fn set_lane(increments: &mut Increments, lane: usize, of_rod: &Increment) {
    for (four, value) in increments.iter_mut().zip(of_rod) {
        four.0[lane] = *value;
    }
}

/// A block of a chain, rows first.
pub type Block<const B: usize> = [[f64; B]; B];

/// Unknowns of a node in space.
pub const SPATIAL: usize = 6;

/// Unknowns of a node that stays in the plane z = 0: its rotation about z, its displacements
/// along x and y.
pub const PLANAR: usize = 3;

/// Number of rotations among the B unknowns of a node; they come first.
pub const fn turns(b: usize) -> usize {
    if b == PLANAR { 1 } else { 3 }
}

/// The component of an [`Increment`] that is the first of B unknowns; the
/// others follow.
pub const fn first(b: usize) -> usize {
    3 - turns(b)
}

/// Entries of the upper triangle of a b x b block, and of a node: the triangle of
/// its own block, then the block (i, i + 1), both rows first.
const fn triangle(b: usize) -> usize {
    b * (b + 1) / 2
}
const fn entries(b: usize) -> usize {
    triangle(b) + b * b
}

/// Position of the entry (r, c) of a triangle, r <= c.
const fn upper(b: usize, r: usize, c: usize) -> usize {
    r * (2 * b - r - 1) / 2 + c
}

/// Position of the entry (r, c) of a block (i, i + 1).
const fn off(b: usize, r: usize, c: usize) -> usize {
    triangle(b) + r * b + c
}

/// The 3 x 3 matrix of a tip, rows first.
pub type Tip = Block<3>;

/// The matrices of a group of rods, nodes 1 to n, without the coupling to others,
/// and their factorisations.
#[derive(Clone, Debug)]
pub struct Chain<const B: usize> {
    /// Entries of all nodes.
    matrix: Vec<Four>,
    /// L D L^T, with unit lower L: of every node L^T of its own block above the
    /// diagonal and 1/d on it, then L^-1 times the block (i, i + 1).
    factor: Vec<Four>,
    segments: usize,
    /// Number of eliminated unknowns of the last node: with a joint tip its rotations alone.
    last: usize,
}

/// The contribution of the masses to a matrix: `shift` times the masses per weight, rotary and
/// translational, times the nodes' weights.
pub struct Masses<'a> {
    pub shift: f64,
    pub per_weight: [Four; 2],
    pub weights: &'a [f64],
}

impl<const B: usize> Chain<B> {
    /// Identity matrices, for rods with `segments` segments.
    pub fn new(segments: usize, joined: bool) -> Self {
        let zeros = vec![Four::default(); segments * entries(B)];
        let mut chain = Chain {
            factor: zeros.clone(),
            matrix: zeros,
            segments,
            last: if joined { turns(B) } else { B },
        };
        for node in chain.matrix.chunks_exact_mut(entries(B)) {
            for k in 0..B {
                node[upper(B, k, k)] = Four::splat(1.0);
            }
        }
        chain
    }

    /// Writes the upper triangle of the block of node `i` (from 0), and the block
    /// between it and the next if there is one; identities in lanes without a rod.
    #[inline(always)]
    pub fn put<S: Simd>(
        &mut self,
        i: usize,
        own: &[[Lanes<S>; B]; B],
        next: Option<&[[Lanes<S>; B]; B]>,
        (active, part): (Lanes<S>, usize),
    ) {
        let node = &mut self.matrix[i * entries(B)..][..entries(B)];
        let zero = Lanes::splat(active.simd, 0.0);
        let one = Lanes::splat(active.simd, 1.0);
        for r in 0..B {
            let own_r = own[r][r].where_positive(active, one);
            own_r.put(&mut node[upper(B, r, r)], part);
            for c in r + 1..B {
                let own = own[r][c].where_positive(active, zero);
                own.put(&mut node[upper(B, r, c)], part);
            }
            if let Some(next) = next {
                for c in 0..B {
                    let next = next[r][c].where_positive(active, zero);
                    next.put(&mut node[off(B, r, c)], part);
                }
            }
        }
    }

    /// Entry (r, c) of the block of node `i` (from 0), r <= c.
    pub fn diagonal(&mut self, i: usize, r: usize, c: usize) -> &mut Four {
        &mut self.matrix[i * entries(B) + upper(B, r, c)]
    }

    /// Entry (r, c) of the block between nodes `i` (from 0) and `i` + 1.
    pub fn off(&mut self, i: usize, r: usize, c: usize) -> &mut Four {
        &mut self.matrix[i * entries(B) + off(B, r, c)]
    }

    /// The block of node `i` (from 0) of the rod in a lane, its upper triangle, and
    /// the one between it and the next.
    pub fn blocks(&self, i: usize, lane: usize) -> (Block<B>, Block<B>) {
        let node = &self.matrix[i * entries(B)..][..entries(B)];
        let (mut own, mut next) = ([[0.0; B]; B], [[0.0; B]; B]);
        for r in 0..B {
            for c in 0..B {
                next[r][c] = node[off(B, r, c)].0[lane];
                if r <= c {
                    own[r][c] = node[upper(B, r, c)].0[lane];
                }
            }
        }
        (own, next)
    }

    /// Factorises the matrices plus `masses`. False if a pivot is not positive or, with
    /// `any_sign`, if one is zero.
    pub fn factorize(&mut self, arch: Arch, masses: &Masses, any_sign: bool) -> bool {
        let mut kernel = Factorize {
            chain: self,
            masses,
            any_sign,
            definite: true,
        };
        run(arch, &mut kernel);
        kernel.definite
    }

    /// The contribution of the rod in a lane to the matrix of the joint tip.
    pub fn tip(&self, lane: usize) -> Tip {
        let node = &self.factor[(self.segments - 1) * entries(B)..];
        // For a tip that stays in the plane, a one on the diagonal fixes its displacement
        // across it.
        let mut tip = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let turns = turns(B);
        for r in 0..B - turns {
            for c in 0..B - turns {
                tip[r][c] = node[upper(B, turns + r.min(c), turns + r.max(c))].0[lane];
            }
        }
        tip
    }

    /// Forward substitution L y = b. With a joint tip the last dx slots of y then hold the
    /// rods' contributions to the tip's right-hand side.
    pub fn forward(&self, arch: Arch, b: &[Increments], y: &mut [Increments]) {
        let chain = self;
        run(arch, &mut Forward { chain, b, y });
    }

    /// Backward substitution in place, from the result of [`Chain::forward`]; with a joint tip
    /// the last dx slots must hold its displacement. Returns b . y.
    pub fn backward(&self, arch: Arch, b: &[Increments], y: &mut [Increments]) -> f64 {
        let mut kernel = Backward {
            chain: self,
            b,
            y,
            product: Four::default(),
        };
        run(arch, &mut kernel);
        kernel.product.sum()
    }
}

/// The matrices of a group of rods with their factorisations.
#[derive(Clone, Debug)]
pub enum GroupMatrix {
    /// Of rods in space.
    Spatial(Chain<SPATIAL>),
    /// Of rods in the plane z = 0.
    Planar(Chain<PLANAR>),
}

impl GroupMatrix {
    pub fn new(segments: usize, joined: bool, planar: bool) -> Self {
        match planar {
            false => GroupMatrix::Spatial(Chain::new(segments, joined)),
            true => GroupMatrix::Planar(Chain::new(segments, joined)),
        }
    }

    /// The chain, of rods in space.
    pub fn spatial(&self) -> &Chain<SPATIAL> {
        match self {
            GroupMatrix::Spatial(chain) => chain,
            GroupMatrix::Planar(_) => unreachable!("a leaf in its plane is only brought to rest"),
        }
    }

    /// The same, mutably.
    pub fn spatial_mut(&mut self) -> &mut Chain<SPATIAL> {
        match self {
            GroupMatrix::Spatial(chain) => chain,
            GroupMatrix::Planar(_) => unreachable!("a leaf in its plane is only brought to rest"),
        }
    }

    /// See [`Chain::factorize`].
    pub fn factorize(&mut self, arch: Arch, masses: &Masses, any_sign: bool) -> bool {
        match self {
            GroupMatrix::Spatial(chain) => chain.factorize(arch, masses, any_sign),
            GroupMatrix::Planar(chain) => chain.factorize(arch, masses, any_sign),
        }
    }

    /// See [`Chain::tip`].
    pub fn tip(&self, lane: usize) -> Tip {
        match self {
            GroupMatrix::Spatial(chain) => chain.tip(lane),
            GroupMatrix::Planar(chain) => chain.tip(lane),
        }
    }

    /// See [`Chain::forward`].
    pub fn forward(&self, arch: Arch, b: &[Increments], y: &mut [Increments]) {
        match self {
            GroupMatrix::Spatial(chain) => chain.forward(arch, b, y),
            GroupMatrix::Planar(chain) => chain.forward(arch, b, y),
        }
    }

    /// See [`Chain::backward`].
    pub fn backward(&self, arch: Arch, b: &[Increments], y: &mut [Increments]) -> f64 {
        match self {
            GroupMatrix::Spatial(chain) => chain.backward(arch, b, y),
            GroupMatrix::Planar(chain) => chain.backward(arch, b, y),
        }
    }
}

/// Solves a symmetric 3 x 3 system by L D L^T; `None` if not positive definite.
#[derive(Clone, Copy, Debug)]
pub struct TipFactor(Tip);

impl TipFactor {
    pub fn new(mut a: Tip) -> Option<Self> {
        for k in 0..3 {
            if a[k][k].is_nan() || a[k][k] <= 0.0 {
                return None;
            }
            let (row, inverse) = (a[k], 1.0 / a[k][k]);
            for r in k + 1..3 {
                for c in r..3 {
                    a[r][c] -= row[r] * inverse * row[c];
                }
                a[k][r] = row[r] * inverse;
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

/// Group and lane of rod `j`.
pub fn group_and_lane(j: usize) -> (usize, usize) {
    (j / GROUP, j % GROUP)
}
