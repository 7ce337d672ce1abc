//! Sentences about a result that the figure and the command line share.

use crate::relax::{Equilibrium, Method, Outcome};
use crate::study::{Contender, TraceEnd, Verdict};

/// How the run ended and what was found, in one phrase.
pub fn verdict(equilibrium: &Equilibrium) -> String {
    match equilibrium.outcome {
        Outcome::Converged => at_rest(equilibrium),
        Outcome::ConvergedAfterSaddle => match &equilibrium.saddle {
            Some(saddle) => format!(
                "{}, after leaving a saddle of index {}",
                at_rest(equilibrium),
                saddle.negative_eigenvalues
            ),
            None => format!("{}, after leaving a saddle", at_rest(equilibrium)),
        },
        Outcome::Saddle => at_rest(equilibrium),
        Outcome::ToleranceNotReached => {
            format!("{}, tolerance not reached", at_rest(equilibrium))
        }
        Outcome::NotAtRest if equilibrium.method == Method::Shooting.name() => {
            "no equilibrium".into()
        }
        Outcome::NotAtRest => "not at rest".into(),
        Outcome::Singular => "singular equations".into(),
        Outcome::Diverged => "diverged".into(),
    }
}

fn at_rest(equilibrium: &Equilibrium) -> String {
    equilibrium_of_index(equilibrium.negative_eigenvalues)
}

/// What kind of equilibrium has so many negative eigenvalues.
pub fn equilibrium_of_index(negative_eigenvalues: Option<usize>) -> String {
    match negative_eigenvalues {
        Some(0) => "stable equilibrium".into(),
        Some(index) => format!("unstable equilibrium of index {index}"),
        None => "equilibrium of unknown stability".into(),
    }
}

/// What was solved, and what of it matters: in one phrase.
pub fn model(equilibrium: &Equilibrium) -> String {
    let (model, veins) = (&equilibrium.model, equilibrium.rods.len());
    let mut phrases = vec![match model.rods < veins {
        true => format!(
            "{} of {veins} veins, the others are their mirror images",
            model.rods
        ),
        false if veins == 1 => "1 vein".into(),
        false => format!("all {veins} veins"),
    }];
    if model.planar {
        phrases.push("planar".into());
    }
    if !equilibrium.segments.is_empty() {
        let grids: Vec<String> = equilibrium.segments.iter().map(usize::to_string).collect();
        phrases.push(format!("{} segments", grids.join("+")));
    }
    if model.rods < veins {
        phrases.push("stable against breaking the mirror".into());
    }
    if model.planar {
        phrases.push("stable out of the plane".into());
    }
    for (effect, what) in [(model.shear, "shear"), (model.stretch, "stretch")] {
        if let Some(effect) = effect {
            phrases.push(format!("{what} matters by {}", power_of_ten(effect)));
        }
    }
    phrases.join("; ")
}

/// The kind of shooting.
pub fn shooting(intervals: usize) -> String {
    match intervals {
        1 => "single shooting".into(),
        count => format!("multiple shooting over {count} intervals"),
    }
}

/// What a check says, in one phrase.
pub fn headline(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::Agree => "both methods agree",
        Verdict::Differ => "the methods differ",
        Verdict::NotCompared(_) => "could not be compared",
    }
}

/// A way to bring a leaf to rest, as a chart names it.
pub fn contender(contender: Contender) -> &'static str {
    match contender {
        Contender::SemiImplicit => "semi-implicit, extrapolated",
        Contender::SemiImplicitGrid => "semi-implicit, single grids",
        Contender::Explicit => "explicit, extrapolated",
        Contender::ExplicitGrid => "explicit, single grids",
        Contender::SingleShooting => "single shooting",
        Contender::MultipleShooting => "multiple shooting",
        Contender::RelaxedShooting => "shooting from the relaxed leaf",
    }
}

/// How a branch ended, in a phrase.
pub fn branch_end(end: TraceEnd) -> &'static str {
    match end {
        TraceEnd::Reached => "to the end of the range",
        TraceEnd::Returned => "back to its start",
        TraceEnd::Closed => "closed",
        TraceEnd::MostPoints => "goes on",
        TraceEnd::OutOfRange => "ends where no leaf is",
        TraceEnd::Unresolved => "ends: grid too coarse",
        TraceEnd::Stuck => "lost",
    }
}

/// An upper bound for reading: two digits, rounded up so that it stays a
/// bound, as in `3.1×10⁻⁹`.
pub fn power_of_ten(bound: f64) -> String {
    if bound.is_nan() || bound.is_infinite() {
        return "∞".into();
    }
    if bound < f64::MIN_POSITIVE {
        return "0".into();
    }
    let mut exponent = bound.log10().floor() as i32;
    // A hair less, so that 3.0 stored as 3.0000000000000004 is not 3.1.
    let mut tenths = (bound / 10f64.powi(exponent) * 10.0 * (1.0 - 1e-12)).ceil();
    if tenths >= 100.0 {
        tenths /= 10.0;
        exponent += 1;
    }
    let mantissa = tenths / 10.0;
    format!("{mantissa:.1}×10{}", superscript(exponent))
}

/// A power, as in `⁻⁹`.
pub fn superscript(exponent: i32) -> String {
    let raised = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit as u32 - '0' as u32).unwrap_or(digit),
    };
    exponent.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_rounded_up() {
        assert_eq!(power_of_ten(3.01e-9), "3.1×10⁻⁹");
        assert_eq!(power_of_ten(9.99e-12), "1.0×10⁻¹¹");
        assert_eq!(power_of_ten(2.0), "2.0×10⁰");
        assert_eq!(power_of_ten(3e-9), "3.0×10⁻⁹");
        assert_eq!(power_of_ten(f64::INFINITY), "∞");
        assert_eq!(power_of_ten(0.0), "0");
    }

    #[test]
    fn the_number_of_intervals_is_told_where_there_are_several() {
        assert_eq!(shooting(1), "single shooting");
        assert_eq!(shooting(12), "multiple shooting over 12 intervals");
    }
}
