//! Equilibria of leaves that differ in two parameters, a manifold, on one grid.

use super::plane::Plane;
use crate::branch::deflation::{STIFF, Solved};
use crate::branch::equations::{Equations, ITERATIONS, Stuck, assembled, at_rest};
use crate::branch::family::{Leaves, OutOfRange};
use crate::branch::field::{add, between, dot, plus, times};
use crate::branch::states::{advanced, forces_on, rate};
use crate::leaf::{DiscreteLeaf, Field, Grid, State, System};

/// Increment along a mode of mass one over which the matrix is differenced.
const ALONG_MODE: f64 = 1e-5;

/// An equilibrium or an approximation to one, with its parameters.
#[derive(Clone, Debug)]
pub struct Solution {
    pub state: State,
    /// Both parameters, as fractions of their ranges.
    pub params: [f64; 2],
}

/// A direction on the solution manifold.
#[derive(Clone, Debug)]
pub struct Direction {
    pub increments: Field,
    pub params: [f64; 2],
}

impl Direction {
    /// The linear combination of two directions.
    pub fn mixed(parts: [f64; 2], [a, b]: &[Direction; 2]) -> Direction {
        let scaled = times(&a.increments, parts[0]);
        Direction {
            increments: plus(&scaled, parts[1], &b.increments),
            params: [0, 1].map(|i| parts[0] * a.params[i] + parts[1] * b.params[i]),
        }
    }

    /// Parameters `step` further along it than these.
    fn further(&self, params: [f64; 2], step: f64) -> [f64; 2] {
        [0, 1].map(|i| params[i] + step * self.params[i])
    }

    pub fn reversed(&self) -> Direction {
        Direction {
            increments: times(&self.increments, -1.0),
            params: self.params.map(|part| -part),
        }
    }
}

/// Solutions of the bordered equations at a state and parameters.
pub struct Sample {
    pub solution: Solution,
    pub solved: Solved,
    /// Derivatives of the forces with respect to both parameters.
    pub rates: Vec<Field>,
}

/// The equations of a plane of leaves on a grid.
pub struct Manifold<'a> {
    pub plane: Plane<'a>,
    pub equations: Equations<'a>,
    leaves: Leaves<Plane<'a>>,
    /// The softened ones whose matrices determine what is singular, if any.
    softened: Option<Leaves<Plane<'a>>>,
}

impl<'a> Manifold<'a> {
    /// Allocates the equations of a plane on `grid`.
    pub fn new(plane: Plane<'a>, grid: Grid) -> Result<Self, OutOfRange> {
        let equations = Equations::new(plane.family, grid)?;
        Manifold::of(plane, equations)
    }

    fn of(plane: Plane<'a>, mut equations: Equations<'a>) -> Result<Self, OutOfRange> {
        let mut leaves = Leaves::new(plane, equations.grid().clone());
        // Veins may be coupled at one end of the second range only.
        for end in [0.0, 1.0] {
            let leaf = leaves.at([0.0, end])?;
            if leaf.coupled() && !equations.leaves.at(0.0)?.coupled() {
                equations.system = System::new(leaf);
            }
        }
        Ok(Manifold {
            plane,
            equations,
            leaves,
            softened: None,
        })
    }

    /// The same on the grid with all segments halved.
    pub fn refined(&self) -> Result<Self, OutOfRange> {
        Manifold::of(self.plane, self.equations.refined()?)
    }

    /// Lets the matrices of leaves with this additional compliance determine what is singular:
    /// see [`Leaves::softened`].
    pub fn soften(&mut self, softening: f64) {
        let leaves = Leaves::softened(self.plane, self.grid().clone(), softening);
        self.softened = Some(leaves);
    }

    pub fn grid(&self) -> &Grid {
        self.equations.grid()
    }

    /// The leaf at fractions of both ranges.
    pub fn leaf(&mut self, params: [f64; 2]) -> Result<&DiscreteLeaf, OutOfRange> {
        self.leaves.at(params)
    }

    pub fn inner(&self, a: &Direction, b: &Direction) -> f64 {
        let numbers = a.params[0] * b.params[0] + a.params[1] * b.params[1];
        self.equations.product(&a.increments, &b.increments) + numbers
    }

    /// Scales a direction to length one.
    pub fn normalised(&self, direction: Direction) -> Direction {
        let length = self.inner(&direction, &direction).sqrt();
        Direction {
            increments: times(&direction.increments, 1.0 / length),
            params: direction.params.map(|part| part / length),
        }
    }

    /// The direction in which one parameter changes and nothing else.
    pub fn unit_parameter(&self, which: usize) -> Direction {
        let segments = self.grid().segments();
        let mut params = [0.0; 2];
        params[which] = 1.0;
        Direction {
            increments: vec![vec![[0.0; 6]; segments]; self.equations.rods()],
            params,
        }
    }

    pub fn difference(&self, a: &Solution, b: &Solution) -> Direction {
        Direction {
            increments: between(&a.state, &b.state),
            params: [0, 1].map(|i| b.params[i] - a.params[i]),
        }
    }

    /// State and parameters `step` further along a direction.
    pub fn moved(
        &mut self,
        solution: &Solution,
        to: &Direction,
        step: f64,
    ) -> Result<Solution, OutOfRange> {
        let params = to.further(solution.params, step);
        let state = self.advanced(&solution.state, params, &to.increments, step)?;
        Ok(Solution { state, params })
    }

    /// The same from an equilibrium: parameters change first, since the forces in the segments
    /// depend on all of their change, however short the step.
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

    /// A state after `step` times these increments, for the leaf at these parameters.
    pub fn advanced(
        &mut self,
        state: &State,
        params: [f64; 2],
        increments: &Field,
        step: f64,
    ) -> Result<State, OutOfRange> {
        let (leaf, system) = (self.leaves.at(params)?, &mut self.equations.system);
        Ok(advanced(leaf, state, system, increments, step))
    }

    /// Solves the bordered equations at a state, in equilibrium or not, given the rates of both
    /// parameters; also returns the rounding error of the forces.
    pub fn sample(
        &mut self,
        mut solution: Solution,
        border: &[Field],
        rates: Vec<Field>,
        soft: bool,
    ) -> Result<(Sample, f64), Stuck> {
        let (forces, noise) = self.assemble(&mut solution, soft)?;
        let each: Vec<&Field> = rates.iter().collect();
        let solved = self.equations.solve_bordered(border, &forces, &each, 0.0)?;
        let sample = Sample {
            solution,
            solved,
            rates,
        };
        Ok((sample, noise))
    }

    /// Returns the forces and their rounding error; the matrix (the softened one, if `soft` and
    /// there is one) is left in the system.
    fn assemble(&mut self, solution: &mut Solution, soft: bool) -> Result<(Field, f64), Stuck> {
        let leaves = match &mut self.softened {
            Some(softened) if soft => softened,
            _ => &mut self.leaves,
        };
        let leaf = leaves.at(solution.params)?;
        assembled(leaf, &mut self.equations.system, &mut solution.state)
    }

    /// The product of the matrix and a mode.
    fn product(&mut self, mut solution: Solution, mode: &Field) -> Result<Field, Stuck> {
        self.assemble(&mut solution, true)?;
        let pattern = self.equations.pattern(0)?;
        Ok(pattern.product(&self.equations.system, mode))
    }

    /// The mean second derivative of the energy along modes.
    pub fn curvature(&mut self, mut solution: Solution, modes: &[Field]) -> Result<f64, Stuck> {
        self.assemble(&mut solution, true)?;
        let pattern = self.equations.pattern(0)?;
        let along = |mode: &Field| dot(&pattern.product(&self.equations.system, mode), mode);
        Ok(modes.iter().map(along).sum::<f64>() / modes.len() as f64)
    }

    /// Derivatives of the forces with respect to both parameters.
    pub fn rates(&mut self, solution: &Solution) -> Result<Vec<Field>, Stuck> {
        let mut rates = Vec::new();
        for which in [0, 1] {
            rates.push(rate(|step| {
                let mut params = solution.params;
                params[which] += step;
                self.forces(&solution.state, params)
            })?);
        }
        Ok(rates)
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
            add(&mut change, -0.5 / step, &self.product(moved, mode)?);
        }
        let mut numbers = [0.0; 2];
        for (which, number) in numbers.iter_mut().enumerate() {
            let alone = self.unit_parameter(which);
            let changed = rate(|step| {
                let beside = self.beside(solution, &alone, step)?;
                self.product(beside, mode)
            })?;
            *number = -dot(&changed, mode);
        }
        // Last, so that the system holds the increments of this state again.
        self.forces(&solution.state, solution.params)?;
        Ok((change, numbers))
    }

    /// A solution with the segment forces computed from its strains.
    pub fn with_segment_forces(&mut self, solution: &Solution) -> Result<Solution, OutOfRange> {
        self.forces(&solution.state, solution.params)?;
        let none = Direction {
            params: [0.0; 2],
            ..self.unit_parameter(0)
        };
        self.moved(solution, &none, 1.0)
    }

    /// The unbalanced forces; the system is left with the segments of this state.
    fn forces(&mut self, state: &State, params: [f64; 2]) -> Result<Field, OutOfRange> {
        let (leaf, system) = (self.leaves.at(params)?, &mut self.equations.system);
        Ok(forces_on(leaf, state, system))
    }

    /// Newton's method to the manifold within the plane normal to two directions through a
    /// state. The matrix may be singular: it is bordered by `border`, and components that remain
    /// undetermined are left unchanged. The rates may be those of a nearby state: they only affect
    /// the rate of convergence, and leaves at other parameters cost more than an iteration.
    pub fn correct(
        &mut self,
        solution: &Solution,
        normals: [&Direction; 2],
        border: &[Field],
        rates: &[Field],
    ) -> Result<Sample, Stuck> {
        let duals = normals.map(|normal| self.equations.momentum(&normal.increments));
        let normals = [0, 1].map(|k| (&duals[k], normals[k].params.as_slice(), 0.0));
        let mut solution = solution.clone();
        let mut previous = f64::INFINITY;
        let mut finished = false;
        // As for a branch: a converged leaf with stiff segments is corrected once more.
        let mut corrected = self.leaf(solution.params)?.stiffest() * STIFF > 1.0;
        for _ in 0..=ITERATIONS + 1 {
            let (sample, noise) = self.sample(solution, border, rates.to_vec(), finished)?;
            if finished {
                return Ok(sample);
            }
            let (increments, changes, size) = sample.solved.step(&normals, noise)?;
            let params = [0, 1].map(|i| sample.solution.params[i] + changes[i]);
            let state = self.advanced(&sample.solution.state, params, &increments, 1.0)?;
            solution = Solution { state, params };
            let rests = at_rest(size, previous);
            finished = rests && corrected;
            corrected |= rests;
            previous = size;
        }
        Err(Stuck::NotConverged)
    }
}
