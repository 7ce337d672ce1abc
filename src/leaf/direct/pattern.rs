//! The pattern of a leaf's matrix and its symbolic factorization, which are the same for all equations of the
//! leaf on one grid.

use crate::leaf::direct::unknowns::{NumberedNodes, UnknownNumbering};
use crate::memory;
use faer::Side;
use faer::sparse::SymbolicSparseColMat;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, supernodal,
};
use std::sync::{Arc, Mutex, OnceLock};

/// Why a matrix could not be factorized.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DirectError {
    /// The factors are too large for the memory that is allowed.
    Memory,
    /// A pivot is not a finite number: it has no sign.
    NotFinite,
}

/// The numbering of the unknowns, and the symbolic factorization once it is needed.
#[derive(Debug)]
pub struct MatrixPattern {
    of: NumberedNodes,
    pub unknowns: UnknownNumbering,
    /// Number of border rows, which follow all unknowns.
    pub border: usize,
    symbolic: OnceLock<Result<Arc<SymbolicFactorization>, DirectError>>,
}

impl MatrixPattern {
    /// The pattern of the matrix of these nodes with so many dense rows and columns at the end.
    pub fn new(of: NumberedNodes, border: usize) -> Self {
        MatrixPattern {
            of,
            unknowns: UnknownNumbering::new(of),
            border,
            symbolic: OnceLock::new(),
        }
    }

    /// Whether it is the pattern of the matrix of these nodes.
    pub fn is_of(&self, nodes: NumberedNodes, border: usize) -> bool {
        (self.of, self.border) == (nodes, border)
    }

    /// Number of unknowns, with those of the border.
    pub fn size(&self) -> usize {
        self.unknowns.count + self.border
    }

    /// The symbolic factorization; `entries` are the columns and rows of the entries of which the lower triangle
    /// is summed.
    pub fn symbolic(
        &self,
        entries: impl FnOnce() -> Vec<[usize; 2]>,
    ) -> Result<&Arc<SymbolicFactorization>, DirectError> {
        let new = || SymbolicFactorization::new(self.size(), &entries()).map(Arc::new);
        let symbolic = self.symbolic.get_or_init(new);
        symbolic.as_ref().map_err(|&error| error)
    }
}

/// The first patterns with which the matrix of a leaf on a grid was factorized as a whole: they are those of all systems of
/// equations of this leaf. There are two where tips are coupled along some axes only, as indices are then counted with
/// fewer coupled unknowns than equations are solved with.
#[derive(Clone, Debug, Default)]
pub struct SharedPattern(Arc<[OnceLock<Arc<MatrixPattern>>; 2]>);

impl SharedPattern {
    /// The pattern of the matrix of these nodes, bordered by so many rows.
    pub fn of_matrix(&self, nodes: NumberedNodes, border: usize) -> Arc<MatrixPattern> {
        let new = || Arc::new(MatrixPattern::new(nodes, border));
        if border > 0 {
            // Families of leaves keep theirs.
            return new();
        }
        let mut kept = self.0.iter().map(|place| place.get_or_init(new));
        match kept.find(|kept| kept.is_of(nodes, border)) {
            Some(kept) => Arc::clone(kept),
            None => new(),
        }
    }
}

/// Pattern of a system of equations, with which the spare memory of its factors is freed.
#[derive(Clone, Debug)]
pub struct SystemPattern(pub SharedPattern);

impl Drop for SystemPattern {
    fn drop(&mut self) {
        for kept in self.0.0.iter().filter_map(OnceLock::get) {
            if let Some(Ok(symbolic)) = kept.symbolic.get() {
                symbolic.spare.clear();
            }
        }
    }
}

/// The symbolic factorization of a leaf's matrix, bordered or not.
#[derive(Debug)]
pub struct SymbolicFactorization {
    factors: SymbolicCholesky<usize>,
    /// The lower triangle, summed from entries in their order.
    pub lower: TrianglePattern,
    /// Number of unknowns, with those of the border.
    pub size: usize,
    /// Memory of factors that are needed no more.
    pub spare: SpareMemory,
}

/// Memory of factors and matrices that are needed no more, for the next ones of the same pattern: the system hands out new
/// pages cleared and one by one, which for fine grids takes a fifth of the time of a factorization.
#[derive(Debug, Default)]
pub struct SpareMemory(Mutex<Vec<Vec<f64>>>);

impl SpareMemory {
    /// So many numbers, of any value.
    pub fn take(&self, count: usize) -> Vec<f64> {
        let spare = self.0.lock().ok().and_then(|mut all| {
            let place = all.iter().position(|spare| spare.len() == count)?;
            Some(all.swap_remove(place))
        });
        spare.unwrap_or_else(|| vec![0.0; count])
    }

    fn clear(&self) {
        if let Ok(mut all) = self.0.lock() {
            all.clear();
        }
    }

    /// Keeps these numbers for the next that takes as many, unless some are kept already.
    pub fn keep(&self, numbers: Vec<f64>) {
        if let Ok(mut all) = self.0.lock()
            && all.iter().all(|spare| spare.len() != numbers.len())
        {
            all.push(numbers);
        }
    }
}

impl SymbolicFactorization {
    /// The symbolic factorization of a matrix with entries in these columns and rows of its lower triangle.
    fn new(size: usize, entries: &[[usize; 2]]) -> Result<Self, DirectError> {
        let lower = lower_triangle(size, entries);
        // If an ordering is given, faer reads the pattern of the upper triangle.
        let upper = lower.pattern.transpose().to_col_major();
        let upper = upper.map_err(|_| DirectError::Memory)?;
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let factors = factorize_symbolic_cholesky(
            upper.as_ref(),
            Side::Upper,
            SymmetricOrdering::Identity,
            params,
        )
        .map_err(|_| DirectError::Memory)?;
        let symbolic = SymbolicFactorization {
            factors,
            lower,
            size,
            spare: SpareMemory::default(),
        };
        memory::check_factor_memory(symbolic.factor_entry_count())
            .map_err(|_| DirectError::Memory)?;
        Ok(symbolic)
    }

    /// Number of stored entries of the factors.
    pub fn factor_entry_count(&self) -> usize {
        self.supernodes().len_val()
    }

    /// The supernodes of the factors.
    pub fn supernodes(&self) -> &supernodal::SymbolicSupernodalCholesky<usize> {
        match self.factors.raw() {
            SymbolicCholeskyRaw::Supernodal(symbolic) => symbolic,
            _ => unreachable!("supernodes are forced"),
        }
    }
}

/// The pattern of the lower triangle of a matrix that is a sum of entries.
#[derive(Debug)]
pub struct TrianglePattern {
    /// Rows of the nonzero entries of every column.
    pub pattern: SymbolicSparseColMat<usize>,
    /// Position in the pattern of each entry of the sum.
    pub places: Vec<usize>,
}

/// The pattern of a lower triangle with entries in these columns and rows, possibly repeated.
fn lower_triangle(size: usize, entries: &[[usize; 2]]) -> TrianglePattern {
    // Sorted by rows and then, in this order, by columns: the rows of each column ascend.
    let sorted = |by: usize, order: &mut dyn Iterator<Item = usize>| {
        let mut ends = vec![0; size + 1];
        entries.iter().for_each(|entry| ends[entry[by] + 1] += 1);
        for k in 0..size {
            ends[k + 1] += ends[k];
        }
        let mut sorted = vec![0; entries.len()];
        for k in order {
            let end = &mut ends[entries[k][by]];
            sorted[*end] = k;
            *end += 1;
        }
        (sorted, ends)
    };
    let (by_rows, _) = sorted(1, &mut (0..entries.len()));
    let (sorted, ends) = sorted(0, &mut by_rows.into_iter());
    let (mut starts, mut rows) = (vec![0], Vec::<usize>::new());
    let mut places = vec![0; entries.len()];
    let mut begin = 0;
    for &end in &ends[..size] {
        let column = &sorted[begin..end];
        begin = end;
        let start = rows.len();
        for &k in column {
            let row = entries[k][1];
            if rows[start..].last() != Some(&row) {
                rows.push(row);
            }
            places[k] = rows.len() - 1;
        }
        starts.push(rows.len());
    }
    TrianglePattern {
        pattern: SymbolicSparseColMat::new_checked(size, size, starts, None, rows),
        places,
    }
}
