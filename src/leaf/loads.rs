//! Loads on the nodes of several rods: dead loads, and the coupling with their neighbours.
//!
//! Dead moments on a single rod, fixed along the lab axes: on its tip, and on points along it. They
//! have no potential in three dimensions.
//!
//! Dead moments in Newton's equations of a single rod.
//!
//! A dead moment M is not conservative in three dimensions: the derivative of its node's moment
//! balance in spatial increments gains -\[M\]/2, which is skew. All of them together have a small
//! rank, and are included by the Sherman-Morrison-Woodbury formula: with the rotations C of their
//! nodes by unit moments on these and the skew S, the moments x that (1 + S C) x = S t of the
//! rotations t without them are taken off.

use crate::leaf::block_tridiagonal::{GroupIncrements, group_and_lane};
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::system::{RodGroup, System};
use crate::leaf::{Leaf, Loads, NODE_COINCIDENCE_TOLERANCE};
use crate::simd::{GROUP, Lanes, NumberGroup, Vectors};
use glam::DVec3;
use pulp::{Arch, Simd};

/// Loads on a rod per weight of its nodes, except the force on its tip.
#[derive(Clone, Copy)]
pub struct RodLoad {
    /// Dead load.
    pub dead: DVec3,
    /// Force on the tip.
    pub tip: DVec3,
    /// Coupling with the previous rod, with the next, and with its own mirror image.
    pub previous: DVec3,
    pub next: DVec3,
    pub image: DVec3,
}

/// Moment, force and energy of what acts on a node besides its segments; the energy of a gap belongs
/// to the lower rod.
#[derive(Clone, Copy, Debug, Default)]
pub struct NodeLoad {
    /// Moment.
    pub moment: DVec3,
    /// Force.
    pub force: DVec3,
    /// Potential energy.
    pub energy: f64,
}

/// Loads on a group of rods, component by component, in the order of the fields of [`RodLoad`].
pub type GroupLoads = [[NumberGroup; 3]; 5];

/// The loads on the rods of a group.
#[inline(always)]
pub fn group_loads(of: [RodLoad; GROUP]) -> GroupLoads {
    let vectors = |of_load: fn(&RodLoad) -> DVec3| {
        let [a, b, c, d] = of.each_ref().map(of_load);
        [
            NumberGroup([a.x, b.x, c.x, d.x]),
            NumberGroup([a.y, b.y, c.y, d.y]),
            NumberGroup([a.z, b.z, c.z, d.z]),
        ]
    };
    [
        vectors(|load| load.dead),
        vectors(|load| load.tip),
        vectors(|load| load.previous),
        vectors(|load| load.next),
        vectors(|load| load.image),
    ]
}

/// The loads on several rods.
#[derive(Clone, Copy)]
pub struct LaneRodLoads<S: Simd> {
    dead: Vectors<S>,
    tip: Vectors<S>,
    previous: Vectors<S>,
    next: Vectors<S>,
    image: Vectors<S>,
}

impl<S: Simd> LaneRodLoads<S> {
    /// The loads on the lanes from `part` on.
    #[inline(always)]
    pub fn load_group(simd: S, group: &GroupLoads, part: usize) -> Self {
        let vectors = |k: usize| {
            let [x, y, z] = [0, 1, 2].map(|c| Lanes::load_group(simd, &group[k][c], part));
            Vectors::new(x, y, z)
        };
        LaneRodLoads {
            dead: vectors(0),
            tip: vectors(1),
            previous: vectors(2),
            next: vectors(3),
            image: vectors(4),
        }
    }

    /// Forces on nodes, and their share of the potential energy (that of a gap belongs to its
    /// lower rod), from the positions of the nodes on the previous rods, of these, and on the
    /// next rods, and from their weights in dead loads and in the coupling.
    #[inline(always)]
    pub fn node_forces(
        &self,
        [previous, x, next]: [Vectors<S>; 3],
        [weight, coupling_weight]: [f64; 2],
        tip: bool,
    ) -> (Vectors<S>, Lanes<S>) {
        let simd = x.x.simd;
        let (weight, half) = (Lanes::splat(simd, weight), Lanes::splat(simd, 0.5));
        let coupling_weight = Lanes::splat(simd, coupling_weight);
        let mut force = self.dead.scale(weight);
        if tip {
            force = force + self.tip;
        }
        let to_image = (self.image * x).scale(coupling_weight);
        let stretch = next - x;
        let pull = (self.next * stretch).scale(coupling_weight);
        let energy = half * (pull.dot(stretch) + to_image.dot(x)) - force.dot(x);
        let push = (self.previous * (x - previous)).scale(coupling_weight);
        (force + pull - push - to_image, energy)
    }

    /// The contribution of the coupling to the diagonal of nodes, per weight.
    #[inline(always)]
    pub fn coupling_stiffness(&self) -> Vectors<S> {
        self.previous + self.next + self.image
    }
}

impl Loads {
    /// Whether dead moments act.
    pub fn has_moments(&self) -> bool {
        self.tip_moment != DVec3::ZERO || self.dead_moment_factor != 0.0
    }
}

impl Leaf {
    /// Sigma and size of every dead moment on a point.
    pub(super) fn point_dead_moments(&self) -> impl Iterator<Item = (f64, DVec3)> {
        let (points, unit) = (self.scenario().points.iter(), self.scale.moment());
        points.map(move |it| (it.at, DVec3::from_array(it.moment) / unit))
    }

    /// Sigma and size of every dead moment.
    pub fn dead_moments(&self) -> impl Iterator<Item = (f64, DVec3)> {
        let (loads, points) = (&self.loads, self.point_dead_moments());
        let on_points = points.map(|(at, moment)| (at, loads.dead_moment_factor * moment));
        let all = std::iter::once((1.0, loads.tip_moment)).chain(on_points);
        all.filter(|(_, moment)| *moment != DVec3::ZERO)
    }

    /// The size of the largest dead moment on a point.
    pub fn largest_point_moment(&self) -> f64 {
        let sizes = self.point_dead_moments().map(|(_, moment)| moment.length());
        self.loads.dead_moment_factor * sizes.fold(0.0, f64::max)
    }

    /// Upper bound on the integral of the moment that the rod carries by the dead moments alone, over
    /// its length: a free rod carries each up to its place, one that is held elsewhere perhaps
    /// beyond it.
    pub fn moment_integral_bound(&self) -> f64 {
        let held = self.has_placed_supports();
        let reach = |at: f64| if held { 1.0 } else { at };
        self.dead_moments()
            .map(|(at, moment)| moment.length() * reach(at))
            .sum()
    }
}

impl DiscreteLeaf {
    /// Nodes and sizes of the dead moments on points; empty if there are none. What acts within
    /// rounding of a clamped base is left to its clamp.
    pub(super) fn nodal_point_moments(&self) -> Vec<(usize, DVec3)> {
        let points = self.leaf.point_dead_moments();
        let some = points.filter(|(_, moment)| *moment != DVec3::ZERO);
        some.map(|(at, moment)| (self.grid.nearest(at), moment))
            .filter(|(node, _)| *node >= self.first_node())
            .collect()
    }

    /// Whether dead moments act.
    pub fn has_moments(&self) -> bool {
        self.dead_moments().next().is_some()
    }

    /// The same leaf without dead moments.
    pub fn without_moments(&self) -> Self {
        let mut without = self.clone();
        without.loads.tip_moment = DVec3::ZERO;
        without.loads.dead_moment_factor = 0.0;
        without
    }

    /// Node and size of every dead moment that acts.
    pub fn dead_moments(&self) -> impl Iterator<Item = (usize, DVec3)> {
        let part = self.load_factor;
        self.dead_moments_under(self.loads)
            .map(move |(node, moment)| (node, part * moment))
            .filter(|(_, moment)| *moment != DVec3::ZERO)
    }

    /// The same under other loads.
    pub fn dead_moments_under(&self, loads: Loads) -> impl Iterator<Item = (usize, DVec3)> {
        let tip = (self.segments(), loads.tip_moment);
        let on_points = self.point_moments.iter();
        let on_points =
            on_points.map(move |&(node, moment)| (node, loads.dead_moment_factor * moment));
        // Joined tips pass on no moment.
        let single = self.rods() == 1;
        let tip = Some(tip).filter(|(_, moment)| single && *moment != DVec3::ZERO);
        tip.into_iter().chain(on_points)
    }

    /// The sum of the dead moments on node `i` of the rod.
    pub(super) fn node_dead_moment(&self, i: usize) -> DVec3 {
        if !self.loads.has_moments() {
            return DVec3::ZERO;
        }
        let here = self.dead_moments().filter(|(node, _)| *node == i);
        here.map(|(_, moment)| moment).sum()
    }

    /// The sum of the dead moments at `sigma`, by which the moment of the rod jumps there.
    pub fn dead_moment_at(&self, sigma: f64) -> DVec3 {
        if !self.loads.has_moments() {
            return DVec3::ZERO;
        }
        let here =
            |node: usize| (self.grid.sigma()[node] - sigma).abs() < NODE_COINCIDENCE_TOLERANCE;
        let moments = self.dead_moments().filter(|(node, _)| here(*node));
        moments.map(|(_, moment)| moment).sum()
    }

    /// The sum of the dead moments beyond segment `i`: what it carries of them if the tip is free.
    pub fn dead_moment_beyond(&self, i: usize) -> DVec3 {
        let beyond = self.dead_moments().filter(|(node, _)| *node > i);
        beyond.map(|(_, moment)| moment).sum()
    }

    /// Adds the dead moments to the right-hand side of an assembled system, which keeps them for
    /// its solution.
    pub(super) fn add_moments(&self, system: &mut System) {
        let first = self.first_node();
        system.moments.replace_moments(
            self.dead_moments()
                .map(|(node, moment)| (node - first, moment)),
        );
        let (group, lane) = group_and_lane(0);
        for (i, moment) in system.moments.nodal_moments() {
            let rhs = &mut system.groups[group].rhs[i];
            for c in 0..3 {
                rhs[c].0[lane] += moment[c];
            }
        }
    }
}

/// The dead moments as of the last assembly, with the workspace of their equations.
#[derive(Clone, Debug, Default)]
pub(crate) struct DeadMoments {
    /// Nodes with equations (from 0) and moments.
    on_nodes: Vec<(usize, DVec3)>,
    /// Their equations, row after row, each with its right-hand side last.
    rows: Vec<f64>,
}

impl DeadMoments {
    /// Replaces them.
    pub fn replace_moments(&mut self, moments: impl Iterator<Item = (usize, DVec3)>) {
        self.on_nodes.clear();
        self.on_nodes.extend(moments);
    }

    /// Nodes (from 1) and moments.
    pub fn nodal_moments(&self) -> impl Iterator<Item = (usize, DVec3)> {
        self.on_nodes.iter().copied()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.on_nodes.is_empty()
    }

    /// Writes S times the rotations of the nodes to a column of the equations.
    fn set_column(&mut self, column: usize, rotations: &[GroupIncrements]) {
        let width = 3 * self.on_nodes.len() + 1;
        for (a, (node, moment)) in self.on_nodes.iter().enumerate() {
            let turn = node_rotation(&rotations[*node]);
            let by = turn.cross(0.5 * *moment);
            for c in 0..3 {
                self.rows[(3 * a + c) * width + column] = by[c];
            }
        }
    }
}

fn node_rotation(increments: &GroupIncrements) -> DVec3 {
    let [x, y, z] = [0, 1, 2].map(|c| increments[c].0[0]);
    DVec3::new(x, y, z)
}

impl System {
    /// Includes the dead moments in the solution; false if the matrix with them is singular.
    pub(super) fn correct_for_moments(&mut self) -> bool {
        let (arch, group, dead) = (self.arch, &mut self.groups[0], &mut self.moments);
        let size = 3 * dead.on_nodes.len();
        dead.rows.resize(size * (size + 1), 0.0);
        for column in 0..size {
            let (node, axis) = (dead.on_nodes[column / 3].0, DVec3::AXES[column % 3]);
            group.set_moment_response(arch, [(node, axis)]);
            dead.set_column(column, &group.z);
            dead.rows[column * (size + 1) + column] += 1.0;
        }
        dead.set_column(size, &group.solution);
        if !solve_by_elimination(&mut dead.rows, size) {
            return false;
        }
        let part = |k: usize| dead.rows[k * (size + 1) + size];
        let taken = |(a, (node, _)): (usize, &(usize, DVec3))| {
            (
                *node,
                DVec3::new(part(3 * a), part(3 * a + 1), part(3 * a + 2)),
            )
        };
        group.set_moment_response(arch, dead.on_nodes.iter().enumerate().map(taken));
        for (solution, z) in group.solution.iter_mut().zip(&group.z) {
            for c in 0..6 {
                solution[c].0[0] -= z[c].0[0];
            }
        }
        true
    }
}

impl RodGroup {
    /// z = B^-1 times moments on nodes with equations (from 0) of the first rod.
    fn set_moment_response(
        &mut self,
        arch: Arch,
        moments: impl IntoIterator<Item = (usize, DVec3)>,
    ) {
        self.residual.fill(GroupIncrements::default());
        for (node, moment) in moments {
            for c in 0..3 {
                self.residual[node][c].0[0] += moment[c];
            }
        }
        self.matrix
            .substitute_forward(arch, &self.residual, &mut self.z);
        (self.matrix).substitute_backward(arch, &self.residual, &mut self.z);
    }
}

/// Solves `size` equations in place by Gaussian elimination with partial pivoting: the solution is
/// left in the last column. False if they are singular, or not finite.
fn solve_by_elimination(rows: &mut [f64], size: usize) -> bool {
    let width = size + 1;
    for k in 0..size {
        let below = |i: &usize| rows[i * width + k].abs();
        let Some(pivot) = (k..size).max_by(|a, b| below(a).total_cmp(&below(b))) else {
            return false;
        };
        let largest = rows[pivot * width + k];
        if largest == 0.0 || !largest.is_finite() {
            return false;
        }
        for c in k..width {
            rows.swap(pivot * width + c, k * width + c);
        }
        for i in (0..size).filter(|i| *i != k) {
            let factor = rows[i * width + k] / largest;
            for c in k..width {
                rows[i * width + c] -= factor * rows[k * width + c];
            }
        }
    }
    for k in 0..size {
        rows[k * width + size] /= rows[k * width + k];
    }
    (0..size).all(|k| rows[k * width + size].is_finite())
}
