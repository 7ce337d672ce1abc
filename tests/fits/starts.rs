//! The answer of a fit does not depend on where it starts, and other sets of numbers that fit as well
//! are named.

use leafdyn::study::{Fit, FitOutcome, FitRemark};
use leafdyn_testing::fit::{VEIN, fitted, gives_back, pulls, request};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

/// A blade that is bent, in newtons and metres; its modulus is 2.4e9.
const BLADE: &str = r#"
    name = "blade"
    units = { length = "m", force = "N" }
    leaf = { rods = 1, length = 0.2, fan = [0.0] }
    section = { shape = "rectangle", width = 0.01, thickness = 0.0005, young = 1e9, poisson = 0.3, mass_density = 900.0 }
"#;
const BENT: &str =
    "load.tip_force[2],tip_z\n-0.001,-0.0107536\n-0.002,-0.0212039\n-0.004,-0.0407607\n";

/// The order of magnitude of a modulus need not be known.
#[test]
fn a_modulus_is_found_from_any_decade() {
    for young in ["1e4", "1e6", "1e9", "1e12", "1e13", "1e15"] {
        let begin = base(BLADE, &format!("section.young={young}"));
        let found = fitted(&request(begin, &[BENT], &["section.young"]));
        assert_eq!(
            found.outcome,
            FitOutcome::Converged,
            "{young}: {:?}",
            found.remarks
        );
        gives_back(&found, &[2.4e9], 5e-3);
    }
}

/// Where no decade is nearer to the data, that is said: a tip that the load does not move.
#[test]
fn that_no_decade_is_nearer_is_said() {
    let apart = "tip_y\n0.19\n0.18\n0.19\n";
    let begin = base(BLADE, "load.tip_force=[0, 0, -0.001]");
    let found = fitted(&request(begin, &[apart], &["section.young"]));
    let nearer = FitRemark::NoDecadeNearer;
    assert!(found.remarks.contains(&nearer), "{:?}", found.remarks);
    assert!(!found.is_success());
}

/// A leaf of three veins whose pinned tip is moved: where it is compressed, there is more than one
/// equilibrium, and at some of these initial values none that is certain.
const PINNED: &str = r#"
    name = "pinned"
    leaf = { rods = 3, length = 1.0, fan = "symmetric" }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 500.0, shear_2 = inf, shear_3 = inf }
    coupling = { y = 1.0, z = 1.0 }
    tip = { held = "pinned", position = [0.9, 0.0, 0.0] }
"#;
const PULLED: &str = "tip.position[0],reaction_x\n0.94,23.5900\n0.95,16.9897\n0.96,10.1251\n\
                      0.97,2.6796\n0.98,-4.8279\n0.99,-12.8342\n";

#[test]
fn a_start_without_equilibrium_or_on_another_branch_is_left() {
    for axial in [480.0, 500.0, 530.0, 560.0, 600.0] {
        let begin = base(PINNED, &format!("stiffness.axial={axial}"));
        let free = ["stiffness.axial", "stiffness.bending_3"];
        let found = fitted(&request(begin, &[PULLED], &free));
        assert_eq!(
            found.outcome,
            FitOutcome::Converged,
            "{axial}: {:?}",
            found.remarks
        );
        gives_back(&found, &[319.08, 1.0195], 5e-3);
    }
}

/// Frequencies do not say which axis of a section is the stiff one.
#[test]
fn exchanged_axes_are_named() {
    let rod = VEIN
        .replace(
            "axial = 50.0, shear_2 = 40.0, shear_3 = 40.0",
            "axial = inf, shear_2 = inf, shear_3 = inf",
        )
        .replace("load = { gravity = [0.0, 0.0, -0.5] }", "");
    let beats = "frequency_1,frequency_2,frequency_3,frequency_4\n0.6130,0.9692,3.8416,6.0741\n";
    let free = ["stiffness.bending_2", "stiffness.bending_3"];
    let found = fitted(&request(base(&rod, ""), &[beats], &free));
    assert_eq!(found.outcome, FitOutcome::Undetermined);
    let [one, other] = [0, 1].map(|k| &found.parameters[k]);
    assert!(!one.determined && !other.determined);
    let alternative = only(&found.alternatives);
    close("exchanged", alternative.values[free[0]], other.value, 1e-3);
    close("exchanged", alternative.values[free[1]], one.value, 1e-3);
    close("as well", alternative.chi_squared, found.chi_squared, 0.2);
    assert!(found.says.concat().contains("other values fit as well"));
    assert_eq!(only(&found.tried), "the axes of the section exchanged");
    // A weight tells them apart.
    let bent = pulls(
        VEIN,
        "stiffness.bending_2=3.0; stiffness.bending_3=1.2",
        &[[0.1, 0.3, 0.4]],
        1e-4,
        &mut Draw(3),
    );
    let found = fitted(&request(base(VEIN, ""), &[&bent], &free));
    assert_eq!(found.outcome, FitOutcome::Converged);
    assert!(found.alternatives.is_empty());
}

/// What is seen of one side only does not say to which side a force points.
#[test]
fn mirror_images_are_named() {
    let truth = "load.tip_force=[0.0, 0.7, 0.0]";
    let leaf = settle(base(VEIN, truth).scenario(), 1e-9);
    let (table, _) = leafdyn_testing::fit::traced(&leaf, [1, 1], "rod,x,z,sd", 1e-4, &mut Draw(5));
    let begin = base(VEIN, "load.tip_force=[0.0, 0.3, 0.0]");
    let found = fitted(&request(begin, &[&table], &["load.tip_force[1]"]));
    assert_eq!(
        found.outcome,
        FitOutcome::Undetermined,
        "{:?}",
        found.parameters
    );
    let value = only(&found.alternatives).values["load.tip_force[1]"];
    close("mirrored", value, -found.parameters[0].value, 1e-3);
}

/// Values that may fit as well cost no more than a look, where the search would lead back.
#[test]
fn a_fit_that_is_unique_costs_one_evaluation_more() {
    let truth = "stiffness.bending_2=1.3; stiffness.bending_3=0.8";
    let data = pulls(
        VEIN,
        truth,
        &leafdyn_testing::fit::PULLS,
        1e-3,
        &mut Draw(8),
    );
    let work = |free: &[&str]| {
        let found = fitted(&request(base(VEIN, truth), &[&data], free));
        assert_eq!(found.outcome, FitOutcome::Converged);
        (found.tried.len(), found.work.evaluations)
    };
    let (tried, alone) = work(&["stiffness.bending_2"]);
    assert_eq!(tried, 0);
    let (tried, both) = work(&["stiffness.bending_2", "stiffness.bending_3"]);
    assert_eq!(tried, 1);
    assert!(both <= alone + 2, "{both} after {alone}");
}

/// Soft veins under forces that say how soft they are, and initial values from which the plain search
/// ends in a valley that the data contradict.
const SOFT: &str = r#"
    name = "soft"
    leaf = { rods = 3, length = 1.0, fan = "symmetric" }
    stiffness = { torsion = 0.12184171565573146, bending_2 = 0.1039337847693259, bending_3 = 0.0315782543534351, axial = 458.1345312746382, shear_2 = 40.0, shear_3 = 40.0 }
    load = { gravity = [0.0, 0.0, -0.3860082930064991] }
    coupling = { y = 0.5, z = 0.5 }
"#;
const SAGGED: &str = "\
load.tip_force[0],load.tip_force[1],load.tip_force[2],tip_x,tip_y,tip_z,sd_tip_x,sd_tip_y,sd_tip_z
-0.01604627610571526,-0.010445125728233142,0.022445002034764655,0.8802182332780252,0.028409752489404697,-0.39402440243154424,0.0017656150348253322,0.0017656150348253322,0.0017656150348253322
0.26786899092515165,0.023421960506608195,-0.03758599361516363,0.9052368297492256,0.04925692978002703,-0.3481229822564471,0.0017656150348253322,0.0017656150348253322,0.0017656150348253322
-0.02869736892429635,-0.04984650957764181,-0.08277386770237057,0.8225232474610472,-0.11935473923304181,-0.46495974974633003,0.0017656150348253322,0.0017656150348253322,0.0017656150348253322
-0.03079084772923291,0.0,0.08345620633333357,0.8973204876259218,-0.04620186256499005,-0.35433346338563604,0.0017656150348253322,0.0017656150348253322,0.0017656150348253322
";

/// Searches elsewhere do not replace a minimum by values that are none.
#[test]
fn a_minimum_is_not_left_for_values_that_are_none() {
    let free = ["bending_2", "axial", "torsion", "bending_3"].map(|it| format!("stiffness.{it}"));
    let free: Vec<&str> = free.iter().map(String::as_str).collect();
    let found = fitted(&request(base(SOFT, ""), &[SAGGED], &free));
    assert_eq!(
        found.outcome,
        FitOutcome::Contradicted,
        "{:?}",
        found.remarks
    );
    // Nor do they go on and on where nothing else fits.
    assert!(found.work.evaluations <= 250, "{:?}", found.work);
}

/// A rod that is curved at rest and pulled straight: as its stiffness changes, its tip comes near the
/// data more than once.
const CURL: &str = r#"
    name = "curl"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 10.0, bending_2 = 1.0, bending_3 = 10.0, axial = inf, shear_2 = inf, shear_3 = inf }
"#;

/// A fit of the bending stiffness to tips, from initial values that are far from the data.
fn uncurled(curvature: f64, start: f64, rows: &str) -> Fit {
    let begin = format!("rest.bend_2={curvature}; stiffness.bending_2={start}");
    let tips = "load.tip_force[0],load.tip_force[2],tip_x,sd_tip_x\n".to_string() + rows;
    fitted(&request(
        base(CURL, &begin),
        &[&tips],
        &["stiffness.bending_2"],
    ))
}

/// What the initial values lead to is found even where the values of another decade are nearer to the
/// data, but lead to a minimum that the data contradict; and a fit that begins with the values found
/// stays there.
#[test]
fn a_decade_that_is_nearer_does_not_hide_the_minimum_beside_the_start() {
    let contradicted = "2.525,1.858,0.91814,0.003\n3.283,2.416,0.96076,0.003\n";
    let found = uncurled(2.098, 3.98, contradicted);
    assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.remarks);
    gives_back(&found, &[1.17], 1e-3);
    let again = uncurled(2.098, found.parameters[0].value, contradicted);
    assert_eq!(again.outcome, FitOutcome::Converged, "{:?}", again.remarks);
    gives_back(&again, &[found.parameters[0].value], 1e-4);
    assert!(again.work.evaluations <= 6, "{:?}", again.work);
}
