//! The cells between two nodes of neighboring veins, whose strips contract as the two segments between the nodes
//! are strained: their energy, forces and second derivatives by the four nodes.

use crate::leaf::block_tridiagonal::{RodLane, rod_lane};
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{Increment, State, displacement_part, rotation_part};
use crate::leaf::system::System;
use crate::leaf::tissue::strips::{StripPlace, strip_ends};
use crate::rod::{
    CarryingStrip, ContractingStrains, NodeBlock, NodePair, PairGradient, SegmentGradient,
    StrainFactors, StripHessian, StripStrainGradients, StripStress, UNKNOWNS, VeinStrain, Wrench,
};
use crate::rotation;
use glam::{DVec2, DVec3};
use nalgebra::{SMatrix, SVector};

/// Unknowns of the four nodes of a cell: of the first rod those of a segment, then of the next rod.
const CELL_UNKNOWNS: usize = 4 * UNKNOWNS;

/// The second derivatives of the energy of the strips of a cell, by the unknowns of its four nodes.
pub type CellMatrix = SMatrix<f64, CELL_UNKNOWNS, CELL_UNKNOWNS>;

/// Derivatives by the unknowns of the four nodes of a cell.
pub(super) type CellGradient = SVector<f64, CELL_UNKNOWNS>;

/// The two segments of a cell, whose strains contract its strips.
struct CellStrains {
    strains: [VeinStrain; 2],
}

impl CellStrains {
    /// The mean excess of the strains of both veins.
    fn mean(&self) -> ContractingStrains {
        let [a, b] = self.strains.each_ref().map(|of| of.excess);
        ContractingStrains {
            stretch: 0.5 * (a.stretch + b.stretch),
            shear: 0.5 * (a.shear + b.shear),
            twist: 0.5 * (a.twist + b.twist),
            bend: 0.5 * (a.bend + b.bend),
        }
    }

    /// The derivatives of the mean strains by the unknowns of the four nodes.
    fn gradients(&self) -> MeanStrainGradients {
        let both = |of: &dyn Fn(&VeinStrain) -> PairGradient| {
            let [a, b] = self.strains.each_ref().map(|vein| 0.5 * of(vein));
            CellGradient::from_fn(|k, _| if k < 12 { a[k] } else { b[k - 12] })
        };
        MeanStrainGradients {
            forces: [DVec2::X, DVec2::Y].map(|axis| both(&|vein| vein.force_gradient(axis))),
            moments: [DVec2::X, DVec2::Y].map(|axis| both(&|vein| vein.moment_gradient(axis))),
        }
    }
}

/// The derivatives of the mean strains of both veins of a cell.
struct MeanStrainGradients {
    /// Of the stretch and the shear.
    forces: [CellGradient; 2],
    /// Of the twist and the bend.
    moments: [CellGradient; 2],
}

impl MeanStrainGradients {
    /// The derivatives of the sum of stretch and shear with these factors.
    fn of_forces(&self, factors: DVec2) -> CellGradient {
        factors.x * self.forces[0] + factors.y * self.forces[1]
    }

    /// The derivatives of the sum of twist and bend with these factors.
    fn of_moments(&self, factors: DVec2) -> CellGradient {
        factors.x * self.moments[0] + factors.y * self.moments[1]
    }
}

/// A strip in a corner of a cell, in a state.
struct CornerStrip {
    /// The strip as its veins are strained, and the force that it carries.
    carrying: CarryingStrip,
    ends: NodePair,
    /// Whether it is at the first nodes of the cell, or at the last: 0 or 1.
    end: usize,
    place: StripPlace,
    /// The spatial force that it carries.
    force: DVec3,
}

impl CornerStrip {
    /// The derivatives of the contracted strains across and in the fold by the unknowns of the cell, from
    /// those of the mean strains.
    fn strain_gradients(&self, means: &MeanStrainGradients) -> [CellGradient; 2] {
        let StripStrainGradients { across, fold } = self.carrying.strain_gradients();
        let factors = self.carrying.strip().vein_strain_factors();
        let mut gradients = [
            means.of_forces(factors.force),
            means.of_moments(factors.moment),
        ];
        for (gradient, own) in gradients.iter_mut().zip([across, fold]) {
            for k in 0..12 {
                gradient[corner_unknown(self.end, k)] += own[k];
            }
        }
        gradients
    }
}

/// Which forces the strips of the tissue carry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TissueForces {
    /// Those of the state, which are condensed out: at rest they are in balance to more digits than strains have.
    Carried,
    /// Those of their strains, in rigid directions those of the state.
    Strained,
}

/// The strips of a cell in a state.
struct AssembledCell {
    energy: f64,
    /// Derivatives of the energy by the unknowns of the four nodes.
    gradient: CellGradient,
}

/// A cell between segments of neighboring rods.
#[derive(Clone, Copy, Debug)]
pub struct TissueCell {
    /// The gap after rod `gap`.
    pub gap: usize,
    /// The segment of both rods.
    pub segment: usize,
}

impl TissueCell {
    /// Rod and number of node `k` of the four, in the order of the unknowns.
    pub fn node(self, k: usize) -> (usize, usize) {
        (self.gap + k / 2, self.segment + k % 2)
    }
}

/// The part of the tissue in the resultants of a segment.
#[derive(Clone, Copy, Debug)]
pub struct ContractionResultants {
    /// Its part of n_1 and n_2, the forces against a stretch and a shear in the plane.
    pub force: DVec2,
    /// Its part of m_1 and m_2, the moments against a twist and a bend about d2.
    pub moment: DVec2,
    /// The derivatives of its energy by the nodes of the segment.
    pub gradient: SegmentGradient,
}

/// The second derivatives of the energy of the strips of a cell.
pub struct CellStiffness {
    pub cell: TissueCell,
    /// By the unknowns (rotation, displacement) of its four nodes.
    pub matrix: CellMatrix,
}

/// The number among the unknowns of a cell of unknown `k` of the strip at its first or last nodes.
fn corner_unknown(end: usize, k: usize) -> usize {
    12 * (k / 6) + 6 * end + k % 6
}

impl DiscreteLeaf {
    /// All cells, if strips are strained by their veins.
    pub(in crate::leaf) fn tissue_cells(&self) -> impl Iterator<Item = TissueCell> + use<> {
        let gaps = match self.has_tissue_cells() {
            true => self.rods() - 1,
            false => 0,
        };
        let n = self.segments();
        (0..gaps).flat_map(move |gap| (0..n).map(move |segment| TissueCell { gap, segment }))
    }

    /// The cells next to node `i` in gap `gap`, if strips are strained by their veins.
    pub(super) fn cells_at_node(
        &self,
        gap: usize,
        i: usize,
    ) -> impl Iterator<Item = TissueCell> + use<> {
        let cells = [i.checked_sub(1), (i < self.segments()).then_some(i)];
        let has_cells = self.has_tissue_cells();
        let cells = cells.into_iter().flatten().filter(move |_| has_cells);
        cells.map(move |segment| TissueCell { gap, segment })
    }

    /// The strains of the veins of a cell.
    fn cell_strains(&self, state: &State, cell: TissueCell) -> CellStrains {
        let TissueCell { gap, segment } = cell;
        let strain =
            |j: usize| VeinStrain::between(self.section(j, segment), &state.ends(j, segment));
        CellStrains {
            strains: [gap, gap + 1].map(strain),
        }
    }

    /// The strips in the corners of a cell, as its veins are strained.
    fn corner_strips(
        &self,
        state: &State,
        cell: TissueCell,
        veins: &CellStrains,
        forces: TissueForces,
    ) -> [CornerStrip; 2] {
        let strained = veins.mean();
        [StripPlace::Ahead, StripPlace::Behind].map(|place| {
            let end = usize::from(place == StripPlace::Behind);
            let (g, i) = (cell.gap, cell.segment + end);
            let strip = self.strips[self.strip_index(place, g, i)].contracted(strained);
            let ends = strip_ends(state, g, i);
            let carried = self.carried_tissue_force(state, place, g, i);
            let carried = carried.filter(|_| forces == TissueForces::Carried);
            let force = carried.unwrap_or_else(|| strip.force(&ends, DVec3::ZERO));
            CornerStrip {
                carrying: strip.carrying(&ends, force),
                ends,
                end,
                place,
                force,
            }
        })
    }

    /// Energy and derivatives of the strips of a cell, and second derivatives, upper triangle, if wanted.
    fn assembled_cell(
        &self,
        state: &State,
        cell: TissueCell,
        forces: TissueForces,
        mut matrix: Option<&mut CellMatrix>,
    ) -> AssembledCell {
        let veins = self.cell_strains(state, cell);
        let gradients = veins.gradients();
        let (mut energy, mut gradient) = (0.0, CellGradient::zeros());
        let (mut stresses, mut carried) = (StrainFactors::default(), StrainFactors::default());
        let mut squares = [(0.0, CellGradient::zeros()); 4];
        for corner in self.corner_strips(state, cell, &veins, forces) {
            let (strip, end) = (corner.carrying.strip(), corner.end);
            for (node, load) in corner.carrying.loads().into_iter().enumerate() {
                for c in 0..3 {
                    gradient[corner_unknown(end, 6 * node + c)] -= load.moment[c];
                    gradient[corner_unknown(end, 6 * node + 3 + c)] -= load.force[c];
                }
            }
            let stress = corner.carrying.stress();
            let factors = strip.vein_strain_factors();
            energy += stress.energy;
            stresses.force += stress.across * factors.force;
            stresses.moment += stress.fold * factors.moment;
            carried.force += stress.carried_across * factors.force;
            if let Some(matrix) = &mut matrix {
                let [by_across, by_fold] = corner.strain_gradients(&gradients);
                squares[2 * end] = (strip.condensing.y, by_across);
                squares[2 * end + 1] = (strip.fold_stiffness, by_fold);
                add_pair(matrix, &corner.carrying.geometric_hessian(), [end, 2 + end]);
            }
        }
        gradient += gradients.of_forces(stresses.force) + gradients.of_moments(stresses.moment);
        if let Some(matrix) = matrix {
            add_squares(matrix, &squares);
            let half = StrainFactors {
                force: 0.5 * carried.force,
                moment: 0.5 * stresses.moment,
            };
            for (vein, strain) in veins.strains.iter().enumerate() {
                add_pair(matrix, &strain.hessian(half), [2 * vein, 2 * vein + 1]);
            }
        }
        AssembledCell { energy, gradient }
    }

    /// Adds the strips of a cell to the right-hand side of an assembled system and, if `matrix`, to its
    /// matrix, where nodes move; returns their energy.
    pub(super) fn add_cell(
        &self,
        state: &State,
        cell: TissueCell,
        system: &mut System,
        matrix: bool,
    ) -> f64 {
        let mut second = CellMatrix::zeros();
        let wanted = matrix.then_some(&mut second);
        let found = self.assembled_cell(state, cell, TissueForces::Carried, wanted);
        for k in 0..4 {
            let (rod, i) = cell.node(k);
            if i >= self.first_node() {
                system.add_load(rod, i, cell_load(&found.gradient, k));
            }
        }
        if matrix {
            system.add_cell_matrix(cell, &second);
        }
        found.energy
    }

    /// Calls `add` with the rod, the node and the load of everything that the strips of a cell exert by
    /// their strains; returns their energy.
    pub(super) fn for_each_cell_load(
        &self,
        state: &State,
        cell: TissueCell,
        mut add: impl FnMut(usize, usize, Wrench),
    ) -> f64 {
        let found = self.assembled_cell(state, cell, TissueForces::Strained, None);
        for k in 0..4 {
            let (rod, i) = cell.node(k);
            add(rod, i, cell_load(&found.gradient, k));
        }
        found.energy
    }

    /// The energy of the strips of all cells.
    pub(in crate::leaf) fn cell_energy(&self, state: &State) -> f64 {
        let energy = |cell: TissueCell| -> f64 {
            let veins = self.cell_strains(state, cell);
            let corners = self.corner_strips(state, cell, &veins, TissueForces::Strained);
            let each = corners.iter().map(|it| it.carrying.stress());
            each.map(|stress| stress.energy).sum()
        };
        self.tissue_cells().map(energy).sum()
    }

    /// The second derivatives of the energy of the strips of a cell.
    fn cell_matrix(&self, state: &State, cell: TissueCell) -> CellMatrix {
        let mut matrix = CellMatrix::zeros();
        self.assembled_cell(state, cell, TissueForces::Strained, Some(&mut matrix));
        matrix.fill_lower_triangle_with_upper_triangle();
        matrix
    }

    /// The second derivatives of the energy of every cell.
    pub fn cell_stiffness(&self, state: &State) -> impl Iterator<Item = CellStiffness> {
        self.tissue_cells().map(|cell| CellStiffness {
            cell,
            matrix: self.cell_matrix(state, cell),
        })
    }

    /// Second derivatives of the energy of a cell along increments of its nodes: the squares of the strains of its
    /// strips with their stiffnesses, as in [`CarryingStrip::curvature`], and what the stresses add.
    pub(super) fn cell_curvature(
        &self,
        state: &State,
        cell: TissueCell,
        forces: TissueForces,
        increment: impl Fn(usize, usize) -> Increment,
    ) -> f64 {
        let veins = self.cell_strains(state, cell);
        let gradients = veins.gradients();
        let all = cell_increments(cell, increment);
        let pair = |[a, b]: [usize; 2]| {
            PairGradient::from_fn(|k, _| {
                all[UNKNOWNS * (if k < UNKNOWNS { a } else { b }) + k % UNKNOWNS]
            })
        };
        let (mut sum, mut half) = (0.0, StrainFactors::default());
        for corner in self.corner_strips(state, cell, &veins, forces) {
            let (strip, end) = (corner.carrying.strip(), corner.end);
            let [across, fold] = corner.strain_gradients(&gradients).map(|of| of.dot(&all));
            sum += strip.condensing.y * across * across + strip.fold_stiffness * fold * fold;
            sum += (corner.carrying.geometric_hessian()).curvature(&pair([end, 2 + end]));
            let (stress, factors) = (corner.carrying.stress(), strip.vein_strain_factors());
            half.force += 0.5 * stress.carried_across * factors.force;
            half.moment += 0.5 * stress.fold * factors.moment;
        }
        for (vein, strain) in veins.strains.iter().enumerate() {
            sum += strain
                .hessian(half)
                .curvature(&pair([2 * vein, 2 * vein + 1]));
        }
        sum
    }

    /// Calls `add` with the changes of the loads of a cell, as rods, nodes and loads, by increments of its
    /// nodes.
    pub(in crate::leaf) fn for_each_cell_response(
        &self,
        state: &State,
        cell: TissueCell,
        increment: impl Fn(usize, usize) -> Increment,
        mut add: impl FnMut(usize, usize, Wrench),
    ) {
        let change = self.cell_matrix(state, cell) * cell_increments(cell, increment);
        for k in 0..4 {
            let (rod, i) = cell.node(k);
            add(rod, i, cell_load(&change, k));
        }
    }

    /// Calls `write` with the number of every strip of a cell and the spatial force, per unit of sigma, that it
    /// carries after `step` times the increments of the nodes.
    pub(super) fn advance_cell(
        &self,
        state: &State,
        cell: TissueCell,
        step: f64,
        increment: impl Fn(usize, usize) -> Increment,
        mut write: impl FnMut(usize, DVec3),
    ) {
        let veins = self.cell_strains(state, cell);
        let all = cell_increments(cell, increment);
        let strained = veins.gradients().forces.map(|of| of.dot(&all));
        for corner in self.corner_strips(state, cell, &veins, TissueForces::Carried) {
            let part = |node: usize| -> Increment {
                std::array::from_fn(|c| all[corner_unknown(corner.end, 6 * node + c)])
            };
            let (a, b) = (part(0), part(1));
            let dx = displacement_part(&b) - displacement_part(&a);
            let turns = [rotation_part(&a), rotation_part(&b)];
            let CornerStrip {
                carrying,
                ends,
                force,
                ..
            } = &corner;
            let (strip, change) = (carrying.strip(), carrying.force_increment(dx, turns));
            let across = rotation::midpoint(ends.q[0], ends.q[1]) * DVec3::Y;
            let by_veins = strip.vein_strain_factors().force.dot(strained.into());
            let contracted = strip.condensing.y * by_veins * across;
            let i = cell.segment + corner.end;
            let weight = self.strip_weight(corner.place, i);
            let number = self.strip_index(corner.place, cell.gap, i);
            write(number, (*force + step * (change + contracted)) / weight);
        }
    }

    /// What the tissue bears of the resultants of all segments, rod after rod, as it resists the strains of the
    /// veins by which it contracts; empty unless it does.
    pub fn contraction_resultants(&self, state: &State) -> Vec<ContractionResultants> {
        let n = self.segments();
        let mut all = Vec::new();
        if !self.has_tissue_cells() {
            return all;
        }
        // By the strains of each segment, from the cells on either side.
        let mut sums = vec![StrainFactors::default(); self.rods() * n];
        for cell in self.tissue_cells() {
            let veins = self.cell_strains(state, cell);
            for corner in self.corner_strips(state, cell, &veins, TissueForces::Strained) {
                let StripStress { across, fold, .. } = corner.carrying.stress();
                let factors = corner.carrying.strip().vein_strain_factors();
                for rod in [cell.gap, cell.gap + 1] {
                    let sum = &mut sums[rod * n + cell.segment];
                    sum.force += 0.5 * across * factors.force;
                    sum.moment += 0.5 * fold * factors.moment;
                }
            }
        }
        for ((j, i), StrainFactors { force, moment }) in self.rod_index_pairs(0..n).zip(sums) {
            let section = self.section(j, i);
            let strain = VeinStrain::between(section, &state.ends(j, i));
            let gradient = strain.force_gradient(force) + strain.moment_gradient(moment);
            let vector = |first: usize| DVec3::from_slice(&gradient.as_slice()[first..first + 3]);
            all.push(ContractionResultants {
                force: force / section.ds,
                moment: moment / section.ds,
                gradient: SegmentGradient {
                    x: vector(9),
                    a: vector(0),
                    b: vector(6),
                },
            });
        }
        all
    }
}

/// The increments of the four nodes of a cell.
fn cell_increments(
    cell: TissueCell,
    increment: impl Fn(usize, usize) -> Increment,
) -> CellGradient {
    let nodes = [0, 1, 2, 3].map(|k| {
        let (rod, i) = cell.node(k);
        increment(rod, i)
    });
    CellGradient::from_fn(|k, _| nodes[k / UNKNOWNS][k % UNKNOWNS])
}

/// Adds the products of gradients with themselves, each times a factor, in the blocks of the upper triangle.
fn add_squares(matrix: &mut CellMatrix, squares: &[(f64, CellGradient); 4]) {
    for node in 0..4 {
        for c in UNKNOWNS * node..UNKNOWNS * (node + 1) {
            let factors = squares.each_ref().map(|(times, of)| times * of[c]);
            let mut column = matrix.column_mut(c);
            for r in 0..UNKNOWNS * (node + 1) {
                let products = factors
                    .iter()
                    .zip(squares)
                    .map(|(factor, (_, of))| factor * of[r]);
                column[r] += products.sum::<f64>();
            }
        }
    }
}

/// Adds second derivatives between two of the four nodes of a cell, in the blocks of the upper triangle.
fn add_pair(matrix: &mut CellMatrix, hessian: &StripHessian, [a, b]: [usize; 2]) {
    let [first, second] = &hessian.diagonal_blocks;
    let blocks = [
        (a, a, first),
        (b, b, second),
        (a, b, &hessian.off_diagonal_block),
    ];
    for (row, column, block) in blocks {
        for c in 0..UNKNOWNS {
            for r in 0..UNKNOWNS {
                matrix[(UNKNOWNS * row + r, UNKNOWNS * column + c)] += block[r][c];
            }
        }
    }
}

/// Minus the part of derivatives by the unknowns of a cell that belongs to one of its nodes.
fn cell_load(gradient: &CellGradient, node: usize) -> Wrench {
    minus_wrench(&gradient.as_slice()[6 * node..])
}

/// Minus the moment and force that come first in these numbers.
pub(super) fn minus_wrench(numbers: &[f64]) -> Wrench {
    Wrench {
        moment: -DVec3::from_slice(numbers),
        force: -DVec3::from_slice(&numbers[3..]),
    }
}

impl System {
    /// The blocks between node `i` (from the first with equations) of rod `g` and node `i + 1` of the
    /// next rod, and between node `i + 1` and node `i`, if tissue contracts.
    pub(in crate::leaf) fn cell_blocks(&self, g: usize, i: usize) -> Option<&[NodeBlock; 2]> {
        match g + 1 < self.rods {
            true => self.cell_blocks.get(g * self.nodes() + i),
            false => None,
        }
    }

    /// As [`System::cell_blocks`], to be changed.
    pub(in crate::leaf) fn cell_blocks_mut(
        &mut self,
        g: usize,
        i: usize,
    ) -> Option<&mut [NodeBlock; 2]> {
        let nodes = self.nodes();
        self.cell_blocks.get_mut(g * nodes + i)
    }

    pub(super) fn clear_cell_blocks(&mut self) {
        self.cell_blocks.fill([NodeBlock::default(); 2]);
    }

    /// Adds the second derivatives of a cell between nodes s and s + 1 of rods g and g + 1, upper
    /// triangle, where nodes have equations.
    fn add_cell_matrix(&mut self, cell: TissueCell, matrix: &CellMatrix) {
        let TissueCell { gap: g, segment: s } = cell;
        let block = |a: usize, b: usize| -> NodeBlock {
            std::array::from_fn(|r| std::array::from_fn(|c| matrix[(6 * a + r, 6 * b + c)]))
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
}
