//! Extrapolation over nested grids, and its error estimate.

/// The largest ratio of successive corrections at which extrapolation is
/// trusted: the first should be 1/4 on a clean ds^2 series.
const CLEAN_RATIO: std::ops::Range<f64> = 0.17..0.36;

/// Safety factor of the error estimate.
const SAFETY: f64 = 3.0;

/// The column of a table that is believed, and its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Best {
    /// Terms of the ds^2 series removed.
    pub columns: usize,
    /// Estimate of the largest error of any value.
    pub error: f64,
}

/// Values on successively halved grids, extrapolated over the series in ds^2.
#[derive(Clone, Debug, Default)]
pub struct Richardson {
    /// Rows of the table, one per grid; column m has the terms up to ds^(2m) removed.
    table: Vec<Vec<Vec<f64>>>,
}

impl Richardson {
    /// Adds the values of the next finer grid.
    pub fn push(&mut self, values: Vec<f64>) {
        let mut row = vec![values];
        if let Some(coarser) = self.table.last() {
            let mut power = 1.0;
            for column in coarser {
                power *= 4.0;
                let finer = row.last().expect("row has a first column");
                let next = finer
                    .iter()
                    .zip(column)
                    .map(|(f, c)| f + (f - c) / (power - 1.0))
                    .collect();
                row.push(next);
            }
        }
        self.table.push(row);
    }

    /// The best column on the finest grid and the estimate of its largest
    /// error, `scale` being the size of the solution. `None` before there are two grids.
    ///
    /// With D_m the change that column m makes on the finest grid, the error
    /// of column m - 1, successive D_m of a clean series shrink ever less
    /// quickly, each by a factor no smaller than the square of the next. So
    /// the last column's error is estimated as D_m sqrt(D_m / D_{m-1}), with
    /// `scale` for D_0, times a safety factor. Where the series is not clean
    /// (the grids do not resolve the solution yet) the finest grid itself is
    /// returned, with the last change as its error.
    pub fn best(&self, scale: f64) -> Option<Best> {
        let row = self.table.last()?;
        let grids = self.table.len();
        let coarser = self.table.get(grids.checked_sub(2)?)?;
        let change = distance(&row[0], &coarser[0]);
        let mut best = Best {
            columns: 0,
            error: change,
        };
        if let Some(coarsest) = grids.checked_sub(3).map(|k| &self.table[k]) {
            let ratio = change / distance(&coarser[0], &coarsest[0]);
            if !CLEAN_RATIO.contains(&ratio) && change > 1e-13 * scale {
                return Some(best);
            }
        }
        let mut last = scale;
        for m in 1..row.len() {
            let correction = distance(&row[m], &row[m - 1]);
            let estimate = SAFETY * correction * (correction / last).sqrt().min(1.0);
            if estimate > best.error || correction > last {
                break;
            }
            best = Best {
                columns: m,
                error: estimate,
            };
            last = correction;
        }
        Some(best)
    }

    /// The finest grid's values with `columns` terms of the series removed;
    /// zero: the plain ones.
    pub fn column(&self, columns: usize) -> &[f64] {
        let row = self.table.last().expect("a table that is asked has a grid");
        &row[columns.min(row.len() - 1)]
    }
}

/// Largest distance between the points of which the values are components,
/// three by three: a measure that does not depend on the axes.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    let square =
        |(a, b): (&[f64], &[f64])| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
    a.chunks(3)
        .zip(b.chunks(3))
        .map(square)
        .fold(0.0, f64::max)
        .sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(f: impl Fn(f64) -> f64, grids: usize) -> Richardson {
        let mut table = Richardson::default();
        for k in 0..grids {
            table.push(vec![f(0.5_f64.powi(k as i32 + 2)), 0.0, 0.0]);
        }
        table
    }

    #[test]
    fn a_series_in_even_powers_is_extrapolated_and_its_error_bounded() {
        let f = |h: f64| 1.0 + 0.3 * (h * h) / (1.0 + h * h);
        for grids in 3..6 {
            let table = table(f, grids);
            let best = table.best(1.0).unwrap();
            let error = (table.column(best.columns)[0] - 1.0).abs();
            assert_eq!(best.columns, grids - 1);
            assert!(
                error <= best.error && best.error < 1e3 * error,
                "{error} {}",
                best.error
            );
        }
    }

    #[test]
    fn a_first_order_series_is_not_extrapolated() {
        let table = table(|h| 1.0 + h, 4);
        let best = table.best(1.0).unwrap();
        assert_eq!(best.columns, 0);
        assert!(best.error >= 0.5_f64.powi(5));
    }
}
