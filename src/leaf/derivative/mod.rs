//! The derivative of a leaf with respect to a number of its scenario: of its forces in a given
//! state, and of its energy. Exact except for the finite differences of scenarios that define
//! the number's effect on the scenario itself.
//!
//! Bases: their motion, and its effect where clamps hold them.
//!
//! The forces by which a parameter change unbalances a leaf, and the linear response to them.
//!
//! What depends on the leaf as a whole, or on its natural state: tissue, and loads of single veins.
//! Their changes are weighted sums over leaves that differ in the number.
//!
//! Dead moments on a single rod that change.

pub(super) mod parameter;
mod supports;

use crate::leaf::Leaf;
use crate::leaf::derivative::parameter::{
    LeafParameterDerivative, LinearResponse, ParameterForces, RodParameterDerivative,
    hessian_at_constant_force,
};
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{NodalField, State, add_to_increment};
use crate::rod::{Section, Segment, TissueStrip};
use glam::DVec3;

impl DiscreteLeaf {
    /// All segments in a state, rod after rod, for use by all derivatives in that state.
    pub fn all_segments(&self, state: &State) -> Vec<Segment> {
        let n = self.segments();
        let each = self.rod_index_pairs(0..n);
        each.map(|(j, i)| self.segment(state, j, i, state.n[j * n + i]))
            .collect()
    }

    /// The effect of a parameter change of the leaf (all of its rods, in space) in a state
    /// with these segments.
    pub fn parameter_forces(
        &self,
        state: &State,
        segments: &[Segment],
        rate: &LeafParameterDerivative,
    ) -> ParameterForces {
        let mut forces = ParameterForces::zeros(self.rods());
        let neighbours = self.weighted_leaves_on_grid(rate);
        let of_all = rate.gravity != DVec3::ZERO || rate.tip_force != DVec3::ZERO;
        for (j, rod) in rate.rods.iter().enumerate() {
            if !rod.sections_unchanged() {
                self.add_section_changes(segments, j, rod, &neighbours, &mut forces);
            }
            let coupling = rate.coupling.get(j).is_some_and(|gap| *gap != DVec3::ZERO);
            if of_all || coupling || rod.length != 0.0 {
                self.add_load_changes(state, j, rate, &mut forces);
            }
            if rod.base != [DVec3::ZERO; 2] {
                self.add_base_motion(state, segments, j, rod.base, &mut forces);
            }
        }
        self.add_moment_changes(rate, &mut forces);
        self.add_tissue_changes(state, &neighbours, &mut forces);
        let motion = self.support_motion_increments(rate, &neighbours);
        self.add_support_motion(state, segments, motion, &mut forces);
        forces
    }

    fn add_section_changes(
        &self,
        segments: &[Segment],
        j: usize,
        rod: &RodParameterDerivative,
        neighbours: &[(f64, DiscreteLeaf)],
        forces: &mut ParameterForces,
    ) {
        let (n, first) = (self.segments(), self.first_node());
        forces.node_forces_mut(j, n + 1 - first);
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
                [change.rest_strain, change.rest_curvature] = rest_rates(neighbours, j, i);
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

    /// Loads and coupling of rod `j`, as in [`DiscreteLeaf::load`].
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
        forces.node_forces_mut(j, count);
        if rate.coupling.get(j).is_some_and(|gap| *gap != DVec3::ZERO) {
            forces.node_forces_mut(j + 1, count);
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

    /// The work of forces on a response to others: by symmetry also that of the
    /// others on the response to these.
    pub fn mutual_work(
        &self,
        segments: &[Segment],
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
                work -= response.force_changes[j * n + i].dot(segments[j * n + i].frame * *gap);
            }
        }
        work
    }

    /// Adds to forces on the nodes the contribution of changes of the gaps when the forces of
    /// the segments are condensed out.
    pub fn condense_gaps(&self, segments: &[Segment], gaps: &[DVec3], nodes: &mut NodalField) {
        let (n, first) = (self.segments(), self.first_node());
        for (j, i) in self.rod_index_pairs(0..n) {
            let gap = gaps[j * n + i];
            if gap == DVec3::ZERO {
                continue;
            }
            let segment = &segments[j * n + i];
            let (g_x, g_a, g_b) = segment.gap_gradient(self.section(j, i), gap);
            if i >= first {
                add_to_increment(&mut nodes[j][i - first], -g_a, g_x);
            }
            add_to_increment(&mut nodes[j][i + 1 - first], -g_b, -g_x);
        }
        // Held components have no equations.
        self.clear_held_forces(nodes);
    }

    /// The changes of the forces of all segments for increments of the nodes and changes of
    /// the gaps, and the remaining gaps, which are nonzero where the condensing stiffness is
    /// less than the segment's own.
    pub fn carried_force_changes(
        &self,
        segments: &[Segment],
        increments: &NodalField,
        gaps: &mut [DVec3],
        force_changes: &mut [DVec3],
    ) {
        let n = self.segments();
        for (j, rod) in increments.iter().enumerate() {
            let (bases, nodes) = rod.split_at(1 - self.first_node());
            let base = bases.first().copied().unwrap_or([0.0; 6]);
            let (mut a, mut dx0) = (
                crate::leaf::rotation_part(&base),
                crate::leaf::displacement_part(&base),
            );
            for (i, increment) in nodes.iter().enumerate() {
                let k = j * n + i;
                let (b, dx1) = (
                    crate::leaf::rotation_part(increment),
                    crate::leaf::displacement_part(increment),
                );
                let section = self.section(j, i);
                let segment = &segments[k];
                let gap = gaps[k] + segment.gap_increment(section, dx1 - dx0, a, b);
                force_changes[k] += segment.frame * (section.condensing * gap / section.ds);
                gaps[k] = gap * self.missing_law_fraction(j, i);
                (a, dx0) = (b, dx1);
            }
        }
    }
}

impl DiscreteLeaf {
    /// Adds the effect of displacing and rotating a clamped base.
    fn add_base_motion(
        &self,
        state: &State,
        segments: &[Segment],
        j: usize,
        [shift, turn]: [DVec3; 2],
        forces: &mut ParameterForces,
    ) {
        let n = self.segments();
        let section = self.section(j, 0);
        let segment = &segments[j * n];
        let k = hessian_at_constant_force(segment, section);
        add_to_increment(
            &mut forces.node_forces_mut(j, n)[0],
            k.xb.transpose() * shift - k.ab.transpose() * turn,
            k.xx * shift - k.xa * turn,
        );
        forces.gap_effects_mut(j, n)[0] +=
            segment.gap_increment(section, -shift, turn, DVec3::ZERO);
        let ((g_x, g_a, _), load) = (segment.gradient(section), self.load(state, j, 0));
        forces.energy += (g_a - load.moment).dot(turn) - (g_x + load.force).dot(shift);
    }
}

/// The changes of the rest strain and the rest curvature of segment `i` of rod `j`.
fn rest_rates(each: &[(f64, DiscreteLeaf)], j: usize, i: usize) -> [DVec3; 2] {
    let Some((_, first)) = each.first() else {
        return [DVec3::ZERO; 2];
    };
    let sum = |of: fn(&Section) -> DVec3| -> DVec3 {
        let own = of(first.section(j, i));
        each.iter()
            .map(|(weight, leaf)| *weight * (of(leaf.section(j, i)) - own))
            .sum()
    };
    [sum(|it| it.rest_strain), sum(|it| it.rest_curvature)]
}

impl DiscreteLeaf {
    /// The weighted leaves of a rate on this grid.
    fn weighted_leaves_on_grid(&self, rate: &LeafParameterDerivative) -> Vec<(f64, DiscreteLeaf)> {
        let leaves = rate.weighted_leaves.iter();
        leaves
            .map(|(weight, leaf)| (*weight, DiscreteLeaf::new(leaf, self.grid.clone())))
            .collect()
    }

    /// The change of the loads that rod `j` has of its own on its node `i`.
    fn own_load_rate(&self, rate: &LeafParameterDerivative, j: usize, i: usize) -> DVec3 {
        let sigma = self.grid.sigma()[i];
        let on = |leaf: &Leaf| {
            let points = leaf.point_loads();
            let here = points.filter(|(rod, at, _)| (*rod, self.grid.nearest(*at)) == (j, i));
            let points: DVec3 = here.map(|(_, _, force)| force).sum();
            self.grid.node_weight(i) * leaf.own_load_density(j, sigma) + points
        };
        rate.weighted_leaves
            .iter()
            .map(|(weight, leaf)| *weight * on(leaf))
            .sum()
    }

    /// Adds the changes of the loads that veins have of their own, from the weighted leaves of
    /// which they are the sum.
    fn add_own_load_changes(
        &self,
        state: &State,
        each: &[(f64, DiscreteLeaf)],
        forces: &mut ParameterForces,
    ) {
        let (n, nodes) = (self.segments(), self.moving_nodes());
        for (j, i) in self.rod_index_pairs(0..n + 1) {
            let first = each[0].1.own_load_on_node(j, i);
            let changes = each
                .iter()
                .map(|(w, leaf)| *w * (leaf.own_load_on_node(j, i) - first));
            let change = self.load_factor * changes.sum::<DVec3>();
            if change != DVec3::ZERO {
                forces.energy -= change.dot(state.x[state.base(j) + i]);
                if nodes.contains(&i) {
                    let on = &mut forces.node_forces_mut(j, nodes.len())[i - nodes.start];
                    add_to_increment(on, DVec3::ZERO, change);
                }
            }
        }
    }

    /// Adds the effect of the changes of the tissue, and of its natural state, and of loads of
    /// single veins: from the weighted leaves of which they are the sum.
    fn add_tissue_changes(
        &self,
        state: &State,
        each: &[(f64, DiscreteLeaf)],
        forces: &mut ParameterForces,
    ) {
        let (n, nodes) = (self.segments(), self.moving_nodes());
        let Some((_, first)) = each.first() else {
            return;
        };
        self.add_own_load_changes(state, each, forces);
        let (first, each): (_, Vec<_>) = (
            &first.strips,
            each.iter().map(|(w, leaf)| (w, &leaf.strips)).collect(),
        );
        for (k, own) in first.iter().enumerate() {
            let mut change = TissueStrip::default();
            for (weight, strips) in &each {
                change.add(**weight, &strips[k].difference_from(own));
            }
            if change == TissueStrip::default() {
                continue;
            }
            let (g, i) = (k / (n + 1), k % (n + 1));
            let (energy, loads) = self.strip_derivatives(state, (g, i), &change);
            forces.energy += energy;
            for (j, [moment, force]) in [g, g + 1].into_iter().zip(loads) {
                if nodes.contains(&i) {
                    let on = &mut forces.node_forces_mut(j, nodes.len())[i - nodes.start];
                    add_to_increment(on, moment, force);
                }
            }
        }
    }
}

impl LeafParameterDerivative<'_> {
    /// Whether dead moments change.
    pub fn changes_moments(&self) -> bool {
        !self.moments.is_empty()
    }
}

impl DiscreteLeaf {
    /// Adds the changes of dead moments.
    fn add_moment_changes(&self, rate: &LeafParameterDerivative, forces: &mut ParameterForces) {
        for (sigma, moment) in &rate.moments {
            let nodes = forces.node_forces_mut(0, self.moving_nodes().len());
            if let Some(i) = self.grid.nearest(*sigma).checked_sub(self.first_node()) {
                add_to_increment(&mut nodes[i], self.load_factor * *moment, DVec3::ZERO);
            }
        }
    }
}
