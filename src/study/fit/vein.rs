//! A vein as a curve on which the nearest point to a traced one is looked for.

use glam::DVec3;

use crate::relax::AtRest;

/// Places along a vein that are tried first.
const PLACES: usize = 64;

/// Iterations to the nearest point between them.
const ITERATIONS: usize = 60;

/// A vein at many places.
pub(super) struct Vein<'a> {
    at: &'a AtRest,
    rod: usize,
    places: Vec<DVec3>,
}

/// The point of a rod at a fraction of its length, in the scenario's units.
fn point(at: &AtRest, rod: usize, sigma: f64) -> DVec3 {
    let stencils = at.stencils(sigma);
    let length = at.levels[0].leaf.leaf.scale.length;
    let best = at.best(|k, level| {
        let base = level.state.base(rod);
        stencils[k].value(|i| level.state.x[base + i])
    });
    best * length
}

impl<'a> Vein<'a> {
    pub fn of(at: &'a AtRest, rod: usize) -> Self {
        let place = |k: usize| point(at, rod, k as f64 / PLACES as f64);
        Vein {
            at,
            rod,
            places: (0..=PLACES).map(place).collect(),
        }
    }

    pub fn at(&self, sigma: f64) -> DVec3 {
        point(self.at, self.rod, sigma)
    }

    /// The fraction of the length nearest to a point of which these coordinates were
    /// seen, and whether it lies between the ends.
    pub fn nearest(&self, seen: [Option<f64>; 3]) -> (f64, bool) {
        let square = |x: DVec3| -> f64 {
            let axes = seen.iter().enumerate();
            axes.filter_map(|(axis, value)| Some((x[axis] - (*value)?).powi(2)))
                .sum()
        };
        let distances: Vec<f64> = self.places.iter().map(|place| square(*place)).collect();
        let order = |a: &usize, b: &usize| distances[*a].total_cmp(&distances[*b]);
        let best = (0..=PLACES).min_by(order).unwrap_or(0);
        let step = 1.0 / PLACES as f64;
        let place = |k: usize| k as f64 * step;
        let (mut low, mut high) = (place(best.saturating_sub(1)), place((best + 1).min(PLACES)));
        // Where the distance stops falling: along the vein it has one minimum here.
        let falls = |sigma: f64| {
            let stencils = self.at.stencils(sigma);
            let length = self.at.levels[0].leaf.leaf.scale.length;
            let slope = self.at.best(|k, level| {
                let base = level.state.base(self.rod);
                stencils[k].slope(|i| level.state.x[base + i])
            }) * length;
            let x = self.at(sigma);
            let axes = seen.iter().enumerate();
            let terms = axes.filter_map(|(axis, value)| Some((x[axis] - (*value)?) * slope[axis]));
            terms.sum::<f64>() < 0.0
        };
        if falls(high) && high == 1.0 {
            return (1.0, false);
        }
        if !falls(low) && low == 0.0 {
            return (0.0, false);
        }
        for _ in 0..ITERATIONS {
            let middle = 0.5 * (low + high);
            match falls(middle) {
                true => low = middle,
                false => high = middle,
            }
        }
        (0.5 * (low + high), true)
    }
}
