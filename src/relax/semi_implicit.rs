//! The semi-implicit method: linearly implicit damped motion, its time step
//! growing as the leaf settles until it is Newton's method.
//!
//! With mass M (unit density, rotary inertia of a strip of blade), damping
//! c M and K, g the Hessian and gradient of the energy, a step is
//!
//! ((1/dt + c)/dt M + K) Delta = -g + M v/dt,   v <- Delta/dt,
//!
//! the linearly implicit Euler method. Time is in units of sqrt(rho L^4/A). As
//! long as K is positive definite the leaf is in the valley it will come to
//! rest in, and the step may be as long as the energy allows; where it is not,
//! the motion decides where the leaf goes, and the step is kept short enough
//! to follow it.

use crate::leaf::{DiscreteLeaf, Solved, State, System};
use crate::relax::equilibrium::Work;
use glam::DVec3;

/// Damping c: critical for the lowest bending mode of a single rod, whose
/// frequency is 3.516 (canonical value beta_1^2 of the clamped-free beam).
const DAMPING: f64 = 2.0 * 3.516;

/// First time step once an unlimited one has proved too long: a thirtieth of
/// that mode's period.
const FIRST_STEP: f64 = 0.06;

/// Shortest time step; a leaf that asks for less is not settling.
const SHORTEST_STEP: f64 = 1e-7;

/// Beyond this time step the inertial terms are below the accuracy anyone
/// asks for: the step becomes Newton's.
const LONGEST_STEP: f64 = 1e3;

/// Largest rotation of a node in one step, radians.
const MAX_TURN: f64 = 1.0;

/// Largest displacement of a node in one step, in units of length.
const MAX_SHIFT: f64 = 1.0;

/// A segment that is bent by more than this (radians) is not resolved by its grid.
pub const RESOLVED_TURN: f64 = 1.6;

/// Steps on one grid before the run is given up.
const MAX_STEPS: usize = 2000;

/// How a leaf settled on one grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Settled {
    /// At rest in a valley: the last increments were of this size.
    Rest(f64),
    /// At rest although the energy has a direction of descent there.
    Saddle,
    /// A segment bends by more than the grid can resolve.
    Unresolved,
    /// The step limit came first.
    StepLimit,
    /// No step however short lowers the energy.
    Stuck,
}

/// Lets `state` come to rest on its grid, to the given accuracy of positions
/// and rotations.
pub fn settle(
    leaf: &DiscreteLeaf,
    state: &mut State,
    system: &mut System,
    accuracy: f64,
    work: &mut Work,
    progress: &mut dyn FnMut(usize, f64),
) -> Settled {
    let n = leaf.segments();
    let mut trial = state.clone();
    let mut velocity = vec![vec![[0.0; 6]; n]; leaf.rods()];
    let mut sums = leaf.assemble(state, &state.n, system);
    work.force_evaluations += 1;
    let mut dt = f64::INFINITY;
    let mut previous = f64::INFINITY;
    let mut growth_limit = 4.0;

    for step in 0..MAX_STEPS {
        // A positive definite matrix and its solution, with as long a time
        // step as it takes.
        let cg_tolerance = (0.03 * previous).clamp(1e-10, 1e-2);
        loop {
            let shift = if dt.is_finite() { (1.0 / dt + DAMPING) / dt } else { 0.0 };
            work.factorizations += 1;
            if system.factorize(shift) {
                let inertia = dt.is_finite().then_some((velocity.as_slice(), 1.0 / dt));
                match system.solve(inertia, cg_tolerance) {
                    Solved::Yes(iterations) => {
                        work.cg_iterations += iterations;
                        break;
                    }
                    Solved::Indefinite(iterations) | Solved::TooSlow(iterations) => {
                        work.cg_iterations += iterations;
                    }
                }
            }
            dt = shorter(dt);
            growth_limit = 2.0;
            if dt < SHORTEST_STEP {
                return Settled::Stuck;
            }
        }

        let (turn, shift) = system.largest();
        let size = turn.max(shift);
        let part = (MAX_TURN / turn).min(MAX_SHIFT / shift).min(1.0);
        leaf.advance(state, system, part, &mut trial);
        let load_work = leaf.moment_work(system, part);
        let next = leaf.assemble(&trial, &state.n, system);
        work.force_evaluations += 1;
        progress(step, size);

        let slack = 1e-9 * (1.0 + sums.merit.abs());
        let merit = next.merit_before - load_work;
        if std::env::var("LD").is_ok() {
            eprintln!("step {step} dt {dt:.2e} size {size:.3e} part {part:.2} merit {:.6e} -> {merit:.6e} cg {} turn {:.2}", sums.merit, work.cg_iterations, next.turn);
        }
        if !merit.is_finite() || merit > sums.merit + slack {
            dt = shorter(dt);
            if dt < SHORTEST_STEP {
                return Settled::Stuck;
            }
            leaf.assemble(state, &state.n, system);
            work.force_evaluations += 1;
            continue;
        }
        if next.turn > RESOLVED_TURN {
            return Settled::Unresolved;
        }
        std::mem::swap(state, &mut trial);
        sums = next;
        work.steps += 1;

        if dt.is_finite() {
            for (j, velocity) in velocity.iter_mut().enumerate() {
                for (i, velocity) in velocity.iter_mut().enumerate() {
                    *velocity = system.increment(j, i + 1).map(|d| d / dt);
                }
            }
            if part == 1.0 {
                dt *= growth_limit;
                growth_limit = 4.0;
            }
            if dt > LONGEST_STEP {
                dt = f64::INFINITY;
            }
            previous = size;
            continue;
        }
        if part == 1.0 {
            // Newton: quadratic at best, and never better than the solution
            // of its equations.
            let rate = (size / previous).min(1.0);
            let remaining = if previous.is_finite() { size * (rate * rate) } else { 10.0 * size * size };
            let remaining = remaining.max(cg_tolerance * size);
            let rounding = size < 1e-9 && rate > 0.3;
            if remaining <= accuracy || rounding {
                return Settled::Rest(if rounding { size } else { remaining });
            }
        }
        previous = size;
    }
    Settled::StepLimit
}

fn shorter(dt: f64) -> f64 {
    if dt.is_finite() { dt / 4.0 } else { FIRST_STEP }
}

impl DiscreteLeaf<'_> {
    /// Work of the dead moment on a single rod's tip over a step.
    fn moment_work(&self, system: &System, part: f64) -> f64 {
        if self.rods() > 1 {
            return 0.0;
        }
        let increment = system.increment(0, self.segments());
        let turn = DVec3::new(increment[0], increment[1], increment[2]);
        part * self.leaf.tip_moment.dot(turn)
    }
}
