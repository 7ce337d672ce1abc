//! A motion is the same to the last bit on any number of threads, whether it
//! is looked at on its way or not, and when it goes on from saved numbers.

mod common;

use common::motion::{explicit, released, semi_implicit};
use common::*;
use leafdyn::internals::leaf::State;
use leafdyn::internals::motion::{Method, Steps};

/// A damped leaf under loads that change.
fn damped(rods: usize) -> Scenario {
    let tilted = "dynamics.gravity={ at = [0.0, 1.0], value = [[0, 0, -1], [0, 1, 0]] }";
    let damped = "coupling.z=2.0; dynamics.internal_damping=0.001";
    scenario(
        "paper/fig04",
        &format!("leaf.rods={rods}; {damped}; {tilted}"),
    )
}

/// Everything about a state, bit by bit.
fn bits(state: &State) -> Vec<u64> {
    let x = state.x.iter().flat_map(|x| x.to_array());
    let q = state.q.iter().flat_map(|q| q.to_array());
    let n = state.n.iter().flat_map(|n| n.to_array());
    x.chain(q).chain(n).map(f64::to_bits).collect()
}

fn methods(leaf: &Leaf, segments: usize) -> [Box<dyn Method>; 2] {
    let state = released(leaf, segments);
    let implicit = semi_implicit(leaf, &state, Steps::Error(1e-4));
    [Box::new(explicit(leaf, &state, None)), Box::new(implicit)]
}

/// Leaves large enough to be shared out.
#[test]
fn on_any_number_of_threads() {
    let leaf = Leaf::new(&damped(30));
    for method in 0..2 {
        let run = |threads: usize| {
            on_threads(threads, || {
                let [explicit, semi_implicit] = methods(&leaf, 300);
                let both = [(explicit, 5e-3), (semi_implicit, 1e-2)];
                let (mut method, until) = both.into_iter().nth(method).unwrap();
                method.advance(until).unwrap();
                assert!(method.steps() > 5, "{}", method.steps());
                (bits(&method.snapshot().state), method.save())
            })
        };
        let one = run(1);
        assert!(run(2) == one && run(3) == one, "method {method}");
    }
}

#[test]
fn looked_at_or_not() {
    let leaf = Leaf::new(&damped(3));
    for (mut looked, mut other) in methods(&leaf, 20).into_iter().zip(methods(&leaf, 20)) {
        for k in 1..=4 {
            looked.advance(0.1 * k as f64).unwrap();
            other.advance(0.1 * k as f64).unwrap();
            let first = bits(&looked.snapshot().state);
            assert_eq!(first, bits(&looked.snapshot().state));
        }
        assert_eq!(looked.save(), other.save());
    }
}
