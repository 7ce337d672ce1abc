//! Which files are written, where, and whose they are: the same for every verb.

mod workplace;

use std::fs;
use std::io::Write;
use std::process::Stdio;

use leafdyn::scenario::Scenario;
use serde_json::Value;
use workplace::{Run, Workplace, all_refused, floats, leaf};

#[test]
fn only_the_kinds_asked_for_are_written() {
    let verbs = [
        (
            "relax leaf.toml",
            "centerlines.csv figure.png figure.svg summary.json",
        ),
        (
            "relax leaf.toml --all",
            "equilibria.json equilibria.png equilibria.svg",
        ),
        ("check leaf.toml", "check.json check.png check.svg"),
        (
            "simulate leaf.toml --set dynamics.duration=0.5",
            "energy.csv energy.png energy.svg filmstrip.png filmstrip.svg motion.csv motion.json",
        ),
        (
            "trace leaf.toml --vary load.gravity[2]=-1..-1.1",
            "trace.csv trace.json trace.png trace.svg",
        ),
    ];
    let place = Workplace::new();
    for (verb, all) in verbs {
        let none = place.run(&format!("{verb} --write none --json"));
        assert_eq!(none.json()["scenario"], "small", "{verb}");
        assert!(!place.path("out").exists());
        for kinds in ["json", "svg", "json,png", "svg,png,json"] {
            place.run(&format!("{verb} --write {kinds}")).ok();
            let wanted = |name: &&str| kinds.split(',').any(|kind| name.ends_with(kind));
            let wanted: Vec<&str> = all.split(' ').filter(wanted).collect();
            assert_eq!(place.names("out/small"), wanted, "{verb} --write {kinds}");
            fs::remove_dir_all(place.path("out")).unwrap();
        }
        place.run(verb).ok();
        assert_eq!(place.names("out/small").join(" "), all);
        fs::remove_dir_all(place.path("out")).unwrap();
    }
    let table = "relax leaf.toml --write csv";
    place
        .run(table)
        .ok()
        .says(&["written  out/small: centerlines.csv\n"]);
}

#[test]
fn a_map_keeps_no_rows_unless_tables_are_asked_for() {
    let place = Workplace::new();
    let map = "map leaf.toml --methods semi-implicit --vary load.gravity[2]=-1..-2:2";
    place.run(&format!("{map} --write svg")).ok();
    assert_eq!(place.names("out/small"), ["map.svg"]);
    place
        .run(&format!("{map} --write csv"))
        .ok()
        .says(&["2 computed"]);
    assert_eq!(place.names("out/small"), ["map.csv", "map.json", "map.svg"]);
    place
        .run(&format!("{map} --write none"))
        .ok()
        .says(&["2 were there, 0 computed"]);
    let shard = place
        .run(&format!("{map} --shard 1/2 --json --out part"))
        .ok();
    assert_eq!(shard.json()["outcomes"][0]["counts"]["right"], 1);
}

#[test]
fn kinds_that_there_are_not_are_refused() {
    all_refused(
        "relax",
        "leaf.toml --write pdf => pdf: must be some of json, csv, svg, png
        leaf.toml --write json,none => none: must be some of
        leaf.toml --write json, => must be some of
        leaf.toml --all --write csv => --write csv: this verb writes json, svg, png
        leaf.toml --stations 0 => --stations
        leaf.toml --stations many => --stations",
    );
    all_refused(
        "trace",
        "leaf.toml --vary rest.twist=0..1 --stations 4 => --stations 4: the files of this verb have none",
    );
}

#[test]
fn stations_are_as_many_as_asked_whatever_the_grids() {
    let place = Workplace::new();
    let stations = |more: &str| {
        let json = place
            .run(&format!("relax leaf.toml --write none --json {more}"))
            .json();
        let positions = json["positions"][2].as_array().unwrap().len();
        let stations = floats(&json["stations"]);
        assert_eq!(stations.len(), positions);
        (stations, json)
    };
    for more in [
        "--tolerance 1e-3",
        "--tolerance 1e-9",
        "--segments 6",
        "--method shooting",
    ] {
        let (found, json) = stations(&format!("{more} --stations 10"));
        let wanted: Vec<f64> = (0..=10).map(|i| f64::from(i) / 10.0).collect();
        assert_eq!(found, wanted, "{more}");
        let finest = json["segments"].as_array().unwrap().last().cloned();
        let (found, _) = stations(more);
        // Fewer where those between would not keep the tolerance.
        if found.len() < 17 {
            assert_eq!(more, "--tolerance 1e-9");
            continue;
        }
        if let Some(finest) = finest
            .and_then(|finest| finest.as_u64())
            .filter(|n| *n >= 16)
        {
            assert_eq!(found.len() as u64, finest + 1);
        }
    }
    // And in every file that has stations.
    place.run("relax leaf.toml --stations 5 --modes 2").ok();
    assert_eq!(
        place.read("out/small/centerlines.csv").lines().count(),
        1 + 5 * 6
    );
    assert_eq!(
        place.read("out/small/modes.csv").lines().count(),
        1 + 2 * 5 * 6
    );
    let all = place
        .run("relax leaf.toml --stations 5 --all --json")
        .json();
    assert_eq!(
        all["equilibria"][0]["stations"].as_array().unwrap().len(),
        6
    );
    place
        .run("simulate leaf.toml --stations 5 --set dynamics.duration=0.3")
        .ok();
    let json = place.json("out/small/motion.json");
    let rows = 5 * 6 * json["frames"].as_u64().unwrap() as usize;
    let motion = place.read("out/small/motion.csv");
    assert_eq!(motion.lines().count(), 1 + rows);
    let tip: Vec<f64> = motion
        .lines()
        .last()
        .unwrap()
        .split(',')
        .map(|x| x.parse().unwrap())
        .collect();
    assert_eq!(floats(&json["tip"]), tip[3..6]);
}

/// `input` of what a verb wrote, from which a leaf is made again.
#[test]
fn every_summary_holds_the_version_and_the_scenario() {
    let place = Workplace::new();
    let quick = "--set leaf.rods=3 --set coupling.y=[0.5,0.3333333333333333] --set stiffness.shear_2=inf --write json";
    let scenario = Scenario::read_with(
        &place.path("leaf.toml"),
        &[
            "leaf.rods=3",
            "coupling.y=[0.5,0.3333333333333333]",
            "stiffness.shear_2=inf",
        ]
        .map(String::from),
    );
    let scenario = scenario.unwrap();
    for (verb, file) in [
        ("relax", "summary"),
        ("relax --all", "equilibria"),
        ("check", "check"),
        ("simulate --set dynamics.duration=0.2", "motion"),
        ("trace --vary load.gravity[2]=-1..-1.1", "trace"),
        (
            "map --methods semi-implicit --vary load.gravity[2]=-1..-1.1:2",
            "map",
        ),
    ] {
        place.run(&format!("{verb} leaf.toml {quick}")).ok();
        let text = place.read(&format!("out/small/{file}.json"));
        let json: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(json["version"], env!("CARGO_PKG_VERSION"));
        assert_eq!(json["source"], "../../leaf.toml");
        if file != "motion" {
            assert_eq!(Scenario::from_toml(&text).unwrap(), scenario, "{verb}");
        }
    }
    // The program takes it, too, and finds the same leaf.
    let first = place.json("out/small/summary.json");
    let again = place
        .run("relax out/small/summary.json --out again --json")
        .ok()
        .json();
    assert_eq!(again["positions"], first["positions"]);
    assert_eq!(again["input"], first["input"]);
    assert_eq!(again["source"], "../out/small/summary.json");
}

#[test]
fn a_scenario_can_come_on_standard_input() {
    let place = Workplace::new();
    let fed = |text: &str| {
        let mut command = place.command("relax - --json --set leaf.rods=2");
        let command = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
        child
            .stdin
            .take()
            .unwrap()
            .write_all(text.as_bytes())
            .unwrap();
        Run::from(child.wait_with_output().unwrap())
    };
    let refused = fed("").ends(2).err;
    assert!(
        refused.contains("standard input: name is missing"),
        "{refused}"
    );
    let run = fed(&leaf("piped", 5)).ends(0);
    assert_eq!(
        (&run.json()["scenario"], &run.json()["rods"]),
        (&"piped".into(), &2.into())
    );
    assert_eq!(place.json("out/piped/summary.json")["source"], "-");
}

#[test]
fn a_folder_belongs_to_one_scenario() {
    let place = Workplace::new();
    fs::create_dir(place.path("other")).unwrap();
    fs::write(place.path("other/leaf.toml"), leaf("small", 3)).unwrap();
    let tips = "load.tip_force[2],tip_z,sd_tip_z\n0.0,-0.12,0.01\n0.2,-0.1,0.01\n";
    fs::write(place.path("tips.csv"), tips).unwrap();
    for (first, file) in [
        ("fit --data tips.csv --free stiffness.bending_2", "fit"),
        ("check", "check"),
        ("relax", "summary"),
        ("relax --all", "equilibria"),
    ] {
        place.run(&format!("{first} leaf.toml --write json")).ok();
        for verb in ["relax", "simulate", "check"] {
            let run = place.run(&format!("{verb} other/leaf.toml")).ends(2);
            let parts = [
                &format!("out/small/{file}.json is of another scenario"),
                "/leaf.toml: name a folder with --out DIR",
            ];
            assert!(
                parts.iter().all(|part| run.err.contains(*part)),
                "{}",
                run.err
            );
            assert_eq!(run.out, "");
        }
        assert_eq!(place.names("out/small"), [format!("{file}.json")]);
        // The same file is welcome, changed or not, and so is a folder that is named.
        place
            .run("relax leaf.toml --write json --set leaf.rods=4")
            .ok();
        place
            .run("relax other/leaf.toml --write json --out out/small")
            .ok();
        assert_eq!(
            place.json("out/small/summary.json")["source"],
            "../../other/leaf.toml"
        );
        fs::remove_dir_all(place.path("out")).unwrap();
    }
}

#[test]
fn verbs_share_a_folder_without_a_clash() {
    let place = Workplace::new();
    let short = "--set dynamics.duration=0.2";
    let verbs = [
        "relax leaf.toml --modes 1",
        "relax leaf.toml --all",
        "check leaf.toml",
        &format!("simulate leaf.toml {short}"),
        "trace leaf.toml --vary load.gravity[2]=-1..-1.1",
        "map leaf.toml --methods semi-implicit --vary load.gravity[2]=-1..-1.1:2",
        "chart leaf.toml --seconds 0.1 --methods semi-implicit --rods 2",
    ];
    let mut files = 0;
    for verb in verbs {
        let alone = Workplace::new();
        alone.run(verb).ok();
        files += alone.names("out/small").len();
        place.run(verb).ok();
        assert_eq!(place.names("out/small").len(), files, "{verb}");
    }
}

/// The keys of a JSON file, in their order.
#[test]
fn keys_and_their_order_are_fixed() {
    let place = Workplace::new();
    let about = |keys: &str| format!("version source {keys} input");
    for (verb, keys) in [
        (
            "check",
            "scenario verdict rods tolerance difference within_estimates relaxation shooting stations differences",
        ),
        (
            "trace --vary load.gravity[2]=-1..-1.1",
            "scenario vary range rods segments tolerance complete branches law factorizations wall_seconds",
        ),
        (
            "relax --all",
            "scenario starts failed equilibria remark wall_seconds",
        ),
        (
            "simulate --set dynamics.duration=0.2",
            "scenario method outcome rods segments tolerance duration time time_step stable_step steps frames energy tip wall_seconds",
        ),
    ] {
        let text = place
            .run(&format!("{verb} leaf.toml --write none --json"))
            .ends(0)
            .out;
        let keys_there = text.lines().filter_map(|line| line.strip_prefix("  \""));
        let keys_there: Vec<&str> = keys_there
            .map(|line| line.split('"').next().unwrap())
            .collect();
        assert_eq!(keys_there.join(" "), about(keys), "{verb}");
    }
}
