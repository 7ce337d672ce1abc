//! Two axes around a panel: grid, frame, ticks and names, with curves and markers
//! inside. Every panel of numbers is drawn with them.

use crate::figure::axis::{Axis, Direction, Tick};
use crate::figure::drawing::{
    Anchor, Color, Drawing, FRAME, GRID, INK, NOTE, Path, Step, Stroke, rectangle,
};
use crate::figure::font::Font;
use crate::figure::layout::{Cell, TEXT_SIZE, TICK_SIZE, title};
use crate::figure::markers::Marker;
use crate::figure::smooth::smooth;
use glam::DVec2;

const TICK: f64 = 4.0;
const DIVISION: f64 = 2.0;
/// From the frame to the base line of the name of the horizontal axis.
const NAME_BELOW: f64 = 34.0;
/// From the frame to that of the vertical axis: the least distance, the gap after the
/// labels, and the largest distance.
const NEAREST_NAME: f64 = 42.0;
const AFTER_LABELS: f64 = 13.0;
const FARTHEST_NAME: f64 = 53.0;

pub struct Curve {
    pub name: &'static str,
    pub color: Color,
    pub points: Vec<(f64, f64)>,
}

impl Curve {
    pub fn values(&self) -> impl Iterator<Item = f64> {
        self.points.iter().map(|point| point.1)
    }
}

pub struct Axes {
    pub cell: Cell,
    pub across: Axis,
    pub up: Axis,
}

impl Axes {
    /// The position of a point on the page; `None` if it cannot be drawn.
    pub fn at(&self, (x, y): (f64, f64)) -> Option<DVec2> {
        let fraction = DVec2::new(self.across.fraction(x), 1.0 - self.up.fraction(y));
        let at = self.cell.corner + self.cell.size * fraction;
        at.is_finite().then_some(at)
    }

    /// Draws a panel of the letter and the title, with these axes.
    pub fn titled(
        page: &mut Drawing,
        cell: Cell,
        [letter, what]: [&str; 2],
        across: Axis,
        up: Axis,
    ) -> Self {
        let axes = Axes { cell, across, up };
        title(page, cell.corner, letter, what);
        axes.draw(page);
        axes
    }

    /// Draws grid, frame, ticks and names.
    pub fn draw(&self, page: &mut Drawing) {
        let Cell { corner, size } = self.cell;
        let end = self.cell.end();
        let stroke = |axis: &Axis, tick: &Tick| match axis.emphasizes_zero && tick.value == 0.0 {
            true => Stroke::new(FRAME, 0.8),
            false => Stroke::new(GRID, 0.7),
        };
        for tick in self.across.ticks(size.x, Direction::Across) {
            let top = corner.with_x(corner.x + tick.fraction * size.x);
            page.line(top, top.with_y(end.y), stroke(&self.across, &tick));
        }
        for tick in self.up.ticks(size.y, Direction::Up) {
            let left = corner.with_y(end.y - tick.fraction * size.y);
            page.line(left, left.with_x(end.x), stroke(&self.up, &tick));
        }
        self.draw_frame(page);
    }

    /// Draws all but the grid.
    pub fn draw_frame(&self, page: &mut Drawing) {
        let Cell { corner, size } = self.cell;
        let (middle, end) = (self.cell.middle(), self.cell.end());
        let rim = Stroke::new(FRAME, 0.8);
        page.stroke(rectangle(corner, size), rim);
        let font = Font::embedded();
        let mut widest = 0.0_f64;
        for (axis, direction, length, out) in [
            (&self.across, Direction::Across, size.x, DVec2::Y),
            (&self.up, Direction::Up, size.y, DVec2::NEG_X),
        ] {
            let foot = |fraction: f64| match direction {
                Direction::Across => corner + size * DVec2::new(fraction, 1.0),
                Direction::Up => corner + size * DVec2::new(0.0, 1.0 - fraction),
            };
            for fraction in axis.divisions(length) {
                let foot = foot(fraction);
                page.line(foot, foot + DIVISION * out, rim);
            }
            for Tick { fraction, text, .. } in axis.ticks(length, direction) {
                let foot = foot(fraction);
                page.line(foot, foot + TICK * out, rim);
                match direction {
                    _ if !axis.labelled => (),
                    Direction::Across => {
                        let base = foot + DVec2::new(0.0, TICK + 1.2 * TICK_SIZE);
                        page.label(base, &text, TICK_SIZE, Anchor::Middle, NOTE);
                    }
                    Direction::Up => {
                        let end = foot - DVec2::new(TICK + 3.0, 0.0);
                        page.centered_label(end, &text, TICK_SIZE, Anchor::End, NOTE);
                        widest = widest.max(font.width(&text, TICK_SIZE));
                    }
                }
            }
        }
        if self.across.labelled {
            let base = DVec2::new(middle.x, end.y + NAME_BELOW);
            page.label(base, &self.across.title(), TEXT_SIZE, Anchor::Middle, INK);
        }
        if self.up.labelled {
            let distance = (widest + AFTER_LABELS).clamp(NEAREST_NAME, FARTHEST_NAME);
            let base = DVec2::new(corner.x - distance, middle.y);
            page.rotated_label(base, &self.up.title(), TEXT_SIZE, INK);
        }
    }

    /// Draws the part of a curve through these points that is inside the frame, with
    /// gaps where a point cannot be drawn.
    pub fn curve(&self, page: &mut Drawing, points: &[(f64, f64)], stroke: Stroke) {
        let columns = self.cell.size.x.ceil().max(1.0) as usize;
        let places = thinned(points, columns).into_iter();
        let places: Vec<Option<DVec2>> = places.map(|point| self.at(point)).collect();
        self.line(page, &places, stroke);
    }

    /// A smooth curve through these points as straight pieces on the page: for every point but the
    /// last those that lead to the next; none where one of both cannot be drawn.
    pub fn smooth(&self, points: &[(f64, f64)]) -> Vec<Vec<DVec2>> {
        let places: Vec<Option<DVec2>> = points.iter().map(|&point| self.at(point)).collect();
        let mut pieces = Vec::with_capacity(points.len());
        for run in places.split_inclusive(Option::is_none) {
            let drawn: Vec<DVec2> = run.iter().flatten().copied().collect();
            pieces.extend(smooth(&drawn));
            pieces.resize(pieces.len() + usize::from(!drawn.is_empty()), Vec::new());
            pieces.resize(pieces.len() + run.len() - drawn.len(), Vec::new());
        }
        pieces.truncate(points.len().saturating_sub(1));
        pieces
    }

    /// Draws what is inside the frame of a line through these points on the page, with gaps where
    /// one is missing.
    pub fn line(&self, page: &mut Drawing, places: &[Option<DVec2>], stroke: Stroke) {
        let mut path: Path = Vec::new();
        let mut pen = None;
        for pair in places.windows(2) {
            let inside = pair[0].zip(pair[1]);
            let Some((from, to)) = inside.and_then(|(from, to)| self.clipped(from, to)) else {
                continue;
            };
            if pen != Some(from) {
                path.push(Step::Move(from));
            }
            path.push(Step::Line(to));
            pen = Some(to);
        }
        if !path.is_empty() {
            page.stroke(path, stroke);
        }
    }

    /// The part of a line that is inside the frame (Liang and Barsky).
    fn clipped(&self, from: DVec2, to: DVec2) -> Option<(DVec2, DVec2)> {
        let step = to - from;
        let (low, high) = (self.cell.corner - from, self.cell.end() - from);
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for (step, low, high) in [(step.x, low.x, high.x), (step.y, low.y, high.y)] {
            if step == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let (a, b) = (low / step, high / step);
            first = first.max(a.min(b));
            last = last.min(a.max(b));
        }
        let point = |part: f64| match part {
            0.0 => from,
            1.0 => to,
            part => from + part * step,
        };
        (first <= last).then(|| (point(first), point(last)))
    }

    /// Draws a marker at each of these points that is inside the frame.
    pub fn markers(
        &self,
        page: &mut Drawing,
        points: impl IntoIterator<Item = (f64, f64)>,
        marker: Marker,
        color: Color,
    ) {
        let (low, high) = (self.cell.corner - 0.01, self.cell.end() + 0.01);
        for at in points.into_iter().filter_map(|point| self.at(point)) {
            if at.cmpge(low).all() && at.cmple(high).all() {
                marker.draw(page, at, color);
            }
        }
    }
}

/// Fewer points that look the same when drawn over `columns` columns: of each
/// the first, the last, the lowest and the highest.
fn thinned(points: &[(f64, f64)], columns: usize) -> Vec<(f64, f64)> {
    let each = points.len().div_ceil(columns);
    if each <= 4 {
        return points.to_vec();
    }
    let mut kept = Vec::with_capacity(4 * columns);
    for column in points.chunks(each) {
        let by_height = |a: &usize, b: &usize| column[*a].1.total_cmp(&column[*b].1);
        let lowest = (0..column.len()).min_by(by_height).unwrap_or(0);
        let highest = (0..column.len()).max_by(by_height).unwrap_or(0);
        let mut chosen = vec![0, lowest, highest, column.len() - 1];
        chosen.sort_unstable();
        chosen.dedup();
        kept.extend(chosen.into_iter().map(|index| column[index]));
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::svg::text;

    #[test]
    fn curves_are_clipped_at_the_frame_and_have_gaps_at_invalid_points() {
        let axes = Axes {
            cell: Cell::new(DVec2::new(10.0, 20.0), DVec2::new(100.0, 50.0)),
            across: Axis::linear("x", 0.0, 1.0),
            up: Axis::linear("y", 0.0, 1.0),
        };
        let curve = |points: &[(f64, f64)]| {
            let mut page = Drawing::new(200.0, "");
            axes.curve(&mut page, points, Stroke::new(INK, 1.0));
            text(&page)
        };
        let diagonal = "<path d=\"M10 70L110 20\"";
        assert!(curve(&[(-1.0, -1.0), (3.0, 3.0)]).contains(diagonal));
        assert!(curve(&[(0.0, 0.0), (1.0, 1.0)]).contains(diagonal));
        assert!(!curve(&[(0.0, 1.5), (1.0, 1.2)]).contains("<path"));
        let line = [0.0, 0.2, 0.3, 0.4, 1.0];
        let with_gap = line.map(|x| (x, if x == 0.3 { f64::NAN } else { x }));
        assert_eq!(curve(&with_gap).matches('M').count(), 2);
        let heights = [0.5, f64::INFINITY, 1e300, -1e280];
        let extreme = [0, 1, 2, 3].map(|i| (0.1 * i as f64, heights[i]));
        assert!(!curve(&extreme).contains("<path"));
    }

    #[test]
    fn smooth_curves_have_gaps_at_invalid_points() {
        let axes = Axes {
            cell: Cell::new(DVec2::ZERO, DVec2::splat(100.0)),
            across: Axis::linear("x", 0.0, 1.0),
            up: Axis::linear("y", 0.0, 1.0),
        };
        let x = [0.0, 0.1, f64::NAN, 0.3, f64::NAN, 0.5, 0.6, 0.8];
        let points = x.map(|x| (x, x));
        let drawn = axes.smooth(&points);
        let there: Vec<bool> = drawn.iter().map(|piece| !piece.is_empty()).collect();
        assert_eq!(there, [true, false, false, false, false, true, true]);
        assert_eq!(drawn[5].first(), axes.at(points[5]).as_ref());
        assert!(axes.smooth(&points[..1]).is_empty());
    }

    #[test]
    fn thinning_keeps_peaks_and_ends() {
        let peak = |i: usize| if i == 5432 { 1.0 } else { 0.0 };
        let points: Vec<(f64, f64)> = (0..10_000).map(|i| (i as f64, peak(i))).collect();
        let kept = thinned(&points, 100);
        assert!(kept.len() <= 400);
        assert!(kept.contains(&(5432.0, 1.0)));
        assert_eq!((kept[0], kept[kept.len() - 1]), (points[0], points[9999]));
        assert!(kept.windows(2).all(|w| w[0].0 < w[1].0));
    }
}
