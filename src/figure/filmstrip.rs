//! A leaf in motion at some instants.

use glam::DVec3;

use super::drawing::{Color, DOT, Drawing, NOTE, Stroke, polyline};
use super::energy::notes;
use super::page::{HEADER, KeyRows, NOTE_BASE, new_page};
use super::setting::Setting;
use super::small::{SIDE, SmallPanels};
use super::veins::{Veins, is_near};
use crate::report::numbers::short;
use crate::scenario::Scenario;
use crate::simulate::{Record, Still};

/// Below the notes.
const KEY_LINE: f64 = 20.0;
/// The tip's way long ago.
const PALE: Color = Color(240, 190, 176);
/// Points of the tip's way that are drawn between two panels at most.
const MOST_WAY: usize = 400;

pub fn draw(record: &Record, scenario: &Scenario) -> Drawing {
    let setting = Setting::of(scenario);
    let name = format!("{}: instants of the motion", record.scenario);
    let stills = record.stills.iter();
    let shapes: Vec<Veins> = stills.map(|still| veins(record, still)).collect();
    let panels = SmallPanels::holding(shapes.iter(), shapes.len(), &setting);
    let has_way = record.tips.len() == 1 && record.stills.len() > 1;
    let panels = match has_way {
        true => panels.below(HEADER + KEY_LINE),
        false => panels,
    };
    let mut notes = notes(record);
    notes.extend(
        shapes
            .iter()
            .take(1)
            .flat_map(|veins| veins.notes(&setting)),
    );
    notes.push(format!("a square of the grid is {} wide", panels.square()));
    let mut drawing = new_page(SIDE, &name, &notes, shapes.first());
    drawing.height = panels.end();
    let mut since = record.stills.first().map_or(0, |still| still.moment);
    let ways = [DOT, PALE].map(|color| Stroke::new(color, 1.0));
    if has_way {
        drawing.group("key", |page| {
            let mut key = KeyRows::at(SIDE, NOTE_BASE + KEY_LINE, 22.0);
            for (name, stroke) in ["the tip's way since the picture before", "and before that"]
                .into_iter()
                .zip(ways)
            {
                key.entry(page, name, |page, cell| cell.line(page, stroke));
            }
        });
    }
    for (index, (veins, still)) in shapes.iter().zip(&record.stills).enumerate() {
        let legs = [way(record, since, still.moment), way(record, 0, since)];
        since = still.moment;
        drawing.group("instant", |page| {
            let time = record.moments.get(still.moment).map_or(0.0, |m| m.time);
            let letter = format!("({})", char::from(b'a' + (index % 26) as u8));
            let when = format!("t = {}", short(time));
            panels.draw(
                page,
                index,
                veins,
                (&letter, &when, NOTE),
                |page, scene, _| {
                    for (leg, stroke) in legs.iter().zip(ways).rev() {
                        let way: Vec<_> = leg.iter().map(|&point| scene.place(point)).collect();
                        if way.len() > 1 {
                            page.stroke(polyline(&way), stroke);
                        }
                    }
                },
            );
        });
    }
    drawing
}

fn veins(record: &Record, still: &Still) -> Veins {
    let joined = if record.joined { 1 } else { still.curves.len() };
    let ends = still.curves.iter().take(joined);
    let tips: Vec<DVec3> = ends.filter_map(|curve| curve.last()).copied().collect();
    Veins::through(&still.curves, &tips, record.length)
}

/// The tip's way from one moment to another, in lengths; none of free tips.
fn way(record: &Record, from: usize, to: usize) -> Vec<DVec3> {
    if record.tips.len() != 1 || from >= to {
        return Vec::new();
    }
    let moments = record.moments.get(from..=to).unwrap_or_default();
    let every = moments.len().div_ceil(MOST_WAY).max(1);
    let points = moments.iter().step_by(every).chain(moments.last());
    points
        .map(|moment| moment.tip / record.length)
        .filter(|&point| is_near(point))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::svg::{hex, text};
    use crate::report::sample;

    #[test]
    fn the_way_of_the_tip_is_drawn() {
        let scenario = sample::scenario("swing", 5);
        let mut record = sample::record(5, 8);
        let ways = |record: &Record| {
            let svg = text(&draw(record, &scenario));
            [DOT, PALE].map(|color| svg.matches(&format!("stroke=\"{}\"", hex(color))).count())
        };
        // In all pictures but the first, or the first two, and in the key.
        assert_eq!(ways(&record), [8, 7]);
        record.joined = false;
        record.tips = record.stills[0]
            .curves
            .iter()
            .map(|curve| curve[0])
            .collect();
        assert_eq!(ways(&record), [0, 0]);
    }
}
