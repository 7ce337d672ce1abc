//! How fast the explicit method steps, and how the explicit relaxation compares
//! with the semi-implicit one. `cargo bench --bench explicit`.

use leafdyn::internals::leaf::{DiscreteLeaf, Grid, Leaf};
use leafdyn::internals::motion::{Explicit, Physics, TimeIntegrator};
use leafdyn::internals::relax::initial_state;
use leafdyn::relax::{self, Options, relax};
use leafdyn::scenario::Scenario;
use leafdyn_testing::bench::{figure, median, print_head};
use std::time::Instant;

/// Veins and segments a vein.
const LEAVES: [(usize, usize); 9] = [
    (1, 50),
    (1, 100),
    (1, 1000),
    (5, 50),
    (35, 50),
    (35, 100),
    (35, 200),
    (35, 400),
    (35, 2000),
];

/// Segments times steps of one measurement, some tens of milliseconds, and least
/// steps: a motion ends with a look at its energy, and has one every so many.
const WORK: usize = 1_000_000;
const STEPS: usize = 1000;

const REPEATS: usize = 15;

/// Nanoseconds per segment and step; threads take turns, so that a busy machine
/// treats them alike.
fn rates(rods: usize, segments: usize, pools: &[rayon::ThreadPool]) -> Vec<f64> {
    let scenario = figure("fig04", rods);
    let leaf = Leaf::new(&scenario);
    let discrete = DiscreteLeaf::new(&leaf, Grid::new(segments, &[]));
    let physics = Physics::new(&leaf);
    let state = initial_state(&discrete);
    let steps = (WORK / (rods * segments)).max(STEPS);
    let mut found = vec![Vec::new(); pools.len()];
    for _ in 0..REPEATS {
        for (pool, found) in pools.iter().zip(&mut found) {
            let seconds = pool.install(|| {
                let motion = Explicit::new(discrete.clone(), physics.clone(), &state, None);
                let mut motion = motion.expect("no rod is rigid");
                let until = motion.longest_step() * steps as f64;
                let clock = Instant::now();
                motion.advance(until).expect("the motion is stable");
                clock.elapsed().as_secs_f64()
            });
            found.push(1e9 * seconds / (rods * segments * steps) as f64);
        }
    }
    found.iter_mut().map(|found| median(found)).collect()
}

fn milliseconds(scenario: &Scenario, method: relax::Method) -> (f64, usize) {
    let options = Options {
        method,
        ..Options::default()
    };
    let mut steps = 0;
    let mut runs = [0.0; 5].map(|_| {
        let leaf = relax(scenario, &options, &mut |_| {}).expect("the request is sound");
        assert!(leaf.outcome.is_success());
        steps = leaf.work.steps;
        1e3 * leaf.wall_seconds
    });
    (median(&mut runs), steps)
}

fn main() {
    let threads = rayon::current_num_threads();
    let pools = [1, threads].map(leafdyn_testing::bench::threads);
    println!("Fig. 4's leaf, explicit: nanoseconds per segment and step, looks at the energy");
    println!("included, median of {REPEATS}.");
    println!();
    print_head(&format!(
        "N | segments a vein | 1 thread | {threads} threads"
    ));
    for (rods, segments) in LEAVES {
        let found = rates(rods, segments, &pools);
        let [one, all] = [found[0], found[1]];
        println!("| {rods} | {segments} | {one:.1} | {all:.1} |");
    }
    println!();
    println!("Relaxation to 1e-6 with error estimate and index, N = 5: milliseconds, median of 5.");
    println!();
    print_head("figure | semi-implicit | steps | explicit | steps");
    for name in [4, 5, 6, 8, 9, 10, 13].map(|number| format!("fig{number:02}")) {
        let scenario = figure(&name, 5);
        let (semi_implicit, few) = milliseconds(&scenario, relax::Method::default());
        let (explicit, many) = milliseconds(&scenario, relax::Method::Explicit { segments: None });
        println!("| {name} | {semi_implicit:.1} | {few} | {explicit:.0} | {many} |");
    }
}
