//! Motion to a given time, and snapshots.

use super::Explicit;
use super::applied::Applied;
use super::kernel::Forces;
use super::packs::vector;
use crate::leaf::State;
use crate::limit::Limit;
use crate::motion::energy_balance::{Exchange, measure, resolved};
use crate::motion::method::{TimeIntegrator, Snapshot, Stopped, Velocity};
use glam::DVec3;

/// Part of a step below which differences of time are rounding.
const NO_TIME: f64 = 1e-9;

/// Advice if energy grows, besides a shorter step.
const OTHERWISE: &str = "the semi-implicit method";

/// Steps between checks of the bending, which are free, and of the energy.
const BENDING_CHECKED: usize = 200;
const ENERGY_CHECKED: usize = 2000;

impl Explicit {
    /// Positions, rotations and segment forces.
    pub fn now(&mut self) -> State {
        let rest = self.physics.rest(self.stepped);
        let (law, layout) = (self.law(rest, false), self.layout);
        let mut forces = Vec::with_capacity(layout.rods * layout.segments);
        for (p, pack) in self.packs.iter_mut().enumerate() {
            self.arch.dispatch(Forces {
                layout,
                pack: p,
                positions: &self.positions,
                motion: &pack.motion,
                material: &pack.material,
                past: &mut pack.past,
                law,
                forces: &mut forces,
            });
        }
        let mut state = self.state();
        state.n = forces.into_iter().map(DVec3::from).collect();
        state
    }

    pub(super) fn state(&self) -> State {
        let n = self.leaf.segments();
        let nodes = || self.leaf.each(0..=n);
        let x = nodes().map(|(j, i)| vector(&self.positions, self.layout.at(j, i)));
        let q = nodes().map(|(j, i)| self.rotation(j, i));
        State::new(n, x.collect(), q.collect())
    }

    /// The present state, if the motion is reliable in it.
    fn judged(&mut self) -> Result<Snapshot, Stopped> {
        let now = self.snapshot();
        (self.balance).judge(&self.leaf, &self.physics, &now, self.step, OTHERWISE)?;
        // In the balance rotations are at most pi, as in space.
        resolved(&self.leaf, self.time, self.largest_turn())?;
        Ok(now)
    }
}

impl TimeIntegrator for Explicit {
    fn time(&self) -> f64 {
        self.time
    }

    fn steps(&self) -> usize {
        self.steps
    }

    fn set_limit(&mut self, limit: Limit) {
        self.limit = limit;
    }

    fn advance(&mut self, until: f64) -> Result<Snapshot, Stopped> {
        let h = self.step;
        loop {
            // Times are multiples of the step, so that rounding does not accumulate.
            let next = self.begin.0 + h * (self.steps + 1 - self.begin.1) as f64;
            if next > until + NO_TIME * h {
                break;
            }
            if self.limit.reached() {
                return Err(Stopped::Interrupted { time: self.time });
            }
            let (exchange, _) = self.kick_and_drift(h);
            self.balance.add(exchange);
            self.steps += 1;
            (self.stepped, self.time) = (next, next);
            let applied = self.applied.as_ref();
            if let Some(half_turn) = applied.and_then(|it| it.half_turn(&self.leaf)) {
                let time = self.time;
                return Err(Stopped::HalfTurn { time, half_turn });
            }
            let suspect = self.steps.is_multiple_of(BENDING_CHECKED) && !self.trusted();
            if suspect || self.steps.is_multiple_of(ENERGY_CHECKED) {
                self.judged()?;
            }
        }
        self.time = until.max(self.time);
        self.judged()
    }

    fn snapshot(&mut self) -> Snapshot {
        let packs = self.packs.iter();
        let moving: Vec<_> = packs.map(|p| (p.motion.clone(), p.past.clone())).collect();
        let past = self.applied.as_ref().map(Applied::past);
        let path = (self.positions.clone(), moving);
        let (time, widths, work) = (self.stepped, self.widths, self.work);
        let mut exchange = Exchange::default();
        let left = self.time - self.stepped;
        if left > NO_TIME * self.step {
            exchange += self.kick_and_drift(left).0;
        }
        self.stepped = self.time;
        exchange += self.kick(0.0, 0.0, false).0;
        exchange.work += self.work_now();
        let state = self.now();
        let places = self.leaf.each(0..=self.leaf.segments());
        let places = places.map(|(j, i)| self.layout.place(j, i));
        let velocity: Vec<Velocity> = places.map(|(p, at)| self.packs[p].velocity(at)).collect();
        self.positions = path.0;
        for (pack, moving) in self.packs.iter_mut().zip(path.1) {
            (pack.motion, pack.past) = moving;
        }
        if let (Some(applied), Some(past)) = (&mut self.applied, past) {
            applied.set_past(past);
        }
        (self.stepped, self.widths, self.work) = (time, widths, work);
        let energy = measure(&mut self.leaf, &self.physics, self.time, &state, &velocity);
        Snapshot {
            time: self.time,
            energy: self.balance.complete(energy, exchange),
            state,
            velocity,
        }
    }
}
