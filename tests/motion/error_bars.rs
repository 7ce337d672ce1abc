//! The bar on the tips of a motion covers their error, that of the grid and that of the steps, at
//! every output where it is told, and is not much larger, mostly; a motion is refined until its bar
//! is as small as requested.

use leafdyn::scenario::{MotionStart, Wind};
use leafdyn::simulate::{DEFAULT_TIP_ERROR, Frame, Options, Refinement, Simulation, Stopped};
use leafdyn_testing::motion::{SLENDER, Scheme, beam, gripped_veins, moving, ramp};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

/// The outputs of the last run of a motion, that run, and how it was to be.
struct Followed {
    frames: Vec<Frame>,
    simulation: Simulation,
    runs: usize,
}

/// All outputs of a run, as far as it goes.
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
        let (time, advice) = (simulation.time(), "");
        let stopped = (!simulation.done()).then_some(Stopped::StepTooShort { time, advice });
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

/// The same motion on a grid eight times as fine, in steps at most a quarter as long.
fn truth(scenario: &Scenario, found: &Simulation) -> Vec<Frame> {
    let options = |step: Option<f64>| Options {
        scheme: Some(found.scheme()),
        segments: Some(8 * found.segments()),
        step,
        tolerance: Some((found.tolerance() / 64.0).max(1e-12)),
        ..Options::default()
    };
    let quarter = found.longest_step().map(|step| step / 4.0);
    let fine = Simulation::new(scenario, &options(quarter));
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
        3 => paper_leaf(
            3,
            [random.log(0.3, 3.0); 3],
            [random.log(30.0, 1e3); 3],
            0.0,
        ),
        _ => paper_leaf(
            1,
            [random.log(0.3, 3.0), 1.0, 1.0],
            [random.log(30.0, 1e3); 3],
            0.0,
        ),
    };
    let unit = leaf.dynamics.natural_time(&leaf.rods);
    if kind > 1 {
        let radius: f64 = random.uniform(0.02, 0.15);
        let inertia = [0.25 * radius * radius; 2].map(Profile::Constant);
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
    dynamics.internal_damping =
        [0.0, random.log(1e-3, 1e-2) * unit][usize::from(random.chance(0.3))];
    match kind {
        4 => {
            let blow = [0; 3].map(|_| random.uniform(-3.0, 3.0));
            dynamics.tip_force =
                Schedule::linear(vec![0.0, 0.1, 0.25], vec![[0.0; 3], blow, [0.0; 3]]);
            dynamics.start = MotionStart::AtRest;
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
            dynamics.rest = Schedule::linear(vec![0.0, 1.0], vec![0.2, random.uniform(0.5, 1.5)]);
            dynamics.start = MotionStart::AtRest;
        }
        _ => {}
    }
    dynamics.duration = random.log(0.3, 2.0) * unit;
    dynamics.output_interval =
        dynamics.duration / [3.0, 25.0, 60.0][(3.0 * random.even()) as usize % 3];
    if random.chance(0.7) {
        dynamics.output_interval = dynamics.duration / 40.0;
    }
    let scheme = [Scheme::Explicit, Scheme::SemiImplicit][usize::from(random.chance(0.5))];
    let segments = [8, 8, 12][(3.0 * random.even()) as usize % 3];
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

/// A slender beam, clamped and struck so softly that it stays linear: the sum of its modes. After a
/// uniform load is switched on at time 0, mode n of frequency w and shape phi moves as (1 - cos wt)/w^2.
#[test]
fn the_bar_covers_the_error_against_the_sum_of_modes() {
    let weight = 1e-2;
    let mut rod = beam(1e-8, [1e8, 1e8]);
    rod.dynamics.gravity = Schedule::constant([0.0, 0.0, -weight]);
    rod.gravity = [0.0, 0.0, -weight];
    rod.dynamics.duration = 2.0;
    rod.dynamics.output_interval = 0.05;
    let found = followed(&rod, &moving(Scheme::SemiImplicit, None));
    let exact = |t: f64| -> f64 {
        // Roots of cos b cosh b = -1; phi normalised by mass is 2 at the tip, up to its sign, and
        // its integral is 2 sigma/b with the same sign alternating.
        let root = |n: usize| match SLENDER.get(n) {
            Some(root) => *root,
            None => (n as f64 + 0.5) * std::f64::consts::PI,
        };
        let of = |n: usize| {
            let b = root(n);
            let sigma = (b.sinh() - b.sin()) / (b.cosh() + b.cos());
            let sign = if n.is_multiple_of(2) { 1.0 } else { -1.0 };
            let omega = b * b;
            sign * 4.0 * sigma / b * (1.0 - (omega * t).cos()) / (omega * omega)
        };
        -weight * (0..12).map(of).sum::<f64>()
    };
    let bar = found.simulation.error_bar().unwrap();
    assert!(
        bar <= DEFAULT_TIP_ERROR && found.runs <= 5,
        "{bar:e}, {}",
        found.runs
    );
    let (mut most, mut swing) = (0.0_f64, 0.0_f64);
    for frame in &found.frames {
        let z = frame.tips(true)[0].z;
        most = most.max((z - exact(frame.time)).abs());
        swing = swing.max(z.abs());
        assert!(most <= frame.error.unwrap(), "{most:e} at {}", frame.time);
    }
    assert!(
        swing > 2e-3 && 30.0 * most > bar,
        "{swing:e}, {most:e}, {bar:e}"
    );
}

/// A glass fibre in mm and N that bends far: at the default grid its phase is lost within the
/// second, and the bar says so or the grid is refined.
#[test]
fn a_glass_fibre_tells_its_error() {
    let fibre = parse(
        r#"
        units = { length = "mm", force = "N", time = "s" }
        leaf = { rods = 1, length = 200.0, fan = [0.0] }
        section = { shape = "circle", diameter = 0.5, young = 7e4, mass_density = 2.5e-9 }
        load = { g = [0.0, 0.0, -9810.0] }
        dynamics = { external_damping = 0.0, duration = 0.2, output_interval = 0.005 }
        "#,
    );
    let (bar, error) = judged(&fibre, &moving(Scheme::SemiImplicit, None))
        .unwrap()
        .unwrap();
    assert!(bar < 1.0 && 30.0 * error > bar, "{bar:e}, {error:e}");
}

#[test]
fn bars_of_random_motions_cover_the_errors() {
    let count = asked("LEAFDYN_MOTIONS", 6) as u64;
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
    assert!(
        2 * (unknown + refused) <= count as usize,
        "{unknown}, {refused}"
    );
}

/// A leaf from whose start no step is short enough, with tissue that is nearly rigid, is not tried on finer grids.
#[test]
fn a_motion_without_a_step_is_not_refined() {
    let saddle = scenario("study/saddle", "");
    let found = followed(&saddle, &moving(Scheme::SemiImplicit, None));
    assert_eq!((found.runs, found.frames.len()), (2, 1));
    assert!(!found.simulation.done());
}

/// A leaf that stays at rest takes a step from output to output on every grid, and its bar is that of the grid: three times
/// the distance from the leaf that is relaxed.
#[test]
fn a_leaf_at_rest_takes_one_step_an_output() {
    let mut leaf = paper_leaf(3, [1.0; 3], [100.0; 3], 4.0);
    leaf.dynamics.start = MotionStart::AtRest;
    leaf.dynamics.duration = 3.0;
    let options = Options {
        scheme: Some(Scheme::SemiImplicit),
        tolerance: Some(1e-4),
        ..Options::default()
    };
    let found = followed(&leaf, &options);
    assert!(found.runs > 1, "{}", found.simulation.segments());
    let outputs = found.frames.len() - 1;
    // The first steps find out how long they may be.
    let steps = found.simulation.steps();
    assert!(steps <= outputs + 15, "{steps} for {outputs} outputs");
    let rest = leaf.relaxation().tolerance(1e-10).run().unwrap();
    let middle = rest.shape.stations.iter().position(|at| *at == 0.5);
    let middle = middle.unwrap();
    let bar = found.simulation.error_bar().unwrap();
    for frame in &found.frames {
        let middles = (0..frame.rods).map(|rod| {
            let nodes = frame.centerline(rod);
            nodes[nodes.len() / 2].distance(rest.shape.rods[rod].nodes[middle].position)
        });
        let error = largest(middles).max(frame.tips(true)[0].distance(rest.tips[0]));
        assert!(error < bar && bar < 4.0 * error, "{error:e}, {bar:e}");
    }
}

/// Where the grid makes the error, as of a plate that falls, steps on the finer grid are not half as long: the bar is hardly
/// larger than with such steps.
#[test]
fn steps_are_as_long_as_the_grid_allows() {
    let leaf = scenario("study/plate", "dynamics.duration=0.2");
    let found = followed(&leaf, &Options::default());
    // An eighth of the local error, of third order, on every grid after the first, before which there is one to compare with.
    let halved = 1e-5 / f64::powi(8.0, found.runs as i32 - 2);
    let own = found.simulation.tolerance();
    assert!(
        found.runs > 2 && own > 2.0 * halved,
        "{own:e} {halved:e} {}",
        found.runs
    );
    let shorter = Options {
        segments: Some(found.simulation.segments()),
        tolerance: Some(halved),
        ..Options::default()
    };
    let shorter = followed(&leaf, &shorter);
    let [steps, others] = [&found, &shorter].map(|it| it.simulation.steps());
    assert!(6 * steps < 5 * others, "{steps} for {others}");
    let bars = [&found, &shorter].map(|it| it.simulation.error_bar().unwrap());
    assert!(bars[0] < 1.05 * bars[1], "{bars:?}");
}
