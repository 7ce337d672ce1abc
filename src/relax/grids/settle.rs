//! Settling on one grid.

use super::stability::saddle_of;
use super::{BUDGET, Level, MAX_SADDLES, Run};
use crate::leaf::{DiscreteLeaf, Grid, Solved, State, System, half_of};
use crate::relax::explicit;
use crate::relax::method::{Method, SemiImplicit};
use crate::relax::moment;
use crate::relax::options::Progress;
use crate::relax::saddle;
use crate::relax::semi_implicit::{Relaxation, Settled};
use crate::relax::start::{disturb, start};
use glam::DVec3;

/// Iteration error allowed on each grid, as a part of the tolerance: after so
/// coarse a first grid a little more saves a step on the finest.
const ITERATION_PART: f64 = 1e-3;
const ITERATION_PART_FROM_COARSE: f64 = 5e-3;

/// Iteration error allowed on a fixed grid, which is there to be compared.
const FIXED_ACCURACY: f64 = 1e-12;

/// Accuracy of the first solutions with conjugate gradients far from rest.
const FAR_FROM_REST: f64 = 1e-2;

/// Force evaluations that even the largest leaf is granted on every grid,
/// whatever was spent before.
const LEAST_EVALUATIONS: usize = 600;

/// Accuracy, in the energy norm, of the effects of shear and stretch: most of
/// that norm is stretch itself, and displacements are a small part of it.
const EFFECT_ACCURACY: f64 = 1e-5;

/// Where settling on a grid begins.
pub enum From {
    Start,
    /// The equilibrium of the next coarser grid, prolonged.
    Coarser(State),
    /// The equilibrium of the next finer grid, interpolated.
    Finer(State),
    /// A saddle the leaf was pushed off.
    Pushed(State),
}

impl<'a> Run<'a, '_> {
    /// Settles on one grid; leaves saddles unless they are wanted. Tells whether
    /// the leaf had to move, not only to settle in the valley it was in.
    pub(super) fn settle(&mut self, grid: Grid, from: From) -> (Level, Settled, bool) {
        self.last = None;
        let leaf = DiscreteLeaf::new(self.leaf, grid);
        let mut near_rest = matches!(from, From::Coarser(_) | From::Finer(_));
        let mut cg_tolerance = match from {
            From::Start | From::Pushed(_) => FAR_FROM_REST,
            From::Coarser(_) => 1e-4,
            // The error of interpolation is one of stiff modes, the error that
            // is to be removed one of soft ones: a small part of the energy.
            From::Finer(_) => 1e-8,
        };
        let mut state = match from {
            From::Start => match self.whole {
                None => {
                    let mut state = start(&leaf);
                    if let Method::SemiImplicit(SemiImplicit {
                        disturbance: Some(number),
                        ..
                    }) = self.options.method
                    {
                        disturb(&leaf, number, &mut state);
                    }
                    state
                }
                Some(whole) => {
                    let whole = DiscreteLeaf::new(whole, leaf.grid.clone());
                    half_of(self.leaf, &start(&whole))
                }
            },
            From::Coarser(state) | From::Finer(state) | From::Pushed(state) => state,
        };
        let mut system = System::new(&leaf);
        let segments = leaf.segments();
        let first = (self.levels.first()).map_or(segments, |first| first.leaf.segments());
        let accuracy = match self.segments() {
            Some(_) => FIXED_ACCURACY,
            None if self.too_coarse(first) => ITERATION_PART_FROM_COARSE * self.tolerance,
            None => ITERATION_PART * self.tolerance,
        };
        let keeps_unstable = self.keeps_unstable();
        let convex_only = self.whole.is_some() || self.too_coarse(segments);
        let progress = &mut *self.progress;
        let mut tell = |step: usize, residual: f64| {
            progress(&Progress {
                grid: segments,
                step,
                residual,
            });
        };
        if let Method::Explicit { .. } = self.options.method {
            let mut request = explicit::Request {
                accuracy,
                near_rest,
                work: &mut self.work,
                progress: &mut tell,
                moved: false,
                deadline: self.options.deadline,
            };
            let settled = explicit::settle(&leaf, &mut state, &mut system, &mut request);
            if let Settled::Rest(remaining) = settled {
                self.remaining = self.remaining.max(remaining);
            }
            return (Level { leaf, state }, settled, request.moved);
        }
        if leaf.tip_moment() != DVec3::ZERO {
            let mut leaf = leaf;
            let settled = moment::settle(
                &mut leaf,
                &mut state,
                &mut system,
                accuracy,
                near_rest,
                &mut self.work,
                &mut tell,
            );
            return (Level { leaf, state }, settled, false);
        }
        if keeps_unstable {
            let settled = saddle::newton(
                &leaf,
                &mut state,
                &mut system,
                accuracy,
                saddle::MAX_ITERATIONS,
                &mut self.work,
                &mut tell,
            );
            return (Level { leaf, state }, settled, false);
        }
        let nodes = leaf.rods() * segments;
        let allowed = (BUDGET.saturating_sub(self.spent) / nodes).max(LEAST_EVALUATIONS);
        let begun = self.work.force_evaluations;
        let mut moved = false;
        for pushes in 0..MAX_SADDLES {
            let mut relaxation = Relaxation {
                state,
                accuracy,
                work: &mut self.work,
                progress: &mut tell,
                near_rest,
                cg_tolerance,
                pushes,
                direct: None,
                most_evaluations: begun + allowed,
                deadline: self.options.deadline,
                convex_only,
                space: (leaf.planar() && self.levels.is_empty())
                    .then(|| System::new(&leaf.in_space())),
                moved: false,
            };
            let before = relaxation.work.force_evaluations;
            let settled = relaxation.settle(&leaf, &mut system);
            self.spent += nodes * (relaxation.work.force_evaluations - before);
            moved |= relaxation.moved;
            let direct = relaxation.direct.is_some();
            state = relaxation.state;
            if let Settled::Rest(remaining) = settled {
                self.remaining = self.remaining.max(remaining);
                if self.levels.is_empty() && !direct {
                    self.effects = effects(&leaf, &state, &mut system);
                }
            }
            if convex_only && !matches!(settled, Settled::Rest(_)) {
                return (Level { leaf, state }, settled, moved);
            }
            if settled != Settled::Saddle {
                self.last = (!direct && matches!(settled, Settled::Rest(_))).then_some(system);
                return (Level { leaf, state }, settled, moved);
            }
            match saddle::polish(&leaf, &mut state, &mut system, &mut self.work) {
                Some(Some(0)) => {
                    return (Level { leaf, state }, Settled::Rest(accuracy), moved);
                }
                Some(Some(index)) => self.saddle = Some(saddle_of(&leaf, &state, index)),
                _ => {}
            }
            saddle::push_off(&leaf, &mut state, &mut system, &mut self.work);
            (near_rest, cg_tolerance) = (false, FAR_FROM_REST);
        }
        (Level { leaf, state }, Settled::StepLimit, moved)
    }
}

/// Largest displacements if the leaf neither sheared, or did not stretch, to
/// first order; with the factorisation that the last iteration left.
fn effects(leaf: &DiscreteLeaf, state: &State, system: &mut System) -> [Option<f64>; 2] {
    [DVec3::new(0.0, 1.0, 1.0), DVec3::X].map(|dropped| {
        leaf.assemble_stiffening(state, dropped, system);
        match system.solve(None, EFFECT_ACCURACY) {
            Solved::Yes(_) => Some(system.largest().1),
            _ => None,
        }
    })
}
