//! The leaf at some instants, seen by one camera, to one scale.

use glam::DVec3;

use super::colors::NOTE;
use super::drawing::{Drawing, Path, Step, Stroke};
use super::energy::short;
use super::flat::title;
use super::header;
use super::markers::{clamp_marker, tip_markers};
use super::motion::notes;
use super::page::WIDTH;
use super::space::{self, Camera, draw_box, draw_veins};
use super::strip::{SIDE, Strip, THINNER};
use super::veins::{Veins, is_near};
use crate::simulate::{Record, Still};

/// Points of the tip's way that are drawn between two panels at most.
const MOST_WAY: usize = 400;

/// The whole page.
pub fn draw(record: &Record) -> Drawing {
    let name = format!("{} in motion", record.scenario);
    let shapes: Vec<Veins> = record
        .stills
        .iter()
        .map(|still| veins(record, still))
        .collect();
    let strip = Strip::holding(shapes.iter(), shapes.len());
    let mut drawing = Drawing {
        width: WIDTH,
        height: strip.end(),
        description: name.clone(),
        marks: Vec::new(),
    };
    if let Some(veins) = shapes.first() {
        drawing.group("header", |page| {
            let mut notes = notes(record);
            notes.extend(veins.notes());
            notes.push(format!("a square of the grid is {} L wide", strip.step));
            header::draw_from(SIDE, page, &name, &notes, veins);
        });
    }
    for (index, (veins, still)) in shapes.iter().zip(&record.stills).enumerate() {
        let camera = strip.camera(index);
        let since = match index {
            0 => still.moment,
            _ => record.stills[index - 1].moment,
        };
        let way = way(record, since, still.moment);
        drawing.group("instant", |page| {
            let time = record.moments.get(still.moment).map_or(0.0, |m| m.time);
            let letter = format!("({})", char::from(b'a' + (index % 26) as u8));
            let when = format!("t = {}", short(time));
            title(page, strip.cell(index).corner, &letter, &when);
            let edges = strip.edges(&camera);
            draw_box(page, &camera, strip.low, strip.high, &edges);
            if index == 0 {
                for edge in &edges {
                    space::name(page, &camera, edge, 9.0);
                }
            }
            let thin = THINNER * veins.line_width();
            draw_veins(page, &camera, veins, strip.low.z, thin);
            draw_way(page, &camera, &way);
            clamp_marker(page, camera.place(DVec3::ZERO));
            tip_markers(page, veins, |tip| camera.place(tip));
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

fn draw_way(page: &mut Drawing, camera: &Camera, way: &[DVec3]) {
    let mut path: Path = way
        .iter()
        .map(|&point| Step::Line(camera.place(point)))
        .collect();
    if let Some(first) = way.first() {
        path[0] = Step::Move(camera.place(*first));
        page.stroke(path, Stroke::new(NOTE, 0.8));
    }
}
