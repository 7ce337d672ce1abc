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
//! roots that are wanted are small.

use crate::krylov::{KrylovLimits, solve_minimal_residual};
use crate::leaf::{DirectSolver, DiscreteLeaf, MatrixFactors, NodalField, State, System};
use crate::modes::MassMatrix;
use crate::motion::Physics;
use crate::newton::FollowerForces;
use crate::run::Limit;
use faer::{Mat, c64};

/// The search for roots.
struct RootSearch {
    /// Number of starts: so many equal roots are found.
    starts: usize,
    /// Largest number of directions.
    most_directions: usize,
    /// Directions between looks at the roots.
    check_every: usize,
    /// Residual of an eigenvalue, as a part of it.
    accuracy: f64,
    /// Size of a new direction, as a part of the image, below which there is none.
    exhausted: f64,
}

const SEARCH: RootSearch = RootSearch {
    starts: 3,
    most_directions: 300,
    check_every: 12,
    accuracy: 1e-10,
    exhausted: 1e-13,
};

/// Limits of the inverse with forces without a potential.
const INVERSE_LIMITS: KrylovLimits = KrylovLimits {
    accuracy: 1e-12,
    most: 200,
    singular_value_limit: 0.0,
    stagnation: None,
};

/// Largest residual of the inverse, which rounding may leave above its accuracy.
const LARGEST_INVERSE_RESIDUAL: f64 = 1e-8;

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

    fn new(root: c64) -> Self {
        MotionRoot {
            growth: root.re,
            frequency: root.im.abs(),
        }
    }

    /// The distance from zero.
    pub fn size(self) -> f64 {
        self.growth.hypot(self.frequency)
    }
}

/// The linearised motion of a leaf about a state of rest.
struct LinearizedMotion<'a> {
    leaf: &'a DiscreteLeaf,
    state: &'a State,
    forces: &'a dyn FollowerForces,
    physics: &'a Physics,
    solver: DirectSolver,
    system: System,
    /// The equations with rods twice as stiff under the same stresses, if the material is damped: the
    /// difference is their material stiffness.
    stiffened: Option<System>,
    masses: MassMatrix,
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
    let mut system = System::new(leaf);
    leaf.assemble(state, &mut system);
    let solver = DirectSolver::for_coupling_pattern(&system).ok()?;
    let neutral = match leaf.zero_energy_fields(state).is_empty() {
        true => 0.0,
        false => leaf.neutral_shift(),
    };
    let mut factors = solver.factorize(&system, neutral).ok()?;
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
    };
    let mut roots = match motion.is_damped_beside_masses() {
        false => {
            let squares = motion.squares(&mut factors, count, time)?;
            if physics.damping == 0.0 {
                return Some(MotionRoots::Squares(squares));
            }
            // One of each conjugate pair.
            let squares = squares.iter().map(|it| it.value).filter(|it| it.im >= 0.0);
            let half = 0.5 * physics.damping;
            let root = |square: c64| {
                let root = MotionRoot::from_square(square + half * half);
                MotionRoot {
                    growth: root.growth - half,
                    ..root
                }
            };
            squares.map(root).collect()
        }
        true => motion.roots_of_states(&mut factors, count, time)?,
    };
    roots.sort_by(|a, b| a.size().total_cmp(&b.size()));
    Some(MotionRoots::Damped(roots))
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

impl LinearizedMotion<'_> {
    /// Whether there is damping that is not proportional to the masses.
    fn is_damped_beside_masses(&self) -> bool {
        self.stiffened.is_some() || self.leaf.leaf.in_wind()
    }

    /// A vector as increments of the nodes.
    fn field(&self, vector: &[f64]) -> NodalField {
        let node = |j: usize, i: usize| self.solver.unknowns(j, i).map(|at| vector[at]);
        let rod = |j: usize| self.leaf.moving_nodes().map(|i| node(j, i)).collect();
        (0..self.leaf.rods()).map(rod).collect()
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
        (self.forces).add_derivative(self.state, &self.field(vector), &mut change);
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
            (self.forces).add_velocity_derivative(self.state, &field, &mut drag);
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
        let mut starts = Vec::new();
        for number in 0..SEARCH.starts {
            starts.push(self.inverse(factors, &self.start(number))?);
        }
        let apply = &mut |q: &[f64]| self.inverse(factors, &self.masses.times(q));
        let eigenvalues = largest_eigenvalues(starts, count, apply, time)?;
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

    /// The roots with any damping.
    fn roots_of_states(
        &self,
        factors: &mut MatrixFactors,
        count: usize,
        time: &Limit,
    ) -> Option<Vec<MotionRoot>> {
        let size = self.solver.size();
        let mut starts = Vec::new();
        for number in 0..SEARCH.starts {
            let mut start = self.inverse(factors, &self.start(number))?;
            start.extend(self.inverse(factors, &self.start(number + SEARCH.starts))?);
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
        let eigenvalues = largest_eigenvalues(starts, 2 * count, apply, time)?;
        let upper = eigenvalues.iter().map(|it| it.eigenvalue);
        let upper = upper.filter(|mu| mu.im >= 0.0);
        Some(upper.map(|mu| MotionRoot::new(mu.finv())).collect())
    }
}

/// The eigenvalues of largest size of a matrix that is known by its products, conjugate ones both, at
/// least `count` if there are so many besides zero: by the Arnoldi method from several starts at once (a
/// band matrix in place of Hessenberg's).
fn largest_eigenvalues(
    starts: Vec<Vec<f64>>,
    count: usize,
    apply: &mut dyn FnMut(&[f64]) -> Option<Vec<f64>>,
    time: &Limit,
) -> Option<Vec<RitzValue>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for mut start in starts {
        orthogonalize(&mut start, &mut basis);
    }
    loop {
        let done = columns.len();
        let exhausted = done == basis.len();
        let full = done == SEARCH.most_directions;
        let looks = done >= 2 * count && done.is_multiple_of(SEARCH.check_every);
        if looks || exhausted || full {
            let found = ritz_values(&columns, basis.len())?;
            // A conjugate pair is not parted.
            let parts = |it: &RitzValue| it.eigenvalue.im != 0.0;
            let pairs = found.iter().take(count).filter(|it| parts(it)).count() % 2;
            let count = count + pairs;
            let wanted = found.iter().take(count);
            let converged = |it: &RitzValue| it.residual <= SEARCH.accuracy * it.eigenvalue.norm();
            if exhausted || found.len() >= count && wanted.into_iter().all(converged) {
                return Some(found.into_iter().take(count).collect());
            }
        }
        if full || time.reached() {
            return None;
        }
        let mut image = apply(&basis[done])?;
        columns.push(orthogonalize(&mut image, &mut basis));
        if columns[done].iter().any(|value| !value.is_finite()) {
            return None;
        }
    }
}

/// Appends the part of a vector that is orthogonal to a basis to it, unless there is none; returns the
/// coefficients of the vector.
fn orthogonalize(vector: &mut [f64], basis: &mut Vec<Vec<f64>>) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let whole = dot(vector, vector).sqrt();
    let mut coefficients = vec![0.0; basis.len()];
    // Twice is enough (Giraud et al., Numer. Math. 101, 2005).
    for _ in 0..2 {
        for (coefficient, direction) in coefficients.iter_mut().zip(&*basis) {
            let part = dot(direction, vector);
            *coefficient += part;
            (vector.iter_mut().zip(direction)).for_each(|(v, d)| *v -= part * d);
        }
    }
    let left = dot(vector, vector).sqrt();
    if left > SEARCH.exhausted * whole {
        vector.iter_mut().for_each(|value| *value /= left);
        basis.push(vector.to_vec());
        coefficients.push(left);
    }
    coefficients
}

/// An approximate eigenvalue, and the norm of its residual.
struct RitzValue {
    eigenvalue: c64,
    residual: f64,
    /// The eigenvector in the basis, of unit length.
    vector: Vec<c64>,
}

impl RitzValue {
    /// Cosine of the angle between two eigenvectors.
    fn alignment(&self, other: &RitzValue) -> f64 {
        let both = self.vector.iter().zip(&other.vector);
        both.map(|(a, b)| a.conj() * b).sum::<c64>().norm()
    }
}

/// The approximate eigenvalues but for those that are zero, the largest first, from the coefficients of the
/// images of so many directions in a basis of `size` vectors.
fn ritz_values(columns: &[Vec<f64>], size: usize) -> Option<Vec<RitzValue>> {
    let done = columns.len();
    let entry = |r: usize, c: usize| columns[c].get(r).copied().unwrap_or(0.0);
    let eigen = Mat::from_fn(done, done, entry).eigen().ok()?;
    let (vectors, values) = (eigen.U(), eigen.S().column_vector());
    let mut found: Vec<RitzValue> = (0..done)
        .filter(|&k| values[k].norm() > 0.0)
        .map(|k| {
            let vector: Vec<c64> = (0..done).map(|c| vectors[(c, k)]).collect();
            let length = vector.iter().map(|v| v.norm_sqr()).sum::<f64>().sqrt();
            let vector: Vec<c64> = vector.into_iter().map(|v| v / length).collect();
            let beyond = (done..size).map(|r| {
                let parts = vector.iter().enumerate().map(|(c, v)| *v * entry(r, c));
                parts.sum::<c64>().norm_sqr()
            });
            RitzValue {
                eigenvalue: values[k],
                residual: beyond.sum::<f64>().sqrt(),
                vector,
            }
        })
        .collect();
    found.sort_by(|a, b| b.eigenvalue.norm().total_cmp(&a.eigenvalue.norm()));
    Some(found)
}
