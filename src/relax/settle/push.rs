//! The count of negative eigenvalues of a leaf at rest, and pushes off saddles.

use crate::leaf::System;
use crate::newton::{Stop, Work};
use crate::relax::nested::{Failure, NestedEquilibrium};
use crate::relax::request::problem::Problem;
use crate::relax::saddle;
use crate::relax::saddle::saddle_of;
use crate::relax::settle::effort::Effort;
use crate::relax::settle::iteration::{InitialGuess, MAX_SADDLES, Settled, settle};
use crate::relax::transfer::level::{Level, complete};

/// What is known of the stability on one grid.
struct Count {
    /// Whether the leaf is clearly stable.
    clearly_stable: bool,
    /// The number of negative eigenvalues, if it is known; `None` if they were not counted.
    index: Option<Option<usize>>,
}

/// Counts the negative eigenvalues on one grid, and whether the leaf is clearly stable. If
/// it is not and will be `compared` with another grid nothing is counted.
fn count_negative(
    problem: &Problem,
    level: &Level,
    system: &mut System,
    compared: bool,
    work: &mut Work,
) -> Count {
    let Level { leaf, state } = level;
    let clearly_stable = saddle::clearly_stable(leaf, state, system, work);
    let index = match clearly_stable {
        true => Some(0),
        false if compared => {
            return Count {
                clearly_stable,
                index: None,
            };
        }
        false if leaf.neutral_shift() > saddle::NOISY => {
            let within = saddle::index_within_rounding(leaf, state, system, work);
            // Whatever is unstable is pushed off, however many its unstable modes.
            let known = |&[least, most]: &[usize; 2]| {
                least == most || (least > 0 && !problem.keeps_unstable())
            };
            within.filter(known).map(|[least, _]| least)
        }
        false => saddle::index(leaf, state, system, 0.0, work),
    };
    Count {
        clearly_stable,
        index: Some(index),
    }
}

/// Counts the negative eigenvalues on the finest grid. On the first, unless it is the `last`,
/// the leaf must be clearly stable. If saddles are accepted the number must be that on the
/// grid before. Otherwise the leaf is pushed off a saddle, and the grids start again from the
/// equilibrium reached. Returns whether stability is known, as far as possible: if not,
/// finer grids are needed.
pub fn check_stability(
    problem: &Problem,
    found: NestedEquilibrium,
    last: bool,
    effort: &mut Effort,
) -> Result<(NestedEquilibrium, bool), Box<Failure>> {
    let level = found.levels.last().expect("the leaf has settled");
    if !level.leaf.leaf.has_potential() {
        return Ok((found, true));
    }
    let compared = !last && found.levels.len() == 1 && problem.segments().is_none();
    if let Some(whole) = problem.whole {
        let level = complete(problem.leaf, whole, level);
        let mut system = System::new(&level.leaf);
        let count = count_negative(problem, &level, &mut system, compared, &mut effort.work);
        let index = count.index.unwrap_or(found.index);
        let found = found.counted(count.clearly_stable, index);
        return match (count.index, found.index) {
            (None, _) => Ok((found, false)),
            (_, Some(0)) => Ok((found, true)),
            _ => found.failed(Stop::Saddle),
        };
    }
    let before = found.index;
    let (mut found, mut level) = found.split();
    let mut spare = effort.spare_system.take();
    if spare.is_none() && found.levels.is_empty() {
        // Further grids have equations of their own.
        spare = found.linear.take().map(|linear| linear.system);
    }
    let mut system = System::reused(spare, &level.leaf);
    let work = &mut effort.work;
    let mut count = count_negative(problem, &level, &mut system, compared, work);
    if matches!(count.index, Some(Some(1..))) && !problem.keeps_unstable() {
        let Level { leaf, state } = &mut level;
        let exact = saddle::polish(leaf, state, &mut system, work);
        count.index = exact.map(Some).or(count.index);
    }
    found = found.counted(count.clearly_stable, count.index.unwrap_or(before));
    let Some(Some(index @ 1..)) = count.index else {
        return Ok((found.joined(level), count.index.is_some()));
    };
    if problem.keeps_unstable() {
        let known = before == found.index || problem.segments().is_some();
        return Ok((found.joined(level), known));
    }
    if problem.stays_in_valley {
        return found.joined(level).failed(Stop::Saddle);
    }
    found.history.saddle = Some(saddle_of(&level.leaf, &level.state, index));
    found.history.pushes += 1;
    if found.history.pushes > MAX_SADDLES {
        return found.joined(level).failed(Stop::StepLimit);
    }
    let Level { leaf, mut state } = level;
    let leaning = problem.options.leaning;
    saddle::push_off(&leaf, &mut state, &mut system, leaning, work);
    let pushed = (leaf.grid, InitialGuess::Pushed(state));
    let Settled { level, rest, .. } = settle(problem, &mut found.history, pushed, effort);
    let found = found.on(vec![level]);
    match (rest, problem.segments()) {
        (Err(stop), _) => found.failed(stop),
        (Ok(_), Some(_)) => check_stability(problem, found, last, effort),
        (Ok(_), None) => Ok((found, false)),
    }
}
