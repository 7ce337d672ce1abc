//! Where the leaf of a cell is at rest in another equilibrium than that of the next: its
//! place jumps between them.
//!
//! Pairs of cells whose answers are farther apart than those beside them are looked at
//! again: the leaf is brought to rest half way, then half way of the half in which it
//! moves more. What is continuous moves less and less; what jumps goes on jumping.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde::Serialize;

use super::Map;
use super::cell::relaxed;
use super::request::MapRequest;
use super::row::{MapMethod, MapRow};
use crate::limit::Limit;
use crate::relax::Method;
use crate::scenario::longest;
use crate::study::judge::Answer;

/// Leaves closer than this, in lengths, are not told from each other.
const SAME: f64 = 0.01;

/// A pair is looked at if its tips, or its twists, are so many times as far apart as those of
/// a pair beside it.
const FARTHER: f64 = 1.5;

/// Half way a leaf that moves continuously is nearer to the middle than this part of the
/// way.
const NEAR_MIDDLE: f64 = 0.1;

/// Halves: where a branch ends in a fold, or leaves another one, a leaf moves as the root
/// of the distance from there, a sixty-fourth.
const HALVES: usize = 12;

/// Two neighbouring cells between which the leaf jumps to another equilibrium.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MapJump {
    /// What varies from the one to the other.
    pub key: String,
    /// The varied values of one cell.
    pub from: Vec<String>,
    /// Those of the other.
    pub to: Vec<String>,
    /// It jumps between these two values of the key.
    pub between: [f64; 2],
    /// How far, in units of length.
    pub distance: f64,
}

/// Two cells next to each other along an axis.
struct Pair {
    axis: usize,
    cells: [usize; 2],
}

impl Map {
    /// Looks where the leaf jumps to another equilibrium from a cell to the next, by the
    /// default method: `jumps` has these then.
    /// `progress` is told how many pairs of cells are looked at, and of how many.
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
        .filter(|pair| stands_out(request, &known, pair))
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
            let next = beside(request, cell, axis, 1)?;
            let cells = [cell, next];
            Some(Pair { axis, cells })
        })
    })
}

/// The cell so many places away along an axis.
fn beside(request: &MapRequest, cell: usize, axis: usize, places: isize) -> Option<usize> {
    let behind = request.axes.iter().skip(axis + 1);
    let stride: usize = behind.map(|axis| axis.values.len()).product();
    let at = request.place(cell)[axis].checked_add_signed(places)?;
    let there = at < request.axes[axis].values.len();
    there.then(|| cell.wrapping_add_signed(places * stride as isize))
}

/// Whether the leaf may jump between two cells, by their rows and those beside them. Where
/// its tip is held, only the leaf itself tells.
fn stands_out(request: &MapRequest, known: &[Option<&MapRow>], pair: &Pair) -> bool {
    let [a, b] = pair.cells;
    let apart = |a: usize, b: usize| Some(apart(known[a]?, known[b]?));
    let Some(own) = apart(a, b) else {
        return false;
    };
    let scenario = request.base.scenario();
    if scenario.held_tip.is_some() {
        return true;
    }
    let before = beside(request, a, pair.axis, -1).and_then(|before| apart(before, a));
    let behind = beside(request, b, pair.axis, 1).and_then(|behind| apart(b, behind));
    let units = [longest(&scenario.rods), 1.0];
    (0..2).any(|k| {
        let beside = [before, behind].into_iter().flatten().map(|it| it[k]);
        let least = beside.fold(f64::INFINITY, f64::min);
        own[k] > SAME * units[k] && (!least.is_finite() || own[k] > FARTHER * least)
    })
}

/// How far tips are apart, and twists.
fn apart(a: &MapRow, b: &MapRow) -> [f64; 2] {
    let difference = |of: fn(&MapRow) -> Option<f64>| of(a).zip(of(b)).map_or(0.0, |(a, b)| a - b);
    let tip = [difference(|row| row.tip_x), difference(|row| row.tip_y)];
    let tip = tip[0].hypot(tip[1]).hypot(difference(|row| row.tip_z));
    [tip, difference(|row| row.twist).abs()]
}

/// The jump between two cells, if there is one for certain.
fn jump(request: &MapRequest, pair: &Pair) -> Option<MapJump> {
    let axis = &request.axes[pair.axis];
    let ends = pair.cells.map(|cell| request.values(cell)[pair.axis].1);
    let value = |part: f64| match axis.log {
        true => ends[0] * (ends[1] / ends[0]).powf(part),
        false => ends[0] + part * (ends[1] - ends[0]),
    };
    let at = |part: f64| answer(request, pair, value(part));
    let length = longest(&request.base.scenario().rods);
    let [mut low, mut high] = [(0.0, at(0.0)?), (1.0, at(1.0)?)];
    let mut distance = low.1.distance(&high.1)?;
    for half in 0..HALVES {
        if distance < SAME * length {
            return None;
        }
        let part = 0.5 * (low.0 + high.0);
        let middle = at(part)?;
        if half == 0 && off_middle(&low.1, &middle, &high.1)? < NEAR_MIDDLE * distance {
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

/// The leaf at rest with another value on the axis of a pair.
fn answer(request: &MapRequest, pair: &Pair, value: f64) -> Option<Answer> {
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

/// How far a leaf is from the middle between two others, at most.
fn off_middle(low: &Answer, middle: &Answer, high: &Answer) -> Option<f64> {
    let common = |sigma: f64, of: &Answer| of.stations.iter().position(|it| *it == sigma);
    let mut most: f64 = 0.0;
    for (i, &sigma) in middle.stations.iter().enumerate() {
        let (Some(a), Some(b)) = (common(sigma, low), common(sigma, high)) else {
            continue;
        };
        for ((low, middle), high) in low.rods.iter().zip(&middle.rods).zip(&high.rods) {
            let between = 0.5 * (low.nodes[a].position + high.nodes[b].position);
            most = most.max((middle.nodes[i].position - between).length());
        }
    }
    most.is_finite().then_some(most)
}
