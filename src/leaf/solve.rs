//! Factorization of Newton's equations, and their solution by conjugate gradients.
//!
//! With the preconditioner B of `system`, B p is updated by the same recursion as the direction p, so
//! that an iteration costs one solve with B and one product with the sparse E. [`DefiniteFactors`] is
//! for several right-hand sides: rod by rod or, where tissue ties the rods, as a whole.

use crate::leaf::block_tridiagonal::{GroupIncrements, ShiftedMasses, TipFactor, rod_lane};
use crate::leaf::direct::{DirectSolver, MatrixFactors};
use crate::leaf::system::{
    CouplingOperator, CurvatureKernel, DirectionUpdateKernel, MassLoad, SolutionUpdateKernel,
    System, each_group, group_rods,
};
use crate::simd::{NumberGroup, run};
use glam::DVec3;
use rayon::prelude::*;

/// Largest number of conjugate gradient iterations. Where more are needed a direct factorization is
/// faster.
const MAX_CG_ITERATIONS: usize = 200;

/// The outcome of a linear solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearSolveOutcome {
    /// Converged to the tolerance, with the number of iterations.
    Converged(usize),
    /// The matrix is not positive definite; detected after this number of iterations.
    Indefinite(usize),
    /// The iteration limit was reached.
    TooSlow(usize),
    /// The matrix of a rod under a dead moment is singular.
    Singular,
}

impl LinearSolveOutcome {
    /// The number of iterations.
    pub fn iterations(self) -> usize {
        match self {
            LinearSolveOutcome::Converged(count)
            | LinearSolveOutcome::Indefinite(count)
            | LinearSolveOutcome::TooSlow(count) => count,
            LinearSolveOutcome::Singular => 1,
        }
    }
}

impl System {
    /// Factorizes B + shift M; false if it is not positive definite, or tissue ties the rods.
    pub fn factorize(&mut self, shift: f64) -> bool {
        // Tissue is not in B + E.
        if self.has_tissue() {
            return false;
        }
        self.factorize_signed(shift, false)
    }

    /// Factorizes the matrix of a single rod whatever the signs of its pivots;
    /// false only if one of them is zero.
    pub fn factorize_indefinite(&mut self) -> bool {
        debug_assert_eq!(self.rods, 1);
        self.factorize_signed(0.0, true)
    }

    fn factorize_signed(&mut self, shift: f64, any_sign: bool) -> bool {
        let (arch, weights) = (self.arch, &self.weights);
        each_group(self.parallel, &mut self.groups, |_, group| {
            let masses = ShiftedMasses {
                shift,
                per_weight: group.masses,
                weights,
            };
            group.definite = group.matrix.factorize(arch, &masses, any_sign);
        });
        if !self.groups.iter().all(|group| group.definite) {
            return false;
        }
        if !self.joined {
            return true;
        }
        let mut sum = [[0.0; 3]; 3];
        for (g, group) in self.groups.iter().enumerate() {
            for lane in 0..group_rods(g, self.rods).len() {
                for (sum, row) in sum.iter_mut().zip(group.matrix.tip_block(lane)) {
                    for c in 0..3 {
                        sum[c] += row[c];
                    }
                }
            }
        }
        self.tip = TipFactor::new(sum);
        self.tip.is_some()
    }

    /// Solves with the factorized matrix for the assembled right-hand side plus `inertia`, to the
    /// relative accuracy `tolerance` in the energy norm.
    pub fn solve(&mut self, inertia: Option<MassLoad>, tolerance: f64) -> LinearSolveOutcome {
        let mut tip_residual = self.set_residual(inertia);
        let preconditioned = self.precondition(tip_residual);
        let (mut tip_z, mut rz) = (preconditioned.tip, preconditioned.product);
        if !self.coupled {
            for group in &mut self.groups {
                group.solution.copy_from_slice(&group.z);
            }
            return match self.moments.is_empty() || self.correct_for_moments() {
                true => LinearSolveOutcome::Converged(1),
                false => LinearSolveOutcome::Singular,
            };
        }

        let mut tip_p = tip_z;
        let mut tip_b_p = tip_residual;
        let mut tip_solution = DVec3::ZERO;
        for (group, p) in self.groups.iter_mut().zip(&mut self.p) {
            group.solution.fill(GroupIncrements::default());
            p.copy_from_slice(&group.z);
            group.b_p.copy_from_slice(&group.residual);
        }
        let target = tolerance * tolerance * rz;
        let mut iterations = 1;
        loop {
            let p_k_p = self.direction_curvature() + tip_p.dot(tip_b_p);
            if p_k_p.is_nan() || p_k_p <= 0.0 {
                return if rz == 0.0 {
                    LinearSolveOutcome::Converged(iterations)
                } else {
                    LinearSolveOutcome::Indefinite(iterations)
                };
            }
            let alpha = rz / p_k_p;
            self.advance(alpha);
            tip_solution += alpha * tip_p;
            tip_residual -= alpha * tip_b_p;
            let preconditioned = self.precondition(tip_residual);
            let rz_next = preconditioned.product;
            tip_z = preconditioned.tip;
            if rz_next <= target {
                break;
            }
            if iterations >= MAX_CG_ITERATIONS {
                return LinearSolveOutcome::TooSlow(iterations);
            }
            iterations += 1;
            let beta = rz_next / rz;
            rz = rz_next;
            tip_p = tip_z + beta * tip_p;
            tip_b_p = tip_residual + beta * tip_b_p;
            self.update_direction(beta);
        }
        if self.joined {
            for group in &mut self.groups {
                let last = group.solution.last_mut().expect("a rod has a segment");
                set_tip(last, tip_solution, &group.active_lanes);
            }
        }
        LinearSolveOutcome::Converged(iterations)
    }

    /// Sets the residual to the right-hand side plus `inertia`; returns the residual of a joint tip.
    fn set_residual(&mut self, inertia: Option<MassLoad>) -> DVec3 {
        let (rods, weights, joined) = (self.rods, &self.weights, self.joined);
        each_group(self.parallel, &mut self.groups, |g, group| {
            group.residual.copy_from_slice(&group.rhs);
            let Some(MassLoad { field, factor }) = inertia else {
                return;
            };
            for (lane, j) in group_rods(g, rods).enumerate() {
                let rotary = group.masses.rotary.0[lane] * factor;
                let mass = group.masses.translational.0[lane] * factor;
                for ((r, v), weight) in group.residual.iter_mut().zip(&field[j]).zip(weights) {
                    for c in 0..3 {
                        r[c].0[lane] += rotary * weight * v[c];
                        r[3 + c].0[lane] += mass * weight * v[3 + c];
                    }
                }
            }
        });
        if inertia.is_some() {
            // Velocities of before are across the axes of before.
            for held in self.spin_axes.iter() {
                let at = rod_lane(held.rod);
                let base = &mut self.groups[at.group].residual[0];
                let across = held.across(DVec3::from([0, 1, 2].map(|c| base[c].0[at.lane])));
                (0..3).for_each(|c| base[c].0[at.lane] = across[c]);
            }
        }
        let mut tip_residual = DVec3::ZERO;
        if joined {
            for group in &mut self.groups {
                let last = group.residual.last_mut().expect("a rod has a segment");
                for c in 0..3 {
                    tip_residual[c] += last[3 + c].sum();
                    last[3 + c] = NumberGroup::default();
                }
            }
        }
        tip_residual
    }

    /// Sets z = B^-1 residual, including the displacement of a joint tip in every rod's last slot.
    fn precondition(&mut self, tip_residual: DVec3) -> PreconditionedTip {
        let (last, arch) = (self.nodes() - 1, self.arch);
        each_group(self.parallel, &mut self.groups, |_, group| {
            group
                .matrix
                .substitute_forward(arch, &group.residual, &mut group.z);
        });
        let mut tip = None;
        if let Some(factor) = self.tip.as_ref().filter(|_| self.joined) {
            let mut b = tip_residual;
            for group in &self.groups {
                for c in 0..3 {
                    b[c] += group.z[last][3 + c].sum();
                }
            }
            tip = Some(factor.solve(b));
        }
        each_group(self.parallel, &mut self.groups, |_, group| {
            if let Some(tip) = tip {
                set_tip(&mut group.z[last], tip, &group.active_lanes);
            }
            // A joint tip's slots hold no residual, only its displacement.
            group.partial_product =
                (group.matrix).substitute_backward(arch, &group.residual, &mut group.z);
        });
        let tip = tip.unwrap_or_default();
        let product = self
            .groups
            .iter()
            .map(|group| group.partial_product)
            .sum::<f64>();
        PreconditionedTip {
            tip,
            product: product + tip_residual.dot(tip),
        }
    }

    /// p . (B + E) p without the contribution of the tip.
    fn direction_curvature(&mut self) -> f64 {
        let (p, weights, arch) = (&self.p, &self.coupling_weights, self.arch);
        each_group(self.parallel, &mut self.groups, |g, group| {
            let mut kernel = CurvatureKernel {
                group,
                coupled: CouplingOperator {
                    p,
                    group: g,
                    weights,
                },
                product: NumberGroup::default(),
            };
            run(arch, &mut kernel);
            group.partial_product = kernel.product.sum();
        });
        self.groups.iter().map(|group| group.partial_product).sum()
    }

    /// Adds `alpha` p to the solution and updates the residual, which stays zero in the slots
    /// of a joint tip, where no coupling acts.
    fn advance(&mut self, alpha: f64) {
        let (p, weights, arch) = (&self.p, &self.coupling_weights, self.arch);
        each_group(self.parallel, &mut self.groups, |g, group| {
            let coupled = CouplingOperator {
                p,
                group: g,
                weights,
            };
            run(
                arch,
                &mut SolutionUpdateKernel {
                    group,
                    coupled,
                    alpha,
                },
            );
        });
    }

    /// The next direction: z plus `beta` times the last.
    fn update_direction(&mut self, beta: f64) {
        let arch = self.arch;
        let turn = |(group, p): (&mut _, &mut Vec<GroupIncrements>)| {
            run(arch, &mut DirectionUpdateKernel { group, p, beta });
        };
        match self.parallel {
            true => (self.groups.par_iter_mut()).zip(&mut self.p).for_each(turn),
            false => self.groups.iter_mut().zip(&mut self.p).for_each(turn),
        }
    }
}

/// What a solve with the preconditioner leaves beside z.
struct PreconditionedTip {
    /// Displacement of a joint tip; zero without one.
    tip: DVec3,
    /// residual . z over all unknowns.
    product: f64,
}

/// Writes the displacement of a joint tip.
fn set_tip(last: &mut GroupIncrements, tip: DVec3, active: &NumberGroup) {
    for c in 0..3 {
        last[3 + c] = NumberGroup(active.0.map(|active| active * tip[c]));
    }
}

/// The factors of the matrix assembled in a [`System`]: of the whole matrix or, if `None`, of the rods in
/// the system itself.
pub struct DefiniteFactors(Option<MatrixFactors>);

impl DefiniteFactors {
    /// Factorizes K + `shift` M; `None` if it is not positive definite, or does not fit into memory.
    pub fn new(system: &mut System, shift: f64) -> Option<Self> {
        if !system.has_tissue() {
            return system.factorize(shift).then_some(DefiniteFactors(None));
        }
        let solver = DirectSolver::new(system).ok()?;
        let factors = solver.factorize_definite(system, shift).ok()??;
        Some(DefiniteFactors(Some(factors)))
    }

    /// Factorizes the matrix of a single rod whatever the signs of its pivots; `None` if one of them
    /// is zero.
    pub fn indefinite_single_rod(system: &mut System) -> Option<Self> {
        system
            .factorize_indefinite()
            .then_some(DefiniteFactors(None))
    }

    /// Solves for the right-hand side in `system`, to the relative accuracy `tolerance` in the
    /// energy norm.
    pub fn solve(&mut self, system: &mut System, tolerance: f64) -> LinearSolveOutcome {
        match &mut self.0 {
            None => system.solve(None, tolerance),
            Some(factors) => {
                factors.solve(system, None);
                LinearSolveOutcome::Converged(1)
            }
        }
    }
}
