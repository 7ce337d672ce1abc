//! The only place that writes numbers for people to read, with [`crate::numbers`].

pub use crate::numbers::{power_of_ten, superscript};
use crate::relax::Equilibrium;

/// Digits after the first that a result without an error estimate shows.
const DIGITS: i32 = 9;

/// How many veins, and how their tips are.
pub fn veins(equilibrium: &Equilibrium) -> String {
    veins_of(equilibrium.shape.rods.len(), equilibrium.shape.joined)
}

/// The same, of any leaf.
pub fn veins_of(count: usize, joined: bool) -> String {
    match count {
        1 => "1 vein".to_string(),
        count if joined => format!("{count} veins joined at the tip"),
        count => format!("{count} veins with free tips"),
    }
}

/// A count in brackets, where there is one.
pub fn eigenvalues(count: Option<usize>) -> String {
    match count {
        Some(1) => " (1 negative eigenvalue)".into(),
        Some(count) => format!(" ({count} negative eigenvalues)"),
        None => String::new(),
    }
}

/// The grids of a relaxation.
pub fn grids(equilibrium: &Equilibrium) -> String {
    let grids: Vec<String> = equilibrium
        .accuracy
        .segments
        .iter()
        .map(usize::to_string)
        .collect();
    format!("grids of {} segments a vein", grids.join(", "))
}

/// An upper bound; zero is as good as the digits are.
pub fn bound(bound: f64) -> String {
    match bound {
        0.0 => "rounding".into(),
        bound => power_of_ten(bound),
    }
}

/// A time in milliseconds or seconds.
pub fn seconds(time: f64) -> String {
    match time {
        time if time < 1.0 => format!("{:.2} ms", 1e3 * time),
        time => format!("{time:.2} s"),
    }
}

/// Length of the longest rod.
pub fn longest_rod(equilibrium: &Equilibrium) -> f64 {
    equilibrium
        .shape
        .rods
        .iter()
        .map(|rod| rod.length)
        .fold(0.0, f64::max)
}

/// As many decimals of a position as the error leaves, and one more.
pub fn decimals(equilibrium: &Equilibrium) -> usize {
    let relative = 10f64.powi(-DIGITS) * longest_rod(equilibrium);
    let error = equilibrium
        .accuracy
        .error_estimate
        .unwrap_or(relative)
        .max(1e-16);
    (1.0 - error.log10().ceil()).clamp(0.0, 15.0) as usize
}

/// A position with so many decimals.
pub fn point(point: [f64; 3], decimals: usize) -> String {
    let unit = 0.5 * 10f64.powi(-(decimals as i32));
    // What would be written as -0.000 is zero.
    let tidy = |value: f64| if value.abs() < unit { 0.0 } else { value };
    let [x, y, z] = point.map(|value| format!("{:.decimals$}", tidy(value)));
    format!("({x}, {y}, {z})")
}

/// Ten significant digits.
pub fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..DIGITS).contains(&exponent) {
        return format!("{value:.*e}", DIGITS as usize);
    }
    format!("{value:.*}", (DIGITS - exponent) as usize)
}

/// Five digits at most.
pub fn brief(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        size if (1e-3..1e5).contains(&size) => {
            let decimals = (4 - size.log10().floor() as i32).max(0) as usize;
            without_idle_zeros(&format!("{value:.decimals$}")).into()
        }
        _ => match format!("{value:.4e}").split_once('e') {
            Some((digits, power)) => format!("{}e{power}", without_idle_zeros(digits)),
            None => value.to_string(),
        },
    }
}

fn without_idle_zeros(digits: &str) -> &str {
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
        assert_eq!(significant(f64::NAN), "NaN");
    }

    #[test]
    fn brief_numbers_have_five() {
        assert_eq!(brief(0.6000000000000001), "0.6");
        assert_eq!(brief(-1234.567), "-1234.6");
        assert_eq!(brief(12.0), "12");
        assert_eq!(brief(3e-9 / 7.0), "4.2857e-10");
        assert_eq!(brief(3e-5), "3e-5");
        assert_eq!(brief(20000.0), "20000");
        assert_eq!(brief(f64::NAN), "NaN");
        assert_eq!(brief(0.0), "0");
    }

    #[test]
    fn points_have_no_negative_zero() {
        assert_eq!(point([1.0, -4e-4, -0.25], 3), "(1.000, 0.000, -0.250)");
    }

    #[test]
    fn times_are_readable() {
        assert_eq!(seconds(0.00123), "1.23 ms");
        assert_eq!(seconds(12.0), "12.00 s");
    }
}
