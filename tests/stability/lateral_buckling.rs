//! Just beyond the load at which a strip that is loaded in its stiff plane turns out of it, the
//! way to the new equilibrium is a curved valley that whole Newton steps leave.

use leafdyn_testing::*;

/// Strong bending stiffness, and the load / sqrt(EI GJ) of `tests/stability/bifurcations.rs`.
const CRITICAL: [(f64, f64); 4] = [
    (1000.0, 4.016676901240),
    (100.0, 4.054222577948),
    (20.0, 4.241802097099),
    (10.0, 4.536899035739),
];

/// Where shooting confirms it, the strip comes to rest out of its plane.
#[test]
fn strips_just_beyond_their_load_come_to_rest() {
    for (strong, ratio) in CRITICAL {
        for beyond in [1.0005, 1.001, 1.002, 1.003] {
            let load = -beyond * ratio * 0.8_f64.sqrt();
            let section = format!("stiffness.torsion=0.8; stiffness.bending_2={strong}");
            let strip = rod(&format!(
                "{RIGID}; {section}; load.tip_force=[0, 0, {load:?}]"
            ));
            let leaf = settle(&strip, 1e-6);
            let what = format!("{strong}, {beyond}: {:?}", leaf.remark);
            assert_eq!(leaf.stability.negative_eigenvalues, Some(0), "{what}");
            assert!(tip(&leaf).y.abs() > 0.01, "{what}");
            let shot = shot_near(&strip, &leaf);
            let off = apart(&strip, &leaf.shape.rods, &shot.rods).position;
            let told = estimate(&leaf) + shot.error.position;
            assert!(off <= told, "{what}: {off:e}, told {told:e}");
        }
    }
}
