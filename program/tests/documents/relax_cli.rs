//! What scripts and readers rely on when they relax a leaf: files, exit statuses, and reports with the
//! digits that are known, and no more.

use leafdyn_testing::workplace::{Json, Run, Workplace, contains, floats, leaf, tells};
use serde_json::{Value, json};
use std::fs;

const FILES: &str = "centerlines.csv figure.png figure.svg summary.json";

const MODES: &str = "mode,eigenvalue,error,frequency,rod,sigma,dx,dy,dz,rx,ry,rz";

fn with_modes() -> String {
    FILES.replace("summary", "modes.csv modes.png modes.svg summary")
}

#[test]
fn a_leaf_comes_to_rest_and_is_written_down() {
    let place = Workplace::new();
    let parts = "small: 5 veins|stable equilibrium|tip|energy|error|out/small";
    let parts: Vec<&str> = parts.split('|').collect();
    place.ok("relax leaf.toml").says(&parts);
    place.holds("out/small", FILES);
    let csv = place.read("out/small/centerlines.csv");
    assert!(csv.starts_with("rod,sigma,s,x,y,z,qw,"));
    place.picture("out/small/figure");
    let summary = place.json("out/small/summary.json");
    let stations = summary["stations"].list().len();
    assert_eq!(csv.lines().count(), 1 + 5 * stations);
    let tip = csv.lines().nth(stations).unwrap().split(',').skip(3);
    let tip: Vec<f64> = tip.take(3).map(|cell| cell.parse().unwrap()).collect();
    assert_eq!(summary["tip"], json!(tip));
}

/// The largest stress is that of a row of the table; without sections there is none.
#[test]
fn stresses_are_told_where_sections_are_given() {
    let place = Workplace::new();
    let text = "
        name = 'rod'
        leaf = { rods = 1, length = 10, fan = [0] }
        section = { shape = 'circle', diameter = 0.2, young = 3e4 }
        load = { tip_force = [0, 0, -1e-3] }
    ";
    fs::write(place.path("rod.toml"), text).unwrap();
    let line = "stress   at most 12.73";
    let run = place.ok("relax rod.toml --write json,csv,html,vtk");
    run.says(&[
        line,
        " in vein 1 at its base: normal 12.73",
        ", shear 0.0424",
    ]);
    let stress = &place.json("out/rod/summary.json")["stress"];
    assert_eq!(
        (&stress["vein"], &stress["sigma"]),
        (&json!(1), &json!(0.0))
    );
    let csv = place.read("out/rod/centerlines.csv");
    let (header, base) = (csv.lines().next().unwrap(), csv.lines().nth(1).unwrap());
    assert!(header.ends_with(",m3,normal_stress,shear_stress,equivalent_stress"));
    let cells: Vec<f64> = base
        .split(',')
        .skip(22)
        .map(|it| it.parse().unwrap())
        .collect();
    let told = ["normal", "shear", "equivalent"].map(|name| stress[name].as_f64().unwrap());
    assert_eq!(cells, told);
    contains(&place.read("out/rod/view.html"), &["\"stress\": \""]);
    contains(
        &place.read("out/rod/leaf.vtp"),
        &["Name=\"equivalent_stress\""],
    );
    let none = place.ok("relax leaf.toml --write json,html");
    assert!(!none.out.contains("stress"));
    assert_eq!(place.json("out/small/summary.json")["stress"], Value::Null);
    assert!(!place.read("out/small/view.html").contains("\"stress\": \""));
}

/// `all` stands for every number that the scenario gives, one by one, and a list for its entries.
#[test]
fn every_number_that_is_given_has_a_derivative() {
    let place = Workplace::new();
    let text = "
        name = 'rod'
        leaf = { rods = 1, length = 10, fan = [0.1] }
        section = { shape = 'circle', diameter = 0.2, young = 3e4 }
        load = { tip_force = [0, 0, -1e-3] }
        solve = { tolerance = 1e-5 }
    ";
    fs::write(place.path("rod.toml"), text).unwrap();
    let changes = |keys: &str| {
        let asked = format!("relax rod.toml --sensitivity {keys} --modes 0 --json --write none");
        let found: Value = place.run(&asked).ends(0).json();
        found["sensitivities"].list().to_vec()
    };
    let all = changes("all");
    let one_by_one = changes(
        "leaf.length,leaf.fan[0],section.diameter,section.young,load.tip_force[0],load.tip_force[1],load.tip_force[2]",
    );
    let by_key = |list: &[Value]| {
        let mut list = list.to_vec();
        list.sort_by_key(|one| one["key"].to_string());
        list
    };
    assert_eq!(by_key(&all), by_key(&one_by_one));
    let fan = changes("leaf.fan");
    assert_eq!(fan.len(), 1);
    assert_eq!(fan[0]["key"], json!("leaf.fan[0]"));
    place.refuses(
        "relax leaf.toml --sensitivity leaf.fan --set leaf.fan=paper",
        "leaf.fan: is \"paper\" in the scenario: write its numbers there",
    );
}

#[test]
fn json_is_alone_on_standard_output() {
    let place = Workplace::new();
    let run = place.run("relax leaf.toml --json --out here/below").ends(0);
    let summary = run.json();
    let found = "scenario=small method=semi-implicit outcome=converged rods=5 stable=true";
    tells(&summary, found);
    assert_eq!(summary["positions"].list().len(), 5);
    assert_eq!(run.out, place.read("here/below/summary.json"));
}

#[test]
fn requests_reach_the_solver() {
    leafdyn_testing::workplace::all_tell(
        0,
        "
        relax leaf.toml --set leaf.rods=3 --tolerance 1e-5 => rods=3 tolerance=1e-5
        relax leaf.toml --method shooting --intervals 4 => intervals=4; by multiple shooting over 4 intervals
        relax scenarios/paper/fig10.toml --set leaf.rods=5 --method shooting => outcome=saddle stable=false negative_eigenvalues=18; unstable equilibrium of index 18
        ",
    );
}

#[test]
fn a_single_grid_claims_no_accuracy() {
    let place = Workplace::new();
    let run = place.run("relax leaf.toml --json --segments 8 --modes 2");
    let summary = run.json();
    let told = "segments=[8] error_estimate=null eigenvalue_errors=null";
    tells(&summary, told);
    assert_eq!(floats(&summary["lowest_eigenvalues"]).len(), 2);
    assert_eq!(place.table("out/small/modes.csv", MODES)[0][2], "");
    let success = summary["outcome"] == "converged";
    assert_eq!(run.status, Some(if success { 0 } else { 1 }));
    // A remark goes to standard error.
    assert!(success || !run.err.is_empty());
    // Written all the same.
    place.holds("out/small", &with_modes());
}

/// Without a potential modes are small motions, whose nodes may be out of phase, and have the files of modes.
#[test]
fn small_motions_have_the_files_of_modes() {
    let place = Workplace::new();
    let run = place.run(
        "relax leaf.toml --set load.follower=[0.05,-0.1,0.2] --set dynamics.internal_damping=0.01 \
         --modes 2 --json --write csv,svg,html",
    );
    let summary = run.json();
    let columns = "mode,growth_rate,error,frequency,rod,sigma,dx,dy,dz,rx,ry,rz,\
                   later_dx,later_dy,later_dz,later_rx,later_ry,later_rz";
    let rows = place.table("out/small/modes.csv", columns);
    let numbers = |key: &str| floats(&summary[key]);
    let stations = summary["stations"].list().len();
    assert_eq!(rows.len() % (stations * numbers("growth_rates").len()), 0);
    for row in &rows {
        let mode: usize = row[0].parse().unwrap();
        for (column, key) in [
            (1, "growth_rates"),
            (2, "motion_errors"),
            (3, "frequencies"),
        ] {
            assert_eq!(row[column].parse::<f64>().unwrap(), numbers(key)[mode - 1]);
        }
        // The base is held.
        if row[5] == "0.0" {
            assert!(row[6..].iter().all(|it| it == "0.0"), "{row:?}");
        }
    }
    let later = |row: &Vec<String>| row[12..].iter().any(|it| it != "0.0");
    assert!(rows.iter().any(later));
    let figure = place.read("out/small/modes.svg");
    contains(&figure, &["decays at", "a quarter of a period later"]);
    contains(&place.read("out/small/view.html"), &["\"later\":"]);
}

#[test]
fn a_folder_that_is_a_file_is_refused() {
    let place = Workplace::new();
    place.write("plain", "a file");
    let message = "error: cannot write to the folder plain/out: plain is not a folder";
    let refused = place.refuses("relax leaf.toml --out plain/out", message);
    contains(&refused.err, &["--out DIR"]);
    place.refuses("relax leaf.toml --json --out plain", "is not a folder");
}

/// A run by shooting into `out`: its report and `summary.json`.
fn shoot(place: &Workplace, arguments: &str, status: i32) -> (String, Value) {
    let run = place.run(format!(
        "relax {arguments} --method shooting --out out --verbose"
    ));
    let Run { out, err, .. } = run.ends(status);
    assert_eq!(err, "");
    place.holds("out", FILES);
    (out, place.json("out/summary.json"))
}

#[test]
fn shooting_finds_a_stable_leaf() {
    let place = Workplace::new();
    let (report, summary) = shoot(&place, "leaf.toml", 0);
    let (found, how) = ("found    stable equilibrium", ", by single shooting");
    contains(&report, &["method shooting", found, how, " corrections, "]);
    let told = "method=shooting outcome=converged segments=[] intervals=1 stable=true";
    tells(&summary, told);
    contains(&place.picture("out/figure"), &["by single shooting"]);
}

#[test]
fn a_failure_of_shooting_shows_no_numbers_that_are_none() {
    let place = Workplace::new();
    let column = "scenarios/classic/cantilever_tip.toml --set load.tip_force=[1e5,0,1]";
    let (report, summary) = shoot(&place, &format!("{column} --intervals 1"), 1);
    let parts = ["found    no equilibrium\n", "use more intervals"];
    contains(&report, &parts);
    for part in ["NaN", "inf", "residual", "energy", "tip  "] {
        assert!(!report.contains(part), "{part} in {report}");
    }
    assert_eq!(summary["outcome"], "not-at-rest");
    let told = "residual=null energy=null error_estimate=null stable=null";
    tells(&summary, told);
    contains(&place.picture("out/figure"), &["how far shooting came"]);
}

fn summary(place: &Workplace, arguments: &str) -> Value {
    place.told(0, format!("relax leaf.toml {arguments}"))
}

#[test]
fn three_eigenvalues_are_told_unasked() {
    let place = Workplace::new();
    let summary = summary(&place, "");
    let eigenvalues = floats(&summary["lowest_eigenvalues"]);
    assert_eq!(eigenvalues.len(), 3);
    assert!(eigenvalues[0] > 0.0 && eigenvalues.is_sorted());
    let errors = floats(&summary["eigenvalue_errors"]);
    assert!(errors.iter().zip(&eigenvalues).all(|(e, l)| *e < 1e-3 * l));
    place.holds("out/small", FILES);

    let cycles = eigenvalues[0].sqrt() / std::f64::consts::TAU;
    let wanted = format!("modes    lowest frequencies {cycles:.4}");
    let report = place.run("relax leaf.toml");
    // No more digits are told than the error leaves.
    report.says(&[&wanted[..wanted.len() - 3]]);
}

#[test]
fn modes_are_written_and_drawn_on_request() {
    let place = Workplace::new();
    let run = place.run("relax leaf.toml --modes 4").ends(0);
    run.says(&["figure.png, modes.csv, modes.svg, modes.png"]);
    place.holds("out/small", &with_modes());

    let summary = place.json("out/small/summary.json");
    let eigenvalues = floats(&summary["lowest_eigenvalues"]);
    let stations = summary["stations"].list().len();
    let rows = place.numbers("out/small/modes.csv", MODES);
    assert_eq!(rows.len(), 4 * 5 * stations);
    for (k, rows) in rows.chunks(5 * stations).enumerate() {
        for row in rows {
            assert_eq!(row[0], (k + 1) as f64);
            assert_eq!(row[1], eigenvalues[k]);
            assert_eq!(row[3], eigenvalues[k].sqrt());
            // The base is clamped.
            assert!(row[5] > 0.0 || row[6..].iter().all(|value| *value == 0.0));
        }
        let far = |row: &Vec<f64>| row[6..9].iter().map(|d| d * d).sum::<f64>().sqrt();
        let largest = rows.iter().map(far).fold(0.0, f64::max);
        // On the finest grid it is 1.
        assert!((0.7..1.0 + 1e-12).contains(&largest), "{largest}");
    }
    let svg = place.picture("out/small/modes");
    assert_eq!(svg.matches("<g class=\"mode\">").count(), 4);
    assert_eq!(svg.matches("ω = ").count(), 4);
    assert!(!svg.contains("NaN") && !svg.contains("unstable"));

    // Of the leaf that is there now nothing like it is known.
    place.run("relax leaf.toml");
    place.holds("out/small", FILES);
}

#[test]
fn no_modes_are_null() {
    let place = Workplace::new();
    for arguments in [
        "--modes 0",
        "--method shooting",
        "--set leaf.rods=1 --set load.tip_moment=[0,0,1]",
    ] {
        let summary = summary(&place, arguments);
        tells(&summary, "lowest_eigenvalues=null eigenvalue_errors=null");
        place.holds("out/small", FILES);
    }
    let run = place.run("relax leaf.toml --modes 0");
    assert!(!run.out.contains("modes"));
}

/// A column at the load under which its own weight makes it buckle (Greenhill 1881).
#[test]
fn a_frequency_of_zero_is_told_with_what_it_means() {
    let place = Workplace::new();
    let column = r#"
        name = "column"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 2.0, axial = inf, shear_2 = inf, shear_3 = inf }
        load = { gravity = [-7.8373474, 0.0, 0.0] }"#;
    place.write("column.toml", column);
    let run = place.run("relax column.toml --write none --modes 3");
    let parts = [
        "modes    lowest frequencies 0, ",
        "; zero within its error: ",
    ];
    run.ends(0).says(&parts);
}

/// The flat shape of this soft leaf is a saddle.
#[test]
fn unstable_modes_are_told_and_marked() {
    let place = Workplace::new();
    let soft = "--set leaf.rods=1 --set leaf.fan=[0.0] --set load.gravity=[0,0,0]";
    let pushed = "--set load.tip_force=[-3,0,0] --keep-unstable --modes 3";
    let run = place.run(format!("relax leaf.toml {soft} {pushed}"));
    let rates = ["modes    growth rates ", "; lowest frequencies "];
    run.says(&["2 negative eigenvalues"]).says(&rates);
    let svg = place.read("out/small/modes.svg");
    assert_eq!(svg.matches("unstable: grows at ").count(), 2);
    assert_eq!(svg.matches("ω = ").count(), 1);
    let cells = &place.table("out/small/modes.csv", MODES)[0];
    assert!(cells[1].starts_with('-') && cells[3].is_empty());
}

#[cfg(unix)]
mod unix {
    use std::process::{Child, Stdio};
    use std::time::{Duration, Instant};
    use std::{io, thread};

    use super::*;
    use leafdyn_testing::workplace::interrupt;

    /// A run whose standard output nobody reads.
    fn unread(place: &Workplace, arguments: &str) -> Run {
        let (reader, writer) = io::pipe().unwrap();
        drop(reader);
        let output = place.command(arguments).stdout(writer).output();
        Run::from(output.unwrap())
    }

    /// A reader that has gone must not make the program panic. Of a report he may have read
    /// enough; JSON that was not delivered is no success.
    #[test]
    fn closed_standard_output_is_an_error_for_json_alone() {
        let place = Workplace::new();
        unread(&place, "relax leaf.toml").ok();
        place.holds("out/small", FILES);
        let run = unread(&place, "relax leaf.toml --json").ends(2);
        contains(&run.err, &["cannot write to standard output"]);
        place.holds("out/small", FILES);
    }

    #[test]
    fn full_standard_output_is_an_error() {
        let Ok(full) = fs::OpenOptions::new().write(true).open("/dev/full") else {
            return;
        };
        let place = Workplace::new();
        let mut command = place.command("relax leaf.toml --json");
        let run = Run::from(command.stdout(full).output().unwrap()).ends(2);
        contains(&run.err, &["cannot write to standard output"]);
    }

    /// A leaf so wide that nobody waits for it.
    fn start_long_run(place: &Workplace) -> Child {
        place.write("leaf.toml", leaf("wide", 20_000));
        place.start("relax leaf.toml --tolerance 1e-10")
    }

    #[test]
    fn an_interrupt_stops_at_once_and_leaves_nothing() {
        let place = Workplace::new();
        let child = start_long_run(&place);
        // Long enough to be in the solver, short enough not to be done.
        thread::sleep(Duration::from_millis(700));
        interrupt(&child);
        let run = Run::from(child.wait_with_output().unwrap()).ends(130);
        assert_eq!(run.out, "");
        place.holds(".", "leaf.toml");
    }

    #[test]
    fn an_interrupt_while_writing_leaves_only_whole_files() {
        let place = Workplace::new();
        // Many rods on a fine grid: a large table, which takes a while to write.
        place.write("leaf.toml", leaf("large", 500));
        let mut command = place.command("relax leaf.toml --segments 256");
        let child = command.stdout(Stdio::null()).spawn().unwrap();
        let folder = place.path("out/large");
        let unfinished = |name: &String| name.ends_with(".part");
        let start = Instant::now();
        while !folder.is_dir() || !place.names("out/large").iter().any(unfinished) {
            let waited = start.elapsed();
            assert!(waited < Duration::from_secs(60), "nothing is written");
            thread::sleep(Duration::from_millis(1));
        }
        interrupt(&child);
        Run::from(child.wait_with_output().unwrap()).ends(130);
        let names = place.names("out/large");
        assert!(names.len() < 4, "{names:?}: interrupted too late");
        let whole = |name: &String| FILES.split(' ').any(|file| file == name);
        assert!(names.iter().all(whole), "{names:?}");
    }
}

/// A closed ring of a straight rod, twisted: what holds its tip is a small force between large
/// moments.
const RING: &str = r#"
name = "ring"
leaf = { rods = 1, length = 1.0, fan = [0.0] }
stiffness = { torsion = 0.7, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
tip = { held = "clamped", position = [0.0, 0.0, 0.0], angles = 6.283185307179586 }
"#;

/// The three numbers of a report's line, with the place of the last digit of each.
fn numbers(report: &str, line: &str) -> Vec<(f64, f64)> {
    let line = report.lines().find(|it| it.trim_start().starts_with(line));
    let inside = line.unwrap().split(['(', ')']).nth(1).unwrap();
    let number = |text: &str| {
        let (digits, power) = text.split_once('e').unwrap_or((text, "0"));
        let decimals = digits.split_once('.').map_or(0, |(_, it)| it.len() as i32);
        let power: i32 = power.parse().unwrap();
        (text.parse().unwrap(), 10_f64.powi(power - decimals))
    };
    inside.split(", ").map(number).collect()
}

#[test]
fn the_force_on_a_holder_has_known_digits() {
    let place = Workplace::new();
    place.write("ring.toml", RING);
    for (twist, bending) in [(0.0, 1.0), (0.487, 1.63), (1.701, 0.708), (0.403, 0.4)] {
        let given = format!(
            "relax ring.toml --write none --modes 0 --set tip.twist={twist} --set stiffness.bending_2={bending}"
        );
        let sharp = place.ok(format!("{given} --tolerance 1e-11 --json")).json();
        let sharp = leafdyn_testing::workplace::floats(&sharp["tip_reaction"]);
        for tolerance in ["1e-4", "1e-6"] {
            let report = place.ok(format!("{given} --tolerance {tolerance}")).out;
            let printed = numbers(&report, "reaction ");
            for ((printed, place), exact) in printed.iter().zip(&sharp) {
                // What is printed as zero is not known at all.
                let off = (printed - exact).abs();
                let allowed = if *printed == 0.0 { 1e-4 } else { 1.01 * place };
                assert!(
                    off <= allowed,
                    "{twist}, {bending}, {tolerance}: {report} {sharp:?}"
                );
            }
        }
    }
    // A ring without twist needs moments alone.
    let report = place
        .ok("relax ring.toml --write none --set tip.twist=0.0")
        .out;
    assert_eq!(numbers(&report, "reaction ").len(), 3);
    assert!(
        report.contains("  reaction (0, 0, 0) on the holder"),
        "{report}"
    );
}

/// Rounding leaves no fifteen decimals.
#[test]
fn an_exact_tip_has_the_digits_that_rounding_leaves() {
    let place = Workplace::new();
    let column = "trace leaf.toml --write none --set leaf.rods=1 --set leaf.fan=[0] --set coupling.y=0 \
                  --set coupling.z=0 --set load.gravity=[0,0,0] --vary load.tip_force[0]=0..-1";
    let report = place.ok(column).out;
    for line in report.lines().filter(|line| line.contains(", tip (")) {
        for (_, place) in numbers(line.split(", tip").nth(1).unwrap(), "(") {
            assert!(place > 5e-15, "{report}");
        }
    }
}

const BLADE: &str = "relax scenarios/measured/blade.toml --tolerance 1e-4";

/// The console and JSON tell the error in veins of every blade with five veins or more, or why not.
#[test]
fn a_blade_tells_its_error_in_veins() {
    let place = Workplace::new();
    let run = place.ok(format!("{BLADE} --write json"));
    run.says(&[
        "in veins about ",
        " cm (of 9, from the same blade with 5; 17 would make it about ",
    ]);
    let blade = &place.json("out/blade/summary.json")["blade"];
    let difference = blade["half_as_many"]["difference"].as_f64().unwrap();
    assert_eq!(blade["error_in_veins"], json!(1.5 * difference));
    let few = place.ok(format!("{BLADE} --veins 5 --write none"));
    few.says(&[
        "blade: 5 veins",
        "estimated from 3 veins, and may be larger)",
    ]);
    let told = place.told(0, format!("{BLADE} --write none --set leaf.rods=4"));
    let none = (
        &told["blade"]["error_in_veins"],
        &told["blade"]["half_as_many"],
    );
    assert_eq!(none, (&Value::Null, &Value::Null));
    let per_vein = "--set load.g=[0,0,0] --set load.gravity=[0,0,-1e-5]";
    let run = place.ok(format!("{BLADE} --write none {per_vein}"));
    run.says(&["in veins not known: load.gravity is that of single veins"]);
}

/// Files are those of the blade with as many veins as it needs; too few end with status 1, and what makes
/// no sense is refused.
#[test]
fn veins_are_refined_on_request() {
    let place = Workplace::new();
    let run = place.ok(format!(
        "{BLADE} --veins auto --set leaf.rods=3 --write json,csv"
    ));
    run.says(&[
        "blade: 9 veins",
        "in veins of those tried: with 5 ",
        ", with 9 ",
    ]);
    let summary = place.json("out/blade/summary.json");
    tells(&summary, "rods=9 outcome=converged");
    assert_eq!(summary["input"]["leaf"]["rods"], json!(9));
    let tried = summary["blade"]["veins_tried"].list();
    assert_eq!(
        (&tried[0]["rods"], &tried[1]["rods"]),
        (&json!(5), &json!(9))
    );
    assert_eq!(
        tried[1]["error_in_veins"],
        summary["blade"]["error_in_veins"]
    );
    assert_eq!(summary["positions"].list().len(), 9);
    // On a single grid, whose own error is not known.
    let most = format!("{BLADE} --veins auto:1e-12 --segments 16 --modes 0 --set leaf.rods=34");
    let summary = place.told(1, format!("{most} --write none"));
    let found = "rods=34 outcome=tolerance-not-reached remark_code=error-in-veins";
    tells(&summary, found);
    let cases = [
        ("--veins 5x", "must be a number of veins, or auto"),
        ("--veins auto:", "must be a number of veins, or auto"),
        ("--veins auto:2", "--veins 2: must be between 0 and 1"),
        ("--veins auto --all", "not with --all"),
        ("--veins auto --margin", "--margin"),
        (
            "--veins auto --set load.gravity=[0,0,-1e-5]",
            "load.gravity is that of single veins",
        ),
    ];
    for (option, message) in cases {
        let run = place.run(format!("{BLADE} {option}")).ends(2);
        contains(&run.err, &[message]);
    }
    place.refuses("relax leaf.toml --veins auto", "only the veins of a blade");
    let run = place.run("check leaf.toml --veins auto").ends(2);
    contains(&run.err, &["--veins"]);
}
