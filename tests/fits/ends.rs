//! Ends of intervals of soft leaves, where refits of the other numbers fail on the way.

use leafdyn::study::FitOutcome;
use leafdyn_testing::fit::{fitted, request};
use leafdyn_testing::*;

/// A soft leaf of three veins under its weight.
const SOFT: &str = r#"
    name = "soft"
    leaf = { rods = 3, length = 20.0, fan = "symmetric" }
    stiffness = { torsion = 0.04, bending_2 = 0.05, bending_3 = 0.05, axial = 100.0, shear_2 = 40.0, shear_3 = 40.0 }
    coupling = { y = 0.001, z = 0.001 }
    load = { gravity = [0.0, 0.0, -2e-4] }
"#;

/// Pulled, it tells its axial stiffness and hardly anything of its bending stiffness. The ends are
/// those of the least chi squared found at fixed axial stiffness from six bending stiffnesses.
#[test]
fn an_end_is_found_where_another_number_is_open() {
    let data = "load.tip_force[0],tip_x,sd_tip_x\n0.5,19.991,0.005\n2.5,20.124,0.005\n\
                5,20.266,0.005\n7.5,20.4,0.005\n10,20.551,0.005\n";
    let free = ["stiffness.bending_2", "stiffness.axial"];
    let found = fitted(&request(base(SOFT, ""), &[data], &free));
    assert_eq!(found.outcome, FitOutcome::Undetermined);
    let axial = &found.parameters[1];
    let (low, high) = (axial.low.unwrap(), axial.high.unwrap());
    assert!(axial.determined, "{axial:?}");
    close("lower end", low, 118.30, 0.12);
    close("upper end", high, 121.39, 0.12);
}
