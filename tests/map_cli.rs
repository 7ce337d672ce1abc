//! What scripts rely on when they map a leaf: files, exit statuses, and that a
//! map can be stopped, shared out and drawn later.

mod workplace;

use std::fs;
use std::path::Path;

use serde_json::Value;
use workplace::{Workplace, is_whole_png, text};

const FILES: [&str; 4] = ["map.csv", "map.json", "map.png", "map.svg"];

/// Twelve cells, one of which the format refuses, by three quick methods.
const SMALL: [&str; 7] = [
    "leaf.toml",
    "--vary",
    "load.gravity[2]=-1e-2..-10:4log",
    "--vary",
    "coupling.y=-1..1:3",
    "--methods",
    "semi-implicit,shooting,shooting-from-rest",
];

fn run(place: &Workplace, more: &[&str], threads: &str) -> String {
    let arguments = [&["map"], &SMALL[..], &["--out", "out"], more].concat();
    let mut command = place.command(&arguments);
    let output = command.env("RAYON_NUM_THREADS", threads).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(text(&output.stderr), "");
    text(&output.stdout).into()
}

fn lines(place: &Workplace, name: &str) -> Vec<String> {
    let table = fs::read_to_string(place.path(name)).unwrap();
    assert!(table.ends_with('\n'));
    table.lines().map(String::from).collect()
}

/// The rows without their times: the last column but one.
fn timeless(lines: &[String]) -> Vec<String> {
    lines
        .iter()
        .map(|line| {
            let columns: Vec<&str> = line.rsplitn(3, ',').collect();
            format!("{},{}", columns[2], columns[0])
        })
        .collect()
}

#[test]
fn help_names_every_option_and_exit_status() {
    let output = Workplace::new().run(&["map", "--help"]);
    assert_eq!(output.status.code(), Some(0));
    for part in [
        "--vary",
        "--methods",
        "--cell-seconds",
        "--shard",
        "--draw",
        "--show",
        "--tolerance",
        "--set",
        "--out",
        "--json",
        "0 the map is made",
        "2 the request was refused",
    ] {
        assert!(text(&output.stdout).contains(part), "{part}");
    }
}

#[test]
fn a_map_is_a_table_a_summary_and_a_figure() {
    let place = Workplace::new();
    let report = run(&place, &[], "2");
    for part in [
        "small: where methods fail",
        "load.gravity[2] from -0.01 to -10.0: 4 values, logarithmic",
        "coupling.y from -1.0 to 1.0: 3 values",
        "12 of 12, reference confirmed in ",
        "0 were there, 36 computed",
        "shooting-from-rest",
        "refused",
        "out: map.json, map.csv, map.svg, map.png",
    ] {
        assert!(report.contains(part), "{part} in {report}");
    }
    assert_eq!(place.names("out"), FILES);
    assert!(is_whole_png(&place.path("out/map.png")));
    let svg = fs::read_to_string(place.path("out/map.svg")).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));

    let rows = lines(&place, "out/map.csv");
    assert_eq!(
        rows[0],
        "load.gravity[2],coupling.y,method,outcome,detail,index,tip_x,tip_y,tip_z,energy,error,error_estimate,margin_waves,margin_amplitude,twist,seconds,reference"
    );
    assert_eq!(rows.len(), 1 + 36);
    assert!(rows[1].starts_with("-0.01,-1.0,semi-implicit,refused,"));
    assert!(rows[1].contains("coupling.y = -1.0: "), "{}", rows[1]);
    assert!(rows[1].ends_with(",none"));
    assert!(rows[36].starts_with("-10.0,1.0,shooting-from-rest,right,"));
    assert!(rows[36].ends_with(",confirmed"));

    // The same rows, drawn by their waves.
    assert!(svg.contains("where methods fail") && !svg.contains("no waves"));
    run(&place, &["--show", "waves"], "2");
    let svg = fs::read_to_string(place.path("out/map.svg")).unwrap();
    assert!(svg.contains("waves along the margins") && svg.contains("stable, no waves"));
    assert_eq!(lines(&place, "out/map.csv"), rows);

    let json = fs::read(place.path("out/map.json")).unwrap();
    let json: Value = serde_json::from_slice(&json).unwrap();
    assert_eq!(json["scenario"], "small");
    assert_eq!(json["cells"], 12);
    assert_eq!(json["request"]["vary"][1]["keys"], "coupling.y");
    assert_eq!(json["outcomes"][0]["counts"]["refused"], 4);
}

#[test]
fn one_and_two_threads_give_the_same_rows() {
    let places = [("1", Workplace::new()), ("2", Workplace::new())];
    let rows = places.map(|(threads, place)| {
        run(&place, &[], threads);
        timeless(&lines(&place, "out/map.csv"))
    });
    assert_eq!(rows[0], rows[1]);
}

#[test]
fn a_run_goes_on_where_one_was_stopped() {
    let place = Workplace::new();
    run(&place, &[], "2");
    let whole = lines(&place, "out/map.csv");
    // Five rows, and a sixth half written, as a kill leaves them.
    let half = format!("{}\n{}", whole[..6].join("\n"), &whole[6][..20]);
    fs::write(place.path("out/map.csv"), half).unwrap();
    let report = run(&place, &[], "2");
    assert!(report.contains("5 were there, 31 computed"), "{report}");
    let again = lines(&place, "out/map.csv");
    assert_eq!(timeless(&again), timeless(&whole));
    // With their times: they were not computed again.
    assert_eq!(again[..6], whole[..6]);

    let report = run(&place, &[], "2");
    assert!(report.contains("36 were there, 0 computed"), "{report}");
    assert_eq!(lines(&place, "out/map.csv"), again);
    let json = place.run(&[&["map"], &SMALL[..], &["--out", "out", "--json"]].concat());
    assert_eq!(
        json.stdout,
        fs::read(place.path("out/map.json")).unwrap(),
        "--json shows the file"
    );
}

#[test]
fn more_methods_are_added_to_a_map() {
    let place = Workplace::new();
    run(&place, &[], "2");
    let arguments = [
        &["map"],
        &SMALL[..5],
        &["--out", "out", "--methods", "single-shooting"],
    ];
    let output = place.run(&arguments.concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("36 were there, 12 computed"));
    assert_eq!(lines(&place, "out/map.csv").len(), 1 + 48);
}

#[test]
fn shards_joined_equal_the_whole() {
    let place = Workplace::new();
    run(&place, &[], "2");
    let whole = timeless(&lines(&place, "out/map.csv"));

    let shared = Workplace::new();
    for shard in ["2/3", "1/3", "3/3"] {
        let report = run(&shared, &["--shard", shard], "1");
        assert!(report.contains("0 were there, 12 computed"), "{report}");
        let report = run(&shared, &["--shard", shard], "1");
        assert!(report.contains("12 were there, 0 computed"), "{report}");
    }
    let parts = ["map-1-of-3.csv", "map-2-of-3.csv", "map-3-of-3.csv"];
    assert_eq!(
        shared.names("out"),
        [&parts[..], &["map.json"]].concat(),
        "no shard draws"
    );
    // Joined, they have the rows of the whole.
    let joined: String = parts
        .map(|part| fs::read_to_string(shared.path(&format!("out/{part}"))).unwrap())
        .concat();
    fs::write(shared.path("joined.csv"), &joined).unwrap();
    let mut rows = timeless(&lines(&shared, "joined.csv"));
    rows.sort();
    rows.dedup();
    let mut sorted = whole.clone();
    sorted.sort();
    assert_eq!(rows, sorted);

    // A plain run in their folder takes them up and draws,
    let report = run(&shared, &[], "2");
    assert!(report.contains("36 were there, 0 computed"), "{report}");
    assert_eq!(timeless(&lines(&shared, "out/map.csv")), whole);
    assert!(is_whole_png(&shared.path("out/map.png")));

    // and so does one elsewhere that is given the joined file, or all.
    for files in [vec!["../joined.csv"], parts.to_vec()] {
        let elsewhere = [&["map"], &SMALL[..], &["--out", "drawn", "--draw"]].concat();
        let mut command = shared.command(&elsewhere);
        let from = |file: &str| Path::new("out").join(file);
        let output = command
            .args(files.iter().map(|file| from(file)))
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert_eq!(timeless(&lines(&shared, "drawn/map.csv")), whole);
        assert_eq!(shared.names("drawn"), FILES);
        fs::remove_dir_all(shared.path("drawn")).unwrap();
    }
}

#[test]
fn what_is_drawn_may_be_part_of_a_map() {
    let place = Workplace::new();
    run(&place, &["--shard", "1/3"], "2");
    let report = run(&place, &["--draw", "out/map-1-of-3.csv"], "2");
    assert!(report.contains("4 of 12"), "{report}");
    let svg = fs::read_to_string(place.path("out/map.svg")).unwrap();
    assert!(svg.contains("4 of 12 cells"));
}

#[test]
fn maps_are_not_mixed() {
    let place = Workplace::new();
    run(&place, &[], "2");
    for (more, what) in [
        (vec!["--set", "load.tip_force=[0,0,1]"], "set"),
        (vec!["--tolerance", "1e-5"], "tolerance"),
        (vec!["--cell-seconds", "3"], "cell_seconds"),
    ] {
        let arguments = [&["map"], &SMALL[..], &["--out", "out"], &more[..]].concat();
        let output = place.run(&arguments);
        assert_eq!(output.status.code(), Some(2), "{more:?}");
        let said = text(&output.stderr);
        assert!(
            said.contains(&format!("its {what} is not the same")),
            "{said}"
        );
    }
    let leaf = fs::read_to_string(place.path("leaf.toml")).unwrap();
    fs::write(place.path("leaf.toml"), leaf.replace("y = 1.0", "y = 2.0")).unwrap();
    let output = place.run(&[&["map"], &SMALL[..], &["--out", "out"]].concat());
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("scenario_digest"));
}

#[test]
fn bad_requests_are_refused_before_anything_is_written() {
    let torsion = "stiffness.torsion=1..2:2";
    for (arguments, message) in [
        (vec![], "--vary"),
        (vec!["--vary", "stiffness.torsion=1"], "has no .."),
        (vec!["--vary", "stiffness.twist=1..2"], "unknown key"),
        (vec!["--vary", "load.gravity=1..2"], "give an index"),
        (vec!["--vary", "load.gravity[2]=-1..1log"], "one sign"),
        (vec!["--vary", "stiffness.torsion[5]=1..2"], "5 entries"),
        (vec!["--vary", torsion, "--vary", torsion], "varies twice"),
        (
            vec![
                "--vary",
                "rest.twist=0..1",
                "--vary",
                torsion,
                "--vary",
                "rest.bend_2=0..1",
            ],
            "one or two axes",
        ),
        (
            vec![
                "--vary",
                "rest.twist=0..1:2000",
                "--vary",
                "rest.bend_2=0..1:2000",
            ],
            "at most 1000000",
        ),
        (
            vec!["--vary", torsion, "--methods", "newton"],
            "semi-implicit",
        ),
        (
            vec!["--vary", torsion, "--methods", "explicit-motion"],
            "method.step",
        ),
        (
            vec!["--vary", torsion, "--set", "method.step=0"],
            "greater than 0",
        ),
        (
            vec!["--vary", torsion, "--set", "method.steps=1"],
            "method.step and method.segments",
        ),
        (
            vec!["--vary", torsion, "--cell-seconds", "0"],
            "--cell-seconds",
        ),
        (vec!["--vary", torsion, "--tolerance", "1"], "--tolerance"),
        (vec!["--vary", torsion, "--shard", "3/2"], "I/K"),
        (
            vec!["--vary", torsion, "--shard", "1/2", "--draw", "a.csv"],
            "--draw",
        ),
        (vec!["--vary", torsion, "--set", "leaf.rods=0"], "rods"),
        (
            vec!["--vary", torsion, "--out", "leaf.toml/out"],
            "--out DIR",
        ),
    ] {
        let place = Workplace::new();
        let output = place.run(&[&["map", "leaf.toml"], &arguments[..]].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert_eq!(text(&output.stdout), "", "{arguments:?}");
        let said = text(&output.stderr);
        assert!(said.contains(message), "{message} in {said}");
        assert_eq!(place.names("."), ["leaf.toml"], "{arguments:?}");
    }
}

#[test]
fn files_that_are_not_of_this_map_are_refused() {
    let place = Workplace::new();
    fs::write(place.path("other.csv"), "a,b\n1,2\n").unwrap();
    for (file, message) in [
        ("other.csv", "other.csv:1: is no row of this map"),
        ("absent.csv", "absent.csv"),
    ] {
        let output = place.run(&[&["map"], &SMALL[..], &["--draw", file]].concat());
        assert_eq!(output.status.code(), Some(2));
        let said = text(&output.stderr);
        assert!(said.contains(message), "{said}");
        assert!(!place.path("out").exists(), "nothing is written");
    }
}
