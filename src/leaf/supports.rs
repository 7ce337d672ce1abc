//! Nodes that are held: bases, tips, and nodes in grips; the forces and moments on what holds them;
//! and the components of increments that are zero there, or in the mirror plane of half a leaf.
//!
//! Veins that can turn without resistance
//! ([`Scenario::zero_energy_rotations`](crate::scenario::Scenario::zero_energy_rotations)) have an
//! eigenvalue that is exactly zero, on every grid, unless they are straight and clamped. A spring that
//! holds one node in the direction in which it would move is a phase condition. As forces do no work in
//! a turn, the equations with the spring have the same solutions, in which the spring has no force, and
//! the matrix has as many negative eigenvalues as that of the leaf, and no zero for the turn.

use crate::leaf::assembly::largest_component;
use crate::leaf::block_tridiagonal::{BlockTridiagonal, GroupIncrements, rod_lane};
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{ComponentSet, NodalField, NodeIncrement, SpinAxes, State};
use crate::leaf::system::{HeldComponents, System};
use crate::leaf::{GrippedNode, Leaf};
use crate::rod::{UNKNOWNS, Wrench};
use crate::rotation::{Pose, outer};
use crate::scenario::{BaseRotations, SupportKind, ZeroEnergyRotation};
use crate::simd::NumberGroup;
use glam::{BVec3, DVec3};
use std::borrow::Cow;

/// Whether supports allow a node to rotate, and along which lab axes to be displaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeFreedom {
    pub rotation: bool,
    pub displacement: BVec3,
}

impl NodeFreedom {
    /// The freedom of a node without support.
    pub const FREE: NodeFreedom = NodeFreedom {
        rotation: true,
        displacement: BVec3::TRUE,
    };

    /// Whether the node is clamped.
    pub fn is_fixed(self) -> bool {
        !self.rotation && !self.displacement.any()
    }

    /// The components of a displacement, or of a force, along the axes along which the node is free.
    pub fn of_displacement(self, vector: DVec3) -> DVec3 {
        DVec3::select(self.displacement, vector, DVec3::ZERO)
    }

    /// What no support balances of a force and a moment on the node.
    pub fn of_wrench(self, on_node: Wrench) -> Wrench {
        Wrench {
            moment: if self.rotation {
                on_node.moment
            } else {
                DVec3::ZERO
            },
            force: self.of_displacement(on_node.force),
        }
    }

    /// The components of the node's increment that are zero.
    fn held_components(self) -> ComponentSet {
        let mut held = ComponentSet::NONE;
        if !self.rotation {
            held = held | ComponentSet::ROTATION;
        }
        for axis in 0..3 {
            if !self.displacement.test(axis) {
                held = held | ComponentSet::displacement_along(axis);
            }
        }
        held
    }
}

/// The unbalanced force and moment on a node, each by its largest component.
pub(super) struct UnbalancedSize {
    pub force: f64,
    pub moment: f64,
}

impl DiscreteLeaf {
    /// Sets the nodes of grips.
    pub(super) fn set_gripped_nodes(&mut self, natural: &State) {
        self.grips = self.find_gripped_nodes(natural);
        self.grip_of_node = Vec::new();
        if !self.grips.is_empty() {
            self.grip_of_node = vec![None; self.rods() * (self.segments() + 1)];
        }
        for (number, held) in self.grips.iter().enumerate().rev() {
            self.grip_of_node[natural.base(held.rod) + held.node] = Some(number);
        }
    }

    /// The nodes of grips: where they are in the stress-free state `natural`, moved by the displacements of
    /// the grips.
    fn find_gripped_nodes(&self, natural: &State) -> Vec<GrippedNode> {
        let length = self.leaf.scale.length;
        let each = self.leaf.scenario().grips.iter().enumerate();
        let nodes = each.flat_map(|(number, grip)| {
            let [from, to] = grip.at.map(|sigma| self.grid.nearest_node(sigma));
            let moved = DVec3::from_array(grip.displacement) / length;
            (from..=to).map(move |node| {
                let k = natural.base(grip.vein) + node;
                GrippedNode {
                    grip: number,
                    rod: grip.vein,
                    node,
                    position: natural.x[k] + moved,
                    held_axes: BVec3::from_array(grip.rigid_axes()),
                    rotation: grip.holds_directions().then_some(natural.q[k]),
                }
            })
        });
        nodes.collect()
    }

    /// Whether grips hold nodes.
    pub fn has_grips(&self) -> bool {
        !self.grips.is_empty()
    }

    /// The nodes of rod `j` that grips hold.
    pub fn rod_grips(&self, j: usize) -> impl Iterator<Item = &GrippedNode> {
        self.grips.iter().filter(move |held| held.rod == j)
    }

    /// What bases and grips hold of the nodes of rod `j` with equations.
    pub(super) fn held_inner_components(&self, j: usize) -> impl Iterator<Item = HeldComponents> {
        let held = move |node: usize| HeldComponents {
            rod: j,
            node,
            components: self.freedom_without_tip_support(j, node).held_components(),
        };
        let base = (0..1).filter(|_| self.leaf.hinged());
        base.chain(self.rod_grips(j).map(|grip| grip.node))
            .map(held)
    }

    /// What base and grips allow to node `i` of rod `j`.
    pub(super) fn freedom_without_tip_support(&self, j: usize, i: usize) -> NodeFreedom {
        if i == 0 {
            return NodeFreedom {
                rotation: self.leaf.base_turns(j),
                displacement: BVec3::FALSE,
            };
        }
        let number = self.grip_of_node.get(j * (self.segments() + 1) + i);
        match number.and_then(|number| self.grips.get((*number)?)) {
            Some(held) => NodeFreedom {
                rotation: held.rotation.is_none(),
                displacement: !held.held_axes,
            },
            None => NodeFreedom::FREE,
        }
    }

    /// What all supports allow to node `i` of rod `j`.
    pub fn node_freedom(&self, j: usize, i: usize) -> NodeFreedom {
        match &self.leaf.tip_support {
            Some(held) if i == self.segments() => NodeFreedom {
                rotation: held.clamps.is_none(),
                displacement: BVec3::FALSE,
            },
            _ if i > 0 && self.grips.is_empty() => NodeFreedom::FREE,
            _ => self.freedom_without_tip_support(j, i),
        }
    }

    /// Puts tips and nodes where they are held.
    pub fn place_held_nodes(&self, state: &mut State) {
        self.leaf.place_held_tips(state);
        for held in &self.grips {
            let k = state.base(held.rod) + held.node;
            state.x[k] = DVec3::select(held.held_axes, held.position, state.x[k]);
            if let Some(rotation) = held.rotation {
                state.q[k] = rotation;
            }
        }
    }

    /// Force on every grip, and the moment about its middle if it is clamped.
    pub fn grip_reactions(&self, state: &State) -> Vec<Wrench> {
        let grips = &self.leaf.scenario().grips;
        // Of nodes that slide or give, the middle of where they are.
        let middle = |number: usize| {
            let held = self.grips.iter().filter(|it| it.grip == number);
            let (sum, count) = held.fold((DVec3::ZERO, 0.0), |(sum, count), it| {
                let x = state.x[state.base(it.rod) + it.node];
                (sum + x, count + 1.0)
            });
            sum / count
        };
        let middles: Vec<DVec3> = (0..grips.len()).map(middle).collect();
        let mut reactions = vec![Wrench::default(); grips.len()];
        let mut add = |grip: usize, at: DVec3, load: Wrench, turns: bool| {
            let on_grip = &mut reactions[grip];
            on_grip.force += load.force;
            if grips[grip].held == SupportKind::Clamped {
                on_grip.moment += (at - middles[grip]).cross(load.force);
            }
            if turns {
                on_grip.moment += load.moment;
            }
        };
        for held in &self.grips {
            let load = self.unbalanced_node_load(state, held.rod, held.node);
            let free = self.freedom_without_tip_support(held.rod, held.node);
            let on_grip = Wrench {
                force: load.force - free.of_displacement(load.force),
                moment: load.moment,
            };
            let k = state.base(held.rod) + held.node;
            add(held.grip, state.x[k], on_grip, held.rotation.is_some());
        }
        for spring in self.springs.iter() {
            if let Some(grip) = spring.grip {
                let k = state.base(spring.rod) + spring.node;
                let (force, moment) = (spring.force(state.x[k]), spring.moment(state.q[k]));
                let on_grip = Wrench {
                    force: -force,
                    moment: -moment,
                };
                add(grip, state.x[k], on_grip, spring.turn_stiffness > 0.0);
            }
        }
        reactions
    }

    /// What every rod exerts on the support of its base: the force, and the moment about the base, which
    /// of a hinge is zero, what is about the axis of one that holds the spin, or that of its spring.
    pub fn base_reactions(&self, state: &State) -> Vec<Wrench> {
        (0..self.rods())
            .map(|j| self.support_load(state, j, 0))
            .collect()
    }

    /// What rod `j` exerts on the support of its node `i`, as of [`DiscreteLeaf::base_reactions`].
    pub fn support_load(&self, state: &State, j: usize, i: usize) -> Wrench {
        let own = self.unbalanced_node_load(state, j, i);
        if i > 0 {
            return own;
        }
        let tissue = self.rigid_end_load(state, j, 0);
        Wrench {
            force: own.force + tissue.force,
            moment: match self.leaf.base_turns(j) {
                true if self.leaf.holds_base_spin(j) => {
                    let moment = own.moment + tissue.moment;
                    moment - self.across_joint(state, j, 0, moment)
                }
                true => -self.spring_load(state, j, 0).moment,
                false => own.moment + tissue.moment + self.dead_moment_on_clamp(),
            },
        }
    }

    /// The forces on all supports that are placed: on the holder of the tips, if any, and on every grip.
    pub fn support_forces(&self, state: &State) -> Vec<DVec3> {
        let tips = self
            .leaf
            .tip_support
            .as_ref()
            .map(|_| self.reaction(state).force);
        let grips = match self.has_grips() {
            true => self.grip_reactions(state),
            false => Vec::new(),
        };
        let grips = grips.into_iter().map(|on_grip| on_grip.force);
        tips.into_iter().chain(grips).collect()
    }

    /// Moment and force on node `i` of rod `j` by its segments, loads and neighbors.
    pub(super) fn unbalanced_node_load(&self, state: &State, j: usize, i: usize) -> Wrench {
        let n = self.segments();
        let gradient = |i: usize| {
            let segment = self.segment(state, j, i, state.n[j * n + i]);
            segment.gradient(self.section(j, i))
        };
        let load = self.load(state, j, i);
        let follower = self.follower_wrench(state, j, i);
        let mut moment = load.moment + self.node_moment(state, j, i);
        let mut force = load.force + follower.force;
        if i > 0 {
            let before = gradient(i - 1);
            (moment, force) = (moment - before.b, force - before.x);
        }
        if i < n {
            let after = gradient(i);
            (moment, force) = (moment - after.a, force + after.x);
        }
        Wrench { moment, force }
    }
}

/// The entry on the diagonal of held components: with the masses of nodes within a vein it is a
/// frequency above all others.
const HELD_DIAGONAL_ENTRY: f64 = 1e9;

impl DiscreteLeaf {
    /// The components that are zero in the increments of node `i` of rod `j`.
    fn held_components(&self, j: usize, i: usize) -> ComponentSet {
        if i == 0 || !self.grips.is_empty() {
            let held = self.freedom_without_tip_support(j, i).held_components();
            if held != ComponentSet::NONE {
                return held;
            }
        }
        if let Some(held) = self
            .leaf
            .tip_support
            .as_ref()
            .filter(|_| i == self.segments())
        {
            match held.clamps {
                Some(_) => ComponentSet::ROTATION | ComponentSet::DISPLACEMENT,
                None => ComponentSet::DISPLACEMENT,
            }
        } else if self.leaf.is_halved_midrib(j) {
            ComponentSet::ACROSS_MIRROR
        } else if self.leaf.mirrored && self.leaf.joined() && i == self.segments() {
            ComponentSet::ACROSS_MIRROR & ComponentSet::DISPLACEMENT
        } else {
            ComponentSet::NONE
        }
    }

    /// The first node with equations that may be held.
    fn first_held(&self) -> usize {
        match (self.leaf.mirrored, &self.leaf.tip_support) {
            _ if self.leaf.hinged() || !self.grips.is_empty() => self.first_node(),
            (true, _) => self.first_node(),
            (false, Some(_)) => self.segments(),
            (false, None) => self.segments() + 1,
        }
    }

    /// Sets the held components of rod `j` to zero in the right-hand side of its
    /// group.
    pub(super) fn clear_held_components(&self, j: usize, rhs: &mut [GroupIncrements]) {
        for i in self.first_held()..self.segments() + 1 {
            let rhs = &mut rhs[i - self.first_node()];
            for c in self.held_components(j, i).iter() {
                rhs[c].0[rod_lane(j).lane] = 0.0;
            }
        }
    }

    /// Sets the held components of increments of the nodes, or of forces on them, to zero, where hinges hold the bases
    /// about these axes.
    pub fn zero_held_components(&self, spins: &SpinAxes, field: &mut NodalField) {
        spins.restrict(field);
        for (j, i) in self.rod_index_pairs(self.first_held()..self.segments() + 1) {
            for c in self.held_components(j, i).iter() {
                field[j][i - self.first_node()][c] = 0.0;
            }
        }
    }

    /// Replaces rows and columns of the held components of rod `j` in the matrix by those of
    /// the identity, which makes them zero.
    pub(super) fn hold_components(&self, j: usize, chain: &mut BlockTridiagonal) {
        let set = |four: &mut NumberGroup, value: f64| four.0[rod_lane(j).lane] = value;
        for i in self.first_held()..self.segments() + 1 {
            let at = i - self.first_node();
            for c in self.held_components(j, i).iter() {
                for k in 0..UNKNOWNS {
                    set(chain.diagonal_entry_mut(at, c.min(k), c.max(k)), 0.0);
                    set(chain.off_diagonal_entry_mut(at, c, k), 0.0);
                    if at > 0 {
                        set(chain.off_diagonal_entry_mut(at - 1, k, c), 0.0);
                    }
                }
                let gripped = self.freedom_without_tip_support(j, i) != NodeFreedom::FREE;
                set(
                    chain.diagonal_entry_mut(at, c, c),
                    if gripped { HELD_DIAGONAL_ENTRY } else { 1.0 },
                );
            }
        }
    }

    /// Sets the entries of held components between neighboring rods to zero.
    pub(super) fn clear_held_gap_blocks(&self, system: &mut System) {
        for (g, i) in self.rod_index_pairs(self.first_held()..self.segments() + 1) {
            if g + 1 < self.rods() {
                let across = system.gap_block_mut(g, i - self.first_node());
                for c in self.held_components(g, i).iter() {
                    across[c] = [0.0; UNKNOWNS];
                }
                for c in self.held_components(g + 1, i).iter() {
                    across.iter_mut().for_each(|row| row[c] = 0.0);
                }
                self.clear_held_cell_blocks(system, g, i);
            }
        }
    }

    /// Sets the entries of held components of the nodes of a gap at `i` to zero in the blocks to the nodes
    /// before and after.
    fn clear_held_cell_blocks(&self, system: &mut System, g: usize, i: usize) {
        let at = i - self.first_node();
        let [own, other] = [g, g + 1].map(|rod| self.held_components(rod, i));
        if let Some([ahead, crossing]) = system.cell_blocks_mut(g, at) {
            own.iter().for_each(|c| ahead[c] = [0.0; UNKNOWNS]);
            for c in other.iter() {
                crossing.iter_mut().for_each(|row| row[c] = 0.0);
            }
        }
        let before = at.checked_sub(1);
        if let Some([ahead, crossing]) = before.and_then(|at| system.cell_blocks_mut(g, at)) {
            own.iter().for_each(|c| crossing[c] = [0.0; UNKNOWNS]);
            for c in other.iter() {
                ahead.iter_mut().for_each(|row| row[c] = 0.0);
            }
        }
    }

    /// The size of an unbalanced force and moment on a node of rod `j`, without the components that
    /// the mirror image balances.
    pub(super) fn unbalanced_size(&self, j: usize, force: DVec3, moment: DVec3) -> UnbalancedSize {
        match self.leaf.is_halved_midrib(j) {
            true => UnbalancedSize {
                force: largest_component(force.with_y(0.0)),
                moment: moment.y.abs(),
            },
            false => UnbalancedSize {
                force: largest_component(force),
                moment: largest_component(moment),
            },
        }
    }
}

impl Leaf {
    /// Puts the bases where the leaf begins.
    pub fn place_bases(&self, state: &mut State) {
        for j in 0..self.rods() {
            let (base, pose) = (state.base(j), self.base_pose(j));
            (state.x[base], state.q[base]) = (pose.position, pose.rotation);
        }
    }

    /// Puts the bases where they are held: clamped ones in their directions, too, those whose spin is held in the next
    /// frame that their hinges allow.
    pub fn place_held_bases(&self, state: &mut State) {
        for j in 0..self.rods() {
            let (base, pose) = (state.base(j), self.base_pose(j));
            state.x[base] = pose.position;
            if !self.base_turns(j) {
                state.q[base] = pose.rotation;
            }
            if let Some(joint) = self.base_joint(j) {
                state.q[base] = joint.settled(state.q[base]);
            }
        }
    }

    /// Puts the tips where they are held, if they are.
    pub fn place_held_tips(&self, state: &mut State) {
        let Some(held) = &self.tip_support else {
            return;
        };
        for j in 0..self.rods() {
            let tip = state.base(j) + state.segments();
            state.x[tip] = held.position;
            if let Some(rotation) = held.rotation(j) {
                state.q[tip] = rotation;
            }
        }
    }
}

/// Stiffness of the spring of a phase condition: A/L^3 against a displacement, A/L against a rotation.
/// It moves one eigenvalue from zero, and no solution.
const PHASE_SPRING_STIFFNESS: f64 = 100.0;

/// Largest displacement per angle, in lengths per radian, of a node on the axis of a turn, by
/// rounding. Straight veins do not move when they turn.
const AXIS_SPEED_TOLERANCE: f64 = 1e-6;

/// The node whose motion in a turn without resistance a phase condition suppresses.
struct PhaseConditionNode {
    rod: usize,
    node: usize,
    /// The direction in which the node is displaced or, if zero, that in which it rotates.
    direction: NodeIncrement,
}

impl DiscreteLeaf {
    /// The turns without resistance, whatever the state: of half of a mirror-symmetric leaf the turns
    /// of veins whose images turn the other way.
    fn zero_energy_rotations(&self) -> impl Iterator<Item = &ZeroEnergyRotation> {
        let moves = |j: usize| j < self.rods() && !self.leaf.is_halved_midrib(j);
        let half = self.leaf.is_mirror_half();
        (self.leaf.zero_energy_rotations.iter())
            .filter(move |it| !half || it.rods.clone().all(moves))
    }

    /// The rotation and the displacement of a node by a turn at unit rate.
    fn zero_energy_increment(
        &self,
        turning: &ZeroEnergyRotation,
        state: &State,
        k: usize,
    ) -> NodeIncrement {
        let length = self.leaf.scale.length;
        let rod = k / (state.segments() + 1);
        let node = Pose {
            position: state.x[k],
            rotation: state.q[k],
        };
        let base = state.q[state.base(rod)];
        let [rotation, displacement] = turning.node_velocity(node, rod, base, length);
        NodeIncrement {
            rotation,
            displacement,
        }
    }

    /// The node of the phase condition: the one that is displaced most or, where sections spin, the
    /// base; not a joint tip, which all rods share. `None` where a turn moves nothing.
    fn phase_condition_node(
        &self,
        turning: &ZeroEnergyRotation,
        state: &State,
    ) -> Option<PhaseConditionNode> {
        if turning.axis == DVec3::ZERO {
            let rod = turning.rods.start;
            let points = &state.x[state.base(rod)..][..=self.segments()];
            let spin = self.zero_energy_increment(turning, state, state.base(rod));
            let moves = turning.moves_something(points, DVec3::ZERO, AXIS_SPEED_TOLERANCE);
            return moves.then_some(PhaseConditionNode {
                rod,
                node: 0,
                direction: NodeIncrement {
                    displacement: DVec3::ZERO,
                    ..spin
                },
            });
        }
        let last = self.segments() - usize::from(self.tips_move_together());
        let mut farthest = None;
        let mut most = AXIS_SPEED_TOLERANCE;
        for (rod, node) in rotating_nodes(turning, last) {
            let turn = self.zero_energy_increment(turning, state, state.base(rod) + node);
            let speed = turn.displacement;
            if speed.length() > most {
                most = speed.length();
                farthest = Some(PhaseConditionNode {
                    rod,
                    node,
                    direction: NodeIncrement {
                        rotation: DVec3::ZERO,
                        displacement: speed / most,
                    },
                });
            }
        }
        farthest
    }

    /// Adds the phase conditions of veins that can turn to an assembled matrix.
    pub fn add_phase_conditions(&self, state: &State, system: &mut System) {
        for turning in self.zero_energy_rotations() {
            if let Some(at) = self.phase_condition_node(turning, state) {
                let NodeIncrement {
                    rotation,
                    displacement,
                } = at.direction;
                let [turn, shift] =
                    [rotation, displacement].map(|d| PHASE_SPRING_STIFFNESS * outer(d, d));
                system.add_displacement_spring(at.rod, at.node, shift);
                system.add_rotation_spring(at.rod, at.node, turn);
            }
        }
    }

    /// Turns veins that can turn without resistance to one equilibrium of a circle of them, the same on
    /// all grids: clamped veins until their moment at the base bends them down (towards -e3); veins on
    /// hinges as near as possible to where they begin in the stress-free leaf, or down; and a vein that
    /// spins without a twist from there.
    pub fn rotate_to_representative(&self, state: &mut State) {
        for turning in self.zero_energy_rotations() {
            if turning.axis == DVec3::ZERO && self.phase_condition_node(turning, state).is_none() {
                continue;
            }
            let rods = &turning.rods;
            let moment = |j: usize| {
                let n = state.n[j * self.segments()];
                let segment = self.segment(state, j, 0, n);
                -segment.gradient(self.section(j, 0)).a
            };
            let begin = |j: usize| BaseRotations {
                stress_free: self.leaf.base_pose(j).rotation,
                now: state.q[state.base(j)],
            };
            let begins: Vec<BaseRotations> = rods.clone().map(begin).collect();
            let directed = (rods.clone()).filter(|j| !self.leaf.base_turns_freely(*j));
            let moments = directed.map(moment).reduce(|sum, own| sum + own);
            let angle = turning.angle_to_representative(&begins, moments);
            let point = turning.point / self.leaf.scale.length;
            let n = self.segments();
            for j in rods.clone() {
                let [turn, back] = turning.rotations(angle, j, state.q[state.base(j)]);
                for node in self.moving_nodes() {
                    let k = state.base(j) + node;
                    let freedom = self.node_freedom(j, node);
                    if node == 0 && freedom.is_fixed() {
                        continue;
                    }
                    if freedom.displacement.any() || node < n {
                        state.x[k] = point + turn * (state.x[k] - point);
                    }
                    if freedom.rotation || node < n {
                        state.q[k] = (turn * state.q[k] * back).normalize();
                    }
                }
                let forces = &mut state.n[j * n..(j + 1) * n];
                forces.iter_mut().for_each(|force| *force = turn * *force);
            }
        }
    }

    /// The equilibrium that stands for the circle of equilibria of a state: see
    /// [`DiscreteLeaf::rotate_to_representative`].
    pub fn circle_representative<'s>(&self, state: &'s State) -> Cow<'s, State> {
        let mut state = Cow::Borrowed(state);
        if self.zero_energy_rotations().next().is_some() {
            self.rotate_to_representative(state.to_mut());
        }
        state
    }

    /// The turns without resistance in a state, at unit rate: increments of the nodes of all rods.
    pub fn zero_energy_fields(&self, state: &State) -> Vec<NodalField> {
        let moves =
            |turning: &&ZeroEnergyRotation| self.phase_condition_node(turning, state).is_some();
        let turn = |turning: &ZeroEnergyRotation| {
            let mut field = vec![vec![[0.0; 6]; self.moving_nodes().len()]; self.rods()];
            for j in turning.rods.clone() {
                for (node, increments) in field[j].iter_mut().enumerate() {
                    let k = state.base(j) + node + self.first_node();
                    *increments = self.zero_energy_increment(turning, state, k).to_array();
                }
            }
            field
        };
        self.zero_energy_rotations()
            .filter(moves)
            .map(turn)
            .collect()
    }
}

/// Rods and nodes of the veins of a turn, without their bases, to the node `last`.
fn rotating_nodes(
    turning: &ZeroEnergyRotation,
    last: usize,
) -> impl Iterator<Item = (usize, usize)> {
    (turning.rods.clone()).flat_map(move |rod| (1..=last).map(move |node| (rod, node)))
}
