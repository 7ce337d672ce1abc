//! The index on both sides of the curves of a boundary, where there is room for it.

use glam::DVec2;

use super::axes::Axes;
use super::drawing::{Drawing, NOTE};
use super::labels::{CLEAR, Labels, size};
use super::page::Cell;
use crate::report::is_special;
use crate::study::{Boundary, BoundaryCurve};

/// Places that are tried lie so far apart along a curve, and most of them.
const STEP: f64 = 5.0;
const MOST_PLACES: usize = 400;
/// Curves closer than this have their outer indices named together.
const CLOSE: f64 = 16.0;
/// From a curve to the text beside it.
const GAP: f64 = 4.0;
/// Less room than this is too little.
const LEAST: f64 = 2.0;
/// The normal of a curve must go along the first number by this part, which tells its sides
/// apart.
const ACROSS: f64 = 0.15;

/// Writes what is known of the sides of every curve, each time where there is most room; of
/// curves that lie close together what is outside them all. Where there is no room anywhere,
/// the key has to do.
pub fn write_indices(page: &mut Drawing, axes: &Axes, boundary: &Boundary, labels: &mut Labels) {
    let curves: Vec<Curve> = (boundary.curves.iter())
        .map(|curve| Curve::of(axes, boundary, curve))
        .collect();
    let mut named = vec![false; curves.len()];
    for c in 0..curves.len() {
        if named[c] {
            continue;
        }
        let mut best: Option<(f64, Sides)> = None;
        for (at, normal) in curves[c].places() {
            let sides = Sides::of(&curves, c, at, normal);
            let room = sides.texts.iter().map(|(cell, _)| labels.clearance(cell));
            let room = room.fold(f64::INFINITY, f64::min);
            if best.as_ref().is_none_or(|(most, _)| room > *most) {
                best = Some((room, sides));
            }
            if room >= CLEAR {
                break;
            }
        }
        if let Some((_, sides)) = best.filter(|(room, _)| *room >= LEAST) {
            for (cell, text) in sides.texts {
                labels.write(page, cell, &text, NOTE);
            }
            sides.curves.iter().for_each(|&curve| named[curve] = true);
        }
    }
}

/// A curve on the page.
struct Curve {
    /// From point to point: where, and the index to the left and to the right.
    pieces: Vec<([DVec2; 2], [usize; 2])>,
    /// Whether two branches meet there and vanish, so that it has no sides.
    fold: bool,
}

impl Curve {
    fn of(axes: &Axes, boundary: &Boundary, curve: &BoundaryCurve) -> Self {
        let place = |values: [f64; 2]| axes.at((values[0], values[1]));
        // To the right the first number may be nearer to the end of its range, or farther.
        let [from, to] = boundary.ranges[0].map(|end| axes.across.part(end));
        let pieces = curve.points.windows(2).filter_map(|pair| {
            let ends = [place(pair[0].values)?, place(pair[1].values)?];
            // Where curves cross, other modes count as well.
            let point = if is_special(&pair[1]) {
                &pair[0]
            } else {
                &pair[1]
            };
            let (before, behind) = (point.index_before, point.index_behind);
            let sides = if from < to {
                [before, behind]
            } else {
                [behind, before]
            };
            Some((ends, sides))
        });
        let first = curve.points.first();
        Curve {
            pieces: pieces.collect(),
            fold: curve.multiplicity == 1
                && first.is_some_and(|point| matches!(point.kind, "fold" | "cusp")),
        }
    }

    /// Places on it with its normal to the right, those in its middle first.
    fn places(&self) -> Vec<(DVec2, DVec2)> {
        let length = |ends: &[DVec2; 2]| ends[0].distance(ends[1]);
        let whole: f64 = self.pieces.iter().map(|(ends, _)| length(ends)).sum();
        let step = STEP.max(whole / MOST_PLACES as f64);
        let (mut places, mut before) = (Vec::new(), 0.0);
        for (ends, _) in &self.pieces {
            let (own, way) = (length(ends), ends[1] - ends[0]);
            let normal = way.perp().normalize_or_zero();
            let normal = if normal.x < 0.0 { -normal } else { normal };
            let count = (own / step).ceil().max(1.0) as usize;
            for k in 0..count {
                let part = (k as f64 + 0.5) / count as f64;
                let off = (before + part * own - 0.5 * whole).abs();
                if normal.x > ACROSS {
                    places.push((off, (ends[0] + part * way, normal)));
                }
            }
            before += own;
        }
        places.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        places.into_iter().map(|(_, place)| place).collect()
    }

    /// Where a line crosses it, how far along that, with the indices on both sides.
    fn crossings(&self, at: DVec2, normal: DVec2) -> impl Iterator<Item = (f64, [usize; 2])> {
        self.pieces.iter().filter_map(move |([a, b], sides)| {
            let way = *b - *a;
            let across = normal.perp_dot(way);
            let part = (at - *a).perp_dot(normal) / way.perp_dot(normal);
            let along = (*a - at).perp_dot(way) / across;
            (across != 0.0 && (0.0..=1.0).contains(&part)).then_some((along, *sides))
        })
    }
}

/// Texts beside a curve, or beside several that lie close together.
struct Sides {
    texts: Vec<(Cell, String)>,
    curves: Vec<usize>,
}

impl Sides {
    fn of(curves: &[Curve], c: usize, at: DVec2, normal: DVec2) -> Self {
        let beside = |along: f64, way: f64, text: String| {
            let size = size(&text);
            let reach = 0.5 * (size * normal.abs()).element_sum() + GAP;
            let middle = at + (along + way * reach) * normal;
            let corner = middle - 0.5 * size;
            (Cell { corner, size }, text)
        };
        let own = curves[c].crossings(at, normal);
        let own = own.min_by(|(a, _), (b, _)| a.abs().total_cmp(&b.abs()));
        let (_, sides) = own.unwrap_or((0.0, [0; 2]));
        if curves[c].fold {
            let text = format!(
                "{} and {} meet",
                sides[0].min(sides[1]),
                sides[0].max(sides[1])
            );
            return Sides {
                texts: vec![beside(0.0, 1.0, text)],
                curves: vec![c],
            };
        }
        // From the curve outwards, as long as the next is near and has the same index between.
        let mut others: Vec<(f64, [usize; 2], usize)> = Vec::new();
        for (k, other) in curves.iter().enumerate().filter(|(_, it)| !it.fold) {
            others.extend(
                other
                    .crossings(at, normal)
                    .map(|(along, it)| (along, it, k)),
            );
        }
        others.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut named = vec![c];
        let mut outside = |way: f64, out: usize| {
            let (mut along, mut index) = (0.0, sides[out]);
            let mut next = |&(at, it, k): &(f64, [usize; 2], usize)| {
                let step = way * (at - along);
                if k != c && (0.0..CLOSE).contains(&step) && it[1 - out] == index {
                    (along, index) = (at, it[out]);
                    named.push(k);
                }
            };
            match way > 0.0 {
                true => others.iter().for_each(&mut next),
                false => others.iter().rev().for_each(&mut next),
            }
            beside(along, way, format!("index {index}"))
        };
        let texts = vec![outside(-1.0, 0), outside(1.0, 1)];
        Sides {
            texts,
            curves: named,
        }
    }
}
