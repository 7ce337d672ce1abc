//! Response of a leaf at rest to changes of the free numbers.

use std::sync::{Mutex, PoisonError};

use crate::leaf::{Forces, LeafRate, Response};
use crate::relax::{Level, Linearized, Lost, NestedEquilibrium};

/// Relative accuracy of the predicted state from which a leaf is relaxed.
const PREDICTED: f64 = 1e-3;

/// The linearised equations of a leaf at rest on every grid, and the force rates of the free
/// numbers.
pub(super) struct Responses {
    linear: Mutex<Vec<Linearized>>,
    /// Force rates of each number on every grid.
    forces: Vec<Vec<Forces>>,
    /// Response to each number on every grid; empty if the adjoint equations are solved for the
    /// data, since these are fewer.
    pub each: Vec<Vec<Response>>,
}

fn singular() -> Lost {
    Lost::NotAtRest("the leaf is at a singular point".into())
}

impl Responses {
    /// The linearised equations at a leaf at rest.
    pub fn new(at: &NestedEquilibrium, rates: &[LeafRate], tolerance: f64) -> Responses {
        let linear = at.levels.iter();
        let linear: Vec<_> = linear
            .map(|level| Linearized::new(level, tolerance))
            .collect();
        let forces = linear.iter().zip(&at.levels);
        Responses {
            forces: forces
                .map(|(linear, level)| linear.forces(level, rates))
                .collect(),
            linear: Mutex::new(linear),
            each: Vec::new(),
        }
    }

    /// Solves them for each number.
    pub fn solve_each(&mut self, levels: &[Level]) -> Result<(), Lost> {
        let count = self.forces.first().map_or(0, Vec::len);
        let mut all = vec![Vec::new(); count];
        let linear = self
            .linear
            .get_mut()
            .unwrap_or_else(PoisonError::into_inner);
        for ((level, linear), forces) in levels.iter().zip(linear).zip(&self.forces) {
            let responses = linear.responses(level, forces).ok_or_else(singular)?;
            for (all, answer) in all.iter_mut().zip(responses) {
                all.push(answer);
            }
        }
        self.each = all;
        Ok(())
    }

    /// Derivatives of results on one grid with respect to each number, if the results are adjoint
    /// to unit forces on the leaf: by one solution per result.
    pub fn by_results(
        &self,
        (k, level): (usize, &Level),
        units: &[Forces],
    ) -> Result<Vec<Vec<f64>>, Lost> {
        let mut all = self.linear.lock().unwrap_or_else(PoisonError::into_inner);
        let linear = &mut all[k];
        let responses = linear.responses(level, units).ok_or_else(singular)?;
        let rates = |answer| {
            let forces = self.forces[k].iter();
            forces
                .map(|force| linear.work(level, force, answer))
                .collect()
        };
        Ok(responses.iter().map(rates).collect())
    }

    /// The response on each of these grids to steps of the numbers.
    pub fn to(&self, levels: &[Level], steps: &[f64]) -> Result<Vec<Response>, Lost> {
        let on = |(k, level): (usize, &Level)| {
            if !self.each.is_empty() {
                let mut sum = Response::zeros(&level.leaf);
                for (responses, step) in self.each.iter().zip(steps) {
                    sum.add(*step, &responses[k]);
                }
                return Ok(sum);
            }
            let mut sum = Forces::zeros(level.leaf.rods());
            for (forces, step) in self.forces[k].iter().zip(steps) {
                sum.add(*step, forces);
            }
            let mut all = self.linear.lock().unwrap_or_else(PoisonError::into_inner);
            let answer = all[k].responses_to(level, &[sum], PREDICTED);
            let answer = answer.ok_or_else(singular)?;
            answer.into_iter().next().ok_or_else(singular)
        };
        levels.iter().enumerate().map(on).collect()
    }
}
