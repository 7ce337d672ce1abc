//! Derivatives of what the matrix gives, and of the moments on a clamp: by differences
//! along the response, from equilibrium to equilibrium.

use crate::leaf::{DiscreteLeaf, Leaf, LeafRate, Response, State};
use crate::modes::{self, LoadedMode};
use crate::motion::Physics;
use crate::relax::run::Level;
use crate::relax::sensitivity::response::moved;
use crate::scenario::Scenario;
use glam::DVec3;
use std::sync::Arc;

/// The leaf for nearby values of a number, at rest there to first order, with the
/// weights by which a function of it is differenced.
pub(crate) struct Nearby(Vec<(f64, DiscreteLeaf, State)>);

impl Nearby {
    /// From scenarios nearby, with their offsets and weights.
    pub fn new(
        level: &Level,
        scenarios: &[(f64, f64, Arc<Scenario>)],
        (rate, response): (&LeafRate, &Response),
    ) -> Nearby {
        let leaf = &level.leaf;
        let near = |(offset, weight, scenario): &(f64, f64, Arc<Scenario>)| {
            let near = Leaf::in_units(Arc::clone(scenario), leaf.leaf.scale);
            let near = DiscreteLeaf::new(&near, leaf.grid.clone());
            (*weight, near, moved(level, rate, response, *offset))
        };
        Nearby(scenarios.iter().map(near).collect())
    }

    /// The change of the eigenvalue of a mode, by its shape and its forces: that of its
    /// quotient as the leaf goes from equilibrium to equilibrium, since its shape enters in
    /// the second order only.
    pub fn eigenvalue_rate(&self, mode: &LoadedMode) -> f64 {
        let term = |(weight, leaf, state): &(f64, DiscreteLeaf, State)| {
            let physics = Physics::new(&leaf.leaf);
            weight * modes::eigenvalue(leaf, &physics, state, &mode.shape, &mode.forces)
        };
        self.0.iter().map(term).sum()
    }

    /// The changes of the moments of the rods on a clamp.
    pub fn clamp_moment_rates(&self, level: &Level) -> Vec<DVec3> {
        let first = level.leaf.reaction(&level.state).1;
        let mut rates = vec![DVec3::ZERO; first.len()];
        for (weight, leaf, state) in &self.0 {
            let moments = leaf.reaction(state).1;
            for ((rate, moment), first) in rates.iter_mut().zip(moments).zip(&first) {
                *rate += *weight * (moment - *first);
            }
        }
        rates
    }
}
