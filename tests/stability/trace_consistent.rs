//! Along every branch of random leaves what must agree does: the energy changes
//! by the work of the load that varies, every change of the index is one of so
//! many modes, and at a fold the branch turns round.

use leafdyn::internals::branch::{
    BranchEquations, ContinuationOptions, CriticalKind, EquilibriumPoint, LeafFamily, follow_branch,
};
use leafdyn::internals::leaf::{DiscreteLeaf, Grid, State};
use leafdyn::internals::relax::state_from_rod_shapes;
use leafdyn_testing::random::{drawn, leaves};
use leafdyn_testing::*;

/// The leaf under loads turned over, from as they are to their opposite times
/// `MOST`: what was lifted is pressed down.
const MOST: f64 = -12.0;

fn loaded(leaf: &Scenario, part: f64) -> Scenario {
    let mut leaf = leaf.clone();
    leaf.gravity = leaf.gravity.map(|g| part * g);
    leaf.tip_force = leaf.tip_force.map(|f| part * f);
    leaf
}

fn begin(scenario: &Scenario, equations: &mut BranchEquations) -> Option<EquilibriumPoint> {
    let rest = relaxed(scenario, &to(1e-7));
    let leaf = Leaf::new(scenario);
    let grid = Grid::new(rest.shape.stations.len() - 1, leaf.kinks());
    let state = state_from_rod_shapes(&leaf, &DiscreteLeaf::new(&leaf, grid), &rest.shape.rods);
    let mut point = equations.correct(&state, 0.0, None).ok()?;
    point.tangent = point.tangent.towards_larger_parameter();
    Some(point)
}

/// Energy of a state under the loads at a fraction of their range.
fn energy(family: &LeafFamily, grid: &Grid, state: &State, fraction: f64) -> f64 {
    let mut equations = BranchEquations::new(family, grid.clone());
    let energy = (equations.leaves.leaf_at([fraction])).map(|leaf| leaf.energy(state));
    energy.unwrap()
}

#[test]
fn random_branches() {
    let (mut points, mut folds, mut crossings, mut missed, mut lost) = (0, 0, 0, 0, 0);
    for (case, scenario) in drawn(leaves(), 60).into_iter().enumerate() {
        let make = |[part]: [f64; 1]| Ok(loaded(&scenario, part));
        let family = LeafFamily::new(&make, [1.0, MOST], false).unwrap();
        let leaf = Leaf::new(&scenario);
        let grid = Grid::new(8.max(leaf.kinks().len() + 1), leaf.kinks());
        let mut equations = BranchEquations::new(&family, grid.clone());
        let Some(first) = begin(&scenario, &mut equations) else {
            lost += 1;
            continue;
        };
        let how = ContinuationOptions::new(0.02, 120);
        let branch = follow_branch(&mut equations, first, &how, &mut |_, _| {});
        points += branch.points.len();
        missed += branch.unlocated_index_changes.len();

        // By parts: the energy is stationary in the state, so that only the
        // load's own change remains.
        let rate = |point: &EquilibriumPoint| {
            let at = |step: f64| energy(&family, &grid, &point.state, point.fraction + step);
            (at(1e-4) - at(-1e-4)) / 2e-4
        };
        let (mut sum, mut scale) = (0.0, 0.0_f64);
        for pair in branch.points.windows(2) {
            let way = pair[1].fraction - pair[0].fraction;
            sum += 0.5 * way * (rate(&pair[0]) + rate(&pair[1]));
            scale = scale.max(rate(&pair[0]).abs() * way.abs());
        }
        let [start, end] = [&branch.points[0], branch.points.last().unwrap()]
            .map(|point| energy(&family, &grid, &point.state, point.fraction));
        let off = (end - start - sum).abs();
        let allowed = 0.02 * (1.0 + scale);
        assert!(off < allowed, "{case}: {off} of {}", end - start);

        for (after, critical) in &branch.critical {
            let (a, b) = (&branch.points[*after], &branch.points[after + 1]);
            let all = branch.critical.iter().filter(|(other, _)| other == after);
            let modes: usize = all.map(|(_, other)| other.modes.len()).sum();
            if !branch.unlocated_index_changes.contains(after) {
                assert_eq!(modes, a.index.abs_diff(b.index), "{case}");
            }
            match critical.kind {
                CriticalKind::Fold => folds += 1,
                CriticalKind::Branching => crossings += 1,
            }
        }
        // It turns round as often as there are folds.
        for (k, pair) in branch.points.windows(2).enumerate() {
            let turned = pair[0].tangent.params[0] * pair[1].tangent.params[0] < 0.0;
            let here = branch.critical.iter().filter(|(after, _)| *after == k);
            let found = here
                .filter(|(_, point)| point.kind == CriticalKind::Fold)
                .count();
            if !branch.unlocated_index_changes.contains(&k) {
                assert_eq!(found % 2 == 1, turned, "{case}: {found} folds at {k}");
            }
        }
    }
    println!("{points} points, {folds} folds, {crossings} crossings, {missed} missed, {lost} lost");
    assert!(folds >= 10 && points > 3000);
    assert!(10 * missed <= folds + crossings, "{missed}");
    assert!(lost <= 3, "{lost}");
}
