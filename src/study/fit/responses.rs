//! Response of a leaf at rest to changes of the free numbers.
//!
//! The derivatives of the components of a point.
//!
//! A vein as a curve, for the nearest point to a traced one.
//!
//! A model with the accuracy of a search: on the coarsest grids whose error is insignificant
//! relative to the data.

use crate::leaf::{Forces, Leaf, LeafRate, Response};
use crate::relax::{
    Grids, LARGEST_TOLERANCE, Level, Linearized, Lost, NestedEquilibrium, Options, Parameter,
    Stencil,
};
use crate::scenario::PhotoRate;
use crate::study::Keys;
use crate::study::fit::FitError;
use crate::study::fit::data::{Kind, Quantity, Seen, View};
use crate::study::fit::least_squares::Weighting;
use crate::study::fit::model::{CaseAt, Change, Compared, Component, INSIGNIFICANT, Model, Point};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::{Mutex, OnceLock, PoisonError};

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

/// Iterations for the nearest point between two nodes, and its accuracy.
const ITERATIONS: usize = 60;

const EXACT: f64 = 1e-10;

/// A vein at the nodes of its finest grid.
pub(super) struct Vein<'a> {
    at: &'a NestedEquilibrium,
    rod: usize,
    /// Fractions of the length, and positions in the scenario's units.
    nodes: Vec<(f64, DVec3)>,
}

impl<'a> Vein<'a> {
    pub fn of(at: &'a NestedEquilibrium, rod: usize) -> Self {
        let nodes = at.levels.last().map_or(Vec::new(), |level| {
            let (base, length) = (level.state.base(rod), level.leaf.leaf.scale.length);
            let sigma = level.leaf.grid.sigma().iter().enumerate();
            sigma
                .map(|(i, sigma)| (*sigma, level.state.x[base + i] * length))
                .collect()
        });
        Vein { at, rod, nodes }
    }

    /// The point at a fraction of the length, in the scenario's units, and its derivative
    /// with respect to the fraction. The vein is extended straight beyond its ends.
    pub fn point(&self, sigma: f64) -> (DVec3, DVec3) {
        let length = self.at.levels[0].leaf.leaf.scale.length;
        let (mut x, mut slope) = (DVec3::ZERO, DVec3::ZERO);
        for (level, weight) in self.at.levels.iter().zip(&self.at.weights) {
            if *weight != 0.0 {
                let [value, derivative] = <Stencil>::at(&level.leaf, sigma);
                let base = level.state.base(self.rod);
                let node = |i: usize| level.state.x[base + i];
                x += *weight * value.value(node);
                slope += *weight * derivative.value(node);
            }
        }
        (x * length, slope * length)
    }

    /// The fraction of the length nearest to a point with these measured coordinates,
    /// and the point there. The vein is extended straight beyond its ends: a traced
    /// point near an end is compared across the vein like all others, so that noise along
    /// it, half of which is beyond the end, does not lengthen the vein.
    pub fn nearest(&self, seen: &Seen, view: &View) -> (f64, DVec3) {
        let known = || {
            let known = seen.iter().enumerate();
            known.filter_map(|(coordinate, value)| Some((coordinate, (*value)?)))
        };
        let apart = |x: DVec3| known().map(move |(k, value)| (k, view.of(k, x) - value));
        let square = |node: &(f64, DVec3)| apart(node.1).map(|(_, it)| it * it).sum::<f64>();
        let order =
            |a: &usize, b: &usize| square(&self.nodes[*a]).total_cmp(&square(&self.nodes[*b]));
        let last = self.nodes.len().saturating_sub(1);
        let best = (0..=last).min_by(order).unwrap_or(0);
        let [low, high] =
            [best.saturating_sub(1), (best + 1).min(last)].map(|node| self.nodes[node].0);
        // The derivative of half the squared distance, and the point.
        let rate = |sigma: f64| {
            let (x, slope) = self.point(sigma);
            let (mut value, mut squared) = (0.0, 0.0);
            for (k, apart) in apart(x) {
                let slope = view.along(k, slope);
                value += slope * apart;
                squared += slope * slope;
            }
            (value, squared, x)
        };
        // Newton's method without the curvature, then the secant method; bisection where a step
        // leaves the bracket of the zero.
        let mut sigma = self.nodes[best].0;
        let (mut below, mut above) = (low, high);
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..ITERATIONS {
            let (value, squared, x) = rate(sigma);
            let step = match before {
                Some((other, at_other)) if (value - at_other) * (sigma - other) > 0.0 => {
                    -value * (sigma - other) / (value - at_other)
                }
                _ if squared > 0.0 => -value / squared,
                _ => 0.0,
            };
            if step.abs() < EXACT {
                return (sigma, x);
            }
            match value < 0.0 {
                true => below = sigma,
                false => above = sigma,
            }
            let next = sigma + step;
            let ends = [(0.0, below, next < low), (1.0, above, next > high)];
            let beyond = ends.iter().find(|(end, it, out)| *out && end == it);
            before = Some((sigma, value));
            sigma = match beyond {
                // On a straight extension, the first step is exact.
                Some((end, ..)) if sigma == *end => {
                    let beyond = end - value / squared;
                    return (beyond, self.point(beyond).0);
                }
                Some((end, ..)) => {
                    before = None;
                    *end
                }
                None if (below..=above).contains(&next) => next,
                None => 0.5 * (below + above),
            };
        }
        (sigma, self.point(sigma).0)
    }
}

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
