//! The derivative of a leaf with respect to a number of its scenario: of its forces in a given state,
//! and of its energy. It is exact but for the finite differences of scenarios that define how the
//! number acts on the scenario itself.
//!
//! Sections, loads, coupling, bases and dead moments change by their own derivatives. What depends on
//! the leaf as a whole, or on its stress-free state (tissue, loads of single veins, grips), changes by
//! weighted sums over leaves that differ in the number.

pub(super) mod parameter;
mod supports;

use crate::leaf::Leaf;
use crate::leaf::derivative::parameter::{
    LeafParameterDerivative, LinearResponse, ParameterForces, RodParameterDerivative, Weighted,
    hessian_at_constant_force,
};
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{
    NodalField, NodeIncrement, State, add_to_increment, displacement_part, rotation_part,
};
use crate::leaf::tissue::rigid::{ForceCarriers, RigidStrip};
use crate::rod::{Section, SectionParameterDerivative, Segment};
use glam::DVec3;

impl DiscreteLeaf {
    /// All elements that carry forces in a state, for use by all derivatives in that state.
    pub fn force_carriers(&self, state: &State) -> ForceCarriers {
        let n = self.segments();
        let each = self.rod_index_pairs(0..n);
        ForceCarriers {
            segments: each
                .map(|(j, i)| self.segment(state, j, i, state.n[j * n + i]))
                .collect(),
            strips: self.rigid_strips(state),
            spin_axes: self.spin_axes(state),
        }
    }

    /// The forces by which a change of the number unbalances this leaf, a whole one in space, in a state
    /// with these segments.
    pub fn parameter_forces(
        &self,
        state: &State,
        carriers: &ForceCarriers,
        rate: &LeafParameterDerivative,
    ) -> ParameterForces {
        let mut forces = ParameterForces::zeros(self.rods());
        let neighbors = self.weighted_leaves_on_grid(rate);
        let of_all = rate.gravity != DVec3::ZERO || rate.tip_force != DVec3::ZERO;
        for (j, rod) in rate.rods.iter().enumerate() {
            if !rod.sections_unchanged() {
                self.add_section_changes(&carriers.segments, j, rod, &neighbors, &mut forces);
            }
            let coupling = rate.coupling.get(j).is_some_and(|gap| *gap != DVec3::ZERO);
            if of_all || coupling || rod.length != 0.0 {
                self.add_load_changes(state, j, rate, &mut forces);
            }
            if rod.base != NodeIncrement::default() {
                self.add_base_motion(state, &carriers.segments, j, rod.base, &mut forces);
            }
        }
        self.add_base_motion_of_cells(state, rate, &mut forces);
        self.add_moment_changes(rate, &mut forces);
        self.add_tissue_and_own_load_changes(state, &neighbors, &mut forces);
        self.add_rigid_strip_changes(&carriers.strips, &neighbors, &mut forces);
        let motion = self.support_motion_increments(rate, &neighbors);
        self.add_support_motion(state, carriers, motion, &mut forces);
        forces
    }

    /// Adds the effect of changes of the sections of rod `j`.
    fn add_section_changes(
        &self,
        segments: &[Segment],
        j: usize,
        rod: &RodParameterDerivative,
        neighbors: &[Weighted<DiscreteLeaf>],
        forces: &mut ParameterForces,
    ) {
        let (n, first) = (self.segments(), self.first_node());
        forces.rod_forces_mut(j, n + 1 - first);
        forces.gap_effects_mut(j, n);
        for i in 0..n {
            let section = self.section(j, i);
            let segment = &segments[j * n + i];
            let mut change = rod.section(
                section,
                self.grid.segment_midpoint(i),
                self.grid.segment_width(i),
            );
            if self.has_tissue() {
                let rate = |of: fn(&Section) -> DVec3| section_rate(neighbors, j, i, of);
                change.rest_strain = rate(|it| it.rest_strain);
                change.rest_curvature = rate(|it| it.rest_curvature);
            }
            let change = segment.parameter_derivative(section, &change);
            let [left, right] = change.gradient;
            let nodes = &mut forces.nodes[j];
            if i >= first {
                add_to_increment(&mut nodes[i - first], -left, DVec3::ZERO);
            }
            add_to_increment(&mut nodes[i + 1 - first], -right, DVec3::ZERO);
            forces.gaps[j][i] += change.gap;
            forces.energy += change.energy;
        }
    }

    /// Adds the changes of loads and coupling of rod `j`, as in [`DiscreteLeaf::load`].
    fn add_load_changes(
        &self,
        state: &State,
        j: usize,
        rate: &LeafParameterDerivative,
        forces: &mut ParameterForces,
    ) {
        let (n, first) = (self.segments(), self.first_node());
        let count = n + 1 - first;
        let rod = &rate.rods[j];
        let gravity = self.loads.gravity * rod.length + rate.gravity * self.leaf.length(j);
        let ends_here = j == 0 || !self.leaf.joined();
        forces.rod_forces_mut(j, count);
        if rate.coupling.get(j).is_some_and(|gap| *gap != DVec3::ZERO) {
            forces.rod_forces_mut(j + 1, count);
        }
        let base = state.x[state.base(j)];
        forces.energy -= (gravity * (self.load_factor * self.grid.node_weight(0))).dot(base);
        if let Some(change) = rate.coupling.get(j) {
            let stretch = state.x[state.base(j + 1)] - base;
            forces.energy += 0.5 * self.grid.node_weight(0) * (*change * stretch).dot(stretch);
        }
        for i in 1..=n {
            let x = state.x[state.base(j) + i];
            let mut force = gravity * (self.load_factor * self.grid.node_weight(i));
            if i == n && ends_here {
                force += self.load_factor * rate.tip_force;
            }
            forces.energy -= force.dot(x);
            let coupled = rate.coupling.get(j).is_some_and(|gap| *gap != DVec3::ZERO);
            if coupled && !(self.leaf.joined() && i == n) {
                let stretch = state.x[state.base(j + 1) + i] - x;
                let pull = rate.coupling[j] * self.grid.node_weight(i) * stretch;
                forces.energy += 0.5 * pull.dot(stretch);
                force += pull;
                add_to_increment(&mut forces.nodes[j + 1][i - first], DVec3::ZERO, -pull);
            }
            add_to_increment(&mut forces.nodes[j][i - first], DVec3::ZERO, force);
        }
    }

    /// The work of forces in the response to other forces: by symmetry also the work of the other
    /// forces in the response to these.
    pub fn mutual_work(
        &self,
        carriers: &ForceCarriers,
        forces: &ParameterForces,
        response: &LinearResponse,
    ) -> f64 {
        let n = self.segments();
        let mut work = 0.0;
        for (forces, response) in forces.nodes.iter().zip(&response.nodes) {
            for (force, shift) in forces.iter().zip(response) {
                let pairs = force.iter().zip(shift);
                work += pairs.map(|(force, shift)| force * shift).sum::<f64>();
            }
        }
        for (j, gaps) in forces.gaps.iter().enumerate() {
            for (i, gap) in gaps.iter().enumerate() {
                let segment = &carriers.segments[j * n + i];
                work -= response.force_changes[j * n + i].dot(segment.frame * *gap);
            }
        }
        let of_tissue = response.force_changes[carriers.segments.len()..].iter();
        for ((strip, gap), change) in carriers
            .strips
            .iter()
            .zip(&forces.tissue_gaps)
            .zip(of_tissue)
        {
            work -= strip.weight * change.dot(strip.element.frame * *gap);
        }
        work
    }

    /// Adds to forces on the nodes the contribution of changes of the gaps when the forces of
    /// the segments are condensed out.
    pub fn condense_gaps(&self, carriers: &ForceCarriers, gaps: &[DVec3], nodes: &mut NodalField) {
        let (n, first) = (self.segments(), self.first_node());
        for (j, i) in self.rod_index_pairs(0..n) {
            let gap = gaps[j * n + i];
            if gap == DVec3::ZERO {
                continue;
            }
            let segment = &carriers.segments[j * n + i];
            let change = segment.gap_gradient(self.section(j, i), gap);
            if i >= first {
                add_to_increment(&mut nodes[j][i - first], -change.a, change.x);
            }
            add_to_increment(&mut nodes[j][i + 1 - first], -change.b, -change.x);
        }
        let of_tissue = gaps[carriers.segments.len()..].iter();
        for (strip, gap) in carriers.strips.iter().zip(of_tissue) {
            if *gap == DVec3::ZERO || strip.node < first {
                continue;
            }
            let (g, i) = (strip.gap, strip.node - first);
            let change = strip.element.gap_gradient(&strip.section, *gap);
            add_to_increment(&mut nodes[g][i], -change.a, change.x);
            add_to_increment(&mut nodes[g + 1][i], -change.b, -change.x);
        }
        // Held components have no equations.
        self.zero_held_components(&carriers.spin_axes, nodes);
    }

    /// The changes of the forces of all segments for increments of the nodes and changes of
    /// the gaps, and the remaining gaps, which are nonzero where the condensing stiffness is
    /// less than the segment's own.
    pub fn carried_force_changes(
        &self,
        carriers: &ForceCarriers,
        increments: &NodalField,
        gaps: &mut [DVec3],
        force_changes: &mut [DVec3],
    ) {
        let n = self.segments();
        for (j, rod) in increments.iter().enumerate() {
            let (bases, nodes) = rod.split_at(1 - self.first_node());
            let base = bases.first().copied().unwrap_or([0.0; 6]);
            let (mut a, mut dx0) = (rotation_part(&base), displacement_part(&base));
            for (i, increment) in nodes.iter().enumerate() {
                let k = j * n + i;
                let (b, dx1) = (rotation_part(increment), displacement_part(increment));
                let section = self.section(j, i);
                let segment = &carriers.segments[k];
                let gap = gaps[k] + segment.gap_increment(section, dx1 - dx0, a, b);
                force_changes[k] += segment.frame * (section.condensing * gap / section.ds);
                gaps[k] = gap * self.missing_law_fraction(j, i);
                (a, dx0) = (b, dx1);
            }
        }
        let first = carriers.segments.len();
        for (k, strip) in (first..).zip(&carriers.strips) {
            let Some(i) = strip.node.checked_sub(self.first_node()) else {
                continue;
            };
            let [a, b] = [strip.gap, strip.gap + 1].map(|rod| &increments[rod][i]);
            let dx = displacement_part(b) - displacement_part(a);
            let turns = [a, b].map(rotation_part);
            let change = (strip.element).gap_increment(&strip.section, dx, turns[0], turns[1]);
            gaps[k] = strip.rigid * (gaps[k] + change);
            let carried = strip.element.frame * (strip.section.condensing * gaps[k]);
            force_changes[k] += carried / strip.weight;
        }
    }

    /// Adds the effect of displacing and rotating a clamped base.
    fn add_base_motion(
        &self,
        state: &State,
        segments: &[Segment],
        j: usize,
        motion: NodeIncrement,
        forces: &mut ParameterForces,
    ) {
        let (shift, turn) = (motion.displacement, motion.rotation);
        let n = self.segments();
        let section = self.section(j, 0);
        let segment = &segments[j * n];
        let k = hessian_at_constant_force(segment, section);
        add_to_increment(
            &mut forces.rod_forces_mut(j, n)[0],
            k.xb.transpose() * shift - k.ab.transpose() * turn,
            k.xx * shift - k.xa * turn,
        );
        forces.gap_effects_mut(j, n)[0] +=
            segment.gap_increment(section, -shift, turn, DVec3::ZERO);
        let (gradient, load) = (segment.gradient(section), self.load(state, j, 0));
        forces.energy +=
            (gradient.a - load.moment).dot(turn) - (gradient.x + load.force).dot(shift);
    }

    /// Adds the forces of tissue that contracts as clamped bases move, by the strains of the first segments.
    fn add_base_motion_of_cells(
        &self,
        state: &State,
        rate: &LeafParameterDerivative,
        forces: &mut ParameterForces,
    ) {
        let still = |rod: &RodParameterDerivative| rod.base == NodeIncrement::default();
        if rate.rods.iter().all(still) {
            return;
        }
        let nodes = self.moving_nodes();
        let increment = |rod: usize, i: usize| match i {
            0 => rate.rods[rod].base.to_array(),
            _ => [0.0; 6],
        };
        for cell in self.tissue_cells().filter(|cell| cell.segment == 0) {
            self.for_each_cell_response(state, cell, increment, |j, i, load| {
                if nodes.contains(&i) {
                    let on = &mut forces.rod_forces_mut(j, nodes.len())[i - nodes.start];
                    add_to_increment(on, load.moment, load.force);
                }
            });
        }
    }
}

/// The change of a property of the section of segment `i` of rod `j`, from the leaves that differ.
fn section_rate(
    leaves: &[Weighted<DiscreteLeaf>],
    j: usize,
    i: usize,
    property: fn(&Section) -> DVec3,
) -> DVec3 {
    let Some(first) = leaves.first() else {
        return DVec3::ZERO;
    };
    let own = property(first.term.section(j, i));
    leaves
        .iter()
        .map(|it| it.weight * (property(it.term.section(j, i)) - own))
        .sum()
}

impl DiscreteLeaf {
    /// The leaves that differ in the number, on this grid.
    fn weighted_leaves_on_grid(
        &self,
        rate: &LeafParameterDerivative,
    ) -> Vec<Weighted<DiscreteLeaf>> {
        let leaves = rate.weighted_leaves.iter().map(|it| Weighted {
            weight: it.weight,
            term: DiscreteLeaf::new(&it.term, self.grid.clone()),
        });
        leaves.collect()
    }

    /// The change of the loads of rod `j` alone on its node `i`.
    fn own_load_rate(&self, rate: &LeafParameterDerivative, j: usize, i: usize) -> DVec3 {
        let on = |leaf: &Leaf| {
            let points = leaf.point_forces();
            let here = points.filter(|it| (it.rod, self.grid.nearest_node(it.sigma)) == (j, i));
            let points: DVec3 = here.map(|it| it.force).sum();
            self.grid.own_load_around_node(leaf, j, i) + points
        };
        rate.weighted_leaves
            .iter()
            .map(|it| it.weight * on(&it.term))
            .sum()
    }

    /// Adds the effect of changes of the loads of single veins: weighted sums over leaves that differ.
    fn add_own_load_changes(
        &self,
        state: &State,
        each: &[Weighted<DiscreteLeaf>],
        forces: &mut ParameterForces,
    ) {
        let (n, nodes) = (self.segments(), self.moving_nodes());
        for (j, i) in self.rod_index_pairs(0..n + 1) {
            let first = each[0].term.own_load_on_node(j, i);
            let changes = each
                .iter()
                .map(|it| it.weight * (it.term.own_load_on_node(j, i) - first));
            let change = self.load_factor * changes.sum::<DVec3>();
            if change != DVec3::ZERO {
                forces.energy -= change.dot(state.x[state.base(j) + i]);
                if nodes.contains(&i) {
                    let on = &mut forces.rod_forces_mut(j, nodes.len())[i - nodes.start];
                    add_to_increment(on, DVec3::ZERO, change);
                }
            }
        }
    }

    /// Adds the effect of changes of the tissue, of its stress-free state, and of loads of single
    /// veins: weighted sums over leaves that differ.
    fn add_tissue_and_own_load_changes(
        &self,
        state: &State,
        each: &[Weighted<DiscreteLeaf>],
        forces: &mut ParameterForces,
    ) {
        let nodes = self.moving_nodes();
        if each.is_empty() {
            return;
        }
        self.add_own_load_changes(state, each, forces);
        self.add_lever_changes(state, each, forces);
        self.add_follower_changes(state, each, forces);
        self.add_spring_changes(state, each, forces);
        let terms: Vec<_> = each.iter().map(|it| (it.weight, &it.term)).collect();
        forces.energy += self.for_each_tissue_change(state, &terms, |j, i, load| {
            if nodes.contains(&i) {
                let on = &mut forces.rod_forces_mut(j, nodes.len())[i - nodes.start];
                add_to_increment(on, load.moment, load.force);
            }
        });
    }

    /// Adds the changes of dead forces off the axes and of where they act.
    fn add_lever_changes(
        &self,
        state: &State,
        each: &[Weighted<DiscreteLeaf>],
        forces: &mut ParameterForces,
    ) {
        let nodes = self.moving_nodes();
        for Weighted { weight, term } in each {
            let factor = self.load_factor * *weight;
            for lever in term.present_levers() {
                let q = state.q[state.base(lever.rod) + lever.node];
                forces.energy += factor * lever.energy(q);
                if nodes.contains(&lever.node) {
                    let on_rod = forces.rod_forces_mut(lever.rod, nodes.len());
                    let on = &mut on_rod[lever.node - nodes.start];
                    add_to_increment(on, factor * lever.moment(q), DVec3::ZERO);
                }
            }
        }
    }

    /// Adds the changes of loads that turn with the sections, and of moments along veins.
    fn add_follower_changes(
        &self,
        state: &State,
        each: &[Weighted<DiscreteLeaf>],
        forces: &mut ParameterForces,
    ) {
        let nodes = self.moving_nodes();
        for Weighted { weight, term } in each.iter().filter(|it| it.term.has_followers()) {
            for (j, i) in self.rod_index_pairs(nodes.clone()) {
                let load = term.follower_wrench(state, j, i);
                let on = &mut forces.rod_forces_mut(j, nodes.len())[i - nodes.start];
                add_to_increment(on, *weight * load.moment, *weight * load.force);
            }
        }
    }

    /// Adds the changes of the springs of supports, in their stiffness and in where they have no force.
    fn add_spring_changes(
        &self,
        state: &State,
        each: &[Weighted<DiscreteLeaf>],
        forces: &mut ParameterForces,
    ) {
        let nodes = self.moving_nodes();
        for Weighted { weight, term } in each {
            for spring in term.springs.iter() {
                let k = state.base(spring.rod) + spring.node;
                let [moment, force] = [spring.moment(state.q[k]), spring.force(state.x[k])];
                forces.energy += *weight * spring.energy(state.x[k], state.q[k]);
                if nodes.contains(&spring.node) {
                    let on_rod = forces.rod_forces_mut(spring.rod, nodes.len());
                    let on = &mut on_rod[spring.node - nodes.start];
                    add_to_increment(on, *weight * moment, *weight * force);
                }
            }
        }
    }

    /// The change of the forces of the springs on node `i` of rod `j` by its displacement.
    pub(super) fn spring_response(&self, j: usize, i: usize, response: &LinearResponse) -> DVec3 {
        let springs = self.springs.on_node(j * (self.segments() + 1) + i);
        let stiffness: DVec3 = springs.iter().map(|spring| spring.stiffness).sum();
        -stiffness * displacement_part(&response.nodes[j][i - self.first_node()])
    }

    /// The change of the force of loads that turn with the section of node `i` of rod `j`.
    pub(super) fn follower_response(
        &self,
        state: &State,
        j: usize,
        i: usize,
        response: &LinearResponse,
    ) -> DVec3 {
        let turn = rotation_part(&response.node_increment(self, j, i));
        let q = state.q[state.base(j) + i];
        self.node_follower(j, i).derivative(q, turn).force
    }

    /// Adds the changes of the forces of springs on their grips.
    fn add_spring_force_rates(
        &self,
        state: &State,
        each: &[Weighted<DiscreteLeaf>],
        response: &LinearResponse,
        rates: &mut [DVec3],
    ) {
        for Weighted { weight, term } in each {
            for spring in term.springs.iter() {
                if let Some(grip) = spring.grip {
                    let x = state.x[state.base(spring.rod) + spring.node];
                    rates[grip] -= *weight * spring.force(x);
                }
            }
        }
        for spring in self.springs.iter() {
            if let Some(grip) = spring.grip {
                let increment = &response.nodes[spring.rod][spring.node - self.first_node()];
                rates[grip] += spring.stiffness * displacement_part(increment);
            }
        }
    }

    /// Adds the effect of changes of the stress-free state on rigid tissue.
    fn add_rigid_strip_changes(
        &self,
        strips: &[RigidStrip],
        each: &[Weighted<DiscreteLeaf>],
        forces: &mut ParameterForces,
    ) {
        let nodes = self.moving_nodes();
        let Some(first) = each.first() else {
            return;
        };
        for (k, strip) in strips.iter().enumerate() {
            let own = first.term.node_strip(k).stress_free_gap;
            let changes = each
                .iter()
                .map(|it| it.weight * (it.term.node_strip(k).stress_free_gap - own));
            let rate = SectionParameterDerivative {
                rest_strain: strip.rigid * changes.sum::<DVec3>(),
                ..Default::default()
            };
            if rate.rest_strain == DVec3::ZERO {
                continue;
            }
            let change = strip.element.parameter_derivative(&strip.section, &rate);
            forces.tissue_gaps.resize(strips.len(), DVec3::ZERO);
            forces.tissue_gaps[k] += change.gap;
            forces.energy += change.energy;
            for (rod, moment) in [strip.gap, strip.gap + 1].into_iter().zip(change.gradient) {
                if nodes.contains(&strip.node) {
                    let on = &mut forces.rod_forces_mut(rod, nodes.len())[strip.node - nodes.start];
                    add_to_increment(on, -moment, DVec3::ZERO);
                }
            }
        }
    }

    /// Adds the changes of dead moments to the forces.
    fn add_moment_changes(&self, rate: &LeafParameterDerivative, forces: &mut ParameterForces) {
        for it in &rate.moments {
            let nodes = forces.rod_forces_mut(0, self.moving_nodes().len());
            if let Some(i) = self
                .grid
                .nearest_node(it.sigma)
                .checked_sub(self.first_node())
            {
                add_to_increment(&mut nodes[i], self.load_factor * it.moment, DVec3::ZERO);
            }
        }
    }
}
