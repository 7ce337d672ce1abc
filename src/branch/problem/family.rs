//! Leaves that differ in one parameter, or in two.

use std::sync::Arc;

use glam::DVec3;

use crate::branch::problem::cache::{LruCache, Patterns};
use crate::leaf::{DiscreteLeaf, Grid, Leaf, Scale, State, System};
use crate::limit::Limit;
use crate::scenario::Scenario;

/// Up to this stiffness in stretch and shear, in units of A/L^2, the matrix is that of the leaf:
/// tangents and signs of eigenvalues are exact. The forces of stiffer, nearly rigid segments are
/// condensed out with a lower one, `CONDENSING`: near singular points a larger one loses digits.
pub(in crate::branch) const STIFFEST: f64 = 1e7;
const CONDENSING: f64 = 1e5;

/// The value at a fraction of a range, or of that of its logarithm.
pub fn between([from, to]: [f64; 2], log: bool, fraction: f64) -> f64 {
    match log {
        true => from * (to / from).powf(fraction),
        false => from + (to - from) * fraction,
    }
}

/// Fractions within this of an end of the range are at the end.
const EXACT: f64 = 1e-12;

/// Makes the scenario at values of the parameters.
type Make<'a, const N: usize> = &'a (dyn Fn([f64; N]) -> Result<Scenario, String> + Sync);

/// A leaf for all values of N parameters.
#[derive(Clone)]
pub struct Family<'a, const N: usize = 1> {
    make: Make<'a, N>,
    ranges: [Range; N],
    /// The first leaf, in whose units all are.
    first: Leaf,
    /// A leaf with coupled veins, if there is one at an end of a range.
    coupled: Leaf,
    /// Sparsity patterns of their matrices.
    pub patterns: Arc<Patterns>,
    /// When branches of these leaves are followed no further: every Newton iteration checks it.
    pub limit: Limit,
}

/// The range of a parameter.
#[derive(Clone, Copy)]
pub struct Range {
    /// Values at the fractions 0 and 1.
    pub ends: [f64; 2],
    /// Whether fractions are those of the logarithm of the value.
    pub log: bool,
}

impl Range {
    /// The value at a fraction.
    fn value(self, fraction: f64) -> f64 {
        // At an end, rounding must not lead beyond: there may be no leaf.
        match fraction {
            part if part.abs() < EXACT => self.ends[0],
            part if (part - 1.0).abs() < EXACT => self.ends[1],
            part => between(self.ends, self.log, part),
        }
    }

    /// The fraction at a value.
    pub fn fraction(self, value: f64) -> f64 {
        let [from, to] = self.ends;
        match self.log {
            true => (value / from).ln() / (to / from).ln(),
            false => (value - from) / (to - from),
        }
    }
}

/// A value of the parameter that no leaf can have, with the message of the scenario.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct OutOfRange(pub String);

impl<'a> Family<'a> {
    /// The leaves given by `make`, for values of the parameter in this range, in the units of the
    /// first.
    pub fn new(make: Make<'a, 1>, ends: [f64; 2], log: bool) -> Result<Self, OutOfRange> {
        let scale = make([ends[0]]).map_err(OutOfRange)?.scale();
        Family::of(make, [Range { ends, log }], scale, ends.map(|end| [end]))
    }

    /// The parameter at a fraction of its range.
    pub fn value(&self, fraction: f64) -> f64 {
        self.values([fraction])[0]
    }
}

impl<'a> Family<'a, 2> {
    /// The leaves given by `make`, for values of two parameters in these ranges, in the units of
    /// that at the start of the first and at `start` of the second.
    pub fn plane(make: Make<'a, 2>, ranges: [Range; 2], start: f64) -> Result<Self, OutOfRange> {
        let [[from, to], [low, high]] = ranges.map(|range| range.ends);
        let scale = make([from, start]).map_err(OutOfRange)?.scale();
        let ends = [[from, start], [to, start], [from, low], [from, high]];
        Family::of(make, ranges, scale, ends)
    }

    /// Leaves of the same kind, in the same units, along a path with the parameter 0 to 1.
    pub fn along_path<'b>(&self, make: Make<'b, 1>) -> Result<Family<'b>, OutOfRange> {
        let (ends, log) = ([0.0, 1.0], false);
        let family = Family::of(make, [Range { ends, log }], self.scale(), [[0.0], [1.0]])?;
        Ok(Family {
            patterns: self.patterns.clone(),
            limit: self.limit.clone(),
            ..family
        })
    }
}

impl<'a, const N: usize> Family<'a, N> {
    /// In these units, with leaves at these values of the parameters.
    fn of<const ENDS: usize>(
        make: Make<'a, N>,
        ranges: [Range; N],
        scale: Scale,
        ends: [[f64; N]; ENDS],
    ) -> Result<Self, OutOfRange> {
        let leaf = |values| {
            let scenario = make(values).map_err(OutOfRange)?;
            Ok(Leaf::in_units(Arc::new(scenario), scale))
        };
        let ends: Vec<Leaf> = ends.into_iter().map(leaf).collect::<Result<_, _>>()?;
        let is_coupled =
            |leaf: &&Leaf| (1..leaf.rods()).any(|g| leaf.coupling(g - 1) != DVec3::ZERO);
        let coupled = ends.iter().find(is_coupled);
        Ok(Family {
            make,
            ranges,
            coupled: coupled.unwrap_or(&ends[1]).clone(),
            first: ends[0].clone(),
            patterns: Arc::default(),
            limit: Limit::default(),
        })
    }

    /// The same leaves, whose branches are followed until this limit is reached.
    pub fn with_limit(self, limit: Limit) -> Self {
        Family { limit, ..self }
    }

    /// The units of all its leaves.
    pub fn scale(&self) -> Scale {
        self.first.scale
    }

    /// Tips of all rods in the scenario's units: the shared one alone, or each.
    pub fn tips(&self, tips: &[DVec3]) -> Vec<DVec3> {
        let count = if self.first.joined() { 1 } else { tips.len() };
        let tips = tips.iter().take(count);
        tips.map(|tip| *tip * self.scale().length).collect()
    }

    /// Centerlines of a state in the scenario's units, one per rod.
    pub fn curves(&self, state: &State) -> Vec<Vec<DVec3>> {
        let length = self.scale().length;
        let rods = state.x.chunks(state.segments() + 1);
        rods.map(|rod| rod.iter().map(|x| *x * length).collect())
            .collect()
    }

    /// The leaf at the start of the ranges.
    pub fn first(&self) -> &Leaf {
        &self.first
    }

    /// Values of the parameters at fractions of their ranges.
    pub fn values(&self, params: [f64; N]) -> [f64; N] {
        std::array::from_fn(|i| self.ranges[i].value(params[i]))
    }

    /// The scenario at fractions.
    pub fn scenario(&self, params: [f64; N]) -> Result<Scenario, OutOfRange> {
        (self.make)(self.values(params)).map_err(OutOfRange)
    }

    /// The leaf at fractions.
    pub fn leaf(&self, params: [f64; N]) -> Result<Leaf, OutOfRange> {
        Ok(Leaf::in_units(
            Arc::new(self.scenario(params)?),
            self.scale(),
        ))
    }

    /// A system of equations for all its leaves on a grid.
    pub fn system(&self, grid: &Grid) -> System {
        System::new(&discretised(&self.coupled, grid, None))
    }
}

/// A leaf on a grid, if requested softened: see [`Leaves::softened`].
fn discretised(leaf: &Leaf, grid: &Grid, softening: Option<f64>) -> DiscreteLeaf {
    let mut discrete = DiscreteLeaf::new(leaf, grid.clone());
    for section in &mut discrete.sections {
        section.condensing = match softening {
            Some(softening) => (section.compliance + DVec3::splat(softening)).recip(),
            None => {
                let exact = section.compliance.cmpge(DVec3::splat(1.0 / STIFFEST));
                let least = section.condensing.min(DVec3::splat(CONDENSING));
                DVec3::select(exact, section.condensing, least)
            }
        };
    }
    discrete
}

/// The same, with the sections of another leaf on this grid if its rods are the same.
fn discretised_as(
    other: Option<&DiscreteLeaf>,
    leaf: &Leaf,
    grid: &Grid,
    softening: Option<f64>,
) -> DiscreteLeaf {
    let copied = other.and_then(|other| other.with_same_rods(leaf));
    copied.unwrap_or_else(|| discretised(leaf, grid, softening))
}

/// Leaves of a family on one grid. The last few are cached: iterations
/// return to them, and making a scenario costs more than assembling a small leaf.
pub struct Leaves<'a, const N: usize = 1> {
    pub family: &'a Family<'a, N>,
    pub grid: Grid,
    softening: Option<f64>,
    cache: LruCache<[f64; N], DiscreteLeaf, CACHED_LEAVES>,
}

/// Number of cached leaves: those of differences over two parameters, and one more.
const CACHED_LEAVES: usize = 6;

impl<'a, const N: usize> Leaves<'a, N> {
    pub fn new(family: &'a Family<'a, N>, grid: Grid) -> Self {
        Leaves {
            family,
            grid,
            softening: None,
            cache: LruCache::default(),
        }
    }

    /// The same, the matrices being those of leaves with this additional
    /// compliance in stretch and shear (in units of L^2/A), equilibria
    /// unchanged. The soft modes of a nearly rigid leaf are lost to rounding in its matrix;
    /// the point at which they become neutral is analytic in the softening, and can be
    /// extrapolated to zero softening.
    pub fn softened(family: &'a Family<'a, N>, grid: Grid, softening: f64) -> Self {
        Leaves {
            softening: Some(softening),
            ..Leaves::new(family, grid)
        }
    }

    /// The same on the grid with all segments halved.
    pub fn refined(&self) -> Self {
        let (grid, softening) = (self.grid.refined(), self.softening);
        let finer = |before: Option<&DiscreteLeaf>, coarse: &DiscreteLeaf| {
            discretised_as(before, &coarse.leaf, &grid, softening)
        };
        Leaves {
            cache: self.cache.map(finer),
            family: self.family,
            grid,
            softening,
        }
    }

    /// The leaf at these parameters, as fractions of their ranges.
    pub fn at(&mut self, params: [f64; N]) -> Result<&DiscreteLeaf, OutOfRange> {
        let (family, grid, softening) = (self.family, &self.grid, self.softening);
        self.cache.at(params, |last| {
            Ok(discretised_as(last, &family.leaf(params)?, grid, softening))
        })
    }
}

/// Puts the bases of all rods where the leaf holds them, and held tips where it holds them.
pub fn clamp(leaf: &DiscreteLeaf, state: &mut State) {
    leaf.hold(state);
    for j in 0..leaf.rods() {
        let base = state.base(j);
        let (x, q) = leaf.leaf.base(j);
        state.x[base] = x;
        if !leaf.leaf.hinged() {
            state.q[base] = q;
        }
    }
}
