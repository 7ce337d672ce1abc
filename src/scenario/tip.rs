//! How the tips are held: the table `[tip]`.

use std::f64::consts::PI;

use glam::DQuat;

use super::entries::Entries;
use super::error::ScenarioResult;
use super::item::Item;
use super::key::Key;
use super::{Rod, longest};

/// Largest distance of a held tip from the base, in lengths of the longest rod with its
/// growth.
const FARTHEST: f64 = 10.0;

/// Largest angle and twist, in turns.
const MOST_TURNS: f64 = 100.0;

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
pub(super) fn held(entries: &Entries, rods: &[Rod], joined: bool) -> ScenarioResult<Option<HeldTip>> {
    let item = entries.item(Key::TipHeld)?;
    let word = item.text()?;
    let clamped = word == "clamped";
    item.ensure(
        clamped || ["free", "pinned"].contains(&word),
        "must be \"free\", \"pinned\" (the position is given) or \"clamped\" (the directions, too)",
    )?;
    let of_clamps = [Key::TipAngles, Key::TipTwist].map(|key| entries.given(key));
    if let Some(unused) = of_clamps.into_iter().flatten().find(|_| !clamped) {
        return Err(unused.refuse("belongs to a clamped tip: add tip.held = \"clamped\""));
    }
    let position = entries.given(Key::TipPosition);
    if word == "free" {
        return match position {
            Some(position) => Err(position
                .refuse("belongs to a tip that is held: add tip.held = \"pinned\" or \"clamped\"")),
            None => Ok(None),
        };
    }
    let Some(at) = position else {
        return Err(item.refuse("needs tip.position = [x, y, z], where the tip is held"));
    };
    item.ensure(
        joined || rods.len() == 1,
        "needs leaf.joined = true: one point is held, which all tips share",
    )?;
    let position = at.vector()?;
    check_reach(&at, position, rods)?;
    if let Some(moment) = entries.given(Key::TipMoment) {
        moment.ensure(
            moment.vector()? == [0.0; 3],
            "needs a free tip: leave out tip.held, or the moment",
        )?;
    }
    let base = entries.item(Key::Clamped)?;
    base.ensure(
        base.switch()?,
        "a tip that is held (tip.held) needs a base that is clamped",
    )?;
    let each = |key| {
        let item = entries.item(key)?;
        let angles = item.one_each(rods.len())?;
        item.ensure(
            angles
                .iter()
                .all(|angle| angle.abs() <= 2.0 * PI * MOST_TURNS),
            format_args!("must be at most {MOST_TURNS} turns, in radians"),
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
fn check_reach(at: &Item, [x, y, z]: [f64; 3], rods: &[Rod]) -> ScenarioResult<()> {
    let distance_from = |rod: &Rod| {
        let [from_x, from_y, from_z] = rod.base;
        (x - from_x).hypot(y - from_y).hypot(z - from_z)
    };
    let distance = rods.iter().map(distance_from).fold(0.0, f64::max);
    let reach = |rod: &Rod| rod.length * rod.rest_stretch.integral(1.0);
    let most = FARTHEST * rods.iter().map(reach).fold(longest(rods), f64::max);
    at.ensure(
        distance <= most,
        format_args!(
            "is {distance:e} away from the base, more than {FARTHEST} times the longest rod"
        ),
    )?;
    for (index, rod) in rods.iter().enumerate() {
        let distance = distance_from(rod);
        at.ensure(
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
