//! The leaf in motion: let go, or on its way to another equilibrium.

use leafdyn::relax::{Equilibrium, EquilibriumTracker, RelaxError};
use leafdyn::scenario::Scenario;
use leafdyn::simulate::{Frame, Options, Simulation, SimulationError, Stopped};
use leafdyn_program::page;
use serde::Serialize;

/// Instants of a motion, and how many of them at most.
const OUTPUTS: f64 = 40.0;
const LONGEST: f64 = 100.0;

/// A damped leaf rests where its kinetic energy is this part of the largest it had.
const AT_REST: f64 = 1e-5;

/// Local error of a step, relative to the length: nobody sees less.
const TOLERANCE: f64 = 1e-3;

/// A motion, and how fast it was at most.
pub struct Motion {
    simulation: Simulation,
    page: page::PageData,
    scenario: Scenario,
    damped: bool,
    unit: f64,
    fastest: f64,
}

/// The leaf at an instant.
#[derive(Serialize)]
pub struct Instant {
    pub leaf: page::PageLeaf,
    pub time: f64,
    pub tip: [f64; 3],
    /// Time between two outputs, and the natural unit of time.
    pub step: f64,
    pub unit: f64,
    /// Whether nothing is to follow.
    pub ended: bool,
}

impl Motion {
    /// From where a leaf is, or from the arcs that it is released from.
    pub fn begin(
        scenario: &Scenario,
        from: Option<&EquilibriumTracker>,
        damped: bool,
    ) -> Result<Motion, SimulationError> {
        let mut scenario = scenario.clone();
        let critical = scenario.dynamics.critical_damping(&scenario.rods);
        let unit = scenario.dynamics.natural_time(&scenario.rods);
        let dynamics = &mut scenario.dynamics;
        if damped {
            dynamics.external_damping = dynamics.external_damping.max(critical);
        }
        dynamics.duration = LONGEST * unit;
        dynamics.output_interval = unit / OUTPUTS;
        let options = Options {
            tolerance: Some(TOLERANCE),
            ..Options::default()
        };
        let simulation = match from {
            Some(follower) => Simulation::from_tracker(follower, &scenario, &options)?,
            None => Simulation::new(&scenario, &options)?,
        };
        Ok(Motion {
            simulation,
            page: page::page_data_without_result(&scenario),
            scenario,
            damped,
            unit,
            fastest: 0.0,
        })
    }

    /// The leaf at its beginning.
    pub fn first(&mut self) -> Instant {
        let frame = self.simulation.frame();
        self.instant(&frame)
    }

    /// The instant so many outputs later, or that at which it ends.
    pub fn next(&mut self, count: usize) -> Result<Instant, Stopped> {
        let mut frame = self.simulation.frame();
        for _ in 0..count {
            if self.ends_with(&frame) {
                break;
            }
            frame = self.simulation.next_frame()?;
            self.fastest = self.fastest.max(frame.energy.kinetic);
        }
        Ok(self.instant(&frame))
    }

    /// At rest, from where it is now.
    pub fn land(
        &mut self,
        follower: &mut EquilibriumTracker,
        scenario: &Scenario,
    ) -> Result<Equilibrium, RelaxError> {
        self.simulation.relax_into_tracker(follower, scenario)
    }

    /// Whether the leaf is as good as at rest, or the time is over.
    fn ends_with(&self, frame: &Frame) -> bool {
        let moved = self.damped && self.fastest > 0.0;
        moved && frame.energy.kinetic < AT_REST * self.fastest || self.simulation.done()
    }

    fn instant(&self, frame: &Frame) -> Instant {
        let curves = frame.curves();
        let tip = frame.tips(self.scenario.joined)[0];
        Instant {
            leaf: page::moving_leaf(
                self.simulation.stations(),
                &curves,
                &self.page,
                &self.scenario,
                frame.time,
            ),
            time: frame.time,
            tip: tip.to_array(),
            step: self.unit / OUTPUTS,
            unit: self.unit,
            ended: self.ends_with(frame),
        }
    }
}
