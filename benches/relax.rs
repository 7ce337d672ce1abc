//! Time to relax Fig. 4's leaf, against the number of veins and the tolerance.
//! One thread, in process, without reading and writing:
//! `cargo bench --bench relax`. The medians are printed as a table at the end.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use leafdyn::relax::relax;
use leafdyn_testing::bench::{figure, on_one_thread, print_head, to};
use std::hint::black_box;
use std::time::{Duration, Instant};

const RODS: [usize; 6] = [5, 10, 15, 21, 28, 35];
const TOLERANCES: [f64; 3] = [1e-4, 1e-6, 1e-8];

fn benchmark(criterion: &mut Criterion) {
    on_one_thread();
    let mut medians = [[None; TOLERANCES.len()]; RODS.len()];
    for (column, tolerance) in TOLERANCES.into_iter().enumerate() {
        let mut group = criterion.benchmark_group(format!("fig04 at {tolerance:e}"));
        group
            .sample_size(20)
            .warm_up_time(Duration::from_secs(1))
            .measurement_time(Duration::from_secs(3));
        for (row, rods) in RODS.into_iter().enumerate() {
            let (leaf, options) = (figure("fig04", rods), to(tolerance));
            let relaxed = || relax(&leaf, &options, &mut |_| {}).expect("a valid request");
            // Only what succeeds is worth timing.
            assert!(relaxed().outcome.is_success());
            let mut samples = Vec::new();
            group.bench_function(BenchmarkId::from_parameter(rods), |bencher| {
                bencher.iter_custom(|runs| {
                    let clock = Instant::now();
                    for _ in 0..runs {
                        black_box(relaxed());
                    }
                    let time = clock.elapsed();
                    samples.push(time.as_secs_f64() / runs as f64);
                    time
                });
            });
            samples.sort_by(f64::total_cmp);
            medians[row][column] = samples.get(samples.len() / 2).copied();
        }
    }
    print_table(&medians);
}

fn print_table(medians: &[[Option<f64>; TOLERANCES.len()]]) {
    println!("Milliseconds, median:\n");
    print_head(&format!(
        "N | {}",
        TOLERANCES.map(|t| format!("{t:e}")).join(" | ")
    ));
    for (rods, row) in RODS.iter().zip(medians) {
        // Not measured if the command line asked for others only.
        let cell =
            |time: &Option<f64>| time.map_or(" - |".into(), |s| format!(" {:.2} |", 1e3 * s));
        println!("| {rods} |{}", row.iter().map(cell).collect::<String>());
    }
}

criterion_group!(benches, benchmark);
criterion_main!(benches);
