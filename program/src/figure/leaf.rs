//! A leaf at rest in four panels, along each axis and in space; all equilibria of a leaf in small panels;
//! and its modes, each drawn over the leaf in two views.
//!
//! The three flat panels have one scale and are placed as in a technical drawing: the side view below
//! the top view with the same xi axis, the front view to the right of the side view with the same zeta
//! axis.

use crate::figure::drawing::labels::new_page;
use crate::figure::drawing::space::{
    BoxMargins, FRONT_VIEW, LEAF_PADDING, PlaneView, SMALL_LINE_WIDTH_FACTOR, SmallPanels,
    SpacePanel, VIEW_FROM_ABOVE, VIEW_FROM_FRONT, VIEW_FROM_SIDE, ViewAngles, draw_plane_panel,
    padded_box,
};
use crate::figure::drawing::veins::{DrawnVein, DrawnVeins, draw_leaf_markers, vein_tips};
use crate::figure::drawing::{
    Color, Drawing, FONT_SIZE, FRAME_COLOR, NOTE_COLOR, PAGE, PageRectangle, PanelCaption,
    SECOND_SOLUTION_COLOR, Stroke, draw_panel_title,
};
use crate::figure::rod;
use crate::figure::scenario::FigureSetting;
use crate::report::numbers::{
    format_as_accurate, format_error_bound, format_four_digits, number_in_unit,
};
use crate::report::{relaxation_verdict, shooting_method_name, stability_phrase};
use glam::{DVec2, DVec3};
use leafdyn::relax::{Equilibrium, Mode, SmallMotions};
use leafdyn::scenario::units::{ENERGY, RATE};
use leafdyn::scenario::{Scenario, Units};
use leafdyn::study::Equilibria;
use std::f64::consts::TAU;

pub fn draw(leaf: &Equilibrium, scenario: &Scenario) -> Drawing {
    let setting = FigureSetting::from_scenario(scenario);
    let veins = DrawnVeins::from_equilibrium(leaf, scenario);
    let notes = header_notes(leaf, &veins, &setting);
    let mut drawing = match veins.count {
        1 => rod::draw(leaf, scenario, &veins, &setting, &notes),
        _ => {
            let panels = LeafPanels::placed_below(PAGE.header, &veins);
            let mut drawing = new_page(PAGE.left_margin, &leaf.scenario, &notes, Some(&veins));
            drawing.height = panels.bottom().ceil();
            panels.draw(&mut drawing, &veins, &setting);
            drawing
        }
    };
    drawing.description = format!("{}: {}", leaf.scenario, relaxation_verdict(leaf));
    drawing
}

fn header_notes(
    equilibrium: &Equilibrium,
    veins: &DrawnVeins,
    setting: &FigureSetting,
) -> Vec<String> {
    let mut notes = vec![
        format!("N = {}", veins.count),
        relaxation_verdict(equilibrium),
    ];
    match equilibrium.accuracy.intervals {
        Some(count) => notes.push(format!("by {}", shooting_method_name(count))),
        None if equilibrium.method.is_shooting() => {
            notes.push("shown is how far shooting came".into());
        }
        None => (),
    }
    if let Some(error) = equilibrium.accuracy.error_estimate {
        let error = format_error_bound(setting.value_per_length() * (error / veins.unit));
        notes.push(format!(
            "error of positions ≤ {error} {}",
            setting.length_unit()
        ));
    }
    notes.extend(veins.leaf_notes(setting));
    notes
}

const MOST_EQUILIBRIA_DRAWN: usize = 24;

pub fn draw_equilibria(all: &Equilibria, scenario: &Scenario) -> Drawing {
    let setting = FigureSetting::from_scenario(scenario);
    let shown = &all.found[..all.found.len().min(MOST_EQUILIBRIA_DRAWN)];
    let shapes = shown
        .iter()
        .map(|found| DrawnVeins::from_equilibrium(&found.equilibrium, scenario));
    let shapes: Vec<DrawnVeins> = shapes.collect();
    let view = ViewAngles::telling_apart(&shapes);
    let count = shown.len();
    let panels = SmallPanels::seen_from(view, shapes.iter(), count, &setting, PAGE.header);
    let name = format!(
        "{}: equilibria with their energies, lowest first",
        all.scenario
    );
    let count = all.found.len();
    let mut notes = vec![format!("{count} found from {} starts", all.starts)];
    if count > MOST_EQUILIBRIA_DRAWN {
        notes.push(format!("the first {MOST_EQUILIBRIA_DRAWN} drawn"));
    }
    let mut drawing = new_page(PAGE.side_margin, &name, &notes, shapes.first());
    drawing.height = panels.bottom();
    for (index, (found, veins)) in shown.iter().zip(&shapes).enumerate() {
        let negative = found.equilibrium.stability.negative_eigenvalues;
        let stability = negative.map_or(String::new(), stability_phrase);
        let energy = found.equilibrium.energy.filter(|energy| energy.is_finite());
        let energy = energy.map(|energy| {
            let digits = format_as_accurate(&found.equilibrium, energy, energy);
            number_in_unit(digits, &scenario.units, ENERGY)
        });
        let parts = [stability, energy.unwrap_or_default()];
        let told = parts.into_iter().filter(|it| !it.is_empty());
        let text = told.collect::<Vec<_>>().join(", ");
        drawing.draw_group("leaf", |page| {
            panels.draw_leaf(page, index, veins, [&(index + 1).to_string(), &text]);
        });
    }
    drawing
}

/// Sizes of the four panels of a leaf, in pixels.
struct LeafLayout {
    /// Between the columns, for the right one's axis.
    column_gap: f64,
    /// Panels are at least this large, however flat the leaf is.
    least_column: f64,
    least_top_row: f64,
    least_bottom_row: f64,
    /// Both rows together are at most this high, however tall the leaf is.
    largest_rows: f64,
}

const LAYOUT: LeafLayout = LeafLayout {
    column_gap: 74.0,
    least_column: 340.0,
    least_top_row: 270.0,
    least_bottom_row: 130.0,
    largest_rows: 800.0,
};

const COLUMNS_WIDTH: f64 = PAGE.width - PAGE.left_margin - PAGE.right_margin - LAYOUT.column_gap;

/// A flat panel: the name of its group, its letter, and what it shows.
struct PlanePanel {
    group: &'static str,
    letter: &'static str,
    view: PlaneView,
}

const PLANE_PANELS: [PlanePanel; 3] = [
    PlanePanel {
        group: "top",
        letter: "(a)",
        view: VIEW_FROM_ABOVE,
    },
    PlanePanel {
        group: "side",
        letter: "(b)",
        view: VIEW_FROM_SIDE,
    },
    PlanePanel {
        group: "front",
        letter: "(c)",
        view: VIEW_FROM_FRONT,
    },
];

/// Margins of the panel in space.
const SPACE_MARGINS: BoxMargins = BoxMargins {
    left: 56.0,
    right: 22.0,
    below: 36.0,
};

/// Draws the projection of the leaf onto two axes, centered.
fn draw_plane_projection(
    page: &mut Drawing,
    veins: &DrawnVeins,
    setting: &FigureSetting,
    cell: PageRectangle,
    scale: f64,
    axes: [usize; 2],
) {
    let middle = 0.5 * (veins.low + veins.high);
    let camera = draw_plane_panel(page, middle, setting, cell, scale, axes);
    let place = |point: DVec3| camera.project_point(point);
    // Veins farther from the viewer first.
    let nearness = |vein: &DrawnVein| {
        let ends = vein.pieces.iter().map(|piece| camera.toward.dot(piece[3]));
        ends.sum::<f64>() / vein.pieces.len().max(1) as f64
    };
    let mut order: Vec<&DrawnVein> = veins.veins.iter().collect();
    order.sort_by(|a, b| nearness(a).total_cmp(&nearness(b)));
    for vein in order {
        let stroke = Stroke::new(vein.color, veins.line_width());
        page.draw_stroke(vein.projected_path(place), stroke);
    }
    draw_leaf_markers(page, veins, place);
    let arrows = setting.direction_arrows(true, 0.0);
    camera.draw_arrows(page, &arrows, cell, veins.piece_ends().map(place));
}

/// A column or a row of panels.
#[derive(Clone, Copy)]
struct PanelSpan {
    start: f64,
    length: f64,
}

/// Columns and rows, and the pixels per length of the flat panels.
pub struct LeafPanels {
    columns: [PanelSpan; 2],
    rows: [PanelSpan; 2],
    scale: f64,
}

impl LeafPanels {
    /// The panels of these veins, placed below `start`.
    pub fn placed_below(start: f64, veins: &DrawnVeins) -> Self {
        let DVec3 { x, y, z } =
            veins.high - veins.low + DVec3::splat(2.0 * LEAF_PADDING * veins.largest_extent());
        // The largest scale that lets every panel hold the leaf.
        let scale = [
            COLUMNS_WIDTH / (x + y),
            (COLUMNS_WIDTH - LAYOUT.least_column) / x.max(y),
            LAYOUT.largest_rows / (y + z),
            (LAYOUT.largest_rows - LAYOUT.least_bottom_row) / y,
            (LAYOUT.largest_rows - LAYOUT.least_top_row) / z,
        ]
        .into_iter()
        .fold(f64::INFINITY, f64::min);

        let widths = [x, y].map(|extent| (scale * extent).max(LAYOUT.least_column));
        let spare = COLUMNS_WIDTH - widths[0] - widths[1];
        let widths = widths.map(|width| width + 0.5 * spare);
        let heights = [
            (scale * y).max(LAYOUT.least_top_row),
            (scale * z).max(LAYOUT.least_bottom_row),
        ];
        let top = start + PAGE.panel_title;
        let bottom = top + heights[0] + PAGE.panel_axis + PAGE.panel_title;
        let spans = |starts: [f64; 2], lengths: [f64; 2]| {
            [0, 1].map(|k| PanelSpan {
                start: starts[k],
                length: lengths[k],
            })
        };
        let right = PAGE.left_margin + widths[0] + LAYOUT.column_gap;
        LeafPanels {
            columns: spans([PAGE.left_margin, right], widths),
            rows: spans([top, bottom], heights),
            scale,
        }
    }

    pub fn bottom(&self) -> f64 {
        self.rows[1].start + self.rows[1].length + PAGE.panel_axis + PAGE.bottom_margin
    }

    pub fn draw(&self, drawing: &mut Drawing, veins: &DrawnVeins, setting: &FigureSetting) {
        let [left, right] = self.columns;
        let [top, bottom] = self.rows;
        let cell = |column: PanelSpan, row: PanelSpan| {
            PageRectangle::new(
                DVec2::new(column.start, row.start),
                DVec2::new(column.length, row.length),
            )
        };
        let cells = [(left, top), (left, bottom), (right, bottom)];
        for (panel, (column, row)) in PLANE_PANELS.into_iter().zip(cells) {
            let cell = cell(column, row);
            drawing.draw_group(panel.group, |page| {
                draw_panel_title(page, cell.corner, panel.letter, panel.view.title);
                draw_plane_projection(page, veins, setting, cell, self.scale, panel.view.axes);
            });
        }
        // The panel in space has no axis on its left: it takes half of the gap.
        let shift = 0.5 * LAYOUT.column_gap;
        let cell = cell(
            PanelSpan {
                start: right.start - shift,
                length: right.length + shift,
            },
            PanelSpan {
                length: top.length + PAGE.panel_axis - FONT_SIZE.tick,
                ..top
            },
        );
        drawing.draw_group("space", |page| {
            let bounds = padded_box(veins.low, veins.high);
            let view = ViewAngles::oblique([veins.tip_from_base()]);
            let scene = SpacePanel::new(bounds, setting, view, cell, SPACE_MARGINS, None);
            draw_panel_title(page, cell.corner, "(d)", "in space");
            scene.draw_floor_and_walls(page);
            scene.draw_axes(page, 38.0);
            scene.draw_direction_arrows(page, true, 0.0);
            scene.draw_leaf(page, veins, veins.line_width());
        });
    }
}

const MOST_MODES_DRAWN: usize = 12;

/// Largest displacement drawn, as a fraction of the leaf's extent.
const LARGEST_DRAWN_AMPLITUDE: f64 = 0.2;

/// Largest displacement a quarter of a period later, as a part of the largest, that is not drawn.
const IN_PHASE: f64 = 1e-3;

/// A mode of vibration, or a small motion of a leaf without a potential.
pub struct DrawnMode<'a> {
    /// Its frequency and growth.
    pub text: String,
    grows: bool,
    pub displacement: &'a [Vec<DVec3>],
    /// Displacement a quarter of a period later, where nodes move out of phase.
    pub later_displacement: Option<&'a [Vec<DVec3>]>,
}

impl DrawnMode<'_> {
    /// The lowest modes or small motions of a leaf, as far as their shapes are known.
    pub fn lowest<'a>(equilibrium: &'a Equilibrium, units: &Units) -> Vec<DrawnMode<'a>> {
        let modes = equilibrium.stability.modes.iter().flatten();
        let modes = modes.map(|mode| DrawnMode {
            text: mode_text(mode, units),
            grows: mode.growth().is_some() && !mode.is_neutral(),
            displacement: &mode.displacement,
            later_displacement: None,
        });
        let motions = equilibrium.stability.small_motions.iter();
        let shapes = motions.flat_map(|motions| {
            let shapes = motions.shapes.iter().flatten().enumerate();
            shapes.map(move |(k, shape)| {
                let later = largest_length(&shape.later_displacement);
                let in_phase = later <= IN_PHASE * largest_length(&shape.displacement);
                DrawnMode {
                    text: small_motion_text(motions, k, units),
                    grows: certain_growth(motions, k) > 0.0,
                    displacement: &shape.displacement,
                    later_displacement: (!in_phase).then_some(&shape.later_displacement[..]),
                }
            })
        });
        modes.chain(shapes).collect()
    }

    /// Growing ones are red.
    fn color(&self) -> Color {
        match self.grows {
            true => SECOND_SOLUTION_COLOR,
            false => NOTE_COLOR,
        }
    }
}

pub fn draw_modes(equilibrium: &Equilibrium, scenario: &Scenario) -> Drawing {
    let setting = FigureSetting::from_scenario(scenario);
    let name = format!("{}: modes", equilibrium.scenario);
    let rest = DrawnVeins::from_equilibrium(equilibrium, scenario);
    let modes = DrawnMode::lowest(equilibrium, &scenario.units);
    let drawn = &modes[..modes.len().min(MOST_MODES_DRAWN)];
    let shapes = drawn.iter().map(|mode| {
        let size = drawn_size(&rest, mode.displacement);
        let now = displaced_veins(equilibrium, &rest, mode.displacement, size);
        let later = mode.later_displacement;
        (
            now,
            later.map(|later| displaced_veins(equilibrium, &rest, later, size)),
        )
    });
    let shapes: Vec<(DrawnVeins, Option<DrawnVeins>)> = shapes.collect();
    // Every mode in two views: a motion towards the viewer in one is visible in the other.
    let views = [ViewAngles::oblique([rest.tip_from_base()]), FRONT_VIEW];
    let count = views.len() * drawn.len();
    let all = shapes
        .iter()
        .flat_map(|(now, later)| [now].into_iter().chain(later));
    let panels = SmallPanels::seen_from(views[0], all.chain([&rest]), count, &setting, PAGE.header);
    let mut notes = vec![
        format!("N = {}", rest.count),
        relaxation_verdict(equilibrium),
    ];
    notes.push(match modes.len() {
        count if count > MOST_MODES_DRAWN => format!("the lowest {MOST_MODES_DRAWN} of {count}"),
        count => format!("the lowest {count}"),
    });
    let out_of_phase = shapes.iter().any(|(_, later)| later.is_some());
    notes.push(match out_of_phase {
        true => "grey: at rest; dashed: a quarter of a period later".into(),
        false => "grey: at rest".into(),
    });
    notes.extend(rest.leaf_notes(&setting));
    let mut drawing = new_page(PAGE.side_margin, &name, &notes, Some(&rest));
    drawing.height = panels.bottom();
    for (index, (mode, (veins, later))) in drawn.iter().zip(&shapes).enumerate() {
        drawing.draw_group("mode", |page| {
            let number = (index + 1).to_string();
            let captions = [
                PanelCaption {
                    letter: &number,
                    text: &mode.text,
                    color: mode.color(),
                },
                PanelCaption {
                    letter: "",
                    text: "from the front",
                    color: NOTE_COLOR,
                },
            ];
            for (k, (view, caption)) in views.into_iter().zip(captions).enumerate() {
                let place = views.len() * index + k;
                let scene = panels.draw_empty_panel(page, place, 0.0, view, caption);
                let width = SMALL_LINE_WIDTH_FACTOR * veins.line_width();
                let mut draw_thin = |veins: &DrawnVeins, stroke: Stroke| {
                    for vein in &veins.veins {
                        let path = vein.projected_path(|point| scene.project_point(point));
                        page.draw_stroke(path, stroke);
                    }
                };
                draw_thin(&rest, Stroke::new(FRAME_COLOR, 0.6 * width));
                if let Some(later) = later {
                    draw_thin(
                        later,
                        Stroke::new(NOTE_COLOR, 0.6 * width).with_dashes(true),
                    );
                }
                scene.draw_leaf(page, veins, width);
            }
        });
    }
    drawing
}

/// The frequency of a mode or, if it is unstable, its growth rate: cycles per time where the scenario names
/// its unit of time, and otherwise the angular frequency.
fn mode_text(mode: &Mode, units: &Units) -> String {
    match (mode.is_neutral(), mode.growth()) {
        (true, _) => "neutral: ω = 0".into(),
        (_, None) => frequency_text(mode.frequency().unwrap_or_default(), units),
        (_, Some(growth)) => format!("unstable: grows at {}", rate_text(growth, units)),
    }
}

/// An angular frequency; cycles per time where the scenario names its unit of time.
fn frequency_text(angular: f64, units: &Units) -> String {
    match units.frequency() {
        None => format!("ω = {}", format_four_digits(angular)),
        Some(unit) => format!("{} {unit}", format_four_digits(angular / TAU)),
    }
}

fn rate_text(rate: f64, units: &Units) -> String {
    number_in_unit(format_four_digits(rate), units, RATE)
}

/// The growth rate of a small motion, zero where that is within its error.
fn certain_growth(motions: &SmallMotions, k: usize) -> f64 {
    let error = motions.errors.as_ref().map_or(0.0, |errors| errors[k]);
    let growth = motions.growth_rates[k];
    if growth.abs() > error { growth } else { 0.0 }
}

/// The frequency of a small motion, if it oscillates, and its growth.
fn small_motion_text(motions: &SmallMotions, k: usize, units: &Units) -> String {
    let (growth, frequency) = (certain_growth(motions, k), motions.frequencies[k]);
    let rate = rate_text(growth.abs(), units);
    let growth = match growth {
        growth if growth > 0.0 => format!("unstable: grows at {rate}"),
        growth if growth < 0.0 => format!("decays at {rate}"),
        _ => String::new(),
    };
    let frequency = match frequency > 0.0 {
        true => frequency_text(frequency, units),
        false => String::new(),
    };
    let parts = [frequency, growth].into_iter().filter(|it| !it.is_empty());
    match parts.collect::<Vec<_>>() {
        parts if parts.is_empty() => "neutral: ω = 0".into(),
        parts => parts.join(", "),
    }
}

fn largest_length(shape: &[Vec<DVec3>]) -> f64 {
    let all = shape.iter().flatten();
    all.fold(0.0, |largest, node| largest.max(node.length()))
}

/// The factor on a displacement that is drawn.
fn drawn_size(rest: &DrawnVeins, displacement: &[Vec<DVec3>]) -> f64 {
    let largest = largest_length(displacement);
    match largest > 0.0 {
        // Never magnified: displacements are small in a mode of rotation alone.
        true => (LARGEST_DRAWN_AMPLITUDE * rest.largest_extent() * rest.unit / largest).min(1.0),
        false => 0.0,
    }
}

/// The leaf displaced by a shape times a factor.
fn displaced_veins(
    equilibrium: &Equilibrium,
    rest: &DrawnVeins,
    displacement: &[Vec<DVec3>],
    size: f64,
) -> DrawnVeins {
    let shape = &equilibrium.shape;
    let moved = shape.curves.iter().zip(displacement);
    let curves: Vec<Vec<DVec3>> = moved
        .map(|(curve, by)| curve.iter().zip(by).map(|(x, d)| x + size * d).collect())
        .collect();
    DrawnVeins::from_curves(&curves, &vein_tips(&curves, shape.joined), rest.unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::formats::checked_svg_text;
    use crate::report::sample;

    #[test]
    fn every_extent_fits_its_panel() {
        for size in [
            [1.0, 1.0, 0.2],
            [1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.1, 2.0, 0.0],
            [0.0; 3],
        ] {
            let mut veins = DrawnVeins::from_equilibrium(
                &sample::sample_equilibrium(3, 4),
                &sample::sample_scenario("fan", 3),
            );
            veins.low = DVec3::ZERO;
            veins.high = DVec3::from_array(size);
            let found = LeafPanels::placed_below(0.0, &veins);
            let [left, right] = found.columns.map(|column| column.length + 1e-9);
            let [top, bottom] = found.rows.map(|row| row.length + 1e-9);
            let [x, y, z] = size.map(|extent| found.scale * extent);
            let fits = left >= x && right >= y && top >= y && bottom >= z;
            assert!(fits, "{size:?}");
            assert!((left + right - COLUMNS_WIDTH).abs() < 1e-8, "{size:?}");
            assert!(top + bottom <= LAYOUT.largest_rows + 1e-8, "{size:?}");
        }
    }

    #[test]
    fn frequencies_growth_and_neutral_modes_are_captioned() {
        for (eigenvalue, caption) in [
            (4.0, "ω = 2<"),
            (-9.0, "unstable: grows at 3<"),
            (1e-10, "neutral"),
        ] {
            let mut leaf = sample::sample_equilibrium(3, 8);
            let shape = vec![vec![DVec3::Z; 9]; 3];
            let mode = Mode {
                eigenvalue,
                error: Some(1e-9),
                effective_masses: None,
                displacement: shape.clone(),
                rotation: shape,
            };
            leaf.stability.modes = Some(vec![mode; 14]);
            let svg = checked_svg_text(&draw_modes(&leaf, &sample::sample_scenario("fan", 3)));
            assert_eq!(svg.matches(caption).count(), MOST_MODES_DRAWN, "{caption}");
            assert!(svg.contains("the lowest 12 of 14"));
            // Every mode in a second view.
            assert_eq!(svg.matches(">from the front<").count(), MOST_MODES_DRAWN);
        }
    }
}
