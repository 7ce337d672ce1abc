//! The plan of a relaxation: which attempts are made to bring a leaf to rest, in which order, by which
//! rule each is accepted.
//!
//! The equilibrium that is asked for is that of slow loading ([`Path`](crate::relax::path::Path)), or
//! that of a release from arcs. The first is often known without loading the leaf slowly: where
//! Newton's method leads from arcs to rest through convex states only, nearby, and the veins take their
//! loads stably, slow loading leads there too. Half of a symmetric leaf stands for the whole as long as
//! that is stable.

use crate::relax::log::{Extent, Strategy};
use crate::relax::problem::{COARSEST, RelaxationProblem};
use crate::relax::request::Method;
use crate::relax::solve_on_grid::softens;

/// By which rule the equilibrium of an attempt is accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Acceptance {
    /// Slow loading leads there: it is stable and near the arcs, and the veins take their loads stably.
    EndOfLoading,
    /// It is stable.
    Stable,
    /// It is at rest.
    AtRest,
}

/// An attempt that is planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlannedAttempt {
    pub strategy: Strategy,
    pub extent: Extent,
    /// Segments of its first grid.
    pub segments: usize,
    pub acceptance: Acceptance,
    /// Whether it is made only before the time limit.
    pub needs_time: bool,
}

/// The attempts for a leaf whose first grid has `segments` segments, in their order: each is made if
/// none before was accepted.
pub fn plan(problem: &RelaxationProblem, has_half: bool, segments: usize) -> Vec<PlannedAttempt> {
    let extent = match has_half {
        true => Extent::Half,
        false => Extent::Whole,
    };
    let first_valley = PlannedAttempt {
        strategy: Strategy::FirstValley,
        extent,
        segments,
        acceptance: Acceptance::EndOfLoading,
        needs_time: false,
    };
    let loading = PlannedAttempt {
        strategy: Strategy::SlowLoading,
        acceptance: Acceptance::AtRest,
        ..first_valley
    };
    let release = PlannedAttempt {
        strategy: Strategy::Release,
        extent: Extent::Whole,
        ..loading
    };
    if problem.loads_slowly() {
        // A stiff leaf is softened on its way from arcs: that may lead elsewhere.
        let convex =
            matches!(problem.options.method, Method::SemiImplicit(_)) && !softens(problem.leaf);
        let from_arcs = PlannedAttempt {
            segments: problem.segments().unwrap_or(COARSEST),
            needs_time: true,
            ..release
        };
        let mut attempts = vec![loading, from_arcs];
        if convex {
            attempts.insert(0, first_valley);
        }
        return attempts;
    }
    let mut attempts = vec![release];
    if has_half {
        attempts.insert(
            0,
            PlannedAttempt {
                extent,
                acceptance: Acceptance::Stable,
                ..release
            },
        );
    }
    if problem.may_be_loaded_instead() {
        attempts.push(PlannedAttempt {
            extent: Extent::Whole,
            needs_time: true,
            ..loading
        });
    }
    attempts
}
