//! What leaves of a family have in common is made once for a grid: each is then, to the last bit, the leaf that is
//! made alone, and a branch through them leads through the leaves that relax there, also from the equilibrium on
//! the side to which the range pushes.

use std::sync::Arc;

use leafdyn::internals::branch::BranchEnd;
use leafdyn::internals::leaf::{DiscreteLeaf, Grid, Leaf};
use leafdyn::study::{Trace, trace};
use leafdyn_testing::branch::{request, text};
use leafdyn_testing::*;

const BLADE: &str = "measured/blade";

/// A leaf in the units of the leaf without overrides, so that all have the same.
fn leaf(name: &str, overrides: &str) -> Leaf {
    let scale = scenario(name, "").scale();
    Leaf::with_scale(Arc::new(scenario(name, overrides)), scale)
}

fn discrete(leaf: &Leaf) -> DiscreteLeaf {
    DiscreteLeaf::new(leaf, Grid::new(16, leaf.kinks()))
}

/// Everything that a leaf on its grid has, except its scenario.
fn content(of: &DiscreteLeaf) -> String {
    let all = format!("{of:?}");
    let (_, discrete) = all
        .split_once("grid: Grid")
        .expect("the grid follows the leaf");
    discrete.to_owned()
}

/// Blades whose rest shapes are alike, but for those of another width or elevation.
#[test]
fn rest_shapes_of_another_leaf_are_taken_over_where_they_are_the_same() {
    let first = discrete(&leaf(BLADE, ""));
    let mut taken = Vec::new();
    for (overrides, same) in [
        ("blade.young=1e5", true),
        ("blade.thickness=0.02", true),
        ("load.g=[0.0, 0.0, -300.0]", true),
        (
            "blade.width={ at=[0.0, 0.15, 0.4, 0.7, 1.0], value=[0.9, 1.4, 1.7, 1.0, 0.0] }",
            false,
        ),
        ("leaf.elevation=0.5", false),
    ] {
        let other = leaf(BLADE, overrides);
        let alone = DiscreteLeaf::new(&other, first.grid.clone());
        let with_shapes = first.with_same_rest_shapes(&other);
        assert!(content(&with_shapes) == content(&alone), "{overrides}");
        let curvatures = |of: &DiscreteLeaf| -> Vec<_> {
            of.sections.iter().map(|it| it.rest_curvature).collect()
        };
        taken.push(curvatures(&first) == curvatures(&alone));
        assert!(!same || taken[taken.len() - 1], "{overrides}");
    }
    // So that the comparison can fail.
    assert!(!taken[3], "the width changes the rest curvature");
}

/// Leaves whose veins are the same, with the same tissue and holders or with others.
#[test]
fn sections_and_tissue_of_another_leaf_are_taken_over_where_they_are_the_same() {
    let across = "measured/across";
    for (name, overrides, same_rods) in [
        (BLADE, "load.g=[0.0, 0.0, -300.0]", true),
        (BLADE, "load.tip_force=[0.0, 0.0, -1e-3]", true),
        (BLADE, "blade.young=1e5", false),
        (across, "tissue.across=20.0", true),
        (across, "tissue.fold=0.003", true),
        (across, "grip[0].at=[0.5, 1.0]", true),
        (across, "grip[1].move=[0.0, 0.1, 0.0]", true),
        (across, "section.young=2e4", false),
    ] {
        let (first, other) = (discrete(&leaf(name, "")), leaf(name, overrides));
        let alone = DiscreteLeaf::new(&other, first.grid.clone());
        match first.with_same_rods(&other) {
            Some(taken) => {
                assert!(
                    same_rods && content(&taken) == content(&alone),
                    "{overrides}"
                );
                assert!(content(&taken) != content(&first), "{overrides}");
            }
            None => assert!(!same_rods, "{overrides}"),
        }
    }
}

fn traced(name: &str, vary: &str, tolerance: f64) -> Trace {
    let mut request = request(base(&text(name), ""), vary, tolerance, 2000);
    request.keep_unstable = false;
    trace(&request, &mut |_, _, _| {}).unwrap()
}

/// Every third point is the leaf that relaxes there, within both bounds.
fn is_at_rest_along(found: &Trace, name: &str) {
    let branch = &found.branches[0];
    assert_eq!(
        branch.end,
        BranchEnd::RangeEndReached,
        "{:?}",
        branch.remarks
    );
    assert!(branch.points.len() > 4);
    for point in branch.points.iter().step_by(3) {
        let scenario = base(&text(name), "")
            .scenario_with_values(&[(&found.keys, point.value)])
            .unwrap()
            .scenario;
        let leaf = settle(&scenario, found.tolerance);
        let bar = point.error.unwrap() + leaf.accuracy.error_estimate.unwrap();
        let off = point.tips[0].distance(leaf.tips[0]);
        assert!(off <= bar, "{}: {off:e} beyond {bar:e}", point.value);
        assert_eq!(point.index, 0);
    }
}

#[test]
fn a_blade_is_followed_through_the_leaves_at_rest() {
    is_at_rest_along(&traced(BLADE, "blade.young=2.5e4..1e5", 1e-6), BLADE);
}

/// Without weight the grass twists as it leaves the plane in which it is made, and rises or sinks by chance. From above it would
/// snap down at 0.066 of its weight.
#[test]
fn a_leaf_begins_on_the_side_to_which_its_range_pushes() {
    for (vary, down) in [
        ("scale:load.gravity=0..2", true),
        ("scale:load.gravity=0..-0.05", false),
    ] {
        let found = traced("measured/grass", vary, 1e-6);
        let branch = &found.branches[0];
        assert_eq!(
            branch.end,
            BranchEnd::RangeEndReached,
            "{vary}: {:?}",
            branch.remarks
        );
        let z = branch.points[0].tips[0].z;
        // The equilibria without weight are mirror images.
        assert!(
            (z.abs() - 0.52845).abs() < 1e-4 && (z < 0.0) == down,
            "{vary}: {z}"
        );
        assert!(branch.points.iter().all(|point| point.index == 0), "{vary}");
    }
}
