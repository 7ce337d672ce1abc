//! The derivatives of the components of a point.

use std::sync::OnceLock;

use rayon::prelude::*;

use super::case::{CaseAt, Compared, Component};
use super::model::{Change, Model, Point};
use super::quantity::Quantity;
use super::responses::Responses;
use crate::leaf::{Leaf, LeafRate};
use crate::relax::{Grids, Lost, Parameter};
use crate::scenario::PhotoRate;
use crate::study::Keys;

/// Derivatives in a search have the accuracy of those of a leaf with this tolerance.
const OF_SEARCH: f64 = 1e-5;

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

    /// A number that changes nothing in a leaf.
    fn without_effect<'v>(&'v self, values: &'v [(&'v Keys, f64)]) -> Parameter<'v> {
        Parameter {
            make: Box::new(move |_| Some(self.base.at(values).ok()?.scenario)),
            value: 0.0,
            unit: 1.0,
            linear: true,
        }
    }

    /// Adds the derivatives of predictions with respect to the offsets of their columns.
    fn add_offsets(&self, found: &mut CaseAt, slopes: &[f64]) {
        let rows = found.gradients.iter_mut().zip(&found.components);
        for (row, component) in rows {
            for (k, free) in self.coordinates.iter().enumerate() {
                if component.has_offset(free) {
                    row[k] -= slopes[k];
                }
            }
        }
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
        let values = self.values(of, theta);
        let numbers: Vec<Parameter> = (self.coordinates.iter().enumerate())
            .map(|(k, free)| match self.place_of(of, k) {
                Some(place) => self.base.parameter(&values, place, free.unit),
                None => self.without_effect(&values),
            })
            .collect();
        let changes = || -> Option<Vec<Change>> { numbers.iter().map(Parameter::rate).collect() };
        let at_limit = || Lost::NotAtRest("a number is at the limit of what it can be".into());
        let leaf = &found.at.levels[0].leaf.leaf;
        let own: Vec<Change>;
        let own_rates: Vec<LeafRate>;
        let (changes, rates): (&[Change], &[LeafRate]) = if self.linear && of.loaded_only {
            let changes = self.changes.get_or_init(changes).as_ref();
            let changes = changes.ok_or_else(at_limit)?;
            (changes, shared.get_or_init(|| rates(leaf, changes)))
        } else {
            own = changes().ok_or_else(at_limit)?;
            own_rates = rates(leaf, &own);
            (&own, &own_rates)
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
            self.add_offsets(found, &slopes);
            found.responses = Some(responses);
            return Ok(());
        }
        responses.solve_each(&found.at.levels)?;
        found.gradients = found.rates(&responses, (&numbers, changes, rates), &slopes);
        self.add_offsets(found, &slopes);
        found.responses = Some(responses);
        Ok(())
    }
}

fn rates<'c>(leaf: &Leaf, changes: &'c [Change]) -> Vec<LeafRate<'c>> {
    let rates = changes.iter().map(|change| LeafRate::new(leaf, change));
    rates.collect()
}

/// How a photograph changes with each number.
fn photo_rates(changes: &[Change]) -> Vec<PhotoRate> {
    let rate = |change: &Change| {
        let photos = change.iter();
        let photos = photos.filter_map(|(weight, it)| Some((*weight, it.photo.as_ref()?)));
        PhotoRate::of(photos)
    };
    changes.iter().map(rate).collect()
}

impl CaseAt {
    /// Derivatives of its components with respect to the coordinates, whose `slopes` are given.
    fn rates(
        &self,
        responses: &Responses,
        (numbers, changes, rates): (&[Parameter], &[Change], &[LeafRate]),
        slopes: &[f64],
    ) -> Vec<Vec<f64>> {
        let mut gradients = Vec::new();
        let photos = photo_rates(changes);
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
                    let rows = self.vein_rates((responses, &photos), (rod, sigma), &point, slopes);
                    index += point.len();
                    gradients.extend(rows);
                }
            }
        }
        gradients
    }
}
