//! Neutral directions: where the equations are singular.

use glam::DVec3;

use super::intervals::GROWTH;
use super::newton::{Newton, NewtonFailure, largest};
use super::solution::{Neutral, Reason};
use super::trajectory::{Nodes, Trajectory};

/// Singular values of the tip's conditions below this part of the largest are
/// reported as a bifurcation nearby.
const NEARLY_SINGULAR: f64 = 1e-7;

/// Unless perturbations grow by more than this over an interval, which
/// alone makes the equations nearly singular.
const LARGEST_GROWTH: f64 = 100.0 * GROWTH;

/// Size of the perturbation along a neutral direction whose effect is computed.
const NUDGE: f64 = 1e-5;

/// Stations at which it is computed.
const STATIONS: [f64; 9] = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0];

impl Newton<'_, '_, '_> {
    /// Smallest singular value of the condensed equations over the largest.
    pub fn condition(&self) -> f64 {
        self.condensed
            .as_ref()
            .map_or(1.0, |condensed| condensed.condition())
    }

    /// The reason that corresponds to a failure of Newton's method.
    pub fn reason(&self, stuck: NewtonFailure) -> Reason {
        let correction = match stuck {
            NewtonFailure::Unbounded(unbounded) => return unbounded.into(),
            NewtonFailure::NoProgress(correction) => correction,
        };
        match self.neutral(&STATIONS) {
            Some(neutral) => Reason::Singular(neutral),
            None => {
                let growths = self.growth.iter().map(|growth| growth.log10());
                let growth = growths.fold(0.0, f64::max);
                Reason::NoConvergence { correction, growth }
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
        let nudged = self.moved(&direction, NUDGE / largest(&direction));
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
        let largest = lengths.fold(0.0, f64::max);
        for displacement in displacement.iter_mut().flatten() {
            *displacement /= largest;
        }
        Some(Neutral {
            ratio: self.condition(),
            displacement,
        })
    }
}
