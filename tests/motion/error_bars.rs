//! The bar on the tips of a motion covers their error, that of the grid and that of the steps, at
//! every output where it is told, and is not much larger, mostly; a motion is refined until its bar
//! is as small as requested.

use leafdyn::scenario::{Start, Wind};
use leafdyn::simulate::{AIM, Frame, Options, REFINEMENT_SECONDS, Refinement, Simulation};
use leafdyn_testing::motion::{SLENDER, Scheme, gripped_veins, moving, ramp};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

/// The outputs of the last run of a motion, that run, and how it was to be.
struct Followed {
    frames: Vec<Frame>,
    simulation: Simulation,
    runs: usize,
}

fn outputs(simulation: &mut Simulation) -> Vec<Frame> {
    let mut frames = vec![simulation.frame()];
    while !simulation.done() {
        match simulation.next_frame() {
            Ok(frame) => frames.push(frame),
            Err(_) => break,
        }
    }
    frames
}

fn followed(scenario: &Scenario, options: &Options) -> Followed {
    let mut refinement = Refinement::new(scenario, options).unwrap();
    let (mut last, mut runs) = (None, 0);
    while let Some(mut simulation) = refinement.next_run(&mut |_| true) {
        let frames = outputs(&mut simulation);
        let stopped = (!simulation.done()).then_some(leafdyn::simulate::Stopped::StepTooShort {
            time: simulation.time(),
            advice: "",
        });
        refinement.end_run(&mut simulation, stopped);
        runs += 1;
        last = Some((frames, simulation));
    }
    let (frames, simulation) = last.unwrap();
    Followed {
        frames,
        simulation,
        runs,
    }
}

/// The same motion on a grid eight times as fine, in steps an eighth as long.
fn truth(scenario: &Scenario, found: &Simulation) -> Vec<Frame> {
    let options = |step: Option<f64>| Options {
        scheme: Some(found.scheme()),
        segments: Some(8 * found.segments()),
        step,
        tolerance: Some((found.tolerance() / 512.0).max(1e-12)),
    };
    let eighth = found.longest_step().map(|step| step / 8.0);
    let fine = Simulation::new(scenario, &options(eighth));
    let fine = fine.or_else(|_| Simulation::new(scenario, &options(None)));
    outputs(&mut fine.unwrap())
}

/// The largest distance of a tip of two frames.
fn apart(a: &Frame, b: &Frame, joined: bool) -> f64 {
    let pairs = a.tips(joined).into_iter().zip(b.tips(joined));
    largest(pairs.map(|(a, b)| a.distance(b)))
}

/// The bar and the true error at the last output whose error is known, all bars having covered
/// the errors before; a sentence where one has not.
fn judged(scenario: &Scenario, options: &Options) -> Result<Option<(f64, f64)>, String> {
    let found = followed(scenario, options);
    let truth = truth(scenario, &found.simulation);
    let (mut most, mut bar) = (0.0_f64, None);
    for (frame, exact) in found.frames.iter().zip(&truth) {
        let Some(told) = frame.error else {
            break;
        };
        most = most.max(apart(frame, exact, scenario.joined));
        if most > told {
            let segments = found.simulation.segments();
            return Err(format!(
                "{most:.2e} is beyond {told:.2e} at t = {} of {}, {segments} segments, {}",
                frame.time,
                scenario.dynamics.duration,
                found.simulation.scheme(),
            ));
        }
        bar = Some(told);
    }
    Ok(bar.map(|bar| (bar, most)))
}

/// A leaf that moves, of one of many kinds: let go, struck, damped, curling, gripped, held, in wind,
/// joined and apart, without units and as people measure them.
fn random_motion(seed: u64) -> (Scenario, Options) {
    let mut random = Draw(seed);
    let kind = seed % 8;
    let mut leaf = match kind {
        0 => parse(&real::leaf(seed)),
        1 => gripped_veins(),
        2 => paper_leaf(1, [1.0; 3], [random.log(30.0, 3e3); 3], 0.0),
        3 => paper_leaf(3, [random.log(0.3, 3.0); 3], [random.log(30.0, 1e3); 3], 0.0),
        _ => paper_leaf(1, [random.log(0.3, 3.0), 1.0, 1.0], [random.log(30.0, 1e3); 3], 0.0),
    };
    let unit = leaf.dynamics.natural_time(&leaf.rods);
    if kind > 1 {
        let radius: f64 = random.uniform(0.02, 0.15);
        let inertia = Profile::Constant(0.25 * radius * radius);
        leaf.dynamics.rotary_inertia = vec![inertia; leaf.rods.len()];
        leaf.gravity = [0; 3].map(|_| random.uniform(-2.0, 2.0));
        leaf.dynamics.gravity = Schedule::constant(leaf.gravity);
        leaf.joined = random.chance(0.5);
        for rod in &mut leaf.rods {
            rod.rest_curvature = [0; 3].map(|_| Profile::Constant(random.uniform(-1.5, 1.5)));
        }
    }
    let dynamics = &mut leaf.dynamics;
    dynamics.external_damping = [0.0, random.log(0.1, 3.0) / unit][usize::from(random.chance(0.5))];
    dynamics.internal_damping = [0.0, random.log(1e-3, 1e-2) * unit][usize::from(random.chance(0.3))];
    match kind {
        4 => {
            let blow = [0; 3].map(|_| random.uniform(-3.0, 3.0));
            dynamics.tip_force = Schedule {
                at: vec![0.0, 0.1, 0.25],
                value: vec![[0.0; 3], blow, [0.0; 3]],
            };
            dynamics.start = Start::AtRest;
        }
        5 => {
            leaf.wind = Some(Wind {
                velocity: ramp(0.5, [0; 3].map(|_| random.uniform(-1.0, 1.0))),
                density: random.log(0.3, 3.0),
                drag: 1.0,
                width: vec![Profile::Constant(1.0)],
            });
        }
        6 => {
            dynamics.rest = Schedule {
                at: vec![0.0, 1.0],
                value: vec![0.2, random.uniform(0.5, 1.5)],
            };
            dynamics.start = Start::AtRest;
        }
        _ => {}
    }
    dynamics.duration = random.log(0.5, 6.0) * unit;
    dynamics.output_interval = dynamics.duration / [3.0, 25.0, 60.0][(3.0 * random.even()) as usize % 3];
    if random.chance(0.7) {
        dynamics.output_interval = dynamics.duration / 40.0;
    }
    let scheme = [Scheme::Explicit, Scheme::SemiImplicit][usize::from(random.chance(0.5))];
    let segments = [8, 12, 16][(3.0 * random.even()) as usize % 3];
    let mut options = moving(scheme, Some(segments));
    let rough = random.log(1e-6, 1e-3);
    if random.chance(0.4) {
        options.tolerance = Some(rough);
    }
    if random.chance(0.2) {
        // Steps of a given length are longer than those that the grid allows, or much shorter.
        options.step = Some(random.log(3e-4, 3e-3) * unit);
    }
    (leaf, options)
}

#[test]
fn bars_of_random_motions_cover_the_errors() {
    let count = asked("LEAFDYN_MOTIONS", 16) as u64;
    let first = asked("LEAFDYN_MOTIONS_FROM", 0) as u64;
    let (mut ratios, mut wrong, mut unknown, mut refused) = (Vec::new(), Vec::new(), 0, 0);
    for seed in first..first + count {
        let (leaf, options) = random_motion(seed);
        if Refinement::new(&leaf, &options).is_err() {
            refused += 1;
            continue;
        }
        match judged(&leaf, &options) {
            Ok(Some((bar, error))) if error > 1e-12 => ratios.push(bar / error),
            Ok(_) => unknown += 1,
            Err(what) => wrong.push(format!("{seed}: {what}")),
        }
    }
    ratios.sort_by(f64::total_cmp);
    let median = ratios[ratios.len() / 2];
    let least = ratios[0];
    println!("{count}: median {median:.2}, least {least:.2}, unknown {unknown}, refused {refused}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(median < 30.0, "{median}");
    assert!(10 * (unknown + refused) < 4 * count as usize, "{unknown}, {refused}");
}
