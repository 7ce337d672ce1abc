//! The block-tridiagonal matrices of a group of rods, one rod in each lane: their factorization, base
//! to tip, and their triangular solves. Linear in the number of nodes.
//!
//! The unknowns of a node are (theta, dx), rotation and displacement. The last node's dx is either the
//! rod's own or that of the joint tip: then it is not eliminated, and its Schur complement is the rod's
//! contribution to the tip's 3 x 3 matrix.

use crate::leaf::state::Increment;
use crate::rod::{LaneBlock, NodeBlock, UNKNOWNS};
use crate::simd::{GROUP, GroupKernel, Lanes, NumberGroup, run};
use glam::DVec3;
use pulp::{Arch, Simd};

/// Increments of a node, or the forces dual to them, of all rods of a group.
pub type GroupIncrements = [NumberGroup; 6];

/// The increment of the rod in a lane.
pub fn lane_increment(increments: &GroupIncrements, lane: usize) -> Increment {
    increments.map(|four| four.0[lane])
}

/// Writes the increment of the rod in a lane.
pub fn set_lane_increment(increments: &mut GroupIncrements, lane: usize, of_rod: &Increment) {
    for (four, value) in increments.iter_mut().zip(of_rod) {
        four.0[lane] = *value;
    }
}

/// Number of rotations among the unknowns of a node; they come first.
pub const ROTATION_UNKNOWNS: usize = 3;

/// Number of entries of the upper triangle of a block.
const TRIANGLE_ENTRIES: usize = UNKNOWNS * (UNKNOWNS + 1) / 2;

/// The entries of a node: the triangle of its own block, then the block (i, i + 1), both rows first.
type NodeEntries = [NumberGroup; ENTRIES_PER_NODE];

const ENTRIES_PER_NODE: usize = TRIANGLE_ENTRIES + UNKNOWNS * UNKNOWNS;

/// Position of the entry (r, c) of a triangle, r <= c.
const fn triangle_index(r: usize, c: usize) -> usize {
    r * (2 * UNKNOWNS - r - 1) / 2 + c
}

/// Position of the entry (r, c) of a block (i, i + 1).
const fn off_diagonal_index(r: usize, c: usize) -> usize {
    TRIANGLE_ENTRIES + r * UNKNOWNS + c
}

/// A 3 x 3 matrix, rows first.
pub type Matrix3 = [[f64; 3]; 3];

/// The two blocks of a node in the matrix of a rod.
pub struct NodeBlocks {
    /// The block of the node, upper triangle.
    pub own: NodeBlock,
    /// The block between the node and the next.
    pub next: NodeBlock,
}

/// Masses of the rods of a group, per weight of their nodes.
#[derive(Clone, Copy, Debug, Default)]
pub struct GroupMasses {
    pub rotary: NumberGroup,
    pub translational: NumberGroup,
}

/// The matrices of a group of rods, nodes from the first with equations on (from 0), without the
/// coupling to others, and their factorizations.
#[derive(Clone, Debug)]
pub struct BlockTridiagonal {
    /// Entries of all nodes.
    matrix: Vec<NodeEntries>,
    /// L D L^T, with unit lower L: of every node L^T of its own block above the
    /// diagonal and 1/d on it, then L^-1 times the block (i, i + 1).
    factor: Vec<NodeEntries>,
    /// Number of eliminated unknowns of the last node: with a joint tip its rotations alone.
    last_node_unknowns: usize,
}

/// The contribution of the masses to a matrix: `shift` times the masses per weight times the nodes'
/// weights.
pub struct ShiftedMasses<'a> {
    pub shift: f64,
    pub per_weight: GroupMasses,
    pub weights: &'a [f64],
}

impl BlockTridiagonal {
    /// Identity matrices, for rods with `nodes` nodes that have equations.
    pub fn new(nodes: usize, joined: bool) -> Self {
        let zeros = [NumberGroup::default(); ENTRIES_PER_NODE];
        let mut identity = zeros;
        for k in 0..UNKNOWNS {
            identity[triangle_index(k, k)] = NumberGroup::splat(1.0);
        }
        BlockTridiagonal {
            matrix: vec![identity; nodes],
            factor: vec![zeros; nodes],
            last_node_unknowns: if joined { ROTATION_UNKNOWNS } else { UNKNOWNS },
        }
    }

    fn nodes(&self) -> usize {
        self.matrix.len()
    }

    /// Number of eliminated unknowns of node `i` (from 0).
    #[inline(always)]
    fn eliminated_unknowns(&self, i: usize) -> usize {
        match i + 1 < self.nodes() {
            true => UNKNOWNS,
            false => self.last_node_unknowns,
        }
    }

    /// Writes the upper triangle of the block of node `i` (from 0), and the block
    /// between it and the next if there is one; identities in lanes without a rod.
    #[inline(always)]
    pub fn store_node_blocks<S: Simd>(
        &mut self,
        i: usize,
        own: &LaneBlock<S>,
        next: Option<&LaneBlock<S>>,
        active: Lanes<S>,
        part: usize,
    ) {
        let node = &mut self.matrix[i];
        let zero = Lanes::splat(active.simd, 0.0);
        let one = Lanes::splat(active.simd, 1.0);
        for r in 0..UNKNOWNS {
            let own_r = own[r][r].select_where_positive(active, one);
            own_r.store_group(&mut node[triangle_index(r, r)], part);
            for c in r + 1..UNKNOWNS {
                let own = own[r][c].select_where_positive(active, zero);
                own.store_group(&mut node[triangle_index(r, c)], part);
            }
            if let Some(next) = next {
                for c in 0..UNKNOWNS {
                    let next = next[r][c].select_where_positive(active, zero);
                    next.store_group(&mut node[off_diagonal_index(r, c)], part);
                }
            }
        }
    }

    /// Entry (r, c) of the block of node `i` (from 0), r <= c.
    pub fn diagonal_entry_mut(&mut self, i: usize, r: usize, c: usize) -> &mut NumberGroup {
        &mut self.matrix[i][triangle_index(r, c)]
    }

    /// Entry (r, c) of the block between nodes `i` (from 0) and `i` + 1.
    pub fn off_diagonal_entry_mut(&mut self, i: usize, r: usize, c: usize) -> &mut NumberGroup {
        &mut self.matrix[i][off_diagonal_index(r, c)]
    }

    /// The blocks of node `i` (from 0) of the rod in a lane.
    pub fn node_blocks(&self, i: usize, lane: usize) -> NodeBlocks {
        let node = &self.matrix[i];
        let (mut own, mut next) = (NodeBlock::default(), NodeBlock::default());
        for r in 0..UNKNOWNS {
            for c in 0..UNKNOWNS {
                next[r][c] = node[off_diagonal_index(r, c)].0[lane];
                if r <= c {
                    own[r][c] = node[triangle_index(r, c)].0[lane];
                }
            }
        }
        NodeBlocks { own, next }
    }

    /// Factorizes the matrices plus `masses`. False if a pivot is not positive or, with
    /// `any_sign`, if one is zero.
    pub fn factorize(&mut self, arch: Arch, masses: &ShiftedMasses, any_sign: bool) -> bool {
        let mut kernel = FactorizationKernel {
            chain: self,
            masses,
            any_sign,
            definite: true,
        };
        run(arch, &mut kernel);
        kernel.definite
    }

    /// The contribution of the rod in a lane to the matrix of the joint tip.
    pub fn tip_block(&self, lane: usize) -> Matrix3 {
        let node = &self.factor[self.nodes() - 1];
        let entry = |r: usize, c: usize| {
            node[triangle_index(ROTATION_UNKNOWNS + r.min(c), ROTATION_UNKNOWNS + r.max(c))].0[lane]
        };
        std::array::from_fn(|r| std::array::from_fn(|c| entry(r, c)))
    }

    /// Forward substitution L y = b. With a joint tip the last dx slots of y then hold the
    /// rods' contributions to the tip's right-hand side.
    pub fn substitute_forward(&self, arch: Arch, b: &[GroupIncrements], y: &mut [GroupIncrements]) {
        let chain = self;
        run(arch, &mut ForwardKernel { chain, b, y });
    }

    /// Backward substitution in place, from the result of [`BlockTridiagonal::substitute_forward`]; with
    /// a joint tip the last dx slots must hold its displacement. Returns b . y.
    pub fn substitute_backward(
        &self,
        arch: Arch,
        b: &[GroupIncrements],
        y: &mut [GroupIncrements],
    ) -> f64 {
        let mut kernel = BackwardKernel {
            chain: self,
            b,
            y,
            product: NumberGroup::default(),
        };
        run(arch, &mut kernel);
        kernel.product.sum()
    }
}

/// The factorization L D L^T of the matrix of a joint tip: L^T above the diagonal and 1/d on it.
#[derive(Clone, Copy, Debug)]
pub struct TipFactor(Matrix3);

impl TipFactor {
    /// Factorizes a symmetric matrix; `None` if it is not positive definite.
    pub fn new(mut a: Matrix3) -> Option<Self> {
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

/// The group of a rod, and its lane within the group.
#[derive(Clone, Copy)]
pub struct RodLane {
    pub group: usize,
    pub lane: usize,
}

/// Where rod `j` is.
pub fn rod_lane(j: usize) -> RodLane {
    RodLane {
        group: j / GROUP,
        lane: j % GROUP,
    }
}

/// The rods of a group, lane by lane; lanes without a rod repeat the last.
#[inline(always)]
pub fn lane_rods(group: usize, rods: usize) -> [usize; GROUP] {
    std::array::from_fn(|lane| (GROUP * group + lane).min(rods - 1))
}

/// The loop of [`BlockTridiagonal::factorize`] along the rods of a group.
struct FactorizationKernel<'a> {
    chain: &'a mut BlockTridiagonal,
    masses: &'a ShiftedMasses<'a>,
    any_sign: bool,
    definite: bool,
}

impl GroupKernel for FactorizationKernel<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let (zero, one) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 1.0));
        let shift = Lanes::splat(simd, self.masses.shift);
        let GroupMasses {
            rotary,
            translational,
        } = &self.masses.per_weight;
        let masses = [
            shift * Lanes::load_group(simd, rotary, part),
            shift * Lanes::load_group(simd, translational, part),
        ];
        let n = self.chain.nodes();
        let mut schur = [[zero; UNKNOWNS]; UNKNOWNS];
        for i in 0..n {
            let count = self.chain.eliminated_unknowns(i);
            let node = &self.chain.matrix[i];
            let factor = &mut self.chain.factor[i];
            let weight = Lanes::splat(simd, self.masses.weights[i]);
            let mut a = [[zero; UNKNOWNS]; UNKNOWNS];
            for r in 0..UNKNOWNS {
                for c in r..UNKNOWNS {
                    a[r][c] =
                        Lanes::load_group(simd, &node[triangle_index(r, c)], part) - schur[r][c];
                }
            }
            for k in 0..UNKNOWNS {
                a[k][k] = masses[k / ROTATION_UNKNOWNS].mul_add(weight, a[k][k]);
            }
            // Rows above the diagonal become L^T, the diagonal 1/d.
            let mut definite = one;
            for k in 0..UNKNOWNS {
                if k < count {
                    let (row, d) = (a[k], a[k][k]);
                    let test = if self.any_sign { d * d } else { d };
                    definite = definite.select_where_positive(test, zero);
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
                    a[r][c].store_group(&mut factor[triangle_index(r, c)], part);
                }
            }
            if i + 1 < n {
                schur = eliminate_off_diagonal(simd, &a, node, factor, part);
            }
        }
    }
}

/// Writes w = L^-1 times the block (i, i + 1); returns the upper triangle of
/// w^T D^-1 w.
#[inline(always)]
fn eliminate_off_diagonal<S: Simd>(
    simd: S,
    a: &LaneBlock<S>,
    node: &NodeEntries,
    factor: &mut NodeEntries,
    part: usize,
) -> LaneBlock<S> {
    let zero = Lanes::splat(simd, 0.0);
    let (mut w, mut schur) = ([[zero; UNKNOWNS]; UNKNOWNS], [[zero; UNKNOWNS]; UNKNOWNS]);
    for r in 0..UNKNOWNS {
        for c in 0..UNKNOWNS {
            w[r][c] = Lanes::load_group(simd, &node[off_diagonal_index(r, c)], part);
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
            row[c].store_group(&mut factor[off_diagonal_index(k, c)], part);
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

/// The loop of [`BlockTridiagonal::substitute_forward`] along the rods of a group.
struct ForwardKernel<'a> {
    chain: &'a BlockTridiagonal,
    b: &'a [GroupIncrements],
    y: &'a mut [GroupIncrements],
}

impl GroupKernel for ForwardKernel<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let n = self.chain.nodes();
        let mut y = [Lanes::splat(simd, 0.0); UNKNOWNS];
        let mut before = y;
        for i in 0..n {
            for k in 0..UNKNOWNS {
                y[k] = Lanes::load_group(simd, &self.b[i][k], part);
            }
            if i > 0 {
                let w = &self.chain.factor[i - 1];
                for k in 0..UNKNOWNS {
                    for c in 0..UNKNOWNS {
                        let w = Lanes::load_group(simd, &w[off_diagonal_index(k, c)], part);
                        y[c] = before[k].neg_mul_add(w, y[c]);
                    }
                }
            }
            let own = &self.chain.factor[i];
            let count = self.chain.eliminated_unknowns(i);
            for k in 0..UNKNOWNS {
                if k < count {
                    for r in k + 1..UNKNOWNS {
                        let l = Lanes::load_group(simd, &own[triangle_index(k, r)], part);
                        y[r] = y[k].neg_mul_add(l, y[r]);
                    }
                }
            }
            for k in 0..UNKNOWNS {
                y[k].store_group(&mut self.y[i][k], part);
                before[k] = y[k] * Lanes::load_group(simd, &own[triangle_index(k, k)], part);
            }
        }
    }
}

/// The loop of [`BlockTridiagonal::substitute_backward`] along the rods of a group.
struct BackwardKernel<'a> {
    chain: &'a BlockTridiagonal,
    b: &'a [GroupIncrements],
    y: &'a mut [GroupIncrements],
    product: NumberGroup,
}

impl GroupKernel for BackwardKernel<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let n = self.chain.nodes();
        let mut y = [Lanes::splat(simd, 0.0); UNKNOWNS];
        let (mut after, mut product) = (y, y[0]);
        for i in (0..n).rev() {
            let own = &self.chain.factor[i];
            for k in 0..UNKNOWNS {
                y[k] = Lanes::load_group(simd, &self.y[i][k], part);
            }
            if i + 1 < n {
                for k in 0..UNKNOWNS {
                    for c in 0..UNKNOWNS {
                        let w = Lanes::load_group(simd, &own[off_diagonal_index(k, c)], part);
                        y[k] = after[c].neg_mul_add(w, y[k]);
                    }
                }
            }
            let count = self.chain.eliminated_unknowns(i);
            for k in (0..UNKNOWNS).rev() {
                if k < count {
                    y[k] = y[k] * Lanes::load_group(simd, &own[triangle_index(k, k)], part);
                    for r in k + 1..UNKNOWNS {
                        let l = Lanes::load_group(simd, &own[triangle_index(k, r)], part);
                        y[k] = y[r].neg_mul_add(l, y[k]);
                    }
                }
            }
            for k in 0..UNKNOWNS {
                let b = Lanes::load_group(simd, &self.b[i][k], part);
                product = b.mul_add(y[k], product);
                y[k].store_group(&mut self.y[i][k], part);
            }
            after = y;
        }
        product.store_group(&mut self.product, part);
    }
}
