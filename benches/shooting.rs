//! How long the boundary-value solution takes from the relaxed leaf, and how
//! that grows with the number of veins: Fig. 4's leaf to 1e-10.
//! `cargo bench --bench shooting`.

use leafdyn::internals::shooting::{self, ShootingSolution, ShootingStart};
use leafdyn::relax::{Equilibrium, relax};
use leafdyn::scenario::Scenario;
use leafdyn::shape::Difference;
use leafdyn_testing::bench::{figure, print_head, to};
use std::time::Instant;

const RODS: [usize; 7] = [1, 5, 10, 21, 35, 70, 140];

const ACCURACY: f64 = 1e-10;

/// Each is solved as often as takes about as long as one of this many rods.
const RODS_IN_ALL: usize = 140;

/// The fastest of several runs on so many threads, in milliseconds.
fn fastest(leaf: &Scenario, relaxed: &Equilibrium, threads: usize) -> (f64, ShootingSolution) {
    let pool = leafdyn_testing::bench::threads(threads);
    let (stations, rods) = (&relaxed.shape.stations[..], &relaxed.shape.rods[..]);
    let start = ShootingStart::Leaf { stations, rods };
    let options = shooting::ShootingOptions::new(
        start,
        stations,
        shooting::RequiredPrecision::EstimatedError(ACCURACY),
    );
    (0..2 + RODS_IN_ALL / leaf.rods.len())
        .map(|_| {
            let clock = Instant::now();
            let solution = pool.install(|| shooting::solve(leaf, &options, &mut |_| {}));
            let milliseconds = 1e3 * clock.elapsed().as_secs_f64();
            (milliseconds, solution.expect("the leaf has a solution"))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .expect("at least one run")
}

fn main() {
    let threads = rayon::current_num_threads();
    println!(
        "Fig. 4's leaf to 1e-10, from the leaf relaxed to the same; milliseconds, best of several;"
    );
    println!("differences in units of L and A/L^2.");
    println!();
    print_head(&format!(
        "N | unknowns | relaxed | shot, 1 thread | {threads} threads | linearisations | integration steps | position | force"
    ));
    for rods in RODS {
        let leaf = figure("fig04", rods);
        let relaxed = relax(&leaf, &to(ACCURACY), &mut |_| {}).expect("a valid request");
        let (one, solution) = fastest(&leaf, &relaxed, 1);
        let (all, _) = fastest(&leaf, &relaxed, threads);
        let difference = Difference::between(&relaxed.shape.rods, &solution.rods);
        println!(
            "| {rods} | {} | {:.1} | {one:.1} | {all:.1} | {} | {} | {:.0e} | {:.0e} |",
            6 * rods,
            1e3 * relaxed.wall_seconds,
            solution.work.linearizations,
            solution.work.steps,
            difference.position,
            difference.force
        );
    }
}
