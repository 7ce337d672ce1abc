//! From a free start to held tips: the grips are moved quasi-statically.
//!
//! A leaf with a held tip may have many equilibria, and the one it reaches depends on the
//! loading path. The path here is that of a testing machine: the leaf is gripped where a free
//! start has its tips, and the grips move and rotate uniformly to their final positions, with
//! the leaf at rest at every step.

use crate::leaf::{DiscreteLeaf, State, System};
use crate::newton::{Definite, Stop};
use crate::relax::methods::Relaxation;
use crate::relax::path::Holders;
use crate::relax::run::Run;
use crate::relax::saddle;

/// Largest displacement (lengths) and rotation (radians) of the grips in a step.
const SHIFT: f64 = 0.1;
const TURN: f64 = 0.4;

/// Accuracy of the equilibria along the path.
const ACCURACY: f64 = 1e-2;

/// Saddles that are left in a step.
const PUSHES: i32 = 3;

impl Run<'_, '_> {
    /// Moves the tips from their positions in `state` to those where they are held. Returns the
    /// state there, whether the leaf rests in it, and whether its energy was not convex along
    /// the path.
    pub fn move_grips(&mut self, leaf: &DiscreteLeaf, state: State) -> (State, bool, bool) {
        let Some(holders) = Holders::new(leaf, &state) else {
            return (state, false, false);
        };
        let steps = (holders.way() / SHIFT).max(holders.turn() / TURN);
        let steps = steps.ceil().max(1.0);
        let keeps_unstable = self.keeps_unstable();
        let (limit, begun) = (&self.options.limit, self.work.force_evaluations);
        let mut system = System::new(leaf);
        let ignored: &mut dyn FnMut(usize, f64) = &mut |_, _| {};
        let mut held = Relaxation::new(state, ACCURACY, (&mut self.work, ignored), limit);
        for step in 1..=steps as usize {
            if limit.reached() {
                break;
            }
            holders.move_tips(leaf, step as f64 / steps, &mut held.state);
            held.near_rest = settle_held(leaf, &mut system, &mut held, keeps_unstable);
        }
        let (mut state, near_rest, moved) = (held.state, held.near_rest, held.moved);
        self.spent += leaf.rods() * leaf.segments() * (self.work.force_evaluations - begun);
        leaf.leaf.hold_tips(&mut state);
        (state, near_rest, moved)
    }
}

/// Brings the leaf roughly to rest with its tips fixed, if possible.
fn settle_held(
    leaf: &DiscreteLeaf,
    system: &mut System,
    held: &mut Relaxation,
    keeps_unstable: bool,
) -> bool {
    for pushes in 0..PUSHES {
        (held.pushes, held.solver) = (pushes, Definite::default());
        let rest = held.settle(leaf, system);
        if rest != Err(Stop::Saddle) || keeps_unstable {
            return rest.is_ok();
        }
        saddle::push_off(leaf, &mut held.state, system, held.work);
    }
    false
}
