//! The equations of a branch on one grid, assembled, linearized and solved.
//!
//! Where the matrix is singular, or nearly so, it is bordered by modes: the equations with the
//! border are regular, and components along the modes that the forces leave undetermined are not
//! changed. The modes come from subspace inverse iteration.

use crate::branch::family::{
    CompletedIncrements, LeafFamily, Leaves, OutOfRange, force_parameter_derivative,
    place_supports, state_after_step, stiffest_condensed, unbalanced_forces,
};
use crate::branch::points::{
    BranchDirection, EquilibriumPoint, ParametrizedState, add_scaled, combine_fields, is_finite,
    largest, prolong_field, scale_field, scaled_sum,
};
use crate::leaf::dot;
use crate::leaf::{
    BorderedSolution, DirectError, DirectSolver, Grid, MatrixFactors, NodalField, State, System,
};
use crate::newton::{Contraction, RequiredAccuracy, remaining_error};
use crate::numbers::larger;
use crate::rod::RESOLVED_TURN;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use std::array::from_fn;
use std::sync::Arc;

/// Largest number of Newton iterations of a corrector.
pub(super) const ITERATIONS: usize = 10;

/// Largest increment (radians, lengths, fractions) of an iteration.
pub(super) const LARGEST_CORRECTOR_INCREMENT: f64 = 1.0;

/// Accuracy of a point (radians, lengths).
pub(super) const ACCURACY: f64 = 1e-10;

/// Increments below this that do not shrink are due to rounding.
const ROUNDING_INCREMENT: f64 = 1e-8;

/// Rounding error of a force, in units of epsilon times the largest stiffness.
const ROUNDING: f64 = 10.0;

/// Why no point of a branch is found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CorrectorFailure {
    /// The parameter has left its range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// A segment bends by more than the grid resolves.
    #[error("a vein bends by more than a right angle within one segment")]
    Unresolved,
    /// Newton's method does not converge.
    #[error("Newton's method does not lead back to the branch")]
    NotConverged,
    /// Without a potential no equilibrium beyond is a continuation of the last one.
    #[error("the branch turns back or ends near here: beyond, no equilibrium continues it")]
    TurnsBack,
    /// The matrix does not fit into memory.
    #[error("the sparse factorisation of the leaf does not fit into memory")]
    TooLarge,
    /// No grid has the Morse index of the leaf.
    #[error(
        "no grid has as many negative eigenvalues as the leaf, which is too close to a bifurcation: start farther from it"
    )]
    BesideBifurcation,
    /// Rounding may change the sign of the softest eigenvalues.
    #[error("rounding on so many segments hides which eigenvalues are negative: fewer tell more")]
    Rounding,
    /// Modes that became neutral together no longer do.
    #[error("modes that become neutral together part")]
    Separated,
    /// The second parameter breaks the symmetry to which the branch point is due.
    #[error("the second number breaks the symmetry by which branches cross")]
    Unfolded,
    /// The limit of the run was reached.
    #[error("the run was stopped")]
    Stopped,
}

impl From<DirectError> for CorrectorFailure {
    fn from(error: DirectError) -> Self {
        match error {
            DirectError::Memory => CorrectorFailure::TooLarge,
            DirectError::NotFinite => CorrectorFailure::NotConverged,
        }
    }
}

/// The equations of a family of leaves on a grid, with workspace.
pub struct BranchEquations<'a, const N: usize = 1> {
    /// The leaves of the family on one grid.
    pub leaves: Leaves<'a, N>,
    /// The leaves with softened matrices, if these determine what is critical. Newton's method
    /// needs the true matrices: near singular points of the softened ones it would not converge.
    regularized_leaves: Option<Leaves<'a, N>>,
    /// The mass of the leaf without its base.
    pub(super) mass: f64,
    pub(super) system: System,
    /// Whether the equations are solved rod by rod, which needs a positive definite matrix.
    pub(super) solves_rod_by_rod: bool,
    /// Matrices factorized so far.
    pub factorizations: usize,
}

/// A state whose matrix is in the system.
pub(super) struct AssembledForces {
    pub forces: NodalField,
    /// The shift that keeps neutral modes from counting as unstable.
    pub(super) shift: f64,
    /// Rounding error of the forces.
    pub rounding_error: f64,
}

/// The forces by which the law of nearly rigid segments is completed; none without such segments.
#[derive(Default)]
pub(super) struct LawCompletion {
    /// Forces on the nodes by which the increments are completed, if there are any.
    nodal_forces: Option<NodalField>,
    pub segment_forces: Vec<DVec3>,
}

impl<'a, const N: usize> BranchEquations<'a, N> {
    /// Allocates the equations of `family` on `grid`.
    pub fn new(family: &'a LeafFamily<'a, N>, grid: Grid) -> Self {
        BranchEquations::from_leaves(Leaves::new(family, grid))
    }

    fn from_leaves(leaves: Leaves<'a, N>) -> Self {
        let system = leaves.family.system(&leaves.grid);
        let one = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
        let ones = vec![vec![one; system.nodes()]; system.rods()];
        BranchEquations {
            leaves,
            regularized_leaves: None,
            mass: dot(&system.mass_product(&ones), &ones),
            system,
            solves_rod_by_rod: true,
            factorizations: 0,
        }
    }

    /// Fails once the limit of the run is reached.
    pub(super) fn check_limit(&self) -> Result<(), CorrectorFailure> {
        match self.leaves.family.limit.reached() {
            true => Err(CorrectorFailure::Stopped),
            false => Ok(()),
        }
    }

    /// The equations of the same leaves on the grid with all segments halved.
    pub fn refined(&self) -> Self {
        BranchEquations {
            solves_rod_by_rod: self.solves_rod_by_rod,
            ..BranchEquations::from_leaves(self.leaves.refined())
        }
    }

    /// Lets the matrices of leaves with this additional compliance determine what is singular:
    /// see [`Leaves::with_regularization`].
    pub(super) fn regularize(&mut self, softening: f64) {
        let (family, grid) = (self.leaves.family, self.grid().clone());
        self.regularized_leaves = Some(Leaves::with_regularization(family, grid, softening));
    }

    /// The grid of all its leaves.
    pub fn grid(&self) -> &Grid {
        &self.leaves.grid
    }

    /// Inner product of two increments over the mass matrix, per unit of the leaf's mass.
    pub fn mass_product(&self, a: &NodalField, b: &NodalField) -> f64 {
        dot(&self.system.mass_product(a), b) / self.mass
    }

    /// The mass matrix times increments, per unit of the leaf's mass.
    pub fn multiply_by_mass(&self, a: &NodalField) -> NodalField {
        scale_field(&self.system.mass_product(a), 1.0 / self.mass)
    }

    /// The mass matrix times each of these fields, per unit of the leaf's mass.
    pub(super) fn multiply_all_by_mass(&self, all: &[NodalField]) -> Vec<NodalField> {
        all.iter().map(|a| self.multiply_by_mass(a)).collect()
    }

    /// The first node of a rod with equations, with which increments begin.
    pub fn first_node(&self) -> usize {
        self.system.first_node()
    }

    pub(super) fn rods(&self) -> usize {
        self.system.rods()
    }

    /// Inner product of two directions: over the mass matrix, per unit of the leaf's mass, plus that
    /// of the parameters' parts.
    pub fn direction_product(&self, a: &BranchDirection<N>, b: &BranchDirection<N>) -> f64 {
        let params = a.params.iter().zip(b.params).map(|(a, b)| a * b);
        self.mass_product(&a.increments, &b.increments) + params.sum::<f64>()
    }

    /// Scales a direction to length one in the inner product of directions.
    pub fn normalize_direction(&self, direction: BranchDirection<N>) -> BranchDirection<N> {
        let length = self.direction_product(&direction, &direction).sqrt();
        BranchDirection {
            increments: scale_field(&direction.increments, 1.0 / length),
            params: direction.params.map(|part| part / length),
        }
    }

    /// The one of two opposite directions that is more along another one.
    pub(super) fn orient_direction(
        &self,
        direction: BranchDirection<N>,
        along: &BranchDirection<N>,
    ) -> BranchDirection<N> {
        match self.direction_product(&direction, along) < 0.0 {
            true => direction.reversed(),
            false => direction,
        }
    }

    /// A direction on the grid of which this one halves all segments.
    pub(super) fn prolong_direction(&self, coarse: &BranchDirection<N>) -> BranchDirection<N> {
        self.normalize_direction(BranchDirection {
            increments: prolong_field(&coarse.increments, self.first_node()),
            params: coarse.params,
        })
    }

    /// State and parameters `step` further along a direction.
    pub fn displace_along_direction(
        &mut self,
        solution: &ParametrizedState<N>,
        to: &BranchDirection<N>,
        step: f64,
    ) -> Result<ParametrizedState<N>, OutOfRange> {
        let params = to.parameters_after_step(solution.params, step);
        let state = self.state_after_increments(&solution.state, params, &to.increments, step)?;
        Ok(ParametrizedState { state, params })
    }

    /// A state after `step` times these increments, for the leaf at these parameters.
    pub fn state_after_increments(
        &mut self,
        state: &State,
        params: [f64; N],
        increments: &NodalField,
        step: f64,
    ) -> Result<State, OutOfRange> {
        let increments = CompletedIncrements {
            increments,
            law_forces: &[],
        };
        let leaf = self.leaves.leaf_at(params)?;
        Ok(state_after_step(
            leaf,
            state,
            &mut self.system,
            increments,
            step,
        ))
    }

    /// A state after a whole step of Newton's method, for the leaf at these parameters.
    pub(super) fn state_after_newton_step(
        &mut self,
        state: &State,
        params: [f64; N],
        step: CompletedIncrements,
    ) -> Result<State, OutOfRange> {
        let leaf = self.leaves.leaf_at(params)?;
        Ok(state_after_step(leaf, state, &mut self.system, step, 1.0))
    }

    /// Completes the law of nearly rigid segments in the increments under the forces assembled at
    /// a solution; `solve` solves with the factors at hand.
    pub(super) fn complete_law(
        &mut self,
        at: &ParametrizedState<N>,
        increments: &mut NodalField,
        solve: &mut dyn FnMut(&mut System, &NodalField) -> Option<NodalField>,
    ) -> Result<LawCompletion, OutOfRange> {
        let leaf = self.leaves.leaf_at(at.params)?;
        if !leaf.is_nearly_rigid() && !leaf.has_rigid_tissue() {
            return Ok(LawCompletion::default());
        }
        self.system.set_solution(increments);
        let nodal_forces = self.system.complete_law(leaf, &at.state, solve);
        *increments = self.system.solution();
        Ok(LawCompletion {
            nodal_forces,
            segment_forces: self.system.law_forces().to_vec(),
        })
    }

    /// Returns the forces; the matrix (the softened one, if `soft` and there is one) is left in
    /// the system.
    pub(super) fn assemble(
        &mut self,
        solution: &mut ParametrizedState<N>,
        soft: bool,
    ) -> Result<AssembledForces, CorrectorFailure> {
        let leaf = leaves_to_assemble(&mut self.leaves, &mut self.regularized_leaves, soft)
            .leaf_at(solution.params)?;
        place_supports(leaf, &mut solution.state);
        self.system.set_coupling(leaf);
        let turn = leaf
            .assemble(&solution.state, &mut self.system)
            .largest_turn;
        leaf.add_phase_conditions(&solution.state, &mut self.system);
        if !turn.is_finite() || turn > RESOLVED_TURN {
            return Err(CorrectorFailure::Unresolved);
        }
        let stiffest = stiffest_condensed(leaf).max(1.0);
        Ok(AssembledForces {
            forces: self.system.rhs(),
            shift: leaf.neutral_shift(),
            rounding_error: ROUNDING * f64::EPSILON * stiffest,
        })
    }

    /// The largest stiffness in stretch and shear with which segment forces are condensed out, in
    /// the matrix that determines what is singular.
    pub(super) fn stiffest_condensed(&mut self, params: [f64; N]) -> Result<f64, OutOfRange> {
        let leaf = leaves_to_assemble(&mut self.leaves, &mut self.regularized_leaves, true)
            .leaf_at(params)?;
        Ok(stiffest_condensed(leaf))
    }

    /// Derivatives of the forces with respect to all parameters; `soft` as in
    /// [`BranchEquations::assemble`].
    pub(super) fn parameter_derivatives(
        &mut self,
        solution: &ParametrizedState<N>,
        soft: bool,
    ) -> Result<Vec<NodalField>, OutOfRange> {
        let leaves = leaves_to_assemble(&mut self.leaves, &mut self.regularized_leaves, soft);
        let rate_of = |which: usize| {
            force_parameter_derivative(|step| {
                let mut params = solution.params;
                params[which] += step;
                let leaf = leaves.leaf_at(params)?;
                Ok(unbalanced_forces(leaf, &solution.state, &mut self.system))
            })
        };
        (0..N).map(rate_of).collect()
    }

    /// The sparsity pattern of the matrix with so many border rows.
    pub(super) fn pattern(&self, border: usize) -> Result<Arc<DirectSolver>, CorrectorFailure> {
        let pattern = self
            .leaves
            .family
            .patterns
            .pattern_of_system(&self.system, border);
        pattern.ok_or(CorrectorFailure::TooLarge)
    }
}

/// The leaves whose matrices are assembled: the softened ones, if `soft` and there are such.
fn leaves_to_assemble<'l, 'a, const N: usize>(
    leaves: &'l mut Leaves<'a, N>,
    softened: &'l mut Option<Leaves<'a, N>>,
    soft: bool,
) -> &'l mut Leaves<'a, N> {
    match softened {
        Some(softened) if soft => softened,
        _ => leaves,
    }
}

/// A direct factorization of the assembled matrix K + `shift` M.
pub(super) fn factorize_matrix(
    pattern: &DirectSolver,
    system: &System,
    shift: f64,
) -> Result<MatrixFactors, CorrectorFailure> {
    Ok(pattern.factorize(system, shift)?)
}

/// Whether the iteration has converged with a Newton step of this size after `previous`.
pub(super) fn has_converged(size: f64, previous: f64) -> bool {
    let first = Contraction::default().error_after_first(size, 0.0);
    let required = RequiredAccuracy {
        accuracy: ACCURACY,
        rounding: ROUNDING_INCREMENT,
    };
    remaining_error(size, previous, [0.0; 2], required, first).is_some()
}

/// Singular values below this, relative to the largest, count as zero.
const NEUTRAL_SINGULAR_VALUE: f64 = 1e-7;

/// Stiffness in stretch and shear, in units of A/L^2, above which segments count as stiff.
pub(super) const STIFF: f64 = 1e4;

/// Subspace iterations: few suffice, since the wanted modes are far softer than the rest.
const SUBSPACE_ITERATIONS: usize = 8;

/// Shift of the matrix (times the mass matrix) in inverse iteration: it keeps
/// pivots away from zero.
const SHIFT: f64 = 1e-9;

/// Solutions of the bordered equations at a state and parameters.
pub struct BorderedLinearization<const N: usize = 1> {
    pub solution: ParametrizedState<N>,
    pub solved: BorderedResponses,
    /// Derivatives of the forces with respect to the parameters.
    pub rates: Vec<NodalField>,
    /// Rounding error of the forces.
    pub noise: f64,
    /// Forces of the segments that complete the law of nearly rigid ones in the increments.
    law_forces: Vec<DVec3>,
}

impl<const N: usize> BranchEquations<'_, N> {
    /// Newton's method to the equilibria within the planes normal to directions through a state.
    /// The matrix may be singular: it is bordered by `border`, and components that remain
    /// undetermined are left unchanged. The rates, if given, may be those of a nearby state: they
    /// only affect the rate of convergence, and leaves at other parameters cost more than an
    /// iteration. Unless `exactly`, a converged leaf with stiff segments is corrected once more:
    /// an error in the length of such a segment causes a large force.
    pub fn correct_bordered(
        &mut self,
        mut solution: ParametrizedState<N>,
        normals: [&BranchDirection<N>; N],
        border: &[NodalField],
        rates: Option<&[NodalField]>,
        exactly: bool,
    ) -> Result<BorderedLinearization<N>, CorrectorFailure> {
        let duals = normals.map(|normal| self.multiply_by_mass(&normal.increments));
        let normals: [_; N] = from_fn(|k| AugmentingFunction {
            state_gradient: &duals[k],
            parameter_gradient: &normals[k].params,
            value: 0.0,
        });
        let mut previous = f64::INFINITY;
        let mut finished = false;
        let mut corrected =
            !exactly && self.leaves.leaf_at(solution.params)?.least_compliance() * STIFF > 1.0;
        for _ in 0..=ITERATIONS + 1 {
            self.check_limit()?;
            let rates = match rates {
                Some(rates) => rates.to_vec(),
                None => self.parameter_derivatives(&solution, finished)?,
            };
            let sample = self.linearize_bordered(solution, border, rates, finished)?;
            if finished {
                return Ok(sample);
            }
            let next = self.newton_step(&sample, &normals)?;
            solution = next.solution;
            let rests = has_converged(next.size, previous);
            finished = rests && corrected;
            corrected |= rests;
            previous = next.size;
        }
        Err(CorrectorFailure::NotConverged)
    }

    /// The state and parameters after the step of [`BorderedResponses::newton_step`].
    pub(super) fn newton_step(
        &mut self,
        sample: &BorderedLinearization<N>,
        functions: &[AugmentingFunction],
    ) -> Result<NewtonIterate<N>, CorrectorFailure> {
        let ParametrizedState { state, params } = &sample.solution;
        let step = sample.solved.newton_step(functions, sample.noise)?;
        let params = from_fn(|i| params[i] + step.parameter_changes[i]);
        let increments = CompletedIncrements {
            increments: &step.increments,
            law_forces: &sample.law_forces,
        };
        Ok(NewtonIterate {
            solution: ParametrizedState {
                state: self.state_after_newton_step(state, params, increments)?,
                params,
            },
            size: step.size,
        })
    }

    /// Solves the bordered equations at a state, in equilibrium or not, given the rates of the
    /// parameters; `soft` as in [`BranchEquations::assemble`].
    pub(super) fn linearize_bordered(
        &mut self,
        mut solution: ParametrizedState<N>,
        border: &[NodalField],
        rates: Vec<NodalField>,
        soft: bool,
    ) -> Result<BorderedLinearization<N>, CorrectorFailure> {
        let linear = self.assemble(&mut solution, soft)?;
        let BorderedSolve {
            responses: mut solved,
            factors: mut factor,
        } = self.solve_bordered(border, &linear.forces, &rates, 0.0)?;
        let none = vec![0.0; border.len()];
        let mut increments = solved.forces.increments.clone();
        // The softened matrix determines what is singular, and no step.
        let completion = match soft {
            true => LawCompletion::default(),
            false => self.complete_law(&solution, &mut increments, &mut |_, forces| {
                Some(factor.solve_bordered(forces, &none).increments)
            })?,
        };
        if let Some(completing) = completion.nodal_forces {
            solved.forces =
                factor.solve_bordered(&scaled_sum(&linear.forces, 1.0, &completing), &none);
        }
        Ok(BorderedLinearization {
            solved,
            solution,
            rates,
            noise: linear.rounding_error,
            law_forces: completion.segment_forces,
        })
    }

    /// Solves the bordered equations with K + `shift` M, where K is the assembled matrix: for the
    /// forces, their rates, and the unit vectors of the border.
    pub(super) fn solve_bordered(
        &mut self,
        border: &[NodalField],
        forces: &NodalField,
        rates: &[NodalField],
        shift: f64,
    ) -> Result<BorderedSolve, CorrectorFailure> {
        let factors = self.factorize_bordered(border, shift)?;
        Ok(bordered_responses(factors, border.len(), forces, rates))
    }

    /// The factors of K + `shift` M with this border, where K is the assembled matrix.
    pub(super) fn factorize_bordered(
        &mut self,
        border: &[NodalField],
        shift: f64,
    ) -> Result<MatrixFactors, CorrectorFailure> {
        let pattern = self.pattern(border.len())?;
        self.factorizations += 1;
        let factors = pattern.factorize_bordered(&self.system, shift, border);
        factors.map_err(|_| CorrectorFailure::TooLarge)
    }
}

/// The solutions of equations with `p` borders that are factorized: for the forces, their rates, and the unit
/// vectors of the border.
pub(super) fn bordered_responses(
    mut factors: MatrixFactors,
    p: usize,
    forces: &NodalField,
    rates: &[NodalField],
) -> BorderedSolve {
    let none = vec![0.0; p];
    let zero = scale_field(forces, 0.0);
    let unit = |i: usize| (0..p).map(|k| if k == i { 1.0 } else { 0.0 }).collect();
    let units: Vec<Vec<f64>> = (0..p).map(unit).collect();
    let columns = units.iter().map(|unit| factors.solve_bordered(&zero, unit));
    let columns: Vec<BorderedSolution> = columns.collect();
    let responses = BorderedResponses {
        h: DMatrix::from_fn(p, p, |r, c| {
            0.5 * (columns[c].multipliers[r] + columns[r].multipliers[c])
        }),
        modes: columns.into_iter().map(|it| it.increments).collect(),
        forces: factors.solve_bordered(forces, &none),
        rates: (rates.iter())
            .map(|rate| factors.solve_bordered(rate, &none))
            .collect(),
        negative: factors.negative_eigenvalue_count(),
    };
    BorderedSolve { responses, factors }
}

impl BranchEquations<'_> {
    /// The `count` modes whose eigenvalues are nearest to zero at a point, by
    /// subspace inverse iteration; of mass one, in the order of these eigenvalues.
    pub fn soft_modes(
        &mut self,
        point: &EquilibriumPoint,
        count: usize,
    ) -> Result<Vec<NodalField>, CorrectorFailure> {
        self.assemble(&mut point.solution(), false)?;
        let count = count
            .min(6 * self.rods() * self.grid().segments() / 2)
            .max(1);
        let pattern = self.pattern(0)?;
        let mut factor = factorize_matrix(&pattern, &self.system, SHIFT)?;
        let mut modes: Vec<NodalField> = (0..count)
            .map(|k| seed_forces(&mut self.system, k))
            .collect();
        for _ in 0..SUBSPACE_ITERATIONS {
            for mode in &mut modes {
                *mode = factor.solve_bordered(mode, &[]).increments;
            }
            // Gram-Schmidt in the mass product, then Rayleigh-Ritz: the operator is
            // K^-1 M, whose largest eigenvalues belong to the softest modes.
            for k in 0..count {
                for l in 0..k {
                    let part = self.mass_product(&modes[l], &modes[k]);
                    let other = modes[l].clone();
                    add_scaled(&mut modes[k], -part, &other);
                }
                let norm = self.mass_product(&modes[k], &modes[k]).sqrt();
                modes[k] = scale_field(&modes[k], 1.0 / norm);
            }
            let momenta = self.multiply_all_by_mass(&modes);
            let image = |momentum| factor.solve_bordered(momentum, &[]).increments;
            let images: Vec<NodalField> = momenta.iter().map(image).collect();
            let ritz = DMatrix::from_fn(count, count, |r, c| {
                0.5 * (dot(&momenta[r], &images[c]) + dot(&momenta[c], &images[r]))
            });
            let eigen = ritz.symmetric_eigen();
            let mut order: Vec<usize> = (0..count).collect();
            let size = |k: usize| eigen.eigenvalues[k].abs();
            order.sort_by(|&a, &b| size(b).total_cmp(&size(a)));
            let mode = |&k: &usize| combine_fields(eigen.eigenvectors.column(k).as_slice(), &modes);
            modes = order.iter().map(mode).collect();
            // Back to forces, for the next inverse iteration.
            if !modes.iter().all(is_finite) {
                return Err(CorrectorFailure::NotConverged);
            }
            modes = self.multiply_all_by_mass(&modes);
        }
        let modes = modes.iter().map(|momentum| {
            let mode = factor.solve_bordered(momentum, &[]).increments;
            let norm = self.mass_product(&mode, &mode).sqrt();
            scale_field(&mode, 1.0 / norm)
        });
        let modes = modes.collect();
        Ok(modes)
    }
}

/// A function of the state and the parameters that becomes zero together with the unbalanced
/// forces. For the plane normal to a direction its gradients are the momentum of that direction
/// and the components of that along the parameters, and its value is zero.
pub(super) struct AugmentingFunction<'f> {
    /// Derivatives with respect to the increments of the nodes, and to the parameters.
    pub state_gradient: &'f NodalField,
    pub parameter_gradient: &'f [f64],
    pub value: f64,
}

/// Newton's step of the bordered equations, augmented by as many functions as parameters.
struct BorderedNewtonStep {
    increments: NodalField,
    parameter_changes: Vec<f64>,
    /// The largest of all (radians, lengths, fractions).
    size: f64,
}

/// The state and parameters after a step of Newton's method, and the size of the step.
pub(super) struct NewtonIterate<const N: usize> {
    pub solution: ParametrizedState<N>,
    pub size: f64,
}

/// Solutions of the bordered equations, and the factors of their matrix.
pub(super) struct BorderedSolve {
    pub responses: BorderedResponses,
    factors: MatrixFactors,
}

/// Solutions of the bordered equations at some state.
pub struct BorderedResponses {
    /// Solutions for the forces, and for their rates with respect to each parameter.
    pub forces: BorderedSolution,
    pub rates: Vec<BorderedSolution>,
    /// The blocks H and X of the solution for the unit vectors of the border.
    pub h: DMatrix<f64>,
    pub modes: Vec<NodalField>,
    /// Negative eigenvalues of the bordered matrix: those of the matrix and those of H
    /// together.
    pub negative: usize,
}

impl BorderedResponses {
    /// Newton's step by which as many additional functions as there are parameters become zero;
    /// fails if it is too large.
    fn newton_step(
        &self,
        functions: &[AugmentingFunction],
        noise: f64,
    ) -> Result<BorderedNewtonStep, CorrectorFailure> {
        let (p, numbers) = (self.modes.len(), self.rates.len());
        let mut matrix = self.h.clone().resize(p + numbers, p + numbers, 0.0);
        let mut right = DVector::zeros(p + numbers);
        for r in 0..p {
            for (i, rate) in self.rates.iter().enumerate() {
                matrix[(r, p + i)] = rate.multipliers[r];
            }
            for (k, function) in functions.iter().enumerate() {
                matrix[(p + k, r)] = dot(function.state_gradient, &self.modes[r]);
            }
            // Forces below rounding are ignored.
            right[r] = match -self.forces.multipliers[r] {
                force if force.abs() < noise => -0.0,
                force => force,
            };
        }
        for (k, function) in functions.iter().enumerate() {
            let dual = function.state_gradient;
            for (i, rate) in self.rates.iter().enumerate() {
                matrix[(p + k, p + i)] =
                    dot(dual, &rate.increments) + function.parameter_gradient[i];
            }
            right[p + k] = -function.value - dot(dual, &self.forces.increments);
        }
        let svd = matrix.svd(true, true);
        let least = NEUTRAL_SINGULAR_VALUE * svd.singular_values.max();
        let solution = svd
            .solve(&right, least)
            .map_err(|_| CorrectorFailure::NotConverged)?;
        let mut increments = self.forces.increments.clone();
        for (i, rate) in self.rates.iter().enumerate() {
            add_scaled(&mut increments, solution[p + i], &rate.increments);
        }
        for (mode, part) in self.modes.iter().zip(solution.iter()) {
            add_scaled(&mut increments, *part, mode);
        }
        let changes: Vec<f64> = solution.iter().skip(p).copied().collect();
        let sizes = changes.iter().map(|v| v.abs());
        let size = sizes.fold(largest(&increments), larger);
        match is_finite(&increments) && size <= LARGEST_CORRECTOR_INCREMENT {
            true => Ok(BorderedNewtonStep {
                increments,
                parameter_changes: changes,
                size,
            }),
            false => Err(CorrectorFailure::NotConverged),
        }
    }
}

/// Forces that excite many modes, with a different pattern along the rods for each `k`.
fn seed_forces(system: &mut System, k: usize) -> NodalField {
    system.seed_inverse_iteration();
    let mut seed = system.rhs();
    for (j, rod) in seed.iter_mut().enumerate() {
        for (i, forces) in rod.iter_mut().enumerate() {
            for (c, force) in forces.iter_mut().enumerate() {
                let phase = (k * (3 * i + 7 * c + 11 * j + 1)) as f64;
                *force *= (0.7 * phase).cos();
            }
        }
    }
    seed
}
