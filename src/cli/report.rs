//! The summary that people read.

use std::fmt::Write;
use std::path::Path;

use leafdyn::output::{FORMATS, power_of_ten, verdict};
use leafdyn::relax::{Equilibrium, Outcome};

/// Digits after the first that a result without an error estimate shows.
const DIGITS: i32 = 9;

/// What was solved, what was found, how well, and where the files are.
pub fn report(equilibrium: &Equilibrium, folder: Option<&Path>) -> String {
    let mut lines = vec![("", solved(equilibrium)), ("found", found(equilibrium))];
    if let Some(saddle) = &equilibrium.saddle {
        lines.push((
            "left",
            format!(
                "a saddle of index {} with energy {} and tip {}",
                saddle.negative_eigenvalues,
                significant(saddle.energy),
                point(saddle.tip.to_array(), decimals(equilibrium)),
            ),
        ));
    }
    if let [tip] = equilibrium.tips.as_slice() {
        lines.push(("tip", point(tip.to_array(), decimals(equilibrium))));
    }
    lines.push(("energy", significant(equilibrium.energy)));
    lines.push(("error", error(equilibrium)));
    lines.push(("work", work(equilibrium)));
    if let Some(folder) = folder {
        let names: Vec<&str> = FORMATS.iter().map(|format| format.file_name()).collect();
        lines.push((
            "written",
            format!("{}: {}", folder.display(), names.join(", ")),
        ));
    }
    if let Some(remark) = &equilibrium.remark {
        lines.push(("remark", remark.clone()));
    }

    let mut text = String::new();
    for (name, line) in lines {
        // Writing to a string cannot fail.
        let _ = match name {
            "" => writeln!(text, "{line}"),
            name => writeln!(text, "  {name:<9}{line}"),
        };
    }
    text
}

fn solved(equilibrium: &Equilibrium) -> String {
    let veins = match equilibrium.rods.len() {
        1 => "1 vein".to_string(),
        count if equilibrium.joined => format!("{count} veins joined at the tip"),
        count => format!("{count} veins with free tips"),
    };
    format!(
        "{}: {veins}, method {}",
        equilibrium.scenario, equilibrium.method
    )
}

fn found(equilibrium: &Equilibrium) -> String {
    let verdict = verdict(equilibrium);
    match (equilibrium.outcome, equilibrium.negative_eigenvalues) {
        (Outcome::NotAtRest | Outcome::Diverged | Outcome::Singular, _) => {
            format!("{verdict} (residual {:.1e})", equilibrium.residual)
        }
        (_, Some(1)) => format!("{verdict} (1 negative eigenvalue)"),
        (_, Some(count)) => format!("{verdict} ({count} negative eigenvalues)"),
        (_, None) => verdict,
    }
}

fn error(equilibrium: &Equilibrium) -> String {
    let source = match equilibrium.intervals {
        Some(1) => "by shooting over 1 interval".to_string(),
        Some(count) => format!("by shooting over {count} intervals"),
        None => {
            let grids: Vec<String> = equilibrium.segments.iter().map(usize::to_string).collect();
            format!("from grids of {} segments a vein", grids.join(", "))
        }
    };
    let longest = longest_rod(equilibrium);
    let wanted = power_of_ten(equilibrium.tolerance * longest);
    match equilibrium.error_estimate {
        Some(error) => format!(
            "positions within {} (wanted {wanted}), {source}",
            power_of_ten(error)
        ),
        None => match equilibrium.segments.as_slice() {
            [segments] => format!("not estimated on a single grid of {segments} segments a vein"),
            _ => "not known".into(),
        },
    }
}

fn work(equilibrium: &Equilibrium) -> String {
    let work = equilibrium.work;
    format!(
        "{} steps, {} factorisations, {} force evaluations in {}",
        work.steps,
        work.factorizations,
        work.force_evaluations,
        seconds(equilibrium.wall_seconds)
    )
}

fn seconds(time: f64) -> String {
    match time {
        time if time < 1.0 => format!("{:.2} ms", 1e3 * time),
        time => format!("{time:.2} s"),
    }
}

fn longest_rod(equilibrium: &Equilibrium) -> f64 {
    equilibrium
        .rods
        .iter()
        .map(|rod| rod.length)
        .fold(0.0, f64::max)
}

/// As many decimals of a position as the error leaves, and one more.
fn decimals(equilibrium: &Equilibrium) -> usize {
    let relative = 10f64.powi(-DIGITS) * longest_rod(equilibrium);
    let error = equilibrium.error_estimate.unwrap_or(relative).max(1e-16);
    (1.0 - error.log10().ceil()).clamp(0.0, 15.0) as usize
}

fn point(point: [f64; 3], decimals: usize) -> String {
    let unit = 0.5 * 10f64.powi(-(decimals as i32));
    // What would be written as -0.000 is zero.
    let tidy = |value: f64| if value.abs() < unit { 0.0 } else { value };
    let [x, y, z] = point.map(|value| format!("{:.decimals$}", tidy(value)));
    format!("({x}, {y}, {z})")
}

fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..DIGITS).contains(&exponent) {
        return format!("{value:.*e}", DIGITS as usize);
    }
    format!("{value:.*}", (DIGITS - exponent) as usize)
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
    fn points_have_no_negative_zero() {
        assert_eq!(point([1.0, -4e-4, -0.25], 3), "(1.000, 0.000, -0.250)");
    }

    #[test]
    fn times_are_readable() {
        assert_eq!(seconds(0.00123), "1.23 ms");
        assert_eq!(seconds(12.0), "12.00 s");
    }
}
