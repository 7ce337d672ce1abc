//! What depends on the leaf as a whole, or on its natural state: tissue, and loads of single veins.
//! Their changes are weighted sums over leaves that differ in the number.

use crate::leaf::derivative::{Forces, LeafRate};
use crate::leaf::dimensionless::Leaf;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{State, add};
use crate::rod::{Section, Strip};
use crate::scenario::Scenario;
use glam::DVec3;
use std::sync::Arc;

/// The leaves of neighbouring scenarios with their weights, in the units of this one.
pub(in crate::leaf::derivative) fn leaves(
    leaf: &Leaf,
    terms: &[(f64, Scenario)],
) -> Vec<(f64, Leaf)> {
    let each = terms.iter().map(|(weight, scenario)| {
        let scenario = Arc::new(scenario.clone());
        (*weight, Leaf::in_units(scenario, leaf.scale))
    });
    each.collect()
}

/// The changes of the rest strain and the rest curvature of segment `i` of rod `j`.
pub(in crate::leaf::derivative) fn rest_rates(
    each: &[(f64, DiscreteLeaf)],
    j: usize,
    i: usize,
) -> [DVec3; 2] {
    let Some((_, first)) = each.first() else {
        return [DVec3::ZERO; 2];
    };
    let sum = |of: fn(&Section) -> DVec3| -> DVec3 {
        let own = of(first.section(j, i));
        each.iter()
            .map(|(weight, leaf)| *weight * (of(leaf.section(j, i)) - own))
            .sum()
    };
    [sum(|it| it.rest_strain), sum(|it| it.rest_curvature)]
}

impl DiscreteLeaf {
    /// The weighted leaves of a rate on this grid.
    pub(in crate::leaf::derivative) fn each_of(&self, rate: &LeafRate) -> Vec<(f64, DiscreteLeaf)> {
        let leaves = rate.leaves.iter();
        leaves
            .map(|(weight, leaf)| (*weight, DiscreteLeaf::new(leaf, self.grid.clone())))
            .collect()
    }

    /// The change of the loads that rod `j` has of its own on its node `i`.
    pub(in crate::leaf::derivative) fn own_load_rate(
        &self,
        rate: &LeafRate,
        j: usize,
        i: usize,
    ) -> DVec3 {
        let sigma = self.grid.sigma()[i];
        let on = |leaf: &Leaf| {
            let points = leaf.point_loads();
            let here = points.filter(|(rod, at, _)| (*rod, self.grid.nearest(*at)) == (j, i));
            let points: DVec3 = here.map(|(_, _, force)| force).sum();
            self.grid.weight(i) * leaf.own_load(j, sigma) + points
        };
        rate.leaves
            .iter()
            .map(|(weight, leaf)| *weight * on(leaf))
            .sum()
    }

    /// Adds the changes of the loads that veins have of their own, from the weighted leaves of
    /// which they are the sum.
    fn add_own_load_changes(
        &self,
        state: &State,
        each: &[(f64, DiscreteLeaf)],
        forces: &mut Forces,
    ) {
        let (n, nodes) = (self.segments(), self.moving_nodes());
        for (j, i) in self.each(0..n + 1) {
            let first = each[0].1.own_load(j, i);
            let changes = each
                .iter()
                .map(|(w, leaf)| *w * (leaf.own_load(j, i) - first));
            let change = self.load_factor * changes.sum::<DVec3>();
            if change != DVec3::ZERO {
                forces.energy -= change.dot(state.x[state.base(j) + i]);
                if nodes.contains(&i) {
                    let on = &mut forces.on_nodes(j, nodes.len())[i - nodes.start];
                    add(on, DVec3::ZERO, change);
                }
            }
        }
    }

    /// Adds the effect of the changes of the tissue, and of its natural state, and of loads of
    /// single veins: from the weighted leaves of which they are the sum.
    pub(in crate::leaf::derivative) fn add_tissue_changes(
        &self,
        state: &State,
        each: &[(f64, DiscreteLeaf)],
        forces: &mut Forces,
    ) {
        let (n, nodes) = (self.segments(), self.moving_nodes());
        let Some((_, first)) = each.first() else {
            return;
        };
        self.add_own_load_changes(state, each, forces);
        let (first, each): (_, Vec<_>) = (
            &first.strips,
            each.iter().map(|(w, leaf)| (w, &leaf.strips)).collect(),
        );
        for (k, own) in first.iter().enumerate() {
            let mut change = Strip::default();
            for (weight, strips) in &each {
                change.add(**weight, &strips[k].minus(own));
            }
            if change == Strip::default() {
                continue;
            }
            let (g, i) = (k / (n + 1), k % (n + 1));
            let (energy, loads) = self.tissue_rates(state, (g, i), &change);
            forces.energy += energy;
            for (j, [moment, force]) in [g, g + 1].into_iter().zip(loads) {
                if nodes.contains(&i) {
                    let on = &mut forces.on_nodes(j, nodes.len())[i - nodes.start];
                    add(on, moment, force);
                }
            }
        }
    }
}
