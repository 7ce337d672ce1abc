//! Bad scenarios and bad overrides: every refusal is one message that says where it was typed, what was
//! found, and what to change.

use leafdyn::scenario::{Key, SourceLocation};
use leafdyn_testing::valid::{VALID, all_refused, holds, with};
use leafdyn_testing::*;

/// The message for VALID with one text replaced by another, `text ~> other`.
#[track_caller]
fn replaced(given: &str, parts: &[&str]) {
    let (text, by) = given.split_once("~>").unwrap();
    let (text, by) = (text.trim_matches(' '), by.trim_matches(' '));
    assert!(VALID.contains(text), "{text}");
    let text = VALID.replacen(text, by, 1);
    holds(Scenario::from_toml_with(&text, "leaf.toml", &[]), parts);
}

/// The message for VALID with the first line of the same key replaced.
#[track_caller]
fn refused(by: &str, parts: &[&str]) {
    let (key, _) = by.split_once('=').unwrap();
    let line = VALID.lines().find(|line| line.starts_with(key));
    replaced(&format!("{} ~> {by}", line.unwrap()), parts);
}

#[test]
fn the_valid_one_is_valid() {
    let scenario = with(&[]).unwrap();
    assert_eq!(scenario.rods.len(), 3);
    assert_eq!(scenario.coupling, [[0.0, 1.0, 1.0], [0.0, 1.0, 2.0]]);
    assert_eq!(scenario.rods[1].rest_curvature[1].at(0.5), 1.0);
    assert_eq!(scenario.rods[2].couple_stiffness[2].at(0.25), 0.75);
    let rigid = Profile::Constant(f64::INFINITY);
    assert_eq!(scenario.rods[0].force_stiffness[0], rigid);
    assert_eq!(scenario.rods[0].angle, -scenario.rods[2].angle);
    assert_eq!(scenario.rods[1].angle, 0.0);
}

#[test]
fn what_may_be_left_out() {
    let text = &VALID[..VALID.find("[rest]").unwrap()].replace("joined = true\n", "");
    let scenario = Scenario::from_toml(text).unwrap();
    assert!(scenario.joined);
    assert_eq!(scenario.tolerance, 1e-6);
    assert_eq!(scenario.coupling, [[0.0; 3]; 2]);
    assert_eq!(scenario.gravity, [0.0; 3]);
}

#[test]
fn unknown_keys() {
    let table = r#"
        torsion = 1.0 ~> torsoin = 1.0 => leaf.toml:9: unknown key stiffness.torsoin (did you mean stiffness.torsion?) & torsion, bending_2, bending_3, axial, shear_2, shear_3 & 9 | torsoin = 1.0\n  | ^^^^^^^
        [stiffness] ~> [stifness] => leaf.toml:8: unknown key stifness & did you mean stiffness?
        rods = 3 ~> gravity = 3 => leaf.toml:4: unknown key leaf.gravity & did you mean load.gravity?
        [solve] ~> [solver.x] => leaf.toml:27: unknown key solver & did you mean solve? & leaf, stiffness
        name = ~> colour = 1\nname = => leaf.toml:2: unknown key colour: allowed here: name, units, leaf
    "#;
    all_refused(table, replaced);
}

#[test]
fn text_that_is_no_toml() {
    let table = r#"
        rods = => leaf.toml:4: not valid TOML & 4 | rods =
        rods = 3\nrods = 4 => leaf.toml:5: not valid TOML: duplicate key
        rods = 3 4 => leaf.toml:4: not valid TOML
    "#;
    all_refused(table, refused);
    refused(
        &format!("rods = {}", "[".repeat(100_000)),
        &["leaf.toml:4: not valid TOML"],
    );
    let twice = "leaf.toml:15: not valid TOML: duplicate key";
    replaced("[rest] ~> [leaf]", &[twice]);
}

#[test]
fn missing_keys() {
    let table = r#"
        torsion = 1.0\n ~> => leaf.toml: stiffness.torsion is missing: add a line such as `torsion = 1.0` below [stiffness]
    "#;
    all_refused(table, replaced);
    let error = Scenario::from_toml("name = \"leaf\"").unwrap_err();
    assert_eq!(
        error.to_string(),
        "scenario: leaf.rods is missing: add the table [leaf], and below it a line such as `rods = 5`; \
         also missing: leaf.length, leaf.fan, stiffness.torsion, stiffness.bending_2, \
         stiffness.bending_3, stiffness.axial, stiffness.shear_2, stiffness.shear_3"
    );
}

#[test]
fn wrong_types() {
    let table = r#"
        name = 3 => leaf.toml:2: name = 3: must be text in quotes
        rods = 3.0 => leaf.toml:4: leaf.rods = 3.0: must be a whole number from 1 to 100000
        joined = 1 => leaf.toml:7: leaf.joined = 1: must be true or false
        torsion = "stiff" => leaf.toml:9: stiffness.torsion = "stiff": must be a number, a list of 3 (one per rod), or a profile
        torsion = 2020-01-01 => stiffness.torsion = 2020-01-01: must be a number
        torsion = [1.0, true, 1.0] => leaf.toml:9: stiffness.torsion, entry 2 = true: must be a number
        gravity = -1.0 => leaf.toml:24: load.gravity = -1.0: must be a list of three numbers
        gravity = [0.0, -1.0] => leaf.toml:24: load.gravity = [0.0, -1.0]: has 2 entries: must have 3
        fan = "round" => leaf.toml:6: leaf.fan = "round": must be "paper" or "symmetric", or a list of 3 angles in radians
        fan = 0.0 => leaf.toml:6: leaf.fan = 0.0: must be "paper"
        length = { at = [0, 1], value = [1, 2] } => leaf.toml:5: leaf.length = { & must be a number or a list of 3 (one per rod)
        y = { at = [0, 1], value = [1, 2] } => coupling.y & a number or a list of 2 (one per gap
    "#;
    all_refused(table, refused);
    let leaf = Scenario::from_toml("name = \"leaf\"\nleaf = 3");
    let table = "scenario:2: leaf = 3: must be a table: write [leaf]";
    holds(leaf, &[table]);
}

#[test]
fn list_lengths() {
    let table = r#"
        torsion = [1.0, 1.0] => leaf.toml:9: stiffness.torsion = [1.0, 1.0]: has 2 entries: must have 3, one per rod (leaf.rods)
        rods = 4 => leaf.toml:10: stiffness.bending_2 = [1.0, 1.0, 1.0]: has 3 entries: must have 4
        fan = [0.0] => leaf.toml:6: leaf.fan & has 1 entries: must have 3
        z = [1.0, 2.0, 3.0] => leaf.toml:22: coupling.z = [1.0, 2.0, 3.0]: has 3 entries: must have 2, one per gap
        bend_2 = { at = [0.0, 1.0], value = [[0.0, 1.0], [0.0, 3.0]] } => leaf.toml:17: rest.bend_2, value = & has 2 entries: must have 3, one per rod
        bend_2 = { at = [0.0, 1.0], value = [[0.0, 1.0], [0.0], [0.0, 3.0]] } => leaf.toml:17: rest.bend_2, value, entry 2 = [0.0]: has 1 entries: must have 2, one per entry of at
    "#;
    all_refused(table, refused);
}

#[test]
fn numbers_out_of_range() {
    for rods in ["0", "-3", "100001", "99999999999999999999"] {
        let found = format!("leaf.toml:4: leaf.rods = {rods}: ");
        let parts = [&found, "must be a whole number from 1 to 100000"];
        refused(&format!("rods = {rods}"), &parts);
    }
    // The place is the entry's own line.
    let table = r#"
        length = 0 => leaf.toml:5: leaf.length = 0: must be greater than 0
        length = inf => leaf.toml:5: leaf.length = inf: must be a finite number
        length = 1e-300 => leaf.length = 1e-300: must lie between 1e-50 and 1e50: choose other units
        torsion = -1.0 => leaf.toml:9: stiffness.torsion = -1.0: must be greater than 0
        torsion = [\n  1.0,\n  -1.0,\n  1.0,\n] => leaf.toml:11: stiffness.torsion, entry 2 = -1.0: must be greater than 0
        torsion = inf => inf (rigid) is allowed for stiffness.axial, shear_2 and shear_3 only
        torsion = 1e999 => stiffness.torsion = 1e999: is not a number a computer can hold
        tip_force = [1e309, 0.0, 0.0] => leaf.toml:25: load.tip_force
        axial = 1e999 => leaf.toml:12: stiffness.axial = 1e999: is not a number
        axial = -inf => leaf.toml:12: stiffness.axial = -inf: must be a finite number
        axial = { at = [0.0, 1.0], value = [1.0, inf] } => leaf.toml:12: stiffness.axial, value, entry 2 = inf & not in a profile
        y = -1.0 => leaf.toml:21: coupling.y = -1.0: must not be negative
        z = [1.0, inf] => leaf.toml:22: coupling.z, entry 2 = inf: must be a finite number
        fan = [0.0, inf, 0.0] => leaf.fan, entry 2 = inf: must be a finite number
    "#;
    all_refused(table, refused);
    assert!(with(&["stiffness.axial=[inf, 1.0, 10]"]).is_ok());
}

#[test]
fn nan_is_refused_wherever_a_number_stands() {
    let refused = ["leaf.toml:", "nan: must be a finite number"];
    // From here on, every number need not be whole.
    let (mut at, mut numbers) = (VALID.find("length").unwrap(), 0);
    for token in VALID[at..].split([' ', ',', '[', ']', '{', '}', '\n']) {
        let end = at + token.len();
        if token.parse::<f64>().is_ok() {
            let text = [&VALID[..at], "nan", &VALID[end..]].concat();
            holds(Scenario::from_toml_with(&text, "leaf.toml", &[]), &refused);
            numbers += 1;
        }
        at = end + 1;
    }
    assert!(numbers > 40, "{numbers}");
    replaced("axial = inf ~> axial = [1.0, -nan, 1.0]", &refused);
    replaced("\"symmetric\" ~> [0.0, nan, 0.0]", &refused);
}

#[test]
fn profiles() {
    let table = r#"
        bending_3 = { at = [0.1, 0.5, 1.0], value = [1.0, 0.5, 0.1] } => leaf.toml:11: stiffness.bending_3, at & entry 1 = 0.1: must start at 0
        bending_3 = { at = [0.0, 0.5, 0.9], value = [1.0, 0.5, 0.1] } => leaf.toml:11: stiffness.bending_3, at & entry 3 = 0.9: must end at 1
        bending_3 = { at = [0.0, 0.0, 1.0], value = [1.0, 0.5, 0.1] } => leaf.toml:11: stiffness.bending_3, at & entry 2 = 0.0: a step at the base has no side before it
        bending_3 = { at = [0.0, 2.0, 1.0], value = [1.0, 0.5, 0.1] } => leaf.toml:11: stiffness.bending_3, at & entry 3 = 1.0: must be greater than the entry before it, 2
        bending_3 = { at = [0.0], value = [1.0, 0.5, 0.1] } => leaf.toml:11: stiffness.bending_3, at & at least two knots
        bending_3 = { at = [], value = [1.0, 0.5, 0.1] } => leaf.toml:11: stiffness.bending_3, at & at least two knots
        bending_3 = { at = 0.5, value = [1.0, 0.5, 0.1] } => leaf.toml:11: stiffness.bending_3, at & must be a list of numbers
        bending_3 = { at = [0.0, 1.0] } => leaf.toml:11: stiffness.bending_3 = { & value is missing: a profile is
        bending_3 = {} => stiffness.bending_3 = {}: at is missing
        bending_3 = { at = [0, 1], values = [1, 1] } => unknown key values: a profile is { at =
        bending_3 = { at = [0, 1], value = [1, 0] } => bending_3, value, entry 2 = 0: must be greater than 0
        bending_3 = { at = [0, 1], value = [1, 1, 1] } => has 3 entries: must have 2, one per entry of at
        bending_3 = { at = [0, 1], value = 1 } => bending_3, value = 1: must be a list of numbers, or a list of 3 such
        bending_3 = { at = [0, 1], value = [[1, 1], [1, -1], [1, 1]] } => leaf.toml:11: stiffness.bending_3, value, list 2, entry 2 = -1: must be greater than 0
        bending_3 = { at = [0, 1], value = [[1, 1], 1, [1, 1]] } => value, entry 2 = 1: must be a list of numbers
    "#;
    all_refused(table, refused);
}

#[test]
fn names_that_are_no_folder() {
    let names = "..|.|a/b|a\\\\b|.hidden|-o|a b |a\\u0000|C:x|../../etc".split('|');
    for name in names.chain(["", &"x".repeat(101)]) {
        let name = format!("name = \"{name}\"");
        let parts = ["leaf.toml:2: name = \"", "must be usable as a folder name"];
        refused(&name, &parts);
    }
    for name in [
        "fig04",
        "Blatt_2",
        "liść",
        "a+b-1.5",
        "my leaf",
        &"x".repeat(100),
    ] {
        assert_eq!(with(&[&format!("name=\"{name}\"")]).unwrap().name, name);
    }
}

#[test]
fn tolerances() {
    let table = r#"
        tolerance = 0 => leaf.toml:28: solve.tolerance = 0: must be greater than 0 and at most 0.1 & relative to the length
        tolerance = -1e-6 => solve.tolerance = -1e-6: must be greater than 0
        tolerance = 0.5 => solve.tolerance = 0.5: must be greater than 0 and at most 0.1
        tolerance = 1e-20 => solve.tolerance = 1e-20: must be at least 1e-12: double precision
        tolerance = inf => solve.tolerance = inf: must be a finite number
    "#;
    all_refused(table, refused);
    assert_eq!(with(&["solve.tolerance=1e-12"]).unwrap().tolerance, 1e-12);
}

/// L = 2 and the smallest bending stiffness is 0.1.
#[test]
fn limits_that_values_set_together() {
    let table = r#"
        tip_moment = [0.0, 0.0, 1.0] => leaf.toml:26: load.tip_moment = [0.0, 0.0, 1.0]: a moment at the tip needs leaf.rods = 1 (here 3)
        tip_force = [1e300, 0.0, 0.0] => leaf.toml:25: load.tip_force = [1e300, 0.0, 0.0]: gives |F| L^2/A = 4.000e301, the limit is 1e8 & confined to less than 1e-4 of the length
        tip_force = [1.7e308, 1.7e308, 1.7e308] => load.tip_force & the limit is 1e8
        gravity = [1e308, 1e308, 1e308] => load.gravity & |g| L^3/A
        gravity = [0, 0, -1e7] => load.gravity & |g| L^3/A = 8.000e8, the limit is 1e8
        y = 1e12 => leaf.toml:21: coupling.y = 1e12: gives kappa L^4/A = 1.600e14, the limit is 1e12
        z = [1, 1e300] => leaf.toml:22: coupling.z, entry 2 = 1e300 & kappa L^4/A
        torsion = [1, 1e-13, 1] => leaf.toml:9: stiffness.torsion, entry 2 = 1e-13: gives A_max/A = 1.000e13, the limit is 1e12
        twist = -5010 => leaf.toml:16: rest.twist = -5010: gives |u0| L = 1.002e4, the limit is 1e4
        shear_3 = 1e-9 => leaf.toml:14: stiffness.shear_3 = 1e-9: gives H L^2/A = 4.000e-8, the limit is 1e-6 & softer in stretch or shear
        length = [2.0, 1.9e-3, 2.0] => leaf.toml:5: leaf.length, entry 2 = 1.9e-3: gives L_max/L = 1.053e3, the limit is 1e3
    "#;
    all_refused(table, refused);
    let wound = with(&[&SINGLE[..], &["coupling.z=0", "load.tip_moment=[0,0,1e9]"]].concat());
    let moment = "load.tip_moment = [0,0,1e9]: gives |M| L/A = 2.000e10";
    holds(wound, &[moment]);
}

/// What makes a single rod of VALID.
const SINGLE: [&str; 3] = ["leaf.rods=1", "stiffness.bending_2=1", "rest.bend_2=0"];

#[test]
fn a_single_rod_has_no_gaps() {
    let coupled = |z: &str| with(&[&SINGLE[..], &[z]].concat());
    for accepted in ["coupling.z=1.0", "coupling.z=[]"] {
        assert!(coupled(accepted).unwrap().coupling.is_empty());
    }
    for (refused, part) in [
        ("coupling.z=[1.0]", "has 1 entries: must have 0"),
        ("coupling.z=-1", "must not be negative"),
    ] {
        holds(coupled(refused), &[part]);
    }
}

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
