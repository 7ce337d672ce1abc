//! A straight round rod is held in a helix by a force along the helix's axis
//! and a moment about it (Love 1927): closed form, position by position.
//!
//! With bending stiffness B, torsional stiffness C, curvature kappa, torsion
//! tau, angle alpha of the tangent out of the plane across the axis and twist
//! w3 of the material: F = (C w3 cos alpha - B kappa sin alpha)/a along the
//! axis and M = B kappa cos alpha + C w3 sin alpha about it.

mod common;

use common::{close, in_lab, parse, set_vector, settle};
use glam::DVec3;
use leafdyn::scenario::Scenario;

const BENDING: f64 = 1.0;
const TORSION: f64 = 0.8;
/// Radius of the helix, and alpha = 30 degrees.
const RADIUS: f64 = 0.2;
const SIN: f64 = 0.5;

/// A point of the helix that leaves the origin along e1 and curves towards e2,
/// and the foot of the perpendicular from the origin to its axis.
struct Helix {
    axis: DVec3,
    centre: DVec3,
    cos: f64,
}

impl Helix {
    fn new() -> Self {
        let cos = (1.0 - SIN * SIN).sqrt();
        Helix {
            // Tangent = cos * (around) + sin * axis.
            axis: DVec3::new(SIN, 0.0, cos),
            centre: DVec3::new(0.0, RADIUS, 0.0),
            cos,
        }
    }

    fn at(&self, s: f64) -> DVec3 {
        let angle = self.cos * s / RADIUS;
        let around = DVec3::new(self.cos, 0.0, -SIN);
        self.centre + RADIUS * (angle.sin() * around - angle.cos() * DVec3::Y) + SIN * s * self.axis
    }
}

fn rod(length: f64, force: DVec3, moment: DVec3) -> Scenario {
    let mut text = format!(
        r#"
        name = "helix"
        leaf = {{ rods = 1, length = {length:?}, fan = [0.0] }}
        stiffness = {{ torsion = {TORSION:?}, bending_2 = {BENDING:?}, bending_3 = {BENDING:?}, axial = inf, shear_2 = inf, shear_3 = inf }}
        "#
    );
    for (key, value) in [("tip_force", force), ("tip_moment", moment)] {
        text += &set_vector(&format!("load.{key}"), value);
        text.push('\n');
    }
    parse(&text)
}

#[test]
fn a_wrench_about_the_axis_holds_a_straight_rod_in_a_helix() {
    let helix = Helix::new();
    let curvature = helix.cos * helix.cos / RADIUS;
    let torsion = SIN * helix.cos / RADIUS;
    close("kappa", curvature, 3.75, 1e-14);
    close("tau", torsion, 2.165063509461097, 1e-14);
    // Twist of the material; force along and moment about the axis, as tabulated;
    // longest rod: beyond, other shapes are in reach under the same wrench.
    for (twist, force, moment, longest) in [
        (torsion, -1.875, 4.113620667976084, 1.0),
        (0.0, -9.375, 3.247595264191645, 0.6),
    ] {
        let formula = (TORSION * twist * helix.cos - BENDING * curvature * SIN) / RADIUS;
        close("F", formula, force, 1e-13);
        let formula = BENDING * curvature * helix.cos + TORSION * twist * SIN;
        close("M", formula, moment, 1e-13);
        for length in [0.3, 0.6, 1.0] {
            if length > longest {
                continue;
            }
            let tip = helix.at(length);
            // The wrench, moved from the axis to the tip.
            let force = force * helix.axis;
            let moment = moment * helix.axis + (helix.centre - tip).cross(force);
            let leaf = settle(&rod(length, force, moment), 1e-11);
            let what = format!("twist {twist}, length {length}");
            for (&sigma, node) in leaf.shape.stations.iter().zip(&leaf.shape.rods[0].nodes) {
                let exact = helix.at(sigma * length);
                let error = (node.position - exact).length();
                assert!(error < 2e-11, "{what}: {error:.1e} at {sigma}");
                let estimate = leaf.accuracy.error_estimate.unwrap();
                assert!(error <= estimate, "{what}: {error:.1e} > {estimate:.1e}");
                // The material twists as it must, and the bend is kappa.
                close(&what, node.u.x, twist, 1e-9);
                close(&what, node.u.y.hypot(node.u.z), curvature, 1e-9);
                assert!((in_lab(node).0 - force).length() < 1e-9, "{what}");
            }
        }
    }
}
