//! What a change of each number does to the tip of a leaf or, if that is held, to the force on its
//! holder: signed bars along each axis.

use crate::figure::drawing::axes::{Axis, PanelAxes};
use crate::figure::drawing::formats::Font;
use crate::figure::drawing::labels::new_page;
use crate::figure::drawing::{
    BLUE, Drawing, FONT_SIZE, FRAME_COLOR, NOTE_COLOR, PAGE, PageRectangle, Stroke, TEXT_COLOR,
    TextAnchor, VERMILION, rectangle_path,
};
use crate::figure::scenario::{COORDINATE_NAMES, QuantityLabel, name_with_unit};
use crate::report::numbers::{format_error_bound, format_four_digits, round_to_error};
use glam::{DVec2, DVec3};
use leafdyn::relax::{Equilibrium, Sensitivity};
use leafdyn::scenario::units::LENGTH;
use leafdyn::scenario::{Scenario, Units};
use leafdyn::study::ParameterKeys;

/// Sizes of the rows of bars, in pixels.
struct BarLayout {
    /// Left of the panels, for the numbers in words, and between the panels.
    words: f64,
    gap: f64,
    /// Height of a row, and of a bar in it.
    row: f64,
    bar: f64,
    /// From a bar to its value.
    value_gap: f64,
    /// Room for the values beside the longest bars, as a fraction of the panel.
    value_room: f64,
    /// Least distance between ticks.
    ticks: f64,
    most_rows: usize,
}

const LAYOUT: BarLayout = BarLayout {
    words: 216.0,
    gap: 16.0,
    row: 34.0,
    bar: 12.0,
    value_gap: 4.0,
    value_room: 0.42,
    ticks: 40.0,
    most_rows: 40,
};

/// Values are shown to this part of them.
const SHOWN_VALUE_PRECISION: f64 = 5e-4;

/// By how much each number changes: this part of it or, if it is zero, of the largest of its list or
/// profile, and if all are zero of the longest vein, of lengths, or of its unit.
const RELATIVE_CHANGE: f64 = 0.01;

/// What a change of one number of the scenario does.
struct SensitivityRow {
    words: String,
    change_text: String,
    change: DVec3,
    /// Bound on the error of each component.
    error: f64,
    /// Whether the number is zero and changes by a part of something else: its effect cannot be compared.
    is_zero: bool,
}

impl SensitivityRow {
    /// The row of a number of a list or profile whose largest has this magnitude, of a leaf whose longest vein has this length.
    fn from_sensitivity(found: &Sensitivity, largest: f64, longest: f64, units: &Units) -> Self {
        let keys: Result<ParameterKeys, _> = found.key.parse();
        let is_length = keys.is_ok_and(|keys| keys.dimension() == LENGTH);
        let size = if is_length { longest } else { 1.0 };
        let number = QuantityLabel::from_keys(&found.key, units);
        let unit = number.unit.map_or(String::new(), |unit| format!(" {unit}"));
        let hundredth_of = |value: f64| {
            let by = format!("by 1 % of {}{unit}", format_four_digits(value));
            (RELATIVE_CHANGE * value, by)
        };
        let (factor, by) = match found.value {
            0.0 if largest > 0.0 => {
                let (factor, by) = hundredth_of(largest);
                (factor, format!("0, {by}"))
            }
            0.0 => (
                RELATIVE_CHANGE * size,
                format!("0, by {}{unit}", format_four_digits(RELATIVE_CHANGE * size)),
            ),
            value => hundredth_of(value),
        };
        let (change, error) = match &found.reaction {
            Some(reaction) => (reaction.force, found.tip_reaction_error),
            None => {
                // Of free tips that which moves most.
                let tips = found.tips.iter().copied();
                let tip = tips.max_by(|a, b| a.length().total_cmp(&b.length()));
                (tip.unwrap_or_default(), found.tip_error)
            }
        };
        SensitivityRow {
            words: number.words,
            change_text: by,
            change: factor * change,
            error: factor.abs() * error.unwrap_or(0.0),
            is_zero: found.value == 0.0,
        }
    }

    /// A component without the digits below its error: zero if it is no larger.
    fn significant_component(&self, axis: usize) -> f64 {
        round_to_error(self.change[axis], self.error)
    }

    fn change_length(&self) -> f64 {
        let known = [0, 1, 2].map(|axis| self.significant_component(axis));
        DVec3::from_array(known).length()
    }
}

/// The largest magnitude of the numbers of the list or profile of this one.
fn largest_beside(found: &[Sensitivity], number: &Sensitivity) -> f64 {
    let list = |it: &Sensitivity| it.key.rfind('[').map(|end| it.key[..end].to_string());
    let own = list(number);
    let beside = found.iter().filter(|it| own.is_some() && list(it) == own);
    let magnitudes = beside.map(|it| it.value.abs());
    magnitudes.filter(|it| it.is_finite()).fold(0.0, f64::max)
}

pub fn draw(leaf: &Equilibrium, scenario: &Scenario) -> Drawing {
    let found = leaf.sensitivities.as_deref().unwrap_or_default();
    let units = &scenario.units;
    let mut rows: Vec<SensitivityRow> = found
        .iter()
        .map(|it| {
            let largest = largest_beside(found, it);
            SensitivityRow::from_sensitivity(it, largest, leaf.shape.longest(), units)
        })
        .collect();
    rows.sort_by(|a, b| {
        let by_effect = b.change_length().total_cmp(&a.change_length());
        a.is_zero.cmp(&b.is_zero).then(by_effect)
    });
    rows.truncate(LAYOUT.most_rows);
    let reaction = found.iter().any(|found| found.reaction.is_some());
    let (what, unit) = match reaction {
        true => ("force on the holder", units.force.as_deref()),
        false => ("displacement of the tip", units.length.as_deref()),
    };
    let name = match reaction {
        true => "what each number does to the force on the holder",
        false => "what each number does to the tip",
    };
    let name = format!("{}: {name}", leaf.scenario);
    let zeros = match rows.iter().any(|row| row.is_zero) {
        true => ", zeros below",
        false => "",
    };
    let mut notes = vec![format!(
        "each changed by a hundredth, largest effect first{zeros}"
    )];
    let error = rows.iter().map(|row| row.error).fold(0.0, f64::max);
    if error > 0.0 {
        notes.push(format!(
            "no bar where the change is within its error, ≤ {}",
            format_error_bound(error)
        ));
    }
    let mut page = new_page(PAGE.left_margin, &name, &notes, None);
    let height = LAYOUT.row * rows.len().max(1) as f64;
    page.height = PAGE.header + PAGE.panel_title + height + PAGE.panel_axis + PAGE.bottom_margin;
    let width =
        (PAGE.width - PAGE.left_margin - PAGE.right_margin - LAYOUT.words - 2.0 * LAYOUT.gap) / 3.0;
    let corner = DVec2::new(
        PAGE.left_margin + LAYOUT.words,
        PAGE.header + PAGE.panel_title,
    );
    page.draw_group("words", |page| {
        for (k, row) in rows.iter().enumerate() {
            let middle = corner + DVec2::new(-10.0, LAYOUT.row * (k as f64 + 0.5));
            let room = LAYOUT.words + PAGE.left_margin - 16.0;
            for (text, up, color) in [
                (&row.words, -6.5, TEXT_COLOR),
                (&row.change_text, 7.0, NOTE_COLOR),
            ] {
                let text = Font::embedded().shorten_text(text, FONT_SIZE.tick, room);
                let at = middle + DVec2::new(0.0, up);
                page.draw_centered_label(at, &text, FONT_SIZE.tick, TextAnchor::End, color);
            }
        }
    });
    // One scale for all axes, with room for the values beside the bars.
    let largest =
        (rows.iter()).flat_map(|row| [0, 1, 2].map(|axis| row.significant_component(axis).abs()));
    let largest = largest.filter(|it| it.is_finite()).fold(0.0, f64::max);
    let end = if largest > 0.0 {
        (1.0 + 2.0 * LAYOUT.value_room) * largest
    } else {
        1.0
    };
    for (axis, of) in COORDINATE_NAMES.into_iter().enumerate() {
        let shift = DVec2::new(axis as f64 * (width + LAYOUT.gap), 0.0);
        let cell = PageRectangle::new(corner + shift, DVec2::new(width, height));
        let name = if axis == 1 {
            name_with_unit(what, unit)
        } else {
            String::new()
        };
        let across = Axis {
            emphasizes_zero: true,
            tick_spacing: Some(LAYOUT.ticks),
            ..Axis::linear(&name, -end, end)
        };
        page.draw_group("changes", |page| {
            draw_bars(page, cell, &format!("along {of}"), across, &rows, axis);
        });
    }
    page
}

/// Draws the changes along an axis, each with its value.
fn draw_bars(
    page: &mut Drawing,
    cell: PageRectangle,
    what: &str,
    across: Axis,
    rows: &[SensitivityRow],
    axis: usize,
) {
    let axes = PanelAxes::draw_titled(page, cell, ["", what], across, Axis::blank());
    // Values are in the unit of the labels of the axis.
    let unit = 10f64.powi(axes.across.label_power_of_ten());
    let Some(zero) = axes.page_position((0.0, 0.0)) else {
        return;
    };
    for (k, row) in rows.iter().enumerate() {
        let middle = cell.corner.y + LAYOUT.row * (k as f64 + 0.5);
        let value = row.significant_component(axis);
        let Some(end) = axes.page_position((value, 0.0)).filter(|_| value != 0.0) else {
            continue;
        };
        let color = if value > 0.0 { BLUE } else { VERMILION };
        let corner = DVec2::new(zero.x.min(end.x), middle - 0.5 * LAYOUT.bar);
        let size = DVec2::new((end.x - zero.x).abs(), LAYOUT.bar);
        page.draw_shape(rectangle_path(corner, size), color, None);
        let side = value.signum();
        let anchor = if value > 0.0 {
            TextAnchor::Start
        } else {
            TextAnchor::End
        };
        let at = DVec2::new(end.x + side * LAYOUT.value_gap, middle);
        let shown = round_to_error(value, SHOWN_VALUE_PRECISION * value.abs()) / unit;
        page.draw_centered_label(
            at,
            &format_four_digits(shown),
            FONT_SIZE.tick,
            anchor,
            NOTE_COLOR,
        );
    }
    let line = zero.with_y(cell.corner.y);
    page.draw_line(
        line,
        line.with_y(cell.opposite_corner().y),
        Stroke::new(FRAME_COLOR, 0.8),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::formats::checked_svg_text;
    use crate::report::sample;

    /// The sample leaf with numbers that move its tip so far along the axes.
    fn svg(changes: &[(&str, f64, [f64; 3])]) -> String {
        let mut leaf = sample::sample_equilibrium(3, 8);
        let found = changes.iter().map(|(key, value, tip)| Sensitivity {
            key: (*key).into(),
            value: *value,
            tips: vec![DVec3::from_array(*tip)],
            tip_error: Some(1e-6),
            energy: 0.0,
            energy_error: None,
            lowest_eigenvalue: None,
            lowest_eigenvalue_error: None,
            frequencies: Vec::new(),
            reaction: None,
            tip_reaction_error: None,
            grip_reactions: Vec::new(),
            grip_reactions_error: None,
            stations: Vec::new(),
            positions: Vec::new(),
            positions_error: None,
        });
        leaf.sensitivities = Some(found.collect());
        let mut scenario = sample::sample_scenario("fan", 3);
        scenario.units.length = Some("cm".into());
        scenario.units.force = Some("N".into());
        checked_svg_text(&draw(&leaf, &scenario))
    }

    #[test]
    fn bars_have_signs_and_none_is_noise() {
        let svg = svg(&[
            ("stiffness.bending_2", 1.0, [0.0, 1e-9, 0.5]),
            ("load.gravity[2]", -1.0, [0.0, -1e-7, 0.25]),
            ("load.gravity[1]", 0.0, [0.0, 0.0, 0.0]),
            ("coupling.y", 0.0, [0.0, 0.0, 0.0]),
        ]);
        let bars = |color: &str| svg.matches(&format!("fill=\"{color}\"")).count();
        // Up along z, and down: by a hundredth of a negative number.
        assert_eq!([bars("#0072b2"), bars("#d55e00")], [1, 1]);
        for part in [
            ">bending stiffness A2<",
            ">by 1 % of 1 N cm²<",
            ">0, by 1 % of 1 N/cm<",
            ">0, by 0.01 N/cm²<",
            ">5<",
            ">\u{2212}2.5<",
            ">displacement of the tip / 10⁻³ cm<",
        ] {
            assert!(svg.contains(part), "{part}");
        }
    }

    #[test]
    fn nothing_and_extreme_numbers_are_drawn() {
        for value in [f64::NAN, f64::INFINITY, 1e300, 0.0] {
            svg(&[("stiffness.torsion", value, [value, -value, 1.0])]);
        }
        svg(&[]);
    }
}
