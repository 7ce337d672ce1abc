//! Holders along a vein: the tables `[[grip]]`; and how bases are held.

use super::entries::Entries;
use super::error::ScenarioResult;
use super::item::Item;
use super::key::Key;
use super::{Hold, Rod, Scenario, longest};

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
    pub held: Hold,
    /// The displacement.
    pub displacement: [f64; 3],
}

/// A grip that ends within this part of the length from the tip holds it.
const AT_TIP: f64 = 1e-11;

impl Scenario {
    /// Whether all tips are held: as `[tip]` says, or by grips.
    pub fn holds_all_tips(&self) -> bool {
        let gripped = |vein: usize| {
            let mut grips = self.grips.iter().filter(|grip| grip.vein == vein);
            grips.any(|grip| 1.0 - grip.at[1] < AT_TIP)
        };
        self.held_tip.is_some() || (0..self.rods.len()).all(gripped)
    }

    /// Whether tissue, which has no force in the natural leaf, or grips, which hold veins where they
    /// are in it, make a leaf depend on shapes at rest in another way than by their strains.
    pub fn depends_on_natural_leaf(&self) -> bool {
        self.tissue.is_some() || !self.grips.is_empty()
    }
}

impl Item<'_> {
    /// One of the words of a [`Hold`].
    pub(super) fn hold(&self) -> ScenarioResult<Hold> {
        self.word("must be \"pinned\" (the position is held) or \"clamped\" (the directions, too)")
    }
}

/// Reads `leaf.base_held`.
pub(super) fn of_bases(entries: &Entries) -> ScenarioResult<Hold> {
    let item = entries.item(Key::BaseHeld)?;
    let held = item.hold()?;
    item.ensure(
        held == Hold::Clamped || entries.item(Key::Clamped)?.switch()?,
        "contradicts dynamics.clamped = false, a base that is free: leave one of them out",
    )?;
    Ok(held)
}

/// Reads `[[grip]]` of a leaf of these rods. `shared`: whether the tip is one that several rods
/// share, or that is held.
pub(super) fn grips(entries: &Entries, rods: &[Rod], shared: bool) -> ScenarioResult<Vec<Grip>> {
    let count = entries.rows("grip").unwrap_or(0);
    let grips: Vec<Grip> = (0..count)
        .map(|row| grip(entries, row, rods, shared))
        .collect::<ScenarioResult<_>>()?;
    refuse_overlaps(entries, &grips)?;
    Ok(grips)
}

fn grip(entries: &Entries, row: usize, rods: &[Rod], shared: bool) -> ScenarioResult<Grip> {
    let item = |key| entries.item_of(key, row);
    let place = item(Key::GripAt)?;
    let at = place.stretch()?;
    place.ensure(
        at[1] < 1.0 || !shared,
        "must end before 1: the tip is shared by several rods, or held: use [tip] for it",
    )?;
    let way = item(Key::GripMove)?;
    let [x, y, z] = way.vector()?;
    way.ensure(
        x.hypot(y).hypot(z) <= FARTHEST_MOVE * longest(rods),
        format_args!("must be at most {FARTHEST_MOVE} times the longest rod"),
    )?;
    Ok(Grip {
        vein: item(Key::GripVein)?.whole(rods.len())? - 1,
        at,
        held: item(Key::GripHeld)?.hold()?,
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
        entries.item_of(Key::GripAt, pair[1])?.ensure(
            one.vein != other.vein || other.at[0] > one.at[1],
            format_args!(
                "is held by grip[{}], too: let the stretches of a vein lie apart",
                pair[0]
            ),
        )?;
    }
    Ok(())
}
