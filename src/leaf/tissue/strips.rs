//! The strips of tissue at the nodes of every gap: how they are made, the forces that they carry, and sections
//! that are turned against each other by half a turn.
//!
//! Tissue that is rigid or contracts has its strains also from the segments of its veins. Then a node of a gap has
//! three strips: one with the forces along and normal to the veins, and one on either side, in the corners
//! of the cells between two nodes, with the force across and the moment of the fold, and half of the weight:
//! it depends on the four nodes of its cell alone.

use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::State;
use crate::numbers::format_two_digits;
use crate::rod::{NodePair, TissueStrip};
use glam::DVec3;

/// Sections of two neighboring veins that tissue ties, turned against each other by half a turn.
/// The law of the tissue depends on the shorter one of both rotations between them, and jumps there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfTurn {
    /// The first of both veins, from 0.
    pub gap: usize,
    /// Place of the sections, as a fraction of the length.
    pub sigma: f64,
}

impl HalfTurn {
    /// The subject and the predicate of a sentence on it.
    pub fn sentence(&self) -> String {
        format!(
            "the sections of veins {} and {} are turned against each other by half a turn at {} of their length, \
             where the law of the tissue between them jumps from one sense of rotation to the other",
            self.gap + 1,
            self.gap + 2,
            format_two_digits(self.sigma)
        )
    }
}

/// Largest difference from half a turn, in radians, of the rotation between two sections at which an
/// iteration is taken to have ended at half a turn: such iterations go back and forth between both
/// sides of the jump.
const HALF_TURN_TOLERANCE: f64 = 0.01;

/// Stiffness with which the forces of rigid tissue are condensed out, in units of the stiffness of the
/// adjacent segments: in stretch along the veins, in shear normal to them. Each iteration
/// leaves the inverse of it, or less, of an error of these forces; a larger one loses the soft modes to
/// rounding.
pub(super) const RIGID_TISSUE_RATIO: f64 = 1e3;

/// Which strip of a node of a gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StripPlace {
    /// The only one, or that with the forces along and normal to the veins.
    Node,
    /// In the corner of the cell towards the tip.
    Ahead,
    /// In the corner of the cell towards the base.
    Behind,
}

impl StripPlace {
    pub(super) const ALL: [StripPlace; 3] =
        [StripPlace::Node, StripPlace::Ahead, StripPlace::Behind];
}

/// A strip of a leaf, with its place.
#[derive(Clone, Copy)]
pub(super) struct PlacedStrip<'a> {
    pub(super) place: StripPlace,
    /// The gap after rod `gap`.
    pub(super) gap: usize,
    pub(super) node: usize,
    pub(super) strip: &'a TissueStrip,
}

impl PlacedStrip<'_> {
    /// The two nodes of the strip in a state.
    pub(super) fn ends(&self, state: &State) -> NodePair {
        strip_ends(state, self.gap, self.node)
    }

    /// The cosine of half the angle between the sections of the strip, negative where their
    /// quaternions are on opposite sides.
    fn cosine_of_half_angle(&self, state: &State) -> f64 {
        let [a, b] = [self.gap, self.gap + 1].map(|rod| state.q[state.base(rod) + self.node]);
        a.dot(b)
    }
}

impl DiscreteLeaf {
    /// For every strip, whether the quaternions of its nodes are on the same side: in a continuous
    /// motion this changes only where their rotation against each other passes half a turn.
    pub fn strip_alignments(&self, state: &State) -> Vec<bool> {
        let strips = self.each_strip();
        strips
            .map(|it| it.cosine_of_half_angle(state) >= 0.0)
            .collect()
    }

    /// The first place where sections have passed half a turn against each other in a continuous
    /// motion that began with these alignments.
    pub fn half_turn_since(&self, alignments: &[bool], state: &State) -> Option<HalfTurn> {
        let mut strips = self.each_strip().zip(alignments);
        let passed = strips.find(|(it, aligned)| {
            (it.cosine_of_half_angle(state) >= 0.0) != **aligned && it.strip.has_stiffness()
        });
        passed.map(|(it, _)| self.half_turn(it))
    }

    /// The place where sections are turned against each other by nearly half a turn, if any are.
    pub fn half_turn_near(&self, state: &State) -> Option<HalfTurn> {
        let acting = self.each_strip().filter(|it| it.strip.has_stiffness());
        let cosine = |it: &PlacedStrip| it.cosine_of_half_angle(state).abs();
        let nearest = acting.min_by(|a, b| cosine(a).total_cmp(&cosine(b)))?;
        (cosine(&nearest) < (0.5 * HALF_TURN_TOLERANCE).sin()).then(|| self.half_turn(nearest))
    }

    fn half_turn(&self, at: PlacedStrip) -> HalfTurn {
        HalfTurn {
            gap: at.gap,
            sigma: self.grid.sigma()[at.node],
        }
    }

    /// The strips of this leaf on its grid, without force in the stress-free state `natural`: of each kind
    /// gap after gap, base to tip. Their weights are those of the coupling, but for a joint tip, where strips
    /// resist rotations.
    pub(in crate::leaf) fn tissue_strips(&self, natural: &State) -> Vec<TissueStrip> {
        let n = self.segments();
        let has_cells = (0..self.rods() - 1).any(|g| self.leaf.is_tissue_strained_by_veins(g));
        let places = &StripPlace::ALL[..if has_cells { 3 } else { 1 }];
        let strip = |place: StripPlace, g: usize, i: usize| {
            let mut stiffness = self.leaf.tissue_stiffness(g, self.grid.sigma()[i]);
            let k = &mut stiffness.displacement;
            match place {
                StripPlace::Node if has_cells => (k.y, stiffness.fold) = (0.0, 0.0),
                StripPlace::Node => {}
                StripPlace::Ahead | StripPlace::Behind => (k.x, k.z) = (0.0, 0.0),
            }
            if self.is_strip_given(g, i) {
                // Rigid tissue would constrain what is held already.
                let rigid = k.cmpeq(DVec3::splat(f64::INFINITY));
                *k = DVec3::select(rigid, DVec3::ZERO, *k);
            }
            let weight = self.strip_weight(place, i);
            if weight == 0.0 {
                return TissueStrip::default();
            }
            let rigid = RIGID_TISSUE_RATIO * self.segment_stiffness(g, i);
            let k = stiffness.displacement;
            let mut strip = TissueStrip::stress_free_between(
                weight * k,
                weight * stiffness.fold,
                rigid,
                &strip_ends(natural, g, i),
            );
            if place != StripPlace::Node && self.leaf.is_tissue_strained_by_veins(g) {
                strip.contraction = stiffness.contraction;
                strip.offset = strip.stress_free_gap.x;
            }
            strip
        };
        let gaps = 0..self.rods() - 1;
        let each = places
            .iter()
            .flat_map(|&place| gaps.clone().map(move |g| (place, g)));
        each.flat_map(|(place, g)| (0..=n).map(move |i| strip(place, g, i)))
            .collect()
    }

    /// Whether supports determine both nodes of a strip: their places and rotations, or a common place.
    fn is_strip_given(&self, g: usize, i: usize) -> bool {
        let tip = i == self.segments();
        let held = |rod: usize| self.freedom_without_tip_support(rod, i).is_fixed();
        let at_base = i < self.first_node();
        let in_common = tip && (self.leaf.joined() || self.leaf.tip_support.is_some());
        at_base || in_common || held(g) && held(g + 1)
    }

    /// Stiffness of the segments next to the nodes of a strip: along the veins in stretch, normal to them
    /// in shear, which bounds that of a curved leaf.
    fn segment_stiffness(&self, g: usize, i: usize) -> DVec3 {
        let n = self.segments();
        let mut most = DVec3::ZERO;
        for (j, s) in [g, g + 1]
            .into_iter()
            .flat_map(|j| [(j, i.saturating_sub(1)), (j, i.min(n - 1))])
        {
            let section = self.section(j, s);
            let of = |c: f64, k: f64| if c > 0.0 { 1.0 / c } else { k };
            let stretch = of(section.compliance.x, section.condensing.x) / section.ds;
            let shear = of(section.compliance.z, section.condensing.z) / section.ds;
            most = most.max(DVec3::new(stretch, 0.0, shear.min(stretch)));
        }
        most
    }

    /// The weight of a strip, as a fraction of the length; zero where there is none.
    pub(super) fn strip_weight(&self, place: StripPlace, i: usize) -> f64 {
        let half = |i: Option<usize>| {
            i.filter(|i| *i < self.segments())
                .map_or(0.0, |i| 0.5 * self.grid.segment_width(i))
        };
        match place {
            StripPlace::Node => self.grid.node_weight(i),
            StripPlace::Ahead => half(Some(i)),
            StripPlace::Behind => half(i.checked_sub(1)),
        }
    }

    /// Whether tissue ties neighboring rods.
    pub fn has_tissue(&self) -> bool {
        !self.strips.is_empty()
    }

    /// Whether the strips of some gap are strained as their veins are.
    pub fn has_tissue_cells(&self) -> bool {
        self.strips.len() > (self.rods() - 1) * (self.segments() + 1)
    }

    /// The strip at a place of node `i` in gap `g`, if there is one.
    pub(super) fn strip(&self, place: StripPlace, g: usize, i: usize) -> Option<&TissueStrip> {
        self.strips.get(self.strip_index(place, g, i))
    }

    /// The number of a strip.
    pub(super) fn strip_index(&self, place: StripPlace, g: usize, i: usize) -> usize {
        ((place as usize) * (self.rods() - 1) + g) * (self.segments() + 1) + i
    }

    pub(super) fn each_strip(&self) -> impl Iterator<Item = PlacedStrip<'_>> {
        let (nodes, gaps) = (self.segments() + 1, self.rods() - 1);
        let strips = self.strips.iter().enumerate();
        let placed = strips.map(move |(k, strip)| PlacedStrip {
            place: StripPlace::ALL[k / (nodes * gaps)],
            gap: k / nodes % gaps,
            node: k % nodes,
            strip,
        });
        placed.filter(|it| it.place == StripPlace::Node || it.strip.has_stiffness())
    }

    /// The strips of nodes, each with two nodes.
    pub(super) fn each_node_strip(&self) -> impl Iterator<Item = PlacedStrip<'_>> {
        let count = (self.rods() - 1) * (self.segments() + 1);
        let nodes = self.each_strip();
        nodes.take(count.min(self.strips.len()))
    }

    /// The gaps on either side of rod `j`.
    pub(super) fn adjacent_gaps(&self, j: usize) -> impl Iterator<Item = usize> + use<> {
        let gaps = [j.checked_sub(1), (j + 1 < self.rods()).then_some(j)];
        gaps.into_iter().flatten()
    }

    /// The strips on either side of node `i` of rod `j`.
    pub fn adjacent_strips(&self, j: usize, i: usize) -> impl Iterator<Item = &TissueStrip> {
        let gaps = [j.checked_sub(1), Some(j)].into_iter().flatten();
        let gaps = gaps.filter(|g| self.has_tissue() && g + 1 < self.rods());
        gaps.flat_map(move |g| StripPlace::ALL.map(|place| self.strip(place, g, i)))
            .flatten()
    }

    /// The spatial force that a strip carries in a state; `None` if that of its strains.
    pub(super) fn carried_tissue_force(
        &self,
        state: &State,
        place: StripPlace,
        g: usize,
        i: usize,
    ) -> Option<DVec3> {
        let force = state.tissue.get(self.strip_index(place, g, i))?;
        Some(self.strip_weight(place, i) * *force)
    }

    /// The spatial force that the strip of a node carries in a state.
    pub(super) fn node_tissue_force(
        &self,
        state: &State,
        at: PlacedStrip,
        ends: &NodePair,
    ) -> DVec3 {
        let carried = self.carried_tissue_force(state, at.place, at.gap, at.node);
        carried.unwrap_or_else(|| at.strip.force(ends, DVec3::ZERO))
    }

    /// The spatial force that the strip of a node carries in its rigid directions.
    pub(super) fn rigid_tissue_force(&self, state: &State, g: usize, i: usize) -> DVec3 {
        let carried = self.carried_tissue_force(state, StripPlace::Node, g, i);
        carried.unwrap_or(DVec3::ZERO)
    }
}

/// The two nodes of the strip of node `i` in gap `g`.
pub(super) fn strip_ends(state: &State, g: usize, i: usize) -> NodePair {
    let nodes = [g, g + 1].map(|rod| state.base(rod) + i);
    NodePair {
        x: nodes.map(|k| state.x[k]),
        q: nodes.map(|k| state.q[k]),
    }
}
