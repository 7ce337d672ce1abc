//! Formats numbers for people, together with [`leafdyn::numbers`]; nothing else does.

pub use leafdyn::numbers::{power_of_ten, superscript};
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::Units;
use leafdyn::scenario::units::{Dimension, LENGTH, PURE};
use leafdyn::study::Keys;

/// Digits shown after the first for a result without an error estimate.
const DIGITS: i32 = 9;

/// Part of a length up to which rounding leaves its digits.
pub const ROUNDING: f64 = 1e-14;

/// The number of veins, and whether their tips are joined.
pub fn veins(equilibrium: &Equilibrium) -> String {
    veins_of(equilibrium.shape.rods.len(), equilibrium.shape.joined)
}

/// The same for any leaf.
pub fn veins_of(count: usize, joined: bool) -> String {
    let tips = match joined {
        _ if count == 1 => "",
        true => " joined at the tip",
        false => " with free tips",
    };
    number_of_veins(count) + tips
}

/// As in `5 veins`.
pub fn number_of_veins(count: usize) -> String {
    counted(count, "vein", "veins")
}

/// A number of things, as `one` or `many` of them are called.
pub fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// The number of negative eigenvalues in brackets, if known.
pub fn eigenvalues(count: Option<usize>) -> String {
    let count = count.map(|it| counted(it, "negative eigenvalue", "negative eigenvalues"));
    count.map_or(String::new(), |count| format!(" ({count})"))
}

/// The grids of a relaxation.
pub fn grids(equilibrium: &Equilibrium) -> String {
    let grids = equilibrium.accuracy.segments.iter();
    let grids: Vec<String> = grids.map(usize::to_string).collect();
    match grids.as_slice() {
        [only] => format!("a grid of {only} segments a vein"),
        _ => format!("grids of {} segments a vein", grids.join(", ")),
    }
}

/// An upper bound; zero means up to rounding.
pub fn bound(bound: f64) -> String {
    match bound {
        0.0 => "rounding".into(),
        bound => power_of_ten(bound),
    }
}

/// A number with the unit of its dimension, if that has a name.
pub fn in_unit(number: String, units: &Units, dimension: Dimension) -> String {
    match units.of(dimension) {
        Some(unit) => format!("{number} {unit}"),
        None => number,
    }
}

/// A value of the scenario, or of numbers that vary together, with the unit of its key.
pub fn in_unit_of_key(number: String, units: &Units, key: &str) -> String {
    // An offset has the unit of its column.
    let keys: Result<Keys, _> = key.strip_prefix("offset:").unwrap_or(key).parse();
    in_unit(number, units, keys.map_or(PURE, |keys| keys.dimension()))
}

/// An upper bound on an error of positions.
pub fn bound_of_positions(error: f64, units: &Units) -> String {
    match error {
        0.0 => bound(error),
        error => in_unit(bound(error), units, LENGTH),
    }
}

/// A time in milliseconds or seconds.
pub fn seconds(time: f64) -> String {
    match time {
        time if (1e5 * time).round() < 1e5 => format!("{:.2} ms", 1e3 * time),
        time => format!("{time:.2} s"),
    }
}

/// The number of decimals that the error of a position leaves.
pub fn decimals(equilibrium: &Equilibrium) -> usize {
    let longest = equilibrium.shape.longest();
    let relative = 10f64.powi(-DIGITS) * longest;
    let error = equilibrium.accuracy.error_estimate.unwrap_or(relative);
    decimals_within(error.max(ROUNDING * longest))
}

/// The number of decimals that an error leaves.
pub fn decimals_within(error: f64) -> usize {
    (-last_place(error)).clamp(0, 15) as usize
}

/// The place of the last digit that an error leaves, as a power of ten.
fn last_place(error: f64) -> i32 {
    error.max(1e-16).log10().ceil() as i32
}

/// A number without the digits below its error: zero if it is no larger.
pub fn rounded_to(value: f64, error: f64) -> f64 {
    if !(error > 0.0 && error.is_finite()) {
        return value;
    }
    if value.abs() <= error {
        return 0.0;
    }
    let unit = 10f64.powi(last_place(error));
    (value / unit).round() * unit
}

/// A number with all digits that its error leaves, 16 at most.
pub fn known(value: f64, error: f64) -> String {
    let error = error.max(1e-16 * value.abs());
    if !value.is_finite() || !error.is_finite() {
        return brief(value);
    }
    let rounded = rounded_to(value, error);
    if rounded == 0.0 {
        return "0".into();
    }
    let (exponent, last) = (exponent_of(value, 0), last_place(error));
    match last > 0 || !(-5..16).contains(&exponent) {
        true => format!("{value:.*e}", (exponent - last).max(0) as usize),
        false => format!("{value:.*}", -last as usize),
    }
}

/// The energy of an equilibrium, or a component of a force of this size: as accurate as its
/// positions are for its length.
pub fn as_accurate(equilibrium: &Equilibrium, value: f64, size: f64) -> String {
    match equilibrium.accuracy.error_estimate {
        Some(error) if size != 0.0 => {
            let part = (error / equilibrium.shape.longest()).max(10f64.powi(-DIGITS - 1));
            let own = equilibrium.accuracy.energy_error.unwrap_or(0.0);
            known(value, (part * size.abs()).max(own))
        }
        _ => significant(value),
    }
}

/// A position with `decimals` decimals.
pub fn point(point: [f64; 3], decimals: usize) -> String {
    let least = 0.5 * 10f64.powi(-(decimals as i32));
    let [x, y, z] = point.map(|value| match value.abs() < least {
        true => "0".into(),
        false => format!("{value:.decimals$}"),
    });
    format!("({x}, {y}, {z})")
}

/// A number with ten significant digits.
pub fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let exponent = exponent_of(value, DIGITS as usize);
    if !(-4..DIGITS).contains(&exponent) {
        return format!("{value:.*e}", DIGITS as usize);
    }
    format!("{value:.*}", (DIGITS - exponent) as usize)
}

/// The digits of a finite number with `decimals` decimals after the first, and their power of ten:
/// rounding may raise it.
fn rounded(value: f64, decimals: usize) -> (String, i32) {
    let digits = format!("{value:.decimals$e}");
    let (mantissa, power) = digits.split_once('e').unwrap_or((&digits, "0"));
    (mantissa.into(), power.parse().unwrap_or(0))
}

/// The power of ten of a number rounded likewise.
fn exponent_of(value: f64, decimals: usize) -> i32 {
    rounded(value, decimals).1
}

/// A number with at most five digits.
pub fn brief(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        size if (-3..5).contains(&exponent_of(size, 4)) => {
            let decimals = (4 - exponent_of(size, 4)).max(0) as usize;
            without_trailing_zeros(&format!("{value:.decimals$}")).into()
        }
        _ => match format!("{value:.4e}").split_once('e') {
            Some((digits, power)) => format!("{}e{power}", without_trailing_zeros(digits)),
            None => value.to_string(),
        },
    }
}

/// A number with at most four digits, for figures.
pub fn short(value: f64) -> String {
    let minus = minus(value);
    let size = value.abs();
    if size.is_nan() || size.is_infinite() {
        return "∞".into();
    }
    if size < f64::MIN_POSITIVE {
        return "0".into();
    }
    let exponent = exponent_of(size, 3);
    if !(-3..6).contains(&exponent) {
        let (mantissa, exponent) = rounded(size, 2);
        return format!("{minus}{mantissa}×10{}", superscript(exponent));
    }
    let decimals = (3 - exponent).max(0) as usize;
    let digits = format!("{size:.decimals$}");
    format!("{minus}{}", without_trailing_zeros(&digits))
}

/// A number with `decimals` decimals, for axes.
pub fn fixed(value: f64, decimals: usize) -> String {
    format!("{}{:.decimals$}", minus(value), value.abs())
}

/// The minus sign (U+2212) of negative values.
fn minus(value: f64) -> &'static str {
    if value < 0.0 { "\u{2212}" } else { "" }
}

/// A power of ten of this sign, as in `10⁻³`.
pub fn decade(sign: f64, power: i32) -> String {
    format!("{}10{}", minus(sign), superscript(power))
}

/// A digit times a power of ten, as a plain number where that is short.
pub fn digit_of_decade(digit: f64, power: i32) -> String {
    let (minus, digit) = (minus(digit), digit.abs());
    match power {
        -3..=3 => format!("{minus}{}", digit * 10f64.powi(power)),
        _ => format!("{minus}{digit}×10{}", superscript(power)),
    }
}

/// A digit times a power of ten seconds, as in `20 ms`.
pub fn time_of_decade(digit: f64, power: i32) -> String {
    let (power, unit) = match power {
        ..=-1 => (power + 3, "ms"),
        _ => (power, "s"),
    };
    let decimals = (-power).max(0) as usize;
    format!("{:.decimals$} {unit}", digit * 10f64.powi(power))
}

fn without_trailing_zeros(digits: &str) -> &str {
    match digits.contains('.') {
        true => digits.trim_end_matches('0').trim_end_matches('.'),
        false => digits,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_ten_digits() {
        assert_eq!(significant(11.069189708218), "11.06918971");
        assert_eq!(significant(-0.00123), "-0.001230000000");
        assert_eq!(significant(1.5e-30), "1.500000000e-30");
        assert_eq!(significant(99.999999999999), "100.0000000");
        assert_eq!(significant(f64::NAN), "NaN");
    }

    #[test]
    fn brief_numbers_have_five() {
        assert_eq!(brief(0.6000000000000001), "0.6");
        assert_eq!(brief(-1234.567), "-1234.6");
        assert_eq!(brief(12.0), "12");
        assert_eq!(brief(99_999.96), "1e5");
        assert_eq!(brief(9.999996e-4), "0.001");
        assert_eq!(brief(3e-9 / 7.0), "4.2857e-10");
        assert_eq!(brief(3e-5), "3e-5");
        assert_eq!(brief(20000.0), "20000");
        assert_eq!(brief(f64::NAN), "NaN");
        assert_eq!(brief(0.0), "0");
    }

    #[test]
    fn no_digits_are_below_the_error() {
        assert_eq!(known(0.920146488027542, 2.8e-10), "0.920146488");
        assert_eq!(known(-0.920146488027542, 1.2e-3), "-0.92");
        assert_eq!(known(12345.678, 200.0), "1.2e4");
        assert_eq!(known(3.2e-9, 4e-9), "0");
        assert_eq!(known(3.26e-9, 1e-10), "3.3e-9");
        assert_eq!(known(9.96, 0.1), "10.0");
        assert_eq!(known(0.25, 0.0), "0.2500000000000000");
        assert_eq!(known(0.25, f64::INFINITY), "0.25");
        assert_eq!(brief(rounded_to(3.1575834, 2e-3)), "3.16");
        assert_eq!(rounded_to(1e-12, 1e-9), 0.0);
        assert_eq!([8.9e-9, 1e-8, 3.0].map(decimals_within), [8, 8, 0]);
    }

    #[test]
    fn points_have_no_negative_zero() {
        assert_eq!(point([1.0, -4e-4, -0.25], 3), "(1.000, 0, -0.250)");
    }

    #[test]
    fn times_are_readable() {
        assert_eq!(seconds(0.00123), "1.23 ms");
        assert_eq!(seconds(12.0), "12.00 s");
        assert_eq!(seconds(0.999_999), "1.00 s");
    }

    #[test]
    fn numbers_in_figures_have_few_digits() {
        assert_eq!(short(0.0), "0");
        assert_eq!(short(-0.123456), "\u{2212}0.1235");
        assert_eq!(short(1234.56), "1235");
        assert_eq!(short(0.7), "0.7");
        assert_eq!(short(120.0), "120");
        assert_eq!(short(2.5e-9), "2.50×10⁻⁹");
        // Numbers that are rounded up to the next power of ten.
        assert_eq!(short(9.999e-9), "1.00×10⁻⁸");
        assert_eq!(short(999_999.0), "1.00×10⁶");
        assert_eq!(short(9.99999e-4), "0.001");
        assert_eq!(short(9.996), "9.996");
        assert_eq!(short(9.9996), "10");
        assert_eq!(short(f64::NAN), "∞");
        assert_eq!(fixed(-0.25, 1), "\u{2212}0.2");
        assert_eq!(decade(-1.0, -3), "\u{2212}10⁻³");
        assert_eq!(digit_of_decade(-2.0, -1), "\u{2212}0.2");
        assert_eq!(digit_of_decade(5.0, 6), "5×10⁶");
        let times = [-5, -4, -3, -1, 0, 2].map(|power| time_of_decade(1.0, power));
        let wanted = ["0.01 ms", "0.1 ms", "1 ms", "100 ms", "1 s", "100 s"];
        assert_eq!(times, wanted);
    }
}
