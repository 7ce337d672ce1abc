//! Following a boundary through the plane of two numbers, both ways.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use super::halt::Halt;
use super::place::{Place, Seed};
use super::plane::Plane;
use super::search::Lost;
use super::sheet::Sheet;
use super::table::Verified;
use super::walk::{Stride, Walk};
use crate::branch::critical::Kind;
use crate::leaf::Grid;

/// A boundary on both sides of where it began.
#[derive(Clone, Debug)]
pub struct Boundary {
    /// What becomes of the branch along the first number, and in how many directions.
    pub kind: Kind,
    pub neutral: usize,
    /// Its points, verified.
    pub points: Vec<Verified>,
    /// How it ended, at its first point and at its last.
    pub ends: [Halt; 2],
    /// Matrices factorised for it, but for those of softened leaves.
    pub factorizations: usize,
}

/// Told of each point: how many there are, and where.
type Progress<'p> = dyn FnMut(usize, [f64; 2]) + Send + 'p;

/// Follows the boundary on which a critical point of a branch lies both ways, side by side.
pub fn follow(
    plane: Plane,
    grid: &Grid,
    seed: &Seed,
    how: &Stride,
    progress: &mut Progress,
) -> Boundary {
    let mut boundary = Boundary {
        kind: seed.critical.kind,
        neutral: seed.critical.modes.len(),
        points: Vec::new(),
        ends: [Halt::Stuck; 2],
        factorizations: 0,
    };
    let begun = Sheet::new(plane, grid.clone()).map_err(Lost::from);
    let begun = begun.and_then(|mut sheet| {
        let begun = Place::begin(&mut sheet, seed);
        boundary.factorizations += sheet.equations.factorizations;
        begun
    });
    let first = match begun {
        Ok(first) => first,
        Err(lost) => {
            boundary.ends = [Halt::from(lost); 2];
            return boundary;
        }
    };
    let (closed, told) = (AtomicBool::new(false), Mutex::new(([0; 2], progress)));
    let walk = |side: usize, way: Place| {
        let mut walk = Walk::new(plane, how, way, seed.given());
        let mut tell = |points: usize, place| {
            let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
            told.0[side] = points;
            let points = told.0.iter().sum();
            told.1(points, place);
        };
        // Where one way leads back to the start, the other one need not be gone.
        let needless = || side == 0 && closed.load(Ordering::Relaxed);
        let end = walk.run(grid.clone(), &needless, &mut tell);
        closed.fetch_or(side == 1 && end == Halt::Closed, Ordering::Relaxed);
        (walk, end)
    };
    let ((ahead, end), (behind, beginning)) =
        rayon::join(|| walk(1, first.clone()), || walk(0, first.turned()));
    boundary.factorizations += ahead.factorizations;
    boundary.ends = [beginning, end];
    boundary.points = ahead.in_order();
    if end == Halt::Closed {
        boundary.ends[0] = end;
        return boundary;
    }
    boundary.factorizations += behind.factorizations;
    // The first point is that of the other way.
    let skip = usize::from(!boundary.points.is_empty());
    let before = behind.in_order().into_iter().skip(skip).rev();
    boundary.points.splice(..0, before);
    boundary
}
