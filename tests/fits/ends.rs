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

/// A soft rod, pulled forward and aside: its axial stiffness is known to no better than a factor of ten.
const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 0.1, bending_2 = 0.034, bending_3 = 0.12, axial = 324.0, shear_2 = inf, shear_3 = inf }
"#;

/// At the end of an interval chi squared has risen by 3.84, whatever the others take: held there, a
/// number leaves them values far away, to which derivatives at the minimum do not lead.
#[test]
fn an_end_is_where_all_other_values_fit_worse() {
    let data = "load.tip_force[0],load.tip_force[1],load.tip_force[2],tip_y,tip_z,sd_tip_y,sd_tip_z\n\
        0.3041515,0.007123818,0.0006667269,0.009248629,0.001576521,0.003624216,0.003624216\n\
        0.2866678,0.05983133,-0.01132216,0.07934491,-0.02791892,0.003624216,0.003624216\n\
        0.07523347,0,0.01951533,0,0.1190849,0.003624216,0.003624216\n\
        0.04535774,-0.07678079,-0.1052716,-0.1411792,-0.5621077,0.003624216,0.003624216\n\
        0.1447878,0,0.1597008,0,0.5160142,0.003624216,0.003624216\n\
        0.121375,-0.01375982,0.09344714,-0.02336134,0.3823514,0.003624216,0.003624216\n";
    let free = [
        "stiffness.axial",
        "stiffness.bending_3",
        "stiffness.bending_2",
    ];
    let found = fitted(&request(base(ROD, ""), &[data], &free));
    let bending = &found.parameters[1];
    for end in [bending.low.unwrap(), bending.high.unwrap()] {
        let others = ["stiffness.axial", "stiffness.bending_2"];
        let held = [3.0, 30.0, 300.0].map(|axial| {
            let start = format!("stiffness.bending_3={end}; stiffness.axial={axial}");
            fitted(&request(base(ROD, &start), &[data], &others)).chi_squared
        });
        let least = held.into_iter().fold(f64::INFINITY, f64::min);
        close("rise of chi squared", least - found.chi_squared, 3.84, 0.4);
    }
}
