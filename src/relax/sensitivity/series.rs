//! Derivatives on successively refined grids.

use crate::relax::richardson::Richardson;
use glam::DVec3;

/// Safety factor on the error estimate: errors of derivatives decrease less regularly than
/// those of positions.
const SAFETY: f64 = 3.0;

/// Relative errors by rounding, and by unfinished iterations as a part of the tolerance.
const ROUNDING: f64 = 1e-10;
const UNFINISHED: f64 = 0.1;

/// Values on successively refined grids, extrapolated together.
pub(super) struct Series {
    segments: Vec<usize>,
    values: Vec<Vec<DVec3>>,
}

impl Series {
    pub fn new() -> Self {
        Series {
            segments: Vec::new(),
            values: Vec::new(),
        }
    }

    pub fn push(&mut self, segments: usize, values: Vec<DVec3>) {
        self.segments.push(segments);
        self.values.push(values);
    }

    /// The same if there are as many values as before: not all are known on every grid.
    pub fn push_if_complete(&mut self, segments: usize, values: Vec<DVec3>) {
        let alike = self
            .values
            .last()
            .is_none_or(|last| last.len() == values.len());
        if !values.is_empty() && alike {
            self.push(segments, values);
        }
    }

    /// The extrapolated values, and a common error bound.
    pub fn extrapolated(&self, tolerance: f64) -> (Vec<DVec3>, Option<f64>) {
        let all = self.values.iter().flatten();
        let unit = all.fold(0.0_f64, |m, v| m.max(v.abs().max_element()));
        let count = self.values.last().map_or(0, Vec::len);
        if unit == 0.0 || count == 0 {
            let error = (self.segments.len() > 1).then_some(0.0);
            return (vec![DVec3::ZERO; count], error);
        }
        let mut table = Richardson::default();
        for (segments, values) in self.segments.iter().zip(&self.values) {
            let numbers = values.iter().flat_map(|v| (*v / unit).to_array());
            table.push(*segments, numbers.collect());
        }
        let best = table.best();
        let column = table.column(best.map_or(0, |best| best.columns));
        let values = column.chunks(3).map(|v| DVec3::from_slice(v) * unit);
        (
            values.collect(),
            best.map(|best| (SAFETY * best.error + ROUNDING + UNFINISHED * tolerance) * unit),
        )
    }
}
