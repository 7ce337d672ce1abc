//! A boundary-value solution does not depend on the number of threads, to the
//! last bit.

mod common;

use common::{scenario, settle};
use leafdyn::bvp::{self, Solution, Start};
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::Scenario;
use rayon::ThreadPoolBuilder;

fn with_threads(threads: usize, leaf: &Scenario, relaxed: Option<&Equilibrium>) -> Solution {
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    let start = match relaxed {
        None => Start::Arcs,
        Some(leaf) => Start::Leaf {
            stations: &leaf.shape.stations,
            rods: &leaf.shape.rods,
        },
    };
    let options = bvp::Options {
        tolerance: 1e-11,
        intervals: None,
        stations: (0..=16).map(|i| i as f64 / 16.0).collect(),
    };
    pool.install(|| bvp::solve(leaf, start, &options)).unwrap()
}

fn bits(solution: &Solution) -> Vec<u64> {
    let nodes = solution.rods.iter().flat_map(|rod| &rod.nodes);
    nodes
        .flat_map(|node| {
            let mut values = node.rotation.to_array().to_vec();
            for v in [node.position, node.v, node.u, node.n, node.m] {
                values.extend(v.to_array());
            }
            values
        })
        .chain([solution.error.position, solution.error.force])
        .chain([solution.energy, solution.defect, solution.growth])
        .chain([solution.condition])
        .chain(solution.intervals.iter().copied())
        .map(f64::to_bits)
        .collect()
}

/// Many veins over one interval, several veins over many, and a continuation.
#[test]
fn one_two_and_five_threads_give_equal_bits() {
    let set = |entries: &[&str]| -> Vec<String> { entries.iter().map(|e| e.to_string()).collect() };
    let many = scenario("paper/fig04", &[]);
    let soft = scenario(
        "paper/fig08",
        &set(&["leaf.rods=5", "load.tip_force=[5, 0, 0]"]),
    );
    let bent = scenario("paper/fig06", &set(&["leaf.rods=5"]));
    let relaxed = |leaf: &Scenario| Some(settle(leaf, 1e-8));
    for (leaf, start) in [
        (&many, relaxed(&many)),
        (&soft, relaxed(&soft)),
        (&bent, None),
    ] {
        let alone = with_threads(1, leaf, start.as_ref());
        for threads in [2, 5] {
            let shared = with_threads(threads, leaf, start.as_ref());
            assert_eq!(bits(&shared), bits(&alone), "{}, {threads}", leaf.name);
            assert_eq!(shared.work, alone.work);
        }
    }
    assert!(
        with_threads(1, &soft, relaxed(&soft).as_ref())
            .intervals
            .len()
            > 5
    );
}
