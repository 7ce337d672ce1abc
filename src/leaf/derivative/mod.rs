//! The derivative of a leaf with respect to a number of its scenario: of its forces in a given
//! state, and of its energy. Exact except for the finite differences of scenarios that define
//! the number's effect on the scenario itself.

mod bases;
mod forces;
mod held;
mod leaves;
mod moments;

use crate::leaf::derivative::bases::base_rate;
pub use crate::leaf::derivative::forces::{Forces, Response};
use crate::leaf::derivative::held::HeldRate;
use crate::leaf::derivative::leaves::{leaves, rest_rates};
use crate::leaf::derivative::moments::moment_rates;
use crate::leaf::dimensionless::Leaf;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{Field, State, add};
use crate::rod::{Blocks, Section, SectionRate, Segment};
use crate::scenario::{Profile, Scenario};
use glam::DVec3;

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
    pub(in crate::leaf::derivative) fn of_hinge(&self, j: usize) -> DVec3 {
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
