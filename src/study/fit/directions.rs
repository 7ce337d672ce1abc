//! Singular directions of derivatives, and quantiles of Student's distribution.

use nalgebra::DMatrix;

/// Singular values below this part of the largest belong to combinations to which the data are
/// insensitive; derivatives are more accurate than that.
pub(super) const NULL: f64 = 1e-7;

/// Components of a combination smaller than this part of its largest are set to zero.
const NEGLIGIBLE: f64 = 1e-3;

/// Half width of a 95 % interval of a normal variable, in standard deviations.
pub(super) const NORMAL: f64 = 1.959_963_984_540_054;

/// Singular values, ascending, and their right singular vectors as columns.
pub(super) fn singular(jacobian: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
    let count = jacobian.ncols();
    if jacobian.nrows() > 2 * count {
        // For many rows: those of the triangular factor, which are the same.
        return singular(&jacobian.clone().qr().r());
    }
    // Padded with zero rows, there are as many values as columns.
    let rows = jacobian.nrows().max(count);
    let square = jacobian.clone().resize_vertically(rows, 0.0);
    let svd = square.svd(false, true);
    let rows = svd.v_t.unwrap_or_else(|| DMatrix::identity(count, count));
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|a, b| svd.singular_values[*a].total_cmp(&svd.singular_values[*b]));
    let values = order.iter().map(|&k| svd.singular_values[k]).collect();
    let directions = DMatrix::from_fn(count, count, |r, c| rows[(order[c], r)]);
    (values, directions)
}

/// A basis of a space of directions with as many zero components as possible:
/// its reduced row echelon form.
pub(super) fn sparse(space: &DMatrix<f64>) -> Vec<Vec<(usize, f64)>> {
    let mut rows = space.transpose();
    let (count, width) = rows.shape();
    let mut pivots: Vec<usize> = Vec::new();
    for row in 0..count {
        let free = (0..width).filter(|k| !pivots.contains(k));
        let largest = free
            .flat_map(|k| (row..count).map(move |r| (r, k)))
            .max_by(|a, b| rows[*a].abs().total_cmp(&rows[*b].abs()));
        let Some((from, column)) = largest else { break };
        rows.swap_rows(row, from);
        pivots.push(column);
        let pivot = rows[(row, column)];
        rows.row_mut(row).scale_mut(1.0 / pivot);
        let own = rows.row(row).into_owned();
        for other in (0..count).filter(|other| *other != row) {
            let part = rows[(other, column)];
            let mut target = rows.row_mut(other);
            target -= &own * part;
        }
    }
    let parts = |row: usize| {
        let largest = rows.row(row).amax();
        let all = (0..width).map(|k| (k, rows[(row, k)] / largest));
        all.filter(|(_, part)| part.abs() > NEGLIGIBLE).collect()
    };
    let mut all: Vec<Vec<(usize, f64)>> = (0..count).map(parts).collect();
    all.sort_by_key(|parts| parts.first().map_or(0, |part| part.0));
    all
}

/// Half width of a 95 % interval in standard deviations that are estimated with this number of
/// degrees of freedom (Student's distribution; Abramowitz and Stegun, Handbook of Mathematical
/// Functions, 26.7.5).
pub(super) fn student(freedom: usize) -> f64 {
    const FEW: [f64; 4] = [12.706_2, 4.302_7, 3.182_4, 2.776_4];
    if let Some(quantile) = FEW.get(freedom.wrapping_sub(1)) {
        return *quantile;
    }
    let (z, n) = (NORMAL, freedom as f64);
    let z2 = z * z;
    z + z * (z2 + 1.0) / (4.0 * n)
        + z * (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / (96.0 * n * n)
        + z * (3.0 * z2.powi(3) + 19.0 * z2 * z2 + 17.0 * z2 - 15.0) / (384.0 * n.powi(3))
        + z * (79.0 * z2.powi(4) + 776.0 * z2.powi(3) + 1482.0 * z2 * z2 - 1920.0 * z2 - 945.0)
            / (92160.0 * n.powi(4))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles of tables of Student's distribution.
    #[test]
    fn quantiles_of_students_distribution() {
        for (freedom, quantile) in [
            (1, 12.7062),
            (4, 2.7764),
            (5, 2.5706),
            (10, 2.2281),
            (30, 2.0423),
            (1_000_000, 1.9600),
        ] {
            assert!((student(freedom) - quantile).abs() < 5e-4, "{freedom}");
        }
    }

    #[test]
    fn a_space_of_directions_has_a_sparse_basis() {
        // Spanned by (1, 1, 0, 0) and (0, 0, 1, -2), mixed.
        let space = DMatrix::from_column_slice(4, 2, &[1.0, 1.0, 1.0, -2.0, 2.0, 2.0, -1.0, 2.0]);
        let basis = sparse(&space);
        assert!(basis[0].iter().map(|part| part.0).eq([0, 1]));
        assert!((basis[0][0].1 - basis[0][1].1).abs() < 1e-12);
        assert!((basis[1][0].1 + 0.5).abs() < 1e-12 && basis[1][1].1 == 1.0);
    }

    #[test]
    fn rows_fewer_than_columns_leave_directions_unfelt() {
        let (values, directions) = singular(&DMatrix::from_row_slice(1, 2, &[3.0, 4.0]));
        assert!(values[0] < 1e-12 && (values[1] - 5.0).abs() < 1e-12);
        let insensitive = directions.column(0);
        assert!((3.0 * insensitive[0] + 4.0 * insensitive[1]).abs() < 1e-12);
    }
}
