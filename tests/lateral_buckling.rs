//! A cantilever strip that is loaded in its stiff plane turns out of it at the
//! critical load of the boundary-value problem, pre-buckling bend included; on
//! grids, and along the branch of equilibria.

mod common;

use common::branch::{changes_at, follow};
use common::*;

const TIP: &str = "load.tip_force";
const WEIGHT: &str = "load.gravity";

/// Torsional stiffness, strong bending stiffness; load / sqrt(EI GJ) at
/// which the planar state loses its stability. Collocation on the linearised
/// boundary-value problem.
const CRITICAL: [(&str, &str); 2] = [
    (
        TIP,
        "0.8  1000   4.016676901240
         0.8   100   4.054222577948
         0.8    20   4.241802097099
         0.8    10   4.536899035739",
    ),
    (
        WEIGHT,
        "0.8  1000  12.867244417440
         0.8   100  12.991462820326
         0.8    20  13.614407298823
         0.8    10  14.602497778784
         2.0   100  13.103177400101",
    ),
];

/// A strip along e1, bending stiffnesses 1 sideways and `strong` up and down.
fn section(torsion: f64, strong: f64) -> String {
    format!("stiffness.torsion={torsion}; stiffness.bending_2={strong}")
}

/// The strip of a section with `stiffness` in stretch and shear.
fn strip(section: &str, stiffness: f64, key: &str, load: f64) -> Scenario {
    let (stiffness, load) = (set_stiffness(stiffness, stiffness), -load);
    rod(&format!("{section}; {stiffness}; {key}=[0, 0, {load:?}]"))
}

#[test]
fn the_critical_loads_are_those_of_the_boundary_value_problem() {
    for (key, rows) in CRITICAL {
        for [torsion, strong, wanted] in table(rows) {
            let unit = torsion.sqrt();
            let section = section(torsion, strong);
            let (low, high) = (0.9 * wanted * unit, 1.1 * wanted * unit);
            let found = critical_of_rigid(low, high, 8, |load, segments, stiffness| {
                let strip = strip(&section, stiffness, key, load);
                let leaf = settle_on(&strip, segments, true);
                assert_eq!(tip(&leaf).y, 0.0, "it has left its plane");
                leaf.stability.negative_eigenvalues.unwrap() > 0
            });
            let what = format!("{key}, EI_strong = {strong}");
            close(&what, found / unit / wanted, 1.0, NEUTRAL);

            let vary = format!("{key}[2]=0..{:?}", -1.3 * wanted * unit);
            let found = follow(ROD, &format!("{section}; {RIGID}"), &vary, false);
            changes_at(&what, &found, &[(-wanted * unit, 1)], 1e-7);
        }
    }
}

/// Beyond it, the strip comes to rest out of its plane; below, in it.
#[test]
fn the_strip_leaves_its_plane_and_comes_to_rest_stable() {
    for (key, rows) in CRITICAL {
        for [torsion, strong, ratio] in table(rows) {
            for (part, planar) in [(0.98, true), (1.05, false)] {
                let load = part * ratio * torsion.sqrt();
                let strip = strip(&section(torsion, strong), f64::INFINITY, key, load);
                let leaf = settle(&strip, 1e-8);
                assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
                let tip = tip(&leaf);
                assert_eq!(tip.y.abs() < 1e-8, planar, "{part}, tip {tip}");
            }
        }
    }
}

/// Just beyond it the way to the new equilibrium is a curved valley that whole Newton steps
/// leave: where shooting confirms it, the strip comes to rest out of its plane.
#[test]
fn strips_just_beyond_their_load_come_to_rest() {
    let (key, rows) = CRITICAL[0];
    for [torsion, strong, ratio] in table(rows) {
        for beyond in [1.0005, 1.001, 1.002, 1.003] {
            let load = beyond * ratio * torsion.sqrt();
            let strip = strip(&section(torsion, strong), f64::INFINITY, key, load);
            let leaf = settle(&strip, 1e-6);
            let what = format!("{strong}, {beyond}: {:?}", leaf.remark);
            assert_eq!(leaf.stability.negative_eigenvalues, Some(0), "{what}");
            assert!(tip(&leaf).y.abs() > 0.01, "{what}");
            let shot = shot_near(&strip, &leaf);
            let off = apart(&strip, &leaf.shape.rods, &shot.rods).position;
            let told = estimate(&leaf) + shot.error.position;
            assert!(off <= told, "{what}: {off:e}");
        }
    }
}
