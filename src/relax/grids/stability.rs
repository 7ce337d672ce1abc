//! Judging the stability of a leaf at rest, and leaving saddles.

use super::settle::From;
use super::{Level, MAX_SADDLES, Run};
use crate::leaf::{DiscreteLeaf, Leaf, State, System, whole_of};
use crate::relax::equilibrium::Saddle;
use crate::relax::richardson::Richardson;
use crate::relax::saddle;
use crate::relax::semi_implicit::Settled;
use glam::DVec3;

/// A leaf whose lowest eigenvalue (over the masses; that of a clamped rod is 12)
/// is larger than this one step before rest is stable at rest.
const CLEARLY: f64 = 1e-2;

impl<'a> Run<'a, '_> {
    /// Counts the negative eigenvalues on the finest grid. At a wanted saddle
    /// they must be as many as on the grid before. At one that is not wanted,
    /// the leaf is pushed off and the grids begin anew from where it lands.
    /// `Err(None)`: go on refining.
    pub(super) fn judge_stability(&mut self) -> Result<(), Option<Settled>> {
        let level = self.levels.last().expect("the leaf has landed");
        if level.leaf.tip_moment() != DVec3::ZERO {
            return Ok(());
        }
        if let Some(whole) = self.whole {
            let Level { leaf, state } = complete(self.leaf, whole, level);
            let mut system = System::new(&leaf);
            self.index = saddle::index(&leaf, &state, &mut system, 0.0, &mut self.work);
            return match self.index {
                Some(0) => Ok(()),
                _ => Err(Some(Settled::Saddle)),
            };
        }
        let before = self.index;
        if let Some(mut system) = self.last.take() {
            // It is that of the leaf at rest, or before a last small step.
            self.work.factorizations += 1;
            if system.stable_without_coupling(-CLEARLY) {
                self.index = Some(0);
                return Ok(());
            }
        }
        let mut system = System::new(&level.leaf);
        self.index = saddle::index(&level.leaf, &level.state, &mut system, 0.0, &mut self.work);
        if !matches!(self.index, Some(1..)) {
            return Ok(());
        }
        if self.keeps_unstable() {
            return if before == self.index || self.segments().is_some() {
                Ok(())
            } else {
                Err(None)
            };
        }
        let mut level = self.levels.pop().expect("the leaf has landed");
        let exact = saddle::polish(&level.leaf, &mut level.state, &mut system, &mut self.work);
        self.index = exact.flatten().or(self.index);
        let Some(index @ 1..) = self.index else {
            self.levels.push(level);
            return Ok(());
        };
        self.saddle = Some(saddle_of(&level.leaf, &level.state, index));
        self.pushes += 1;
        if self.pushes > MAX_SADDLES {
            self.levels.push(level);
            return Err(Some(Settled::StepLimit));
        }
        let mut state = level.state;
        saddle::push_off(&level.leaf, &mut state, &mut system, &mut self.work);
        let (level, settled, _) = self.settle(level.leaf.grid.clone(), From::Pushed(state));
        self.levels.clear();
        self.table = Richardson::default();
        self.push(level);
        match settled {
            Settled::Rest(_) if self.segments().is_some() => self.judge_stability(),
            Settled::Rest(_) => Err(None),
            _ => Err(Some(settled)),
        }
    }
}

/// The leaf with all of its unknowns, of which `reduced` is settled.
pub fn complete(reduced: &Leaf, whole: &Leaf, level: &Level) -> Level {
    Level {
        leaf: match reduced.rods() == whole.rods() {
            true => level.leaf.seen_as(whole),
            false => DiscreteLeaf::new(whole, level.leaf.grid.clone()),
        },
        state: whole_of(reduced, &level.state),
    }
}

/// What is said of a saddle.
pub fn saddle_of(leaf: &DiscreteLeaf, state: &State, index: usize) -> Saddle {
    let scale = leaf.leaf.scale;
    Saddle {
        energy: leaf.energy(state) * scale.moment(),
        negative_eigenvalues: index,
        tip: state.tip(0) * scale.length,
    }
}
