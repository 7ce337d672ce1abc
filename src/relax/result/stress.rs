//! The largest stresses along the veins.

use crate::largest::largest;
use crate::relax::nested::NestedEquilibrium;
use crate::relax::result::reaction::extrapolated;
use crate::relax::transfer::level::Level;
use crate::relax::transfer::strains;
use crate::scenario::{Moduli, Scenario, Stress};
use crate::shape::RodShape;
use glam::DVec3;
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
    /// Bound on the error of any of them; `None` on a single grid.
    pub error: Option<f64>,
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
            error: None,
            rods,
        })
    }

    /// With the error by those of forces and moments anywhere: a stress is a norm of both.
    pub fn within(self, scenario: &Scenario, errors: Option<[f64; 2]>) -> Self {
        let Some([force, moment]) = errors else {
            return self;
        };
        let moduli = scenario.moduli(self.vein - 1, self.sigma);
        let along_all = |size: f64| DVec3::splat(size);
        let error = moduli.map(|it| it.stress(along_all(force), along_all(moment)).equivalent);
        Stresses { error, ..self }
    }

    /// With the error of a leaf on nested grids: that of the stresses at the nodes of the coarsest,
    /// and the distance of these from their extrapolation.
    pub(in crate::relax) fn on_grids(self, scenario: &Scenario, found: &NestedEquilibrium) -> Self {
        let sigma = found.levels[0].leaf.grid.sigma();
        let (rods, scale) = (self.rods.len(), found.levels[0].leaf.leaf.scale);
        let moduli: Option<Vec<Moduli>> = (0..rods)
            .flat_map(|j| sigma.iter().map(move |at| scenario.moduli(j, *at)))
            .collect();
        let Some(moduli) = moduli else {
            return self;
        };
        let stress = |k: usize, [n, m]: [DVec3; 2]| {
            let stress = moduli[k].stress(n * scale.force(), m * scale.moment());
            DVec3::new(stress.normal, stress.shear, stress.equivalent)
        };
        let nodes = || (0..rods).flat_map(|j| (0..sigma.len()).map(move |i| (j, i)));
        let on = |level: &Level| -> Vec<DVec3> {
            let stride = level.leaf.segments() / (sigma.len() - 1);
            let resultants = |(j, i)| strains::resultants(&level.leaf, &level.state, j, i * stride);
            nodes()
                .enumerate()
                .map(|(k, at)| stress(k, resultants(at)))
                .collect()
        };
        let (extrapolated, error) = extrapolated(&found.levels, on, [found.history.remaining, 0.0]);
        let error = match (&error, found.integrated()) {
            (None, Some((estimate, _))) => {
                // A single grid is compared with the leaf that was integrated from it.
                let stride = estimate.grid.segments() / (sigma.len() - 1);
                let off = nodes().enumerate().map(|(k, (j, i))| {
                    let at = &estimate.rods[j][i * stride];
                    let along = [at.n, at.m].map(|it| at.q.conjugate() * it);
                    stress(k, along).distance(extrapolated[k])
                });
                Some(largest(off))
            }
            _ => error,
        };
        let told = self.largest.equivalent;
        let peak = largest(extrapolated.iter().map(|it| it.z));
        // Between the nodes of the coarsest grid stresses may be larger, but not those at a node.
        let off = match sigma.contains(&self.sigma) {
            true => (told - peak).abs(),
            false => 0.0,
        };
        Stresses {
            error: error.map(|error| error + off),
            ..self
        }
    }
}
