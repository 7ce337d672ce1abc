//! Forces on grips along veins as data.

use leafdyn::study::{FitOutcome, fit};
use leafdyn_testing::fit::{fitted, gives_back, request};
use leafdyn_testing::*;

/// Three veins with tissue, both margins held along a stretch.
const ACROSS: &str = r#"
    name = "across"
    leaf = { rods = 3, length = 1.0, fan = [0.0, 0.0, 0.0], joined = false, base = [[0.0, -0.2, 0.0], [0.0, 0.0, 0.0], [0.0, 0.2, 0.0]] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 2.0, axial = 200.0, shear_2 = 80.0, shear_3 = 80.0 }
    tissue = { along = 20.0, across = 40.0, normal = 30.0, fold = 0.5 }
    grip = [{ vein = 1, at = [0.25, 0.75] }, { vein = 3, at = [0.25, 0.75], held = "clamped" }]
"#;

/// The forces of a machine that pulls the margins apart, and along the veins, give the stiffness of
/// the tissue and of the veins back.
#[test]
fn forces_on_grips_give_stiffnesses() {
    let truth = "tissue.across=47; tissue.along=16; stiffness.axial=170";
    let mut table = String::from(
        "grip[1].move[1],grip[1].move[0],grip_1_x,grip_2_x,grip_2_y,sd_grip_1_x,sd_grip_2_x,sd_grip_2_y\n",
    );
    for [y, x] in [[0.02, 0.0], [0.08, 0.0], [0.02, 0.03], [0.0, -0.03]] {
        let moved = base(
            ACROSS,
            &format!("{truth}; grip[1].move=[{x:?}, {y:?}, 0.0]"),
        );
        let leaf = settle(moved.scenario(), 1e-9);
        let [one, other] = [0, 1].map(|k| leaf.grip_reactions[k].force);
        let felt = format!("{:?},{:?},{:?}", one.x, other.x, other.y);
        table += &format!("{y:?},{x:?},{felt},1e-3,1e-3,1e-3\n");
    }
    let free = ["tissue.across", "tissue.along", "stiffness.axial"];
    let found = fitted(&request(base(ACROSS, ""), &[&table], &free));
    assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.remarks);
    gives_back(&found, &[47.0, 16.0, 170.0], 1e-4);
}

#[test]
fn a_grip_that_is_not_there_is_refused() {
    let table = "grip[1].move[1],grip_3_y,sd_grip_3_y\n0.02,1.0,0.1\n";
    let asked = request(base(ACROSS, ""), &[table], &["tissue.across"]);
    let said = fit(&asked, &mut |_| {}).unwrap_err().to_string();
    assert!(
        said.contains("grip_3_y is what a grip feels, counted from 1"),
        "{said}"
    );
    assert!(said.contains("has 2 of [[grip]]"), "{said}");
}
