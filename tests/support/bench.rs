//! What the benchmarks share.

use crate::path;
use leafdyn::relax::Options;
use leafdyn::scenario::Scenario;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// A figure of the paper with so many veins.
pub fn figure(name: &str, rods: usize) -> Scenario {
    Scenario::read_with(
        &path(&format!("paper/{name}")),
        &[format!("leaf.rods={rods}")],
    )
    .expect("the scenario is valid")
}

/// Relaxing to a tolerance.
pub fn to(tolerance: f64) -> Options {
    Options {
        tolerance: Some(tolerance),
        ..Options::default()
    }
}

/// From here on everything runs on one thread.
pub fn on_one_thread() {
    let pool = ThreadPoolBuilder::new().num_threads(1);
    pool.build_global()
        .expect("no thread pool was built before");
}

pub fn threads(count: usize) -> ThreadPool {
    let pool = ThreadPoolBuilder::new().num_threads(count);
    pool.build().expect("threads can be started")
}

pub fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The head of a table in Markdown, and the line below it.
pub fn print_head(columns: &str) {
    println!("| {columns} |");
    println!("|{}", " --- |".repeat(columns.split(" | ").count()));
}
