//! The longest stable time step of the explicit method.
//!
//! A leapfrog step h is stable while h omega < 2 for every frequency omega of
//! the leaf. Its squared frequencies are at most the largest that any one
//! segment would have with its share of the masses at its ends (T. J. R.
//! Hughes, The Finite Element Method, 1987, section 9.2), plus what coupling
//! adds. With the rate of internal friction from three strains (see
//! [`super::friction::rates`]) a mode with the part K of its squared frequency
//! from strains and C from coupling goes like
//!
//! ```text
//! z^3 + (a + 3 b/2 - 2) z^2 + (1 - 2 b) z + b/2 = 0,   a = h^2 (K + C),   b = eta h K
//! ```
//!
//! whose roots are inside the unit circle while a + 4 b < 4; external damping
//! leaves that as it is.

use nalgebra::SMatrix;

use super::physics::{Inertia, Physics};
use crate::leaf::{DiscreteLeaf, State};
use crate::rod::{Section, Segment};
use glam::{DMat3, DQuat, DVec3};

/// The longest stable time step, and what limits it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StableStep {
    /// The step.
    pub step: f64,
    /// The fastest motion.
    pub limit: &'static str,
}

impl StableStep {
    /// Of a leaf with these positions and rotations.
    pub fn of(leaf: &DiscreteLeaf, physics: &Physics, state: &State) -> Self {
        let (strains, mut limit) = fastest_segment(leaf, physics, state);
        let coupling = coupling(leaf, physics);
        if coupling > strains {
            limit = "coupling";
        }
        let (friction, all) = (physics.retardation * strains, strains + coupling);
        if friction * friction > all {
            limit = "internal damping";
        }
        StableStep {
            step: 2.0 / (friction + (friction * friction + all).sqrt()),
            limit,
        }
    }
}

/// Largest squared frequency of any segment alone, and of what motion.
fn fastest_segment(leaf: &DiscreteLeaf, physics: &Physics, state: &State) -> (f64, &'static str) {
    let (mut largest, mut limit) = (0.0, "");
    let grid = &leaf.grid;
    for j in 0..leaf.rods() {
        for i in 0..leaf.segments() {
            // A node shares its mass between the segments beside it.
            let share = |node: usize| {
                let part = grid.width(i) / (2.0 * grid.weight(node));
                let inertia = physics.inertia(leaf.leaf, grid, j, node);
                Inertia {
                    mass: part * inertia.mass,
                    transverse: part * inertia.transverse,
                    ..inertia
                }
            };
            let ends = [share(i), share(i + 1)];
            let k = state.base(j) + i;
            let section = leaf.section(j, i).condense(f64::INFINITY);
            let idle = leaf.segment(state, j, i, DVec3::ZERO);
            let strain = idle.v(&section) - section.rest_strain;
            let segment = leaf.segment(state, j, i, idle.frame * (strain / section.compliance));
            let squared = squared_frequency(&section, &segment, ends, [state.q[k], state.q[k + 1]]);
            if squared > largest {
                (largest, limit) = (squared, name(&section, ends));
            }
        }
    }
    (largest, limit)
}

/// Largest squared frequency of a free segment with these masses at its ends.
fn squared_frequency(
    section: &Section,
    segment: &Segment,
    ends: [Inertia; 2],
    q: [DQuat; 2],
) -> f64 {
    let k = segment.hessian(section);
    let turning = |inertia: Inertia, q: DQuat| {
        let d1 = q * DVec3::X;
        let per_root = inertia.transverse.sqrt().recip();
        let own = (inertia.transverse / inertia.polar()).sqrt() - 1.0;
        (DMat3::IDENTITY + crate::rotation::outer(d1, d1) * own) * per_root
    };
    let moving = |inertia: Inertia| DMat3::IDENTITY * inertia.mass.sqrt().recip();
    // In the order x0, x1, a, b.
    let roots = [
        moving(ends[0]),
        moving(ends[1]),
        turning(ends[0], q[0]),
        turning(ends[1], q[1]),
    ];
    let stiffness = [
        [k.xx, -k.xx, -k.xa, -k.xb],
        [-k.xx, k.xx, k.xa, k.xb],
        [-k.xa.transpose(), k.xa.transpose(), k.aa, k.ab],
        [-k.xb.transpose(), k.xb.transpose(), k.ab.transpose(), k.bb],
    ];
    let scaled: [[DMat3; 4]; 4] =
        std::array::from_fn(|r| std::array::from_fn(|c| roots[r] * stiffness[r][c] * roots[c]));
    SMatrix::<f64, 12, 12>::from_fn(|r, c| scaled[r / 3][c / 3].col(c % 3)[r % 3])
        .symmetric_eigenvalues()
        .max()
}

/// The fastest motion of a segment, were it straight.
fn name(section: &Section, ends: [Inertia; 2]) -> &'static str {
    let sum = |of: fn(&Inertia) -> f64| 1.0 / of(&ends[0]) + 1.0 / of(&ends[1]);
    let (per_mass, per_inertia) = (sum(|end| end.mass), sum(|end| end.transverse));
    let per_polar = sum(Inertia::polar);
    let (stretch, bend) = (section.compliance.recip(), section.couple_stiffness);
    let (ds, shear) = (section.ds, stretch.y.max(stretch.z));
    let motions = [
        (stretch.x / ds * per_mass, "waves of stretch"),
        (bend.x / ds * per_polar, "waves of twist"),
        (bend.y.max(bend.z) / ds * per_inertia, "waves of bending"),
        (
            shear / ds * per_mass + shear * 0.25 * ds * per_inertia,
            "shear with rotation",
        ),
    ];
    let fastest = motions.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
    fastest.map_or("", |(_, name)| name)
}

/// What coupling adds to the squared frequency, at most: of all pairs of
/// nodes that are tied together, the largest sum of what ties each, over its
/// mass. (The same bound for the Laplacian of a graph: W. N. Anderson and
/// T. D. Morley, Linear and Multilinear Algebra 18, 1985.)
fn coupling(leaf: &DiscreteLeaf, physics: &Physics) -> f64 {
    let mut largest = 0.0_f64;
    for i in 1..=leaf.segments() {
        let of = |j: usize| {
            let gaps = [j.wrapping_sub(1), j];
            let inside = gaps.into_iter().filter(|&g| g < leaf.rods() - 1);
            let springs: DVec3 = inside.map(|g| leaf.spring(g, i)).sum();
            springs / physics.inertia(leaf.leaf, &leaf.grid, j, i).mass
        };
        for gap in 0..leaf.rods() - 1 {
            let tied = leaf.spring(gap, i).cmpgt(DVec3::ZERO);
            let sum = DVec3::select(tied, of(gap) + of(gap + 1), DVec3::ZERO);
            largest = largest.max(sum.max_element());
        }
    }
    largest
}
