//! Labels where they cover neither curves nor each other: next to points of a panel, and, of
//! a boundary, the index on both sides of its curves.

use super::kit::*;
use crate::report::is_special;
use crate::study::{Boundary, BoundaryCurve};

/// Spacing in pixels of the points on curves that labels keep clear of.
const SPACING: f64 = 4.0;
/// Most of these points.
const MOST_PLACES: usize = 20_000;
/// From a point to the middle of its label.
const DISTANCES: [f64; 3] = [11.0, 16.0, 24.0];
const DIRECTIONS: usize = 16;
/// A clearance that is large enough.
const CLEAR: f64 = 5.0;
/// Points closer than this share a label.
const CLOSE: f64 = 10.0;

pub struct Labels {
    cell: Cell,
    /// Points on curves.
    taken: Vec<DVec2>,
    /// Labels drawn so far.
    drawn: Vec<Cell>,
    /// Points that are still to be labelled.
    wanted: Vec<(DVec2, String)>,
}

impl Labels {
    pub fn within(cell: Cell) -> Self {
        Labels {
            cell,
            taken: Vec::new(),
            drawn: Vec::new(),
            wanted: Vec::new(),
        }
    }

    /// Makes labels keep clear of a curve through these points.
    pub fn avoid(&mut self, axes: &Axes, points: &[(f64, f64)]) {
        let places: Vec<DVec2> = points.iter().filter_map(|&point| axes.at(point)).collect();
        self.taken.extend(places.first());
        for pair in places.windows(2) {
            let parts = (pair[0].distance(pair[1]) / SPACING).ceil().max(1.0);
            let room = MOST_PLACES.saturating_sub(self.taken.len());
            let parts = (parts as usize).min(room);
            let place = |k: usize| pair[0].lerp(pair[1], k as f64 / parts as f64);
            self.taken.extend((1..=parts).map(place));
        }
    }

    /// Requests a label next to a point; points close to each other share one.
    pub fn add(&mut self, at: DVec2, text: &str) {
        let mut wanted = self.wanted.iter_mut();
        match wanted.find(|(place, _)| place.distance(at) < CLOSE) {
            Some((_, texts)) => *texts += &format!(", {text}"),
            None => self.wanted.push((at, text.into())),
        }
    }

    /// Draws all requested labels.
    pub fn draw(&mut self, page: &mut Drawing) {
        self.taken.extend(self.wanted.iter().map(|(at, _)| *at));
        for (at, text) in std::mem::take(&mut self.wanted) {
            let size = size(&text);
            let places = DISTANCES.into_iter().flat_map(|distance| {
                (0..DIRECTIONS).map(move |k| {
                    let angle = -0.25 * std::f64::consts::PI
                        + std::f64::consts::TAU * k as f64 / DIRECTIONS as f64;
                    distance * DVec2::from_angle(angle)
                })
            });
            let cells = places.map(|offset| {
                // Wide labels are placed farther to the side.
                let side = DVec2::new(0.5 * (size.x - size.y).max(0.0) * offset.normalize().x, 0.0);
                Cell::new(at + offset + side - 0.5 * size, size)
            });
            if let Some((_, cell)) = clearest(cells, |cell| self.clearance(cell)) {
                self.write(page, cell, &text, INK);
            }
        }
    }

    fn write(&mut self, page: &mut Drawing, cell: Cell, text: &str, color: Color) {
        page.centered_label(cell.middle(), text, TICK_SIZE, Anchor::Middle, color);
        self.drawn.push(cell);
    }

    /// The distance of a label from curves, at most [`CLEAR`]; negative where it leaves
    /// the panel or covers another label.
    fn clearance(&self, label: &Cell) -> f64 {
        let inside = label.corner.cmpge(self.cell.corner + 2.0).all()
            && label.end().cmple(self.cell.end() - 2.0).all();
        let apart = |other: &Cell| {
            label.corner.cmpgt(other.end() + 1.0).any()
                || label.end().cmplt(other.corner - 1.0).any()
        };
        if !inside || !self.drawn.iter().all(apart) {
            return -1.0;
        }
        let (middle, half) = (label.middle(), 0.5 * label.size);
        let far = |place: &DVec2| ((*place - middle).abs() - half).max(DVec2::ZERO).length();
        self.taken.iter().map(far).fold(CLEAR, f64::min)
    }
}

/// The first of these labels that is clear enough, or the clearest of all.
fn clearest<T>(labels: impl Iterator<Item = T>, clearance: impl Fn(&T) -> f64) -> Option<(f64, T)> {
    let mut best: Option<(f64, T)> = None;
    for label in labels {
        let clear = clearance(&label);
        if best.as_ref().is_none_or(|(most, _)| clear > *most) {
            best = Some((clear, label));
        }
        if clear >= CLEAR {
            break;
        }
    }
    best
}

fn size(text: &str) -> DVec2 {
    DVec2::new(Font::embedded().width(text, TICK_SIZE), TICK_SIZE)
}

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
pub fn write_indices(page: &mut Drawing, axes: &Axes, boundary: &Boundary, labels: &mut Labels) {
    let curves: Vec<Curve> = (boundary.curves.iter())
        .map(|curve| Curve::of(axes, boundary, curve))
        .collect();
    let mut named = vec![false; curves.len()];
    for c in 0..curves.len() {
        if named[c] {
            continue;
        }
        let places = curves[c].places().into_iter();
        let best = clearest(places.map(|place| Sides::of(&curves, c, place)), |sides| {
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
    fn of(curves: &[Curve], c: usize, (at, normal, sides): Place) -> Self {
        let label = |along: f64, sign: f64, text: String| {
            let size = size(&text);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::axis::Axis;
    use crate::figure::drawing::Mark;

    #[test]
    fn labels_cover_neither_curves_nor_each_other() {
        let cell = Cell::new(DVec2::ZERO, DVec2::new(300.0, 200.0));
        let axes = Axes {
            cell,
            across: Axis::linear("", 0.0, 1.0),
            up: Axis::linear("", 0.0, 1.0),
        };
        let curves = [0.3, 0.5].map(|slope| [(0.0, 0.2), (1.0, 0.2 + slope)]);
        let mut labels = Labels::within(cell);
        let mut points = Vec::new();
        for curve in &curves {
            labels.avoid(&axes, curve);
            let at = |x: f64| (x, curve[0].1 + x * (curve[1].1 - curve[0].1));
            points.extend([0.0, 0.1, 0.5, 1.0].map(at));
        }
        for (k, &point) in points.iter().enumerate() {
            labels.add(axes.at(point).unwrap(), &(k + 1).to_string());
        }
        let taken = labels.taken.clone();
        let mut page = Drawing::new(300.0, "");
        labels.draw(&mut page);
        let label = |mark| match mark {
            Mark::Label(label) => Some(label),
            _ => None,
        };
        let texts: Vec<_> = page.marks.into_iter().filter_map(label).collect();
        // Both curves begin at one point: labels there are shared.
        assert_eq!(texts[0].text, "1, 5");
        assert_eq!(texts.len(), 6);
        let font = Font::embedded();
        let boxes = texts.iter().map(|label| {
            let size = DVec2::new(font.width(&label.text, label.size), 0.7 * label.size);
            let corner = label.at - DVec2::new(0.5 * size.x, size.y);
            Cell { corner, size }
        });
        let boxes: Vec<Cell> = boxes.collect();
        for (k, one) in boxes.iter().enumerate() {
            let covers =
                |place: &DVec2| place.cmpgt(one.corner).all() && place.cmplt(one.end()).all();
            assert!(!taken.iter().any(covers), "{}", texts[k].text);
            assert!(one.corner.cmpge(cell.corner).all() && one.end().cmple(cell.end()).all());
            for other in &boxes[..k] {
                let apart =
                    one.corner.cmpgt(other.end()).any() || one.end().cmplt(other.corner).any();
                assert!(apart, "{}", texts[k].text);
            }
        }
    }
}
