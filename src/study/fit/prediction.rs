//! Predictions of one leaf at rest for its data.
//!
//! Results are extrapolated over the grids of the leaf. A traced point is compared with the point of
//! the vein at the same fraction of its length or, unmarked, with the nearest one; photographs show
//! points by a projection. The linearized equations of the leaf give its response to the free
//! numbers, and with it the start of the leaf at the next values.

use crate::leaf::{LeafParameterDerivative, LinearResponse, ParameterForces};
use crate::modes;
use crate::modes::motion_pairs::MotionPair;
use crate::motion::Physics;
use crate::relax::accuracy::transfer::weights;
use crate::relax::{
    ContinuationFailure, GridLevel, Linearized, NestedEquilibrium, Stencil, small_motion_pairs,
};
use crate::run::Limit;
use crate::scenario::{Photo, PhotoParameterDerivative};
use crate::study::fit::columns::{
    COORDINATE_COLUMNS, DatumDimension, FIRST_PHOTO_COORDINATE, MeasuredQuantity,
    ObservedCoordinates,
};
use crate::study::fit::data::{DataOrigin, ExperimentCase, ObservedExperiment};
use crate::study::fit::free::{FitCoordinate, FreeParameterTarget, OffsetColumn};
use glam::DVec3;
use std::sync::{Mutex, PoisonError};

/// A leaf at rest at some values of the free numbers.
pub(super) struct CaseSolution {
    pub equilibrium: NestedEquilibrium,
    pub vibrations: Vibrations,
    pub scalar_data: Vec<ScalarDatum>,
    /// Its response to the numbers, once computed.
    pub responses: Option<ParameterResponses>,
    /// The gradients of the components; empty until computed.
    pub gradients: Vec<Vec<f64>>,
}

/// What vibrates of a leaf, on its first grids.
pub(super) enum Vibrations {
    /// Its modes.
    Modes(Vec<Vec<modes::Eigenpair>>),
    /// Its small motions, where loads have no potential.
    Motions(Vec<Vec<MotionPair>>),
}

impl Vibrations {
    /// The number of grids.
    fn grids(&self) -> usize {
        match self {
            Vibrations::Modes(modes) => modes.len(),
            Vibrations::Motions(motions) => motions.len(),
        }
    }

    /// Whether a mode has a frequency with derivatives on all grids.
    fn check_frequency(&self, mode: usize) -> Result<(), ContinuationFailure> {
        let Vibrations::Motions(grids) = self else {
            return Ok(());
        };
        let motions = || grids.iter().map(|motions| &motions[mode - 1]);
        let why = if motions().any(|it| it.root.im == 0.0) {
            format!("small motion {mode} does not oscillate: leave out frequency_{mode}")
        } else if motions().any(|it| it.separation < LEAST_SEPARATION) {
            format!(
                "small motion {mode} is about to merge with another one, or has its frequency, and no derivatives: \
                 leave out frequency_{mode}"
            )
        } else {
            return Ok(());
        };
        Err(ContinuationFailure::NotAtRest(why))
    }
}

/// How far from merging with another one a small motion is differentiated: about two hundredths of the load below
/// flutter without damping, which grids of some ten segments locate less well.
const LEAST_SEPARATION: f64 = 0.2;

/// The grids on which a leaf vibrates.
fn vibrating_grids(at: &NestedEquilibrium) -> impl Iterator<Item = &GridLevel> {
    let levels = at.levels.iter().enumerate();
    let small = |(k, level): &(usize, &GridLevel)| {
        *k == 0 || 6 * level.leaf.rods() * level.leaf.segments() < MOST_UNKNOWNS_FOR_MODES
    };
    levels.take_while(small).map(|(_, level)| level)
}

/// How accurate frequencies of a model are.
#[derive(Clone, Copy)]
pub(super) enum FrequencyAccuracy<'a> {
    /// As the grids have it on which the leaf rests.
    OnTheseGrids,
    /// On as many grids as this tolerance of the leaf, and the deviations of the data, need.
    Within { tolerance: f64, limit: &'a Limit },
}

/// Largest relative error of a frequency, over the tolerance of the leaf and in itself, and as a part of the relative
/// standard deviation of the datum. The tolerance itself is accurate enough.
struct FrequencyErrors {
    over_tolerance: f64,
    largest: f64,
    of_deviation: f64,
}

/// The first two are those of frequencies that `relax` lists.
const FREQUENCY_ERRORS: FrequencyErrors = FrequencyErrors {
    over_tolerance: 40.0,
    largest: 4e-5,
    of_deviation: 0.1,
};

impl FrequencyErrors {
    /// The largest relative error of the frequencies that are compared with these data.
    fn allowed(&self, of: &ExperimentCase, tolerance: f64) -> f64 {
        let deviation = of.measured_values().filter_map(|measured| {
            let MeasuredQuantity::Frequency(_) = measured.quantity else {
                return None;
            };
            Some(self.of_deviation * measured.sd? / measured.value?.abs())
        });
        let listed = (self.over_tolerance * tolerance).min(self.largest);
        deviation.fold(listed, f64::min).max(tolerance)
    }
}

fn lost_frequencies() -> ContinuationFailure {
    ContinuationFailure::NotAtRest("its frequencies cannot be found".into())
}

impl Vibrations {
    /// So many modes or small motions on the grids of a leaf.
    fn on_grids(at: &NestedEquilibrium, count: usize) -> Result<Self, ContinuationFailure> {
        let mut found = match at.levels.iter().all(|it| it.leaf.leaf.has_potential()) {
            true => Vibrations::Modes(Vec::new()),
            false => Vibrations::Motions(Vec::new()),
        };
        if count > 0 {
            for level in vibrating_grids(at) {
                found.add_grid(level, count)?;
            }
        }
        Ok(found)
    }

    /// Adds so many modes or small motions on the next grid.
    fn add_grid(&mut self, level: &GridLevel, count: usize) -> Result<(), ContinuationFailure> {
        match self {
            Vibrations::Modes(grids) => {
                let pairs = modes::unsoftened_modes(&level.leaf, &level.state, count);
                let pairs = pairs.filter(|pairs| pairs.len() == count);
                grids.push(pairs.ok_or_else(lost_frequencies)?);
            }
            Vibrations::Motions(grids) => {
                let pairs = small_motion_pairs(level, count).filter(|pairs| pairs.len() == count);
                grids.push(pairs.ok_or_else(lost_frequencies)?);
            }
        }
        Ok(())
    }

    /// The frequency of a mode on a grid; the square root of its size where the leaf is unstable.
    fn frequency(&self, grid: usize, mode: usize) -> f64 {
        match self {
            Vibrations::Modes(grids) => grids[grid][mode - 1].eigenvalue.abs().sqrt(),
            Vibrations::Motions(grids) => grids[grid][mode - 1].root.im,
        }
    }

    /// Whether the frequencies of all these modes, extrapolated over these grids, are as accurate: the extrapolated
    /// value without the finest grid is no farther from it.
    fn are_accurate(&self, segments: &[usize], modes: &[usize], allowed: f64) -> bool {
        let extrapolated = |mode: usize, grids: usize| {
            let weights = weights(&segments[..grids], f64::INFINITY);
            let terms = weights.iter().enumerate();
            terms
                .map(|(grid, weight)| weight * self.frequency(grid, mode))
                .sum::<f64>()
        };
        let grids = self.grids();
        grids > 1
            && modes.iter().all(|&mode| {
                let [before, all] = [grids - 1, grids].map(|grids| extrapolated(mode, grids));
                (before - all).abs() <= allowed * all.abs()
            })
    }
}

/// A leaf at rest with its vibrations on grids that are fine enough for these.
fn vibrating_leaf(
    of: &ExperimentCase,
    mut at: NestedEquilibrium,
    accuracy: FrequencyAccuracy,
) -> Result<(NestedEquilibrium, Vibrations), ContinuationFailure> {
    let modes = of
        .measured_values()
        .filter_map(|measured| match measured.quantity {
            MeasuredQuantity::Frequency(mode) => Some(mode),
            _ => None,
        });
    let modes: Vec<usize> = modes.collect();
    let count = modes.iter().copied().max().unwrap_or(0);
    let mut vibrations = Vibrations::on_grids(&at, count)?;
    let FrequencyAccuracy::Within { tolerance, limit } = accuracy else {
        return Ok((at, vibrations));
    };
    let allowed = FREQUENCY_ERRORS.allowed(of, tolerance);
    while count > 0 && vibrations.grids() == at.levels.len() {
        let segments: Vec<usize> = at.levels.iter().map(|it| it.leaf.segments()).collect();
        if vibrations.are_accurate(&segments, &modes, allowed) {
            break;
        }
        let unknowns = |level: &GridLevel| 6 * level.leaf.rods() * level.leaf.segments();
        let finest = at.levels.last().map_or(0, unknowns);
        if 2 * finest >= MOST_UNKNOWNS_FOR_MODES {
            break;
        }
        let Some(finer) = at.level_on_next_grid(limit) else {
            break;
        };
        vibrations.add_grid(&finer, count)?;
        let levels = at.levels.iter().cloned().chain([finer]).collect();
        at = at.without_estimates().with_levels(levels);
    }
    Ok((at, vibrations))
}

/// Largest number of unknowns of a grid on which modes are computed, except the first.
const MOST_UNKNOWNS_FOR_MODES: usize = 4_000;

impl CaseSolution {
    /// Predictions of a leaf at rest for the data under these conditions: on more grids where frequencies need these.
    pub fn new(
        of: &ExperimentCase,
        at: NestedEquilibrium,
        accuracy: FrequencyAccuracy,
    ) -> Result<CaseSolution, ContinuationFailure> {
        let (at, vibrations) = vibrating_leaf(of, at, accuracy)?;
        for measured in of.measured_values() {
            if let MeasuredQuantity::Frequency(mode) = measured.quantity {
                vibrations.check_frequency(mode)?;
            }
        }
        let mut found = CaseSolution {
            equilibrium: at,
            vibrations,
            scalar_data: Vec::new(),
            responses: None,
            gradients: Vec::new(),
        };
        let mut veins = Vec::new();
        let observed = of.experiments.iter();
        let components = observed.flat_map(|of| found.experiment_data(of, &mut veins));
        found.scalar_data = components.collect();
        Ok(found)
    }

    fn experiment_data<'v>(
        &'v self,
        of: &ObservedExperiment,
        veins: &mut Vec<Option<VeinInterpolant<'v>>>,
    ) -> Vec<ScalarDatum> {
        let mut components = Vec::new();
        let view = self.photo_projection();
        for measured in &of.experiment.measured {
            components.push(ScalarDatum {
                experiment: of.number,
                quantity: DatumQuantity::Result(measured.quantity),
                observed: measured.value.unwrap_or(f64::NAN),
                model: self.predicted_result(measured.quantity),
                sd: measured.sd,
                is_uninformative: false,
                origin: of.experiment.origin.clone(),
            });
        }
        for traced in &of.traced {
            veins.resize_with(veins.len().max(traced.rod + 1), || None);
            let vein = veins[traced.rod].get_or_insert_with(|| {
                VeinInterpolant::from_equilibrium(&self.equilibrium, traced.rod)
            });
            let beside = traced.sigma.is_none();
            let nearest = match traced.sigma {
                Some(sigma) => vein.point(sigma),
                None => vein.nearest_point(&traced.coordinates, &view),
            };
            let seen = traced.coordinates.iter().enumerate();
            let seen = seen.filter_map(|(k, value)| value.map(|value| (k, value)));
            for (number, (coordinate, observed)) in seen.enumerate() {
                components.push(ScalarDatum {
                    experiment: of.number,
                    quantity: DatumQuantity::Vein {
                        rod: traced.rod,
                        coordinate,
                        sigma: nearest.sigma,
                    },
                    observed,
                    model: view.project_point(coordinate, nearest.position),
                    sd: traced.sd,
                    is_uninformative: beside && number == 0,
                    origin: Some(traced.origin.clone()),
                });
            }
        }
        components
    }

    /// Its response to steps of the numbers on these grids, each of which must be one of its
    /// own; empty if there are no steps.
    pub fn response_to_steps(
        &self,
        levels: &[GridLevel],
        steps: &[f64],
    ) -> Result<Vec<LinearResponse>, ContinuationFailure> {
        let none = |level: &GridLevel| LinearResponse::zeros(&level.leaf);
        match &self.responses {
            Some(responses) if steps.iter().any(|step| *step != 0.0) => {
                responses.response_to_steps(levels, steps)
            }
            _ => Ok(levels.iter().map(none).collect()),
        }
    }

    /// How points on its veins are seen.
    pub fn photo_projection(&self) -> ObservationModel<'_> {
        ObservationModel::new(self.photograph())
    }

    fn photograph(&self) -> Option<&Photo> {
        let leaf = &self.equilibrium.levels[0].leaf.leaf;
        leaf.scenario().photo.as_ref()
    }

    pub fn leaf_length(&self) -> f64 {
        self.equilibrium.levels[0].leaf.leaf.scale.length
    }

    pub fn force_unit(&self) -> f64 {
        self.equilibrium.levels[0].leaf.leaf.scale.force()
    }

    /// The unit of such data in which numbers of the leaf are about one.
    pub fn data_unit(&self, kind: DatumDimension) -> f64 {
        match kind {
            DatumDimension::Length => self.leaf_length(),
            DatumDimension::Pixel => {
                self.leaf_length() / self.photograph().map_or(1.0, |photo| photo.scale)
            }
            DatumDimension::Force => self.force_unit(),
            DatumDimension::Frequency => {
                let physics = Physics::new(&self.equilibrium.levels[0].leaf.leaf);
                1.0 / (std::f64::consts::TAU * physics.time_unit)
            }
        }
    }

    pub fn predicted_result(&self, quantity: MeasuredQuantity) -> f64 {
        match quantity {
            MeasuredQuantity::Tip(axis) => {
                let tip = self
                    .equilibrium
                    .extrapolated_value(|_, level| level.state.tip(0));
                tip[axis] * self.leaf_length()
            }
            MeasuredQuantity::Reaction(axis) => {
                let force = self
                    .equilibrium
                    .extrapolated_value(|_, level| level.leaf.reaction(&level.state).force);
                force[axis] * self.force_unit()
            }
            MeasuredQuantity::Grip(grip, axis) => {
                let force =
                    |_, level: &GridLevel| level.leaf.grip_reactions(&level.state)[grip].force;
                self.equilibrium.extrapolated_value(force)[axis] * self.force_unit()
            }
            MeasuredQuantity::Frequency(mode) => {
                let frequency = match &self.vibrations {
                    Vibrations::Modes(modes) => {
                        let eigenvalue =
                            self.extrapolate_over_grids(|level| modes[level][mode - 1].eigenvalue);
                        eigenvalue.max(0.0).sqrt()
                    }
                    Vibrations::Motions(motions) => {
                        self.extrapolate_over_grids(|level| motions[level][mode - 1].root.im)
                    }
                };
                frequency * self.data_unit(DatumDimension::Frequency)
            }
        }
    }

    /// A number of the modes, extrapolated over the grids with modes.
    pub fn extrapolate_over_grids(&self, value: impl Fn(usize) -> f64) -> f64 {
        let segments = self
            .equilibrium
            .levels
            .iter()
            .map(|level| level.leaf.segments());
        let segments: Vec<usize> = segments.take(self.vibrations.grids()).collect();
        let weights = weights(&segments, f64::INFINITY);
        weights
            .iter()
            .enumerate()
            .map(|(k, weight)| weight * value(k))
            .sum()
    }
}

#[derive(Clone, Debug)]
pub(super) struct ScalarDatum {
    /// The number of its experiment.
    pub experiment: usize,
    pub quantity: DatumQuantity,
    pub observed: f64,
    pub model: f64,
    /// Its standard deviation, if known.
    pub sd: Option<f64>,
    /// Whether it does not count as a datum: the distance of a point from a curve contains no
    /// information on the position along it.
    pub is_uninformative: bool,
    pub origin: Option<DataOrigin>,
}

impl ScalarDatum {
    /// Whether a coordinate is the offset of its column.
    pub fn has_offset(&self, free: &FitCoordinate) -> bool {
        match (&free.number, self.quantity) {
            (
                FreeParameterTarget::Offset(OffsetColumn::Result(of)),
                DatumQuantity::Result(what),
            ) => *of == what,
            _ => false,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum DatumQuantity {
    Result(MeasuredQuantity),
    /// One of [`COORDINATE_COLUMNS`] of a point on a rod, at this fraction of its length.
    Vein {
        rod: usize,
        coordinate: usize,
        sigma: f64,
    },
}

impl DatumQuantity {
    pub fn dimension(self) -> DatumDimension {
        match self {
            DatumQuantity::Result(quantity) => quantity.dimension(),
            DatumQuantity::Vein { coordinate, .. } if coordinate >= FIRST_PHOTO_COORDINATE => {
                DatumDimension::Pixel
            }
            DatumQuantity::Vein { .. } => DatumDimension::Length,
        }
    }

    /// The name of its column in the data.
    pub fn column(self) -> String {
        match self {
            DatumQuantity::Result(quantity) => quantity.to_string(),
            DatumQuantity::Vein { coordinate, .. } => COORDINATE_COLUMNS[coordinate].into(),
        }
    }

    /// The name of the column of its standard deviation.
    pub fn deviation_column(self) -> String {
        match self {
            DatumQuantity::Result(quantity) => format!("sd_{quantity}"),
            DatumQuantity::Vein { .. } => "sd".into(),
        }
    }
}

/// How coordinates follow from positions: each is a . x + b.
pub(super) struct ObservationModel<'p> {
    photo: Option<&'p Photo>,
    linear_forms: [(DVec3, f64); COORDINATE_COLUMNS.len()],
}

impl<'p> ObservationModel<'p> {
    pub fn new(photo: Option<&'p Photo>) -> Self {
        let nowhere = [(DVec3::ZERO, f64::NAN); 2];
        let [x, y] = photo.map_or(nowhere, Photo::projection);
        let rows = [(DVec3::X, 0.0), (DVec3::Y, 0.0), (DVec3::Z, 0.0), x, y];
        ObservationModel {
            photo,
            linear_forms: rows,
        }
    }

    pub fn project_point(&self, coordinate: usize, point: DVec3) -> f64 {
        let (row, offset) = self.linear_forms[coordinate];
        row.dot(point) + offset
    }

    /// The change of a coordinate as the point moves.
    pub fn project_displacement(&self, coordinate: usize, change: DVec3) -> f64 {
        self.linear_forms[coordinate].0.dot(change)
    }

    /// The change of a coordinate of a point as its photograph changes.
    pub fn photo_derivative(
        &self,
        coordinate: usize,
        point: DVec3,
        by: &PhotoParameterDerivative,
    ) -> f64 {
        match (self.photo, coordinate.checked_sub(FIRST_PHOTO_COORDINATE)) {
            (Some(photo), Some(axis)) => photo.rate(point, by)[axis],
            _ => 0.0,
        }
    }

    /// Where a traced point is in space, as far as that is known.
    pub fn position_in_space(&self, seen: &ObservedCoordinates) -> [Option<f64>; 3] {
        match (
            self.photo,
            seen[FIRST_PHOTO_COORDINATE],
            seen[FIRST_PHOTO_COORDINATE + 1],
        ) {
            (Some(photo), Some(x), Some(y)) => photo.point_at_pixel([x, y]),
            _ => [seen[0], seen[1], seen[2]],
        }
    }
}

/// Iterations for the nearest point between two nodes, and its accuracy.
const NEAREST_POINT_ITERATIONS: usize = 60;

const NEAREST_POINT_ACCURACY: f64 = 1e-10;

#[derive(Clone, Copy)]
pub(super) struct VeinPoint {
    /// Fraction of the length; outside 0 to 1 on a straight extension.
    sigma: f64,
    /// In the scenario's units.
    position: DVec3,
}

/// A point of a vein with its tangent, both in the scenario's units.
struct PointWithTangent {
    position: DVec3,
    /// The derivative with respect to the fraction of the length.
    tangent: DVec3,
}

pub(super) struct VeinInterpolant<'a> {
    equilibrium: &'a NestedEquilibrium,
    rod: usize,
    /// The nodes of the finest grid.
    nodes: Vec<VeinPoint>,
}

impl<'a> VeinInterpolant<'a> {
    pub fn from_equilibrium(at: &'a NestedEquilibrium, rod: usize) -> Self {
        let nodes = at.levels.last().map_or(Vec::new(), |level| {
            let (base, length) = (level.state.base(rod), level.leaf.leaf.scale.length);
            let sigma = level.leaf.grid.sigma().iter().enumerate();
            sigma
                .map(|(i, sigma)| VeinPoint {
                    sigma: *sigma,
                    position: level.state.x[base + i] * length,
                })
                .collect()
        });
        VeinInterpolant {
            equilibrium: at,
            rod,
            nodes,
        }
    }

    /// The point at a fraction of the length. The vein is extended straight beyond its ends.
    fn point(&self, sigma: f64) -> VeinPoint {
        let position = self.point_with_tangent(sigma).position;
        VeinPoint { sigma, position }
    }

    fn point_with_tangent(&self, sigma: f64) -> PointWithTangent {
        let length = self.equilibrium.levels[0].leaf.leaf.scale.length;
        let (mut x, mut slope) = (DVec3::ZERO, DVec3::ZERO);
        for (level, weight) in self
            .equilibrium
            .levels
            .iter()
            .zip(&self.equilibrium.weights)
        {
            if *weight != 0.0 {
                let [value, derivative] =
                    <Stencil>::value_and_derivative_stencils(&level.leaf, sigma);
                let base = level.state.base(self.rod);
                let node = |i: usize| level.state.x[base + i];
                x += *weight * value.value(node);
                slope += *weight * derivative.value(node);
            }
        }
        PointWithTangent {
            position: x * length,
            tangent: slope * length,
        }
    }

    /// The point nearest to one with these measured coordinates. The vein is extended straight
    /// beyond its ends: a traced
    /// point near an end is compared across the vein like all others, so that noise along
    /// it, half of which is beyond the end, does not lengthen the vein.
    pub fn nearest_point(&self, seen: &ObservedCoordinates, view: &ObservationModel) -> VeinPoint {
        let known = || {
            let known = seen.iter().enumerate();
            known.filter_map(|(coordinate, value)| Some((coordinate, (*value)?)))
        };
        let apart = |x: DVec3| known().map(move |(k, value)| (k, view.project_point(k, x) - value));
        let square = |node: &VeinPoint| apart(node.position).map(|(_, it)| it * it).sum::<f64>();
        let order =
            |a: &usize, b: &usize| square(&self.nodes[*a]).total_cmp(&square(&self.nodes[*b]));
        let last = self.nodes.len().saturating_sub(1);
        let best = (0..=last).min_by(order).unwrap_or(0);
        let [low, high] =
            [best.saturating_sub(1), (best + 1).min(last)].map(|node| self.nodes[node].sigma);
        // The derivative of half the squared distance, and the point.
        let rate = |sigma: f64| {
            let PointWithTangent {
                position: x,
                tangent: slope,
            } = self.point_with_tangent(sigma);
            let (mut value, mut squared) = (0.0, 0.0);
            for (k, apart) in apart(x) {
                let slope = view.project_displacement(k, slope);
                value += slope * apart;
                squared += slope * slope;
            }
            (value, squared, x)
        };
        // Newton's method without the curvature, then the secant method; bisection where a step
        // leaves the bracket of the zero.
        let mut sigma = self.nodes[best].sigma;
        let (mut below, mut above) = (low, high);
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..NEAREST_POINT_ITERATIONS {
            let (value, squared, x) = rate(sigma);
            let step = match before {
                Some((other, at_other)) if (value - at_other) * (sigma - other) > 0.0 => {
                    -value * (sigma - other) / (value - at_other)
                }
                _ if squared > 0.0 => -value / squared,
                _ => 0.0,
            };
            if step.abs() < NEAREST_POINT_ACCURACY {
                return VeinPoint { sigma, position: x };
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
                    return self.point(beyond);
                }
                Some((end, ..)) => {
                    before = None;
                    *end
                }
                None if (below..=above).contains(&next) => next,
                None => 0.5 * (below + above),
            };
        }
        self.point(sigma)
    }
}

/// Relative accuracy of the predicted state from which a leaf is relaxed.
const PREDICTED_STATE_ACCURACY: f64 = 1e-3;

/// The linearized equations of a leaf at rest on every grid, and the force rates of the free
/// numbers.
pub(super) struct ParameterResponses {
    linearized: Mutex<Vec<Linearized>>,
    /// Force rates of each number on every grid.
    force_rates: Vec<Vec<ParameterForces>>,
    /// Response to each number on every grid; empty if the adjoint equations are solved for the
    /// data, since these are fewer.
    pub per_parameter: Vec<Vec<LinearResponse>>,
}

fn singular_matrix_failure() -> ContinuationFailure {
    ContinuationFailure::NotAtRest("the leaf is at a singular point".into())
}

impl ParameterResponses {
    /// The linearized equations at a leaf at rest.
    pub fn new(
        at: &NestedEquilibrium,
        rates: &[LeafParameterDerivative],
        tolerance: f64,
    ) -> ParameterResponses {
        let linear = at.levels.iter();
        let linear: Vec<_> = linear
            .map(|level| Linearized::new(level, tolerance))
            .collect();
        let forces = linear.iter().zip(&at.levels);
        ParameterResponses {
            force_rates: forces
                .map(|(linear, level)| linear.forces(level, rates))
                .collect(),
            linearized: Mutex::new(linear),
            per_parameter: Vec::new(),
        }
    }

    /// Solves them for each number.
    pub fn solve_for_parameters(
        &mut self,
        levels: &[GridLevel],
    ) -> Result<(), ContinuationFailure> {
        let count = self.force_rates.first().map_or(0, Vec::len);
        let mut all = vec![Vec::new(); count];
        let linear = self
            .linearized
            .get_mut()
            .unwrap_or_else(PoisonError::into_inner);
        for ((level, linear), forces) in levels.iter().zip(linear).zip(&self.force_rates) {
            let responses = linear
                .responses(level, forces)
                .ok_or_else(singular_matrix_failure)?;
            for (all, answer) in all.iter_mut().zip(responses) {
                all.push(answer);
            }
        }
        self.per_parameter = all;
        Ok(())
    }

    /// Derivatives of results on one grid with respect to each number, if the results are adjoint
    /// to unit forces on the leaf: by one solution per result.
    pub fn adjoint_derivatives(
        &self,
        k: usize,
        level: &GridLevel,
        units: &[ParameterForces],
    ) -> Result<Vec<Vec<f64>>, ContinuationFailure> {
        let mut all = self
            .linearized
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let linear = &mut all[k];
        let responses = linear
            .responses(level, units)
            .ok_or_else(singular_matrix_failure)?;
        let rates = |answer| {
            let forces = self.force_rates[k].iter();
            forces
                .map(|force| linear.work(level, force, answer))
                .collect()
        };
        Ok(responses.iter().map(rates).collect())
    }

    /// The response on each of these grids to steps of the numbers.
    pub fn response_to_steps(
        &self,
        levels: &[GridLevel],
        steps: &[f64],
    ) -> Result<Vec<LinearResponse>, ContinuationFailure> {
        let on = |(k, level): (usize, &GridLevel)| {
            if !self.per_parameter.is_empty() {
                let mut sum = LinearResponse::zeros(&level.leaf);
                for (responses, step) in self.per_parameter.iter().zip(steps) {
                    sum.add(*step, &responses[k]);
                }
                return Ok(sum);
            }
            let mut sum = ParameterForces::zeros(level.leaf.rods());
            for (forces, step) in self.force_rates[k].iter().zip(steps) {
                sum.add(*step, forces);
            }
            let mut all = self
                .linearized
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            let answer = all[k].responses_to(level, &[sum], PREDICTED_STATE_ACCURACY);
            let answer = answer.ok_or_else(singular_matrix_failure)?;
            answer
                .into_iter()
                .next()
                .ok_or_else(singular_matrix_failure)
        };
        levels.iter().enumerate().map(on).collect()
    }
}
