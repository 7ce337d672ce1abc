//! The files of results: which are written, whose they are, and what is not replaced; of several
//! scenarios in one call a folder each and one table, whatever the threads.

use leafdyn::scenario::Scenario;
use leafdyn_testing::workplace::{Json, Run, Workplace, contains, floats, leaf, pairs};
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::process::Stdio;

/// Verbs, the files that they write and the keys of their JSON, in their order.
const VERBS: &str = "
    relax => centerlines.csv figure.png figure.svg summary.json => scenario method outcome rods segments tolerance residual error_estimate energy_error energy tip tip_force_sum base_reactions base_reaction stable negative_eigenvalues neutral_directions lowest_eigenvalues eigenvalue_errors path undulation model shear_effect stretch_effect work wall_seconds stations positions
    relax --all => equilibria.json equilibria.png equilibria.svg => scenario starts failed equilibria remark wall_seconds
    check => check.json check.png check.svg => scenario verdict rods tolerance difference within_estimates relaxation shooting stations differences
    simulate --segments 16 --set dynamics.duration=0.5 => energy.csv energy.png energy.svg filmstrip.png filmstrip.svg motion.csv motion.json => scenario method outcome choice start rods segments tolerance assumed_damping duration time error_estimate error_known_until error_aim time_step stable_step steps frames energy tip tip_speed wall_seconds
    trace --vary load.gravity[2]=-1..-1.1 => trace.csv trace.json trace.png trace.svg => scenario vary range rods segments tolerance complete branches law factorizations wall_seconds
";

/// Verb, files and keys.
fn verbs() -> impl Iterator<Item = (&'static str, &'static str, &'static str)> {
    pairs(VERBS).map(|(verb, rest)| {
        let (files, keys) = rest.split_once(" => ").unwrap();
        (verb, files, keys)
    })
}

#[test]
fn only_the_kinds_asked_for_are_written() {
    let place = Workplace::new();
    for (verb, all, _) in verbs() {
        let run = format!("{verb} leaf.toml");
        let none = place.run(format!("{run} --write none --json"));
        assert_eq!(none.json()["scenario"], "small", "{verb}");
        assert!(!place.path("out").exists());
        for kinds in ["json", "svg", "json,png", "svg,png,json"] {
            place.ok(format!("{run} --write {kinds}"));
            let wanted = |name: &&str| kinds.split(',').any(|kind| name.ends_with(kind));
            let wanted: Vec<&str> = all.split(' ').filter(wanted).collect();
            assert_eq!(place.names("out/small"), wanted, "{verb} --write {kinds}");
            fs::remove_dir_all(place.path("out")).unwrap();
        }
        place.ok(run);
        place.holds("out/small", all);
        fs::remove_dir_all(place.path("out")).unwrap();
    }
    let table = place.ok("relax leaf.toml --write csv");
    table.says(&["written  out/small: centerlines.csv\n"]);
}

#[test]
fn a_map_keeps_no_rows_unless_tables_are_asked_for() {
    let place = Workplace::new();
    let map = "map leaf.toml --methods semi-implicit --vary load.gravity[2]=-1..-2:2";
    place.ok(format!("{map} --write svg"));
    place.holds("out/small", "map.svg");
    place.ok(format!("{map} --write csv")).says(&["2 computed"]);
    place.holds("out/small", "map.csv map.svg");
}

#[test]
fn stations_are_as_many_as_asked_whatever_the_grids() {
    let place = Workplace::new();
    let stations = |more: &str| {
        let json = place.run(format!("relax leaf.toml --write none --json {more}"));
        let json = json.json();
        let stations = floats(&json["stations"]);
        assert_eq!(stations.len(), json["positions"][2].list().len());
        (stations, json)
    };
    let ways = "--tolerance 1e-3|--tolerance 1e-9|--segments 6|--method shooting";
    for more in ways.split('|') {
        let (found, json) = stations(&format!("{more} --stations 10"));
        let wanted: Vec<f64> = (0..=10).map(|i| f64::from(i) / 10.0).collect();
        assert_eq!(found, wanted, "{more}");
        let (found, _) = stations(more);
        let finest = json["segments"].list().last().map_or(0, Json::count);
        // Fewer where those between would not keep the tolerance.
        if found.len() < 17 {
            assert_eq!(more, "--tolerance 1e-9");
        } else if finest >= 16 {
            assert_eq!(found.len(), finest + 1);
        }
    }
    // And in every file that has stations.
    place.ok("relax leaf.toml --stations 5 --modes 2");
    let lines = |file: &str| place.read(&format!("out/small/{file}.csv")).lines().count();
    assert_eq!(lines("centerlines"), 1 + 5 * 6);
    assert_eq!(lines("modes"), 1 + 2 * 5 * 6);
    let all = place
        .run("relax leaf.toml --stations 5 --all --json")
        .json();
    assert_eq!(all["equilibria"][0]["stations"].list().len(), 6);
    place.ok("simulate leaf.toml --stations 5 --set dynamics.duration=0.3");
    let json = place.json("out/small/motion.json");
    assert_eq!(lines("motion"), 1 + 5 * 6 * json["frames"].count());
    let motion = place.read("out/small/motion.csv");
    let last = motion.lines().last().unwrap().split(',');
    let tip: Vec<f64> = last.map(|x| x.parse().unwrap()).collect();
    assert_eq!(floats(&json["tip"]), tip[3..6]);
}

/// `input` of what a verb wrote, from which a leaf is made again.
#[test]
fn every_summary_holds_the_version_and_the_scenario() {
    let place = Workplace::new();
    let entries = "leaf.rods=3 coupling.y=[0.5,0.3333333333333333] stiffness.shear_2=inf";
    let entries: Vec<String> = entries.split(' ').map(String::from).collect();
    let quick = format!("--set {}", entries.join(" --set "));
    let scenario = Scenario::read_with(&place.path("leaf.toml"), &entries).unwrap();
    let map = "map --methods semi-implicit --vary load.gravity[2]=-1..-1.1:2";
    let all = verbs().map(|(verb, files, _)| (verb, files));
    for (verb, files) in all.chain([(map, "map.json")]) {
        let file = files
            .split(' ')
            .find(|file| file.ends_with(".json"))
            .unwrap();
        place.ok(format!("{verb} leaf.toml {quick} --write json"));
        let text = place.read(&format!("out/small/{file}"));
        let json: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(json["version"], env!("CARGO_PKG_VERSION"));
        assert_eq!(json["source"], "../../leaf.toml");
        if file != "motion.json" {
            assert_eq!(Scenario::from_toml(&text).unwrap(), scenario, "{verb}");
        }
    }
    // The program takes it, too, and finds the same leaf.
    let first = place.json("out/small/summary.json");
    let again = place.ok("relax out/small/summary.json --out again --json");
    let again = again.json();
    assert_eq!(again["positions"], first["positions"]);
    assert_eq!(again["input"], first["input"]);
    assert_eq!(again["source"], "../out/small/summary.json");
}

#[test]
fn a_scenario_can_come_on_standard_input() {
    let place = Workplace::new();
    let fed_to = |verb: &str, text: &str| {
        let mut command = place.command(verb);
        let command = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
        let mut input = child.stdin.take().unwrap();
        input.write_all(text.as_bytes()).unwrap();
        drop(input);
        Run::from(child.wait_with_output().unwrap())
    };
    let fed = |text: &str| fed_to("relax - --json --set leaf.rods=2", text);
    contains(
        &fed("").ends(2).err,
        &["standard input: leaf.fan is missing"],
    );
    let found = fed(&leaf("piped", 5)).ends(0).json();
    assert_eq!(found["scenario"], "piped");
    assert_eq!(found["rods"], 2);
    assert_eq!(place.json("out/piped/summary.json")["source"], "-");
    // Standard input is welcome to its folder, a file is not.
    fed_to("relax -", &leaf("piped", 6)).ends(0);
    place.write("piped.toml", leaf("piped", 5));
    let another = "is of another scenario, from standard input: name a folder with --out DIR";
    place.refuses("relax piped.toml", another);
    place.ok("relax piped.toml --out out/piped");
    let twice = fed_to("relax - -", &leaf("twice", 2)).ends(2);
    contains(&twice.err, &["standard input can be read only once"]);
}

/// What a leaf is fitted to.
const TIPS: &str = "load.tip_force[2],tip_z,sd_tip_z\n0.0,-0.12,0.01\n0.2,-0.1,0.01\n";

#[test]
fn a_folder_belongs_to_one_scenario() {
    let place = Workplace::new();
    fs::create_dir(place.path("other")).unwrap();
    place.write("other/leaf.toml", leaf("small", 3));
    place.write("tips.csv", TIPS);
    let verbs = "
        fit --data tips.csv --free stiffness.bending_2 => fit
        check => check
        relax => summary
        relax --all => equilibria
    ";
    for (first, file) in pairs(verbs) {
        place.ok(format!("{first} leaf.toml --write json"));
        for verb in ["relax", "simulate", "check"] {
            let another = format!("out/small/{file}.json is of another scenario");
            let run = place.refuses(format!("{verb} other/leaf.toml"), &another);
            contains(&run.err, &["/leaf.toml: name a folder with --out DIR"]);
        }
        place.holds("out/small", &format!("{file}.json"));
        // The same file is welcome, changed or not, and so is a folder that is named.
        place.ok("relax leaf.toml --write json --set leaf.rods=4");
        place.ok("relax other/leaf.toml --write json --out out/small");
        let summary = place.json("out/small/summary.json");
        assert_eq!(summary["source"], "../../other/leaf.toml");
        fs::remove_dir_all(place.path("out")).unwrap();
    }
    // JSON that does not say whose it is is left alone.
    place.ok("relax leaf.toml");
    for foreign in ["not json", "{\"a\": 1}"] {
        place.write("out/small/summary.json", foreign);
        let why = "out/small/summary.json does not say of which scenario it is";
        place.refuses("relax leaf.toml", why);
        assert_eq!(place.read("out/small/summary.json"), foreign);
    }
}

/// What a request reads it does not replace, by whatever path.
#[test]
fn inputs_are_not_replaced() {
    let place = Workplace::new();
    place.write("fit.csv", TIPS);
    place.write("tips.csv", TIPS);
    let peers = "program,scenario,rods,setting,seconds,error,outcome\n";
    place.write("chart.csv", peers);
    // First, as it removes tables of modes, which it does not have.
    place.ok("relax leaf.toml --write json --out o");
    for file in "centerlines.csv modes.csv table.csv fitted.toml motion.csv".split(' ') {
        place.write(&format!("o/{file}"), leaf("small", 2));
    }
    let table = "
        fit leaf.toml FIT fit.csv --out . => ./fit.csv
        fit leaf.toml FIT tips.csv FIT o/../fit.csv --out o/.. => o/../fit.csv
        fit leaf.toml FIT tips.csv --candidates fit.csv --out . => ./fit.csv
        fit o/fitted.toml FIT tips.csv --out o => o/fitted.toml
        chart leaf.toml --peers chart.csv --out . => ./chart.csv
        relax o/centerlines.csv --out o => o/centerlines.csv
        relax o/modes.csv --write json --out ./o => o/modes.csv
        relax o/summary.json --out o --json => o/summary.json
        relax o/table.csv leaf.toml --out o => o/table.csv
        simulate o/motion.csv --out o => o/motion.csv
    ";
    for (request, file) in pairs(table) {
        let request = request.replace("FIT", "--free stiffness.bending_2 --data");
        let before = (place.names("o"), place.read("fit.csv"));
        let run = place.refuses(request, &format!("{file} is read by this request"));
        contains(&run.err, &["name another folder with --out DIR"]);
        assert_eq!((place.names("o"), place.read("fit.csv")), before);
    }
    // Files of other kinds are in nobody's way.
    place.ok("relax o/centerlines.csv --write svg --out o");
}

#[test]
fn verbs_share_a_folder_without_a_clash() {
    let place = Workplace::new();
    let others = [
        "relax --modes 1",
        "map --methods semi-implicit --vary load.gravity[2]=-1..-1.1:2",
        "chart --seconds 0.1 --methods semi-implicit --rods 2",
    ];
    let without_relax = verbs().map(|(verb, ..)| verb).skip(1);
    let mut files = 0;
    for verb in others.into_iter().chain(without_relax) {
        let (alone, run) = (Workplace::new(), format!("{verb} leaf.toml"));
        alone.ok(&run);
        files += alone.names("out/small").len();
        place.ok(&run);
        assert_eq!(place.names("out/small").len(), files, "{verb}");
    }
}

#[test]
fn keys_and_their_order_are_fixed() {
    let place = Workplace::new();
    for (verb, _, keys) in verbs() {
        let run = place.run(format!("{verb} leaf.toml --write none --json"));
        let run = run.ends(0);
        let lines = run.out.lines().filter_map(|line| line.strip_prefix("  \""));
        let found: Vec<&str> = lines.flat_map(|line| line.split('"').next()).collect();
        let keys = format!("version source {keys} input");
        assert_eq!(found.join(" "), keys, "{verb}");
    }
}

#[test]
fn several_scenarios_have_a_folder_each_and_one_table() {
    let place = Workplace::new();
    place.write("wide.toml", leaf("wide", 9));
    place.write("bad.toml", "name = 3");
    let run = place.ok("relax leaf.toml wide.toml");
    run.says(&["small: 5 veins", "wide: 9 veins", "out: table.csv"]);
    place.holds("out", "small table.csv wide");
    let table = place.read("out/table.csv");
    let rows = table.lines().map(|line| line.split(',').collect());
    let rows: Vec<Vec<&str>> = rows.collect();
    assert_eq!(rows[0][..3], ["file", "exit_status", "scenario"]);
    assert_eq!(rows.len(), 3);
    assert!(rows.iter().all(|row| row.len() == rows[0].len()));
    for (row, name) in rows[1..].iter().zip(["small", "wide"]) {
        let json = place.json(&format!("out/{name}/summary.json"));
        let cell = |column: &str| row[rows[0].iter().position(|it| *it == column).unwrap()];
        assert_eq!(cell("exit_status"), "0");
        assert_eq!(cell("outcome"), "converged");
        let told = [
            ("tip_z", &json["tip"][2]),
            ("energy", &json["energy"]),
            ("work_steps", &json["work"]["steps"]),
        ];
        for (column, value) in told {
            assert_eq!(cell(column).parse(), Ok(value.number()), "{column}");
        }
        assert_eq!(cell("error"), "");
    }
    // One that is refused does not keep the others.
    let run = place.run("relax leaf.toml bad.toml wide.toml --json --write csv --out three");
    let run = run.ends(2);
    let json = run.json();
    assert_eq!(json[0]["scenario"], "small");
    assert_eq!(json[1]["exit_status"], 2);
    let error = json[1]["error"].text();
    assert!(error.starts_with("bad.toml:1: name = 3"), "{error}");
    assert_eq!(json[2]["scenario"], "wide");
    place.holds("three", "small table.csv wide");
    assert_eq!(place.read("three/table.csv").lines().count(), 4);
    place.ok("check leaf.toml wide.toml");
    let table = place.read("out/check_table.csv");
    assert!(table.starts_with("file,exit_status,"));
    place.write("same.toml", leaf("small", 2));
    let run = place.run("relax leaf.toml same.toml --out same").ends(2);
    contains(&run.err, &["leaf.toml and same.toml are both named small"]);
    assert!(!place.path("same").exists());
}

#[test]
fn a_table_is_not_replaced_by_that_of_other_leaves() {
    let place = Workplace::empty();
    for (rods, name) in ["a", "b", "c", "d"].into_iter().enumerate() {
        place.write(&format!("{name}.toml"), leaf(name, rods + 1));
    }
    let rows = || place.read("out/table.csv").lines().count() - 1;
    place.ok("relax a.toml b.toml --write json,csv");
    for (others, said) in [
        ("c.toml d.toml", "results of a.toml, b.toml, which are not"),
        ("c.toml ./a.toml --json", "results of b.toml, which are not"),
    ] {
        let run = place.refuses(format!("relax {others} --write json,csv"), said);
        contains(&run.err, &["out/table.csv", "name a folder with --out DIR"]);
        place.holds("out", "a b table.csv");
    }
    // The same are welcome, in any order, with others; and so is a folder that is named.
    place.ok("relax ./b.toml c.toml a.toml --write json,csv");
    assert_eq!(rows(), 3);
    place.ok("check a.toml d.toml --write json,csv");
    place.ok("relax c.toml d.toml --write json,csv --out out");
    assert_eq!(rows(), 2);
    place.write("out/table.csv", "x,y\n1,2\n");
    let foreign = "out/table.csv is no table of results";
    place.refuses("relax a.toml b.toml", foreign);
    // What was refused left no result.
    place.write("bad.toml", "name = 3");
    fs::remove_file(place.path("out/table.csv")).unwrap();
    place.run("relax a.toml bad.toml --write json,csv").ends(2);
    place.ok("relax a.toml b.toml --write json,csv");
}

#[test]
fn several_leaves_side_by_side_are_those_one_by_one() {
    let place = Workplace::new();
    let names = [2, 3, 4, 5, 6, 7, 8, 9].map(|rods| format!("leaf{rods}"));
    for (rods, name) in (2..10).zip(&names) {
        place.write(&format!("{name}.toml"), leaf(name, rods));
    }
    let files = names.join(".toml ") + ".toml";
    place.run_on("4", &format!("relax --out all {files}")).ok();
    for name in &names {
        let alone = format!("relax {name}.toml --out one/{name}");
        place.run_on("1", &alone).ok();
        for file in ["centerlines.csv", "figure.svg", "figure.png"] {
            let path = |out: &str| place.path(&format!("{out}/{name}/{file}"));
            let [one, all] = ["one", "all"].map(|out| fs::read(path(out)).unwrap());
            assert!(one == all, "{name}/{file}");
        }
    }
}
