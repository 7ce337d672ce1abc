//! The summary of a check that people read.

use std::path::Path;

use crate::bvp::Solution;
use crate::report::numbers::power_of_ten;
use crate::report::words::{equilibrium_of_index, headline, shooting};
use crate::study::{Check, Place, Quantity, Verdict};

use super::numbers::{bound, decimals, eigenvalues, grids, point, seconds, significant, veins};
use super::relax::found;
use super::table::{lay_out, written};

/// The verdict, what both methods found, and how far they are apart.
pub fn report(check: &Check, folder: Option<&Path>) -> String {
    let mut lines = vec![("verdict", judgement(check))];
    lines.extend(both(check));
    lines.extend(differences(check));
    lines.extend(errors(check));
    if let Some(solution) = check.solution() {
        lines.extend(shooting_itself(solution));
    }
    // Why the leaf is not at rest is in the verdict.
    if let (Some(remark), true) = (&check.relaxed.remark, check.shot.is_some()) {
        lines.push(("remark", remark.clone()));
    }
    if let Some(folder) = folder {
        lines.push(("written", written(check, folder)));
    }
    let relaxed = &check.relaxed;
    let heading = format!(
        "{}: {}, relaxed and by shooting",
        relaxed.scenario,
        veins(relaxed)
    );
    lay_out(&heading, &lines)
}

fn judgement(check: &Check) -> String {
    let allowed = format!(
        "positions within {}, rotations within {} rad",
        power_of_ten(check.allowed()),
        power_of_ten(check.allowed_rotation())
    );
    let headline = headline(&check.verdict);
    match &check.verdict {
        Verdict::Agree => format!("{headline}: {allowed}"),
        Verdict::Differ => format!("{headline}: to agree, {allowed}"),
        Verdict::NotCompared(reason) => format!("{headline}: {reason}"),
    }
}

/// What each method found, and when.
fn both(check: &Check) -> Vec<(&'static str, String)> {
    let relaxed = &check.relaxed;
    let mut lines = vec![(
        "relaxed",
        format!("{} in {}", found(relaxed), seconds(relaxed.wall_seconds)),
    )];
    lines.push((
        "shooting",
        match &check.shot {
            Some(shot) => {
                let found = match shot.found {
                    Ok(_) => format!(
                        "{}{}",
                        equilibrium_of_index(shot.negative_eigenvalues),
                        eigenvalues(shot.negative_eigenvalues)
                    ),
                    Err(_) => "no solution".into(),
                };
                format!("{found} in {}", seconds(shot.wall_seconds))
            }
            None => "not tried".into(),
        },
    ));
    if let [tip] = relaxed.tips.as_slice() {
        let tip = point(tip.to_array(), decimals(relaxed));
        lines.push(("tip", format!("{tip} relaxed")));
        if let Some([tip]) = check.shot.as_ref().map(|shot| shot.tips.as_slice()) {
            let tip = point(tip.to_array(), decimals(relaxed));
            lines.push(("", format!("{tip} by shooting")));
        }
    }
    let relaxed = significant(relaxed.energy.unwrap_or(f64::NAN));
    lines.push((
        "energy",
        match check.solution() {
            Some(solution) => format!(
                "{relaxed} relaxed, {} by shooting",
                significant(solution.energy)
            ),
            None => format!("{relaxed} relaxed"),
        },
    ));
    lines
}

/// The largest differences, and where they are.
fn differences(check: &Check) -> Vec<(&'static str, String)> {
    let Some(difference) = &check.difference else {
        return Vec::new();
    };
    let mut lines: Vec<(&str, String)> = Quantity::ALL
        .into_iter()
        .map(|quantity| {
            let found = quantity.of(difference);
            let unit = match quantity {
                Quantity::Rotation => " rad",
                _ => "",
            };
            let word = quantity.word();
            let line = match check.farthest(quantity) {
                Some(place) if found > 0.0 => format!(
                    "{word}s by {}{unit} at most, {}",
                    power_of_ten(found),
                    whereabouts(place, check.relaxed.shape.rods.len())
                ),
                _ => format!("{word}s not at all"),
            };
            ("", line)
        })
        .collect();
    lines[0].0 = "differ";
    lines
}

fn whereabouts(place: Place, rods: usize) -> String {
    let Place { rod, sigma } = place;
    match rods {
        1 => format!("at {sigma:.3} of the length"),
        _ => format!("in vein {} at {sigma:.3} of its length", rod + 1),
    }
}

/// What both methods say about their own errors.
fn errors(check: &Check) -> Vec<(&'static str, String)> {
    let relaxed = &check.relaxed;
    let mut lines = vec![(
        "error",
        match relaxed.accuracy.error_estimate {
            Some(error) => format!(
                "relaxed: positions within {}, from {}",
                bound(error),
                grids(relaxed)
            ),
            None => "relaxed: not known".into(),
        },
    )];
    if let Some(Solution { error, .. }) = check.solution() {
        lines.push((
            "",
            format!(
                "shooting: positions within {}, rotations {}, forces {}, moments {}",
                bound(error.position),
                match error.rotation {
                    0.0 => bound(0.0),
                    rotation => format!("{} rad", bound(rotation)),
                },
                bound(error.force),
                bound(error.moment)
            ),
        ));
    }
    match check.within_estimates {
        Some(true) => lines.push(("", "positions differ by no more than both errors".into())),
        Some(false) => lines.push(("", "positions differ by more than both errors".into())),
        None => (),
    }
    lines
}

/// How the shooting went.
fn shooting_itself(solution: &Solution) -> Vec<(&'static str, String)> {
    let mut lines = vec![
        (
            "growth",
            format!(
                "perturbations grow 10^{:.1} times from base to tip: {}",
                solution.growth,
                shooting(solution.intervals.len() - 1)
            ),
        ),
        (
            "defect",
            format!(
                "{}, ratio of singular values {:.1e}",
                power_of_ten(solution.defect),
                solution.condition
            ),
        ),
    ];
    if let Some(neutral) = &solution.neutral {
        lines.push(("neutral", neutral.to_string()));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn another_equilibrium_is_called_unstable() {
        let report = report(&sample::check(1, 8, 0.1), None);
        for part in [
            "fan: 1 vein, relaxed and by shooting\n",
            "  verdict  the methods differ: to agree, positions within 1.0×10⁻⁶, rotations within 1.0×10⁻⁴ rad\n",
            "  shooting unstable equilibrium of index 2 (2 negative eigenvalues) in 20.00 ms\n",
            "at 1.000 of the length\n           rotations by ",
            "positions differ by more than both errors\n",
            "  neutral  a bifurcation is near",
        ] {
            assert!(report.contains(part), "{part} in {report}");
        }
    }
}
