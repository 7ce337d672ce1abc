//! Loads with which searches for modes begin.

use super::Vibration;

impl Vibration<'_> {
    /// A load that excites all approximate modes not found yet.
    pub(super) fn near_start(&self, found: usize) -> Vec<f64> {
        let mut load = vec![0.0; self.pattern.size()];
        for near in &self.near[found..] {
            (load.iter_mut().zip(near)).for_each(|(load, near)| *load += near);
        }
        self.masses.times(&load)
    }

    /// A load without any symmetry, different in every search.
    pub(super) fn start(&self, search: usize) -> Vec<f64> {
        // Multiples of the golden ratio spread evenly: no symmetry, no chance.
        let golden = |k: usize| (k as f64 * 0.618_033_988_749_895).fract() - 0.5;
        let mut load = vec![0.0; self.pattern.size()];
        for (j, i) in self.leaf.each(self.leaf.moving_nodes()) {
            let sigma = self.leaf.grid.sigma()[i];
            let wave = (7.0 * search as f64 * sigma).sin();
            for (c, at) in self.pattern.unknowns(j, i).into_iter().enumerate() {
                let k = 18 * (j + 97 * search) + c;
                load[at] += golden(k + 1) + sigma * golden(k + 7) + wave * golden(k + 13);
            }
        }
        self.masses.times(&load)
    }
}
