//! A straight rod wound into coils by a dead moment and pulled aside by a
//! dead force (Ibrahimbegovic 1997).

mod common;

use std::f64::consts::PI;

use common::{set_vector, solve, tip_is};
use glam::DVec3;

const LENGTH: f64 = 10.0;

/// Collocation on the boundary-value problem, tip / L.
#[test]
fn one_coil_and_ten_end_where_the_boundary_value_problem_says() {
    for (lambda, wanted, digits) in [
        (
            0.1,
            [0.041020335261, 0.005377090312, -0.109172901932],
            1e-12,
        ),
        (
            1.0,
            [0.000480324966, 0.0000072496847, -0.007644174173],
            1e-12,
        ),
    ] {
        let leaf = solve(
            "classic/helical_rollup",
            &[
                set_vector("load.tip_moment", DVec3::new(0.0, 0.0, 200.0 * PI * lambda)),
                set_vector("load.tip_force", DVec3::new(0.0, 0.0, 50.0 * lambda)),
            ],
        );
        let what = format!("lambda = {lambda}");
        let wanted = LENGTH * DVec3::from_array(wanted);
        tip_is(&what, &leaf, wanted, LENGTH * digits, LENGTH * 1e-11);
        // No potential, so no count of eigenvalues: nothing is claimed.
        assert_eq!(leaf.stability.negative_eigenvalues, None);
    }
}
