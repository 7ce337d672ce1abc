//! What scripts rely on when they simulate a leaf: streams, files and exit statuses.

use std::fs;

use leafdyn_testing::workplace::{Json, Workplace, contains, floats, tells};
use leafdyn_testing::{root, scenario};
use serde_json::Value;

const FILES: &str =
    "energy.csv energy.png energy.svg filmstrip.png filmstrip.svg motion.csv motion.json";

const MOTION: &str = "time,rod,sigma,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz";

const ENERGY: &str =
    "time,steps,kinetic,elastic,coupling,potential,dissipated,work,tip_x,tip_y,tip_z,error";

/// Runs to the end; the summary as printed.
#[track_caller]
fn simulate(place: &Workplace, arguments: &str) -> Value {
    // What takes long, or is not as accurate as aimed at, is told to people.
    place
        .run(format!("simulate --json {arguments}"))
        .ends(0)
        .json()
}

fn energies(place: &Workplace) -> Vec<Vec<f64>> {
    place.numbers("out/small/energy.csv", ENERGY)
}

/// A leaf let go, one that curls, a vein that is struck, of which the explicit method at
/// its longest step is some thousandths off, a blade of 20 cm in a gust, a leaf that a drop hits, and a strip that snaps
/// twice: the tips end no farther apart than this.
#[test]
fn methods_agree_on_every_scenario_in_motion() {
    // Explicit steps would have to be far shorter with the internal damping of the tissue.
    let undamped = "--set dynamics.internal_damping=0 --set dynamics.duration=0.06";
    let scenarios = [
        ("swing", 1e-4, ""),
        ("curl", 1e-6, ""),
        ("strike", 5e-3, ""),
        ("gust", 1e-2, ""),
        ("drop", 1e-3, undamped),
        ("snap", 1e-4, ""),
    ];
    let folder = root().join("scenarios/motion");
    assert_eq!(fs::read_dir(folder).unwrap().count(), scenarios.len());
    for (name, tolerance, sets) in scenarios {
        let place = Workplace::new();
        let [explicit, semi_implicit] = ["explicit", "semi-implicit"].map(|method| {
            let how = format!("--segments 16 --method {method} --out {method} {sets}");
            let summary = simulate(&place, &format!("scenarios/motion/{name}.toml {how}"));
            place.holds(method, FILES);
            tells(&summary, &format!("scenario={name} method={method}"));
            assert_eq!(summary["time"], summary["duration"]);
            floats(&summary["tip"])
        });
        let pairs = explicit.iter().zip(&semi_implicit);
        let apart = pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        assert!(apart < tolerance, "{name}: {apart:.1e}");
    }
}

/// A drop that hits a leaf loses energy, which the report and the summary tell.
#[test]
fn a_drop_loses_energy() {
    let place = Workplace::new();
    let sets = "--set dynamics.duration=0.03 --set dynamics.output_interval=0.01 --segments 8";
    let run = place.run(format!(
        "simulate scenarios/motion/drop.toml {sets} --out drop"
    ));
    run.ok().says(&[
        "  start    at rest under the loads at time 0\n",
        "  landing  a mass on vein 4 at 0.500, at t = 0.02 s: its kinetic energy ",
        "\n           damped until the end ",
        "  end      still moving: the tip at ",
        " cm/s, and by ",
    ]);
    let summary = simulate(
        &place,
        &format!("scenarios/motion/drop.toml {sets} --out drop"),
    );
    let landing = &summary["landings"][0];
    let told = ["point", "vein", "at", "time"].map(|key| landing[key].as_f64().unwrap());
    let exact = [1.0, 4.0, 0.5, 0.02];
    assert!(
        told.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-15),
        "{told:?}"
    );
    let lost = landing["lost_energy"].as_f64().unwrap();
    let point = &scenario("motion/drop", "").points[0];
    let drop = point.landing.unwrap();
    let brought = landing["kinetic_energy"].number();
    let speed_squared: f64 = drop.velocity.iter().map(|v| v * v).sum();
    let exact = 0.5 * drop.mass * speed_squared;
    assert!(
        (brought - exact).abs() < 1e-14 * exact && lost < exact,
        "{brought} {exact}"
    );
    // Half of the drop's 0.0225 N cm at most.
    assert!((1e-3..0.01).contains(&lost), "{lost}");
}

#[test]
fn the_report_says_what_was_done() {
    let place = Workplace::new();
    let run = place.run("simulate leaf.toml --set dynamics.duration=1");
    run.ok().says(&[
        "small: 5 veins joined at the tip, method explicit\n",
        "  moved    to t = 1 in ",
        " 101 outputs\n",
        " segments a vein\n",
        "  start    released without load: veins as arcs that meet in the tip\n",
        "  end      still moving: the tip at ",
        "  step     at most ",
        ", stable up to ",
        " (shear with rotation)\n",
        "  energy   kinetic ",
        "  balance  ",
        "  tip      (",
        "  error    tips within ",
        " segments a vein tells\n",
        " ns a step and segment\n",
        "  written  out/small: motion.json, energy.svg, energy.png, filmstrip.svg, \
         filmstrip.png, motion.csv, energy.csv\n",
    ]);
    place.holds("out/small", FILES);
    for picture in ["energy", "filmstrip"] {
        place.picture(&format!("out/small/{picture}"));
    }
}

#[test]
fn tables_and_summary_tell_the_same() {
    let place = Workplace::new();
    let summary = simulate(&place, "leaf.toml --set dynamics.duration=0.5 --segments 8");
    assert_eq!(place.json("out/small/motion.json"), summary);

    let motion = place.numbers("out/small/motion.csv", MOTION);
    assert_eq!(motion.len(), 101 * 5 * 9);
    let energy = energies(&place);
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
    let done = "outcome=completed segments=8 frames=101 time=0.5 duration=0.5 tolerance=1e-6";
    tells(&summary, done);
    assert_eq!(summary.get("remark"), None);
    assert_eq!(summary["steps"].number(), last[1]);
    // The parser of this test rounds the last digit.
    let same = |a: f64, b: f64| (a - b).abs() <= 1e-15 * b.abs();
    assert!(same(summary["error_estimate"].number(), last[11]));
    assert_eq!(summary["error_known_until"], summary["time"]);
    assert_eq!(summary["error_aim"], Value::Null);
    let bars = energy.windows(2);
    assert!(bars.into_iter().all(|pair| pair[0][11] <= pair[1][11]));
    let tip = floats(&summary["tip"]).into_iter().zip(&last[8..11]);
    assert!(tip.into_iter().all(|(a, b)| same(a, *b)));
    for (column, key) in ENERGY.split(',').enumerate().take(8).skip(2) {
        assert!(same(summary["energy"][key].number(), last[column]), "{key}");
    }
    for key in ["balance_start", "balance_end"] {
        assert!(summary["energy"][key].is_number(), "{key}");
    }
    let stable = summary["stable_step"]["step"].number();
    assert!(summary["time_step"].number() < (0.9 + 1e-12) * stable);
    assert!(summary["stable_step"]["limit"].is_string());
    assert!(summary["wall_seconds"].number() > 0.0);
}

#[test]
fn of_free_tips_all_are_listed_and_their_mean_is_tabled() {
    let place = Workplace::new();
    let free = "leaf.toml --set leaf.joined=false --set dynamics.duration=0.2";
    let summary = simulate(&place, free);
    assert_eq!(summary["tip"], Value::Null);
    let tips: Vec<_> = summary["tips"].list().iter().map(floats).collect();
    assert_eq!(tips.len(), 5);
    let energy = energies(&place);
    for axis in 0..3 {
        let mean = tips.iter().map(|tip| tip[axis]).sum::<f64>() / 5.0;
        assert!((mean - energy[100][8 + axis]).abs() < 1e-15);
    }
}

#[test]
fn rigid_rods_are_moved_semi_implicitly() {
    let rigid = "leaf.toml --segments 16 --tolerance 1e-4 --set stiffness.axial=inf \
                 --set dynamics.start=at-rest --set dynamics.duration=0.1";
    let summary = simulate(&Workplace::new(), rigid);
    let steps = "method=semi-implicit tolerance=1e-4 time_step=null stable_step=null";
    tells(&summary, steps);
}

#[test]
fn tolerance_and_step_rule_the_semi_implicit_method() {
    let place = Workplace::new();
    let steps = |how: &str| {
        let asked = "leaf.toml --segments 16 --set dynamics.duration=1 --method semi-implicit";
        simulate(&place, &format!("{asked} {how}"))["steps"].count()
    };
    let [rough, fine] = ["--tolerance 1e-3", "--tolerance 1e-5"].map(steps);
    assert!(fine > 2 * rough, "{rough} {fine}");
    assert_eq!(steps("--step 0.005"), 200);
}

/// Grid and steps are refined until the bar is as small as requested, unless a grid is given.
#[test]
fn a_motion_is_refined_to_its_tolerance() {
    let place = Workplace::new();
    let at = |how: &str| {
        simulate(
            &place,
            &format!("leaf.toml --set dynamics.duration=0.3 {how}"),
        )
    };
    let segments = |summary: &Value| summary["segments"].count();
    let bar = |summary: &Value| summary["error_estimate"].number();
    let [rough, fine] = ["", "--tolerance 1e-4"].map(at);
    assert!(bar(&rough) <= 1e-3 && bar(&fine) <= 1e-4);
    assert_eq!(rough["error_aim"].number(), 1e-3);
    assert_eq!(fine["error_aim"].number(), 1e-4);
    assert!(segments(&fine) > segments(&rough));
    let given = at("--segments 8 --tolerance 1e-6");
    assert_eq!(segments(&given), 8);
    assert!(bar(&given) > 1e-6);
    let doubts = given["doubts"].list();
    contains(
        doubts[0].text(),
        &["the error of the tips may be ", "was aimed at"],
    );
}

/// A vein that falls so far that its grid cannot follow.
#[test]
fn an_early_end_is_told_and_its_way_is_written() {
    let place = Workplace::new();
    let falling = "simulate leaf.toml --segments 3 --set leaf.rods=1 --set leaf.fan=[0] \
                   --set coupling.y=0 --set coupling.z=0 --set load.gravity=[0,0,-300] \
                   --set stiffness.axial=1e5 --set stiffness.shear_2=1e5 \
                   --set stiffness.shear_3=1e5 --set dynamics.duration=1";
    for method in ["explicit", "semi-implicit"] {
        let run = place.run(format!("{falling} --json --method {method}"));
        let run = run.ends(1);
        place.holds("out/small", FILES);
        let summary = run.json();
        assert_eq!(summary["outcome"], "unresolved");
        let remark = summary["remark"].text();
        contains(remark, &["use more segments than 3"]);
        assert_eq!(run.err, format!("small: {remark}\n"));
        let energy = energies(&place);
        let time = energy.last().unwrap()[0];
        assert!(time > 0.0 && time < 1.0, "{time}");
        assert_eq!(summary["time"], time);
        assert_eq!(summary["frames"], energy.len());
        let motion = place.numbers("out/small/motion.csv", MOTION);
        assert_eq!(motion.len(), 4 * energy.len());

        // Of an array, the header tells how many outputs there are.
        let fine = "--set dynamics.output_interval=1e-5";
        let run = place.run(format!("{falling} {fine} --method {method}"));
        run.ends(1);
        let (shape, numbers) = npy(&place);
        let outputs = energies(&place).len();
        assert_eq!(shape, [outputs, 1, 4, 13]);
        assert_eq!(numbers.len(), outputs * 4 * 13);
    }
}

/// Shape and numbers of the motion as a NumPy array, format 1.0.
fn npy(place: &Workplace) -> (Vec<usize>, Vec<f64>) {
    let bytes = fs::read(place.path("out/small/motion.npy")).unwrap();
    assert_eq!(bytes[..8], *b"\x93NUMPY\x01\x00");
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert_eq!((10 + length) % 64, 0);
    let header = str::from_utf8(&bytes[10..10 + length]).unwrap();
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
        let interval = format!("--set dynamics.output_interval={interval}");
        // Steps that outputs do not cut short.
        let asked = "leaf.toml --set dynamics.duration=12 --step 0.0025";
        simulate(&place, &format!("{asked} {interval}"))
    };
    every("0.5");
    let rows = place.numbers("out/small/motion.csv", MOTION);
    let summary = every("0.005");
    assert_eq!(summary["frames"], 2401);
    // No table of an earlier run.
    let files = FILES.replace("motion.csv motion.json", "motion.json motion.npy");
    place.holds("out/small", &files);
    let (shape, numbers) = npy(&place);
    assert_eq!(shape, [2401, 5, 17, 13]);
    assert_eq!(numbers.len(), shape.iter().product::<usize>());
    let energy = energies(&place);
    assert_eq!(energy.len(), 2401);
    for (moment, output) in energy.iter().zip(numbers.chunks(5 * 17 * 13)) {
        assert_eq!(moment[8..11], output[84 * 13..84 * 13 + 3], "the tip");
    }
    let outputs = numbers.chunks(5 * 17 * 13).step_by(100);
    let nodes = outputs.flat_map(|output| output.chunks(13));
    for (row, number) in rows.iter().zip(nodes) {
        // Velocities are those of fast waves, too, which the length of the
        // last step before an output matters to.
        for (a, b) in row[3..10].iter().zip(number) {
            assert!((a - b).abs() < 1e-2, "{a} {b}");
        }
    }
}
