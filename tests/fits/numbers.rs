//! From made-up measurements back to the numbers that they were made with.

use leafdyn::study::FitOutcome;
use leafdyn_testing::fit::{LEAF, PULLS, THREE, VEIN, fitted, gives_back, pulls, request, traced};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

/// Without noise the numbers come back to many digits, whether positions or
/// frequencies are given.
#[test]
fn exact_data_give_the_exact_numbers() {
    let truth = "stiffness.bending_2=1.7; stiffness.bending_3=0.6; stiffness.axial=31";
    let exact = pulls(VEIN, truth, &PULLS, 0.0, &mut Draw(1));
    let exact = exact.replace(",0.0,0.0,0.0\n", ",1e-3,1e-3,1e-3\n");
    let mut wanted = request(base(VEIN, ""), &[&exact], &THREE);
    wanted.tolerance = Some(1e-8);
    let found = fitted(&wanted);
    assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.remarks);
    gives_back(&found, &[1.7, 0.6, 31.0], 1e-5);
    assert!(found.chi_squared < 1e-6);
    // The scenario that is written is the fitted one.
    let again = base(&found.fitted, "");
    let bending = again.scenario().rods[0].couple_stiffness[1].at(0.5);
    assert_eq!(bending, found.parameters[0].value);
}

#[test]
fn frequencies_give_stiffness_and_mass() {
    let truth = base(VEIN, "stiffness.bending_2=1.7; stiffness.bending_3=0.6");
    let found = relaxed(truth.scenario(), &with_modes(2, to(1e-8)));
    let modes = found.stability.modes.unwrap();
    let hertz = |k: usize| modes[k].frequency().unwrap() / std::f64::consts::TAU;
    let header = "frequency_1,frequency_2,sd_frequency_1,sd_frequency_2";
    let [one, two] = [0, 1].map(hertz);
    let data = format!("{header}\n{one:?},{two:?},1e-3,1e-3\n");
    let free = ["stiffness.bending_2", "stiffness.bending_3"];
    let begin = base(VEIN, "stiffness.bending_2=1.2");
    gives_back(&fitted(&request(begin, &[&data], &free)), &[1.7, 0.6], 1e-4);
}

/// Traced veins, marked or not, of which a photograph gives two coordinates.
#[test]
fn traced_veins_give_stiffnesses() {
    let truth = base(LEAF, "stiffness.bending_2=1.6; coupling.z=2.5");
    let leaf = settle(truth.scenario(), 1e-9);
    let free = ["stiffness.bending_2", "coupling.z"];
    for columns in ["rod,sigma,x,y,z", "rod,x,z"] {
        let (data, _) = traced(&leaf, [5, 1], columns, 0.0, &mut Draw(1));
        let found = fitted(&request(base(LEAF, ""), &[&data], &free));
        gives_back(&found, &[1.6, 2.5], 1e-3);
    }
}

/// A weight three times as large bends a vein three times as stiff as much: along what is not
/// known, gravity changes by itself while the stiffness changes by the factor e.
#[test]
fn what_weight_and_stiffness_share_is_named_in_their_units() {
    let heavy = VEIN
        .replace("-0.5", "-20.0")
        .replace("axial = 50.0, shear_2 = 40.0, shear_3 = 40.0", RIGIDLY);
    let leaf = settle(base(&heavy, "").scenario(), 1e-9);
    let (table, _) = traced(&leaf, [1, 1], "rod,x,z,sd", 0.0, &mut Draw(1));
    let free = ["stiffness.bending_2", "load.gravity[2]"];
    let found = fitted(&request(base(&heavy, ""), &[&table], &free));
    let open = only(&found.undetermined);
    let rate = open["load.gravity[2]"] / open["stiffness.bending_2"];
    close("change of gravity", rate, -20.0, 0.05);
    assert!(found.says.concat().contains("20 ln t"), "{:?}", found.says);
}

const RIGIDLY: &str = "axial = inf, shear_2 = inf, shear_3 = inf";

/// Data that no leaf like this can give: coordinates in millimetres of a leaf in metres, with and
/// without standard deviations, and deviations far below what the model leaves.
#[test]
fn data_that_contradict_the_model_are_not_fitted() {
    let hanging = "rod,x,z\n1,545.8,-40.0\n1,739.4,-99.9\n1,846.2,-500.2\n";
    let known = "rod,x,z,sd\n1,545.8,-40.0,0.01\n1,739.4,-99.9,0.01\n1,846.2,-500.2,0.01\n";
    let bent =
        "load.tip_force[2],tip_z,sd_tip_z\n0.0,-0.06,1e-3\n-0.5,-0.2,1e-3\n-1.0,-0.21,1e-3\n";
    let beats = "frequency_1,frequency_3\n0.5,0.51\n0.5,0.52\n";
    for data in [hanging, known, bent, beats] {
        let found = fitted(&request(base(VEIN, ""), &[data], &["stiffness.bending_2"]));
        assert_eq!(found.outcome, FitOutcome::Contradicted, "{data}");
        assert!(!found.is_success() && !found.parameters[0].determined);
        assert_eq!(found.parameters[0].low, None);
    }
}

/// Data whose scatter is within what chance allows do not contradict the model, nor do outliers of
/// a robust fit.
#[test]
fn data_within_their_deviations_do_not_contradict_the_model() {
    let truth = "stiffness.bending_2=1.7";
    let data = pulls(VEIN, truth, &PULLS, 1e-3, &mut Draw(7));
    let narrow = data.replace(",0.001,0.001,0.001", ",0.0007,0.0007,0.0007");
    assert_ne!(data, narrow);
    let asked = request(base(VEIN, ""), &[&narrow], &["stiffness.bending_2"]);
    assert_eq!(fitted(&asked).outcome, FitOutcome::Converged);
    let outlier = data.clone() + "0.0,0.0,0.0,-0.5,0.9,0.8,0.001,0.001,0.001\n";
    let mut asked = request(base(VEIN, ""), &[&outlier], &["stiffness.bending_2"]);
    assert_eq!(fitted(&asked).outcome, FitOutcome::Contradicted);
    asked.robust = true;
    assert_eq!(fitted(&asked).outcome, FitOutcome::Converged);
}

/// A number at the bound that was given for it is not determined by the data.
#[test]
fn a_number_at_its_bound_is_not_determined() {
    let data = pulls(VEIN, "stiffness.bending_2=1.7", &PULLS, 1e-3, &mut Draw(7));
    for (bounds, at) in [("0.5..1.5", 1.5), ("1.9..3", 1.9)] {
        let free = format!("stiffness.bending_2={bounds}");
        let begin = format!("stiffness.bending_2={at}");
        let asked = request(
            base(VEIN, &begin),
            &[&data.replace("0.001", "0.1")],
            &[&free],
        );
        let found = fitted(&asked);
        assert_eq!(found.parameters[0].value, at);
        assert!(!found.parameters[0].determined);
        assert_eq!(found.outcome, FitOutcome::Undetermined);
        assert!(
            found.says.concat().contains("at its bound"),
            "{:?}",
            found.says
        );
    }
}

/// Data in millimetres of a leaf in metres, forces a thousand times too small, and frequencies
/// of a leaf without mass.
#[test]
fn data_in_other_units_are_doubted() {
    let free = ["stiffness.bending_2"];
    let doubted = |text: &str, data: &str, code: &str| {
        let found = fitted(&request(base(text, ""), &[data], &free));
        found.remarks.iter().any(|remark| remark.code() == code)
    };
    let near = "rod,x,z\n1,0.5,-0.01\n1,0.9,-0.04\n1,0.98,-0.05\n";
    let far = "rod,x,z\n1,500,-10\n1,900,-40\n1,980,-50\n";
    assert!(!doubted(VEIN, near, "far-from-any-leaf"));
    assert!(doubted(VEIN, far, "far-from-any-leaf"));
    // Within the leaf's length, but not under these forces.
    let weak = "load.tip_force[2],tip_z\n1e-5,0.6\n2e-5,0.62\n-1e-5,0.58\n";
    assert!(!doubted(VEIN, weak, "far-from-any-leaf"));
    assert!(doubted(VEIN, weak, "far-from-fitted-leaf"));
    assert!(!doubted(VEIN, near, "far-from-fitted-leaf"));
    let massless = VEIN.replace("dynamics = { density = 1.0, rotary_inertia = 1e-4 }", "");
    let beats = "frequency_1\n0.5\n0.51\n0.49\n";
    assert!(!doubted(VEIN, beats, "no-density"));
    assert!(doubted(&massless, beats, "no-density"));
}
