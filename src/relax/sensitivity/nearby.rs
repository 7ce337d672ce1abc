//! Derivatives of eigenvalues, and of the moments on clamps, by finite differences between
//! neighbouring equilibria, which are known to first order from the response.

use crate::leaf::{DiscreteLeaf, Leaf, LeafRate, Response, State};
use crate::modes::{self, Eigenpair};
use crate::relax::sensitivity::response::moved;
use crate::relax::transfer::level::Level;
use crate::scenario::Scenario;
use glam::DVec3;
use std::sync::Arc;

/// The leaf for neighbouring values of a number, at rest to first order, with
/// finite-difference weights.
pub(crate) struct Nearby(Vec<Near>);

struct Near {
    offset: f64,
    weight: f64,
    leaf: DiscreteLeaf,
    state: State,
}

/// Relative differences below which two eigenvalues, and their derivatives, count as equal;
/// the third number bounds the error of eigenvalues by rounding, as a part of the first.
const EQUAL: f64 = 1e-6;
const SAME: f64 = 1e-3;
const NOISE: f64 = 1e-3;

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
            Near {
                offset: *offset,
                weight: *weight,
                leaf: near,
                state: moved(level, rate, response, *offset),
            }
        };
        Nearby(scenarios.iter().map(near).collect())
    }

    /// The derivative of the eigenvalue of a mode: that of its Rayleigh quotient between
    /// neighbouring equilibria, as changes of its shape enter in second order only.
    pub fn eigenvalue_rate(&self, mode: &Eigenpair) -> f64 {
        let term = |near: &Near| near.weight * modes::eigenvalue(&near.leaf, &near.state, mode);
        self.0.iter().map(term).sum()
    }

    /// The same for several modes. NaN where a multiple eigenvalue splits: its modes change
    /// differently, and the lower one is another mode on either side.
    pub fn eigenvalue_rates(&self, modes: &[Eigenpair]) -> Vec<f64> {
        let mut rates: Vec<f64> = modes
            .iter()
            .map(|mode| self.eigenvalue_rate(mode))
            .collect();
        let offsets = self.0.iter().map(|near| near.offset.abs());
        let farthest = offsets.fold(0.0, f64::max);
        let pairs = modes.windows(2).enumerate();
        let equal = |pair: &[Eigenpair]| {
            let [a, b] = [pair[0].eigenvalue, pair[1].eigenvalue];
            (a - b).abs() <= EQUAL * a.abs().max(b.abs())
        };
        for (k, pair) in pairs.filter(|(_, pair)| equal(pair)) {
            let [a, b] = [rates[k], rates[k + 1]];
            let mixed = self.eigenvalue_rate(&pair[0].plus(&pair[1])) - 0.5 * (a + b);
            let rounding = EQUAL * NOISE * pair[0].eigenvalue.abs() / farthest;
            let same = SAME * a.abs().max(b.abs()) + rounding;
            if !(mixed.abs() <= same && (a - b).abs() <= same) {
                rates[k..k + 2].fill(f64::NAN);
            }
        }
        rates
    }

    /// The derivatives of the moments of the rods on a clamp.
    pub fn clamp_moment_rates(&self, level: &Level) -> Vec<DVec3> {
        self.rates_of(level, |leaf, state| leaf.reaction(state).1)
    }

    /// The derivatives of the moments on grips about their middles.
    pub fn grip_moment_rates(&self, level: &Level) -> Vec<DVec3> {
        self.rates_of(level, |leaf, state| {
            let reactions = leaf.grip_reactions(state).into_iter();
            reactions.map(|[_, moment]| moment).collect()
        })
    }

    fn rates_of(
        &self,
        level: &Level,
        vectors: impl Fn(&DiscreteLeaf, &State) -> Vec<DVec3>,
    ) -> Vec<DVec3> {
        let first = vectors(&level.leaf, &level.state);
        let mut rates = vec![DVec3::ZERO; first.len()];
        for near in &self.0 {
            let found = vectors(&near.leaf, &near.state);
            for ((rate, vector), first) in rates.iter_mut().zip(found).zip(&first) {
                *rate += near.weight * (vector - *first);
            }
        }
        rates
    }
}
