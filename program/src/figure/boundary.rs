//! The boundary of stability in the plane of two numbers: curves with the index on both sides, shaded
//! ground on which the branch is stable, cells of a coarse map, and leaves from either side of a curve.
//!
//! Labels stand on both sides of a curve where there is room; curves close to each other share them. Ground
//! is stable where all curves around it say so, which is found along rows and columns of the panel.

use crate::figure::drawing::axes::{Axis, PanelAxes};
use crate::figure::drawing::labels::{
    LabelPlacement, Legend, MOST_CURVES_NAMED, clearest_label, label_size, new_page,
};
use crate::figure::drawing::markers::Marker;
use crate::figure::drawing::space::SmallPanels;
use crate::figure::drawing::veins::{DrawnVeins, longest_curve, magnify_displacements, vein_tips};
use crate::figure::drawing::{
    BLUE, Color, DashPattern, Drawing, FONT_SIZE, GREEN, NOTE_COLOR, PAGE, PURPLE, PageRectangle,
    SKY, SLATE, Stroke, TEXT_COLOR, TextAnchor, VERMILION, draw_panel_title, polygon_path,
};
use crate::figure::map::{DARKEST_MORSE_INDEX, STABLE_GROUND_COLOR, fill_cell_by_index};
use crate::figure::scenario::{FigureSetting, QuantityLabel};
use crate::report::numbers::{
    count_in_words, format_error_bound, format_four_digits, vein_count_text,
};
use crate::report::{index_change_text, is_codimension_two, stability_phrase};
use glam::{DVec2, DVec3};
use leafdyn::scenario::{Scenario, Units};
use leafdyn::study::{
    BoundaryCurve, BoundaryMap, BoundaryPoint, CriticalKind, LeafBeside, StabilityBoundary,
};
use std::collections::{BTreeSet, HashMap};

/// Sizes of the diagram, in pixels.
struct BoundaryLayout {
    diagram: f64,
    /// Width right of the panel, for the key.
    key: f64,
    /// Most leaves drawn, each at a named point.
    most_leaves: usize,
}

const LAYOUT: BoundaryLayout = BoundaryLayout {
    diagram: 400.0,
    key: 210.0,
    most_leaves: 4,
};

/// Colors of neighboring curves; they also differ in their dashes.
const BOUNDARY_COLORS: [Color; 6] = [BLUE, VERMILION, GREEN, PURPLE, SLATE, SKY];

pub fn draw(boundary: &StabilityBoundary, scenario: &Scenario) -> Drawing {
    let setting = FigureSetting::from_scenario(scenario);
    let shown: Vec<CaptionedLeaf> = (boundary.curves.iter())
        .flat_map(|curve| (curve.beside.iter()).map(|leaf| CaptionedLeaf::new(curve.kind, leaf)))
        .take(LAYOUT.most_leaves)
        .collect();
    let longest = longest_curve(shown.iter().flat_map(|it| &it.leaf.curves));
    let shapes: Vec<DrawnVeins> = (shown.iter())
        .map(|it| DrawnVeins::from_curves(&it.curves, &it.tips, longest).with_supports(scenario))
        .collect();
    let diagram =
        PageRectangle::left_of_legend(PAGE.header + PAGE.panel_title, LAYOUT.diagram, LAYOUT.key);
    let below = diagram.opposite_corner().y + PAGE.panel_axis;
    let panels = SmallPanels::fitted_to_shapes(shapes.iter(), shown.len(), &setting, below);
    let name = format!("{}: where the index changes", boundary.scenario);
    let mut notes = header_notes(boundary);
    if shown.iter().any(|leaf| leaf.caption.contains('×')) {
        notes.push("×: buckling magnified".into());
    }
    let mut drawing = new_page(PAGE.left_margin, &name, &notes, None);
    drawing.height = panels.bottom();
    drawing.draw_group("curves", |page| {
        draw_curves(page, boundary, &scenario.units, &shown, diagram)
    });
    drawing.draw_group("leaves", |page| {
        for (number, (veins, shown)) in shapes.iter().zip(&shown).enumerate() {
            let [first, second] = shown.leaf.values.map(format_four_digits);
            let text = format!("({first}, {second}): {}", shown.caption);
            panels.draw_leaf(page, number, veins, [&leaf_letter(number), &text]);
        }
    });
    drawing
}

/// A leaf next to a curve, as it is drawn.
struct CaptionedLeaf<'b> {
    leaf: &'b LeafBeside,
    caption: String,
    curves: Vec<Vec<DVec3>>,
    tips: Vec<DVec3>,
}

impl<'b> CaptionedLeaf<'b> {
    fn new(kind: CriticalKind, leaf: &'b LeafBeside) -> Self {
        let caption = match (&leaf.fallen_from, kind, leaf.index) {
            (None, _, index) => stability_phrase(index),
            (Some(_), CriticalKind::Fold, _) => "snapped".into(),
            (Some(from), CriticalKind::Branching, _) => {
                return CaptionedLeaf::with_magnified_displacements(leaf, from);
            }
        };
        CaptionedLeaf {
            leaf,
            caption,
            curves: leaf.curves.clone(),
            tips: leaf.tips.clone(),
        }
    }

    /// Next to a crossing of branches a leaf buckles only little: its displacements are
    /// magnified until they are visible.
    fn with_magnified_displacements(leaf: &'b LeafBeside, from: &[Vec<DVec3>]) -> Self {
        let mut curves = leaf.curves.clone();
        let mut caption = "buckled".to_string();
        if let Some(factor) = magnify_displacements(&mut curves, from) {
            caption += &format!(" ×{}", format_four_digits(factor));
        }
        let tips = vein_tips(&curves, leaf.tips.len() == 1);
        CaptionedLeaf {
            leaf,
            caption,
            curves,
            tips,
        }
    }
}

/// The letter of a leaf in the diagram.
fn leaf_letter(number: usize) -> String {
    char::from(b'a' + number as u8).into()
}

fn header_notes(boundary: &StabilityBoundary) -> Vec<String> {
    let points = || boundary.curves.iter().flat_map(|curve| &curve.points);
    let curves = count_in_words(boundary.curves.len(), "curve", "curves");
    let points_on = format!("{} points on {curves}", points().count());
    let mut notes = vec![vein_count_text(boundary.rods), points_on];
    let worst = points().map(|point| point.error).fold(0.0, f64::max);
    if worst > 0.0 {
        notes.push(format!("tips within {}", format_error_bound(worst)));
    }
    let [first, second] = boundary
        .ranges
        .map(|ends| ends.map(format_four_digits).join(" to "));
    notes.push(format!("looked for in {first} and {second}"));
    notes
}

fn draw_curves(
    page: &mut Drawing,
    boundary: &StabilityBoundary,
    units: &Units,
    shown: &[CaptionedLeaf],
    cell: PageRectangle,
) {
    let points = || boundary.curves.iter().flat_map(|curve| &curve.points);
    let axes = PanelAxes {
        cell,
        across: parameter_axis(boundary, units, 0),
        up: parameter_axis(boundary, units, 1),
    };
    draw_panel_title(page, cell.corner, "", "curves, and the index on both sides");
    let lines: Vec<BoundaryLine> = (boundary.curves.iter())
        .map(|curve| BoundaryLine::from_curve(&axes, boundary, curve))
        .collect();
    let shaded = match &boundary.map {
        Some(map) => {
            draw_index_cells(page, &axes, boundary, map);
            false
        }
        None => shade_stable_region(page, searched_rectangle(boundary, &axes), &lines),
    };
    axes.draw(page);
    let at = |point: &BoundaryPoint| (point.values[0], point.values[1]);
    let mut labels = LabelPlacement::in_rectangle(cell);
    for (c, (curve, line)) in boundary.curves.iter().zip(&lines).enumerate() {
        for ends in join_segments(line.segment_ends()) {
            axes.draw_clipped_line(page, &ends, curve_stroke(c, line));
        }
        labels.avoid_curve(&axes, &curve.points.iter().map(at).collect::<Vec<_>>());
    }
    for (kind, marker) in [("cusp", Marker::Diamond), ("crossing", Marker::Ring)] {
        let special = points().filter(|point| point.kind == kind);
        axes.draw_markers(page, special.map(at), marker, TEXT_COLOR);
    }
    let places = || (shown.iter()).map(|it| (it.leaf.values[0], it.leaf.values[1]));
    axes.draw_markers(page, places(), Marker::Dot, TEXT_COLOR);
    for (number, place) in places().enumerate() {
        if let Some(place) = axes.page_position(place) {
            labels.request_label(place, &leaf_letter(number));
        }
    }
    labels.draw_requested(page);
    draw_index_labels(page, &lines, &mut labels);
    draw_legend(page, boundary, &lines, shaded, cell);
}

/// The part of the panel in which curves were looked for.
fn searched_rectangle(boundary: &StabilityBoundary, axes: &PanelAxes) -> PageRectangle {
    let [first, second] = boundary.ranges;
    let ends = [0, 1].map(|k| {
        axes.page_position((first[k], second[k]))
            .unwrap_or(axes.cell.corner)
    });
    let (low, high) = (axes.cell.corner, axes.cell.opposite_corner());
    let corner = ends[0].min(ends[1]).clamp(low, high);
    PageRectangle::new(corner, ends[0].max(ends[1]).clamp(low, high) - corner)
}

/// The stroke of a curve by its number, thicker if it bounds stable ground.
fn curve_stroke(number: usize, line: &BoundaryLine) -> Stroke {
    Stroke {
        dash: DashPattern::ALL[number % DashPattern::ALL.len()],
        ..Stroke::new(
            BOUNDARY_COLORS[number % BOUNDARY_COLORS.len()],
            if line.bounds_stable_region() {
                2.0
            } else {
                1.4
            },
        )
    }
}

/// Segments as lines, each as long as one begins where the one before ends.
fn join_segments(segments: impl Iterator<Item = [DVec2; 2]>) -> Vec<Vec<Option<DVec2>>> {
    let mut lines: Vec<Vec<Option<DVec2>>> = Vec::new();
    for [from, to] in segments {
        match lines.last_mut() {
            Some(line) if line.last() == Some(&Some(from)) => line.push(Some(to)),
            _ => lines.push(vec![Some(from), Some(to)]),
        }
    }
    lines
}

/// Draws the cells of the map, each in the color of its index.
fn draw_index_cells(
    page: &mut Drawing,
    axes: &PanelAxes,
    boundary: &StabilityBoundary,
    map: &BoundaryMap,
) {
    let x = boundary.cell_edges(0, map.first.len());
    let y = boundary.cell_edges(1, map.second.len());
    for (r, row) in map.index.iter().enumerate() {
        for (c, index) in row.iter().enumerate() {
            let corners = [
                axes.page_position((x[c], y[r])),
                axes.page_position((x[c + 1], y[r + 1])),
            ];
            let ([Some(a), Some(b)], Some(index)) = (corners, index) else {
                continue;
            };
            let corner = a.min(b);
            let cell = PageRectangle::new(corner, a.max(b) - corner);
            fill_cell_by_index(page, cell, *index);
        }
    }
    for [c, r] in &map.disagreeing {
        if let Some(at) = axes.page_position((map.first[c - 1], map.second[r - 1])) {
            page.draw_label(at, "×", FONT_SIZE.tick, TextAnchor::Middle, TEXT_COLOR);
        }
    }
}

/// An axis over the values, and the cells of the map if there is one; logarithmic if they are spaced
/// logarithmically. Values increase along it.
fn parameter_axis(boundary: &StabilityBoundary, units: &Units, which: usize) -> Axis {
    let name = QuantityLabel::from_keys(&boundary.keys[which].to_string(), units).axis_name();
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
        false => Axis::linear_covering(&name, values),
        true => {
            let sign = ends[0].signum();
            let decades = values.map(|value| (sign * value).log10());
            Axis {
                sign: Some(sign),
                emphasizes_zero: false,
                ..Axis::linear_covering(&name, decades)
            }
        }
    }
}

fn draw_legend(
    page: &mut Drawing,
    boundary: &StabilityBoundary,
    lines: &[BoundaryLine],
    has_stable_region: bool,
    cell: PageRectangle,
) {
    let mut key = Legend::right_of(cell);
    let more = lines.len().saturating_sub(MOST_CURVES_NAMED);
    for (c, (curve, line)) in
        (boundary.curves.iter().zip(lines).enumerate()).take(MOST_CURVES_NAMED)
    {
        let what = index_change_text(curve).unwrap_or_else(|| "not verified".into());
        let beside = (0..c).find(|&other| line.coincides_with(&lines[other]));
        let name = match beside {
            Some(other) => format!("curve {}, beside curve {}", c + 1, other + 1),
            None => format!("curve {}", c + 1),
        };
        key.add_line(page, &name, &what, curve_stroke(c, line));
    }
    if more > 0 {
        key.add_entry(page, "", &format!("and {more} more"), |_, _| ());
    }
    if has_stable_region {
        key.add_entry(page, "", &stability_phrase(0), |page, cell| {
            fill_cell_by_index(page, cell, 0)
        });
    }
    if let Some(map) = &boundary.map {
        let found = map.index.iter().flatten().flatten();
        let indices: BTreeSet<usize> = found
            .map(|index| *index.min(&DARKEST_MORSE_INDEX))
            .collect();
        for index in indices {
            let more = if index == DARKEST_MORSE_INDEX {
                " or more"
            } else {
                ""
            };
            let name = stability_phrase(index) + more;
            key.add_entry(page, "", &name, |page, cell| {
                fill_cell_by_index(page, cell, index)
            });
        }
    }
    let points = || boundary.curves.iter().flat_map(|curve| &curve.points);
    for (kind, marker) in [("cusp", Marker::Diamond), ("crossing", Marker::Ring)] {
        if points().any(|point| point.kind == kind) {
            key.add_marker(page, kind, "", marker, TEXT_COLOR);
        }
    }
}

/// Where the sides of a curve are labelled, in pixels.
struct SideLabelRules {
    /// Of the places that are tried along a curve, and their largest number.
    spacing: f64,
    most_places: usize,
    /// Curves closer than this are labelled together, with the indices outside them.
    neighbour: f64,
    /// From a curve to its label.
    gap: f64,
    least_clearance: f64,
    /// Least component of the normal of a curve along the first number, which distinguishes the sides.
    least_normal: f64,
}

const SIDE_LABEL: SideLabelRules = SideLabelRules {
    spacing: 5.0,
    most_places: 400,
    neighbour: 16.0,
    gap: 4.0,
    least_clearance: 2.0,
    least_normal: 0.15,
};

/// Labels both sides of every curve where the clearance is largest; curves close to each other
/// only on the outside. A curve without enough clearance anywhere is described by the key alone.
fn draw_index_labels(page: &mut Drawing, curves: &[BoundaryLine], labels: &mut LabelPlacement) {
    let mut named = vec![false; curves.len()];
    for c in 0..curves.len() {
        if named[c] {
            continue;
        }
        let places = curves[c].label_places().into_iter();
        let best = clearest_label(
            places.map(|place| SideLabels::for_curves(curves, c, place)),
            |sides| {
                let room = sides.labels.iter().map(|it| labels.clearance(&it.cell));
                room.fold(f64::INFINITY, f64::min)
            },
        );
        if let Some(best) = best.filter(|best| best.clearance >= SIDE_LABEL.least_clearance) {
            for PlacedLabel { cell, text } in best.label.labels {
                labels.draw_label_at(page, cell, &text, NOTE_COLOR);
            }
            best.label
                .curves
                .iter()
                .for_each(|&curve| named[curve] = true);
        }
    }
}

/// A place on a curve next to which its sides may be labelled.
#[derive(Clone, Copy)]
struct LabelPlace {
    at: DVec2,
    /// The normal that points to the right.
    normal: DVec2,
    /// Indices to the left and to the right.
    sides: [usize; 2],
}

/// Curves closer than this, in pixels, along this part of one are drawn over each other.
const COINCIDING_CURVES: f64 = 4.0;
const COINCIDING_PART: f64 = 0.8;

/// The distance of a point from a straight piece.
fn distance_to_segment(point: DVec2, [from, to]: [DVec2; 2]) -> f64 {
    let way = to - from;
    let along = (point - from).dot(way) / way.length_squared().max(f64::MIN_POSITIVE);
    point.distance(from + along.clamp(0.0, 1.0) * way)
}

/// A straight piece of a curve.
struct BoundarySegment {
    pub ends: [DVec2; 2],
    /// Indices to the left and to the right.
    pub sides: [usize; 2],
}

/// Where a curve crosses a line: how far along the line, and what is on both sides.
struct LineCrossing<S> {
    pub along: f64,
    pub sides: S,
}

/// A curve on the page.
struct BoundaryLine {
    segments: Vec<BoundarySegment>,
    /// Whether two branches meet and vanish there, so that it has no sides.
    is_fold: bool,
    /// On which sides of a fold there is a stable leaf, if that is known.
    stable_sides: Option<[bool; 2]>,
}

impl BoundaryLine {
    /// A line of these segments, along which branches cross, or where two meet.
    pub fn new(segments: Vec<BoundarySegment>, fold: bool) -> Self {
        BoundaryLine {
            segments,
            is_fold: fold,
            stable_sides: None,
        }
    }

    fn from_curve(axes: &PanelAxes, boundary: &StabilityBoundary, curve: &BoundaryCurve) -> Self {
        // Along the axis the first number may move towards the end of its range, or away.
        let [from, to] = boundary.ranges[0].map(|end| axes.across.fraction(end));
        let points = curve.points.iter();
        let points: Vec<(f64, f64)> = points.map(|it| (it.values[0], it.values[1])).collect();
        let drawn = axes.smooth_curve(&points).into_iter();
        let pieces = curve
            .points
            .windows(2)
            .zip(drawn)
            .flat_map(|(pair, drawn)| {
                // Where curves cross, the index counts other modes as well.
                let point = match is_codimension_two(&pair[1]) {
                    true => &pair[0],
                    false => &pair[1],
                };
                let (before, after) = (point.index_before, point.index_behind);
                let sides = match from < to {
                    true => [before, after],
                    false => [after, before],
                };
                let segments = drawn.windows(2).map(|ends| BoundarySegment {
                    ends: [ends[0], ends[1]],
                    sides,
                });
                segments.collect::<Vec<_>>()
            });
        let first = curve.points.first();
        let fold = curve.multiplicity == 1
            && first.is_some_and(|point| matches!(point.kind, "fold" | "cusp"));
        let line = BoundaryLine::new(pieces.collect(), fold);
        let mut stable = curve.beside.iter();
        let stable = stable.find(|leaf| leaf.index == 0 && leaf.fallen_from.is_none());
        let stable = stable.and_then(|leaf| axes.page_position((leaf.values[0], leaf.values[1])));
        let to_left =
            stable.and_then(|at| Some(line.index_crossings(at, DVec2::X).next()?.along > 0.0));
        BoundaryLine {
            stable_sides: to_left.map(|left| [left, !left]),
            ..line
        }
    }

    fn segment_ends(&self) -> impl Iterator<Item = [DVec2; 2]> {
        self.segments.iter().map(|segment| segment.ends)
    }

    /// Whether the page does not show it apart from another one: along nearly all of its length.
    fn coincides_with(&self, other: &BoundaryLine) -> bool {
        let is_near = |segment: &BoundarySegment| {
            let middle = 0.5 * (segment.ends[0] + segment.ends[1]);
            let mut others = other.segments.iter();
            others.any(|it| distance_to_segment(middle, it.ends) < COINCIDING_CURVES)
        };
        let near = self.segments.iter().filter(|segment| is_near(segment));
        near.count() as f64 > COINCIDING_PART * self.segments.len() as f64
    }

    /// Whether ground on one of its sides is stable.
    fn bounds_stable_region(&self) -> bool {
        (self.segments.iter()).any(|segment| segment.sides.contains(&0))
    }

    /// Its crossings with a line, and whether the ground on both sides is stable, unless that is not
    /// known.
    fn stability_crossings(
        &self,
        at: DVec2,
        normal: DVec2,
    ) -> impl Iterator<Item = LineCrossing<Option<[bool; 2]>>> {
        self.index_crossings(at, normal).map(|crossing| {
            let sides = crossing.sides;
            let stable = match self.is_fold {
                true => self.stable_sides.filter(|_| sides.contains(&0)),
                false => Some(sides.map(|index| index == 0)),
            };
            LineCrossing {
                along: crossing.along,
                sides: stable,
            }
        })
    }

    /// Places on it, from the middle outwards.
    fn label_places(&self) -> Vec<LabelPlace> {
        let length = |ends: &[DVec2; 2]| ends[0].distance(ends[1]);
        let whole: f64 = self.segments.iter().map(|it| length(&it.ends)).sum();
        let spacing = SIDE_LABEL
            .spacing
            .max(whole / SIDE_LABEL.most_places as f64);
        let (mut places, mut before) = (Vec::new(), 0.0);
        for BoundarySegment { ends, sides } in &self.segments {
            let (own, step) = (length(ends), ends[1] - ends[0]);
            let normal = step.perp().normalize_or_zero();
            let normal = if normal.x < 0.0 { -normal } else { normal };
            let count = (own / spacing).ceil().max(1.0) as usize;
            for k in 0..count {
                let part = (k as f64 + 0.5) / count as f64;
                let off = (before + part * own - 0.5 * whole).abs();
                if normal.x > SIDE_LABEL.least_normal {
                    let place = LabelPlace {
                        at: ends[0] + part * step,
                        normal,
                        sides: *sides,
                    };
                    places.push((off, place));
                }
            }
            before += own;
        }
        places.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        places.into_iter().map(|(_, place)| place).collect()
    }

    /// Where the curve crosses a line through a point along this normal, with the indices on both sides.
    fn index_crossings(
        &self,
        at: DVec2,
        normal: DVec2,
    ) -> impl Iterator<Item = LineCrossing<[usize; 2]>> {
        self.segments.iter().filter_map(move |segment| {
            let ([a, b], sides) = (segment.ends, segment.sides);
            let step = b - a;
            let across = normal.perp_dot(step);
            let part = (at - a).perp_dot(normal) / step.perp_dot(normal);
            let along = (a - at).perp_dot(step) / across;
            let crosses = across != 0.0 && (0.0..=1.0).contains(&part);
            crosses.then_some(LineCrossing { along, sides })
        })
    }
}

/// A text and the rectangle that it fills.
struct PlacedLabel {
    cell: PageRectangle,
    text: String,
}

/// Labels on the sides of a curve, or of several curves close to each other.
struct SideLabels {
    labels: Vec<PlacedLabel>,
    curves: Vec<usize>,
}

impl SideLabels {
    fn for_curves(curves: &[BoundaryLine], c: usize, place: LabelPlace) -> Self {
        let LabelPlace { at, normal, sides } = place;
        let label = |along: f64, sign: f64, text: String| {
            let size = label_size(&text);
            let reach = 0.5 * (size * normal.abs()).element_sum() + SIDE_LABEL.gap;
            let middle = at + (along + sign * reach) * normal;
            let corner = middle - 0.5 * size;
            let cell = PageRectangle { corner, size };
            PlacedLabel { cell, text }
        };
        if curves[c].is_fold {
            let (fewer, more) = (sides[0].min(sides[1]), sides[0].max(sides[1]));
            let text = format!("{fewer} and {more} meet");
            return SideLabels {
                labels: vec![label(0.0, 1.0, text)],
                curves: vec![c],
            };
        }
        let others = curves
            .iter()
            .enumerate()
            .filter(|(k, it)| *k != c && !it.is_fold);
        let mut others: Vec<(usize, LineCrossing<[usize; 2]>)> = others
            .flat_map(|(k, it)| it.index_crossings(at, normal).map(move |found| (k, found)))
            .collect();
        let mut named = vec![c];
        // From the curve outwards, while the next one is close and the indices between them agree.
        let mut outside = |sign: f64, out: usize| {
            others.sort_by(|(_, a), (_, b)| (sign * a.along).total_cmp(&(sign * b.along)));
            let (mut along, mut index) = (0.0, sides[out]);
            for (k, it) in &others {
                if (0.0..SIDE_LABEL.neighbour).contains(&(sign * (it.along - along)))
                    && it.sides[1 - out] == index
                {
                    (along, index) = (it.along, it.sides[out]);
                    named.push(*k);
                }
            }
            label(along, sign, format!("index {index}"))
        };
        let labels = vec![outside(-1.0, 0), outside(1.0, 1)];
        SideLabels {
            labels,
            curves: named,
        }
    }
}

/// Rows and columns along which crossings with curves are looked for, in pixels.
struct ShadingGrid {
    /// Distance of rows, and of columns.
    row: f64,
    column: f64,
    /// Least distance of a column from the ends of a stretch in which it is.
    beside: f64,
}

const SHADING: ShadingGrid = ShadingGrid {
    row: 2.0,
    column: 4.0,
    beside: 0.5,
};

/// A part of a row between two crossings with curves, or a crossing and an end of the row.
struct RowStretch {
    row: usize,
    /// The curves at both ends.
    end_curves: [Option<usize>; 2],
    ends: [f64; 2],
    /// Whether the curves say that it is stable: one, both alike, or not all.
    stable: Option<bool>,
}

/// Shades where the branch is stable in a part of the plane that curves leave only at its rim; whether
/// there is such ground.
fn shade_stable_region(page: &mut Drawing, cell: PageRectangle, curves: &[BoundaryLine]) -> bool {
    let rows = (cell.size.y / SHADING.row).floor().max(1.0) as usize;
    let height = cell.size.y / rows as f64;
    let y = |row: usize| cell.corner.y + (row as f64 + 0.5) * height;
    let stretches: Vec<RowStretch> = (0..rows)
        .flat_map(|row| row_stretches(cell, curves, row, y(row)))
        .collect();
    let regions = connected_regions(&stretches, cell, curves, y);
    // Of the stretches of a region those with curves must all say that it is stable.
    let stable = |place: usize| {
        let mut said = (stretches.iter().zip(&regions))
            .filter(|(_, region)| **region == regions[place])
            .filter_map(|(stretch, _)| stretch.stable)
            .peekable();
        said.peek().is_some() && said.all(|stable| stable)
    };
    let mut verdicts: HashMap<usize, bool> = HashMap::new();
    // One polygon for stretches between the same curves in one row after the other.
    let mut polygons: Vec<(&RowStretch, Vec<[DVec2; 2]>)> = Vec::new();
    for (place, stretch) in stretches.iter().enumerate() {
        if !*(verdicts.entry(regions[place])).or_insert_with(|| stable(place)) {
            continue;
        }
        let ends = stretch.ends.map(|x| DVec2::new(x, y(stretch.row)));
        let above = polygons
            .iter_mut()
            .rev()
            .find(|(last, _)| last.row + 1 == stretch.row && last.end_curves == stretch.end_curves);
        match above {
            Some((last, ends_of)) => {
                *last = stretch;
                ends_of.push(ends);
            }
            None => polygons.push((stretch, vec![ends])),
        }
    }
    let any = !polygons.is_empty();
    for (_, mut ends) in polygons {
        // To the rims of its rows.
        let half = DVec2::new(0.0, 0.5 * height);
        let (first, last) = (ends[0], ends[ends.len() - 1]);
        ends.insert(0, first.map(|at| at - half));
        ends.push(last.map(|at| at + half));
        let left = ends.iter().map(|ends| ends[0]);
        let right = ends.iter().rev().map(|ends| ends[1]);
        let corners: Vec<DVec2> = left.chain(right).collect();
        page.draw_shape(polygon_path(&corners), STABLE_GROUND_COLOR, None);
    }
    any
}

/// The stretches of a row, from left to right.
fn row_stretches(
    cell: PageRectangle,
    curves: &[BoundaryLine],
    row: usize,
    y: f64,
) -> Vec<RowStretch> {
    let from = cell.corner.with_y(y);
    let mut crossings: Vec<(usize, LineCrossing<Option<[bool; 2]>>)> = (curves.iter().enumerate())
        .flat_map(|(k, curve)| {
            let found = curve.stability_crossings(from, DVec2::X);
            found.map(move |crossing| (k, crossing))
        })
        .filter(|(_, crossing)| (0.0..=cell.size.x).contains(&crossing.along))
        .collect();
    crossings.sort_by(|(_, a), (_, b)| a.along.total_cmp(&b.along));
    let at = |k: Option<usize>| k.and_then(|k| crossings.get(k));
    let sides = |crossing: &LineCrossing<Option<[bool; 2]>>| crossing.sides.unwrap_or_default();
    (0..=crossings.len())
        .map(|k| {
            let (left, right) = (at(k.checked_sub(1)), at(Some(k)));
            let said = [
                left.map(|(_, it)| sides(it)[1]),
                right.map(|(_, it)| sides(it)[0]),
            ];
            RowStretch {
                row,
                end_curves: [left, right].map(|it| it.map(|(curve, _)| *curve)),
                ends: [
                    left.map_or(0.0, |(_, it)| it.along),
                    right.map_or(cell.size.x, |(_, it)| it.along),
                ]
                .map(|x| from.x + x),
                stable: said.into_iter().flatten().reduce(|a, b| a && b),
            }
        })
        .collect()
}

/// The region of each stretch: those of neighboring rows are one where a column leads from one to the
/// other without a curve in between.
fn connected_regions(
    stretches: &[RowStretch],
    cell: PageRectangle,
    curves: &[BoundaryLine],
    y: impl Fn(usize) -> f64,
) -> Vec<usize> {
    let columns = (cell.size.x / SHADING.column).ceil().max(1.0) as usize;
    let x = |k: usize| cell.corner.x + (k as f64 + 0.5) * cell.size.x / columns as f64;
    let crossed: Vec<Vec<f64>> = (0..columns)
        .map(|k| {
            let top = DVec2::new(x(k), 0.0);
            let found = curves
                .iter()
                .flat_map(|it| it.stability_crossings(top, DVec2::Y));
            found.map(|crossing| crossing.along).collect()
        })
        .collect();
    let mut parent: Vec<usize> = (0..stretches.len()).collect();
    fn root(parent: &mut [usize], mut place: usize) -> usize {
        while parent[place] != place {
            parent[place] = parent[parent[place]];
            place = parent[place];
        }
        place
    }
    let rows: Vec<usize> = {
        let last = stretches.last().map_or(0, |stretch| stretch.row);
        (0..=last + 1)
            .map(|row| stretches.partition_point(|stretch| stretch.row < row))
            .collect()
    };
    for (place, stretch) in stretches.iter().enumerate() {
        let Some(&end) = rows.get(stretch.row + 2) else {
            continue;
        };
        let (here, below) = (y(stretch.row), y(stretch.row + 1));
        for other in rows[stretch.row + 1]..end {
            let [low, high] = [
                stretch.ends[0].max(stretches[other].ends[0]),
                stretch.ends[1].min(stretches[other].ends[1]),
            ];
            // A column along a curve leads nowhere.
            let open = (0..columns).any(|k| {
                let inside = low + SHADING.beside < x(k) && x(k) < high - SHADING.beside;
                inside && !crossed[k].iter().any(|y| (here..=below).contains(y))
            });
            if open {
                let [a, b] = [place, other].map(|it| root(&mut parent, it));
                parent[a] = b;
            }
        }
    }
    (0..stretches.len())
        .map(|place| root(&mut parent, place))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::formats::checked_svg_text;
    use crate::figure::drawing::{DrawingElement, PathStep};

    /// A line through these points with the index on both sides.
    fn line(points: &[[f64; 2]], sides: [usize; 2]) -> BoundaryLine {
        let points: Vec<DVec2> = points.iter().map(|&it| DVec2::from_array(it)).collect();
        let segments = points.windows(2).map(|ends| BoundarySegment {
            ends: [ends[0], ends[1]],
            sides,
        });
        BoundaryLine::new(segments.collect(), false)
    }

    /// The area that is shaded of a panel of 100 x 100.
    fn area(curves: &[BoundaryLine]) -> f64 {
        let cell = PageRectangle::new(DVec2::ZERO, DVec2::splat(100.0));
        let mut page = Drawing::new(100.0, "");
        assert_eq!(
            shade_stable_region(&mut page, cell, curves),
            !page.elements.is_empty()
        );
        checked_svg_text(&page);
        let area = |mark: &DrawingElement| {
            let DrawingElement::Shape { path, .. } = mark else {
                return 0.0;
            };
            let at = path.iter().filter_map(|step| match step {
                PathStep::Move(at) | PathStep::Line(at) => Some(*at),
                _ => None,
            });
            let at: Vec<DVec2> = at.collect();
            let next = at.iter().cycle().skip(1);
            0.5 * at
                .iter()
                .zip(next)
                .map(|(a, b)| a.perp_dot(*b))
                .sum::<f64>()
                .abs()
        };
        page.elements.iter().map(area).sum()
    }

    fn vertical(x: f64, sides: [usize; 2]) -> BoundaryLine {
        line(&[[x, -1.0], [x, 101.0]], sides)
    }

    #[test]
    fn ground_is_stable_where_all_curves_say_so() {
        for (curves, wanted) in [
            (vec![vertical(60.0, [1, 0]), vertical(30.0, [0, 1])], 7000.0),
            (vec![vertical(30.0, [1, 0])], 7000.0),
            (vec![vertical(30.0, [2, 0]), vertical(40.0, [0, 1])], 1000.0),
            // They contradict each other, or there is none.
            (vec![vertical(30.0, [1, 0]), vertical(40.0, [1, 2])], 0.0),
            (vec![], 0.0),
        ] {
            assert!((area(&curves) - wanted).abs() < 1e-6, "{wanted}");
        }
    }

    /// Ground reaches below the lowest point of a curve that turns back, and around it.
    #[test]
    fn rows_without_a_curve_belong_to_the_ground_beside_them() {
        let inside = line(&[[20.0, -1.0], [20.0, 60.0], [50.0, 61.0]], [0, 1]);
        let other = line(&[[50.0, 61.0], [80.0, 60.0], [80.0, -1.0]], [1, 0]);
        let hollow = 60.0 * 60.0;
        assert!((area(&[inside, other]) - (10_000.0 - hollow)).abs() < 100.0);
    }
}
