//! Where the equations are singular: what that means for the leaf.

use glam::DVec3;

use super::intervals::GROWTH;
use super::newton::{Newton, Stuck, largest};
use super::solution::{Neutral, Reason};
use super::trajectory::{Nodes, Trajectory};

/// Singular values of the tip's conditions below this part of the largest are
/// reported as a bifurcation nearby.
const NEARLY_SINGULAR: f64 = 1e-7;

/// But not where perturbations grow more than this over an interval: that
/// alone makes the equations nearly singular.
const LARGEST_GROWTH: f64 = 100.0 * GROWTH;

/// Size of the perturbation by which a neutral direction is made visible.
const NUDGE: f64 = 1e-5;

/// Stations at which that is done.
const STATIONS: [f64; 9] = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0];

impl Newton<'_, '_, '_> {
    /// Smallest singular value of the condensed equations over the largest.
    pub fn condition(&self) -> f64 {
        self.march.as_ref().map_or(1.0, |march| march.condition())
    }

    /// What being stuck means.
    pub fn reason(&self, stuck: Stuck) -> Reason {
        let correction = match stuck {
            Stuck::Unbounded(unbounded) => return unbounded.into(),
            Stuck::NoProgress(correction) => correction,
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

    /// The neutral direction, if the equations are nearly singular: what a
    /// small perturbation along it does to the rods.
    pub fn neutral(&self, stations: &[f64]) -> Option<Neutral> {
        let trusted = self.growth.iter().all(|growth| *growth < LARGEST_GROWTH);
        let march = self.march.as_ref()?;
        if !trusted || march.condition() > NEARLY_SINGULAR {
            return None;
        }
        let direction = march.null();
        let nudged = self.moved(&direction, NUDGE / largest(&direction));
        let sampled =
            |nodes: &Nodes| Trajectory::sampled(self.equations, nodes, stations, NUDGE * NUDGE);
        let (at, beside) = (sampled(&self.nodes).ok()?, sampled(&nudged).ok()?);
        let (at, beside) = (at.shape(self.equations), beside.shape(self.equations));
        let mut displacement: Vec<Vec<DVec3>> = (at.iter().zip(&beside))
            .map(|(at, beside)| {
                let nodes = at.nodes.iter().zip(&beside.nodes);
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
