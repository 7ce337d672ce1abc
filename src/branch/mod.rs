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

pub mod boundary;
mod events;
mod problem;
mod verify;
mod walk;

pub use crate::branch::events::critical::{Critical, Kind};
pub use crate::branch::problem::equations::{Equations, Stuck};
pub use crate::branch::problem::family::{Family, Range, between as value_between};
pub(crate) use crate::branch::problem::field::{between, prolong_field, times};
pub(crate) use crate::branch::verify::critical::NEARLY_RIGID;
pub use crate::branch::verify::refined::{Doubt, Refined};
pub(crate) use crate::branch::verify::regular::{on_finer, refine_at};
pub use crate::branch::walk::begin::{begin, switch};
pub use crate::branch::walk::follow::{Followed, Grids};
pub use crate::branch::walk::steps::{End, Walk, walk};

use crate::leaf::{Field, State};

/// A point of a branch on one grid.
#[derive(Clone, Debug)]
pub struct Point {
    /// The state of the leaf.
    pub state: State,
    /// The parameter, as a fraction of its range.
    pub fraction: f64,
    /// The unit tangent of the branch.
    pub tangent: Direction,
    /// Morse index.
    pub index: usize,
    /// Newton iterations by which it was found.
    pub iterations: usize,
}

impl Point {
    /// Its state and parameter.
    fn solution(&self) -> Solution {
        Solution {
            state: self.state.clone(),
            params: [self.fraction],
        }
    }
}

/// A leaf in equilibrium, or nearly so, with its parameters as fractions of their ranges.
#[derive(Clone, Debug)]
pub struct Solution<const N: usize = 1> {
    /// The state of the leaf.
    pub state: State,
    /// The parameters.
    pub params: [f64; N],
}

/// A direction along which the state and the parameters change.
#[derive(Clone, Debug)]
pub struct Direction<const N: usize = 1> {
    /// Increments of the nodes.
    pub increments: Field,
    /// Changes of the parameters, as fractions of their ranges.
    pub params: [f64; N],
}

impl<const N: usize> Direction<N> {
    /// The opposite direction.
    pub fn reversed(&self) -> Self {
        Direction {
            increments: times(&self.increments, -1.0),
            params: self.params.map(|part| -part),
        }
    }

    /// Parameters `step` further along it than these.
    fn further(&self, params: [f64; N], step: f64) -> [f64; N] {
        std::array::from_fn(|i| params[i] + step * self.params[i])
    }
}
