//! Positions near given ones in which segments that hardly yield are not strained, such as those
//! of arcs with different chords that are joined at their tips.

mod curves;

use crate::leaf::{DiscreteLeaf, State, System};
use crate::newton::{Definite, Equations, Newton, Work};
use curves::meeting;

/// Squared frequencies of the springs that hold the nodes while their positions are made
/// consistent: stiff ones first; a straight vein that must buckle may need softer ones.
const HOLDS: [f64; 3] = [1e3, 30.0, 1.0];

/// Compliances (L^2/A) through which the leaf is made as stiff as it is: the first, the ratio of
/// successive ones, and the last.
const FIRST_COMPLIANCE: f64 = 0.1;
const COMPLIANCE_RATIO: f64 = 0.3;
const LAST_COMPLIANCE: f64 = 1e-9;

/// Iterations at each of them, and their accuracy.
const ITERATIONS: usize = 20;
const NEARLY_CONSISTENT: f64 = 1e-4;
const CONSISTENT: f64 = 1e-13;

/// A state near this one in which segments are strained no more than gently: the leaf becomes as
/// stiff as it is in steps, without loads, while springs in proportion to the masses hold its
/// nodes. If that fails, since the side to which straight rods buckle is undetermined, the rods
/// become curves with a common tip. `None` if there are none.
pub fn unstrained(leaf: &DiscreteLeaf, near: &State) -> Option<State> {
    let mut leaf = leaf.clone();
    leaf.load_factor = 0.0;
    let mut system = System::new(&leaf);
    let mut held = |&rate: &f64| held(&leaf, &mut system, near, rate);
    let found = HOLDS.iter().find_map(&mut held);
    let is_held = leaf.leaf.is_held();
    found.or_else(|| meeting(&leaf).filter(|_| !is_held))
}

/// The equilibrium with springs of this `rate`, if there is one.
fn held(leaf: &DiscreteLeaf, system: &mut System, near: &State, rate: f64) -> Option<State> {
    let mut state = near.clone();
    let mut floor = FIRST_COMPLIANCE;
    let last = leaf.least_compliance().max(LAST_COMPLIANCE);
    leaf.softened(floor).strain_forces(&mut state);
    let mut hold = |leaf: &DiscreteLeaf, accuracy: f64| {
        let newton = Newton {
            accuracy,
            iterations: ITERATIONS,
            work: &mut Work::default(),
            progress: &mut |_, _| {},
        };
        let held = Equations::Proximal {
            solver: &mut Definite::default(),
            at: near,
            rate,
            largest: f64::INFINITY,
        };
        newton.solve(leaf, &mut state, system, held).ok()
    };
    while floor > last {
        hold(&leaf.softened(floor), NEARLY_CONSISTENT)?;
        floor *= COMPLIANCE_RATIO;
    }
    hold(leaf, CONSISTENT)?;
    Some(state)
}
