//! Branches of equilibria: a coordinate of the tip against the number that
//! varies, and the leaf at some of the points.

use crate::figure::drawing::axes::{Axis, PanelAxes};
use crate::figure::drawing::labels::{LabelPlacement, Legend, LegendText, new_page};
use crate::figure::drawing::markers::Marker;
use crate::figure::drawing::space::SmallPanels;
use crate::figure::drawing::veins::{DrawnVeins, longest_curve, magnify_displacements, vein_tips};
use crate::figure::drawing::{
    CURVE_COLORS, Drawing, PAGE, PageRectangle, Stroke, TEXT_COLOR, curve_between_fractions,
    panel_letters,
};
use crate::figure::scenario::{FigureSetting, QuantityLabel, name_with_unit};
use crate::report::numbers::{format_error_bound, format_four_digits, vein_count_text};
use crate::report::{
    branch_end_phrase, error_location_words, passes_crossings, point_stability_phrase, slope_unit,
};
use glam::{DVec2, DVec3};
use leafdyn::scenario::Scenario;
use leafdyn::study::{ForceDisplacementLine, PointKind, Trace, TraceBranch, TracePoint, TraceShow};

/// Heights of the panels of a trace, in pixels.
struct TraceLayout {
    /// The first panel, and further ones.
    diagram: f64,
    further: f64,
    /// The panel of force against displacement, and the gap above it.
    force_line: f64,
    between: f64,
    /// Width right of the panels, for the key.
    key: f64,
    most_leaves: usize,
}

const LAYOUT: TraceLayout = TraceLayout {
    diagram: 380.0,
    further: 220.0,
    force_line: 240.0,
    between: 26.0,
    key: 190.0,
    most_leaves: 8,
};

/// Leaves whose points differ by less, in lengths, look the same in small panels.
const VISIBLE_DIFFERENCE: f64 = 0.04;

/// Equal parts of each vein at whose ends leaves are compared.
const COMPARED_PARTS_PER_VEIN: usize = 8;

/// Least extent, in lengths, of a coordinate of the tip where other branches leave the one that is drawn.
const BRANCHING_EXTENT: f64 = 0.5;

/// Variations of the twist, in radians, and of tips, in lengths, that are rounding.
const ROUNDING_VARIATION: f64 = 1e-7;

pub fn draw(trace: &Trace, scenario: &Scenario) -> Drawing {
    let setting = FigureSetting::from_scenario(scenario);
    let shown = points_with_leaves(trace);
    let point = |&[b, p]: &[usize; 2]| &trace.branches[b].points[p];
    let longest = longest_curve(shown.iter().map(point).flat_map(|point| &point.curves));
    let leaves: Vec<LeafOfTrace> = (shown.iter())
        .map(|&at| LeafOfTrace::new(trace, at))
        .collect();
    let shapes: Vec<DrawnVeins> = (leaves.iter())
        .map(|leaf| {
            DrawnVeins::from_curves(&leaf.curves, &leaf.tips, longest).with_supports(scenario)
        })
        .collect();
    let varied = QuantityLabel::from_keys(&trace.keys.to_string(), &trace.units);
    let quantities = match trace.show.as_slice() {
        [] => vec![most_varying_quantity(trace)],
        asked => asked.to_vec(),
    };
    let name = format!("{}: equilibria, {} varied", trace.scenario, varied.words);
    let mut notes = header_notes(trace);
    if leaves.iter().any(|leaf| leaf.magnified.is_some()) {
        notes.push("×: buckling magnified".into());
    }
    let mut drawing = new_page(PAGE.left_margin, &name, &notes, None);
    let mut letters = panel_letters();
    let mut letter = || letters.next().unwrap_or_default();
    let mut below = PAGE.header;
    for (place, &quantity) in quantities.iter().enumerate() {
        let height = if place == 0 {
            LAYOUT.diagram
        } else {
            LAYOUT.further
        };
        let cell = PageRectangle::left_of_legend(below + PAGE.panel_title, height, LAYOUT.key);
        drawing.draw_group("branches", |page| {
            let axis = varied_number_axis(trace, &varied);
            draw_branches(page, trace, axis, quantity, &shown, cell, &letter());
            if place == 0 {
                draw_legend(page, trace, cell);
            }
        });
        below = cell.opposite_corner().y + PAGE.panel_axis;
    }
    if let (Some(law), Some(branch)) = (&trace.law, trace.branches.first()) {
        let cell = PageRectangle::left_of_legend(
            below + LAYOUT.between + PAGE.panel_title,
            LAYOUT.force_line,
            LAYOUT.key,
        );
        drawing.draw_group("law", |page| {
            draw_force_displacement_line(page, trace, law, branch, cell, &letter())
        });
        below = cell.opposite_corner().y + PAGE.panel_axis;
    }
    let panels = SmallPanels::fitted_to_shapes(shapes.iter(), shown.len(), &setting, below);
    drawing.height = panels.bottom();
    drawing.draw_group("leaves", |page| {
        for (index, (veins, at)) in shapes.iter().zip(&shown).enumerate() {
            let mut caption = leaf_caption(point(at), varied.unit.as_deref());
            if let Some(factor) = leaves[index].magnified {
                caption += &format!(" ×{}", format_four_digits(factor));
            }
            panels.draw_leaf(page, index, veins, [&(index + 1).to_string(), &caption]);
        }
    });
    drawing
}

/// A leaf of a trace as it is drawn.
struct LeafOfTrace {
    curves: Vec<Vec<DVec3>>,
    tips: Vec<DVec3>,
    /// How much larger its displacement from where its branch begins is drawn.
    magnified: Option<f64>,
}

impl LeafOfTrace {
    /// The leaf of a point: on a branch that has just left another one, as it buckles.
    fn new(trace: &Trace, [b, p]: [usize; 2]) -> Self {
        let (branch, point) = (&trace.branches[b], &trace.branches[b].points[p]);
        let mut curves = point.curves.clone();
        let origin = branch.from.map(|[b, p]| &trace.branches[b].points[p]);
        let magnified = origin.and_then(|origin| {
            // Grids are nested: at the stations of the coarser one both have nodes.
            let stations = match origin.stations.len() < point.stations.len() {
                true => &origin.stations,
                false => &point.stations,
            };
            let from = curves_at_stations(origin, stations);
            let mut displaced = curves_at_stations(point, stations);
            let factor = magnify_displacements(&mut displaced, &from)?;
            curves = displaced;
            Some(factor)
        });
        LeafOfTrace {
            tips: match magnified {
                Some(_) => vein_tips(&curves, point.tips.len() == 1),
                None => point.tips.clone(),
            },
            curves,
            magnified,
        }
    }
}

/// The curves of a point at these stations, which may be those of another grid.
fn curves_at_stations(point: &TracePoint, stations: &[f64]) -> Vec<Vec<DVec3>> {
    let at = |curve: &Vec<DVec3>| -> Vec<DVec3> {
        let place =
            |&sigma: &f64| curve_between_fractions(&point.stations, curve, [sigma; 2]).pop();
        stations.iter().filter_map(place).collect()
    };
    point.curves.iter().map(at).collect()
}

fn header_notes(trace: &Trace) -> Vec<String> {
    let points: usize = trace.branches.iter().map(|b| b.points.len()).sum();
    let mut notes = vec![
        vein_count_text(trace.rods),
        match trace.branches.len() {
            1 => format!("{points} points"),
            branches => format!("{points} points on {branches} branches"),
        },
        format!("followed on {} segments a vein", trace.segments),
    ];
    let errors = trace.branches.iter().flat_map(|b| &b.points);
    let worst = errors.filter_map(|p| p.error).fold(0.0, f64::max);
    if worst > 0.0 {
        let (what, worst) = (error_location_words(trace), format_error_bound(worst));
        notes.push(format!("{what} within {worst}"));
    }
    notes
}

/// The points whose leaves are drawn: the ends of branches, points where the index
/// changes, and the middles of branches; only the first of leaves that look the same.
fn points_with_leaves(trace: &Trace) -> Vec<[usize; 2]> {
    let mut wanted: Vec<(usize, [usize; 2])> = Vec::new();
    for (b, branch) in trace.branches.iter().enumerate() {
        let Some(last) = branch.points.len().checked_sub(1) else {
            continue;
        };
        if b == 0 {
            wanted.push((0, [b, 0]));
        }
        wanted.push((1 + b.min(1), [b, last]));
        wanted.extend(branch.critical_points().map(|(p, _)| (3, [b, p])));
        wanted.push((4, [b, last / 2]));
    }
    wanted.sort_by_key(|&(rank, _)| rank);
    let point = |[b, p]: [usize; 2]| &trace.branches[b].points[p];
    // Every branch that has left another one shows how: magnified, if it has not gone far.
    let is_magnified = |[b, p]: [usize; 2]| {
        let is_last = p + 1 == trace.branches[b].points.len();
        is_last && LeafOfTrace::new(trace, [b, p]).magnified.is_some()
    };
    let mut shown: Vec<[usize; 2]> = Vec::new();
    for (_, at) in wanted {
        let alike = |&other: &[usize; 2]| {
            largest_leaf_distance(point(at), point(other)) <= VISIBLE_DIFFERENCE
        };
        let is_new = is_magnified(at) || !shown.iter().any(alike);
        if shown.len() < LAYOUT.most_leaves && is_new {
            shown.push(at);
        }
    }
    shown.sort_unstable();
    shown
}

/// Largest distance between two leaves, in lengths; their grids may differ.
fn largest_leaf_distance(one: &TracePoint, other: &TracePoint) -> f64 {
    let at = |curve: &[DVec3], part: usize| {
        let last = curve.len().saturating_sub(1);
        curve
            .get((part * last + COMPARED_PARTS_PER_VEIN / 2) / COMPARED_PARTS_PER_VEIN)
            .copied()
    };
    let pairs = || one.curves.iter().zip(&other.curves);
    let points = pairs()
        .flat_map(|(a, b)| (0..=COMPARED_PARTS_PER_VEIN).map(move |k| at(a, k).zip(at(b, k))));
    let distances = points.flatten().map(|(a, b)| a.distance(b));
    let size = longest_curve(one.curves.iter().chain(&other.curves));
    distances.fold(0.0, f64::max) / size.max(f64::MIN_POSITIVE)
}

fn leaf_caption(point: &TracePoint, unit: Option<&str>) -> String {
    let kind = match point.kind {
        PointKind::Regular => point_stability_phrase(point),
        kind => kind.word().replace('-', " "),
    };
    let unit = unit.map_or(String::new(), |unit| format!(" {unit}"));
    format!("at {}{unit}, {kind}", format_four_digits(point.value))
}

/// The axis of the number that varies, whose values increase along it: logarithmic if they are
/// spaced logarithmically.
fn varied_number_axis(trace: &Trace, varied: &QuantityLabel) -> Axis {
    let values = trace.branches.iter().flat_map(|branch| &branch.points);
    let sign = trace.log.then(|| trace.range[0].signum());
    Axis::covering_values(&varied.axis_name(), values.map(|point| point.value), sign)
}

/// The coordinate of the tip that varies most; of a leaf that is held the component of a reaction
/// that does.
fn most_varying_quantity(trace: &Trace) -> TraceShow {
    let axes = 0..3;
    let on_grips = |grip: usize| (0..3).map(move |axis| TraceShow::Grip { grip, axis });
    let shown: Vec<TraceShow> = match (trace.held, trace.grips) {
        (false, 0) => axes.map(TraceShow::Tip).collect(),
        (true, 0) => axes.map(TraceShow::Reaction).collect(),
        (_, grips) => (0..grips).flat_map(on_grips).collect(),
    };
    let change = |what: TraceShow| {
        let points = trace.branches.iter().flat_map(|branch| &branch.points);
        let ends = points
            .map(|point| point.figure_value(what))
            .map(|it| (it, it));
        let ends = ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        ends.map_or(0.0, |(low, high)| high - low)
    };
    // Where a leaf buckles and no other branch is followed, its own branch does not move along the axis
    // along which it buckles: that axis tells what happens.
    let mut critical = trace.branches.iter().flat_map(TraceBranch::critical_points);
    let buckling = critical.find(|(_, point)| matches!(point.kind, PointKind::Branching(_)));
    let axis = buckling.and_then(|(_, point)| point.critical_mode_axis);
    if let (Some(axis), false, false, 0) = (axis, trace.switch, trace.held, trace.grips) {
        return TraceShow::Tip(axis);
    }
    let largest = shown
        .into_iter()
        .max_by(|a, b| change(*a).total_cmp(&change(*b)));
    largest.unwrap_or(TraceShow::Tip(2))
}

/// The axis of a quantity with its unit, wide enough that rounding is invisible.
fn quantity_axis(trace: &Trace, quantity: TraceShow) -> Axis {
    let points = || trace.branches.iter().flat_map(|branch| &branch.points);
    let units = &trace.units;
    let (name, least) = match quantity {
        TraceShow::Energy => (name_with_unit("energy", units.energy().as_deref()), 0.0),
        TraceShow::Twist => (
            name_with_unit("mean twist", Some("rad")),
            ROUNDING_VARIATION,
        ),
        TraceShow::Reaction(axis) => {
            let force = format!("reaction along {}", TraceShow::Tip(axis));
            (name_with_unit(&force, units.force.as_deref()), 0.0)
        }
        TraceShow::Grip { grip, axis } => {
            let force = format!("force on grip {} along {}", grip + 1, TraceShow::Tip(axis));
            (name_with_unit(&force, units.force.as_deref()), 0.0)
        }
        tip => {
            let longest = longest_curve(points().take(1).flat_map(|point| &point.curves));
            let name = name_with_unit(&format!("{tip} of the tip"), units.length.as_deref());
            // A branch that others leave has the room in which these would be.
            let least = match passes_crossings(trace) {
                true => BRANCHING_EXTENT,
                false => ROUNDING_VARIATION,
            };
            (name, least * longest)
        }
    };
    Axis::linear_covering(&name, points().map(|point| point.figure_value(quantity)))
        .with_least_extent(least)
}

fn tip_coordinate(point: &TracePoint, axis: usize) -> f64 {
    point.figure_value(TraceShow::Tip(axis))
}

fn draw_branches(
    page: &mut Drawing,
    trace: &Trace,
    across: Axis,
    quantity: TraceShow,
    shown: &[[usize; 2]],
    cell: PageRectangle,
    letter: &str,
) {
    let at = |point: &TracePoint| (point.value, point.figure_value(quantity));
    let all = || trace.branches.iter().flat_map(|branch| &branch.points);
    // The title names only the kinds that occur.
    let indices = [true, false].map(|stable| all().any(|point| (point.index == 0) == stable));
    let what = match indices {
        [true, true] => "equilibria: stable drawn solid, unstable dashed",
        [false, true] => "unstable equilibria",
        _ => "stable equilibria",
    };
    let axes = PanelAxes::draw_titled(
        page,
        cell,
        [letter, what],
        across,
        quantity_axis(trace, quantity),
    );
    let mut labels = LabelPlacement::in_rectangle(cell);
    let mut dashed = Vec::new();
    for (b, branch) in trace.branches.iter().enumerate() {
        let origin = branch.from.map(|[b, p]| &trace.branches[b].points[p]);
        let points: Vec<&TracePoint> = origin.into_iter().chain(&branch.points).collect();
        let line: Vec<(f64, f64)> = points.iter().map(|point| at(point)).collect();
        let drawn = axes.smooth_curve(&line);
        let mut begun = 0;
        for StretchOfBranch { segments, stable } in stretches_of_branch(&points, origin.is_some()) {
            let width = if stable { 2.0 } else { 1.2 };
            let stroke =
                Stroke::new(CURVE_COLORS[b % CURVE_COLORS.len()], width).with_dashes(!stable);
            let piece: Vec<Option<DVec2>> = (drawn[begun..begun + segments].iter())
                .flat_map(|run| {
                    if run.is_empty() {
                        vec![None]
                    } else {
                        run.iter().copied().map(Some).collect()
                    }
                })
                .collect();
            let piece = match stable {
                true => piece,
                false => not_yet_drawn(&piece, &mut dashed),
            };
            axes.draw_clipped_line(page, &piece, stroke);
            begun += segments;
        }
        labels.avoid_curve(&axes, &line);
    }
    for CriticalMarker {
        marker, is_of_kind, ..
    } in CRITICAL_MARKERS.into_iter().rev()
    {
        let critical = trace.branches.iter().flat_map(TraceBranch::critical_points);
        let of_kind = critical.filter(|(_, point)| is_of_kind(point.kind));
        axes.draw_markers(
            page,
            of_kind.map(|(_, point)| at(point)),
            marker,
            TEXT_COLOR,
        );
    }
    for (index, &[b, p]) in shown.iter().enumerate() {
        if let Some(place) = axes.page_position(at(&trace.branches[b].points[p])) {
            labels.request_label(place, &(index + 1).to_string());
        }
    }
    labels.draw_requested(page);
}

/// Distances along and across a line, in pixels.
struct DashLayout {
    /// A line runs along another one up to this distance.
    apart: f64,
    /// A line is compared with what is so far behind on itself.
    behind: f64,
}

const DASHES: DashLayout = DashLayout {
    apart: 0.8,
    behind: 20.0,
};

/// The parts of a line that do not run along one of the `drawn` segments, or back along the line itself,
/// as mirror images do: dashes on dashes would look like a solid line. Adds those parts to the drawn ones.
fn not_yet_drawn(line: &[Option<DVec2>], drawn: &mut Vec<[DVec2; 2]>) -> Vec<Option<DVec2>> {
    let near = |point: DVec2, [from, to]: [DVec2; 2]| {
        let along = to - from;
        let part = (point - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
        point.distance(from + part.clamp(0.0, 1.0) * along) < DASHES.apart
    };
    let mut shown = vec![line.first().copied().flatten()];
    // Segments of the line and how far along it they end, and how many are already among the drawn ones.
    let mut own: Vec<([DVec2; 2], f64)> = Vec::new();
    let (mut gone, mut settled) = (0.0, 0);
    for pair in line.windows(2) {
        let [Some(from), Some(to)] = [pair[0], pair[1]] else {
            shown.push(pair[1]);
            continue;
        };
        while own
            .get(settled)
            .is_some_and(|it| it.1 < gone - DASHES.behind)
        {
            drawn.push(own[settled].0);
            settled += 1;
        }
        let known = |point: DVec2| drawn.iter().any(|it| near(point, *it));
        if [from, from.midpoint(to), to].into_iter().all(known) {
            shown.extend([None, Some(to)]);
        } else {
            shown.push(Some(to));
            own.push(([from, to], gone + from.distance(to)));
        }
        gone += from.distance(to);
    }
    drawn.extend(own.into_iter().skip(settled).map(|it| it.0));
    shown
}

/// Draws the key: the branches, and the kinds of points that occur.
fn draw_legend(page: &mut Drawing, trace: &Trace, cell: PageRectangle) {
    let mut key = Legend::right_of(cell);
    // How all of them end is said once.
    let mut ends = trace
        .branches
        .iter()
        .map(|branch| branch_end_phrase(&branch.end));
    let first = ends.next();
    let shared = first.filter(|first| trace.branches.len() > 1 && ends.all(|end| end == *first));
    let branches = trace.branches.iter().enumerate().map(|(b, branch)| {
        let name = match branch.from {
            None => "first branch".into(),
            Some([from, _]) => format!("branch {}, off branch {}", b + 1, from + 1),
        };
        LegendText {
            name,
            note: match shared {
                Some(_) => String::new(),
                None => branch_end_phrase(&branch.end).into(),
            },
        }
    });
    key.add_curves(page, branches);
    if let Some(end) = shared {
        key.add_entry(page, "", &format!("all {end}"), |_, _| ());
    }
    for CriticalMarker {
        marker,
        name,
        is_of_kind,
    } in CRITICAL_MARKERS
    {
        let mut critical = trace.branches.iter().flat_map(TraceBranch::critical_points);
        if critical.any(|(_, point)| is_of_kind(point.kind)) {
            let how = match marker == Marker::Diamond && passes_crossings(trace) {
                true => "--switch follows the buckled ones",
                false => "",
            };
            key.add_marker(page, name, how, marker, TEXT_COLOR);
        }
    }
}

/// How critical points of a kind are drawn.
struct CriticalMarker {
    marker: Marker,
    name: &'static str,
    is_of_kind: fn(PointKind) -> bool,
}

const CRITICAL_MARKERS: [CriticalMarker; 4] = [
    CriticalMarker {
        marker: Marker::Diamond,
        name: "branches cross",
        is_of_kind: |kind| matches!(kind, PointKind::Branching(_)),
    },
    CriticalMarker {
        marker: Marker::Ring,
        name: "fold",
        is_of_kind: |kind| kind == PointKind::Fold,
    },
    CriticalMarker {
        marker: Marker::Triangle,
        name: "flutter",
        is_of_kind: |kind| kind == PointKind::Flutter,
    },
    CriticalMarker {
        marker: Marker::Square,
        name: "divergence",
        is_of_kind: |kind| kind == PointKind::Divergence,
    },
];

/// Successive segments of a branch that are all stable, or all unstable.
struct StretchOfBranch {
    segments: usize,
    stable: bool,
}

/// The stretches of a branch through these points, one after the other. With an `origin` the first of
/// the points is where the branch leaves another.
fn stretches_of_branch(points: &[&TracePoint], origin: bool) -> Vec<StretchOfBranch> {
    let mut stretches: Vec<StretchOfBranch> = Vec::new();
    for (k, pair) in points.windows(2).enumerate() {
        // The index of a critical point is the one after it, but that of the other branch.
        let of = if origin && k == 0 { pair[1] } else { pair[0] };
        let stable = of.index == 0;
        match stretches.last_mut() {
            Some(last) if last.stable == stable => last.segments += 1,
            _ => stretches.push(StretchOfBranch {
                segments: 1,
                stable,
            }),
        }
    }
    stretches
}

/// Draws force against displacement of the tip, and the fitted line.
fn draw_force_displacement_line(
    page: &mut Drawing,
    trace: &Trace,
    law: &ForceDisplacementLine,
    branch: &TraceBranch,
    cell: PageRectangle,
    letter: &str,
) {
    let start = branch
        .points
        .first()
        .map_or(0.0, |p| tip_coordinate(p, law.axis));
    let points: Vec<(f64, f64)> = (branch.points.iter())
        .map(|point| {
            (
                tip_coordinate(point, law.axis) - start,
                point.force_on_tip(law.axis),
            )
        })
        .collect();
    let units = &trace.units;
    let across = format!("displacement along {}", TraceShow::Tip(law.axis));
    let across = name_with_unit(&across, units.length.as_deref());
    let up = name_with_unit("force", units.force.as_deref());
    let count = points.len() as f64;
    let x = points.iter().map(|p| p.0).sum::<f64>() / count;
    let y = points.iter().map(|p| p.1).sum::<f64>() / count;
    let ends = [points.first(), points.last()].map(|end| {
        let across = end.map_or(0.0, |p| p.0);
        (across, y + law.slope * (across - x))
    });
    // The line may leave the range of the points.
    let drawn = || points.iter().chain(&ends);
    let across = Axis::linear_covering(&across, drawn().map(|p| p.0));
    let up = Axis::linear_covering(&up, drawn().map(|p| p.1));
    let what = "force against displacement of the tip";
    let axes = PanelAxes::draw_titled(page, cell, [letter, what], across, up);
    let line = Stroke::new(CURVE_COLORS[2], 1.4);
    axes.draw_curve(page, &ends, line);
    axes.draw_markers(page, points, Marker::Dot, CURVE_COLORS[0]);
    let mut key = Legend::right_of(cell);
    let which = "of the first branch";
    key.add_marker(page, "equilibria", which, Marker::Dot, CURVE_COLORS[0]);
    let slope = format!(
        "slope {}{}",
        format_four_digits(law.slope),
        slope_unit(units)
    );
    key.add_line(page, "line of least squares", &slope, line);
    let off = format!(
        "off by {} % at most",
        format_four_digits(100.0 * law.deviation)
    );
    key.add_entry(page, &format!("R² = {:.6}", law.r_squared), &off, |_, _| ());
}

#[cfg(test)]
mod tests {
    use super::*;

    fn length(line: &[Option<DVec2>]) -> f64 {
        let pieces = line.windows(2);
        let pieces = pieces.filter_map(|pair| Some(pair[0]?.distance(pair[1]?)));
        pieces.sum()
    }

    /// There and back, and along another line: drawn once. Beside it, and across it: drawn.
    #[test]
    fn dashes_are_not_drawn_over_dashes() {
        let arc = |shift: DVec2| {
            (0..=60).map(move |k| {
                let (sin, cos) = (0.025 * f64::from(k)).sin_cos();
                Some(200.0 * DVec2::new(cos, sin) + shift)
            })
        };
        let once: Vec<_> = arc(DVec2::ZERO).collect();
        let and_back: Vec<_> = arc(DVec2::ZERO).chain(arc(DVec2::ZERO).rev()).collect();
        let mut drawn = Vec::new();
        let shown = length(&not_yet_drawn(&and_back, &mut drawn));
        // Where it turns it is not told from itself yet.
        assert!(
            (shown - length(&once)).abs() < 2.0 * DASHES.behind,
            "{shown}"
        );
        assert_eq!(length(&not_yet_drawn(&once, &mut drawn)), 0.0);
        for line in [
            arc(DVec2::new(2.0, 2.0)).collect::<Vec<_>>(),
            vec![Some(DVec2::ZERO), Some(DVec2::splat(300.0))],
        ] {
            let all = length(&line);
            assert_eq!(length(&not_yet_drawn(&line, &mut drawn.clone())), all);
        }
    }
}
