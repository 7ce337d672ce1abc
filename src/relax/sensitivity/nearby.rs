//! Derivatives of what the matrix gives, and of the moments on a clamp: by differences
//! along the response, from equilibrium to equilibrium.

use crate::leaf::{DiscreteLeaf, Leaf, LeafRate, Response, State};
use crate::modes;
use crate::motion::Physics;
use crate::relax::number::Number;
use crate::relax::run::Level;
use crate::relax::sensitivity::response::moved;
use glam::DVec3;
use std::sync::Arc;

/// The leaf for nearby values of a number, at rest there to first order, with the
/// weights by which a function of it is differenced.
fn nearby(
    level: &Level,
    number: &Number,
    (rate, response): (&LeafRate, &Response),
) -> Option<Vec<(f64, DiscreteLeaf, State)>> {
    let leaf = &level.leaf;
    let near = |(offset, weight, scenario)| {
        let near = Leaf::in_units(Arc::new(scenario), leaf.leaf.scale);
        let near = DiscreteLeaf::new(&near, leaf.grid.clone());
        (weight, near, moved(level, rate, response, offset))
    };
    Some(number.nearby()?.into_iter().map(near).collect())
}

/// The change of the eigenvalue of a mode: that of its quotient as the leaf goes from
/// equilibrium to equilibrium, since its shape enters in the second order only.
pub(crate) fn eigenvalue_rate(
    level: &Level,
    number: &Number,
    change: (&LeafRate, &Response),
    shape: &[[f64; 6]],
) -> Option<f64> {
    let forces = modes::mode_forces(&level.leaf, &level.state, shape);
    let terms = nearby(level, number, change)?;
    let term = |(weight, leaf, state): &(f64, DiscreteLeaf, State)| {
        let physics = Physics::new(&leaf.leaf);
        weight * modes::eigenvalue(leaf, &physics, state, shape, &forces)
    };
    Some(terms.iter().map(term).sum())
}

/// The changes of the moments of the rods on a clamp.
pub(super) fn clamp_moment_rates(
    level: &Level,
    number: &Number,
    change: (&LeafRate, &Response),
) -> Option<Vec<DVec3>> {
    let first = level.leaf.reaction(&level.state).1;
    let mut rates = vec![DVec3::ZERO; first.len()];
    for (weight, leaf, state) in nearby(level, number, change)? {
        let moments = leaf.reaction(&state).1;
        for ((rate, moment), first) in rates.iter_mut().zip(moments).zip(&first) {
            *rate += weight * (moment - *first);
        }
    }
    Some(rates)
}
