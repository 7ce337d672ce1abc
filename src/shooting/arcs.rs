//! The leaf whose rest shape is known: stretched circular arcs from the fan at
//! the base to one common tip. Free rods have their own rest shapes.

use std::f64::consts::PI;

use crate::scenario::Scenario;

/// Lower bound on the ratio of chord to arc length, which vanishes for arcs that turn by
/// nearly a full circle.
const SHORTEST_CHORD: f64 = 0.05;

/// Rest shape of one rod of that leaf: stretch v1, and bend about d3.
#[derive(Clone, Copy, Debug)]
pub struct Arc {
    pub stretch: f64,
    pub bend: f64,
}

/// One arc per rod, for these dimensionless lengths without growth; none
/// for free rods.
pub fn arcs(scenario: &Scenario, lengths: &[f64]) -> Vec<Arc> {
    if !scenario.joined || lengths.len() == 1 {
        return Vec::new();
    }
    let angles = scenario.rods.iter().map(|rod| rod.angle.sin_cos());
    let (sin, cos) = angles.fold((0.0, 0.0), |(s, c), (sin, cos)| (s + sin, c + cos));
    let mean = if sin.hypot(cos) > 1e-9 * lengths.len() as f64 {
        sin.atan2(cos)
    } else {
        scenario.rods[0].angle
    };
    let openings: Vec<f64> = (scenario.rods.iter())
        .map(|rod| (rod.angle - mean + PI).rem_euclid(2.0 * PI) - PI)
        .collect();
    // Chord over length of an arc that turns by twice the opening.
    let chord = |opening: f64| match opening.abs() {
        small if small < 1e-8 => 1.0,
        _ => (opening.sin() / opening).max(SHORTEST_CHORD),
    };
    let grown = (scenario.rods.iter().zip(lengths))
        .map(|(rod, length)| length * rod.rest_stretch.integral(1.0));
    let chords = (openings.iter().zip(grown)).map(|(&opening, length)| length * chord(opening));
    let tip = chords.sum::<f64>() / lengths.len() as f64;
    (openings.iter().zip(lengths))
        .map(|(&opening, length)| Arc {
            stretch: tip / (length * chord(opening)),
            bend: -2.0 * opening / length,
        })
        .collect()
}
