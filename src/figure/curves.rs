//! A panel with curves in time on linear axes.

use glam::DVec2;

use super::colors::{Color, FRAME, GRID, INK, NOTE};
use super::drawing::{Anchor, Drawing, HALF_CAPITAL, Path, Step, Stroke, rectangle};
use super::font::Font;
use super::page::{Cell, TEXT_SIZE, TICK_SIZE};
use super::ticks::{round_step, ticks};
use crate::report::numbers::superscript;

/// Air above and below the curves, as a fraction of their extent.
const AIR: f64 = 0.06;

/// Distance between ticks at least.
const ACROSS: f64 = 62.0;
const UP: f64 = 25.0;

/// What is larger is a number gone wild.
const LARGEST: f64 = 1e290;

/// Powers of ten that are written out on an axis.
const PLAIN: std::ops::Range<f64> = -2.0..4.0;

/// The values along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    low: f64,
    high: f64,
    /// Numbers on the axis are in this power of ten.
    power: i32,
}

impl Range {
    /// From the least to the greatest of these.
    pub fn of(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = values
            .filter(|value| is_drawable(*value))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            });
        match low <= high {
            true => Range::between(low, high),
            false => Range::between(0.0, 0.0),
        }
    }

    pub fn between(low: f64, high: f64) -> Self {
        let size = low.abs().max(high.abs());
        // An extent that is rounding is none.
        let (low, high) = match high - low > 1e-12 * size && high - low > f64::MIN_POSITIVE {
            true => (low, high),
            false if size > f64::MIN_POSITIVE => (low - 0.5 * size, high + 0.5 * size),
            false => (-1.0, 1.0),
        };
        let size = low.abs().max(high.abs()).log10();
        let power = match PLAIN.contains(&size) {
            true => 0,
            false => 3 * (size / 3.0).floor() as i32,
        };
        Range { low, high, power }
    }

    /// With air at both ends.
    pub fn airy(self) -> Self {
        let air = AIR * (self.high - self.low);
        Range {
            low: self.low - air,
            high: self.high + air,
            ..self
        }
    }

    /// Ticks that are at least so many pixels apart on an axis of `length`.
    fn ticks(&self, distance: f64, length: f64) -> Vec<(f64, String)> {
        let unit = 10f64.powi(self.power);
        let (low, high) = (self.low / unit, self.high / unit);
        let step = round_step((high - low) * distance / length);
        let shown = ticks(low, high, step).into_iter();
        shown.map(|(value, text)| (value * unit, text)).collect()
    }

    /// A name with the power of ten in which it is given, if it is.
    fn label(&self, name: &str) -> String {
        match self.power {
            0 => name.into(),
            power => format!("{name} · 10{}", superscript(-power)),
        }
    }
}

fn is_drawable(value: f64) -> bool {
    value.abs() < LARGEST
}

/// Two axes around a cell.
pub struct Axes {
    pub cell: Cell,
    pub across: Range,
    pub up: Range,
}

impl Axes {
    /// Where a point is on the page.
    pub fn at(&self, (x, y): (f64, f64)) -> DVec2 {
        self.place(x, y)
    }

    fn place(&self, x: f64, y: f64) -> DVec2 {
        let part = |range: Range, value: f64| (value - range.low) / (range.high - range.low);
        let Cell { corner, size } = self.cell;
        corner + size * DVec2::new(part(self.across, x), 1.0 - part(self.up, y))
    }

    /// Draws grid, frame, ticks and names.
    pub fn draw(&self, page: &mut Drawing, across: &str, up: &str) {
        const TICK_LENGTH: f64 = 4.0;
        let Cell { corner, size } = self.cell;
        let end = corner + size;
        let columns = self.across.ticks(ACROSS, size.x);
        let rows = self.up.ticks(UP, size.y);
        let (grid, rim) = (Stroke::new(GRID, 0.7), Stroke::new(FRAME, 0.8));
        let column = |value: f64| self.place(value, self.up.low).x;
        let row = |value: f64| self.place(self.across.low, value).y;
        for (value, _) in &columns {
            let x = column(*value);
            page.line(DVec2::new(x, corner.y), DVec2::new(x, end.y), grid);
        }
        for (value, _) in &rows {
            let y = row(*value);
            // Zero is where most of these curves begin.
            let line = if *value == 0.0 { rim } else { grid };
            page.line(DVec2::new(corner.x, y), DVec2::new(end.x, y), line);
        }
        page.stroke(rectangle(corner, size), rim);
        for (value, text) in &columns {
            let foot = DVec2::new(column(*value), end.y);
            page.line(foot, foot + DVec2::new(0.0, TICK_LENGTH), rim);
            let base = foot + DVec2::new(0.0, TICK_LENGTH + 1.2 * TICK_SIZE);
            page.label(base, text, TICK_SIZE, Anchor::Middle, NOTE);
        }
        for (value, text) in &rows {
            let foot = DVec2::new(corner.x, row(*value));
            page.line(foot, foot - DVec2::new(TICK_LENGTH, 0.0), rim);
            let base = foot + DVec2::new(-TICK_LENGTH - 3.0, HALF_CAPITAL * TICK_SIZE);
            page.label(base, text, TICK_SIZE, Anchor::End, NOTE);
        }
        if !across.is_empty() {
            let below = DVec2::new(0.5 * (corner.x + end.x), end.y + 34.0);
            let across = self.across.label(across);
            page.label(below, &across, TEXT_SIZE, Anchor::Middle, INK);
        }
        let font = Font::embedded();
        let widths = rows.iter().map(|(_, text)| font.width(text, TICK_SIZE));
        let away = widths.fold(29.0, f64::max) + 13.0;
        let beside = DVec2::new(corner.x - away, 0.5 * (corner.y + end.y));
        page.upright_label(beside, &self.up.label(up), TEXT_SIZE, INK);
    }

    /// Draws a curve through points in rising order; it is broken where a value
    /// cannot be drawn.
    pub fn curve(&self, page: &mut Drawing, points: &[(f64, f64)], stroke: Stroke) {
        let columns = self.cell.size.x.ceil().max(1.0) as usize;
        let mut path: Path = Vec::new();
        let mut broken = true;
        for (x, y) in thinned(points, columns) {
            if !(is_drawable(x) && is_drawable(y)) {
                broken = true;
                continue;
            }
            let at = self.place(x, y);
            path.push(if broken {
                Step::Move(at)
            } else {
                Step::Line(at)
            });
            broken = false;
        }
        if !path.is_empty() {
            page.stroke(path, stroke);
        }
    }

    /// A colour's name and what is to be said of it, beside the panel.
    pub fn key(&self, page: &mut Drawing, entry: usize, color: Color, name: &str, note: &str) {
        const ENTRY: f64 = 40.0;
        const SWATCH: f64 = 22.0;
        let at = self.cell.corner + DVec2::new(self.cell.size.x + 16.0, 8.0 + ENTRY * entry as f64);
        page.line(at, at + DVec2::new(SWATCH, 0.0), Stroke::new(color, 1.8));
        let base = at + DVec2::new(SWATCH + 6.0, HALF_CAPITAL * TICK_SIZE);
        page.label(base, name, TICK_SIZE, Anchor::Start, INK);
        let below = base + DVec2::new(0.0, 15.0);
        page.label(below, note, TICK_SIZE, Anchor::Start, NOTE);
    }
}

/// Points that look the same when drawn over so many columns: of every
/// column's, the first, the last, the lowest and the highest.
fn thinned(points: &[(f64, f64)], columns: usize) -> Vec<(f64, f64)> {
    let each = points.len().div_ceil(columns);
    if each <= 4 {
        return points.to_vec();
    }
    let mut kept = Vec::with_capacity(4 * columns);
    for column in points.chunks(each) {
        let by_height = |a: &usize, b: &usize| column[*a].1.total_cmp(&column[*b].1);
        let (lowest, highest) = (
            (0..column.len()).min_by(by_height).unwrap_or(0),
            (0..column.len()).max_by(by_height).unwrap_or(0),
        );
        let mut chosen = [0, lowest, highest, column.len() - 1];
        chosen.sort_unstable();
        let mut last = None;
        for index in chosen {
            if last != Some(index) {
                kept.push(column[index]);
            }
            last = Some(index);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_have_few_digits() {
        for (low, high, label) in [
            (0.0, 12.0, "t"),
            (0.0, 3e-5, "t · 10⁶"),
            (-2e7, 1e6, "t · 10⁻⁶"),
            (0.02, 0.5, "t"),
        ] {
            let range = Range::between(low, high).airy();
            assert_eq!(range.label("t"), label);
            let ticks = range.ticks(UP, 300.0);
            assert!((3..=12).contains(&ticks.len()), "{low} {high}: {ticks:?}");
            for (value, text) in ticks {
                assert!(text.chars().count() <= 6, "{text}");
                assert!(value >= range.low && value <= range.high);
            }
        }
    }

    #[test]
    fn nothing_and_constants_have_an_extent() {
        for values in [
            vec![],
            vec![0.0, 0.0],
            vec![3.0],
            vec![f64::NAN, f64::INFINITY],
            vec![1.0, 1.0 + 1e-15],
            vec![1e-320, 0.0],
        ] {
            let range = Range::of(values.iter().copied());
            assert!(range.high > range.low, "{values:?}");
            assert!(!range.ticks(UP, 300.0).is_empty(), "{values:?}");
        }
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
