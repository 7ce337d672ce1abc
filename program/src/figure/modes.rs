//! The modes of a leaf at rest: each mode drawn over the leaf.

use crate::figure::drawing::labels::new_page;
use crate::figure::drawing::space::{
    FRONT_VIEW, OBLIQUE_VIEW, SMALL_LINE_WIDTH_FACTOR, SmallPanels, ViewAngles,
};
use crate::figure::drawing::veins::{DrawnVeins, vein_tips};
use crate::figure::drawing::{
    Color, Drawing, FRAME_COLOR, NOTE_COLOR, PAGE, PanelCaption, SECOND_SOLUTION_COLOR, Stroke,
};
use crate::figure::scenario::FigureSetting;
use crate::report::numbers::format_four_digits;
use crate::report::relaxation_verdict;
use glam::DVec3;
use leafdyn::relax::{Equilibrium, Mode};
use leafdyn::scenario::Scenario;

const MOST_MODES_DRAWN: usize = 12;

/// A motion towards the viewer in one view is visible in the other.
const VIEWS: [ViewAngles; 2] = [OBLIQUE_VIEW, FRONT_VIEW];

/// Largest displacement drawn, as a fraction of the leaf's extent.
const LARGEST_DRAWN_AMPLITUDE: f64 = 0.2;

pub fn draw(equilibrium: &Equilibrium, scenario: &Scenario) -> Drawing {
    let setting = FigureSetting::from_scenario(scenario);
    let name = format!("{}: modes", equilibrium.scenario);
    let rest = DrawnVeins::from_equilibrium(equilibrium, scenario);
    let modes = equilibrium.stability.modes.as_deref().unwrap_or_default();
    let drawn = &modes[..modes.len().min(MOST_MODES_DRAWN)];
    let shapes = drawn
        .iter()
        .map(|mode| displaced_veins(equilibrium, &rest, mode));
    let shapes: Vec<DrawnVeins> = shapes.collect();
    // Every mode in two views.
    let count = VIEWS.len() * drawn.len();
    let panels =
        SmallPanels::fitted_to_shapes(shapes.iter().chain([&rest]), count, &setting, PAGE.header);
    let mut notes = vec![
        format!("N = {}", rest.count),
        relaxation_verdict(equilibrium),
    ];
    notes.push(match modes.len() {
        count if count > MOST_MODES_DRAWN => format!("the lowest {MOST_MODES_DRAWN} of {count}"),
        count => format!("the lowest {count}"),
    });
    notes.push("grey: at rest".into());
    notes.extend(rest.leaf_notes(&setting));
    let mut drawing = new_page(PAGE.side_margin, &name, &notes, Some(&rest));
    drawing.height = panels.bottom();
    for (index, (mode, veins)) in drawn.iter().zip(&shapes).enumerate() {
        drawing.draw_group("mode", |page| {
            let (number, text) = ((index + 1).to_string(), mode_text(mode));
            let captions = [
                PanelCaption {
                    letter: &number,
                    text: &text,
                    color: mode_color(mode),
                },
                PanelCaption {
                    letter: "",
                    text: "from the front",
                    color: NOTE_COLOR,
                },
            ];
            for (k, (view, caption)) in VIEWS.into_iter().zip(captions).enumerate() {
                let place = VIEWS.len() * index + k;
                let scene = panels.draw_empty_panel(page, place, 0.0, view, caption);
                let width = SMALL_LINE_WIDTH_FACTOR * veins.line_width();
                for vein in &rest.veins {
                    let path = vein.projected_path(|point| scene.project_point(point));
                    page.draw_stroke(path, Stroke::new(FRAME_COLOR, 0.6 * width));
                }
                scene.draw_leaf(page, veins, width);
            }
        });
    }
    drawing
}

/// The frequency of a mode or, if it is unstable, its growth rate.
fn mode_text(mode: &Mode) -> String {
    match (mode.is_neutral(), mode.growth()) {
        (true, _) => "neutral: ω = 0".into(),
        (_, None) => {
            let frequency = format_four_digits(mode.frequency().unwrap_or_default());
            format!("ω = {frequency}")
        }
        (_, Some(growth)) => format!("unstable: grows at {}", format_four_digits(growth)),
    }
}

/// Unstable modes are red.
fn mode_color(mode: &Mode) -> Color {
    match mode.growth() {
        Some(_) if !mode.is_neutral() => SECOND_SOLUTION_COLOR,
        _ => NOTE_COLOR,
    }
}

fn displaced_veins(equilibrium: &Equilibrium, rest: &DrawnVeins, mode: &Mode) -> DrawnVeins {
    let most = |shape: &[DVec3]| shape.iter().fold(0.0_f64, |m, d| m.max(d.length()));
    let largest = mode.displacement.iter().fold(0.0, |m, d| most(d).max(m));
    let size = match largest > 0.0 {
        // Never magnified: displacements are small in a mode of rotation alone.
        true => (LARGEST_DRAWN_AMPLITUDE * rest.largest_extent() * rest.unit / largest).min(1.0),
        false => 0.0,
    };
    let shape = &equilibrium.shape;
    let moved = shape.curves.iter().zip(&mode.displacement);
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
                displacement: shape.clone(),
                rotation: shape,
            };
            leaf.stability.modes = Some(vec![mode; 14]);
            let svg = checked_svg_text(&draw(&leaf, &sample::sample_scenario("fan", 3)));
            assert_eq!(svg.matches(caption).count(), MOST_MODES_DRAWN, "{caption}");
            assert!(svg.contains("the lowest 12 of 14"));
            // Every mode in a second view.
            assert_eq!(svg.matches(">from the front<").count(), MOST_MODES_DRAWN);
        }
    }
}
