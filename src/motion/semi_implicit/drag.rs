//! The drag of wind in a step, and its work.

use super::SemiImplicit;
use glam::DVec3;

impl SemiImplicit {
    /// Adds the drag on the trial, which has the velocities at the end of the step, in the air of a
    /// time to the equations; the derivative of a velocity by the displacement is `rate`. The
    /// derivative by the direction of the rod is left out: it makes the matrix unsymmetric, and is
    /// small beside that of inertia in steps that resolve the motion.
    pub(super) fn add_drag(&mut self, time: f64, rate: f64) {
        let Some(wind) = &self.wind else { return };
        let (leaf, system, moving) = (&self.leaf, &mut self.system, &self.next_moving);
        let moves = |j: usize, i: usize| leaf.moves(j, i)[1];
        let air = self.physics.air(time);
        for ((j, i), drag) in wind.drags(&self.trial, air, |k| moving[k].v[1]) {
            let (half, stiffness) = (0.5 * drag.force(), 0.25 * rate * drag.by_velocity());
            let free = [moves(j, i), moves(j, i + 1)];
            for (node, free) in [i, i + 1].into_iter().zip(free) {
                if free {
                    system.add_load(j, node, [DVec3::ZERO, half]);
                    system.hold(j, node, stiffness);
                }
            }
            if free == [true; 2] {
                system.hold_together(j, i, stiffness);
            }
        }
    }

    /// Work of the wind in the accepted step of `h`, from the trial: the mean of the forces before
    /// and after it, times the displacement.
    pub(super) fn work_of_wind(&self, h: f64) -> f64 {
        let Some(wind) = &self.wind else { return 0.0 };
        let [from, to] = [self.time, self.time + h].map(|time| self.physics.air(time));
        let before = wind.drags(&self.trial, from, |k| self.next_moving[k].v[1]);
        let after = wind.drags(&self.state, to, |k| self.moving[k].v[1]);
        let pairs = before.zip(after).map(|(((j, i), before), (_, after))| {
            let node = self.state.base(j) + i;
            let moved = |k: usize| self.state.x[k] - self.trial.x[k];
            let force = 0.5 * (before.force() + after.force());
            force.dot(0.5 * (moved(node) + moved(node + 1)))
        });
        pairs.sum()
    }
}
