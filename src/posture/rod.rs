//! The rod that hangs: its stiffness up to Young's modulus and its dead loads, along the fraction of its length.

use crate::scenario::{Profile, RodPlace};
use glam::DVec3;

/// A dead force on a point.
#[derive(Clone, Copy, Debug)]
pub struct PointForce {
    /// Fraction of the length.
    pub at: f64,
    /// The force.
    pub force: DVec3,
    /// Where it is off the axis, lengths along d2 and d3 of the section there.
    pub offset: [f64; 2],
}

impl PointForce {
    /// Whether it acts off the axis.
    pub fn is_off_axis(&self) -> bool {
        self.offset != [0.0; 2] && self.force != DVec3::ZERO
    }
}

/// A single rod with dead loads, clamped at its base and free at its tip.
#[derive(Clone, Debug)]
pub struct HangingRod {
    /// A1, A2, A3 at a Young's modulus of 1: moments of area, that of torsion times G/E.
    pub stiffness: [Profile; 3],
    /// Weight per length that is the same everywhere.
    pub weight: DVec3,
    /// The acceleration of gravity and the mass per length that it pulls, if any.
    pub mass: Option<(DVec3, Profile)>,
    /// Dead force per length, by components, if any.
    pub distributed: Option<[Profile; 3]>,
    /// Forces on points.
    pub points: Vec<PointForce>,
    /// Force on the tip.
    pub tip_force: DVec3,
}

impl HangingRod {
    /// Force per length at a place.
    pub fn load(&self, place: RodPlace) -> DVec3 {
        let mut load = self.weight;
        if let Some((g, mass)) = &self.mass {
            load += mass.at(place) * *g;
        }
        if let Some(distributed) = &self.distributed {
            load += DVec3::from_array(distributed.each_ref().map(|one| one.at(place)));
        }
        load
    }

    /// Whether any load acts.
    pub fn is_loaded(&self) -> bool {
        let distributed = self.distributed.iter().flatten();
        self.weight != DVec3::ZERO
            || self.tip_force != DVec3::ZERO
            || self.points.iter().any(|point| point.force != DVec3::ZERO)
            || distributed.map(Profile::max_abs).any(|most| most > 0.0)
            || self
                .mass
                .as_ref()
                .is_some_and(|(g, mass)| *g != DVec3::ZERO && mass.max_abs() > 0.0)
    }

    /// The sum of all loads on a rod of this length.
    pub fn total_load(&self, length: f64) -> DVec3 {
        let mut total = self.tip_force + length * self.weight;
        if let Some((g, mass)) = &self.mass {
            total += length * mass.integral(1.0) * *g;
        }
        if let Some(distributed) = &self.distributed {
            total +=
                length * DVec3::from_array(distributed.each_ref().map(|one| one.integral(1.0)));
        }
        total + self.points.iter().map(|point| point.force).sum::<DVec3>()
    }

    /// Whether it bends alike about all axes across it, so that the place of its directors does not matter.
    pub fn is_round(&self) -> bool {
        let [_, second, third] = &self.stiffness;
        second == third
            || [0.0, 0.25, 0.5, 0.75, 1.0]
                .iter()
                .chain(second.kinks())
                .all(|&sigma| {
                    RodPlace::both_sides(sigma).into_iter().all(|place| {
                        let [a, b] = [second, third].map(|profile| profile.at(place));
                        (a - b).abs() <= 1e-9 * a.max(b)
                    })
                })
    }

    /// Whether forces act off the axis, whose moments depend on how the section is turned.
    pub fn has_levers(&self) -> bool {
        self.points.iter().any(PointForce::is_off_axis)
    }

    /// Fractions inside (0, 1) where A^-1 m jumps: with the stiffness, or with the moment by a force off the axis.
    pub fn compliance_jumps(&self) -> Vec<f64> {
        let levers = self.points.iter().filter(|point| point.is_off_axis());
        let levers: Vec<f64> = levers.map(|point| point.at).collect();
        let is_jump = |at: &f64| {
            let stiffness_jumps = self.stiffness.iter().any(|profile| {
                let [before, behind] = RodPlace::both_sides(*at).map(|place| profile.at(place));
                (before - behind).abs() > 1e-9 * before.max(behind)
            });
            stiffness_jumps || levers.iter().any(|lever| (lever - at).abs() < 1e-9)
        };
        self.kinks().into_iter().filter(is_jump).collect()
    }

    /// Fractions inside (0, 1) where stiffness or loads have kinks or jumps.
    pub fn kinks(&self) -> Vec<f64> {
        let mass = self.mass.iter().map(|(_, mass)| mass);
        let profiles = self
            .stiffness
            .iter()
            .chain(mass)
            .chain(self.distributed.iter().flatten());
        let kinks =
            profiles.flat_map(|profile| profile.kinks().iter().chain(profile.seams()).copied());
        let points = self.points.iter().map(|point| point.at);
        let mut all: Vec<f64> = kinks.chain(points).collect();
        all.retain(|at| *at > 1e-9 && *at < 1.0 - 1e-9);
        all.sort_by(f64::total_cmp);
        all.dedup_by(|next, kept| *next - *kept < 1e-9);
        all
    }
}
