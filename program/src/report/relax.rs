//! The text report of a relaxation.

use crate::report::Reported;
use crate::report::blade::blade_lines;
use crate::report::margin::{margin_lines, tip};
use crate::report::numbers::{
    ROUNDING, as_accurate, bound, bound_of_positions, brief, decimals, eigenvalues, grids, in_unit,
    in_unit_of_key, known, point, rounded_to, seconds, veins,
};
use crate::report::table::{Lines, labelled};
use crate::report::words::{shooting, verdict};
use glam::DVec3;
use leafdyn::largest::largest;
use leafdyn::relax::{Equilibrium, Event, Mode, Model, Outcome, Path, Sensitivity};
use leafdyn::scenario::units::{ENERGY, FORCE, LENGTH, RATE, STRESS};
use leafdyn::scenario::{Stress, Units};
use std::f64::consts::TAU;

/// Most modes that are listed.
const MOST_MODES: usize = 6;

impl Reported for Equilibrium {
    fn heading(&self) -> String {
        let (name, veins) = (&self.scenario, veins(self));
        format!("{name}: {veins}, method {}", self.method)
    }

    fn lines(&self, units: &Units) -> Lines {
        let length = self.shape.longest();
        let mut lines = vec![("found", found(self))];
        lines.extend(self.path.as_ref().map(|path| ("path", way(path))));
        if let Some(saddle) = &self.stability.saddle {
            // It was seen on one grid.
            let index = saddle.negative_eigenvalues;
            let energy = in_unit(brief(saddle.energy), units, ENERGY);
            let tip = tip(saddle.tip, length, units);
            let left = format!("a saddle of index {index} with energy {energy} and tip {tip}");
            lines.push(("left", left));
        }
        // Where shooting failed, the shape is not that of the leaf: it has no energy, and
        // its tip is meaningless.
        if let Some(energy) = self.energy.filter(|energy| energy.is_finite()) {
            if let [tip] = self.tips.as_slice() {
                let tip = point(tip.to_array(), decimals(self));
                lines.push(("tip", in_unit(tip, units, LENGTH)));
            }
            let energy = as_accurate(self, energy, energy);
            lines.push(("energy", in_unit(energy, units, ENERGY)));
        }
        let moments =
            |all: &Option<Vec<DVec3>>| largest(all.iter().flatten().map(|it| it.length()));
        if let Some(reaction) = &self.reaction {
            let sizes = (reaction.force, moments(&reaction.moments));
            let force = felt(self, sizes, reaction.error);
            let force = in_unit(format!("({force})"), units, FORCE);
            lines.push(("reaction", format!("{force} on the holder of the tip")));
        }
        for (number, grip) in self.grip_reactions.iter().enumerate() {
            let sizes = (grip.force, grip.moment.map_or(0.0, DVec3::length));
            let force = felt(self, sizes, grip.error);
            let force = in_unit(format!("({force})"), units, FORCE);
            let grip = format!("{force} on the holder of grip {}", number + 1);
            lines.push(("grip", grip));
        }
        lines.extend(stress(self, units).map(|stress| ("stress", stress)));
        lines.extend(waves(self, units).map(|waves| ("waves", waves)));
        lines.push(("error", error(self, units)));
        lines.extend(modes(self, units).map(|modes| ("modes", modes)));
        lines.extend(labelled("changes", changes(self, units)));
        let blade = self.blade.as_ref().map(|it| blade_lines(it, units));
        lines.extend(labelled("blade", blade.unwrap_or_default()));
        let margin = self.margin.as_ref();
        let margin = margin.map(|it| margin_lines(it, length, units));
        lines.extend(labelled("margin", margin.unwrap_or_default()));
        if !self.accuracy.segments.is_empty() {
            lines.push(("model", model(&self.model, units)));
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
        (1, _) => ", one of a circle: veins turn about their base without resistance".into(),
        (count, _) => format!(
            ", one of a family: in {count} ways veins turn about their bases without resistance"
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
        Path::Held { events } if events.is_empty() => {
            "stable throughout, while it was moved to where it is held".into()
        }
        Path::Loaded { events, .. } | Path::Held { events } => {
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

/// The force on a holder, which may feel a moment as well, to its known digits. Where it is small, as
/// on a ring that closes by itself, the forces that bend the leaf and those of clamps tell how
/// accurate it is.
fn felt(equilibrium: &Equilibrium, (force, moment): (DVec3, f64), error: Option<f64>) -> String {
    if let Some(error) = error {
        let rounding = ROUNDING * force.length();
        return force
            .to_array()
            .map(|it| known(it, error.max(rounding)))
            .join(", ");
    }
    let longest = equilibrium.shape.longest();
    let energy = equilibrium.energy.unwrap_or_default().abs();
    let most = largest([force.length(), moment / longest, energy / longest]);
    let error = equilibrium.accuracy.error_estimate;
    let relative = error.map_or(WITHOUT_ERROR, |error| error / longest);
    let error = OF_FORCES * relative.max(ROUNDING) * most;
    force.to_array().map(|it| known(it, error)).join(", ")
}

/// What was solved for, and what of the rods' strains matters.
fn model(model: &Model, units: &Units) -> String {
    let moves = |effect: Option<f64>, what: &str| {
        let effect = in_unit(bound(effect.filter(|effect| *effect > 0.0)?), units, LENGTH);
        Some(format!("{what} moves it by {effect}"))
    };
    let effects = [
        moves(model.shear_effect, "shear"),
        moves(model.stretch_effect, "stretch"),
    ];
    let effects = effects.into_iter().flatten();
    let phrases = [model.description.clone()].into_iter().chain(effects);
    phrases.collect::<Vec<_>>().join("; ")
}

fn error(equilibrium: &Equilibrium, units: &Units) -> String {
    let source = match equilibrium.accuracy.intervals {
        Some(count) => format!("by {}", shooting(count)),
        None => format!("from {}", grids(equilibrium)),
    };
    let wanted = equilibrium.accuracy.tolerance * equilibrium.shape.longest();
    let wanted = bound_of_positions(wanted, units);
    match equilibrium.accuracy.error_estimate {
        Some(error) => {
            let error = bound_of_positions(error, units);
            format!("positions within {error} (wanted {wanted}), {source}")
        }
        None => match equilibrium.accuracy.segments.as_slice() {
            [segments] => format!("not estimated on a single grid of {segments} segments a vein"),
            _ => "not known".into(),
        },
    }
}

/// The largest stress in the sections of a leaf at rest.
fn stress(equilibrium: &Equilibrium, units: &Units) -> Option<String> {
    let of = (equilibrium.stress.as_ref()).filter(|_| equilibrium.outcome.is_at_rest())?;
    let Stress {
        normal,
        shear,
        equivalent,
    } = of.largest;
    let place = match of.sigma {
        0.0 => "at its base".into(),
        1.0 => "at its tip".into(),
        sigma => format!("at {} of its length", brief(sigma)),
    };
    let relative = equilibrium.accuracy.error_estimate.unwrap_or(0.0) / equilibrium.shape.longest();
    let error = of.error.unwrap_or(OF_FORCES * relative * equivalent);
    let [normal, shear, equivalent] =
        [normal, shear, equivalent].map(|it| in_unit(brief(rounded_to(it, error)), units, STRESS));
    Some(format!(
        "at most {equivalent} in vein {} {place}: normal {normal}, shear {shear}",
        of.vein
    ))
}

/// Part of the height and the length of waves to which these are told: they are measured at
/// stations.
const MEASURED: f64 = 5e-4;

/// The waves along the margins, if any vein has waves.
fn waves(equilibrium: &Equilibrium, units: &Units) -> Option<String> {
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
            let digits = |it: f64| {
                let rounded = rounded_to(it, error.max(MEASURED * it));
                in_unit(brief(rounded), units, LENGTH)
            };
            let [high, long] = [high, long].map(digits);
            format!("{waves} along the margins, {high} high and {long} long; {theory}")
        }
        None => format!("none along the margins; {theory}"),
    })
}

/// The lowest eigenvalues, as growth rates per time and frequencies in cycles per time.
fn modes(equilibrium: &Equilibrium, units: &Units) -> Option<String> {
    let Some(modes) = &equilibrium.stability.modes else {
        let asked = equilibrium.stability.mode_shapes;
        return asked.then(|| "not known".into());
    };
    let unstable = |mode: &&Mode| mode.growth().is_some();
    let list = |modes: &mut dyn Iterator<Item = &Mode>, cycle: f64| {
        let listed = modes.take(MOST_MODES).map(|mode| rate(mode, cycle));
        listed.collect::<Vec<_>>().join(", ")
    };
    let growth = list(&mut modes.iter().filter(unstable), 1.0);
    let frequencies = list(&mut modes.iter().filter(|mode| !unstable(mode)), TAU);
    let per_time = units.of(RATE).unwrap_or("per time".into());
    let cycles = units.frequency().unwrap_or("cycles per time".into());
    let phrases = [
        ("growth rates", growth, per_time),
        ("lowest frequencies", frequencies, cycles),
    ];
    let phrases = phrases.iter().filter(|(_, list, _)| !list.is_empty());
    let phrases: Vec<String> = phrases
        .map(|(what, list, unit)| format!("{what} {list} {unit}"))
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

/// The growth rate of a mode, or its frequency with cycles of so many radians.
fn rate(mode: &Mode, cycle: f64) -> String {
    let rate = mode.eigenvalue.abs().sqrt();
    match mode.error {
        _ if mode.is_neutral() => "0".into(),
        Some(error) => brief(rounded_to(rate / cycle, 0.5 * error / (rate * cycle))),
        None => brief(rate / cycle),
    }
}

/// How the tip moves when each number grows by 1 %, or in proportion to it if it is zero.
fn changes(equilibrium: &Equilibrium, units: &Units) -> Vec<String> {
    let change = |found: &Sensitivity| {
        let (key, zero) = (&found.key, found.value == 0.0);
        let by = if zero { 1.0 } else { 0.01 * found.value };
        let tip = found.tips.first().map(|tip| (*tip * by).to_array());
        let error = found.tip_error.unwrap_or(0.0) * by.abs();
        let digits = |it: f64| brief(rounded_to(it, error));
        let tip = tip.map(|tip| format!("({})", tip.map(digits).join(", ")));
        let tip = in_unit(tip.unwrap_or_default(), units, LENGTH);
        match zero {
            true => {
                let unit = in_unit_of_key("1".into(), units, key);
                format!("{key} is 0: each {unit} of it moves the tip by {tip} at first")
            }
            false => format!("+1 % of {key} moves the tip by {tip}"),
        }
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
