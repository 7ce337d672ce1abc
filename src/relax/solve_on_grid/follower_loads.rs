//! Forces without a potential on any leaf: loads that turn with the sections, moments along veins, dead
//! moments and steady wind; and the equilibrium under them.
//!
//! The leaf without them rests by its energy. From there they grow together to their full size, in steps
//! each of which ends with Newton's method with the exact, unsymmetric matrix. Whether the equilibrium is
//! stable is not asked on the way: the linearised motion about its end tells.

use crate::homotopy::{StepEnd, StepSizes};
use crate::leaf::{
    DiscreteLeaf, Grid, Loads, NodalField, NodeFreedom, State, System, add_to_increment,
    displacement_part,
};
use crate::motion::{Physics, SegmentDrag, WindDrag};
use crate::newton::{
    EquilibriumFailure, FollowerForces, NewtonEquations, NewtonIteration, SolverCounts,
};
use crate::relax::accuracy::transfer::{GridLevel, prolong, transfer};
use crate::relax::path::LoadOrder;
use crate::relax::same_equilibrium::is_near_guess;
use crate::relax::solve_on_grid::start::GridRelaxation;
use crate::rod::{RESOLVED_TURN, Wrench};
use crate::run::Limit;
use glam::DVec3;

/// How forces without a potential are balanced, and how they grow.
struct Growth {
    /// Moment (A/L, of the softest A) by which the loads may grow in the first step. Half of it doubles
    /// the steps of a leaf that bends as far as it may.
    moment_per_step: f64,
    /// Newton iterations of a step.
    iterations: usize,
    /// Largest increment of an iteration, radians and lengths.
    largest_increment: f64,
    /// Largest way of the leaf in a step, radians and lengths: a longer one may lead to another
    /// equilibrium.
    longest_way: f64,
    /// Accuracy of all steps but the last, lengths and radians.
    step_accuracy: f64,
    /// Bending of a segment (radians) of a leaf at rest from which on a failure is attributed to the
    /// grid.
    coarse_segment_bending: f64,
}

const GROWTH: Growth = Growth {
    moment_per_step: 1.0,
    iterations: 20,
    largest_increment: 1.0,
    longest_way: 1.0,
    step_accuracy: 1e-4,
    coarse_segment_bending: 0.5 * RESOLVED_TURN,
};

/// Steps of the loads, of which the first depends on them.
const STEPS: StepSizes = StepSizes {
    first: 1.0,
    shortest: 1e-5,
    longest: 1.0,
    growth: 2.0,
    failure: 0.5,
};

/// Steps in which the other loads are taken off and put on again.
const OTHER_LOADS_STEPS: StepSizes = StepSizes {
    first: 0.125,
    ..STEPS
};

/// The accuracy of balances in wind, radians and lengths: forces are balanced to rounding, as nothing
/// else shows that the leaf rests.
const WIND_ACCURACY: f64 = 1e-13;

/// The accuracy of balances next to a guess, radians and lengths.
const NEAR_ACCURACY: f64 = 1e-11;

/// The accuracy of equilibria on finer grids for their small motions, radians and lengths.
const NEXT_GRID_ACCURACY: f64 = 1e-9;

/// Largest displacement from a guess to its balance, in lengths: a farther one is another equilibrium.
const LONGEST_WAY_TO_BALANCE: f64 = 0.2;

/// All forces without a potential on a leaf without velocity.
pub struct WithoutPotential<'a> {
    leaf: &'a DiscreteLeaf,
    wind: Option<SteadyWind>,
}

impl<'a> WithoutPotential<'a> {
    pub fn new(leaf: &'a DiscreteLeaf) -> Self {
        WithoutPotential {
            leaf,
            wind: SteadyWind::new(leaf, &Physics::for_relaxation(&leaf.leaf)),
        }
    }

    /// These forces under a part of the pressure of the wind.
    fn under_pressure(leaf: &'a DiscreteLeaf, part: f64) -> Self {
        let mut forces = WithoutPotential::new(leaf);
        if let Some(wind) = &mut forces.wind {
            wind.velocity *= part.sqrt();
        }
        forces
    }

    /// These forces with times in the unit of a motion.
    pub fn in_motion(leaf: &'a DiscreteLeaf, physics: &Physics) -> Self {
        WithoutPotential {
            leaf,
            wind: SteadyWind::new(leaf, physics),
        }
    }

    /// Adds the change of the drag as clamped bases, which have no equations, are displaced at these rates.
    pub fn add_base_motion(
        &self,
        state: &State,
        rate: impl Fn(usize) -> DVec3,
        forces: &mut NodalField,
    ) {
        let Some(wind) = self.wind.as_ref().filter(|wind| wind.first > 0) else {
            return;
        };
        for ((j, _), drag) in wind.drags(state).filter(|((_, i), _)| *i == 0) {
            let half = drag.chord_derivative() * (-0.5 * rate(j));
            for (node, free) in wind.free_segment_ends(j, 0) {
                let on = &mut forces[j][node - wind.first];
                add_to_increment(on, DVec3::ZERO, free.of_displacement(half));
            }
        }
    }

    /// The drag on all nodes.
    pub fn wind_forces(&self, state: &State) -> Vec<DVec3> {
        let mut forces = vec![DVec3::ZERO; state.x.len()];
        if let Some(SteadyWind { wind, velocity, .. }) = &self.wind {
            wind.set_forces(state, *velocity, |_| DVec3::ZERO, &mut forces);
        }
        forces
    }
}

impl FollowerForces for WithoutPotential<'_> {
    fn add_forces(&self, state: &State, system: &mut System) {
        self.leaf.add_followers(state, system);
        if let Some(wind) = &self.wind {
            wind.add_forces(state, system);
        }
    }

    fn add_derivative(&self, state: &State, increments: &NodalField, forces: &mut NodalField) {
        self.leaf.add_follower_derivative(state, increments, forces);
        if let Some(wind) = &self.wind {
            wind.add_derivative(state, increments, forces);
        }
    }

    fn add_velocity_derivative(
        &self,
        state: &State,
        velocities: &NodalField,
        forces: &mut NodalField,
    ) {
        if let Some(wind) = &self.wind {
            wind.add_velocity_derivative(state, velocities, forces);
        }
    }
}

/// Steady wind on a leaf without velocity.
struct SteadyWind {
    wind: WindDrag,
    velocity: DVec3,
    /// What supports allow to each node, rod after rod.
    free: Vec<NodeFreedom>,
    segments: usize,
    /// The first node of a rod with equations.
    first: usize,
}

impl SteadyWind {
    fn new(leaf: &DiscreteLeaf, physics: &Physics) -> Option<Self> {
        let segments = leaf.segments();
        let free = |(j, i)| leaf.node_freedom(j, i);
        Some(SteadyWind {
            wind: WindDrag::new(leaf, physics)?,
            velocity: physics.air(0.0),
            free: leaf.rod_index_pairs(0..segments + 1).map(free).collect(),
            segments,
            first: leaf.first_node(),
        })
    }

    /// Rod and number of every segment, and the drag on it.
    fn drags<'a>(
        &'a self,
        state: &'a State,
    ) -> impl Iterator<Item = ((usize, usize), SegmentDrag)> + 'a {
        self.wind.drags(state, self.velocity, |_| DVec3::ZERO)
    }

    /// The ends of a segment that supports let move, and what they allow.
    fn free_segment_ends(
        &self,
        j: usize,
        i: usize,
    ) -> impl Iterator<Item = (usize, NodeFreedom)> + '_ {
        let base = j * (self.segments + 1);
        let ends = [i, i + 1].map(|i| (i, self.free[base + i]));
        ends.into_iter().filter(|(_, free)| free.displacement.any())
    }

    fn add_forces(&self, state: &State, system: &mut System) {
        for ((j, i), drag) in self.drags(state) {
            for (node, free) in self.free_segment_ends(j, i) {
                let half = free.of_displacement(0.5 * drag.force());
                system.add_load(j, node, Wrench::from_force(half));
            }
        }
    }

    fn add_derivative(&self, state: &State, increments: &NodalField, forces: &mut NodalField) {
        self.add_changes(state, increments, forces, |drag, [a, b]| {
            drag.chord_derivative() * (b - a)
        });
    }

    /// The drag changes by its derivative with respect to the air's velocity, less the mean velocity of
    /// both ends.
    fn add_velocity_derivative(
        &self,
        state: &State,
        velocities: &NodalField,
        forces: &mut NodalField,
    ) {
        self.add_changes(state, velocities, forces, |drag, [a, b]| {
            drag.velocity_derivative() * (-0.5 * (a + b))
        });
    }

    /// Adds the changes of the drag on all segments by the displacements, or velocities, of both ends.
    fn add_changes(
        &self,
        state: &State,
        fields: &NodalField,
        forces: &mut NodalField,
        change: impl Fn(&SegmentDrag, [DVec3; 2]) -> DVec3,
    ) {
        for ((j, i), drag) in self.drags(state) {
            let end = |i: usize| match i.checked_sub(self.first) {
                Some(i) => displacement_part(&fields[j][i]),
                None => DVec3::ZERO,
            };
            let half = 0.5 * change(&drag, [end(i), end(i + 1)]);
            for (node, free) in self.free_segment_ends(j, i) {
                let half = free.of_displacement(half);
                add_to_increment(&mut forces[j][node - self.first], DVec3::ZERO, half);
            }
        }
    }
}

/// Newton's method for the balance of all forces.
pub fn balance_forces(
    leaf: &DiscreteLeaf,
    system: &mut System,
    forces: &WithoutPotential,
    rest: &mut GridRelaxation,
) -> Result<f64, EquilibriumFailure> {
    let accuracy = match leaf.leaf.in_wind() {
        true => WIND_ACCURACY,
        false => rest.accuracy,
    };
    balance_within(leaf, system, forces, rest, accuracy)
}

fn balance_within(
    leaf: &DiscreteLeaf,
    system: &mut System,
    forces: &WithoutPotential,
    rest: &mut GridRelaxation,
    accuracy: f64,
) -> Result<f64, EquilibriumFailure> {
    let newton = NewtonIteration {
        accuracy,
        iterations: GROWTH.iterations,
        work: rest.work,
        progress: rest.progress,
    };
    let equations = NewtonEquations::Following {
        forces,
        largest: GROWTH.largest_increment,
    };
    newton.solve(leaf, &mut rest.state, system, equations)
}

/// An equilibrium continued to the grid next to its own; `None` if Newton's method leads elsewhere.
pub fn balance_on_next_grid(level: &GridLevel, limit: &Limit) -> Option<GridLevel> {
    let guess = prolong(&level.leaf, &level.state);
    balance_on_grid_nearby(level, level.leaf.grid.refined(), guess, limit)
}

/// An equilibrium continued to a coarse grid of so many segments; `None` if Newton's method leads elsewhere.
pub fn balance_on_coarse_grid(
    level: &GridLevel,
    segments: usize,
    limit: &Limit,
) -> Option<GridLevel> {
    let grid = Grid::new(segments, level.leaf.leaf.kinks());
    let guess = transfer(&level.leaf, &level.state, &grid);
    balance_on_grid_nearby(level, grid, guess, limit)
}

/// An equilibrium continued to another grid, from a guess there.
fn balance_on_grid_nearby(
    level: &GridLevel,
    grid: Grid,
    mut guess: State,
    limit: &Limit,
) -> Option<GridLevel> {
    let leaf = DiscreteLeaf::new(&level.leaf.leaf, grid);
    leaf.place_held_nodes(&mut guess);
    let (mut system, mut work) = (System::new(&leaf), SolverCounts::default());
    let mut ignored = |_, _| {};
    let start = guess.clone();
    let mut rest = GridRelaxation::new(start, NEXT_GRID_ACCURACY, &mut work, &mut ignored, limit);
    let forces = WithoutPotential::new(&leaf);
    balance_within(&leaf, &mut system, &forces, &mut rest, NEXT_GRID_ACCURACY).ok()?;
    let state = rest.state;
    is_near_guess(&guess, &state).then_some(GridLevel { leaf, state })
}

/// The balance of all forces next to a guess; `None` if Newton's method leads elsewhere, or nowhere.
pub fn balance_near(
    leaf: &DiscreteLeaf,
    system: &mut System,
    guess: State,
    work: &mut SolverCounts,
    limit: &Limit,
) -> Option<State> {
    let mut ignored = |_, _| {};
    let mut rest = GridRelaxation::new(guess.clone(), NEAR_ACCURACY, work, &mut ignored, limit);
    let forces = WithoutPotential::new(leaf);
    balance_within(leaf, system, &forces, &mut rest, NEAR_ACCURACY).ok()?;
    let state = rest.state;
    (guess.largest_displacement_to(&state) < LONGEST_WAY_TO_BALANCE).then_some(state)
}

/// Corrects a state near rest, or lets all loads without a potential grow from a state of rest without
/// them. [`EquilibriumFailure::Unresolved`]: the grid is too coarse.
///
/// The drag of wind then acts on the nodes as dead forces, in which all sums over the leaf are balanced.
pub fn solve_with_followers(
    leaf: &mut DiscreteLeaf,
    system: &mut System,
    rest: &mut GridRelaxation,
) -> Result<f64, EquilibriumFailure> {
    let remaining = match rest.near_rest {
        true => balance_forces(leaf, system, &WithoutPotential::new(leaf), rest)?,
        false => grow_to_full_size(leaf, system, rest)?,
    };
    if leaf.leaf.in_wind() {
        let forces = WithoutPotential::new(leaf).wind_forces(&rest.state);
        leaf.add_nodal_loads(&forces);
    }
    Ok(remaining)
}

/// Lets all forces without a potential grow from a state of rest without them.
fn grow_to_full_size(
    leaf: &mut DiscreteLeaf,
    system: &mut System,
    rest: &mut GridRelaxation,
) -> Result<f64, EquilibriumFailure> {
    let loads = leaf.loads;
    let stiffness = (leaf.sections.iter()).map(|s| s.couple_stiffness.min_element());
    let softest = stiffness.fold(f64::INFINITY, f64::min);
    let drag = WithoutPotential::new(leaf).wind_forces(&rest.state);
    let drag: f64 = drag.iter().map(|force| force.length()).sum();
    let moment = leaf.leaf.moment_integral_bound() + leaf.leaf.follower_moment_bound() + drag;
    let growing = StepSizes {
        first: (GROWTH.moment_per_step * softest / moment).clamp(STEPS.shortest, 1.0),
        ..STEPS
    };
    let legs = LoadLeg::of_order(rest.load_order);
    let mut before = rest.state.clone();
    let mut error = 0.0;
    let mut end = Ok(());
    for (k, leg) in legs.iter().enumerate() {
        let is_last = k + 1 == legs.len();
        let sizes = match leg.grows() {
            true => growing,
            false => OTHER_LOADS_STEPS,
        };
        let mut reached = leg.from;
        end = sizes.follow(|step| {
            if rest.limit.reached() {
                return StepEnd::Ended(EquilibriumFailure::StepLimit);
            }
            let parts = leg.at(step.to);
            let part = parts.without_potential;
            leaf.loads = Loads {
                tip_moment: part * loads.tip_moment,
                dead_moment_factor: part * loads.dead_moment_factor,
                follower_factor: part * loads.follower_factor,
                ..loads * parts.with_potential
            };
            let accuracy = match is_last && step.to == 1.0 {
                false => GROWTH.step_accuracy,
                true if leaf.leaf.in_wind() => WIND_ACCURACY,
                true => rest.accuracy,
            };
            let forces = WithoutPotential::under_pressure(leaf, part);
            let balanced = balance_within(leaf, system, &forces, rest, accuracy);
            let way = before.distance(&rest.state);
            match balanced {
                Ok(remaining) if way <= GROWTH.longest_way => {
                    error = remaining;
                    reached = parts;
                    before.clone_from(&rest.state);
                    StepEnd::Made {
                        growth: STEPS.growth,
                    }
                }
                failed => {
                    rest.state.clone_from(&before);
                    let stop = failed.err().unwrap_or(EquilibriumFailure::NoDescent);
                    let turn = leaf.assemble(&before, system).largest_turn;
                    let coarse = turn > GROWTH.coarse_segment_bending;
                    match (step.is_shortest, coarse) {
                        (_, true) if step.is_shortest || stop == EquilibriumFailure::Unresolved => {
                            StepEnd::Ended(EquilibriumFailure::Unresolved)
                        }
                        (true, _) => StepEnd::Ended(EquilibriumFailure::NoDescent),
                        _ => StepEnd::TooLong(stop),
                    }
                }
            }
        });
        if end.is_err() {
            let ends = end == Err(EquilibriumFailure::NoDescent) && reached.with_potential == 1.0;
            rest.borne_part = Some(reached.without_potential).filter(|_| ends && leg.grows());
            break;
        }
    }
    leaf.loads = loads;
    end.map(|()| error)
}

/// The parts of all loads, from 0 to 1, that act on a leaf.
#[derive(Clone, Copy)]
struct LoadParts {
    with_potential: f64,
    without_potential: f64,
}

/// A part of the way from a leaf under the loads that have a potential to one under all loads.
struct LoadLeg {
    from: LoadParts,
    to: LoadParts,
}

impl LoadLeg {
    const fn new(from: [f64; 2], to: [f64; 2]) -> Self {
        const fn parts([with_potential, without_potential]: [f64; 2]) -> LoadParts {
            LoadParts {
                with_potential,
                without_potential,
            }
        }
        LoadLeg {
            from: parts(from),
            to: parts(to),
        }
    }

    /// The way in this order.
    fn of_order(order: LoadOrder) -> &'static [LoadLeg] {
        match order {
            LoadOrder::PotentialFirst => const { &[LoadLeg::new([1.0, 0.0], [1.0, 1.0])] },
            LoadOrder::PotentialLast => {
                const {
                    &[
                        LoadLeg::new([1.0, 0.0], [0.0, 0.0]),
                        LoadLeg::new([0.0, 0.0], [0.0, 1.0]),
                        LoadLeg::new([0.0, 1.0], [1.0, 1.0]),
                    ]
                }
            }
        }
    }

    /// Whether the loads without a potential grow.
    fn grows(&self) -> bool {
        self.to.without_potential > self.from.without_potential
    }

    /// The loads at a part of this way.
    fn at(&self, lambda: f64) -> LoadParts {
        let between = |of: fn(&LoadParts) -> f64| match of(&self.from) == of(&self.to) {
            true => of(&self.to),
            false => of(&self.from) + lambda * (of(&self.to) - of(&self.from)),
        };
        LoadParts {
            with_potential: between(|it| it.with_potential),
            without_potential: between(|it| it.without_potential),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::{DirectSolver, Leaf};
    use crate::relax::initial_state;
    use crate::scenario::Scenario;

    const LEAF: &str = r#"
        name = "leaf"
        leaf = { rods = 2, length = [1.0, 0.9], fan = "symmetric" }
        stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = 60.0, shear_2 = 70.0, shear_3 = 50.0 }
        coupling = { x = 1.0, y = 2.0, z = 1.5 }
        [load]
        gravity = [0.1, 0.2, -0.5]
        follower = [0.2, -0.4, 0.8]
        couple = [0.3, 0.5, -0.2]
        [[load.point]]
        vein = 1
        at = 1.0
        force = [0.4, 0.3, -0.5]
        moment = [0.2, -0.3, 0.4]
        follows = true
    "#;

    const ROD: &str = r#"
        name = "rod"
        leaf = { rods = 1, length = 1.0, fan = [0.3] }
        stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = 60.0, shear_2 = 70.0, shear_3 = 50.0 }
        load = { tip_moment = [0.3, -0.5, 0.7], couple = [0.2, 0.4, 0.3], couple_follows = true, follower = [0.2, 0.3, 0.4] }
    "#;

    const WINDY: &str = r#"
        name = "rod"
        leaf = { rods = 1, length = 1.0, fan = [0.3] }
        stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = 60.0, shear_2 = 70.0, shear_3 = 50.0 }
        load = { follower = [0.2, 0.3, 0.4] }
        wind = { velocity = [0.5, 0.8, 1.0], density = 1.2, drag = 2.0, width = 0.2 }
    "#;

    /// Multiples of the golden ratio are equidistributed: a direction without any symmetry.
    fn direction(leaf: &DiscreteLeaf) -> NodalField {
        let golden = |k: usize| (k as f64 * 0.618_033_988_749_895).fract() - 0.5;
        let node = |j: usize, i: usize| std::array::from_fn(|c| golden(7 + 6 * (37 * j + i) + c));
        let rod = |j: usize| leaf.moving_nodes().map(|i| node(j, i)).collect();
        let mut field: NodalField = (0..leaf.rods()).map(rod).collect();
        if leaf.tips_move_together() {
            let tip = field[0][leaf.segments() - 1];
            for rod in &mut field {
                rod[leaf.segments() - 1][3..].copy_from_slice(&tip[3..]);
            }
        }
        field
    }

    /// The right-hand side of Newton's equations, the forces on a joint tip on the first rod's.
    fn unbalanced(leaf: &DiscreteLeaf, state: &State, system: &mut System) -> NodalField {
        leaf.assemble(state, system);
        WithoutPotential::new(leaf).add_forces(state, system);
        joined(leaf, system.rhs())
    }

    fn joined(leaf: &DiscreteLeaf, mut forces: NodalField) -> NodalField {
        if leaf.tips_move_together() {
            let last = leaf.moving_nodes().len() - 1;
            for j in 1..leaf.rods() {
                for c in 3..6 {
                    forces[0][last][c] += std::mem::take(&mut forces[j][last][c]);
                }
            }
        }
        forces
    }

    /// At an equilibrium K minus the derivative of what has no potential is the derivative of all forces.
    #[test]
    fn the_matrix_is_the_derivative_of_all_forces() {
        for text in [LEAF, ROD, WINDY] {
            let scenario = Scenario::from_toml(text).unwrap();
            let mut leaf = DiscreteLeaf::new(&Leaf::new(&scenario), Grid::new(8, &[]));
            let mut system = System::new(&leaf);
            let (mut work, limit) = (SolverCounts::default(), Limit::default());
            let mut ignored = |_, _| {};
            let state = initial_state(&leaf);
            let mut rest = GridRelaxation::new(state, 1e-13, &mut work, &mut ignored, &limit);
            solve_with_followers(&mut leaf, &mut system, &mut rest).unwrap();
            let state = rest.state.clone();
            assert!(leaf.leaf.in_wind() || leaf.residual(&state) < 1e-10);
            let field = direction(&leaf);
            let step = 1e-6;
            let mut moved = |by: f64| {
                let mut next = state.clone();
                system.set_solution(&field);
                leaf.advance(&state, &system, by, &mut next);
                unbalanced(&leaf, &next, &mut system)
            };
            let [behind, before] = [moved(step), moved(-step)];
            leaf.assemble(&state, &mut system);
            let solver = DirectSolver::new(&system).unwrap();
            let stiff = solver.product(&system, &field);
            let mut change: NodalField =
                vec![vec![[0.0; 6]; leaf.moving_nodes().len()]; leaf.rods()];
            WithoutPotential::new(&leaf).add_derivative(&state, &field, &mut change);
            let change = joined(&leaf, change);
            for (j, i) in leaf.rod_index_pairs(0..leaf.moving_nodes().len()) {
                for c in 0..6 {
                    let by_difference = (behind[j][i][c] - before[j][i][c]) / (2.0 * step);
                    let exact = change[j][i][c] - stiff[j][i][c];
                    let off = (by_difference - exact).abs();
                    assert!(
                        off < 1e-6 * (1.0 + exact.abs()),
                        "{j}, {i}, {c}: {by_difference} {exact}"
                    );
                }
            }
        }
    }
}
