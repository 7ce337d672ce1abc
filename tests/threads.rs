//! Results do not depend on the number of threads, to the last bit: neither of
//! relaxation nor of shooting.

mod common;

use common::*;
use leafdyn::internals::bvp::{self, Start};

fn bits_of(numbers: impl IntoIterator<Item = f64>) -> Vec<u64> {
    numbers.into_iter().map(f64::to_bits).collect()
}

/// 600 veins: from the second grid on they are shared out among threads. The
/// softer leaf has to move far, and more threads than cores change nothing.
#[test]
fn large_leaves_are_relaxed_equally_on_one_two_and_five_threads() {
    let mut soft = fig04(300);
    for rod in &mut soft.rods {
        rod.couple_stiffness[1] = Profile::Constant(0.05);
    }
    for leaf in [fig04(600), soft] {
        let on = |threads| on_threads(threads, || settle(&leaf, 1e-8));
        let bits = |leaf: &Equilibrium| {
            let numbers = [leaf.energy, leaf.accuracy.residual].map(Option::unwrap);
            let numbers = bits_of(numbers.into_iter().chain(leaf.accuracy.error_estimate));
            (bits(&leaf.shape.rods), numbers, leaf.work)
        };
        let alone = on(1);
        let finest = alone.accuracy.segments.last().unwrap();
        let nodes = finest * leaf.rods.len();
        assert!(nodes >= 4096, "too small to be shared out");
        for threads in [2, 5] {
            assert_eq!(bits(&on(threads)), bits(&alone), "{threads} threads");
        }
    }
}

/// Many veins over one interval, several veins over many, and a continuation.
#[test]
fn shooting_finds_equal_bits_on_one_two_and_five_threads() {
    let relaxed = |leaf: &Scenario| Some(settle(leaf, 1e-8));
    let many = scenario("paper/fig04", "");
    let soft = scenario("paper/fig08", "leaf.rods=5; load.tip_force=[5, 0, 0]");
    let bent = scenario("paper/fig06", "leaf.rods=5");
    let starts = [relaxed(&many), relaxed(&soft), None];
    for (leaf, start) in [many, soft, bent].iter().zip(&starts) {
        let on = |threads| {
            let start = start.as_ref().map_or(Start::Arcs, |leaf| Start::Leaf {
                stations: &leaf.shape.stations,
                rods: &leaf.shape.rods,
            });
            let stations: Vec<f64> = (0..=16).map(|i| i as f64 / 16.0).collect();
            let precision = bvp::Precision::LocalError(1e-11);
            let options = bvp::Options::new(start, &stations, precision);
            let shot = on_threads(threads, || bvp::solve(leaf, &options, &mut |_| {})).unwrap();
            let errors = [shot.error.position, shot.error.force, shot.defect];
            let numbers = [shot.energy, shot.growth, shot.condition];
            let numbers = errors.into_iter().chain(numbers).chain(shot.intervals);
            let numbers = bits_of(numbers);
            (bits(&shot.rods), numbers, shot.work)
        };
        let alone = on(1);
        assert_eq!(alone.1.len() > 6 + 5, leaf.name == "fig08", "intervals");
        for threads in [2, 5] {
            assert_eq!(on(threads), alone, "{}, {threads}", leaf.name);
        }
    }
}
