//! Predictions of a scenario's leaf for the data, and their derivatives with respect to the free
//! numbers.
//!
//! A leaf at rest under the conditions of its experiments, its predictions for the data, and
//! their derivatives.

use crate::leaf::{LeafRate, Response, shift};
use crate::modes;
use crate::motion::Physics;
use crate::newton::Work;
use crate::relax::accuracy::transfer::weights;
use crate::relax::{
    Grids, Level, Lost, Nearby, NestedEquilibrium, Options, Parameter, unit_forces,
};
use crate::scenario::{Photo, PhotoRate, Scenario};
use crate::study::fit::data::{
    COORDINATES, Case, Data, IN_PHOTO, Kind, Measured, Observed, Origin, Quantity, Traced, View,
};
use crate::study::fit::found::digits;
use crate::study::fit::responses::{Responses, Vein};
use crate::study::fit::{Coordinate, FitError, FreeNumber, OffsetColumn, data};
use crate::study::{Base, Keys};
use nalgebra::DVector;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

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
        let cases = data::cases(data)?;
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

/// Largest number of unknowns of a grid on which modes are computed, except the first.
const FEW_UNKNOWNS: usize = 4_000;

/// One scalar datum.
#[derive(Clone, Debug)]
pub(super) struct Component {
    /// The number of its experiment.
    pub experiment: usize,
    pub what: Compared,
    pub observed: f64,
    pub model: f64,
    /// Its standard deviation, if known.
    pub sd: Option<f64>,
    /// Whether it does not count as a datum: the distance of a point from a curve contains no
    /// information on the position along it.
    pub free: bool,
    pub origin: Option<Origin>,
}

impl Component {
    /// Whether a coordinate is the offset of its column.
    pub fn has_offset(&self, free: &Coordinate) -> bool {
        match (&free.number, self.what) {
            (FreeNumber::Offset(OffsetColumn::Result(of)), Compared::Result(what)) => *of == what,
            _ => false,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Compared {
    Result(Quantity),
    /// One of [`COORDINATES`] of a point on a rod, at this fraction of its length.
    Vein {
        rod: usize,
        coordinate: usize,
        sigma: f64,
    },
}

impl Compared {
    pub fn kind(self) -> Kind {
        match self {
            Compared::Result(quantity) => quantity.kind(),
            Compared::Vein { coordinate, .. } if coordinate >= IN_PHOTO => Kind::Pixel,
            Compared::Vein { .. } => Kind::Length,
        }
    }

    /// The name of its column in the data.
    pub fn column(self) -> String {
        match self {
            Compared::Result(quantity) => quantity.to_string(),
            Compared::Vein { coordinate, .. } => COORDINATES[coordinate].into(),
        }
    }

    /// The name of the column of its standard deviation.
    pub fn deviation_column(self) -> String {
        match self {
            Compared::Result(quantity) => format!("sd_{quantity}"),
            Compared::Vein { .. } => "sd".into(),
        }
    }
}

/// A leaf at rest at some values of the free numbers.
pub(super) struct CaseAt {
    pub at: NestedEquilibrium,
    /// Modes on the first grids.
    pub modes: Vec<Vec<modes::Eigenpair>>,
    pub components: Vec<Component>,
    /// Its response to the numbers, once computed.
    pub responses: Option<Responses>,
    /// The gradients of the components; empty until computed.
    pub gradients: Vec<Vec<f64>>,
}

impl CaseAt {
    /// Predictions of a leaf at rest for the data under these conditions.
    pub fn new(of: &Case, at: NestedEquilibrium) -> Result<CaseAt, Lost> {
        let frequencies = of
            .measured()
            .filter_map(|measured| match measured.quantity {
                Quantity::Frequency(mode) => Some(mode),
                _ => None,
            });
        let count = frequencies.max().unwrap_or(0);
        let mut modes = Vec::new();
        for level in at.levels.iter().filter(|_| count > 0) {
            let unknowns = 6 * level.leaf.rods() * level.leaf.segments();
            if modes.is_empty() || unknowns < FEW_UNKNOWNS {
                let pairs = modes::loaded(&level.leaf, &level.state, count);
                let lost = || Lost::NotAtRest("its frequencies cannot be found".into());
                let pairs = pairs
                    .filter(|pairs| pairs.len() == count)
                    .ok_or_else(lost)?;
                modes.push(pairs);
            }
        }
        let mut found = CaseAt {
            at,
            modes,
            components: Vec::new(),
            responses: None,
            gradients: Vec::new(),
        };
        let mut veins = Vec::new();
        let observed = of.observed.iter();
        let components = observed.flat_map(|of| found.compared(of, &mut veins));
        found.components = components.collect();
        Ok(found)
    }

    /// The components of an experiment.
    fn compared<'v>(&'v self, of: &Observed, veins: &mut Vec<Option<Vein<'v>>>) -> Vec<Component> {
        let mut components = Vec::new();
        let view = self.view();
        for measured in &of.experiment.measured {
            components.push(Component {
                experiment: of.number,
                what: Compared::Result(measured.quantity),
                observed: measured.value.unwrap_or(f64::NAN),
                model: self.result(measured.quantity),
                sd: measured.sd,
                free: false,
                origin: of.experiment.origin.clone(),
            });
        }
        for traced in &of.traced {
            veins.resize_with(veins.len().max(traced.rod + 1), || None);
            let vein = veins[traced.rod].get_or_insert_with(|| Vein::of(&self.at, traced.rod));
            let beside = traced.sigma.is_none();
            let (sigma, model) = match traced.sigma {
                Some(sigma) => (sigma, vein.point(sigma).0),
                None => vein.nearest(&traced.at, &view),
            };
            let seen = traced.at.iter().enumerate();
            let seen = seen.filter_map(|(k, value)| value.map(|value| (k, value)));
            for (number, (coordinate, observed)) in seen.enumerate() {
                components.push(Component {
                    experiment: of.number,
                    what: Compared::Vein {
                        rod: traced.rod,
                        coordinate,
                        sigma,
                    },
                    observed,
                    model: view.of(coordinate, model),
                    sd: traced.sd,
                    free: beside && number == 0,
                    origin: Some(traced.origin.clone()),
                });
            }
        }
        components
    }

    /// The axes along which its tip was measured, if there are no other data, and the equations of
    /// the leaf are symmetric: adjoint solutions for each axis then give the derivatives with
    /// respect to all numbers. `None` if solving for each number takes no more work.
    pub fn tip_axes(&self, numbers: usize) -> Option<Vec<usize>> {
        let leaf = &self.at.levels[0].leaf;
        let symmetric = !leaf.leaf.is_held() && !leaf.has_moments();
        let tip = |component: &Component| match component.what {
            Compared::Result(Quantity::Tip(axis)) => Some(axis),
            _ => None,
        };
        let mut axes: Vec<usize> = self.components.iter().map(tip).collect::<Option<_>>()?;
        axes.sort_unstable();
        axes.dedup();
        // One more is for the next step.
        (symmetric && axes.len() + 1 < numbers).then_some(axes)
    }

    /// The gradients of the components from these solutions.
    pub fn tip_rates(
        &self,
        responses: &Responses,
        axes: &[usize],
        slopes: &[f64],
    ) -> Result<Vec<Vec<f64>>, Lost> {
        let mut sums = [(); 3].map(|()| vec![0.0; slopes.len()]);
        for (k, level) in self.at.levels.iter().enumerate() {
            let weight = self.at.weights[k] * self.length();
            if weight == 0.0 {
                continue;
            }
            let all = unit_forces(&level.leaf, 1);
            let units: Vec<_> = axes.iter().map(|&axis| all[axis].clone()).collect();
            let rates = responses.by_results((k, level), &units)?;
            for (axis, rates) in axes.iter().zip(rates) {
                let sums = sums[*axis].iter_mut().zip(rates).zip(slopes);
                sums.for_each(|((sum, rate), slope)| *sum += weight * rate * slope);
            }
        }
        let row = |component: &Component| match component.what {
            Compared::Result(Quantity::Tip(axis)) => sums[axis].clone(),
            _ => Vec::new(),
        };
        Ok(self.components.iter().map(row).collect())
    }

    /// Its response to steps of the numbers on these grids, each of which must be one of its
    /// own; empty if there are no steps.
    pub fn answer(&self, levels: &[Level], steps: &[f64]) -> Result<Vec<Response>, Lost> {
        let none = |level: &Level| Response::zeros(&level.leaf);
        match &self.responses {
            Some(responses) if steps.iter().any(|step| *step != 0.0) => responses.to(levels, steps),
            _ => Ok(levels.iter().map(none).collect()),
        }
    }

    /// How points on its veins are seen.
    pub fn view(&self) -> View<'_> {
        View::new(self.photo())
    }

    fn photo(&self) -> Option<&Photo> {
        let leaf = &self.at.levels[0].leaf.leaf;
        leaf.scenario().photo.as_ref()
    }

    fn length(&self) -> f64 {
        self.at.levels[0].leaf.leaf.scale.length
    }

    fn force(&self) -> f64 {
        self.at.levels[0].leaf.leaf.scale.force()
    }

    /// The unit of such data in which numbers of the leaf are about one.
    pub fn unit(&self, kind: Kind) -> f64 {
        match kind {
            Kind::Length => self.length(),
            Kind::Pixel => self.length() / self.photo().map_or(1.0, |photo| photo.scale),
            Kind::Force => self.force(),
            Kind::Frequency => {
                let physics = Physics::new(&self.at.levels[0].leaf.leaf);
                1.0 / (std::f64::consts::TAU * physics.time)
            }
        }
    }

    pub fn result(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Tip(axis) => {
                let tip = self.at.best(|_, level| level.state.tip(0));
                tip[axis] * self.length()
            }
            Quantity::Reaction(axis) => {
                let force = self.at.best(|_, level| level.leaf.reaction(&level.state).0);
                force[axis] * self.force()
            }
            Quantity::Grip(grip, axis) => {
                let force = |_, level: &Level| level.leaf.grip_reactions(&level.state)[grip][0];
                self.at.best(force)[axis] * self.force()
            }
            Quantity::Frequency(mode) => {
                self.eigenvalue(mode).max(0.0).sqrt() * self.unit(Kind::Frequency)
            }
        }
    }

    /// An eigenvalue, extrapolated over the grids with modes.
    fn eigenvalue(&self, mode: usize) -> f64 {
        self.over_modes(|level| self.modes[level][mode - 1].eigenvalue)
    }

    fn over_modes(&self, value: impl Fn(usize) -> f64) -> f64 {
        let segments = self.at.levels.iter().map(|level| level.leaf.segments());
        let segments: Vec<usize> = segments.take(self.modes.len()).collect();
        let weights = weights(&segments, f64::INFINITY);
        weights
            .iter()
            .enumerate()
            .map(|(k, weight)| weight * value(k))
            .sum()
    }

    /// The derivative of a result with respect to a number of the scenario.
    pub fn result_rate(
        &self,
        quantity: Quantity,
        (number, rate, responses): (&Parameter, &LeafRate, &[Response]),
    ) -> f64 {
        match quantity {
            Quantity::Tip(axis) => {
                let tip = |k: usize, level: &Level| {
                    shift(&responses[k].of_node(&level.leaf, 0, level.leaf.segments()))
                };
                self.at.best(tip)[axis] * self.length()
            }
            Quantity::Reaction(axis) => {
                let force = |k: usize, level: &Level| level.leaf.reaction_rate(rate, &responses[k]);
                self.at.best(force)[axis] * self.force()
            }
            Quantity::Grip(grip, axis) => {
                let force = |k: usize, level: &Level| {
                    let Level { leaf, state } = level;
                    leaf.grip_force_rates(state, rate, &responses[k])[grip]
                };
                self.at.best(force)[axis] * self.force()
            }
            Quantity::Frequency(mode) => {
                let scenarios = number.nearby().unwrap_or_default();
                let of = |k: usize| {
                    let near = Nearby::new(&self.at.levels[k], &scenarios, (rate, &responses[k]));
                    near.eigenvalue_rate(&self.modes[k][mode - 1])
                };
                // omega^2 = (2 pi f)^2.
                let frequency = self.result(quantity);
                self.over_modes(of) / (2.0 * std::f64::consts::TAU.powi(2) * frequency)
            }
        }
    }

    /// The derivatives of the coordinates of a point on a vein by numbers that change the leaf and its
    /// photograph; for the nearest point to an unmarked one, only the components normal to the vein.
    pub fn vein_rates(
        &self,
        (responses, photos): (&Responses, &[PhotoRate]),
        (rod, sigma): (usize, f64),
        point: &[&Component],
        slopes: &[f64],
    ) -> Vec<Vec<f64>> {
        let (view, stencils) = (self.view(), self.at.stencils(sigma));
        let coordinates = point.iter().map(|component| match component.what {
            Compared::Vein { coordinate, .. } => coordinate,
            Compared::Result(_) => 0,
        });
        let coordinates: Vec<usize> = coordinates.collect();
        let of_vein = |derivative: usize| {
            self.at.best(|k, level| {
                let base = level.state.base(rod);
                stencils[k][derivative].value(|i| level.state.x[base + i])
            })
        };
        let mut along = vec![0.0; coordinates.len()];
        if point.iter().any(|component| component.free) {
            let slope = of_vein(1);
            let seen = coordinates.iter().map(|k| view.along(*k, slope));
            along = normalized(seen.collect());
        }
        let place = of_vein(0) * self.length();
        let change = |(responses, photo): (&Vec<Response>, &PhotoRate)| -> Vec<f64> {
            let change = self.at.best(|k, level| {
                stencils[k][0].value(|i| shift(&responses[k].of_node(&level.leaf, rod, i)))
            }) * self.length();
            let seen = |k: &usize| view.along(*k, change) + view.rate(*k, place, photo);
            let seen: Vec<f64> = coordinates.iter().map(seen).collect();
            let part: f64 = seen.iter().zip(&along).map(|(a, b)| a * b).sum();
            let both = seen.iter().zip(&along);
            both.map(|(seen, along)| seen - part * along).collect()
        };
        let changes: Vec<Vec<f64>> = responses.each.iter().zip(photos).map(change).collect();
        let row = |place: usize| {
            let all = changes.iter().zip(slopes);
            all.map(|(change, slope)| change[place] * slope).collect()
        };
        (0..coordinates.len()).map(row).collect()
    }
}

/// A vector of length one, or zero.
fn normalized(vector: Vec<f64>) -> Vec<f64> {
    let length = vector.iter().map(|it| it * it).sum::<f64>().sqrt();
    let by = if length > 0.0 { 1.0 / length } else { 0.0 };
    vector.into_iter().map(|it| it * by).collect()
}
