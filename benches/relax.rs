//! Time to relax Fig. 4's leaf, against the number of veins and the tolerance.
//! One thread, in process, without reading and writing:
//! `cargo bench --bench relax`.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use leafdyn::relax::{Options, relax};
use leafdyn::scenario::Scenario;
use std::path::Path;
use std::time::Duration;

const RODS: [usize; 6] = [5, 10, 15, 21, 28, 35];
const TOLERANCES: [f64; 3] = [1e-4, 1e-6, 1e-8];

fn fig04(rods: usize) -> Scenario {
    let rods = [format!("leaf.rods={rods}")];
    Scenario::read(Path::new("scenarios/paper/fig04.toml"), &rods).expect("the scenario is valid")
}

fn benchmark(criterion: &mut Criterion) {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()
        .expect("no thread pool was built before");
    for tolerance in TOLERANCES {
        let mut group = criterion.benchmark_group(format!("fig04 at {tolerance:e}"));
        group
            .sample_size(20)
            .warm_up_time(Duration::from_secs(1))
            .measurement_time(Duration::from_secs(3));
        for rods in RODS {
            let leaf = fig04(rods);
            let options = Options {
                tolerance: Some(tolerance),
                ..Options::default()
            };
            let relaxed = || relax(&leaf, &options, &mut |_| {}).expect("a valid request");
            // Only what succeeds is worth timing.
            assert!(relaxed().outcome.is_success());
            group.bench_function(BenchmarkId::from_parameter(rods), |bencher| {
                bencher.iter(relaxed);
            });
        }
    }
}

criterion_group!(benches, benchmark);
criterion_main!(benches);
