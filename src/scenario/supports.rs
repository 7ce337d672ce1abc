//! How bases and grips are held.
//!
//! How the tips are held: the table `[tip]`.
//!
//! Holders along a vein: the tables `[[grip]]`; and how bases are held.
//!
//! Veins that can turn without resistance.
//!
//! Round ones that are clamped in line, loaded along this line and held on it, if at all, turn about
//! the axis of their base; with tissue, and about axes that do not go through the origin, they are
//! left out. Where every vein of a group that is tied together, or a single one, turns about the axis
//! by an angle and every section back about its own tangent, no clamp, load or strain energy changes:
//! if it is bent it has a circle of equilibria, and no bifurcation.
//!
//! On hinges a vein that is straight or round spins: every section turns about its own tangent,
//! whatever its loads, as nothing but tissue or a clamp holds its sections. And a group of veins
//! turns as a rigid body about the line through all points where it is held, if it is loaded along
//! this line, whatever its sections.

#[cfg(test)]
mod tests;

use crate::rotation::angle_about;
use crate::scenario::format::Key;
use crate::scenario::format::entries::Entries;
use crate::scenario::format::item::EntryValue;
use crate::scenario::format::source::ScenarioResult;
use crate::scenario::{Profile, Rod, Scenario, Tissue, longest};
use crate::words;
use glam::{DQuat, DVec3};
use std::f64::consts::PI;
use std::ops::Range;

words! {
    /// What is held.
    pub enum SupportKind {
        /// The position; directions are free, as on a hinge.
        Pinned = "pinned",
        /// The position and the directions.
        Clamped = "clamped",
    }
}

/// Largest distance of a held tip from the base, in lengths of the longest rod with its
/// growth.
const FARTHEST: f64 = 10.0;

/// Largest angle and twist, in turns.
const MAX_CLAMP_TURNS: f64 = 100.0;

/// A tip that is held: of a joined leaf, or of a single rod.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldTip {
    /// Its position.
    pub position: [f64; 3],
    /// The directions of the rods if these are held, too; `None`: pinned.
    pub clamps: Option<Vec<Clamp>>,
}

/// The direction in which the tip of a rod is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clamp {
    /// Angle of d1 in the e1-e2 plane, radians.
    pub angle: f64,
    /// Angle by which the section is then turned about d1, radians.
    pub twist: f64,
}

impl Clamp {
    /// The rotation of the tip.
    pub fn rotation(self) -> DQuat {
        DQuat::from_rotation_z(self.angle) * DQuat::from_rotation_x(self.twist)
    }
}

/// Reads `[tip]` of a leaf of these rods; `None` if the tips are free.
pub(super) fn held(
    entries: &Entries,
    rods: &[Rod],
    joined: bool,
) -> ScenarioResult<Option<HeldTip>> {
    let item = entries.value_or_default(Key::TipHeld)?;
    let word = item.text()?;
    let clamped = word == "clamped";
    item.refuse_unless(
        clamped || ["free", "pinned"].contains(&word),
        "must be \"free\", \"pinned\" (the position is given) or \"clamped\" (the directions, too)",
    )?;
    let of_clamps = [Key::TipAngles, Key::TipTwist].map(|key| entries.given_value(key));
    if let Some(unused) = of_clamps.into_iter().flatten().find(|_| !clamped) {
        return Err(unused.value_error("belongs to a clamped tip: add tip.held = \"clamped\""));
    }
    let position = entries.given_value(Key::TipPosition);
    if word == "free" {
        return match position {
            Some(position) => Err(position.value_error(
                "belongs to a tip that is held: add tip.held = \"pinned\" or \"clamped\"",
            )),
            None => Ok(None),
        };
    }
    let Some(at) = position else {
        return Err(item.value_error("needs tip.position = [x, y, z], where the tip is held"));
    };
    item.refuse_unless(
        joined || rods.len() == 1,
        "needs leaf.joined = true: one point is held, which all tips share",
    )?;
    let position = at.vector()?;
    check_reach(&at, position, rods)?;
    if let Some(moment) = entries.given_value(Key::TipMoment) {
        moment.refuse_unless(
            moment.vector()? == [0.0; 3],
            "needs a free tip: leave out tip.held, or the moment",
        )?;
    }
    let base = entries.value_or_default(Key::Clamped)?;
    base.refuse_unless(
        base.switch()?,
        "a tip that is held (tip.held) needs a base that is clamped",
    )?;
    let each = |key| {
        let item = entries.value_or_default(key)?;
        let angles = item.number_for_each(rods.len())?;
        item.refuse_unless(
            angles
                .iter()
                .all(|angle| angle.abs() <= 2.0 * PI * MAX_CLAMP_TURNS),
            format_args!("must be at most {MAX_CLAMP_TURNS} turns, in radians"),
        )?;
        Ok(angles)
    };
    let clamps = match clamped {
        true => {
            let pairs = each(Key::TipAngles)?.into_iter().zip(each(Key::TipTwist)?);
            Some(pairs.map(|(angle, twist)| Clamp { angle, twist }).collect())
        }
        false => None,
    };
    Ok(Some(HeldTip { position, clamps }))
}

/// Refuses positions that the rods cannot reach.
fn check_reach(at: &EntryValue, [x, y, z]: [f64; 3], rods: &[Rod]) -> ScenarioResult<()> {
    let distance_from = |rod: &Rod| {
        let [from_x, from_y, from_z] = rod.base;
        (x - from_x).hypot(y - from_y).hypot(z - from_z)
    };
    let distance = rods.iter().map(distance_from).fold(0.0, f64::max);
    let reach = |rod: &Rod| rod.length * rod.rest_stretch.integral(1.0);
    let most = FARTHEST * rods.iter().map(reach).fold(longest(rods), f64::max);
    at.refuse_unless(
        distance <= most,
        format_args!(
            "is {distance:e} away from the base, more than {FARTHEST} times the longest rod"
        ),
    )?;
    for (index, rod) in rods.iter().enumerate() {
        let distance = distance_from(rod);
        at.refuse_unless(
            !rod.force_stiffness[0].min().is_infinite() || distance < reach(rod),
            format_args!(
                "is {distance:e} away from the base, but rod {} is inextensible and {:e} long",
                index + 1,
                reach(rod)
            ),
        )?;
    }
    Ok(())
}

/// Largest way of a grip, in lengths of the longest rod.
const FARTHEST_MOVE: f64 = 10.0;

/// A holder somewhere along a vein. It holds a stretch, or a point, where that is in the natural
/// leaf (every vein in its rest shape from its base), moved by a given displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// The vein, counted from 0.
    pub vein: usize,
    /// Fractions of its length where the stretch begins and ends, in (0, 1]; the same for a point.
    pub at: [f64; 2],
    /// What it holds.
    pub held: SupportKind,
    /// The displacement.
    pub displacement: [f64; 3],
}

/// A grip that ends within this part of the length from the tip holds it.
const TIP_GRIP_TOLERANCE: f64 = 1e-11;

impl Scenario {
    /// Whether all tips are held: as `[tip]` says, or by grips.
    pub fn holds_all_tips(&self) -> bool {
        let gripped = |vein: usize| {
            let mut grips = self.grips.iter().filter(|grip| grip.vein == vein);
            grips.any(|grip| 1.0 - grip.at[1] < TIP_GRIP_TOLERANCE)
        };
        self.held_tip.is_some() || (0..self.rods.len()).all(gripped)
    }

    /// Whether tissue, which has no force in the natural leaf, or grips, which hold veins where they
    /// are in it, make a leaf depend on shapes at rest in another way than by their strains.
    pub fn needs_stress_free_leaf(&self) -> bool {
        self.tissue.is_some() || !self.grips.is_empty()
    }
}

impl EntryValue<'_> {
    /// One of the words of a [`Hold`].
    pub(super) fn support_kind(&self) -> ScenarioResult<SupportKind> {
        self.word("must be \"pinned\" (the position is held) or \"clamped\" (the directions, too)")
    }
}

/// Reads `leaf.base_held`.
pub(super) fn of_bases(entries: &Entries) -> ScenarioResult<SupportKind> {
    let item = entries.value_or_default(Key::BaseHeld)?;
    let held = item.support_kind()?;
    item.refuse_unless(
        held == SupportKind::Clamped || entries.value_or_default(Key::Clamped)?.switch()?,
        "contradicts dynamics.clamped = false, a base that is free: leave one of them out",
    )?;
    Ok(held)
}

/// Reads `[[grip]]` of a leaf of these rods. `shared`: whether the tip is one that several rods
/// share, or that is held.
pub(super) fn grips(entries: &Entries, rods: &[Rod], shared: bool) -> ScenarioResult<Vec<Grip>> {
    let count = entries.table_count("grip").unwrap_or(0);
    let grips: Vec<Grip> = (0..count)
        .map(|row| grip(entries, row, rods, shared))
        .collect::<ScenarioResult<_>>()?;
    refuse_overlaps(entries, &grips)?;
    Ok(grips)
}

fn grip(entries: &Entries, row: usize, rods: &[Rod], shared: bool) -> ScenarioResult<Grip> {
    let item = |key| entries.value_in_row(key, row);
    let place = item(Key::GripAt)?;
    let at = place.fraction_interval()?;
    place.refuse_unless(
        at[1] < 1.0 || !shared,
        "must end before 1: the tip is shared by several rods, or held: use [tip] for it",
    )?;
    let way = item(Key::GripMove)?;
    let [x, y, z] = way.vector()?;
    way.refuse_unless(
        x.hypot(y).hypot(z) <= FARTHEST_MOVE * longest(rods),
        format_args!("must be at most {FARTHEST_MOVE} times the longest rod"),
    )?;
    Ok(Grip {
        vein: item(Key::GripVein)?.whole_number(rods.len())? - 1,
        at,
        held: item(Key::GripHeld)?.support_kind()?,
        displacement: [x, y, z],
    })
}

/// No point has two holders.
fn refuse_overlaps(entries: &Entries, grips: &[Grip]) -> ScenarioResult<()> {
    let mut order: Vec<usize> = (0..grips.len()).collect();
    let begin = |grip: &Grip| (grip.vein, grip.at[0]);
    order.sort_by(|&a, &b| {
        let ((vein, from), (other, begins)) = (begin(&grips[a]), begin(&grips[b]));
        vein.cmp(&other).then(from.total_cmp(&begins))
    });
    for pair in order.windows(2) {
        let [one, other] = [&grips[pair[0]], &grips[pair[1]]];
        entries.value_in_row(Key::GripAt, pair[1])?.refuse_unless(
            one.vein != other.vein || other.at[0] > one.at[1],
            format_args!(
                "is held by grip[{}], too: let the stretches of a vein lie apart",
                pair[0]
            ),
        )?;
    }
    Ok(())
}

/// Tangents whose parts across an axis are smaller tell no direction about it.
const TANGENT_TOLERANCE: f64 = 1e-8;

/// Numbers that differ by less than this part are the same.
const EQUALITY_TOLERANCE: f64 = 1e-12;

/// A vein that is not round spins without resistance only where it is straight. Where it is bent
/// by more than this part of what else counts as near, its stiffer side rolls over.
const STRAIGHTNESS_TOLERANCE: f64 = 1e-3;

/// Profiles are compared at so many equal distances, and at their kinks.
const PROFILE_COMPARISON_POINTS: usize = 16;

/// Neighbouring veins that can turn together without resistance, whatever their shape: at unit rate
/// all turn about the axis, and every section by `own` about its own tangent.
#[derive(Clone, Debug, PartialEq)]
pub struct ZeroEnergyRotation {
    /// Their numbers.
    pub rods: Range<usize>,
    /// A point of the axis.
    pub point: DVec3,
    /// The direction of the axis, or zero for a vein that only spins.
    pub axis: DVec3,
    /// Rate of the turn of sections about their own tangents: -1, 0 or 1.
    pub section_rate: f64,
    /// Whether they turn so also where they are bent.
    pub includes_bent_veins: bool,
}

/// Moments about a line about which nothing holds a group of veins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnbalancedMoment {
    /// Which line.
    pub line: &'static str,
    /// The sum of the moments about it.
    pub moment: f64,
}

/// The rotations in which a vein begins.
pub struct BaseRotations {
    /// In the natural leaf.
    pub stress_free: DQuat,
    /// Now.
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
            f64::hypot(sin, cos) > TANGENT_TOLERANCE,
            sum.length() > TANGENT_TOLERANCE,
        ) {
            (true, _) => sin.atan2(cos),
            (false, true) => angle_about(axis, sum, down.reject_from_normalized(axis)),
            (false, false) => 0.0,
        }
    }

    /// Whether anything moves when veins through these points turn: some point that is farther than
    /// `near` from the axis through `point`; or, where a vein spins, its sections, if it is round or no
    /// point is so far from the line between its ends.
    pub fn moves_something(&self, points: &[DVec3], point: DVec3, near: f64) -> bool {
        let off = |from: DVec3, axis: DVec3, near: f64| {
            let mut points = points.iter();
            points.any(|at| (*at - from).reject_from_normalized(axis).length() > near)
        };
        match (self.axis == DVec3::ZERO, points) {
            (false, _) => off(point, self.axis, near),
            (true, [base, .., tip]) => {
                let chord = (*tip - *base).normalize_or(DVec3::X);
                self.includes_bent_veins || !off(*base, chord, STRAIGHTNESS_TOLERANCE * near)
            }
            (true, _) => self.includes_bent_veins,
        }
    }

    /// The rotations by this angle about the axis and, from the right, of sections about their own
    /// tangents.
    pub fn rotations(&self, angle: f64) -> [DQuat; 2] {
        let turn = match self.axis == DVec3::ZERO {
            true => DQuat::IDENTITY,
            false => DQuat::from_axis_angle(self.axis, angle),
        };
        [turn, DQuat::from_rotation_x(self.section_rate * angle)]
    }

    /// The velocity of a node in this position, whose unit of length is `length`, and with these
    /// directors.
    pub fn node_velocity(&self, x: DVec3, q: DQuat, length: f64) -> [DVec3; 2] {
        let spin = self.axis + self.section_rate * (q * DVec3::X);
        [spin, self.axis.cross(x - self.point / length)]
    }
}

impl Scenario {
    /// The groups of veins that can turn without resistance: in wind only those that spin.
    pub fn zero_energy_rotations(&self) -> Vec<ZeroEnergyRotation> {
        let mut turnings = Vec::new();
        let hinged = self.base_held == SupportKind::Pinned;
        for rods in self.tied_groups() {
            let windy = self.wind.is_some();
            let between_clamps = self.axis_between_clamps(rods.clone()).filter(|_| !windy);
            turnings.extend(between_clamps.map(|axis| ZeroEnergyRotation {
                rods: rods.clone(),
                point: DVec3::ZERO,
                axis,
                section_rate: -1.0,
                includes_bent_veins: true,
            }));
            if hinged {
                // In this order: to lean, a vein spins back from where it has turned to as a whole.
                let rigid = self.rigid_rotation(&rods).filter(|_| !windy);
                turnings.extend(rigid);
                turnings.extend(
                    rods.filter(|j| self.spins(*j))
                        .map(|j| self.spin_rotation(j)),
                );
            }
        }
        turnings
    }

    /// Whether every section of a vein on a hinge can turn about its own tangent, if it is round or
    /// straight.
    fn spins(&self, vein: usize) -> bool {
        let gaps = [vein.checked_sub(1), Some(vein)].into_iter().flatten();
        let tissue = |gap| (self.tissue.iter()).any(|all| all.get(gap).is_some_and(has_some));
        let clamps = |grip: &Grip| grip.vein == vein && grip.held == SupportKind::Clamped;
        let tip = self.held_tip.as_ref();
        tip.is_none_or(|held| held.clamps.is_none())
            && !gaps.clone().any(tissue)
            && !self.grips.iter().any(clamps)
            && !self.has_moments_on(&(vein..vein + 1))
    }

    fn spin_rotation(&self, vein: usize) -> ZeroEnergyRotation {
        ZeroEnergyRotation {
            rods: vein..vein + 1,
            point: DVec3::ZERO,
            axis: DVec3::ZERO,
            section_rate: 1.0,
            includes_bent_veins: is_round(&self.rods[vein]),
        }
    }

    /// The turn of a group of tied veins on hinges as a rigid body, about the line through the points
    /// where it is held or, if there is only one, along its loads.
    fn rigid_rotation(&self, group: &Range<usize>) -> Option<ZeroEnergyRotation> {
        let apart = self.support_offsets(group)?;
        let axis = self.axis_between_hinges(group, &apart)?;
        (!self.has_moments_on(group)).then(|| ZeroEnergyRotation {
            rods: group.clone(),
            point: self.rods[group.start].base_position(),
            axis,
            section_rate: 0.0,
            includes_bent_veins: true,
        })
    }

    /// The axis about which a group of tied veins on hinges, which is held in places that are so far
    /// `apart`, can turn as a rigid body while its forces do no work.
    fn axis_between_hinges(&self, group: &Range<usize>, apart: &[DVec3]) -> Option<DVec3> {
        let near = EQUALITY_TOLERANCE * crate::scenario::longest(&self.rods);
        let on_line = |axis: DVec3| {
            let mut apart = apart.iter();
            apart.all(|it| it.reject_from_normalized(axis).length() <= near)
        };
        let loads = self.group_loads(group);
        let axis = self.support_line(group, apart)?;
        let turns = on_line(axis)
            && loads.iter().all(|load| is_along(*load, axis))
            && self.coupling_is_isotropic(group, axis);
        turns.then_some(axis)
    }

    /// The moments on a leaf that cannot rest: on a group of veins that turns as a rigid body while
    /// no force does work, they sum up to something about the axis.
    pub fn unbalanced_moment(&self) -> Option<UnbalancedMoment> {
        if self.base_held != SupportKind::Pinned || self.wind.is_some() {
            return None;
        }
        self.tied_groups().into_iter().find_map(|group| {
            let apart = self.support_offsets(&group)?;
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
            (moment.abs() > EQUALITY_TOLERANCE * size).then_some(UnbalancedMoment { line, moment })
        })
    }

    /// The places where a group of veins is held, from that of its first hinge; `None` if clamps hold
    /// it, or grips, whose places depend on the shapes at rest.
    fn support_offsets(&self, group: &Range<usize>) -> Option<Vec<DVec3>> {
        let tip = self.held_tip.as_ref();
        let gripped = self.grips.iter().any(|grip| group.contains(&grip.vein));
        let clamped = tip.is_some_and(|held| held.clamps.is_some());
        if gripped || clamped {
            return None;
        }
        let tip = tip.map(|held| DVec3::from_array(held.position));
        let bases = self.rods[group.clone()].iter().map(Rod::base_position);
        let first = self.rods[group.start].base_position();
        Some(bases.chain(tip).map(|place| place - first).collect())
    }

    /// The direction of the line through these places, or of a load; `None` without any.
    fn support_line(&self, group: &Range<usize>, apart: &[DVec3]) -> Option<DVec3> {
        let near = EQUALITY_TOLERANCE * crate::scenario::longest(&self.rods);
        let line = apart.iter().find(|apart| apart.length() > near).copied();
        let load = |load: &DVec3| *load != DVec3::ZERO;
        let axis = line.or_else(|| self.group_loads(group).into_iter().find(load));
        axis.map(DVec3::normalize)
    }

    /// Whether a group of veins on one hinge has no load: nothing tells where it points.
    pub fn has_undetermined_orientation(&self) -> bool {
        let free = |group: Range<usize>| {
            let apart = self.support_offsets(&group);
            let points = |apart: Vec<DVec3>| self.support_line(&group, &apart).is_some();
            !self.has_moments_on(&group) && apart.is_some_and(|apart| !points(apart))
        };
        let hinged = self.base_held == SupportKind::Pinned && self.wind.is_none();
        hinged && self.tied_groups().into_iter().any(free)
    }

    /// Whether a coupling within a group differs from a multiple of the unit matrix along an axis
    /// alone.
    fn coupling_is_isotropic(&self, group: &Range<usize>, axis: DVec3) -> bool {
        self.coupling[group.start..group.end - 1].iter().all(|k| {
            (0..3).any(|own| {
                let [one, other] = [k[(own + 1) % 3], k[(own + 2) % 3]];
                let on_axis =
                    axis.reject_from_normalized(DVec3::AXES[own]).length() <= EQUALITY_TOLERANCE;
                are_nearly_equal(one, other) && (are_nearly_equal(one, k[own]) || on_axis)
            })
        })
    }

    /// Whether dead moments, which have no potential, act on a group of veins.
    fn has_moments_on(&self, group: &Range<usize>) -> bool {
        self.group_moments(group)
            .iter()
            .any(|it| *it != DVec3::ZERO)
    }

    /// The dead moments on a group of veins.
    fn group_moments(&self, group: &Range<usize>) -> Vec<DVec3> {
        let points = self.points.iter().filter(|it| group.contains(&it.vein));
        let moments = points.map(|it| it.moment).chain([self.tip_moment]);
        moments.map(DVec3::from_array).collect()
    }

    /// All loads on a group of veins, where they may be largest.
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
        let free = self.base_held == SupportKind::Pinned && grips.clone().next().is_none();
        let axis = match self.base_held {
            SupportKind::Pinned if free => clamp?,
            SupportKind::Pinned if !gripped && clamp.is_none() => return None,
            _ => tangent(rods.first()?),
        };
        let in_line = |direction: DVec3| direction.distance(axis) <= EQUALITY_TOLERANCE;
        let along = |load: [f64; 3]| is_along(DVec3::from_array(load), axis);
        let held = self.held_tip.as_ref().is_none_or(|held| {
            let clamps = held.clamps.as_ref().map(|clamps| &clamps[group.clone()]);
            let mut clamps = clamps.into_iter().flatten();
            along(held.position) && clamps.all(|clamp| in_line(clamp.rotation() * DVec3::X))
        });
        let gaps = group.start..group.end - 1;
        let tissue = self
            .tissue
            .iter()
            .any(|all| all[gaps.clone()].iter().any(has_some));
        let begins =
            |rod: &Rod| (free || in_line(tangent(rod))) && is_along(rod.base_position(), axis);
        let turns = rods.iter().all(begins)
            && !tissue
            && self.group_loads(&group).iter().all(|load| is_along(*load, axis))
            && grips.all(|grip| along(grip.displacement))
            && !self.has_moments_on(&group)
            && held
            && self.coupling_is_isotropic(&group, axis)
            // This takes longest.
            && rods.iter().all(is_round);
        turns.then_some(axis)
    }
}

impl Scenario {
    /// The distributed load of a vein where it may have extremes.
    fn distributed_at_knots(&self, vein: usize) -> impl Iterator<Item = [f64; 3]> {
        let loads = self.distributed.iter().map(move |all| &all[vein]);
        loads.flat_map(|load| {
            let inner = load.iter().flat_map(|one| one.kinks()).copied();
            let knots = [0.0, 1.0].into_iter().chain(inner);
            knots.map(|sigma| load.each_ref().map(|one| one.at(sigma)))
        })
    }
}

/// Veins whose points are all nearer to the axis than this part of the leaf's length are straight,
/// and do not move when they turn.
const AXIS_TOLERANCE: f64 = 1e-6;

impl Scenario {
    /// Number of directions in which the leaf can move without resistance in an equilibrium: one
    /// for every vein that can spin, and for every group that can turn and is bent. Each has an
    /// eigenvalue that is zero. `points` are those of a vein.
    pub fn neutral_directions<P: IntoIterator<Item = DVec3>>(
        &self,
        points: impl Fn(usize) -> P,
    ) -> usize {
        let near = AXIS_TOLERANCE * crate::scenario::longest(&self.rods);
        let moves = |turning: &ZeroEnergyRotation| {
            let points: Vec<DVec3> = turning.rods.clone().flat_map(&points).collect();
            turning.moves_something(&points, turning.point, near)
        };
        self.zero_energy_rotations()
            .iter()
            .filter(|it| moves(it))
            .count()
    }
}

fn is_along(vector: DVec3, axis: DVec3) -> bool {
    vector.reject_from_normalized(axis).length() <= EQUALITY_TOLERANCE * vector.length()
}

fn has_some(tissue: &Tissue) -> bool {
    *tissue != Tissue::default()
}

fn are_nearly_equal(a: f64, b: f64) -> bool {
    a == b || (a - b).abs() <= EQUALITY_TOLERANCE * a.abs().max(b.abs())
}

/// Whether sections have no preferred direction, and a vein at rest is straight.
fn is_round(rod: &Rod) -> bool {
    let alike = |a: &Profile, b: &Profile| {
        let even =
            (0..=PROFILE_COMPARISON_POINTS).map(|i| i as f64 / PROFILE_COMPARISON_POINTS as f64);
        let kinks = a.kinks().iter().chain(b.kinks()).copied();
        even.chain(kinks)
            .all(|sigma| are_nearly_equal(a.at(sigma), b.at(sigma)))
    };
    let [_, bending_2, bending_3] = &rod.couple_stiffness;
    let [_, shear_2, shear_3] = &rod.force_stiffness;
    let curved = rod.rest_curvature[1..].iter().any(|of| of.max_abs() > 0.0);
    !curved && alike(bending_2, bending_3) && alike(shear_2, shear_3)
}
