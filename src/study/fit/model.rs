//! Predictions of a scenario's leaf for the data, and their derivatives with respect to the free
//! numbers.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

use nalgebra::DVector;
use rayon::prelude::*;

use super::FitError;
use super::case::{CaseAt, Component};
use super::data::{Data, Measured, Origin, Traced};
use super::experiments::{self, Case};
use super::free::{Coordinate, FreeNumber};
use super::quantity::{Kind, Quantity};
use super::words::digits;
use crate::newton::Work;
use crate::relax::{Grids, Lost, NestedEquilibrium, Options};
use crate::scenario::Scenario;
use crate::study::{Base, Keys};

/// Derivative of a scenario with respect to a number: scenarios with finite-difference weights.
pub(super) type Change = Vec<(f64, Scenario)>;

/// Largest error of a prediction during a search, in standard deviations of its datum.
pub(super) const INSIGNIFICANT: f64 = 0.05;

/// The largest tolerance of leaves from which a search starts.
const LOOSEST: f64 = 1e-4;

/// How often the leaves of all experiments may be relaxed or followed in a fit, and how often they were.
pub(super) struct Budget {
    most: usize,
    spent: AtomicUsize,
}

impl Budget {
    pub fn new(most: usize) -> Self {
        let spent = AtomicUsize::new(0);
        Budget { most, spent }
    }

    /// Whether it is used up. Asked where nothing is computed in parallel, so that a fit ends at the
    /// same place on any number of threads.
    pub fn is_used_up(&self) -> bool {
        self.spent.load(Ordering::Relaxed) >= self.most
    }

    pub fn most(&self) -> usize {
        self.most
    }
}

/// Data common to all points of a fit.
#[derive(Clone)]
pub(super) struct Model<'a> {
    pub base: &'a Base,
    pub coordinates: &'a [Coordinate],
    pub options: Options,
    pub cases: Arc<Vec<Case>>,
    /// The grids on which leaves are followed.
    pub grids: Grids,
    /// Whether scenarios are linear in the free numbers.
    pub linear: bool,
    /// The derivatives of scenarios with respect to the free numbers, if common to all.
    pub changes: Arc<OnceLock<Option<Vec<Change>>>>,
    pub budget: Arc<Budget>,
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

    /// Takes over the derivatives of another point.
    pub fn take_gradients(&mut self, other: &mut Point) {
        for (own, other) in self.cases.iter_mut().zip(&mut other.cases) {
            own.gradients = std::mem::take(&mut other.gradients);
        }
    }

    pub fn gradients(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.cases.iter().flat_map(|case| &case.gradients)
    }
}

/// Tables of a scenario in whose numbers it is linear, independently of the others:
/// a length changes the coupling of its gap, and a section its stiffnesses.
const APART: [&str; 4] = ["stiffness.", "coupling.", "load.", "rest."];

/// Whether the derivatives of a scenario with respect to these are constant.
fn is_linear(coordinates: &[Coordinate]) -> bool {
    coordinates.iter().all(|free| {
        free.number.keys().is_some_and(|keys| {
            let mut all = keys.targets().iter().filter_map(|target| target.key());
            let apart = all.all(|key| APART.iter().any(|table| key.path().starts_with(table)));
            apart && keys.is_linear()
        })
    })
}

impl<'a> Model<'a> {
    pub fn new(
        base: &'a Base,
        coordinates: &'a [Coordinate],
        options: &Options,
        (data, budget): (Data, Budget),
    ) -> Result<Self, FitError> {
        let rods = base.scenario().rods.len();
        let cases = experiments::cases(data)?;
        for case in &cases {
            let of_a_tip = |m: &&Measured| m.quantity.kind() == Kind::Length;
            if let Some(measured) = case.measured().find(of_a_tip)
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
            let mut traced = case.traced();
            if let Some(traced) = traced.find(|traced| traced.is_in_photo())
                && base.scenario().photo.is_none()
            {
                let why = format!(
                    "{}: pixels of a photograph: say in the scenario how it shows the leaf, by [photo] with \
                     scale, x and y",
                    traced.origin
                );
                return Err(FitError::Data(why));
            }
            let of_a_holder = |m: &&Measured| matches!(m.quantity, Quantity::Reaction(_));
            if let Some(measured) = case.measured().find(of_a_holder)
                && base.scenario().held_tip.is_none()
            {
                let why = format!(
                    "{} is what the holder of a tip feels, and the scenario's tip is free: add \
                     [tip] with held = \"pinned\" or \"clamped\"",
                    measured.quantity
                );
                return Err(FitError::Data(why));
            }
            let grips = base.scenario().grips.len();
            let of_no_grip =
                |m: &&Measured| matches!(m.quantity, Quantity::Grip(grip, _) if grip >= grips);
            if let Some(measured) = case.measured().find(of_no_grip) {
                let why = format!(
                    "{} is what a grip feels, counted from 1, and the scenario has {grips} of \
                     [[grip]]",
                    measured.quantity
                );
                return Err(FitError::Data(why));
            }
            let both = |(keys, _): &&(Keys, f64)| {
                let mut free = coordinates.iter().filter_map(|free| free.number.keys());
                free.any(|free| free.overlaps(keys))
            };
            if let Some((keys, _)) = case.settings().iter().find(both) {
                let place = case.place();
                let why = format!("{place}{keys} is set by the experiment, and free");
                return Err(FitError::Data(why));
            }
        }
        Ok(Model {
            base,
            coordinates,
            options: options.clone(),
            cases: Arc::new(cases),
            grids: Grids::AsNeeded,
            linear: is_linear(coordinates) && !base.scenario().depends_on_natural_leaf(),
            changes: Arc::default(),
            budget: Arc::new(budget),
        })
    }

    /// The numbers of the scenario in an experiment: its settings with their offsets, and then the free
    /// ones.
    pub(super) fn values<'s>(&'s self, case: &'s Case, theta: &[f64]) -> Vec<(&'s Keys, f64)> {
        let free = || self.coordinates.iter().zip(theta);
        let settings = case.settings().iter().map(|(keys, value)| {
            let offsets = free().filter(|(free, _)| free.number.is_offset_of(keys));
            let offset: f64 = offsets.map(|(free, theta)| free.value(*theta)).sum();
            (keys, value + offset)
        });
        let entries =
            free().filter_map(|(free, theta)| Some((free.number.keys()?, free.value(*theta))));
        settings.chain(entries).collect()
    }

    /// Where the number that a coordinate changes stands among [`Model::values`]; none if it changes
    /// nothing in this experiment's leaf.
    pub(super) fn place_of(&self, case: &Case, k: usize) -> Option<usize> {
        match &self.coordinates[k].number {
            FreeNumber::Entry(_) => {
                let before = self.coordinates[..k].iter();
                let before = before.filter(|free| free.number.keys().is_some());
                Some(case.settings().len() + before.count())
            }
            offset @ FreeNumber::Offset(_) => {
                let mut settings = case.settings().iter();
                settings.position(|(keys, _)| offset.is_offset_of(keys))
            }
        }
    }

    /// Predictions of a leaf at rest for the data of an experiment, less the offsets of their columns.
    pub(super) fn case_at(
        &self,
        case: usize,
        theta: &[f64],
        at: NestedEquilibrium,
    ) -> Result<CaseAt, Lost> {
        let mut found = CaseAt::new(&self.cases[case], at)?;
        for (free, theta) in self.coordinates.iter().zip(theta) {
            let offset = free.value(*theta);
            let own = found.components.iter_mut().filter(|it| it.has_offset(free));
            own.for_each(|component| component.model -= offset);
        }
        Ok(found)
    }

    /// The scenario of an experiment.
    pub(super) fn scenario(&self, case: &Case, theta: &[f64]) -> Result<Arc<Scenario>, FitError> {
        match self.base.at(&self.values(case, theta)) {
            Ok(varied) => Ok(Arc::new(varied.scenario)),
            Err(refused) => Err(FitError::Data(format!("{}{refused}", case.place()))),
        }
    }

    /// The leaves at rest, relaxed from their usual starts.
    pub fn find(&self, theta: &[f64]) -> Result<Point, FitError> {
        let find = |case: usize| -> Result<CaseAt, FitError> {
            let scenario = self.scenario(&self.cases[case], theta)?;
            let found = NestedEquilibrium::find(&scenario, &self.options)?;
            let found = found.and_then(|at| self.case_at(case, theta, at));
            found.map_err(|lost| self.no_equilibrium(theta, case, &lost))
        };
        self.point(theta, find)
    }

    /// The same in no more than so many steps of each leaf.
    pub fn find_within(&self, theta: &[f64], most_steps: usize) -> Result<Point, FitError> {
        let find = |case: usize| -> Result<CaseAt, FitError> {
            let scenario = self.scenario(&self.cases[case], theta)?;
            let found = NestedEquilibrium::find_within(&scenario, &self.options, most_steps)?;
            let found = found.and_then(|at| self.case_at(case, theta, at));
            found.map_err(|lost| self.no_equilibrium(theta, case, &lost))
        };
        self.point(theta, find)
    }

    /// The point at which `of` finds the leaf of each case.
    pub(super) fn point<E: Send>(
        &self,
        theta: &[f64],
        of: impl Fn(usize) -> Result<CaseAt, E> + Sync + Send,
    ) -> Result<Point, E> {
        self.budget.spent.fetch_add(1, Ordering::Relaxed);
        let cases = (0..self.cases.len()).into_par_iter().map(of);
        Ok(Point {
            theta: theta.to_vec(),
            cases: cases.collect::<Result<_, _>>()?,
        })
    }

    pub(super) fn no_equilibrium(&self, theta: &[f64], case: usize, lost: &Lost) -> FitError {
        let case = &self.cases[case];
        let (place, name) = (case.place(), case.name());
        let why = match lost {
            Lost::NotAtRest(why) => why.as_str(),
            Lost::Elsewhere => "it jumps to another equilibrium",
        };
        let mut both = self.coordinates.iter().zip(theta);
        let numbers = match both.all(|(free, theta)| free.start == *theta) {
            true => "the numbers of the scenario".into(),
            false => self.in_words(theta),
        };
        FitError::NoEquilibrium(format!(
            "{place}experiment {name}: with {numbers} there is no stable equilibrium ({why}): \
             start from other numbers, or leave this experiment out"
        ))
    }

    /// The number that each coordinate stands for.
    pub fn numbers(&self, theta: &[f64]) -> Vec<(String, f64)> {
        let both = self.coordinates.iter().zip(theta);
        both.map(|(free, theta)| (free.number.to_string(), free.value(*theta)))
            .collect()
    }

    /// These in words.
    pub fn in_words(&self, theta: &[f64]) -> String {
        let numbers = self.numbers(theta);
        let each = numbers
            .iter()
            .map(|(key, value)| format!("{key} = {}", digits(*value)));
        each.collect::<Vec<_>>().join(", ")
    }

    /// The leaves at other values, followed from those of a point with derivatives.
    pub fn follow(&self, from: &Point, theta: &[f64]) -> Result<Point, Lost> {
        self.follow_on(from, theta, self.grids)
    }

    /// The same on these grids.
    pub fn follow_on(&self, from: &Point, theta: &[f64], grids: Grids) -> Result<Point, Lost> {
        let steps = self.steps(&from.theta, theta);
        let follow = |case: usize| -> Result<CaseAt, Lost> {
            let scenario = self.scenario(&self.cases[case], theta);
            let scenario = scenario.map_err(|refused| Lost::NotAtRest(refused.to_string()))?;
            let from = &from.cases[case];
            let how = (&self.options, grids);
            let answer = from.answer(&from.at.levels, &steps)?;
            let at = from.at.follow(scenario, &answer, how)?;
            self.case_at(case, theta, at)
        };
        self.point(theta, follow)
    }

    /// Unit of the data: the length of the leaf, or the largest of them.
    pub fn unit(&self) -> f64 {
        let mut measured = self.cases.iter().flat_map(Case::measured);
        let mut traced = self.cases.iter().flat_map(Case::traced);
        let lengths = |measured: &Measured| measured.quantity.kind() == Kind::Length;
        let in_photo = traced.clone().any(Traced::is_in_photo);
        match traced.next().is_some() || measured.clone().all(lengths) {
            true if in_photo => self.base.scenario().scale().length / self.pixel(),
            true => self.base.scenario().scale().length,
            false => {
                let sizes = measured.by_ref().filter_map(|measured| measured.value);
                let size = sizes.fold(0.0_f64, |most, value| most.max(value.abs()));
                size.max(f64::MIN_POSITIVE)
            }
        }
    }

    /// The length of a pixel of its photograph before the fit, if there is one.
    pub fn pixel(&self) -> f64 {
        let photo = self.base.scenario().photo.as_ref();
        photo.map_or(1.0, |photo| photo.scale)
    }

    /// Values of the coordinates after `step` times a change, within their bounds.
    pub fn moved(&self, from: &[f64], step: f64, change: &DVector<f64>) -> Vec<f64> {
        let coordinates = self.coordinates.iter().zip(from).zip(change.iter());
        let moved = coordinates.map(|((free, from), change)| {
            let [low, high] = free.bounds;
            (from + step * change).clamp(low, high)
        });
        moved.collect()
    }

    pub fn steps(&self, from: &[f64], to: &[f64]) -> Vec<f64> {
        let each = self.coordinates.iter().zip(to).zip(from);
        each.map(|((free, to), from)| free.value(*to) - free.value(*from))
            .collect()
    }

    /// The same model with leaves only as accurate as the resolution of its data, all of which are
    /// lengths.
    pub fn with_loose_tolerance(&self, assumed: f64) -> Model<'a> {
        let length = self.base.scenario().scale().length;
        let sd = |sd: Option<f64>| sd.unwrap_or(assumed) / length;
        let mut tolerance = f64::INFINITY;
        for case in self.cases.iter() {
            for measured in case.measured() {
                let known = match measured.quantity.kind() {
                    Kind::Length => INSIGNIFICANT * sd(measured.sd),
                    _ => 0.0,
                };
                tolerance = known.min(tolerance);
            }
            let traced = case.traced().map(|traced| {
                let unit = if traced.is_in_photo() {
                    self.pixel()
                } else {
                    1.0
                };
                INSIGNIFICANT * unit * sd(traced.sd)
            });
            tolerance = traced.fold(tolerance, f64::min);
        }
        Model {
            options: Options {
                tolerance: Some(tolerance.min(LOOSEST).max(self.tolerance())),
                ..self.options.clone()
            },
            ..self.clone()
        }
    }

    pub fn tolerance(&self) -> f64 {
        let scenario = self.base.scenario();
        self.options.tolerance.unwrap_or(scenario.tolerance)
    }

    /// Checks that the standard deviations are known for all data, or for none, then of one kind.
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

    /// Checks that double precision can weigh all data.
    pub fn check_weights(&self, point: &Point) -> Result<(), FitError> {
        let all = point.cases.iter();
        let all = all.flat_map(|case| case.components.iter().map(move |datum| (case, datum)));
        for (case, datum) in all {
            let (value, column) = (datum.observed, datum.what.column());
            let kind = datum.what.kind();
            let size = match kind {
                // A vein is extended to any point that was traced.
                Kind::Length | Kind::Pixel => case.unit(kind),
                _ => case.unit(kind).max(datum.model.abs()),
            };
            let why = match datum.sd {
                _ if value.abs() * f64::EPSILON > size => format!(
                    "{column} = {value:e}: next to such a number the whole leaf is lost in \
                     rounding: check its unit, or leave the row out"
                ),
                Some(sd) if sd < f64::EPSILON * size.max(value.abs()) => format!(
                    "{} = {sd:e}: is less than the rounding of {column} as computed: give the \
                     standard deviation of the measurement",
                    datum.what.deviation_column()
                ),
                _ => continue,
            };
            let place = datum.origin.as_ref().map(Origin::to_string);
            let place = place.map_or_else(String::new, |place| format!("{place}: "));
            return Err(FitError::Data(format!("{place}{why}")));
        }
        Ok(())
    }

    pub fn work(point: &Point) -> Work {
        let works = point.cases.iter().map(|case| case.at.work);
        works.fold(Work::default(), |sum, work| sum + work)
    }
}
