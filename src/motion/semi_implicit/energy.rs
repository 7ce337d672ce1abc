//! What an accepted step exchanges: the energy that friction and damping dissipate, and the work of loads, rest
//! shapes, wind and supports that change or move.

use crate::leaf::{NodalMoment, State};
use crate::motion::moving_supports::MovingSupports;
use crate::motion::semi_implicit::SemiImplicit;
use crate::motion::{Exchange, rate_weights};
use crate::rod::Section;
use crate::rotation;
use glam::DVec3;

impl SemiImplicit {
    /// What the accepted step of `h`, with these strains at its end where they have friction, exchanged.
    pub(super) fn step_energy_exchange(
        &mut self,
        h: f64,
        strains: Option<&[[DVec3; 2]]>,
    ) -> Exchange {
        let mut exchange = Exchange {
            dissipated: self.physics.damping * self.momentum_times_displacement(),
            work: self.varying_load_work(h) + self.work_of_wind(h) + self.work_of_followers(h),
        };
        exchange.work += self.work_of_supports();
        if let Some(strains) = strains {
            exchange.dissipated += self.work_of_friction(h, strains);
        }
        exchange
    }

    /// Work of changing loads and rest shapes in the accepted step of `h`: that on the mean of
    /// the states before (the trial) and after.
    fn varying_load_work(&mut self, h: f64) -> f64 {
        let (from, to) = (self.clock.time, self.clock.time + h);
        let mut work = 0.0;
        if self.physics.loads_vary() {
            let mut potential = |time: f64| {
                self.physics.apply_loads(&mut self.leaf, time);
                self.leaf.potential(&self.trial) + self.leaf.potential(&self.state)
            };
            let before = potential(from);
            work += 0.5 * (potential(to) - before);
        }
        if self.physics.rest_curvature_varies() {
            let bending =
                |rest: f64| self.bending(&self.trial, rest) + self.bending(&self.state, rest);
            work += 0.5
                * (bending(self.physics.rest_curvature_factor(to))
                    - bending(self.physics.rest_curvature_factor(from)));
        }
        for time in [from, to] {
            self.physics.apply_loads(&mut self.leaf, time);
            let moments = self.leaf.dead_moments_under(self.leaf.loads);
            for NodalMoment { node, moment } in moments {
                let turn = rotation::log(self.state.q[node] * self.trial.q[node].conjugate());
                work += 0.5 * moment.dot(turn);
            }
        }
        work
    }

    /// Energy of bending in a state with the rest curvatures times `rest`.
    fn bending(&self, state: &State, rest: f64) -> f64 {
        let segments = self.leaf.rod_index_pairs(0..self.leaf.segments());
        let energy = |((j, i), own): (_, &Section)| {
            let u = self.leaf.segment(state, j, i, DVec3::ZERO).u;
            let bent = u - rest * own.rest_curvature;
            0.5 * own.ds * bent.dot(own.couple_stiffness * bent)
        };
        segments.zip(&self.sections).map(energy).sum()
    }

    /// The work of internal friction in the accepted step of `h`: the mean of its stresses at both ends times
    /// the change of the strains. Rates that decay within the step, as after a landing, count with the strain
    /// over which they do, not with the time of the step.
    fn work_of_friction(&mut self, h: f64, strains: &[[DVec3; 2]]) -> f64 {
        let [c0, c1, c2] = rate_weights(h, self.past_step);
        let mut work = 0.0;
        for (i, now) in strains.iter().enumerate() {
            let section = &self.sections[i];
            // Not against strains that are suppressed.
            let resistance = |compliance: f64| {
                if compliance > 0.0 {
                    compliance.recip()
                } else {
                    0.0
                }
            };
            let stiffness = [
                DVec3::from_array(section.compliance.to_array().map(resistance)),
                section.couple_stiffness,
            ];
            for (kind, stiffness) in stiffness.into_iter().enumerate() {
                let [last, before] = self.strain_history.each_ref().map(|it| it[i][kind]);
                let rate = c0 * now[kind] + c1 * last + c2 * before;
                let mean = 0.5 * (self.strain_rates[i][kind] + rate);
                work += section.ds * (stiffness * mean).dot(now[kind] - last);
                self.strain_rates[i][kind] = rate;
            }
        }
        self.physics.retardation * work
    }

    /// The mean momentum of the accepted step times its displacement: the work of
    /// external damping over its rate. It contains nothing of the unresolved motion,
    /// which alternates.
    fn momentum_times_displacement(&self) -> f64 {
        let mut sum = 0.0;
        for (k, inertia) in self.inertia.iter().enumerate() {
            let (before, after) = (&self.next_node_motions[k], &self.node_motions[k]);
            let mean = |c: usize| 0.5 * (before.v[c] + after.v[c]);
            let turn = rotation::log(self.state.q[k] * self.trial.q[k].conjugate());
            let shift = self.state.x[k] - self.trial.x[k];
            let shift = MovingSupports::free_part(&self.supports, k, shift);
            if !MovingSupports::holds_rotation(&self.supports, k) {
                sum += turn.dot(inertia.tensor(self.state.q[k]) * mean(0));
            }
            sum += inertia.mass * shift.dot(mean(1));
            if inertia.is_off_axis() {
                let s = inertia.first_moment(self.state.q[k]);
                if !MovingSupports::holds_rotation(&self.supports, k) {
                    sum += turn.dot(s.cross(mean(1)));
                }
                sum += shift.dot(mean(0).cross(s));
            }
        }
        sum
    }

    /// Work of the loads that turn with the sections, and of moments along veins, in the accepted step of `h`,
    /// from the trial: the mean of the loads before and after it, times the displacement.
    fn work_of_followers(&mut self, h: f64) -> f64 {
        if !self.leaf.has_followers() {
            return 0.0;
        }
        // The leaf has the loads at the end of the step.
        let after = self.follower_work(&self.state);
        let varies = self.leaf.leaf.scenario().has_followers_in_time();
        if varies {
            self.physics.apply_loads(&mut self.leaf, self.clock.time);
        }
        let before = self.follower_work(&self.trial);
        if varies {
            self.physics
                .apply_loads(&mut self.leaf, self.clock.time + h);
        }
        0.5 * (before + after)
    }

    /// The work that the present loads without a potential, as they are turned in a state, would do in the accepted
    /// step, from the trial.
    fn follower_work(&self, turned: &State) -> f64 {
        let work = |(j, i)| {
            let k = self.state.base(j) + i;
            let load = self.leaf.follower_wrench(turned, j, i);
            let turn = rotation::log(self.state.q[k] * self.trial.q[k].conjugate());
            let shift = self.state.x[k] - self.trial.x[k];
            load.moment.dot(turn) + load.force.dot(shift)
        };
        // Also on bases, whose supports may move.
        let nodes = self.leaf.rod_index_pairs(0..self.leaf.segments() + 1);
        nodes.map(work).sum()
    }

    /// Work of the wind in the accepted step of `h`, from the trial: the mean of the forces before
    /// and after it, times the displacement.
    fn work_of_wind(&self, h: f64) -> f64 {
        let Some(wind) = &self.wind else { return 0.0 };
        let [from, to] = [self.clock.time, self.clock.time + h].map(|time| self.physics.air(time));
        let before = wind.drags(&self.trial, from, |k| self.next_node_motions[k].v[1]);
        let after = wind.drags(&self.state, to, |k| self.node_motions[k].v[1]);
        let pairs = before.zip(after).map(|(((j, i), before), (_, after))| {
            let node = self.state.base(j) + i;
            // What presses on a support that moves does no work on the leaf.
            let moved = |k: usize| {
                let shift = self.state.x[k] - self.trial.x[k];
                MovingSupports::free_part(&self.supports, k, shift)
            };
            let force = 0.5 * (before.force() + after.force());
            force.dot(0.5 * (moved(node) + moved(node + 1)))
        });
        pairs.sum()
    }
}
