//! The iteration to equilibrium on one grid.

use crate::leaf::{DiscreteLeaf, Grid, Solved, State, System, half_of};
use crate::newton::{Definite, Newton, Stop};
use crate::relax::level::Level;
use crate::relax::method::{Method, SemiImplicit};
use crate::relax::methods::semi_implicit::Relaxation;
use crate::relax::methods::{explicit, moment};
use crate::relax::options::Progress;
use crate::relax::run::{BUDGET, Run, is_large};
use crate::relax::saddle::{self, saddle_of};
use crate::relax::start::{disturb, start};
use glam::DVec3;

/// Iteration error allowed on each grid, as a part of the tolerance: if the first grid is very
/// coarse, a looser one saves a step on the finest. On a grid that may be the only one it is
/// estimated, and subtracted, with the error of the grid.
const ITERATION_PART: f64 = 1e-3;
const ITERATION_PART_FROM_COARSE: f64 = 5e-3;
const ITERATION_PART_ALONE: f64 = 5e-2;

/// Iteration error allowed on a fixed grid, whose results are meant for comparisons.
const FIXED_ACCURACY: f64 = 1e-12;

/// Accuracy of the first solutions with conjugate gradients far from rest.
const FAR_FROM_REST: f64 = 1e-2;

/// Force evaluations that any leaf may use on every grid, whatever was spent before; on grids
/// of more segments than [`COARSE`] proportionally fewer, but no less than the second number.
const LEAST_EVALUATIONS: (usize, usize) = (600, 100);
const COARSE: usize = 64;

/// Newton iterations towards an equilibrium of any kind.
const MAX_ITERATIONS: usize = 200;

/// Saddles that are left before the run fails.
pub const MAX_SADDLES: i32 = 10;

/// Accuracy, in the energy norm, of the effects of shear and stretch: stretch dominates this
/// norm, to which displacements contribute little.
const EFFECT_ACCURACY: f64 = 1e-5;

/// The initial guess of the iteration on a grid.
pub enum InitialGuess {
    /// The start of the scenario, disturbed if requested.
    Start,
    /// The equilibrium of the next coarser grid, prolonged.
    Coarser(State),
    /// The equilibrium predicted from those on several coarser grids.
    Predicted(State),
    /// A state displaced from a saddle along its unstable mode.
    Pushed(State),
}

/// The end of the iteration on a grid, converged or not.
pub struct Settled {
    pub level: Level,
    /// The remaining iteration error.
    pub rest: Result<f64, Stop>,
    /// Whether it had to move through states of non-convex energy, instead of settling in the
    /// valley of the initial guess.
    pub moved: bool,
}

impl Run<'_, '_> {
    /// Settles on one grid; leaves saddles unless they are accepted.
    pub fn settle(&mut self, grid: Grid, guess: InitialGuess) -> Settled {
        let mut leaf = DiscreteLeaf::new(self.leaf, grid);
        let mut near_rest = matches!(guess, InitialGuess::Coarser(_) | InitialGuess::Predicted(_));
        let from_start = matches!(guess, InitialGuess::Start);
        let grip = leaf.leaf.held.is_some() && from_start;
        let cg_tolerance = match guess {
            InitialGuess::Start | InitialGuess::Pushed(_) => FAR_FROM_REST,
            InitialGuess::Coarser(_) => 1e-4,
            // The interpolation error is dominated by stiff modes; the error to be removed is
            // one of soft modes, a small part of the energy.
            InitialGuess::Predicted(_) => 1e-8,
        };
        let mut state = match guess {
            InitialGuess::Start => self.start(&leaf),
            InitialGuess::Coarser(state)
            | InitialGuess::Predicted(state)
            | InitialGuess::Pushed(state) => state,
        };
        let mut moved = false;
        if grip {
            let end = self.move_grips(&leaf, state);
            (state, near_rest, moved) = (end.state, end.at_rest, end.moved);
        }
        let explicit = matches!(self.options.method, Method::Explicit { .. });
        let dead_moment = leaf.tip_moment() != DVec3::ZERO;
        if !explicit && !dead_moment && !self.keeps_unstable() {
            let by_steps = self.by_steps && from_start;
            let how = (near_rest, by_steps, cg_tolerance);
            self.spare_system = None;
            let mut system = System::new(&leaf);
            let settled = self.settle_semi_implicit(leaf, state, &mut system, how);
            self.spare_system = (!is_large(&settled.level.leaf)).then_some(system);
            return Settled {
                moved: moved || settled.moved,
                ..settled
            };
        }
        let accuracy = self.accuracy(&leaf);
        let mut system = System::new(&leaf);
        let progress = &mut step_reporter(&mut *self.progress, leaf.segments());
        let work = &mut self.work;
        let rest = if explicit {
            let mut request = explicit::Request {
                accuracy,
                near_rest,
                work,
                progress,
                moved,
                limit: &self.options.limit,
            };
            let rest = explicit::settle(&leaf, &mut state, &mut system, &mut request);
            moved |= request.moved;
            self.remaining = self.remaining.max(rest.unwrap_or(0.0));
            rest
        } else {
            let newton = Newton {
                accuracy,
                iterations: MAX_ITERATIONS,
                work,
                progress,
            };
            match dead_moment {
                true => {
                    let limit = &self.options.limit;
                    moment::settle(&mut leaf, &mut state, &mut system, near_rest, limit, newton)
                }
                // To the next equilibrium, stable or not.
                false => newton.solve(&leaf, &mut state, &mut system, saddle::ANY_SIGN),
            }
        };
        let level = Level { leaf, state };
        Settled { level, rest, moved }
    }

    /// The start of a leaf without an initial guess.
    pub(super) fn start(&self, leaf: &DiscreteLeaf) -> State {
        if let Some(whole) = self.whole {
            let whole = DiscreteLeaf::new(whole, leaf.grid.clone());
            return half_of(self.leaf, &start(&whole));
        }
        let mut state = start(leaf);
        if let Method::SemiImplicit(SemiImplicit {
            disturbance: Some(number),
            ..
        }) = self.options.method
        {
            disturb(leaf, number, &mut state);
        }
        state
    }

    /// Iteration error allowed on a grid.
    fn accuracy(&self, leaf: &DiscreteLeaf) -> f64 {
        let first = (self.levels.first()).map_or(leaf.segments(), |first| first.leaf.segments());
        match self.segments() {
            Some(_) => FIXED_ACCURACY,
            None if self.too_coarse(first) => match self.levels.is_empty() && self.may_be_alone() {
                true => ITERATION_PART_ALONE * self.tolerance,
                false => ITERATION_PART_FROM_COARSE * self.tolerance,
            },
            None => ITERATION_PART * self.tolerance,
        }
    }

    /// Settles by the semi-implicit method.
    fn settle_semi_implicit(
        &mut self,
        leaf: DiscreteLeaf,
        mut state: State,
        system: &mut System,
        (mut near_rest, mut by_steps, mut cg_tolerance): (bool, bool, f64),
    ) -> Settled {
        let accuracy = self.accuracy(&leaf);
        let convex_only = self.whole.is_some() || self.too_coarse(leaf.segments());
        let nodes = leaf.rods() * leaf.segments();
        let (most, least) = LEAST_EVALUATIONS;
        let granted = (most * COARSE / leaf.segments()).clamp(least, most);
        let allowed = (BUDGET.saturating_sub(self.spent) / nodes).max(granted);
        let begun = self.work.force_evaluations;
        let mut moved = false;
        // After earlier pushes off saddles at rest, the softened leaf returned to one.
        for pushes in self.pushes..self.pushes + MAX_SADDLES {
            let mut relaxation = Relaxation {
                state,
                accuracy,
                work: &mut self.work,
                progress: &mut step_reporter(&mut *self.progress, leaf.segments()),
                near_rest,
                cg_tolerance,
                pushes,
                solver: Definite {
                    contraction: self.contraction,
                    direct: None,
                },
                most_evaluations: begun + allowed,
                limit: &self.options.limit,
                convex_only,
                moved: false,
                in_time: false,
                by_steps,
                moved_softened: false,
                load_part: 0.0,
            };
            let before = relaxation.work.force_evaluations;
            let rest = relaxation.settle(&leaf, system);
            let spent = relaxation.work.force_evaluations - before;
            moved |= relaxation.moved;
            let direct = relaxation.solver.direct.is_some();
            self.contraction = relaxation.solver.contraction;
            self.load_part = relaxation.load_part.max(self.load_part);
            self.moved_softened |= relaxation.moved_softened;
            state = relaxation.state;
            self.spent += nodes * spent;
            if let Ok(remaining) = rest {
                self.remaining = self.remaining.max(remaining);
                if self.levels.is_empty() && !direct {
                    self.effects = effects(&leaf, &state, system);
                }
            }
            if rest != Err(Stop::Saddle) || convex_only {
                let level = Level { leaf, state };
                return Settled { level, rest, moved };
            }
            match saddle::polish(&leaf, &mut state, system, &mut self.work) {
                Some(0) => {
                    let (level, rest) = (Level { leaf, state }, Ok(accuracy));
                    return Settled { level, rest, moved };
                }
                Some(index) => self.saddle = Some(saddle_of(&leaf, &state, index)),
                None => {}
            }
            saddle::push_off(&leaf, &mut state, system, &mut self.work);
            (near_rest, cg_tolerance, by_steps) = (false, FAR_FROM_REST, false);
        }
        let (level, rest) = (Level { leaf, state }, Err(Stop::StepLimit));
        Settled { level, rest, moved }
    }
}

/// Reports the steps on a grid of `grid` segments.
fn step_reporter(
    progress: &mut dyn FnMut(&Progress),
    grid: usize,
) -> impl FnMut(usize, f64) + use<'_> {
    move |step, residual| {
        progress(&Progress::Relaxing {
            grid,
            step,
            residual,
        });
    }
}

/// Largest displacements, to first order, if shear, or stretch, were suppressed; uses the
/// factorisation of the last iteration.
fn effects(leaf: &DiscreteLeaf, state: &State, system: &mut System) -> [Option<f64>; 2] {
    [DVec3::new(0.0, 1.0, 1.0), DVec3::X].map(|dropped| {
        leaf.assemble_stiffening(state, dropped, system);
        match system.solve(None, EFFECT_ACCURACY) {
            Solved::Yes(_) => Some(system.largest().1),
            _ => None,
        }
    })
}
