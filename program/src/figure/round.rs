//! Round numbers, for ticks and scales.

use crate::report::numbers::fixed;

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
pub fn multiples(low: f64, high: f64, step: f64) -> Vec<(f64, String)> {
    let slack = 1e-9;
    let first = (low / step - slack).ceil() as i64;
    let last = (high / step + slack).floor() as i64;
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    (first..=last)
        .map(|multiple| multiple as f64 * step)
        .map(|value| (value, fixed(value, decimals)))
        .collect()
}

#[cfg(test)]
mod tests {
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
            let found = multiples(low, high, step).into_iter();
            found.map(|(_, text)| text).collect()
        };
        let even = ["\u{2212}0.4", "\u{2212}0.2", "0.0", "0.2", "0.4"];
        assert_eq!(texts(-0.4, 0.45, 0.2), even);
        assert_eq!(texts(-0.1, 0.1, 0.05).len(), 5);
        assert_eq!(texts(0.3, 19.0, 10.0), ["10"]);
        assert_eq!(texts(0.1, 0.2, 1.0), [""; 0]);
    }
}
