//! What scripts rely on when they check a leaf: streams, files, exit statuses
//! and the keys of `check.json`.

mod workplace;

use std::fs;
use std::path::Path;

use serde_json::Value;
use workplace::{Workplace, is_whole_png, text};

const FILES: [&str; 3] = ["check.json", "check.png", "check.svg"];

/// The path of a scenario that comes with the program.
fn scenario(name: &str) -> String {
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    scenarios.join(name).to_str().unwrap().into()
}

/// `check.json` as printed, and the exit status.
fn check(arguments: &[&str]) -> (Value, i32) {
    let place = Workplace::new();
    let arguments: Vec<&str> = ["check"].iter().chain(arguments).copied().collect();
    let output = place.run(&[&arguments[..], &["--json", "--out", "out"]].concat());
    let written = fs::read(place.path("out/check.json")).unwrap_or_default();
    assert_eq!(
        text(&output.stdout),
        text(&written),
        "{}",
        text(&output.stderr)
    );
    let value = serde_json::from_slice(&output.stdout).unwrap();
    (value, output.status.code().unwrap())
}

#[test]
fn help_names_every_option_and_exit_status() {
    let output = Workplace::new().run(&["check", "--help"]);
    assert_eq!(output.status.code(), Some(0));
    for part in [
        "--tolerance",
        "--set",
        "--out",
        "--json",
        "--intervals",
        "--keep-unstable",
        "0 both methods agree",
        "1 they differ or could not be compared",
        "2 the request was refused",
    ] {
        assert!(text(&output.stdout).contains(part), "{part}");
    }
}

#[test]
fn both_methods_agree_on_a_leaf_of_the_paper() {
    let place = Workplace::new();
    let fig04 = scenario("paper/fig04.toml");
    let output = place.run(&["check", &fig04, "--set", "leaf.rods=5"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(text(&output.stderr), "");
    for part in [
        "fig04: 5 veins joined at the tip",
        "verdict  both methods agree",
        "relaxed  stable equilibrium",
        "shooting stable equilibrium",
        "positions by ",
        "rotations by ",
        "forces by ",
        "moments by ",
        "at most, in vein ",
        "growth",
        "out/fig04: check.json, check.svg, check.png",
    ] {
        let report = text(&output.stdout);
        assert!(report.contains(part), "{part} in {report}");
    }
    assert_eq!(place.names("out/fig04"), FILES);
    assert!(is_whole_png(&place.path("out/fig04/check.png")));
    let svg = fs::read_to_string(place.path("out/fig04/check.svg")).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    assert!(svg.contains("fig04: both methods agree"));
}

#[test]
fn the_json_has_both_solutions_and_their_differences() {
    let (check, status) = check(&["leaf.toml"]);
    assert_eq!(status, 0);
    assert_eq!(check["scenario"], "small");
    assert_eq!(check["verdict"], "agree");
    assert_eq!(check.get("reason"), None);
    assert_eq!(check["rods"], 5);
    assert_eq!(check["tolerance"], 1e-6);
    assert_eq!(check["within_estimates"], true);
    for quantity in ["position", "rotation", "force", "moment"] {
        let along = check["differences"].as_array().unwrap();
        let along = along.iter().map(|found| found[quantity].as_f64().unwrap());
        let largest = check["difference"][quantity].as_f64().unwrap();
        assert_eq!(along.fold(0.0, f64::max), largest, "{quantity}");
        assert!(largest < 1e-6, "{quantity}: {largest}");
        assert!(check["shooting"]["error_estimate"][quantity].is_number());
    }
    let stations = check["stations"].as_array().unwrap().len();
    assert_eq!(check["differences"].as_array().unwrap().len(), stations);
    for method in ["relaxation", "shooting"] {
        assert_eq!(check[method]["outcome"], "converged");
        assert_eq!(check[method]["stable"], true);
        assert_eq!(check[method]["negative_eigenvalues"], 0);
        assert_eq!(check[method]["tip"].as_array().unwrap().len(), 3);
        assert!(check[method]["energy"].is_number());
        assert!(check[method]["wall_seconds"].as_f64().unwrap() > 0.0);
    }
    let shooting = &check["shooting"];
    assert_eq!(shooting["intervals"], 1);
    assert_eq!(shooting["neutral"], Value::Null);
    for key in ["growth_log10", "defect", "condition"] {
        assert!(shooting[key].is_number(), "{key}");
    }
    for key in ["iterations", "linearizations", "steps", "slopes"] {
        assert!(shooting["work"][key].as_u64().unwrap() > 0, "{key}");
    }
}

#[test]
fn tolerance_and_intervals_are_as_asked() {
    let arguments = ["leaf.toml", "--tolerance", "1e-8", "--intervals", "7"];
    let (check, status) = check(&arguments);
    assert_eq!(status, 0);
    assert_eq!(check["tolerance"], 1e-8);
    assert_eq!(check["shooting"]["intervals"], 7);
    assert!(check["difference"]["position"].as_f64().unwrap() < 1e-8);
}

#[test]
fn a_saddle_is_called_unstable_by_both() {
    let fig10 = scenario("paper/fig10.toml");
    let arguments = ["check", &fig10, "--set", "leaf.rods=5", "--keep-unstable"];
    let place = Workplace::new();
    let output = place.run(&arguments);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    for part in [
        "relaxed  unstable equilibrium of index 18",
        "shooting unstable equilibrium of index 18",
    ] {
        assert!(text(&output.stdout).contains(part), "{part}");
    }
    let check = fs::read(place.path("out/fig10/check.json")).unwrap();
    let check: Value = serde_json::from_slice(&check).unwrap();
    for method in ["relaxation", "shooting"] {
        assert_eq!(check[method]["stable"], false);
        assert_eq!(check[method]["negative_eigenvalues"], 18);
    }
}

#[test]
fn a_neutral_direction_is_explained() {
    // Euler's load: the straight column may buckle sideways.
    let column = scenario("classic/elastica_buckled.toml");
    let load = "load.tip_force=[-2.46740110027,0,0]";
    let (check, _) = check(&[&column, "--set", load, "--keep-unstable"]);
    let neutral = &check["shooting"]["neutral"];
    assert!(neutral["ratio"].as_f64().unwrap() < 1e-7);
    let meaning = neutral["meaning"].as_str().unwrap();
    assert!(meaning.contains("bifurcation") && meaning.contains("along y"));
    let rods = neutral["displacement"].as_array().unwrap();
    let tip = rods[0].as_array().unwrap().last().unwrap();
    assert!((tip[1].as_f64().unwrap().abs() - 1.0).abs() < 1e-9);
}

#[test]
fn free_tips_are_listed() {
    let (check, status) = check(&["leaf.toml", "--set", "leaf.joined=false"]);
    assert_eq!(status, 0);
    for method in ["relaxation", "shooting"] {
        assert_eq!(check[method]["tip"], Value::Null);
        assert_eq!(check[method]["tips"].as_array().unwrap().len(), 5);
    }
}

/// Single shooting cannot follow a leaf that is pulled hard.
#[test]
fn what_could_not_be_compared_is_told_with_the_reason() {
    let fig08 = scenario("paper/fig08.toml");
    let pulled = [
        "check",
        &fig08,
        "--set",
        "leaf.rods=5",
        "--set",
        "load.tip_force=[5,0,0]",
    ];
    let place = Workplace::new();
    let single = [&pulled[..], &["--intervals", "1"]].concat();
    let output = place.run(&single);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    for part in [
        "verdict  could not be compared: ",
        "use more intervals",
        "relaxed  stable equilibrium",
        "shooting no solution in ",
    ] {
        assert!(text(&output.stdout).contains(part), "{part}");
    }
    assert_eq!(place.names("out/fig08"), FILES);
    assert!(is_whole_png(&place.path("out/fig08/check.png")));

    let (check, status) = check(&single[1..]);
    assert_eq!(status, 1);
    assert_eq!(check["verdict"], "not-compared");
    let reason = check["reason"].as_str().unwrap();
    assert!(reason.contains("use more intervals"), "{reason}");
    assert_eq!(check["shooting"]["outcome"], "no-convergence");
    assert_eq!(check["shooting"]["tip"], Value::Null);
    assert!(check["shooting"]["wall_seconds"].is_number());
    assert_eq!(check["difference"], Value::Null);
    assert_eq!(check["differences"].as_array().unwrap().len(), 0);

    let many = place.run(&pulled);
    assert_eq!(many.status.code(), Some(0), "{}", text(&many.stdout));
    assert!(text(&many.stdout).contains("multiple shooting over "));
}

#[test]
fn json_goes_alone_to_standard_output_and_the_reason_to_standard_error() {
    let place = Workplace::new();
    let heavy = "load.gravity=[0,0,-1e7]";
    let output = place.run(&["check", "leaf.toml", "--set", heavy, "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let check: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(check["verdict"], "not-compared");
    assert_eq!(check["shooting"], Value::Null);
    let reason = check["reason"].as_str().unwrap();
    assert!(reason.contains("did not come to rest"), "{reason}");
    assert!(text(&output.stderr).contains(reason));
}

#[test]
fn bad_requests_are_refused_before_anything_is_written() {
    for (arguments, message) in [
        (vec!["leaf.toml", "--intervals", "0"], "--intervals 0"),
        (vec!["leaf.toml", "--intervals", "5000"], "1 to 4096"),
        (vec!["leaf.toml", "--tolerance", "-1"], "tolerance"),
        (vec!["leaf.toml", "--tolerance", "1"], "tolerance"),
        (vec!["leaf.toml", "--set", "leaf.rods=0"], "rods"),
        (vec!["leaf.toml", "--segments", "8"], "--segments"),
        (vec!["leaf.toml", "--method", "shooting"], "--method"),
        (vec!["leaf.toml", "--out", "leaf.toml/out"], "--out DIR"),
        (vec!["absent.toml"], "absent.toml"),
        (vec![], "SCENARIO"),
    ] {
        let place = Workplace::new();
        let output = place.run(&[&["check"], &arguments[..]].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert_eq!(text(&output.stdout), "", "{arguments:?}");
        let said = text(&output.stderr);
        assert!(said.contains(message), "{message} in {said}");
        assert_eq!(place.names("."), ["leaf.toml"], "{arguments:?}");
    }
}
