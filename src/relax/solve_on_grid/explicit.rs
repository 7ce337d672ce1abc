//! The explicit method: dynamic relaxation.
//!
//! First the leaf moves with the true masses and damping of a relaxation, every motion
//! resolved, until it is in a valley (basin of attraction) of its energy: that decides which
//! equilibrium it finds. Then only the descent to the minimum matters, and masses and damping
//! are chosen for speed: fictitious masses that equalize the highest frequencies of all
//! segments ([`crate::motion`]), and damping at the rate 3/t, restarted whenever the leaf
//! moves uphill. (Such damping makes the motion an accelerated gradient descent, without
//! knowledge of its lowest frequency: Su, Boyd and Candes, J. Mach. Learn. Res. 17, 2016;
//! O'Donoghue and Candes, Found. Comput. Math. 15, 2015.) Measured on the paper's leaves it
//! takes fewer steps than kinetic damping, up to six times fewer, and as many as constant
//! damping when that was chosen best.

use crate::leaf::{DirectSolver, DiscreteLeaf, Leaf, State, System};
use crate::motion::{Explicit, Physics, Snapshot, Stopped, TimeIntegrator};
use crate::newton::{EquilibriumFailure, SolverCounts};
use crate::relax::plan::WORK;
use crate::relax::request::RelaxError;
use crate::relax::saddle;
use crate::relax::solve_on_grid::start::GridRelaxation;
use crate::run::{Limit, RefusedOption};
use crate::scenario::Rod;

/// The motion with true masses, until the leaf is in a valley of its energy.
struct MotionIntoValley {
    /// Time between checks, in units of sqrt(rho L^4/A).
    check_interval: f64,
    /// The leaf is in a valley if its energy is convex in so many consecutive checks. More of them make
    /// the motion longer, fewer take a passage through convex states for a valley.
    convex_checks: usize,
    /// And its kinetic energy at most this part of the largest before.
    kinetic_fraction: f64,
    /// Time after which the descent begins in any case: soft modes take longer to decide.
    longest_time: f64,
    /// Steps between checks of the time limit.
    steps_between_limit_checks: f64,
    /// Limit on nodes times these steps: a tenth of a second.
    node_steps_between_limit_checks: f64,
}

const MOTION: MotionIntoValley = MotionIntoValley {
    check_interval: 0.25,
    convex_checks: 3,
    kinetic_fraction: 1e-2,
    longest_time: 100.0,
    steps_between_limit_checks: 2000.0,
    node_steps_between_limit_checks: 5e6,
};

/// The descent with fictitious masses to the minimum.
struct AcceleratedDescent {
    /// Time step, as a part of the stability limit: beyond one the descent diverges.
    step: f64,
    /// Steps between evaluations of the residual, each of which costs as much as a step.
    steps_per_check: usize,
    /// Best accuracy that rounding allows, in lengths and radians.
    least_accuracy: f64,
    /// Residual at which the remaining distance is first measured, over the accuracy required.
    first_balance: f64,
    /// Evaluations without progress after which only rounding is left.
    stagnant_checks: usize,
    /// The largest remaining distance, in lengths and radians, that is accepted then.
    largest_stagnant_distance: f64,
}

const DESCENT: AcceleratedDescent = AcceleratedDescent {
    step: 0.95,
    steps_per_check: 200,
    least_accuracy: 1e-10,
    first_balance: 0.1,
    stagnant_checks: 50,
    largest_stagnant_distance: 1e-6,
};

const HELD_SPIN_REFUSAL: &str = "it cannot hold the spin of bases on hinges (leaf.base_spin = \"held\"); use \
     semi-implicit, or shooting, or leaf.base_spin = \"free\"";

const DEAD_MOMENT_REFUSAL: &str = "under load.tip_moment or load.point.moment, dead moments without a potential, motion \
     need not come to rest; use semi-implicit, or shooting";

/// Refuses leaves that the explicit method cannot treat: rigid ones, and those under a dead moment,
/// which may drive a motion forever.
pub fn check(leaf: &Leaf) -> Result<(), RelaxError> {
    let refuse = |why: String| Err(RefusedOption::new("method", "explicit", why).into());
    let rigid = |rod: &Rod| {
        let stiffest = (rod.force_stiffness.iter()).fold(0.0_f64, |m, h| m.max(h.max_abs()));
        stiffest.is_infinite()
    };
    if leaf.scenario().rods.iter().any(rigid) {
        let keys = leaf.scenario().rigid_keys_text();
        let why = format!(
            "{keys}: no time step is short enough for rigid rods; give numbers, or use semi-implicit"
        );
        return refuse(why);
    }
    if leaf.loads.has_moments() {
        return refuse(DEAD_MOMENT_REFUSAL.into());
    }
    if leaf.holds_spins() {
        return refuse(HELD_SPIN_REFUSAL.into());
    }
    Ok(())
}

/// Lets a leaf come to rest by the explicit method; returns the remaining distance to equilibrium, in
/// lengths and radians.
pub fn relax_explicitly(
    leaf: &DiscreteLeaf,
    system: &mut System,
    request: &mut GridRelaxation,
) -> Result<f64, EquilibriumFailure> {
    let physics = Physics::for_relaxation(&leaf.leaf);
    let rigid = leaf.has_rigid_tissue();
    let leaf = &leaf.with_elastic_tissue();
    let motion = Explicit::new(leaf.clone(), physics, &request.state, None);
    let mut motion = motion.map_err(|_| EquilibriumFailure::NoDescent)?;
    let most_steps = WORK.explicit_node_steps / (leaf.rods() * leaf.segments());
    let settled = match request.near_rest {
        true => Ok(()),
        false => find_valley(leaf, &mut motion, system, most_steps, request),
    };
    let settled = settled.and_then(|()| descend(leaf, &mut motion, system, most_steps, request));
    request.work.steps += motion.steps();
    request.work.force_evaluations += motion.steps();
    request.state = motion.present_state();
    if rigid {
        leaf.set_tissue_forces(&mut request.state);
    }
    settled
}

/// Damped motion into the valley of the equilibrium.
fn find_valley(
    leaf: &DiscreteLeaf,
    motion: &mut Explicit,
    system: &mut System,
    most_steps: usize,
    request: &mut GridRelaxation,
) -> Result<(), EquilibriumFailure> {
    let (mut fastest, mut convex) = (0.0_f64, 0);
    while motion.time() < MOTION.longest_time {
        let now = move_to_next_check(motion, leaf.rods() * leaf.segments(), request.limit)?;
        fastest = fastest.max(now.energy.kinetic);
        let slow = now.energy.kinetic <= MOTION.kinetic_fraction * fastest;
        let shift = leaf.neutral_shift();
        let valley = saddle::index(leaf, &now.state, system, shift, request.work) == Some(0);
        convex = if valley { convex + 1 } else { 0 };
        request.left_convex_valley |= !valley;
        if slow && convex >= MOTION.convex_checks {
            break;
        }
        if motion.steps() > most_steps || request.limit.reached() {
            return Err(EquilibriumFailure::StepLimit);
        }
        (request.progress)(motion.steps(), leaf.residual(&now.state));
    }
    Ok(())
}

/// Moves to the time of the next check. On fine grids of stiff rods that takes long: if there
/// is a time limit, it is checked in between.
fn move_to_next_check(
    motion: &mut Explicit,
    nodes: usize,
    limit: &Limit,
) -> Result<Snapshot, EquilibriumFailure> {
    let begin = motion.time();
    let steps = (MOTION.steps_between_limit_checks)
        .min((MOTION.node_steps_between_limit_checks / nodes as f64).max(1.0));
    let pieces = match limit.is_none() {
        false => (MOTION.check_interval / (steps * motion.longest_step())).ceil(),
        true => 1.0,
    };
    let mut piece = 0.0;
    loop {
        piece += 1.0;
        let now = motion
            .advance(begin + MOTION.check_interval * (piece / pieces))
            .map_err(|stopped| match stopped {
                Stopped::Unresolved { .. } => EquilibriumFailure::Unresolved,
                _ => EquilibriumFailure::NoDescent,
            })?;
        if limit.reached() {
            return Err(EquilibriumFailure::StepLimit);
        }
        if piece >= pieces {
            return Ok(now);
        }
    }
}

/// Descends to the minimum; returns the remaining distance.
fn descend(
    leaf: &DiscreteLeaf,
    motion: &mut Explicit,
    system: &mut System,
    most_steps: usize,
    request: &mut GridRelaxation,
) -> Result<f64, EquilibriumFailure> {
    let accuracy = request.accuracy.max(DESCENT.least_accuracy);
    let large = (leaf.rods() * leaf.segments()) as f64
        > MOTION.node_steps_between_limit_checks / MOTION.steps_between_limit_checks;
    motion.use_fictitious_masses();
    let mut balanced = DESCENT.first_balance * accuracy;
    let (mut since, mut before) = (0, 0.0);
    let (mut best, mut checks_since_best) = (f64::INFINITY, 0);
    loop {
        for _ in 0..DESCENT.steps_per_check {
            if large && request.limit.reached() {
                return Err(EquilibriumFailure::StepLimit);
            }
            let rate = 3.0 / (DESCENT.step * (since + 2) as f64);
            motion.set_damping(rate);
            let moving = motion.step(DESCENT.step);
            // Power of the forces: rate of kinetic energy plus damping loss.
            let downhill = 0.5 * (moving - before) / DESCENT.step + rate * moving;
            (since, before) = (since + 1, moving);
            if downhill < 0.0 && since > 3 {
                motion.stop();
                (since, before) = (0, 0.0);
            }
        }
        let state = motion.present_state();
        let residual = leaf.residual(&state);
        if !(residual.is_finite() && state.x.iter().all(|x| x.is_finite())) {
            return Err(EquilibriumFailure::NoDescent);
        }
        (request.progress)(motion.steps(), residual);
        checks_since_best += 1;
        if residual < 0.5 * best {
            (best, checks_since_best) = (residual, 0);
        }
        if residual <= balanced || checks_since_best > DESCENT.stagnant_checks {
            let remaining = distance_to_equilibrium(leaf, &state, system, request.work);
            let stagnates = checks_since_best > DESCENT.stagnant_checks;
            if remaining <= accuracy || stagnates && remaining <= DESCENT.largest_stagnant_distance
            {
                return Ok(remaining);
            }
            if stagnates {
                return Err(EquilibriumFailure::StepLimit);
            }
            balanced *= (0.5 * accuracy / remaining).max(1e-3);
        }
        if motion.steps() > most_steps || request.limit.reached() {
            return Err(EquilibriumFailure::StepLimit);
        }
    }
}

/// Distance to equilibrium, measured by a Newton step that is not taken.
fn distance_to_equilibrium(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    work: &mut SolverCounts,
) -> f64 {
    leaf.assemble(state, system);
    leaf.add_phase_conditions(state, system);
    work.force_evaluations += 1;
    work.factorizations += 1;
    let Ok(pattern) = DirectSolver::new(system) else {
        return f64::INFINITY;
    };
    let Ok(mut factor) = pattern.factorize(system, leaf.neutral_shift()) else {
        return f64::INFINITY;
    };
    factor.solve(system, None);
    system.largest_increment().larger()
}
