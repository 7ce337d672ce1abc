//! A run that Ctrl-C or another signal ends writes whole files with what was found until then, or says that
//! nothing is kept, and has the exit status of the signal; one that is killed leaves files that are whole,
//! or none. `LEAFDYN_KILLS` is how often each verb is killed.
#![cfg(unix)]

use leafdyn_testing::workplace::{Json, Run, Workplace, contains, interrupt, leaf, send};
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};
use std::{fs, thread};

/// Long enough to be in the midst of what takes longer.
const MEANWHILE: Duration = Duration::from_millis(900);

#[track_caller]
fn interrupted(child: Child) -> Run {
    thread::sleep(MEANWHILE);
    interrupt(&child);
    Run::from(child.wait_with_output().unwrap()).ends(130)
}

/// A branch in so many steps that nobody waits for its end.
#[test]
fn points_of_a_branch_are_kept() {
    let place = Workplace::new();
    let many = "--vary load.gravity[2]=0..-3:10000 --points 10000";
    let run = interrupted(place.start(&format!("trace leaf.toml {many}")));
    contains(&run.out, &["goes on: stopped", "written"]);
    place.holds("out/small", "trace.csv trace.json trace.png trace.svg");
    let json = place.json("out/small/trace.json");
    assert_eq!(json["exit_status"], 130);
    assert_eq!(json["error"], "stopped by Ctrl-C");
    assert_eq!(
        (&json["complete"], &json["branches"][0]["end"]),
        (&false.into(), &"stopped".into())
    );
    let points = json["branches"][0]["points"].number();
    assert!(points > 1.0, "{points}");
}

/// Waits until a motion in this folder has made outputs.
fn wait_for_outputs(place: &Workplace, folder: &str) {
    let folder = place.path(folder);
    let lines = || -> usize {
        let files = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        let drafts = files.filter(|file| file.file_name().to_string_lossy().contains("energy.csv"));
        let texts = drafts.map(|file| std::fs::read_to_string(file.path()).unwrap_or_default());
        texts.map(|text| text.lines().count()).sum()
    };
    let start = std::time::Instant::now();
    while lines() < 20 {
        assert!(start.elapsed() < Duration::from_secs(60), "nothing happens");
        thread::sleep(Duration::from_millis(1));
    }
}

/// A motion ends with its last output, as a table and as an array.
#[test]
fn a_motion_ends_whole_with_its_last_output() {
    let place = Workplace::new();
    let table = "[dynamics]\nduration = 90\noutput_interval = 0.5\ninternal_damping = 0.002\n";
    let array = "[dynamics]\nduration = 6\noutput_interval = 0.0025\ninternal_damping = 0.01\n";
    place.write("table.toml", leaf("table", 5) + table);
    place.write("array.toml", leaf("array", 5) + array);
    for (name, file, segments, how) in [
        ("table", "motion.csv", 64, "--method explicit"),
        (
            "array",
            "motion.npy",
            16,
            "--method semi-implicit --tolerance 1e-5",
        ),
    ] {
        let how = format!("{how} --segments {segments} --write json,csv --json");
        let child = place.start(&format!("simulate {name}.toml {how}"));
        let out = format!("out/{name}");
        wait_for_outputs(&place, &out);
        interrupt(&child);
        let run = Run::from(child.wait_with_output().unwrap()).ends(130);
        let mut files = ["energy.csv", "motion.json", file];
        files.sort_unstable();
        place.holds(&out, &files.join(" "));
        let json = place.json(&format!("{out}/motion.json"));
        assert_eq!(json, run.json());
        let told = (&json["outcome"], &json["exit_status"], &json["error"]);
        let interrupted = (
            &"interrupted".into(),
            &130.into(),
            &"stopped by Ctrl-C".into(),
        );
        assert_eq!(told, interrupted);
        let outputs = json["frames"].number() as usize;
        let energies = place.read(&format!("{out}/energy.csv"));
        assert_eq!(energies.lines().count(), 1 + outputs);
        let cells: Vec<&str> = energies.lines().last().unwrap().split(',').collect();
        assert_eq!(cells.len(), 12);
        assert_eq!(cells[0].parse::<f64>().unwrap(), json["time"].number());
        let motion = std::fs::read(place.path(&format!("{out}/{file}"))).unwrap();
        let nodes = 5 * (segments + 1);
        if name == "table" {
            let lines = motion.iter().filter(|byte| **byte == b'\n').count();
            assert_eq!(lines, 1 + outputs * nodes);
            assert_eq!(motion.last(), Some(&b'\n'));
        } else {
            assert_eq!(motion.len(), 128 + outputs * nodes * 13 * 8);
            let header = String::from_utf8_lossy(&motion[..128]).into_owned();
            contains(&header, &[&format!("({outputs}, 5, {}, 13)", segments + 1)]);
        }
    }
}

/// Cells of a map that are finished.
#[test]
fn finished_cells_are_kept() {
    let place = Workplace::new();
    let many = "--vary load.gravity[2]=-1..-3:10000 --methods semi-implicit";
    let run = interrupted(place.start(&format!("map leaf.toml {many} --write json,csv")));
    contains(&run.out, &[" of 10000, reference", "written"]);
    place.holds("out/small", "map.csv map.json");
    let json = place.json("out/small/map.json");
    assert_eq!(
        (&json["exit_status"], &json["error"]),
        (&130.into(), &"stopped by Ctrl-C".into())
    );
    let counts = json["outcomes"][0]["counts"].as_object().unwrap();
    let rows: f64 = counts.values().map(Json::number).sum();
    assert!(
        rows > 0.0 && !counts.contains_key("out-of-time"),
        "{counts:?}"
    );
    let table = place.read("out/small/map.csv");
    assert_eq!(table.lines().count(), 1 + rows as usize);
}

/// Of several scenarios those that are finished have their files and their rows.
#[test]
fn finished_scenarios_are_kept() {
    let place = Workplace::new();
    place.write("large.toml", leaf("large", 3000));
    let run = place.start("relax leaf.toml large.toml --tolerance 1e-10 --write json,csv");
    let run = interrupted(run);
    contains(&run.err, &["1 of 2 scenarios are not solved"]);
    place.holds("out/small", "centerlines.csv summary.json");
    let table = place.read("out/table.csv");
    let rows: Vec<&str> = table.lines().skip(1).collect();
    assert_eq!(rows.len(), 2, "{table}");
    contains(rows[0], &["leaf.toml", "converged"]);
    contains(rows[1], &["large.toml", "stopped by Ctrl-C"]);
}

#[test]
fn that_nothing_is_kept_is_said() {
    let place = Workplace::new();
    for (verb, rods) in [("relax", 3000), ("check", 300)] {
        place.write("large.toml", leaf("large", rods));
        let run = interrupted(place.start(&format!("{verb} large.toml --tolerance 1e-10")));
        assert_eq!(
            run.err,
            "stopped by Ctrl-C: nothing of an unfinished result is kept\n"
        );
        assert_eq!(run.out, "");
        assert!(!place.path("out").exists(), "{verb}");
    }
}

/// A file that was begun is removed at every request to end, and no draft of it stays.
#[test]
fn no_signal_leaves_a_draft() {
    for (signal, status, name) in [("TERM", 143, "SIGTERM"), ("HUP", 129, "SIGHUP")] {
        let place = Workplace::new();
        let many = "--vary load.gravity[2]=0..-3:10000 --points 10000";
        let child = place.start(&format!("trace leaf.toml {many} --json"));
        thread::sleep(MEANWHILE);
        send(&child, signal);
        let run = Run::from(child.wait_with_output().unwrap()).ends(status);
        assert_eq!(run.json()["error"], format!("stopped by {name}"));
        place.holds("out/small", "trace.csv trace.json trace.png trace.svg");
        let json = place.json("out/small/trace.json");
        assert_eq!(json["exit_status"], status);
    }
}

/// What is started to outlive its terminal does.
#[cfg(target_os = "linux")]
#[test]
fn a_hangup_that_is_ignored_ends_nothing() {
    let place = Workplace::new();
    place.write("large.toml", leaf("large", 600));
    let quiet = "exec \"$0\" relax large.toml --tolerance 1e-9 --write none";
    let mut shell = std::process::Command::new("sh");
    let program = leafdyn_testing::workplace::program();
    let child = (shell
        .arg("-c")
        .arg(format!("trap '' HUP; {quiet}"))
        .arg(program))
    .current_dir(place.path("."))
    .stdout(std::process::Stdio::piped())
    .stderr(std::process::Stdio::piped())
    .spawn()
    .unwrap();
    thread::sleep(MEANWHILE / 3);
    send(&child, "HUP");
    Run::from(child.wait_with_output().unwrap()).ends(0);
}

/// Verbs that write while they run, with what makes them write much.
const RUNS: [&str; 5] = [
    "relax leaf.toml --segments 512",
    "check leaf.toml",
    "map leaf.toml --vary load.gravity[2]=-1..0:12 --methods semi-implicit,shooting",
    "trace leaf.toml --vary load.gravity[2]=-1..0",
    "simulate leaf.toml --set dynamics.output_interval=0.01",
];

/// A file that bears its name is whole; what is not yet written bears another.
fn assert_whole(file: &Path) {
    let bytes = fs::read(file).unwrap();
    let ends = |end: &[u8]| bytes.ends_with(end);
    let extension = file.extension().unwrap_or_default().to_str().unwrap();
    let whole = match extension {
        "json" => serde_json::from_slice::<serde_json::Value>(&bytes).is_ok(),
        "svg" => bytes.starts_with(b"<svg ") && ends(b"</svg>\n"),
        "png" => bytes.len() > 16 && bytes[..bytes.len() - 4].ends_with(b"IEND"),
        // Rows of a map are added as they are found: the next run leaves out the last.
        "csv" if file.ends_with("map.csv") => bytes.starts_with(b"load.gravity[2],method,"),
        "csv" => ends(b"\n"),
        _ => true,
    };
    assert!(whole, "{} of {} bytes", file.display(), bytes.len());
}

#[test]
fn killed_at_any_time_no_file_is_half_written() {
    let kills: u32 = std::env::var("LEAFDYN_KILLS").map_or(6, |kills| kills.parse().unwrap());
    for run in RUNS {
        let place = Workplace::new();
        let clock = Instant::now();
        assert!(place.start(run).wait().unwrap().success(), "{run}");
        let takes = clock.elapsed();
        for kill in 0..kills {
            let mut child = place.start(run);
            // Spread over the run, and more often at its end, where it writes.
            let part = (1.0 - (f64::from(kill) / f64::from(kills)).powi(2)) * 1.1;
            thread::sleep(Duration::from_secs_f64(takes.as_secs_f64() * part));
            let _ = child.kill();
            child.wait().unwrap();
            for name in place.names("out/small") {
                assert_whole(&place.path("out/small").join(name));
            }
        }
        // And what they left is in nobody's way.
        place.run(run).ends(0);
    }
}
