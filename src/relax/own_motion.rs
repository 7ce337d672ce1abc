//! The landing place of a leaf that moved while it was softer than it is: that of its
//! own motion in time.
//!
//! Stiff rods are softened while a leaf moves ([`super::methods`]), and softened it may
//! come to rest in another valley of its energy. Where that can have happened, the
//! damped motion of the leaf with its own stiffness, from the start and with the mass
//! and damping that a relaxation has, is followed on one grid until it has settled in a
//! valley; Newton's method goes on from there.

use crate::leaf::{DiscreteLeaf, Grid, System};
use crate::motion::{Method as _, Physics, SemiImplicit, Steps};
use crate::newton::Stop;
use crate::relax::level::Level;
use crate::relax::method::{Method, SemiImplicit as How};
use crate::relax::run::Run;
use crate::relax::saddle;
use crate::relax::settle::InitialGuess;

/// Segments of the grid, unless one is asked for.
const SEGMENTS: usize = 32;

/// Steps of the motion, errors in lengths and radians: of a first attempt, and where that
/// ends elsewhere than the softened leaf, of a second one, which decides.
const STEPS: [Steps; 2] = [
    Steps::ToRest {
        error: 1e-2,
        rho_inf: 0.0,
    },
    Steps::ToRest {
        error: 3e-3,
        rho_inf: 0.8,
    },
];

/// Time between looks at the moving leaf, in units of sqrt(rho L^4/A).
const LOOK: f64 = 0.25;

/// No more of the kinetic energy than this part is left where it may have settled, and
/// where it rests, be it at a saddle.
const SLOW: f64 = 1e-2;
const STILL: f64 = 1e-9;

/// Nodes times factorisations after which it is given up: about a second.
const BUDGET: usize = 1_000_000;

/// Largest distance of a node, in lengths, between states in one valley.
const SAME_PLACE: f64 = 0.02;

/// Whether no node is beside the plane z = 0.
fn flat(level: &Level) -> bool {
    level.state.x.iter().all(|x| x.z == 0.0)
}

impl Run<'_, '_> {
    /// The end of a run, or, where the leaf had to move while softened and its own
    /// motion comes to rest elsewhere, that of a run from there.
    pub fn land_by_own_motion(
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
        // Tips that are held were led to their places: that is no motion in time.
        let held = self.leaf.held.is_some();
        if end.is_err() || !self.moved_softened || disturbed || held {
            return end;
        }
        let effects = self.effects;
        let softened = std::mem::take(&mut self.levels);
        let mut landed = None;
        for steps in STEPS {
            let Some(there) = self.follow_own_motion(grid.clone(), steps) else {
                break;
            };
            // In its plane a motion stays, stable or not: that decides nothing.
            if flat(&there) && softened.last().is_some_and(|level| !flat(level)) {
                break;
            }
            self.moved_softened = false;
            let elsewhere = |here: &Level| here.state.shift_to(&there.state) > SAME_PLACE;
            landed = softened.last().is_some_and(elsewhere).then_some(there);
            if landed.is_none() {
                break;
            }
        }
        let Some(level) = landed else {
            (self.levels, self.effects) = (softened, effects);
            return end;
        };
        let effects = self.effects;
        self.begin_anew();
        self.effects = effects;
        self.push(level);
        self.refine()
    }

    /// The leaf at rest in the valley in which its own motion ends; `None` if that takes
    /// too long, or ends at a saddle.
    fn follow_own_motion(&mut self, mut grid: Grid, steps: Steps) -> Option<Level> {
        while self.segments().is_none() && grid.segments() < SEGMENTS {
            grid = grid.refined();
        }
        let leaf = DiscreteLeaf::new(self.leaf, grid);
        let most = BUDGET / (leaf.rods() * leaf.segments());
        let mut system = System::new(&leaf);
        let (physics, start) = (Physics::at_rest(self.leaf), self.start(&leaf));
        let mut motion = SemiImplicit::new(leaf.clone(), physics, &start, steps);
        let (mut next_look, mut fastest) = (LOOK, 0.0_f64);
        let mut settled = None;
        let softened = self.moved_softened;
        while settled.is_none() && motion.factorizations < most && !self.late() {
            if motion.step_towards(f64::INFINITY).is_err() {
                break;
            }
            if motion.time() < next_look {
                continue;
            }
            next_look = motion.time() + LOOK;
            let now = motion.snapshot();
            let kinetic = now.energy.kinetic;
            fastest = fastest.max(kinetic);
            if kinetic.is_nan() || kinetic > SLOW * fastest {
                continue;
            }
            let shift = leaf.neutral_shift();
            let index = saddle::index(&leaf, &now.state, &mut system, shift, &mut self.work);
            if index == Some(0) {
                self.moved_softened = false;
                let guess = InitialGuess::Coarser(now.state.clone());
                let found = self.settle(leaf.grid.clone(), guess);
                let stays = !found.moved && !self.moved_softened && found.rest.is_ok();
                let near = found.level.state.shift_to(&now.state) < SAME_PLACE;
                settled = (stays && near).then_some(found.level);
            } else if kinetic <= STILL * fastest {
                break;
            }
        }
        self.work.steps += motion.steps();
        self.work.factorizations += motion.factorizations;
        self.work.force_evaluations += motion.factorizations;
        self.moved_softened = softened;
        settled
    }
}
