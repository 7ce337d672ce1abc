//! Dead moments on points of a single rod while it moves.

use leafdyn::simulate;
use leafdyn_testing::motion::{BOTH, moving, run};
use leafdyn_testing::*;

/// A straight rod that is let go, damped, with two moments that bend it in one plane, one of them at
/// its tip.
const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 0.9, bending_2 = 1.2, bending_3 = 0.8, axial = 90.0, shear_2 = 60.0, shear_3 = 70.0 }
    dynamics = { density = 1.0, rotary_inertia = 0.01, external_damping = 4.0, duration = 16.0, start = "released" }
    load.tip_moment = [0.0, 0.0, -0.6]
    load.point = [{ vein = 1, at = 0.5, moment = [0.0, 0.0, 1.5] }]
"#;

/// It comes to the rest that relaxation finds.
#[test]
fn a_damped_motion_ends_where_relaxation_does() {
    let scenario = parse(ROD);
    let rest = settled(&scenario, &iterated(1e-12, 8));
    assert!(tip(&rest).y.abs() > 0.2);
    for scheme in BOTH {
        let options = simulate::Options {
            step: Some(2e-3),
            ..moving(scheme, Some(8))
        };
        let end = run(&scenario, &options).positions;
        for (found, node) in end.iter().zip(nodes(&rest.shape.rods)) {
            let off = found.distance(node.position);
            assert!(off < 1e-8, "{scheme:?}: {off:e}");
        }
    }
}
