//! Sensitivities of a leaf at rest: derivatives of its results with respect to numbers of its
//! scenario, from the linearized equations on each grid, extrapolated like the results
//! themselves. Derivatives of eigenvalues, of the moments on clamps, and in wind of the forces on supports, are finite
//! differences between neighbouring equilibria, which are known to first order from the response.

use crate::leaf::{
    DiscreteLeaf, Leaf, LeafParameterDerivative, LinearResponse, ParameterForces, State, Weighted,
    displacement_part, rotation_part,
};
use crate::modes::Eigenpair;
use crate::modes::motion_pairs::MotionPair;
use crate::motion::Physics;
use crate::relax::accuracy::richardson::{BestColumn, Extrapolated, Richardson};
use crate::relax::accuracy::transfer::GridLevel;
use crate::relax::linear_response::Linearized;
use crate::relax::plan::UNKNOWNS;
use crate::relax::result::Sensitivity;
use crate::relax::result::forces::{GripReaction, Reaction};
use crate::relax::solve_on_grid::follower_loads::WithoutPotential;
use crate::scenario::{Grip, Scenario, SupportKind};
use crate::{modes, rotation};
use faer::c64;
use glam::DVec3;
use std::sync::Arc;

/// Up to this many numbers the equations are solved for each, which gives all derivatives; for
/// more of them adjoint solutions give those of tips and energy alone.
const MAX_DIRECT_PARAMETERS: usize = 100;

/// A number by which the results are differentiated, with the scenarios that differ in it.
struct DifferentiatedParameter<'n, 'a> {
    key: &'n String,
    parameter: &'n Parameter<'a>,
    /// The derivative of the scenario, as a weighted sum of scenarios.
    rate: Vec<Weighted<Scenario>>,
    /// Scenarios for finite differences; none where no result needs these.
    neighbours: Vec<NeighbouringScenario>,
}

/// Derivatives of the results of a leaf, in its units.
#[derive(Default)]
struct ResultDerivatives<T> {
    tips: T,
    /// The derivative of the energy, as x.
    energy: T,
    /// The derivatives of the eigenvalues, as x.
    eigenvalues: T,
    /// The derivative of the force on the holder of the tip, then those of the moments.
    reaction: T,
    positions: T,
    /// The derivatives of the force and the moment on each grip, one after the other.
    grips: T,
}

impl ResultDerivatives<VectorSeries> {
    /// Adds the derivatives on a grid of so many segments.
    fn push(&mut self, segments: usize, on_grid: ResultDerivatives<Vec<DVec3>>) {
        self.tips.push(segments, on_grid.tips);
        self.energy.push(segments, on_grid.energy);
        self.eigenvalues.push(segments, on_grid.eigenvalues);
        self.reaction.push(segments, on_grid.reaction);
        self.positions.push(segments, on_grid.positions);
        self.grips.push(segments, on_grid.grips);
    }

    fn extrapolated(&self, tolerance: f64) -> ResultDerivatives<Extrapolated<Vec<DVec3>>> {
        ResultDerivatives {
            tips: self.tips.extrapolated(tolerance),
            energy: self.energy.extrapolated(tolerance),
            eigenvalues: self.eigenvalues.extrapolated(tolerance),
            reaction: self.reaction.extrapolated(tolerance),
            positions: self.positions.extrapolated(tolerance),
            grips: self.grips.extrapolated(tolerance),
        }
    }
}

/// The squared frequencies of a leaf on one grid, and the derivatives of its results with respect to
/// each number.
struct DerivativesOnGrid {
    /// In the scenario's unit of time.
    eigenvalues: Vec<f64>,
    derivatives: Vec<ResultDerivatives<Vec<DVec3>>>,
}

/// The derivatives of a leaf's results by these numbers, each of which has a name. `levels`
/// are its grids from coarse to fine. Left out are numbers for which the scenario has no
/// admissible differences, and all numbers if the leaf is at a singular point.
pub(crate) fn sensitivities(
    levels: &[GridLevel],
    numbers: &[(String, Parameter)],
    tolerance: f64,
    modes: usize,
) -> Vec<Sensitivity> {
    let (Some(coarsest), Some(finest)) = (levels.first(), levels.last()) else {
        return Vec::new();
    };
    let leaf = &finest.leaf.leaf;
    let held_in_wind = leaf.in_wind() && leaf.has_placed_supports();
    let differences = modes > 0 || has_clamped_tip(leaf) || has_clamped_grips(leaf) || held_in_wind;
    let known: Vec<DifferentiatedParameter> = (numbers.iter())
        .filter_map(|(key, parameter)| {
            let neighbours = if differences {
                parameter.neighbouring_scenarios()
            } else {
                None
            };
            Some(DifferentiatedParameter {
                key,
                parameter,
                rate: parameter.rate()?,
                neighbours: neighbours.unwrap_or_default(),
            })
        })
        .collect();
    let rates: Vec<LeafParameterDerivative> = (known.iter())
        .map(|number| LeafParameterDerivative::new(leaf, &number.rate))
        .collect();
    let mut found: Vec<ResultDerivatives<VectorSeries>> =
        rates.iter().map(|_| ResultDerivatives::default()).collect();
    let mut eigenvalues = VectorSeries::default();
    for (k, level) in levels.iter().enumerate() {
        let unknowns = 6 * level.leaf.rods() * level.leaf.segments();
        let with_modes = k == 0 || unknowns < UNKNOWNS.quick;
        let grid = SensitivityGrid {
            level,
            tolerance,
            modes: if with_modes { modes } else { 0 },
            stride: level.leaf.segments() / coarsest.leaf.segments(),
        };
        let Some(on_grid) = grid.result_derivatives(&known, &rates) else {
            return Vec::new();
        };
        let segments = level.leaf.segments();
        let squared = on_grid.eigenvalues.into_iter();
        eigenvalues.push(segments, squared.map(|value| DVec3::X * value).collect());
        for (series, derivatives) in found.iter_mut().zip(on_grid.derivatives) {
            series.push(segments, derivatives);
        }
    }
    let stations = coarsest.leaf.grid.sigma();
    let squared = eigenvalues.extrapolated(tolerance).value;
    (known.iter().zip(found))
        .map(|(number, series)| {
            let derivatives = series.extrapolated(tolerance);
            sensitivity(number, leaf, stations, derivatives, &squared)
        })
        .collect()
}

/// Extrapolated derivatives with respect to a number, at these stations, in the scenario's units;
/// the eigenvalues themselves are `squared` frequencies.
fn sensitivity(
    number: &DifferentiatedParameter,
    leaf: &Leaf,
    stations: &[f64],
    derivatives: ResultDerivatives<Extrapolated<Vec<DVec3>>>,
    squared: &[DVec3],
) -> Sensitivity {
    let ResultDerivatives {
        tips,
        energy,
        eigenvalues,
        reaction,
        positions,
        grips,
    } = derivatives;
    let scale = leaf.scale;
    let of = |values: &[DVec3], unit: f64| -> Vec<DVec3> {
        values.iter().map(|value| *value * unit).collect()
    };
    let lowest = eigenvalues.value.first().map(|value| value.x);
    let lowest = lowest.filter(|it| it.is_finite());
    // omega^2 = (2 pi f)^2, and an eigenvalue is omega^2.
    let frequency = |(change, squared): (&DVec3, &DVec3)| {
        let known = squared.x > 0.0 && change.x.is_finite();
        known.then(|| change.x / (2.0 * std::f64::consts::TAU * squared.x.sqrt()))
    };
    let places = positions.value.chunks(stations.len());
    let held = reaction
        .value
        .split_first()
        .map(|(force, moments)| Reaction {
            force: *force * scale.force(),
            moments: has_clamped_tip(leaf).then(|| of(moments, scale.moment())),
            error: None,
            moments_error: None,
        });
    let grip = |(change, grip): (&[DVec3], &Grip)| GripReaction {
        force: change[0] * scale.force(),
        moment: (grip.held == SupportKind::Clamped).then(|| change[1] * scale.moment()),
        error: None,
        moment_error: None,
    };
    let on_grips = grips.value.chunks(2).zip(&leaf.scenario().grips).map(grip);
    Sensitivity {
        key: number.key.clone(),
        value: number.parameter.value,
        tips: of(&tips.value, scale.length),
        tip_error: tips.error.map(|error| error * scale.length),
        energy: energy.value.first().map_or(f64::NAN, |it| it.x) * scale.moment(),
        energy_error: energy.error.map(|error| error * scale.moment()),
        lowest_eigenvalue: lowest,
        lowest_eigenvalue_error: lowest.and(eigenvalues.error),
        frequencies: (eigenvalues.value.iter().zip(squared))
            .map(frequency)
            .collect(),
        tip_reaction_error: (reaction.error)
            .filter(|_| held.is_some())
            .map(|error| error * scale.force()),
        reaction: held,
        grip_reactions: on_grips.collect(),
        grip_reactions_error: (grips.error)
            .filter(|_| !grips.value.is_empty())
            .map(|error| error * scale.force()),
        positions: places.map(|rod| of(rod, scale.length)).collect(),
        positions_error: positions.error.map(|error| error * scale.length),
        stations: stations.to_vec(),
    }
}

fn has_clamped_tip(leaf: &Leaf) -> bool {
    (leaf.tip_support.as_ref()).is_some_and(|held| held.clamps.is_some())
}

fn has_clamped_grips(leaf: &Leaf) -> bool {
    let mut grips = leaf.scenario().grips.iter();
    grips.any(|grip| grip.held == SupportKind::Clamped)
}

/// A grid on which derivatives are computed.
struct SensitivityGrid<'l> {
    level: &'l GridLevel,
    tolerance: f64,
    modes: usize,
    /// Segments between neighbouring nodes of the coarsest grid.
    stride: usize,
}

impl SensitivityGrid<'_> {
    /// The derivatives with respect to each number; `None` if the leaf is at a singular point.
    fn result_derivatives(
        &self,
        known: &[DifferentiatedParameter],
        rates: &[LeafParameterDerivative],
    ) -> Option<DerivativesOnGrid> {
        let (leaf, state) = (&self.level.leaf, &self.level.state);
        let mut linear = Linearized::new(self.level, self.tolerance);
        let forces = linear.forces(self.level, rates);
        // Where loads have no potential the matrix is unsymmetric, and need not have real modes.
        let physics = Physics::new(&leaf.leaf);
        let symmetric = !leaf.has_moments() && !leaf.has_followers() && !leaf.leaf.in_wind();
        let modes = match self.modes > 0 && symmetric {
            true => modes::unsoftened_modes(leaf, state, self.modes),
            false => None,
        };
        let modes = modes.unwrap_or_default();
        // In the scenario's unit of time, as their derivatives are.
        let squared = |mode: &modes::Eigenpair| mode.eigenvalue / physics.time_unit.powi(2);
        let eigenvalues = modes.iter().map(squared).collect();
        let (tip_held, held) = (
            leaf.leaf.tip_support.is_some(),
            leaf.leaf.has_placed_supports(),
        );
        if forces.len() > MAX_DIRECT_PARAMETERS && modes.is_empty() && symmetric && !held {
            return Some(DerivativesOnGrid {
                eigenvalues,
                derivatives: self.tips_by_adjoint(&mut linear, &forces)?,
            });
        }
        let responses = linear.responses(self.level, &forces)?;
        let each = known.iter().zip(rates).zip(forces.iter().zip(&responses));
        let derivatives = each.map(|((number, rate), (forces, response))| {
            let near = &number.neighbours;
            let differences = !near.is_empty() && (held || !modes.is_empty());
            let near =
                differences.then(|| NeighbouringEquilibria::new(self.level, near, rate, response));
            let of_modes = (near.iter())
                .filter(|_| !rate.changes_moments())
                .flat_map(|near| near.eigenvalue_rates(&modes));
            let n = leaf.segments();
            let tip = |j: usize| displacement_part(&response.node_increment(leaf, j, n));
            // The work of dead moments is not part of the energy.
            let works = leaf.dead_moments().map(|it| {
                let turn = rotation_part(&response.node_increment(leaf, 0, it.node));
                it.moment.dot(turn)
            });
            let work: f64 = works.sum();
            ResultDerivatives {
                tips: self.tips().map(tip).collect(),
                energy: match leaf.has_followers() || leaf.leaf.in_wind() {
                    true => Vec::new(),
                    false => vec![DVec3::X * (forces.energy + work)],
                },
                eigenvalues: of_modes.map(|value| DVec3::X * value).collect(),
                reaction: match tip_held {
                    true => self.reaction(near.as_ref(), rate, response),
                    false => Vec::new(),
                },
                positions: self.positions(rate, response),
                grips: self.grip_derivatives(near.as_ref(), rate, response),
            }
        });
        Some(DerivativesOnGrid {
            eigenvalues,
            derivatives: derivatives.collect(),
        })
    }

    fn tips(&self) -> std::ops::Range<usize> {
        let leaf = &self.level.leaf;
        0..if leaf.leaf.joined() { 1 } else { leaf.rods() }
    }

    fn reaction(
        &self,
        near: Option<&NeighbouringEquilibria>,
        rate: &LeafParameterDerivative,
        response: &LinearResponse,
    ) -> Vec<DVec3> {
        let GridLevel { leaf, state } = self.level;
        let mut all = match near.filter(|_| leaf.leaf.in_wind()) {
            Some(near) => vec![near.reaction_force_rate(self.level)],
            None => vec![leaf.reaction_rate(state, rate, response)],
        };
        if has_clamped_tip(&leaf.leaf) {
            all.extend(
                near.iter()
                    .flat_map(|near| near.clamp_moment_rates(self.level)),
            );
        }
        all
    }

    /// The changes of force and moment on every grip.
    fn grip_derivatives(
        &self,
        near: Option<&NeighbouringEquilibria>,
        rate: &LeafParameterDerivative,
        response: &LinearResponse,
    ) -> Vec<DVec3> {
        let GridLevel { leaf, state } = self.level;
        if !leaf.has_grips() {
            return Vec::new();
        }
        let forces = match near.filter(|_| leaf.leaf.in_wind()) {
            Some(near) => near.grip_force_rates(self.level),
            None => leaf.grip_force_rates(state, rate, response),
        };
        let clamped = near.filter(|_| has_clamped_grips(&leaf.leaf));
        let moments = clamped.map_or(vec![DVec3::ZERO; forces.len()], |near| {
            near.grip_moment_rates(self.level)
        });
        forces
            .into_iter()
            .zip(moments)
            .flat_map(<[_; 2]>::from)
            .collect()
    }

    /// Displacements of the nodes that all grids have, rod after rod.
    fn positions(&self, rate: &LeafParameterDerivative, response: &LinearResponse) -> Vec<DVec3> {
        let rods = response.nodes.iter().enumerate();
        let of = |(j, rod): (usize, &Vec<[f64; 6]>)| -> Vec<DVec3> {
            // A clamped base has no equations; a hinged one moves with its hinge.
            let (bases, nodes) = rod.split_at(1 - self.level.leaf.first_node());
            let base = bases
                .first()
                .map_or(rate.base_motion_rate(j).displacement, displacement_part);
            let nodes = nodes.iter().skip(self.stride - 1).step_by(self.stride);
            [base]
                .into_iter()
                .chain(nodes.map(displacement_part))
                .collect()
        };
        rods.flat_map(of).collect()
    }

    /// Derivatives of the tips and of the energy alone, by one adjoint solution for each
    /// component of a tip.
    fn tips_by_adjoint(
        &self,
        linear: &mut Linearized,
        forces: &[ParameterForces],
    ) -> Option<Vec<ResultDerivatives<Vec<DVec3>>>> {
        let units = unit_forces(&self.level.leaf, self.tips().len());
        let adjoint = linear.responses(self.level, &units)?;
        let linear = &*linear;
        let component =
            |forces: &ParameterForces, k: usize| linear.work(self.level, forces, &adjoint[k]);
        let tip = |forces: &ParameterForces, tip: usize| {
            DVec3::from_array([0, 1, 2].map(|axis| component(forces, 3 * tip + axis)))
        };
        let changes = |forces: &ParameterForces| ResultDerivatives {
            tips: self.tips().map(|k| tip(forces, k)).collect(),
            energy: vec![DVec3::X * forces.energy],
            ..ResultDerivatives::default()
        };
        Some(forces.iter().map(changes).collect())
    }
}

/// A unit force on every tip along every axis.
pub(crate) fn unit_forces(leaf: &DiscreteLeaf, tips: usize) -> Vec<ParameterForces> {
    let n = leaf.moving_nodes().len();
    let force = |(tip, axis): (usize, usize)| {
        let mut unit = ParameterForces::zeros(leaf.rods());
        unit.rod_forces_mut(tip, n)[n - 1][3 + axis] = 1.0;
        unit
    };
    let all = (0..tips).flat_map(|tip| (0..3).map(move |axis| (tip, axis)));
    all.map(force).collect()
}

/// The leaf for neighbouring values of a number, at rest to first order, with
/// finite-difference weights.
pub(crate) struct NeighbouringEquilibria(Vec<NeighbouringEquilibrium>);

struct NeighbouringEquilibrium {
    offset: f64,
    weight: f64,
    leaf: DiscreteLeaf,
    state: State,
}

/// When two eigenvalues of a leaf are one that is multiple.
struct MultipleEigenvalue {
    /// Largest relative difference of the eigenvalues.
    eigenvalues: f64,
    /// Largest relative difference of their derivatives.
    derivatives: f64,
    /// Bound on the error of the eigenvalues by rounding, as a part of their largest difference.
    rounding: f64,
}

const MULTIPLE_EIGENVALUE: MultipleEigenvalue = MultipleEigenvalue {
    eigenvalues: 1e-6,
    derivatives: 1e-3,
    rounding: 1e-3,
};

impl NeighbouringEquilibria {
    /// Moves the leaf of a level along its response to each of the scenarios nearby.
    pub fn new(
        level: &GridLevel,
        scenarios: &[NeighbouringScenario],
        rate: &LeafParameterDerivative,
        response: &LinearResponse,
    ) -> NeighbouringEquilibria {
        let leaf = &level.leaf;
        let near = |near: &NeighbouringScenario| {
            let own = Leaf::with_scale(Arc::clone(&near.scenario), leaf.leaf.scale);
            let mut state = displace_along_response(level, rate, response, near.offset);
            let mut there = DiscreteLeaf::new(&own, leaf.grid.clone());
            there.settle_spins(&mut state);
            if own.in_wind() {
                let drag = WithoutPotential::new(&there).wind_forces(&state);
                there.add_nodal_loads(&drag);
            }
            NeighbouringEquilibrium {
                offset: near.offset,
                weight: near.weight,
                leaf: there,
                state,
            }
        };
        NeighbouringEquilibria(scenarios.iter().map(near).collect())
    }

    /// The derivative of the eigenvalue of a mode: that of its Rayleigh quotient between
    /// neighbouring equilibria, as changes of its shape enter in second order only.
    pub fn eigenvalue_rate(&self, mode: &Eigenpair) -> f64 {
        let term = |near: &NeighbouringEquilibrium| {
            near.weight * modes::eigenvalue(&near.leaf, &near.state, mode)
        };
        self.0.iter().map(term).sum()
    }

    /// The derivative of the root of a small motion, per time of the scenario; not a number if memory is short.
    pub fn root_rate(&self, level: &GridLevel, motion: &MotionPair) -> c64 {
        let (own, _) = Physics::for_small_motions(&level.leaf.leaf);
        let term = |near: &NeighbouringEquilibrium| {
            let (physics, _) = Physics::for_small_motions(&near.leaf.leaf);
            let forces = WithoutPotential::in_motion(&near.leaf, &physics);
            let ratio = physics.time_unit / own.time_unit;
            let unbalanced = motion.unbalanced(&near.leaf, &physics, &near.state, &forces, ratio);
            let unbalanced = unbalanced.unwrap_or(c64::new(f64::NAN, f64::NAN));
            -near.weight * unbalanced / own.time_unit
        };
        self.0.iter().map(term).sum()
    }

    /// The derivatives of the eigenvalues of several modes. NaN where a multiple eigenvalue splits: its modes change
    /// differently, and the lower one is another mode on either side.
    fn eigenvalue_rates(&self, modes: &[Eigenpair]) -> Vec<f64> {
        let mut rates: Vec<f64> = modes
            .iter()
            .map(|mode| self.eigenvalue_rate(mode))
            .collect();
        let offsets = self.0.iter().map(|near| near.offset.abs());
        let farthest = offsets.fold(0.0, f64::max);
        let pairs = modes.windows(2).enumerate();
        let equal = |pair: &[Eigenpair]| {
            let [a, b] = [pair[0].eigenvalue, pair[1].eigenvalue];
            (a - b).abs() <= MULTIPLE_EIGENVALUE.eigenvalues * a.abs().max(b.abs())
        };
        for (k, pair) in pairs.filter(|(_, pair)| equal(pair)) {
            let [a, b] = [rates[k], rates[k + 1]];
            let mixed = self.eigenvalue_rate(&pair[0].plus(&pair[1])) - 0.5 * (a + b);
            let rounding = MULTIPLE_EIGENVALUE.eigenvalues
                * MULTIPLE_EIGENVALUE.rounding
                * pair[0].eigenvalue.abs()
                / farthest;
            let same = MULTIPLE_EIGENVALUE.derivatives * a.abs().max(b.abs()) + rounding;
            if !(mixed.abs() <= same && (a - b).abs() <= same) {
                rates[k..k + 2].fill(f64::NAN);
            }
        }
        rates
    }

    /// The derivative of the force on the holder of the tip, on which also the drag next to it acts.
    pub fn reaction_force_rate(&self, level: &GridLevel) -> DVec3 {
        let rates = self.vector_derivatives(level, |leaf, state| vec![leaf.reaction(state).force]);
        rates[0]
    }

    /// The derivatives of the forces on grips, on which also the drag on their nodes acts.
    pub fn grip_force_rates(&self, level: &GridLevel) -> Vec<DVec3> {
        self.vector_derivatives(level, |leaf, state| {
            let reactions = leaf.grip_reactions(state).into_iter();
            reactions.map(|on_grip| on_grip.force).collect()
        })
    }

    /// The derivatives of the moments of the rods on a clamp.
    fn clamp_moment_rates(&self, level: &GridLevel) -> Vec<DVec3> {
        self.vector_derivatives(level, |leaf, state| leaf.reaction(state).moments)
    }

    /// The derivatives of the moments on grips about their middles.
    fn grip_moment_rates(&self, level: &GridLevel) -> Vec<DVec3> {
        self.vector_derivatives(level, |leaf, state| {
            let reactions = leaf.grip_reactions(state).into_iter();
            reactions.map(|on_grip| on_grip.moment).collect()
        })
    }

    fn vector_derivatives(
        &self,
        level: &GridLevel,
        vectors: impl Fn(&DiscreteLeaf, &State) -> Vec<DVec3>,
    ) -> Vec<DVec3> {
        let first = vectors(&level.leaf, &level.state);
        let mut rates = vec![DVec3::ZERO; first.len()];
        for near in &self.0 {
            let found = vectors(&near.leaf, &near.state);
            for ((rate, vector), first) in rates.iter_mut().zip(found).zip(&first) {
                *rate += near.weight * (vector - *first);
            }
        }
        rates
    }
}

/// Steps of finite differences with respect to a parameter, relative to its size.
struct DifferenceSteps {
    /// Where the scenario depends linearly on the parameter: large, since rounding is the only error.
    linear: f64,
    /// For other parameters, with differences of fourth order.
    nonlinear: f64,
    /// For eigenvalues, whose modes may be close together, and for moments on clamps.
    eigenvalues: f64,
    /// Size of a parameter over its unit up to which it counts as zero: squares of smaller numbers, and inverses of their
    /// steps, leave the range of numbers.
    least_size: f64,
}

const STEPS: DifferenceSteps = DifferenceSteps {
    linear: 0.125,
    nonlinear: 1e-3,
    eigenvalues: 3e-4,
    least_size: 1e-100,
};

/// A term of a finite-difference rule.
struct DifferenceTerm {
    /// The offset of the value, in steps.
    steps: f64,
    /// Its weight in the derivative, for a step of one.
    weight: f64,
}

const fn term(steps: f64, weight: f64) -> DifferenceTerm {
    DifferenceTerm { steps, weight }
}

/// The difference of a function that is linear.
const LINEAR_DIFFERENCE_RULE: [DifferenceTerm; 2] = [term(0.0, -1.0), term(1.0, 1.0)];

/// The central difference of fourth order.
const CENTRAL_DIFFERENCE_RULE: [DifferenceTerm; 4] = [
    term(-2.0, 1.0 / 12.0),
    term(-1.0, -2.0 / 3.0),
    term(1.0, 2.0 / 3.0),
    term(2.0, -1.0 / 12.0),
];

/// The one-sided difference of fourth order.
const ONE_SIDED_DIFFERENCE_RULE: [DifferenceTerm; 5] = [
    term(0.0, -25.0 / 12.0),
    term(1.0, 4.0),
    term(2.0, -3.0),
    term(3.0, 4.0 / 3.0),
    term(4.0, -0.25),
];

/// A scenario with another value of a parameter, in a finite difference.
pub(crate) struct NeighbouringScenario<S = Arc<Scenario>> {
    /// Difference of the parameter from its value.
    offset: f64,
    /// Weight of the scenario in the derivative.
    weight: f64,
    scenario: S,
}

/// A numerical parameter of a scenario.
pub(crate) struct Parameter<'a> {
    /// The scenario with another value of the parameter, if that is admissible.
    pub make: Box<dyn Fn(f64) -> Option<Scenario> + Send + Sync + 'a>,
    /// Value of the parameter in the scenario.
    pub value: f64,
    /// Size used for the step where the value is zero.
    pub unit: f64,
    /// Whether the scenario is linear in it.
    pub linear: bool,
}

impl Parameter<'_> {
    fn step_unit(&self) -> f64 {
        match self.value.abs() {
            size if size > STEPS.least_size * self.unit => size,
            _ => self.unit,
        }
    }

    /// Scenarios with their offsets and weights by the first of these rules, in either
    /// direction, all of whose scenarios are admissible.
    fn differences(
        &self,
        step: f64,
        rules: &[&[DifferenceTerm]],
    ) -> Option<Vec<NeighbouringScenario<Scenario>>> {
        let signs = [1.0, -1.0];
        let mut tried = (rules.iter()).flat_map(|rule| signs.map(|sign| (*rule, sign)));
        tried.find_map(|(rule, sign)| {
            let step = sign * step;
            let at = |term: &DifferenceTerm| {
                let offset = term.steps * step;
                Some(NeighbouringScenario {
                    offset,
                    weight: term.weight / step,
                    scenario: (self.make)(self.value + offset)?,
                })
            };
            rule.iter().map(at).collect()
        })
    }

    /// The derivative of the scenario as a weighted sum of scenarios.
    pub fn rate(&self) -> Option<Vec<Weighted<Scenario>>> {
        let found = match self.linear {
            true => self.differences(STEPS.linear * self.step_unit(), &[&LINEAR_DIFFERENCE_RULE]),
            false => self.differences(
                STEPS.nonlinear * self.step_unit(),
                &[&CENTRAL_DIFFERENCE_RULE, &ONE_SIDED_DIFFERENCE_RULE],
            ),
        };
        let terms = found?.into_iter();
        let weighted = terms.map(|near| Weighted {
            weight: near.weight,
            term: near.scenario,
        });
        Some(weighted.collect())
    }

    /// Neighbouring scenarios for the finite difference of a function of the scenario.
    pub fn neighbouring_scenarios(&self) -> Option<Vec<NeighbouringScenario>> {
        let found = self.differences(
            STEPS.eigenvalues * self.step_unit(),
            &[&CENTRAL_DIFFERENCE_RULE, &ONE_SIDED_DIFFERENCE_RULE],
        )?;
        let shared = |near: NeighbouringScenario<Scenario>| NeighbouringScenario {
            offset: near.offset,
            weight: near.weight,
            scenario: Arc::new(near.scenario),
        };
        Some(found.into_iter().map(shared).collect())
    }
}

/// The state, moved along a response.
fn displace_along_response(
    level: &GridLevel,
    rate: &LeafParameterDerivative,
    response: &LinearResponse,
    step: f64,
) -> State {
    let mut state = level.state.clone();
    for j in 0..state.rods() {
        let base = state.base(j);
        let motion = rate.base_motion_rate(j);
        state.x[base] += step * motion.displacement;
        state.q[base] = (rotation::exp(step * motion.rotation) * state.q[base]).normalize();
    }
    response.advance(&mut state, step);
    state
}

/// What the error bar of a derivative is made from.
struct DerivativeBar {
    /// Safety factor on the error by extrapolation: errors of derivatives decrease less regularly
    /// than those of positions.
    safety: f64,
    /// Relative error by rounding.
    rounding: f64,
    /// Relative error by unfinished iterations, as a part of the tolerance.
    iterations: f64,
}

const BAR: DerivativeBar = DerivativeBar {
    safety: 3.0,
    rounding: 1e-10,
    iterations: 0.1,
};

/// Values on successively refined grids, extrapolated together.
#[derive(Default)]
struct VectorSeries(Vec<GridVectors>);

/// Values of a series on one grid.
struct GridVectors {
    segments: usize,
    values: Vec<DVec3>,
}

impl VectorSeries {
    /// Adds the values on a grid of so many segments, if there are as many as before: not all
    /// are known on every grid.
    fn push(&mut self, segments: usize, values: Vec<DVec3>) {
        let last = self.0.last();
        let alike = last.is_none_or(|last| last.values.len() == values.len());
        if !values.is_empty() && alike {
            self.0.push(GridVectors { segments, values });
        }
    }

    /// The extrapolated values, with a common error bound.
    fn extrapolated(&self, tolerance: f64) -> Extrapolated<Vec<DVec3>> {
        let all = self.0.iter().flat_map(|grid| &grid.values);
        let unit = all.fold(0.0_f64, |m, v| m.max(v.abs().max_element()));
        let count = self.0.last().map_or(0, |grid| grid.values.len());
        if unit == 0.0 || count == 0 {
            return Extrapolated {
                value: vec![DVec3::ZERO; count],
                error: (self.0.len() > 1).then_some(0.0),
            };
        }
        let on = |grid: &GridVectors| {
            let numbers = grid.values.iter().flat_map(|v| (*v / unit).to_array());
            (grid.segments, numbers.collect())
        };
        let table: Richardson = self.0.iter().map(on).collect();
        let values = table.extrapolated().chunks(3);
        let error = |best: BestColumn| {
            (BAR.safety * best.error + BAR.rounding + BAR.iterations * tolerance) * unit
        };
        Extrapolated {
            value: values.map(|v| DVec3::from_slice(v) * unit).collect(),
            error: table.best().map(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::relax::{Options, relax_on_grids};
    use crate::scenario::Scenario;

    /// A derivative costs one solution on each grid, and no factorization of its own.
    #[test]
    fn a_number_costs_one_solution_on_a_grid() {
        let text = include_str!("../../scenarios/paper/fig04.toml");
        let scenario = Scenario::from_toml(text).unwrap();
        let options = Options::default();
        let relaxed = relax_on_grids(&scenario, &options, false, &mut |_| {}).unwrap();
        let found = relaxed.on_grids;
        for level in &found.levels {
            let mut linear = Linearized::new(level, 1e-6);
            let units = super::unit_forces(&level.leaf, 1);
            let loads: Vec<ParameterForces> = units.iter().cycle().take(10).cloned().collect();
            assert_eq!(linear.responses(level, &loads).unwrap().len(), 10);
            assert_eq!((linear.solves, linear.factorizations), (10, 1));
        }
    }
}
