//! `trace` over two parameters: the boundary of stability as curves in their plane.

mod compare;
mod known;
mod map;
mod result;
mod run;

pub use result::{Boundary, BoundaryCurve, BoundaryMap, BoundaryPoint, LeafBeside};
pub use run::boundary;

use super::trace::{TraceError, TraceRequest};
use super::vary::Vary;
use crate::refusal::RefusedOption;

/// Largest number of curves of a boundary.
pub const MOST_CURVES: usize = 24;

/// A request for a boundary.
#[derive(Clone, Debug)]
pub struct BoundaryRequest {
    /// The trace along the first parameter whose critical points are followed; it is made
    /// at the scenario's value of the second parameter or, if that is not within the range, at
    /// its start.
    pub trace: TraceRequest,
    /// The second parameter and its range; no step is longer than the distance of its values.
    pub across: Vary,
    /// Cells of a coarse map under the curves, along both parameters, if requested.
    pub map: Option<[usize; 2]>,
}

impl BoundaryRequest {
    /// Validates the request before it is run.
    fn check(&self) -> Result<(), TraceError> {
        self.trace.check()?;
        let second = TraceRequest {
            vary: self.across.clone(),
            ..self.trace.clone()
        };
        second.check()?;
        let (first, second) = (&self.trace.vary.keys, &self.across.keys);
        let shared = first
            .targets()
            .iter()
            .find(|it| second.targets().contains(it));
        if let Some(target) = shared {
            let why = format!("{target}: varies twice; give two numbers that differ");
            return Err(TraceError::Vary(why));
        }
        let possible = |cells: &usize| (1..=map::MOST_CELLS).contains(cells);
        if let Some([columns, rows]) = self.map.filter(|map| !map.iter().all(possible)) {
            let most = map::MOST_CELLS;
            let why = format!("give from 1 to {most} cells along each number, as 16x16");
            return Err(RefusedOption::new("map", format!("{columns}x{rows}"), why).into());
        }
        Ok(())
    }
}
