//! Plausibility checks of a leaf at rest: remarks on results that indicate wrong input.

use crate::relax::result::equilibrium::Equilibrium;
use crate::scenario::{STRETCHED, Scenario, out_of_reach, slips};
use crate::shape::RodShape;

/// The implausible properties of a leaf at rest, one short sentence each; first those of its
/// scenario.
pub fn doubts(scenario: &Scenario, leaf: &Equilibrium) -> Vec<String> {
    if !leaf.outcome.is_at_rest() {
        return Vec::new();
    }
    let (rods, stations) = (&leaf.shape.rods, &leaf.shape.stations);
    let mut all = slips(scenario);
    if out_of_reach(scenario).is_none() {
        let strained = || stretched(strains(scenario, rods, stations));
        all.extend(inverted(rods, stations).or_else(strained));
    }
    all
}

/// Relative stretch beyond the rest stretch, with the vein and the fraction of its length.
fn strains<'l>(
    scenario: &'l Scenario,
    rods: &'l [RodShape],
    stations: &'l [f64],
) -> impl Iterator<Item = (f64, usize, f64)> + 'l {
    let of = move |(j, rod): (usize, &'l RodShape)| {
        let rest = &scenario.rods[j].rest_stretch;
        let nodes = rod.nodes.iter().zip(stations);
        nodes.map(move |(node, at)| (node.v.x / rest.at(*at) - 1.0, j, *at))
    };
    rods.iter().enumerate().flat_map(of)
}

fn stretched(strains: impl Iterator<Item = (f64, usize, f64)>) -> Option<String> {
    let (strain, j, at) = strains.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (strain > STRETCHED).then(|| {
        format!(
            "vein {} is stretched by {:.0} % at {at:.2} of its length: few materials follow a linear law so far",
            j + 1,
            100.0 * strain
        )
    })
}

/// A vein with inverted elements (non-positive stretch).
fn inverted(rods: &[RodShape], stations: &[f64]) -> Option<String> {
    let backwards = |rod: &RodShape| rod.nodes.iter().position(|node| node.v.x <= 0.0);
    let mut rods = rods.iter().enumerate();
    rods.find_map(|(j, rod)| {
        let at = stations[backwards(rod)?];
        Some(format!(
            "vein {} is turned through itself at {at:.2} of its length, which no body can be: raise stiffness.axial",
            j + 1
        ))
    })
}
