//! The largest stresses along the veins.

use crate::largest::{larger, largest};
use crate::leaf::Scale;
use crate::relax::accuracy::defect::Estimate;
use crate::relax::nested::NestedEquilibrium;
use crate::relax::result::reaction::extrapolated;
use crate::relax::transfer::level::Level;
use crate::relax::transfer::strains;
use crate::scenario::{Moduli, Scenario, Stress};
use crate::shape::{RodShape, SAME_STATION};
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

    /// With the error of a leaf that was integrated along its rods to these stations, from those of its
    /// forces and moments: a stress is a norm of both, and may be the largest at another station.
    fn integrated(
        self,
        (scenario, stations): (&Scenario, &[f64]),
        (estimate, safety): (&Estimate, f64),
        scale: Scale,
    ) -> Self {
        let places = estimate.errors[0].len() - 1;
        let (nodes, sigma) = (estimate.grid.segments(), estimate.grid.sigma());
        let error = |j: usize, station: f64| -> Option<f64> {
            let i = sigma
                .partition_point(|at| *at < station - SAME_STATION)
                .min(nodes);
            let fields = &estimate.rods[j][i];
            let along = |it: DVec3| fields.q.conjugate() * it;
            let moduli = scenario.moduli(j, station)?;
            let at = |place: usize| {
                let [_, turn, n, m] = estimate.errors[j][place];
                let force = along(n - turn.cross(fields.n)) * scale.force();
                let moment = along(m - turn.cross(fields.m)) * scale.moment();
                safety * moduli.stress(force, moment).equivalent
            };
            let place = i * places / nodes;
            let next = (i * places).div_ceil(nodes);
            Some(larger(at(place), at(next)))
        };
        let mut most = error(self.vein - 1, self.sigma);
        for (j, rod) in self.rods.iter().enumerate() {
            for (&station, stress) in stations.iter().zip(rod) {
                let reached = error(j, station).map(|error| stress.equivalent + error);
                let above = reached.map(|reached| reached - self.largest.equivalent);
                most = most.zip(above).map(|(most, above)| larger(most, above));
            }
        }
        Stresses {
            error: most,
            ..self
        }
    }

    /// With the error of a leaf on nested grids at these stations: where it was not integrated that of
    /// the stresses at the nodes of the coarsest, and the distance of these from their extrapolation.
    pub(in crate::relax) fn on_grids(
        self,
        scenario: &Scenario,
        stations: &[f64],
        found: &NestedEquilibrium,
    ) -> Self {
        let scale = found.levels[0].leaf.leaf.scale;
        if let Some(errors) = found
            .field_errors()
            .filter(|_| found.integrated().is_some())
        {
            return self.integrated((scenario, stations), errors, scale);
        }
        let sigma = found.levels[0].leaf.grid.sigma();
        let rods = self.rods.len();
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
