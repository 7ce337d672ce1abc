//! Time to relax Fig. 4's leaf, against the number of veins and the tolerance.
//! One thread, in process: `cargo bench --bench relax`.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use leafdyn::relax::{Options, relax};
use leafdyn::scenario::Scenario;
use std::path::Path;
use std::time::Duration;

fn fig04(rods: usize) -> Scenario {
    let rods = [format!("leaf.rods={rods}")];
    Scenario::read(Path::new("scenarios/paper/fig04.toml"), &rods).expect("the scenario is valid")
}

fn benchmark(criterion: &mut Criterion) {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()
        .expect("no thread pool was built before");
    for tolerance in [1e-4, 1e-6, 1e-8] {
        let mut group = criterion.benchmark_group(format!("fig04 at {tolerance:e}"));
        group
            .sample_size(20)
            .measurement_time(Duration::from_secs(3));
        for rods in [5, 10, 15, 21, 28, 35] {
            let leaf = fig04(rods);
            let options = Options {
                tolerance: Some(tolerance),
                ..Options::default()
            };
            group.bench_with_input(BenchmarkId::from_parameter(rods), &leaf, |bencher, leaf| {
                bencher.iter(|| relax(leaf, &options, &mut |_| {}));
            });
        }
    }
}

criterion_group!(benches, benchmark);
criterion_main!(benches);
