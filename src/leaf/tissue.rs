//! Tissue between neighboring veins: the law of a strip ([`TissueStrip`]) at every node of every gap,
//! in the sums over the leaf, and the blocks between nodes of neighboring rods, which strips tie by
//! forces and moments.

use crate::leaf::block_tridiagonal::{RodLane, rod_lane};
use crate::leaf::discrete::{DiscreteLeaf, NodeLoad};
use crate::leaf::state::{Increment, State, displacement_part, rotation_part};
use crate::leaf::system::System;
use crate::numbers::{format_two_digits, largest};
use crate::rod::{NodeBlock, NodePair, StripLoads, TissueStrip, Wrench};
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

/// A strip of a leaf, with its place.
#[derive(Clone, Copy)]
struct PlacedStrip<'a> {
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

    /// The second derivatives of the energy of the strip.
    fn stiffness(&self, state: &State) -> StripStiffness {
        StripStiffness {
            gap: self.gap,
            node: self.node,
            matrix: stiffness_matrix(self.strip, &self.ends(state)),
        }
    }
}

/// The second derivatives of the energy of a strip of a leaf.
pub struct StripStiffness {
    pub gap: usize,
    pub node: usize,
    /// By the unknowns (rotation, displacement) of both nodes.
    pub matrix: SMatrix<f64, 12, 12>,
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

    /// The strips of this leaf on its grid, gap after gap, base to tip, without force in the stress-free
    /// state `natural`. Their weights are those of the coupling, but for a joint tip, where strips
    /// resist rotations.
    pub(super) fn tissue_strips(&self, natural: &State) -> Vec<TissueStrip> {
        let gaps = 0..self.rods() - 1;
        let strip = |g: usize, i: usize| {
            let stiffness = self.leaf.tissue_stiffness(g, self.grid.sigma()[i]);
            let weight = self.grid.node_weight(i);
            TissueStrip::stress_free_between(
                weight * stiffness.displacement,
                weight * stiffness.fold,
                &strip_ends(natural, g, i),
            )
        };
        gaps.flat_map(|g| (0..=self.segments()).map(move |i| strip(g, i)))
            .collect()
    }

    /// Whether tissue ties neighboring rods.
    pub fn has_tissue(&self) -> bool {
        !self.strips.is_empty()
    }

    /// The exponent of the growth of a perturbation along a vein over the fraction `width` of its length,
    /// with the properties in its middle: the vein bends or stretches against the tissue on both sides,
    /// as on an elastic foundation.
    pub fn tissue_growth_exponent(&self, width: f64) -> f64 {
        if !self.has_tissue() {
            return 0.0;
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

    /// The strip of node `i` in gap `g`.
    fn strip(&self, g: usize, i: usize) -> &TissueStrip {
        &self.strips[g * (self.segments() + 1) + i]
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
            let (strip, ends) = (self.strip(g, i), strip_ends(state, g, i));
            let StripLoads { energy, on_nodes } = strip.loads(&ends);
            load.moment += on_nodes[end].moment;
            load.force += on_nodes[end].force;
            if end == 0 {
                load.energy += energy;
            }
        }
        load
    }

    fn each_strip(&self) -> impl Iterator<Item = PlacedStrip<'_>> {
        let nodes = self.segments() + 1;
        let strips = self.strips.iter().enumerate();
        strips.map(move |(k, strip)| PlacedStrip {
            gap: k / nodes,
            node: k % nodes,
            strip,
        })
    }

    /// Adds the tissue to the right-hand side of an assembled system and, if `matrix`, to its matrix,
    /// where nodes move; returns its energy.
    pub(super) fn add_tissue(&self, state: &State, system: &mut System, matrix: bool) -> f64 {
        let mut energy = 0.0;
        for placed in self.each_strip() {
            let PlacedStrip {
                gap: g,
                node: i,
                strip,
            } = placed;
            let ends = placed.ends(state);
            let StripLoads {
                energy: own,
                on_nodes: mut loads,
            } = strip.loads(&ends);
            energy += own;
            if i < self.first_node() {
                continue;
            }
            let force = self.tissue_force(state, placed, &ends);
            if !state.tissue.is_empty() {
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
        energy
    }

    /// The spatial force that a strip carries in a state.
    fn tissue_force(&self, state: &State, at: PlacedStrip, ends: &NodePair) -> DVec3 {
        match state.tissue.get(at.gap * (self.segments() + 1) + at.node) {
            Some(force) => self.grid.node_weight(at.node) * *force,
            None => at.strip.force(ends),
        }
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
        for (k, placed) in self.each_strip().enumerate() {
            let PlacedStrip {
                gap: g,
                node: i,
                strip,
            } = placed;
            let ends = placed.ends(state);
            let force = self.tissue_force(state, placed, &ends);
            let change = match i < self.first_node() {
                true => DVec3::ZERO,
                false => {
                    let [a, b] = [g, g + 1].map(|rod| solution.node_solution(rod, i));
                    let dx = displacement_part(&b) - displacement_part(&a);
                    strip.force_increment(&ends, force, dx, [rotation_part(&a), rotation_part(&b)])
                }
            };
            next.tissue[k] = (force + step * change) / self.grid.node_weight(i);
        }
    }

    /// Adds the moments and forces of all tissue on all nodes, rod after rod.
    pub fn add_tissue_loads(&self, state: &State, loads: &mut [Wrench]) {
        for placed in self.each_strip() {
            let [a, b] = placed.strip.loads(&placed.ends(state)).on_nodes;
            for (rod, added) in [(placed.gap, a), (placed.gap + 1, b)] {
                let load = &mut loads[state.base(rod) + placed.node];
                load.moment += added.moment;
                load.force += added.force;
            }
        }
    }

    /// The second derivatives of the energy of every strip.
    pub fn tissue_stiffness(&self, state: &State) -> impl Iterator<Item = StripStiffness> {
        self.each_strip().map(|it| it.stiffness(state))
    }

    /// The changes of the loads of the strip of node `i` in gap `g` on its two nodes, by increments of
    /// both.
    pub(super) fn tissue_response(
        &self,
        state: &State,
        g: usize,
        i: usize,
        increments: &[Increment; 2],
    ) -> [Wrench; 2] {
        let both = SVector::<f64, 12>::from_fn(|k, _| increments[k / 6][k % 6]);
        let change = stiffness_matrix(self.strip(g, i), &strip_ends(state, g, i)) * both;
        let vector = |first: usize| DVec3::from_slice(&change.as_slice()[first..first + 3]);
        [0, 6].map(|node| Wrench {
            moment: -vector(node),
            force: -vector(node + 3),
        })
    }

    /// The strips on either side of node `i` of rod `j`.
    pub fn adjacent_strips(&self, j: usize, i: usize) -> impl Iterator<Item = &TissueStrip> {
        let gaps = [j.checked_sub(1), Some(j)].into_iter().flatten();
        let gaps = gaps.filter(|g| self.has_tissue() && g + 1 < self.rods());
        gaps.map(move |g| self.strip(g, i))
    }

    /// The changes of energy and loads of the strip of node `i` in gap `g` by a change of the strip.
    pub(super) fn strip_derivatives(
        &self,
        state: &State,
        g: usize,
        i: usize,
        change: &TissueStrip,
    ) -> StripLoads {
        self.strip(g, i)
            .parameter_derivative(&strip_ends(state, g, i), change)
    }

    /// Second derivatives of the energy of the tissue along a shape, at all nodes but clamped bases.
    pub fn tissue_curvature(&self, state: &State, shape: &[Increment]) -> f64 {
        let moving = self.each_strip().filter(|it| it.node >= self.first_node());
        let each = moving.map(|it| {
            let [a, b] = [it.gap, it.gap + 1].map(|rod| &shape[state.base(rod) + it.node]);
            let both = SVector::<f64, 12>::from_fn(|k, _| if k < 6 { a[k] } else { b[k - 6] });
            both.dot(&(it.stiffness(state).matrix * both))
        });
        each.sum()
    }
}

/// The second derivatives of the energy of a strip by the unknowns of both nodes.
fn stiffness_matrix(strip: &TissueStrip, ends: &NodePair) -> SMatrix<f64, 12, 12> {
    let hessian = strip.hessian(ends);
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
