//! What scripts rely on when they check a leaf: streams, files, exit statuses
//! and the keys of `check.json`.

use leafdyn_testing::workplace::{Json, Run, Workplace, contains, tells};
use serde_json::Value;

const FILES: &str = "check.json check.png check.svg";

/// `check.json` as printed, and the run.
fn check(arguments: &str) -> (Value, Run) {
    let place = Workplace::new();
    let run = place.run(format!("check {arguments} --json --out out"));
    assert_eq!(run.out, place.read("out/check.json"), "{}", run.err);
    (run.json(), run)
}

#[test]
fn both_methods_agree_on_a_leaf_of_the_paper() {
    let place = Workplace::new();
    let run = place.ok("check scenarios/paper/fig04.toml --set leaf.rods=5");
    run.says(&[
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
    ]);
    place.holds("out/fig04", FILES);
    let picture = place.picture("out/fig04/check");
    contains(&picture, &["fig04: both methods agree"]);
}

/// A nearly round column under 1.00014 and 1.00004 times its two Euler loads: buckled by 2 % of its
/// length, which a coarse grid does not tell from straight.
const BUCKLED: &str = r#"
name = "column"
leaf = { rods = 1, length = 1.0, fan = [0.0] }
load = { tip_force = [-5.096954363457133, 0.0, 0.0] }
[stiffness]
torsion = 1.2496011635341304
bending_2 = 2.065310299737473
bending_3 = 2.0655168307674465
axial = 100000.0
shear_2 = inf
shear_3 = inf
"#;

#[test]
fn beside_a_bifurcation_both_methods_have_the_same_index() {
    let place = Workplace::new();
    place.write("column.toml", BUCKLED);
    let check = place.told(0, "check column.toml --tolerance 1e-7 --write none");
    let stable = "verdict=agree relaxation.stable=true shooting.negative_eigenvalues=0";
    tells(&check, stable);
    let shot = place.told(
        0,
        "relax column.toml --method shooting-from-rest --tolerance 1e-7",
    );
    tells(&shot, "outcome=converged stable=true");
}

#[test]
fn the_json_has_both_solutions_and_their_differences() {
    let (check, run) = check("leaf.toml");
    run.ok();
    let told = "scenario=small verdict=agree rods=5 tolerance=1e-6 within_estimates=true";
    tells(&check, told);
    assert_eq!(check.get("reason"), None);
    let along = check["differences"].list();
    for quantity in ["position", "rotation", "force", "moment"] {
        let along = along.iter().map(|found| found[quantity].number());
        let largest = check["difference"][quantity].number();
        assert_eq!(along.fold(0.0, f64::max), largest, "{quantity}");
        assert!(largest < 1e-6, "{quantity}: {largest}");
        assert!(check["shooting"]["error_estimate"][quantity].is_number());
    }
    assert_eq!(along.len(), check["stations"].list().len());
    for method in ["relaxation", "shooting"] {
        let found = &check[method];
        let told = "outcome=converged stable=true negative_eigenvalues=0";
        tells(found, told);
        assert_eq!(found["tip"].list().len(), 3);
        assert!(found["energy"].is_number());
        assert!(found["wall_seconds"].number() > 0.0);
    }
    let shooting = &check["shooting"];
    tells(shooting, "intervals=1 neutral=null");
    for key in ["growth_log10", "defect", "condition"] {
        assert!(shooting[key].is_number(), "{key}");
    }
    for key in ["iterations", "linearizations", "steps", "slopes"] {
        assert!(shooting["work"][key].count() > 0, "{key}");
    }
}

/// Tolerances and intervals as asked, a saddle, and free tips, which are listed.
#[test]
fn what_is_asked_of_both_methods_is_told_of_both() {
    leafdyn_testing::workplace::all_tell(
        0,
        "
        check leaf.toml --tolerance 1e-8 --intervals 7 => tolerance=1e-8 shooting.intervals=7 within_estimates=true; multiple shooting over 7
        check scenarios/paper/fig10.toml --set leaf.rods=5 --keep-unstable => relaxation.stable=false relaxation.negative_eigenvalues=18 shooting.stable=false shooting.negative_eigenvalues=18; relaxed  unstable equilibrium of index 18 | shooting unstable equilibrium of index 18
        ",
    );
    let free = Workplace::new().told(0, "check leaf.toml --set leaf.joined=false");
    for method in ["relaxation", "shooting"] {
        assert_eq!(free[method]["tip"], Value::Null);
        assert_eq!(free[method]["tips"].list().len(), 5);
    }
}

/// Euler's load: the straight column may buckle sideways.
#[test]
fn a_neutral_direction_is_explained() {
    let load = "--set load.tip_force=[-2.46740110027,0,0]";
    let column = "scenarios/classic/elastica_buckled.toml";
    let (check, _) = check(&format!("{column} {load} --keep-unstable"));
    let neutral = &check["shooting"]["neutral"];
    assert!(neutral["ratio"].number() < 1e-7);
    contains(neutral["meaning"].text(), &["bifurcation", "along y"]);
    let tip = neutral["displacement"][0].list().last().unwrap();
    assert!((tip[1].number().abs() - 1.0).abs() < 1e-9);
}

/// Single shooting cannot follow a leaf that is pulled hard.
#[test]
fn what_could_not_be_compared_is_told_with_the_reason() {
    let pulled = "scenarios/paper/fig08.toml --set leaf.rods=5 --set load.tip_force=[5,0,0]";
    let single = format!("{pulled} --intervals 1");
    let place = Workplace::new();
    place.run(format!("check {single}")).ends(1).says(&[
        "verdict  could not be compared: ",
        "use more intervals",
        "relaxed  stable equilibrium",
        "shooting no solution in ",
    ]);
    place.holds("out/fig08", FILES);
    place.picture("out/fig08/check");

    let (check, run) = check(&single);
    run.ends(1);
    assert_eq!(check["verdict"], "not-compared");
    contains(check["reason"].text(), &["use more intervals"]);
    tells(&check["shooting"], "outcome=no-convergence tip=null");
    assert!(check["shooting"]["wall_seconds"].is_number());
    assert_eq!(check["difference"], Value::Null);
    assert_eq!(check["differences"].list().len(), 0);

    let many = place.run(format!("check {pulled}")).ends(0);
    many.says(&["multiple shooting over "]);
}

#[test]
fn json_goes_alone_to_standard_output_and_the_reason_to_standard_error() {
    let run = Workplace::new().run("check leaf.toml --set load.gravity=[0,0,-1e7] --json");
    let run = run.ends(1);
    let check = run.json();
    tells(&check, "verdict=not-compared shooting=null");
    let reason = check["reason"].text();
    contains(reason, &["did not come to rest"]);
    contains(&run.err, &[reason]);
}
