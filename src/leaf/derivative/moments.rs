//! Dead moments on a single rod that change.

use crate::leaf::derivative::{Forces, LeafRate, change};
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::add;
use crate::scenario::Scenario;
use glam::DVec3;

/// Sigma and derivative of every dead moment that changes, over a unit.
pub(in crate::leaf::derivative) fn moment_rates(
    terms: &[(f64, Scenario)],
    unit: f64,
) -> Vec<(f64, DVec3)> {
    let rate = |moment: &dyn Fn(&Scenario) -> [f64; 3]| {
        DVec3::from_array([0, 1, 2].map(|axis| change(terms, &|s| moment(s)[axis]))) / unit
    };
    let points = terms[0].1.points.iter().enumerate();
    let on_points = points.map(|(k, point)| (point.at, rate(&|s| s.points[k].moment)));
    let all = std::iter::once((1.0, rate(&|s| s.tip_moment))).chain(on_points);
    all.filter(|(_, moment)| *moment != DVec3::ZERO).collect()
}

impl LeafRate<'_> {
    /// Whether dead moments change.
    pub fn changes_moments(&self) -> bool {
        !self.moments.is_empty()
    }
}

impl DiscreteLeaf {
    /// Adds the changes of dead moments.
    pub(in crate::leaf::derivative) fn add_moment_changes(
        &self,
        rate: &LeafRate,
        forces: &mut Forces,
    ) {
        for (sigma, moment) in &rate.moments {
            let nodes = forces.on_nodes(0, self.moving_nodes().len());
            if let Some(i) = self.grid.nearest(*sigma).checked_sub(self.first_node()) {
                add(&mut nodes[i], self.load_factor * *moment, DVec3::ZERO);
            }
        }
    }
}
