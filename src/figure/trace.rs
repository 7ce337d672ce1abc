//! Branches of equilibria: a coordinate of the tip against the number that
//! varies, and the leaf at some of the points.

use glam::{DVec2, DVec3};

use super::Pictured;
use super::colors::{CURVES, INK, WHITE};
use super::curves::{Axes, Range};
use super::drawing::{Anchor, Drawing, HALF_CAPITAL, Stroke, circle, polygon};
use super::energy::short;
use super::flat::title;
use super::header::{self, HEADER};
use super::page::{Cell, LEFT, PANEL_AXIS, PANEL_TITLE, RIGHT, TICK_SIZE, WIDTH};
use super::small::{SmallLeaf, small_height, small_leaves};
use crate::report::numbers::power_of_ten;
use crate::report::words::branch_end;
use crate::study::{PointKind, Trace, TraceBranch, TracePoint};

const DIAGRAM: f64 = 380.0;
/// Right of the panel, for the key.
const KEY: f64 = 190.0;
const LAW: f64 = 240.0;
const BETWEEN: f64 = 26.0;
const BOTTOM: f64 = 10.0;

/// Leaves drawn.
const MOST_LEAVES: usize = 8;

/// Length of a dash and of the gap after it.
const DASH: f64 = 5.0;

impl Pictured for Trace {
    const SVG: &'static str = "trace.svg";
    const PNG: &'static str = "trace.png";

    fn draw(&self) -> Drawing {
        let shown = shown(self);
        let law = match self.law {
            Some(_) => PANEL_TITLE + LAW + PANEL_AXIS + BETWEEN,
            None => 0.0,
        };
        let diagram = HEADER + PANEL_TITLE;
        let leaves = diagram + DIAGRAM + PANEL_AXIS + law;
        let name = format!("{}: equilibria along {}", self.scenario, self.keys);
        let mut drawing = Drawing {
            width: WIDTH,
            height: leaves + small_height(shown.len()) + BOTTOM,
            description: name.clone(),
            marks: Vec::new(),
        };
        drawing.group("header", |page| {
            header::draw_without_key(page, &name, &notes(self));
        });
        let cell = |top: f64, height: f64| Cell {
            corner: DVec2::new(LEFT, top),
            size: DVec2::new(WIDTH - LEFT - RIGHT - KEY, height),
        };
        drawing.group("branches", |page| {
            branches(page, self, &shown, cell(diagram, DIAGRAM));
        });
        if self.law.is_some() {
            let top = diagram + DIAGRAM + PANEL_AXIS + PANEL_TITLE + BETWEEN;
            drawing.group("law", |page| hooke(page, self, cell(top, LAW)));
        }
        drawing.group("leaves", |page| {
            small_leaves(page, &self::leaves(self, &shown), leaves);
        });
        drawing
    }
}

fn notes(trace: &Trace) -> Vec<String> {
    let rods = match trace.rods {
        1 => "1 vein".into(),
        rods => format!("{rods} veins"),
    };
    let points: usize = trace.branches.iter().map(|b| b.points.len()).sum();
    let mut notes = vec![
        rods,
        match trace.branches.len() {
            1 => format!("{points} points"),
            branches => format!("{points} points on {branches} branches"),
        },
        format!("followed on {} segments a vein", trace.segments),
    ];
    let errors = trace.branches.iter().flat_map(|b| &b.points);
    let worst = errors.filter_map(|p| p.error).fold(0.0, f64::max);
    if worst > 0.0 {
        notes.push(format!("tips within {}", power_of_ten(worst)));
    }
    notes
}

/// The points whose leaves are drawn: where branches begin and end, and where
/// the index changes.
fn shown(trace: &Trace) -> Vec<[usize; 2]> {
    let mut wanted: Vec<(usize, [usize; 2])> = Vec::new();
    for (b, branch) in trace.branches.iter().enumerate() {
        let Some(last) = branch.points.len().checked_sub(1) else {
            continue;
        };
        if b == 0 {
            wanted.push((0, [b, 0]));
        }
        wanted.push((1 + b.min(1), [b, last]));
        let critical = branch.critical().map(|(p, _)| (3, [b, p]));
        wanted.extend(critical);
    }
    wanted.sort_by_key(|&(rank, _)| rank);
    let mut shown: Vec<[usize; 2]> = Vec::new();
    for (_, at) in wanted {
        if shown.len() < MOST_LEAVES && !shown.contains(&at) {
            shown.push(at);
        }
    }
    shown.sort_unstable();
    shown
}

/// The axis along which the tip goes furthest.
fn axis(trace: &Trace) -> usize {
    let tips = || {
        let points = trace.branches.iter().flat_map(|branch| &branch.points);
        points.filter_map(|point| point.tips.first())
    };
    let low = tips().fold(DVec3::INFINITY, |low, tip| low.min(*tip));
    let high = tips().fold(DVec3::NEG_INFINITY, |high, tip| high.max(*tip));
    let way = high - low;
    (0..3)
        .max_by(|&a, &b| way[a].total_cmp(&way[b]))
        .unwrap_or(2)
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// A name with its unit, if that is known.
fn with_unit(name: &str, unit: &Option<String>) -> String {
    match unit {
        Some(unit) => format!("{name} ({unit})"),
        None => name.into(),
    }
}

fn branches(page: &mut Drawing, trace: &Trace, shown: &[[usize; 2]], cell: Cell) {
    let axis = axis(trace);
    let at = |point: &TracePoint| {
        let tip = point.tips.first().map_or(f64::NAN, |tip| tip[axis]);
        (point.value, tip)
    };
    let all = || trace.branches.iter().flat_map(|branch| &branch.points);
    let axes = Axes {
        cell,
        across: Range::of(all().map(|p| at(p).0)).airy(),
        up: Range::of(all().map(|p| at(p).1)).airy(),
    };
    title(
        page,
        cell.corner,
        "(a)",
        "equilibria: stable drawn solid, unstable dashed",
    );
    let tip = format!("{} of the tip", AXES[axis]);
    let across = match trace.keys.to_string() {
        force if force.starts_with("load.tip_force") => with_unit(&force, &trace.units.force),
        other => other,
    };
    axes.draw(page, &across, &with_unit(&tip, &trace.units.length));
    for (b, branch) in trace.branches.iter().enumerate() {
        let color = CURVES[b % CURVES.len()];
        let entrance = branch.from.map(|[b, p]| &trace.branches[b].points[p]);
        for (points, stable) in pieces(entrance, branch) {
            let line: Vec<DVec2> = points.iter().map(|p| axes.at(at(p))).collect();
            let width = if stable { 2.0 } else { 1.2 };
            let stroke = Stroke::new(color, width);
            match stable {
                true => line.windows(2).for_each(|w| page.line(w[0], w[1], stroke)),
                false => dashes(page, &line, stroke),
            }
        }
        if b < 8 {
            let name = match branch.from {
                None => "first branch".into(),
                Some([from, _]) => format!("branch {}, off branch {}", b + 1, from + 1),
            };
            axes.key(page, b, color, &name, branch_end(branch.end));
        }
    }
    for branch in &trace.branches {
        for (_, point) in branch.critical() {
            critical_marker(page, axes.at(at(point)), point.kind);
        }
    }
    for (number, &[b, p]) in shown.iter().enumerate() {
        let place = axes.at(at(&trace.branches[b].points[p]));
        let beside = place + DVec2::new(7.0, -6.0);
        page.label(
            beside,
            &(number + 1).to_string(),
            TICK_SIZE,
            Anchor::Start,
            INK,
        );
    }
    markers_key(page, cell, trace.branches.len().min(8));
}

/// The points of a branch, with that from which it was entered, in pieces of one
/// stability each; a piece begins where the one before it ends.
fn pieces<'t>(
    entrance: Option<&'t TracePoint>,
    branch: &'t TraceBranch,
) -> Vec<(Vec<&'t TracePoint>, bool)> {
    let mut pieces: Vec<(Vec<&TracePoint>, bool)> = Vec::new();
    if let (Some(entrance), Some(first)) = (entrance, branch.points.first()) {
        pieces.push((vec![entrance, first], first.index == 0));
    }
    for pair in branch.points.windows(2) {
        // The index of a critical point is that behind it.
        let stable = pair[0].index == 0;
        match pieces.last_mut() {
            Some((points, same)) if *same == stable => points.push(&pair[1]),
            _ => pieces.push((vec![&pair[0], &pair[1]], stable)),
        }
    }
    pieces
}

fn dashes(page: &mut Drawing, line: &[DVec2], stroke: Stroke) {
    let mut gone = 0.0;
    for pair in line.windows(2) {
        let way = pair[1] - pair[0];
        let length = way.length();
        let mut from = 0.0;
        while from < length {
            let phase: f64 = (gone + from) % (2.0 * DASH);
            let left = if phase < DASH {
                DASH - phase
            } else {
                2.0 * DASH - phase
            };
            let to = (from + left.max(1e-3)).min(length);
            if phase < DASH {
                let at = |s: f64| pair[0] + way * (s / length);
                page.line(at(from), at(to), stroke);
            }
            from = to;
        }
        gone += length;
    }
}

fn critical_marker(page: &mut Drawing, at: DVec2, kind: PointKind) {
    let rim = Some(Stroke::new(INK, 1.1));
    match kind {
        PointKind::Fold => page.shape(circle(at, 3.4), WHITE, rim),
        _ => {
            let corner = |x: f64, y: f64| at + 4.6 * DVec2::new(x, y);
            let corners = [
                corner(1.0, 0.0),
                corner(0.0, 1.0),
                corner(-1.0, 0.0),
                corner(0.0, -1.0),
            ];
            page.shape(polygon(&corners), INK, Some(Stroke::new(WHITE, 0.8)));
        }
    }
}

fn markers_key(page: &mut Drawing, cell: Cell, entries: usize) {
    let x = cell.corner.x + cell.size.x + 27.0;
    let y = cell.corner.y + 14.0 + 40.0 * entries as f64;
    let kinds = [
        (PointKind::Branching(1), "branches cross"),
        (PointKind::Fold, "fold"),
    ];
    for (row, (kind, name)) in kinds.into_iter().enumerate() {
        let at = DVec2::new(x, y + 18.0 * row as f64);
        critical_marker(page, at, kind);
        let base = at + DVec2::new(17.0, HALF_CAPITAL * TICK_SIZE);
        page.label(base, name, TICK_SIZE, Anchor::Start, INK);
    }
}

/// Force against displacement of the tip, and the line through it.
fn hooke(page: &mut Drawing, trace: &Trace, cell: Cell) {
    let (Some(law), Some(branch)) = (&trace.law, trace.branches.first()) else {
        return;
    };
    let tip = |point: &TracePoint| point.tips.first().map_or(f64::NAN, |tip| tip[law.axis]);
    let start = branch.points.first().map_or(0.0, tip);
    let points: Vec<(f64, f64)> = branch
        .points
        .iter()
        .map(|p| (tip(p) - start, p.value))
        .collect();
    let axes = Axes {
        cell,
        across: Range::of(points.iter().map(|p| p.0)).airy(),
        up: Range::of(points.iter().map(|p| p.1)).airy(),
    };
    title(
        page,
        cell.corner,
        "(b)",
        "force against displacement of the tip",
    );
    let name = format!("displacement along {}", AXES[law.axis]);
    axes.draw(
        page,
        &with_unit(&name, &trace.units.length),
        &with_unit("force", &trace.units.force),
    );
    let count = points.len() as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let ends = [points.first(), points.last()].map(|end| {
        let across = end.map_or(0.0, |p| p.0);
        (across, y + law.slope * (across - x))
    });
    axes.curve(page, &ends, Stroke::new(CURVES[2], 1.4));
    for point in &points {
        page.shape(circle(axes.at(*point), 1.9), CURVES[0], None);
    }
    let unit = match (&trace.units.force, &trace.units.length) {
        (Some(force), Some(length)) => format!(" {force}/{length}"),
        _ => String::new(),
    };
    axes.key(page, 0, CURVES[0], "equilibria", "of the first branch");
    let slope = format!("slope {}{unit}", short(law.slope));
    axes.key(page, 1, CURVES[2], "line of least squares", &slope);
    let off = format!("off by {} % at most", short(100.0 * law.deviation));
    axes.key(page, 2, WHITE, &format!("R² = {:.6}", law.r_squared), &off);
    if let Some(young) = law.young {
        axes.key(page, 3, WHITE, "Young's modulus", &short(young));
    }
}

/// The leaves at some points, and what each of them is.
fn leaves<'t>(trace: &'t Trace, shown: &[[usize; 2]]) -> Vec<SmallLeaf<'t>> {
    let leaf = |at: &[usize; 2]| {
        let found = &trace.branches[at[0]].points[at[1]];
        let index = match (found.kind, found.index) {
            (PointKind::Regular, 0) => "stable".into(),
            (PointKind::Regular, index) => format!("index {index}"),
            (kind, _) => kind.word().replace('-', " "),
        };
        SmallLeaf {
            curves: &found.curves,
            tips: &found.tips,
            title: format!("at {}, {index}", short(found.value)),
        }
    };
    shown.iter().map(leaf).collect()
}
