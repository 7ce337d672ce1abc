//! The text report of a check.

use crate::report::document::{
    ReportedResult, check_verdict_phrase, equilibrium_kind, shooting_method_name,
};
use crate::report::numbers::{
    duration_text, format_as_accurate, format_error_bound, grids_text, negative_eigenvalues_text,
    number_in_unit, position_decimals, position_error_text, tips_text, upper_bound_text,
    veins_text,
};
use crate::report::relax::{doubt_with_option, equilibrium_phrase};
use crate::report::table::{LabelledLines, label_first_line};
use glam::DVec3;
use leafdyn::scenario::Units;
use leafdyn::scenario::units::{ENERGY, FORCE, LENGTH};
use leafdyn::study::{Check, CheckVerdict, ComparedQuantity, DifferenceLocation, ShootingSolution};

impl ReportedResult for Check {
    fn heading(&self) -> String {
        let (name, veins) = (&self.relaxed.scenario, veins_text(&self.relaxed));
        format!("{name}: {veins}, relaxed and by shooting")
    }

    fn report_lines(&self, units: &Units) -> LabelledLines {
        let mut lines = vec![("verdict", verdict_sentence(self, units))];
        lines.extend(method_lines(self, units));
        lines.extend(label_first_line("differ", difference_lines(self, units)));
        lines.extend(label_first_line(
            "error",
            both_error_estimate_lines(self, units),
        ));
        lines.extend(self.solution().into_iter().flat_map(shooting_detail_lines));
        // Otherwise the verdict explains why the leaf is not at rest.
        if let (Some(remark), true) = (&self.relaxed.remark, self.shot.is_some()) {
            lines.push(("remark", remark.to_string()));
        }
        let doubts = self.relaxed.doubts.iter().map(doubt_with_option);
        lines.extend(label_first_line("doubtful", doubts));
        lines
    }
}

fn verdict_sentence(check: &Check, units: &Units) -> String {
    let [position, rotation] = [check.allowed(), check.allowed_rotation()].map(format_error_bound);
    let position = number_in_unit(position, units, LENGTH);
    let allowed = format!("positions within {position}, rotations within {rotation} rad");
    let headline = check_verdict_phrase(&check.verdict);
    match &check.verdict {
        CheckVerdict::Agree => match check.indices() {
            Some(_) => format!("{headline}: {allowed}, the same index"),
            None => format!("{headline}: {allowed}; their indices are not compared"),
        },
        CheckVerdict::Differ => format!("{headline}: to agree, {allowed}, the same index"),
        CheckVerdict::NotCompared(reason) | CheckVerdict::NotIndependent(reason) => {
            format!("{headline}: {reason}")
        }
    }
}

/// The result and the time of each method.
fn method_lines(check: &Check, units: &Units) -> LabelledLines {
    let relaxed = &check.relaxed;
    let found = format!(
        "{} in {}",
        equilibrium_phrase(relaxed),
        duration_text(relaxed.wall_seconds)
    );
    let mut lines = vec![("relaxed", found)];
    let shot = check.shot.as_ref().map(|shot| {
        let index = shot.negative_eigenvalues;
        let found = match shot.found {
            Ok(_) => equilibrium_kind(index) + &negative_eigenvalues_text(index),
            Err(_) => "no solution".into(),
        };
        format!("{found} in {}", duration_text(shot.wall_seconds))
    });
    lines.push(("shooting", shot.unwrap_or_else(|| "not tried".into())));
    let places = |tips: &[DVec3]| tips_text(tips, position_decimals(relaxed), units);
    if let Some(tips) = places(&relaxed.tips) {
        lines.push(("tip", format!("{tips} relaxed")));
        let shot = check.shot.as_ref().and_then(|shot| places(&shot.tips));
        lines.extend(shot.map(|tips| ("", format!("{tips} by shooting"))));
    }
    let digits =
        |energy: f64| number_in_unit(format_as_accurate(relaxed, energy, energy), units, ENERGY);
    let of_relaxed = relaxed.energy.map(|energy| digits(energy) + " relaxed");
    let solution = check.solution().filter(|_| relaxed.energy.is_some());
    let by_shooting = solution.map(|it| digits(it.energy) + " by shooting");
    let energies: Vec<String> = of_relaxed.into_iter().chain(by_shooting).collect();
    if !energies.is_empty() {
        lines.push(("energy", energies.join(", ")));
    }
    lines
}

/// The largest differences, and where they are.
fn difference_lines(check: &Check, units: &Units) -> Vec<String> {
    let Some(difference) = &check.difference else {
        return Vec::new();
    };
    let line = |quantity: ComparedQuantity| {
        let (word, largest) = (quantity.word(), quantity.component(difference));
        match check.largest_difference_location(quantity) {
            Some(DifferenceLocation { rod, sigma }) if largest > 0.0 => {
                let place = match check.relaxed.shape.rods.len() {
                    1 => format!("at {sigma:.3} of the length"),
                    _ => format!("in vein {} at {sigma:.3} of its length", rod + 1),
                };
                let largest = number_with_unit(format_error_bound(largest), quantity, units);
                format!("{word}s by {largest} at most, {place}")
            }
            _ => format!("{word}s not at all"),
        }
    };
    ComparedQuantity::ALL.into_iter().map(line).collect()
}

/// A number with the unit of its quantity.
fn number_with_unit(number: String, quantity: ComparedQuantity, units: &Units) -> String {
    match quantity {
        ComparedQuantity::Position => number_in_unit(number, units, LENGTH),
        ComparedQuantity::Rotation => number + " rad",
        ComparedQuantity::Force => number_in_unit(number, units, FORCE),
        ComparedQuantity::Moment => number_in_unit(number, units, ENERGY),
    }
}

/// The error estimates of both methods.
fn both_error_estimate_lines(check: &Check, units: &Units) -> Vec<String> {
    let relaxed = &check.relaxed;
    let mut lines = vec![match relaxed.accuracy.error_estimate {
        Some(error) => {
            let (error, grids) = (position_error_text(error, units), grids_text(relaxed));
            format!("relaxed: positions within {error}, from {grids}")
        }
        None => "relaxed: not known".into(),
    }];
    if let Some(ShootingSolution { error, .. }) = check.solution() {
        let [position, rotation, force, moment] =
            ComparedQuantity::ALL.map(|quantity| match quantity.component(error) {
                0.0 => upper_bound_text(0.0),
                error => number_with_unit(upper_bound_text(error), quantity, units),
            });
        lines.push(format!(
            "shooting: positions within {position}, rotations {rotation}, forces {force}, moments {moment}"
        ));
    }
    lines.extend(check.within_estimates.map(|within| {
        let than = if within { "no more than" } else { "more than" };
        format!("positions differ by {than} both errors")
    }));
    lines
}

/// Growth of perturbations, defect and conditioning of the shooting.
fn shooting_detail_lines(solution: &ShootingSolution) -> LabelledLines {
    let (growth, method) = (
        solution.growth,
        shooting_method_name(solution.intervals.len() - 1),
    );
    let growth = format!("perturbations grow 10^{growth:.1} times from base to tip: {method}");
    let (defect, ratio) = (format_error_bound(solution.defect), solution.condition);
    let defect = format!("{defect}, ratio of singular values {ratio:.1e}");
    let mut lines = vec![("growth", growth), ("defect", defect)];
    lines.extend((solution.neutral.iter()).map(|neutral| ("neutral", neutral.to_string())));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn another_equilibrium_is_called_unstable() {
        let report = sample::sample_check(1, 8, 0.1).report(&Units::default(), Vec::new(), false);
        for part in [
            "fan: 1 vein, relaxed and by shooting\n",
            "  verdict  the methods differ: to agree, positions within 1.0×10⁻⁶, rotations within 1.0×10⁻⁴ rad, the same index\n",
            "  shooting unstable equilibrium of index 2 (2 negative eigenvalues) in 20.00 ms\n",
            "at 1.000 of the length\n           rotations by ",
            "positions differ by more than both errors\n",
            "  neutral  a bifurcation is near",
        ] {
            assert!(report.contains(part), "{part} in {report}");
        }
    }
}
