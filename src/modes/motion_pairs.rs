//! Small motions with their shapes and those of the transposed equations, by which their roots are
//! differentiated: of a root lambda of Q(lambda) = lambda^2 M + lambda C + K - W with Q x = 0 and u^T Q = 0,
//!
//! dlambda = -u^T dQ x / u^T (2 lambda M + C) x
//!
//! (P. Lancaster, Numer. Math. 6, 1964). The denominator is zero where two roots merge, as where flutter begins
//! without damping: there roots have no derivatives.

use crate::leaf::{DiscreteLeaf, MatrixFactors, State};
use crate::modes::linearized::{ComplexIncrement, LinearizedMotion, MotionRoot};
use crate::motion::Physics;
use crate::newton::FollowerForces;
use crate::run::Limit;
use faer::c64;

/// Distance of a root of the transposed equations from that of the equations, as a part of it, up to which both
/// are one.
const SAME_ROOT: f64 = 1e-6;

/// A small motion exp(lambda t) x, with the vector u of the transposed equations, scaled to
/// u^T (2 lambda M + C) x = 1. Dimensionless.
#[derive(Clone, Debug)]
pub struct MotionPair {
    /// lambda, with an imaginary part that is not negative.
    pub root: c64,
    shape: Vec<c64>,
    transposed_shape: Vec<c64>,
    /// The denominator of the derivative, as a part of that with either vector alone: one without damping and with a
    /// potential, and zero where two roots merge.
    pub separation: f64,
}

/// Imaginary part of the square of a root, as a part of it, that is rounding of two equal real ones.
const EQUAL_SQUARES: f64 = 1e-6;

/// A small motion exp(lambda t) x: lambda, and x at all nodes, rod after rod, base to tip.
#[derive(Clone, Debug)]
pub struct NodalMotion {
    pub root: MotionRoot,
    pub shape: Vec<ComplexIncrement>,
}

/// The small motions about a state next to zero with their shapes, one of each conjugate pair, in the order of
/// [`lowest_roots`](crate::modes::linearized::lowest_roots). `None` where that has none.
pub fn lowest_shapes(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    forces: &dyn FollowerForces,
    count: usize,
    time: &Limit,
) -> Option<Vec<NodalMotion>> {
    let shift = leaf.neutral_shift();
    let (motion, mut factors) = LinearizedMotion::new(leaf, physics, state, forces, shift)?;
    let found = shapes(&motion, &mut factors, count, time)?;
    let squares = !motion.is_damped_beside_masses();
    let nodal = |root: c64, vector: &[c64]| NodalMotion {
        root: MotionRoot::new(root),
        shape: motion.node_increments(vector),
    };
    let mut all = Vec::new();
    for Shape { root, vector } in &found {
        let square = motion.square_of_root(*root);
        if squares && square.im != 0.0 && square.im.abs() <= EQUAL_SQUARES * square.norm() {
            // Both parts of the vector are shapes of two equal real squares: made orthogonal.
            let main = (0.5 * dot(vector, vector).arg()).sin_cos();
            let turn = c64::new(main.1, -main.0);
            let turned = || vector.iter().map(|it| *it * turn);
            let parts = [
                turned().map(|it| c64::new(it.re, 0.0)).collect::<Vec<_>>(),
                turned().map(|it| c64::new(it.im, 0.0)).collect(),
            ];
            all.extend(parts.map(|part| nodal(*root, &part)));
        } else {
            all.push(nodal(*root, vector));
        }
    }
    Some(all)
}

/// The small motions about a state next to zero, one of each conjugate pair, as
/// [`lowest_roots`](crate::modes::linearized::lowest_roots) has their roots. `None` where that has none.
pub fn lowest_pairs(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    forces: &dyn FollowerForces,
    count: usize,
    time: &Limit,
) -> Option<Vec<MotionPair>> {
    let shift = leaf.neutral_shift();
    let (mut motion, mut factors) = LinearizedMotion::new(leaf, physics, state, forces, shift)?;
    let right = shapes(&motion, &mut factors, count, time)?;
    // K, and with it the factors, are those of the transposed equations, too.
    motion.transpose();
    let left = shapes(&motion, &mut factors, count, time)?;
    motion.transpose_back();
    let pair = |own: Shape| {
        let distance = |other: &&Shape| (other.root - own.root).norm();
        let other = left
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let other = other.filter(|it| distance(it) <= SAME_ROOT * own.root.norm())?;
        let slope = |vector: &[c64]| motion.polynomial(own.root, vector).slope;
        let [of_own, of_other] = [&own.vector, &other.vector].map(|it| slope(it));
        let product = dot(&other.vector, &of_own);
        let size = |vector: &[c64], slope: &[c64]| {
            let both = vector.iter().zip(slope);
            both.map(|(a, b)| a.conj() * b).sum::<c64>().norm()
        };
        let sizes = size(&own.vector, &of_own) * size(&other.vector, &of_other);
        let separation = product.norm() / sizes.sqrt();
        let scaled = other.vector.iter().map(|value| *value / product);
        Some(MotionPair {
            root: own.root,
            transposed_shape: scaled.collect(),
            shape: own.vector,
            separation,
        })
    };
    right.into_iter().take(count).map(pair).collect()
}

/// A root with its vector.
struct Shape {
    root: c64,
    vector: Vec<c64>,
}

/// At least `count` roots with their vectors, if there are so many, from their squares or, with damping beside that of
/// masses, from those of states: one of each conjugate pair, the nearest to zero first.
fn shapes(
    motion: &LinearizedMotion,
    factors: &mut MatrixFactors,
    count: usize,
    time: &Limit,
) -> Option<Vec<Shape>> {
    let states = motion.is_damped_beside_masses();
    let found = match states {
        true => motion.eigenpairs_of_states(factors, 2 * count, time),
        false => motion.eigenpairs_of_squares(factors, 2 * count, time),
    }?;
    let size = motion.solver.size();
    let mut all = Vec::new();
    for (k, it) in found.values.iter().enumerate() {
        let inverse = it.eigenvalue.finv();
        let root = match states {
            true => inverse,
            false => motion.root_of_square(-inverse),
        };
        // One of each conjugate pair: of squares the other one has the same root but for its sign.
        let other = match states {
            true => it.eigenvalue.im > 0.0,
            false => it.eigenvalue.im < 0.0,
        };
        if other {
            continue;
        }
        let mut vector = found.eigenvector(k);
        vector.truncate(size);
        all.push(Shape { root, vector });
    }
    all.sort_by(|a, b| a.root.norm().total_cmp(&b.root.norm()));
    Some(all)
}

/// a . b, not conjugated.
fn dot(a: &[c64], b: &[c64]) -> c64 {
    a.iter().zip(b).map(|(a, b)| *a * *b).sum()
}

impl MotionPair {
    /// u^T Q(lambda) x of a neighbouring leaf at rest on the same grid, whose times are in the unit of its own
    /// `physics`, `time_ratio` times that of this motion: minus the change of lambda to first order. `None` if memory
    /// is short.
    pub fn unbalanced(
        &self,
        leaf: &DiscreteLeaf,
        physics: &Physics,
        state: &State,
        forces: &dyn FollowerForces,
        time_ratio: f64,
    ) -> Option<c64> {
        let shift = leaf.neutral_shift();
        let (motion, _) = LinearizedMotion::new(leaf, physics, state, forces, shift)?;
        // Hinges that hold the spin allow other increments in another state.
        let [shape, transposed] =
            [&self.shape, &self.transposed_shape].map(|shape| motion.restricted(shape));
        let product = motion.polynomial(self.root * time_ratio, &shape);
        Some(dot(&transposed, &product.value))
    }
}
