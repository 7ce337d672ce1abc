//! The text report of a check.

use crate::report::numbers::{
    as_accurate, bound, bound_of_positions, decimals, eigenvalues, grids, in_unit, point,
    power_of_ten, seconds, veins,
};
use crate::report::relax::found;
use crate::report::table::{Lines, labelled};
use crate::report::{Reported, equilibrium_of_index, headline, shooting};
use glam::DVec3;
use leafdyn::scenario::Units;
use leafdyn::scenario::units::{ENERGY, FORCE, LENGTH};
use leafdyn::study::{Check, Place, Quantity, ShootingSolution as Solution, Verdict};

impl Reported for Check {
    fn heading(&self) -> String {
        let (name, veins) = (&self.relaxed.scenario, veins(&self.relaxed));
        format!("{name}: {veins}, relaxed and by shooting")
    }

    fn lines(&self, units: &Units) -> Lines {
        let mut lines = vec![("verdict", judgement(self, units))];
        lines.extend(results(self, units));
        lines.extend(labelled("differ", differences(self, units)));
        lines.extend(labelled("error", errors(self, units)));
        lines.extend(self.solution().into_iter().flat_map(shooting_details));
        // Otherwise the verdict explains why the leaf is not at rest.
        if let (Some(remark), true) = (&self.relaxed.remark, self.shot.is_some()) {
            lines.push(("remark", remark.clone()));
        }
        lines.extend(labelled("doubtful", self.relaxed.doubts.clone()));
        lines
    }
}

fn judgement(check: &Check, units: &Units) -> String {
    let [position, rotation] = [check.allowed(), check.allowed_rotation()].map(power_of_ten);
    let position = in_unit(position, units, LENGTH);
    let allowed = format!("positions within {position}, rotations within {rotation} rad");
    let headline = headline(&check.verdict);
    match &check.verdict {
        Verdict::Agree => match check.indices() {
            Some(_) => format!("{headline}: {allowed}, the same index"),
            None => format!("{headline}: {allowed}; their indices are not compared"),
        },
        Verdict::Differ => format!("{headline}: to agree, {allowed}, the same index"),
        Verdict::NotCompared(reason) | Verdict::NotIndependent(reason) => {
            format!("{headline}: {reason}")
        }
    }
}

/// The result and the time of each method.
fn results(check: &Check, units: &Units) -> Lines {
    let relaxed = &check.relaxed;
    let found = format!("{} in {}", found(relaxed), seconds(relaxed.wall_seconds));
    let mut lines = vec![("relaxed", found)];
    let shot = check.shot.as_ref().map(|shot| {
        let index = shot.negative_eigenvalues;
        let found = match shot.found {
            Ok(_) => equilibrium_of_index(index) + &eigenvalues(index),
            Err(_) => "no solution".into(),
        };
        format!("{found} in {}", seconds(shot.wall_seconds))
    });
    lines.push(("shooting", shot.unwrap_or_else(|| "not tried".into())));
    let place = |tip: &DVec3| {
        let tip = point(tip.to_array(), decimals(relaxed));
        in_unit(tip, units, LENGTH)
    };
    if let [tip] = relaxed.tips.as_slice() {
        lines.push(("tip", format!("{} relaxed", place(tip))));
        if let Some([tip]) = check.shot.as_ref().map(|shot| shot.tips.as_slice()) {
            lines.push(("", format!("{} by shooting", place(tip))));
        }
    }
    let digits = |energy: f64| in_unit(as_accurate(relaxed, energy, energy), units, ENERGY);
    let mut energy = digits(relaxed.energy.unwrap_or(f64::NAN)) + " relaxed";
    if let Some(solution) = check.solution() {
        energy += &format!(", {} by shooting", digits(solution.energy));
    }
    lines.push(("energy", energy));
    lines
}

/// The largest differences, and where they are.
fn differences(check: &Check, units: &Units) -> Vec<String> {
    let Some(difference) = &check.difference else {
        return Vec::new();
    };
    let line = |quantity: Quantity| {
        let (word, largest) = (quantity.word(), quantity.of(difference));
        match check.farthest(quantity) {
            Some(Place { rod, sigma }) if largest > 0.0 => {
                let place = match check.relaxed.shape.rods.len() {
                    1 => format!("at {sigma:.3} of the length"),
                    _ => format!("in vein {} at {sigma:.3} of its length", rod + 1),
                };
                let largest = with_unit(power_of_ten(largest), quantity, units);
                format!("{word}s by {largest} at most, {place}")
            }
            _ => format!("{word}s not at all"),
        }
    };
    Quantity::ALL.into_iter().map(line).collect()
}

/// A number with the unit of its quantity.
fn with_unit(number: String, quantity: Quantity, units: &Units) -> String {
    match quantity {
        Quantity::Position => in_unit(number, units, LENGTH),
        Quantity::Rotation => number + " rad",
        Quantity::Force => in_unit(number, units, FORCE),
        Quantity::Moment => in_unit(number, units, ENERGY),
    }
}

/// The error estimates of both methods.
fn errors(check: &Check, units: &Units) -> Vec<String> {
    let relaxed = &check.relaxed;
    let mut lines = vec![match relaxed.accuracy.error_estimate {
        Some(error) => {
            let (error, grids) = (bound_of_positions(error, units), grids(relaxed));
            format!("relaxed: positions within {error}, from {grids}")
        }
        None => "relaxed: not known".into(),
    }];
    if let Some(Solution { error, .. }) = check.solution() {
        let [position, rotation, force, moment] =
            Quantity::ALL.map(|quantity| match quantity.of(error) {
                0.0 => bound(0.0),
                error => with_unit(bound(error), quantity, units),
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
fn shooting_details(solution: &Solution) -> Lines {
    let (growth, method) = (solution.growth, shooting(solution.intervals.len() - 1));
    let growth = format!("perturbations grow 10^{growth:.1} times from base to tip: {method}");
    let (defect, ratio) = (power_of_ten(solution.defect), solution.condition);
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
        let report = sample::check(1, 8, 0.1).report(&Units::default(), Vec::new(), false);
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
