//! A start whose rigid segments are strained, as arcs of different chords are.

use super::SemiImplicit;
use super::curves::meeting;
use crate::leaf::{DiscreteLeaf, State};
use crate::newton::{Definite, Equations, Newton, Work};

/// Squared frequencies of the springs that hold the nodes where they are: stiff
/// ones first; a straight vein that must give way may need softer ones.
const HOLDS: [f64; 3] = [1e3, 30.0, 1.0];

/// Compliances (L^2/A) by which the leaf is made rigid: the first, the ratio of
/// the next, and the last.
const FIRST: f64 = 0.1;
const NEXT: f64 = 0.3;
const LAST: f64 = 1e-9;

/// Iterations at each of them, and their accuracy.
const ITERATIONS: usize = 20;
const NEARLY: f64 = 1e-4;
const CLOSED: f64 = 1e-13;

impl SemiImplicit {
    /// Moves the nodes to where rigid segments are not strained, by little: the
    /// leaf is made rigid by steps, without loads, while springs in proportion to
    /// the masses hold its nodes. Where that fails, as straight rods do not know to
    /// which side to give way, the rods become curves that meet. Leaves the nodes
    /// where they are if there are none.
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

    /// The state that springs of this `rate` leave, if there is one.
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

    /// To the equilibrium of `leaf` whose nodes are held where they are now.
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
        let held = Equations::Held {
            solver: &mut Definite::default(),
            at: &self.state,
            rate,
            largest: f64::INFINITY,
        };
        newton.solve(leaf, state, &mut self.system, held).ok()
    }
}
