//! Leaves with holders along their veins, followed while these move.

use leafdyn_testing::branch::follow;
use leafdyn_testing::*;

/// Three veins with tissue, held at the margins along a stretch: pulled across, as in a tensile
/// test.
const ACROSS: &str = r#"
    name = "across"
    leaf = { rods = 3, length = 1.0, fan = [0.0, 0.0, 0.0], joined = false, base = [[0.0, -0.2, 0.0], [0.0, 0.0, 0.0], [0.0, 0.2, 0.0]] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 2.0, axial = 200.0, shear_2 = 80.0, shear_3 = 80.0 }
    tissue = { along = 20.0, across = 40.0, normal = 30.0, fold = 0.5 }
    grip = [{ vein = 1, at = [0.25, 0.75], move = [0.0, -0.02, 0.02] }, { vein = 3, at = [0.25, 0.75], held = "clamped", move = [0.0, 0.0, 0.02] }]
"#;

/// Every point is the leaf that relaxes there, and its grips feel the same.
#[test]
fn points_are_the_leaves_that_relax_there() {
    let found = follow(ACROSS, "", "grip[1].move[1]=0..0.2", false);
    assert!(found.complete, "{:?}", found.branches[0].remarks);
    let key = "grip[1].move[1]".parse().unwrap();
    let points = &found.branches[0].points;
    assert!(points.len() > 4 && points.iter().all(|point| point.index == 0));
    for point in points.iter().step_by(3) {
        let scenario = base(ACROSS, "")
            .scenario_with_values(&[(&key, point.value)])
            .unwrap()
            .scenario;
        let leaf = settle(&scenario, 1e-9);
        let bar = point.error.unwrap() + leaf.accuracy.error_estimate.unwrap();
        for (ours, theirs) in point.tips.iter().zip(&leaf.tips) {
            assert!(ours.distance(*theirs) <= bar, "{}", point.value);
        }
        assert_eq!(point.grip_reactions.len(), 2);
        for (ours, theirs) in point.grip_reactions.iter().zip(&leaf.grip_reactions) {
            let off = ours.distance(theirs.force);
            assert!(
                off < 1e-6 * (1.0 + theirs.force.length()),
                "{}: {off:e}",
                point.value
            );
        }
    }
}
