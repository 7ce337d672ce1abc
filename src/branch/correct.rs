//! One step along a branch: a prediction along its tangent, which may end where the range of the
//! parameter does, and Newton's method back to the branch, within a plane or at a parameter. The
//! Morse index there is the number of negative eigenvalues of the matrix, without neutral modes.

use crate::branch::equations::{
    ACCURACY, AssembledForces, BranchEquations, CorrectorFailure, ITERATIONS,
    LARGEST_CORRECTOR_INCREMENT, factorize_matrix, has_converged,
};
use crate::branch::family::{
    CompletedIncrements, OutOfRange, force_parameter_derivative, place_supports, unbalanced_forces,
};
use crate::branch::points::{
    BranchDirection, EquilibriumPoint, ParametrizedState, add_scaled, increments_between,
    inject_forces, is_finite, largest, scale_field, scaled_sum,
};
use crate::leaf::dot;
use crate::leaf::{DiscreteLeaf, LinearSolveOutcome, MatrixFactors, NodalField, State, System};
use crate::newton::ForceConvergence;
use crate::numbers::larger;
use crate::relax::NOISY_EIGENVALUE_THRESHOLD;
use crate::relax::accuracy::transfer::prolong;
use glam::DVec3;

/// Relative tolerance of the conjugate gradients by which rods that are coupled are solved for.
const CG_TOLERANCE: f64 = 1e-11;

/// A step too small to change the sign of any eigenvalue, even of a nearly neutral one.
const INDEX_PRESERVING_STEP: f64 = 1e-9;

/// Iterations go on while an increment is at most this part of the one before, up to so many.
const CONTRACTION_LIMIT: f64 = 0.5;

const MAX_CONTRACTING_ITERATIONS: usize = 50;

/// A hyperplane in which a point is sought.
pub(super) struct ArclengthConstraint {
    /// Its normal: the increments times the mass matrix, per unit of the leaf's mass, and the
    /// component along the parameter.
    pub state_gradient: NodalField,
    pub parameter_gradient: f64,
    /// A state in it; if none, the initial state of the search.
    pub reference_state: Option<State>,
}

impl ArclengthConstraint {
    /// The plane through a point normal to the branch without its parameter: a given displacement
    /// along the branch, measured by the shifts and turns of the nodes of this grid only, lest it
    /// depend on how states are interpolated.
    pub fn normal_to_branch(equations: &BranchEquations, point: &EquilibriumPoint) -> Self {
        let direction = equations.normalize_direction(BranchDirection {
            increments: point.tangent.increments.clone(),
            params: [0.0],
        });
        ArclengthConstraint {
            state_gradient: equations.multiply_by_mass(&direction.increments),
            parameter_gradient: 0.0,
            reference_state: Some(point.state.clone()),
        }
    }

    /// This plane on the grid with all segments halved, that of `leaf`.
    pub fn refined(&self, leaf: &DiscreteLeaf) -> Self {
        ArclengthConstraint {
            state_gradient: inject_forces(&self.state_gradient, leaf.first_node()),
            parameter_gradient: self.parameter_gradient,
            reference_state: (self.reference_state.as_ref()).map(|state| prolong(leaf, state)),
        }
    }

    /// Signed distance of a state from it, without the parameter.
    fn distance(&self, state: &State) -> f64 {
        let through = self.reference_state.as_ref();
        through.map_or(0.0, |through| {
            let first = state.segments() + 1 - self.state_gradient[0].len();
            dot(
                &self.state_gradient,
                &increments_between(through, state, first),
            )
        })
    }
}

/// The equations linearized at a state, and their solutions.
pub(super) struct LinearizedState {
    /// The derivative of the forces with respect to the parameter, and the rate of the increments with it.
    forces_rate: NodalField,
    rate: NodalField,
    /// The factors of the matrix, if that was factorized directly.
    factors: Option<MatrixFactors>,
    /// The number of negative eigenvalues, if it was counted.
    index: Option<usize>,
    /// How far Newton's method has moved since from the state, and from that whose eigenvalues were counted (radians,
    /// lengths, fractions).
    moved: f64,
    moved_since_count: f64,
}

/// At a distance up to this (radians, lengths, fractions) from a state the equations linearized there still hold:
/// an iteration with them gains seven digits, and a tangent misses no more by them than by the differences that the
/// rates are.
const NEARBY_STATE: f64 = 1e-7;

/// Increments that balance the forces at a state, and the forces of the segments that complete the law
/// of nearly rigid ones in them.
struct CorrectorStep {
    forces: NodalField,
    law_forces: Vec<DVec3>,
}

impl BranchEquations<'_> {
    /// Derivative, with respect to the parameter, of the positions of held nodes that have equations,
    /// which the forces do not contain; `None` if there are none.
    fn support_position_rate(
        &mut self,
        state: &State,
        fraction: f64,
    ) -> Result<Option<NodalField>, OutOfRange> {
        let leaf = &self.leaves.leaf_at([fraction])?.leaf;
        if !leaf.has_placed_supports() && !leaf.hinged() {
            return Ok(None);
        }
        let first = self.first_node();
        let held = |step: f64| {
            let mut held = state.clone();
            place_supports(self.leaves.leaf_at([fraction + step])?, &mut held);
            Ok(increments_between(state, &held, first))
        };
        force_parameter_derivative(held).map(Some)
    }

    /// Solves for the forces and their rate with K + shift M: rod by rod if possible,
    /// else by a direct factorization, which also counts the negative eigenvalues.
    fn solve(
        &mut self,
        at: &ParametrizedState,
        linear: &AssembledForces,
        forces_rate: NodalField,
    ) -> Result<(CorrectorStep, LinearizedState), CorrectorFailure> {
        let shift = linear.shift;
        self.factorizations += 1;
        let linearized = |rate, forces_rate, factors: Option<MatrixFactors>| LinearizedState {
            forces_rate,
            rate,
            index: factors
                .as_ref()
                .map(MatrixFactors::negative_eigenvalue_count),
            factors,
            moved: 0.0,
            moved_since_count: 0.0,
        };
        if self.solves_rod_by_rod {
            if self.system.factorize(shift) {
                let mut solved = |system: &mut System, rhs: &NodalField| {
                    system.set_rhs(rhs);
                    let found = system.solve(None, CG_TOLERANCE);
                    matches!(found, LinearSolveOutcome::Converged(_)).then(|| system.solution())
                };
                let found = [&linear.forces, &forces_rate].map(|rhs| solved(&mut self.system, rhs));
                if let [Some(mut forces), Some(rate)] = found {
                    let completion = self.complete_law(at, &mut forces, &mut solved)?;
                    let step = CorrectorStep {
                        forces,
                        law_forces: completion.segment_forces,
                    };
                    return Ok((step, linearized(rate, forces_rate, None)));
                }
            }
            self.solves_rod_by_rod = false;
            self.factorizations += 1;
        }
        let pattern = self.pattern(0)?;
        let mut factors = factorize_matrix(&pattern, &self.system, shift)?;
        let rate = factors.solve_bordered(&forces_rate, &[]).increments;
        let step = self.balance(at, &linear.forces, &mut factors)?;
        Ok((step, linearized(rate, forces_rate, Some(factors))))
    }

    /// The increments by factors of the matrix that balance the forces assembled at a state.
    fn balance(
        &mut self,
        at: &ParametrizedState,
        forces: &NodalField,
        factors: &mut MatrixFactors,
    ) -> Result<CorrectorStep, CorrectorFailure> {
        let mut solved = |rhs: &NodalField| factors.solve_bordered(rhs, &[]).increments;
        let mut forces = solved(forces);
        let completion = self.complete_law(at, &mut forces, &mut |_, rhs| Some(solved(rhs)))?;
        Ok(CorrectorStep {
            forces,
            law_forces: completion.segment_forces,
        })
    }

    /// Newton's step at a state, by the equations linearized there or, if these are known, near it.
    fn corrector_step(
        &mut self,
        now: &mut ParametrizedState,
        known: &mut Option<LinearizedState>,
    ) -> Result<(CorrectorStep, LinearizedState), CorrectorFailure> {
        // The factors take most of the memory, and other ones are next.
        let near = known.take().filter(|near| near.moved < NEARBY_STATE);
        match near {
            Some(mut near) => match near.factors.take() {
                Some(mut factors) => {
                    let leaf = self.leaves.leaf_at(now.params)?;
                    place_supports(leaf, &mut now.state);
                    let forces = unbalanced_forces(leaf, &now.state, &mut self.system);
                    let step = self.balance(now, &forces, &mut factors)?;
                    near.factors = Some(factors);
                    Ok((step, near))
                }
                None => {
                    let linear = self.assemble(now, false)?;
                    let (step, solved) = self.solve(now, &linear, near.forces_rate)?;
                    let linearized = match solved.index {
                        Some(_) => LinearizedState {
                            moved: near.moved,
                            ..solved
                        },
                        None => LinearizedState {
                            moved: near.moved,
                            index: near.index,
                            moved_since_count: near.moved_since_count,
                            ..solved
                        },
                    };
                    Ok((step, linearized))
                }
            },
            None => {
                let forces_rate = self.parameter_derivatives(now, false)?.swap_remove(0);
                let linear = self.assemble(now, false)?;
                self.solve(now, &linear, forces_rate)
            }
        }
    }

    /// Newton corrector: back to the branch within the plane normal to `normal`
    /// through the given state; without a normal, at the given parameter. The
    /// tangent of the point is oriented along `normal`.
    pub fn correct(
        &mut self,
        state: &State,
        fraction: f64,
        normal: Option<&BranchDirection>,
    ) -> Result<EquilibriumPoint, CorrectorFailure> {
        let plane = normal.map(|t| ArclengthConstraint {
            state_gradient: self.multiply_by_mass(&t.increments),
            parameter_gradient: t.params[0],
            reference_state: None,
        });
        let mut point = self.correct_within(state, fraction, plane.as_ref())?;
        if let Some(normal) = normal {
            point.tangent = self.orient_direction(point.tangent, normal);
        }
        Ok(point)
    }

    /// As [`BranchEquations::correct`], within any plane; the tangent points to growing
    /// values of the parameter.
    pub(super) fn correct_within(
        &mut self,
        state: &State,
        fraction: f64,
        plane: Option<&ArclengthConstraint>,
    ) -> Result<EquilibriumPoint, CorrectorFailure> {
        self.correct_from(state, fraction, plane, &mut None)
    }

    /// As [`BranchEquations::correct_within`], with the equations as they are, or become, known at a state nearby.
    pub(super) fn correct_from(
        &mut self,
        state: &State,
        fraction: f64,
        plane: Option<&ArclengthConstraint>,
        known: &mut Option<LinearizedState>,
    ) -> Result<EquilibriumPoint, CorrectorFailure> {
        let mut now = ParametrizedState {
            state: state.clone(),
            params: [fraction],
        };
        let mut previous = f64::INFINITY;
        let mut progress = None;
        for iterations in 1.. {
            self.check_limit()?;
            let (CorrectorStep { forces, law_forces }, linearized) =
                self.corrector_step(&mut now, known)?;
            let mut rate = linearized.rate.clone();
            let linearized = known.insert(linearized);
            if let Some(held) = self.support_position_rate(&now.state, now.params[0])? {
                add_scaled(&mut rate, 1.0, &held);
            }
            self.exclude_turn(&now, &mut rate)?;
            let step = plane.map_or(0.0, |plane| {
                let off = plane.distance(&now.state) + dot(&plane.state_gradient, &forces);
                -off / (dot(&plane.state_gradient, &rate) + plane.parameter_gradient)
            });
            let increments = scaled_sum(&forces, step, &rate);
            let size = larger(largest(&increments), step.abs());
            if !is_finite(&increments) || !step.is_finite() || size > LARGEST_CORRECTOR_INCREMENT {
                return Err(CorrectorFailure::NotConverged);
            }
            linearized.moved += size;
            linearized.moved_since_count += size;
            now.params[0] += step;
            let completed = CompletedIncrements {
                increments: &increments,
                law_forces: &law_forces,
            };
            let next = self.state_after_newton_step(&now.state, now.params, completed)?;
            let progress = match &mut progress {
                Some(progress) => progress,
                none => none.insert(ForceConvergence::new(self.leaves.leaf_at(now.params)?)),
            };
            progress.record_step(size, &now.state, &next);
            now.state = next;
            if has_converged(size, previous) && progress.has_converged(ACCURACY) {
                place_supports(self.leaves.leaf_at(now.params)?, &mut now.state);
                let tangent = self.normalize_direction(BranchDirection {
                    increments: rate,
                    params: [1.0],
                });
                // The factorized matrix is that of the previous state.
                let index = match linearized.index {
                    Some(index) if linearized.moved_since_count < INDEX_PRESERVING_STEP => index,
                    _ => self.index(&now)?,
                };
                (linearized.index, linearized.moved_since_count) = (Some(index), 0.0);
                return Ok(EquilibriumPoint {
                    state: now.state,
                    fraction: now.params[0],
                    tangent,
                    index,
                    iterations,
                });
            }
            // Where the matrix is that of a softer leaf, the method converges linearly.
            if iterations >= ITERATIONS && size > CONTRACTION_LIMIT * previous
                || iterations >= MAX_CONTRACTING_ITERATIONS
            {
                break;
            }
            previous = size;
        }
        Err(CorrectorFailure::NotConverged)
    }

    /// Subtracts the turns of veins that can turn without resistance, so that a tangent does not
    /// depend on where the turns are held.
    fn exclude_turn(
        &mut self,
        at: &ParametrizedState,
        increments: &mut NodalField,
    ) -> Result<(), OutOfRange> {
        let mut excluded: Vec<NodalField> = Vec::new();
        for mut turn in self
            .leaves
            .leaf_at(at.params)?
            .zero_energy_fields(&at.state)
        {
            let without = |field: &mut NodalField, other: &NodalField| {
                let amount = self.mass_product(other, field) / self.mass_product(other, other);
                add_scaled(field, -amount, other);
            };
            excluded.iter().for_each(|other| without(&mut turn, other));
            without(increments, &turn);
            excluded.push(turn);
        }
        Ok(())
    }

    /// Morse index of an equilibrium, without neutral modes.
    fn index(&mut self, solution: &ParametrizedState) -> Result<usize, CorrectorFailure> {
        let shift = self.leaves.leaf_at(solution.params)?.neutral_shift();
        let index = self.index_below(solution, shift)?;
        if shift > NOISY_EIGENVALUE_THRESHOLD && index != self.index_below(solution, -shift)? {
            return Err(CorrectorFailure::Rounding);
        }
        Ok(index)
    }

    /// The number of eigenvalues (squared frequencies) below minus `shift`.
    fn index_below(
        &mut self,
        solution: &ParametrizedState,
        shift: f64,
    ) -> Result<usize, CorrectorFailure> {
        let leaf = self.leaves.leaf_at(solution.params)?;
        let system = &mut self.system;
        self.factorizations += 1;
        system.set_coupling(leaf);
        leaf.assemble(&solution.state, system);
        leaf.add_phase_conditions(&solution.state, system);
        if system.is_definite_without_coupling(shift) {
            return Ok(0);
        }
        leaf.assemble(&solution.state, system);
        leaf.add_phase_conditions(&solution.state, system);
        self.factorizations += 1;
        let pattern = self.pattern(0)?;
        Ok(factorize_matrix(&pattern, &self.system, shift)?.negative_eigenvalue_count())
    }
}

/// A point of a branch found by a step from another, and the step that has led to it.
pub(super) struct SteppedPoint {
    pub point: EquilibriumPoint,
    /// Length of the step along the tangent at its start.
    pub step: f64,
    /// Distance of the point from that along the tangent.
    pub drift: f64,
}

/// The tangent of a branch at a point before, and how long ago that was.
#[derive(Clone, Copy)]
pub(super) struct TangentBefore<'a> {
    pub tangent: &'a BranchDirection,
    /// Length of the step from there.
    pub step: f64,
}

impl TangentBefore<'_> {
    /// Whether it is on the grid of a point.
    pub fn is_on_grid_of(&self, point: &EquilibriumPoint) -> bool {
        self.tangent.increments[0].len() == point.tangent.increments[0].len()
    }
}

impl BranchDirection {
    /// The direction of the chord of this `step` along a branch with this tangent, which turned from that
    /// `before` to it.
    fn bent(&self, before: TangentBefore, step: f64) -> BranchDirection {
        let part = 0.5 * step / before.step;
        let increments = scaled_sum(
            &scale_field(&self.increments, 1.0 + part),
            -part,
            &before.tangent.increments,
        );
        let [now, then] = [self.params[0], before.tangent.params[0]];
        BranchDirection {
            increments,
            params: [now + part * (now - then)],
        }
    }
}

impl SteppedPoint {
    /// Makes a step of this length, or a shorter one to the end of the range: beyond the end there
    /// may be no leaf. It is predicted by the tangent and that of the point `before`.
    pub fn step_from(
        equations: &mut BranchEquations,
        now: &EquilibriumPoint,
        before: Option<TangentBefore>,
        step: f64,
    ) -> Result<Self, CorrectorFailure> {
        match step_along_branch(equations, now, before, step) {
            Err(CorrectorFailure::OutOfRange(out)) => step_to_range_end(equations, now, step, out),
            found => found,
        }
    }

    /// If a step of this length leaves the range, shortens it to the end of the range;
    /// returns that end.
    pub fn stop_at_range_end(
        &mut self,
        equations: &mut BranchEquations,
        now: &EquilibriumPoint,
        step: f64,
    ) -> Result<Option<f64>, CorrectorFailure> {
        let edge = match self.point.fraction {
            1.0 if now.fraction < 1.0 => return Ok(Some(1.0)),
            0.0 if now.fraction > 0.0 => return Ok(Some(0.0)),
            fraction if fraction > 1.0 => 1.0,
            fraction if fraction < 0.0 => 0.0,
            _ => return Ok(None),
        };
        let part = (edge - now.fraction) / (self.point.fraction - now.fraction);
        let at_end = correct_at_range_end(equations, now, edge, part * step)?;
        (self.point, self.step) = (at_end.point, at_end.step);
        Ok(Some(edge))
    }
}

/// A step of this length along the branch, corrected in the plane normal to its tangent.
fn step_along_branch(
    equations: &mut BranchEquations,
    now: &EquilibriumPoint,
    before: Option<TangentBefore>,
    step: f64,
) -> Result<SteppedPoint, CorrectorFailure> {
    let bent = before.map(|before| now.tangent.bent(before, step));
    let along = bent.as_ref().unwrap_or(&now.tangent);
    let near = equations.displace_along_direction(&now.solution(), along, step)?;
    let [fraction] = near.params;
    let point = equations.correct(&near.state, fraction, Some(&now.tangent))?;
    // How far a branch turns in a step is told by its tangent.
    let straight = match bent {
        Some(_) => equations.displace_along_direction(&now.solution(), &now.tangent, step)?,
        None => near,
    };
    let drift = larger(
        straight.state.largest_displacement_to(&point.state),
        (point.fraction - straight.params[0]).abs(),
    );
    Ok(SteppedPoint { point, step, drift })
}

/// A step to the end of the range, if one of this length would leave it.
fn step_to_range_end(
    equations: &mut BranchEquations,
    now: &EquilibriumPoint,
    step: f64,
    out: OutOfRange,
) -> Result<SteppedPoint, CorrectorFailure> {
    let edge = if now.tangent.params[0] > 0.0 {
        1.0
    } else {
        0.0
    };
    let length = (edge - now.fraction) / now.tangent.params[0];
    if length <= 0.0 || length > step {
        return Err(out.into());
    }
    let found = correct_at_range_end(equations, now, edge, length)?;
    let part = length / step;
    Ok(SteppedPoint {
        drift: found.drift / part,
        ..found
    })
}

/// The point at an end of the range, predicted `length` along the tangent.
fn correct_at_range_end(
    equations: &mut BranchEquations,
    now: &EquilibriumPoint,
    edge: f64,
    length: f64,
) -> Result<SteppedPoint, CorrectorFailure> {
    let state =
        equations.state_after_increments(&now.state, [edge], &now.tangent.increments, length)?;
    let mut point = equations.correct(&state, edge, None)?;
    point.tangent = equations.orient_direction(point.tangent, &now.tangent);
    Ok(SteppedPoint {
        drift: state.largest_displacement_to(&point.state),
        point,
        step: length,
    })
}
