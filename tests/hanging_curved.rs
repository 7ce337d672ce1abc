//! A naturally curved rod hangs in its plane until it is too heavy for that
//! (Miller and others, J. Mech. Phys. Solids 68, 2014).

mod common;

use common::branch::{changes_at, follow, text};
use common::*;

fn hanging(curvature: f64, weight: f64, stiffness: f64) -> Scenario {
    let stiffness = set_stiffness(stiffness, stiffness);
    let bent = format!("rest.bend_3={curvature:?}; load.gravity=[{weight:?}, 0, 0]");
    scenario("classic/hanging_curved", &format!("{stiffness}; {bent}"))
}

/// Gamma = w L^3/EI at which the planar state first loses its stability;
/// collocation on the linearised boundary-value problem.
#[test]
fn the_planar_state_loses_its_stability_where_the_boundary_value_problem_says() {
    for (curvature, wanted) in [(6.0, 11.868750740620), (2.0 * PI, 12.187078750000)] {
        let (low, high) = (0.97 * wanted, 1.03 * wanted);
        let found = critical_of_rigid(low, high, 16, |weight, segments, stiffness| {
            let leaf = settle_on(&hanging(curvature, weight, stiffness), segments, true);
            assert_eq!(tip(&leaf).z, 0.0, "it has left its plane");
            leaf.stability.negative_eigenvalues.unwrap() > 0
        });
        let what = format!("kL = {curvature}");
        close(&what, found / wanted, 1.0, NEUTRAL);

        let bent = format!("rest.bend_3={curvature:?}");
        let vary = format!("load.gravity[0]={:?}..{:?}", 1.3 * wanted, 0.8 * wanted);
        let found = follow(&text("classic/hanging_curved"), &bent, &vary, false);
        changes_at(&what, &found, &[(wanted, -1)], 1e-8);
    }
}

#[test]
fn below_it_the_rod_rests_in_its_plane_and_above_beside_it() {
    for (weight, planar) in [(11.0, true), (11.8, true), (12.0, false), (12.5, false)] {
        let leaf = settle(&hanging(6.0, weight, f64::INFINITY), 1e-8);
        assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
        let tip = tip(&leaf);
        assert_eq!(tip.z.abs() < 1e-8, planar, "{weight}: {tip}");
    }
}

/// Up to kL = 5 the planar state never loses it (to Gamma = 3 (kL)^3 + 50).
#[test]
fn a_less_curved_rod_stays_in_its_plane() {
    for curvature in [1.0, 3.0, 5.0_f64] {
        let most = 3.0 * curvature.powi(3) + 50.0;
        for part in [0.02, 0.1, 0.3, 0.6, 1.0] {
            let leaf = settle(&hanging(curvature, part * most, f64::INFINITY), 1e-8);
            assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
            assert!(leaf.stability.saddle.is_none(), "kL = {curvature}, {part}");
            assert!(tip(&leaf).z.abs() < 1e-8);
        }
    }
}
