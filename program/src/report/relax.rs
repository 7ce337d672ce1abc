//! The text report of a relaxation: the leaf at rest, the blade of which it is made, its modes and
//! sensitivities, all of its equilibria, and its stability margin.

use crate::report::document::{
    ReportedResult, relaxation_verdict, shooting_method_name, stability_phrase,
};
use crate::report::numbers::{
    ROUNDING_OF_LENGTHS, count_in_words, decimals_for_error, duration_text, format_as_accurate,
    format_error_bound, format_five_digits, format_position, format_within_error, grids_text,
    negative_eigenvalues_text, number_in_key_unit, number_in_unit, position_decimals,
    position_error_text, round_to_error, tips_text, upper_bound_text, veins_text,
};
use crate::report::table::{LabelledLines, label_first_line};
use glam::DVec3;
use leafdyn::numbers::{format_two_digits, larger, largest};
use leafdyn::relax::{
    Attempt, AxisDirection, Barrier, BladeReport, CriticalTipForce, Equilibrium, EquilibriumDoubt,
    Event, InstabilityKind, Margin, Mode, Model, Outcome, Path, PostcriticalBehavior, Sensitivity,
    SmallMotions,
};
use leafdyn::scenario::units::{
    AREA, COUPLE_STIFFNESS, Dimension, ENERGY, FORCE, FORCE_PER_AREA, LENGTH, MASS, RATE, STRESS,
};
use leafdyn::scenario::{Stress, Units};
use leafdyn::study::{Equilibria, FoundEquilibrium};
use std::f64::consts::TAU;

/// Most modes that are listed.
const MOST_MODES_LISTED: usize = 6;

impl ReportedResult for Equilibrium {
    fn heading(&self) -> String {
        let (name, veins) = (&self.scenario, veins_text(self));
        format!("{name}: {veins}, method {}", self.method)
    }

    fn report_lines(&self, units: &Units) -> LabelledLines {
        let length = self.shape.longest();
        let mut lines = vec![("found", equilibrium_phrase(self))];
        lines.extend(
            self.path
                .as_ref()
                .map(|path| ("path", path_to_equilibrium(path))),
        );
        if let Some(saddle) = &self.stability.saddle {
            // It was seen on one grid.
            let index = saddle.negative_eigenvalues;
            let energy = number_in_unit(format_five_digits(saddle.energy), units, ENERGY);
            let tip = tip_text(saddle.tip, length, units);
            let left = format!("a saddle of index {index} with energy {energy} and tip {tip}");
            lines.push(("left", left));
        }
        // Where shooting failed, the shape is not that of the leaf: it has no energy, and its tip is
        // meaningless. Nor has a leaf under loads without a potential, whose tip is known.
        let is_known = match self.energy {
            Some(energy) => energy.is_finite(),
            None => self.outcome.is_success(),
        };
        if is_known {
            let tips = tips_text(&self.tips, position_decimals(self), units);
            lines.extend(tips.map(|tips| ("tip", tips)));
        }
        if let Some(energy) = self.energy.filter(|energy| energy.is_finite()) {
            let energy = format_as_accurate(self, energy, energy);
            lines.push(("energy", number_in_unit(energy, units, ENERGY)));
        }
        lines.extend(base_line(self, units).map(|base| ("base", base)));
        let moments =
            |all: &Option<Vec<DVec3>>| largest(all.iter().flatten().map(|it| it.length()));
        if let Some(reaction) = &self.reaction {
            let moment = moments(&reaction.moments);
            let force = reaction_text(self, reaction.force, moment, reaction.error);
            let force = number_in_unit(format!("({force})"), units, FORCE);
            lines.push(("reaction", format!("{force} on the holder of the tip")));
        }
        for (number, grip) in self.grip_reactions.iter().enumerate() {
            let moment = grip.moment.map_or(0.0, DVec3::length);
            let force = reaction_text(self, grip.force, moment, grip.error);
            let force = number_in_unit(format!("({force})"), units, FORCE);
            let grip = format!("{force} on the holder of grip {}", number + 1);
            lines.push(("grip", grip));
        }
        lines.extend(largest_stress_line(self, units).map(|stress| ("stress", stress)));
        lines.extend(margin_waves_line(self, units).map(|waves| ("waves", waves)));
        let errors = std::iter::once(error_line(self, units));
        let errors = errors.chain(error_in_veins_lines(self, units));
        lines.extend(label_first_line("error", errors));
        lines.extend(lowest_modes_line(self, units).map(|modes| ("modes", modes)));
        let motions = self.stability.small_motions.as_ref();
        lines.extend(motions.map(|motions| ("motions", small_motions_line(motions, units))));
        lines.extend(label_first_line("changes", tip_change_lines(self, units)));
        let blade = self.blade.as_ref().map(|it| blade_lines(it, units));
        lines.extend(label_first_line("blade", blade.unwrap_or_default()));
        let margin = self.margin.as_ref();
        let margin = margin.map(|it| margin_lines(it, length, units));
        lines.extend(label_first_line("margin", margin.unwrap_or_default()));
        if !self.accuracy.segments.is_empty() {
            lines.push(("model", model_line(&self.model, units)));
        }
        lines
    }

    fn work_line(&self) -> Option<String> {
        Some(solver_work_line(self))
    }

    fn attempt_lines(&self) -> Vec<String> {
        self.attempts.iter().map(Attempt::to_string).collect()
    }

    fn remarks(&self) -> LabelledLines {
        let remark = label_first_line("remark", self.remark.as_ref().map(ToString::to_string));
        let doubts = self.doubts.iter().map(doubt_with_option);
        [remark, label_first_line("doubtful", doubts)].concat()
    }
}

/// A doubt on an equilibrium, with the option that helps.
pub fn doubt_with_option(doubt: &EquilibriumDoubt) -> String {
    match doubt {
        EquilibriumDoubt::UnconfirmedPath | EquilibriumDoubt::UnconfirmedEquilibrium => {
            format!("{doubt}; relax with --all looks for the others")
        }
        _ => doubt.to_string(),
    }
}

/// The kind of equilibrium, or the residual.
pub fn equilibrium_phrase(equilibrium: &Equilibrium) -> String {
    let verdict = relaxation_verdict(equilibrium);
    let residual = equilibrium.accuracy.residual.filter(|it| it.is_finite());
    match (equilibrium.outcome, residual) {
        (
            Outcome::NotAtRest | Outcome::OutOfTime | Outcome::Diverged | Outcome::Singular,
            Some(residual),
        ) => {
            format!("{verdict} (residual {residual:.1e})")
        }
        _ => {
            verdict
                + &negative_eigenvalues_text(equilibrium.stability.negative_eigenvalues)
                + &zero_energy_rotation_line(equilibrium)
        }
    }
}

/// Says that an equilibrium is one of a circle of equilibria, if it is.
fn zero_energy_rotation_line(equilibrium: &Equilibrium) -> String {
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
fn path_to_equilibrium(path: &Path) -> String {
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
const DEFAULT_POSITION_ERROR: f64 = 1e-10;

/// Errors of the force on a holder, relative to the forces within the leaf, are so many times those
/// of positions relative to its length: of 48 leaves 14 times at most.
const FORCE_ERROR_FACTOR: f64 = 20.0;

/// The force on a holder, which may feel a moment as well, to its known digits. Where it is small, as
/// on a ring that closes by itself, the forces that bend the leaf and those of clamps tell how
/// accurate it is.
fn reaction_text(
    equilibrium: &Equilibrium,
    force: DVec3,
    moment: f64,
    error: Option<f64>,
) -> String {
    if let Some(error) = error {
        let rounding = ROUNDING_OF_LENGTHS * force.length();
        return force
            .to_array()
            .map(|it| format_within_error(it, error.max(rounding)))
            .join(", ");
    }
    let longest = equilibrium.shape.longest();
    let energy = equilibrium.energy.unwrap_or_default().abs();
    let most = largest([force.length(), moment / longest, energy / longest]);
    let error = equilibrium.accuracy.error_estimate;
    let relative = error.map_or(DEFAULT_POSITION_ERROR, |error| error / longest);
    let error = FORCE_ERROR_FACTOR * relative.max(ROUNDING_OF_LENGTHS) * most;
    force
        .to_array()
        .map(|it| format_within_error(it, error))
        .join(", ")
}

/// Part of a force or a moment down to which components on bases are told.
const BASE_PRECISION: f64 = 1e-5;

/// The force on the supports of all bases, and the moment.
fn base_line(equilibrium: &Equilibrium, units: &Units) -> Option<String> {
    let on_base = (equilibrium.base_reaction).filter(|_| equilibrium.outcome.is_at_rest())?;
    let text = |vector: DVec3, error: Option<f64>, size: f64, unit: Dimension| {
        let error = error.unwrap_or(0.0).max(BASE_PRECISION * size);
        let text = format_position(vector.to_array(), decimals_for_error(error));
        number_in_unit(text, units, unit)
    };
    let (force, longest) = (on_base.force, equilibrium.shape.longest());
    let moment = on_base.moment.unwrap_or_default();
    let size = larger(force.length(), moment.length() / longest);
    let force = text(force, on_base.error, size, FORCE);
    let moment = text(moment, on_base.moment_error, size * longest, ENERGY);
    let bases = || {
        equilibrium
            .shape
            .rods
            .iter()
            .map(|rod| rod.nodes[0].position)
    };
    let apart = bases().any(|place| Some(place) != bases().next());
    let hinged = equilibrium
        .base_reactions
        .iter()
        .all(|it| it.moment.is_none());
    Some(match (apart, hinged) {
        (true, _) => format!("{force} on its supports, with the moment {moment} about their mean"),
        (false, true) => format!("{force} on its hinge"),
        (false, false) => format!("{force} on its support, with the moment {moment}"),
    })
}

/// What was solved for, and what of the rods' strains matters.
fn model_line(model: &Model, units: &Units) -> String {
    let moves = |effect: Option<f64>, what: &str| {
        let effect = number_in_unit(
            upper_bound_text(effect.filter(|effect| *effect > 0.0)?),
            units,
            LENGTH,
        );
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

fn error_line(equilibrium: &Equilibrium, units: &Units) -> String {
    let source = match equilibrium.accuracy.intervals {
        Some(count) => format!("by {}", shooting_method_name(count)),
        None => format!("from {}", grids_text(equilibrium)),
    };
    let wanted = equilibrium.accuracy.tolerance * equilibrium.shape.longest();
    let wanted = position_error_text(wanted, units);
    match equilibrium.accuracy.error_estimate {
        Some(error) => {
            let error = position_error_text(error, units);
            format!("positions within {error} (wanted {wanted}), {source}")
        }
        None => match equilibrium.accuracy.segments.as_slice() {
            [segments] => format!("not estimated on a single grid of {segments} segments a vein"),
            _ => "not known".into(),
        },
    }
}

/// The part of the largest stress from which on its error is told beside it.
const LARGE_STRESS_ERROR: f64 = 0.05;

/// The largest stress in the sections of a leaf at rest.
fn largest_stress_line(equilibrium: &Equilibrium, units: &Units) -> Option<String> {
    let of = (equilibrium.stress.as_ref()).filter(|_| equilibrium.outcome.is_at_rest())?;
    let Stress {
        normal,
        shear,
        equivalent,
    } = of.largest;
    let place = match of.sigma {
        0.0 => "at its base".into(),
        1.0 => "at its tip".into(),
        sigma => format!("at {} of its length", format_five_digits(sigma)),
    };
    let relative = equilibrium.accuracy.error_estimate.unwrap_or(0.0) / equilibrium.shape.longest();
    let error = of
        .error
        .unwrap_or(FORCE_ERROR_FACTOR * relative * equivalent);
    let [normal, shear, rounded] =
        [normal, shear, equivalent].map(|it| format_five_digits(round_to_error(it, error)));
    let equivalent = match error > LARGE_STRESS_ERROR * equivalent {
        true => format!(
            "{} ± {}",
            format_two_digits(equivalent),
            format_error_bound(error)
        ),
        false => rounded,
    };
    let [normal, shear, equivalent] =
        [normal, shear, equivalent].map(|it| number_in_unit(it, units, STRESS));
    Some(format!(
        "at most {equivalent} in vein {} {place}: normal {normal}, shear {shear}",
        of.vein
    ))
}

/// Part of the height and the length of waves to which these are told: they are measured at
/// stations.
const WAVE_MEASUREMENT_PRECISION: f64 = 5e-4;

/// The waves along the margins, if any vein has waves.
fn margin_waves_line(equilibrium: &Equilibrium, units: &Units) -> Option<String> {
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
                let rounded = round_to_error(it, error.max(WAVE_MEASUREMENT_PRECISION * it));
                number_in_unit(format_five_digits(rounded), units, LENGTH)
            };
            let [high, long] = [high, long].map(digits);
            format!("{waves} along the margins, {high} high and {long} long; {theory}")
        }
        None => format!("none along the margins; {theory}"),
    })
}

/// The lowest eigenvalues, as growth rates per time and frequencies in cycles per time.
fn lowest_modes_line(equilibrium: &Equilibrium, units: &Units) -> Option<String> {
    let Some(modes) = &equilibrium.stability.modes else {
        let stability = &equilibrium.stability;
        let asked = stability.mode_shapes && stability.small_motions.is_none();
        return asked.then(|| "not known".into());
    };
    let unstable = |mode: &&Mode| mode.growth().is_some();
    let list = |modes: &mut dyn Iterator<Item = &Mode>, cycle: f64| {
        let listed = modes
            .take(MOST_MODES_LISTED)
            .map(|mode| growth_rate_text(mode, cycle));
        listed.collect::<Vec<_>>().join(", ")
    };
    let growth = list(&mut modes.iter().filter(unstable), 1.0);
    let frequencies = list(&mut modes.iter().filter(|mode| !unstable(mode)), TAU);
    let per_time = units.unit_name(RATE).unwrap_or("per time".into());
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

/// Growth rates and frequencies of the small motions about an equilibrium without a potential.
fn small_motions_line(motions: &SmallMotions, units: &Units) -> String {
    let per_time = units.unit_name(RATE).unwrap_or("per time".into());
    let cycles = units.frequency().unwrap_or("cycles per time".into());
    let listed = |numbers: &[f64], cycle: f64| {
        let errors = motions.errors.iter().flatten().copied();
        let errors = errors.chain(std::iter::repeat(0.0));
        let numbers = numbers.iter().zip(errors).take(MOST_MODES_LISTED);
        let texts = numbers
            .map(|(it, error)| format_five_digits(round_to_error(it / cycle, error / cycle)));
        texts.collect::<Vec<_>>().join(", ")
    };
    let growth = listed(&motions.growth_rates, 1.0);
    let frequencies = listed(&motions.frequencies, TAU);
    match motions.growth_rates.is_empty() {
        true => "none listed".into(),
        false => format!("growth rates {growth} {per_time}; frequencies {frequencies} {cycles}"),
    }
}

/// The growth rate of a mode, or its frequency with cycles of so many radians.
fn growth_rate_text(mode: &Mode, cycle: f64) -> String {
    let rate = mode.eigenvalue.abs().sqrt();
    match mode.error {
        _ if mode.is_neutral() => "0".into(),
        Some(error) => {
            format_five_digits(round_to_error(rate / cycle, 0.5 * error / (rate * cycle)))
        }
        None => format_five_digits(rate / cycle),
    }
}

/// How the tip moves when each number grows by 1 %, or in proportion to it if it is zero.
fn tip_change_lines(equilibrium: &Equilibrium, units: &Units) -> Vec<String> {
    let change = |found: &Sensitivity| {
        let (key, zero) = (&found.key, found.value == 0.0);
        let by = if zero { 1.0 } else { 0.01 * found.value };
        // Of free tips that which moves most.
        let tips = found.tips.iter().enumerate().rev();
        let most = tips.max_by(|(_, a), (_, b)| a.length().total_cmp(&b.length()));
        let which = match most {
            Some((vein, _)) if found.tips.len() > 1 => {
                format!("the tip of vein {}, most of all, by", vein + 1)
            }
            _ => "the tip by".into(),
        };
        let tip = most.map(|(_, tip)| (*tip * by).to_array());
        let error = found.tip_error.unwrap_or(0.0) * by.abs();
        let digits = |it: f64| format_five_digits(round_to_error(it, error));
        let tip = tip.map(|tip| format!("({})", tip.map(digits).join(", ")));
        let tip = number_in_unit(tip.unwrap_or_default(), units, LENGTH);
        match zero {
            true => {
                let unit = number_in_key_unit("1".into(), units, key);
                format!("{key} is 0: each {unit} of it moves {which} {tip} at first")
            }
            false => format!("+1 % of {key} moves {which} {tip}"),
        }
    };
    let found = equilibrium.sensitivities.as_deref().unwrap_or_default();
    found.iter().map(change).collect()
}

fn solver_work_line(equilibrium: &Equilibrium) -> String {
    let work = equilibrium.work;
    let (steps, factorizations, evaluations) =
        (work.steps, work.factorizations, work.force_evaluations);
    let time = duration_text(equilibrium.wall_seconds);
    if equilibrium.method.is_shooting() {
        return format!(
            "{steps} corrections, {factorizations} linearisations, {evaluations} evaluations of all slopes in {time}"
        );
    }
    format!(
        "{steps} steps, {factorizations} factorisations, {evaluations} force evaluations in {time}"
    )
}

/// The lines about a blade.
fn blade_lines(blade: &BladeReport, units: &Units) -> Vec<String> {
    let length = |it: f64| number_in_unit(format_five_digits(it), units, LENGTH);
    let stiffness = |it: f64| number_in_unit(format_five_digits(it), units, COUPLE_STIFFNESS);
    let mass = |it: f64| match units.grams() {
        Some(grams) => format!("; its mass is {} g", format_five_digits(grams * it)),
        None => format!(
            "; its mass is {}",
            number_in_unit(format_five_digits(it), units, MASS)
        ),
    };
    let mut lines = vec![format!(
        "of the area {}; at its widest, {}, its bending stiffness is {} (E I of a strip that is free to curve across; held flat \
         it has 1/(1 - poisson²) times that) and its torsional stiffness {}{}",
        number_in_unit(format_five_digits(blade.area), units, AREA),
        length(blade.width),
        stiffness(blade.bending),
        stiffness(blade.torsion),
        blade.mass.map(mass).unwrap_or_default()
    )];
    let [a1, a2, a3] = blade.couple_stiffness.map(stiffness);
    let strip = length(blade.strip_width);
    lines.push(format!(
        "each vein there: a strip {strip} wide, torsion {a1}, bending_2 {a2}, bending_3 {a3}"
    ));
    if let Some(tissue) = blade.tissue {
        let across = number_in_unit(format_five_digits(tissue.across), units, FORCE_PER_AREA);
        let fold = number_in_unit(format_five_digits(tissue.fold), units, FORCE);
        lines.push(format!(
            "tissue there: across {across}, fold {fold}, contraction {}",
            length(tissue.contraction)
        ));
    }
    if let Some(least) = blade.least_width {
        let effect = blade.least_width_effect;
        let effect = effect.map(|it| position_error_text(it, units));
        let effect = effect.map(|it| format!("; half of that moves it by {it}"));
        lines.push(format!(
            "where narrower than {} it is as stiff as there{}",
            length(least),
            effect.unwrap_or_default()
        ));
    }
    lines
}

/// The lines on the error in veins of a blade, if it was asked for.
fn error_in_veins_lines(equilibrium: &Equilibrium, units: &Units) -> Vec<String> {
    let Some(blade) = &equilibrium.blade else {
        return Vec::new();
    };
    let about = |error: f64| number_in_unit(format_two_digits(error), units, LENGTH);
    let remark = blade.error_in_veins_remark.as_ref();
    let mut lines = Vec::new();
    match (blade.error_in_veins, blade.half_as_many) {
        (Some(error), Some(fewer)) => {
            let (rods, more) = (equilibrium.rod_count, 2 * equilibrium.rod_count - 1);
            let known = format!(
                "in veins about {} (of {rods}, from the same blade with {}",
                about(error),
                fewer.rods
            );
            // An error of second order, on half the distances.
            lines.push(match remark {
                Some(remark) => format!("{known}; {remark})"),
                None => format!(
                    "{known}; {more} would make it about {})",
                    about(error / 4.0)
                ),
            });
        }
        _ => lines.extend(remark.map(|remark| format!("in veins not known: {remark}"))),
    }
    if !blade.veins_tried.is_empty() {
        let tried = blade.veins_tried.iter().map(|tried| {
            let error = tried.error_in_veins.map_or("not known".into(), about);
            format!("with {} {error}", tried.rods)
        });
        let tried: Vec<String> = tried.collect();
        lines.push(format!("in veins of those tried: {}", tried.join(", ")));
    }
    lines
}

impl ReportedResult for Equilibria {
    fn heading(&self) -> String {
        let leaf = self.found.first();
        let veins = leaf.map_or("a leaf".into(), |found| veins_text(&found.equilibrium));
        format!("{}: {veins}, all shapes", self.scenario)
    }

    /// The equilibria, lowest energy first.
    fn report_lines(&self, units: &Units) -> LabelledLines {
        let found = self.found.iter().enumerate();
        let mut lines = label_first_line(
            "found",
            found.map(|(number, found)| equilibrium_line(number, found, units)),
        );
        let stable = |found: &&FoundEquilibrium| found.equilibrium.stable() == Some(true);
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

    fn work_line(&self) -> Option<String> {
        Some(format!("{} in all", duration_text(self.wall_seconds)))
    }

    fn remarks(&self) -> LabelledLines {
        let more = "there may be more: no number of starts proves that these are all";
        let remark = label_first_line("remark", self.remark());
        [remark, label_first_line("remark", Some(more.into()))].concat()
    }
}

fn equilibrium_line(number: usize, found: &FoundEquilibrium, units: &Units) -> String {
    let leaf = &found.equilibrium;
    let index = leaf.stability.negative_eigenvalues;
    let stability = index.map_or("of unknown stability".into(), stability_phrase);
    let tips = tips_text(&leaf.tips, position_decimals(leaf), units);
    let tip = tips.map_or(String::new(), |tips| format!(", tip {tips}"));
    let within = match leaf.accuracy.error_estimate {
        Some(error) => format!(", within {}", position_error_text(error, units)),
        None => String::new(),
    };
    let plain = if found.plain {
        ", the plain one among them"
    } else {
        ""
    };
    let starts = count_in_words(found.starts, "start", "starts");
    let (number, energy) = (number + 1, leaf.energy.unwrap_or(f64::NAN));
    let energy = number_in_unit(format_as_accurate(leaf, energy, energy), units, ENERGY);
    format!("{number:>2}. energy {energy}: {stability}{tip}{within} ({starts}{plain})")
}

/// Part of the longest vein to which positions are told that were found on one grid.
const SINGLE_GRID_PRECISION: f64 = 1e-3;

/// The lines about a margin of a leaf of this length, the smallest push first.
fn margin_lines(margin: &Margin, length: f64, units: &Units) -> Vec<String> {
    let lost = margin.pushes.iter().filter(|push| push.force.is_some());
    let mut lines: Vec<String> = lost
        .filter(|push| !push.mirrored)
        .map(|push| critical_tip_force_line(margin, push, length, units))
        .collect();
    lines.extend(stable_directions_line(margin, units));
    let unknown = margin.pushes.iter();
    let unknown = unknown.filter(|push| push.kind == InstabilityKind::Unknown && !push.mirrored);
    lines.extend(unknown.map(|push| {
        let why = push.remark.as_ref().map(ToString::to_string);
        let why = why.unwrap_or_default();
        let which = direction_text(margin, push);
        match push.more_than.filter(|least| *least > 0.0) {
            Some(least) => {
                let least = force_text(units, least);
                format!(
                    "a push {which} is known up to {least} only, under which it is stable: {why}"
                )
            }
            None => format!("the effect of a push {which} is not known: {why}"),
        }
    }));
    match &margin.barrier {
        Some(found) => lines.push(energy_barrier_line(found, length, units)),
        None if margin.climbs > 0 => {
            let what = "no pass to another equilibrium found";
            lines.push(format!("{what} from {} places", margin.climbs));
        }
        None => {}
    }
    lines.extend(margin.remark.as_ref().map(ToString::to_string));
    lines
}

/// A push under which stability is lost.
fn critical_tip_force_line(
    margin: &Margin,
    push: &CriticalTipForce,
    length: f64,
    units: &Units,
) -> String {
    let error = push.error.unwrap_or(0.0);
    let exact = push.force.unwrap_or_default();
    let at = force_text(units, round_to_error(exact, error));
    let then = match push.then {
        Some(PostcriticalBehavior::BendsAside) => "makes it bend aside",
        Some(PostcriticalBehavior::Snaps) | None => "snaps it",
    };
    let rest = (push.neighbour.as_ref())
        .map(|it| format!(" to rest with tip {}", tip_text(it.tip, length, units)));
    let within = push
        .error
        .map(|error| number_in_unit(upper_bound_text(error), units, FORCE));
    let within = within.map(|error| format!(", within {error}"));
    let weights = push.per_weight.map(|part| {
        let part = round_to_error(part, part * error / exact);
        format!(" ({} weights)", format_five_digits(part))
    });
    let place = match margin.every_tip {
        true => "at every tip",
        false => "at the tip",
    };
    format!(
        "a push of {at} {} {place} {then}{}{}{}",
        direction_text(margin, push),
        rest.unwrap_or_default(),
        within.unwrap_or_default(),
        weights.unwrap_or_default(),
    )
}

/// Directions in which the leaf stays stable up to the largest push.
fn stable_directions_line(margin: &Margin, units: &Units) -> Option<String> {
    let none = margin.pushes.iter();
    let none = none.filter(|push| push.kind == InstabilityKind::NoneUpTo);
    let none: Vec<String> = none.map(|push| push.direction.to_string()).collect();
    let largest = force_text(units, margin.largest_push?);
    (!none.is_empty()).then(|| format!("more than {largest} is needed along {}", none.join(", ")))
}

fn energy_barrier_line(barrier: &Barrier, length: f64, units: &Units) -> String {
    let energy = round_to_error(barrier.energy, barrier.error.unwrap_or(0.0));
    let energy = number_in_unit(format_five_digits(energy), units, ENERGY);
    let error = barrier
        .error
        .map(|error| number_in_unit(upper_bound_text(error), units, ENERGY));
    let error = error.map(|error| format!(" within {error}"));
    let lifted = barrier.height.map(|height| {
        let height = number_in_unit(format_five_digits(height), units, LENGTH);
        format!(", as the leaf lifted by {height}")
    });
    format!(
        "barrier of {energy}{}{}, over a saddle with tip {} to rest with tip {}",
        error.unwrap_or_default(),
        lifted.unwrap_or_default(),
        tip_text(barrier.saddle.tip, length, units),
        tip_text(barrier.neighbour.tip, length, units),
    )
}

fn tip_text(tip: DVec3, length: f64, units: &Units) -> String {
    let tip = format_position(
        tip.to_array(),
        decimals_for_error(SINGLE_GRID_PRECISION * length),
    );
    number_in_unit(tip, units, LENGTH)
}

fn force_text(units: &Units, force: f64) -> String {
    number_in_unit(format_five_digits(force), units, FORCE)
}

/// The direction of a push, with that of its mirror image.
fn direction_text(margin: &Margin, push: &CriticalTipForce) -> String {
    let image = push.direction.opposite();
    let mut pushes = margin.pushes.iter();
    match pushes.any(|other| other.mirrored && other.direction == image) {
        true => format!(
            "{} ({} or {image})",
            direction_word(push.direction),
            push.direction
        ),
        false => format!("{} ({})", direction_word(push.direction), push.direction),
    }
}

fn direction_word(direction: AxisDirection) -> &'static str {
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
            tip_text(
                DVec3::new(1.2345, 0.0, -0.5) * unit,
                1.5 * unit,
                &Units::default(),
            )
        };
        assert_eq!(at(1.0), "(1.23, 0, -0.50)");
        assert_eq!(at(1e-3), "(0.00123, 0, -0.00050)");
    }
}
