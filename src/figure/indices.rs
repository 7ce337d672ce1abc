//! The index on both sides of the curves of a boundary, where there is room for it.

use glam::DVec2;

use super::axes::Axes;
use super::drawing::{Drawing, NOTE};
use super::labels::{CLEAR, Labels, size};
use super::page::Cell;
use crate::report::is_special;
use crate::study::{Boundary, BoundaryCurve};

/// Spacing of the places that are tried along a curve, and their largest number.
const STEP: f64 = 5.0;
const MOST_PLACES: usize = 400;
/// Curves closer than this are labelled together, with the indices outside them.
const CLOSE: f64 = 16.0;
/// From a curve to its label.
const GAP: f64 = 4.0;
/// Labels need at least this clearance.
const LEAST: f64 = 2.0;
/// The normal of a curve must have at least this component along the first number, which
/// distinguishes the sides.
const ACROSS: f64 = 0.15;

/// Labels both sides of every curve where the clearance is largest; curves close to each other
/// only on the outside. A curve without enough clearance anywhere is described by the key alone.
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
    /// Segments: their ends, and the indices to the left and to the right.
    pieces: Vec<([DVec2; 2], [usize; 2])>,
    /// Whether two branches meet and vanish there, so that it has no sides.
    fold: bool,
}

impl Curve {
    fn of(axes: &Axes, boundary: &Boundary, curve: &BoundaryCurve) -> Self {
        let place = |values: [f64; 2]| axes.at((values[0], values[1]));
        // Along the axis the first number may move towards the end of its range, or away.
        let [from, to] = boundary.ranges[0].map(|end| axes.across.fraction(end));
        let pieces = curve.points.windows(2).filter_map(|pair| {
            let ends = [place(pair[0].values)?, place(pair[1].values)?];
            // Where curves cross, the index counts other modes as well.
            let point = match is_special(&pair[1]) {
                true => &pair[0],
                false => &pair[1],
            };
            let (before, after) = (point.index_before, point.index_behind);
            let sides = match from < to {
                true => [before, after],
                false => [after, before],
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

    /// Points on it, each with the normal that points to the right, from the middle outwards.
    fn places(&self) -> Vec<(DVec2, DVec2)> {
        let length = |ends: &[DVec2; 2]| ends[0].distance(ends[1]);
        let whole: f64 = self.pieces.iter().map(|(ends, _)| length(ends)).sum();
        let spacing = STEP.max(whole / MOST_PLACES as f64);
        let (mut places, mut before) = (Vec::new(), 0.0);
        for (ends, _) in &self.pieces {
            let (own, step) = (length(ends), ends[1] - ends[0]);
            let normal = step.perp().normalize_or_zero();
            let normal = if normal.x < 0.0 { -normal } else { normal };
            let count = (own / spacing).ceil().max(1.0) as usize;
            for k in 0..count {
                let part = (k as f64 + 0.5) / count as f64;
                let off = (before + part * own - 0.5 * whole).abs();
                if normal.x > ACROSS {
                    places.push((off, (ends[0] + part * step, normal)));
                }
            }
            before += own;
        }
        places.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        places.into_iter().map(|(_, place)| place).collect()
    }

    /// Its crossings with a line: how far along the line, and the indices on both sides.
    fn crossings(&self, at: DVec2, normal: DVec2) -> impl Iterator<Item = (f64, [usize; 2])> {
        self.pieces.iter().filter_map(move |([a, b], sides)| {
            let step = *b - *a;
            let across = normal.perp_dot(step);
            let part = (at - *a).perp_dot(normal) / step.perp_dot(normal);
            let along = (*a - at).perp_dot(step) / across;
            (across != 0.0 && (0.0..=1.0).contains(&part)).then_some((along, *sides))
        })
    }
}

/// Labels on the sides of a curve, or of several curves close to each other.
struct Sides {
    texts: Vec<(Cell, String)>,
    curves: Vec<usize>,
}

impl Sides {
    fn of(curves: &[Curve], c: usize, at: DVec2, normal: DVec2) -> Self {
        let label = |along: f64, sign: f64, text: String| {
            let size = size(&text);
            let reach = 0.5 * (size * normal.abs()).element_sum() + GAP;
            let middle = at + (along + sign * reach) * normal;
            let corner = middle - 0.5 * size;
            (Cell { corner, size }, text)
        };
        let own = curves[c].crossings(at, normal);
        let own = own.min_by(|(a, _), (b, _)| a.abs().total_cmp(&b.abs()));
        let (_, sides) = own.unwrap_or((0.0, [0; 2]));
        if curves[c].fold {
            let (fewer, more) = (sides[0].min(sides[1]), sides[0].max(sides[1]));
            let text = format!("{fewer} and {more} meet");
            return Sides {
                texts: vec![label(0.0, 1.0, text)],
                curves: vec![c],
            };
        }
        // From the curve outwards, while the next one is close and the indices between them agree.
        let mut others: Vec<(f64, [usize; 2], usize)> = Vec::new();
        for (k, other) in curves.iter().enumerate().filter(|(_, it)| !it.fold) {
            let crossings = other.crossings(at, normal);
            others.extend(crossings.map(|(along, it)| (along, it, k)));
        }
        others.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut named = vec![c];
        let mut outside = |sign: f64, out: usize| {
            let (mut along, mut index) = (0.0, sides[out]);
            let mut next = |&(at, it, k): &(f64, [usize; 2], usize)| {
                let step = sign * (at - along);
                if k != c && (0.0..CLOSE).contains(&step) && it[1 - out] == index {
                    (along, index) = (at, it[out]);
                    named.push(k);
                }
            };
            match sign > 0.0 {
                true => others.iter().for_each(&mut next),
                false => others.iter().rev().for_each(&mut next),
            }
            label(along, sign, format!("index {index}"))
        };
        let texts = vec![outside(-1.0, 0), outside(1.0, 1)];
        Sides {
            texts,
            curves: named,
        }
    }
}
