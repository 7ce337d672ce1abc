//! A model that is as accurate as a search needs: on the coarsest grids on which the
//! data would not notice the difference.

use std::sync::Arc;

use rayon::prelude::*;

use super::FitError;
use super::case::{CaseAt, Component};
use super::least_squares::Weighing;
use super::model::{Model, Point, UNNOTICED};
use crate::relax::{Grids, LARGEST_TOLERANCE, Lost, Options};

/// Error of an iteration on them: of positions, in standard deviations.
const ITERATED: f64 = 10.0 * UNNOTICED;

/// Grids of a leaf at most.
const MOST_GRIDS: usize = 2;

impl<'a> Model<'a> {
    /// The same model on a few coarse grids, and its leaves there, from where this one
    /// has found them.
    pub fn rough(
        &self,
        accurate: &Point,
        weighing: Weighing,
    ) -> Result<(Model<'a>, Point), FitError> {
        let length = self.base.scenario().scale().length;
        let sd = |component: &Component| component.sd.unwrap_or(weighing.assumed);
        let least = accurate.components().map(sd).fold(f64::INFINITY, f64::min);
        let tolerance = (ITERATED * least / length).min(LARGEST_TOLERANCE);
        let model = Model {
            base: self.base,
            coordinates: self.coordinates,
            options: Options {
                tolerance: Some(tolerance.max(self.tolerance())),
                ..self.options.clone()
            },
            cases: Arc::clone(&self.cases),
            grids: Grids::These,
            linear: self.linear,
            changes: Arc::clone(&self.changes),
            additions: Arc::clone(&self.additions),
        };
        let coarse = |case: usize| -> Result<CaseAt, FitError> {
            let lost = |lost| self.no_equilibrium(case, &lost);
            let known = &accurate.cases[case];
            for count in 1..=MOST_GRIDS {
                let Some(at) = known.at.coarsest(count) else {
                    break;
                };
                let found = CaseAt::new(&self.cases[case], case, at).map_err(lost)?;
                let mut both = found.components.iter().zip(&known.components);
                if both.all(|(a, b)| (a.model - b.model).abs() < UNNOTICED * sd(b)) {
                    return Ok(found);
                }
            }
            CaseAt::new(&self.cases[case], case, known.at.clone()).map_err(lost)
        };
        let cases = (0..self.cases.len()).into_par_iter().map(coarse);
        let cases = cases.collect::<Result<_, _>>()?;
        let theta = accurate.theta.clone();
        Ok((model, Point { theta, cases }))
    }

    /// The leaves at rest from where relaxations start, beyond the place where one of
    /// `before` would have to jump; or there, if it can be in another equilibrium. `None`
    /// where the data are no nearer.
    pub fn beyond(&self, theta: &[f64], before: &Point, weighing: Weighing) -> Option<Point> {
        let residuals = weighing.residuals(before);
        let bound = weighing.bound(&residuals);
        let sum = weighing.sum(&residuals, bound);
        [theta, before.theta.as_slice()]
            .into_iter()
            .find_map(|theta| {
                let (there, _) = self.find(theta).ok()?;
                let nearer = weighing.sum(&weighing.residuals(&there), bound) < sum;
                nearer.then_some(there)
            })
    }

    /// The leaves of a point of another model, as accurate as this one wants them.
    pub fn refined(&self, point: &Point) -> Result<Point, Lost> {
        self.follow(point, &point.theta)
    }
}
