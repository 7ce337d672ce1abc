//! The matrices of a group of rods, one rod in each lane: every rod's block-tridiagonal matrix
//! (chain), its factorisation, base to tip, and its triangular solves. Linear in the number of
//! nodes.
//!
//! The unknowns of a node are (theta, dx). The last node's dx is either the rod's own, or belongs
//! to the joint tip: then it is not eliminated, and its Schur complement is the rod's contribution
//! to the tip's 3 x 3 matrix.

mod kernels;

use self::kernels::{Backward, Factorize, Forward};
use super::state::Increment;
use crate::lanes::{Four, GROUP, Lanes, run};
use crate::rod::{self, UNKNOWNS};
use glam::DVec3;
use pulp::{Arch, Simd};

/// Increments of a node, or the forces dual to them, of all rods of a group.
pub type Increments = [Four; 6];

/// The increments of the rod in a lane.
pub fn of_lane(increments: &Increments, lane: usize) -> Increment {
    increments.map(|four| four.0[lane])
}

/// Writes the increments of the rod in a lane.
pub fn set_lane(increments: &mut Increments, lane: usize, of_rod: &Increment) {
    for (four, value) in increments.iter_mut().zip(of_rod) {
        four.0[lane] = *value;
    }
}

/// A block of a chain, rows first.
pub type ChainBlock = [[f64; UNKNOWNS]; UNKNOWNS];

/// Number of rotations among the unknowns of a node; they come first.
pub const TURNS: usize = 3;

/// Entries of the upper triangle of a block.
const TRIANGLE: usize = UNKNOWNS * (UNKNOWNS + 1) / 2;

/// The entries of a node: the triangle of its own block, then the block (i, i + 1), both rows first.
type Entries = [Four; ENTRIES];
const ENTRIES: usize = TRIANGLE + UNKNOWNS * UNKNOWNS;

/// Position of the entry (r, c) of a triangle, r <= c.
const fn upper(r: usize, c: usize) -> usize {
    r * (2 * UNKNOWNS - r - 1) / 2 + c
}

/// Position of the entry (r, c) of a block (i, i + 1).
const fn off(r: usize, c: usize) -> usize {
    TRIANGLE + r * UNKNOWNS + c
}

/// The 3 x 3 matrix of a tip, rows first.
pub type Tip = [[f64; 3]; 3];

/// The matrices of a group of rods, nodes from the first with equations on (from 0), without the
/// coupling to others, and their factorisations.
#[derive(Clone, Debug)]
pub struct Chain {
    /// Entries of all nodes.
    matrix: Vec<Entries>,
    /// L D L^T, with unit lower L: of every node L^T of its own block above the
    /// diagonal and 1/d on it, then L^-1 times the block (i, i + 1).
    factor: Vec<Entries>,
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

impl Chain {
    /// Identity matrices, for rods with `nodes` nodes that have equations.
    pub fn new(nodes: usize, joined: bool) -> Self {
        let zeros = [Four::default(); ENTRIES];
        let mut identity = zeros;
        for k in 0..UNKNOWNS {
            identity[upper(k, k)] = Four::splat(1.0);
        }
        Chain {
            matrix: vec![identity; nodes],
            factor: vec![zeros; nodes],
            last: if joined { TURNS } else { UNKNOWNS },
        }
    }

    fn nodes(&self) -> usize {
        self.matrix.len()
    }

    /// Writes the upper triangle of the block of node `i` (from 0), and the block
    /// between it and the next if there is one; identities in lanes without a rod.
    #[inline(always)]
    pub fn put<S: Simd>(
        &mut self,
        i: usize,
        own: &rod::Block<S>,
        next: Option<&rod::Block<S>>,
        active: Lanes<S>,
        part: usize,
    ) {
        let node = &mut self.matrix[i];
        let zero = Lanes::splat(active.simd, 0.0);
        let one = Lanes::splat(active.simd, 1.0);
        for r in 0..UNKNOWNS {
            let own_r = own[r][r].where_positive(active, one);
            own_r.put(&mut node[upper(r, r)], part);
            for c in r + 1..UNKNOWNS {
                let own = own[r][c].where_positive(active, zero);
                own.put(&mut node[upper(r, c)], part);
            }
            if let Some(next) = next {
                for c in 0..UNKNOWNS {
                    let next = next[r][c].where_positive(active, zero);
                    next.put(&mut node[off(r, c)], part);
                }
            }
        }
    }

    /// Entry (r, c) of the block of node `i` (from 0), r <= c.
    pub fn diagonal(&mut self, i: usize, r: usize, c: usize) -> &mut Four {
        &mut self.matrix[i][upper(r, c)]
    }

    /// Entry (r, c) of the block between nodes `i` (from 0) and `i` + 1.
    pub fn off(&mut self, i: usize, r: usize, c: usize) -> &mut Four {
        &mut self.matrix[i][off(r, c)]
    }

    /// The block of node `i` (from 0) of the rod in a lane, its upper triangle, and
    /// the one between it and the next.
    pub fn blocks(&self, i: usize, lane: usize) -> (ChainBlock, ChainBlock) {
        let node = &self.matrix[i];
        let (mut own, mut next) = ([[0.0; UNKNOWNS]; UNKNOWNS], [[0.0; UNKNOWNS]; UNKNOWNS]);
        for r in 0..UNKNOWNS {
            for c in 0..UNKNOWNS {
                next[r][c] = node[off(r, c)].0[lane];
                if r <= c {
                    own[r][c] = node[upper(r, c)].0[lane];
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
        let node = &self.factor[self.nodes() - 1];
        let entry = |r: usize, c: usize| node[upper(TURNS + r.min(c), TURNS + r.max(c))].0[lane];
        std::array::from_fn(|r| std::array::from_fn(|c| entry(r, c)))
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

    pub fn solve(&self, mut b: DVec3) -> DVec3 {
        let u = &self.0;
        b.y -= u[0][1] * b.x;
        b.z -= u[0][2] * b.x + u[1][2] * b.y;
        let z = b.z * u[2][2];
        let y = b.y * u[1][1] - u[1][2] * z;
        let x = b.x * u[0][0] - u[0][1] * y - u[0][2] * z;
        DVec3::new(x, y, z)
    }
}

/// Group and lane of rod `j`.
pub fn group_and_lane(j: usize) -> (usize, usize) {
    (j / GROUP, j % GROUP)
}

/// The rods of a group, lane by lane; lanes without a rod repeat the last.
#[inline(always)]
pub fn lanes_of(group: usize, rods: usize) -> [usize; GROUP] {
    std::array::from_fn(|lane| (GROUP * group + lane).min(rods - 1))
}
