//! How time and memory grow with the number of veins: Fig. 4's leaf to 1e-6.
//! `cargo bench --bench growth`; with `RAYON_NUM_THREADS=1` in front for one
//! thread, which shows the cost per unknown without the help of others.

use leafdyn::relax::{Options, relax};
use leafdyn::scenario::Scenario;
use std::path::Path;

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

fn main() {
    let threads = rayon::current_num_threads();
    println!("Fig. 4's leaf to 1e-6 with {threads} thread(s); unknowns: 6 a node of the finest");
    println!("grid; ratio: time per unknown to that of the smallest leaf.");
    println!();
    println!(" rods  segments  steps  gradients  unknowns   seconds  us/unknown  ratio  peak MB");
    let mut smallest = None;
    for rods in RODS {
        let entry = [format!("leaf.rods={rods}")];
        let leaf = Scenario::read(Path::new("scenarios/paper/fig04.toml"), &entry)
            .expect("the scenario is valid");
        let options = Options {
            tolerance: Some(1e-6),
            ..Options::default()
        };
        let runs = (RODS_IN_ALL / rods).clamp(FEWEST_RUNS, MOST_RUNS);
        let best = (0..runs)
            .map(|_| relax(&leaf, &options, &mut |_| {}).expect("a valid request"))
            .min_by(|a, b| a.wall_seconds.total_cmp(&b.wall_seconds))
            .expect("at least one run");
        assert!(best.outcome.is_success(), "{:?}", best.outcome);
        let segments = best.segments.last().copied().unwrap_or_default();
        let unknowns = 6 * rods * segments;
        let each = 1e6 * best.wall_seconds / unknowns as f64;
        let ratio = each / *smallest.get_or_insert(each);
        let memory = peak_memory().map_or("-".into(), |mb| format!("{mb:.0}"));
        println!(
            "{rods:5}  {segments:8}  {:5}  {:9}  {unknowns:8}  {:8.4}  {each:10.3}  {ratio:5.2}  {memory:>7}",
            best.work.steps, best.work.cg_iterations, best.wall_seconds
        );
    }
}
