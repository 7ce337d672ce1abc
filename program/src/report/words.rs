//! Phrases about results that figures and the command line share.

use leafdyn::relax::{Equilibrium, Method, Outcome};
use leafdyn::study::{BranchEnd as End, Stuck};
use leafdyn::study::{Contender, MapShow, Verdict};

/// How the run ended and what was found, in one phrase.
pub fn verdict(equilibrium: &Equilibrium) -> String {
    match equilibrium.outcome {
        Outcome::Converged => at_rest(equilibrium),
        Outcome::ConvergedAfterSaddle => {
            let saddle = equilibrium.stability.saddle.as_ref();
            let index = saddle.map(|saddle| format!(" of index {}", saddle.negative_eigenvalues));
            let left = format!(", after leaving a saddle{}", index.unwrap_or_default());
            at_rest(equilibrium) + &left
        }
        Outcome::Saddle => at_rest(equilibrium),
        Outcome::ToleranceNotReached => {
            format!("{}, tolerance not reached", at_rest(equilibrium))
        }
        Outcome::NotAtRest if equilibrium.method.is_shooting() => "no equilibrium".into(),
        Outcome::NotAtRest => "not at rest".into(),
        Outcome::Singular => "singular equations".into(),
        Outcome::Diverged => "diverged".into(),
    }
}

fn at_rest(equilibrium: &Equilibrium) -> String {
    equilibrium_of_index(equilibrium.stability.negative_eigenvalues)
}

/// The title of what a map shows.
pub fn map_shows(show: MapShow) -> &'static str {
    match show {
        MapShow::Outcomes => "where methods fail",
        MapShow::Waves => "waves along the margins",
    }
}

/// The kind of equilibrium with this number of negative eigenvalues.
pub fn equilibrium_of_index(negative_eigenvalues: Option<usize>) -> String {
    match negative_eigenvalues {
        Some(0) => "stable equilibrium".into(),
        Some(index) => format!("unstable equilibrium of index {index}"),
        None => "equilibrium of unknown stability".into(),
    }
}

/// The same in a word or two, of a known index.
pub fn stable_or_index(index: usize) -> String {
    match index {
        0 => "stable".into(),
        index => format!("index {index}"),
    }
}

pub fn shooting(intervals: usize) -> String {
    match intervals {
        1 => "single shooting".into(),
        count => format!("multiple shooting over {count} intervals"),
    }
}

/// The verdict of a check, in one phrase.
pub fn headline(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::Agree => "both methods agree",
        Verdict::Differ => "the methods differ",
        Verdict::NotCompared(_) => "could not be compared",
        Verdict::NotIndependent(_) => "not confirmed by an independent solution",
    }
}

/// The name of a contender in a chart.
pub fn contender(contender: Contender) -> &'static str {
    match (contender.method, contender.one_grid) {
        (Method::SemiImplicit(_), false) => "semi-implicit, extrapolated",
        (Method::SemiImplicit(_), true) => "semi-implicit, single grids",
        (Method::Explicit { .. }, false) => "explicit, extrapolated",
        (Method::Explicit { .. }, true) => "explicit, single grids",
        (Method::SingleShooting, _) => "single shooting",
        (Method::Shooting { .. }, _) => "multiple shooting",
        (Method::ShootingFromRest { .. }, _) => "shooting from the relaxed leaf",
    }
}

/// How a branch ended, in a phrase.
pub fn branch_end(end: &End) -> &'static str {
    match end {
        End::Reached => "to the end of the range",
        End::Returned => "back to the start of the range",
        End::Closed => "closed",
        End::Met => "met",
        End::MostPoints | End::Enough => "goes on",
        End::Unstable => "ends: loses its stability",
        End::Stopped | End::Stuck(Stuck::Stopped) => "goes on: stopped",
        End::Stuck(Stuck::OutOfRange(_)) => "ends where no leaf is",
        End::Stuck(Stuck::Unresolved) => "ends: grid too coarse",
        End::Stuck(_) => "lost",
        End::Unverified(_) => "ends: not verified further",
    }
}
