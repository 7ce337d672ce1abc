//! What scripts rely on: streams, files and exit statuses of the command line.

mod workplace;

use std::fs;
use std::process::Command;

use serde_json::Value;
use workplace::{Workplace, is_whole_png, leaf, text};

const FILES: [&str; 4] = [
    "centerlines.csv",
    "figure.png",
    "figure.svg",
    "summary.json",
];

#[test]
fn help_names_every_option() {
    let output = Workplace::new().run(&["relax", "--help"]);
    assert_eq!(output.status.code(), Some(0));
    for option in [
        "--method",
        "--segments",
        "--tolerance",
        "--set",
        "--out",
        "--json",
        "--keep-unstable",
        "--modes",
        "semi-implicit",
    ] {
        assert!(text(&output.stdout).contains(option), "{option}");
    }
}

#[test]
fn a_leaf_comes_to_rest_and_is_written_down() {
    let place = Workplace::new();
    let output = place.run(&["relax", "leaf.toml"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(text(&output.stderr), "");
    let summary = text(&output.stdout);
    for word in [
        "small: 5 veins",
        "stable equilibrium",
        "tip",
        "energy",
        "error",
        "out/small",
    ] {
        assert!(summary.contains(word), "{word} in {summary}");
    }

    assert_eq!(place.names("out/small"), FILES);
    let csv = fs::read_to_string(place.path("out/small/centerlines.csv")).unwrap();
    assert!(csv.starts_with("rod,sigma,s,x,y,z,qw,"));
    let svg = fs::read_to_string(place.path("out/small/figure.svg")).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    assert!(is_whole_png(&place.path("out/small/figure.png")));
    let summary = fs::read_to_string(place.path("out/small/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    let stations = summary["stations"].as_array().unwrap().len();
    assert_eq!(csv.lines().count(), 1 + 5 * stations);
}

#[test]
fn json_is_alone_on_standard_output() {
    let place = Workplace::new();
    let output = place.run(&["relax", "leaf.toml", "--json", "--out", "here/below"]);
    assert_eq!(output.status.code(), Some(0));
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["scenario"], "small");
    assert_eq!(summary["method"], "semi-implicit");
    assert_eq!(summary["outcome"], "converged");
    assert_eq!(summary["rods"], 5);
    assert_eq!(summary["stable"], true);
    assert_eq!(summary["positions"].as_array().unwrap().len(), 5);
    assert_eq!(
        output.stdout,
        fs::read(place.path("here/below/summary.json")).unwrap()
    );
}

#[test]
fn overrides_reach_the_scenario() {
    let place = Workplace::new();
    let arguments = [
        "relax",
        "leaf.toml",
        "--json",
        "--set",
        "leaf.rods=3",
        "--tolerance",
        "1e-5",
    ];
    let summary: Value = serde_json::from_slice(&place.run(&arguments).stdout).unwrap();
    assert_eq!(summary["rods"], 3);
    assert_eq!(summary["tolerance"], 1e-5);
}

#[test]
fn a_single_grid_claims_no_accuracy() {
    let place = Workplace::new();
    let output = place.run(&["relax", "leaf.toml", "--json", "--segments", "8"]);
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["segments"], serde_json::json!([8]));
    assert_eq!(summary["error_estimate"], Value::Null);
    let success = summary["outcome"] == "converged";
    assert_eq!(output.status.code(), Some(if success { 0 } else { 1 }));
    if !success {
        assert!(
            !output.stderr.is_empty(),
            "the remark goes to standard error"
        );
    }
    assert_eq!(
        place.names("out/small"),
        FILES,
        "files are written all the same"
    );
}

/// Runs that are refused: status 2, a message, and nothing written.
fn assert_refused(arguments: &[&str], message: &[&str]) {
    let place = Workplace::new();
    fs::write(place.path("plain"), "a file").unwrap();
    let output = place.run(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    assert_eq!(text(&output.stdout), "", "{arguments:?}");
    for part in message {
        assert!(
            text(&output.stderr).contains(part),
            "{part} in {}",
            text(&output.stderr)
        );
    }
    assert_eq!(place.names("."), ["leaf.toml", "plain"], "{arguments:?}");
}

#[test]
fn unknown_methods_are_refused_with_the_list_of_methods() {
    for name in ["newton", "implicit"] {
        assert_refused(
            &["relax", "leaf.toml", "--method", name],
            &[name, "semi-implicit"],
        );
    }
}

#[test]
fn unwritable_output_folders_are_refused_before_the_run() {
    let message = [
        "error: cannot write to the folder plain/out: plain is not a folder",
        "--out DIR",
    ];
    assert_refused(&["relax", "leaf.toml", "--out", "plain/out"], &message);
    assert_refused(
        &["relax", "leaf.toml", "--json", "--out", "plain"],
        &["is not a folder"],
    );
}

#[test]
fn unreadable_scenarios_and_impossible_tolerances_are_refused() {
    assert_refused(&["relax", "absent.toml"], &["absent.toml"]);
    assert_refused(&["relax", "leaf.toml", "--tolerance", "0"], &["tolerance"]);
    assert_refused(&["relax", "leaf.toml", "--tolerance", "-1"], &["tolerance"]);
    assert_refused(
        &["relax", "leaf.toml", "--segments", "few"],
        &["--segments"],
    );
    assert_refused(&["relax"], &["SCENARIO"]);
    assert_refused(&["grow", "leaf.toml"], &["grow"]);
}

#[cfg(unix)]
mod unix {
    use std::io;
    use std::process::{Child, Stdio};
    use std::thread;
    use std::time::{Duration, Instant};

    use super::*;

    /// A reader that has gone must not make the program panic.
    #[test]
    fn closed_standard_output_is_no_error() {
        for arguments in [
            vec!["relax", "leaf.toml"],
            vec!["relax", "leaf.toml", "--json"],
        ] {
            let (reader, writer) = io::pipe().unwrap();
            drop(reader);
            let place = Workplace::new();
            let output = place.command(&arguments).stdout(writer).output().unwrap();
            assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
            assert_eq!(text(&output.stderr), "");
            assert_eq!(place.names("out/small"), FILES);
        }
    }

    #[test]
    fn full_standard_output_is_an_error() {
        let Ok(full) = fs::OpenOptions::new().write(true).open("/dev/full") else {
            return;
        };
        let place = Workplace::new();
        let output = place
            .command(&["relax", "leaf.toml", "--json"])
            .stdout(full)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output.stderr).contains("cannot write to standard output"));
    }

    fn interrupt(child: &Child) {
        let killed = Command::new("kill")
            .arg("-INT")
            .arg(child.id().to_string())
            .status();
        assert!(killed.unwrap().success());
    }

    /// A leaf so wide that nobody waits for it.
    fn start_long_run(place: &Workplace) -> Child {
        fs::write(place.path("leaf.toml"), leaf("wide", 20_000)).unwrap();
        place
            .command(&["relax", "leaf.toml", "--tolerance", "1e-10"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    #[test]
    fn an_interrupt_stops_at_once_and_leaves_nothing() {
        let place = Workplace::new();
        let child = start_long_run(&place);
        // Long enough to be in the solver, short enough not to be done.
        thread::sleep(Duration::from_millis(700));
        interrupt(&child);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(130), "{}", text(&output.stderr));
        assert_eq!(text(&output.stdout), "");
        assert_eq!(place.names("."), ["leaf.toml"]);
    }

    #[test]
    fn an_interrupt_while_writing_leaves_only_whole_files() {
        let place = Workplace::new();
        // Many rods on a fine grid: a large table, which takes a while to write.
        fs::write(place.path("leaf.toml"), leaf("large", 500)).unwrap();
        let arguments = ["relax", "leaf.toml", "--segments", "256"];
        let child = place
            .command(&arguments)
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let unfinished = |name: &String| name.ends_with(".part");
        let start = Instant::now();
        while !place.path("out/large").is_dir() || !place.names("out/large").iter().any(unfinished)
        {
            assert!(
                start.elapsed() < Duration::from_secs(60),
                "nothing is written"
            );
            thread::sleep(Duration::from_millis(1));
        }
        interrupt(&child);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(130));
        let names = place.names("out/large");
        assert!(
            names.len() < FILES.len(),
            "{names:?} is everything: interrupted too late"
        );
        assert!(
            names.iter().all(|name| FILES.contains(&name.as_str())),
            "{names:?}"
        );
    }
}
