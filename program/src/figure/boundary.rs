//! The boundary of stability: curves in the plane of two numbers, with the index on both
//! sides, and leaves from either side.

use std::collections::BTreeSet;

use super::boundary_sides::{Line, write_indices};
use super::map::{DARKEST_INDEX, fill_index};
use super::stable_ground::shade;
use crate::figure::axes::Axes;
use crate::figure::axis::Axis;
use crate::figure::drawing::{
    Anchor, BLUE, Color, Dash, Drawing, GREEN, INK, PURPLE, SKY, SLATE, Stroke, VERMILION,
};
use crate::figure::labels::Labels;
use crate::figure::layout::{Cell, HEADER, LEFT, PANEL_AXIS, PANEL_TITLE, TICK_SIZE, title};
use crate::figure::markers::Marker;
use crate::figure::page::{Key, MOST_NAMED, new_page};
use crate::figure::quantity::Quantity;
use crate::figure::round::round_step;
use crate::figure::setting::Setting;
use crate::figure::small::SmallPanels;
use crate::figure::veins::{Veins, longest, tips};
use crate::report::numbers::{counted, number_of_veins, power_of_ten, short};
use crate::report::sides;
use crate::report::words::stable_or_index;
use glam::{DVec2, DVec3};
use leafdyn::scenario::{Scenario, Units};
use leafdyn::study::CriticalKind as Kind;
use leafdyn::study::{Boundary, BoundaryMap, BoundaryPoint, LeafBeside};

const DIAGRAM: f64 = 400.0;
/// Right of the panel, for the key.
const KEY: f64 = 210.0;
/// Displacements of a buckled leaf below this fraction of its length are magnified.
const VISIBLE: f64 = 0.1;
/// Most leaves drawn, each at a named point.
const MOST_LEAVES: usize = 4;
/// Colours of neighbouring curves; they also differ in their dashes.
const COLORS: [Color; 6] = [BLUE, VERMILION, GREEN, PURPLE, SLATE, SKY];

pub fn draw(boundary: &Boundary, scenario: &Scenario) -> Drawing {
    let setting = Setting::of(scenario);
    let shown: Vec<DrawnLeaf> = (boundary.curves.iter())
        .flat_map(|curve| (curve.beside.iter()).map(|leaf| DrawnLeaf::new(curve.kind, leaf)))
        .take(MOST_LEAVES)
        .collect();
    let longest = longest(shown.iter().flat_map(|it| &it.leaf.curves));
    let shapes: Vec<Veins> = (shown.iter())
        .map(|it| Veins::through(&it.curves, &it.tips, longest).held_as(scenario))
        .collect();
    let diagram = Cell::left_of_key(HEADER + PANEL_TITLE, DIAGRAM, KEY);
    let below = diagram.end().y + PANEL_AXIS;
    let panels = SmallPanels::holding(shapes.iter(), shown.len(), &setting, below);
    let name = format!("{}: where the index changes", boundary.scenario);
    let mut drawing = new_page(LEFT, &name, &notes(boundary), None);
    drawing.height = panels.end();
    drawing.group("curves", |page| {
        draw_curves(page, boundary, &scenario.units, &shown, diagram)
    });
    drawing.group("leaves", |page| {
        for (number, (veins, shown)) in shapes.iter().zip(&shown).enumerate() {
            let [first, second] = shown.leaf.values.map(short);
            let text = format!("{}, ({first}, {second})", shown.caption);
            panels.draw(page, number, veins, [&letter(number), &text]);
        }
    });
    drawing
}

/// A leaf next to a curve, as it is drawn.
struct DrawnLeaf<'b> {
    leaf: &'b LeafBeside,
    caption: String,
    curves: Vec<Vec<DVec3>>,
    tips: Vec<DVec3>,
}

impl<'b> DrawnLeaf<'b> {
    fn new(kind: Kind, leaf: &'b LeafBeside) -> Self {
        let caption = match (&leaf.fallen_from, kind, leaf.index) {
            (None, _, index) => stable_or_index(index),
            (Some(_), Kind::Fold, _) => "snapped".into(),
            (Some(from), Kind::Branching, _) => return DrawnLeaf::buckled(leaf, from),
        };
        DrawnLeaf {
            leaf,
            caption,
            curves: leaf.curves.clone(),
            tips: leaf.tips.clone(),
        }
    }

    /// Next to a crossing of branches a leaf buckles only little: its displacements are
    /// magnified until they are visible.
    fn buckled(leaf: &'b LeafBeside, from: &[Vec<DVec3>]) -> Self {
        let mut curves = leaf.curves.clone();
        let largest = curves.iter().flatten().zip(from.iter().flatten());
        let largest = largest.map(|(x, y)| x.distance(*y)).fold(0.0, f64::max);
        let visible = VISIBLE * longest(&curves);
        let mut caption = "buckled".to_string();
        if 0.0 < largest && largest < visible {
            let factor = round_step(visible / largest);
            for (x, from) in curves.iter_mut().flatten().zip(from.iter().flatten()) {
                *x = *from + factor * (*x - *from);
            }
            caption += &format!(" ×{}", short(factor));
        }
        let tips = tips(&curves, leaf.tips.len() == 1);
        DrawnLeaf {
            leaf,
            caption,
            curves,
            tips,
        }
    }
}

/// The letter of a leaf in the diagram.
fn letter(number: usize) -> String {
    char::from(b'a' + number as u8).into()
}

fn notes(boundary: &Boundary) -> Vec<String> {
    let points = || boundary.curves.iter().flat_map(|curve| &curve.points);
    let curves = counted(boundary.curves.len(), "curve", "curves");
    let points_on = format!("{} points on {curves}", points().count());
    let mut notes = vec![number_of_veins(boundary.rods), points_on];
    let worst = points().map(|point| point.error).fold(0.0, f64::max);
    if worst > 0.0 {
        notes.push(format!("tips within {}", power_of_ten(worst)));
    }
    let [first, second] = boundary.ranges.map(|ends| ends.map(short).join(" to "));
    notes.push(format!("looked for in {first} and {second}"));
    notes
}

fn draw_curves(
    page: &mut Drawing,
    boundary: &Boundary,
    units: &Units,
    shown: &[DrawnLeaf],
    cell: Cell,
) {
    let points = || boundary.curves.iter().flat_map(|curve| &curve.points);
    let axes = Axes {
        cell,
        across: axis(boundary, units, 0),
        up: axis(boundary, units, 1),
    };
    title(page, cell.corner, "", "curves, and the index on both sides");
    let lines: Vec<Line> = (boundary.curves.iter())
        .map(|curve| Line::of(&axes, boundary, curve))
        .collect();
    let shaded = match &boundary.map {
        Some(map) => {
            draw_cells(page, &axes, boundary, map);
            false
        }
        None => shade(page, looked_at(boundary, &axes), &lines),
    };
    axes.draw(page);
    let at = |point: &BoundaryPoint| (point.values[0], point.values[1]);
    let mut labels = Labels::within(cell);
    for (c, (curve, line)) in boundary.curves.iter().zip(&lines).enumerate() {
        for ends in connected(line.segments()) {
            axes.line(page, &ends, stroke(c, line));
        }
        labels.avoid(&axes, &curve.points.iter().map(at).collect::<Vec<_>>());
    }
    for (kind, marker) in [("cusp", Marker::Diamond), ("crossing", Marker::Ring)] {
        let special = points().filter(|point| point.kind == kind);
        axes.markers(page, special.map(at), marker, INK);
    }
    let places = || (shown.iter()).map(|it| (it.leaf.values[0], it.leaf.values[1]));
    axes.markers(page, places(), Marker::Dot, INK);
    for (number, place) in places().enumerate() {
        if let Some(place) = axes.at(place) {
            labels.add(place, &letter(number));
        }
    }
    labels.draw(page);
    write_indices(page, &lines, &mut labels);
    draw_key(page, boundary, (&lines, shaded), cell);
}

/// The part of the panel in which curves were looked for.
fn looked_at(boundary: &Boundary, axes: &Axes) -> Cell {
    let [first, second] = boundary.ranges;
    let ends = [0, 1].map(|k| axes.at((first[k], second[k])).unwrap_or(axes.cell.corner));
    let (low, high) = (axes.cell.corner, axes.cell.end());
    let corner = ends[0].min(ends[1]).clamp(low, high);
    Cell::new(corner, ends[0].max(ends[1]).clamp(low, high) - corner)
}

/// The stroke of a curve by its number, thicker if it bounds stable ground.
fn stroke(number: usize, line: &Line) -> Stroke {
    Stroke {
        dash: Dash::ALL[number % Dash::ALL.len()],
        ..Stroke::new(
            COLORS[number % COLORS.len()],
            if line.bounds_stable() { 2.0 } else { 1.4 },
        )
    }
}

/// Segments as lines, each as long as one begins where the one before ends.
fn connected(segments: impl Iterator<Item = [DVec2; 2]>) -> Vec<Vec<Option<DVec2>>> {
    let mut lines: Vec<Vec<Option<DVec2>>> = Vec::new();
    for [from, to] in segments {
        match lines.last_mut() {
            Some(line) if line.last() == Some(&Some(from)) => line.push(Some(to)),
            _ => lines.push(vec![Some(from), Some(to)]),
        }
    }
    lines
}

/// Draws the cells of the map, each in the colour of its index.
fn draw_cells(page: &mut Drawing, axes: &Axes, boundary: &Boundary, map: &BoundaryMap) {
    let x = boundary.edges(0, map.first.len());
    let y = boundary.edges(1, map.second.len());
    for (r, row) in map.index.iter().enumerate() {
        for (c, index) in row.iter().enumerate() {
            let corners = [axes.at((x[c], y[r])), axes.at((x[c + 1], y[r + 1]))];
            let ([Some(a), Some(b)], Some(index)) = (corners, index) else {
                continue;
            };
            let corner = a.min(b);
            let cell = Cell::new(corner, a.max(b) - corner);
            fill_index(page, cell, *index);
        }
    }
    for [c, r] in &map.disagreeing {
        if let Some(at) = axes.at((map.first[c - 1], map.second[r - 1])) {
            page.label(at, "×", TICK_SIZE, Anchor::Middle, INK);
        }
    }
}

/// An axis over the values, and the cells of the map if there is one; logarithmic if they are spaced
/// logarithmically. Values increase along it.
fn axis(boundary: &Boundary, units: &Units, which: usize) -> Axis {
    let name = Quantity::of(&boundary.keys[which].to_string(), units).axis();
    let curves = || boundary.curves.iter();
    let points = curves().flat_map(|curve| &curve.points);
    let points = points.map(|point| point.values[which]);
    let beside = curves().flat_map(|curve| &curve.beside);
    let beside = beside.map(|leaf| leaf.values[which]);
    let ends = boundary.ranges[which];
    // Without curves the range is all there is.
    let whole = boundary.map.is_some() || curves().all(|curve| curve.points.is_empty());
    let values = points
        .chain(beside)
        .chain(ends.into_iter().filter(|_| whole));
    match boundary.log[which] {
        false => Axis::holding(&name, values),
        true => {
            let sign = ends[0].signum();
            let decades = values.map(|value| (sign * value).log10());
            Axis {
                sign: Some(sign),
                emphasizes_zero: false,
                ..Axis::holding(&name, decades)
            }
        }
    }
}

fn draw_key(page: &mut Drawing, boundary: &Boundary, (lines, shaded): (&[Line], bool), cell: Cell) {
    let mut key = Key::right_of(cell);
    let more = lines.len().saturating_sub(MOST_NAMED);
    for (c, (curve, line)) in (boundary.curves.iter().zip(lines).enumerate()).take(MOST_NAMED) {
        let what = sides(curve).unwrap_or_else(|| "not verified".into());
        key.line(page, &format!("curve {}", c + 1), &what, stroke(c, line));
    }
    if more > 0 {
        key.entry(page, "", &format!("and {more} more"), |_, _| ());
    }
    if shaded {
        key.entry(page, "", &stable_or_index(0), |page, cell| {
            fill_index(page, cell, 0)
        });
    }
    if let Some(map) = &boundary.map {
        let found = map.index.iter().flatten().flatten();
        let indices: BTreeSet<usize> = found.map(|index| *index.min(&DARKEST_INDEX)).collect();
        for index in indices {
            let more = if index == DARKEST_INDEX {
                " or more"
            } else {
                ""
            };
            let name = stable_or_index(index) + more;
            key.entry(page, "", &name, |page, cell| fill_index(page, cell, index));
        }
    }
    let points = || boundary.curves.iter().flat_map(|curve| &curve.points);
    for (kind, marker) in [("cusp", Marker::Diamond), ("crossing", Marker::Ring)] {
        if points().any(|point| point.kind == kind) {
            key.marker(page, kind, "", marker, INK);
        }
    }
}
