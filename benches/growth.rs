//! How time and memory grow with the number of veins: Fig. 4's leaf to 1e-6.
//! `cargo bench --bench growth`; `RAYON_NUM_THREADS=1` for one thread.

use leafdyn::relax::{Options, relax};
use leafdyn::scenario::Scenario;
use std::path::Path;

/// Largest memory this process has used, in MB, where the system tells.
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1024.0)
}

fn main() {
    println!("veins  segments    unknowns   seconds  us/unknown  ratio  peak MB");
    let mut first = None;
    for rods in [35, 100, 350, 1000, 3500, 10_000] {
        let rods_entry = [format!("leaf.rods={rods}")];
        let leaf = Scenario::read(Path::new("scenarios/paper/fig04.toml"), &rods_entry)
            .expect("the scenario is valid");
        let options = Options {
            tolerance: Some(1e-6),
            ..Options::default()
        };
        // Small leaves are timed several times, the best counts.
        let repeats = (3500 / rods).clamp(1, 20);
        let runs =
            (0..repeats).map(|_| relax(&leaf, &options, &mut |_| {}).expect("a valid request"));
        let best = runs
            .min_by(|a, b| a.wall_seconds.total_cmp(&b.wall_seconds))
            .expect("at least one run");
        assert!(best.outcome.is_success(), "{:?}", best.outcome);
        let segments = best.segments.last().copied().unwrap_or_default();
        let unknowns = 6 * rods * segments;
        let each = 1e6 * best.wall_seconds / unknowns as f64;
        let ratio = each / *first.get_or_insert(each);
        let memory = peak_memory().map_or("-".into(), |mb| format!("{mb:.0}"));
        println!(
            "{rods:5}  {segments:8}  {unknowns:10}  {:8.4}  {each:10.3}  {ratio:5.2}  {memory:>7}",
            best.wall_seconds
        );
    }
}
