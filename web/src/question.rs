//! What a page asks.

use leafdyn::scenario::{PointLoad, Scenario};
use serde::Deserialize;

/// How far a point is pulled at most, in lengths.
const FARTHEST: f64 = 2.0;

/// Values of numbers of the scenario by their paths.
pub type Values = Vec<(String, f64)>;

/// What a page asks.
#[derive(Deserialize)]
#[serde(tag = "ask", rename_all = "lowercase")]
pub enum Question {
    /// A scenario, with the values of some of its numbers; where it has several equilibria, the one
    /// near a place that was asked for.
    Open {
        text: String,
        name: String,
        #[serde(default)]
        values: Values,
        #[serde(default)]
        at: Option<String>,
    },
    /// Where the leaf is.
    Place,
    /// The leaf with other values, followed there.
    Set {
        values: Values,
        /// How many modes are wanted.
        #[serde(default)]
        modes: usize,
        /// Whether a coarse grid is enough, as while a slider is dragged.
        #[serde(default)]
        coarse: bool,
        /// Where it is pulled.
        #[serde(default)]
        pull: Option<Pull>,
    },
    /// The leaf, which was left where its stable equilibria end, at rest elsewhere.
    Settle,
    /// The leaf let go from where it is, or from the arcs it is released from; `damped` if the
    /// motion is not its own but that to its next equilibrium.
    Go {
        #[serde(default)]
        damped: bool,
        #[serde(default)]
        released: bool,
    },
    /// An instant of that motion, so many outputs later.
    Frame {
        #[serde(default = "one")]
        count: usize,
    },
    /// The end of the motion: the leaf at rest.
    Land,
    /// The branch of the present equilibrium between two values of a number.
    Trace {
        key: String,
        from: f64,
        to: f64,
        #[serde(default)]
        log: bool,
    },
    /// All equilibria that are found.
    Equilibria,
    /// Derivatives of the tip.
    Sensitivity { keys: Vec<String> },
    /// The leaf without loads.
    Unloaded,
    /// One of the files that the program writes, or the scenario.
    Write { file: String },
    /// The version of the solver.
    Version,
}

fn one() -> usize {
    1
}

/// A point of a vein, by its number from 1 and the fraction of its length, pulled by a spring whose
/// other end is displaced.
#[derive(Clone, Copy, Deserialize)]
pub struct Pull {
    vein: usize,
    at: f64,
    displacement: [f64; 3],
}

/// Stiffness of that spring: times the bending stiffness of the veins over the length cubed.
const SPRING: f64 = 6.0;

impl Pull {
    /// The scenario with its force.
    pub fn on(self, mut scenario: Scenario) -> Scenario {
        let (scale, rods) = (scenario.scale(), scenario.rods.len());
        let stiffness = SPRING * rods as f64 * scale.force() / scale.length;
        let farthest = FARTHEST * scale.length;
        let force = (self.displacement).map(|x| stiffness * x.clamp(-farthest, farthest));
        let vein = self.vein.clamp(1, rods) - 1;
        let tip = self.at >= 1.0 && scenario.joined && rods > 1;
        if force.iter().any(|x| !x.is_finite()) || !(self.at > 0.0 && self.at <= 1.0) {
            return scenario;
        }
        if tip {
            scenario.tip_force = [0, 1, 2].map(|k| scenario.tip_force[k] + force[k]);
            return scenario;
        }
        scenario.points.push(PointLoad {
            vein,
            at: self.at,
            force,
            moment: [0.0; 3],
            follows: false,
            mass: 0.0,
            offset: [0.0; 2],
            in_time: None,
            landing: None,
        });
        scenario
    }
}
