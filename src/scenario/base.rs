//! Where and how veins begin, and where along them nodes must be.

use glam::{DQuat, DVec3};

use super::{Profile, Rod, Scenario, Tissue, ascending};

/// Places that differ by less are the same: no segment may be so short.
const ROUNDING: f64 = 1e-12;

impl Rod {
    /// The rotation of the directors at the base: by the fan's angle about e3, after the elevation
    /// about -e2, so that d1 = (cos e cos phi, cos e sin phi, sin e), after the roll about e1.
    pub fn base_rotation(&self) -> DQuat {
        let mut rotation = DQuat::from_rotation_z(self.angle);
        if self.elevation != 0.0 {
            rotation *= DQuat::from_rotation_y(-self.elevation);
        }
        if self.roll != 0.0 {
            rotation *= DQuat::from_rotation_x(self.roll);
        }
        rotation
    }

    /// Where it begins.
    pub fn base_position(&self) -> DVec3 {
        DVec3::from_array(self.base)
    }
}

impl Scenario {
    /// Where vein `j` begins, and the rotation of its directors there.
    pub fn base(&self, j: usize) -> (DVec3, DQuat) {
        let rod = &self.rods[j];
        (rod.base_position(), rod.base_rotation())
    }

    /// Fractions inside (0, 1) where a grid must have a node: kinks of stiffnesses, rest shapes,
    /// loads and the wind's width, points that are loaded, and the ends of what is gripped;
    /// ascending, each once, and none within rounding of another or of an end: what is there is at
    /// the nearest node.
    pub fn kinks(&self) -> Vec<f64> {
        let masses = (0..self.rods.len()).filter_map(|vein| self.weight(vein).of_mass);
        let profiles = self.rods.iter().flat_map(Rod::profiles);
        let profiles = profiles
            .chain(masses.map(|(_, mass)| mass))
            .chain(self.tissue.iter().flatten().flat_map(Tissue::profiles))
            .chain(self.distributed.iter().flatten().flatten())
            .chain(self.wind.iter().flat_map(|wind| &wind.width));
        let points = self.points.iter().map(|point| point.at);
        let ends = self.grips.iter().flat_map(|grip| grip.at);
        let inside = points.chain(ends);
        let all = profiles.flat_map(Profile::kinks).copied().chain(inside);
        let mut kinks = ascending(all.filter(|&at| at > ROUNDING && at < 1.0 - ROUNDING));
        kinks.dedup_by(|next, kept| *next - *kept <= ROUNDING);
        kinks
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn rod(angle: f64, elevation: f64) -> Rod {
        Rod {
            length: 1.0,
            base: [0.1, -0.2, 0.3],
            angle,
            elevation,
            roll: 0.0,
            couple_stiffness: [1.0; 3].map(Profile::Constant),
            force_stiffness: [1.0; 3].map(Profile::Constant),
            rest_curvature: [0.0; 3].map(Profile::Constant),
            rest_stretch: Profile::Constant(1.0),
        }
    }

    /// d2 stays in the plane of the fan, d3 leans back.
    #[test]
    fn a_vein_rises_from_the_plane_of_the_fan() {
        for (angle, elevation) in [(0.0, 0.0), (0.7, 0.4), (-2.0, -1.1), (0.3, FRAC_PI_2)] {
            let rod = rod(angle, elevation);
            let turn = rod.base_rotation();
            let ((sin, cos), (up, flat)) = (angle.sin_cos(), elevation.sin_cos());
            let directors = [
                DVec3::new(flat * cos, flat * sin, up),
                DVec3::new(-sin, cos, 0.0),
                DVec3::new(-up * cos, -up * sin, flat),
            ];
            for (axis, director) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().zip(directors) {
                assert!(
                    (turn * axis).distance(director) < 1e-15,
                    "{angle} {elevation}"
                );
            }
        }
        // Leaves that lie flat are what they always were, to the last bit.
        assert_eq!(rod(0.7, 0.0).base_rotation(), DQuat::from_rotation_z(0.7));
        assert_eq!(rod(0.7, 0.0).base_position(), DVec3::new(0.1, -0.2, 0.3));
    }
}
