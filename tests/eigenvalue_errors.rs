//! The stated errors of eigenvalues hold.

mod common;

use common::random::{drawn, leaves};
use common::*;
use leafdyn::relax::Mode;

/// Random leaves, unless LEAFDYN_LEAVES asks for others.
const LEAVES: usize = 30;

fn relaxed(leaf: &Scenario, tolerance: f64, mode_shapes: bool) -> Equilibrium {
    let options = Options {
        modes: 4,
        mode_shapes,
        ..common::to(tolerance)
    };
    common::relaxed(leaf, &options)
}

fn modes(leaf: &Equilibrium) -> &[Mode] {
    leaf.stability.modes.as_deref().unwrap_or_default()
}

/// Against the same leaf to 1e-10, with and without more grids for the modes' shapes.
#[test]
fn stated_errors_of_eigenvalues_are_bounds() {
    let count = asked("LEAFDYN_LEAVES", LEAVES);
    let mut compared = 0;
    for (k, leaf) in drawn(leaves(), count).iter().enumerate() {
        let best = relaxed(leaf, 1e-10, true);
        for (tolerance, shapes) in [(1e-3, false), (1e-3, true), (1e-5, false), (1e-6, true)] {
            let found = relaxed(leaf, tolerance, shapes);
            if (found.tips[0] - best.tips[0]).length() > 10.0 * tolerance {
                continue;
            }
            for (mode, best) in modes(&found).iter().zip(modes(&best)) {
                let (error, left) = (mode.error.unwrap(), best.error.unwrap());
                let what = format!("leaf {k} to {tolerance:e}, shapes {shapes}");
                close(&what, mode.eigenvalue, best.eigenvalue, error + left);
                compared += 1;
            }
        }
    }
    assert!(compared > 10 * count, "{compared}");
}
