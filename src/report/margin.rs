//! The text report of the stability margin of a leaf.

use glam::DVec3;

use crate::relax::{Barrier, Direction, Fate, Loss, Margin, Push};

use super::numbers::{bound, brief, point};

/// Decimals of positions that were found on one grid.
const DECIMALS: usize = 3;

/// The lines of the report, the smallest push first.
pub fn lines(margin: &Margin) -> Vec<String> {
    let lost = margin.pushes.iter().filter(|push| push.force.is_some());
    let mut lines: Vec<String> = lost
        .filter(|push| !push.mirrored)
        .map(|push| destabilizing_push(margin, push))
        .collect();
    lines.extend(stable_directions(margin));
    let unknown = margin.pushes.iter();
    let unknown = unknown.filter(|push| push.kind == Loss::Unknown && !push.mirrored);
    lines.extend(unknown.map(|push| {
        let least = force(margin, push.more_than.unwrap_or_default());
        let why = push.remark.as_deref().unwrap_or_default();
        let which = directions(margin, push);
        format!("a push {which} is known up to {least} only, under which it is stable: {why}")
    }));
    match &margin.barrier {
        Some(found) => lines.push(barrier(margin, found)),
        None if margin.climbs > 0 => {
            let what = "no pass to another equilibrium found";
            lines.push(format!("{what} from {} places", margin.climbs));
        }
        None => {}
    }
    lines.extend(margin.remark.clone());
    lines
}

/// A push under which stability is lost.
fn destabilizing_push(margin: &Margin, push: &Push) -> String {
    let at = force(margin, push.force.unwrap_or_default());
    let then = match push.then {
        Some(Fate::BendsAside) => "makes it bend aside",
        Some(Fate::Snaps) | None => "snaps it",
    };
    let rest = (push.neighbour.as_ref()).map(|it| format!(" to rest with tip {}", tip(it.tip)));
    let error = push.error.map(|error| format!(", within {}", bound(error)));
    let weights = (push.per_weight).map(|part| format!(" ({} weights)", brief(part)));
    let place = match margin.every_tip {
        true => "at every tip",
        false => "at the tip",
    };
    format!(
        "a push of {at} {} {place} {then}{}{}{}",
        directions(margin, push),
        rest.unwrap_or_default(),
        error.unwrap_or_default(),
        weights.unwrap_or_default(),
    )
}

/// Directions in which the leaf stays stable up to the largest push.
fn stable_directions(margin: &Margin) -> Option<String> {
    let none = margin.pushes.iter();
    let none = none.filter(|push| push.kind == Loss::NoneUpTo);
    let none: Vec<String> = none.map(|push| push.direction.to_string()).collect();
    let largest = force(margin, margin.largest_push?);
    (!none.is_empty()).then(|| format!("more than {largest} is needed along {}", none.join(", ")))
}

fn barrier(margin: &Margin, barrier: &Barrier) -> String {
    let energy = with_unit(barrier.energy, margin.units.energy().as_deref());
    let error = (barrier.error).map(|error| format!(" within {}", bound(error)));
    let lifted = barrier.height.map(|height| {
        let height = with_unit(height, margin.units.length.as_deref());
        format!(", as the leaf lifted by {height}")
    });
    format!(
        "barrier of {energy}{}{}, over a saddle with tip {} to rest with tip {}",
        error.unwrap_or_default(),
        lifted.unwrap_or_default(),
        tip(barrier.saddle.tip),
        tip(barrier.neighbour.tip),
    )
}

fn tip(tip: DVec3) -> String {
    point(tip.to_array(), DECIMALS)
}

fn force(margin: &Margin, force: f64) -> String {
    with_unit(force, margin.units.force.as_deref())
}

fn with_unit(value: f64, unit: Option<&str>) -> String {
    match unit {
        Some(unit) => format!("{} {unit}", brief(value)),
        None => brief(value),
    }
}

/// The direction of a push, with that of its mirror image.
fn directions(margin: &Margin, push: &Push) -> String {
    let image = push.direction.opposite();
    let mut pushes = margin.pushes.iter();
    match pushes.any(|other| other.mirrored && other.direction == image) {
        true => format!("{} ({} or {image})", word(push.direction), push.direction),
        false => format!("{} ({})", word(push.direction), push.direction),
    }
}

fn word(direction: Direction) -> &'static str {
    match (direction.axis, direction.negative) {
        (0, false) => "forwards",
        (0, true) => "backwards",
        (1, _) => "sideways",
        (_, false) => "upwards",
        (_, true) => "downwards",
    }
}
