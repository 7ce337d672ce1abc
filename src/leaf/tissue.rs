//! Tissue between neighboring veins: the law of a strip ([`TissueStrip`]) at every node of every gap,
//! in the sums over the leaf, and the blocks between nodes of neighboring rods, which strips tie by
//! forces and moments.
//!
//! Tissue that contracts has its strains also from the segments of its veins. Then a node of a gap has
//! three strips: one with the forces along and normal to the veins, and one on either side, in the corners
//! of the cells between two nodes, with the force across and the moment of the fold, and half of the weight:
//! it depends on the four nodes of its cell alone.

use crate::leaf::block_tridiagonal::{RodLane, rod_lane};
use crate::leaf::discrete::{DiscreteLeaf, NodeLoad};
use crate::leaf::state::{Increment, State, displacement_part, rotation_part};
use crate::leaf::system::System;
use crate::numbers::{format_two_digits, largest};
use crate::rod::{
    ContractingStrains, NodeBlock, NodePair, PairGradient, Section, Segment, SegmentGradient,
    StripHessian, StripLoads, StripStrainGradients, StripStress, TissueStrip, UNKNOWNS, VeinStrain,
    Wrench,
};
use crate::rotation;
use glam::DVec3;
use nalgebra::{SMatrix, SVector};

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
const RIGID_TISSUE_RATIO: f64 = 1e3;

/// The same where no force is carried on from one step to the next, in explicit motions: the error by the
/// finite stiffness is of second order in the length of the segments.
const ELASTIC_TISSUE_RATIO: f64 = 10.0;

/// The elements of a leaf in a state whose forces are condensed out of its linear equations, and not always
/// exactly: see [`DiscreteLeaf::complete_law`].
pub struct ForceCarriers {
    /// All segments, rod after rod.
    pub segments: Vec<Segment>,
    /// The strips of all nodes, gap after gap; empty unless tissue is rigid.
    pub strips: Vec<RigidStrip>,
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

/// Which strip of a node of a gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StripPlace {
    /// The only one, or that with the forces along and normal to the veins.
    Node,
    /// In the corner of the cell towards the tip.
    Ahead,
    /// In the corner of the cell towards the base.
    Behind,
}

impl StripPlace {
    const ALL: [StripPlace; 3] = [StripPlace::Node, StripPlace::Ahead, StripPlace::Behind];
}

/// A strip of a leaf, with its place.
#[derive(Clone, Copy)]
struct PlacedStrip<'a> {
    place: StripPlace,
    /// The gap after rod `gap`.
    gap: usize,
    node: usize,
    strip: &'a TissueStrip,
}

impl PlacedStrip<'_> {
    /// The two nodes of the strip in a state.
    fn ends(&self, state: &State) -> NodePair {
        strip_ends(state, self.gap, self.node)
    }

    /// The cosine of half the angle between the sections of the strip, negative where their
    /// quaternions are on opposite sides.
    fn cosine_of_half_angle(&self, state: &State) -> f64 {
        let [a, b] = [self.gap, self.gap + 1].map(|rod| state.q[state.base(rod) + self.node]);
        a.dot(b)
    }
}

/// The four nodes between which a strip has derivatives: of the first rod those of a segment, then of the
/// next rod. A strip that does not contract has only two, the first of either pair.
const CELL_UNKNOWNS: usize = 4 * UNKNOWNS;

/// The second derivatives of the energy of the strips of a cell, by the unknowns of its four nodes.
type CellMatrix = SMatrix<f64, CELL_UNKNOWNS, CELL_UNKNOWNS>;

/// Derivatives by the unknowns of the four nodes of a cell.
type CellGradient = SVector<f64, CELL_UNKNOWNS>;

/// The second derivatives of the energy of the tissue between two nodes of neighboring rods.
pub struct StripStiffness {
    pub gap: usize,
    pub node: usize,
    /// By the unknowns (rotation, displacement) of both nodes.
    pub matrix: SMatrix<f64, 12, 12>,
}

/// The two segments of a cell, whose strains contract its strips.
struct CellVeins {
    strains: [VeinStrain; 2],
}

impl CellVeins {
    /// The mean excess of the strains of both veins.
    fn mean(&self) -> ContractingStrains {
        let [a, b] = self.strains.each_ref().map(|of| of.excess);
        ContractingStrains {
            stretch: 0.5 * (a.stretch + b.stretch),
            bend: 0.5 * (a.bend + b.bend),
        }
    }

    /// The derivatives of the mean stretch and bend by the unknowns of the four nodes.
    fn gradients(&self) -> [CellGradient; 2] {
        let both = |of: fn(&VeinStrain) -> PairGradient| {
            let [a, b] = self.strains.each_ref().map(|vein| 0.5 * of(vein));
            CellGradient::from_fn(|k, _| if k < 12 { a[k] } else { b[k - 12] })
        };
        [
            both(VeinStrain::stretch_gradient),
            both(VeinStrain::bend_gradient),
        ]
    }
}

/// A strip in a corner of a cell, in a state.
struct Corner {
    /// The strip as its veins are strained.
    strip: TissueStrip,
    ends: NodePair,
    /// Whether it is at the first nodes of the cell, or at the last: 0 or 1.
    end: usize,
    /// The spatial force that it carries.
    force: DVec3,
}

impl Corner {
    /// The derivatives of the contracted strains across and in the fold by the unknowns of the cell, from
    /// those of the mean stretch and bend.
    fn strain_gradients(&self, [stretch, bend]: &[CellGradient; 2]) -> [CellGradient; 2] {
        let StripStrainGradients { across, fold } =
            self.strip.strain_gradients(&self.ends, self.force);
        let c = self.strip.contraction;
        let mut gradients = [c * stretch, -c * bend];
        for (gradient, own) in gradients.iter_mut().zip([across, fold]) {
            for k in 0..12 {
                gradient[corner_unknown(self.end, k)] += own[k];
            }
        }
        gradients
    }
}

/// The number among the unknowns of a cell of unknown `k` of the strip at its first or last nodes.
fn corner_unknown(end: usize, k: usize) -> usize {
    12 * (k / 6) + 6 * end + k % 6
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
    pub(super) fn tissue_strips(&self, natural: &State) -> Vec<TissueStrip> {
        let n = self.segments();
        let contracts = (0..self.rods() - 1).any(|g| self.leaf.tissue_contracts(g));
        let places = &StripPlace::ALL[..if contracts { 3 } else { 1 }];
        let strip = |place: StripPlace, g: usize, i: usize| {
            let mut stiffness = self.leaf.tissue_stiffness(g, self.grid.sigma()[i]);
            let k = &mut stiffness.displacement;
            match place {
                StripPlace::Node if contracts => (k.y, stiffness.fold) = (0.0, 0.0),
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
            if place != StripPlace::Node {
                strip.contraction = stiffness.contraction;
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
        let held = |rod: usize| {
            let free = self.freedom_without_tip_support(rod, i);
            !free.displacement && !free.rotation
        };
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
    fn strip_weight(&self, place: StripPlace, i: usize) -> f64 {
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

    /// Sets the forces of the tissue to those of its strains.
    pub fn set_tissue_forces(&self, state: &mut State) {
        state.tissue.clear();
        if !self.has_tissue() {
            return;
        }
        let mut forces = vec![DVec3::ZERO; self.strips.len()];
        for it in self.each_node_strip() {
            let force = it.strip.force(&it.ends(state), DVec3::ZERO);
            forces[self.strip_index(it.place, it.gap, it.node)] =
                force / self.grid.node_weight(it.node);
        }
        for (g, s) in self.contracting_cells() {
            let veins = self.cell_veins(state, g, s);
            for corner in self.corners(state, g, s, &veins) {
                let (place, i) = (StripPlace::ALL[1 + corner.end], s + corner.end);
                forces[self.strip_index(place, g, i)] = corner.force / self.strip_weight(place, i);
            }
        }
        state.tissue = forces;
    }

    /// Whether tissue is rigid in some direction.
    pub fn has_rigid_tissue(&self) -> bool {
        self.strips.iter().any(TissueStrip::is_rigid)
    }

    /// Whether tissue ties neighboring rods.
    pub fn has_tissue(&self) -> bool {
        !self.strips.is_empty()
    }

    /// The exponent of the growth of a perturbation along a vein over the fraction `width` of its length,
    /// with the properties in its middle: the vein bends or stretches against the tissue on both sides,
    /// as on an elastic foundation. Infinite where tissue contracts or is rigid, whose forces the
    /// equations of single rods do not determine.
    pub fn tissue_growth_exponent(&self, width: f64) -> f64 {
        if !self.has_tissue() {
            return 0.0;
        }
        if self.has_contracting_tissue() || self.has_rigid_tissue() {
            return f64::INFINITY;
        }
        let rate = |j: usize| {
            let gaps = [j.checked_sub(1), (j + 1 < self.rods()).then_some(j)];
            let gaps = gaps.into_iter().flatten();
            let k = 2.0
                * gaps
                    .map(|g| {
                        let stiffness = self.leaf.tissue_stiffness(g, 0.5);
                        stiffness.displacement.max_element()
                    })
                    .sum::<f64>();
            let section = self.leaf.section(j, 0.5, 1.0);
            let (length, softest) = (section.ds, section.couple_stiffness.min_element());
            let bends = (k * length.powi(3) / softest).sqrt().sqrt();
            let stretches = (k * length * section.compliance.max_element()).sqrt();
            bends.max(stretches)
        };
        width * largest((0..self.rods()).map(rate))
    }

    /// The strip at a place of node `i` in gap `g`, if there is one.
    fn strip(&self, place: StripPlace, g: usize, i: usize) -> Option<&TissueStrip> {
        self.strips.get(self.strip_index(place, g, i))
    }

    /// The number of a strip.
    fn strip_index(&self, place: StripPlace, g: usize, i: usize) -> usize {
        ((place as usize) * (self.rods() - 1) + g) * (self.segments() + 1) + i
    }

    /// Whether strips contract as their veins are strained.
    pub(super) fn has_contracting_tissue(&self) -> bool {
        self.strips.len() > (self.rods() - 1) * (self.segments() + 1)
    }

    fn each_strip(&self) -> impl Iterator<Item = PlacedStrip<'_>> {
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
    fn each_node_strip(&self) -> impl Iterator<Item = PlacedStrip<'_>> {
        let count = (self.rods() - 1) * (self.segments() + 1);
        let nodes = self.each_strip();
        nodes.take(count.min(self.strips.len()))
    }

    /// Gap and segment of every cell whose strips contract.
    fn contracting_cells(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let gaps = if self.has_contracting_tissue() {
            self.rods() - 1
        } else {
            0
        };
        let n = self.segments();
        (0..gaps).flat_map(move |g| (0..n).map(move |s| (g, s)))
    }

    /// The strains of the veins of a cell.
    fn cell_veins(&self, state: &State, g: usize, s: usize) -> CellVeins {
        CellVeins {
            strains: [g, g + 1].map(|j| VeinStrain::between(self.section(j, s), &state.ends(j, s))),
        }
    }

    /// The strips in the corners of a cell, as its veins are strained.
    fn corners(&self, state: &State, g: usize, s: usize, veins: &CellVeins) -> [Corner; 2] {
        let strained = veins.mean();
        [StripPlace::Ahead, StripPlace::Behind].map(|place| {
            let end = usize::from(place == StripPlace::Behind);
            let i = s + end;
            let strip = self.strips[self.strip_index(place, g, i)].contracted(strained);
            let ends = strip_ends(state, g, i);
            let force = match self.carried_tissue_force(state, place, g, i) {
                Some(carried) => carried,
                None => strip.force(&ends, DVec3::ZERO),
            };
            Corner {
                strip,
                ends,
                end,
                force,
            }
        })
    }

    /// The spatial force that a strip carries in a state; `None` if that of its strains.
    fn carried_tissue_force(
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
    fn node_tissue_force(&self, state: &State, at: PlacedStrip, ends: &NodePair) -> DVec3 {
        let carried = self.carried_tissue_force(state, at.place, at.gap, at.node);
        carried.unwrap_or_else(|| at.strip.force(ends, DVec3::ZERO))
    }

    /// The spatial force that the strip of a node carries in its rigid directions.
    fn rigid_tissue_force(&self, state: &State, g: usize, i: usize) -> DVec3 {
        let carried = self.carried_tissue_force(state, StripPlace::Node, g, i);
        carried.unwrap_or(DVec3::ZERO)
    }

    /// Calls `add` with the rod, the node and the load of everything that the tissue exerts by its strains,
    /// and by the forces that it carries in rigid directions; returns its energy.
    fn for_each_tissue_load(
        &self,
        state: &State,
        mut add: impl FnMut(usize, usize, Wrench),
    ) -> f64 {
        let mut energy = 0.0;
        for it in self.each_node_strip() {
            let (g, i) = (it.gap, it.node);
            let carried = self.rigid_tissue_force(state, g, i);
            let loads = it.strip.loads(&it.ends(state), carried);
            energy += loads.energy;
            for (rod, load) in [g, g + 1].into_iter().zip(loads.on_nodes) {
                add(rod, i, load);
            }
        }
        for (g, s) in self.contracting_cells() {
            energy += self.for_each_cell_load(state, g, s, &mut add);
        }
        energy
    }

    /// As [`DiscreteLeaf::for_each_tissue_load`], of the strips in the corners of one cell.
    fn for_each_cell_load(
        &self,
        state: &State,
        g: usize,
        s: usize,
        mut add: impl FnMut(usize, usize, Wrench),
    ) -> f64 {
        let veins = self.cell_veins(state, g, s);
        let [stretch, bend] = veins.gradients();
        let mut energy = 0.0;
        let mut by_strains = CellGradient::zeros();
        for corner in self.corners(state, g, s, &veins) {
            let loads = corner.strip.loads(&corner.ends, DVec3::ZERO);
            energy += loads.energy;
            for (rod, load) in [g, g + 1].into_iter().zip(loads.on_nodes) {
                add(rod, s + corner.end, load);
            }
            let StripStress { across, fold, .. } = corner.strip.stress(&corner.ends);
            let c = corner.strip.contraction;
            by_strains += c * (across * stretch - fold * bend);
        }
        for node in 0..4 {
            add(g + node / 2, s + node % 2, cell_load(&by_strains, node));
        }
        energy
    }

    /// What the tissue on either side exerts on node `i` of rod `j`.
    pub(super) fn tissue_load(&self, state: &State, j: usize, i: usize) -> NodeLoad {
        let mut load = NodeLoad::default();
        if !self.has_tissue() {
            return load;
        }
        let gaps = [
            (j.checked_sub(1), 1),
            ((j + 1 < self.rods()).then_some(j), 0),
        ];
        for (gap, end) in gaps {
            let Some(g) = gap else { continue };
            let carried = self.rigid_tissue_force(state, g, i);
            let Some(strip) = self.strip(StripPlace::Node, g, i) else {
                continue;
            };
            let StripLoads { energy, on_nodes } = strip.loads(&strip_ends(state, g, i), carried);
            load.moment += on_nodes[end].moment;
            load.force += on_nodes[end].force;
            if end == 0 {
                load.energy += energy;
            }
            if !self.has_contracting_tissue() {
                continue;
            }
            for s in [i.checked_sub(1), (i < self.segments()).then_some(i)]
                .into_iter()
                .flatten()
            {
                let energy = self.for_each_cell_load(state, g, s, |rod, node, on| {
                    if (rod, node) == (j, i) {
                        load.moment += on.moment;
                        load.force += on.force;
                    }
                });
                if end == 0 {
                    // Both nodes of the rod have a part of the cell's.
                    load.energy += 0.5 * energy;
                }
            }
        }
        load
    }

    /// Adds the tissue to the right-hand side of an assembled system and, if `matrix`, to its matrix,
    /// where nodes move; returns its energy.
    pub(super) fn add_tissue(&self, state: &State, system: &mut System, matrix: bool) -> f64 {
        let mut energy = 0.0;
        for placed in self.each_node_strip() {
            let PlacedStrip {
                gap: g,
                node: i,
                strip,
                ..
            } = placed;
            let ends = placed.ends(state);
            let StripLoads {
                energy: own,
                on_nodes: mut loads,
            } = strip.loads(&ends, self.rigid_tissue_force(state, g, i));
            energy += own;
            if i < self.first_node() {
                continue;
            }
            let force = self.node_tissue_force(state, placed, &ends);
            if !state.tissue.is_empty() || strip.is_rigid() {
                loads = strip.condensed_loads(&ends, force);
            }
            for (rod, load) in [g, g + 1].into_iter().zip(loads) {
                system.add_load(rod, i, load);
            }
            if matrix {
                let hessian = strip.condensed_hessian(&ends, force);
                for (rod, own) in [g, g + 1].into_iter().zip(&hessian.diagonal_blocks) {
                    system.add_block(rod, i, own);
                }
                *system.gap_block_mut(g, i - self.first_node()) = hessian.off_diagonal_block;
            }
        }
        if matrix {
            system.clear_cell_blocks();
        }
        for (g, s) in self.contracting_cells() {
            energy += self.add_cell(state, g, s, system, matrix);
        }
        energy
    }

    /// Adds the strips in the corners of a cell, as [`DiscreteLeaf::add_tissue`].
    fn add_cell(
        &self,
        state: &State,
        g: usize,
        s: usize,
        system: &mut System,
        matrix: bool,
    ) -> f64 {
        let first = self.first_node();
        let veins = self.cell_veins(state, g, s);
        let gradients = veins.gradients();
        let mut energy = 0.0;
        let mut rhs = CellGradient::zeros();
        let mut cell = CellMatrix::zeros();
        let (mut stretching, mut carried, mut bending) = (0.0, 0.0, 0.0);
        for corner in self.corners(state, g, s, &veins) {
            energy += corner.strip.loads(&corner.ends, DVec3::ZERO).energy;
            let loads = corner.strip.condensed_loads(&corner.ends, corner.force);
            for (node, load) in loads.into_iter().enumerate() {
                for c in 0..3 {
                    rhs[12 * node + 6 * corner.end + c] += load.moment[c];
                    rhs[12 * node + 6 * corner.end + 3 + c] += load.force[c];
                }
            }
            let StripStress {
                across,
                carried_across,
                fold,
            } = corner.strip.condensed_stress(&corner.ends, corner.force);
            let c = corner.strip.contraction;
            stretching += c * across;
            carried += c * carried_across;
            bending -= c * fold;
            if !matrix {
                continue;
            }
            let [by_across, by_fold] = corner.strain_gradients(&gradients);
            add_square(&mut cell, corner.strip.condensing.y, &by_across);
            add_square(&mut cell, corner.strip.fold_stiffness, &by_fold);
            let geometric = corner.strip.geometric_hessian(&corner.ends, corner.force);
            add_pair(&mut cell, &geometric, |k| corner_unknown(corner.end, k));
        }
        rhs -= stretching * gradients[0] + bending * gradients[1];
        for node in 0..4 {
            let i = s + node % 2;
            if i >= first {
                let load = cell_load(&-rhs, node);
                system.add_load(g + node / 2, i, load);
            }
        }
        if matrix {
            for (vein, strain) in veins.strains.iter().enumerate() {
                let geometric = strain.hessian(0.5 * carried, 0.5 * bending);
                add_pair(&mut cell, &geometric, |k| 12 * vein + k);
            }
            system.add_cell_matrix(g, s, &cell);
        }
        energy
    }

    /// Writes the forces that the tissue carries after `step` times the increments in `solution`.
    pub(super) fn advance_tissue(
        &self,
        state: &State,
        solution: &System,
        step: f64,
        next: &mut State,
    ) {
        next.tissue.resize(self.strips.len(), DVec3::ZERO);
        let increment = |rod: usize, i: usize| match i < self.first_node() {
            true => [0.0; 6],
            false => solution.node_solution(rod, i),
        };
        for placed in self.each_node_strip() {
            let PlacedStrip {
                gap: g,
                node: i,
                strip,
                ..
            } = placed;
            let ends = placed.ends(state);
            let force = self.node_tissue_force(state, placed, &ends);
            let change = match i < self.first_node() {
                true => DVec3::ZERO,
                false => {
                    let [a, b] = [g, g + 1].map(|rod| increment(rod, i));
                    let dx = displacement_part(&b) - displacement_part(&a);
                    strip.force_increment(&ends, force, dx, [rotation_part(&a), rotation_part(&b)])
                }
            };
            let k = self.strip_index(StripPlace::Node, g, i);
            next.tissue[k] = (force + step * change) / self.grid.node_weight(i);
        }
        for (g, s) in self.contracting_cells() {
            let veins = self.cell_veins(state, g, s);
            let [stretch, _] = veins.gradients();
            let nodes = [0, 1, 2, 3].map(|node| increment(g + node / 2, s + node % 2));
            let stretched: f64 = (0..CELL_UNKNOWNS)
                .map(|k| stretch[k] * nodes[k / UNKNOWNS][k % UNKNOWNS])
                .sum();
            for corner in self.corners(state, g, s, &veins) {
                let [a, b] = [0, 2].map(|node| &nodes[node + corner.end]);
                let dx = displacement_part(b) - displacement_part(a);
                let turns = [rotation_part(a), rotation_part(b)];
                let strip = &corner.strip;
                let change = strip.force_increment(&corner.ends, corner.force, dx, turns);
                let across = rotation::midpoint(corner.ends.q[0], corner.ends.q[1]) * DVec3::Y;
                let contracted = strip.condensing.y * strip.contraction * stretched * across;
                let place = StripPlace::ALL[1 + corner.end];
                let i = s + corner.end;
                let k = self.strip_index(place, g, i);
                let weight = self.strip_weight(place, i);
                next.tissue[k] = (corner.force + step * (change + contracted)) / weight;
            }
        }
        if self.has_contracting_tissue() {
            // Interpolated along a gap, both kinds of corners have values at both ends.
            for g in 0..self.rods() - 1 {
                let n = self.segments();
                for (none, other, i) in [
                    (StripPlace::Ahead, StripPlace::Behind, n),
                    (StripPlace::Behind, StripPlace::Ahead, 0),
                ] {
                    let [to, from] = [none, other].map(|place| self.strip_index(place, g, i));
                    next.tissue[to] = next.tissue[from];
                }
            }
        }
    }

    /// The part of the tissue in the force and the moments of segment `i` of rod `j`: it resists a stretch and
    /// a bend of the veins by which it contracts.
    pub fn contraction_gradient(&self, state: &State, j: usize, i: usize) -> SegmentGradient {
        let mut sum = PairGradient::zeros();
        if self.has_contracting_tissue() {
            for g in self.adjacent_gaps(j) {
                let veins = self.cell_veins(state, g, i);
                let own = &veins.strains[j - g];
                let [stretch, bend] = [own.stretch_gradient(), own.bend_gradient()];
                for corner in self.corners(state, g, i, &veins) {
                    let StripStress { across, fold, .. } = corner.strip.stress(&corner.ends);
                    let c = 0.5 * corner.strip.contraction;
                    sum += c * (across * stretch - fold * bend);
                }
            }
        }
        let vector = |first: usize| DVec3::from_slice(&sum.as_slice()[first..first + 3]);
        SegmentGradient {
            x: vector(9),
            a: vector(0),
            b: vector(6),
        }
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

    /// The gaps on either side of rod `j`.
    fn adjacent_gaps(&self, j: usize) -> impl Iterator<Item = usize> + use<> {
        let gaps = [j.checked_sub(1), (j + 1 < self.rods()).then_some(j)];
        gaps.into_iter().flatten()
    }

    /// The strips of all nodes in a state by their rigid directions; none unless tissue is rigid.
    pub(super) fn rigid_strips(&self, state: &State) -> Vec<RigidStrip> {
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
    pub(super) fn node_strip(&self, k: usize) -> &TissueStrip {
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
            it.strip.open_gap(&ends, force).length()
        };
        largest(rigid.map(gap))
    }

    /// Adds the moments and forces of all tissue on all nodes, rod after rod.
    pub fn add_tissue_loads(&self, state: &State, loads: &mut [Wrench]) {
        self.for_each_tissue_load(state, |rod, i, added| {
            let load = &mut loads[state.base(rod) + i];
            load.moment += added.moment;
            load.force += added.force;
        });
    }

    /// The second derivatives of the energy of every strip between its two nodes, the strains of its
    /// veins fixed. With the part `share` of its stiffness they are an upper bound on those by all
    /// nodes (see [`DiscreteLeaf::contraction_share`]).
    pub fn tissue_stiffness(&self, state: &State) -> impl Iterator<Item = StripStiffness> {
        self.each_strip().map(|it| {
            let carried = self.rigid_tissue_force(state, it.gap, it.node);
            StripStiffness {
                gap: it.gap,
                node: it.node,
                matrix: stiffness_matrix(it.strip, &it.ends(state), carried),
            }
        })
    }

    /// The changes of the loads of all tissue on the nodes of gap `g`, by increments of its nodes at `i`
    /// of both rods, as rods, nodes and loads.
    pub(super) fn for_each_tissue_response(
        &self,
        state: &State,
        g: usize,
        i: usize,
        increments: &[Increment; 2],
        mut add: impl FnMut(usize, usize, Wrench),
    ) {
        let Some(strip) = self.strip(StripPlace::Node, g, i) else {
            return;
        };
        let both = SVector::<f64, 12>::from_fn(|k, _| increments[k / 6][k % 6]);
        let carried = self.rigid_tissue_force(state, g, i);
        let change = stiffness_matrix(strip, &strip_ends(state, g, i), carried) * both;
        for (rod, k) in [(g, 0), (g + 1, 6)] {
            add(rod, i, minus_wrench(&change.as_slice()[k..]));
        }
        if !self.has_contracting_tissue() {
            return;
        }
        for s in [i.checked_sub(1), (i < self.segments()).then_some(i)]
            .into_iter()
            .flatten()
        {
            let mut moved = CellGradient::zeros();
            for k in 0..12 {
                moved[corner_unknown(i - s, k)] = both[k];
            }
            let change = self.cell_matrix(state, g, s) * moved;
            for node in 0..4 {
                let k = 6 * node;
                add(
                    g + node / 2,
                    s + node % 2,
                    minus_wrench(&change.as_slice()[k..]),
                );
            }
        }
    }

    /// The second derivatives of the energy of the strips in the corners of a cell.
    fn cell_matrix(&self, state: &State, g: usize, s: usize) -> CellMatrix {
        let veins = self.cell_veins(state, g, s);
        let gradients = veins.gradients();
        let mut cell = CellMatrix::zeros();
        let (mut stretching, mut bending) = (0.0, 0.0);
        for mut corner in self.corners(state, g, s, &veins) {
            corner.force = corner.strip.force(&corner.ends, DVec3::ZERO);
            let StripStress { across, fold, .. } = corner.strip.stress(&corner.ends);
            let c = corner.strip.contraction;
            stretching += c * across;
            bending -= c * fold;
            let [by_across, by_fold] = corner.strain_gradients(&gradients);
            add_square(&mut cell, corner.strip.condensing.y, &by_across);
            add_square(&mut cell, corner.strip.fold_stiffness, &by_fold);
            let geometric = corner.strip.geometric_hessian(&corner.ends, corner.force);
            add_pair(&mut cell, &geometric, |k| corner_unknown(corner.end, k));
        }
        for (vein, strain) in veins.strains.iter().enumerate() {
            let geometric = strain.hessian(0.5 * stretching, 0.5 * bending);
            add_pair(&mut cell, &geometric, |k| 12 * vein + k);
        }
        cell.fill_lower_triangle_with_upper_triangle();
        cell
    }

    /// The strips on either side of node `i` of rod `j`.
    pub fn adjacent_strips(&self, j: usize, i: usize) -> impl Iterator<Item = &TissueStrip> {
        let gaps = [j.checked_sub(1), Some(j)].into_iter().flatten();
        let gaps = gaps.filter(|g| self.has_tissue() && g + 1 < self.rods());
        gaps.flat_map(move |g| StripPlace::ALL.map(|place| self.strip(place, g, i)))
            .flatten()
    }

    /// Calls `add` with the changes of the loads of all tissue by a change of the leaf, the weighted sum over
    /// leaves that differ, in a fixed state; returns the change of the energy. What is rigid has no change of
    /// its force.
    pub(super) fn for_each_tissue_change(
        &self,
        state: &State,
        each: &[(f64, &DiscreteLeaf)],
        mut add: impl FnMut(usize, usize, Wrench),
    ) -> f64 {
        let Some((_, first)) = each.first() else {
            return 0.0;
        };
        let mut energy = 0.0;
        for own in first.each_node_strip() {
            let (g, i) = (own.gap, own.node);
            let k = first.strip_index(own.place, g, i);
            let mut change = TissueStrip::default();
            for (weight, leaf) in each {
                change.add(*weight, &leaf.strips[k].difference_from(own.strip));
            }
            if change == TissueStrip::default() {
                continue;
            }
            let Some(strip) = self.strip(own.place, g, i) else {
                continue;
            };
            let loads = strip.parameter_derivative(&strip_ends(state, g, i), &change);
            energy += loads.energy;
            for (rod, load) in [g, g + 1].into_iter().zip(loads.on_nodes) {
                add(rod, i, load);
            }
        }
        for (weight, leaf) in each {
            for (g, s) in leaf.contracting_cells() {
                let own = |rod: usize, i: usize, load: Wrench| (rod, i, scaled(load, *weight));
                energy += weight
                    * leaf.for_each_cell_load(state, g, s, |rod, i, load| {
                        let (rod, i, load) = own(rod, i, load);
                        add(rod, i, load);
                    });
                energy -= weight
                    * first.for_each_cell_load(state, g, s, |rod, i, load| {
                        let (rod, i, load) = own(rod, i, scaled(load, -1.0));
                        add(rod, i, load);
                    });
            }
        }
        energy
    }

    /// Second derivatives of the energy of the tissue along a shape, at all nodes but clamped bases.
    pub fn tissue_curvature(&self, state: &State, shape: &[Increment]) -> f64 {
        let moving = self
            .each_node_strip()
            .filter(|it| it.node >= self.first_node());
        let each = moving.map(|it| {
            let [a, b] = [it.gap, it.gap + 1].map(|rod| &shape[state.base(rod) + it.node]);
            let both = SVector::<f64, 12>::from_fn(|k, _| if k < 6 { a[k] } else { b[k - 6] });
            let carried = self.rigid_tissue_force(state, it.gap, it.node);
            both.dot(&(stiffness_matrix(it.strip, &it.ends(state), carried) * both))
        });
        let nodes: f64 = each.sum();
        let cells = self.contracting_cells().map(|(g, s)| {
            let all = CellGradient::from_fn(|k, _| {
                let node = k / UNKNOWNS;
                let i = s + node % 2;
                match i < self.first_node() {
                    true => 0.0,
                    false => shape[state.base(g + node / 2) + i][k % UNKNOWNS],
                }
            });
            all.dot(&(self.cell_matrix(state, g, s) * all))
        });
        nodes + cells.sum::<f64>()
    }
}

/// Adds `times` the product of a gradient with itself, upper triangle.
fn add_square(matrix: &mut CellMatrix, times: f64, gradient: &CellGradient) {
    for c in 0..CELL_UNKNOWNS {
        let factor = times * gradient[c];
        for r in 0..=c {
            matrix[(r, c)] += factor * gradient[r];
        }
    }
}

/// Adds second derivatives between two nodes, of which unknown k has the number `at(k)` in the cell, in
/// ascending order, upper triangle.
fn add_pair(matrix: &mut CellMatrix, hessian: &StripHessian, at: impl Fn(usize) -> usize) {
    for c in 0..6 {
        for r in 0..6 {
            if r <= c {
                for (node, block) in hessian.diagonal_blocks.iter().enumerate() {
                    matrix[(at(6 * node + r), at(6 * node + c))] += block[r][c];
                }
            }
            matrix[(at(r), at(6 + c))] += hessian.off_diagonal_block[r][c];
        }
    }
}

/// Minus the part of derivatives by the unknowns of a cell that belongs to one of its nodes.
fn cell_load(gradient: &CellGradient, node: usize) -> Wrench {
    minus_wrench(&gradient.as_slice()[6 * node..])
}

/// Minus the moment and force that come first in these numbers.
fn minus_wrench(numbers: &[f64]) -> Wrench {
    Wrench {
        moment: -DVec3::from_slice(numbers),
        force: -DVec3::from_slice(&numbers[3..]),
    }
}

fn scaled(load: Wrench, factor: f64) -> Wrench {
    Wrench {
        moment: factor * load.moment,
        force: factor * load.force,
    }
}

/// The second derivatives of the energy of a strip by the unknowns of both nodes.
fn stiffness_matrix(strip: &TissueStrip, ends: &NodePair, carried: DVec3) -> SMatrix<f64, 12, 12> {
    let hessian = strip.hessian(ends, carried);
    SMatrix::from_fn(|r, c| match (r / 6, c / 6) {
        (0, 1) => hessian.off_diagonal_block[r][c - 6],
        (1, 0) => hessian.off_diagonal_block[c][r - 6],
        (a, _) => hessian.diagonal_blocks[a][r.min(c) % 6][r.max(c) % 6],
    })
}

/// The two nodes of the strip of node `i` in gap `g`.
fn strip_ends(state: &State, g: usize, i: usize) -> NodePair {
    let nodes = [g, g + 1].map(|rod| state.base(rod) + i);
    NodePair {
        x: nodes.map(|k| state.x[k]),
        q: nodes.map(|k| state.q[k]),
    }
}

impl System {
    /// Whether tissue ties neighbors, also by moments: then the matrix must be factorized as a
    /// whole, as rod by rod conjugate gradients take too many iterations.
    pub fn has_tissue(&self) -> bool {
        !self.gap_blocks.is_empty()
    }

    /// The unknowns of a node (rotation, displacement) that are coupled with those of neighbors.
    pub(super) fn coupled_unknowns(&self) -> [bool; 6] {
        let along = |c: usize| self.gaps.iter().any(|gap| gap[c] != 0.0);
        std::array::from_fn(|c| self.has_tissue() || c >= 3 && along(c - 3))
    }

    /// The block between node `i` (from the first with equations) of rod `g` and the same node of the
    /// next rod, if there is tissue.
    pub(super) fn gap_block(&self, g: usize, i: usize) -> Option<&NodeBlock> {
        match self.has_tissue() && g + 1 < self.rods {
            true => Some(&self.gap_blocks[g * self.nodes() + i]),
            false => None,
        }
    }

    /// As [`System::gap_block`], to be changed.
    pub(super) fn gap_block_mut(&mut self, g: usize, i: usize) -> &mut NodeBlock {
        let nodes = self.nodes();
        &mut self.gap_blocks[g * nodes + i]
    }

    /// The blocks between node `i` (from the first with equations) of rod `g` and node `i + 1` of the
    /// next rod, and between node `i + 1` and node `i`, if tissue contracts.
    pub(super) fn cell_blocks(&self, g: usize, i: usize) -> Option<&[NodeBlock; 2]> {
        match g + 1 < self.rods {
            true => self.cell_blocks.get(g * self.nodes() + i),
            false => None,
        }
    }

    /// As [`System::cell_blocks`], to be changed.
    pub(super) fn cell_blocks_mut(&mut self, g: usize, i: usize) -> Option<&mut [NodeBlock; 2]> {
        let nodes = self.nodes();
        self.cell_blocks.get_mut(g * nodes + i)
    }

    fn clear_cell_blocks(&mut self) {
        self.cell_blocks.fill([NodeBlock::default(); 2]);
    }

    /// Adds the second derivatives of a cell between nodes s and s + 1 of rods g and g + 1, upper
    /// triangle, where nodes have equations.
    fn add_cell_matrix(&mut self, g: usize, s: usize, cell: &CellMatrix) {
        let block = |a: usize, b: usize| -> NodeBlock {
            std::array::from_fn(|r| std::array::from_fn(|c| cell[(6 * a + r, 6 * b + c)]))
        };
        // Nodes of the cell: 0 and 1 on rod g, 2 and 3 on the next.
        let (at, first) = (|node: usize| s + node % 2, self.first);
        for node in (0..4).filter(|&node| at(node) >= first) {
            let own = block(node, node);
            self.add_block(g + node / 2, at(node), &own);
        }
        for node in (0..2).filter(|&node| at(node) >= first) {
            let own = block(node, node + 2);
            let across = self.gap_block_mut(g, at(node) - first);
            for (sum, row) in across.iter_mut().flatten().zip(own.iter().flatten()) {
                *sum += row;
            }
        }
        let Some(i) = s.checked_sub(first) else {
            return;
        };
        for rod in 0..2 {
            let next = block(2 * rod, 2 * rod + 1);
            let RodLane { group, lane } = rod_lane(g + rod);
            let chain = &mut self.groups[group].matrix;
            for (r, row) in next.iter().enumerate() {
                for (c, value) in row.iter().enumerate() {
                    chain.off_diagonal_entry_mut(i, r, c).0[lane] += value;
                }
            }
        }
        let crossing = block(1, 2);
        let ahead = block(0, 3);
        if let Some(blocks) = self.cell_blocks_mut(g, i) {
            for (sum, value) in blocks
                .iter_mut()
                .flatten()
                .flatten()
                .zip([ahead, crossing].iter().flatten().flatten())
            {
                *sum += value;
            }
        }
    }

    /// Adds the upper triangle of a block to the matrix at node `i` of rod `j`.
    pub(super) fn add_block(&mut self, j: usize, i: usize, block: &NodeBlock) {
        let RodLane { group, lane } = rod_lane(j);
        let (at, chain) = (i - self.first, &mut self.groups[group].matrix);
        for (r, row) in block.iter().enumerate() {
            for c in r..row.len() {
                chain.diagonal_entry_mut(at, r, c).0[lane] += row[c];
            }
        }
    }

    /// Adds a load to the right-hand side of node `i` of rod `j`.
    pub fn add_load(&mut self, j: usize, i: usize, load: Wrench) {
        let RodLane { group, lane } = rod_lane(j);
        let rhs = &mut self.groups[group].rhs[i - self.first];
        for c in 0..3 {
            rhs[c].0[lane] += load.moment[c];
            rhs[3 + c].0[lane] += load.force[c];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::{Grid, Leaf};
    use crate::scenario::Entries;

    /// Veins of different sections, with tissue that contracts.
    const LEAF: &str = r#"
        name = "leaf"
        leaf = { rods = 3, length = [0.9, 1.0, 1.1], fan = [-0.2, 0.0, 0.3], joined = false, base = [[0.0, -0.2, 0.0], [0.0, 0.0, 0.0], [0.0, 0.3, 0.1]] }
        stiffness = { torsion = 1.0, bending_2 = 0.7, bending_3 = 1.3, axial = 100.0, shear_2 = 50.0, shear_3 = 40.0 }
        rest = { bend_2 = 0.4, stretch = 1.1 }
        tissue = { along = 3.0, across = 20.0, normal = 5.0, fold = 0.3, contraction = [0.2, -0.1] }
    "#;

    /// The leaf on a coarse grid, and a state far from rest.
    fn strained() -> (DiscreteLeaf, State) {
        let scenario = Entries::from_text(LEAF, "leaf").unwrap().check().unwrap();
        let leaf = DiscreteLeaf::new(&Leaf::new(&scenario), Grid::new(2, &[]));
        let mut state = leaf.stress_free_state();
        let number = |k: usize| (k as f64 * 0.618_033_988_749_895).fract() - 0.5;
        for k in 0..state.x.len() {
            let vector = |first: usize| {
                DVec3::new(
                    number(9 * k + first),
                    number(9 * k + first + 1),
                    number(9 * k + first + 2),
                )
            };
            state.x[k] += 0.2 * vector(0);
            state.q[k] = rotation::exp(0.6 * vector(3)) * state.q[k];
        }
        (leaf, state)
    }

    fn moved(state: &State, node: usize, c: usize, by: f64) -> State {
        let (mut state, change) = (state.clone(), by * DVec3::AXES[c % 3]);
        match c < 3 {
            true => state.q[node] = rotation::exp(change) * state.q[node],
            false => state.x[node] += change,
        }
        state
    }

    /// The derivative of a function of a number by central differences of order 4.
    fn slope(f: impl Fn(f64) -> f64) -> f64 {
        let central = |h: f64| (f(h) - f(-h)) / (2.0 * h);
        (4.0 * central(1e-3) - central(2e-3)) / 3.0
    }

    /// Moments and forces on all nodes.
    fn loads(leaf: &DiscreteLeaf, state: &State) -> Vec<f64> {
        let mut loads = vec![Wrench::default(); state.x.len()];
        leaf.add_tissue_loads(state, &mut loads);
        let vectors = loads.iter().flat_map(|it| [it.moment, it.force]);
        vectors.flat_map(|v| v.to_array()).collect()
    }

    #[test]
    fn loads_are_the_derivatives_of_the_energy() {
        let (leaf, state) = strained();
        let found = loads(&leaf, &state);
        let energy = |state: &State| leaf.for_each_tissue_load(state, |_, _, _| {});
        for (k, found) in found.iter().enumerate() {
            let slope = slope(|h| energy(&moved(&state, k / 6, k % 6, h)));
            assert!((found + slope).abs() < 1e-8, "{k}: {found} {slope}");
        }
        let at_rest = loads(&leaf, &leaf.stress_free_state());
        assert!(at_rest.iter().all(|load| load.abs() < 1e-13));
        // One by one they are the same.
        for (j, i) in leaf.rod_index_pairs(0..leaf.segments() + 1) {
            let load = leaf.tissue_load(&state, j, i);
            let all = &found[6 * (state.base(j) + i)..];
            assert!(load.moment.distance(DVec3::from_slice(all)) < 1e-12);
            assert!(load.force.distance(DVec3::from_slice(&all[3..])) < 1e-12);
        }
    }

    /// In spatial increments the derivatives of moments are unsymmetric by half of their moment.
    #[test]
    fn second_derivatives_are_those_of_the_loads() {
        let (leaf, state) = strained();
        let count = 6 * state.x.len();
        let slopes: Vec<Vec<f64>> = (0..count)
            .map(|k| {
                let at = |h: f64| loads(&leaf, &moved(&state, k / 6, k % 6, h));
                let [a, b, c, d] = [1e-3, -1e-3, 2e-3, -2e-3].map(at);
                let central = |r: usize| (8.0 * (a[r] - b[r]) - (c[r] - d[r])) / 12e-3;
                (0..count).map(|r| -central(r)).collect()
            })
            .collect();
        let wanted = |r: usize, c: usize| 0.5 * (slopes[c][r] + slopes[r][c]);
        for r in 0..count {
            let mut shape = vec![[0.0; 6]; state.x.len()];
            for c in 0..=r {
                let at = |k: usize| (k / 6, k % 6);
                shape.iter_mut().for_each(|node| *node = [0.0; 6]);
                let ((a, b), (d, e)) = (at(r), at(c));
                let value = |shape: &[Increment]| leaf.tissue_curvature(&state, shape);
                if [a, d].iter().any(|node| node % 3 == 0) {
                    continue;
                }
                shape[a][b] = 1.0;
                let own = value(&shape);
                let found = match r == c {
                    true => own,
                    false => {
                        shape[d][e] = 1.0;
                        let both = value(&shape);
                        shape[a][b] = 0.0;
                        0.5 * (both - own - value(&shape))
                    }
                };
                assert!(
                    (found - wanted(r, c)).abs() < 1e-7,
                    "{r} {c}: {found} {}",
                    wanted(r, c)
                );
            }
        }
    }

    /// The matrix and the forces that are assembled, of segments and tissue that carry the forces of
    /// their strains.
    #[test]
    fn the_assembled_matrix_has_the_derivatives_of_the_forces() {
        let (leaf, state) = strained();
        let mut system = System::new(&leaf);
        let mut balanced = |state: &State, forces: &State| {
            let mut state = state.clone();
            leaf.strain_forces(&mut state);
            state.tissue.clone_from(&forces.tissue);
            leaf.assemble_forces(&state, &mut system);
            system.rhs()
        };
        let mut state = state.clone();
        leaf.strain_forces(&mut state);
        let mut whole = System::new(&leaf);
        leaf.assemble(&state, &mut whole);
        let solver = crate::leaf::DirectSolver::new(&whole).unwrap();
        let rods = leaf.rods();
        // Carried forces change nothing in the condensed ones of what is not rigid.
        let mut carrying = state.clone();
        carrying.tissue = (0..leaf.strips.len())
            .map(|k| DVec3::splat((k as f64).sin()))
            .collect();
        let count = leaf.segments();
        for (j, i) in leaf.rod_index_pairs(1..count + 1) {
            for c in 0..6 {
                let node = state.base(j) + i;
                let mut shape = vec![vec![[0.0; 6]; count]; rods];
                shape[j][i - 1][c] = 1.0;
                let found = solver.product(&whole, &shape);
                for (own, it) in [(true, &state), (false, &carrying)] {
                    if !own {
                        continue;
                    }
                    let h = 1e-4;
                    let [a, b] = [h, -h].map(|h| balanced(&moved(&state, node, c, h), it));
                    for (r, k) in leaf.rod_index_pairs(0..count) {
                        for d in 3..6 {
                            let slope = -(a[r][k][d] - b[r][k][d]) / (2.0 * h);
                            let off = (found[r][k][d] - slope).abs();
                            assert!(
                                off < 1e-5,
                                "{j} {i} {c}: {r} {k} {d}: {} {slope}",
                                found[r][k][d]
                            );
                        }
                    }
                }
            }
        }
    }
}
