//! A straight rod under an end moment M is an arc of the angle M L/EI, with no
//! force in it, whatever its stretch and shear stiffness (closed form).

mod common;

use std::f64::consts::PI;

use common::{TIGHT, close, set_stiffness, set_vector, solve};
use glam::DVec3;

#[test]
fn every_station_lies_on_the_arc() {
    for moment in [0.5, 1.5, PI, -2.0, 2.0 * PI, 4.0 * PI, 7.0 * PI] {
        for (axial, shear) in [(1000.0, 400.0), (f64::INFINITY, f64::INFINITY), (2.0, 1.0)] {
            let mut overrides = set_stiffness(axial, shear).to_vec();
            overrides.push(set_vector("load.tip_moment", DVec3::new(0.0, 0.0, moment)));
            let leaf = solve("classic/rollup", &overrides);
            let what = format!("M = {moment}, EA = {axial}");
            for (&sigma, node) in leaf.shape.stations.iter().zip(&leaf.shape.rods[0].nodes) {
                let angle = moment * sigma;
                let arc = DVec3::new(angle.sin(), 1.0 - angle.cos(), 0.0) / moment;
                let error = (node.position - arc).length();
                assert!(error <= 1e-11, "{what}: {error:.1e} at {sigma}");
                assert!(
                    error <= leaf.accuracy.error_estimate.unwrap(),
                    "{what}: {error:.1e}"
                );
                // The angles are exact on any grid, full turns included.
                let tangent = node.rotation * DVec3::X;
                let exact = DVec3::new(angle.cos(), angle.sin(), 0.0);
                assert!((tangent - exact).length() < 1e-12, "{what}");
                assert!(node.n.length() < 1e-11 * moment.abs(), "{what}: {}", node.n);
                assert!((node.m - moment * DVec3::Z).length() < TIGHT, "{what}");
                assert!((node.u - moment * DVec3::Z).length() < TIGHT, "{what}");
            }
            // Strain energy M^2 L/(2 EI) less the work M theta of the dead moment
            // would be the potential; without one, the energy is that of strain.
            close(&what, leaf.energy.unwrap(), 0.5 * moment * moment, 1e-10);
        }
    }
}

#[test]
fn a_full_circle_comes_back_to_the_clamp_turned_once() {
    let leaf = solve("classic/rollup", &[]);
    let tip = leaf.shape.rods[0].nodes.last().unwrap();
    assert!(tip.position.length() < 1e-11, "{}", tip.position);
    // Turned by 2 pi, its quaternion has gone to the other sheet.
    close("w", tip.rotation.w, -1.0, 1e-12);
    let middle = leaf.shape.rods[0].nodes[leaf.shape.stations.len() / 2].position;
    assert!((middle - DVec3::new(0.0, 1.0 / PI, 0.0)).length() < 1e-11);
}
