//! Leaves that can turn about the axis of their base without resistance: of round veins that are
//! clamped in line, loaded along this line and held on it, if at all.
//!
//! Where every vein turns about the axis by an angle and every section back about its own
//! tangent, no clamp, load or strain energy changes: a leaf that is bent has a circle of
//! equilibria, and no bifurcation.

use super::{Profile, Rod, Scenario};
use glam::{DQuat, DVec3};

/// Numbers that differ by less than this part are the same.
const ROUNDING: f64 = 1e-12;

/// Profiles are compared at so many equal distances, and at their kinks.
const COMPARED: usize = 16;

impl Scenario {
    /// The axis about which the whole leaf can turn without resistance, whatever its shape.
    pub fn turning_axis(&self) -> Option<DVec3> {
        let tangent = |rod: &Rod| DQuat::from_rotation_z(rod.angle) * DVec3::X;
        let axis = tangent(self.rods.first()?);
        let in_line = |direction: DVec3| direction.distance(axis) <= ROUNDING;
        let along = |load: [f64; 3]| {
            let load = DVec3::from_array(load);
            load.reject_from_normalized(axis).length() <= ROUNDING * load.length()
        };
        let held = self.held_tip.as_ref().is_none_or(|held| {
            let mut clamps = held.clamps.iter().flatten();
            along(held.position) && clamps.all(|clamp| in_line(clamp.rotation() * DVec3::X))
        });
        // A coupling differs from a multiple of the unit matrix along the axis alone, which is
        // in the e1-e2 plane.
        let coupling = self.coupling.iter().all(|&[x, y, z]| {
            let across = same(y, z) && (same(x, y) || in_line(DVec3::X));
            across || (axis.x.abs() <= ROUNDING && same(x, z))
        });
        let turns = self.rods.iter().all(|rod| in_line(tangent(rod)) && is_round(rod))
            && along(self.gravity)
            && along(self.tip_force)
            // A dead moment has no potential.
            && self.tip_moment == [0.0; 3]
            && held
            && coupling;
        turns.then_some(axis)
    }
}

/// A leaf whose points are all nearer to the axis than this part of its length is straight, and
/// does not move when it turns.
const ON_AXIS: f64 = 1e-6;

impl Scenario {
    /// Number of directions in which the leaf can move without resistance in the equilibrium
    /// through these points: one if it can turn and is bent. Each has an eigenvalue that is zero.
    pub fn neutral_directions(&self, points: impl IntoIterator<Item = DVec3>) -> usize {
        let near = ON_AXIS * super::longest(&self.rods);
        let bent = |axis: DVec3| {
            let mut points = points.into_iter();
            points.any(|point| point.reject_from_normalized(axis).length() > near)
        };
        usize::from(self.turning_axis().is_some_and(bent))
    }
}

fn same(a: f64, b: f64) -> bool {
    a == b || (a - b).abs() <= ROUNDING * a.abs().max(b.abs())
}

/// Whether sections have no preferred direction, and a vein at rest is straight.
fn is_round(rod: &Rod) -> bool {
    let alike = |a: &Profile, b: &Profile| {
        let even = (0..=COMPARED).map(|i| i as f64 / COMPARED as f64);
        let kinks = a.kinks().iter().chain(b.kinks()).copied();
        even.chain(kinks)
            .all(|sigma| same(a.at(sigma), b.at(sigma)))
    };
    let [_, bending_2, bending_3] = &rod.couple_stiffness;
    let [_, shear_2, shear_3] = &rod.force_stiffness;
    let curved = rod.rest_curvature[1..].iter().any(|of| of.max_abs() > 0.0);
    !curved && alike(bending_2, bending_3) && alike(shear_2, shear_3)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(change: &str) -> Option<DVec3> {
        let text = format!(
            r#"
            name = "round"
            leaf = {{ rods = 2, length = [1.0, 0.8], fan = [0.0, 0.0], joined = false }}
            coupling = {{ x = 1.0, y = 2.0, z = 2.0 }}
            load = {{ gravity = [-3.0, 0.0, 0.0] }}
            stiffness = {{ torsion = 0.7, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = 9.0, shear_3 = 9.0 }}
            {change}
            "#
        );
        Scenario::from_toml(&text).unwrap().turning_axis()
    }

    #[test]
    fn only_what_has_no_preferred_direction_turns() {
        assert_eq!(axis(""), Some(DVec3::X));
        assert_eq!(axis("[rest]\ntwist = 0.4"), Some(DVec3::X));
        assert_eq!(axis("[rest]\nbend_2 = 0.1"), None);
    }
}
