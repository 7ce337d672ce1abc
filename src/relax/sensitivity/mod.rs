//! Sensitivities of a leaf at rest: derivatives of its results with respect to numbers of its
//! scenario, from the linearised equations on each grid, extrapolated like the results
//! themselves.

mod nearby;
pub mod parameter;
mod response;
mod series;

pub(crate) use self::nearby::Nearby;
pub(crate) use self::response::Linearized;
use self::series::Series;
use crate::leaf::{DiscreteLeaf, Forces, Leaf, LeafRate, Response, shift, turn};
use crate::modes;
use crate::motion::Physics;
use crate::relax::result::equilibrium::Sensitivity;
use crate::relax::result::reaction::{GripReaction, Reaction};
use crate::relax::sensitivity::parameter::Parameter;
use crate::relax::transfer::level::Level;
use crate::scenario::{Grip, Hold, Scenario};
use glam::DVec3;
use std::sync::Arc;

/// Up to this many numbers the equations are solved for each, which gives all derivatives; for
/// more of them adjoint solutions give those of tips and energy alone.
const MOST_DIRECT: usize = 100;

/// Grids with fewer unknowns than this have their eigenvalues differentiated, and the coarsest
/// in any case.
const FEW_UNKNOWNS: usize = 4_000;

/// A number with its name, the derivative of the scenario, and neighbouring scenarios if they
/// are needed.
type Known<'n, 'a> = (
    &'n String,
    &'n Parameter<'a>,
    Vec<(f64, Scenario)>,
    Vec<(f64, f64, Arc<Scenario>)>,
);

/// Derivatives on one grid, in the leaf's units: of the tips, the energy, the eigenvalues (numbers
/// as x), the reaction (force, then moments), the positions, and the grips' reactions (of each the
/// force and the moment).
type Changes = [Vec<DVec3>; 6];

/// The derivatives of a leaf's results by these numbers, each of which has a name. `levels`
/// are its grids from coarse to fine. Left out are numbers for which the scenario has no
/// admissible differences, and all numbers if the leaf is at a singular point.
pub(crate) fn sensitivities(
    levels: &[Level],
    numbers: &[(String, Parameter)],
    tolerance: f64,
    modes: usize,
) -> Vec<Sensitivity> {
    let (Some(coarsest), Some(finest)) = (levels.first(), levels.last()) else {
        return Vec::new();
    };
    let leaf = &finest.leaf.leaf;
    let differences = modes > 0 || is_clamped(leaf) || has_clamped_grips(leaf);
    let known: Vec<Known> = (numbers.iter())
        .filter_map(|(key, number)| {
            let near = if differences { number.nearby() } else { None };
            Some((key, number, number.rate()?, near.unwrap_or_default()))
        })
        .collect();
    let rates: Vec<LeafRate> = (known.iter())
        .map(|(_, _, terms, _)| LeafRate::new(leaf, terms))
        .collect();
    let mut found: Vec<[Series; 6]> = rates.iter().map(|_| Default::default()).collect();
    let mut eigenvalues = Series::default();
    for (k, level) in levels.iter().enumerate() {
        let unknowns = 6 * level.leaf.rods() * level.leaf.segments();
        let with_modes = k == 0 || unknowns < FEW_UNKNOWNS;
        let grid = Grid {
            level,
            tolerance,
            modes: if with_modes { modes } else { 0 },
            stride: level.leaf.segments() / coarsest.leaf.segments(),
        };
        let Some((squared, changes)) = grid.changes(&known, &rates) else {
            return Vec::new();
        };
        let segments = level.leaf.segments();
        let squared = squared.into_iter().map(|value| DVec3::X * value);
        eigenvalues.push(segments, squared.collect());
        for (series, changes) in found.iter_mut().zip(changes) {
            for (series, values) in series.iter_mut().zip(changes) {
                series.push(segments, values);
            }
        }
    }
    let stations = coarsest.leaf.grid.sigma();
    let (eigenvalues, _) = eigenvalues.extrapolated(tolerance);
    (known.iter().zip(found))
        .map(|((key, number, ..), series)| {
            let all = series.map(|series| series.extrapolated(tolerance));
            sensitivity((key, number.value), (leaf, stations), all, &eigenvalues)
        })
        .collect()
}

/// Extrapolated derivatives with respect to a number, at these stations, in the scenario's units;
/// the eigenvalues themselves are `squared` frequencies.
fn sensitivity(
    (key, value): (&str, f64),
    (leaf, stations): (&Leaf, &[f64]),
    [tips, energy, eigenvalues, reaction, positions, grips]: [(Vec<DVec3>, Option<f64>); 6],
    squared: &[DVec3],
) -> Sensitivity {
    let scale = leaf.scale;
    let of = |values: &[DVec3], unit: f64| -> Vec<DVec3> {
        values.iter().map(|value| *value * unit).collect()
    };
    let lowest = eigenvalues.0.first().map(|value| value.x);
    let lowest = lowest.filter(|it| it.is_finite());
    // omega^2 = (2 pi f)^2, and an eigenvalue is omega^2.
    let frequency = |(change, squared): (&DVec3, &DVec3)| {
        let known = squared.x > 0.0 && change.x.is_finite();
        known.then(|| change.x / (2.0 * std::f64::consts::TAU * squared.x.sqrt()))
    };
    let places = positions.0.chunks(stations.len());
    let held = reaction.0.split_first().map(|(force, moments)| Reaction {
        force: *force * scale.force(),
        moments: is_clamped(leaf).then(|| of(moments, scale.moment())),
        error: None,
        moments_error: None,
    });
    let grip = |(change, grip): (&[DVec3], &Grip)| GripReaction {
        force: change[0] * scale.force(),
        moment: (grip.held == Hold::Clamped).then(|| change[1] * scale.moment()),
        error: None,
        moment_error: None,
    };
    let on_grips = grips.0.chunks(2).zip(&leaf.scenario().grips).map(grip);
    Sensitivity {
        key: key.to_owned(),
        value,
        tips: of(&tips.0, scale.length),
        tip_error: tips.1.map(|error| error * scale.length),
        energy: energy.0.first().map_or(f64::NAN, |it| it.x) * scale.moment(),
        energy_error: energy.1.map(|error| error * scale.moment()),
        lowest_eigenvalue: lowest,
        lowest_eigenvalue_error: lowest.and(eigenvalues.1),
        frequencies: eigenvalues.0.iter().zip(squared).map(frequency).collect(),
        tip_reaction_error: (reaction.1)
            .filter(|_| held.is_some())
            .map(|error| error * scale.force()),
        reaction: held,
        grip_reactions: on_grips.collect(),
        grip_reactions_error: (grips.1)
            .filter(|_| !grips.0.is_empty())
            .map(|error| error * scale.force()),
        positions: places.map(|rod| of(rod, scale.length)).collect(),
        positions_error: positions.1.map(|error| error * scale.length),
        stations: stations.to_vec(),
    }
}

fn is_clamped(leaf: &Leaf) -> bool {
    (leaf.held.as_ref()).is_some_and(|held| held.clamps.is_some())
}

fn has_clamped_grips(leaf: &Leaf) -> bool {
    let mut grips = leaf.scenario().grips.iter();
    grips.any(|grip| grip.held == Hold::Clamped)
}

/// A grid on which derivatives are computed.
struct Grid<'l> {
    level: &'l Level,
    tolerance: f64,
    modes: usize,
    /// Segments between neighbouring nodes of the coarsest grid.
    stride: usize,
}

impl Grid<'_> {
    /// The squared frequencies, and the derivatives with respect to each number.
    fn changes(&self, known: &[Known], rates: &[LeafRate]) -> Option<(Vec<f64>, Vec<Changes>)> {
        let (leaf, state) = (&self.level.leaf, &self.level.state);
        let mut linear = Linearized::new(self.level, self.tolerance);
        let forces = linear.forces(self.level, rates);
        // A dead moment has no potential, and the unsymmetric matrix need not have real modes.
        let physics = Physics::new(&leaf.leaf);
        let modes = match self.modes > 0 && !leaf.has_moments() {
            true => modes::loaded(leaf, state, self.modes),
            false => None,
        };
        let modes = modes.unwrap_or_default();
        // In the scenario's unit of time, as their derivatives are.
        let squared = |mode: &modes::Eigenpair| mode.eigenvalue / physics.time.powi(2);
        let eigenvalues = modes.iter().map(squared).collect();
        let (tip_held, held) = (leaf.leaf.held.is_some(), leaf.leaf.is_held());
        if forces.len() > MOST_DIRECT && modes.is_empty() && !leaf.has_moments() && !held {
            return Some((eigenvalues, self.tips_by_adjoint(&mut linear, &forces)?));
        }
        let responses = linear.responses(self.level, &forces)?;
        let each = known.iter().zip(rates).zip(forces.iter().zip(&responses));
        let changes = each.map(|(((_, _, _, near), rate), (forces, response))| {
            let change = (rate, response);
            let differences = !near.is_empty() && (held || !modes.is_empty());
            let near = differences.then(|| Nearby::new(self.level, near, change));
            let of_modes = (near.iter())
                .filter(|_| !rate.changes_moments())
                .flat_map(|near| near.eigenvalue_rates(&modes));
            let n = leaf.segments();
            let tip = |j: usize| shift(&response.of_node(leaf, j, n));
            // The work of dead moments is not part of the energy.
            let works = leaf
                .moments()
                .map(|(node, moment)| moment.dot(turn(&response.of_node(leaf, 0, node))));
            let work: f64 = works.sum();
            [
                self.tips().map(tip).collect(),
                vec![DVec3::X * (forces.energy + work)],
                of_modes.map(|value| DVec3::X * value).collect(),
                match tip_held {
                    true => self.reaction(near.as_ref(), change),
                    false => Vec::new(),
                },
                self.positions(rate, response),
                self.on_grips(near.as_ref(), change),
            ]
        });
        Some((eigenvalues, changes.collect()))
    }

    fn tips(&self) -> std::ops::Range<usize> {
        let leaf = &self.level.leaf;
        0..if leaf.leaf.joined() { 1 } else { leaf.rods() }
    }

    fn reaction(&self, near: Option<&Nearby>, change: (&LeafRate, &Response)) -> Vec<DVec3> {
        let leaf = &self.level.leaf;
        let mut all = vec![leaf.reaction_rate(change.0, change.1)];
        if is_clamped(&leaf.leaf) {
            all.extend(
                near.iter()
                    .flat_map(|near| near.clamp_moment_rates(self.level)),
            );
        }
        all
    }

    /// The changes of force and moment on every grip.
    fn on_grips(
        &self,
        near: Option<&Nearby>,
        (rate, response): (&LeafRate, &Response),
    ) -> Vec<DVec3> {
        let Level { leaf, state } = self.level;
        if !leaf.has_grips() {
            return Vec::new();
        }
        let forces = leaf.grip_force_rates(state, rate, response);
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
    fn positions(&self, rate: &LeafRate, response: &Response) -> Vec<DVec3> {
        let rods = response.nodes.iter().enumerate();
        let of = |(j, rod): (usize, &Vec<[f64; 6]>)| -> Vec<DVec3> {
            // A clamped base has no equations; a hinged one moves with its hinge.
            let (bases, nodes) = rod.split_at(1 - self.level.leaf.first_node());
            let base = bases.first().map_or(rate.of_base(j)[0], shift);
            let nodes = nodes.iter().skip(self.stride - 1).step_by(self.stride);
            [base].into_iter().chain(nodes.map(shift)).collect()
        };
        rods.flat_map(of).collect()
    }

    /// Derivatives of the tips and of the energy alone, by one adjoint solution for each
    /// component of a tip.
    fn tips_by_adjoint(&self, linear: &mut Linearized, forces: &[Forces]) -> Option<Vec<Changes>> {
        let units = unit_forces(&self.level.leaf, self.tips().len());
        let adjoint = linear.responses(self.level, &units)?;
        let linear = &*linear;
        let component = |forces: &Forces, k: usize| linear.work(self.level, forces, &adjoint[k]);
        let tip = |forces: &Forces, tip: usize| {
            DVec3::from_array([0, 1, 2].map(|axis| component(forces, 3 * tip + axis)))
        };
        let changes = |forces: &Forces| -> Changes {
            let tips = self.tips().map(|k| tip(forces, k)).collect();
            let energy = vec![DVec3::X * forces.energy];
            [tips, energy, Vec::new(), Vec::new(), Vec::new(), Vec::new()]
        };
        Some(forces.iter().map(changes).collect())
    }
}

/// A unit force on every tip along every axis.
pub(crate) fn unit_forces(leaf: &DiscreteLeaf, tips: usize) -> Vec<Forces> {
    let n = leaf.moving_nodes().len();
    let force = |(tip, axis): (usize, usize)| {
        let mut unit = Forces::zeros(leaf.rods());
        unit.on_nodes(tip, n)[n - 1][3 + axis] = 1.0;
        unit
    };
    let all = (0..tips).flat_map(|tip| (0..3).map(move |axis| (tip, axis)));
    all.map(force).collect()
}
