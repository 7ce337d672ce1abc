//! A leaf in motion at some instants.

use glam::DVec3;

use super::drawing::{Drawing, NOTE, Stroke, polyline};
use super::energy::notes;
use super::page::new_page;
use super::small::{SIDE, SmallPanels};
use super::veins::{Veins, is_near};
use crate::report::numbers::short;
use crate::simulate::{Record, Still};

/// Points of the tip's way that are drawn between two panels at most.
const MOST_WAY: usize = 400;

pub fn draw(record: &Record) -> Drawing {
    let name = format!("{} in motion", record.scenario);
    let stills = record.stills.iter();
    let shapes: Vec<Veins> = stills.map(|still| veins(record, still)).collect();
    let panels = SmallPanels::holding(shapes.iter(), shapes.len());
    let mut notes = notes(record);
    notes.extend(shapes.first().map(Veins::notes).unwrap_or_default());
    notes.push(format!("a square of the grid is {} L wide", panels.step));
    let mut drawing = new_page(SIDE, &name, &notes, shapes.first());
    drawing.height = panels.end();
    let mut since = record.stills.first().map_or(0, |still| still.moment);
    for (index, (veins, still)) in shapes.iter().zip(&record.stills).enumerate() {
        let way = way(record, since, still.moment);
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
                    let way: Vec<_> = way.iter().map(|&point| scene.place(point)).collect();
                    if !way.is_empty() {
                        page.stroke(polyline(&way), Stroke::new(NOTE, 0.8));
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
    if record.tips.len() != 1 {
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
