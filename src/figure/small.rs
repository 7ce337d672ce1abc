//! Several leaves in small panels, seen by one camera, to one scale.

use glam::{DVec2, DVec3};

use super::drawing::Drawing;
use super::flat::title;
use super::markers::{clamp_marker, tip_markers};
use super::page::{Cell, PANEL_TITLE, WIDTH};
use super::space::{Camera, Room, draw_box, draw_veins, edges_with, surrounding_box};
use super::ticks::round_step;
use super::veins::Veins;

const COLUMNS: usize = 4;
const SIDE: f64 = 22.0;
const GAP: f64 = 12.0;
const LEAF: f64 = 170.0;

/// Between grid lines at least.
const GRID: f64 = 17.0;

/// Veins are thinner in small panels.
const THINNER: f64 = 0.75;

const ROOM: Room = Room {
    left: 8.0,
    right: 8.0,
    below: 8.0,
};

/// A leaf in the scenario's units, and what it is.
pub struct SmallLeaf<'a> {
    pub curves: &'a [Vec<DVec3>],
    pub tips: &'a [DVec3],
    pub title: String,
}

/// Height of the panels of so many leaves.
pub fn small_height(leaves: usize) -> f64 {
    leaves.div_ceil(COLUMNS) as f64 * (PANEL_TITLE + LEAF + GAP)
}

/// Draws them below `top`, numbered from 1.
pub fn small_leaves(page: &mut Drawing, leaves: &[SmallLeaf], top: f64) {
    let length = |rod: &Vec<DVec3>| rod.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>();
    let rods = leaves.iter().flat_map(|leaf| leaf.curves);
    let longest = rods.map(length).fold(0.0, f64::max);
    let veins: Vec<Veins> = leaves
        .iter()
        .map(|leaf| Veins::through(leaf.curves, leaf.tips, longest))
        .collect();
    let lows = veins.iter().map(|veins| veins.low);
    let highs = veins.iter().map(|veins| veins.high);
    let (low, high) = surrounding_box(
        lows.reduce(DVec3::min).unwrap_or(DVec3::ZERO),
        highs.reduce(DVec3::max).unwrap_or(DVec3::ZERO),
    );
    let width = (WIDTH - 2.0 * SIDE - (COLUMNS - 1) as f64 * GAP) / COLUMNS as f64;
    for (number, (veins, leaf)) in veins.iter().zip(leaves).enumerate() {
        let (row, column) = (number / COLUMNS, number % COLUMNS);
        let cell = Cell {
            corner: DVec2::new(
                SIDE + column as f64 * (width + GAP),
                top + PANEL_TITLE + row as f64 * (PANEL_TITLE + LEAF + GAP),
            ),
            size: DVec2::new(width, LEAF),
        };
        let camera = Camera::facing(low, high, cell, ROOM);
        let step = round_step(GRID / camera.scale());
        title(page, cell.corner, &(number + 1).to_string(), &leaf.title);
        let edges = edges_with(&camera, low, high, |_| step);
        draw_box(page, &camera, low, high, &edges);
        draw_veins(page, &camera, veins, low.z, THINNER * veins.line_width());
        clamp_marker(page, camera.place(DVec3::ZERO));
        tip_markers(page, veins, |tip| camera.place(tip));
    }
}
