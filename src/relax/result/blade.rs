//! What follows from the outline and the material of a blade, as a part of a result.

use crate::scenario::{Blade, Scenario};
use serde::Serialize;

/// A blade: the stiffnesses that follow from it at its widest place, and what its division into veins
/// matters. As JSON it is `blade` in `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BladeReport {
    /// The largest width.
    pub width: f64,
    /// Width of the strip of each vein there.
    pub strip_width: f64,
    /// A1, A2 and A3 there of the vein in the middle.
    pub couple_stiffness: [f64; 3],
    /// H1, H2 and H3.
    pub force_stiffness: [f64; 3],
    /// k1, k2, k3 and c1 of the tissue beside it there; none of a single vein.
    pub tissue: Option<[f64; 4]>,
    /// Stiffness of the whole blade there against bending out of its surface: the sum of A2.
    pub bending: f64,
    /// And against twisting: the sum of A1.
    pub torsion: f64,
    /// The mass, if the material has one.
    pub mass: Option<f64>,
    /// The width below which it is as stiff as there; none if it is wider everywhere.
    pub least_width: Option<f64>,
    /// By how much centerlines move if that is half as much, if it is known.
    pub least_width_effect: Option<f64>,
    /// The same blade with half as many veins, if that is known.
    pub half_as_many: Option<FewerVeins>,
}

/// A blade with fewer veins.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FewerVeins {
    /// The number of veins.
    pub rods: usize,
    /// The largest distance of their centerlines from the surface of the blade with all veins.
    pub difference: f64,
}

impl BladeReport {
    /// Of a scenario, without what other relaxations tell; `None` if it has no blade.
    pub fn of(scenario: &Scenario) -> Option<Self> {
        let blade: &Blade = scenario.blade.as_ref()?;
        let (rods, middle) = (&scenario.rods, scenario.rods.len() / 2);
        let sigma = blade.widest();
        let at =
            |profiles: &[crate::scenario::Profile; 3]| profiles.each_ref().map(|of| of.at(sigma));
        let tissue = |all: &Vec<crate::scenario::Tissue>| {
            let gap = &all[middle.min(all.len() - 1)];
            gap.profiles().map(|of| of.at(sigma))
        };
        let sum = |axis: usize| {
            rods.iter()
                .map(|rod| rod.couple_stiffness[axis].at(sigma))
                .sum()
        };
        let masses = rods.iter().zip(&scenario.dynamics.density);
        let mass = masses.map(|(rod, density)| rod.length * density.integral(1.0));
        let width = blade.bearing_width(sigma);
        Some(BladeReport {
            width,
            strip_width: width / rods.len() as f64,
            couple_stiffness: at(&rods[middle].couple_stiffness),
            force_stiffness: at(&rods[middle].force_stiffness),
            tissue: scenario.tissue.as_ref().map(tissue),
            bending: sum(1),
            torsion: sum(0),
            mass: blade.has_mass().then(|| mass.sum()),
            least_width: blade.least_width(),
            least_width_effect: None,
            half_as_many: None,
        })
    }
}
