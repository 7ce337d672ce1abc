//! The Arnoldi method for the eigenvalues of largest size of an unsymmetric matrix that is known by its
//! products (W. E. Arnoldi, Quart. Appl. Math. 9, 1951), from several starts at once: so many equal
//! eigenvalues are found.

use crate::run::Limit;
use faer::{Mat, c64};

/// The search for eigenvalues.
struct ArnoldiSearch {
    /// Largest number of directions.
    most_directions: usize,
    /// Directions between looks at the eigenvalues.
    check_every: usize,
    /// Residual of an eigenvalue, as a part of it.
    accuracy: f64,
    /// Size of a new direction, as a part of the image, below which there is none.
    exhausted: f64,
}

const SEARCH: ArnoldiSearch = ArnoldiSearch {
    most_directions: 300,
    check_every: 12,
    accuracy: 1e-10,
    exhausted: 1e-13,
};

/// The eigenvalues of largest size of a matrix that is known by its products, conjugate ones both, at
/// least `count` if there are so many besides zero: by the Arnoldi method from several starts at once (a
/// band matrix in place of Hessenberg's).
pub fn largest_eigenvalues(
    starts: Vec<Vec<f64>>,
    count: usize,
    apply: &mut dyn FnMut(&[f64]) -> Option<Vec<f64>>,
    time: &Limit,
) -> Option<RitzPairs> {
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
                let values = found.into_iter().take(count).collect();
                return Some(RitzPairs { values, basis });
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

/// Eigenvalues, the largest first, with the basis of their eigenvectors.
pub struct RitzPairs {
    pub values: Vec<RitzValue>,
    basis: Vec<Vec<f64>>,
}

impl RitzPairs {
    /// An eigenvector, of unit length.
    pub fn eigenvector(&self, k: usize) -> Vec<c64> {
        let size = self.basis.first().map_or(0, Vec::len);
        let mut sum = vec![c64::new(0.0, 0.0); size];
        for (part, direction) in self.values[k].vector.iter().zip(&self.basis) {
            for (sum, value) in sum.iter_mut().zip(direction) {
                *sum += *part * *value;
            }
        }
        sum
    }
}

/// An approximate eigenvalue, and the norm of its residual.
pub struct RitzValue {
    pub eigenvalue: c64,
    residual: f64,
    /// The eigenvector in the basis, of unit length.
    vector: Vec<c64>,
}

impl RitzValue {
    /// Cosine of the angle between two eigenvectors.
    pub fn alignment(&self, other: &RitzValue) -> f64 {
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
