//! Panels with two axes: grid, frame, ticks and names, with curves and markers inside. Every panel of
//! numbers is drawn with them.
//!
//! An axis, linear or logarithmic, maps values to fractions of its length, and has ticks at round numbers as
//! close as their labels can be read.

use crate::figure::drawing::formats::Font;
use crate::figure::drawing::markers::Marker;
use crate::figure::drawing::{
    Color, Drawing, DrawingPath, FONT_SIZE, FRAME_COLOR, GRID_COLOR, NOTE_COLOR, PageRectangle,
    PathStep, Stroke, TEXT_COLOR, TextAnchor, draw_panel_title, rectangle_path, smooth_curve,
};
use crate::report::numbers::{
    digit_times_power_text, format_decimals, power_of_ten_text, superscript, time_power_text,
};
use glam::DVec2;
use std::ops::{Range, RangeInclusive};

/// Sizes of what surrounds a frame, in pixels.
struct AxisMarks {
    tick: f64,
    subdivision_tick: f64,
    /// From the frame to the base line of the name of the horizontal axis.
    name_below: f64,
    /// From the frame to the base line of the name of the vertical axis: at least, after its labels, and at
    /// most.
    least_name_beside: f64,
    name_label_gap: f64,
    largest_name_beside: f64,
}

const AXIS_MARKS: AxisMarks = AxisMarks {
    tick: 4.0,
    subdivision_tick: 2.0,
    name_below: 34.0,
    least_name_beside: 42.0,
    name_label_gap: 13.0,
    largest_name_beside: 53.0,
};

pub struct NamedCurve {
    pub name: &'static str,
    pub color: Color,
    pub points: Vec<(f64, f64)>,
}

impl NamedCurve {
    pub fn ordinates(&self) -> impl Iterator<Item = f64> {
        self.points.iter().map(|point| point.1)
    }
}

pub struct PanelAxes {
    pub cell: PageRectangle,
    pub across: Axis,
    pub up: Axis,
}

impl PanelAxes {
    /// The position of a point on the page; `None` if it cannot be drawn.
    pub fn page_position(&self, (x, y): (f64, f64)) -> Option<DVec2> {
        let fraction = DVec2::new(self.across.fraction(x), 1.0 - self.up.fraction(y));
        let at = self.cell.corner + self.cell.size * fraction;
        at.is_finite().then_some(at)
    }

    /// Draws a panel of the letter and the title, with these axes.
    pub fn draw_titled(
        page: &mut Drawing,
        cell: PageRectangle,
        [letter, what]: [&str; 2],
        across: Axis,
        up: Axis,
    ) -> Self {
        let axes = PanelAxes { cell, across, up };
        draw_panel_title(page, cell.corner, letter, what);
        axes.draw(page);
        axes
    }

    /// Draws grid, frame, ticks and names.
    pub fn draw(&self, page: &mut Drawing) {
        let PageRectangle { corner, size } = self.cell;
        let end = self.cell.opposite_corner();
        let stroke = |axis: &Axis, tick: &Tick| match axis.emphasizes_zero && tick.value == 0.0 {
            true => Stroke::new(FRAME_COLOR, 0.8),
            false => Stroke::new(GRID_COLOR, 0.7),
        };
        for tick in self.across.ticks(size.x, AxisOrientation::Horizontal) {
            let top = corner.with_x(corner.x + tick.fraction * size.x);
            page.draw_line(top, top.with_y(end.y), stroke(&self.across, &tick));
        }
        for tick in self.up.ticks(size.y, AxisOrientation::Vertical) {
            let left = corner.with_y(end.y - tick.fraction * size.y);
            page.draw_line(left, left.with_x(end.x), stroke(&self.up, &tick));
        }
        self.draw_without_grid(page);
    }

    /// Draws frame, ticks and names, without the grid.
    pub fn draw_without_grid(&self, page: &mut Drawing) {
        let PageRectangle { corner, size } = self.cell;
        let (middle, end) = (self.cell.middle(), self.cell.opposite_corner());
        let rim = Stroke::new(FRAME_COLOR, 0.8);
        page.draw_stroke(rectangle_path(corner, size), rim);
        let widest = self.widest_label();
        // Long labels are written smaller, so that the name has its place beside them.
        let room = AXIS_MARKS.largest_name_beside - AXIS_MARKS.name_label_gap;
        let size_beside = FONT_SIZE.tick * (room / widest.max(room));
        for (axis, direction, length, out) in [
            (&self.across, AxisOrientation::Horizontal, size.x, DVec2::Y),
            (&self.up, AxisOrientation::Vertical, size.y, DVec2::NEG_X),
        ] {
            let foot = |fraction: f64| match direction {
                AxisOrientation::Horizontal => corner + size * DVec2::new(fraction, 1.0),
                AxisOrientation::Vertical => corner + size * DVec2::new(0.0, 1.0 - fraction),
            };
            for fraction in axis.decade_subdivisions(length) {
                let foot = foot(fraction);
                page.draw_line(foot, foot + AXIS_MARKS.subdivision_tick * out, rim);
            }
            for Tick { fraction, text, .. } in axis.ticks(length, direction) {
                let foot = foot(fraction);
                page.draw_line(foot, foot + AXIS_MARKS.tick * out, rim);
                match direction {
                    _ if !axis.labelled => (),
                    AxisOrientation::Horizontal => {
                        let base = foot + DVec2::new(0.0, AXIS_MARKS.tick + 1.2 * FONT_SIZE.tick);
                        page.draw_label(
                            base,
                            &text,
                            FONT_SIZE.tick,
                            TextAnchor::Middle,
                            NOTE_COLOR,
                        );
                    }
                    AxisOrientation::Vertical => {
                        let end = foot - DVec2::new(AXIS_MARKS.tick + 3.0, 0.0);
                        page.draw_centered_label(
                            end,
                            &text,
                            size_beside,
                            TextAnchor::End,
                            NOTE_COLOR,
                        );
                    }
                }
            }
        }
        if self.across.labelled {
            let base = DVec2::new(middle.x, end.y + AXIS_MARKS.name_below);
            page.draw_label(
                base,
                &self.across.title(),
                FONT_SIZE.text,
                TextAnchor::Middle,
                TEXT_COLOR,
            );
        }
        if self.up.labelled {
            let distance = (widest + AXIS_MARKS.name_label_gap)
                .clamp(AXIS_MARKS.least_name_beside, AXIS_MARKS.largest_name_beside);
            let base = DVec2::new(corner.x - distance, middle.y);
            page.draw_rotated_label(base, &self.up.title(), FONT_SIZE.text, TEXT_COLOR);
        }
    }

    /// The width of the widest label beside the frame.
    fn widest_label(&self) -> f64 {
        let font = Font::embedded();
        let ticks = self.up.ticks(self.cell.size.y, AxisOrientation::Vertical);
        let widths = ticks.iter().filter(|_| self.up.labelled);
        let widths = widths.map(|tick| font.text_width(&tick.text, FONT_SIZE.tick));
        widths.fold(0.0, f64::max)
    }

    /// Draws the part of a curve through these points that is inside the frame, with
    /// gaps where a point cannot be drawn.
    pub fn draw_curve(&self, page: &mut Drawing, points: &[(f64, f64)], stroke: Stroke) {
        let columns = self.cell.size.x.ceil().max(1.0) as usize;
        let places = thin_points(points, columns).into_iter();
        let places: Vec<Option<DVec2>> = places.map(|point| self.page_position(point)).collect();
        self.draw_clipped_line(page, &places, stroke);
    }

    /// A smooth curve through these points as straight pieces on the page: for every point but the
    /// last those that lead to the next; none where one of both cannot be drawn.
    pub fn smooth_curve(&self, points: &[(f64, f64)]) -> Vec<Vec<DVec2>> {
        let places: Vec<Option<DVec2>> = points
            .iter()
            .map(|&point| self.page_position(point))
            .collect();
        let mut pieces = Vec::with_capacity(points.len());
        for run in places.split_inclusive(Option::is_none) {
            let drawn: Vec<DVec2> = run.iter().flatten().copied().collect();
            pieces.extend(smooth_curve(&drawn));
            pieces.resize(pieces.len() + usize::from(!drawn.is_empty()), Vec::new());
            pieces.resize(pieces.len() + run.len() - drawn.len(), Vec::new());
        }
        pieces.truncate(points.len().saturating_sub(1));
        pieces
    }

    /// Draws what is inside the frame of a line through these points on the page, with gaps where
    /// one is missing.
    pub fn draw_clipped_line(&self, page: &mut Drawing, places: &[Option<DVec2>], stroke: Stroke) {
        let mut path: DrawingPath = Vec::new();
        let mut pen = None;
        for pair in places.windows(2) {
            let ends = pair[0].zip(pair[1]).map(<[DVec2; 2]>::from);
            let Some([from, to]) = ends.and_then(|ends| self.clip_to_frame(ends)) else {
                continue;
            };
            if pen != Some(from) {
                path.push(PathStep::Move(from));
            }
            path.push(PathStep::Line(to));
            pen = Some(to);
        }
        if !path.is_empty() {
            page.draw_stroke(path, stroke);
        }
    }

    /// The part of a line that is inside the frame (Liang and Barsky).
    fn clip_to_frame(&self, [from, to]: [DVec2; 2]) -> Option<[DVec2; 2]> {
        let step = to - from;
        let (low, high) = (self.cell.corner - from, self.cell.opposite_corner() - from);
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
        (first <= last).then(|| [first, last].map(point))
    }

    /// Draws a marker at each of these points that is inside the frame.
    pub fn draw_markers(
        &self,
        page: &mut Drawing,
        points: impl IntoIterator<Item = (f64, f64)>,
        marker: Marker,
        color: Color,
    ) {
        let (low, high) = (self.cell.corner - 0.01, self.cell.opposite_corner() + 0.01);
        for at in points
            .into_iter()
            .filter_map(|point| self.page_position(point))
        {
            if at.cmpge(low).all() && at.cmple(high).all() {
                marker.draw(page, at, color);
            }
        }
    }
}

/// Fewer points that look the same when drawn over `columns` columns: of each
/// the first, the last, the lowest and the highest.
fn thin_points(points: &[(f64, f64)], columns: usize) -> Vec<(f64, f64)> {
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

/// Which values an axis covers.
struct AxisRange {
    /// Padding at both ends, as a fraction of a linear extent and in decades.
    linear_padding: f64,
    logarithmic_padding: f64,
    /// Decades that are shown below the largest value: smaller ones are rounding.
    most_decades: f64,
    /// Larger values are diverged and not drawn.
    largest_value: f64,
}

const AXIS_RANGE_RULES: AxisRange = AxisRange {
    linear_padding: 0.06,
    logarithmic_padding: 0.12,
    most_decades: 18.0,
    largest_value: 1e290,
};

/// Powers of ten for which a linear axis writes values without a factor.
const POWERS_WITHOUT_FACTOR: Range<f64> = -2.0..4.0;

/// Least distances of ticks, in pixels.
struct TickSpacing {
    /// Distance of ticks across and up, on linear and logarithmic axes.
    linear: [f64; 2],
    logarithmic: [f64; 2],
    /// Gap between the labels of neighboring ticks.
    label_gap: f64,
    /// A wider decade is subdivided.
    subdivided_decade: f64,
}

const TICK_SPACING: TickSpacing = TickSpacing {
    linear: [62.0, 25.0],
    logarithmic: [38.0, 22.0],
    label_gap: 4.0,
    subdivided_decade: 60.0,
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisOrientation {
    Horizontal,
    Vertical,
}

/// Where ticks are, and how they are labelled.
#[derive(Clone, Debug)]
pub enum TickPlacement {
    /// Round numbers; on a logarithmic axis powers of ten.
    RoundNumbers,
    /// Powers of ten, in seconds.
    PowersInSeconds,
    /// Some of these whole numbers.
    WholeNumbers(Vec<f64>),
}

#[derive(Clone, Debug)]
pub struct Axis {
    pub name: String,
    /// The sign of all values of a logarithmic axis; `None`: linear.
    pub sign: Option<f64>,
    /// Values at both ends or, on a logarithmic axis, decades; they may decrease.
    pub start: f64,
    pub end: f64,
    pub ticks: TickPlacement,
    /// Least pixels between ticks, in place of the default.
    pub tick_spacing: Option<f64>,
    /// Whether the ticks and the axis are labelled.
    pub labelled: bool,
    /// Whether the grid line of zero, where most curves begin, is emphasized.
    pub emphasizes_zero: bool,
}

#[derive(Clone, Debug)]
pub struct Tick {
    pub value: f64,
    /// From 0 at the start of the axis to 1 at its end.
    pub fraction: f64,
    pub text: String,
}

/// A value as a tick shows it.
#[derive(Clone, Debug)]
pub struct LabelledValue {
    pub value: f64,
    pub text: String,
}

impl Axis {
    pub fn linear(name: &str, start: f64, end: f64) -> Self {
        let [start, end] = [start, end].map(|value| {
            value.clamp(
                -AXIS_RANGE_RULES.largest_value,
                AXIS_RANGE_RULES.largest_value,
            )
        });
        let size = start.abs().max(end.abs());
        let extent = (end - start).abs();
        // An extent that is only rounding counts as zero.
        let (start, end) = if extent > 1e-12 * size && extent > f64::MIN_POSITIVE {
            (start, end)
        } else if size > f64::MIN_POSITIVE {
            (start - 0.5 * size, end + 0.5 * size)
        } else {
            (-1.0, 1.0)
        };
        Axis {
            name: name.into(),
            sign: None,
            start,
            end,
            ticks: TickPlacement::RoundNumbers,
            tick_spacing: None,
            labelled: true,
            emphasizes_zero: false,
        }
    }

    /// An axis from 0 to 1 without ticks, for rows that are placed by their number.
    pub fn blank() -> Self {
        Axis {
            ticks: TickPlacement::WholeNumbers(Vec::new()),
            labelled: false,
            ..Axis::linear("", 0.0, 1.0)
        }
    }

    /// A linear axis that covers these values, with padding.
    pub fn linear_covering(name: &str, values: impl Iterator<Item = f64>) -> Self {
        let (low, high) =
            extent_of_values(values.filter(|value| value.abs() < AXIS_RANGE_RULES.largest_value))
                .unwrap_or_default();
        let axis = Axis::linear(name, low, high);
        let padding = AXIS_RANGE_RULES.linear_padding * (axis.end - axis.start);
        Axis {
            start: axis.start - padding,
            end: axis.end + padding,
            emphasizes_zero: true,
            ..axis
        }
    }

    /// Widens the axis to at least this extent: smaller variations are rounding.
    pub fn with_least_extent(self, extent: f64) -> Self {
        let lacking = extent - (self.end - self.start);
        if lacking.is_nan() || lacking <= 0.0 {
            return self;
        }
        Axis {
            start: self.start - 0.5 * lacking,
            end: self.end + 0.5 * lacking,
            ..self
        }
    }

    /// A logarithmic axis of at least `fewest` decades that covers the positive ones of
    /// these values, with padding.
    pub fn logarithmic(name: &str, values: impl Iterator<Item = f64>, fewest: f64) -> Self {
        let drawable = values.filter(|value| value.is_normal() && *value > 0.0);
        let (start, end) = match extent_of_values(drawable.map(f64::log10)) {
            Some((low, high)) => {
                let low = low.max(high - AXIS_RANGE_RULES.most_decades);
                let padding =
                    (0.5 * (fewest - (high - low))).max(AXIS_RANGE_RULES.logarithmic_padding);
                (low - padding, high + padding)
            }
            None => (-fewest, 0.0),
        };
        Axis {
            sign: Some(1.0),
            ..Axis::linear(name, start, end)
        }
    }

    /// An axis that covers these values: linear or, given their sign, logarithmic.
    pub fn covering_values(
        name: &str,
        values: impl Iterator<Item = f64>,
        sign: Option<f64>,
    ) -> Self {
        match sign {
            None => Axis::linear_covering(name, values),
            Some(sign) => Axis {
                sign: Some(sign),
                ..Axis::logarithmic(name, values.map(|value| sign * value), 1.0)
            },
        }
    }

    /// The name, with the unit of the labels: a power of ten times that of the values.
    pub fn title(&self) -> String {
        match self.label_power_of_ten() {
            _ if self.name.is_empty() => String::new(),
            0 => self.name.clone(),
            power => match self.name.rsplit_once(" / ") {
                Some((name, unit)) => format!("{name} / 10{} {unit}", superscript(power)),
                None => format!("{} / 10{}", self.name, superscript(power)),
            },
        }
    }

    /// The power of ten that is the unit of the tick labels.
    pub fn label_power_of_ten(&self) -> i32 {
        let size = self.start.abs().max(self.end.abs()).log10();
        match (self.sign, &self.ticks) {
            (None, TickPlacement::RoundNumbers) if !POWERS_WITHOUT_FACTOR.contains(&size) => {
                3 * (size / 3.0).floor() as i32
            }
            _ => 0,
        }
    }

    /// Where a value is, from 0 at the start to 1 at the end; not finite if it
    /// cannot be drawn.
    pub fn fraction(&self, value: f64) -> f64 {
        let at = match self.sign {
            Some(sign) => (sign * value).log10(),
            None if value.abs() < AXIS_RANGE_RULES.largest_value => value,
            None => f64::NAN,
        };
        (at - self.start) / (self.end - self.start)
    }

    /// As many ticks as can be read on an axis of this length in pixels.
    pub fn ticks(&self, length: f64, direction: AxisOrientation) -> Vec<Tick> {
        let default = match self.ticks {
            TickPlacement::RoundNumbers if self.sign.is_none() => TICK_SPACING.linear,
            _ => TICK_SPACING.logarithmic,
        };
        let font = Font::embedded();
        let size = |tick: &Tick| match direction {
            AxisOrientation::Horizontal => font.text_width(&tick.text, FONT_SIZE.tick),
            AxisOrientation::Vertical => FONT_SIZE.tick,
        };
        let separate = |pair: &[Tick]| {
            let distance = length * (pair[1].fraction - pair[0].fraction).abs();
            distance - 0.5 * (size(&pair[0]) + size(&pair[1])) > TICK_SPACING.label_gap
        };
        let mut spacing = self.tick_spacing.unwrap_or(default[direction as usize]);
        loop {
            let ticks = self.ticks_spaced(spacing / length);
            if !self.labelled || spacing > length || ticks.windows(2).all(separate) {
                return ticks;
            }
            spacing *= 1.25;
        }
    }

    /// Ticks spaced by about this fraction of the axis.
    fn ticks_spaced(&self, spacing: f64) -> Vec<Tick> {
        let (low, high) = (self.start.min(self.end), self.start.max(self.end));
        let every = |count: usize| (count as f64 * spacing).ceil().max(1.0) as usize;
        let ticks = match (&self.ticks, self.sign) {
            (TickPlacement::WholeNumbers(values), _) => {
                let kept = values.iter().step_by(every(values.len()));
                kept.map(|&value| LabelledValue {
                    value,
                    text: format_decimals(value, 0),
                })
                .collect()
            }
            (_, Some(sign)) => {
                let count = (high.floor() - low.ceil() + 1.0).max(0.0) as usize;
                self.decade_ticks(low..=high, sign, every(count) as i32, count < 2)
            }
            (TickPlacement::RoundNumbers | TickPlacement::PowersInSeconds, None) => {
                let unit = 10f64.powi(self.label_power_of_ten());
                let step = round_step((high - low) * spacing / unit);
                let found = multiples_with_text(low / unit, high / unit, step).into_iter();
                found
                    .map(|LabelledValue { value, text }| LabelledValue {
                        value: value * unit,
                        text,
                    })
                    .collect()
            }
        };
        let tick = |LabelledValue { value, text }: LabelledValue| Tick {
            value,
            fraction: self.fraction(value),
            text,
        };
        // Beyond the largest number there is no power of ten.
        let ticks = ticks.into_iter().map(tick);
        ticks.filter(|tick| tick.fraction.is_finite()).collect()
    }

    /// Powers of ten that are multiples of `every` or, if there are few, 1, 2 and 5 times
    /// every power.
    fn decade_ticks(
        &self,
        range: RangeInclusive<f64>,
        sign: f64,
        every: i32,
        few: bool,
    ) -> Vec<LabelledValue> {
        let (digits, every) = match few {
            true => ([1.0, 2.0, 5.0].as_slice(), 1),
            false => ([1.0].as_slice(), every),
        };
        let powers = range.start().floor() as i32..=range.end().ceil() as i32;
        let powers = powers.filter(|power| power % every == 0);
        let found = powers.flat_map(|power| digits.iter().map(move |&digit| (digit, power)));
        found
            .filter(|&(digit, power)| range.contains(&(f64::from(power) + f64::log10(digit))))
            .map(|(digit, power)| {
                let text = match self.ticks {
                    TickPlacement::PowersInSeconds => time_power_text(digit, power),
                    _ if few => digit_times_power_text(sign * digit, power),
                    _ => power_of_ten_text(sign, power),
                };
                LabelledValue {
                    value: sign * digit * 10f64.powi(power),
                    text,
                }
            })
            .collect()
    }

    /// Fractions at which long decades are subdivided: 2 to 9 times the power of ten.
    fn decade_subdivisions(&self, length: f64) -> Vec<f64> {
        let (low, high) = (self.start.min(self.end), self.start.max(self.end));
        let divided = length > TICK_SPACING.subdivided_decade * (high - low)
            && !matches!(self.ticks, TickPlacement::WholeNumbers(_));
        let Some(sign) = self.sign.filter(|_| divided) else {
            return Vec::new();
        };
        let powers = low.floor() as i32..=high.floor() as i32;
        let values =
            powers.flat_map(|power| (2..10).map(move |n| f64::from(n) * 10f64.powi(power)));
        let fractions = values.map(|value| self.fraction(sign * value));
        fractions.filter(|it| (0.0..=1.0).contains(it)).collect()
    }
}

fn extent_of_values(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let both = values.map(|value| (value, value));
    both.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// The smallest of 1, 2 or 5 times a power of ten that is at least `smallest`.
pub fn round_step(smallest: f64) -> f64 {
    let decade = 10f64.powf(smallest.log10().floor());
    // Tolerates rounding: 0.2 must yield 0.2 and not 0.5.
    let wanted = smallest * (1.0 - 1e-9);
    [1.0, 2.0, 5.0]
        .into_iter()
        .map(|factor| factor * decade)
        .find(|&step| step >= wanted)
        .unwrap_or(10.0 * decade)
}

/// Multiples of `step` from `low` to `high`, each with its text.
pub fn multiples_with_text(low: f64, high: f64, step: f64) -> Vec<LabelledValue> {
    let slack = 1e-9;
    let first = (low / step - slack).ceil() as i64;
    let last = (high / step + slack).floor() as i64;
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    (first..=last)
        .map(|multiple| multiple as f64 * step)
        .map(|value| LabelledValue {
            value,
            text: format_decimals(value, decimals),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::formats::checked_svg_text;

    #[test]
    fn curves_are_clipped_at_the_frame_and_have_gaps_at_invalid_points() {
        let axes = PanelAxes {
            cell: PageRectangle::new(DVec2::new(10.0, 20.0), DVec2::new(100.0, 50.0)),
            across: Axis::linear("x", 0.0, 1.0),
            up: Axis::linear("y", 0.0, 1.0),
        };
        let curve = |points: &[(f64, f64)]| {
            let mut page = Drawing::new(200.0, "");
            axes.draw_curve(&mut page, points, Stroke::new(TEXT_COLOR, 1.0));
            checked_svg_text(&page)
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
        let axes = PanelAxes {
            cell: PageRectangle::new(DVec2::ZERO, DVec2::splat(100.0)),
            across: Axis::linear("x", 0.0, 1.0),
            up: Axis::linear("y", 0.0, 1.0),
        };
        let x = [0.0, 0.1, f64::NAN, 0.3, f64::NAN, 0.5, 0.6, 0.8];
        let points = x.map(|x| (x, x));
        let drawn = axes.smooth_curve(&points);
        let there: Vec<bool> = drawn.iter().map(|piece| !piece.is_empty()).collect();
        assert_eq!(there, [true, false, false, false, false, true, true]);
        assert_eq!(drawn[5].first(), axes.page_position(points[5]).as_ref());
        assert!(axes.smooth_curve(&points[..1]).is_empty());
    }

    #[test]
    fn thinning_keeps_peaks_and_ends() {
        let peak = |i: usize| if i == 5432 { 1.0 } else { 0.0 };
        let points: Vec<(f64, f64)> = (0..10_000).map(|i| (i as f64, peak(i))).collect();
        let kept = thin_points(&points, 100);
        assert!(kept.len() <= 400);
        assert!(kept.contains(&(5432.0, 1.0)));
        assert_eq!((kept[0], kept[kept.len() - 1]), (points[0], points[9999]));
        assert!(kept.windows(2).all(|w| w[0].0 < w[1].0));
    }
}

#[cfg(test)]
mod axis_tests {
    use super::*;
    use AxisOrientation::{Horizontal, Vertical};

    fn texts(axis: &Axis, length: f64) -> Vec<String> {
        let ticks = axis.ticks(length, Horizontal).into_iter();
        ticks.map(|tick| tick.text).collect()
    }

    #[test]
    fn linear_axes_have_few_digits() {
        for (low, high, name) in [
            (0.0, 12.0, "t"),
            (0.0, 3e-5, "t / 10⁻⁶"),
            (-2e7, 1e6, "t / 10⁶"),
            (0.02, 0.5, "t"),
        ] {
            let axis = Axis::linear_covering("t", [low, high].into_iter());
            assert_eq!(axis.title(), name);
            let ticks = axis.ticks(300.0, Vertical);
            assert!((3..=12).contains(&ticks.len()), "{low} {high}: {ticks:?}");
            for tick in ticks {
                assert!(tick.text.chars().count() <= 6, "{tick:?}");
                assert!((0.0..=1.0).contains(&tick.fraction), "{tick:?}");
            }
        }
        let axis = Axis::linear_covering("tip / cm", [0.0, 3e-5].into_iter());
        assert_eq!(axis.title(), "tip / 10⁻⁶ cm");
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
            for axis in [
                Axis::linear_covering("t", values.iter().copied()),
                Axis::logarithmic("t", values.iter().copied(), 1.0),
            ] {
                assert!(axis.end > axis.start, "{values:?}");
                assert!(!axis.ticks(300.0, Vertical).is_empty(), "{values:?}");
            }
        }
    }

    #[test]
    fn logarithmic_axes_cover_their_values_with_padding() {
        for values in [vec![1e-4, 3.0], vec![2.0, 2.1], vec![7.0], vec![1e-12, 0.0]] {
            for fewest in [1.0, 3.0] {
                let axis = Axis::logarithmic("", values.iter().copied(), fewest);
                for &value in values.iter().filter(|&&value| value > 0.0) {
                    let fraction = axis.fraction(value);
                    assert!((0.0..=1.0).contains(&fraction), "{value} in {axis:?}");
                }
                assert!(axis.end - axis.start >= fewest - 1e-12);
                assert!(!axis.fraction(0.0).is_finite());
            }
        }
        // Rounding of rounding is left out.
        let axis = Axis::logarithmic("", [1e-300, 1e-3].into_iter(), 3.0);
        assert!(axis.fraction(1e-300) < 0.0);
    }

    #[test]
    fn ticks_of_the_largest_numbers_are_on_the_axis() {
        for values in [vec![1e308], vec![1e308, 1e-300], vec![-1.7e308, 1.7e308]] {
            for axis in [
                Axis::logarithmic("t", values.iter().copied(), 3.0),
                Axis::linear_covering("t", values.iter().copied()),
                Axis::linear("t", values[0], *values.last().unwrap()),
            ] {
                for tick in axis.ticks(300.0, Vertical) {
                    assert!((0.0..=1.0).contains(&tick.fraction), "{tick:?} of {axis:?}");
                }
            }
        }
    }

    #[test]
    fn labels_are_readable_and_do_not_touch() {
        let axis = Axis::logarithmic("", [2e-3, 0.5].into_iter(), 1.0);
        assert_eq!(texts(&axis, 400.0), ["10⁻²", "10⁻¹"]);
        let axis = Axis {
            ticks: TickPlacement::PowersInSeconds,
            ..axis
        };
        assert_eq!(texts(&axis, 400.0), ["10 ms", "100 ms"]);
        let axis = Axis::logarithmic("", [2.0, 5.0].into_iter(), 0.1);
        assert_eq!(texts(&axis, 400.0), ["2", "5"]);
        let sign = Some(-1.0);
        let axis = Axis { sign, ..axis };
        assert_eq!(texts(&axis, 400.0), ["\u{2212}2", "\u{2212}5"]);
        let axis = Axis {
            ticks: TickPlacement::WholeNumbers((1..=40).map(f64::from).collect()),
            ..Axis::linear("", 0.5, 40.5)
        };
        assert_eq!(texts(&axis, 200.0).len(), 5);
        assert_eq!(texts(&axis, 2000.0).len(), 40);
        let axis = Axis::linear("", 1000.001, 1000.009);
        for pair in axis.ticks(300.0, Horizontal).windows(2) {
            let apart = 300.0 * (pair[1].fraction - pair[0].fraction);
            assert!(apart > 62.0, "{pair:?}");
        }
    }
}

#[cfg(test)]
mod round_tests {
    use super::*;

    #[test]
    fn steps_are_round() {
        let asked = [0.13, 0.2, 0.21, 0.6, 30.0];
        for (smallest, step) in asked.into_iter().zip([0.2, 0.2, 0.5, 1.0, 50.0]) {
            let found = round_step(smallest);
            assert!((found - step).abs() < 1e-12 * step, "{smallest}: {found}");
        }
    }

    #[test]
    fn multiples_reach_both_ends_and_have_equal_decimals() {
        let texts = |low, high, step| -> Vec<String> {
            let found = multiples_with_text(low, high, step).into_iter();
            found.map(|it| it.text).collect()
        };
        let even = ["\u{2212}0.4", "\u{2212}0.2", "0.0", "0.2", "0.4"];
        assert_eq!(texts(-0.4, 0.45, 0.2), even);
        assert_eq!(texts(-0.1, 0.1, 0.05).len(), 5);
        assert_eq!(texts(0.3, 19.0, 10.0), ["10"]);
        assert_eq!(texts(0.1, 0.2, 1.0), [""; 0]);
    }
}
