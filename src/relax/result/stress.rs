//! The largest stresses along the veins.

use crate::scenario::{Scenario, Stress};
use crate::shape::RodShape;
use serde::Serialize;

/// The largest stresses of a leaf in each of its sections, at its stations. As JSON the place where
/// the equivalent stress is largest of all: `stress` in `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stresses {
    /// The vein with the largest one, from 1.
    pub vein: usize,
    /// The place along it, a fraction of its length.
    pub sigma: f64,
    /// The stresses there.
    #[serde(flatten)]
    pub largest: Stress,
    /// Those at all stations, a list per rod.
    #[serde(skip)]
    pub rods: Vec<Vec<Stress>>,
}

impl Stresses {
    /// Of rods at these stations; `None` if stiffnesses are given in place of sections.
    pub fn of(scenario: &Scenario, stations: &[f64], rods: &[RodShape]) -> Option<Self> {
        let stress = |(j, rod): (usize, &RodShape)| -> Option<Vec<Stress>> {
            let nodes = stations.iter().zip(&rod.nodes);
            let at = |(sigma, node): (&f64, &crate::shape::NodeState)| {
                Some(scenario.moduli(j, *sigma)?.stress(node.n, node.m))
            };
            nodes.map(at).collect()
        };
        let rods: Vec<_> = rods.iter().enumerate().map(stress).collect::<Option<_>>()?;
        let each = rods.iter().zip(1..);
        let all = each.flat_map(|(rod, vein)| {
            let here = stations.iter().zip(rod);
            here.map(move |(sigma, stress)| (vein, *sigma, *stress))
        });
        // The first of those that are equal.
        let larger = |one: (usize, f64, Stress), other: (usize, f64, Stress)| {
            if other.2.equivalent > one.2.equivalent {
                other
            } else {
                one
            }
        };
        let (vein, sigma, largest) = all.reduce(larger)?;
        Some(Stresses {
            vein,
            sigma,
            largest,
            rods,
        })
    }
}
