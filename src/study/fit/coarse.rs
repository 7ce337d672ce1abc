//! A model with the accuracy of a search: on the coarsest grids whose error is insignificant
//! relative to the data.

use super::FitError;
use super::case::{CaseAt, Component};
use super::least_squares::Weighting;
use super::model::{INSIGNIFICANT, Model, Point};
use super::quantity::Kind;
use crate::relax::{Grids, LARGEST_TOLERANCE, Options};

/// Error of an iteration on them: of positions, in standard deviations.
const ITERATED: f64 = 10.0 * INSIGNIFICANT;

/// Largest number of grids of a leaf.
const MOST_GRIDS: usize = 2;

/// Values, of those at which a leaf would have to jump, at which it is relaxed again.
const FARTHEST_JUMPS: usize = 3;

impl<'a> Model<'a> {
    /// The same model on a few coarse grids, and its leaves there, started from those of
    /// this one.
    pub fn coarse(
        &self,
        accurate: &Point,
        weighting: Weighting,
    ) -> Result<(Model<'a>, Point), FitError> {
        let length = self.base.scenario().scale().length;
        let sd = |component: &Component| component.sd.unwrap_or(weighting.assumed);
        let in_lengths = |component: &Component| match component.what.kind() {
            Kind::Pixel => sd(component) * self.pixel(),
            _ => sd(component),
        };
        let all = accurate.components().map(in_lengths);
        let least = all.fold(f64::INFINITY, f64::min);
        let tolerance = (ITERATED * least / length).min(LARGEST_TOLERANCE);
        let model = Model {
            options: Options {
                tolerance: Some(tolerance.max(self.tolerance())),
                ..self.options.clone()
            },
            grids: Grids::These,
            ..self.clone()
        };
        let coarse = |case: usize| -> Result<CaseAt, FitError> {
            let lost = |lost| self.no_equilibrium(&accurate.theta, case, &lost);
            let known = &accurate.cases[case];
            for count in 1..=MOST_GRIDS {
                let Some(at) = known.at.coarsest(count) else {
                    break;
                };
                let found = self.case_at(case, &accurate.theta, at).map_err(lost)?;
                let mut both = found.components.iter().zip(&known.components);
                if both.all(|(a, b)| (a.model - b.model).abs() < INSIGNIFICANT * sd(b)) {
                    return Ok(found);
                }
            }
            self.case_at(case, &accurate.theta, known.at.grids())
                .map_err(lost)
        };
        let point = self.point(&accurate.theta, coarse)?;
        Ok((model, point))
    }

    /// The leaves relaxed from their usual starts, beyond the values at which one of
    /// `before` would have to jump; or there, if another equilibrium exists. `None`
    /// if that does not reduce the residuals.
    pub fn beyond(
        &self,
        jumps: &[Vec<f64>],
        before: &Point,
        weighting: Weighting,
    ) -> Option<Point> {
        let residuals = weighting.residuals(before);
        let bound = weighting.bound(&residuals);
        let sum = weighting.sum(&residuals, bound);
        // The farthest are the steps that the data ask for; close to where a leaf buckles none is followed.
        let far = jumps.iter().take(FARTHEST_JUMPS);
        let near = jumps.iter().skip(FARTHEST_JUMPS).next_back();
        far.chain(near).chain([&before.theta]).find_map(|theta| {
            let there = self.find(theta).ok()?;
            let nearer = weighting.sum(&weighting.residuals(&there), bound) < sum;
            nearer.then_some(there)
        })
    }
}
