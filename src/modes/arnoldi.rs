//! The Arnoldi method for the eigenvalues of largest size of an unsymmetric matrix that is known by its
//! products (W. E. Arnoldi, Quart. Appl. Math. 9, 1951), from several starts at once: so many equal
//! eigenvalues are found. The small matrices to which that leads, and others that are dense, are solved by
//! Francis's iteration.

use crate::run::Limit;
use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, EvdParams, evd_real, evd_scratch};
use faer::{Auto, Mat, Par, Spec, c64};

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
    let DenseEigenpairs { values, vectors } = dense_eigenpairs(&Mat::from_fn(done, done, entry))?;
    let mut found: Vec<RitzValue> = (0..done)
        .filter(|&k| values[k].norm() > 0.0)
        .map(|k| {
            let vector = eigenvector_of(&values, &vectors, k);
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

/// The eigenvalues of a dense matrix, and its eigenvectors as columns: of a conjugate pair the real parts, then
/// the imaginary ones.
struct DenseEigenpairs {
    values: Vec<c64>,
    vectors: Mat<f64>,
}

/// The eigenvector of the eigenvalue `k`.
fn eigenvector_of(values: &[c64], vectors: &Mat<f64>, k: usize) -> Vec<c64> {
    let column = |c: usize| (0..vectors.nrows()).map(move |r| vectors[(r, c)]);
    match values[k].im {
        0.0 => column(k).map(|re| c64::new(re, 0.0)).collect(),
        im => {
            let (first, sign) = if im > 0.0 { (k, 1.0) } else { (k - 1, -1.0) };
            let parts = column(first).zip(column(first + 1));
            parts.map(|(re, im)| c64::new(re, sign * im)).collect()
        }
    }
}

/// Francis's iteration with two shifts. That with many, for large matrices, may go on for ever where many
/// eigenvalues are equal but for rounding.
fn francis_iteration() -> Spec<EvdParams, f64> {
    let mut parameters = <EvdParams as Auto<f64>>::auto();
    parameters.schur.blocking_threshold = usize::MAX;
    parameters.into()
}

/// The eigenvalues of a dense matrix; `None` if the iteration does not converge.
pub fn dense_eigenvalues(matrix: &Mat<f64>) -> Option<Vec<c64>> {
    dense_eigenvalues_into(matrix, None)
}

fn dense_eigenpairs(matrix: &Mat<f64>) -> Option<DenseEigenpairs> {
    let mut vectors = Mat::zeros(matrix.nrows(), matrix.nrows());
    let values = dense_eigenvalues_into(matrix, Some(&mut vectors))?;
    Some(DenseEigenpairs { values, vectors })
}

fn dense_eigenvalues_into(matrix: &Mat<f64>, vectors: Option<&mut Mat<f64>>) -> Option<Vec<c64>> {
    let size = matrix.nrows();
    let wanted = match vectors.is_some() {
        true => ComputeEigenvectors::Yes,
        false => ComputeEigenvectors::No,
    };
    let (none, parameters) = (ComputeEigenvectors::No, francis_iteration());
    let room = evd_scratch::<f64>(size, none, wanted, Par::Seq, parameters);
    let (mut re, mut im) = (Diag::zeros(size), Diag::zeros(size));
    evd_real(
        matrix.as_ref(),
        re.as_mut(),
        im.as_mut(),
        None,
        vectors.map(|it| it.as_mut()),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(room)),
        parameters,
    )
    .ok()?;
    let parts = (0..size).map(|k| c64::new(re.column_vector()[k], im.column_vector()[k]));
    Some(parts.collect())
}
