//! Motion to a given time, snapshots, and saved states.

use super::Explicit;
use crate::leaf::State;
use crate::motion::energy_balance::{Exchange, measure, resolved};
use crate::motion::kernel::{Forces, Layout};
use crate::motion::method::{Method, Snapshot, Stopped, Velocity};
use crate::motion::nodes::vector;
use glam::DVec3;

/// Part of a step below which differences of time are rounding.
const NO_TIME: f64 = 1e-9;

/// Advice if energy grows, besides a shorter step.
const OTHERWISE: &str = "the semi-implicit method";

/// Steps between checks of the bending, which are free, and of the energy.
const BENDING_CHECKED: usize = 200;
const ENERGY_CHECKED: usize = 2000;

impl Explicit {
    /// Forces of all segments at the present positions, rod by rod. Strains
    /// are stored as those of the last step if `remember`.
    pub(super) fn forces(&mut self, remember: bool) -> Vec<DVec3> {
        let rest = self.physics.rest(self.stepped);
        let (law, layout) = (self.law(rest, remember), self.layout);
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
        forces.into_iter().map(DVec3::from).collect()
    }

    /// Positions, rotations and segment forces.
    pub fn now(&mut self) -> State {
        let mut state = self.state();
        state.n = self.forces(false);
        state
    }

    pub(super) fn state(&self) -> State {
        let n = self.leaf.segments();
        let nodes = || self.leaf.each(0..=n);
        let x = nodes().map(|(j, i)| vector(&self.positions, self.layout.at(j, i)));
        let q = nodes().map(|(j, i)| self.rotation(j, i));
        State::new(n, x.collect(), q.collect())
    }

    fn judge(&mut self) -> Result<(), Stopped> {
        let now = self.snapshot();
        (self.balance).judge(&self.leaf, &self.physics, &now, self.step, OTHERWISE)?;
        self.last_snapshot = Some(now);
        // In the balance rotations are at most pi, as in space.
        resolved(&self.leaf, self.time, self.largest_turn())
    }
}

impl Method for Explicit {
    fn time(&self) -> f64 {
        self.time
    }

    fn steps(&self) -> usize {
        self.steps
    }

    fn advance(&mut self, until: f64) -> Result<(), Stopped> {
        let h = self.step;
        loop {
            // Times are multiples of the step, so that rounding does not accumulate.
            let next = self.begin.0 + h * (self.steps + 1 - self.begin.1) as f64;
            if next > until + NO_TIME * h {
                break;
            }
            let (exchange, _) = self.kick_and_drift(h);
            self.balance.add(exchange);
            self.steps += 1;
            (self.stepped, self.time) = (next, next);
            let suspect = self.steps.is_multiple_of(BENDING_CHECKED) && !self.trusted();
            if suspect || self.steps.is_multiple_of(ENERGY_CHECKED) {
                self.judge()?;
            }
        }
        self.time = until.max(self.time);
        self.judge()
    }

    fn snapshot(&mut self) -> Snapshot {
        if let Some(last) = self.last_snapshot.take()
            && last.time == self.time
        {
            return last;
        }
        let packs = self.packs.iter();
        let moving: Vec<_> = packs.map(|p| (p.motion.clone(), p.past.clone())).collect();
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
        (self.stepped, self.widths, self.work) = (time, widths, work);
        let energy = measure(&mut self.leaf, &self.physics, self.time, &state, &velocity);
        Snapshot {
            time: self.time,
            energy: self.balance.complete(energy, exchange),
            state,
            velocity,
        }
    }

    fn save(&self) -> Vec<f64> {
        // How the arrays are laid out, by which others are recognised.
        let Layout { stride, pack, .. } = self.layout;
        let mut numbers = vec![
            stride as f64,
            pack as f64,
            self.stepped,
            self.time,
            self.steps as f64,
            self.begin.0,
            self.begin.1 as f64,
            self.widths[0],
            self.widths[1],
        ];
        numbers.extend(self.work.save());
        numbers.extend(self.balance.save());
        let moving = self.packs.iter().flat_map(|pack| pack.moving_arrays());
        numbers.extend(
            self.positions
                .iter()
                .chain(moving)
                .flat_map(|array| array.iter()),
        );
        numbers
    }

    fn restore(&mut self, numbers: &[f64]) -> bool {
        let own = self.save();
        if numbers.len() != own.len() || numbers[..2] != own[..2] {
            return false;
        }
        let mut numbers = numbers[2..].iter().copied();
        let mut next = || numbers.next().unwrap_or_default();
        self.stepped = next();
        self.time = next();
        self.steps = next() as usize;
        self.begin = (next(), next() as usize);
        self.widths = [next(), next()];
        self.work.restore(&mut next);
        self.balance.restore(&mut next);
        self.last_snapshot = None;
        let moving = self
            .packs
            .iter_mut()
            .flat_map(|pack| pack.moving_arrays_mut());
        let arrays = self.positions.iter_mut().chain(moving);
        for value in arrays.flat_map(|array| array.iter_mut()) {
            *value = next();
        }
        true
    }
}
