//! A straight round rod is held in a helix by a force along the helix's axis
//! and a moment about it (Love 1927): closed form, position by position; by
//! relaxation and by shooting.
//!
//! With bending stiffness B, torsional stiffness C, curvature kappa, torsion
//! tau, angle alpha of the tangent out of the plane across the axis and twist
//! w3 of the material: F = (C w3 cos alpha - B kappa sin alpha)/a along the
//! axis and M = B kappa cos alpha + C w3 sin alpha about it.

use leafdyn_testing::*;

const BENDING: f64 = 1.0;
const TORSION: f64 = 0.8;
/// Radius of the helix, and alpha = 30 degrees.
const RADIUS: f64 = 0.2;
const SIN: f64 = 0.5;

#[test]
fn a_wrench_about_the_axis_holds_a_straight_rod_in_a_helix() {
    let cos = (1.0 - SIN * SIN).sqrt();
    // It leaves the origin along e1 and curves towards e2. Tangent = cos * around + SIN * axis;
    // the foot of the perpendicular from the origin to the axis.
    let (axis, around) = (DVec3::new(SIN, 0.0, cos), DVec3::new(cos, 0.0, -SIN));
    let centre = RADIUS * DVec3::Y;
    let helix = |s: f64| {
        let (sin_s, cos_s) = (cos * s / RADIUS).sin_cos();
        centre + RADIUS * (sin_s * around - cos_s * DVec3::Y) + SIN * s * axis
    };
    let curvature = cos * cos / RADIUS;
    let torsion = SIN * cos / RADIUS;
    close("kappa", curvature, 3.75, 1e-14);
    close("tau", torsion, 2.165063509461097, 1e-14);
    // Twist of the material; force along and moment about the axis, as tabulated;
    // longest rod: beyond, other shapes are in reach under the same wrench.
    for (twist, force, moment, lengths) in [
        (torsion, -1.875, 4.113620667976084, &[0.3, 0.6, 1.0][..]),
        (0.0, -9.375, 3.247595264191645, &[0.3, 0.6]),
    ] {
        let formula = (TORSION * twist * cos - BENDING * curvature * SIN) / RADIUS;
        close("F", formula, force, 1e-13);
        let formula = BENDING * curvature * cos + TORSION * twist * SIN;
        close("M", formula, moment, 1e-13);
        for &length in lengths {
            // The wrench, moved from the axis to the tip.
            let force = force * axis;
            let moment = moment * axis + (centre - helix(length)).cross(force);
            let [pulled, turned] = [force, moment].map(|load| load.to_array());
            let loads = format!("load.tip_force={pulled:?}; load.tip_moment={turned:?}");
            let stiffness = format!("{RIGID}; stiffness.torsion={TORSION}");
            let long = format!("leaf.length={length:?}; {stiffness}");
            let leaf = Both::of(&rod(&format!("{long}; {loads}")));
            let what = format!("twist {twist}, length {length}");
            let estimate = estimate(&leaf.relaxed);
            for (rods, estimate) in leaf.shapes().into_iter().zip([estimate, f64::INFINITY]) {
                for (&sigma, node) in leaf.relaxed.shape.stations.iter().zip(&rods[0].nodes) {
                    let error = (node.position - helix(sigma * length)).length();
                    assert!(error < 2e-11, "{what}: {error:.1e} at {sigma}");
                    assert!(error <= estimate, "{what}: {error:.1e} > {estimate:.1e}");
                    // The material twists as it must, and the bend is kappa.
                    close(&what, node.u.x, twist, 1e-9);
                    close(&what, node.u.y.hypot(node.u.z), curvature, 1e-9);
                    assert!((in_lab(node).0 - force).length() < 1e-10, "{what}");
                }
            }
        }
    }
}
