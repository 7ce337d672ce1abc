//! Rigid tissue: the forces of its strips as multipliers, in the linear equations and at the ends of veins, and a
//! finite stiffness in place of a rigid one.

use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{SpinAxes, State};
use crate::leaf::tissue::strips::{PlacedStrip, RIGID_TISSUE_RATIO, StripPlace, strip_ends};
use crate::numbers::largest;
use crate::rod::{Section, Segment, TissueStrip, Wrench};
use crate::rotation;
use glam::DVec3;

/// Finite stiffness of rigid tissue in explicit motions, which carry no force on from one step to the next, in units of the
/// stiffness of the adjacent segments. Its error is of second order in the length of the segments, and
/// extrapolated with theirs: a tenth takes a third of the steps, and leaves errors
/// above the bars.
const ELASTIC_TISSUE_RATIO: f64 = 100.0;

/// The elements of a leaf in a state whose forces are condensed out of its linear equations, and not always
/// exactly: see [`DiscreteLeaf::complete_law`].
pub struct ForceCarriers {
    /// All segments, rod after rod.
    pub segments: Vec<Segment>,
    /// The strips of all nodes, gap after gap; empty unless tissue is rigid.
    pub strips: Vec<RigidStrip>,
    /// About which axes hinges hold bases.
    pub spin_axes: SpinAxes,
}

/// A strip of a node as an element, by its rigid directions.
pub struct RigidStrip {
    /// The gap after rod `gap`.
    pub gap: usize,
    pub node: usize,
    /// Ones in rigid directions, zeros in others.
    pub rigid: DVec3,
    /// Its weight, as a fraction of the length.
    pub weight: f64,
    /// Its data, of the length one, without compliance.
    pub section: Section,
    pub element: Segment,
}

impl DiscreteLeaf {
    /// Whether tissue is rigid in some direction.
    pub fn has_rigid_tissue(&self) -> bool {
        self.strips.iter().any(TissueStrip::is_rigid)
    }

    /// This leaf with a finite stiffness of its tissue in place of a rigid one, for motions that carry
    /// no force on.
    pub fn with_elastic_tissue(&self) -> Self {
        let mut soft = self.clone();
        for strip in soft.strips.iter_mut().filter(|strip| strip.is_rigid()) {
            let finite = strip.condensing * (ELASTIC_TISSUE_RATIO / RIGID_TISSUE_RATIO);
            let rigid = strip.stiffness.cmpeq(DVec3::splat(f64::INFINITY));
            strip.stiffness = DVec3::select(rigid, finite, strip.stiffness);
            strip.condensing = strip.stiffness;
        }
        soft
    }

    /// The strips of the tissue, whatever place they have.
    pub fn tissue_data(&self) -> &[TissueStrip] {
        &self.strips
    }

    /// Sets the stiffness with which forces in rigid tissue are condensed out to that of the leaf's `own` strips or, where
    /// this is larger, to that of the inertia of the nodes of these numbers: iterations in the steps of a motion
    /// then converge equally fast for all steps.
    pub fn condense_rigid_tissue(&mut self, own: &[TissueStrip], inertial: impl Fn(usize) -> f64) {
        let (nodes, gaps) = (self.segments() + 1, self.rods().saturating_sub(1));
        for (k, (strip, own)) in self.strips.iter_mut().zip(own).enumerate() {
            if !own.is_rigid() {
                continue;
            }
            let (gap, node) = (k / nodes % gaps, k % nodes);
            let [a, b] = [gap, gap + 1].map(|rod| inertial(rod * nodes + node));
            let rigid = own.stiffness.cmpeq(DVec3::INFINITY);
            let raised = own.condensing.max(DVec3::splat(a.max(b)));
            strip.condensing = DVec3::select(rigid, raised, own.condensing);
        }
    }

    /// The strips of all nodes in a state by their rigid directions; none unless tissue is rigid.
    pub(in crate::leaf) fn rigid_strips(&self, state: &State) -> Vec<RigidStrip> {
        if !self.has_rigid_tissue() {
            return Vec::new();
        }
        let rigid_strip = |it: PlacedStrip| {
            let ends = it.ends(state);
            let (rigid, strip) = (it.strip.rigid_directions(), it.strip);
            let mut section = Section {
                ds: 1.0,
                couple_stiffness: DVec3::ZERO,
                rest_curvature: DVec3::ZERO,
                rest_strain: DVec3::ZERO,
                compliance: DVec3::ZERO,
                condensing: rigid * strip.condensing,
            };
            // In other directions it has no force, and its own length.
            let own = Segment::new(&section, &ends, DVec3::ZERO).gap;
            section.rest_strain = rigid * strip.stress_free_gap + (DVec3::ONE - rigid) * own;
            let carried = self.node_tissue_force(state, it, &ends);
            let middle = rotation::midpoint(ends.q[0], ends.q[1]);
            let force = middle * (rigid * (middle.inverse() * carried));
            RigidStrip {
                gap: it.gap,
                node: it.node,
                rigid,
                weight: self.grid.node_weight(it.node),
                element: Segment::new(&section, &ends, force),
                section,
            }
        };
        self.each_node_strip().map(rigid_strip).collect()
    }

    /// The strip of a node by its number among those of all nodes.
    pub(in crate::leaf) fn node_strip(&self, k: usize) -> &TissueStrip {
        &self.strips[k]
    }

    /// Number of elements with forces: see [`ForceCarriers`].
    pub fn force_carrier_count(&self) -> usize {
        let strips = match self.has_rigid_tissue() {
            true => (self.rods() - 1) * (self.segments() + 1),
            false => 0,
        };
        self.rods() * self.segments() + strips
    }

    /// The largest length by which rigid tissue misses its law.
    pub fn open_tissue_gap(&self, state: &State) -> f64 {
        let rigid = self.each_node_strip().filter(|it| it.strip.is_rigid());
        let gap = |it: PlacedStrip| {
            let ends = it.ends(state);
            let force = self.node_tissue_force(state, it, &ends);
            it.strip.carrying(&ends, force).open_gap().length()
        };
        largest(rigid.map(gap))
    }

    /// What the forces of rigid tissue at an end of rod `j` lack there, or have too much, for those along the
    /// rod to go on smoothly to its end: at a clamped base tissue has none, and at a tip it may have
    /// a concentrated one.
    pub fn rigid_end_load(&self, state: &State, j: usize, i: usize) -> Wrench {
        let (n, mut load) = (self.segments(), Wrench::default());
        if !self.has_rigid_tissue() || state.tissue.is_empty() || n < 4 || i > 0 && i < n {
            return load;
        }
        let inner = match i {
            0 => [1, 2, 3],
            _ => [n - 1, n - 2, n - 3],
        };
        for g in self.adjacent_gaps(j) {
            let density = |i: usize| state.tissue[self.strip_index(StripPlace::Node, g, i)];
            let at = |i: usize| self.grid.sigma()[i];
            // The parabola through the nodes next to the end.
            let weight = |k: usize| {
                let others = inner.iter().filter(|&&other| other != k);
                let parts = others.map(|&other| (at(i) - at(other)) / (at(k) - at(other)));
                parts.product::<f64>()
            };
            let wanted: DVec3 = inner.iter().map(|&k| weight(k) * density(k)).sum();
            let Some(rigid) = self.strip(StripPlace::Node, g, inner[0]) else {
                continue;
            };
            let rigid = rigid.rigid_directions();
            let ends = strip_ends(state, g, i);
            let middle = rotation::midpoint(ends.q[0], ends.q[1]);
            let own = middle.inverse() * self.rigid_tissue_force(state, g, i);
            let held = (self.strip(StripPlace::Node, g, i))
                .map_or(DVec3::ZERO, TissueStrip::rigid_directions);
            let missing =
                rigid * (middle.inverse() * (self.grid.node_weight(i) * wanted)) - held * own;
            let section = Section {
                ds: 1.0,
                couple_stiffness: DVec3::ZERO,
                rest_curvature: DVec3::ZERO,
                rest_strain: middle.inverse() * (ends.x[1] - ends.x[0]),
                compliance: DVec3::ZERO,
                condensing: DVec3::ZERO,
            };
            let change = Segment::new(&section, &ends, middle * missing).gradient(&section);
            let (moment, force) = match j == g {
                true => (-change.a, change.x),
                false => (-change.b, -change.x),
            };
            load.moment += moment;
            load.force += force;
        }
        load
    }
}
