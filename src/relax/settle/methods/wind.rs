//! A leaf in steady wind, which has no potential: neither energy nor signs of pivots guide it. It
//! moves, damped as in a relaxation, until it hardly moves any more; then Newton's method with the
//! exact, unsymmetric matrix finds the balance of all forces with the drag. Where it rests is thus
//! stable as that motion is.

use crate::largest::largest;
use crate::leaf::{DiscreteLeaf, Field, State, System, add, shift};
use crate::motion::{Drag, TimeIntegrator, Physics, SemiImplicit, Steps, Wind};
use crate::newton::{Equations, Following, Newton, Stop};
use crate::relax::settle::methods::Relaxation;
use glam::DVec3;

/// Local error of the steps of the motion (lengths, radians).
const MOTION_ERROR: f64 = 1e-3;

/// Time between looks at the moving leaf, and the longest motion, in units of sqrt(rho L^4/A).
const LOOK: f64 = 0.5;
const LONGEST_MOTION: f64 = 400.0;

/// Largest velocity (lengths or radians per unit of time) with which the leaf hardly moves, and the
/// factor on it where Newton's method led elsewhere.
const SLOW: f64 = 3e-2;
const SLOWER: f64 = 0.1;

/// Farther from the moving leaf (lengths, radians) than this many times the way in a unit of time
/// is elsewhere.
const NEAR: f64 = 10.0;

/// Two balances no farther apart (lengths, radians) are one: a leaf that has come closer to it in
/// between, however slowly, comes to rest there.
const SAME: f64 = 1e-8;

/// Newton iterations, their longest increment (radians, lengths), and their accuracy: forces are
/// balanced to rounding, as nothing else shows that the leaf rests.
const ITERATIONS: usize = 20;
const LONGEST: f64 = 1.0;
const ACCURACY: f64 = 1e-13;

/// Brings the leaf to rest. The drag then acts on its nodes as dead forces, in which all sums over
/// the leaf are balanced.
pub fn settle_in_wind(
    leaf: &mut DiscreteLeaf,
    system: &mut System,
    rest: &mut Relaxation,
) -> Result<f64, Stop> {
    let physics = Physics::at_rest(&leaf.leaf);
    let air = Air::new(leaf, &physics).ok_or(Stop::Stuck)?;
    let remaining = match rest.near_rest {
        true => balance(leaf, system, &air, rest)?,
        false => move_to_rest(leaf, system, (physics, &air), rest)?,
    };
    let mut forces = vec![DVec3::ZERO; rest.state.x.len()];
    let still = |_| DVec3::ZERO;
    (air.wind).set_forces(&rest.state, air.velocity, still, &mut forces);
    leaf.load_nodes(&forces);
    Ok(remaining)
}

/// Damped motion until Newton's method leads to rest nearby.
fn move_to_rest(
    leaf: &DiscreteLeaf,
    system: &mut System,
    (physics, air): (Physics, &Air),
    rest: &mut Relaxation,
) -> Result<f64, Stop> {
    let steps = Steps::Error(MOTION_ERROR);
    let mut motion = SemiImplicit::new(leaf.clone(), physics, &rest.state, steps);
    let (mut slow, mut until) = (SLOW, LOOK);
    let mut end = Err(Stop::StepLimit);
    // Where forces are balanced, as found before, and how far from there the leaf was.
    let mut before: Option<(State, f64)> = None;
    while until < LONGEST_MOTION && !rest.limit.reached() {
        if motion.step_towards(until).is_err() {
            end = Err(Stop::Stuck);
            break;
        }
        if motion.time() < until {
            continue;
        }
        until += LOOK;
        let now = motion.snapshot();
        let speeds = (now.velocity.iter()).flat_map(|v| [v.linear.length(), v.angular.length()]);
        let speed = largest(speeds);
        (rest.progress)(motion.steps(), speed);
        rest.state = now.state;
        if speed < slow {
            let moving = rest.state.clone();
            let balanced = balance(leaf, system, air, rest);
            if balanced.is_ok() {
                let away = moving.distance(&rest.state);
                let comes_closer = |(other, then): &(State, f64)| {
                    away < *then && other.distance(&rest.state) < SAME
                };
                if away < NEAR * slow || before.as_ref().is_some_and(comes_closer) {
                    end = balanced;
                    break;
                }
                before = Some((rest.state.clone(), away));
            }
            rest.state = moving;
            slow *= SLOWER;
        }
    }
    rest.work.steps += motion.steps();
    rest.work.force_evaluations += motion.factorizations;
    rest.work.factorizations += motion.factorizations;
    end
}

/// Newton's method for the balance of forces.
fn balance(
    leaf: &DiscreteLeaf,
    system: &mut System,
    air: &Air,
    rest: &mut Relaxation,
) -> Result<f64, Stop> {
    let newton = Newton {
        accuracy: ACCURACY,
        iterations: ITERATIONS,
        work: rest.work,
        progress: rest.progress,
    };
    let equations = Equations::Following {
        forces: air,
        largest: LONGEST,
    };
    newton.solve(leaf, &mut rest.state, system, equations)
}

/// Steady wind on a leaf without velocity.
struct Air {
    wind: Wind,
    velocity: DVec3,
    /// Whether each node may be displaced, rod after rod.
    free: Vec<bool>,
    segments: usize,
    /// The first node of a rod with equations.
    first: usize,
}

impl Air {
    fn new(leaf: &DiscreteLeaf, physics: &Physics) -> Option<Self> {
        let segments = leaf.segments();
        let free = |(j, i)| leaf.moves(j, i)[1];
        Some(Air {
            wind: Wind::new(leaf, physics)?,
            velocity: physics.air(0.0),
            free: leaf.each(0..segments + 1).map(free).collect(),
            segments,
            first: leaf.first_node(),
        })
    }

    /// Rod and number of every segment, and the drag on it.
    fn drags<'a>(&'a self, state: &'a State) -> impl Iterator<Item = ((usize, usize), Drag)> + 'a {
        self.wind.drags(state, self.velocity, |_| DVec3::ZERO)
    }

    /// The free ones among the ends of a segment.
    fn ends(&self, j: usize, i: usize) -> impl Iterator<Item = usize> + '_ {
        let base = j * (self.segments + 1);
        [i, i + 1].into_iter().filter(move |i| self.free[base + i])
    }
}

impl Following for Air {
    fn add_forces(&self, state: &State, system: &mut System) {
        for ((j, i), drag) in self.drags(state) {
            for node in self.ends(j, i) {
                system.add_load(j, node, [DVec3::ZERO, 0.5 * drag.force()]);
            }
        }
    }

    fn add_change(&self, state: &State, increments: &Field, forces: &mut Field) {
        for ((j, i), drag) in self.drags(state) {
            let moved = |i: usize| match i.checked_sub(self.first) {
                Some(i) => shift(&increments[j][i]),
                None => DVec3::ZERO,
            };
            let half = 0.5 * (drag.by_chord() * (moved(i + 1) - moved(i)));
            for node in self.ends(j, i) {
                add(&mut forces[j][node - self.first], DVec3::ZERO, half);
            }
        }
    }
}
