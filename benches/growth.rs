//! How time and memory grow with the number of veins: Fig. 4's leaf to 1e-6.
//! On one thread, which shows the cost per unknown, and on all there are.
//! `cargo bench --bench growth`.

use leafdyn::relax::{Equilibrium, relax};
use leafdyn::scenario::Scenario;
use leafdyn_testing::bench::{figure, print_head, to};

const RODS: [usize; 6] = [35, 100, 350, 1000, 3500, 10_000];

/// Each leaf is relaxed as often as takes about as long as one of this many
/// rods, within the bounds given; the best time counts.
const RODS_IN_ALL: usize = 3500;
const FEWEST_RUNS: usize = 2;
const MOST_RUNS: usize = 50;

/// Largest memory this process has used so far, in MB, where the system tells.
/// Leaves come in ascending order, so that it is the last one's.
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1024.0)
}

/// The fastest of several runs on so many threads.
fn fastest(leaf: &Scenario, threads: usize) -> Equilibrium {
    let pool = leafdyn_testing::bench::threads(threads);
    let runs = (RODS_IN_ALL / leaf.rods.len()).clamp(FEWEST_RUNS, MOST_RUNS);
    let best = (0..runs)
        .map(|_| pool.install(|| relax(leaf, &to(1e-6), &mut |_| {}).expect("a valid request")))
        .min_by(|a, b| a.wall_seconds.total_cmp(&b.wall_seconds))
        .expect("at least one run");
    assert!(best.outcome.is_success(), "{:?}", best.outcome);
    best
}

fn main() {
    let threads = rayon::current_num_threads();
    println!("Fig. 4's leaf to 1e-6; gradients: iterations of the conjugate gradients; ratio: of");
    println!("the time per unknown on one thread to the first row's.");
    println!();
    print_head(&format!(
        "N | steps | gradients | unknowns | 1 thread, s | µs per unknown | ratio | {threads} threads, s | peak MB"
    ));
    let mut smallest = None;
    for rods in RODS {
        let leaf = figure("fig04", rods);
        let (one, all) = (fastest(&leaf, 1), fastest(&leaf, threads));
        let unknowns = 6 * rods * one.accuracy.segments.last().expect("at least one grid");
        let each = 1e6 * one.wall_seconds / unknowns as f64;
        let ratio = each / *smallest.get_or_insert(each);
        let memory = peak_memory().map_or("-".into(), |mb| format!("{mb:.0}"));
        println!(
            "| {rods:5} | {} | {} | {unknowns:7} | {:.4} | {each:.2} | {ratio:.2} | {:.4} | {memory} |",
            one.work.steps, one.work.cg_iterations, one.wall_seconds, all.wall_seconds
        );
    }
}
