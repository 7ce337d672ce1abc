//! Fits of leaves in a steady wind.

use leafdyn::study::{FitOutcome, FitRequest, fit};
use leafdyn_testing::fit::{fitted, gives_back, pulls, request, within_bars};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

const STIFFNESS: &str = "stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = 60.0, shear_2 = 70.0, shear_3 = 50.0 }";
const BLOWS: &str = "wind = { velocity = [0.5, 0.8, 1.0], density = 1.2, drag = 2.0, width = 0.3 }";

/// Two veins that share their tip.
fn veins() -> String {
    format!(
        "name = \"veins\"\nleaf = {{ rods = 2, length = [1.0, 0.9], fan = [0.3, -0.2] }}\n{STIFFNESS}\n{BLOWS}
         coupling = {{ x = 1.0, y = 2.0, z = 1.5 }}\nload = {{ gravity = [0.1, 0.2, -0.5] }}"
    )
}

/// A vein with more in the scenario.
fn vein(more: &str) -> String {
    format!(
        "name = \"vein\"\nleaf = {{ rods = 1, length = 1.0, fan = [0.2] }}\n{STIFFNESS}\n{BLOWS}\n{more}"
    )
}

const PULLS: [[f64; 3]; 5] = [
    [0.0; 3],
    [0.6, 0.0, 0.3],
    [0.0, 0.9, 0.0],
    [-0.3, 0.2, 0.8],
    [0.4, -0.8, -0.6],
];

/// Stiffnesses and the drag come back from tips: exactly without noise, within their bars with it.
#[test]
fn numbers_come_back_from_tips() {
    let free = ["stiffness.bending_2", "stiffness.bending_3", "wind.drag"];
    let truth = "stiffness.bending_2=1.15; stiffness.bending_3=1.7; wind.drag=2.4";
    let wanted = [1.15, 1.7, 2.4];
    for sd in [0.0, 1e-3] {
        let table = pulls(&veins(), truth, &PULLS, sd, &mut Draw(3));
        let table = table.replace(",0.0,0.0,0.0\n", ",1e-6,1e-6,1e-6\n");
        let mut asked = request(base(&veins(), ""), &[&table], &free);
        asked.tolerance = Some(1e-8);
        let found = fitted(&asked);
        assert_eq!(
            found.outcome,
            FitOutcome::Converged,
            "{sd} {:?}",
            found.remarks
        );
        match sd == 0.0 {
            true => gives_back(&found, &wanted, 1e-5),
            false => within_bars(&found, &wanted, 2.5),
        }
    }
}

/// The deflection of a cantilever across the wind is q L^4/8 EI, with the drag q = 1/2 density drag width
/// speed^2 per length: less than a part of the slope squared, (q L^3/6 EI)^2, is lost to its turning.
#[test]
fn a_cantilever_that_hardly_bends_gives_its_stiffness() {
    let text = r#"
        name = "cantilever"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
        wind = { velocity = [0.0, 0.0, 1.0], density = 1.2, drag = 2.0, width = 0.01 }
    "#;
    let (young, width) = (0.8, 0.01);
    let mut table = String::from("wind.velocity[2],tip_z,sd_tip_z\n");
    for speed in [0.5, 1.0, 1.3] {
        let drag = 0.5 * 1.2 * 2.0 * width * speed * speed;
        table += &format!("{speed:?},{:?},1e-8\n", drag / (8.0 * young));
    }
    let mut asked = request(base(text, ""), &[&table], &["stiffness.bending_2"]);
    asked.tolerance = Some(1e-10);
    let found = fitted(&asked);
    gives_back(&found, &[young], 1e-4);
    // The number of the wind, with the stiffness that it has.
    asked.base = base(text, &format!("stiffness.bending_2={young:?}"));
    asked.free = vec!["wind.width".parse().unwrap()];
    gives_back(&fitted(&asked), &[width], 1e-4);
}

/// What is measured on a leaf with these numbers, as a request with its stiffness, or its drag, free.
fn measured(text: &str, columns: &[&str], free: &str, truth: f64) -> FitRequest {
    let at = base(text, &format!("{free}={truth:?}"));
    let leaf = settle(at.scenario(), 1e-9);
    let values: Vec<String> = columns
        .iter()
        .map(|column| format!("{:?}", number_of(&leaf, column)))
        .collect();
    let deviations: Vec<String> = columns.iter().map(|it| format!("sd_{it}")).collect();
    let table = format!(
        "{},{}\n{},{}\n",
        columns.join(","),
        deviations.join(","),
        values.join(","),
        vec!["1e-3"; columns.len()].join(",")
    );
    let mut asked = request(base(text, ""), &[&table], &[free]);
    asked.tolerance = Some(1e-8);
    asked
}

/// The number in a column of experiments.
fn number_of(leaf: &Equilibrium, column: &str) -> f64 {
    let axis = match column.chars().last() {
        Some('x') => 0,
        Some('y') => 1,
        _ => 2,
    };
    let of = match column.split('_').next() {
        Some("reaction") => leaf.reaction.as_ref().unwrap().force,
        Some("grip") => leaf.grip_reactions[0].force,
        _ => leaf.tips[0],
    };
    of[axis]
}

const HELD: &str = "tip = { held = \"pinned\", position = [0.9, 0.3, 0.15] }";
const GRIPPED: &str = "grip = [{ vein = 1, at = [0.25, 0.5], stiffness = [0.0, inf, 4.0], move = [0.0, 0.03, 0.05] }]";

/// Tips and the forces that holders feel, next to which the drag acts, give numbers back; and the derivatives
/// by which their bars are told are differences of whole relaxations.
#[test]
fn every_quantity_is_differentiated() {
    let tips = ["tip_x", "tip_y", "tip_z"];
    let reactions = ["reaction_x", "reaction_y", "reaction_z"];
    let grips = ["grip_1_y", "grip_1_z", "tip_z"];
    for (more, columns) in [("", tips), (HELD, reactions), (GRIPPED, grips)] {
        for (free, truth) in [
            ("stiffness.bending_3", 1.6),
            ("wind.drag", 2.3),
            ("wind.velocity[1]", 0.9),
        ] {
            let text = vein(more);
            let found = fitted(&measured(&text, &columns, free, truth));
            gives_back(&found, &[truth], 1e-5);
            let error = found.parameters[0].standard_error.unwrap();
            let near = |step: f64| {
                let at = base(&text, &format!("{free}={:?}", truth * (1.0 + step)));
                settle(at.scenario(), 1e-10)
            };
            let step = 1e-3;
            let [before, behind] = [-step, step].map(near);
            let rates = columns.map(|column| {
                (number_of(&behind, column) - number_of(&before, column)) / (2.0 * step * truth)
            });
            let squares: f64 = rates.iter().map(|rate| (rate / 1e-3).powi(2)).sum();
            close(
                &format!("{free} {columns:?}"),
                error * squares.sqrt(),
                1.0,
                1e-4,
            );
            for (residual, rate) in found.residuals.iter().zip(rates) {
                let told = residual.band / found.residuals[0].band;
                let ratio = (rate / rates[0]).abs();
                assert!(
                    (told - ratio).abs() < 1e-4 * (1.0 + ratio),
                    "{free} {told} {ratio}"
                );
            }
        }
    }
}

/// Points traced on a vein in wind give its stiffness and the drag back.
#[test]
fn traced_points_give_stiffness_and_drag() {
    let truth = base(&vein(""), "stiffness.bending_2=1.2; wind.drag=1.7");
    let leaf = settle(truth.scenario(), 1e-9);
    let columns = "rod,sigma,x,y,z,sd";
    let (table, _) = leafdyn_testing::fit::traced(&leaf, [1, 2], columns, 0.0, &mut Draw(1));
    let free = ["stiffness.bending_2", "wind.drag"];
    let found = fitted(&request(base(&vein(""), ""), &[&table], &free));
    gives_back(&found, &[1.2, 1.7], 1e-3);
}

/// Wind that changes lets nothing rest.
#[test]
fn wind_that_changes_is_refused() {
    let text = vein("").replace(
        "[0.5, 0.8, 1.0]",
        "{ at = [0.0, 1.0], value = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]] }",
    );
    let asked = request(
        base(&text, ""),
        &["tip_x,sd_tip_x\n0.5,0.01\n"],
        &["stiffness.torsion"],
    );
    let said = fit(&asked, &mut |_| {}).unwrap_err().to_string();
    assert!(
        said.contains("a leaf comes to rest in steady wind only"),
        "{said}"
    );
}
