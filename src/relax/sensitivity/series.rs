//! Derivatives on successively refined grids.

use crate::relax::accuracy::richardson::{Best, Richardson};
use glam::DVec3;

/// Safety factor on the error estimate: errors of derivatives decrease less regularly than
/// those of positions.
const SAFETY: f64 = 3.0;

/// Relative errors by rounding, and by unfinished iterations as a part of the tolerance.
const ROUNDING: f64 = 1e-10;
const UNFINISHED: f64 = 0.1;

/// Values on successively refined grids, extrapolated together.
#[derive(Default)]
pub(super) struct Series(Vec<(usize, Vec<DVec3>)>);

impl Series {
    /// Adds the values on a grid of so many segments, if there are as many as before: not all
    /// are known on every grid.
    pub fn push(&mut self, segments: usize, values: Vec<DVec3>) {
        let last = self.0.last();
        let alike = last.is_none_or(|(_, last)| last.len() == values.len());
        if !values.is_empty() && alike {
            self.0.push((segments, values));
        }
    }

    /// The extrapolated values, and a common error bound.
    pub fn extrapolated(&self, tolerance: f64) -> (Vec<DVec3>, Option<f64>) {
        let all = self.0.iter().flat_map(|(_, values)| values);
        let unit = all.fold(0.0_f64, |m, v| m.max(v.abs().max_element()));
        let count = self.0.last().map_or(0, |(_, values)| values.len());
        if unit == 0.0 || count == 0 {
            let error = (self.0.len() > 1).then_some(0.0);
            return (vec![DVec3::ZERO; count], error);
        }
        let on = |(segments, values): &(usize, Vec<DVec3>)| {
            let numbers = values.iter().flat_map(|v| (*v / unit).to_array());
            (*segments, numbers.collect())
        };
        let table: Richardson = self.0.iter().map(on).collect();
        let values = table.extrapolated().chunks(3);
        let error = |best: Best| (SAFETY * best.error + ROUNDING + UNFINISHED * tolerance) * unit;
        (
            values.map(|v| DVec3::from_slice(v) * unit).collect(),
            table.best().map(error),
        )
    }
}
