//! The longest stable time step of the explicit method.
//!
//! A leapfrog step h is stable while h omega < 2 for every frequency omega of
//! the leaf. Its squared frequencies are at most the largest of any single
//! segment with its share of the masses at its ends, plus the contribution of
//! coupling (T. J. R. Hughes, The Finite Element Method, 1987, section
//! 9.2). The shares are arbitrary; here they are in proportion to the stiffness with which
//! each segment holds the node, so that a short or stiff segment has most of a mass
//! that it alone moves fast. The inertia of a node is a tensor along its directors, of which each segment has a part of its
//! own about each of them: the bound holds for three different moments of inertia, too. It is that of motions that are
//! small. As nodes turn against the segments beside them by a finite angle, the axis of a small moment of inertia meets
//! another stiffness: a leaf of flat sections that bends or twists by more than about a radian beyond its
//! shape at the start may be faster, whereas of a leaf of round ones the stiffness that changes is small. With the rate of internal friction from three
//! strains ([`crate::motion::rate_weights`]) a mode with the part K of its squared frequency
//! from strains and C from coupling satisfies
//!
//! ```text
//! z^3 + (a + 3 b/2 - 2) z^2 + (1 - 2 b) z + b/2 = 0,   a = h^2 (K + C),   b = eta h K
//! ```
//!
//! with roots inside the unit circle while a + 4 b < 4; external damping
//! does not change that. The drag of wind, with velocities extrapolated from those of the last two
//! half steps, at which they decay at the rate lambda, gives
//!
//! ```text
//! z^3 + (a + 3 b/2 - 2) z^2 + (1 - 2 b) z + b/2 = 0,   b = h lambda
//! ```
//!
//! and the same bound.
//!
//! If only the equilibrium matters, masses are arbitrary. With the fictitious ones below, the
//! fastest motion of every single segment and of every coupling between neighbors,
//! alone with its share of the masses, has the frequency 2: that bounds the frequencies of
//! the leaf, the longest stable time step is one, and slow motions are as fast relative
//! to it as possible (P. Underwood, Dynamic relaxation, in: Computational
//! Methods for Transient Analysis, 1983).

use crate::leaf::{CellStiffness, DiscreteLeaf, NodeFreedom, State};
use crate::motion::explicit::layout::{NodeData, PackLayout};
use crate::motion::explicit::packs::{Pack, materials, node_data};
use crate::motion::physics::{Physics, WindDrag};
use glam::{DMat3, DQuat, DVec3};
use nalgebra::SMatrix;
use std::array::from_fn;

/// The longest stable time step, and what limits it.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct StableStep {
    /// Length of the step, dimensionless.
    pub step: f64,
    /// The fastest motion, in words, which limits the step.
    pub limit: &'static str,
}

impl StableStep {
    /// The longest stable step of a leaf with these positions and rotations.
    pub fn for_leaf(leaf: &DiscreteLeaf, physics: &Physics, state: &State) -> Self {
        let fastest = fastest_segment(leaf, physics, state);
        let (strains, mut limit) = (fastest.squared_frequency, fastest.kind);
        let (coupling, tissue) = (
            coupling_frequency_bound(leaf, physics),
            tissue_frequency_bound(leaf, physics, state),
        );
        if coupling.max(tissue) > strains {
            limit = if tissue > coupling {
                "tissue"
            } else {
                "coupling"
            };
        }
        let springs = leaf.spring_frequency_bound(|j, i| {
            let inertia = physics.inertia(leaf, j, i);
            [inertia.principal.min_element(), inertia.mass]
        });
        if springs > strains.max(coupling).max(tissue) {
            limit = "the springs of supports";
        }
        let levers = leaf.lever_frequency_bound(|j, i| {
            let inertia = physics.inertia(leaf, j, i);
            inertia.principal.min_element()
        });
        if levers > strains.max(coupling).max(tissue).max(springs) {
            limit = "the levers of loads off the axis";
        }
        let coupling = coupling + tissue + springs + levers;
        let all = strains + coupling;
        let friction = physics.retardation * strains;
        let drag =
            WindDrag::new(leaf, physics).map_or(0.0, |wind| wind.fastest_decay(leaf, physics));
        let damping = friction + drag;
        if damping * damping > all {
            limit = if drag > friction {
                "the drag of the wind"
            } else {
                "internal damping"
            };
        }
        StableStep {
            step: 2.0 / (damping + (damping * damping + all).sqrt()),
            limit,
        }
    }
}

/// Stiffness of a segment, between the displacements of its left and its right end, and
/// the rotations of both.
type SegmentStiffness = [[DMat3; 4]; 4];

/// Stiffness with which a node is held.
#[derive(Clone, Copy, Debug, Default)]
struct NodeHold {
    /// Stiffness for displacements along the node's directors.
    displacement: DVec3,
    /// Stiffness for rotations about them.
    rotation: DVec3,
}

/// The fastest motion of any single segment.
struct FastestMotion {
    squared_frequency: f64,
    kind: &'static str,
}

/// Least stiffness of a hold in any direction, as a part of its largest component.
const MIN_STIFFNESS_FRACTION: f64 = 0.01;

/// The fastest motion of any single segment with its shares of the masses.
fn fastest_segment(leaf: &DiscreteLeaf, physics: &Physics, state: &State) -> FastestMotion {
    let (rods, n) = (leaf.rods(), leaf.segments());
    let joined = leaf.leaf.joined() && rods > 1;
    let mut held = vec![NodeHold::default(); state.x.len()];
    for (j, i) in leaf.rod_index_pairs(0..n) {
        let stiffness = stiffness(leaf, state, j, i);
        for end in 0..2 {
            let node = state.base(j) + i + end;
            let hold = node_stiffness(&stiffness, end, state.q[node]);
            held[node].displacement += hold.displacement;
            held[node].rotation += hold.rotation;
        }
    }
    // All rods hold a shared tip, along their own directors: as a scalar.
    let tips = (0..rods).map(|j| held[state.base(j) + n].displacement.max_element());
    let tip: f64 = tips.sum();
    let tip_mass = (0..rods).map(|j| physics.inertia(leaf, j, n).mass);
    let tip_mass: f64 = tip_mass.sum();
    let (mut largest, mut fastest) = (0.0, None);
    for (j, i) in leaf.rod_index_pairs(0..n) {
        let stiffness = stiffness(leaf, state, j, i);
        // Inverse square root of the masses of an end, along the lab axes.
        let root = |end: usize| {
            let free = match i + end == 0 && physics.clamped() {
                true => leaf.node_freedom(j, 0),
                false => NodeFreedom::FREE,
            };
            if free.is_fixed() {
                return [DMat3::ZERO; 2];
            }
            let node = state.base(j) + i + end;
            let inertia = physics.inertia(leaf, j, i + end);
            let hold = node_stiffness(&stiffness, end, state.q[node]);
            let (shift, turn) = (hold.displacement, hold.rotation);
            let moving = match joined && i + end == n {
                true => DVec3::splat(tip_mass * shift.max_element() / tip),
                false => inertia.mass * shift / held[node].displacement,
            };
            let turning = inertia.principal * turn / held[node].rotation;
            let frame = DMat3::from_quat(state.q[node]);
            [(moving, free.displacement.any()), (turning, free.rotation)].map(|(mass, free)| {
                match free {
                    true => {
                        let root = DMat3::from_diagonal(mass.map(f64::sqrt).recip());
                        frame * root * frame.transpose()
                    }
                    false => DMat3::ZERO,
                }
            })
        };
        let (left, right) = (root(0), root(1));
        let roots = [left[0], right[0], left[1], right[1]];
        let scaled: SegmentStiffness =
            from_fn(|r| from_fn(|c| roots[r] * stiffness[r][c] * roots[c]));
        let matrix = SMatrix::<f64, 12, 12>::from_fn(|r, c| scaled[r / 3][c / 3].col(c % 3)[r % 3]);
        let squared = matrix.symmetric_eigenvalues().max();
        if squared > largest {
            (largest, fastest) = (squared, Some((j, i, roots, matrix)));
        }
    }
    let Some((j, i, roots, matrix)) = fastest else {
        return FastestMotion {
            squared_frequency: 0.0,
            kind: "",
        };
    };
    let eigen = matrix.symmetric_eigen();
    let mode = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    let motion = |k: usize| roots[k] * DVec3::from_slice(&mode.as_slice()[3 * k..3 * k + 3]);
    let (displacements, rotations) = ([motion(0), motion(1)], [motion(2), motion(3)]);
    FastestMotion {
        squared_frequency: largest,
        kind: motion_kind_name(leaf, state, j, i, displacements, rotations),
    }
}

/// Stiffness of a segment that carries the force of its strain.
fn stiffness(leaf: &DiscreteLeaf, state: &State, j: usize, i: usize) -> SegmentStiffness {
    let section = leaf.section(j, i).limit_condensing_stiffness(f64::INFINITY);
    let k = leaf.strained_segment(state, j, i).hessian(&section);
    [
        [k.xx, -k.xx, -k.xa, -k.xb],
        [-k.xx, k.xx, k.xa, k.xb],
        [-k.xa.transpose(), k.xa.transpose(), k.aa, k.ab],
        [-k.xb.transpose(), k.xb.transpose(), k.ab.transpose(), k.bb],
    ]
}

/// Stiffness with which a segment holds the node of rotation `q` at its left or right end.
fn node_stiffness(stiffness: &SegmentStiffness, end: usize, q: DQuat) -> NodeHold {
    let frame = DMat3::from_quat(q);
    let [displacement, rotation] = [end, 2 + end].map(|c| {
        let seen = frame.transpose() * stiffness[c][c] * frame;
        let hold = DVec3::new(seen.x_axis.x, seen.y_axis.y, seen.z_axis.z);
        hold.max(DVec3::splat(MIN_STIFFNESS_FRACTION * hold.max_element()))
    });
    NodeHold {
        displacement,
        rotation,
    }
}

/// The dominant kind of a motion of segment `i` of rod `j`, given by the displacements and the
/// rotations of its ends.
fn motion_kind_name(
    leaf: &DiscreteLeaf,
    state: &State,
    j: usize,
    i: usize,
    [x0, x1]: [DVec3; 2],
    [a, b]: [DVec3; 2],
) -> &'static str {
    let (section, node) = (leaf.section(j, i), state.base(j) + i);
    let frame = leaf.segment(state, j, i, DVec3::ZERO).frame.transpose();
    let along = frame * (state.x[node + 1] - state.x[node]);
    let strain = frame * (x1 - x0) + along.cross(frame * (0.5 * (a + b)));
    let stretch = strain * strain / section.compliance;
    let turn = frame * (b - a);
    let bend = turn * turn * section.couple_stiffness;
    let motions = [
        (stretch.x, "waves of stretch"),
        (bend.x, "waves of twist"),
        (bend.y + bend.z, "waves of bending"),
        (stretch.y + stretch.z, "shear with rotation"),
    ];
    let most = motions.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
    most.map_or("", |(_, name)| name)
}

/// Upper bound on the contribution of coupling to the squared frequency: of all pairs of
/// coupled nodes, the largest sum of the stiffness that couples each, over its
/// mass. (The same bound for the Laplacian of a graph: W. N. Anderson and
/// T. D. Morley, Linear and Multilinear Algebra 18, 1985.)
fn coupling_frequency_bound(leaf: &DiscreteLeaf, physics: &Physics) -> f64 {
    let mut largest = 0.0_f64;
    for i in 1..=leaf.segments() {
        let of = |j: usize| {
            let gaps = [j.wrapping_sub(1), j];
            let inside = gaps.into_iter().filter(|&g| g < leaf.rods() - 1);
            let springs: DVec3 = inside.map(|g| leaf.node_coupling(g, i)).sum();
            springs / physics.inertia(leaf, j, i).mass
        };
        for gap in 0..leaf.rods() - 1 {
            let tied = leaf.node_coupling(gap, i).cmpgt(DVec3::ZERO);
            let sum = DVec3::select(tied, of(gap) + of(gap + 1), DVec3::ZERO);
            largest = largest.max(sum.max_element());
        }
    }
    largest
}

/// Upper bound on the contribution of the tissue to the squared frequency: the largest of any single
/// strip, half of the masses of a node belonging to either of its two gaps, plus that of any cell whose strips
/// contract, to which belongs a half of that again, as a node is in two cells of a gap.
fn tissue_frequency_bound(leaf: &DiscreteLeaf, physics: &Physics, state: &State) -> f64 {
    // The inverse roots of inertia and mass of the part of a node.
    let inverse_roots = |rod: usize, i: usize, cells: f64| {
        let inertia = physics.inertia(leaf, rod, i);
        let ends = [0, leaf.rods() - 1].contains(&rod);
        let share = if ends { 1.0 } else { 0.5 } / cells;
        // Bases that are held do not move.
        let free = match i == 0 && physics.clamped() {
            true => leaf.node_freedom(rod, 0),
            false => NodeFreedom::FREE,
        };
        let part = |free: bool| if free { 1.0 / share } else { 0.0 };
        let turning = inertia.principal.min_element();
        [
            part(free.rotation) / turning,
            part(free.displacement.any()) / inertia.mass,
        ]
        .map(f64::sqrt)
    };
    let mut of_strips = 0.0_f64;
    for strip in leaf.tissue_stiffness(state) {
        let (g, i) = (strip.gap, strip.node);
        let [a, b] = [g, g + 1].map(|rod| inverse_roots(rod, i, 1.0));
        let roots = [a[0], a[1], b[0], b[1]];
        let scaled = |r: usize, c: usize| roots[r / 3] * strip.matrix[(r, c)] * roots[c / 3];
        let matrix = SMatrix::<f64, 12, 12>::from_fn(scaled);
        of_strips = of_strips.max(matrix.symmetric_eigenvalues().max());
    }
    let mut of_cells = 0.0_f64;
    for CellStiffness { cell, mut matrix } in leaf.cell_stiffness(state) {
        let roots = [0, 1, 2, 3].map(|k| {
            let (rod, i) = cell.node(k);
            inverse_roots(rod, i, 2.0)
        });
        let root = |k: usize| roots[k / 6][k % 6 / 3];
        for r in 0..matrix.nrows() {
            for c in 0..matrix.ncols() {
                matrix[(r, c)] *= root(r) * root(c);
            }
        }
        of_cells = of_cells.max(matrix.symmetric_eigenvalues().max());
    }
    of_strips + of_cells
}

/// Part of the squared frequency 4 of a segment that is due to the rotations of its
/// ends, the rest being due to their translations. Slow motions are mostly translations:
/// rotations get the smaller part of the frequency, hence larger masses.
const ROTATION_FREQUENCY_FRACTION: f64 = 0.5;

/// Sets the masses of the rods; returns that of a shared tip.
pub fn set_fictitious_masses(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    layout: PackLayout,
    packs: &mut [Pack],
) -> f64 {
    let (n, count) = (leaf.segments(), leaf.rods());
    let mut tip = 0.0;
    let mut rods: Vec<Vec<NodeData>> = Vec::with_capacity(count);
    for j in 0..count {
        let old: Vec<NodeData> = (0..=n).map(|i| node_data(leaf, physics, j, i)).collect();
        let mut new = old.clone();
        for i in 0..=n {
            let (mut mass, mut inertia) = (0.0, 0.0);
            let before = i.checked_sub(1).map(|before| &old[before]);
            for segment in before.into_iter().chain([&old[i]]) {
                let stretch = segment
                    .stretch_stiffness
                    .into_iter()
                    .fold(0.0_f64, f64::max);
                let bend = segment
                    .bending_stiffness
                    .into_iter()
                    .fold(0.0_f64, f64::max);
                let arm = 0.5 * segment.rest_length[0];
                mass += 2.0 * stretch / (4.0 - ROTATION_FREQUENCY_FRACTION);
                inertia += 2.0 * (bend + stretch * arm * arm) / ROTATION_FREQUENCY_FRACTION;
            }
            let node = &mut new[i];
            // Both neighbors pull on a node, and may move as much as it does.
            for (gap, coupled) in [j.wrapping_sub(1), j]
                .into_iter()
                .zip(node.coupling_weights)
            {
                if gap < count - 1 {
                    mass += 0.5 * (leaf.leaf.coupling(gap) * coupled).max_element();
                }
            }
            for strip in leaf.adjacent_strips(j, i) {
                let stiffness = strip.stiffness.max_element();
                let arm = 0.5 * strip.stress_free_gap.length();
                mass += 2.0 * stiffness / (4.0 - ROTATION_FREQUENCY_FRACTION);
                inertia += 2.0 * (strip.fold_stiffness + stiffness * arm * arm)
                    / ROTATION_FREQUENCY_FRACTION;
            }
            if i == n {
                tip += mass;
            }
            // Zero for a held node, and for a shared tip.
            if node.inverse_inertia != [0.0; 3] {
                node.inverse_inertia = [1.0 / inertia; 3];
            }
            if node.inverse_mass != 0.0 {
                node.mass = mass;
                node.inverse_mass = 1.0 / mass;
            }
        }
        rods.push(new);
    }
    for (pack, material) in packs.iter_mut().zip(materials(layout, |j, i| rods[j][i])) {
        pack.material = material;
    }
    tip
}
