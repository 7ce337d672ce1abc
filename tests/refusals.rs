//! What scripts and terminals get of a refusal: with `--json` one JSON object, and
//! never a control character.

mod workplace;

use std::fs;

use workplace::{Run, Workplace, contains};

#[test]
fn every_refusal_is_one_json_object() {
    let place = Workplace::new();
    fs::write(place.path("plain"), "").unwrap();
    for (arguments, part) in [
        ("relax absent.toml --json", "absent.toml: cannot be read"),
        (
            "relax leaf.toml --json --segments few",
            "invalid value 'few' for '--segments <N>'",
        ),
        ("relax --json", "<SCENARIO>"),
        ("relax leaf.toml --json --write pdf", "pdf: must be some of"),
        (
            "relax leaf.toml --json --set leaf.rods=0",
            "leaf.rods = 0: must be a whole number",
        ),
        (
            "relax leaf.toml --json --out plain/out",
            "plain is not a folder",
        ),
        (
            "check leaf.toml --json --intervals 0",
            "--intervals 0: allowed are",
        ),
        ("simulate leaf.toml --json --resume", "cannot resume"),
        (
            "trace leaf.toml --json --vary leaf.rods=1..2",
            "a whole number has nothing between",
        ),
        (
            "map leaf.toml --json --vary stiffness.torsion=1",
            "has no ..",
        ),
        (
            "map leaf.toml --json --vary rest.twist=0..1 --shard 3/2",
            "--shard <I/K>",
        ),
        ("chart leaf.toml --json --seconds 0", "--seconds 0: must be"),
    ] {
        place.refuses(arguments, part);
        let run = place.run(arguments);
        let refused = run.json();
        let keys: Vec<&String> = refused.as_object().unwrap().keys().collect();
        assert_eq!(keys, ["error", "exit_status"], "{arguments}");
        // To people it says the same.
        assert_eq!(
            run.err.trim_end(),
            format!("error: {}", refused["error"].as_str().unwrap())
        );
    }
    assert!(
        place
            .run("relax --help --json")
            .ok()
            .out
            .starts_with("Find how a leaf")
    );
}

/// What was found is not lost with the files, and is one object, too.
#[test]
fn files_that_cannot_be_written_are_told_beside_the_result() {
    let place = Workplace::new();
    fs::create_dir_all(place.path("out/small/figure.svg/in")).unwrap();
    for verb in ["relax leaf.toml", "relax leaf.toml leaf2.toml"] {
        fs::write(place.path("leaf2.toml"), workplace::leaf("two", 2)).unwrap();
        let run = place.run(&format!("{verb} --json")).ends(2);
        let json = run.json();
        let json = if json.is_array() { &json[0] } else { &json };
        assert_eq!(json["outcome"], "converged");
        assert_eq!(json["exit_status"], 2);
        let error = json["error"].as_str().unwrap();
        contains(error, &["cannot write out/small/figure.svg"]);
        assert_eq!(run.err.trim_end(), format!("error: {error}"));
    }
}

/// What a terminal gets of a run.
fn shown(run: Run) -> String {
    let all = run.out + &run.err;
    let obeyed = all
        .chars()
        .find(|c| c.is_control() && !matches!(c, '\n' | '\t'));
    assert_eq!(obeyed, None, "{all:?}");
    assert!(!all.contains(['\u{202e}', '\u{2066}']), "{all:?}");
    all
}

#[test]
fn control_characters_are_escaped() {
    let place = Workplace::new();
    let (esc, bell, back) = ("\u{1b}[31m", "\u{7}", "\u{202e}");
    let run = |arguments: &[&str]| {
        let mut command = place.command("");
        let run = Run::from(command.args(arguments).output().unwrap());
        assert_eq!(run.status, Some(2), "{arguments:?}");
        shown(run)
    };
    let escaped = "\\u{1b}[31m";
    let name = format!("{esc}{bell}{back}");
    let set = |entry: &str| ["relax", "leaf.toml", "--set", entry].map(String::from);
    for arguments in [
        ["relax", &format!("{name}.toml"), "--json", "--write=none"].map(String::from),
        set(&format!("{name}=1")),
        set(&format!("leaf.fan={name}")),
        set(&format!("name={name}")),
        set(&format!("leaf.rods[{name}]=1")),
        ["relax", "leaf.toml", "--out", &format!("leaf.toml/{name}")].map(String::from),
        ["chart", "leaf.toml", "--peers", &name].map(String::from),
    ] {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let said = run(&arguments);
        assert!(said.contains(escaped), "{arguments:?}: {said}");
    }
    // Of requests that are not understood they may also be left out.
    for arguments in [
        ["relax", "leaf.toml", "--method", &name].map(String::from),
        ["map", "leaf.toml", "--vary", &format!("{name}=1..2")].map(String::from),
        [
            "trace",
            "leaf.toml",
            "--vary",
            &format!("rest.twist={name}"),
        ]
        .map(String::from),
        ["relax", "leaf.toml", "--write", &name].map(String::from),
        ["relax", "leaf.toml", &format!("--{name}"), "1"].map(String::from),
    ] {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        run(&arguments);
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
        fs::write(place.path(&file), text).unwrap();
        contains(&run(&["relax", &file]), &[escaped]);
    }
    fs::write(place.path(&file), workplace::leaf("small", 2)).unwrap();
    let out = format!("o{esc}");
    let report = place
        .command("relax")
        .args([file.as_str(), "--out", out.as_str()])
        .output();
    contains(
        &shown(Run::from(report.unwrap())),
        &["o\\u{1b}[31m: summary.json"],
    );
}
