//! The text reports of a relaxation, with the stability margin of the leaf, and of all
//! equilibria of a leaf.

use glam::DVec3;

use crate::report::Reported;
use crate::report::numbers::{
    ROUNDING, as_accurate, bound, brief, counted, decimals, decimals_within, eigenvalues, grids,
    known, point, power_of_ten, rounded_to, seconds, veins,
};
use crate::report::table::{Lines, labelled};
use crate::report::words::{shooting, stable_or_index, verdict};
use leafdyn::largest::largest;
use leafdyn::relax::{
    Barrier, Direction, Equilibrium, Event, Fate, Loss, Margin, Mode, Outcome, Path, Push,
    Reaction, Sensitivity,
};
use leafdyn::study::{Equilibria, Found};

/// Most modes that are listed.
const MOST_MODES: usize = 6;

impl Reported for Equilibrium {
    fn heading(&self) -> String {
        let (name, veins) = (&self.scenario, veins(self));
        format!("{name}: {veins}, method {}", self.method)
    }

    fn lines(&self) -> Lines {
        let length = self.shape.longest();
        let mut lines = vec![("found", found(self))];
        lines.extend(self.path.as_ref().map(|path| ("path", way(path))));
        if let Some(saddle) = &self.stability.saddle {
            // It was seen on one grid.
            let (index, energy) = (saddle.negative_eigenvalues, brief(saddle.energy));
            let tip = tip(saddle.tip, length);
            let left = format!("a saddle of index {index} with energy {energy} and tip {tip}");
            lines.push(("left", left));
        }
        // Where shooting failed, the shape is not that of the leaf: it has no energy, and
        // its tip is meaningless.
        if let Some(energy) = self.energy.filter(|energy| energy.is_finite()) {
            if let [tip] = self.tips.as_slice() {
                lines.push(("tip", point(tip.to_array(), decimals(self))));
            }
            lines.push(("energy", as_accurate(self, energy, energy)));
        }
        if let Some(reaction) = &self.reaction {
            let error = reaction_error(self, reaction);
            let force = reaction.force.to_array().map(|it| known(it, error));
            let force = force.join(", ");
            lines.push(("reaction", format!("({force}) on the holder of the tip")));
        }
        lines.extend(waves(self).map(|waves| ("waves", waves)));
        lines.push(("error", error(self)));
        lines.extend(modes(self).map(|modes| ("modes", modes)));
        lines.extend(labelled("changes", changes(self)));
        let margin = self.margin.as_ref().map(|it| margin_lines(it, length));
        lines.extend(labelled("margin", margin.unwrap_or_default()));
        if !self.accuracy.segments.is_empty() {
            lines.push(("model", self.model.description.clone()));
        }
        lines
    }

    fn work(&self) -> Option<String> {
        Some(work(self))
    }

    fn remarks(&self) -> Lines {
        let remark = labelled("remark", self.remark.clone());
        [remark, labelled("doubtful", self.doubts.clone())].concat()
    }
}

/// The kind of equilibrium, or the residual.
pub fn found(equilibrium: &Equilibrium) -> String {
    let verdict = verdict(equilibrium);
    let residual = equilibrium.accuracy.residual.filter(|it| it.is_finite());
    match (equilibrium.outcome, residual) {
        (Outcome::NotAtRest | Outcome::Diverged | Outcome::Singular, Some(residual)) => {
            format!("{verdict} (residual {residual:.1e})")
        }
        _ => {
            verdict + &eigenvalues(equilibrium.stability.negative_eigenvalues) + &turns(equilibrium)
        }
    }
}

/// That it is one of a circle of equilibria, if it is.
fn turns(equilibrium: &Equilibrium) -> String {
    match (
        equilibrium.stability.neutral_directions,
        equilibrium.rod_count,
    ) {
        (0, _) => String::new(),
        (1, 1) => ", one of a circle: it turns about its base without resistance".into(),
        (1, _) => ", one of a circle: round veins turn about their base without resistance".into(),
        (count, _) => format!(
            ", one of a family: {count} round veins, or groups of them, turn about their bases \
             without resistance"
        ),
    }
}

/// How the leaf came to its equilibrium.
fn way(path: &Path) -> String {
    match path {
        Path::Released => "released from arcs under all loads".into(),
        Path::Loaded { events, .. } if events.is_empty() => {
            "stable throughout, from the unloaded veins".into()
        }
        Path::Loaded { events, .. } => {
            let events: Vec<String> = events.iter().map(Event::to_string).collect();
            events.join(", then ")
        }
    }
}

/// Error of positions, relative to the length, if none is estimated.
const WITHOUT_ERROR: f64 = 1e-10;

/// Errors of the force on a holder, relative to the forces within the leaf, are so many times those
/// of positions relative to its length: of 48 leaves 14 times at most.
const OF_FORCES: f64 = 20.0;

/// The error of the force on a holder. Where that is small, as on a ring that closes by itself,
/// the forces that bend the leaf and those of clamps tell how accurate it is.
fn reaction_error(equilibrium: &Equilibrium, reaction: &Reaction) -> f64 {
    let longest = equilibrium.shape.longest();
    let moments = reaction.moments.iter().flatten();
    let moment = largest(moments.map(|moment| moment.length()));
    let energy = equilibrium.energy.unwrap_or_default().abs();
    let force = largest([reaction.force.length(), moment / longest, energy / longest]);
    let error = equilibrium.accuracy.error_estimate;
    let relative = error.map_or(WITHOUT_ERROR, |error| error / longest);
    OF_FORCES * relative.max(ROUNDING) * force
}

fn error(equilibrium: &Equilibrium) -> String {
    let source = match equilibrium.accuracy.intervals {
        Some(count) => format!("by {}", shooting(count)),
        None => format!("from {}", grids(equilibrium)),
    };
    let wanted = bound(equilibrium.accuracy.tolerance * equilibrium.shape.longest());
    match equilibrium.accuracy.error_estimate {
        Some(error) => {
            let error = bound(error);
            format!("positions within {error} (wanted {wanted}), {source}")
        }
        None => match equilibrium.accuracy.segments.as_slice() {
            [segments] => format!("not estimated on a single grid of {segments} segments a vein"),
            _ => "not known".into(),
        },
    }
}

/// Part of the height and the length of waves to which these are told: they are measured at
/// stations.
const MEASURED: f64 = 5e-4;

/// The waves along the margins, if any vein has waves.
fn waves(equilibrium: &Equilibrium) -> Option<String> {
    let undulation = &equilibrium.undulation;
    let margin = undulation.margin()?;
    if undulation.veins.iter().all(|vein| vein.waves() == 0.0) {
        return None;
    }
    let load = match margin.tension < 0.0 {
        true => "compression",
        false => "tension",
    };
    let (predicted, number) = (margin.predicted_waves(), margin.load_number);
    let theory = format!("linear theory: {predicted:.1} at |T| L²/A2 = {number:.1} of {load}");
    let (waves, high) = (margin.waves(), margin.amplitude);
    Some(match margin.wavelength {
        Some(long) => {
            let error = equilibrium.accuracy.error_estimate.unwrap_or(0.0);
            let digits = |it: f64| brief(rounded_to(it, error.max(MEASURED * it)));
            let [high, long] = [high, long].map(digits);
            format!("{waves} along the margins, {high} high and {long} long; {theory}")
        }
        None => format!("none along the margins; {theory}"),
    })
}

/// The lowest eigenvalues, as growth rates and frequencies.
fn modes(equilibrium: &Equilibrium) -> Option<String> {
    let Some(modes) = &equilibrium.stability.modes else {
        let asked = equilibrium.stability.mode_shapes;
        return asked.then(|| "not known".into());
    };
    let unstable = |mode: &&Mode| mode.growth().is_some();
    let list = |modes: &mut dyn Iterator<Item = &Mode>| {
        let listed: Vec<String> = modes.take(MOST_MODES).map(rate).collect();
        listed.join(", ")
    };
    let growth = list(&mut modes.iter().filter(unstable));
    let frequencies = list(&mut modes.iter().filter(|mode| !unstable(mode)));
    let phrases = [
        ("growth rates", growth),
        ("lowest frequencies", frequencies),
    ];
    let phrases = phrases.iter().filter(|(_, list)| !list.is_empty());
    let phrases: Vec<String> = phrases
        .map(|(what, list)| format!("{what} {list}"))
        .collect();
    let one_grid = modes.iter().any(|mode| mode.error.is_none());
    let note = if one_grid { " (on one grid)" } else { "" };
    let neutral = modes.iter().filter(|mode| mode.is_neutral()).count();
    let neutral = match neutral > equilibrium.stability.neutral_directions {
        true => {
            "; zero within its error: the leaf can move without resistance, or is at a bifurcation"
        }
        false => "",
    };
    (!phrases.is_empty()).then(|| phrases.join("; ") + note + neutral)
}

/// The growth rate or the frequency of a mode.
fn rate(mode: &Mode) -> String {
    let rate = mode.eigenvalue.abs().sqrt();
    match mode.error {
        _ if mode.is_neutral() => "0".into(),
        Some(error) => brief(rounded_to(rate, 0.5 * error / rate)),
        None => brief(rate),
    }
}

/// How the tip moves when each number changes by 1 %, or by its unit if it is zero.
fn changes(equilibrium: &Equilibrium) -> Vec<String> {
    let change = |found: &Sensitivity| {
        let (by, what) = match found.value == 0.0 {
            true => (1.0, "one unit".into()),
            false => (0.01 * found.value, format!("1 % of {}", brief(found.value))),
        };
        let tips = found.tips.iter().map(|tip| (*tip * by).to_array());
        let error = found.tip_error.unwrap_or(0.0) * by.abs();
        let digits = |it: f64| brief(rounded_to(it, error));
        let tips = tips.map(|tip| format!("({})", tip.map(digits).join(", ")));
        let tips: Vec<String> = tips.take(1).collect();
        format!("{}: by {what} the tip moves {}", found.key, tips.join(""))
    };
    let found = equilibrium.sensitivities.as_deref().unwrap_or_default();
    found.iter().map(change).collect()
}

fn work(equilibrium: &Equilibrium) -> String {
    let work = equilibrium.work;
    let (steps, factorizations, evaluations) =
        (work.steps, work.factorizations, work.force_evaluations);
    let time = seconds(equilibrium.wall_seconds);
    if equilibrium.method.is_shooting() {
        return format!(
            "{steps} corrections, {factorizations} linearisations, {evaluations} evaluations of all slopes in {time}"
        );
    }
    format!(
        "{steps} steps, {factorizations} factorisations, {evaluations} force evaluations in {time}"
    )
}

/// Part of the longest vein to which positions are told that were found on one grid.
const ON_ONE_GRID: f64 = 1e-3;

/// The lines about a margin of a leaf of this length, the smallest push first.
fn margin_lines(margin: &Margin, length: f64) -> Vec<String> {
    let lost = margin.pushes.iter().filter(|push| push.force.is_some());
    let mut lines: Vec<String> = lost
        .filter(|push| !push.mirrored)
        .map(|push| destabilizing_push(margin, push, length))
        .collect();
    lines.extend(stable_directions(margin));
    let unknown = margin.pushes.iter();
    let unknown = unknown.filter(|push| push.kind == Loss::Unknown && !push.mirrored);
    lines.extend(unknown.map(|push| {
        let why = push.remark.as_deref().unwrap_or_default();
        let which = directions(margin, push);
        match push.more_than.filter(|least| *least > 0.0) {
            Some(least) => {
                let least = force(margin, least);
                format!(
                    "a push {which} is known up to {least} only, under which it is stable: {why}"
                )
            }
            None => format!("the effect of a push {which} is not known: {why}"),
        }
    }));
    match &margin.barrier {
        Some(found) => lines.push(barrier(margin, found, length)),
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
fn destabilizing_push(margin: &Margin, push: &Push, length: f64) -> String {
    let error = push.error.unwrap_or(0.0);
    let exact = push.force.unwrap_or_default();
    let at = force(margin, rounded_to(exact, error));
    let then = match push.then {
        Some(Fate::BendsAside) => "makes it bend aside",
        Some(Fate::Snaps) | None => "snaps it",
    };
    let rest =
        (push.neighbour.as_ref()).map(|it| format!(" to rest with tip {}", tip(it.tip, length)));
    let within = push.error.map(|error| format!(", within {}", bound(error)));
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
fn stable_directions(margin: &Margin) -> Option<String> {
    let none = margin.pushes.iter();
    let none = none.filter(|push| push.kind == Loss::NoneUpTo);
    let none: Vec<String> = none.map(|push| push.direction.to_string()).collect();
    let largest = force(margin, margin.largest_push?);
    (!none.is_empty()).then(|| format!("more than {largest} is needed along {}", none.join(", ")))
}

fn barrier(margin: &Margin, barrier: &Barrier, length: f64) -> String {
    let energy = rounded_to(barrier.energy, barrier.error.unwrap_or(0.0));
    let energy = with_unit(energy, margin.units.energy().as_deref());
    let error = (barrier.error).map(|error| format!(" within {}", bound(error)));
    let lifted = barrier.height.map(|height| {
        let height = with_unit(height, margin.units.length.as_deref());
        format!(", as the leaf lifted by {height}")
    });
    format!(
        "barrier of {energy}{}{}, over a saddle with tip {} to rest with tip {}",
        error.unwrap_or_default(),
        lifted.unwrap_or_default(),
        tip(barrier.saddle.tip, length),
        tip(barrier.neighbour.tip, length),
    )
}

fn tip(tip: DVec3, length: f64) -> String {
    point(tip.to_array(), decimals_within(ON_ONE_GRID * length))
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

impl Reported for Equilibria {
    fn heading(&self) -> String {
        let leaf = self.found.first();
        let veins = leaf.map_or("a leaf".into(), |found| veins(&found.equilibrium));
        format!("{}: {veins}, all shapes", self.scenario)
    }

    /// The equilibria, lowest energy first.
    fn lines(&self) -> Lines {
        let found = self.found.iter().enumerate();
        let mut lines = labelled(
            "found",
            found.map(|(number, found)| equilibrium_line(number, found)),
        );
        let stable = |found: &&Found| found.equilibrium.stable() == Some(true);
        let stable = self.found.iter().filter(stable).count();
        let others = self.found.len() - stable;
        let failed = match self.failed {
            0 => String::new(),
            failed => format!(", {failed} of them without coming to rest"),
        };
        let starts = self.starts;
        let count =
            format!("{stable} stable and {others} other equilibria from {starts} starts{failed}");
        lines.push(("starts", count));
        lines
    }

    fn work(&self) -> Option<String> {
        Some(format!("{} in all", seconds(self.wall_seconds)))
    }

    fn remarks(&self) -> Lines {
        let more = "there may be more: no number of starts proves that these are all";
        let remark = labelled("remark", self.remark.clone());
        [remark, labelled("remark", Some(more.into()))].concat()
    }
}

fn equilibrium_line(number: usize, found: &Found) -> String {
    let leaf = &found.equilibrium;
    let index = leaf.stability.negative_eigenvalues;
    let stability = index.map_or("of unknown stability".into(), stable_or_index);
    let tip = match &leaf.tips[..] {
        [tip] => format!(", tip {}", point(tip.to_array(), decimals(leaf))),
        _ => String::new(),
    };
    let within = match leaf.accuracy.error_estimate {
        Some(error) => format!(", within {}", power_of_ten(error)),
        None => String::new(),
    };
    let plain = if found.plain {
        ", the plain one among them"
    } else {
        ""
    };
    let starts = counted(found.starts, "start", "starts");
    let (number, energy) = (number + 1, leaf.energy.unwrap_or(f64::NAN));
    let energy = as_accurate(leaf, energy, energy);
    format!("{number:>2}. energy {energy}: {stability}{tip}{within} ({starts}{plain})")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A position found on one grid has three digits whatever the unit of length.
    #[test]
    fn positions_on_one_grid_have_digits_of_the_leaf() {
        let at = |unit: f64| tip(DVec3::new(1.2345, 0.0, -0.5) * unit, 1.5 * unit);
        assert_eq!(at(1.0), "(1.23, 0.00, -0.50)");
        assert_eq!(at(1e-3), "(0.00123, 0.00000, -0.00050)");
    }
}
