//! Normalised shapes of modes.

use crate::leaf::{Increment, shift, turn};
use glam::DVec3;

/// A mode with smaller displacements than this, in lengths per radian of its rotation, is one
/// of rotation alone.
const NO_DISPLACEMENT: f64 = 1e-6;

/// Displacements and rotations of all nodes, rod by rod.
pub(super) type Shape = (Vec<Vec<DVec3>>, Vec<Vec<DVec3>>);

/// A shape in the scenario's unit of length, normalised.
pub(super) fn normalized(shape: &[Vec<Increment>], length: f64) -> Shape {
    let nodes = || shape.iter().flatten();
    let largest =
        |part: fn(&Increment) -> DVec3| nodes().map(|node| part(node).length()).fold(0.0, f64::max);
    let (far, turned) = (largest(shift), largest(turn));
    let (size, part): (f64, fn(&Increment) -> DVec3) = match far > NO_DISPLACEMENT * turned {
        true => (far, shift),
        false => (turned, turn),
    };
    let components: Vec<f64> = nodes().flat_map(|node| part(node).to_array()).collect();
    let most = components.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    // The last of those that are equal up to rounding: a tip's.
    let mut last = components.iter().rev();
    let sign = last
        .find(|c| c.abs() > 0.99 * most)
        .map_or(1.0, |c| c.signum());
    let rods = |part: fn(&Increment) -> DVec3, unit: f64| {
        let rod = |rod: &Vec<Increment>| rod.iter().map(|node| part(node) * unit).collect();
        shape.iter().map(rod).collect()
    };
    let unit = sign / size;
    (rods(shift, unit * length), rods(turn, unit))
}
