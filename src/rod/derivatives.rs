//! First and second derivatives of an element, with respect to the variables of its strains and to
//! the unknowns of its two nodes.

use crate::lanes::{Lanes, Vectors};
use pulp::Simd;

/// A matrix, rows first.
pub type Rows<S> = [Vectors<S>; 3];

/// First derivatives: with respect to x1 (that to x0 is its negative), and to
/// the rotations of the two nodes.
pub type First<S> = [Vectors<S>; 3];

/// Second derivatives with respect to (x1 - x0) and the spatial rotation
/// increments a, b of the two nodes.
pub struct Second<S: Simd> {
    pub xx: Rows<S>,
    pub xa: Rows<S>,
    pub xb: Rows<S>,
    pub aa: Rows<S>,
    pub ab: Rows<S>,
    pub bb: Rows<S>,
}

impl<S: Simd> Second<S> {
    /// By nodes.
    #[inline(always)]
    pub fn by_nodes(self) -> Hessian<S> {
        let Second {
            xx,
            xa,
            xb,
            aa,
            ab,
            bb,
        } = self;
        let none = [[xx[0].x; UNKNOWNS]; UNKNOWNS];
        let (mut left, mut right, mut across) = (none, none, none);
        let (ax, bx) = (transposed(xa), transposed(xb));
        for r in 0..3 {
            let (xx, xb, aa, ab) = (xx[r].array(), xb[r].array(), aa[r].array(), ab[r].array());
            let (ax, bx, bb) = (ax[r].array(), bx[r].array(), bb[r].array());
            for c in 0..3 {
                left[r][c] = aa[c];
                left[r][3 + c] = -ax[c];
                left[3 + r][3 + c] = xx[c];
                right[r][c] = bb[c];
                right[r][3 + c] = bx[c];
                right[3 + r][3 + c] = xx[c];
                across[r][c] = ab[c];
                across[r][3 + c] = ax[c];
                across[3 + r][c] = -xb[c];
                across[3 + r][3 + c] = -xx[c];
            }
        }
        Hessian {
            own: [left, right],
            across,
        }
    }
}

/// Second derivatives with respect to the unknowns of the two nodes, the force condensed out.
pub struct Hessian<S: Simd> {
    /// The nodes' own blocks, upper triangles.
    pub own: [Block<S>; 2],
    /// The block between the first and the second.
    pub across: Block<S>,
}

/// A block of a matrix of nodal unknowns, rows first.
pub type Block<S> = [[Lanes<S>; UNKNOWNS]; UNKNOWNS];

/// Unknowns of a node: rotation, then displacement.
pub const UNKNOWNS: usize = 6;

/// The transposed matrix.
#[inline(always)]
pub fn transposed<S: Simd>([a, b, c]: Rows<S>) -> Rows<S> {
    [
        Vectors::new(a.x, b.x, c.x),
        Vectors::new(a.y, b.y, c.y),
        Vectors::new(a.z, b.z, c.z),
    ]
}

/// First derivatives with respect to the unknowns of the two nodes.
#[inline(always)]
pub fn on_nodes<S: Simd>([x, a, b]: First<S>) -> [[Lanes<S>; UNKNOWNS]; 2] {
    [
        [a.x, a.y, a.z, -x.x, -x.y, -x.z],
        [b.x, b.y, b.z, x.x, x.y, x.z],
    ]
}
