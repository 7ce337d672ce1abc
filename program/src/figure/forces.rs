//! Dead forces on a rod as arrows, on its tip, on points and along it.

use crate::figure::drawing::{Anchor, Drawing, INK, NOTE, Stroke, polygon};
use crate::figure::font::Font;
use crate::figure::layout::{Cell, TICK_SIZE};
use crate::figure::marks::{Action, LoadMark, load_marks};
use crate::report::numbers::short;
use glam::{DVec2, DVec3};
use leafdyn::scenario::Scenario;

/// Length and half the width of the heads of arrows, in pixels.
const HEAD: [f64; 2] = [10.0, 4.2];
const SMALL_HEAD: [f64; 2] = [6.0, 2.6];
/// From an arrow to the middle of its label.
const GAP: f64 = 9.0;
/// An arrow that is shorter on the page is seen end-on.
const ARROW_END_ON: f64 = 6.0;

/// The arrow of a force on a rod.
pub struct Force {
    /// From its tail to its head.
    pub ends: [DVec3; 2],
    head: [f64; 2],
    /// Empty of those along the rod.
    label: String,
}

/// The forces on a single rod whose largest extent is `extent`; `at` gives the point at a fraction of
/// its length, with the tangent there.
pub fn forces(
    scenario: &Scenario,
    extent: f64,
    at: impl Fn(f64) -> Option<(DVec3, DVec3)>,
) -> Vec<Force> {
    let unit = scenario.units.force.as_deref();
    let unit = unit.map_or(String::new(), |unit| format!(" {unit}"));
    let marks = load_marks(scenario, None).into_iter();
    let arrow = |mark: LoadMark| {
        let (place, tangent) = at(mark.at)?;
        let along = mark.action == Action::Distributed;
        // One that pushes against the rod ends at the point, any other begins there.
        let pushes = mark.direction.dot(tangent) < -0.5;
        let start = if pushes || along { -1.0 } else { 0.0 };
        let reach = mark.length * extent * mark.direction;
        Some(Force {
            ends: [start, start + 1.0].map(|part| place + part * reach),
            head: if along { SMALL_HEAD } else { HEAD },
            label: match along {
                true => String::new(),
                false => format!("force {}{unit}", short(mark.size)),
            },
        })
    };
    let forces = marks.filter(|mark| mark.action != Action::Moment);
    forces.filter_map(arrow).collect()
}

impl Force {
    /// Draws it; its label stays inside the panel.
    pub fn draw(&self, page: &mut Drawing, cell: Cell, place: impl Fn(DVec3) -> DVec2) {
        let [tail, tip] = self.ends.map(place);
        let [length, half] = self.head;
        let along = (tip - tail).normalize_or_zero();
        if (tip - tail).length() > ARROW_END_ON {
            let (neck, side) = (tip - length * along, half * along.perp());
            page.line(tail, neck, Stroke::new(INK, 1.5));
            page.shape(polygon(&[tip, neck + side, neck - side]), INK, None);
        }
        // Beside the middle of the arrow, or below it where it lies flat.
        let size = DVec2::new(Font::embedded().width(&self.label, TICK_SIZE), TICK_SIZE);
        let side = if along.x.abs() < 0.7 {
            DVec2::X
        } else {
            DVec2::Y
        };
        let reach = GAP + 0.5 * (size * side).element_sum();
        let middle = 0.5 * (tail + tip) + reach * side;
        let (low, high) = (
            cell.corner + 0.5 * size + 3.0,
            cell.end() - 0.5 * size - 3.0,
        );
        let middle = middle.max(low).min(high);
        page.centered_label(middle, &self.label, TICK_SIZE, Anchor::Middle, NOTE);
    }
}
