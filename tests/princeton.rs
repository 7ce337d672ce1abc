//! The Princeton beam: a flat strip under an oblique tip load; by relaxation
//! and by shooting.

mod common;

use common::*;

/// Length in m.
const LENGTH: f64 = 0.508;

/// Load in N, its angle from the chord in degrees; displacements of the tip in
/// m along the rod, its chord and its thin direction. Collocation on the
/// boundary-value problem.
const ROWS: &str = "
     8.896  30  -0.007659232352  0.010146995016  0.079447830196
     8.896  90  -0.026019304238  0               0.146246558816
    13.345  45  -0.030355556827  0.015341799699  0.156573901653
    13.345  90  -0.050397327369  0               0.200677265105
";

#[test]
fn the_tip_goes_where_the_boundary_value_problem_says() {
    for [load, angle, x, y, z] in table(ROWS) {
        let what = format!("{load} N at {angle} degrees");
        // 90 degrees is straight along the thin direction.
        let (sin, cos) = match angle {
            90.0 => (1.0, 0.0),
            _ => f64::to_radians(angle).sin_cos(),
        };
        let force = format!("load.tip_force=[0, {:?}, {:?}]", load * cos, load * sin);
        let leaf = Both::solve("classic/princeton", &force);
        leaf.tip_is(&what, DVec3::new(LENGTH + x, y, z), 6e-13, 5e-12);
        assert_eq!(leaf.relaxed.stable(), Some(true), "{what}");
    }
}
