//! The derivative of a leaf with respect to a number of its scenario: what changes of its rods, its
//! profiles and its held tips, the forces of that change, and the response of the nodes to them.

use crate::leaf::Leaf;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{Increment, NodalField, State};
use crate::rod::{Section, SectionParameterDerivative, Segment, SegmentHessian};
use crate::rotation;
use crate::scenario::{Clamp, Profile, Scenario};
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// The derivative of a leaf: weighted sums over scenarios that differ in the number, with
/// weights that add up to zero.
pub struct LeafParameterDerivative<'s> {
    pub(super) rods: Vec<RodParameterDerivative<'s>>,
    pub(super) coupling: Vec<DVec3>,
    pub(super) gravity: DVec3,
    pub(super) tip_force: DVec3,
    /// Sigma and change of dead moments on a single rod.
    pub(super) moments: Vec<(f64, DVec3)>,
    pub(super) held: Option<TipSupportDerivative>,
    /// The leaves that differ in the number, with their weights, if they have tissue, loads of
    /// single veins, or grips.
    pub(super) weighted_leaves: Vec<(f64, Leaf)>,
}

/// The derivative of a rod, in the leaf's units.
pub(super) struct RodParameterDerivative<'s> {
    pub(super) length: f64,
    /// Of a clamped base: its position, its rotation.
    pub(super) base: [DVec3; 2],
    /// Of the place of a hinge.
    hinge: DVec3,
    couple_stiffness: [ProfileDerivative<'s>; 3],
    force_stiffness: [ProfileDerivative<'s>; 3],
    rest_curvature: [ProfileDerivative<'s>; 3],
    rest_stretch: ProfileDerivative<'s>,
}

/// The derivative of a profile: a weighted sum of profiles, without terms if it is zero.
pub(super) struct ProfileDerivative<'s>(Vec<(f64, &'s Profile)>);

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
    pub(super) fn hinge_displacement_rate(&self, j: usize) -> DVec3 {
        self.rods[j].hinge
    }

    /// The rates of displacement and rotation of the base of rod `j` if it is clamped.
    pub fn base_motion_rates(&self, j: usize) -> [DVec3; 2] {
        self.rods[j].base
    }
}

impl RodParameterDerivative<'_> {
    /// Whether all sections of the rod are unchanged.
    pub(super) fn sections_unchanged(&self) -> bool {
        let triples = [
            &self.couple_stiffness,
            &self.force_stiffness,
            &self.rest_curvature,
        ];
        let mut slopes = triples.into_iter().flatten().chain([&self.rest_stretch]);
        self.length == 0.0 && slopes.all(ProfileDerivative::is_zero)
    }

    /// The derivative of a section at `sigma` whose segment is the fraction `width` of the rod.
    pub(super) fn section(
        &self,
        section: &Section,
        sigma: f64,
        width: f64,
    ) -> SectionParameterDerivative {
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

/// The derivative of a number of the scenario: relative to the first, so that without changes it
/// is exactly zero.
pub(super) fn value_derivative(terms: &[(f64, Scenario)], value: &dyn Fn(&Scenario) -> f64) -> f64 {
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

pub(super) fn add_scaled_increments(sums: &mut [Increment], times: f64, more: &[Increment]) {
    for (sum, more) in sums.iter_mut().zip(more) {
        (sum.iter_mut().zip(more)).for_each(|(sum, more)| *sum += times * more);
    }
}

/// The rate of change of the position and the orientation of the tips' holder, in the leaf's units.
pub(super) struct TipSupportDerivative {
    shift: DVec3,
    /// Rotations of the clamps, one per rod; empty for a pinned tip.
    turns: Vec<DVec3>,
}

impl TipSupportDerivative {
    /// `None` if the tips are free, or their holder does not move.
    pub fn new(leaf: &Leaf, terms: &[(f64, Scenario)]) -> Option<Self> {
        let held = leaf.tip_support.as_ref()?;
        let of = |value: &dyn Fn(&Scenario) -> f64| value_derivative(terms, value);
        let axis =
            |axis: usize| of(&|s| s.held_tip.as_ref().map_or(0.0, |held| held.position[axis]));
        let shift = DVec3::from_array([0, 1, 2].map(axis)) / leaf.scale.length;
        let clamp = |s: &Scenario, j: usize| Some(s.held_tip.as_ref()?.clamps.as_ref()?[j]);
        // The angle about e3, then the twist about the resulting d1, as in the clamp's definition.
        let turn = |(j, own): (usize, &Clamp)| {
            let d1 = DQuat::from_rotation_z(own.angle) * DVec3::X;
            let angle = of(&|s| clamp(s, j).map_or(0.0, |clamp| clamp.angle));
            let twist = of(&|s| clamp(s, j).map_or(0.0, |clamp| clamp.twist));
            angle * DVec3::Z + twist * d1
        };
        let clamps = held.clamps.iter().flatten().enumerate();
        let turns: Vec<DVec3> = clamps.map(turn).collect();
        let moves = shift != DVec3::ZERO || turns.iter().any(|turn| *turn != DVec3::ZERO);
        moves.then_some(TipSupportDerivative { shift, turns })
    }
}

impl TipSupportDerivative {
    /// The increment of the tip of rod `j`.
    pub(super) fn tip_increment(&self, j: usize) -> Increment {
        increment_from_vectors(
            self.turns.get(j).copied().unwrap_or(DVec3::ZERO),
            self.shift,
        )
    }
}

/// The derivatives of the position and of the rotation of the base of rod `j`.
pub(super) fn base_rate(terms: &[(f64, Scenario)], j: usize, length: f64) -> [DVec3; 2] {
    let (first, turned) = terms[0].1.base(j);
    let mut rate = [DVec3::ZERO; 2];
    for (weight, scenario) in terms {
        let (x, q) = scenario.base(j);
        rate[0] += *weight * (x - first) / length;
        rate[1] += *weight * rotation::log(q * turned.conjugate());
    }
    rate
}

/// Sigma and derivative of every dead moment that changes, over a unit.
pub(super) fn moment_rates(terms: &[(f64, Scenario)], unit: f64) -> Vec<(f64, DVec3)> {
    let rate = |moment: &dyn Fn(&Scenario) -> [f64; 3]| {
        DVec3::from_array([0, 1, 2].map(|axis| value_derivative(terms, &|s| moment(s)[axis])))
            / unit
    };
    let points = terms[0].1.points.iter().enumerate();
    let on_points = points.map(|(k, point)| (point.at, rate(&|s| s.points[k].moment)));
    let all = std::iter::once((1.0, rate(&|s| s.tip_moment))).chain(on_points);
    all.filter(|(_, moment)| *moment != DVec3::ZERO).collect()
}

/// The leaves of neighbouring scenarios with their weights, in the units of this one.
pub(super) fn weighted_leaves(leaf: &Leaf, terms: &[(f64, Scenario)]) -> Vec<(f64, Leaf)> {
    let each = terms.iter().map(|(weight, scenario)| {
        let scenario = Arc::new(scenario.clone());
        (*weight, Leaf::with_scale(scenario, leaf.scale))
    });
    each.collect()
}

pub(super) fn increment_from_vectors(turned: DVec3, moved: DVec3) -> Increment {
    let [a, b] = [turned.to_array(), moved.to_array()];
    [a[0], a[1], a[2], b[0], b[1], b[2]]
}
