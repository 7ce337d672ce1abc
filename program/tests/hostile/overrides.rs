//! Entries replaced on the command line: what is taken, and that refusals say where
//! it was typed.

use leafdyn::scenario::{Key, SourceLocation};
use leafdyn_testing::valid::{VALID, all_refused, holds, with};
use leafdyn_testing::*;

/// The message for VALID with an override goes on so.
#[track_caller]
fn overridden(given: &str, problem: &[&str]) {
    holds(with(&[given]), &[&format!("set {given}: {}", problem[0])]);
}

#[test]
fn overrides() {
    let with = |given: &[&str]| with(given).unwrap();
    assert_eq!(with(&["load.gravity=[0,0,-0.5]"]).gravity, [0.0, 0.0, -0.5]);
    assert_eq!(with(&["name=other"]).name, "other");
    assert_eq!(with(&["name = 'other'"]).name, "other");
    let last = &with(&["leaf.fan=paper"]).rods[2];
    assert_eq!(last.angle, std::f64::consts::PI / 3.0);
    let twice = with(&["solve.tolerance=1e-3", "solve.tolerance=1e-4"]);
    assert_eq!(twice.tolerance, 1e-4);
    assert!(!with(&["leaf.joined=false"]).joined);
    let tapered = with(&["stiffness.torsion={at=[0,1],value=[1,3]}"]);
    assert_eq!(tapered.rods[0].couple_stiffness[0].at(0.5), 2.0);
    // A missing or wrong entry of the file can be made good.
    let text = VALID
        .replace("torsion = 1.0", "")
        .replace("= 2.0", "= -2.0");
    let mended = ["stiffness.torsion=1", "leaf.length=2"].map(String::from);
    assert!(Scenario::from_toml_with(&text, "leaf.toml", &mended).is_ok());
}

#[test]
fn refused_overrides_say_that_they_are_overrides() {
    let table = r#"
        leaf.rods=0 => leaf.rods = 0: must be a whole number
        leaf.rods=five => leaf.rods = five: must be a whole number
        stiffness.torsion=-1 => stiffness.torsion = -1: must be greater than 0
        load.gravity=[0,0 => not valid TOML
        leaf.fan= => not valid TOML
        leaf.fan=round => leaf.fan = round: must be "paper"
        stifness.torsion=1 => unknown key stifness.torsion (did you mean stiffness.torsion?)
        gravity=[0,0,1] => unknown key gravity (did you mean load.gravity?)
        leaf=3 => unknown key leaf
        =3 => unknown key
        leaf.rods => must be KEY=VALUE, as in load.gravity=[0,0,-0.5]
        load.tip_force=[0,0,1e300] => load.tip_force = [0,0,1e300]: gives |F| L^2/A
        name=a/b => name = a/b: must be usable as a folder name
    "#;
    all_refused(table, overridden);
    holds(with(&["leaf.rods=1\nname='x'"]), &["leaf.rods"]);
    // The list in the file is what no longer fits.
    let list = "leaf.toml:10: stiffness.bending_2 = [1.0, 1.0, 1.0]: has 3 entries: must have 4";
    holds(with(&["leaf.rods=4"]), &[list]);
}

#[test]
fn errors_carry_values() {
    let error = with(&["leaf.rods=4"]).unwrap_err();
    let (file, line) = ("leaf.toml".into(), Some(10));
    assert_eq!(error.place, SourceLocation::File { file, line });
    assert_eq!(error.key.map(Key::path), Some("stiffness.bending_2"));
    let given = "leaf.rods=0".to_string();
    let error = with(&[&given]).unwrap_err();
    assert_eq!(error.place, SourceLocation::Set { given });
    let both = format!("{}: {}", error.place, error.problem);
    assert_eq!(error.to_string(), both);
}
