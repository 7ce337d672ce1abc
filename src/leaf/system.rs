//! Newton's equations of a leaf, in groups of four rods, one in each lane of an instruction.
//!
//! K = B + E, where B has the block-tridiagonal matrix of each rod (with its neighbors fixed) and the
//! joint tip, and E is the coupling between neighbors. B is factorized in linear time and preconditions
//! conjugate gradients for K (`solve`), whose vectors and products with E are here.
//!
//! A dead moment M on a single rod is not conservative in three dimensions: the derivative of its
//! node's moment balance in spatial increments gains -\[M\]/2, which is skew. All dead moments together
//! have a small rank, and are included by the Sherman-Morrison-Woodbury formula: with the rotations C
//! of their nodes by unit moments on these, and the skew matrix S, the response to the moments x that
//! solve (1 + S C) x = S t is subtracted from the solution without them, which has the rotations t.

use crate::leaf::block_tridiagonal::{
    BlockTridiagonal, GroupIncrements, GroupMasses, RodLane, TipFactor, lane_increment, rod_lane,
    set_lane_increment,
};
use crate::leaf::direct::pattern::SystemPattern;
use crate::leaf::discrete::{DiscreteLeaf, NodeMass};
use crate::leaf::nodal_loads::NodalMoment;
use crate::leaf::state::{
    ComponentSet, Increment, NodalField, SpinAxes, displacement_part, rotation_part,
};
use crate::numbers::larger;
use crate::rod::{NodeBlock, Wrench};
use crate::scenario::Scenario;
use crate::simd::{GROUP, GroupKernel, Lanes, NumberGroup, widest_arch};
use glam::{DMat3, DVec3};
use pulp::{Arch, Simd};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Number of nodes from which on groups of rods are distributed over threads. Measured: with fewer
/// nodes waking the threads costs more than it saves.
const LEAST_PARALLEL_NODES: usize = 8192;

/// Sums, and a maximum, over all rods from an assembly.
#[derive(Clone, Copy, Debug, Default)]
pub struct AssemblyTotals {
    /// Potential energy: of the strains, the coupling and the loads.
    pub energy: f64,
    /// Largest rotation between the ends of a segment.
    pub largest_turn: f64,
}

/// The largest component of a rotation, in radians, and of a displacement of any node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IncrementSize {
    pub rotation: f64,
    pub displacement: f64,
}

impl IncrementSize {
    /// The larger one; infinite if one is not a number.
    pub fn larger(self) -> f64 {
        larger(self.rotation, self.displacement)
    }
}

/// The mass matrix times a field times a factor, a part of the right-hand side: momentum over the time
/// step, or the force of springs in proportion to the masses.
#[derive(Clone, Copy, Debug)]
pub struct MassLoad<'a> {
    /// Velocities, or extensions of the springs, of all nodes with equations.
    pub field: &'a [Vec<Increment>],
    /// Inverse of the time step, or rate of the springs.
    pub factor: f64,
}

/// A stiffness against motions of a node: the diagonal blocks of its matrix.
#[derive(Clone, Copy, Debug)]
pub struct DiagonalBlocks {
    /// Against rotations.
    pub rotary: DMat3,
    /// Against displacements, the same in all directions.
    pub translational: f64,
}

/// Components of the increment of a node that a hinge or grip holds.
#[derive(Clone, Debug)]
pub(super) struct HeldComponents {
    pub rod: usize,
    pub node: usize,
    pub components: ComponentSet,
}

/// E of the rods of a group: their coupling per weight with the rods before and after them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct GroupCoupling {
    previous: [NumberGroup; 3],
    next: [NumberGroup; 3],
}

/// The data of a group of rods, one rod in each lane. In a lane without a rod all increments
/// and forces are zero.
#[derive(Clone, Debug)]
pub(super) struct RodGroup {
    pub matrix: BlockTridiagonal,
    /// One in lanes with a rod, zero in others.
    pub active_lanes: NumberGroup,
    /// Right-hand side; with a joint tip, the last displacement slots hold
    /// the rods' shares of the tip's.
    pub rhs: Vec<GroupIncrements>,
    /// Solution, all nodes with equations, complete.
    pub solution: Vec<GroupIncrements>,
    pub sums: AssemblyTotals,
    /// Masses of the nodes.
    pub(super) masses: GroupMasses,
    coupling: GroupCoupling,
    /// Residual of the conjugate gradients.
    pub(super) residual: Vec<GroupIncrements>,
    /// z = B^-1 residual.
    pub(super) z: Vec<GroupIncrements>,
    /// B p for the direction p.
    pub(super) b_p: Vec<GroupIncrements>,
    /// Whether the last factorization succeeded.
    pub(super) definite: bool,
    /// Part of the group in a scalar product.
    pub(super) partial_product: f64,
}

/// The linear system of a leaf, with workspace for its solution.
#[derive(Clone, Debug)]
pub struct System {
    /// The scenario of the leaf to which these equations belong.
    scenario: Arc<Scenario>,
    pub(super) groups: Vec<RodGroup>,
    pub(super) rods: usize,
    /// Direction p of the conjugate gradients, group after group.
    pub(super) p: Vec<Vec<GroupIncrements>>,
    /// Whether all tips are one point that moves.
    pub(super) joined: bool,
    pub(super) coupled: bool,
    /// Whether groups are distributed over threads.
    pub(super) parallel: bool,
    segments: usize,
    /// The first node of a rod with equations, from which its nodes are numbered here.
    pub(super) first: usize,
    /// Weights of the nodes with equations in the masses.
    pub(super) weights: Vec<f64>,
    /// Weights of the nodes in E: zero at a joint tip and at hinged bases, which are not displaced.
    pub(super) coupling_weights: Vec<f64>,
    pub(super) arch: Arch,
    pub(super) tip: Option<TipFactor>,
    /// Coupling of every gap per weight; empty if the leaf has no coupling.
    pub(super) gaps: Vec<DVec3>,
    /// The blocks between neighboring rods, gap after gap, all nodes with equations; empty without
    /// tissue.
    pub(super) gap_blocks: Vec<NodeBlock>,
    /// The blocks between a node and the next one of the neighboring rod, and the other way, gap after
    /// gap, all nodes with equations; empty unless tissue contracts.
    pub(super) cell_blocks: Vec<[NodeBlock; 2]>,
    /// What hinges and grips hold, nodes from the first with equations: these components have no
    /// momentum.
    held_components: Vec<HeldComponents>,
    /// About which axes hinges hold bases, as of the last assembly.
    pub(super) spin_axes: SpinAxes,
    /// Spatial forces of the segments, beside those of the solution, that complete the law of nearly
    /// rigid ones; empty without any.
    pub(super) law_forces: Vec<DVec3>,
    /// Dead moments on the nodes of a single rod, as of the last assembly.
    pub(super) moments: DeadMoments,
    /// The pattern with which the matrix was first factorized as a whole.
    pub(super) pattern: SystemPattern,
}

/// The memory of Newton's equations, passed on from one solution to the next: equations of the same
/// leaf on the same grid are set up in the memory of the last ones, others in new memory.
#[derive(Debug, Default)]
pub struct EquationWorkspace {
    last: Option<System>,
}

impl EquationWorkspace {
    /// Whether the last equations were those of `leaf`.
    pub fn fits(&self, leaf: &DiscreteLeaf) -> bool {
        self.last.as_ref().is_some_and(|last| last.belongs_to(leaf))
    }

    /// Equations of `leaf` that are to be assembled, in the memory of the last ones if that fits; it
    /// is released otherwise.
    pub fn equations(&mut self, leaf: &DiscreteLeaf) -> System {
        let last = self.last.take().filter(|last| last.belongs_to(leaf));
        last.unwrap_or_else(|| System::new(leaf))
    }

    /// Takes back the memory of equations that are not needed any more.
    pub fn take_back(&mut self, system: System) {
        self.last = Some(system);
    }
}

/// Runs `f` over the groups, on all threads if `parallel`. Each group works on its
/// own data only and sums are taken in the order of the groups afterwards, so
/// that the result does not depend on the number of threads.
pub(super) fn each_group<T: Send>(
    parallel: bool,
    groups: &mut [T],
    f: impl Fn(usize, &mut T) + Sync,
) {
    if parallel {
        let groups = groups.par_iter_mut().enumerate();
        groups.for_each(|(g, group)| f(g, group));
    } else {
        let groups = groups.iter_mut().enumerate();
        groups.for_each(|(g, group)| f(g, group));
    }
}

/// The numbers of the rods of a group.
pub(super) fn group_rods(group: usize, rods: usize) -> Range<usize> {
    GROUP * group..rods.min(GROUP * (group + 1))
}

impl System {
    /// Allocates the equations of `leaf`.
    pub fn new(leaf: &DiscreteLeaf) -> Self {
        let (rods, nodes) = (leaf.rods(), leaf.moving_nodes());
        let (first, n) = (nodes.start, nodes.len());
        let joined = leaf.tips_move_together();
        let coupled = leaf.coupled() || leaf.has_tissue();
        let gaps = match leaf.coupled() {
            true => gap_couplings(leaf).collect(),
            false => Vec::new(),
        };
        let count = rods.div_ceil(GROUP);
        System {
            scenario: leaf.leaf.shared_scenario(),
            groups: (0..count).map(|g| RodGroup::new(leaf, g, &gaps)).collect(),
            rods,
            p: vec![vec![GroupIncrements::default(); n]; count],
            joined,
            coupled,
            parallel: rods * n >= LEAST_PARALLEL_NODES
                && count > 1
                && rayon::current_num_threads() > 1,
            segments: leaf.segments(),
            first,
            weights: nodes.clone().map(|i| leaf.mass_weight(i)).collect(),
            coupling_weights: nodes
                .map(|i| if i == 0 { 0.0 } else { leaf.coupling_weight(i) })
                .collect(),
            arch: widest_arch(),
            tip: None,
            gaps,
            gap_blocks: vec![
                Default::default();
                if leaf.has_tissue() { (rods - 1) * n } else { 0 }
            ],
            cell_blocks: vec![
                Default::default();
                if leaf.has_tissue_cells() {
                    (rods - 1) * n
                } else {
                    0
                }
            ],
            held_components: (0..rods)
                .flat_map(|j| {
                    let held = leaf.held_inner_components(j);
                    held.map(move |it| HeldComponents {
                        node: it.node - first,
                        ..it
                    })
                })
                .collect(),
            spin_axes: SpinAxes::default(),
            law_forces: Vec::new(),
            moments: DeadMoments::default(),
            pattern: SystemPattern(leaf.pattern.clone()),
        }
    }

    /// Updates the coupling between rods, if there is any, from a leaf that differs from the leaf of
    /// [`System::new`] only in its coupling and in what is assembled.
    pub fn set_coupling(&mut self, leaf: &DiscreteLeaf) {
        if !self.gaps.is_empty() {
            self.gaps.clear();
            self.gaps.extend(gap_couplings(leaf));
            for (g, group) in self.groups.iter_mut().enumerate() {
                group.coupling = group_coupling(group_rods(g, self.rods), &self.gaps);
            }
        }
    }

    /// Whether these are equations of `leaf`: of the same veins, supports and coupling, on the same grid.
    fn belongs_to(&self, leaf: &DiscreteLeaf) -> bool {
        let nodes = leaf.moving_nodes();
        leaf.leaf.is_from_scenario(&self.scenario)
            && (self.rods, self.segments) == (leaf.rods(), leaf.segments())
            && (self.first, self.joined) == (nodes.start, leaf.tips_move_together())
            && nodes
                .map(|i| leaf.mass_weight(i))
                .eq(self.weights.iter().copied())
            && match leaf.coupled() {
                true => gap_couplings(leaf).eq(self.gaps.iter().copied()),
                false => self.gaps.is_empty(),
            }
    }

    /// Number of rods.
    pub fn rods(&self) -> usize {
        self.rods
    }

    /// Segments of a rod.
    pub fn segments(&self) -> usize {
        self.segments
    }

    /// The first node of a rod with equations; fields begin with it.
    pub fn first_node(&self) -> usize {
        self.first
    }

    /// Number of nodes of a rod with equations.
    pub fn nodes(&self) -> usize {
        self.weights.len()
    }

    /// Whether neighbors are coupled, so that conjugate gradients are needed.
    pub fn coupled(&self) -> bool {
        self.coupled
    }

    /// Coupling of gap `g` at node `i` (from the first with equations), if there is one.
    pub(super) fn node_coupling(&self, g: usize, i: usize) -> Option<DVec3> {
        Some(*self.gaps.get(g)? * self.coupling_weights[i])
    }

    /// Mass of node `i` (from the first with equations) of rod `j`.
    pub(super) fn mass(&self, j: usize, i: usize) -> NodeMass {
        let at = rod_lane(j);
        let masses = &self.groups[at.group].masses;
        NodeMass {
            rotary: masses.rotary.0[at.lane] * self.weights[i],
            translational: masses.translational.0[at.lane] * self.weights[i],
        }
    }

    /// The right-hand side of node `i` of rod `j`; at a joint tip the rod's share.
    pub fn unbalanced_node_load(&self, j: usize, i: usize) -> Wrench {
        let at = rod_lane(j);
        let rhs = lane_increment(&self.groups[at.group].rhs[i - self.first], at.lane);
        Wrench {
            moment: rotation_part(&rhs),
            force: displacement_part(&rhs),
        }
    }

    /// Sets the right-hand side to the mass matrix times the last solution, scaled to a
    /// largest component of one: a step of inverse iteration.
    pub fn iterate_inverse(&mut self) {
        let size = self.largest_increment();
        let scale = 1.0 / size.rotation.max(size.displacement);
        let mut rhs = self.mass_product(&self.solution());
        for value in rhs.iter_mut().flatten().flatten() {
            *value *= scale;
        }
        self.set_rhs(&rhs);
    }

    /// Sets a right-hand side without symmetry, the same on all grids, as the start of inverse
    /// iteration.
    pub fn seed_inverse_iteration(&mut self) {
        // Multiples of the golden ratio are equidistributed: no symmetry, and deterministic.
        let golden = |k: usize| (k as f64 * 0.618_033_988_749_895).fract() - 0.5;
        let segments = self.segments as f64;
        let node = |j: usize, i: usize| {
            let along = (i + self.first) as f64 / segments;
            std::array::from_fn(|c| golden(12 * j + c + 1) + along * golden(12 * j + c + 7))
        };
        let rod = |j: usize| (0..self.nodes()).map(|i| node(j, i)).collect();
        let seed: NodalField = (0..self.rods).map(rod).collect();
        self.set_rhs(&self.mass_product(&seed));
    }

    /// Whether K + shift M is positive definite even without the coupling, which is positive
    /// semidefinite: then no eigenvalue is negative. Not known with tissue. Overwrites the matrix.
    pub fn is_definite_without_coupling(&mut self, shift: f64) -> bool {
        if self.has_tissue() {
            return false;
        }
        for group in &mut self.groups {
            for (i, weight) in self.coupling_weights.iter().enumerate() {
                for c in 0..3 {
                    let block = group.matrix.diagonal_entry_mut(i, 3 + c, 3 + c);
                    for (lane, value) in block.0.iter_mut().enumerate() {
                        let GroupCoupling { previous, next } = &group.coupling;
                        *value -= (previous[c].0[lane] + next[c].0[lane]) * weight;
                    }
                }
            }
        }
        self.factorize(shift)
    }

    /// The right-hand side as of the last assembly.
    pub fn rhs(&self) -> NodalField {
        self.nodal_field(|group| &group.rhs)
    }

    /// Replaces the right-hand side.
    pub fn set_rhs(&mut self, rhs: &NodalField) {
        self.set_nodal_field(rhs, |group| &mut group.rhs);
    }

    /// The last solution.
    pub fn solution(&self) -> NodalField {
        self.nodal_field(|group| &group.solution)
    }

    /// The last solution at node `i` of rod `j`.
    pub fn node_solution(&self, j: usize, i: usize) -> Increment {
        let at = rod_lane(j);
        lane_increment(&self.groups[at.group].solution[i - self.first], at.lane)
    }

    /// Replaces the last solution.
    pub fn set_solution(&mut self, increments: &NodalField) {
        self.law_forces.clear();
        self.set_nodal_field(increments, |group| &mut group.solution);
    }

    /// The increments or forces of all rods, from those of the groups.
    fn nodal_field(&self, of: impl Fn(&RodGroup) -> &Vec<GroupIncrements>) -> NodalField {
        let rod = |j: usize| {
            let at = rod_lane(j);
            let nodes = of(&self.groups[at.group]).iter();
            nodes.map(|node| lane_increment(node, at.lane)).collect()
        };
        (0..self.rods).map(rod).collect()
    }

    /// Writes increments or forces of all rods to the lanes of the groups.
    fn set_nodal_field(
        &mut self,
        field: &NodalField,
        of: impl Fn(&mut RodGroup) -> &mut Vec<GroupIncrements>,
    ) {
        for (j, rod) in field.iter().enumerate() {
            let at = rod_lane(j);
            for (node, of_rod) in of(&mut self.groups[at.group]).iter_mut().zip(rod) {
                set_lane_increment(node, at.lane, of_rod);
            }
        }
    }

    /// The mass matrix times increments.
    pub fn mass_product(&self, increments: &NodalField) -> NodalField {
        let node = |j: usize, (i, v): (usize, &Increment)| {
            let mass = self.mass(j, i);
            std::array::from_fn(|c| mass.of_component(c) * v[c])
        };
        let rods = increments.iter().enumerate();
        let mut momentum: NodalField = rods
            .map(|(j, rod)| rod.iter().enumerate().map(|of| node(j, of)).collect())
            .collect();
        for held in &self.held_components {
            for c in held.components.iter() {
                momentum[held.rod][held.node][c] = 0.0;
            }
        }
        self.spin_axes.restrict(&mut momentum);
        momentum
    }

    /// Largest rotation and largest displacement of the last solution; infinite if one is not a
    /// number.
    pub fn largest_increment(&self) -> IncrementSize {
        let mut largest = [NumberGroup::default(); 2];
        for increment in self.groups.iter().flat_map(|group| &group.solution) {
            for c in 0..6 {
                for (most, value) in largest[c / 3].0.iter_mut().zip(&increment[c].0) {
                    *most = larger(*most, value.abs());
                }
            }
        }
        let [rotation, displacement] = largest.map(|four| crate::numbers::largest(four.0));
        IncrementSize {
            rotation,
            displacement,
        }
    }

    /// Kinetic energy at unit density of the given nodal velocities.
    pub fn kinetic_energy(&self, velocity: &[Vec<Increment>]) -> f64 {
        let node = |j: usize, (i, v): (usize, &Increment)| {
            let mass = self.mass(j, i);
            0.5 * (mass.rotary * rotation_part(v).length_squared()
                + mass.translational * displacement_part(v).length_squared())
        };
        let rods = velocity.iter().enumerate();
        rods.map(|(j, rod)| rod.iter().enumerate().map(|of| node(j, of)).sum::<f64>())
            .sum()
    }

    /// Writes the velocity that corresponds to a fraction of the last solution in a time `dt`.
    pub fn write_velocity(&self, fraction: f64, dt: f64, velocity: &mut [Vec<Increment>]) {
        for (j, rod) in velocity.iter_mut().enumerate() {
            let at = rod_lane(j);
            for (v, d) in rod.iter_mut().zip(&self.groups[at.group].solution) {
                *v = lane_increment(d, at.lane).map(|d| fraction * d / dt);
            }
        }
    }
}

impl RodGroup {
    /// Allocates the equations of a group of the rods of `leaf`.
    fn new(leaf: &DiscreteLeaf, group: usize, gaps: &[DVec3]) -> Self {
        let n = leaf.moving_nodes().len();
        let zeros = vec![GroupIncrements::default(); n];
        let (mut active, mut masses) = (NumberGroup::default(), GroupMasses::default());
        for (lane, j) in group_rods(group, leaf.rods()).enumerate() {
            active.0[lane] = 1.0;
            let mass = leaf.mass_per_weight(j);
            masses.rotary.0[lane] = mass.rotary;
            masses.translational.0[lane] = mass.translational;
        }
        RodGroup {
            matrix: BlockTridiagonal::new(n, leaf.tips_move_together()),
            active_lanes: active,
            rhs: zeros.clone(),
            solution: zeros.clone(),
            sums: AssemblyTotals::default(),
            masses,
            coupling: group_coupling(group_rods(group, leaf.rods()), gaps),
            residual: zeros.clone(),
            z: zeros.clone(),
            b_p: zeros,
            definite: false,
            partial_product: 0.0,
        }
    }
}

impl System {
    /// Adds a stiffness and a load to the equations of node `i` of rod `j`.
    pub fn add_to_node(&mut self, j: usize, i: usize, stiffness: DiagonalBlocks, load: Wrench) {
        let RodLane { group, lane } = rod_lane(j);
        let (at, group) = (i - self.first, &mut self.groups[group]);
        let chain = &mut group.matrix;
        let increment = &mut group.rhs[at];
        for c in 0..3 {
            for r in 0..=c {
                chain.diagonal_entry_mut(at, r, c).0[lane] += stiffness.rotary.col(c)[r];
            }
            chain.diagonal_entry_mut(at, 3 + c, 3 + c).0[lane] += stiffness.translational;
            increment[c].0[lane] += load.moment[c];
            increment[3 + c].0[lane] += load.force[c];
        }
    }

    /// Adds a spring's `stiffness` to the matrix at node `i` of rod `j`, against its
    /// displacement.
    pub fn add_displacement_spring(&mut self, j: usize, i: usize, stiffness: DMat3) {
        let RodLane { group, lane } = rod_lane(j);
        let (at, chain) = (i - self.first, &mut self.groups[group].matrix);
        for c in 0..3 {
            for r in 0..=c {
                chain.diagonal_entry_mut(at, 3 + r, 3 + c).0[lane] += stiffness.col(c)[r];
            }
        }
    }

    /// Adds a spring's `stiffness` to the matrix at node `i` of rod `j`, against its rotation.
    pub fn add_rotation_spring(&mut self, j: usize, i: usize, stiffness: DMat3) {
        let against_rotation = DiagonalBlocks {
            rotary: stiffness,
            translational: 0.0,
        };
        self.add_to_node(j, i, against_rotation, Wrench::default());
    }

    /// Adds to the matrix, at node `i` of rod `j`, what couples its rotation (rows) and its displacement.
    pub fn add_rotation_displacement_coupling(&mut self, j: usize, i: usize, coupling: DMat3) {
        let RodLane { group, lane } = rod_lane(j);
        let (at, chain) = (i - self.first, &mut self.groups[group].matrix);
        for c in 0..3 {
            for r in 0..3 {
                chain.diagonal_entry_mut(at, r, 3 + c).0[lane] += coupling.col(c)[r];
            }
        }
    }

    /// Adds `stiffness` to the matrix between the displacements of nodes `i` and `i` + 1 of
    /// rod `j`.
    pub fn add_adjacent_node_spring(&mut self, j: usize, i: usize, stiffness: DMat3) {
        let RodLane { group, lane } = rod_lane(j);
        let (at, chain) = (i - self.first, &mut self.groups[group].matrix);
        for c in 0..3 {
            for r in 0..3 {
                chain.off_diagonal_entry_mut(at, 3 + r, 3 + c).0[lane] += stiffness.col(c)[r];
            }
        }
    }
}

/// Coupling of every gap per weight.
fn gap_couplings(leaf: &DiscreteLeaf) -> impl Iterator<Item = DVec3> {
    let gap = move |g: usize| {
        // A node in the mirror plane is not displaced across it.
        let free = match leaf.leaf.is_halved_midrib(g) {
            true => DVec3::new(1.0, 0.0, 1.0),
            false => DVec3::ONE,
        };
        free * leaf.coupling(g - 1)
    };
    (1..leaf.rods()).map(gap)
}

/// E of the rods of a group, from the coupling of all gaps.
fn group_coupling(rods: Range<usize>, gaps: &[DVec3]) -> GroupCoupling {
    let mut coupling = GroupCoupling::default();
    let gap = |g: usize| gaps.get(g).copied().unwrap_or_default();
    for (lane, j) in rods.enumerate() {
        let (before, after) = (gap(j.wrapping_sub(1)), gap(j));
        for c in 0..3 {
            coupling.previous[c].0[lane] = before[c];
            coupling.next[c].0[lane] = after[c];
        }
    }
    coupling
}

/// The operands of E p.
#[derive(Clone, Copy)]
pub(super) struct CouplingOperator<'a> {
    /// The direction p of all groups.
    pub p: &'a [Vec<GroupIncrements>],
    /// Number of the group of which E p is taken.
    pub group: usize,
    /// Weights of the nodes in E.
    pub weights: &'a [f64],
}

impl CouplingOperator<'_> {
    /// Component `c` of the displacement part of E p at node `i`.
    #[inline(always)]
    fn coupling_product<S: Simd>(
        self,
        simd: S,
        i: usize,
        c: usize,
        coupling: &GroupCoupling,
        part: usize,
    ) -> Lanes<S> {
        let at = |group: usize, lane: usize| match self.p.get(group) {
            Some(p) => p[i][3 + c].0[lane],
            None => 0.0,
        };
        let own = self.p[self.group][i][3 + c].0;
        let first = at(self.group.wrapping_sub(1), GROUP - 1);
        let last = at(self.group + 1, 0);
        let previous = NumberGroup([first, own[0], own[1], own[2]]);
        let next = NumberGroup([own[1], own[2], own[3], last]);
        let pull = Lanes::load_group(simd, &coupling.previous[c], part)
            * Lanes::load_group(simd, &previous, part);
        let next = Lanes::load_group(simd, &next, part);
        let pull = next.mul_add(Lanes::load_group(simd, &coupling.next[c], part), pull);
        Lanes::splat(simd, -self.weights[i]) * pull
    }

    /// Component `c` of (B + E) p at node `i` of its group.
    #[inline(always)]
    fn matrix_product<S: Simd>(
        self,
        simd: S,
        of: &RodGroup,
        i: usize,
        c: usize,
        part: usize,
    ) -> Lanes<S> {
        let b_p = Lanes::load_group(simd, &of.b_p[i][c], part);
        match c.checked_sub(3) {
            Some(c) => b_p + self.coupling_product(simd, i, c, &of.coupling, part),
            None => b_p,
        }
    }
}

/// Sums p . (B + E) p over a group.
pub(super) struct CurvatureKernel<'a> {
    pub group: &'a RodGroup,
    pub coupled: CouplingOperator<'a>,
    pub product: NumberGroup,
}

impl GroupKernel for CurvatureKernel<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let mut sum = Lanes::splat(simd, 0.0);
        let p = &self.coupled.p[self.coupled.group];
        for (i, p) in p.iter().enumerate() {
            for c in 0..6 {
                let k_p = self.coupled.matrix_product(simd, self.group, i, c, part);
                sum = k_p.mul_add(Lanes::load_group(simd, &p[c], part), sum);
            }
        }
        sum.store_group(&mut self.product, part);
    }
}

/// A step of the conjugate gradients: solution += alpha p, residual -= alpha (B + E) p.
pub(super) struct SolutionUpdateKernel<'a> {
    pub group: &'a mut RodGroup,
    pub coupled: CouplingOperator<'a>,
    pub alpha: f64,
}

impl GroupKernel for SolutionUpdateKernel<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let alpha = Lanes::splat(simd, self.alpha);
        let p = &self.coupled.p[self.coupled.group];
        for i in 0..p.len() {
            for c in 0..6 {
                let k_p = self.coupled.matrix_product(simd, self.group, i, c, part);
                let solution = &mut self.group.solution[i][c];
                let residual = &mut self.group.residual[i][c];
                let p = Lanes::load_group(simd, &p[i][c], part);
                p.mul_add(alpha, Lanes::load_group(simd, solution, part))
                    .store_group(solution, part);
                k_p.neg_mul_add(alpha, Lanes::load_group(simd, residual, part))
                    .store_group(residual, part);
            }
        }
    }
}

/// The next direction of the conjugate gradients: p = z + beta p, B p = residual + beta B p.
pub(super) struct DirectionUpdateKernel<'a> {
    pub group: &'a mut RodGroup,
    pub p: &'a mut [GroupIncrements],
    pub beta: f64,
}

impl GroupKernel for DirectionUpdateKernel<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let beta = Lanes::splat(simd, self.beta);
        let RodGroup {
            z, residual, b_p, ..
        } = &mut *self.group;
        for i in 0..z.len() {
            for c in 0..6 {
                for (old, new) in [
                    (&mut self.p[i][c], &z[i][c]),
                    (&mut b_p[i][c], &residual[i][c]),
                ] {
                    let new = Lanes::load_group(simd, new, part);
                    Lanes::load_group(simd, old, part)
                        .mul_add(beta, new)
                        .store_group(old, part);
                }
            }
        }
    }
}

/// The dead moments as of the last assembly, with the workspace of their equations.
#[derive(Clone, Debug, Default)]
pub(super) struct DeadMoments {
    /// The moments; nodes from the first with equations.
    on_nodes: Vec<NodalMoment>,
    /// The equations (1 + S C) x = S t, row after row, each with its right-hand side last.
    rows: Vec<f64>,
}

impl DeadMoments {
    /// Replaces all moments; nodes from the first with equations.
    pub fn replace_moments(&mut self, moments: impl Iterator<Item = NodalMoment>) {
        self.on_nodes.clear();
        self.on_nodes.extend(moments);
    }

    /// The moments; nodes from the first with equations.
    pub fn nodal_moments(&self) -> impl Iterator<Item = NodalMoment> {
        self.on_nodes.iter().copied()
    }

    /// Whether no dead moment acts.
    pub fn is_empty(&self) -> bool {
        self.on_nodes.is_empty()
    }

    /// Writes S times the rotations of the nodes to a column of the equations.
    fn set_column(&mut self, column: usize, rotations: &[GroupIncrements]) {
        let width = 3 * self.on_nodes.len() + 1;
        for (a, it) in self.on_nodes.iter().enumerate() {
            let turn = node_rotation(&rotations[it.node]);
            let by = turn.cross(0.5 * it.moment);
            for c in 0..3 {
                self.rows[(3 * a + c) * width + column] = by[c];
            }
        }
    }
}

/// The rotation of a node of the only rod.
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
            let unit = NodalMoment {
                node: dead.on_nodes[column / 3].node,
                moment: DVec3::AXES[column % 3],
            };
            group.set_moment_response(arch, [unit]);
            dead.set_column(column, &group.z);
            dead.rows[column * (size + 1) + column] += 1.0;
        }
        dead.set_column(size, &group.solution);
        if !solve_by_elimination(&mut dead.rows, size) {
            return false;
        }
        let x = |k: usize| dead.rows[k * (size + 1) + size];
        let correction = |(a, it): (usize, &NodalMoment)| NodalMoment {
            node: it.node,
            moment: DVec3::new(x(3 * a), x(3 * a + 1), x(3 * a + 2)),
        };
        group.set_moment_response(arch, dead.on_nodes.iter().enumerate().map(correction));
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
    fn set_moment_response(&mut self, arch: Arch, moments: impl IntoIterator<Item = NodalMoment>) {
        self.residual.fill(GroupIncrements::default());
        for NodalMoment { node, moment } in moments {
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
