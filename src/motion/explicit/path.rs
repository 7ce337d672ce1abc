//! Along the path in time: advancing, looking, going back.

use super::Explicit;
use crate::motion::ledger::{Exchange, measure};
use crate::motion::method::{Broken, Method, Snapshot, Velocity};
use crate::rod::RESOLVED_TURN;

/// Part of a step that is rounding.
const NO_TIME: f64 = 1e-9;

/// Steps between looks at what costs nothing to see, and at the energy.
const GLANCED: usize = 200;
const WATCHED: usize = 1000;

impl Explicit {
    fn judge(&mut self) -> Result<(), Broken> {
        let now = self.snapshot();
        (self.ledger).judge(&self.leaf, &self.physics, &now, self.step)?;
        self.seen = Some(now);
        // The ledger takes turns for what they are in space, at most pi.
        let (time, turn) = (self.time, self.sharpest());
        match turn > RESOLVED_TURN {
            true => Err(Broken::Unresolved { time, turn }),
            false => Ok(()),
        }
    }
}

impl Method for Explicit {
    fn name(&self) -> &'static str {
        "explicit"
    }

    fn time(&self) -> f64 {
        self.time
    }

    fn steps(&self) -> usize {
        self.steps
    }

    fn advance(&mut self, until: f64) -> Result<(), Broken> {
        let h = self.step;
        loop {
            // Times are not summed up, and neither is rounding.
            let next = self.begin.0 + h * (self.steps + 1 - self.begin.1) as f64;
            if next > until + NO_TIME * h {
                break;
            }
            let (exchange, _) = self.go(h);
            self.ledger.add(exchange);
            self.steps += 1;
            (self.stepped, self.time) = (next, next);
            let suspect = self.steps.is_multiple_of(GLANCED) && !self.sound();
            if suspect || self.steps.is_multiple_of(WATCHED) {
                self.judge()?;
            }
        }
        self.time = until.max(self.time);
        self.judge()
    }

    fn snapshot(&mut self) -> Snapshot {
        if let Some(seen) = self.seen.take()
            && seen.time == self.time
        {
            return seen;
        }
        let path: Vec<_> = (self.rods.iter().zip(&self.positions))
            .map(|(rod, x)| (x.clone(), rod.motion.clone(), rod.past.clone()))
            .collect();
        let (time, widths) = (self.stepped, self.widths);
        let mut exchange = Exchange::default();
        let left = self.time - self.stepped;
        if left > NO_TIME * self.step {
            exchange += self.go(left).0;
        }
        self.stepped = self.time;
        exchange += self.kick(0.0, 0.0, false).0;
        let state = self.now();
        let n = self.leaf.segments();
        let velocity: Vec<Velocity> = (self.rods.iter())
            .flat_map(|rod| rod.velocities(n))
            .collect();
        for ((rod, x), path) in self.rods.iter_mut().zip(&mut self.positions).zip(path) {
            (*x, rod.motion, rod.past) = path;
        }
        (self.stepped, self.widths) = (time, widths);
        let energy = measure(&mut self.leaf, &self.physics, self.time, &state, &velocity);
        Snapshot {
            time: self.time,
            energy: self.ledger.complete(energy, exchange),
            state,
            velocity,
        }
    }

    fn save(&self) -> Vec<f64> {
        let mut numbers = vec![
            self.stepped,
            self.time,
            self.steps as f64,
            self.begin.0,
            self.begin.1 as f64,
            self.widths[0],
            self.widths[1],
        ];
        numbers.extend(self.ledger.save());
        for (rod, positions) in self.rods.iter().zip(&self.positions) {
            let moving = positions.x.iter().chain(rod.moving_arrays());
            numbers.extend(moving.flat_map(|array| array.iter()));
        }
        numbers
    }

    fn restore(&mut self, numbers: &[f64]) -> bool {
        if numbers.len() != self.save().len() {
            return false;
        }
        let mut numbers = numbers.iter().copied();
        let mut next = || numbers.next().unwrap_or_default();
        self.stepped = next();
        self.time = next();
        self.steps = next() as usize;
        self.begin = (next(), next() as usize);
        self.widths = [next(), next()];
        self.ledger.restore(&mut next);
        self.seen = None;
        for (rod, positions) in self.rods.iter_mut().zip(&mut self.positions) {
            let moving = positions.x.iter_mut().chain(rod.moving_arrays_mut());
            for value in moving.flat_map(|array| array.iter_mut()) {
                *value = next();
            }
        }
        true
    }
}
