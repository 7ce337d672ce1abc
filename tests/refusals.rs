//! What scripts and terminals get of failures: one JSON object, and never a control character.
//! That refusals of requests are such objects is tested where the requests are.

mod workplace;

use std::fs;

use workplace::{Json, Run, Workplace, contains};

#[test]
fn help_is_the_same_with_json() {
    let place = Workplace::new();
    let help = place.ok("relax --help --json").out;
    assert!(help.starts_with("Find how a leaf"));
}

/// What was found is not lost with the files, and is one object, too.
#[test]
fn files_that_cannot_be_written_are_told_beside_the_result() {
    let place = Workplace::new();
    fs::create_dir_all(place.path("out/small/figure.svg/in")).unwrap();
    place.write("leaf2.toml", workplace::leaf("two", 2));
    for verb in ["relax leaf.toml", "relax leaf.toml leaf2.toml"] {
        let run = place.run(format!("{verb} --json")).ends(2);
        let json = run.json();
        let json = if json.is_array() { &json[0] } else { &json };
        assert_eq!(json["outcome"], "converged");
        assert_eq!(json["exit_status"], 2);
        let error = json["error"].text();
        contains(error, &["cannot write out/small/figure.svg"]);
        assert_eq!(run.err.trim_end(), format!("error: {error}"));
    }
}

/// What a terminal gets of a run.
fn shown(run: Run) -> String {
    let all = run.out + &run.err;
    let mut characters = all.chars();
    let obeyed = characters.find(|c| c.is_control() && !matches!(c, '\n' | '\t'));
    assert_eq!(obeyed, None, "{all:?}");
    assert!(!all.contains(['\u{202e}', '\u{2066}']), "{all:?}");
    all
}

#[test]
fn control_characters_are_escaped() {
    let place = Workplace::new();
    let (esc, escaped) = ("\u{1b}[31m", "\\u{1b}[31m");
    let run = |arguments: &str| {
        let named = arguments.replace("NAME", &format!("{esc}\u{7}\u{202e}"));
        shown(place.run(named).ends(2))
    };
    for arguments in [
        "relax NAME.toml --json --write=none",
        "relax leaf.toml --set NAME=1",
        "relax leaf.toml --set leaf.fan=NAME",
        "relax leaf.toml --set name=NAME",
        "relax leaf.toml --set leaf.rods[NAME]=1",
        "relax leaf.toml --out leaf.toml/NAME",
        "chart leaf.toml --peers NAME",
    ] {
        let said = run(arguments);
        assert!(said.contains(escaped), "{arguments:?}: {said}");
    }
    // Of requests that are not understood they may also be left out.
    for arguments in [
        "relax leaf.toml --method NAME",
        "map leaf.toml --vary NAME=1..2",
        "trace leaf.toml --vary rest.twist=NAME",
        "relax leaf.toml --write NAME",
        "relax leaf.toml --NAME 1",
    ] {
        run(arguments);
    }
    // And those in a file: its name, a key, a value, a comment beside a slip.
    let file = format!("a{esc}.toml");
    for text in [
        format!("name = \"{esc}\""),
        format!("\"{esc}\" = 1"),
        format!("name = 3 # {esc}"),
        format!("name = \"a\"\nnamee = 3 # {esc}"),
        format!("{{\"{esc}\": 1}}"),
    ] {
        place.write(&file, text);
        contains(&run(&format!("relax {file}")), &[escaped]);
    }
    place.write(&file, workplace::leaf("small", 2));
    let report = place.run(format!("relax {file} --out o{esc}"));
    contains(&shown(report), &["o\\u{1b}[31m: summary.json"]);
}
