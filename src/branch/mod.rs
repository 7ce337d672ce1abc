//! A branch: an equilibrium followed through a parameter, through folds, with
//! its Morse index and the points at which this changes.
//!
//! With the unbalanced forces g(z, l) of a leaf in the state z at the parameter
//! l, a branch is a curve g = 0. It is followed by pseudo-arclength continuation (Keller, in:
//! Applications of Bifurcation Theory, 1977): from a point with tangent t a step
//! is predicted along t, and Newton's method corrects it within the
//! plane normal to t. Matrices are those of the relaxation.
//!
//! Where the index changes, the matrix K is singular. There it is bordered by
//! P, the mass matrix times the modes that become neutral,
//!
//! ```text
//! [ K   P ] [ X ]   [ 0 ]
//! [ P^T 0 ] [ H ] = [ 1 ]
//! ```
//!
//! which is regular (Govaerts, Numerical Methods for Bifurcations of Dynamical
//! Equilibria, 2000). An eigenvalue of H vanishes where one of K does, and is smooth,
//! so that a secant method finds its zero to rounding.
//!
//! All this holds on one grid. A point counts as verified once finer grids have it too: on
//! the same branch, with the same orientation and index, its tips known to the
//! accuracy asked for. Otherwise the branch is continued on a finer grid
//! from the last verified point.
//!
//! Linear algebra on fields of nodal increments and forces.
//!
//! Why a branch ends, or does not begin.
//!
//! The equations of branches: leaves that differ in parameters, linearised and solved.
//!
//! Along a branch on one grid: where it begins, its steps, and Newton's method back to it.
//!
//! Points of a branch on finer and finer grids, which verify them.
//!
//! Folds, branch points, and the vertices of pitchforks on one grid.

pub(crate) mod boundary;
mod continuation;
mod convergence;
mod correct;
mod critical;
mod equations;
mod family;
mod refine;
mod saddle_search;
mod verified_branch;

pub use crate::branch::continuation::{BranchEnd, ContinuationOptions, follow_branch};
pub use crate::branch::convergence::{ExtrapolatedPoint, VerificationFailure};
pub use crate::branch::critical::{CriticalKind, CriticalPoint};
pub use crate::branch::equations::BranchEquations;
use crate::branch::family::OutOfRange;
pub use crate::branch::family::{LeafFamily, ParameterRange, value_at_fraction};
pub(crate) use crate::branch::refine::{NEARLY_RIGID, on_finer, verify_at_parameter};
pub use crate::branch::verified_branch::{
    NestedBranchEquations, VerifiedBranch, begin_branch, switch_branches,
};
use crate::leaf::{DirectError, Increment, NodalField, State};
use crate::relax::Stencil;

/// A point of a branch on one grid.
#[derive(Clone, Debug)]
pub struct EquilibriumPoint {
    /// The state of the leaf.
    pub state: State,
    /// The parameter, as a fraction of its range.
    pub fraction: f64,
    /// The unit tangent of the branch.
    pub tangent: BranchDirection,
    /// Morse index.
    pub index: usize,
    /// Newton iterations by which it was found.
    pub iterations: usize,
}

impl EquilibriumPoint {
    /// Its state and parameter.
    fn solution(&self) -> ParametrizedState {
        ParametrizedState {
            state: self.state.clone(),
            params: [self.fraction],
        }
    }
}

/// A leaf in equilibrium, or nearly so, with its parameters as fractions of their ranges.
#[derive(Clone, Debug)]
pub struct ParametrizedState<const N: usize = 1> {
    /// The state of the leaf.
    pub state: State,
    /// The parameters.
    pub params: [f64; N],
}

/// A direction along which the state and the parameters change.
#[derive(Clone, Debug)]
pub struct BranchDirection<const N: usize = 1> {
    /// Increments of the nodes.
    pub increments: NodalField,
    /// Changes of the parameters, as fractions of their ranges.
    pub params: [f64; N],
}

impl<const N: usize> BranchDirection<N> {
    /// The opposite direction.
    pub fn reversed(&self) -> Self {
        BranchDirection {
            increments: scale_field(&self.increments, -1.0),
            params: self.params.map(|part| -part),
        }
    }

    /// Parameters `step` further along it than these.
    fn parameters_after_step(&self, params: [f64; N], step: f64) -> [f64; N] {
        std::array::from_fn(|i| params[i] + step * self.params[i])
    }
}

/// The work of forces on increments.
pub fn dot(forces: &NodalField, increments: &NodalField) -> f64 {
    let mut sum = 0.0;
    for (f, d) in forces.iter().flatten().zip(increments.iter().flatten()) {
        sum += (0..6).map(|c| f[c] * d[c]).sum::<f64>();
    }
    sum
}

/// a + factor b.
pub fn scaled_sum(a: &NodalField, factor: f64, b: &NodalField) -> NodalField {
    let mut sum = a.clone();
    add_scaled(&mut sum, factor, b);
    sum
}

/// a <- a + factor b.
pub fn add_scaled(a: &mut NodalField, factor: f64, b: &NodalField) {
    for (a, b) in a.iter_mut().flatten().zip(b.iter().flatten()) {
        for c in 0..6 {
            a[c] += factor * b[c];
        }
    }
}

/// a times a factor.
pub fn scale_field(a: &NodalField, factor: f64) -> NodalField {
    let of = |a: &Increment| a.map(|a| factor * a);
    a.iter().map(|rod| rod.iter().map(of).collect()).collect()
}

/// The linear combination of fields with these coefficients.
pub fn combine_fields(parts: &[f64], fields: &[NodalField]) -> NodalField {
    let mut sum = scale_field(&fields[0], 0.0);
    for (part, field) in parts.iter().zip(fields) {
        add_scaled(&mut sum, *part, field);
    }
    sum
}

pub fn largest(a: &NodalField) -> f64 {
    crate::numbers::largest(a.iter().flatten().flatten().map(|v| v.abs()))
}

/// The increments of the nodes from the `first` on that lead from one state to another on the same
/// grid.
pub fn increments_between(a: &State, b: &State, first: usize) -> NodalField {
    let mut field = NodalField::new();
    a.increments_to(b, first, &mut field);
    field
}

pub fn is_finite(a: &NodalField) -> bool {
    a.iter().flatten().flatten().all(|v| v.is_finite())
}

/// Increments on the grid with all segments halved: cubic interpolation, zero at clamped bases, where
/// the `first` node of the field is the next.
pub fn prolong_field(a: &NodalField, first: usize) -> NodalField {
    a.iter().map(|rod| prolong_rod(rod, first)).collect()
}

/// Nodal forces on the grid with all segments halved: the given ones at the nodes of this grid,
/// zero at the new ones.
pub fn inject_forces(a: &NodalField, first: usize) -> NodalField {
    // A new node precedes every one but a base.
    let all = |rod: &Vec<Increment>| rod.iter().flat_map(|f| [[0.0; 6], *f]).collect::<Vec<_>>();
    let rod = |rod: &Vec<Increment>| all(rod).split_off(1 - first);
    a.iter().map(rod).collect()
}

/// Increments on the grid with every second node.
pub fn restrict_field(a: &NodalField, first: usize) -> NodalField {
    let rod = |rod: &Vec<Increment>| rod.iter().skip(first).step_by(2).copied().collect();
    a.iter().map(rod).collect()
}

fn prolong_rod(rod: &[Increment], first: usize) -> Vec<Increment> {
    let n = rod.len() + first - 1;
    let at = |i: usize| match i < first {
        true => [0.0; 6],
        false => rod[i - first],
    };
    let node = |k: usize| {
        if k.is_multiple_of(2) {
            return at(k / 2);
        }
        // Four neighbouring nodes; at the ends, the nearest four.
        let mut sum = [0.0; 6];
        for (i, weight) in Stencil::<4>::new(0, n + 1, k as f64 / 2.0).terms() {
            let value = at(i);
            for c in 0..6 {
                sum[c] += weight * value[c];
            }
        }
        sum
    };
    (first..=2 * n).map(node).collect()
}

/// Why no point is found.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubics_are_prolonged_exactly() {
        let f = |s: f64| [s, s * s, s * s * s, 2.0 * s - s * s, 0.0, -s];
        for (n, first) in [(3, 1), (4, 1), (7, 1), (3, 0), (4, 0)] {
            let on = |n: usize| {
                vec![
                    (first..=n)
                        .map(|i| f(i as f64 / n as f64))
                        .collect::<Vec<_>>(),
                ]
            };
            let (coarse, fine) = (on(n), on(2 * n));
            let difference = scaled_sum(&prolong_field(&coarse, first), -1.0, &fine);
            assert!(largest(&difference) < 1e-14, "{n}");
            assert_eq!(restrict_field(&fine, first), coarse);
            assert_eq!(
                restrict_field(&inject_forces(&coarse, first), first),
                coarse
            );
        }
    }
}
