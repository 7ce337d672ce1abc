//! What scripts rely on when they map a leaf: files and exit statuses.

use leafdyn_testing::workplace::{Workplace, contains};

const FILES: &str = "map.csv map.json map.png map.svg";

/// Twelve cells, one of which the format refuses.
const CELLS: &str =
    "map leaf.toml --vary load.gravity[2]=-1e-2..-10:4log --vary coupling.y=-1..1:3";

/// The cells by three quick methods.
fn small(more: &str) -> String {
    format!("{CELLS} --methods semi-implicit,shooting,shooting-from-rest {more}")
}

#[track_caller]
fn run(place: &Workplace, more: &str, threads: &str) -> String {
    let arguments = small(&format!("--out out {more}"));
    place.run_on(threads, &arguments).ok().out
}

fn lines(place: &Workplace, name: &str) -> Vec<String> {
    let table = place.read(name);
    assert!(table.ends_with('\n'));
    table.lines().map(String::from).collect()
}

/// The rows of a table without their times: the last column but one.
fn timeless(place: &Workplace, name: &str) -> Vec<String> {
    let without = |line: String| {
        let columns: Vec<&str> = line.rsplitn(3, ',').collect();
        format!("{},{}", columns[2], columns[0])
    };
    lines(place, name).into_iter().map(without).collect()
}

#[test]
fn a_map_is_a_table_a_summary_and_a_figure() {
    let place = Workplace::new();
    let report = run(&place, "", "2");
    let parts = [
        "small: where methods fail",
        "load.gravity[2] from -0.01 to -10.0: 4 values, logarithmic",
        "coupling.y from -1.0 to 1.0: 3 values",
        "12 of 12, reference confirmed in ",
        "36 computed in ",
        "shooting-from-rest",
        "refused",
        "out: map.json, map.csv, map.svg, map.png",
    ];
    contains(&report, &parts);
    place.holds("out", FILES);
    let svg = place.picture("out/map");
    assert!(svg.contains("where methods fail") && !svg.contains("no waves"));

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
    run(&place, "--show waves", "2");
    let parts = ["waves along the margins", "stable, no waves"];
    contains(&place.picture("out/map"), &parts);

    let json = place.json("out/map.json");
    assert_eq!(json["scenario"], "small");
    assert_eq!(json["cells"], 12);
    assert_eq!(json["request"]["vary"][1]["keys"], "coupling.y");
    assert_eq!(json["outcomes"][0]["counts"]["refused"], 4);
}

#[test]
fn one_and_two_threads_give_the_same_rows() {
    let [one, two] = ["1", "2"].map(|threads| {
        let place = Workplace::new();
        run(&place, "", threads);
        timeless(&place, "out/map.csv")
    });
    assert_eq!(one, two);
}
