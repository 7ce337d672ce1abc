//! The response of leaves at rest to changes of the free numbers, and the derivatives of the
//! components of a point.

use std::sync::{Mutex, OnceLock, PoisonError};

use rayon::prelude::*;

use super::case::{CaseAt, Compared, Component};
use super::model::{Change, Model, Point};
use super::quantity::Quantity;
use crate::leaf::{Forces, Leaf, LeafRate, Response};
use crate::relax::{AtRest, Grids, Level, Linearized, Lost, Number};
use crate::scenario::Scenario;

/// Derivatives in a search have the accuracy of those of a leaf with this tolerance.
const OF_SEARCH: f64 = 1e-5;

/// Relative accuracy of the predicted state from which a leaf is relaxed.
const PREDICTED: f64 = 1e-3;

impl Model<'_> {
    /// Computes the derivatives of a point's components with respect to the coordinates.
    pub fn differentiate(&self, point: &mut Point) -> Result<(), Lost> {
        let theta = point.theta.clone();
        let shared = OnceLock::new();
        let each =
            |(case, at): (usize, &mut CaseAt)| self.differentiate_case((case, at), &theta, &shared);
        let cases = point.cases.par_iter_mut().enumerate();
        cases.map(each).collect()
    }

    /// The same for one leaf. Leaves that differ by loads only share their derivatives.
    fn differentiate_case<'s>(
        &'s self,
        (case, found): (usize, &mut CaseAt),
        theta: &[f64],
        shared: &OnceLock<Vec<LeafRate<'s>>>,
    ) -> Result<(), Lost> {
        if found.responses.is_some() {
            return Ok(());
        }
        let of = &self.cases[case];
        let fixed = self.values(of, theta);
        let first = fixed.len() - theta.len();
        let made: Vec<_> = (0..theta.len())
            .map(|k| {
                let fixed = &fixed;
                move |value: f64| -> Option<Scenario> {
                    let mut values = fixed.clone();
                    values[first + k].1 = value;
                    Some(self.base.at(&values).ok()?.scenario)
                }
            })
            .collect();
        let numbers: Vec<Number> = (self.coordinates.iter().zip(theta).zip(&made))
            .map(|((free, theta), make)| Number {
                make,
                value: free.value(*theta),
                unit: free.unit,
                linear: free.keys.is_linear(),
            })
            .collect();
        let changes = || -> Option<Vec<Change>> { numbers.iter().map(Number::rate).collect() };
        let at_limit = || Lost::NotAtRest("a number is at the limit of what it can be".into());
        let leaf = &found.at.levels[0].leaf.leaf;
        let own: Vec<Change>;
        let own_rates: Vec<LeafRate>;
        let rates: &[LeafRate] = if self.linear && of.loaded_only {
            let changes = self.changes.get_or_init(changes).as_ref();
            let changes = changes.ok_or_else(at_limit)?;
            shared.get_or_init(|| rates(leaf, changes))
        } else {
            own = changes().ok_or_else(at_limit)?;
            own_rates = rates(leaf, &own);
            &own_rates
        };
        let tolerance = match self.grids {
            Grids::AsNeeded => self.base.scenario().tolerance.min(self.tolerance()),
            Grids::These => OF_SEARCH,
        };
        let mut responses = Responses::new(&found.at, rates, tolerance);
        let slopes = self.coordinates.iter().zip(theta);
        let slopes: Vec<f64> = slopes.map(|(free, theta)| free.slope(*theta)).collect();
        if let Some(axes) = found.tip_axes(numbers.len()) {
            found.gradients = found.tip_rates(&responses, &axes, &slopes)?;
            found.responses = Some(responses);
            return Ok(());
        }
        responses.solve_each(&found.at.levels)?;
        found.gradients = found.rates(&responses, (&numbers, rates), &slopes);
        found.responses = Some(responses);
        Ok(())
    }
}

fn rates<'c>(leaf: &Leaf, changes: &'c [Change]) -> Vec<LeafRate<'c>> {
    let rates = changes.iter().map(|change| LeafRate::new(leaf, change));
    rates.collect()
}

impl CaseAt {
    /// Derivatives of its components with respect to the coordinates, whose `slopes` are given.
    fn rates(
        &self,
        responses: &Responses,
        (numbers, rates): (&[Number], &[LeafRate]),
        slopes: &[f64],
    ) -> Vec<Vec<f64>> {
        let mut gradients = Vec::new();
        // Measured more than once, a result has the same derivatives.
        let mut known: Vec<(Quantity, Vec<f64>)> = Vec::new();
        let mut index = 0;
        while index < self.components.len() {
            let component = &self.components[index];
            match component.what {
                Compared::Result(quantity) => {
                    index += 1;
                    if let Some((_, row)) = known.iter().find(|(it, _)| *it == quantity) {
                        gradients.push(row.clone());
                        continue;
                    }
                    let by = |k: usize| {
                        let of = (&numbers[k], &rates[k], responses.each[k].as_slice());
                        slopes[k] * self.result_rate(quantity, of)
                    };
                    let row: Vec<f64> = (0..numbers.len()).map(by).collect();
                    known.push((quantity, row.clone()));
                    gradients.push(row);
                }
                Compared::Vein { rod, sigma, .. } => {
                    // All coordinates of the point.
                    let same = |other: &&Component| match other.what {
                        Compared::Vein { .. } => other.origin == component.origin,
                        Compared::Result(_) => false,
                    };
                    let point: Vec<&Component> =
                        self.components[index..].iter().take_while(same).collect();
                    let rows = self.vein_rates(responses, (rod, sigma), &point, slopes);
                    index += point.len();
                    gradients.extend(rows);
                }
            }
        }
        gradients
    }
}

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
    pub fn new(at: &AtRest, rates: &[LeafRate], tolerance: f64) -> Responses {
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
            let (rods, segments) = (level.leaf.rods(), level.leaf.segments());
            if !self.each.is_empty() {
                let mut sum = Response::none(rods, segments);
                for (responses, step) in self.each.iter().zip(steps) {
                    sum.add(*step, &responses[k]);
                }
                return Ok(sum);
            }
            let mut sum = Forces::none(rods);
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
