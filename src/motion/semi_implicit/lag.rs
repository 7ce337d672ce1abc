//! Accelerations that lag behind loads.

use super::SemiImplicit;
use crate::leaf::Loads;

impl SemiImplicit {
    /// Corrects the auxiliary accelerations for an attempted step of `h`. Under a load that is
    /// linear in time that of a free body is the acceleration alpha_f - alpha_m steps ago, and
    /// then the method has the exact impulse of the load. Where the load changes its slope, or
    /// steps change their length, the lag is another one: without a correction a pulse of few
    /// steps would have another impulse, and go on acting in the longer steps after it.
    pub(super) fn correct_lag(&mut self, h: f64) {
        if !self.physics.loads_change() {
            return;
        }
        let (now, w) = (self.time, self.weights);
        let [before, now, after] =
            [now - self.past_step, now, now + h].map(|t| self.physics.loads(t));
        let lag = ((after - now) - (now - before)) * (w.alpha_m - w.alpha_f);
        let change = lag - self.corrected;
        self.corrected = lag;
        if change != Loads::default() {
            self.accelerate(change);
        }
    }

    /// Adds the accelerations of free nodes under these loads.
    fn accelerate(&mut self, loads: Loads) {
        let n = self.leaf.segments();
        let force = |j: usize, i: usize| {
            let weight = self.leaf.grid.weight(i) * self.leaf.leaf.length(j);
            weight * self.leaf.leaf.share(j) * loads.gravity
        };
        let rods = 0..self.leaf.rods();
        // The shared tip, if there is one.
        let mut tip = (loads.tip_force, 0.0);
        for j in rods {
            tip.0 += force(j, n);
            tip.1 += self.inertia[self.state.base(j) + n].mass;
        }
        let together = self.leaf.tips_move_together();
        for (j, i) in self.leaf.each(1..=n) {
            let k = self.state.base(j) + i;
            let [turns, shifts] = self.leaf.moves(i);
            let mass = self.inertia[k].mass;
            let linear = match i == n {
                true if together => tip.0 / tip.1,
                true => (force(j, i) + loads.tip_force) / mass,
                false => force(j, i) / mass,
            };
            if shifts {
                self.moving[k].a[1] += linear;
            }
            if i == n && turns && self.leaf.rods() == 1 {
                let tensor = self.inertia[k].tensor(self.state.q[k]);
                self.moving[k].a[0] += tensor.inverse() * loads.tip_moment;
            }
        }
    }
}
