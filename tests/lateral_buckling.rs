//! A cantilever strip that is loaded in its stiff plane turns out of it at the
//! critical load of the boundary-value problem, pre-buckling bend included.

mod common;

use common::{NEUTRAL, close, critical_of_rigid, set_stiffness, set_vector, settle_on, tip};
use glam::DVec3;
use leafdyn::scenario::Scenario;

/// A strip along e1, bending stiffnesses 1 sideways and `strong` up and down,
/// `stiffness` in stretch and shear.
fn strip(strong: f64, torsion: f64, stiffness: f64, loads: [&str; 2], load: f64) -> Scenario {
    let text = r#"
        name = "strip"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
    "#;
    let [key, _] = loads;
    let mut overrides = set_stiffness(stiffness, stiffness).to_vec();
    overrides.push(format!("stiffness.torsion={torsion:?}"));
    overrides.push(format!("stiffness.bending_2={strong:?}"));
    overrides.push(set_vector(key, DVec3::new(0.0, 0.0, -load)));
    Scenario::from_toml_with(text, "strip", &overrides).unwrap()
}

const TIP: [&str; 2] = ["load.tip_force", "tip load"];
const WEIGHT: [&str; 2] = ["load.gravity", "weight"];

/// Load, torsional stiffness, strong bending stiffness; load / sqrt(EI GJ) at
/// which the planar state loses its stability. Collocation on the linearised
/// boundary-value problem.
const CRITICAL: [([&str; 2], f64, f64, f64); 9] = [
    (TIP, 0.8, 1000.0, 4.016676901240),
    (TIP, 0.8, 100.0, 4.054222577948),
    (TIP, 0.8, 20.0, 4.241802097099),
    (TIP, 0.8, 10.0, 4.536899035739),
    (WEIGHT, 0.8, 1000.0, 12.867244417440),
    (WEIGHT, 0.8, 100.0, 12.991462820326),
    (WEIGHT, 0.8, 20.0, 13.614407298823),
    (WEIGHT, 0.8, 10.0, 14.602497778784),
    (WEIGHT, 2.0, 100.0, 13.103177400101),
];

#[test]
fn the_critical_loads_are_those_of_the_boundary_value_problem() {
    for (loads, torsion, strong, wanted) in CRITICAL {
        let unit = torsion.sqrt();
        let (low, high) = (0.9 * wanted * unit, 1.1 * wanted * unit);
        let found = critical_of_rigid(low, high, 8, |load, segments, stiffness| {
            let strip = strip(strong, torsion, stiffness, loads, load);
            let leaf = settle_on(&strip, segments, true);
            assert_eq!(tip(&leaf).y, 0.0, "it has left its plane");
            leaf.stability.negative_eigenvalues.unwrap() > 0
        });
        let what = format!("{}, EI_strong = {strong}", loads[1]);
        close(&what, found / unit / wanted, 1.0, NEUTRAL);
    }
}

/// Beyond it, the strip comes to rest out of its plane; below, in it.
#[test]
fn the_strip_leaves_its_plane_and_comes_to_rest_stable() {
    for (loads, torsion, strong, ratio) in CRITICAL {
        for (part, planar) in [(0.98, true), (1.05, false)] {
            let load = part * ratio * torsion.sqrt();
            let leaf = common::settle(&strip(strong, torsion, f64::INFINITY, loads, load), 1e-8);
            assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
            assert_eq!(
                tip(&leaf).y.abs() < 1e-8,
                planar,
                "{part}, tip {}",
                tip(&leaf)
            );
        }
    }
}
