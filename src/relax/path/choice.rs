//! The side to which a leaf turns from a saddle, the same on all grids, in all units, and in
//! whichever order its veins are numbered.

use crate::leaf::{DiscreteLeaf, State, System, shift};
use crate::newton::Work;
use crate::relax::saddle;
use glam::DVec3;

/// Work of the leaning force, as a part of the largest possible, from which on it decides.
const DECIDES: f64 = 1e-6;

/// The sign of the unstable mode that moves the leaf along the `leaning` force or, if it does
/// not matter, in the first of these of which it moves it to one side: down, to the left (along
/// e2), forward; and of their moments about the base.
pub fn side(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    leaning: DVec3,
    work: &mut Work,
) -> f64 {
    if !saddle::find_unstable_mode(leaf, state, system, work) {
        return 1.0;
    }
    let mode = system.solution();
    let mean = |force: &dyn Fn(DVec3) -> DVec3| {
        let (mut sum, mut size) = (0.0, 0.0);
        for (j, rod) in mode.iter().enumerate() {
            for (i, increment) in rod.iter().enumerate() {
                let force = force(state.x[state.base(j) + i + 1]);
                let displacement = shift(increment);
                let weight = leaf.grid.weight(i + 1) * leaf.leaf.length(j);
                sum += weight * force.dot(displacement);
                size += weight * force.length() * displacement.length();
            }
        }
        if size > 0.0 { sum / size } else { 0.0 }
    };
    let uniform = |force: DVec3| mean(&move |_| force);
    // Turning about an axis, and stretching along one: these tell antisymmetric modes apart.
    let bend = |axis: DVec3, along: DVec3| mean(&move |x: DVec3| x.dot(along) * axis);
    let measures = [
        uniform(leaning),
        uniform(-DVec3::Z),
        uniform(DVec3::Y),
        uniform(DVec3::X),
        bend(-DVec3::Z, DVec3::Y),
        bend(-DVec3::Z, DVec3::X),
        bend(DVec3::Y, DVec3::X),
        bend(DVec3::Y, DVec3::Y),
        bend(DVec3::X, DVec3::Y),
    ];
    let decisive = measures.into_iter().find(|value| value.abs() > DECIDES);
    decisive.map_or(1.0, f64::signum)
}

/// Displaces a state at a saddle along its unstable mode, to one side.
pub fn push(
    leaf: &DiscreteLeaf,
    state: &mut State,
    system: &mut System,
    side: f64,
    work: &mut Work,
) {
    if saddle::find_unstable_mode(leaf, state, system, work) {
        saddle::displace(leaf, state, system, side);
    }
}
