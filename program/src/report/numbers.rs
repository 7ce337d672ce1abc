//! Formats numbers for people, together with [`leafdyn::numbers`]; nothing else does.

use glam::DVec3;
use leafdyn::numbers::largest;
pub use leafdyn::numbers::{format_error_bound, superscript};
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::Units;
use leafdyn::scenario::units::{DIMENSIONLESS, Dimension, LENGTH};
use leafdyn::study::ParameterKeys;

/// Digits shown after the first for a result without an error estimate.
const DIGITS_WITHOUT_ERROR: i32 = 9;

/// Part of a length up to which rounding leaves its digits.
pub const ROUNDING_OF_LENGTHS: f64 = 1e-14;

/// The number of veins, and whether their tips are joined.
pub fn veins_text(equilibrium: &Equilibrium) -> String {
    veins_text_for_count(equilibrium.shape.rods.len(), equilibrium.shape.joined)
}

/// How many veins there are, and whether their tips are joined.
pub fn veins_text_for_count(count: usize, joined: bool) -> String {
    let tips = match joined {
        _ if count == 1 => "",
        true => " joined at the tip",
        false => " with free tips",
    };
    vein_count_text(count) + tips
}

/// As in `5 veins`.
pub fn vein_count_text(count: usize) -> String {
    count_in_words(count, "vein", "veins")
}

/// A number of things, as `one` or `many` of them are called.
pub fn count_in_words(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// The number of negative eigenvalues in brackets, if known.
pub fn negative_eigenvalues_text(count: Option<usize>) -> String {
    let count = count.map(|it| count_in_words(it, "negative eigenvalue", "negative eigenvalues"));
    count.map_or(String::new(), |count| format!(" ({count})"))
}

/// The grids of a relaxation, as in `grids of 8, 16 segments a vein`.
pub fn grids_text(equilibrium: &Equilibrium) -> String {
    let grids = equilibrium.accuracy.segments.iter();
    let grids: Vec<String> = grids.map(usize::to_string).collect();
    match grids.as_slice() {
        [only] => format!("a grid of {only} segments a vein"),
        _ => format!("grids of {} segments a vein", grids.join(", ")),
    }
}

/// An upper bound; zero means up to rounding.
pub fn upper_bound_text(bound: f64) -> String {
    match bound {
        0.0 => "rounding".into(),
        bound => format_error_bound(bound),
    }
}

/// A number with the unit of its dimension, if that has a name.
pub fn number_in_unit(number: String, units: &Units, dimension: Dimension) -> String {
    match units.unit_name(dimension) {
        Some(unit) => format!("{number} {unit}"),
        None => number,
    }
}

/// A value of the scenario, or of numbers that vary together, with the unit of its key.
pub fn number_in_key_unit(number: String, units: &Units, key: &str) -> String {
    // An offset has the unit of its column.
    let keys: Result<ParameterKeys, _> = key.strip_prefix("offset:").unwrap_or(key).parse();
    number_in_unit(
        number,
        units,
        keys.map_or(DIMENSIONLESS, |keys| keys.dimension()),
    )
}

/// An upper bound on an error of positions.
pub fn position_error_text(error: f64, units: &Units) -> String {
    match error {
        0.0 => upper_bound_text(error),
        error => number_in_unit(upper_bound_text(error), units, LENGTH),
    }
}

/// A time in milliseconds or seconds.
pub fn duration_text(time: f64) -> String {
    match time {
        time if (1e5 * time).round() < 1e5 => format!("{:.2} ms", 1e3 * time),
        time => format!("{time:.2} s"),
    }
}

/// The number of decimals that the error of a position leaves.
pub fn position_decimals(equilibrium: &Equilibrium) -> usize {
    let longest = equilibrium.shape.longest();
    let relative = 10f64.powi(-DIGITS_WITHOUT_ERROR) * longest;
    let error = equilibrium.accuracy.error_estimate.unwrap_or(relative);
    decimals_for_error(error.max(ROUNDING_OF_LENGTHS * longest))
}

/// The number of decimals that an error leaves.
pub fn decimals_for_error(error: f64) -> usize {
    (-last_significant_place(error)).clamp(0, 15) as usize
}

/// The place of the last digit that an error leaves, as a power of ten.
fn last_significant_place(error: f64) -> i32 {
    error.max(1e-16).log10().ceil() as i32
}

/// The place of the last digit of a number that its error leaves; the first digit of one that is larger than its error.
fn last_place_of(value: f64, error: f64) -> i32 {
    let place = last_significant_place(error);
    let is_lost = value.abs() > error && (value / 10f64.powi(place)).round() == 0.0;
    place - i32::from(is_lost)
}

/// A number without the digits below its error: zero if it is no larger.
pub fn round_to_error(value: f64, error: f64) -> f64 {
    if !(error > 0.0 && error.is_finite()) {
        return value;
    }
    if value.abs() <= error {
        return 0.0;
    }
    let unit = 10f64.powi(last_place_of(value, error));
    (value / unit).round() * unit
}

/// A number with all digits that its error leaves, 16 at most.
pub fn format_within_error(value: f64, error: f64) -> String {
    let error = error.max(1e-16 * value.abs());
    if !value.is_finite() || !error.is_finite() {
        return format_five_digits(value);
    }
    let rounded = round_to_error(value, error);
    if rounded == 0.0 {
        return "0".into();
    }
    let (exponent, last) = (rounded_exponent(value, 0), last_place_of(value, error));
    match last > 0 || !(-5..16).contains(&exponent) {
        true => format!("{value:.*e}", (exponent - last).max(0) as usize),
        false => format!("{value:.*}", -last as usize),
    }
}

/// The energy of an equilibrium, or a component of a force of this size: as accurate as its
/// positions are for its length.
pub fn format_as_accurate(equilibrium: &Equilibrium, value: f64, size: f64) -> String {
    match equilibrium.accuracy.error_estimate {
        Some(error) if size != 0.0 => {
            let part =
                (error / equilibrium.shape.longest()).max(10f64.powi(-DIGITS_WITHOUT_ERROR - 1));
            let own = equilibrium.accuracy.energy_error.unwrap_or(0.0);
            format_within_error(value, (part * size.abs()).max(own))
        }
        _ => format_ten_digits(value),
    }
}

pub fn format_position(point: [f64; 3], decimals: usize) -> String {
    let least = 0.5 * 10f64.powi(-(decimals as i32));
    let [x, y, z] = point.map(|value| match value.abs() < least {
        true => "0".into(),
        false => format!("{value:.decimals$}"),
    });
    format!("({x}, {y}, {z})")
}

/// Where the tip is, to so many decimals; of free tips their mean and how far the farthest is from it.
pub fn tips_text(tips: &[DVec3], decimals: usize, units: &Units) -> Option<String> {
    let place =
        |tip: DVec3| number_in_unit(format_position(tip.to_array(), decimals), units, LENGTH);
    if let [tip] = tips {
        return Some(place(*tip));
    }
    let mean = tips.iter().sum::<DVec3>() / tips.len().max(1) as f64;
    let farthest = largest(tips.iter().map(|tip| tip.distance(mean)));
    let farthest = round_to_error(farthest, 10f64.powi(-(decimals as i32)));
    let farthest = number_in_unit(format_five_digits(farthest), units, LENGTH);
    (!tips.is_empty()).then(|| {
        let count = tips.len();
        format!(
            "{} on average of {count}, up to {farthest} from there",
            place(mean)
        )
    })
}

/// A number with ten significant digits.
pub fn format_ten_digits(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let exponent = rounded_exponent(value, DIGITS_WITHOUT_ERROR as usize);
    if !(-4..DIGITS_WITHOUT_ERROR).contains(&exponent) {
        return format!("{value:.*e}", DIGITS_WITHOUT_ERROR as usize);
    }
    format!("{value:.*}", (DIGITS_WITHOUT_ERROR - exponent) as usize)
}

/// A number in scientific notation.
struct ScientificNumber {
    mantissa: String,
    exponent: i32,
}

/// A finite number with `decimals` decimals after the first digit; rounding may raise the power of ten.
fn round_scientific(value: f64, decimals: usize) -> ScientificNumber {
    let digits = format!("{value:.decimals$e}");
    let (mantissa, power) = digits.split_once('e').unwrap_or((&digits, "0"));
    ScientificNumber {
        mantissa: mantissa.into(),
        exponent: power.parse().unwrap_or(0),
    }
}

/// The power of ten of a number rounded likewise.
fn rounded_exponent(value: f64, decimals: usize) -> i32 {
    round_scientific(value, decimals).exponent
}

/// A number with at most five digits.
pub fn format_five_digits(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        size if (-3..5).contains(&rounded_exponent(size, 4)) => {
            let decimals = (4 - rounded_exponent(size, 4)).max(0) as usize;
            without_trailing_zeros(&format!("{value:.decimals$}")).into()
        }
        _ => match format!("{value:.4e}").split_once('e') {
            Some((digits, power)) => format!("{}e{power}", without_trailing_zeros(digits)),
            None => value.to_string(),
        },
    }
}

/// A number with at most four digits, for figures.
pub fn format_four_digits(value: f64) -> String {
    let minus = minus_sign(value);
    let size = value.abs();
    if size.is_nan() || size.is_infinite() {
        return "∞".into();
    }
    if size < f64::MIN_POSITIVE {
        return "0".into();
    }
    let exponent = rounded_exponent(size, 3);
    if !(-3..6).contains(&exponent) {
        let ScientificNumber { mantissa, exponent } = round_scientific(size, 2);
        return format!("{minus}{mantissa}×10{}", superscript(exponent));
    }
    let decimals = (3 - exponent).max(0) as usize;
    let digits = format!("{size:.decimals$}");
    format!("{minus}{}", without_trailing_zeros(&digits))
}

/// A number with `decimals` decimals, for axes.
pub fn format_decimals(value: f64, decimals: usize) -> String {
    format!("{}{:.decimals$}", minus_sign(value), value.abs())
}

/// The minus sign (U+2212) of negative values.
fn minus_sign(value: f64) -> &'static str {
    if value < 0.0 { "\u{2212}" } else { "" }
}

/// A power of ten of this sign, as in `10⁻³`.
pub fn power_of_ten_text(sign: f64, power: i32) -> String {
    format!("{}10{}", minus_sign(sign), superscript(power))
}

/// A digit times a power of ten, as a plain number where that is short.
pub fn digit_times_power_text(digit: f64, power: i32) -> String {
    let (minus, digit) = (minus_sign(digit), digit.abs());
    match power {
        -3..=3 => format!("{minus}{}", digit * 10f64.powi(power)),
        _ => format!("{minus}{digit}×10{}", superscript(power)),
    }
}

/// A digit times a power of ten seconds, as in `20 ms`.
pub fn time_power_text(digit: f64, power: i32) -> String {
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
        assert_eq!(format_ten_digits(11.069189708218), "11.06918971");
        assert_eq!(format_ten_digits(-0.00123), "-0.001230000000");
        assert_eq!(format_ten_digits(1.5e-30), "1.500000000e-30");
        assert_eq!(format_ten_digits(99.999999999999), "100.0000000");
        assert_eq!(format_ten_digits(f64::NAN), "NaN");
    }

    #[test]
    fn brief_numbers_have_five() {
        assert_eq!(format_five_digits(0.6000000000000001), "0.6");
        assert_eq!(format_five_digits(-1234.567), "-1234.6");
        assert_eq!(format_five_digits(12.0), "12");
        assert_eq!(format_five_digits(99_999.96), "1e5");
        assert_eq!(format_five_digits(9.999996e-4), "0.001");
        assert_eq!(format_five_digits(3e-9 / 7.0), "4.2857e-10");
        assert_eq!(format_five_digits(3e-5), "3e-5");
        assert_eq!(format_five_digits(20000.0), "20000");
        assert_eq!(format_five_digits(f64::NAN), "NaN");
        assert_eq!(format_five_digits(0.0), "0");
    }

    #[test]
    fn no_digits_are_below_the_error() {
        assert_eq!(
            format_within_error(0.920146488027542, 2.8e-10),
            "0.920146488"
        );
        assert_eq!(format_within_error(-0.920146488027542, 1.2e-3), "-0.92");
        assert_eq!(format_within_error(12345.678, 200.0), "1.2e4");
        assert_eq!(format_within_error(3.2e-9, 4e-9), "0");
        assert_eq!(format_within_error(3.26e-9, 1e-10), "3.3e-9");
        assert_eq!(format_within_error(9.96, 0.1), "10.0");
        assert_eq!(format_within_error(0.25, 0.0), "0.2500000000000000");
        assert_eq!(format_within_error(0.25, f64::INFINITY), "0.25");
        assert_eq!(format_five_digits(round_to_error(3.1575834, 2e-3)), "3.16");
        // What is larger than its error keeps its first digit.
        assert_eq!(round_to_error(429.0, 121.0), 400.0);
        assert_eq!(format_within_error(429.0, 121.0), "4e2");
        assert_eq!(format_within_error(-0.429, 0.121), "-0.4");
        assert_eq!(round_to_error(119.0, 121.0), 0.0);
        assert_eq!(round_to_error(1e-12, 1e-9), 0.0);
        assert_eq!([8.9e-9, 1e-8, 3.0].map(decimals_for_error), [8, 8, 0]);
    }

    /// Free tips have a mean, and the farthest from it, without digits below the error.
    #[test]
    fn free_tips_are_told_by_their_mean() {
        let at = |x: f64, z: f64| DVec3::new(x, 0.0, z);
        let tips = [at(1.0, 0.25), at(1.0, -0.05), at(1.0, 0.1)];
        let units = Units {
            length: Some("cm".into()),
            ..Units::default()
        };
        let text = tips_text(&tips, 3, &units).unwrap();
        assert_eq!(
            text,
            "(1.000, 0, 0.100) cm on average of 3, up to 0.15 cm from there"
        );
        assert_eq!(
            tips_text(&tips[..1], 2, &units).unwrap(),
            "(1.00, 0, 0.25) cm"
        );
        assert_eq!(tips_text(&[], 2, &units), None);
        let alike = tips_text(&[tips[0], tips[0] + 1e-9], 3, &units).unwrap();
        assert!(alike.ends_with("up to 0 cm from there"), "{alike}");
    }

    #[test]
    fn points_have_no_negative_zero() {
        assert_eq!(
            format_position([1.0, -4e-4, -0.25], 3),
            "(1.000, 0, -0.250)"
        );
    }

    #[test]
    fn times_are_readable() {
        assert_eq!(duration_text(0.00123), "1.23 ms");
        assert_eq!(duration_text(12.0), "12.00 s");
        assert_eq!(duration_text(0.999_999), "1.00 s");
    }

    #[test]
    fn numbers_in_figures_have_few_digits() {
        assert_eq!(format_four_digits(0.0), "0");
        assert_eq!(format_four_digits(-0.123456), "\u{2212}0.1235");
        assert_eq!(format_four_digits(1234.56), "1235");
        assert_eq!(format_four_digits(0.7), "0.7");
        assert_eq!(format_four_digits(120.0), "120");
        assert_eq!(format_four_digits(2.5e-9), "2.50×10⁻⁹");
        // Numbers that are rounded up to the next power of ten.
        assert_eq!(format_four_digits(9.999e-9), "1.00×10⁻⁸");
        assert_eq!(format_four_digits(999_999.0), "1.00×10⁶");
        assert_eq!(format_four_digits(9.99999e-4), "0.001");
        assert_eq!(format_four_digits(9.996), "9.996");
        assert_eq!(format_four_digits(9.9996), "10");
        assert_eq!(format_four_digits(f64::NAN), "∞");
        assert_eq!(format_decimals(-0.25, 1), "\u{2212}0.2");
        assert_eq!(power_of_ten_text(-1.0, -3), "\u{2212}10⁻³");
        assert_eq!(digit_times_power_text(-2.0, -1), "\u{2212}0.2");
        assert_eq!(digit_times_power_text(5.0, 6), "5×10⁶");
        let times = [-5, -4, -3, -1, 0, 2].map(|power| time_power_text(1.0, power));
        let wanted = ["0.01 ms", "0.1 ms", "1 ms", "100 ms", "1 s", "100 s"];
        assert_eq!(times, wanted);
    }
}
