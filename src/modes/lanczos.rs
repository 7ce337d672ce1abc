//! The Lanczos method for (K - sigma M)^-1 M, in the inner product of M, with full
//! reorthogonalization (C. Lanczos, J. Res. Nat. Bur. Standards 45, 1950;
//! T. Ericsson and A. Ruhe, Math. Comp. 35, 1980, for the inverse).

use crate::run::Limit;
use nalgebra::{DMatrix, SymmetricEigen};

/// When the Lanczos method ends.
struct LanczosLimits {
    /// Best possible accuracy of an eigenvector relative to the largest eigenvalue: rounding.
    accuracy: f64,
    /// Largest dimension of the Krylov space, and its increase for every pair wanted.
    dimension: usize,
    dimension_per_pair: usize,
    /// Further checks that the next pair may take after some have converged: with more of them a
    /// closer shift is cheaper.
    further_checks: f64,
    /// A direction reduced by orthogonalization below this part of its length is rounding: the
    /// Krylov space of the start is exhausted.
    exhaustion_ratio: f64,
}

const LIMITS: LanczosLimits = LanczosLimits {
    accuracy: 1e-13,
    dimension: 40,
    dimension_per_pair: 4,
    further_checks: 3.0,
    exhaustion_ratio: 1e-13,
};

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

/// What one run of the Lanczos method found.
pub struct LanczosResult {
    pub modes: Vec<NormalizedEigenvector>,
    /// A value that the wanted eigenvalues do not exceed, if some are not found.
    pub bound: Option<RitzBound>,
}

/// Eigenpairs of a tridiagonal matrix, eigenvalues descending.
struct RitzPairs {
    values: Vec<f64>,
    /// Eigenvectors, one in each column.
    vectors: DMatrix<f64>,
}

/// The Lanczos method about a shift.
pub struct Lanczos<'a> {
    /// Multiplies a vector by the mass matrix M.
    pub mass_product: &'a dyn Fn(&[f64]) -> Vec<f64>,
    /// The shift sigma.
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

/// The scalar product, with eight partial sums, which are independent of each other.
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
    /// too long.
    pub fn run(&mut self, start: Vec<f64>, wanted: usize, limit: f64) -> LanczosResult {
        let mut next = start;
        (self.solve)(&mut next);
        let most = (LIMITS.dimension + LIMITS.dimension_per_pair * wanted)
            .min(next.len() - self.known_modes.len());
        let mut basis: Vec<Vec<f64>> = Vec::new();
        let (mut diagonal, mut off): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut length = self.orthogonal(&mut next, &basis);
        // Number of converged pairs at the last check, and the error of the next one.
        let mut last_check = (0, f64::INFINITY);
        while basis.len() < most && length > 0.0 && !self.time.reached() {
            next.iter_mut().for_each(|x| *x /= length);
            let loaded = (self.mass_product)(&next);
            let mut image = loaded.clone();
            (self.solve)(&mut image);
            diagonal.push(dot(&image, &loaded));
            basis.push(next);
            let before = dot(&image, &(self.mass_product)(&image)).max(0.0).sqrt();
            length = self.orthogonal(&mut image, &basis);
            if length <= LIMITS.exhaustion_ratio * before {
                length = 0.0;
            }
            let size = basis.len();
            if size.is_multiple_of(self.check_every) || size == most || length == 0.0 {
                let RitzPairs { values, vectors } = ritz(&diagonal, &off);
                let error = |k: usize| length * vectors[(size - 1, k)].abs();
                let good = |k: usize| {
                    error(k) <= (self.accuracy * values[k]).max(LIMITS.accuracy * values[0])
                };
                let done = (0..size).take_while(|&k| good(k)).count();
                let next_error = if done < size {
                    error(done) / values[done]
                } else {
                    0.0
                };
                let slow = limit.is_infinite() && last_check.0 == done && done > 0 && {
                    let gained = (last_check.1 / next_error).ln().max(0.0);
                    (next_error / self.accuracy).ln() > LIMITS.further_checks * gained
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
                    return LanczosResult {
                        modes: found,
                        bound: short.then(|| bound(wanted - 1)),
                    };
                }
            }
            off.push(length);
            next = image;
        }
        LanczosResult {
            modes: Vec::new(),
            bound: None,
        }
    }

    /// Orthogonalizes a vector against the basis and the known modes, twice, since
    /// once is not accurate to the last digits. Returns its length.
    fn orthogonal(&self, vector: &mut [f64], basis: &[Vec<f64>]) -> f64 {
        for _ in 0..2 {
            let loaded = (self.mass_product)(vector);
            let known = self.known_modes.iter().map(|found| &found.vector);
            for direction in known.chain(basis) {
                subtract(vector, dot(direction, &loaded), direction);
            }
        }
        dot(vector, &(self.mass_product)(vector)).max(0.0).sqrt()
    }

    /// The combination of the basis with the coefficients in a column.
    fn combined(&self, basis: &[Vec<f64>], coefficients: &DMatrix<f64>, column: usize) -> Vec<f64> {
        let mut sum = vec![0.0; basis[0].len()];
        for (k, direction) in basis.iter().enumerate() {
            subtract(&mut sum, -coefficients[(k, column)], direction);
        }
        // The length differs from one by rounding.
        let length = dot(&sum, &(self.mass_product)(&sum)).sqrt();
        sum.iter_mut().for_each(|x| *x /= length);
        sum
    }
}

/// The eigenpairs of the symmetric tridiagonal matrix with this diagonal and these numbers beside it.
fn ritz(diagonal: &[f64], off: &[f64]) -> RitzPairs {
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
    RitzPairs {
        values,
        vectors: eigen.eigenvectors.select_columns(&order),
    }
}
