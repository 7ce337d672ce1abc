//! What measurements leave open is named, and never given a narrow interval.

mod common;

use common::fit::{VEIN, fitted, pulls, request};
use common::random::Draw;
use common::*;
use leafdyn::study::FitOutcome;

/// What no datum feels is named, alone or as a combination, and never given a
/// narrow interval.
#[test]
fn what_the_data_do_not_determine_is_named() {
    // In its plane a vein feels neither torsion nor bending out of it.
    let flat = VEIN.replace("[0.0, 0.0, -0.5]", "[0.0, 0.0, 0.0]");
    let forces = [[1.0, 0.3, 0.0], [0.5, 0.8, 0.0], [2.0, -0.4, 0.0]];
    let truth = "stiffness.bending_3=0.7";
    let data = pulls(&flat, truth, &forces, 1e-3, &mut Draw(3));
    let free = [
        "stiffness.torsion",
        "stiffness.bending_2",
        "stiffness.bending_3",
    ];
    let found = fitted(&request(base(&flat, ""), &[&data], &free));
    assert_eq!(found.outcome, FitOutcome::Undetermined);
    let open = found.undetermined.iter();
    let named: Vec<Vec<&String>> = open.map(|open| open.keys().collect()).collect();
    assert_eq!(named, [[free[0]], [free[1]]], "{:?}", found.says);
    for (parameter, known) in found.parameters.iter().zip([false, false, true]) {
        assert_eq!(parameter.determined, known, "{parameter:?}");
        assert_eq!(parameter.low.is_some() && parameter.high.is_some(), known);
    }
    // Of frequencies alone only the ratio of stiffness and mass is felt.
    let slender = flat.replace(", rotary_inertia = 1e-4", ", section_radius = 1e-2");
    let data = "frequency_1\n0.6\n0.61\n0.59\n";
    let stiffness = "stiffness.bending_2+stiffness.bending_3+stiffness.torsion";
    let free = [stiffness, "dynamics.density"];
    let found = fitted(&request(base(&slender, RIGID), &[data], &free));
    assert_eq!(found.outcome, FitOutcome::Undetermined);
    let [open] = found.undetermined.as_slice() else {
        panic!("{:?}", found.undetermined);
    };
    let mut parts = open.values();
    assert!(parts.all(|part| (part - 1.0).abs() < 1e-3), "{open:?}");
    let mut says = found.says.iter();
    assert!(says.any(|said| said.contains("only as their ratio")));
}
