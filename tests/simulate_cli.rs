//! What scripts rely on when they simulate a leaf: streams, files, exit
//! statuses, and that a run that was stopped goes on as if it had not been.

mod workplace;

use std::fs;
use std::path::Path;

use serde_json::Value;
use workplace::{Workplace, is_whole_png, text};

const FILES: [&str; 7] = [
    "energy.csv",
    "energy.png",
    "energy.svg",
    "filmstrip.png",
    "filmstrip.svg",
    "motion.csv",
    "summary.json",
];

/// The path of a scenario that comes with the program.
fn scenario(name: &str) -> String {
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/motion");
    scenarios
        .join(format!("{name}.toml"))
        .to_str()
        .unwrap()
        .into()
}

/// Runs to the end; the summary as printed.
#[track_caller]
fn simulate(place: &Workplace, arguments: &[&str]) -> Value {
    let output = place.run(&[&["simulate", "--json"], arguments].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(text(&output.stderr), "");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Cells of a CSV file without its header.
fn cells(file: &Path) -> Vec<Vec<f64>> {
    let table = fs::read_to_string(file).unwrap();
    let row = |line: &str| line.split(',').map(|cell| cell.parse().unwrap()).collect();
    table.lines().skip(1).map(row).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    let numbers = value.as_array().unwrap().iter();
    numbers.map(|number| number.as_f64().unwrap()).collect()
}

/// Both methods end with their tips no farther apart than this.
#[track_caller]
fn methods_agree(name: &str, tolerance: f64) {
    let place = Workplace::new();
    let scenario = scenario(name);
    let [explicit, semi_implicit] = ["explicit", "semi-implicit"].map(|method| {
        let summary = simulate(&place, &[&scenario, "--method", method, "--out", method]);
        assert_eq!(place.names(method), FILES);
        assert_eq!(summary["scenario"], name);
        assert_eq!(summary["method"], method);
        assert_eq!(summary["time"], summary["duration"]);
        numbers(&summary["tip"])
    });
    let apart = explicit.iter().zip(&semi_implicit).map(|(a, b)| a - b);
    let apart = apart.map(|d| d * d).sum::<f64>().sqrt();
    assert!(apart < tolerance, "{name}: {apart:.1e}");
}

#[test]
fn methods_agree_on_a_leaf_let_go() {
    methods_agree("swing", 1e-4);
}

#[test]
fn methods_agree_on_a_leaf_that_curls() {
    methods_agree("curl", 1e-6);
}

/// At its longest step the explicit method is some thousandths off.
#[test]
fn methods_agree_on_a_struck_vein() {
    methods_agree("strike", 5e-3);
}

#[test]
fn every_scenario_in_motion_is_tested_above() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/motion");
    assert_eq!(fs::read_dir(folder).unwrap().count(), 3);
}

#[test]
fn help_names_every_option_and_exit_status() {
    let output = Workplace::new().run(&["simulate", "--help"]);
    assert_eq!(output.status.code(), Some(0));
    for part in [
        "--tolerance",
        "--set",
        "--out",
        "--json",
        "--method",
        "explicit",
        "semi-implicit",
        "--segments",
        "--step",
        "--resume",
        "0 followed to its end",
        "1 ended early",
        "2 the request was refused",
        "130 stopped by Ctrl-C",
    ] {
        assert!(text(&output.stdout).contains(part), "{part}");
    }
}

#[test]
fn the_report_says_what_was_done() {
    let place = Workplace::new();
    let output = place.run(&["simulate", "leaf.toml", "--set", "dynamics.duration=1"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(text(&output.stderr), "");
    let report = text(&output.stdout);
    for part in [
        "small: 5 veins joined at the tip, method explicit\n",
        "  moved    to t = 1 in ",
        " 101 outputs\n",
        "  grid     16 segments a vein\n",
        "  step     at most 5.3",
        ", stable up to 5.9",
        " (shear with rotation)\n",
        "  energy   kinetic ",
        "  balance  ",
        "  tip      (",
        " ns a step and segment\n",
        "  written  out/small: summary.json, energy.svg, energy.png, filmstrip.svg, \
         filmstrip.png, motion.csv, energy.csv\n",
    ] {
        assert!(report.contains(part), "{part} in {report}");
    }
    assert_eq!(place.names("out/small"), FILES);
    for picture in ["energy", "filmstrip"] {
        let file = |kind: &str| place.path("out/small").join(format!("{picture}.{kind}"));
        assert!(is_whole_png(&file("png")));
        let svg = fs::read_to_string(file("svg")).unwrap();
        assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    }
}

#[test]
fn tables_and_summary_tell_the_same() {
    let place = Workplace::new();
    let asked = [
        "leaf.toml",
        "--set",
        "dynamics.duration=0.5",
        "--segments",
        "8",
    ];
    let summary = simulate(&place, &asked);
    let written = fs::read(place.path("out/small/summary.json")).unwrap();
    assert_eq!(serde_json::from_slice::<Value>(&written).unwrap(), summary);

    let motion = fs::read_to_string(place.path("out/small/motion.csv")).unwrap();
    assert!(motion.starts_with("time,rod,sigma,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz\n"));
    let motion = cells(&place.path("out/small/motion.csv"));
    assert_eq!(motion.len(), 101 * 5 * 9);
    let energy = fs::read_to_string(place.path("out/small/energy.csv")).unwrap();
    assert!(energy.starts_with(
        "time,steps,kinetic,elastic,coupling,potential,dissipated,work,tip_x,tip_y,tip_z\n"
    ));
    let energy = cells(&place.path("out/small/energy.csv"));
    assert_eq!(energy.len(), 101);
    for (row, moment) in motion.chunks(5 * 9).zip(&energy) {
        assert_eq!(row[0][0], moment[0], "time");
        assert_eq!(row[44][3..6], moment[8..11], "tip");
        assert_eq!(row[0][3..6], [0.0; 3], "base");
        assert_eq!(row[0][10..], [0.0; 6], "the base does not move");
    }

    let (first, last) = (&energy[0], &energy[100]);
    assert_eq!((first[0], last[0]), (0.0, 0.5));
    assert_eq!(first[2], 0.0);
    assert_eq!(summary["outcome"], "completed");
    assert_eq!(summary.get("remark"), None);
    assert_eq!(summary["segments"], 8);
    assert_eq!(summary["frames"], 101);
    assert_eq!(summary["steps"].as_f64(), Some(last[1]));
    assert_eq!(summary["time"], 0.5);
    assert_eq!(summary["duration"], 0.5);
    assert_eq!(summary["tolerance"], 1e-6);
    // The parser of this test rounds the last digit.
    let same = |a: f64, b: f64| (a - b).abs() <= 1e-15 * b.abs();
    let tip = numbers(&summary["tip"]).into_iter().zip(&last[8..11]);
    assert!(tip.into_iter().all(|(a, b)| same(a, *b)));
    for (key, column) in [
        ("kinetic", 2),
        ("elastic", 3),
        ("coupling", 4),
        ("potential", 5),
        ("dissipated", 6),
        ("work", 7),
    ] {
        let energy = summary["energy"][key].as_f64().unwrap();
        assert!(same(energy, last[column]), "{key}");
    }
    for key in ["balance_start", "balance_end"] {
        assert!(summary["energy"][key].is_number(), "{key}");
    }
    let step = summary["time_step"].as_f64().unwrap();
    let stable = summary["stable_step"]["step"].as_f64().unwrap();
    assert!((step / stable - 0.9).abs() < 1e-12);
    assert!(summary["stable_step"]["limit"].is_string());
    assert!(summary["wall_seconds"].as_f64().unwrap() > 0.0);
}

#[test]
fn of_free_tips_all_are_listed_and_their_mean_is_tabled() {
    let place = Workplace::new();
    let free = ["leaf.toml", "--set", "leaf.joined=false"];
    let summary = simulate(
        &place,
        &[&free[..], &["--set", "dynamics.duration=0.2"]].concat(),
    );
    assert_eq!(summary["tip"], Value::Null);
    let tips: Vec<Vec<f64>> = summary["tips"]
        .as_array()
        .unwrap()
        .iter()
        .map(numbers)
        .collect();
    assert_eq!(tips.len(), 5);
    let energy = cells(&place.path("out/small/energy.csv"));
    for axis in 0..3 {
        let mean = tips.iter().map(|tip| tip[axis]).sum::<f64>() / 5.0;
        assert!((mean - energy[100][8 + axis]).abs() < 1e-15);
    }
}

#[test]
fn rigid_rods_are_moved_semi_implicitly() {
    let place = Workplace::new();
    let mut asked = vec!["leaf.toml", "--tolerance", "1e-4"];
    for set in [
        "stiffness.axial=inf",
        "dynamics.start=at-rest",
        "dynamics.duration=0.1",
    ] {
        asked.extend(["--set", set]);
    }
    let summary = simulate(&place, &asked);
    assert_eq!(summary["method"], "semi-implicit");
    assert_eq!(summary["tolerance"], 1e-4);
    assert_eq!(summary["time_step"], Value::Null);
    assert_eq!(summary["stable_step"], Value::Null);
}

#[test]
fn tolerance_and_step_rule_the_semi_implicit_method() {
    let place = Workplace::new();
    let steps = |how: [&str; 2]| {
        let asked = ["leaf.toml", "--set", "dynamics.duration=1"];
        let method = ["--method", "semi-implicit"];
        simulate(&place, &[&asked[..], &method, &how].concat())["steps"]
            .as_u64()
            .unwrap()
    };
    let (rough, fine) = (
        steps(["--tolerance", "1e-3"]),
        steps(["--tolerance", "1e-5"]),
    );
    assert!(fine > 2 * rough, "{rough} {fine}");
    assert_eq!(steps(["--step", "0.005"]), 200);
}

/// A vein that falls so far that its grid cannot follow.
#[test]
fn an_early_end_is_told_and_its_way_is_written() {
    let place = Workplace::new();
    let mut asked = vec!["simulate", "leaf.toml", "--segments", "3"];
    for set in [
        "leaf.rods=1",
        "leaf.fan=[0]",
        "coupling.y=0",
        "coupling.z=0",
        "load.gravity=[0,0,-300]",
        "stiffness.axial=1e5",
        "stiffness.shear_2=1e5",
        "stiffness.shear_3=1e5",
        "dynamics.duration=1",
    ] {
        asked.extend(["--set", set]);
    }
    for method in ["explicit", "semi-implicit"] {
        let output = place.run(&[&asked[..], &["--json", "--method", method]].concat());
        assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
        assert_eq!(place.names("out/small"), FILES);
        let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(summary["outcome"], "unresolved");
        let remark = summary["remark"].as_str().unwrap();
        assert!(remark.contains("use more segments than 3"), "{remark}");
        assert_eq!(text(&output.stderr), format!("small: {remark}\n"));
        let energy = cells(&place.path("out/small/energy.csv"));
        let time = energy.last().unwrap()[0];
        assert!(time > 0.0 && time < 1.0, "{time}");
        assert_eq!(summary["time"], time);
        assert_eq!(summary["frames"], energy.len());
        let motion = cells(&place.path("out/small/motion.csv"));
        assert_eq!(motion.len(), 4 * energy.len());

        // Of an array, the header tells how many outputs there are.
        let fine = ["--set", "dynamics.output_interval=1e-5", "--method", method];
        let output = place.run(&[&asked[..], &fine].concat());
        assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
        let (shape, numbers) = npy(&place.path("out/small/motion.npy"));
        let outputs = cells(&place.path("out/small/energy.csv")).len();
        assert_eq!(shape, [outputs, 1, 4, 13]);
        assert_eq!(numbers.len(), outputs * 4 * 13);
    }
}

/// Shape and numbers of a NumPy array, format 1.0.
fn npy(file: &Path) -> (Vec<usize>, Vec<f64>) {
    let bytes = fs::read(file).unwrap();
    assert_eq!(bytes[..8], *b"\x93NUMPY\x01\x00");
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert_eq!((10 + length) % 64, 0);
    let header = text(&bytes[10..10 + length]);
    assert!(header.starts_with("{'descr': '<f8', 'fortran_order': False, 'shape': ("));
    assert!(header.ends_with('\n'));
    let shape = header.split(['(', ')']).nth(1).unwrap();
    let shape = shape.split(", ").map(|size| size.parse().unwrap());
    let numbers = bytes[10 + length..].chunks_exact(8);
    let number = |bytes: &[u8]| f64::from_le_bytes(bytes.try_into().unwrap());
    (shape.collect(), numbers.map(number).collect())
}

/// What is too long for a table is an array of the same numbers.
#[test]
fn long_motions_are_arrays() {
    let place = Workplace::new();
    let every = |interval: &str| {
        let interval = format!("dynamics.output_interval={interval}");
        let asked = ["leaf.toml", "--set", "dynamics.duration=12", "--set"];
        // Steps that outputs do not cut short.
        let step = ["--step", "0.0025"];
        simulate(&place, &[&asked[..], &[&interval], &step].concat())
    };
    every("0.5");
    let rows = cells(&place.path("out/small/motion.csv"));
    let summary = every("0.005");
    assert_eq!(summary["frames"], 2401);
    let mut names = FILES;
    names[5] = "motion.npy";
    assert_eq!(
        place.names("out/small"),
        names,
        "no table of an earlier run"
    );
    let (shape, numbers) = npy(&place.path("out/small/motion.npy"));
    assert_eq!(shape, [2401, 5, 17, 13]);
    assert_eq!(numbers.len(), shape.iter().product::<usize>());
    let energy = cells(&place.path("out/small/energy.csv"));
    assert_eq!(energy.len(), 2401);
    for (moment, output) in energy.iter().zip(numbers.chunks(5 * 17 * 13)) {
        assert_eq!(moment[8..11], output[84 * 13..84 * 13 + 3], "the tip");
    }
    let outputs = numbers.chunks(5 * 17 * 13).step_by(100);
    for (row, number) in rows
        .iter()
        .zip(outputs.flat_map(|output| output.chunks(13)))
    {
        // Velocities are those of fast waves, too, which the length of the
        // last step before an output matters to.
        for (a, b) in row[3..10].iter().zip(number) {
            assert!((a - b).abs() < 1e-2, "{a} {b}");
        }
    }
}

#[test]
fn bad_requests_are_refused_before_anything_is_written() {
    let refused: [(&[&str], &str); 14] = [
        (&["leaf.toml", "--step", "0"], "step 0: must be greater"),
        (&["leaf.toml", "--step", "-1"], "step -1"),
        (&["leaf.toml", "--step", "nan"], "step NaN"),
        (
            &["leaf.toml", "--step", "0.1"],
            "stable up to 5.964e-3, because of shear with rotation: use a shorter step",
        ),
        (
            &[
                "leaf.toml",
                "--method",
                "explicit",
                "--set",
                "stiffness.shear_2=inf",
            ],
            "no stable time step for rigid rods",
        ),
        (&["leaf.toml", "--method", "shooting"], "semi-implicit"),
        (&["leaf.toml", "--segments", "0"], "--segments 0"),
        (&["leaf.toml", "--tolerance", "1"], "tolerance"),
        (&["leaf.toml", "--keep-unstable"], "--keep-unstable"),
        (&["leaf.toml", "--out", "leaf.toml/out"], "--out DIR"),
        (
            &["leaf.toml", "--resume"],
            "cannot resume: there is no out/small/checkpoint.json; leave out --resume",
        ),
        (&["leaf.toml", "--set", "dynamics.start=1"], "start"),
        (&["absent.toml"], "absent.toml"),
        (&[], "SCENARIO"),
    ];
    for (arguments, message) in refused {
        let place = Workplace::new();
        let output = place.run(&[&["simulate"], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert_eq!(text(&output.stdout), "", "{arguments:?}");
        let said = text(&output.stderr);
        assert!(said.contains(message), "{message} in {said}");
        assert_eq!(place.names("."), ["leaf.toml"], "{arguments:?}");
    }
}
