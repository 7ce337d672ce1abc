//! Fits of leaves under loads that turn with the section.

use leafdyn::study::FitOutcome;
use leafdyn_testing::fit::{fitted, gives_back, pulls, request, within_bars};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

/// Two veins under loads that turn with their sections.
const VEINS: &str = r#"
    name = "veins"
    leaf = { rods = 2, length = [1.0, 0.9], fan = [0.3, -0.2] }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = 60.0, shear_2 = 70.0, shear_3 = 50.0 }
    coupling = { x = 1.0, y = 2.0, z = 1.5 }
    load = { gravity = [0.1, 0.2, -0.5], follower = [0.2, -0.4, 0.8], couple = [0.3, 0.5, -0.2] }
"#;

const PULLS: [[f64; 3]; 5] = [
    [0.0; 3],
    [0.6, 0.0, 0.3],
    [0.0, 0.9, 0.0],
    [-0.3, 0.2, 0.8],
    [0.4, -0.8, -0.6],
];
const TRUTH: &str =
    "stiffness.bending_2=1.15; stiffness.torsion=0.7; load.follower=[0.2, -0.4, 0.95]";
const FREE: [&str; 3] = [
    "stiffness.bending_2",
    "stiffness.torsion",
    "load.follower[2]",
];
const WANTED: [f64; 3] = [1.15, 0.7, 0.95];

/// Stiffnesses and a load come back from tips: exactly without noise, within their bars with it.
#[test]
fn numbers_come_back_from_tips() {
    for sd in [0.0, 1e-3] {
        let table = pulls(VEINS, TRUTH, &PULLS, sd, &mut Draw(3));
        let table = if sd == 0.0 {
            table.replace(",0.0,0.0,0.0\n", ",1e-6,1e-6,1e-6\n")
        } else {
            table
        };
        let mut wanted = request(base(VEINS, ""), &[&table], &FREE);
        wanted.tolerance = Some(1e-8);
        let found = fitted(&wanted);
        assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.remarks);
        match sd == 0.0 {
            true => gives_back(&found, &WANTED, 1e-5),
            false => within_bars(&found, &WANTED, 2.5),
        }
    }
}
