//! The linearised motion about an equilibrium under forces that need no potential:
//! M q'' + C q' + (K - W) q = 0 with the derivatives W of the forces without a potential along
//! displacements and the damping C, their derivatives along velocities included. Dimensionless; times in
//! units of sqrt(rho L^4/A).
//!
//! A solution exp(lambda t) with a root lambda of positive real part grows: by flutter if the root is
//! complex, by divergence if it is real. Roots next to zero are found by the Arnoldi method with the inverse
//! of K - W. Where damping is proportional to the masses, C = a M, the eigenvalues nu of (K - W)^-1 M tell
//! them, lambda^2 + a lambda + 1/nu = 0: without damping what does not grow has exactly no growth. Otherwise
//! the state (q, lambda q) has the eigenvalues 1/lambda of
//!
//! (q, p) -> (-(K - W)^-1 (C q + M p), q).
//!
//! Unknowns without mass and damping have the eigenvalue zero of both: they follow statically.
//!
//! The inverse is that of the factorized K, corrected for W by the minimal residual method, as in Newton's
//! method. Several starts at once find roots of several modes; the search ends when the residuals of all
//! roots that are wanted are small. A motion that grows may be farther from zero than any number of others: of a
//! leaf of few unknowns all roots are those of a dense matrix.

use crate::krylov::{KrylovLimits, solve_minimal_residual};
use crate::leaf::{DirectSolver, DiscreteLeaf, MatrixFactors, NodalField, State, System};
use crate::modes::MassMatrix;
use crate::modes::arnoldi::{RitzPairs, RitzValue, dense_eigenvalues, largest_eigenvalues};
use crate::modes::node_blocks::NodeBlocks;
use crate::motion::Physics;
use crate::newton::FollowerForces;
use crate::run::Limit;
use faer::linalg::solvers::Solve;
use faer::{Mat, c64};
use glam::{DMat3, DQuat};

/// Number of starts of the search for roots: so many equal ones are found.
const STARTS: usize = 3;

/// Limits of the inverse with forces without a potential.
const INVERSE_LIMITS: KrylovLimits = KrylovLimits {
    accuracy: 1e-12,
    most: 200,
    singular_value_limit: 0.0,
    stagnation: None,
};

/// Largest residual of the inverse, which rounding may leave above its accuracy.
const LARGEST_INVERSE_RESIDUAL: f64 = 1e-8;

/// Accuracy to which roots are computed on a grid, as a part of them. Of random leaves with damping it was 1e-7 where two
/// roots nearly meet: growth below it is not told from none.
pub const ROOT_ACCURACY: f64 = 2e-7;

/// Largest number of states of which all roots are computed: about a second.
pub const MOST_DENSE_STATES: usize = 600;

/// Size of an eigenvalue of a dense matrix, as a part of the largest, from which on rounding may add an imaginary
/// part that looks like growth.
const DENSE_ROUNDING: f64 = 1e-6;

/// Stiffness of springs on all unknowns, in A/L^2, that hold a leaf that can turn without resistance, of which all
/// roots are computed: with the least ones the others would be lost beside the one that is nearly zero.
const DENSE_NEUTRAL_SHIFT: f64 = 1e-3;

/// Rotation and displacement of a node in a small motion: complex, as nodes need not move in phase.
pub type ComplexIncrement = [c64; 6];

/// A root of the linearised motion, or a pair of conjugate ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionRoot {
    /// Real part: rate of growth.
    pub growth: f64,
    /// Imaginary part, not negative: angular frequency.
    pub frequency: f64,
}

/// The roots of a linearised motion.
pub enum MotionRoots {
    /// Without damping: the squares lambda^2, conjugate ones both, the nearest to zero first. They are
    /// analytic functions of the leaf where two meet and become complex, in their mean and the square of
    /// their difference.
    Squares(Vec<Square>),
    /// With damping: one root of each conjugate pair, the nearest to zero first.
    Damped(Vec<MotionRoot>),
}

/// The square of a root, and how close its mode is to that of the next in a list.
#[derive(Clone, Copy, Debug)]
pub struct Square {
    pub value: c64,
    /// Cosine of the angle between both modes: one where two meet and become complex, but not where
    /// independent ones are equal.
    pub alignment: f64,
}

impl MotionRoot {
    /// The root of positive real part, or of positive imaginary part, of a square.
    pub fn from_square(square: c64) -> Self {
        // Without rounding in the part that is zero.
        let root = match square.im == 0.0 {
            true if square.re < 0.0 => c64::new(0.0, (-square.re).sqrt()),
            true => c64::new(square.re.sqrt(), 0.0),
            false => square.sqrt(),
        };
        MotionRoot::new(root)
    }

    pub(super) fn new(root: c64) -> Self {
        MotionRoot {
            growth: root.re,
            frequency: root.im.abs(),
        }
    }

    /// The distance from zero.
    pub fn size(self) -> f64 {
        self.growth.hypot(self.frequency)
    }

    /// The distance from another root.
    pub fn distance(self, other: MotionRoot) -> f64 {
        (self.growth - other.growth).hypot(self.frequency - other.frequency)
    }
}

impl MotionRoots {
    /// The roots themselves; of conjugate squares both.
    pub fn into_roots(self) -> Vec<MotionRoot> {
        match self {
            MotionRoots::Squares(squares) => {
                let roots = squares.iter().map(|it| MotionRoot::from_square(it.value));
                roots.collect()
            }
            MotionRoots::Damped(roots) => roots,
        }
    }
}

/// The linearised motion of a leaf about a state of rest.
pub(super) struct LinearizedMotion<'a> {
    leaf: &'a DiscreteLeaf,
    state: &'a State,
    forces: &'a dyn FollowerForces,
    physics: &'a Physics,
    pub(super) solver: DirectSolver,
    system: System,
    /// The equations with rods twice as stiff under the same stresses, if the material is damped: the
    /// difference is their material stiffness.
    stiffened: Option<System>,
    /// Springs on all unknowns of a leaf that can turn without resistance, in multiples of the system's masses.
    neutral: f64,
    masses: MassMatrix,
    /// What has no potential as blocks, where the equations are the transposed ones.
    transposed: Option<TransposedForces>,
}

/// A vector times the matrix polynomial of a motion, and times its derivative by lambda.
pub(super) struct PolynomialProduct {
    pub value: Vec<c64>,
    pub slope: Vec<c64>,
}

/// The derivatives of the forces without a potential, whose transposes act.
struct TransposedForces {
    by_displacement: NodeBlocks,
    /// In wind.
    by_velocity: Option<NodeBlocks>,
}

/// The roots of the linearised motion next to zero, at least `count` of them if there are so many. `None` if memory is short, the time limit is exceeded, or they do
/// not converge.
pub fn lowest_roots(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    forces: &dyn FollowerForces,
    count: usize,
    time: &Limit,
) -> Option<MotionRoots> {
    let shift = leaf.neutral_shift();
    let (motion, mut factors) = LinearizedMotion::new(leaf, physics, state, forces, shift)?;
    Some(match motion.is_damped_beside_masses() {
        false => motion.roots_of_squares(motion.squares(&mut factors, count, time)?),
        true => sorted_damped(motion.roots_of_states(&mut factors, count, time)?),
    })
}

/// All roots of the linearised motion, from a dense matrix: none that grows is missed, but for those whose size
/// is so large that the matrix is rounded there. `None` if the states of what moves are more than
/// [`MOST_DENSE_STATES`], or the matrix is singular.
pub fn all_roots(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    forces: &dyn FollowerForces,
) -> Option<MotionRoots> {
    let shift = DENSE_NEUTRAL_SHIFT.max(leaf.neutral_shift());
    let (motion, mut factors) = LinearizedMotion::new(leaf, physics, state, forces, shift)?;
    let damped = motion.is_damped_beside_masses();
    let moving = motion.moving_unknowns();
    let states = match damped {
        false => moving.len(),
        true => 2 * moving.len(),
    };
    if states > MOST_DENSE_STATES {
        return None;
    }
    let masses = |unit: &[f64]| motion.masses.times(unit);
    let of_masses = motion.dense_inverse(&mut factors, &moving, &masses)?;
    Some(match damped {
        false => {
            let squares = nonzero_eigenvalues(&of_masses)?.into_iter();
            let square = |nu: c64| Square {
                value: -nu.finv(),
                alignment: 0.0,
            };
            motion.roots_of_squares(squares.map(square).collect())
        }
        true => {
            let damping = |unit: &[f64]| motion.damping(unit);
            let of_damping = motion.dense_inverse(&mut factors, &moving, &damping)?;
            let count = moving.len();
            let companion =
                Mat::from_fn(2 * count, 2 * count, |r, c| match (r < count, c < count) {
                    (true, true) => -of_damping[(r, c)],
                    (true, false) => -of_masses[(r, c - count)],
                    (false, _) => f64::from(r == c + count),
                });
            let upper = nonzero_eigenvalues(&companion)?.into_iter();
            let upper = upper.filter(|mu| mu.im >= 0.0);
            sorted_damped(upper.map(|mu| MotionRoot::new(mu.finv())).collect())
        }
    })
}

/// States of the motion of a node: those of unknowns that follow statically do not count.
pub fn states_per_node(leaf: &DiscreteLeaf, physics: &Physics) -> usize {
    let rotates = physics.retardation > 0.0
        || leaf.rod_index_pairs(leaf.moving_nodes()).any(|(j, i)| {
            let inertia = physics.inertia(leaf, j, i);
            inertia.tensor(DQuat::IDENTITY) != DMat3::ZERO
        });
    let unknowns = if rotates { 6 } else { 3 };
    match leaf.leaf.in_moving_air() || physics.retardation > 0.0 {
        true => 2 * unknowns,
        false => unknowns,
    }
}

/// The eigenvalues of a dense matrix that are not zero by rounding, the largest first.
fn nonzero_eigenvalues(matrix: &Mat<f64>) -> Option<Vec<c64>> {
    let mut all = dense_eigenvalues(matrix)?;
    all.sort_by(|a, b| b.norm().total_cmp(&a.norm()));
    let largest = all.first()?.norm();
    all.retain(|value| value.norm() > DENSE_ROUNDING * largest);
    largest.is_finite().then_some(all)
}

fn sorted_damped(mut roots: Vec<MotionRoot>) -> MotionRoots {
    roots.sort_by(|a, b| a.size().total_cmp(&b.size()));
    MotionRoots::Damped(roots)
}

impl DiscreteLeaf {
    /// This leaf with rods twice as stiff, at rest in another shape such that all stresses of a state are
    /// the same.
    fn with_doubled_stiffness(&self, state: &State) -> Self {
        let mut stiff = self.clone();
        let n = self.segments();
        for (j, i) in self.rod_index_pairs(0..n) {
            let k = j * n + i;
            let segment = self.segment(state, j, i, state.n[k]);
            let section = &mut stiff.sections[k];
            section.couple_stiffness *= 2.0;
            section.rest_curvature = segment.u - segment.m / section.couple_stiffness;
            section.compliance *= 0.5;
            section.rest_strain += section.compliance * segment.nu;
            section.condensing *= 2.0;
        }
        stiff
    }
}

impl<'a> LinearizedMotion<'a> {
    /// The linearised motion, and the factors of its stiffness, to which that of springs is added if it can turn
    /// without resistance; `None` if memory is short.
    pub(super) fn new(
        leaf: &'a DiscreteLeaf,
        physics: &'a Physics,
        state: &'a State,
        forces: &'a dyn FollowerForces,
        neutral_shift: f64,
    ) -> Option<(Self, MatrixFactors)> {
        let mut system = System::new(leaf);
        leaf.assemble(state, &mut system);
        let solver = DirectSolver::for_coupling_pattern(&system).ok()?;
        let neutral = match leaf.zero_energy_fields(state).is_empty() {
            true => 0.0,
            false => neutral_shift,
        };
        let factors = solver.factorize(&system, neutral).ok()?;
        let stiffened = (physics.retardation > 0.0).then(|| {
            let mut stiffened = System::new(leaf);
            leaf.with_doubled_stiffness(state)
                .assemble(state, &mut stiffened);
            stiffened
        });
        let motion = LinearizedMotion {
            leaf,
            state,
            forces,
            physics,
            masses: MassMatrix::new(leaf, physics, state, &solver),
            solver,
            system,
            stiffened,
            neutral,
            transposed: None,
        };
        Some((motion, factors))
    }

    /// Turns the matrices into their transposes, which have the same roots.
    pub(super) fn transpose(&mut self) {
        let by_displacement = self.probe(&|field, change| {
            (self.forces).add_derivative(self.state, field, change);
        });
        let windy = self.leaf.leaf.in_wind();
        let by_velocity = windy.then(|| {
            self.probe(&|field, change| {
                (self.forces).add_velocity_derivative(self.state, field, change);
            })
        });
        self.transposed = Some(TransposedForces {
            by_displacement,
            by_velocity,
        });
    }

    /// The motion itself again, after [`LinearizedMotion::transpose`].
    pub(super) fn transpose_back(&mut self) {
        self.transposed = None;
    }

    /// The blocks of a matrix that ties neighbouring nodes of a rod alone.
    fn probe(&self, product: &dyn Fn(&NodalField, &mut NodalField)) -> NodeBlocks {
        NodeBlocks::probe(&self.no_forces(), product)
    }

    /// The roots from their squares, or from lambda^2 + a lambda where masses are damped by a.
    fn roots_of_squares(&self, squares: Vec<Square>) -> MotionRoots {
        if self.physics.damping == 0.0 {
            return MotionRoots::Squares(squares);
        }
        // One of each conjugate pair.
        let squares = squares.iter().map(|it| it.value).filter(|it| it.im >= 0.0);
        let root = |square: c64| MotionRoot::new(self.root_of_square(square));
        sorted_damped(squares.map(root).collect())
    }

    /// The root lambda of lambda^2 + a lambda that grows faster, where masses are damped by a.
    pub(super) fn root_of_square(&self, square: c64) -> c64 {
        let half = 0.5 * self.physics.damping;
        let root = MotionRoot::from_square(square + half * half);
        c64::new(root.growth - half, root.frequency)
    }

    /// The square lambda^2 + a lambda of a root, whose masses are damped by a.
    pub(super) fn square_of_root(&self, root: c64) -> c64 {
        root * (root + self.physics.damping)
    }

    /// The unknowns with mass or damping; the others follow them statically.
    fn moving_unknowns(&self) -> Vec<usize> {
        let size = self.solver.size();
        let damped = self.is_damped_beside_masses();
        let moves = |at: &usize| {
            let unit = self.unit(*at);
            let acts = |image: &[f64]| image.iter().any(|value| *value != 0.0);
            acts(&self.masses.times(&unit)) || damped && acts(&self.damping(&unit))
        };
        (0..size).filter(moves).collect()
    }

    /// (K - W)^-1 times a matrix that is known by its products, for these unknowns: by the factors of K or, where the
    /// iteration for W does not converge for one of the columns, by those of the dense matrix. `None` if that is
    /// singular.
    fn dense_inverse(
        &self,
        factors: &mut MatrixFactors,
        unknowns: &[usize],
        product: &dyn Fn(&[f64]) -> Vec<f64>,
    ) -> Option<Mat<f64>> {
        let columns: Vec<Vec<f64>> = unknowns.iter().map(|at| product(&self.unit(*at))).collect();
        let iterated = columns.iter().map(|it| self.inverse(factors, it));
        let solved = match iterated.collect::<Option<Vec<_>>>() {
            Some(solved) => solved,
            None => self.solve_dense(&columns)?,
        };
        let count = unknowns.len();
        Some(Mat::from_fn(count, count, |r, c| solved[c][unknowns[r]]))
    }

    fn unit(&self, at: usize) -> Vec<f64> {
        let mut unit = vec![0.0; self.solver.size()];
        unit[at] = 1.0;
        unit
    }

    /// K - W times a vector.
    fn stiffness(&self, vector: &[f64]) -> Vec<f64> {
        let stiff = self.vector(&self.solver.product(&self.system, &self.field(vector)));
        let without = self.force_derivative(vector);
        stiff.iter().zip(without).map(|(k, w)| k - w).collect()
    }

    /// (K - W)^-1, with the springs of a leaf that can turn, times these columns, by the factors of the dense matrix;
    /// `None` if it is singular.
    fn solve_dense(&self, columns: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
        let size = self.solver.size();
        let of_unit = |at: usize| {
            let unit = self.unit(at);
            let springs = self.vector(&self.system.mass_product(&self.field(&unit)));
            let stiffness = self.stiffness(&unit).into_iter().zip(springs);
            stiffness.map(|(k, mass)| k + self.neutral * mass).collect()
        };
        let of_units: Vec<Vec<f64>> = (0..size).map(of_unit).collect();
        let matrix = Mat::from_fn(size, size, |r, c| of_units[c][r]);
        let wanted = Mat::from_fn(size, columns.len(), |r, c| columns[c][r]);
        let solved = matrix.partial_piv_lu().solve(&wanted);
        let left = &matrix * &solved - &wanted;
        let accurate = left.norm_l2() <= LARGEST_INVERSE_RESIDUAL * wanted.norm_l2();
        let column = |c: usize| (0..size).map(|r| solved[(r, c)]).collect();
        accurate.then(|| (0..columns.len()).map(column).collect())
    }

    /// Whether there is damping that is not proportional to the masses.
    pub(super) fn is_damped_beside_masses(&self) -> bool {
        self.stiffened.is_some() || self.leaf.leaf.in_moving_air()
    }

    /// A vector without what hinges that hold the spin do not allow.
    pub(super) fn restricted(&self, vector: &[c64]) -> Vec<c64> {
        let mut restricted = vector.to_vec();
        for held in self.leaf.spin_axes(self.state).iter() {
            let [x, y, z, ..] = self.solver.unknowns(held.rod, 0);
            let parts = || [x, y, z].into_iter().zip(held.axis.to_array());
            let along: c64 = parts().map(|(at, axis)| vector[at] * axis).sum();
            parts().for_each(|(at, axis)| restricted[at] -= along * axis);
        }
        restricted
    }

    /// A vector as increments of the nodes.
    fn field(&self, vector: &[f64]) -> NodalField {
        let node = |j: usize, i: usize| self.solver.unknowns(j, i).map(|at| vector[at]);
        let rod = |j: usize| self.leaf.moving_nodes().map(|i| node(j, i)).collect();
        (0..self.leaf.rods()).map(rod).collect()
    }

    /// A vector as increments of all nodes, rod after rod, base to tip.
    pub(super) fn node_increments(&self, vector: &[c64]) -> Vec<ComplexIncrement> {
        let mut shape = vec![[c64::new(0.0, 0.0); 6]; self.state.x.len()];
        for (j, i) in self.leaf.rod_index_pairs(self.leaf.moving_nodes()) {
            shape[self.state.base(j) + i] = self.solver.unknowns(j, i).map(|at| vector[at]);
        }
        shape
    }

    /// Forces on the nodes as a vector.
    fn vector(&self, forces: &NodalField) -> Vec<f64> {
        let mut vector = vec![0.0; self.solver.size()];
        let first = self.leaf.first_node();
        for (j, i) in self.leaf.rod_index_pairs(self.leaf.moving_nodes()) {
            let node = &forces[j][i - first];
            for (at, part) in self.solver.unknowns(j, i).into_iter().zip(node) {
                vector[at] += part;
            }
        }
        vector
    }

    fn no_forces(&self) -> NodalField {
        vec![vec![[0.0; 6]; self.leaf.moving_nodes().len()]; self.leaf.rods()]
    }

    /// W times a vector.
    fn force_derivative(&self, vector: &[f64]) -> Vec<f64> {
        let mut change = self.no_forces();
        let field = self.field(vector);
        match &self.transposed {
            Some(blocks) => blocks
                .by_displacement
                .add_transposed_product(&field, &mut change),
            None => (self.forces).add_derivative(self.state, &field, &mut change),
        }
        self.vector(&change)
    }

    /// C times a vector.
    fn damping(&self, vector: &[f64]) -> Vec<f64> {
        let mut sum = self.masses.times(vector);
        let external = self.physics.damping;
        sum.iter_mut().for_each(|value| *value *= external);
        let field = self.field(vector);
        let mut more = |factor: f64, forces: &NodalField| {
            let forces = self.vector(forces);
            (sum.iter_mut().zip(forces)).for_each(|(sum, force)| *sum += factor * force);
        };
        if let Some(stiffened) = &self.stiffened {
            let time = self.physics.retardation;
            more(time, &self.solver.product(stiffened, &field));
            more(-time, &self.solver.product(&self.system, &field));
        }
        if self.leaf.leaf.in_wind() {
            let mut drag = self.no_forces();
            match self
                .transposed
                .as_ref()
                .and_then(|it| it.by_velocity.as_ref())
            {
                Some(blocks) => blocks.add_transposed_product(&field, &mut drag),
                None => (self.forces).add_velocity_derivative(self.state, &field, &mut drag),
            }
            more(-1.0, &drag);
        }
        sum
    }

    /// (K - W)^-1 times a vector of forces.
    fn inverse(&self, factors: &mut MatrixFactors, forces: &[f64]) -> Option<Vec<f64>> {
        let mut start = forces.to_vec();
        factors.solve_vector(&mut start);
        let product = &mut |direction: &[f64]| {
            let mut image = self.force_derivative(direction);
            factors.solve_vector(&mut image);
            Some(direction.iter().zip(image).map(|(v, w)| v - w).collect())
        };
        let found = solve_minimal_residual(&start, INVERSE_LIMITS, product)?;
        let solved = found.residual <= LARGEST_INVERSE_RESIDUAL;
        let zero = || vec![0.0; forces.len()];
        solved.then(|| found.solution().unwrap_or_else(zero))
    }

    /// A load without any symmetry, another one for every start.
    fn start(&self, number: usize) -> Vec<f64> {
        // Multiples of the golden ratio are equidistributed: no symmetry, and deterministic.
        let golden = |k: usize| (k as f64 * 0.618_033_988_749_895).fract() - 0.5;
        let mut vector = vec![0.0; self.solver.size()];
        for (j, i) in self.leaf.rod_index_pairs(self.leaf.moving_nodes()) {
            let sigma = self.leaf.grid.sigma()[i];
            let wave = (7.0 * number as f64 * sigma).cos();
            for (c, at) in self.solver.unknowns(j, i).into_iter().enumerate() {
                let k = 18 * (j + 97 * number) + c;
                vector[at] = golden(k + 1) + sigma * golden(k + 7) + wave * golden(k + 13);
            }
        }
        self.masses.times(&vector)
    }

    /// The squares lambda^2 + a lambda = -1/nu of the roots where all damping is proportional to the masses.
    fn squares(
        &self,
        factors: &mut MatrixFactors,
        count: usize,
        time: &Limit,
    ) -> Option<Vec<Square>> {
        let eigenvalues = self.eigenpairs_of_squares(factors, count, time)?.values;
        let square = |it: &RitzValue, next: Option<&RitzValue>| Square {
            value: -it.eigenvalue.finv(),
            alignment: next.map_or(0.0, |next| it.alignment(next)),
        };
        let pairs = eigenvalues.iter().zip(1..);
        Some(
            pairs
                .map(|(it, k)| square(it, eigenvalues.get(k)))
                .collect(),
        )
    }

    /// The eigenpairs of (K - W)^-1 M of largest eigenvalues, conjugate ones both.
    pub(super) fn eigenpairs_of_squares(
        &self,
        factors: &mut MatrixFactors,
        count: usize,
        time: &Limit,
    ) -> Option<RitzPairs> {
        let mut starts = Vec::new();
        for number in 0..STARTS {
            starts.push(self.inverse(factors, &self.start(number))?);
        }
        let apply = &mut |q: &[f64]| self.inverse(factors, &self.masses.times(q));
        largest_eigenvalues(starts, count, apply, time)
    }

    /// The roots with any damping.
    fn roots_of_states(
        &self,
        factors: &mut MatrixFactors,
        count: usize,
        time: &Limit,
    ) -> Option<Vec<MotionRoot>> {
        let eigenvalues = self.eigenpairs_of_states(factors, 2 * count, time)?.values;
        let upper = eigenvalues.iter().map(|it| it.eigenvalue);
        let upper = upper.filter(|mu| mu.im >= 0.0);
        Some(upper.map(|mu| MotionRoot::new(mu.finv())).collect())
    }

    /// The eigenpairs of the map of states (q, p) of largest eigenvalues, conjugate ones both.
    pub(super) fn eigenpairs_of_states(
        &self,
        factors: &mut MatrixFactors,
        count: usize,
        time: &Limit,
    ) -> Option<RitzPairs> {
        let size = self.solver.size();
        let mut starts = Vec::new();
        for number in 0..STARTS {
            let mut start = self.inverse(factors, &self.start(number))?;
            start.extend(self.inverse(factors, &self.start(number + STARTS))?);
            starts.push(start);
        }
        let apply = &mut |state: &[f64]| {
            let (q, p) = state.split_at(size);
            let (damped, moving) = (self.damping(q), self.masses.times(p));
            let sum: Vec<f64> = damped.iter().zip(moving).map(|(a, b)| -a - b).collect();
            let mut image = self.inverse(factors, &sum)?;
            image.extend_from_slice(q);
            Some(image)
        };
        largest_eigenvalues(starts, count, apply, time)
    }

    /// (lambda^2 M + lambda C + K - W) times a complex vector, and the same differentiated by lambda.
    pub(super) fn polynomial(&self, lambda: c64, vector: &[c64]) -> PolynomialProduct {
        let parts = [|it: &c64| it.re, |it: &c64| it.im];
        let parts = parts.map(|of| vector.iter().map(of).collect::<Vec<f64>>());
        let complex = |product: &dyn Fn(&[f64]) -> Vec<f64>| -> Vec<c64> {
            let [re, im] = [product(&parts[0]), product(&parts[1])];
            re.into_iter()
                .zip(im)
                .map(|(re, im)| c64::new(re, im))
                .collect()
        };
        let masses = complex(&|v| self.masses.times(v));
        let damping = complex(&|v| self.damping(v));
        let stiffness = complex(&|v| self.stiffness(v));
        let all = masses.iter().zip(&damping).zip(&stiffness);
        let value = |((m, c), k): ((&c64, &c64), &c64)| lambda * (lambda * m + c) + k;
        let slope = |(m, c): (&c64, &c64)| 2.0 * lambda * m + c;
        PolynomialProduct {
            value: all.map(value).collect(),
            slope: masses.iter().zip(&damping).map(slope).collect(),
        }
    }
}

#[cfg(test)]
mod tests;
