//! What the leaf of a scenario predicts for the data, and how that changes with the
//! free numbers.

use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use super::FitError;
use super::case::{Case, CaseAt, Component};
use super::data::{Data, Experiment, Measured, Origin};
use super::free::Coordinate;
use super::quantity::Kind;
use crate::newton::Work;
use crate::relax::{AtRest, Equilibrium, Grids, Lost, Options};
use crate::scenario::Scenario;
use crate::study::{Base, Keys};

/// What all points of a fit have in common.
pub(super) struct Model<'a> {
    pub base: &'a Base,
    pub coordinates: &'a [Coordinate],
    pub options: Options,
    pub cases: Arc<Vec<Case>>,
    /// On which grids leaves are followed.
    pub grids: Grids,
}

/// The leaves of all experiments.
pub(super) struct Point {
    pub theta: Vec<f64>,
    pub cases: Vec<CaseAt>,
}

impl Point {
    pub fn components(&self) -> impl Iterator<Item = &Component> {
        self.cases.iter().flat_map(|case| &case.components)
    }

    pub fn gradients(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.cases.iter().flat_map(|case| &case.gradients)
    }
}

impl<'a> Model<'a> {
    pub fn new(
        base: &'a Base,
        coordinates: &'a [Coordinate],
        options: &Options,
        data: Data,
    ) -> Result<Self, FitError> {
        let rods = base.scenario().rods.len();
        let case = |experiment: Experiment| Case {
            name: experiment.name,
            settings: experiment.settings,
            measured: experiment.measured,
            traced: Vec::new(),
            origin: experiment.origin,
            changes: OnceLock::new(),
        };
        let mut cases: Vec<Case> = data.experiments.into_iter().map(case).collect();
        let mut plain = None;
        for traced in data.traced {
            let place = match &traced.experiment {
                Some(name) => {
                    let found = cases.iter().position(|case| case.name == *name);
                    found.ok_or_else(|| {
                        let origin = &traced.origin;
                        let why = format!(
                            "{origin}: experiment {name}: no row of an experiments file has that name"
                        );
                        FitError::Data(why)
                    })?
                }
                None => *plain.get_or_insert_with(|| {
                    cases.push(Case {
                        name: "as it is".into(),
                        settings: Vec::new(),
                        measured: Vec::new(),
                        traced: Vec::new(),
                        origin: None,
                        changes: OnceLock::new(),
                    });
                    cases.len() - 1
                }),
            };
            cases[place].traced.push(traced);
        }
        cases.retain(|case| !case.measured.is_empty() || !case.traced.is_empty());
        for case in &cases {
            let of_a_tip = |m: &&Measured| m.quantity.kind() == Kind::Length;
            if let Some(measured) = case.measured.iter().find(of_a_tip)
                && rods > 1
                && !base.scenario().joined
            {
                let why = format!(
                    "{} of free tips: there are {rods} of them: give the tips as points on \
                     veins (rod, sigma = 1, x, y, z)",
                    measured.quantity
                );
                return Err(FitError::Data(why));
            }
            let of_a_holder = |m: &&Measured| m.quantity.kind() == Kind::Force;
            if let Some(measured) = case.measured.iter().find(of_a_holder)
                && base.scenario().held_tip.is_none()
            {
                let why = format!(
                    "{} is what the holder of a tip feels, and the scenario's tip is free: add \
                     [tip] with held = \"pinned\" or \"clamped\"",
                    measured.quantity
                );
                return Err(FitError::Data(why));
            }
            let both =
                |(keys, _): &&(Keys, f64)| coordinates.iter().any(|free| free.keys.overlaps(keys));
            if let Some((keys, _)) = case.settings.iter().find(both) {
                let place = case.origin.as_ref().map(Origin::to_string);
                let place = place.unwrap_or_default();
                let why = format!("{place}: {keys} is set by the experiment, and free");
                return Err(FitError::Data(why));
            }
        }
        Ok(Model {
            base,
            coordinates,
            options: options.clone(),
            cases: Arc::new(cases),
            grids: Grids::AsNeeded,
        })
    }

    pub(super) fn values<'s>(&'s self, case: &'s Case, theta: &[f64]) -> Vec<(&'s Keys, f64)> {
        let settings = case.settings.iter().map(|(keys, value)| (keys, *value));
        let free = self.coordinates.iter().zip(theta);
        settings
            .chain(free.map(|(free, theta)| (&free.keys, free.value(*theta))))
            .collect()
    }

    pub(super) fn scenario(&self, case: &Case, theta: &[f64]) -> Result<Scenario, FitError> {
        let varied = self.base.at(&self.values(case, theta));
        varied.map(|varied| varied.scenario).map_err(|refused| {
            let place = case.origin.as_ref().map(|origin| format!("{origin}: "));
            FitError::Data(format!("{}{refused}", place.unwrap_or_default()))
        })
    }

    /// The leaves at rest from where relaxations start.
    pub fn find(&self, theta: &[f64]) -> Result<(Point, Vec<Equilibrium>), FitError> {
        let find = |case: usize| -> Result<(CaseAt, Equilibrium), FitError> {
            let scenario = self.scenario(&self.cases[case], theta)?;
            let found = AtRest::find(&scenario, &self.options)?;
            let (at, leaf) = found.map_err(|lost| self.no_equilibrium(case, &lost))?;
            let case_at = CaseAt::new(&self.cases[case], case, at);
            Ok((
                case_at.map_err(|lost| self.no_equilibrium(case, &lost))?,
                leaf,
            ))
        };
        let cases = (0..self.cases.len()).into_par_iter().map(find);
        let cases = cases.collect::<Result<Vec<_>, _>>()?;
        let (cases, leaves) = cases.into_iter().unzip();
        let theta = theta.to_vec();
        Ok((Point { theta, cases }, leaves))
    }

    pub(super) fn no_equilibrium(&self, case: usize, lost: &Lost) -> FitError {
        let case = &self.cases[case];
        let place = case.origin.as_ref().map(|origin| format!("{origin}: "));
        let why = match lost {
            Lost::NotAtRest(why) => why.as_str(),
            Lost::Elsewhere => "it jumps to another equilibrium",
        };
        FitError::NoEquilibrium(format!(
            "{}experiment {}: with the numbers of the scenario there is no stable equilibrium ({why}): \
             start from other numbers, or leave this experiment out",
            place.unwrap_or_default(),
            case.name
        ))
    }

    /// The leaves for other values, followed from those of a point that is
    /// differentiated.
    pub fn follow(&self, from: &Point, theta: &[f64]) -> Result<Point, Lost> {
        let steps: Vec<f64> = (self.coordinates.iter().zip(theta).zip(&from.theta))
            .map(|((free, to), from)| free.value(*to) - free.value(*from))
            .collect();
        let follow = |case: usize| -> Result<CaseAt, Lost> {
            let scenario = self.scenario(&self.cases[case], theta);
            let scenario = scenario.map_err(|refused| Lost::NotAtRest(refused.to_string()))?;
            let from = &from.cases[case];
            let how = (&self.options, self.grids);
            let at = from.at.follow(&scenario, &from.responses, &steps, how)?;
            CaseAt::new(&self.cases[case], case, at)
        };
        let cases = (0..self.cases.len()).into_par_iter().map(follow);
        Ok(Point {
            theta: theta.to_vec(),
            cases: cases.collect::<Result<_, _>>()?,
        })
    }

    pub fn tolerance(&self) -> f64 {
        let scenario = self.base.scenario();
        self.options.tolerance.unwrap_or(scenario.tolerance)
    }

    /// Standard deviations are known of all data, or of none, which are then of one kind.
    pub fn check_deviations(&self, point: &Point) -> Result<bool, FitError> {
        let known = |component: &&Component| component.sd.is_some();
        let count = point.components().filter(known).count();
        if count == point.components().count() {
            return Ok(true);
        }
        let without = point.components().find(|component| !known(component));
        if count > 0 {
            let place = without.and_then(|c| c.origin.as_ref());
            let place = place.map(Origin::to_string).unwrap_or_default();
            return Err(FitError::Data(format!(
                "{place}: has no standard deviation, and others have: give all or none"
            )));
        }
        let mut kinds = point.components().map(|component| component.what.kind());
        let first = kinds.next();
        if kinds.any(|kind| Some(kind) != first) {
            return Err(FitError::Data(
                "lengths, forces and frequencies can only be weighed against each other by their \
                 standard deviations: add columns sd_frequency_1, sd_tip_x, ... (sd of points on veins)"
                    .into(),
            ));
        }
        Ok(false)
    }

    pub fn work(point: &Point) -> Work {
        let works = point.cases.iter().map(|case| case.at.work);
        works.fold(Work::default(), |sum, work| sum + work)
    }
}
