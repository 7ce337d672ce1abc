//! Following a boundary through the plane of two parameters, in both directions.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use super::manifold::{Manifold, Plane};
use super::singular_point::{Seed, SingularPoint};
use super::table::Verified;
use super::walk::{Walk, WalkOptions, lost};
use crate::branch::events::critical::Kind;
use crate::branch::walk::steps::End;
use crate::leaf::Grid;

/// A boundary, on both sides of its starting point.
#[derive(Clone, Debug)]
pub struct Boundary {
    /// The kind of its critical points along the first parameter, and how many modes are neutral.
    pub kind: Kind,
    pub neutral: usize,
    pub points: Vec<Verified>,
    /// How it ended at its first point and at its last.
    pub ends: [End; 2],
    /// Matrices factorised for it, without those of softened leaves.
    pub factorizations: usize,
}

/// Called for each point with the number of points so far and its parameters.
type Progress<'p> = dyn FnMut(usize, [f64; 2]) + Send + 'p;

/// Follows the boundary through a critical point of a branch in both directions, in parallel.
pub fn follow(
    plane: &Plane,
    grid: &Grid,
    seed: &Seed,
    how: &WalkOptions,
    progress: &mut Progress,
) -> Boundary {
    let mut boundary = Boundary {
        kind: seed.critical.kind,
        neutral: seed.critical.modes.len(),
        points: Vec::new(),
        ends: [End::MostPoints, End::MostPoints],
        factorizations: 0,
    };
    let mut manifold = Manifold::new(plane, grid.clone());
    let begun = SingularPoint::begin(&mut manifold, seed);
    boundary.factorizations += manifold.factorizations;
    let first = match begun {
        Ok(first) => first,
        Err(stuck) => {
            let end = lost(stuck);
            boundary.ends = [end.clone(), end];
            return boundary;
        }
    };
    let (closed, reported) = (AtomicBool::new(false), Mutex::new(([0; 2], progress)));
    let walk = |side: usize, first: SingularPoint| {
        let mut walk = Walk::new(plane, how, first, seed.given());
        let mut report = |points: usize, params| {
            let mut reported = reported.lock().unwrap_or_else(PoisonError::into_inner);
            reported.0[side] = points;
            let points = reported.0.iter().sum();
            reported.1(points, params);
        };
        // If one direction leads back to the start, the other is not needed.
        let cancelled = || side == 0 && closed.load(Ordering::Relaxed);
        let end = walk.run(grid.clone(), &cancelled, &mut report);
        closed.fetch_or(side == 1 && end == End::Closed, Ordering::Relaxed);
        (walk, end)
    };
    let ((forward, end), (backward, beginning)) =
        rayon::join(|| walk(1, first.clone()), || walk(0, first.turned()));
    boundary.factorizations += forward.factorizations;
    let is_closed = end == End::Closed;
    boundary.ends = [if is_closed { end.clone() } else { beginning }, end];
    boundary.points = forward.in_order();
    if is_closed {
        return boundary;
    }
    boundary.factorizations += backward.factorizations;
    // Both directions begin with the same point.
    let skip = usize::from(!boundary.points.is_empty());
    let before = backward.in_order().into_iter().skip(skip).rev();
    boundary.points.splice(..0, before);
    boundary
}
