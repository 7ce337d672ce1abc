//! One Newton equation of Fig. 4's leaf on 32 segments: rod by rod against
//! all at once, in the same run. `cargo bench --bench linear_solvers`.

use leafdyn::leaf::{DiscreteLeaf, Grid, Leaf, Solved, SparsePattern, State, System};
use leafdyn::relax::start;
use leafdyn::scenario::Scenario;
use std::path::Path;
use std::time::Instant;

const REPEATS: usize = 30;

/// Best time of several runs, in microseconds.
fn time(mut f: impl FnMut()) -> f64 {
    (0..REPEATS)
        .map(|_| {
            let clock = Instant::now();
            f();
            1e6 * clock.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

fn iterations(solved: Solved) -> usize {
    match solved {
        Solved::Yes(iterations) => iterations,
        other => panic!("the leaf at its start is positive definite: {other:?}"),
    }
}

fn main() {
    println!(
        "times in microseconds; rod by rod: factorisation, conjugate gradients to 1e-3 and 1e-10"
    );
    println!("all at once: ordering and symbolic part, numeric part, solution");
    println!(
        "veins assembly |  factor    1e-3 (it)   1e-10 (it) | symbolic   numeric   solve | numeric+solve / factor+1e-10"
    );
    for rods in [5, 10, 21, 35] {
        let entry = [format!("leaf.rods={rods}")];
        let scenario = Scenario::read(Path::new("scenarios/paper/fig04.toml"), &entry)
            .expect("the scenario is valid");
        let model = Leaf::new(&scenario);
        let leaf = DiscreteLeaf::new(&model, Grid::new(32, &[]));
        let state: State = start(&leaf);
        let mut system = System::new(&leaf);
        let assembly = time(|| assert!(leaf.assemble(&state, &mut system).energy.is_finite()));
        let factor = time(|| assert!(system.factorize(0.0)));
        let (mut loose_its, mut tight_its) = (0, 0);
        let loose = time(|| loose_its = iterations(system.solve(None, 1e-3)));
        let tight = time(|| tight_its = iterations(system.solve(None, 1e-10)));
        let symbolic = time(|| drop(SparsePattern::new(&system)));
        let pattern = SparsePattern::new(&system).expect("fits into memory");
        let numeric = time(|| drop(pattern.factorize(&system, 0.0)));
        let mut sparse = pattern.factorize(&system, 0.0).expect("fits into memory");
        let solve = time(|| sparse.solve(&mut system, None));
        println!(
            "{rods:5} {assembly:8.0} | {factor:7.0} {loose:7.0} ({loose_its:2}) {tight:7.0} ({tight_its:2}) | {symbolic:8.0} {numeric:9.0} {solve:7.0} | {:5.1}",
            (numeric + solve) / (factor + tight)
        );
    }
}
