//! The motion of a leaf: its mass, damping and duration, and loads that change in time.

use super::{Profile, Rod, Scale, Schedule, ascending};
use crate::words;

/// Radius of the section over the length of the longest rod: half of it, the radius of
/// gyration, is that of the relaxation.
const RADIUS: f64 = 0.2;
/// Frequency of the lowest mode of a clamped rod, in units of sqrt(A/(rho L^4)).
const LOWEST_FREQUENCY: f64 = 3.516;
/// Duration, in units of sqrt(rho L^4/A).
const DURATION: f64 = 10.0;
/// Outputs in that time.
pub(super) const OUTPUTS: f64 = 100.0;

words! {
    /// Where a motion begins, at time 0 and without velocity.
    pub enum Start {
        /// In the shape from which a relaxation starts: arcs that meet in the tip,
        /// or the rest shape of free rods.
        Released = "released",
        /// In the equilibrium under the loads and with the rest shape of time 0.
        AtRest = "at-rest",
    }
}

/// How a leaf moves. All quantities are in the units of the scenario, with
/// its unit of time. L is the longest rod, A the mean bending stiffness
/// ([`Scale`]), rho the mean of the densities mid-rod.
#[derive(Clone, Debug, PartialEq)]
pub struct Dynamics {
    /// Mass per unit reference length, one per rod; positive.
    pub density: Vec<Profile>,
    /// rho I, the moment of inertia per unit reference length about d2 and
    /// about d3, one per rod; positive.
    pub rotary_inertia: Vec<Profile>,
    /// Excess of the inertia about d1 over `rotary_inertia`, as a fraction of it: 1 if a
    /// section is given, as for every round one; 0 otherwise, where a vein turns with its
    /// strip of blade and has the same inertia about all axes, as in the relaxation
    /// ([`crate::relax`]).
    pub polar_excess: f64,
    /// Viscous force per unit reference length and velocity. Rotation is damped
    /// at the same rate: by this over the density times the angular momentum.
    pub external_damping: f64,
    /// Retardation time of the material (Kelvin-Voigt): the stress is the
    /// stiffness times the strain and times this time the strain rate.
    pub internal_damping: f64,
    /// How long the leaf is followed, a time.
    pub duration: f64,
    /// Time between two outputs; at most the duration.
    pub output_interval: f64,
    /// Whether the base is clamped; free only on a single rod.
    pub clamped: bool,
    /// Where the motion begins.
    pub start: Start,
    /// Gravity, force per unit reference length.
    pub gravity: Schedule<[f64; 3]>,
    /// Dead force on the joint tip, or on every tip when the tips are free.
    pub tip_force: Schedule<[f64; 3]>,
    /// Dead moment about the lab axes on the tip of a single rod.
    pub tip_moment: Schedule<[f64; 3]>,
    /// Factor of all rest curvatures.
    pub rest: Schedule<f64>,
}

impl Dynamics {
    /// The default for these rods, of which there is at least one, without loads: see
    /// [`Dynamics::with_loads`].
    ///
    /// ```
    /// use leafdyn::scenario::{Dynamics, Profile, Rod};
    ///
    /// let rod = Rod {
    ///     length: 2.0,
    ///     base: [0.0; 3],
    ///     angle: 0.0,
    ///     elevation: 0.0,
    ///     roll: 0.0,
    ///     couple_stiffness: [8.0; 3].map(Profile::Constant),
    ///     force_stiffness: [f64::INFINITY; 3].map(Profile::Constant),
    ///     rest_curvature: [0.0; 3].map(Profile::Constant),
    ///     rest_stretch: Profile::Constant(1.0),
    /// };
    /// let weight = [0.0, 0.0, -1.0];
    /// let dynamics = Dynamics::default_for(&[rod]).with_loads(weight, [0.0; 3], [0.0; 3]);
    /// assert!((dynamics.mean_density() - 0.5).abs() < 1e-15);
    /// assert_eq!(dynamics.duration, 10.0);
    /// assert_eq!(dynamics.gravity.at(3.0), weight);
    /// ```
    pub fn default_for(rods: &[Rod]) -> Self {
        let scale = Scale::of(rods);
        let density = scale.stiffness / scale.length.powi(4);
        Dynamics::of_density(rods, vec![Profile::Constant(density); rods.len()])
    }

    /// This motion under constant loads.
    pub fn with_loads(
        self,
        gravity: [f64; 3],
        tip_force: [f64; 3],
        tip_moment: [f64; 3],
    ) -> Dynamics {
        Dynamics {
            gravity: Schedule::constant(gravity),
            tip_force: Schedule::constant(tip_force),
            tip_moment: Schedule::constant(tip_moment),
            ..self
        }
    }

    /// rho: the mean of the mid-rod densities of the rods, mass per length.
    pub fn mean_density(&self) -> f64 {
        mean_of(&self.density)
    }

    /// The unit of time, sqrt(rho L^4/A), of these rods.
    pub fn natural_time(&self, rods: &[Rod]) -> f64 {
        time(Scale::of(rods), &self.density)
    }

    /// The external damping that is critical for the lowest mode of a clamped vein.
    pub fn critical_damping(&self, rods: &[Rod]) -> f64 {
        critical_damping(&self.density, self.natural_time(rods))
    }

    /// The default for rods of these densities.
    pub(super) fn of_density(rods: &[Rod], density: Vec<Profile>) -> Dynamics {
        let scale = Scale::of(rods);
        let time = time(scale, &density);
        let duration = DURATION * time;
        let radius = Profile::Constant(RADIUS * scale.length);
        let inertia = |density| round_inertia(density, &radius);
        Dynamics {
            rotary_inertia: density.iter().map(inertia).collect(),
            polar_excess: 0.0,
            external_damping: critical_damping(&density, time),
            density,
            internal_damping: 0.0,
            duration,
            output_interval: duration / OUTPUTS,
            clamped: true,
            start: Start::Released,
            gravity: Schedule::constant([0.0; 3]),
            tip_force: Schedule::constant([0.0; 3]),
            tip_moment: Schedule::constant([0.0; 3]),
            rest: Schedule::constant(1.0),
        }
    }
}

/// That is critical for the lowest mode of a clamped rod of the mean density.
fn critical_damping(density: &[Profile], time: f64) -> f64 {
    2.0 * LOWEST_FREQUENCY * mean_of(density) / time
}

/// Mean of the mid-rod values; exact if all are equal.
fn mean_of(profiles: &[Profile]) -> f64 {
    let counted = profiles.iter().zip(1..);
    counted.fold(0.0, |mean, (profile, count)| {
        mean + (profile.at(0.5) - mean) / f64::from(count)
    })
}

/// The unit of time sqrt(rho L^4/A); in this order nothing overflows.
pub(super) fn time(scale: Scale, density: &[Profile]) -> f64 {
    (mean_of(density) / (scale.stiffness / scale.length.powi(4))).sqrt()
}

/// Moment of inertia of a round section: rho I = density radius^2/4 at all knots of
/// both profiles, and linear between them. Where the radius varies the exact value is a
/// cubic, which lies below: more knots of the radius reduce the difference.
pub(super) fn round_inertia(density: &Profile, radius: &Profile) -> Profile {
    let at_fraction = |sigma: f64| density.at(sigma) * radius.at(sigma).powi(2) / 4.0;
    if let (Profile::Constant(_), Profile::Constant(_)) = (density, radius) {
        return Profile::Constant(at_fraction(0.0));
    }
    let at = ascending([&[0.0], density.kinks(), radius.kinks(), &[1.0]].concat());
    let value = at.iter().map(|&sigma| at_fraction(sigma)).collect();
    Profile::Linear { at, value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_in_the_natural_unit_by_default() {
        for (length, bending) in [(1.0, 1.0), (0.03, 7.1), (1e50, 1e-50), (1e-50, 1e50)] {
            let rods = [1.0, 0.5, 0.1].map(|part| Rod {
                length: part * length,
                base: [0.0; 3],
                angle: 0.0,
                elevation: 0.0,
                roll: 0.0,
                couple_stiffness: [0.1, bending, bending].map(Profile::Constant),
                force_stiffness: [f64::INFINITY; 3].map(Profile::Constant),
                rest_curvature: [0.0; 3].map(Profile::Constant),
                rest_stretch: Profile::Constant(1.0),
            });
            let dynamics = Dynamics::default_for(&rods);
            assert_eq!((dynamics.duration, dynamics.output_interval), (10.0, 0.1));
            let density = dynamics.mean_density();
            let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
            assert!(close(density, bending / length.powi(4)));
            assert!(close(dynamics.external_damping, 2.0 * 3.516 * density));
            let inertia = dynamics.rotary_inertia[2].at(0.5);
            assert!(close(inertia, 0.01 * density * length * length));
        }
    }

    #[test]
    fn the_mean_of_equal_densities_is_exact() {
        assert_eq!(mean_of(&vec![Profile::Constant(0.1); 7]), 0.1);
        let taper = Profile::Linear {
            at: vec![0.0, 1.0],
            value: vec![4.0, 2.0],
        };
        assert_eq!(mean_of(&[taper, Profile::Constant(1.0)]), 2.0);
    }
}
