//! What of a leaf changes with a number of its scenario: its rods, profiles, loads and held tips
//! ([`LeafParameterDerivative`]); the forces by which that unbalances the leaf ([`ParameterForces`]);
//! and the response of the nodes to such forces ([`LinearResponse`]).

use crate::leaf::Leaf;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::loads::PointMoment;
use crate::leaf::state::{Increment, NodalField, NodeIncrement, State};
use crate::rod::{Section, SectionParameterDerivative, Segment, SegmentHessian};
use crate::rotation;
use crate::scenario::{Clamp, Profile, Scenario};
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// A term of a weighted sum, such as a derivative by finite differences.
#[derive(Clone, Copy, Debug)]
pub struct Weighted<T> {
    pub weight: f64,
    pub term: T,
}

/// The derivative of a leaf: weighted sums over scenarios that differ in the number, with
/// weights that add up to zero.
pub struct LeafParameterDerivative<'s> {
    pub(super) rods: Vec<RodParameterDerivative<'s>>,
    /// Rates of the coupling of every gap, per unit of sigma.
    pub(super) coupling: Vec<DVec3>,
    pub(super) gravity: DVec3,
    pub(super) tip_force: DVec3,
    /// Rates of the dead moments that change.
    pub(super) moments: Vec<PointMoment>,
    /// Rate of the place of the tips' holder, if that moves.
    pub(super) held: Option<TipSupportDerivative>,
    /// The leaves that differ in the number, if they have tissue, springs at the bases, loads of single veins, loads
    /// without a potential, or grips.
    pub(super) weighted_leaves: Vec<Weighted<Leaf>>,
}

/// The derivative of a rod, in the leaf's units.
pub(super) struct RodParameterDerivative<'s> {
    pub(super) length: f64,
    /// Rate of the place of a clamped base without equations; zero for others.
    pub(super) base: NodeIncrement,
    /// Rate of what is held of a base with equations: of the position of a hinge, of the place of a clamp
    /// beside hinges; zero for others.
    held_base: NodeIncrement,
    couple_stiffness: [ProfileDerivative<'s>; 3],
    force_stiffness: [ProfileDerivative<'s>; 3],
    rest_curvature: [ProfileDerivative<'s>; 3],
    rest_stretch: ProfileDerivative<'s>,
}

/// The derivative of a profile: a weighted sum of profiles, without terms if it is zero.
struct ProfileDerivative<'s>(Vec<Weighted<&'s Profile>>);

impl<'s> ProfileDerivative<'s> {
    fn from_terms(
        terms: &'s [Weighted<Scenario>],
        unit: f64,
        profile: impl Fn(&'s Scenario) -> &'s Profile,
    ) -> Self {
        let first = profile(&terms[0].term);
        let profiles = terms.iter().map(|it| Weighted {
            weight: it.weight * unit,
            term: profile(&it.term),
        });
        let mut profiles: Vec<_> = profiles.collect();
        if profiles.iter().all(|it| it.term == first) {
            profiles.clear();
        }
        ProfileDerivative(profiles)
    }

    fn value_at(&self, sigma: f64) -> f64 {
        let terms = self.0.iter().map(|it| it.weight * it.term.at(sigma));
        terms.fold(0.0, |sum, term| sum + term)
    }

    fn is_zero(&self) -> bool {
        self.0.is_empty()
    }
}

impl<'s> LeafParameterDerivative<'s> {
    /// The derivative of `leaf` from neighboring scenarios.
    pub fn new(leaf: &Leaf, terms: &'s [Weighted<Scenario>]) -> Self {
        let scale = leaf.scale;
        let sum = |value: &dyn Fn(&Scenario) -> f64| value_derivative(terms, value);
        let vector = |value: fn(&Scenario) -> [f64; 3], unit: f64| {
            DVec3::from_array([0, 1, 2].map(|axis| sum(&|s| value(s)[axis]))) / unit
        };
        let none = NodeIncrement::default();
        let rod = |j: usize| RodParameterDerivative {
            length: sum(&|s| s.rods[j].length) / scale.length,
            base: match leaf.hinged() {
                true => none,
                false => base_rate(terms, j, scale.length),
            },
            held_base: match (leaf.hinged(), leaf.base_turns(j)) {
                // A joint that holds the spin turns its base as its natural frame turns.
                (true, true) if !leaf.holds_base_spin(j) => NodeIncrement {
                    rotation: DVec3::ZERO,
                    ..base_rate(terms, j, scale.length)
                },
                (true, _) => base_rate(terms, j, scale.length),
                (false, _) => none,
            },
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
                || leaf.has_base_springs()
                || terms.iter().any(|it| depends_on_whole_leaf(&it.term))
            {
                true => weighted_leaves(leaf, terms),
                false => Vec::new(),
            },
        }
    }
}

impl LeafParameterDerivative<'_> {
    /// The rate of what is held of the base of rod `j`, if that has equations.
    pub(super) fn held_base_rate(&self, j: usize) -> NodeIncrement {
        self.rods[j].held_base
    }

    /// The leaves that differ in the number, if all that changes is not told otherwise.
    pub fn weighted_leaves(&self) -> &[Weighted<Leaf>] {
        &self.weighted_leaves
    }

    /// Whether dead moments change.
    pub fn changes_moments(&self) -> bool {
        !self.moments.is_empty()
    }

    /// The rate of the place of the base of rod `j` if it is clamped and has no equations.
    pub fn base_motion_rate(&self, j: usize) -> NodeIncrement {
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

/// The derivative of a value of the scenario: a weighted sum of differences from the first scenario, so
/// that the derivative of an unchanged value is exactly zero.
fn value_derivative(terms: &[Weighted<Scenario>], value: &dyn Fn(&Scenario) -> f64) -> f64 {
    let first = value(&terms[0].term);
    let change = |it: &Weighted<Scenario>| it.weight * (value(&it.term) - first);
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
    /// Changes of the unbalanced forces at the nodes.
    pub nodes: NodalField,
    /// Changes of the gaps of the segments, which are the residuals of their constitutive laws.
    pub gaps: Vec<Vec<DVec3>>,
    /// The same of the strips of nodes, if rigid tissue is affected.
    pub tissue_gaps: Vec<DVec3>,
    /// Change of the energy.
    pub energy: f64,
    /// Increments of held nodes. Rods on which no support moves have no entries.
    pub support_increments: NodalField,
}

/// The linear response of a leaf to forces.
#[derive(Clone, Debug)]
pub struct LinearResponse {
    /// Increments of the nodes.
    pub nodes: NodalField,
    /// Changes of the spatial forces of the segments, rod after rod, and of rigid strips of nodes, per
    /// unit of sigma.
    pub force_changes: Vec<DVec3>,
}

impl ParameterForces {
    /// Zero, for `rods` rods.
    pub fn zeros(rods: usize) -> ParameterForces {
        ParameterForces {
            nodes: vec![Vec::new(); rods],
            gaps: vec![Vec::new(); rods],
            tissue_gaps: Vec::new(),
            energy: 0.0,
            support_increments: vec![Vec::new(); rods],
        }
    }

    /// The forces on the nodes of rod `j`, of which `count` have equations.
    pub fn rod_forces_mut(&mut self, j: usize, count: usize) -> &mut [Increment] {
        let nodes = &mut self.nodes[j];
        nodes.resize(count, [0.0; 6]);
        nodes
    }

    /// The changes of the gaps of rod `j`, one for each of its `segments`.
    pub fn gap_effects_mut(&mut self, j: usize, segments: usize) -> &mut [DVec3] {
        let gaps = &mut self.gaps[j];
        gaps.resize(segments, DVec3::ZERO);
        gaps
    }

    /// Adds `times` other forces.
    pub fn add(&mut self, times: f64, other: &ParameterForces) {
        for (j, (nodes, gaps)) in other.nodes.iter().zip(&other.gaps).enumerate() {
            let count = nodes.len().max(self.nodes[j].len());
            add_scaled_increments(self.rod_forces_mut(j, count), times, nodes);
            let count = gaps.len().max(self.gaps[j].len());
            let sums = self.gap_effects_mut(j, count);
            (sums.iter_mut().zip(gaps)).for_each(|(sum, more)| *sum += times * *more);
        }
        let count = self.tissue_gaps.len().max(other.tissue_gaps.len());
        self.tissue_gaps.resize(count, DVec3::ZERO);
        for (sum, more) in self.tissue_gaps.iter_mut().zip(&other.tissue_gaps) {
            *sum += times * *more;
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
    pub fn dense(&self, leaf: &DiscreteLeaf) -> DenseParameterForces {
        let (segments, count) = (leaf.segments(), leaf.moving_nodes().len());
        let mut gaps = vec![DVec3::ZERO; self.gaps.len() * segments];
        for (all, own) in gaps.chunks_mut(segments.max(1)).zip(&self.gaps) {
            all[..own.len()].copy_from_slice(own);
        }
        gaps.extend(&self.tissue_gaps);
        gaps.resize(leaf.force_carrier_count(), DVec3::ZERO);
        let rod = |nodes: &Vec<Increment>| match nodes.is_empty() {
            true => vec![[0.0; 6]; count],
            false => nodes.clone(),
        };
        DenseParameterForces {
            nodes: self.nodes.iter().map(rod).collect(),
            gaps,
        }
    }
}

/// [`ParameterForces`] of all rods, zeros included.
pub struct DenseParameterForces {
    /// Changes of the unbalanced forces at the nodes.
    pub nodes: NodalField,
    /// Changes of the gaps of the segments, rod after rod, and of the strips of nodes.
    pub gaps: Vec<DVec3>,
}

impl LinearResponse {
    /// Zero, for the rods of `leaf`.
    pub fn zeros(leaf: &DiscreteLeaf) -> LinearResponse {
        LinearResponse {
            nodes: vec![vec![[0.0; 6]; leaf.moving_nodes().len()]; leaf.rods()],
            force_changes: vec![DVec3::ZERO; leaf.force_carrier_count()],
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
        let carried = state.n.iter_mut().chain(&mut state.tissue);
        let forces = carried.zip(&self.force_changes);
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
    fn new(leaf: &Leaf, terms: &[Weighted<Scenario>]) -> Option<Self> {
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

    /// The increment of the tip of rod `j`.
    pub(super) fn tip_increment(&self, j: usize) -> NodeIncrement {
        NodeIncrement {
            rotation: self.turns.get(j).copied().unwrap_or(DVec3::ZERO),
            displacement: self.shift,
        }
    }
}

/// The derivative of the place of the base of rod `j`, in units of `length`.
fn base_rate(terms: &[Weighted<Scenario>], j: usize, length: f64) -> NodeIncrement {
    let (first, turned) = terms[0].term.base(j);
    let mut rate = NodeIncrement::default();
    for Weighted { weight, term } in terms {
        let (x, q) = term.base(j);
        rate.displacement += *weight * (x - first) / length;
        rate.rotation += *weight * rotation::log(q * turned.conjugate());
    }
    rate
}

/// The derivatives of the dead moments that change, in units of `unit`.
fn moment_rates(terms: &[Weighted<Scenario>], unit: f64) -> Vec<PointMoment> {
    let rate = |moment: &dyn Fn(&Scenario) -> [f64; 3]| {
        DVec3::from_array([0, 1, 2].map(|axis| value_derivative(terms, &|s| moment(s)[axis])))
            / unit
    };
    let points = terms[0].term.points.iter().enumerate();
    let dead = points.filter(|(_, point)| !point.follows);
    let on_points = dead.map(|(k, point)| PointMoment {
        sigma: point.at,
        moment: rate(&|s| s.points[k].moment),
    });
    let on_tip = PointMoment {
        sigma: 1.0,
        moment: rate(&|s| s.tip_moment),
    };
    let all = std::iter::once(on_tip).chain(on_points);
    all.filter(|it| it.moment != DVec3::ZERO).collect()
}

/// Whether the loads and supports of single veins, or loads without a potential, act on a leaf: their changes are
/// weighted sums over whole leaves.
fn depends_on_whole_leaf(scenario: &Scenario) -> bool {
    scenario.has_own_loads()
        || scenario.needs_stress_free_leaf()
        || scenario.has_followers()
        || scenario.wind.is_some()
}

/// The leaves of neighboring scenarios, in the units of `leaf`.
fn weighted_leaves(leaf: &Leaf, terms: &[Weighted<Scenario>]) -> Vec<Weighted<Leaf>> {
    let each = terms.iter().map(|it| Weighted {
        weight: it.weight,
        term: Leaf::with_scale(Arc::new(it.term.clone()), leaf.scale),
    });
    each.collect()
}
