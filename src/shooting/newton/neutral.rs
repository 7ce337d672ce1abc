//! Directions in which the equations are nearly singular, and why there is no convergence.

use super::{LARGEST_GROWTH, NEARLY_SINGULAR, NUDGE, Newton, STATIONS, size_of};
use crate::largest::largest;
use crate::shooting::solution::{Neutral, Reason};
use crate::shooting::trajectory::{Nodes, Trajectory};
use glam::DVec3;

impl Newton<'_, '_, '_> {
    /// Smallest singular value of the condensed equations over the largest.
    pub fn condition(&self) -> f64 {
        self.condensed
            .as_ref()
            .map_or(1.0, |condensed| condensed.condition())
    }

    /// Why there is no convergence, as far as the last linearisation shows it.
    pub(super) fn explained(&self, reason: Reason) -> Reason {
        let Reason::NoConvergence {
            correction,
            fixed,
            from_leaf,
            ..
        } = reason
        else {
            return reason;
        };
        match self.neutral(&STATIONS) {
            Some(neutral) => Reason::Singular(neutral),
            None if self.gives_up => Reason::Rounding {
                correction,
                growth: self.growth.iter().map(|growth| growth.log10()).sum(),
            },
            None => {
                let growths = self.growth.iter().map(|growth| growth.log10());
                let growth = largest(growths);
                Reason::NoConvergence {
                    correction,
                    growth,
                    fixed,
                    from_leaf,
                }
            }
        }
    }

    /// The neutral direction, if the equations are nearly singular: the effect on the rods of a
    /// small perturbation along it.
    pub fn neutral(&self, stations: &[f64]) -> Option<Neutral> {
        let trusted = self.growth.iter().all(|growth| *growth < LARGEST_GROWTH);
        let condensed = self.condensed.as_ref()?;
        if !trusted || condensed.condition() > NEARLY_SINGULAR {
            return None;
        }
        let direction = condensed.null();
        let nudged = self.moved(&direction, NUDGE / size_of(&direction));
        let sampled =
            |nodes: &Nodes| Trajectory::sampled(self.equations, nodes, stations, NUDGE * NUDGE);
        let (at, perturbed) = (sampled(&self.nodes).ok()?, sampled(&nudged).ok()?);
        let (at, perturbed) = (at.shape(self.equations), perturbed.shape(self.equations));
        let mut displacement: Vec<Vec<DVec3>> = (at.iter().zip(&perturbed))
            .map(|(at, perturbed)| {
                let nodes = at.nodes.iter().zip(&perturbed.nodes);
                nodes.map(|(a, b)| b.position - a.position).collect()
            })
            .collect();
        let lengths = displacement.iter().flatten().map(|d| d.length());
        let most = largest(lengths);
        for displacement in displacement.iter_mut().flatten() {
            *displacement /= most;
        }
        Some(Neutral {
            ratio: self.condition(),
            displacement,
        })
    }
}
