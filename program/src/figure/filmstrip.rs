//! A moving leaf at several instants.

use super::energy::notes;
use crate::figure::curve::is_drawable;
use crate::figure::drawing::{Color, DOT, Drawing, NOTE, Stroke, polyline};
use crate::figure::layout::{HEADER, letters};
use crate::figure::page::{KeyRows, NOTE_BASE, new_page};
use crate::figure::setting::Setting;
use crate::figure::small::{SIDE, SmallPanels, THINNER};
use crate::figure::space::OBLIQUE;
use crate::figure::veins::Veins;
use crate::report::numbers::{in_unit, short};
use glam::DVec3;
use leafdyn::scenario::Scenario;
use leafdyn::scenario::units::TIME;
use leafdyn::simulate::Record;

/// Below the notes.
const KEY_LINE: f64 = 20.0;
/// Colour of the earlier path of the tip.
const PALE: Color = Color(240, 190, 176);
/// Most points of the tip's path that are drawn between two panels.
const MOST_PATH_POINTS: usize = 400;

pub fn draw_filmstrip(record: &Record, scenario: &Scenario) -> Drawing {
    let setting = Setting::of(scenario);
    let name = format!("{}: instants of the motion", record.scenario);
    let stills = record.stills.iter();
    let shapes: Vec<Veins> = stills
        .map(|it| Veins::at_instant(record, it, scenario))
        .collect();
    let has_path = record.tips.len() == 1 && record.stills.len() > 1;
    let top = if has_path { HEADER + KEY_LINE } else { HEADER };
    let panels = SmallPanels::holding(shapes.iter(), shapes.len(), &setting, top);
    let mut notes = notes(record);
    let first = shapes.first();
    notes.extend(first.map_or(Vec::new(), |veins| veins.notes(&setting)));
    let width = panels.grid_width();
    notes.push(format!("a square of the grid is {width} wide"));
    let mut drawing = new_page(SIDE, &name, &notes, first);
    drawing.height = panels.end();
    let mut since = record.stills.first().map_or(0, |still| still.moment);
    let strokes = [DOT, PALE].map(|color| Stroke::new(color, 1.0));
    if has_path {
        drawing.group("key", |page| {
            let mut key = KeyRows::at(SIDE, NOTE_BASE + KEY_LINE, 22.0);
            for (name, stroke) in ["the tip's way since the picture before", "and before that"]
                .into_iter()
                .zip(strokes)
            {
                key.entry(page, name, |page, cell| cell.line(page, stroke));
            }
        });
    }
    let instants = shapes.iter().zip(&record.stills).enumerate();
    for ((index, (veins, still)), letter) in instants.zip(letters().cycle()) {
        let paths = [(since, still.moment), (0, since)];
        let paths = paths.map(|(from, to)| tip_path(record, from, to));
        since = still.moment;
        drawing.group("instant", |page| {
            let time = record.moments.get(still.moment).map_or(0.0, |m| m.time);
            let when = format!("t = {}", in_unit(short(time), &scenario.units, TIME));
            let caption = (letter.as_str(), when.as_str(), NOTE);
            let scene = panels.begin(page, (index, time), OBLIQUE, caption);
            for (path, stroke) in paths.iter().zip(strokes).rev() {
                let path: Vec<_> = path.iter().map(|&point| scene.place(point)).collect();
                if path.len() > 1 {
                    page.stroke(polyline(&path), stroke);
                }
            }
            scene.draw_leaf(page, veins, THINNER * veins.line_width());
        });
    }
    drawing
}

/// The path of the tip from one moment to another, in lengths; empty for free tips.
fn tip_path(record: &Record, from: usize, to: usize) -> Vec<DVec3> {
    if record.tips.len() != 1 || from >= to {
        return Vec::new();
    }
    let moments = record.moments.get(from..=to).unwrap_or_default();
    let every = moments.len().div_ceil(MOST_PATH_POINTS).max(1);
    let points = moments.iter().step_by(every).chain(moments.last());
    points
        .map(|moment| moment.tip / record.length)
        .filter(|&point| is_drawable(point))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::svg::{hex, text};
    use crate::report::sample;

    #[test]
    fn the_path_of_the_tip_is_drawn() {
        let scenario = sample::scenario("swing", 5);
        let mut record = sample::record(5, 8);
        let paths = |record: &Record| {
            let svg = text(&draw_filmstrip(record, &scenario));
            [DOT, PALE].map(|color| svg.matches(&format!("stroke=\"{}\"", hex(color))).count())
        };
        // In all pictures but the first, or the first two, and in the key.
        assert_eq!(paths(&record), [8, 7]);
        record.joined = false;
        let curves = record.stills[0].curves.iter();
        record.tips = curves.map(|curve| curve[0]).collect();
        assert_eq!(paths(&record), [0, 0]);
    }
}
