//! Leaves with tissue, bases apart and loads of single veins, by relaxation and by shooting, which
//! has formulas of its own for them.

use leafdyn_testing::*;

const LEAF: &str = r#"
    name = "tied"
    leaf = { rods = 3, length = [1.0, 0.8, 0.9], fan = [0.2, -0.1, -0.2], elevation = [0.3, 0.1, 0.0], joined = JOINED, base = [[0.0, 0.1, 0.0], [0.0, -0.1, 0.05], [0.0, -0.2, 0.0]] }
    stiffness = { torsion = 1.0, bending_2 = { at = [0.0, 1.0], value = [1.0, 0.5] }, bending_3 = 2.0, axial = 200.0, shear_2 = 80.0, shear_3 = 60.0 }
    rest = { bend_2 = 0.3, twist = { at = [0.0, 0.4, 1.0], value = [0.1, 0.6, 0.0] } }
    tissue = { along = [30.0, 10.0], across = 60.0, normal = 20.0, fold = 0.2 }
    dynamics = { density = { at = [0.0, 1.0], value = [0.3, 0.05] } }
    [load]
    g = [0.0, 0.0, -9.81]
    tip_force = [0.1, 0.0, 0.0]
    [[load.point]]
    vein = 2
    at = 0.6
    force = [0.1, 0.2, -0.4]
    [[load.point]]
    vein = 3
    at = 1.0
    force = [0.0, 0.2, 0.0]
"#;

#[test]
fn both_methods_find_leaves_with_tissue() {
    for joined in ["false", "true"] {
        let scenario = parse(&LEAF.replace("JOINED", joined));
        let leaf = settle(&scenario, TIGHT);
        let shot = shot_near(&scenario, &leaf);
        agree(joined, &scenario, &leaf, &shot, 1e-9);
        assert!(shot.defect < 1e-11, "{joined}: {:.1e}", shot.defect);
        // The linearised loads of the tissue are exact: one linearisation is enough near the solution.
        assert_eq!(shot.work.linearizations, 1, "{joined}");
    }
}
