//! Leaves that differ in one parameter.

use glam::DVec3;

use std::sync::Arc;

use crate::leaf::{DiscreteLeaf, Grid, Leaf, Scale, State};
use crate::scenario::Scenario;

/// Stiffness in stretch and shear, in units of A/L^2, with which forces are
/// condensed out at most: near singular points a larger stiffness loses digits.
const STIFFEST: f64 = 1e5;

/// A leaf for every value of a parameter.
#[derive(Clone, Copy)]
pub struct Family<'a> {
    make: &'a (dyn Fn(f64) -> Result<Scenario, String> + Sync),
    /// Values of the parameter at the fractions 0 and 1.
    from: f64,
    to: f64,
    /// Whether equal steps of the fraction are equal quotients of the value.
    log: bool,
    scale: Scale,
    softening: Option<f64>,
}

/// A value of the parameter that no leaf can have; what the scenario says of it.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{0}")]
pub struct OutOfRange(pub String);

impl<'a> Family<'a> {
    /// The leaves `make` gives, from one value of the parameter to another (in
    /// equal quotients if `log`), in the units of the first.
    pub fn new(
        make: &'a (dyn Fn(f64) -> Result<Scenario, String> + Sync),
        (from, to): (f64, f64),
        log: bool,
    ) -> Result<Self, OutOfRange> {
        let first = make(from).map_err(OutOfRange)?;
        make(to).map_err(OutOfRange)?;
        Ok(Family {
            make,
            from,
            to,
            log,
            scale: Leaf::new(&first).scale,
            softening: None,
        })
    }

    /// The same family whose matrices are those of leaves with so much more
    /// compliance in stretch and shear (in units of L^2/A), while the equilibria
    /// stay. A matrix of a nearly rigid leaf loses its soft modes to rounding;
    /// where these become neutral is analytic in the softening, and can be
    /// extrapolated to none.
    pub fn softened(&self, softening: f64) -> Self {
        Family {
            softening: Some(softening),
            ..*self
        }
    }

    /// The units of all its leaves.
    pub fn scale(&self) -> Scale {
        self.scale
    }

    /// The parameter at a fraction of its range.
    pub fn value(&self, fraction: f64) -> f64 {
        match fraction {
            1.0 => self.to,
            _ if self.log => self.from * (self.to / self.from).powf(fraction),
            _ => self.from + (self.to - self.from) * fraction,
        }
    }

    /// The scenario there.
    pub fn scenario(&self, fraction: f64) -> Result<Scenario, OutOfRange> {
        (self.make)(self.value(fraction)).map_err(OutOfRange)
    }

    /// Does something with the leaf there, on a grid.
    pub fn with<R>(
        &self,
        fraction: f64,
        grid: &Grid,
        act: impl FnOnce(&DiscreteLeaf) -> R,
    ) -> Result<R, OutOfRange> {
        let scenario = self.scenario(fraction)?;
        let leaf = Leaf::in_units(Arc::new(scenario), self.scale);
        let mut discrete = DiscreteLeaf::new(&leaf, grid.clone());
        for section in &mut discrete.sections {
            section.condensing = match self.softening {
                Some(softening) => (section.compliance + DVec3::splat(softening)).recip(),
                None => section.condensing.min(DVec3::splat(STIFFEST)),
            };
        }
        Ok(act(&discrete))
    }
}

/// Puts the bases of all rods where the leaf clamps them, and tips where they are
/// held.
pub fn clamp(leaf: &DiscreteLeaf, state: &mut State) {
    leaf.hold_tips(state);
    for j in 0..leaf.rods() {
        let base = state.base(j);
        state.q[base] = leaf.leaf.base(j);
    }
}
