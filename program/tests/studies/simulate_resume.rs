//! A simulation that is stopped and resumed writes the same files, to the last
//! bit, as one that is not.
#![cfg(unix)]

use std::fs;
use std::process::{Child, Command};
use std::thread;
use std::time::{Duration, Instant};

use leafdyn::scenario::Scenario;
use leafdyn::simulate::{Options, Scheme, Simulation};
use leafdyn_program::files::{Document, Recording, Selection};
use leafdyn_testing::workplace::{Run, Workplace, contains, interrupt, leaf, pairs, program};
use serde_json::json;

/// So many outputs are waited for before a run is stopped.
const OUTPUTS: usize = 20;

const LEFT: [&str; 3] = ["checkpoint.json", "energy.csv.part", "motion.csv.part"];

/// A run that takes about a second by the explicit method.
const EXPLICIT: &str = "long.toml --method explicit --json";

const LONG: &str = "
[dynamics]
duration = 90
output_interval = 0.5
internal_damping = 0.002
";

/// And one by the semi-implicit method whose motion is an array.
const SEMI_IMPLICIT: &str =
    "fine.toml --segments 16 --method semi-implicit --tolerance 1e-5 --json";

const FINE: &str = "
[dynamics]
start = \"at-rest\"
duration = 6
output_interval = 0.0025
internal_damping = 0.01
tip_force = { at = [1, 3, 4], value = [[0, 0, 0], [0, 0.5, 1], [0, 0, 0]] }
";

/// A folder with both leaves.
fn workplace() -> Workplace {
    let place = Workplace::new();
    for (file, dynamics) in [("long.toml", LONG), ("fine.toml", FINE)] {
        place.write(file, leaf("small", 5) + dynamics);
    }
    place
}

/// Lines of the energies that are on the disk.
fn outputs(place: &Workplace, folder: &str) -> usize {
    let folder = place.path(folder);
    if !folder.is_dir() {
        return 0;
    }
    let mut names = place.names(folder.to_str().unwrap());
    names.retain(|name| name.contains("energy.csv") && name.ends_with(".part"));
    let bytes = |name| fs::read(folder.join(name)).unwrap_or_default();
    let lines = |bytes: Vec<u8>| bytes.iter().filter(|&&byte| byte == b'\n').count();
    names.iter().map(bytes).map(lines).sum()
}

/// Waits until there are so many outputs, and stops the run.
#[track_caller]
fn stop(place: &Workplace, child: Child, after: usize) -> Run {
    let start = Instant::now();
    while outputs(place, "out") <= after {
        assert!(start.elapsed() < Duration::from_secs(60), "nothing happens");
        thread::sleep(Duration::from_millis(1));
    }
    interrupt(&child);
    Run::from(child.wait_with_output().unwrap()).ends(130)
}

/// Stops a run in the folder `out`, and checks what it leaves.
#[track_caller]
fn stopped(place: &Workplace, arguments: &str) {
    let child = place.start(&format!("simulate {arguments} --out out"));
    let run = stop(place, child, OUTPUTS);
    let refused = json!({ "error": "stopped by Ctrl-C", "exit_status": 130 });
    assert_eq!(run.json(), refused);
    let err = run.err;
    assert!(err.starts_with("stopped at t = "), "{err}");
    assert!(err.ends_with("; go on with --resume\n"), "{err}");
}

/// A run that is stopped twice on the way ends like one that is not.
#[track_caller]
fn ends_the_same(arguments: &str) {
    let place = workplace();
    let whole = place.run(format!("simulate {arguments} --out whole"));
    let whole = whole.ends(0);

    stopped(&place, arguments);
    let left = place.names("out");
    assert_eq!(left.len(), LEFT.len(), "{left:?}");
    let resume = format!("simulate {arguments} --resume --out out");
    let before = outputs(&place, "out");
    stop(&place, place.start(&resume), before + OUTPUTS);
    assert_eq!(place.names("out"), left);
    let resumed = place.run(&resume).ends(0);

    same_files(&place);
    let [whole, resumed] = [whole, resumed].map(|run| without_wall_seconds(&run.out));
    assert_eq!(whole, resumed);
}

/// The folders `whole` and `out` hold the same.
#[track_caller]
fn same_files(place: &Workplace) {
    let names = place.names("whole");
    assert_eq!(place.names("out"), names);
    assert_eq!(names.len(), 7);
    for name in names {
        let [a, b] = ["whole", "out"].map(|folder| match name.as_str() {
            "motion.json" => without_wall_seconds(&place.read(&format!("{folder}/{name}"))),
            _ => fs::read(place.path(folder).join(&name)).unwrap(),
        });
        assert!(a == b, "{name} differs");
    }
}

fn without_wall_seconds(summary: &str) -> Vec<u8> {
    let mut lines: Vec<&str> = summary.lines().collect();
    lines.retain(|line| !line.contains("wall_seconds"));
    lines.join("\n").into_bytes()
}

#[test]
fn a_stopped_run_goes_on_by_either_method() {
    for run in [EXPLICIT, SEMI_IMPLICIT] {
        ends_the_same(run);
    }
}

/// Wherever a run is kept: before its first step, and after its last.
#[test]
fn a_run_goes_on_from_any_output() {
    let text = leaf("small", 3)
        + "
[rest]
bend_2 = 1.0
twist = 0.5
[dynamics]
duration = 0.6
output_interval = 0.1
internal_damping = 0.01
rest = { at = [0.1, 0.4], factor = [0.5, 1.0] }
gravity = { at = [0.0, 1.0], value = [[0, 0, -1], [0, 1, -1]] }
";
    for set in ["leaf.joined=true", "leaf.joined=false"] {
        let scenario = Scenario::from_toml_with(&text, "leaf", &[set.into()]).unwrap();
        for scheme in [Scheme::Explicit, Scheme::SemiImplicit] {
            let place = Workplace::new();
            let options = Options {
                scheme: Some(scheme),
                tolerance: Some(1e-4),
                ..Options::default()
            };
            // Runs to the end, or is kept after so many outputs.
            let run = |folder: &str, resume: bool, outputs: Option<usize>| {
                let folder = place.path(folder);
                let mut simulation = Simulation::new(&scenario, &options).unwrap();
                let recording = match resume {
                    true => Recording::resume(&folder, &mut simulation, &Selection::default()),
                    false => Recording::begin(&folder, &mut simulation, &Selection::default()),
                };
                let mut recording = recording.unwrap();
                while !simulation.done() && Some(simulation.frames().1) != outputs {
                    let frame = simulation.next_frame().unwrap();
                    recording.add(&mut simulation, &frame).unwrap();
                }
                if outputs.is_some() {
                    let time = recording.checkpointer().write().unwrap().unwrap();
                    assert_eq!(time, simulation.time());
                    return;
                }
                let record = recording.record(&simulation, None).unwrap();
                let document = Document::new(&record, &scenario, None);
                recording.finish(&document).unwrap();
                let kept = recording.checkpointer().write();
                assert!(kept.is_none(), "nothing is left to keep");
            };
            run("whole", false, None);
            for outputs in [0, 1, 4, 6] {
                run("out", false, Some(outputs));
                let out = place.path("out");
                assert!(LEFT.iter().all(|name| out.join(name).exists()));
                run("out", true, None);
                same_files(&place);
            }
        }
    }
}

/// Resuming something else is refused, and changes nothing.
#[test]
fn only_the_same_run_is_resumed() {
    let place = workplace();
    stopped(&place, EXPLICIT);
    assert_eq!(place.names("out"), LEFT);
    let read = |name: &str| fs::read(place.path("out").join(name)).unwrap();
    let kept = LEFT.map(read);

    let refused = |arguments: &str, messages: &[&str]| {
        let run = place.run(format!("simulate --resume --out out {arguments}"));
        contains(&run.ends(2).err, messages);
        assert_eq!(place.names("out"), LEFT, "{arguments:?}");
    };
    let table = "
        EXPLICIT --segments 8 => segments 16, now 8
        EXPLICIT --step 1e-3 => time step 0.00
        EXPLICIT --tolerance 1e-5 => tolerance 0.000001, now 0.00001
        EXPLICIT --set leaf.rods=6 => an override of it, has changed
        EXPLICIT --set name=other => scenario small, now other
        leaf.toml => an override of it, has changed
        long.toml --method semi-implicit => method explicit, now semi-implicit
    ";
    for (other, message) in pairs(table) {
        let messages = ["out/checkpoint.json is of another run", message, "--resume"];
        refused(&other.replace("EXPLICIT", EXPLICIT), &messages);
    }
    assert_eq!(LEFT.map(read), kept);

    // Damage to any of the three files is noticed.
    for (name, bytes) in LEFT.iter().zip(&kept) {
        let file = place.path("out").join(name);
        let mut changed = bytes.clone();
        let half = changed.len() / 2;
        changed[half] = if changed[half] == b'1' { b'2' } else { b'1' };
        for damaged in [&changed[..], &bytes[..half], &[]] {
            fs::write(&file, damaged).unwrap();
            let message = format!("out/{name} is damaged");
            refused(EXPLICIT, &["cannot resume", &message, "to begin anew"]);
            assert_eq!(fs::read(&file).unwrap(), damaged);
        }
        fs::write(&file, bytes).unwrap();
    }
    for name in &LEFT[1..] {
        let file = place.path("out").join(name);
        let aside = place.path("aside");
        fs::rename(&file, &aside).unwrap();
        let run = place.run(format!("simulate --resume --out out {EXPLICIT}"));
        contains(&run.ends(2).err, &[name]);
        fs::rename(&aside, &file).unwrap();
    }

    // A run that begins anew leaves nothing of the one that was kept.
    let short = "simulate --out out leaf.toml --set dynamics.duration=0.1";
    place.run(short).ends(0);
    let left = place.names("out");
    assert!(left.iter().all(|name| !LEFT.contains(&name.as_str())));
}

/// What was found before a file could not be written is not lost with it.
#[test]
fn a_run_goes_on_when_there_is_room_on_the_disk_again() {
    let place = Workplace::new();
    let program = program();
    let run = |limit: &str, more: &str| -> Run {
        // A file that grows beyond the limit is an error, not a signal.
        let script = format!(
            "trap '' XFSZ; {limit} exec \"$0\" simulate leaf.toml --out out \
             --set dynamics.duration=5 --json {more}"
        );
        let mut shell = Command::new("sh");
        let shell = shell.current_dir(place.path(".")).args(["-c", &script]);
        shell.arg(&program).output().unwrap().into()
    };
    // Blocks are of 512 or of 1024 bytes.
    let run_out = run("ulimit -f 600;", "").ends(2);
    let parts = ["cannot write out/motion.csv", "go on with --resume"];
    contains(&run_out.err, &parts);
    assert_eq!(place.names("out"), LEFT);

    run("", "--resume").ends(0);
    let resumed = fs::read(place.path("out/motion.csv")).unwrap();
    run("", "").ends(0);
    assert!(resumed == fs::read(place.path("out/motion.csv")).unwrap());
}
