//! A boundary-value solution without a given start: by continuation from the leaf
//! that rests in arcs, whose solution is known, to the scenario's.

use crate::homotopy::Homotopy;
use crate::shape::equally_spaced;
use crate::shooting::equations::Equations;
use crate::shooting::newton::Newton;
use crate::shooting::solution::{Log, Reason};
use crate::shooting::trajectory::Trajectory;

/// Accuracy of intermediate solutions.
const ROUGH: f64 = 1e-6;

/// Smallest step, as a part of the whole change.
const LEAST_STEP: f64 = 1.0 / 16384.0;

/// Evaluations of slopes of single rods before a strategy is abandoned: some seconds.
const BUDGET: usize = 4_000_000;

/// Stations per interval at which a solution is stored as the start of the next one.
const STATIONS: usize = 4;

/// Over many short intervals, Newton's method has a larger region of convergence.
/// Rotation over one of them, in radians, and their largest number.
const TURN: f64 = 0.3;
const LEAST_INTERVALS: usize = 8;
const MOST_INTERVALS: usize = 256;

/// A continuation that ended before the scenario's leaf was reached.
pub struct Interrupted {
    pub reason: Reason,
    /// Part of the change that was made.
    pub part: f64,
    pub near: Trajectory,
}

/// How the leaf of arcs is changed into the scenario's, in the order of attempts.
/// The last one may end far from its start.
const STRATEGIES: [Strategy; 3] = [Strategy::Near, Strategy::Stiff, Strategy::Far];

#[derive(Clone, Copy, PartialEq)]
enum Strategy {
    /// Newton's steps are limited to solutions nearby.
    Near,
    /// Steps limited like those of [`Strategy::Near`], with rods that initially have their
    /// largest stiffness in all directions.
    Stiff,
    /// Newton's steps are not limited.
    Far,
}

/// Follows the equilibrium from the leaf of arcs to the scenario's. Returns a
/// trajectory near the solution.
pub fn from_arcs(
    equations: &mut Equations,
    intervals: Option<usize>,
    log: &mut Log,
) -> Result<Trajectory, Interrupted> {
    let mut first = None;
    for strategy in STRATEGIES {
        let mut attempt = Attempt {
            strategy,
            equations,
            intervals,
            log,
        };
        match attempt.follow() {
            Ok(near) => return Ok(near),
            Err(failure) if failure.reason == Reason::OutOfTime => return Err(failure),
            Err(failure) => first = first.or(Some(failure)),
        }
    }
    Err(first.expect("there is a strategy"))
}

/// A continuation by one of the strategies.
struct Attempt<'c, 'a, 'p> {
    strategy: Strategy,
    equations: &'c mut Equations<'a>,
    intervals: Option<usize>,
    log: &'c mut Log<'p>,
}

impl Attempt<'_, '_, '_> {
    fn follow(&mut self) -> Result<Trajectory, Interrupted> {
        self.equations.part = 0.0;
        let stiff = self.strategy == Strategy::Stiff;
        self.equations.softened = if stiff { 0.0 } else { 1.0 };
        let unstressed = Trajectory::unstressed(self.equations, ROUGH);
        let near = unstressed.map_err(|unbounded| Interrupted {
            reason: unbounded.into(),
            part: 0.0,
            near: Trajectory::straight(self.equations),
        })?;
        let near = self.follow_stage(|equations| &mut equations.part, near)?;
        match stiff {
            true => self.follow_stage(|equations| &mut equations.softened, near),
            false => Ok(near),
        }
    }

    /// Changes the equations by one stage; the first attempt is the whole change.
    fn follow_stage(
        &mut self,
        stage: Stage,
        mut near: Trajectory,
    ) -> Result<Trajectory, Interrupted> {
        let mut path = Homotopy::new(1.0, [LEAST_STEP, 1.0]);
        let mut before: Option<(Trajectory, f64)> = None;
        let (begun, rods) = (self.log.work.slopes, self.equations.rods());
        while path.part < 1.0 {
            let part = path.part;
            self.log.part = part;
            *stage(self.equations) = path.next();
            let predicted = match &before {
                Some((earlier, at)) => {
                    near.beyond(self.equations, earlier, path.length() / (part - at))
                }
                None => near.clone(),
            };
            match self.solve_near(&predicted) {
                Ok(trajectory) => {
                    before = Some((std::mem::replace(&mut near, trajectory), part));
                    path.advance(2.0 * path.length());
                }
                Err(reason) => {
                    let spent = (self.log.work.slopes - begun) * rods;
                    let ends = reason == Reason::OutOfTime || spent >= BUDGET;
                    if ends || !path.shorten(0.5) {
                        return Err(Interrupted { reason, part, near });
                    }
                }
            }
        }
        self.log.part = 1.0;
        Ok(near)
    }

    fn solve_near(&mut self, near: &Trajectory) -> Result<Trajectory, Reason> {
        let equations = &*self.equations;
        let count = self.intervals.unwrap_or_else(|| {
            let turns = (near.turn(equations) / TURN).ceil() as usize;
            turns.clamp(LEAST_INTERVALS, MOST_INTERVALS)
        });
        let mut newton = Newton::from_trajectory(equations, near, Some(count), self.log)?;
        newton.only_near = self.strategy != Strategy::Far;
        newton.solve(ROUGH)?;
        let stations = equally_spaced(STATIONS * count.max(LEAST_INTERVALS));
        let sampled = Trajectory::sampled(equations, &newton.nodes, &stations, ROUGH);
        Ok(sampled?)
    }
}

/// The parameter that varies from 0 to 1 along a stage.
type Stage = for<'e> fn(&'e mut Equations) -> &'e mut f64;
