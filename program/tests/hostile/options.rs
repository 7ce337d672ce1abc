//! Every verb with options drawn at random, on leaves drawn at random: it ends with one of its exit
//! statuses, in one message or a result of numbers, and never in a panic. `LEAFDYN_MUTATIONS` asks
//! for so many times as many.

use std::process::Stdio;
use std::thread::sleep;
use std::time::{Duration, Instant};

use leafdyn_testing::workplace::{Run, Workplace, pairs};
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::{Config, RngSeed, TestRunner};
use serde_json::Value;

/// Entries of the leaf, of which some are drawn, each with one of its values.
const ENTRIES: &str = "
    leaf.rods => 1 2 3
    leaf.joined => false
    leaf.fan => symmetric
    stiffness.bending_2 => 0.01 1.0 3.0 {at=[0,0.4,1],value=[1,0.5,0.1]}
    stiffness.bending_3 => 0.2 1.0 30.0
    stiffness.torsion => 0.05 2.0
    stiffness.axial => inf 10.0 1e5
    stiffness.shear_2 => inf 1e4
    stiffness.shear_3 => inf
    rest.bend_2 => 2.0 -6.0 {at=[0,1],value=[0,3]}
    rest.twist => 1.5
    rest.stretch => 1.2
    coupling.x => 5.0
    coupling.z => 0.0 100.0
    load.gravity => [0,0,0] [0,0,-5] [-3,0,0] [0.2,0.1,-30]
    load.tip_force => [0,0,1] [-4,0,0] [-2,0.01,0]
    dynamics.internal_damping => 0.01
    dynamics.start => at-rest
";

/// Options of each verb, of which some are drawn, each with one of its values.
const OPTIONS: &str = "
    relax => --method=semi-implicit --method=explicit --method=single-shooting --method=shooting \
        --method=shooting-from-rest | --segments=3 --segments=8 --segments=33 | --intervals=1 \
        --intervals=5 | --path=loading --path=release | --keep-unstable | --modes=0 --modes=1 \
        --modes=7 --modes=60 --modes=100 | --full-model | --stations=1 --stations=40 | --all | --margin \
        | --sensitivity=stiffness.bending_2 --sensitivity=load.gravity[2],rest.bend_2
    trace => --vary=load.tip_force[0]=0..-4 --vary=load.gravity[2]=-1..3 \
        --vary=stiffness.bending_2=1..0.1log --vary=rest.bend_2=0..8 | --switch | --keep-unstable \
        | --segments=8 --segments=5 | --points=1 --points=12 | --show=x,energy --show=reaction_x \
        | --vary=stiffness.torsion=1..2
    simulate => --set=dynamics.duration=0.02 | --method=explicit --method=semi-implicit | --segments=1 \
        --segments=8 --segments=20 | --step=1e-4 --step=0.01 | --resume | --stations=3
    map => --vary=load.gravity[2]=-1..0:2 --vary=method.segments=4..8:2 --vary=leaf.rods=1..2:2 \
        | --methods=semi-implicit,shooting --methods=explicit,explicit-motion \
        --methods=single-shooting | --cell-seconds=0.2 | --shard=1/2 | --show=waves
    fit => --data=pull.csv --data=traced.csv | --free=stiffness.bending_2 --free=rest.bend_2=-1..3 \
        --free=stiffness.axial | --robust | --candidates=pull.csv | --free=stiffness.bending_3
    check => --intervals=1 --intervals=4 | --keep-unstable
    chart => --seconds=0.05 | --methods=semi-implicit --methods=shooting | --rods=1,2
";

/// Options of all verbs.
const COMMON: &str = "--tolerance=0.1 --tolerance=1e-2 --tolerance=1e-3 | --json | --memory=1MB \
    --memory=500MB | --write=json --write=csv,svg --write=none --write=png";

/// Options without which a verb would do nothing, or much.
const ALWAYS: [&str; 6] = [
    "--tolerance=",
    "--vary=load",
    "--set=dynamics.duration",
    "--data=",
    "--cell-seconds",
    "--seconds",
];

/// Longest run. Some leaves take longer, which is no fault here.
const LONGEST: Duration = Duration::from_secs(10);

struct Draw(TestRunner);

impl Draw {
    fn below(&mut self, count: usize) -> usize {
        (0..count).new_tree(&mut self.0).unwrap().current()
    }

    fn one<'t>(&mut self, of: &[&'t str]) -> &'t str {
        of[self.below(of.len())]
    }

    fn request(&mut self) -> String {
        let verbs: Vec<_> = pairs(OPTIONS).collect();
        // Of two requests one is of a relaxation or a trace.
        let (verb, options) = match self.below(4) {
            0 => verbs[0],
            1 => verbs[1],
            _ => verbs[self.below(verbs.len())],
        };
        let mut request = format!("{verb} leaf.toml");
        for options in options.split('|').chain(COMMON.split('|')) {
            let values: Vec<&str> = options.split_whitespace().collect();
            let always = ALWAYS.iter().any(|it| values[0].starts_with(it));
            let always = always || values[0].starts_with("--free=stiffness.bending_2");
            // Searches from many starts take long.
            let seldom = matches!(values[0], "--all" | "--margin");
            if always || self.below(if seldom { 20 } else { 4 }) == 0 {
                request += &format!(" {}", self.one(&values));
            }
        }
        for (entry, values) in pairs(ENTRIES) {
            if entry == "leaf.rods" || self.below(6) == 0 {
                let values: Vec<&str> = values.split_whitespace().collect();
                request += &format!(" --set {entry}={}", self.one(&values));
            }
        }
        if request.contains("leaf.rods=1 ") || request.ends_with("leaf.rods=1") {
            // Nothing couples a single rod.
            request += " --set coupling.x=0 --set coupling.y=0 --set coupling.z=0";
        }
        request
    }
}

/// A run that is stopped if it takes too long.
fn run(place: &Workplace, request: &str) -> Option<Run> {
    let mut command = place.command(request);
    let command = command.env("RAYON_NUM_THREADS", "1").stdin(Stdio::null());
    let [out, err] = ["out.txt", "err.txt"].map(|name| std::fs::File::create(place.path(name)));
    let mut child = command
        .stdout(out.unwrap())
        .stderr(err.unwrap())
        .spawn()
        .unwrap();
    let clock = Instant::now();
    let status = loop {
        match child.try_wait().unwrap() {
            Some(status) => break status.code(),
            None if clock.elapsed() > LONGEST => {
                child.kill().unwrap();
                child.wait().unwrap();
                return None;
            }
            None => sleep(Duration::from_millis(2)),
        }
    };
    Some(Run {
        status,
        out: place.read("out.txt"),
        err: place.read("err.txt"),
    })
}

/// Asserts that a request ended as documented.
fn ends_well(request: &str, run: &Run) {
    let shown = format!("{request}\n{}{}", run.out, run.err);
    assert!(!run.err.contains("panicked"), "{shown}");
    let status = run.status.unwrap_or(-1);
    let map = request.starts_with("map");
    assert!(
        matches!(status, 0 | 2) || status == 1 && !map,
        "{status}: {shown}"
    );
    if status == 2 {
        assert!(run.err.starts_with("error: "), "{shown}");
    }
    match request.contains("--json") {
        true => assert!(serde_json::from_str::<Value>(&run.out).is_ok(), "{shown}"),
        false => assert!(!run.out.contains("NaN"), "{shown}"),
    }
}

#[test]
fn every_request_ends_as_documented() {
    let asked = std::env::var("LEAFDYN_MUTATIONS").ok();
    let times: usize = asked.and_then(|it| it.parse().ok()).unwrap_or(1);
    let mut config = Config::with_cases(1);
    config.rng_seed = if times == 1 {
        RngSeed::Fixed(1)
    } else {
        RngSeed::Random
    };
    let mut draw = Draw(TestRunner::new(config));
    let mut ended = [0; 3];
    for _ in 0..150 * times {
        let place = Workplace::new();
        place.write(
            "pull.csv",
            "experiment,load.tip_force[2],tip_z,sd_tip_z\n1,0.1,-0.12,0.01\n2,0.2,-0.1,0.02\n",
        );
        place.write(
            "traced.csv",
            "rod,x,y,z,sigma,sd\n1,0.5,0.1,-0.2,0.5,0.01\n1,0.9,-0.1,0.0,1.0,0.01\n",
        );
        let request = draw.request();
        if let Some(run) = run(&place, &request) {
            ends_well(&request, &run);
            ended[run.status.unwrap_or(0) as usize % 3] += 1;
        }
    }
    // Requests that are all refused would prove little.
    assert!(ended[0] > ended[2], "{ended:?}");
}
