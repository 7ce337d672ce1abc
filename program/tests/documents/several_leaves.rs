//! Several scenarios in one call: a folder each and one table, whatever the threads.

use std::fs;

use leafdyn_testing::workplace::{Json, Workplace, contains, leaf};

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
