//! Labels where they cover neither curves nor each other.

use crate::figure::axes::Axes;
use crate::figure::drawing::{Anchor, Color, Drawing, INK};
use crate::figure::font::Font;
use crate::figure::layout::{Cell, TICK_SIZE};
use glam::DVec2;

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
            let size = label_size(&text);
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

    pub fn write(&mut self, page: &mut Drawing, cell: Cell, text: &str, color: Color) {
        page.centered_label(cell.middle(), text, TICK_SIZE, Anchor::Middle, color);
        self.drawn.push(cell);
    }

    /// The distance of a label from curves, at most [`CLEAR`]; negative where it leaves
    /// the panel or covers another label.
    pub fn clearance(&self, label: &Cell) -> f64 {
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
pub fn clearest<T>(
    labels: impl Iterator<Item = T>,
    clearance: impl Fn(&T) -> f64,
) -> Option<(f64, T)> {
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

pub fn label_size(text: &str) -> DVec2 {
    DVec2::new(Font::embedded().width(text, TICK_SIZE), TICK_SIZE)
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
