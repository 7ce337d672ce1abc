//! What is held of a leaf: its bases, its tips (the table `[tip]`), and stretches or points along its
//! veins (the tables `[[grip]]`).

use crate::scenario::format::Key;
use crate::scenario::format::entries::Entries;
use crate::scenario::format::error::ScenarioResult;
use crate::scenario::format::item::EntryValue;
use crate::scenario::veins::{Rod, longest};
use crate::words;
use glam::DQuat;
use std::f64::consts::PI;

words! {
    /// What a support holds.
    pub enum SupportKind {
        /// The position; directions are free, as on a hinge.
        Pinned = "pinned",
        /// The position and the directions.
        Clamped = "clamped",
    }
}

words! {
    /// What is held of the bases.
    pub enum BaseSupport {
        /// The positions and the directions.
        Clamped = "clamped",
        /// The positions; directions are free, as on hinges.
        Pinned = "pinned",
        /// The positions, and the directions by springs.
        Elastic = "elastic",
    }
}

words! {
    /// Whether bases on hinges may spin about their own tangents.
    pub enum BaseSpin {
        /// They may.
        Free = "free",
        /// They may not: the frame of a base is turned from its natural one by the shortest turn of its tangent, as by a
        /// constant-velocity joint.
        Held = "held",
    }
}

/// How far holders may take a leaf from its natural shape.
struct SupportLimits {
    /// Largest distance of a held tip from the base, in lengths of the longest rod with its growth.
    tip_distance: f64,
    /// Largest displacement of a grip, in lengths of the longest rod.
    grip_move: f64,
    /// Largest angle and twist of a clamped tip, in turns.
    clamp_turns: f64,
}

const SUPPORT_LIMITS: SupportLimits = SupportLimits {
    tip_distance: 10.0,
    grip_move: 10.0,
    clamp_turns: 100.0,
};

/// A tip that is held: of a joined leaf, or of a single rod.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldTip {
    /// Where the tip is held.
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
    /// The rotation of the directors at the tip.
    pub fn rotation(self) -> DQuat {
        DQuat::from_rotation_z(self.angle) * DQuat::from_rotation_x(self.twist)
    }
}

/// Reads `[tip]` of a leaf of these rods; `None` if the tips are free.
pub(super) fn read_held_tip(
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
    let position = at.vectors_in_time()?;
    for position in position.bounds() {
        check_reach(&at, position, rods)?;
    }
    let position = position.at(0.0);
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
        let turns = SUPPORT_LIMITS.clamp_turns;
        item.refuse_unless(
            angles.iter().all(|angle| angle.abs() <= 2.0 * PI * turns),
            format_args!("must be at most {turns} turns, in radians"),
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
    let farthest = SUPPORT_LIMITS.tip_distance;
    let most = farthest * rods.iter().map(reach).fold(longest(rods), f64::max);
    at.refuse_unless(
        distance <= most,
        format_args!(
            "is {distance:e} away from the base, more than {farthest} times the longest rod"
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

/// A holder somewhere along a vein. It holds a stretch, or a point, where that is in the natural
/// leaf (every vein in its rest shape from its base), moved by a given displacement: rigidly, by a
/// spring, or so that it slides, along each lab axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// The vein, counted from 0.
    pub vein: usize,
    /// Fractions of the vein's length where the stretch begins and ends, in (0, 1]; the same for a
    /// point.
    pub at: [f64; 2],
    /// Whether the directions are held, too.
    pub held: SupportKind,
    /// By how much the grip has moved from its place in the natural leaf.
    pub displacement: [f64; 3],
    /// The force per displacement along each lab axis: infinite where the grip is rigid, zero where it
    /// slides. A spring of a stretch is spread evenly over it.
    pub stiffness: [f64; 3],
    /// The moment per radian of a clamped grip: infinite where it is rigid.
    pub turn_stiffness: f64,
}

impl Grip {
    /// A rigid grip of a vein, counted from 0, that has not moved.
    pub fn rigid(vein: usize, at: [f64; 2], held: SupportKind) -> Self {
        Grip {
            vein,
            at,
            held,
            displacement: [0.0; 3],
            stiffness: [f64::INFINITY; 3],
            turn_stiffness: f64::INFINITY,
        }
    }

    /// Whether the grip holds the position rigidly, along each lab axis.
    pub fn rigid_axes(&self) -> [bool; 3] {
        self.stiffness.map(f64::is_infinite)
    }

    /// Whether the grip holds the directions rigidly.
    pub fn holds_directions(&self) -> bool {
        self.held == SupportKind::Clamped && self.turn_stiffness.is_infinite()
    }

    /// Whether the grip holds all that it holds rigidly.
    pub fn is_rigid(&self) -> bool {
        let directions = self.held == SupportKind::Pinned || self.holds_directions();
        self.rigid_axes() == [true; 3] && directions
    }

    /// Whether the grip holds the position along some axis, or the directions, by a spring.
    pub fn has_springs(&self) -> bool {
        let gives = |stiffness: f64| stiffness.is_finite() && stiffness > 0.0;
        self.stiffness.into_iter().any(gives)
            || self.held == SupportKind::Clamped && gives(self.turn_stiffness)
    }

    /// Whether this grip and another hold the same, with springs of any stiffness.
    pub(crate) fn holds_same_components(&self, other: &Grip) -> bool {
        (self.vein, self.at, self.held) == (other.vein, other.at, other.held)
            && self.rigid_axes() == other.rigid_axes()
            && self.holds_directions() == other.holds_directions()
    }
}

impl EntryValue<'_> {
    /// One of the words of a [`BaseSpin`].
    pub(super) fn base_spin(&self) -> ScenarioResult<BaseSpin> {
        self.word("must be \"free\" or \"held\" (hinges let a vein swing, and not spin)")
    }

    /// One of the words of a [`SupportKind`].
    fn support_kind(&self) -> ScenarioResult<SupportKind> {
        self.word("must be \"pinned\" (the position is held) or \"clamped\" (the directions, too)")
    }
}

/// What is held of the bases.
pub(super) struct HeldBases {
    /// Of the base of each rod.
    pub held: Vec<BaseSupport>,
    /// The stiffness of the spring of each rod, if it has one; empty unless some base is elastic.
    pub turn_stiffness: Vec<f64>,
    /// Whether those on hinges may spin.
    pub spin: BaseSpin,
}

/// Reads `leaf.base_held`, `leaf.base_spin` and `leaf.base_turn_stiffness` of so many rods.
pub(super) fn read_base_support(entries: &Entries, rods: usize) -> ScenarioResult<HeldBases> {
    let item = entries.value_or_default(Key::BaseHeld)?;
    let held: Vec<BaseSupport> = item.word_for_each(
        rods,
        "must be \"clamped\" (positions and directions are held), \"pinned\" (positions alone) or \"elastic\" \
         (directions by springs)",
    )?;
    let clamped = held.iter().all(|held| *held == BaseSupport::Clamped);
    item.refuse_unless(
        clamped || entries.value_or_default(Key::Clamped)?.switch()?,
        "contradicts dynamics.clamped = false, a base that is free: leave one of them out",
    )?;
    let springs = entries.given_value(Key::BaseTurnStiffness);
    let turn_stiffness = match (held.contains(&BaseSupport::Elastic), springs) {
        (true, Some(springs)) => {
            let elastic = held.iter().map(|held| *held == BaseSupport::Elastic);
            springs.number_for_each_used(&elastic.collect::<Vec<_>>())?
        }
        (true, None) => {
            return Err(item.value_error(
                "needs leaf.base_turn_stiffness, the moment per radian of the springs at the bases",
            ));
        }
        (false, Some(springs)) => {
            return Err(
                springs.value_error("belongs to bases that give: add leaf.base_held = \"elastic\"")
            );
        }
        (false, None) => Vec::new(),
    };
    let item = entries.value_or_default(Key::BaseSpin)?;
    let spin = item.base_spin()?;
    item.refuse_unless(
        spin == BaseSpin::Free || held.contains(&BaseSupport::Pinned),
        "belongs to bases on hinges, as clamps and springs hold the spin themselves: add leaf.base_held = \"pinned\"",
    )?;
    Ok(HeldBases {
        held,
        turn_stiffness,
        spin,
    })
}

/// Reads `[[grip]]` of a leaf of these rods. `shared`: whether the tip is one that several rods
/// share, or that is held.
pub(super) fn read_grips(
    entries: &Entries,
    rods: &[Rod],
    shared: bool,
) -> ScenarioResult<Vec<Grip>> {
    let count = entries.table_count("grip").unwrap_or(0);
    let mut rows = Vec::new();
    for row in 0..count {
        let veins = entries.value_in_row(Key::GripVein, row)?;
        for vein in veins.whole_numbers(rods.len())? {
            let grip = read_grip(entries, row, vein - 1, rods, shared)?;
            rows.push(GripInRow { row, grip });
        }
    }
    refuse_overlaps(entries, &rows)?;
    Ok(rows.into_iter().map(|it| it.grip).collect())
}

/// A grip, and the table that it is from: one with a list of veins is that of several.
struct GripInRow {
    row: usize,
    grip: Grip,
}

/// Reads the grip on a vein, counted from 0, from its table.
fn read_grip(
    entries: &Entries,
    row: usize,
    vein: usize,
    rods: &[Rod],
    shared: bool,
) -> ScenarioResult<Grip> {
    let item = |key| entries.value_in_row(key, row);
    let place = item(Key::GripAt)?;
    let at = place.fraction_interval()?;
    place.refuse_unless(
        at[1] < 1.0 || !shared,
        "must end before 1: the tip is shared by several rods, or held: use [tip] for it",
    )?;
    let farthest = SUPPORT_LIMITS.grip_move;
    let way = item(Key::GripMove)?;
    let moves = way.vectors_in_time()?;
    way.refuse_unless(
        (moves.bounds().iter()).all(|[x, y, z]| x.hypot(*y).hypot(*z) <= farthest * longest(rods)),
        format_args!("must be at most {farthest} times the longest rod"),
    )?;
    let held = item(Key::GripHeld)?.support_kind()?;
    let springs = item(Key::GripStiffness)?;
    let stiffness = springs.vector()?;
    springs.refuse_unless(
        held == SupportKind::Clamped || stiffness != [0.0; 3],
        "holds nothing: give an axis a stiffness, or inf where the grip is rigid",
    )?;
    let turned = item(Key::GripTurnStiffness)?;
    let turn_stiffness = turned.number()?;
    turned.refuse_unless(
        held == SupportKind::Clamped || turn_stiffness.is_infinite(),
        "belongs to a grip that holds directions: add held = \"clamped\"",
    )?;
    let grip = Grip {
        vein,
        at,
        held,
        displacement: moves.at(0.0),
        stiffness,
        turn_stiffness,
    };
    // Where every place is held, a section that cannot stretch cannot shear, and the force that keeps it from it is any.
    let [stretch, shear @ ..] =
        (rods[vein].force_stiffness.each_ref()).map(|of| of.min().is_infinite());
    let is_stretch_held = grip.is_rigid() && held == SupportKind::Pinned && at[0] < at[1];
    place.refuse_unless(
        !is_stretch_held || !stretch || shear == [true; 2],
        "holds every place of a stretch that shears and is inextensible, where no force along it is determined: give \
         stiffness.axial a number, clamp the grip, or hold single points",
    )?;
    Ok(grip)
}

/// Refuses grips that hold the same point.
fn refuse_overlaps(entries: &Entries, grips: &[GripInRow]) -> ScenarioResult<()> {
    let mut order: Vec<&GripInRow> = grips.iter().collect();
    order.sort_by(|a, b| {
        let by_vein = a.grip.vein.cmp(&b.grip.vein);
        by_vein.then(a.grip.at[0].total_cmp(&b.grip.at[0]))
    });
    for pair in order.windows(2) {
        let [one, other] = [pair[0].grip, pair[1].grip];
        let item = entries.value_in_row(Key::GripAt, pair[1].row)?;
        item.refuse_unless(
            one.vein != other.vein || other.at[0] > one.at[1],
            format_args!(
                "is held by grip[{}], too: let the stretches of a vein lie apart",
                pair[0].row
            ),
        )?;
    }
    Ok(())
}
