//! How the components of a point change with the free numbers.

use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use super::case::{CaseAt, Change, Component, What};
use super::model::{Model, Point};
use crate::leaf::{Forces, LeafRate, Response};
use crate::relax::{Lost, Number, responses};
use crate::scenario::Scenario;

/// Tables of a scenario whose numbers change it in proportion, whatever the others are:
/// a length changes the coupling of its gap, and a section its stiffnesses.
const APART: [&str; 4] = ["stiffness.", "coupling.", "load.", "rest."];

impl Model<'_> {
    /// Finds how the components of a point change with the coordinates.
    pub fn differentiate(&self, point: &mut Point) -> Result<(), Lost> {
        let theta = point.theta.clone();
        let each = |(case, at): (usize, &mut CaseAt)| self.differentiate_case(case, at, &theta);
        let cases = point.cases.par_iter_mut().enumerate();
        cases.map(each).collect()
    }

    fn differentiate_case(
        &self,
        case: usize,
        found: &mut CaseAt,
        theta: &[f64],
    ) -> Result<(), Lost> {
        if !found.gradients.is_empty() {
            return Ok(());
        }
        let of = &self.cases[case];
        let fixed = self.values(of, theta);
        let first = fixed.len() - theta.len();
        // Where all numbers are as they are, all scenarios are the same.
        let here: OnceLock<Option<Scenario>> = OnceLock::new();
        let made: Vec<_> = (0..theta.len())
            .map(|k| {
                let (fixed, here) = (&fixed, &here);
                move |value: f64| -> Option<Scenario> {
                    if value == fixed[first + k].1 {
                        return here.get_or_init(|| self.scenario(of, theta).ok()).clone();
                    }
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
        let changes = || -> Option<Vec<Change>> {
            let changes = numbers.iter().map(|number| number.rate().map(Arc::new));
            changes.collect()
        };
        let changes = match self.is_linear() {
            true => of.changes.get_or_init(changes).clone(),
            false => changes(),
        };
        let at_limit = || Lost::NotAtRest("a number is at the limit of what it can be".into());
        let changes = changes.ok_or_else(at_limit)?;
        let leaf = &found.at.levels[0].leaf.leaf;
        let rates: Vec<LeafRate> = (changes.iter())
            .map(|change| LeafRate::new(leaf, change))
            .collect();
        let mut all: Vec<Vec<Response>> = vec![Vec::new(); numbers.len()];
        let scenario = self.base.scenario();
        let tolerance = scenario.tolerance.min(self.tolerance());
        for level in &found.at.levels {
            let forces = rates.iter().map(|rate| level.leaf.rate(&level.state, rate));
            let forces: Vec<Forces> = forces.collect();
            let answers = responses(level, &forces, tolerance);
            let answers =
                answers.ok_or(Lost::NotAtRest("the leaf is at a singular point".into()))?;
            for (all, answer) in all.iter_mut().zip(answers) {
                all.push(answer);
            }
        }
        found.responses = all;
        let slopes = self.coordinates.iter().zip(theta);
        let slopes: Vec<f64> = slopes.map(|(free, theta)| free.slope(*theta)).collect();
        let mut gradients = Vec::new();
        let mut index = 0;
        while index < found.components.len() {
            let component = &found.components[index];
            match component.what {
                What::Result(quantity) => {
                    let by = |k: usize| {
                        let of = (&numbers[k], &rates[k], found.responses[k].as_slice());
                        slopes[k] * found.result_rate(quantity, of)
                    };
                    gradients.push((0..numbers.len()).map(by).collect());
                    index += 1;
                }
                What::Vein { rod, sigma, .. } => {
                    // All coordinates of the point.
                    let same = |other: &&Component| match other.what {
                        What::Vein { .. } => other.origin == component.origin,
                        What::Result(_) => false,
                    };
                    let point: Vec<&Component> =
                        found.components[index..].iter().take_while(same).collect();
                    let rows = found.vein_rates(rod, sigma, &point, &slopes);
                    index += point.len();
                    gradients.extend(rows);
                }
            }
        }
        found.gradients = gradients;
        Ok(())
    }

    /// Whether the changes of a scenario with the free numbers are the same wherever
    /// these are.
    fn is_linear(&self) -> bool {
        self.coordinates.iter().all(|free| {
            let mut keys = free.keys.targets().iter().filter_map(|target| target.key());
            let apart = keys.all(|key| APART.iter().any(|table| key.path().starts_with(table)));
            apart && free.keys.is_linear()
        })
    }
}
