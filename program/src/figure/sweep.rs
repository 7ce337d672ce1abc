//! Leaves over one or several numbers: a panel for each quantity, with a curve over the first number for every
//! combination of the others or, where two numbers have many values, the quantity as the color of cells.

use crate::figure::drawing::axes::{Axis, PanelAxes};
use crate::figure::drawing::labels::{Legend, new_page};
use crate::figure::drawing::markers::Marker;
use crate::figure::drawing::{
    CURVE_COLORS, Color, Drawing, FONT_SIZE, PAGE, PageRectangle, Stroke, TEXT_COLOR, TextAnchor,
    panel_letters, rectangle_path, vein_color,
};
use crate::figure::map::VariedAxis;
use crate::figure::scenario::{QuantityLabel, name_with_unit};
use crate::report::numbers::{format_four_digits, vein_count_text};
use glam::DVec2;
use leafdyn::scenario::{Scenario, Units};
use leafdyn::study::{LeafQuantity, ParameterSweep, Sweep, SweepRow};

/// Sizes of the panels, in pixels.
struct SweepLayout {
    /// The first panel, and further ones.
    diagram: f64,
    further: f64,
    /// Width right of the panels, for the key.
    key: f64,
    /// Height of a panel of cells.
    cells: f64,
    /// Side of the mark of a leaf that has no value.
    gap_mark: f64,
}

const LAYOUT: SweepLayout = SweepLayout {
    diagram: 380.0,
    further: 260.0,
    key: 190.0,
    cells: 420.0,
    gap_mark: 3.0,
};

/// More curves than this are drawn as cells, where two numbers vary.
const MOST_CURVES: usize = CURVE_COLORS.len();

/// Colors in the key of a panel of cells.
const KEY_COLORS: usize = 5;

/// Variations, as a part of the largest value, that are rounding.
const ROUNDING_VARIATION: f64 = 1e-9;

/// Cells without a value.
const NO_VALUE_COLOR: Color = Color(240, 240, 242);

pub fn draw(sweep: &Sweep, scenario: &Scenario) -> Drawing {
    let (request, units) = (&sweep.request, &scenario.units);
    let labels: Vec<QuantityLabel> = (request.axes.iter())
        .map(|axis| QuantityLabel::from_keys(&axis.keys.to_string(), units))
        .collect();
    let words: Vec<&str> = labels.iter().map(|label| label.words.as_str()).collect();
    let title = format!("{}: {} varied", scenario.name, words.join(", "));
    let mut drawing = new_page(
        PAGE.left_margin,
        &title,
        &header_notes(sweep, scenario),
        None,
    );
    let as_cells = is_drawn_as_cells(&request.axes);
    let (mut letters, mut below) = (panel_letters(), PAGE.header);
    let shown = sweep.shown();
    // One panel needs no letter, and a curve alone no key.
    let is_only = shown.len() == 1;
    let key = match request.axes.len() {
        1 => 0.0,
        _ => LAYOUT.key,
    };
    for (place, quantity) in shown.into_iter().enumerate() {
        let letter = letters.next().filter(|_| !is_only).unwrap_or_default();
        let height = match (as_cells, place) {
            (true, _) => LAYOUT.cells,
            (false, 0) => LAYOUT.diagram,
            (false, _) => LAYOUT.further,
        };
        let cell = PageRectangle::left_of_legend(below + PAGE.panel_title, height, key);
        let panel = SweepPanel {
            sweep,
            units,
            quantity,
            cell,
            letter,
        };
        drawing.draw_group("sweep", |page| match as_cells {
            true => panel.draw_cells(page),
            false => panel.draw_curves(page, &labels, place == 0),
        });
        below = cell.opposite_corner().y + PAGE.panel_axis;
    }
    drawing.height = below;
    drawing
}

fn is_drawn_as_cells(axes: &[ParameterSweep]) -> bool {
    matches!(axes, [_, second] if second.values.len() > MOST_CURVES)
}

fn header_notes(sweep: &Sweep, scenario: &Scenario) -> Vec<String> {
    let request = &sweep.request;
    let mut notes = Vec::new();
    let mut axes = request.axes.iter();
    if !axes.any(|axis| axis.keys.to_string() == "leaf.rods") {
        notes.push(vein_count_text(scenario.rods.len()));
    }
    let (known, all) = (sweep.rows.len(), request.leaves());
    notes.push(match known < all {
        true => format!("{known} of {all} leaves"),
        false => format!("{all} leaves"),
    });
    let failed = sweep.rows.iter().filter(|row| !row.success).count();
    if failed > 0 {
        notes.push(format!("{failed} not at rest within the tolerance"));
    }
    notes
}

/// The name of the axis of a quantity, with its unit.
fn quantity_name(quantity: LeafQuantity, units: &Units) -> String {
    let axis = |axis: usize| ["x", "y", "z"][axis];
    let words = match quantity {
        LeafQuantity::Tip(k) => format!("{} of the tip", axis(k)),
        LeafQuantity::BaseForce(k) => format!("force on the base along {}", axis(k)),
        LeafQuantity::BaseMoment(k) => format!("moment on the base about {}", axis(k)),
        LeafQuantity::Reaction(k) => format!("reaction along {}", axis(k)),
        LeafQuantity::Grip { grip, axis: k } => {
            format!("force on grip {} along {}", grip + 1, axis(k))
        }
        LeafQuantity::PeakStress => "largest equivalent stress".into(),
        LeafQuantity::Frequency(mode) => format!("frequency {}", mode + 1),
        LeafQuantity::GrowthRate(mode) => format!("growth rate {}", mode + 1),
        LeafQuantity::NegativeEigenvalues => "Morse index".into(),
        LeafQuantity::MarginWaves => "waves along the margins".into(),
        LeafQuantity::MarginAmplitude => "amplitude of the waves".into(),
        LeafQuantity::Twist => return name_with_unit("mean twist", Some("rad")),
        named => named.to_string().replace('_', " "),
    };
    let unit = match quantity {
        LeafQuantity::Frequency(_) => units.frequency(),
        _ => units.unit_name(quantity.dimension()),
    };
    name_with_unit(&words, unit.as_deref())
}

/// The panel of a quantity.
struct SweepPanel<'s> {
    sweep: &'s Sweep,
    units: &'s Units,
    quantity: LeafQuantity,
    cell: PageRectangle,
    letter: String,
}

impl SweepPanel<'_> {
    fn value(&self, row: &SweepRow) -> Option<f64> {
        let value = self.sweep.number(row, self.quantity)?;
        value.is_finite().then_some(value)
    }

    fn known_values(&self) -> impl Iterator<Item = f64> {
        self.sweep.rows.iter().filter_map(|row| self.value(row))
    }

    /// Draws a curve over the first number for every combination of the others.
    fn draw_curves(&self, page: &mut Drawing, labels: &[QuantityLabel], with_key: bool) {
        let axes = &self.sweep.request.axes;
        let (first, others) = (&axes[0], axes[1..].iter());
        let curves: usize = others.map(|axis| axis.values.len()).product();
        let sign = first.log.then(|| first.values[0].signum());
        let across = VariedAxis::over_values(first, &labels[0].axis_name(), sign);
        let largest = self.known_values().fold(0.0, |a: f64, b| a.max(b.abs()));
        let up = Axis::linear_covering(
            &quantity_name(self.quantity, self.units),
            self.known_values(),
        )
        .with_least_extent(ROUNDING_VARIATION * largest);
        let panel = PanelAxes::draw_titled(page, self.cell, [&self.letter, ""], across, up);
        let mut key = Legend::right_of(self.cell);
        for curve in 0..curves {
            let points = self.curve_points(curve, curves);
            let color = curve_color(curve, curves);
            panel.draw_curve(page, &points, Stroke::new(color, 1.6));
            panel.draw_markers(page, points, Marker::Dot, color);
            if with_key && curves > 1 && is_named(curve, curves) {
                let texts = self.sweep.request.texts(curve);
                let name = labels.iter().zip(&texts).skip(1);
                let name = name.map(|(label, text)| {
                    name_with_unit(&format!("{} = {text}", label.words), label.unit.as_deref())
                });
                key.add_marked_line(page, &name.collect::<Vec<_>>().join(", "), "", color);
            }
        }
        if with_key && curves > MOST_CURVES {
            key.add_entry(page, "", "and those between", |_, _| ());
        }
        self.mark_gaps(page, &panel);
    }

    /// A curve of the leaves that differ in the first number alone, with gaps where a value is not known.
    fn curve_points(&self, curve: usize, curves: usize) -> Vec<(f64, f64)> {
        let values = &self.sweep.request.axes[0].values;
        let mut points: Vec<(f64, f64)> = values.iter().map(|&x| (x, f64::NAN)).collect();
        for row in &self.sweep.rows {
            if row.leaf % curves == curve {
                points[row.leaf / curves].1 = self.value(row).unwrap_or(f64::NAN);
            }
        }
        points
    }

    /// Marks the values of the first number at which a leaf has no value, at the foot of the panel.
    fn mark_gaps(&self, page: &mut Drawing, panel: &PanelAxes) {
        let foot = self.cell.opposite_corner().y;
        for row in &self.sweep.rows {
            if self.value(row).is_some() {
                continue;
            }
            let (_, x) = self.sweep.request.values(row.leaf)[0];
            let along = self.cell.corner.x + self.cell.size.x * panel.across.fraction(x);
            if along.is_finite() {
                let at = DVec2::new(along, foot - 2.0 * LAYOUT.gap_mark);
                Marker::Cross.draw(page, at, TEXT_COLOR);
            }
        }
    }

    /// Draws the quantity of every leaf as the color of a cell over two numbers.
    fn draw_cells(&self, page: &mut Drawing) {
        let request = &self.sweep.request;
        let [x, y] = [0, 1].map(|k| VariedAxis::from_sweep(&request.axes[k], self.units));
        let ends = self.known_values().map(|value| [value, value]);
        let ends = ends.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        let [low, high] = ends.unwrap_or([0.0, 1.0]);
        let color = |value: f64| match high > low {
            true => vein_color((value - low) / (high - low)),
            false => vein_color(0.5),
        };
        for row in &self.sweep.rows {
            let position = request.position(row.leaf);
            let tile = VariedAxis::cell_rectangle(self.cell, [&x, &y], [position[0], position[1]]);
            let fill = self.value(row).map_or(NO_VALUE_COLOR, color);
            page.draw_shape(rectangle_path(tile.corner, tile.size), fill, None);
        }
        let axes = PanelAxes {
            cell: self.cell,
            across: x.axis,
            up: y.axis,
        };
        axes.draw_without_grid(page);
        let name = quantity_name(self.quantity, self.units);
        let base = self.cell.corner - DVec2::new(0.0, 8.0);
        let title = format!("{}  {name}", self.letter);
        page.draw_label(
            base,
            title.trim(),
            FONT_SIZE.text,
            TextAnchor::Start,
            TEXT_COLOR,
        );
        let mut key = Legend::right_of(self.cell);
        for step in (0..KEY_COLORS).rev() {
            let value = low + (high - low) * step as f64 / (KEY_COLORS - 1) as f64;
            let name = format_four_digits(value);
            key.add_entry(page, &name, "", |page, sample| {
                page.draw_shape(
                    rectangle_path(sample.corner, sample.size),
                    color(value),
                    None,
                )
            });
        }
        if self.sweep.rows.iter().any(|row| self.value(row).is_none()) {
            key.add_entry(page, "not known", "", |page, sample| {
                page.draw_shape(
                    rectangle_path(sample.corner, sample.size),
                    NO_VALUE_COLOR,
                    None,
                )
            });
        }
    }
}

fn curve_color(curve: usize, curves: usize) -> Color {
    match curves <= MOST_CURVES {
        true => CURVE_COLORS[curve],
        false => vein_color(curve as f64 / (curves - 1) as f64),
    }
}

/// Whether the key names a curve: of many the first, the last and some between.
fn is_named(curve: usize, curves: usize) -> bool {
    let every = curves.div_ceil(MOST_CURVES);
    curve.is_multiple_of(every) || curve + 1 == curves
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::formats::checked_svg_text;
    use crate::report::sample;

    fn svg(vary: &[&str], show: &[&str]) -> String {
        let mut sweep = sample::sample_sweep(vary);
        sweep.show = show.iter().map(|name| name.parse().unwrap()).collect();
        checked_svg_text(&draw(&sweep, sweep.request.base.scenario()))
    }

    #[test]
    fn a_curve_over_a_number_and_one_for_each_value_of_a_second() {
        let one = svg(&["load.gravity[2]=-1..-3:3"], &[]);
        assert!(
            one.contains(">z of the tip<") && one.contains(">3 leaves<")
                || one.contains("3 leaves")
        );
        assert!(!one.contains(">(a)<"), "{one}");
        let two = svg(
            &["load.gravity[2]=-1..-3:3", "stiffness.bending_2=1..2:2"],
            &["tip_z", "frequency_1"],
        );
        assert!(two.contains("frequency 1"), "{two}");
        assert!(two.contains(">(a)<") && two.contains(">(b)<"), "{two}");
        for text in ["= 1.0", "= 2.0"] {
            assert!(two.contains(text), "{text}");
        }
    }

    /// A leaf that is refused leaves a gap and a cross.
    #[test]
    fn what_is_not_known_is_a_gap() {
        let whole = svg(&["stiffness.torsion=1..2:2"], &["tip_z"]);
        let gap = svg(&["stiffness.torsion=-1..1:3"], &["tip_z"]);
        assert!(gap.contains("2 not at rest within the tolerance"));
        assert!(!whole.contains("not at rest"));
    }

    #[test]
    fn many_values_of_two_numbers_are_cells() {
        let cells = svg(
            &["load.gravity[2]=-1..-2:2", "stiffness.bending_2=1..2:9"],
            &["tip_z"],
        );
        assert_eq!(cells.matches("Z\" fill").count(), 18 + KEY_COLORS);
    }
}
