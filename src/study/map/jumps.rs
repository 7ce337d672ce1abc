//! Jumps: neighbouring cells in which the leaf rests in different equilibria.
//!
//! Pairs of cells whose answers are farther apart than those of the neighbouring pairs are
//! bisected: the leaf is relaxed at the midpoint, then at that of the half in which it moves
//! more. The displacement of a continuous branch decreases with bisection; a jump does not.

use crate::clock::Instant;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use rayon::prelude::*;
use serde::Serialize;

use super::Map;
use super::cell::relaxed;
use super::request::MapRequest;
use super::row::{MapMethod, MapRow};
use crate::branch::value_between;
use crate::largest::larger;
use crate::limit::Limit;
use crate::relax::Method;
use crate::scenario::longest;
use crate::study::judge::Answer;

/// Leaves closer than this, in lengths, count as the same.
const SAME: f64 = 0.01;

/// A pair is examined if its tips, or its twists, are farther apart than those of
/// a neighbouring pair by this factor.
const FARTHER: f64 = 1.5;

/// At the midpoint, a leaf on a continuous branch is nearer to the mean of both ends than this
/// part of their distance.
const NEAR_MIDDLE: f64 = 0.1;

/// Number of bisections: near a fold or a branch point a leaf moves as the square root of the
/// distance from it, here a sixty-fourth.
const HALVES: usize = 12;

/// Two neighbouring cells between which the leaf jumps to another equilibrium.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MapJump {
    /// The key that varies between them.
    pub key: String,
    /// The varied values of one cell.
    pub from: Vec<String>,
    /// Those of the other.
    pub to: Vec<String>,
    /// The two values of the key between which it jumps.
    pub between: [f64; 2],
    /// Size of the jump, in units of length.
    pub distance: f64,
}

/// Two neighbouring cells along an axis.
struct Pair {
    axis: usize,
    cells: [usize; 2],
}

impl Map {
    /// Searches for jumps of the leaf to another equilibrium between neighbouring cells, by the
    /// default method, and stores them in `jumps`.
    /// `progress` is called with the number of pairs examined and their total number.
    pub fn find_jumps(&mut self, progress: &(dyn Fn(usize, usize) + Sync)) {
        self.jumps = Some(jumps(&self.request, &self.rows, progress));
    }
}

fn jumps(
    request: &MapRequest,
    rows: &[MapRow],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Vec<MapJump> {
    let method = MapMethod::default();
    let mut known: Vec<Option<&MapRow>> = vec![None; request.cells()];
    let at_rest = |row: &&MapRow| row.method == method && row.tip_x.is_some();
    for row in rows.iter().filter(at_rest) {
        known[row.cell] = Some(row);
    }
    let pairs: Vec<Pair> = pairs(request)
        .filter(|pair| may_jump(request, &known, pair))
        .collect();
    let done = AtomicUsize::new(0);
    let found = pairs.par_iter().map(|pair| {
        let found = jump(request, pair);
        progress(1 + done.fetch_add(1, Ordering::Relaxed), pairs.len());
        found
    });
    found.flatten().collect()
}

fn pairs(request: &MapRequest) -> impl Iterator<Item = Pair> {
    (0..request.cells()).flat_map(move |cell| {
        (0..request.axes.len()).filter_map(move |axis| {
            let next = neighbour(request, cell, axis, 1)?;
            let cells = [cell, next];
            Some(Pair { axis, cells })
        })
    })
}

/// The cell at a signed offset along an axis.
fn neighbour(request: &MapRequest, cell: usize, axis: usize, offset: isize) -> Option<usize> {
    let later = request.axes.iter().skip(axis + 1);
    let stride: usize = later.map(|axis| axis.values.len()).product();
    let at = request.place(cell)[axis].checked_add_signed(offset)?;
    let there = at < request.axes[axis].values.len();
    there.then(|| cell.wrapping_add_signed(offset * stride as isize))
}

/// Whether the leaf may jump between two cells, by comparison with neighbouring rows. If
/// its tip is held, only its shape can show it.
fn may_jump(request: &MapRequest, known: &[Option<&MapRow>], pair: &Pair) -> bool {
    let [a, b] = pair.cells;
    let distances = |a: usize, b: usize| Some(distances(known[a]?, known[b]?));
    let Some(own) = distances(a, b) else {
        return false;
    };
    let scenario = request.base.scenario();
    if scenario.held_tip.is_some() {
        return true;
    }
    let before = neighbour(request, a, pair.axis, -1).and_then(|before| distances(before, a));
    let after = neighbour(request, b, pair.axis, 1).and_then(|after| distances(b, after));
    let units = [longest(&scenario.rods), 1.0];
    (0..2).any(|k| {
        let others = [before, after].into_iter().flatten().map(|it| it[k]);
        let least = others.fold(f64::INFINITY, f64::min);
        own[k] > SAME * units[k] && (!least.is_finite() || own[k] > FARTHER * least)
    })
}

/// Distances of the tips and of the twists.
fn distances(a: &MapRow, b: &MapRow) -> [f64; 2] {
    let difference = |of: fn(&MapRow) -> Option<f64>| of(a).zip(of(b)).map_or(0.0, |(a, b)| a - b);
    let tip = [difference(|row| row.tip_x), difference(|row| row.tip_y)];
    let tip = tip[0].hypot(tip[1]).hypot(difference(|row| row.tip_z));
    [tip, difference(|row| row.twist).abs()]
}

/// The jump between two cells, if there certainly is one.
fn jump(request: &MapRequest, pair: &Pair) -> Option<MapJump> {
    let axis = &request.axes[pair.axis];
    let ends = pair.cells.map(|cell| request.values(cell)[pair.axis].1);
    let value = |part: f64| value_between(ends, axis.log, part);
    let at = |part: f64| answer_between(request, pair, value(part));
    let length = longest(&request.base.scenario().rods);
    let [mut low, mut high] = [(0.0, at(0.0)?), (1.0, at(1.0)?)];
    let mut distance = low.1.distance(&high.1)?;
    for half in 0..HALVES {
        if distance < SAME * length {
            return None;
        }
        let part = 0.5 * (low.0 + high.0);
        let middle = at(part)?;
        if half == 0 && distance_from_middle(&low.1, &middle, &high.1)? < NEAR_MIDDLE * distance {
            return None;
        }
        let [below, above] = [low.1.distance(&middle)?, middle.distance(&high.1)?];
        match below > above {
            true => (high, distance) = ((part, middle), below),
            false => (low, distance) = ((part, middle), above),
        }
    }
    (distance >= SAME * length).then(|| MapJump {
        key: axis.keys.to_string(),
        from: request.texts(pair.cells[0]),
        to: request.texts(pair.cells[1]),
        between: [value(low.0), value(high.0)],
        distance,
    })
}

/// The relaxed leaf at another value along the axis of a pair.
fn answer_between(request: &MapRequest, pair: &Pair, value: f64) -> Option<Answer> {
    let mut values = request.values(pair.cells[0]);
    values[pair.axis].1 = value;
    let varied = request.base.at(&values).ok()?;
    let limit = Limit {
        deadline: Some(Instant::now() + Duration::from_secs_f64(request.cell_seconds)),
        ..request.limit.clone()
    };
    let method = Method::default().on_grid(varied.knobs.segments);
    let tolerance = request.tolerance.unwrap_or(varied.scenario.tolerance);
    relaxed(&varied.scenario, method, tolerance, &limit).ok()
}

/// Largest distance of a leaf from the mean of two others.
fn distance_from_middle(low: &Answer, middle: &Answer, high: &Answer) -> Option<f64> {
    let common = |sigma: f64, of: &Answer| of.stations.iter().position(|it| *it == sigma);
    let mut most: f64 = 0.0;
    for (i, &sigma) in middle.stations.iter().enumerate() {
        let (Some(a), Some(b)) = (common(sigma, low), common(sigma, high)) else {
            continue;
        };
        for ((low, middle), high) in low.rods.iter().zip(&middle.rods).zip(&high.rods) {
            let between = 0.5 * (low.nodes[a].position + high.nodes[b].position);
            most = larger(most, (middle.nodes[i].position - between).length());
        }
    }
    most.is_finite().then_some(most)
}
