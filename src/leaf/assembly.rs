//! Assembly of Newton's equations: unbalanced forces, matrix and energy of a leaf in a state.
//!
//! The loops over the segments of a group of rods are kernels for instructions of any width. The
//! right-hand side may also be that of a first-order change: if compliances were dropped, or if jumps
//! of the fields along the rods were removed.

use crate::leaf::block_tridiagonal::{GroupIncrements, ROTATION_UNKNOWNS, lane_rods, rod_lane};
use crate::leaf::discrete::{DiscreteLeaf, GroupLoads, LaneRodLoads, NodeLoad, group_loads};
use crate::leaf::rod_ode::FieldChange;
use crate::leaf::state::{State, add_to_increment};
use crate::leaf::system::{
    AssemblyTotals, DiagonalBlocks, RodGroup, System, each_group, group_rods,
};
use crate::numbers::{larger, largest};
use crate::rod::{
    Element, LaneNodes, LaneSections, Section, Segment, SegmentGradient, SegmentHessian, UNKNOWNS,
    Wrench, nodal_gradient,
};
use crate::rotation::{Quaternions, exp_each, multiply_each};
use crate::simd::{GROUP, GroupKernel, Lanes, NumberGroup, Vectors, run};
use glam::{DMat3, DQuat, DVec3};
use pulp::Simd;
use rayon::prelude::*;
use std::ops::Range;

impl DiscreteLeaf {
    /// Assembles matrix and right-hand side of Newton's equations into
    /// `system`.
    pub fn assemble(&self, state: &State, system: &mut System) -> AssemblyTotals {
        self.assemble_with::<true>(state, system)
    }

    /// Assembles the right-hand side alone; the matrix is unchanged.
    pub fn assemble_forces(&self, state: &State, system: &mut System) -> AssemblyTotals {
        self.assemble_with::<false>(state, system)
    }

    fn assemble_with<const MATRIX: bool>(
        &self,
        state: &State,
        system: &mut System,
    ) -> AssemblyTotals {
        let arch = system.arch;
        system.law_forces.clear();
        each_group(system.parallel, &mut system.groups, |g, group| {
            let rods = GroupRods::new(self, state, g);
            run(arch, &mut AssemblyKernel::<MATRIX> { rods, group });
        });
        let mut total = AssemblyTotals {
            energy: self.add_tissue(state, system, MATRIX)
                + self.add_own_loads(state, system)
                + self.add_levers(state, system, MATRIX)
                + self.add_springs(state, system, MATRIX)
                + self.base_energy(state),
            largest_turn: 0.0,
        };
        self.add_moments(system);
        each_group(system.parallel, &mut system.groups, |g, group| {
            for j in group_rods(g, self.rods()) {
                self.clear_held_components(j, &mut group.rhs);
                if MATRIX {
                    self.hold_components(j, &mut group.matrix);
                }
            }
        });
        if MATRIX && self.has_tissue() {
            self.clear_held_gap_blocks(system);
        }
        self.hold_spins(state, system, MATRIX);
        for group in &system.groups {
            total.energy += group.sums.energy;
            total.largest_turn = larger(total.largest_turn, group.sums.largest_turn);
        }
        total
    }

    /// Assembles the right-hand side for the first-order change if the rods had no compliance
    /// in the components `dropped` (ones and zeros).
    pub fn assemble_stiffening(&self, state: &State, dropped: DVec3, system: &mut System) {
        let arch = system.arch;
        each_group(system.parallel, &mut system.groups, |g, group| {
            let rods = GroupRods::new(self, state, g);
            let mut kernel = StiffeningKernel {
                rods,
                dropped_compliance: dropped,
                group,
            };
            run(arch, &mut kernel);
        });
        for j in 0..self.rods() {
            self.clear_held_components(j, &mut system.groups[rod_lane(j).group].rhs);
        }
        self.hold_spins(state, system, false);
    }

    /// Subtracts `times` the excess stiffness of the elements against rotations of their nodes
    /// from an assembled matrix.
    pub fn subtract_excess_stiffness(&self, state: &State, system: &mut System, times: f64) {
        let n = self.segments();
        let excess = |j: usize, i: usize| {
            let segment = self.segment(state, j, i, state.n[j * n + i]);
            0.5 * times * segment.excess_stiffness(self.section(j, i))
        };
        for j in 0..self.rods() {
            let mut before = 0.0;
            for i in 0..=n {
                let after = if i < n { excess(j, i) } else { 0.0 };
                if self.node_freedom(j, i).rotation {
                    let stiffness = DiagonalBlocks {
                        rotary: DMat3::from_diagonal(DVec3::splat(-before - after)),
                        translational: 0.0,
                    };
                    system.add_to_node(j, i, stiffness, Wrench::default());
                }
                before = after;
            }
        }
    }

    /// The state after `step` times the increments in `solution` (rod after
    /// rod, all nodes with equations), written over `next`.
    pub fn advance(&self, state: &State, solution: &System, step: f64, next: &mut State) {
        next.clone_from(state);
        if self.has_tissue() {
            self.advance_tissue(state, solution, step, next);
        }
        let (n, arch) = (self.segments(), solution.arch);
        let (nodes, forces) = (GROUP * (n + 1), GROUP * n);
        let advance = |(g, ((x, q), n)): (usize, ((&mut [_], &mut [_]), &mut [_]))| {
            let rods = GroupRods::new(self, state, g);
            let solution = &solution.groups[g].solution;
            let mut kernel = StateAdvanceKernel {
                rods,
                solution,
                step,
                x,
                q,
                n,
            };
            run(arch, &mut kernel);
        };
        match solution.parallel {
            true => (next.x.par_chunks_mut(nodes))
                .zip(next.q.par_chunks_mut(nodes))
                .zip(next.n.par_chunks_mut(forces))
                .enumerate()
                .for_each(advance),
            false => (next.x.chunks_mut(nodes))
                .zip(next.q.chunks_mut(nodes))
                .zip(next.n.chunks_mut(forces))
                .enumerate()
                .for_each(advance),
        }
        let carried = next.n.iter_mut().chain(&mut next.tissue);
        for (force, more) in carried.zip(&solution.law_forces) {
            *force += step * *more;
        }
        self.settle_spins(next);
    }

    /// Largest unbalanced nodal force or moment, or violation of the
    /// constitutive law (as length), of a state.
    pub fn residual(&self, state: &State) -> f64 {
        let n = self.segments();
        let mut largest = 0.0_f64;
        let mut tip = DVec3::ZERO;
        let tissue = self.tissue_loads(state);
        for j in 0..self.rods() {
            let on_tissue = |i: usize| tissue.get(state.base(j) + i).copied().unwrap_or_default();
            let turned = self.load_with_tissue(state, j, 0, on_tissue(0)).moment
                + self.node_moment(state, j, 0)
                + self.spring_load(state, j, 0).moment;
            let (mut force, mut moment) = (DVec3::ZERO, turned);
            for i in 0..n {
                let segment = self.segment(state, j, i, state.n[j * n + i]);
                let gradient = segment.gradient(self.section(j, i));
                if i >= self.first_node() {
                    let free = self.freedom_without_tip_support(j, i);
                    let on_node = free.of_wrench(Wrench {
                        moment: self.across_joint(state, j, i, moment - gradient.a),
                        force: force + gradient.x,
                    });
                    let unbalanced = self.unbalanced_size(j, on_node.force, on_node.moment);
                    largest = larger(largest, larger(unbalanced.force, unbalanced.moment));
                }
                let load = self.load_with_tissue(state, j, i + 1, on_tissue(i + 1));
                let springs = self.spring_load(state, j, i + 1);
                let follower = self.follower_wrench(state, j, i + 1);
                force = load.force + springs.force + follower.force - gradient.x;
                moment =
                    load.moment + springs.moment + self.node_moment(state, j, i + 1) - gradient.b;
                let gap = self.closable_gap(j, i, segment.gap);
                largest = larger(largest, largest_component(gap));
            }
            // The holder balances the remaining force on a held tip.
            let on_tip = self.node_freedom(j, n).of_wrench(Wrench { moment, force });
            let unbalanced = self.unbalanced_size(j, on_tip.force, on_tip.moment);
            match self.leaf.joined() {
                true => tip += on_tip.force,
                false => largest = larger(largest, unbalanced.force),
            }
            largest = larger(largest, unbalanced.moment);
        }
        if self.leaf.mirrored {
            tip.y = 0.0;
        }
        larger(largest, largest_component(tip))
    }

    /// Potential energy of the loads and of the coupling at the bases: none where these are in the
    /// origin, and no force acts off their axes.
    fn base_energy(&self, state: &State) -> f64 {
        let apart = |j: usize| {
            state.x[state.base(j)] != DVec3::ZERO || self.levers_on(j, 0).next().is_some()
        };
        if !(0..self.rods()).any(apart) {
            return 0.0;
        }
        let none = NodeLoad::default();
        let of = |j: usize| self.load_with_tissue(state, j, 0, none).energy;
        (0..self.rods()).map(of).sum()
    }

    /// Potential energy of a state: elastic, of the coupling, and of the loads.
    /// Dead moments on a rod have no potential and are left out.
    pub fn energy(&self, state: &State) -> f64 {
        let n = self.segments();
        let mut energy = self.base_energy(state) + self.cell_energy(state);
        for (j, i) in self.rod_index_pairs(0..1) {
            energy += self.node_strip_load(state, j, i).energy;
        }
        energy += self.spring_energy(state);
        let load = |j: usize, i: usize| {
            self.load_with_tissue(state, j, i, self.node_strip_load(state, j, i))
        };
        for j in 0..self.rods() {
            for i in 0..n {
                let segment = self.segment(state, j, i, state.n[j * n + i]);
                energy += self.section(j, i).elastic_energy(&segment) + load(j, i + 1).energy;
            }
        }
        energy
    }
}

/// The largest component of a vector, without its sign.
pub(super) fn largest_component(vector: DVec3) -> f64 {
    largest(vector.abs().to_array())
}

/// The rods of a group in a state; lanes without a rod repeat the last.
struct GroupRods<'a> {
    leaf: &'a DiscreteLeaf,
    group: usize,
    sections: [&'a [Section]; GROUP],
    x: [&'a [DVec3]; GROUP],
    q: [&'a [DQuat]; GROUP],
    n: [&'a [DVec3]; GROUP],
    /// Positions of the previous and the next rods, or their own if there is none.
    neighbor_positions: [[&'a [DVec3]; GROUP]; 2],
    loads: GroupLoads,
}

impl<'a> GroupRods<'a> {
    fn new(leaf: &'a DiscreteLeaf, state: &'a State, group: usize) -> Self {
        let (n, last) = (leaf.segments(), leaf.rods() - 1);
        let rods = lane_rods(group, leaf.rods());
        let x = |j: usize| &state.x[state.base(j)..][..=n];
        GroupRods {
            leaf,
            group,
            sections: rods.map(|j| &leaf.sections[j * n..][..n]),
            x: rods.map(x),
            q: rods.map(|j| &state.q[state.base(j)..][..=n]),
            n: rods.map(|j| &state.n[j * n..][..n]),
            neighbor_positions: [
                rods.map(|j| x(j.saturating_sub(1))),
                rods.map(|j| x((j + 1).min(last))),
            ],
            loads: group_loads(rods.map(|j| leaf.rod_load(j))),
        }
    }

    #[inline(always)]
    fn rotations<S: Simd>(&self, simd: S, i: usize, part: usize) -> Quaternions<S> {
        let [a, b, c, d] = self.q;
        let (a, b, c, d) = (a[i], b[i], c[i], d[i]);
        let vector = |q: DQuat| DVec3::new(q.x, q.y, q.z);
        let vectors = [vector(a), vector(b), vector(c), vector(d)];
        Quaternions {
            vector: Vectors::from_group(simd, vectors, part),
            scalar: Lanes::load_group(simd, &NumberGroup([a.w, b.w, c.w, d.w]), part),
        }
    }

    #[inline(always)]
    fn sections<S: Simd>(&self, simd: S, i: usize, part: usize) -> LaneSections<S> {
        let [a, b, c, d] = self.sections;
        LaneSections::from_group_sections(simd, [&a[i], &b[i], &c[i], &d[i]], part)
    }

    /// Segment `i` of every rod.
    #[inline(always)]
    fn segments<S: Simd>(&self, simd: S, i: usize, part: usize) -> LaneSegments<S> {
        let nodes = LaneNodes {
            x: [
                lane_vectors(simd, self.x, i, part),
                lane_vectors(simd, self.x, i + 1, part),
            ],
            q: [
                self.rotations(simd, i, part),
                self.rotations(simd, i + 1, part),
            ],
        };
        let sections = self.sections(simd, i, part);
        let n = lane_vectors(simd, self.n, i, part);
        LaneSegments {
            element: Element::new(&sections, &nodes, n),
            sections,
        }
    }
}

/// A segment of several rods.
struct LaneSegments<S: Simd> {
    element: Element<S>,
    sections: LaneSections<S>,
}

/// The vectors at index `i` of each rod of a group.
#[inline(always)]
fn lane_vectors<S: Simd>(simd: S, rods: [&[DVec3]; GROUP], i: usize, part: usize) -> Vectors<S> {
    let [a, b, c, d] = rods;
    Vectors::from_group(simd, [a[i], b[i], c[i], d[i]], part)
}

/// Assembles the right-hand side and the energy of a group, and the matrix if requested.
struct AssemblyKernel<'a, const MATRIX: bool> {
    rods: GroupRods<'a>,
    group: &'a mut RodGroup,
}

impl<const MATRIX: bool> GroupKernel for AssemblyKernel<'_, MATRIX> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let RodGroup {
            matrix,
            rhs,
            active_lanes: active,
            sums,
            ..
        } = &mut *self.group;
        let (rods, active) = (&self.rods, Lanes::load_group(simd, active, part));
        let zero = Lanes::splat(simd, 0.0);
        let loads = LaneRodLoads::load_group(simd, &rods.loads, part);
        let stiffness = loads.coupling_stiffness().array();
        let (mut energy, mut squared_turn) = (zero, zero);
        let (mut own, mut force) = ([[zero; UNKNOWNS]; UNKNOWNS], [zero; UNKNOWNS]);
        let (n, first) = (rods.leaf.segments(), rods.leaf.first_node());
        for i in 0..n {
            let LaneSegments { element, sections } = rods.segments(simd, i, part);
            energy = energy + element.strain_energy(&sections);
            squared_turn = squared_turn.larger_or_infinite(element.squared_turn());
            let gradient = nodal_gradient(element.condensed(&sections));
            if i >= first {
                for r in 0..UNKNOWNS {
                    let force = active * (force[r] - gradient[0][r]);
                    force.store_group(&mut rhs[i - first][r], part);
                }
            }
            if MATRIX {
                let hessian = element.hessian(&sections);
                if i >= first {
                    for r in 0..UNKNOWNS {
                        for c in r..UNKNOWNS {
                            own[r][c] = own[r][c] + hessian.diagonal_blocks[0][r][c];
                        }
                    }
                    matrix.store_node_blocks(
                        i - first,
                        &own,
                        Some(&hessian.off_diagonal_block),
                        active,
                        part,
                    );
                }
                own = hessian.diagonal_blocks[1];
            }
            let tip = i + 1 == n;
            let weights = rods.leaf.node_weights(i + 1);
            let [previous, next] = rods.neighbor_positions;
            let x = [
                lane_vectors(simd, previous, i + 1, part),
                lane_vectors(simd, rods.x, i + 1, part),
                lane_vectors(simd, next, i + 1, part),
            ];
            let loaded = loads.node_forces(x, weights, tip);
            energy = energy + loaded.energy;
            let load = loaded.force.array();
            let coupling_weight = Lanes::splat(simd, weights.coupling);
            for r in 0..UNKNOWNS {
                force[r] = -gradient[1][r];
                if r >= ROTATION_UNKNOWNS {
                    let c = r - ROTATION_UNKNOWNS;
                    force[r] = force[r] + load[c];
                    own[r][r] = stiffness[c].mul_add(coupling_weight, own[r][r]);
                }
            }
        }
        for r in 0..UNKNOWNS {
            (active * force[r]).store_group(&mut rhs[n - first][r], part);
        }
        if MATRIX {
            matrix.store_node_blocks(n - first, &own, None, active, part);
        }
        if part == 0 {
            *sums = AssemblyTotals::default();
        }
        sums.energy += energy.select_where_positive(active, zero).sum();
        sums.largest_turn = larger(sums.largest_turn, squared_turn.largest().sqrt());
    }
}

/// Assembles the right-hand side of [`DiscreteLeaf::assemble_stiffening`].
struct StiffeningKernel<'a> {
    rods: GroupRods<'a>,
    /// Ones for the components of compliance that are dropped, zeros for the others.
    dropped_compliance: DVec3,
    group: &'a mut RodGroup,
}

impl GroupKernel for StiffeningKernel<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let RodGroup {
            rhs,
            active_lanes: active,
            ..
        } = &mut *self.group;
        let active = Lanes::load_group(simd, active, part);
        let dropped = Vectors::splat(simd, self.dropped_compliance.to_array());
        let none = [Lanes::splat(simd, 0.0); UNKNOWNS];
        let (n, first) = (self.rods.leaf.segments(), self.rods.leaf.first_node());
        let mut force = none;
        for i in 0..=n {
            let gradient = match i < n {
                true => {
                    let LaneSegments { element, sections } = self.rods.segments(simd, i, part);
                    nodal_gradient(element.stiffening_gradient(&sections, dropped))
                }
                false => [none; 2],
            };
            for r in 0..UNKNOWNS {
                if i >= first {
                    let force = active * (force[r] - gradient[0][r]);
                    force.store_group(&mut rhs[i - first][r], part);
                }
                force[r] = -gradient[1][r];
            }
        }
    }
}

/// Writes the next state of a group, without clamped bases, which stay.
struct StateAdvanceKernel<'a> {
    rods: GroupRods<'a>,
    solution: &'a [GroupIncrements],
    step: f64,
    x: &'a mut [DVec3],
    q: &'a mut [DQuat],
    n: &'a mut [DVec3],
}

impl GroupKernel for StateAdvanceKernel<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let step = Lanes::splat(simd, self.step);
        let lanes = group_rods(self.rods.group, self.rods.leaf.rods()).len();
        let lanes = part..lanes.min(part + S::F64_LANES);
        let none = Vectors::splat(simd, [0.0; 3]);
        let (mut turn, mut shift) = (none, none);
        let segments = self.rods.leaf.segments();
        let ahead = self.solution.len() - segments;
        if ahead > 0 {
            turn = increment_vectors(simd, &self.solution[0], 0, part);
            self.turn_bases(turn.scale(step), lanes.clone(), part);
        }
        for (i, increment) in self.solution[ahead..].iter().enumerate() {
            let of = |c: usize| increment_vectors(simd, increment, c, part);
            let (turn_after, shift_after) = (of(0), of(3));
            let rods = &self.rods;
            let LaneSegments { element, sections } = rods.segments(simd, i, part);
            let turns = [turn, turn_after];
            let change = element.force_increment(&sections, shift_after - shift, turns);
            let n = change.mul_add(step, lane_vectors(simd, rods.n, i, part));
            let x = shift_after.mul_add(step, lane_vectors(simd, rods.x, i + 1, part));
            let turned = exp_each(turn_after.scale(step));
            let turned = multiply_each(turned, rods.rotations(simd, i + 1, part));
            let (q, qw) = (turned.vector, turned.scalar);
            let mut numbers = [NumberGroup::default(); 10];
            let [n, x, q] = [n, x, q].map(Vectors::array);
            for c in 0..3 {
                n[c].store_group(&mut numbers[c], part);
                x[c].store_group(&mut numbers[3 + c], part);
                q[c].store_group(&mut numbers[6 + c], part);
            }
            qw.store_group(&mut numbers[9], part);
            for lane in lanes.clone() {
                let [n1, n2, n3, x1, x2, x3, q1, q2, q3, qw] = numbers.map(|four| four.0[lane]);
                let node = lane * (segments + 1) + i + 1;
                self.n[lane * segments + i] = DVec3::new(n1, n2, n3);
                self.x[node] = DVec3::new(x1, x2, x3);
                self.q[node] = DQuat::from_xyzw(q1, q2, q3, qw);
            }
            (turn, shift) = (turn_after, shift_after);
        }
    }
}

impl StateAdvanceKernel<'_> {
    /// Turns the bases, which hinges hold in their places.
    #[inline(always)]
    fn turn_bases<S: Simd>(&mut self, turn: Vectors<S>, lanes: Range<usize>, part: usize) {
        let simd = turn.x.simd;
        let turned = multiply_each(exp_each(turn), self.rods.rotations(simd, 0, part));
        let (q, qw) = (turned.vector, turned.scalar);
        let mut numbers = [NumberGroup::default(); 4];
        let [x, y, z] = q.array();
        for (number, four) in [x, y, z, qw].into_iter().zip(&mut numbers) {
            number.store_group(four, part);
        }
        let nodes = self.rods.leaf.segments() + 1;
        for lane in lanes {
            self.q[lane * nodes] = DQuat::from_array(numbers.map(|four| four.0[lane]));
        }
    }
}

/// Three components of increments, from `c` on.
#[inline(always)]
fn increment_vectors<S: Simd>(simd: S, of: &GroupIncrements, c: usize, part: usize) -> Vectors<S> {
    let [x, y, z] = [&of[c], &of[c + 1], &of[c + 2]];
    Vectors::new(
        Lanes::load_group(simd, x, part),
        Lanes::load_group(simd, y, part),
        Lanes::load_group(simd, z, part),
    )
}

/// A segment with its derivatives.
pub struct SegmentTangent {
    /// The segment in its state.
    pub segment: Segment,
    /// First derivatives of Pi at fixed force.
    pub first: SegmentGradient,
    /// Second derivatives, the force condensed out.
    pub second: SegmentHessian,
}

impl DiscreteLeaf {
    /// Segment `i` of rod `j` with its derivatives.
    pub fn tangent(&self, state: &State, j: usize, i: usize) -> SegmentTangent {
        let section = self.section(j, i);
        let segment = self.segment(state, j, i, state.n[j * self.segments() + i]);
        SegmentTangent {
            first: segment.gradient(section),
            second: segment.hessian(section),
            segment,
        }
    }

    /// Assembles the right-hand side for the first-order change that removes the `jumps` of the fields
    /// of a leaf, given rod after rod at the midpoints of equal parts: the fields before a midpoint,
    /// seen from the base, minus those beyond it. `tangents` are the segments that begin at the
    /// midpoints.
    pub fn assemble_jump_correction(
        &self,
        tangents: &[Vec<SegmentTangent>],
        jumps: &[Vec<FieldChange>],
        system: &mut System,
    ) {
        let (n, first) = (self.segments(), self.first_node());
        let mut rhs = vec![vec![[0.0; 6]; self.moving_nodes().len()]; self.rods()];
        for ((rhs, rod), tangents) in rhs.iter_mut().zip(jumps).zip(tangents) {
            let part = n / rod.len();
            for (k, (jump, tangent)) in rod.iter().zip(tangents).enumerate() {
                // After the change the segment beyond the node begins where the one before it
                // ends.
                let i = k * part + part / 2;
                let (second, held) = (&tangent.second, tangent.first.a);
                let (shift, turn) = (jump.position, jump.rotation);
                let pull = second.xa * turn - second.xx * shift;
                // A moment with fixed lab components does not rotate with its node.
                let at_begin =
                    second.aa * turn - second.xa.transpose() * shift + 0.5 * turn.cross(held);
                let at_end = second.ab.transpose() * turn - second.xb.transpose() * shift;
                add_to_increment(
                    &mut rhs[i - first],
                    -at_begin - jump.moment,
                    pull - jump.force,
                );
                add_to_increment(&mut rhs[i + 1 - first], -at_end, -pull);
            }
        }
        system.set_rhs(&rhs);
        for j in 0..self.rods() {
            self.clear_held_components(j, &mut system.groups[rod_lane(j).group].rhs);
        }
        system.clear_held_spins();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::{Grid, Leaf, LinearSolveOutcome, displacement_part};
    use crate::scenario::Scenario;
    use glam::DQuat;

    const ROD: &str = r#"
        name = "rod"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        stiffness = { torsion = 2.0, bending_2 = 1.0, bending_3 = 1.0, axial = 40.0, shear_2 = 50.0, shear_3 = 60.0 }
    "#;
    const SEGMENTS: usize = 8;

    /// The displacements of a straight rod at rest, from its first node on, due to a jump at
    /// its midpoint.
    fn displacements(jump: FieldChange) -> Vec<DVec3> {
        let rod = Scenario::from_toml(ROD).unwrap();
        let leaf = DiscreteLeaf::new(&Leaf::new(&rod), Grid::new(SEGMENTS, &[]));
        let x = leaf.grid.sigma().iter().map(|&sigma| sigma * DVec3::X);
        let state = State::new(SEGMENTS, x.collect(), vec![DQuat::IDENTITY; SEGMENTS + 1]);
        let mut system = System::new(&leaf);
        leaf.assemble(&state, &mut system);
        assert!(system.factorize(0.0));
        let tangent = leaf.tangent(&state, 0, SEGMENTS / 2);
        leaf.assemble_jump_correction(&[vec![tangent]], &[vec![jump]], &mut system);
        assert!(matches!(
            system.solve(None, 1e-12),
            LinearSolveOutcome::Converged(_)
        ));
        system.solution()[0].iter().map(displacement_part).collect()
    }

    fn assert_moved(jump: FieldChange, expected: impl Fn(f64) -> DVec3) {
        for (i, found) in displacements(jump).into_iter().enumerate() {
            let expected = expected((i + 1) as f64 / SEGMENTS as f64);
            let off = (found - expected).length();
            assert!(off < 1e-12, "{jump:?}, {i}: {found} for {expected}");
        }
    }

    /// The part beyond the jump moves as a rigid body.
    #[test]
    fn behind_a_jump_the_free_part_follows() {
        let by = DVec3::new(0.1, -0.2, 0.3);
        let beyond = |sigma: f64| if sigma > 0.5 { 1.0 } else { 0.0 };
        let shifted = FieldChange {
            position: by,
            ..FieldChange::default()
        };
        assert_moved(shifted, |sigma| beyond(sigma) * by);
        let turned = FieldChange {
            rotation: by,
            ..FieldChange::default()
        };
        assert_moved(turned, |sigma| {
            beyond(sigma) * by.cross((sigma - 0.5) * DVec3::X)
        });
    }

    /// Removing a jump of force or moment is equivalent to a load of that size at the
    /// midpoint.
    #[test]
    fn before_a_jump_of_a_force_the_held_part_bends_back() {
        let force = DVec3::new(0.7, 0.0, 0.0);
        let pulled = FieldChange {
            force,
            ..FieldChange::default()
        };
        assert_moved(pulled, |sigma| -sigma.min(0.5) / 40.0 * force);
        // A cantilever of half the length under a moment M at its end: M s^2/(2 A).
        let bent = FieldChange {
            moment: DVec3::new(0.0, 0.0, 0.6),
            ..FieldChange::default()
        };
        assert_moved(bent, |sigma| {
            let s = sigma.min(0.5);
            -0.6 * (0.5 * s * s + (sigma - s) * s) * DVec3::Y
        });
    }
}
