//! What the leaf of a scenario predicts for the data, and how that changes with the
//! free numbers.

use glam::DVec3;
use rayon::prelude::*;

use super::FitError;
use super::data::{Data, Experiment, Measured, Origin, Quantity, Traced};
use super::free::Coordinate;
use super::vein::Vein;
use crate::leaf::{Forces, LeafRate, Response};
use crate::modes;
use crate::motion::Physics;
use crate::newton::Work;
use crate::relax::{AtRest, Equilibrium, Level, Lost, Number, Options, eigenvalue_rate, responses};
use crate::scenario::Scenario;
use crate::study::{Base, Keys};

/// Unknowns of the finest grid on which modes are looked for, but for the first.
const FEW_UNKNOWNS: usize = 4_000;

/// What all points of a fit have in common.
pub(super) struct Model<'a> {
    pub base: &'a Base,
    pub coordinates: &'a [Coordinate],
    pub options: &'a Options,
    pub cases: Vec<Case>,
}

/// A leaf under the conditions of one experiment, and what was seen of it.
pub(super) struct Case {
    pub name: String,
    pub settings: Vec<(Keys, f64)>,
    pub measured: Vec<Measured>,
    pub traced: Vec<Traced>,
    pub origin: Option<Origin>,
}

/// One number that is compared.
#[derive(Clone, Debug)]
pub(super) struct Component {
    /// The experiment.
    pub case: usize,
    pub what: What,
    pub observed: f64,
    pub model: f64,
    /// Its standard deviation, if it is known.
    pub sd: Option<f64>,
    /// Whether another of the same point takes its place in the count: a point beside
    /// a curve says nothing about the place along it.
    pub free: bool,
    pub origin: Option<Origin>,
}

/// What is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum What {
    Result(Quantity),
    /// A coordinate of a point of a rod, at this fraction of its length.
    Vein {
        rod: usize,
        axis: usize,
        sigma: f64,
    },
}

/// A leaf at rest for some values of the free numbers.
pub(super) struct CaseAt {
    pub at: AtRest,
    /// Modes on the first grids.
    modes: Vec<Vec<modes::Eigenpair>>,
    pub components: Vec<Component>,
    /// How it answers each number, on every grid, and the gradients of the
    /// components; empty until asked for.
    responses: Vec<Vec<Response>>,
    pub gradients: Vec<Vec<f64>>,
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
        options: &'a Options,
        data: Data,
    ) -> Result<Self, FitError> {
        let rods = base.scenario().rods.len();
        let case = |experiment: Experiment| Case {
            name: experiment.name,
            settings: experiment.settings,
            measured: experiment.measured,
            traced: Vec::new(),
            origin: experiment.origin,
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
                    });
                    cases.len() - 1
                }),
            };
            cases[place].traced.push(traced);
        }
        cases.retain(|case| !case.measured.is_empty() || !case.traced.is_empty());
        for case in &cases {
            let tip = |m: &&Measured| m.quantity.is_length();
            if let Some(measured) = case.measured.iter().find(tip)
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
            options,
            cases,
        })
    }

    fn values<'s>(&'s self, case: &'s Case, theta: &[f64]) -> Vec<(&'s Keys, f64)> {
        let settings = case.settings.iter().map(|(keys, value)| (keys, *value));
        let free = self.coordinates.iter().zip(theta);
        settings
            .chain(free.map(|(free, theta)| (&free.keys, free.value(*theta))))
            .collect()
    }

    fn scenario(&self, case: &Case, theta: &[f64]) -> Result<Scenario, FitError> {
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
            let found = AtRest::find(&scenario, self.options)?;
            let (at, leaf) = found.map_err(|lost| self.no_equilibrium(case, &lost))?;
            let case_at = self.compare(case, at);
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

    fn no_equilibrium(&self, case: usize, lost: &Lost) -> FitError {
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
            let at = from
                .at
                .follow(&scenario, &from.responses, &steps, self.options)?;
            self.compare(case, at)
        };
        let cases = (0..self.cases.len()).into_par_iter().map(follow);
        Ok(Point {
            theta: theta.to_vec(),
            cases: cases.collect::<Result<_, _>>()?,
        })
    }

    /// Predictions of a leaf at rest, beside the data.
    fn compare(&self, case: usize, at: AtRest) -> Result<CaseAt, Lost> {
        let of = &self.cases[case];
        let frequencies = of
            .measured
            .iter()
            .filter_map(|measured| match measured.quantity {
                Quantity::Frequency(mode) => Some(mode),
                Quantity::Tip(_) => None,
            });
        let count = frequencies.max().unwrap_or(0);
        let mut modes = Vec::new();
        for level in at.levels.iter().filter(|_| count > 0) {
            let unknowns = 6 * level.leaf.rods() * level.leaf.segments();
            if modes.is_empty() || unknowns < FEW_UNKNOWNS {
                let physics = Physics::new(&level.leaf.leaf);
                let pairs = modes::lowest(&level.leaf, &physics, &level.state, count);
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
            responses: Vec::new(),
            gradients: Vec::new(),
        };
        for measured in &of.measured {
            found.components.push(Component {
                case,
                what: What::Result(measured.quantity),
                observed: measured.value.unwrap_or(f64::NAN),
                model: found.result(measured.quantity),
                sd: measured.sd,
                free: false,
                origin: of.origin.clone(),
            });
        }
        let mut veins: Vec<Option<Vein>> = Vec::new();
        for traced in &of.traced {
            veins.resize_with(veins.len().max(traced.rod + 1), || None);
            let vein = veins[traced.rod].get_or_insert_with(|| Vein::of(&found.at, traced.rod));
            let (sigma, beside) = match traced.sigma {
                Some(sigma) => (sigma, false),
                None => vein.nearest(traced.at),
            };
            let model = vein.at(sigma);
            let seen = traced.at.iter().enumerate();
            let seen = seen.filter_map(|(axis, value)| value.map(|value| (axis, value)));
            for (number, (axis, observed)) in seen.enumerate() {
                found.components.push(Component {
                    case,
                    what: What::Vein {
                        rod: traced.rod,
                        axis,
                        sigma,
                    },
                    observed,
                    model: model[axis],
                    sd: traced.sd,
                    free: beside && number == 0,
                    origin: Some(traced.origin.clone()),
                });
            }
        }
        Ok(found)
    }

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
        let terms: Option<Vec<_>> = numbers.iter().map(Number::rate).collect();
        let at_limit = || Lost::NotAtRest("a number is at the limit of what it can be".into());
        let terms = terms.ok_or_else(at_limit)?;
        let leaf = &found.at.levels[0].leaf.leaf;
        let rates: Vec<LeafRate> = terms
            .iter()
            .map(|terms| LeafRate::new(leaf, terms))
            .collect();
        let mut all: Vec<Vec<Response>> = vec![Vec::new(); numbers.len()];
        let tolerance = self.tolerance();
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

    pub fn tolerance(&self) -> f64 {
        let scenario = self.base.scenario();
        self.options.tolerance.unwrap_or(scenario.tolerance)
    }

    /// Standard deviations are known of all data, or of none, which are then lengths.
    pub fn check_deviations(&self, point: &Point) -> Result<bool, FitError> {
        let known = point
            .components()
            .filter(|component| component.sd.is_some())
            .count();
        let all = point.components().count();
        let frequency = |c: &&Component| match c.what {
            What::Result(quantity) => !quantity.is_length(),
            What::Vein { .. } => false,
        };
        let frequencies = point.components().filter(frequency).count();
        if known == all {
            return Ok(true);
        }
        if known > 0 {
            let without = point.components().find(|component| component.sd.is_none());
            let place = without
                .and_then(|c| c.origin.as_ref())
                .map(Origin::to_string);
            let place = place.unwrap_or_default();
            return Err(FitError::Data(format!(
                "{place}: has no standard deviation, and others have: give all or none"
            )));
        }
        if frequencies > 0 && frequencies < all {
            return Err(FitError::Data(
                "lengths and frequencies can only be weighed against each other by their standard \
                 deviations: add columns sd_frequency_1, sd_tip_x, ... (sd of points on veins)"
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

impl CaseAt {
    fn length(&self) -> f64 {
        self.at.levels[0].leaf.leaf.scale.length
    }

    fn result(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Tip(axis) => {
                let tip = self.at.best(|_, level| level.state.tip(0));
                tip[axis] * self.length()
            }
            Quantity::Frequency(mode) => {
                let physics = Physics::new(&self.at.levels[0].leaf.leaf);
                self.eigenvalue(mode).max(0.0).sqrt() / (std::f64::consts::TAU * physics.time)
            }
        }
    }

    /// An eigenvalue, extrapolated over the grids on which modes are known.
    fn eigenvalue(&self, mode: usize) -> f64 {
        self.over_modes(|level| self.modes[level][mode - 1].eigenvalue)
    }

    fn over_modes(&self, value: impl Fn(usize) -> f64) -> f64 {
        let segments = self.at.levels.iter().map(|level| level.leaf.segments());
        let segments: Vec<usize> = segments.take(self.modes.len()).collect();
        let weights = crate::relax::extrapolation(&segments, segments.len() - 1);
        weights
            .iter()
            .enumerate()
            .map(|(k, weight)| weight * value(k))
            .sum()
    }

    /// The change of a result with a number of the scenario.
    fn result_rate(
        &self,
        quantity: Quantity,
        (number, rate, answers): (&Number, &LeafRate, &[Response]),
    ) -> f64 {
        match quantity {
            Quantity::Tip(axis) => {
                let tip = |k: usize, level: &Level| {
                    crate::leaf::shift(&answers[k].nodes[0][level.leaf.segments() - 1])
                };
                self.at.best(tip)[axis] * self.length()
            }
            Quantity::Frequency(mode) => {
                let of = |k: usize| {
                    let shape = &self.modes[k][mode - 1].shape;
                    let (level, answer) = (&self.at.levels[k], &answers[k]);
                    eigenvalue_rate(level, number, (rate, answer), shape).unwrap_or(0.0)
                };
                // omega^2 = (2 pi f)^2.
                let frequency = self.result(quantity);
                self.over_modes(of) / (2.0 * std::f64::consts::TAU.powi(2) * frequency)
            }
        }
    }

    /// The changes of the coordinates of a point on a vein; of the nearest one to a
    /// point that was not marked only those across the vein.
    fn vein_rates(
        &self,
        rod: usize,
        sigma: f64,
        point: &[&Component],
        slopes: &[f64],
    ) -> Vec<Vec<f64>> {
        let stencils = self.at.stencils(sigma);
        let axes: Vec<usize> = (point.iter())
            .map(|component| match component.what {
                What::Vein { axis, .. } => axis,
                What::Result(_) => 0,
            })
            .collect();
        let mut along = DVec3::ZERO;
        if point.iter().any(|component| component.free) {
            let slope = self.at.best(|k, level| {
                let base = level.state.base(rod);
                stencils[k].slope(|i| level.state.x[base + i])
            });
            axes.iter().for_each(|&axis| along[axis] = slope[axis]);
            along = along.normalize_or_zero();
        }
        let change = |answers: &Vec<Response>| {
            let change = self.at.best(|k, _| {
                stencils[k].value(|i| match i {
                    0 => DVec3::ZERO,
                    _ => crate::leaf::shift(&answers[k].nodes[rod][i - 1]),
                })
            }) * self.length();
            let mut seen = DVec3::ZERO;
            axes.iter().for_each(|&axis| seen[axis] = change[axis]);
            seen - seen.dot(along) * along
        };
        let changes: Vec<DVec3> = self.responses.iter().map(change).collect();
        let row = |&axis: &usize| {
            let all = changes.iter().zip(slopes);
            all.map(|(change, slope)| change[axis] * slope).collect()
        };
        axes.iter().map(row).collect()
    }
}
