//! Work and dissipation of a step.

use super::super::energy_balance::Exchange;
use super::super::friction::rates;
use super::{SemiImplicit, Steps};
use crate::leaf::{Loads, State};
use crate::rod::Section;
use crate::rotation;
use glam::DVec3;

impl SemiImplicit {
    /// Strains (v, u) of all segments.
    pub(super) fn strains(&self) -> Vec<[DVec3; 2]> {
        let (leaf, state, n) = (&self.leaf, &self.state, self.leaf.segments());
        let strains = |(j, i)| {
            let segment = leaf.segment(state, j, i, state.n[j * n + i]);
            [segment.v(leaf.section(j, i)), segment.u]
        };
        leaf.each(0..n).map(strains).collect()
    }

    /// Accepts the attempted step of `h` and updates the energy balance, unless steps are only
    /// counted.
    pub(super) fn accept(&mut self, h: f64) {
        std::mem::swap(&mut self.state, &mut self.trial);
        std::mem::swap(&mut self.moving, &mut self.next_moving);
        if !matches!(self.steps, Steps::ToCount(_)) {
            let exchange = self.exchange(h);
            self.balance.add(exchange);
        }
        if self.physics.retardation > 0.0 {
            self.past.swap(0, 1);
            self.past[0] = self.strains();
        }
        self.corrected = Loads::default();
        self.past_step = h;
        self.longest_made = self.longest_made.max(h);
        self.time += h;
        self.count += 1;
    }

    /// What the accepted step of `h` exchanged.
    fn exchange(&mut self, h: f64) -> Exchange {
        let mut exchange = Exchange {
            dissipated: self.physics.damping * self.momentum_times_displacement(),
            work: self.work_of_changes(h) + self.work_of_wind(h),
        };
        if self.physics.retardation > 0.0 {
            let power = self.power_of_friction(h);
            exchange.dissipated += 0.5 * h * (self.friction_power + power);
            self.friction_power = power;
        }
        exchange
    }

    /// Work of changing loads and rest shapes in the accepted step of `h`: that on the mean of
    /// the states before (the trial) and after.
    fn work_of_changes(&mut self, h: f64) -> f64 {
        let (from, to) = (self.time, self.time + h);
        let mut work = 0.0;
        if self.physics.loads_change() {
            let mut potential = |loads: Loads| {
                self.leaf.loads = loads;
                self.leaf.potential(&self.trial) + self.leaf.potential(&self.state)
            };
            let before = potential(self.physics.loads(from));
            work += 0.5 * (potential(self.physics.loads(to)) - before);
        }
        if self.physics.rest_changes() {
            let bending =
                |rest: f64| self.bending(&self.trial, rest) + self.bending(&self.state, rest);
            work += 0.5 * (bending(self.physics.rest(to)) - bending(self.physics.rest(from)));
        }
        for time in [from, to] {
            for (node, moment) in self.leaf.moments_of(self.physics.loads(time)) {
                let turn = rotation::log(self.state.q[node] * self.trial.q[node].conjugate());
                work += 0.5 * moment.dot(turn);
            }
        }
        work
    }

    /// Energy of bending in a state with the rest curvatures times `rest`.
    fn bending(&self, state: &State, rest: f64) -> f64 {
        let segments = self.leaf.each(0..self.leaf.segments());
        let energy = |((j, i), own): (_, &Section)| {
            let u = self.leaf.segment(state, j, i, DVec3::ZERO).u;
            let bent = u - rest * own.rest_curvature;
            0.5 * own.ds * bent.dot(own.couple_stiffness * bent)
        };
        segments.zip(&self.sections).map(energy).sum()
    }

    /// Power of internal friction at the end of a step of `h`.
    fn power_of_friction(&self, h: f64) -> f64 {
        let [c0, c1, c2] = rates(h, self.past_step);
        let mut power = 0.0;
        for (i, now) in self.strains().iter().enumerate() {
            let section = &self.sections[i];
            let rate = |kind: usize| {
                c0 * now[kind] + c1 * self.past[0][i][kind] + c2 * self.past[1][i][kind]
            };
            let (v, u) = (rate(0), rate(1));
            for c in 0..3 {
                if section.compliance[c] > 0.0 {
                    power += section.ds * v[c] * v[c] / section.compliance[c];
                }
                power += section.ds * u[c] * u[c] * section.couple_stiffness[c];
            }
        }
        self.physics.retardation * power
    }

    /// The mean momentum of the accepted step times its displacement: the work of
    /// external damping over its rate. It contains nothing of the unresolved motion,
    /// which alternates.
    fn momentum_times_displacement(&self) -> f64 {
        let mut sum = 0.0;
        for (k, inertia) in self.inertia.iter().enumerate() {
            let (before, after) = (&self.next_moving[k], &self.moving[k]);
            let mean = |c: usize| 0.5 * (before.v[c] + after.v[c]);
            let turn = rotation::log(self.state.q[k] * self.trial.q[k].conjugate());
            let shift = self.state.x[k] - self.trial.x[k];
            sum += turn.dot(inertia.tensor(self.state.q[k]) * mean(0));
            sum += inertia.mass * shift.dot(mean(1));
        }
        sum
    }
}
