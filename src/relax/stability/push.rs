//! The stability of a leaf at rest, and pushes off saddles.

use crate::leaf::System;
use crate::newton::Stop;
use crate::relax::saddle;
use crate::relax::saddle::saddle_of;
use crate::relax::settle::iteration::{InitialGuess, MAX_SADDLES, Settled};
use crate::relax::settle::run::Run;
use crate::relax::transfer::level::{Level, complete};
use glam::DVec3;

impl Run<'_, '_> {
    /// Counts the negative eigenvalues on one grid, and whether the leaf is clearly stable. If
    /// it is not and will be `compared` with another grid nothing is counted; returns whether
    /// it was.
    fn count_negative(&mut self, level: &Level, system: &mut System, compared: bool) -> bool {
        let Level { leaf, state } = level;
        self.clearly_stable = saddle::clearly_stable(leaf, state, system, &mut self.work);
        if compared && !self.clearly_stable {
            return false;
        }
        self.index = match self.clearly_stable {
            true => Some(0),
            false if leaf.neutral_shift() > saddle::NOISY => {
                let within = saddle::index_within_rounding(leaf, state, system, &mut self.work);
                // Whatever is unstable is pushed off, however many its unstable modes.
                let known = |&[least, most]: &[usize; 2]| {
                    least == most || (least > 0 && !self.keeps_unstable())
                };
                within.filter(known).map(|[least, _]| least)
            }
            false => saddle::index(leaf, state, system, 0.0, &mut self.work),
        };
        true
    }

    /// Counts the negative eigenvalues on the finest grid. On the first, unless it is the `last`,
    /// the leaf must be clearly stable. If saddles are accepted the number must be that on the
    /// grid before. Otherwise the leaf is pushed off a saddle, and the grids start again from the
    /// equilibrium reached. Returns whether stability is known, as far as possible: if not,
    /// finer grids are needed.
    pub fn check_stability(&mut self, last: bool) -> Result<bool, Stop> {
        let level = self.levels.last().expect("the leaf has settled");
        if level.leaf.tip_moment() != DVec3::ZERO {
            return Ok(true);
        }
        let compared = !last && self.levels.len() == 1 && self.segments().is_none();
        if let Some(whole) = self.whole {
            let level = complete(self.leaf, whole, level);
            let mut system = System::new(&level.leaf);
            if !self.count_negative(&level, &mut system, compared) {
                return Ok(false);
            }
            return match self.index {
                Some(0) => Ok(true),
                _ => Err(Stop::Saddle),
            };
        }
        let before = self.index;
        let mut level = self.levels.pop().expect("the leaf has settled");
        let mut spare = self.spare_system.take();
        if spare.is_none() && self.levels.is_empty() {
            // Further grids have equations of their own.
            spare = self.linear.take().map(|linear| linear.system);
        }
        let mut system = System::reused(spare, &level.leaf);
        let counted = self.count_negative(&level, &mut system, compared);
        if counted && matches!(self.index, Some(1..)) && !self.keeps_unstable() {
            let Level { leaf, state } = &mut level;
            let exact = saddle::polish(leaf, state, &mut system, &mut self.work);
            self.index = exact.or(self.index);
        }
        let index = match self.index {
            Some(index @ 1..) if counted => index,
            _ => {
                self.levels.push(level);
                return Ok(counted);
            }
        };
        if self.keeps_unstable() {
            self.levels.push(level);
            return Ok(before == self.index || self.segments().is_some());
        }
        if self.stays_in_valley {
            self.levels.push(level);
            return Err(Stop::Saddle);
        }
        self.saddle = Some(saddle_of(&level.leaf, &level.state, index));
        self.pushes += 1;
        if self.pushes > MAX_SADDLES {
            self.levels.push(level);
            return Err(Stop::StepLimit);
        }
        let Level { leaf, mut state } = level;
        let leaning = self.options.leaning;
        saddle::push_off(&leaf, &mut state, &mut system, leaning, &mut self.work);
        let Settled { level, rest, .. } = self.settle(leaf.grid, InitialGuess::Pushed(state));
        self.levels.clear();
        self.push(level);
        rest?;
        match self.segments() {
            Some(_) => self.check_stability(last),
            None => Ok(false),
        }
    }
}
