//! The walk along the path of equilibria: a predictor through the last states, Newton's method
//! as corrector, and the Morse index watched.

use crate::homotopy::Homotopy;
use crate::leaf::{DiscreteLeaf, State, System};
use crate::limit::Limit;
use crate::newton::{Definite, Equations, Newton, Stop, Work};
use crate::relax::loading::partial::Loading;
use crate::relax::path::{Event, Happening, Stage};
use crate::relax::saddle;
use crate::rotation;
use glam::DVec3;

/// First, shortest and longest steps of lambda. Where an index changes, or where the path ends,
/// is known to the shortest.
const FIRST_STEP: f64 = 0.125;
const SHORTEST_STEP: f64 = 1.0 / 512.0;
const LONGEST_STEP: f64 = 0.5;

/// Largest factor on a step after a successful one.
const GROWTH: f64 = 2.5;

/// Factor on a step that failed.
const SHORTENED: f64 = 0.25;

/// The distance of a state from its prediction (lengths, radians) that steps are made for, and
/// the largest accepted.
const WANTED_DRIFT: f64 = 0.1;
const LARGEST_DRIFT: f64 = 0.3;

/// Largest increment of Newton's method, lengths or radians: the first after the natural leaf
/// may be large.
const LARGEST_INCREMENT: f64 = 2.0;

/// Accuracy of states on the way, at its end, and where the index is in doubt.
const ON_THE_WAY: f64 = 1e-3;
const AT_THE_END: f64 = 1e-4;
const EXACT: f64 = 1e-10;

/// Newton iterations of a step.
const ITERATIONS: usize = 8;

/// Towards an equilibrium of any index so many iterations at a time are made, in which the leaf moves
/// by less than this part of what it moved in those before, or none is near.
const ITERATIONS_AT_A_TIME: usize = 4;
const APPROACHING: f64 = 0.25;

/// Relative accuracy of the first solutions with conjugate gradients.
const CG_TOLERANCE: f64 = 1e-3;

/// States through which the next is predicted.
const PREDICTED_THROUGH: usize = 3;

/// A walk on one grid.
pub struct Walk<'w> {
    pub loading: Loading<'w>,
    pub system: System,
    pub work: &'w mut Work,
    pub limit: &'w Limit,
    pub progress: &'w mut dyn FnMut(usize, f64),
    /// Count of force evaluations at which it ends without success.
    pub most_evaluations: usize,
    pub solver: Definite,
    /// The last states at rest, with their parts of the loading.
    known: Vec<(f64, State)>,
    /// The next one.
    pub next: State,
    pub events: Vec<Event>,
    /// Where it is.
    pub stage: Stage,
    pub part: f64,
    /// Towards which a leaf turns aside that may turn to either side: a force on all nodes.
    pub leaning: DVec3,
}

/// What a step came to.
enum Step {
    /// A stable equilibrium so far from its prediction.
    Stable(f64),
    /// An equilibrium with negative eigenvalues.
    Unstable,
    /// Newton's method fails, or leads far away.
    Lost(Stop),
}

impl<'w> Walk<'w> {
    /// At the natural leaf.
    pub fn new(
        whole: &'w DiscreteLeaf,
        (work, progress): (&'w mut Work, &'w mut dyn FnMut(usize, f64)),
        (limit, most_evaluations): (&'w Limit, usize),
    ) -> Self {
        let (loading, natural) = Loading::new(whole);
        Walk {
            system: System::new(&loading.leaf),
            work,
            limit,
            progress,
            most_evaluations,
            solver: Definite::default(),
            next: natural.clone(),
            known: vec![(0.0, natural)],
            events: Vec::new(),
            stage: Stage::Loading,
            part: 0.0,
            loading,
            leaning: DVec3::ZERO,
        }
    }

    /// Walks to the end of a stage, if it can; the last state and what happened on the way are kept.
    pub fn run(&mut self, last: Stage) -> Result<(), Stop> {
        for stage in self.loading.stages() {
            if stage == Stage::Joining && last == Stage::Loading {
                break;
            }
            let (_, state) = self.known.pop().expect("the last state");
            self.loading.begin(stage, &state);
            if stage == Stage::Joining {
                // Its tips move together, and its veins will be coupled.
                self.system = System::new(self.loading.whole);
                self.solver = Definite::default();
            }
            self.known.clear();
            self.known.push((0.0, state));
            (self.stage, self.part) = (stage, 0.0);
            self.walk_stage()?;
        }
        Ok(())
    }

    /// The state in which it ended.
    pub fn last(self) -> State {
        let last = self.known.into_iter().next_back();
        last.map_or(self.next, |(_, state)| state)
    }

    fn walk_stage(&mut self) -> Result<(), Stop> {
        let mut path = Homotopy::new(FIRST_STEP, [SHORTEST_STEP, LONGEST_STEP]);
        while self.part < 1.0 {
            if self.work.force_evaluations > self.most_evaluations || self.limit.reached() {
                return Err(Stop::StepLimit);
            }
            let part = path.next();
            match self.step_to(part, path.is_shortest()) {
                Step::Stable(drift) => {
                    self.accept(part);
                    path.advance(path.length() * (WANTED_DRIFT / drift).sqrt().min(GROWTH));
                    continue;
                }
                Step::Lost(Stop::Unresolved) => return Err(Stop::Unresolved),
                Step::Unstable | Step::Lost(_) if path.shorten(SHORTENED) => continue,
                Step::Unstable => self.turn_aside(part)?,
                Step::Lost(_) => self.snap(part)?,
            }
            self.known.clear();
            self.accept(part);
            path.advance(FIRST_STEP);
        }
        Ok(())
    }

    /// Takes the next state as known.
    fn accept(&mut self, part: f64) {
        self.part = part;
        if self.known.len() == PREDICTED_THROUGH {
            self.known.rotate_left(1);
            let last = self.known.last_mut().expect("states");
            last.0 = part;
            last.1.clone_from(&self.next);
        } else {
            self.known.push((part, self.next.clone()));
        }
    }

    /// Carries the last state at rest to another part.
    pub fn carry_last(&mut self, part: f64) {
        let (at, last) = self.known.last().expect("states");
        self.next.clone_from(last);
        self.loading.carry([*at, part], &mut self.next);
        self.system.set_coupling(&self.loading.leaf);
    }

    /// Predicts the state at another part.
    fn predict(&mut self, part: f64) {
        self.carry_last(part);
        if self.known.len() < 2 {
            return;
        }
        let count = self.known.len();
        let weight = |k: usize| {
            let others = (0..count).filter(|other| *other != k);
            let part = others.map(|other| {
                let [own, other] = [k, other].map(|k| self.known[k].0);
                (part - other) / (own - other)
            });
            part.product()
        };
        // The last one, which the others change, has the rest of the weight.
        let mut weights = [0.0; PREDICTED_THROUGH];
        (0..count - 1).for_each(|k| weights[k] = weight(k));
        let (_, last) = &self.known[count - 1];
        let others = || self.known[..count - 1].iter().zip(weights);
        for k in 0..last.x.len() {
            let mut shift = DVec3::ZERO;
            let mut turn = DVec3::ZERO;
            for ((_, state), weight) in others() {
                shift += weight * (state.x[k] - last.x[k]);
                turn += weight * rotation::log(state.q[k] * last.q[k].conjugate());
            }
            self.next.x[k] = last.x[k] + shift;
            self.next.q[k] = (rotation::exp(turn) * last.q[k]).normalize();
        }
        for k in 0..last.n.len() {
            let change: DVec3 = others()
                .map(|((_, state), weight)| weight * (state.n[k] - last.n[k]))
                .sum();
            self.next.n[k] = last.n[k] + change;
        }
        let tied = others().all(|((_, state), _)| state.tissue.len() == last.tissue.len());
        self.next.tissue.clone_from(&last.tissue);
        for (k, force) in self.next.tissue.iter_mut().enumerate().filter(|_| tied) {
            for ((_, state), weight) in others() {
                *force += weight * (state.tissue[k] - last.tissue[k]);
            }
        }
        for j in 0..last.rods() {
            let base = last.base(j);
            (self.next.x[base], self.next.q[base]) = (last.x[base], last.q[base]);
        }
        self.loading.place_tips(&mut self.next);
    }

    /// Predicts and corrects the equilibrium at another part. Where none is found that is surely
    /// stable, one of any index is looked for if `any_sign` (more expensive), and converged to
    /// rounding: a neutral mode, as that of a buckled round column, is not unstable.
    fn step_to(&mut self, part: f64, any_sign: bool) -> Step {
        self.predict(part);
        let predicted = self.next.clone();
        let accuracy = if part < 1.0 { ON_THE_WAY } else { AT_THE_END };
        let stable =
            (self.correct(accuracy, ITERATIONS, definite)).and_then(|_| self.check(&predicted));
        match stable {
            Ok((0, drift)) => return Step::Stable(drift),
            Err(stop) if !any_sign => return Step::Lost(stop),
            Err(_) => {}
            Ok(_) => {
                // Forces of stiff rods that are not converged may be compressive.
                let again = self.correct(EXACT, ITERATIONS, definite);
                match again.and_then(|_| self.check(&predicted)) {
                    Ok((0, drift)) => return Step::Stable(drift),
                    _ if !any_sign => return Step::Unstable,
                    _ => {}
                }
            }
        }
        self.next.clone_from(&predicted);
        match (self.correct_to_any(&predicted)).and_then(|_| self.check(&predicted)) {
            Ok((0, drift)) => Step::Stable(drift),
            Ok(_) => Step::Unstable,
            Err(stop) => Step::Lost(stop),
        }
    }

    /// The Morse index of the next state, and its distance from the one predicted, if it is
    /// near that.
    fn check(&mut self, predicted: &State) -> Result<(usize, f64), Stop> {
        let drift = self.next.distance(predicted);
        if self.known.len() > 1 && drift > LARGEST_DRIFT {
            return Err(Stop::Stuck);
        }
        let leaf = &self.loading.leaf;
        let shift = leaf.neutral_shift();
        let index = saddle::index(leaf, &self.next, &mut self.system, shift, self.work);
        Ok((index.ok_or(Stop::Stuck)?, drift))
    }

    /// Newton's method from the predicted state to an equilibrium of any index nearby: beyond a fold
    /// there is none, and the iteration would wander.
    fn correct_to_any(&mut self, predicted: &State) -> Result<f64, Stop> {
        let mut moved = f64::INFINITY;
        for _ in 0..2 * ITERATIONS / ITERATIONS_AT_A_TIME {
            let from = self.next.clone();
            match self.correct(EXACT, ITERATIONS_AT_A_TIME, |_| saddle::ANY_SIGN) {
                Err(Stop::StepLimit) => {}
                end => return end,
            }
            let moves = from.distance(&self.next);
            let approaches = moves <= APPROACHING * moved;
            if !approaches || self.next.distance(predicted) > LARGEST_DRIFT {
                return Err(Stop::Stuck);
            }
            moved = moves;
        }
        Err(Stop::StepLimit)
    }

    /// Newton's method from the next state.
    fn correct<'s>(
        &'s mut self,
        accuracy: f64,
        iterations: usize,
        equations: impl FnOnce(&'s mut Definite) -> Equations<'s>,
    ) -> Result<f64, Stop> {
        let newton = Newton {
            accuracy,
            iterations,
            work: self.work,
            progress: self.progress,
        };
        let equations = equations(&mut self.solver);
        newton.solve(
            &self.loading.leaf,
            &mut self.next,
            &mut self.system,
            equations,
        )
    }

    /// Notes what happened at a part of the loading.
    pub fn note(&mut self, part: f64, happening: Happening) {
        let stage = self.stage;
        self.events.push(Event {
            stage,
            part,
            happening,
        });
    }
}

/// Newton's equations in a convex valley.
fn definite(solver: &mut Definite) -> Equations<'_> {
    Equations::Definite {
        solver,
        largest: LARGEST_INCREMENT,
        shifted: false,
        cg_tolerance: CG_TOLERANCE,
    }
}
