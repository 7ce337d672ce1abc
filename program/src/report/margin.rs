//! The stability margin of a leaf, as text.

use glam::DVec3;

use crate::report::numbers::{bound, brief, decimals_within, in_unit, point, rounded_to};
use leafdyn::relax::{Barrier, Direction, Fate, Loss, Margin, Push};
use leafdyn::scenario::Units;
use leafdyn::scenario::units::{ENERGY, FORCE, LENGTH};

/// Part of the longest vein to which positions are told that were found on one grid.
const ON_ONE_GRID: f64 = 1e-3;

/// The lines about a margin of a leaf of this length, the smallest push first.
pub fn margin_lines(margin: &Margin, length: f64, units: &Units) -> Vec<String> {
    let lost = margin.pushes.iter().filter(|push| push.force.is_some());
    let mut lines: Vec<String> = lost
        .filter(|push| !push.mirrored)
        .map(|push| destabilizing_push((margin, push), length, units))
        .collect();
    lines.extend(stable_directions(margin, units));
    let unknown = margin.pushes.iter();
    let unknown = unknown.filter(|push| push.kind == Loss::Unknown && !push.mirrored);
    lines.extend(unknown.map(|push| {
        let why = push.remark.as_deref().unwrap_or_default();
        let which = directions(margin, push);
        match push.more_than.filter(|least| *least > 0.0) {
            Some(least) => {
                let least = force(units, least);
                format!(
                    "a push {which} is known up to {least} only, under which it is stable: {why}"
                )
            }
            None => format!("the effect of a push {which} is not known: {why}"),
        }
    }));
    match &margin.barrier {
        Some(found) => lines.push(barrier(found, length, units)),
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
fn destabilizing_push((margin, push): (&Margin, &Push), length: f64, units: &Units) -> String {
    let error = push.error.unwrap_or(0.0);
    let exact = push.force.unwrap_or_default();
    let at = force(units, rounded_to(exact, error));
    let then = match push.then {
        Some(Fate::BendsAside) => "makes it bend aside",
        Some(Fate::Snaps) | None => "snaps it",
    };
    let rest = (push.neighbour.as_ref())
        .map(|it| format!(" to rest with tip {}", tip(it.tip, length, units)));
    let within = push.error.map(|error| in_unit(bound(error), units, FORCE));
    let within = within.map(|error| format!(", within {error}"));
    let weights = push.per_weight.map(|part| {
        let part = rounded_to(part, part * error / exact);
        format!(" ({} weights)", brief(part))
    });
    let place = match margin.every_tip {
        true => "at every tip",
        false => "at the tip",
    };
    format!(
        "a push of {at} {} {place} {then}{}{}{}",
        directions(margin, push),
        rest.unwrap_or_default(),
        within.unwrap_or_default(),
        weights.unwrap_or_default(),
    )
}

/// Directions in which the leaf stays stable up to the largest push.
fn stable_directions(margin: &Margin, units: &Units) -> Option<String> {
    let none = margin.pushes.iter();
    let none = none.filter(|push| push.kind == Loss::NoneUpTo);
    let none: Vec<String> = none.map(|push| push.direction.to_string()).collect();
    let largest = force(units, margin.largest_push?);
    (!none.is_empty()).then(|| format!("more than {largest} is needed along {}", none.join(", ")))
}

fn barrier(barrier: &Barrier, length: f64, units: &Units) -> String {
    let energy = rounded_to(barrier.energy, barrier.error.unwrap_or(0.0));
    let energy = in_unit(brief(energy), units, ENERGY);
    let error = barrier
        .error
        .map(|error| in_unit(bound(error), units, ENERGY));
    let error = error.map(|error| format!(" within {error}"));
    let lifted = barrier.height.map(|height| {
        let height = in_unit(brief(height), units, LENGTH);
        format!(", as the leaf lifted by {height}")
    });
    format!(
        "barrier of {energy}{}{}, over a saddle with tip {} to rest with tip {}",
        error.unwrap_or_default(),
        lifted.unwrap_or_default(),
        tip(barrier.saddle.tip, length, units),
        tip(barrier.neighbour.tip, length, units),
    )
}

pub fn tip(tip: DVec3, length: f64, units: &Units) -> String {
    let tip = point(tip.to_array(), decimals_within(ON_ONE_GRID * length));
    in_unit(tip, units, LENGTH)
}

fn force(units: &Units, force: f64) -> String {
    in_unit(brief(force), units, FORCE)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A position found on one grid has three digits whatever the unit of length.
    #[test]
    fn positions_on_one_grid_have_digits_of_the_leaf() {
        let at = |unit: f64| {
            tip(
                DVec3::new(1.2345, 0.0, -0.5) * unit,
                1.5 * unit,
                &Units::default(),
            )
        };
        assert_eq!(at(1.0), "(1.23, 0, -0.50)");
        assert_eq!(at(1e-3), "(0.00123, 0, -0.00050)");
    }
}
