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

mod supports;

use crate::leaf::Leaf;
use crate::leaf::derivative::supports::TipSupportDerivative;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{Increment, NodalField, State, add_to_increment};
use crate::rod::{Section, SectionParameterDerivative, Segment, SegmentHessian, TissueStrip};
use crate::rotation;
use crate::scenario::{Profile, Scenario};
use glam::DVec3;
use std::sync::Arc;

/// The derivative of a leaf: weighted sums over scenarios that differ in the number, with
/// weights that add up to zero.
pub struct LeafParameterDerivative<'s> {
    rods: Vec<RodParameterDerivative<'s>>,
    coupling: Vec<DVec3>,
    gravity: DVec3,
    tip_force: DVec3,
    /// Sigma and change of dead moments on a single rod.
    moments: Vec<(f64, DVec3)>,
    held: Option<TipSupportDerivative>,
    /// The leaves that differ in the number, with their weights, if they have tissue, loads of
    /// single veins, or grips.
    weighted_leaves: Vec<(f64, Leaf)>,
}

/// The derivative of a rod, in the leaf's units.
struct RodParameterDerivative<'s> {
    length: f64,
    /// Of a clamped base: its position, its rotation.
    base: [DVec3; 2],
    /// Of the place of a hinge.
    hinge: DVec3,
    couple_stiffness: [ProfileDerivative<'s>; 3],
    force_stiffness: [ProfileDerivative<'s>; 3],
    rest_curvature: [ProfileDerivative<'s>; 3],
    rest_stretch: ProfileDerivative<'s>,
}

/// The derivative of a profile: a weighted sum of profiles, without terms if it is zero.
struct ProfileDerivative<'s>(Vec<(f64, &'s Profile)>);

impl<'s> ProfileDerivative<'s> {
    fn from_terms(
        terms: &'s [(f64, Scenario)],
        unit: f64,
        profile: impl Fn(&'s Scenario) -> &'s Profile,
    ) -> Self {
        let first = profile(&terms[0].1);
        let profiles = terms.iter().map(|(weight, s)| (weight * unit, profile(s)));
        let mut profiles: Vec<_> = profiles.collect();
        if profiles.iter().all(|(_, other)| *other == first) {
            profiles.clear();
        }
        ProfileDerivative(profiles)
    }

    fn value_at(&self, sigma: f64) -> f64 {
        let terms = self.0.iter().map(|(weight, p)| weight * p.at(sigma));
        terms.fold(0.0, |sum, term| sum + term)
    }

    fn is_zero(&self) -> bool {
        self.0.is_empty()
    }
}

impl<'s> LeafParameterDerivative<'s> {
    /// Of a leaf, from neighbouring scenarios with their weights.
    pub fn new(leaf: &Leaf, terms: &'s [(f64, Scenario)]) -> Self {
        let scale = leaf.scale;
        let sum = |value: &dyn Fn(&Scenario) -> f64| value_derivative(terms, value);
        let vector = |value: fn(&Scenario) -> [f64; 3], unit: f64| {
            DVec3::from_array([0, 1, 2].map(|axis| sum(&|s| value(s)[axis]))) / unit
        };
        let bases = |j: usize| match (base_rate(terms, j, scale.length), leaf.hinged()) {
            ([shift, _], true) => ([DVec3::ZERO; 2], shift),
            (clamped, false) => (clamped, DVec3::ZERO),
        };
        let rod = |j: usize| RodParameterDerivative {
            length: sum(&|s| s.rods[j].length) / scale.length,
            base: bases(j).0,
            hinge: bases(j).1,
            couple_stiffness: [0, 1, 2].map(|k| {
                ProfileDerivative::from_terms(terms, 1.0 / scale.stiffness, move |s| {
                    &s.rods[j].couple_stiffness[k]
                })
            }),
            force_stiffness: [0, 1, 2].map(|k| {
                ProfileDerivative::from_terms(terms, 1.0 / scale.force(), move |s| {
                    &s.rods[j].force_stiffness[k]
                })
            }),
            rest_curvature: [0, 1, 2].map(|k| {
                ProfileDerivative::from_terms(terms, scale.length, move |s| {
                    &s.rods[j].rest_curvature[k]
                })
            }),
            rest_stretch: ProfileDerivative::from_terms(terms, 1.0, move |s| {
                &s.rods[j].rest_stretch
            }),
        };
        let rods = leaf.scenario().rods.len();
        // Per unit of sigma, as in `Leaf::coupling`.
        let gap = |s: &Scenario, g: usize| 0.5 * (s.rods[g].length + s.rods[g + 1].length);
        let unit = scale.length / scale.force();
        let coupling = |g: usize| {
            let of = |axis: usize| sum(&|s| s.coupling[g][axis] * gap(s, g));
            DVec3::from_array([0, 1, 2].map(of)) * unit
        };
        LeafParameterDerivative {
            rods: (0..rods).map(rod).collect(),
            coupling: (0..rods - 1).map(coupling).collect(),
            gravity: vector(|s| s.gravity, scale.force() / scale.length),
            tip_force: vector(|s| s.tip_force, scale.force()),
            moments: moment_rates(terms, scale.moment()),
            held: TipSupportDerivative::new(leaf, terms),
            weighted_leaves: match leaf.has_tissue()
                || terms
                    .iter()
                    .any(|(_, s)| s.has_own_loads() || !s.grips.is_empty())
            {
                true => weighted_leaves(leaf, terms),
                false => Vec::new(),
            },
        }
    }
}

impl LeafParameterDerivative<'_> {
    /// The rate of displacement of the hinge of rod `j`.
    fn hinge_displacement_rate(&self, j: usize) -> DVec3 {
        self.rods[j].hinge
    }

    /// The rates of displacement and rotation of the base of rod `j` if it is clamped.
    pub fn base_motion_rates(&self, j: usize) -> [DVec3; 2] {
        self.rods[j].base
    }
}

impl RodParameterDerivative<'_> {
    /// Whether all sections of the rod are unchanged.
    fn sections_unchanged(&self) -> bool {
        let triples = [
            &self.couple_stiffness,
            &self.force_stiffness,
            &self.rest_curvature,
        ];
        let mut slopes = triples.into_iter().flatten().chain([&self.rest_stretch]);
        self.length == 0.0 && slopes.all(ProfileDerivative::is_zero)
    }

    /// The derivative of a section at `sigma` whose segment is the fraction `width` of the rod.
    fn section(&self, section: &Section, sigma: f64, width: f64) -> SectionParameterDerivative {
        let at = |slopes: &[ProfileDerivative; 3]| {
            DVec3::from_array(slopes.each_ref().map(|s| s.value_at(sigma)))
        };
        let compliance = section.compliance;
        SectionParameterDerivative {
            ds: self.length * width,
            couple_stiffness: at(&self.couple_stiffness),
            rest_curvature: at(&self.rest_curvature),
            rest_strain: DVec3::X * self.rest_stretch.value_at(sigma),
            compliance: -compliance * compliance * at(&self.force_stiffness),
        }
    }
}

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

/// The derivative of a number of the scenario: relative to the first, so that without changes it
/// is exactly zero.
fn value_derivative(terms: &[(f64, Scenario)], value: &dyn Fn(&Scenario) -> f64) -> f64 {
    let first = value(&terms[0].1);
    let change = |(weight, s): &(f64, Scenario)| weight * (value(s) - first);
    terms.iter().map(change).sum()
}

/// Second derivatives of a segment at constant force.
pub fn hessian_at_constant_force(segment: &Segment, section: &Section) -> SegmentHessian {
    segment.hessian(&Section {
        condensing: DVec3::ZERO,
        ..*section
    })
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

/// The derivatives of the position and of the rotation of the base of rod `j`.
fn base_rate(terms: &[(f64, Scenario)], j: usize, length: f64) -> [DVec3; 2] {
    let (first, turned) = terms[0].1.base(j);
    let mut rate = [DVec3::ZERO; 2];
    for (weight, scenario) in terms {
        let (x, q) = scenario.base(j);
        rate[0] += *weight * (x - first) / length;
        rate[1] += *weight * rotation::log(q * turned.conjugate());
    }
    rate
}

/// The effect of a parameter change in a fixed state. Unaffected rods have no entries.
#[derive(Clone, Debug)]
pub struct ParameterForces {
    /// On the unbalanced forces at the nodes.
    pub nodes: NodalField,
    /// On the gaps of the segments (residuals of their constitutive laws).
    pub gaps: Vec<Vec<DVec3>>,
    /// On the energy.
    pub energy: f64,
    /// Increments of held nodes. Rods on which it moves none have no entries.
    pub support_increments: NodalField,
}

/// The linear response of a leaf to forces.
#[derive(Clone, Debug)]
pub struct LinearResponse {
    /// Increments of the nodes.
    pub nodes: NodalField,
    /// Changes of the spatial forces of the segments, rod after rod.
    pub force_changes: Vec<DVec3>,
}

impl ParameterForces {
    /// Zero, for `rods` rods.
    pub fn zeros(rods: usize) -> ParameterForces {
        ParameterForces {
            nodes: vec![Vec::new(); rods],
            gaps: vec![Vec::new(); rods],
            energy: 0.0,
            support_increments: vec![Vec::new(); rods],
        }
    }

    /// The forces on the nodes of rod `j`, of which `count` have equations.
    pub fn node_forces_mut(&mut self, j: usize, count: usize) -> &mut [Increment] {
        let nodes = &mut self.nodes[j];
        nodes.resize(count, [0.0; 6]);
        nodes
    }

    /// The effects on the gaps of rod `j`, which has `segments` of them.
    pub fn gap_effects_mut(&mut self, j: usize, segments: usize) -> &mut [DVec3] {
        let gaps = &mut self.gaps[j];
        gaps.resize(segments, DVec3::ZERO);
        gaps
    }

    /// Adds `times` other forces.
    pub fn add(&mut self, times: f64, other: &ParameterForces) {
        for (j, (nodes, gaps)) in other.nodes.iter().zip(&other.gaps).enumerate() {
            let count = nodes.len().max(self.nodes[j].len());
            add_scaled_increments(self.node_forces_mut(j, count), times, nodes);
            let count = gaps.len().max(self.gaps[j].len());
            let sums = self.gap_effects_mut(j, count);
            (sums.iter_mut().zip(gaps)).for_each(|(sum, more)| *sum += times * *more);
        }
        self.energy += times * other.energy;
        for (moved, more) in self
            .support_increments
            .iter_mut()
            .zip(&other.support_increments)
        {
            moved.resize(moved.len().max(more.len()), [0.0; 6]);
            add_scaled_increments(moved, times, more);
        }
    }

    /// Forces on all nodes and effects on all gaps of the rods of `leaf`, zeros included.
    pub fn dense(&self, leaf: &DiscreteLeaf) -> (NodalField, Vec<DVec3>) {
        let (segments, count) = (leaf.segments(), leaf.moving_nodes().len());
        let mut gaps = vec![DVec3::ZERO; self.gaps.len() * segments];
        for (all, own) in gaps.chunks_mut(segments.max(1)).zip(&self.gaps) {
            all[..own.len()].copy_from_slice(own);
        }
        let rod = |nodes: &Vec<Increment>| match nodes.is_empty() {
            true => vec![[0.0; 6]; count],
            false => nodes.clone(),
        };
        (self.nodes.iter().map(rod).collect(), gaps)
    }
}

impl LinearResponse {
    /// Zero, for the rods of `leaf`.
    pub fn zeros(leaf: &DiscreteLeaf) -> LinearResponse {
        LinearResponse {
            nodes: vec![vec![[0.0; 6]; leaf.moving_nodes().len()]; leaf.rods()],
            force_changes: vec![DVec3::ZERO; leaf.rods() * leaf.segments()],
        }
    }

    /// Moves a state, but not clamped bases, by `step` times the response.
    pub fn advance(&self, state: &mut State, step: f64) {
        for (j, rod) in self.nodes.iter().enumerate() {
            let first = state.base(j) + state.segments() + 1 - rod.len();
            for (i, increment) in rod.iter().enumerate() {
                state.advance_node(first + i, increment, step);
            }
        }
        let forces = state.n.iter_mut().zip(&self.force_changes);
        forces.for_each(|(force, change)| *force += step * *change);
    }

    /// The increment of node `i` of rod `j` of `leaf`; zero for a clamped base.
    pub fn node_increment(&self, leaf: &DiscreteLeaf, j: usize, i: usize) -> Increment {
        let known = i.checked_sub(leaf.first_node());
        known.map_or([0.0; 6], |k| self.nodes[j][k])
    }

    /// Adds `times` another response.
    pub fn add(&mut self, times: f64, other: &LinearResponse) {
        for (sums, more) in self.nodes.iter_mut().zip(&other.nodes) {
            add_scaled_increments(sums, times, more);
        }
        let carried = self.force_changes.iter_mut().zip(&other.force_changes);
        carried.for_each(|(sum, more)| *sum += times * *more);
    }
}

fn add_scaled_increments(sums: &mut [Increment], times: f64, more: &[Increment]) {
    for (sum, more) in sums.iter_mut().zip(more) {
        (sum.iter_mut().zip(more)).for_each(|(sum, more)| *sum += times * more);
    }
}

/// The leaves of neighbouring scenarios with their weights, in the units of this one.
fn weighted_leaves(leaf: &Leaf, terms: &[(f64, Scenario)]) -> Vec<(f64, Leaf)> {
    let each = terms.iter().map(|(weight, scenario)| {
        let scenario = Arc::new(scenario.clone());
        (*weight, Leaf::with_scale(scenario, leaf.scale))
    });
    each.collect()
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

/// Sigma and derivative of every dead moment that changes, over a unit.
fn moment_rates(terms: &[(f64, Scenario)], unit: f64) -> Vec<(f64, DVec3)> {
    let rate = |moment: &dyn Fn(&Scenario) -> [f64; 3]| {
        DVec3::from_array([0, 1, 2].map(|axis| value_derivative(terms, &|s| moment(s)[axis])))
            / unit
    };
    let points = terms[0].1.points.iter().enumerate();
    let on_points = points.map(|(k, point)| (point.at, rate(&|s| s.points[k].moment)));
    let all = std::iter::once((1.0, rate(&|s| s.tip_moment))).chain(on_points);
    all.filter(|(_, moment)| *moment != DVec3::ZERO).collect()
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
