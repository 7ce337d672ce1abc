//! A trace, and a boundary, as text and as rows of CSV: every point of every branch or curve.

use crate::report::document::{ReportedResult, branch_end_phrase, stability_phrase};
use crate::report::numbers;
use crate::report::numbers::{
    ROUNDING_OF_LENGTHS, decimals_for_error, duration_text, format_error_bound, format_five_digits,
    format_four_digits, format_within_error, number_in_unit, position_error_text, round_to_error,
    veins_text_for_count,
};
use crate::report::table::{
    LabelledLines, csv_writer_without_header, label_first_line, table_header,
};
use glam::DVec3;
use leafdyn::scenario::Units;
use leafdyn::scenario::units::{FORCE, FORCE_PER_LENGTH, RATE};
use leafdyn::study::{
    BoundaryCurve, BoundaryMap, BoundaryPoint, BranchEnd, BranchingKind, CorrectorFailure,
    ForceDisplacementLine, PointKind, StabilityBoundary, Trace, TraceBranch, TracePoint,
    VerificationFailure,
};
use serde::Serialize;
use std::f64::consts::TAU;
use std::io;
use std::io::Write;

/// `value` is that of the varied number. Branches and points are numbered from 1. The tip is
/// the joint one, or the first rod's.
const TRACE_COLUMNS: &str = "branch,point,kind,value,value_error,tip_x,tip_y,tip_z,error,energy,\
    negative_eigenvalues,stable,multiplicity,margin_waves,margin_amplitude,twist";

/// Further columns where loads have no potential.
const MOTION_COLUMNS: &str = ",unstable_roots,growth_rate,frequency,motion_error";

/// Further columns if tips are held: the force on their holder.
const REACTION_COLUMNS: &str = ",reaction_x,reaction_y,reaction_z";

/// And with grips: the force on each.
fn grip_reaction_columns(number: usize) -> String {
    let number = number + 1;
    format!(",grip_{number}_x,grip_{number}_y,grip_{number}_z")
}

impl ReportedResult for Trace {
    fn heading(&self) -> String {
        let veins = veins_text_for_count(self.rods, self.joined);
        format!("{}: {veins}, followed", self.scenario)
    }

    fn report_lines(&self, units: &Units) -> LabelledLines {
        let [from, to] = self.range.map(|value| self.keys.text(value));
        let to = number_in_unit(to, units, self.keys.dimension());
        let mut lines = vec![("vary", format!("{} from {from} to {to}", self.keys))];
        let branches = self.branches.iter().enumerate();
        let branches = branches.flat_map(|(number, branch)| branch_lines(self, number, branch));
        lines.extend(label_first_line("branch", branches));
        lines.extend(critical_value_line(self).map(|line| ("critical", line)));
        let assumed = self.assumed.iter().flat_map(|it| it.words());
        let assumed: Vec<&str> = assumed.collect();
        if !assumed.is_empty() {
            lines.push(("assumed", assumed.join(", ")));
        }
        lines.extend(
            self.law
                .iter()
                .map(|law| ("law", force_displacement_line(self, law))),
        );
        let errors = self.branches.iter().flat_map(|branch| &branch.points);
        let errors = errors.filter_map(|point| point.error);
        lines.extend(errors.reduce(f64::max).map(|worst| {
            let (worst, segments) = (position_error_text(worst, units), self.segments);
            let what = error_location_words(self);
            let error = format!("{what} within {worst}, followed on {segments} segments a vein");
            ("error", error)
        }));
        lines
    }

    fn work_line(&self) -> Option<String> {
        let (count, time) = (self.factorizations, duration_text(self.wall_seconds));
        Some(format!("{count} factorisations to follow, {time} in all"))
    }

    fn remarks(&self) -> LabelledLines {
        let remark = label_first_line("remark", self.remark.as_ref().map(ToString::to_string));
        let advice = label_first_line("advice", option_advice(self));
        [
            remark,
            label_first_line("doubtful", self.doubts.iter().map(ToString::to_string)),
            advice,
        ]
        .concat()
    }
}

/// So many losses of stability along a branch suggest that it goes on for ever.
const MANY_STABILITY_LOSSES: usize = 3;

/// Options with which a trace tells more, or less.
fn option_advice(trace: &Trace) -> Vec<String> {
    let mut advice = Vec::new();
    if passes_crossings(trace) {
        advice.push(
            "branches cross here that are not followed: --switch follows the buckled ones".into(),
        );
    }
    let loss = trace.branches.first().and_then(TraceBranch::stability_loss);
    if let (Some((_, point)), None, false) = (loss, &trace.assumed, trace.switch) {
        let value = varied_value_text(trace, point);
        advice.push(format!(
            "relax --all finds the shapes in which the leaf can rest beyond {value}: set {} there",
            trace.keys
        ));
    }
    if trace.until.is_none() {
        let losses = trace.branches.iter().map(TraceBranch::index_increase_count);
        let first = losses
            .enumerate()
            .find(|(_, losses)| *losses >= MANY_STABILITY_LOSSES);
        advice.extend(first.map(|(branch, losses)| {
            let branch = branch + 1;
            format!(
                "branch {branch} passes {losses} points beyond which more modes are unstable: --until unstable ends \
                 branches at the first"
            )
        }));
    }
    advice
}

/// Whether other branches cross those of a trace, and were not to be followed.
pub fn passes_crossings(trace: &Trace) -> bool {
    let mut critical = trace.branches.iter().flat_map(TraceBranch::critical_points);
    !trace.switch && critical.any(|(_, point)| matches!(point.kind, PointKind::Branching(_)))
}

/// Where the first branch loses its stability, and what the leaf does there.
fn critical_value_line(trace: &Trace) -> Option<String> {
    let (_, point) = trace.branches.first()?.stability_loss()?;
    let mode = match point.critical_mode {
        Some(mode) => mode.to_string(),
        None => "buckles".into(),
    };
    let what = match (point.kind, point.branching) {
        // The line of the branch says all.
        (PointKind::Flutter | PointKind::Divergence, _) => return None,
        (PointKind::Fold, _) => "the branch turns back, and the leaf snaps".into(),
        (_, Some(BranchingKind::Supercritical)) => {
            format!("it {mode}, steadily: the buckled branches lie beyond (supercritical)")
        }
        (_, Some(BranchingKind::Subcritical)) => {
            format!("it {mode}, and jumps: the branches that cross lie before (subcritical)")
        }
        (_, Some(kind)) => format!("it {mode} ({})", kind.word()),
        (_, None) => format!("it {mode}"),
    };
    let within = match point.value_error {
        Some(error) => format!(" within {}", bound_in_unit(trace, error)),
        None => String::new(),
    };
    let value = varied_value_text(trace, point);
    Some(format!(
        "stable up to {} = {value}{within}: there {what}",
        trace.keys
    ))
}

/// How a branch ended, its ends and its critical points.
fn branch_lines(trace: &Trace, number: usize, branch: &TraceBranch) -> Vec<String> {
    let from = match branch.from {
        Some([from, _]) => format!(", off branch {}", from + 1),
        None => String::new(),
    };
    let (number, points) = (number + 1, branch.points.len());
    let end = branch_end_phrase(&branch.end);
    let mut lines = vec![format!("{number}{from}: {points} points, {end}")];
    let first = branch.points.first();
    lines.extend(first.map(|point| format!("  from {}", point_values_text(trace, point))));
    let mut before = first.map_or(0, |point| point.index);
    for (_, point) in branch.critical_points() {
        lines.push(format!("  {}", critical_point_line(trace, point, before)));
        before = point.index;
    }
    let last = branch.points.last();
    lines.extend(last.map(|point| format!("  to {}", point_values_text(trace, point))));
    lines.extend(branch.remark().map(|remark| format!("  {remark}")));
    lines
}

/// The fitted line of force against displacement.
fn force_displacement_line(trace: &Trace, law: &ForceDisplacementLine) -> String {
    let unit = slope_unit(&trace.units);
    format!(
        "force against displacement along {}: slope {}{unit}, R² = {:.7}, off the line by {:.2} % at most",
        ['x', 'y', 'z'][law.axis],
        format_five_digits(law.slope),
        law.r_squared,
        100.0 * law.deviation
    )
}

/// The unit of force per displacement after a blank, or nothing if it is not known.
pub fn slope_unit(units: &Units) -> String {
    number_in_unit(String::new(), units, FORCE_PER_LENGTH)
}

pub fn error_location_words(trace: &Trace) -> &'static str {
    match (trace.held, trace.grips) {
        (true, _) => "middles of the veins",
        (false, 0) => "tips",
        (false, _) => "tips and middles of the veins",
    }
}

fn point_values_text(trace: &Trace, point: &TracePoint) -> String {
    let stability = point_stability_phrase(point);
    let tip = match point.tips.first().filter(|_| point.reaction.is_none()) {
        Some(tip) => {
            let error = point.error.unwrap_or(DEFAULT_TIP_ERROR * tip.length());
            let decimals = decimals_for_error(error.max(ROUNDING_OF_LENGTHS * tip.length()));
            let tips = numbers::tips_text(&point.tips, decimals, &trace.units);
            tips.map_or(String::new(), |tips| format!(", tip {tips}"))
        }
        None => String::new(),
    };
    let text = |force: &DVec3| {
        let error = trace.tolerance * force.length();
        let [x, y, z] = force
            .to_array()
            .map(|it| format_four_digits(round_to_error(it, error)).replace('\u{2212}', "-"));
        number_in_unit(format!("({x}, {y}, {z})"), &trace.units, FORCE)
    };
    let reaction = point.reaction.as_ref().map(text);
    let reaction = reaction.map_or(String::new(), |force| format!(", reaction {force}"));
    let grips = point.grip_reactions.iter().enumerate();
    let grips = grips.map(|(k, force)| format!(", on grip {} {}", k + 1, text(force)));
    let value = varied_value_text(trace, point);
    format!(
        "{value}: {stability}{tip}{reaction}{}",
        grips.collect::<String>()
    )
}

/// The number that varies at a point: as it was prescribed, with the digits that its error
/// leaves, or, at a point of no meaning of its own, where it is about.
fn varied_value_text(trace: &Trace, point: &TracePoint) -> String {
    let value = match point.value_error {
        Some(error) => format_within_error(point.value, error),
        None if trace.range.contains(&point.value) => trace.keys.text(point.value),
        None => format_five_digits(point.value),
    };
    number_in_unit(value, &trace.units, trace.keys.dimension())
}

/// A bound on the varied value, with its unit.
fn bound_in_unit(trace: &Trace, error: f64) -> String {
    number_in_unit(
        format_error_bound(error),
        &trace.units,
        trace.keys.dimension(),
    )
}

/// Part of its distance from the base to which a tip without an error is told.
const DEFAULT_TIP_ERROR: f64 = 1e-3;

fn critical_point_line(trace: &Trace, point: &TracePoint, before: usize) -> String {
    let what = match point.kind {
        PointKind::Fold => "fold".into(),
        PointKind::Branching(1) | PointKind::Regular => "branches cross".into(),
        PointKind::Branching(modes) => format!("branches cross in {modes} directions"),
        kind @ (PointKind::Flutter | PointKind::Divergence) => {
            return motion_event_line(trace, point, kind, before);
        }
    };
    let within = match point.value_error {
        Some(error) => format!(", within {}", bound_in_unit(trace, error)),
        None => String::new(),
    };
    let (value, after) = (varied_value_text(trace, point), point.index);
    let mode = point.critical_mode.filter(|_| after > before);
    let mode = mode.map_or(String::new(), |mode| format!(": it {mode}"));
    format!("{what} at {value}{within}: index {before} to {after}{mode}")
}

/// Where growth begins or ends, with the frequency there.
fn motion_event_line(trace: &Trace, point: &TracePoint, kind: PointKind, before: usize) -> String {
    let what = match point.index > before {
        true => "begins",
        false => "ends",
    };
    let within = match point.value_error {
        Some(error) => format!(", within {}", bound_in_unit(trace, error)),
        None => String::new(),
    };
    let dominant = point.motion.and_then(|motion| motion.dominant);
    let frequency = dominant.filter(|it| it.frequency > 0.0).map(|it| {
        let per_time = trace.units.unit_name(RATE).unwrap_or("per time".into());
        let angular = match it.error {
            Some(error) => format_within_error(it.frequency, error),
            None => format_five_digits(it.frequency),
        };
        let cycles = match it.error {
            Some(error) => format_within_error(it.frequency / TAU, error / TAU),
            None => format_five_digits(it.frequency / TAU),
        };
        format!(", angular frequency {angular} {per_time} ({cycles} cycles)")
    });
    let value = varied_value_text(trace, point);
    let unstable = match point.index {
        0 => "stable beyond".into(),
        1 => "1 root grows beyond".into(),
        roots => format!("{roots} roots grow beyond"),
    };
    format!(
        "{} {what} at {value}{within}{}: {unstable}",
        kind.word(),
        frequency.unwrap_or_default()
    )
}

/// The stability of a point, in one phrase.
pub fn point_stability_phrase(point: &TracePoint) -> String {
    match (point.motion, point.stable()) {
        (None, _) => stability_phrase(point.index),
        (Some(_), Some(true)) => "stable".into(),
        (Some(_), Some(false)) => "unstable".into(),
        (Some(_), None) => "of unknown stability".into(),
    }
}

/// `trace.csv`: one row per branch and point.
pub fn write_trace_table(trace: &Trace, out: &mut dyn Write) -> io::Result<()> {
    let (reaction, more) = if trace.held {
        (REACTION_COLUMNS, 3)
    } else {
        ("", 0)
    };
    let grips: String = (0..trace.grips).map(grip_reaction_columns).collect();
    let motion = match trace.assumed {
        Some(_) => MOTION_COLUMNS,
        None => "",
    };
    out.write_all(&table_header(
        &[TRACE_COLUMNS, reaction, &grips, motion].concat(),
    ))?;
    let mut table = csv_writer_without_header(out);
    for (number, branch) in trace.branches.iter().enumerate() {
        for point in &branch.points {
            let reaction = point.reaction.unwrap_or_default().to_array();
            let grips = point
                .grip_reactions
                .iter()
                .flat_map(|force| force.to_array());
            let forces = reaction.into_iter().take(more).chain(grips);
            // Adding zero turns -0 into 0.
            let forces: Vec<f64> = forces.map(|x| x + 0.0).collect();
            let motion = motion_cells(point);
            table.serialize((
                (number + 1, point.point),
                trace_table_cells(point),
                forces,
                motion,
            ))?;
        }
    }
    table.flush()
}

/// The columns of small motions; none with a potential.
fn motion_cells(point: &TracePoint) -> Vec<impl Serialize> {
    let cells = point.motion.map(|motion| {
        let dominant = motion.dominant;
        (
            motion.unstable_roots,
            dominant.map(|it| it.growth_rate),
            dominant.map(|it| it.frequency),
            dominant.and_then(|it| it.error),
        )
    });
    cells.into_iter().collect()
}

/// The columns from `kind` to `twist`.
fn trace_table_cells(point: &TracePoint) -> impl Serialize {
    let tip = point.tips.first();
    // Adding zero turns -0 into 0.
    let tip = tip.map_or([f64::NAN; 3], |tip| tip.to_array().map(|x| x + 0.0));
    let multiplicity = match point.kind {
        PointKind::Branching(modes) => Some(modes),
        _ => None,
    };
    let margin = point.undulation.margin();
    let energy = Some(point.energy).filter(|energy| !energy.is_nan());
    let index = point.motion.is_none().then_some(point.index);
    (
        (point.kind.word(), point.value, point.value_error),
        (tip, point.error, energy),
        (index, point.index == 0, multiplicity),
        margin.map(|vein| vein.waves()),
        margin.map(|vein| vein.amplitude),
        point.undulation.twist() + 0.0,
    )
}

impl ReportedResult for StabilityBoundary {
    fn heading(&self) -> String {
        let veins = veins_text_for_count(self.rods, self.joined);
        format!("{}: {veins}, the boundary", self.scenario)
    }

    fn report_lines(&self, units: &Units) -> LabelledLines {
        let vary = self.keys.iter().zip(self.ranges).map(|(keys, [from, to])| {
            let [from, to] = [from, to].map(|value| keys.text(value));
            let to = number_in_unit(to, units, keys.dimension());
            format!("{keys} from {from} to {to}")
        });
        let mut lines = label_first_line("vary", vary);
        let second = &self.keys[1];
        let start = number_in_unit(second.text(self.start), units, second.dimension());
        let start = format!("at {second} = {start}");
        lines.push(("begun", start));
        let curves = self.curves.iter().enumerate();
        let curves = curves.flat_map(|(number, curve)| curve_lines(self, number, curve));
        lines.extend(label_first_line("curve", curves));
        let points = self.curves.iter().flat_map(|curve| &curve.points);
        let worst = points.map(|point| point.error).reduce(f64::max);
        lines.extend(worst.map(|worst| {
            (
                "error",
                format!("tips within {}", position_error_text(worst, units)),
            )
        }));
        lines.extend(
            (self.map.iter()).flat_map(|map| label_first_line("map", boundary_map_lines(map))),
        );
        lines
    }

    fn work_line(&self) -> Option<String> {
        Some(format!("{} in all", duration_text(self.wall_seconds)))
    }

    fn remarks(&self) -> LabelledLines {
        let remark = label_first_line("remark", self.remark.as_ref().map(ToString::to_string));
        [
            remark,
            label_first_line("doubtful", self.doubts.iter().map(ToString::to_string)),
        ]
        .concat()
    }
}

/// The kind of a curve, its ends and its special points.
fn curve_lines(boundary: &StabilityBoundary, number: usize, curve: &BoundaryCurve) -> Vec<String> {
    let what = index_change_text(curve).unwrap_or_else(|| "no point verified".into());
    let (number, points) = (number + 1, curve.points.len());
    let mut lines = vec![format!("{number}: {points} points, {what}")];
    let end = |label: &str, point: Option<&BoundaryPoint>, end: usize| {
        let phrase = curve_end_phrase(&curve.ends[end]);
        let at = point.map_or(String::new(), |point| boundary_point_text(boundary, point));
        format!("  {label} {at}: {phrase}")
    };
    lines.push(end("from", curve.points.first(), 0));
    let special = curve
        .points
        .iter()
        .filter(|point| is_codimension_two(point));
    lines.extend(special.map(|point| {
        format!(
            "  {} at {}",
            point.kind,
            boundary_point_text(boundary, point)
        )
    }));
    lines.push(end("to", curve.points.last(), 1));
    lines
}

/// How a curve ended on one of its sides, as a phrase.
fn curve_end_phrase(end: &BranchEnd) -> &'static str {
    match end {
        BranchEnd::RangeEndReached | BranchEnd::RangeStartReached => "the end of a range",
        BranchEnd::LoopClosed => "closed",
        BranchEnd::KnownBoundaryMet => "on a curve above",
        BranchEnd::PointLimitReached | BranchEnd::StopCriterionMet => "goes on: allow more points",
        BranchEnd::StabilityLost => "loses its stability",
        BranchEnd::RunLimitReached | BranchEnd::StepFailed(CorrectorFailure::Stopped) => {
            "goes on: stopped"
        }
        BranchEnd::StepFailed(CorrectorFailure::Unfolded) => {
            "the second number breaks the symmetry by which branches cross"
        }
        BranchEnd::StepFailed(CorrectorFailure::Separated) => {
            "modes that become neutral together part"
        }
        BranchEnd::StepFailed(CorrectorFailure::OutOfRange(_)) => "no leaf is there",
        BranchEnd::StepFailed(_) => "lost",
        BranchEnd::PointUnverified(VerificationFailure::Unsolved) => {
            "not verified: finer grids have none"
        }
        BranchEnd::PointUnverified(VerificationFailure::OtherIndex) => {
            "not verified: finer grids have another index"
        }
        BranchEnd::PointUnverified(VerificationFailure::Inaccurate) => {
            "not verified: the tolerance is not reached"
        }
        BranchEnd::PointUnverified(_) => "not verified: finer grids have another curve",
    }
}

/// Most disagreeing cells that are listed.
const MOST_CELLS_LISTED: usize = 5;

/// Whether the map agrees with the curves.
fn boundary_map_lines(map: &BoundaryMap) -> Vec<String> {
    let (columns, rows) = (map.first.len(), map.second.len());
    let verdict = match map.disagreeing.len() {
        0 => "all as the curves say".into(),
        count => format!("{count} not as the curves say: others may begin elsewhere"),
    };
    let known = format!(
        "{} with an equilibrium of the branch",
        map.known_cell_count()
    );
    let mut lines = vec![format!("{columns} x {rows} cells, {known}, {verdict}")];
    let named = map.disagreeing.iter().take(MOST_CELLS_LISTED);
    lines.extend(named.map(|[column, row]| {
        let (first, second) = (map.first[column - 1], map.second[row - 1]);
        let what = map.index[row - 1][column - 1];
        let what = what.map_or("none".into(), |index| format!("index {index}"));
        format!(
            "  at ({}, {}): {what}",
            format_five_digits(first),
            format_five_digits(second)
        )
    }));
    lines
}

/// How the index changes across a curve.
pub fn index_change_text(curve: &BoundaryCurve) -> Option<String> {
    let point = curve.points.first()?;
    let what = match (point.kind, curve.multiplicity) {
        ("fold" | "cusp", _) => "fold".into(),
        (_, 1) => "branches cross".into(),
        (_, modes) => format!("branches cross in {modes} directions"),
    };
    let (before, after) = (point.index_before, point.index_behind);
    Some(format!("{what}: index {before} to {after}"))
}

/// Whether a point is a cusp or a crossing.
pub fn is_codimension_two(point: &BoundaryPoint) -> bool {
    matches!(point.kind, "cusp" | "crossing")
}

fn boundary_point_text(boundary: &StabilityBoundary, point: &BoundaryPoint) -> String {
    let number = |i: usize| match point.errors[i] {
        0.0 => boundary.keys[i].text(point.values[i]),
        error => {
            let value = format_within_error(point.values[i], error);
            format!("{value} within {}", format_error_bound(error))
        }
    };
    format!("({}, {})", number(0), number(1))
}

/// `boundary.csv`: one row per curve and point, with columns named by the keys.
pub fn write_boundary_table(boundary: &StabilityBoundary, out: &mut dyn Write) -> io::Result<()> {
    let [first, second] = &boundary.keys;
    let errors = "error_1,error_2,tip_x,tip_y,tip_z,error,index_before,index_behind";
    out.write_all(&table_header(&format!(
        "curve,point,kind,{first},{second},{errors}"
    )))?;
    let mut table = csv_writer_without_header(out);
    for (number, curve) in boundary.curves.iter().enumerate() {
        for point in &curve.points {
            // The joint tip, or the first rod's; adding zero turns -0 into 0.
            let tip = point.tips.first();
            let tip = tip.map_or([f64::NAN; 3], |tip| tip.to_array());
            table.serialize((
                (number + 1, point.point, point.kind),
                point.values,
                point.errors,
                tip.map(|x| x + 0.0),
                point.error,
                (point.index_before, point.index_behind),
            ))?;
        }
    }
    table.flush()
}
