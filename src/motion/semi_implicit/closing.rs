//! Closing of an initial state with strained rigid segments, as of arcs of different chords.

use super::SemiImplicit;
use super::curves::meeting;
use crate::leaf::{DiscreteLeaf, State};
use crate::newton::{Definite, Equations, Newton, Work};

/// Squared frequencies of the springs that hold the nodes in place: stiff
/// ones first; a straight vein that must buckle may need softer ones.
const HOLDS: [f64; 3] = [1e3, 30.0, 1.0];

/// Compliances (L^2/A) through which the leaf is made rigid: the first, the ratio of
/// successive ones, and the last.
const FIRST: f64 = 0.1;
const NEXT: f64 = 0.3;
const LAST: f64 = 1e-9;

/// Iterations at each of them, and their accuracy.
const ITERATIONS: usize = 20;
const NEARLY: f64 = 1e-4;
const CLOSED: f64 = 1e-13;

impl SemiImplicit {
    /// Moves the nodes slightly to a state with unstrained rigid segments: the
    /// leaf is made rigid in steps, without loads, while springs in proportion to
    /// the masses hold its nodes. If that fails, since the side to which straight rods buckle is
    /// undetermined, the rods become curves with a common tip. If there are none, the nodes are
    /// not moved.
    pub(super) fn close(&mut self) {
        let mut leaf = self.leaf.clone();
        leaf.sections.clone_from(&self.sections);
        leaf.load_factor = 0.0;
        let closed = HOLDS.iter().find_map(|&rate| self.closed(&leaf, rate));
        let held = leaf.leaf.held.is_some();
        let closed = closed.or_else(|| meeting(&leaf).filter(|_| !held));
        if let Some(state) = closed {
            self.state = state;
        }
    }

    /// The equilibrium with springs of this `rate`, if there is one.
    fn closed(&mut self, leaf: &DiscreteLeaf, rate: f64) -> Option<State> {
        let mut state = self.state.clone();
        let mut floor = FIRST;
        leaf.softened(floor).strain_forces(&mut state);
        while floor > LAST {
            self.hold(&leaf.softened(floor), &mut state, rate, NEARLY)?;
            floor *= NEXT;
        }
        self.hold(leaf, &mut state, rate, CLOSED)?;
        Some(state)
    }

    /// Solves for the equilibrium of `leaf` with springs at the present positions of its nodes.
    fn hold(
        &mut self,
        leaf: &DiscreteLeaf,
        state: &mut State,
        rate: f64,
        accuracy: f64,
    ) -> Option<f64> {
        let newton = Newton {
            accuracy,
            iterations: ITERATIONS,
            work: &mut Work::default(),
            progress: &mut |_, _| {},
        };
        let held = Equations::Proximal {
            solver: &mut Definite::default(),
            at: &self.state,
            rate,
            largest: f64::INFINITY,
        };
        newton.solve(leaf, state, &mut self.system, held).ok()
    }
}
