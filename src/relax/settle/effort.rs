//! What the way to rest has cost so far, and what it leaves for reuse.

use crate::leaf::System;
use crate::newton::Work;
use crate::relax::path::Stage;
use crate::relax::request::options::Progress;

/// Limit on nodes times force evaluations for a leaf to come to rest: some seconds.
pub const BUDGET: usize = 10_000_000;

/// Counts of the work on all grids, whatever becomes of them, and its progress.
pub struct Effort<'o> {
    pub progress: &'o mut dyn FnMut(&Progress),
    pub work: Work,
    /// Nodes times force evaluations so far.
    pub spent: usize,
    /// Nodes times force evaluations of all walks.
    pub walked: usize,
    /// How far the leaf came on its path before it failed.
    pub reached: Option<(Stage, f64)>,
    /// The linear system of the last grid, for reuse.
    pub spare_system: Option<System>,
}

impl<'o> Effort<'o> {
    /// None so far.
    pub fn new(progress: &'o mut dyn FnMut(&Progress)) -> Self {
        Effort {
            progress,
            work: Work::default(),
            spent: 0,
            walked: 0,
            reached: None,
            spare_system: None,
        }
    }
}
