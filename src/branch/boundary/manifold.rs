//! Equilibria of leaves that differ in two parameters, a manifold, on one grid.

use crate::branch;
use crate::branch::problem::bordered;
use crate::branch::problem::equations::{Equations, Stuck};
use crate::branch::problem::family::{Family, OutOfRange};
use crate::branch::problem::field::{add, between, dot, plus, times};
use crate::branch::problem::states::{forces_on, rate};
use crate::leaf::Field;

/// Increment along a mode of mass one over which the matrix is differenced.
const ALONG_MODE: f64 = 1e-5;

/// Leaves that differ in two parameters, their equations, and what solves these.
pub type Plane<'a> = Family<'a, 2>;
pub type Manifold<'a> = Equations<'a, 2>;
pub type Solution = branch::Solution<2>;
pub type Direction = branch::Direction<2>;
pub type Sample = bordered::Sample<2>;

impl Direction {
    /// The linear combination of two directions.
    pub fn mixed(parts: [f64; 2], [a, b]: &[Direction; 2]) -> Direction {
        let scaled = times(&a.increments, parts[0]);
        Direction {
            increments: plus(&scaled, parts[1], &b.increments),
            params: [0, 1].map(|i| parts[0] * a.params[i] + parts[1] * b.params[i]),
        }
    }
}

impl Manifold<'_> {
    /// The direction in which one parameter changes and nothing else.
    pub fn unit_parameter(&self, which: usize) -> Direction {
        let nodes = self.system.nodes();
        let mut params = [0.0; 2];
        params[which] = 1.0;
        Direction {
            increments: vec![vec![[0.0; 6]; nodes]; self.rods()],
            params,
        }
    }

    /// What leads from one solution to another.
    pub fn difference(&self, a: &Solution, b: &Solution) -> Direction {
        Direction {
            increments: between(&a.state, &b.state, self.first_node()),
            params: [0, 1].map(|i| b.params[i] - a.params[i]),
        }
    }

    /// State and parameters `step` further along a direction from an equilibrium: parameters
    /// change first, since the forces in the segments depend on all of their change, however short
    /// the step.
    pub fn beside(
        &mut self,
        solution: &Solution,
        to: &Direction,
        step: f64,
    ) -> Result<Solution, OutOfRange> {
        let (params, none) = (solution.params, self.unit_parameter(0).increments);
        let state = self.advanced(&solution.state, to.further(params, step), &none, 1.0)?;
        self.moved(&Solution { state, params }, to, step)
    }

    /// The product of the matrix and a mode.
    fn stiffness_times(&mut self, mut solution: Solution, mode: &Field) -> Result<Field, Stuck> {
        self.assemble(&mut solution, true)?;
        Ok(self.pattern(0)?.product(&self.system, mode))
    }

    /// The mean second derivative of the energy along modes.
    pub fn curvature(&mut self, mut solution: Solution, modes: &[Field]) -> Result<f64, Stuck> {
        self.assemble(&mut solution, true)?;
        let pattern = self.pattern(0)?;
        let along = |mode: &Field| dot(&pattern.product(&self.system, mode), mode);
        Ok(modes.iter().map(along).sum::<f64>() / modes.len() as f64)
    }

    /// Derivatives of the curvature of the energy along a mode, with the sign of H, with respect to
    /// all increments and both parameters. Where the mode is neutral, third derivatives of the
    /// energy are symmetric.
    pub fn curvature_change(
        &mut self,
        solution: &Solution,
        mode: &Field,
    ) -> Result<(Field, [f64; 2]), Stuck> {
        let way = Direction {
            increments: mode.clone(),
            params: [0.0; 2],
        };
        let mut change = times(mode, 0.0);
        for step in [ALONG_MODE, -ALONG_MODE] {
            let moved = self.moved(solution, &way, step)?;
            add(
                &mut change,
                -0.5 / step,
                &self.stiffness_times(moved, mode)?,
            );
        }
        let mut numbers = [0.0; 2];
        for (which, number) in numbers.iter_mut().enumerate() {
            let alone = self.unit_parameter(which);
            let changed = rate(|step| {
                let beside = self.beside(solution, &alone, step)?;
                self.stiffness_times(beside, mode)
            })?;
            *number = -dot(&changed, mode);
        }
        // Last, so that the system holds the increments of this state again.
        self.forces(solution)?;
        Ok((change, numbers))
    }

    /// A solution with the segment forces computed from its strains.
    pub fn with_segment_forces(&mut self, solution: &Solution) -> Result<Solution, OutOfRange> {
        self.forces(solution)?;
        let none = Direction {
            params: [0.0; 2],
            ..self.unit_parameter(0)
        };
        self.moved(solution, &none, 1.0)
    }

    /// The unbalanced forces; the system is left with the segments of this state.
    fn forces(&mut self, solution: &Solution) -> Result<Field, OutOfRange> {
        let leaf = self.leaves.at(solution.params)?;
        Ok(forces_on(leaf, &solution.state, &mut self.system))
    }
}
