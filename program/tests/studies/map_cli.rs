//! What scripts rely on when they map a leaf: files, exit statuses, and that a
//! map can be stopped, shared out and drawn later.

use std::fs;

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
        "0 were there, 36 computed",
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
    assert_eq!(lines(&place, "out/map.csv"), rows);

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

#[test]
fn a_run_goes_on_where_one_was_stopped() {
    let place = Workplace::new();
    run(&place, "", "2");
    let timeless = || timeless(&place, "out/map.csv");
    let (whole, without) = (lines(&place, "out/map.csv"), timeless());
    // Five rows, and a sixth half written, as a kill leaves them.
    let half = format!("{}\n{}", whole[..6].join("\n"), &whole[6][..20]);
    place.write("out/map.csv", half);
    contains(&run(&place, "", "2"), &["5 were there, 31 computed"]);
    assert_eq!(timeless(), without);
    let again = lines(&place, "out/map.csv");
    // With their times: they were not computed again.
    assert_eq!(again[..6], whole[..6]);

    contains(&run(&place, "", "2"), &["36 were there, 0 computed"]);
    assert_eq!(lines(&place, "out/map.csv"), again);
    let shown = run(&place, "--json", "2");
    assert_eq!(shown, place.read("out/map.json"), "--json shows the file");
    // With another method.
    let more = place.run(format!("{CELLS} --out out --methods single-shooting"));
    more.ends(0).says(&["36 were there, 12 computed"]);
    assert_eq!(lines(&place, "out/map.csv").len(), 1 + 48);
}

#[test]
fn shards_joined_equal_the_whole() {
    let place = Workplace::new();
    run(&place, "", "2");
    let whole = timeless(&place, "out/map.csv");

    let shared = Workplace::new();
    for shard in ["--shard 2/3", "--shard 1/3", "--shard 3/3"] {
        for said in ["0 were there, 12 computed", "12 were there, 0 computed"] {
            contains(&run(&shared, shard, "1"), &[said]);
        }
    }
    // No shard draws.
    let parts = ["map-1-of-3.csv", "map-2-of-3.csv", "map-3-of-3.csv"];
    shared.holds("out", &format!("{} map.json", parts.join(" ")));
    // A plain run in their folder takes them up and draws.
    contains(&run(&shared, "", "2"), &["36 were there, 0 computed"]);
    assert_eq!(timeless(&shared, "out/map.csv"), whole);
    shared.picture("out/map");
}

#[test]
fn maps_are_not_mixed() {
    let place = Workplace::new();
    run(&place, "", "2");
    for (more, what) in [
        ("--set load.tip_force=[0,0,1]", "set"),
        ("--tolerance 1e-5", "tolerance"),
        ("--cell-seconds 3", "cell_seconds"),
    ] {
        let message = format!("its {what} is not the same");
        place.refuses(small(&format!("--out out {more}")), &message);
    }
    let leaf = place.read("leaf.toml").replace("y = 1.0", "y = 2.0");
    place.write("leaf.toml", leaf);
    place.refuses(small("--out out"), "scenario_digest");
    // Rows without a word on which map they are of, and other tables.
    fs::remove_file(place.path("out/map.json")).unwrap();
    let before = place.read("out/map.csv");
    let refused = place.refuses(small("--out out"), "out/map.csv is of another map");
    contains(&refused.err, &["name another folder with --out DIR"]);
    assert_eq!(place.read("out/map.csv"), before);
    place.holds("out", "map.csv map.png map.svg");
    let place = Workplace::new();
    run(&place, "", "2");
    place.write("out/map-1-of-2.csv", "a,b\n1,2\n");
    let message = "map-1-of-2.csv:1: is no row of this map";
    place.refuses(small("--out out"), message);
}
