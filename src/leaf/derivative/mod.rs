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
use crate::leaf::derivative::supports::HeldRate;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{Field, Increment, State, add};
use crate::rod::{Blocks, Section, SectionRate, Segment, Strip};
use crate::rotation;
use crate::scenario::{Profile, Scenario};
use glam::DVec3;
use std::sync::Arc;

/// The derivative of a leaf: weighted sums over scenarios that differ in the number, with
/// weights that add up to zero.
pub struct LeafRate<'s> {
    rods: Vec<RodRate<'s>>,
    coupling: Vec<DVec3>,
    gravity: DVec3,
    tip_force: DVec3,
    /// Sigma and change of dead moments on a single rod.
    moments: Vec<(f64, DVec3)>,
    held: Option<HeldRate>,
    /// The leaves that differ in the number, with their weights, if they have tissue, loads of
    /// single veins, or grips.
    leaves: Vec<(f64, Leaf)>,
}

/// The derivative of a rod, in the leaf's units.
struct RodRate<'s> {
    length: f64,
    /// Of a clamped base: its position, its rotation.
    base: [DVec3; 2],
    /// Of the place of a hinge.
    hinge: DVec3,
    couple_stiffness: [Slope<'s>; 3],
    force_stiffness: [Slope<'s>; 3],
    rest_curvature: [Slope<'s>; 3],
    rest_stretch: Slope<'s>,
}

/// The derivative of a profile: a weighted sum of profiles, without terms if it is zero.
struct Slope<'s>(Vec<(f64, &'s Profile)>);

impl<'s> Slope<'s> {
    fn of(
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
        Slope(profiles)
    }

    fn at(&self, sigma: f64) -> f64 {
        let terms = self.0.iter().map(|(weight, p)| weight * p.at(sigma));
        terms.fold(0.0, |sum, term| sum + term)
    }

    fn is_none(&self) -> bool {
        self.0.is_empty()
    }
}

impl<'s> LeafRate<'s> {
    /// Of a leaf, from neighbouring scenarios with their weights.
    pub fn new(leaf: &Leaf, terms: &'s [(f64, Scenario)]) -> Self {
        let scale = leaf.scale;
        let sum = |value: &dyn Fn(&Scenario) -> f64| change(terms, value);
        let vector = |value: fn(&Scenario) -> [f64; 3], unit: f64| {
            DVec3::from_array([0, 1, 2].map(|axis| sum(&|s| value(s)[axis]))) / unit
        };
        let bases = |j: usize| match (base_rate(terms, j, scale.length), leaf.hinged()) {
            ([shift, _], true) => ([DVec3::ZERO; 2], shift),
            (clamped, false) => (clamped, DVec3::ZERO),
        };
        let rod = |j: usize| RodRate {
            length: sum(&|s| s.rods[j].length) / scale.length,
            base: bases(j).0,
            hinge: bases(j).1,
            couple_stiffness: [0, 1, 2].map(|k| {
                Slope::of(terms, 1.0 / scale.stiffness, move |s| {
                    &s.rods[j].couple_stiffness[k]
                })
            }),
            force_stiffness: [0, 1, 2].map(|k| {
                Slope::of(terms, 1.0 / scale.force(), move |s| {
                    &s.rods[j].force_stiffness[k]
                })
            }),
            rest_curvature: [0, 1, 2]
                .map(|k| Slope::of(terms, scale.length, move |s| &s.rods[j].rest_curvature[k])),
            rest_stretch: Slope::of(terms, 1.0, move |s| &s.rods[j].rest_stretch),
        };
        let rods = leaf.scenario().rods.len();
        // Per unit of sigma, as in `Leaf::coupling`.
        let gap = |s: &Scenario, g: usize| 0.5 * (s.rods[g].length + s.rods[g + 1].length);
        let unit = scale.length / scale.force();
        let coupling = |g: usize| {
            let of = |axis: usize| sum(&|s| s.coupling[g][axis] * gap(s, g));
            DVec3::from_array([0, 1, 2].map(of)) * unit
        };
        LeafRate {
            rods: (0..rods).map(rod).collect(),
            coupling: (0..rods - 1).map(coupling).collect(),
            gravity: vector(|s| s.gravity, scale.force() / scale.length),
            tip_force: vector(|s| s.tip_force, scale.force()),
            moments: moment_rates(terms, scale.moment()),
            held: HeldRate::new(leaf, terms),
            leaves: match leaf.has_tissue()
                || terms
                    .iter()
                    .any(|(_, s)| s.has_own_loads() || !s.grips.is_empty())
            {
                true => leaves(leaf, terms),
                false => Vec::new(),
            },
        }
    }
}

impl LeafRate<'_> {
    /// The rate of displacement of the hinge of rod `j`.
    fn of_hinge(&self, j: usize) -> DVec3 {
        self.rods[j].hinge
    }

    /// The rates of displacement and rotation of the base of rod `j` if it is clamped.
    pub fn of_base(&self, j: usize) -> [DVec3; 2] {
        self.rods[j].base
    }
}

impl RodRate<'_> {
    /// Whether all sections of the rod are unchanged.
    fn sections_unchanged(&self) -> bool {
        let triples = [
            &self.couple_stiffness,
            &self.force_stiffness,
            &self.rest_curvature,
        ];
        let mut slopes = triples.into_iter().flatten().chain([&self.rest_stretch]);
        self.length == 0.0 && slopes.all(Slope::is_none)
    }

    /// The derivative of a section at `sigma` whose segment is the fraction `width` of the rod.
    fn section(&self, section: &Section, sigma: f64, width: f64) -> SectionRate {
        let at = |slopes: &[Slope; 3]| DVec3::from_array(slopes.each_ref().map(|s| s.at(sigma)));
        let compliance = section.compliance;
        SectionRate {
            ds: self.length * width,
            couple_stiffness: at(&self.couple_stiffness),
            rest_curvature: at(&self.rest_curvature),
            rest_strain: DVec3::X * self.rest_stretch.at(sigma),
            compliance: -compliance * compliance * at(&self.force_stiffness),
        }
    }
}

impl DiscreteLeaf {
    /// All segments in a state, rod after rod, for use by all derivatives in that state.
    pub fn all_segments(&self, state: &State) -> Vec<Segment> {
        let n = self.segments();
        let each = self.each(0..n);
        each.map(|(j, i)| self.segment(state, j, i, state.n[j * n + i]))
            .collect()
    }

    /// The effect of a parameter change of the leaf (all of its rods, in space) in a state
    /// with these segments.
    pub fn rate(&self, state: &State, segments: &[Segment], rate: &LeafRate) -> Forces {
        let mut forces = Forces::zeros(self.rods());
        let neighbours = self.each_of(rate);
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
        let motion = self.held_motion(rate, &neighbours);
        self.add_held_motion(state, segments, motion, &mut forces);
        forces
    }

    fn add_section_changes(
        &self,
        segments: &[Segment],
        j: usize,
        rod: &RodRate,
        neighbours: &[(f64, DiscreteLeaf)],
        forces: &mut Forces,
    ) {
        let (n, first) = (self.segments(), self.first_node());
        forces.on_nodes(j, n + 1 - first);
        forces.on_gaps(j, n);
        for i in 0..n {
            let section = self.section(j, i);
            let segment = &segments[j * n + i];
            let mut change = rod.section(section, self.grid.middle(i), self.grid.width(i));
            if self.tied() {
                [change.rest_strain, change.rest_curvature] = rest_rates(neighbours, j, i);
            }
            let change = segment.rate(section, &change);
            let [left, right] = change.gradient;
            let nodes = &mut forces.nodes[j];
            if i >= first {
                add(&mut nodes[i - first], -left, DVec3::ZERO);
            }
            add(&mut nodes[i + 1 - first], -right, DVec3::ZERO);
            forces.gaps[j][i] += change.gap;
            forces.energy += change.energy;
        }
    }

    /// Loads and coupling of rod `j`, as in [`DiscreteLeaf::load`].
    fn add_load_changes(&self, state: &State, j: usize, rate: &LeafRate, forces: &mut Forces) {
        let (n, first) = (self.segments(), self.first_node());
        let count = n + 1 - first;
        let rod = &rate.rods[j];
        let gravity = self.loads.gravity * rod.length + rate.gravity * self.leaf.length(j);
        let ends_here = j == 0 || !self.leaf.joined();
        forces.on_nodes(j, count);
        if rate.coupling.get(j).is_some_and(|gap| *gap != DVec3::ZERO) {
            forces.on_nodes(j + 1, count);
        }
        let base = state.x[state.base(j)];
        forces.energy -= (gravity * (self.load_factor * self.grid.weight(0))).dot(base);
        if let Some(change) = rate.coupling.get(j) {
            let stretch = state.x[state.base(j + 1)] - base;
            forces.energy += 0.5 * self.grid.weight(0) * (*change * stretch).dot(stretch);
        }
        for i in 1..=n {
            let x = state.x[state.base(j) + i];
            let mut force = gravity * (self.load_factor * self.grid.weight(i));
            if i == n && ends_here {
                force += self.load_factor * rate.tip_force;
            }
            forces.energy -= force.dot(x);
            let coupled = rate.coupling.get(j).is_some_and(|gap| *gap != DVec3::ZERO);
            if coupled && !(self.leaf.joined() && i == n) {
                let stretch = state.x[state.base(j + 1) + i] - x;
                let pull = rate.coupling[j] * self.grid.weight(i) * stretch;
                forces.energy += 0.5 * pull.dot(stretch);
                force += pull;
                add(&mut forces.nodes[j + 1][i - first], DVec3::ZERO, -pull);
            }
            add(&mut forces.nodes[j][i - first], DVec3::ZERO, force);
        }
    }

    /// The work of forces on a response to others: by symmetry also that of the
    /// others on the response to these.
    pub fn work(&self, segments: &[Segment], forces: &Forces, response: &Response) -> f64 {
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
                work -= response.carried[j * n + i].dot(segments[j * n + i].frame * *gap);
            }
        }
        work
    }

    /// Adds to forces on the nodes the contribution of changes of the gaps when the forces of
    /// the segments are condensed out.
    pub fn condense_gaps(&self, segments: &[Segment], gaps: &[DVec3], nodes: &mut Field) {
        let (n, first) = (self.segments(), self.first_node());
        for (j, i) in self.each(0..n) {
            let gap = gaps[j * n + i];
            if gap == DVec3::ZERO {
                continue;
            }
            let segment = &segments[j * n + i];
            let (g_x, g_a, g_b) = segment.gap_gradient(self.section(j, i), gap);
            if i >= first {
                add(&mut nodes[j][i - first], -g_a, g_x);
            }
            add(&mut nodes[j][i + 1 - first], -g_b, -g_x);
        }
        // Held components have no equations.
        self.clear_held_forces(nodes);
    }

    /// The changes of the forces of all segments for increments of the nodes and changes of
    /// the gaps, and the remaining gaps, which are nonzero where the condensing stiffness is
    /// less than the segment's own.
    pub fn carried(
        &self,
        segments: &[Segment],
        increments: &Field,
        gaps: &mut [DVec3],
        carried: &mut [DVec3],
    ) {
        let n = self.segments();
        for (j, rod) in increments.iter().enumerate() {
            let (bases, nodes) = rod.split_at(1 - self.first_node());
            let base = bases.first().copied().unwrap_or([0.0; 6]);
            let (mut a, mut dx0) = (crate::leaf::turn(&base), crate::leaf::shift(&base));
            for (i, increment) in nodes.iter().enumerate() {
                let k = j * n + i;
                let (b, dx1) = (crate::leaf::turn(increment), crate::leaf::shift(increment));
                let section = self.section(j, i);
                let segment = &segments[k];
                let gap = gaps[k] + segment.gap_increment(section, dx1 - dx0, a, b);
                carried[k] += segment.frame * (section.condensing * gap / section.ds);
                gaps[k] = gap * self.missing_part(j, i);
                (a, dx0) = (b, dx1);
            }
        }
    }
}

/// The derivative of a number of the scenario: relative to the first, so that without changes it
/// is exactly zero.
fn change(terms: &[(f64, Scenario)], value: &dyn Fn(&Scenario) -> f64) -> f64 {
    let first = value(&terms[0].1);
    let change = |(weight, s): &(f64, Scenario)| weight * (value(s) - first);
    terms.iter().map(change).sum()
}

/// Second derivatives of a segment at constant force.
pub fn at_constant_force(segment: &Segment, section: &Section) -> Blocks {
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
        forces: &mut Forces,
    ) {
        let n = self.segments();
        let section = self.section(j, 0);
        let segment = &segments[j * n];
        let k = at_constant_force(segment, section);
        add(
            &mut forces.on_nodes(j, n)[0],
            k.xb.transpose() * shift - k.ab.transpose() * turn,
            k.xx * shift - k.xa * turn,
        );
        forces.on_gaps(j, n)[0] += segment.gap_increment(section, -shift, turn, DVec3::ZERO);
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
pub struct Forces {
    /// On the unbalanced forces at the nodes.
    pub nodes: Field,
    /// On the gaps of the segments (residuals of their constitutive laws).
    pub gaps: Vec<Vec<DVec3>>,
    /// On the energy.
    pub energy: f64,
    /// Increments of held nodes. Rods on which it moves none have no entries.
    pub moved: Field,
}

/// The linear response of a leaf to forces.
#[derive(Clone, Debug)]
pub struct Response {
    /// Increments of the nodes.
    pub nodes: Field,
    /// Changes of the spatial forces of the segments, rod after rod.
    pub carried: Vec<DVec3>,
}

impl Forces {
    /// Zero, for `rods` rods.
    pub fn zeros(rods: usize) -> Forces {
        Forces {
            nodes: vec![Vec::new(); rods],
            gaps: vec![Vec::new(); rods],
            energy: 0.0,
            moved: vec![Vec::new(); rods],
        }
    }

    /// The forces on the nodes of rod `j`, of which `count` have equations.
    pub fn on_nodes(&mut self, j: usize, count: usize) -> &mut [Increment] {
        let nodes = &mut self.nodes[j];
        nodes.resize(count, [0.0; 6]);
        nodes
    }

    /// The effects on the gaps of rod `j`, which has `segments` of them.
    pub fn on_gaps(&mut self, j: usize, segments: usize) -> &mut [DVec3] {
        let gaps = &mut self.gaps[j];
        gaps.resize(segments, DVec3::ZERO);
        gaps
    }

    /// Adds `times` other forces.
    pub fn add(&mut self, times: f64, other: &Forces) {
        for (j, (nodes, gaps)) in other.nodes.iter().zip(&other.gaps).enumerate() {
            let count = nodes.len().max(self.nodes[j].len());
            add_nodes(self.on_nodes(j, count), times, nodes);
            let count = gaps.len().max(self.gaps[j].len());
            let sums = self.on_gaps(j, count);
            (sums.iter_mut().zip(gaps)).for_each(|(sum, more)| *sum += times * *more);
        }
        self.energy += times * other.energy;
        for (moved, more) in self.moved.iter_mut().zip(&other.moved) {
            moved.resize(moved.len().max(more.len()), [0.0; 6]);
            add_nodes(moved, times, more);
        }
    }

    /// Forces on all nodes and effects on all gaps of the rods of `leaf`, zeros included.
    pub fn dense(&self, leaf: &DiscreteLeaf) -> (Field, Vec<DVec3>) {
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

impl Response {
    /// Zero, for the rods of `leaf`.
    pub fn zeros(leaf: &DiscreteLeaf) -> Response {
        Response {
            nodes: vec![vec![[0.0; 6]; leaf.moving_nodes().len()]; leaf.rods()],
            carried: vec![DVec3::ZERO; leaf.rods() * leaf.segments()],
        }
    }

    /// Moves a state, but not clamped bases, by `step` times the response.
    pub fn advance(&self, state: &mut State, step: f64) {
        for (j, rod) in self.nodes.iter().enumerate() {
            let first = state.base(j) + state.segments() + 1 - rod.len();
            for (i, increment) in rod.iter().enumerate() {
                state.advance(first + i, increment, step);
            }
        }
        let forces = state.n.iter_mut().zip(&self.carried);
        forces.for_each(|(force, change)| *force += step * *change);
    }

    /// The increment of node `i` of rod `j` of `leaf`; zero for a clamped base.
    pub fn of_node(&self, leaf: &DiscreteLeaf, j: usize, i: usize) -> Increment {
        let known = i.checked_sub(leaf.first_node());
        known.map_or([0.0; 6], |k| self.nodes[j][k])
    }

    /// Adds `times` another response.
    pub fn add(&mut self, times: f64, other: &Response) {
        for (sums, more) in self.nodes.iter_mut().zip(&other.nodes) {
            add_nodes(sums, times, more);
        }
        let carried = self.carried.iter_mut().zip(&other.carried);
        carried.for_each(|(sum, more)| *sum += times * *more);
    }
}

fn add_nodes(sums: &mut [Increment], times: f64, more: &[Increment]) {
    for (sum, more) in sums.iter_mut().zip(more) {
        (sum.iter_mut().zip(more)).for_each(|(sum, more)| *sum += times * more);
    }
}

/// The leaves of neighbouring scenarios with their weights, in the units of this one.
fn leaves(leaf: &Leaf, terms: &[(f64, Scenario)]) -> Vec<(f64, Leaf)> {
    let each = terms.iter().map(|(weight, scenario)| {
        let scenario = Arc::new(scenario.clone());
        (*weight, Leaf::in_units(scenario, leaf.scale))
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
    fn each_of(&self, rate: &LeafRate) -> Vec<(f64, DiscreteLeaf)> {
        let leaves = rate.leaves.iter();
        leaves
            .map(|(weight, leaf)| (*weight, DiscreteLeaf::new(leaf, self.grid.clone())))
            .collect()
    }

    /// The change of the loads that rod `j` has of its own on its node `i`.
    fn own_load_rate(&self, rate: &LeafRate, j: usize, i: usize) -> DVec3 {
        let sigma = self.grid.sigma()[i];
        let on = |leaf: &Leaf| {
            let points = leaf.point_loads();
            let here = points.filter(|(rod, at, _)| (*rod, self.grid.nearest(*at)) == (j, i));
            let points: DVec3 = here.map(|(_, _, force)| force).sum();
            self.grid.weight(i) * leaf.own_load(j, sigma) + points
        };
        rate.leaves
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
        forces: &mut Forces,
    ) {
        let (n, nodes) = (self.segments(), self.moving_nodes());
        for (j, i) in self.each(0..n + 1) {
            let first = each[0].1.own_load(j, i);
            let changes = each
                .iter()
                .map(|(w, leaf)| *w * (leaf.own_load(j, i) - first));
            let change = self.load_factor * changes.sum::<DVec3>();
            if change != DVec3::ZERO {
                forces.energy -= change.dot(state.x[state.base(j) + i]);
                if nodes.contains(&i) {
                    let on = &mut forces.on_nodes(j, nodes.len())[i - nodes.start];
                    add(on, DVec3::ZERO, change);
                }
            }
        }
    }

    /// Adds the effect of the changes of the tissue, and of its natural state, and of loads of
    /// single veins: from the weighted leaves of which they are the sum.
    fn add_tissue_changes(&self, state: &State, each: &[(f64, DiscreteLeaf)], forces: &mut Forces) {
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
            let mut change = Strip::default();
            for (weight, strips) in &each {
                change.add(**weight, &strips[k].minus(own));
            }
            if change == Strip::default() {
                continue;
            }
            let (g, i) = (k / (n + 1), k % (n + 1));
            let (energy, loads) = self.tissue_rates(state, (g, i), &change);
            forces.energy += energy;
            for (j, [moment, force]) in [g, g + 1].into_iter().zip(loads) {
                if nodes.contains(&i) {
                    let on = &mut forces.on_nodes(j, nodes.len())[i - nodes.start];
                    add(on, moment, force);
                }
            }
        }
    }
}

/// Sigma and derivative of every dead moment that changes, over a unit.
fn moment_rates(terms: &[(f64, Scenario)], unit: f64) -> Vec<(f64, DVec3)> {
    let rate = |moment: &dyn Fn(&Scenario) -> [f64; 3]| {
        DVec3::from_array([0, 1, 2].map(|axis| change(terms, &|s| moment(s)[axis]))) / unit
    };
    let points = terms[0].1.points.iter().enumerate();
    let on_points = points.map(|(k, point)| (point.at, rate(&|s| s.points[k].moment)));
    let all = std::iter::once((1.0, rate(&|s| s.tip_moment))).chain(on_points);
    all.filter(|(_, moment)| *moment != DVec3::ZERO).collect()
}

impl LeafRate<'_> {
    /// Whether dead moments change.
    pub fn changes_moments(&self) -> bool {
        !self.moments.is_empty()
    }
}

impl DiscreteLeaf {
    /// Adds the changes of dead moments.
    fn add_moment_changes(&self, rate: &LeafRate, forces: &mut Forces) {
        for (sigma, moment) in &rate.moments {
            let nodes = forces.on_nodes(0, self.moving_nodes().len());
            if let Some(i) = self.grid.nearest(*sigma).checked_sub(self.first_node()) {
                add(&mut nodes[i], self.load_factor * *moment, DVec3::ZERO);
            }
        }
    }
}
