//! Extrapolation over nested grids, and its error estimate.

use crate::numbers::{larger, largest};

/// When a column of a table shows the order of its error. The numbers here and in [`SAFETY`] were set
/// on some 700 runs: random leaves, the paper's, textbook problems, boundary layers.
struct OrderTest {
    /// A column of order p is extrapolated further only if its changes from grid to grid shrink by
    /// 2^p, or nearly so: at most this many times less.
    slack: f64,
    /// Changes of the first column that shrink to less than this part of what its order indicates
    /// are not those of a ds^2 series either.
    smallest_first_ratio: f64,
    /// A further column is rejected if it changes the values by more than this part of the change
    /// by the column before it: it has nothing left to remove.
    useless_column_ratio: f64,
    /// Ratios of the last two changes of a column between which they shrink in proportion: as those of an error
    /// between the orders 1.5 and 3.5.
    least_shrinking: f64,
    most_shrinking: f64,
}

const ORDER: OrderTest = OrderTest {
    slack: 1.5,
    smallest_first_ratio: 0.68,
    useless_column_ratio: 0.1,
    least_shrinking: 0.09,
    most_shrinking: 0.35,
};

/// Safety factors of the errors that the last changes of a table tell.
struct ExtrapolationSafety {
    /// Factor on the last change of a column without a proven order.
    unproven_order: f64,
    /// Slope of the safety factor on the last correction over the root of the ratio of the last two.
    slope: f64,
    /// The least factor on the last correction, and the largest.
    least: f64,
    most: f64,
    /// Factor on the corrections of few numbers, each weighted by the part of it that those after it must
    /// reach: of 1,800 forces, moments and energies of random leaves the largest error was 4.6
    /// times the largest of the corrections so weighted.
    few_values: f64,
    few_values_part: f64,
}

const SAFETY: ExtrapolationSafety = ExtrapolationSafety {
    unproven_order: 3.0,
    slope: 30.0,
    least: 1.3,
    most: 10.0,
    few_values: 5.0,
    few_values_part: 1.0 / 32.0,
};

/// Changes below this, relative to the leaf's length, are rounding.
const ROUNDING: f64 = 1e-13;

/// Largest number of grids over which single numbers are extrapolated: errors on coarser ones, which the
/// finest have no more, need not be small.
pub const EXTRAPOLATED_GRIDS: usize = 4;

/// The selected column of a table, and its error estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BestColumn {
    /// Terms of the ds^2 series removed.
    pub columns: usize,
    /// Estimate of the largest error of any value.
    pub error: f64,
}

/// An extrapolated value with a bound on its error, which is unknown on a single grid.
pub struct Extrapolated<T> {
    pub value: T,
    pub error: Option<f64>,
}

/// Values on successively refined grids, extrapolated over the series in ds^2.
#[derive(Clone, Debug, Default)]
pub struct Richardson {
    /// Rows of the table, one per grid; column m has the terms up to ds^(2m) removed.
    table: Vec<Vec<Vec<f64>>>,
    /// Segments of each grid, from coarse to fine.
    segments: Vec<usize>,
    /// Changes below this are rounding, if it is more than [`ROUNDING`].
    noise: f64,
}

impl FromIterator<(usize, Vec<f64>)> for Richardson {
    /// From the segments of each grid, coarse to fine, and the values there.
    fn from_iter<I: IntoIterator<Item = (usize, Vec<f64>)>>(grids: I) -> Self {
        let mut table = Richardson::default();
        for (segments, values) in grids {
            table.push(segments, values);
        }
        table
    }
}

impl Richardson {
    /// Adds the values of the next finer grid, which has `segments` segments.
    pub fn push(&mut self, segments: usize, values: Vec<f64>) {
        let mut row = vec![values];
        if let Some(coarser) = self.table.last() {
            // Column m joins this grid with the one m + 1 before it.
            for (column, other) in coarser.iter().zip(self.segments.iter().rev()) {
                let power = (segments as f64 / *other as f64).powi(2);
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
        self.segments.push(segments);
    }

    /// The table, of values with rounding errors of this size.
    pub fn with_noise(self, noise: f64) -> Self {
        Richardson { noise, ..self }
    }

    /// The best column on the finest grid and the estimate of its largest
    /// error. `None` before there are two grids.
    ///
    /// Let D_m be the change by column m on the finest grid: it is the error of column m - 1.
    /// For a clean series the error of column m is a small part of D_m, the smaller the ratio
    /// D_m/D_{m-1} the smaller; the estimate is D_m times a safety factor that rises with
    /// sqrt(D_m/D_{m-1}). Where the first column is not of second order (the
    /// grids do not resolve the solution yet) the finest grid itself is returned, its last
    /// change as error.
    pub fn best(&self) -> Option<BestColumn> {
        let row = self.table.last()?;
        let before = &self.table[self.table.len().checked_sub(2)?];
        let last = row.len() - 1;
        let correction = |m: usize| self.correction(m);
        let mut columns = self.proven_columns();
        if columns == 0 {
            return Some(BestColumn {
                columns,
                error: distance(&row[0], &before[0]),
            });
        }
        while columns > 1
            && correction(columns) > ORDER.useless_column_ratio * correction(columns - 1)
        {
            columns -= 1;
        }
        if columns < last {
            // Its order is not confirmed: the error estimate is its last change, or the sum of all that are to come if
            // they shrink, though not as those of a ds^2 series.
            let error = self.shrinking_remainder(columns).unwrap_or_else(|| {
                let change = distance(&row[columns], &before[columns]);
                larger(
                    change,
                    SAFETY.most / SAFETY.unproven_order * correction(columns),
                )
            });
            let error = SAFETY.unproven_order * error;
            return Some(BestColumn { columns, error });
        }
        // With two grids the only reference is the size of the leaf, one.
        let previous = if last > 1 { correction(last - 1) } else { 1.0 };
        let ratio = correction(last) / previous.max(ROUNDING);
        let safety = (SAFETY.slope * ratio.sqrt()).clamp(SAFETY.least, SAFETY.most);
        Some(BestColumn {
            columns,
            error: larger(0.0, safety * correction(last)),
        })
    }

    /// The sum of the changes of column `m` on all finer grids, if they go on shrinking as the last two do, in
    /// proportion; `None` if they hardly shrink, or there are less than two.
    fn shrinking_remainder(&self, m: usize) -> Option<f64> {
        let [.., coarse, before, row] = self.table.as_slice() else {
            return None;
        };
        let first = distance(before.get(m)?, coarse.get(m)?);
        // One that is small by chance says less than the one before it.
        let last = larger(distance(&row[m], &before[m]), ORDER.least_shrinking * first);
        let ratio = last / first;
        (ratio < ORDER.most_shrinking).then_some(last * ratio / (1.0 - ratio))
    }

    /// The error of the best column of a few numbers that are all of one size, such as the parts of a
    /// force: sharper than that of the positions of many nodes, whose largest changes from column to
    /// column may be those of other nodes. Of a clean series the last correction is
    /// some twenty times the error; a single one may be small by chance, but then a part of those before
    /// it is not.
    pub fn few_values_error(&self) -> Option<BestColumn> {
        let best = self.best()?;
        if best.columns == 0 || best.columns + 1 < self.table.len() {
            return Some(best);
        }
        let error =
            SAFETY.few_values * self.largest_correction(best.columns, SAFETY.few_values_part);
        Some(BestColumn { error, ..best })
    }

    /// The largest of the corrections on the finest grid by the first so many `columns`, of each
    /// this `part` for every column after it.
    pub fn largest_correction(&self, columns: usize, part: f64) -> f64 {
        let corrections = (1..=columns).rev().zip(0..);
        largest(corrections.map(|(m, after)| part.powi(after) * self.correction(m)))
    }

    /// Terms of the series that may be removed, as the changes from grid to grid of all columns
    /// before show their orders.
    pub fn proven_columns(&self) -> usize {
        let Some(last) = self.table.len().checked_sub(1) else {
            return 0;
        };
        let shows_none = |m: &usize| {
            let change = self.change(*m);
            let before = distance(&self.table[last - 1][*m], &self.table[last - 2][*m]);
            let (ratio, order) = (change / before, self.expected_change_ratio(*m));
            let least = ORDER.smallest_first_ratio * order;
            change > self.noise.max(ROUNDING)
                && (ratio > ORDER.slack * order || *m == 0 && ratio < least)
        };
        (0..last.saturating_sub(1)).find(shows_none).unwrap_or(last)
    }

    /// The last change of a column from grid to grid.
    fn change(&self, m: usize) -> f64 {
        let last = self.table.len() - 1;
        distance(&self.table[last][m], &self.table[last - 1][m])
    }

    /// The last change from grid to grid of the column with one term less removed than the best one; zero if
    /// there is none.
    pub fn change_of_column_before_best(&self) -> f64 {
        match self.best_column_number() {
            0 => 0.0,
            best => self.change(best - 1),
        }
    }

    /// The last change of the column with so many terms removed, if the best one has more; else
    /// zero.
    pub fn change_beyond(&self, columns: usize) -> f64 {
        match columns < self.best_column_number() {
            true => self.change(columns),
            false => 0.0,
        }
    }

    /// Terms of the series that the best column has removed; none before there are two grids.
    pub fn best_column_number(&self) -> usize {
        self.best().map_or(0, |best| best.columns)
    }

    /// The values of the best column.
    pub fn extrapolated(&self) -> &[f64] {
        self.column(self.best_column_number())
    }

    /// The change by column `m`, from 1, on the finest grid.
    pub fn correction(&self, m: usize) -> f64 {
        let row = self.table.last().expect("a table that is asked has a grid");
        distance(&row[m], &row[m - 1])
    }

    /// The change from grid to grid of the values that are not extrapolated before their last one;
    /// zero if there is none.
    pub fn change_before(&self) -> f64 {
        match self.table.as_slice() {
            [.., coarse, before, _] => distance(&before[0], &coarse[0]),
            _ => 0.0,
        }
    }

    /// Expected ratio of the last two changes of column `m` from grid to grid, if its error is
    /// proportional to the first remaining term: to the product of ds^2 of the grids it
    /// combines.
    fn expected_change_ratio(&self, m: usize) -> f64 {
        let last = self.segments.len() - 1;
        let unit = self.segments[last] as f64;
        let error = |grid: usize| -> f64 {
            let joined = &self.segments[grid - m..=grid];
            joined.iter().map(|&n| (unit / n as f64).powi(2)).product()
        };
        (error(last) - error(last - 1)) / (error(last - 1) - error(last - 2))
    }

    /// The finest grid's values with `columns` terms of the series removed;
    /// zero: the plain ones.
    pub fn column(&self, columns: usize) -> &[f64] {
        let row = self.table.last().expect("a table that is asked has a grid");
        &row[columns.min(row.len() - 1)]
    }
}

/// Largest distance between points whose components are three consecutive values each:
/// invariant under rotation of the axes. Infinite if one is not a number.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    let square =
        |(a, b): (&[f64], &[f64])| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
    largest(a.chunks(3).zip(b.chunks(3)).map(square)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(f: impl Fn(f64) -> f64, grids: usize) -> Richardson {
        let mut table = Richardson::default();
        for k in 0..grids {
            let h = 0.5_f64.powi(k as i32 + 2);
            table.push(1 << k, vec![f(h), 0.0, 0.0]);
        }
        table
    }

    #[test]
    fn a_series_in_even_powers_is_extrapolated_and_its_error_bounded() {
        let f = |h: f64| 1.0 + 0.3 * (h * h) / (1.0 + h * h);
        for grids in 3..6 {
            let table = table(f, grids);
            let best = table.best().unwrap();
            let error = (table.column(best.columns)[0] - 1.0).abs();
            assert_eq!(best.columns, grids - 1);
            let told = best.error;
            assert!(error <= told && told < 1e3 * error, "{error} {told}");
        }
    }

    /// A value that could not be computed has no small error.
    #[test]
    fn what_is_not_a_number_is_far_away() {
        assert_eq!(distance(&[0.0; 6], &[0.0, 0.0, 1.0, 0.0, 2.0, 0.0]), 2.0);
        let lost = [0.0, 0.0, 1.0, f64::NAN, 0.0, 0.0];
        assert_eq!(distance(&[0.0; 6], &lost), f64::INFINITY);
        let mut table = table(|h| 1.0 + h * h, 2);
        table.push(4, vec![f64::NAN, 0.0, 0.0]);
        assert_eq!(table.best().map(|best| best.error), Some(f64::INFINITY));
    }

    #[test]
    fn a_first_order_series_is_not_extrapolated() {
        let table = table(|h| 1.0 + h, 4);
        let best = table.best().unwrap();
        assert_eq!(best.columns, 0);
        assert!(best.error >= 0.5_f64.powi(5));
    }
}
