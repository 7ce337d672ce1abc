//! An axis: maps values to fractions of its length, and places round ticks.

use std::ops::{Range, RangeInclusive};

use crate::figure::font::Font;
use crate::figure::layout::TICK_SIZE;
use crate::figure::round::{multiples, round_step};
use crate::report::numbers::{decade, digit_of_decade, fixed, superscript, time_of_decade};

/// Padding at both ends: as a fraction of a linear extent, and in decades.
const PADDING: f64 = 0.06;
const PADDING_DECADES: f64 = 0.12;
/// Most decades of an axis: smaller values are below rounding.
const MOST_DECADES: f64 = 18.0;
/// Larger values are diverged and not drawn.
const LARGEST: f64 = 1e290;
/// Powers of ten for which a linear axis writes values without a factor.
const PLAIN: Range<f64> = -2.0..4.0;
/// Least pixels between ticks, across and up, and between their labels.
const LINEAR: [f64; 2] = [62.0, 25.0];
const LOGARITHMIC: [f64; 2] = [38.0, 22.0];
const BETWEEN_LABELS: f64 = 4.0;
/// A decade wider than this many pixels is subdivided.
const DIVIDED: f64 = 60.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    Across,
    Up,
}

/// Where ticks are, and how they are labelled.
#[derive(Clone, Debug)]
pub enum Ticks {
    /// Round numbers; on a logarithmic axis powers of ten.
    Round,
    /// Powers of ten, in seconds.
    Times,
    /// Some of these whole numbers.
    At(Vec<f64>),
}

#[derive(Clone, Debug)]
pub struct Axis {
    pub name: String,
    /// The sign of all values of a logarithmic axis; `None`: linear.
    pub sign: Option<f64>,
    /// Values at both ends or, on a logarithmic axis, decades; they may decrease.
    pub start: f64,
    pub end: f64,
    pub ticks: Ticks,
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

impl Axis {
    pub fn linear(name: &str, start: f64, end: f64) -> Self {
        let [start, end] = [start, end].map(|value| value.clamp(-LARGEST, LARGEST));
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
            ticks: Ticks::Round,
            tick_spacing: None,
            labelled: true,
            emphasizes_zero: false,
        }
    }

    /// A linear axis that covers these values, with padding.
    pub fn holding(name: &str, values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = extent(values.filter(|value| value.abs() < LARGEST)).unwrap_or_default();
        let axis = Axis::linear(name, low, high);
        let padding = PADDING * (axis.end - axis.start);
        Axis {
            start: axis.start - padding,
            end: axis.end + padding,
            emphasizes_zero: true,
            ..axis
        }
    }

    /// The same axis with at least this extent: smaller variations are rounding.
    pub fn at_least(self, extent: f64) -> Self {
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
        let (start, end) = match extent(drawable.map(f64::log10)) {
            Some((low, high)) => {
                let low = low.max(high - MOST_DECADES);
                let padding = (0.5 * (fewest - (high - low))).max(PADDING_DECADES);
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
    pub fn covering(name: &str, values: impl Iterator<Item = f64>, sign: Option<f64>) -> Self {
        match sign {
            None => Axis::holding(name, values),
            Some(sign) => Axis {
                sign: Some(sign),
                ..Axis::logarithmic(name, values.map(|value| sign * value), 1.0)
            },
        }
    }

    /// The name, with the power of ten by which values are multiplied.
    pub fn title(&self) -> String {
        match self.power() {
            _ if self.name.is_empty() => String::new(),
            0 => self.name.clone(),
            power => format!("{} · 10{}", self.name, superscript(-power)),
        }
    }

    /// The power of ten that is the unit of the tick labels.
    pub fn power(&self) -> i32 {
        let size = self.start.abs().max(self.end.abs()).log10();
        match (self.sign, &self.ticks) {
            (None, Ticks::Round) if !PLAIN.contains(&size) => 3 * (size / 3.0).floor() as i32,
            _ => 0,
        }
    }

    /// Where a value is, from 0 at the start to 1 at the end; not finite if it
    /// cannot be drawn.
    pub fn fraction(&self, value: f64) -> f64 {
        let at = match self.sign {
            Some(sign) => (sign * value).log10(),
            None if value.abs() < LARGEST => value,
            None => f64::NAN,
        };
        (at - self.start) / (self.end - self.start)
    }

    /// As many ticks as are readable on an axis of this length.
    pub fn ticks(&self, length: f64, direction: Direction) -> Vec<Tick> {
        let default = match self.ticks {
            Ticks::Round if self.sign.is_none() => LINEAR,
            _ => LOGARITHMIC,
        };
        let font = Font::embedded();
        let size = |tick: &Tick| match direction {
            Direction::Across => font.width(&tick.text, TICK_SIZE),
            Direction::Up => TICK_SIZE,
        };
        let separate = |pair: &[Tick]| {
            let distance = length * (pair[1].fraction - pair[0].fraction).abs();
            distance - 0.5 * (size(&pair[0]) + size(&pair[1])) > BETWEEN_LABELS
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
            (Ticks::At(values), _) => {
                let kept = values.iter().step_by(every(values.len()));
                kept.map(|&value| (value, fixed(value, 0))).collect()
            }
            (_, Some(sign)) => {
                let count = (high.floor() - low.ceil() + 1.0).max(0.0) as usize;
                self.decades(low..=high, sign, every(count) as i32, count < 2)
            }
            (Ticks::Round | Ticks::Times, None) => {
                let unit = 10f64.powi(self.power());
                let step = round_step((high - low) * spacing / unit);
                let found = multiples(low / unit, high / unit, step).into_iter();
                found.map(|(value, text)| (value * unit, text)).collect()
            }
        };
        let tick = |(value, text): (f64, String)| Tick {
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
    fn decades(
        &self,
        range: RangeInclusive<f64>,
        sign: f64,
        every: i32,
        few: bool,
    ) -> Vec<(f64, String)> {
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
                    Ticks::Times => time_of_decade(digit, power),
                    _ if few => digit_of_decade(sign * digit, power),
                    _ => decade(sign, power),
                };
                (sign * digit * 10f64.powi(power), text)
            })
            .collect()
    }

    /// Fractions at which long decades are subdivided: 2 to 9 times the power of ten.
    pub fn divisions(&self, length: f64) -> Vec<f64> {
        let (low, high) = (self.start.min(self.end), self.start.max(self.end));
        let divided = length > DIVIDED * (high - low) && !matches!(self.ticks, Ticks::At(_));
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

fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let both = values.map(|value| (value, value));
    both.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use Direction::{Across, Up};

    fn texts(axis: &Axis, length: f64) -> Vec<String> {
        let ticks = axis.ticks(length, Across).into_iter();
        ticks.map(|tick| tick.text).collect()
    }

    #[test]
    fn linear_axes_have_few_digits() {
        for (low, high, name) in [
            (0.0, 12.0, "t"),
            (0.0, 3e-5, "t · 10⁶"),
            (-2e7, 1e6, "t · 10⁻⁶"),
            (0.02, 0.5, "t"),
        ] {
            let axis = Axis::holding("t", [low, high].into_iter());
            assert_eq!(axis.title(), name);
            let ticks = axis.ticks(300.0, Up);
            assert!((3..=12).contains(&ticks.len()), "{low} {high}: {ticks:?}");
            for tick in ticks {
                assert!(tick.text.chars().count() <= 6, "{tick:?}");
                assert!((0.0..=1.0).contains(&tick.fraction), "{tick:?}");
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
            for axis in [
                Axis::holding("t", values.iter().copied()),
                Axis::logarithmic("t", values.iter().copied(), 1.0),
            ] {
                assert!(axis.end > axis.start, "{values:?}");
                assert!(!axis.ticks(300.0, Up).is_empty(), "{values:?}");
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
                Axis::holding("t", values.iter().copied()),
                Axis::linear("t", values[0], *values.last().unwrap()),
            ] {
                for tick in axis.ticks(300.0, Up) {
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
            ticks: Ticks::Times,
            ..axis
        };
        assert_eq!(texts(&axis, 400.0), ["10 ms", "100 ms"]);
        let axis = Axis::logarithmic("", [2.0, 5.0].into_iter(), 0.1);
        assert_eq!(texts(&axis, 400.0), ["2", "5"]);
        let sign = Some(-1.0);
        let axis = Axis { sign, ..axis };
        assert_eq!(texts(&axis, 400.0), ["\u{2212}2", "\u{2212}5"]);
        let axis = Axis {
            ticks: Ticks::At((1..=40).map(f64::from).collect()),
            ..Axis::linear("", 0.5, 40.5)
        };
        assert_eq!(texts(&axis, 200.0).len(), 5);
        assert_eq!(texts(&axis, 2000.0).len(), 40);
        let axis = Axis::linear("", 1000.001, 1000.009);
        for pair in axis.ticks(300.0, Across).windows(2) {
            let apart = 300.0 * (pair[1].fraction - pair[0].fraction);
            assert!(apart > 62.0, "{pair:?}");
        }
    }
}
