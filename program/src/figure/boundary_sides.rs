//! Labels with the index on both sides of the curves of a boundary.

use crate::figure::axes::Axes;
use crate::figure::drawing::{Drawing, NOTE};
use crate::figure::labels::{Labels, clearest, label_size};
use crate::figure::layout::Cell;
use crate::report::is_special;
use glam::DVec2;
use leafdyn::study::{Boundary, BoundaryCurve};

/// Spacing of the places that are tried along a curve, and their largest number.
const STEP: f64 = 5.0;
const MOST_TRIED: usize = 400;
/// Curves closer than this are labelled together, with the indices outside them.
const NEIGHBOURS: f64 = 16.0;
/// From a curve to its label.
const GAP: f64 = 4.0;
/// Labels need at least this clearance.
const LEAST: f64 = 2.0;
/// The normal of a curve must have at least this component along the first number, which
/// distinguishes the sides.
const ACROSS: f64 = 0.15;

/// Labels both sides of every curve where the clearance is largest; curves close to each other
/// only on the outside. A curve without enough clearance anywhere is described by the key alone.
pub fn write_indices(page: &mut Drawing, curves: &[Line], labels: &mut Labels) {
    let mut named = vec![false; curves.len()];
    for c in 0..curves.len() {
        if named[c] {
            continue;
        }
        let places = curves[c].places().into_iter();
        let best = clearest(places.map(|place| Sides::of(curves, c, place)), |sides| {
            let room = sides.texts.iter().map(|(cell, _)| labels.clearance(cell));
            room.fold(f64::INFINITY, f64::min)
        });
        if let Some((_, sides)) = best.filter(|(room, _)| *room >= LEAST) {
            for (cell, text) in sides.texts {
                labels.write(page, cell, &text, NOTE);
            }
            sides.curves.iter().for_each(|&curve| named[curve] = true);
        }
    }
}

/// A place on a curve: the point, the normal to the right, and the indices on both sides.
type Place = (DVec2, DVec2, [usize; 2]);

/// A curve on the page.
pub struct Line {
    /// Segments: their ends, and the indices to the left and to the right.
    pieces: Vec<([DVec2; 2], [usize; 2])>,
    /// Whether two branches meet and vanish there, so that it has no sides.
    fold: bool,
    /// Of a fold, to which side there is a stable leaf, if that is known.
    stable: Option<[bool; 2]>,
}

impl Line {
    /// A line of these segments, along which branches cross, or where two meet.
    pub fn new(pieces: Vec<([DVec2; 2], [usize; 2])>, fold: bool) -> Self {
        Line {
            pieces,
            fold,
            stable: None,
        }
    }

    pub fn of(axes: &Axes, boundary: &Boundary, curve: &BoundaryCurve) -> Self {
        // Along the axis the first number may move towards the end of its range, or away.
        let [from, to] = boundary.ranges[0].map(|end| axes.across.fraction(end));
        let points = curve.points.iter();
        let points: Vec<(f64, f64)> = points.map(|it| (it.values[0], it.values[1])).collect();
        let drawn = axes.smooth(&points).into_iter();
        let pieces = curve
            .points
            .windows(2)
            .zip(drawn)
            .flat_map(|(pair, drawn)| {
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
                let ends = drawn.windows(2).map(|ends| ([ends[0], ends[1]], sides));
                ends.collect::<Vec<_>>()
            });
        let first = curve.points.first();
        let fold = curve.multiplicity == 1
            && first.is_some_and(|point| matches!(point.kind, "fold" | "cusp"));
        let line = Line::new(pieces.collect(), fold);
        let mut stable = curve.beside.iter();
        let stable = stable.find(|leaf| leaf.index == 0 && leaf.fallen_from.is_none());
        let stable = stable.and_then(|leaf| axes.at((leaf.values[0], leaf.values[1])));
        let to_left = stable.and_then(|at| Some(line.crossings(at, DVec2::X).next()?.0 > 0.0));
        Line {
            stable: to_left.map(|left| [left, !left]),
            ..line
        }
    }

    /// Its segments.
    pub fn segments(&self) -> impl Iterator<Item = [DVec2; 2]> {
        self.pieces.iter().map(|(ends, _)| *ends)
    }

    /// Whether ground on one of its sides is stable.
    pub fn bounds_stable(&self) -> bool {
        self.pieces.iter().any(|(_, sides)| sides.contains(&0))
    }

    /// Its crossings with a line: how far along the line, and whether the ground on both sides is
    /// stable, unless that is not known.
    pub fn stable_beside(
        &self,
        at: DVec2,
        normal: DVec2,
    ) -> impl Iterator<Item = (f64, Option<[bool; 2]>)> {
        self.crossings(at, normal).map(|(along, sides)| {
            let stable = match self.fold {
                true => self.stable.filter(|_| sides.contains(&0)),
                false => Some(sides.map(|index| index == 0)),
            };
            (along, stable)
        })
    }

    /// Places on it, from the middle outwards.
    fn places(&self) -> Vec<Place> {
        let length = |ends: &[DVec2; 2]| ends[0].distance(ends[1]);
        let whole: f64 = self.pieces.iter().map(|(ends, _)| length(ends)).sum();
        let spacing = STEP.max(whole / MOST_TRIED as f64);
        let (mut places, mut before) = (Vec::new(), 0.0);
        for (ends, sides) in &self.pieces {
            let (own, step) = (length(ends), ends[1] - ends[0]);
            let normal = step.perp().normalize_or_zero();
            let normal = if normal.x < 0.0 { -normal } else { normal };
            let count = (own / spacing).ceil().max(1.0) as usize;
            for k in 0..count {
                let part = (k as f64 + 0.5) / count as f64;
                let off = (before + part * own - 0.5 * whole).abs();
                if normal.x > ACROSS {
                    places.push((off, (ends[0] + part * step, normal, *sides)));
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
    fn of(curves: &[Line], c: usize, (at, normal, sides): Place) -> Self {
        let label = |along: f64, sign: f64, text: String| {
            let size = label_size(&text);
            let reach = 0.5 * (size * normal.abs()).element_sum() + GAP;
            let middle = at + (along + sign * reach) * normal;
            let corner = middle - 0.5 * size;
            (Cell { corner, size }, text)
        };
        if curves[c].fold {
            let (fewer, more) = (sides[0].min(sides[1]), sides[0].max(sides[1]));
            let text = format!("{fewer} and {more} meet");
            return Sides {
                texts: vec![label(0.0, 1.0, text)],
                curves: vec![c],
            };
        }
        let others = curves
            .iter()
            .enumerate()
            .filter(|(k, it)| *k != c && !it.fold);
        let mut others: Vec<(f64, [usize; 2], usize)> = others
            .flat_map(|(k, it)| {
                it.crossings(at, normal)
                    .map(move |(at, sides)| (at, sides, k))
            })
            .collect();
        let mut named = vec![c];
        // From the curve outwards, while the next one is close and the indices between them agree.
        let mut outside = |sign: f64, out: usize| {
            others.sort_by(|a, b| (sign * a.0).total_cmp(&(sign * b.0)));
            let (mut along, mut index) = (0.0, sides[out]);
            for (at, it, k) in &others {
                if (0.0..NEIGHBOURS).contains(&(sign * (at - along))) && it[1 - out] == index {
                    (along, index) = (*at, it[out]);
                    named.push(*k);
                }
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
