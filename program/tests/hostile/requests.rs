//! Requests that cannot be met are refused in one message that says what to
//! change, with exit status 2 and nothing written; scenes that cannot come to
//! rest end in an outcome, soon.

use leafdyn::relax::{RelaxError, relax};
use leafdyn_testing::workplace::{Json, Workplace, contains};
use leafdyn_testing::*;

/// A leaf of five veins of length two, with a kink in a stiffness.
const LEAF: &str = r#"
name = "leaf"
leaf = { rods = 5, length = 2.0, fan = "paper" }
load = { gravity = [0.0, 0.0, -1.0] }
coupling = { y = 1.0, z = 1.0 }
stiffness = { torsion = 1.0, bending_2 = { at = [0.0, 0.2, 0.5, 1.0], value = [1.0, 0.5, 0.7, 0.2] }, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
"#;

/// A folder with it.
fn place() -> Workplace {
    let place = Workplace::new();
    place.write("leaf.toml", LEAF);
    place
}

/// Tolerances beyond double precision, segments that no grid can have (two kinks cut the rod in
/// three), and leaves that do not fit.
const REFUSED: &str = "
    --tolerance small => --tolerance & small
    --tolerance 1e-20 => double precision
    --segments 0 => --segments 0 & at least 3
    --segments 2 => --segments 2 & at least 3 & knots
    --segments -5 => -5
    --segments 1.5 => --segments & 1.5
    --segments 1000000 => 5000000 nodes & at most 4000000
    --segments 18446744073709551615 => nodes & at most 4000000
    --segments 18446744073709551616 => --segments
    --set leaf.rods=1000000 => leaf.rods & 100000
    --set leaf.rods=100000 --segments 1000 => 100000 rods & at most 4000000
";

#[test]
fn requests_that_cannot_be_met_are_refused() {
    let mut all = REFUSED.to_string();
    for tolerance in ["0", "1e-20", "-1", "1e-13", "0.2", "inf", "nan", "1e400"] {
        all += &format!("--tolerance {tolerance} => tolerance & 1e-12 & 0.1\n");
        all += &format!("--set solve.tolerance={tolerance} => tolerance\n");
    }
    for (arguments, said) in pairs(&all) {
        let parts: Vec<&str> = said.split(" & ").collect();
        let message = place().refuses(format!("relax leaf.toml {arguments}"), parts[0]);
        contains(&message.err, &parts);
        assert!(message.err.trim().lines().count() <= 8, "too long: {said}");
    }
    place().run("relax leaf.toml --segments 3").ends(0);
}

/// Asserts that a value of an option was refused.
#[track_caller]
fn refused_option(error: &RelaxError, option: &str, value: &str) {
    let RelaxError::Option(refused) = error else {
        panic!("{error}");
    };
    assert_eq!((refused.option, refused.value.as_str()), (option, value));
}

#[test]
fn the_library_refuses_alike() {
    let leaf = Scenario::from_toml(LEAF).unwrap();
    let ask = |options: Options| {
        relax(&leaf, &options, &mut |_| panic!("nothing is computed")).unwrap_err()
    };
    for found in [0.0, -1e-6, 1e-20, 1.0, f64::INFINITY, f64::NEG_INFINITY] {
        refused_option(&ask(to(found)), "tolerance", &found.to_string());
    }
    let nan = ask(to(f64::NAN));
    refused_option(&nan, "tolerance", "NaN");
    refused_option(&ask(on(2)), "segments", "2");
    let many = ask(on(usize::MAX));
    assert!(matches!(many, RelaxError::TooManyNodes { rods: 5, .. }));
}

/// Scenes at the edge of what a scenario may state, some of which have no
/// stable equilibrium that any grid allowed could resolve. None may run on.
const HARD: &str = "
    pushed back => load.tip_force=[-1e5,0,0]
    pushed back by the strongest force => load.tip_force=[-5e6,0,0]
    hung on its tip => load.tip_force=[0,0,5e6]
    as heavy as allowed => load.gravity=[0,0,-2e6]
    heavy and upside down => load.gravity=[-1e5,0,0]
    glued together => coupling.x=1e10; coupling.y=1e10; coupling.z=1e10
    wound up at rest => rest.bend_2=100.0; rest.twist=100.0
    soft as a thread => stiffness.bending_3=1e-6; stiffness.torsion=1e-6; load.gravity=[0,0,-0.1]
";

#[test]
fn hard_scenes_end_in_an_outcome_after_bounded_work() {
    for (what, overrides) in pairs(HARD) {
        let leaf = relaxed(base(LEAF, overrides).scenario(), &Options::default());
        let work = leaf.work.force_evaluations;
        // Some seconds, whatever the machine.
        let finest = leaf.accuracy.segments.last().unwrap();
        assert!(work * finest < 12_000_000, "{what}: {work} on {finest}");
        if leaf.outcome.is_success() {
            assert_eq!(leaf.stability.negative_eigenvalues, Some(0), "{what}");
            assert!(estimate(&leaf) <= 2.0 * leaf.accuracy.tolerance, "{what}");
        } else {
            assert_ne!(leaf.outcome, Outcome::Saddle);
            assert!(leaf.remark.is_some(), "{what}: no remark");
        }
        // Whatever it is, it is numbers.
        let finite = |node: &NodeState| node.position.is_finite() && node.rotation.is_finite();
        assert!(nodes(&leaf.shape.rods).all(finite), "{what}");
    }
}

/// A failed run says so in its exit status, and how far it came in its files.
#[test]
fn a_run_that_fails_is_written_down_and_has_status_one() {
    let place = place();
    let run = place.run("relax leaf.toml --json --set load.tip_force=[-5e6,0,0]");
    let run = run.ends(1);
    let summary = run.json();
    let outcome = summary["outcome"].text();
    let failures = ["tolerance-not-reached", "not-at-rest", "diverged"];
    assert!(failures.contains(&outcome), "{outcome}");
    let remark = summary["remark"].text();
    assert!(remark.len() > 20);
    contains(&run.err, &[remark]);
    let files = "centerlines.csv figure.png figure.svg summary.json";
    place.holds("out/leaf", files);
}
