//! The equilibrium of a leaf that moved while softened, checked against its motion in time
//! with its own stiffness.
//!
//! Stiff rods are softened while a leaf moves ([`super::methods`]), and a softened leaf may
//! come to rest in another valley (basin of attraction) of its energy, even if its steps, too
//! long to resolve inertia, never leave the valley of its start. Unless Newton's steps alone led
//! to rest, the damped motion of the leaf with its own stiffness is integrated on one grid, from
//! the start and with the mass and damping of a relaxation, until it has settled in a valley;
//! Newton's method continues from there.

use crate::leaf::{DiscreteLeaf, Grid, State, System};
use crate::motion::{Method as _, Physics, SemiImplicit, Steps};
use crate::newton::Stop;
use crate::relax::grids::FINEST_RESOLVING;
use crate::relax::level::{Level, flat};
use crate::relax::method::{Method, SemiImplicit as How};
use crate::relax::prolong::prolong;
use crate::relax::run::Run;
use crate::relax::saddle;
use crate::relax::settle::InitialGuess;

/// Segments of the grid, at least, unless a grid is requested: of a first attempt and, if that
/// ends at another equilibrium than the softened leaf, of a second, which decides.
const SEGMENTS: [usize; 2] = [32, 64];

/// Step control of the motion, errors in lengths and radians. With larger steps, or more
/// damping of what these do not resolve, some leaves end elsewhere.
const STEPS: Steps = Steps::ToRest {
    error: 3e-3,
    rho_inf: 0.8,
};

/// Time between checks of the moving leaf, in units of sqrt(rho L^4/A).
const CHECK_INTERVAL: f64 = 0.25;

/// Kinetic energy, as a part of its maximum, below which the leaf may have settled in a
/// valley, and below which it is at rest, possibly at a saddle.
const SLOW: f64 = 1e-2;
const AT_REST: f64 = 1e-9;

/// Limit on nodes times factorisations in an attempt: about a second.
const BUDGET: usize = 3_000_000;

/// Largest displacement of a node, in lengths, between states of the same valley.
const SAME_PLACE: f64 = 0.02;

/// Whether two states are in the same valley.
fn same_place(a: &Level, b: &Level) -> bool {
    a.state.shift_to(&b.state) < SAME_PLACE
}

impl Run<'_, '_> {
    /// The end of a run or, if the leaf moved while softened and its own motion comes to rest
    /// at another equilibrium, the end of a run that starts there. Whether it moved remains set
    /// where its own motion does not decide.
    pub fn settle_by_own_motion(
        &mut self,
        grid: &Grid,
        end: Result<bool, Stop>,
    ) -> Result<bool, Stop> {
        let disturbed = matches!(
            self.options.method,
            Method::SemiImplicit(How {
                disturbance: Some(_),
                ..
            })
        );
        // Held tips were moved quasi-statically to their positions, not by a motion in time.
        let held = self.leaf.held.is_some();
        if end.is_err() || !self.moved_softened || disturbed || held {
            return end;
        }
        let effects = self.effects;
        let softened = std::mem::take(&mut self.levels);
        let softened_end = softened.last().expect("the leaf has settled");
        let (mut grid, mut followed_on) = (grid.clone(), 0);
        let mut last: Option<Level> = None;
        for segments in SEGMENTS {
            while self.segments().is_none() && grid.segments() < segments {
                grid = grid.refined();
            }
            if grid.segments() == followed_on {
                // The motion would be the same.
                self.moved_softened = false;
                break;
            }
            followed_on = grid.segments();
            let Some(there) = self.follow_own_motion(grid.clone()) else {
                break;
            };
            // A planar motion stays planar, stable or not: it decides nothing.
            if flat(&there) && !flat(softened_end) {
                break;
            }
            self.moved_softened = !same_place(last.as_ref().unwrap_or(softened_end), &there);
            last = Some(there);
            if !self.moved_softened {
                break;
            }
        }
        let moved_softened = self.moved_softened;
        let Some(level) = last.filter(|there| !same_place(softened_end, there)) else {
            (self.levels, self.effects) = (softened, effects);
            return end;
        };
        let effects = self.effects;
        self.restart();
        self.effects = effects;
        self.push(level);
        let end = self.refine();
        self.moved_softened |= moved_softened;
        end
    }

    /// The equilibrium in the valley where the leaf's own motion ends; `None` if that takes
    /// too long or ends at a saddle.
    fn follow_own_motion(&mut self, grid: Grid) -> Option<Level> {
        let leaf = DiscreteLeaf::new(self.leaf, grid);
        let most = BUDGET / (leaf.rods() * leaf.segments());
        let mut system = System::new(&leaf);
        let (physics, start) = (Physics::at_rest(self.leaf), self.start(&leaf));
        let mut motion = SemiImplicit::new(leaf.clone(), physics, &start, STEPS);
        let (mut next_check, mut fastest) = (CHECK_INTERVAL, 0.0_f64);
        let softened = self.moved_softened;
        let begun = self.work.factorizations;
        let mut settled = None;
        while !self.out_of_time() {
            // Those of indices and of attempts to settle count, too.
            if self.work.factorizations - begun + motion.factorizations > most {
                break;
            }
            if motion.step_towards(f64::INFINITY).is_err() {
                break;
            }
            if motion.time() < next_check {
                continue;
            }
            next_check = motion.time() + CHECK_INTERVAL;
            let now = motion.snapshot();
            let kinetic = now.energy.kinetic;
            fastest = fastest.max(kinetic);
            if kinetic.is_nan() || kinetic > SLOW * fastest {
                continue;
            }
            let shift = leaf.neutral_shift();
            let index = saddle::index(&leaf, &now.state, &mut system, shift, &mut self.work);
            if index == Some(0) {
                settled = self.settle_in_this_valley(&leaf, &now.state);
            }
            if settled.is_some() || kinetic <= AT_REST * fastest {
                break;
            }
        }
        self.work.steps += motion.steps();
        self.work.factorizations += motion.factorizations;
        self.work.force_evaluations += motion.factorizations;
        self.moved_softened = softened;
        settled
    }

    /// The equilibrium that Newton's method reaches from a state without leaving its valley, on
    /// the first grid from this one on that resolves it.
    fn settle_in_this_valley(&mut self, leaf: &DiscreteLeaf, state: &State) -> Option<Level> {
        let (mut grid, mut guess) = (leaf.grid.clone(), state.clone());
        self.moved_softened = false;
        loop {
            let found = self.settle(grid, InitialGuess::Coarser(guess));
            let level = found.level;
            let finer = level.leaf.grid.refined();
            if found.rest == Err(Stop::Unresolved)
                && self.segments().is_none()
                && finer.segments() <= FINEST_RESOLVING
            {
                guess = prolong(&level.leaf, &level.state);
                grid = finer;
                continue;
            }
            let stays = !found.moved && !self.moved_softened && found.rest.is_ok();
            let near = level.state.shift_to(state) < SAME_PLACE;
            return (stays && near).then_some(level);
        }
    }
}
