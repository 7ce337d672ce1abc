//! Speed against the number of veins: what scripts rely on.

mod workplace;

use serde_json::json;
use workplace::{Json, Workplace};

const COLUMNS: &str = "rods,method,knob,seconds,seconds_min,seconds_q1,seconds_q3,runs,steps,\
                       factorizations,force_evaluations,true_error,error_estimate,outcome";

#[test]
fn cost_is_charted_against_the_number_of_veins() {
    let place = Workplace::new();
    let methods = "--methods semi-implicit,semi-implicit-grid,shooting-from-rest";
    let how = "--seconds 0.05 --rods 3,2 --tolerance 1e-3";
    let run = place.run(format!("chart leaf.toml --set leaf.rods=2 {methods} {how}"));
    run.ends(0).says(&[
        "  veins    to a tolerance of 1e-3\n",
        "semi-implicit, extrapolated, N = 2: ",
        ", N = 3: ",
        "chart_rods.csv, chart_rods.svg, chart_rods.png",
    ]);
    place.picture("out/small/chart_rods");
    place.read("out/small/chart.csv");
    let rows = place.table("out/small/chart_rods.csv", COLUMNS);
    let who: Vec<_> = rows.iter().map(|row| [&row[1][..], &row[0]]).collect();
    let methods = ["semi-implicit", "semi-implicit-grid", "shooting-from-rest"];
    let wanted = methods
        .into_iter()
        .flat_map(|method| [[method, "2"], [method, "3"]]);
    assert_eq!(who, wanted.collect::<Vec<_>>());
    for row in &rows {
        let error: f64 = row[11].parse().unwrap();
        assert!(error <= 1e-3, "{row:?}");
        assert_eq!(row[13], "converged");
    }
    let chart = place.json("out/small/chart.json");
    assert_eq!(chart["scaling"]["tolerance"], 1e-3);
    assert_eq!(chart["scaling"]["unconfirmed"], json!([]));
    assert_eq!(chart["scaling"]["runs"].list().len(), 6);
}

/// Two joined veins buckle in one way; a single one may do so in any direction, so
/// that shooting cannot confirm it.
#[test]
fn a_leaf_of_rods_alone_that_is_not_confirmed_is_a_failure() {
    let asked = "chart leaf.toml --seconds 0.1 --methods semi-implicit-grid --write none \
                 --set leaf.rods=2 --set leaf.fan=symmetric --set load.gravity=[0,0,0] \
                 --set load.tip_force=[-12,0,0]";
    for (rods, status, unconfirmed) in [("1", 1, json!([1])), ("2", 0, json!([]))] {
        let chart = Workplace::new().told(status, format!("{asked} --rods {rods}"));
        assert_eq!(chart["reference"]["confirmed"], true);
        assert_eq!(chart["scaling"]["unconfirmed"], unconfirmed);
    }
}
