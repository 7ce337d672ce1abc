//! What measurements leave open is named, and never given a narrow interval.

mod common;

use common::fit::{Noise, VEIN, base, fitted, pulls, request};
use leafdyn::study::FitOutcome;

/// What no datum feels is named, alone or as a combination, and never given a
/// narrow interval.
#[test]
fn what_the_data_do_not_determine_is_named() {
    // In its plane a vein feels neither torsion nor bending out of it.
    let flat = VEIN.replace("[0.0, 0.0, -0.5]", "[0.0, 0.0, 0.0]");
    let forces = [[1.0, 0.3, 0.0], [0.5, 0.8, 0.0], [2.0, -0.4, 0.0]];
    let data = pulls(
        &flat,
        &["stiffness.bending_3=0.7"],
        &forces,
        1e-3,
        &mut Noise(3),
    );
    let free = [
        "stiffness.torsion",
        "stiffness.bending_2",
        "stiffness.bending_3",
    ];
    let found = fitted(&request(base(&flat, &[]), &[&data], &free));
    assert_eq!(found.outcome, FitOutcome::Undetermined);
    let named: Vec<Vec<&String>> = found
        .undetermined
        .iter()
        .map(|open| open.keys().collect())
        .collect();
    assert_eq!(named, [[free[0]], [free[1]]], "{:?}", found.says);
    for (parameter, known) in found.parameters.iter().zip([false, false, true]) {
        assert_eq!(parameter.determined, known, "{parameter:?}");
        assert_eq!(parameter.low.is_some() && parameter.high.is_some(), known);
    }
    // Of frequencies alone only the ratio of stiffness and mass is felt.
    let slender = VEIN.replace(
        "axial = 50.0, shear_2 = 40.0, shear_3 = 40.0",
        "axial = inf, shear_2 = inf, shear_3 = inf",
    );
    let slender = slender
        .replace("[0.0, 0.0, -0.5]", "[0.0, 0.0, 0.0]")
        .replace(", rotary_inertia = 1e-4", ", section_radius = 1e-2");
    let data = "frequency_1\n0.6\n0.61\n0.59\n";
    let free = [
        "stiffness.bending_2+stiffness.bending_3+stiffness.torsion",
        "dynamics.density",
    ];
    let found = fitted(&request(base(&slender, &[]), &[data], &free));
    assert_eq!(found.outcome, FitOutcome::Undetermined);
    let [open] = found.undetermined.as_slice() else {
        panic!("{:?}", found.undetermined);
    };
    assert!(
        open.values().all(|part| (part - 1.0).abs() < 1e-3),
        "{open:?}"
    );
    assert!(
        found
            .says
            .iter()
            .any(|said| said.contains("only as their ratio")),
        "{:?}",
        found.says
    );
}
