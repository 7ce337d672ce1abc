//! Loads without a potential: neither energy nor signs of pivots can guide a relaxation.
//!
//! Dead moments on a single rod (at its tip or along it): all loads grow together from zero, in
//! steps of about one radian of tip rotation, each followed by Newton's method with the exact,
//! unsymmetric tangent. Where that would take too many steps, the other loads grow from the shape under
//! the moments alone, which is computed segment by segment from the clamp: a free rod carries at every
//! place the sum of the moments beyond it. Where the path ends at a fold, the moments are applied before
//! the other loads, or after them. A rod that is held elsewhere than at its base is brought there under
//! the other loads, by their energy, before the moments are applied.
//!
//! Steady wind: the leaf moves, damped as in a relaxation, until it hardly moves any more; then
//! Newton's method with the exact, unsymmetric matrix finds the balance of all forces with the drag.
//! Where it rests is thus stable as that motion is.

use crate::homotopy::{StepEnd, StepSizes};
use crate::leaf::{DiscreteLeaf, Grid, Leaf, Loads, State, System};
use crate::motion::{Physics, SemiImplicit, StepControl, TimeIntegrator};
use crate::newton::{EquilibriumFailure, NewtonEquations, NewtonIteration};
use crate::numbers::{larger, largest};
use crate::relax::same_equilibrium::is_same_balance;
use crate::relax::solve_on_grid::follower_loads::{WithoutPotential, balance_forces};
use crate::relax::solve_on_grid::start::GridRelaxation;
use crate::rod::{RESOLVED_TURN, Section};
use crate::rotation;
use glam::{DMat3, DQuat, DVec3};

/// How dead moments are applied to a rod.
struct MomentLoading {
    /// Rotation of the tip (radians) in one load step. Half of it doubles the steps.
    turn_per_step: f64,
    /// Newton iterations of a load step before it is halved.
    iterations: usize,
    /// Accuracy of all load steps but the last, lengths and radians.
    step_accuracy: f64,
    /// Bending of a segment (radians) of a rod at rest from which on a failure is attributed to the
    /// grid.
    coarse_segment_bending: f64,
    /// Rotation of the tip (radians) beyond which the moments on a free rod are not applied in steps.
    largest_stepped_turn: f64,
    /// Largest number of steps of the other loads in that case.
    most_steps_of_other_loads: usize,
    /// Largest number of steps of the moments on a held rod.
    most_steps_of_held_rod: usize,
}

const LOADING: MomentLoading = MomentLoading {
    turn_per_step: 1.0,
    iterations: 15,
    step_accuracy: 1e-3,
    coarse_segment_bending: 0.5 * RESOLVED_TURN,
    largest_stepped_turn: 250.0,
    most_steps_of_other_loads: 100,
    most_steps_of_held_rod: 1000,
};

/// Load steps, of which the first depends on the load.
const STEPS: StepSizes = StepSizes {
    first: 1.0,
    shortest: 1e-6,
    longest: 1.0,
    growth: 1.0,
    failure: 0.5,
};

/// Newton's method for the rotation of one segment.
struct SegmentIteration {
    most_iterations: usize,
    /// The step at which it ends, radians.
    accuracy: f64,
    /// The step of its finite differences, radians.
    difference: f64,
}

const SEGMENT: SegmentIteration = SegmentIteration {
    most_iterations: 20,
    accuracy: 1e-13,
    difference: 1e-7,
};

/// Squared half rotation below which series replace quotients that tend to 0/0.
const SERIES_ROTATION_THRESHOLD: f64 = 1e-5;

/// The order in which the loads of a rod are applied: what is applied after a part of the loading, as
/// parts, where less than none is none, and more than all is all.
#[derive(Clone, Copy)]
struct LoadingOrder {
    moments: fn(f64) -> f64,
    other_loads: fn(f64) -> f64,
}

/// Orders for a free rod: the path may end at a fold in one of them, and pass it in another.
const FREE_ROD_ORDERS: [LoadingOrder; 3] = [
    LoadingOrder {
        moments: |part| part,
        other_loads: |part| part,
    },
    LoadingOrder {
        moments: |part| 2.0 * part,
        other_loads: |part| 2.0 * part - 1.0,
    },
    LoadingOrder {
        moments: |part| 2.0 * part - 1.0,
        other_loads: |part| 2.0 * part,
    },
];

/// The order for a held rod, on which the other loads act from the beginning.
const HELD_ROD_ORDER: LoadingOrder = LoadingOrder {
    moments: |part| part,
    other_loads: |_| 1.0,
};

/// The order for a rod that was given the shape under its moments.
const WOUND_ROD_ORDER: LoadingOrder = LoadingOrder {
    moments: |_| 1.0,
    other_loads: |part| part,
};

/// Loads the rod from its rest shape, or corrects a state near rest.
pub fn solve_with_dead_moments(
    leaf: &mut DiscreteLeaf,
    system: &mut System,
    rod: &mut GridRelaxation,
) -> Result<f64, EquilibriumFailure> {
    if rod.near_rest {
        return newton(leaf, system, rod, rod.accuracy);
    }
    if is_strongly_wound(&leaf.leaf) {
        shape_by_moment(leaf, &mut rod.state)?;
        let most_steps = LOADING.most_steps_of_other_loads;
        return apply_loads(leaf, system, rod, WOUND_ROD_ORDER, 1.0, most_steps);
    }
    let stiffness = (leaf.sections.iter()).map(|s| s.couple_stiffness.min_element());
    let softest = stiffness.fold(f64::INFINITY, f64::min);
    let turn = leaf.leaf.moment_integral_bound() * leaf.leaf.length(0) / softest;
    let mut step = 1.0 / (turn / LOADING.turn_per_step).ceil().max(1.0);
    if leaf.leaf.has_placed_supports() {
        let most_steps = LOADING.most_steps_of_held_rod;
        return apply_loads(leaf, system, rod, HELD_ROD_ORDER, step, most_steps);
    }
    let unloaded = rod.state.clone();
    let mut end = Err(EquilibriumFailure::StepLimit);
    for order in FREE_ROD_ORDERS {
        rod.state.clone_from(&unloaded);
        end = apply_loads(leaf, system, rod, order, step, usize::MAX);
        if end.is_ok() || end == Err(EquilibriumFailure::Unresolved) || rod.limit.reached() {
            break;
        }
        // In the other orders the moments are applied in half of the loading.
        step = 0.5 / (turn / LOADING.turn_per_step).ceil().max(1.0);
    }
    end
}

fn newton(
    leaf: &DiscreteLeaf,
    system: &mut System,
    rod: &mut GridRelaxation,
    accuracy: f64,
) -> Result<f64, EquilibriumFailure> {
    let newton = NewtonIteration {
        accuracy,
        iterations: LOADING.iterations,
        work: rod.work,
        progress: rod.progress,
    };
    newton.solve(leaf, &mut rod.state, system, NewtonEquations::Unsymmetric)
}

/// Applies the loads in a given order and at most so many steps of the given size, which is
/// halved where Newton's method fails. [`EquilibriumFailure::Unresolved`]: the grid is too coarse.
fn apply_loads(
    leaf: &mut DiscreteLeaf,
    system: &mut System,
    rod: &mut GridRelaxation,
    order: LoadingOrder,
    step: f64,
    mut most_steps: usize,
) -> Result<f64, EquilibriumFailure> {
    let loads = leaf.loads;
    let sizes = StepSizes {
        first: step,
        ..STEPS
    };
    let mut before = rod.state.clone();
    let mut error = 0.0;
    let end = sizes.follow(|step| {
        if most_steps == 0 || rod.limit.reached() {
            return StepEnd::Ended(EquilibriumFailure::StepLimit);
        }
        most_steps -= 1;
        let moments = (order.moments)(step.to).clamp(0.0, 1.0);
        let others = (order.other_loads)(step.to).clamp(0.0, 1.0);
        leaf.loads = Loads {
            tip_moment: moments * loads.tip_moment,
            dead_moment_factor: moments * loads.dead_moment_factor,
            ..loads * others
        };
        let wanted = match step.to < 1.0 {
            true => LOADING.step_accuracy,
            false => rod.accuracy,
        };
        match newton(leaf, system, rod, wanted) {
            Ok(remaining) => {
                error = remaining;
                before.clone_from(&rod.state);
                StepEnd::Made {
                    growth: STEPS.growth,
                }
            }
            Err(stop) => {
                rod.state.clone_from(&before);
                let mut coarse =
                    || leaf.assemble(&before, system).largest_turn > LOADING.coarse_segment_bending;
                let unresolved = stop == EquilibriumFailure::Unresolved;
                let ends = step.is_shortest || unresolved && coarse();
                if !ends {
                    return StepEnd::TooLong(stop);
                }
                StepEnd::Ended(match coarse() {
                    true => EquilibriumFailure::Unresolved,
                    false => EquilibriumFailure::NoDescent,
                })
            }
        }
    });
    leaf.loads = loads;
    end.map(|()| error)
}

/// Whether moments turn the tip of a free rod so far (at most, as if only the softest stiffness
/// resisted them) that they are not applied in steps.
fn is_strongly_wound(leaf: &Leaf) -> bool {
    let softest = leaf.section(0, 0.5, 1.0).couple_stiffness.min_element();
    let turn = leaf.moment_integral_bound() * leaf.length(0) / softest;
    turn > LOADING.largest_stepped_turn && !leaf.has_placed_supports()
}

/// The largest curvature (radians per length) of the rod under large moments alone; `None` if
/// these are small, or too large for a grid of `segments` segments.
pub fn moment_curvature(leaf: &Leaf, segments: usize) -> Option<f64> {
    if !is_strongly_wound(leaf) {
        return None;
    }
    let leaf = DiscreteLeaf::new(leaf, Grid::new(segments, leaf.kinks()));
    let mut base = leaf.leaf.base_pose(0).rotation;
    let (mut turn, mut largest) = (DVec3::ZERO, 0.0_f64);
    for (i, section) in leaf.sections.iter().enumerate() {
        turn = segment_turn(section, base, leaf.dead_moment_beyond(i), turn)?;
        largest = larger(largest, turn.length() / section.ds);
        base = (base * rotation::exp(turn)).normalize();
    }
    Some(largest)
}

/// Sets the state to the shape under the moments alone.
fn shape_by_moment(leaf: &DiscreteLeaf, state: &mut State) -> Result<(), EquilibriumFailure> {
    let mut turn = DVec3::ZERO;
    for (i, section) in leaf.sections.iter().enumerate() {
        let base = state.q[i];
        turn = segment_turn(section, base, leaf.dead_moment_beyond(i), turn)
            .ok_or(EquilibriumFailure::Unresolved)?;
        let next = (base * rotation::exp(turn)).normalize();
        state.q[i + 1] = next;
        state.x[i + 1] =
            state.x[i] + section.ds * (rotation::midpoint(base, next) * section.rest_strain);
        state.n[i] = DVec3::ZERO;
    }
    Ok(())
}

/// S a, S being the derivative of the rotation vector psi half-way:
/// s a + sigma y (y . a), with y = psi/2, s = |y|/sin |y|, sigma = (1 - s)/|y|^2.
fn pull_back_vector(psi: DVec3, a: DVec3) -> DVec3 {
    let y = 0.5 * psi;
    let squared = y.length_squared();
    let (s, sigma) = match squared < SERIES_ROTATION_THRESHOLD {
        true => (1.0 + squared / 6.0, -1.0 / 6.0 - 7.0 / 360.0 * squared),
        false => {
            let s = squared.sqrt() / squared.sqrt().sin();
            (s, (1.0 - s) / squared)
        }
    };
    s * a + sigma * y.dot(a) * y
}

/// The rotation vector of a segment that carries the moment and no force, from
/// its neighbour's: S A (psi/ds - u0) = exp(-psi/2) R^T M in the frame half-way.
fn segment_turn(section: &Section, base: DQuat, moment: DVec3, near: DVec3) -> Option<DVec3> {
    let moment = base.conjugate() * moment;
    let unbalanced = |psi: DVec3| {
        let couple = section.couple_stiffness * (psi / section.ds - section.rest_curvature);
        pull_back_vector(psi, couple) - rotation::exp(-0.5 * psi) * moment
    };
    let mut psi = near;
    for _ in 0..SEGMENT.most_iterations {
        let value = unbalanced(psi);
        let column = |axis: DVec3| {
            (unbalanced(psi + SEGMENT.difference * axis) - value) / SEGMENT.difference
        };
        let rate = DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z));
        let step = rate.inverse() * value;
        psi -= step;
        if psi.is_nan() || psi.length() > RESOLVED_TURN {
            return None;
        }
        if step.length() <= SEGMENT.accuracy {
            return Some(psi);
        }
    }
    // The remaining error is corrected by Newton's method for the whole rod.
    Some(psi)
}

/// The damped motion of a leaf in wind, in lengths, radians and the unit of time sqrt(rho L^4/A).
struct MotionInWind {
    /// Local error of its steps. A tenth of it doubles their number.
    error: f64,
    /// Time between looks at the moving leaf.
    check_interval: f64,
    /// Time after which a leaf that still moves is given up.
    longest_time: f64,
    /// Largest velocity with which the leaf hardly moves.
    slow: f64,
    /// Factor on that velocity where Newton's method led elsewhere.
    slow_reduction: f64,
    /// A balance is elsewhere if it is farther from the moving leaf than so many times the way in a unit
    /// of time.
    nearby: f64,
}

const MOTION: MotionInWind = MotionInWind {
    error: 1e-3,
    check_interval: 0.5,
    longest_time: 400.0,
    slow: 3e-2,
    slow_reduction: 0.1,
    nearby: 10.0,
};

/// A state in which all forces on a leaf in wind are balanced.
struct WindBalance {
    state: State,
    /// Distance from the moving leaf, lengths and radians.
    away: f64,
}

/// Brings a leaf to rest in wind. The drag then acts on its nodes as dead forces, in which all sums over
/// the leaf are balanced.
pub fn solve_in_wind(
    leaf: &mut DiscreteLeaf,
    system: &mut System,
    rest: &mut GridRelaxation,
) -> Result<f64, EquilibriumFailure> {
    let physics = Physics::for_relaxation(&leaf.leaf);
    let remaining = match rest.near_rest {
        true => balance_forces(leaf, system, &WithoutPotential::new(leaf), rest)?,
        false => approach_rest_in_wind(leaf, system, physics, rest)?,
    };
    let forces = WithoutPotential::new(leaf).wind_forces(&rest.state);
    leaf.add_nodal_loads(&forces);
    Ok(remaining)
}

/// Damped motion until Newton's method leads to rest nearby.
fn approach_rest_in_wind(
    leaf: &DiscreteLeaf,
    system: &mut System,
    physics: Physics,
    rest: &mut GridRelaxation,
) -> Result<f64, EquilibriumFailure> {
    let forces = WithoutPotential::new(leaf);
    let steps = StepControl::LocalError(MOTION.error);
    let mut motion = SemiImplicit::new(leaf.clone(), physics, &rest.state, steps);
    let (mut slow, mut until) = (MOTION.slow, MOTION.check_interval);
    let mut end = Err(EquilibriumFailure::StepLimit);
    let mut before: Option<WindBalance> = None;
    while until < MOTION.longest_time && !rest.limit.reached() {
        if motion.step_towards(until).is_err() {
            end = Err(EquilibriumFailure::NoDescent);
            break;
        }
        if motion.time() < until {
            continue;
        }
        until += MOTION.check_interval;
        let now = motion.snapshot();
        let speeds = (now.velocity.iter()).flat_map(|v| [v.linear.length(), v.angular.length()]);
        let speed = largest(speeds);
        (rest.progress)(motion.steps(), speed);
        rest.state = now.state;
        if speed < slow {
            let moving = rest.state.clone();
            let balanced = balance_forces(leaf, system, &forces, rest);
            if balanced.is_ok() {
                let away = moving.distance(&rest.state);
                // A leaf that has come closer to a balance, however slowly, comes to rest there.
                let comes_closer = |before: &WindBalance| {
                    away < before.away && is_same_balance(&before.state, &rest.state)
                };
                if away < MOTION.nearby * slow || before.as_ref().is_some_and(comes_closer) {
                    end = balanced;
                    break;
                }
                let state = rest.state.clone();
                before = Some(WindBalance { state, away });
            }
            rest.state = moving;
            slow *= MOTION.slow_reduction;
        }
    }
    rest.work.steps += motion.steps();
    rest.work.force_evaluations += motion.factorizations;
    rest.work.factorizations += motion.factorizations;
    end
}
