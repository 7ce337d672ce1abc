//! Veins that can turn without resistance: directions of zero energy.
//!
//! Round veins that are clamped in line, loaded along this line and held on it, if at all, turn about
//! the axis of their base. Where every vein of a group that is tied together, or a single vein, turns
//! about the axis by an angle and every section back about its own tangent, no clamp, load or strain
//! energy changes: a bent group has a circle of equilibria, and no bifurcation. Groups with tissue, and
//! axes that do not go through the origin, are left out.
//!
//! On hinges a vein that is straight or round spins: every section turns about its own tangent,
//! whatever its loads, as nothing but tissue or a clamp holds its sections. And a group of veins
//! turns as a rigid body about the line through all points where it is held, if it is loaded along
//! this line, whatever its sections. Hinges that hold the spin (`leaf.base_spin`) allow what clamps do: the turn about
//! their natural direction with the sections back about their own tangents; and round veins that no tissue ties turn on
//! them about any axis about which they would turn as a rigid body, each with a spin that depends on its shape. Rollers and foundations that hold along one axis alone let veins turn
//! about this axis.

#[cfg(test)]
mod tests;

use crate::rotation::{HeldSpin, Pose, angle_about};
use crate::scenario::checked::Scenario;
use crate::scenario::profile::{Profile, RodPlace, knot_places};
use crate::scenario::supports::{BaseSupport, Grip, SupportKind};
use crate::scenario::veins::{Rod, Tissue, longest};
use glam::{BVec3, DQuat, DVec3};
use std::ops::Range;

/// What counts as the same, or as straight, where veins turn.
struct TurnTolerances {
    /// Tangents whose parts across an axis are smaller tell no direction about it.
    tangent: f64,
    /// Relative difference below which numbers are equal.
    equality: f64,
    /// A vein that is not round spins without resistance only where it is straight. Where it is bent
    /// by more than this part of what else counts as near, its stiffer side rolls over.
    straightness: f64,
    /// Veins whose points are all nearer to the axis than this part of the leaf's length do not move
    /// when they turn.
    axis_distance: f64,
    /// Profiles are compared at so many equal distances, and at their kinks.
    profile_steps: usize,
}

const TOLERANCES: TurnTolerances = TurnTolerances {
    tangent: 1e-8,
    equality: 1e-12,
    straightness: 1e-3,
    axis_distance: 1e-6,
    profile_steps: 16,
};

/// Neighbouring veins that can turn together without resistance, whatever their shape: at unit rate
/// all turn about the axis, and every section at `section_rate` about its own tangent.
#[derive(Clone, Debug, PartialEq)]
pub struct ZeroEnergyRotation {
    /// The numbers of the veins.
    pub rods: Range<usize>,
    /// A point of the axis.
    pub point: DVec3,
    /// The direction of the axis, or zero for a vein that only spins.
    pub axis: DVec3,
    /// Rate of the turn of sections about their own tangents: -1, 0 or 1.
    pub section_rate: f64,
    /// Whether the veins turn so also where they are bent.
    pub includes_bent_veins: bool,
    /// Of veins whose bases are on hinges that hold their spin: the hinges, by which the rate of the sections of each vein
    /// depends on its shape; empty of others.
    pub joints: Vec<HeldSpin>,
}

/// Moments about a line about which nothing holds a group of veins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnbalancedMoment {
    /// The line, for messages.
    pub line: &'static str,
    /// The sum of the moments about the line.
    pub moment: f64,
}

/// The rotations of the directors at the base of a vein.
pub struct BaseRotations {
    /// In the natural leaf.
    pub stress_free: DQuat,
    /// In the equilibrium.
    pub now: DQuat,
}

impl ZeroEnergyRotation {
    /// The angle by which a leaf turns to the one of its circle of equilibria that stands for all:
    /// clamped veins until their `moment` on the bases bends them down (towards -e3); on hinges until
    /// the veins begin as near as possible to where they do in the natural leaf, or down; what spins
    /// until it has no twist from there.
    pub fn angle_to_representative(&self, begin: &[BaseRotations], moment: Option<DVec3>) -> f64 {
        let axis = self.axis;
        if let (
            true,
            [
                BaseRotations {
                    stress_free: natural,
                    now,
                },
            ],
        ) = (axis == DVec3::ZERO, begin)
        {
            let from_natural = natural.conjugate() * *now;
            return -2.0 * from_natural.x.atan2(from_natural.w);
        }
        // Down, or for a vertical axis e1, normal to the axis.
        let down = match axis.z.abs() > 0.99 {
            true => DVec3::X,
            false => -DVec3::Z,
        };
        if let Some(moment) = moment {
            return angle_about(axis, moment, axis.cross(down));
        }
        // The angle with the least sum of squared distances of the tangents.
        let across = |q: DQuat| (q * DVec3::X).reject_from_normalized(axis);
        let (mut sin, mut cos, mut sum) = (0.0, 0.0, DVec3::ZERO);
        for [natural, now] in begin.iter().map(|it| [it.stress_free, it.now].map(across)) {
            sin += axis.dot(now.cross(natural));
            cos += now.dot(natural);
            sum += now;
        }
        match (
            f64::hypot(sin, cos) > TOLERANCES.tangent,
            sum.length() > TOLERANCES.tangent,
        ) {
            (true, _) => sin.atan2(cos),
            (false, true) => angle_about(axis, sum, down.reject_from_normalized(axis)),
            (false, false) => 0.0,
        }
    }

    /// Whether anything moves when veins through these points turn: some point farther than `near` from
    /// the axis through `point`. Of a vein that spins the sections move if the vein is round or nearly
    /// straight.
    pub fn moves_something(&self, points: &[DVec3], point: DVec3, near: f64) -> bool {
        let off = |from: DVec3, axis: DVec3, near: f64| {
            let mut points = points.iter();
            points.any(|at| (*at - from).reject_from_normalized(axis).length() > near)
        };
        match (self.axis == DVec3::ZERO, points) {
            (false, _) => off(point, self.axis, near),
            (true, [base, .., tip]) => {
                let chord = (*tip - *base).normalize_or(DVec3::X);
                self.includes_bent_veins || !off(*base, chord, TOLERANCES.straightness * near)
            }
            (true, _) => self.includes_bent_veins,
        }
    }

    /// The rotations by this angle about the axis and, from the right, of sections about their own
    /// tangents, of vein `rod` of the leaf that begins with the rotation `base`.
    pub fn rotations(&self, angle: f64, rod: usize, base: DQuat) -> [DQuat; 2] {
        let turn = match self.axis == DVec3::ZERO {
            true => DQuat::IDENTITY,
            false => DQuat::from_axis_angle(self.axis, angle),
        };
        let back = match self.joint_of(rod) {
            None => DQuat::from_rotation_x(self.section_rate * angle),
            Some(joint) => (turn * base).conjugate() * joint.settled(turn * base),
        };
        [turn, back]
    }

    /// The hinge of a vein, if it holds the spin.
    fn joint_of(&self, rod: usize) -> Option<HeldSpin> {
        self.joints.get(rod - self.rods.start).copied()
    }

    /// At unit rate about the axis, the rate of the sections of a vein that begins with the rotation `base`: where a hinge
    /// holds the spin, the base then does not turn about the axis of the hinge.
    fn section_rate_of(&self, rod: usize, base: DQuat) -> f64 {
        self.joint_of(rod).map_or(self.section_rate, |joint| {
            let held = joint.axis(base);
            -self.axis.dot(held) / (base * DVec3::X).dot(held)
        })
    }

    /// The angular velocity and the velocity, at unit rate, of a node of vein `rod`, which begins with the rotation `base`,
    /// at this pose, whose unit of length is `length`.
    pub fn node_velocity(&self, node: Pose, rod: usize, base: DQuat, length: f64) -> [DVec3; 2] {
        let (x, d1) = (node.position, node.rotation * DVec3::X);
        let spin = self.axis + self.section_rate_of(rod, base) * d1;
        [spin, self.axis.cross(x - self.point / length)]
    }
}

impl Scenario {
    /// The groups of veins that can turn without resistance: in wind only those that spin, and none
    /// under loads that turn with the sections.
    pub fn zero_energy_rotations(&self) -> Vec<ZeroEnergyRotation> {
        let mut rotations = Vec::new();
        if self.has_followers() {
            return rotations;
        }
        for rods in self.tied_groups() {
            let windy = self.wind.is_some();
            let between_clamps = self.axis_between_clamps(rods.clone()).filter(|_| !windy);
            let as_on_clamps = between_clamps.is_some();
            rotations.extend(between_clamps.map(|axis| ZeroEnergyRotation {
                rods: rods.clone(),
                point: DVec3::ZERO,
                axis,
                section_rate: -1.0,
                includes_bent_veins: true,
                joints: Vec::new(),
            }));
            // Rigid turns before spins: to lean, a vein spins back from where it has turned to as a whole.
            let rigid = self.rigid_rotation(&rods).filter(|_| !windy);
            let rigid = rigid.filter(|it| it.joints.is_empty() || !as_on_clamps);
            rotations.extend(rigid);
            rotations.extend(
                rods.filter(|j| self.spins(*j))
                    .map(|j| self.spin_rotation(j)),
            );
        }
        rotations
    }

    /// Whether the base of a vein turns freely.
    fn is_pinned(&self, vein: usize) -> bool {
        self.base_held[vein] == BaseSupport::Pinned
    }

    /// Whether the base of a vein turns freely, and about its own tangent, too.
    fn base_spins(&self, vein: usize) -> bool {
        self.is_pinned(vein) && !self.holds_base_spin(vein)
    }

    /// Whether every section of a vein is on a hinge and can turn about its own tangent, provided that the
    /// vein is round or straight.
    fn spins(&self, vein: usize) -> bool {
        let gaps = [vein.checked_sub(1), Some(vein)].into_iter().flatten();
        let tissue = |gap| (self.tissue.iter()).any(|all| all.get(gap).is_some_and(has_some));
        let clamps = |grip: &Grip| grip.vein == vein && grip.held == SupportKind::Clamped;
        let tip = self.held_tip.as_ref();
        self.base_spins(vein)
            && tip.is_none_or(|held| held.clamps.is_none())
            && !gaps.clone().any(tissue)
            && !self.grips.iter().any(clamps)
            && !self.has_moments_on(&(vein..vein + 1))
            && !self.has_levers_on(&(vein..vein + 1))
    }

    /// The first vein that may spin on its hinge and on which moments act that turn with its sections, or along it, if
    /// there is one: nothing need balance them.
    pub fn vein_driven_to_spin(&self) -> Option<usize> {
        let on_points = |vein: usize| {
            let mut points = self.points.iter();
            points.any(|it| it.vein == vein && it.follows && it.moment != [0.0; 3])
        };
        (0..self.rods.len())
            .find(|vein| (self.couple.is_some() || on_points(*vein)) && self.spins(*vein))
    }

    fn spin_rotation(&self, vein: usize) -> ZeroEnergyRotation {
        ZeroEnergyRotation {
            rods: vein..vein + 1,
            point: DVec3::ZERO,
            axis: DVec3::ZERO,
            section_rate: 1.0,
            includes_bent_veins: is_round(&self.rods[vein]),
            joints: Vec::new(),
        }
    }

    /// The turn of a group of tied veins on hinges as a rigid body, about the line through the points
    /// where it is held or, if there is only one, along its loads.
    fn rigid_rotation(&self, group: &Range<usize>) -> Option<ZeroEnergyRotation> {
        let apart = self.support_offsets(group)?;
        let axis = self.axis_between_hinges(group, &apart)?;
        let spins = group.clone().all(|vein| self.base_spins(vein));
        // Where the spin of bases is held, veins spin as they turn, which only round ones do that no tissue ties.
        let bases = &self.rods[group.clone()];
        let turns_on_joints = || {
            bases.iter().all(is_round) && !self.has_levers_on(group) && !self.has_tissue_in(group)
        };
        let joint = |rod: &Rod| HeldSpin {
            natural: rod.base_rotation(),
        };
        let turns = !self.has_moments_on(group) && (spins || turns_on_joints());
        turns.then(|| ZeroEnergyRotation {
            rods: group.clone(),
            point: self.rods[group.start].base_position(),
            axis,
            section_rate: 0.0,
            includes_bent_veins: true,
            joints: match spins {
                true => Vec::new(),
                false => bases.iter().map(joint).collect(),
            },
        })
    }

    /// The axis about which a group of tied veins on hinges, which is held in places that are so far
    /// `apart`, can turn as a rigid body while its forces do no work.
    fn axis_between_hinges(&self, group: &Range<usize>, apart: &[DVec3]) -> Option<DVec3> {
        let near = TOLERANCES.equality * longest(&self.rods);
        let on_line = |axis: DVec3| {
            let mut apart = apart.iter();
            apart.all(|it| it.reject_from_normalized(axis).length() <= near)
        };
        let loads = self.group_loads(group);
        let axis = self.support_line(group, apart)?;
        let rollers = self.roller_axis(group).ok()?;
        let turns = on_line(axis)
            && rollers.is_none_or(|roller| is_along(roller, axis))
            && loads.iter().all(|load| is_along(*load, axis))
            && self.coupling_is_isotropic(group, axis);
        turns.then_some(axis)
    }

    /// Moments that keep a leaf from resting: on a group of veins that turns as a rigid body while no
    /// force does work, their sum about the axis is not zero.
    pub fn unbalanced_moment(&self) -> Option<UnbalancedMoment> {
        if self.wind.is_some() || self.has_followers() {
            return None;
        }
        self.tied_groups().into_iter().find_map(|group| {
            let apart = self.support_offsets(&group)?;
            // A hinge that holds the spin balances moments, too.
            if !group.clone().all(|vein| self.base_spins(vein)) {
                return None;
            }
            let moments = self.group_moments(&group);
            let whole: DVec3 = moments.iter().sum();
            let size: f64 = moments.iter().map(|moment| moment.length()).sum();
            let (line, moment) = match self.support_line(&group, &apart) {
                Some(_) => {
                    let axis = self.axis_between_hinges(&group, &apart)?;
                    let held = apart
                        .iter()
                        .any(|place| is_along(*place, axis) && *place != DVec3::ZERO);
                    let line = if held {
                        "the line through its holders"
                    } else {
                        "the line along its loads through its hinge"
                    };
                    (line, whole.dot(axis))
                }
                None => ("any line through its hinge", whole.length()),
            };
            (moment.abs() > TOLERANCES.equality * size).then_some(UnbalancedMoment { line, moment })
        })
    }

    /// The lab axes along which springs of the foundation hold a group of veins.
    fn foundation_axes(&self, group: &Range<usize>) -> BVec3 {
        let mut axes = BVec3::FALSE;
        for stiffness in self.foundation.iter().flat_map(|all| &all[group.clone()]) {
            axes |= BVec3::from_array(stiffness.each_ref().map(|of| of.max_abs() > 0.0));
        }
        axes
    }

    /// The only axis along which supports that hold neither directions nor the other axes hold a group of
    /// veins, grips on rollers and a foundation: nothing but turns about that axis is free of their
    /// forces. `None` without such supports; an error if there are others.
    fn roller_axis(&self, group: &Range<usize>) -> Result<Option<DVec3>, OtherSupports> {
        let mut axes = self.foundation_axes(group);
        for grip in self.grips.iter().filter(|grip| group.contains(&grip.vein)) {
            if grip.held == SupportKind::Clamped {
                return Err(OtherSupports);
            }
            axes |= BVec3::from_array(grip.stiffness.map(|stiffness| stiffness > 0.0));
        }
        match [0, 1, 2].map(|axis| axes.test(axis)) {
            [false, false, false] => Ok(None),
            [true, false, false] => Ok(Some(DVec3::X)),
            [false, true, false] => Ok(Some(DVec3::Y)),
            [false, false, true] => Ok(Some(DVec3::Z)),
            _ => Err(OtherSupports),
        }
    }

    /// Whether the springs of a foundation, and grips in their stiffness, are the same in all directions
    /// across an axis.
    fn supports_are_isotropic(&self, group: &Range<usize>, axis: DVec3) -> bool {
        let grips = self.grips.iter().filter(|grip| group.contains(&grip.vein));
        let foundation = self.foundation.iter().flat_map(|all| &all[group.clone()]);
        let even = |[x, y, z]: &[Profile; 3]| {
            let alike = |a: &Profile, b: &Profile| a == b;
            is_isotropic([alike(y, z), alike(z, x), alike(x, y)], axis)
        };
        { grips }.all(|grip| {
            let [x, y, z] = grip.stiffness;
            let equal = [[y, z], [z, x], [x, y]].map(|[a, b]| are_nearly_equal(a, b));
            is_isotropic(equal, axis)
        }) && { foundation }.all(even)
    }

    /// The places where a group of veins on hinges is held, from that of its first hinge; `None` if clamps
    /// hold it, springs, or grips, whose places depend on the shapes at rest, unless these hold along one axis only.
    fn support_offsets(&self, group: &Range<usize>) -> Option<Vec<DVec3>> {
        let tip = self.held_tip.as_ref();
        let gripped = self.roller_axis(group).is_err();
        let clamped = tip.is_some_and(|held| held.clamps.is_some());
        if gripped || clamped || !group.clone().all(|vein| self.is_pinned(vein)) {
            return None;
        }
        let tip = tip.map(|held| DVec3::from_array(held.position));
        let bases = self.rods[group.clone()].iter().map(Rod::base_position);
        let first = self.rods[group.start].base_position();
        Some(bases.chain(tip).map(|place| place - first).collect())
    }

    /// The direction of the line through these places, or of a load; `None` without any.
    fn support_line(&self, group: &Range<usize>, apart: &[DVec3]) -> Option<DVec3> {
        let near = TOLERANCES.equality * longest(&self.rods);
        let line = apart.iter().find(|apart| apart.length() > near).copied();
        let load = |load: &DVec3| *load != DVec3::ZERO;
        let rollers = || self.roller_axis(group).ok().flatten();
        let axis = line
            .or_else(|| self.group_loads(group).into_iter().find(load))
            .or_else(rollers);
        axis.map(DVec3::normalize)
    }

    /// Whether a group of veins on one hinge has no load: nothing tells where it points.
    pub fn has_undetermined_orientation(&self) -> bool {
        let free = |group: Range<usize>| {
            let apart = self.support_offsets(&group);
            let points = |apart: Vec<DVec3>| self.support_line(&group, &apart).is_some();
            // Moments without a line are refused, but where hinges that hold the spin could balance them.
            let spins = group.clone().all(|vein| self.base_spins(vein));
            !(spins && self.has_moments_on(&group)) && apart.is_some_and(|apart| !points(apart))
        };
        let determined = self.wind.is_some() || self.has_followers();
        !determined && self.tied_groups().into_iter().any(free)
    }

    /// Whether every coupling within a group has one stiffness in all directions across an axis: no
    /// turn about the axis changes its energy.
    fn coupling_is_isotropic(&self, group: &Range<usize>, axis: DVec3) -> bool {
        self.coupling[group.start..group.end - 1]
            .iter()
            .all(|&[x, y, z]| {
                let equal = [[y, z], [z, x], [x, y]].map(|[a, b]| are_nearly_equal(a, b));
                is_isotropic(equal, axis)
            })
    }

    /// Whether dead moments, which have no potential, act on a group of veins.
    fn has_moments_on(&self, group: &Range<usize>) -> bool {
        self.group_moments(group)
            .iter()
            .any(|it| *it != DVec3::ZERO)
    }

    /// Whether dead forces act off the axis of a vein of a group: their energy depends on how its sections
    /// are turned.
    fn has_levers_on(&self, group: &Range<usize>) -> bool {
        let mut points = self.points.iter().filter(|it| group.contains(&it.vein));
        points.any(|point| point.is_off_axis() && self.force_on(point) != [0.0; 3])
    }

    /// Whether tissue ties veins of a group.
    fn has_tissue_in(&self, group: &Range<usize>) -> bool {
        let mut tissue = self.tissue.iter();
        tissue.any(|all| all[group.start..group.end - 1].iter().any(has_some))
    }

    /// The dead moments on a group of veins.
    fn group_moments(&self, group: &Range<usize>) -> Vec<DVec3> {
        let points = self.points.iter().filter(|it| group.contains(&it.vein));
        let moments = points.map(|it| it.moment).chain([self.tip_moment]);
        moments.map(DVec3::from_array).collect()
    }

    /// All loads on a group of veins, those that vary along a vein at the knots of their profiles.
    fn group_loads(&self, group: &Range<usize>) -> Vec<DVec3> {
        let points = self.points.iter();
        let points = points.filter(|point| group.contains(&point.vein));
        let of_veins = group.clone().flat_map(|vein| {
            let weight = self.weight(vein);
            let of_mass = weight.of_mass.map(|(g, _)| g);
            let weights = [weight.even].into_iter().chain(of_mass);
            weights.chain(self.distributed_at_knots(vein))
        });
        let forces = points.map(|point| self.force_on(point));
        let all = of_veins.chain(forces).chain([self.tip_force]);
        all.map(DVec3::from_array).collect()
    }

    /// The veins that couplings, tissue or a free joint tip tie together.
    fn tied_groups(&self) -> Vec<Range<usize>> {
        let share_tip = self.joined && self.held_tip.is_none();
        let tissue = |gap: usize| self.tissue.as_ref().is_some_and(|all| has_some(&all[gap]));
        let tied = |gap: usize| share_tip || self.coupling[gap] != [0.0; 3] || tissue(gap);
        let ends = (1..=self.rods.len()).filter(|&end| end == self.rods.len() || !tied(end - 1));
        let mut start = 0;
        ends.map(|end| std::mem::replace(&mut start, end)..end)
            .collect()
    }

    /// The axis about which a group of tied veins can turn between clamps.
    fn axis_between_clamps(&self, group: Range<usize>) -> Option<DVec3> {
        let rods = &self.rods[group.clone()];
        let tangent = |rod: &Rod| rod.base_rotation() * DVec3::X;
        let mut grips = self.grips.iter().filter(|grip| group.contains(&grip.vein));
        let gripped = grips.clone().any(|grip| grip.held == SupportKind::Clamped);
        let clamps = self.held_tip.as_ref().and_then(|tip| tip.clamps.as_ref());
        let clamp = clamps.map(|clamps| clamps[group.start].rotation() * DVec3::X);
        // Where grips hold a vein depends on how it begins in the natural leaf.
        let without_grips = grips.clone().next().is_none();
        // A hinge that holds the spin allows what a clamp does: turns about n, with the sections back about their own.
        let free = |vein: usize| self.base_spins(vein) && without_grips;
        let axis = match group.clone().find(|vein| !free(*vein)) {
            None => clamp?,
            Some(_)
                if !gripped && clamp.is_none() && group.clone().all(|it| self.base_spins(it)) =>
            {
                return None;
            }
            Some(directed) => tangent(&self.rods[directed]),
        };
        let in_line = |direction: DVec3| direction.distance(axis) <= TOLERANCES.equality;
        let along = |load: [f64; 3]| is_along(DVec3::from_array(load), axis);
        let held = self.held_tip.as_ref().is_none_or(|held| {
            let clamps = held.clamps.as_ref().map(|clamps| &clamps[group.clone()]);
            let mut clamps = clamps.into_iter().flatten();
            along(held.position) && clamps.all(|clamp| in_line(clamp.rotation() * DVec3::X))
        });
        let begins = |vein: usize| {
            let rod = &self.rods[vein];
            (free(vein) || in_line(tangent(rod))) && is_along(rod.base_position(), axis)
        };
        let turns = group.clone().all(begins)
            && !self.has_tissue_in(&group)
            && self.group_loads(&group).iter().all(|load| is_along(*load, axis))
            && grips.all(|grip| along(grip.displacement))
            && self.supports_are_isotropic(&group, axis)
            && !self.has_moments_on(&group)
            && !self.has_levers_on(&group)
            && held
            && self.coupling_is_isotropic(&group, axis)
            // Comparing profiles takes longest.
            && rods.iter().all(is_round);
        turns.then_some(axis)
    }

    /// The distributed load of a vein where it may have extremes.
    fn distributed_at_knots(&self, vein: usize) -> impl Iterator<Item = [f64; 3]> {
        let loads = self.distributed.iter().map(move |all| &all[vein]);
        loads.flat_map(|load| {
            let knots = knot_places(load).into_iter();
            knots.map(|place| load.each_ref().map(|one| one.at(place)))
        })
    }

    /// Number of directions in which the leaf can move without resistance in an equilibrium: one
    /// for every vein that can spin, and for every group that can turn and is bent. Each has an
    /// eigenvalue that is zero. `points` gives the points of a vein.
    pub fn neutral_directions<P: IntoIterator<Item = DVec3>>(
        &self,
        points: impl Fn(usize) -> P,
    ) -> usize {
        let near = TOLERANCES.axis_distance * longest(&self.rods);
        let moves = |rotation: &ZeroEnergyRotation| {
            let points: Vec<DVec3> = rotation.rods.clone().flat_map(&points).collect();
            rotation.moves_something(&points, rotation.point, near)
        };
        self.zero_energy_rotations()
            .iter()
            .filter(|it| moves(it))
            .count()
    }
}

/// Supports that hold a group of veins otherwise than along one axis.
struct OtherSupports;

/// Whether a diagonal tensor, of whose entries for y and z, z and x, x and y it is known whether they are
/// equal, is the same in all directions across an axis.
fn is_isotropic(equal: [bool; 3], axis: DVec3) -> bool {
    (0..3).any(|own| {
        let off_axis = axis.reject_from_normalized(DVec3::AXES[own]).length();
        equal[own] && (equal[(own + 2) % 3] || off_axis <= TOLERANCES.equality)
    })
}

fn is_along(vector: DVec3, axis: DVec3) -> bool {
    vector.reject_from_normalized(axis).length() <= TOLERANCES.equality * vector.length()
}

fn has_some(tissue: &Tissue) -> bool {
    *tissue != Tissue::default()
}

fn are_nearly_equal(a: f64, b: f64) -> bool {
    a == b || (a - b).abs() <= TOLERANCES.equality * a.abs().max(b.abs())
}

/// Whether sections have no preferred direction, and a vein at rest is straight.
fn is_round(rod: &Rod) -> bool {
    let alike = |a: &Profile, b: &Profile| {
        let steps = TOLERANCES.profile_steps;
        let even = (0..=steps).map(|i| RodPlace::from(i as f64 / steps as f64));
        even.chain(knot_places([a, b]))
            .all(|place| are_nearly_equal(a.at(place), b.at(place)))
    };
    let [_, bending_2, bending_3] = &rod.couple_stiffness;
    let [_, shear_2, shear_3] = &rod.force_stiffness;
    let curved = rod.rest_curvature[1..].iter().any(|of| of.max_abs() > 0.0);
    !curved && alike(bending_2, bending_3) && alike(shear_2, shear_3)
}
