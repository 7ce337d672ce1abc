//! Loads of the boundary-value problem that have no potential: forces and moments that turn with the section,
//! moments along veins, and the drag of a steady wind.
//!
//! With the spatial rotation theta of a section a force F that turns with it changes by theta x F. The drag per
//! length c |u_n| u_n, with c = rho C_D w/2, depends on the tangent t by the velocity u_n = U - (t . U) t of
//! the air normal to it.

use crate::rod::Wrench;
use crate::rotation::outer;
use crate::scenario::{PointLoad, Profile, RodPlace, Scenario};
use crate::shooting::rod_state::{LoadDerivatives, RodState, cross_matrix};
use glam::{DMat3, DQuat, DVec3};

/// The loads without a potential of a leaf, in units of force, and of force times length.
#[derive(Clone, Debug)]
pub struct FollowerLoads<'a> {
    scenario: &'a Scenario,
    length_unit: f64,
    force_unit: f64,
    /// Velocity of the air in the scenario's units, if there is wind.
    air: Option<DVec3>,
}

/// The drag on a rod per unit of sigma.
struct Drag {
    force: DVec3,
    /// Derivative of the force with respect to the slope r' of the centerline.
    by_slope: DMat3,
}

impl<'a> FollowerLoads<'a> {
    /// The loads of a scenario; `None` if all of its loads have a potential.
    pub fn new(scenario: &'a Scenario, length_unit: f64, force_unit: f64) -> Option<Self> {
        let wind = scenario.wind.as_ref();
        (scenario.has_followers() || wind.is_some()).then(|| FollowerLoads {
            scenario,
            length_unit,
            force_unit,
            air: wind.map(|wind| DVec3::from_array(wind.velocity.at(0.0))),
        })
    }

    /// Force and moment per unit of sigma on rod `j` of this dimensionless length, at a place where its
    /// centerline has the slope r'.
    pub fn along(&self, j: usize, length: f64, place: RodPlace, q: DQuat, slope: DVec3) -> Wrench {
        let (force, couple) = self.densities(j, length, place);
        let drag = self.drag(j, length, place, slope);
        Wrench {
            force: q * force + drag.map_or(DVec3::ZERO, |drag| drag.force),
            moment: match self.scenario.couple_follows {
                true => q * couple,
                false => couple,
            },
        }
    }

    /// The force along the directors, and the moment along these or the lab axes, per unit of sigma.
    fn densities(&self, j: usize, length: f64, place: RodPlace) -> (DVec3, DVec3) {
        let at = |loads: &Option<Vec<[Profile; 3]>>| {
            loads.as_ref().map_or(DVec3::ZERO, |all| {
                DVec3::from_array(all[j].each_ref().map(|load| load.at(place)))
            })
        };
        let force = at(&self.scenario.follower) * (length * self.length_unit / self.force_unit);
        (
            force,
            at(&self.scenario.couple) * (length / self.force_unit),
        )
    }

    fn drag(&self, j: usize, length: f64, place: RodPlace, slope: DVec3) -> Option<Drag> {
        let (air, wind) = (self.air?, self.scenario.wind.as_ref()?);
        let pressed = 0.5 * wind.density * wind.drag * wind.width[j].at(place);
        let factor = pressed * (length * self.length_unit / self.force_unit);
        let tangent = slope.normalize_or_zero();
        let along = tangent.dot(air);
        let normal = air - along * tangent;
        let speed = normal.length();
        let direction = normal.normalize_or_zero();
        let across = DMat3::IDENTITY - outer(tangent, tangent);
        let by_velocity = speed * (across + outer(direction, direction));
        let by_tangent = by_velocity * along + speed * outer(tangent, normal);
        Some(Drag {
            force: factor * speed * normal,
            by_slope: by_tangent * (-factor / slope.length().max(f64::MIN_POSITIVE)),
        })
    }

    /// Derivatives of n' and m' by these loads, from those of the slope r' of the centerline with respect to the
    /// rotation and to n.
    pub fn derivatives(
        &self,
        j: usize,
        length: f64,
        place: RodPlace,
        q: DQuat,
        (slope, [slope_theta, slope_n]): (DVec3, [DMat3; 2]),
    ) -> LoadDerivatives {
        let (force, couple) = self.densities(j, length, place);
        let mut derivatives = LoadDerivatives {
            n_theta: cross_matrix(q * force),
            n_n: DMat3::ZERO,
            m_theta: match self.scenario.couple_follows {
                true => cross_matrix(q * couple),
                false => DMat3::ZERO,
            },
        };
        if let Some(drag) = self.drag(j, length, place, slope) {
            derivatives.n_theta -= drag.by_slope * slope_theta;
            derivatives.n_n -= drag.by_slope * slope_n;
        }
        derivatives
    }

    /// What a load on a point that turns with the section exerts on it, times a factor.
    pub fn on_point(&self, point: &PointLoad, rod: &RodState, factor: f64) -> Wrench {
        let unit = factor / self.force_unit;
        let force = DVec3::from_array(point.force);
        let mut moment = DVec3::from_array(point.moment);
        if point.is_off_axis() {
            moment += point.arm().cross(force);
        }
        Wrench {
            force: unit * (rod.q * force),
            moment: unit / self.length_unit * (rod.q * moment),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDY: &str = r#"
        name = "rod"
        leaf = { rods = 1, length = 1.3, fan = [0.3] }
        stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = 60.0, shear_2 = 70.0, shear_3 = 50.0 }
        wind = { velocity = [0.5, 0.8, 1.0], density = 1.2, drag = 2.0, width = 0.2 }
    "#;

    /// Central differences of the drag by the slope.
    #[test]
    fn the_drag_has_its_derivative_by_the_slope() {
        let scenario = Scenario::from_toml(WINDY).unwrap();
        let loads = FollowerLoads::new(&scenario, 1.3, 0.7).unwrap();
        let slope = DVec3::new(0.9, -0.4, 0.3);
        let drag = |slope: DVec3| loads.drag(0, 1.0, 0.5.into(), slope).unwrap();
        let h = 1e-5;
        for axis in DVec3::AXES {
            let change = drag(slope + h * axis).force - drag(slope - h * axis).force;
            let off = change / (2.0 * h) - drag(slope).by_slope * axis;
            assert!(off.length() < 1e-9, "{off}");
        }
    }
}
