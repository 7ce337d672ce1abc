//! The decision on the stability of a leaf at rest: its Morse index is that on a grid only where
//! no eigenvalue is so close to zero that other grids may tell another sign.

use crate::leaf::{Grid, System};
use crate::newton::Stop;
use crate::relax::request::options::MOST_MODES;
use crate::relax::saddle::bounds;
use crate::relax::settle::run::Run;
use crate::relax::stability::eigenvalues;
use crate::relax::stability::eigenvalues::{List, Lowest, deciding_grid, small_grid};
use crate::relax::transfer::level::Level;
use glam::DVec3;

/// What is known of the Morse index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// It is that counted on the finest grid.
    AsCounted,
    /// It is this, by eigenvalues extrapolated over the grids.
    Index(usize),
    /// An eigenvalue may have either sign; so many others are negative for certain.
    Undecided(usize),
    /// The eigenvalues that decide cannot be computed.
    Unknown,
}

/// The decision on a leaf.
pub struct Decision {
    pub verdict: Verdict,
    /// The requested modes, if they were computed for it.
    pub modes: Option<Lowest>,
    /// Whether stability was not clear without eigenvalues, or not on the grids before.
    pub needed: bool,
}

/// What to do on the grids so far.
enum Next {
    /// The count is certain.
    Nothing,
    /// A finer grid.
    Finer(Grid),
    /// Compute these eigenvalues.
    Compute(List),
    /// The matrix does not fit into memory.
    Impossible,
}

/// Decides, on further grids where necessary; `again` brings the leaf to rest on a grid whose
/// equilibrium is not near those of the grids before.
pub fn decide(
    run: &mut Run,
    end: &mut Result<bool, Stop>,
    again: &mut dyn FnMut(&mut Run, Grid) -> Result<bool, Stop>,
) -> Decision {
    let mut decision = Decision {
        verdict: Verdict::AsCounted,
        modes: None,
        needed: false,
    };
    let mut may_refine = true;
    while end.is_ok() {
        let next = next(run, may_refine);
        let list = match &next {
            Next::Nothing => break,
            Next::Finer(_) => None,
            Next::Compute(list) => Some(*list),
            Next::Impossible => {
                (decision.verdict, decision.needed) = (Verdict::Unknown, true);
                break;
            }
        };
        // More than one attempt: the leaf may be large.
        let list = list.map(|list| List {
            decides: list.decides || decision.needed,
            ..list
        });
        let lowest = list.and_then(|list| eigenvalues::lowest(run, list));
        decision.needed |= list.is_none_or(|list| list.decides);
        run.softening = lowest.as_ref().map_or(1.0, |found| found.softening);
        let inaccurate = end.is_ok_and(|reached| reached)
            && run.segments().is_none()
            && run.error().is_some_and(|error| error > run.tolerance);
        let finer = match (next, &lowest) {
            (Next::Finer(grid), _) => Some(grid),
            (_, Some(_)) if inaccurate && may_refine => run.finer(),
            (_, Some(found)) => found.undecided.and_then(|size| deciding_grid(run, size)),
            _ => decision.needed.then(|| small_grid(run)).flatten(),
        };
        let softening = std::mem::replace(&mut run.softening, 1.0);
        let moved = finer.is_some_and(|finer| go_on(run, end, finer, again));
        if moved {
            decision.needed = true;
            continue;
        }
        run.softening = softening;
        if inaccurate {
            *end = Ok(false);
        }
        let Some(list) = list else {
            // The grids so far have to do.
            may_refine = false;
            continue;
        };
        decision.verdict = match &lowest {
            None if decision.needed => Verdict::Unknown,
            None => Verdict::AsCounted,
            Some(found) => verdict(run, list, found),
        };
        let requested = list.above.is_none() && list.count == run.options.modes;
        decision.modes = lowest.filter(|_| requested);
        break;
    }
    decision
}

/// Comes to rest on a finer grid. The grids before found rest; without this one the sign remains
/// undecided.
fn go_on(
    run: &mut Run,
    end: &mut Result<bool, Stop>,
    finer: Grid,
    again: &mut dyn FnMut(&mut Run, Grid) -> Result<bool, Stop>,
) -> bool {
    let before = run.found();
    // A saddle of the finer grid may be none of the coarser, and what it leads to not near them.
    let further = run.continue_on(finer.clone()).or_else(|_| {
        run.restart();
        again(run, finer)
    });
    if further.is_err() {
        run.return_to(before);
        return false;
    }
    *end = further;
    true
}

/// What decides on the grids so far.
fn next(run: &mut Run, may_refine: bool) -> Next {
    let requested = List::requested(run);
    let Some(level) = run.levels.last() else {
        return Next::Nothing;
    };
    // A single grid allows no comparison; a dead moment has no potential.
    let comparable = run.segments().is_none() && level.leaf.tip_moment() == DVec3::ZERO;
    match run.index {
        Some(0) if comparable && !run.clearly_stable => Next::Compute(List {
            count: requested.count.max(1),
            decides: true,
            ..requested
        }),
        Some(1..) if comparable => beside_zero(run, may_refine),
        _ if requested.count == 0 => Next::Nothing,
        _ => Next::Compute(requested),
    }
}

/// What decides on a saddle: the counts of negative eigenvalues, or the few that are close to
/// zero.
fn beside_zero(run: &mut Run, may_refine: bool) -> Next {
    let Some(Level { leaf, state }) = run.levels.last() else {
        return Next::Nothing;
    };
    let mut system = System::new(leaf);
    let Some(bounds) = bounds(leaf, state, &mut system, &mut run.work) else {
        return Next::Impossible;
    };
    if bounds.least == bounds.finer && run.index == Some(bounds.least) {
        return Next::Nothing;
    }
    if may_refine
        && bounds.here < bounds.finer
        && let Some(finer) = small_grid(run)
    {
        return Next::Finer(finer);
    }
    let count = (bounds.finer - bounds.least).max(1);
    if count > MOST_MODES {
        return Next::Impossible;
    }
    Next::Compute(List {
        count,
        above: Some((bounds.least, -bounds.close)),
        decides: true,
        exact: false,
    })
}

/// What the signs of extrapolated eigenvalues tell.
fn verdict(run: &Run, list: List, found: &Lowest) -> Verdict {
    // On a fine grid rounding may have excused a negative eigenvalue as neutral, or hide what
    // coarser ones tell.
    let as_counted = found.undecided.is_none() && found.negative <= run.index;
    if as_counted && found.certainly_negative() <= run.index.unwrap_or(0) {
        return Verdict::AsCounted;
    }
    let (certain, negative) = match list.above {
        Some(_) => (found.certainly_negative(), found.negative),
        None => by_more_eigenvalues(run, list, found),
    };
    negative.map_or(Verdict::Undecided(certain), Verdict::Index)
}

/// How many eigenvalues are negative for certain, and how many are, if that is known: of the list
/// or, where its signs are not certain or all of them are negative, of a longer and exact one.
fn by_more_eigenvalues(run: &Run, list: List, found: &Lowest) -> (usize, Option<usize>) {
    let (mut certain, mut negative) = (found.certainly_negative(), found.negative);
    let mut list = List {
        decides: true,
        ..list
    };
    while list.count < MOST_MODES
        && (negative == Some(list.count) || negative.is_none() && !list.exact)
    {
        list.exact = true;
        list.count = (2 * list.count).min(MOST_MODES);
        let more = eigenvalues::lowest(run, list);
        negative = (more.as_ref()).and_then(|more| more.negative_beyond(certain));
        certain = certain.max(more.map_or(0, |more| more.certainly_negative()));
    }
    // There may be more than can be listed.
    (certain, negative.filter(|negative| *negative < list.count))
}
