//! The leaf at some instants, seen by one camera, to one scale.

use glam::{DVec2, DVec3};

use super::colors::NOTE;
use super::drawing::{Drawing, Path, Step, Stroke};
use super::energy::short;
use super::flat::title;
use super::header::{self, HEADER};
use super::markers::{clamp_marker, tip_markers};
use super::motion::notes;
use super::page::{Cell, PANEL_TITLE, WIDTH};
use super::space::{self, Camera, Room, draw_box, draw_veins, edges_with, surrounding_box};
use super::ticks::round_step;
use super::veins::{Veins, is_near};
use crate::simulate::{Record, Still};

const COLUMNS: usize = 4;
const SIDE: f64 = 22.0;
const GAP: f64 = 12.0;
const LOWEST: f64 = 110.0;
const HIGHEST: f64 = 330.0;
const BOTTOM: f64 = 10.0;

/// Between grid lines at least.
const GRID: f64 = 17.0;

/// Veins are thinner in small panels.
const THINNER: f64 = 0.75;

/// Points of the tip's way that are drawn between two panels at most.
const MOST_WAY: usize = 400;

const NAMES: Room = Room {
    left: 14.0,
    right: 14.0,
    below: 14.0,
};

/// The whole page.
pub fn draw(record: &Record) -> Drawing {
    let name = format!("{} in motion", record.scenario);
    let shapes: Vec<Veins> = record
        .stills
        .iter()
        .map(|still| veins(record, still))
        .collect();
    let lows = shapes.iter().map(|veins| veins.low);
    let highs = shapes.iter().map(|veins| veins.high);
    let (low, high) = surrounding_box(
        lows.reduce(DVec3::min).unwrap_or(DVec3::ZERO),
        highs.reduce(DVec3::max).unwrap_or(DVec3::ZERO),
    );
    let width = (WIDTH - 2.0 * SIDE - (COLUMNS - 1) as f64 * GAP) / COLUMNS as f64;
    let height = height(low, high, width);
    let rows = shapes.len().div_ceil(COLUMNS).max(1);
    let row = PANEL_TITLE + height + GAP;
    let cell = |index: usize| Cell {
        corner: DVec2::new(
            SIDE + (index % COLUMNS) as f64 * (width + GAP),
            HEADER + PANEL_TITLE + (index / COLUMNS) as f64 * row,
        ),
        size: DVec2::new(width, height),
    };
    let step = round_step(GRID / Camera::facing(low, high, cell(0), NAMES).scale());
    let mut drawing = Drawing {
        width: WIDTH,
        height: (HEADER + rows as f64 * row + BOTTOM).ceil(),
        description: name.clone(),
        marks: Vec::new(),
    };
    if let Some(veins) = shapes.first() {
        drawing.group("header", |page| {
            let mut notes = notes(record);
            notes.extend(veins.notes());
            notes.push(format!("a square of the grid is {step} L wide"));
            header::draw_from(SIDE, page, &name, &notes, veins);
        });
    }
    for (index, (veins, still)) in shapes.iter().zip(&record.stills).enumerate() {
        let camera = Camera::facing(low, high, cell(index), NAMES);
        let since = match index {
            0 => still.moment,
            _ => record.stills[index - 1].moment,
        };
        let way = way(record, since, still.moment);
        drawing.group("instant", |page| {
            let time = record.moments.get(still.moment).map_or(0.0, |m| m.time);
            let letter = format!("({})", char::from(b'a' + (index % 26) as u8));
            let when = format!("t = {}", short(time));
            title(page, cell(index).corner, &letter, &when);
            let edges = edges_with(&camera, low, high, |_| step);
            draw_box(page, &camera, low, high, &edges);
            if index == 0 {
                for edge in &edges {
                    space::name(page, &camera, edge, 9.0);
                }
            }
            let thin = THINNER * veins.line_width();
            draw_veins(page, &camera, veins, low.z, thin);
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

/// As high as the box needs in a panel of this width.
fn height(low: DVec3, high: DVec3, width: f64) -> f64 {
    let any = Cell {
        corner: DVec2::ZERO,
        size: DVec2::ONE * (NAMES.left + NAMES.right + 1.0),
    };
    let (first, last) = Camera::facing(low, high, any, NAMES).outline(low, high);
    let needed = (last - first).y / (last - first).x * (width - NAMES.left - NAMES.right);
    (needed + NAMES.below).clamp(LOWEST, HIGHEST)
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
