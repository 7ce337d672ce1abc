//! The figure of a check: the relaxed leaf as lines, the boundary-value
//! solution as dots, and their differences along the veins.

use crate::figure::drawing::axes::{Axis, NamedCurve, PanelAxes, TickPlacement};
use crate::figure::drawing::formats::Font;
use crate::figure::drawing::labels::{Legend, LegendRows, draw_header};
use crate::figure::drawing::markers::{Marker, draw_second_solution_dot};
use crate::figure::drawing::veins::DrawnVeins;
use crate::figure::drawing::{
    CURVE_COLORS, Color, Drawing, FONT_SIZE, NOTE_COLOR, PAGE, PageRectangle, Stroke, TEXT_COLOR,
    TextAnchor, draw_panel_title, vein_color,
};
use crate::figure::leaf::LeafPanels;
use crate::figure::scenario::FigureSetting;
use crate::report::numbers::format_error_bound;
use crate::report::{check_verdict_phrase, equilibrium_kind, relaxation_verdict};
use glam::DVec2;
use leafdyn::scenario::Scenario;
use leafdyn::study::{Check, CheckVerdict, ComparedQuantity};

/// Sizes of the panel of differences, in pixels.
struct DifferenceLayout {
    /// Height of a line of the reason for a verdict.
    reason_line: f64,
    frame: f64,
    /// Width right of the frame, for the key.
    key: f64,
    /// Height of the strip below for differences of exactly zero: one lane per quantity.
    zero_strip: f64,
    /// Curves through more stations have no markers.
    most_marked: usize,
}

const LAYOUT: DifferenceLayout = DifferenceLayout {
    reason_line: 19.0,
    frame: 216.0,
    key: 212.0,
    zero_strip: 30.0,
    most_marked: 70,
};

pub fn draw(check: &Check, scenario: &Scenario) -> Drawing {
    let setting = FigureSetting::from_scenario(scenario);
    let mut veins = DrawnVeins::from_equilibrium(&check.relaxed, scenario);
    if let Some(solution) = check.solution() {
        veins.add_second_solution(&solution.rods);
    }
    let title = format!(
        "{}: {}",
        check.relaxed.scenario,
        check_verdict_phrase(&check.verdict)
    );
    // Why the solutions could not be compared.
    let reason = match &check.verdict {
        CheckVerdict::NotCompared(why) | CheckVerdict::NotIndependent(why) => Font::embedded()
            .wrap_text(
                &why.to_string(),
                FONT_SIZE.text,
                PAGE.width - PAGE.left_margin - PAGE.right_margin,
            ),
        _ => Vec::new(),
    };
    let key_line = PAGE.notes_base_line + LAYOUT.reason_line * (reason.len() + 1) as f64;
    let panels = LeafPanels::placed_below(PAGE.header - PAGE.notes_base_line + key_line, &veins);
    let compared = !check.along.is_empty();
    let below = if compared { PANEL_HEIGHT } else { 0.0 };
    let mut drawing = Drawing::new(PAGE.width, &title);
    drawing.height = (panels.bottom() + below).ceil();
    drawing.draw_group("header", |page| {
        let notes = header_notes(check, &veins, &setting);
        draw_header(page, PAGE.left_margin, &title, &notes, Some(&veins));
        for (line, text) in reason.iter().enumerate() {
            let base = DVec2::new(
                PAGE.left_margin,
                PAGE.notes_base_line + LAYOUT.reason_line * (line + 1) as f64,
            );
            page.draw_label(base, text, FONT_SIZE.text, TextAnchor::Start, TEXT_COLOR);
        }
        let mut key = LegendRows::starting_at(PAGE.left_margin, key_line, 26.0);
        let stroke = Stroke::new(vein_color(0.3), veins.line_width());
        key.add_entry(page, "relaxed", |page, cell| {
            cell.draw_midline(page, stroke)
        });
        if check.solution().is_some() {
            key.add_entry(page, "boundary-value solution by shooting", |page, cell| {
                draw_second_solution_dot(page, cell.middle(), 2.0);
            });
        }
    });
    panels.draw(&mut drawing, &veins, &setting);
    if compared {
        drawing.draw_group("differences", |page| {
            draw_differences(page, check, veins.unit, panels.bottom());
        });
    }
    drawing
}

fn header_notes(check: &Check, veins: &DrawnVeins, setting: &FigureSetting) -> Vec<String> {
    let mut notes = vec![format!("N = {}", veins.count)];
    let relaxed = relaxation_verdict(&check.relaxed);
    match &check.shot {
        Some(shot) if shot.found.is_ok() => {
            let shot = equilibrium_kind(shot.negative_eigenvalues);
            if shot == relaxed {
                notes.push(format!("both: {shot}"));
            } else {
                notes.push(format!("relaxed: {relaxed}"));
                notes.push(format!("by shooting: {shot}"));
            }
        }
        _ => notes.push(format!("relaxed: {relaxed}")),
    }
    notes.extend(veins.leaf_notes(setting));
    notes
}

const PANEL_HEIGHT: f64 = PAGE.panel_title + LAYOUT.frame + PAGE.panel_axis;

const FEWEST_DECADES: f64 = 3.0;

/// How much both solutions differ in a quantity.
struct DifferenceCurve {
    along: NamedCurve,
    /// The largest difference at which the solutions agree.
    allowed: Option<f64>,
}

/// Differences of a quantity along the veins: of positions in units of `unit`, of other quantities in
/// those of the scenario.
fn difference_curve(
    quantity: ComparedQuantity,
    check: &Check,
    unit: f64,
    color: Color,
) -> DifferenceCurve {
    let (name, unit, allowed) = match quantity {
        ComparedQuantity::Position => {
            ("position, in lengths L", unit, Some(check.allowed() / unit))
        }
        ComparedQuantity::Rotation => ("rotation, in radians", 1.0, Some(check.allowed_rotation())),
        ComparedQuantity::Force => ("force, in the scenario's unit", 1.0, None),
        ComparedQuantity::Moment => ("moment, in the scenario's unit", 1.0, None),
    };
    let values = check
        .along
        .iter()
        .map(|found| quantity.component(found) / unit);
    let stations = check.relaxed.shape.stations.iter().copied();
    let points = stations.zip(values).collect();
    let along = NamedCurve {
        name,
        color,
        points,
    };
    DifferenceCurve { along, allowed }
}

fn draw_differences(page: &mut Drawing, check: &Check, unit: f64, start: f64) {
    let quantities = ComparedQuantity::ALL.into_iter().zip(CURVE_COLORS);
    let curves: Vec<DifferenceCurve> = quantities
        .map(|(quantity, color)| difference_curve(quantity, check, unit, color))
        .collect();
    let values = || curves.iter().flat_map(|curve| curve.along.ordinates());
    let mut cell =
        PageRectangle::left_of_legend(start + PAGE.panel_title, LAYOUT.frame, LAYOUT.key);
    let what = "largest difference of all veins at each station";
    draw_panel_title(page, cell.corner, "(e)", what);
    let stations = Axis {
        tick_spacing: Some(50.0),
        ..Axis::linear("σ, fraction of each vein's length", 0.0, 1.0)
    };
    let mut across = stations.clone();
    if values().any(|value| value == 0.0) {
        cell.size.y -= LAYOUT.zero_strip;
        across.labelled = false;
        draw_zero_strip(page, &curves, cell, stations);
    }
    let allowed = curves.iter().filter_map(|curve| curve.allowed);
    let axes = PanelAxes {
        cell,
        across,
        up: Axis::logarithmic("", values().chain(allowed), FEWEST_DECADES),
    };
    axes.draw(page);
    for curve in &curves {
        if let Some(allowed) = curve.allowed {
            let stroke = Stroke::new(curve.along.color, 1.0).with_dashes(true);
            axes.draw_curve(page, &[(0.0, allowed), (1.0, allowed)], stroke);
        }
    }
    for DifferenceCurve { along: curve, .. } in &curves {
        axes.draw_curve(page, &curve.points, Stroke::new(curve.color, 1.6));
        if curve.points.len() <= LAYOUT.most_marked {
            axes.draw_markers(page, curve.points.iter().copied(), Marker::Dot, curve.color);
        }
    }
    draw_legend(page, &curves, cell);
}

/// Draws differences of zero, which have no place on a logarithmic axis, in a strip
/// below it.
fn draw_zero_strip(
    page: &mut Drawing,
    curves: &[DifferenceCurve],
    above: PageRectangle,
    stations: Axis,
) {
    let strip = PanelAxes {
        cell: PageRectangle::new(
            DVec2::new(above.corner.x, above.opposite_corner().y),
            DVec2::new(above.size.x, LAYOUT.zero_strip),
        ),
        across: stations,
        up: Axis {
            ticks: TickPlacement::WholeNumbers(vec![0.0]),
            ..Axis::linear("", 2.7, -2.7)
        },
    };
    strip.draw(page);
    for (lane, curve) in curves.iter().enumerate() {
        let zeros = (curve.along.points.iter()).filter(|point| point.1 == 0.0);
        let places = zeros.map(|point| (point.0, lane as f64 - 1.5));
        strip.draw_markers(page, places, Marker::Dot, curve.along.color);
    }
}

fn draw_legend(page: &mut Drawing, curves: &[DifferenceCurve], cell: PageRectangle) {
    let mut key = Legend::right_of(cell);
    for DifferenceCurve { along: curve, .. } in curves {
        let largest = match curve.ordinates().fold(0.0, f64::max) {
            0.0 => "no difference".into(),
            largest => format!("≤ {}", format_error_bound(largest)),
        };
        key.add_marked_line(page, curve.name, &largest, curve.color);
    }
    let dashed = Stroke::new(NOTE_COLOR, 1.0).with_dashes(true);
    key.add_line(page, "allowed difference", "", dashed);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::formats::checked_svg_text;
    use crate::report::sample;
    use leafdyn::relax::EquilibriumRemark;
    use leafdyn::study::CheckReason;

    fn svg(check: &Check) -> String {
        checked_svg_text(&draw(check, &sample::sample_scenario("fan", 5)))
    }

    #[test]
    fn the_verdict_is_the_title() {
        for (angle, title) in [
            (0.0, "fan: both methods agree"),
            (0.1, "fan: the methods differ"),
        ] {
            let svg = svg(&sample::sample_check(5, 8, angle));
            assert!(svg.contains(&format!("<title>{title}</title>")), "{title}");
            assert!(svg.contains(&format!(">{title}</text>")), "{title}");
            for quantity in ["position", "rotation", "force", "moment"] {
                assert!(svg.contains(quantity), "{quantity}");
            }
        }
    }

    #[test]
    fn without_a_second_solution_the_reason_is_given() {
        let mut check = sample::sample_check(5, 8, 0.0);
        let remark = Some(EquilibriumRemark::OutOfMemory { segments: 512 });
        check.shot = None;
        check.along.clear();
        check.difference = None;
        check.verdict = CheckVerdict::NotCompared(CheckReason::NotAtRest { remark });
        let svg = svg(&check);
        assert!(svg.contains("could not be compared"));
        for part in ["did not come to rest:", "the limit on memory"] {
            assert!(svg.contains(part), "{part}");
        }
        assert!(!svg.contains("class=\"differences\""));
    }
}
