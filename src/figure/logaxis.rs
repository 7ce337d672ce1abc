//! Logarithmic axes and their labels.

use crate::report::numbers::superscript;

/// Decades between points and the frame at least, and of an axis at least.
const AIR: f64 = 0.12;
const FEWEST_DECADES: f64 = 1.0;

/// Labels that an axis has at most.
const MOST_LABELS: i32 = 14;

/// The smallest value that is drawn: what is smaller is put there.
const SMALLEST: f64 = 1e-17;

/// One logarithmic axis: decades at both ends.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    low: f64,
    high: f64,
}

impl Axis {
    pub fn of(values: impl Iterator<Item = f64>) -> Self {
        let decades = values.filter(|value| value.is_finite() && *value >= 0.0);
        let decades = decades.map(|value| value.max(SMALLEST).log10());
        let (low, high) = decades.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
            (low.min(at), high.max(at))
        });
        if low > high {
            return Axis {
                low: 0.0,
                high: FEWEST_DECADES,
            };
        }
        let spare = (0.5 * (FEWEST_DECADES - (high - low))).max(AIR);
        Axis {
            low: low - spare,
            high: high + spare,
        }
    }

    /// From 0 at the low end to 1 at the high end.
    pub fn part(&self, value: f64) -> f64 {
        (value.max(SMALLEST).log10() - self.low) / (self.high - self.low)
    }

    pub fn decades(&self) -> impl Iterator<Item = i32> {
        self.low.ceil() as i32..=self.high.floor() as i32
    }

    /// Twice to nine times the decades.
    pub fn between(&self) -> Vec<f64> {
        let decades = self.low.floor() as i32..=self.high.floor() as i32;
        let values =
            decades.flat_map(|decade| (2..10).map(move |n| f64::from(n) * 10f64.powi(decade)));
        let inside = values.filter(|&value| (0.0..=1.0).contains(&self.part(value)));
        inside.collect()
    }
}

/// How an axis is labelled.
pub enum Labels {
    /// Decades of seconds.
    Times,
    /// Decades as powers of ten.
    Powers,
    /// These numbers.
    Numbers(Vec<usize>),
}

impl Labels {
    /// What is written where.
    pub fn of(&self, axis: &Axis) -> Vec<(f64, String)> {
        if let Labels::Numbers(numbers) = self {
            let numbers = numbers.iter();
            return numbers.map(|&n| (n as f64, n.to_string())).collect();
        }
        let count = axis.decades().count() as i32;
        let every = (count + MOST_LABELS - 1) / MOST_LABELS;
        let shown = axis
            .decades()
            .filter(|decade| decade.rem_euclid(every.max(1)) == 0);
        let labels = shown.map(|decade| {
            let text = match self {
                Labels::Times => time(decade),
                _ => format!("10{}", superscript(decade)),
            };
            (10f64.powi(decade), text)
        });
        labels.collect()
    }
}

/// A power of ten seconds.
fn time(decade: i32) -> String {
    let (decade, unit) = match decade {
        ..=-1 => (decade + 3, "ms"),
        _ => (decade, "s"),
    };
    let decimals = (-decade).max(0) as usize;
    format!("{:.decimals$} {unit}", 10f64.powi(decade))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_readable() {
        let times = [-5, -4, -3, -1, 0, 2].map(time);
        assert_eq!(
            times,
            ["0.01 ms", "0.1 ms", "1 ms", "100 ms", "1 s", "100 s"]
        );
    }

    #[test]
    fn axes_hold_their_values_with_some_air() {
        for values in [vec![1e-4, 3.0], vec![2.0, 2.1], vec![0.0, 1e-3], vec![7.0]] {
            let axis = Axis::of(values.iter().copied());
            for value in values {
                assert!(
                    (0.0..=1.0).contains(&axis.part(value)),
                    "{value} in {axis:?}"
                );
            }
            assert!(axis.high - axis.low >= FEWEST_DECADES);
        }
        let axis = Axis::of([f64::NAN, f64::INFINITY].into_iter());
        assert!(axis.high > axis.low);
    }
}
