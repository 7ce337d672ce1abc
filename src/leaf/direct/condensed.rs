//! The matrix of a leaf factorised vein after vein, without a general sparse solver.
//!
//! The rotations of a vein are eliminated node by node. What they leave is a dense symmetric matrix
//! T_j of its displacements, by which alone a vein is coupled with the next one (diagonal matrices
//! E_j), so that the veins follow one another: S_1 = T_1 and
//! S_j+1 = T_j+1 - E_j S_j^-1 E_j. Every S_j is inverted in place by symmetric sweeps (J. H.
//! Goodnight, A tutorial on the SWEEP operator, Am. Stat. 33, 1979), whose pivots have the signs of
//! the eigenvalues by Sylvester's law; the displacement of a joint tip follows all others.
//!
//! The pivots are the rotation or the displacement of a node. Where one would let the other entries
//! grow, the matrix is left to the sparse factorisation, which chooses its pivots.

use super::sweep::{Matrix3, Workspace, padded, sweep3};
use super::unknowns::Unknowns;
use super::vein::Vein;
use crate::leaf::system::System;
use pulp::{Arch, Simd, WithSimd};

/// The factorised matrix.
pub struct Condensed {
    veins: Vec<Vein>,
    /// Coupling of every vein with the next, at the displacements that are eliminated.
    coupling: Vec<Vec<f64>>,
    /// Minus the inverse of the matrix that is left for the displacement of a joint tip.
    tip: Option<Matrix3>,
    /// Number of negative pivots.
    negative: usize,
    /// Displacements of a vein, and those of them that are eliminated with it.
    width: usize,
    own: usize,
    arch: Arch,
}

impl Condensed {
    /// Factorises the matrix assembled in `system` plus `shift` times its mass matrix. `None` if
    /// pivots are too small or not numbers.
    pub fn new(system: &System, shift: f64) -> Option<Self> {
        let mut work = Workspace::new(system);
        let (width, own) = (work.width, work.own);
        let mut condensed = Condensed {
            veins: Vec::with_capacity(system.rods()),
            coupling: (1..system.rods())
                .map(|j| coupling(system, j - 1, own))
                .collect(),
            tip: None,
            negative: 0,
            width,
            own,
            arch: system.arch,
        };
        for j in 0..system.rods() {
            let mut vein = Vein::default();
            let before = j.checked_sub(1);
            let before = before.map(|k| (&condensed.veins[k], condensed.coupling[k].as_slice()));
            condensed.negative += vein.eliminate((system, shift, j), before, &mut work)?;
            mirror(&mut vein.swept, width);
            condensed.veins.push(vein);
        }
        if system.joined {
            let (negative, tip) = tip(condensed.veins.last()?, &work)?;
            condensed.negative += negative;
            condensed.tip = Some(tip);
        }
        Some(condensed)
    }

    /// The number of negative eigenvalues alone, without the factors. `None` as for
    /// [`Condensed::new`].
    pub fn count(system: &System, shift: f64) -> Option<usize> {
        let mut work = Workspace::new(system);
        let [mut vein, mut last] = [(); 2].map(|()| Vein::default());
        let mut negative = 0;
        let mut gap = Vec::new();
        for j in 0..system.rods() {
            let before = (j > 0).then_some((&last, gap.as_slice()));
            negative += vein.eliminate((system, shift, j), before, &mut work)?;
            gap = coupling(system, j, work.own);
            std::mem::swap(&mut vein, &mut last);
        }
        if system.joined {
            negative += tip(&last, &work)?.0;
        }
        Some(negative)
    }

    /// Number of negative eigenvalues, by Sylvester's law of inertia.
    pub fn negative(&self) -> usize {
        self.negative
    }

    /// Solves in place, with these numbers of the unknowns. A step of iterative refinement makes the
    /// solution as accurate as one without inverse matrices.
    pub fn solve(&self, unknowns: &Unknowns, b: &mut [f64]) {
        let mut x = b.to_vec();
        self.solve_once(unknowns, &mut x);
        self.subtract_product(unknowns, &x, b);
        self.solve_once(unknowns, b);
        b.iter_mut().zip(&x).for_each(|(b, x)| *b += x);
    }

    /// Solves in place without refinement.
    pub fn solve_once(&self, unknowns: &Unknowns, b: &mut [f64]) {
        self.arch.dispatch(Solution {
            condensed: self,
            unknowns,
            b,
        });
    }

    /// Subtracts the matrix times `x` from `b`.
    fn subtract_product(&self, unknowns: &Unknowns, x: &[f64], b: &mut [f64]) {
        for (j, vein) in self.veins.iter().enumerate() {
            for (i, node) in vein.nodes.iter().enumerate() {
                let here = unknowns.of(j, i);
                let own = here.map(|k| x[k]);
                for (at, row) in here.iter().zip(&node.own) {
                    b[*at] -= product(row, &own);
                }
                if i + 1 < vein.nodes.len() {
                    let ahead = unknowns.of(j, i + 1);
                    let next = ahead.map(|k| x[k]);
                    for (r, row) in node.next.iter().enumerate() {
                        b[here[r]] -= product(row, &next);
                        for (at, value) in ahead.iter().zip(row) {
                            b[*at] -= value * own[r];
                        }
                    }
                }
                if j + 1 < self.veins.len() && 3 * i < self.own {
                    let other = unknowns.of(j + 1, i);
                    for c in 0..3 {
                        let coupling = self.coupling[j][3 * i + c];
                        b[here[3 + c]] += coupling * x[other[3 + c]];
                        b[other[3 + c]] += coupling * x[here[3 + c]];
                    }
                }
            }
        }
    }
}

fn product(row: &[f64; 6], values: &[f64; 6]) -> f64 {
    row.iter().zip(values).map(|(a, b)| a * b).sum()
}

/// The coupling of a vein with the next at the displacements that are eliminated with it.
fn coupling(system: &System, j: usize, own: usize) -> Vec<f64> {
    let spring = |k: usize| system.spring(j, k / 3).map_or(0.0, |spring| spring[k % 3]);
    (0..own).map(spring).collect()
}

/// Completes a symmetric matrix of padded rows, given by its upper triangle.
fn mirror(a: &mut [f64], width: usize) {
    let stride = padded(width);
    for r in 1..width {
        for c in 0..r {
            a[r * stride + c] = a[c * stride + r];
        }
    }
}

/// The number of negative pivots of a joint tip after the last vein, and minus the inverse of
/// its matrix.
fn tip(last: &Vein, work: &Workspace) -> Option<(usize, Matrix3)> {
    let at = |k: usize| (work.own + k) * padded(work.width) + work.own;
    let entry = |r: usize, c: usize| last.swept[at(r.min(c)) + r.max(c)];
    let mut tip: Matrix3 = std::array::from_fn(|r| std::array::from_fn(|c| entry(r, c)));
    let scale = std::array::from_fn(|k| tip[k][k].abs());
    Some((sweep3(&mut tip, scale)?, tip))
}

/// Solves for a vector of all unknowns, in place.
struct Solution<'a> {
    condensed: &'a Condensed,
    unknowns: &'a Unknowns,
    b: &'a mut [f64],
}

impl WithSimd for Solution<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Solution {
            condensed,
            unknowns,
            b,
        } = self;
        let Condensed { width, own, .. } = *condensed;
        let rods = condensed.veins.len();
        let mut turns = vec![[0.0; 3]; width / 3];
        // S^-1 times what is left for the displacements of every vein, then these themselves.
        let mut shifts = vec![0.0; rods * width];
        let mut load = vec![0.0; width];
        let mut tip = unknowns
            .tip
            .map_or([0.0; 3], |tip| [b[tip], b[tip + 1], b[tip + 2]]);
        for (j, vein) in condensed.veins.iter().enumerate() {
            load.fill(0.0);
            for (i, turn) in turns.iter_mut().enumerate() {
                let at = unknowns.of(j, i);
                for c in 0..3 {
                    turn[c] = b[at[c]];
                    if 3 * i < own {
                        load[3 * i + c] = b[at[3 + c]];
                    }
                }
            }
            vein.solve_rotations(&mut turns);
            for (i, turn) in turns.iter().enumerate() {
                let at = unknowns.of(j, i);
                for c in 0..3 {
                    b[at[c]] = turn[c];
                }
            }
            vein.subtract_rotations(&turns, &mut load);
            let (before, here) = shifts.split_at_mut(j * width);
            if j > 0 {
                let before = &before[(j - 1) * width..];
                for k in 0..own {
                    load[k] += condensed.coupling[j - 1][k] * before[k];
                }
            }
            let here = &mut here[..width];
            vein.multiply(&load[..own], here);
            for c in 0..width - own {
                tip[c] += load[own + c] - here[own + c];
            }
            here[..own].iter_mut().for_each(|value| *value = -*value);
        }
        if let Some(inverse) = condensed.tip {
            tip = inverse.map(|row| -(row[0] * tip[0] + row[1] * tip[1] + row[2] * tip[2]));
            let first = unknowns.tip.expect("a joint tip has numbers");
            b[first..first + 3].copy_from_slice(&tip);
        }
        let mut product = vec![0.0; width];
        for (j, vein) in condensed.veins.iter().enumerate().rev() {
            let (here, next) = shifts.split_at_mut((j + 1) * width);
            let here = &mut here[j * width..];
            if j + 1 < rods {
                for k in 0..own {
                    load[k] = condensed.coupling[j][k] * next[k];
                }
                vein.multiply(&load[..own], &mut product);
                for k in 0..own {
                    here[k] -= product[k];
                }
            }
            for (c, tip) in tip.iter().enumerate().take(width - own) {
                let column = &vein.swept[(own + c) * padded(width)..];
                for k in 0..own {
                    here[k] -= column[k] * tip;
                }
                here[own + c] = *tip;
            }
            vein.rotations_of(here, &mut turns);
            for (i, turn) in turns.iter().enumerate() {
                let at = unknowns.of(j, i);
                for c in 0..3 {
                    b[at[c]] -= turn[c];
                    if 3 * i < own {
                        b[at[3 + c]] = here[3 * i + c];
                    }
                }
            }
        }
    }
}
