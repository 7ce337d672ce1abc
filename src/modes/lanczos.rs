//! The Lanczos method for (K - sigma M)^-1 M, in the inner product of M, with full
//! reorthogonalization (C. Lanczos, J. Res. Nat. Bur. Standards 45, 1950;
//! T. Ericsson and A. Ruhe, Math. Comp. 35, 1980, for the inverse).
//!
//! Loads with which searches for modes begin.

use crate::modes::{MassMatrix, Vibration};
use crate::run::Limit;
use nalgebra::{DMatrix, SymmetricEigen};

/// Best possible accuracy of an eigenvector relative to the largest eigenvalue: rounding.
const LEAST_ACCURACY: f64 = 1e-13;

/// Largest dimension of the Krylov space, and its increase for every pair wanted.
const MAX_KRYLOV_DIMENSION: usize = 40;

const KRYLOV_DIMENSION_PER_PAIR: usize = 4;

/// If some pairs have converged and the next one would take more checks than this, a
/// closer shift is cheaper.
const MAX_FURTHER_CHECKS: f64 = 3.0;

/// A direction reduced by orthogonalization below this part of its length is rounding: the
/// Krylov space of the start is exhausted.
const KRYLOV_EXHAUSTION_RATIO: f64 = 1e-13;

/// An eigenvector of unit mass.
pub struct NormalizedEigenvector {
    pub eigenvalue: f64,
    pub vector: Vec<f64>,
}

/// A Ritz value that eigenvalues do not exceed, and its relative error as seen from the shift.
pub struct RitzBound {
    pub eigenvalue: f64,
    pub error: f64,
}

pub struct Lanczos<'a> {
    pub masses: &'a MassMatrix,
    /// Sigma.
    pub shift: f64,
    /// Solves (K - sigma M) x = b in place.
    pub solve: &'a mut dyn FnMut(&mut [f64]),
    /// Eigenvectors found before, to be excluded.
    pub known_modes: &'a [NormalizedEigenvector],
    /// Relative accuracy of an eigenvector; that of the eigenvalue is its square.
    pub accuracy: f64,
    /// Directions between convergence checks.
    pub check_every: usize,
    /// Time limit, beyond which nothing is returned.
    pub time: &'a Limit,
}

/// With eight partial sums, which are independent of each other.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, rest_a), (b, rest_b)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for k in 0..8 {
            sums[k] += a[k] * b[k];
        }
    }
    let rest: f64 = rest_a.iter().zip(rest_b).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

fn subtract(a: &mut [f64], factor: f64, b: &[f64]) {
    a.iter_mut().zip(b).for_each(|(a, b)| *a -= factor * b);
}

impl Lanczos<'_> {
    /// The eigenvalues next above sigma, from the load `start`: `wanted` or
    /// more of them, fewer if there are no more below `limit` or the run becomes
    /// too long. Also a value that the wanted ones do not exceed, if some are not found.
    pub fn run(
        &mut self,
        start: Vec<f64>,
        wanted: usize,
        limit: f64,
    ) -> (Vec<NormalizedEigenvector>, Option<RitzBound>) {
        let mut next = start;
        (self.solve)(&mut next);
        let most = (MAX_KRYLOV_DIMENSION + KRYLOV_DIMENSION_PER_PAIR * wanted)
            .min(next.len() - self.known_modes.len());
        let mut basis: Vec<Vec<f64>> = Vec::new();
        let (mut diagonal, mut off): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut length = self.orthogonal(&mut next, &basis);
        // Number of converged pairs at the last check, and the error of the next one.
        let mut last_check = (0, f64::INFINITY);
        while basis.len() < most && length > 0.0 && !self.time.reached() {
            next.iter_mut().for_each(|x| *x /= length);
            let loaded = self.masses.times(&next);
            let mut image = loaded.clone();
            (self.solve)(&mut image);
            diagonal.push(dot(&image, &loaded));
            basis.push(next);
            let before = dot(&image, &self.masses.times(&image)).max(0.0).sqrt();
            length = self.orthogonal(&mut image, &basis);
            if length <= KRYLOV_EXHAUSTION_RATIO * before {
                length = 0.0;
            }
            let size = basis.len();
            if size.is_multiple_of(self.check_every) || size == most || length == 0.0 {
                let (values, vectors) = ritz(&diagonal, &off);
                let error = |k: usize| length * vectors[(size - 1, k)].abs();
                let good = |k: usize| {
                    error(k) <= (self.accuracy * values[k]).max(LEAST_ACCURACY * values[0])
                };
                let done = (0..size).take_while(|&k| good(k)).count();
                let next_error = if done < size {
                    error(done) / values[done]
                } else {
                    0.0
                };
                let slow = limit.is_infinite() && last_check.0 == done && done > 0 && {
                    let gained = (last_check.1 / next_error).ln().max(0.0);
                    (next_error / self.accuracy).ln() > MAX_FURTHER_CHECKS * gained
                };
                last_check = (done, next_error);
                let eigenvalue = |k: usize| self.shift + 1.0 / values[k];
                let beyond = done > 0 && eigenvalue(done - 1) > limit;
                if done >= wanted || beyond || slow || size == most || length == 0.0 {
                    let pair = |k: usize| NormalizedEigenvector {
                        eigenvalue: eigenvalue(k),
                        vector: self.combined(&basis, &vectors, k),
                    };
                    // Values that are not positive are due to rounding.
                    let positive = values.iter().take_while(|&&value| value > 0.0).count();
                    let found = (0..done.min(positive)).map(pair).collect();
                    let short = done < wanted && wanted <= positive;
                    let bound = |k: usize| RitzBound {
                        eigenvalue: eigenvalue(k),
                        error: error(k) / values[k],
                    };
                    return (found, short.then(|| bound(wanted - 1)));
                }
            }
            off.push(length);
            next = image;
        }
        (Vec::new(), None)
    }

    /// Orthogonalizes a vector against the basis and the known modes, twice, since
    /// once is not accurate to the last digits. Returns its length.
    fn orthogonal(&self, vector: &mut [f64], basis: &[Vec<f64>]) -> f64 {
        for _ in 0..2 {
            let loaded = self.masses.times(vector);
            let known = self.known_modes.iter().map(|found| &found.vector);
            for direction in known.chain(basis) {
                subtract(vector, dot(direction, &loaded), direction);
            }
        }
        dot(vector, &self.masses.times(vector)).max(0.0).sqrt()
    }

    /// The combination of the basis with the coefficients in a column.
    fn combined(&self, basis: &[Vec<f64>], coefficients: &DMatrix<f64>, column: usize) -> Vec<f64> {
        let mut sum = vec![0.0; basis[0].len()];
        for (k, direction) in basis.iter().enumerate() {
            subtract(&mut sum, -coefficients[(k, column)], direction);
        }
        // The length differs from one by rounding.
        let length = dot(&sum, &self.masses.times(&sum)).sqrt();
        sum.iter_mut().for_each(|x| *x /= length);
        sum
    }
}

/// Eigenvalues, descending, and eigenvectors of the tridiagonal matrix.
fn ritz(diagonal: &[f64], off: &[f64]) -> (Vec<f64>, DMatrix<f64>) {
    let size = diagonal.len();
    let mut matrix = DMatrix::zeros(size, size);
    for k in 0..size {
        matrix[(k, k)] = diagonal[k];
        if k > 0 {
            matrix[(k, k - 1)] = off[k - 1];
            matrix[(k - 1, k)] = off[k - 1];
        }
    }
    let eigen = SymmetricEigen::new(matrix);
    let mut order: Vec<usize> = (0..size).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let values = order.iter().map(|&k| eigen.eigenvalues[k]).collect();
    (values, eigen.eigenvectors.select_columns(&order))
}

impl Vibration<'_> {
    /// A load that excites all approximate modes not found yet.
    pub(super) fn start_from_modes(&self, found: usize) -> Vec<f64> {
        let mut load = vec![0.0; self.direct_solver.size()];
        for near in &self.approximate_modes[found..] {
            (load.iter_mut().zip(near)).for_each(|(load, near)| *load += near);
        }
        self.masses.times(&load)
    }

    /// A load without any symmetry, different in every search.
    pub(super) fn asymmetric_start(&self, search: usize) -> Vec<f64> {
        // Multiples of the golden ratio spread evenly: no symmetry, no chance.
        let golden = |k: usize| (k as f64 * 0.618_033_988_749_895).fract() - 0.5;
        let mut load = vec![0.0; self.direct_solver.size()];
        for (j, i) in self.leaf.rod_index_pairs(self.leaf.moving_nodes()) {
            let sigma = self.leaf.grid.sigma()[i];
            let wave = (7.0 * search as f64 * sigma).sin();
            for (c, at) in self.direct_solver.unknowns(j, i).into_iter().enumerate() {
                let k = 18 * (j + 97 * search) + c;
                load[at] += golden(k + 1) + sigma * golden(k + 7) + wave * golden(k + 13);
            }
        }
        self.masses.times(&load)
    }
}
