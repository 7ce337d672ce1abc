//! Factorisation, and conjugate gradients.
//!
//! B p follows p by the recursion of the method itself, so that an iteration
//! costs one solve with B and one product with the sparse E.

use super::{System, dot, each_rod};
use crate::leaf::chain::TipFactor;
use crate::leaf::state::Increment;
use glam::DVec3;

/// Iterations after which the rod-wise preconditioner is held to have failed.
const MAX_ITERATIONS: usize = 200;

/// How a solution went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solved {
    /// To the tolerance, in so many iterations.
    Yes(usize),
    /// The matrix is not positive definite; noticed after so many iterations.
    Indefinite(usize),
    /// The iteration limit was reached.
    TooSlow(usize),
}

impl System {
    /// Factorises B + shift M; false if it is not positive definite.
    pub fn factorize(&mut self, shift: f64) -> bool {
        self.factorize_signed(shift, false)
    }

    /// Factorises the matrix of a single rod whatever the signs of its pivots;
    /// false only if one of them is zero.
    pub fn factorize_indefinite(&mut self) -> bool {
        debug_assert_eq!(self.rods.len(), 1);
        self.factorize_signed(0.0, true)
    }

    fn factorize_signed(&mut self, shift: f64, any_sign: bool) -> bool {
        each_rod(self.parallel, &mut self.rods, |_, rod| {
            let tip = rod.matrix.factorize(shift, &rod.mass, any_sign);
            rod.partial = if tip.is_some() { 1.0 } else { -1.0 };
            if let (Some(tip), Some(last)) = (tip, rod.z.last_mut()) {
                // Carried to the sum below without allocating.
                *last = [
                    tip[0][0], tip[0][1], tip[0][2], tip[1][1], tip[1][2], tip[2][2],
                ];
            }
        });
        if self.rods.iter().any(|rod| rod.partial < 0.0) {
            return false;
        }
        if !self.joined {
            return true;
        }
        let mut sum = [0.0; 6];
        for rod in &self.rods {
            for (sum, value) in sum.iter_mut().zip(&rod.z[self.segments - 1]) {
                *sum += value;
            }
        }
        let [a, b, c, d, e, f] = sum;
        self.tip = TipFactor::new([[a, b, c], [b, d, e], [c, e, f]]);
        self.tip.is_some()
    }

    /// Solves with the factorised matrix for the assembled right-hand side
    /// plus `inertia` (mass times velocity over time step), to the relative
    /// accuracy `tolerance` in the energy norm.
    pub fn solve(&mut self, inertia: Option<(&[Vec<Increment>], f64)>, tolerance: f64) -> Solved {
        let (last, joined) = (self.segments - 1, self.joined);
        let mut tip_residual = self.load_residual(inertia);
        if !self.coupled {
            self.precondition(tip_residual);
            for rod in &mut self.rods {
                rod.solution.copy_from_slice(&rod.z);
            }
            if self.moment != DVec3::ZERO {
                self.correct_for_moment();
            }
            return Solved::Yes(1);
        }

        let mut tip_z = self.precondition(tip_residual);
        let mut tip_p = tip_z;
        let mut tip_b_p = tip_residual;
        let mut tip_solution = [0.0; 3];
        for (rod, p) in self.rods.iter_mut().zip(&mut self.p) {
            rod.solution.fill([0.0; 6]);
            p.copy_from_slice(&rod.z);
            rod.b_p.copy_from_slice(&rod.residual);
        }
        let mut rz = self.residual_dot_z(&tip_residual, &tip_z);
        let target = tolerance * tolerance * rz;
        let mut iterations = 1;
        loop {
            let p_k_p = self.multiply() + dot(&tip_p, &tip_b_p);
            if p_k_p.is_nan() || p_k_p <= 0.0 {
                return if rz == 0.0 {
                    Solved::Yes(iterations)
                } else {
                    Solved::Indefinite(iterations)
                };
            }
            let alpha = rz / p_k_p;
            let p = &self.p;
            each_rod(self.parallel, &mut self.rods, |j, rod| {
                for i in 0..rod.solution.len() {
                    for c in 0..6 {
                        rod.solution[i][c] += alpha * p[j][i][c];
                        rod.residual[i][c] -= alpha * (rod.b_p[i][c] + rod.e_p[i][c]);
                    }
                }
            });
            for c in 0..3 {
                tip_solution[c] += alpha * tip_p[c];
                tip_residual[c] -= alpha * tip_b_p[c];
            }
            if joined {
                // No coupling acts on the joint tip: B p alone stands there.
                for rod in &mut self.rods {
                    for c in 3..6 {
                        rod.residual[last][c] = 0.0;
                    }
                }
            }
            tip_z = self.precondition(tip_residual);
            let rz_next = self.residual_dot_z(&tip_residual, &tip_z);
            if rz_next <= target {
                break;
            }
            if iterations >= MAX_ITERATIONS {
                return Solved::TooSlow(iterations);
            }
            iterations += 1;
            let beta = rz_next / rz;
            rz = rz_next;
            for c in 0..3 {
                tip_p[c] = tip_z[c] + beta * tip_p[c];
                tip_b_p[c] = tip_residual[c] + beta * tip_b_p[c];
            }
            for (rod, p) in self.rods.iter_mut().zip(&mut self.p) {
                for i in 0..p.len() {
                    for c in 0..6 {
                        p[i][c] = rod.z[i][c] + beta * p[i][c];
                        rod.b_p[i][c] = rod.residual[i][c] + beta * rod.b_p[i][c];
                    }
                }
            }
        }
        if joined {
            for rod in &mut self.rods {
                rod.solution[last][3..].copy_from_slice(&tip_solution);
            }
        }
        Solved::Yes(iterations)
    }

    /// Makes the right-hand side plus `inertia` the residual; returns that of a
    /// joint tip.
    fn load_residual(&mut self, inertia: Option<(&[Vec<Increment>], f64)>) -> [f64; 3] {
        let last = self.segments - 1;
        each_rod(self.parallel, &mut self.rods, |j, rod| {
            rod.residual.copy_from_slice(&rod.rhs);
            if let Some((velocity, per_step)) = inertia {
                for ((r, v), m) in rod.residual.iter_mut().zip(&velocity[j]).zip(&rod.mass) {
                    for c in 0..6 {
                        r[c] += m[c / 3] * v[c] * per_step;
                    }
                }
            }
        });
        let mut tip_residual = [0.0; 3];
        if self.joined {
            for rod in &mut self.rods {
                for c in 0..3 {
                    tip_residual[c] += rod.residual[last][3 + c];
                    rod.residual[last][3 + c] = 0.0;
                }
            }
        }
        tip_residual
    }

    /// z = B^-1 residual, complete with the tip's displacement in every rod's
    /// last slot; returns that displacement.
    fn precondition(&mut self, tip_residual: [f64; 3]) -> [f64; 3] {
        let last = self.segments - 1;
        each_rod(self.parallel, &mut self.rods, |_, rod| {
            rod.z.copy_from_slice(&rod.residual);
            rod.matrix.forward(&mut rod.z);
        });
        let mut tip = [0.0; 3];
        if let Some(factor) = self.tip.as_ref().filter(|_| self.joined) {
            let mut b = tip_residual;
            for rod in &self.rods {
                for c in 0..3 {
                    b[c] += rod.z[last][3 + c];
                }
            }
            tip = factor.solve(b);
        }
        let joined = self.joined;
        each_rod(self.parallel, &mut self.rods, |_, rod| {
            if joined {
                rod.z[last][3..].copy_from_slice(&tip);
            }
            rod.matrix.backward(&mut rod.z);
        });
        tip
    }

    /// residual . z over all unknowns.
    fn residual_dot_z(&mut self, tip_residual: &[f64; 3], tip_z: &[f64; 3]) -> f64 {
        each_rod(self.parallel, &mut self.rods, |_, rod| {
            rod.partial = rod
                .residual
                .iter()
                .zip(&rod.z)
                .map(|(a, b)| dot(a, b))
                .sum();
        });
        // A joint tip's slots hold no residual, only its displacement.
        self.rods.iter().map(|rod| rod.partial).sum::<f64>() + dot(tip_residual, tip_z)
    }

    /// e_p = E p for every rod; returns p . (B + E) p without the tip's part.
    fn multiply(&mut self) -> f64 {
        let (p, springs, joined, last) = (&self.p, &self.springs, self.joined, self.segments - 1);
        each_rod(self.parallel, &mut self.rods, |j, rod| {
            let mut partial = 0.0;
            for i in 0..rod.e_p.len() {
                let mut e_p = [0.0; 6];
                for (gap, neighbour) in [(j.wrapping_sub(1), j.wrapping_sub(1)), (j, j + 1)] {
                    if gap < springs.len() {
                        for c in 0..3 {
                            e_p[3 + c] -= springs[gap][i][c] * p[neighbour][i][3 + c];
                        }
                    }
                }
                rod.e_p[i] = e_p;
                let count = if joined && i == last { 3 } else { 6 };
                for c in 0..count {
                    partial += p[j][i][c] * (rod.b_p[i][c] + e_p[c]);
                }
            }
            rod.partial = partial;
        });
        self.rods.iter().map(|rod| rod.partial).sum()
    }

    /// A dead moment M is not conservative in three dimensions: the derivative
    /// of the tip's moment balance in spatial increments gains -[M]/2, which is
    /// skew. It has rank two at one node and is brought in by the formula of
    /// Sherman, Morrison and Woodbury.
    fn correct_for_moment(&mut self) {
        use nalgebra::Matrix3;
        let last = self.segments - 1;
        let rod = &mut self.rods[0];
        let m = 0.5 * self.moment;
        let skew = Matrix3::new(0.0, m.z, -m.y, -m.z, 0.0, m.x, m.y, -m.x, 0.0);
        // Columns of B^-1 that belong to the tip's rotation, one at a time.
        let mut columns = Matrix3::zeros();
        for c in 0..3 {
            rod.z.fill([0.0; 6]);
            rod.z[last][c] = 1.0;
            rod.matrix.forward(&mut rod.z);
            rod.matrix.backward(&mut rod.z);
            for r in 0..3 {
                columns[(r, c)] = rod.z[last][r];
            }
        }
        let turn = nalgebra::Vector3::from_column_slice(&rod.solution[last][..3]);
        let small = Matrix3::identity() + skew * columns;
        let Some(inverse) = small.try_inverse() else {
            return;
        };
        let moment = inverse * (skew * turn);
        rod.z.fill([0.0; 6]);
        rod.z[last][..3].copy_from_slice(moment.as_slice());
        rod.matrix.forward(&mut rod.z);
        rod.matrix.backward(&mut rod.z);
        for (solution, z) in rod.solution.iter_mut().zip(&rod.z) {
            for c in 0..6 {
                solution[c] -= z[c];
            }
        }
    }
}
