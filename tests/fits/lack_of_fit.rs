//! A fit does not call determined what follows from a model that lacks something: residuals that are
//! smooth along a column are found, and slack can be free.

use leafdyn::study::{Data, DataFileOptions, FitOutcome, fit};
use leafdyn_testing::fit::{fitted, request, within_bars};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

/// A strip pulled by jaws with 0.15 of slack; its modulus is 212.
const STRIP: &str = r#"
    name = "strip"
    leaf = { rods = 1, length = 100.0, fan = [0.0] }
    section = { shape = "rectangle", width = 30.0, thickness = 0.3, young = 100.0 }
    tip = { held = "clamped", position = [100.0, 0.0, 0.0] }
"#;
const SLACK: &str = "tip.position[0],reaction_x\n\
    100.1,-0.014\n100.2,-1.142\n100.3,-2.722\n100.4,-4.919\n100.5,-6.639\n100.6,-8.547\n100.7,-10.779\n\
    100.8,-12.426\n100.9,-14.304\n101.0,-16.327\n101.1,-18.295\n101.2,-20.029\n101.3,-22.030\n\
    101.4,-23.704\n101.5,-25.703\n101.6,-27.600\n101.7,-29.374\n101.8,-31.256\n101.9,-33.146\n\
    102.0,-35.262\n102.1,-37.180\n102.2,-39.066\n102.3,-41.032\n102.4,-42.730\n102.5,-44.826\n";

#[test]
fn slack_is_told_and_can_be_free() {
    let found = fitted(&request(base(STRIP, ""), &[SLACK], &["section.young"]));
    assert_eq!(found.outcome, FitOutcome::Systematic, "{:?}", found.says);
    let young = &found.parameters[0];
    assert!(!young.determined);
    assert!(young.high.unwrap() - young.low.unwrap() > 25.0, "{young:?}");
    assert!(found.says[0].contains("slack (offset:tip.position[0] is not free)"));
    let free = ["section.young", "offset:tip.position[0]"];
    let found = fitted(&request(base(STRIP, ""), &[SLACK], &free));
    assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.remarks);
    // The scatter of these data alone gives 211.0.
    within_bars(&found, &[212.0, -0.15], 1.5);
    assert_eq!(found.parameters[1].key, free[1]);
    assert!(found.fitted.contains("young") && !found.fitted.contains("offset"));
}

/// The zero of a column of results, and rows that are left out.
#[test]
fn a_load_cell_has_a_zero_and_rows_are_chosen() {
    let mut table = "tip.position[0],reaction_x,sd_reaction_x\n".to_string();
    let mut noise = Draw(11);
    for row in 1..=12 {
        let (moved, area) = (0.1 * f64::from(row), 9.0);
        let force = -212.0 * area * moved / 100.0 + 0.4 + 0.02 * noise.normal();
        table += &format!("{},{force},0.02\n", 100.0 + moved);
    }
    table += "100.0,50.0,0.02\n";
    let mut data = Data {
        reading: DataFileOptions {
            rows: vec!["tip.position[0]>100.05 and reaction_x<10".parse().unwrap()],
            ..DataFileOptions::default()
        },
        ..Data::default()
    };
    data.read(&table, "cell.csv", 1).unwrap();
    assert_eq!(data.files[0].rows, 12);
    let mut asked = request(
        base(STRIP, ""),
        &[],
        &["section.young", "offset:reaction_x"],
    );
    asked.data = data;
    let found = fitted(&asked);
    assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.says);
    close("modulus", found.parameters[0].value, 212.0, 1.0);
    // What is added to the column takes its zero away.
    close("zero", found.parameters[1].value, -0.4, 0.1);
    asked.data.reading.rows = vec!["tip_z>1".parse().unwrap()];
    let said = fit(&asked, &mut |_| {}).unwrap_err().to_string();
    assert!(said.contains("rows are chosen by tip_z"), "{said}");
}

/// A bent vein, and what is true of it in place of what the model says.
const VEIN: &str = r#"
    name = "vein"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 5.0, bending_2 = 1.0, bending_3 = 5.0, axial = inf, shear_2 = inf, shear_3 = inf }
    rest = { bend_2 = 0.0 }
    load = { tip_force = [0.0, 0.0, 0.0] }
"#;
const TRUTHS: [&str; 4] = [
    "rest.bend_2=0.4",
    "stiffness.bending_2={at=[0.0,1.0],value=[1.5,0.3]}",
    "load.tip_force[0]=1.0",
    "load.tip_force[0]=0.0",
];

/// Heights of the tip under rising forces, without errors; of the last kind with a drift.
fn heights(kind: usize, rows: usize) -> Vec<[f64; 2]> {
    let height = |row: usize| {
        let force = 3.0 * (row as f64 + 1.0) / rows as f64;
        let truth = format!("{}; load.tip_force[2]={force}", TRUTHS[kind]);
        let tip = settle(base(VEIN, &truth).scenario(), 1e-8).tips[0];
        let drift = if kind == 3 {
            0.1 * (row as f64 / rows as f64).powi(2)
        } else {
            0.0
        };
        [force, tip.z + drift]
    };
    (0..rows).map(height).collect()
}

/// Of the fits with a false model, whose effect on a datum is beyond three standard deviations, 95 % are
/// flagged, and of those with a true one no more than 5 %. `LEAFDYN_LEAVES` fits of each are made.
#[test]
fn false_models_are_flagged_and_true_ones_are_not() {
    let count = std::env::var("LEAFDYN_LEAVES").ok();
    let count: usize = count.and_then(|it| it.parse().ok()).unwrap_or(20);
    let mut noise = Draw(62);
    let (mut missed, mut wrong) = (0, 0);
    for number in 0..count {
        let (kind, rows) = (number % 4, 8 + (33.0 * noise.even()) as usize);
        let with_sd = number / 4 % 2 == 0;
        let exact = heights(kind, rows);
        let flagged = |model: &str, sd: f64, values: &[[f64; 2]], with_sd: bool| {
            let mut table = "load.tip_force[2],tip_z".to_string();
            table += if with_sd { ",sd_tip_z\n" } else { "\n" };
            for [force, height] in values {
                let told = if with_sd {
                    format!(",{sd}")
                } else {
                    String::new()
                };
                table += &format!("{force},{height}{told}\n");
            }
            let truth = fitted(&request(
                base(VEIN, model),
                &[&table],
                &["scale:stiffness.bending_2"],
            ));
            let off = truth.residuals.iter().map(|it| (it.data - it.model).abs());
            let is_told = matches!(
                truth.outcome,
                FitOutcome::Systematic | FitOutcome::Contradicted
            );
            (is_told, off.fold(0.0_f64, f64::max))
        };
        let (_, effect) = flagged("", 1.0, &exact, true);
        let sd = effect / (3.0 + 3.0 * noise.even());
        let mut noisy = |values: &[[f64; 2]]| -> Vec<[f64; 2]> {
            let noisy = values
                .iter()
                .map(|[force, it]| [*force, it + sd * noise.normal()]);
            noisy.collect()
        };
        let (found, _) = flagged("", sd, &noisy(&exact), with_sd);
        missed += usize::from(!found);
        // The drift is none of the model's: there the truth is what the model is.
        let (model, values) = match kind {
            3 => (
                "",
                exact
                    .iter()
                    .enumerate()
                    .map(|(row, [force, it])| {
                        [*force, it - 0.1 * (row as f64 / rows as f64).powi(2)]
                    })
                    .collect(),
            ),
            _ => (TRUTHS[kind], exact),
        };
        let (found, _) = flagged(model, sd, &noisy(&values), with_sd);
        wrong += usize::from(found);
    }
    println!("{count} fits of each: {missed} false models missed, {wrong} true ones flagged");
    assert!(20 * missed <= count, "{missed} of {count}");
    assert!(20 * wrong <= count, "{wrong} of {count}");
}
