//! What was tried to bring a leaf to rest, what came of each attempt, and what that has cost so far.

use crate::leaf::EquationWorkspace;
use crate::newton::{EquilibriumFailure, SolverCounts};
use crate::relax::path::PathPosition;
use crate::relax::request::Progress;
use std::fmt;

/// How an attempt brings the leaf to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategy {
    /// Newton's method from arcs, through states of convex energy only.
    FirstValley,
    /// Slow loading along a path of equilibria, and rest from where it leads.
    SlowLoading,
    /// The method of the request from its start, wherever that leads.
    Release,
    /// The method of the request from its start, with the loads without a potential put on before the others.
    OtherLoadOrder,
    /// Newton's method from a shape that is given.
    GivenShape,
}

/// How much of a leaf is solved for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// All veins.
    Whole,
    /// One half of a leaf that is its own mirror image.
    Half,
}

/// An attempt that was made, and what came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attempt {
    /// How the leaf was to come to rest.
    pub strategy: Strategy,
    /// How much of the leaf it solved for.
    pub extent: Extent,
    /// Segments of the first grid of the attempt.
    pub segments: usize,
    /// How the attempt ended.
    pub end: AttemptEnd,
}

/// What came of an attempt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AttemptEnd {
    /// The equilibrium was accepted.
    Accepted,
    /// The equilibrium is not stable.
    Unstable,
    /// The equilibrium is so far from the arcs that slow loading may lead elsewhere.
    FarFromArcs,
    /// The veins may lose their stability while they are loaded.
    VeinsMayBuckle,
    /// The path of equilibria could not be followed to its end.
    PathLost,
    /// No grid kept the tolerance.
    Inaccurate,
    /// The leaf did not come to rest.
    Failed(EquilibriumFailure),
}

impl fmt::Display for Attempt {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let strategy = match self.strategy {
            Strategy::FirstValley => "Newton's method from arcs",
            Strategy::SlowLoading => "slow loading",
            Strategy::Release => "release",
            Strategy::OtherLoadOrder => "loads without a potential first",
            Strategy::GivenShape => "Newton's method from the given shape",
        };
        let extent = match self.extent {
            Extent::Whole => "the whole leaf",
            Extent::Half => "one half",
        };
        let end = match self.end {
            AttemptEnd::Accepted => "accepted",
            AttemptEnd::Unstable => "not stable",
            AttemptEnd::FarFromArcs => "slow loading may lead elsewhere",
            AttemptEnd::VeinsMayBuckle => "the veins may buckle while they are loaded",
            AttemptEnd::PathLost => "the path could not be followed",
            AttemptEnd::Inaccurate => "no grid keeps the tolerance",
            AttemptEnd::Failed(EquilibriumFailure::Saddle) => "the leaf leaves its valley",
            AttemptEnd::Failed(EquilibriumFailure::Unresolved) => {
                "the grid does not resolve the leaf"
            }
            AttemptEnd::Failed(EquilibriumFailure::StepLimit) => "not at rest within the limits",
            AttemptEnd::Failed(EquilibriumFailure::NoDescent) => "no step lowers the energy",
            AttemptEnd::Failed(EquilibriumFailure::Memory) => "the matrix needs too much memory",
        };
        write!(
            f,
            "{strategy} of {extent} on {} segments: {end}",
            self.segments
        )
    }
}

/// The work for a leaf on all grids, whatever becomes of them, with its progress and its memory.
pub(crate) struct WorkLog<'o> {
    /// Receives every step.
    pub progress: &'o mut dyn FnMut(&Progress),
    pub work: SolverCounts,
    /// Nodes times force evaluations of the relaxation so far.
    pub node_evaluations: usize,
    /// Nodes times force evaluations of slow loading on all grids.
    pub loading_node_evaluations: usize,
    /// How far the leaf came on its path before it failed.
    pub farthest_position: Option<PathPosition>,
    /// The part of the loads without a potential that the leaf bears after all others are put on, if they could not grow
    /// to their full size.
    pub borne_part: Option<f64>,
    /// The attempts to bring the leaf to rest.
    pub attempts: Vec<Attempt>,
    /// Memory that the equations of one grid leave to those of the next.
    pub workspace: EquationWorkspace,
}

impl<'o> WorkLog<'o> {
    /// The log of a leaf for which nothing was done so far.
    pub fn new(progress: &'o mut dyn FnMut(&Progress)) -> Self {
        WorkLog {
            progress,
            work: SolverCounts::default(),
            node_evaluations: 0,
            loading_node_evaluations: 0,
            farthest_position: None,
            borne_part: None,
            attempts: Vec::new(),
            workspace: EquationWorkspace::default(),
        }
    }

    /// Notes an attempt that was made, and how it ended.
    pub fn log(&mut self, strategy: Strategy, extent: Extent, segments: usize, end: AttemptEnd) {
        self.attempts.push(Attempt {
            strategy,
            extent,
            segments,
            end,
        });
    }
}
