//! What makes a motion doubtful from its beginning: it starts where it would stay for ever but for
//! rounding.

use crate::leaf::{DiscreteLeaf, Increment, State, System, shift, turn};
use crate::limit::Limit;
use crate::modes::{Eigenpair, Wanted, lowest};
use crate::motion::Physics;
use crate::newton::{Newton, Work};
use crate::numbers::two_digits;
use crate::relax::{ANY_SIGN, polish};

/// Largest distance of a start from the equilibrium that it is compared with, in lengths.
const NEAR: f64 = 0.1;

/// Largest deviation from that equilibrium along an unstable mode, radians or lengths, that is
/// none: it would have to grow by e fourteen times.
const NO_DEVIATION: f64 = 1e-6;

/// Accuracy of these modes.
const MODE_ACCURACY: f64 = 1e-9;

/// A sentence on a start at an unstable equilibrium, or beside one but without a deviation along
/// its unstable modes, such as that of a straight column under its weight.
pub(super) fn unstable(leaf: &DiscreteLeaf, physics: &Physics, start: &State) -> Option<String> {
    let mut leaf = leaf.clone();
    leaf.loads = physics.loads(0.0);
    if leaf.leaf.in_wind() || leaf.loads.has_moments() || !physics.clamped() {
        // Its rest is no minimum of an energy, or it has none.
        return None;
    }
    leaf.set_rest(physics.rest(0.0));
    let (mut system, mut work) = (System::new(&leaf), Work::default());
    if !may_be_near(&leaf, start, &mut system) {
        return None;
    }
    let mut exact = start.clone();
    let index = polish(&leaf, &mut exact, &mut system, &mut work).filter(|&index| index > 0)?;
    let wanted = Wanted {
        count: index,
        above: None,
        accuracy: MODE_ACCURACY,
        near: &[],
        time: &Limit::default(),
    };
    let mut modes = lowest(&leaf, physics, &exact, wanted)?;
    modes.retain(|mode| mode.eigenvalue < 0.0);
    let fastest = -modes.first()?.eigenvalue;
    let deviates =
        |mode: &Eigenpair| deviation(&leaf, physics, (&exact, start), &mode.shape) > NO_DEVIATION;
    if modes.iter().any(deviates) {
        return None;
    }
    let time = two_digits(physics.time / fastest.sqrt());
    Some(format!(
        "the motion starts at an unstable equilibrium (negative eigenvalues: {index}), and nothing displaces the leaf \
         the way it would leave: a deviation grows by e in {time}, and rounding decides when and to which side; \
         give it a small push, such as a short dynamics.tip_force"
    ))
}

/// Whether the first step of Newton's method is short enough for an equilibrium nearby.
fn may_be_near(leaf: &DiscreteLeaf, start: &State, system: &mut System) -> bool {
    let mut next = start.clone();
    let first = Newton {
        accuracy: 0.0,
        iterations: 1,
        work: &mut Work::default(),
        progress: &mut |_, _| {},
    };
    // It is not converged after one step.
    let _ = first.solve(leaf, &mut next, system, ANY_SIGN);
    start.shift_to(&next) < NEAR
}

/// The largest rotation or displacement in the part along a mode of what leads from one state to
/// another. Modes are orthonormal in the mass product.
fn deviation(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    (from, to): (&State, &State),
    mode: &[Increment],
) -> f64 {
    let (mut field, mut along, mut largest) = (Vec::new(), 0.0, 0.0_f64);
    from.increments_to(to, leaf.first_node(), &mut field);
    for (j, i) in leaf.each(leaf.moving_nodes()) {
        let (k, inertia) = (from.base(j) + i, physics.inertia(leaf, j, i));
        let (off, mode, tensor) = (
            &field[j][i - leaf.first_node()],
            &mode[k],
            inertia.tensor(from.q[k]),
        );
        along += turn(mode).dot(tensor * turn(off)) + inertia.mass * shift(mode).dot(shift(off));
        largest = largest.max(turn(mode).length()).max(shift(mode).length());
    }
    along.abs() * largest
}
