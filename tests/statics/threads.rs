//! Results do not depend on the number of threads, to the last bit: neither of
//! relaxation, nor of shooting, nor of motion; nor on whether a motion is looked at on its way.

use leafdyn::internals::motion::{Snapshot, StepControl, TimeIntegrator};
use leafdyn::internals::shooting::{self, ShootingStart};
use leafdyn_testing::motion::{explicit, released, semi_implicit};
use leafdyn_testing::*;

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
            let start = start
                .as_ref()
                .map_or(ShootingStart::Arcs, |leaf| ShootingStart::Leaf {
                    stations: &leaf.shape.stations,
                    rods: &leaf.shape.rods,
                });
            let stations: Vec<f64> = (0..=16).map(|i| i as f64 / 16.0).collect();
            let precision = shooting::RequiredPrecision::LocalError(1e-11);
            let options = shooting::ShootingOptions::new(start, &stations, precision);
            let shot =
                on_threads(threads, || shooting::solve(leaf, &options, &mut |_| {})).unwrap();
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

/// A damped leaf under loads that change.
fn damped(rods: usize) -> Scenario {
    let tilted = "dynamics.gravity={ at = [0.0, 1.0], value = [[0, 0, -1], [0, 1, 0]] }";
    let damped = "coupling.z=2.0; dynamics.internal_damping=0.001";
    scenario(
        "paper/fig04",
        &format!("leaf.rods={rods}; {damped}; {tilted}"),
    )
}

/// Everything about a moving leaf, bit by bit.
fn bits_of_snapshot(now: &Snapshot) -> Vec<u64> {
    let state = &now.state;
    let velocities = now.velocity.iter().flat_map(|v| [v.angular, v.linear]);
    let vectors = state.x.iter().chain(&state.n).copied().chain(velocities);
    let numbers = vectors.flat_map(|v| v.to_array());
    let rotations = state.q.iter().flat_map(|q| q.to_array());
    let e = &now.energy;
    let energies = [
        e.kinetic,
        e.elastic,
        e.coupling,
        e.potential,
        e.dissipated,
        e.work,
    ];
    bits_of(numbers.chain(rotations).chain(energies).chain([now.time]))
}

fn methods(leaf: &Leaf, segments: usize) -> [Box<dyn TimeIntegrator>; 2] {
    let state = released(leaf, segments);
    let implicit = semi_implicit(leaf, &state, StepControl::LocalError(1e-4));
    [Box::new(explicit(leaf, &state, None)), Box::new(implicit)]
}

/// Leaves large enough to be shared out.
#[test]
fn motions_are_equal_on_one_two_and_three_threads() {
    let leaf = Leaf::new(&damped(30));
    for method in 0..2 {
        let run = |threads: usize| {
            on_threads(threads, || {
                let [explicit, semi_implicit] = methods(&leaf, 300);
                let both = [(explicit, 5e-3), (semi_implicit, 1e-2)];
                let (mut method, until) = both.into_iter().nth(method).unwrap();
                method.advance(until).unwrap();
                assert!(method.steps() > 5, "{}", method.steps());
                (bits_of_snapshot(&method.snapshot()), method.steps())
            })
        };
        let one = run(1);
        assert!(run(2) == one && run(3) == one, "method {method}");
    }
}

#[test]
fn motions_are_equal_looked_at_or_not() {
    let leaf = Leaf::new(&damped(3));
    for (mut looked, mut other) in methods(&leaf, 20).into_iter().zip(methods(&leaf, 20)) {
        for k in 1..=4 {
            looked.advance(0.1 * k as f64).unwrap();
            other.advance(0.1 * k as f64).unwrap();
            let first = bits_of_snapshot(&looked.snapshot());
            assert_eq!(first, bits_of_snapshot(&looked.snapshot()));
        }
        let [looked, other] =
            [looked, other].map(|mut it| (bits_of_snapshot(&it.snapshot()), it.steps()));
        assert_eq!(looked, other);
    }
}
