//! The result does not depend on the number of threads, to the last bit.

mod common;

use common::fig04;
use leafdyn::relax::{Equilibrium, Options, relax};
use leafdyn::scenario::Scenario;
use rayon::ThreadPoolBuilder;

fn with_threads(threads: usize, scenario: &Scenario) -> Equilibrium {
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    let options = Options {
        tolerance: Some(1e-8),
        ..Options::default()
    };
    let leaf = pool.install(|| relax(scenario, &options, &mut |_| {}).unwrap());
    assert!(leaf.outcome.is_success());
    leaf
}

fn bits(leaf: &Equilibrium) -> Vec<u64> {
    let nodes = leaf.shape.rods.iter().flat_map(|rod| &rod.nodes);
    nodes
        .flat_map(|node| {
            let mut values = node.rotation.to_array().to_vec();
            for v in [node.position, node.v, node.u, node.n, node.m] {
                values.extend(v.to_array());
            }
            values
        })
        .chain(leaf.accuracy.error_estimate)
        .chain([leaf.energy.unwrap(), leaf.accuracy.residual.unwrap()])
        .map(f64::to_bits)
        .collect()
}

/// 300 veins: from the second grid on they are shared out among threads. The
/// softer leaf has to move far, and more threads than cores change nothing.
#[test]
fn large_leaves_are_equal_bit_by_bit_on_one_two_and_five_threads() {
    let mut soft = fig04(150);
    for rod in &mut soft.rods {
        rod.couple_stiffness[1] = leafdyn::scenario::Profile::Constant(0.05);
    }
    for leaf in [fig04(300), soft] {
        let alone = with_threads(1, &leaf);
        let finest = alone.accuracy.segments.last().unwrap();
        assert!(
            finest * leaf.rods.len() >= 4096,
            "too small to be shared out"
        );
        for threads in [2, 5] {
            let shared = with_threads(threads, &leaf);
            assert_eq!(bits(&shared), bits(&alone), "{threads} threads");
            assert_eq!(shared.work, alone.work);
        }
    }
}
