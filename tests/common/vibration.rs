//! Small vibrations of a leaf at rest: its stiffness and mass matrices, from
//! the second derivatives of the segments, and the frequencies they give.

use glam::{DMat3, DVec3};
use leafdyn::internals::leaf::{DiscreteLeaf, State};
use leafdyn::internals::motion::Physics;
use leafdyn::internals::rotation::outer;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// A leaf with its nodes' freedoms numbered: turns about and shifts along the
/// lab axes. Bases are held; a joint tip is one point.
pub struct Linear {
    /// First freedom of the turn and of the shift of every node, rod by rod.
    freedoms: Vec<Option<[usize; 2]>>,
    /// Stiffness of the strains and loads, and of the coupling.
    pub strains: DMatrix<f64>,
    pub coupling: DMatrix<f64>,
    /// One over the root of the mass matrix.
    pub per_root_mass: DMatrix<f64>,
}

/// Frequencies, lowest first, and modes as columns.
pub struct Modes {
    pub frequencies: Vec<f64>,
    pub modes: DMatrix<f64>,
}

fn add(matrix: &mut DMatrix<f64>, (row, column): (usize, usize), block: &DMat3) {
    for c in 0..3 {
        for r in 0..3 {
            matrix[(row + r, column + c)] += block.col(c)[r];
        }
    }
}

impl Linear {
    pub fn new(leaf: &DiscreteLeaf, physics: &Physics, state: &State) -> Self {
        let (rods, n) = (leaf.rods(), leaf.segments());
        let joined = leaf.leaf.joined() && rods > 1;
        let mut freedoms = Vec::new();
        let mut count = 0;
        let mut next = || {
            count += 3;
            count - 3
        };
        let mut tip = None;
        for _ in 0..rods {
            freedoms.push(None);
            for i in 1..=n {
                let (turn, met) = (next(), tip.filter(|_| i == n && joined));
                let shift = met.unwrap_or_else(&mut next);
                tip = (i == n).then_some(shift).or(tip);
                freedoms.push(Some([turn, shift]));
            }
        }
        let zeros = || DMatrix::zeros(count, count);
        let mut linear = Linear {
            freedoms,
            strains: zeros(),
            coupling: zeros(),
            per_root_mass: zeros(),
        };
        linear.add_segments(leaf, state);
        linear.add_coupling(leaf);
        linear.add_masses(leaf, physics, state);
        linear
    }

    fn add_segments(&mut self, leaf: &DiscreteLeaf, state: &State) {
        for j in 0..leaf.rods() {
            for i in 0..leaf.segments() {
                // Exact, however stiff.
                let section = leaf.section(j, i).condense(f64::INFINITY);
                let idle = leaf.segment(state, j, i, DVec3::ZERO);
                let strain = idle.v(&section) - section.rest_strain;
                let force = idle.frame * (strain / section.compliance);
                let k = leaf.segment(state, j, i, force).hessian(&section);
                let node = state.base(j) + i;
                // Turn and shift of the left end, turn and shift of the right.
                let rows = [
                    [k.aa, -k.xa.transpose(), k.ab, k.xa.transpose()],
                    [-k.xa, k.xx, -k.xb, -k.xx],
                    [k.ab.transpose(), -k.xb.transpose(), k.bb, k.xb.transpose()],
                    [k.xa, -k.xx, k.xb, k.xx],
                ];
                let ends = [self.freedoms[node], self.freedoms[node + 1]];
                for (r, row) in rows.iter().enumerate() {
                    for (c, block) in row.iter().enumerate() {
                        if let (Some(a), Some(b)) = (ends[r / 2], ends[c / 2]) {
                            add(&mut self.strains, (a[r % 2], b[c % 2]), block);
                        }
                    }
                }
            }
        }
    }

    fn add_coupling(&mut self, leaf: &DiscreteLeaf) {
        let n = leaf.segments();
        let joined = leaf.leaf.joined();
        for gap in 1..leaf.rods() {
            for i in 1..=n {
                if i == n && joined {
                    continue;
                }
                let spring = leaf.leaf.coupling(gap - 1) * leaf.grid.weight(i);
                let nodes = [(gap - 1) * (n + 1) + i, gap * (n + 1) + i];
                let [a, b] = nodes.map(|node| self.freedoms[node].unwrap()[1]);
                let block = DMat3::from_diagonal(spring);
                for (at, sign) in [((a, a), 1.0), ((b, b), 1.0), ((a, b), -1.0), ((b, a), -1.0)] {
                    add(&mut self.coupling, at, &(sign * block));
                }
            }
        }
    }

    fn add_masses(&mut self, leaf: &DiscreteLeaf, physics: &Physics, state: &State) {
        let mut masses = vec![0.0; self.strains.nrows()];
        for j in 0..leaf.rods() {
            for i in 1..=leaf.segments() {
                let node = state.base(j) + i;
                let [turn, shift] = self.freedoms[node].unwrap();
                let inertia = physics.inertia(leaf, j, i);
                let d1 = state.q[node] * DVec3::X;
                let own = (inertia.transverse / inertia.polar()).sqrt() - 1.0;
                let root = inertia.transverse.sqrt().recip();
                let root = root * (DMat3::IDENTITY + own * outer(d1, d1));
                add(&mut self.per_root_mass, (turn, turn), &root);
                masses[shift] += inertia.mass;
            }
        }
        for (shift, mass) in masses.into_iter().enumerate() {
            for c in (0..3).filter(|_| mass > 0.0) {
                self.per_root_mass[(shift + c, shift + c)] = mass.sqrt().recip();
            }
        }
    }

    /// Stiffness over mass, symmetric.
    pub fn scaled(&self, stiffness: &DMatrix<f64>) -> DMatrix<f64> {
        let root = &self.per_root_mass;
        let count = root.nrows();
        // A row has three entries at most.
        let row = |r: usize| -> Vec<(usize, f64)> {
            let near = r.saturating_sub(2)..(r + 3).min(count);
            let entries = near.map(|c| (c, root[(r, c)]));
            entries.filter(|(_, value)| *value != 0.0).collect()
        };
        let rows: Vec<_> = (0..count).map(row).collect();
        let times = |matrix: &DMatrix<f64>| {
            let entry = |r, (k, value): &(usize, f64)| matrix[(*k, r)] * value;
            DMatrix::from_fn(count, count, |r, c| {
                rows[c].iter().map(|of| entry(r, of)).sum()
            })
        };
        // Transposed on the way, twice.
        times(&times(stiffness))
    }

    /// Frequencies and modes.
    pub fn modes(&self) -> Modes {
        let all = self.scaled(&(&self.strains + &self.coupling));
        let eigen = SymmetricEigen::new(all);
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let modes = (&self.per_root_mass * &eigen.eigenvectors).select_columns(&order);
        let frequencies = order.iter().map(|&k| eigen.eigenvalues[k].sqrt()).collect();
        Modes { frequencies, modes }
    }

    /// A shape, given by increments of all nodes, in the numbering of the freedoms.
    pub fn numbered(&self, shape: &[[f64; 6]]) -> DVector<f64> {
        let mut numbered = DVector::zeros(self.strains.nrows());
        for (freedoms, increment) in self.freedoms.iter().zip(shape) {
            for (at, part) in freedoms.iter().flatten().zip(increment.chunks(3)) {
                numbered.rows_mut(*at, 3).copy_from_slice(part);
            }
        }
        numbered
    }

    /// The state displaced by `size` times a mode, whose largest entry is one.
    pub fn displaced(&self, state: &State, mode: DVector<f64>, size: f64) -> State {
        let factor = size / mode.amax();
        let mut displaced = state.clone();
        for (node, freedoms) in self.freedoms.iter().enumerate() {
            if let Some([turn, shift]) = freedoms {
                let of = |at: usize| [0, 1, 2].map(|c| mode[at + c]);
                let [a, b] = [turn, shift].map(|&at| of(at));
                let increment = [a[0], a[1], a[2], b[0], b[1], b[2]];
                displaced.advance(node, &increment, factor);
            }
        }
        displaced
    }
}
