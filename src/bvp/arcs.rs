//! The leaf whose rest shape is known: stretched circular arcs from the fan at
//! the base to one common tip. Free rods are at rest in their own shapes.

use std::f64::consts::PI;

use glam::DVec3;

use crate::scenario::Scenario;

/// Chords of arcs that turn by nearly a full circle vanish; they are taken as
/// at least this part of the arc.
const SHORTEST_CHORD: f64 = 0.05;

/// Rest shape of one rod of that leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// Rest stretch v1, or the rod's own.
    stretch: Option<f64>,
    /// Rest bend about d3, or the rod's own rest curvature.
    bend: Option<f64>,
}

impl Arc {
    /// Rest stretch, where the scenario has `own`.
    pub fn stretch(&self, own: f64) -> f64 {
        self.stretch.unwrap_or(own)
    }

    /// Rest curvature, where the scenario has `own`.
    pub fn curvature(&self, own: DVec3) -> DVec3 {
        self.bend.map_or(own, |bend| bend * DVec3::Z)
    }
}

/// One arc per rod, of the given dimensionless lengths before any growth.
pub fn arcs(scenario: &Scenario, lengths: &[f64]) -> Vec<Arc> {
    if !scenario.joined || lengths.len() == 1 {
        let free = Arc {
            stretch: None,
            bend: None,
        };
        return vec![free; lengths.len()];
    }
    let (sin, cos) = scenario
        .rods
        .iter()
        .map(|rod| rod.angle.sin_cos())
        .fold((0.0, 0.0), |(s, c), (sin, cos)| (s + sin, c + cos));
    let mean = if sin.hypot(cos) > 1e-9 * lengths.len() as f64 {
        sin.atan2(cos)
    } else {
        scenario.rods[0].angle
    };
    let openings: Vec<f64> = scenario
        .rods
        .iter()
        .map(|rod| (rod.angle - mean + PI).rem_euclid(2.0 * PI) - PI)
        .collect();
    // Chord over length of an arc that turns by twice the opening.
    let chord = |opening: f64| match opening.abs() {
        small if small < 1e-8 => 1.0,
        _ => (opening.sin() / opening).max(SHORTEST_CHORD),
    };
    let grown = (scenario.rods.iter().zip(lengths))
        .map(|(rod, length)| length * rod.rest_stretch.integral(1.0));
    let tip = openings
        .iter()
        .zip(grown)
        .map(|(&opening, length)| length * chord(opening))
        .sum::<f64>()
        / lengths.len() as f64;
    openings
        .iter()
        .zip(lengths)
        .map(|(&opening, length)| Arc {
            stretch: Some(tip / (length * chord(opening))),
            bend: Some(-2.0 * opening / length),
        })
        .collect()
}
