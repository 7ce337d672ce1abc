//! Which measurement would say most, and what a holder of the tip feels as a datum.

use leafdyn::study::{FitError, FitOutcome, FitRequest, fit};
use leafdyn_testing::fit::{VEIN, fitted, gives_back, pulls, request};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

/// Pulls in the plane of a vein say nothing about torsion and bending out of it; of the
/// experiments that could be made, the one out of the plane comes first, and once it
/// is made with made-up data the number is known.
#[test]
fn the_best_next_measurement_is_named() {
    let flat = VEIN.replace("[0.0, 0.0, -0.5]", "[0.0, 0.0, 0.0]");
    let forces = [[1.0, 0.3, 0.0], [0.5, 0.8, 0.0], [2.0, -0.4, 0.0]];
    let made = |forces: &[[f64; 3]]| {
        let data = pulls(&flat, "", forces, 1e-3, &mut Draw(5));
        let free = ["stiffness.bending_2", "stiffness.bending_3"];
        request(base(&flat, "stiffness.bending_2=1.3"), &[&data], &free)
    };
    let table = "experiment,load.tip_force[0],load.tip_force[1],load.tip_force[2],tip_x,tip_y,tip_z\n\
                 again,1.0,0.4,0.0,,,\naside,0.5,-0.9,0.0,,,\nup,0.0,0.0,0.7,,,\n";
    let wanted = FitRequest {
        candidates: FitRequest::read_candidates(table, "next.csv", &[]).unwrap(),
        ..made(&forces)
    };
    let found = fitted(&wanted);
    assert_eq!(found.outcome, FitOutcome::Undetermined);
    assert_eq!(found.candidates[0].experiment, "up");
    let bits: Vec<f64> = found.candidates.iter().map(|one| one.bits).collect();
    assert!(bits[0] > bits[1] + 1.0, "{bits:?}");
    assert!(bits.is_sorted_by(|a, b| a >= b), "{bits:?}");
    assert!(found.candidates[0].shrinks < 0.1);
    assert!(found.candidates[1..].iter().all(|one| one.shrinks > 0.9));
    // Each of them made.
    let with = |force: [f64; 3]| fitted(&made(&[&forces[..], &[force]].concat())).outcome;
    assert_eq!(with([0.0, 0.0, 0.7]), FitOutcome::Converged);
    assert_eq!(with([1.0, 0.4, 0.0]), FitOutcome::Undetermined);
}

/// A vein whose tip is pinned.
fn pinned(position: [f64; 3]) -> String {
    format!("{VEIN}\ntip = {{ held = \"pinned\", position = {position:?} }}")
}

/// Forces of a testing machine at several places of its grip give the stiffnesses back.
#[test]
fn reactions_give_stiffnesses() {
    let truth = "stiffness.bending_2=1.7; stiffness.axial=31";
    let text = pinned([0.9, 0.0, -0.1]);
    let felt = "reaction_x,reaction_y,reaction_z,sd_reaction_x,sd_reaction_y,sd_reaction_z";
    let mut table = format!("tip.position[0],{felt}\n");
    for x in [0.9, 0.95, 1.0, 1.03] {
        let placed = base(&text, &format!("{truth}; tip.position=[{x:?}, 0.0, -0.1]"));
        let leaf = settle(placed.scenario(), 1e-9);
        let [fx, fy, fz] = leaf.reaction.unwrap().force.to_array();
        table += &format!("{x:?},{fx:?},{fy:?},{fz:?},1e-3,1e-3,1e-3\n");
    }
    let free = ["stiffness.bending_2", "stiffness.axial"];
    let found = fitted(&request(base(&text, ""), &[&table], &free));
    assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.remarks);
    gives_back(&found, &[1.7, 31.0], 1e-4);
}

/// A push that crushes the vein, and a grip farther away than a vein is long that does
/// not stretch, leave no equilibrium; the message names the row, and what to do.
#[test]
fn an_experiment_without_equilibrium_is_named() {
    let refused = |text: &str, entries: &str, table: &str, free: &str| -> FitError {
        let asked = request(base(text, entries), &[table], &[free]);
        fit(&asked, &mut |_| {}).unwrap_err()
    };
    let table = "load.tip_force[0],tip_x\n1.0,0.9\n2.0,0.92\n-1e6,0.1\n";
    let crushed = refused(VEIN, "", table, "stiffness.bending_2");
    assert!(matches!(crushed, FitError::NoEquilibrium(_)), "{crushed}");
    let said = crushed.to_string();
    assert!(said.contains("data0.csv:4"), "{said}");
    assert!(said.contains("leave this experiment out"), "{said}");
    let text = pinned([0.9, 0.0, -0.1]);
    let table = "tip.position[0],reaction_x\n0.9,1.0\n0.92,1.2\n1.5,2.0\n";
    let said = refused(&text, RIGID, table, "stiffness.bending_2").to_string();
    assert!(said.contains("data0.csv:4"), "{said}");
    assert!(said.contains("away from the base"), "{said}");
    // What is infinite cannot be free.
    let said = refused(&text, RIGID, table, "stiffness.axial").to_string();
    assert!(said.contains("is infinite"), "{said}");
}
