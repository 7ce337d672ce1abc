//! A leaf let go at an equilibrium that is not stable does not stay there.

mod common;

use common::branch::{text, weightless};
use common::*;
use leafdyn::internals::branch::{Equations, Family};
use leafdyn::internals::leaf::{DiscreteLeaf, Grid, Leaf};
use leafdyn::internals::relax::{settle_from, start};
use leafdyn::relax::Limit;

/// The flat leaf of the study of undulation, far beyond its boundary, to rounding.
#[test]
fn a_leaf_falls_off_a_saddle_that_it_stands_on_exactly() {
    let base = base(&text("study/undulation"), &weightless(0.146, 1.59));
    let scenario = base.scenario();
    let make = |_| Ok(scenario.clone());
    let family = Family::new(&make, (0.0, 1.0), false).unwrap();
    let leaf = Leaf::new(scenario);
    let grid = Grid::new(32, leaf.kinks());
    let from = start(&DiscreteLeaf::new(&leaf, grid.clone()));
    let mut equations = Equations::new(&family, grid.clone()).unwrap();
    let flat = equations.correct(&from, 0.0, None).ok().unwrap();
    assert!(flat.index > 1, "{}", flat.index);
    assert!(flat.state.x.iter().all(|x| x.z.abs() < 1e-12));
    let rest = settle_from(&leaf, &grid, flat.state.clone(), &Limit::default()).unwrap();
    let rest = equations.correct(&rest, 0.0, None).ok().unwrap();
    assert_eq!(rest.index, 0);
    assert!(rest.state.shift_to(&flat.state) > 1e-2);
}
