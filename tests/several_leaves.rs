//! Several scenarios in one call: a folder each and one table, whatever the threads.

mod workplace;

use std::fs;

use workplace::{Workplace, leaf};

const TABLE: [&str; 3] = ["file", "exit_status", "scenario"];

#[test]
fn several_scenarios_have_a_folder_each_and_one_table() {
    let place = Workplace::new();
    fs::write(place.path("wide.toml"), leaf("wide", 9)).unwrap();
    fs::write(place.path("bad.toml"), "name = 3").unwrap();
    let run = place.run("relax leaf.toml wide.toml").ok();
    run.says(&["small: 5 veins", "wide: 9 veins", "out: table.csv"]);
    assert_eq!(place.names("out"), ["small", "table.csv", "wide"]);
    let table = place.read("out/table.csv");
    let rows: Vec<Vec<&str>> = table
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    assert_eq!(rows[0][..3], TABLE);
    assert_eq!(rows.len(), 3);
    assert!(rows.iter().all(|row| row.len() == rows[0].len()));
    for (row, name) in rows[1..].iter().zip(["small", "wide"]) {
        let json = place.json(&format!("out/{name}/summary.json"));
        let cell = |column: &str| row[rows[0].iter().position(|it| *it == column).unwrap()];
        assert_eq!(cell("exit_status"), "0");
        assert_eq!(cell("outcome"), "converged");
        assert_eq!(cell("tip_z").parse::<f64>().unwrap(), json["tip"][2]);
        assert_eq!(cell("energy").parse::<f64>().unwrap(), json["energy"]);
        assert_eq!(
            cell("work_steps").parse::<u64>().unwrap(),
            json["work"]["steps"]
        );
        assert_eq!(cell("error"), "");
    }
    // One that is refused does not keep the others.
    let run = place.run("relax leaf.toml bad.toml wide.toml --json --write csv --out three");
    let run = run.ends(2);
    let json = run.json();
    assert_eq!(json[0]["scenario"], "small");
    assert_eq!(json[1]["exit_status"], 2);
    assert!(
        json[1]["error"]
            .as_str()
            .unwrap()
            .starts_with("bad.toml:1: name = 3")
    );
    assert_eq!(json[2]["scenario"], "wide");
    assert_eq!(place.names("three"), ["small", "table.csv", "wide"]);
    assert_eq!(place.read("three/table.csv").lines().count(), 4);
    place.run("check leaf.toml wide.toml").ok();
    assert!(
        place
            .read("out/check_table.csv")
            .starts_with("file,exit_status,")
    );
    fs::write(place.path("same.toml"), leaf("small", 2)).unwrap();
    let run = place.run("relax leaf.toml same.toml --out same").ends(2);
    assert!(
        run.err
            .contains("leaf.toml and same.toml are both named small")
    );
    assert!(!place.path("same").exists());
}

#[test]
fn several_leaves_side_by_side_are_those_one_by_one() {
    let place = Workplace::new();
    let names: Vec<String> = (2..10).map(|rods| format!("leaf{rods}")).collect();
    for (rods, name) in (2..10).zip(&names) {
        fs::write(place.path(&format!("{name}.toml")), leaf(name, rods)).unwrap();
    }
    let files: Vec<String> = names.iter().map(|name| format!("{name}.toml")).collect();
    place
        .run_on("4", &format!("relax --out all {}", files.join(" ")))
        .ok();
    for name in &names {
        place
            .run_on("1", &format!("relax {name}.toml --out one/{name}"))
            .ok();
        for file in ["centerlines.csv", "figure.svg", "figure.png"] {
            let [one, all] = ["one", "all"]
                .map(|out| fs::read(place.path(&format!("{out}/{name}/{file}"))).unwrap());
            assert!(one == all, "{name}/{file}");
        }
    }
}
