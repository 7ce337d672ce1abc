//! Tissue between neighboring veins: the law of a strip ([`TissueStrip`]) at every node of every gap, in the sums
//! over the leaf, and the blocks between nodes of neighboring rods, which strips tie by forces and moments.
//!
//! `strips` makes the strips, `cells` has those that contract as their veins are strained, `rigid` those whose
//! forces are multipliers.

pub mod cells;
pub mod rigid;
pub mod strips;
#[cfg(test)]
mod tests;

use crate::leaf::block_tridiagonal::{RodLane, rod_lane};
use crate::leaf::discrete::{DiscreteLeaf, NodeLoad};
use crate::leaf::state::{Increment, State, displacement_part, rotation_part};
use crate::leaf::system::System;
use crate::leaf::tissue::cells::{TissueForces, minus_wrench};
use crate::leaf::tissue::strips::{PlacedStrip, StripPlace, strip_ends};
use crate::numbers::largest;
use crate::rod::{NodeBlock, NodePair, PairGradient, StripLoads, TissueStrip, Wrench};
use glam::DVec3;
use nalgebra::{SMatrix, SVector};

/// The second derivatives of the energy of the tissue between two nodes of neighboring rods.
pub struct StripStiffness {
    pub gap: usize,
    pub node: usize,
    /// By the unknowns (rotation, displacement) of both nodes.
    pub matrix: SMatrix<f64, 12, 12>,
}

impl DiscreteLeaf {
    /// The exponent of the growth of a perturbation along a vein over the fraction `width` of its length,
    /// with the properties in its middle: the vein bends or stretches against the tissue on both sides,
    /// as on an elastic foundation. Infinite where tissue contracts or is rigid, whose forces the
    /// equations of single rods do not determine.
    pub fn tissue_growth_exponent(&self, width: f64) -> f64 {
        if !self.has_tissue() {
            return 0.0;
        }
        if self.has_tissue_cells() {
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
        for cell in self.tissue_cells() {
            energy += self.for_each_cell_load(state, cell, &mut add);
        }
        energy
    }

    /// Adds the moments and forces of all tissue on all nodes, rod after rod.
    pub fn add_tissue_loads(&self, state: &State, loads: &mut [Wrench]) {
        self.for_each_tissue_load(state, |rod, i, added| {
            let load = &mut loads[state.base(rod) + i];
            load.moment += added.moment;
            load.force += added.force;
        });
    }

    /// The loads of all tissue on all nodes, rod after rod; empty without tissue. Energies are not told by
    /// nodes.
    pub fn tissue_loads(&self, state: &State) -> Vec<NodeLoad> {
        if !self.has_tissue() {
            return Vec::new();
        }
        let mut loads = vec![Wrench::default(); state.x.len()];
        self.add_tissue_loads(state, &mut loads);
        let load = |Wrench { moment, force }| NodeLoad {
            moment,
            force,
            energy: 0.0,
        };
        loads.into_iter().map(load).collect()
    }

    /// What the strips of node `i` of rod `j` exert on it.
    pub(in crate::leaf) fn node_strip_load(&self, state: &State, j: usize, i: usize) -> NodeLoad {
        let mut load = NodeLoad::default();
        if !self.has_tissue() {
            return load;
        }
        for g in self.adjacent_gaps(j) {
            let end = j - g;
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
        }
        load
    }

    /// What the tissue on either side exerts on node `i` of rod `j`.
    pub(in crate::leaf) fn tissue_load(&self, state: &State, j: usize, i: usize) -> NodeLoad {
        let mut load = self.node_strip_load(state, j, i);
        if !self.has_tissue_cells() {
            return load;
        }
        for g in self.adjacent_gaps(j) {
            for cell in self.cells_at_node(g, i) {
                let energy = self.for_each_cell_load(state, cell, |rod, node, on| {
                    if (rod, node) == (j, i) {
                        load.moment += on.moment;
                        load.force += on.force;
                    }
                });
                if j == g {
                    // Both nodes of the rod have a part of the cell's.
                    load.energy += 0.5 * energy;
                }
            }
        }
        load
    }

    /// Adds the tissue to the right-hand side of an assembled system and, if `matrix`, to its matrix,
    /// where nodes move; returns its energy.
    pub(in crate::leaf) fn add_tissue(
        &self,
        state: &State,
        system: &mut System,
        matrix: bool,
    ) -> f64 {
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
            let carrying = strip.carrying(&ends, self.node_tissue_force(state, placed, &ends));
            if !state.tissue.is_empty() || strip.is_rigid() {
                loads = carrying.loads();
            }
            for (rod, load) in [g, g + 1].into_iter().zip(loads) {
                system.add_load(rod, i, load);
            }
            if matrix {
                let hessian = carrying.hessian();
                for (rod, own) in [g, g + 1].into_iter().zip(&hessian.diagonal_blocks) {
                    system.add_block(rod, i, own);
                }
                *system.gap_block_mut(g, i - self.first_node()) = hessian.off_diagonal_block;
            }
        }
        if matrix {
            system.clear_cell_blocks();
        }
        for cell in self.tissue_cells() {
            energy += self.add_cell(state, cell, system, matrix);
        }
        energy
    }

    /// Writes the forces that the tissue carries after `step` times the increments in `solution`.
    pub(in crate::leaf) fn advance_tissue(
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
                    let turns = [rotation_part(&a), rotation_part(&b)];
                    strip.carrying(&ends, force).force_increment(dx, turns)
                }
            };
            let k = self.strip_index(StripPlace::Node, g, i);
            next.tissue[k] = (force + step * change) / self.grid.node_weight(i);
        }
        for cell in self.tissue_cells() {
            self.advance_cell(state, cell, step, increment, |k, force| {
                next.tissue[k] = force
            });
        }
        if self.has_tissue_cells() {
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
        let still = |_, _| [0.0; 6];
        for cell in self.tissue_cells() {
            // The state carries none: a step of no length has the forces of the strains.
            self.advance_cell(state, cell, 0.0, still, |k, force| forces[k] = force);
        }
        state.tissue = forces;
    }

    /// The second derivatives of the energy of the strip of every node; those of strips that contract
    /// are in [`DiscreteLeaf::cell_stiffness`].
    pub fn tissue_stiffness(&self, state: &State) -> impl Iterator<Item = StripStiffness> {
        self.each_node_strip().map(|it| {
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
    pub(in crate::leaf) fn for_each_tissue_response(
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
        let moved = |rod: usize, node: usize| match node == i {
            true => increments[rod - g],
            false => [0.0; 6],
        };
        for cell in self.cells_at_node(g, i) {
            self.for_each_cell_response(state, cell, moved, &mut add);
        }
    }

    /// Calls `add` with the changes of the loads of all tissue by a change of the leaf, the weighted sum over
    /// leaves that differ, in a fixed state; returns the change of the energy. What is rigid has no change of
    /// its force; what a leaf does not have is soft.
    pub(in crate::leaf) fn for_each_tissue_change(
        &self,
        state: &State,
        each: &[(f64, &DiscreteLeaf)],
        mut add: impl FnMut(usize, usize, Wrench),
    ) -> f64 {
        let with_tissue = each.iter().find(|(_, leaf)| leaf.has_tissue());
        let Some((_, first)) = with_tissue else {
            return 0.0;
        };
        let mut energy = 0.0;
        for own in first.each_node_strip() {
            let (g, i) = (own.gap, own.node);
            let k = first.strip_index(own.place, g, i);
            let soft = own.strip.without_stiffness();
            let mut change = TissueStrip::default();
            for (weight, leaf) in each {
                let strip = leaf.strips.get(k).unwrap_or(&soft);
                change.add(*weight, &strip.difference_from(own.strip));
            }
            if change == TissueStrip::default() {
                continue;
            }
            let strip = self.strip(own.place, g, i).unwrap_or(&soft);
            let loads = strip.parameter_derivative(&strip_ends(state, g, i), &change);
            energy += loads.energy;
            for (rod, load) in [g, g + 1].into_iter().zip(loads.on_nodes) {
                add(rod, i, load);
            }
        }
        // Each leaf less the first.
        let total: f64 = each.iter().map(|(weight, _)| weight).sum();
        for (weight, leaf) in each.iter().copied().chain([(-total, *first)]) {
            for cell in leaf.tissue_cells() {
                energy += weight
                    * leaf.for_each_cell_load(state, cell, |rod, i, load| {
                        add(rod, i, scaled_wrench(load, weight));
                    });
            }
        }
        energy
    }

    /// Second derivatives of the energy of the tissue along a shape, at all nodes but clamped bases. Where the tissue
    /// carries the forces of the state, those that the shape causes in rigid directions are multipliers.
    pub fn tissue_curvature(
        &self,
        state: &State,
        shape: &[Increment],
        forces: TissueForces,
    ) -> f64 {
        let moving = self
            .each_node_strip()
            .filter(|it| it.node >= self.first_node());
        let each = moving.map(|it| {
            let [a, b] = [it.gap, it.gap + 1].map(|rod| &shape[state.base(rod) + it.node]);
            let both = PairGradient::from_fn(|k, _| if k < 6 { a[k] } else { b[k - 6] });
            let ends = it.ends(state);
            match forces {
                TissueForces::Carried => {
                    let force = self.node_tissue_force(state, it, &ends);
                    it.strip.carrying(&ends, force).curvature(&both, 2.0)
                }
                TissueForces::Strained => {
                    let carried = self.rigid_tissue_force(state, it.gap, it.node);
                    let force = it.strip.force(&ends, carried);
                    it.strip.carrying(&ends, force).curvature(&both, 1.0)
                }
            }
        });
        let nodes: f64 = each.sum();
        let increment = |rod: usize, i: usize| match i < self.first_node() {
            true => [0.0; 6],
            false => shape[state.base(rod) + i],
        };
        let cells = self.tissue_cells();
        let cells = cells.map(|cell| self.cell_curvature(state, cell, forces, increment));
        nodes + cells.sum::<f64>()
    }
}

/// A moment and a force times a factor.
fn scaled_wrench(load: Wrench, factor: f64) -> Wrench {
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

impl System {
    /// Whether tissue ties neighbors, also by moments: then the matrix must be factorized as a
    /// whole, as rod by rod conjugate gradients take too many iterations.
    pub fn has_tissue(&self) -> bool {
        !self.gap_blocks.is_empty()
    }

    /// The unknowns of a node (rotation, displacement) that are coupled with those of neighbors.
    pub(in crate::leaf) fn coupled_unknowns(&self) -> [bool; 6] {
        let along = |c: usize| self.gaps.iter().any(|gap| gap[c] != 0.0);
        std::array::from_fn(|c| self.has_tissue() || c >= 3 && along(c - 3))
    }

    /// The block between node `i` (from the first with equations) of rod `g` and the same node of the
    /// next rod, if there is tissue.
    pub(in crate::leaf) fn gap_block(&self, g: usize, i: usize) -> Option<&NodeBlock> {
        match self.has_tissue() && g + 1 < self.rods {
            true => Some(&self.gap_blocks[g * self.nodes() + i]),
            false => None,
        }
    }

    /// As [`System::gap_block`], to be changed.
    pub(in crate::leaf) fn gap_block_mut(&mut self, g: usize, i: usize) -> &mut NodeBlock {
        let nodes = self.nodes();
        &mut self.gap_blocks[g * nodes + i]
    }

    /// Adds the upper triangle of a block to the matrix at node `i` of rod `j`.
    pub(in crate::leaf) fn add_block(&mut self, j: usize, i: usize, block: &NodeBlock) {
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
