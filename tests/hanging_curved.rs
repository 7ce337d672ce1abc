//! A naturally curved rod hangs in its plane until it is too heavy for that.

mod common;

use std::f64::consts::PI;

use common::{
    NEUTRAL, close, critical_of_rigid, scenario, set_stiffness, set_vector, settle, settle_on, tip,
};
use glam::DVec3;
use leafdyn::scenario::Scenario;

fn with_stiffness(curvature: f64, weight: f64, stiffness: f64) -> Scenario {
    let mut overrides = set_stiffness(stiffness, stiffness).to_vec();
    overrides.push(format!("rest.bend_3={curvature:?}"));
    overrides.push(set_vector("load.gravity", DVec3::new(weight, 0.0, 0.0)));
    scenario("classic/hanging_curved", &overrides)
}

fn hanging(curvature: f64, weight: f64) -> Scenario {
    with_stiffness(curvature, weight, f64::INFINITY)
}

/// Gamma = w L^3/EI at which the planar state first loses its stability;
/// collocation on the linearised boundary-value problem.
#[test]
fn the_planar_state_loses_its_stability_where_the_boundary_value_problem_says() {
    for (curvature, wanted) in [(6.0, 11.868750740620), (2.0 * PI, 12.187078750000)] {
        let found = critical_of_rigid(
            0.97 * wanted,
            1.03 * wanted,
            16,
            |weight, segments, stiffness| {
                let rod = with_stiffness(curvature, weight, stiffness);
                let leaf = settle_on(&rod, segments, true);
                assert_eq!(tip(&leaf).z, 0.0, "it has left its plane");
                leaf.stability.negative_eigenvalues.unwrap() > 0
            },
        );
        close(&format!("kL = {curvature}"), found / wanted, 1.0, NEUTRAL);
    }
}

#[test]
fn below_it_the_rod_rests_in_its_plane_and_above_beside_it() {
    for (weight, planar) in [(11.0, true), (11.8, true), (12.0, false), (12.5, false)] {
        let leaf = settle(&hanging(6.0, weight), 1e-8);
        assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
        assert_eq!(
            tip(&leaf).z.abs() < 1e-8,
            planar,
            "{weight}: {}",
            tip(&leaf)
        );
    }
}

/// Up to kL = 5 the planar state never loses it (to Gamma = 3 (kL)^3 + 50).
#[test]
fn a_less_curved_rod_stays_in_its_plane() {
    for curvature in [1.0, 3.0, 5.0_f64] {
        let most = 3.0 * curvature.powi(3) + 50.0;
        for part in [0.02, 0.1, 0.3, 0.6, 1.0] {
            let leaf = settle(&hanging(curvature, part * most), 1e-8);
            assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
            assert!(leaf.stability.saddle.is_none(), "kL = {curvature}, {part}");
            assert!(tip(&leaf).z.abs() < 1e-8);
        }
    }
}
