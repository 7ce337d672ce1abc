//! Where a branch begins: at the equilibrium that a relaxation found.

use super::equations::Stuck;
use super::family::Family;
use super::follow::Grids;
use super::{Point, prolonged};
use crate::leaf::{DiscreteLeaf, Grid};
use crate::relax::{Equilibrium, project};

/// The finest grid on which the first point is sought.
const FINEST: usize = 512;

/// The first point of a branch with its grid: the equilibrium `rest` at the fraction
/// 0, on a grid of so many segments or more, or on one twice as fine as the coarsest
/// of the relaxation or finer on which the index is that of the finest.
///
/// # Errors
/// If Newton's method finds it on no grid, what it says on the finest.
pub fn begin<'a>(
    family: &'a Family<'a>,
    rest: &Equilibrium,
    segments: Option<usize>,
) -> Result<(Grids<'a>, Point), Stuck> {
    let leaf = family.first();
    let mut grid = Grid::new(rest.shape.stations.len() - 1, leaf.kinks());
    let mut discrete = DiscreteLeaf::new(leaf, grid.clone());
    let mut state = project(leaf, &discrete, &rest.shape.rods);
    let least = segments.unwrap_or(2 * grid.segments());
    let mut found = Err(Stuck::NotConverged);
    loop {
        if grid.segments() >= least {
            let mut grids = Grids::new(family, grid.clone())?;
            match grids.of(&state).correct(&state, 0.0, None) {
                Ok((point, _)) => {
                    let same = Some(point.index) == rest.stability.negative_eigenvalues;
                    found = Ok((grids, point));
                    if same || segments.is_some() {
                        return found;
                    }
                }
                Err(stuck) if found.is_err() => found = Err(stuck),
                Err(_) => {}
            }
            if grid.segments() >= FINEST {
                return found;
            }
        }
        state = prolonged(&discrete, &state);
        grid = grid.refined();
        discrete = DiscreteLeaf::new(leaf, grid.clone());
    }
}
