//! Derivatives of a rod at rest by dead moments on it, and while they act.

use crate::sensitivities::{derivatives, differenced, keys, of, results};
use leafdyn_testing::*;

/// Dead moments on points of a single rod: by their components, and by all else while they act.
#[test]
fn moments_on_points_are_numbers_like_others() {
    for (tip, more) in [
        (
            "",
            "load.tip_moment[1] load.tip_force[1] load.point[2].moment[1]",
        ),
        (
            "tip = { held = \"clamped\", position = [0.8, 0.02, -0.1], angles = 0.2, twist = 0.3 }",
            "tip.position[0] tip.twist",
        ),
        (
            "grip = [{ vein = 1, at = [0.75, 1.0], held = \"clamped\", move = [-0.1, 0.05, 0.1] }]",
            "grip[0].move[2]",
        ),
    ] {
        let text = format!(
            r#"
            name = "rod"
            {tip}
            leaf = {{ rods = 1, length = 1.0, fan = [0.3] }}
            stiffness = {{ torsion = 0.7, bending_2 = 1.0, bending_3 = 1.6, axial = 60.0, shear_2 = 40.0, shear_3 = 80.0 }}
            rest = {{ twist = 0.3, bend_2 = -0.4, bend_3 = 0.5 }}
            [load]
            gravity = [0.3, 0.0, -0.7]
            [[load.point]]
            vein = 1
            at = 0.25
            moment = [0.3, -0.2, 0.4]
            [[load.point]]
            vein = 1
            at = 0.5
            force = [0.1, 0.3, -0.2]
            moment = [0.0, 0.0, 0.5]
            [[load.point]]
            vein = 1
            at = 1e-13
            moment = [0.0, 0.1, 0.5]
            "#
        );
        let wanted = format!(
            "load.point[0].moment[0] load.point[0].moment[1] load.point[0].moment[2] \
             load.point[1].moment[0] load.point[1].moment[2] load.point[1].force[2] leaf.length \
             stiffness.torsion stiffness.axial leaf.fan[0] load.gravity[2] {more}"
        );
        let wanted: Vec<&str> = wanted.split_whitespace().collect();
        let base = base(&text, "");
        let options = with_modes(0, iterated(1e-9, 12));
        let (leaf, found) = derivatives(&base, &wanted, &options);
        assert_eq!(found.len(), wanted.len());
        let units = results(&leaf).0;
        for (key, found) in keys(&wanted).iter().zip(&found) {
            let (ours, theirs) = (of(found), differenced(&base, key, &options));
            assert_eq!(ours.len(), theirs.len(), "{key}");
            for (k, (ours, (theirs, unsure))) in ours.iter().zip(&theirs).enumerate() {
                let off = (ours - theirs).abs() - 4.0 * unsure;
                let error = off / (units[k].abs().max(1.0) + theirs.abs());
                assert!(error < 1e-7, "{tip}, {key}, result {k}: {ours} {theirs}");
            }
        }
    }
}
